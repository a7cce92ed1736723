"""Write meshes as Gmsh, VTK and Abaqus files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path

import meshio
import numpy as np
import numpy.typing as npt
from meshio._vtk_common import meshio_to_vtk_type

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError, quoted
from fem.base.files import plain_write_errors
from fem.formats.abaqus.types import ORDERS, SOLIDS
from fem.formats.ignored import SET_PREFIX
from fem.mesh.cells import KINDS
from fem.mesh.frame_mesh import FrameMesh
from fem.mesh.structure_mesh import StructureMesh

ABAQUS_TYPES = {
    kind: name + ("R" if KINDS[kind].reducible else "")
    for name, kind in SOLIDS.items()
    if not name.startswith("CPE")
}
ABAQUS_TYPES |= {"line": "B31", "line3": "B32"}


def write_mesh(mesh: FrameMesh | StructureMesh, path: str | Path) -> None:
    """Write a mesh so that `read_mesh`, or `read_structure`, gives it back.

    Parameters
    ----------
    mesh
        The mesh. One of a structure is written as ``.vtu`` or ``.inp`` only.
    path
        File ending in ``.msh`` (Gmsh 2.2, ASCII), ``.vtu`` or ``.inp`` (Abaqus: B21 elements of a
        frame; of a structure elements of the types that the mesh knows of, else B31, CPS and C3D).

    Raises
    ------
    ModelError
        For another extension, for a mesh to which masses or springs are attached, for parts that
        overlap in a Gmsh file, which cannot say so, for cells that Abaqus has no elements for, or
        if the file cannot be written.

    Examples
    --------
    >>> import pathlib, tempfile, fem
    >>> mesh = fem.frame_mesh({"a": (0, 0), "b": (1, 0)}, [("rod", "a", "b", 2)])
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "rod.vtu"
    >>> fem.write_mesh(mesh, path)
    >>> fem.read_mesh(path).point_sets
    {'a': array([0]), 'b': array([1])}
    """
    path = Path(path)
    if mesh.attachments:
        raise ModelError(
            f"{path}: something is attached to the mesh ({mesh.attachments}), which a mesh file"
            " would lose; write it without, by dataclasses.replace(mesh, attachments=Attachments())"
        )
    if isinstance(mesh, StructureMesh):
        structures = {".vtu": _write_structure, ".inp": _write_abaqus_structure}
        if path.suffix.lower() not in structures:
            raise ModelError(f"{path}: the mesh of a structure is written as '.vtu' or '.inp' only")
        with plain_write_errors(path):
            structures[path.suffix.lower()](mesh, path)
        return
    writers = {".msh": _write_gmsh, ".vtu": _write_vtu, ".inp": _write_abaqus}
    if path.suffix.lower() not in writers:
        raise ModelError(
            f"{path}: unknown mesh extension {path.suffix!r}; known are {quoted(writers)}"
        )
    with plain_write_errors(path):
        writers[path.suffix.lower()](mesh, path)


def _write_gmsh(mesh: FrameMesh, path: Path) -> None:
    part_tags = np.zeros(len(mesh.lines), dtype=np.int64)
    groups: dict[str, IntArray] = {}
    for tag, (name, elements) in enumerate(mesh.parts.items(), start=1):
        if part_tags[elements].any():
            raise ModelError(f"{path}: part {name!r} overlaps another, which Gmsh 2.2 cannot say")
        part_tags[elements] = tag
        groups[name] = np.array([tag, 1])
    vertices: list[int] = []
    point_tags: list[int] = []
    for tag, (name, nodes) in enumerate(mesh.point_sets.items(), start=len(groups) + 1):
        if name in groups:
            raise ModelError(f"{path}: {name!r} names both a part and a point")
        vertices.extend(nodes.tolist())
        point_tags.extend([tag] * len(nodes))
        groups[name] = np.array([tag, 0])
    cells = [("line", mesh.lines)]
    tags = [part_tags]
    if vertices:
        cells.append(("vertex", np.array(vertices).reshape(-1, 1)))
        tags.append(np.array(point_tags))
    content = meshio.Mesh(
        mesh.points,
        cells,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data=groups,
    )
    meshio.gmsh.write(path, content, fmt_version="2.2", binary=False)


def _write_vtu(mesh: FrameMesh, path: Path) -> None:
    content = meshio.Mesh(
        mesh.points,
        [("line", mesh.lines)],
        cell_data={
            SET_PREFIX + name: [_indicator(elements, len(mesh.lines))]
            for name, elements in mesh.parts.items()
        },
        point_data={
            SET_PREFIX + name: _indicator(nodes, len(mesh.points))
            for name, nodes in mesh.point_sets.items()
        },
    )
    meshio.vtu.write(path, content)


def _write_structure(mesh: StructureMesh, path: Path) -> None:
    """Compressed; coordinates in double precision."""
    for kind in mesh.cells:
        if kind not in meshio_to_vtk_type:
            raise ModelError(f"{path}: VTK has no cells of kind {kind!r}")
    content = meshio.Mesh(
        mesh.points,
        list(mesh.cells.items()),
        cell_data={
            SET_PREFIX + name: [
                _flags(group.get(kind, np.zeros(0, dtype=np.int64)), len(cells))
                for kind, cells in mesh.cells.items()
            ]
            for name, group in mesh.groups.items()
        },
        point_data={
            SET_PREFIX + name: _flags(nodes, len(mesh.points))
            for name, nodes in mesh.point_sets.items()
        },
    )
    meshio.vtu.write(path, content)


def _flags(indices: IntArray, count: int) -> npt.NDArray[np.int8]:
    return _indicator(indices, count).astype(np.int8)


def _indicator(indices: IntArray, count: int) -> IntArray:
    values = np.zeros(count, dtype=np.int64)
    values[indices] = 1
    return values


def _write_abaqus(mesh: FrameMesh, path: Path) -> None:
    _write_deck(path, mesh.points, [("B21", mesh.lines)], mesh.parts, mesh.point_sets)


def _write_abaqus_structure(mesh: StructureMesh, path: Path) -> None:
    counts = [len(cells) for cells in mesh.cells.values()]
    first = dict(zip(mesh.cells, np.cumsum([0, *counts]).tolist(), strict=False))
    groups = {
        name: np.concatenate([first[kind] + cells for kind, cells in group.items()])
        for name, group in mesh.groups.items()
        if group
    }
    elements = [piece for kind in mesh.cells for piece in _by_type(mesh, kind, path)]
    _write_deck(path, mesh.points, elements, groups, mesh.point_sets)


def _by_type(mesh: StructureMesh, kind: str, path: Path) -> Iterator[tuple[str, IntArray]]:
    """Runs of cells of a kind that are of one type, in the order of nodes of a deck."""
    names = np.full(len(mesh.cells[kind]), ABAQUS_TYPES.get(kind, ""), dtype=object)
    for name, found in mesh.element_types.items():
        names[found.get(kind, np.zeros(0, dtype=np.int64))] = name
    if not all(names):
        raise ModelError(f"{path}: Abaqus has no elements for cells of kind {kind!r}")
    cells = mesh.cells[kind]
    if kind in ORDERS:
        cells = cells[:, np.argsort(ORDERS[kind])]
    first = 0
    for name, run in groupby(names):
        last = first + len(list(run))
        yield str(name), cells[first:last]
        first = last


def _write_deck(
    path: Path,
    points: FloatArray,
    elements: Sequence[tuple[str, IntArray]],
    groups: Mapping[str, IntArray],
    point_sets: Mapping[str, IntArray],
) -> None:
    """Nodes, elements by type and their sets, labelled from 1."""
    rows = ["*HEADING", path.stem, "*NODE"]
    for label, xyz in enumerate(points.tolist(), start=1):
        rows.append(", ".join([str(label), *(repr(x) for x in xyz)]))
    label = 0
    for name, cells in elements:
        rows.append(f"*ELEMENT, TYPE={name}")
        for nodes in (cells + 1).tolist():
            label += 1
            rows.append(",\n".join(_lines_of_16([label, *nodes])))
    for keyword, sets in (("ELSET", groups), ("NSET", point_sets)):
        for name, indices in sets.items():
            rows.append(f"*{keyword}, {keyword}={name}")
            rows.extend(_lines_of_16((indices + 1).tolist()))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def _lines_of_16(labels: list[int]) -> list[str]:
    """Numbers in lines of 16, more than which Abaqus does not read."""
    return [", ".join(map(str, labels[i : i + 16])) for i in range(0, len(labels), 16)]
