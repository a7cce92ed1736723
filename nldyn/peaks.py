"""Resonance peaks of a branch: where the largest displacement is locally largest."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from scipy.optimize import minimize_scalar

from nldyn.branch import Branch
from nldyn.orbit import Orbit
from nldyn.special import Chord, LocateError


@dataclass(frozen=True, eq=False)
class Peak:
    """A local maximum of the largest displacement along a branch.

    Parameters
    ----------
    orbit : Orbit
        The orbit at the top.
    """

    orbit: Orbit

    @property
    def frequency_hz(self) -> float:
        """Excitation frequency in Hz."""
        return self.orbit.frequency_hz

    @property
    def height(self) -> float:
        """Largest absolute displacement in m."""
        return self.orbit.max_abs_displacement


def resonance_peaks(branch: Branch, range_hz: tuple[float, float] | None = None) -> list[Peak]:
    """Tops of a branch, in order along it, refined between the computed points.

    Parameters
    ----------
    branch : Branch
        A branch.
    range_hz : (float, float), optional
        Only tops between these frequencies.

    Returns
    -------
    list of Peak

    Examples
    --------
    >>> resonance_peaks(branch, (20.0, 30.0))[0].frequency_hz       # doctest: +SKIP
    25.371
    """
    low, high = range_hz or (0.0, float("inf"))
    heights = branch.max_abs_displacement
    peaks = []
    for i in range(1, len(heights) - 1):
        top = heights[i] >= heights[i - 1] and heights[i] > heights[i + 1]
        if top and low <= branch.nodes[i].orbit.frequency_hz <= high:
            peaks.append(Peak(_refined(branch, i, 1.0)))
    return peaks


def lowest_orbit(branch: Branch, range_hz: tuple[float, float]) -> Orbit | None:
    """The orbit of smallest largest displacement between two frequencies, refined as the tops are.

    None if the branch has no computed point there.
    """
    low, high = range_hz
    inside = [i for i, o in enumerate(branch.points) if low <= o.frequency_hz <= high]
    if not inside:
        return None
    lowest = min(inside, key=lambda i: branch.nodes[i].orbit.max_abs_displacement)
    return _refined(branch, lowest, -1.0)


def _refined(branch: Branch, i: int, sense: float) -> Orbit:
    """Highest orbit on the two chords beside point i, or the lowest for the sense -1."""

    def height(orbit: Orbit) -> float:
        return sense * orbit.max_abs_displacement

    best = branch.nodes[i].orbit
    for a, b in pairwise(branch.nodes[max(i - 1, 0) : i + 2]):
        chord = Chord(a, b)
        try:
            found = minimize_scalar(
                lambda x, c=chord: -height(c.at(float(x)).orbit),
                bounds=(0.0, 1.0),
                method="bounded",
                options={"xatol": 1e-4},
            )
            orbit = chord.at(float(found.x)).orbit
        except LocateError:
            continue
        if height(orbit) > height(best):
            best = orbit
    return best
