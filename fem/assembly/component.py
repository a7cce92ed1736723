"""From a model to stiffness, mass and interfaces."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from fem.assembly.constraints import (
    Constraints,
    Numbering,
    constrain,
    number_blocks,
    point_dof,
)
from fem.assembly.load_vectors import InertiaLoads
from fem.assembly.loose import loose_directions
from fem.assembly.mesh_errors import energy_and_mass_off
from fem.assembly.shells import facet_rows
from fem.assembly.solids import cell_rows
from fem.assembly.structure import (
    attached_rows,
    beam_dofs,
    damping_matrix,
    rigid_motions_of,
    unconstrained_matrices,
)
from fem.assembly.trusses import truss_form
from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import JointWarning, ModelError
from fem.checks.conforming import check_conforming
from fem.checks.distorted import distortion_warnings
from fem.checks.hanging import boundary, check_nothing_hangs
from fem.checks.locking import locking_warnings
from fem.checks.mechanisms import joint_warnings, mechanism_warnings
from fem.checks.neighbours import check_not_folded
from fem.checks.overlapping import overlap_warnings
from fem.checks.unlikely import UnlikelyWarning, check_masses_carried, unlikely
from fem.elements.natural import NaturalForm, natural_form
from fem.elements.scatter import SparseArray, displacement_of
from fem.mesh.pieces import check_joined
from fem.model.store import load_model, save_model
from fem.model.structure import AXES, StructureModel

MODES_AT_ONCE = 8
MOST_ERROR = 1.0
"""Of a frequency that is estimated."""


class LockingWarning(UserWarning):
    """Cells that are likely to be too stiff in bending on this mesh, and by how much.

    Without a warning, though below 0.9 of the deflection, are

    - hexahedra on flat plates that are loaded at a point (in full 0.37 to 0.82, reduced 0.84), and
      in full on clamped ones (0.85);
    - wedges, tetrahedra and pyramids of second order in one layer of a thin plate, of which the
      modes tell (`Component.mesh_errors`), and tetrahedra in a single twisted row (0.895);
    - shells of triangles in a single row that is twisted (0.70 to 0.88), that are parallelograms
      bent in their plane (0.74), and much longer than wide below a force (0.75 to 0.86).

    The numbers are those of ``docs/results/elements.md``.
    """


class CurvedCellsWarning(LockingWarning):
    """Curved cells of second order that, each by itself, are likely to be too stiff in bending.

    In a thick part it need not matter: where there are modes, `Component.mesh_errors` knows.
    """


class MeshWarning(UserWarning):
    """Modes whose frequencies the mesh makes likely too high, and by how much."""


class DistortionWarning(UserWarning):
    """Cells that are out of shape: their part may be too stiff, and its stresses wrong there."""


@dataclass(frozen=True, eq=False, repr=False)
class Component(InertiaLoads):
    """An assembled structure: N free degrees of freedom, two matrices and named interfaces.

    Parameters
    ----------
    stiffness, mass
        K in N/m (N m/rad, ...) and M in kg (kg m², ...), sparse and symmetric, shape (N, N).
    interfaces
        A vector of shape (N,) by name: a load f at the interface is `vector * f` and its
        displacement is `vector @ u`.
    model
        The structure that was assembled.
    numbering, constraints
        Which degrees of freedom there are, and how they follow from the free ones.
    rigid_mass
        Mass matrix (6, 6) of the rigid motions, supports apart: along and about x, y and z.
    inertia
        M r in kg of the translations r of everything, supports included, along x, y and, but in
        the plane, z, shape (N, 2 or 3): the load by an acceleration of 1 m/s², such as a weight's.
    damping
        Matrix in N s/m of the dampers that the file of the mesh holds; None without any.
    load_vectors
        Names of those interfaces that are load vectors, see `with_load`.
    areas
        Interfaces that are the points of areas of contact, see `with_interfaces`.
    """

    stiffness: SparseArray
    mass: SparseArray
    interfaces: Mapping[str, FloatArray]
    model: StructureModel
    numbering: Numbering
    constraints: Constraints
    rigid_mass: FloatArray
    inertia: FloatArray
    damping: SparseArray | None = None
    load_vectors: tuple[str, ...] = ()
    areas: Mapping[str, Any] = field(default_factory=dict)

    @property
    def free(self) -> IntArray:
        """Indices of the free degrees of freedom among all, shape (N,)."""
        return self.constraints.free

    @cached_property
    def natural_form(self) -> NaturalForm:
        """K = AᵀdA, which keeps digits that the entries of K have lost.

        Made when it is first asked for; it keeps the gradients of all solids' shape functions.
        """
        sorts = (cell_rows, facet_rows, truss_form, attached_rows)
        rows = [row for sort in sorts for row in sort(self.model, self.numbering)]
        return natural_form(rows, self.constraints.transformation)

    def shape(self, u: FloatArray) -> FloatArray:
        """Translations and rotations (x, y, z) of every node of the mesh, shape (n, 6).

        Parameters
        ----------
        u
            Displacements of the free degrees of freedom, shape (N,).

        Returns
        -------
        ndarray
            Zero where supported, and for rotations of nodes that have none.
        """
        values = np.append(self.all_values(u), 0.0)
        return np.asarray(values[self.numbering.dofs(np.arange(len(self.model.mesh.points)))])

    def element_shape(self, u: FloatArray, part: str) -> FloatArray:
        """Six displacements at both ends of every line of a beam part, hinges apart, (e, 2, 6)."""
        return np.asarray(
            self.all_values(u)[beam_dofs(self.model, self.numbering, part)].reshape(-1, 2, 6)
        )

    def mesh_errors(self, modes: FloatArray) -> FloatArray:
        """How much too high the mesh makes the frequencies of elastic modes: 0.05 is 5 %, (m,).

        An estimate: strains of solids, and curvatures of shells, are made smooth from cell to cell;
        what those of the mesh are off is energy that a fine mesh would not have. It knows cells
        that lock and meshes that are too coarse alike. Beams count as exact, as do stretching of
        shells and shells with layers. `MOST_ERROR` stands for it and more. Where a mode is missing
        altogether, as in cells of first order that hardly bend, no other mode tells of it; there
        `LockingWarning` does.

        Parameters
        ----------
        modes
            Displacements of the free degrees of freedom, shape (N, m).

        Examples
        --------
        A clamped plate of 4 x 4 cells through the thickness, 37 % too stiff:

        >>> import fem
        >>> from scipy.sparse.linalg import eigsh
        >>> plate = fem.box_mesh("plate", (1.0, 1.0, 0.01), (4, 4, 1))
        >>> part = fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))
        >>> held = [fem.Support(side, ("x", "y", "z")) for side in ("x0", "x1", "y0", "y1")]
        >>> component = fem.assemble(fem.StructureModel(plate, {"plate": part}, supports=held))
        >>> _, mode = eigsh(component.stiffness, 1, component.mass, sigma=0.0)
        >>> 0.15 < component.mesh_errors(mode)[0] < 0.4
        np.True_
        """
        energy = np.sum(modes * (self.stiffness @ modes), axis=0)
        mass = np.sum(modes * (self.mass @ modes), axis=0)
        found = np.empty(modes.shape[1])
        for first in range(0, modes.shape[1], MODES_AT_ONCE):
            at = slice(first, first + MODES_AT_ONCE)
            shapes = np.stack([self.shape(u) for u in modes[:, at].T])
            stiffer, lighter = energy_and_mass_off(self.model, shapes)
            least = (1.0 + MOST_ERROR) ** -2
            ratio = (1.0 + lighter / mass[at]) / np.maximum(1.0 - stiffer / energy[at], least)
            found[at] = np.sqrt(np.maximum(ratio, 1.0)) - 1.0
        return np.minimum(found, MOST_ERROR)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the structure to an .npz file; the matrices are assembled again by `load`."""
        save_model(self.model, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Component:
        """Read and assemble what `save` wrote; a `ModelError` says what is wrong."""
        return assemble(load_model(path))

    def all_values(self, u: FloatArray) -> FloatArray:
        """All degrees of freedom, also held and coupled ones, from the free ones (N,)."""
        u = displacement_of(self, u)
        return np.asarray(self.constraints.transformation @ u, dtype=np.float64)


def assemble(model: StructureModel) -> Component:
    """Assemble stiffness and consistent mass of a structure.

    Parameters
    ----------
    model
        What is assembled. It may float freely or be a mechanism.

    Returns
    -------
    Component
        Matrices of the free degrees of freedom and the interface vectors.

    Raises
    ------
    ModelError
        If the supports leave nothing free, a cell is flat or folded, cells do not fit together,
        or a support, mass, spring or interface is where there is nothing to hold, load or move.

    Warns
    -----
    LockingWarning
        If cells of a part are likely to be more than 5 % too stiff, mostly in bending.
    DistortionWarning
        If cells are out of shape.
    UnlikelyWarning
        If a thickness or a point mass is unlikely.
    JointWarning
        If a shell meets solids at an edge only, or a beam at a node, about which it can turn, or
        solids meet each other so, but for parts that are ``pinned``; if a truss has a node that is
        not held in all directions; if cells on a curved face lack nodes of others that lie there.

    Notes
    -----
    Beams: cubic Hermite bending and linear stretching [1]_, with shear deformation and rotary
    inertia where a part is a Timoshenko beam. The error of a bending frequency falls with the
    fourth power of the element length as long as stretching does not matter, else with the
    second. Solids: displacements of first or second order, fully integrated; the error of a
    frequency falls with the second or fourth power of the cell size where the solution is smooth.

    .. [1] M. Petyt, Introduction to Finite Element Vibration Analysis, 2nd ed., Cambridge
       University Press, 2010, sections 3.2, 3.4 and 3.5.

    Examples
    --------
    The tip of a cantilever under 1 N moves by L³/(3 E I):

    >>> import fem
    >>> from scipy.sparse.linalg import spsolve
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (2, 0)}, [("arm", "root", "tip", 3)])
    >>> component = fem.assemble(fem.StructureModel(
    ...     mesh,
    ...     parts={"arm": fem.BeamPart(fem.Material(2e11, 7800.0), fem.Section(1e-3, 1e-8))},
    ...     supports=[fem.Support("root", ("x", "y", "rotation"))],
    ...     interfaces={"tip": fem.Interface("tip", "y")},
    ...     plane=True,
    ... ))
    >>> tip = component.interfaces["tip"]
    >>> bool(abs(tip @ spsolve(component.stiffness, tip) / (8 / (3 * 2e11 * 1e-8)) - 1) < 1e-12)
    True
    """
    if not isinstance(model, StructureModel):
        raise ModelError(f"assemble needs a StructureModel, not {model!r}")
    slits = check_joined(model)
    check_conforming(model)
    check_not_folded(model)
    for text in (*joint_warnings(model), *mechanism_warnings(model), *slits):
        warnings.warn(text, JointWarning, stacklevel=2)
    check_masses_carried(model)
    for text in unlikely(model):
        warnings.warn(text, UnlikelyWarning, stacklevel=2)
    for text in distortion_warnings(model):
        warnings.warn(text, DistortionWarning, stacklevel=2)
    numbering = number_blocks(model)
    constraints = constrain(model, numbering)
    interfaces = _interface_vectors(model, numbering, constraints)
    stiffness, mass = unconstrained_matrices(model, numbering)
    looked_at = boundary(model)
    check_nothing_hangs(model, looked_at)
    for text, curved in locking_warnings(model, looked_at):
        warnings.warn(text, CurvedCellsWarning if curved else LockingWarning, stacklevel=2)
    for text in overlap_warnings(model, looked_at):
        warnings.warn(text, JointWarning, stacklevel=2)
    K = constraints.reduced(stiffness)
    del stiffness
    M = constraints.reduced(mass)
    loose = loose_directions(model, numbering, constraints, K)
    if loose.any():
        text = (
            f"{model.mesh.source}: {loose.sum()} directions of nodes that nothing resists are held"
        )
        warnings.warn(text, JointWarning, stacklevel=2)
        constraints = constraints.holding(loose)
        interfaces = _interface_vectors(model, numbering, constraints)
        K, M = (sparse.csr_array(matrix[~loose][:, ~loose]) for matrix in (K, M))
    _check_nothing_empty(K, M, model, numbering, constraints)
    damping = damping_matrix(model, numbering, constraints)
    motions = rigid_motions_of(model, numbering)
    pushed = np.asarray(mass @ motions)
    inertia = np.asarray(constraints.transformation.T @ pushed[:, : 2 if model.plane else 3])
    return Component(
        K, M, interfaces, model, numbering, constraints, motions.T @ pushed, inertia, damping
    )


def _check_nothing_empty(
    K: SparseArray,
    M: SparseArray,
    model: StructureModel,
    numbering: Numbering,
    constraints: Constraints,
) -> None:
    """Refuse a direction with neither stiffness nor mass, which no solver could bear."""
    empty = np.flatnonzero((K.diagonal() == 0.0) & (M.diagonal() == 0.0))
    if not len(empty):
        return
    dofs = numbering.dofs(np.arange(len(model.mesh.points)))
    node, axis = np.argwhere(dofs == constraints.free[empty[0]])[0]
    name = next((n for n, at in model.mesh.point_sets.items() if list(at) == [node]), None)
    what = f"node {node}" if name is None else f"point {name!r}"
    raise ModelError(
        f"{model.mesh.source}: nothing is joined to the direction {AXES[axis]!r} of {what};"
        " support it or couple it in all directions"
    )


def _interface_vectors(
    model: StructureModel, numbering: Numbering, constraints: Constraints
) -> dict[str, FloatArray]:
    vectors = {}
    for name, interface in model.interfaces.items():
        dof = point_dof(model, numbering, interface.point, interface.direction)
        vector = constraints.transformation[[dof]].toarray().ravel()
        if not vector.any():
            raise ModelError(
                f"{model.mesh.source}: interface {name!r} is on direction {interface.direction!r}"
                f" of point {interface.point!r}, which a support holds"
            )
        vector.setflags(write=False)
        vectors[name] = vector
    return vectors
