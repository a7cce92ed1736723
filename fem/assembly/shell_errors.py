"""Energy and mass that shells are off by in given shapes: curvatures and deflections made smooth.

Curvatures and transverse shear strains are fitted by linear functions in each patch
(`patches.py`). What a facet's own are off counts as in solids. A facet that bends stays flat,
though: between its nodes the surface lies off it by a parabola, so that its mass moves by too
little, and curvatures across the direction in which a quadrilateral's rotations change are linear
where they should be parabolas, so that their energy is too low. Stretching is not looked at.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from fem.assembly.patches import SURE, Patches, fitted, patches_of
from fem.base.arrays import FloatArray, IntArray
from fem.elements.membranes import plane_law
from fem.elements.plates import jacobians
from fem.elements.shells import TRIANGLES, FlatCells, facet_rule, flat_cells, shell_rows
from fem.mesh.cells import CellKind
from fem.model.parts import ShellPart

RIDGE = np.array([1e-9, 1e-4, 1e-4])
SMOOTH_DEGREES = 50.0
"""Facets that meet at less than this angle bend as one surface: a ring of 8 still does."""
MIDDLE = {"triangle": np.full((1, 2), 1.0 / 3.0), "quad": np.full((1, 2), 0.5)}


@dataclass(frozen=True, eq=False)
class Facets:
    """Facets of one kind in given shapes.

    Parameters
    ----------
    kind, nodes, corners, cells
        What they are; corners as of `smooth_corners`.
    values
        Shape functions at the places of integration, (q, b).
    area
        At the same places in m², shape (e, q).
    own
        Curvatures xx, yy, 2 xy and transverse shear strains (m, e, q, 5) in the facets' axes.
    deflection
        Along the normal at the same places, shape (m, e, q).
    """

    kind: CellKind
    nodes: IntArray
    corners: IntArray
    cells: FlatCells
    values: FloatArray
    area: FloatArray
    own: FloatArray
    deflection: FloatArray

    def __repr__(self) -> str:
        return f"Facets({len(self.nodes)} {self.kind.name})"


def shell_errors(
    points: FloatArray,
    part: ShellPart,
    blocks: Sequence[tuple[CellKind, IntArray, FloatArray, IntArray]],
    shapes: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Twice the energy in J that is too much, and the kg m² that are too little, (m,) each.

    Parameters
    ----------
    points
        Of the mesh, shape (n, 3).
    part
        The part, of one material.
    blocks
        Kind, nodes (e, b) and normals (e, b, 3) of its facets, as of `shell_pieces`, and their
        corners (e, b), as of `smooth_corners`.
    shapes
        Displacements and rotations of the nodes, shape (m, n, 6).
    """
    facets = [_facets(points, part, *block, shapes) for block in blocks]
    normals = [f.cells.axes[:, 2] for f in facets]
    nodes = [f.nodes for f in facets]
    thin = [normal[:, :, None] * normal[:, None] for normal in normals]
    patches = patches_of(points, [f.corners for f in facets], nodes, thin)
    fits, trust = _fits(points, patches, facets)
    law = np.append(_split_law(part), [part.shearing, part.shearing])
    energy, mass = np.zeros(len(shapes)), np.zeros(len(shapes))
    for each in facets:
        off = _smooth(points, patches, each, fits, trust) - each.own
        energy += _energy(each, law, off, off)
        parabola = _between(each)
        if each.kind.name == "quad":
            more = _across(patches, each, fits, parabola)
            energy -= _energy(each, law, more, 2.0 * each.own + more)
        bent = each.own[..., :3].mean(axis=2)
        lift = np.einsum("eqs,mes->meq", parabola, bent / 2.0)
        mass += part.mass * np.einsum("eq,meq->m", each.area, lift * (2.0 * each.deflection + lift))
    return energy, mass


def smooth_corners(points: FloatArray, blocks: Sequence[IntArray]) -> list[IntArray]:
    """Numbers of the corners of facets (e, b), the same where they meet in one smooth surface.

    At a fold and along an edge of three facets or more, as that of a rib on a plate, curvatures
    jump, and the facets of each side have corners of their own.

    Examples
    --------
    Two facets in a plane and one that stands on their edge share no corner across it:

    >>> x, y, z = [0, 1, 1, 0, 2, 2, 1, 1], [0, 0, 1, 1, 0, 1, 0, 1], [0, 0, 0, 0, 0, 0, 1, 1]
    >>> points = np.array([x, y, z], dtype=float).T
    >>> flat = np.array([[0, 1, 2, 3], [1, 4, 5, 2]])
    >>> smooth_corners(points, [flat])[0]
    array([[0, 1, 2, 3],
           [1, 4, 5, 2]], dtype=int32)
    >>> len(np.unique(smooth_corners(points, [np.vstack([flat, [1, 6, 7, 2]])])[0]))
    12
    """
    if not blocks:
        return []
    first = np.cumsum([0, *(block.size for block in blocks)])
    numbers = [
        start + np.arange(block.size).reshape(block.shape)
        for start, block in zip(first, blocks, strict=False)
    ]
    ends, normals = [], []
    for block, own in zip(blocks, numbers, strict=True):
        edge = np.stack([block, np.roll(block, -1, axis=1), own, np.roll(own, -1, axis=1)], axis=-1)
        turn = edge[..., 0] > edge[..., 1]
        edge[turn] = edge[turn][:, [1, 0, 3, 2]]
        ends.append(edge.reshape(-1, 4))
        normals.append(np.repeat(flat_cells(points[block]).axes[:, 2], block.shape[1], axis=0))
    edges, normal = np.concatenate(ends), np.concatenate(normals)
    order = np.lexsort(edges[:, :2].T)
    edges, normal = edges[order], normal[order]
    same = (edges[1:, :2] == edges[:-1, :2]).all(axis=1)
    alone = ~np.append(same[1:], False) & ~np.insert(same[:-1], 0, False)
    cosine = np.abs(np.einsum("pi,pi->p", normal[1:], normal[:-1]))
    at = np.flatnonzero(same & alone & (cosine > np.cos(np.radians(SMOOTH_DEGREES))))
    one, other = edges[at, 2:].ravel(), edges[at + 1, 2:].ravel()
    joined = sparse.coo_array((np.ones(len(one)), (one, other)), shape=(first[-1], first[-1]))
    label = connected_components(joined, directed=False)[1]
    return [label[own] for own in numbers]


def _split_law(part: ShellPart) -> FloatArray:
    """Stiffness (3,) of sum, difference and shear of curvatures in N m."""
    nu = part.material.poissons_ratio_for("shell part")
    return plane_law(part.stretching * part.thickness**2 / 12.0, nu)


def _energy(facets: Facets, law: FloatArray, one: FloatArray, other: FloatArray) -> FloatArray:
    """Twice the energy (m,) of two fields of curvatures and shears (m, e, q, 5)."""
    first, second = (_split(each) for each in (one, other))
    return np.asarray(np.einsum("eq,r,meqr,meqr->m", facets.area, law, first, second))


def _split(strains: FloatArray) -> FloatArray:
    """Sum, difference, shear and the rest of curvatures and shears (..., 5)."""
    found = strains.copy()
    found[..., 0] = strains[..., 0] + strains[..., 1]
    found[..., 1] = strains[..., 0] - strains[..., 1]
    return found


def _facets(
    points: FloatArray,
    part: ShellPart,
    kind: CellKind,
    nodes: IntArray,
    normals: FloatArray,
    corners: IntArray,
    shapes: FloatArray,
) -> Facets:
    """Facets in some shapes; curvatures of triangles are their means."""
    cells = flat_cells(points[nodes])
    rows, _ = shell_rows(part, kind, points, nodes, normals)
    bending = rows[:, 6 * len(TRIANGLES[kind.name]) :]
    moved = shapes[:, nodes].reshape(len(shapes), len(nodes), -1)
    own = np.einsum("erj,mej->mer", bending, moved).reshape(*moved.shape[:2], -1, 5)
    places, weights = facet_rule(kind)
    area = np.linalg.det(jacobians(kind, cells.plane, places)) * weights
    if kind.name == "triangle":
        mean = np.einsum("eq,meqr->mer", area, own) / area.sum(axis=1)[:, None]
        own = np.broadcast_to(mean[:, :, None], own.shape)
    own = _split(own)
    own[..., :2] /= 2.0
    values, _ = kind.basis(places)
    along = np.einsum("mebi,ei->meb", shapes[:, nodes, :3], cells.axes[:, 2])
    return Facets(kind, nodes, corners, cells, values, area, own, along @ values.T)


def _turns(
    patches: Patches, facets: Facets, column: int, places: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Terms (e, q, 3), turns (e, 2, 2) from the facets' planes to patches, and sides (e,)."""
    corners = facets.corners[:, column]
    at, _ = patches.coordinates(corners, places)
    _, axes = patches.coordinates(corners, places.mean(axis=1, keepdims=True))
    turn = axes[:, 0] @ facets.cells.axes.swapaxes(1, 2)
    side = np.sign(turn[:, 2, 2])
    left, _, right = np.linalg.svd(turn[:, :2, :2])
    terms = np.stack([np.ones_like(at[..., 0]), at[..., 0], at[..., 1]], axis=-1)
    return terms, left @ right, side


def turned(strains: FloatArray, turn: FloatArray, side: FloatArray) -> FloatArray:
    """Curvatures xx, yy, 2 xy and shears (..., e, q, 5) in other axes of the plane.

    Parameters
    ----------
    strains
        In the old axes.
    turn
        New components of vectors from old ones, shape (e, 2, 2).
    side
        -1 where the normals are opposite, shape (e,).
    """
    x, y, twice = (strains[..., i] for i in range(3))
    tensor = np.stack([np.stack([x, twice / 2], -1), np.stack([twice / 2, y], -1)], -2)
    tensor = turn[:, None] @ tensor @ turn[:, None].swapaxes(-1, -2)
    shear = (turn[:, None] @ strains[..., 3:, None])[..., 0]
    parts = [tensor[..., 0, 0], tensor[..., 1, 1], 2.0 * tensor[..., 0, 1]]
    found = np.stack([*parts, shear[..., 0], shear[..., 1]], axis=-1)
    return np.asarray(found * side[:, None, None])


def _fits(
    points: FloatArray, patches: Patches, facets: Sequence[Facets]
) -> tuple[FloatArray, FloatArray]:
    """Coefficients (p, 3, m, 5) of the means of facets in each patch, and their weights (p,)."""
    modes = len(facets[0].own)
    normal, count = np.zeros((len(patches.size), 3, 3)), np.zeros(len(patches.size))
    right = np.zeros((len(patches.size), 3, modes * 5))
    for each in facets:
        whole = each.area.sum(axis=1)
        mean = np.einsum("eq,meqr->mer", each.area, each.own) / whole[:, None]
        middle = points[each.nodes].mean(axis=1, keepdims=True)
        for number, column in enumerate(each.corners.T):
            terms, turn, side = _turns(patches, each, number, middle)
            seen = np.moveaxis(turned(mean[:, :, None], turn, side)[:, :, 0], 0, 1)
            weighted = terms.swapaxes(1, 2) * whole[:, None, None]
            normal += patches.sums(column, weighted @ terms)
            right += patches.sums(column, weighted @ seen.reshape(len(column), 1, -1))
            count += patches.sums(column, np.ones(len(column)))
    fits, known = fitted(normal, right, RIDGE)
    return fits.reshape(len(fits), 3, modes, 5), count * known**SURE


def _smooth(
    points: FloatArray, patches: Patches, facets: Facets, fits: FloatArray, trust: FloatArray
) -> FloatArray:
    """Smooth curvatures and shears (m, e, q, 5) of facets, in their axes."""
    values = facets.values
    places = values @ points[facets.nodes]
    total, whole = np.zeros(facets.own.shape), np.zeros(facets.area.shape)
    for number, column in enumerate(facets.corners.T):
        terms, turn, side = _turns(patches, facets, number, places)
        patch = patches.place[column]
        found = np.einsum("eqt,etmr->meqr", terms, fits[patch])
        weight = np.maximum(values[:, number] * trust[patch][:, None], np.finfo(np.float64).tiny)
        total += weight[..., None] * turned(found, turn.swapaxes(1, 2), side)
        whole += weight
    return np.asarray(total / whole[..., None])


def _between(facets: Facets) -> FloatArray:
    """x², y² and x y between the nodes less themselves, (e, q, 3)."""
    values, at = facets.values, facets.cells.plane
    there = values @ at
    products = [(0, 0), (1, 1), (0, 1)]
    found = [
        (at[..., i] * at[..., j]) @ values.T - there[..., i] * there[..., j] for i, j in products
    ]
    return np.stack(found, axis=-1)


def _across(patches: Patches, facets: Facets, fits: FloatArray, parabola: FloatArray) -> FloatArray:
    """Curvatures and no shears (m, e, q, 5) that quadrilaterals lack where they bend."""
    middle = MIDDLE[facets.kind.name]
    slope = facets.kind.basis(middle)[1][0]
    gradient = slope @ np.linalg.inv(jacobians(facets.kind, facets.cells.plane, middle)[:, 0])
    second = np.zeros((len(facets.own), len(facets.nodes), 2, 5))
    for number, column in enumerate(facets.corners.T):
        patch = patches.place[column]
        centres = patches.centres[patch][:, None]
        _, turn, side = _turns(patches, facets, number, centres)
        slopes = np.moveaxis(fits[patch][:, 1:] / patches.size[patch][:, None, None, None], 2, 0)
        slopes = turned(slopes, turn.swapaxes(1, 2), side)
        along = np.einsum("eji,mejr->meir", turn, slopes)
        second += gradient[:, number][:, :, None] * along
    found = np.zeros(facets.own.shape)
    xx, yy = -parabola[..., 0] / 2.0, -parabola[..., 1] / 2.0
    found[..., 0] = second[:, :, None, 1, 0] * yy
    found[..., 1] = second[:, :, None, 0, 1] * xx
    found[..., 2] = (second[:, :, None, 0, 2] * xx + second[:, :, None, 1, 2] * yy) / 2.0
    return found
