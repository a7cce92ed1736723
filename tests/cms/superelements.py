"""Superelements as other codes export them: few digits, mass of rank deficiency, mixed units."""

import mpmath
import numpy as np
from scipy import linalg


def rounded(matrix, digits):
    """The matrix with so many decimal digits, as a file has it."""
    return np.array([[float(f"{x:.{digits - 1}e}") for x in row] for row in matrix])


def free_beam(elements, length=1.0, bending=1e6 / 3, mass=1.0):
    """K and M of a free Euler-Bernoulli beam, two degrees of freedom (m, rad) at each node."""
    h, size = length / elements, 2 * elements + 2
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h]])
    k = bending / h**3 * np.vstack([k, -k[0], [6 * h, 2 * h * h, -6 * h, 4 * h * h]])
    m = np.array(
        [
            [156, 22 * h, 54, -13 * h],
            [22 * h, 4 * h * h, 13 * h, -3 * h * h],
            [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h * h, -22 * h, 4 * h * h],
        ]
    )
    m = mass * h / 420 * m
    K, M = np.zeros((size, size)), np.zeros((size, size))
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        K[at, at] += k
        M[at, at] += m
    return K, M


def superelement(kept=23, between=3, held=False, heavy=36, units=1.0, noise=1e-12, seed=0):
    """K, M (2 kept, 2 kept) of a beam by Guyan, with a mass of rank ``heavy`` but for noise.

    The mass before condensation sits at some translations only, so that the condensed one has that
    rank. ``units`` spreads the units of the degrees of freedom; noise is relative to the diagonal.
    """
    K, _ = free_beam((kept - 1) * between)
    if held:
        K[:2, :2] += np.diag([1e9, 1e6])
    nodes = np.arange(0, (kept - 1) * between + 1, between)
    master = np.sort(np.concatenate([2 * nodes, 2 * nodes + 1]))
    slave = np.setdiff1d(np.arange(K.shape[0]), master)
    T = np.zeros((K.shape[0], master.size))
    T[master] = np.eye(master.size)
    T[slave] = -np.linalg.solve(K[np.ix_(slave, slave)], K[np.ix_(slave, master)])
    random = np.random.default_rng(seed)
    lumps = np.sort(random.choice(K.shape[0] // 2, heavy, replace=False))
    B = np.sqrt(random.uniform(0.5, 1.5, heavy) / heavy)[:, None] * T[2 * lumps]
    stiffness, mass = T.T @ K @ T, B.T @ B
    scale = units ** random.uniform(-0.25, 0.25, master.size)  # entries spread by ``units``
    stiffness, mass = ((A + A.T) / 2 * np.outer(scale, scale) for A in (stiffness, mass))
    error = random.uniform(-noise, noise, mass.shape)
    size = np.sqrt(np.diag(mass))
    return stiffness, mass + np.outer(size, size) * (error + error.T) / 2, scale


def exact_hz(stiffness, mass, count, digits=60, least=1e-10):
    """Lowest frequencies in Hz of the same matrices by dense eigen-solves in many digits.

    Directions whose mass in M scaled to a unit diagonal is below ``least`` are static.
    """
    with mpmath.workdps(digits):
        K, M = mpmath.matrix(stiffness.tolist()), mpmath.matrix(mass.tolist())
        n = K.rows
        d = [1 / mpmath.sqrt(M[i, i]) for i in range(n)]
        for i in range(n):
            for j in range(n):
                K[i, j], M[i, j] = K[i, j] * d[i] * d[j], M[i, j] * d[i] * d[j]
        values, vectors = mpmath.eigsy(M)
        K = vectors.T * K * vectors
        none = sum(1 for i in range(n) if values[i] <= least)
        if none:
            K = K[none:, none:] - K[none:, :none] * mpmath.inverse(K[:none, :none]) * K[:none, none:]
        root = [1 / mpmath.sqrt(values[none + i]) for i in range(n - none)]
        for i in range(n - none):
            for j in range(n - none):
                K[i, j] *= root[i] * root[j]
        squares = mpmath.eigsy((K + K.T) / 2, eigvals_only=True)
        squares = sorted(float(x) for x in squares)[:count]
    return np.sign(squares) * np.sqrt(np.abs(squares)) / (2 * np.pi)


def joined(first, second, rows, columns):
    """K or M of two components of which degrees of freedom ``rows`` and ``columns`` are one."""
    n = first.shape[0]
    rest = np.setdiff1d(np.arange(second.shape[0]), columns)
    size = n + rest.size
    place = np.empty(second.shape[0], dtype=int)
    place[rest] = np.arange(n, size)
    place[columns] = rows
    whole = linalg.block_diag(first, np.zeros((rest.size, rest.size)))
    whole[np.ix_(place, place)] += second
    return whole
