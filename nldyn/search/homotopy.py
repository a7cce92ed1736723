"""Further branches by way of a changed system, where they are joined to others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from nldyn.branches.branch import Branch
from nldyn.branches.checkpoint import BranchFile
from nldyn.branches.options import ContinuationOptions
from nldyn.orbits.homotopy import Homotopy, checked_factors, named
from nldyn.orbits.orbit import Orbit, minimal_period, same_orbit
from nldyn.runtime.progress import Progress
from nldyn.runtime.threads import one_thread
from nldyn.search.diagram import Collector, Diagram, counted
from nldyn.search.extend import (
    check_search,
    collector_beside,
    diagram_of,
    inner_frequencies,
    take_kept,
)
from nldyn.system.parameters import Parameter

THERE, BACK = 0.3, 0.8  # shares of the work done when all orbits are there, and back
PLACES = 3  # orbits of each branch that are carried there, in case some get lost


@one_thread()
def by_detour(
    known: Diagram,
    factors: Mapping[str | Parameter, float],
    *,
    max_period: int = 3,
    spacing: float = 0.002,
    options: ContinuationOptions | None = None,
    progress: Progress | None = None,
    checkpoint: BranchFile | None = None,
) -> Diagram:
    """Find further branches by way of a system with other numbers, where known ones lead to them.

    Closed branches (isolas) grow and join others when the damping falls, with more or less of the
    excitation, or when a natural frequency moves. So the branches known are followed there; the
    orbits of these, at frequencies next to each other, are carried back to the system as it is, as
    are their folds, whose frequencies move on the way, so that narrow branches are met as well.
    What lies on no known branch is on a new one. Isolas that join none of the branches known there
    are not found, nor those of which no orbit comes back.
    Other factors may find more, as may another call with the branches found.

    Parameters
    ----------
    known : Diagram
        Branches of a system, from `diagram` or `explore`, with their orbits.
    factors : mapping of str or Parameter to float
        What is changed and how many times it is there, up to 1000 or down to its inverse:
        ``{"damping": 0.5}`` halves the damping of all modes and all dampers,
        ``{"excitation": 1.4}`` is of all sources of excitation, and
        ``{Parameter("natural_frequency_hz", 1): 0.99}`` of one number. Names and indices are those
        of `continue_in`, but for the frequency; a name alone means index 0. Several are changed
        one after the other.
    max_period : int
        Longest orbits carried, and wanted.
    spacing : float
        Largest relative distance of the frequencies at which orbits are carried back.
    options : ContinuationOptions, optional
        Step control.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``.
    checkpoint : CheckpointFile, optional
        File that keeps the branches found, also those of an earlier call, whatever its factors:
        they count as known. Those of the changed system are not kept, and followed anew.

    Returns
    -------
    Diagram
        The branches known, then those found. The last note tells what was tried, and of how many
        of the branches given, up to `max_period`, an orbit came back by way of others of them: at
        least so many it would have found, had each alone been unknown. The note before tells, if
        every mode is damped, whether the indices add up to one, see `index_sum`. What `known` notes
        of them is left out.

    Raises
    ------
    SystemModelError
        For input that makes no sense, and for a factor of what is zero or not there.
    OutputError
        If `checkpoint` cannot be written.

    Examples
    --------
    >>> from nldyn import Diagram, HarmonicForce, Stop, System, continue_branch, solve_orbit
    >>> system = System.from_modal([10.0, 30.307], {"tip": [1, -1.2178], "force": [1, 1.0309]},
    ...     modal_damping=0.013513, stops=[Stop("tip", stiffness=3.5791e7)],
    ...     excitation=[HarmonicForce("force", 7.4926)])
    >>> branch = continue_branch(solve_orbit(system, 11.0), (7.2, 11.0))
    >>> known = Diagram((branch,), (7.2, 11.0), "tip")
    >>> more = by_detour(known, {"damping": 0.5}, max_period=1, spacing=0.1)
    >>> len(more.branches), more.branches[1].closed
    (2, True)
    """
    check_search(known, max_period, spacing, options, progress)
    own = known.branches[0].points[0].problem.flow
    detour = Homotopy(own, checked_factors(own.system, factors))
    box = collector_beside(known, options, progress, checkpoint)
    with box.checkpoint:
        take_kept(box, max_period)
        there = _followed(box, detour, max_period)
        tried = came = 0
        places = inner_frequencies(box.range_hz, spacing)
        for number, frequency in enumerate(places):
            box.done = THERE + (BACK - THERE) * number / len(places)
            box.tell("back", frequency)
            orbits = [(via, orbit) for via in there for orbit in via.branch.at(frequency)]
            carriages = ((via, detour.carried(orbit, 1.0, 0.0)) for via, orbit in orbits)
            back = [(via, orbit) for via, orbit in carriages if orbit is not None]
            tried, came = tried + len(orbits), came + len(back)
            _follow_new(box, back, max_period)
        folds = _folds_carried_back(box, detour, there, max_period)
    new = counted(box.branches[len(known.branches) :])
    changed = " and ".join(f"{f:g} of {named(what)}" for what, f in detour.factors.items())
    led = (
        f"{counted([via.branch for via in there])}, {came} of {tried} orbits carried back, "
        f"{folds}, {_met_from_others(known, there, max_period)}"
        if there
        else "no orbit got there, as some may with factors nearer to 1"
    )
    return diagram_of(box, max_period, f"at {changed}: {led}, {new} beside those given")


@dataclass
class Via:
    """A branch of the changed system, and the branches of the system itself that it joins.

    Parameters
    ----------
    branch : Branch
        Of the changed system.
    entries, exits : set of int
        Indices of the branches an orbit of which was carried to it, and of those on which an orbit
        of it lay when it was carried back.
    """

    branch: Branch
    entries: set[int] = field(default_factory=set)
    exits: set[int] = field(default_factory=set)


def _met_from_others(known: Diagram, there: Sequence[Via], max_period: int) -> str:
    """To how many of the branches known an orbit came back by way of others of them."""
    given = {i for i, branch in enumerate(known.branches) if branch.period <= max_period}
    met = {i for i in given if any(i in via.exits and via.entries & given - {i} for via in there)}
    return f"{len(met)} of the {len(given)} given met from others"


def _followed(known: Collector, detour: Homotopy, max_period: int) -> list[Via]:
    """Branches of the changed system to which those known lead."""
    box = Collector(detour.flow(1.0), known.range_hz, known.observe, known.options, known.progress)
    there: list[Via] = []
    for index, branch in enumerate(known.branches):
        if branch.period > max_period:
            continue
        box.done = THERE * index / len(known.branches)
        for orbit in _spread(branch.points, known.range_hz):
            box.tell("there", orbit.frequency_hz)
            other = detour.carried(orbit, 0.0, 1.0)
            if other is not None:
                box.follow(other, max_period, max_period, None)
                there += [Via(new) for new in box.branches[len(there) :]]
                for via in there:
                    if via.branch.contains(other):
                        via.entries.add(index)
    return there


def _spread(orbits: Sequence[Orbit], range_hz: tuple[float, float]) -> list[Orbit]:
    """A few of some orbits within a range, from the inside."""
    low, high = range_hz
    within = [orbit for orbit in orbits if low <= orbit.frequency_hz <= high]
    if not within:
        return []
    places = np.linspace(0.0, len(within) - 1.0, PLACES + 2)[1:-1]
    return [within[i] for i in sorted({round(place) for place in places.tolist()})]


def _follow_new(box: Collector, back: Sequence[tuple[Via, Orbit]], max_period: int) -> None:
    """Follow the orbits, all of one frequency, that lie on no branch; note where the others lie."""
    here: list[tuple[int, Orbit]] = []
    seen = 0
    for via, orbit in back:
        for index, branch in enumerate(box.branches[seen:], seen):
            here += [(index, other) for other in branch.at(orbit.frequency_hz)]
        seen = len(box.branches)
        on = next((index for index, other in here if same_orbit(orbit, other)), None)
        if on is not None:
            via.exits.add(on)
        else:
            box.follow(orbit, max_period, max_period, None)


def _folds_carried_back(
    box: Collector, detour: Homotopy, there: Sequence[Via], max_period: int
) -> str:
    """Carry the folds back, follow the branches of those on none of the box; how many came back.

    Where the others lie is noted.
    """
    tried = came = 0
    for number, via in enumerate(there):
        box.done = BACK + (1.0 - BACK) * number / len(there)
        for special in via.branch.special_points:
            if special.kind != "LP":
                continue
            box.tell("folds", special.frequency_hz)
            fold = detour.carried_fold(special.orbit, 1.0, 0.0)
            tried += 1
            if fold is None:
                continue
            came += 1
            on = box.with_fold(fold)
            if on is not None:
                via.exits.add(on)
            elif minimal_period(fold) == fold.period:
                box.follow(fold, max_period, max_period, None)
    return f"{came} of {tried} folds"
