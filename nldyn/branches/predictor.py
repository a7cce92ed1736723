"""Where a branch goes on, by its last points and their tangents (engine/predictor.c)."""

from __future__ import annotations

import ctypes

import numpy as np

from nldyn.base.arrays import Real
from nldyn.engine.library import function
from nldyn.engine.numbers import address_of, reals

_WHOLE, _POINTER = ctypes.c_int64, ctypes.c_void_p
_predicted = function(
    "nldyn_predicted", _WHOLE, _POINTER, _POINTER, _WHOLE, _POINTER, _POINTER, ctypes.c_double,
    _POINTER, _POINTER,
)  # fmt: skip


def predicted(
    point: Real, tangent: Real, behind: Real, weights: Real, step: float
) -> tuple[Real, Real]:
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
    point, tangent, behind, weights = map(reals, (point, tangent, behind, weights))
    cubic, best = np.empty((2, point.size))
    found = _predicted(
        point.size, address_of(point), address_of(tangent), len(behind) // 2, address_of(behind),
        address_of(weights), step, address_of(cubic), address_of(best),
    )  # fmt: skip
    if not found:
        raise MemoryError("no memory for a prediction")
    return cubic, best
