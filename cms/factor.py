"""Factorise a symmetric positive definite matrix and solve with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from cms.component import FloatArray, SparseMatrix

DENSE_LIMIT = 1500

Progress = Callable[[str], None]
listener: ContextVar[Progress | None] = ContextVar("listener", default=None)


@contextmanager
def announced(progress: Progress | None) -> Iterator[None]:
    """Tell every factorisation within to ``progress`` before it begins."""
    token = listener.set(progress)
    try:
        yield
    finally:
        listener.reset(token)


def announce(text: str) -> None:
    """Say what is done, to whom it may concern."""
    progress = listener.get()
    if progress is not None:
        progress(text)


@dataclass(frozen=True, eq=False)
class Factor:
    """A factorised positive definite matrix A.

    Attributes
    ----------
    matrix : (N, N) sparse array
        A itself, for the residuals.
    smallest_pivot : float
        Smallest pivot of A scaled to a unit diagonal: near rounding if A is nearly singular.
    backsolve : callable
        One solve without refinement.
    """

    matrix: SparseMatrix
    smallest_pivot: float
    backsolve: Callable[[FloatArray], FloatArray]

    def solve(self, right: FloatArray, refinements: int = 0) -> FloatArray:
        """A^-1 times ``right`` (N,) or (N, m), with steps of iterative refinement."""
        solution = self.backsolve(right)
        for _ in range(refinements):
            solution = solution + self.backsolve(right - self.matrix @ solution)
        return solution


def factorise(matrix: SparseMatrix) -> Factor | None:
    """Factorise A, or None where A is not numerically positive definite.

    A is first scaled to a unit diagonal, so that metres and radians weigh the same. Up to 1500
    rows LAPACK's Cholesky factorisation is used, above that SuperLU in its symmetric mode with
    pivots on the diagonal only, so that their signs count as in an L D L^T factorisation.
    """
    diagonal = matrix.diagonal()
    if np.any(diagonal <= 0.0):
        return None
    scale = 1.0 / np.sqrt(diagonal)
    scaling = sparse.diags_array(scale)
    scaled = sparse.csc_array(scaling @ matrix @ scaling)
    found = dense_solver(scaled) if scaled.shape[0] <= DENSE_LIMIT else sparse_solver(scaled)
    if found is None:
        return None
    solver, smallest_pivot = found

    def backsolve(right: FloatArray) -> FloatArray:
        column = scale if right.ndim == 1 else scale[:, None]
        return column * solver(column * right)

    return Factor(matrix, smallest_pivot, backsolve)


Solver = Callable[[FloatArray], FloatArray]


def dense_solver(matrix: SparseMatrix) -> tuple[Solver, float] | None:
    """Cholesky solver and smallest pivot, or None if the matrix is not positive definite."""
    try:
        lower = linalg.cholesky(matrix.toarray(), lower=True)
    except linalg.LinAlgError:
        return None

    def solver(right: FloatArray) -> FloatArray:
        return np.asarray(linalg.cho_solve((lower, True), right), dtype=np.float64)

    return solver, float(np.min(np.diag(lower))) ** 2


def sparse_solver(matrix: SparseMatrix) -> tuple[Solver, float] | None:
    """SuperLU solver and smallest pivot, or None if the matrix is not positive definite."""
    try:
        factors = splu(
            matrix,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:  # exactly singular
        return None
    pivots = factors.U.diagonal()
    if np.any(factors.perm_r != factors.perm_c) or np.any(pivots <= 0.0):
        return None

    def solver(right: FloatArray) -> FloatArray:
        return np.asarray(factors.solve(np.ascontiguousarray(right)), dtype=np.float64)

    return solver, float(np.min(pivots))
