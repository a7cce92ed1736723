"""Stops that open and close at the same instant, and searches that find nothing."""

import numpy as np
from one_dof import make_one_dof

from nldyn import SearchOptions, Stop, diagram, solve_orbit


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


def test_a_search_that_finds_nothing_says_so():
    effort = SearchOptions(starts=1, transient=5, recorded=6)
    found = diagram(make_one_dof(), (20.0, 21.0), (7,), search_points=1, search=effort)
    assert found.branches == ()
    assert found.notes == ("no orbit of period 7 found by simulation at 1 frequency",)
