"""Orbits are found beside closed walks among random states."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from problems import make_one_dof, section, section_of

from nldyn import Stop
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.orbit import stroboscopic
from nldyn.search import ClosedWalks
from nldyn.search.extend import WINDOW, Place, orbits_near
from nldyn.search.random_walks import (
    LEAST,
    NARROWEST,
    NEIGHBOURS,
    Cloud,
    StateGraph,
    _known_states,
)
from nldyn.system.system import System

OMEGA = 2.0 * np.pi * 37.0


def graph_of(count=400, seed=0):
    """Of the 1-DOF model, with its cloud."""
    flow, rng = FlowMap(make_one_dof()), np.random.default_rng(seed)
    cloud = Cloud.of(flow, 1e-5 * rng.standard_normal((50, 2)))
    return flow, cloud, StateGraph.of(flow, OMEGA, cloud, count, rng)


def test_edges_go_to_the_states_nearest_to_the_image():
    flow, cloud, graph = graph_of()
    for state, successors in zip(graph.states, graph.successors, strict=True):
        image = flow.strobe(state, OMEGA, 1).ends[0]
        off = np.linalg.norm(cloud.scaled(graph.states - image), axis=1)
        assert set(successors) == set(np.argsort(off)[:NEIGHBOURS])


def test_of_few_states_all_are_near():
    _, _, graph = graph_of(count=3)
    assert graph.successors.shape == (3, 3)


@pytest.mark.parametrize("length", [1, 2, 3, 5])
def test_walks_follow_edges_and_close(length):
    """One through each state through which the powers of the matrix of the edges count any."""
    graph = graph_of()[2]
    walks = list(graph.closed_walks(length, np.random.default_rng(0)))
    for walk in walks:
        assert len(walk) == length
        for at, after in zip(walk, walk[1:] + walk[:1], strict=True):
            assert after in graph.successors[at]
    edges = np.zeros((400, 400))
    np.put_along_axis(edges, graph.successors, 1.0, axis=1)
    through = np.diag(np.linalg.matrix_power(edges, length))
    assert sorted(walk[0] for walk in walks) == np.flatnonzero(through).tolist()


def test_each_closed_walk_through_a_state_is_as_likely_as_another():
    """Of three edges; the scatter of 4000 of them is that of equal chances."""
    successors = np.array([[0, 1], [2, 3], [0, 1], [0, 2]])
    graph = StateGraph(np.zeros((4, 2)), successors)
    rng = np.random.default_rng(0)
    walks = [w for _ in range(4000) for w in graph.closed_walks(3, rng) if w[0] == 0]
    counts = Counter(map(tuple, walks))
    wanted = {(0, b, c) for b in successors[0] for c in successors[b] if 0 in successors[c]}
    assert set(counts) == wanted
    assert len(wanted) > 2
    share = len(walks) / len(wanted)
    assert max(abs(count - share) for count in counts.values()) < 5.0 * np.sqrt(share)


def test_random_states_have_the_mean_and_covariance_of_those_known():
    rng = np.random.default_rng(1)
    mix = np.array([[3.0, 0.0, 0.0, 0.0], [2.0, 0.1, 0.0, 0.0], [0, 0, 1.0, 0], [0, 0, 0, 1e-2]])
    spread = np.sqrt(np.sum(mix**2, axis=1))
    correlation = mix @ mix.T / np.outer(spread, spread)
    widened = 2.0 * NARROWEST**2 / np.linalg.eigvalsh(correlation)[0]  # twice for the sample's own
    known = rng.standard_normal((300, 4)) @ mix.T + np.array([1.0, -2.0, 0.0, 5.0])
    system = System.from_modal([10.0, 20.0], {"tip": [1.0, 1.0]}, modal_damping=0.1)
    cloud = Cloud.of(FlowMap(system), known)
    states = cloud.scaled(cloud.states(40_000, rng) - known.mean(axis=0))
    assert np.abs(states.mean(axis=0)).max() < 5.0 / np.sqrt(40_000)
    assert np.abs(np.cov(states.T) - np.eye(4)).max() < 5.0 * np.sqrt(2.0 / 40_000)
    inside = cloud.scaled(known - known.mean(axis=0))
    assert np.abs(np.cov(inside.T, bias=True) - np.eye(4)).max() < widened


def test_random_states_are_no_deeper_in_a_stop_than_those_known():
    """Of 5000 normally distributed ones a hundred and more would be deeper; some are nearly so."""
    flow, rng = FlowMap(make_one_dof()), np.random.default_rng(0)
    row = flow.rows[0]
    known = rng.standard_normal((100, 2)) / np.linalg.norm(row)
    known = known[known @ row < 1.5]
    deepest = (known @ row).max()
    cloud = Cloud.of(flow, known)
    free = (cloud.mean + rng.standard_normal((5000, 2)) @ cloud.axes.T) @ row
    assert np.count_nonzero(free > deepest) > 100
    reached = (cloud.states(5000, rng) @ row).max()
    assert np.sort(free[free <= deepest])[-20] < reached <= deepest


def test_between_two_pressed_stops_there_is_room_for_states():
    """At rest, against both: no known state is deeper than any other."""
    modes = {"middle": [1.0], "back": [-1.0]}
    stops = [Stop("middle", stiffness=5.17e9), Stop("back", stiffness=5.17e9)]
    system = System.from_matrices([[2.48]], [[16877.0]], modes, modal_damping=0.01, stops=stops)
    flow = FlowMap(system)
    states = Cloud.of(flow, np.zeros((5, 2))).states(500, np.random.default_rng(0))
    assert states.shape == (500, 2)
    depths = states @ flow.rows[:2].T
    assert depths.max(axis=0).min() > 0.0


def test_where_hardly_any_state_is_shallow_enough_the_search_for_some_ends():
    """A thousand bounds a standard deviation away, all independent."""
    rows = np.eye(1000)
    cloud = Cloud(np.zeros(1000), np.eye(1000), rows, np.ones(1000))
    assert len(cloud.states(5, np.random.default_rng(0))) == 0
    few = Cloud(np.zeros(1000), np.eye(1000), rows[:20], np.ones(20))  # 0.84^20 = 3 % allowed
    states = few.states(5, np.random.default_rng(0))
    assert len(states) == 5
    assert states[:, :20].max() <= 1.0


def test_known_orbits_near_a_frequency_tell_where_states_lie_and_no_others(three):
    flow = three.branches[0].points[0].problem.flow
    (harmonic,), (third,) = three.of_period(1), three.of_period(3)
    above = 1.01 * (1.0 + WINDOW) * third.frequency_hz.max()
    motions, with_near, with_far = (
        _known_states(section(flow, above), branches, np.random.default_rng(0))
        for branches in ([], [harmonic], [third])
    )
    assert np.array_equal(with_near[: len(motions)], motions)
    assert np.array_equal(with_far, motions)
    near = orbits_near(harmonic, section_of(harmonic, above))
    orbits = np.vstack([stroboscopic(orbit) for orbit in near])
    assert np.array_equal(with_near[len(motions) :], orbits)


def test_states_that_cannot_be_carried_on_are_left_out(monkeypatch):
    """And where no motion can be, and no orbit is known, no walk is tried."""
    flow, cloud, _ = graph_of()
    whole = FlowMap.strobe

    def strobe(self, state, omega, periods):
        found = whole(self, state, omega, periods)
        return replace(found, failure="too fast") if state[0] > 0.0 else found

    monkeypatch.setattr(FlowMap, "strobe", strobe)
    graph = StateGraph.of(flow, OMEGA, cloud, 200, np.random.default_rng(0))
    assert 0 < len(graph.states) < 200
    assert graph.states[:, 0].max() <= 0.0
    assert len(graph.successors) == len(graph.states)
    monkeypatch.setattr(
        FlowMap, "strobe", lambda self, *given: replace(whole(self, *given), failure="too fast")
    )
    nothing = StateGraph.of(flow, OMEGA, cloud, 200, np.random.default_rng(0))
    assert list(nothing.closed_walks(3, np.random.default_rng(0))) == []
    box = SimpleNamespace(flow=flow, tell=lambda *_: None)
    place = Place(section(flow, 37.0), 0.01, range(1, 3), np.random.default_rng(0))
    assert list(ClosedWalks(states=50, tries=5).guesses(box, [], place)) == []


def test_a_long_walk_to_which_few_of_all_lead_is_found():
    """Of 400 edges: one in 20^400 leads back to the state that no other one leads to."""
    successors = np.tile(np.arange(1, 21), (21, 1))
    successors[0] = np.arange(20)
    graph = StateGraph(np.zeros((21, 2)), successors)
    walks = graph.closed_walks(400, np.random.default_rng(0))
    assert [0] * 400 in walks


def test_walks_begin_in_random_order():
    graph = graph_of()[2]
    firsts = [next(graph.closed_walks(3, np.random.default_rng(seed)))[0] for seed in range(5)]
    assert len(set(firsts)) == 5


@pytest.mark.parametrize("size", [0.0, 1.0, 1e-170, 1e170])
def test_states_that_are_all_alike_give_others_near_them(size):
    """Also where squares of them would be too small or too large to be told."""
    cloud = Cloud.of(FlowMap(make_one_dof()), np.full((5, 2), size))
    states = cloud.states(50, np.random.default_rng(0))
    assert np.ptp(states, axis=0).min() > 0.0
    assert np.abs(states - size).max() < 5.0 * LEAST * (size or 1.0)  # five standard deviations
    assert np.abs(cloud.scaled(states - size)).max() < 5.0
