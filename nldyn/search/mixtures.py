"""Guesses: mixtures of two known orbits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.branches.branch import Branch
from nldyn.orbits.axis import Section
from nldyn.orbits.starts import SHORT_STEPS, nearest_orbit
from nldyn.search.collector import Collector
from nldyn.search.extend import Guesses, Place, check_numbers, distance_from, orbits_near
from nldyn.search.pseudo_orbits import nodes_of

NEIGHBOURS = 40  # branches whose orbits are mixed, the nearest in the parameter
BEYOND = 0.8  # part of the way between two orbits by which a mixture may lie beyond either


@dataclass(frozen=True)
class Mixtures:
    """A strategy of `extend_diagram`: to guess between and beyond two known orbits.

    The states of two orbits at the same phases, eight in each excitation period, are mixed,
    (1 - λ)A + λB with a random λ from -0.8 to 1.8, either begun at a random one of its periods:
    the arithmetic crossover of genetic algorithms [Michalewicz 1996]. They are of the forty
    branches nearest in frequency, those up to the longest period wanted before others, of each up
    to six orbits within 3 % of it, or else the nearest; both may be of one branch. Orbits whose
    period does not divide the one wanted give a stretch of it, which does not close. No motion is
    simulated, so that orbits are found whatever their stability and energy, if they lie among those
    known.

    Parameters
    ----------
    tries : int
        How many mixtures of each length at each frequency.
    seed : int
        Of the random numbers; another one tries others.

    Raises
    ------
    SystemModelError
        For numbers that make no sense.

    Examples
    --------
    >>> Mixtures(tries=50, seed=1)
    Mixtures(tries=50, seed=1)
    """

    tries: int = 500
    seed: int = 0

    what = "mixtures"
    of_known = True

    def __post_init__(self) -> None:
        check_numbers(self, self.tries)

    def check(self, longest: int) -> None:
        """Orbits of any period may be mixed."""

    def guesses(self, box: Collector, branches: Sequence[Branch], place: Place) -> Guesses:
        """The two branches of each mixture, and the orbit near it if that is in the range."""
        if not branches:
            return
        loops = Loops.of(branches, place.here, place.periods[-1], place.rng)
        for period in place.periods:
            for _ in range(self.tries):
                box.tell(self.what, place.here.value)
                used, nodes = loops.mixture(period, place.rng)
                orbit = nearest_orbit(place.here, nodes, box.observe, SHORT_STEPS)
                yield used, box.within([orbit])


@dataclass(frozen=True, eq=False)
class Loops:
    """Orbits by their states.

    Parameters
    ----------
    branch : (m,) int array
        Index of the branch that each is of.
    nodes : sequence of m (period, k, 2n) arrays
        States z at k equidistant phases of each excitation period.
    """

    branch: NDArray[np.intp]
    nodes: Sequence[Real]

    @classmethod
    def of(
        cls,
        branches: Sequence[Branch],
        here: Section,
        longest: int,
        rng: np.random.Generator,
    ) -> Loops:
        """Those of the branches nearest to a value, first those up to a period.

        Of more that reach the value, some at random.
        """
        away = [distance_from(branch, here) for branch in branches]
        longer = [branch.period > longest for branch in branches]
        order = np.lexsort((rng.permutation(len(branches)).tolist(), away, longer))
        rows = [
            (index, nodes_of(orbit, here.base))
            for index in order[:NEIGHBOURS].tolist()
            for orbit in orbits_near(branches[index], here)
        ]
        return cls(np.array([index for index, _ in rows]), [nodes for _, nodes in rows])

    def mixture(self, period: int, rng: np.random.Generator) -> tuple[set[int], Real]:
        """States (period, k, 2n) between or beyond those of two orbits, and their branches."""
        share = rng.uniform(-BEYOND, 1.0 + BEYOND)
        chosen = rng.integers(len(self.nodes), size=2)
        first, last = (_stretch(self.nodes[i], period, rng) for i in chosen.tolist())
        return set(self.branch[chosen].tolist()), (1.0 - share) * first + share * last


def _stretch(nodes: Real, period: int, rng: np.random.Generator) -> Real:
    """So many periods of an orbit, from a random one of its own."""
    first = int(rng.integers(len(nodes)))
    return np.asarray(nodes[(first + np.arange(period)) % len(nodes)])
