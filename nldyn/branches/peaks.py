"""Resonance peaks of a branch: where the largest displacement is locally largest."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from scipy.optimize import minimize_scalar

from nldyn.base.errors import LocateError
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.point import BranchNode
from nldyn.branches.branch import Branch
from nldyn.orbits.orbit import Orbit

WHERE = 1e-4  # of a step: the height of a peak is flat there


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


def resonance_peaks(branch: Branch, limits: tuple[float, float] | None = None) -> list[Peak]:
    """Tops of a branch, in order along it, refined between the computed points.

    Parameters
    ----------
    branch : Branch
        A branch.
    limits : (float, float), optional
        Only tops between these values of the parameter.

    Returns
    -------
    list of Peak

    Examples
    --------
    >>> resonance_peaks(branch, (20.0, 30.0))[0].frequency_hz       # doctest: +SKIP
    25.371
    """
    low, high = limits or (-math.inf, math.inf)
    peaks = []
    for around in _neighbourhoods(branch):
        if len(around) < 3:
            continue
        before, here, after = (node.orbit.max_abs_displacement for node in around)
        if before <= here > after and low <= around[1].value <= high:
            peaks.append(Peak(_refined(around, 1.0)))
    return peaks


def lowest_orbit(branch: Branch, limits: tuple[float, float]) -> Orbit | None:
    """The orbit of smallest largest displacement between two values, refined as the tops are.

    None if the branch has no computed point there.
    """
    low, high = limits
    inside = [
        (node.orbit.max_abs_displacement, around)
        for node, around in zip(branch.nodes, _neighbourhoods(branch), strict=False)
        if low <= node.value <= high
    ]
    return _refined(min(inside, key=lambda pair: pair[0])[1], -1.0) if inside else None


def _neighbourhoods(branch: Branch) -> list[tuple[BranchNode, ...]]:
    """Every point between those beside it, which an end has on one side only.

    A closed branch has no end: its last point, which lies just beyond its first, is left out.
    """
    nodes = branch.nodes
    if branch.closed:
        ring = (nodes[-2], *nodes[:-1], nodes[0])
        return [ring[i : i + 3] for i in range(len(nodes) - 1)]
    return [nodes[max(i - 1, 0) : i + 2] for i in range(len(nodes))]


def _refined(around: tuple[BranchNode, ...], sense: float) -> Orbit:
    """Highest orbit on the chords between neighbouring points, or the lowest for the sense -1."""

    def height(orbit: Orbit) -> float:
        return sense * orbit.max_abs_displacement

    best = max((node.orbit for node in around), key=height)
    for a, b in pairwise(around):
        chord = Chord(a, b)
        try:
            found = minimize_scalar(
                lambda x, c=chord: -height(c.at(float(x)).orbit),
                bounds=(0.0, 1.0),
                method="bounded",
                options={"xatol": WHERE},
            )
            orbit = chord.at(float(found.x)).orbit
        except LocateError:
            continue
        if height(orbit) > height(best):
            best = orbit
    return best
