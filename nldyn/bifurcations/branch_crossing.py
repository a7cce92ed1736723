"""Where branches cross beside an orbit."""

from __future__ import annotations

import math

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.bifurcations.point import SpecialPoint
from nldyn.orbits.bordered import OrbitFamily, Place, Solved
from nldyn.orbits.conditions import nearest_crossing
from nldyn.orbits.shooting import metric_length

CROSSES = 1e-12  # least unfolding of a crossing, relative to the orbit, that is not rounding
ON_CROSSING = 3e-7  # distance from one, relative to the orbit, at which a branch cannot be told
NEAR_CRITICAL = 1e-3  # a multiplier no nearer to 1 or -1 is not that of a special point
FIRST_STEP = 100.0  # of a distance: Newton's method steps no farther to a crossing within it
NEIGHBOUR = 1e-3  # arclength between two branch points at one turn, and dP/ds there
SHORTEST_CROSSING = 3e-6  # step over which a branch may cross another one
SAME = 2.0 * SHORTEST_CROSSING  # distance of branch points that two such steps locate as one
NOT_NEAR = 0.1  # least over largest singular value, above which no critical orbit is near
SOLVED = 1e-10  # last step of Newton's method, relative to the orbit
FARTHEST = 0.5  # Newton step in ln ω that leads nowhere


def is_crossing(place: Place) -> bool:
    """Whether branches cross beside an orbit, and do not only come close; if it can be told."""
    crossing = nearest_crossing(place)
    return crossing is None or crossing[1] <= CROSSES


def lies_on_crossing(place: Place, within: float) -> bool:
    """Whether branches cross within a distance of an orbit, relative to it.

    On a plane across a branch Newton's method may find any orbit of the other one there.
    """
    return crossing_within(place, within) is not None


def crossing_within(place: Place, within: float) -> Solved | None:
    """Where branches cross within a distance of an orbit, relative to it, if they do."""
    crossing = crossing_beside(place, FIRST_STEP * within)
    return crossing if crossing is not None and distance(place, crossing) < within else None


def crossing_beside(place: Place, longest: float = math.inf) -> Solved | None:
    """Where branches cross beside an orbit that has a multiplier near 1, if they do.

    It is given up where the first step towards it is longer than said.
    """
    if float(np.abs(place.orbit.multipliers - 1.0).min()) > NEAR_CRITICAL:
        return None
    return true_crossing(place, longest)


def correct_across(family: OrbitFamily, guess: Real, row: Real, level: float) -> Solved | None:
    """Orbit on the plane ``row @ point = level`` where branches cross nearby.

    There the shooting equations are nearly singular and Newton's method loses the digits that they
    lose. So the component along the null vector q is held at that of the guess, and a multiple β of
    the left null vector is added to the equations instead. A guess that lies on the branch in this
    one component makes β vanish.

    Returns
    -------
    Solved or None
        The orbit's error is the last step or β, relative to the orbit, whichever is larger; None if
        Newton's method fails or there is no multiplier near 1.

    References
    ----------
    Govaerts (2000), chapter 3 (bordered systems).
    """
    size = guess.size - 1
    scale = family.scale(guess) * math.sqrt(family.segments)
    bordered = np.zeros((size + 2, size + 2))
    point = guess.copy()
    q: Real | None = None
    for _ in range(8):
        at = family.at(point)
        try:
            bordered[:size, :-1], defect = at.jacobian, at.residual
        except ConvergenceError:
            return None
        if q is None:
            left, values, right = np.linalg.svd(at.jacobian[:, :size])
            if values[-1] > NOT_NEAR * values[0]:
                return None
            q, y = right[-1], left[:, -1]
        bordered[:size, -1], bordered[size, :-1], bordered[-1, :size] = y, row, q
        rest = np.append(defect, [row @ point - level, q @ (point - guess)[:size]])
        step = np.linalg.solve(bordered, -rest)
        point = point + step[:-1]
        if not abs(step[size]) < FARTHEST:
            return None
        moved = float(np.linalg.norm(step[:size])) / scale
        if moved < SOLVED:
            error = max(moved, abs(float(step[-1])) / scale)
            return Solved(family, point, family.at(point).orbit_by(at.segments.jacobians, error))
    return None


def distance(a: Place, b: Place) -> float:
    """Distance of two orbits of one family, relative to the first."""
    return metric_length(a.family.metric(a.point), b.point - a.point)


def true_crossing(place: Place, longest: float = math.inf) -> Solved | None:
    """Where branches cross beside an orbit, if they do."""
    crossing = nearest_crossing(place, longest)
    return crossing[0] if crossing is not None and crossing[1] <= CROSSES else None


def without_repeats(found: list[SpecialPoint]) -> list[SpecialPoint]:
    """Special points without those that rounding adds.

    Of neighbouring branch points where one branch turns, only the one nearest to the turn is kept.

    A branch that turns where it meets another one has a multiplier that touches 1 there without
    passing it, so that rounding decides how often the branch point's test changes sign. The turn is
    no fold. Where the parameter only stands still, rounding makes two folds at one value, and there
    is none.
    """
    kept: list[SpecialPoint] = []
    for special in found:
        if kept and _stands_still(kept[-1], special):
            kept.pop()
        elif kept and _turns_twice(kept[-1], special):
            crossings = [s for s in (kept[-1], special) if s.kind == "BP"]
            kept[-1] = min(crossings, key=_pace)
        else:
            kept.append(special)
    return kept


def _stands_still(a: SpecialPoint, b: SpecialPoint) -> bool:
    """Whether two folds are a place where the parameter, to their errors, does not turn."""
    folds = a.kind == b.kind == "LP" and distance(a.point, b.point) < NEIGHBOUR
    return folds and abs(a.value - b.value) <= a.error + b.error


def _turns_twice(a: SpecialPoint, b: SpecialPoint) -> bool:
    apart = abs(a.point.arclength - b.point.arclength)
    turning = apart < NEIGHBOUR and max(_pace(a), _pace(b)) < NEIGHBOUR
    kinds = {a.kind, b.kind}
    one = apart < NEIGHBOUR and same_crossing(a, b)
    return one or (turning and kinds in ({"BP"}, {"BP", "LP"}))


def same_crossing(a: SpecialPoint, b: SpecialPoint) -> bool:
    """Whether two special points are one branch point."""
    return a.kind == b.kind == "BP" and distance(a.point, b.point) < SAME


def _pace(special: SpecialPoint) -> float:
    """How fast the parameter changes along the branch."""
    return abs(float(special.point.tangent[-1]))
