"""Checks of a reduced model against its component, as commercial codes print them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cms.base.arrays import FloatArray, SparseMatrix
from cms.base.errors import ReductionError
from cms.component.component import (
    ComponentLike,
    Pencil,
    checked_pencil,
    interface_vector,
    symmetric_matrix,
    times,
)
from cms.reduction.inertia import elastic_solutions, quotient
from cms.reduction.model import ReducedModel
from cms.reduction.seen import told_of_left_out
from cms.solvers.eigen import Shifted, lowest_modes, shifted_factor, without_offsets

ONE_FREQUENCY = 1e-6  # modes nearer than this may be turned among each other


@dataclass(frozen=True, eq=False)
class Checks:
    """What `check` found.

    Attributes
    ----------
    mass_orthogonality, stiffness_orthogonality : float
        Largest entry of ``V^T M V - I``, and of ``V^T K V - diag(w^2)`` with rows and columns
        divided by w (a rigid-body mode by the first w above zero).
    static_recovery : dict of str to float
        Error of the whole static shape under a load at each interface, in strain energy:
        ``sqrt(e^T K e / u^T K u)``; under inertia relief where the component floats.
    rigid_body_modes : (int, int)
        Of the reduced model and of the component.
    direction_mass : dict of str to float
        ``d^T M d`` of each direction d: the mass in it, in kg for a unit translation.
    direction_hz : dict of str to float
        ``sqrt(d^T K d / d^T M d)`` in Hz: zero if the component floats in this direction.
    effective_mass : dict of str to (r,) array
        Modal effective mass ``(phi^T M d)^2``; its sum over all modes of the component is the mass.
    frequency_errors : (n,) array
        Relative error of the frequency nearest in shape to each compared mode of the component.
    mac : (n,) array
        Modal assurance criterion of that mode with the space of the model's modes of the same
        frequency (rigid-body modes are one space): the squared cosine of the angle between them.
    rigid_bound_hz : float
        As `ReducedModel.rigid_bound_hz`.
    unseen_modes : tuple of int
        As `ReducedModel.unseen_modes`.
    left_out_hz : tuple of float
        As `ReducedModel.left_out_hz`.
    """

    mass_orthogonality: float
    stiffness_orthogonality: float
    static_recovery: Mapping[str, float]
    rigid_body_modes: tuple[int, int]
    direction_mass: Mapping[str, float]
    direction_hz: Mapping[str, float]
    effective_mass: Mapping[str, FloatArray]
    frequency_errors: FloatArray
    mac: FloatArray
    rigid_bound_hz: float = 0.0
    unseen_modes: tuple[int, ...] = ()
    left_out_hz: tuple[float, ...] = ()

    def report(self) -> str:
        """The checks as text, a line each."""
        lines = [
            f"orthogonality: mass {self.mass_orthogonality:.1e}, "
            f"stiffness {self.stiffness_orthogonality:.1e}",
            "rigid-body modes: {} of the model, {} of the component".format(*self.rigid_body_modes),
        ]
        if self.rigid_bound_hz:
            lines.append(f"few digits leave these undetermined up to {self.rigid_bound_hz:.3g} Hz")
        if self.unseen_modes:
            numbers = ", ".join(map(str, self.unseen_modes))
            lines.append(f"kept modes that move no interface: {numbers}")
        lines += told_of_left_out(self.left_out_hz)
        for name, error in self.static_recovery.items():
            lines.append(f"static recovery of a load at '{name}': error {error:.1e}")
        for name, mass in self.direction_mass.items():
            share = float(self.effective_mass[name].sum()) / mass if mass else np.nan
            lines.append(
                f"direction '{name}': mass {mass:.6g}, {100 * share:.2f} % of it in the modes, "
                f"held by {self.direction_hz[name]:.4g} Hz"
            )
        for number, (error, value) in enumerate(
            zip(self.frequency_errors, self.mac, strict=True), start=1
        ):
            lines.append(f"mode {number} of the component: frequency {error:+.1e}, MAC {value:.6f}")
        return "\n".join(lines)


def check(
    component: ComponentLike,
    reduced: ReducedModel,
    *,
    directions: Mapping[str, ArrayLike] | None = None,
    modes: int = 0,
) -> Checks:
    """Check a reduced model against the component that it was made of.

    Parameters
    ----------
    component : ComponentLike
        As for `cms.reduce`.
    reduced : ReducedModel
        Its reduced model, by any method.
    directions : mapping of str to (N,) array_like, optional
        Rigid translations or rotations: 1 at every free dof of the direction.
    modes : int
        How many of the component's lowest modes to compare with.

    Returns
    -------
    Checks

    Raises
    ------
    ReductionError
        If the model does not belong to the component.

    Examples
    --------
    >>> import numpy as np, cms
    >>> n = 20
    >>> K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    >>> chain = cms.Matrices(K, np.eye(n), {"first": np.eye(n)[0]})
    >>> found = cms.check(chain, cms.reduce(chain, modes=4), directions={"along": np.ones(n)})
    >>> found.static_recovery["first"] < 1e-12, found.direction_mass["along"]
    (True, 20.0)
    """
    pencil = checked_pencil(component)
    check_belongs(pencil, reduced)
    shifted = shifted_factor(pencil)
    pencil = without_offsets(pencil, shifted)
    given = {
        name: interface_vector(vector, name, pencil.size)
        for name, vector in (directions or {}).items()
    }
    masses = {name: float(d @ times(pencil.mass, d)) for name, d in given.items()}
    energies = {name: float(pencil.energies(d[:, None])[0, 0]) for name, d in given.items()}
    errors, values = compared(pencil, shifted, reduced, modes)
    mass_error, stiffness_error = orthogonality(pencil, reduced)
    return Checks(
        mass_orthogonality=mass_error,
        stiffness_orthogonality=stiffness_error,
        static_recovery=static_recovery(pencil, shifted, reduced),
        rigid_body_modes=(reduced.rigid_body_modes, shifted.rigid),
        direction_mass=masses,
        direction_hz={
            name: float(np.sqrt(max(energies[name], 0.0) / masses[name])) / (2 * np.pi)
            if masses[name] > 0.0
            else np.inf
            for name in given
        },
        effective_mass={
            name: (reduced.basis.T @ times(pencil.mass, d)) ** 2 for name, d in given.items()
        },
        frequency_errors=errors,
        mac=values,
        rigid_bound_hz=reduced.rigid_bound_hz,
        unseen_modes=reduced.unseen_modes,
        left_out_hz=reduced.left_out_hz,
    )


def check_belongs(pencil: Pencil, reduced: ReducedModel) -> None:
    """Raise ReductionError where sizes or interfaces differ."""
    if reduced.components:
        raise ReductionError("a coupled model has no component to be compared with")
    if reduced.basis.shape[0] != pencil.size:
        raise ReductionError(
            f"the model has {reduced.basis.shape[0]} degrees of freedom, but the component "
            f"{pencil.size}"
        )
    if reduced.interfaces != pencil.names:
        raise ReductionError(
            f"the model has the interfaces {', '.join(reduced.interfaces) or 'none'}, but the "
            f"component {', '.join(pencil.names) or 'none'}"
        )


def orthogonality(pencil: Pencil, reduced: ReducedModel) -> tuple[float, float]:
    """Deviation of the modes from M- and K-orthogonality, see `Checks`."""
    V, squares = reduced.basis, (2.0 * np.pi * reduced.frequencies_hz) ** 2
    mass = V.T @ times(pencil.mass, V) - np.eye(reduced.size)
    slowest = float(np.min(squares, where=squares > 0.0, initial=np.inf))
    scale: FloatArray = np.sqrt(np.maximum(squares, slowest if slowest < np.inf else 1.0))
    stiffness = (pencil.energies(V) - np.diag(squares)) / np.outer(scale, scale)
    return float(np.abs(mass).max()), float(np.abs(stiffness).max())


def static_recovery(pencil: Pencil, shifted: Shifted, reduced: ReducedModel) -> dict[str, float]:
    """Relative error of the static shapes in strain energy, by interface."""
    exact = elastic_solutions(pencil, shifted, pencil.loads)
    squares = (2.0 * np.pi * reduced.frequencies_hz) ** 2
    soft = np.where(squares > 0.0, quotient(np.ones_like(squares), squares), 0.0)
    found = {}
    for number, name in enumerate(pencil.names):
        shape = reduced.expand(soft * reduced.participation[name])
        if reduced.residual_shapes is not None:
            shape = shape + reduced.residual_shapes[:, number]
        u = exact[:, number]
        part, whole = np.diag(pencil.energies(np.column_stack([shape - u, u])))
        found[name] = float(np.sqrt(max(part, 0.0) / whole)) if whole > 0.0 else 0.0
    return found


def compared(
    pencil: Pencil, shifted: Shifted, reduced: ReducedModel, modes: int
) -> tuple[FloatArray, FloatArray]:
    """Errors of frequency (n,) and MAC (n,) of the component's lowest modes."""
    if not 0 <= modes <= pencil.size:
        raise ReductionError(f"modes = {modes} to compare with must be from 0 to {pencil.size}")
    full = lowest_modes(pencil, shifted, modes)
    if modes == 0:
        return np.zeros(0), np.zeros(0)
    alike = mac(full.vectors, reduced.basis, pencil.mass)
    nearest = np.argmax(alike, axis=1)
    exact = np.sqrt(full.squares) / (2.0 * np.pi)
    own = reduced.frequencies_hz
    error = quotient(own[nearest] - exact, exact)
    same = np.abs(own[None, :] - own[nearest][:, None]) <= ONE_FREQUENCY * own[nearest][:, None]
    return error, np.minimum(np.sum(alike, axis=1, where=same), 1.0)


def mac(a: ArrayLike, b: ArrayLike, mass: SparseMatrix | ArrayLike | None = None) -> FloatArray:
    r"""Modal assurance criterion of two sets of shapes.

    .. math:: \mathrm{MAC}_{ij} = \frac{(a_i^T M b_j)^2}{(a_i^T M a_i)(b_j^T M b_j)}

    Parameters
    ----------
    a, b : (N, k), (N, l) array_like
        Shapes, one per column.
    mass : (N, N) matrix, optional
        Weight M; the identity unless given.

    Returns
    -------
    (k, l) array
        Between 0 and 1.

    Raises
    ------
    ReductionError
        If shapes do not agree.

    References
    ----------
    Allemang, R.J. and Brown, D.L. (1982) A correlation coefficient for modal vector analysis.
    Proceedings of the 1st International Modal Analysis Conference, 110-116.

    Examples
    --------
    >>> mac([[1.0], [0.0]], [[1.0, 1.0], [0.0, 1.0]]).tolist()
    [[1.0, 0.5]]
    """
    first, second = np.atleast_2d(np.asarray(a, float)), np.atleast_2d(np.asarray(b, float))
    if first.shape[0] != second.shape[0]:
        raise ReductionError(
            f"shapes of {first.shape[0]} and of {second.shape[0]} degrees of freedom cannot be "
            "compared"
        )
    weight = None if mass is None else symmetric_matrix(mass, "mass")
    if weight is not None and weight.shape[0] != first.shape[0]:
        raise ReductionError(
            f"the mass matrix has shape {weight.shape}, the shapes have {first.shape[0]} rows"
        )
    first_weighted = first if weight is None else times(weight, first)
    second_weighted = second if weight is None else times(weight, second)
    cross = first.T @ second_weighted
    sizes = np.outer(
        np.sum(first * first_weighted, axis=0), np.sum(second * second_weighted, axis=0)
    )
    return quotient(cross**2, sizes)
