"""Write meshes as Gmsh, VTK and Abaqus files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError, quoted
from fem.base.files import plain_write_errors
from fem.formats.abaqus.types import ORDERS, SOLIDS
from fem.formats.content import CellBlock
from fem.formats.ignored import SET_PREFIX
from fem.formats.vtu import write_vtu
from fem.mesh.cells import KINDS
from fem.mesh.structure_mesh import StructureMesh

ABAQUS_TYPES = {
    kind: name + ("R" if KINDS[kind].reducible else "")
    for name, kind in SOLIDS.items()
    if not name.startswith("CPE")
}
ABAQUS_TYPES |= {"line": "B31", "line3": "B32"}


def write_mesh(mesh: StructureMesh, path: str | Path) -> None:
    """Write a mesh so that `read_mesh` gives it back.

    Parameters
    ----------
    mesh
        The mesh.
    path
        File ending in ``.vtu``, ``.inp`` (Abaqus: elements of the types that the mesh knows of,
        else B31, CPS and C3D) or, of a mesh of two-node lines, ``.msh`` (Gmsh 2.2, ASCII).

    Raises
    ------
    ModelError
        For another extension, for a mesh to which masses or springs are attached, for groups that
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
    writers = {".msh": _write_gmsh, ".vtu": _write_vtu, ".inp": _write_abaqus}
    if path.suffix.lower() not in writers:
        raise ModelError(
            f"{path}: unknown mesh extension {path.suffix!r}; known are {quoted(writers)}"
        )
    with plain_write_errors(path):
        writers[path.suffix.lower()](mesh, path)


def _write_gmsh(mesh: StructureMesh, path: Path) -> None:
    """Version 2.2, ASCII: lines of one physical group each, and vertices for the points."""
    if set(mesh.cells) != {"line"}:
        raise ModelError(f"{path}: only a mesh of two-node lines is written as '.msh'")
    lines = mesh.cells["line"]
    tags = np.zeros(len(lines), dtype=np.int64)
    names: list[tuple[int, str]] = []
    for tag, (name, group) in enumerate(mesh.groups.items(), start=1):
        at = group.get("line", np.zeros(0, dtype=np.int64))
        if tags[at].any():
            raise ModelError(f"{path}: group {name!r} overlaps another, which Gmsh 2.2 cannot say")
        tags[at] = tag
        names.append((1, name))
    cells = [(1, tag, ends) for tag, ends in zip(tags.tolist(), lines.tolist(), strict=True)]
    for tag, (name, nodes) in enumerate(mesh.point_sets.items(), start=len(names) + 1):
        if name in mesh.groups:
            raise ModelError(f"{path}: {name!r} names both a group and a point set")
        cells += [(15, tag, [node]) for node in nodes.tolist()]
        names.append((0, name))
    points = enumerate(mesh.points.tolist(), start=1)
    sections = {
        "MeshFormat": ["2.2 0 8"],
        "PhysicalNames": [str(len(names))]
        + [f'{size} {tag} "{name}"' for tag, (size, name) in enumerate(names, start=1)],
        "Nodes": [str(len(mesh.points)), *(f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in points)],
        "Elements": [str(len(cells))]
        + [
            " ".join(map(str, (label, code, 2, tag, tag, *(node + 1 for node in nodes))))
            for label, (code, tag, nodes) in enumerate(cells, start=1)
        ],
    }
    rows = [f"${name}\n" + "\n".join(body) + f"\n$End{name}\n" for name, body in sections.items()]
    path.write_text("".join(rows), encoding="utf-8")


def _write_vtu(mesh: StructureMesh, path: Path) -> None:
    none = np.zeros(0, dtype=np.int64)
    marks = {
        SET_PREFIX + name: np.concatenate(
            [_flags(group.get(kind, none), len(cells)) for kind, cells in mesh.cells.items()]
        )
        for name, group in mesh.groups.items()
    }
    blocks = [CellBlock(kind, cells) for kind, cells in mesh.cells.items()]
    write_vtu(path, mesh.points, blocks, _marked_points(mesh), marks)


def _marked_points(mesh: StructureMesh) -> dict[str, npt.NDArray[np.int8]]:
    return {
        SET_PREFIX + name: _flags(nodes, len(mesh.points))
        for name, nodes in mesh.point_sets.items()
    }


def _flags(indices: IntArray, count: int) -> npt.NDArray[np.int8]:
    values = np.zeros(count, dtype=np.int8)
    values[indices] = 1
    return values


def _write_abaqus(mesh: StructureMesh, path: Path) -> None:
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
