"""Resonance peaks of a branch: where the largest displacement is locally largest."""

from __future__ import annotations

from dataclasses import dataclass

from scipy.optimize import minimize_scalar

from nldyn.branch import Branch
from nldyn.orbit import Orbit
from nldyn.special import Chord, LocateError


@dataclass(frozen=True)
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
            peaks.append(Peak(_refined(branch, i)))
    return peaks


def _refined(branch: Branch, i: int) -> Orbit:
    """Highest orbit on the two chords beside point i."""
    best = branch.nodes[i].orbit
    for a, b in ((i - 1, i), (i, i + 1)):
        chord = Chord(branch.nodes[a], branch.nodes[b])
        try:
            found = minimize_scalar(
                lambda x, c=chord: -c.at(float(x)).orbit.max_abs_displacement,
                bounds=(0.0, 1.0),
                method="bounded",
                options={"xatol": 1e-4},
            )
            orbit = chord.at(float(found.x)).orbit
        except LocateError:
            continue
        if orbit.max_abs_displacement > best.max_abs_displacement:
            best = orbit
    return best
