"""Rows of numbers that grow in number."""

from __future__ import annotations

import numpy as np

from nldyn.base.arrays import Real


class Rows:
    """A growing array: what was given out of it keeps its length and shares its memory.

    Parameters
    ----------
    width : int
        Of each row.
    """

    def __init__(self, width: int) -> None:
        self._rows = np.empty((16, width))
        self._count = 0

    def add(self, row: Real) -> None:
        """Append a row (width,)."""
        if self._count == len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self._count] = row
        self._count += 1

    def so_far(self) -> Real:
        """All rows, (m, width)."""
        return self._rows[: self._count]
