"""The walk along a branch or a curve of periodic orbits in one direction, by pseudo-arclength."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import SLACK, TINY, Real
from nldyn.base.errors import FAILURES, ConvergenceError, check_types
from nldyn.base.rows import Rows
from nldyn.bifurcations.beyond_rigid_grazing import DIFFERENCED, SLIGHTEST
from nldyn.bifurcations.branch_crossing import SHORTEST_CROSSING
from nldyn.bifurcations.codimension_two import is_torus, is_torus_curve
from nldyn.bifurcations.corners import CORNER_STEP, MEETS, corner_ahead, extremes_meet
from nldyn.bifurcations.just_sticking import just_slips, just_sticks
from nldyn.bifurcations.last_slip import LEAST, LITTLE, first_slip, last_slip
from nldyn.bifurcations.on_curve import FARTHEST_NODE, on_chart_plane, on_plane
from nldyn.bifurcations.period_doubling import flip_between, passed_flip
from nldyn.bifurcations.point import BranchNode, place_of
from nldyn.bifurcations.self_excited import at_rest_between, past_corner
from nldyn.bifurcations.within_step import passes_node
from nldyn.branches.endings import Ending, StopReason
from nldyn.branches.guards import (
    GRAZES,
    KINK,
    MEETING_STEP,
    Attempt,
    grazes_rigid,
    grazing_between,
    in_the_way,
    meets_flip,
)
from nldyn.branches.past_obstacles import (
    FASTEST,
    LONGER_CROSSINGS,
    NEAR_NODE,
    PAST_NODE,
    SHARES,
    Advance,
    across_touch,
    clear_of_nodes,
    crossing_ahead,
    over_node,
)
from nldyn.branches.predictor import predicted
from nldyn.branches.step_control import ContinuationOptions
from nldyn.orbits.bordered import FREE, correct, nearest_depth
from nldyn.orbits.conditions import UNFOLDED, BranchPointCondition, Held, Turning, depth_row
from nldyn.orbits.multipliers import EPS
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import FROM_NEAR, metric_length, shifts
from nldyn.system.chart import told_value

MOST_BEHIND = 4  # points behind the last one that tell where a branch goes on
LOOKS_BACK = 4  # steps between two looks whether a walk has been there before
RECENT = 10  # points behind a walk that it does not come back to
SAME_PLACE = 1e-8  # distance of points that are one, relative to the orbit
ROOM = 1.1  # times a bound: what is searched, where the bound itself is looked at later
BESIDE_RESONANCE = 1e-6  # relative distance from one, where steps are lost in rounding
LOST_IN_ROUNDING = 1e-7  # of an orbit's size, which is far more than Newton's method leaves
SCALES = 1e-8  # relative departure from a proportional change that is rounding
BESIDE_STEP = 0.01  # squared distance from a step, over its own, of what it passes through
ONE_EXTREME = 1e-9  # depth between two extremes, relative to the orbit, that is rounding
ALONG = 1e-12  # part of a unit tangent that is rounding


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


@dataclass
class Stepper:
    """Iterator over the points of a branch, or of a curve in two parameters, in one direction.

    Yields `BranchNode`s; when it ends, `stop_reason` says why. The caller may stop between any
    two points; asked for points again, the walk goes on where it was.

    Parameters
    ----------
    start : BranchNode
        First point, yielded first; its tangent gives the direction, its condition what the orbits
        of a curve have in common.
    limits : (float, float)
        Values of the first parameter between which to stay; of a second one its chart tells.
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
            last = self._scaled_to_rest(here, behind)
            if last is not None:
                yield from last
                return
            made = self._shortened(behind, here, step)
            if made is None and self._last is not None:
                yield from self._last
                return
            if made is None:
                self.stop_reason = self._why_short(here)
                return
            for a, b in pairwise((here, *made.way)):
                last = self._ended(a, b)
                half_step = 0.5 * made.step
                if last and half_step >= self.options.min_step and self._grazes_before(a, last[0]):
                    self.stride = replace(self.stride, step=half_step)
                    break
                if last is not None:
                    yield from last
                    return
                if b is not made.there:
                    yield b
            else:
                yield self._moved(made)
        self.stop_reason = Ending.MOST_POINTS.told(points=self.options.max_points)

    def _moved(self, made: Advance) -> BranchNode:
        """The next point, from which the walk goes on."""
        assert self.stride is not None
        here, there, step = self.stride.here, made.there, made.step
        bent = step <= KINK and (
            here.condition is not FREE  # whose slopes are coarse
            or there.orbit.impacts != here.orbit.impacts
            or there.orbit.system.jumps
        )
        bent = bent or passes_node(here, there) or bool(there.corner or made.way[0].corner)
        trail = np.concatenate([here.point[None], here.tangent[None], self.stride.behind])
        behind = trail[: 0 if bent else 2 * MOST_BEHIND]
        step = self.options.next_step(step, made.angle, made.miss)
        self.stride = StepperState(there, step, behind, self.stride.count + 1)
        self.visited.append(there)
        return there

    def _ended(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """The last points of the walk if it ends in this step, and why."""
        for ends in (
            self._leaves_range, self._dissolves, self._meets_half_period, self._becomes_neutral,
            self._vanishes, self._shrinks, self._grazes, self._ceases_to_slide, self._closed,
            self._came_back, self._meets_open_end,
        ):  # fmt: skip
            last = ends(here, there)
            if last is not None:
                return last
        return None

    @cached_property
    def _slightest(self) -> float:
        """Slightest impact with a rigid stop that is followed, its depth over the orbit's size."""
        return SLIGHTEST if self.start.family.is_exact else DIFFERENCED

    @cached_property
    def _ranges(self) -> list[tuple[float, float]]:
        """Values of the parameters between which to stay."""
        return [self.limits, *((c.low, c.high) for c in self.start.family.charts[1:])]

    def _at_range_end(self, which: int = 0) -> StopReason:
        family = self.start.family
        if family.in_frequency_alone:
            return Ending.RANGE_END.told()
        return Ending.PARAMETER_RANGE_END.told(parameter=family.charts[which].parameter.name)

    def _why_short(self, here: BranchNode) -> StopReason:
        """The reason to stop where no step leads on, by what the orbits have in common."""
        condition, orbit = here.condition, here.orbit
        if extremes_meet(here):
            return Ending.EXTREME_VANISHES.told()
        if isinstance(condition, BranchPointCondition) and nearest_depth(orbit) < MEETS:
            return Ending.CORNER.told()
        if isinstance(condition, Held) and condition.changes_extreme(orbit):
            return Ending.OTHER_EXTREME.told()
        near = GRAZES if condition is FREE else max(GRAZES, self._slightest)
        if grazes_rigid(orbit, -near, near, condition):
            return _at_grazing(here)
        return self.too_short()

    def too_short(self) -> StopReason:
        """The reason to stop where no step leads on."""
        if self.stride is not None:
            here = self.stride.here
            resonance = _resonance_beside(here.orbit)
            if resonance is not None:
                alone = here.family.in_frequency_alone
                place = f"{resonance:.9g} Hz" if alone else _beside(here)
                return Ending.GROWS.told(place=place)
            slider = just_slips(here.orbit)
            if slider is not None:
                return Ending.JUST_SLIPS.told(at=slider.at, place=place_of(here, 9))
            share = _rounding(here)
            if share > LOST_IN_ROUNDING:
                place = place_of(here)
                return Ending.LOST_IN_ROUNDING.told(place=place, share=f"{share:.1g}")
            slider = just_sticks(here.orbit)
            if slider is not None:
                return Ending.JUST_STICKS.told(at=slider.at, place=place_of(here, 9))
            if self._ceases_to_slide(here, here, LITTLE) is not None:
                return self.stop_reason
            slider = first_slip(here.orbit)
            if slider is not None:
                return Ending.BEGINS_TO_SLIDE.told(at=slider.at, place=place_of(here, 9))
        return Ending.SHORT_STEP.told(step=f"{self.options.min_step:g}", obstacle=self._obstacle)

    def begin_anew(self, here: BranchNode, step: float) -> None:
        """Go on from a point behind a corner of the branch; the points before it do not count."""
        assert self.stride is not None
        behind = np.empty((0, here.tangent.size))
        self.stride = StepperState(here, step, behind, self.stride.count + 1)
        self.visited.append(here)

    def _shortened(self, behind: Real, here: BranchNode, step: float) -> Advance | None:
        """The longest step up to `step` that leads to a next point."""
        free = here.condition is FREE
        looked = bool(here.corner)
        nearest = SHORTEST_CROSSING if free else CORNER_STEP
        while step >= self.options.min_step:
            made = self._advance(behind, here, step, 0.0, looked)
            if free and step <= KINK:
                made = made or self._across_touch(here, step)
            elif made is None or not (free or clear_of_nodes(made.there)):
                steps = (step,) if free else [share * step for share in SHARES]
                near = min(FARTHEST_NODE, FASTEST * step)
                made = self._over_node(here, steps, near, looked) or made
            if made is None and step <= MEETING_STEP and self._met == 2.0 * step:
                step, self._met = self._met, 0.0  # shorter, it ends too near to the flip
                made = self._advance(behind, here, step, step)
            if made is not None:
                return made
            self._last = self._limit_ahead(here, step)
            if self._last is not None:
                return None
            step *= 0.5
            if not looked and self.options.min_step <= step < nearest:
                looked = True
                made = self._past_obstacle(here)
                if made is not None:
                    return made
        return None

    def _past_obstacle(self, here: BranchNode) -> Advance | None:
        """Next point from one beside which an impact, a crossing or a corner is in the way."""
        options = self.options
        if here.condition is FREE:
            made = self._over_node(here, PAST_NODE, NEAR_NODE) or self._past_crossing(here)
            return made and made._replace(step=made.there.arclength - here.arclength)
        if isinstance(here.condition, Turning):
            way = past_corner(here) if here.orbit.system.rubbing else []
        else:
            way = corner_ahead(here, options.grazing_step, options.max_step)
        if not way:
            return None
        *_, before, last = (here, *way)
        step = last.arclength - before.arclength
        return Advance(tuple(way), step, options.max_angle, options.max_miss)

    def _over_node(
        self, here: BranchNode, steps: Sequence[float], near: float, looked: bool = False
    ) -> Advance | None:
        """Next point by states at other phases, where an impact is as near to one of shooting."""
        none = np.empty((0, here.tangent.size))

        def straight_on(shot: BranchNode, length: float) -> Advance | None:
            return self._advance(none, shot, length, 0.0, looked)

        return over_node(here, steps, near, straight_on)

    def _advance(
        self,
        behind: Real,
        here: BranchNode,
        step: float,
        crossing: float = 0.0,
        looked: bool = False,
    ) -> Advance | None:
        """Next point at a distance, if nothing is in the way.

        None when the step must be shorter, as it must be to cross another branch or to meet it:
        up to `SHORTEST_CROSSING` or `MEETING_STEP`, or `crossing` if that is longer.
        """
        family = here.family
        weights = here.weights
        direction = here.tangent / metric_length(weights, here.tangent)
        straight = here.point + step * direction
        row = weights * direction
        row /= math.sqrt(float(row @ row))
        cubic, guess = predicted(here.point, here.tangent, behind, weights, step)
        found = correct(
            family,
            guess,
            here.condition,
            row,
            float(row @ straight),
            longest=self._longest(here, step),
            max_iterations=FROM_NEAR,
            like=here.orbit.motion,
            aim=cubic,
            # behind a grazing point the branch may turn on a very short length
            closings=self._closings(here.orbit, step),
            turn=math.cos(ROOM * self.options.max_angle) if step > KINK else 0.0,
        )
        attempt = Attempt(
            here, step, direction, straight, cubic, found, self.options, crossing, looked
        )
        obstacle = in_the_way(attempt)
        if obstacle is not None:
            guard, self._obstacle = obstacle
            if guard is meets_flip:
                self._met = step
            return None
        bends = (0.0, 0.0) if attempt.kinked else (attempt.angle, attempt.miss)
        return Advance((attempt.there,), step, *bends)

    def _longest(self, here: BranchNode, step: float) -> float:
        """How far Newton's method may step at first, but along a curve, whose slopes are coarse."""
        if here.condition is not FREE:
            return math.inf
        return ROOM * self.options.max_miss * step if step > KINK else 2.0 * step

    def _closings(self, orbit: Orbit, step: float) -> int:
        """How often stops close on the next orbit, or -1 for any number.

        A series of impacts that ends in rest may be cut by a phase of shooting, and counts then.
        """
        return orbit.impacts if step > self.options.grazing_step and not orbit.rests else -1

    def _across_touch(self, here: BranchNode, step: float) -> Advance | None:
        """Next point on the other side of a grazing point, or None."""
        if self._depth_row is None or self._depth_row[0] is not here:
            self._depth_row = here, depth_row(here)
        row = self._depth_row[1]
        return None if row is None else across_touch(here, step, row)

    def _past_crossing(self, here: BranchNode) -> Advance | None:
        """Next point from one beside which branches cross, or None.

        Its place is some mixture of theirs, and the next orbits may be so ill conditioned that
        Newton's method does not find them: longer steps lead on from the crossing itself.
        """
        crossing = crossing_ahead(here)
        if crossing is None:
            return None
        obstacle = self._obstacle
        back = max(here.arclength - crossing.arclength, 0.0)
        none = np.empty((0, crossing.tangent.size))
        for factor in LONGER_CROSSINGS:
            length = back + factor * SHORTEST_CROSSING
            made = self._advance(none, crossing, length, length)
            if made is not None:
                return made
        self._obstacle = obstacle
        return None

    def _grazes_before(self, here: BranchNode, end: BranchNode) -> bool:
        """Whether a rigid stop is grazed before the end of the range, behind which may be rest."""
        if self.stop_reason.ending not in (Ending.RANGE_END, Ending.PARAMETER_RANGE_END):
            return False
        return not here.family.passages and grazing_between(here.orbit, end.orbit)

    def _leaves_range(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """The point exactly at an end of a range; none if the walk stands there."""
        passed = []
        pairs = zip(here.values.tolist(), there.values.tolist(), self._ranges, strict=True)
        for which, (a, b, (low, high)) in enumerate(pairs):
            if not low <= b <= high:
                limit = low if b < low else high
                passed.append((1.0 if a == b else (limit - a) / (b - a), which, limit))
        if not passed:
            return None
        share, which, limit = min(passed)
        self.stop_reason = self._at_range_end(which)
        if share <= (0.0 if here.condition is FREE else SLACK):
            return []
        end = on_chart_plane(here, there, which, limit)
        if end is None and not here.family.in_frequency_alone:
            name = here.family.charts[which].parameter.name
            self.stop_reason = Ending.NO_ORBIT_AT_RANGE_END.told(parameter=name)
        return [] if end is None else [end]

    def _limit_ahead(self, here: BranchNode, step: float) -> list[BranchNode] | None:
        """The point at the end of a range, if a failed step would have passed it.

        Behind the end of the range of a parameter there may be no systems: no restitution above 1,
        no damping below zero. No point if the walk is there.
        """
        family = here.family
        if family.in_frequency_alone:
            return None
        weights, values = here.weights, here.values.tolist()
        for which, (chart, limits) in enumerate(zip(family.charts, self._ranges, strict=True)):
            place = family.n_states + which
            slope = float(here.tangent[place])
            limit = limits[slope > 0.0]
            if abs(slope) > ALONG and (values[which] - limit) * slope >= 0.0:
                self.stop_reason = self._at_range_end(which)
                return []
            coordinate = chart.coordinate(limit)
            ahead = (coordinate - float(here.point[place])) / (slope or TINY)
            if not 0.0 < ahead <= step:
                continue
            way = ahead * here.tangent
            end = on_plane(here, way, ahead, which, coordinate)
            if end is None or (not family.passages and grazing_between(here.orbit, end.orbit)):
                continue
            off = metric_length(weights, end.point - here.point - way)
            if off <= self.options.max_angle * ahead:
                self.stop_reason = self._at_range_end(which)
                return [end]
        return None

    def _scaled_to_rest(self, here: BranchNode, behind: Real) -> list[BranchNode] | None:
        """What ends the walk where orbits shrink in proportion to parameters that go to zero.

        They would do so for ever on the scale of their own size. It is rest, but where no orbit of
        a curve is found there; None if they do not.
        """
        charts, n = here.family.charts, here.family.n_states
        at_zero = [
            place
            for place, (chart, limits) in enumerate(zip(charts, self._ranges, strict=True))
            if (chart.low, chart.high) == limits and chart.low <= 0.0 <= chart.high
            and here.tangent[n + place] * np.sign(here.point[n + place]) < -SCALES
        ]  # fmt: skip
        if not (at_zero and len(behind)):
            return None
        scaled = np.arange(here.point.size) < n
        scaled[[n + place for place in at_zero]] = True
        secant = here.point - behind[0]
        secant /= metric_length(here.weights, secant)
        held = float(np.abs(secant[~scaled]).max(initial=0.0))
        if held > SCALES or not scales(here.point[scaled], secant[scaled]):
            return None
        way = np.where(scaled, -here.point, 0.0)
        length = metric_length(here.weights, way)
        rest = on_plane(here, way, length, at_zero[-1], 0.0)
        if rest is None and here.condition is FREE:
            return None
        names = " and ".join(charts[place].parameter.name for place in at_zero)
        self.stop_reason = Ending.SCALES_TO_REST.told(parameter=names)
        return [] if rest is None else [rest]

    def _dissolves(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """A branch point that is none any more."""
        unfolded = isinstance(here.condition, BranchPointCondition)
        if not (unfolded and abs(float(there.point[-1])) > UNFOLDED):
            return None
        self.stop_reason = Ending.DISSOLVED.told()
        return []

    def _meets_half_period(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """The flip at which a doubled branch ends; a curve ends before it."""
        if not passed_flip(here, there):
            return None
        half = here.orbit.period // 2
        if here.condition is not FREE:
            self.stop_reason = Ending.MEETS_HALF_PERIODS.told(period=half)
            return []
        try:
            end = flip_between(here, there)
        except ConvergenceError:
            self.stop_reason = Ending.MEETS_HALF_PERIOD.told(period=half, place=place_of(here))
            return []
        self.stop_reason = Ending.JOINS.told(period=half, place=place_of(end))
        return [end]

    def _becomes_neutral(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """A curve of Neimark-Sacker points whose pair has become real."""
        if not is_torus_curve(here.condition) or is_torus(there.orbit.multipliers):
            return None
        self.stop_reason = Ending.RESONANCE.told()
        return [there]

    def _vanishes(self, _: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """A curve of grazings whose extreme meets the next one of the other kind."""
        if not extremes_meet(there, ONE_EXTREME):
            return None
        self.stop_reason = Ending.EXTREME_VANISHES.told()
        return [there]

    def _shrinks(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """A limit cycle that has shrunk to rest, behind which it comes back half a turn later."""
        end = at_rest_between(here, there)
        if end is None:
            return None
        self.stop_reason = Ending.HOPF.told(place=place_of(end))
        return [end]

    def _grazes(self, _: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """An impact with a rigid stop too slight to be followed."""
        if not grazes_rigid(there.orbit, 0.0, self._slightest, there.condition):
            return None
        self.stop_reason = _at_grazing(there)
        return [there]

    def _ceases_to_slide(
        self, _: BranchNode, there: BranchNode, least: float = LEAST
    ) -> list[BranchNode] | None:
        """A motion that all but sticks all the time, of which less and less is left."""
        if len(there.family.charts) > 1 or not there.orbit.system.rubbing:
            return None
        found = last_slip([*self.visited, there], least)
        if found is None:
            return None
        slider, limit = found
        place = told_value(there.parameter, limit, digits=6)
        self.stop_reason = Ending.STICKS.told(at=slider.at, place=place)
        return [there]

    def _closed(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """The point behind the start, where the walk has come round."""
        if not self.closes(here, there):
            return None
        free = here.condition is FREE
        self.stop_reason = (Ending.CLOSED_BRANCH if free else Ending.CLOSED_CURVE).told()
        return [there]

    def _came_back(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """Where the walk has been before."""
        assert self.stride is not None
        if self.stride.count % LOOKS_BACK or not self._comes_back(here, there):
            return None
        self.stop_reason = Ending.COMES_BACK.told(place=place_of(here))
        return []

    def _meets_open_end(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """The point behind the open end of another branch."""
        if self.open_ends is None or not _passed(here, there, self.open_ends).any():
            return None
        self.stop_reason = Ending.MEETS_OPEN_END.told()
        return [there]

    def closes(self, a: BranchNode, b: BranchNode) -> bool:
        """Whether the walk from a to b passes the start again, in the same direction.

        The orbit may have come back shifted by some of its excitation periods.
        """
        start = self.start
        if b.arclength - start.arclength < 3.0 * (b.arclength - a.arclength):
            return False
        if not _near(a, b, start.point):  # nor is a shift, whose parameter is the same
            return False
        places, tangents = self._shifts
        passed = _passed(a, b, places)
        if not np.count_nonzero(passed):
            return False
        step = start.weights * (b.point - a.point)
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
        if not np.count_nonzero(passed):
            return False
        weights, step = a.weights, b.point - a.point
        length2 = float(step @ (weights * step))
        for index in np.flatnonzero(passed):
            place, tangent = self.visited[index].point, self.visited[index].tangent
            if tangent @ (weights * step) <= 0.0:
                continue
            row = weights * tangent / np.linalg.norm(weights * tangent)
            share = float((place - a.point) @ (weights * step)) / length2
            found = correct(a.family, a.point + share * step, a.condition, row, float(row @ place))
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
    if orbit.touches_stops:
        return None
    return orbit.system.response(orbit.omega).resonance_hz(orbit.omega, BESIDE_RESONANCE)


def _beside(here: BranchNode) -> str:
    """Values of what is followed in words, to as many digits as `BESIDE_RESONANCE` leaves."""
    digits = -round(math.log10(BESIDE_RESONANCE))
    pairs = [
        (chart.parameter, chart.value(round(chart.coordinate(value), digits) + 0.0))
        for chart, value in zip(here.family.charts, here.values.tolist(), strict=True)
    ]
    return ", ".join(told_value(*pair) for pair in pairs)


def _rounding(here: BranchNode) -> float:
    """How far rounding moves an orbit, over its size: ε by the condition of what closes it."""
    weights = np.sqrt(here.weights)
    of_states = weights[: here.family.n_states, None]
    try:
        closing = here.family.at(here.point).jacobian
        values = np.linalg.svd(of_states * closing / weights, compute_uv=False)
    except FAILURES:
        return 0.0
    return EPS * float(values[0] / max(values[-1], TINY))


def _near(a: BranchNode, b: BranchNode, place: Real) -> bool:
    """Whether the parameter of a place is as near as the step from a to b is long."""
    length = metric_length(a.weights, b.point - a.point)
    return abs(float(place[-1] - a.point[-1])) <= ROOM * length


def _passed(a: BranchNode, b: BranchNode, places: Real) -> NDArray[np.bool_]:
    """Which places (m, N + 1) lie beside the step from a to b, nearer than 0.1 of its length.

    None do where an impact passes a phase of shooting: the state jumps there.
    """
    passed = np.zeros(len(places), dtype=bool)
    if not passed.size or passes_node(a, b):
        return passed
    start, step, weights = a.point, b.point - a.point, a.weights
    length2 = float(step @ (weights * step))
    near = np.abs(places[:, -1] - start[-1]) <= ROOM * math.sqrt(length2)  # few are
    if np.count_nonzero(near):
        way = places[near] - start
        along = way @ (weights * step)
        off = way - np.outer(along / length2, step)
        inside = (along >= 0.0) & (along <= length2)
        passed[near] = inside & ((off * off) @ weights < BESIDE_STEP * length2)
    return passed
