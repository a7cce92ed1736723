"""Test functions of multipliers (engine/multipliers.c)."""

from __future__ import annotations

import ctypes

from nldyn.base.arrays import Complex
from nldyn.engine.library import address_of, function
from nldyn.engine.numbers import complexes

_WHOLE, _NUMBER, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
_shifted = function("nldyn_shifted_product", _WHOLE, _POINTER, _NUMBER, result=_NUMBER)
_torus = function("nldyn_torus_test", _WHOLE, _POINTER, result=_NUMBER)
_nearest = function("nldyn_nearest_pair", _WHOLE, _POINTER, _POINTER)
_travel = function("nldyn_travel", _WHOLE, _POINTER, _POINTER, result=_NUMBER)
_outside = function("nldyn_number_outside", _WHOLE, _POINTER, _NUMBER)


def flip_test(multipliers: Complex) -> float:
    """∏(μ + 1), each factor divided by 1 + |μ|: changes sign where a multiplier crosses -1."""
    return _shifted_product(multipliers, 1.0)


def branch_point_test(multipliers: Complex) -> float:
    """∏(μ - 1), each factor divided by 1 + |μ|: changes sign where a multiplier crosses +1."""
    return _shifted_product(multipliers, -1.0)


def _shifted_product(multipliers: Complex, shift: float) -> float:
    multipliers = complexes(multipliers)
    return float(_shifted(multipliers.size, address_of(multipliers), shift))


def torus_test(multipliers: Complex) -> float:
    """∏(μᵢμⱼ - 1) over pairs i < j, scaled: zero where a pair is on the unit circle.

    The product is the determinant of the bialternate product of Φ with itself minus the identity
    (Kuznetsov 2004, section 10.2.2).
    """
    multipliers = complexes(multipliers)
    return float(_torus(multipliers.size, address_of(multipliers)))


def nearest_pair(multipliers: Complex) -> tuple[int, float]:
    """Index of the first of the two whose product is nearest to 1, and how far that is from 1."""
    multipliers, off = complexes(multipliers), _NUMBER()
    return (
        int(_nearest(multipliers.size, address_of(multipliers), ctypes.addressof(off))),
        off.value,
    )


def travel(before: Complex, after: Complex) -> float:
    """Longest way of a multiplier near the unit circle to the nearest one of the next orbit."""
    before, after = complexes(before), complexes(after)
    return float(_travel(before.size, address_of(before), address_of(after)))


def number_outside(multipliers: Complex, tolerance: float) -> tuple[int, int]:
    """Fewest and most multipliers outside the unit circle, if each modulus may be off so far."""
    multipliers = complexes(multipliers)
    place = address_of(multipliers)
    return (
        int(_outside(multipliers.size, place, tolerance)),
        int(_outside(multipliers.size, place, -tolerance)),
    )
