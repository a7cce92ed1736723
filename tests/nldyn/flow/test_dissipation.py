"""Contacts that dissipate, and laws of the user's own."""

from __future__ import annotations

import math

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from independent import Motion
from problems import make_one_dof
from scipy.optimize import brentq

from nldyn import (
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    dissipation_for,
    solve_orbit,
)

OMEGA = 2 * np.pi * 10.0


def rebound(speed: float, loss: float) -> float:
    """Speed after a free impact with F = k δ^p (1 + a v), from m v dv = -F dδ (exact).

    Both speeds have the same v/a - ln(1 + a v)/a².
    """

    def spent(v):
        return v / loss - math.log1p(loss * v) / loss**2

    lowest = -(1.0 - 1e-15) / loss
    return brentq(lambda v: spent(v) - spent(speed), max(lowest, -speed * (1 + 1e-9)), -1e-9)


MASS = 2.0


def free_mass(stop: Stop) -> FlowMap:
    return FlowMap(System.from_matrices([[MASS]], [[0.0]], {"m": [1.0]}, stops=[stop]))


def moving(flow: FlowMap, speed: float) -> np.ndarray:
    """State of a mass that is about to hit."""
    return flow.to_state(np.array([0.0, speed * math.sqrt(MASS)]))


@given(
    st.floats(-3.0, 0.5), st.floats(0.01, 0.9), st.sampled_from([1.0, 1.5, 2.0]),
    st.floats(4.0, 9.0),
)  # fmt: skip
def test_a_free_impact_loses_what_its_first_integral_says(log_speed, share, exponent, log_k):
    speed = 10.0**log_speed
    loss = share / speed
    flow = free_mass(Stop("m", 10.0**log_k, exponent, dissipation=loss))
    start = moving(flow, speed)
    duration = 12.0 * (2.0 / 10.0**log_k / speed ** (exponent - 1.0)) ** (1.0 / (exponent + 1.0))
    found = flow.shoot(start[None], np.array([0.0, OMEGA * duration]), OMEGA)
    assert not found.failure and found.closings.tolist() == [1]
    ratio = flow.to_modal(found.ends[0])[1] / flow.to_modal(start)[1]
    assert ratio == pytest.approx(rebound(speed, loss) / speed, rel=2e-9)


def test_speed_after_an_impact_depends_on_that_before_as_the_first_integral_says():
    """d v1/d v0 = (v0/v1) (1 + a v1)/(1 + a v0)."""
    flow = free_mass(Stop("m", 5e9, dissipation=3.0))
    v0 = 0.1
    found = flow.shoot(moving(flow, v0)[None], np.array([0.0, OMEGA * 0.02]), OMEGA)
    v1 = flow.to_modal(found.ends[0])[1] / math.sqrt(MASS)
    basis = flow.system.linear
    jacobian = basis.right @ found.jacobians[0] @ basis.left
    exact = v0 / v1 * (1 + 3.0 * v1) / (1 + 3.0 * v0)
    assert jacobian[1, 1] == pytest.approx(exact, rel=1e-8)


@pytest.mark.parametrize(
    "restitution", [1.0, 1.0 - 1e-9, 1.0 - 1e-5, 0.99999, 0.9, 0.7, 0.5, 0.1, 0.02, 1e-3, 1e-12]
)
def test_a_free_body_rebounds_with_the_restitution_asked_for(restitution):
    """Against the first integral solved for the rebound, with fifty digits."""
    speed = 0.2
    loss = dissipation_for(restitution, speed)
    if restitution == 1.0:
        assert loss == 0.0
        return
    with mp.workdps(50):
        x = mp.mpf(loss) * speed
        after = 1 + mp.lambertw(-(1 + x) * mp.exp(-1 - x)).real  # u e^-u is kept, u = 1 + a v
        lost = 1 - after / x
        # 1 - e is known to rounding of e
        allowed = 1e-9 * (1.0 - restitution) + 1e-15
        assert abs(float(lost - (1 - mp.mpf(restitution)))) <= allowed


def test_published_laws_meet_the_restitution_to_second_order():
    for law in ("lankarani-nikravesh", "hunt-crossley"):
        for e in (0.99, 0.97):
            loss = dissipation_for(e, 0.2, law=law)
            assert -rebound(0.2, loss) / 0.2 == pytest.approx(e, abs=2.0 * (1 - e) ** 2)


@pytest.mark.parametrize("law, met", [("lankarani-nikravesh", 0.725), ("hunt-crossley", 0.663)])
def test_published_laws_lose_too_little_at_a_restitution_of_one_half(law, met):
    """As the docs say."""
    assert -rebound(0.2, dissipation_for(0.5, 0.2, law=law)) / 0.2 == pytest.approx(met, abs=5e-4)


def three_modes(*stops: Stop) -> System:
    return System.from_modal(
        [13.1, 117.5, 326.5],
        {"middle": [0.63, 0.45, 0.5], "end": [0.2, -0.7, 0.4]},
        modal_damping=0.01,
        stops=list(stops),
    )


def stiffening(delta, speed):
    """Hertz and a cubic term with a loss."""
    root, lossy = math.sqrt(delta), 1.0 + 30.0 * speed
    force = 2e9 * delta * root + 1e14 * delta**3 * lossy
    return force, 3e9 * root + 3e14 * delta**2 * lossy, 3e15 * delta**3


LOSSY = [
    (Stop("middle", 5e9, dissipation=5.0, gap=1e-6),),
    (Stop("middle", 5e9, dissipation=2.0), Stop("end", 1e6, 1.0, gap=-2e-6, direction=-1)),
    (Stop("middle", 5e9, dissipation=2.0, against="end"), Stop("end", 3e9, dissipation=4.0)),
    (Stop("end", 3e9, dissipation=4.0, gap=1e-6), Stop("middle", 2e9, law=stiffening)),
]
AS_TWO = Stop("middle", 2e9), Stop("middle", 1e14, 3.0, dissipation=30.0)


@pytest.mark.parametrize("stops", LOSSY)
def test_lossy_stops_against_runge_kutta(stops):
    system = three_modes(*stops)
    same = three_modes(stops[0], *AS_TWO) if stops[-1].law else system
    x0 = np.array([-2e-6, 1e-6, 0.0, 4e-3, 1e-3, 2e-3])
    phases = (0.0, 0.6)
    exact, exact_jacobian, closings = Motion(same).run(x0, phases, OMEGA, max_step=0.005)
    flow = FlowMap(system)
    found = flow.shoot(flow.to_state(x0)[None], np.array(phases), OMEGA)
    assert found.closings.tolist() == closings[: len(stops)]
    basis = system.linear
    weights = np.repeat([np.abs(exact[:3]).max(), np.abs(exact[3:]).max()], 3)
    assert flow.to_modal(found.ends[0]) / weights == pytest.approx(exact / weights, abs=1e-9)
    units = weights / weights[:, None]
    jacobian = basis.right @ found.jacobians[0] @ basis.left * units
    size = np.abs(exact_jacobian * units).max()
    assert np.abs(jacobian - exact_jacobian * units).max() < 1e-8 * size


def test_a_law_of_ones_own_that_is_hertzs_gives_the_same_orbit():
    def hertz(delta, speed):
        return 5.17e9 * delta**1.5, 1.5 * 5.17e9 * delta**0.5, 0.0

    known = solve_orbit(make_one_dof(), 26.0)
    own = solve_orbit(make_one_dof(stops=[Stop("middle", 5.17e9, law=hertz)]), 26.0)
    assert own.max_abs_displacement == pytest.approx(known.max_abs_displacement, rel=1e-10)
    assert own.multipliers == pytest.approx(known.multipliers, rel=1e-8)


def test_the_work_of_the_force_is_what_dampers_and_contacts_take():
    system = make_one_dof(stops=[Stop("middle", 5.17e9, dissipation=4.0)])
    orbit = solve_orbit(FlowMap(system, FlowOptions(rtol=1e-12)), 26.0)
    phi = system.participation["middle"]
    # smooth parts by the trapezoidal rule over a period, the contact by its own quadrature
    phases, weights = orbit.trajectory.contact_quadrature()
    states = orbit.states(phases)
    stop = system.stops[0]
    delta, speed = states[:, :1] @ phi - stop.gap, states[:, 1:] @ phi
    loss = float(weights @ (speed * stop.force(delta, speed)))
    energy_change = loss
    grid = np.linspace(0.0, 2 * np.pi, 200001)
    v = orbit.states(grid)[:, 1:] @ phi
    force = system.excitation[0].mass_times_radius * orbit.omega**2 * np.cos(grid)
    damping = float(system.total_damping[0, 0] / phi[0] ** 2)
    power = force * v - damping * v**2
    energy_change -= np.trapezoid(power, grid) / orbit.omega
    assert loss > 0.0
    assert abs(energy_change) < 1e-6 * loss


def test_the_largest_force_of_a_lossy_impact_comes_before_the_deepest_point():
    orbit = solve_orbit(make_one_dof(stops=[Stop("middle", 5.17e9, dissipation=8.0)]), 26.0)
    (impact,) = orbit.impact_list
    stop = orbit.system.stops[0]
    assert impact.force > stop.force(impact.penetration)
    around = np.linspace(-0.05, 0.0, 20001) + impact.time * orbit.omega
    states = orbit.states(around)
    phi = orbit.system.participation["middle"]
    sampled = stop.force(states[:, :1] @ phi, states[:, 1:] @ phi)
    assert impact.force == pytest.approx(sampled.max(), rel=1e-6)


@pytest.mark.parametrize("loss", [pytest.param(2000.0, marks=pytest.mark.slow), 1e4])
def test_an_orbit_with_a_stop_that_is_all_but_a_dashpot_is_found(loss):
    """The contact creeps; panels remembered from the step before must not keep Newton going."""
    system = System.from_matrices(
        [[1.0]], [[(20 * np.pi) ** 2]], {"a": [1.0]}, modal_damping=0.02,
        stops=[Stop("a", 1e8, 1.5, dissipation=loss)], excitation=[HarmonicForce("a", 1.0)],
    )  # fmt: skip
    state = np.array([-0.00010089, 0.02278614])  # of the strongest loss, by simulation with LSODA
    for guess in (None, state):
        orbit = solve_orbit(system, 12.0, guess=guess)
        exact, *_ = Motion(system).run(
            orbit.states(np.zeros(1))[0], (0.0, 2 * np.pi), orbit.omega, max_step=0.002
        )
        assert orbit.states(np.zeros(1))[0] == pytest.approx(exact, rel=1e-8)


def test_laws_that_cannot_be_used_are_refused():
    def wrong_slope(delta, speed):
        return delta**1.5, delta**0.5, 0.0

    def dashpot(delta, speed):
        return delta + 3.0 * speed, 1.0, 3.0

    def not_a_number(delta, speed):
        return math.nan, 1.0, 0.0

    for law, words in (
        (wrong_slope, "derivative by the penetration"),
        (dashpot, "vanish with the penetration; .* is `dashpot` of a linear stop"),
        (not_a_number, "not finite"),
        (lambda delta: delta, "three numbers"),
    ):
        with pytest.raises(SystemModelError, match=words):
            Stop("middle", 1.0, law=law)
    with pytest.raises(SystemModelError, match="either dissipation or a law"):
        Stop("middle", 1.0, dissipation=1.0, law=wrong_slope)
    with pytest.raises(SystemModelError, match="dissipation must not be negative"):
        Stop("middle", 1.0, dissipation=-1.0)
    for arguments in ((1.1, 0.1), (0.0, 0.1), (0.9, 0.0)):
        with pytest.raises(SystemModelError, match="dissipation_for"):
            dissipation_for(*arguments)


def test_a_law_that_cannot_be_compiled_says_so():
    table = {"k": 5e9}

    def from_a_table(delta, speed):
        return table["k"] * delta**1.5, 1.5 * table["k"] * delta**0.5, 0.0

    system = make_one_dof(stops=[Stop("middle", 5e9, law=from_a_table)])
    with pytest.raises(SystemModelError, match="'from_a_table' cannot be compiled"):
        solve_orbit(system, 26.0)


def test_law_may_give_whole_numbers():
    def whole(delta, speed):
        return 10**6 * delta, 10**6, 0

    own = Stop("m", 1e6, exponent=1.0, gap=-1e-5, law=whole)
    linear = Stop("m", 1e6, exponent=1.0, gap=-1e-5)
    ends = []
    for stop in (own, linear):
        system = System.from_modal([13.1], {"m": [0.6]}, modal_damping=0.01, stops=[stop])
        ends.append(FlowMap(system).shoot(np.zeros((1, 2)), np.array([0.0, 6.0]), 80.0).ends)
    assert np.abs(ends[0] - ends[1]).max() <= 1e-12 * np.abs(ends[1]).max()


def bilinear(delta, speed):
    if delta < 2e-5:
        return 1e6 * delta, 1e6, 0.0
    return 20.0 + 5e6 * (delta - 2e-5), 5e6, 0.0


def test_law_with_a_kink_is_refused():
    with pytest.raises(SystemModelError, match="not smooth: its derivative by the penetration"):
        Stop("m", 1e6, exponent=1.0, law=bilinear)


@pytest.mark.parametrize("steepness", [1e4, 3e6])
def test_smooth_law_is_not_taken_for_one_with_a_kink(steepness):
    def stiffening(delta, speed):
        rise = math.expm1(min(steepness * delta, 200.0))
        return 1e6 / steepness * rise, 1e6 * (rise + 1.0), 0.0

    assert Stop("m", 1e6, exponent=1.0, law=stiffening).law is stiffening


def test_a_slope_by_speed_that_is_nothing_but_rounding_does_not_shorten_panels():
    def brake(depth, speed):  # beyond a speed of 8 the slope by speed is 1 - 1 but for rounding
        share = math.tanh(2.4 * speed)
        force = 4e5 * depth * (1.0 + 0.5 * share)
        return force, 4e5 * (1.0 + 0.5 * share), 4.8e5 * depth * (1.0 - share * share)

    system = System.from_modal(
        [10.0], {"a": [1.0]}, modal_damping=0.01, stops=[Stop("a", 4e5, 1.0, law=brake)]
    )
    pieces = []
    for rtol in (1e-9, 1e-13):
        flow = FlowMap(system, FlowOptions(rtol=rtol))
        start = flow.to_state(np.array([-1e-3, 6.5]))[None]
        pieces.append(flow.trajectory(start, np.array([0.0, 2.0 * np.pi]), 300.0).record.kind.size)
    assert max(pieces) < 20


@pytest.mark.parametrize("exponent", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("loss", [35.0, 1e3, 1e5, 1e8])
def test_an_impact_that_all_but_sticks_leaves_at_the_speed_of_the_dashpot(loss, exponent):
    """At 1 m/s. By the first integral u = 1 + a v has the same u e^-u before and after, so that
    the body leaves at -1/a to rounding; and v/a - ln(1 + a v)/a² = k d^(p + 1)/((p + 1) m) where
    it turns, at the depth d.
    """
    stiffness = 1e9
    flow = free_mass(Stop("m", stiffness, exponent, dissipation=loss))
    spent = 1.0 / loss - math.log1p(loss) / loss**2
    deepest = ((exponent + 1.0) * spent * MASS / stiffness) ** (1.0 / (exponent + 1.0))
    omega = 2.0 * np.pi / (1.5 * loss * deepest)
    motion = flow.trajectory(moving(flow, 1.0)[None], np.array([0.0, 2.0 * np.pi]), omega)
    assert not motion.failure
    assert motion.record.kind.size < 200
    end = motion.states(np.array([2.0 * np.pi]))
    depth, speed = flow.to_modal(end)[0] / math.sqrt(MASS)
    assert depth < 0.0  # it has left
    assert speed == pytest.approx(-1.0 / loss, rel=1e-8)
    assert motion.extremes(0)[:, 1].max() == pytest.approx(deepest, rel=1e-8)


@pytest.mark.parametrize("depth", [1e-5, 1e-4])
@pytest.mark.parametrize("loss", [5.0, 100.0])
@pytest.mark.parametrize("speed", [0.0, -0.5, -2.0])
def test_creep_in_a_stop_forgets_its_initial_speed(loss, depth, speed):
    """A linear stop: u = 1 + a δ' falls with the rate k a d/m, so that it ends at δ' = -1/a; what
    the initial speed has added to the depth until then is m/(k a d) of it.
    """
    stiffness, some = 1e12, 0.2
    flow = free_mass(Stop("m", stiffness, 1.0, dissipation=loss))
    start = flow.to_state(np.array([depth, speed / loss]) * math.sqrt(MASS))[None]
    duration = some * depth * loss
    found = flow.shoot(start, np.array([0.0, 2.0 * np.pi]), 2.0 * np.pi / duration)
    assert not found.failure
    end = flow.to_modal(found.ends)[0] / math.sqrt(MASS)
    assert end[1] == pytest.approx(-1.0 / loss, rel=1e-6)
    sooner = MASS / (stiffness * loss * depth)
    expected = (1.0 - some) * depth + (1.0 + speed) / loss * sooner
    assert end[0] == pytest.approx(expected, abs=0.1 * sooner / loss + 1e-9 * depth)
    right, left = flow.to_modal(np.eye(2)).T, flow.to_state(np.eye(2)).T
    jacobian = right @ found.jacobians[0] @ left
    slope = sooner / (loss * depth)  # of what is added, by the depth
    assert jacobian[0, 0] == pytest.approx(1.0 - (1.0 + speed) * slope, abs=0.2 * slope)
    assert jacobian[0, 1] == pytest.approx(sooner, rel=0.05)
    assert abs(jacobian[1, 0]) * duration < 1e-6
    assert abs(jacobian[1, 1]) < 1e-6


def test_the_derivative_by_the_frequency_holds_while_a_stop_holds_the_body():
    """Where the segment ends, 1 + a δ' is rounding: the force is told by the panel before it."""
    system = System.from_modal(
        [50.0], {"a": [0.5]}, modal_damping=0.01, stops=[Stop("a", 2.4e8, 1.0, dissipation=4e5)],
        excitation=[HarmonicForce("a", 8.6)],
    )  # fmt: skip
    flow, omega, phases = FlowMap(system), 39.0, np.array([0.0, 8.0 * np.pi])
    start = np.array([5e-6, 9e-4])
    found = flow.to_modal(flow.shoot(flow.to_state(start)[None], phases, omega).d_omega)[0]
    step = 1e-3 * omega
    ends = [Motion(system).stiff_end(start, phases, omega + by) for by in (step, -step)]
    exact = (ends[0] - ends[1]) / (2.0 * step)
    off = np.abs(found - exact)
    assert off[0] < 1e-4 * abs(exact[0])
    assert off[1] < 0.01 * omega * abs(exact[0])


@pytest.mark.parametrize("depth", [1e-4, pytest.param(1e-2, marks=pytest.mark.slow)])
def test_creep_of_two_modes_against_a_stiff_integrator(depth):
    """Pressed in, and left alone for a quarter of the time that it takes to creep out."""
    stiffness, loss = 1e12, 100.0
    stop = Stop("a", stiffness, dissipation=loss)
    system = System.from_modal([10.0, 40.0], {"a": [1.0, 0.5]}, modal_damping=0.01, stops=[stop])
    flow, phases = FlowMap(system), np.array([0.0, 2.0 * np.pi])
    duration, start = 0.25 * depth * loss, np.array([depth, 0.0, 0.0, 0.0])
    motion = flow.trajectory(flow.to_state(start)[None], phases, phases[1] / duration)
    assert not motion.failure
    assert motion.record.kind.size < 200
    exact = Motion(system).stiff_end(start, phases, phases[1] / duration, atol=1e-14)
    found = flow.to_modal(motion.states(phases))[1]
    damped = 1.25 * stiffness * depth**1.5 * loss * duration  # times rounding: what a speed loses
    for part in (slice(2), slice(2, 4)):
        off = np.abs(found[part] - exact[part]).max() / np.abs(exact[part]).max()
        assert off < 1e-9 + 1e-15 * damped


@pytest.mark.parametrize(
    ("frequencies", "shape", "stiffness", "exponent", "loss", "depth"),
    [
        ([16.0], [0.8], 6.4e9, 1.0, 3.9e5, 3e-5),
        ([23.0], [0.5], 1.4e11, 1.5, 7e3, 5e-5),
        ([9.0, 31.0], [0.7, -0.4], 1.2e9, 1.5, 4e3, 1e-4),
    ],
)
def test_speeds_of_driven_creep_against_a_stiff_integrator(
    frequencies, shape, stiffness, exponent, loss, depth
):
    """The drive acts on a body that the stop lets go at -1/a but for the share force / k δ^p.

    What the forces integrate to is wrong by 1e-7 to 6e-6 here.
    """
    n, row, omega = len(frequencies), np.array(shape), 2.0 * np.pi * 8.0
    stop = Stop("a", stiffness, exponent, dissipation=loss)
    system = System.from_modal(
        frequencies, {"a": shape}, modal_damping=0.02, stops=[stop],
        excitation=[HarmonicForce("a", 7.5)],
    )  # fmt: skip
    flow, start = FlowMap(system), np.concatenate([row / (row @ row) * depth, np.zeros(n)])
    phases = np.array([0.0, 0.1 * omega])
    exact = Motion(system).stiff_end(start, phases, omega)
    found = flow.to_modal(flow.shoot(flow.to_state(start)[None], phases, omega).ends)[0]
    for part in (slice(n), slice(n, 2 * n)):
        off = np.abs(found[part] - exact[part]).max() / np.abs(exact[part]).max()
        assert off < 1e-8


@pytest.mark.parametrize("off", [0.0, 1e-6, 0.003])
def test_creep_near_the_resonance_of_a_mode_without_damping(off):
    """The response grows while the stop holds the body: without that speeds are 8e-2 off.

    What rounding hides goes with what the stop damps meanwhile, 1e8.
    """
    stop, row = Stop("a", 6.8e9, dissipation=1.7e4, gap=-2.4e-5), np.array([-1.5, 1.4, -0.25])
    system = System.from_modal(
        [4.15, 17.0, 20.9], {"a": row}, modal_damping=0.0, stops=[stop],
        excitation=[HarmonicForce("a", 0.3)],
    )  # fmt: skip
    flow, start = FlowMap(system), np.array([-3.8e-4, -8.7e-5, 1e-4, 0.01, -0.072, -0.015])
    omega, phases = 8.3 * np.pi * (1.0 - off), np.array([0.0, 0.6])
    exact = Motion(system).stiff_end(start, phases, omega)
    found = flow.to_modal(flow.shoot(flow.to_state(start)[None], phases, omega).ends)[0]
    force = stop.stiffness * (row @ start[:3] - stop.gap) ** 1.5
    damped = row @ row * force * stop.dissipation * phases[1] / omega
    for part in (slice(3), slice(3, 6)):
        off_by = np.abs(found[part] - exact[part]).max() / np.abs(exact[part]).max()
        assert off_by < 1e-9 + 1e-15 * damped


def test_creep_of_one_mode_out_of_two_stops_takes_few_panels():
    """The stops' forces, 5e5 N and -5e5 N, cancel to a ten-thousandth; 8000 panels at first."""
    stops = [
        Stop("a", 1.379e6, 1.0, direction=-1, dissipation=2.4526),
        Stop("b", 3.0264e10, 2.0, gap=0.040326, direction=-1, dissipation=529.95),
    ]
    participation = {"a": [-1.2265], "b": [-1.2152]}
    system = System.from_modal([4.918], participation, modal_damping=0.05, stops=stops)
    flow, start = FlowMap(system), np.array([0.321805, 3.46])
    phases, omega = np.array([0.0, 2.0 * np.pi]), 200.0 * np.pi
    motion = flow.trajectory(flow.to_state(start)[None], phases, omega)
    assert not motion.failure
    assert motion.record.kind.size < 400
    exact = Motion(system).stiff_end(start, phases, omega)
    found = flow.to_modal(motion.states(phases))[1]
    assert np.abs(found / exact - 1.0).max() < 1e-7


@pytest.mark.parametrize("stiffness", [1e10, 1e12, 1e16])
def test_creep_that_rounding_hides_is_refused_or_right(stiffness):
    """The rounding of a speed, 1e-16, times what the stop damps meanwhile: 1e11 times at 1e12."""
    flow = free_mass(Stop("m", stiffness, 1.0, dissipation=1e4))
    start = flow.to_state(np.array([1e-4, -1e-4]) * math.sqrt(MASS))[None]
    found = flow.shoot(start, np.array([0.0, 2.0 * np.pi]), 10.0 * np.pi)
    if found.failure or stiffness > 1e14:
        assert "hidden by rounding" in found.failure
    else:  # it moves on at -1/a
        end = flow.to_modal(found.ends)[0] / math.sqrt(MASS)
        assert end == pytest.approx([8e-5, -1e-4], rel=1e-8)


def test_an_orbit_is_as_exact_from_a_guess_that_is_far_too_large():
    system = make_one_dof(stops=[])
    exact = solve_orbit(system, frequency_hz=20.0)
    problem = exact.problem
    guess = np.append(1e30 * (1.0 + np.abs(exact.point[:-1])), exact.point[-1])
    row = np.zeros(guess.size)
    row[-1] = 1.0
    found = problem.correct(guess, row)
    np.testing.assert_allclose(found.point, exact.point, rtol=1e-10, atol=1e-22)


@pytest.mark.parametrize("size", [1.0, 0.1, 1e-3, 1e-33, 1e-98, 1e-126])
def test_rest_is_found_from_a_guess_of_any_size(size):
    problem = solve_orbit(make_one_dof(stops=[], excitation=[]), frequency_hz=20.0).problem
    row = np.append(np.zeros(problem.segments * problem.size), 1.0)
    guess = np.append(np.full(row.size - 1, size), math.log(100.0))
    found = problem.correct(guess, row)
    assert found.failure == ""
    assert np.abs(found.point[:-1]).max() <= 1e-11 * size
