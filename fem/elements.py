"""Element matrices of the Euler-Bernoulli frame element, discretised by scikit-fem."""

from __future__ import annotations

import numpy as np
import skfem
from skfem.helpers import dd, ddot, dot, grad

from fem.mesh import FloatArray

AXIAL = np.array([0, 3])
BENDING = np.array([1, 2, 4, 5])


@skfem.BilinearForm
def _bending(u, v, w):  # type: ignore[no-untyped-def]
    return ddot(dd(u), dd(v))


@skfem.BilinearForm
def _stretching(u, v, w):  # type: ignore[no-untyped-def]
    return dot(grad(u), grad(v))


@skfem.BilinearForm
def _product(u, v, w):  # type: ignore[no-untyped-def]
    return u * v


def local_matrices(
    lengths: FloatArray,
    axial_stiffness: FloatArray,
    bending_stiffness: FloatArray,
    mass_per_length: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Stiffness and consistent mass of frame elements along their own axes.

    The elements are those of one disconnected `skfem.MeshLine` in which every element lies on
    [0, L]: cubic Hermite bending (`ElementLineHermite`) and linear stretching (`ElementLineP1`).
    There is no rotary inertia of the cross-section (Euler-Bernoulli).

    Parameters
    ----------
    lengths, axial_stiffness, bending_stiffness, mass_per_length
        L in m, EA in N, EI in N m², rho A in kg/m of every element, each of shape (e,).

    Returns
    -------
    stiffness, mass
        Shape (e, 6, 6), for the displacements (u, w, rotation) of the first end, then the second.

    Examples
    --------
    >>> one = np.ones(1)
    >>> k, m = local_matrices(one, one, one, 420 * one)
    >>> np.round(k[0, 1:3, 1:3], 12)
    array([[12.,  6.],
           [ 6.,  4.]])
    >>> np.round(m[0, 1:3, 1:3], 9)
    array([[156.,  22.],
           [ 22.,   4.]])
    """
    mesh = _disconnected_lines(lengths)
    bending = skfem.Basis(mesh, skfem.ElementLineHermite(), intorder=6)
    stretching = skfem.Basis(mesh, skfem.ElementLineP1(), intorder=2)
    shape = (len(lengths), 6, 6)
    stiffness, mass = np.zeros(shape), np.zeros(shape)
    for matrix, form, basis, dofs, factor in (
        (stiffness, _stretching, stretching, AXIAL, axial_stiffness),
        (stiffness, _bending, bending, BENDING, bending_stiffness),
        (mass, _product, stretching, AXIAL, mass_per_length),
        (mass, _product, bending, BENDING, mass_per_length),
    ):
        local = form.elemental(basis).tolocal()
        matrix[np.ix_(np.arange(shape[0]), dofs, dofs)] = factor[:, None, None] * local
    return stiffness, mass


def turn(matrices: FloatArray, directions: FloatArray) -> FloatArray:
    """Element matrices TᵀkT in the directions of the frame.

    Parameters
    ----------
    matrices
        Along the elements' own axes, shape (e, 6, 6).
    directions
        Unit vectors (cos, sin) along the elements, shape (e, 2).

    Returns
    -------
    ndarray
        Shape (e, 6, 6), for (ux, uy, rotation) of the first end, then the second; symmetric.
    """
    T = rotations(directions)
    turned = np.einsum("eki,ekl,elj->eij", T, matrices, T, optimize=True)
    return np.asarray((turned + turned.transpose(0, 2, 1)) / 2.0, dtype=np.float64)


def rotations(directions: FloatArray) -> FloatArray:
    """The matrices T, shape (e, 6, 6), from (ux, uy, rotation) to (u, w, rotation) at both ends."""
    c, s = directions.T
    T = np.zeros((len(directions), 6, 6))
    for first in (0, 3):
        T[:, first, first] = T[:, first + 1, first + 1] = c
        T[:, first, first + 1] = s
        T[:, first + 1, first] = -s
        T[:, first + 2, first + 2] = 1.0
    return T


def _disconnected_lines(lengths: FloatArray) -> skfem.MeshLine:
    count = len(lengths)
    ends = np.zeros((1, 2 * count))
    ends[0, 1::2] = lengths
    return skfem.MeshLine(ends, np.ascontiguousarray(np.arange(2 * count).reshape(count, 2).T))
