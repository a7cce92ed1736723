"""Read VTK files, XML and legacy ones, where meshio would stop or leave something out."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from urllib.parse import unquote
from xml.sax.saxutils import unescape

import meshio
import numpy as np

import fem.formats.meshio_kinds  # noqa: F401  (completes meshio's tables)
from fem.base.errors import ModelError
from fem.formats.faults import reason_of
from fem.formats.unpacking import bounded_unpacking

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
LEGACY_DATA = re.compile(
    rb"^(?:(?:POINT|CELL)_DATA[ \t]+(?P<count>\d+)"
    rb"|NORMALS[ \t]+(?P<normals>\S+[ \t]+\S+)"
    rb"|TENSORS6[ \t]+(?P<tensors>\S+)[ \t]+(?P<tensor>\S+)"
    rb"|TEXTURE_COORDINATES[ \t]+(?P<places>\S+)[ \t]+(?P<axes>\d)[ \t]+(?P<place>\S+)"
    rb"|(?:GLOBAL|PEDIGREE)_IDS[ \t]+(?P<labels>\S+)[ \t]+(?P<label>\S+)"
    rb"|COLOR_SCALARS[ \t]+(?P<colours>\S+)[ \t]+(?P<shades>\d+))[ \t\r]*$",
    re.MULTILINE | re.IGNORECASE,
)
"""Lines before data of a VTK legacy file that meshio does not take, and how many there are."""
LEGACY_TABLE = re.compile(rb"^LOOKUP_TABLE[ \t]+\S+[ \t]+(\d+)[ \t\r]*\n", re.MULTILINE | re.I)
"""The line before a table of colours, of four bytes or four numbers each."""


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
        with TemporaryDirectory() as folder:
            readable = path
            if (plain := _as_fields(whole)) != whole:
                readable = Path(folder) / "mesh.vtk"
                readable.write_bytes(plain)
            content = _without_warning(meshio.vtk.read, readable)
    except KeyError as error:
        raise ModelError(
            f"{path}: holds numbers of the type {error}, which are not read of VTK legacy files;"
            " save it as '.vtu'"
        ) from error
    except meshio.ReadError as error:
        raise ModelError(
            f"{path}: is cut off, or holds what is not read of VTK legacy files"
            f" ({reason_of(error)}); save it as '.vtu'"
        ) from error
    for data in (content.point_data, content.cell_data):
        for name in list(data):
            data[unquote(name)] = data.pop(name)
    _check_no_ghosts(content, path)
    return content


def _as_fields(whole: bytes) -> bytes:
    """A VTK legacy file whose normals, colours, labels and the like are arrays as others are.

    They lie in the file as an array does that its number of columns and of rows tells of.
    """
    count = b"0"
    binary = whole.split(b"\n", 3)[2].strip().upper() == b"BINARY"
    shade = b"unsigned_char" if binary else b"double"
    while table := LEGACY_TABLE.search(whole):
        values = rb"[\s\S]{%d}" if binary else rb"(?:\s*\S+){%d}"
        end = re.compile(values % (4 * int(table[1]))).match(whole, table.end())
        whole = whole[: table.start()] + whole[end.end() if end else table.end() :]

    def field(name: bytes, columns: bytes, kind: bytes) -> bytes:
        return b" ".join([b"FIELD FieldData 1\n" + name, columns, count, kind])

    def told(found: re.Match[bytes]) -> bytes:
        nonlocal count
        part = found.groupdict()
        if part["count"]:
            count = part["count"]
            return found[0]
        if part["normals"]:
            return b"VECTORS " + part["normals"]
        if part["tensors"]:
            return field(part["tensors"], b"6", part["tensor"])
        if part["places"]:
            return field(part["places"], part["axes"], part["place"])
        if part["labels"]:
            return field(part["labels"], b"1", part["label"])
        return field(part["colours"], part["shades"], shade)

    return LEGACY_DATA.sub(told, whole)


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
