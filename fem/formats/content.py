"""What a mesh file holds, before a mesh is made of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from fem.base.arrays import FloatArray, IntArray

_DIMENSIONS = {"vert": 0, "line": 1, "tria": 2, "quad": 2}  # by the beginning of a kind's name


def dimension_of(kind: str) -> int:
    """Dimension of the cells of a kind, 0 for "vertex" to 3.

    Examples
    --------
    >>> dimension_of("quad8"), dimension_of("wedge15")
    (2, 3)
    """
    return _DIMENSIONS.get(kind[:4], 3)


@dataclass
class CellBlock:
    """Cells of one kind, and the indices of their nodes, shape (e, b)."""

    type: str
    data: IntArray


class MeshLike(Protocol):
    """What is asked of a mesh, such as a `meshio.Mesh`: arrays, and blocks of cells."""

    @property
    def points(self) -> Any: ...
    @property
    def cells(self) -> Sequence[Any]: ...
    @property
    def point_data(self) -> Mapping[str, Any]: ...
    @property
    def cell_data(self) -> Mapping[str, Any]: ...
    @property
    def field_data(self) -> Mapping[str, Any]: ...
    @property
    def point_sets(self) -> Mapping[str, Any]: ...
    @property
    def cell_sets(self) -> Mapping[str, Any]: ...


@dataclass(repr=False)
class MeshContent:
    """Points, cells and names of a mesh file.

    Parameters
    ----------
    points
        Coordinates (n, d).
    cells
        Blocks of cells of one kind, nodes in VTK's order (a wedge in Gmsh's).
    point_data, cell_data
        Arrays by name: a value for each point; for each block the values of its cells.
    field_data
        By the name of a Gmsh group its number and its dimension.
    point_sets, cell_sets
        By name: indices of points; for each block the indices of its cells.
    unit
        Of the coordinates, where the file states it, else empty.
    """

    points: FloatArray
    cells: list[CellBlock]
    point_data: dict[str, Any] = field(default_factory=dict)
    cell_data: dict[str, list[Any]] = field(default_factory=dict)
    field_data: dict[str, Any] = field(default_factory=dict)
    point_sets: dict[str, IntArray] = field(default_factory=dict)
    cell_sets: dict[str, list[IntArray]] = field(default_factory=dict)
    unit: str = ""

    def __post_init__(self) -> None:
        self.points = np.asarray(self.points)

    def __repr__(self) -> str:
        cells = ", ".join(f"{len(block.data)} {block.type}" for block in self.cells)
        return f"<MeshContent: {len(self.points)} points, {cells}>"
