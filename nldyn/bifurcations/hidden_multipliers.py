"""Multipliers between two orbits, and where they may cross the circle (engine/multipliers.c)."""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Complex, Real
from nldyn.engine.library import HOST, Packed, function
from nldyn.engine.numbers import address_of, complexes, reals
from nldyn.orbits.periodic_schur import NO_MEMORY

_WHOLE, _NUMBER, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
_between = function(
    "nldyn_multipliers_between", *[ctypes.c_char_p] * 2, *[_WHOLE] * 3, _POINTER, _POINTER
)
_error = function(
    "nldyn_error_half_way",
    *[ctypes.c_char_p] * 2,
    _WHOLE,
    _WHOLE,
    _POINTER,
    _POINTER,
    result=_NUMBER,
)
_half_way = function(
    "nldyn_half_way",
    *[ctypes.c_char_p] * 2,
    _WHOLE,
    _POINTER,
    _POINTER,
    _NUMBER,
    _POINTER,
    _POINTER,
)
_meetings = function("nldyn_meetings", _WHOLE, _POINTER, _POINTER, *[_NUMBER] * 3, _WHOLE)
_doubtful = function("nldyn_doubtful", _WHOLE, _WHOLE, _POINTER, _POINTER, _NUMBER, _POINTER)
_dips = function(
    "nldyn_dips_towards_circle",
    *(_WHOLE, _WHOLE, _POINTER, _POINTER, _POINTER, _POINTER),
    result=None,
)
_return = function("nldyn_return_of_outside", _WHOLE, _WHOLE, _POINTER, _POINTER)


class Along:
    """Jacobians of some orbits along a branch.

    Parameters
    ----------
    jacobians : (p, k, n, n)
        Of the segments of p orbits.
    places : (p,)
        Where these are.
    """

    def __init__(self, jacobians: Real, places: Real) -> None:
        self.count, self.n = len(places), jacobians.shape[-1]
        self._packed = Packed(*jacobians.shape[1:3], reals(jacobians), reals(places))

    def multipliers(self, sigmas: Real) -> Complex:
        """Those (m, n) of the Jacobians at positions (m,), a polynomial for each segment.

        The multipliers themselves are not smooth where they meet.
        """
        sigmas = reals(sigmas)
        found = np.empty((sigmas.size, self.n), dtype=np.complex128)
        done = _between(
            HOST,
            self._packed.content,
            0,
            self.count,
            sigmas.size,
            address_of(sigmas),
            address_of(found),
        )
        if not done:
            raise MemoryError(NO_MEMORY)
        return found

    def half_way(self, before: Complex, after: Complex, calm: float) -> tuple[bool, Complex, float]:
        """Whether no multiplier comes near the circle between two of the orbits, at 0 and 1.

        That is where all move by less than `calm` times their distance from it in half the step.
        And the multipliers half-way, and how far one moves in all.
        """
        before, after = complexes(before), complexes(after)
        middle, way = np.empty(self.n, dtype=np.complex128), _NUMBER()
        is_calm = _half_way(
            HOST, self._packed.content, self.count, address_of(before), address_of(after), calm,
            address_of(middle), ctypes.addressof(way),
        )  # fmt: skip
        if is_calm < 0:
            raise MemoryError(NO_MEMORY)
        return bool(is_calm), middle, way.value

    def error_half_way(self, first: int, middle: Complex) -> float:
        """How far the multipliers near the circle move where an orbit is left out.

        They are those half-way between the places first and first + 1.
        """
        middle, found = complexes(middle), np.empty(self.n, dtype=np.complex128)
        error = float(
            _error(HOST, self._packed.content, self.count, first, *map(address_of, (middle, found)))
        )
        if error < 0.0:
            raise MemoryError(NO_MEMORY)
        return error


def meetings(
    before: Complex, after: Complex, way: float, error_before: float, error_after: float,
    coarse: bool,
) -> int:  # fmt: skip
    """Whether multipliers near the unit circle may meet, or touch it, between two sets of them.

    Parameters
    ----------
    before, after : (n,) complex
        The multipliers.
    way : float
        How far one moves between them.
    error_before, error_after : float
        Of the multipliers.
    coarse : bool
        Whether to say so, too, of multipliers that come near the circle alone.

    Returns
    -------
    int
        0: they do not, or too far inside to come out. 1: smaller steps tell, as where several
        cross it. 2: the error hides it.
    """
    before, after = complexes(before), complexes(after)
    return int(
        _meetings(
            before.size, address_of(before), address_of(after), way, error_before, error_after,
            coarse,
        )
    )  # fmt: skip


def doubtful(sigmas: Real, sets: Complex, error: float) -> int:
    """Where a multiplier that is followed through some sets may cross the circle more than once.

    The error of ln|μ| is taken as a constant between -1 and 1 times `error` σ(1 - σ).

    Parameters
    ----------
    sigmas : (m,)
        Positions of the sets, from 0 to 1.
    sets : (m, n) complex
        Multipliers; the first and the last are exact.
    error : float
        Of the sets between them.

    Returns
    -------
    int
        Number of a set, or -1.
    """
    sigmas, sets = reals(sigmas), complexes(sets)
    scratch = np.empty(sigmas.size)
    return int(
        _doubtful(*sets.shape, address_of(sigmas), address_of(sets), error, address_of(scratch))
    )


def dips_towards_circle(sigmas: Real, sets: Complex, errors: Real) -> NDArray[np.bool_]:
    """Beside which sets (m, n) of multipliers, at positions (m,), one nears the circle and goes.

    That is where its distance is less than what a parabola may dip between three of them, or the
    parabola itself comes there on either side, and not hidden by the error, (m,).
    """
    sigmas, sets, errors = reals(sigmas), complexes(sets), reals(errors)
    found = np.empty(len(sets), dtype=np.bool_)
    given = map(address_of, (sigmas, sets, errors, found))
    _dips(*sets.shape, *given)
    return found


def return_of_outside(sigmas: Real, sets: Complex) -> int:
    """At which of the sets more or fewer are outside than on the way from first to last, or -1."""
    sigmas, sets = reals(sigmas), complexes(sets)
    return int(_return(*sets.shape, address_of(sigmas), address_of(sets)))
