"""Assembly of the solids of a structure."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from fem.assembly.constraints import Numbering
from fem.base.arrays import FloatArray
from fem.elements.natural import Rows, node_rows, solid_rows
from fem.elements.reduced import hourglass_rows
from fem.elements.scatter import SparseArray, block_pattern
from fem.elements.solids import (
    checked_volumes,
    gradients_and_volumes,
    mapped_volumes,
    mass_matrices,
    stiffness_matrices,
)
from fem.mesh.structure_mesh import StructureMesh
from fem.model.structure import SolidCells, StructureModel

BATCH_BYTES = 1e8
"""Size of the element matrices that are made at a time."""


def solid_matrices(model: StructureModel, numbering: Numbering) -> tuple[SparseArray, SparseArray]:
    """Stiffness and mass of all solids, for all degrees of freedom."""
    size = 3 * numbering.count
    pieces = model.solid_cells
    if not pieces:
        return sparse.csr_array((size, size)), sparse.csr_array((size, size))
    pattern = block_pattern([numbering.translation[p.nodes] for p in pieces], numbering.count)
    stiffness = np.zeros((3, 3, len(pattern.indices)))
    mass = np.zeros(len(pattern.indices))
    for piece, places in zip(pieces, pattern.places, strict=True):
        for batch in _batches(piece):
            K, M = cell_matrices(piece, model.mesh, batch)
            at = places[batch].ravel()
            for i, j in np.ndindex(piece.kind.dimension, piece.kind.dimension):
                np.add.at(stiffness[i, j], at, K[:, :, i, :, j].ravel())
            np.add.at(mass, at, M.ravel())
    return pattern.matrix(stiffness), pattern.same_in_all_directions(mass)


def cell_rows(model: StructureModel, numbering: Numbering) -> Iterator[Rows]:
    """Rows of the natural form of all solids, in batches."""
    size = 3 * numbering.count
    for piece in model.solid_cells:
        for batch in _batches(piece):
            gradients, weights = weighted_gradients(piece, model.mesh, batch)
            dofs = 3 * numbering.translation[piece.nodes[batch]][..., None] + np.arange(3)
            in_cell = dofs[..., : piece.kind.dimension]
            yield solid_rows(gradients, weights, in_cell, size, piece.part.lame)
            if piece.reduced:
                rows, stiffness = unseen_rows(piece, model.mesh, batch)
                flat = np.zeros((*rows.shape[:3], 3))
                flat[..., : piece.kind.dimension] = rows
                yield node_rows(flat.reshape(*stiffness.shape, -1), stiffness, dofs, size)


def _batches(piece: SolidCells) -> Iterator[slice]:
    kind, count = piece.kind, len(piece.nodes)
    values = (kind.node_count * kind.dimension) ** 2 + 9 * len(kind.quadrature[1]) * kind.node_count
    step = max(int(BATCH_BYTES / (8 * values)), 1)
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))


def cell_matrices(
    piece: SolidCells, mesh: StructureMesh, batch: slice
) -> tuple[FloatArray, FloatArray]:
    """Stiffness (e, b, d, b, d) and mass for one direction (e, b, b) of some cells of a piece.

    Examples
    --------
    >>> from fem.mesh.structure_mesh import box_mesh
    >>> from fem.model.parts import Material, SolidPart
    >>> cube = box_mesh("cube", (1.0, 1.0, 1.0), (1, 1, 1), kind="hexahedron")
    >>> model = StructureModel(cube, {"cube": SolidPart(Material(1.0, 1.0, 0.0))})
    >>> K, M = cell_matrices(model.solid_cells[0], cube, slice(None))
    >>> K.shape, round(float(M.sum()), 12)
    ((1, 8, 3, 8, 3), 1.0)
    """
    gradients, weighted = weighted_gradients(piece, mesh, batch)
    K = stiffness_matrices(gradients, weighted, piece.part.lame)
    if piece.reduced:
        rows, stiffness = unseen_rows(piece, mesh, batch)
        K += np.einsum("er,erai,erbj->eaibj", stiffness, rows, rows, optimize=True)
    return K, mass_matrices(piece.kind, volumes(piece, mesh, batch), piece.part.material.density)


def weighted_gradients(
    piece: SolidCells, mesh: StructureMesh, batch: slice
) -> tuple[FloatArray, FloatArray]:
    """Gradients (e, q, b, d) at the places of the stiffness and the volumes (e, q) there."""
    kind = piece.kind
    places, weights = kind.reduced_quadrature if piece.reduced else kind.quadrature
    coordinates = mesh.points[piece.nodes[batch]][..., : kind.dimension]
    gradients, volumes = gradients_and_volumes(kind, coordinates, places)
    return gradients, _checked(piece, mesh, batch, volumes) * weights


def volumes(piece: SolidCells, mesh: StructureMesh, batch: slice) -> FloatArray:
    """The volumes (e, q) at all places, those of the mass."""
    places, weights = piece.kind.quadrature
    coordinates = mesh.points[piece.nodes[batch]][..., : piece.kind.dimension]
    return _checked(piece, mesh, batch, mapped_volumes(piece.kind, coordinates, places)) * weights


def _checked(
    piece: SolidCells, mesh: StructureMesh, batch: slice, volumes: FloatArray
) -> FloatArray:
    """Volumes (e, q), times the thickness of a plane part, of cells that are not folded."""
    what = f"{mesh.source}: part {piece.name!r}: {piece.kind.name}"
    coordinates = mesh.points[piece.nodes[batch]]
    found = checked_volumes(volumes, coordinates, what, piece.numbers[batch])
    return found * (piece.part.thickness or 1.0)


def unseen_rows(
    piece: SolidCells, mesh: StructureMesh, batch: slice
) -> tuple[FloatArray, FloatArray]:
    """Motions (e, r, b, d) that strain no place of reduced integration, and their stiffness."""
    coordinates = mesh.points[piece.nodes[batch]][..., : piece.kind.dimension]
    rows, stiffness = hourglass_rows(piece.kind, coordinates, piece.part.lame[1])
    return rows, stiffness * (piece.part.thickness or 1.0)
