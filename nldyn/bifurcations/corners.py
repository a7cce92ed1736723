"""Corners of curves of special points, where an extreme grazes a stop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES, SystemModelError
from nldyn.bifurcations.point import BranchNode, node_of
from nldyn.orbits.bordered import (
    SHORTEST_DIFFERENCE,
    Condition,
    Corrected,
    Evaluation,
    correct,
    gradient,
    tangent_surface,
)
from nldyn.orbits.conditions import Both, Grazing, Singular
from nldyn.orbits.extremes import nearest
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import metric_length

MEETING = 1e-9  # arclength within which a curve and a grazing meet
MOST_SECANTS = 20
MEETS = 1e-6  # depth, relative to the orbit, of an extreme that one of depth zero is about to meet
BEHIND = (1e-5, 1e-6, 1e-7)  # extremes, relative to the orbit, of a first point behind a corner
CORNER_STEP = 1e-3  # a step shorter than this may have met a corner
STRAIGHT_AHEAD = 0.9  # cosine of the way to a corner and the tangent


def corner_ahead(here: BranchNode, grazing_step: float, max_step: float) -> list[BranchNode]:
    """The grazing point close ahead at which a curve has a corner, with its tangent behind it.

    The derivative of the monodromy matrix jumps at a grazing, and with it the direction of a
    curve on which a condition of that matrix holds. At a linear stop it is that of a root: the
    curve leaves along the grazings, and a point behind the corner comes with it.
    """
    if not isinstance(here.condition, Singular):
        return []
    try:
        grazing = Grazing.of(here.orbit)
        family = here.family
        linear = here.orbit.system.stops[grazing.stop].is_linear
        if linear:
            found = _meeting(here.at, here.condition, grazing, 10.0 * CORNER_STEP)
        else:
            found = correct(family, here.point, Both(here.condition, grazing), max_iterations=25)
        if found is None or not found.converged:
            return []
        weights = here.weights
        way = found.at.point - here.point
        length = metric_length(weights, way)
        ahead = float(way @ (weights * here.tangent)) > STRAIGHT_AHEAD * length
        if not (ahead and length < 10.0 * grazing_step):
            return []
        before = float(grazing.value(here.at)[0])
        condition = here.condition.renewed(found.at)
        kind = f"GR{here.condition.kind}"
        corner = BranchNode(
            family, found.point, found.orbit, here.tangent, here.arclength + length,
            condition=condition, corner=kind,
        )  # fmt: skip
        if linear:
            side = -math.copysign(1.0, before)
            behind = _behind(corner, grazing, side, 2.0 * max_step)
            if behind is not None:
                chord = behind.point - corner.point
                tangent = chord / metric_length(corner.weights, chord)
                return [replace(corner, tangent=tangent), behind]
        tangent = _tangent_behind(found.at, here.condition, grazing, before < 0.0)
        return [replace(corner, tangent=tangent)]
    except FAILURES:
        return []


def _behind(
    corner: BranchNode, grazing: Grazing, side: float, farthest: float
) -> BranchNode | None:
    """A point of a curve a little behind a grazing of a linear stop, or None."""
    at, condition = corner.at, corner.condition
    family = at.family
    for depth in BEHIND:
        try:
            met = _meeting(at, condition, replace(grazing, depth=side * depth), farthest)
        except FAILURES:
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
            return node_of(found, chord, corner.arclength + length)
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


def extremes_meet(here: BranchNode, within: float = MEETS) -> bool:
    """Whether the next extreme of the other kind is as near to zero as the one that grazes."""
    grazing = here.condition
    if not isinstance(grazing, Grazing):
        return False
    orbit, full = here.orbit, 2.0 * math.pi * here.orbit.period
    other = nearest(orbit.touched, grazing.stop, not grazing.is_maximum, grazing.phase, full)
    return other is not None and abs(float(other[1])) < within * grazing.unit


def grazes_linear(orbit: Orbit) -> bool:
    """Whether the extreme nearest to zero is one of a linear stop."""
    try:
        return orbit.system.stops[Grazing.of(orbit).stop].is_linear
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
