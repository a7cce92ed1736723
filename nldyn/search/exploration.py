"""What `explore` is asked and what it has found: options, coverage, report."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_whole, is_finite, shown
from nldyn.branches.step_control import MOST_POINTS, ContinuationOptions
from nldyn.flow.flow_map import FlowMap, same_flow
from nldyn.orbits.axis import Axis
from nldyn.orbits.shooting import LONGEST_PERIOD
from nldyn.orbits.starts import MOST_COUNT, settling_periods
from nldyn.search.collector import counted
from nldyn.search.diagram import Diagram
from nldyn.search.fixed_point_index import index_note, is_damped_along

FINEST_SPACING = 1e-6
MOST_NUMBERS = 10**7  # of counts of closed walks: states times the longest period
CAN_BE_MISSING = (
    "may be missing all the same: isolas that no motion came near, and what is stable in small "
    "basins or between two values; another seed, more rounds "
    "or extend_diagram may find them"
)


@dataclass(frozen=True)
class ExploreOptions:
    """Effort of `explore`.

    Parameters
    ----------
    spacing : float
        Largest relative distance of the frequencies at which motions are simulated, or of other
        values; where their range is not positive, the share of its width. A branch that is stable
        only in a narrower window may be missed.
    starts : int
        Initial states at each of them, rest and random ones, beside the motions of the frequency
        before.
    rounds : int
        Most searches through the range. Each begins from rest and random states of its own at
        frequencies between those of the ones before; one that finds no new branch up to the
        longest period looked for is the last.
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
    pseudo_orbits : int
        Most closed sequences of pieces of known orbits, of each length up to `unstable_period`,
        beside which orbits are looked for at each frequency on the way down, see
        `PseudoOrbits`.
    mixtures : int
        Mixtures of two known orbits, of each length up to `unstable_period`, beside which orbits
        are looked for at each frequency on the way down, see `Mixtures`.
    walks : int
        Most closed walks among random states, of each length up to `unstable_period`, beside which
        orbits are looked for at each frequency on the way down, see `ClosedWalks`.
    walk_states : int
        How many random states these are among.
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
    pseudo_orbits: int = 10
    mixtures: int = 10
    walks: int = 10
    walk_states: int = 500
    seed: int = 20

    def __post_init__(self) -> None:
        check_spacing("explore: spacing", self.spacing)
        check_whole("explore: starts", self.starts, 1, MOST_COUNT)
        check_whole("explore: rounds", self.rounds, 1, MOST_COUNT)
        check_whole("explore: settling", self.settling, 1, MOST_COUNT)
        check_whole("explore: unstable_period", self.unstable_period, 0, LONGEST_PERIOD)
        check_whole("explore: doubled_period", self.doubled_period, 1, LONGEST_PERIOD)
        if self.doubled_points is not None:
            check_whole("explore: doubled_points", self.doubled_points, 2, MOST_POINTS)
        check_whole("explore: pseudo_orbits", self.pseudo_orbits, 0, MOST_COUNT)
        check_whole("explore: mixtures", self.mixtures, 0, MOST_COUNT)
        check_whole("explore: walks", self.walks, 0, MOST_COUNT)
        check_walk_states("explore: walk_states", self.walk_states, max(1, self.unstable_period))
        check_whole("explore: seed", self.seed, 0)


@dataclass(frozen=True)
class Coverage:
    """What simulations at one frequency, or another value, came to.

    Parameters
    ----------
    value : float
        Excitation frequency in Hz, or value of the parameter.
    periods : tuple of int
        Period multiples of the different attractors found, ascending.
    settled, unsettled, failed : int
        Numbers of simulations that ended on one of them, that did not (chaotic motion, longer
        periods or slow transients), and that could not be computed.
    """

    value: float
    periods: tuple[int, ...]
    settled: int
    unsettled: int
    failed: int

    def with_more(self, other: Coverage) -> Coverage:
        """Both together."""
        return Coverage(
            self.value,
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
    axis : Axis
        What changes, over which range.
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
    axis: Axis
    max_period: int
    observe: str
    effort: ExploreOptions
    options: ContinuationOptions

    def values(self, turn: int) -> list[float]:
        """Frequencies in Hz, or other values, at which a round simulates motions, ascending.

        Between two neighbours of the first round, the shares of the way at which the further ones
        lie are van der Corput's sequence 1/2, 1/4, 3/4, 1/8, ...: each fills the largest gaps.
        """
        found: list[float] = self.axis.spread(self.axis.steps(self.effort.spacing) + 1).tolist()
        if turn == 0:
            return found
        share, weight = 0.0, 0.5
        while turn:
            share, weight, turn = share + weight * (turn % 2), 0.5 * weight, turn // 2
        return [self.axis.between(a, b, share) for a, b in pairwise(found)]

    def place(self, steps: int) -> tuple[int, int, int]:
        """Round in which some steps have ended, how many of them belong to it, and its length."""
        turn = 0
        while steps >= (length := 2 * len(self.values(turn))):
            turn, steps = turn + 1, steps - length
        return turn, steps, length

    def same(self, other: Question) -> bool:
        """Whether another question is this one, but for the number of rounds."""
        mine, its = (
            (q.axis, q.max_period, q.observe, replace(q.effort, rounds=1), q.options)
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
    """

    steps: int
    branches: int
    notes: int
    carried: Real
    coverage: tuple[Coverage, ...]
    met: NDArray[np.bool_]
    ends: tuple[int, ...]
    given: int = 0


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

    def __repr__(self) -> str:
        """One line: branches, and the share of simulated motions that they explain."""
        share = f"{100.0 * self.settled_share:.1f} % of simulated motions explained"
        ended = "" if self.finished else ", not finished"
        told = self.question.axis.told_range()
        return f"<Exploration of {told}: {counted(self.diagram.branches)}, {share}{ended}>"

    @property
    def coverage(self) -> tuple[Coverage, ...]:
        """What the simulations came to, one for each frequency, ascending."""
        return self.stage.coverage

    @property
    def finished(self) -> bool:
        """Whether all rounds were done, or one that found nothing new."""
        done = len(self.stage.ends)
        if done == 0:
            return False
        return done >= self.question.effort.rounds or self.new_branches[done - 1] == 0

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
        """In how many of the rounds done motions came to each branch they know of.

        Of the branches of the periods looked for.
        """
        rounds, known = len(self.stage.ends), (0, *self.stage.ends)[-1]
        counts = np.asarray(self.stage.met)[:rounds, :known].sum(axis=0).tolist()
        branches = self.diagram.branches[:known]
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

    def report(self) -> str:
        """What was found, tried and left unexplained, in a few lines."""
        counts = Counter(
            "harmonic" if branch.period == 1 else f"1/{branch.period}"
            for branch in self.diagram.branches
        )
        found = ", ".join(f"{n} {kind}" for kind, n in counts.items()) or "none"
        told = self.question.axis.told_range()
        first = f"{told}: {counted(self.diagram.branches)} ({found})"
        return "\n".join([first, *self.coverage_lines(), *self.diagram.notes])

    def coverage_lines(self) -> list[str]:
        """What was tried and left unexplained, line by line."""
        simulations = sum(c.settled + c.unsettled + c.failed for c in self.coverage)
        lines, axis = [], self.question.axis
        if simulations:
            lines.append(
                f"{simulations} simulations at {axis.counted(len(self.coverage))}, "
                f"{100.0 * self.settled_share:.1f} % ended on one of the branches"
            )
        failed = [c for c in self.coverage if c.failed]
        if failed:
            lines.append(
                f"{sum(c.failed for c in failed)} simulations could not be computed, at "
                f"{axis.counted(len(failed))} from "
                f"{axis.told_span(failed[0].value, failed[-1].value, digits=4)}"
            )
        if not self.finished:
            turn, steps, length = self.question.place(self.stage.steps)
            lines.append(
                f"not finished: {steps} of {length} steps up and down of round {turn + 1} are done"
            )
        lines += self._rounds()
        open_ranges = self.unsettled_ranges()
        if open_ranges:
            lines.append(
                f"motions that did not settle (chaos, longer periods or slow decay): "
                f"{axis.told_ranges(open_ranges)}"
            )
        tried = self._unstable() + self._beside() + self._cut()
        return lines + tried + self._indices + [CAN_BE_MISSING]

    def _rounds(self) -> list[str]:
        """What each round found, and how many branches are still to be expected."""
        if math.isnan(self.unmet_branches):
            return []
        found = ", ".join(str(n) for n in self.new_branches)
        never, once, twice = (self.meetings.count(n) for n in (0, 1, 2))
        longest = self.question.max_period
        return [
            f"branches up to period {longest} that the rounds added: {found}",
            f"in {len(self.stage.ends)} rounds motions came to {len(self.meetings) - never} of "
            f"{len(self.meetings)} branches, to {once} in one round only and to {twice} in two: "
            f"at least about {self.unmet_branches:.0f} more are to be expected "
            f"that motions would come to (Chao 1987); {never} were reached otherwise"
            + (f" or known before, as {self.stage.given} were" if self.stage.given else ""),
        ]

    def _unstable(self) -> list[str]:
        """Which unstable orbits were not looked for beside motions."""
        longest, wanted = self.question.effort.unstable_period, self.question.max_period
        if longest >= wanted:
            return []
        above = f" of periods above {longest}" if longest else ""
        return [
            f"unstable orbits{above} were not looked for (unstable_period={longest}): they are "
            "found only where a branch of the others leads to them"
        ]

    def _beside(self) -> list[str]:
        """Where known orbits were mixed, or pieces of them put together."""
        effort = self.question.effort
        longest = min(effort.unstable_period, self.question.max_period)
        turn, steps, length = self.question.place(self.stage.steps)
        way_down_begun = turn > 0 or 2 * steps > length
        if not (longest and way_down_begun):
            return []
        guesses = {
            f"up to {effort.pseudo_orbits} pseudo-orbits": effort.pseudo_orbits,
            f"{effort.mixtures} mixtures": effort.mixtures,
            f"up to {effort.walks} closed walks": effort.walks,
        }
        return [
            f"beside {what} of each length up to {longest} orbits were looked for at each "
            f"{self.question.axis.noun} on the way down"
            for what, count in guesses.items()
            if count
        ]

    def _cut(self) -> list[str]:
        """Where the motions had less time to settle than the damping asks for."""
        axis, flow, limit = self.question.axis, self.question.flow, self.question.effort.settling
        here = [axis.at(flow, c.value) for c in self.coverage]
        needed = [(settling_periods(at.flow.system, at.frequency_hz), at.value) for at in here]
        cut = [value for periods, value in needed if periods > limit]
        if not cut:
            return []
        span = axis.told_span(cut[0], cut[-1], digits=4)
        return [
            f"settling was cut at {limit} periods from {span}; the slowest motion takes up to "
            f"{max(needed)[0]} there"
        ]

    @cached_property
    def _indices(self) -> list[str]:
        """Whether orbits are missing for certain, where unstable ones were looked for as well."""
        longest = min(self.question.effort.unstable_period, self.question.max_period)
        axis = self.question.axis
        if not (longest and self.finished and is_damped_along(axis, self.question.flow)):
            return []
        return [index_note(self.diagram.branches, axis, longest)]

    def unsettled_ranges(self) -> list[tuple[float, float]]:
        """Ranges of neighbouring frequencies in Hz, or values, where simulations did not settle."""
        ranges: list[tuple[float, float]] = []
        before = False
        for c in self.coverage:
            if c.unsettled and before:
                ranges[-1] = (ranges[-1][0], c.value)
            elif c.unsettled:
                ranges.append((c.value, c.value))
            before = c.unsettled > 0
        return ranges


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


def check_spacing(name: str, spacing: object) -> None:
    """Raise unless this may be a relative distance of frequencies."""
    if not (is_finite(spacing) and FINEST_SPACING <= spacing < 1.0):
        raise SystemModelError(
            f"{name} must be at least {FINEST_SPACING:g} and less than 1, got {shown(spacing)}"
        )


def check_walk_states(name: str, states: object, longest: int) -> None:
    """Raise unless closed walks up to a period may be made among so many states."""
    check_whole(name, states, 1, MOST_NUMBERS // longest)
