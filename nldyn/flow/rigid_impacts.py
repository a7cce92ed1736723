"""Impacts of a recorded motion with rigid stops: speeds, impulses, and what they take."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from nldyn.base.arrays import Real
from nldyn.flow.flow_map import FlowMap, Trajectory
from nldyn.system.system import System

SHUT = 1e-13  # of the displacements that add up to that at a stop: a gap counts as closed
STILL = 1e-9  # of the largest speed at a stop: one that counts as none
ROUNDED = 1e-9  # of the slip before an impact: one behind it that is none
GONE = 1e-12  # the same over a plane, in an impact: nothing slides on


class Course(NamedTuple):
    """What states tell of a rigid stop.

    Parameters
    ----------
    depth, closing : (k,)
        Penetration in m, and its rate.
    slip : (k, d)
        Speeds of sliding in m/s along each tangent, without friction one that is zero.
    mobility : (k, 1 + d, 1 + d)
        Speeds of closing and sliding that unit impulses along the normal and of friction take.
    """

    depth: Real
    closing: Real
    slip: Real
    mobility: Real


def course(flow: FlowMap, stop: int, states: Real) -> Course:
    """What states z (k, 2n) tell of a rigid stop."""
    depth, closing = flow.system.depth_and_speed(flow.system.stops[stop], flow.to_modal(states))
    ring, slip = flow.system.round_stops.get(stop), np.zeros((len(states), 1))
    if ring is not None:
        at = flow.system.round_polar(ring, flow.to_modal(states))
        ways = np.stack([ring.sense * at.normal, at.across], axis=1)
        mobility = ways @ flow.mobility(flow.round_rows[stop]) @ np.swapaxes(ways, 1, 2)
        return Course(depth, closing, at.sliding[:, None] if ring.friction else slip, mobility)
    number = slider_of(flow.system, stop)
    rows = [stop, stop]
    if number is not None:
        rows = [stop, *flow.slider_rows(number)]
        slip = flow.slips(number, states)
    mobility = np.broadcast_to(flow.mobility(rows), (len(states), len(rows), len(rows)))
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
    rub : (k, d)
        Those of friction along each tangent, in the sense in which `slip` counts; zero without any.
    slip, slip_behind : (k, d)
        Speeds in m/s of sliding before and after; zero without friction.
    mobility : (k, 1 + d, 1 + d)
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
        along = 0.5 * (self.rub * (self.slip + self.slip_behind)).sum(axis=1)
        return np.asarray(0.5 * self.impulse * (self.speed - self.rebound) + along)


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
        none, sides = np.empty(0), np.empty((0, 1))
        return RigidImpacts(after, none, none, none, none, sides, sides, sides, np.empty((0, 2, 2)))
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
    """Impulses (k,) along the normal and (k, d) of friction, and speeds of sliding at both ends."""
    jump = before.closing - behind.closing
    if coefficient is None:
        none = np.zeros((jump.size, 1))
        return jump / before.mobility[:, 0, 0], none, none, none
    jumps = np.column_stack([jump, before.slip - behind.slip])
    found: Real = np.linalg.solve(before.mobility, jumps[:, :, None])[:, :, 0].astype(float)
    return found[:, 0], found[:, 1:], before.slip, behind.slip


def _turns(coefficient: float, hits: RigidImpacts) -> Real:
    """Normal impulses (k,) in N s at which sliding comes to rest or turns, or those at the end."""
    both, along = hits.mobility[:, 1].T
    slip, behind = hits.slip[:, 0], hits.slip_behind[:, 0]
    sense = np.sign(slip)
    turns = sense * behind <= ROUNDED * np.abs(slip)
    slowed = np.where(turns & (sense != 0.0), sense * both + coefficient * along, 1.0)
    return np.where(turns, np.abs(slip) / slowed, hits.impulse)


def rubbed(coefficient: float, hits: RigidImpacts) -> Real:
    """Integrals (k,) in N m of the sliding speed over the normal impulse, in impacts with friction.

    Sliding slows to rest at an instant of the impact, if it does; then it sticks, or slides back
    ever faster. Times μ that is what friction takes.
    """
    if hits.slip.shape[1] == 2:
        return np.asarray(_over_plane(coefficient, hits, hits.impulse)[0])
    turn = _turns(coefficient, hits)
    before, behind = np.abs(hits.slip[:, 0]), np.abs(hits.slip_behind[:, 0])
    way = before * turn + behind * (hits.impulse - turn)
    way[turn == hits.impulse] += (behind * hits.impulse)[turn == hits.impulse]
    return 0.5 * way


def _over_plane(coefficient: float, hits: RigidImpacts, ends: Real) -> Real:
    """Integrals (2, k) of the speeds of sliding and closing over the impulse up to `ends`."""
    each = zip(hits.mobility, hits.speed, hits.slip, ends, strict=True)
    found = [_slid_and_done(coefficient, *one) for one in each]
    return np.array(found, dtype=float).reshape(-1, 2).T


def _slid_and_done(
    coefficient: float, mobility: Real, speed: float, slip: Real, end: float
) -> tuple[float, float]:
    """Integrals of the speeds of sliding and closing in one impact, up to a normal impulse.

    Along the hodograph of sliding u, by s with dP = |u| ds, see `nldyn/engine/plane_impact.c`. The
    work along the normal is what the energy loses beside that of friction.
    """
    both, B, size = mobility[0, 1:], mobility[1:, 1:], float(np.hypot(*slip))

    def rate(_: float, y: Real) -> Real:
        fast = np.hypot(y[0], y[1])
        return np.array([*(-fast * both - coefficient * B @ y[:2]), fast, fast * fast])

    def left(_: float, y: Real) -> float:
        return float(y[2]) - end

    def gone(_: float, y: Real) -> float:
        return float(np.hypot(y[0], y[1])) - GONE * size

    left.terminal = gone.terminal = True  # type: ignore[attr-defined]
    u, passed, slid = np.zeros(2), 0.0, 0.0
    if size > 0.0:
        run = solve_ivp(rate, (0.0, math.inf), [*slip, 0.0, 0.0], method="DOP853", rtol=1e-12,
                        atol=1e-15 * size, events=[left, gone])  # fmt: skip
        u, passed, slid = run.y[:2, -1], float(run.y[2, -1]), float(run.y[3, -1])
        if np.hypot(*u) <= 2.0 * GONE * size:
            u = np.zeros(2)
    if passed < end and not np.any(u):
        u = -(both + B @ _share_behind(coefficient, both, B)) * (end - passed)
        slid += 0.5 * float(np.hypot(*u)) * (end - passed)
    rub = np.linalg.solve(B, slip - u - both * end)
    speeds = np.array([speed, *slip]), np.array([speed - mobility[0] @ [end, *rub], *u])
    energies = [0.5 * float(v @ np.linalg.solve(mobility, v)) for v in speeds]
    return slid, energies[0] - energies[1] - coefficient * slid


def _share_behind(coefficient: float, both: Real, B: Real) -> Real:
    """Friction (2,) per normal impulse from where nothing slides on: it sticks, or leaves."""
    sticks = np.linalg.solve(B, -both)
    if np.hypot(*sticks) <= coefficient:
        return np.asarray(sticks)

    def along(faster: float) -> Real:
        return np.asarray(np.linalg.solve(coefficient * B + faster * np.eye(2), -both))

    def excess(faster: float) -> float:
        return float(np.hypot(*along(faster))) - 1.0

    faster = float(brentq(excess, 0.0, 2.0 * float(np.hypot(*both))))
    return np.asarray(coefficient * along(faster))


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
    if hits.slip.shape[1] == 2:
        return np.asarray(_over_plane(coefficient, hits, ends)[1])
    own, both = hits.mobility[:, 0].T
    turn = _turns(coefficient, hits)
    share = np.sign(hits.slip[:, 0]) * coefficient
    kink = hits.speed - (own + share * both) * turn
    return np.where(turn < ends, 0.5 * (turn * hits.speed + ends * kink), work)
