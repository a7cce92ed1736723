"""Test functions along curves of orbits: which further condition is met on the way."""

from __future__ import annotations

import math

import numpy as np

from nldyn.base.arrays import Complex, Real
from nldyn.base.errors import FAILURES, ConvergenceError
from nldyn.bifurcations.rigid_grazing import RootMap
from nldyn.bifurcations.rigid_touch import Touches
from nldyn.bifurcations.sign_changes import COMPLEX
from nldyn.orbits.bordered import CLEAR, Condition, Evaluation, nearest_depth
from nldyn.orbits.conditions import BranchPointCondition, Grazing, Singular
from nldyn.orbits.critical_functions import branch_point_test, flip_test, torus_test
from nldyn.orbits.orbit import Orbit

# Derivatives of the monodromy matrix are differences over at most 1e-3 of the orbit's size: its
# error of 1e-10 then makes one of 1e-7 in the first and of 1e-4 in the second. They must not reach
# across a grazing, where the first jumps; nearer to one than this they are not computed.
DIFFERENCE = 1e-3
SHORTEST_DIFFERENCE = 1e-5
UNIT_PRODUCT = 1e-6  # distance from 1 of products on a curve where they are 1
DOUBLE = 1e-6  # product of unit null vectors from which a multiplier counts as double


def codimension_tests(condition: Condition, at: Evaluation) -> dict[str, float]:
    """Test functions by the name of the point at which they vanish.

    Parameters
    ----------
    condition : Condition
        What holds on the curve.
    at : Evaluation
        A point of it.

    Returns
    -------
    dict of str to float
        The names are those of MatCont, but for grazing (GR), which comes first in a pair of names;
        GGR is the degenerate one of a rigid stop.
    """
    mu = at.orbit.multipliers
    if isinstance(condition, Singular):
        tests = {
            "LP": along_folds,
            "PD": along_flips,
            "NS": along_tori,
        }[condition.kind](condition, at.orbit, mu)
        if at.family.start:  # the borders are of other phases than the orbit's
            return {name: tests[name] for name in tests if name not in ("CP", "GPD")}
        return tests
    if isinstance(condition, BranchPointCondition):
        return along_branch_points(mu)
    tests = {
        "PD": flip_test(mu), "NS": torus_test(mu) if mu.size > 2 else 1.0,
        "LP": branch_point_test(mu),
    }  # fmt: skip
    if not isinstance(condition, Grazing):
        return tests
    found = {f"GR{name}": value for name, value in tests.items()}
    return found | {"GGR": trace_of_impact(condition, at.orbit)} if condition.half else found


def trace_of_impact(condition: Grazing, orbit: Orbit) -> float:
    """What a slight impact leaves of itself up to the next grazing of the rigid stop, c A b.

    Where it is zero the multiplier does not grow without bounds (Nordmark 1991; Fredriksson and
    Nordmark 1997). It is nan where the motion around the stop fails.
    """
    try:
        return RootMap.of(Touches.of(orbit, grazing=condition)).trace
    except FAILURES:
        return math.nan


def along_folds(condition: Singular, orbit: Orbit, mu: Complex) -> dict[str, float]:
    """Tests on a curve of folds: cusp, and what the other multipliers do."""
    others = np.delete(mu, int(np.argmin(np.abs(mu - 1.0))))
    tests = {
        "CP": fold_coefficient(orbit, condition.left, condition.right),
        "R1": branch_point_test(others),
        "LPPD": flip_test(others),
    }
    if others.size > 2:
        tests["LPNS"] = torus_test(others)
    return tests


def along_flips(condition: Singular, orbit: Orbit, mu: Complex) -> dict[str, float]:
    """Tests on a curve of flips: degenerate flip, and what the other multipliers do."""
    others = np.delete(mu, int(np.argmin(np.abs(mu + 1.0))))
    tests = {
        "GPD": flip_coefficient(orbit, condition.left, condition.right),
        "LPPD": branch_point_test(others),
        "R2": flip_test(others),
    }
    if others.size > 2:
        tests["PDNS"] = torus_test(others)
    return tests


def along_tori(_: Singular | None, orbit: Orbit | None, mu: Complex) -> dict[str, float]:
    """Tests on a Neimark-Sacker curve: strong resonances, and what the other multipliers do."""
    pair, cosine = torus_pair(mu), torus_cosine(mu)
    others = np.delete(mu, pair)
    tests = {
        "R1": 1.0 - cosine,
        "R2": 1.0 + cosine,
        "R3": cosine + 0.5,
        "R4": cosine,
        "LPNS": branch_point_test(others),
        "PDNS": flip_test(others),
    }
    if others.size > 2:
        tests["NSNS"] = torus_test(others)
    return tests


def along_branch_points(mu: Complex) -> dict[str, float]:
    """Tests on a curve of branch points: what the other multipliers do."""
    others = np.delete(mu, int(np.argmin(np.abs(mu - 1.0))))
    tests = {"R1": branch_point_test(others), "BPPD": flip_test(others)}
    if others.size > 2:
        tests["BPNS"] = torus_test(others)
    return tests


def torus_pair(mu: Complex) -> list[int]:
    """Indices of the two multipliers whose product is nearest to 1."""
    i, j = np.triu_indices(mu.size, 1)
    best = int(np.argmin(np.abs(mu[i] * mu[j] - 1.0)))
    return [int(i[best]), int(j[best])]


def torus_cosine(mu: Complex) -> float:
    """Half the sum of the two multipliers whose product is nearest to 1.

    The cosine of their angle on the unit circle, beyond ±1 at a neutral saddle.
    """
    pair = torus_pair(mu)
    return 0.5 * float((mu[pair[0]] + mu[pair[1]]).real)


def cosine_near(mu: Complex, cosine: float) -> float:
    """The `torus_cosine` nearest to a value, of all pairs of multipliers whose product is 1."""
    i, j = np.triu_indices(mu.size, 1)
    off = np.abs(mu[i] * mu[j] - 1.0)
    found = 0.5 * (mu[i] + mu[j]).real[off <= max(UNIT_PRODUCT, off.min())]
    return float(found[np.argmin(np.abs(found - cosine))])


def is_torus_curve(condition: Condition) -> bool:
    """Whether a pair of multipliers has the product 1 on a curve: Neimark-Sacker, or neutral."""
    return isinstance(condition, Singular) and condition.kind == "NS"


def is_torus(mu: Complex) -> bool:
    """Whether the multipliers whose product is nearest to 1 are a complex pair."""
    value = mu[torus_pair(mu)[0]]
    return bool(abs(value.imag) > COMPLEX * abs(value))


def fold_coefficient(orbit: Orbit, left: Real, right: Real) -> float:
    """Product pᵀB(q, q) with null vectors p, q of Φ - 1, relative to the orbit's size.

    It is zero at a cusp. B is the second derivative of the map over the orbit's period (Kuznetsov
    2004, section 9.4). Close to a grazing it is nan.
    """
    h = _reach(orbit)
    if h < SHORTEST_DIFFERENCE:
        return math.nan
    before, after = _jacobians_beside(orbit, right, h)
    return float(left @ (after - before) @ right) / (2.0 * h)


def flip_coefficient(orbit: Orbit, left: Real, right: Real) -> float:
    """Normal form coefficient of a flip relative to the orbit's size; zero where it degenerates.

    pᵀ(C(q, q, q) + 3B(q, (1 - Φ)⁻¹B(q, q)))/6 with pᵀq = 1 (Kuznetsov 2004, eq. 5.44); positive
    where the doubled orbits are stable in the plane of the flip. Close to a grazing, and where two
    multipliers are -1, it is nan.
    """
    h = _reach(orbit)
    if h < 10.0 * SHORTEST_DIFFERENCE or abs(float(left @ right)) < DOUBLE:
        return math.nan
    before, after = _jacobians_beside(orbit, right, h)
    monodromy = orbit.monodromy
    p = left / float(left @ right)
    second = (after - before) / (2.0 * h)
    third = float(p @ (after - 2.0 * monodromy + before) @ right) / h**2
    shift = np.linalg.solve(np.eye(len(monodromy)) - monodromy, second @ right)
    return (third + 3.0 * float(p @ second @ shift)) / 6.0


def _reach(orbit: Orbit) -> float:
    """Length of a difference that crosses no grazing, relative to the orbit's size."""
    return min(CLEAR * nearest_depth(orbit), DIFFERENCE)


def _jacobians_beside(orbit: Orbit, direction: Real, h: float) -> tuple[Real, Real]:
    """Monodromy matrices of the motions that start a small way before and behind the orbit."""
    problem = orbit.problem
    h *= problem.scale(orbit.point)
    start = problem.nodes(orbit.point)[0]
    found = []
    for sign in (-1.0, 1.0):
        segments = problem.flow.shoot(
            (start + sign * h * direction)[None], problem.phases, orbit.omega, chained=True
        )
        if segments.failure:
            raise ConvergenceError(segments.failure)
        found.append(segments.monodromy)
    return found[0], found[1]
