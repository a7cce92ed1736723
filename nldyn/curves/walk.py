"""Walking along a curve of orbits that meet a condition in one or two parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from nldyn.base.arrays import SLACK, TINY, Real
from nldyn.base.errors import FAILURES
from nldyn.bifurcations.beyond_rigid_grazing import DIFFERENCED, SLIGHTEST
from nldyn.bifurcations.period_doubling import passed_flip
from nldyn.bifurcations.point import BranchNode, node_of
from nldyn.branches.arclength import (
    BESIDE_STEP,
    FARTHEST_OFF,
    GRAZES,
    SCALES,
    grazes_rigid,
    loses_impact,
    scales,
)
from nldyn.branches.endings import Ending, StopReason
from nldyn.branches.step_control import ContinuationOptions
from nldyn.curves.codimension_two import cosine_near, is_torus, torus_cosine
from nldyn.curves.corners import CORNER_STEP, MEETS, corner_ahead, extremes_meet, grazes_linear
from nldyn.curves.point import (
    NEAR_NODE,
    clear_of_nodes,
    on_chart_plane,
    on_plane,
    shot_from,
)
from nldyn.orbits.bordered import Condition, correct, nearest_depth
from nldyn.orbits.conditions import BranchPointCondition, Grazing, Held, Singular
from nldyn.orbits.impact_phases import nodes_to_impacts, start_far_from_impacts
from nldyn.orbits.shooting import FROM_NEAR, metric_length
from nldyn.system.chart import told_value

UNFOLDED = 1e-6  # unfolding number from which a branch point has dissolved
ALONG = 1e-12  # part of a unit tangent that is rounding
FASTEST = 20.0  # change of an impact's phase with the arclength, at most, in rad
CLEAR_OF_NODES = 3e-3  # rad from an impact to one, from which derivatives do not reach across it
MOST_OVER_NODE = 8  # steps, none of which leads clear of it where the impact moves slowly
SHARES = (1.0, 0.8, 0.6, 0.4, 0.25)  # of a step that leads over a phase of shooting
# The condition of a Neimark-Sacker point holds for neutral saddles, too, and some may be near: the
# cosine of the pair's angle changes by no more than this from point to point.
TURN = 0.1


def _grazes_rigid(here: BranchNode, least: float, most: float) -> StopReason | None:
    """The reason to stop, if the slightest impact with a rigid stop, or nearest miss, is so deep.

    Both bounds are shares of the orbit's size; that of a curve of grazings is its own.
    """
    condition, orbit = here.condition, here.orbit
    but = None
    if isinstance(condition, Grazing):

        def but(stop: int, phase: float) -> bool:
            return condition.is_of(stop, True, phase, orbit.period)

    if not grazes_rigid(orbit, least, most, but):
        return None
    chart, value = here.family.charts[0], float(here.values[0])
    return Ending.GRAZES_RIGID.told(place=told_value(chart.parameter, value, digits=9))


@dataclass
class CurveWalk:
    """Iterator over the points of a curve in one direction, as `Stepper` is over a branch's.

    Parameters
    ----------
    start : BranchNode
        First point, yielded first; its tangent gives the direction.
    options : ContinuationOptions
        Step control.
    origin : BranchNode, optional
        Where the curve closes, in its direction; the start unless given.
    """

    start: BranchNode
    options: ContinuationOptions
    origin: BranchNode | None = None
    stop_reason: StopReason = field(default_factory=Ending.NOT_FINISHED.told)
    _cosine: float = field(default=math.nan, init=False, repr=False)  # of a pair on the circle
    _obstacle: str = field(default="", init=False, repr=False)

    def __iter__(self) -> Iterator[BranchNode]:
        """Walk along the curve."""
        here, step = self.start, self.options.first_step
        curvature = np.zeros(here.tangent.size)
        if is_torus_curve(here.condition):
            self._cosine = torus_cosine(here.orbit.multipliers)
        yield here
        if left := self._left_at_once():
            self.stop_reason = Ending.PARAMETER_RANGE_END.told(parameter=left)
            return
        ahead: list[BranchNode] = []  # a corner, and what is behind it
        before = None
        for _ in range(self.options.max_points):
            rest = before and self._scaled_to_rest(before, here)
            if rest is not None:
                yield from rest
                return
            attempt = None
            seen = bool(here.corner)
            if ahead:
                step = ahead[0].arclength - here.arclength
                attempt = ahead.pop(0), self.options.max_angle, self.options.max_miss
            while attempt is None:
                attempt = self._advance(here, curvature, step, seen)
                if attempt is None:
                    limit = self._limit_ahead(here, step)
                    if limit is not None:
                        yield limit
                        return
                    step *= 0.5
                    if step < CORNER_STEP and not seen:
                        seen = True
                        ahead = corner_ahead(here, self.options)
                        if ahead:
                            attempt = ahead.pop(0), self.options.max_angle, self.options.max_miss
                    if step < self.options.min_step:
                        self.stop_reason = self._why_short(here)
                        return
            there, angle, miss = attempt
            last = self._end(here, there)
            if last is not None:
                yield from last
                return
            yield there
            if grazes := _grazes_rigid(there, 0.0, self._slightest):
                self.stop_reason = grazes
                return
            if is_torus_curve(there.condition):
                self._cosine = cosine_near(there.orbit.multipliers, self._cosine)
            curvature = (there.tangent - here.tangent) / (there.arclength - here.arclength)
            if there.corner or clear_of_nodes(here, there)[0] is not here:
                curvature = np.zeros(here.tangent.size)
            before, here = here, there
            step = self.options.next_step(step, angle, miss)
        self.stop_reason = Ending.MOST_POINTS.told(points=self.options.max_points)

    def _advance(
        self, here: BranchNode, curvature: Real, step: float, seen: bool
    ) -> tuple[BranchNode, float, float] | None:
        """Next point, also where an impact passes a phase of shooting; see `_straight_on`."""
        attempt = self._straight_on(here, curvature, step, seen)
        if attempt is not None and nodes_to_impacts(attempt[0].orbit) > CLEAR_OF_NODES:
            return attempt
        if not nodes_to_impacts(here.orbit) < min(NEAR_NODE, FASTEST * step):
            return attempt
        try:
            shot = shot_from(here, start_far_from_impacts(here.orbit))
            none = np.zeros(here.tangent.size)
            for _ in range(MOST_OVER_NODE):
                first = None
                for share in SHARES:
                    beyond = self._straight_on(shot, none, share * step, seen)
                    if beyond is None:
                        continue
                    first = first or beyond[0]
                    there = shot_from(beyond[0], 0.0)
                    if nodes_to_impacts(there.orbit) > CLEAR_OF_NODES:
                        return there, *beyond[1:]
                if first is None:
                    break
                shot = first
        except FAILURES:
            pass
        return attempt

    def _straight_on(
        self, here: BranchNode, curvature: Real, step: float, seen: bool
    ) -> tuple[BranchNode, float, float] | None:
        """Next point, its angle to this one and its relative distance from the predictor.

        None when the step must be shorter. Where no corner was seen yet, none of a linear stop is
        stepped over: beside it another piece of the curve may lie straight ahead.
        """
        family = here.family
        weights = family.metric(here.point)
        direction = here.tangent
        straight = here.point + step * direction
        row = weights * direction
        row /= np.linalg.norm(row)
        predicted = straight + 0.5 * step**2 * curvature
        found = correct(
            family, predicted, here.condition, row, float(row @ straight), max_iterations=FROM_NEAR
        )
        if not found.converged:
            self._obstacle = found.failure
            return None
        self._obstacle = "what Newton's method finds is not the next point of the curve"
        if not family.passages and loses_impact(found.orbit):
            return None
        miss = metric_length(weights, found.at.point - predicted) / step
        off = metric_length(weights, found.at.point - straight)
        if miss > self.options.max_miss or off > FARTHEST_OFF * self.options.max_angle * step:
            return None
        try:
            there = node_of(found, direction, here.arclength + step)
        except FAILURES:
            return None
        cosine = float(direction @ (weights * there.tangent)) / metric_length(
            weights, there.tangent
        )
        angle = math.acos(min(max(cosine, -1.0), 1.0))
        if angle > self.options.max_angle:
            return None
        if is_torus_curve(here.condition):
            cosine = cosine_near(there.orbit.multipliers, self._cosine)
            if abs(cosine - self._cosine) > TURN:  # a neutral saddle, or another pair
                return None
        touched = there.orbit.impacts != here.orbit.impacts
        grazes = isinstance(here.condition, Grazing)
        if touched and not grazes:
            self._obstacle = "the number of contacts changes"
            root = isinstance(here.condition, Singular) and not seen and grazes_linear(here.orbit)
            if root or step > self.options.grazing_step:
                return None
        return there, angle, miss

    def _why_short(self, here: BranchNode) -> StopReason:
        """Why no step is short enough."""
        if extremes_meet(here):
            return Ending.EXTREME_VANISHES.told()
        if isinstance(here.condition, BranchPointCondition) and nearest_depth(here.orbit) < MEETS:
            return Ending.CORNER.told()
        if isinstance(here.condition, Held) and here.condition.changes_extreme(here.orbit):
            return Ending.OTHER_EXTREME.told()
        near = max(GRAZES, self._slightest)
        return _grazes_rigid(here, -near, near) or self.too_short()

    def too_short(self) -> StopReason:
        """The reason to stop where no step leads on."""
        return Ending.SHORT_STEP.told(step=f"{self.options.min_step:g}", obstacle=self._obstacle)

    @property
    def _slightest(self) -> float:
        """Slightest impact with a rigid stop that is followed, its depth over the orbit's size."""
        return SLIGHTEST if self.start.family.is_exact else DIFFERENCED

    def _left_at_once(self) -> str:
        """Name of a parameter at the end of its range, beyond which the curve would begin."""
        charts, start = self.start.family.charts, self.start
        for which, chart in enumerate(charts):
            value = float(start.values[which])
            slope = float(start.tangent[start.family.n_states + which])
            if (slope < -ALONG and value <= chart.low) or (slope > ALONG and value >= chart.high):
                return str(chart.parameter.name)
        return ""

    def _limit_ahead(self, here: BranchNode, step: float) -> BranchNode | None:
        """Point at the end of a range, if a failed step would have passed it.

        Behind the end there may be no systems: no exponent below 1, no damping below zero.
        """
        for which, chart in enumerate(here.family.charts):
            place = here.family.n_states + which
            slope, limit = float(here.tangent[place]), chart.high
            if slope < 0.0:
                limit = chart.low
            ahead = (chart.coordinate(limit) - float(here.point[place])) / (slope or TINY)
            if not 0.0 < ahead <= step:
                continue
            end = on_plane(here, ahead * here.tangent, ahead, which, chart.coordinate(limit))
            if end is not None:
                weights = here.family.metric(here.point)
                off = metric_length(weights, end.point - here.point - ahead * here.tangent)
                if off <= self.options.max_angle * ahead:
                    self.stop_reason = Ending.PARAMETER_RANGE_END.told(
                        parameter=chart.parameter.name
                    )
                    return end
        return None

    def _scaled_to_rest(self, before: BranchNode, here: BranchNode) -> list[BranchNode] | None:
        """What ends the walk where orbits shrink in proportion to parameters whose ranges end at 0.

        They would do so for ever on the scale of their own size. It is rest, but where no orbit of
        the condition is found there; None if they do not.
        """
        family = here.family
        scaled = np.ones(here.point.size, dtype=bool)
        scaled[family.n_states :] = False
        for place, chart in enumerate(family.charts, family.n_states):
            scaled[place] = chart.low == 0.0
        (places,) = np.nonzero(scaled)
        names = [chart.parameter.name for chart in family.charts if chart.low == 0.0]
        if not names or here.tangent[places[-1]] >= 0.0:
            return None
        secant = (here.point - before.point) / (here.arclength - before.arclength)
        held = float(np.abs(secant[~scaled]).max(initial=0.0))
        if held > SCALES or not scales(here.point[scaled], secant[scaled]):
            return None
        self.stop_reason = Ending.SCALES_TO_REST.told(parameter=" and ".join(names))
        way = np.where(scaled, -here.point, 0.0)
        length = metric_length(family.metric(here.point), way)
        rest = on_plane(here, way, length, int(places[-1]) - family.n_states, 0.0)
        return [] if rest is None else [rest]

    def _end(self, here: BranchNode, there: BranchNode) -> list[BranchNode] | None:
        """The last points of the walk if it ends in this step."""
        charts = here.family.charts
        ends = []
        for which, chart in enumerate(charts):
            a, b = float(here.values[which]), float(there.values[which])
            if not chart.low <= b <= chart.high:
                limit = chart.low if b < chart.low else chart.high
                share = 1.0 if a == b else (limit - a) / (b - a)
                ends.append((share, which, limit))
        if ends:
            share, which, limit = min(ends)
            name = charts[which].parameter.name
            self.stop_reason = Ending.PARAMETER_RANGE_END.told(parameter=name)
            if share <= SLACK:
                return []
            end = on_chart_plane(here, there, which, limit)
            if end is None:
                self.stop_reason = Ending.NO_ORBIT_AT_RANGE_END.told(parameter=name)
                return []
            return [end]
        if isinstance(here.condition, BranchPointCondition) and abs(there.point[-1]) > UNFOLDED:
            self.stop_reason = Ending.DISSOLVED.told()
            return []
        if passed_flip(here, there):
            self.stop_reason = Ending.MEETS_HALF_PERIODS.told(period=here.orbit.period // 2)
            return []
        if is_torus_curve(here.condition) and not is_torus(there.orbit.multipliers):
            self.stop_reason = Ending.RESONANCE.told()
            return [there]
        if self._closed(here, there):
            self.stop_reason = Ending.CLOSED_CURVE.told()
            return [there]
        return None

    def _closed(self, a: BranchNode, b: BranchNode) -> bool:
        """Whether the walk from a to b passes the origin, in its direction."""
        origin = self.origin or self.start
        if b.arclength - origin.arclength < 3.0 * (b.arclength - a.arclength):
            return False
        weights = origin.family.metric(origin.point)
        step, way = b.point - a.point, origin.point - a.point
        length2 = float(step @ (weights * step))
        along = float(step @ (weights * way))
        if float(step @ (weights * origin.tangent)) <= 0.0 or not 0.0 <= along <= length2:
            return False
        off = way - along / length2 * step
        return float(off @ (weights * off)) < BESIDE_STEP * length2


def is_torus_curve(condition: Condition) -> bool:
    return isinstance(condition, Singular) and condition.kind == "NS"
