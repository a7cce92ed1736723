"""Pseudo-arclength continuation of periodic orbits in the excitation frequency."""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from cms.threads import one_thread
from nldyn.branch import (
    CLOSED,
    JOINS,
    NOT_FINISHED,
    POINTS,
    RANGE_END,
    SHORT_STEP,
    Branch,
    BranchPoint,
    Course,
    SpecialPoint,
    WalkEnd,
    check_special,
)
from nldyn.checkpoint import Checkpoint, checkpoint_at
from nldyn.conditions import TOUCH, depth_row, nearest_flip
from nldyn.crossings import check_requested, requested
from nldyn.errors import (
    LARGEST_FREQUENCY,
    SMALLEST_FREQUENCY,
    SystemModelError,
    check_positive,
    check_types,
    check_whole,
    is_finite,
    shown,
)
from nldyn.linear import Real
from nldyn.orbit import ConvergenceError, Orbit, check_minimal, minimal_period, refine
from nldyn.shooting import ShootingProblem, asymmetry, metric_length
from nldyn.special import (
    ON_CROSSING,
    SHORTEST_CROSSING,
    Chord,
    LocateError,
    crosses,
    crossing_beside,
    distance,
    insert_dip,
    is_crossing,
    lies_on_crossing,
    special_points_between,
    without_repeats,
)
from nldyn.system import numbers

KINK = TOUCH  # step below which a branch may bend by any angle where the number of contacts changes
MEETS_OPEN_END = "meets another branch where that was broken off"
BROKEN = 1e-8  # asymmetry of an orbit that is more than rounding
EQUAL_HALVES = 1e-3  # difference of an orbit's halves, over that of the orbit before
MEETING_STEP = 1e-4  # longest step over which a doubled branch may meet the one it comes from
AT_FLIP = 1e-5  # distance of a turn of a doubled branch from its end that may be the flip itself
FLAT = 1e-4  # frequency part of tangents beside such a turn, below which it is
FROM_FOLD = 1e-4  # arclength from a fold to the point at which a branch through it begins
LONGER_CROSSINGS = (1.0, 10.0, 100.0)  # times that, where no shorter step succeeds
LOOKS_BACK = 4  # steps between two looks whether a walk has been there before
RECENT = 10  # points behind a walk that it does not come back to
SAME_PLACE = 1e-8  # distance of points that are one, relative to the orbit
COMES_BACK = "comes back to where it had been"
TOO_NEAR = "on the way it left the branch for another one that lies too near"
SHORTEST_DETOUR = 1e-6  # first step of a walk that looks closely at what lies within a step
MOST_DETOUR = 500  # points of such a walk
MOST_POINTS = 10**8  # in one direction
MET_AGAIN = 1e-6  # longest Newton step by which a solved orbit is met again across its branch


@dataclass(frozen=True)
class ContinuationOptions:
    """Step control. Lengths are relative: a step of 0.1 changes orbit or frequency by 10 %.

    Parameters
    ----------
    first_step, max_step, min_step : float
        Arclength steps.
    max_angle : float
        Largest angle between the tangents of two neighbouring points, in radians. With more than
        0.3 a step may leave the branch unseen where another one crosses it.
    max_miss : float
        Largest distance of a point from where it was predicted, relative to the step; more than
        0.2 is as doubtful.
    grazing_step : float
        Longest step over which the number of contacts may change.
    max_points : int
        Most points in one direction.

    Raises
    ------
    SystemModelError
        For a length or angle out of range, or steps out of order.
    """

    first_step: float = 0.01
    max_step: float = 0.05
    min_step: float = 1e-10
    max_angle: float = 0.25
    max_miss: float = 0.1
    grazing_step: float = 0.004
    max_points: int = 5000

    def __post_init__(self) -> None:
        for name in ("min_step", "first_step", "max_step", "max_angle", "max_miss", "grazing_step"):
            value = getattr(self, name)
            if not (is_finite(value) and value > 0.0):
                raise SystemModelError(
                    f"continuation: {name} must be positive and finite, got {shown(value)}"
                )
        if not self.min_step <= self.first_step <= self.max_step:
            raise SystemModelError(
                "continuation: steps must satisfy min_step <= first_step <= max_step"
            )
        if self.grazing_step < self.min_step:
            raise SystemModelError("continuation: grazing_step must not be below min_step")
        if self.max_angle >= 1.5:
            raise SystemModelError(
                f"continuation: max_angle must lie below 1.5, got {self.max_angle:g}"
            )
        check_whole("continuation: max_points", self.max_points, 2, MOST_POINTS)


@dataclass(frozen=True, eq=False)
class Stride:
    """Where a walk is, and its step control there: all that the next points depend on.

    Parameters
    ----------
    here : BranchPoint
        The last point.
    step : float
        Arclength of the next step.
    behind : (2, N + 1)
        Shooting unknowns and tangent of the point before; no rows at the start.
    count : int
        Steps made.
    """

    here: BranchPoint
    step: float
    behind: Real
    count: int


class Rows:
    """A growing array: what was given out of it keeps its length and shares its memory.

    Parameters
    ----------
    width : int
        Of each row.
    """

    def __init__(self, width: int) -> None:
        self._rows = np.empty((16, width))
        self._count = 0

    def add(self, row: Real) -> None:
        """Append a row (width,)."""
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self._count] = row
        self._count += 1

    def so_far(self) -> Real:
        """All rows, (m, width)."""
        return self._rows[: self._count]


@dataclass
class Walk:
    """Iterator over the points of a branch in one direction.

    Yields `BranchPoint`s; when it ends, `stop_reason` says why. The caller may stop between any
    two points; asked for points again, the walk goes on where it was.

    Parameters
    ----------
    start : BranchPoint
        First point, yielded first; its tangent gives the direction.
    range_hz : (float, float)
        Frequencies between which to stay.
    options : ContinuationOptions
        Step control.
    open_ends : (m, N + 1) array, optional
        Where other branches were broken off: the walk stops at the first of these that it passes.
    stride : Stride, optional
        Where to go on, if not at the start.
    visited : list of BranchPoint
        The points so far.
    """

    start: BranchPoint
    range_hz: tuple[float, float]
    options: ContinuationOptions
    open_ends: Real | None = None
    stop_reason: str = NOT_FINISHED
    stride: Stride | None = None
    visited: list[BranchPoint] = field(default_factory=list, repr=False)
    _places: Rows | None = field(default=None, init=False, repr=False)  # unknowns of these
    _obstacle: str = field(default="", init=False, repr=False)
    _depth_row: tuple[BranchPoint, Real | None] | None = field(default=None, init=False, repr=False)
    _met: float = field(default=0.0, init=False, repr=False)  # last step too long to meet a flip

    def __post_init__(self) -> None:
        check_types(start=(self.start, BranchPoint), options=(self.options, ContinuationOptions))

    def __iter__(self) -> Iterator[BranchPoint]:
        """Walk along the branch."""
        problem = self.start.orbit.problem
        if self.stride is None:
            behind = np.empty((0, self.start.tangent.size))
            self.stride = Stride(self.start, self.options.first_step, behind, 0)
            yield self.start
        while self.stride.count < self.options.max_points:
            here, step, behind = self.stride.here, self.stride.step, self.stride.behind
            attempt = self._shortened(problem, behind, here, step)
            if attempt is None:
                self.stop_reason = f"{SHORT_STEP}{self.options.min_step:g}: {self._obstacle}"
                return
            step, point, angle, miss = attempt
            low, high = self.range_hz
            if not low <= point.orbit.frequency_hz <= high:
                end = self._range_end(here, point, low if point.orbit.frequency_hz < low else high)
                self.stop_reason = RANGE_END
                if end is not None:
                    yield end
                return
            if passed_flip(here.orbit, point.orbit):
                half = f"the branch of period {problem.period // 2}"
                try:
                    end = _flip_between(here, point)
                except ConvergenceError:
                    self.stop_reason = (
                        f"meets {half} beyond {here.orbit.frequency_hz:.6g} Hz, where no orbit of "
                        "that period was found"
                    )
                    return
                self.stop_reason = f"{JOINS} {half} at the flip at {end.orbit.frequency_hz:.6g} Hz"
                yield end
                return
            if self.closes(here, point):
                self.stop_reason = CLOSED
                yield point
                return
            if self.stride.count % LOOKS_BACK == 0 and self._comes_back(here, point):
                self.stop_reason = f"{COMES_BACK} at {here.orbit.frequency_hz:.6g} Hz: {TOO_NEAR}"
                return
            if self.open_ends is not None and _passed(here, point, self.open_ends).any():
                self.stop_reason = MEETS_OPEN_END
                yield point
                return
            bent = step <= KINK and point.orbit.impacts != here.orbit.impacts
            growth = 0.7 * self.options.max_angle / max(angle, 1e-3)
            growth = min(growth, math.sqrt(0.5 * self.options.max_miss / max(miss, 1e-6)))
            step = min(step * min(max(growth, 0.5), 1.6), self.options.max_step)
            behind = np.array([] if bent else [here.orbit.point, here.tangent])
            behind = behind.reshape(-1, here.tangent.size)
            self.stride = Stride(point, step, behind, self.stride.count + 1)
            self.visited.append(point)
            yield point
        self.stop_reason = f"{self.options.max_points}{POINTS}"

    def _shortened(
        self, problem: ShootingProblem, behind: Real, here: BranchPoint, step: float
    ) -> tuple[float, BranchPoint, float, float] | None:
        """The longest step up to `step` that leads to a next point, with what `_advance` gives."""
        while True:
            attempt = self._advance(problem, behind, here, step)
            if attempt is None and step <= KINK:
                attempt = self._across_touch(problem, here, step)
            if attempt is None and step <= MEETING_STEP and self._met == 2.0 * step:
                step, self._met = self._met, 0.0  # shorter, it ends too near to the flip
                attempt = self._advance(problem, behind, here, step, step)
            if attempt is not None:
                return step, *attempt
            step *= 0.5
            if step < self.options.min_step:
                break
        attempt = self._past_crossing(here)
        return None if attempt is None else (attempt[0].arclength - here.arclength, *attempt)

    def _advance(
        self,
        problem: ShootingProblem,
        behind: Real,
        here: BranchPoint,
        step: float,
        crossing: float = 0.0,
    ) -> tuple[BranchPoint, float, float] | None:
        """Next point, its angle to this one and its relative distance from the predictor.

        None when the step must be shorter, as it must be to cross another branch or to meet it:
        up to `SHORTEST_CROSSING` or `MEETING_STEP`, or `crossing` if that is longer.
        """
        weights = problem.metric(here.orbit.point)
        direction = here.tangent / metric_length(weights, here.tangent)
        straight = here.orbit.point + step * direction
        row = weights * direction
        row /= math.sqrt(float(row @ row))
        predicted = _extrapolate(weights, behind, here, step) if behind.size else straight
        found = problem.correct(
            predicted,
            row,
            offset=float(row @ straight),
            longest=2.0 * (self.options.max_miss if step > KINK else 1.0) * step,
            max_iterations=8,
        )
        if not found.converged:
            self._obstacle = found.failure
            if found.last_step < math.inf:
                self._obstacle += f", last relative step {found.last_step:.1e}"
            return None
        self._obstacle = "what Newton's method finds is not the next point of the branch"
        if _jumped(problem, here.orbit.point, straight, found.point):
            return None
        miss = metric_length(weights, found.point - predicted) / step
        if step <= KINK and miss < 1.0:  # a linear stop that is touched bends the branch
            orbit = Orbit.of(problem, found, here.orbit.observe)
            if orbit.impacts != here.orbit.impacts:
                tangent = problem.tangent(found, direction)
                return BranchPoint(orbit, tangent, here.arclength + step), 0.0, 0.0
        if miss > self.options.max_miss:
            return None
        # a curve that turns by max_angle leaves its tangent by half of that: a longer correction
        # has landed on another branch
        off = metric_length(weights, found.point - straight)
        if off > 0.75 * self.options.max_angle * step:
            return None
        tangent = problem.tangent(found, direction)
        cosine = float(direction @ (weights * tangent)) / metric_length(weights, tangent)
        angle = math.acos(min(max(cosine, -1.0), 1.0))
        if angle > self.options.max_angle:
            return None
        orbit = Orbit.of(problem, found, here.orbit.observe)
        # behind a grazing point the branch may turn on a very short length
        if step > self.options.grazing_step and orbit.impacts != here.orbit.impacts:
            return None
        meets = passed_flip(here.orbit, orbit)
        if meets and step > max(MEETING_STEP, crossing):
            self._met = step
            return None
        point = BranchPoint(orbit, tangent, here.arclength + step)
        if not meets and crosses(here, point) and (
            step > max(crossing, SHORTEST_CROSSING) or not is_crossing(orbit)
        ):
            return None
        if lies_on_crossing(orbit, min(0.1 * step, ON_CROSSING)):
            return None
        return point, angle, miss

    def _across_touch(
        self, problem: ShootingProblem, here: BranchPoint, step: float
    ) -> tuple[BranchPoint, float, float] | None:
        """Next point on the other side of a grazing point, as `_advance` gives it, or None.

        A stiff stop may bend the branch by more than a right angle within 1e-8, back from every
        plane across its tangent. The depth of the touch rises or falls all the way, and where it is
        held the stop's force hardly depends on the orbit.
        """
        if self._depth_row is None or self._depth_row[0] is not here:
            self._depth_row = here, depth_row(here.orbit)
        row = self._depth_row[1]
        if row is None:
            return None
        weights = problem.metric(here.orbit.point)
        guess = here.orbit.point + step * here.tangent / metric_length(weights, here.tangent)
        found = problem.correct(guess, row, longest=2.0 * KINK, max_iterations=8)
        if not found.converged or _jumped(problem, here.orbit.point, guess, found.point):
            return None
        orbit = Orbit.of(problem, found, here.orbit.observe)
        length = metric_length(weights, found.point - here.orbit.point)
        if length > KINK or orbit.impacts == here.orbit.impacts:
            return None
        tangent = problem.tangent(found, here.tangent)
        if float(row @ tangent) * float(row @ here.tangent) < 0.0:
            tangent = -tangent
        return BranchPoint(orbit, tangent, here.arclength + length), 0.0, 0.0

    def _past_crossing(self, here: BranchPoint) -> tuple[BranchPoint, float, float] | None:
        """Next point from one beside which branches cross, or None.

        Its tangent is some mixture of theirs, and the next orbits may be so ill conditioned that
        Newton's method does not find them: the way to here tells where longer steps lead, or, if
        that is too short, the way between here and the crossing.
        """
        problem, obstacle = here.orbit.problem, self._obstacle
        if self.options.min_step > SHORTEST_CROSSING:
            return None
        weights = problem.metric(here.orbit.point)
        beside = _way_of_crossing(here)
        for factor in LONGER_CROSSINGS:
            length = factor * SHORTEST_CROSSING
            ways = (here.orbit.point - point.orbit.point for point in reversed(self.visited))
            far = (way for way in ways if metric_length(weights, way) > 3.0 * length)
            way = next(far, beside)
            if way is None:
                break
            led = BranchPoint(here.orbit, way, here.arclength)
            attempt = self._advance(problem, np.empty((0, way.size)), led, length, length)
            if attempt is not None:
                return attempt
        self._obstacle = obstacle
        return None

    def _range_end(self, a: BranchPoint, b: BranchPoint, end_hz: float) -> BranchPoint | None:
        """Point of the branch exactly at an end of the range."""
        p = math.log(2.0 * math.pi * end_hz)
        pa, pb = a.orbit.point[-1], b.orbit.point[-1]
        if pa == p:
            return None
        share = (p - pa) / (pb - pa)
        problem = a.orbit.problem
        guess = (1.0 - share) * a.orbit.point + share * b.orbit.point
        row = np.zeros(guess.size)
        row[-1] = 1.0
        guess[-1] = p
        found = problem.correct(guess, row)
        if not found.converged:
            return None
        orbit = Orbit.of(problem, found, a.orbit.observe)
        tangent = problem.tangent(found, a.tangent)
        length = a.arclength + share * (b.arclength - a.arclength)
        return BranchPoint(orbit, tangent, length)

    def closes(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether the walk from a to b passes the start again, in the same direction.

        The orbit may have come back shifted by some of its excitation periods.
        """
        start = self.start
        if b.arclength - start.arclength < 3.0 * (b.arclength - a.arclength):
            return False
        places, tangents = self._shifts
        step = start.orbit.problem.metric(start.orbit.point) * (b.orbit.point - a.orbit.point)
        return bool((_passed(a, b, places) & (tangents @ step > 0.0)).any())

    def _comes_back(self, a: BranchPoint, b: BranchPoint) -> bool:
        """Whether the walk from a to b passes a point that it has passed before, not the start.

        It can, in the same direction, only where it has left its branch for another one on the way.
        """
        if self._places is None:
            self._places = Rows(a.orbit.point.size)
        for point in self.visited[len(self._places.so_far()) :]:
            self._places.add(point.orbit.point)
        passed = _passed(a, b, self._places.so_far()[:-RECENT])
        if not passed.any():
            return False
        problem = a.orbit.problem
        weights, step = problem.metric(a.orbit.point), b.orbit.point - a.orbit.point
        length2 = float(step @ (weights * step))
        for index in np.flatnonzero(passed):
            place, tangent = self.visited[index].orbit.point, self.visited[index].tangent
            if tangent @ (weights * step) <= 0.0:
                continue
            row = weights * tangent / np.linalg.norm(weights * tangent)
            share = float((place - a.orbit.point) @ (weights * step)) / length2
            guess = a.orbit.point + share * step
            found = problem.correct(guess, row, offset=float(row @ place))
            if found.converged and metric_length(weights, found.point - place) < SAME_PLACE:
                return True
        return False

    @cached_property
    def _shifts(self) -> tuple[Real, Real]:
        """Shooting unknowns and tangents of the start shifted by its excitation periods."""
        problem = self.start.orbit.problem
        return (
            np.array(shifts(problem, self.start.orbit.point)),
            np.array(shifts(problem, self.start.tangent)),
        )


def _way_of_crossing(here: BranchPoint) -> Real | None:
    """Difference of a point and one where branches cross beside it, ahead along its branch."""
    crossing = crossing_beside(here.orbit)
    if crossing is None:
        return None
    weights, way = here.orbit.problem.metric(here.orbit.point), crossing.point - here.orbit.point
    if metric_length(weights, way) < ON_CROSSING:
        return None
    return way if float(way @ (weights * here.tangent)) > 0.0 else -way


def shifts(problem: ShootingProblem, point: Real) -> list[Real]:
    """Shooting unknowns (N + 1,) of an orbit shifted by each of its excitation periods."""
    nodes = problem.nodes(point)
    moves = range(0, problem.segments, problem.segments // problem.period)
    return [np.append(np.roll(nodes, move, axis=0).ravel(), point[-1]) for move in moves]


def _passed(a: BranchPoint, b: BranchPoint, places: Real) -> NDArray[np.bool_]:
    """Which places (m, N + 1) lie beside the step from a to b, nearer than 0.1 of its length."""
    start, step = a.orbit.point, b.orbit.point - a.orbit.point
    weights = a.orbit.problem.metric(start)
    length2 = float(step @ (weights * step))
    passed = np.zeros(len(places), dtype=bool)
    near = np.abs(places[:, -1] - start[-1]) <= 1.1 * math.sqrt(length2)  # few are
    if near.any():
        way = places[near] - start
        along = way @ (weights * step)
        off = way - np.outer(along / length2, step)
        inside = (along >= 0.0) & (along <= length2)
        passed[near] = inside & ((off * off) @ weights < 0.01 * length2)
    return passed


def open_ends(branch: Branch) -> list[Real]:
    """Shooting unknowns where a branch was broken off, shifted by all its excitation periods."""
    ends = [end.orbit for end, _ in broken_off(branch)]
    return [place for orbit in ends for place in shifts(orbit.problem, orbit.point)]


def alike(orbit: Orbit, places: Sequence[Real]) -> Real:
    """Those of some shooting unknowns that are as many as an orbit's, (m, N + 1)."""
    size = orbit.point.size
    return np.array([place for place in places if place.size == size]).reshape(-1, size)


def broken_off(branch: Branch) -> list[tuple[BranchPoint, str]]:
    """The ends at which a branch was broken off, and why."""
    ends = zip((branch.nodes[0], branch.nodes[-1]), branch.stop_reasons, strict=True)
    return [(end, why) for end, why in ends if why.endswith(POINTS) or why.startswith(SHORT_STEP)]


def _extrapolate(weights: Real, behind: Real, here: BranchPoint, step: float) -> Real:
    """Point at a distance along the tangent on the cubic through two points and their tangents."""
    (a, tangent), b = behind, here.orbit.point
    direction = here.tangent / metric_length(weights, here.tangent)
    row = weights * direction
    back = float(row @ (a - b))
    slope_a, slope_b = tangent / float(row @ tangent), direction
    x = step / back  # 0 here, 1 behind
    return np.asarray(
        (1.0 + 2.0 * x) * (1.0 - x) ** 2 * b
        + x * (1.0 - x) ** 2 * back * slope_b
        + x * x * (3.0 - 2.0 * x) * a
        + x * x * (x - 1.0) * back * slope_a
    )


def passed_flip(a: Orbit, b: Orbit) -> bool:
    """Whether an even-period orbit turned into its own shift: a branch of half the period met.

    At the flip the two halves of the orbit are equal; behind it they have changed places.
    """
    if a.period % 2:
        return False
    first = _half_difference(a.problem, a.point)
    second = _half_difference(b.problem, b.point)
    product = float(first @ second)
    return product < -0.8 * float(np.linalg.norm(first) * np.linalg.norm(second))


def _flip_between(a: BranchPoint, b: BranchPoint) -> BranchPoint:
    """The orbit of half the period near the flip between a and b, run through twice.

    The shooting equations of the doubled branch are singular at the flip, so the point where the
    halves agree is interpolated and solved as an orbit of half the period; from there Newton's
    method goes to the flip, unless it fails.

    Raises
    ------
    ConvergenceError
        If Newton's method finds no such orbit.
    """
    chord = Chord(a, b)
    problem = a.orbit.problem
    reference = _half_difference(problem, a.orbit.point)

    def difference(sigma: float) -> float:
        return float(reference @ _half_difference(problem, chord.between(sigma)))

    sigma = float(brentq(difference, 0.0, 1.0))
    point = chord.between(sigma)
    nodes = problem.nodes(point)
    half = nodes.shape[0] // 2
    single = ShootingProblem(problem.flow, problem.period // 2, half)
    mean = 0.5 * (nodes[:half] + nodes[half:])
    orbit = refine(single, mean, float(np.exp(point[-1])), a.orbit.observe)
    orbit = nearest_flip(orbit) or orbit
    states = np.tile(single.nodes(orbit.point), (2, 1)).ravel()
    doubled = Orbit(
        problem,
        np.append(states, orbit.point[-1]),
        np.concatenate([orbit.jacobians, orbit.jacobians]),
        orbit.error,
        orbit.observe,
    )
    return BranchPoint(doubled, a.tangent, a.arclength + sigma * (b.arclength - a.arclength))


def _half_difference(problem: ShootingProblem, point: Real) -> Real:
    """First half of the states minus the second: zero for an orbit of half the period."""
    nodes = problem.nodes(point)
    half = nodes.shape[0] // 2
    return (nodes[:half] - nodes[half:]).ravel()


def _jumped(problem: ShootingProblem, here: Real, guess: Real, there: Real) -> bool:
    """Whether a step has landed on an orbit shifted by some excitation periods, or on half of one.

    Where it is shifted, some other shift of it lies nearer to where the step began. Only through a
    flip the halves change places steadily, as the tangent foretells; not in a jump. Nor does a
    doubled branch go on along the one that it comes from, nor one of broken symmetry along the
    symmetric one.
    """
    broken = asymmetry(problem, here)
    if broken > BROKEN and asymmetry(problem, there) < EQUAL_HALVES * broken:
        return True
    apart, *others = (float(np.linalg.norm((p - here)[:-1])) for p in shifts(problem, there))
    if problem.period % 2 == 0:  # half its period: a flip, below
        del others[problem.period // 2 - 1]
    if any(other < apart for other in others):
        return True
    if problem.period % 2:
        return False
    a, g, b = (_half_difference(problem, point) for point in (here, guess, there))
    before, after = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if after < EQUAL_HALVES * before:  # on the branch of half the period
        return True
    return float(a @ b) < 0.0 and float(np.linalg.norm(b - g)) > 0.5 * max(before, after)


def start_point(orbit: Orbit, direction: float) -> BranchPoint:
    """Branch point at an orbit, heading up (+1) or down (-1) in frequency.

    Beside a flip or a fold, where the frequency hardly tells the orbits of a branch apart, the
    orbit is met again on the plane across the branch. From a fold it is a short way to the point:
    at the fold itself rounding decides on which side of it the orbit is.

    Raises
    ------
    ConvergenceError
        If Newton's method does not meet the orbit again, or branches cross so near to it that it
        may be of either.
    """
    if lies_on_crossing(orbit, ON_CROSSING):
        raise ConvergenceError(
            f"branches cross at the orbit at {orbit.frequency_hz:g} Hz: begin farther from there, "
            "or with one of switch_at_branch_point"
        )
    problem = orbit.problem
    towards = np.zeros(orbit.point.size)
    towards[-1] = direction
    found = problem.correct(orbit.point, towards)
    if not found.converged and np.isfinite(found.along).all() and found.along.any():
        across = problem.metric(orbit.point) * problem.tangent(found, towards)
        found = problem.correct(orbit.point, across, longest=MET_AGAIN)
    if not found.converged:
        raise ConvergenceError(f"no orbit at {orbit.frequency_hz:g} Hz: {found.failure}")
    tangent = problem.tangent(found, towards)
    if abs(float(tangent[-1])) < FLAT:
        across = problem.metric(orbit.point) * tangent
        beside = problem.correct(orbit.point + FROM_FOLD * tangent, across)
        if beside.converged:
            moved = Orbit.of(problem, beside, orbit.observe)
            return BranchPoint(moved, problem.tangent(beside, tangent), 0.0)
    return BranchPoint(orbit, tangent, 0.0)


def trace(
    start: BranchPoint,
    range_hz: tuple[float, float],
    options: ContinuationOptions | None = None,
    progress: Callable[[float], None] | None = None,
) -> tuple[list[BranchPoint], list[SpecialPoint], str, list[str]]:
    """Walk from a point in the direction of its tangent and collect special points.

    Returns the points, the special points, why the walk stopped, and notes on what may be missing.
    """
    trail = Trail(Walk(start, range_hz, options or ContinuationOptions()))
    leg = trail.follow(progress)
    return leg.nodes, leg.special_points, leg.reason, leg.notes


@dataclass(frozen=True, eq=False)
class Leg:
    """What a walk in one direction has found, in its own order.

    Parameters
    ----------
    nodes, special_points, notes : list
        As in `Branch`.
    reason : str
        Why the walk stopped.
    end : WalkEnd, optional
        How it would go on.
    """

    nodes: list[BranchPoint]
    special_points: list[SpecialPoint]
    notes: list[str]
    reason: str
    end: WalkEnd | None


@dataclass
class Trail:
    """A walk with what is found on the way.

    Special points of a pair of neighbouring points are located as soon as the next point is known,
    since that may put another point between them.

    Parameters
    ----------
    walk : Walk
        The walk.
    nodes, special_points, notes : list
        What was found before, if the walk goes on; of the pairs of nodes all but the last have
        been searched.
    """

    walk: Walk
    nodes: list[BranchPoint] = field(default_factory=list)
    special_points: list[SpecialPoint] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._searched = max(len(self.nodes) - 2, 0)
        self._mark = self._here() if self.nodes else None

    @classmethod
    def going_on(
        cls,
        leg: Leg,
        range_hz: tuple[float, float],
        options: ContinuationOptions,
        open_ends: Real,
    ) -> Trail:
        """The same walk with another end of its range or other options."""
        walk = Walk(leg.nodes[0], range_hz, options, open_ends)
        end = leg.end
        if end is None:
            return cls(walk)
        here = leg.nodes[end.node]
        walk.stride = Stride(here, end.step, end.behind, end.count)
        walk.visited = list(leg.nodes[: end.kept])
        return cls(
            walk,
            [*leg.nodes[: end.kept], here],
            leg.special_points[: end.special_points],
            leg.notes[: end.notes],
        )

    def follow(
        self,
        progress: Callable[[float], None] | None = None,
        keep: Callable[[], None] | None = None,
    ) -> Leg:
        """Walk to the end.

        Parameters
        ----------
        progress : callable, optional
            Called with the frequency of every point.
        keep : callable, optional
            Called after every point, when `so_far` tells of it.
        """
        for point in self.walk:
            self.nodes.append(point)
            if progress is not None:
                progress(point.orbit.frequency_hz)
            if len(self.nodes) > 2:
                insert_dip(self.nodes, len(self.nodes) - 2)
            regular = self.walk.stride is not None and self.walk.stride.here is point
            self._search(len(self.nodes) - 2, closely=regular)
            if regular:
                self._mark = self._here()
                if keep is not None:
                    keep()
        self._search(len(self.nodes) - 1, closely=False)
        if self.walk.stop_reason.startswith(COMES_BACK):
            self.notes.append(self.walk.stop_reason)
        special = self.special_points
        if self.walk.stop_reason.startswith(JOINS):
            special = [s for s in special if not self._is_flip_at_end(s)]
        elif self.walk.stop_reason == CLOSED:  # the last step leads beyond the start
            special = [s for s in special if not self._is_repeated(s.point)]
            last = self.nodes.pop()  # a dip may have put others there
            self.nodes = [*(p for p in self.nodes if not self._is_repeated(p)), last]
        end = self._end(next(i for i, p in enumerate(self.nodes) if p is self._stride.here))
        return Leg(self.nodes, special, self.notes, self.walk.stop_reason, end)

    def so_far(self) -> Leg | None:
        """What was found up to the last complete point; None before the first."""
        if self._mark is None:
            return None
        kept, special, notes, stride = self._mark
        return Leg(
            [*self.nodes[:kept], stride.here],
            self.special_points[:special],
            self.notes[:notes],
            NOT_FINISHED,
            self._end(kept),
        )

    def _is_flip_at_end(self, special: SpecialPoint) -> bool:
        """Whether a turn of a doubled branch is where it joins the one that it comes from."""
        if special.kind not in ("BP", "LP"):
            return False
        if distance(self.nodes[-1].orbit, special.orbit) > AT_FLIP:
            return False
        after = bisect(self.nodes, special.point.arclength, key=attrgetter("arclength"))
        beside = self.nodes[max(after - 1, 0) : after + 1]
        return special.kind == "BP" or min(abs(float(p.tangent[-1])) for p in beside) < FLAT

    def _is_repeated(self, point: BranchPoint) -> bool:
        """Whether a point of a closed branch lies where the walk has begun again."""
        here = self._stride.here
        return point.arclength > here.arclength and self.walk.closes(here, point)

    @property
    def _stride(self) -> Stride:
        assert self.walk.stride is not None
        return self.walk.stride

    def _here(self) -> tuple[int, int, int, Stride]:
        """How much will stay as it is, whatever follows."""
        return len(self.nodes) - 1, len(self.special_points), len(self.notes), self._stride

    def _end(self, node: int) -> WalkEnd | None:
        if self._mark is None:
            return None
        kept, special, notes, stride = self._mark
        return WalkEnd(stride.step, stride.behind, stride.count, node, kept, special, notes)

    def _walk_closely(self) -> bool:
        """Put the points of a walk with shorter steps into the step searched, if it led on.

        A narrow resonance may lie within one step: the branch leaves at its foot and comes back
        beside it. What lies behind is moved by the length of the detour.
        """
        a, b = self.nodes[self._searched : self._searched + 2]
        between = _detour(a, b, self.walk)
        if between is None:
            return False
        last = between[-1]
        weights = last.orbit.problem.metric(last.orbit.point)
        end = last.arclength + metric_length(weights, b.orbit.point - last.orbit.point)
        behind = self.nodes[self._searched + 1 :]
        moved = [replace(p, arclength=p.arclength + (end - b.arclength)) for p in behind]
        self.nodes[self._searched + 1 :] = [*between, *moved]
        self.walk.stride = replace(self._stride, here=moved[-1])
        return True

    def _search(self, pairs: int, closely: bool = True) -> None:
        """Locate the special points of the first pairs of nodes, as far as that is not done.

        Where that fails, the step is walked again with shorter ones; not at the end of the walk,
        whose last steps a longer one does anew.
        """
        known = len(self.special_points)
        ahead = len(self.nodes) - pairs  # nodes that stay beyond those searched
        while self._searched < len(self.nodes) - ahead:
            a, b = self.nodes[self._searched : self._searched + 2]
            before = self.nodes[self._searched - 1] if self._searched else None
            after = next(iter(self.nodes[self._searched + 2 :]), None)
            try:
                self.special_points += special_points_between(a, b, before, after)
            except (LocateError, ConvergenceError) as error:
                if closely and self._walk_closely():
                    continue
                found, lost = _by_halves(a, b, error)
                self.special_points += found
                self.notes += lost
            self._searched += 1
        if len(self.special_points) > known:
            self.special_points = without_repeats(self.special_points)


def _detour(a: BranchPoint, b: BranchPoint, walk: Walk) -> list[BranchPoint] | None:
    """Points of a walk with shorter steps from a that passes b in its direction, or None."""
    first_step = (b.arclength - a.arclength) / 64.0
    if first_step < max(SHORTEST_DETOUR, walk.options.min_step):
        return None
    options = replace(
        walk.options, first_step=first_step, max_step=8.0 * first_step, max_points=MOST_DETOUR
    )
    inner = Walk(a, walk.range_hz, options, b.orbit.point[None])
    between = list(inner)[1:-1]
    if inner.stop_reason != MEETS_OPEN_END or not between:
        return None
    last = between[-1]
    weights = last.orbit.problem.metric(last.orbit.point)
    ahead = float((b.orbit.point - last.orbit.point) @ (weights * b.tangent))
    return between if ahead > 0.0 else None


def _by_halves(
    a: BranchPoint, b: BranchPoint, reason: Exception, depth: int = 0
) -> tuple[list[SpecialPoint], list[str]]:
    """Special points of a chord on which a correction failed: try again on its halves.

    With notes on the pieces where it failed again.
    """
    try:
        if depth > 3:
            raise reason
        middle = Chord(a, b).at(0.5)
    except (LocateError, ConvergenceError) as error:
        hz = sorted(point.orbit.frequency_hz for point in (a, b))
        return [], [
            f"special points between {hz[0]:.8g} and {hz[1]:.8g} Hz may be missing: {error}"
        ]
    found: list[SpecialPoint] = []
    notes: list[str] = []
    for first, last in ((a, middle), (middle, b)):
        try:
            found += special_points_between(first, last)
        except (LocateError, ConvergenceError) as error:
            more, lost = _by_halves(first, last, error, depth + 1)
            found += more
            notes += lost
    return found, notes


def continue_branch(
    orbit: Orbit,
    range_hz: tuple[float, float],
    *,
    name: str = "",
    options: ContinuationOptions | None = None,
    progress: Callable[[float], None] | None = None,
    open_ends: Sequence[Real] = (),
    at: Sequence[float] = (),
    checkpoint: str | Path | Checkpoint | None = None,
) -> Branch:
    """Continue an orbit in both directions through a range of frequencies.

    Parameters
    ----------
    orbit : Orbit
        Where to start; its frequency must lie in the range. From a fold the first point is 1e-4 of
        arclength away.
    range_hz : (float, float)
        Frequencies in Hz, ascending. The ends are met exactly.
    name : str
        Name of the branch.
    options : ContinuationOptions, optional
        Step control.
    progress : callable, optional
        Called with the frequency of every point.
    open_ends : sequence of (N + 1,) arrays
        Where other branches were broken off, see `Walk`.
    at : sequence of float
        Frequencies in Hz at which orbits are wanted: `Branch.requested` has all of them, at each
        passage of the branch.
    checkpoint : str or Path, optional
        File that keeps what is computed, written now and then, at the end, and when an exception
        such as Ctrl-C ends the computation. If it holds this very continuation, that one goes on
        and gives the points of an uninterrupted one.

    Returns
    -------
    Branch

    Raises
    ------
    SystemModelError
        If the range is empty, the orbit or a requested frequency lies outside, or `checkpoint`
        holds something else.
    OutputError
        If `checkpoint` cannot be written.
    ConvergenceError
        If Newton's method does not meet the orbit again at its own frequency, or branches cross
        there.

    References
    ----------
    H. B. Keller (1977), pseudo-arclength continuation; E. Doedel et al., AUTO-07p manual.
    """
    check_types(
        orbit=(orbit, Orbit),
        name=(name, str),
        options=(options, ContinuationOptions, None),
        progress=(progress, Callable, None),
        open_ends=(open_ends, Sequence),
    )
    check_minimal(orbit)
    low, high = check_range(range_hz)
    if not low * (1.0 - 1e-9) <= orbit.frequency_hz <= high * (1.0 + 1e-9):
        raise SystemModelError(
            f"the orbit at {orbit.frequency_hz:g} Hz lies outside range_hz = ({low:g}, {high:g})"
        )
    course = Course(
        (low, high),
        options or ContinuationOptions(),
        alike(orbit, [numbers("open_ends", end) for end in open_ends]),
        check_requested(at, (low, high)),
    )
    start = start_point(orbit, 1.0)
    with checkpoint_at(checkpoint, orbit.system) as kept:
        known = kept.branch_from(start.orbit, course)
        if known is not None:
            return known.extend(at=at, progress=progress, checkpoint=kept)
        return complete(name, None, None, start, course, progress, kept)


@one_thread()
def complete(
    name: str,
    forward: Leg | None,
    backward: Leg | None,
    start: BranchPoint,
    course: Course,
    progress: Callable[[float], None] | None,
    checkpoint: Checkpoint,
) -> Branch:
    """Walk the legs of a branch that are missing or may go on, forward first, and join them.

    Parameters
    ----------
    name : str
        Name of the branch.
    forward, backward : Leg, optional
        What is known.
    start : BranchPoint
        Where both began, heading forward.
    course : Course
        Range, options and requested frequencies.
    progress : callable, optional
        Called with the frequency of every point.
    checkpoint : Checkpoint
        Keeps what is computed.
    """

    def walked(
        leg: Leg | None, first: BranchPoint, whole: Callable[[Leg | None], Branch | None]
    ) -> Leg:
        if leg is not None and not goes_on(leg, course):
            return leg
        leg = leg or Leg([first], [], [], NOT_FINISHED, None)
        trail = Trail.going_on(leg, course.range_hz, course.options, course.open_ends)

        checkpoint.work = lambda: whole(trail.so_far())
        return trail.follow(progress, checkpoint.offer)

    forward = walked(forward, start, lambda leg: join(name, leg, backward, course) if leg else None)
    if forward.reason == CLOSED:
        backward = None
    else:
        done = forward
        backward = walked(backward, _reversed(start), lambda leg: join(name, done, leg, course))
    branch = join(name, forward, backward, course)
    points, lost = requested(branch)
    lost = [note for note in lost if note not in branch.notes]
    branch = replace(branch, requested=tuple(points), notes=(*branch.notes, *lost))
    checkpoint.work = lambda: branch
    checkpoint.offer()
    return branch


def goes_on(leg: Leg, course: Course) -> bool:
    """Whether a walk would go on with the range and the options of a course."""
    end, options = leg.end, course.options
    if leg.reason == NOT_FINISHED:
        return True
    if end is None:
        return False
    if leg.reason == RANGE_END:
        low, high = course.range_hz
        return low * (1.0 + 1e-9) < leg.nodes[-1].orbit.frequency_hz < high * (1.0 - 1e-9)
    if leg.reason.endswith(POINTS):
        return options.max_points > end.count
    shortest = leg.reason.partition(":")[0]
    return shortest != f"{SHORT_STEP}{options.min_step:g}" and leg.reason.startswith(SHORT_STEP)


def join(name: str, forward: Leg, backward: Leg | None, course: Course) -> Branch:
    """Branch of two legs from one start."""
    if backward is None:
        first = CLOSED if forward.reason == CLOSED else NOT_FINISHED
        backward = Leg([forward.nodes[0]], [], [], first, None)
    branch = make_branch(
        name,
        [_reversed(point) for point in backward.nodes[:0:-1]] + forward.nodes,
        [_reversed_special(s) for s in reversed(backward.special_points)] + forward.special_points,
        (backward.reason, forward.reason),
        backward.notes + forward.notes,
    )
    whole = replace(
        course,
        start=len(backward.nodes) - 1,
        special_points_before=len(backward.special_points),
        notes_before=len(backward.notes),
        ends=(backward.end, forward.end),
    )
    return replace(branch, course=whole)


def split(branch: Branch, course: Course) -> tuple[Leg, Leg | None]:
    """The legs of which a branch was joined: forward and, if it was begun, backward."""
    nodes, special, notes = branch.nodes, branch.special_points, branch.notes
    start, specials, lines = course.start, course.special_points_before, course.notes_before
    first, last = branch.stop_reasons
    forward = Leg(
        list(nodes[start:]), list(special[specials:]), list(notes[lines:]), last, course.ends[1]
    )
    if course.ends[0] is None:
        return forward, None
    backward = Leg(
        [_reversed(point) for point in nodes[start::-1]],
        [_reversed_special(s) for s in reversed(special[:specials])],
        list(notes[:lines]),
        first,
        course.ends[0],
    )
    return forward, backward


def make_branch(
    name: str,
    nodes: list[BranchPoint],
    special: list[SpecialPoint],
    reasons: tuple[str, str],
    notes: list[str],
) -> Branch:
    """Branch from its parts; the period is that of its orbits."""
    period = nodes[0].orbit.period
    return Branch(name, period, tuple(nodes), tuple(special), reasons, tuple(notes))


def check_range(range_hz: tuple[float, float]) -> tuple[float, float]:
    """A frequency range as two floats, or a SystemModelError that says what is wrong."""
    ends = numbers("range_hz", range_hz)
    if ends.shape != (2,):
        raise SystemModelError(f"range_hz must be two frequencies, got {shown(range_hz)}")
    low, high = ends.tolist()
    if not SMALLEST_FREQUENCY <= low < high <= LARGEST_FREQUENCY:
        raise SystemModelError(
            f"range_hz must be two positive frequencies, ascending, from {SMALLEST_FREQUENCY:g} "
            f"to {LARGEST_FREQUENCY:g}; got ({low:g}, {high:g})"
        )
    return low, high


def _reversed(point: BranchPoint) -> BranchPoint:
    return BranchPoint(point.orbit, -point.tangent, -point.arclength)


def _reversed_special(special: SpecialPoint) -> SpecialPoint:
    return SpecialPoint(special.kind, _reversed(special.point), special.frequency_error)


def switch_at_flip(special: SpecialPoint, amplitude: float = 0.02) -> BranchPoint:
    """First point of the doubled branch at a flip, heading away from it.

    Parameters
    ----------
    special : SpecialPoint
        A flip (PD).
    amplitude : float
        Relative size of the first step off the branch; smaller ones are tried until no contact has
        changed and the multiplier that was (-1)² at the flip is still near 1.

    Returns
    -------
    BranchPoint
        An orbit of twice the period.

    Raises
    ------
    SystemModelError
        If the special point is not a flip, or the amplitude not positive.
    LocateError
        If no orbit of twice the period is found.
    """
    check_special("switch_at_flip", special, "PD", of_branch=False)
    check_positive("amplitude", amplitude)
    orbit = special.orbit
    base = orbit.problem
    problem = ShootingProblem(base.flow, 2 * base.period, 2 * base.segments)
    values, vectors = np.linalg.eig(orbit.monodromy)
    v = vectors[:, int(np.argmin(np.abs(values + 1.0)))].real
    jacobians = base.flow.shoot(base.nodes(orbit.point), base.phases, orbit.omega).jacobians
    modes = [v]
    for jacobian in jacobians[:-1]:
        modes.append(jacobian @ modes[-1])
    shape = np.array(modes)
    direction = np.append(np.concatenate([shape, -shape]).ravel(), 0.0)
    nodes = base.nodes(orbit.point)
    doubled = np.append(np.concatenate([nodes, nodes]).ravel(), orbit.point[-1])
    weights = problem.metric(doubled)
    direction /= metric_length(weights, direction)
    row = weights * direction
    first: BranchPoint | None = None
    for share in (1.0, 0.25, 0.05, 0.01, 2e-3, 4e-4):
        size = share * amplitude
        found = problem.correct(doubled + size * direction, row / np.linalg.norm(row))
        if found.converged:
            twin = Orbit.of(problem, found, orbit.observe)
            if minimal_period(twin) < problem.period:
                continue
            first = BranchPoint(twin, problem.tangent(found, direction), 0.0)
            if twin.impacts == 2 * orbit.impacts and np.abs(twin.multipliers - 1.0).min() < 0.3:
                break
    if first is not None:
        return first
    raise LocateError(
        f"no orbit of period {problem.period} found beside the flip at "
        f"{orbit.frequency_hz:.6g} Hz: {found.failure or 'only such of a shorter period'}"
    )
