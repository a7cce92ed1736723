"""Compiled: where a branch goes on, by polynomials through its last points and their tangents."""

from __future__ import annotations

import math

import numpy as np

from nldyn.flow.kernels.compiling import allocating, inner, njit

APART = 0.1  # of the step: a polynomial farther from the cubic is not believed


@njit(cache=True, error_model="numpy")
def predicted(point, tangent, behind, weights, step):
    """Points at a distance along the tangent: on the cubic, and on the polynomial that fits best.

    Parameters
    ----------
    point, tangent : (N + 1,)
        Where the branch is.
    behind : (2m, N + 1)
        The points before and their tangents in turn, the last point first.
    weights : (N + 1,)
        Metric at the point.
    step : float
        The distance.

    Returns
    -------
    cubic : (N + 1,)
        On the cubic through two points; on the tangent if there is one only.
    best : (N + 1,)
        On the polynomial through so many points as foretell this one best from those before it.
    """
    m = 1 + behind.shape[0] // 2
    points, tangents = np.empty((m, point.size)), np.empty((m, point.size))
    for i in range(point.size):
        points[0, i], tangents[0, i] = point[i], tangent[i]
        for k in range(1, m):
            points[k, i], tangents[k, i] = behind[2 * k - 2, i], behind[2 * k - 1, i]
    cubic = hermite(points, tangents, weights, 0, min(m, 2), step)
    if m < 3:
        return cubic, cubic
    count, least = 2, np.inf
    for q in range(2, m):
        error = foretold_error(points, tangents, weights, q)
        if error < least:
            count, least = q, error
    if count == m - 1:
        count = m
    best = hermite(points, tangents, weights, 0, count, step)
    return cubic, best if distance(weights, best, cubic) < APART * step else cubic


@inner
def distance(weights, a, b):
    """Distance of two points."""
    total = 0.0
    for i in range(weights.size):
        total += weights[i] * (a[i] - b[i]) ** 2
    return math.sqrt(total)


@allocating
def foretold_error(points, tangents, weights, count):
    """Distance of the newest point from the polynomial through some points before it."""
    row = unit_row(tangents[1], weights)
    step = 0.0
    for i in range(row.size):
        step += row[i] * (points[0, i] - points[1, i])
    found = hermite(points, tangents, weights, 1, 1 + count, step)
    return distance(weights, found, points[0])


@allocating
def unit_row(tangent, weights):
    """The covector of the direction of a tangent."""
    length = 0.0
    for i in range(weights.size):
        length += weights[i] * tangent[i] ** 2
    return weights * tangent / math.sqrt(length)


@allocating
def hermite(points, tangents, weights, first, last, step):
    """Polynomial through points and tangents from `first` up to `last`, a step ahead of the first.

    The distance along the first tangent is its variable; divided differences of double nodes.
    """
    size, n = points.shape[1], 2 * (last - first)
    row = unit_row(tangents[first], weights)
    nodes, slopes = np.empty(n), np.empty(last - first)
    for k in range(last - first):
        at, pace = 0.0, 0.0
        for i in range(size):
            at += row[i] * (points[first + k, i] - points[first, i])
            pace += row[i] * tangents[first + k, i]
        nodes[2 * k], nodes[2 * k + 1] = at, at
        slopes[k] = pace
    values, table = np.empty(size), np.empty(n)
    for i in range(size):
        for k in range(last - first):
            table[2 * k] = points[first + k, i]
            table[2 * k + 1] = tangents[first + k, i] / slopes[k]
        for k in range(last - first - 1, 0, -1):
            rise = points[first + k, i] - points[first + k - 1, i]
            table[2 * k] = rise / (nodes[2 * k] - nodes[2 * k - 2])
        for order in range(2, n):
            for j in range(n - 1, order - 1, -1):
                table[j] = (table[j] - table[j - 1]) / (nodes[j] - nodes[j - order])
        value = table[n - 1]
        for j in range(n - 2, -1, -1):
            value = value * (step - nodes[j]) + table[j]
        values[i] = value
    return values
