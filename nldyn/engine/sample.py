"""Recorded trajectories in the engine: states at any instant, local extremes."""

from __future__ import annotations

import ctypes
from collections.abc import Callable

import numpy as np

from nldyn.base.arrays import Complex, Real
from nldyn.engine.layout import OUT_OF_MEMORY, Record
from nldyn.engine.library import HOST, Packed, function
from nldyn.engine.numbers import address_of, complexes, reals

_POINTER, _WHOLE, _NUMBER = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double
_MOTION = [ctypes.c_char_p] * 4
_sample_states = function("nldyn_sample_states", *_MOTION, _NUMBER, _WHOLE, _POINTER, _POINTER)
_local_extremes = function(
    "nldyn_local_extremes", *_MOTION, _NUMBER, _WHOLE, _WHOLE, _POINTER, _POINTER, _WHOLE, _POINTER
)
_touches = function(
    "nldyn_touches", *_MOTION, _NUMBER, _WHOLE, _POINTER, _NUMBER, _WHOLE, _POINTER, _POINTER
)


def sample_states(
    system: Packed, tables: Packed, record: Record, omega: float, phases: Real
) -> Real:
    """States (n_phases, 2n) of a motion at ascending forcing phases."""
    phases = reals(phases)
    states = np.empty((phases.size, record.size))
    _check(
        _sample_states(
            HOST, system.content, tables.content, record.packed, omega, phases.size,
            address_of(phases), address_of(states),
        )
    )  # fmt: skip
    return states


def local_extremes(
    system: Packed,
    tables: Packed,
    record: Record,
    omega: float,
    orders: Real,
    amplitudes: Complex,
    output: int,
) -> Real:
    """Phases, values, whether they are maxima (1 or 0), and values again of all extremes, (k, 4).

    The motion is taken as periodic: an extreme at its start counts once.

    Parameters
    ----------
    system, tables : Packed
        What moves, and the collocation tables.
    record : Record
        The pieces of its motion.
    omega : float
        Excitation frequency.
    orders, amplitudes : (k,)
        Of a base on which the output rides: it adds Σ Re(amplitudes e^{i orders ωt}).
    output : int
        The output.
    """
    orders, amplitudes = reals(orders), complexes(amplitudes)
    base = orders.size, address_of(orders), address_of(amplitudes)
    motion = HOST, system.content, tables.content, record.packed, omega
    return _filled(lambda room, place: _local_extremes(*motion, output, *base, room, place))


def touches(
    system: Packed, tables: Packed, record: Record, omega: float, gaps: Real, share: float
) -> tuple[Real, list[int]]:
    """Extremes (k, 4) of the stops' penetrations, and how many of each stop's are shallow.

    A row has the phase, the penetration, a key (twice the number of the stop, for a maximum one
    more), and the penetration with the gap. Shallow are those within a share of the largest.

    Parameters
    ----------
    system, tables, record, omega
        As of `local_extremes`.
    gaps : (n_stops,)
        What is taken off.
    share : float
        That of the largest.
    """
    shallow = np.zeros(gaps.size, dtype=np.int64)
    motion = HOST, system.content, tables.content, record.packed, omega
    given = gaps.size, address_of(gaps), share
    counts = address_of(shallow)
    found = _filled(lambda room, place: _touches(*motion, *given, room, place, counts))
    return found, shallow.tolist()


def of_stop(extremes: Real, stop: int) -> Real:
    """Those of the extremes (k, 4) of `touches` that are one stop's."""
    found: Real = extremes[extremes[:, 2] // 2.0 == stop]
    return found


def _filled(fill: Callable[[int, int], int]) -> Real:
    """Extremes that a function fills: it is told the room and the address, and tells how many."""
    room = 64
    while True:
        found = np.empty((room, 4))
        count = fill(room, address_of(found))
        if count < 0:
            _check(OUT_OF_MEMORY)
        if count <= room:
            return found[:count].copy()
        room = count


def _check(outcome: int) -> None:
    if outcome == OUT_OF_MEMORY:
        raise MemoryError("no memory for the evaluation of a motion")
