"""Gauss-Legendre collocation on one panel, with maps that resolve a contact switch."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from nldyn.engine.library import Packed

Real = NDArray[np.float64]

FINE = 257  # points on a panel at which polynomials of its nodes are looked at

# Panel kinds: 2 * (switch at the start) + (switch at the end).
SMOOTH, ENDS_AT_SWITCH, STARTS_AT_SWITCH, BETWEEN_SWITCHES = range(4)


class GaussTables(NamedTuple):
    """Tables of an m-node panel for each of the four kinds of ends.

    Parameters
    ----------
    chi : (4, m)
        Node times as fractions of the panel.
    slope : (4, m)
        dχ/ds at the nodes.
    integrate : (4, m, m)
        ``integrate[kind, i, j]``: weight of node j in the integral up to node i.
    weights : (4, m)
        Weights of the integral over the panel.
    to_legendre : (m, m)
        Legendre coefficients in s from node values.
    nodes : (m,)
        The Gauss nodes in s.
    ends_nodes, barycentric : (m + 2,)
        0, the nodes and 1, and the weights of barycentric interpolation through them.
    derivative : (m, m + 2)
        Derivatives by s at the nodes, from values at `ends_nodes`.
    fine_grid : (N,)
        Chebyshev points in s with both ends, four times as many.
    to_fine : (N, m + 2)
        Interpolation from `ends_nodes` to `fine_grid`.
    power : int
        Power of the maps at a switch, see `time_map`.
    """

    chi: Real
    slope: Real
    integrate: Real
    weights: Real
    to_legendre: Real
    nodes: Real
    ends_nodes: Real
    barycentric: Real
    derivative: Real
    fine_grid: Real
    to_fine: Real
    power: int

    def ways(self, values: Real) -> Real:
        """Ways (k, m) that the nodes of panels stand for, of values (k, m + 2) at `ends_nodes`.

        Each sums up to what lies between start and end. The sum of a force on them is its work, as
        exact as the force: that of an elastic one is lost or won by rounding only.

        Examples
        --------
        >>> tables = gauss_tables(8)
        >>> depth = tables.ends_nodes[None] * (1.0 - tables.ends_nodes)  # and back to zero
        >>> bool(abs((tables.ways(depth) * depth[:, 1:-1]).sum()) < 1e-15)
        True
        """
        return np.asarray(self.weights[SMOOTH] * (values @ self.derivative.T))

    def packed(self) -> Packed:
        """The tables as the engine reads them."""
        return Packed(
            self.nodes.size, self.fine_grid.size, self.power, self.chi, self.slope,
            self.integrate.transpose(0, 2, 1), self.weights, self.to_legendre, self.ends_nodes,
            self.barycentric, self.fine_grid, self.to_fine.T,
        )  # fmt: skip


def time_map(kind: int, s: Real | float, power: int = 2) -> tuple[Real | float, Real | float]:
    """Fraction of the panel χ(s) and its slope; flat at an end where a contact switches.

    With t - t0 ~ s², a force that starts like (t - t0)^p is smooth in s if 2p is an integer; with
    the power 4 it is smooth enough for any p (and all the more crowded at the switch). The cosine
    has no other simple zeros in the complex plane, so it adds no branch points.

    Examples
    --------
    >>> time_map(STARTS_AT_SWITCH, 0.5)
    (0.25, 1.0)
    """
    if kind == SMOOTH:
        return s, 1.0 + 0.0 * s
    if kind == ENDS_AT_SWITCH:
        return 1.0 - (1.0 - s) ** power, power * (1.0 - s) ** (power - 1)
    if kind == STARTS_AT_SWITCH:
        return s**power, power * s ** (power - 1)
    if power == 2:
        return 0.5 - 0.5 * np.cos(np.pi * s), 0.5 * np.pi * np.sin(np.pi * s)
    return s**4 * (35.0 - s * (84.0 - s * (70.0 - 20.0 * s))), 140.0 * (s * (1.0 - s)) ** 3


@lru_cache(maxsize=8)
def gauss_tables(m: int, power: int = 2) -> GaussTables:
    """Tables for m Gauss nodes and a power (2 or 4) of the maps at a switch.

    Examples
    --------
    >>> gauss_tables(4).weights[0].sum().round(12)
    np.float64(1.0)
    """
    x, w = legendre.leggauss(m)
    nodes = 0.5 * (x + 1.0)
    degrees = np.arange(m)
    vandermonde = legendre.legvander(x, m - 1)
    to_legendre = (0.5 * (2 * degrees + 1))[:, None] * vandermonde.T * w
    antiderivative = np.array(
        [0.5 * legendre.legval(x, legendre.legint(unit, lbnd=-1)) for unit in np.eye(m)]
    ).T
    running = antiderivative @ to_legendre
    maps = [time_map(kind, nodes, power) for kind in range(4)]
    chi = np.array([c for c, _ in maps])
    slope = np.array([d for _, d in maps])
    ends_nodes = np.concatenate([[0.0], nodes, [1.0]])
    barycentric = 1.0 / np.prod(_differences(4.0 * ends_nodes), axis=1)
    fine_grid = 0.5 - 0.5 * np.cos(np.pi * np.linspace(0.0, 1.0, 4 * (m + 2)))
    return GaussTables(
        chi,
        slope,
        np.ascontiguousarray(running[None] * slope[:, None, :]),
        0.5 * w * slope,
        to_legendre,
        nodes,
        ends_nodes,
        barycentric,
        _differentiation(ends_nodes, barycentric)[1:-1],
        fine_grid,
        _interpolation(ends_nodes, barycentric, fine_grid),
        power,
    )


def _differences(points: Real) -> Real:
    """Matrix of x_i - x_j with ones on the diagonal."""
    return points[:, None] - points[None, :] + np.eye(points.size)


def _differentiation(points: Real, barycentric: Real) -> Real:
    """Matrix that takes values at the points to derivatives of their polynomial there."""
    found = barycentric / barycentric[:, None] / _differences(points)
    np.fill_diagonal(found, 0.0)
    np.fill_diagonal(found, -found.sum(axis=1))
    return found


def _interpolation(points: Real, barycentric: Real, targets: Real) -> Real:
    """Matrix that takes values at the points to values of their polynomial at the targets."""
    distance = targets[:, None] - points[None, :]
    hit = distance == 0.0
    weights = barycentric / np.where(hit, 1.0, distance)
    weights[hit.any(axis=1)] = 0.0
    weights[hit] = 1.0
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def peaks(values: Real) -> Real:
    """Largest value of each row (p,), by the parabola through three samples.

    Examples
    --------
    >>> x = np.linspace(0.0, 1.0, 11)
    >>> float(peaks(1.0 - (x[None] - 0.33) ** 2)[0].round(12))
    1.0
    """
    if not len(values):
        return np.empty(0)
    middle = np.clip(values.argmax(axis=1), 1, values.shape[1] - 2)
    before, here, after = (
        np.take_along_axis(values, (middle + k)[:, None], axis=1)[:, 0] for k in (-1, 0, 1)
    )
    bend = before - 2.0 * here + after
    lean = 0.5 * (after - before)
    inside = (bend < 0.0) & (np.abs(lean) <= -bend)
    top = here - 0.5 * lean**2 / np.where(inside, bend, -1.0)
    largest = values.max(axis=1)  # at an end the parabola's vertex may lie below it
    found: Real = np.where(inside, np.maximum(top, largest), largest)
    return found


@lru_cache(maxsize=8)
def fine_table(nodes: int) -> Real:
    """Matrix (FINE, nodes): the polynomial through values at the Gauss nodes, at equal steps."""
    fine = legendre.legvander(np.linspace(-1.0, 1.0, FINE), nodes - 1)
    return np.asarray(fine @ gauss_tables(nodes).to_legendre)
