"""Special points met along curves in two parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nldyn.base.errors import FAILURES
from nldyn.bifurcations.chord import BESIDE, Chord
from nldyn.bifurcations.codimension_two import is_torus, is_torus_curve, torus_pair
from nldyn.bifurcations.on_curve import between, clear_of_nodes, curve_tests
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.bifurcations.roots import root
from nldyn.bifurcations.self_excited import corner_error
from nldyn.bifurcations.sign_changes import leaves_circle
from nldyn.bifurcations.touching import Touch, touching_extremes
from nldyn.orbits.bordered import Condition, Corrected, correct, length_unit
from nldyn.orbits.conditions import UNFOLDED, Both, BranchPointCondition, Grazing, Singular, Turning

POLE = 1e-3  # of its values beside it: what a test is not below where it has no root but a pole
NOISY = 0.1  # the same for a coefficient made of differences, whose rounding is a hundredth of them
ALIKE = 1e-6  # share of a step within which touches are those of one orbit by symmetry
FLAT = 1e-10  # part of a unit tangent along the parameter of limit cycles that is rounding
TURNS_BACK = 1e-3  # part of a unit tangent along both parameters, at a cusp


def without_direction(found: Corrected, arclength: float) -> BranchNode:
    """A solution of a defining system, of which no branch is followed."""
    none = np.zeros(found.point.size)
    return BranchNode(
        found.family, found.point, found.orbit, none, arclength, condition=found.condition
    )


def marks_between(a: BranchNode, b: BranchNode) -> tuple[list[SpecialPoint], list[str]]:
    """What is met between two neighbouring points of a curve, in order, and what may be missing."""
    if not (np.any(a.orbit.point[:-1]) and np.any(b.orbit.point[:-1])):
        return [], []  # from rest on, of which the others are multiples
    start = a.family.start
    a, b = clear_of_nodes(a, b)
    chord, span = Chord(a, b), abs(b.arclength - a.arclength)
    found: list[tuple[float, SpecialPoint]] = []
    notes: list[str] = []
    jumps = isinstance(a.condition, Turning) and bool(a.corner or b.corner)
    for name in [] if jumps else _changes_of_sign(a, b):
        try:
            if name == "LP" and isinstance(a.condition, Turning) and _keeps_parameter(chord):
                continue
            sigma, error = root(lambda x, name=name: curve_tests(chord.at(x))[name])  # type: ignore[misc]
            point = chord.at(sigma)
            least = NOISY if name == "GPD" else POLE
            before, here, after = (abs(curve_tests(node)[name]) for node in (a, point, b))
            if here > least * max(before, after):
                if name != "GPD":  # whose coefficient has a pole where a flip meets a fold
                    notes.append(_missing(name, a, "its test jumps there"))
                continue
            if name == "LP" and isinstance(a.condition, Turning) and not turns_back(a, b):
                name = "BP"
            if _is_true(name, point):
                found.append((sigma, SpecialPoint(name, point, error * span)))
        except FAILURES as error:
            notes.append(_missing(name, a, error))
    for touches in _touches(a, b):
        try:
            found.append(_touched(touches, chord))
        except FAILURES as error:
            notes.append(_missing(_touch_name(a.condition), a, error))
    if b.corner:
        found.append((1.0, SpecialPoint(b.corner, b, corner_error(a, b))))
    found.sort(key=lambda pair: pair[0])
    return [_shot_from(mark, start) for _, mark in found], notes


def _shot_from(mark: SpecialPoint, start: float) -> SpecialPoint:
    """A mark by the states at the phases of shooting of its curve."""
    node = mark.point
    if node.family.start == start:
        return mark
    family = node.family.shot_from(start)
    at = family.at(family.unknowns(node.orbit))
    condition, none = node.condition.renewed(at), np.zeros(at.point.size)
    point = replace(node, family=family, point=at.point, tangent=none, condition=condition)
    return replace(mark, point=point)


def _touched(touches: Sequence[Touch], chord: Chord) -> tuple[float, SpecialPoint]:
    """Where a stop is touched between two points of a curve.

    At a branch point the curve may have a corner there, before which Newton's method on planes
    steps to and fro; then it is sought with both conditions.

    Raises
    ------
    LocateError, ConvergenceError
        If none of the touches, which are alike, is found.
    """
    name, touch = _touch_name(chord.first.condition), touches[0]
    try:
        sigma, error = root(lambda x: touch.depth(chord.at(x)))
        length = chord.last.arclength - chord.first.arclength
        return sigma, SpecialPoint(name, chord.at(sigma), error * abs(length))
    except FAILURES:
        for other in touches:
            met = _met_at_touch(name, chord, other)
            if met is not None:
                return met
        raise


def _met_at_touch(name: str, chord: Chord, touch: Touch) -> tuple[float, SpecialPoint] | None:
    """The point where a stop is touched, by Newton's method for both conditions."""
    a, b = chord.first, chord.last
    family, guess = a.family, between(a, b, _share(touch, a, b))
    grazing = Grazing(touch.output, touch.is_maximum, touch.phase, length_unit(a.orbit))
    both = Both(a.condition, grazing)
    found = correct(family, guess, both, max_iterations=25)
    weights, way = a.weights, b.point - a.point
    sigma = float((found.at.point - a.point) @ (weights * way) / (way @ (weights * way)))
    if not (found.converged and 0.0 <= sigma <= 1.0):
        return None
    if isinstance(a.condition, BranchPointCondition) and abs(found.at.point[-1]) > UNFOLDED:
        return None
    length = a.arclength + sigma * (b.arclength - a.arclength)
    return sigma, SpecialPoint(name, without_direction(found, length), found.step)


def _share(touch: Touch, a: BranchNode, b: BranchNode) -> float:
    """Share of the way from a to b at which a stop is touched, by linear interpolation."""
    before, after = touch.depth(a), touch.depth(b)
    return before / (before - after)


def _touches(a: BranchNode, b: BranchNode) -> list[list[Touch]]:
    """Touches between two points, those together that a symmetry of the structure exchanges."""
    condition = a.condition
    if a.corner or b.corner:
        return []
    alike: dict[float, list[Touch]] = {}
    for touch in touching_extremes(a.orbit, b.orbit):
        own = isinstance(condition, Grazing) and condition.is_of(
            touch.output, touch.is_maximum, touch.phase, a.orbit.period
        )
        if own:
            continue
        share = _share(touch, a, b)
        near = next((other for other in alike if abs(other - share) < ALIKE), share)
        alike.setdefault(near, []).append(touch)
    return list(alike.values())


def _changes_of_sign(a: BranchNode, b: BranchNode) -> list[str]:
    """Names of the tests that change sign between two points."""
    before, after = curve_tests(a), curve_tests(b)
    rounding = () if leaves_circle(a.orbit, b.orbit) else ("NS", "GRNS")
    return [name for name in before if before[name] * after[name] < 0.0 and name not in rounding]


def _touch_name(condition: Condition) -> str:
    if isinstance(condition, Grazing):
        return "GRGR"
    if isinstance(condition, BranchPointCondition):
        return "GRBP"
    return f"GR{condition.kind}" if isinstance(condition, Singular) else "GR"


def _is_true(name: str, point: BranchNode) -> bool:
    """Whether a pair of multipliers is complex where a test tells of one on the unit circle."""
    mu = point.orbit.multipliers
    if name in ("NS", "GRNS"):
        return is_torus(mu)
    if name == "BPNS":
        return is_torus(np.delete(mu, int(np.argmin(np.abs(mu - 1.0)))))
    if name in ("LPNS", "PDNS") and not is_torus_curve(point.condition):
        target = 1.0 if name == "LPNS" else -1.0
        return is_torus(np.delete(mu, int(np.argmin(np.abs(mu - target)))))
    if name == "NSNS":
        return is_torus(np.delete(mu, torus_pair(mu)))
    if name == "CP":  # the parameters turn back
        return bool(np.abs(point.tangent[-2:]).max() < TURNS_BACK)
    return True


def turns_back(a: BranchNode, b: BranchNode) -> bool:
    """Whether the first parameter turns between two points."""
    place = a.family.n_states
    return bool(a.tangent[place] * b.tangent[place] < 0.0)


def _keeps_parameter(chord: Chord) -> bool:
    """Whether cycles of all sizes are at one parameter, as where they are linear; its tests round.

    At a fold the tangent is without the parameter, too, but not beside it.
    """
    place = chord.first.family.n_states
    ends = [chord.first, chord.last]
    flat = [abs(end.tangent[place]) < FLAT for end in ends]
    if any(flat) and not all(flat):
        flat = [abs(chord.at(BESIDE if flat[0] else 1.0 - BESIDE).tangent[place]) < FLAT]
    return all(flat)


def _missing(name: str, point: BranchNode, why: Exception | str) -> str:
    """The note that a mark may be missing behind a point."""
    charts = point.family.charts
    pairs = zip(charts, point.values.tolist(), strict=True)
    place = ", ".join(f"{chart.parameter.name} = {value:.8g}" for chart, value in pairs)
    return f"{name} near {place} may be missing: {why}"
