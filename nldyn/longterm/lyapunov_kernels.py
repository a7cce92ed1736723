"""Compiled orthonormalisation: how much each direction grows over a sequence of Jacobians."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from nldyn.runtime.kernel_cache import ensure_cache

ensure_cache()


@njit(cache=True, nogil=True, error_model="numpy")
def growth_rates(jacobians, basis, least):
    """Carry an orthonormal basis (n, n) in place; return ln of the stretches (k, n).

    After every Jacobian the columns are made orthonormal again, each one twice against those before
    it, since once loses digits where they have nearly become parallel. A column no longer than
    ``least`` times the Jacobian's size has been squeezed to nothing, and another takes its place.
    """
    k, n, _ = jacobians.shape
    stretches = np.empty((k, n))
    moved = np.empty((n, n))
    for step in range(k):
        size = 0.0
        for i in range(n):
            for j in range(n):
                size += jacobians[step, i, j] ** 2
        nothing = least * math.sqrt(size)
        for i in range(n):
            for j in range(n):
                total = 0.0
                for m in range(n):
                    total += jacobians[step, i, m] * basis[m, j]
                moved[i, j] = total
        for j in range(n):
            for _ in range(2):
                for other in range(j):
                    share = 0.0
                    for i in range(n):
                        share += basis[i, other] * moved[i, j]
                    for i in range(n):
                        moved[i, j] -= share * basis[i, other]
            length = 0.0
            for i in range(n):
                length += moved[i, j] * moved[i, j]
            length = math.sqrt(length)
            if length > nothing:
                stretches[step, j] = math.log(length)
                for i in range(n):
                    basis[i, j] = moved[i, j] / length
            else:
                stretches[step, j] = -math.inf
                put_across(basis, j)
    return stretches


@njit(cache=True, nogil=True, error_model="numpy")
def put_across(basis, j):
    """Make column j a unit vector across the columns before it."""
    n = len(basis)
    best, across = 0, -1.0
    for i in range(n):
        left = 1.0
        for other in range(j):
            left -= basis[i, other] ** 2
        if left > across:
            best, across = i, left
    for i in range(n):
        share = 0.0
        for other in range(j):
            share += basis[best, other] * basis[i, other]
        basis[i, j] = ((i == best) - share) / math.sqrt(across)
