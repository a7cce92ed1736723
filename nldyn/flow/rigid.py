"""Series of impacts with rigid stops in a recorded motion, and the forces of rest on them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.flow.flow_map import FlowMap, Trajectory
from nldyn.flow.rigid_impacts import RigidImpacts, rigid_impacts, states_before
from nldyn.flow.sliding import held_in_pieces, round_friction
from nldyn.system.friction import Slider
from nldyn.system.round_stop import Polar, RoundStop

BEHIND = 1e-9  # of them: depth of a state that lies behind a rigid stop
STILL = 1e-9  # of the largest speed at a stop: one that counts as none


def behind_rigid_stops(flow: FlowMap, states: Real) -> NDArray[np.bool_]:
    """Which of the states z (k, 2n) lie behind a rigid stop, where no motion can begin."""
    behind = np.zeros(len(states), dtype=bool)
    for i, stop in flow.system.rigid_stops.items():
        rows = flow.rows[flow.round_rows.get(i, [i])]
        size = (np.abs(states) @ np.abs(rows).T).sum(axis=1) + stop.reach
        behind |= flow.outputs_at(i, states) - stop.gap > BEHIND * size
    return behind


def before_rigid_stops(flow: FlowMap, states: Real) -> Real:
    """States z (k, 2n), those behind rigid stops mirrored at them, or moved to the middle."""
    states = states.copy()
    rigid = [row for i in flow.system.rigid_stops for row in flow.round_rows.get(i, [i])]
    for i, stop in flow.system.rigid_stops.items():
        depth = np.maximum(flow.outputs_at(i, states) - stop.gap, 0.0)
        rows = np.array([flow.output_row(i, state) for state in states]).reshape(states.shape)
        states -= 2.0 * (depth / (rows * rows).sum(axis=1))[:, None] * rows
    behind = behind_rigid_stops(flow, states)
    if behind.any():
        across = np.linalg.pinv(flow.rows[rigid]) @ flow.rows[rigid]
        states[behind] -= states[behind] @ across.T
    return states


def impacts_in_order(motion: Trajectory) -> list[tuple[int, float]]:
    """Rigid stop and speed of every impact, also of those that follow within one instant."""
    flow, system = motion.flow, motion.flow.system
    found = {stop: rigid_impacts(motion, stop) for stop in system.rigid_stops}
    hits = [(int(piece), stop, float(speed)) for stop, hit in found.items()
            for piece, speed in zip(hit.piece, hit.speed, strict=True)]  # fmt: skip
    several = {piece for piece, *_ in hits if sum(other == piece for other, *_ in hits) > 1}
    listed = [(stop, speed) for piece, stop, speed in hits if piece not in several]
    for piece in several:
        before = states_before(motion, np.array([piece]))[0]
        rates, columns = _closing(flow, before)
        speeds, mobility = rates @ before, rates @ columns
        shut = [stop for other, stop, _ in hits if other == piece]
        while True:
            hit = max(shut, key=lambda stop: speeds[stop])
            speed = float(speeds[hit])
            if speed <= STILL * np.abs(speeds[shut]).max():
                break
            listed.append((hit, speed))
            kick = (1.0 + system.rigid_stops[hit].restitution_at(speed)) * speed
            kick /= mobility[hit, hit]
            speeds = speeds - mobility[:, hit] * kick
    return listed


def _closing(flow: FlowMap, state: Real) -> tuple[Real, Real]:
    """Rows (n_stops, 2n) of the closing speeds at a state z, columns (2n, n_stops) of impulses."""
    count = len(flow.system.stops)
    rates, columns = flow.rate_rows[:count].copy(), flow.force_columns[:, :count].copy()
    for i, rows in flow.round_rows.items():
        ring = flow.system.round_stops[i]
        out = ring.sense * flow.system.round_polar(ring, flow.to_modal(state[None])).normal[0]
        rates[i], columns[:, i] = out @ flow.rate_rows[rows], flow.force_columns[:, rows] @ out
    return rates, columns


class Series(NamedTuple):
    """What impacts of one period with a rigid stop have to do with rest on it.

    Parameters
    ----------
    follows : (k,)
        Whether each is a later one of a series that ends in rest.
    soft : (k,)
        Whether each is the first of a series before which the body had rested.
    """

    follows: NDArray[np.bool_]
    soft: NDArray[np.bool_]


def series_to_rest(motion: Trajectory, stop: int, hits: RigidImpacts) -> Series:
    """Which impacts of one period with a rigid stop belong to series that end in rest.

    In a series the speeds fall. Its end may lie in the next period.
    """
    rests = rests_in_pieces(motion, stop)
    follows, soft = np.zeros((2, hits.piece.size), dtype=bool)
    if not (rests.any() and follows.size):
        return Series(follows, soft)
    n, k = rests.size, hits.piece.size
    ends = np.flatnonzero(np.tile(rests & ~np.roll(rests, 1), 2))
    pieces = np.concatenate([hits.piece, hits.piece + n])
    twice = np.tile(rests, 2)
    for end in ends.tolist():
        last = int(np.searchsorted(pieces, end, side="right")) - 1
        while last > 0:
            if twice[pieces[last - 1] : pieces[last]].any():
                soft[last % k] = True
                break
            if hits.speed[(last - 1) % k] <= hits.speed[last % k]:
                break
            follows[last % k] = True
            last -= 1
    return Series(follows, soft)


def rests_on_rigid_stop(motion: Trajectory) -> bool:
    """Whether a body rests on a rigid stop for a while in a motion."""
    return any(rests_in_pieces(motion, stop).any() for stop in motion.flow.system.rigid_stops)


def rests_in_pieces(motion: Trajectory, stop: int) -> NDArray[np.bool_]:
    """Whether a body rests on a rigid stop in the pieces of a motion, (pieces,)."""
    rows = motion.flow.round_rows.get(stop, [stop])
    return np.asarray(motion.record.depth[:, rows].any(axis=(1, 2)))


def rest_forces(motion: Trajectory, phases: Real, states: Real) -> Real:
    """Forces (k, n_stops) in N of rigid stops on what rests on them; zero for elastic stops.

    By the forces that keep the gaps' accelerations at zero, at states z (k, 2n) of the motion at
    forcing phases (k,).
    """
    flow, rec, omega = motion.flow, motion.record, motion.omega
    system, data = flow.system, flow._data
    forces = np.zeros((len(phases), len(system.stops)))
    rigid = np.array([i for i in system.rigid_stops if i not in system.round_stops], dtype=np.intp)
    piece = np.clip(np.searchsorted(rec.phase, phases, side="right") - 1, 0, None)
    rests = np.any(rec.depth[:, rigid] != 0.0, axis=2)[piece]
    rings = {i: rests_in_pieces(motion, i)[piece] for i in system.rigid_stops if i not in rigid}
    resting = np.flatnonzero(np.any([*rests.T, *rings.values(), 0.0 * phases], axis=0))
    if not resting.size:
        return forces
    turns = np.exp(1j * phases[:, None] * data.orders)
    rates = (turns @ (np.array([1.0, omega, omega * omega]) @ data.drive)).real
    if system.sprung:  # modal states do not tell the places of what is behind springs
        order = np.argsort(phases, kind="stable")
        states = states.copy()
        states[order] = motion.states(phases[order])
    modal, around, on_rings = flow.to_modal(states), [], []
    for i, on in rings.items():
        ring, (_, across, stuck) = system.round_stops[i], round_friction(motion, i)
        at, sticks = system.round_polar(ring, modal), stuck[piece] & on
        share = np.where(sticks, 0.0, ring.friction * np.sign(across.sum(axis=1)[piece]))
        on_rings.append((on, i, at, share))
        around.append((sticks, ring, at, flow.round_rows[i]))
    for i, stop in system.elastic_stops.items():
        pushed = stop.force(*system.depth_and_speed(stop, modal))
        if isinstance(stop, RoundStop):
            at, sticks = system.round_polar(stop, modal), round_friction(motion, i)[2][piece]
            along = np.where(sticks[:, None], stop.sense * at.normal, stop.along(at))
            rates -= pushed[:, None] * along @ flow.force_columns[:, flow.round_rows[i]].T
            around.append((sticks, stop, at, flow.round_rows[i]))
        else:
            rates -= pushed[:, None] * flow.force_columns[:, i]
    first = len(system.stops)
    tangents = [row for i in range(len(system.sliders)) for row in flow.slider_rows(i)]
    rubs = {i: np.zeros((len(phases), len(tangents))) for i in rigid.tolist()}
    holds = np.zeros((len(phases), len(tangents)), dtype=bool)
    for number in set(system.sprung) & set(system.over_planes):
        slider, own = system.sliders[number], flow.slider_rows(number)
        pulled = (slider.tangential_stiffness or 0.0) * states @ flow.rows[own].T
        most = slider.friction.coefficient * _normal_force(flow, slider, states)
        size = np.hypot(pulled[:, 0], pulled[:, 1])
        share = np.minimum(1.0, most / np.where(size > 0.0, size, 1.0))
        rates -= (share[:, None] * pulled) @ data.force[:, own].T
    for number, slider in enumerate(system.sliders):
        if number in system.sprung and number in system.over_planes:
            continue
        own = flow.slider_rows(number)
        places = [tangents.index(row) for row in own]
        friction = rec.force[piece][:, own]
        acts, sticks = friction.any(axis=(1, 2)), held_in_pieces(motion, number)[piece]
        holds[:, places] = (acts & sticks)[:, None]
        if number in system.sprung:
            most = slider.friction.coefficient * _normal_force(flow, slider, states)
            pulled = (slider.tangential_stiffness or 0.0) * (states @ flow.rows[own[0]])
            pulled = np.clip(pulled, -most, most)
            rates -= pulled[:, None] * flow.force_columns[:, own[0]]
            continue
        slip = flow.slips(number, states)
        size = np.linalg.norm(slip, axis=1)
        way = np.sign(friction.sum(axis=2))  # along a line
        if len(own) == 2:
            way = slip / np.where(size > 0.0, size, 1.0)[:, None]
        way *= np.where(acts & ~sticks, slider.friction.at(size), 0.0)[:, None]
        if slider.stop in system.rigid_stops:
            rubs[slider.stop][:, places] = way
        else:
            way *= _normal_force(flow, slider, states)[:, None]
            rates -= way @ flow.force_columns[:, own].T
    for i, bond in enumerate(system.bonds, first + len(system.sliders)):
        pulled = bond.force(states @ flow.rows[i], states @ flow.rate_rows[i])
        rates -= pulled[:, None] * flow.force_columns[:, i]
    acting = np.r_[rigid, np.array(tangents, dtype=np.intp)]
    rows = flow.rate_rows[acting]
    pace = states @ data.rows[2, acting].T + rates @ rows.T
    for k in resting.tolist():
        pressed = [(i, at, share) for on, i, at, share in on_rings if on[k]]
        more = [
            _held_outward(flow, i, at, float(share[k]), k, states[k], rates[k])
            for i, at, share in pressed
        ] + [
            _held_across(flow, stop, at, plane, k, states[k], rates[k])
            for sticks, stop, at, plane in around
            if sticks[k]
        ]
        held = np.flatnonzero(np.r_[rests[k], holds[k], np.ones(len(more), dtype=bool)])
        columns = flow.force_columns[:, acting]
        pushed = np.column_stack([columns, *(column for _, column, _ in more)])
        taken = np.vstack([rows, *(row for row, _, _ in more)]) @ pushed
        along = taken[:, rigid.size : acting.size].copy()
        for place, stop in enumerate(rigid.tolist()):
            taken[:, place] += along @ rubs[stop][k]
        paces = np.r_[pace[k], [each for _, _, each in more]]
        found = np.linalg.solve(taken[np.ix_(held, held)], paces[held])
        forces[k, rigid[held[held < rigid.size]]] = found[held < rigid.size]
        forces[k, [i for i, *_ in pressed]] = found[len(found) - len(more) :][: len(pressed)]
    return forces


def _held_outward(
    flow: FlowMap, number: int, at: Polar, share: float, k: int, state: Real, rate: Real
) -> tuple[Real, Real, float]:
    """How a state z moves along the radius where it rests in a rigid round clearance, at place k.

    As `_held_across`; friction takes a share of the force.
    """
    ring, plane = flow.system.round_stops[number], flow.round_rows[number]
    out, whirl = ring.sense * at.normal[k], at.sliding[k] - ring.sliding_speed
    row = out @ flow.rate_rows[plane]
    column = flow.force_columns[:, plane] @ (out + share * at.across[k])
    pace = state @ (out @ flow._data.rows[2, plane]) + rate @ row
    return row, column, float(pace + ring.sense * whirl**2 / at.radius[k])


def _held_across(
    flow: FlowMap, stop: RoundStop, at: Polar, plane: list[int], k: int, state: Real, rate: Real
) -> tuple[Real, Real, float]:
    """How a state z moves along the circle where it sticks in a round clearance, at place k.

    The row of its rate, the column of a unit force, and what that force must take away.
    """
    across = at.across[k]
    row, column = across @ flow.rate_rows[plane], flow.force_columns[:, plane] @ across
    whirl, out = at.sliding[k] - stop.sliding_speed, stop.sense * at.rate[k]
    pace = state @ (across @ flow._data.rows[2, plane]) + rate @ row
    return row, column, float(pace - whirl * out / at.radius[k])


def _normal_force(flow: FlowMap, slider: Slider, states: Real) -> Real:
    """What presses a slider on at states (k, 2n), in N."""
    if slider.stop < 0:
        return np.full(len(states), slider.normal_force)
    stop = flow.system.elastic_stops[slider.stop]
    return stop.force(*flow.system.depth_and_speed(stop, flow.to_modal(states)))
