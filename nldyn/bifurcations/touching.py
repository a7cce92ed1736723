"""Extremes of the penetrations that change their sign between two orbits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import LocateError
from nldyn.bifurcations.point import BranchNode
from nldyn.engine.sample import of_stop
from nldyn.orbits.bordered import length_unit
from nldyn.orbits.extremes import alone, nearest, sign_changes
from nldyn.orbits.orbit import Extremes, Orbit
from nldyn.system.system import System

EXACT = 1e-9  # of an orbit's size: depth of a touch that is solved for


@dataclass(frozen=True)
class Touch:
    """An extremum of a stop's penetration whose sign differs between two neighbouring orbits."""

    output: int
    is_maximum: bool
    phase: float

    def depth(self, point: BranchNode) -> float:
        """Value of the extremum of this kind nearest in phase."""
        orbit, full = point.orbit, 2.0 * math.pi * point.orbit.period
        found = nearest(orbit.touched, self.output, self.is_maximum, self.phase, full)
        if found is None:
            raise LocateError("an extreme has vanished")
        return float(found[1])


@lru_cache(maxsize=4)  # of a step it is asked for by all that look into it
def touching_extremes(a: Orbit, b: Orbit) -> tuple[Touch, ...]:
    """Extremes of the penetrations that change sign between two neighbouring orbits.

    A maximum that becomes positive is a new contact; a minimum that becomes negative splits one.
    """
    changes = sign_changes(a.touched, b.touched, len(a.system.stops), 2.0 * math.pi * a.period)
    return tuple(Touch(int(key) // 2, key % 2 == 1, phase) for key, phase in changes)


def changes_hidden_by_birth(a: Orbit, b: Orbit) -> bool:
    """Whether extremes that only one of two orbits has are across the stop in the other.

    A maximum and a minimum of the penetration that are born together in flight may both reach the
    stop before the next point: a new contact and its union with another one, after which there are
    as many contacts as before.
    """
    for output, (count, other) in enumerate(zip(a.touch_counts, b.touch_counts, strict=True)):
        if count == other:
            continue
        fewer, more = (a, b) if count < other else (b, a)
        first, last = (of_stop(orbit.touched, output) for orbit in (fewer, more))
        new = last[alone(first, last, 2.0 * math.pi * a.period)]
        if np.any(new[:, 1] * fewer.penetration(output, new[:, 0]) < 0.0):
            return True
    return False


def rigid_grazing(orbit: Orbit) -> tuple[int, float, float] | None:
    """Rigid stop, phase and depth (in m) of the slightest impact or nearest miss; None without one.

    The depth of an impact is its speed over ω.
    """
    return min(rigid_touches(orbit), key=lambda entry: abs(entry[2]), default=None)


def rigid_touches(orbit: Orbit) -> list[tuple[int, float, float]]:
    """Rigid stop, phase and depth (in m) of all impacts and near misses."""
    return [
        (stop, float(phase), float(depth))
        for stop in orbit.system.rigid_stops
        for phase, depth in zip(*_maxima(orbit.touches(stop)), strict=True)
    ]


def grazes_exactly(orbit: Orbit) -> bool:
    """Whether an orbit grazes a rigid stop, as one that was solved for does."""
    found = rigid_grazing(orbit)
    return found is not None and abs(found[2]) < EXACT * length_unit(orbit)


def _maxima(found: Extremes) -> tuple[Real, Real]:
    return found.phases[found.is_maximum], found.values[found.is_maximum]


def touches_sharply(system: System) -> bool:
    """Whether there is a stop that is touched sharply, see `Stop.sharp`."""
    return any(stop.sharp for stop in system.stops)
