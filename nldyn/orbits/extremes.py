"""Which extremes of two orbits belong together and pass zero between them (engine/matching.c).

Extremes are rows as of `nldyn.engine.sample.touches`.
"""

from __future__ import annotations

import ctypes
import struct

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.engine.library import function
from nldyn.engine.numbers import address_of

_WHOLE, _NUMBER, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
_nearest = function("nldyn_nearest", _WHOLE, _POINTER, *[_NUMBER] * 3)
_sign_changes = function("nldyn_sign_changes", *(_WHOLE, _POINTER) * 2, _WHOLE, _NUMBER, _POINTER)
_alone = function("nldyn_alone", *(_WHOLE, _POINTER) * 2, _NUMBER, _POINTER, result=None)
_dips = function(
    "nldyn_dips", _NUMBER, _NUMBER, _WHOLE, ctypes.c_char_p, _WHOLE, ctypes.c_char_p,
    *[_POINTER] * 3, _NUMBER, _POINTER, result=None,
)  # fmt: skip
_COUNTS = struct.Struct("3q")


def nearest(extremes: Real, stop: int, is_maximum: bool, phase: float, full: float) -> Real | None:
    """The extreme (4,) of a stop nearest in phase on a circle of length `full`, or None."""
    key = 2 * stop + is_maximum
    index = _nearest(len(extremes), address_of(extremes), key, phase, full)
    return extremes[index] if index >= 0 else None


def sign_changes(before: Real, after: Real, stops: int, full: float) -> list[list[float]]:
    """Keys and phases of the extremes, nearest to each other, of opposite signs.

    The phase is that of the extreme nearer to zero.
    """
    found = np.empty((len(after), 2))
    count = _sign_changes(
        len(before), address_of(before), len(after), address_of(after), stops, full,
        address_of(found),
    )  # fmt: skip
    pairs: list[list[float]] = found[:count].tolist()
    return pairs


def alone(before: Real, after: Real, full: float) -> NDArray[np.bool_]:
    """Which extremes after none before belongs to: those born or lost between them."""
    found = np.empty(len(after), dtype=np.bool_)
    _alone(len(before), address_of(before), len(after), address_of(after), full, address_of(found))
    return found


def dips(
    left: float, right: float, tests: list[float], stops: int, beside: list[Real], full: float
) -> list[float]:
    """Where functions and extremes may touch zero unseen between `left` and `right`, or nan.

    The three values of such a function have one sign, but the parabola through them comes within a
    quarter of zero. Of each stop it is the first of the extremes that does so, each with the
    nearest ones beside it.

    Parameters
    ----------
    left, right : float
        Where the points beside this one are.
    tests : list of float
        Of all functions the values before, then those here, then those after.
    stops : int
        Number of stops.
    beside : list of (k, 4) arrays
        Extremes before, here and after.
    full : float
        Phase of a period.
    """
    count = len(tests) // 3
    found = np.empty(count + stops)
    _dips(
        left, right, count, struct.pack(f"{len(tests)}d", *tests), stops,
        _COUNTS.pack(*map(len, beside)), *map(address_of, beside), full, address_of(found),
    )  # fmt: skip
    where: list[float] = found.tolist()
    return where
