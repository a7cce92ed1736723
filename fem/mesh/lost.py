"""Cells of a mesh that carry something but are in no part of a model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array, csr_array

from fem.base.arrays import IntArray
from fem.base.errors import ModelError, quoted
from fem.mesh.cell_checks import cell_at
from fem.mesh.element_types import family
from fem.mesh.structure_mesh import StructureMesh

BoolArray = npt.NDArray[np.bool_]


def check_nothing_lost(mesh: StructureMesh, in_parts: Mapping[str, BoolArray]) -> None:
    """Refuse cells in no part that are not a face, an edge or a piece of one of a part's cells.

    Those name places, and carry nothing; so do the plane elements that Gmsh writes into a deck for
    the faces of solids. Other elements of a type that the file gives must be in a part.

    Parameters
    ----------
    mesh
        The mesh.
    in_parts
        By kind, which cells are in a part, shape (e,).

    Raises
    ------
    ModelError
        With their kind, their number, the number and place of the first, and their groups.
    """
    on_parts = [mesh.cells[kind][mask] for kind, mask in in_parts.items() if mask.any()]
    for kind, mask in in_parts.items():
        nodes, bare = mesh.cells[kind], np.flatnonzero(~mask)
        if not len(bare):
            continue
        typed = np.zeros(len(nodes), dtype=np.bool_)
        for name, found in mesh.element_types.items():
            if family(name) != "plane solid" and kind in found:
                typed[found[kind]] = True
        lost = bare[typed[bare] | ~_within_one(nodes[bare], on_parts, len(mesh.points))]
        if len(lost):
            groups = [n for n, g in mesh.groups.items() if np.isin(g.get(kind, []), lost).any()]
            where = f"in {quoted(groups)}" if groups else "in no group"
            first = cell_at(kind, int(lost[0]), mesh.points[nodes[lost[0]]])
            raise ModelError(
                f"{mesh.source}: {len(lost)} {kind} ({where}) are in no part of the model, the"
                f" first {first}; make them a part, or ignore their group"
            )


def _within_one(cells: IntArray, others: Sequence[IntArray], count: int) -> BoolArray:
    """Which cells (e, b) have all of their nodes in one of the others."""
    own = np.repeat(np.arange(len(cells)), cells.shape[1])
    incidence = csr_array(
        coo_array((np.ones(cells.size), (own, cells.ravel())), shape=(len(cells), count))
    )
    inside = np.zeros(len(cells), dtype=np.bool_)
    for nodes in others:
        rows = np.repeat(np.arange(len(nodes)), nodes.shape[1])
        other = csr_array(
            coo_array((np.ones(nodes.size), (nodes.ravel(), rows)), shape=(count, len(nodes)))
        )
        shared = csr_array(incidence @ other)
        highest = np.asarray(shared.max(axis=1).todense()).ravel() if shared.nnz else 0.0
        inside |= np.asarray(highest >= cells.shape[1])
    return inside
