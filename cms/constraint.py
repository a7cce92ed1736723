"""Fixed-interface modes and constraint modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from cms.component import FloatArray, Pencil, SparseMatrix, times
from cms.eigen import EPS, RIGID_TOLERANCE, SUSPECT_PIVOT, Shifted, mass_orthonormal, shifted_factor
from cms.errors import ReductionError
from cms.inertia import elastic_solutions

IntArray = NDArray[np.intp]
DEPENDENCE_TOLERANCE = 1e-10


@dataclass(frozen=True, eq=False)
class FixedInterface:
    """A component in the coordinates (interior dofs, displacements y of the interfaces).

    Attributes
    ----------
    whole : Pencil
        The component.
    turn : (N, N) sparse array
        ``u = turn @ (u_interior, y)``.
    interior : Pencil
        K and M of the interior dofs, which is the component with its interfaces held.
    shifted : Shifted
        The factorised interior stiffness; the one factorisation of the method.
    constraint_modes : (N, m) array
        Static shapes under a unit displacement of one interface, the others held.
    dropped : int
        Interfaces whose displacement follows from that of the others.
    """

    whole: Pencil
    turn: SparseMatrix
    interior: Pencil
    shifted: Shifted
    constraint_modes: FloatArray
    dropped: int

    def expanded(self, vectors: FloatArray) -> FloatArray:
        """Shapes of the component (N, k) from those of the interior dofs, interfaces held."""
        held = np.zeros((self.whole.size - vectors.shape[0], vectors.shape[1]))
        return times(self.turn, np.vstack([vectors, held]))


def fixed_interface(pencil: Pencil) -> FixedInterface:
    """Take the interfaces' displacements as coordinates and factorise what is between them.

    One dof of every interface vector gives way to the displacement ``y = b^T u``; for an
    interface of a single dof nothing changes but the order. Interfaces that depend on the others
    are left out.
    """
    interfaces, pivots = independent_interfaces(pencil.loads)
    inner = np.setdiff1d(np.arange(pencil.size), pivots)
    B = pencil.loads[:, interfaces]
    inverse = linalg.inv(B[pivots].T) if pivots.size else np.zeros((0, 0))
    follow = sparse.coo_array(-inverse @ B[inner].T)
    size, m = pencil.size, pivots.size
    at, into = follow.coords
    rows = np.concatenate([inner, pivots[at], np.repeat(pivots, m)])
    columns = np.concatenate([np.arange(inner.size), into, np.tile(np.arange(inner.size, size), m)])
    data = np.concatenate([np.ones(inner.size), follow.data, inverse.ravel()])
    turn = sparse.csc_array((data, (rows, columns)), shape=(size, size))
    K = sparse.csc_array(turn.T @ pencil.stiffness @ turn)
    M = sparse.csc_array(turn.T @ pencil.mass @ turn)
    n = inner.size
    coupling = K[:n, n:].toarray()
    interior = Pencil(symmetric(K[:n, :n]), symmetric(M[:n, :n]), (), np.zeros((n, 0)))
    shifted = shifted_factor(interior)
    shapes = np.vstack([elastic_solutions(interior, shifted, -coupling), np.eye(m)])
    dropped = pencil.loads.shape[1] - m
    return FixedInterface(pencil, turn, interior, shifted, times(turn, shapes), dropped)


def symmetric(matrix: SparseMatrix) -> SparseMatrix:
    """The matrix with its rounding asymmetry averaged away."""
    return sparse.csc_array((matrix + matrix.T) * 0.5)


def independent_interfaces(loads: FloatArray) -> tuple[IntArray, IntArray]:
    """Indices of independent interface vectors (m,) and of as many dofs that tell them apart."""
    if not loads.shape[1]:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    scaled = loads / np.linalg.norm(loads, axis=0)
    _, upper, order = linalg.qr(scaled, mode="economic", pivoting=True)
    rank = int(np.count_nonzero(np.abs(np.diag(upper)) > DEPENDENCE_TOLERANCE))
    interfaces = np.sort(order[:rank])
    _, _, dofs = linalg.qr(scaled[:, interfaces].T, mode="economic", pivoting=True)
    return interfaces, dofs[:rank]


def ritz(basis: FloatArray, pencil: Pencil, fastest: float) -> tuple[FloatArray, FloatArray]:
    """w^2 (r,) ascending and mass-normalised vectors (N, r) of K and M projected on a basis (N, r).

    Where the projected stiffness is singular, w^2 at rounding level (of the fastest w^2 of the
    component) are exactly zero. Slow modes come from the inverse problem, fast ones from the
    direct one, as in `cms.eigen.with_fast_modes`.

    Raises
    ------
    ReductionError
        If a direction of the basis has no mass.
    """
    if basis.shape[1] == 0:
        return np.zeros(0), basis
    K = basis.T @ times(pencil.stiffness, basis)
    M = basis.T @ times(pencil.mass, basis)
    K, M = (K + K.T) / 2, (M + M.T) / 2
    shift = 0.0 if definite(K) else np.sqrt(EPS) * fastest
    nu, directions = linalg.eigh(M, K + shift * M)
    nu, directions = nu[::-1], directions[:, ::-1]
    if nu[-1] <= 0.0:
        raise ReductionError("an interface has no mass to move: give it some")
    squares, directions = 1.0 / nu - shift, directions / np.sqrt(nu)
    direct, direct_directions = linalg.eigh(K, M)
    slow = direct + shift <= np.sqrt(1.0 / (nu[0] * nu[-1]))
    squares = np.where(slow, squares, direct)
    directions = np.where(slow, directions, direct_directions)
    if shift:
        squares = np.where(np.abs(squares) <= RIGID_TOLERANCE * fastest, 0.0, squares)
    return squares, mass_orthonormal(basis @ directions, pencil.mass)


def definite(matrix: FloatArray) -> bool:
    """Whether a symmetric matrix scaled to a unit diagonal has no pivot at rounding level."""
    diagonal = np.diag(matrix)
    if np.any(diagonal <= 0.0):
        return False
    scale = 1.0 / np.sqrt(diagonal)
    try:
        lower = linalg.cholesky(scale[:, None] * matrix * scale, lower=True)
    except linalg.LinAlgError:
        return False
    return bool(np.min(np.diag(lower)) ** 2 > SUSPECT_PIVOT)


def fixed_interface_errors(
    fixed: FixedInterface, squares: FloatArray, vectors: FloatArray
) -> FloatArray:
    """Relative residual of each mode, as `cms.eigen.mode_errors` gives it, by the interior factor.

    The residual of a Ritz vector is orthogonal to the constraint modes, so that
    ``r^T K^-1 r = r_i^T K_ii^-1 r_i``.
    """
    K, M = fixed.whole.stiffness, fixed.whole.mass
    residual = times(K, vectors) - times(M, vectors) * squares
    inner = times(sparse.csc_array(fixed.turn.T), residual)[: fixed.interior.size]
    energy = np.sum(inner * fixed.shifted.factor.solve(inner), axis=0)
    scale = squares + fixed.shifted.shift
    quotient = np.divide(np.abs(energy), scale, out=np.zeros_like(scale), where=scale > 0.0)
    return np.asarray(np.sqrt(quotient))
