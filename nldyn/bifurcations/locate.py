"""Special points: test functions along a branch, and where they change sign."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from nldyn.base.errors import LocateError
from nldyn.bifurcations.branch_crossing import (
    NEAR_CRITICAL,
    NEIGHBOUR,
    crossing_within,
    distance,
    true_crossing,
)
from nldyn.bifurcations.chord import BESIDE, Chord
from nldyn.bifurcations.kinds import KINDS
from nldyn.bifurcations.normal_form_coefficients import turns_near_crossing
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.bifurcations.roots import root
from nldyn.bifurcations.sign_changes import (
    _on_unit_circle,
    accounted,
    changed,
    leaves_circle,
    tests,
)
from nldyn.bifurcations.touching import Touch, changes_hidden_by_birth, touching_extremes
from nldyn.orbits.bordered import Solved

PASSED = 1e-6  # least of a branch point's test on both sides of a fold that is no crossing
MIXED = 1e-5  # distance from a crossing within which a tangent may be of both branches
VANISHED = 1e-3  # an extreme at its root, relative to those beside it


def locate(kind: str, chord: Chord, test: Callable[[BranchNode], float]) -> SpecialPoint:
    """Root of a test function on a chord whose ends have opposite signs.

    Raises
    ------
    LocateError
        If none is found, see `root`, or an orbit on the way to it, see `Chord.at`.
    """
    sigma, error = root(lambda x: test(chord.at(x)))
    point = chord.at(sigma)
    return SpecialPoint(kind, point, error * abs(chord.pace(point)) + point.orbit.error)


def located_between(a: BranchNode, b: BranchNode, depth: int = 0) -> list[SpecialPoint]:
    """The special points between two points that their tests tell of, in order.

    Each change of sign is followed to its root. Where several happen in one step, or the events do
    not explain the change in the number of contacts or of unstable multipliers, the chord is
    halved.
    """
    chord = Chord(a, b)
    signs = changed(a, b)
    if "NS" in signs and not leaves_circle(a.orbit, b.orbit):
        signs.remove("NS")
    kinds = _told_apart(signs)
    lonely_fold = "LP" in signs and "BP" not in signs
    contacts = abs(a.orbit.impacts - b.orbit.impacts)
    touches = touching_extremes(a.orbit, b.orbit)
    clear = len(touches) == contacts and len(kinds) + contacts <= 1 and not lonely_fold
    clear = clear and not changes_hidden_by_birth(a.orbit, b.orbit)
    if not clear and depth < 10:
        middle = chord.at(0.5)
        return located_between(a, middle, depth + 1) + located_between(middle, b, depth + 1)
    found = [s for k in kinds for s in _located(k, chord)]
    if touches:
        touch = touches[0]
        grazing = locate("GR", chord, touch.depth)
        if contacts or _vanishes(touch, grazing.point, a, b):
            found += [grazing, *_pairs_around(grazing, chord)]
    found.sort(key=lambda s: s.point.arclength, reverse=bool(b.arclength < a.arclength))
    if depth < 8 and not accounted(a.orbit, found, b.orbit):
        middle = chord.at(0.5)
        return located_between(a, middle, depth + 1) + located_between(middle, b, depth + 1)
    return found


def _located(kind: str, chord: Chord) -> list[SpecialPoint]:
    """Where a test changes its sign on a chord; nothing if that is no pair on the unit circle.

    Where branches cross beside an end of the chord, the tangent there may be of both: its change of
    sign is not that of a fold, unless a multiplier tells, or the sign does there.
    """
    special = locate(kind, chord, lambda point: tests(point)[kind])
    away = np.abs(special.orbit.multipliers - KINDS[kind].multiplier).min()
    if away > NEAR_CRITICAL:
        raise LocateError("a test function jumps, as it does from one branch to another")
    if kind == "NS" and not _on_unit_circle(special.orbit):
        return []
    if kind == "LP" and _is_plain_fold(chord):
        return [special]
    if kind == "LP" and not _turns_beside(special.point, chord):
        crossing = _crossing_at_an_end(chord)
        if crossing is not None:
            return [SpecialPoint("BP", chord.with_place(crossing), crossing.orbit.error)]
    return [_along(chord, _crossing_or_fold(special))]


def _turns_beside(fold: BranchNode, chord: Chord) -> bool:
    """Whether the branch turns at a fold, not where the tangent jumps elsewhere on the chord."""
    sigma = chord.place(fold)
    return "LP" in changed(chord.at(sigma - BESIDE), chord.at(sigma + BESIDE))


def _crossing_at_an_end(chord: Chord) -> Solved | None:
    """Where branches cross so near to an end of a chord that its tangent may be of both."""
    return crossing_within(chord.first, MIXED) or crossing_within(chord.last, MIXED)


def _vanishes(touch: Touch, at: BranchNode, a: BranchNode, b: BranchNode) -> bool:
    """Whether an extreme is nearly zero at a point, not only of different signs beside it.

    A touch that is too slight to count as a contact may begin at a distance from its grazing point.
    """
    return abs(touch.depth(at)) <= VANISHED * max(abs(touch.depth(a)), abs(touch.depth(b)))


def _pairs_around(grazing: SpecialPoint, chord: Chord) -> list[SpecialPoint]:
    """Points on either side of a grazing point, where tests change their sign twice in a step.

    They bend there, so that the step does not tell.
    """
    sides = Chord(chord.first, grazing.point), Chord(grazing.point, chord.last)
    before, after = (changed(side.first, side.last) for side in sides)
    hidden = _told_apart([kind for kind in before if kind in after])
    return [special for kind in hidden for side in sides for special in _located(kind, side)]


def _told_apart(signs: list[str]) -> list[str]:
    """What to look for where tests change signs: at a fold that of a branch point does too."""
    return [kind for kind in signs if not (kind == "BP" and "LP" in signs)]


def _is_plain_fold(chord: Chord) -> bool:
    """Whether a multiplier passes 1 clearly where a branch turns, as it does not at a crossing."""
    before, after = tests(chord.first)["BP"], tests(chord.last)["BP"]
    return before * after < 0.0 and min(abs(before), abs(after)) > PASSED


def _crossing_or_fold(special: SpecialPoint) -> SpecialPoint:
    """What looks like a fold may be where this branch crosses another one.

    So a branch of broken symmetry turns at the branch point that its two halves share. Where the
    symmetry is not perfect it is folded beside it: then the crossing has an unfolding. A branch
    point is solved for by its own system, whose digits do not depend on the branch.
    """
    turns = special.kind == "LP" and turns_near_crossing(special.point)
    if special.kind != "BP" and not turns:
        return special
    crossing = true_crossing(special.point)
    if crossing is None or distance(special.point, crossing) > NEIGHBOUR:
        return special
    point = BranchNode.of(crossing, special.point.tangent, special.point.arclength)
    return SpecialPoint("BP", point, special.error)


def _along(chord: Chord, special: SpecialPoint) -> SpecialPoint:
    """A special point of a chord; a branch point with tangent and place of the chord's branch.

    It may have been found from an orbit of the other branch, whose tangent leads elsewhere.
    """
    if special.kind != "BP":
        return special
    return replace(special, point=chord.with_place(special.point))
