"""Element matrices of straight beams, discretised by scikit-fem."""

from __future__ import annotations

import numpy as np
import skfem
from skfem.helpers import d, dd, ddot, dot, grad
from skfem.quadrature import get_quadrature

from fem.base.arrays import FloatArray


@skfem.BilinearForm
def _bending(u, v, w):  # type: ignore[no-untyped-def]
    return w.factor * ddot(dd(u), dd(v))


@skfem.BilinearForm
def _stretching(u, v, w):  # type: ignore[no-untyped-def]
    return w.factor * dot(grad(u), grad(v))


@skfem.BilinearForm
def _product(u, v, w):  # type: ignore[no-untyped-def]
    return w.factor * u * v


@skfem.BilinearForm
def _turning(u, v, w):  # type: ignore[no-untyped-def]
    return w.factor * dot(d(u), d(v))


ORDER = 8
"""Polynomial order that is integrated exactly along beams: a mass that changes with the square."""
_PLACES, WEIGHTS = get_quadrature(skfem.ElementLineP1(), ORDER)
PLACES = _PLACES[0]
"""Places of integration along a line between 0 and 1, shape (q,), with the weights (q,)."""


def _integrals(form: skfem.BilinearForm, basis: skfem.Basis, factor: FloatArray) -> FloatArray:
    """Element matrices of a form times a factor: one for each element, (e,), or each place."""
    if factor.ndim == 1:
        matrices = form.elemental(basis, factor=1.0).tolocal()
        return np.asarray(factor[:, None, None] * matrices, dtype=np.float64)
    return np.asarray(form.elemental(basis, factor=factor).tolocal(), dtype=np.float64)


def mean(values: FloatArray) -> FloatArray:
    """Means (e,) over elements of values for each element, (e,), or for each place, (e, q)."""
    return values if values.ndim == 1 else np.asarray(values @ WEIGHTS, dtype=np.float64)


def stretching_matrices(
    lengths: FloatArray, stiffness: FloatArray, mass_per_length: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Linear stretching, or twisting: stiffness and mass (e, 2, 2) from EA or GJ, and rho A.

    These are numbers of every element, shape (e,), or at all `PLACES` along it, (e, q).

    All elements are one disconnected `skfem.MeshLine` in which each lies on [0, L], because
    scikit-fem's line meshes have neither y nor z.

    Examples
    --------
    >>> one = np.ones(1)
    >>> stretching_matrices(one, one, one)[0][0]
    array([[ 1., -1.],
           [-1.,  1.]])
    """
    order = 2 if stiffness.ndim == 1 else ORDER
    basis = skfem.Basis(_disconnected_lines(lengths), skfem.ElementLineP1(), intorder=order)
    return (
        _integrals(_stretching, basis, stiffness),
        _integrals(_product, basis, mass_per_length),
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
        L in m, EI in N m², rho A in kg/m of every element, each of shape (e,); all but the length
        may be given at all `PLACES` along it, shape (e, q).
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
    so all matrices follow from Hermite's. Statics are exact at any length. Where the section
    changes along the element g is the constant strain of least energy; frequencies then are upper
    bounds.

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
    order = 6 if bending_stiffness.ndim == 1 else ORDER
    basis = skfem.Basis(_disconnected_lines(lengths), skfem.ElementLineHermite(), intorder=order)
    stiffness = _integrals(_bending, basis, bending_stiffness)
    mass = _integrals(_product, basis, mass_per_length)
    if shear_stiffness is None and inertia_per_length is None and axial_force is None:
        return stiffness, mass
    count = len(lengths)
    strain = _shear_strain(lengths, bending_stiffness, shear_stiffness)
    turn = np.tile(np.eye(4), (count, 1, 1))
    turn[:, [1, 3], :] += strain[:, None, :]
    slopes = congruent(_integrals(_turning, basis, np.ones(count)), turn)
    stiffness, mass = congruent(stiffness, turn), congruent(mass, turn)
    squared = strain[:, :, None] * strain[:, None, :]
    if shear_stiffness is not None:
        carried = mean(shear_stiffness)
        sheared = np.isfinite(carried)
        stiffness[sheared] += (carried * lengths)[sheared, None, None] * squared[sheared]
    if inertia_per_length is not None:
        mixed = strain[:, :, None] * _turn_integrals(lengths, inertia_per_length, turn)[:, None, :]
        rotation = congruent(_integrals(_turning, basis, inertia_per_length), turn)
        mass += rotation - mixed - mixed.transpose(0, 2, 1)
        mass += (mean(inertia_per_length) * lengths)[:, None, None] * squared
    if axial_force is not None:
        stiffness += axial_force[:, None, None] * slopes
    return stiffness, mass


def _turn_integrals(lengths: FloatArray, factor: FloatArray, turn: FloatArray) -> FloatArray:
    """Integrals (e, 4) of the slope w' times a factor, from (w, rotation) at both ends."""
    if factor.ndim == 1:
        return np.asarray(factor[:, None] * np.array([-1.0, 0.0, 1.0, 0.0]), dtype=np.float64)
    _, slopes = hermite(PLACES)
    found = (factor * WEIGHTS) @ slopes.T
    found[:, [1, 3]] *= lengths[:, None]
    return np.asarray(np.einsum("ei,eij->ej", found, turn), dtype=np.float64)


def _shear_strain(
    lengths: FloatArray, bending_stiffness: FloatArray, shear_stiffness: FloatArray | None
) -> FloatArray:
    """The rows (e, 4) that give the shear strain from (w, rotation) at both ends."""
    if shear_stiffness is None:
        return np.zeros((len(lengths), 4))
    _, mixed, odd = bending_numbers(lengths, bending_stiffness)
    carried = mean(shear_stiffness) * lengths
    infinite = ~np.isfinite(carried)
    share = np.where(infinite, 0.0, -2.0 / np.where(infinite, 1.0, 4.0 * odd + carried))
    one = np.ones(len(lengths))
    even_row = np.stack([0.0 * one, one, 0.0 * one, -one], axis=1)
    odd_row = np.stack([2.0 / lengths, one, -2.0 / lengths, one], axis=1)
    rows = share[:, None] * (mixed[:, None] * even_row + odd[:, None] * odd_row)
    return np.asarray(rows, dtype=np.float64)


def bending_numbers(
    lengths: FloatArray, bending_stiffness: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Stiffness of Hermite's bending for r1 - r2 and r1 + r2 - 2 c: its 11, 12 and 22, each (e,).

    c is the turn of the chord. With s along the element these are the means of EI/L, of
    -3 EI (2 s - 1)/L and of 9 EI (2 s - 1)²/L.

    Examples
    --------
    >>> [float(x) for (x,) in bending_numbers(np.ones(1), np.ones(1))]
    [1.0, 0.0, 3.0]
    """
    own = mean(bending_stiffness) / lengths
    if bending_stiffness.ndim == 1:
        return own, np.zeros(len(lengths)), 3.0 * own
    lever = 3.0 * (2.0 * PLACES - 1.0)
    mixed = -mean(bending_stiffness * lever) / lengths
    return own, mixed, mean(bending_stiffness * lever**2) / lengths


def hermite(s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Hermite's four cubics at places (..., q) on [0, 1], and their slopes, each (4, ..., q).

    Those of rotations are to be multiplied by the length.
    """
    values = (1 - 3 * s**2 + 2 * s**3, s - 2 * s**2 + s**3, 3 * s**2 - 2 * s**3, s**3 - s**2)
    slopes = (6 * s**2 - 6 * s, 1 - 4 * s + 3 * s**2, 6 * s - 6 * s**2, 3 * s**2 - 2 * s)
    return np.array(values), np.array(slopes)


def congruent(matrices: FloatArray, T: FloatArray) -> FloatArray:
    """TᵀkT for every element: matrices (e, m, m), T (e, m, p); symmetric, shape (e, p, p)."""
    turned = np.einsum("eki,ekl,elj->eij", T, matrices, T, optimize=True)
    return np.asarray((turned + turned.transpose(0, 2, 1)) / 2.0, dtype=np.float64)


def _disconnected_lines(lengths: FloatArray) -> skfem.MeshLine:
    count = len(lengths)
    ends = np.zeros((1, 2 * count))
    ends[0, 1::2] = lengths
    return skfem.MeshLine(ends, np.ascontiguousarray(np.arange(2 * count).reshape(count, 2).T))
