"""Test functions of multipliers (engine/multipliers.c)."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

from nldyn.base.arrays import Complex
from nldyn.engine.library import function
from nldyn.engine.numbers import address_of, complexes

_WHOLE, _NUMBER, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
_shifted = function("nldyn_shifted_product", _WHOLE, _POINTER, _NUMBER, result=_NUMBER)
_torus = function("nldyn_torus_test", _WHOLE, _POINTER, result=_NUMBER)
_travel = function("nldyn_farthest_travel", _WHOLE, _POINTER, _POINTER, result=_NUMBER)
_outside = function("nldyn_number_outside", _WHOLE, _POINTER, _NUMBER)
ROUNDED_MODULUS = 1e-6  # error of a multiplier's modulus that may be rounding


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


def travel(before: Complex, after: Complex) -> float:
    """Longest way of a multiplier near the circle to the nearest of the other orbit, either way."""
    before, after = complexes(before), complexes(after)
    return float(_travel(before.size, address_of(before), address_of(after)))


class Critical(NamedTuple):
    """All test functions of an orbit's multipliers.

    Parameters
    ----------
    flip, branch_point, torus : float
        See `flip_test`, `branch_point_test` and `torus_test`.
    pair : int
        Index of the first of the two multipliers whose product is nearest to 1.
    off : float
        How far that is from 1.
    outside : (int, int)
        Fewest and most multipliers outside the circle, if each modulus is off by `ROUNDED_MODULUS`.
    """

    flip: float
    branch_point: float
    torus: float
    pair: int
    off: float
    outside: tuple[int, int]

    @classmethod
    def told(cls, numbers: list[float]) -> Critical:
        """By the numbers of the engine."""
        flip, branch_point, torus, pair, off, fewest, most = numbers
        return cls(flip, branch_point, torus, int(pair), off, (int(fewest), int(most)))


def number_outside(multipliers: Complex, tolerance: float) -> tuple[int, int]:
    """Fewest and most multipliers outside the unit circle, if each modulus may be off so far."""
    multipliers = complexes(multipliers)
    place = address_of(multipliers)
    return (
        int(_outside(multipliers.size, place, tolerance)),
        int(_outside(multipliers.size, place, -tolerance)),
    )
