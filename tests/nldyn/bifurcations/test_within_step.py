"""Two special points of a kind within a step."""

import numpy as np
import pytest
from paper.jobs import scene_system

from nldyn import (
    ContinuationOptions,
    FlowMap,
    HarmonicForce,
    LocateError,
    RigidStop,
    Stop,
    System,
    Unbalance,
    continue_branch,
    impacts,
    solve_orbit,
)
from nldyn.bifurcations.within_step import differs, passes_node, special_points_between
from nldyn.orbits.impact_phases import impacts_by_segment
from nldyn.orbits.starts import orbit_near
from nldyn.search.fixed_point_index import _changes


def test_two_flips_within_a_step_are_found():
    """A multiplier passes -1 on the unit circle and is back on it before the next point."""
    system = scene_system("four_dof_xi_0.001")
    start = continue_branch(solve_orbit(system, 42.0), (39.03, 42.0)).points[0]
    assert start.frequency_hz < 39.031
    long = ContinuationOptions(first_step=0.05, max_step=0.05)
    branch = continue_branch(start, (39.03, 39.08), options=long)
    flips = [s.frequency_hz for s in branch.special_points if s.kind == "PD"]
    assert len(branch.points) < 5
    assert [round(hz, 4) for hz in flips] == [39.0346, 39.0739]


def test_two_folds_behind_a_grazing_point_are_found_from_every_start():
    """They lie 5e-7 of the frequency apart: where a linear stop is touched, a multiplier dips."""
    system = System(
        np.array([125.66370614359172, 334.85673403]), np.diag([1.43255671, 3.81734136]),
        {"m": np.array([1.0, -0.74994498]), "n": np.array([0.5, -0.30212696]),
         "f": np.array([1.0, 0.89401234])},
        (Stop("m", 18911763.49182209), Stop.linear("n", 79370.93133132052, direction=-1)),
        (), (Unbalance("f", 0.0004592791346638346),),
    )  # fmt: skip
    state = np.array([3.20561900e-05, 1.51622911e-05, -1.88056171e-03, -6.42275901e-04])
    first = continue_branch(solve_orbit(system, 15.99458909443381, guess=state), (15.9, 16.6))
    (grazing,) = (
        s.frequency_hz
        for s in first.special_points
        if s.kind == "GR" and 16.2115 < s.frequency_hz < 16.2117
    )
    for start in first.points[::15]:
        branch = continue_branch(start, (15.9, 16.6))
        kinds = [s.kind for s in branch.special_points if abs(s.frequency_hz - grazing) < 1e-4]
        assert sorted(kinds) == ["GR", "LP", "LP", "LP"]
        assert len(branch.at(16.211585)) == 4


def test_only_the_last_point_of_a_closed_branch_lies_beyond_its_start():
    """Also where a touch, twice within the last step, puts a point between its ends."""
    flow = FlowMap(scene_system("four_dof_xi_0.001"))
    hz, state = 28.218257384643508, [
        1.8984869179784e-6, -1.1909021869360e-5, -1.8386967220751e-6, -7.5170210415372e-7,
        -3.9881359108745e-8, 2.5616578435823e-7, -3.0953090011517e-8, -1.8729804769715e-7,
    ]  # fmt: skip
    orbit = orbit_near(flow, np.array(state), 3, 2.0 * np.pi * hz, "middle")
    isola = continue_branch(orbit, (28.0, 28.5))
    assert isola.closed
    first, *_, before, last = (node.orbit.point for node in isola.nodes)
    weights, step = orbit.problem.metric(first), last - before
    assert 0.0 < (first - before) @ (weights * step) <= step @ (weights * step)
    ends, rises = _changes([isola], 3)  # the two halves of an isola have opposite indices
    order = np.argsort(ends, kind="stable")
    sums, widths = np.cumsum(rises[order]), np.diff(ends[order], append=np.inf)
    assert not sums[widths > 1e-9].any()


def impact_oscillator():
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.1]],
        stops=[RigidStop("x", 0.8, 0.3)], excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip


def test_a_step_past_a_phase_of_shooting_in_which_multipliers_go_far_is_not_taken_for_searched():
    """Ends of one kind, from 0.5 inside the unit circle to near 1, do not tell what is between."""
    branch = continue_branch(solve_orbit(impact_oscillator(), 0.165), (0.144, 0.166))
    last, first = (
        min(branch.nodes, key=lambda node: abs(node.orbit.frequency_hz - hz))
        for hz in (0.145, 0.16)
    )
    assert passes_node(first, last)
    assert not differs(first, last)
    with pytest.raises(LocateError, match="two of them may lie within one step"):
        special_points_between(first, last)


def test_what_is_cut_off_an_endless_series_of_impacts_passes_no_phase_of_shooting():
    """The flow map follows 65 impacts or 66 of a series that ends in rest within one segment."""
    branch = continue_branch(solve_orbit(impact_oscillator(), 0.035), (0.035, 0.0365))
    assert len({len(impacts(orbit)) for orbit in branch.points}) > 1
    assert {tuple(impacts_by_segment(orbit)) for orbit in branch.points} == {(0, 2)}
