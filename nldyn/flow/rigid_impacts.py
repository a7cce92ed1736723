"""Impacts of a recorded motion with rigid stops: speeds, impulses, and what they take."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.flow.flow_map import FlowMap, Trajectory
from nldyn.system.system import System

SHUT = 1e-13  # of the displacements that add up to that at a stop: a gap counts as closed
STILL = 1e-9  # of the largest speed at a stop: one that counts as none
ROUNDED = 1e-9  # of the slip before an impact: one behind it that is none


class RigidImpacts(NamedTuple):
    """Impacts with a rigid stop, in the order of time.

    Parameters
    ----------
    piece : (k,)
        Pieces of the record that begin with them.
    phase : (k,)
        Forcing phases.
    speed, rebound : (k,)
        Speeds in m/s at which the gap closes before, and opens after.
    impulse : (k,)
        Impulses in N s along the normal.
    rub : (k,)
        Those of friction, in the sense in which `slip` counts; zero without any.
    slip, slip_behind : (k,)
        Speeds in m/s of sliding before and after; zero without friction.
    """

    piece: NDArray[np.intp]
    phase: Real
    speed: Real
    rebound: Real
    impulse: Real
    rub: Real
    slip: Real
    slip_behind: Real

    @property
    def loss(self) -> Real:
        """Energies (k,) in J that impacts take: an impulse times the mean speed along it."""
        along = 0.5 * self.rub * (self.slip + self.slip_behind)
        return 0.5 * self.impulse * (self.speed - self.rebound) + along


def states_before(motion: Trajectory, pieces: NDArray[np.intp]) -> Real:
    """States z (k, 2n) at the ends of what comes before some pieces of a motion.

    Those of the record: solved anew, an impact may come a rounding earlier, and be over.
    """
    return motion.recorded_states(np.nextafter(motion.record.phase[pieces], -math.inf))


def rigid_impacts(motion: Trajectory, stop: int) -> RigidImpacts:
    """The impacts of a motion with one of its rigid stops.

    Those that end in rest, ever faster, are told as far as the flow map follows them.
    """
    flow, rec = motion.flow, motion.record
    after = 1 + np.flatnonzero(np.isin(rec.event[:-1], list(flow.system.rigid_stops)))
    if not after.size:
        return RigidImpacts(after, *np.empty((7, 0)))
    before = states_before(motion, after)
    row, rate = flow.rows[stop], flow.rate_rows[stop]
    gap = flow.system.stops[stop].gap
    depth = rec.start[after] @ row - gap
    speed, rebound = before @ rate, -(rec.start[after] @ rate)
    size = (np.abs(rec.start) @ np.abs(row)).max() + gap
    size += motion.flow.response(motion.omega).size(motion.omega) * np.abs(row).sum()
    fastest = max(np.abs(rec.start @ rate).max(), np.abs(speed).max())
    hit = (np.abs(depth) <= SHUT * size) & (speed > STILL * fastest)
    hit &= speed + rebound > STILL * speed
    impulses, slips = _impulses(
        flow, stop, speed[hit] + rebound[hit], before[hit], rec.start[after[hit]]
    )
    return RigidImpacts(
        after[hit], rec.phase[after[hit]], speed[hit], rebound[hit], *impulses, *slips
    )


def slider_of(system: System, stop: int) -> int | None:
    """Which of the `System.sliders` a stop presses on, if any."""
    numbers = (i for i, slider in enumerate(system.sliders) if slider.stop == stop)
    return next(numbers, None)


def _impulses(
    flow: FlowMap, stop: int, jump: Real, before: Real, behind: Real
) -> tuple[Real, Real]:
    """Impulses (2, k) along the normal and of friction, and speeds (2, k) of sliding.

    By the jump (k,) of the speed of closing, and the states z (k, 2n) before and behind.
    """
    number = slider_of(flow.system, stop)
    if number is None:
        none = np.zeros(jump.shape)
        return np.array([jump / flow.mobility([stop])[0, 0], none]), np.array([none, none])
    row = flow.rate_rows[len(flow.system.stops) + number]
    belt = flow.system.sliders[number].friction.base_speeds[0]
    slips = np.array([states @ row - belt for states in (before, behind)])
    jumps = np.array([jump, slips[0] - slips[1]])
    return np.linalg.solve(_mobility(flow, stop, number), jumps), slips


def _mobility(flow: FlowMap, stop: int, number: int) -> Real:
    """Speeds (2, 2) of closing and sliding that impulses along the normal and of friction take."""
    return flow.mobility([stop, len(flow.system.stops) + number])


def _turns(flow: FlowMap, number: int, hits: RigidImpacts) -> Real:
    """Normal impulses (k,) in N s at which sliding comes to rest or turns, or those at the end."""
    slider = flow.system.sliders[number]
    (_, both), (_, along) = _mobility(flow, slider.stop, number)
    sense, mu = np.sign(hits.slip), slider.friction.coefficient
    turns = sense * hits.slip_behind <= ROUNDED * np.abs(hits.slip)
    slowed = np.where(turns & (sense != 0.0), sense * both + mu * along, 1.0)
    return np.where(turns, np.abs(hits.slip) / slowed, hits.impulse)


def rubbed(flow: FlowMap, number: int, hits: RigidImpacts) -> Real:
    """Integrals (k,) in N m of the sliding speed over the normal impulse, in impacts of a slider.

    Sliding slows to rest at an instant of the impact, if it does; then it sticks, or slides back
    ever faster. Times μ that is what friction takes.
    """
    turn = _turns(flow, number, hits)
    before, behind = np.abs(hits.slip), np.abs(hits.slip_behind)
    way = before * turn + behind * (hits.impulse - turn)
    way[turn == hits.impulse] += (behind * hits.impulse)[turn == hits.impulse]
    return 0.5 * way


def normal_losses(flow: FlowMap, stop: int, hits: RigidImpacts) -> Real:
    """Energies (k,) in J that impacts take along the normal."""
    number = slider_of(flow.system, stop)
    if number is None:
        return hits.loss
    coefficient = flow.system.sliders[number].friction.coefficient
    return hits.loss - coefficient * rubbed(flow, number, hits)


def compression_works(flow: FlowMap, stop: int, hits: RigidImpacts) -> Real:
    """Work (k,) in J done against a rigid stop until its gap closes no more."""
    number, of = slider_of(flow.system, stop), flow.system.rigid_stops[stop]
    e = np.array([of.restitution_at(speed) for speed in hits.speed.tolist()])
    ends = hits.impulse / (1.0 + np.where(hits.rebound > STILL * hits.speed, e, 0.0))
    work = 0.5 * ends * hits.speed
    if number is None:
        return work
    (own, both), _ = _mobility(flow, stop, number)
    turn = _turns(flow, number, hits)
    share = np.sign(hits.slip) * flow.system.sliders[number].friction.coefficient
    kink = hits.speed - (own + share * both) * turn
    return np.where(turn < ends, 0.5 * (turn * hits.speed + ends * kink), work)
