"""Assembled real matrices in Harwell-Boeing's format, symmetric ones included."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from cms.base.errors import ReductionError
from cms.files.triangles import mirrored

KIND = re.compile(r"[RCP][SUHZR][AE]", re.IGNORECASE)
FORMAT = re.compile(r"\(\s*(?:\d+P\s*,?\s*)?(\d*)\s*[IEDFG]\s*(\d+)", re.IGNORECASE)


def is_harwell_boeing(head: list[str]) -> bool:
    """Whether the first three lines of a file are those of this format."""
    return len(head) > 2 and bool(KIND.fullmatch(head[2][:14].strip()))


def read_harwell_boeing(path: Path) -> sparse.csc_array[np.float64]:
    """Read an assembled real matrix (n, m), its second triangle filled in where it is symmetric.

    Right-hand sides are left out. The format is that of Duff, Grimes and Lewis (1992), Users'
    guide for the Harwell-Boeing sparse matrix collection.

    Raises
    ------
    ReductionError
        If the matrix is complex, a pattern or not assembled, or the file ends too early.
    """
    with path.open(encoding="latin-1") as file:
        file.readline()
        counts = [int(word) for word in file.readline().split()]
        third, formats = file.readline(), file.readline()
        kind = third[:14].strip().upper()
        if kind not in ("RSA", "RUA", "RRA"):
            raise ReductionError(f"is of the kind {kind}; real, assembled ones (RSA, RUA) are read")
        rows, columns, entries = (int(word) for word in third[14:].split()[:3])
        if len(counts) > 4 and counts[4] > 0:
            file.readline()
        fields = FORMAT.findall(formats)
        if len(fields) < 3:
            raise ReductionError("does not tell the formats of its numbers in line 4")
        widths = [int(width) for _, width in fields]
        starts = _fields(file, columns + 1, widths[0]).astype(np.int64) - 1
        places = _fields(file, entries, widths[1]).astype(np.int64) - 1
        values = _fields(file, entries, widths[2])
    matrix = sparse.csc_array((values, places, starts), shape=(rows, columns))
    matrix.check_format(full_check=True)
    return matrix if kind != "RSA" else mirrored(matrix)


def _fields(file: TextIO, count: int, width: int) -> NDArray[np.float64]:
    """The next numbers of a file (count,), each in a field of some letters."""
    found: list[str] = []
    while len(found) < count:
        line = file.readline()
        if not line:
            raise ReductionError("ends before all its numbers")
        line = line.rstrip().upper().replace("D", "E")
        found.extend(line[k : k + width] for k in range(0, len(line), width))
    return np.array(found[:count], dtype=np.float64)
