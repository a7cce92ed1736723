"""Points of a curve in two parameters, and those between two neighbours."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from nldyn.base.arrays import Real, hermite
from nldyn.base.errors import FAILURES
from nldyn.bifurcations.codimension_two import codimension_tests
from nldyn.bifurcations.point import BranchNode, node_of
from nldyn.orbits.bordered import Corrected, correct
from nldyn.orbits.impact_phases import nodes_to_impacts, start_far_from_impacts
from nldyn.orbits.shooting import metric_length

AT_POINT = 1e-6  # share of a step within which two points are one
FARTHEST_NODE = 0.3  # rad from an impact to a phase of shooting that it may pass in the next step
MOST_BENT = 3.0  # times that neighbours may lie apart farther than their arclength says


def curve_tests(node: BranchNode) -> dict[str, float]:
    """Test functions of what may be met on a curve, computed once for each point."""
    if not node.tests:
        node.tests.update(codimension_tests(node.condition, node.at))
    return node.tests


def shot_from(node: BranchNode, start: float) -> BranchNode:
    """The same point with the states of its unknowns at other phases.

    Raises
    ------
    ConvergenceError
        If the flow map fails, or there is no tangent.
    """
    family = node.family.shot_from(start)
    at = family.at(family.unknowns(node.orbit))
    condition = node.condition.renewed(at)
    found = Corrected(at, condition, node.orbit.error, 0, "")
    towards = np.zeros(node.tangent.size)
    towards[family.n_states :] = node.tangent[family.n_states :]
    return node_of(found, towards, node.arclength)


def on_chart_plane(a: BranchNode, b: BranchNode, which: int, value: float) -> BranchNode | None:
    """Point of the curve between a and b at which a parameter has a value."""
    start = a.family.start
    a, b = clear_of_nodes(a, b)
    found = _on_chart_plane(a, b, which, value)
    return found if found is None or a.family.start == start else shot_from(found, start)


def _on_chart_plane(a: BranchNode, b: BranchNode, which: int, value: float) -> BranchNode | None:
    place, target = a.family.n_states + which, a.family.charts[which].coordinate(value)
    if a.point[place] == target or a.point[place] == b.point[place]:
        return None
    share = (target - a.point[place]) / (b.point[place] - a.point[place])
    length = a.arclength + share * (b.arclength - a.arclength)
    for guess in ((1.0 - share) * a.point + share * b.point, between(a, b, share)):
        found = _held(a, guess, a.tangent, length, which, target)
        if found is not None:
            return found
    return None


def clear_of_nodes(a: BranchNode, b: BranchNode) -> tuple[BranchNode, BranchNode]:
    """Two neighbours, by their states at other phases where an impact passes one between them."""
    apart = metric_length(a.weights, b.point - a.point)
    smooth = apart < MOST_BENT * abs(b.arclength - a.arclength)
    if smooth or nodes_to_impacts(a.orbit) > FARTHEST_NODE:
        return a, b
    start = start_far_from_impacts(a.orbit)
    return shot_from(a, start), shot_from(b, start)


def met_on_curve(points: Sequence[BranchNode], which: int, value: float) -> list[BranchNode]:
    """Points at which a curve has a value of a parameter, its first one with the others."""
    first = math.isclose(float(points[0].values[which]), value)
    return [*points[:first], *passages(points, which, value)]


def passages(points: Iterable[BranchNode], which: int, value: float) -> Iterator[BranchNode]:
    """Points behind the first at which a curve has a value of a parameter, two in a step or three.

    A step has them where the cubic through its ends, with their tangents, says.
    """
    for pair in pairwise(points):
        a, b = clear_of_nodes(*pair)
        family = a.family
        place, span = family.n_states + which, b.arclength - a.arclength
        target = family.charts[which].coordinate(value)
        y, end = float(a.point[place]) - target, float(b.point[place]) - target
        slope, last = span * float(a.tangent[place]), span * float(b.tangent[place])
        cubic = [2.0 * (y - end) + slope + last, 3.0 * (end - y) - 2.0 * slope - last, slope, y]
        shares = np.roots(cubic)
        shares = np.sort(shares.real[np.abs(shares.imag) < AT_POINT])
        met: list[BranchNode] = []
        for share in shares[(shares > AT_POINT) & (shares <= 1.0 + AT_POINT)].tolist():
            way = between(a, b, share) - a.point
            there = on_plane(a, way, share * span, which, target)
            if there is None:
                continue
            away = [metric_length(a.weights, there.point - other.point) for other in met]
            if min(away, default=math.inf) > AT_POINT * span:
                met.append(there)
                yield there


def between(a: BranchNode, b: BranchNode, x: float) -> Real:
    """Unknowns at a share of the way from a to b, by cubic interpolation with the tangents."""
    span = b.arclength - a.arclength
    return hermite(x, a.point, b.point, span * a.tangent, span * b.tangent)


def on_plane(
    a: BranchNode, way: Real, length: float, which: int, coordinate: float
) -> BranchNode | None:
    """Point of the curve near the end of a way from a, where a parameter has a coordinate."""
    return _held(a, a.point + way, way, a.arclength + length, which, coordinate)


def _held(
    a: BranchNode, guess: Real, towards: Real, arclength: float, which: int, coordinate: float
) -> BranchNode | None:
    """Point of the curve near a guess, where a parameter has a coordinate."""
    row = np.zeros(guess.size)
    row[a.family.n_states + which] = 1.0
    guess[a.family.n_states + which] = coordinate
    found = correct(a.family, guess, a.condition, row, coordinate, like=a.orbit.motion)
    if not found.converged:
        return None
    try:
        return node_of(found, towards, arclength)
    except FAILURES:
        return None
