"""Places of a mesh by coordinates or by a box, where its file has no names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.attachments import vector
from fem.mesh.pieces import place_of

NEAR = 1e-6
"""How far a node may be from the place asked for, relative to the size of the mesh."""


def node_at(
    points: FloatArray, place: Sequence[float], source: str, tolerance: float | None = None
) -> IntArray:
    """The one node at a place, as an array of one index.

    Parameters
    ----------
    points
        Coordinates in m, shape (n, 3).
    place
        (x, y, z) in m.
    source
        Where the mesh comes from.
    tolerance
        In m; by default 1e-6 of the size of the mesh.

    Raises
    ------
    ModelError
        If no node is so near, which names the nearest one, or several are.

    Examples
    --------
    >>> node_at(np.eye(3), (0.0, 1.0, 0.0), "mesh")
    array([1])
    """
    wanted = np.array(vector(f"{source}: a place", place, 3))
    away = np.linalg.norm(points - wanted, axis=1)
    near = NEAR * float(np.ptp(points, axis=0).max()) if tolerance is None else tolerance
    found = np.flatnonzero(away <= near)
    if len(found) == 1:
        return found
    nearest = int(np.argmin(away))
    if not len(found):
        raise ModelError(
            f"{source}: no node is at {place_of(wanted)}; the nearest one, at"
            f" {place_of(points[nearest])}, is {away[nearest]:.3g} m away"
        )
    raise ModelError(f"{source}: {len(found)} nodes are at {place_of(wanted)}")


def nodes_inside(points: FloatArray, box: Sequence[Sequence[float]], source: str) -> IntArray:
    """The nodes in a box, its sides included.

    Parameters
    ----------
    points
        Coordinates in m, shape (n, 3).
    box
        The corners with the lowest and with the highest coordinates, in m.
    source
        Where the mesh comes from.

    Raises
    ------
    ModelError
        If the box is turned round or holds no node.

    Examples
    --------
    >>> nodes_inside(np.eye(3), ((0.0, 0.0, 0.0), (1.0, 0.5, 0.5)), "mesh")
    array([0])
    """
    low, high = (np.array(vector(f"{source}: a corner of a box", each, 3)) for each in box)
    if (low > high).any():
        raise ModelError(f"{source}: the box from {place_of(low)} to {place_of(high)} is empty")
    slack = NEAR * float(np.ptp(points, axis=0).max())
    found = np.flatnonzero(((points >= low - slack) & (points <= high + slack)).all(axis=1))
    if not len(found):
        raise ModelError(
            f"{source}: no node is in the box from {place_of(low)} to {place_of(high)}; the nodes"
            f" lie from {place_of(points.min(axis=0))} to {place_of(points.max(axis=0))}"
        )
    return found
