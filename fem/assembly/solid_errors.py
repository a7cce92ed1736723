"""Energy that solids have too much of in given shapes, by smoothing their stresses.

The strains of a mesh are fitted by polynomials in each patch (`patches.py`); what they are off from
these is the error of the mesh [1]_. Cells that lock have strains that go up and down from cell to
cell, which no smooth field has.

.. [1] O. C. Zienkiewicz and J. Z. Zhu, The superconvergent patch recovery and a posteriori error
   estimates, International Journal for Numerical Methods in Engineering 33 (1992) 1331-1382.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fem.assembly.patches import SURE, Patches, fitted, patches_of
from fem.assembly.solids import unseen_rows
from fem.base.arrays import FloatArray, IntArray
from fem.elements.shells import unit
from fem.elements.solids import gradients_and_volumes
from fem.mesh.cells import CellKind
from fem.mesh.structure_mesh import StructureMesh
from fem.model.structure import SolidCells

PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
"""How often each is in a symmetric tensor."""
RIDGE = {
    1: np.array([1e-9] + [1e-8] * 3 + [1e-4] * 2),
    2: np.array([1e-9] + [1e-8] * 3 + [1e-4] * 9),
}
"""For `fitted`, by the order of cells: slopes are asked for before what is of higher order."""
INNER = 1e-3
"""Weight of patches at the edge of a notch beside that of others."""
NOTCH_DEGREES = 230.0, 350.0
"""Angles of the material around the edge of a notch: inside a ring of 8 it is less."""
BATCH_BYTES = 5e7


def solid_errors(
    mesh: StructureMesh, pieces: Sequence[SolidCells], shapes: FloatArray
) -> FloatArray:
    """Twice the energy (m,) in J of what the strains of a part are off, in shapes (m, n, 6)."""
    order = max(piece.kind.order for piece in pieces)
    corners = [piece.nodes[:, : len(piece.kind.corners)] for piece in pieces]
    thin = [_thinness(mesh.points[block], pieces[0].kind.dimension) for block in corners]
    patches = patches_of(mesh.points, corners, [piece.nodes for piece in pieces], thin)
    size = len(RIDGE[order])
    normal = np.zeros((len(patches.size), size, size))
    right = np.zeros((len(patches.size), size, len(shapes) * len(PAIRS)))
    count = np.zeros(len(patches.size))
    for piece in pieces:
        for nodes, places, weights, strain in _at_best(piece, mesh, shapes):
            for column in nodes[:, : len(piece.kind.corners)].T:
                terms, turned = _seen_from(patches, column, places, strain, order)
                weighted = (terms * weights[..., None]).swapaxes(1, 2)
                normal += patches.sums(column, weighted @ terms)
                right += patches.sums(column, weighted @ turned)
                count += patches.sums(column, np.ones(len(column)))
    fits, known = fitted(normal, right, RIDGE[order])
    trust = count * known**SURE
    trust[patches.place[inner_corners(mesh.points, pieces)]] *= INNER
    found = np.zeros(len(shapes))
    for piece in pieces:
        found += _off(piece, mesh, shapes, patches, fits, trust, order)
    return found


def inner_corners(points: FloatArray, pieces: Sequence[SolidCells]) -> IntArray:
    """Nodes at the ends of edges into which solids have a notch, where strains are not smooth."""
    keys, angles = [], []
    for kind, nodes in ((piece.kind, piece.nodes) for piece in pieces):
        for first, second, *beside in _edges(kind):
            at, *ways = (points[nodes[:, node]] for node in (first, *beside))
            along = unit(points[nodes[:, second]] - at) if second != first else 0.0 * at
            across = [v - at - np.sum((v - at) * along, axis=1)[:, None] * along for v in ways]
            cosine = np.sum(unit(across[0]) * unit(across[1]), axis=1)
            angles.append(np.arccos(np.clip(cosine, -1.0, 1.0)))
            low, high = np.sort(nodes[:, [first, second]], axis=1).T
            keys.append(low * len(points) + high)
    edges, which = np.unique(np.concatenate(keys), return_inverse=True)
    whole = np.degrees(np.bincount(which, np.concatenate(angles)))
    inner = edges[(whole > NOTCH_DEGREES[0]) & (whole < NOTCH_DEGREES[1])]
    return np.unique(np.concatenate(np.divmod(inner, len(points))))


def _edges(kind: CellKind) -> Iterator[tuple[int, ...]]:
    """Ends of the edges of cells and the corners beside; in the plane those beside a corner."""
    next_to = [
        [b if a == n else a for a, b in kind.edges if n in (a, b)] for n in range(len(kind.corners))
    ]
    for first, second in (
        [(n, n) for n in range(len(next_to))] if kind.dimension == 2 else kind.edges
    ):
        yield first, second, *[n for n in next_to[first] if n != second][:2]


def _thinness(places: FloatArray, dimension: int) -> FloatArray:
    """Inverse of how the corners (e, c, 3) of cells spread, (e, 3, 3); none in the plane."""
    if dimension == 2:
        return np.broadcast_to(np.eye(3), (len(places), 3, 3))
    away = places - places.mean(axis=1, keepdims=True)
    return np.asarray(np.linalg.inv(away.swapaxes(1, 2) @ away / places.shape[1]))


def polynomials(at: FloatArray, order: int) -> FloatArray:
    """Terms (..., t) at x, y and height (..., 3): of bending, by the order of cells.

    Examples
    --------
    >>> polynomials(np.array([2.0, 3.0, 5.0]), 1)
    array([ 1.,  2.,  3.,  5., 10., 15.])
    """
    x, y, z = np.moveaxis(at, -1, 0)
    terms = [np.ones_like(x), x, y, z, x * z, y * z]
    if order == 2:
        terms += [x * x, x * y, y * y, z * z, x * x * z, x * y * z, y * y * z]
    return np.stack(terms, axis=-1)


def turning(axes: FloatArray) -> FloatArray:
    """Matrices (..., 6, 6) of the components `PAIRS` of tensors in axes (..., 3, 3) by rows.

    Examples
    --------
    >>> turned = turning(np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    >>> turned @ np.array([1.0, 2.0, 3.0, 0.5, 0.0, 0.0])
    array([ 2. ,  1. ,  3. , -0.5,  0. ,  0. ])
    """
    found = np.empty((*axes.shape[:-2], len(PAIRS), len(PAIRS)))
    for row, (i, j) in enumerate(PAIRS):
        for column, (m, n) in enumerate(PAIRS):
            found[..., row, column] = axes[..., i, m] * axes[..., j, n]
            if m != n:
                found[..., row, column] += axes[..., i, n] * axes[..., j, m]
    return found


def _seen_from(
    patches: Patches, corners: IntArray, places: FloatArray, strain: FloatArray, order: int
) -> tuple[FloatArray, FloatArray]:
    """Terms (e, q, t) and strains (e, q, 6 m) in the axes of the patches around corners (e,)."""
    at, axes = patches.coordinates(corners, places)
    thin = patches.thin[patches.place[corners]]
    turned = strain.copy()
    turned[thin] = turning(axes[thin]) @ strain[thin]
    return polynomials(at, order), turned.reshape(*at.shape[:2], -1)


def _batches(piece: SolidCells, shapes: FloatArray) -> Iterator[slice]:
    points = len(piece.kind.quadrature[1])
    step = max(int(BATCH_BYTES / (8 * points * (3 * piece.kind.node_count + 20 * len(shapes)))), 1)
    for first in range(0, len(piece.nodes), step):
        yield slice(first, first + step)


def best_places(kind: CellKind) -> tuple[FloatArray, FloatArray]:
    """Where strains of cells are the best, in the reference cell (q, d), and weights (q,)."""
    if kind.order == 1:
        return kind.quadrature
    return kind.reduced_quadrature if len(kind.corners) == 2**kind.dimension else kind.rule(2)


def _at_best(
    piece: SolidCells, mesh: StructureMesh, shapes: FloatArray
) -> Iterator[tuple[IntArray, FloatArray, FloatArray, FloatArray]]:
    """Nodes, places (e, q, 3), shares of the volume (e, q) and strains (e, q, 6, m), in batches."""
    at, weights = best_places(piece.kind)
    values, _ = piece.kind.basis(at)
    for batch in _batches(piece, shapes):
        nodes = piece.nodes[batch]
        gradients, volumes = _gradients(piece.kind, mesh.points[nodes], at)
        share = np.abs(volumes) * weights
        share /= share.sum(axis=1, keepdims=True)
        yield nodes, values @ mesh.points[nodes], share, _strains(gradients, shapes[:, nodes, :3])


def _gradients(
    kind: CellKind, coordinates: FloatArray, at: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Gradients (e, q, b, 3), zero along z in the plane, and the volumes of the mapping (e, q)."""
    d = kind.dimension
    gradients, volumes = gradients_and_volumes(kind, coordinates[..., :d], at)
    return np.pad(gradients, ((0, 0), (0, 0), (0, 0), (0, 3 - d))), volumes


def _strains(gradients: FloatArray, displacements: FloatArray) -> FloatArray:
    """Components `PAIRS` of strains (e, q, 6, m) of displacements (m, e, b, 3)."""
    e, q, b, _ = gradients.shape
    moved = np.moveaxis(displacements, 0, -1).reshape(e, b, -1)
    slope = gradients.swapaxes(2, 3).reshape(e, 3 * q, b) @ moved
    slope = slope.reshape(e, q, 3, 3, -1)
    return np.stack([(slope[:, :, i, j] + slope[:, :, j, i]) / 2.0 for i, j in PAIRS], axis=2)


def _off(
    piece: SolidCells,
    mesh: StructureMesh,
    shapes: FloatArray,
    patches: Patches,
    fits: FloatArray,
    trust: FloatArray,
    order: int,
) -> FloatArray:
    """Twice the energy (m,) of the differences of a piece's own strains and the smooth ones."""
    kind = piece.kind
    at, weights = kind.quadrature
    own_at = kind.reduced_quadrature[0] if piece.reduced else at
    linear = kind.of_first_order
    shares, first, mu = linear.basis(at)[0], *piece.part.lame
    between = shares @ np.linalg.inv(linear.basis(own_at)[0]) if piece.reduced else None
    found = np.zeros(len(shapes))
    for batch in _batches(piece, shapes):
        nodes = piece.nodes[batch]
        gradients, volume = _gradients(kind, mesh.points[nodes], own_at)
        off = -_strains(gradients, shapes[:, nodes, :3])
        if between is not None:
            off = np.einsum("pq,eqrm->eprm", between, off, optimize=True)
            _, volume = _gradients(kind, mesh.points[nodes], at)
        off += _smooth(
            nodes[:, : len(kind.corners)],
            kind.basis(at)[0] @ mesh.points[nodes],
            shares,
            patches,
            fits,
            trust,
            order,
        )
        volume = np.abs(volume) * weights * (piece.part.thickness or 1.0)
        density = first * off[:, :, :3].sum(axis=2) ** 2
        density += 2.0 * mu * np.einsum("r,eqrm->eqm", TWICE, off**2)
        found += np.einsum("eq,eqm->m", volume, density)
        if piece.reduced:
            rows, stiffness = unseen_rows(piece, mesh, batch)
            unseen = np.einsum("erbi,mebi->mer", rows, shapes[:, nodes, : kind.dimension])
            found += np.einsum("er,mer->m", stiffness, unseen**2)
    return found


def _smooth(
    corners: IntArray,
    places: FloatArray,
    shares: FloatArray,
    patches: Patches,
    fits: FloatArray,
    trust: FloatArray,
    order: int,
) -> FloatArray:
    """Smooth strains (e, q, 6, m): the fits of the patches of all corners, by their shares."""
    total = np.zeros((*places.shape[:2], len(PAIRS), fits.shape[2] // len(PAIRS)))
    whole = np.zeros(places.shape[:2])
    for column, share in zip(corners.T, shares.T, strict=True):
        at, axes = patches.coordinates(column, places)
        patch = patches.place[column]
        weight = np.maximum(share * trust[patch][:, None], np.finfo(np.float64).tiny)
        seen = (polynomials(at, order) * weight[..., None]) @ fits[patch]
        seen = seen.reshape(total.shape)
        thin = patches.thin[patch]
        seen[thin] = turning(axes[thin].swapaxes(-1, -2)) @ seen[thin]
        total += seen
        whole += weight
    return np.asarray(total / whole[..., None, None])
