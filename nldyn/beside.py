"""What searches beside known branches have in common."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from nldyn.branch import check_branches
from nldyn.checkpoint import checkpoint_of_several
from nldyn.diagrams import Collector, Diagram, Progress, check_known, middle_orbit
from nldyn.errors import SystemModelError, check_types, check_whole, is_finite, shown
from nldyn.exploration import FINEST_SPACING, steps_between
from nldyn.fixed_point_index import index_note, is_damped, without_index_note
from nldyn.orbit import LONGEST_PERIOD, Orbit
from nldyn.step_control import ContinuationOptions
from nldyn.tally import Tally


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
    if not (is_finite(spacing) and FINEST_SPACING <= spacing < 1.0):
        raise SystemModelError(
            f"spacing must lie between {FINEST_SPACING:g} and 1, got {shown(spacing)}"
        )
    check_branches("known: branches", known.branches)
    if not known.branches:
        raise SystemModelError("known: has no branches to begin with")
    check_known(known, known.branches[0].points[0].problem.flow)


def collector_beside(
    known: Diagram,
    options: ContinuationOptions | None,
    progress: Progress | None,
    checkpoint: str | Path | None,
) -> Collector:
    """A collector that has the known branches, and a file for what is found beside them."""
    own, progress = known.branches[0].points[0].problem.flow, progress or (lambda what, hz: None)
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
        progress = partial(box.progress, f"1/{branch.period}")
        box.take_in(branch.extend(progress=progress, checkpoint=box.checkpoint))
    box.follow_up(count, max_period, max_period, None)


def follow_new(
    box: Collector,
    known: Diagram,
    max_period: int,
    question: str,
    frequencies: Sequence[float],
    near: Callable[[int], Iterable[tuple[set[int], Sequence[Orbit]]]],
) -> Tally:
    """Follow the orbits that lie on no branch, found near one frequency after the other.

    What each guess was made of comes with its orbits, which are asked for by the number of the
    frequency. How many are done is kept in the file of the box; a search with the same question,
    known branches, frequencies and options goes on after them.
    """
    given = set(range(len(known.branches)))
    wanted = {i for i in given if known.branches[i].period <= max_period}
    begun = Tally(f"{question}, beside {_digest(known, frequencies, box.options)}", len(wanted))
    tally = box.checkpoint.tally
    if tally is None or tally.question != begun.question:
        tally = begun
    for place in range(tally.done, len(frequencies)):
        tried, came, met = 0, 0, set[int]()
        for used, orbits in near(place):
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
            done=place + 1,
            tried=tally.tried + tried,
            came=tally.came + came,
            met=tally.met | (met & wanted),
        )
        box.checkpoint.tally = tally
        box.checkpoint.offer()
    return tally


def _digest(known: Diagram, frequencies: Sequence[float], options: ContinuationOptions) -> str:
    """A name of branches, frequencies and options that tells them from others."""
    digest = hashlib.sha256(np.array(frequencies).tobytes() + repr(options).encode())
    for branch in known.branches:
        digest.update(branch.frequency_hz.tobytes())
    return digest.hexdigest()[:16]


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
