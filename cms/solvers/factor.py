"""Factorise a symmetric positive definite matrix and solve with it."""

from __future__ import annotations

import math
import os
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import splu

from cms.base.arrays import FloatArray, SparseMatrix
from cms.base.errors import ReductionError
from cms.component.component import times
from cms.solvers.cholesky import Cholesky, NotPositiveDefiniteError
from cms.solvers.dissection import Elimination, dissected

DENSE_LIMIT = 1500
GOOD_SOLUTION = 1e-12
BAD_SOLUTION = 1e-6
SUPERLU_FILL = 2.0  # entries of L and U per entry of the Cholesky factor by fronts: 1.6 in blocks
SUPERLU_BYTES = 40.0  # memory per such entry, with the copy from which the pivots are read

SUSPECT_PIVOT = 1e-11  # of a matrix scaled to a unit diagonal: what rounding leaves of none
SUSPECT_EIGENVALUE = 1e-13  # the same of an eigenvalue, which is smaller than every pivot
DENSE_SUSPECT = 1e-12  # where the pivots are those of LAPACK, an eigenvalue costs little
KILOBYTE, DOUBLE = 1024.0, 8.0  # in bytes

Solver = Callable[[FloatArray], FloatArray]

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
    suspect : bool
        Whether A may be singular: of A scaled to a unit diagonal the smallest pivot, or an estimate
        of the smallest eigenvalue, is near rounding.
    backsolve : callable
        One solve without refinement.
    size : float
        Largest row sum of A.
    """

    matrix: SparseMatrix
    suspect: bool
    backsolve: Callable[[FloatArray], FloatArray]
    size: float

    def solve(self, right: FloatArray) -> FloatArray:
        """A^-1 times ``right`` (N,) or (N, m).

        Every solution is checked by its residual. One that fails gets a step of refinement.

        Raises
        ------
        ReductionError
            If ``max|b - A x|`` stays above 1e-6 of ``max|b|`` plus the row sum times ``max|x|``.
        """
        solution = self.backsolve(right)
        for again in (True, False):
            residual = right - self.matrix @ solution
            error = backward_error(residual, right, solution, self.size)
            if error <= GOOD_SOLUTION:
                return solution
            if again:
                solution = solution + self.backsolve(residual)
        if error <= BAD_SOLUTION:
            return solution
        raise ReductionError(
            f"a solution with the factorised stiffness fails its residual check ({error:.1e} > "
            f"{BAD_SOLUTION:.0e})"
        )


def backward_error(
    residual: FloatArray, right: FloatArray, solution: FloatArray, size: float
) -> float:
    """Largest residual relative to what rounding of A x - b may leave; nan counts as infinite."""
    with np.errstate(invalid="ignore", over="ignore"):
        scale = np.abs(right).max(axis=0) + size * np.abs(solution).max(axis=0)
        left = np.abs(residual).max(axis=0)
        ratio = np.divide(left, scale, out=np.zeros_like(left), where=scale != 0.0)
        error = np.max(ratio, initial=0.0)
    return float(error) if np.isfinite(error) else np.inf


def factorise(matrix: SparseMatrix, dense_suspect: float = DENSE_SUSPECT) -> Factor | None:
    """Factorise A, or None where A is not numerically positive definite.

    A is first scaled to a unit diagonal, so that metres and radians weigh the same. Up to 1500
    rows LAPACK's Cholesky factorisation is used; above that PARDISO of the package pypardiso where
    it is installed, else `cms.solvers.cholesky`, and SciPy's SuperLU where one of these fails. The
    environment variable ``CMS_SOLVER`` names one of them: ``pardiso``, ``cholesky`` or ``superlu``.

    Raises
    ------
    ReductionError
        If the factor needs more memory than there is, before it is computed, or the solver that
        is asked for is not there or fails.
    """
    matrix = sparse.csc_array(matrix)
    diagonal = matrix.diagonal()
    if np.any(diagonal <= 0.0):
        return None
    scale = 1.0 / np.sqrt(diagonal)
    data = matrix.data * scale[matrix.indices]
    data *= np.repeat(scale, np.diff(matrix.indptr))
    scaled = sparse.csc_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)
    small = scaled.shape[0] <= DENSE_LIMIT
    found = dense_solver(scaled, dense_suspect) if small else chosen_solver(scaled)
    if found is None:
        return None
    solver, suspect = found

    def backsolve(right: FloatArray) -> FloatArray:
        column = scale if right.ndim == 1 else scale[:, None]
        return column * solver(column * right)

    size = float(abs(matrix).sum(axis=1).max())
    return Factor(matrix, suspect, backsolve, size)


def chosen_solver(matrix: SparseMatrix) -> tuple[Solver, bool] | None:
    """The solver that CMS_SOLVER names, else the first of those there are that does not fail."""
    wanted = os.environ.get("CMS_SOLVER", "").lower()
    if wanted:
        if wanted not in SOLVERS:
            raise ReductionError(
                f"there is no solver CMS_SOLVER={wanted!r} (there are: {', '.join(SOLVERS)})"
            )
        if wanted == "pardiso" and not pardiso_is_there():
            raise ReductionError("CMS_SOLVER=pardiso needs the package pypardiso with its library")
        return SOLVERS[wanted](matrix)
    if not pardiso_is_there() and find_spec("pypardiso") is not None:
        announce(
            "pypardiso is installed, but MKL's library mkl_rt is not found (PYPARDISO_MKL_RT may "
            "name it): taking another solver"
        )
    for name in ("pardiso", "cholesky") if pardiso_is_there() else ("cholesky",):
        try:
            return SOLVERS[name](matrix)
        except SolverError as error:
            announce(f"{error}: taking another solver")
    return superlu_solver(matrix)


class SolverError(ReductionError):
    """A solver fails, which says nothing of the matrix: another may do."""


@contextmanager
def factorising(matrix: SparseMatrix, name: str, needed: float) -> Iterator[None]:
    """Tell the listener of a factorisation and its memory in bytes before and after it.

    Raises
    ------
    ReductionError
        If there is not so much memory.
    """
    rows, there = matrix.shape[0], available_memory()
    if needed > there:
        raise ReductionError(
            f"the factor of {rows} rows by {name} needs {1e-9 * needed:.3g} GB of memory, and only "
            f"{1e-9 * there:.3g} GB are available: use a coarser mesh"
        )
    announce(
        f"factorising {rows} rows with {matrix.nnz} entries by {name}, which takes "
        f"{1e-9 * needed:.2g} GB of memory"
    )
    start = time.perf_counter()
    yield
    announce(f"factorised in {time.perf_counter() - start:.1f} s")


def available_memory() -> float:
    """Memory in bytes that the system can still give; infinite where it does not say."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
    except OSError:
        return math.inf
    kilobytes = [line.split()[1] for line in lines if line.startswith("MemAvailable:")]
    return KILOBYTE * float(kilobytes[0]) if kilobytes else math.inf


def dense_solver(matrix: SparseMatrix, suspect: float) -> tuple[Solver, bool] | None:
    """Cholesky solver, and whether the matrix may be singular, or None if it is not positive.

    It may where a pivot is as small as rounding leaves one, or an eigenvalue is up to `suspect`.
    """
    try:
        lower = linalg.cholesky(matrix.toarray(), lower=True)
    except linalg.LinAlgError:
        return None

    def solver(right: FloatArray) -> FloatArray:
        return np.asarray(linalg.cho_solve((lower, True), right), dtype=np.float64)

    small = float(np.min(np.diag(lower))) ** 2 <= SUSPECT_PIVOT
    return solver, small or smallest_eigenvalue(solver, matrix) <= suspect


def cholesky_solver(matrix: SparseMatrix) -> tuple[Solver, bool] | None:
    """Solver by fronts, and whether the matrix may be singular, or None if it is not positive."""
    plan = announced_plan(matrix)
    with factorising(matrix, "sparse Cholesky", DOUBLE * plan.most_numbers):
        try:
            factor = Cholesky(matrix, plan)
        except NotPositiveDefiniteError:
            return None
        except ValueError as error:
            raise SolverError(f"sparse Cholesky fails ({error})") from error
    return factor.solve, factor.smallest_pivot <= SUSPECT_PIVOT


def announced_plan(matrix: SparseMatrix) -> Elimination:
    """The order of elimination, told to the listener."""
    announce(f"ordering {matrix.shape[0]} rows by nested dissection")
    return dissected(matrix)


def superlu_solver(matrix: SparseMatrix) -> tuple[Solver, bool] | None:
    """SuperLU's solver, and whether the matrix may be singular, or None if it is not positive.

    In its symmetric mode, by the same order of elimination; without exchange of rows all pivots
    of a positive definite matrix are positive.
    """
    plan = announced_plan(matrix)
    order = plan.order
    if SUPERLU_FILL * plan.entries > np.iinfo(np.int32).max:
        raise SolverError("SuperLU cannot count so many entries of a factor: use a coarser mesh")
    with factorising(matrix, "SuperLU", SUPERLU_BYTES * plan.entries):
        ordered = sparse.csc_matrix(matrix[order][:, order])
        try:
            factor = splu(
                ordered,
                permc_spec="NATURAL",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError:  # exactly singular
            return None
        smallest = float(np.min(factor.U.diagonal()))
    if smallest <= 0.0 or not np.array_equal(factor.perm_r, factor.perm_c):
        return None

    def solver(right: FloatArray) -> FloatArray:
        found = np.empty_like(right, dtype=np.float64)
        found[order] = factor.solve(np.ascontiguousarray(right[order], dtype=np.float64))
        return found

    return solver, smallest <= SUSPECT_PIVOT


@cache
def pardiso_is_there() -> bool:
    """Whether pypardiso and its MKL library can be loaded."""
    try:
        import pypardiso

        pypardiso.PyPardisoSolver(mtype=2)
    except (ImportError, OSError, AttributeError):
        return False
    return True


# Every entry that MKL's manual lists as input, numbered from 1: 1 no defaults, 2 nested dissection,
# 8 refinement by `Factor.solve`, 10 perturbation of pivots (of type -2 alone), 27 check of the
# matrix, 28 double precision, 35 numbered from 1, 37 compressed rows, 60 in memory.
IPARM = {
    1: 1, 2: 2, 4: 0, 5: 0, 6: 0, 8: 0, 10: 13, 11: 0, 12: 0, 13: 0, 18: 0, 19: 0, 21: 1, 24: 0,
    25: 0, 27: 1, 28: 0, 31: 0, 34: 0, 35: 0, 36: 0, 37: 0, 56: 0, 60: 0,
}  # fmt: skip
POSITIVE_DEFINITE = 2
NOT_POSITIVE = -4


def pardiso_solver(matrix: SparseMatrix) -> tuple[Solver, bool] | None:
    """PARDISO's solver, and whether the matrix may be singular, or None if it is not positive.

    The matrix type is that of positive definite matrices, for which the default settings of
    pypardiso, made for unsymmetric ones, do not hold.
    """
    import pypardiso

    upper = sparse.csr_matrix(sparse.triu(matrix, format="csr"))
    upper.sort_indices()
    pardiso = pypardiso.PyPardisoSolver(mtype=POSITIVE_DEFINITE)
    pardiso.iparm[:] = 0
    for place, value in IPARM.items():
        pardiso.iparm[place - 1] = value
    nothing = np.zeros((matrix.shape[0], 1), order="F")
    try:
        pardiso.set_phase(11)
        pardiso._call_pardiso(upper, nothing)
        needed = KILOBYTE * max(pardiso.iparm[14], float(pardiso.iparm[15]) + pardiso.iparm[16])
        with factorising(matrix, "PARDISO", needed):
            pardiso.set_phase(22)
            pardiso._call_pardiso(upper, nothing)
    except pypardiso.pardiso_wrapper.PyPardisoError as error:
        if error.value == NOT_POSITIVE:
            return None
        raise SolverError(f"PARDISO fails with its error code {error.value}") from error
    pardiso.set_phase(33)

    def solver(right: FloatArray) -> FloatArray:
        if not right.size:  # which PARDISO takes for an error
            return np.zeros_like(right)
        found = pardiso._call_pardiso(upper, np.asfortranarray(right, dtype=np.float64))
        return np.asarray(found, dtype=np.float64)

    weakref.finalize(solver, released, pardiso, upper)
    return solver, smallest_eigenvalue(solver, matrix) <= SUSPECT_EIGENVALUE


SOLVERS = {
    "pardiso": pardiso_solver,
    "cholesky": cholesky_solver,
    "superlu": superlu_solver,
}


def released(pardiso: Any, upper: Any) -> None:
    """Give PARDISO's memory back."""
    pardiso.set_phase(-1)
    pardiso._call_pardiso(upper, np.zeros(upper.shape[0]))


def smallest_eigenvalue(solver: Solver, matrix: SparseMatrix, steps: int = 3) -> float:
    """Upper bound of the smallest eigenvalue of A, by inverse iteration."""
    vector = np.random.default_rng(0).standard_normal(matrix.shape[0])
    for _ in range(steps):
        vector = solver(vector / np.linalg.norm(vector))
    return float(vector @ times(matrix, vector)) / float(vector @ vector)
