"""The whole picture without guesses: sweeps, deflation and branches, and how much they explain."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cms.threads import one_thread
from nldyn.branch import Branch, is_at
from nldyn.checkpoint import Checkpoint, begun_before
from nldyn.continuation import MOST_POINTS, ContinuationOptions, check_range, shifts
from nldyn.diagrams import Collector, Diagram, Progress, check_flow, counted
from nldyn.errors import SystemModelError, check_types, check_whole, is_finite, shown
from nldyn.fixed_point_index import index_note, is_damped, sum_of_indices
from nldyn.flow import FlowMap, flow_of
from nldyn.fold_search import connected_folds, leading_parameter
from nldyn.linear import Real
from nldyn.orbit import (
    LONGEST_PERIOD,
    ConvergenceError,
    Orbit,
    check_observe,
    minimal_period,
    near_returns,
    refine,
    same_orbit,
    shooting_problem,
    spread,
    stroboscopic,
)
from nldyn.parameters import Parameter
from nldyn.search import MOST_COUNT, orbit_beside, orbit_near, random_states
from nldyn.system import System

RETURNS = 3.0  # recorded periods after settling, over the longest period looked for
DECAYS = 4.0  # time allowed for settling, over the slowest decay time of the linear part
FEWEST, UNDAMPED = 30, 600  # periods of it: at least, and where nothing decays
NEAR = 0.1  # a return within this share of the motion is worth a Newton iteration
ARRIVED = 0.01  # a motion this near to a known orbit, relative, has settled on it or passes it
CANDIDATES = 5  # near returns of each motion and period from which Newton's method starts
TRANSIENT = 5  # periods of a motion beside which no orbits are looked for
PASSING, BESIDE_PASSING = 60, 10  # periods of a short motion, and candidates as above
PIECE = 16  # periods simulated between two looks at the known orbits; later a quarter of all
LONGEST = 0.5  # step of a deflated iteration, relative to the orbit
ITERATIONS = 20  # of a deflated iteration
FINEST_SPACING = 1e-6
LARGEST_FACTOR = 100.0  # by which a parameter is changed in search of folds
AGAIN = 12  # times that a frequency is searched again while its indices say that orbits are missing


@dataclass(frozen=True)
class ExploreOptions:
    """Effort of `explore`.

    Parameters
    ----------
    spacing : float
        Largest relative distance of the frequencies at which motions are simulated. A branch that
        is stable only in a narrower window may be missed.
    starts : int
        Random initial states at each of them, beside the motions of the frequency before.
    rounds : int
        Most searches through the range. Each begins from random states of its own at frequencies
        between those of the ones before; one that finds no new branch up to the longest period
        looked for is the last.
    settling : int
        Most excitation periods after which a motion may have settled. The limit itself follows the
        damping; where this one cuts it, the report says so.
    unstable_period : int
        Largest period multiple of unstable orbits looked for by near returns and deflation.
    doubled_period : int
        Longest orbits followed from flips, if longer than those looked for.
    doubled_points : int, optional
        Most points in one direction of a branch that is longer in period than those looked for;
        as on the others unless given. A note names each branch that is broken off.
    passing : int
        Further random initial states at each frequency on the way up, whose motions are followed
        for 60 periods only, beside which unstable orbits are looked for.
    fold_factor : float
        After each round the folds found are followed in frequency and damping, or where the modes
        share no damping ratio in frequency and excitation, which are divided and multiplied by up
        to this factor. Where such a curve comes back to the system's own value, another branch may
        begin. 1 means that they are not followed.
    seed : int
        Seed of the random initial states: results are repeatable.

    Raises
    ------
    SystemModelError
        If one of them is not a number in its range.
    """

    spacing: float = 0.005
    starts: int = 12
    rounds: int = 1
    settling: int = 50000
    unstable_period: int = 3
    doubled_period: int = 1
    doubled_points: int | None = None
    passing: int = 0
    fold_factor: float = 1.0
    seed: int = 20

    def __post_init__(self) -> None:
        if not (is_finite(self.spacing) and FINEST_SPACING <= self.spacing < 1.0):
            raise SystemModelError(
                f"explore: spacing must lie between {FINEST_SPACING:g} and 1, "
                f"got {shown(self.spacing)}"
            )
        check_whole("explore: starts", self.starts, 1, MOST_COUNT)
        check_whole("explore: rounds", self.rounds, 1, MOST_COUNT)
        check_whole("explore: settling", self.settling, 1, MOST_COUNT)
        check_whole("explore: unstable_period", self.unstable_period, 0, LONGEST_PERIOD)
        check_whole("explore: doubled_period", self.doubled_period, 1, LONGEST_PERIOD)
        if self.doubled_points is not None:
            check_whole("explore: doubled_points", self.doubled_points, 2, MOST_POINTS)
        check_whole("explore: passing", self.passing, 0, MOST_COUNT)
        if not (is_finite(self.fold_factor) and 1.0 <= self.fold_factor <= LARGEST_FACTOR):
            raise SystemModelError(
                f"explore: fold_factor must lie between 1 and {LARGEST_FACTOR:g}, "
                f"got {shown(self.fold_factor)}"
            )
        check_whole("explore: seed", self.seed, 0)


@dataclass(frozen=True)
class Coverage:
    """What simulations at one frequency came to.

    Parameters
    ----------
    frequency_hz : float
        Excitation frequency in Hz.
    periods : tuple of int
        Period multiples of the different attractors found, ascending.
    settled, unsettled, failed : int
        Numbers of simulations that ended on one of them, that did not (chaotic motion, longer
        periods or slow transients), and that could not be computed.
    """

    frequency_hz: float
    periods: tuple[int, ...]
    settled: int
    unsettled: int
    failed: int

    def with_more(self, other: Coverage) -> Coverage:
        """Both together."""
        return Coverage(
            self.frequency_hz,
            tuple(sorted({*self.periods, *other.periods})),
            self.settled + other.settled,
            self.unsettled + other.unsettled,
            self.failed + other.failed,
        )


@dataclass(frozen=True, eq=False)
class Question:
    """What is explored, and how.

    Parameters
    ----------
    flow : FlowMap
        Of the system.
    range_hz : (float, float)
        Frequencies in Hz.
    max_period : int
        Longest orbits looked for.
    observe : str
        Interface whose displacement is reported.
    effort : ExploreOptions
        How much is simulated.
    options : ContinuationOptions
        Step control.
    """

    flow: FlowMap
    range_hz: tuple[float, float]
    max_period: int
    observe: str
    effort: ExploreOptions
    options: ContinuationOptions

    def frequencies(self, turn: int) -> list[float]:
        """Frequencies in Hz at which a round simulates motions, ascending.

        Between two neighbours of the first round, the shares of the way at which the further ones
        lie are van der Corput's sequence 1/2, 1/4, 3/4, 1/8, ...: each fills the largest gaps.
        """
        low, high = self.range_hz
        steps = math.ceil(math.log(high / low) / self.effort.spacing)
        found: list[float] = np.geomspace(low, high, steps + 1).tolist()
        if turn == 0:
            return found
        share, weight = 0.0, 0.5
        while turn:
            share, weight, turn = share + weight * (turn % 2), 0.5 * weight, turn // 2
        return [a * (b / a) ** share for a, b in pairwise(found)]

    def place(self, steps: int) -> tuple[int, int, int]:
        """Round in which some steps have ended, how many of them belong to it, and its length."""
        turn = 0
        while steps >= (length := 2 * len(self.frequencies(turn))):
            turn, steps = turn + 1, steps - length
        return turn, steps, length

    def same(self, other: Question) -> bool:
        """Whether another question is this one, but for the number of rounds."""
        from nldyn.store import same_flow

        mine, its = (
            (q.range_hz, q.max_period, q.observe, replace(q.effort, rounds=1), q.options)
            for q in (self, other)
        )
        return mine == its and same_flow(self.flow, other.flow)


@dataclass(frozen=True, eq=False)
class Stage:
    """How far an exploration has come: all that its further steps depend on, beside the branches.

    Parameters
    ----------
    steps : int
        Frequencies done, on the way up and then down, round by round.
    branches, notes : int
        How many of those in the diagram these steps have found and followed up.
    carried : (k, 2n)
        States from which the next frequency starts, beside the random ones.
    coverage : tuple of Coverage
        One for each frequency reached, ascending, with what both ways found there.
    met : (rounds, branches) array of bool
        Which of the branches simulated motions came to in each round begun: settled on, or
        nearly returned beside.
    ends : tuple of int
        Number of branches at the end of each round that is done.
    given : int
        How many of the branches were known before.
    folds_followed : int
        How many of the branches had their folds followed.
    """

    steps: int
    branches: int
    notes: int
    carried: Real
    coverage: tuple[Coverage, ...]
    met: NDArray[np.bool_]
    ends: tuple[int, ...]
    given: int = 0
    folds_followed: int = 0


@dataclass(frozen=True, eq=False)
class Exploration:
    """The branches found and how much of the simulated motion they explain.

    Parameters
    ----------
    diagram : Diagram
        All branches, with notes.
    question : Question
        What was explored, and how.
    stage : Stage
        How far it has come.
    """

    diagram: Diagram
    question: Question
    stage: Stage

    @property
    def coverage(self) -> tuple[Coverage, ...]:
        """What the simulations came to, one for each frequency, ascending."""
        return self.stage.coverage

    @property
    def finished(self) -> bool:
        """Whether all rounds were done, or one that found nothing new, and all folds followed."""
        done = len(self.stage.ends)
        if done == 0 or self.folds_due:
            return False
        return done >= self.question.effort.rounds or self.new_branches[done - 1] == 0

    @property
    def folds_due(self) -> bool:
        """Whether a round has done its simulations, and folds of branches are to be followed."""
        stage = self.stage
        between = stage.steps > 0 and self.question.place(stage.steps)[1] == 0
        wanted = self.question.effort.fold_factor > 1.0
        return wanted and between and stage.folds_followed < stage.branches

    @property
    def new_branches(self) -> tuple[int, ...]:
        """How many branches of the periods looked for each round found, the one at work too."""
        ends = [self.stage.given, *self.stage.ends]
        if len(ends) <= len(self.stage.met):
            ends.append(self.stage.branches)
        periods = [branch.period for branch in self.diagram.branches]
        longest = self.question.max_period
        return tuple(sum(n <= longest for n in periods[a:b]) for a, b in pairwise(ends))

    @property
    def meetings(self) -> tuple[int, ...]:
        """In how many rounds motions came to each branch of the periods looked for."""
        counts = np.asarray(self.stage.met).sum(axis=0).tolist()
        branches = self.diagram.branches[: self.stage.branches]
        longest = self.question.max_period
        return tuple(n for n, b in zip(counts, branches, strict=True) if b.period <= longest)

    @property
    def unmet_branches(self) -> float:
        """Estimate of how many branches motions would come to, but did not in the rounds done.

        See `chao_lower_bound`; NaN after one round. Some of them may be known, reached from
        flips, branch points or by deflation. It says nothing of branches that no motion comes near.
        """
        return chao_lower_bound(self.meetings, len(self.stage.ends))

    @property
    def settled_share(self) -> float:
        """Share of all simulations that ended on an orbit of one of the branches."""
        settled = sum(c.settled for c in self.coverage)
        total = sum(c.settled + c.unsettled + c.failed for c in self.coverage)
        return settled / total if total else math.nan

    def save(self, path: str | Path) -> None:
        """Write branches and coverage to one HDF5 file that `load_exploration` reads.

        Also `load_diagram` and `load_branches` read it.

        Raises
        ------
        OutputError, SystemModelError
            As `Branch.save`.
        """
        from nldyn.store import save_exploration

        save_exploration(path, self)

    def report(self) -> str:
        """What was found, tried and left unexplained, in a few lines."""
        counts = Counter(
            "harmonic" if branch.period == 1 else f"1/{branch.period}"
            for branch in self.diagram.branches
        )
        low, high = self.diagram.range_hz
        found = ", ".join(f"{n} {kind}" for kind, n in counts.items()) or "none"
        first = f"{low:g} to {high:g} Hz: {counted(self.diagram.branches)} ({found})"
        return "\n".join([first, *self.coverage_lines(), *self.diagram.notes])

    def coverage_lines(self) -> list[str]:
        """What was tried and left unexplained, line by line."""
        simulations = sum(c.settled + c.unsettled + c.failed for c in self.coverage)
        lines = []
        if simulations:
            lines.append(
                f"{simulations} simulations at {len(self.coverage)} frequencies, "
                f"{100.0 * self.settled_share:.1f} % ended on one of the branches"
            )
        failed = [c for c in self.coverage if c.failed]
        if failed:
            lines.append(
                f"{sum(c.failed for c in failed)} simulations could not be computed, at "
                f"{len(failed)} frequencies from {failed[0].frequency_hz:.4g} to "
                f"{failed[-1].frequency_hz:.4g} Hz"
            )
        if not self.finished:
            turn, steps, length = self.question.place(self.stage.steps)
            lines.append(
                f"not finished: of round {turn} the folds of {self.stage.folds_followed} of "
                f"{self.stage.branches} branches are followed"
                if self.folds_due
                else f"not finished: {steps} of {length} steps up and down of round {turn + 1} are "
                "done"
            )
        lines += self._rounds()
        open_ranges = ", ".join(
            f"{a:.4g}-{b:.4g}" if a < b else f"{a:.4g}" for a, b in self.unsettled_ranges()
        )
        if open_ranges:
            lines.append(
                f"motions that did not settle (chaos, longer periods or slow decay): "
                f"{open_ranges} Hz"
            )
        return lines + self._folds() + self._cut() + self._indices

    def _rounds(self) -> list[str]:
        """What each round found, and how many branches are still to be expected."""
        if math.isnan(self.unmet_branches):
            return []
        found = ", ".join(str(n) for n in self.new_branches)
        never, once, twice = (self.meetings.count(n) for n in (0, 1, 2))
        longest = self.question.max_period
        return [
            f"branches up to period {longest} that the rounds added: {found}",
            f"of them motions came to {len(self.meetings) - never}, {once} in one round only and "
            f"{twice} in two: at least about {self.unmet_branches:.0f} more are to be expected "
            f"that motions would come to (Chao 1987); {never} were reached otherwise"
            + (f" or known before, as {self.stage.given} were" if self.stage.given else ""),
        ]

    def _folds(self) -> list[str]:
        """Whose folds were followed, and in what."""
        factor, count = self.question.effort.fold_factor, self.stage.folds_followed
        if factor == 1.0 or count == 0:
            return []
        parameter = leading_parameter(self.question.flow.system)
        if parameter is None:
            return ["no folds were followed: there is neither damping nor excitation to change"]
        return [
            f"the folds of the first {count} branches, up to period {self.question.max_period}, "
            f"were followed in {parameter.name}, from 1/{factor:g} of it to {factor:g} times"
        ]

    def _cut(self) -> list[str]:
        """Where the motions had less time to settle than the damping asks for."""
        system, limit = self.question.flow.system, self.question.effort.settling
        needed = [(settling_periods(system, c.frequency_hz), c.frequency_hz) for c in self.coverage]
        cut = [hz for periods, hz in needed if periods > limit]
        if not cut:
            return []
        return [
            f"settling was cut at {limit} periods from {cut[0]:.4g} to {cut[-1]:.4g} Hz; the "
            f"slowest motion takes up to {max(needed)[0]} there"
        ]

    @cached_property
    def _indices(self) -> list[str]:
        """Whether orbits are missing for certain, where unstable ones were looked for as well."""
        longest = min(self.question.effort.unstable_period, self.question.max_period)
        if not (longest and self.finished and is_damped(self.question.flow.system)):
            return []
        return [index_note(self.diagram.branches, self.diagram.range_hz, longest)]

    def unsettled_ranges(self) -> list[tuple[float, float]]:
        """Ranges of neighbouring frequencies in Hz at which some simulations did not settle."""
        ranges: list[tuple[float, float]] = []
        before = False
        for c in self.coverage:
            if c.unsettled and before:
                ranges[-1] = (ranges[-1][0], c.frequency_hz)
            elif c.unsettled:
                ranges.append((c.frequency_hz, c.frequency_hz))
            before = c.unsettled > 0
        return ranges


@one_thread()
def explore(
    system: System | FlowMap,
    range_hz: tuple[float, float],
    max_period: int = 8,
    *,
    observe: str | None = None,
    effort: ExploreOptions | None = None,
    options: ContinuationOptions | None = None,
    known: Diagram | None = None,
    progress: Progress | None = None,
    checkpoint: str | Path | None = None,
) -> Exploration:
    """Find the branches of periodic orbits in a range of frequencies, without initial guesses.

    Motions are simulated at many frequencies from random states and swept up and down, each
    frequency starting from the attractors of the one before. What they settle on is solved for as
    an orbit, and its branch continued in both directions unless it is known. Unstable orbits come
    from near returns of motions that wander, from Newton's method deflated by the known orbits
    [Farrell, Birkisson and Funke 2015], and from flips, at each of which the doubled branch is
    followed as long as its period is within `max_period`, and from branch points. The folds of
    all of these may be followed in damping or excitation to further ones
    (`ExploreOptions.fold_factor`).

    Isolas of unstable orbits that no motion passes, attractors with small basins that exist
    between two of the frequencies only, and orbits of longer periods can still be missing.

    Parameters
    ----------
    system : System or FlowMap
        What to explore.
    range_hz : (float, float)
        Frequencies in Hz, ascending.
    max_period : int
        Longest orbits wanted, in excitation periods.
    observe : str, optional
        Interface whose displacement is reported; the first unless given.
    effort : ExploreOptions, optional
        How much to simulate.
    options : ContinuationOptions, optional
        Step control.
    known : Diagram, optional
        Of this system in this range, from `diagram` or an exploration with less effort. Its
        branches are taken over, what they lead to is followed, and others are looked for.
    progress : callable, optional
        Called as ``progress(what, frequency_hz)``.
    checkpoint : str or Path, optional
        File that keeps what is found, written now and then, at the end, and when an exception such
        as Ctrl-C ends the exploration; `load_exploration` reads it at any time. If it holds this
        very exploration, that one goes on and gives what an uninterrupted one gives.

    Returns
    -------
    Exploration

    Raises
    ------
    SystemModelError
        For input that makes no sense, or if `known` or `checkpoint` is of something else.
    OutputError
        If `checkpoint` cannot be written.

    Examples
    --------
    >>> from nldyn import ExploreOptions, Stop, System, Unbalance, explore
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = explore(system, (48.0, 52.0), 2, effort=ExploreOptions(spacing=0.05, starts=4))
    >>> sorted({branch.period for branch in found.diagram.branches})
    [1, 2]
    """
    flow = flow_of(system)
    check_types(
        effort=(effort, ExploreOptions, None),
        options=(options, ContinuationOptions, None),
        known=(known, Diagram, None),
        progress=(progress, Callable, None),
    )
    low, high = check_range(range_hz)
    check_whole("max_period", max_period, 1, LONGEST_PERIOD)
    question = Question(
        flow,
        (low, high),
        max_period,
        check_observe(flow.system, observe),
        effort or ExploreOptions(),
        options or ContinuationOptions(),
    )
    box = Collector(
        flow,
        question.range_hz,
        question.observe,
        question.options,
        progress or (lambda what, frequency_hz: None),
    )
    if known is None:
        known = Diagram((), question.range_hz, question.observe, ())
    _check_known(known, question)
    survey = _Survey(box, question, known)
    if checkpoint is None or not survey.goes_on_in(checkpoint):
        box.take(known.branches, known.notes)
    with box.checkpoint:
        while not (found := survey.so_far(box.branches)).finished:
            if found.folds_due:
                survey.follow_folds()
            else:
                survey.step()
    return survey.so_far(box.branches)


def _check_known(known: Diagram, question: Question) -> None:
    """Raise unless branches that are known belong to the question."""
    if known.range_hz != question.range_hz:
        (a, b), (low, high) = known.range_hz, question.range_hz
        raise SystemModelError(
            f"known: is of {a:g} to {b:g} Hz, but {low:g} to {high:g} Hz are to be explored"
        )
    if known.observe != question.observe:
        raise SystemModelError(
            f"known: observes {shown(known.observe)}, not {shown(question.observe)}"
        )
    check_flow(known, question.flow)


def _same_branches(a: Diagram, b: Diagram) -> bool:
    """Whether two diagrams hold the same branches, in the same order, and notes."""
    return (
        a.notes == b.notes
        and len(a.branches) == len(b.branches)
        and all(
            np.array_equal(one.frequency_hz, other.frequency_hz)
            and np.array_equal(one.nodes[0].orbit.point, other.nodes[0].orbit.point)
            for one, other in zip(a.branches, b.branches, strict=True)
        )
    )


class _Survey:
    """Simulations over frequencies that fill a box of branches."""

    def __init__(self, box: Collector, question: Question, known: Diagram) -> None:
        self.box, self.question, self.known = box, question, known
        self.max_period, self.effort = question.max_period, question.effort
        nothing = np.empty((0, 2 * question.flow.system.size))
        given = len(known.branches)
        met = np.zeros((0, given), dtype=bool)
        self.stage = Stage(0, given, len(known.notes), nothing, (), met, (), given)

    def goes_on_in(self, path: str | Path) -> bool:
        """Keep everything in a file, and begin where the exploration in it ended, if there is one.

        Raises
        ------
        SystemModelError, OutputError
            As `explore`.
        """
        from nldyn.store import check_writable, laws_of, load_exploration, save_exploration

        place = check_writable(path)
        earlier: Sequence[Branch] = ()
        begun = place.exists()
        if begun:
            laws = laws_of(self.question.flow.system)
            kept = begun_before(partial(load_exploration, laws=laws), place)
            given = replace(
                kept.diagram,
                branches=kept.diagram.branches[: kept.stage.given],
                notes=kept.diagram.notes[: len(self.known.notes)],
            )
            if not (self.question.same(kept.question) and _same_branches(given, self.known)):
                raise SystemModelError(
                    f"{path}: holds another exploration (other system, range, periods, effort, "
                    "options or known branches); choose another file, or delete it"
                )
            self.stage = kept.stage
            take = self.box.take_back if kept.stage.steps else self.box.take
            take(
                kept.diagram.branches[: kept.stage.branches],
                kept.diagram.notes[: kept.stage.notes],
            )
            earlier = kept.diagram.branches[kept.stage.branches :]
        self.box.checkpoint = Checkpoint(
            lambda branches: save_exploration(place, self.so_far(branches)),
            self.box.branches,
            earlier,
        )
        return begun

    def so_far(self, branches: Sequence[Branch]) -> Exploration:
        """What the steps that are done have come to, with branches found since then too."""
        box = self.box
        diagram = Diagram(tuple(branches), box.range_hz, box.observe, tuple(box.notes))
        return Exploration(diagram, self.question, self.stage)

    def step(self) -> None:
        """Simulate at the next frequency, from what came before and, going up, random states."""
        box, flow, stage = self.box, self.box.flow, self.stage
        turn, place, length = self.question.place(stage.steps)
        up, last = place < length // 2, place == length - 1
        frequency = self.question.frequencies(turn)[place if up else length - 1 - place]
        box.progress("explore", frequency)
        omega = 2.0 * math.pi * frequency
        if stage.steps == 0:
            box.follow_up(0, *self._depth)
        starts = stage.carried
        if up:
            seed = (self.effort.seed, turn, place)
            starts = np.vstack([starts, random_states(flow, omega, self.effort.starts, seed)])
        known = _Known(box, frequency)
        here, carried = self._search(starts, known, also_unstable=up)
        if up and self.effort.passing:
            count = self.effort.passing + 1  # the first is rest
            number = AGAIN + 1  # of the seed, after those of the searches again
            states = random_states(flow, omega, count, (self.effort.seed, turn, place, number))
            self._pass_by(states[1:], known)
        for again in range(AGAIN if up else 0):
            if not known.incomplete(min(self.effort.unstable_period, self.max_period)):
                break
            starts = random_states(
                flow, omega, self.effort.starts, (self.effort.seed, turn, place, again + 1)
            )
            here = here.with_more(self._search(starts, known, also_unstable=True)[0])
        both = {c.frequency_hz: c for c in stage.coverage}
        both[frequency] = both[frequency].with_more(here) if frequency in both else here
        met = self._met(turn + 1)
        met[turn, known.met] = True
        self.stage = Stage(
            stage.steps + 1,
            len(box.branches),
            len(box.notes),
            np.array(carried).reshape(-1, 2 * flow.system.size),
            tuple(both[hz] for hz in sorted(both)),
            met,
            (*stage.ends, len(box.branches)) if last else stage.ends,
            stage.given,
            stage.folds_followed,
        )
        if box.checkpoint.work is None:
            box.checkpoint.work = lambda: None  # the coverage is worth keeping without a branch too
        box.checkpoint.offer()

    def _met(self, rounds: int) -> NDArray[np.bool_]:
        """Which branches each round came to, with those found since the last step."""
        met = np.zeros((rounds, len(self.box.branches)), dtype=bool)
        met[: len(self.stage.met), : self.stage.branches] = self.stage.met
        return met

    def follow_folds(self) -> None:
        """Follow the folds of the next branch in a second parameter, and what they lead to."""
        box, stage = self.box, self.stage
        branch = box.branches[stage.folds_followed]
        parameter = leading_parameter(box.flow.system)
        if branch.period <= self.max_period and parameter is not None:
            self._beyond_folds(branch, parameter)
        self.stage = replace(
            stage,
            branches=len(box.branches),
            notes=len(box.notes),
            met=self._met(len(stage.met)),
            ends=(*stage.ends[:-1], len(box.branches)),
            folds_followed=stage.folds_followed + 1,
        )
        box.checkpoint.offer()

    def _beyond_folds(self, branch: Branch, parameter: Parameter) -> None:
        """Follow the branches to which curves of a branch's folds come back."""
        box, factor = self.box, self.effort.fold_factor
        passed: list[Orbit] = []
        for fold in branch.special_points:
            if fold.kind != "LP" or any(is_at(orbit, fold) for orbit in passed):
                continue
            box.progress("folds", fold.frequency_hz)
            which = f"the fold of branch {branch.name} at {fold.frequency_hz:.6g} Hz"
            try:
                found, broken = connected_folds(fold, parameter, factor, box.range_hz, box.options)
            except (ConvergenceError, SystemModelError) as error:
                box.notes.append(f"{which} was not followed in {parameter.name}: {error}")
                continue
            for reason in broken:
                box.notes.append(f"the curve in {parameter.name} of {which} broke off: {reason}")
            passed += found
            for orbit in found:
                if not self._is_known_fold(orbit):
                    self._follow(orbit)

    def _is_known_fold(self, orbit: Orbit) -> bool:
        return any(
            is_at(orbit, special)
            for branch in self.box.of_period(orbit.period)
            for special in branch.special_points
            if special.kind == "LP"
        )

    def _search(
        self, starts: Real, known: _Known, *, also_unstable: bool
    ) -> tuple[Coverage, list[Real]]:
        """Follow what motions come to; the states from which the next frequency starts."""
        attractors: list[Orbit] = []
        runs, wandering = [], []
        for start in starts:
            run, orbit = self._motion(start, known)
            if run is None:
                continue
            runs.append(run)
            orbit = orbit or self._settled_on(run, known.omega, attractors)
            if orbit is None:
                wandering.append(run)
            elif not any(same_orbit(orbit, other) for other in attractors):
                attractors.append(orbit)
                self._meet(orbit, known)
        adrift = [run[-1] for run in wandering]
        settled = [stroboscopic(orbit)[0] for orbit in attractors]
        if also_unstable:
            self._beside(runs, known, CANDIDATES)
            self._deflate(adrift + settled, known)
        coverage = Coverage(
            known.frequency_hz,
            tuple(sorted({orbit.period for orbit in attractors})),
            len(runs) - len(wandering),
            len(wandering),
            len(starts) - len(runs),
        )
        return coverage, settled + adrift[:1]

    def _motion(self, start: Real, known: _Known) -> tuple[Real | None, Orbit | None]:
        """States after each period, and the known stable orbit on which the motion has settled.

        It ends as soon as it comes near to one; no states if it cannot be computed.
        """
        flow = self.box.flow
        settling = settling_periods(flow.system, known.frequency_hz)
        settling = min(settling, self.effort.settling)
        left = settling + math.ceil(RETURNS * self.max_period) + 1
        states = np.array([start])
        while left > 0:
            self.box.progress("search", known.frequency_hz)
            count = min(left, max(PIECE, len(states) // 4))
            found = flow.strobe(states[-1], known.omega, count)
            if found.failure:
                return None, None
            states = np.vstack([states, found.ends])
            orbit = known.stable_near(states[-PIECE:])
            if orbit is not None:
                return states, orbit
            left -= count
        return states, None

    def _settled_on(self, run: Real, omega: float, known: Sequence[Orbit]) -> Orbit | None:
        """Stable orbit to which a run comes near at its end, one of the known ones if it can be."""
        scale = float(np.linalg.norm(run, axis=1).max()) or 1.0
        for orbit in known:
            if _nearest(stroboscopic(orbit), run[-1]) < 1e-4 * scale:
                return orbit
        for period in range(1, self.max_period + 1):
            tail = run[-period - self.max_period :]
            off = np.linalg.norm(tail[period:] - tail[:-period], axis=1)
            if float(np.median(off)) > NEAR * scale:
                continue
            found = self._orbit_near(run[-1 - period], period, omega)
            if found is None or not found.stable:
                continue
            if _nearest(stroboscopic(found), run[-1]) < NEAR * scale:
                return next((other for other in known if same_orbit(found, other)), found)
        return None

    def _orbit_near(self, start: Real, period: int, omega: float) -> Orbit | None:
        return orbit_near(self.box.flow, start, period, omega, self.box.observe)

    def _pass_by(self, starts: Real, known: _Known) -> None:
        """Look for unstable orbits that short motions pass by."""
        flow = self.box.flow
        motions = [flow.strobe(start, known.omega, PASSING) for start in starts]
        runs = [found.ends for found in motions if not found.failure]
        self._beside(runs, known, BESIDE_PASSING)

    def _unstable_periods(self) -> range:
        return range(1, min(self.effort.unstable_period, self.max_period) + 1)

    def _beside(self, runs: Sequence[Real], known: _Known, candidates: int) -> None:
        """Look for unstable orbits of short periods beside motions."""
        box, omega = self.box, known.omega
        low, high = box.range_hz
        for period, run in product(self._unstable_periods(), runs):
            for start in near_returns(run[TRANSIENT:], period, candidates):
                state = run[TRANSIENT + start]
                number = known.beside(state, period)
                if number is not None:
                    known.met.append(number)
                    continue
                orbit = orbit_beside(box.flow, state, period, omega, box.observe)
                if orbit is not None and low <= orbit.frequency_hz <= high:
                    self._meet(orbit, known)

    def _deflate(self, starts: Sequence[Real], known: _Known) -> None:
        """Look for unstable orbits of short periods with the known ones divided out."""
        for period, start in product(self._unstable_periods(), starts):
            others = known.of_period(period)
            other = deflated_orbit(self.box, start, period, known.omega, others)
            if other is not None:
                self._follow(other)
                known.take()

    def _meet(self, orbit: Orbit, known: _Known) -> None:
        """Follow the branch of an orbit that a motion came to, unless it is known."""
        if known.number(orbit) is None:
            self._follow(orbit)
            known.take()
        number = known.number(orbit)
        if number is not None:
            known.met.append(number)

    def _follow(self, orbit: Orbit) -> None:
        """Follow an orbit's branch unless it is known, and those that it leads to."""
        self.box.follow(orbit, *self._depth)

    @property
    def _depth(self) -> tuple[int, int, int | None]:
        """How far doubled branches are followed, see `Collector.follow_up`."""
        longest = max(self.max_period, self.effort.doubled_period)
        return longest, self.max_period, self.effort.doubled_points


class _Known:
    """Orbits of all branches at one frequency, and which of the branches motions came to."""

    def __init__(self, box: Collector, frequency_hz: float) -> None:
        self.box, self.frequency_hz = box, frequency_hz
        self.omega = 2.0 * math.pi * frequency_hz
        self.met: list[int] = []
        self._orbits: list[tuple[int, Orbit, Real]] = []  # with their stroboscopic states
        self._seen = 0
        self.take()

    def take(self) -> None:
        """Take the orbits of branches that were found since."""
        for number in range(self._seen, len(self.box.branches)):
            orbits = self.box.branches[number].at(self.frequency_hz)
            self._orbits += [(number, orbit, stroboscopic(orbit)) for orbit in orbits]
        self._seen = len(self.box.branches)

    def of_period(self, period: int) -> list[Orbit]:
        """Orbits of one period multiple."""
        return [orbit for _, orbit, _ in self._orbits if orbit.period == period]

    def incomplete(self, longest: int) -> bool:
        """Whether the indices of the fixed points of some Pⁿ up to a period do not add up to one.

        They need not where a mode is not damped.
        """
        if not is_damped(self.box.flow.system):
            return False
        orbits = [orbit for _, orbit, _ in self._orbits]
        return any(sum_of_indices(orbits, n) != 1 for n in range(1, longest + 1))

    def number(self, orbit: Orbit) -> int | None:
        """Number of the branch that an orbit, perhaps of another frequency, lies on."""
        if orbit.omega == self.omega:
            return next((i for i, other, _ in self._orbits if same_orbit(orbit, other)), None)
        branches = self.box.branches
        return next((i for i, branch in enumerate(branches) if branch.contains(orbit)), None)

    def beside(self, state: Real, period: int) -> int | None:
        """Number of the branch with an orbit near a state, its period the given one or a part."""
        size = ARRIVED * (float(np.linalg.norm(state)) or 1.0)
        for number, orbit, places in self._orbits:
            if period % orbit.period == 0 and _nearest(places, state) < size:
                return number
        return None

    def stable_near(self, states: Real) -> Orbit | None:
        """Stable orbit near which the last of some states lie, one period after the other."""
        size = ARRIVED * (float(np.linalg.norm(states, axis=1).max()) or 1.0)
        for _, orbit, places in self._orbits:
            if not orbit.stable:
                continue
            tail = states[-orbit.period :]
            off = np.linalg.norm(places[:, None] - tail[None], axis=2).min(axis=0)
            if float(off.max()) < size:
                return orbit
        return None


def _nearest(places: Real, state: Real) -> float:
    """Distance of a state from the nearest of some places (m, 2n)."""
    return float(np.linalg.norm(places - state, axis=1).min())


def chao_lower_bound(counts: Sequence[int], rounds: int) -> float:
    """Estimated number of kinds that none of several rounds met, NaN for less than two rounds.

    From the numbers Q₁ and Q₂ of kinds met in one and in two of r rounds it is
    (r - 1)/r Q₁(Q₁ - 1)/(2(Q₂ + 1)) [Chao 1987, bias-corrected]. Where some kinds are harder to
    meet than others, it is a lower bound.

    Parameters
    ----------
    counts : sequence of int
        In how many rounds each kind was met.
    rounds : int
        Number r of rounds.

    Examples
    --------
    >>> chao_lower_bound([1, 1, 1, 2, 2, 4], 4)
    0.75
    """
    if rounds < 2:
        return math.nan
    once, twice = counts.count(1), counts.count(2)
    return (rounds - 1) / rounds * once * max(once - 1, 0) / (2.0 * (twice + 1))


def settling_periods(system: System, frequency_hz: float) -> int:
    """Excitation periods after which the slowest linear motion has decayed to e^-4, at least 30.

    A motion without damping does not settle; 600 periods show where it goes.

    Examples
    --------
    >>> from nldyn import System
    >>> system = System.from_modal([10.0], {"tip": [1.0]}, modal_damping=0.01)
    >>> settling_periods(system, 10.0)
    64
    """
    slowest = min(-float(np.linalg.eigvals(block).real.max()) for block in system.linear.blocks)
    if slowest <= 0.0:
        return UNDAMPED
    return max(math.ceil(DECAYS * frequency_hz / slowest), FEWEST)


def deflated_orbit(
    box: Collector, start: Real, period: int, omega: float, known: Sequence[Orbit]
) -> Orbit | None:
    """Orbit other than the known ones, by Newton's method on the deflated equations.

    The equations are multiplied by ∏ (1/|x - xᵢ|² + 1) over the known orbits and their shifts, so
    that Newton's steps are only stretched [Farrell, Birkisson and Funke 2015, section 2]; long
    steps are shortened.
    """
    problem = shooting_problem(box.flow, period)
    try:
        point = np.append(spread(problem, start, omega).ravel(), math.log(omega))
    except ConvergenceError:
        return None
    row = np.zeros(point.size)
    row[-1] = 1.0
    repelled = [x[:-1] for orbit in known for x in shifts(problem, orbit.point)]
    for _ in range(ITERATIONS):
        step = problem.correct(point, row, max_iterations=1).point - point
        size = problem.scale(point) * math.sqrt(problem.segments)
        length = float(np.linalg.norm(step)) / size
        if not math.isfinite(length):
            return None
        away = min((float(np.linalg.norm(point[:-1] - x)) / size for x in repelled), default=1.0)
        if length == 0.0 or length < min(1e-4, 0.1 * away):
            break
        stretch = _stretch(point[:-1], step[:-1], repelled, size)
        point = point + step * math.copysign(min(abs(stretch), LONGEST / length), stretch)
    else:
        return None
    try:
        orbit = refine(problem, problem.nodes(point), omega, box.observe, max_iterations=10)
    except ConvergenceError:
        return None
    if minimal_period(orbit) < period or any(same_orbit(orbit, other) for other in known):
        return None
    return orbit


def _stretch(x: Real, step: Real, repelled: Sequence[Real], size: float) -> float:
    """Factor 1/(1 - m'·step/m) of a Newton step, m being the product that repels."""
    slope = 0.0
    for other in repelled:
        away = (x - other) / size
        square = float(away @ away) or 1e-300
        slope += -2.0 * float(away @ step) / size / (square * (1.0 + square))
    return 1.0 / (1.0 - slope) if slope != 1.0 else 1.0
