"""Which extremes of two orbits belong together and pass zero between them (engine/matching.c)."""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.engine.library import Packed, address_of, function
from nldyn.engine.numbers import flags, reals

Kinds = NDArray[np.bool_]
Extremes = tuple[Real, Real, Kinds]
_WHOLE, _NUMBER, _POINTER, _EXTREMES = (
    ctypes.c_int64, ctypes.c_double, ctypes.c_void_p, ctypes.c_char_p
)  # fmt: skip
_nearest = function("nldyn_nearest", _EXTREMES, _WHOLE, _NUMBER, _NUMBER)
_sign_changes = function("nldyn_sign_changes", _EXTREMES, _EXTREMES, _NUMBER, _POINTER, _POINTER)
_alone = function("nldyn_alone", _EXTREMES, _EXTREMES, _NUMBER, _POINTER, result=None)
_dip = function("nldyn_dip", *[_NUMBER] * 5, result=_NUMBER)
_extreme_dip = function(
    "nldyn_extreme_dip", _NUMBER, _NUMBER, *[_EXTREMES] * 3, _NUMBER, result=_NUMBER
)


def _packed(phases: Real, values: Real, kinds: Kinds) -> Packed:
    phases = reals(phases)
    return Packed(phases.size, phases, reals(values), flags(kinds))


def nearest(phases: Real, kinds: Kinds, kind: bool, phase: float, full: float) -> int:
    """Index of the extreme of a kind nearest in phase on a circle of length `full`, or -1."""
    extremes = _packed(phases, phases, kinds)
    return int(_nearest(extremes.content, int(kind), phase, full))


def sign_changes(
    phases_a: Real, values_a: Real, kinds_a: Kinds, phases_b: Real, values_b: Real,
    kinds_b: Kinds, full: float,
) -> tuple[Kinds, Real]:  # fmt: skip
    """Kinds and phases of the extremes of a and b, nearest to each other, of opposite signs.

    The phase is that of the extreme nearer to zero.
    """
    a, b = _packed(phases_a, values_a, kinds_a), _packed(phases_b, values_b, kinds_b)
    kinds, phases = np.empty(phases_b.size, dtype=np.bool_), np.empty(phases_b.size)
    n = _sign_changes(a.content, b.content, full, address_of(kinds), address_of(phases))
    return kinds[:n], phases[:n]


def alone(phases_a: Real, kinds_a: Kinds, phases_b: Real, kinds_b: Kinds, full: float) -> Kinds:
    """Which extremes of b none of a belongs to: those born or lost between them."""
    a, b = _packed(phases_a, phases_a, kinds_a), _packed(phases_b, phases_b, kinds_b)
    found = np.empty(phases_b.size, dtype=np.bool_)
    _alone(a.content, b.content, full, address_of(found))
    return found


def dip(left: float, right: float, before: float, here: float, after: float) -> float:
    """Where a function may touch zero unseen between `left` and `right` of here, or nan.

    Its three values have one sign, but the parabola through them comes within a quarter of zero.
    """
    return float(_dip(left, right, before, here, after))


def extreme_dip(
    left: float, right: float, before: Extremes, here: Extremes, after: Extremes, full: float
) -> float:
    """The same for the first of the extremes that does so, each with the nearest ones beside it.

    Extremes are their phases, values, and whether they are maxima.
    """
    z, a, b = (_packed(*each) for each in (before, here, after))
    return float(_extreme_dip(left, right, z.content, a.content, b.content, full))
