"""Stretches of a motion in which what rubs sticks, slides one way or the other, or is let go."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import TINY, Real
from nldyn.flow.flow_map import Trajectory
from nldyn.flow.sliding import held_in_pieces, round_friction, touching_pieces

STUCK, OPEN = 0, 2  # modes; those of sliding are 1 and -1, over a plane 1
EXACT = 1e-11  # of friction: a force behind a spring that is nowhere less in a stretch is friction


class Stretch(NamedTuple):
    """A time in which something that rubs does the same all along.

    Parameters
    ----------
    mode : int
        `STUCK`, `OPEN`, or the side to which friction pulls as it slides, 1 or -1; over a plane 1.
    phase : float
        Forcing phase in rad at which it begins.
    length : float
        How long it takes, in rad of that phase.
    """

    mode: int
    phase: float
    length: float


def stretches(motion: Trajectory, number: int) -> list[Stretch]:
    """The stretches of one of `System.rubbing` in a period, in order, none like the one before it.

    The motion is taken as periodic: the last one is not like the first either, unless it is all.

    Examples
    --------
    >>> from nldyn import HarmonicForce, System, solve_orbit
    >>> from nldyn.system import DryFriction
    >>> block = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]},
    ...     dampers=[DryFriction("x", 1.0, 0.8)], excitation=[HarmonicForce("x", 1.0)])
    >>> sorted(each.mode for each in stretches(solve_orbit(block, 0.1).trajectory, 0))
    [-1, 0, 0, 1]
    """
    rec, system = motion.record, motion.flow.system
    if number >= len(system.sliders):
        modes = _modes_around(motion, system.rubbing[number].stop)
    else:
        modes = _modes_of_slider(motion, number)
    lengths = motion.omega * rec.duration
    begins = np.flatnonzero(modes != np.roll(modes, 1))
    if not begins.size:
        return [Stretch(int(modes[0]), float(rec.phase[0]), float(lengths.sum()))]
    totals = np.add.reduceat(np.roll(lengths, -begins[0]), begins - begins[0])
    return [
        Stretch(int(modes[at]), float(rec.phase[at]), float(total))
        for at, total in zip(begins, totals, strict=True)
    ]


def _modes_of_slider(motion: Trajectory, number: int) -> NDArray[np.int64]:
    """Modes (pieces,) of a slider."""
    flow, rec, slider = motion.flow, motion.record, motion.flow.system.sliders[number]
    closed = np.ones(rec.used, dtype=bool)
    if slider.stop >= 0:
        closed = touching_pieces(motion, slider.stop)
    if number not in flow.system.sprung:
        stuck = held_in_pieces(motion, number)
    elif number in flow.plane_rows:
        stuck = np.asarray(~rec.force[:, flow.plane_rows[number][2:]].any(axis=(1, 2)))
    else:
        stuck = _strained(motion, number, closed)
    ways = np.ones(rec.used, dtype=np.int64)
    if number not in flow.plane_rows:
        ways = _sides(rec.force[:, len(flow.system.stops) + number])
    return np.where(closed, np.where(stuck, STUCK, ways), OPEN)


def _modes_around(motion: Trajectory, stop: int) -> NDArray[np.int64]:
    """Modes (pieces,) in a round clearance."""
    _, across, stuck = round_friction(motion, stop)
    modes = np.where(stuck, STUCK, _sides(across))
    return np.where(touching_pieces(motion, stop), modes, OPEN)


def _sides(force: Real) -> NDArray[np.int64]:
    """Signs (pieces,) of forces (pieces, m) that keep them in a piece."""
    return np.where(force.sum(axis=1) < 0.0, -1, 1)


def _strained(motion: Trajectory, number: int, closed: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether what is behind a spring sticks in the pieces of a motion, (pieces,).

    Its force is friction as it slides. It sticks, or slides, from one of its events to the next.
    """
    rec, system = motion.record, motion.flow.system
    slider, output = system.sliders[number], len(system.stops) + number
    normal = rec.force[:, slider.stop] if slider.stop >= 0 else slider.normal_force
    most = slider.friction.coefficient * np.broadcast_to(normal, rec.force[:, output].shape)
    less = np.abs(most - np.abs(rec.force[:, output])).max(axis=1) / (most.max(axis=1) + TINY)
    changes = (rec.event[:-1] == output) | (closed[1:] != closed[:-1])
    first = np.flatnonzero(np.append(True, changes))
    largest = np.maximum.reduceat(less, first)
    return np.repeat(largest > EXACT, np.diff(np.append(first, rec.used)))


def without(word: Sequence[Stretch], some: Collection[int]) -> list[Stretch]:
    """Stretches of a period without some of them, whose time goes to those before.

    What these part is one where it is alike; the first one follows the last.

    Examples
    --------
    >>> word = [Stretch(1, 0.0, 3.0), Stretch(0, 3.0, 0.5), Stretch(1, 3.5, 2.0)]
    >>> without(word, [1])
    [Stretch(mode=1, phase=0.0, length=5.5)]
    """
    found: list[Stretch] = []
    for i, each in enumerate(word):
        if found and (i in some or each.mode == found[-1].mode):
            each = found[-1]._replace(length=found.pop().length + each.length)
        elif i in some:
            continue
        found.append(each)
    missing = sum(each.length for each in word) - sum(each.length for each in found)
    if len(found) > 1 and found[0].mode == found[-1].mode:
        missing += found[0].length
        del found[0]
    return [*found[:-1], found[-1]._replace(length=found[-1].length + missing)] if found else []
