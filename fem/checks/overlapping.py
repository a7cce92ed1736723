"""Nodes on curved faces of cells that lie against theirs but do not have them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array

from fem.base.arrays import FloatArray, IntArray
from fem.checks.hanging import NAMES, Boundary, Facets, held_nodes, told_cell
from fem.mesh.cells import KINDS, CellKind
from fem.mesh.pieces import place_of
from fem.model.structure import StructureModel

BoolArray = npt.NDArray[np.bool_]

OPPOSITE = -0.7
"""Facets lie against each other if the product of their normals is below."""
NEAR = 0.05
"""How far from a cell a node counts as on it, in the coordinates of the reference cell."""
STEPS = 8


def overlap_warnings(model: StructureModel, looked_at: Boundary) -> Iterator[str]:
    """One sentence if cells share nodes on a curved face but lie there against other nodes.

    Curved faces of cells that do not conform fit together roughly only, so that this is told where
    `check_nothing_hangs` (`hanging.py`) refuses what hangs on flat ones. Looked at are the outer
    facets of solids and the edges of shells that share a node with one that faces them; a node of
    one must lie within 5 % of the other's cell, and on none of its nodes.

    Examples
    --------
    >>> import fem
    >>> from fem.checks.hanging import boundary
    >>> def ring(radius, around):
    ...     flat = fem.box_mesh("ring", (0.5, 1.0), (1, around), kind="quad8",
    ...         origin=(radius, 0.0, 0.0))
    ...     r, angle, z = flat.points.T
    ...     return flat.with_points(np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1))
    >>> sheet = fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3), "stress", 0.01)
    >>> both = fem.joined([ring(0.5, 2), ring(1.0, 4)])
    >>> model = fem.StructureModel(both, {"ring": sheet})
    >>> [said] = overlap_warnings(model, boundary(model))
    >>> said.split(": ")[1].split(", ")[0]
    '4 nodes lie on curved faces of cells that do not have them'
    """
    if model.separate:
        return
    held = held_nodes(model)
    for facets in looked_at:
        if facets is None:
            continue
        cells, nodes, owners = _candidates(model, facets, held)
        found = np.flatnonzero(_on_cells(model, facets[cells], nodes))
        if len(found):
            first = found[np.lexsort((cells[found], nodes[found]))[0]]
            place = place_of(model.mesh.points[nodes[first]])
            yield (
                f"{model.mesh.source}: {len(np.unique(nodes[found]))} nodes lie on curved faces of"
                f" cells that do not have them, the first at {place}, of"
                f" {told_cell(model, facets, int(owners[first]))} on"
                f" {told_cell(model, facets, int(cells[first]))}: the model has a gap there that"
                " opens as it moves; give both sides the same nodes, or say that it is meant"
                " ('separate')"
            )


def _candidates(
    model: StructureModel, facets: Facets, held: BoolArray
) -> tuple[IntArray, IntArray, IntArray]:
    """Facets, nodes of outer facets that face them and share a node, and the latter facets."""
    count, width = facets.nodes.shape
    rows = np.repeat(np.arange(count), width)
    incidence = csr_array(
        (np.ones(rows.size), (rows, facets.nodes.ravel())), shape=(count, len(model.mesh.points))
    )
    one, other = (incidence @ incidence.T).nonzero()
    facing = np.einsum("pi,pi->p", facets.normals[one], facets.normals[other])
    loose = facets.outer[other] & (one != other)
    keep = loose & ((facing < OPPOSITE) | ~facets.normals[one].any(axis=1))
    one, other = one[keep], other[keep]
    nodes = [np.empty((0, 3), dtype=np.int64)]
    for code in np.unique(facets.kinds[other]):
        at = np.flatnonzero(facets.kinds[other] == code)
        cells = model.mesh.cells[NAMES[code]][facets.numbers[other[at]]]
        pair, local = np.nonzero(_on_facet(KINDS[NAMES[code]], cells, facets.nodes[other[at]]))
        nodes.append(np.stack([one[at[pair]], cells[pair, local], other[at[pair]]], axis=1))
    found = np.concatenate(nodes)
    one, node, other = found[~held[found[:, 1]]].T
    return one, node, other


def _on_facet(kind: CellKind, cells: IntArray, corners: IntArray) -> BoolArray:
    """Which nodes of cells (p, b) are on their facets with some corners (p, c), shape (p, b)."""
    at = (cells[:, : len(kind.corners), None] == corners[:, None]).any(axis=2)
    edges = kind.edges if kind.order == 2 else ()
    between = [at[:, list(of)].all(axis=1) for of in (*edges, *kind.centres)]
    return np.column_stack([at, *between])


def _on_cells(model: StructureModel, facets: Facets, nodes: IntArray) -> BoolArray:
    """Whether each node (p,) lies on the cell of its facet, and is not at a node of it."""
    found = np.zeros(len(nodes), dtype=np.bool_)
    for code in np.unique(facets.kinds):
        kind = KINDS[NAMES[code]]
        at = np.flatnonzero(facets.kinds == code)
        cells = model.mesh.cells[kind.name][facets.numbers[at]]
        at, cells = (kept[~(cells == nodes[at, None]).any(axis=1)] for kept in (at, cells))
        places = model.mesh.points[cells]
        natural, away = _natural_places(kind.name, places, model.mesh.points[nodes[at]])
        inside = (_outside(kind, natural) <= NEAR).all(axis=1)
        size = np.ptp(places, axis=1).max(axis=1)
        own = np.abs(natural[:, None] - kind.nodes).max(axis=2).min(axis=1) <= NEAR
        found[at] = inside & ~own & (away <= NEAR * size)
    return found


def _natural_places(
    kind: str, cells: FloatArray, places: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where in the reference cell places (p, 3) lie, by Newton's method, and how far from there."""
    natural = np.repeat(KINDS[kind].corners.mean(axis=0)[None], len(cells), axis=0)
    for step in range(STEPS + 1):
        values, gradients = KINDS[kind].basis(natural)
        left = places - np.einsum("pb,pbi->pi", values, cells)
        if step == STEPS:
            break
        slopes = np.einsum("pbd,pbi->pid", gradients, cells)
        move = np.einsum("pdi,pi->pd", np.linalg.pinv(slopes), left)
        natural = np.clip(natural + move, -2.0, 2.0)
    return natural, np.linalg.norm(left, axis=1)


def _outside(kind: CellKind, natural: FloatArray) -> FloatArray:
    """How far places (p, d) in the reference cell are outside of each of its sides, (p, sides)."""
    distances = []
    for face in kind.shape.faces:
        corners = kind.corners[list(face)]
        span = corners[1:] - corners[0]
        normal = np.array([span[0, 1], -span[0, 0]]) if span.shape[1] == 2 else np.cross(*span[:2])
        normal = normal / np.linalg.norm(normal)
        normal = normal * np.sign(normal @ (corners[0] - kind.corners.mean(axis=0)))
        distances.append((natural - corners[0]) @ normal)
    return np.stack(distances, axis=1)
