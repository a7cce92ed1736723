"""Guesses: pieces of known orbits put together where they nearly fit."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from nldyn.base.arrays import Real
from nldyn.branches.branch import Branch
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.axis import Section
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import SEGMENTS_PER_PERIOD
from nldyn.orbits.starts import LONG_STEPS, SHORT_STEPS, nearest_orbit
from nldyn.search.collector import Collector
from nldyn.search.extend import Guesses, Place, check_numbers

NODES = 8  # states of an orbit in each period
PLACES = 3  # most frequencies at which a branch gives pieces
ALIKE = 0.05  # relative difference of orbits that are taken for one
NEAREST = 60  # pieces that may follow one: bounds time and memory where there are hundreds
MOST_PATHS = 200_000  # the shortest, that are prolonged: bounds them for longer periods
NEAR = 0.5  # sum of the jumps, over the size of the pieces, up to which all are as good
FARTHEST = 2.0  # up to which they are put together
MOST_ALIKE = 4  # pseudo-orbits made of the same orbits that are tried, in other orders or places
WAYS = (NODES // SEGMENTS_PER_PERIOD, LONG_STEPS), (1, SHORT_STEPS)  # every how many states, steps


@dataclass(frozen=True)
class PseudoOrbits:
    """A strategy of `extend_diagram`: to guess where pieces of known orbits nearly fit together.

    A pseudo-orbit is a sequence of pieces of motions with small jumps between them; in a hyperbolic
    set an orbit is near every one [Bowen 1975]. Here the pieces are single excitation periods of
    known orbits, of any period and of frequencies close together, put together in closed sequences:
    in random order where the jumps are small and then by their size. No motion is simulated; it is
    the faster the fewer branches there are, and slow for long periods: with few branches of the
    1-DOF model up to period 3 in 6 s, to 5 in 270 s. What resembles no orbits known is not found.

    Parameters
    ----------
    tries : int
        Most pseudo-orbits of each length at each frequency from which an orbit is looked for; those
        of the same orbits, four at most, come after one of each choice of orbits.
    seed : int
        Of the random order; another one tries others first.

    Raises
    ------
    SystemModelError
        For numbers that make no sense.

    Examples
    --------
    >>> PseudoOrbits(tries=50)
    PseudoOrbits(tries=50, seed=0)
    """

    tries: int = 2000
    seed: int = 0

    what = "pseudo-orbits"
    of_known = True

    def __post_init__(self) -> None:
        check_numbers(self, self.tries)

    def check(self, longest: int) -> None:
        """Pieces may be put together to any period."""

    def guesses(self, box: Collector, branches: Sequence[Branch], place: Place) -> Guesses:
        """The branches of each, and the orbits near it that are in the range.

        Those that long steps between few states lead to, and short steps between many: beside few
        orbits the first meet more others, beside many the second.
        """
        pieces = Pieces.of(branches, place.here, place.spacing)
        for period in place.periods:
            for sequence in islice(pieces.pseudo_orbits(period, MOST_ALIKE, place.rng), self.tries):
                box.tell(self.what, place.here.value)
                chosen = list(sequence)
                nodes = pieces.nodes[chosen]
                orbits = [
                    nearest_orbit(place.here, nodes[:, ::every], box.observe, steps)
                    for every, steps in WAYS
                ]
                yield set(pieces.branch[chosen].tolist()), box.within(orbits)


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of orbits, each one excitation period long.

    Parameters
    ----------
    branch : (m,) int array
        Index of the branch that each is of.
    passage : (m,) int array
        Number of its orbit, the same of orbits of one branch that hardly differ.
    place : (m,) int array
        Which of the periods of its orbit it is, from zero.
    period : (m,) int array
        Period multiple of the orbit.
    nodes : (m, k, 2n) array
        States z at k equidistant phases.
    ends : (m, 2n) array
        States one period after the first.
    """

    branch: NDArray[np.intp]
    passage: NDArray[np.intp]
    place: NDArray[np.intp]
    period: NDArray[np.intp]
    nodes: Real
    ends: Real

    @classmethod
    def of(cls, branches: Sequence[Branch], here: Section, spacing: float) -> Pieces:
        """Pieces of the orbits of some branches within a distance of a value."""
        window = here.axis.around(here.value, spacing)
        pieces: list[tuple[int, int, int, int, Real, Real]] = []
        passages = 0
        for index, branch in enumerate(branches):
            orbits = list(_orbits_within(branch, window, here.base))
            for number, nodes in zip(_passages(orbits), orbits, strict=True):
                for place, after in enumerate(np.roll(nodes[:, 0], -1, axis=0)):
                    row = index, passages + number, place, len(nodes), nodes[place], after
                    pieces.append(row)
            passages += len(orbits)
        columns = zip(*pieces, strict=True) if pieces else ((),) * 6
        branch_, passage, place_, period, nodes_, ends = map(np.array, columns)
        return cls(branch_, passage, place_, period, nodes_, ends)

    @cached_property
    def jumps(self) -> Real:
        """Distance (m, m) from the end of a piece to the beginning of another, over their size."""
        starts = self.nodes[:, 0]
        size = float(np.linalg.norm(starts, axis=1).mean()) or 1.0
        return np.asarray(cdist(self.ends, starts) / size)

    def is_orbit(self, sequence: Sequence[int]) -> bool:
        """Whether a sequence is that of an orbit, or of orbits that hardly differ."""
        chosen = np.array(sequence)
        if np.ptp(self.passage[chosen]):
            return False
        steps = np.roll(self.place[chosen], -1) - self.place[chosen] - 1
        return not np.any(steps % self.period[chosen])

    def pseudo_orbits(
        self, period: int, most_alike: int, rng: np.random.Generator
    ) -> Iterator[tuple[int, ...]]:
        """Closed sequences of pieces, at random where the jumps are small, then by their size.

        Not those that are orbits, nor shorter sequences repeated. First is one of each choice of
        orbits, then a second one, in another order or place, and so on: what differs more leads to
        more, and the smallest jumps are those of pieces that are most alike. Of very many pieces
        only the nearest are put together, and only the shortest of the sequences kept.

        Parameters
        ----------
        period : int
            Number of pieces.
        most_alike : int
            Most of the sequences made of the same orbits.
        rng : Generator
            Of the random order.
        """
        if not self.branch.size:
            return
        alike = Counter[tuple[int, ...]]()
        seen: set[tuple[int, ...]] = set()
        later: list[list[tuple[int, ...]]] = [[] for _ in range(1, most_alike)]
        for sequence in _closed_paths(self.jumps, period, rng):
            begun_elsewhere = [sequence[i:] + sequence[:i] for i in range(period)]
            first = min(begun_elsewhere)
            orbits = tuple(sorted(self.passage[list(first)].tolist()))
            count = alike[orbits]
            repeats = begun_elsewhere.count(first) > 1
            if repeats or first in seen or count >= most_alike or self.is_orbit(first):
                continue
            seen.add(first)
            alike[orbits] += 1
            if count:
                later[count - 1].append(first)
            else:
                yield first
        for sequences in later:
            yield from sequences


def _orbits_within(branch: Branch, window: tuple[float, float], base: FlowMap) -> Iterator[Real]:
    """States (period, NODES, 2n) of orbits of a branch at a few values within a window."""
    reached = branch.values
    low, high = max(window[0], float(reached.min())), min(window[1], float(reached.max()))
    if low >= high:
        return
    count = 1 + round((PLACES - 1) * (high - low) / (window[1] - window[0]))
    for share in (np.arange(count) + 0.5) / count:
        for orbit in branch.at(low + share * (high - low)):
            yield nodes_of(orbit, base)


def nodes_of(orbit: Orbit, base: FlowMap) -> Real:
    """States z (period, NODES, 2n) of an orbit at equidistant phases of each of its periods.

    They are in the coordinates of a base.
    """
    phases = 2.0 * math.pi / NODES * np.arange(NODES * orbit.period, dtype=float)
    return base.to_state(orbit.states(phases)).reshape(orbit.period, NODES, -1)


def _passages(orbits: Sequence[Real]) -> list[int]:
    """Numbers of some orbits of a branch, the same of those that hardly differ."""
    numbers: list[int] = []
    for orbit in orbits:
        size = ALIKE * float(np.linalg.norm(orbit))
        near = (n for n in numbers if np.linalg.norm(orbit - orbits[n]) < size)
        numbers.append(next(near, len(numbers)))
    return numbers


def _closed_paths(jumps: Real, length: int, rng: np.random.Generator) -> Iterator[tuple[int, ...]]:
    """Closed paths over places, some of them more than once: near ones at random, then in order."""
    near = np.argsort(jumps, axis=1)[:, :NEAREST]
    paths = np.arange(len(jumps))[:, None]
    ways = np.zeros(len(jumps))
    for _ in range(length - 1):
        last = paths[:, -1]
        longer = ways[:, None] + jumps[last[:, None], near[last]]
        chosen = np.flatnonzero(longer < FARTHEST)
        if chosen.size > MOST_PATHS:
            chosen = chosen[np.argpartition(longer.flat[chosen], MOST_PATHS)[:MOST_PATHS]]
        before, column = np.divmod(chosen, near.shape[1])
        paths = np.column_stack([paths[before], near[last[before], column]])
        ways = longer.flat[chosen]
    ways = ways + jumps[paths[:, -1], paths[:, 0]]
    chance = rng.permutation(len(ways))
    order = np.lexsort([chance, np.maximum(ways, NEAR)])
    for path in paths[order[ways[order] < FARTHEST]]:
        yield tuple(path.tolist())
