"""What `explore` finds without guesses: coexisting branches, isolas, and what it admits to miss."""

from itertools import combinations

import numpy as np
import pytest

from nldyn import (
    ExploreOptions,
    FlowMap,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    explore,
    solve_orbit,
)
from nldyn.branch import stroboscopic
from nldyn.diagrams import Collector
from nldyn.exploration import deflated_orbit, settling_periods
from nldyn.resources import example
from nldyn.scene import build_system, load_scene
from nldyn.search import random_states


def system_of(name):
    return build_system(load_scene(example(f"{name}.toml")))


@pytest.fixture(scope="module")
def around_37():
    """The 1-DOF model where section 3 of the paper has a 1/3 branch that nothing leads to."""
    return explore(system_of("one_dof"), (36.0, 38.0), 4)


def test_isolated_third_subharmonic_is_found_unaided(around_37):
    """Its peak lies near 37.1 Hz (section 3 of the paper)."""
    thirds = around_37.diagram.of_period(3)
    assert any(36.9 < branch.frequency_hz.max() < 37.3 for branch in thirds)


@pytest.mark.parametrize(("near", "period"), [(62.2, 5), (58.0, 7), (83.0, 10)])
def test_listed_subharmonics_are_found_unaided(near, period):
    """Orders and places of section 3 of the paper; the peaks are stable over 0.1 Hz or less."""
    found = explore(
        system_of("one_dof"),
        (near - 0.1, near + 0.1),
        period,
        effort=ExploreOptions(spacing=0.0005, unstable_period=0),
    )
    assert found.diagram.of_period(period)


def test_both_harmonic_branches_of_two_modes_are_found():
    """Section 4 of the paper: two separate harmonic branches near 23 Hz, three orbits there."""
    found = explore(system_of("two_dof_xi_0.01"), (21.5, 24.0), 1)
    assert sum(len(branch.at(23.0)) for branch in found.diagram.of_period(1)) >= 3
    assert len(found.diagram.of_period(1)) >= 2


def test_no_branch_is_found_twice(around_37):
    for a, b in combinations(around_37.diagram.branches, 2):
        if a.period == b.period:
            assert not any(b.contains(orbit) for orbit in a.points[1:-1:20])


def test_every_simulation_is_accounted_for(around_37):
    """Twelve random starts at each frequency, and those carried over from the one before."""
    steps = np.diff(np.log([c.frequency_hz for c in around_37.coverage]))
    assert steps.max() <= 0.005 * (1 + 1e-9)
    for c in around_37.coverage:
        assert c.settled + c.unsettled + c.failed >= 12
        assert all(period <= 4 for period in c.periods)
        assert bool(c.periods) == (c.settled > 0)


def test_report_tells_what_was_tried(around_37):
    text = around_37.report()
    assert f"simulations at {len(around_37.coverage)} frequencies" in text
    assert "harmonic" in text and "1/3" in text


def test_repeated_exploration_gives_the_same_branches():
    effort = ExploreOptions(spacing=0.02, starts=3)
    first, second = (explore(system_of("one_dof"), (49.0, 51.0), 2, effort=effort) for _ in "ab")
    for a, b in zip(first.diagram.branches, second.diagram.branches, strict=True):
        np.testing.assert_array_equal(a.frequency_hz, b.frequency_hz)


def test_linear_system_has_one_branch_on_which_everything_settles():
    system = System.from_modal(
        [10.0], {"tip": [1.0]}, modal_damping=0.05, excitation=[Unbalance("tip", 1e-5)]
    )
    found = explore(system, (5.0, 20.0), 3, effort=ExploreOptions(spacing=0.1))
    assert [branch.period for branch in found.diagram.branches] == [1]
    assert found.settled_share == 1.0
    assert found.unsettled_ranges() == []


def test_deflation_leaves_a_known_orbit_for_another_one():
    """Two modes at 23 Hz have several harmonic orbits; with one known, Newton finds others."""
    flow = FlowMap(system_of("two_dof_xi_0.01"))
    box = Collector(flow, (22.0, 24.0), "middle", None, lambda what, hz: None)
    first = solve_orbit(flow, 23.0)
    state = stroboscopic(first)[0]
    starts = random_states(flow, first.omega, 8, seed=1)
    found = [deflated_orbit(box, start, 1, first.omega, [first]) for start in starts]
    others = [orbit for orbit in found if orbit is not None]
    assert others
    for other in others:
        assert other.error < 1e-9
        assert np.abs(stroboscopic(other)[0] - state).max() > 1e-3 * np.abs(state).max()


def test_deflation_finds_nothing_where_there_is_one_orbit():
    system = System.from_modal(
        [10.0], {"tip": [1.0]}, modal_damping=0.05, excitation=[Unbalance("tip", 1e-5)]
    )
    orbit = solve_orbit(system, 12.0)
    box = Collector(orbit.problem.flow, (5.0, 20.0), "tip", None, lambda what, hz: None)
    start = 1.5 * stroboscopic(orbit)[0]
    assert deflated_orbit(box, start, 1, orbit.omega, [orbit]) is None


def test_settling_time_follows_the_slowest_decay():
    """ζω = 0.01 · 2π · 10 /s: e^-4 after 6.37 s, at 20 Hz that is 128 periods."""
    system = System.from_modal([10.0, 50.0], {"tip": [1.0, 1.0]}, modal_damping=0.01)
    assert settling_periods(system, 20.0) == 128
    free = System.from_modal([0.0], {"tip": [1.0]}, modal_damping=0.0, stops=[Stop("tip", 1e9)])
    assert settling_periods(free, 20.0) == 600


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"spacing": 0.0}, "spacing must lie between 0 and 1"),
        ({"spacing": float("nan")}, "spacing must lie between 0 and 1"),
        ({"starts": 0}, "explore: starts"),
        ({"unstable_period": -1}, "explore: unstable_period"),
        ({"seed": 0.5}, "explore: seed"),
    ],
)
def test_bad_efforts_are_refused_by_name(given, says):
    with pytest.raises(SystemModelError, match=says):
        ExploreOptions(**given)


@pytest.mark.parametrize(
    ("range_hz", "period", "says"),
    [
        ((10.0, 5.0), 2, "range_hz"),
        ((5.0, 10.0), 0, "max_period"),
        ((5.0, 10.0), 1.5, "max_period"),
    ],
)
def test_bad_questions_are_refused_before_any_simulation(range_hz, period, says):
    with pytest.raises(SystemModelError, match=says):
        explore(system_of("one_dof"), range_hz, period)
