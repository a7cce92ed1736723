"""Impacts of a recorded motion with rigid stops, and the forces while it rests on them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.flow.flow_map import Trajectory
from nldyn.system.elements import Stop
from nldyn.system.rigid_stop import RigidStop

SHUT = 1e-13  # of the displacements that add up to that at a stop: a gap counts as closed
STILL = 1e-9  # of the largest speed at a stop: one that counts as none


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
    """

    piece: NDArray[np.intp]
    phase: Real
    speed: Real
    rebound: Real

    def impulse(self, mobility: float) -> Real:
        """Impulses (k,) in N s, by the mobility of the stop in 1/kg."""
        return (self.speed + self.rebound) / mobility


def rigid_impacts(motion: Trajectory, stop: int) -> RigidImpacts:
    """The impacts of a motion with one of its rigid stops.

    Those that end in rest, ever faster, are told as far as the flow map follows them.
    """
    flow, rec = motion.flow, motion.record
    rigid = [isinstance(each, RigidStop) for each in flow.system.stops]
    after = 1 + np.flatnonzero(np.isin(rec.event[:-1], np.flatnonzero(rigid)))
    if not after.size:
        return RigidImpacts(after, *np.empty((3, 0)))
    before = motion.states(np.nextafter(rec.phase[after], -math.inf))
    row, rate = flow.rows[stop], flow.rate_rows[stop]
    gap = flow.system.stops[stop].gap
    depth = rec.start[after] @ row - gap
    speed, rebound = before @ rate, -(rec.start[after] @ rate)
    size = (np.abs(rec.start) @ np.abs(row)).max() + gap
    size += motion._response.size(motion.omega) * np.abs(row).sum()
    fastest = max(np.abs(rec.start @ rate).max(), np.abs(speed).max())
    hit = (np.abs(depth) <= SHUT * size) & (speed > STILL * fastest)
    hit &= speed + rebound > STILL * speed
    return RigidImpacts(after[hit], rec.phase[after[hit]], speed[hit], rebound[hit])


def rest_forces(motion: Trajectory, phases: Real, states: Real) -> Real:
    """Forces (k, n_stops) in N of rigid stops on what rests on them; zero for elastic stops.

    By the forces that keep the gaps' accelerations at zero, at states z (k, 2n) of the motion at
    forcing phases (k,).
    """
    flow, rec, omega = motion.flow, motion.record, motion.omega
    system, data = flow.system, flow._data
    forces = np.zeros((len(phases), len(system.stops)))
    rigid = np.flatnonzero([isinstance(stop, RigidStop) for stop in system.stops])
    piece = np.clip(np.searchsorted(rec.phase, phases, side="right") - 1, 0, None)
    rests = np.any(rec.depth[:, rigid] != 0.0, axis=2)[piece]
    if not rests.any():
        return forces
    turns = np.exp(1j * phases[:, None] * data.orders)
    rates = (turns @ (np.array([1.0, omega, omega * omega]) @ data.drive)).real
    for i, stop in enumerate(system.stops):
        if isinstance(stop, Stop):
            pushed = stop.force(states @ flow.rows[i] - stop.gap, states @ flow.rate_rows[i])
            rates -= pushed[:, None] * data.force[:, i]
    for i, bond in enumerate(system.bonds, len(system.stops)):
        pulled = bond.force(states @ flow.rows[i], states @ flow.rate_rows[i])
        rates -= pulled[:, None] * data.force[:, i]
    rows = flow.rate_rows[rigid]
    pace = states @ data.rows[2, rigid].T + rates @ rows.T
    mobility = rows @ data.force[:, rigid]
    for k in np.flatnonzero(rests.any(axis=1)):
        held = np.flatnonzero(rests[k])
        forces[k, rigid[held]] = np.linalg.solve(mobility[np.ix_(held, held)], pace[k, held])
    return forces
