"""How much faster, at equal error."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

Curve = Sequence[tuple[float, float]]  # (error, seconds)


def envelope(curve: Curve) -> list[tuple[float, float]]:
    """Points that no other one beats in both error and time, from coarse to fine."""
    points = sorted((e, t) for e, t in curve if math.isfinite(e) and e > 0.0)
    best: list[tuple[float, float]] = []
    for error, seconds in points:
        if not best or seconds < best[-1][1]:
            best.append((error, seconds))
    return best[::-1]


def seconds_at(curve: Curve, error: float) -> float | None:
    """Time to reach an error, interpolated in both logarithms.

    Parameters
    ----------
    curve : sequence of (error, seconds)
        Measured points of one engine.
    error : float
        Error wanted.

    Returns
    -------
    float or None
        None if the engine does not reach the error. If its fastest point is better than asked for,
        the time of that one.

    Examples
    --------
    >>> f"{seconds_at([(1e-2, 1.0), (1e-6, 100.0)], 1e-4):.3f}"
    '10.000'
    """
    points = envelope(curve)
    if not points or points[-1][0] > error:
        return None
    if points[0][0] <= error:
        return points[0][1]
    for (e0, t0), (e1, t1) in pairwise(points):
        if e1 <= error:
            share = math.log(e0 / error) / math.log(e0 / e1)
            return t0 * math.exp(share * math.log(t1 / t0))
    raise AssertionError("an envelope is sorted")


def times_faster(ours: Curve, theirs: Curve, error: float) -> float | None:
    """Their time over ours at equal error; None if one of them does not reach it."""
    a, b = seconds_at(ours, error), seconds_at(theirs, error)
    return None if a is None or b is None else b / a
