"""Springs and dampers between two points, as terms of their elongation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from scipy import sparse

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.elements.scatter import SparseArray
from fem.mesh.attachments import Link

Term = tuple[str, str, float]


class PlacedNodes(Protocol):
    """What is needed of a mesh: where its named points are."""

    @property
    def source(self) -> str: ...
    @property
    def points(self) -> FloatArray: ...
    def node(self, name: str) -> int: ...


def link_terms(mesh: PlacedNodes, link: Link) -> list[Term]:
    """The elongation of a link as (point, direction, coefficient).

    Raises
    ------
    ModelError
        If a link without directions is between two points at one place.

    Examples
    --------
    >>> import fem
    >>> mesh = fem.frame_mesh({"a": (0, 0), "b": (3, 4)}, [("rod", "a", "b", 1)])
    >>> link_terms(mesh, Link("a", "b", stiffness=1.0))[:2]
    [('a', 'x', 0.6), ('a', 'y', 0.8)]
    """
    if link.directions is not None:
        signed = zip(link.points, link.directions, (1.0, -1.0), strict=False)
        return [(point, direction, sign) for point, direction, sign in signed]
    first, second = (mesh.points[mesh.node(point)] for point in link.points)
    length = float(np.linalg.norm(first - second))
    if length == 0.0:
        raise ModelError(
            f"{mesh.source}: the link between {link.first!r} and {link.second!r} has no length and"
            " so no direction; give a spring with directions"
        )
    along = (second - first) / length
    return [
        (point, axis, sign * float(part))
        for point, sign in zip(link.points, (1.0, -1.0), strict=True)
        for axis, part in zip("xyz", along, strict=True)
        if part
    ]


def link_rows(
    mesh: PlacedNodes, links: Sequence[Link], size: int, dof: Callable[[str, str], int]
) -> tuple[SparseArray, FloatArray, FloatArray]:
    """Elongations (m, size) of links, and their stiffness and damping, shape (m,).

    Parameters
    ----------
    mesh
        Where the named points are.
    links
        Springs and dampers between two points or directions.
    size
        Number of degrees of freedom.
    dof
        The degree of freedom of a point and a direction.
    """
    rows, columns, values = [], [], []
    for row, link in enumerate(links):
        for point, direction, value in link_terms(mesh, link):
            rows.append(row)
            columns.append(dof(point, direction))
            values.append(value)
    shape = len(links), size
    elongations = sparse.csr_array((np.array(values, dtype=np.float64), (rows, columns)), shape)
    stiffness, damping = np.array([(k.stiffness, k.damping) for k in links]).reshape(-1, 2).T
    return elongations, stiffness, damping
