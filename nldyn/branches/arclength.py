"""The walk along a branch of periodic orbits in one direction, by pseudo-arclength."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import TINY, Real
from nldyn.base.errors import FAILURES, ConvergenceError, check_types
from nldyn.base.rows import Rows
from nldyn.bifurcations.beyond_rigid_grazing import DIFFERENCED, SLIGHTEST
from nldyn.bifurcations.branch_crossing import (
    ON_CROSSING,
    SHORTEST_CROSSING,
    crossing_beside,
    is_crossing,
    lies_on_crossing,
)
from nldyn.bifurcations.period_doubling import flip_between, half_difference, passed_flip
from nldyn.bifurcations.point import BranchNode, place_of
from nldyn.bifurcations.sign_changes import crosses
from nldyn.bifurcations.touching import rigid_grazing, rigid_touches
from nldyn.bifurcations.within_step import differs, passes_node
from nldyn.branches.endings import Ending, StopReason
from nldyn.branches.predictor import predicted
from nldyn.branches.step_control import ContinuationOptions
from nldyn.orbits.bordered import FREE, OrbitFamily, correct, length_unit
from nldyn.orbits.conditions import TOUCH, depth_row
from nldyn.orbits.impact_phases import (
    impact_behind_node,
    impacts_by_segment,
    start_far_from_impacts,
)
from nldyn.orbits.multipliers import EPS
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import (
    BROKEN,
    FROM_NEAR,
    asymmetry,
    metric_length,
    shifts,
)

KINK = TOUCH  # step below which a branch may bend by any angle where the number of contacts changes
BY_TOLERANCE = 1.0  # asymmetry over the tolerance of the flow map: its error (0.3 at most seen)
EQUAL_HALVES = 1e-3  # difference of an orbit's halves, over that of the orbit before
MEETING_STEP = 1e-4  # longest step over which a doubled branch may meet the one it comes from
LONGER_CROSSINGS = (1.0, 10.0, 100.0)  # steps from a crossing, over `SHORTEST_CROSSING`
FARTHEST_CROSSING = 1e-4  # distance of one from which a step may begin
GRAZES = 1e-4  # depth over size at which a walk that cannot go on is at a grazing of a rigid stop
NEAR_NODE = 1e-4  # rad from an impact to a phase of shooting, from which a short step may pass it
FARTHEST_NODE = 0.3  # rad, the same for a step of any length
FASTEST = 20.0  # rad by which an impact's phase changes at most, over the arclength
AT_NODE = 1e-7  # rad from an impact to a phase of shooting, which are too few
PAST_NODE = 1e-6, 1e-5, 1e-4, 1e-3  # short steps past it, in arclength
MOST_BEHIND = 4  # points behind the last one that tell where a branch goes on
LOOKS_BACK = 4  # steps between two looks whether a walk has been there before
RECENT = 10  # points behind a walk that it does not come back to
SAME_PLACE = 1e-8  # distance of points that are one, relative to the orbit
ROOM = 1.1  # times a bound: what is searched, where the bound itself is looked at later
FARTHEST_OFF = 0.75  # of the largest angle: how far, over the step, a point may lie off the tangent
NEAR_CROSSING = 0.1  # of the step: a crossing as near as this to its end is passed by another step
BESIDE_RESONANCE = 1e-6  # relative distance from one, where steps are lost in rounding
LOST_IN_ROUNDING = 1e-7  # of an orbit's size, which is far more than Newton's method leaves
SCALES = 1e-8  # relative departure from a proportional change that is rounding
BESIDE_STEP = 0.01  # squared distance from a step, over its own, of what it passes through


@dataclass(frozen=True, eq=False)
class StepperState:
    """Where a walk is, and its step control there: all that the next points depend on.

    Parameters
    ----------
    here : BranchNode
        The last point.
    step : float
        Arclength of the next step.
    behind : (2m, N + 1)
        Unknowns and tangent of the points before, the last one first; no rows at the
        start.
    count : int
        Steps made.
    """

    here: BranchNode
    step: float
    behind: Real
    count: int


def grazes_rigid(
    orbit: Orbit, least: float, most: float, but: Callable[[int, float], bool] | None = None
) -> bool:
    """Whether an impact with a rigid stop, or a near miss, is so deep.

    Both bounds are shares of the orbit's size; `but` is as for `rigid_grazing`.
    """
    unit, touches = length_unit(orbit), rigid_touches(orbit)
    slight = [each[:2] for each in touches if least < each[2] / unit < most]
    return bool(slight) and (but is None or not all(but(*each) for each in slight))


def loses_impact(orbit: Orbit) -> bool:
    """Whether the last step of Newton's method has lost or won a slight impact."""
    grazed = rigid_grazing(orbit)
    if grazed is None or abs(grazed[2]) > GRAZES * length_unit(orbit) or orbit.rests:
        return False
    problem = orbit.problem
    found = problem.flow.shoot(
        problem.nodes(orbit.point), problem.phases, orbit.omega, sensitivities=False
    )
    return bool(found.failure) or int(found.closings.sum()) != orbit.impacts


def grazing_between(a: Orbit, b: Orbit) -> bool:
    """Whether two neighbouring orbits without rest differ by impacts with rigid stops.

    Between them lies a grazing, where a branch has a corner, and may turn back.
    """
    if a.rests or b.rests:
        return False
    first, last = (sum(depth > 0.0 for *_, depth in rigid_touches(orbit)) for orbit in (a, b))
    return first != last


def rubs_all_around(orbit: Orbit) -> bool:
    """Whether a round clearance is closed all the time, which no impact tells.

    Where that begins, all of a circular whirl touches at once, and its branch has a corner.
    """
    if orbit.impacts or not orbit.system.round_stops:
        return False
    depth = orbit.trajectory.contacts_at_nodes[0]
    return bool(depth[:, list(orbit.system.round_stops)].any())


def _past_impact_at_node(
    here: BranchNode, steps: Sequence[float], near: float, max_angle: float
) -> tuple[BranchNode, float, float] | None:
    """Next point where the phase of an impact with a rigid stop passes one of shooting, or None.

    The state there jumps from that before the impact to that behind it, or back. So the step is
    made with the states at other phases, the first of `steps` that leads on by no more than an
    angle. The phase must be as near as told.
    """
    orbit, plain = here.orbit, here.family
    before = impact_behind_node(orbit)
    if abs(before) > near:
        return None
    family = plain.shot_from(start_far_from_impacts(orbit))
    by_parameter = np.zeros(here.point.size)
    by_parameter[-1] = math.copysign(1.0, here.tangent[-1])
    try:
        begin = family.unknowns(orbit)
        first = correct(family, begin, FREE, np.abs(by_parameter))
        if not first.converged:
            return None
        weights = family.metric(first.point)
        direction = _unit(first.along, weights, by_parameter)
        row = weights * direction
        row /= np.linalg.norm(row)
        for step in steps:
            straight = first.point + step * direction
            met = correct(family, straight, FREE, row)
            off = metric_length(weights, met.point - straight)
            if not met.converged or off > FARTHEST_OFF * max_angle * step:
                continue
            way = _unit(met.along, weights, weights * direction)
            angle = math.acos(min(max(float(direction @ (weights * way)), -1.0), 1.0))
            behind = impact_behind_node(met.orbit)
            stays = (impacts_by_segment(met.orbit) == impacts_by_segment(orbit)).all()
            if abs(behind) < AT_NODE or (stays and abs(before) > AT_NODE and before * behind > 0.0):
                continue
            by_parameter[-1] = math.copysign(1.0, way[-1])
            guess = plain.unknowns(met.orbit)
            guess[-1] = met.point[-1]
            found = correct(
                plain, guess, FREE, by_parameter, longest=NEAR_NODE, max_iterations=FROM_NEAR
            )
            if angle > max_angle or not found.converged:
                continue
            other = found.orbit
            if loses_impact(other) or grazing_between(orbit, other):
                continue
            there = BranchNode.of(found, found.tangent(by_parameter), here.arclength + step)
            if other.impacts == orbit.impacts and not differs(here, there):
                return there, angle, 0.0
    except FAILURES:
        pass
    return None


def _unit(vector: Real, weights: Real, towards: Real) -> Real:
    """A vector made as long as 1 in a metric, on the side of a row."""
    length = metric_length(weights, vector)
    return np.asarray(vector / (length if float(towards @ vector) >= 0.0 else -length))


@dataclass
class Stepper:
    """Iterator over the points of a branch in one direction.

    Yields `BranchNode`s; when it ends, `stop_reason` says why. The caller may stop between any
    two points; asked for points again, the walk goes on where it was.

    Parameters
    ----------
    start : BranchNode
        First point, yielded first; its tangent gives the direction.
    limits : (float, float)
        Values of the parameter between which to stay.
    options : ContinuationOptions
        Step control.
    open_ends : (m, N + 1) array, optional
        Where other branches were broken off: the walk stops at the first of these that it passes.
    stride : StepperState, optional
        Where to go on, if not at the start.
    visited : list of BranchNode
        The points so far.
    """

    start: BranchNode
    limits: tuple[float, float]
    options: ContinuationOptions
    open_ends: Real | None = None
    stop_reason: StopReason = field(default_factory=Ending.NOT_FINISHED.told)
    stride: StepperState | None = None
    visited: list[BranchNode] = field(default_factory=list, repr=False)
    _places: Rows | None = field(default=None, init=False, repr=False)  # unknowns of these
    _obstacle: str = field(default="", init=False, repr=False)
    _depth_row: tuple[BranchNode, Real | None] | None = field(default=None, init=False, repr=False)
    _last: list[BranchNode] | None = field(default=None, init=False, repr=False)
    _met: float = field(default=0.0, init=False, repr=False)  # last step too long to meet a flip

    def __post_init__(self) -> None:
        check_types(start=(self.start, BranchNode), options=(self.options, ContinuationOptions))

    def __iter__(self) -> Iterator[BranchNode]:
        """Walk along the branch."""
        if self.stride is None:
            behind = np.empty((0, self.start.tangent.size))
            self.stride = StepperState(self.start, self.options.first_step, behind, 0)
            yield self.start
        while self.stride.count < self.options.max_points:
            here, step, behind = self.stride.here, self.stride.step, self.stride.behind
            rest = self._scaled_to_rest(here, behind)
            if rest is not None:
                parameter = here.parameter.name
                self.stop_reason = Ending.SCALES_TO_REST.told(parameter=parameter)
                yield rest
                return
            attempt = self._shortened(behind, here, step)
            if attempt is None and self._last is not None:
                self.stop_reason = self._at_range_end()
                yield from self._last
                return
            if attempt is None:
                grazes = grazes_rigid(here.orbit, -GRAZES, GRAZES)
                self.stop_reason = _at_grazing(here) if grazes else self.too_short()
                return
            step, point, angle, miss = attempt
            low, high = self.limits
            if not low <= point.value <= high:
                end = self._range_end(here, point, low if point.value < low else high)
                half_step = 0.5 * step
                passed = end is not None and grazing_between(here.orbit, end.orbit)
                if passed and half_step >= self.options.min_step:  # behind the end may be rest
                    self.stride = replace(self.stride, step=half_step)
                    continue
                self.stop_reason = self._at_range_end()
                if end is not None:
                    yield end
                return
            if passed_flip(here, point):
                half = here.family.period // 2
                try:
                    end = flip_between(here, point)
                except ConvergenceError:
                    self.stop_reason = Ending.MEETS_HALF_PERIOD.told(
                        period=half, place=place_of(here)
                    )
                    return
                self.stop_reason = Ending.JOINS.told(period=half, place=place_of(end))
                yield end
                return
            if grazes_rigid(point.orbit, 0.0, self._slightest):
                self.stop_reason = _at_grazing(point)
                yield point
                return
            if self.closes(here, point):
                self.stop_reason = Ending.CLOSED_BRANCH.told()
                yield point
                return
            if self.stride.count % LOOKS_BACK == 0 and self._comes_back(here, point):
                self.stop_reason = Ending.COMES_BACK.told(place=place_of(here))
                return
            if self.open_ends is not None and _passed(here, point, self.open_ends).any():
                self.stop_reason = Ending.MEETS_OPEN_END.told()
                yield point
                return
            bent = step <= KINK and (
                point.orbit.impacts != here.orbit.impacts or point.orbit.system.jumps
            )
            bent = bent or passes_node(here, point)
            step = self.options.next_step(step, angle, miss)
            trail = np.vstack([here.point, here.tangent, behind])
            behind = trail[: 0 if bent else 2 * MOST_BEHIND]
            self.stride = StepperState(point, step, behind, self.stride.count + 1)
            self.visited.append(point)
            yield point
        self.stop_reason = Ending.MOST_POINTS.told(points=self.options.max_points)

    @cached_property
    def _slightest(self) -> float:
        """Slightest impact with a rigid stop that is followed, its depth over the orbit's size."""
        return SLIGHTEST if self.start.family.is_exact else DIFFERENCED

    def _at_range_end(self) -> StopReason:
        if self.start.family.in_frequency_alone:
            return Ending.RANGE_END.told()
        return Ending.PARAMETER_RANGE_END.told(parameter=self.start.parameter.name)

    def too_short(self) -> StopReason:
        """The reason to stop where no step leads on."""
        if self.stride is not None:
            resonance = _resonance_beside(self.stride.here.orbit)
            if resonance is not None:
                return Ending.GROWS.told(place=f"{resonance:.9g} Hz")
            share = _rounding(self.stride.here)
            if share > LOST_IN_ROUNDING:
                place = place_of(self.stride.here)
                return Ending.LOST_IN_ROUNDING.told(place=place, share=f"{share:.1g}")
        return Ending.SHORT_STEP.told(step=f"{self.options.min_step:g}", obstacle=self._obstacle)

    def begin_anew(self, here: BranchNode, step: float) -> None:
        """Go on from a point behind a corner of the branch; the points before it do not count."""
        assert self.stride is not None
        behind = np.empty((0, here.tangent.size))
        self.stride = StepperState(here, step, behind, self.stride.count + 1)
        self.visited.append(here)

    def _shortened(
        self, behind: Real, here: BranchNode, step: float
    ) -> tuple[float, BranchNode, float, float] | None:
        """The longest step up to `step` that leads to a next point, with what `_advance` gives."""
        tried, jumps = False, here.orbit.system.jumps
        while step >= self.options.min_step:
            attempt = self._advance(behind, here, step)
            if attempt is None and step <= KINK:
                attempt = self._across_touch(here, step)
            elif attempt is None and jumps:
                attempt = _past_impact_at_node(
                    here, (step,), min(FARTHEST_NODE, FASTEST * step), self.options.max_angle
                )
            if attempt is None and step <= MEETING_STEP and self._met == 2.0 * step:
                step, self._met = self._met, 0.0  # shorter, it ends too near to the flip
                attempt = self._advance(behind, here, step, step)
            if attempt is not None:
                return step, *attempt
            self._last = self._limit_ahead(here, step)
            if self._last is not None:
                return None
            step *= 0.5
            if not tried and self.options.min_step <= step < SHORTEST_CROSSING:
                tried = True
                attempt = _past_impact_at_node(here, PAST_NODE, NEAR_NODE, self.options.max_angle)
                attempt = attempt or self._past_crossing(here)
                if attempt is not None:
                    return attempt[0].arclength - here.arclength, *attempt
        return None

    def _advance(
        self, behind: Real, here: BranchNode, step: float, crossing: float = 0.0
    ) -> tuple[BranchNode, float, float] | None:
        """Next point, its angle to this one and its relative distance from the predictor.

        None when the step must be shorter, as it must be to cross another branch or to meet it:
        up to `SHORTEST_CROSSING` or `MEETING_STEP`, or `crossing` if that is longer.
        """
        family = here.family
        weights = family.metric(here.point)
        direction = here.tangent / metric_length(weights, here.tangent)
        straight = here.point + step * direction
        row = weights * direction
        row /= math.sqrt(float(row @ row))
        cubic, guess = predicted(here.point, here.tangent, behind, weights, step)
        found = correct(
            family,
            guess,
            FREE,
            row,
            float(row @ straight),
            longest=ROOM * self.options.max_miss * step if step > KINK else 2.0 * step,
            max_iterations=FROM_NEAR,
            like=here.orbit.motion,
            aim=cubic,
            # behind a grazing point the branch may turn on a very short length
            closings=self._closings(here.orbit, step),
            turn=math.cos(ROOM * self.options.max_angle) if step > KINK else 0.0,
        )
        if not found.converged:
            self._obstacle = found.failure
            if found.solution is not None and found.step < math.inf:
                self._obstacle += f", last relative step {found.step:.1e}"
            return None
        self._obstacle = "what Newton's method finds is not the next point of the branch"
        if _jumped(family, here.point, straight, found.point):
            return None
        orbit = found.orbit
        if loses_impact(orbit) or grazing_between(here.orbit, orbit):
            return None
        miss = metric_length(weights, found.point - cubic) / step
        # a linear stop that is touched bends the branch; a force that jumps does where the phase of
        # a switch passes one of shooting, as the state there has a corner
        if step <= KINK and miss < 1.0:
            if orbit.impacts != here.orbit.impacts and grazes_rigid(here.orbit, -GRAZES, GRAZES):
                return None  # the branch with the impact and that without meet in a corner
            if (
                orbit.system.jumps
                or orbit.impacts != here.orbit.impacts
                or rubs_all_around(orbit) != rubs_all_around(here.orbit)
            ):
                tangent = found.tangent(direction)
                return BranchNode.of(found, tangent, here.arclength + step), 0.0, 0.0
        if miss > self.options.max_miss:
            return None
        # a curve that turns by max_angle leaves its tangent by half of that: a longer correction
        # has landed on another branch
        off = metric_length(weights, found.point - straight)
        if off > FARTHEST_OFF * self.options.max_angle * step:
            return None
        tangent = found.tangent(direction)
        cosine = float(direction @ (weights * tangent)) / metric_length(weights, tangent)
        angle = math.acos(min(max(cosine, -1.0), 1.0))
        if angle > self.options.max_angle:
            return None
        if step > self.options.grazing_step and orbit.impacts != here.orbit.impacts:
            return None
        meets = passed_flip(here, found)
        if meets and step > max(MEETING_STEP, crossing):
            self._met = step
            return None
        point = BranchNode.of(found, tangent, here.arclength + step)
        if (
            not meets
            and crosses(here, point)
            and (step > max(crossing, SHORTEST_CROSSING) or not is_crossing(found))
        ):
            return None
        if lies_on_crossing(found, min(NEAR_CROSSING * step, ON_CROSSING)):
            return None
        return point, angle, miss

    def _closings(self, orbit: Orbit, step: float) -> int:
        """How often stops close on the next orbit, or -1 for any number.

        A series of impacts that ends in rest may be cut by a phase of shooting, and counts then.
        """
        return orbit.impacts if step > self.options.grazing_step and not orbit.rests else -1

    def _across_touch(
        self, here: BranchNode, step: float
    ) -> tuple[BranchNode, float, float] | None:
        """Next point on the other side of a grazing point, as `_advance` gives it, or None.

        A stiff stop may bend the branch by more than a right angle within 1e-8, back from every
        plane across its tangent. The depth of the touch rises or falls all the way, and where it is
        held the stop's force hardly depends on the orbit.
        """
        if self._depth_row is None or self._depth_row[0] is not here:
            self._depth_row = here, depth_row(here)
        row = self._depth_row[1]
        if row is None:
            return None
        family = here.family
        weights = family.metric(here.point)
        guess = here.point + step * here.tangent / metric_length(weights, here.tangent)
        found = correct(family, guess, FREE, row, longest=2.0 * KINK, max_iterations=FROM_NEAR)
        if not found.converged or _jumped(family, here.point, guess, found.point):
            return None
        length = metric_length(weights, found.point - here.point)
        if length > KINK or found.orbit.impacts == here.orbit.impacts:
            return None
        tangent = found.tangent(here.tangent)
        if float(row @ tangent) * float(row @ here.tangent) < 0.0:
            tangent = -tangent
        return BranchNode.of(found, tangent, here.arclength + length), 0.0, 0.0

    def _past_crossing(self, here: BranchNode) -> tuple[BranchNode, float, float] | None:
        """Next point from one beside which branches cross, or None.

        Its place is some mixture of theirs, and the next orbits may be so ill conditioned that
        Newton's method does not find them: longer steps lead on from the crossing itself.
        """
        crossing = _crossing_ahead(here)
        if crossing is None:
            return None
        obstacle = self._obstacle
        back = max(here.arclength - crossing.arclength, 0.0)
        none = np.empty((0, crossing.tangent.size))
        for factor in LONGER_CROSSINGS:
            length = back + factor * SHORTEST_CROSSING
            attempt = self._advance(none, crossing, length, length)
            if attempt is not None:
                return attempt
        self._obstacle = obstacle
        return None

    def _range_end(self, a: BranchNode, b: BranchNode, end: float) -> BranchNode | None:
        """Point of the branch exactly at an end of the range."""
        p = a.family.charts[0].coordinate(end)
        pa, pb = a.point[-1], b.point[-1]
        if pa == p:
            return None
        share = (p - pa) / (pb - pa)
        guess = (1.0 - share) * a.point + share * b.point
        row = np.zeros(guess.size)
        row[-1] = 1.0
        guess[-1] = p
        found = correct(a.family, guess, FREE, row, like=a.orbit.motion)
        if not found.converged:
            return None
        length = a.arclength + share * (b.arclength - a.arclength)
        return BranchNode.of(found, found.tangent(a.tangent), length)

    def _scaled_to_rest(self, here: BranchNode, behind: Real) -> BranchNode | None:
        """Rest, at the end of a range at zero to which orbits shrink in proportion, or None.

        They would do so for ever on the scale of their own size.
        """
        chart = here.family.charts[0]
        towards = chart.low == 0.0 == self.limits[0] and here.tangent[-1] < 0.0
        if not (towards and len(behind)):
            return None
        if not (scales(behind[0], behind[1]) and scales(here.point, here.tangent)):
            return None
        row = np.zeros(here.point.size)
        row[-1] = 1.0
        found = correct(here.family, np.zeros(here.point.size), FREE, row)
        if not found.converged:
            return None
        length = metric_length(here.family.metric(here.point), here.point)
        return BranchNode.of(found, found.tangent(here.tangent), here.arclength + length)

    def _limit_ahead(self, here: BranchNode, step: float) -> list[BranchNode] | None:
        """The point at the end of the range, if a failed step would have passed it.

        Behind the end of the range of a parameter there may be no systems: no restitution above 1,
        no damping below zero. No point if the walk is there.
        """
        if here.family.in_frequency_alone:
            return None
        weights, slope = here.family.metric(here.point), float(here.tangent[-1])
        limit = self.limits[slope > 0.0]
        p = here.family.charts[0].coordinate(limit)
        ahead = (p - float(here.point[-1])) / (slope or TINY)
        if here.value == limit or not 0.0 < ahead <= step:
            return [] if here.value == limit else None
        straight = here.point + ahead * here.tangent
        straight[-1] = p
        row = np.zeros(straight.size)
        row[-1] = 1.0
        found = correct(here.family, straight, FREE, row)
        off = metric_length(weights, found.point - straight)
        if not found.converged or off > self.options.max_angle * ahead:
            return None
        end = BranchNode.of(found, found.tangent(here.tangent), here.arclength + ahead)
        return None if grazing_between(here.orbit, end.orbit) else [end]

    def closes(self, a: BranchNode, b: BranchNode) -> bool:
        """Whether the walk from a to b passes the start again, in the same direction.

        The orbit may have come back shifted by some of its excitation periods.
        """
        start = self.start
        if b.arclength - start.arclength < 3.0 * (b.arclength - a.arclength):
            return False
        places, tangents = self._shifts
        passed = _passed(a, b, places)
        if not passed.any():
            return False
        step = start.family.metric(start.point) * (b.point - a.point)
        return bool((tangents[passed] @ step > 0.0).any())

    def _comes_back(self, a: BranchNode, b: BranchNode) -> bool:
        """Whether the walk from a to b passes a point that it has passed before, not the start.

        It can, in the same direction, only where it has left its branch for another one on the way.
        """
        if self._places is None:
            self._places = Rows(a.point.size)
        for point in self.visited[len(self._places.so_far()) :]:
            self._places.add(point.point)
        passed = _passed(a, b, self._places.so_far()[:-RECENT])
        if not passed.any():
            return False
        weights, step = a.family.metric(a.point), b.point - a.point
        length2 = float(step @ (weights * step))
        for index in np.flatnonzero(passed):
            place, tangent = self.visited[index].point, self.visited[index].tangent
            if tangent @ (weights * step) <= 0.0:
                continue
            row = weights * tangent / np.linalg.norm(weights * tangent)
            share = float((place - a.point) @ (weights * step)) / length2
            found = correct(a.family, a.point + share * step, FREE, row, float(row @ place))
            if found.converged and metric_length(weights, found.point - place) < SAME_PLACE:
                return True
        return False

    @cached_property
    def _shifts(self) -> tuple[Real, Real]:
        """Shooting unknowns and tangents of the start shifted by its excitation periods."""
        problem, start = self.start.family.problem, self.start
        return np.array(shifts(problem, start.point)), np.array(shifts(problem, start.tangent))


def _at_grazing(point: BranchNode) -> StopReason:
    return Ending.GRAZES_RIGID.told(place=place_of(point, 9))


def scales(point: Real, tangent: Real) -> bool:
    """Whether the states of a branch in one parameter change in proportion to it."""
    off = point[:-1] * tangent[-1] - tangent[:-1] * point[-1]
    return bool(np.abs(off).max() < SCALES * np.abs(tangent[:-1]).max() * abs(point[-1]))


def _resonance_beside(orbit: Orbit) -> float | None:
    """Frequency in Hz of an undamped mode at which a motion without contact grows, or None."""
    if orbit.impacts or orbit.max_penetration > 0.0:
        return None
    return orbit.system.response(orbit.omega).resonance_hz(orbit.omega, BESIDE_RESONANCE)


def _rounding(here: BranchNode) -> float:
    """How far rounding moves an orbit, over its size: ε by the condition of what closes it."""
    weights = np.sqrt(here.family.metric(here.point))
    try:
        closing = here.family.at(here.point).jacobian
        values = np.linalg.svd(weights[:-1, None] * closing / weights, compute_uv=False)
    except FAILURES:
        return 0.0
    return EPS * float(values[0] / max(values[-1], TINY))


def _crossing_ahead(here: BranchNode) -> BranchNode | None:
    """Where another branch crosses that of a point right beside there, on its tangent.

    It may lie a little behind.
    """
    crossing = crossing_beside(here)
    if crossing is None:
        return None
    way = crossing.point - here.point
    weights = here.family.metric(here.point)
    if metric_length(weights, way) > FARTHEST_CROSSING:
        return None
    ahead = float(way @ (weights * here.tangent)) / metric_length(weights, here.tangent)
    return BranchNode.of(crossing, here.tangent, here.arclength + ahead)


def _passed(a: BranchNode, b: BranchNode, places: Real) -> NDArray[np.bool_]:
    """Which places (m, N + 1) lie beside the step from a to b, nearer than 0.1 of its length.

    None do where an impact passes a phase of shooting: the state jumps there.
    """
    if passes_node(a, b):
        return np.zeros(len(places), dtype=bool)
    start, step = a.point, b.point - a.point
    weights = a.family.metric(start)
    length2 = float(step @ (weights * step))
    passed = np.zeros(len(places), dtype=bool)
    near = np.abs(places[:, -1] - start[-1]) <= ROOM * math.sqrt(length2)  # few are
    if near.any():
        way = places[near] - start
        along = way @ (weights * step)
        off = way - np.outer(along / length2, step)
        inside = (along >= 0.0) & (along <= length2)
        passed[near] = inside & ((off * off) @ weights < BESIDE_STEP * length2)
    return passed


def _jumped(family: OrbitFamily, here: Real, guess: Real, there: Real) -> bool:
    """Whether a step has landed on an orbit shifted by some excitation periods, or on half of one.

    Where it is shifted, some other shift of it lies nearer to where the step began. Only through a
    flip the halves change places steadily, as the tangent foretells; not in a jump. Nor does a
    doubled branch go on along the one that it comes from, nor one of broken symmetry along the
    symmetric one.
    """
    problem = family.problem
    broken = asymmetry(problem, here)
    least = max(BROKEN, BY_TOLERANCE * problem.flow.options.rtol)
    if broken > least and asymmetry(problem, there) < EQUAL_HALVES * broken:
        return True
    if problem.period == 1:
        return False
    apart, *others = (float(np.linalg.norm((p - here)[:-1])) for p in shifts(problem, there))
    if problem.period % 2 == 0:  # half its period: a flip, below
        del others[problem.period // 2 - 1]
    if any(other < apart for other in others):
        return True
    if problem.period % 2:
        return False
    a, g, b = (half_difference(family, point) for point in (here, guess, there))
    before, after = float(np.linalg.norm(a)), float(np.linalg.norm(b))
    if after < EQUAL_HALVES * before:  # on the branch of half the period
        return True
    return float(a @ b) < 0.0 and float(np.linalg.norm(b - g)) > 0.5 * max(before, after)
