"""Write meshes as Gmsh, VTK and Abaqus files."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import numpy.typing as npt

from fem.errors import ModelError, quoted
from fem.files import plain_write_errors
from fem.mesh import FrameMesh, IntArray
from fem.read import SET_PREFIX
from fem.structure_mesh import StructureMesh


def write_mesh(mesh: FrameMesh | StructureMesh, path: str | Path) -> None:
    """Write a mesh so that `read_mesh`, or `read_structure`, gives it back.

    Parameters
    ----------
    mesh
        The mesh. One of a structure is written as ``.vtu`` only.
    path
        File ending in ``.msh`` (Gmsh 2.2, ASCII), ``.vtu`` or ``.inp`` (Abaqus, B21 elements).

    Raises
    ------
    ModelError
        For another extension, for parts that overlap in a Gmsh file, which cannot say so, or if
        the file cannot be written.

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
    if isinstance(mesh, StructureMesh):
        if path.suffix.lower() != ".vtu":
            raise ModelError(f"{path}: the mesh of a structure is written as '.vtu' only")
        with plain_write_errors(path):
            _write_structure(mesh, path)
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
    rows = ["*HEADING", path.stem, "*NODE"]
    for label, xyz in enumerate(mesh.points.tolist(), start=1):
        rows.append(", ".join([str(label), *(repr(x) for x in xyz)]))
    rows.append("*ELEMENT, TYPE=B21")
    for label, (start, stop) in enumerate((mesh.lines + 1).tolist(), start=1):
        rows.append(f"{label}, {start}, {stop}")
    for keyword, sets in (("ELSET", mesh.parts), ("NSET", mesh.point_sets)):
        for name, indices in sets.items():
            labels = [str(index + 1) for index in indices.tolist()]
            rows.append(f"*{keyword}, {keyword}={name}")
            rows.extend(", ".join(labels[i : i + 16]) for i in range(0, len(labels), 16))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
