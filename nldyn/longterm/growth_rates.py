"""How much each direction grows over a sequence of Jacobians (engine/growth.c)."""

from __future__ import annotations

import ctypes

import numpy as np

from nldyn.base.arrays import Real
from nldyn.engine.library import HOST, function
from nldyn.engine.numbers import address_of, reals

_WHOLE, _POINTER = ctypes.c_int64, ctypes.c_void_p
_growth_rates = function(
    "nldyn_growth_rates", ctypes.c_char_p, _WHOLE, _WHOLE, _POINTER, _POINTER, ctypes.c_double,
    _POINTER, _POINTER,
)  # fmt: skip


def growth_rates(jacobians: Real, basis: Real, least: float) -> Real:
    """Carry an orthonormal basis (n, n) in place; return ln of the stretches (k, n).

    After every Jacobian the columns are made orthonormal again, each one twice against those before
    it, since once loses digits where they have nearly become parallel. A column no longer than
    ``least`` times the Jacobian's size has been squeezed to nothing, and another takes its place.
    """
    jacobians, carried = reals(jacobians), reals(basis)
    stretches, moved = np.empty(jacobians.shape[:2]), np.empty(carried.shape)
    _growth_rates(
        HOST, len(jacobians), len(carried), address_of(jacobians), address_of(carried), least,
        address_of(stretches), address_of(moved),
    )  # fmt: skip
    if carried is not basis:
        basis[:] = carried
    return stretches
