"""What a component has to offer, and the checks that it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from cms.base.arrays import FloatArray, SparseMatrix
from cms.base.errors import ReductionError
from cms.component.digits import checked_digits, entry_digits, relative_rounding, rounded_energies
from cms.component.massless import massless_directions, without_noise

SYMMETRY_TOLERANCE = 1e-9
NATURAL_TOLERANCE = 1e-6
MOST_DENSE = 1500
MOST_BYTES = 3e8  # of deformations at a time


@runtime_checkable
class ComponentLike(Protocol):
    """Anything with a stiffness, a mass and named interface vectors.

    Attributes
    ----------
    stiffness, mass : (N, N) sparse or dense matrix
        Symmetric, in consistent units (N/m and kg for translations).
    interfaces : mapping of str to (N,) array
        A load f at the interface is ``vector * f``; its displacement is ``vector @ u``.

    Notes
    -----
    A ``natural_form`` is optional: an object whose ``deformations`` A, an (m, N) matrix or linear
    operator, and ``stiffness`` d, (m,), give ``K = A^T d A``. Where A keeps the digits of
    deformations beside those of rigid motion, all results do, whatever the condition of K.
    ``load_vectors`` are optional, too: names of interfaces that are no places but loads on the
    whole, as a weight is. So are ``digits``: how many decimal digits the entries have.
    Where they are not given they are read off the entries.
    """

    @property
    def stiffness(self) -> Any:
        """Symmetric (N, N) matrix."""

    @property
    def mass(self) -> Any:
        """Symmetric (N, N) matrix."""

    @property
    def interfaces(self) -> Mapping[str, Any]:
        """Vectors by name."""


@dataclass(frozen=True, eq=False)
class Matrices:
    """A component given by its matrices.

    Attributes
    ----------
    stiffness, mass : (N, N) sparse or dense matrix
        Symmetric, in N/m and kg for translations.
    interfaces : mapping of str to (N,) array_like
        Load and displacement vector of each interface.
    damping : (N, N) sparse or dense matrix, optional
        Symmetric, in N s/m for translations.
    digits : int, optional
        How many decimal digits the entries of stiffness and mass have, 3 to 17; read off the
        entries unless given. State it where they were rounded and then converted to other units,
        or where exact entries look rounded (17).
    load_vectors : tuple of str
        Names of those interfaces that are loads on the whole, as a weight is.

    Examples
    --------
    >>> import cms
    >>> oscillator = cms.Matrices([[4.0]], [[1.0]], {"mass": [1.0]})
    >>> cms.reduce(oscillator, modes=1).frequencies_hz.round(4).tolist()
    [0.3183]
    """

    stiffness: Any
    mass: Any
    interfaces: Mapping[str, Any]
    damping: Any = None
    digits: int | None = None
    load_vectors: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class NaturalForm:
    """K = A^T d A by deformations A, a linear operator (m, N), and their stiffness d (m,)."""

    deformations: Any
    stiffness: FloatArray

    def after(self, turn: SparseMatrix) -> NaturalForm:
        """That of ``turn^T K turn``."""
        return NaturalForm(self.deformations @ aslinearoperator(turn), self.stiffness)

    def forces(self, vectors: FloatArray) -> FloatArray:
        """``K V``, (N, k)."""
        found = np.empty_like(vectors)
        for columns in self.chunks(vectors.shape[1]):
            stress = self.stiffness[:, None] * (self.deformations @ vectors[:, columns])
            found[:, columns] = self.deformations.T @ stress
        return found

    def energies(self, vectors: FloatArray) -> FloatArray:
        """``V^T K V``, (k, k)."""
        count = vectors.shape[1]
        found = np.empty((count, count))
        for columns in self.chunks(count):
            deformed = self.deformations @ vectors[:, columns]
            stress = self.stiffness[:, None] * deformed
            found[columns, columns] = stress.T @ deformed
            for others in self.chunks(columns.start):
                block = stress.T @ (self.deformations @ vectors[:, others])
                found[columns, others], found[others, columns] = block, block.T
        return (found + found.T) / 2

    def chunks(self, count: int) -> list[slice]:
        """Columns whose deformations fit into memory together."""
        step = max(int(MOST_BYTES / (8 * max(self.stiffness.size, 1))), 1)
        return [slice(first, min(first + step, count)) for first in range(0, count, step)]


@dataclass(frozen=True, eq=False)
class Pencil:
    """The checked matrices K and M (N, N) and the interface vectors B, one column per name.

    Products with K go by its natural form where there is one; K itself is for factors. They are
    those of ``K - F diag(w^2) F^T`` with the inertia F = M R of rigid-body modes R that rounding
    of the entries has given the ``offset`` w^2.

    ``rounding`` is the largest relative error of an entry of K, ``mass_rounding`` that of M,
    beyond that of double precision. A pencil in other coordinates has its ``origin``: another one
    and the matrix (N', N) that expands to its degrees of freedom, where these roundings are.
    """

    stiffness: SparseMatrix
    mass: SparseMatrix
    names: tuple[str, ...]
    loads: FloatArray
    natural: NaturalForm | None = None
    rounding: float = 0.0
    mass_rounding: float = 0.0
    inertia: FloatArray | None = None
    offset: FloatArray | None = None
    origin: tuple[Pencil, Any] | None = None

    @property
    def size(self) -> int:
        """Number of degrees of freedom N."""
        return int(self.stiffness.shape[0])

    @property
    def digits(self) -> int | None:
        """Decimal digits of the entries of K; None if they are those of double precision."""
        return None if not self.rounding else round(1.0 - np.log10(2.0 * self.rounding))

    @cached_property
    def massless(self) -> FloatArray:
        """Directions without mass (N, z); not looked for beyond `MOST_DENSE` rows."""
        if self.size > MOST_DENSE:
            return np.zeros((self.size, 0))
        return massless_directions(self.mass, self.mass_rounding)

    def forces(self, vectors: FloatArray) -> FloatArray:
        """``K V``, (N, k)."""
        if self.natural is not None:
            return self.natural.forces(vectors)
        found = times(self.stiffness, vectors)
        if self.inertia is None or self.offset is None:
            return found
        return found - self.inertia @ (self.offset[:, None] * (self.inertia.T @ vectors))

    def undetermined(self, vectors: FloatArray, double: float) -> FloatArray:
        """Change of ``v^T K v`` (k,) by rounding, of double precision by ``double``."""
        if self.origin is not None:
            before, expansion = self.origin
            return before.undetermined(np.asarray(expansion @ vectors), double)
        large = np.abs(vectors)
        summed = double * np.sum(large * times(abs(self.stiffness), large), axis=0)
        if self.rounding == 0.0:
            return np.asarray(summed)
        return np.asarray(summed + rounded_energies(self.stiffness, vectors, self.rounding))

    def energies(self, vectors: FloatArray) -> FloatArray:
        """``V^T K V``, (k, k)."""
        if self.natural is not None:
            return self.natural.energies(vectors)
        found = vectors.T @ self.forces(vectors)
        return np.asarray((found + found.T) / 2)


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
        raise ReductionError(
            f"the {what} matrix has the entry {value} in row {row}, counted from 0"
        )
    largest = float(abs(array).max())
    difference = float(abs(array - array.T).max())
    if difference > SYMMETRY_TOLERANCE * largest:
        raise ReductionError(
            f"the {what} matrix is not symmetric: entries opposite each other differ by "
            f"{difference:.3g}, its largest entry being {largest:.3g}"
        )
    return sparse.csc_array((array + array.T) * 0.5) if difference else array


def interface_vector(vector: Any, name: str, size: int) -> FloatArray:
    """The interface vector as (N,) floats, checked to be finite and not zero.

    Raises
    ------
    ReductionError
        If its shape is not (N,), an entry is not finite, or all are zero.
    """
    if sparse.issparse(vector):
        given: Any = vector
        vector = given.toarray()
        vector = vector.ravel() if 1 in vector.shape else vector
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
    mass = without_noise(mass, stiffness)
    check_diagonal(mass, "mass")
    if not abs(mass).max() > 0.0:
        raise ReductionError("the mass matrix is zero: the component has no mass")
    size = int(stiffness.shape[0])
    names = tuple(component.interfaces)
    vectors = [interface_vector(component.interfaces[name], name, size) for name in names]
    loads = np.column_stack(vectors) if vectors else np.zeros((size, 0))
    natural = checked_form(getattr(component, "natural_form", None), stiffness)
    given = checked_digits(getattr(component, "digits", None))
    rounding = [0.0, 0.0]
    if natural is None:
        for number, matrix in enumerate((component.stiffness, component.mass)):
            found = entry_digits(sparse.csc_array(matrix).data) if given is None else given
            rounding[number] = relative_rounding(found)
    return Pencil(stiffness, mass, names, loads, natural, rounding[0], rounding[1])


def checked_form(form: Any, stiffness: SparseMatrix) -> NaturalForm | None:
    """The natural form of a component, if it has one, checked to be that of K (N, N).

    Raises
    ------
    ReductionError
        If its shapes or its product with a vector differ.
    """
    if form is None:
        return None
    try:
        stiffnesses = np.asarray(form.stiffness, dtype=np.float64)
        given = form.deformations
        if not (sparse.issparse(given) or isinstance(given, LinearOperator)):
            given = np.asarray(given, dtype=np.float64)
        found = NaturalForm(aslinearoperator(given), stiffnesses)
    except (AttributeError, TypeError, ValueError) as error:
        raise ReductionError(
            "the natural form needs 'deformations' and 'stiffness', arrays of numbers"
        ) from error
    size = stiffness.shape[0]
    if stiffnesses.ndim != 1 or found.deformations.shape != (stiffnesses.size, size):
        raise ReductionError(
            f"the natural form has deformations of shape {found.deformations.shape} and stiffness "
            f"of shape {stiffnesses.shape}, but the component has {size} degrees of freedom"
        )
    diagonal = stiffness.diagonal()
    weights = np.sqrt(np.where(diagonal > 0.0, diagonal, np.inf))
    trial = (np.random.default_rng(0).standard_normal(size) / weights)[:, None]
    exact = times(stiffness, trial)
    scale = 1.0 / weights[:, None]  # so that soft degrees of freedom count as stiff ones
    worst = np.abs(scale * (found.forces(trial) - exact)).max()
    if not worst <= NATURAL_TOLERANCE * np.abs(scale * exact).max():
        raise ReductionError("the natural form is not that of the stiffness matrix")
    return found


def check_diagonal(matrix: SparseMatrix, what: str) -> None:
    """Raise ReductionError where a diagonal entry is negative: the matrix is then indefinite."""
    diagonal = matrix.diagonal()
    worst = int(np.argmin(diagonal))
    if diagonal[worst] < 0.0:
        raise ReductionError(
            f"the {what} matrix is not positive: its diagonal has {diagonal[worst]:.3g} "
            f"in row {worst}, counted from 0"
        )
