"""Cells that stand twice in a mesh: their stiffness and mass would count twice."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.cell_checks import cell_at


def check_no_doubles(
    source: str, points: FloatArray, kind: str, numbers: IntArray, cells: Mapping[str, IntArray]
) -> None:
    """Refuse cells of one kind with the same nodes, in whatever order.

    Parameters
    ----------
    source
        Where the mesh comes from.
    points
        Coordinates in m, shape (n, 3).
    kind, numbers
        Which cells must be different ones.
    cells
        Node indices (e, b) of all cells by kind.

    Raises
    ------
    ModelError
        With how many there are, and the numbers and the place of the first.

    Examples
    --------
    >>> lines = {"line": np.array([[0, 1], [1, 0]])}
    >>> check_no_doubles("m", np.zeros((2, 3)), "line", np.arange(2), lines)
    Traceback (most recent call last):
        ...
    fem.base.errors.ModelError: m: line 1 at (0, 0, 0) stands twice, also as line 0 (1 such cells)
    """
    nodes = cells[kind][numbers]
    _, first, inverse = np.unique(
        np.sort(nodes, axis=1), axis=0, return_index=True, return_inverse=True
    )
    original = first[inverse.ravel()]
    again = np.flatnonzero(original != np.arange(len(nodes)))
    if len(again):
        place = cell_at(kind, int(numbers[again[0]]), points[nodes[again[0]]])
        raise ModelError(
            f"{source}: {place} stands twice, also as {kind} {numbers[original[again[0]]]}"
            f" ({len(again)} such cells)"
        )
