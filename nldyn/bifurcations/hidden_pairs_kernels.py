"""Compiled: multipliers between two orbits, and where they may cross the unit circle."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from nldyn.base import arrays
from nldyn.base.arrays import TINY, Real
from nldyn.flow.kernels.compiling import inner, njit
from nldyn.orbits import critical_functions
from nldyn.orbits.critical_functions import LEAST_MODULUS, NEAR_CIRCLE, number_outside, travel
from nldyn.orbits.periodic_schur import product_eigenvalues
from nldyn.runtime.kernel_cache import resting_on

compiled = resting_on(
    njit(cache=True, error_model="numpy"), critical_functions.__file__, arrays.__file__
)


@compiled
def jacobians_between(jacobians, places, first, last, sigmas):
    """Jacobians (m, k, n, n) at positions (m,) between those (p, k, n, n) of p orbits.

    Those from first up to last are taken, a polynomial for each segment.
    """
    found = np.zeros((sigmas.size, *jacobians.shape[1:]))
    for at in range(sigmas.size):
        for i in range(first, last):
            weight = 1.0
            for j in range(first, last):
                if j != i:
                    weight *= (sigmas[at] - places[j]) / (places[i] - places[j])
            found[at] += weight * jacobians[i]
    return found


def interpolated(
    jacobians: Real, places: Real, first: int, last: int, sigmas: Real
) -> NDArray[np.complex128]:
    """Multipliers (m, n) of those Jacobians: they themselves are not smooth where they meet.

    In Python: the eigenvalues would be compiled once more for each kernel that needs them.
    """
    between = jacobians_between(jacobians, places, first, last, sigmas)
    return np.array([product_eigenvalues(pieces)[0] for pieces in between])


def error_half_way(
    jacobians: Real, places: Real, first: int, middle: NDArray[np.complex128]
) -> float:
    """How far the multipliers near the circle move where an orbit is left out.

    They are those half-way between the places first and first + 1.
    """
    sigmas = np.array([0.5])
    if places.size == 3:
        return float(travel(middle, interpolated(jacobians, places, first, first + 2, sigmas)[0]))
    left = interpolated(jacobians, places, 0, 3, sigmas)[0]
    right = interpolated(jacobians, places, 1, 4, sigmas)[0]
    return float(max(travel(middle, left), travel(middle, right)))


@compiled
def off_circle(multipliers):
    """Distance of the nearest multiplier from the unit circle."""
    least = np.inf
    for mu in multipliers:
        least = min(least, abs(abs(mu) - 1.0))
    return least


@compiled
def farthest_travel(before, after):
    """Longest way of a multiplier near the circle from one set to the other, either way."""
    return max(travel(before, after), travel(after, before))


@compiled
def meetings(before, after, way, error_before, error_after, coarse):
    """Whether multipliers near the unit circle may meet, or touch it, between two sets of them.

    Parameters
    ----------
    before, after : (n,) complex
        The multipliers.
    way : float
        How far one moves between them.
    error_before, error_after : float
        Of the multipliers.
    coarse : bool
        Whether to say so, too, of multipliers that come near the circle alone.

    Returns
    -------
    int
        0: they do not, or too far inside to come out. 1: smaller steps tell, as where several
        cross it. 2: the error hides it.
    """
    verdict, error, crossings = 0, max(error_before, error_after), 0
    for i in range(before.size):
        mu = before[i]
        height = distance(mu)
        if mu.imag < 0.0 or abs(height) > NEAR_CIRCLE:
            continue
        j = closest(after, mu)
        step, later = abs(after[j] - mu), distance(after[j])
        off = min(abs(height), abs(later)) if height * later > 0.0 else 0.0
        if 2.0 * (way + error) < off:
            continue
        crossings += height * later < 0.0
        gap = min(to_others(before, i), to_others(after, j))
        if gap < 4.0 * (max(way, step) + error):
            if 2.0 * error > off > 0.0:
                return 2
            verdict = 1
        elif coarse:
            near = abs(height) < 1.5 * error_before or abs(later) < 1.5 * error_after
            if near or off < 0.5 * abs(height - later):
                verdict = 1
    return 1 if crossings > 1 else verdict


@compiled
def doubtful(sigmas, sets, error):
    """Where a multiplier that is followed through some sets may cross the circle more than once.

    The error of ln|μ| is taken as a constant between -1 and 1 times `error` σ(1 - σ).

    Parameters
    ----------
    sigmas : (m,)
        Positions of the sets, from 0 to 1.
    sets : (m, n) complex
        Multipliers; the first and the last are exact.
    error : float
        Of the sets between them.

    Returns
    -------
    int
        Number of a set, or -1.
    """
    m, n = sets.shape
    found, worst = -1, 0.0
    ratios = np.empty(m)
    for backward in (False, True):
        for i in range(n):
            at = i
            for k in range(m):
                now = m - 1 - k if backward else k
                if k > 0:
                    at = closest(sets[now], sets[now + 1 if backward else now - 1][at])
                size = error * sigmas[now] * (1.0 - sigmas[now])
                ratios[k] = distance(sets[now][at]) / max(size, TINY)
            k = doubtful_in(ratios)
            if k >= 0:
                now = m - 1 - k if backward else k
                if sigmas[now] * (1.0 - sigmas[now]) > worst:
                    found, worst = now, sigmas[now] * (1.0 - sigmas[now])
    return found


@compiled
def dips_towards_circle(sets, errors):
    """Beside which sets (m, n) of multipliers one comes near the circle and goes again.

    That is where its distance is less than what a parabola may dip between three of them, and not
    hidden by the error, (m,).
    """
    m, n = sets.shape
    found = np.zeros(m, dtype=np.bool_)
    for k in range(1, m - 1):
        for i in range(n):
            here = distance(sets[k][i])
            size = abs(here)
            if not errors[k] < size < NEAR_CIRCLE:
                continue
            before = distance(sets[k - 1][closest(sets[k - 1], sets[k][i])])
            after = distance(sets[k + 1][closest(sets[k + 1], sets[k][i])])
            if before * here > 0.0 and here * after > 0.0:
                least = min(abs(before), abs(after))
                if size <= least and size < 0.5 * (abs(before) + abs(after) - 2.0 * size):
                    found[k] = True
    return found


@compiled
def return_of_outside(sigmas, sets):
    """At which of the sets more or fewer are outside than on the way from first to last, or -1."""
    m = sigmas.size
    counts = np.array([number_outside(multipliers, 0.0)[0] for multipliers in sets])
    found, worst, reached = -1, 0.0, counts[0]
    rising = 1 if counts[m - 1] >= counts[0] else -1
    for k in range(1, m - 1):
        beyond = rising * (counts[k] - counts[m - 1]) > 0 or rising * (counts[k] - reached) < 0
        if beyond and sigmas[k] * (1.0 - sigmas[k]) > worst:
            found, worst = k, sigmas[k] * (1.0 - sigmas[k])
        reached = max(reached, counts[k]) if rising > 0 else min(reached, counts[k])
    return found


@inner
def doubtful_in(ratios):
    """The first place at which a number in -1 ... 1 may be passed for the second time, or -1."""
    m = ratios.size
    rising = ratios[m - 1] > 0.0
    if rising == (ratios[0] > 0.0):
        best, where = 1.0, -1
        for k in range(1, m - 1):
            ratio = ratios[k] if rising else -ratios[k]
            if ratio < best:
                best, where = ratio, k
        return where
    reached = -np.inf
    for k in range(m):
        ratio = ratios[k] if rising else -ratios[k]
        if ratio < min(reached, 1.0) and reached > -1.0:
            return k - 1 if k == m - 1 else k
        reached = max(reached, ratio)
    return -1


@inner
def distance(mu):
    """ln|μ|, negative within the unit circle, not below that of `LEAST_MODULUS`."""
    return math.log(max(abs(mu), LEAST_MODULUS))


@inner
def closest(multipliers, mu):
    """Index of the multiplier nearest to another one."""
    best, least = 0, np.inf
    for k in range(multipliers.size):
        if abs(multipliers[k] - mu) < least:
            best, least = k, abs(multipliers[k] - mu)
    return best


@inner
def to_others(multipliers, i):
    """Distance of a multiplier from the nearest of the others."""
    least = np.inf
    for k in range(multipliers.size):
        if k != i:
            least = min(least, abs(multipliers[k] - multipliers[i]))
    return least
