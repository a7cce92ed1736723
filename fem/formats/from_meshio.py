"""Meshes from those of files and of meshio."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError, quoted
from fem.formats.collapsed import uncollapsed
from fem.formats.content import MeshLike, dimension_of
from fem.formats.ignored import SET_PREFIX, TYPE_PREFIX
from fem.mesh.cells import KINDS
from fem.mesh.structure_mesh import StructureMesh

Named = TypeVar("Named")
FARTHEST = 1e50


def from_meshio(content: MeshLike, source: str = "meshio mesh") -> StructureMesh:
    """Take cells, groups and points of all kinds out of a `meshio.Mesh`.

    The conventions are those of `read_mesh`.

    Examples
    --------
    >>> import meshio
    >>> content = meshio.Mesh(
    ...     [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [("triangle", [[0, 1, 2]])],
    ...     cell_data={"set:sheet": [[1]]},
    ... )
    >>> from_meshio(content).part("sheet")
    {'triangle': array([0])}
    """
    points = _three_coordinates(content, source)
    _check_kinds(
        content,
        {*KINDS, "vertex"},
        source,
        f"known are {quoted(KINDS)}; or ignore these by their names",
    )
    cells: dict[str, list[IntArray]] = {}
    groups: dict[str, dict[str, list[IntArray]]] = {}
    for index, block in enumerate(content.cells):
        if block.type == "vertex" or not len(block.data):
            continue
        blocks = cells.setdefault(block.type, [])
        first = sum(len(data) for data in blocks)
        for name, found in _groups(content, index, KINDS[block.type].dimension, source):
            groups.setdefault(name, {}).setdefault(block.type, []).append(found + first)
        blocks.append(np.asarray(block.data, dtype=np.int64))
    if not cells:
        vertices = sum(len(block.data) for block in content.cells)
        raise ModelError(
            f"{source}: the mesh has no cells (it has {len(points)} nodes and {vertices} vertices)"
        )
    _check_far(points, source)
    nodes_of = {kind: np.concatenate(blocks) for kind, blocks in cells.items()}
    for kind, nodes in nodes_of.items():
        _check_nodes(kind, nodes, len(points), source)
    whole, named, notes = uncollapsed(
        points,
        nodes_of,
        {
            name: {kind: np.concatenate(found) for kind, found in group.items()}
            for name, group in groups.items()
            if any(len(cells) for found in group.values() for cells in found)
        },
        source,
    )
    sets = _point_sets(content, source)
    sets = {name: nodes for name, nodes in sets.items() if len(nodes) or name not in named}
    return StructureMesh(
        points, whole, _names(named), sets, source, notes=notes, element_types=_types(named)
    )


def _check_kinds(content: MeshLike, taken: set[str], source: str, advice: str) -> None:
    """Refuse cells that would be left out, by their kinds, blocks and groups."""
    found: dict[str, list[int]] = {}
    for index, block in enumerate(content.cells):
        if block.type not in taken and len(block.data):
            found.setdefault(block.type, []).append(index)
    if not found:
        return
    told = []
    for kind, blocks in found.items():
        count = sum(len(content.cells[index].data) for index in blocks)
        dimension = dimension_of(kind)
        names = {n for i in blocks for n, at in _groups(content, i, dimension, source) if len(at)}
        group = f"in {quoted(sorted(names))}" if names else "in no group"
        number = ", ".join(map(str, blocks[:5])) + (", ..." if len(blocks) > 5 else "")
        told.append(f"{count} {kind} ({group}; block {number} of the file, counted from 0)")
    raise ModelError(f"{source}: the mesh has cells that are not read: {'; '.join(told)}; {advice}")


def _names(groups: Mapping[str, Named]) -> dict[str, Named]:
    """The groups that a file names."""
    return {name: found for name, found in groups.items() if not name.startswith(TYPE_PREFIX)}


def _types(groups: Mapping[str, Named]) -> dict[str, Named]:
    """The groups that hold the elements of one type, by the name of the type."""
    return {
        name.removeprefix(TYPE_PREFIX): found
        for name, found in groups.items()
        if name.startswith(TYPE_PREFIX)
    }


def _check_far(points: FloatArray, source: str) -> None:
    bad = np.flatnonzero(~(np.abs(points) < FARTHEST).all(axis=1))
    if len(bad):
        raise ModelError(
            f"{source}: the coordinates of node {bad[0]} (counted from 0) are not finite numbers"
            f" below {FARTHEST:g} m"
        )


def _check_nodes(what: str, nodes: IntArray, count: int, source: str) -> None:
    """Refuse nodes that are not there, which numpy would count from the end."""
    if not len(nodes):
        return
    bad = np.flatnonzero(((nodes < 0) | (nodes >= count)).reshape(len(nodes), -1).any(axis=1))
    if len(bad):
        raise ModelError(f"{source}: {what} {bad[0]} (counted from 0) has a node that is not there")


def _three_coordinates(content: MeshLike, source: str) -> FloatArray:
    points = np.asarray(content.points, dtype=np.float64)
    if points.ndim != 2 or not 1 <= points.shape[1] <= 3:
        raise ModelError(f"{source}: the mesh is empty (no points)")
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def _point_sets(content: MeshLike, source: str) -> dict[str, IntArray]:
    sets: dict[str, list[IntArray]] = {}
    for name, nodes in content.point_sets.items():
        sets.setdefault(str(name), []).append(np.asarray(nodes, dtype=np.int64))
    for name, values in content.point_data.items():
        if name.startswith(SET_PREFIX):
            sets.setdefault(_set_name(name), []).append(_marked(name, values, source))
    for index, block in enumerate(content.cells):
        if block.type == "vertex":
            for name, vertices in _groups(content, index, 0, source):
                sets.setdefault(name, []).append(block.data[vertices].ravel())
    found = {name: np.unique(np.concatenate(nodes)) for name, nodes in sets.items()}
    for name, nodes in found.items():
        _check_nodes(f"point {name!r}", nodes, len(content.points), source)
    return found


def _marked(array: str, values: ArrayLike, source: str) -> IntArray:
    """Indices where an array ``set:NAME`` is 1; elsewhere it is 0."""
    marks = np.asarray(values).ravel()
    bad = np.flatnonzero((marks != 0) & (marks != 1))
    if len(bad):
        raise ModelError(f"{source}: array {array!r} holds {marks[bad[0]]}, but 0 or 1 is expected")
    return np.flatnonzero(marks)


def _groups(
    content: MeshLike, index: int, dimension: int, source: str
) -> Iterator[tuple[str, IntArray]]:
    """Names and cell indices of all groups in one block of cells."""
    for name, blocks in content.cell_sets.items():
        if not name.startswith("gmsh:") and index < len(blocks) and len(blocks[index]):
            yield str(name), np.asarray(blocks[index], dtype=np.int64)
    for name, blocks in content.cell_data.items():
        if name.startswith(SET_PREFIX):
            yield _set_name(name), _marked(name, blocks[index], source)
    tags = np.asarray(content.cell_data.get("gmsh:physical", {index: []})[index])
    for tag in np.unique(tags[tags != 0]):
        yield _physical_name(content, int(tag), dimension), np.flatnonzero(tags == tag)


def _physical_name(content: MeshLike, tag: int, dimension: int) -> str:
    for name, (number, its_dimension) in content.field_data.items():
        if (number, its_dimension) == (tag, dimension):
            return str(name)
    return str(tag)


def _set_name(array: str) -> str:
    return array.removeprefix(SET_PREFIX)
