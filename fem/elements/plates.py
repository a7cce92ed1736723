"""Bending of flat plates with transverse shear: curvatures and shear strains that do not lock.

Rotations are the right-handed ones a about x and b about y; a point at the height z moves by
(z b, -z a) in the plane. With beta = (b, -a) the curvatures are the strains of beta and the
transverse shear strains are grad w + beta. Taken as they are, the latter cannot vanish in a thin
plate that bends; they are interpolated from places where they can.
"""

from __future__ import annotations

import numpy as np

from fem.base.arrays import FloatArray
from fem.elements.membranes import split_strains
from fem.mesh.cells import CellKind

SHIFT = 1e-4
"""Places of MITC3+ on the medians lie this far from the middle, as its authors have it."""


def plate_rows(
    kind: CellKind,
    corners: FloatArray,
    places: FloatArray,
    weights: FloatArray,
    bending_law: FloatArray,
    shear_stiffness: float,
) -> tuple[FloatArray, FloatArray]:
    """Deformations (e, 5 q, 3 b) from (w, a, b) at each corner, and their stiffness (e, 5 q).

    Parameters
    ----------
    kind
        "triangle" or "quad".
    corners
        In the plane, in m, shape (e, b, 2).
    places, weights
        Of integration in the reference cell, shape (q, 2) and (q,).
    bending_law
        Stiffness (3,) of the sum, difference and shear of curvatures, in N m.
    shear_stiffness
        Shear modulus times thickness times 5/6, in N/m.

    Notes
    -----
    Quadrilaterals are the MITC4 element of E. N. Dvorkin and K. J. Bathe, A continuum mechanics
    based four-node shell element for general nonlinear analysis, Engineering Computations 1 (1984)
    77-88, for flat cells; triangles are the MITC3+ of Y. Lee, P.-S. Lee and K.-J. Bathe, The MITC3+
    shell element and its performance, Computers & Structures 138 (2014) 12-23, whose rotation of
    the middle is eliminated from each cell.
    """
    curvature, area = curvatures(kind, corners, places)
    if kind.name == "quad":
        shear = quad_shears(kind, corners, places)
    else:
        shear = triangle_shears(kind, corners, places)
    volume = area * weights
    stiffness = np.concatenate(
        [volume[..., None] * bending_law, shear_stiffness * volume[..., None] * np.ones(2)], axis=2
    ).reshape(len(corners), -1)
    rows = np.concatenate([split_strains(curvature), shear], axis=2)
    rows = rows.reshape(len(corners), stiffness.shape[1], -1)
    return condensed(rows, stiffness, 3 * kind.node_count), stiffness


def condensed(rows: FloatArray, stiffness: FloatArray, kept: int) -> FloatArray:
    """Rows (e, r, kept) in which the other unknowns take their values of least energy."""
    own, other = rows[..., :kept], rows[..., kept:]
    if not other.shape[2]:
        return own
    weighted = (stiffness[..., None] * other).transpose(0, 2, 1)
    answer = np.linalg.solve(weighted @ other, weighted @ own)
    return np.asarray(own - other @ answer, dtype=np.float64)


def unknowns(kind: CellKind) -> int:
    """Number of unknowns of a cell: three a corner; two of the middle of a triangle."""
    return 3 * kind.node_count + (2 if kind.name == "triangle" else 0)


def rotation_shapes(kind: CellKind, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shape functions of rotations (q, s) and their gradients (q, s, 2), with the bubble."""
    values, slopes = kind.basis(places)
    if kind.name == "quad":
        return values, slopes
    r, s = places.T
    bubble = 27.0 * r * s * (1.0 - r - s)
    slope = 27.0 * np.stack([s * (1.0 - 2.0 * r - s), r * (1.0 - r - 2.0 * s)], axis=-1)
    return (
        np.concatenate([values, bubble[:, None]], axis=1),
        np.concatenate([slopes, slope[:, None]], axis=1),
    )


def rotation_columns(kind: CellKind) -> FloatArray:
    """Columns (s, 2) of the rotations a and b that belong to each shape function."""
    first = 3 * np.arange(kind.node_count) + 1
    if kind.name == "triangle":
        first = np.append(first, 3 * kind.node_count)
    return np.stack([first, first + 1], axis=1)


def jacobians(kind: CellKind, corners: FloatArray, places: FloatArray) -> FloatArray:
    """J[e, q, i, j] = dx_i / dX_j."""
    found = np.einsum("ebi,qbj->eqij", corners, kind.basis(places)[1], optimize=True)
    return np.asarray(found, dtype=np.float64)


def curvatures(
    kind: CellKind, corners: FloatArray, places: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Curvatures (e, q, 3, m) as (xx, yy, 2 xy), and the area (e, q) of the mapping."""
    J = jacobians(kind, corners, places)
    slopes = np.matmul(rotation_shapes(kind, places)[1], np.linalg.inv(J))
    dx, dy = slopes[..., 0], slopes[..., 1]
    a, b = rotation_columns(kind).T
    found = np.zeros((*J.shape[:2], 3, unknowns(kind)))
    found[:, :, 0, b], found[:, :, 1, a] = dx, -dy
    found[:, :, 2, b], found[:, :, 2, a] = dy, -dx
    return found, np.linalg.det(J)


def covariant_shears(kind: CellKind, corners: FloatArray, places: FloatArray) -> FloatArray:
    """Shear strains along the lines of the reference cell, (e, q, 2, m): dw/dX_j + beta_i J_ij."""
    J = jacobians(kind, corners, places)
    values, _ = rotation_shapes(kind, places)
    found = np.zeros((*J.shape[:2], 2, unknowns(kind)))
    found[..., 3 * np.arange(kind.node_count)] = kind.basis(places)[1].transpose(0, 2, 1)
    a, b = rotation_columns(kind).T
    found[..., b] = values[:, None, :] * J[:, :, 0, :, None]
    found[..., a] = -values[:, None, :] * J[:, :, 1, :, None]
    return found


def quad_shears(kind: CellKind, corners: FloatArray, places: FloatArray) -> FloatArray:
    """MITC4: along each direction linear between the middles of the two edges that run so."""
    middles = np.array([[0.5, 0.0], [0.5, 1.0], [0.0, 0.5], [1.0, 0.5]])
    at = covariant_shears(kind, corners, middles)
    X, Y = places.T[..., None]
    first = at[:, [0], 0] * (1.0 - Y) + at[:, [1], 0] * Y
    second = at[:, [2], 1] * (1.0 - X) + at[:, [3], 1] * X
    return to_plane(kind, corners, places, np.stack([first, second], axis=2))


def triangle_shears(kind: CellKind, corners: FloatArray, places: FloatArray) -> FloatArray:
    """MITC3+: a linear field from three places inside and three near the middle."""
    third, d = 1.0 / 3.0, SHIFT
    ties = np.array(
        [
            [1 / 6, 2 / 3],
            [2 / 3, 1 / 6],
            [1 / 6, 1 / 6],
            [third + d, third - 2 * d],
            [third - 2 * d, third + d],
            [third + d, third + d],
        ]
    )
    at = covariant_shears(kind, corners, ties)
    r, s = at[:, :, 0], at[:, :, 1]
    middle = (r[:, 2] + s[:, 2]) * third
    turn = (r[:, 5] - r[:, 3] - s[:, 5] + s[:, 4]) * third
    X, Y = places.T[..., None]
    first = ((2 * r[:, 1] - s[:, 1]) * third + middle)[:, None] + turn[:, None] * (3 * Y - 1)
    second = ((2 * s[:, 0] - r[:, 0]) * third + middle)[:, None] + turn[:, None] * (1 - 3 * X)
    return to_plane(kind, corners, places, np.stack([first, second], axis=2))


def to_plane(
    kind: CellKind, corners: FloatArray, places: FloatArray, covariant: FloatArray
) -> FloatArray:
    """Shear strains (e, q, 2, m) along x and y from those along the reference cell's lines."""
    J = jacobians(kind, corners, places)
    return np.asarray(np.linalg.solve(J.transpose(0, 1, 3, 2), covariant), dtype=np.float64)
