"""Orbits are found beside pieces of others that nearly fit together."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import section_of

from nldyn.orbits.starts import nearest_orbit
from nldyn.search import pseudo_orbits
from nldyn.search.pseudo_orbits import FARTHEST, NEAR, NODES, WAYS, Pieces


def test_short_steps_between_more_states_lead_back_to_an_orbit_more_often(three):
    """A hundred times, each of its pieces moved by itself by a tenth of their size.

    Where only one way leads back either would be as likely, were both as good.
    """
    (third,) = three.of_period(3)
    orbit = third.at(36.5)[0]
    flow = orbit.problem.flow
    phases = 2.0 * np.pi / NODES * np.arange(3 * NODES)
    nodes = flow.to_state(orbit.states(phases)).reshape(3, NODES, -1)
    size = np.linalg.norm(nodes[:, 0], axis=1).mean()
    rng, back, here = np.random.default_rng(1), [], three.axis.at(flow, orbit.frequency_hz)
    for _ in range(100):
        moved = nodes + 0.1 * size * rng.standard_normal((3, 1, 2)) / np.sqrt(2.0)
        for every, steps in WAYS:
            found = nearest_orbit(here, moved[:, ::every], "middle", steps)
            back.append(found is not None and third.contains(found))
    long, short = np.reshape(back, (100, len(WAYS))).T
    only_short, only_long = np.sum(short & ~long), np.sum(long & ~short)
    assert only_short - only_long > 4.0 * np.sqrt(only_short + only_long)


def test_pieces_are_motions_over_one_period_of_the_excitation(three):
    pieces = Pieces.of(three.branches, section_of(three.branches[0], 36.5), 1e-9)
    flow = three.branches[0].points[0].problem.flow
    assert sorted(set(pieces.period.tolist())) == [1, 2, 3]
    for nodes, end in zip(pieces.nodes, pieces.ends, strict=True):
        found = flow.strobe(nodes[0], 2.0 * np.pi * 36.5, 1)
        assert np.abs(found.ends[-1] - end).max() < 1e-7 * np.abs(pieces.nodes).max()


def test_orbits_on_either_side_of_a_fold_are_two(three):
    (third,) = three.of_period(3)
    fold = max(s.frequency_hz for s in third.special_points if s.kind == "LP")
    pieces = Pieces.of([third], section_of(third, 0.99 * fold), 1e-9)
    assert len(third.at(0.99 * fold)) == len(set(pieces.passage.tolist())) == 2


def test_a_narrow_branch_gives_pieces_although_it_does_not_reach_the_frequency(three):
    (third,) = three.of_period(3)
    highest = third.frequency_hz.max()
    assert Pieces.of([third], section_of(third, highest * 1.005), 0.01).branch.size
    assert not Pieces.of([third], section_of(third, highest * 1.02), 0.01).branch.size


def test_pieces_of_one_orbit_in_its_order_are_the_orbit():
    """Not those of two orbits of one branch."""
    place, period = np.array([0, 1, 2, 0, 0]), np.array([3, 3, 3, 1, 1])
    branch, passage = np.array([0, 0, 0, 1, 1]), np.array([0, 0, 0, 1, 2])
    pieces = Pieces(branch, passage, place, period, np.zeros((5, 2, 2)), np.zeros((5, 2)))
    assert pieces.is_orbit((1, 2, 0))
    assert pieces.is_orbit((3, 3, 3))
    assert not pieces.is_orbit((3, 4))
    assert not pieces.is_orbit((0, 2, 1))
    assert not pieces.is_orbit((0, 1))
    assert not pieces.is_orbit((0, 1, 3))


def pieces_at_random(count: int, seed: int) -> Pieces:
    ends, starts = np.random.default_rng(seed).standard_normal((2, count, 4))
    zeros = np.zeros(count, dtype=int)
    return Pieces(zeros, np.arange(count), zeros, zeros + 1, starts[:, None], ends)


def way(pieces: Pieces, sequence: tuple[int, ...]) -> float:
    """Sum of the jumps of a closed sequence."""
    steps = zip(sequence, sequence[1:] + sequence[:1], strict=True)
    return sum(pieces.jumps[a, b] for a, b in steps)


@given(st.integers(1, 4), st.integers(1, 6), st.integers(0, 2**32 - 1))
def test_closed_sequences_come_in_the_order_of_their_jumps(length, count, seed):
    """Against all, of which those that begin elsewhere are one; first one of each choice."""
    pieces = pieces_at_random(count, seed)
    begun = {
        s: [s[i:] + s[:i] for i in range(length)] for s in product(range(count), repeat=length)
    }
    wanted = {
        min(same)
        for s, same in begun.items()
        if way(pieces, s) < FARTHEST and len(set(same)) == length > 1
    }
    found = list(pieces.pseudo_orbits(length, 100, np.random.default_rng(0)))
    assert len(found) == len(set(found))
    assert set(found) == wanted
    choices = [tuple(sorted(sequence)) for sequence in found]
    ranks = [choices[:i].count(choice) for i, choice in enumerate(choices)]
    assert ranks == sorted(ranks)
    ways = [max(way(pieces, sequence), NEAR) for sequence in found]
    for i, j in pairwise(range(len(found))):
        assert ranks[i] < ranks[j] or ways[j] - ways[i] > -1e-12
    for most in (1, 2):
        some = [
            tuple(sorted(sequence))
            for sequence in pieces.pseudo_orbits(length, most, np.random.default_rng(0))
        ]
        assert max(map(some.count, some), default=0) <= most


def test_closed_sequences_of_small_jumps_come_in_no_order():
    """The jumps of pieces alike, a thousandth of their size: all sums are below the bound."""
    alike = pieces_at_random(12, 1)
    pieces = replace(alike, nodes=1.0 + 1e-3 * alike.nodes, ends=1.0 + 1e-3 * alike.ends)
    ways = [
        way(pieces, sequence) for sequence in pieces.pseudo_orbits(3, 1, np.random.default_rng(0))
    ]
    assert len(ways) > 100
    rising = np.sum(np.diff(ways) > 0.0)
    assert abs(rising - len(ways) / 2) < 5.0 * np.sqrt(len(ways) / 12)  # of a random permutation


@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.integers(1, 40))
def test_of_very_many_pieces_some_of_the_sequences_are_left_out(seed, nearest, most_paths):
    """Those that a search of the nearest, prolonged by one at a time, leaves out."""
    pieces = pieces_at_random(8, seed)
    all_of_them = set(pieces.pseudo_orbits(3, 100, np.random.default_rng(0)))
    ranks = np.argsort(np.argsort(pieces.jumps, axis=1), axis=1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pseudo_orbits, "NEAREST", nearest)
        near = set(pieces.pseudo_orbits(3, 100, np.random.default_rng(0)))
        patch.setattr(pseudo_orbits, "MOST_PATHS", most_paths)
        few = set(pieces.pseudo_orbits(3, 100, np.random.default_rng(0)))
    assert few <= near <= all_of_them
    assert len(few) <= most_paths
    for sequence in all_of_them:
        steps = zip(sequence, sequence[1:] + sequence[:1], strict=True)
        far = sum(ranks[a, b] >= nearest for a, b in steps)
        assert (sequence in near) == (far <= 1)  # the last step back to the first may be long
