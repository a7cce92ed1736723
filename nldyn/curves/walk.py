"""Walking along a curve of orbits that meet a condition in one or two parameters."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from nldyn.base.arrays import SLACK, TINY, Real
from nldyn.base.errors import ConvergenceError, SystemModelError
from nldyn.bifurcations.period_doubling import passed_flip
from nldyn.branches.arclength import (
    BESIDE_STEP,
    FARTHEST_OFF,
    GRAZES,
    SLIGHTEST,
    grazes_rigid,
    loses_impact,
)
from nldyn.branches.endings import Ending, StopReason
from nldyn.branches.step_control import ContinuationOptions
from nldyn.curves.codimension_two import codimension_tests, cosine_near, is_torus, torus_cosine
from nldyn.orbits.bordered import (
    SHORTEST_DIFFERENCE,
    Condition,
    Corrected,
    Evaluation,
    Free,
    correct,
    gradient,
    nearest_depth,
    tangent_surface,
)
from nldyn.orbits.conditions import Both, BranchPointCondition, Grazing, Held, Singular
from nldyn.orbits.extremes import nearest
from nldyn.orbits.impact_phases import nodes_to_impacts, start_far_from_impacts
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import FROM_NEAR, metric_length
from nldyn.system.chart import Chart
from nldyn.system.rigid_stop import is_linear

UNFOLDED = 1e-6  # unfolding number from which a branch point has dissolved
MEETING = 1e-9  # arclength within which a curve and a grazing meet
MOST_SECANTS = 20
MEETS = 1e-6  # depth, relative to the orbit, of an extreme that one of depth zero is about to meet
BEHIND = (1e-5, 1e-6, 1e-7)  # extremes, relative to the orbit, of a first point behind a corner
ALONG = 1e-12  # part of a unit tangent that is rounding
AT_POINT = 1e-6  # share of a step within which two points are one
CORNER_STEP = 1e-3  # a step shorter than this may have met a corner
NEAR_NODE = 0.3  # rad from an impact to a phase of shooting that it may pass in the next step
MOST_BENT = 3.0  # times that neighbours may lie apart farther than their arclength says
FASTEST = 20.0  # change of an impact's phase with the arclength, at most, in rad
CLEAR_OF_NODES = 3e-3  # rad from an impact to one, from which derivatives do not reach across it
SHARES = (1.0, 0.8, 0.6, 0.4, 0.25)  # of a step that leads over a phase of shooting
# The condition of a Neimark-Sacker point holds for neutral saddles, too, and some may be near: the
# cosine of the pair's angle changes by no more than this from point to point.
TURN = 0.1
STRAIGHT_AHEAD = 0.9  # cosine of the way to a corner and the tangent


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """An orbit on a curve.

    Parameters
    ----------
    found : Corrected
        The solution.
    condition : Condition
        The condition that it meets, with borders of its own.
    tangent : (N + m,) array
        Unit tangent in the family's metric.
    arclength : float
        Relative arclength from the start.
    corner : str
        Kind of the mark where the curve has a corner at a grazing point, else empty.
    """

    found: Corrected
    condition: Condition
    tangent: Real
    arclength: float

    corner: str = ""

    @property
    def point(self) -> Real:
        """Unknowns of the family."""
        return self.found.at.point

    @property
    def values(self) -> Real:
        """Values of the parameters."""
        return self.found.at.values

    @property
    def orbit(self) -> Orbit:
        """The orbit."""
        return self.found.orbit

    @cached_property
    def residual(self) -> float:
        """Largest of the relative error of closing and the condition."""
        return self.found.residual(self.condition)

    @cached_property
    def tests(self) -> dict[str, float]:
        """Test functions of what may be met on the curve."""
        one = isinstance(self.condition, Free)
        return codimension_tests(
            self.condition, self.found.at, float(self.tangent[-1]) if one else None
        )

    def on_charts(self, charts: tuple[Chart, ...]) -> CurvePoint:
        """The same point with its parameters on the scales of other ranges."""
        at = self.found.at
        n, point, tangent = at.family.n_states, self.point.copy(), self.tangent.copy()
        for place, (old, new) in enumerate(zip(at.family.charts, charts, strict=True), n):
            value = old.value(float(point[place]))
            tangent[place] *= old.slope(float(point[place]))
            point[place] = new.coordinate(value)
            tangent[place] /= new.slope(float(point[place]))
        family = replace(at.family, charts=charts)
        tangent /= metric_length(family.metric(point), tangent)
        found = replace(self.found, at=Evaluation(family, point))
        return replace(self, found=found, tangent=tangent)

    def shot_from(self, start: float) -> CurvePoint:
        """The same point with the states of its unknowns at other phases.

        Raises
        ------
        ConvergenceError
            If the flow map fails, or there is no tangent.
        """
        at = self.found.at
        family = replace(at.family, start=start)
        found = replace(self.found, at=family.at(family.unknowns(self.orbit)))
        towards = np.zeros(self.tangent.size)
        towards[family.n_states :] = self.tangent[family.n_states :]
        return curve_point(found, self.condition.renewed(found.at), towards, self.arclength)

    def reversed(self) -> CurvePoint:
        """The same point of the curve run through the other way."""
        return replace(self, tangent=-self.tangent, arclength=-self.arclength)


def curve_point(
    found: Corrected, condition: Condition, towards: Real, arclength: float
) -> CurvePoint:
    """Curve point from a solution, its tangent on the side of a vector."""
    weighted = found.at.family.metric(found.at.point) * found.along
    length = math.sqrt(float(found.along @ weighted))
    if float(towards @ weighted) < 0.0:
        length = -length
    renewed, along = condition.renewed(found.at), found.along
    if isinstance(renewed, Grazing):  # whose rigid stop is passed where the extreme is now
        family = found.at.family.past(renewed.passage)
        found = replace(found, at=Evaluation(family, found.at.point))
    return CurvePoint(found, renewed, along / length, arclength)


def on_chart_plane(a: CurvePoint, b: CurvePoint, which: int, value: float) -> CurvePoint | None:
    """Point of the curve between a and b at which a parameter has a value."""
    start = a.found.at.family.start
    a, b = clear_of_nodes(a, b)
    found = _on_chart_plane(a, b, which, value)
    return found if found is None or a.found.at.family.start == start else found.shot_from(start)


def _on_chart_plane(a: CurvePoint, b: CurvePoint, which: int, value: float) -> CurvePoint | None:
    family = a.found.at.family
    place = family.n_states + which
    if a.point[place] == b.point[place]:
        return None
    target = family.charts[which].coordinate(value)
    share = (target - float(a.point[place])) / float(b.point[place] - a.point[place])
    way = between(a, b, share) - a.point
    return _on_plane(a, way, share * (b.arclength - a.arclength), which, target)


def clear_of_nodes(a: CurvePoint, b: CurvePoint) -> tuple[CurvePoint, CurvePoint]:
    """Two neighbours, by their states at other phases where an impact passes one between them."""
    family = a.found.at.family
    apart = metric_length(family.metric(a.point), b.point - a.point)
    if apart < MOST_BENT * abs(b.arclength - a.arclength) or nodes_to_impacts(a.orbit) > NEAR_NODE:
        return a, b
    start = start_far_from_impacts(a.orbit)
    return a.shot_from(start), b.shot_from(start)


def passages(points: Iterable[CurvePoint], which: int, value: float) -> Iterator[CurvePoint]:
    """Points behind the first at which a curve has a value of a parameter, two in a step or three.

    A step has them where the cubic through its ends, with their tangents, says.
    """
    for pair in pairwise(points):
        a, b = clear_of_nodes(*pair)
        family = a.found.at.family
        place, span = family.n_states + which, b.arclength - a.arclength
        target = family.charts[which].coordinate(value)
        y, end = float(a.point[place]) - target, float(b.point[place]) - target
        slope, last = span * float(a.tangent[place]), span * float(b.tangent[place])
        cubic = [2.0 * (y - end) + slope + last, 3.0 * (end - y) - 2.0 * slope - last, slope, y]
        shares = np.roots(cubic)
        shares = np.sort(shares.real[np.abs(shares.imag) < AT_POINT])
        met: list[CurvePoint] = []
        for share in shares[(shares > AT_POINT) & (shares <= 1.0 + AT_POINT)].tolist():
            way = between(a, b, share) - a.point
            there = _on_plane(a, way, share * span, which, target)
            if there is None:
                continue
            away = [
                metric_length(family.metric(a.point), there.point - other.point) for other in met
            ]
            if min(away, default=math.inf) > AT_POINT * span:
                met.append(there)
                yield there


def between(a: CurvePoint, b: CurvePoint, x: float) -> Real:
    """Unknowns at a share of the way from a to b, by cubic interpolation with the tangents."""
    span = b.arclength - a.arclength
    return np.asarray(
        (1.0 + 2.0 * x) * (1.0 - x) ** 2 * a.point
        + x * (1.0 - x) ** 2 * span * a.tangent
        + x * x * (3.0 - 2.0 * x) * b.point
        + x * x * (x - 1.0) * span * b.tangent
    )


def _on_plane(
    a: CurvePoint, way: Real, length: float, which: int, coordinate: float
) -> CurvePoint | None:
    """Point of the curve near the end of a way from a, where a parameter has a coordinate."""
    guess = a.point + way
    row = np.zeros(guess.size)
    row[a.found.at.family.n_states + which] = 1.0
    found = correct(a.found.at.family, guess, a.condition, row, coordinate)
    if not found.converged:
        return None
    try:
        return curve_point(found, a.condition, way, a.arclength + length)
    except ConvergenceError:
        return None


def corner_ahead(here: CurvePoint, options: ContinuationOptions) -> list[CurvePoint]:
    """The grazing point close ahead at which a curve has a corner, with its tangent behind it.

    The derivative of the monodromy matrix jumps at a grazing, and with it the direction of a
    curve on which a condition of that matrix holds. At a linear stop it is that of a root: the
    curve leaves along the grazings, and a point behind the corner comes with it.
    """
    if not isinstance(here.condition, Singular):
        return []
    try:
        grazing = Grazing.of(here.orbit)
        family = here.found.at.family
        linear = is_linear(here.orbit.system.stops[grazing.stop])
        if linear:
            found = _meeting(here.found.at, here.condition, grazing, 10.0 * CORNER_STEP)
        else:
            found = correct(family, here.point, Both(here.condition, grazing), max_iterations=25)
        if found is None or not found.converged:
            return []
        weights = family.metric(here.point)
        way = found.at.point - here.point
        length = metric_length(weights, way)
        ahead = float(way @ (weights * here.tangent)) > STRAIGHT_AHEAD * length
        if not (ahead and length < 10.0 * options.grazing_step):
            return []
        before = float(grazing.value(here.found.at)[0])
        condition = here.condition.renewed(found.at)
        kind = f"GR{here.condition.kind}"
        corner = CurvePoint(found, condition, here.tangent, here.arclength + length, kind)
        if linear:
            side = -math.copysign(1.0, before)
            behind = _behind(corner, grazing, side, 2.0 * options.max_step)
            if behind is not None:
                chord = behind.point - corner.point
                tangent = chord / metric_length(family.metric(corner.point), chord)
                return [replace(corner, tangent=tangent), behind]
        tangent = _tangent_behind(found.at, here.condition, grazing, before < 0.0)
        return [replace(corner, tangent=tangent)]
    except (ConvergenceError, SystemModelError, np.linalg.LinAlgError):
        return []


def _behind(
    corner: CurvePoint, grazing: Grazing, side: float, farthest: float
) -> CurvePoint | None:
    """A point of a curve a little behind a grazing of a linear stop, or None."""
    at, condition = corner.found.at, corner.condition
    family = at.family
    for depth in BEHIND:
        try:
            met = _meeting(at, condition, replace(grazing, depth=side * depth), farthest)
        except (ConvergenceError, SystemModelError, np.linalg.LinAlgError):
            continue
        if met is None:
            continue
        chord = met.at.point - at.point
        weights = family.metric(at.point)
        length = metric_length(weights, chord)
        row = weights * chord / np.linalg.norm(weights * chord)
        found = correct(family, met.at.point, condition, row, float(row @ met.at.point))
        moved = metric_length(weights, found.at.point - met.at.point)
        if found.converged and moved < CORNER_STEP * length and length < farthest:
            return curve_point(found, condition, chord, corner.arclength + length)
    return None


def _meeting(
    start: Evaluation, condition: Condition, grazing: Grazing, farthest: float
) -> Corrected | None:
    """The orbit on a curve of special points with a given extreme of a linear stop, or None.

    The condition of the curve has the slope of a root where an extreme is zero, over which Newton's
    method steps to and fro. So it is followed along the orbits with that extreme, where it is
    smooth, by the secant method.
    """
    family = start.family
    _, surface = tangent_surface(start)
    along = surface @ np.linalg.svd(gradient(start, surface, grazing))[2][-1]
    row = family.metric(start.point) * along
    row /= np.linalg.norm(row)
    level, pace = float(row @ start.point), float(row @ along)
    here = correct(family, start.point, grazing, row, level)
    if not here.converged:
        return None
    reach = max(
        metric_length(family.metric(start.point), here.at.point - start.point), 10.0 * MEETING
    )
    place, value, step = 0.0, float(condition.value(here.at)[0]), reach
    for _ in range(MOST_SECANTS):
        there = correct(
            family, here.at.point + step * along, grazing, row, level + pace * (place + step)
        )
        if not there.converged:
            return None
        before, value = value, float(condition.value(there.at)[0])
        here, place = there, place + step
        if value == before:
            return None
        step *= -value / (value - before)
        if abs(step) < MEETING:
            return here
        if abs(place + step) > farthest:
            return None
    return None


def extremes_meet(here: CurvePoint) -> bool:
    """Whether the next extreme of the other kind is as near to zero as the one that grazes."""
    grazing = here.condition
    if not isinstance(grazing, Grazing):
        return False
    found, full = here.orbit.touches(grazing.stop), 2.0 * math.pi * here.orbit.period
    other = nearest(found.phases, found.is_maximum, not grazing.is_maximum, grazing.phase, full)
    return bool(other >= 0 and abs(found.values[other]) < MEETS * grazing.unit)


def _grazes_linear(orbit: Orbit) -> bool:
    """Whether the extreme nearest to zero is one of a linear stop."""
    try:
        return is_linear(orbit.system.stops[Grazing.of(orbit).stop])
    except SystemModelError:
        return False


def _tangent_behind(at: Evaluation, condition: Condition, grazing: Grazing, deep: bool) -> Real:
    """Unit tangent of a curve on the side of a grazing where the extreme is positive, or not."""
    _, surface = tangent_surface(at)
    by_surface = gradient(at, surface, grazing)
    slopes = by_surface[0] if deep else -by_surface[0]
    across = slopes / np.linalg.norm(slopes)
    beside = np.array([-across[1], across[0]])
    # both legs of the differences lead to the same side of the grazing
    legs = [surface @ (across + sign * 0.5 * beside) for sign in (-1.0, 1.0)]
    h = 10.0 * SHORTEST_DIFFERENCE
    g = [
        (condition.value(at.family.at(at.point + h * leg)) - condition.value(at))[0] for leg in legs
    ]
    by_beside, by_across = g[1] - g[0], 0.5 * (g[0] + g[1])
    tangent = surface @ (by_beside * across - by_across * beside)
    return np.asarray(tangent / math.copysign(math.hypot(by_beside, by_across), by_beside))


def _grazes_rigid(here: CurvePoint, least: float, most: float) -> StopReason | None:
    """The reason to stop, if the slightest impact with a rigid stop, or nearest miss, is so deep.

    Both bounds are shares of the orbit's size; that of a curve of grazings is its own.
    """
    condition, orbit = here.condition, here.orbit
    but = None
    if isinstance(condition, Grazing):

        def but(stop: int, phase: float) -> bool:
            return condition.is_of(stop, True, phase, orbit.period)

    return grazes_rigid(orbit, least, most, but)


@dataclass
class CurveWalk:
    """Iterator over the points of a curve in one direction, as `Stepper` is over a branch's.

    Parameters
    ----------
    start : CurvePoint
        First point, yielded first; its tangent gives the direction.
    options : ContinuationOptions
        Step control.
    origin : CurvePoint, optional
        Where the curve closes, in its direction; the start unless given.
    """

    start: CurvePoint
    options: ContinuationOptions
    origin: CurvePoint | None = None
    stop_reason: StopReason = field(default_factory=Ending.NOT_FINISHED.told)
    _cosine: float = field(default=math.nan, init=False, repr=False)  # of a pair on the circle
    _obstacle: str = field(default="", init=False, repr=False)

    def __iter__(self) -> Iterator[CurvePoint]:
        """Walk along the curve."""
        here, step = self.start, self.options.first_step
        curvature = np.zeros(here.tangent.size)
        if is_torus_curve(here.condition):
            self._cosine = torus_cosine(here.orbit.multipliers)
        yield here
        if left := self._left_at_once():
            self.stop_reason = Ending.PARAMETER_RANGE_END.told(parameter=left)
            return
        ahead: list[CurvePoint] = []  # a corner, and what is behind it
        for _ in range(self.options.max_points):
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
            if grazes := _grazes_rigid(there, 0.0, SLIGHTEST):
                self.stop_reason = grazes
                return
            if is_torus_curve(there.condition):
                self._cosine = cosine_near(there.orbit.multipliers, self._cosine)
            curvature = (there.tangent - here.tangent) / (there.arclength - here.arclength)
            if there.corner or clear_of_nodes(here, there)[0] is not here:
                curvature = np.zeros(here.tangent.size)
            here = there
            step = self.options.next_step(step, angle, miss)
        self.stop_reason = Ending.MOST_POINTS.told(points=self.options.max_points)

    def _advance(
        self, here: CurvePoint, curvature: Real, step: float, seen: bool
    ) -> tuple[CurvePoint, float, float] | None:
        """Next point, also where an impact passes a phase of shooting; see `_straight_on`."""
        attempt = self._straight_on(here, curvature, step, seen)
        if attempt is not None and nodes_to_impacts(attempt[0].orbit) > CLEAR_OF_NODES:
            return attempt
        if not nodes_to_impacts(here.orbit) < min(NEAR_NODE, FASTEST * step):
            return attempt
        try:
            shot = here.shot_from(start_far_from_impacts(here.orbit))
            none = np.zeros(here.tangent.size)
            for share in SHARES:
                beyond = self._straight_on(shot, none, share * step, seen)
                if beyond is not None:
                    there = beyond[0].shot_from(0.0)
                    if nodes_to_impacts(there.orbit) > CLEAR_OF_NODES:
                        return there, *beyond[1:]
        except (ConvergenceError, SystemModelError, np.linalg.LinAlgError):
            pass
        return attempt

    def _straight_on(
        self, here: CurvePoint, curvature: Real, step: float, seen: bool
    ) -> tuple[CurvePoint, float, float] | None:
        """Next point, its angle to this one and its relative distance from the predictor.

        None when the step must be shorter. Where no corner was seen yet, none of a linear stop is
        stepped over: beside it another piece of the curve may lie straight ahead.
        """
        family = here.found.at.family
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
        if family.passage is None and loses_impact(found.orbit):
            return None
        miss = metric_length(weights, found.at.point - predicted) / step
        off = metric_length(weights, found.at.point - straight)
        if miss > self.options.max_miss or off > FARTHEST_OFF * self.options.max_angle * step:
            return None
        try:
            there = curve_point(found, here.condition, direction, here.arclength + step)
        except ConvergenceError:
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
            root = isinstance(here.condition, Singular) and not seen and _grazes_linear(here.orbit)
            if root or step > self.options.grazing_step:
                return None
        return there, angle, miss

    def _why_short(self, here: CurvePoint) -> StopReason:
        """Why no step is short enough."""
        if extremes_meet(here):
            return Ending.EXTREME_VANISHES.told()
        if isinstance(here.condition, BranchPointCondition) and nearest_depth(here.orbit) < MEETS:
            return Ending.CORNER.told()
        if isinstance(here.condition, Held) and here.condition.changes_extreme(here.orbit):
            return Ending.OTHER_EXTREME.told()
        short = Ending.SHORT_STEP.told(step=f"{self.options.min_step:g}", obstacle=self._obstacle)
        return _grazes_rigid(here, -GRAZES, GRAZES) or short

    def _left_at_once(self) -> str:
        """Name of a parameter at the end of its range, beyond which the curve would begin."""
        charts, start = self.start.found.at.family.charts, self.start
        for which, chart in enumerate(charts):
            value = float(start.values[which])
            slope = float(start.tangent[start.found.at.family.n_states + which])
            if (slope < -ALONG and value <= chart.low) or (slope > ALONG and value >= chart.high):
                return str(chart.parameter.name)
        return ""

    def _limit_ahead(self, here: CurvePoint, step: float) -> CurvePoint | None:
        """Point at the end of a range, if a failed step would have passed it.

        Behind the end there may be no systems: no exponent below 1, no damping below zero.
        """
        for which, chart in enumerate(here.found.at.family.charts):
            place = here.found.at.family.n_states + which
            slope, limit = float(here.tangent[place]), chart.high
            if slope < 0.0:
                limit = chart.low
            ahead = (chart.coordinate(limit) - float(here.point[place])) / (slope or TINY)
            if not 0.0 < ahead <= step:
                continue
            end = _on_plane(here, ahead * here.tangent, ahead, which, chart.coordinate(limit))
            if end is not None:
                weights = here.found.at.family.metric(here.point)
                off = metric_length(weights, end.point - here.point - ahead * here.tangent)
                if off <= self.options.max_angle * ahead:
                    self.stop_reason = Ending.PARAMETER_RANGE_END.told(
                        parameter=chart.parameter.name
                    )
                    return end
        return None

    def _end(self, here: CurvePoint, there: CurvePoint) -> list[CurvePoint] | None:
        """The last points of the walk if it ends in this step."""
        charts = here.found.at.family.charts
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
        if passed_flip(here.orbit, there.orbit):
            self.stop_reason = Ending.MEETS_HALF_PERIODS.told(period=here.orbit.period // 2)
            return []
        if is_torus_curve(here.condition) and not is_torus(there.orbit.multipliers):
            self.stop_reason = Ending.RESONANCE.told()
            return [there]
        if self._closed(here, there):
            self.stop_reason = Ending.CLOSED_CURVE.told()
            return [there]
        return None

    def _closed(self, a: CurvePoint, b: CurvePoint) -> bool:
        """Whether the walk from a to b passes the origin, in its direction."""
        origin = self.origin or self.start
        if b.arclength - origin.arclength < 3.0 * (b.arclength - a.arclength):
            return False
        weights = origin.found.at.family.metric(origin.point)
        step, way = b.point - a.point, origin.point - a.point
        length2 = float(step @ (weights * step))
        along = float(step @ (weights * way))
        if float(step @ (weights * origin.tangent)) <= 0.0 or not 0.0 <= along <= length2:
            return False
        off = way - along / length2 * step
        return float(off @ (weights * off)) < BESIDE_STEP * length2


def is_torus_curve(condition: Condition) -> bool:
    return isinstance(condition, Singular) and condition.kind == "NS"
