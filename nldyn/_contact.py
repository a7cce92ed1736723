"""Compiled kernels for contact phases: collocation on the scalar contact forces.

While stops are closed the modes see one scalar force per stop, so the penetrations at the Gauss
nodes of a panel satisfy a small Volterra equation

    δ_a(t_i) = free_a(t_i) - Σ_b Σ_j h W_ij K_ab(t_i - t_j) F_b(δ_b(t_j)),

K being the impulse response between two stops. Its Newton matrix also gives all sensitivities.
The end state is a Gauss quadrature: order 2m with m nodes.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def law(delta, stiffness, exponent):
    """Contact force and its derivative with respect to the penetration."""
    if delta <= 0.0:
        return 0.0, 0.0
    if exponent == 1.5:
        root = np.sqrt(delta)
        return stiffness * delta * root, 1.5 * stiffness * root
    if exponent == 1.0:
        return stiffness * delta, stiffness
    slope = stiffness * delta ** (exponent - 1.0)
    return slope * delta, exponent * slope


@njit(cache=True)
def kernel_matrix(fl, tab, kind, h, active, E, E_inv, G):
    """Fill E (m, nz) = exp(λ t_i), its inverse, and G = h W_ij K_ab(t_i - t_j)."""
    m = tab.nodes.size
    nz = fl.eigenvalues.size
    for i in range(m):
        for k in range(nz):
            exponent = fl.eigenvalues[k] * (h * tab.chi[kind, i])
            E[i, k] = np.exp(exponent)
            E_inv[i, k] = np.exp(-exponent)
    for a in range(active.size):
        for b in range(active.size):
            for i in range(m):
                for j in range(m):
                    G[a * m + i, b * m + j] = 0.0
            for k in range(nz):
                z = h * fl.rows[active[a], k] * fl.force[k, active[b]]
                for i in range(m):
                    zi = z * E[i, k]
                    for j in range(m):
                        G[a * m + i, b * m + j] += zi.real * E_inv[j, k].real - (
                            zi.imag * E_inv[j, k].imag
                        )
            for i in range(m):
                for j in range(m):
                    G[a * m + i, b * m + j] *= tab.integrate[kind, i, j]


@njit(cache=True)
def lu_solve(A, B):
    """Solve A X = B in place (X overwrites B, LU overwrites A), with row pivoting."""
    n = A.shape[0]
    n_rhs = B.shape[1]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            for j in range(n_rhs):
                B[k, j], B[pivot, j] = B[pivot, j], B[k, j]
        inverse = 1.0 / A[k, k] if A[k, k] != 0.0 else np.inf
        for i in range(k + 1, n):
            factor = A[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
                for j in range(n_rhs):
                    B[i, j] -= factor * B[k, j]
    for k in range(n - 1, -1, -1):
        inverse = 1.0 / A[k, k] if A[k, k] != 0.0 else np.inf
        for j in range(n_rhs):
            total = B[k, j]
            for i in range(k + 1, n):
                total -= A[k, i] * B[i, j]
            B[k, j] = total * inverse


@njit(cache=True)
def free_output(fl, out, w, E, i, phase):
    """Output `out` at node i if no force acted."""
    value = (fl.forced[out] * np.exp(1j * phase)).real
    for k in range(fl.eigenvalues.size):
        value += (fl.rows[out, k] * E[i, k] * w[k]).real
    return value


@njit(cache=True)
def solve_panel(fl, tab, kind, phase, w, h, active, delta, F, dF, E, E_inv, G):
    """Newton's method for the penetrations at the nodes; delta (na, m) holds the guess.

    Returns whether it converged, with F, dF, E, E_inv and G filled.
    """
    m = tab.nodes.size
    na = active.size
    size = na * m
    kernel_matrix(fl, tab, kind, h, active, E, E_inv, G)
    free = np.empty(size)
    for a in range(na):
        for i in range(m):
            node_phase = phase + fl.omega * h * tab.chi[kind, i]
            free[a * m + i] = free_output(fl, active[a], w, E, i, node_phase) - fl.gap[active[a]]
    J = np.empty((size, size))
    step = np.empty((size, 1))
    for _ in range(40):
        scale = 0.0
        for a in range(na):
            for i in range(m):
                F[a, i], dF[a, i] = law(
                    delta[a, i], fl.stiffness[active[a]], fl.exponent[active[a]]
                )
                scale = max(scale, abs(delta[a, i]))
        for p in range(size):
            total = free[p] - delta[p // m, p % m]
            for q in range(size):
                g = G[p, q]
                total -= g * F[q // m, q % m]
                J[p, q] = g * dF[q // m, q % m]
            J[p, p] += 1.0
            step[p, 0] = total
        lu_solve(J, step)
        change = 0.0
        for p in range(size):
            delta[p // m, p % m] += step[p, 0]
            change = max(change, abs(step[p, 0]))
        if not np.isfinite(change):
            return False
        if change <= 1e-11 * scale:
            for a in range(na):
                for i in range(m):
                    F[a, i], dF[a, i] = law(
                        delta[a, i], fl.stiffness[active[a]], fl.exponent[active[a]]
                    )
            return True
    return False


@njit(cache=True)
def panel_end(fl, tab, kind, w, h, active, F, E_inv, w_end):
    """State w_end at the end of a panel from the forces at its nodes."""
    for k in range(w.size):
        total = w[k]
        for j in range(tab.nodes.size):
            drive = 0.0j
            for a in range(active.size):
                drive += fl.force[k, active[a]] * F[a, j]
            total -= h * tab.weights[kind, j] * drive * E_inv[j, k]
        w_end[k] = total * np.exp(fl.eigenvalues[k] * h)


@njit(cache=True)
def panel_columns(fl, tab, kind, phase, t0, h, active, dF, E, E_inv, G, columns):
    """Advance sensitivities (nz, n_columns) in place over a panel.

    The last column is the derivative with respect to ω at fixed time; t0 is the time from the
    start of the segment at which its phase is fixed.
    """
    m = tab.nodes.size
    na = active.size
    nz = fl.eigenvalues.size
    size = na * m
    n_columns = columns.shape[1]
    J = np.empty((size, size))
    rhs = np.zeros((size, n_columns))
    for p in range(size):
        for q in range(size):
            J[p, q] = G[p, q] * dF[q // m, q % m]
        J[p, p] += 1.0
    for a in range(na):
        for i in range(m):
            p = a * m + i
            for k in range(nz):
                z = fl.rows[active[a], k] * E[i, k]
                for c in range(n_columns):
                    rhs[p, c] += z.real * columns[k, c].real - z.imag * columns[k, c].imag
            t = h * tab.chi[kind, i]
            turn = np.exp(1j * (phase + fl.omega * t))
            slope = fl.d_forced[active[a]] + 1j * (t0 + t) * fl.forced[active[a]]
            rhs[p, n_columns - 1] += (slope * turn).real
    lu_solve(J, rhs)
    for k in range(nz):
        growth = np.exp(fl.eigenvalues[k] * h)
        for a in range(na):
            for j in range(m):
                z = fl.force[k, active[a]] * (h * tab.weights[kind, j] * dF[a, j]) * E_inv[j, k]
                for c in range(n_columns):
                    columns[k, c] -= z * rhs[a * m + j, c]
        for c in range(n_columns):
            columns[k, c] *= growth


@njit(cache=True)
def legendre_tail(tab, F):
    """Largest of the last two Legendre coefficients of the forces, relative to the largest force."""
    m = tab.nodes.size
    worst = 0.0
    largest = 0.0
    for a in range(F.shape[0]):
        for row in range(m - 2, m):
            total = 0.0
            for j in range(m):
                total += tab.to_legendre[row, j] * F[a, j]
            worst = max(worst, abs(total))
        for j in range(m):
            largest = max(largest, F[a, j])
    if largest == 0.0:
        return 0.0
    return worst / largest
