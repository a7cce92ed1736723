"""Assembly of the shells of a structure."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import sparse

from fem.assembly.constraints import Numbering
from fem.base.arrays import FloatArray, IntArray
from fem.elements.natural import Rows, node_rows
from fem.elements.scatter import SparseArray, block_pattern
from fem.elements.shells import (
    check_shape,
    check_sides,
    corner_normals,
    facet_batches,
    flat_cells,
    shell_matrices,
    shell_rows,
)
from fem.mesh.cells import KINDS, CellKind
from fem.model.parts import ShellPart
from fem.model.structure import StructureModel


def facet_matrices(model: StructureModel, numbering: Numbering) -> tuple[SparseArray, SparseArray]:
    """Stiffness and mass of all shells, for all degrees of freedom."""
    size = 3 * numbering.count
    pieces = list(shell_pieces(model))
    if not pieces:
        return sparse.csr_array((size, size)), sparse.csr_array((size, size))
    blocks = [numbering.blocks(nodes) for _, _, nodes, _ in pieces]
    pattern = block_pattern(blocks, numbering.count)
    stiffness, mass = (np.zeros((3, 3, len(pattern.indices))) for _ in range(2))
    for (part, kind, nodes, normals), places in zip(pieces, pattern.places, strict=True):
        for batch in facet_batches(kind, len(nodes)):
            pair = shell_matrices(part, kind, model.mesh.points, nodes[batch], normals[batch])
            at, shape = places[batch].ravel(), (len(nodes[batch]), 2 * nodes.shape[1], 3)
            for total, matrices in zip((stiffness, mass), pair, strict=True):
                each = matrices.reshape(*shape, *shape[1:])
                for i, j in np.ndindex(3, 3):
                    np.add.at(total[i, j], at, each[:, :, i, :, j].ravel())
    return pattern.matrix(stiffness), pattern.matrix(mass)


def shell_pieces(
    model: StructureModel,
) -> Iterator[tuple[ShellPart, CellKind, IntArray, FloatArray]]:
    """Part, kind, nodes (e, b) and normals at the corners (e, b, 3) of all facets of shells.

    Raises
    ------
    ModelError
        If a facet has no area or a corner that points inwards, or if neighbours of a part with
        an offset have their normals on different sides.
    """
    found = []
    for name, (part, kinds) in model.shells.items():
        for kind, nodes in kinds.items():
            what = f"{model.mesh.source}: part {name!r}"
            check_shape(KINDS[kind], flat_cells(model.mesh.points[nodes]), nodes, what)
            found.append((part, KINDS[kind], nodes))
        if part.offset:
            check_sides(list(kinds.values()), f"{model.mesh.source}: part {name!r}")
    if found:
        normals = corner_normals(model.mesh.points, [nodes for _, _, nodes in found])
        yield from ((*piece, each) for piece, each in zip(found, normals, strict=True))


def facet_rows(model: StructureModel, numbering: Numbering) -> Iterator[Rows]:
    """Rows of the natural form of all shells, in batches."""
    points = model.mesh.points
    for part, kind, nodes, normals in shell_pieces(model):
        for batch in facet_batches(kind, len(nodes)):
            rows, stiffness = shell_rows(part, kind, points, nodes[batch], normals[batch])
            dofs = numbering.dofs(nodes[batch])
            yield node_rows(rows, stiffness, dofs, 3 * numbering.count)
