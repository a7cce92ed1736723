"""How much too high a mesh makes frequencies, estimated from its own modes."""

from __future__ import annotations

import numpy as np

from fem.assembly.shell_errors import shell_errors, smooth_corners
from fem.assembly.shells import shell_pieces
from fem.assembly.solid_errors import solid_errors
from fem.base.arrays import FloatArray, IntArray
from fem.mesh.cells import CellKind
from fem.model.parts import ShellPart
from fem.model.structure import SolidCells, StructureModel


def energy_and_mass_off(model: StructureModel, shapes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Twice the energy too much and the mass too little, (m,) each, in shapes (m, n, 6).

    Beams and trusses have none here, nor have shells with a section of their own.
    """
    stiffer, lighter = np.zeros((2, len(shapes)))
    pieces: dict[str, list[SolidCells]] = {}
    for piece in model.solid_cells:
        pieces.setdefault(piece.name, []).append(piece)
    for solids in pieces.values():
        stiffer += solid_errors(model.mesh, solids, shapes)
    shells = list(shell_pieces(model))
    corners = smooth_corners(model.mesh.points, [nodes for _, _, nodes, _ in shells])
    facets: dict[int, tuple[ShellPart, list[tuple[CellKind, IntArray, FloatArray, IntArray]]]] = {}
    for (part, kind, nodes, normals), own in zip(shells, corners, strict=True):
        if part.section is None:
            facets.setdefault(id(part), (part, []))[1].append((kind, nodes, normals, own))
    for part, blocks in facets.values():
        energy, mass = shell_errors(model.mesh.points, part, blocks, shapes)
        stiffer += energy
        lighter += mass
    return stiffer, lighter
