"""Stops that open and close at the same instant, and searches that find nothing."""

import numpy as np
import pytest
from problems import make_one_dof

from nldyn import FlowMap, FlowOptions, HarmonicForce, Stop, System, diagram, solve_orbit
from nldyn.orbits import OrbitSearchOptions

PERIOD = np.array([0.0, 2.0 * np.pi])


def test_two_stops_at_one_place_act_as_one_of_the_summed_stiffness():
    single = solve_orbit(make_one_dof(), frequency_hz=20.0)
    halves = [Stop("middle", 3.0e9), Stop("middle", 2.17e9)]
    double = solve_orbit(make_one_dof(stops=halves), frequency_hz=20.0)
    assert double.impacts == 2 * single.impacts
    np.testing.assert_allclose(double.max_abs_displacement, single.max_abs_displacement, rtol=1e-11)
    np.testing.assert_allclose(double.multipliers, single.multipliers, rtol=1e-10)


def test_stops_on_both_sides_without_a_gap_hand_over_at_the_same_instant():
    stops = [Stop("middle", 1e7), Stop("middle", 1e7, direction=-1)]
    orbit = solve_orbit(make_one_dof(stops=stops), frequency_hz=20.0)
    values = orbit.observed_extremes.values
    assert orbit.impacts == 2
    np.testing.assert_allclose(values.max(), -values.min(), rtol=1e-9)  # the motion is symmetric
    assert orbit.liouville_error < 1e-12


def differences(flow: FlowMap, start, omega: float, step: float):
    """Jacobian (2n, 2n) by central differences of order four."""

    def end(state):
        return flow.shoot(state[None], PERIOD, omega, sensitivities=False).ends[0]

    columns = []
    for e in step * np.eye(start.size):
        near, far = end(start + e) - end(start - e), end(start + 2 * e) - end(start - 2 * e)
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.array(columns).T


@pytest.mark.parametrize(("exponent", "stiffness"), [(1.5, 3e7), (2.5, 3e11)])
def test_a_linear_and_another_stop_without_play_hand_over_at_the_linear_ones_accuracy(
    exponent, stiffness
):
    """The slope of the linear one jumps: its share in the Jacobian goes with the instant."""
    system = System.from_modal(
        [23.0, 41.0], {"a": [0.7, 0.9]}, modal_damping=0.02,
        stops=[Stop("a", 4e5, 1.0), Stop("a", stiffness, exponent, 0.0, -1)],
        excitation=[HarmonicForce("a", 10.0)],
    )  # fmt: skip
    modal = np.array([1e-3, -4e-4, 0.1, -0.2])
    default, tight = FlowMap(system), FlowMap(system, FlowOptions(rtol=1e-13))
    start = default.to_state(modal)
    found = default.shoot(start[None], PERIOD, 120.0)
    assert found.closings.min() > 3
    wanted = differences(tight, start, 120.0, 1e-5 * np.linalg.norm(start))
    off = np.linalg.norm(found.jacobians[0] - wanted) / np.linalg.norm(wanted)
    assert off < 1e-8


@pytest.mark.parametrize("rtol", [1e-9, 1e-12, 1e-13])
@pytest.mark.parametrize("apart", [1e-13, 1e-12, 1e-11])
def test_stops_a_picometre_apart_are_resolved_at_every_tolerance(rtol, apart):
    omega = 40.0 * np.pi
    stops = [Stop("a", 5e7, 1.5, 1e-4), Stop("a", 1e8, 1.5, 1e-4 + apart)]
    one = [Stop("a", 1.5e8, 1.5, 1e-4)]
    ends = []
    for some in (stops, one):
        system = System.from_modal(
            [9.0, 31.0], {"a": [1.0, 0.6]}, modal_damping=0.05, stops=some,
            excitation=[HarmonicForce("a", 16.0, 30.0)],
        )  # fmt: skip
        flow = FlowMap(system, FlowOptions(rtol=rtol))
        start = flow.to_state(np.array([-2e-4, 1e-4, 0.1, 0.0]))
        found = flow.shoot(start[None], PERIOD, omega)
        assert found.failure == ""
        ends.append(flow.to_modal(found.ends[0]))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6 * np.abs(ends[1]).max())


@pytest.mark.parametrize(("one", "other"), [(1.0, 1.0), (1.5, 1.0), (1.5, 1.5)])
def test_a_motion_may_begin_on_a_stop_while_another_one_is_closed(one, other):
    """As the motions that begin a picometre before or behind."""
    stops = [Stop("x", 1e6, one), Stop("x", 1e6, other, gap=-1e-3, direction=-1)]
    flow = FlowMap(System.from_modal([10.0], {"x": [1.0]}, stops=stops))
    starts = flow.to_state(np.array([[-1e-12, 1.0], [0.0, 1.0], [1e-12, 1.0]]))
    found = [flow.shoot(start[None], PERIOD, 100.0) for start in starts]
    assert not any(each.failure for each in found)
    before, here, behind = (each.ends[0] for each in found)
    assert np.abs(here - 0.5 * (before + behind)).max() < 1e-11


def test_a_motion_may_begin_on_a_stop_that_it_leaves():
    """Rounding may put it a hair behind the stop: where, is the drive's and the modes' matter."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        speed = -rng.random(3)
        system = System.from_modal(
            [47.5, 68.0, 96.8], {"x": rng.random(3)}, stops=[Stop("x", 945.0, 1.0)],
            excitation=[HarmonicForce("x", 0.087)],
        )  # fmt: skip
        starts = np.array([[-1e-12, 0.0, 0.0, *speed], [0.0, 0.0, 0.0, *speed]])
        flow = FlowMap(system)
        before, here = (flow.shoot(flow.to_state(start)[None], PERIOD, 26.3) for start in starts)
        assert not here.failure
        assert np.abs(here.ends - before.ends).max() < 1e-9


def test_a_search_that_finds_nothing_says_so():
    effort = OrbitSearchOptions(starts=1, transient=5, recorded=6)
    found = diagram(make_one_dof(), (20.0, 21.0), (7,), search_points=1, search=effort)
    assert found.branches == ()
    assert found.notes == ("no orbit of period 7 found by simulation at 1 frequency",)
