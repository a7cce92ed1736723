"""Solid cells that share a face, in the plane an edge, and on which side of it they lie."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.cell_checks import cell_at
from fem.mesh.cells import KINDS, facet_keys
from fem.model.structure import StructureModel


def shared_facets(model: StructureModel) -> Iterator[tuple[IntArray, IntArray]]:
    """Corners (p, c) of facets that two cells have, and the cells (p, 2), by the number of corners.

    The cells of all solid parts are numbered one after the other. Where three cells share a facet,
    each two of them are a pair.
    """
    first = 0
    sides: dict[int, list[tuple[IntArray, IntArray]]] = {}
    for _, kinds in model.solids.values():
        for kind, cells in kinds.items():
            for facet, nodes in KINDS[kind].facets_of(cells).items():
                corners = nodes[:, : len(KINDS[facet].corners)]
                owners = first + np.repeat(np.arange(len(cells)), len(nodes) // len(cells))
                sides.setdefault(corners.shape[1], []).append((corners, owners))
            first += len(cells)
    for blocks in sides.values():
        corners, owners = (np.concatenate(column) for column in zip(*blocks, strict=True))
        keys = facet_keys(np.sort(corners, axis=1)[:, :3])
        order = np.argsort(keys, kind="stable")
        for step in (1, 2):
            same = np.flatnonzero(keys[order][step:] == keys[order][:-step])
            one, other = order[same], order[same + step]
            yield corners[one], np.stack([owners[one], owners[other]], axis=1)


def check_not_folded(model: StructureModel) -> None:
    """Refuse solid cells that lie on the same side of the face that they share.

    Raises
    ------
    ModelError
        With how many pairs there are, and both cells of the first.

    Notes
    -----
    A cell may be numbered either way around, as long as it lies where no other one does. Where a
    node lies beyond its neighbours, a tetrahedron or a triangle is turned over, but has a volume as
    any other, and the mesh counts a part of the body twice.

    Examples
    --------
    >>> import fem
    >>> mesh = fem.StructureMesh(
    ...     [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0.3, 0.3, 0]],
    ...     {"triangle": [[0, 1, 2], [1, 2, 3]]}, {"sheet": {"triangle": [0, 1]}})
    >>> sheet = fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3), "stress", 0.01)
    >>> try:
    ...     check_not_folded(fem.StructureModel(mesh, {"sheet": sheet}))
    ... except fem.ModelError as error:
    ...     print(str(error).split("; ")[0])
    mesh: 1 pairs of cells overlap, as they lie on the same side of what they share: triangle 0 at \
(0.333333, 0.333333, 0) and triangle 1 at (0.433333, 0.433333, 0)
    """
    if not model.solids:
        return
    centres = _centres(model)
    found = [np.empty((0, 2), dtype=np.int64)]
    for corners, pairs in shared_facets(model):
        places = model.mesh.points[corners]
        away = centres[pairs] - places.mean(axis=1)[:, None]
        side = np.einsum("pki,pi->pk", away, _normals(places))
        found.append(pairs[side.prod(axis=1) > 0.0])
    overlapping = np.concatenate(found)
    if len(overlapping):
        one, other = (_told(model, int(cell)) for cell in overlapping[0])
        raise ModelError(
            f"{model.mesh.source}: {len(overlapping)} pairs of cells overlap, as they lie on the"
            f" same side of what they share: {one} and {other}; the mesh is folded there"
        )


def _centres(model: StructureModel) -> FloatArray:
    """Means of the corners of all solid cells, shape (e, 3)."""
    return np.concatenate(
        [
            model.mesh.points[cells[:, : len(KINDS[kind].corners)]].mean(axis=1)
            for _, kinds in model.solids.values()
            for kind, cells in kinds.items()
        ]
    )


def _normals(places: FloatArray) -> FloatArray:
    """Across edges in the plane, triangles and quadrilaterals (f, c, 3), of any length."""
    if places.shape[1] == 2:
        return (places[:, 1] - places[:, 0])[:, [1, 0, 2]] * [1.0, -1.0, 0.0]
    return np.cross(places[:, 2] - places[:, 0], places[:, -1] - places[:, 1])


def _told(model: StructureModel, cell: int) -> str:
    """A solid cell by its number among all of them."""
    for name in model.solids:
        for kind, at in model.mesh.part(name).items():
            if cell < len(at):
                number = int(at[cell])
                return cell_at(kind, number, model.mesh.points[model.mesh.cells[kind][number]])
            cell -= len(at)
    raise IndexError(cell)
