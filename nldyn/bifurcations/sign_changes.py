"""Test functions along a branch, their changes of sign, and whether events explain what changes."""

from __future__ import annotations

import numpy as np

from nldyn.base.arrays import Complex
from nldyn.bifurcations.kinds import KINDS
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.orbits.critical_functions import (
    branch_point_test,
    flip_test,
    nearest_pair,
    number_outside,
    torus_test,
)
from nldyn.orbits.orbit import Orbit

ON_CIRCLE = 1e-8  # of a product of two multipliers: rounding of one that is 1
ROUNDED = 1e-8  # below which the sign of a branch point's test may be rounding
ROUNDED_MODULUS = 1e-6  # error of a multiplier's modulus that may be rounding
COMPLEX = 1e-6  # share of the imaginary part, above which a multiplier is not real


def tests(point: BranchNode) -> dict[str, float]:
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
    outside = _possible_outside(a.multipliers)
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
        others = _possible_outside(np.delete(mu, crossing))
        outside = {n + size for n in others & outside} | {n for n in others if n + size in outside}
    return bool(outside & _possible_outside(b.multipliers))


def _possible_outside(multipliers: Complex) -> set[int]:
    """Numbers of multipliers that may lie outside the unit circle, given their rounding."""
    fewest, most = number_outside(multipliers, ROUNDED_MODULUS)
    return set(range(fewest, most + 1))


def leaves_circle(before: Complex, after: Complex) -> bool:
    """Whether the pair nearest to the unit circle lies beside it at one of two orbits.

    The pair of a mode without damping stays on it, where the torus test is rounding noise.
    """
    return any(_pair_off_circle(mu)[1] > ON_CIRCLE for mu in (before, after))


def _pair_off_circle(multipliers: Complex) -> tuple[complex, float]:
    """One of the two multipliers whose product is nearest to 1, and how far that is from 1."""
    index, off = nearest_pair(multipliers)
    return complex(multipliers[index]), off


def _on_unit_circle(multipliers: Complex) -> bool:
    """Whether a complex pair (not a real pair μ, 1/μ) is what makes the torus test vanish."""
    mu = _pair_off_circle(multipliers)[0]
    return bool(abs(mu.imag) > COMPLEX * abs(mu))


def changed(a: BranchNode, b: BranchNode) -> list[str]:
    """Tests that change their sign between two points."""
    before, after = tests(a), tests(b)
    return [kind for kind in before if before[kind] * after[kind] < 0.0]
