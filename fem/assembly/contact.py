"""Points of contact of a face, an edge, lines of beams or a set of nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from fem.assembly.component import Component
from fem.assembly.structure import beam_dofs, beam_motions, gauss
from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.elements.beams import cross_matrix
from fem.elements.scatter import SparseArray
from fem.mesh.cells import KINDS, TRIANGLE
from fem.model.structure import AXES

FLAT = 1e-4  # 1 - cosine of the angle between the normals of what counts as flat
HELD = 1e-12  # motion of a point, of one that is free: a support holds it
MOST_PLACES = 12  # in one direction of a cell

Block = tuple[FloatArray, FloatArray, FloatArray, IntArray]


@dataclass(frozen=True, eq=False, repr=False)
class ContactPoints:
    """Points of an area of contact, their weights, and how they move.

    Parameters
    ----------
    at
        Name of the set of the mesh.
    direction
        Unit vector along the normal, shape (3,).
    places
        Coordinates in m, shape (k, 3).
    weights
        What each stands for: m² of a face, m of an edge or beams, 1 node by node; shape (k,).
    motion
        Their translations from the free degrees of freedom, sparse (3 k, N): x, y and z of the
        first point, then of the second.
    measure
        "area", "length" or "node".
    held
        How many more points there are, which supports hold along the normal.
    """

    at: str
    direction: FloatArray
    places: FloatArray
    weights: FloatArray
    motion: SparseArray
    measure: str
    held: int = 0

    def __repr__(self) -> str:
        """One line: how many points, where and of how much."""
        unit = {"area": " m²", "length": " m", "node": " nodes"}[self.measure]
        return (
            f"<ContactPoints: {len(self.places)} of {self.at!r}, {self.weights.sum():.6g}{unit}, "
            f"{self.held} held>"
        )

    def vectors(self, direction: str | Sequence[float] | None = None) -> FloatArray:
        """Load vectors (k, N) of unit forces at the points, along the normal unless given."""
        along = self.direction if direction is None else unit_vector(self.at, direction)
        rows = sparse.kron(sparse.eye_array(len(self.places)), along[None], format="csr")
        return np.asarray((rows @ self.motion).toarray(), dtype=np.float64)

    def only(self, kept: IntArray) -> ContactPoints:
        """Some of the points, by their numbers (n,)."""
        rows = (3 * kept[:, None] + np.arange(3)).ravel()
        return replace(
            self,
            places=self.places[kept],
            weights=self.weights[kept],
            motion=sparse.csr_array(self.motion[rows]),
        )


def contact_points(
    component: Component,
    at: str,
    direction: str | Sequence[float],
    *,
    points: int | str = 1,
    surface: float = 0.0,
) -> ContactPoints:
    """Points of an area of contact of an assembled component.

    Parameters
    ----------
    component
        What was assembled.
    at
        A face of solids or shells, an edge of plane solids, a part or a set of nodes of beams.
    direction
        Axis of the normal, such as "y" or "-y", or a vector.
    points
        Gauss's places in each direction of a cell, or "nodes": node by node.
    surface
        Distance in m, along the normal, of the surface from the axis of beams or the middle of
        shells: their points move with the rotation, too.

    Returns
    -------
    ContactPoints

    Raises
    ------
    ModelError
        If there is no such set, no cell or beam all of whose nodes are in it, more than one normal,
        or nothing that moves along it.

    Examples
    --------
    >>> import fem
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (2, 0)}, [("arm", "root", "tip", 4)])
    >>> arm = fem.assemble(fem.StructureModel(
    ...     mesh,
    ...     parts={"arm": fem.BeamPart(fem.Material(2e11, 7800.0), fem.Section(1e-3, 1e-8))},
    ...     supports=[fem.Support("root", ("x", "y", "rotation"))],
    ...     plane=True,
    ... ))
    >>> fem.contact_points(arm, "arm", "y", points=3)
    <ContactPoints: 12 of 'arm', 2 m, 0 held>
    >>> fem.contact_points(arm, "arm", "y", points="nodes")
    <ContactPoints: 4 of 'arm', 4 nodes, 1 held>
    """
    normal = unit_vector(at, direction)
    if points == "nodes":
        nodes = component.model.mesh.nodes(at)
        blocks, measure = [node_block(component, at, nodes, surface * normal)], "node"
    else:
        whole = isinstance(points, int) and not isinstance(points, bool)
        if not (whole and 1 <= int(points) <= MOST_PLACES):
            raise ModelError(
                f"contact at {at!r}: points must be 'nodes' or a whole number from 1 to "
                f"{MOST_PLACES}, not {points!r}"
            )
        blocks, measure = _blocks(component, at, int(points), surface, normal)
    places, weights, motion = gathered(component, blocks)
    size = np.abs(
        sparse.kron(sparse.eye_array(len(places)), np.abs(normal)[None], format="csr") @ abs(motion)
    ).sum(axis=1)
    free = np.asarray(size).ravel() > HELD
    if not free.any():
        raise ModelError(
            f"{component.model.mesh.source}: contact at {at!r}: nothing of it moves along "
            f"({', '.join(f'{x:g}' for x in normal)}), as supports hold it"
        )
    kept = np.repeat(free, 3)
    return ContactPoints(
        at,
        normal,
        places[free],
        weights[free],
        sparse.csr_array(motion[kept]),
        measure,
        int(np.count_nonzero(~free)),
    )


def unit_vector(at: str, direction: str | Sequence[float]) -> FloatArray:
    """The unit vector of an axis, such as "-y", or of a vector."""
    if isinstance(direction, str):
        name = direction.removeprefix("-")
        if name in AXES[:3]:
            sign = -1.0 if direction.startswith("-") else 1.0
            return np.asarray(sign * np.eye(3)[AXES.index(name)], dtype=np.float64)
        vector = np.zeros(0)
    else:
        vector = np.asarray(direction, dtype=np.float64)
    length = float(np.linalg.norm(vector)) if vector.shape == (3,) else 0.0
    if not (0.0 < length < np.inf):
        raise ModelError(
            f"contact at {at!r}: direction must be 'x', 'y', 'z', one of these with '-', or a "
            f"vector, not {direction!r}"
        )
    return np.asarray(vector / length, dtype=np.float64)


def gathered(
    component: Component, blocks: Sequence[Block]
) -> tuple[FloatArray, FloatArray, SparseArray]:
    """Places (k, 3), weights (k,) and motion (3 k, N) of blocks of cells.

    A block has places (c, q, 3), weights (c, q), shapes (c, q, 3, d) and degrees of freedom (c, d)
    among all, -1 for none.
    """
    to_free = component.constraints.transformation
    size = to_free.shape[0]
    motions = []
    for places, _, shapes, dofs in blocks:
        cells, count = places.shape[:2]
        rows = np.arange(3 * cells * count).reshape(cells, count, 3, 1)
        columns = np.broadcast_to(dofs[:, None, None, :], shapes.shape)
        rows = np.broadcast_to(rows, shapes.shape)
        there = columns >= 0
        motions.append(
            sparse.coo_array(
                (shapes[there], (rows[there], columns[there])), shape=(3 * cells * count, size)
            )
        )
    motion = sparse.csr_array(sparse.vstack(motions)) @ to_free
    return (
        np.concatenate([places.reshape(-1, 3) for places, *_ in blocks]),
        np.concatenate([weights.ravel() for _, weights, *_ in blocks]),
        motion,
    )


def node_block(component: Component, at: str, nodes: IntArray, arm: FloatArray) -> Block:
    """Nodes, or places an arm off them that turns with them."""
    if np.any(arm) and np.any(component.numbering.rotation[nodes] < 0):
        raise _off_solids(component, at)
    values = np.ones((len(nodes), 1, 1))
    places = component.model.mesh.points[nodes][:, None] + arm
    return places, values[..., 0], *facet_shapes(component, nodes[:, None], values, arm)


def _blocks(
    component: Component, at: str, points: int, surface: float, normal: FloatArray
) -> tuple[list[Block], str]:
    model = component.model
    check_surface(component, at, surface)
    blocks = [
        _facet_block(component, at, kind, facets, points, normal, surface)
        for kind, facets in model.facets_on(at).items()
    ]
    measure = "length" if model.plane else "area"
    s, weights = gauss(points)
    beams = [
        beam_block(component, name, numbers, s, weights, surface * normal)
        for name, numbers in model.beams_on(at).items()
    ]
    if blocks and beams:
        raise ModelError(f"{model.mesh.source}: contact at {at!r}: has both facets and beams")
    if not blocks and not beams:
        raise ModelError(
            f"{model.mesh.source}: contact at {at!r}: there is no outer face, edge or beam whose "
            "nodes are all in it; take points = 'nodes' for single nodes"
        )
    return (blocks, measure) if blocks else (beams, "length")


def _facet_block(
    component: Component,
    at: str,
    kind: str,
    facets: IntArray,
    points: int,
    normal: FloatArray,
    surface: float,
) -> Block:
    places, weights = rule(kind, points)
    values, gradients = KINDS[kind].basis(places)
    corners = component.model.mesh.points[facets]
    J = np.einsum("fbi,qbj->fqij", corners, gradients)
    areas = np.sqrt(np.linalg.det(J.swapaxes(-1, -2) @ J)) * weights
    off = np.abs(np.einsum("i,fqij->fqj", normal, J / np.linalg.norm(J, axis=2, keepdims=True)))
    sine = float(off.max())
    if sine**2 > 2.0 * FLAT:
        raise ModelError(
            f"{component.model.mesh.source}: contact at {at!r}: its normals are up to "
            f"{np.degrees(np.arcsin(min(sine, 1.0))):.3g} degrees off its direction; make an area "
            "of each flat part, with its own direction"
        )
    values, arm = np.broadcast_to(values, (len(facets), *values.shape)), surface * normal
    at_places = np.einsum("fqb,fbi->fqi", values, corners) + arm
    return at_places, areas, *facet_shapes(component, facets, values, arm)


def facet_shapes(
    component: Component, facets: IntArray, values: FloatArray, arm: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Translations (f, q, 3, d) at places of facets (f, b) from their degrees of freedom (f, d).

    By the shape functions (f, q, b) there, an arm off shells, which turns with them.
    """
    per_node = np.eye(3)
    dofs = component.numbering.dofs(facets)[..., :3]
    if np.any(arm):
        per_node = np.hstack([per_node, -cross_matrix(arm)])
        dofs = component.numbering.dofs(facets)
    shapes = np.einsum("fqb,ij->fqibj", values, per_node)
    return shapes.reshape(*shapes.shape[:3], -1), dofs.reshape(len(facets), -1)


def check_surface(component: Component, at: str, surface: float) -> None:
    """Refuse a surface that is off the nodes of solids."""
    model = component.model
    facets = [nodes.ravel() for nodes in model.facets_on(at).values()]
    if surface and facets and np.any(component.numbering.rotation[np.concatenate(facets)] < 0):
        raise _off_solids(component, at)


def _off_solids(component: Component, at: str) -> ModelError:
    return ModelError(
        f"{component.model.mesh.source}: contact at {at!r}: surface is for beams and shells, not "
        "for faces of solids"
    )


def beam_block(
    component: Component,
    name: str,
    numbers: IntArray,
    s: FloatArray,
    weights: FloatArray,
    arm: FloatArray,
) -> Block:
    """Places (q,) or (e, q) from 0 to 1 on lines (e,) of a beam, an arm off its axis."""
    model = component.model
    ends = model.mesh.points[model.beams[name][1][numbers]]
    lengths, moves, turns = beam_motions(model, name, numbers, s)
    shapes = moves - cross_matrix(arm) @ turns
    share = np.broadcast_to(s, (len(ends), s.shape[-1]))[..., None]
    places = (1.0 - share) * ends[:, None, 0] + share * ends[:, None, 1]
    dofs = beam_dofs(model, component.numbering, name)[numbers]
    return places + arm, weights * lengths[:, None], shapes, dofs


def rule(kind: str, points: int) -> tuple[FloatArray, FloatArray]:
    """Places (q, d) and positive weights (q,) on a facet, so many in each direction.

    On a triangle those of as high an order.
    """
    shape = KINDS[kind].shape
    if shape is not TRIANGLE:
        s, w = gauss(points)
        count = shape.corners.shape[1]
        places = np.stack(np.meshgrid(*[s] * count, indexing="ij"), axis=-1).reshape(-1, count)
        weights = np.stack(np.meshgrid(*[w] * count, indexing="ij"), axis=-1).reshape(-1, count)
        return places, weights.prod(axis=1)
    if points == 1:
        return shape.corners.mean(axis=0)[None], np.array([0.5])
    for order in range(2 * points - 1, 2 * points + 4):
        places, weights = KINDS[kind].rule(order)
        if np.all(weights > 0.0):
            break
    return places, weights
