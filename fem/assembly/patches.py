"""Patches: the cells around each corner of a mesh, in which stresses are smoothed.

Where cells are clearly thin in one direction a patch is taken for a piece of a thin part: its third
axis is that direction, its middle is z = q(x, y), of second order, heights count from it, and
tensors are turned into its tangent plane, so that what is smooth along a curved part is a
polynomial. Other patches have the axes of the mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy import sparse

from fem.base.arrays import FloatArray, IntArray
from fem.elements.shells import unit

THIN = 2.0
"""Ratio of the squares of two lengths of cells from which a patch is thin."""
FLAT_RIDGE = 1e-11
CURVED_RIDGE = 1e-9
"""Of the trace of the normal equations: hold what the nodes of a patch do not determine."""
SURE = 4
"""Power of how well determined the fit of a patch is: its weight beside its neighbours'."""


@dataclass(frozen=True, eq=False)
class Patches:
    """The cells around p corners.

    Parameters
    ----------
    place
        Which patch belongs to a corner of the mesh by its number, -1 where none.
    centres, axes, size
        Of each, in m, shape (p, 3), (p, 3, 3) by rows, and (p,).
    thin
        Whether each is a piece of a thin part, shape (p,).
    surface
        Coefficients of z over the size by those of 1, x, y, x², x y, y², shape (p, 6).
    height
        Greatest height over the size, shape (p,).
    """

    place: IntArray
    centres: FloatArray
    axes: FloatArray
    size: FloatArray
    thin: npt.NDArray[np.bool_]
    surface: FloatArray
    height: FloatArray

    def __repr__(self) -> str:
        return f"Patches({len(self.size)})"

    def sums(self, corners: IntArray, values: FloatArray) -> FloatArray:
        """Sums (p, ...) over patches of values (e, ...) of cells with one of these corners (e,)."""
        return _sums(self.place[corners], values, len(self.size))

    def local(self, corners: IntArray, places: FloatArray) -> FloatArray:
        """Places (e, q, 3) in the patches of corners (e,), over their size."""
        at = self.place[corners]
        away = places - self.centres[at][:, None]
        return np.asarray(away @ self.axes[at].swapaxes(1, 2) / self.size[at][:, None, None])

    def coordinates(self, corners: IntArray, places: FloatArray) -> tuple[FloatArray, FloatArray]:
        """x, y and height (e, q, 3), each of order 1, and the tangent axes there (e, q, 3, 3)."""
        at = self.place[corners]
        found = self.local(corners, places)
        x, y = found[..., 0], found[..., 1]
        c = self.surface[at][:, None]
        found[..., 2] -= np.sum(c * quadratics(x, y), axis=-1)
        found[..., 2] /= self.height[at][:, None]
        slope = c[..., 1] + 2.0 * c[..., 3] * x + c[..., 4] * y
        rise = c[..., 2] + c[..., 4] * x + 2.0 * c[..., 5] * y
        normal = unit(np.stack([-slope, -rise, np.ones_like(x)], axis=-1))
        first = unit(np.stack([np.ones_like(x), np.zeros_like(x), slope], axis=-1))
        turned = np.stack([first, np.cross(normal, first), normal], axis=-2)
        return found, turned @ self.axes[at][:, None]


def patches_of(
    points: FloatArray,
    corners: Sequence[IntArray],
    nodes: Sequence[IntArray],
    thinness: Sequence[FloatArray],
) -> Patches:
    """The patches of cells given by blocks.

    Parameters
    ----------
    points
        Of the mesh in m, shape (n, 3).
    corners
        Numbers of the corners of the cells of each block, shape (e, c): cells with the same one
        share a patch.
    nodes
        Of the same cells, corners first, shape (e, b).
    thinness
        Tensors (e, 3, 3) whose greatest eigenvalues belong to the directions in which cells are
        thin, and grow with the inverse square of the thickness.
    """
    used = np.unique(np.concatenate([block.ravel() for block in corners]))
    place = np.full(used[-1] + 1, -1)
    place[used] = np.arange(len(used))
    total = np.zeros((len(used), 13))
    for block, own_nodes, tensor in zip(corners, nodes, thinness, strict=True):
        middle = points[own_nodes[:, : block.shape[1]]].mean(axis=1)
        own = np.column_stack([np.ones(len(block)), middle, tensor.reshape(-1, 9)])
        for column in block.T:
            total += _sums(place[column], own, len(used))
    centres = total[:, 1:4] / total[:, :1]
    values, vectors = np.linalg.eigh(total[:, 4:].reshape(-1, 3, 3))
    size = np.zeros(len(used))
    for block, own_corners in zip(nodes, corners, strict=True):
        for column in own_corners.T:
            away = points[block] - centres[place[column]][:, None]
            np.maximum.at(size, place[column], np.linalg.norm(away, axis=2).max(axis=1))
    none = np.zeros((len(used), 6))
    thin = values[:, 2] > THIN * values[:, 1]
    axes = np.where(thin[:, None, None], vectors.swapaxes(1, 2), np.eye(3))
    flat = Patches(place, centres, axes, size, thin, none, np.ones(len(used)))
    return _with_surface(flat, points, corners, nodes)


def _with_surface(
    flat: Patches,
    points: FloatArray,
    corners: Sequence[IntArray],
    nodes: Sequence[IntArray],
) -> Patches:
    """The patches with the middles of the thin ones, through all nodes, and their heights."""
    count = len(flat.size)
    normal, right = np.zeros((count, 6, 6)), np.zeros((count, 6))
    for block, own in zip(nodes, corners, strict=True):
        for column in own.T:
            at = flat.local(column, points[block])
            terms = quadratics(at[..., 0], at[..., 1])
            normal += flat.sums(column, terms.swapaxes(1, 2) @ terms)
            right += flat.sums(column, np.einsum("ebt,eb->et", terms, at[..., 2]))
    ridge = np.diag([FLAT_RIDGE] * 3 + [CURVED_RIDGE] * 3)
    normal += np.trace(normal, axis1=1, axis2=2)[:, None, None] * ridge
    answer = np.linalg.solve(normal, right[..., None])[..., 0]
    surface = np.asarray(answer * flat.thin[:, None], dtype=np.float64)
    height = np.zeros(count)
    for block, own in zip(nodes, corners, strict=True):
        for column in own.T:
            at = flat.local(column, points[block])
            level = np.einsum(
                "ebt,et->eb", quadratics(at[..., 0], at[..., 1]), surface[flat.place[column]]
            )
            np.maximum.at(height, flat.place[column], np.abs(at[..., 2] - level).max(axis=1))
    height = np.maximum(height, np.finfo(np.float64).eps)
    return replace(flat, surface=surface, height=height)


def quadratics(x: FloatArray, y: FloatArray) -> FloatArray:
    """1, x, y, x², x y and y² along a last axis."""
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)


def fitted(
    normal: FloatArray, right: FloatArray, ridge: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Coefficients (p, t, k) of fits by least squares, and how well determined each fit is, (p,).

    Parameters
    ----------
    normal, right
        The normal equations, shape (p, t, t) and (p, t, k).
    ridge
        What is added to the diagonal, over the trace, shape (t,): it leaves out the terms that the
        patch does not determine.

    Examples
    --------
    Two values at x = -1 and 1 determine a line, but no parabola:

    >>> x = np.array([-1.0, 1.0])
    >>> terms = np.stack([x**0, x, x**2], axis=1)[None]
    >>> right = terms.swapaxes(1, 2) @ np.array([[[1.0], [3.0]]])
    >>> found, sure = fitted(terms.swapaxes(1, 2) @ terms, right, np.array([1e-9, 1e-9, 1e-4]))
    >>> np.abs(np.round(found[0, :, 0], 3)), round(float(sure[0]), 3)
    (array([2., 1., 0.]), 0.667)
    """
    held = normal + np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.diag(ridge)
    answer = np.linalg.solve(held, np.concatenate([right, normal], axis=2))
    count = right.shape[2]
    known = np.trace(answer[:, :, count:], axis1=1, axis2=2) / normal.shape[1]
    return answer[:, :, :count], np.asarray(known, dtype=np.float64)


def _sums(at: IntArray, values: FloatArray, count: int) -> FloatArray:
    into = sparse.csr_array((np.ones(len(at)), (at, np.arange(len(at)))), shape=(count, len(at)))
    found = np.asarray(into @ values.reshape(len(at), -1))
    return np.asarray(found.reshape(count, *values.shape[1:]), dtype=np.float64)
