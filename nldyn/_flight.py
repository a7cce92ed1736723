"""Compiled kernels for flights: exact propagation and a guaranteed first contact."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


class FlowData(NamedTuple):
    """Numbers of a system at one excitation frequency, as the kernels need them.

    The first rows of `rows` are the stops' penetration rows, then the observed outputs.
    """

    eigenvalues: Complex  # (nz,)
    rows: Complex  # (n_out, nz)
    force: Complex  # (nz, n_stops): w' = λ w - force @ F
    forced: Complex  # (n_out,) forced amplitude of each output
    d_forced: Complex  # (n_out,) its derivative with respect to ω
    gap: Real  # (n_stops,)
    stiffness: Real  # (n_stops,)
    exponent: Real  # (n_stops,)
    mobility: Real  # (n_stops,) velocity jump per unit impulse, 1/kg
    duration_factor: Real  # (n_stops,) contact duration = factor * peak / speed
    pack_mode: NDArray[np.int64]  # (2n,)
    pack_unit: Complex  # (2n,)
    omega: float
    tail: float  # largest relative Legendre tail accepted on a contact panel


@njit(cache=True)
def output_derivatives(fl, out, w, phase, t):
    """Value and first two time derivatives of output `out`, and a bound on the third, after t."""
    turn = fl.forced[out] * np.exp(1j * (phase + fl.omega * t))
    value = turn.real
    first = -fl.omega * turn.imag
    second = -fl.omega * fl.omega * turn.real
    bound = abs(turn) * fl.omega**3
    for k in range(fl.eigenvalues.size):
        lam = fl.eigenvalues[k]
        part = fl.rows[out, k] * w[k] * np.exp(lam * t)
        value += part.real
        part1 = lam * part
        first += part1.real
        part2 = lam * part1
        second += part2.real
        bound += abs(part2) * abs(lam)
    return value, first, second, bound


@njit(cache=True)
def safe_step(h, h1, h2, bound):
    """First positive root of h + h1 τ + h2 τ²/2 + bound τ³/6, for h <= 0.

    No function with these derivatives and a third derivative below `bound` reaches zero sooner.
    """
    if bound <= 0.0:
        return np.inf
    if h >= 0.0:
        if h1 >= 0.0:
            return 0.0
        # leave the root at zero out: h1 + h2 τ/2 + bound τ²/6 = 0
        return (-0.5 * h2 + math.sqrt(0.25 * h2 * h2 - 2.0 / 3.0 * bound * h1)) * 3.0 / bound
    turning = h2 * h2 - 2.0 * bound * h1
    tau = -1.0
    if h2 < 0.0 and h1 > 0.0 and turning >= 0.0:
        top = 2.0 * h1 / (-h2 + math.sqrt(turning))
        if h + top * (h1 + top * (0.5 * h2 + top * bound / 6.0)) >= 0.0:
            tau = 0.0  # the root lies on the concave rise before the top: Newton from the left
    if tau < 0.0:  # beyond the inflection: Newton from an upper bound of all roots
        tau = 2.0 * max(
            3.0 * abs(h2) / bound,
            max(math.sqrt(6.0 * abs(h1) / bound), (6.0 * abs(h) / bound) ** (1.0 / 3.0)),
        )
    for _ in range(60):
        p = h + tau * (h1 + tau * (0.5 * h2 + tau * bound / 6.0))
        p1 = h1 + tau * (h2 + 0.5 * tau * bound)
        if p1 <= 0.0:
            break
        step = p / p1
        tau -= step
        if abs(step) <= 1e-15 * tau:
            break
    return max(tau, 0.0)


@njit(cache=True)
def closing_time(fl, stop, w, phase, start, end):
    """First time in [start, end] at which a stop closes, or inf; no contact is passed over.

    Every step is bounded by the third derivative, so that it cannot cross a contact; the steps
    converge to the contact at order three. Only contacts shorter than 1e-9 periods of the
    fastest mode can be stepped over, and these carry no force.
    """
    fastest = fl.omega
    for k in range(fl.eigenvalues.size):
        fastest = max(fastest, abs(fl.eigenvalues[k]))
    shortest = 1e-10 / fastest
    t = start
    while t <= end:
        value, h1, h2, bound = output_derivatives(fl, stop, w, phase, t)
        h = value - fl.gap[stop]
        if h >= 0.0 and h1 > 0.0:
            return t
        tau = safe_step(min(h, 0.0), h1, h2, bound)
        if tau < shortest:
            if h1 > 0.0 and h + h1 * shortest >= 0.0:
                return min(t + max(tau, 0.0), end)
            tau = shortest
        t += tau
    return np.inf


@njit(cache=True)
def fly(fl, w, t):
    """Advance w in place by a flight of duration t."""
    for k in range(w.size):
        w[k] *= np.exp(fl.eigenvalues[k] * t)


@njit(cache=True)
def fly_columns(fl, columns, t):
    """Advance sensitivities (nz, n_columns) in place by a flight of duration t."""
    for k in range(columns.shape[0]):
        factor = np.exp(fl.eigenvalues[k] * t)
        for c in range(columns.shape[1]):
            columns[k, c] *= factor
