"""Compiled: which extremes of two orbits belong together, and which pass zero between them."""

from __future__ import annotations

import numpy as np

from nldyn.flow.kernels.compiling import njit


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
