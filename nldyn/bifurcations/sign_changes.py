"""Test functions along a branch, their changes of sign, and whether events explain what changes."""

from __future__ import annotations

import numpy as np

from nldyn.bifurcations.kinds import KINDS
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.orbits.critical_functions import ROUNDED_MODULUS, number_outside
from nldyn.orbits.orbit import Orbit

ON_CIRCLE = 1e-8  # of a product of two multipliers: rounding of one that is 1
ROUNDED = 1e-8  # below which the sign of a branch point's test may be rounding
COMPLEX = 1e-6  # share of the imaginary part, above which a multiplier is not real


def tests(point: BranchNode) -> dict[str, float]:
    """All smooth test functions at a point; LP is the frequency part of the tangent.

    Without damping the multipliers of every stable orbit lie on the unit circle and leave it in
    fours, which is no Neimark-Sacker point; the torus test is rounding noise there.
    """
    if not point.tests:
        orbit, found = point.orbit, point.orbit.critical
        pairs = orbit.multipliers.size > 2 and not orbit.system.conservative
        point.tests.update(
            LP=float(point.tangent[-1]),
            PD=found.flip,
            BP=found.branch_point,
            NS=found.torus if pairs else 1.0,
        )
    return point.tests


def crosses(a: BranchNode, b: BranchNode) -> bool:
    """Whether a branch crosses another one between two points, or jumps to it.

    The determinant of the shooting equations bordered by the tangent keeps its sign along a branch
    up to where it crosses another one. It has the sign of det(Φ - 1) over the tangent's frequency
    part, for both vanish at a fold.
    """
    first, last = tests(a), tests(b)
    if min(abs(first["BP"]), abs(last["BP"])) < ROUNDED:
        return False
    return first["BP"] * first["LP"] * last["BP"] * last["LP"] < 0.0


def accounted(a: Orbit, found: list[SpecialPoint], b: Orbit) -> bool:
    """Whether the special points from a to b explain how many multipliers leave the unit circle.

    At each of them the other multipliers tell the number outside on either side.
    """
    outside = _from_to(a.critical.outside)
    for special in found:
        if special.kind == "GR":
            continue
        mu = special.orbit.multipliers
        if special.kind == "NS":
            off_circle = np.where(mu.imag == 0.0, np.inf, np.abs(np.abs(mu) - 1.0))
            crossing = np.argsort(off_circle, kind="stable")[:2]
        else:
            crossing = np.argsort(np.abs(mu - KINDS[special.kind].multiplier))[:1]
        size = crossing.size
        others = _from_to(number_outside(np.delete(mu, crossing), ROUNDED_MODULUS))
        outside = {n + size for n in others & outside} | {n for n in others if n + size in outside}
    return bool(outside & _from_to(b.critical.outside))


def _from_to(bounds: tuple[int, int]) -> set[int]:
    """Whole numbers from the fewest to the most."""
    fewest, most = bounds
    return set(range(fewest, most + 1))


def leaves_circle(a: Orbit, b: Orbit) -> bool:
    """Whether the pair nearest to the unit circle lies beside it at one of two orbits.

    The pair of a mode without damping stays on it, where the torus test is rounding noise.
    """
    return max(a.critical.off, b.critical.off) > ON_CIRCLE


def _on_unit_circle(orbit: Orbit) -> bool:
    """Whether a complex pair (not a real pair μ, 1/μ) is what makes the torus test vanish."""
    mu = complex(orbit.multipliers[orbit.critical.pair])
    return abs(mu.imag) > COMPLEX * abs(mu)


def changed(a: BranchNode, b: BranchNode) -> list[str]:
    """Tests that change their sign between two points."""
    before, after = tests(a), tests(b)
    return [kind for kind in before if before[kind] * after[kind] < 0.0]
