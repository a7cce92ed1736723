"""Indices of fixed points add up to one where no orbit is missing."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import RANGE_HZ

from nldyn import (
    ContinuationOptions,
    ExploreOptions,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    diagram,
    explore,
    index_sum,
    solve_orbit,
)
from nldyn.orbits.axis import Axis
from nldyn.search.fixed_point_index import index, index_gaps, index_note


@pytest.fixture(scope="module")
def doubled(one_dof):
    """The harmonic branch between two flips, and what is born there."""
    return diagram(one_dof, (28.0, 60.0), (1, 2))


def test_no_piece_of_a_doubled_branch_is_missing_beside_its_flip(doubled):
    """The sums hold at any distance from the flips at which it begins and ends."""
    harmonic = next(b for b in doubled.branches if b.period == 1 and b.special_points)
    flips = [s.frequency_hz for s in harmonic.special_points if s.kind == "PD"]
    assert flips
    for flip in flips:
        for distance in (1e-5, 1e-4, 1e-3):
            for frequency in (flip * (1.0 - distance), flip * (1.0 + distance)):
                assert [index_sum(doubled.branches, frequency, n) for n in (1, 2)] == [1, 1]


@pytest.mark.slow
def test_no_piece_of_a_crossing_branch_is_missing_beside_the_branch_point():
    """Two facing linear stops break the symmetry; the halves meet where that is not far away."""
    stops = [Stop.linear("m", 1e6, gap=1e-3, direction=side) for side in (1, -1)]
    system = System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.02, stops=stops, excitation=[HarmonicForce("m", 2.0)]
    )
    found = explore(
        system, (9.2, 10.0), max_period=1, effort=ExploreOptions(spacing=0.05, starts=4)
    )
    for frequency in np.geomspace(9.21, 9.9, 40):
        assert index_sum(found.diagram.branches, frequency, 1) == 1


@pytest.mark.parametrize("first_step", [pytest.param(0.007, marks=pytest.mark.slow), 0.02])
def test_there_is_no_gap_beside_the_pitchforks_of_a_broken_symmetry(first_step):
    """The index of the branch that leaves there to one side does not change."""
    stops = [Stop.linear("m", 1e6, gap=1e-3, direction=side) for side in (1, -1)]
    system = System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.1, stops=stops, excitation=[HarmonicForce("m", 3.0)]
    )
    options = ContinuationOptions(first_step=first_step)
    found = diagram(system, (6.0, 10.0), (1,), search_points=3, options=options)
    assert [s.kind for b in found.branches for s in b.special_points].count("BP") == 4
    assert index_gaps(found.branches, found.limits) == []


@pytest.mark.slow
def test_a_crossing_found_from_the_other_branch_has_its_place_on_this_one():
    """One of four crossings of a 1/3 branch is approached along the branch that turns there."""
    stops = [Stop("y", stiffness=5e8, gap=2e-6, direction=side) for side in (1, -1)]
    system = System.from_modal(
        [12.0], {"y": [0.7]}, modal_damping=0.02, stops=stops, excitation=[Unbalance("y", 6e-6)]
    )
    found = diagram(system, (20.0, 70.0), (1, 3), search_points=6)
    assert index_gaps(found.branches, found.limits, 3) == []
    passed = 0
    for branch in found.branches:
        crossings = [id(s.point) for s in branch.special_points if s.kind == "BP"]
        places = branch.places.points
        for before, place, after in zip(places, places[1:], places[2:], strict=False):
            if id(place) in crossings and abs(place.tangent[-1]) > 0.1:
                hz = [point.orbit.frequency_hz for point in (before, place, after)]
                assert sorted(hz) in (hz, hz[::-1])
                passed += 1
    assert passed == 5


def test_the_note_tells_that_all_is_missing_where_there_is_no_branch():
    told = index_note([], Axis.in_frequency((28.0, 60.0)), 1)
    assert " but for P from 28 to 60 Hz: orbits are missing" in told


@given(share=st.floats(0.001, 0.999))
def test_the_harmonic_branch_has_the_sum_one_at_every_frequency(harmonic_branch, share):
    frequency = RANGE_HZ[0] * (RANGE_HZ[1] / RANGE_HZ[0]) ** share
    assert index_sum([harmonic_branch], frequency) == 1


@pytest.mark.parametrize("frequency", [29.0, 33.0, 40.0, 50.0, 59.0])
def test_with_doubled_orbits_the_sum_of_two_periods_is_one(doubled, frequency):
    assert index_sum(doubled.branches, frequency, 1) == 1
    assert index_sum(doubled.branches, frequency, 2) == 1


def test_a_missing_doubled_branch_shows_between_its_flips(doubled):
    harmonic = [branch for branch in doubled.branches if branch.period == 1]
    (orbit,) = harmonic[0].at(50.0)
    assert orbit.multipliers[0].real < -1.0
    assert index_sum(harmonic, 50.0, 1) == 1
    assert index_sum(harmonic, 50.0, 2) == -1


def test_the_note_tells_for_each_power_where_orbits_are_missing(doubled):
    """Above the flip of the harmonic branch, without the doubled orbits."""
    low, high = doubled.limits
    harmonic = [branch for branch in doubled.branches if branch.period == 1]
    (flip,) = [s.frequency_hz for s in harmonic[0].special_points if s.kind == "PD"]
    assert index_gaps(harmonic, (low, high), 2) == [pytest.approx((flip, high), rel=1e-12)]
    where = f"P^2 from {flip:.10g} to 60 Hz"
    told = index_note(harmonic, Axis.in_frequency((low, high)), 3)
    assert told.startswith("indices of the fixed points of P to P^3 add up to one from 28 to 60 ")
    assert told.endswith(f" but for {where}: orbits are missing, or a branch was broken off")
    assert index_note(harmonic, Axis.in_frequency((low, flip)), 3).endswith(
        f" add up to one from 28 to {flip:g} Hz; isolas that are missing as a whole would not "
        "change that"
    )


@given(share=st.floats(0.001, 0.999), period=st.integers(1, 4), left=st.booleans())
def test_the_gaps_are_where_the_sum_is_not_one(doubled, share, period, left):
    low, high = doubled.limits
    frequency = low * (high / low) ** share
    branches = [branch for branch in doubled.branches if left or branch.period == 1]
    inside = any(a < frequency < b for a, b in index_gaps(branches, doubled.limits, period))
    assert (index_sum(branches, frequency, period) != 1) == inside


def test_the_index_between_special_points_follows_from_what_is_beside_them(harmonic_branch):
    """No computed point lies between the folds of the superharmonic peak; the flips stay, too."""
    assert index_gaps([harmonic_branch], RANGE_HZ) == []
    folds = [s.point.arclength for s in harmonic_branch.special_points if s.kind == "LP"]
    nodes = harmonic_branch.nodes
    outside = [node for node in nodes if not min(folds) < node.arclength < max(folds)]
    sparse = replace(harmonic_branch, nodes=tuple(outside))
    assert len(folds) > 2 and len(outside) < len(nodes)
    assert index_gaps([sparse], RANGE_HZ) == []


def test_a_branch_that_is_missing_in_a_narrow_range_shows(doubled):
    """The doubled branch ends at 28.7 Hz or so; a millionth of it is left out."""
    (branch,) = [branch for branch in doubled.branches if branch.period == 1]
    (flip,) = [s.frequency_hz for s in branch.special_points if s.kind == "PD"]
    short = (flip * (1.0 - 1e-6), flip * (1.0 + 1e-6))
    assert index_gaps(doubled.branches, short, 2) == []
    ((a, b),) = index_gaps([branch], short, 2)
    assert (a, b) == pytest.approx((flip, short[1]), rel=1e-12)


def test_a_branch_that_is_broken_off_shows(harmonic_branch, one_dof):
    """At 12.15 Hz it passes three times; with few points it ends after the second one."""
    assert [index(orbit) for orbit in harmonic_branch.at(12.15)] == [1, -1, 1]
    start = solve_orbit(one_dof, 13.0)
    shorter = (
        continue_branch(start, (11.0, 14.0), options=ContinuationOptions(max_points=points))
        for points in count(2)
    )
    broken = next(branch for branch in shorter if len(branch.at(12.15)) == 2)
    assert index_sum([broken], 12.15) == 0


def test_the_index_is_the_sign_of_the_determinant(doubled):
    for branch in doubled.branches:
        for orbit in branch.points[1:-1:10]:
            for times in (1, 2, 3):
                map_by = np.linalg.matrix_power(orbit.monodromy, times)
                determinant = np.linalg.det(np.eye(2) - map_by)
                if abs(determinant) > 1e-6:
                    assert index(orbit, times) == np.sign(determinant)


def test_branches_of_two_systems_are_refused(doubled):
    system = doubled.branches[0].points[0].system
    other = replace(system, excitation=(HarmonicForce("middle", 1.0),))
    branches = [doubled.branches[0], continue_branch(solve_orbit(other, 50.0), (28.0, 60.0))]
    with pytest.raises(SystemModelError, match="of one system and accuracy"):
        index_sum(branches, 50.0)


def test_a_mode_without_damping_is_refused():
    system = System.from_modal(
        [13.0], {"tip": [1.0]}, stops=[Stop("tip", 1e9)], excitation=[Unbalance("tip", 1e-6)]
    )
    branch = continue_branch(solve_orbit(system, 30.0), (29.9, 30.1))
    with pytest.raises(SystemModelError, match="damped"):
        index_sum([branch], 30.0)
