"""Compiled test functions: what of a branch's multipliers and extremes tells of special points."""

from __future__ import annotations

import math

import numpy as np

from nldyn._kernels import inner, njit


@njit(cache=True, error_model="numpy")
def flip_test(multipliers):
    """∏(μ + 1), each factor divided by 1 + |μ|: changes sign where a multiplier crosses -1."""
    return shifted_product(multipliers, 1.0)


@njit(cache=True, error_model="numpy")
def branch_point_test(multipliers):
    """∏(μ - 1), each factor divided by 1 + |μ|: changes sign where a multiplier crosses +1."""
    return shifted_product(multipliers, -1.0)


@inner
def shifted_product(multipliers, shift):
    """∏(μ + shift) / (1 + |μ|)."""
    product = 1.0 + 0.0j
    for mu in multipliers:
        product *= (mu + shift) / (1.0 + abs(mu))
    return product.real


@njit(cache=True, error_model="numpy")
def torus_test(multipliers):
    """∏(μᵢμⱼ - 1) over pairs i < j, scaled: zero where a pair is on the unit circle.

    The product is the determinant of the bialternate product of Φ with itself minus the identity
    (Kuznetsov 2004, section 10.2.2).
    """
    product = 1.0 + 0.0j
    for i in range(multipliers.size):
        for j in range(i):
            both = multipliers[i] * multipliers[j]
            product *= (both - 1.0) / (1.0 + abs(both))
    return product.real


@njit(cache=True, error_model="numpy")
def travel(before, after):
    """Longest way of a multiplier near the unit circle to the nearest one of the next orbit."""
    longest = 0.0
    for mu in before:
        if abs(math.log(max(abs(mu), 1e-3))) < 0.4:
            shortest = np.inf
            for other in after:
                shortest = min(shortest, abs(other - mu))
            longest = max(longest, shortest)
    return longest


@njit(cache=True, error_model="numpy")
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
        if mu.imag < 0.0 or abs(height) > 0.4:
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


@njit(cache=True, error_model="numpy")
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
                ratios[k] = distance(sets[now][at]) / max(size, 1e-300)
            k = doubtful_in(ratios)
            if k >= 0:
                now = m - 1 - k if backward else k
                if sigmas[now] * (1.0 - sigmas[now]) > worst:
                    found, worst = now, sigmas[now] * (1.0 - sigmas[now])
    return found


@njit(cache=True, error_model="numpy")
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
            if not errors[k] < size < 0.4:
                continue
            before = distance(sets[k - 1][closest(sets[k - 1], sets[k][i])])
            after = distance(sets[k + 1][closest(sets[k + 1], sets[k][i])])
            if before * here > 0.0 and here * after > 0.0:
                least = min(abs(before), abs(after))
                if size <= least and size < 0.5 * (abs(before) + abs(after) - 2.0 * size):
                    found[k] = True
    return found


@njit(cache=True, error_model="numpy")
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
    """ln|μ|, negative within the unit circle, not below ln 0.001."""
    return math.log(max(abs(mu), 1e-3))


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


@njit(cache=True, error_model="numpy")
def number_outside(multipliers, tolerance):
    """Fewest and most multipliers outside the unit circle, if each modulus may be off so far."""
    fewest, most = 0, 0
    for mu in multipliers:
        fewest += abs(mu) > 1.0 + tolerance
        most += abs(mu) > 1.0 - tolerance
    return fewest, most


@njit(cache=True, error_model="numpy")
def nearest(phases, kinds, kind, phase, full):
    """Index of the extreme of a kind nearest in phase on a circle of length `full`, or -1."""
    best, shortest = -1, np.inf
    for i in range(phases.size):
        if kinds[i] == kind:
            distance = abs((phases[i] - phase + 0.5 * full) % full - 0.5 * full)
            if distance < shortest:
                best, shortest = i, distance
    return best


@njit(cache=True, error_model="numpy")
def sign_changes(phases_a, values_a, kinds_a, phases_b, values_b, kinds_b, full):
    """Kinds and phases of the extremes of a and b, nearest to each other, of opposite signs.

    The phase is that of the extreme nearer to zero.
    """
    kinds, phases = np.empty(phases_b.size, dtype=np.bool_), np.empty(phases_b.size)
    n = 0
    for kind in (True, False):
        for j in range(phases_b.size):
            if kinds_b[j] != kind:
                continue
            i = nearest(phases_a, kinds_a, kind, phases_b[j], full)
            if i < 0 or values_a[i] * values_b[j] >= 0.0:
                continue
            if nearest(phases_b, kinds_b, kind, phases_a[i], full) == j:
                kinds[n] = kind
                phases[n] = phases_b[j] if abs(values_b[j]) < abs(values_a[i]) else phases_a[i]
                n += 1
    return kinds[:n], phases[:n]


@njit(cache=True, error_model="numpy")
def alone(phases_a, kinds_a, phases_b, kinds_b, full):
    """Which extremes of b none of a belongs to: those born or lost between them."""
    found = np.empty(phases_b.size, dtype=np.bool_)
    for j in range(phases_b.size):
        i = nearest(phases_a, kinds_a, kinds_b[j], phases_b[j], full)
        found[j] = i < 0 or nearest(phases_b, kinds_b, kinds_b[j], phases_a[i], full) != j
    return found


@njit(cache=True, error_model="numpy")
def dip(left, right, before, here, after):
    """Where a function may touch zero unseen between `left` and `right` of here, or nan.

    Its three values have one sign, but the parabola through them comes within a quarter of zero.
    """
    if before * here <= 0.0 or here * after <= 0.0 or left == 0.0 or right == 0.0:
        return np.nan
    first, last = (before - here) / left, (after - here) / right
    curvature = (last - first) / (right - left)
    slope = first - curvature * left
    if curvature * here <= 0.0:  # bends away from zero
        return np.nan
    where = -0.5 * slope / curvature
    value = here - 0.25 * slope * slope / curvature
    least = min(abs(before), abs(here), abs(after))
    close = left < where < right and value * here < 0.25 * least * abs(here)
    return where if close else np.nan


@njit(cache=True, error_model="numpy")
def extreme_dip(
    left,
    right,
    phases_z,
    values_z,
    kinds_z,
    phases,
    values,
    kinds,
    phases_b,
    values_b,
    kinds_b,
    full,
):
    """The same for the first of the extremes that does so, each with the nearest ones beside it."""
    for i in range(phases.size):
        z = nearest(phases_z, kinds_z, kinds[i], phases[i], full)
        b = nearest(phases_b, kinds_b, kinds[i], phases[i], full)
        if z >= 0 and b >= 0:
            where = dip(left, right, values_z[z], values[i], values_b[b])
            if where == where:
                return where
    return np.nan
