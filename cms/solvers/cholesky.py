"""Sparse Cholesky factorisation by fronts: A = L L^T in the order of a nested dissection."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.linalg import blas, lapack

from cms.base.arrays import FloatArray, IntArray, SparseMatrix
from cms.base.threads import one_thread
from cms.solvers.dissection import Elimination, Front

CHUNK = 48  # columns that are added at once, few enough to stay in the cache


class NotPositiveDefiniteError(ArithmeticError):
    """A pivot is not positive."""


class Cholesky:
    """The factor L of a symmetric positive definite matrix, two blocks per front.

    Parameters
    ----------
    matrix : (N, N) sparse array
        Symmetric.
    plan : Elimination
        Of its pattern.

    Raises
    ------
    NotPositiveDefiniteError
        If the matrix is not numerically positive definite.

    Notes
    -----
    The multifrontal method [1]_: each front gathers its rows of the matrix and what its children
    hand on in dense blocks, eliminates its own rows by LAPACK and hands the rest on. Only lower
    triangles are filled.

    References
    ----------
    .. [1] Liu, J.W.H. (1992) The multifrontal method for sparse matrix solution: theory and
       practice. SIAM Review 34(1), 82-109.

    Examples
    --------
    >>> import numpy as np
    >>> from scipy import sparse
    >>> from cms.solvers.dissection import dissected
    >>> A = sparse.csc_array(sparse.diags_array([-1.0, 4.0, -1.0], offsets=[-1, 0, 1],
    ...                                         shape=(9, 9)))
    >>> x = Cholesky(A, dissected(A)).solve(np.ones(9))
    >>> bool(np.allclose(A @ x, 1.0))
    True
    """

    def __init__(self, matrix: SparseMatrix, plan: Elimination) -> None:
        self.plan = plan
        lower = lower_triangle(matrix, plan.order)
        self.diagonals: list[FloatArray] = []
        self.panels: list[FloatArray] = []
        handed: dict[int, FloatArray] = {}
        with one_thread():
            for number, front in enumerate(plan.fronts):
                own, panel, update = gathered(lower, plan, front, handed)
                factor, panel = eliminated(own, panel, update)
                if front.border.size:
                    handed[number] = update
                self.diagonals.append(factor)
                self.panels.append(panel)

    @property
    def smallest_pivot(self) -> float:
        """Smallest pivot of the elimination."""
        return min(float(np.min(np.diag(factor))) for factor in self.diagonals) ** 2

    def solve(self, right: FloatArray) -> FloatArray:
        """A^-1 times ``right``, (N,) or (N, m)."""
        x = np.ascontiguousarray(right[self.plan.order].reshape(right.shape[0], -1))
        blocks = list(zip(self.plan.fronts, self.diagonals, self.panels, strict=True))
        with one_thread():
            for front, factor, panel in blocks:
                own = x[front.start : front.stop]
                own[:] = divided(factor, own, transposed=False)
                x[front.border] -= panel @ own
            for front, factor, panel in reversed(blocks):
                own = x[front.start : front.stop]
                own[:] = divided(factor, own - panel.T @ x[front.border], transposed=True)
        found = np.empty_like(x)
        found[self.plan.order] = x
        return found.reshape(right.shape)


def lower_triangle(matrix: SparseMatrix, order: IntArray) -> SparseMatrix:
    """The lower triangle of a symmetric matrix whose rows and columns are put in an order."""
    place = np.empty(order.size, dtype=np.int32)
    place[order] = np.arange(order.size)
    rows, columns = place[matrix.indices], np.repeat(place, np.diff(matrix.indptr))
    kept = rows >= columns
    entries = (matrix.data[kept], (rows[kept], columns[kept]))
    return sparse.csc_array(entries, shape=matrix.shape)


def divided(factor: FloatArray, right: FloatArray, *, transposed: bool) -> FloatArray:
    """L^-1 or L^-T times ``right`` (n, m) in row order, as a division from the right, in place."""
    if right.shape[1] == 1:
        return np.asarray(blas.dtrsv(factor, right[:, 0], lower=1, trans=transposed))[:, None]
    trans = not transposed
    done = blas.dtrsm(1.0, factor, right.T, side=1, lower=1, trans_a=trans, overwrite_b=1)
    return np.asarray(done.T)


def eliminated(
    own: FloatArray, panel: FloatArray, update: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Factor and panel of a front; what it hands on is left in ``update``."""
    factor, fault = lapack.dpotrf(own, lower=1, overwrite_a=1)
    if fault:
        raise NotPositiveDefiniteError
    if not panel.size:
        return factor, panel
    panel = blas.dtrsm(1.0, factor, panel, side=1, lower=1, trans_a=1, overwrite_b=1)
    blas.dsyrk(-1.0, panel, beta=1.0, c=update, lower=1, overwrite_c=1)
    return factor, panel


def gathered(
    lower: SparseMatrix, plan: Elimination, front: Front, handed: dict[int, FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """The dense blocks of a front: its own rows, its border's, and what it will hand on."""
    border = front.border
    own = np.zeros((front.rows, front.rows), order="F")
    panel = np.zeros((border.size, front.rows), order="F")
    update = np.zeros((border.size, border.size), order="F")
    entries = slice(lower.indptr[front.start], lower.indptr[front.stop])
    counts = np.diff(lower.indptr[front.start : front.stop + 1])
    column = np.repeat(np.arange(front.rows), counts)
    row, data = lower.indices[entries], lower.data[entries]
    inside = row < front.stop
    own[row[inside] - front.start, column[inside]] = data[inside]
    panel[np.searchsorted(border, row[~inside]), column[~inside]] = data[~inside]
    for child in front.children:
        places = plan.fronts[child].border
        if not places.size:
            continue
        given = handed.pop(child)
        split = int(np.searchsorted(places, front.stop))
        at, beyond = places[:split] - front.start, np.searchsorted(border, places[split:])
        add_lower(own, at, given[:split, :split])
        add(panel, beyond, at, given[split:, :split])
        add_lower(update, beyond, given[split:, split:])
    return own, panel, update


def add_lower(block: FloatArray, places: IntArray, given: FloatArray) -> None:
    """Add a lower triangle to the rows and columns of a block at ascending places."""
    for start in range(0, places.size, CHUNK):
        columns = slice(start, start + CHUNK)
        add(block, places[start:], places[columns], given[start:, columns])


def add(block: FloatArray, rows: IntArray, columns: IntArray, given: FloatArray) -> None:
    """Add to the entries of a block in column order at ascending rows and columns."""
    if not given.size:
        return
    if rows[-1] - rows[0] == rows.size - 1:
        block.T[columns, rows[0] : rows[-1] + 1] += given.T
    else:
        block.T[np.ix_(columns, rows)] += given.T
