"""Element matrices of straight beams, discretised by scikit-fem."""

from __future__ import annotations

import numpy as np
import skfem
from skfem.helpers import d, dd, ddot, dot, grad

from fem.mesh import FloatArray


@skfem.BilinearForm
def _bending(u, v, w):  # type: ignore[no-untyped-def]
    return ddot(dd(u), dd(v))


@skfem.BilinearForm
def _stretching(u, v, w):  # type: ignore[no-untyped-def]
    return dot(grad(u), grad(v))


@skfem.BilinearForm
def _product(u, v, w):  # type: ignore[no-untyped-def]
    return u * v


@skfem.BilinearForm
def _turning(u, v, w):  # type: ignore[no-untyped-def]
    return dot(d(u), d(v))


def stretching_matrices(
    lengths: FloatArray, stiffness: FloatArray, mass_per_length: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Linear stretching, or twisting: stiffness and mass (e, 2, 2) from EA or GJ, and rho A.

    All elements are one disconnected `skfem.MeshLine` in which each lies on [0, L], because
    scikit-fem's line meshes have neither y nor z.

    Examples
    --------
    >>> one = np.ones(1)
    >>> stretching_matrices(one, one, one)[0][0]
    array([[ 1., -1.],
           [-1.,  1.]])
    """
    basis = skfem.Basis(_disconnected_lines(lengths), skfem.ElementLineP1(), intorder=2)
    return (
        stiffness[:, None, None] * _stretching.elemental(basis).tolocal(),
        mass_per_length[:, None, None] * _product.elemental(basis).tolocal(),
    )


def bending_matrices(
    lengths: FloatArray,
    bending_stiffness: FloatArray,
    mass_per_length: FloatArray,
    shear_stiffness: FloatArray | None = None,
    inertia_per_length: FloatArray | None = None,
    axial_force: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Bending in one plane: stiffness and mass (e, 4, 4) for (w, rotation) at both ends.

    Parameters
    ----------
    lengths, bending_stiffness, mass_per_length
        L in m, EI in N m², rho A in kg/m of every element, each of shape (e,).
    shear_stiffness
        Area that carries shear times G in N; infinite without shear deformation, the default.
    inertia_per_length
        rho I in kg m, by default 0.
    axial_force
        In N, positive for tension, by default 0.

    Notes
    -----
    Without shear this is cubic Hermite bending (`skfem.ElementLineHermite`). With it, it is the
    Timoshenko element whose shear strain g is constant and in equilibrium with the moments
    [1]_: g = s ((w2 - w1)/L - (r1 + r2)/2) with s = p/(1 + p), p = 12 EI / (kGA L²). Its
    displacement is Hermite's cubic with the slopes r + g at the ends and its rotation is w' - g,
    so all matrices follow from Hermite's. Statics are exact at any length.

    .. [1] Z. Friedman and J. B. Kosmatka, An improved two-node Timoshenko beam finite element,
       Computers & Structures 47 (1993) 473-481.

    Examples
    --------
    >>> one = np.ones(1)
    >>> k, m = bending_matrices(one, one, 420 * one)
    >>> np.round(k[0, :2, :2], 12)
    array([[12.,  6.],
           [ 6.,  4.]])
    >>> np.round(m[0, :2, :2], 9)
    array([[156.,  22.],
           [ 22.,   4.]])

    The tip of a cantilever under 1 N moves by L³/(3 EI) + L/(kGA):

    >>> k, _ = bending_matrices(one, one, one, shear_stiffness=one / 2)
    >>> round(float(np.linalg.inv(k[0, 2:, 2:])[0, 0]), 12) == round(1 / 3 + 2, 12)
    True
    """
    basis = skfem.Basis(_disconnected_lines(lengths), skfem.ElementLineHermite(), intorder=6)
    stiffness = bending_stiffness[:, None, None] * _bending.elemental(basis).tolocal()
    mass = mass_per_length[:, None, None] * _product.elemental(basis).tolocal()
    if shear_stiffness is None and inertia_per_length is None and axial_force is None:
        return stiffness, mass
    count = len(lengths)
    strain = _shear_strain(lengths, bending_stiffness, shear_stiffness)
    turn = np.tile(np.eye(4), (count, 1, 1))
    turn[:, [1, 3], :] += strain[:, None, :]
    slopes = congruent(_turning.elemental(basis).tolocal(), turn)
    stiffness, mass = congruent(stiffness, turn), congruent(mass, turn)
    squared = strain[:, :, None] * strain[:, None, :]
    if shear_stiffness is not None:
        sheared = np.isfinite(shear_stiffness)
        stiffness[sheared] += (shear_stiffness * lengths)[sheared, None, None] * squared[sheared]
    if inertia_per_length is not None:
        mixed = strain[:, :, None] * np.array([-1.0, 0.0, 1.0, 0.0])
        rotation = slopes - mixed - mixed.transpose(0, 2, 1) + lengths[:, None, None] * squared
        mass += inertia_per_length[:, None, None] * rotation
    if axial_force is not None:
        stiffness += axial_force[:, None, None] * slopes
    return stiffness, mass


def _shear_strain(
    lengths: FloatArray, bending_stiffness: FloatArray, shear_stiffness: FloatArray | None
) -> FloatArray:
    """The rows (e, 4) that give the shear strain from (w, rotation) at both ends."""
    if shear_stiffness is None:
        return np.zeros((len(lengths), 4))
    ratio = 12.0 * bending_stiffness / (shear_stiffness * lengths**2)
    half, one = np.full(len(lengths), -0.5), 1.0 / lengths
    rows = np.stack([-one, half, one, half], axis=1)
    return np.asarray((ratio / (1.0 + ratio))[:, None] * rows, dtype=np.float64)


def congruent(matrices: FloatArray, T: FloatArray) -> FloatArray:
    """TᵀkT for every element: matrices (e, m, m), T (e, m, p); symmetric, shape (e, p, p)."""
    turned = np.einsum("eki,ekl,elj->eij", T, matrices, T, optimize=True)
    return np.asarray((turned + turned.transpose(0, 2, 1)) / 2.0, dtype=np.float64)


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
    return congruent(matrices, rotations(directions))


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
