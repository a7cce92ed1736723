"""Further branches beside mixtures of two known orbits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import check_whole
from nldyn.branches.branch import Branch
from nldyn.branches.checkpoint import BranchFile
from nldyn.branches.options import ContinuationOptions
from nldyn.orbits.starts import MOST_COUNT, SHORT_STEPS, nearest_orbit
from nldyn.runtime.progress import Progress
from nldyn.runtime.threads import one_thread
from nldyn.search.diagram import Collector, Diagram
from nldyn.search.extend import (
    Guesses,
    Wanted,
    check_search,
    collector_beside,
    orbits_near,
    relative_distance,
    search_beside,
)
from nldyn.search.pseudo_orbits import nodes_of

NEIGHBOURS = 40  # branches whose orbits are mixed, the nearest in frequency
BEYOND = 0.8  # part of the way between two orbits by which a mixture may lie beyond either


@one_thread()
def by_crossover(
    known: Diagram,
    *,
    min_period: int = 1,
    max_period: int = 3,
    range_hz: tuple[float, float] | None = None,
    spacing: float = 0.01,
    tries: int = 500,
    seed: int = 0,
    options: ContinuationOptions | None = None,
    progress: Progress | None = None,
    checkpoint: BranchFile | None = None,
) -> Diagram:
    """Find further branches beside mixtures of two known orbits.

    The states of two orbits at the same phases, eight in each excitation period, are mixed,
    (1 - λ)A + λB with a random λ from -0.8 to 1.8, either begun at a random one of its periods:
    the arithmetic crossover of genetic algorithms [Michalewicz 1996]. They are of the forty
    branches nearest in frequency, those up to the longest period wanted before others, of each up
    to six orbits within 3 % of it, or else the nearest; both may be of one branch. Orbits whose
    period does not divide the one wanted give a stretch of it, which does not close. From there the
    Gauss-Newton method [Allgower and Georg 1990, chapter 3] goes to the nearest orbit, at a
    frequency that it finds. If that lies on no known branch, its branch is followed, with what it
    leads to. No motion is simulated, so that orbits are found whatever their stability and energy,
    if they lie among those known. Flips of the branches given are not followed.

    Parameters
    ----------
    known : Diagram
        Branches of a system, from `diagram` or `explore`, with their orbits.
    min_period, max_period : int
        Shortest and longest mixtures.
    range_hz : (float, float), optional
        Frequencies at which orbits are mixed, within those of `known`; all of these if not given.
        Branches found are followed through all.
    spacing : float
        Relative distance of the frequencies at which orbits are mixed.
    tries : int
        How many mixtures of each length at each frequency.
    seed : int
        Of the random numbers; another one tries others.
    options : ContinuationOptions, optional
        Step control.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``.
    checkpoint : CheckpointFile, optional
        File that keeps the branches found, also those of an earlier call: they count as known.
        The same call with the same file goes on after the frequencies done, and gives the same
        once all are; another search takes the place of this one in the file.

    Returns
    -------
    Diagram
        The branches known, then those found. The last note tells what was tried, and to how many of
        the branches given, of these periods and frequencies, mixtures of others of them led: had
        each alone been unknown, it would have found about so many, or more by way of new ones. The
        note before tells, if every mode is damped, whether the indices add up to one, see
        `index_sum`. What `known` notes of them is left out.

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    OutputError
        If `checkpoint` cannot be written.

    Examples
    --------
    >>> from nldyn import Diagram, Stop, System, Unbalance
    >>> from nldyn import continue_branch, find_orbits, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> range_hz = 36.0, 38.5
    >>> orbits = [solve_orbit(system, 37.0), *find_orbits(system, 37.0, 3)[:1]]
    >>> branches = tuple(continue_branch(orbit, range_hz) for orbit in orbits)
    >>> more = by_crossover(Diagram(branches, range_hz, "middle"), tries=50)
    >>> [branch.period for branch in more.branches]
    [1, 3, 2]
    """
    check_search(known, max_period, spacing, options, progress)
    wanted = Wanted.checked(known, min_period, max_period, range_hz, spacing)
    check_whole("tries", tries, 1, MOST_COUNT)
    check_whole("seed", seed, 0)
    box = collector_beside(known, options, progress, checkpoint)

    def near(place: int, branches: Sequence[Branch]) -> Guesses:
        rng, frequency_hz = np.random.default_rng([seed, place]), wanted.frequencies[place]
        return near_mixtures(box, branches, frequency_hz, wanted.periods, tries, rng)

    return search_beside(box, wanted, "mixtures", f"{tries} each, seed {seed}", near)


def near_mixtures(
    box: Collector,
    branches: Sequence[Branch],
    frequency_hz: float,
    periods: Sequence[int],
    tries: int,
    rng: np.random.Generator,
) -> Guesses:
    """Mixtures of each length at a frequency: their branches, and the orbit near by.

    None of an orbit that is out of the range.
    """
    loops = Loops.of(branches, frequency_hz, periods[-1], rng)
    omega = 2.0 * math.pi * frequency_hz
    for period in periods:
        for _ in range(tries):
            box.tell("mixtures", frequency_hz)
            used, nodes = loops.mixture(period, rng)
            orbit = nearest_orbit(box.flow, nodes, omega, box.observe, SHORT_STEPS)
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
        frequency_hz: float,
        longest: int,
        rng: np.random.Generator,
    ) -> Loops:
        """Those of the branches nearest to a frequency, first those up to a period.

        Of more that reach the frequency, some at random.
        """
        away = [relative_distance(branch.frequency_hz, frequency_hz) for branch in branches]
        longer = [branch.period > longest for branch in branches]
        order = np.lexsort((rng.permutation(len(branches)).tolist(), away, longer))
        rows = [
            (index, nodes_of(orbit))
            for index in order[:NEIGHBOURS].tolist()
            for orbit in orbits_near(branches[index], frequency_hz)
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
