"""Coordinate systems: rectangular, cylindrical and spherical, each in another one."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from fem.base.arrays import FloatArray
from fem.formats.nastran.cards import Card

Place = Callable[[int, Card], FloatArray]
ON_AXIS = 1e-12  # of the distance from the origin: so near the axis, no direction leads away


@dataclass(frozen=True)
class System:
    """A coordinate system: its kind "R", "C" or "S", origin and axes as rows, in basic ones."""

    kind: str
    origin: FloatArray
    axes: FloatArray

    def place(self, given: FloatArray) -> FloatArray:
        """Basic coordinates of a point that is given in this system, angles in degrees."""
        return np.asarray(self.origin + self._straight(given) @ self.axes, dtype=np.float64)

    def _straight(self, given: FloatArray) -> FloatArray:
        if self.kind == "R":
            return given
        if self.kind == "C":
            r, angle, z = given[0], math.radians(given[1]), given[2]
            return np.array([r * math.cos(angle), r * math.sin(angle), z])
        r, polar, angle = given[0], math.radians(given[1]), math.radians(given[2])
        direction = np.array(
            [
                math.sin(polar) * math.cos(angle),
                math.sin(polar) * math.sin(angle),
                math.cos(polar),
            ]
        )
        return np.asarray(r * direction, dtype=np.float64)

    def axes_at(self, point: FloatArray) -> FloatArray:
        """Unit vectors of the three directions at a point (basic coordinates), as rows."""
        if self.kind == "R":
            return self.axes
        x, y, z = self.axes @ (point - self.origin)
        size = math.sqrt(x * x + y * y + z * z)
        near = math.hypot(x, y) <= ON_AXIS * size or size == 0.0
        angle = 0.0 if near else math.atan2(y, x)
        outward = np.array([math.cos(angle), math.sin(angle), 0.0])
        around = np.array([-math.sin(angle), math.cos(angle), 0.0])
        if self.kind == "C":
            local = np.stack([outward, around, np.array([0.0, 0.0, 1.0])])
        else:
            polar = 0.0 if size == 0.0 else math.acos(z / size)
            upward = np.array([0.0, 0.0, 1.0])
            radial = math.sin(polar) * outward + math.cos(polar) * upward
            meridian = math.cos(polar) * outward - math.sin(polar) * upward
            local = np.stack([radial, meridian, around])
        return np.asarray(local @ self.axes, dtype=np.float64)


BASIC = System("R", np.zeros(3), np.eye(3))
CARDS = {f"CORD{n}{kind}": (n, kind) for n in (1, 2) for kind in "RCS"}
"""How a system is given, by grid points (1) or by numbers (2), and its kind."""


@dataclass
class Systems:
    """All coordinate systems of a deck, made when they are first asked for.

    Parameters
    ----------
    given
        The card of each system, and the place in it where the numbers begin.
    grids
        Basic coordinates of a grid point, by its number and the card that asks for it.
    """

    given: Mapping[int, tuple[Card, int]]
    grids: Place
    made: dict[int, System] = field(default_factory=lambda: {0: BASIC})
    open: list[int] = field(default_factory=list)

    def system(self, number: int, card: Card) -> System:
        """A system by its number, for the card that names it."""
        if number in self.made:
            return self.made[number]
        if number not in self.given:
            raise card.fail(f"names the coordinate system {number}, which is not defined")
        own, first = self.given[number]
        if number in self.open:
            raise own.fail(f"coordinate system {number} rests on itself")
        self.open.append(number)
        by, kind = CARDS[own.name]
        if by == 1:
            points = [self.grids(own.whole(first + i), own) for i in range(3)]
        else:
            base = self.system(own.whole(first, 0), own)
            numbers = np.array(own.reals(first + 1, 9)).reshape(3, 3)
            points = [base.place(each) for each in numbers]
        self.open.pop()
        self.made[number] = System(kind, points[0], axes_of(own, *points))
        return self.made[number]


def axes_of(card: Card, origin: FloatArray, above: FloatArray, aside: FloatArray) -> FloatArray:
    """Axes as rows from the origin, a point on z and one in the x-z plane."""
    z = above - origin
    y = np.cross(z, aside - origin)
    sizes = np.linalg.norm(z), np.linalg.norm(y)
    if not (sizes[0] > 0.0 and sizes[1] > 1e-12 * sizes[0] * np.linalg.norm(aside - origin)):
        raise card.fail("its three points lie on a line and determine no axes")
    z, y = z / sizes[0], y / sizes[1]
    return np.stack([np.cross(y, z), y, z])
