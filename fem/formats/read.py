"""Read meshes of frames and structures from Gmsh, VTK and Abaqus files."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar
from urllib.parse import unquote
from xml.sax.saxutils import unescape

import meshio
import numpy as np
from numpy.typing import ArrayLike

import fem.formats.meshio_kinds  # noqa: F401  (completes meshio's tables)
from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError, quoted
from fem.formats.abaqus import read_abaqus
from fem.formats.abaqus.deck import bare
from fem.formats.collapsed import uncollapsed
from fem.formats.gmsh import read_gmsh
from fem.formats.ignored import SET_PREFIX, TYPE_PREFIX, without_cells
from fem.formats.med import read_med
from fem.formats.nastran import read_nastran
from fem.formats.unpacking import bounded_unpacking
from fem.formats.unv import read_unv
from fem.mesh.cells import KINDS, SPANS
from fem.mesh.frame_mesh import FrameMesh
from fem.mesh.structure_mesh import StructureMesh

Mesh = TypeVar("Mesh", FrameMesh, StructureMesh)

FARTHEST = 1e50

GHOSTS = {"vtkGhostType": 1 | 8 | 32, "vtkGhostLevels": 255}
"""Bits of VTK's arrays for cells of another piece, cells that others refine, and hidden ones."""

FIELD_DATA = re.compile(rb"<FieldData\b(?:[^>]*/>|.*?</FieldData>)", re.DOTALL)
"""What a VTK file says of the whole, such as ParaView's time; meshio stops at it in a piece."""

OFFSET = re.compile(rb"""\boffset\s*=\s*["']\s*(\d+)\s*["']""")
"""Where a VTK file says at which byte of its appended data an array begins."""

LEGACY_ARRAY = re.compile(
    rb"^(?:SCALARS +)?(set\S+) +(?:\d+ +\d+ +)?[a-z]\w*(?: +\d+)?[ \r]*$", re.MULTILINE
)
"""The line before an array of marks in a VTK legacy file, of a FIELD or by itself."""

# What Python's and numpy's errors say about the words of a file, for one who wrote the file.
FAULTS = (
    (r"invalid literal for int\(\) with base 10: (.*)", r"\1 is not a whole number"),
    (r"could not convert string to float: (.*)", r"\1 is not a number"),
    (r".* codec can't decode .*", "it holds characters that are not UTF-8"),
    (r"(not enough values|cannot reshape|setting an array element).*", "numbers are missing"),
    (r"No (closing quotation|escaped character)", "a quoted name has no end"),
)
ASIDE = 1e-6  # of its length: how far the middle node of a straight line may lie beside it


def read_vtu(path: Path) -> meshio.Mesh:
    """Read a VTK file, without unpacking endlessly; what meshio would leave out is an error."""
    before, appended, data = path.read_bytes().partition(b"<AppendedData")
    told = FIELD_DATA.sub(b"", before)
    pieces = told.count(b"<Piece")
    if pieces > 1:
        raise ModelError(
            f"{path}: has {pieces} pieces, not one; pyvista.read(file).save(other_file) joins them"
        )
    for _, arrays in re.findall(rb"<(PointData|CellData)\b(.*?)</\1>", told, re.DOTALL):
        found = re.findall(rb"<DataArray\b[^>]*?\bName=[\"']([^\"']*)[\"']", arrays)
        _check_each_once([unescape(name.decode("utf-8", "replace")) for name in found], path)
    with bounded_unpacking(path), TemporaryDirectory() as folder:
        readable = path
        if told != before:
            readable = Path(folder) / "mesh.vtu"
            offsets = [int(offset) for offset in OFFSET.findall(before)]
            readable.write_bytes(_packed(told, offsets, data) if appended else told)
        content = _without_warning(meshio.vtu.read, readable)
    _check_no_ghosts(content, path)
    return content


def _packed(told: bytes, offsets: Sequence[int], data: bytes) -> bytes:
    """A VTK file with only those blocks of its appended data that it tells of.

    Parameters
    ----------
    told
        What stands before the appended data.
    offsets
        Of all blocks in ``data``.
    data
        From the end of ``<AppendedData`` on.
    """
    head, mark, rest = data.partition(b"_")
    blob, close, tail = rest.rpartition(b"</AppendedData>")
    blob = blob.rstrip(b" ").removesuffix(b"\n")
    ends = dict(pairwise([*sorted(set(offsets)), len(blob)]))
    kept: list[bytes] = []

    def moved(found: re.Match[bytes]) -> bytes:
        offset = int(found[1])
        place = sum(map(len, kept))
        kept.append(blob[offset : ends[offset]])
        return b'offset="%d"' % place

    told = OFFSET.sub(moved, told)
    return told + b"<AppendedData" + head + mark + b"".join(kept) + b"\n" + close + tail


def read_vtk(path: Path) -> meshio.Mesh:
    """Read a VTK legacy file; what meshio would leave out is an error.

    VTK writes a blank in a name as %20, a percent sign as %25, and so on; meshio leaves it so.
    """
    whole = path.read_bytes()
    if re.search(rb"^DATASET\s+POLYDATA\b", whole[:1024], re.MULTILINE):
        raise ModelError(
            f"{path}: holds POLYDATA, no unstructured grid;"
            " pyvista.read(file).cast_to_unstructured_grid().save('mesh.vtu') makes it one"
        )
    for arrays in re.split(rb"^(?:POINT|CELL)_DATA\b", whole, flags=re.MULTILINE)[1:]:
        _check_each_once([unquote(name) for name in LEGACY_ARRAY.findall(arrays)], path)
    try:
        content = _without_warning(meshio.vtk.read, path)
    except KeyError as error:
        raise ModelError(
            f"{path}: holds numbers of the type {error}, which are not read of VTK legacy files;"
            " save it as '.vtu'"
        ) from error
    except meshio.ReadError as error:
        raise ModelError(
            f"{path}: is cut off, or holds what is not read of VTK legacy files"
            f" ({_reason(error)}); save it as '.vtu'"
        ) from error
    for data in (content.point_data, content.cell_data):
        for name in list(data):
            data[unquote(name)] = data.pop(name)
    _check_no_ghosts(content, path)
    return content


def _check_no_ghosts(content: meshio.Mesh, path: Path) -> None:
    """Refuse cells that a VTK file marks as ones that do not count."""
    for name in GHOSTS.keys() & content.cell_data:
        marks = np.concatenate([np.ravel(marks) for marks in content.cell_data[name]])
        found = np.flatnonzero(marks.astype(np.int64) & GHOSTS[name])
        if len(found):
            raise ModelError(
                f"{path}: its array {name!r} says that {len(found)} cells (the first is cell"
                f" {found[0]}) are hidden, refined or of another piece; save it without them"
            )


def _check_each_once(names: Sequence[str], path: Path) -> None:
    """Refuse two arrays of one name, of which meshio would take the last one."""
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        raise ModelError(f"{path}: has two arrays {twice!r}")


def _without_warning(read: Callable[[Path], meshio.Mesh], path: Path) -> meshio.Mesh:
    said = io.StringIO()
    with redirect_stderr(said):
        content = read(path)
    if said.getvalue():
        raise ValueError(" ".join(said.getvalue().split()).removeprefix("Warning: "))
    return content


READERS: dict[str, tuple[str, Callable[[Path], meshio.Mesh]]] = {
    ".msh": ("Gmsh", read_gmsh),
    ".vtu": ("VTK", read_vtu),
    ".vtk": ("VTK", read_vtk),
    ".med": ("MED", read_med),
    ".unv": ("universal", read_unv),
}
DECK = ".inp"
"""The extension of files that hold more than a mesh."""
NASTRAN = (".bdf", ".nas")
ARCHIVE = ".cdb"
EXTENSIONS = (*READERS, DECK, *NASTRAN)


def read_mesh(
    path: str | Path, include_folders: Iterable[str | Path] = (), ignore: Sequence[str] = ()
) -> FrameMesh:
    """Read a line mesh with its named parts and points.

    Parameters
    ----------
    path
        A file whose extension says what it is:

        - ``.msh``: Gmsh 2.2 or 4.1, ASCII or binary. Physical curves are the parts, physical
          points the points; a group without a name goes by its number.
        - ``.vtu``, ``.vtk``: VTK unstructured grid. VTK has neither cell sets nor point sets, so
          a cell array ``set:NAME`` that is 1 on the elements of a part, else 0, names the part,
          and a point array ``set:NAME`` that is 1 at one node names a point.
        - ``.med``: MED of version 3 or later. Groups of edges and of nodes are parts and points.
        - ``.unv``: universal file, as Salome writes it, with its groups likewise.
        - ``.bdf``, ``.nas``: Nastran bulk data, of which solids are read, so for `read_structure`
          only. Properties are the parts, "PSOLID 3"; there are no names of points.
        - ``.inp``: Abaqus input. ELSET and NSET, also those given on ``*ELEMENT`` and ``*NODE``.

    include_folders
        Folders from which an Abaqus file may ``*INCLUDE`` others, beside its own.
    ignore
        Cells to leave out: names of groups, kinds of cells such as "quad", element types of
        Abaqus such as "S4R", or "ungrouped" for those in no group. Of an Abaqus file also what is
        refused: element types and keywords such as ``GAPUNI`` and ``*CONTACT PAIR``.

    Returns
    -------
    FrameMesh
        All coordinates as in the file. A straight line of three nodes becomes two elements. The
        nodes that are on no line are left out.

    Raises
    ------
    ModelError
        If the file does not exist, has another extension or another content, or if it has no
        line elements, curved lines, surfaces or volumes, coordinates that are not finite, or
        whatever `FrameMesh` refuses.

    Examples
    --------
    >>> import fem
    >>> mesh = fem.read_mesh("meshes/half_beam.msh")
    >>> sorted(mesh.parts), sorted(mesh.point_sets)
    (['beam', 'leaf'], ['corner', 'foot', 'middle'])
    """
    return _read(path, from_meshio, include_folders, ignore)


def read_structure(
    path: str | Path, include_folders: Iterable[str | Path] = (), ignore: Sequence[str] = ()
) -> StructureMesh:
    """Read a mesh of lines, surfaces and volumes with its named groups and points.

    Parameters
    ----------
    path
        A file as for `read_mesh`. In ``.msh`` files all physical groups are groups of cells, and
        physical points are point sets; in ``.vtu`` files the arrays ``set:NAME``; in ``.inp``
        files ELSET are groups and NSET point sets.
    include_folders, ignore
        As for `read_mesh`.

    Returns
    -------
    StructureMesh
        All cells. Hexahedra, wedges, pyramids and quadrilaterals some of whose nodes are repeated
        are the wedges, pyramids, tetrahedra and triangles that they mean; `notes` tell how many.

    Raises
    ------
    ModelError
        As for `read_mesh`, for cells of a kind that `fem` does not know, which it names, and for
        whatever `StructureMesh` refuses.

    Examples
    --------
    >>> import fem
    >>> sorted(fem.read_structure("meshes/half_beam.msh").groups)
    ['beam', 'leaf']
    """
    return _read(path, structure_from_meshio, include_folders, ignore)


def _read(
    path: str | Path,
    build: Callable[[meshio.Mesh, str], Mesh],
    include_folders: Iterable[str | Path],
    ignore: Sequence[str],
) -> Mesh:
    path = Path(path)
    extension = path.suffix.lower()
    if extension not in EXTENSIONS:
        if extension == ARCHIVE:
            raise ModelError(
                f"{path}: archives of Ansys are not read, and no conversion that keeps their"
                " components is known; the matrices that Ansys writes by HBMAT are read: give them"
                " as [matrices] in the scene"
            )
        raise ModelError(
            f"{path}: unknown mesh extension {path.suffix!r}; known are {quoted(EXTENSIONS)};"
            " export it as one of these from the program that made it: converters lose the names"
        )
    if not path.is_file():
        raise ModelError(f"{path}: there is no such mesh file")
    if path.stat().st_size == 0:
        raise ModelError(f"{path}: the mesh file is empty")
    try:
        if extension == DECK:
            return _deck_mesh(path, build, include_folders, ignore)
        if extension in NASTRAN:
            solids, left_out = read_nastran(path)
            content, said = without_cells(solids, ignore, str(path))
            return replace(_noted(build(content, str(path)), said), left_out=left_out)
        whole = READERS[extension][1](path)
        content, said = without_cells(whole, ignore, str(path))
        return _noted(_with_unit(build(content, str(path)), whole.info), said)
    except ModelError:
        raise
    except (Exception, SystemExit) as error:
        reason = _reason(error)
        if "zero-size array" in reason:
            raise ModelError(f"{path}: the mesh is empty, it has no elements") from error
        kind = "Abaqus" if extension == DECK else READERS.get(extension, ("Nastran",))[0]
        raise ModelError(f"{path}: cannot be read as {kind} mesh ({reason})") from error


def _deck_mesh(
    path: Path,
    build: Callable[[meshio.Mesh, str], Mesh],
    include_folders: Iterable[str | Path],
    ignore: Sequence[str],
) -> Mesh:
    """The mesh of an Abaqus file, with what the file attaches to it."""
    found = read_abaqus(path, include_folders, ignore)
    others = [name for name in ignore if bare(name) not in found.ignored]
    content, said = without_cells(found.content, others, str(path))
    notes = list(found.notes) + said
    return replace(
        _noted(build(content, str(path)), notes),
        attachments=found.attachments,
        described=found.described,
        left_out=found.left_out,
    )


def _with_unit(mesh: Mesh, unit: str | None) -> Mesh:
    """A mesh with the unit that its file states."""
    if unit in (None, "", "m"):
        return mesh
    note = (
        f"{mesh.source}: states the unit {unit!r} for its coordinates, which are taken as they are,"
        " in m unless 'unit' in [mesh] says otherwise"
    )
    return _noted(replace(mesh, unit=unit), [note])


def _noted(mesh: Mesh, said: Sequence[str]) -> Mesh:
    """A mesh with further notes."""
    return replace(mesh, notes=[*mesh.notes, *said]) if said else mesh


def _reason(error: BaseException) -> str:
    """What is wrong with a file, by the error of its reader."""
    said = " ".join(str(error).split())
    if isinstance(error, KeyError):
        return f"{said} is missing"
    for pattern, words in FAULTS:
        said = re.sub(f"^{pattern}$", words, said)
    return said or "it is damaged or cut off"


def from_meshio(content: meshio.Mesh, source: str = "meshio mesh") -> FrameMesh:
    """Take lines, parts and points out of a `meshio.Mesh`; see `read_mesh` for the conventions.

    Examples
    --------
    >>> import meshio
    >>> content = meshio.Mesh(
    ...     [[0.0, 0.0], [1.0, 0.0]], [("line", [[0, 1]])],
    ...     cell_data={"set:rod": [[1]]}, point_data={"set:tip": [0, 1]},
    ... )
    >>> from_meshio(content).parts
    {'rod': array([0])}
    """
    points = _three_coordinates(content, source)
    lines, parts = _lines_and_parts(content, source)
    _check_far(points, source)
    _check_nodes("line", lines, len(points), source)
    used = np.unique(lines)
    number = np.full(len(points), -1)
    number[used] = np.arange(len(used))
    sets = {name: number[nodes] for name, nodes in _point_sets(content, source).items()}
    parts = {name: elements for name, elements in parts.items() if len(elements)}
    return FrameMesh(
        points[used],
        number[lines],
        _names(parts),
        {name: nodes[nodes >= 0] for name, nodes in sets.items()},
        source,
        element_types=_types(parts),
    )


def structure_from_meshio(content: meshio.Mesh, source: str = "meshio mesh") -> StructureMesh:
    """Take cells, groups and points of all kinds out of a `meshio.Mesh`.

    Examples
    --------
    >>> import meshio
    >>> content = meshio.Mesh(
    ...     [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [("triangle", [[0, 1, 2]])],
    ...     cell_data={"set:sheet": [[1]]},
    ... )
    >>> structure_from_meshio(content).part("sheet")
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
    sets = {name: nodes for name, nodes in _point_sets(content, source).items() if len(nodes)}
    return StructureMesh(
        points, whole, _names(named), sets, source, notes=notes, element_types=_types(named)
    )


def _check_kinds(content: meshio.Mesh, taken: set[str], source: str, advice: str) -> None:
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
        dimension = content.cells[blocks[0]].dim
        names = {n for i in blocks for n, at in _groups(content, i, dimension, source) if len(at)}
        group = f"in {quoted(sorted(names))}" if names else "in no group"
        number = ", ".join(map(str, blocks[:5])) + (", ..." if len(blocks) > 5 else "")
        told.append(f"{count} {kind} ({group}; block {number} of the file, counted from 0)")
    raise ModelError(f"{source}: the mesh has cells that are not read: {'; '.join(told)}; {advice}")


Named = TypeVar("Named")


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


def _three_coordinates(content: meshio.Mesh, source: str) -> FloatArray:
    points = np.asarray(content.points, dtype=np.float64)
    if points.ndim != 2 or not 1 <= points.shape[1] <= 3:
        raise ModelError(f"{source}: the mesh is empty (no points)")
    return np.pad(points, ((0, 0), (0, 3 - points.shape[1])))


def _lines_and_parts(content: meshio.Mesh, source: str) -> tuple[IntArray, dict[str, IntArray]]:
    curved = sorted({b.type for b in content.cells if b.type.startswith("line")} - set(SPANS))
    if curved:
        raise ModelError(
            f"{source}: elements of type {quoted(curved)} are not straight two-node lines;"
            " make the mesh of first order"
        )
    advice = "a frame has lines only; read it as a structure, or ignore these by their names"
    if any(block.type in SPANS and len(block.data) for block in content.cells):
        _check_kinds(content, {*SPANS, "vertex"}, source, advice)
    lines: list[IntArray] = []
    parts: dict[str, list[IntArray]] = {}
    first = 0
    for index, block in enumerate(content.cells):
        if block.type in SPANS and len(block.data):
            pieces = straight_pieces(content, block.type, block.data, source)
            count = len(SPANS[block.type])
            for name, elements in _groups(content, index, 1, source):
                halves = count * elements[:, None] + np.arange(count)
                parts.setdefault(name, []).append(halves.ravel() + first)
            lines.append(pieces)
            first += len(pieces)
    if not lines:
        found = sorted({block.type for block in content.cells if len(block.data)})
        raise ModelError(f"{source}: the mesh has no line elements (its cells are {quoted(found)})")
    return np.concatenate(lines), {name: np.concatenate(p) for name, p in parts.items()}


def straight_pieces(content: meshio.Mesh, kind: str, cells: ArrayLike, source: str) -> IntArray:
    """Two-node lines (e, 2) of lines with two or three nodes; a curved one is refused."""
    nodes = np.asarray(cells, dtype=np.int64)
    _check_nodes(kind, nodes, len(content.points), source)
    if kind == "line3":
        points = _three_coordinates(content, source)[nodes]
        span, arm = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
        square = np.sum(span**2, axis=1)
        share = np.sum(span * arm, axis=1) / np.where(square > 0.0, square, np.inf)
        aside = np.linalg.norm(arm - share[:, None] * span, axis=1)
        bad = np.flatnonzero((aside > ASIDE * np.sqrt(square)) | (np.abs(share - 0.5) >= 0.5))
        if len(bad):
            raise ModelError(
                f"{source}: line3 {bad[0]} (counted from 0) is not straight; a frame has straight"
                " beams: make the mesh of first order, or use a structure, where a line of three"
                " nodes is two beams"
            )
    return np.stack([nodes[:, list(ends)] for ends in SPANS[kind]], axis=1).reshape(-1, 2)


def _point_sets(content: meshio.Mesh, source: str) -> dict[str, IntArray]:
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
    content: meshio.Mesh, index: int, dimension: int, source: str
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


def _physical_name(content: meshio.Mesh, tag: int, dimension: int) -> str:
    for name, (number, its_dimension) in content.field_data.items():
        if (number, its_dimension) == (tag, dimension):
            return str(name)
    return str(tag)


def _set_name(array: str) -> str:
    return array.removeprefix(SET_PREFIX)
