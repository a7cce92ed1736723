"""What the tolerance of the flow map means, against references of fifty digits."""

from __future__ import annotations

import numpy as np
import pytest
from bench.models import load_case
from bench.studies import TUBE_HZ, tube
from independent import Motion

from nldyn import (
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Orbit,
    Parameter,
    Stop,
    System,
    SystemModelError,
    Unbalance,
)
from nldyn.orbits.shooting import ShootingProblem

CASES = ["one_dof", "two_dof", "four_dof", "sixteen_dof"]


def orbit_at(case, rtol: float) -> Orbit:
    """The reference's start as an orbit in one segment."""
    flow = FlowMap(case.system, FlowOptions(rtol=rtol))
    point = np.append(flow.to_state(case.start), np.log(case.omega))
    return Orbit(ShootingProblem(flow, 1, 1), point, np.eye(2 * case.size)[None], 0.0, "")


def true_errors(case, orbit: Orbit) -> tuple[float, float, float]:
    flow = orbit.problem.flow
    found = flow.shoot(orbit.problem.nodes(orbit.point), orbit.problem.phases, orbit.omega)
    basis = flow.system.linear
    state = flow.to_state(case.exact.state)
    monodromy = basis.left @ case.exact.monodromy @ basis.right
    d_omega = flow.to_state(case.exact.d_omega)
    return (
        float(np.linalg.norm(found.ends[0] - state) / np.linalg.norm(state)),
        float(np.linalg.norm(found.monodromy - monodromy) / np.linalg.norm(monodromy)),
        float(np.linalg.norm(found.d_omega[0] - d_omega) / np.linalg.norm(d_omega)),
    )


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12])
@pytest.mark.parametrize("name", CASES)
def test_errors_are_within_the_tolerance(name, rtol):
    case = load_case(name)
    state, monodromy, d_omega = true_errors(case, orbit_at(case, rtol))
    assert state < rtol
    assert monodromy < 10.0 * rtol
    assert d_omega < 10.0 * rtol


@pytest.mark.parametrize("name", CASES)
def test_the_tightest_setting_reaches_twelve_digits(name):
    case = load_case(name)
    assert max(true_errors(case, orbit_at(case, 1e-13))) < 1e-12


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-9, 1e-10])
@pytest.mark.parametrize("name", CASES)
def test_error_estimates_are_true_within_a_factor_of_ten(name, rtol):
    case = load_case(name)
    orbit = orbit_at(case, rtol)
    rounding = 1e-13
    for estimate, true in zip(
        (orbit.flow_error.state, orbit.flow_error.monodromy, orbit.flow_error.d_omega),
        true_errors(case, orbit),
        strict=True,
    ):
        assert 0.1 * true - rounding < estimate < 10.0 * true + rounding


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-9])
def test_error_estimates_of_parameter_derivatives_are_true_within_a_factor_of_ten(rtol):
    case = load_case("two_dof")
    wanted = [Parameter("stiffness"), Parameter("gap")]
    coarse, tightest = (FlowMap(case.system, FlowOptions(rtol=r)) for r in (rtol, 1e-13))
    start, period = coarse.to_state(case.start)[None], np.array([0.0, 2.0 * np.pi])
    found, exact = (
        flow.shoot(start, period, case.omega, parameters=wanted).d_parameters[0]
        for flow in (coarse, tightest)
    )
    true = np.max(np.linalg.norm(found - exact, axis=0) / np.linalg.norm(exact, axis=0))
    estimate = coarse.error(start, period, case.omega, parameters=wanted).d_parameters
    assert 0.1 * true < estimate < 10.0 * true


def test_the_error_of_a_map_that_fails_is_infinite():
    flow = FlowMap(one_dof(0.0))
    error = flow.error(np.array([[0.0, 1e300]]), np.array([0.0, 2.0 * np.pi]), 50.0)
    assert error.state == error.monodromy == error.d_omega == np.inf


@pytest.mark.parametrize("omega", [0.0, 1e-300, 1e-12, 1e14, np.nan])
def test_a_frequency_that_no_excitation_has_is_refused(omega):
    flow = FlowMap(one_dof(0.0))
    with pytest.raises(SystemModelError, match="omega must be positive, that of 1e-12 to"):
        flow.shoot(np.zeros((1, 2)), np.array([0.0, 2.0 * np.pi]), omega)


def test_stiff_stops_of_mixed_exponents_agree_at_all_tolerances():
    """Newton's method for a panel must not trust its first two steps to show how fast it is."""
    stops = [
        Stop("a", 5.89e7, 1.37, -9.28e-5, 1),
        Stop("a", 3.82e13, 3.0, -3.12e-5, -1),
        Stop("a", 2.49e6, 1.0, 4.39e-5, -1),
    ]
    system = System.from_modal(
        [10.0], {"a": [1.0]}, modal_damping=0.02, stops=stops,
        excitation=[HarmonicForce("a", 2.83)],
    )  # fmt: skip
    start, phases = np.array([[8.05e-6, -5.71e-4]]), np.array([0.0, 2.0 * np.pi])
    ends = [
        FlowMap(system, FlowOptions(rtol=rtol)).shoot(start, phases, 40.0 * np.pi).ends[0]
        for rtol in (1e-9, 1e-10, 1e-11, 1e-12, 1e-13)
    ]
    for end in ends:
        np.testing.assert_allclose(end, ends[-1], rtol=1e-8)


@pytest.mark.parametrize("exponent", [1.0, 1.0 + 1e-9, 1.003, 1.01, 1.05, 1.1, 1.2, 1.35, 1.5])
def test_the_jacobian_of_a_law_that_is_nearly_linear_against_differences(exponent):
    """A contact of 0.0024 of the period; differences of the states, extrapolated to order six."""
    system = one_dof(0.0, exponent)
    fine, phases = FlowMap(system, FlowOptions(1e-13, nodes=28)), np.array([0.0, 2.0 * np.pi])
    omega, start = 2.0 * np.pi * 34.8, np.array([-1.3e-5, 2.8e-7])

    def difference(direction, length):
        there, back = (
            fine.shoot((start + way * direction)[None], phases, omega).ends[0]
            for way in (length, -length)
        )
        return (there - back) / (2.0 * length)

    step = 4e-9
    columns = [
        64.0 * difference(e, step) - 20.0 * difference(e, 2.0 * step) + difference(e, 4.0 * step)
        for e in np.eye(2)
    ]
    wanted = np.transpose(columns) / 45.0
    for rtol in (1e-6, 1e-9):
        found = FlowMap(system, FlowOptions(rtol)).shoot(start[None], phases, omega).jacobians[0]
        assert np.linalg.norm(found - wanted) < 10.0 * rtol * np.linalg.norm(wanted)


def test_derivative_by_dissipation_where_there_is_none_against_differences():
    flow = [FlowMap(one_dof(dissipation)) for dissipation in (0.0, 1e-3)]
    start, phases = np.zeros((1, 2)), np.array([0.0, 2.0 * np.pi])
    exact = flow[0].shoot(start, phases, 160.0, parameters=[Parameter("dissipation")])
    ends = [one.shoot(start, phases, 160.0).ends[0] for one in flow]
    difference = (ends[1] - ends[0]) / 1e-3
    np.testing.assert_allclose(exact.d_parameters[0, :, 0], difference, rtol=1e-3)


def one_dof(dissipation, exponent=1.5):
    return System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142,
        stops=[Stop("middle", 5.17e9, exponent, dissipation=dissipation)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip


@pytest.mark.parametrize("duration", [0.02, 0.024, 0.03])
def test_a_soft_contact_resolves_the_fast_mode_that_it_starts(duration):
    """The force is smooth until the mode that it shakes shows in it: 3e-7 off at first."""
    stop = Stop("a", 5.2e6, exponent=2.0)
    modes = {"a": [0.5, -1.33]}
    system = System.from_modal([5.65, 108.6], modes, modal_damping=0.05, stops=[stop])
    flow, omega, phases = FlowMap(system), 100.0, np.array([0.0, 100.0 * duration])
    start = np.array([6.3e-4, 0.0, 0.081, 0.0])
    shot = flow.shoot(flow.to_state(start)[None], phases, omega)
    end, tangent, _ = Motion(system).run(start, (0.0, phases[1]), omega)
    basis = system.linear
    own = np.array([1e-3, 1e-3, 0.1, 0.1])  # m and m/s
    assert np.abs((flow.to_modal(shot.ends)[0] - end) / own).max() < 1e-9
    found = basis.right @ shot.jacobians[0] @ basis.left
    assert np.abs((found - tangent) * own / own[:, None]).max() < 3e-9


def test_panels_of_many_nodes_with_many_modes_are_as_exact():
    """One contact of a tube, 14 swings of its twentieth mode, against fewer and tighter nodes."""
    system, omega = tube(40), 2.0 * np.pi * TUBE_HZ
    few, many = FlowMap(system, FlowOptions(1e-12, nodes=14)), FlowMap(system)
    assert many.tables.nodes.size > 2 * few.tables.nodes.size
    start = np.zeros((1, 80))
    start[0, 40] = 0.5
    states, phases = many.to_state(start), np.array([0.0, 0.2])
    expected, found = few.shoot(states, phases, omega), many.shoot(states, phases, omega)
    assert expected.closings.sum() > 0
    for a, b in ((found.ends, expected.ends), (found.monodromy, expected.monodromy)):
        assert np.linalg.norm(a - b) < 1e-9 * np.linalg.norm(b)


@pytest.mark.parametrize(
    ("nodes", "phases", "omega", "says"),
    [
        (np.zeros((1, 3)), [0.0, 1.0], 10.0, "nodes must have shape"),
        (np.zeros((1, 2)), [0.0, 1.0, 2.0], 10.0, "nodes must have shape"),
        (np.full((1, 2), np.nan), [0.0, 1.0], 10.0, "must be finite"),
        (np.zeros((1, 2)), [1.0, 0.0], 10.0, "ascending"),
        (np.zeros((1, 2)), [0.0, 1.0], -1.0, "omega must be positive"),
        (np.zeros((1, 2)), [0.0, 1.0], np.inf, "omega must be positive"),
    ],
)
def test_senseless_segments_are_refused(nodes, phases, omega, says):
    with pytest.raises(SystemModelError, match=says):
        FlowMap(one_dof(0.0)).shoot(nodes, np.array(phases), omega)


@pytest.mark.parametrize(("guess", "row"), [(3, 5), (5, 3), (6, 6)])
def test_unknowns_that_do_not_fit_the_segments_are_refused(guess, row):
    """Two segments of one mode have five; the engine does not look where they end."""
    with pytest.raises(SystemModelError, match=r"guess and row must have shape \(5,\)"):
        problem = ShootingProblem(FlowMap(one_dof(0.0)), 1, 2)
        problem.correct(np.zeros(guess), np.zeros(row), offset=0.0)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda flow, motion: motion.states(None), "phases"),
        (lambda flow, motion: motion.states(1.0), "phases must be a list"),
        (lambda flow, motion: motion.states([2.0, 1.0]), "phases must be a list of ascending"),
        (lambda flow, motion: motion.states([0.0, 7.0]), "phases must lie within the motion"),
        (lambda flow, motion: motion.states([-1.0]), "phases must lie within the motion"),
        (lambda flow, motion: motion.extremes("a"), "output must be a whole number from 0 to 1"),
        (lambda flow, motion: motion.extremes(2), "output must be a whole number from 0 to 1"),
        (lambda flow, motion: motion.extremes(-1), "output must be a whole number from 0 to 1"),
        (lambda flow, motion: flow.to_modal([1.0, 2.0, 3.0]), "states must have 2 columns"),
        (lambda flow, motion: flow.to_state(1.0), "modal must have 2 columns"),
        (lambda flow, motion: flow.strobe([0.0, 0.0], 50.0, 1.5), "periods"),
    ],
)
def test_what_a_recorded_motion_cannot_tell_is_refused(call, sentence):
    flow = FlowMap(one_dof(0.0))
    motion = flow.trajectory(np.zeros((1, 2)), np.array([0.0, 2.0 * np.pi]), 50.0)
    with pytest.raises(SystemModelError, match=sentence):
        call(flow, motion)
