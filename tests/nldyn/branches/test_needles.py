"""Resonances of hardly damped modes that are narrower than a step of the walk."""

import numpy as np
import pytest
from branches_alike import assert_same_branches
from paper.jobs import scene_system

from nldyn import ContinuationOptions, System, continue_branch, solve_orbit

RANGE = (42.5, 45.5)
SHORT = ContinuationOptions(first_step=0.004, max_step=0.004)
LONG = ContinuationOptions(first_step=0.05)


def folds_flips_touches(branch):
    """Kinds and frequencies, sorted; pairs of NS points may lie within a step unseen."""
    return sorted((s.kind, s.frequency_hz) for s in branch.special_points if s.kind != "NS")


@pytest.fixture(scope="module")
def walks():
    """The branch with short steps, and with usual ones from orbits that put them differently."""
    scene = scene_system("four_dof_xi_0.001")
    damping = np.diag(2e-4 * scene.natural_frequencies)
    system = System(
        scene.natural_frequencies,
        damping,
        scene.participation,
        scene.stops,
        excitation=scene.excitation,
    )
    short = continue_branch(solve_orbit(system, 45.0), RANGE, options=SHORT)
    starts = [short.at(hz)[0] for hz in (42.5, 43.0, 43.4, 43.85)]
    return short, [continue_branch(orbit, RANGE, options=LONG) for orbit in starts]


def test_a_needle_within_a_step_is_walked(walks):
    """Its folds, flips and touches are those of a walk whose steps are shorter than its foot."""
    short, others = walks
    expected = folds_flips_touches(short)
    assert {kind for kind, _ in expected} == {"LP", "PD", "GR"}
    for branch in others:
        found = folds_flips_touches(branch)
        assert [kind for kind, _ in found] == [kind for kind, _ in expected]
        assert np.allclose([hz for _, hz in found], [hz for _, hz in expected], rtol=1e-8, atol=0)
        assert not branch.notes


def test_the_length_of_the_detour_counts(walks):
    """The arclength grows from point to point, and by the length of the needle."""
    lengths = []
    for branch in (walks[0], *walks[1]):
        arclengths = np.array([node.arclength for node in branch.nodes])
        assert np.all(np.diff(arclengths) > 0.0)
        lengths.append(arclengths[-1] - arclengths[0])
    assert lengths[1:] == pytest.approx([lengths[0]] * 4, rel=0.02)  # of chords, a fifth as long


def test_a_branch_with_a_detour_is_extended_as_if_walked_at_once(walks):
    """The steps beside the end of a range, which need the next point, are done again."""
    whole = walks[1][0]
    for end in (44.2, 44.27, 44.3, 44.5):
        part = continue_branch(whole.points[0], (RANGE[0], end), options=LONG)
        assert_same_branches(continue_branch(part, RANGE), whole)
