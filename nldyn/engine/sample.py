"""Recorded trajectories in the engine: states at any instant, local extremes."""

from __future__ import annotations

import ctypes

import numpy as np

from nldyn.base.arrays import Complex, Real
from nldyn.engine.layout import OUT_OF_MEMORY
from nldyn.engine.library import HOST, Packed, address_of, function
from nldyn.engine.numbers import complexes, reals

_POINTER, _WHOLE, _NUMBER = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_MOTION = [ctypes.c_char_p] * 4
_sample_states = function("nldyn_sample_states", *_MOTION, _NUMBER, _WHOLE, _POINTER, _POINTER)
_local_extremes = function(
    "nldyn_local_extremes", *_MOTION, _NUMBER, _WHOLE, _WHOLE, _POINTER, _POINTER, _WHOLE,
    _POINTER, _POINTER,
)  # fmt: skip


def sample_states(
    system: Packed, tables: Packed, record: Packed, omega: float, phases: Real, size: int
) -> Real:
    """States (n_phases, size) of a motion at ascending forcing phases."""
    phases = reals(phases)
    states = np.empty((phases.size, size))
    _check(
        _sample_states(
            HOST, system.content, tables.content, record.content, omega, phases.size,
            address_of(phases), address_of(states),
        )
    )  # fmt: skip
    return states


def local_extremes(
    system: Packed,
    tables: Packed,
    record: Packed,
    omega: float,
    orders: Real,
    amplitudes: Complex,
    output: int,
) -> Real:
    """Phases, values and kinds (+1 maximum, -1 minimum) of all local extremes of an output, (k, 3).

    The motion is taken as periodic: an extreme at its start counts once.

    Parameters
    ----------
    system, tables, record : Packed
        The pieces of a motion, and of what.
    omega : float
        Excitation frequency.
    orders, amplitudes : (k,)
        Of a base on which the output rides: it adds Σ Re(amplitudes e^{i orders ωt}).
    output : int
        The output.
    """
    orders, amplitudes = reals(orders), complexes(amplitudes)
    count, capacity = np.zeros(1, dtype=np.int64), 64
    while True:
        found = np.empty((capacity, 3))
        _check(
            _local_extremes(
                HOST, system.content, tables.content, record.content, omega, output, orders.size,
                address_of(orders), address_of(amplitudes), capacity, address_of(found),
                address_of(count),
            )
        )  # fmt: skip
        if count[0] <= capacity:
            return found[: count[0]].copy()
        capacity = int(count[0])


def _check(outcome: int) -> None:
    if outcome == OUT_OF_MEMORY:
        raise MemoryError("no memory for the evaluation of a motion")
