"""Single orbits: what is found, and what is reported of it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from independent import Motion, state_map
from problems import make_one_dof
from repeated import run_through

from nldyn import (
    ConvergenceError,
    Damper,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Stop,
    System,
    Unbalance,
    continue_branch,
    solve_orbit,
)
from nldyn.orbits.orbit import minimal_period, same_orbit

MASS = np.array([[2.0, 0.3], [0.3, 1.0]])
STIFFNESS = np.array([[3e4, -1e4], [-1e4, 2e4]])
DAMPING = np.array([[8.0, -2.0], [-2.0, 5.0]])
INTERFACES = {"first": [1.0, 0.0], "second": [0.0, 1.0]}


def linear_system(**changes) -> System:
    elements = {"excitation": [Unbalance("second", 1e-4, 40.0)], "damping": DAMPING, **changes}
    return System.from_matrices(MASS, STIFFNESS, INTERFACES, **elements)


def two_modes() -> System:
    """Two modes against a stop that is hit twice in a period at 26 Hz."""
    return System.from_modal(
        [13.1, 125.1], {"middle": [0.635, 0.8]}, modal_damping=0.03,
        stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip


@pytest.mark.parametrize("frequency", [3.0, 14.0, 27.0, 80.0])
@pytest.mark.parametrize("observe", ["first", "second"])
def test_orbit_of_a_linear_system_is_its_receptance(frequency, observe):
    omega = 2 * np.pi * frequency
    load = np.array([0.0, 1e-4 * omega**2])
    u = np.linalg.solve(STIFFNESS - omega**2 * MASS + 1j * omega * DAMPING, load)
    orbit = solve_orbit(linear_system(), frequency, observe=observe)
    amplitude = abs(u[0 if observe == "first" else 1])
    assert orbit.max_abs_displacement == pytest.approx(amplitude, rel=1e-12)
    assert (orbit.impacts, orbit.max_penetration, orbit.stable) == (0, 0.0, True)
    assert orbit.frequency_hz == pytest.approx(frequency, rel=1e-14)


def test_multipliers_of_a_linear_system_are_those_of_its_eigenvalues():
    A = np.block(
        [[np.zeros((2, 2)), np.eye(2)],
         [-np.linalg.solve(MASS, STIFFNESS), -np.linalg.solve(MASS, DAMPING)]]
    )  # fmt: skip
    orbit = solve_orbit(linear_system(), 27.0)
    exact = np.exp(np.linalg.eigvals(A) / 27.0)
    np.testing.assert_allclose(
        np.sort_complex(orbit.multipliers), np.sort_complex(exact), rtol=0, atol=1e-12
    )
    assert orbit.largest_multiplier.imag >= 0.0
    assert abs(orbit.largest_multiplier) == pytest.approx(np.abs(exact).max(), rel=1e-12)


def test_stop_out_of_reach_leaves_the_linear_orbit():
    free = solve_orbit(linear_system(), 14.0, observe="first")
    reach = free.max_abs_displacement
    near = linear_system(stops=[Stop("first", 1e9, gap=reach * (1 + 1e-9))])
    orbit = solve_orbit(near, 14.0, observe="first")
    assert orbit.impacts == 0
    assert orbit.max_abs_displacement == pytest.approx(reach, rel=1e-12)
    depth = orbit.penetration_peaks[0].values.max()
    assert depth == pytest.approx(-reach * 1e-9, rel=1e-4)
    touching = linear_system(stops=[Stop("first", 1e9, gap=reach * (1 - 1e-3))])
    assert solve_orbit(touching, 14.0).impacts == 1


CASES = pytest.mark.parametrize(
    ("make", "frequency"),
    [(make_one_dof, 8.0), (make_one_dof, 26.0), (two_modes, 8.0), (two_modes, 26.0)],
)


@CASES
def test_orbit_closes_under_runge_kutta(make, frequency):
    """One period of an independent integration leads back, with the same monodromy matrix."""
    system = make()
    orbit = solve_orbit(system, frequency)
    start = orbit.states(np.array([0.0]))[0]
    end, jacobian, _ = Motion(system).run(start, (0.0, 2 * np.pi), orbit.omega)
    n = system.size
    scale = np.repeat([np.abs(start[:n]).max(), orbit.omega * np.abs(start[:n]).max()], n)
    assert np.abs((end - start) / scale).max() < 3e-8
    L = state_map(system)
    found = np.linalg.solve(L, orbit.monodromy @ L)
    weights = scale[:, None] / scale
    error = np.abs((found - jacobian) / weights).max() / np.abs(jacobian / weights).max()
    assert error < 1e-6
    assert orbit.error < 1e-9


@CASES
def test_reported_extremes_are_those_of_a_dense_history(make, frequency):
    orbit = solve_orbit(make(), frequency)
    history = orbit.history(200_000)
    y, depth = history.displacement["middle"], history.penetration[:, 0]
    assert orbit.max_abs_displacement == pytest.approx(np.abs(y).max(), rel=1e-8)
    assert orbit.max_penetration == pytest.approx(depth.max(), rel=1e-7)
    closings = int(np.sum((depth[:-1] <= 0) & (depth[1:] > 0)))
    assert orbit.impacts == closings > 0
    turns = 1 + np.flatnonzero(np.diff(np.sign(np.diff(depth))))
    found = orbit.extremes(0)
    order = np.argsort(found.phases)
    np.testing.assert_allclose(found.values[order], depth[turns], rtol=0, atol=1e-7 * np.ptp(depth))
    exact = 5.17e9 * np.maximum(depth, 0.0) ** 1.5
    np.testing.assert_allclose(history.force[:, 0], exact, rtol=1e-14)
    deepest = max(impact.penetration for impact in orbit.impact_list)
    assert deepest == orbit.max_penetration
    assert max(i.force for i in orbit.impact_list) == pytest.approx(history.force.max(), rel=1e-6)
    times = [impact.time for impact in orbit.impact_list]
    assert times == sorted(times)
    assert min(times) >= 0.0 and max(times) <= orbit.duration


@pytest.mark.parametrize("elastic", [[], [13.0]])
def test_a_free_body_that_touches_by_rounding_has_no_place(elastic):
    """A push would have to be balanced: only orbits that do not touch, anywhere below the stop."""
    system = System.from_modal(
        [0.0, *elastic],
        {"a": [0.6] * (1 + len(elastic))},
        modal_damping=0.01,
        stops=[Stop("a", 1e9)],
        excitation=[Unbalance("a", 1e-5)],
    )
    with pytest.raises(ConvergenceError, match="nothing tells its place"):
        solve_orbit(system, 20.0)


@pytest.mark.parametrize("against", [None, "b"])
def test_free_bodies_that_no_stop_holds_have_no_place(against):
    """Two bodies, the second free of all stops, or both free but for stops between them."""
    gap = 1e-4 if against else -1e-4
    stops = [Stop("a", 1e6, gap=gap, against=against, direction=side) for side in (1, -1)]
    parts = {"a": [1.0, 0.0], "b": [0.0, 1.0]}
    drive = [HarmonicForce("a", 1.0)]
    system = System.from_modal([0.0, 0.0], parts, stops=stops, excitation=drive)
    with pytest.raises(ConvergenceError, match="no stop limits, and nothing tells its place"):
        solve_orbit(system, 10.0)


def test_a_free_body_held_softly_between_two_stops_has_its_place():
    stops = [Stop("a", 1.0, 1.0, -2.5e-8), Stop("a", 1.0, 1.0, -2.5e-8, direction=-1)]
    system = System.from_modal(
        [0.0],
        {"a": [1.0]},
        stops=stops,
        dampers=[Damper("a", 1.0)],
        excitation=[HarmonicForce("a", 1.0)],
    )
    orbit = solve_orbit(system, 1000.0)
    omega = 2.0 * np.pi * 1000.0  # both springs are held nearly always: a linear oscillator
    assert orbit.max_abs_displacement == pytest.approx(1.0 / omega**2, rel=1e-3)


@CASES
def test_states_within_contacts_are_those_of_a_fine_integration(make, frequency):
    system = make()
    orbit = solve_orbit(system, frequency)
    deepest = max(orbit.impact_list, key=lambda impact: impact.penetration)
    phases = orbit.omega * deepest.time + np.linspace(-3e-3, 3e-3, 13)
    states = orbit.states(phases)
    assert (orbit.penetration(0, phases) > 0.0).any()
    size = np.abs(states).max(axis=0)
    for start, first, last, end in zip(states, phases, phases[1:], states[1:], strict=False):
        found, *_ = Motion(system).run(start, (first, last), orbit.omega)
        assert np.abs((end - found) / size).max() < 2e-9


def test_history_is_periodic_and_starts_at_the_shooting_point():
    orbit = solve_orbit(two_modes(), 26.0)
    history = orbit.history(64)
    assert history.modal.shape == (65, 2)
    assert history.penetration.shape == history.force.shape == (65, 1)
    assert history.time[-1] == pytest.approx(orbit.duration, rel=1e-14)
    np.testing.assert_allclose(history.modal[0], history.modal[-1], rtol=0, atol=1e-15)
    flow = orbit.problem.flow
    start = flow.to_modal(orbit.problem.nodes(orbit.point)[0])
    np.testing.assert_allclose(history.modal[0], start[:2], rtol=1e-12)
    np.testing.assert_allclose(history.modal_velocity[0], start[2:], rtol=1e-12)


def test_systems_and_orbits_can_be_compared_and_be_keys():
    """Each is itself only: their arrays have no single answer to an equality."""
    systems = [two_modes(), two_modes()]
    orbits = [solve_orbit(system, 26.0) for system in systems]
    for first, second in (systems, orbits):
        assert first != second
        assert {first: 1, second: 2}[second] == 2


def test_system_does_not_follow_an_array_that_is_changed_later():
    shape = np.array([0.635])
    system = System.from_modal([13.1], {"middle": shape})
    shape[0] = 9.0
    assert system.participation["middle"].tolist() == [0.635]


def test_number_of_segments_changes_nothing():
    orbits = {}
    for segments in (1, 2, 4, 8):
        orbits[segments] = solve_orbit(two_modes(), 26.0, segments=segments)
    base = orbits[1]
    for orbit in orbits.values():
        assert orbit.max_abs_displacement == pytest.approx(base.max_abs_displacement, rel=1e-9)
        assert orbit.impacts == base.impacts
        np.testing.assert_allclose(orbit.multipliers, base.multipliers, rtol=0, atol=1e-7)


def test_segments_cut_the_simulation_from_rest_too():
    """The drive presses the mass on its stop for half a period: 20000 oscillations there."""
    system = System.from_modal(
        [0.5 / math.pi], {"m": [1.0]}, modal_damping=0.05, stops=[Stop("m", 1e15)],
        excitation=[HarmonicForce("m", 1.0)],
    )  # fmt: skip
    with pytest.raises(ConvergenceError, match="more `segments` of solve_orbit help"):
        solve_orbit(system, 0.45)
    orbit = solve_orbit(system, 0.45, segments=16)
    again = solve_orbit(system, 0.45, guess=orbit.states([0.0])[0], segments=8)
    assert orbit.max_abs_displacement == pytest.approx(again.max_abs_displacement, rel=1e-9)


def test_finer_collocation_changes_multipliers_by_less_than_1e_7():
    base = solve_orbit(two_modes(), 26.0)
    fine = solve_orbit(FlowMap(two_modes(), FlowOptions(nodes=20, tail=1e-7)), 26.0)
    assert base.max_abs_displacement == pytest.approx(fine.max_abs_displacement, rel=1e-9)
    np.testing.assert_allclose(
        np.sort_complex(base.multipliers), np.sort_complex(fine.multipliers), rtol=0, atol=1e-7
    )


def test_guess_at_phase_zero_and_at_all_phases():
    orbit = solve_orbit(make_one_dof(), 26.0)
    at_zero = orbit.states(np.array([0.0]))[0]
    rough = solve_orbit(make_one_dof(), 26.0, guess=at_zero * 1.05)
    assert same_orbit(orbit, rough)
    everywhere = orbit.states(orbit.problem.phases[:-1])
    assert same_orbit(orbit, solve_orbit(make_one_dof(), 26.0, guess=everywhere * 1.05))


def test_unstable_orbit_is_found_from_a_guess():
    """Newton's method does not care: the harmonic orbit at 60 Hz repels, the 1/2 one attracts."""
    orbit = solve_orbit(make_one_dof(), 60.0)
    assert not orbit.stable
    assert orbit.multipliers[0].real < -1.0
    determinant = math.exp(-2 * 0.0142 * math.sqrt(16877.0 / 2.48) / 60.0)
    assert np.prod(orbit.multipliers).real == pytest.approx(determinant, rel=1e-8)


def test_minimal_period_of_an_orbit_run_through_several_times():
    single = solve_orbit(make_one_dof(), 26.0)
    for period in (2, 3, 4):
        several = run_through(single, period)
        assert minimal_period(several) == 1
        expected = single.multipliers**period
        np.testing.assert_allclose(several.multipliers, expected, rtol=0, atol=1e-7)
        assert several.impacts == period * single.impacts
        assert several.duration == pytest.approx(period * single.duration)


def test_orbits_shifted_by_a_period_are_the_same():
    orbit = solve_orbit(make_one_dof(), 50.0, 2)
    assert minimal_period(orbit) == 2
    later = orbit.states(np.array([2 * np.pi]))[0]
    shifted = solve_orbit(make_one_dof(), 50.0, 2, guess=later)
    assert np.abs(orbit.point - shifted.point).max() > 1e-6
    assert same_orbit(orbit, shifted)
    assert not same_orbit(orbit, solve_orbit(make_one_dof(), 50.5, 2))


def test_no_orbit_is_an_error_that_says_how_far_newton_came():
    with pytest.raises(ConvergenceError, match=r"^no orbit of period 1 found at 45 Hz: .+ step"):
        solve_orbit(make_one_dof(), 45.0, guess=np.array([1.0, -300.0]))


@pytest.mark.parametrize("hz", [17.0, 18.0, 19.0, 20.0])
def test_orbit_that_no_motion_from_rest_comes_near_is_found_by_more_damping(hz):
    """A preloaded stop on which the motion goes astray; the branch from 50 Hz has one orbit."""
    system = System.from_matrices(
        [[2.48]], [[16877.0]], {"m": [1.0]}, modal_damping=0.0142,
        stops=[Stop("m", 5.17e9, gap=-2e-6)], excitation=[Unbalance("m", 4.92e-6)],
    )  # fmt: skip
    (expected,) = continue_branch(solve_orbit(system, 50.0), (hz, 50.5)).at(hz)
    found = solve_orbit(system, hz)
    assert found.multipliers == pytest.approx(expected.multipliers, rel=1e-7)
    assert found.point == pytest.approx(expected.point, rel=1e-9, abs=1e-16)


def test_system_without_excitation_rests_at_its_preload():
    """Static balance k x = F(-x - gap) on a stop with a negative gap."""
    system = System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.1, stops=[Stop("m", 1e9, gap=-1e-3)]
    )
    orbit = solve_orbit(system, 7.0)
    x = orbit.history(4).displacement["m"]
    depth = x[0] + 1e-3
    assert 1e9 * depth**1.5 == pytest.approx(-((20 * np.pi) ** 2) * x[0], rel=1e-9)
    assert np.ptp(x) < 1e-15
    assert orbit.impacts == 0
    assert orbit.max_abs_displacement == pytest.approx(abs(x[0]), rel=1e-9)


def test_opposed_preloads_that_never_open_are_a_linear_spring():
    """1/|K + 2k - ω² + icω|, beside preloads that make 1e-10 of it rounding, 225 times a period."""
    stops = [Stop.linear("x", 1e6, gap=-1.0, direction=d) for d in (1, -1)]
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[1.0]], stops=stops,
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    orbit = solve_orbit(system, 1.0, guess=np.zeros(2))
    exact = 1.0 / abs(1.0 + 2e6 - orbit.omega**2 + 1j * orbit.omega)
    assert orbit.max_abs_displacement == pytest.approx(exact, rel=1e-6)
    assert abs(orbit.multipliers) == pytest.approx(math.exp(-0.5), rel=1e-8)


def test_damper_and_both_sides_enter_the_orbit():
    """A symmetric pair of stops has a symmetric orbit: x(t + T/2) = -x(t)."""
    stops = [Stop("middle", 5e9, gap=2e-6), Stop("middle", 5e9, gap=2e-6, direction=-1)]
    system = System.from_modal(
        [13.1], {"middle": [0.635]}, modal_damping=0.02, stops=stops,
        dampers=[Damper("middle", 20.0)], excitation=[HarmonicForce("middle", 0.3)],
    )  # fmt: skip
    orbit = solve_orbit(system, 40.0)
    x = orbit.history(200).displacement["middle"]
    np.testing.assert_allclose(x[100:], -x[:101], rtol=0, atol=1e-8 * np.abs(x).max())
    assert orbit.impacts % 2 == 0 and orbit.impacts > 0


@pytest.mark.parametrize("frequency", [11.0, 17.0])
def test_rate_is_zero_at_an_extreme(frequency):
    largest = 0.0
    for shift in np.linspace(0.0, 1.0, 20):
        orbit = solve_orbit(make_one_dof(), frequency + shift)
        rates = orbit.states(np.sort(orbit.extremes(0).phases))[:, 1]
        fastest = np.abs(orbit.history(200).modal_velocity).max()
        largest = max(largest, np.abs(rates).max() / fastest)
    assert largest < 1e-6


@pytest.mark.parametrize("frequency", [5.0, 20.0, 33.0])
def test_extremes_of_an_undamped_orbit_lie_at_phases_zero_and_pi(frequency):
    system = System.from_matrices(
        [[2.48]], [[16877.0]], {"m": [1.0]}, excitation=[HarmonicForce("m", 1.0)]
    )
    steady = 1.0 / (16877.0 - 2.48 * (2 * np.pi * frequency) ** 2)
    unit = 1.0 / system.participation["m"][0]
    orbit = solve_orbit(system, frequency, guess=np.array([steady * unit, 0.0]))
    found = orbit.observed_extremes
    assert sorted(found.values) == pytest.approx(sorted([steady, -steady]), rel=1e-12)


def test_states_are_periodic_in_the_phase():
    orbit = solve_orbit(make_one_dof(), 26.0)
    phases = np.linspace(0.0, 2 * np.pi, 9)
    np.testing.assert_allclose(
        orbit.states(phases + 2 * np.pi), orbit.states(phases), rtol=0, atol=1e-9
    )


@pytest.mark.parametrize("frequency_hz", [34.0, 40.0, 42.0])
def test_an_unstable_orbit_is_found_beside_the_attractor_of_twice_its_period(frequency_hz):
    orbit = solve_orbit(make_one_dof(), frequency_hz)
    assert orbit.period == 1 and not orbit.stable and orbit.error < 1e-10


@pytest.mark.parametrize("short", [0.1, 1e-2, 1e-3, 1e-4])
def test_extremes_closer_than_the_samples_are_found(short):
    """y = a sin τ + b sin 2τ has y' = 0 where 4b c² + a c = 2b for c = cos τ; with a a little less
    than 2b two of these lie close beside τ = π, nearer to each other than a sample."""
    system = System.from_modal([10.0, 20.0], {"tip": [1.0, 1.0]})
    flow = FlowMap(system)
    natural, b = 20.0 * np.pi, 1e-3
    a = 2.0 * b * (1.0 - short)
    start = flow.to_state(np.array([0.0, 0.0, a * natural, 2.0 * b * natural]))
    motion = flow.trajectory(start[None], np.array([0.0, 2.0 * np.pi]), natural)
    c = (-a + np.array([1.0, -1.0]) * np.sqrt(a * a + 32.0 * b * b)) / (8.0 * b)
    exact = np.sort(np.concatenate([np.arccos(c), 2.0 * np.pi - np.arccos(c)]))
    found = motion.extremes(0)
    assert found[:, 2].tolist() == [1.0, -1.0, 1.0, -1.0]
    phases = found[:, 0]
    np.testing.assert_allclose(phases, exact, atol=1e-7 / np.sqrt(short))
    np.testing.assert_allclose(
        found[:, 1], a * np.sin(exact) + b * np.sin(2.0 * exact), atol=1e-12 * b + 1e-16
    )
