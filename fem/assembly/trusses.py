"""Assembly of the trusses of a structure."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.assembly.constraints import Numbering
from fem.base.arrays import IntArray
from fem.elements.natural import Rows, node_rows
from fem.elements.scatter import SparseArray, dense_scatter
from fem.elements.trusses import truss_mass, truss_rows
from fem.mesh.cells import KINDS, CellKind
from fem.model.parts import TrussPart
from fem.model.structure import StructureModel


def truss_pieces(model: StructureModel) -> Iterator[tuple[TrussPart, CellKind, IntArray, str]]:
    """Part, kind, nodes (e, b) and name for errors of all trusses."""
    for name, (part, kinds) in model.trusses.items():
        for kind, nodes in kinds.items():
            yield part, KINDS[kind], nodes, f"{model.mesh.source}: part {name!r}"


def truss_matrices(model: StructureModel, numbering: Numbering) -> tuple[SparseArray, SparseArray]:
    """Stiffness and mass of all trusses, for all degrees of freedom."""
    size = 3 * numbering.count
    stiffness, mass = [], []
    for part, kind, nodes, what in truss_pieces(model):
        coordinates = model.mesh.points[nodes]
        rows, weights = truss_rows(part, kind, coordinates, what)
        flat = rows.reshape(*weights.shape, -1)
        K = (flat * weights[..., None]).transpose(0, 2, 1) @ flat
        M = truss_mass(part, kind, coordinates, what)
        M = np.einsum("eab,ij->eaibj", M, np.eye(3)).reshape(K.shape)
        dofs = numbering.dofs(nodes)[..., :3].reshape(len(nodes), -1)
        stiffness.append((K, dofs))
        mass.append((M, dofs))
    return dense_scatter(stiffness, size), dense_scatter(mass, size)


def truss_form(model: StructureModel, numbering: Numbering) -> Iterator[Rows]:
    """Rows of the natural form of all trusses."""
    for part, kind, nodes, what in truss_pieces(model):
        rows, stiffness = truss_rows(part, kind, model.mesh.points[nodes], what)
        dofs = numbering.dofs(nodes)[..., :3]
        yield node_rows(rows.reshape(*stiffness.shape, -1), stiffness, dofs, 3 * numbering.count)
