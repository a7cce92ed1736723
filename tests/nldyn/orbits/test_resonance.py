"""Undamped and lightly damped modes excited at, or almost at, their own frequency."""

from __future__ import annotations

from dataclasses import replace

import mpmath as mp
import numpy as np
import pytest
from independent import Motion, exact_flight, state_map
from scipy.optimize import brentq

from nldyn import (
    ConvergenceError,
    Damper,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Parameter,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    find_orbits,
    solve_orbit,
)
from nldyn.system.linear import NEAR

HZ = 10.0
OWN = 2 * np.pi * HZ
FORCE = 3.0
DETUNINGS = (0.0, 1e-14, -1e-12, 1e-10, -1e-8, 1e-6, -1e-4, 1e-3, -2.9e-3, 3.1e-3, 1e-2)
EXACT = FlowOptions(rtol=1e-13)


def one_mode(**changes) -> System:
    elements = {"excitation": [HarmonicForce("m", FORCE)], **changes}
    return System.from_modal([HZ], {"m": [1.0]}, **elements)


def impact_oscillator() -> System:
    return one_mode(stops=[Stop("m", 1e5, gap=5e-3)])


def two_modes(stops: int = 1) -> System:
    """Without damping: excited at 10 or 27 Hz one of its modes has no steady response."""
    both = [Stop("e", 1e5, gap=1e-3), Stop("m", 2e4, 1.0, gap=3e-3, direction=-1)]
    return System.from_modal(
        [HZ, 27.0],
        {"m": [1.0, 0.8], "e": [0.5, -1.0]},
        stops=both[:stops],
        excitation=[HarmonicForce("m", 1.0), Unbalance("e", 1e-4, 40.0)],
    )


def from_rest(omega: float, phase: float) -> mp.matrix:
    """Displacement and velocity of q'' + Ω² q = F cos ωt at a phase, fifty digits.

    q = F t sin(at) sinc(bt)/(2a) with a and b half the sum and the difference of Ω and ω.
    """
    with mp.workdps(50):
        own, omega = mp.mpf(OWN), mp.mpf(omega)
        a, b, t = (own + omega) / 2, (own - omega) / 2, mp.mpf(phase) / omega
        q = t * mp.sin(a * t) * mp.sinc(b * t)
        v = a * t * mp.cos(a * t) * mp.sinc(b * t) + mp.sin(a * t) * mp.cos(b * t)
        return FORCE / (2 * a) * mp.matrix([q, v])


def size(modal: np.ndarray) -> np.ndarray:
    """Sizes by which errors of displacements and velocities count."""
    n = modal.size // 2
    scale = max(np.abs(modal[:n]).max(), np.abs(modal[n:]).max() / OWN)
    return np.repeat([scale, scale * OWN], n)


@pytest.mark.parametrize("detuning", DETUNINGS)
def test_response_from_rest_is_secular(detuning):
    """Also through 40 segments, and where they begin after many turns."""
    omega = OWN * (1.0 + detuning)
    flow = FlowMap(one_mode())
    for phases in ([0.0, 7.0], np.linspace(0.0, 40.0, 41)):
        found = flow.shoot(np.zeros((1, 2)), np.array(phases), omega, chained=True)
        exact = np.array([float(x) for x in from_rest(omega, phases[-1])])
        error = np.abs(flow.to_modal(found.ends[-1]) - exact) / size(exact)
        assert error.max() < (2e-14 if abs(detuning) < NEAR else 2e-13)


@pytest.mark.parametrize("detuning", DETUNINGS)
def test_derivative_of_the_response_with_respect_to_frequency_and_force(detuning):
    omega, phase = OWN * (1.0 + detuning), 7.0
    flow = FlowMap(one_mode())
    found = flow.shoot(
        np.zeros((1, 2)), np.array([0.0, phase]), omega, parameters=[Parameter("amplitude")]
    )
    with mp.workdps(50):
        h = mp.mpf(10) ** -12 * omega
        slope = (from_rest(omega + h, phase) - from_rest(omega - h, phase)) / (2 * h)
    exact = np.array([float(x) for x in slope])
    error = np.abs(flow.to_modal(found.d_omega[0]) - exact) / size(exact)
    assert error.max() < (1e-13 if abs(detuning) < NEAR else 1e-10)
    by_force = found.d_parameters[0, :, 0] * FORCE
    assert by_force == pytest.approx(found.ends[0], rel=1e-13)


SYSTEMS = {
    "repeated frequency": ([HZ, HZ, 31.0], {}),
    "all modes alike": ([HZ, HZ, HZ], {}),
    "free body": ([0.0, HZ, 31.0], {}),
    "nearly repeated": ([HZ, HZ * (1 + 1e-9), HZ * (1 - 1e-3)], {}),
    "lightly damped": ([HZ, HZ, 31.0], {"modal_damping": [1e-6, 1e-3, 1e-2]}),
    "damper at a node of the mode": ([HZ, 22.0, 31.0], {"dampers": [Damper("node", 5.0)]}),
}


@pytest.mark.parametrize("detuning", (0.0, 1e-9, -1e-3))
@pytest.mark.parametrize("name", SYSTEMS)
def test_flight_at_resonance_is_the_matrix_exponential(name, detuning):
    frequencies, changes = SYSTEMS[name]
    system = System.from_modal(
        frequencies,
        {"m": [1.0, 0.7, -0.4], "node": [0.0, 0.6, 0.9]},
        excitation=[HarmonicForce("m", FORCE, 20.0), Unbalance("m", 1e-3)],
        **changes,
    )
    flow, omega, phases = FlowMap(system), OWN * (1.0 + detuning), (5.9, 5.9 + 2.6 * np.pi)
    x0 = np.array([1e-3, -2e-3, 5e-4, 0.1, 0.2, -0.1])
    exact, exact_jacobian = exact_flight(system, x0, phases, omega)
    found = flow.shoot(flow.to_state(x0)[None], np.array(phases), omega)
    error = np.abs(flow.to_modal(found.ends[0]) - exact) / size(exact)
    assert error.max() < 1e-12
    L = state_map(system)
    jacobian = np.linalg.solve(L, found.jacobians[0] @ L)
    assert np.abs(jacobian - exact_jacobian).max() < 1e-12 * np.abs(exact_jacobian).max()
    h = 1e-3 * omega
    ends = [exact_flight(system, x0, phases, omega + k * h)[0] for k in (-3, -2, -1, 1, 2, 3)]
    slope = np.array([-1, 9, -45, 45, -9, 1]) @ np.array(ends) / (60 * h)
    error = np.abs(flow.to_modal(found.d_omega[0]) - slope) / size(slope)
    assert error.max() < 1e-8


@pytest.mark.parametrize(
    ("hz", "detuning"),
    [(HZ, 0.0), (HZ, 1e-9), (HZ, 1e-2), (27.0, 1e-14), (27.0, -1e-5), (27.0, 2e-3)],
)
def test_contacts_at_resonance_agree_with_runge_kutta(hz, detuning):
    system = two_modes(stops=2)
    flow, omega = FlowMap(system, EXACT), 2 * np.pi * hz * (1.0 + detuning)
    x0, phases = np.array([1e-3, 5e-4, 0.05, 0.3]), (0.3, 0.3 + 3.0 * np.pi)
    exact, *_ = Motion(system).run(x0, phases, omega)
    found = flow.shoot(flow.to_state(x0)[None], np.array(phases), omega)
    assert found.closings.any()
    error = np.abs(flow.to_modal(found.ends[0]) - exact) / size(exact)
    assert error.max() < 1e-11
    L = state_map(system)
    jacobian = np.linalg.solve(L, found.jacobians[0] @ L)

    def agrees(max_step):
        _, exact, _ = Motion(system).run(x0, phases, omega, max_step=max_step)
        return np.abs(jacobian - exact).max() < 1e-9 * np.abs(exact).max()

    # one in ten or so errs by more, where a step of it happens to go far over a contact's end
    assert any(agrees(max_step) for max_step in (0.05, 0.03, 0.015, 0.01))
    assert np.linalg.det(found.jacobians[0]) == pytest.approx(1.0, abs=1e-11)  # Liouville


def test_where_the_steady_response_takes_over_nothing_jumps():
    """Ends on both sides of the change agree to rounding, derivatives to nine digits."""
    flow = FlowMap(two_modes(stops=2), EXACT)
    start = flow.to_state(np.array([[1e-3, 5e-4, 0.05, 0.3]]))
    for sign in (-1.0, 1.0):
        edge = OWN / (1.0 + sign * NEAR)  # |Ω - ω| = NEAR ω
        sides = [edge * (1.0 + step) for step in (-1e-14, 1e-14)]
        found = [flow.shoot(start, np.array([0.3, 7.0]), omega) for omega in sides]
        near = [flow.system.response(omega).terms.kinds.size for omega in sides]
        assert sorted(near) == [0, 1]
        scale = np.abs(found[0].ends).max()
        assert np.abs(found[1].ends - found[0].ends).max() < 1e-12 * scale
        slope = np.abs(found[0].d_omega).max()
        assert np.abs(found[1].d_omega - found[0].d_omega).max() < 1e-9 * slope


EVERY = [
    *(Parameter(name, 0) for name in ("gap", "stiffness", "exponent", "dissipation")),
    Parameter("gap", 1), Parameter("amplitude", 0), Parameter("mass_times_radius", 1),
]  # fmt: skip


def test_derivatives_through_contacts_are_the_limits_of_differences():
    """With a force that depends on the speed, and phases fixed beyond a whole turn."""
    plain = two_modes(stops=2)
    system = replace(plain, stops=(replace(plain.stops[0], dissipation=0.5), plain.stops[1]))
    phases = np.array([5.5, 5.5 + 3.0 * np.pi])
    start = FlowMap(system).to_state(np.array([[1e-3, 5e-4, 0.05, 0.3]]))

    def end(changed: System, omega: float) -> np.ndarray:
        return FlowMap(changed, EXACT).shoot(start, phases, omega, sensitivities=False).ends[0]

    found = FlowMap(system, EXACT).shoot(start, phases, OWN, parameters=EVERY)
    assert found.closings.min() > 0
    h = 1e-5 * OWN
    slope = (end(system, OWN + h) - end(system, OWN - h)) / (2 * h)
    assert np.abs(found.d_omega[0] - slope).max() < 1e-5 * np.abs(slope).max()
    for column, parameter in enumerate(EVERY):
        kind = "excitation" if parameter.name in ("amplitude", "mass_times_radius") else "stops"
        elements = list(getattr(system, kind))
        element = elements[parameter.index]
        value = getattr(element, parameter.name)
        ends = []
        for factor in (1.0 + 1e-5, 1.0 - 1e-5):
            elements[parameter.index] = replace(element, **{parameter.name: value * factor})
            ends.append(end(replace(system, **{kind: tuple(elements)}), OWN))
        slope = (ends[0] - ends[1]) / (2e-5 * value)
        exact = found.d_parameters[0, :, column]
        assert np.abs(exact - slope).max() < 1e-5 * np.abs(slope).max(), parameter


def growing_maximum(number: int) -> float:
    """Phase of a maximum of φ sin φ, counted from zero."""
    low = 2 * np.pi * number
    return brentq(lambda x: np.sin(x) + x * np.cos(x), low + 0.5 * np.pi, low + np.pi, xtol=1e-15)


@pytest.mark.parametrize(("share", "closings"), [(1.0 + 1e-9, 0), (1.0 - 1e-9, 1)])
def test_no_contact_of_a_growing_motion_is_passed_over(share, closings):
    """In one segment of twenty periods only the last maximum reaches the stop, if any."""
    top = growing_maximum(19)
    gap = share * FORCE * top * np.sin(top) / (2 * OWN**2)
    system = one_mode(stops=[Stop("m", 1e5, gap=gap)])
    found = FlowMap(system).shoot(np.zeros((1, 2)), np.array([0.0, 40 * np.pi]), OWN)
    assert found.closings.tolist() == [closings]


def test_recorded_motion_is_the_secular_response():
    flow = FlowMap(one_mode())
    cuts = np.array([0.0, 5.5, 11.0, 20.0])
    nodes = flow.to_state(np.array([[float(x) for x in from_rest(OWN, c)] for c in cuts[:3]]))
    motion = flow.trajectory(nodes, cuts, OWN)
    phases = np.linspace(0.0, 20.0, 57)
    exact = FORCE * phases * np.sin(phases) / (2 * OWN**2)
    found = flow.to_modal(motion.states(phases))[:, 0]
    assert np.abs(found - exact).max() < 1e-14 * np.abs(exact).max()
    maxima = [p for p in motion.extremes(0) if p[2] > 0.0][-3:]
    for number, (phase, value, _) in enumerate(maxima):
        top = growing_maximum(number)
        assert phase == pytest.approx(top, rel=1e-8)
        assert value == pytest.approx(FORCE * top * np.sin(top) / (2 * OWN**2), rel=1e-13)


@pytest.mark.parametrize("make", (impact_oscillator, two_modes))
@pytest.mark.parametrize("detuning", (0.0, 1e-13, -1e-7, 1e-3))
def test_orbit_at_resonance_is_periodic(make, detuning):
    system = make()
    orbit = solve_orbit(system, HZ * (1.0 + detuning))
    assert orbit.impacts > 0
    start = orbit.states(np.array([0.0]))[0]
    end, jacobian, _ = Motion(system).run(start, (0.0, 2 * np.pi), orbit.omega)
    assert np.abs((end - start) / size(start)).max() < 1e-9
    values = np.sort_complex(np.linalg.eigvals(jacobian))
    assert np.sort_complex(orbit.multipliers) == pytest.approx(values, abs=1e-6)
    assert orbit.liouville_error < 1e-11
    middle = orbit.states(np.array([2.0, 4.0]))
    for phase, state in zip((2.0, 4.0), middle, strict=True):
        exact, *_ = Motion(system).run(start, (0.0, phase), orbit.omega, tangent=False)
        assert np.abs((state - exact) / size(start)).max() < 1e-9


@pytest.mark.parametrize("make", (impact_oscillator, two_modes))
def test_branch_passes_the_resonance(make):
    orbit = solve_orbit(make(), 0.97 * HZ)
    branch = continue_branch(orbit, (0.97 * HZ, 1.03 * HZ))
    assert "end of the frequency range" in branch.stop_reason
    points = branch.points
    frequencies = np.array([point.frequency_hz for point in points])
    assert frequencies.min() < 0.98 * HZ and frequencies.max() > 1.02 * HZ
    assert max(point.liouville_error for point in points) < 1e-11
    at = solve_orbit(make(), HZ)
    heights = np.array([point.max_abs_displacement for point in points])
    around = np.argsort(np.abs(frequencies - HZ))[:2]
    assert heights[around].min() * 0.99 < at.max_abs_displacement < heights[around].max() * 1.01


def test_search_finds_the_orbit_at_resonance():
    system = impact_oscillator()
    height = solve_orbit(system, HZ).max_abs_displacement
    found = [orbit.max_abs_displacement for orbit in find_orbits(system, HZ, period=1)]
    assert any(other == pytest.approx(height, rel=1e-9) for other in found)


def test_search_finds_an_orbit_on_two_stops():
    """Motion from rest does not lead to it: it never settles."""
    system = two_modes(stops=2)
    orbit = find_orbits(system, HZ, period=1)[0]
    assert orbit.trajectory.closings.min() > 0
    start = orbit.states(np.array([0.0]))[0]
    end, *_ = Motion(system).run(start, (0.0, 2 * np.pi), orbit.omega, tangent=False)
    assert np.abs((end - start) / size(start)).max() < 1e-9


@pytest.mark.parametrize("find", (solve_orbit, lambda s, hz: find_orbits(s, hz, 1)))
def test_without_stops_the_resonance_is_refused(find):
    with pytest.raises(SystemModelError, match=r"10 Hz meets an undamped mode exactly"):
        find(one_mode(), HZ)


def test_out_of_reach_of_the_stops_there_is_no_orbit_at_resonance():
    system = one_mode(stops=[Stop("m", 1e5, gap=1e3)])
    with pytest.raises(ConvergenceError, match=r"10 Hz.*undamped mode.*without bound") as caught:
        solve_orbit(system, HZ)
    assert "\n" not in str(caught.value)
    assert find_orbits(system, HZ, period=1) == []


def test_a_resonant_mode_that_nothing_excites_does_no_harm():
    """Its free vibration has the forcing's period: the other mode's response remains."""
    system = System.from_modal(
        [HZ, 25.0], {"m": [0.0, 1.0]}, excitation=[HarmonicForce("m", FORCE)]
    )
    steady = FlowMap(system).to_modal(system.steady(OWN))
    assert steady[1] == pytest.approx(FORCE / ((2 * np.pi * 25.0) ** 2 - OWN**2), rel=1e-13)
    found = FlowMap(system).shoot(system.steady(OWN)[None], np.array([0.0, 2 * np.pi]), OWN)
    assert found.ends[0] == pytest.approx(system.steady(OWN), rel=1e-13)


def test_no_torus_is_invented_where_all_multipliers_lie_on_the_unit_circle():
    """Two undamped modes: the torus test vanishes along the whole branch."""
    system = System.from_modal(
        [10.0, 27.0],
        {"tip": [1.0, 0.8]},
        modal_damping=0.0,
        stops=[Stop("tip", 1e8, gap=0.0)],
        excitation=[HarmonicForce("tip", 1.0)],
    )
    orbit = find_orbits(system, 12.0, 1)[0]
    branch = continue_branch(orbit, (11.8, 12.2))
    assert len(branch.points) > 3
    assert "NS" not in {special.kind for special in branch.special_points}
