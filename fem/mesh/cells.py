"""Kinds of cells: shape functions and quadrature in VTK's order of nodes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from fem.base.arrays import FloatArray, IntArray
from fem.mesh.wedges import (
    PYRAMID_TERMS,
    WEDGE_TERMS,
    NodalElement,
    Rule,
    Term,
    pyramid_rule,
    wedge_rule,
)

SPANS = {"line": ((0, 1),), "line3": ((0, 2), (2, 1))}
"""How a line of a kind is cut into straight pieces with two nodes."""

FACET_KINDS = {
    (2, 2): "line",
    (2, 3): "line3",
    (3, 3): "triangle",
    (3, 6): "triangle6",
    (4, 4): "quad",
    (4, 8): "quad8",
    (4, 9): "quad9",
}
"""Kinds of facets by their numbers of corners and of nodes."""
SAME_PLACE = 1e-12  # distance of a node and a place of the unit cell that are one

Indices = tuple[tuple[int, ...], ...]


@dataclass(frozen=True, eq=False)
class Shape:
    """A reference cell.

    Parameters
    ----------
    corners
        Places of the corners, shape (c, d).
    edges
        Pairs of corners, in the order of the nodes in the middle of the edges.
    faces
        Corners of each face (in 3-D) or edge (in 2-D), one after the other around it. Those of
        hexahedra, wedges and pyramids are in the order in which Abaqus numbers them.
    """

    corners: FloatArray
    edges: Indices
    faces: Indices = ()

    @property
    def dimension(self) -> int:
        """1 for lines, 2 for triangles and quadrilaterals, 3 for the others."""
        return int(self.corners.shape[1])


_RIM3 = ((0, 1), (1, 2), (2, 0))
_RIM4 = ((0, 1), (1, 2), (2, 3), (3, 0))
_FLAT3 = np.array([[0, 0], [1, 0], [0, 1]], dtype=np.float64)
_FLAT4 = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=np.float64)


def _raised(flat: FloatArray) -> FloatArray:
    return np.vstack([np.insert(flat, 2, z, axis=1) for z in (0.0, 1.0)])


SEGMENT = Shape(np.array([[0.0], [1.0]]), ((0, 1),))
TRIANGLE = Shape(_FLAT3, _RIM3, _RIM3)
SQUARE = Shape(_FLAT4, _RIM4, _RIM4)
TETRAHEDRON = Shape(
    np.vstack([np.zeros(3), np.eye(3)]),
    (*_RIM3, (0, 3), (1, 3), (2, 3)),
    ((0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)),
)
CUBE = Shape(
    _raised(_FLAT4),
    (*_RIM4, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
    ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
)
WEDGE = Shape(
    _raised(_FLAT3),
    (*_RIM3, (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
)
PYRAMID = Shape(
    np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0], [0, 0, 1]], dtype=np.float64),
    (*_RIM4, (0, 4), (1, 4), (2, 4), (3, 4)),
    ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
)


@dataclass(frozen=True, eq=False)
class CellKind:
    """A kind of cell.

    Parameters
    ----------
    name
        As meshio names it, such as "hexahedron20".
    element
        scikit-fem's element of the same shape functions, or a `NodalElement`.
    order
        Order of the shape functions, 1 or 2.
    integration_order
        Polynomial order that is integrated exactly, for stiffness and mass.
    shape
        The reference cell.
    centres
        Corners in the middle of which the nodes lie that come after those on the edges.
    """

    name: str
    element: skfem.Element
    order: int
    integration_order: int
    shape: Shape
    centres: Indices = ()

    @property
    def dimension(self) -> int:
        """1 for lines, 2 for triangles and quadrilaterals, 3 for the others."""
        return self.shape.dimension

    @property
    def corners(self) -> FloatArray:
        """Places of the corner nodes in the reference cell, shape (c, d)."""
        return self.shape.corners

    @property
    def edges(self) -> Indices:
        """Pairs of corners in the order of the nodes in the middle of the edges."""
        return self.shape.edges

    @property
    def of_first_order(self) -> CellKind:
        """The kind of the same shape whose only nodes are the corners."""
        return next(kind for kind in KINDS.values() if kind.order == 1 and kind.shape is self.shape)

    @property
    def node_count(self) -> int:
        """Number of nodes of one cell."""
        return len(self.nodes)

    @cached_property
    def nodes(self) -> FloatArray:
        """Places of all nodes in the reference cell, in VTK's order, shape (b, d)."""
        return self.filled(self.corners)

    def filled(self, corners: FloatArray) -> FloatArray:
        """All nodes (..., b, d) of cells with straight edges from their corners (..., c, d).

        Examples
        --------
        >>> KINDS["line3"].filled(np.array([[0.0], [4.0]])).ravel()
        array([0., 4., 2.])
        """
        return _filled(corners, self.edges if self.order == 2 else (), self.centres)

    @cached_property
    def facets(self) -> dict[str, IntArray]:
        """Local nodes (f, k) of the faces (in the plane: edges), by the kind that they are."""
        middle = {frozenset(edge): n for n, edge in enumerate(self.edges, len(self.corners))}
        first = self.node_count - len(self.centres)
        centre = {frozenset(corners): n for n, corners in enumerate(self.centres, first)}
        found: dict[str, list[tuple[int, ...]]] = {}
        for face in self.shape.faces:
            around = zip(face, face[1:] + face[:1], strict=True) if len(face) > 2 else [face]
            local = face
            if self.order == 2:
                local += tuple(middle[frozenset(pair)] for pair in around)
            if len(face) > 2 and frozenset(face) in centre:
                local += (centre[frozenset(face)],)
            found.setdefault(FACET_KINDS[len(face), len(local)], []).append(local)
        return {kind: np.array(nodes, dtype=np.int64) for kind, nodes in found.items()}

    def facets_of(self, cells: IntArray) -> dict[str, IntArray]:
        """Nodes (f, k) of all facets of cells (e, b), by the kind that they are.

        Examples
        --------
        >>> facets = KINDS["wedge"].facets_of(np.arange(6)[None])
        >>> {kind: nodes.shape for kind, nodes in facets.items()}
        {'triangle': (2, 3), 'quad': (3, 4)}
        """
        return {
            kind: cells[:, local].reshape(-1, local.shape[1]) for kind, local in self.facets.items()
        }

    @cached_property
    def basis_order(self) -> IntArray:
        """Index of the element's basis function that belongs to each node, shape (b,)."""
        places = np.asarray(self.element.doflocs, dtype=np.float64)
        distance = np.abs(self.nodes[:, None, :] - places[None, :, :]).max(axis=2)
        assert (distance.min(axis=1) < SAME_PLACE).all(), self.name
        return np.asarray(distance.argmin(axis=1), dtype=np.int64)

    @cached_property
    def quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Places (q, d) and weights (q,) in the reference cell."""
        return self.rule(self.integration_order)

    def rule(self, order: int) -> tuple[FloatArray, FloatArray]:
        """Places (q, d) and weights (q,) that integrate polynomials of an order exactly."""
        if isinstance(self.element, NodalElement):
            return self.element.rule(order)
        places, weights = get_quadrature(self.element, order)
        return np.ascontiguousarray(places.T), weights

    @property
    def reducible(self) -> bool:
        """Whether cells of the kind may be integrated at 2 places in each direction only."""
        return self.name in ("quad8", "hexahedron20")

    @cached_property
    def reduced_quadrature(self) -> tuple[FloatArray, FloatArray]:
        """Gauss's 2 places in each direction (q, d) and their weights (q,)."""
        return self.rule(3)

    def basis(self, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Shape functions and their reference gradients, (q, b) and (q, b, d), at places (q, d)."""
        at = np.ascontiguousarray(places.T)
        values, gradients = [], []
        for index in self.basis_order:
            value, gradient = self.element.lbasis(at, int(index))
            values.append(np.broadcast_to(value, len(places)))
            gradients.append(np.broadcast_to(np.asarray(gradient), at.shape))
        return np.stack(values, axis=1), np.stack(gradients, axis=0).transpose(2, 0, 1)


def _filled(corners: FloatArray, edges: Indices, centres: Indices) -> FloatArray:
    further = [corners[..., list(of), :].mean(axis=-2) for of in (*edges, *centres)]
    return np.concatenate([corners, *(place[..., None, :] for place in further)], axis=-2)


def _nodal(
    name: str, shape: Shape, terms: Sequence[Term], rule: Rule, centres: Indices = ()
) -> CellKind:
    """A wedge or a pyramid that has the functions of a span."""
    order = 1 if len(terms) == len(shape.corners) else 2
    places = _filled(shape.corners, shape.edges if order == 2 else (), centres)
    return CellKind(name, NodalElement(places, terms, rule), order, 2 * order, shape, centres)


_CUBE_CENTRES = (*(CUBE.faces[i] for i in (5, 3, 2, 4, 0, 1)), tuple(range(8)))
_ALL4 = ((0, 1, 2, 3),)

KINDS: dict[str, CellKind] = {
    kind.name: kind
    for kind in (
        CellKind("line", skfem.ElementLineP1(), 1, 2, SEGMENT),
        CellKind("line3", skfem.ElementLineP2(), 2, 4, SEGMENT),
        CellKind("triangle", skfem.ElementTriP1(), 1, 2, TRIANGLE),
        CellKind("triangle6", skfem.ElementTriP2(), 2, 4, TRIANGLE),
        CellKind("quad", skfem.ElementQuad1(), 1, 2, SQUARE),
        CellKind("quad8", skfem.ElementQuadS2(), 2, 4, SQUARE),
        CellKind("quad9", skfem.ElementQuad2(), 2, 4, SQUARE, _ALL4),
        CellKind("tetra", skfem.ElementTetP1(), 1, 2, TETRAHEDRON),
        CellKind("tetra10", skfem.ElementTetP2(), 2, 4, TETRAHEDRON),
        _nodal("pyramid", PYRAMID, PYRAMID_TERMS[5], pyramid_rule),
        _nodal("pyramid13", PYRAMID, PYRAMID_TERMS[13], pyramid_rule),
        _nodal("pyramid14", PYRAMID, PYRAMID_TERMS[14], pyramid_rule, _ALL4),
        _nodal("wedge", WEDGE, WEDGE_TERMS[6], wedge_rule),
        _nodal("wedge15", WEDGE, WEDGE_TERMS[15], wedge_rule),
        _nodal("wedge18", WEDGE, WEDGE_TERMS[18], wedge_rule, WEDGE.faces[2:]),
        CellKind("hexahedron", skfem.ElementHex1(), 1, 2, CUBE),
        CellKind("hexahedron20", skfem.ElementHexS2(), 2, 4, CUBE),
        CellKind("hexahedron27", skfem.ElementHex2(), 2, 4, CUBE, _CUBE_CENTRES),
    )
}
"""All kinds by name.

The nodes are the corners, the middles of the edges, and where there are more, the middles of the
faces: of a wedge18 in the order (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5), of a hexahedron27 -x, +x,
-y, +y, -z, +z and then its own middle, both as in VTK; of a pyramid14 its base.
"""


def all_facets(parts: Iterable[Mapping[str, IntArray]]) -> dict[str, IntArray]:
    """Nodes (f, k) of all facets of the cells (e, b) by kind of some parts, by the facets' kind.

    Examples
    --------
    >>> facets = all_facets([{"triangle": np.array([[0, 1, 2]])}, {"quad": np.arange(4)[None]}])
    >>> facets["line"].shape
    (7, 2)
    """
    found: dict[str, list[IntArray]] = {}
    for cells in parts:
        for kind, nodes in cells.items():
            for facet_kind, facets in KINDS[kind].facets_of(nodes).items():
                found.setdefault(facet_kind, []).append(facets)
    return {kind: np.concatenate(blocks) for kind, blocks in found.items()}


def facet_keys(corners: IntArray) -> IntArray:
    """A number for each facet (f, k) by its first two corners and its last, in ascending order.

    Examples
    --------
    >>> facet_keys(np.array([[0, 1, 2], [0, 1, 3], [0, 1, 2]]))
    array([0, 1, 0])
    """
    size = int(corners.max()) + 1
    _, pair = np.unique(corners[:, 0] * size + corners[:, 1], return_inverse=True)
    _, key = np.unique(pair.ravel() * size + corners[:, -1], return_inverse=True)
    return np.asarray(key.ravel(), dtype=np.int64)


def measures(kind: str, coordinates: FloatArray) -> FloatArray:
    """Volume (area, length) at each place of integration of cells or facets (f, k, d), (f, q)."""
    places, weights = KINDS[kind].quadrature
    _, reference = KINDS[kind].basis(places)
    J = np.einsum("fbi,qbj->fqij", coordinates, reference)
    return np.asarray(np.sqrt(np.linalg.det(J.swapaxes(-1, -2) @ J)) * weights)
