"""Sparse matrices of many small ones: nodes in blocks of three degrees of freedom."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
from scipy import sparse

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError

SparseArray = sparse.csr_array


@dataclass(frozen=True, eq=False)
class BlockPattern:
    """Where the blocks of all cells go: rows of blocks, and a place for each pair of nodes.

    Parameters
    ----------
    indptr, indices
        Compressed rows of the blocks, shape (count + 1,) and (p,).
    places
        For every kind of cell in the order given, the places (e, b, b) of its pairs among the p.
    """

    indptr: npt.NDArray[Any]
    indices: npt.NDArray[Any]
    places: tuple[IntArray, ...]

    @property
    def count(self) -> int:
        """Number of blocks in a row."""
        return len(self.indptr) - 1

    def matrix(self, data: FloatArray) -> SparseArray:
        """The matrix (3 count, 3 count) of blocks given as (3, 3, p)."""
        blocks = np.ascontiguousarray(data.transpose(2, 0, 1))
        size = 3 * self.count
        found = sparse.bsr_array((blocks, self.indices, self.indptr), shape=(size, size))
        return sparse.csr_array(found.tocsr())

    def same_in_all_directions(self, data: FloatArray) -> SparseArray:
        """The matrix (3 count, 3 count) whose blocks are numbers (p,) times the identity."""
        each = sparse.csr_array((data, self.indices, self.indptr), shape=(self.count, self.count))
        return sparse.csr_array(sparse.kron(each, sparse.eye_array(3), format="csr"))


def block_pattern(cells: list[IntArray], count: int) -> BlockPattern:
    """The pattern of cells given by their blocks (e, b), out of ``count`` blocks.

    Examples
    --------
    >>> pattern = block_pattern([np.array([[0, 1], [1, 2]])], 3)
    >>> pattern.indices
    array([0, 1, 0, 1, 2, 1, 2], dtype=int32)
    """
    pairs = [(nodes[:, :, None] * count + nodes[:, None, :]) for nodes in cells]
    keys = np.concatenate([pair.ravel() for pair in pairs]) if pairs else np.zeros(0, np.int64)
    used, inverse = np.unique(keys, return_inverse=True)
    inverse = inverse.astype(np.int32 if len(used) < 2**31 else np.int64)
    index = np.int32 if 9 * len(used) < 2**31 else np.int64
    indptr = np.searchsorted(used, count * np.arange(count + 1, dtype=np.int64)).astype(index)
    ends = np.cumsum([pair.size for pair in pairs])[:-1]
    places = tuple(
        part.reshape(pair.shape) for part, pair in zip(np.split(inverse, ends), pairs, strict=True)
    )
    return BlockPattern(indptr, (used % count).astype(index), places)


def dense_scatter(pieces: Iterable[tuple[FloatArray, IntArray]], count: int) -> SparseArray:
    """Sum of matrices (e, m, m) at degrees of freedom (e, m), of all pieces, (count, count)."""
    entries = [(np.zeros(0), np.zeros(0, np.int64), np.zeros(0, np.int64))]
    for matrices, dofs in pieces:
        there = matrices != 0.0
        places = (
            np.broadcast_to(at, there.shape)[there] for at in (dofs[:, :, None], dofs[:, None])
        )
        entries.append((matrices[there], *places))
    values, rows, columns = map(np.concatenate, zip(*entries, strict=True))
    full = sparse.coo_array((values, (rows, columns)), shape=(count, count))
    return sparse.csr_array(full.tocsr())


def added(first: SparseArray, second: SparseArray) -> SparseArray:
    """The sum of two matrices, one of which may be empty."""
    if second.nnz == 0:
        return first
    return sparse.csr_array(first + second) if first.nnz else second


def squares(rows: SparseArray, weights: FloatArray) -> SparseArray:
    """The sparse matrix BᵀwB."""
    if not len(weights):
        return sparse.csr_array((rows.shape[1], rows.shape[1]))
    return sparse.csr_array(rows.T @ sparse.diags_array(weights) @ rows)


class HasFree(Protocol):
    """What `displacement_of` needs of a component."""

    @property
    def model(self) -> Any: ...
    @property
    def free(self) -> IntArray: ...


def displacement_of(component: HasFree, u: npt.ArrayLike) -> FloatArray:
    """Displacements of a component's free degrees of freedom (N,), checked for their number."""
    values = np.asarray(u, dtype=np.float64)
    if values.shape != component.free.shape:
        raise ModelError(
            f"{component.model.mesh.source}: a displacement of the component has shape"
            f" {component.free.shape}, not {values.shape}"
        )
    return values
