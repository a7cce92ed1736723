"""Whether the nodes of cells are where their kind has them."""

from __future__ import annotations

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.cells import KINDS

NO_LENGTH = 1e-12  # of the mesh: an edge so short has lost its direction
OFF_MIDDLE = 0.35  # of an edge: farther off, a node is not the middle one that its place says


def check_cells(source: str, kind: str, cells: IntArray, points: FloatArray) -> None:
    """Refuse cells of a known kind with a node twice, two at one place, or others out of place.

    Parameters
    ----------
    source
        Where the mesh comes from; error texts begin with it.
    kind
        A key of `KINDS`.
    cells
        Node indices, shape (e, b).
    points
        Coordinates in m, shape (n, 3).

    Raises
    ------
    ModelError
        By the number and place of the first such cell, and how many there are.

    Examples
    --------
    >>> check_cells("mesh", "triangle", np.array([[0, 1, 2]]), np.eye(3))
    """
    own = KINDS[kind]
    _check_once(source, kind, cells, points)
    if own.dimension > 1:
        _check_lengths(source, kind, cells, points)
    if own.order == 2:
        _check_middles(source, kind, cells, points)
    if own.centres:
        _check_centres(source, kind, cells, points)


def cell_at(kind: str, number: int, coordinates: FloatArray) -> str:
    """A cell by its kind, number and place, for error texts; ``coordinates`` are its nodes'.

    Examples
    --------
    >>> cell_at("line", 4, np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 2.0]]))
    'line 4 at (0.5, 0, 1)'
    """
    x, y, z = coordinates.mean(axis=0)
    return f"{kind} {number} at ({x:.6g}, {y:.6g}, {z:.6g})"


def has_repeated_nodes(cells: IntArray) -> np.ndarray:
    """Which of the cells (e, b) name a node twice, shape (e,)."""
    ordered = np.sort(cells, axis=1)
    return np.asarray((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))


def _check_once(source: str, kind: str, cells: IntArray, points: FloatArray) -> None:
    twice = np.flatnonzero(has_repeated_nodes(cells))
    if len(twice):
        first = cell_at(kind, twice[0], points[cells[twice[0]]])
        raise ModelError(f"{source}: {first} has a node twice ({len(twice)} such cells)")


def _check_lengths(source: str, kind: str, cells: IntArray, points: FloatArray) -> None:
    """Edges must have a length; those of beams are looked at in their model."""
    edges = np.array(KINDS[kind].edges)
    ends = points[cells[:, edges]]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    bad = np.argwhere(length <= NO_LENGTH * float(np.ptp(points, axis=0).max()))
    if len(bad):
        cell, edge = bad[0]
        one, other = cells[cell, edges[edge]]
        raise ModelError(
            f"{source}: {cell_at(kind, cell, points[cells[cell]])} has its nodes {one} and {other}"
            f" at one place ({len(set(bad[:, 0]))} such cells); make them one node"
        )


def _check_middles(source: str, kind: str, cells: IntArray, points: FloatArray) -> None:
    """Nodes between corners must be nearer to the middle than to either end."""
    edges = np.array(KINDS[kind].edges)
    ends = points[cells[:, edges]]
    first = len(KINDS[kind].corners)
    middle = points[cells[:, first : first + len(edges)]]
    off = np.linalg.norm(middle - ends.mean(axis=2), axis=2)
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    bad = np.flatnonzero((off > OFF_MIDDLE * length).any(axis=1))
    if len(bad):
        cell = cell_at(kind, bad[0], points[cells[bad[0]]])
        raise ModelError(
            f"{source}: the nodes on the edges of {cell} are not near the middle of their edges"
            f" ({len(bad)} such cells): they are badly curved, or in another order than that of"
            " the file's format"
        )


def _check_centres(source: str, kind: str, cells: IntArray, points: FloatArray) -> None:
    """Nodes in the middle of faces must be nearer to their own place than to any other."""
    own = KINDS[kind]
    first = own.node_count - len(own.centres)
    places = points[cells].copy()
    for number, corners in enumerate(own.centres, start=first):
        edges = [i for i, ends in enumerate(own.edges) if set(ends) <= set(corners)]
        middles = points[cells[:, len(own.corners) + np.array(edges)]].sum(axis=1)
        ends = points[cells[:, list(corners)]].sum(axis=1)
        # what the functions of 8 nodes on a face, of 20 in a cube, are in its middle
        places[:, number] = middles * (0.5 if len(corners) == 4 else 0.25) - ends / 4.0
    there = points[cells[:, first:]]
    nearest = np.linalg.norm(there[:, :, None] - places[:, None], axis=3).argmin(axis=2)
    bad = np.flatnonzero((nearest != np.arange(first, own.node_count)).any(axis=1))
    if len(bad):
        cell = cell_at(kind, bad[0], points[cells[bad[0]]])
        raise ModelError(
            f"{source}: the nodes on the faces of {cell} are not in the middle of their faces"
            f" ({len(bad)} such cells; they must be in the order of VTK)"
        )
