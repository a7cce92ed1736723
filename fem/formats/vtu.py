"""Read and write VTK's XML files of unstructured grids."""

from __future__ import annotations

import base64
import lzma
import re
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.formats.content import CellBlock, MeshContent
from fem.formats.vtk_cells import NUMBERS, ORDERS, check_each_once, content_of, is_needed

ALWAYS, TIMES = 200_000_000, 50  # bytes that a file may unpack to, and bytes for each of its own
KINDS = {"Float32": "f4", "Float64": "f8"}
KINDS |= {
    f"{sign}{8 * n}": f"{sign[0].lower()}{n}" for sign in ("Int", "UInt") for n in (1, 2, 4, 8)
}
ENDS = {"LittleEndian": "<", "BigEndian": ">"}
CODECS: dict[str, Callable[[], zlib._Decompress | lzma.LZMADecompressor]] = {
    "vtkZLibDataCompressor": zlib.decompressobj,
    "vtkLZMADataCompressor": lzma.LZMADecompressor,
}
APPENDED = re.compile(rb"<AppendedData\b[^>]*\bencoding\s*=\s*[\"'](\w+)[\"'][^>]*>\s*_", re.DOTALL)
BLOCK = 1 << 15  # bytes that are packed at once


def read_vtu(path: Path) -> MeshContent:
    """Read an unstructured grid with its arrays ``set:NAME``.

    Parameters
    ----------
    path
        Of one piece; ASCII or binary, as VTK, ParaView and meshio write it, packed by zlib, by
        LZMA or not at all.

    Raises
    ------
    ModelError
        If it is not such a file, has several pieces, two arrays of one name, or ghosts.
    ValueError
        If it contradicts itself or is cut off; the text says how.

    References
    ----------
    *VTK file formats*, https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html.

    Examples
    --------
    >>> read_vtu(Path("meshes/half_beam.vtu"))
    <MeshContent: 93 points, 92 line>
    """
    whole = path.read_bytes()
    root, appended = _root(whole)
    arrays = _Arrays.of(root, appended, ALWAYS + TIMES * len(whole))
    pieces = root.findall("./UnstructuredGrid/Piece")
    if root.get("type") != "UnstructuredGrid" or not pieces:
        raise ValueError(f"it holds {root.get('type') or 'nothing'}, no unstructured grid")
    if len(pieces) > 1:
        raise ModelError(
            f"{path}: has {len(pieces)} pieces, not one;"
            " pyvista.read(file).save(other_file) joins them"
        )
    return _content(pieces[0], arrays, str(path))


def _root(whole: bytes) -> tuple[Element, _Blob | None]:
    """The root of a file, and its appended data, which need not be XML."""
    appended, begin = None, APPENDED.search(whole)
    if begin:
        end = whole.rfind(b"</AppendedData>")
        if end < begin.end():
            raise ValueError("its appended data are cut off")
        appended = _Blob(whole[begin.end() : end], begin[1].decode())
        whole = whole[: begin.start()] + whole[end + len(b"</AppendedData>") :]
    try:
        root = ElementTree.fromstring(whole)
    except ElementTree.ParseError as error:
        raise ValueError(f"it is damaged or cut off: {error}") from error
    if root.tag != "VTKFile":
        raise ValueError(f"it begins with <{root.tag}>, not with <VTKFile>")
    return root, appended


@dataclass(frozen=True)
class _Blob:
    """Bytes as they are ("raw") or in base64, of which any part can be taken."""

    data: bytes
    encoding: str

    def take(self, at: int, count: int) -> tuple[bytes, int]:
        """So many bytes of those that are encoded from a place on, and where the rest begins."""
        end = at + (count if self.encoding == "raw" else -(-count // 3) * 4)
        if not 0 <= at <= end <= len(self.data):
            raise ValueError("its binary data are cut off")
        part = self.data[at:end]
        if self.encoding == "base64":
            part = base64.b64decode(part, validate=True)[:count]
        return part, end


@dataclass
class _Arrays:
    """How a file has its arrays, and how many bytes may still be unpacked."""

    end: str
    header: np.dtype[np.unsignedinteger]
    codec: Callable[[], zlib._Decompress | lzma.LZMADecompressor] | None
    appended: _Blob | None
    left: int

    @classmethod
    def of(cls, root: Element, appended: _Blob | None, left: int) -> _Arrays:
        known = {
            "version": ("0.1", "1.0"),
            "byte_order": ENDS,
            "header_type": ("UInt32", "UInt64"),
            "compressor": CODECS,
        }
        for name, values in known.items():
            if root.get(name, next(iter(values))) not in values:
                raise ValueError(f"its {name} is {root.get(name)!r}, which is not read")
        end = ENDS[root.get("byte_order", "LittleEndian")]
        header = np.dtype(end + KINDS[root.get("header_type", "UInt32")])
        return cls(end, header, CODECS.get(root.get("compressor", "")), appended, left)

    def read(self, array: Element, count: int) -> np.ndarray:
        """So many values or rows of a ``DataArray``."""
        name, kind = array.get("Name", "Points"), KINDS.get(array.get("type", ""))
        if array.tag != "DataArray" or kind is None:
            raise ValueError(f"its array {name!r} holds {array.get('type')}, which is not read")
        form, columns = array.get("format", "ascii"), int(array.get("NumberOfComponents") or 1)
        if form == "ascii":
            words = (array.text or "").split()
            values = np.array(words, dtype="S").astype(kind) if words else np.zeros(0, kind)
        else:
            values = np.frombuffer(self._bytes(array, form), self.end + kind).astype(kind)
        if columns < 1 or len(values) != count * columns:
            raise ValueError(f"its array {name!r} has {len(values)} numbers, not {count * columns}")
        return values.reshape(count, columns) if columns > 1 else values

    def _bytes(self, array: Element, form: str) -> bytes:
        if form == "binary":
            return self._unpacked(_Blob("".join((array.text or "").split()).encode(), "base64"), 0)
        if form != "appended" or self.appended is None:
            raise ValueError(f"its format {form!r} is not read, or its data are missing")
        return self._unpacked(self.appended, int(array.get("offset", "")))

    def _unpacked(self, blob: _Blob, at: int) -> bytes:
        width = self.header.itemsize
        first, _ = blob.take(at, width)
        count = int(np.frombuffer(first, self.header)[0])
        if self.codec is None:
            return blob.take(at, width + count)[0][width:]
        head, at = blob.take(at, (3 + count) * width)
        _, size, last, *packed = np.frombuffer(head, self.header).tolist()
        whole, _ = blob.take(at, sum(packed))
        places = np.cumsum([0, *packed]).tolist()
        found = [self._unpack(whole[a:b]) for a, b in pairwise(places)]
        sizes = [size] * count
        if count and last:
            sizes[-1] = last
        if [len(block) for block in found] != sizes:
            raise ValueError("its packed blocks have other sizes than it says")
        return b"".join(found)

    def _unpack(self, packed: bytes) -> bytes:
        assert self.codec is not None
        codec = self.codec()
        found = codec.decompress(packed, self.left + 1)
        self.left -= len(found)
        if self.left < 0:
            raise ValueError("it unpacks to far more than a mesh of its size holds")
        if not codec.eof:
            raise ValueError("its packed data are cut off")
        return found


def _content(piece: Element, arrays: _Arrays, source: str) -> MeshContent:
    points, cells = (int(piece.get(f"NumberOf{what}", "")) for what in ("Points", "Cells"))
    places = piece.findall("./Points/DataArray")
    if len(places) != 1:
        raise ValueError(f"it has {len(places)} arrays of points, not one")
    told = {array.get("Name"): array for array in piece.findall("./Cells/DataArray")}
    if not {"connectivity", "offsets", "types"} <= told.keys():
        raise ValueError("its cells are not told by 'connectivity', 'offsets' and 'types'")
    ends, types = (arrays.read(told[n], cells).astype(np.int64) for n in ("offsets", "types"))
    nodes = arrays.read(told["connectivity"], int(ends[-1]) if cells else 0).astype(np.int64)
    data = []
    for what, count in (("PointData", points), ("CellData", cells)):
        found = [a for a in piece.findall(f"./{what}/*") if is_needed(a.get("Name", ""))]
        check_each_once([a.get("Name", "") for a in found], source)
        data.append({a.get("Name", ""): arrays.read(a, count) for a in found})
    places_of = arrays.read(places[0], points).reshape(points, -1)
    return content_of(places_of, (nodes, ends, types), data[0], data[1], source)


def write_vtu(
    path: Path,
    points: FloatArray,
    blocks: Sequence[CellBlock],
    point_data: Mapping[str, np.ndarray],
    cell_data: Mapping[str, np.ndarray],
) -> None:
    """Write an unstructured grid, packed by zlib; coordinates in double precision.

    Parameters
    ----------
    path
        The file.
    points
        Coordinates (n, 3).
    blocks
        Cells of one kind each.
    point_data, cell_data
        Arrays (n,), and (e,) over the cells of all blocks.

    Raises
    ------
    ModelError
        For cells that VTK has not.
    """
    unknown = next((block.type for block in blocks if block.type not in NUMBERS), None)
    if unknown is not None:
        raise ModelError(f"{path}: VTK has no cells of kind {unknown!r}")
    sizes = [block.data.shape[1] for block in blocks for _ in block.data]
    nodes = [b.data[:, ORDERS[b.type]] if b.type in ORDERS else b.data for b in blocks]
    root = Element("VTKFile", type="UnstructuredGrid", version="0.1")
    root.attrib |= {"byte_order": "LittleEndian", "compressor": "vtkZLibDataCompressor"}
    counts = {"NumberOfPoints": str(len(points)), "NumberOfCells": str(len(sizes))}
    piece = SubElement(SubElement(root, "UnstructuredGrid"), "Piece", counts)
    _put(SubElement(piece, "Points"), "Points", np.asarray(points, dtype=np.float64))
    cells = SubElement(piece, "Cells")
    _put(cells, "connectivity", _joined([block.ravel() for block in nodes]))
    _put(cells, "offsets", np.cumsum(sizes, dtype=np.int64))
    _put(cells, "types", _joined([np.full(len(b.data), NUMBERS[b.type]) for b in blocks]))
    for what, data in (("PointData", point_data), ("CellData", cell_data)):
        section = SubElement(piece, what)
        for name, values in data.items():
            _put(section, name, values)
    ElementTree.indent(root, "")
    with BytesIO() as file:
        ElementTree.ElementTree(root).write(file, encoding="utf-8", xml_declaration=True)
        path.write_bytes(file.getvalue() + b"\n")


def _joined(parts: Sequence[IntArray]) -> IntArray:
    return np.concatenate([np.zeros(0, dtype=np.int64), *parts])


def _put(section: Element, name: str, values: np.ndarray) -> None:
    """An array of a section: the sizes of its blocks and then these, each in base64."""
    of = {"f": "Float", "i": "Int"}[values.dtype.kind] + str(8 * values.itemsize)
    array = SubElement(section, "DataArray", type=of, Name=name, format="binary")
    if values.ndim == 2:
        array.set("NumberOfComponents", str(values.shape[1]))
    data = values.astype(values.dtype.newbyteorder("<")).tobytes()
    packed = [zlib.compress(data[a : a + BLOCK]) for a in range(0, len(data), BLOCK)]
    header = [len(packed), BLOCK, len(data) % BLOCK, *map(len, packed)]
    parts = (np.array(header, dtype="<u4").tobytes(), b"".join(packed))
    array.text = "".join(base64.b64encode(part).decode() for part in parts)
