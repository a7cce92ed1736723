"""Shape functions and quadrature of wedges and pyramids, which scikit-fem does not offer.

scikit-fem has the wedge of six nodes, but its rule of quadrature for it takes the places of the
line for the first direction of the triangle, and it has no pyramids.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import skfem
from scipy.special import roots_jacobi
from skfem.quadrature import get_quadrature

from fem.base.arrays import FloatArray

Rule = Callable[[int], tuple[FloatArray, FloatArray]]
Term = tuple[int, int, int, int]


class NodalElement:
    """The functions of a span that are 1 at one node and 0 at the others.

    It offers what the product takes from an element of scikit-fem: `doflocs` and `lbasis`.

    Parameters
    ----------
    doflocs
        Places of the nodes in the reference cell, shape (b, 3).
    terms
        Powers (i, j, k, m), one for each node; they stand for xⁱ yʲ zᵏ rᵐ with r = x y/(1 - z).
    rule
        Places (q, 3) and weights (q,) that integrate polynomials up to an order exactly; on a
        pyramid also the polynomials in x/(1 - z), y/(1 - z) and z that its terms are.

    Raises
    ------
    ValueError
        If the terms cannot be told apart at the nodes.

    Notes
    -----
    The gradient of r has no limit at the apex of a pyramid. There it is given its limit along
    the axis x = y = 0, which is zero; the rules have no place at the apex.

    Examples
    --------
    >>> element = NodalElement(np.eye(3), [(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0)], wedge_rule)
    >>> element.lbasis(np.array([[0.2], [0.3], [0.4]]), 1)[0]
    array([0.3])
    """

    def __init__(self, doflocs: FloatArray, terms: Sequence[Term], rule: Rule) -> None:
        self.doflocs = np.asarray(doflocs, dtype=np.float64)
        self.terms = tuple(terms)
        self.rule = rule
        at_nodes = np.array([_term(term, self.doflocs.T)[0] for term in self.terms])
        if at_nodes.shape[0] != at_nodes.shape[1] or np.linalg.cond(at_nodes) > 1e6:
            raise ValueError("the terms are not told apart by their values at the nodes")
        self.coefficients = np.linalg.inv(at_nodes)

    def lbasis(self, X: FloatArray, i: int) -> tuple[FloatArray, FloatArray]:
        """Function i (q,) and its gradient (3, q) at places X (3, q)."""
        value, gradient = np.zeros(X.shape[1]), np.zeros_like(X)
        for weight, term in zip(self.coefficients[i], self.terms, strict=True):
            own, slope = _term(term, X)
            value, gradient = value + weight * own, gradient + weight * slope
        return value, gradient


def _term(term: Term, X: FloatArray) -> tuple[FloatArray, FloatArray]:
    """xⁱ yʲ zᵏ rᵐ (q,) and its gradient (3, q) at places (3, q)."""
    x, y, z = X
    below = np.where(z == 1.0, 1.0, 1.0 - z)
    factors = np.stack([x, y, z, x * y / below])
    slopes = np.zeros((4, 3, X.shape[1]))
    slopes[0, 0] = slopes[1, 1] = slopes[2, 2] = 1.0
    slopes[3] = y / below, x / below, x * y / below**2
    powers = np.array([factor**power for factor, power in zip(factors, term, strict=True)])
    gradient = np.zeros_like(X)
    for n, power in enumerate(term):
        if power:
            others = np.prod(np.delete(powers, n, axis=0), axis=0)
            gradient += power * factors[n] ** (power - 1) * others * slopes[n]
    return np.asarray(powers.prod(axis=0)), gradient


def wedge_rule(order: int) -> tuple[FloatArray, FloatArray]:
    """Places (q, 3) and weights (q,) on the wedge: those of the triangle times the line's.

    Examples
    --------
    >>> places, weights = wedge_rule(4)
    >>> len(weights), float(np.round(weights @ places[:, 0] ** 2 * 12, 12))
    (18, 1.0)
    """
    triangle, across = get_quadrature(skfem.ElementTriP1(), order)
    line, along = get_quadrature(skfem.ElementLineP1(), order)
    flat = np.repeat(triangle.T, len(along), axis=0)
    places = np.column_stack([flat, np.tile(line[0], len(across))])
    return places, np.outer(across, along).ravel()


def pyramid_rule(order: int) -> tuple[FloatArray, FloatArray]:
    """Places (q, 3) and weights (q,) on the pyramid with the base [-1, 1]² and the height 1.

    The cube is collapsed by x = ξ (1 - z), y = η (1 - z), which has the volume (1 - z)²: Gauss and
    Legendre's places for ξ and η, Gauss and Jacobi's for z [1]_. Exact for polynomials of the
    order in each of ξ, η and z.

    .. [1] A. H. Stroud, Approximate Calculation of Multiple Integrals, Prentice-Hall, 1971,
       section 2.5 (conical product formulas).

    Examples
    --------
    >>> places, weights = pyramid_rule(2)
    >>> len(weights), float(np.round(weights.sum() * 3, 12))
    (8, 4.0)
    """
    count = order // 2 + 1
    flat, across = np.polynomial.legendre.leggauss(count)
    up, along = roots_jacobi(count, 2, 0)
    xi, eta, z = (grid.ravel() for grid in np.meshgrid(flat, flat, (up + 1.0) / 2.0))
    weights = np.einsum("i,j,k->ijk", across, across, along / 8.0).ravel()
    return np.column_stack([xi * (1.0 - z), eta * (1.0 - z), z]), weights


_LINEAR = [(0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0)]
_QUADRATIC = [*_LINEAR, (2, 0, 0, 0), (1, 1, 0, 0), (0, 2, 0, 0)]
_TO_THE_APEX = [(0, 0, 1, 0), (0, 0, 2, 0), (1, 0, 1, 0), (0, 1, 1, 0)]


def _times_z(terms: Sequence[Term], power: int) -> list[Term]:
    return [(i, j, k + power, m) for i, j, k, m in terms]


WEDGE_TERMS: dict[int, list[Term]] = {
    6: _LINEAR + _times_z(_LINEAR, 1),
    15: _QUADRATIC + _times_z(_QUADRATIC, 1) + _times_z(_LINEAR, 2),
    18: _QUADRATIC + _times_z(_QUADRATIC, 1) + _times_z(_QUADRATIC, 2),
}
"""Powers of the wedges' functions by their number of nodes: linear; serendipity [1]_; complete.

.. [1] O. C. Zienkiewicz, R. L. Taylor, J. Z. Zhu, The Finite Element Method: Its Basis and
   Fundamentals, 7th ed., Butterworth-Heinemann, 2013, section 6.5.
"""

PYRAMID_TERMS: dict[int, list[Term]] = {
    5: [*_LINEAR, (0, 0, 1, 0), (0, 0, 0, 1)],
    13: [*_QUADRATIC, *_TO_THE_APEX, (0, 0, 0, 1), (1, 0, 0, 1), (0, 1, 0, 1)],
    14: [*_QUADRATIC, *_TO_THE_APEX, (0, 0, 0, 1), (1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 0, 2)],
}
"""Powers of the pyramids' functions by their number of nodes.

On the base they are those of a quadrilateral with 4, 8 or 9 nodes and on the sides those of a
triangle. Of 5 and 13 nodes they are Bedrosian's [1]_, of 14 nodes the space of second order of
Bergot, Cohen and Duruflé [2]_, which holds all quadratics also where the base is no parallelogram.

.. [1] G. Bedrosian, Shape functions and integration formulas for three-dimensional finite element
   analysis, International Journal for Numerical Methods in Engineering 35 (1992) 95-108.
.. [2] M. Bergot, G. Cohen, M. Duruflé, Higher-order finite elements for hybrid meshes using new
   nodal pyramidal elements, Journal of Scientific Computing 42 (2010) 345-381.
"""
