"""Two special points of a kind within a step, at low damping."""

from nldyn import ContinuationOptions, continue_branch, solve_orbit
from nldyn.paper.jobs import scene_system


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
