"""Read VTK's legacy files of unstructured grids."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from fem.base.arrays import IntArray
from fem.base.errors import ModelError
from fem.formats.content import MeshContent
from fem.formats.faults import reason_of
from fem.formats.vtk_cells import check_each_once, content_of, is_needed

KINDS = {
    "unsigned_char": "u1", "char": "i1", "signed_char": "i1", "unsigned_short": "u2",
    "short": "i2", "unsigned_int": "u4", "int": "i4", "unsigned_long": "u8", "long": "i8",
    "vtktypeint64": "i8", "vtktypeuint64": "u8", "vtkidtype": "i4", "float": "f4", "double": "f8",
}  # fmt: skip
"""Numbers by VTK's names; vtkIdType is written as int."""
MESH = ("POINTS", "CELLS", "CELL_TYPES")
COLUMNS = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6, "GLOBAL_IDS": 1}
COLUMNS |= {"PEDIGREE_IDS": 1, "EDGE_FLAGS": 1}
"""Attributes of points and cells told by a name and a kind of numbers, and their columns."""


def read_vtk(path: Path) -> MeshContent:
    """Read an unstructured grid with its arrays ``set:NAME``.

    VTK writes a blank in a name as %20, a percent sign as %25, and so on.

    Parameters
    ----------
    path
        Version 1 to 5, ASCII or binary.

    Raises
    ------
    ModelError
        If it is not such a file, is cut off, has two arrays of one name, or ghosts.

    References
    ----------
    *VTK file formats*, https://docs.vtk.org/en/latest/vtk_file_formats/vtk_legacy_file_format.html.
    """
    return _Legacy(path, path.read_bytes()).content()


@dataclass
class _Legacy:
    """A legacy file, read from its beginning on."""

    path: Path
    whole: bytes
    at: int = 0
    binary: bool = False
    new: bool = False  # of version 5: cells as a list of nodes and one of where cells begin
    met: set[str] = field(default_factory=set)
    count: int | None = None  # of points or cells, in the section of data that is read
    points: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    nodes: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    ends: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    types: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    data: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    section: str = ""

    def content(self) -> MeshContent:
        try:
            self._header()
            while (words := self._words()) is not None:
                self._take(*words)
            cells = (self.nodes, self.ends, self.types)
            data = [self.data.get(f"{what}_DATA", {}) for what in ("POINT", "CELL")]
            return content_of(self.points, cells, data[0], data[1], str(self.path))
        except KeyError as error:
            raise ModelError(
                f"{self.path}: holds numbers of the type {error}, which are not read of VTK legacy"
                " files; save it as '.vtu'"
            ) from error
        except (ValueError, IndexError, OverflowError, TypeError) as error:
            if isinstance(error, ModelError):
                raise
            raise ModelError(
                f"{self.path}: is cut off, or holds what is not read of VTK legacy files"
                f" ({reason_of(error)}); save it as '.vtu'"
            ) from error

    def _header(self) -> None:
        version = self._line()
        if not version.startswith("# vtk DataFile Version"):
            raise ValueError("it does not begin as one")
        self.new = int(version.split()[-1].split(".")[0]) >= 5
        self._line()  # a title
        form = self._line().strip().upper()
        if form not in ("ASCII", "BINARY"):
            raise ValueError(f"it is neither ASCII nor BINARY, but {form[:20]!r}")
        self.binary = form == "BINARY"
        words = [word.upper() for word in self._words() or []]
        kind = " ".join(words[1:])
        if words[:1] != ["DATASET"]:
            raise ValueError(f"{' '.join(words)[:40]!r} stands where DATASET is due")
        if kind != "UNSTRUCTURED_GRID":
            raise ModelError(
                f"{self.path}: holds {kind}, no unstructured grid;"
                " pyvista.read(file).cast_to_unstructured_grid().save('mesh.vtu') makes it one"
            )

    def _take(self, keyword: str, *words: str) -> None:
        """What a line announces."""
        keyword = keyword.upper()
        readers: dict[str, Callable[..., None]] = {
            "POINTS": self._points,
            "CELLS": self._cells,
            "CELL_TYPES": self._types,
            "FIELD": self._field,
            "SCALARS": self._scalars,
            "COLOR_SCALARS": self._colours,
            "LOOKUP_TABLE": self._table,
            "TEXTURE_COORDINATES": self._places,
            "METADATA": self._metadata,
        }
        if keyword in ("POINT_DATA", "CELL_DATA"):
            self.section, self.count = keyword, int(words[0])
        elif keyword in COLUMNS:
            self._array(words[0], words[1], self._rows(), COLUMNS[keyword])
        elif keyword in readers:
            if keyword in MESH:
                if keyword in self.met:
                    raise ValueError(f"{keyword} stands twice")
                self.met.add(keyword)
            readers[keyword](*words)
        else:
            raise ValueError(f"{keyword[:40]!r} is not understood")

    def _points(self, count: str, kind: str) -> None:
        self.points = self._numbers(kind, 3 * int(count)).reshape(-1, 3)

    def _cells(self, count: str, size: str) -> None:
        if not self.new:
            self._cells_with_their_sizes(int(count), self._numbers("int", int(size)))
            return
        begins, nodes = (self._told(word, int(n)) for word, n in
                         (("OFFSETS", count), ("CONNECTIVITY", size)))  # fmt: skip
        if len(begins) and begins[0] != 0:
            raise ValueError("its first cell does not begin with its first node")
        self.nodes, self.ends = nodes, begins[1:]

    def _told(self, keyword: str, count: int) -> IntArray:
        words = self._words() or [""]
        if words[0].upper() != keyword:
            raise ValueError(f"{keyword} is expected, but {words[0][:40]!r} is there")
        return self._numbers(words[1], count).astype(np.int64)

    def _cells_with_their_sizes(self, count: int, numbers: IntArray) -> None:
        """Cells of versions before 5: the number of its nodes, and then these."""
        found: list[int] = []
        at = 0
        for _ in range(count):
            found.append(int(numbers[at]))
            if found[-1] < 0:
                raise ValueError("a cell has a negative number of nodes")
            at += 1 + found[-1]
        if at != len(numbers):
            raise ValueError("its cells do not end where their nodes do")
        sizes = np.array(found, dtype=np.int64)
        self.ends = np.cumsum(sizes)
        heads = self.ends - sizes + np.arange(count)
        self.nodes = np.delete(numbers, heads).astype(np.int64)

    def _types(self, count: str) -> None:
        self.types = self._numbers("int", int(count)).astype(np.int64)

    def _field(self, name: str, count: str) -> None:
        for _ in range(int(count)):
            words = self._words() or []
            if words[:1] == ["METADATA"]:
                self._metadata()
                words = self._words() or []
            name, columns, rows, kind = words
            if kind.lower() == "string":
                self._pass_texts(int(rows) * int(columns))
            else:
                self._array(name, kind, int(rows), int(columns))

    def _pass_texts(self, count: int) -> None:
        """Texts, one in a line; in a binary file after its length, in 6, 14, 30 or 62 bits."""
        for _ in range(count):
            if self.binary:
                width = 1 << (3 - (self.whole[self.at] >> 6))
                length = int.from_bytes(self.whole[self.at : self.at + width])
                self.at += width + (length & ((1 << (8 * width - 2)) - 1))
            else:
                self._line()

    def _scalars(self, name: str, kind: str, columns: str = "1") -> None:
        at, words = self.at, self._words() or [""]
        if words[0].upper() != "LOOKUP_TABLE":
            self.at = at
        self._array(name, kind, self._rows(), int(columns))

    def _colours(self, name: str, columns: str) -> None:
        self._keep(name, self._shades(self._rows() * int(columns)), self._rows(), int(columns))

    def _table(self, name: str, count: str) -> None:
        self._shades(4 * int(count))

    def _shades(self, count: int) -> np.ndarray:
        """Bytes; in ASCII they are written as parts of 255."""
        if self.binary:
            return self._numbers("unsigned_char", count)
        return np.rint(255.0 * self._numbers("double", count))

    def _places(self, name: str, columns: str, kind: str) -> None:
        self._array(name, kind, self._rows(), int(columns))

    def _metadata(self) -> None:
        while self._line().strip():
            pass

    def _rows(self) -> int:
        if self.count is None:
            raise ValueError("an array is of neither points nor cells")
        return self.count

    def _array(self, name: str, kind: str, rows: int, columns: int) -> None:
        self._keep(name, self._numbers(kind, rows * columns), rows, columns)

    def _keep(self, coded: str, values: np.ndarray, rows: int, columns: int) -> None:
        """Keep an array of the present section if it says something of the mesh."""
        name = unquote(coded.replace("%%", "%"))  # as VTK 9.4 writes names of colours
        if is_needed(name) and self.section:
            known = self.data.setdefault(self.section, {})
            check_each_once([*known, name], str(self.path))
            known[name] = values.reshape(rows, columns)

    def _line(self) -> str:
        end = self.whole.find(b"\n", self.at)
        end = len(self.whole) if end < 0 else end
        line, self.at = self.whole[self.at : end], end + 1
        return line.decode("utf-8")

    def _words(self) -> list[str] | None:
        """The words of the next line that has some; None at the end."""
        while self.at < len(self.whole):
            if words := self._line().split():
                return words
        return None

    def _numbers(self, kind: str, count: int) -> np.ndarray:
        """So many numbers from the next line on."""
        code = KINDS[kind.lower()]
        if count < 0:
            raise ValueError("a number of values is negative")
        if not self.binary:
            return self._written(count, code)
        end = self.at + count * np.dtype(code).itemsize
        if end > len(self.whole):
            raise ValueError(f"{count} numbers are declared, but the file ends before")
        found = np.frombuffer(self.whole[self.at : end], f">{code}").astype(code)
        self.at = end
        return found

    def _written(self, count: int, code: str) -> np.ndarray:
        """Numbers of whole lines."""
        words: list[str] = []
        while len(words) < count:
            more = self._words()
            if more is None:
                raise ValueError(f"{count} numbers are declared, but {len(words)} are there")
            words += more
        if len(words) > count:
            raise ValueError(f"a line goes on after the {count} numbers that are declared")
        return np.array(words, dtype="S").astype(code) if words else np.zeros(0, code)
