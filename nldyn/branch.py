"""Branches of periodic orbits: points, special points, and orbits between the points."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from nldyn.errors import check_frequency
from nldyn.linear import Real
from nldyn.orbit import ConvergenceError, Orbit, refine

CLOSED = "closed branch"  # why a continuation stopped


@dataclass(frozen=True, eq=False)
class BranchPoint:
    """An orbit on a branch with the branch's direction there.

    Parameters
    ----------
    orbit : Orbit
        The orbit.
    tangent : (N + 1,)
        Unit tangent in the metric of the shooting problem.
    arclength : float
        Relative arclength from the branch's first computed point.
    tests : dict of str to float
        Test functions, filled when first asked for (see `nldyn.special.tests`).
    """

    orbit: Orbit
    tangent: Real
    arclength: float
    tests: dict[str, float] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, eq=False)
class SpecialPoint:
    """A located bifurcation or grazing point.

    Parameters
    ----------
    kind : {"LP", "PD", "NS", "BP", "GR"}
        Cyclic fold, flip, Neimark-Sacker, branch point, grazing.
    point : BranchPoint
        The orbit at which it happens.
    frequency_error : float
        Estimated error of the root in frequency and the last Newton step, relative.
    """

    kind: str
    point: BranchPoint
    frequency_error: float

    @property
    def orbit(self) -> Orbit:
        """The orbit."""
        return self.point.orbit

    @property
    def frequency_hz(self) -> float:
        """Excitation frequency in Hz."""
        return self.point.orbit.frequency_hz


@dataclass(frozen=True, eq=False)
class Branch:
    """A curve of periodic orbits of one period multiple.

    Parameters
    ----------
    name : str
        Name in tables and legends.
    period : int
        Period multiple n.
    nodes : tuple of BranchPoint
        Computed points in order along the branch.
    special_points : tuple of SpecialPoint
        In the same order.
    stop_reasons : tuple of str
        Why the continuation stopped at the first and at the last point.
    notes : tuple of str
        What may be missing.
    """

    name: str
    period: int
    nodes: tuple[BranchPoint, ...]
    special_points: tuple[SpecialPoint, ...]
    stop_reasons: tuple[str, str]
    notes: tuple[str, ...] = ()

    @property
    def points(self) -> list[Orbit]:
        """The orbits, in order."""
        return [node.orbit for node in self.nodes]

    @property
    def closed(self) -> bool:
        """Whether the branch ends where it began: its last point lies just beyond its first."""
        return CLOSED in self.stop_reasons

    @property
    def stop_reason(self) -> str:
        """Why the continuation stopped at either end, in one line."""
        return " / ".join(self.stop_reasons)

    @property
    def frequency_hz(self) -> Real:
        """Frequencies of the points in Hz."""
        return np.array([orbit.frequency_hz for orbit in self.points])

    @property
    def max_abs_displacement(self) -> Real:
        """Largest absolute displacements in m."""
        return np.array([orbit.max_abs_displacement for orbit in self.points])

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Stability of the points."""
        return np.array([orbit.stable for orbit in self.points])

    def at(self, frequency_hz: float) -> list[Orbit]:
        """All orbits of the branch at one frequency, corrected from its neighbours.

        These are its points and special points: between a fold and the points beside it there may
        be two orbits.

        Raises
        ------
        SystemModelError
            If the frequency is not a positive number.

        Examples
        --------
        >>> branch.at(20.0)[0].frequency_hz        # doctest: +SKIP
        20.0
        """
        check_frequency("frequency_hz", frequency_hz)
        p = math.log(2.0 * math.pi * frequency_hz)
        found: list[Orbit] = []
        places = [*self.nodes, *(special.point for special in self.special_points)]
        places.sort(key=lambda place: place.arclength)
        for a, b in pairwise(places):
            pa, pb = a.orbit.point[-1], b.orbit.point[-1]
            if min(pa, pb) <= p <= max(pa, pb):
                share = 0.5 if pa == pb else (p - pa) / (pb - pa)
                guess = (1.0 - share) * a.orbit.point + share * b.orbit.point
                problem = a.orbit.problem
                try:
                    orbit = refine(problem, problem.nodes(guess), math.exp(p), a.orbit.observe)
                except ConvergenceError:
                    continue
                if not any(same_orbit(orbit, other) for other in found):
                    found.append(orbit)
        return found

    def contains(self, orbit: Orbit) -> bool:
        """Whether the branch passes through an orbit (up to a shift by whole periods)."""
        if orbit.period != self.period:
            return False
        return any(same_orbit(orbit, other) for other in self.at(orbit.frequency_hz))


def stroboscopic(orbit: Orbit) -> Real:
    """States (n, 2n_modes) at the start of each excitation period."""
    problem = orbit.problem
    return problem.nodes(orbit.point)[:: problem.segments // problem.period]


def same_orbit(a: Orbit, b: Orbit, rtol: float = 1e-5) -> bool:
    """Whether two orbits at one frequency agree up to a shift by whole excitation periods."""
    if a.period != b.period or not math.isclose(a.omega, b.omega, rel_tol=1e-9):
        return False
    first, second = stroboscopic(a), stroboscopic(b)
    scale = a.problem.scale(a.point)
    return any(
        float(np.abs(first - np.roll(second, shift, axis=0)).max()) <= rtol * scale
        for shift in range(a.period)
    )


def minimal_period(orbit: Orbit, rtol: float = 1e-6) -> int:
    """Smallest number of excitation periods after which the orbit really repeats."""
    states = stroboscopic(orbit)
    scale = orbit.problem.scale(orbit.point)
    for n in range(1, orbit.period):
        if orbit.period % n == 0:
            shifted = np.roll(states, n, axis=0)
            if float(np.abs(states - shifted).max()) <= rtol * scale:
                return n
    return orbit.period
