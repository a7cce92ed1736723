"""Special points: test functions along a branch, and where they change sign."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from nldyn.base.arrays import Complex, Real
from nldyn.base.errors import LocateError
from nldyn.bifurcations.branch_crossing import (
    NEAR_CRITICAL,
    NEIGHBOUR,
    SHORTEST_CROSSING,
    crossing_within,
    distance,
    true_crossing,
)
from nldyn.bifurcations.critical import correct_across, turns_near_crossing
from nldyn.bifurcations.point import BranchPoint, SpecialPoint
from nldyn.bifurcations.roots import root
from nldyn.bifurcations.touching import Touch, changes_hidden_by_birth, touching_extremes
from nldyn.orbits.conditions import TOUCH, depth_row
from nldyn.orbits.extremes import branch_point_test, flip_test, number_outside, torus_test
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import metric_length

BESIDE = 1e-3  # in σ: the least distance of points that tell the direction of a branch
CROSSING_ERROR = 1e-8  # relative, of an orbit where branches cross
ON_CIRCLE = 1e-8  # of a product of two multipliers: rounding of one that is 1
ROUNDED = 1e-8  # below which the sign of a branch point's test may be rounding
PASSED = 1e-6  # least of a branch point's test on both sides of a fold that is no crossing
MIXED = 1e-5  # distance from a crossing within which a tangent may be of both branches
CRITICAL = {"LP": 1.0, "BP": 1.0, "PD": -1.0}  # multiplier at a special point
VANISHED = 1e-3  # an extreme at its root, relative to those beside it
STEEPEST = 0.5  # least cosine between a branch and the chord of a step, below which it is refused
BEND = 1e-4  # arclength of a chord, above which a branch does not depart from it by more


def tests(point: BranchPoint) -> dict[str, float]:
    """All smooth test functions at a point; LP is the frequency part of the tangent.

    Without damping the multipliers of every stable orbit lie on the unit circle and leave it in
    fours, which is no Neimark-Sacker point; the torus test is rounding noise there.
    """
    if not point.tests:
        mu = point.orbit.multipliers
        pairs = mu.size > 2 and not point.orbit.system.conservative
        point.tests.update(
            LP=float(point.tangent[-1]),
            PD=flip_test(mu),
            BP=branch_point_test(mu),
            NS=torus_test(mu) if pairs else 1.0,
        )
    return point.tests


def crosses(a: BranchPoint, b: BranchPoint) -> bool:
    """Whether a branch crosses another one between two points, or jumps to it.

    The determinant of the shooting equations bordered by the tangent keeps its sign along a branch
    up to where it crosses another one. It has the sign of det(Φ - 1) over the tangent's frequency
    part, for both vanish at a fold.
    """
    first, last = tests(a), tests(b)
    if min(abs(first["BP"]), abs(last["BP"])) < ROUNDED:
        return False
    return first["BP"] * first["LP"] * last["BP"] * last["LP"] < 0.0


@dataclass(frozen=True)
class Chord:
    """The piece of a branch between two neighbouring points, as a function of σ in [0, 1].

    σ is the position along the secant; points once computed help to predict the next ones.
    """

    first: BranchPoint
    last: BranchPoint
    known: dict[float, BranchPoint] = field(default_factory=dict)

    @cached_property
    def _secant(self) -> Real:
        return self.last.orbit.point - self.first.orbit.point

    @cached_property
    def _weights(self) -> Real:
        return self.first.orbit.problem.metric(self.first.orbit.point)

    @cached_property
    def _length(self) -> float:
        return metric_length(self._weights, self._secant)

    @cached_property
    def row(self) -> Real:
        """Along the secant, or the slope of a touch's depth if that rises or falls all the way."""
        a = self.first.orbit
        row = self._weights * self._secant
        if abs(self.last.arclength - self.first.arclength) < TOUCH:
            depth = depth_row(a)
            ways = self._secant, self.first.tangent, self.last.tangent
            if depth is not None and abs(sum(np.sign(depth @ way) for way in ways)) == len(ways):
                row = depth
        return np.asarray(row / np.linalg.norm(row))

    def at(self, sigma: float) -> BranchPoint:
        """Point of the branch on the plane through σ of the chord.

        Raises
        ------
        LocateError
            If Newton's method fails there, or finds an orbit at which the branch runs across the
            chord: then it turns between the two points, and a tangent that is taken along the chord
            would change its sign without passing a fold. Or if it finds one of another branch that
            crosses this one, as far as the signs of the tests tell.
        """
        if sigma <= 0.0:
            return self.first
        if sigma >= 1.0:
            return self.last
        if sigma in self.known:
            return self.known[sigma]
        a = self.first
        problem = a.orbit.problem
        row = self.row
        offset = float(row @ (a.orbit.point + sigma * self._secant))
        guess = self.between(sigma)
        found = problem.correct(guess, row, offset=offset)
        beside = found.converged and self._is_beside(found.point - guess)
        crossing = None if beside else self._where_branches_cross(guess, offset)
        if crossing is not None:
            orbit, tangent = crossing, self.direction(sigma)
        elif found.converged:
            orbit = Orbit.of(problem, found, a.orbit.observe)
            tangent = problem.tangent(found, self._secant)
            if float(row @ tangent) * float(row @ self._secant) < 0.0:
                tangent = -tangent
            if self._across(tangent):
                raise LocateError("the branch turns within one step")
        else:
            raise LocateError(found.failure)
        length = a.arclength + sigma * (self.last.arclength - a.arclength)
        point = BranchPoint(orbit, tangent, length)
        if crosses(self.first, point) and crosses(self.last, point):
            raise LocateError("the branch turns within one step")
        self.known[sigma] = point
        return point

    def place(self, orbit: Orbit) -> float:
        """Position σ of an orbit of the branch, which may lie beyond the ends."""
        way = orbit.point - self.first.orbit.point
        return float(self.row @ way) / float(self.row @ self._secant)

    def with_place(self, orbit: Orbit) -> BranchPoint:
        """An orbit with the place and the tangent that the chord gives it."""
        sigma = self.place(orbit)
        length = self.last.arclength - self.first.arclength
        return BranchPoint(orbit, self.direction(sigma), self.first.arclength + sigma * length)

    def passes(self, orbit: Orbit, off: float) -> bool:
        """Whether an orbit lies on the chord, but for a part of its length."""
        sigma = self.place(orbit)
        if not -off <= sigma <= 1.0 + off:
            return False
        away = orbit.point - self.between(min(max(sigma, 0.0), 1.0))
        return metric_length(self._weights, away) <= off * self._length

    def between(self, sigma: float) -> Real:
        """Cubic interpolation of the shooting unknowns between the nearest known points."""
        below = max((s for s in self.known if s < sigma), default=0.0)
        above = min((s for s in self.known if s > sigma), default=1.0)
        a, b = self.at(below), self.at(above)
        x = (sigma - below) / (above - below)
        start, end = ((above - below) * self._slope(point) for point in (a, b))
        return np.asarray(
            (1.0 + 2.0 * x) * (1.0 - x) ** 2 * a.orbit.point
            + x * (1.0 - x) ** 2 * start
            + x * x * (3.0 - 2.0 * x) * b.orbit.point
            + x * x * (x - 1.0) * end
        )

    def direction(self, sigma: float) -> Real:
        """Unit tangent by interpolation between points beside σ, or along a short chord.

        Where branches cross, the equations give none, and very near to that none that is good.
        """
        if abs(self.last.arclength - self.first.arclength) < NEIGHBOUR:
            return self._unit(self._secant)
        below = max((s for s in self.known if s <= sigma - BESIDE), default=0.0)
        above = min((s for s in self.known if s >= sigma + BESIDE), default=1.0)
        a, b, width = self.at(below), self.at(above), above - below
        x = (sigma - below) / width
        towards = (
            6.0 * x * (1.0 - x) * (b.orbit.point - a.orbit.point) / width
            + (1.0 - x) * (1.0 - 3.0 * x) * self._slope(a)
            + x * (3.0 * x - 2.0) * self._slope(b)
        )
        return self._unit(towards)

    def _unit(self, vector: Real) -> Real:
        return np.asarray(vector / metric_length(self._weights, vector))

    def _where_branches_cross(self, guess: Real, offset: float) -> Orbit | None:
        """The orbit of this branch beside a guess, if another branch crosses it there."""
        problem = self.first.orbit.problem
        crossing = correct_across(problem, guess, self.row, offset)
        if crossing is None or crossing[2] > CROSSING_ERROR:
            return None
        return Orbit(problem, *crossing, self.first.orbit.observe)

    def _is_beside(self, way: Real) -> bool:
        """Whether a way from the chord is no longer than the chord, or than that of a crossing."""
        return metric_length(self._weights, way) <= max(self._length, SHORTEST_CROSSING)

    def _across(self, tangent: Real) -> bool:
        """Whether a tangent departs from the chord by more than a branch may within a step."""
        along = float(self._secant @ (self._weights * tangent))
        pace = metric_length(self._weights, tangent)
        return self._length > BEND and along < STEEPEST * self._length * pace

    def frequency_slope(self, point: BranchPoint) -> float:
        """Derivative of ln ω with respect to σ."""
        return float(self._slope(point)[-1])

    def _slope(self, point: BranchPoint) -> Real:
        """Derivative of the shooting unknowns with respect to σ."""
        pace = float(self.row @ self._secant) / float(self.row @ point.tangent)
        return np.asarray(pace * point.tangent)


def locate(kind: str, chord: Chord, test: Callable[[BranchPoint], float]) -> SpecialPoint:
    """Root of a test function on a chord whose ends have opposite signs.

    Raises
    ------
    LocateError
        If none is found, see `root`, or an orbit on the way to it, see `Chord.at`.
    """
    sigma, error = root(lambda x: test(chord.at(x)))
    point = chord.at(sigma)
    return SpecialPoint(kind, point, error * abs(chord.frequency_slope(point)) + point.orbit.error)


def located_between(a: BranchPoint, b: BranchPoint, depth: int = 0) -> list[SpecialPoint]:
    """The special points between two points that their tests tell of, in order.

    Each change of sign is followed to its root. Where several happen in one step, or the events do
    not explain the change in the number of contacts or of unstable multipliers, the chord is
    halved.
    """
    chord = Chord(a, b)
    signs = changed(a, b)
    if "NS" in signs and not leaves_circle(a.orbit.multipliers, b.orbit.multipliers):
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
    critical = CRITICAL.get(kind)
    if critical and np.abs(special.orbit.multipliers - critical).min() > NEAR_CRITICAL:
        raise LocateError("a test function jumps, as it does from one branch to another")
    if kind == "NS" and not _on_unit_circle(special.orbit.multipliers):
        return []
    if kind == "LP" and _is_plain_fold(chord):
        return [special]
    if kind == "LP" and not _turns_beside(special.orbit, chord):
        crossing = _crossing_at_an_end(chord)
        if crossing is not None:
            at = replace(special.point, orbit=crossing)
            return [_along(chord, SpecialPoint("BP", at, crossing.error))]
    return [_along(chord, _crossing_or_fold(special))]


def _turns_beside(fold: Orbit, chord: Chord) -> bool:
    """Whether the branch turns at a fold, not where the tangent jumps elsewhere on the chord."""
    sigma = chord.place(fold)
    return "LP" in changed(chord.at(sigma - BESIDE), chord.at(sigma + BESIDE))


def _crossing_at_an_end(chord: Chord) -> Orbit | None:
    """Where branches cross so near to an end of a chord that its tangent may be of both."""
    return crossing_within(chord.first.orbit, MIXED) or crossing_within(chord.last.orbit, MIXED)


def _vanishes(touch: Touch, at: BranchPoint, a: BranchPoint, b: BranchPoint) -> bool:
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
    turns = special.kind == "LP" and turns_near_crossing(special.orbit)
    if special.kind != "BP" and not turns:
        return special
    orbit = true_crossing(special.orbit)
    if orbit is None or distance(special.orbit, orbit) > NEIGHBOUR:
        return special
    point = BranchPoint(orbit, special.point.tangent, special.point.arclength)
    return SpecialPoint("BP", point, special.frequency_error)


def _along(chord: Chord, special: SpecialPoint) -> SpecialPoint:
    """A special point of a chord; a branch point with tangent and place of the chord's branch.

    It may have been found from an orbit of the other branch, whose tangent leads elsewhere.
    """
    if special.kind != "BP":
        return special
    return replace(special, point=chord.with_place(special.orbit))


def accounted(a: Orbit, found: list[SpecialPoint], b: Orbit) -> bool:
    """Whether the special points from a to b explain how many multipliers leave the unit circle.

    At each of them the other multipliers tell the number outside on either side.
    """
    outside = _possible_outside(a.multipliers)
    for special in found:
        if special.kind == "GR":
            continue
        mu = special.orbit.multipliers
        if special.kind == "NS":
            off_circle = np.where(mu.imag == 0.0, np.inf, np.abs(np.abs(mu) - 1.0))
            crossing = np.argsort(off_circle, kind="stable")[:2]
        else:
            crossing = np.argsort(np.abs(mu - CRITICAL[special.kind]))[:1]
        size = crossing.size
        others = _possible_outside(np.delete(mu, crossing))
        outside = {n + size for n in others & outside} | {n for n in others if n + size in outside}
    return bool(outside & _possible_outside(b.multipliers))


def _possible_outside(multipliers: Complex) -> set[int]:
    """Numbers of multipliers that may lie outside the unit circle, given their rounding."""
    fewest, most = number_outside(multipliers, 1e-6)
    return set(range(fewest, most + 1))


def leaves_circle(before: Complex, after: Complex) -> bool:
    """Whether the pair nearest to the unit circle lies beside it at one of two orbits.

    The pair of a mode without damping stays on it, where the torus test is rounding noise.
    """
    return any(_pair_off_circle(mu)[1] > ON_CIRCLE for mu in (before, after))


def _pair_off_circle(multipliers: Complex) -> tuple[complex, float]:
    """One of the two multipliers whose product is nearest to 1, and how far that is from 1."""
    i, j = np.triu_indices(multipliers.size, 1)
    off = np.abs(multipliers[i] * multipliers[j] - 1.0)
    nearest_one = int(np.argmin(off))
    return complex(multipliers[i[nearest_one]]), float(off[nearest_one])


def _on_unit_circle(multipliers: Complex) -> bool:
    """Whether a complex pair (not a real pair μ, 1/μ) is what makes the torus test vanish."""
    mu = _pair_off_circle(multipliers)[0]
    return bool(abs(mu.imag) > 1e-6 * abs(mu))


def changed(a: BranchPoint, b: BranchPoint) -> list[str]:
    """Tests that change their sign between two points."""
    before, after = tests(a), tests(b)
    return [kind for kind in before if before[kind] * after[kind] < 0.0]
