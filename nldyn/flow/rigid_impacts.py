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


class Course(NamedTuple):
    """What states tell of a rigid stop.

    Parameters
    ----------
    depth, closing, slip : (k,)
        Penetration in m, its rate, and the speed of sliding in m/s, which is zero without friction.
    mobility : (k, 2, 2)
        Speeds of closing and sliding that unit impulses along the normal and of friction take.
    """

    depth: Real
    closing: Real
    slip: Real
    mobility: Real


def course(flow: FlowMap, stop: int, states: Real) -> Course:
    """What states z (k, 2n) tell of a rigid stop."""
    depth, closing = flow.system.depth_and_speed(flow.system.stops[stop], flow.to_modal(states))
    ring, slip = flow.system.round_stops.get(stop), np.zeros(len(states))
    if ring is not None:
        at = flow.system.round_polar(ring, flow.to_modal(states))
        ways = np.stack([ring.sense * at.normal, at.across], axis=1)
        mobility = ways @ flow.mobility(flow.round_rows[stop]) @ np.swapaxes(ways, 1, 2)
        return Course(depth, closing, at.sliding if ring.friction else slip, mobility)
    number = slider_of(flow.system, stop)
    rows = [stop, stop]
    if number is not None:
        rows[1] = len(flow.system.stops) + number
        slip = flow.slips(number, states)[:, 0]
    mobility = np.broadcast_to(flow.mobility(rows), (len(states), 2, 2))
    return Course(depth, closing, slip, np.asarray(mobility))


def friction_at(system: System, stop: int) -> float | None:
    """Coefficient of friction at a rigid stop; None where there is none."""
    ring, number = system.round_stops.get(stop), slider_of(system, stop)
    if ring is not None:
        return ring.friction or None
    return None if number is None else system.sliders[number].friction.coefficient


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
    mobility : (k, 2, 2)
        As of a `Course`.
    """

    piece: NDArray[np.intp]
    phase: Real
    speed: Real
    rebound: Real
    impulse: Real
    rub: Real
    slip: Real
    slip_behind: Real
    mobility: Real

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
        none = np.empty(0)
        return RigidImpacts(
            after, none, none, none, none, none, none, none, np.empty((0, 2, 2))
        )
    before, behind = (
        course(flow, stop, states) for states in (states_before(motion, after), rec.start[after])
    )
    rows = flow.round_rows.get(stop, [stop])
    seen, rates = np.abs(flow.rows[rows]).sum(axis=0), rec.start @ flow.rate_rows[rows].T
    size = (np.abs(rec.start) @ seen).max() + flow.system.rigid_stops[stop].reach
    size += motion.flow.response(motion.omega).size(motion.omega) * seen.sum()
    fastest = max(np.linalg.norm(rates, axis=1).max(), np.abs(before.closing).max())
    speed, rebound = before.closing, -behind.closing
    hit = (np.abs(behind.depth) <= SHUT * size) & (speed > STILL * fastest)
    hit &= speed + rebound > STILL * speed
    impulse, rub, slip, slip_behind = _impulses(
        friction_at(flow.system, stop), Course(*(each[hit] for each in before)),
        Course(*(each[hit] for each in behind)),
    )  # fmt: skip
    return RigidImpacts(
        after[hit], rec.phase[after[hit]], speed[hit], rebound[hit], impulse, rub, slip,
        slip_behind, before.mobility[hit],
    )  # fmt: skip


def slider_of(system: System, stop: int) -> int | None:
    """Which of the `System.sliders` a stop presses on, if any."""
    numbers = (i for i, slider in enumerate(system.sliders) if slider.stop == stop)
    return next(numbers, None)


def _impulses(
    coefficient: float | None, before: Course, behind: Course
) -> tuple[Real, Real, Real, Real]:
    """Impulses (k,) along the normal and of friction, and speeds (k,) of sliding at both ends."""
    jump = before.closing - behind.closing
    if coefficient is None:
        none = np.zeros(jump.shape)
        return jump / before.mobility[:, 0, 0], none, none, none
    jumps = np.stack([jump, before.slip - behind.slip], axis=1)
    impulse, rub = np.linalg.solve(before.mobility, jumps[:, :, None])[:, :, 0].T
    return impulse, rub, before.slip, behind.slip


def _turns(coefficient: float, hits: RigidImpacts) -> Real:
    """Normal impulses (k,) in N s at which sliding comes to rest or turns, or those at the end."""
    both, along = hits.mobility[:, 1].T
    sense = np.sign(hits.slip)
    turns = sense * hits.slip_behind <= ROUNDED * np.abs(hits.slip)
    slowed = np.where(turns & (sense != 0.0), sense * both + coefficient * along, 1.0)
    return np.where(turns, np.abs(hits.slip) / slowed, hits.impulse)


def rubbed(coefficient: float, hits: RigidImpacts) -> Real:
    """Integrals (k,) in N m of the sliding speed over the normal impulse, in impacts with friction.

    Sliding slows to rest at an instant of the impact, if it does; then it sticks, or slides back
    ever faster. Times μ that is what friction takes.
    """
    turn = _turns(coefficient, hits)
    before, behind = np.abs(hits.slip), np.abs(hits.slip_behind)
    way = before * turn + behind * (hits.impulse - turn)
    way[turn == hits.impulse] += (behind * hits.impulse)[turn == hits.impulse]
    return 0.5 * way


def normal_losses(flow: FlowMap, stop: int, hits: RigidImpacts) -> Real:
    """Energies (k,) in J that impacts take along the normal."""
    coefficient = friction_at(flow.system, stop)
    return hits.loss if coefficient is None else hits.loss - coefficient * rubbed(coefficient, hits)


def compression_works(flow: FlowMap, stop: int, hits: RigidImpacts) -> Real:
    """Work (k,) in J done against a rigid stop until its gap closes no more."""
    coefficient, of = friction_at(flow.system, stop), flow.system.rigid_stops[stop]
    e = np.array([of.restitution_at(speed) for speed in hits.speed.tolist()])
    ends = hits.impulse / (1.0 + np.where(hits.rebound > STILL * hits.speed, e, 0.0))
    work = 0.5 * ends * hits.speed
    if coefficient is None:
        return work
    own, both = hits.mobility[:, 0].T
    turn = _turns(coefficient, hits)
    share = np.sign(hits.slip) * coefficient
    kink = hits.speed - (own + share * both) * turn
    return np.where(turn < ends, 0.5 * (turn * hits.speed + ends * kink), work)
