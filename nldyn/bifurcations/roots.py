"""Roots of test functions between two points of a branch."""

from __future__ import annotations

import math
from collections.abc import Callable

from nldyn.base.errors import LocateError

PRECISION = 1e-9  # of the distance of the two points, to which a root is found
STALL = 1e-6  # a move, shorter than which a function should come nearer to zero


def root(f: Callable[[float], float]) -> tuple[float, float]:
    """Root of a function on [0, 1] with opposite signs at the ends, and its estimated error.

    Trials come from inverse interpolation through the values nearest to zero, so that a function
    that is smooth on one side of its root only (the depth at a grazing point) is followed on that
    side; where trials do not come closer fast, the bracket is halved (after Brent 1973, ch. 4).
    The error is how far the next trial would have moved: where the function jumps, or rounding
    changes its sign often, as far as where the trials ended. A short move that brings the function
    no nearer to zero has met its rounding level; then the error is what secants say.

    Raises
    ------
    LocateError
        If no root is found, or the signs at the ends are the same.
    """
    known = sorted([(f(0.0), 0.0), (f(1.0), 1.0)], key=_size)
    if known[0][0] * known[1][0] > 0.0:
        raise LocateError("no change of sign")
    low, high, rising = 0.0, 1.0, max(known)[1] == 1.0
    move, move_before = 1.0, 1.0
    for _ in range(100):
        y, best = known[0]
        if y == 0.0:
            return best, 0.0
        x = _inverse_interpolation(known, low, high)
        step = abs(x - best)
        if step <= PRECISION or high - low <= PRECISION:
            return best, step
        if step > 0.5 * move_before:
            x = 0.5 * (low + high)
        move_before, move = move, abs(x - best)
        value = f(x)
        if math.isnan(value):
            break
        if move < STALL and abs(value) > 0.5 * abs(y):
            secants = (abs(y * (other - best) / (v - y)) for v, other in known[1:] if v != y)
            reach = max(secants, default=1.0)
            if reach < STALL:  # the rounding level of the function
                return best, max(reach, move)
        low, high = (low, x) if (value > 0.0) == rising else (x, high)
        known = sorted([*known, (value, x)], key=_size)[:4]
    raise LocateError("no root found")


def _size(value: tuple[float, float]) -> float:
    return abs(value[0])


def _inverse_interpolation(known: list[tuple[float, float]], low: float, high: float) -> float:
    """Where the polynomial x(y) through the most points has y = 0 within (low, high)."""
    estimates = [x for _, x in known]
    y = [value for value, _ in known]
    found = 0.5 * (low + high)
    for order in range(1, len(y)):  # Neville's scheme
        for i in range(len(y) - order):
            if y[i + order] == y[i]:
                return found
            estimates[i] += (estimates[i + 1] - estimates[i]) * y[i] / (y[i] - y[i + order])
        if low < estimates[0] < high:
            found = estimates[0]
    return found
