"""The piece of a branch between two neighbouring points."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from nldyn.base.arrays import Real, hermite
from nldyn.base.errors import LocateError, failing_as
from nldyn.bifurcations.branch_crossing import NEIGHBOUR, SHORTEST_CROSSING, correct_across
from nldyn.bifurcations.point import BranchNode, node_of
from nldyn.bifurcations.sign_changes import crosses
from nldyn.orbits.bordered import FREE, Place, Solved, correct
from nldyn.orbits.conditions import TOUCH, depth_row
from nldyn.orbits.shooting import metric_length

BESIDE = 1e-3  # in σ: the least distance of points that tell the direction of a branch
CROSSING_ERROR = 1e-8  # relative, of an orbit where branches cross

STEEPEST = 0.5  # least cosine between a branch and the chord of a step, below which it is refused
BEND = 1e-4  # arclength of a chord, above which a branch does not depart from it by more


@dataclass(frozen=True)
class Chord:
    """The piece of a branch between two neighbouring points, as a function of σ in [0, 1].

    σ is the position along the secant; points once computed help to predict the next ones.
    """

    first: BranchNode
    last: BranchNode
    known: dict[float, BranchNode] = field(default_factory=dict)

    @cached_property
    def _secant(self) -> Real:
        return self.last.point - self.first.point

    @cached_property
    def _weights(self) -> Real:
        return self.first.weights

    @cached_property
    def _length(self) -> float:
        return metric_length(self._weights, self._secant)

    @cached_property
    def row(self) -> Real:
        """Along the secant, or the slope of a touch's depth if that rises or falls all the way."""
        row = self._weights * self._secant
        short = abs(self.last.arclength - self.first.arclength) < TOUCH
        if short and self.first.condition is FREE:
            depth = depth_row(self.first)
            ways = self._secant, self.first.tangent, self.last.tangent
            if depth is not None and abs(sum(np.sign(depth @ way) for way in ways)) == len(ways):
                row = depth
        return np.asarray(row / np.linalg.norm(row))

    @failing_as(LocateError)
    def at(self, sigma: float) -> BranchNode:
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
        row = self.row
        level = float(row @ (a.point + sigma * self._secant))
        guess = self.between(sigma)
        like = self._nearest(sigma).orbit.motion
        found = correct(a.family, guess, a.condition, row, level, like=like)
        length = a.arclength + sigma * (self.last.arclength - a.arclength)
        if a.condition is not FREE:
            if not found.converged:
                raise LocateError(found.failure)
            self.known[sigma] = node_of(found, self._secant, length)
            return self.known[sigma]
        beside = found.converged and self._is_beside(found.point - guess)
        crossing = None if beside else self._where_branches_cross(guess, level)
        if crossing is not None:
            place: Place = crossing
            tangent = self.direction(sigma)
        elif found.converged:
            place, tangent = found, found.tangent(self._secant)
            if float(row @ tangent) * float(row @ self._secant) < 0.0:
                tangent = -tangent
            if self._across(tangent):
                raise LocateError("the branch turns within one step")
        else:
            raise LocateError(found.failure)
        point = BranchNode.of(place, tangent, length)
        if crosses(self.first, point) and crosses(self.last, point):
            raise LocateError("the branch turns within one step")
        self.known[sigma] = point
        return point

    def place(self, place: Place) -> float:
        """Position σ of an orbit of the branch, which may lie beyond the ends."""
        way = place.point - self.first.point
        return float(self.row @ way) / float(self.row @ self._secant)

    def with_place(self, place: Place) -> BranchNode:
        """An orbit with the place and the tangent that the chord gives it."""
        sigma = self.place(place)
        length = self.last.arclength - self.first.arclength
        return BranchNode.of(place, self.direction(sigma), self.first.arclength + sigma * length)

    def passes(self, place: Place, off: float) -> bool:
        """Whether an orbit lies on the chord, but for a part of its length."""
        sigma = self.place(place)
        if not -off <= sigma <= 1.0 + off:
            return False
        away = place.point - self.between(min(max(sigma, 0.0), 1.0))
        return metric_length(self._weights, away) <= off * self._length

    def between(self, sigma: float) -> Real:
        """Cubic interpolation of the shooting unknowns between the nearest known points."""
        below = max((s for s in self.known if s < sigma), default=0.0)
        above = min((s for s in self.known if s > sigma), default=1.0)
        a, b = self.at(below), self.at(above)
        x = (sigma - below) / (above - below)
        start, end = ((above - below) * self._slope(point) for point in (a, b))
        return hermite(x, a.point, b.point, start, end)

    def _nearest(self, sigma: float) -> BranchNode:
        """The known point nearest to a position."""
        known = self.known | {0.0: self.first, 1.0: self.last}
        return known[min(known, key=lambda x: abs(x - sigma))]

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
            6.0 * x * (1.0 - x) * (b.point - a.point) / width
            + (1.0 - x) * (1.0 - 3.0 * x) * self._slope(a)
            + x * (3.0 * x - 2.0) * self._slope(b)
        )
        return self._unit(towards)

    def _unit(self, vector: Real) -> Real:
        return np.asarray(vector / metric_length(self._weights, vector))

    def _where_branches_cross(self, guess: Real, level: float) -> Solved | None:
        """The orbit of this branch beside a guess, if another branch crosses it there."""
        crossing = correct_across(self.first.family, guess, self.row, level)
        return None if crossing is None or crossing.orbit.error > CROSSING_ERROR else crossing

    def _is_beside(self, way: Real) -> bool:
        """Whether a way from the chord is no longer than the chord, or than that of a crossing."""
        return metric_length(self._weights, way) <= max(self._length, SHORTEST_CROSSING)

    def _across(self, tangent: Real) -> bool:
        """Whether a tangent departs from the chord by more than a branch may within a step."""
        along = float(self._secant @ (self._weights * tangent))
        pace = metric_length(self._weights, tangent)
        return self._length > BEND and along < STEEPEST * self._length * pace

    def pace(self, point: BranchNode) -> float:
        """Derivative of the parameter's coordinate with respect to σ."""
        return float(self._slope(point)[-1])

    def _slope(self, point: BranchNode) -> Real:
        """Derivative of the shooting unknowns with respect to σ."""
        pace = float(self.row @ self._secant) / float(self.row @ point.tangent)
        return np.asarray(pace * point.tangent)
