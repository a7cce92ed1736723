"""What a component has to offer, and the checks that it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cms.errors import ReductionError

FloatArray = NDArray[np.float64]
SparseMatrix = sparse.csc_array[np.float64]

SYMMETRY_TOLERANCE = 1e-9


@runtime_checkable
class ComponentLike(Protocol):
    """Anything with a stiffness, a mass and named interface vectors.

    Attributes
    ----------
    stiffness, mass : (N, N) sparse or dense matrix
        Symmetric, in consistent units (N/m and kg for translations).
    interfaces : mapping of str to (N,) array
        A load f at the interface is ``vector * f``; its displacement is ``vector @ u``.
    """

    @property
    def stiffness(self) -> Any: ...

    @property
    def mass(self) -> Any: ...

    @property
    def interfaces(self) -> Mapping[str, Any]: ...


@dataclass(frozen=True, eq=False)
class Pencil:
    """The checked matrices K and M (N, N) and the interface vectors B, one column per name."""

    stiffness: SparseMatrix
    mass: SparseMatrix
    names: tuple[str, ...]
    loads: FloatArray

    @property
    def size(self) -> int:
        """Number of degrees of freedom N."""
        return int(self.stiffness.shape[0])


def times(matrix: SparseMatrix, vectors: FloatArray) -> FloatArray:
    """Matrix (N, N) times vectors (N,) or (N, m)."""
    return np.asarray(matrix @ vectors, dtype=np.float64)


def symmetric_matrix(matrix: Any, what: str) -> SparseMatrix:
    """The matrix as a sparse (N, N) array of floats, its rounding asymmetry averaged away.

    Raises
    ------
    ReductionError
        If it is not a square, finite, real and symmetric matrix.
    """
    try:
        if np.iscomplexobj(matrix):
            raise ReductionError(f"the {what} matrix is complex, it must be real")
        array = sparse.csc_array(matrix, dtype=np.float64)
    except ReductionError:
        raise
    except (TypeError, ValueError) as error:
        raise ReductionError(f"the {what} cannot be read as a matrix of numbers") from error
    if array.ndim != 2 or array.shape[0] != array.shape[1]:
        raise ReductionError(f"the {what} matrix has shape {array.shape}, it must be square")
    if array.shape[0] == 0:
        raise ReductionError(f"the {what} matrix is empty: the component has no free dof")
    bad = np.flatnonzero(~np.isfinite(array.data))
    if bad.size:
        row = int(array.indices[bad[0]])
        value = array.data[bad[0]]
        raise ReductionError(f"the {what} matrix has the entry {value} in row {row}")
    largest = float(abs(array).max())
    difference = float(abs(array - array.T).max())
    if difference > SYMMETRY_TOLERANCE * largest:
        raise ReductionError(
            f"the {what} matrix is not symmetric: entries opposite each other differ by "
            f"{difference:.3g}, its largest entry being {largest:.3g}"
        )
    return sparse.csc_array((array + array.T) * 0.5)


def interface_vector(vector: Any, name: str, size: int) -> FloatArray:
    """The interface vector as (N,) floats, checked to be finite and not zero.

    Raises
    ------
    ReductionError
        If its shape is not (N,), an entry is not finite, or all are zero.
    """
    try:
        array = np.asarray(vector, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ReductionError(f"interface '{name}' is not a vector of numbers") from error
    if array.shape != (size,):
        raise ReductionError(
            f"interface '{name}' has shape {array.shape}, but the component has {size} "
            "degrees of freedom"
        )
    if not np.all(np.isfinite(array)):
        raise ReductionError(f"interface '{name}' has an entry that is not a finite number")
    if not np.any(array):
        raise ReductionError(f"interface '{name}' is a zero vector: it moves with no dof")
    return array


def checked_pencil(component: ComponentLike) -> Pencil:
    """Read and check a component.

    Raises
    ------
    ReductionError
        With one sentence that names the matrix or interface at fault.
    """
    for attribute in ("stiffness", "mass", "interfaces"):
        if not hasattr(component, attribute):
            kind = type(component).__name__
            raise ReductionError(f"the component (a {kind}) has no attribute '{attribute}'")
    stiffness = symmetric_matrix(component.stiffness, "stiffness")
    mass = symmetric_matrix(component.mass, "mass")
    if stiffness.shape != mass.shape:
        raise ReductionError(
            f"the stiffness matrix has shape {stiffness.shape}, but the mass matrix {mass.shape}"
        )
    check_diagonal(stiffness, "stiffness")
    check_diagonal(mass, "mass")
    if not abs(mass).max() > 0.0:
        raise ReductionError("the mass matrix is zero: the component has no mass")
    size = int(stiffness.shape[0])
    names = tuple(component.interfaces)
    vectors = [interface_vector(component.interfaces[name], name, size) for name in names]
    loads = np.column_stack(vectors) if vectors else np.zeros((size, 0))
    return Pencil(stiffness, mass, names, loads)


def check_diagonal(matrix: SparseMatrix, what: str) -> None:
    """Raise ReductionError where a diagonal entry is negative: the matrix is then indefinite."""
    diagonal = matrix.diagonal()
    worst = int(np.argmin(diagonal))
    if diagonal[worst] < 0.0:
        raise ReductionError(
            f"the {what} matrix is not positive: its diagonal has {diagonal[worst]:.3g} "
            f"in row {worst}"
        )
