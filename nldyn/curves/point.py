"""A point of a curve, and points between two neighbours."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES
from nldyn.curves.codimension_two import codimension_tests
from nldyn.orbits.bordered import Condition, Corrected, Evaluation, OrbitFamily, correct
from nldyn.orbits.conditions import Grazing
from nldyn.orbits.impact_phases import nodes_to_impacts, start_far_from_impacts
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import metric_length
from nldyn.system.chart import Chart

AT_POINT = 1e-6  # share of a step within which two points are one
NEAR_NODE = 0.3  # rad from an impact to a phase of shooting that it may pass in the next step
MOST_BENT = 3.0  # times that neighbours may lie apart farther than their arclength says


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
    def family(self) -> OrbitFamily:
        """The family."""
        return self.found.at.family

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
        return codimension_tests(self.condition, self.found.at)

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
        family = at.family.shot_from(start)
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
        family = found.at.family.past(renewed.passages)
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
    return on_plane(a, way, share * (b.arclength - a.arclength), which, target)


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
            there = on_plane(a, way, share * span, which, target)
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


def on_plane(
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
    except FAILURES:
        return None
