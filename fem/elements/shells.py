"""Shells of flat facets: from material and thickness to the matrices of triangles and quads."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.elements.beams import cross_matrix
from fem.elements.laminates import section_rows
from fem.elements.membranes import areas, membrane_rows, plane_law
from fem.elements.plates import jacobians, plate_rows
from fem.mesh.cells import CellKind
from fem.model.parts import ShellPart

TRIANGLES = {
    "triangle": ((1.0, (0, 1, 2)),),
    "quad": ((0.5, (0, 1, 2)), (0.5, (0, 2, 3)), (0.5, (0, 1, 3)), (0.5, (1, 2, 3))),
}
"""The membrane of a quadrilateral is the mean of its two cuts into triangles."""
ORDERS = {"triangle": 4, "quad": 2}
"""Polynomial order that is integrated exactly: the rotation of a triangle's middle is a cubic."""
SMOOTH_DEGREES = 30.0
"""Facets that meet at less than this angle are taken for one smooth surface."""
BATCH_BYTES = 1e8
FLAT = 1e-9  # of its squared diameter: area of a facet that has none


@dataclass(frozen=True, eq=False)
class FlatCells:
    """Facets in planes of their own.

    Parameters
    ----------
    axes
        Unit vectors x, y and the normal z as rows, shape (e, 3, 3).
    plane
        Places of the corners in the plane, in m, shape (e, b, 2).
    heights
        Of the corners above the plane, shape (e, b): zero for triangles, of alternate signs for
        warped quadrilaterals.
    """

    axes: FloatArray
    plane: FloatArray
    heights: FloatArray


def flat_cells(corners: FloatArray) -> FlatCells:
    """The planes of facets (e, b, 3); a quadrilateral's is parallel to both of its diagonals."""
    if corners.shape[1] == 3:
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        x = corners[:, 1] - corners[:, 0]
    else:
        first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
        normal, x = np.cross(first, second), first - second
    z, x = unit(normal), unit(x)
    axes = np.stack([x, np.cross(z, x), z], axis=1)
    local = np.einsum("eij,ebj->ebi", axes, corners - corners.mean(axis=1, keepdims=True))
    return FlatCells(axes, local[..., :2], local[..., 2])


def facet_rule(kind: CellKind) -> tuple[FloatArray, FloatArray]:
    """Places (q, 2) and weights (q,) of a facet's bending and mass."""
    return kind.rule(ORDERS[kind.name])


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) of length 1, or of zeros."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0), dtype=np.float64)


def check_shape(kind: CellKind, cells: FlatCells, nodes: IntArray, what: str) -> None:
    """Raise ModelError for a facet without area, or with a corner that points inwards."""
    area = np.linalg.det(jacobians(kind, cells.plane, kind.corners))
    size = np.linalg.norm(np.ptp(cells.plane, axis=1), axis=1) ** 2
    bad = np.flatnonzero(~(area > FLAT * size[:, None]).all(axis=1))
    if len(bad):
        listed = ", ".join(str(node) for node in nodes[bad[0]])
        raise ModelError(
            f"{what}: the {kind.name} with the nodes {listed} is flat, folded or has a corner of"
            " 180° or more"
        )


def check_sides(kinds: Sequence[IntArray], what: str) -> None:
    """Raise ModelError if two neighbours have their normals on different sides.

    Neighbours whose nodes run the same way round pass along their common edge in opposite
    directions.
    """
    edges = np.concatenate(
        [np.stack([n, np.roll(n, -1, axis=1)], axis=-1).reshape(-1, 2) for n in kinds]
    )
    edges, count = np.unique(edges, axis=0, return_counts=True)
    if count.max() > 1:
        first, second = edges[np.argmax(count > 1)]
        raise ModelError(
            f"{what}: it has an offset, but two of its cells that meet at the nodes {first} and"
            f" {second} have their normals on different sides; turn the order of the nodes of one"
        )


def node_matrices(part: ShellPart, cells: FlatCells) -> FloatArray:
    """Six displacements of the middle surface in local axes from those of a node, (e, b, 6, 6)."""
    arms = (part.offset - cells.heights)[..., None] * cells.axes[:, None, 2]
    T = np.zeros((*arms.shape[:2], 6, 6))
    T[..., :3, :3] = T[..., 3:, 3:] = cells.axes[:, None]
    T[..., :3, 3:] = cells.axes[:, None] @ -cross_matrix(arms)
    return T


def section_angles(part: ShellPart, cells: FlatCells) -> FloatArray:
    """Angles (e,) in radians from the x axes of facets to those of a part's section."""
    if isinstance(part.direction, tuple):
        x, y = np.moveaxis(cells.axes[:, :2] @ np.array(part.direction), -1, 0)
        if not (np.hypot(x, y) > 0.0).all():
            raise ModelError(f"shell part: a cell lies across its direction {part.direction}")
        return np.asarray(np.arctan2(y, x))
    side = cells.plane[:, 1] - cells.plane[:, 0]
    return np.asarray(np.arctan2(side[:, 1], side[:, 0]) + np.radians(part.direction))


def local_rows(
    part: ShellPart,
    kind: CellKind,
    plane: FloatArray,
    reduction: FloatArray,
    angles: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Deformations (e, r, b, 6) of flat facets and their stiffness (e, r), in local axes."""
    if part.section is not None:
        pieces = TRIANGLES[kind.name]
        return section_rows(part.section, kind, plane, angles, pieces, facet_rule(kind), reduction)
    nu = part.material.poissons_ratio_for("shell part")
    count, b = plane.shape[:2]
    rows, stiffness = [], []
    for share, corners in TRIANGLES[kind.name]:
        at = list(corners)
        own, weight = membrane_rows(plane[:, at], share * part.stretching, nu, reduction)
        block = np.zeros((count, own.shape[1], b, 6))
        block[:, :, np.array(at)[:, None], [0, 1, 5]] = own.reshape(count, -1, 3, 3)
        rows.append(block)
        stiffness.append(weight)
    places, weights = facet_rule(kind)
    law = plane_law(part.stretching * part.thickness**2 / 12.0, nu)
    bent, weight = plate_rows(kind, plane, places, weights, law, part.shearing)
    block = np.zeros((count, bent.shape[1], b, 6))
    block[..., 2:5] = bent.reshape(count, -1, b, 3)
    return np.concatenate([*rows, block], axis=1), np.concatenate([*stiffness, weight], axis=1)


def local_mass(part: ShellPart, kind: CellKind, plane: FloatArray) -> FloatArray:
    """Consistent mass (e, b, 6, b, 6) in local axes, with the inertia of turning fibres.

    Rotations about the normal have that inertia against the turn of the cell in its plane alone,
    so that a rigid body has its own.
    """
    places, weights = facet_rule(kind)
    values, slopes = kind.basis(places)
    J = jacobians(kind, plane, places)
    volume = np.linalg.det(J) * weights
    products = np.einsum("eq,qa,qc->eac", volume, values, values, optimize=True)
    mass, inertia = part.mass, part.inertia
    count, b = plane.shape[:2]
    M = np.zeros((count, b, 6, b, 6))
    for axis in range(5):
        M[:, :, axis, :, axis] = (mass if axis < 3 else inertia) * products
    turn = np.zeros((count, len(weights), b, 6))
    gradient = np.matmul(slopes, np.linalg.inv(J))
    turn[..., 0], turn[..., 1] = gradient[..., 1] / 2.0, -gradient[..., 0] / 2.0
    turn[..., 5] = values
    M += np.einsum("eq,eqai,eqcj->eaicj", inertia * volume, turn, turn, optimize=True)
    return M


def corner_normals(points: FloatArray, kinds: Sequence[IntArray]) -> list[FloatArray]:
    """Normals (e, b, 3) of the surface at the corners of facets, for each array of nodes (e, b).

    The mean of the normals of the facets that meet there and belong to one smooth surface with
    this one, whichever way round their nodes are.

    Examples
    --------
    >>> points = np.array([[0, 0, 0], [1, 0, 0.1], [1, 1, 0.1], [0, 1, 0], [2, 0, 0], [2, 1, 0.0]])
    >>> normals = corner_normals(points, [np.array([[0, 1, 2, 3], [1, 4, 5, 2]])])[0]
    >>> np.round(normals[0, :2], 4)
    array([[-0.0995,  0.    ,  0.995 ],
           [ 0.    ,  0.    ,  1.    ]])
    """
    flat = [np.repeat(flat_cells(points[n]).axes[:, 2], n.shape[1], axis=0) for n in kinds]
    normal, node = np.concatenate(flat), np.concatenate([n.ravel() for n in kinds])
    at = (np.arange(len(node)), node)
    meets = sparse.csr_array((np.ones(len(node)), at), shape=(len(node), len(points)))
    pairs = sparse.coo_array(meets @ meets.T)
    one, other = pairs.coords
    cosine = np.einsum("pi,pi->p", normal[one], normal[other])
    weight = np.sign(cosine) * (np.abs(cosine) > np.cos(np.radians(SMOOTH_DEGREES)))
    mean = sparse.csr_array((weight, (one, other)), shape=pairs.shape) @ normal
    mean = unit(mean)
    ends = np.cumsum([n.size for n in kinds])[:-1]
    return [part.reshape(*n.shape, 3) for part, n in zip(np.split(mean, ends), kinds, strict=True)]


def curvature_reduction(part: ShellPart, cells: FlatCells, normals: FloatArray) -> FloatArray:
    """Factors (e,) on the stiffness against rotations about the normal where a shell is curved.

    Notes
    -----
    Where the surface turns by the angle alpha from the middle of a facet of size h to its corners,
    bending with the curvature k turns these by k h about lines in the surface, of which k h alpha
    is about the normal of the facet. As stretching this costs E t (k h alpha)², which is
    12 (alpha h / t)² times what bending itself does, E t³ k²/12, and a coarse thin shell would
    lock. Divided by 1 plus this ratio it costs as much at most; on a flat or a finely divided
    shell the factor is 1.
    """
    turned = np.linalg.norm(normals - cells.axes[:, None, 2], axis=2).max(axis=1)
    ratio = 12.0 * turned**2 * box_area(cells.plane) / part.thickness**2
    return np.asarray(1.0 / (1.0 + ratio), dtype=np.float64)


def box_area(plane: FloatArray) -> FloatArray:
    """Areas (e,) of quadrilaterals (e, 4, 2), and twice those of triangles (e, 3, 2)."""
    first = areas(plane[:, :3])
    return 2.0 * first if plane.shape[1] == 3 else first + areas(plane[:, [0, 2, 3]])


def slant_reduction(plane: FloatArray) -> FloatArray:
    """Factors (e,) on the same stiffness where a slender facet has slanting sides.

    Notes
    -----
    With all of that stiffness rectangles, and the right-angled triangles that they are cut into,
    bend exactly in their plane; slanting facets are too stiff, the more so the more slender they
    are. With the cosine c of the corner that is farthest from a right angle (of a triangle the
    nearest) and the square r of the longest side over the area of the box the factor is
    1/(1 + (c r)²). This is measured, not derived: on the slender beam of trapezoids of MacNeal and
    Harder it takes most of the excess away and it leaves rectangles as they are.

    Examples
    --------
    >>> slant_reduction(np.array([[[0, 0], [5, 0], [5, 1], [0, 1.0]]]))
    array([1.])
    """
    sides = np.roll(plane, -1, axis=1) - plane
    length = np.linalg.norm(sides, axis=2)
    products = np.einsum("ebi,ebi->eb", sides, np.roll(sides, 1, axis=1))
    cosine = np.abs(products) / (length * np.roll(length, 1, axis=1))
    corner = cosine.min(axis=1) if plane.shape[1] == 3 else cosine.max(axis=1)
    slant = corner * length.max(axis=1) ** 2 / box_area(plane)
    return np.asarray(1.0 / (1.0 + slant**2), dtype=np.float64)


def shell_rows(
    part: ShellPart,
    kind: CellKind,
    points: FloatArray,
    nodes: IntArray,
    normals: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Deformations (e, r, 6 b) of facets from their nodes' displacements, and stiffness (e, r).

    The normals (e, b, 3) are those of `corner_normals`.
    """
    cells = flat_cells(points[nodes])
    reduction = curvature_reduction(part, cells, normals) * slant_reduction(cells.plane)
    rows, stiffness = local_rows(part, kind, cells.plane, reduction, section_angles(part, cells))
    found = np.matmul(rows.transpose(0, 2, 1, 3), node_matrices(part, cells))
    return found.transpose(0, 2, 1, 3).reshape(*stiffness.shape, -1), stiffness


def shell_matrices(
    part: ShellPart, kind: CellKind, points: FloatArray, nodes: IntArray, normals: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Stiffness and mass (e, 6 b, 6 b) of facets for the six displacements of their nodes."""
    rows, stiffness = shell_rows(part, kind, points, nodes, normals)
    K = np.matmul((rows * stiffness[..., None]).transpose(0, 2, 1), rows)
    cells = flat_cells(points[nodes])
    T = node_matrices(part, cells)
    M = local_mass(part, kind, cells.plane)
    M = np.einsum("eaki,eakcl,eclj->eaicj", T, M, T, optimize=True).reshape(K.shape)
    return (K + K.transpose(0, 2, 1)) / 2.0, (M + M.transpose(0, 2, 1)) / 2.0


def facet_batches(kind: CellKind, count: int) -> Iterator[slice]:
    """Slices of so many facets that their matrices stay small."""
    step = max(int(BATCH_BYTES / (8 * 6 * (6 * kind.node_count) ** 2)), 1)
    for first in range(0, count, step):
        yield slice(first, min(first + step, count))
