"""What searches beside known branches have in common."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_range, check_types, check_whole
from nldyn.branches.branch import Branch, check_branches
from nldyn.branches.checkpoint import BranchFile, Tally, checkpoint_of_several
from nldyn.branches.continuation import extended
from nldyn.branches.options import ContinuationOptions
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import LONGEST_PERIOD
from nldyn.runtime.progress import Progress, silent
from nldyn.search.diagram import Collector, Diagram, check_known, counted, middle_orbit
from nldyn.search.exploration import check_spacing, steps_between
from nldyn.search.fixed_point_index import index_note, is_damped, without_index_note

PLACES = 6  # orbits of a branch near a frequency
WINDOW = 0.03  # relative distance within which frequencies are near

Guesses = Iterator[tuple[set[int], Sequence[Orbit]]]  # branches each was made of, its orbits


@dataclass(frozen=True)
class Wanted:
    """What a search beside known branches looks for, and where.

    Parameters
    ----------
    known : Diagram
        Branches with their orbits.
    periods : range
        Of the orbits wanted, one after the other.
    frequencies : sequence of float
        Where guesses are made, in Hz.
    """

    known: Diagram
    periods: range
    frequencies: Sequence[float]

    @classmethod
    def checked(
        cls,
        known: Diagram,
        min_period: int,
        max_period: int,
        range_hz: tuple[float, float] | None,
        spacing: float,
    ) -> Wanted:
        """What input wants, once `check_search` has passed.

        Raises
        ------
        SystemModelError
            If the shortest period or the range makes no sense.
        """
        check_whole("min_period", min_period, 1, max_period)
        within = range_within(known.range_hz, range_hz)
        return cls(known, range(min_period, max_period + 1), inner_frequencies(within, spacing))

    @property
    def given(self) -> set[int]:
        """Indices of the branches known of these periods that reach one of the frequencies."""
        low, high = self.frequencies[0], self.frequencies[-1]
        return {
            index
            for index, branch in enumerate(self.known.branches)
            if branch.period in self.periods
            and branch.frequency_hz.max() >= low
            and branch.frequency_hz.min() <= high
        }


def check_search(
    known: Diagram,
    max_period: int,
    spacing: float,
    options: ContinuationOptions | None,
    progress: Progress | None,
) -> None:
    """Raise unless the input of a search beside known branches makes sense."""
    check_types(
        known=(known, Diagram),
        options=(options, ContinuationOptions, None),
        progress=(progress, Callable, None),
    )
    check_whole("max_period", max_period, 1, LONGEST_PERIOD)
    check_spacing("spacing", spacing)
    check_branches("known: branches", known.branches)
    if not known.branches:
        raise SystemModelError("known: has no branches to begin with")
    check_known(known, known.branches[0].points[0].problem.flow)


def range_within(
    known: tuple[float, float], range_hz: tuple[float, float] | None
) -> tuple[float, float]:
    """A range in Hz within that of the branches known, which is meant if there is none."""
    if range_hz is None:
        return known
    low, high = check_range(range_hz)
    if not known[0] <= low < high <= known[1]:
        raise SystemModelError(
            f"range_hz = ({low:g}, {high:g}) must lie within that of the branches known, "
            f"({known[0]:g}, {known[1]:g})"
        )
    return low, high


def collector_beside(
    known: Diagram,
    options: ContinuationOptions | None,
    progress: Progress | None,
    checkpoint: BranchFile | None,
) -> Collector:
    """A collector that has the known branches, and a file for what is found beside them."""
    own, progress = known.branches[0].points[0].problem.flow, progress or silent
    options = options or ContinuationOptions()
    low, high = known.range_hz
    box = Collector(own, (low, high), known.observe, options, progress)
    box.take(known.branches, without_index_note(known.notes))
    box.checkpoint = checkpoint_of_several(checkpoint, box.branches, own, box.range_hz)
    return box


def take_kept(box: Collector, max_period: int) -> None:
    """Finish the branches that the file holds, and follow what they lead to."""
    count = len(box.branches)
    for branch in box.checkpoint.new_branches(lambda branch: box.known(middle_orbit(branch))):
        progress = partial(box.tell, f"1/{branch.period}")
        box.take_in(extended(branch, progress=progress, checkpoint=box.checkpoint))
    box.follow_up(count, max_period, max_period, None)


def search_beside(
    box: Collector,
    wanted: Wanted,
    what: str,
    numbers: str,
    near: Callable[[int, Sequence[Branch]], Guesses],
    *,
    from_known: bool = True,
) -> Diagram:
    """Follow the orbits that lie on no branch, found near one frequency after the other.

    How many frequencies are done is kept in the file of the box; a search with the same name,
    numbers, known branches, periods, frequencies and options goes on after them.

    Parameters
    ----------
    box : Collector
        See `collector_beside`.
    wanted : Wanted
        What to look for, and where.
    what : str
        What guesses are called.
    numbers : str
        Of how they are made.
    near : callable
        Gives the guesses at the frequency of a number, and their orbits, from the branches that
        were known when it was begun.
    from_known : bool
        Whether guesses are made of known orbits, which are not counted as met by their own.
    """
    max_period = wanted.periods[-1]
    with box.checkpoint:
        take_kept(box, max_period)
        question = f"{what}, {numbers}, {_digest(wanted, box.options)}"
        tally = _follow_new(box, wanted, question, near)
    new = counted(box.branches[len(wanted.known.branches) :])
    of_others = ", not made of them," if from_known else ""
    note = (
        f"{tally.came} of {tally.tried} {what} led to an orbit, and{of_others} to "
        f"{len(tally.met)} of the {tally.given} given there, {new} beside those given"
    )
    return diagram_of(box, max_period, note)


def _follow_new(
    box: Collector,
    wanted: Wanted,
    question: str,
    near: Callable[[int, Sequence[Branch]], Guesses],
) -> Tally:
    """Follow the orbits that lie on no branch; what was tried, see `search_beside`."""
    given, to_meet = set(range(len(wanted.known.branches))), wanted.given
    max_period = wanted.periods[-1]
    tally = box.checkpoint.tally
    if tally is None or tally.question != question:
        tally = Tally(question, len(to_meet), len(box.branches))
    for place in range(tally.done, len(wanted.frequencies)):
        box.done = place / len(wanted.frequencies)
        box.checkpoint.tally = tally
        box.checkpoint.offer()
        tried, came, met = 0, 0, set[int]()
        for used, orbits in near(place, box.branches[: tally.known]):
            tried += 1
            came += bool(orbits)
            for orbit in orbits:
                on = box.branch_of(orbit)
                if on is None:
                    box.follow(orbit, max_period, max_period, None)
                elif on not in used and used <= given:
                    met.add(on)
        tally = replace(
            tally,
            known=len(box.branches),
            done=place + 1,
            tried=tally.tried + tried,
            came=tally.came + came,
            met=tally.met | (met & to_meet),
        )
    box.checkpoint.tally = tally
    return tally


def _digest(wanted: Wanted, options: ContinuationOptions) -> str:
    """A name of branches, periods, frequencies and options that tells them from others."""
    digest = hashlib.sha256(np.array(wanted.frequencies).tobytes())
    digest.update(f"{wanted.periods} {options}".encode())
    for branch in wanted.known.branches:
        digest.update(branch.frequency_hz.tobytes())
    return digest.hexdigest()[:16]


def relative_distance(reached: Real, frequency_hz: float) -> float:
    """How far, relatively, a branch ends from a frequency; zero if it does not."""
    low, high = math.log(reached.min() / frequency_hz), math.log(reached.max() / frequency_hz)
    return max(0.0, low, -high)


def orbits_near(branch: Branch, frequency_hz: float) -> list[Orbit]:
    """A few orbits of a branch of about a frequency, or the nearest one."""
    away = np.abs(np.log(branch.frequency_hz / frequency_hz))
    near = np.flatnonzero(away <= max(WINDOW, float(away.min())))
    places = np.linspace(0.0, near.size - 1.0, min(PLACES, near.size))
    return [branch.points[near[round(place)]] for place in places.tolist()]


def inner_frequencies(range_hz: tuple[float, float], spacing: float) -> list[float]:
    """Frequencies in Hz within a range, at least one, in equal ratios of at most 1 + spacing."""
    low, high = range_hz
    count = steps_between(low, high, spacing)
    found: list[float] = np.geomspace(low, high, count + 2)[1:-1].tolist()
    return found


def diagram_of(box: Collector, max_period: int, note: str) -> Diagram:
    """What a collector has, with notes on the indices, if every mode is damped, and on the search.

    Indices that add up to one prove nothing; others prove that orbits are missing.
    """
    if is_damped(box.flow.system):
        box.notes.append(index_note(box.branches, box.range_hz, max_period))
    box.notes.append(note)
    return Diagram(tuple(box.branches), box.range_hz, box.observe, tuple(box.notes))
