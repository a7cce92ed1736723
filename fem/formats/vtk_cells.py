"""Cells as VTK's files have them: a list of nodes, where each cell ends, and numbers of types."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from fem.base.arrays import IntArray
from fem.base.errors import ModelError
from fem.formats.content import CellBlock, MeshContent
from fem.formats.ignored import SET_PREFIX

TYPES = {
    1: ("vertex", 1), 3: ("line", 2), 5: ("triangle", 3), 8: ("pixel", 4), 9: ("quad", 4),
    10: ("tetra", 4), 11: ("voxel", 8), 12: ("hexahedron", 8), 13: ("wedge", 6),
    14: ("pyramid", 5), 15: ("penta_prism", 10), 16: ("hexa_prism", 12), 21: ("line3", 3),
    22: ("triangle6", 6), 23: ("quad8", 8), 24: ("tetra10", 10), 25: ("hexahedron20", 20),
    26: ("wedge15", 15), 27: ("pyramid13", 13), 28: ("quad9", 9), 29: ("hexahedron27", 27),
    30: ("quad6", 6), 31: ("wedge12", 12), 32: ("wedge18", 18), 33: ("hexahedron24", 24),
    34: ("triangle7", 7), 35: ("line4", 4), 37: ("pyramid19", 19),
}  # fmt: skip
"""Kinds of cells and their numbers of nodes by VTK's numbers (vtkCellType.h)."""
OF_ANY_SIZE = {2: "poly_vertex", 4: "poly_line", 6: "triangle_strip", 7: "polygon"}
OF_ANY_SIZE |= {36: "quadratic_polygon", 41: "convex_point_set", 42: "polyhedron"}
NUMBERS = {kind: number for number, (kind, _) in TYPES.items()}
ORDERS = {"wedge": (0, 2, 1, 3, 5, 4)}
"""Where VTK has the nodes of a cell, and the other way round: a wedge is told from the inside."""

GHOSTS = {"vtkGhostType": 1 | 8 | 32, "vtkGhostLevels": 255}
"""Bits of VTK's arrays for cells of another piece, cells that others refine, and hidden ones."""


def is_needed(name: str) -> bool:
    """Whether an array of a VTK file says something of the mesh; results are passed over."""
    return name.startswith(SET_PREFIX) or name in GHOSTS or name == "gmsh:physical"


def check_each_once(names: Sequence[str], source: str) -> None:
    """Refuse two arrays of one name."""
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ModelError(f"{source}: has two arrays {twice!r}")


def content_of(
    points: np.ndarray,
    cells: tuple[IntArray, IntArray, IntArray],
    point_data: Mapping[str, np.ndarray],
    cell_data: Mapping[str, np.ndarray],
    source: str,
) -> MeshContent:
    """The mesh of a VTK file.

    Parameters
    ----------
    points
        Coordinates (n, 3).
    cells
        Nodes of all cells one after the other, where in them each cell ends (e,), and the number
        of each one's type (e,).
    point_data, cell_data
        Arrays of n and of e values or rows.
    source
        Where the mesh comes from.

    Raises
    ------
    ModelError
        For ghosts.
    ValueError
        If the numbers contradict each other.
    """
    _check_no_ghosts(cell_data, source)
    for data, count in ((point_data, len(points)), (cell_data, len(cells[2]))):
        for name, values in data.items():
            if len(values) != count:
                raise ValueError(f"its array {name!r} has {len(values)} rows, not {count}")
    rows, blocks = _blocks(*cells)
    return MeshContent(
        points,
        blocks,
        point_data=dict(point_data),
        cell_data={name: [values[a:b] for a, b in rows] for name, values in cell_data.items()},
    )


def _blocks(
    nodes: IntArray, ends: IntArray, types: IntArray
) -> tuple[list[tuple[int, int]], list[CellBlock]]:
    """Runs of cells of one type and size, and where they begin and end among all cells."""
    if len(ends) != len(types):
        raise ValueError(f"it has {len(ends)} cells, but types for {len(types)}")
    sizes = np.diff(ends, prepend=0)
    if (sizes < 0).any() or sizes.sum() != len(nodes):
        raise ValueError("its cells do not end where their nodes do")
    if not len(types):
        return [], []
    cuts = np.flatnonzero((np.diff(types) != 0) | (np.diff(sizes) != 0)) + 1
    rows = list(zip([0, *cuts.tolist()], [*cuts.tolist(), len(types)], strict=True))
    return rows, [
        _block(int(types[a]), nodes[ends[a] - sizes[a] : ends[b - 1]].reshape(b - a, sizes[a]))
        for a, b in rows
    ]


def _block(number: int, nodes: IntArray) -> CellBlock:
    if number not in TYPES:
        return CellBlock(OF_ANY_SIZE.get(number, f"VTK type {number}"), nodes)
    kind, count = TYPES[number]
    if nodes.shape[1] != count:
        raise ValueError(f"a {kind} has {nodes.shape[1]} nodes, not {count}")
    return CellBlock(kind, nodes[:, ORDERS[kind]] if kind in ORDERS else nodes)


def _check_no_ghosts(cell_data: Mapping[str, np.ndarray], source: str) -> None:
    """Refuse cells that a VTK file marks as ones that do not count."""
    for name in GHOSTS.keys() & cell_data:
        found = np.flatnonzero(np.ravel(cell_data[name]).astype(np.int64) & GHOSTS[name])
        if len(found):
            raise ModelError(
                f"{source}: its array {name!r} says that {len(found)} cells (the first is cell"
                f" {found[0]}) are hidden, refined or of another piece; save it without them"
            )
