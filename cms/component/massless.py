"""Directions of a component that have no mass, and what is left when they follow statically."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from cms.base.errors import ReductionError

FloatArray = NDArray[np.float64]

MASSLESS = 1e-10  # least eigenvalue of a mass matrix scaled to a unit diagonal that is a mass
CERTAIN = 1e-6  # above it an estimate of the least eigenvalue is enough
SAFETY = 2.0
ESTIMATES = 8
NOISE = 10.0  # rows with up to so many times the mass of a negative one are as massless as it


def without_noise(mass: Any, stiffness: Any) -> Any:
    """M (N, N) without the rows of degrees of freedom whose mass is noise about zero.

    Mass is measured by stiffness, ``m_ij / sqrt(k_ii k_jj)``, which no unit changes. A negative
    entry on the diagonal shows the noise, at least that of double precision, where it is within
    1e-10 of the largest one.
    """
    diagonal = stiffness.diagonal()
    scale = sparse.diags_array(1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, np.inf)))
    scaled = abs(sparse.csr_array(scale @ mass @ scale))
    masses = np.copysign(scaled.diagonal(), mass.diagonal())
    noise, largest = -float(np.min(masses)), float(np.max(masses))
    if not 0.0 < noise <= MASSLESS * largest:
        return mass
    noise = max(noise, float(np.finfo(np.float64).eps) * largest)
    rows = scaled.max(axis=1).toarray().ravel()
    kept = (rows > NOISE * noise) | (diagonal <= 0.0)
    keep = sparse.diags_array(kept.astype(np.float64))
    return sparse.csc_array(keep @ mass @ keep)


def massless_directions(mass: Any, rounding: float) -> FloatArray:
    """Directions Z (N, z) in which a symmetric matrix M (N, N) is zero but for rounding.

    M is scaled to a unit diagonal. What its eigenvalues have below 1e-10, or below what entries
    with a relative error of ``rounding`` leave, is no mass.

    Raises
    ------
    ReductionError
        If an eigenvalue is negative beyond that.
    """
    diagonal = mass.diagonal()
    has = diagonal > 0.0
    scale = 1.0 / np.sqrt(np.where(has, diagonal, 1.0))
    scaled = (sparse.diags_array(scale) @ mass @ sparse.diags_array(scale)).toarray()
    off = np.where(np.outer(has, has), 0.0, np.abs(scaled)).max(initial=0.0)
    if off > 0.0:
        row = int(np.flatnonzero(~has)[np.argmax(np.abs(scaled[~has]).max(axis=1))])
        raise ReductionError(
            f"the mass matrix is not positive: its diagonal is zero in row {row}, counted from 0, "
            "which has other entries"
        )
    if np.all(has) and least_eigenvalue(scaled) > CERTAIN + 10.0 * rounding * scaled.shape[0]:
        return np.zeros((scaled.shape[0], 0))
    values, vectors = linalg.eigh(scaled)
    limit = max(MASSLESS, SAFETY * rounding * float(linalg.norm(np.abs(scaled), 2)))
    if values[0] < -limit:
        worst = int(np.argmax(np.abs(vectors[:, 0])))
        raise ReductionError(
            f"the mass matrix is not positive: scaled to a unit diagonal it has the eigenvalue "
            f"{values[0]:.3g}, mostly in row {worst}, counted from 0, where rounding explains "
            f"{limit:.1g}"
        )
    return np.asarray(scale[:, None] * vectors[:, values <= limit])


def least_eigenvalue(scaled: FloatArray) -> float:
    """Estimate of the least eigenvalue, from above, by inverse iteration; zero if not positive."""
    try:
        lower = linalg.cholesky(scaled, lower=True)
    except linalg.LinAlgError:
        return 0.0
    vector = np.random.default_rng(0).standard_normal((scaled.shape[0], 1))
    growth: float = 1.0
    for _ in range(ESTIMATES):
        unit = np.asarray(vector / np.linalg.norm(vector), dtype=np.float64)
        vector = np.asarray(linalg.cho_solve((lower, True), unit))
        growth = float(np.linalg.norm(vector))
    return 1.0 / growth


def statically_split(stiffness: Any, massless: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shapes without mass, and shapes that have it with the massless ones following statically.

    Parameters
    ----------
    stiffness : (N, N) sparse array
        K, or K + s M.
    massless : (N, z) array
        Directions Z without mass.

    Returns
    -------
    (N, z) and (N, N - z) arrays
        V with ``V^T K V = I`` that spans Z, and W with ``V^T K W = 0``; both span all together.

    Raises
    ------
    ReductionError
        If a massless direction has no stiffness either.
    """
    diagonal = stiffness.diagonal()
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = (sparse.diags_array(scale) @ stiffness @ sparse.diags_array(scale)).toarray()
    turn, _ = linalg.qr(massless / scale[:, None])
    Z, R = turn[:, : massless.shape[1]], turn[:, massless.shape[1] :]
    inner = Z.T @ scaled @ Z
    try:
        lower = linalg.cholesky((inner + inner.T) / 2, lower=True)
    except linalg.LinAlgError:
        lower = np.zeros_like(inner)
    if np.min(np.diag(lower)) ** 2 <= MASSLESS:
        vector = Z @ linalg.eigh(inner)[1][:, 0]
        row = int(np.argmax(np.abs(vector)))
        raise ReductionError(
            f"a direction of the component, mostly degree of freedom {row}, has neither mass nor "
            "stiffness, or a negative one: K + s M is not positive definite"
        )
    V = linalg.solve_triangular(lower, Z.T, lower=True).T
    W = R - V @ (V.T @ (scaled @ R))
    W = W - V @ (V.T @ (scaled @ W))
    return scale[:, None] * V, scale[:, None] * W
