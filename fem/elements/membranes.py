"""The membrane of flat triangles with a rotation about the normal at each corner.

This is the optimal triangle of C. A. Felippa, A study of optimal membrane triangles with drilling
freedoms, Computer Methods in Applied Mechanics and Engineering 192 (2003) 2125-2168: a part that
carries constant strains exactly and a part for the corners' rotations against the triangle's own.
Rectangles of two such triangles bend exactly in their plane at any ratio of their sides. The
rotations are true ones with a true stiffness; nothing fictitious holds them.
"""

from __future__ import annotations

import numpy as np

from fem.base.arrays import FloatArray

LIFT = 1.5
"""How much of a corner's rotation moves the edges: Felippa's alpha_b, that of Allman's triangle."""
COEFFICIENTS = (1.0, 2.0, 1.0, 0.0, 1.0, -1.0, -1.0, -1.0, -2.0)
"""Felippa's beta_1 to beta_9."""
CORNERS = ((0, 1, 2, 3, 4, 5, 6, 7, 8), (8, 6, 7, 2, 0, 1, 5, 3, 4), (4, 5, 3, 7, 8, 6, 1, 2, 0))
"""Which of the coefficients relate strains along the edges at a corner to the rotations."""
LEAST_WEIGHT = 0.01  # of the higher strains, which vanish at a Poisson's ratio of 1/2


def membrane_rows(
    corners: FloatArray, stretching: float, poissons_ratio: float, reduction: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Deformations (e, 6, 9) of triangles from (u, v, rotation) at each corner, and stiffness.

    Parameters
    ----------
    corners
        In the plane, in m, counter-clockwise, shape (e, 3, 2).
    stretching
        E t / (1 - nu²) in N/m.
    poissons_ratio
        nu.
    reduction
        Factors (e,), from 0 to 1, on the stiffness against the corners' rotations. Any above 0
        leaves constant strains exact; with 1 bending in the plane is the best.

    Returns
    -------
    rows, stiffness
        The sum of mean strains, their difference, their shear, and three of the corners'
        rotations; K is the sum of the rows' squares times the stiffness (e, 6).

    Examples
    --------
    >>> rows, stiffness = membrane_rows(
    ...     np.array([[[0, 0], [1, 0], [0, 1.0]]]), 1.0, 0.0, np.ones(1)
    ... )
    >>> turned = np.array([0, 0, 1, 0, 1, 1, -1, 0, 1.0])
    >>> bool(np.abs(rows @ turned).max() < 1e-15)
    True
    """
    law = plane_law(stretching, poissons_ratio)
    area = areas(corners)
    mean = split_strains(mean_strains(corners, area))
    factor = np.linalg.cholesky(rotation_stiffness(corners, area, law, poissons_ratio))
    own = corner_rotations(corners, area)
    rows = np.concatenate([mean, factor.transpose(0, 2, 1) @ own], axis=1)
    turning = np.repeat(reduction[:, None], 3, axis=1)
    weights = np.concatenate([area[:, None] * law, turning], axis=1)
    return rows, weights


def plane_law(stretching: float, poissons_ratio: float) -> FloatArray:
    """Stiffness (3,) of the sum, the difference and the shear of strains in plane stress."""
    half = (1.0 - poissons_ratio) / 2.0
    return stretching * np.array([(1.0 + poissons_ratio) / 2.0, half, half])


def split_strains(strains: FloatArray) -> FloatArray:
    """Rows (..., 3, m) of (xx, yy, 2 xy) as sum, difference and shear, which do not mix."""
    xx, yy, xy = np.moveaxis(strains, -2, 0)
    return np.stack([xx + yy, xx - yy, xy], axis=-2)


def areas(corners: FloatArray) -> FloatArray:
    """Areas (e,) of triangles (e, 3, 2), negative when clockwise."""
    (x1, y1), (x2, y2), (x3, y3) = np.moveaxis(corners, 0, -1)
    return np.asarray(((x2 - x1) * (y3 - y1) - (x3 - x1) * (y2 - y1)) / 2.0, dtype=np.float64)


def mean_strains(corners: FloatArray, area: FloatArray) -> FloatArray:
    """Mean strains (e, 3, 9), as (xx, yy, 2 xy): Felippa's force-lumping matrix over the area."""
    found = np.zeros((len(corners), 3, 9))
    for i in range(3):
        (x, y), (xj, yj), (xk, yk) = (corners[:, (i + n) % 3].T for n in range(3))
        y_jk, x_kj = yj - yk, xk - xj
        found[:, 0, 3 * i] = found[:, 2, 3 * i + 1] = y_jk
        found[:, 1, 3 * i + 1] = found[:, 2, 3 * i] = x_kj
        # the sides next to the corner: from it to k and from j to it
        found[:, 0, 3 * i + 2] = LIFT / 6.0 * y_jk * ((y - yk) - (yj - y))
        found[:, 1, 3 * i + 2] = LIFT / 6.0 * x_kj * ((xk - x) - (x - xj))
        found[:, 2, 3 * i + 2] = LIFT / 3.0 * ((xk - x) * (y - yk) - (x - xj) * (yj - y))
    return np.asarray(found / (2.0 * area[:, None, None]), dtype=np.float64)


def corner_rotations(corners: FloatArray, area: FloatArray) -> FloatArray:
    """Rotations of the corners less that of the triangle, (e, 3, 9)."""
    found = np.zeros((len(corners), 3, 9))
    for i in range(3):
        (xj, yj), (xk, yk) = (corners[:, (i + n) % 3].T for n in (1, 2))
        found[:, :, 3 * i] = ((xk - xj) / (4.0 * area))[:, None]
        found[:, :, 3 * i + 1] = ((yk - yj) / (4.0 * area))[:, None]
        found[:, i, 3 * i + 2] = 1.0
    return found


def rotation_stiffness(
    corners: FloatArray, area: FloatArray, law: FloatArray, poissons_ratio: float
) -> FloatArray:
    """Stiffness (e, 3, 3) against the corners' rotations less that of the triangle."""
    natural = np.sqrt(law)[:, None] * split_strains(from_edges(corners))
    return turning_stiffness(corners, area, natural, np.full(len(area), poissons_ratio))


def turning_stiffness(
    corners: FloatArray, area: FloatArray, natural: FloatArray, poissons_ratio: FloatArray
) -> FloatArray:
    """The same from rows (e, 3, 3) of strains along the edges whose squares are the energy."""
    weight = np.maximum((1.0 - 4.0 * poissons_ratio**2) / 2.0, LEAST_WEIGHT)
    sides = corners[:, [1, 2, 0]] - corners[:, [0, 1, 2]]
    scale = (2.0 * area[:, None] / 3.0) / np.sum(sides**2, axis=2)
    beta = np.array(COEFFICIENTS)
    Q = [scale[:, :, None] * beta[list(each)].reshape(3, 3) for each in CORNERS]
    found = np.zeros((len(corners), 3, 3))
    for first, second in ((0, 1), (1, 2), (2, 0)):
        rows = natural @ ((Q[first] + Q[second]) / 2.0)
        found += rows.transpose(0, 2, 1) @ rows
    return np.asarray(0.75 * (weight * area)[:, None, None] * found, dtype=np.float64)


def from_edges(corners: FloatArray) -> FloatArray:
    """The matrices (e, 3, 3) from strains along the edges 12, 23, 31 to (xx, yy, 2 xy)."""
    sides = corners[:, [1, 2, 0]] - corners[:, [0, 1, 2]]
    x, y = sides[..., 0], sides[..., 1]
    along = np.stack([x**2, y**2, x * y], axis=-1) / np.sum(sides**2, axis=2)[..., None]
    return np.asarray(np.linalg.inv(along), dtype=np.float64)
