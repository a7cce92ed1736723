"""Fixed-interface modes and constraint modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

from cms.base.arrays import FloatArray, SparseMatrix
from cms.base.errors import ReductionError
from cms.component.component import Pencil, times
from cms.reduction.inertia import elastic_solutions
from cms.solvers.eigen import Shifted, shifted_factor, without_offsets

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

    def inertia_of_constraint_modes(self) -> FloatArray:
        """``M Psi_c`` at the interior dofs, (n, m)."""
        inertia = times(self.whole.mass, self.constraint_modes)
        return np.asarray(self.turn.T @ inertia)[: self.interior.size]


def fixed_interface(pencil: Pencil) -> FixedInterface:
    """Take the interfaces' displacements as coordinates and factorise what is between them.

    One dof of every interface vector gives way to the displacement ``y = b^T u``; for an
    interface of a single dof nothing changes but the order. Interfaces that depend on the others
    are left out.

    Raises
    ------
    ReductionError
        If no degree of freedom is left between them.
    """
    interfaces, pivots = independent_interfaces(pencil.loads)
    inner = np.setdiff1d(np.arange(pencil.size), pivots)
    if not inner.size:
        raise ReductionError(
            f"the interfaces take all degrees of freedom of the component ({pencil.size}): nothing "
            "is left between them to reduce; use method 'rubin'"
        )
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
    natural = None if pencil.natural is None else pencil.natural.after(turn[:, :n])
    interior = Pencil(
        symmetric(K[:n, :n]),
        symmetric(M[:n, :n]),
        (),
        np.zeros((n, 0)),
        natural,
        pencil.rounding,
        pencil.mass_rounding,
        origin=(pencil, turn[:, :n]),
    )
    shifted = shifted_factor(interior)
    interior = without_offsets(interior, shifted)
    shapes = np.vstack([elastic_solutions(interior, shifted, -coupling), np.eye(m)])
    if natural is not None:
        left = times(sparse.csc_array(turn.T), pencil.forces(times(turn, shapes)))[:n]
        shapes[:n] -= elastic_solutions(interior, shifted, left)
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


def fixed_interface_errors(
    fixed: FixedInterface, squares: FloatArray, vectors: FloatArray
) -> FloatArray:
    """Relative residual of each mode, as by `eigen.mode_errors`, by the interior factor.

    The residual of a Ritz vector is orthogonal to the constraint modes, so that
    ``r^T K^-1 r = r_i^T K_ii^-1 r_i``.
    """
    residual = fixed.whole.forces(vectors) - times(fixed.whole.mass, vectors) * squares
    inner = times(sparse.csc_array(fixed.turn.T), residual)[: fixed.interior.size]
    energy = np.sum(inner * fixed.shifted.factor.solve(inner), axis=0)
    scale = squares + fixed.shifted.shift
    quotient = np.divide(np.abs(energy), scale, out=np.zeros_like(scale), where=scale > 0.0)
    return np.asarray(np.sqrt(quotient))
