"""Further branches beside short motions that begin at disturbed states of known orbits."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cms.threads import one_thread
from nldyn.beside import (
    check_search,
    collector_beside,
    diagram_of,
    inner_frequencies,
    take_kept,
)
from nldyn.branch import Branch
from nldyn.detour import DAMPING, times
from nldyn.diagrams import Collector, Diagram, Progress, counted
from nldyn.errors import check_whole
from nldyn.flow import FlowMap
from nldyn.linear import Real
from nldyn.orbit import Orbit, near_returns, stroboscopic
from nldyn.search import MOST_COUNT, orbit_beside
from nldyn.step_control import ContinuationOptions

NEIGHBOURS = 40  # branches whose orbits are disturbed, the nearest in frequency
PLACES = 8  # orbits of each
DISTURBANCE = 0.3  # of the size of each coordinate
LENGTH = 4  # of a motion, over the longest period wanted
RETURNS = 3  # states of a motion that come back, for each period
LESS_DAMPED = 0.1  # damping of every other motion, over that of the system


@one_thread()
def by_disturbed_orbits(
    known: Diagram,
    *,
    max_period: int = 3,
    spacing: float = 0.01,
    motions: int = 100,
    seed: int = 0,
    options: ContinuationOptions | None = None,
    progress: Progress | None = None,
    checkpoint: str | Path | None = None,
) -> Diagram:
    """Find further branches beside short motions that begin at disturbed states of known orbits.

    Motions from random states settle, and those that do not have too little energy, or too much, to
    pass near every unstable orbit. So motions begin here at states of known orbits of frequencies
    close by, each coordinate of which is changed at random by some 30 %, and last four times as
    long as the longest orbits wanted. Every other one is of the system with a tenth of its damping,
    where those with much energy keep it. Where one nearly comes back, the Gauss-Newton method
    [Allgower and Georg 1990, chapter 3] goes to the nearest orbit of the system, at a frequency
    that it finds. If that lies on no known branch, its branch is followed, with what it leads to.
    Flips of the branches given are not followed.

    Parameters
    ----------
    known : Diagram
        Branches of a system, from `diagram` or `explore`, with their orbits.
    max_period : int
        Longest orbits wanted.
    spacing : float
        Relative distance of the frequencies of the motions.
    motions : int
        How many at each frequency.
    seed : int
        Of the random changes; another one tries others.
    options : ContinuationOptions, optional
        Step control.
    progress : callable, optional
        Called as ``progress(what, frequency_hz)``.
    checkpoint : str or Path, optional
        File that keeps the branches found, also those of an earlier call: they count as known.
        The frequencies done are not kept, and tried anew.

    Returns
    -------
    Diagram
        The branches known, then those found. The last note tells what was tried, and to how many of
        the branches given, up to `max_period`, states of others led: about so many it would have
        found, had each alone been unknown. The note before tells, if every mode is damped, whether
        the indices add up to one, see `index_sum`. What `known` notes of them is left out.

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    OutputError
        If `checkpoint` cannot be written.

    Examples
    --------
    >>> from nldyn import Diagram, Stop, System, Unbalance, continue_branch, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> range_hz = 36.0, 38.5
    >>> branch = continue_branch(solve_orbit(system, 37.0), range_hz)
    >>> more = by_disturbed_orbits(Diagram((branch,), range_hz, "middle"), motions=20)
    >>> [branch.period for branch in more.branches]
    [1, 2, 3]
    """
    check_search(known, max_period, spacing, options, progress)
    check_whole("motions", motions, 1, MOST_COUNT)
    check_whole("seed", seed, 0)
    box = collector_beside(known, options, progress, checkpoint)
    given = set(range(len(known.branches)))
    wanted = {i for i in given if known.branches[i].period <= max_period}
    tried, came, met = 0, 0, set[int]()
    periods = range(1, max_period + 1)
    with box.checkpoint:
        take_kept(box, max_period)
        for frequency in inner_frequencies(box.range_hz, spacing):
            rng = np.random.default_rng([seed, round(1e6 * frequency)])
            for source, orbit in near_motions(box, frequency, periods, motions, rng):
                tried += 1
                if orbit is None:
                    continue
                came += 1
                on = box.branch_of(orbit)
                if on is None:
                    box.follow(orbit, max_period, max_period, None)
                elif on != source and source in given:
                    met.add(on)
    new = counted(box.branches[len(known.branches) :])
    note = (
        f"{came} of {tried} states that came back led to an orbit, and to {len(met & wanted)} of "
        f"the {len(wanted)} given from states of others, {new} beside those given"
    )
    return diagram_of(box, max_period, note)


def near_motions(
    box: Collector,
    frequency_hz: float,
    periods: Sequence[int],
    count: int,
    rng: np.random.Generator,
) -> Iterator[tuple[int, Orbit | None]]:
    """States of motions that come back: the branch disturbed, and the orbit near by, if any.

    An orbit out of the range is none.
    """
    low, high = box.range_hz
    omega = 2.0 * math.pi * frequency_hz
    known = States.of(box.branches, frequency_hz)
    flows = flows_of(box.flow)
    for number in range(count):
        branch, start = known.disturbed(rng)
        box.progress("disturbed", frequency_hz)
        motion = flows[number % len(flows)].strobe(start, omega, LENGTH * max(periods))
        if motion.failure:
            continue
        for period in periods:
            for index in near_returns(motion.ends, period, RETURNS):
                orbit = orbit_beside(box.flow, motion.ends[index], period, omega, box.observe)
                inside = orbit is not None and low <= orbit.frequency_hz <= high
                yield branch, orbit if inside else None


@dataclass(frozen=True, eq=False)
class States:
    """States of orbits at forcing phase zero.

    Parameters
    ----------
    branch : (m,) int array
        Index of the branch that each is of.
    states : (m, 2n) array
        States z.
    """

    branch: NDArray[np.intp]
    states: Real

    @classmethod
    def of(cls, branches: Sequence[Branch], frequency_hz: float) -> States:
        """Those of the branches nearest to a frequency."""
        away = [_distance(branch, frequency_hz) for branch in branches]
        rows: list[tuple[int, Real]] = []
        for index in np.argsort(away, kind="stable")[:NEIGHBOURS].tolist():
            points = branches[index].points
            places = np.linspace(0.0, len(points) - 1.0, min(PLACES, len(points)))
            for place in places.tolist():
                rows += [(index, state) for state in stroboscopic(points[round(place)])]
        branch, states = zip(*rows, strict=True)
        return cls(np.array(branch), np.array(states))

    def disturbed(self, rng: np.random.Generator) -> tuple[int, Real]:
        """One of the states, changed at random, and the branch that it was of."""
        chosen = int(rng.integers(len(self.states)))
        size = np.sqrt(np.mean(self.states**2, axis=0))
        changed = self.states[chosen] + DISTURBANCE * size * rng.standard_normal(size.size)
        return int(self.branch[chosen]), changed


def _distance(branch: Branch, frequency_hz: float) -> float:
    """How far, relatively, a branch ends from a frequency; zero if it does not."""
    reached = branch.frequency_hz
    return max(0.0, math.log(reached.min() / frequency_hz), math.log(frequency_hz / reached.max()))


def flows_of(own: FlowMap) -> list[FlowMap]:
    """The flow map of a system, and that of the system with less damping, if it has any."""
    if own.system.conservative:
        return [own]
    return [own, FlowMap(times(own.system, DAMPING, LESS_DAMPED), own.options)]
