"""Assembly of a plane frame of beams and trusses."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from fem.assembly.load_vectors import InertiaLoads
from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import JointWarning, ModelError
from fem.checks.unlikely import UnlikelyWarning, check_masses_carried, unlikely
from fem.elements.beams import plane_matrices, plane_rows
from fem.elements.links import link_rows, link_terms
from fem.elements.natural import (
    MatrixRows,
    NaturalForm,
    chosen_rows,
    ground_rows,
    line_rows,
    natural_form,
)
from fem.elements.scatter import SparseArray, displacement_of, squares
from fem.elements.straight_beams import rotations, turn
from fem.elements.tapers import along
from fem.elements.trusses import loose_nodes, loose_sentences
from fem.mesh.attachments import DIRECTIONS, plane_direction
from fem.mesh.pieces import check_joined
from fem.model.frame import FrameModel
from fem.model.parts import TrussPart
from fem.model.store import load_model, save_model


@dataclass(frozen=True, eq=False, repr=False)
class Component(InertiaLoads):
    """An assembled frame: N free degrees of freedom, two matrices and named interfaces.

    Parameters
    ----------
    stiffness, mass
        K in N/m (N m/rad, ...) and M in kg (kg m², ...), sparse and symmetric, shape (N, N).
    interfaces
        A vector of shape (N,) by name: a load f at the interface is `vector * f` and its
        displacement is `vector @ u`.
    model
        The frame that was assembled.
    free
        Indices of the free degrees of freedom among all, shape (N,).
    element_dofs
        Indices among all degrees of freedom of (ux, uy, rotation) at the first and the second
        end of every element, shape (e, 6). Node i has 3i, 3i + 1, 3i + 2; the own rotations of
        hinged parts follow after the nodes.
    rigid_mass
        Mass matrix (3, 3) of the rigid motions, supports apart: along x, along y, about z.
    inertia
        M r in kg of the translations r of everything, supports included, along x and y, shape
        (N, 2): the load by an acceleration of 1 m/s², such as a weight's.
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
    model: FrameModel
    free: IntArray
    element_dofs: IntArray
    rigid_mass: FloatArray
    inertia: FloatArray
    damping: SparseArray | None = None
    load_vectors: tuple[str, ...] = ()
    areas: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def natural_form(self) -> NaturalForm:
        """K = AᵀdA, which keeps digits that the entries of K have lost."""
        return frame_form(self.model, self.element_dofs, self.free)

    def shape(self, u: FloatArray) -> FloatArray:
        """Translations and rotation (ux, uy, rotation) of every node of the mesh.

        Parameters
        ----------
        u
            Displacements of the free degrees of freedom, shape (N,).

        Returns
        -------
        ndarray
            Shape (n, 3); zero where supported. At a hinge it is the rotation of the parts that
            are not hinged; `element_shape` has both.
        """
        return self._all(u)[: 3 * len(self.model.mesh.points)].reshape(-1, 3)

    def element_shape(self, u: FloatArray) -> FloatArray:
        """(ux, uy, rotation) at both ends of every element, with hinges, shape (e, 2, 3)."""
        return self._all(u)[self.element_dofs].reshape(-1, 2, 3)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the frame to an .npz file; the matrices are assembled again by `load`."""
        save_model(self.model, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Component:
        """Read and assemble a frame that `save` wrote; a `ModelError` says what is wrong."""
        return assemble_frame(load_model(path))

    def _all(self, u: FloatArray) -> FloatArray:
        u = displacement_of(self, u)
        values = np.zeros(_dof_count(self.model))
        values[self.free] = u
        return values


def assemble_frame(model: FrameModel) -> Component:
    """Assemble a plane frame; `fem.assemble` calls it."""
    slits = check_joined(model)
    for text in (*mechanism_warnings(model), *slits):
        warnings.warn(text, JointWarning, stacklevel=3)
    check_masses_carried(model)
    for text in unlikely(model):
        warnings.warn(text, UnlikelyWarning, stacklevel=3)
    element_dofs = number_dofs(model)
    free = _free_dofs(model)
    stiffness, mass = _element_matrices(model)
    springs = sparse.diags_array(_spring_diagonal(model), format="csr")
    elongations, given, damping = _link_rows(model)
    K = _scatter(stiffness, element_dofs, springs + squares(elongations, given), free)
    lumps = sparse.diags_array(_mass_diagonal(model), format="csr")
    every = _scatter(mass, element_dofs, lumps, np.arange(_dof_count(model)))
    M = sparse.csr_array(every[free][:, free])
    motions = rigid_motions(model)
    pushed = np.asarray(every @ motions)
    C = squares(elongations, damping)[free][:, free] if damping.any() else None
    vectors = _interface_vectors(model, free)
    return Component(
        K, M, vectors, model, free, element_dofs, motions.T @ pushed, pushed[free, :2], C
    )


def rigid_motions(model: FrameModel) -> FloatArray:
    """Rigid motions (n, 3) of all degrees of freedom: along x, along y, about z."""
    x, y = model.mesh.points[:, 0], model.mesh.points[:, 1]
    motions = np.zeros((_dof_count(model), 3))
    ends = 3 * np.arange(len(x))
    motions[ends, 0] = motions[ends + 1, 1] = 1.0
    motions[ends, 2], motions[ends + 1, 2] = -y, x
    motions[ends + 2, 2] = 1.0
    motions[3 * len(x) :, 2] = 1.0  # own rotations at hinges
    return motions


def mechanism_warnings(model: FrameModel) -> Iterator[str]:
    """One sentence for nodes that trusses do not hold in the plane."""
    trusses = [
        model.mesh.lines[elements]
        for name, elements in model.element_parts().items()
        if isinstance(model.parts[name], TrussPart)
    ]
    held = np.repeat(model.turning[:, None], 3, axis=1).astype(np.int64)
    ties = [(s.point, d) for s in model.supports for d in s.directions]
    ties += [(spring.point, spring.direction) for spring in model.springs]
    ties += [
        (point, plane_direction(way))
        for link in model.attached.links
        for point, way, _ in link_terms(model.mesh, link)
    ]
    for point, direction in ties:
        if direction != "rotation":
            held[model.mesh.nodes(point), DIRECTIONS.index(direction)] = 1
    yield from loose_sentences(model.mesh, loose_nodes(model.mesh.points, trusses, held, 2))


def number_dofs(model: FrameModel) -> IntArray:
    """Degrees of freedom of both ends of every element, shape (e, 6); hinges add rotations."""
    mesh = model.mesh
    dofs = (3 * mesh.lines[:, :, None] + np.arange(3)).astype(np.int64)
    for extra, hinge in enumerate(model.hinges):
        elements = mesh.part(hinge.part)
        at_point = mesh.lines[elements] == mesh.node(hinge.point)
        rotation = dofs[elements, :, 2]
        rotation[at_point] = 3 * len(mesh.points) + extra
        dofs[elements, :, 2] = rotation
    return dofs.reshape(-1, 6)


def _dof_count(model: FrameModel) -> int:
    return 3 * len(model.mesh.points) + len(model.hinges)


def _dof(model: FrameModel, point: str, direction: str) -> int:
    return 3 * model.mesh.node(point) + DIRECTIONS.index(direction)


def _free_dofs(model: FrameModel) -> IntArray:
    held = [
        3 * model.mesh.nodes(support.point) + DIRECTIONS.index(direction)
        for support in model.supports
        for direction in support.directions
    ]
    held.append(3 * np.flatnonzero(~model.turning) + 2)
    free = np.setdiff1d(np.arange(_dof_count(model)), np.concatenate(held))
    if len(free) == 0:
        raise ModelError(f"{model.mesh.source}: the supports hold every degree of freedom")
    return free


def _element_matrices(model: FrameModel) -> tuple[FloatArray, FloatArray]:
    mesh = model.mesh
    directions = mesh.spans[:, :2] / mesh.lengths[:, None]
    count = len(mesh.lines)
    stiffness, mass = np.zeros((count, 6, 6)), np.zeros((count, 6, 6))
    for name, elements in model.element_parts().items():
        what = f"{mesh.source}: part {name!r}"
        part = along(model.parts[name], mesh, mesh.lines[elements], what)
        pair = plane_matrices(part, mesh.lengths[elements], what)
        stiffness[elements], mass[elements] = pair
    return turn(stiffness, directions), turn(mass, directions)


def frame_form(model: FrameModel, element_dofs: IntArray, free: IntArray) -> NaturalForm:
    """The natural form of a frame's stiffness."""
    mesh, size = model.mesh, _dof_count(model)
    rows, stiffness = np.zeros((len(mesh.lines), 4, 4)), np.zeros((len(mesh.lines), 4))
    for name, elements in model.element_parts().items():
        what = f"{mesh.source}: part {name!r}"
        part = along(model.parts[name], mesh, mesh.lines[elements], what)
        pair = plane_rows(part, mesh.lengths[elements], what)
        rows[elements], stiffness[elements] = pair
    turn = np.tile(np.eye(4), (len(rows), 1, 1))
    turn[:, :2, :2] = rotations(mesh.spans[:, :2] / mesh.lengths[:, None])[:, :2, :2]
    parts = [line_rows(rows @ turn, stiffness, element_dofs, size, 2)]
    springs = _spring_diagonal(model)
    held = np.flatnonzero(springs)
    parts.append(ground_rows(springs[held, None, None], held[:, None], size))
    elongations, given, _ = _link_rows(model)
    if given.any():
        parts.append(MatrixRows(given, sparse.eye_array(len(given), format="csr"), elongations))
    return natural_form(parts, sparse.csr_array(chosen_rows(free, size).T))


def _spring_diagonal(model: FrameModel) -> FloatArray:
    diagonal = np.zeros(_dof_count(model))
    for spring in model.springs:
        diagonal[_dof(model, spring.point, spring.direction)] += spring.stiffness
    return diagonal


def _link_rows(model: FrameModel) -> tuple[SparseArray, FloatArray, FloatArray]:
    """Elongations (m, n) of all links, and their stiffness and damping, shape (m,)."""

    def dof(point: str, direction: str) -> int:
        return _dof(model, point, plane_direction(direction))

    return link_rows(model.mesh, model.attached.links, _dof_count(model), dof)


def _mass_diagonal(model: FrameModel) -> FloatArray:
    diagonal = np.zeros(_dof_count(model))
    for lump in model.attached.point_masses:
        about_z = float(np.broadcast_to(lump.rotary_inertia, 3)[2])
        for direction, value in zip(DIRECTIONS, (lump.mass, lump.mass, about_z), strict=True):
            diagonal[_dof(model, lump.point, direction)] += value
    return diagonal


def _scatter(
    matrices: FloatArray, element_dofs: IntArray, attached: SparseArray, free: IntArray
) -> SparseArray:
    rows = np.repeat(element_dofs, 6, axis=1).ravel()
    columns = np.tile(element_dofs, (1, 6)).ravel()
    shape = attached.shape
    full = sparse.coo_array((matrices.ravel(), (rows, columns)), shape=shape).tocsr()
    full = sparse.csr_array(full + attached)
    part = sparse.csr_array(full[free][:, free])
    part.eliminate_zeros()
    return part


def _interface_vectors(model: FrameModel, free: IntArray) -> dict[str, FloatArray]:
    vectors = {}
    for name, interface in model.interfaces.items():
        vector = (free == _dof(model, interface.point, interface.direction)).astype(np.float64)
        vector.setflags(write=False)
        vectors[name] = vector
    return vectors
