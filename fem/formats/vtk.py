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
            f" ({reason_of(error)}); save it as '.vtu'"
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
