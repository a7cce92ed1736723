"""Further branches beside known ones: one driver, and what a strategy has to give it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types, check_whole, shown
from nldyn.branches.branch import Branch, check_branches
from nldyn.branches.checkpoint import BranchFile, Tally, checkpoint_of_several
from nldyn.branches.continuation import finished
from nldyn.branches.step_control import ContinuationOptions
from nldyn.orbits.axis import Axis, Section
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import LONGEST_PERIOD
from nldyn.orbits.starts import MOST_COUNT
from nldyn.runtime.progress import Progress, shows_progress, silent
from nldyn.runtime.threads import one_thread
from nldyn.search.collector import Collector, counted, middle_orbit
from nldyn.search.diagram import Diagram, check_known
from nldyn.search.exploration import check_spacing
from nldyn.search.fixed_point_index import index_note, is_damped_along, without_index_note

PLACES = 6  # orbits of a branch near a value
WINDOW = 0.03  # distance on its scale within which values are near

Guesses = Iterator[tuple[set[int], Sequence[Orbit]]]  # branches each was made of, its orbits


@dataclass(frozen=True)
class Place:
    """Where guesses are made, and of how many excitation periods.

    Parameters
    ----------
    here : Section
        The motions at the frequency, or the value of another parameter.
    spacing : float
        Relative distance to the next such value, see `ExploreOptions`.
    periods : range
        Of the orbits wanted, one after the other.
    rng : Generator
        Of what is random.
    """

    here: Section
    spacing: float
    periods: range
    rng: np.random.Generator


class Strategy(Protocol):
    """How `extend_diagram` guesses where further orbits lie.

    For developers: a frozen dataclass of its numbers, checked when it is made. Its repr tells it
    from another one in a file that keeps a search.
    """

    @property
    def what(self) -> str:
        """What its guesses are called."""

    @property
    def of_known(self) -> bool:
        """Whether guesses are made of known orbits, which are not counted as met by their own."""

    @property
    def seed(self) -> int:
        """Of the random numbers."""

    def check(self, longest: int) -> None:
        """Raise a `SystemModelError` unless it can guess orbits up to so many periods."""

    def guesses(self, box: Collector, branches: Sequence[Branch], place: Place) -> Guesses:
        """Of each guess the indices of the branches it was made of, and the orbits near it.

        Parameters
        ----------
        box : Collector
            Of the system; its `tell` is called before each guess.
        branches : sequence of Branch
            Those known.
        place : Place
            Where to guess.
        """


@one_thread()
@shows_progress()
def extend_diagram(
    known: Diagram,
    strategy: Strategy,
    *,
    min_period: int = 1,
    max_period: int = 3,
    limits: tuple[float, float] | None = None,
    spacing: float = 0.01,
    options: ContinuationOptions | None = None,
    progress: Progress | None = None,
    checkpoint: BranchFile | None = None,
) -> Diagram:
    """Find further branches beside those known.

    At one frequency, or value of the parameter, after the other a strategy guesses where orbits
    lie, and the Gauss-Newton method [Allgower and Georg 1990, chapter 3] goes to the nearest orbit,
    at a value that it finds. If that lies on no known branch, its branch is followed, with what it
    leads to. Flips of the branches given are not followed: begin with what `explore` or `diagram`
    has found. Call it again with what it has found, and with another seed, until it finds no more.

    Parameters
    ----------
    known : Diagram
        Branches of a system, from `diagram` or `explore`, with their orbits; in any parameter.
    strategy : Strategy
        How guesses are made: `PseudoOrbits`, `Mixtures`, `ClosedWalks`, or another one with the
        methods of `Strategy`.
    min_period, max_period : int
        Shortest and longest orbits guessed, in excitation periods.
    limits : (float, float), optional
        Values between which guesses are made, within those of `known`; all of these if not given.
        Branches found are followed through all.
    spacing : float
        Relative distance of these values, see `ExploreOptions`.
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
        the branches given, of these periods and frequencies, guesses led that were not made of
        them: had each alone been unknown, it would have found about so many. The note before tells,
        if every mode is damped, whether the indices add up to one, see `index_sum`. What `known`
        notes of them is left out.

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    OutputError
        If `checkpoint` cannot be written.

    Examples
    --------
    >>> from nldyn import Diagram, Stop, System, Unbalance
    >>> from nldyn.search import Mixtures
    >>> from nldyn import continue_branch, find_orbits, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> range_hz = 36.0, 38.5
    >>> orbits = [solve_orbit(system, 37.0), *find_orbits(system, 37.0, 3)[:1]]
    >>> branches = tuple(continue_branch(orbit, range_hz) for orbit in orbits)
    >>> more = extend_diagram(Diagram(branches, range_hz, "middle"), Mixtures(tries=50))
    >>> [branch.period for branch in more.branches]
    [1, 3, 2]
    """
    check_types(
        known=(known, Diagram),
        options=(options, ContinuationOptions, None),
        progress=(progress, Callable, None),
    )
    check_strategy(strategy)
    check_whole("max_period", max_period, 1, LONGEST_PERIOD)
    check_whole("min_period", min_period, 1, max_period)
    check_spacing("spacing", spacing)
    check_branches("known: branches", known.branches)
    if not known.branches:
        raise SystemModelError("known: has no branches to begin with")
    axis = check_known(known, known.branches[0].nodes[0].family.problem.flow)
    strategy.check(max_period)
    values = inner_values(_axis_within(axis, limits), spacing)
    search = _Search(known, strategy, range(min_period, max_period + 1), values, spacing)
    box = collector_beside(known, axis, options, progress, checkpoint)
    with box.checkpoint:
        _take_kept(box, max_period)
        tally = search.follow_new(box)
    if is_damped_along(axis, box.flow):
        box.notes.append(index_note(box.branches, axis, max_period))
    box.notes.append(search.note(tally, box.branches))
    return Diagram.of(box)


def check_strategy(strategy: object) -> None:
    """Raise unless this is a strategy."""
    if isinstance(strategy, type) or not hasattr(strategy, "guesses"):
        raise SystemModelError(
            f"strategy must be a strategy such as Mixtures(), got {shown(strategy)}"
        )


def check_numbers(strategy: Strategy, tries: int) -> None:
    """Raise unless the numbers that strategies share make sense."""
    name = type(strategy).__name__
    check_whole(f"{name}: tries", tries, 1, MOST_COUNT)
    check_whole(f"{name}: seed", strategy.seed, 0)


@dataclass(frozen=True)
class _Search:
    """What is looked for beside which branches, and where.

    Parameters
    ----------
    known : Diagram
        Branches with their orbits.
    strategy : Strategy
        That guesses.
    periods : range
        Of the orbits wanted, one after the other.
    values : sequence of float
        Where guesses are made.
    spacing : float
        Relative distance of these.
    """

    known: Diagram
    strategy: Strategy
    periods: range
    values: Sequence[float]
    spacing: float

    def given(self) -> set[int]:
        """Indices of the branches known of these periods that reach one of the values."""
        low, high = self.values[0], self.values[-1]
        return {
            index
            for index, branch in enumerate(self.known.branches)
            if branch.period in self.periods
            and branch.values.max() >= low
            and branch.values.min() <= high
        }

    def follow_new(self, box: Collector) -> Tally:
        """Follow the orbits that lie on no branch; what was tried.

        How many values are done is kept in the file of the box; a search with the same
        strategy, known branches, periods, values and options goes on after them. At each
        value guesses are made from the branches that were known when it was begun.
        """
        given, to_meet = set(range(len(self.known.branches))), self.given()
        longest, question = self.periods[-1], self._digest(box.options)
        tally = box.checkpoint.tally
        if tally is None or tally.question != question:
            tally = Tally(question, len(to_meet), len(box.branches))
        for number in range(tally.done, len(self.values)):
            box.done = number / len(self.values)
            box.checkpoint.tally = tally
            box.checkpoint.offer()
            tried, came, met = 0, 0, set[int]()
            known, place = box.branches[: tally.known], self._place(box, number)
            for used, orbits in self.strategy.guesses(box, known, place):
                tried += 1
                came += bool(orbits)
                for orbit in orbits:
                    on = box.branch_of(orbit)
                    if on is None:
                        box.follow(orbit, longest, longest, None)
                    elif on not in used and used <= given:
                        met.add(on)
            tally = replace(
                tally,
                known=len(box.branches),
                done=number + 1,
                tried=tally.tried + tried,
                came=tally.came + came,
                met=tally.met | (met & to_meet),
            )
        box.checkpoint.tally = tally
        return tally

    def _place(self, box: Collector, number: int) -> Place:
        rng = np.random.default_rng([self.strategy.seed, number])
        return Place(box.at(self.values[number]), self.spacing, self.periods, rng)

    def _digest(self, options: ContinuationOptions) -> str:
        """A name that tells this search from others."""
        digest = hashlib.sha256(np.array(self.values).tobytes())
        digest.update(f"{self.strategy!r} {self.periods} {options}".encode())
        for branch in self.known.branches:
            digest.update(branch.values.tobytes())
        return digest.hexdigest()[:16]

    def note(self, tally: Tally, branches: Sequence[Branch]) -> str:
        """What was tried and found."""
        new = counted(branches[len(self.known.branches) :])
        of_others = ", not made of them," if self.strategy.of_known else ""
        return (
            f"{tally.came} of {tally.tried} {self.strategy.what} led to an orbit, and{of_others} "
            f"to {len(tally.met)} of the {tally.given} given there, {new} beside those given"
        )


def _axis_within(known: Axis, limits: tuple[float, float] | None) -> Axis:
    """The axis over a range within that of the branches known, which is meant if there is none."""
    if limits is None:
        return known
    chart = known.chart.over(limits)
    (first, last), low, high = known.limits, chart.low, chart.high
    if not first <= low < high <= last:
        raise SystemModelError(
            f"limits = ({low:g}, {high:g}) must lie within those of the branches known, "
            f"({first:g}, {last:g})"
        )
    return replace(known, chart=chart)


def collector_beside(
    known: Diagram,
    axis: Axis,
    options: ContinuationOptions | None,
    progress: Progress | None,
    checkpoint: BranchFile | None,
) -> Collector:
    """A collector that has the known branches, and a file for what is found beside them."""
    own, progress = known.branches[0].nodes[0].family.problem.flow, progress or silent
    box = Collector(own, axis, known.observe, options or ContinuationOptions(), progress)
    box.take(known.branches, without_index_note(known.notes))
    box.checkpoint = checkpoint_of_several(checkpoint, box.branches, own, axis)
    return box


def _take_kept(box: Collector, max_period: int) -> None:
    """Finish the branches that the file holds, and follow what they lead to."""
    count = len(box.branches)
    for branch in box.checkpoint.new_branches(lambda branch: box.known(middle_orbit(branch))):
        progress = partial(box.tell, f"1/{branch.period}")
        box.take_in(finished(branch, progress, box.checkpoint))
    box.follow_up(count, max_period, max_period, None)


def distance_from(branch: Branch, here: Section) -> float:
    """How far a branch ends from a value, on its scale; zero if it does not."""
    reached = coordinates(branch)
    return max(0.0, float(reached.min()) - here.coordinate, here.coordinate - float(reached.max()))


def coordinates(branch: Branch) -> Real:
    """Values of the parameter at the points of a branch, on its scale."""
    return np.array([node.point[-1] for node in branch.nodes])


def orbits_near(branch: Branch, here: Section) -> list[Orbit]:
    """A few orbits of a branch of about a value, or the nearest one."""
    away = np.abs(coordinates(branch) - here.coordinate)
    near = np.flatnonzero(away <= max(WINDOW, float(away.min())))
    places = np.linspace(0.0, near.size - 1.0, min(PLACES, near.size))
    return [branch.points[near[round(place)]] for place in places.tolist()]


def inner_values(axis: Axis, spacing: float) -> list[float]:
    """Values within a range, at least one, in equal steps of at most a share."""
    found: list[float] = axis.spread(axis.steps(spacing) + 2)[1:-1].tolist()
    return found
