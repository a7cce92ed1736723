"""Residual flexibility attachment modes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from scipy import linalg

from cms.base.arrays import FloatArray
from cms.component.component import Pencil, times
from cms.component.massless import MASSLESS
from cms.reduction.area import Area, Attached, gathered
from cms.reduction.inertia import elastic_solutions, quotient
from cms.solvers.eigen import Shifted

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
    massless : (N, z) array
        Shapes without mass, ``V^T K V = I``: the flexibility that is left of the interfaces when
        all modes with mass are kept.
    dropped : int
        How many of the interfaces' residuals vanish or depend on the others.
    attached : dict of str to Attached
        What each area of contact was given.
    """

    squares: FloatArray
    vectors: FloatArray
    massless: FloatArray
    dropped: int
    attached: Mapping[str, Attached] = field(default_factory=dict)


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


def residual_modes(
    pencil: Pencil,
    shifted: Shifted,
    modes: FloatArray,
    areas: Mapping[str, Area] = MappingProxyType({}),
    names: Sequence[str] | None = None,
) -> ResidualModes:
    """Residual flexibility modes of interfaces, projected on K and M and diagonalised.

    Parameters
    ----------
    pencil : Pencil
        K and M (N, N) and the interface vectors.
    shifted : Shifted
        The factorised K, or K + s M where the component floats.
    modes : (N, k) array
        The kept, mass-normalised modes, with all rigid-body modes among them.
    areas : mapping of str to Area
        Interfaces that share a few.
    names : sequence of str
        The interfaces; all unless given.

    Returns
    -------
    ResidualModes

    Notes
    -----
    The residual ``psi_j`` of each interface is measured in strain energy against its whole static
    solution, so the choice does not depend on the interfaces' units. The eigenvalues of that
    energy matrix reveal the rank; those below 1e-12 (a change of at most 1e-12 in the static
    flexibility) are dropped.
    """
    names = pencil.names if names is None else names
    loads = pencil.loads[:, [pencil.names.index(name) for name in names]]
    static = elastic_solutions(pencil, shifted, loads)
    attached: dict[str, Attached] = {}
    if areas:
        left = without_modes(static, modes, pencil)
        chosen, attached = gathered(areas, names, loads, left)
        static, loads = static @ chosen, loads @ chosen
    size = np.sqrt(np.maximum(np.sum(loads * static, axis=0), 0.0))
    static = static * quotient(np.ones_like(size), size)
    residual = without_modes(static, modes, pencil)
    basis = independent_part(residual, pencil, pencil.size - modes.shape[1])
    basis = without_modes(basis, modes, pencil)
    squares, vectors, massless = diagonalised(basis, pencil, shifted.fastest)
    return ResidualModes(squares, vectors, massless, loads.shape[1] - basis.shape[1], attached)


def independent_part(residual: FloatArray, pencil: Pencil, at_most: int) -> FloatArray:
    """A K-orthonormal basis (N, p) of the residuals (N, m), p being their numerical rank."""
    energy = pencil.energies(residual)
    share, directions = linalg.eigh(energy) if energy.size else (np.zeros(0), energy)
    kept = np.flatnonzero(share > DEPENDENCE_TOLERANCE)[::-1][: max(at_most, 0)]
    return (residual @ directions[:, kept]) / np.sqrt(share[kept])


def diagonalised(
    basis: FloatArray, pencil: Pencil, fastest: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """w^2 (p,) and mass-normalised vectors (N, p) of K and M projected on the basis (N, p + z).

    The z directions whose mass is rounding come apart, with ``V^T K V = I``.
    """
    if basis.shape[1] == 0:
        return np.zeros(0), basis, basis
    mass = basis.T @ times(pencil.mass, basis)
    nu, directions = linalg.eigh((mass + mass.T) / 2, pencil.energies(basis))
    nu, vectors = nu[::-1], basis @ directions[:, ::-1]
    large = np.abs(vectors)
    sizes = np.sum(large * times(abs(pencil.mass), large), axis=0)
    sizes = np.maximum(sizes, 1.0 / fastest if fastest > 0.0 else 0.0)
    heavy = nu > max(MASSLESS, pencil.mass_rounding) * sizes
    return 1.0 / nu[heavy], vectors[:, heavy] / np.sqrt(nu[heavy]), vectors[:, ~heavy]
