"""The natural form of a stiffness: K = AᵀdA, from displacements to deformations of elements.

Entries of K are sums that are rounded, and rigid motions of an element, which should cost no
energy, then do. In a long thin structure they are so large beside its deformations that its
lowest frequencies lose as many digits as the condition of K has. The rows of A are deformations
of single elements, from which rigid motion is taken before anything is rounded, and d are their
stiffnesses: they keep their digits at any condition [1]_.

.. [1] J. H. Argyris and O. E. Brönlund, The natural factor formulation of the stiffness for the
   matrix displacement method, Computer Methods in Applied Mechanics and Engineering 5 (1975)
   97-119.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator

from fem.base.arrays import FloatArray, IntArray
from fem.elements.scatter import SparseArray


class Rows(Protocol):
    """Some deformations, from all degrees of freedom, and their stiffnesses."""

    @property
    def stiffness(self) -> FloatArray:
        """Of every row, shape (r,)."""

    def of(self, displacements: FloatArray) -> FloatArray:
        """Deformations (r, k) of displacements (n, k)."""

    def forces(self, deformations: FloatArray) -> FloatArray:
        """The transposed product: (n, k) from (r, k)."""


class Deformations(LinearOperator):
    """The deformations A (m, N) of all elements.

    Parameters
    ----------
    parts
        The rows, for all degrees of freedom.
    transformation
        All degrees of freedom from the free ones, sparse (n, N).
    """

    def __init__(self, parts: Sequence[Rows], transformation: SparseArray) -> None:
        self.parts, self.transformation = tuple(parts), transformation
        self.ends = np.cumsum([len(part.stiffness) for part in self.parts])
        shape = int(self.ends[-1]), int(transformation.shape[1])
        super().__init__(np.float64, shape)  # type: ignore[call-arg]

    def _matmat(self, V: FloatArray) -> FloatArray:
        U = np.asarray(self.transformation @ V)
        return np.concatenate([part.of(U) for part in self.parts])

    def _rmatmat(self, S: FloatArray) -> FloatArray:
        pieces = np.split(S, self.ends[:-1])
        forces = np.zeros((self.transformation.shape[0], S.shape[1]))
        for part, piece in zip(self.parts, pieces, strict=True):
            forces += part.forces(piece)
        return np.asarray(self.transformation.T @ forces)


@dataclass(frozen=True, eq=False)
class NaturalForm:
    """K = AᵀdA of the free degrees of freedom.

    Parameters
    ----------
    deformations
        A, a linear operator of shape (m, N).
    stiffness
        d, shape (m,); negative numbers are of compression and of rules of integration.
    """

    deformations: LinearOperator
    stiffness: FloatArray


def natural_form(parts: Sequence[Rows], transformation: SparseArray) -> NaturalForm:
    """The rows of all elements, for the free degrees of freedom."""
    stiffness = np.concatenate([part.stiffness for part in parts])
    return NaturalForm(Deformations(parts, transformation), stiffness)


@dataclass(frozen=True, eq=False)
class MatrixRows:
    """Deformations of beams and springs: sparse rows (r, c) of sparse differences (c, n).

    They are not multiplied out: differences of neighbours are all but exact.
    """

    stiffness: FloatArray
    rows: Any
    differences: SparseArray

    def of(self, displacements: FloatArray) -> FloatArray:
        """Deformations (r, k) of displacements (n, k)."""
        return np.asarray(self.rows @ (self.differences @ displacements))

    def forces(self, deformations: FloatArray) -> FloatArray:
        """The transposed product."""
        return np.asarray(self.differences.T @ (self.rows.T @ deformations))


def line_rows(
    rows: FloatArray, stiffness: FloatArray, dofs: IntArray, size: int, moves: int
) -> MatrixRows:
    """Rows (e, r, m - moves) of lines from the relative displacement of their ends.

    Parameters
    ----------
    rows
        For the first ``moves`` degrees of freedom of the second end less those of the first,
        then the turns of the first and of the second end.
    stiffness
        Of the rows, shape (e, r).
    dofs
        Degrees of freedom of both ends, shape (e, m).
    size
        Number of all degrees of freedom.
    moves
        Number of translations of an end.

    Examples
    --------
    >>> rod = line_rows(np.array([[[2.0]]]), np.array([[1.0]]), np.array([[0, 1]]), 2, 1)
    >>> rod.of(np.array([[1.0], [1.5]])), rod.forces(np.array([[1.0]])).ravel()
    (array([[1.]]), array([-2.,  2.]))
    """
    half = dofs.shape[1] // 2
    first, second = dofs[:, :half], dofs[:, half:]
    kept = np.hstack([second[:, :moves], first[:, moves:], second[:, moves:]])
    lines = np.arange(kept.size).reshape(kept.shape)
    at = np.append(lines.ravel(), lines[:, :moves].ravel())
    columns = np.append(kept.ravel(), first[:, :moves].ravel())
    signs = np.append(np.ones(kept.size), -np.ones(len(dofs) * moves))
    differences = sparse.coo_array((signs, (at, columns)), shape=(kept.size, size))
    return MatrixRows(stiffness.ravel(), block_diagonal(rows), sparse.csr_array(differences))


def node_rows(rows: FloatArray, stiffness: FloatArray, dofs: IntArray, size: int) -> MatrixRows:
    """Rows (e, r, b m) of cells, by the moves of their nodes from that of the first one.

    Parameters
    ----------
    rows
        For m degrees of freedom of each of b nodes, of which the first three are translations:
        a common one of all nodes deforms nothing.
    stiffness
        Of the rows, shape (e, r).
    dofs
        Degrees of freedom, shape (e, b, m).
    size
        Number of all degrees of freedom.
    """
    count, b, m = dofs.shape
    kept = dofs.reshape(count, -1)[:, 3:]
    at = np.arange(kept.size).reshape(kept.shape)
    moves = (m * np.arange(1, b)[:, None] - 3 + np.arange(3)).ravel()
    first = np.tile(dofs[:, 0, :3], (1, b - 1))
    entries = np.append(np.ones(kept.size), -np.ones(first.size))
    places = np.append(at.ravel(), at[:, moves].ravel()), np.append(kept.ravel(), first.ravel())
    differences = sparse.coo_array((entries, places), shape=(kept.size, size))
    return MatrixRows(
        stiffness.ravel(), block_diagonal(rows[:, :, 3:]), sparse.csr_array(differences)
    )


def ground_rows(matrices: FloatArray, dofs: IntArray, size: int) -> MatrixRows:
    """Rows of matrices (e, m, m) that resist all motions, such as those of foundations."""
    squares, vectors = np.linalg.eigh(matrices)
    chosen = chosen_rows(dofs, size)
    return MatrixRows(squares.ravel(), block_diagonal(vectors.transpose(0, 2, 1)), chosen)


def chosen_rows(dofs: IntArray, size: int) -> SparseArray:
    """The sparse matrix that takes the degrees of freedom in the order of ``dofs``."""
    entries = np.ones(dofs.size), (np.arange(dofs.size), dofs.ravel())
    return sparse.csr_array(entries, shape=(dofs.size, size))


def block_diagonal(blocks: FloatArray) -> Any:
    """A sparse matrix (e r, e m) of blocks (e, r, m)."""
    count, r, m = blocks.shape
    shape = (count * r, count * m)
    return sparse.bsr_array((blocks, np.arange(count), np.arange(count + 1)), shape=shape)


@dataclass(frozen=True, eq=False)
class SolidRows:
    """Strains of isotropic cells at their places of integration.

    With kappa = lambda + 2 mu / d the strain energy density is kappa/2 tr² + mu dev:dev. The rows
    of a place are the trace, the diagonal of the deviator and the shears.

    Parameters
    ----------
    gradients
        Of the shape functions of all nodes but the first, shape (e, q d, b - 1).
    weights
        The volume that belongs to each place, shape (e, q).
    dofs
        Degrees of freedom (e, b, d) among ``size``.
    size
        Number of degrees of freedom.
    lame
        lambda and mu.
    """

    gradients: FloatArray
    weights: FloatArray
    dofs: IntArray
    size: int
    lame: tuple[float, float]

    @cached_property
    def stiffness(self) -> FloatArray:
        """Of the rows."""
        d, (first, second) = self.dofs.shape[2], self.lame
        law = [first + 2.0 * second / d] + d * [2.0 * second] + len(shears(d)) * [second]
        return np.asarray((self.weights[..., None] * np.array(law)).ravel(), dtype=np.float64)

    def of(self, displacements: FloatArray) -> FloatArray:
        """Deformations (r, k) of displacements (n, k)."""
        e, b, d = self.dofs.shape
        moved = displacements[self.dofs]
        relative = (moved[:, 1:] - moved[:, :1]).reshape(e, b - 1, -1)
        slopes = np.matmul(self.gradients, relative).reshape(e, -1, d, d, displacements.shape[1])
        trace = np.einsum("eqiik->eqk", slopes)
        rows = [trace, *(slopes[:, :, i, i] - trace / d for i in range(d))]
        rows += [slopes[:, :, i, j] + slopes[:, :, j, i] for i, j in shears(d)]
        return np.stack(rows, axis=2).reshape(-1, displacements.shape[1])

    def forces(self, deformations: FloatArray) -> FloatArray:
        """The transposed product."""
        (e, b, d), k = self.dofs.shape, deformations.shape[1]
        rows = deformations.reshape(*self.weights.shape, -1, k)
        stress = np.empty((*self.weights.shape, d, d, k))
        mean = rows[:, :, 0] - rows[:, :, 1 : 1 + d].sum(axis=2) / d
        for i in range(d):
            stress[:, :, i, i] = mean + rows[:, :, 1 + i]
        for row, (i, j) in enumerate(shears(d), start=1 + d):
            stress[:, :, i, j] = stress[:, :, j, i] = rows[:, :, row]
        forces = np.empty((e, b, d * k))
        forces[:, 1:] = np.matmul(self.gradients.transpose(0, 2, 1), stress.reshape(e, -1, d * k))
        forces[:, 0] = -forces[:, 1:].sum(axis=1)
        return np.asarray(self._scatter @ forces.reshape(-1, k))

    @cached_property
    def _scatter(self) -> SparseArray:
        """From the degrees of freedom of the cells to all."""
        return sparse.csr_array(chosen_rows(self.dofs, self.size).T)


def solid_rows(
    gradients: FloatArray,
    weights: FloatArray,
    dofs: IntArray,
    size: int,
    lame: tuple[float, float],
) -> SolidRows:
    """Strains from the gradients (e, q, b, d) of all shape functions, see `SolidRows`."""
    e, q, b, d = gradients.shape
    turned = gradients[:, :, 1:].transpose(0, 1, 3, 2).reshape(e, q * d, b - 1)
    return SolidRows(turned, weights, dofs, size, lame)


def shears(dimension: int) -> list[tuple[int, int]]:
    """Pairs of directions."""
    return list(itertools.combinations(range(dimension), 2))
