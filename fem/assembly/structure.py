"""Assembly of structures of solids, shells and beams."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy import sparse

from fem.assembly.constraints import (
    Constraints,
    Numbering,
    constrain,
    facet_products,
    number_blocks,
    point_dof,
    rigid_motions,
)
from fem.assembly.load_vectors import InertiaLoads
from fem.assembly.loose import loose_directions
from fem.assembly.shells import facet_matrices, facet_rows
from fem.assembly.solids import cell_rows, solid_matrices
from fem.assembly.trusses import truss_form, truss_matrices
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
from fem.elements.beams import (
    cross_matrix,
    element_matrices,
    element_rows,
    hermite,
    local_axes,
    run,
    to_nodes,
)
from fem.elements.links import link_rows
from fem.elements.natural import (
    MatrixRows,
    NaturalForm,
    Rows,
    ground_rows,
    line_rows,
    natural_form,
)
from fem.elements.scatter import (
    SparseArray,
    added,
    dense_scatter,
    displacement_of,
    squares,
)
from fem.elements.tapers import along
from fem.mesh.attachments import PointMass
from fem.mesh.pieces import check_joined
from fem.model.parts import BeamPart
from fem.model.store import load_structure, save_structure
from fem.model.structure import AXES, StructureModel


class LockingWarning(UserWarning):
    """Cells that are likely to be too stiff in bending on this mesh, and by how much.

    Without a warning, though below 0.9 of the deflection, are

    - hexahedra on flat plates that are loaded at a point (in full 0.37 to 0.82, reduced 0.84), and
      in full on clamped ones (0.85);
    - tetrahedra of second order in a single row that is twisted (0.895);
    - shells of triangles in a single row that is twisted (0.70 to 0.88), that are parallelograms
      bent in their plane (0.74), and much longer than wide below a force (0.75 to 0.86).

    The numbers are those of ``docs/results/elements.md``.
    """


class DistortionWarning(UserWarning):
    """Cells that are out of shape: their part may be too stiff, and its stresses wrong there."""


@dataclass(frozen=True, eq=False, repr=False)
class StructureComponent(InertiaLoads):
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
        M r in kg of the translations r of everything, supports included, along x, y and z, shape
        (N, 3): the load by an acceleration of 1 m/s², such as a weight's.
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

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the structure to an .npz file; the matrices are assembled again by `load`."""
        save_structure(self.model, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> StructureComponent:
        """Read and assemble what `save` wrote; a `ModelError` says what is wrong."""
        return assemble_structure(load_structure(path))

    def all_values(self, u: FloatArray) -> FloatArray:
        """All degrees of freedom, also held and coupled ones, from the free ones (N,)."""
        u = displacement_of(self, u)
        return np.asarray(self.constraints.transformation @ u, dtype=np.float64)


def assemble_structure(model: StructureModel) -> StructureComponent:
    """Assemble stiffness and consistent mass of a structure; `fem.assemble` calls it.

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
    """
    slits = check_joined(model)
    check_conforming(model)
    check_not_folded(model)
    for text in (*joint_warnings(model), *mechanism_warnings(model), *slits):
        warnings.warn(text, JointWarning, stacklevel=3)
    check_masses_carried(model)
    for text in unlikely(model):
        warnings.warn(text, UnlikelyWarning, stacklevel=3)
    for text in distortion_warnings(model):
        warnings.warn(text, DistortionWarning, stacklevel=3)
    numbering = number_blocks(model)
    constraints = constrain(model, numbering)
    stiffness, mass = unconstrained_matrices(model, numbering)
    looked_at = boundary(model)
    check_nothing_hangs(model, looked_at)
    for text in locking_warnings(model, looked_at):
        warnings.warn(text, LockingWarning, stacklevel=3)
    for text in overlap_warnings(model, looked_at):
        warnings.warn(text, JointWarning, stacklevel=3)
    K = constraints.reduced(stiffness)
    del stiffness
    M = constraints.reduced(mass)
    loose = loose_directions(model, numbering, constraints, K)
    if loose.any():
        text = (
            f"{model.mesh.source}: {loose.sum()} directions of nodes that nothing resists are held"
        )
        warnings.warn(text, JointWarning, stacklevel=3)
        constraints = constraints.holding(loose)
        K, M = (sparse.csr_array(matrix[~loose][:, ~loose]) for matrix in (K, M))
    _check_nothing_empty(K, M, model, numbering, constraints)
    interfaces = _interface_vectors(model, numbering, constraints)
    damping = _damping(model, numbering, constraints)
    motions = rigid_motions_of(model, numbering)
    pushed = np.asarray(mass @ motions)
    inertia = np.asarray(constraints.transformation.T @ pushed[:, :3])
    return StructureComponent(
        K, M, interfaces, model, numbering, constraints, motions.T @ pushed, inertia, damping
    )


def unconstrained_matrices(
    model: StructureModel, numbering: Numbering
) -> tuple[SparseArray, SparseArray]:
    """Stiffness and mass for all degrees of freedom, as if nothing were held or coupled."""
    stiffness, mass = solid_matrices(model, numbering)
    for others in (facet_matrices, truss_matrices, attached_matrices):
        more = others(model, numbering)
        stiffness, mass = added(stiffness, more[0]), added(mass, more[1])
    return stiffness, mass


def rigid_motions_of(model: StructureModel, numbering: Numbering) -> FloatArray:
    """Rigid motions (n, 6) of all degrees of freedom that have a place, along and about x, y, z."""
    axes = np.arange(3)
    motions = np.zeros((3 * numbering.count, 6))
    moving, turning = numbering.translation >= 0, numbering.rotation >= 0
    for name in model.attached.placeless:
        moving[model.mesh.nodes(name)] = False
    blocks = numbering.translation[moving]
    motions[3 * blocks[:, None] + axes] = rigid_motions(model.mesh.points[moving])
    turns = np.concatenate([numbering.rotation[turning], numbering.hinged])
    motions[3 * turns[:, None] + axes, 3 + axes] = 1.0
    return motions


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


def attached_rows(model: StructureModel, numbering: Numbering) -> Iterator[Rows]:
    """Rows of the natural form of beams, springs and foundations."""
    size = 3 * numbering.count
    for name, (part, lines) in model.beams.items():
        spans = model.mesh.points[lines[:, 1]] - model.mesh.points[lines[:, 0]]
        what = f"{model.mesh.source}: part {name!r}"
        rows, stiffness = element_rows(along(part, model.mesh, lines, what), spans, what)
        yield line_rows(rows, stiffness, beam_dofs(model, numbering, name), size, 3)
    elongations, given, _ = _link_rows(model, numbering)
    if given.any():
        yield MatrixRows(given, sparse.eye_array(len(given), format="csr"), elongations)
    springs = *_springs(model, numbering), *_matrices(model, numbering, "stiffness")
    for matrices, dofs in (*_foundations(model, numbering), *springs):
        yield ground_rows(matrices, dofs, size)


def attached_matrices(
    model: StructureModel, numbering: Numbering
) -> tuple[SparseArray, SparseArray]:
    """Stiffness and mass of beams, springs, foundations and lumped masses."""
    size = 3 * numbering.count
    stiffness, mass = sparse.csr_array((size, size)), sparse.csr_array((size, size))
    for name, (part, lines) in model.beams.items():
        points = model.mesh.points
        spans = points[lines[:, 1]] - points[lines[:, 0]]
        what = f"{model.mesh.source}: part {name!r}"
        K, M = element_matrices(along(part, model.mesh, lines, what), spans, what)
        dofs = beam_dofs(model, numbering, name)
        stiffness = added(stiffness, dense_scatter(K, dofs, size))
        mass = added(mass, dense_scatter(M, dofs, size))
    elongations, given, _ = _link_rows(model, numbering)
    stiffness = added(stiffness, squares(elongations, given))
    springs = *_springs(model, numbering), *_matrices(model, numbering, "stiffness")
    for matrices, dofs in (*_foundations(model, numbering), *springs):
        stiffness = added(stiffness, dense_scatter(matrices, dofs, size))
    for matrices, dofs in _matrices(model, numbering, "mass"):
        mass = added(mass, dense_scatter(matrices, dofs, size))
    for lump in model.attached.point_masses:
        matrix, dofs = _lumped(model, numbering, lump)
        mass = added(mass, dense_scatter(matrix, dofs, size))
    return stiffness, mass


def beam_dofs(model: StructureModel, numbering: Numbering, name: str) -> IntArray:
    """Degrees of freedom (e, 12) of the lines of a beam part; hinges have their own rotations."""
    lines = model.beams[name][1]
    dofs = numbering.dofs(lines)
    for hinge, block in zip(model.hinges, numbering.hinged, strict=True):
        if hinge.part == name:
            dofs[lines == model.mesh.node(hinge.point), 3:] = 3 * block + np.arange(3)
    return np.asarray(dofs.reshape(-1, 12), dtype=np.int64)


def _springs(model: StructureModel, numbering: Numbering) -> Iterator[tuple[FloatArray, IntArray]]:
    for spring in model.springs:
        dof = point_dof(model, numbering, spring.point, spring.direction)
        yield np.array([[[spring.stiffness]]]), np.array([[dof]])


def _matrices(
    model: StructureModel, numbering: Numbering, kind: str
) -> Iterator[tuple[FloatArray, IntArray]]:
    """The matrices of one kind between directions of points, (1, k, k) and (1, k)."""
    for matrix in model.attached.matrices:
        rows = getattr(matrix, kind)
        if rows:
            dofs = [point_dof(model, numbering, point, way) for point, way in matrix.terms]
            yield np.array([rows]), np.array([dofs])


def _link_rows(
    model: StructureModel, numbering: Numbering
) -> tuple[SparseArray, FloatArray, FloatArray]:
    """Elongations (m, n) of all links, and their stiffness and damping, shape (m,)."""
    at = partial(point_dof, model, numbering)
    return link_rows(model.mesh, model.attached.links, 3 * numbering.count, at)


def _damping(
    model: StructureModel, numbering: Numbering, constraints: Constraints
) -> SparseArray | None:
    """Damping matrix of the links and of matrices, if one has any."""
    elongations, _, damping = _link_rows(model, numbering)
    found = squares(elongations, damping)
    for matrices, dofs in _matrices(model, numbering, "damping"):
        found = added(found, dense_scatter(matrices, dofs, 3 * numbering.count))
    return constraints.reduced(found) if found.count_nonzero() else None


def _lumped(
    model: StructureModel, numbering: Numbering, lump: PointMass
) -> tuple[FloatArray, IntArray]:
    """Mass matrix of a rigid body at a point, with its centre at the offset, (1, k, k)."""
    node = model.mesh.node(lump.point)
    inertia = np.broadcast_to(np.asarray(lump.rotary_inertia, dtype=np.float64), (3,))
    if not inertia.any() and not any(lump.offset):
        directions = ("x", "y") if model.is_plane else ("x", "y", "z")
        dofs = [point_dof(model, numbering, lump.point, name) for name in directions]
        return lump.mass * np.eye(len(dofs))[None], np.array([dofs])
    point_dof(model, numbering, lump.point, "rotation_z")
    # the centre moves by u + r x c = u - [c]x r
    to_centre = np.hstack([np.eye(3), -cross_matrix(np.asarray(lump.offset))])
    M = lump.mass * to_centre.T @ to_centre
    M[3:, 3:] += np.diag(inertia)
    return M[None], numbering.dofs(np.array([node]))


def _foundations(
    model: StructureModel, numbering: Numbering
) -> Iterator[tuple[FloatArray, IntArray]]:
    for foundation in model.foundations:
        found = [
            *_facet_foundation(model, numbering, foundation.face, foundation.stiffness),
            *_beam_foundation(model, numbering, foundation.face, foundation.stiffness),
        ]
        if not found:
            raise ModelError(
                f"{model.mesh.source}: foundation of {foundation.face!r}: there is no outer face,"
                " edge or beam whose nodes are all in it"
            )
        yield from found


def _facet_foundation(
    model: StructureModel, numbering: Numbering, face: str, stiffness: Sequence[float]
) -> Iterator[tuple[FloatArray, IntArray]]:
    for kind, cells in model.facets_on(face).items():
        products = facet_products(kind, model.mesh.points[cells])
        for axis in range(2 if model.is_plane else 3):
            if stiffness[axis]:
                yield stiffness[axis] * products, 3 * numbering.translation[cells] + axis


def _beam_foundation(
    model: StructureModel, numbering: Numbering, face: str, stiffness: Sequence[float]
) -> Iterator[tuple[FloatArray, IntArray]]:
    inside = np.zeros(len(model.mesh.points), dtype=np.bool_)
    inside[model.mesh.nodes(face)] = True
    for name, (part, lines) in model.beams.items():
        on = inside[lines].all(axis=1)
        if on.any():
            ends = model.mesh.points[lines[on]]
            what = f"{model.mesh.source}: part {name!r}"
            spans = ends[:, 1] - ends[:, 0]
            lengths, N, _ = beam_motions(part, spans, what, BEAM_PLACES)
            weights = BEAM_WEIGHTS[None, :] * lengths[:, None]
            K = np.einsum("eq,eqia,i,eqib->eab", weights, N, stiffness, N, optimize=True)
            yield K, beam_dofs(model, numbering, name)[on]


BEAM_PLACES, BEAM_WEIGHTS = (
    (np.polynomial.legendre.leggauss(4)[0] + 1.0) / 2.0,
    np.polynomial.legendre.leggauss(4)[1] / 2.0,
)


def beam_motions(
    part: BeamPart, spans: FloatArray, what: str, places: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lengths (e,) of beams, and translations and rotations of their axes, each (e, q, 3, 12).

    At places (q,) from 0 to 1 along lines with spans (e, 3) between their nodes, by the
    translations and rotations of these; in x, y and z.
    """
    axes = local_axes(part, spans, what)
    lengths = np.linalg.norm(run(part, spans, what), axis=1)
    ends = to_nodes(part, axes)
    moves, turns = (
        np.einsum("eji,eqjk,ekl->eqil", axes, shapes, ends, optimize=True)
        for shapes in beam_shapes(lengths, places)
    )
    return lengths, moves, turns


def beam_shapes(lengths: FloatArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Displacement (u, v, w) and rotation from the twelve local numbers, each (e, q, 3, 12).

    Hermite's cubics, also for Timoshenko beams, whose own differ by their shear strain.
    """
    N = np.zeros((len(lengths), len(s), 3, 12))
    turns = np.zeros_like(N)
    N[:, :, 0, 0], N[:, :, 0, 6] = 1 - s, s
    turns[:, :, 0, 3], turns[:, :, 0, 9] = 1 - s, s
    cubic, slopes = hermite(s)
    L = lengths[:, None]
    for row, dofs, sign in ((1, (1, 5, 7, 11), 1.0), (2, (2, 4, 8, 10), -1.0)):
        for k, dof in enumerate(dofs):
            scale = sign * L if k % 2 else 1.0
            N[:, :, row, dof] = scale * cubic[k]
            turns[:, :, 3 - row, dof] = sign * scale * slopes[k] / L
    return N, turns


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
