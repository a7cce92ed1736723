"""Further branches beside pieces of known orbits that nearly fit together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import islice

import numpy as np

from nldyn.base.errors import check_whole
from nldyn.branches.branch import Branch
from nldyn.branches.checkpoint import BranchFile
from nldyn.branches.options import ContinuationOptions
from nldyn.orbits.shooting import SEGMENTS_PER_PERIOD
from nldyn.orbits.starts import LONG_STEPS, MOST_COUNT, SHORT_STEPS, nearest_orbit
from nldyn.runtime.progress import Progress
from nldyn.runtime.threads import one_thread
from nldyn.search.diagram import Collector, Diagram
from nldyn.search.extend import Guesses, Wanted, check_search, collector_beside, search_beside
from nldyn.search.pseudo_orbits import NODES, Pieces

MOST_ALIKE = 4  # pseudo-orbits made of the same orbits that are tried, in other orders or places
WAYS = (NODES // SEGMENTS_PER_PERIOD, LONG_STEPS), (1, SHORT_STEPS)  # every how many states, steps


@one_thread()
def by_pseudo_orbits(
    known: Diagram,
    *,
    min_period: int = 1,
    max_period: int = 3,
    range_hz: tuple[float, float] | None = None,
    spacing: float = 0.01,
    tries: int = 2000,
    seed: int = 0,
    options: ContinuationOptions | None = None,
    progress: Progress | None = None,
    checkpoint: BranchFile | None = None,
) -> Diagram:
    """Find further branches where pieces of known orbits nearly fit together.

    A pseudo-orbit is a sequence of pieces of motions with small jumps between them; in a hyperbolic
    set an orbit is near every one [Bowen 1975]. Here the pieces are single excitation periods of
    known orbits, of any period and of frequencies close together. From each closed sequence of up
    to `max_period` of them, in random order where the jumps are small and then by their size, the
    Gauss-Newton method [Allgower and Georg 1990, chapter 3] goes to the nearest orbit, at a
    frequency that it finds. If that lies on no known branch, its branch is followed, with what it
    leads to. No motion is simulated, and no other system is needed; it is the faster the fewer
    branches there are, and slow for long periods: with few branches of the 1-DOF model up to period
    3 in 6 s, to 5 in 270 s. What resembles no orbits known is not found. Flips of the branches
    given are not followed.

    Parameters
    ----------
    known : Diagram
        Branches of a system, from `diagram` or `explore`, with their orbits.
    min_period, max_period : int
        Least and largest number of pieces.
    range_hz : (float, float), optional
        Frequencies at which pieces are put together, within those of `known`; all of these if not
        given. Branches found are followed through all.
    spacing : float
        Relative distance of the frequencies at which pieces are put together, and largest
        distance of those of the pieces from it.
    tries : int
        Most pseudo-orbits of each length at each frequency from which an orbit is looked for; those
        of the same orbits, four at most, come after one of each choice of orbits.
    seed : int
        Of the random order; another one tries others first.
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
        the branches given, of these periods and frequencies, pieces of others led: about so many it
        would have found, had each alone been unknown. The note before tells, if every mode is
        damped, whether the indices add up to one, see `index_sum`. What `known` notes of them is
        left out.

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
    >>> orbits = [solve_orbit(system, 37.0), *find_orbits(system, 37.0, 2)[:1]]
    >>> branches = tuple(continue_branch(orbit, range_hz) for orbit in orbits)
    >>> more = by_pseudo_orbits(Diagram(branches, range_hz, "middle"))
    >>> [branch.period for branch in more.branches]
    [1, 2, 3]
    """
    check_search(known, max_period, spacing, options, progress)
    wanted = Wanted.checked(known, min_period, max_period, range_hz, spacing)
    check_whole("tries", tries, 1, MOST_COUNT)
    check_whole("seed", seed, 0)
    box = collector_beside(known, options, progress, checkpoint)

    def near(place: int, branches: Sequence[Branch]) -> Guesses:
        rng, frequency_hz = np.random.default_rng([seed, place]), wanted.frequencies[place]
        return near_pseudo_orbits(box, branches, frequency_hz, spacing, wanted.periods, tries, rng)

    return search_beside(box, wanted, "pseudo-orbits", f"{tries} each, seed {seed}", near)


def near_pseudo_orbits(
    box: Collector,
    branches: Sequence[Branch],
    frequency_hz: float,
    spacing: float,
    periods: Sequence[int],
    tries: int,
    rng: np.random.Generator,
) -> Guesses:
    """Pseudo-orbits of each length at a frequency: their branches, and orbits near by.

    Those that long steps between few states lead to, and short steps between many, unless they are
    out of the range: beside few orbits the first meet more others, beside many the second.
    """
    pieces = Pieces.of(branches, frequency_hz, spacing)
    omega = 2.0 * math.pi * frequency_hz
    for period in periods:
        for sequence in islice(pieces.pseudo_orbits(period, MOST_ALIKE, rng), tries):
            box.tell("pseudo-orbits", frequency_hz)
            chosen = list(sequence)
            nodes = pieces.nodes[chosen]
            orbits = [
                nearest_orbit(box.flow, nodes[:, ::every], omega, box.observe, steps)
                for every, steps in WAYS
            ]
            yield set(pieces.branch[chosen].tolist()), box.within(orbits)
