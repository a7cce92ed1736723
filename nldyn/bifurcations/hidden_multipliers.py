"""Multipliers between two orbits, and where they may cross the circle (engine/multipliers.c)."""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Complex, Real
from nldyn.engine.library import address_of, function
from nldyn.engine.numbers import complexes, reals
from nldyn.orbits.critical_functions import travel
from nldyn.orbits.periodic_schur import product_eigenvalues

_WHOLE, _NUMBER, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
_between = function(
    "nldyn_jacobians_between", _WHOLE, _POINTER, _POINTER, _WHOLE, _WHOLE, _WHOLE, _POINTER,
    _POINTER, result=None,
)  # fmt: skip
_off_circle = function("nldyn_off_circle", _WHOLE, _POINTER, result=_NUMBER)
_meetings = function("nldyn_meetings", _WHOLE, _POINTER, _POINTER, *[_NUMBER] * 3, _WHOLE)
_doubtful = function("nldyn_doubtful", _WHOLE, _WHOLE, _POINTER, _POINTER, _NUMBER, _POINTER)
_dips = function(
    "nldyn_dips_towards_circle",
    *(_WHOLE, _WHOLE, _POINTER, _POINTER, _POINTER, _POINTER),
    result=None,
)
_return = function("nldyn_return_of_outside", _WHOLE, _WHOLE, _POINTER, _POINTER)


def jacobians_between(jacobians: Real, places: Real, first: int, last: int, sigmas: Real) -> Real:
    """Jacobians (m, k, n, n) at positions (m,) between those (p, k, n, n) of p orbits.

    Those from first up to last are taken, a polynomial for each segment.
    """
    jacobians, places, sigmas = reals(jacobians), reals(places), reals(sigmas)
    found = np.empty((sigmas.size, *jacobians.shape[1:]))
    _between(
        jacobians[0].size, address_of(jacobians), address_of(places), first, last, sigmas.size,
        address_of(sigmas), address_of(found),
    )  # fmt: skip
    return found


def interpolated(jacobians: Real, places: Real, first: int, last: int, sigmas: Real) -> Complex:
    """Multipliers (m, n) of those Jacobians: they themselves are not smooth where they meet."""
    between = jacobians_between(jacobians, places, first, last, sigmas)
    return np.array([product_eigenvalues(pieces)[0] for pieces in between])


def error_half_way(jacobians: Real, places: Real, first: int, middle: Complex) -> float:
    """How far the multipliers near the circle move where an orbit is left out.

    They are those half-way between the places first and first + 1.
    """
    sigmas = np.array([0.5])
    if places.size == 3:
        return travel(middle, interpolated(jacobians, places, first, first + 2, sigmas)[0])
    left = interpolated(jacobians, places, 0, 3, sigmas)[0]
    right = interpolated(jacobians, places, 1, 4, sigmas)[0]
    return max(travel(middle, left), travel(middle, right))


def off_circle(multipliers: Complex) -> float:
    """Distance of the nearest multiplier from the unit circle."""
    multipliers = complexes(multipliers)
    return float(_off_circle(multipliers.size, address_of(multipliers)))


def farthest_travel(before: Complex, after: Complex) -> float:
    """Longest way of a multiplier near the circle from one set to the other, either way."""
    return max(travel(before, after), travel(after, before))


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
