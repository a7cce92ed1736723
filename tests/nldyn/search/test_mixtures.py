"""Orbits are found beside mixtures of two others."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from branches_alike import without
from problems import THREE_HZ

from nldyn import SystemModelError, by_crossover, index_sum
from nldyn.search import mixtures as crossover
from nldyn.search.exploration import steps_between
from nldyn.search.extend import PLACES, WINDOW, collector_beside, orbits_near
from nldyn.search.mixtures import BEYOND, NEIGHBOURS, Loops, near_mixtures
from nldyn.search.pseudo_orbits import NODES


@pytest.mark.parametrize(
    ("period", "tries"), [pytest.param(1, 50, marks=pytest.mark.slow), (2, 50), (3, 200)]
)
def test_a_branch_is_found_from_mixtures_of_the_others(three, period, tries):
    """Period 3 from stretches of period 2 that do not close, to which one in 200 or so leads."""
    (left_out,) = three.of_period(period)
    done = by_crossover(without(three, left_out), tries=tries, spacing=0.02)
    (found,) = done.branches[2:]
    assert found.period == period
    assert all(left_out.contains(orbit) for orbit in found.points)
    assert done.notes[-1].endswith("1 branch beside those given")
    assert [index_sum(done.branches, 36.5, n) for n in (1, 2, 3)] == [1, 1, 1]


def test_what_is_known_is_met_and_not_found_again(three):
    done = by_crossover(three, tries=50, spacing=0.02)
    assert len(done.branches) == 3
    met = re.search(r"to (\d) of the 3 given there, 0 branches", done.notes[-1])
    assert int(met[1]) >= 2
    assert done.notes[:-2] == tuple(n for n in three.notes if not n.startswith("indices"))


def test_what_its_own_orbits_lead_to_is_not_met_from_others(three):
    """The harmonic alone: every mixture is of two of its orbits."""
    (harmonic,) = three.of_period(1)
    done = by_crossover(replace(three, branches=(harmonic,)), max_period=1, tries=20)
    came, met = re.search(r"^(\d+) of .*, to (\d+) of the 1 given", done.notes[-1]).groups()
    assert int(came) > 0
    assert met == "0"


def test_orbits_beyond_the_range_are_not_met(three):
    """Mixed just below its upper end, half of them lie above it."""
    (harmonic,) = three.of_period(1)
    _, high = three.range_hz
    box = collector_beside(replace(three, branches=(harmonic,)), None, None, None)
    inside, outside = [], []
    for top, found in ((high, inside), (2.0 * high, outside)):
        rng = np.random.default_rng(1)
        box.range_hz = three.range_hz[0], top
        for _, orbits in near_mixtures(box, box.branches, high, range(1, 2), 50, rng):
            found += [orbit.frequency_hz for orbit in orbits]
    assert inside == [hz for hz in outside if hz <= high]
    assert len(inside) < len(outside)


def test_only_the_periods_and_frequencies_wanted_are_tried(three):
    tried = set()
    done = by_crossover(
        three, min_period=2, max_period=2, range_hz=(37.2, 38.0), tries=3, spacing=0.005,
        progress=lambda what, hz, done: tried.add(hz),
    )  # fmt: skip
    assert 37.2 < min(tried) < max(tried) < 38.0
    assert f" of {3 * len(tried)} mixtures led to" in done.notes[-1]
    assert " of the 1 given" in done.notes[-1]  # period 3 ends below


def test_no_longer_orbits_are_looked_for_than_wanted(three):
    (third,) = three.of_period(3)
    done = by_crossover(without(three, third), max_period=2, tries=5)
    assert len(done.branches) == 2
    assert " of the 2 given" in done.notes[-1]


def test_as_many_are_tried_as_wanted(three):
    """Two of each of three lengths at each frequency."""
    done = by_crossover(three, tries=2, spacing=0.02)
    tried = int(re.search(r"of (\d+) mixtures", done.notes[-1])[1])
    assert tried == 2 * 3 * steps_between(*THREE_HZ, 0.02)


def test_the_same_seed_gives_the_same_and_another_one_other_mixtures(three):
    notes = [by_crossover(three, tries=5, seed=seed).notes[-1] for seed in (1, 1, 2)]
    assert notes[0] == notes[1] != notes[2]


def test_mixtures_lie_on_the_line_through_two_orbits():
    """Each of one state, drawn as often as the other, up to 0.8 of the way beyond either."""
    pair = Loops(np.array([4, 7]), [np.full((1, 1, 2), x) for x in (0.0, 1.0)])
    rng, places, alone = np.random.default_rng(0), [], 0
    for _ in range(4000):
        used, nodes = pair.mixture(1, rng)
        assert used <= {4, 7}
        assert nodes.shape == (1, 1, 2)
        alone += len(used) == 1
        if len(used) == 2:
            places.append(nodes[0, 0, 0])
    assert abs(alone - 2000) < 5.0 * np.sqrt(1000.0)
    assert min(places) == pytest.approx(-BEYOND, abs=0.01)
    assert max(places) == pytest.approx(1.0 + BEYOND, abs=0.01)
    assert np.mean(places) == pytest.approx(0.5, abs=5.0 * 0.75 / np.sqrt(len(places)))


def test_an_orbit_is_begun_at_each_of_its_periods_and_goes_on_in_its_order():
    """Its states are the numbers of its periods: a mixture of two stretches that begin alike."""
    orbit, rng = Loops(np.array([0]), [np.arange(3.0)[:, None, None]]), np.random.default_rng(0)
    mixtures = [orbit.mixture(4, rng)[1].ravel() for _ in range(50)]
    whole = [m for m in mixtures if np.allclose(m, np.round(m)) and set(m) <= {0.0, 1.0, 2.0}]
    assert {int(m[0]) for m in whole} == {0, 1, 2}
    assert all(np.array_equal(np.diff(m) % 3.0, np.ones(3)) for m in whole)


def loops_of(branches, frequency_hz, longest=3, seed=0):
    return Loops.of(branches, frequency_hz, longest, np.random.default_rng(seed))


def test_loops_are_motions_over_the_period_of_the_orbit(three):
    for branch in three.branches:
        loops, orbits = loops_of([branch], 36.5), orbits_near(branch, 36.5)
        assert len(loops.nodes) == len(orbits) > 1
        for nodes, orbit in zip(loops.nodes, orbits, strict=True):
            assert nodes.shape == (branch.period, NODES, 2)
            ends = orbit.problem.flow.strobe(nodes[0, 0], orbit.omega, branch.period).ends
            following = np.roll(nodes[:, 0], -1, axis=0)
            assert np.abs(ends[-branch.period :] - following).max() < 1e-6 * np.abs(nodes).max()


def test_the_branches_nearest_in_frequency_are_mixed(three):
    """One that ends below the frequency, if there are not so many others that reach it."""
    (harmonic,), (third,) = three.of_period(1), three.of_period(3)
    above = 1.001 * third.frequency_hz.max()
    for others, used in ((NEIGHBOURS - 1, True), (NEIGHBOURS, False)):
        loops = loops_of([third, *[harmonic] * others], above)
        assert (0 in loops.branch) == used
        assert len(set(loops.branch.tolist())) == NEIGHBOURS


def test_branches_of_longer_periods_than_wanted_are_mixed_last(three, monkeypatch):
    """However near: doubled ones may be many. Of as many that reach the frequency, any."""
    (harmonic,), (third,) = three.of_period(1), three.of_period(3)
    most = 5
    monkeypatch.setattr(crossover, "NEIGHBOURS", most)
    branches = [*[third] * most, harmonic]
    for longest, wanted in ((1, {True}), (3, {True, False})):
        seeds = range(50)  # left out by none: chance (5/6)^50, 1e-4
        mixed = [most in loops_of(branches, 37.0, longest, n).branch for n in seeds]
        assert set(mixed) == wanted


def test_of_a_branch_its_orbits_near_the_frequency_are_mixed_or_else_the_nearest(three):
    (third,) = three.of_period(3)
    assert len(loops_of([third], 37.0).nodes) == PLACES
    far = third.frequency_hz.max() * (1.0 + 2.0 * WINDOW)
    assert len(loops_of([third], far).nodes) == 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tries": 0}, "tries must be"),
        ({"tries": 1.5}, "tries must be"),
        ({"seed": -1}, "seed must be"),
        ({"max_period": 0}, "max_period must be"),
        ({"min_period": 0}, "min_period must be"),
        ({"min_period": 3, "max_period": 2}, "min_period must be"),
        ({"range_hz": (30.0, 37.0)}, r"\(30, 37\) must lie within that of .*, \(36, 38.5\)"),
        ({"range_hz": (37.0, 37.0)}, "range_hz must be two positive frequencies"),
        ({"spacing": 0.0}, "spacing must be at least 1e-06 and less than 1, got 0"),
        ({"known": None}, "known must be a Diagram"),
        ({"progress": 3}, "progress must be"),
    ],
)
def test_what_makes_no_sense_is_refused(three, change, message):
    known = change.get("known", three)
    options = {key: value for key, value in change.items() if key != "known"}
    with pytest.raises(SystemModelError, match=message):
        by_crossover(known, **options)
