"""Where a branch meets a stiff stop: it may turn back within a billionth of its size."""

import math
from dataclasses import replace

import numpy as np
import pytest
from problems import in_frequency
from scipy.optimize import brentq

from nldyn import HarmonicForce, Stop, System, continue_branch, solve_orbit
from nldyn.orbits.conditions import Grazing, depth_row

FREQUENCIES = np.array([25.125, 25.2])
AT_STOP, AT_FORCE = np.array([1.136, 0.11]), np.array([-0.553, -0.785])
DAMPING, GAP, FORCE = np.array([0.0105, 0.005]), 7.5e-4, 0.7


def near_resonance(stiffness: float) -> System:
    """Two close modes and one stop, that the linear motion reaches beside their resonance."""
    return System.from_modal(
        FREQUENCIES.tolist(), {"a": AT_STOP.tolist(), "b": AT_FORCE.tolist()},
        modal_damping=DAMPING.tolist(), stops=[Stop.linear("a", stiffness, gap=GAP)],
        excitation=[HarmonicForce("b", FORCE)],
    )  # fmt: skip


def linear_amplitude(hz: float) -> float:
    """Of the displacement at the stop, without the stop, from the modal transfer functions."""
    w, natural = 2.0 * math.pi * hz, 2.0 * math.pi * FREQUENCIES
    modes = AT_STOP * AT_FORCE / (natural**2 - w**2 + 2j * DAMPING * natural * w)
    return FORCE * abs(complex(modes.sum()))


def at_resonance(branch):
    """The fold and the grazing point above the resonance."""
    return [(s.kind, s.frequency_hz) for s in branch.special_points if 25.2 < s.frequency_hz < 25.5]


@pytest.mark.parametrize(
    "stiffness", [*(pytest.param(k, marks=pytest.mark.slow) for k in (1e7, 3e7)), 1e9]
)
def test_branch_that_turns_back_at_a_stiff_stop_is_followed_from_every_start(stiffness):
    graze = brentq(lambda hz: linear_amplitude(hz) - GAP, 25.3, 26.0, xtol=1e-13)
    system = near_resonance(stiffness)
    expected = None
    for hz in (15.0, 25.2, 26.0, 50.0):
        branch = continue_branch(solve_orbit(system, hz), (10.0, 55.0))
        assert branch.stop_reasons == ("end of the frequency range",) * 2
        assert branch.notes == ()
        found = at_resonance(branch)
        assert [kind for kind, _ in found] == ["LP", "GR"]
        assert found[1][1] == pytest.approx(graze, rel=1e-12)
        expected = expected or found[0][1]
        assert found[0][1] == pytest.approx(expected, rel=1e-13)


def test_fold_beside_a_grazing_point_nears_it_with_the_square_of_the_stiffness():
    """The touch's share in the Jacobian goes with stiffness times the root of the depth."""
    distances = []
    for stiffness in (1e6, 1e7):
        branch = continue_branch(solve_orbit(near_resonance(stiffness), 50.0), (24.0, 55.0))
        (_, fold), (_, graze) = at_resonance(branch)
        distances.append((graze - fold) * stiffness**2)
    assert distances[1] == pytest.approx(distances[0], rel=1e-3)


def grazing_orbit(system: System, hz: float):
    """The orbit of the grazing point nearest to a frequency."""
    branch = continue_branch(solve_orbit(system, hz), (0.9 * hz, 1.2 * hz))
    graze = [s for s in branch.special_points if s.kind == "GR"]
    return min(graze, key=lambda s: abs(s.frequency_hz - hz)).orbit


def test_slope_of_the_depth_of_a_touch_is_that_of_its_differences():
    orbit = grazing_orbit(near_resonance(1e6), 25.4)
    touch, row = Grazing.of(orbit), depth_row(in_frequency(orbit))
    problem, rng = orbit.problem, np.random.default_rng(3)
    for _ in range(5):
        way = rng.normal(size=row.size) / np.sqrt(problem.metric(orbit.point))
        way *= 1e-6
        depths = [touch.extreme(_moved(orbit, sign * way))[1] for sign in (1.0, -1.0)]
        assert float(row @ way) == pytest.approx((depths[0] - depths[1]) / 2.0, rel=1e-4, abs=1e-14)


def _moved(orbit, way):
    """Not an orbit: its segments begin elsewhere."""
    return replace(orbit, point=orbit.point + way)


def test_no_depth_row_where_no_stop_is_grazed():
    assert depth_row(in_frequency(solve_orbit(near_resonance(1e6), 50.0))) is None


@pytest.mark.parametrize("depth", [1e-12, 1e-11, 1e-10, 2e-10, 1e-9, 1e-8])
def test_slight_touch_during_another_contact_is_counted(depth):
    """The state at the end of a panel tells of it, the polynomial on the panel does not."""
    system = System.from_modal(
        [8.2142551], {"a": [1.2247], "b": [-0.5103]}, modal_damping=0.01,
        stops=[
            Stop.linear("a", 1.762e6, gap=3.493e-4),
            Stop.linear("b", 1.778e4, gap=-2.206e-4, direction=-1),
        ],
        excitation=[HarmonicForce("b", 1.131)],
    )  # fmt: skip
    orbit = grazing_orbit(system, 10.5)
    row, point = depth_row(in_frequency(orbit)), orbit.point.copy()
    point[:-1] += depth * row[:-1] / float(row[:-1] @ row[:-1])
    problem = orbit.problem
    nodes = problem.nodes(point)
    usual, finer = (
        flow.shoot(nodes, problem.phases, orbit.omega)
        for flow in (problem.flow, problem.flow.finer)
    )
    assert usual.closings.tolist() == finer.closings.tolist() == [1, 1]
    size = problem.scale(point)
    assert np.abs(usual.ends - finer.ends).max() < 1e-10 * size
