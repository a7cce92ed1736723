"""Kinds of cells: scikit-fem's basis and quadrature in the node order of meshio and VTK."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from fem.mesh import FloatArray, IntArray

SEGMENT = np.array([[0.0], [1.0]])
TRIANGLE = np.array([[0, 0], [1, 0], [0, 1]], dtype=np.float64)
SQUARE = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float64)
TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
CUBE = np.vstack([np.insert(SQUARE, 2, z, axis=1) for z in (0.0, 1.0)])

TRIANGLE_EDGES = ((0, 1), (1, 2), (2, 0))
SQUARE_EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
TETRAHEDRON_EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
CUBE_EDGES = (*SQUARE_EDGES, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
CUBE_FACES = ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7))

SPANS = {"line": ((0, 1),), "line3": ((0, 2), (2, 1))}
"""How a line of a kind is cut into straight pieces with two nodes."""


@dataclass(frozen=True)
class CellKind:
    """A kind of cell.

    Parameters
    ----------
    name
        meshio's name, such as "hexahedron20".
    element
        scikit-fem's element of the same shape functions.
    order
        Order of the shape functions, 1 or 2.
    integration_order
        Polynomial order that is integrated exactly, for stiffness and mass.
    corners
        Places of the corner nodes in the reference cell, shape (c, d).
    edges
        Pairs of corners in the order of the nodes in the middle of the edges.
    facets
        Local nodes of each face (in 3-D) or edge (in 2-D), in the order of `facet_kind`.
    facet_kind
        meshio's name of the facets.
    """

    name: str
    element: skfem.Element
    order: int
    integration_order: int
    corners: FloatArray
    edges: tuple[tuple[int, int], ...]
    facets: tuple[tuple[int, ...], ...]
    facet_kind: str

    @property
    def dimension(self) -> int:
        """1 for lines, 2 for triangles and quadrilaterals, 3 for tetrahedra and hexahedra."""
        return int(self.corners.shape[1])

    @property
    def node_count(self) -> int:
        """Number of nodes of one cell."""
        return len(self.basis_order)

    @cached_property
    def nodes(self) -> FloatArray:
        """Places of all nodes in the reference cell, in meshio's order, shape (b, d)."""
        places = self.corners
        if self.order == 2:
            middles = [self.corners[list(edge)].mean(axis=0) for edge in self.edges]
            places = np.vstack([places, middles])
        count = len(self.element.doflocs)
        if count == len(places) + 1:
            places = np.vstack([places, self.corners.mean(axis=0)])
        if count == len(places) + 7:
            centres = [self.corners[list(CUBE_FACES[i])].mean(axis=0) for i in (5, 3, 2, 4, 0, 1)]
            places = np.vstack([places, centres, self.corners.mean(axis=0)])
        return places

    @cached_property
    def basis_order(self) -> IntArray:
        """Index of scikit-fem's basis function that belongs to each node, shape (b,)."""
        places = np.asarray(self.element.doflocs, dtype=np.float64)
        distance = np.abs(self.nodes[:, None, :] - places[None, :, :]).max(axis=2)
        assert (distance.min(axis=1) < 1e-12).all(), self.name
        return np.asarray(distance.argmin(axis=1), dtype=np.int64)

    @cached_property
    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Places (q, d) and weights (q,) in the reference cell."""
        places, weights = get_quadrature(self.element, self.integration_order)
        return np.ascontiguousarray(places.T), weights

    def basis(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Shape functions and their reference gradients, (q, b) and (q, b, d), at places (q, d)."""
        at = np.ascontiguousarray(places.T)
        values, gradients = [], []
        for index in self.basis_order:
            value, gradient = self.element.lbasis(at, int(index))
            values.append(np.broadcast_to(value, len(places)))
            gradients.append(np.broadcast_to(np.asarray(gradient), at.shape))
        return np.stack(values, axis=1), np.stack(gradients, axis=0).transpose(2, 0, 1)


def _facets(
    corners: tuple[tuple[int, ...], ...], edges: tuple[tuple[int, int], ...], first: int
) -> tuple[tuple[int, ...], ...]:
    """Corners of the facets followed by the nodes in the middle of their edges."""
    middle = {frozenset(edge): first + i for i, edge in enumerate(edges)}
    found = []
    for facet in corners:
        around = zip(facet, facet[1:] + facet[:1], strict=True) if len(facet) > 2 else [facet]
        found.append(facet + tuple(middle[frozenset(pair)] for pair in around))
    return tuple(found)


TETRAHEDRON_FACES = tuple(combinations(range(4), 3))

KINDS: dict[str, CellKind] = {
    kind.name: kind
    for kind in (
        CellKind("line", skfem.ElementLineP1(), 1, 2, SEGMENT, ((0, 1),), (), ""),
        CellKind("line3", skfem.ElementLineP2(), 2, 4, SEGMENT, ((0, 1),), (), ""),
        CellKind("triangle", skfem.ElementTriP1(), 1, 2, TRIANGLE, TRIANGLE_EDGES,
                 TRIANGLE_EDGES, "line"),
        CellKind("triangle6", skfem.ElementTriP2(), 2, 4, TRIANGLE, TRIANGLE_EDGES,
                 _facets(TRIANGLE_EDGES, TRIANGLE_EDGES, 3), "line3"),
        CellKind("quad", skfem.ElementQuad1(), 1, 2, SQUARE, SQUARE_EDGES, SQUARE_EDGES, "line"),
        CellKind("quad8", skfem.ElementQuadS2(), 2, 4, SQUARE, SQUARE_EDGES,
                 _facets(SQUARE_EDGES, SQUARE_EDGES, 4), "line3"),
        CellKind("quad9", skfem.ElementQuad2(), 2, 4, SQUARE, SQUARE_EDGES,
                 _facets(SQUARE_EDGES, SQUARE_EDGES, 4), "line3"),
        CellKind("tetra", skfem.ElementTetP1(), 1, 2, TETRAHEDRON, TETRAHEDRON_EDGES,
                 TETRAHEDRON_FACES, "triangle"),
        CellKind("tetra10", skfem.ElementTetP2(), 2, 4, TETRAHEDRON, TETRAHEDRON_EDGES,
                 _facets(TETRAHEDRON_FACES, TETRAHEDRON_EDGES, 4), "triangle6"),
        CellKind("hexahedron", skfem.ElementHex1(), 1, 2, CUBE, CUBE_EDGES, CUBE_FACES, "quad"),
        CellKind("hexahedron20", skfem.ElementHexS2(), 2, 4, CUBE, CUBE_EDGES,
                 _facets(CUBE_FACES, CUBE_EDGES, 8), "quad8"),
        CellKind("hexahedron27", skfem.ElementHex2(), 2, 4, CUBE, CUBE_EDGES,
                 tuple((*f, c) for f, c in zip(_facets(CUBE_FACES, CUBE_EDGES, 8),
                                                (24, 25, 22, 21, 23, 20), strict=True)), "quad9"),
    )
}  # fmt: skip
"""All kinds by name. A hexahedron27 has its face nodes in the order of VTK: -x, +x, -y, +y, -z,
+z, then the middle."""
