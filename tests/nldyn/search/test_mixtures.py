"""Orbits are found beside mixtures of two others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from problems import section_of

from nldyn.orbits.axis import Axis
from nldyn.search import Mixtures
from nldyn.search import mixtures as crossover
from nldyn.search.extend import PLACES, WINDOW, Place, collector_beside, orbits_near
from nldyn.search.mixtures import BEYOND, NEIGHBOURS, Loops
from nldyn.search.pseudo_orbits import NODES


def test_orbits_beyond_the_range_are_not_met(three):
    """Mixed just below its upper end, half of them lie above it."""
    (harmonic,) = three.of_period(1)
    _, high = three.limits
    box = collector_beside(replace(three, branches=(harmonic,)), three.axis, None, None, None)
    inside, outside = [], []
    for top, found in ((high, inside), (2.0 * high, outside)):
        place = Place(box.at(high), 0.01, range(1, 2), np.random.default_rng(1))
        box.axis = Axis.in_frequency((three.limits[0], top))
        for _, orbits in Mixtures(tries=50).guesses(box, box.branches, place):
            found += [orbit.frequency_hz for orbit in orbits]
    assert inside == [hz for hz in outside if hz <= high]
    assert len(inside) < len(outside)


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
    here = section_of(branches[0], frequency_hz)
    return Loops.of(branches, here, longest, np.random.default_rng(seed))


def test_loops_are_motions_over_the_period_of_the_orbit(three):
    for branch in three.branches:
        loops, orbits = loops_of([branch], 36.5), orbits_near(branch, section_of(branch, 36.5))
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
