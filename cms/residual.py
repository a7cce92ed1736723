"""Residual flexibility attachment modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cms.component import FloatArray, Pencil, times
from cms.eigen import Shifted
from cms.errors import ReductionError
from cms.inertia import elastic_solutions, quotient

DEPENDENCE_TOLERANCE = 1e-12


@dataclass(frozen=True, eq=False)
class ResidualModes:
    """Residual modes, mass-normalised and diagonalised.

    Attributes
    ----------
    squares : (p,) array
        Their w^2 in rad^2/s^2, ascending.
    vectors : (N, p) array
        K- and M-orthogonal to the kept modes and to each other, ``V^T M V = I``.
    dropped : int
        How many of the interfaces' residuals vanish or depend on the others.
    """

    squares: FloatArray
    vectors: FloatArray
    dropped: int


def residual_flexibility(pencil: Pencil, shifted: Shifted, modes: FloatArray) -> FloatArray:
    """``K^-1 B`` less the modes' share, (N, m); with inertia relief where the component floats."""
    return without_modes(elastic_solutions(pencil, shifted, pencil.loads), modes, pencil)


def without_modes(vectors: FloatArray, modes: FloatArray, pencil: Pencil) -> FloatArray:
    """Take the modes' share out of the vectors: ``(I - Phi Phi^T M) V``, done twice.

    For ``V = K^-1 B`` this is ``K^-1 B - Phi diag(1/w^2) Phi^T B``, but keeps its orthogonality
    to rounding.
    """
    for _ in range(2):
        vectors = vectors - modes @ (modes.T @ times(pencil.mass, vectors))
    return vectors


def residual_modes(pencil: Pencil, shifted: Shifted, modes: FloatArray) -> ResidualModes:
    """Residual flexibility modes of all interfaces, projected on K and M and diagonalised.

    Parameters
    ----------
    pencil : Pencil
        K and M (N, N) and the interface vectors.
    shifted : Shifted
        The factorised K, or K + s M where the component floats.
    modes : (N, k) array
        The kept, mass-normalised modes, with all rigid-body modes among them.

    Returns
    -------
    ResidualModes

    Raises
    ------
    ReductionError
        If a residual mode has no mass.

    Notes
    -----
    The residual ``psi_j`` of each interface is measured in strain energy against its whole static
    solution, so the choice does not depend on the interfaces' units. The eigenvalues of that
    energy matrix reveal the rank; those below 1e-12 (a change of at most 1e-12 in the static
    flexibility) are dropped.
    """
    static = elastic_solutions(pencil, shifted, pencil.loads)
    size = np.sqrt(np.maximum(np.sum(pencil.loads * static, axis=0), 0.0))
    static = static * quotient(np.ones_like(size), size)
    residual = without_modes(static, modes, pencil)
    basis = independent_part(residual, pencil, pencil.size - modes.shape[1])
    basis = without_modes(basis, modes, pencil)
    squares, vectors = diagonalised(basis, pencil)
    return ResidualModes(squares, vectors, pencil.loads.shape[1] - squares.size)


def independent_part(residual: FloatArray, pencil: Pencil, at_most: int) -> FloatArray:
    """A K-orthonormal basis (N, p) of the residuals (N, m), p being their numerical rank."""
    energy = pencil.energies(residual)
    share, directions = linalg.eigh(energy) if energy.size else (np.zeros(0), energy)
    kept = np.flatnonzero(share > DEPENDENCE_TOLERANCE)[::-1][: max(at_most, 0)]
    return (residual @ directions[:, kept]) / np.sqrt(share[kept])


def diagonalised(basis: FloatArray, pencil: Pencil) -> tuple[FloatArray, FloatArray]:
    """w^2 (p,) and mass-normalised vectors (N, p) of K and M projected on the basis (N, p)."""
    if basis.shape[1] == 0:
        return np.zeros(0), basis
    mass = basis.T @ times(pencil.mass, basis)
    nu, directions = linalg.eigh((mass + mass.T) / 2, pencil.energies(basis))
    nu, directions = nu[::-1], directions[:, ::-1]
    if nu[-1] <= 0.0:
        raise ReductionError("a residual mode has no mass: give its interface some mass")
    return 1.0 / nu, basis @ directions / np.sqrt(nu)
