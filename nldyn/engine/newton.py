"""Newton's method for the shooting equations, and the flow map alone, in the engine."""

from __future__ import annotations

import ctypes
import struct
from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Complex, Real
from nldyn.engine.layout import OUT_OF_MEMORY, Record, SystemData
from nldyn.engine.library import Packed, function
from nldyn.engine.looking import host_now, raise_ended
from nldyn.engine.numbers import address_of, reals

WIDTH = 8  # numbers in the widest register
_TASK = struct.Struct("8q6d14q")  # the structure Task of newton.c
_newton = function("nldyn_newton", *[ctypes.c_char_p] * 5)


class Corrector(NamedTuple):
    """What Newton's method for the shooting equations needs to know.

    Parameters
    ----------
    row, level : (N + 1,), float
        The plane ``row @ point = level`` on which to stay.
    state_weight : float
        Weight of a state's square in the squared length of a step (that of ln ω is 1).
    rtol : float
        Longest last step.
    longest : float
        Farthest distance of the first corrected point from `aim`: more means failure.
    max_iterations : int
        Most steps; none means the flow map alone.
    aim : (N + 1,)
        Where the point is expected.
    closings : int
        How often stops close in the motion from the guess, or it fails; -1 for any number.
    turn : float
        Least cosine of the first tangent and the normal of the plane, in the metric, or it fails.
    """

    row: Real
    level: float
    state_weight: float
    rtol: float
    longest: float
    max_iterations: int
    aim: Real
    closings: int
    turn: float


class Found(NamedTuple):
    """What comes of a call.

    Parameters
    ----------
    outcome : int
        `OK`, `DIVERGED`, `SINGULAR`, `NOT_CONVERGED` or why the flow map failed.
    iterations : int
    first, last : float
        Lengths of the first and the last step; of `UNDECIDED` friction at a rigid stop the stop
        and the forcing phase.
    along : (N + 1,)
        Vector along the branch, of no particular length; none of the flow map alone.
    ends, jacobians, d_omegas, d_parameters : (k, 2n), (k, 2n, 2n), (k, 2n), (k, 2n, n_parameters)
        Of the segments, at the point before the last step, where the record is from, too.
    closings : (n_stops,)
        How often each stop closed.
    """

    outcome: int
    iterations: int
    first: float
    last: float
    along: Real
    ends: Real
    jacobians: Real
    d_omegas: Real
    d_parameters: Real
    closings: NDArray[np.int64]


def packed_system(system: SystemData) -> Packed:
    """A system's numbers as the engine reads them."""
    blocks, rows, bound3, force, orders, drive, stops, laws, tail, node_angle, common = system
    return Packed(
        len(blocks), rows.shape[1], len(stops), stops.shape[1], orders.size,
        *(np.ascontiguousarray(array) for array in (
            blocks, rows, bound3, force, orders, drive.astype(complex), stops, laws)),
        tail, node_angle, np.ascontiguousarray(common),
    )  # fmt: skip


def newton(
    system: Packed,
    tables: Packed,
    record: Record,
    recording: bool,
    omega: float,
    point: Real,
    phases: Real,
    chained: bool,
    with_columns: bool,
    parameters: NDArray[np.int64],
    drive_by: Complex,
    corrector: Corrector,
    n_stops: int,
    like: Record | None = None,
) -> Found:
    """Newton's method for the shooting equations on a plane, in place, or the flow map alone.

    Parameters
    ----------
    system, tables : Packed
        What is propagated, and the collocation tables.
    record : Record
        Where the pieces are recorded.
    recording : bool
        Whether to record.
    omega : float
        Excitation frequency, of the flow map alone.
    point : (N + 1,), or at least so many states as are needed
        States at the k phases and ln ω; the guess, then the solution. States for the flow map
        alone, which leaves them as they are.
    phases : (k + 1,)
        Forcing phases of the segment ends.
    chained : bool
        Whether only the first node is used and each segment starts where the last one ended.
    with_columns : bool
        Whether to carry sensitivities.
    parameters, drive_by : (n, 2), (n, h, 3, 2n)
        Column of `StopRow`, or -1, and stop of each parameter; derivatives of `SystemData.drive`.
    corrector : Corrector
        The plane and when to stop.
    n_stops : int
        Number of stops and bonds.
    like : Record, optional
        Of a motion nearby over the same phases, whose contact panels are the first guesses.
    """
    size = record.size
    row, level, state_weight, rtol, longest, max_iterations, aim, wanted, turn = corrector
    k, count = phases.size - 1, len(parameters)
    n, kept = point.size if max_iterations else 0, k if with_columns else 1
    room, starts, parts = _answers(
        3, n, k * size, kept * size * size, kept * size, kept * size * count, n_stops
    )
    numbers = np.zeros(room)
    first_place = address_of(numbers)
    row, aim, phases = reals(row), reals(aim), reals(phases)
    task = _TASK.pack(
        recording, chained, with_columns, k, n, count, max_iterations, wanted,
        omega, level, state_weight, rtol, longest, turn, address_of(point), address_of(phases),
        address_of(parameters) if count else 0, address_of(drive_by) if count else 0,
        address_of(row) if n else 0, address_of(aim) if n else 0,
        address_of(like.block) if like is not None else 0,
        *[first_place + start for start in starts],
    )  # fmt: skip
    outcome = _newton(host_now(), system.content, tables.content, record.packed, task)
    raise_ended()
    if outcome == OUT_OF_MEMORY:
        raise MemoryError("no memory for a motion with so many modes and stops")
    told, along, ends, jacobians, d_omegas, by, closings = [numbers[part] for part in parts]
    iterations, first, last = told.tolist()
    return Found(
        outcome, int(iterations), first, last, along, ends.reshape(k, size),
        jacobians.reshape(kept, size, size), d_omegas.reshape(kept, size),
        by.reshape(kept, size, count), closings.view(np.int64),
    )  # fmt: skip


@lru_cache
def _answers(*sizes: int) -> tuple[int, list[int], list[slice]]:
    """Room for arrays of so many numbers in one, where each begins, in bytes, and its part.

    Each begins where a vector register may: sums of BLAS depend on it.
    """
    starts = [0, *accumulate(-(-each // WIDTH) * WIDTH for each in sizes)]
    parts = [slice(a, a + each) for a, each in zip(starts, sizes, strict=False)]
    return starts[-1], [8 * start for start in starts[:-1]], parts
