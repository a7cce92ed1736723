"""Element matrices of linear elastic solids, all cells of a kind in one batch.

The shape functions and the quadrature are scikit-fem's. The products of gradients are formed by
one matrix product per batch instead of one loop per pair of basis functions, which gives the
same matrices as scikit-fem's elasticity form to rounding, and takes a small part of its time.
"""

from __future__ import annotations

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.cells import CellKind


def gradients_and_volumes(
    kind: CellKind, coordinates: FloatArray, places: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Gradients of the shape functions in space, and the volume of the mapping.

    Parameters
    ----------
    kind
        The kind of cell.
    coordinates
        Of the nodes in m, shape (e, b, d).
    places
        In the reference cell, shape (q, d).

    Returns
    -------
    gradients, volumes
        In 1/m, shape (e, q, b, d), and the determinant of the isoparametric mapping, (e, q); it
        is negative in a cell that is turned inside out.
    """
    _, reference = kind.basis(places)
    jacobian = jacobians(coordinates, reference)
    volumes = np.linalg.det(jacobian)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = adjugate(jacobian) / volumes[..., None, None]
    return np.matmul(reference, inverse), volumes


def mapped_volumes(kind: CellKind, coordinates: FloatArray, places: FloatArray) -> FloatArray:
    """The determinant (e, q) of the mapping alone, see `gradients_and_volumes`."""
    return np.asarray(np.linalg.det(jacobians(coordinates, kind.basis(places)[1])))


def jacobians(coordinates: FloatArray, reference: FloatArray) -> FloatArray:
    """J[e, q, i, j] = dx_i / dX_j."""
    found = np.einsum("ebi,qbj->eqij", coordinates, reference, optimize=True)
    return np.asarray(found, dtype=np.float64)


def adjugate(matrices: FloatArray) -> FloatArray:
    """Transposed cofactors of matrices (..., d, d), d being 2 or 3."""
    if matrices.shape[-1] == 2:
        flipped = matrices[..., ::-1, ::-1].swapaxes(-1, -2)
        return np.asarray(flipped * np.array([[1.0, -1.0], [-1.0, 1.0]]), dtype=np.float64)
    rows = [
        np.cross(matrices[..., (i + 1) % 3, :], matrices[..., (i + 2) % 3, :]) for i in range(3)
    ]
    return np.stack(rows, axis=-1)


def checked_volumes(
    volumes: FloatArray, coordinates: FloatArray, what: str, numbers: IntArray
) -> FloatArray:
    """Absolute determinants (e, q), or a ModelError for a cell that is folded or flat."""
    sign = np.sign(volumes[:, :1])
    bad = np.flatnonzero(~((volumes * sign > 0.0).all(axis=1)))
    if len(bad):
        x, y, z = coordinates[bad[0]].mean(axis=0)
        raise ModelError(
            f"{what}: cell {numbers[bad[0]]} of the part, at ({x:.6g}, {y:.6g}, {z:.6g}), is flat"
            " or folded (its mapping has no positive volume everywhere)"
        )
    return np.asarray(np.abs(volumes), dtype=np.float64)


def stiffness_matrices(
    gradients: FloatArray, weights: FloatArray, lame: tuple[float, float]
) -> FloatArray:
    """Stiffness of isotropic cells.

    Parameters
    ----------
    gradients
        Shape (e, q, b, d).
    weights
        Volume in m³ (in 2-D: area times thickness) that belongs to each place, shape (e, q).
    lame
        Lamé's lambda and mu in N/m²; for plane stress lambda is 2 lambda mu / (lambda + 2 mu).

    Returns
    -------
    ndarray
        Shape (e, b, d, b, d).

    Notes
    -----
    With H_aibj the integral of dN_a/dx_i dN_b/dx_j, the stiffness is lambda H_aibj + mu H_ajbi
    + mu delta_ij H_akbk, which is the usual BᵀDB for an isotropic D.
    """
    e, q, b, d = gradients.shape
    first, second = lame
    flat = gradients.reshape(e, q, b * d)
    H = np.matmul((flat * weights[..., None]).transpose(0, 2, 1), flat).reshape(e, b, d, b, d)
    trace = np.einsum("eakbk->eab", H)
    K = first * H
    K += second * H.transpose(0, 1, 4, 3, 2)
    for i in range(d):
        K[:, :, i, :, i] += second * trace
    return np.asarray(K, dtype=np.float64)


def mass_matrices(kind: CellKind, weights: FloatArray, density: float) -> FloatArray:
    """Consistent mass of cells for one direction, shape (e, b, b), in kg."""
    values, _ = kind.basis(kind.quadrature[0])
    products = values[:, :, None] * values[:, None, :]
    M = density * weights @ products.reshape(len(values), -1)
    return np.asarray(M.reshape(len(weights), *products.shape[1:]), dtype=np.float64)


def strains(gradients: FloatArray, displacements: FloatArray) -> FloatArray:
    """Strain tensors (e, q, d, d) from gradients (e, q, b, d) and displacements (e, b, d)."""
    slope = np.einsum("eqbj,ebi->eqij", gradients, displacements, optimize=True)
    return np.asarray((slope + slope.swapaxes(-1, -2)) / 2.0, dtype=np.float64)
