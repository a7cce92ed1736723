"""Matrices of a structure before it is held: of its parts, and of what is attached to it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
from scipy import sparse

from fem.assembly.constraints import (
    Constraints,
    Numbering,
    facet_products,
    point_dof,
    rigid_motions,
)
from fem.assembly.shells import facet_matrices
from fem.assembly.solids import solid_matrices
from fem.assembly.trusses import truss_matrices
from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.elements.beams import (
    cross_matrix,
    element_matrices,
    element_rows,
    local_axes,
    run,
    to_nodes,
)
from fem.elements.links import link_rows
from fem.elements.natural import (
    MatrixRows,
    Rows,
    ground_rows,
    line_rows,
)
from fem.elements.scatter import (
    SparseArray,
    added,
    dense_scatter,
    squares,
)
from fem.elements.straight_beams import hermite
from fem.elements.tapers import along
from fem.mesh.attachments import PointMass
from fem.model.parts import BeamPart
from fem.model.structure import StructureModel


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


def attached_rows(model: StructureModel, numbering: Numbering) -> Iterator[Rows]:
    """Rows of the natural form of beams, springs and foundations."""
    size = 3 * numbering.count
    for name, part, spans, what in _beams(model):
        rows, stiffness = element_rows(part, spans, what, model.plane)
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
    stiffness, mass = [], []
    for name, part, spans, what in _beams(model):
        K, M = element_matrices(part, spans, what, model.plane)
        dofs = beam_dofs(model, numbering, name)
        stiffness.append((K, dofs))
        mass.append((M, dofs))
    stiffness += [*_foundations(model, numbering), *_springs(model, numbering)]
    stiffness += _matrices(model, numbering, "stiffness")
    mass += _matrices(model, numbering, "mass")
    mass += [_lumped(model, numbering, lump) for lump in model.attached.point_masses]
    elongations, given, _ = _link_rows(model, numbering)
    linked = squares(elongations, given)
    return added(dense_scatter(stiffness, size), linked), dense_scatter(mass, size)


def _beams(model: StructureModel) -> Iterator[tuple[str, BeamPart, FloatArray, str]]:
    """Names of beams, their parts along their lines, the spans (e, 3) of these, and what to say."""
    for name, (part, lines) in model.beams.items():
        what = f"{model.mesh.source}: part {name!r}"
        yield name, along(part, model.mesh, lines, what), _spans(model, lines), what


def _spans(model: StructureModel, lines: IntArray) -> FloatArray:
    return np.asarray(model.mesh.points[lines[:, 1]] - model.mesh.points[lines[:, 0]])


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


def damping_matrix(
    model: StructureModel, numbering: Numbering, constraints: Constraints
) -> SparseArray | None:
    """Damping matrix of the links and of matrices, if one has any."""
    elongations, _, damping = _link_rows(model, numbering)
    given = dense_scatter(_matrices(model, numbering, "damping"), 3 * numbering.count)
    found = added(given, squares(elongations, damping))
    return constraints.reduced(found) if found.count_nonzero() else None


def _lumped(
    model: StructureModel, numbering: Numbering, lump: PointMass
) -> tuple[FloatArray, IntArray]:
    """Mass matrix of a rigid body at a point, with its centre at the offset, (1, k, k)."""
    node = model.mesh.node(lump.point)
    inertia = np.broadcast_to(np.asarray(lump.rotary_inertia, dtype=np.float64), (3,))
    if not inertia.any() and not any(lump.offset):
        directions = ("x", "y") if model.plane else ("x", "y", "z")
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
        for axis in range(2 if model.plane else 3):
            if stiffness[axis]:
                yield stiffness[axis] * products, 3 * numbering.translation[cells] + axis


def _beam_foundation(
    model: StructureModel, numbering: Numbering, face: str, stiffness: Sequence[float]
) -> Iterator[tuple[FloatArray, IntArray]]:
    places, shares = gauss(4)
    for name, on in model.beams_on(face).items():
        lengths, N, _ = beam_motions(model, name, on, places)
        weights = shares[None, :] * lengths[:, None]
        K = np.einsum("eq,eqia,i,eqib->eab", weights, N, stiffness, N, optimize=True)
        yield K, beam_dofs(model, numbering, name)[on]


def gauss(points: int) -> tuple[FloatArray, FloatArray]:
    """Gauss's places on [0, 1] and their weights."""
    places, weights = np.polynomial.legendre.leggauss(points)
    return (places + 1.0) / 2.0, weights / 2.0


def beam_motions(
    model: StructureModel, name: str, numbers: IntArray, places: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lengths (e,) of lines of a beam, and translations and rotations of their axes (e, q, 3, 12).

    At places (q,), or (e, q), from 0 to 1 along the lines of these numbers (e,), by the
    translations and rotations of their nodes; in x, y and z.
    """
    part, lines = model.beams[name]
    spans = _spans(model, lines[numbers])
    what = f"{model.mesh.source}: part {name!r}"
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
    N = np.zeros((len(lengths), s.shape[-1], 3, 12))
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
