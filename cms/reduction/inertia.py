"""Static solutions of a component that floats: loads balanced by the inertia of rigid motion."""

from __future__ import annotations

import numpy as np

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError
from cms.component.component import Pencil, times
from cms.solvers.eigen import EPS, MOST_REFINEMENTS, Shifted

MOST_STEPS = 200
STEP_TOLERANCE = 4 * EPS
RESIDUAL_TOLERANCE = 1e-6
BALANCE_TOLERANCE = 1e-12


def balanced(pencil: Pencil, loads: FloatArray, rigid: FloatArray) -> FloatArray:
    """Loads (N, m) that the inertia of the rigid motion they cause balances.

    What is left at rounding level, where a load causes nothing but rigid motion, is zero.
    """
    left = relieved(pencil, loads, rigid)
    rounding = np.abs(left).max(axis=0) <= BALANCE_TOLERANCE * np.abs(loads).max(axis=0)
    return np.where(rounding, 0.0, left)


def relieved(pencil: Pencil, forces: FloatArray, rigid: FloatArray) -> FloatArray:
    """``F - M R R^T F``, the forces (N, m) less the inertia of the rigid motion they cause."""
    return forces - times(pencil.mass, rigid) @ (rigid.T @ forces)


def elastic_solutions(pencil: Pencil, shifted: Shifted, loads: FloatArray) -> FloatArray:
    r"""Elastic part of the answer to static loads, with inertia relief where the component floats.

    Parameters
    ----------
    pencil : Pencil
        K and M, (N, N).
    shifted : Shifted
        The factorised K + s M and the rigid-body modes R.
    loads : (N, m) array
        One load per column.

    Returns
    -------
    (N, m) array
        ``K^-1 F``, or the solution of ``K u = F - M R R^T F`` with ``R^T M u = 0``.

    Raises
    ------
    ReductionError
        If the solution does not meet its equation.

    Notes
    -----
    A floating component has no factor of K, but one of K + s M. It serves as preconditioner of a
    conjugate gradient iteration, in which K has the eigenvalues :math:`\omega^2/(\omega^2 + s)`,
    nearly all of them 1. Matrices of few digits have no K R = 0: what K u leaves of forces on R is
    balanced by inertia, too, which keeps the iteration symmetric. For inertia relief see Craig and
    Chang (1977) and Craig and Kurdila (2006), section 17.2.
    """
    if shifted.shift == 0.0:
        return refined_solutions(pencil, shifted, loads)
    rigid = shifted.rigid_modes
    residual = balanced(pencil, loads, rigid)
    whole = np.maximum(column_products(residual, shifted.factor.solve(residual)), 0.0)
    solution = np.zeros_like(residual)
    move = np.zeros_like(residual)
    before = np.zeros(loads.shape[1])
    for _ in range(MOST_STEPS):
        ahead = without_rigid(pencil, rigid, shifted.factor.solve(residual))
        energy = column_products(residual, ahead)
        running = energy > STEP_TOLERANCE**2 * whole
        if not np.any(running):
            break
        move = ahead + move * quotient(energy, before)
        stretch = relieved(pencil, pencil.forces(move), rigid)
        length = np.where(running, quotient(energy, column_products(move, stretch)), 0.0)
        solution = solution + move * length
        residual = residual - stretch * length
        before = energy
    solution = without_rigid(pencil, rigid, solution)
    check_solution(pencil, shifted, solution, balanced(pencil, loads, rigid), whole)
    return solution


def refined_solutions(pencil: Pencil, shifted: Shifted, loads: FloatArray) -> FloatArray:
    """``K^-1 F`` with steps of iterative refinement as long as each is half the one before."""
    solution = shifted.factor.solve(loads)
    before = np.full(loads.shape[1], np.inf)
    for _ in range(MOST_REFINEMENTS):
        step = shifted.factor.solve(loads - pencil.forces(solution))
        size = np.linalg.norm(step, axis=0)
        solution = solution + step
        if not np.any((size < before / 2) & (size > EPS * np.linalg.norm(solution, axis=0))):
            break
        before = size
    return solution


def check_solution(
    pencil: Pencil, shifted: Shifted, solution: FloatArray, loads: FloatArray, whole: FloatArray
) -> None:
    """Raise ReductionError where K u differs from the load by more than 1e-6 in energy."""
    left = relieved(pencil, loads - pencil.forces(solution), shifted.rigid_modes)
    error = np.sqrt(np.abs(column_products(left, shifted.factor.solve(left))))
    failed = error > RESIDUAL_TOLERANCE * np.sqrt(whole)
    if np.any(failed):
        worst = float(np.max(quotient(error, np.sqrt(whole))))
        raise ReductionError(
            f"the static solution with inertia relief fails its residual check ({worst:.1e} > "
            f"{RESIDUAL_TOLERANCE:.0e}): the stiffnesses of the component differ too much "
            "for double precision; use a coarser mesh or stiffnesses that differ less"
        )


def without_rigid(pencil: Pencil, rigid: FloatArray, vectors: FloatArray) -> FloatArray:
    """``(I - R R^T M) V``."""
    return vectors - rigid @ (rigid.T @ times(pencil.mass, vectors))


def column_products(a: FloatArray, b: FloatArray) -> FloatArray:
    """``a_j^T b_j`` for every column, (m,)."""
    return np.asarray(np.sum(a * b, axis=0))


def quotient(a: FloatArray, b: FloatArray) -> FloatArray:
    """The quotient a / b, zero where b is zero."""
    return np.divide(a, b, out=np.zeros_like(a), where=b != 0.0)
