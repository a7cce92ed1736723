"""The special points of a branch do not depend on where its continuation begins."""

import numpy as np
import pytest
from paper.jobs import scene_system
from problems import RANGE_HZ

from nldyn import ContinuationOptions, continue_branch, find_orbits, solve_orbit
from nldyn.orbits import OrbitSearchOptions

STARTS = {
    1: np.geomspace(6.0, 85.0, 10),
    2: np.linspace(42.0, 52.0, 10),
    3: np.linspace(67.0, 77.0, 10),
}
FEW = [(1, 0), (1, 4), (2, 9), (3, 8)]
ALL = [(period, number) for period in STARTS for number in range(10)]
REST = [pytest.param(*case, marks=pytest.mark.slow) for case in ALL if case not in FEW]


def start(system, period, number):
    """An orbit of a period at one of ten frequencies, from motions that no other start has."""
    hz = float(STARTS[period][number])
    if period == 1:
        return solve_orbit(system, hz)
    return find_orbits(system, hz, period, options=OrbitSearchOptions(starts=4, seed=number))[0]


def special_points(branch):
    """Kind, frequency and displacement of the special points in an order of their own."""
    found = [(s.kind, s.frequency_hz, s.orbit.max_abs_displacement) for s in branch.special_points]
    return sorted(found, key=lambda point: (point[0], round(point[1], 6)))


def assert_same_special_points(some, others):
    assert [point[0] for point in some] == [point[0] for point in others]
    for a, b in zip(some, others, strict=True):
        assert a[1] == pytest.approx(b[1], rel=1e-9, abs=0.0)
        assert a[2] == pytest.approx(b[2], rel=1e-6, abs=0.0)  # tells apart orbits at one frequency


@pytest.fixture(scope="module")
def finely(one_dof):
    """Special points by period, with steps a fifth as long, from starts of their own."""
    options = ContinuationOptions(max_step=0.01, max_points=20000)
    orbits = {
        1: solve_orbit(one_dof, 55.0),
        2: find_orbits(one_dof, 50.0, 2)[0],
        3: find_orbits(one_dof, 75.0, 3)[0],
    }
    return {
        period: special_points(continue_branch(orbit, RANGE_HZ, options=options))
        for period, orbit in orbits.items()
    }


@pytest.mark.parametrize(("period", "number"), [*FEW, *REST])
def test_ten_starts_give_the_same_special_points(one_dof, finely, period, number):
    """Harmonic, 1/2 and 1/3 branches of the 1-DOF model from 5.7 to 90 Hz."""
    branch = continue_branch(start(one_dof, period, number), RANGE_HZ)
    assert not branch.notes
    assert_same_special_points(special_points(branch), finely[period])


def test_contacts_that_are_born_and_joined_within_a_step_are_found():
    """Two modes: near 17.193 and 19.927 Hz two extremes of the penetration are born in flight, the
    higher one touches the stop, then both contacts join: two grazing points 0.004 and 0.0001 of
    arclength apart, with one contact before and one behind them."""
    system = scene_system("two_dof_xi_0.01")
    shortest = ContinuationOptions(max_step=0.004, first_step=0.004, max_points=20000)
    fine = special_points(
        continue_branch(solve_orbit(system, 17.0), (16.9, 20.4), options=shortest)
    )
    for low, top in ((17.19, 17.2), (19.92, 19.93)):
        assert len([p for p in fine if p[0] == "GR" and low < p[1] < top]) == 2
    for hz in (16.95, 17.3, 18.5, 20.3):
        branch = continue_branch(solve_orbit(system, hz), (16.9, 20.4))
        assert_same_special_points(special_points(branch), fine)
