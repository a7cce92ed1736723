"""Matrices in Nastran's punch files: DMIG entries."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cms.base.errors import ReductionError
from cms.files.file_entries import chosen_entry

IntArray = NDArray[np.int64]
SYMMETRIC, REAL = 6, (1, 2)


def read_punch(path: Path, name: str | None) -> tuple[IntArray, IntArray, NDArray[np.float64]]:
    """Read a symmetric real DMIG: grid points and components of rows and columns, and values.

    Returns
    -------
    rows, columns : (m, 2) array of int
        Grid point, and component 1 to 6 (1 for a scalar point's 0).
    values : (m,) array
        Entries.

    Raises
    ------
    ReductionError
        If there is no such matrix, or it is not symmetric and real.
    """
    with path.open(encoding="latin-1") as file:
        lines = [line.rstrip("\n") for line in file if line[:4] == "DMIG" or line[:1] == "*"]
    headers = {_field(line, 8, 8): line for line in lines if _is_header(line)}
    name = chosen_entry(path, headers, name, ("matrix", "matrices"), "KAAX")
    form, kind = (int(_field(headers[name], place, 8)) for place in (24, 32))
    if form != SYMMETRIC or kind not in REAL:
        raise ReductionError(f"matrix {name} must be symmetric (6) and real (1 or 2)")
    return _entries(lines, name)


def _is_header(line: str) -> bool:
    return line[:8].strip() == "DMIG" and _field(line, 16, 8) == "0"


def _entries(lines: list[str], name: str) -> tuple[IntArray, IntArray, NDArray[np.float64]]:
    rows, columns, values = [], [], []
    column: tuple[int, int] | None = None
    for line in lines:
        if _is_header(line):
            column = None
        elif line[:5] == "DMIG*":
            ours = _field(line, 8, 16) == name
            column = (int(_field(line, 24, 16)), int(_field(line, 40, 16))) if ours else None
        elif line[:4] == "DMIG":
            raise ReductionError("has DMIG in fields of 8 letters; fields of 16 (DMIG*) are read")
        elif column is not None:
            rows.append((int(_field(line, 8, 16)), int(_field(line, 24, 16))))
            columns.append(column)
            values.append(float(_field(line, 40, 16).upper().replace("D", "E")))
    if not values:
        raise ReductionError(f"matrix {name} has no entries")
    labels = np.array([rows, columns], dtype=np.int64)
    labels[:, :, 1] = np.maximum(labels[:, :, 1], 1)
    return labels[0], labels[1], np.array(values)


def _field(line: str, start: int, width: int) -> str:
    return line[start : start + width].strip()
