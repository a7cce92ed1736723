"""Cells that are out of shape, found before they give wrong numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.mesh.cells import KINDS, CellKind
from fem.model.structure import StructureModel

LEAST_VOLUME = 1.0 / 30.0
"""Least volume of a cell's mapping over its greatest, below which a cell is told of."""
GREATEST_ASPECT = 30.0
"""Longest edge over the shortest, above which a cell is told of."""
GREATEST_WARP = 45.0
"""Angle in degrees between the halves of a face with four corners, above which it is told of."""
BATCH = 20_000
TINY = 1e-300  # in place of a divisor that is zero


def distortion_warnings(model: StructureModel) -> Iterator[str]:
    """A sentence for every part, kind of cell and measure by which cells are out of shape.

    Notes
    -----
    The volume of the mapping is the determinant of its derivative, at the nodes and at the places
    of integration. Where it is negative at a place of integration, the assembly refuses the cell.
    """
    for name, (_, kinds) in model.solids.items():
        for kind, nodes in kinds.items():
            own = model.mesh.part(name)[kind]
            for bad, worst, said in _measured(KINDS[kind], model.mesh.points, nodes):
                cell = model.mesh.where(kind, int(own[worst]))
                yield (
                    f"{model.mesh.source}: part {name!r} has {bad} {kind} out of {len(nodes)}"
                    f" {said}; the worst is {cell}"
                )


def _measured(
    cell: CellKind, points: FloatArray, nodes: IntArray
) -> Iterator[tuple[int, int, str]]:
    """How many cells a measure finds, the worst one, and what it says of it."""
    parts = [nodes[first : first + BATCH] for first in range(0, len(nodes), BATCH)]
    least = np.concatenate([least_volumes(cell, points[part]) for part in parts])
    if least.min() < LEAST_VOLUME:
        said = f"whose mapping has almost no volume somewhere, {least.min():.2g} of its greatest"
        yield int((least < LEAST_VOLUME).sum()), int(least.argmin()), said
    long = np.concatenate([aspects(cell, points[part]) for part in parts])
    if long.max() > GREATEST_ASPECT:
        said = f"with edges of very different length, up to {long.max():.3g} to 1"
        yield int((long > GREATEST_ASPECT).sum()), int(long.argmax()), said
    bent = np.concatenate([warps(cell, points[part]) for part in parts])
    if bent.max() > GREATEST_WARP:
        said = f"with faces that are far from flat, by up to {bent.max():.0f}° between their halves"
        yield int((bent > GREATEST_WARP).sum()), int(bent.argmax()), said


def least_volumes(cell: CellKind, coordinates: FloatArray) -> FloatArray:
    """Least volume of the mapping over its greatest, shape (e,); negative where it is folded.

    Examples
    --------
    >>> square = KINDS["quad"].nodes
    >>> least_volumes(KINDS["quad"], np.array([square, square + [[0, 0], [0, 0], [0, 0], [0, -1]]]))
    array([1., 0.])
    """
    _, reference = cell.basis(np.vstack([cell.quadrature[0], cell.nodes]))
    at = coordinates[..., : cell.dimension]
    volumes = np.linalg.det(np.einsum("ebi,qbj->eqij", at, reference, optimize=True))
    volumes = volumes * np.sign(volumes.sum(axis=1, keepdims=True))
    greatest = np.maximum(volumes.max(axis=1), np.finfo(np.float64).tiny)
    return np.asarray(volumes.min(axis=1) / greatest, dtype=np.float64)


def aspects(cell: CellKind, coordinates: FloatArray) -> FloatArray:
    """Longest edge over the shortest, shape (e,)."""
    ends = coordinates[:, np.array(cell.edges)]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    return np.asarray(length.max(axis=1) / length.min(axis=1), dtype=np.float64)


def warps(cell: CellKind, coordinates: FloatArray) -> FloatArray:
    """Greatest angle in degrees between the two halves of a face, over both cuts, shape (e,)."""
    found = np.zeros(len(coordinates))
    for face in cell.shape.faces:
        if len(face) == 4 and cell.dimension == 3:
            corners = coordinates[:, list(face)]
            for one, other in (((0, 1, 2), (0, 2, 3)), ((1, 2, 3), (1, 3, 0))):
                found = np.maximum(found, _angle(corners[:, list(one)], corners[:, list(other)]))
    return found


def _angle(one: FloatArray, other: FloatArray) -> FloatArray:
    normals = [np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]) for t in (one, other)]
    length = np.linalg.norm(normals[0], axis=1) * np.linalg.norm(normals[1], axis=1)
    cosine = np.sum(normals[0] * normals[1], axis=1) / np.maximum(length, TINY)
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))), dtype=np.float64)
