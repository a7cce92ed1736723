"""Where between two points of a branch multipliers may cross the unit circle and come back.

The Jacobians of the shooting segments change smoothly along a branch, also where multipliers meet
and part, which have no derivative there. Interpolated through the two points and those beside
them, they tell the multipliers within the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Complex
from nldyn.bifurcations.hidden_multipliers import (
    Along,
    dips_towards_circle,
    doubtful,
    meetings,
    return_of_outside,
)
from nldyn.orbits.orbit import Orbit

COARSE = 0.1  # part of a step down to which a multiplier near the circle is followed
FINEST = 2.0**-12  # part of a step to which meeting multipliers are followed
CALM = 1.0  # of their distance to the circle: multipliers that move by less do not come to it
MOST_SAMPLES = 96


class Between:
    """Multipliers between two orbits of a branch.

    Parameters
    ----------
    orbits : sequence of Orbit
        Two, three or four neighbours of one branch, in its order.
    places : sequence of float
        Their positions along it, 0 and 1 for the two between which to look.
    """

    def __init__(self, orbits: Sequence[Orbit], places: Sequence[float]) -> None:
        self.places = np.array(places)
        self.along = Along(np.array([orbit.jacobians for orbit in orbits]), self.places)
        self.first = int(np.flatnonzero(self.places == 0.0)[0])
        self.spectra = [orbit.multipliers for orbit in orbits]
        self.ends = [orbits[self.first + i].multipliers for i in range(2)]

    def at(self, sigmas: Sequence[float]) -> NDArray[np.complex128]:
        """Multipliers (m, 2n) at positions (m,) by interpolation."""
        return self.along.multipliers(np.array(sigmas, dtype=float))

    def where_to_look(self) -> float | None:
        """Position of an orbit that would tell whether a multiplier crosses the circle twice.

        None where none does by what the interpolation says.
        """
        before, after = self.ends
        if self.places.size == 2:
            return 0.5
        calm, middle, speed = self.along.half_way(before, after, CALM)
        known = {0.0: before, 0.5: middle, 1.0: after}
        if calm:
            return None
        error = self.along.error_half_way(self.first, middle)
        fresh = {0.5}
        while fresh:
            sigmas = sorted(known)
            split = set()
            for low, high in pairwise(sigmas):
                if low not in fresh and high not in fresh:
                    continue
                a, b, wide = known[low], known[high], high - low > COARSE
                off = error * bulge(low), error * bulge(high)
                way = speed * (high - low)
                verdict = max(
                    meetings(a, b, way, *off, wide), meetings(b, a, way, *off[::-1], wide)
                )
                if verdict == 2 or (verdict == 1 and high - low < FINEST):
                    return 0.5 * (low + high)
                if verdict == 1:
                    split.add(0.5 * (low + high))
            split |= self._beside_dips(known, error)
            if len(known) + len(split) > MOST_SAMPLES:
                return min(split)
            wanted = sorted(split)
            if wanted:
                known.update(zip(wanted, self.at(wanted), strict=True))
            fresh = split
        places = np.array(sorted(known))
        sets = np.array([known[sigma] for sigma in places])
        odd = max(return_of_outside(places, sets), doubtful(places, sets, 4.0 * error))
        return None if odd < 0 else float(places[odd])

    def _beside_dips(self, known: dict[float, Complex], error: float) -> set[float]:
        """Positions half-way to the next known ones from where a multiplier nears the circle."""
        beside = dict(zip(self.places.tolist(), self.spectra, strict=True)) | known
        sigmas = sorted(beside)
        sizes = np.array([error * max(bulge(sigma), 0.0) for sigma in sigmas])
        found: set[float] = set()
        sets = np.array([beside[x] for x in sigmas])
        for i in np.flatnonzero(dips_towards_circle(np.array(sigmas), sets, sizes)):
            for low, high in ((sigmas[i - 1], sigmas[i]), (sigmas[i], sigmas[i + 1])):
                if low >= 0.0 and high <= 1.0 and high - low > FINEST:
                    found.add(0.5 * (low + high))
        return found


def bulge(sigma: float) -> float:
    """Shape of the error of an interpolation between two points."""
    return 4.0 * sigma * (1.0 - sigma)
