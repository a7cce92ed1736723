"""What all searches share: orbits are followed to branches, new ones told from known ones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from nldyn.base.errors import ConvergenceError, LocateError
from nldyn.base.rows import Rows
from nldyn.bifurcations.normal_forms import switch_at_branch_point
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.bifurcations.point import BranchNode, SpecialPoint, is_at, place_of
from nldyn.branches.branch import Branch, Course
from nldyn.branches.checkpoint import Checkpoint
from nldyn.branches.continuation import (
    broken_off,
    first_point,
    further_ranges,
    going_on,
    leg_key,
    offer_branch,
    open_ends,
    walked_leg,
)
from nldyn.branches.endings import Ending
from nldyn.branches.step_control import ContinuationOptions
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.axis import Axis, Section
from nldyn.orbits.limit_cycle import limit_cycle_near
from nldyn.orbits.orbit import Orbit, minimal_period, stroboscopic
from nldyn.orbits.solve import solve_orbit
from nldyn.orbits.starts import orbit_near
from nldyn.runtime.prefetch import Ahead, Task
from nldyn.runtime.progress import Progress
from nldyn.search.outlook import Outlook
from nldyn.system.chart import FREQUENCY


@dataclass
class Collector:
    """Branches found so far, with the tools to add more."""

    flow: FlowMap
    axis: Axis
    observe: str
    options: ContinuationOptions
    progress: Progress
    checkpoint: Checkpoint = field(default_factory=Checkpoint)
    branches: list[Branch] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    open_ends: dict[tuple[int, int], Rows] = field(default_factory=dict)
    flip_ends: list[Orbit] = field(default_factory=list)
    crossings: list[SpecialPoint] = field(default_factory=list)
    done: float = 0.0  # share of the whole computation
    ahead: Ahead = field(init=False)
    outlook: Outlook = field(default_factory=Outlook)
    starts: dict[int, tuple[SpecialPoint, BranchNode | LocateError]] = field(
        default_factory=dict
    )  # of the branches born at flips, by the flips' ids

    def __post_init__(self) -> None:
        self.ahead = Ahead(self.flow)

    def at(self, value: float) -> Section:
        """The motions at a value of the parameter."""
        return self.axis.at(self.flow, value)

    def _start_of(self, orbit: Orbit) -> BranchNode:
        """Where the branch of an orbit begins."""
        return first_point(self.axis.family(self.flow, orbit), orbit)

    def tell(self, what: str, value: float) -> None:
        """Say what is being computed."""
        if self.axis.parameter.name != FREQUENCY:
            what, value = f"{what} at {self.axis.told(value)}", 0.0
        self.progress(what, value, self.done)
        self.ahead.look()

    def reach(self, part: str, count: int) -> None:
        """Count what is done of a part of the `outlook`."""
        self.outlook.reach(part, count)
        self.done = self.outlook.done

    def known(self, orbit: Orbit) -> bool:
        return self.branch_of(orbit) is not None

    def branch_of(self, orbit: Orbit) -> int | None:
        """Index of the branch that passes through an orbit."""
        passing = (i for i, branch in enumerate(self.branches) if branch.contains(orbit))
        return next(passing, None)

    def of_period(self, period: int) -> list[Branch]:
        return [branch for branch in self.branches if branch.period == period]

    def _add(self, branch: Branch) -> None:
        count = len(self.branches) + 1
        label = "harmonic" if branch.period == 1 else f"1/{branch.period}"
        if self.axis.self_excited:
            label = "limit cycle"
        named = replace(branch, name=f"{count:02d} {label}")
        self._keep(named)
        self.notes += [f"branch {named.name}: {note}" for note in named.notes]
        self.notes += notes_on_ends(named)

    def _keep(self, branch: Branch) -> None:
        self.branches.append(branch)
        for end in open_ends(branch):
            self._open_ends_like(branch.nodes[0]).add(end)
        ends = zip(branch.stop_reasons, (branch.nodes[0], branch.nodes[-1]), strict=True)
        self.flip_ends += [node.orbit for reason, node in ends if reason.ending is Ending.JOINS]

    def _open_ends_like(self, node: BranchNode) -> Rows:
        """Where branches were broken off at orbits of as many periods and unknowns as this one.

        What lies beyond is followed up to there.
        """
        like = node.family.period, node.point.size
        return self.open_ends.setdefault(like, Rows(node.point.size))

    def take(self, branches: Iterable[Branch], notes: Iterable[str]) -> None:
        """Take branches that are known, with their names; see `follow_up`."""
        self.notes += notes
        for branch in branches:
            self._keep(branch)

    def take_back(self, branches: Iterable[Branch], notes: Iterable[str]) -> None:
        """Take branches that an earlier run had found, named and followed up, in its order."""
        branches = tuple(branches)
        self.take(branches, notes)
        for branch in branches:
            for special in branch.special_points:
                if special.kind == "BP":
                    self._is_new_crossing(special)

    def _is_new_crossing(self, special: SpecialPoint) -> bool:
        """Whether a branch point was not met before; from now on it was."""
        if any(is_at(special.orbit, other) for other in self.crossings):
            return False
        self.crossings.append(special)
        return True

    def within(self, orbits: Iterable[Orbit | None]) -> list[Orbit]:
        """Those of some orbits that were found, and that lie within the range."""
        return [o for o in orbits if o is not None and self._is_within(o)]

    def from_orbits(
        self, orbits: Iterable[Orbit], options: ContinuationOptions | None = None
    ) -> None:
        """Follow each orbit both ways, unless its branch is known."""
        for orbit in orbits:
            if self.known(orbit):
                continue
            try:
                start = self._start_of(orbit)
            except ConvergenceError as error:
                self.notes.append(f"orbit of period {orbit.period} found but not followed: {error}")
            else:
                self.from_start(start, options)

    def offer_orbits(self, orbits: Iterable[Orbit]) -> None:
        """Let branches be followed ahead, of each period one at a time: most will be the same."""
        if self.ahead.executor is None:
            return
        for orbit in orbits:
            try:
                start = self._start_of(orbit)
            except ConvergenceError:
                continue
            if not self.known(start.orbit):
                group = "period", orbit.period
                offer_branch(self.ahead, start, self._course(start, None), group)

    def offer_flips(self, branch: Branch, options: ContinuationOptions | None = None) -> None:
        """Let the branches be followed ahead that are born at the flips of a branch.

        A branch mostly leads from one flip to the next; so only every other one is tried.
        """
        if self.ahead.executor is None:
            return
        flips = [special for special in branch.special_points if special.kind == "PD"]
        for special in flips[::2]:
            start = self._start_at(special)
            if not isinstance(start, BranchNode) or not self._is_within(start.orbit):
                continue
            if not self.known(start.orbit):
                offer_branch(self.ahead, start, self._course(start, options))

    def _start_at(self, special: SpecialPoint) -> BranchNode | LocateError:
        """The start of the branch that is born at a flip, or why there is none; computed once."""
        if id(special) not in self.starts:
            try:
                start: BranchNode | LocateError = switch_at_flip(special)
            except LocateError as error:
                start = error
            self.starts[id(special)] = special, start
        return self.starts[id(special)][1]

    def _course(self, start: BranchNode, options: ContinuationOptions | None) -> Course:
        ends = self._open_ends_like(start).so_far()
        further = further_ranges(start.family)
        return Course(self.axis.limits, options or self.options, ends, further=further)

    def _is_within(self, orbit: Orbit) -> bool:
        return self.axis.holds(self.axis.value(orbit))

    def follow(self, orbit: Orbit, longest: int, wanted: int, most: int | None) -> None:
        """Follow an orbit's branch unless it is known, and what it leads to; see `follow_up`."""
        count = len(self.branches)
        self.from_orbits([orbit])
        self.follow_up(count, longest, wanted, most)

    def follow_up(self, count: int, longest: int, wanted: int, most: int | None) -> None:
        """Follow what the branches after the first `count` lead to.

        Doubled branches are followed up to the longest period. Those that are longer in period than
        wanted end after `most` points in one direction, if that is given.
        """
        shorter = self.options if most is None else replace(self.options, max_points=most)
        while count < len(self.branches):
            branch = self.branches[count]
            count += 1
            if 2 * branch.period <= longest:
                self.offer_flips(branch, self.options if 2 * branch.period <= wanted else shorter)
            for special in branch.special_points:
                if special.kind not in ("PD", "BP"):
                    continue
                period = minimal_period(special.orbit) * (2 if special.kind == "PD" else 1)
                options = self.options if period <= wanted else shorter
                if special.kind == "PD" and period <= longest:
                    self.from_flip(special, options)
                elif special.kind == "BP":
                    self.from_branch_point(special, options)
            self.from_mirror(branch, self.options if branch.period <= wanted else shorter)

    def from_mirror(self, branch: Branch, options: ContinuationOptions) -> None:
        """Follow the mirror image of a branch, if the system is symmetric and it is not known."""
        if not self.flow.system.symmetric:
            return
        orbit = middle_orbit(branch)
        try:
            start = self._start_of(mirror_image(orbit))
        except ConvergenceError as error:
            self.notes.append(f"the mirror image of branch {branch.name} was not found: {error}")
        else:
            self.from_start(start, options)

    def _repeats(self, branch: Branch) -> bool:
        """Whether a branch is a known one after all: beside folds and flips that may not be seen.

        One of the two holds the middle of the other. One that holds a known branch which was broken
        off is more than that.
        """
        return self.known(middle_orbit(branch)) or any(
            branch.contains(middle_orbit(other))
            for other in self.of_period(branch.period)
            if not broken_off(other)
        )

    def from_flip(self, special: SpecialPoint, options: ContinuationOptions | None = None) -> None:
        """Follow the branch that is born at a flip, unless it is known."""
        if any(is_at(end, special, 2) for end in self.flip_ends):
            return
        start = self._start_at(special)
        if isinstance(start, LocateError):
            self.notes.append(str(start))
        else:
            self.from_start(start, options)

    def from_branch_point(
        self, special: SpecialPoint, options: ContinuationOptions | None = None
    ) -> None:
        """Follow the other branch through a branch point both ways, unless it is known.

        Where a doubled branch comes to the flip that it is born at, that is the one of the shorter
        period.
        """
        if not self._is_new_crossing(special):
            return
        orbit, shorter = special.orbit, minimal_period(special.orbit)
        if shorter < orbit.period:
            state = stroboscopic(orbit)[0]
            flow = orbit.problem.flow
            single = orbit_near(flow, state, shorter, orbit.omega, orbit.observe)
            if single is None:
                place = special.place()
                note = f"no orbit of period {shorter} found at the branch point at {place}"
                self.notes.append(note)
            else:
                self.from_orbits([single], options)
            return
        try:
            starts = switch_at_branch_point(special)
        except LocateError as error:
            self.notes.append(str(error))
            return
        for start in starts:
            self.from_start(start, options)

    def from_start(self, start: BranchNode, options: ContinuationOptions | None = None) -> None:
        """Follow a branch from a point both ways, unless it is known or out of range."""
        if not self._is_within(start.orbit) or self.known(start.orbit):
            return
        progress = partial(self.tell, f"1/{start.orbit.period}")
        course = self._course(start, options)
        group = "period", start.orbit.period
        progress(start.value)
        self.ahead.take(group, leg_key(start, course))
        self.take_in(going_on("", None, start, course, progress, self.checkpoint, self.ahead))
        self.ahead.release(group)
        self.ahead.drop(self._is_of_last)

    def _is_of_last(self, task: Task) -> bool:
        """Whether the leg of a task is one of the branch that was found last."""
        if task.function is not walked_leg or not self.branches:
            return False
        return self.branches[-1].contains(task.arguments[0].orbit)

    def take_in(self, branch: Branch) -> None:
        """Add the branch that was at work, unless it is a known one."""
        if not self._repeats(branch):
            self._add(branch)
            if 2 * branch.period in self.outlook.doubled:
                self.offer_flips(branch)
                flips = [s for b in self.of_period(branch.period) for s in b.special_points
                         if s.kind == "PD"]  # fmt: skip
                self.outlook.flips(2 * branch.period, len(flips))
        self.checkpoint.work = None


def mirror_image(orbit: Orbit) -> Orbit:
    """The mirror image of an orbit of a symmetric system.

    Raises
    ------
    ConvergenceError
        If it is not met.
    """
    problem = orbit.problem
    if orbit.self_excited:
        found = orbit.observed_extremes
        lowest = orbit.states(found.phases[[np.argmin(found.values)]])[0]
        state = problem.flow.to_state(-lowest)
        return limit_cycle_near(problem, state, orbit.omega, orbit.observe)
    half_later = -orbit.states(problem.phases[:-1] + math.pi)
    return solve_orbit(
        problem.flow,
        orbit.frequency_hz,
        orbit.period,
        guess=half_later,
        observe=orbit.observe,
        segments=problem.segments,
    )


def notes_on_ends(branch: Branch) -> list[str]:
    """Where a branch was broken off, and why."""
    return [
        f"branch {branch.name} was broken off at {place_of(end)}: {reason}"
        for end, reason in broken_off(branch)
    ]


def counted(branches: Sequence[Branch]) -> str:
    """How many branches, in words."""
    return "1 branch" if len(branches) == 1 else f"{len(branches)} branches"


def middle_orbit(branch: Branch) -> Orbit:
    """Orbit of a branch away from where it ends and from where it turns or crosses another one.

    Of those after a quarter, half and three quarters of its points the one whose multipliers keep
    farthest from 1: halves of a broken symmetry cross the symmetric branch halfway.
    """
    inner = branch.nodes[1:-1] or branch.nodes
    quarters = [inner[i * len(inner) // 4].orbit for i in (2, 1, 3)]
    return max(quarters, key=lambda orbit: float(np.abs(orbit.multipliers - 1.0).min()))
