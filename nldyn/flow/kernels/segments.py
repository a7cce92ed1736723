"""Flights and contacts in turn through the segments of a motion."""

from __future__ import annotations

import math

import numpy as np

from nldyn.flow.kernels.compiling import (
    allocating,
    by_reference,
    inlined,
    inner,
    keep,
    never_inline,
)
from nldyn.flow.kernels.contact import (
    bond_length,
    contact_panel,
    expected_contact,
    growth_of_panel,
    lost_to_rounding,
    remember,
    with_event,
)
from nldyn.flow.kernels.flights import (
    add_growth,
    at_frequency,
    calm_time,
    closing_time,
    distance,
    fastest_moved,
    fly,
    fly_state,
    output_columns,
    output_derivatives,
    output_noise,
    rate_noise,
    term,
    turned,
)
from nldyn.flow.kernels.law import is_bond, is_rigid, never_pulls
from nldyn.flow.kernels.layout import (
    CONTACT_FAILED,
    DASHPOT,
    DECAY,
    FLIGHT,
    GAP,
    HALF_ULP,
    INSTANT,
    MAPPED,
    OK,
    RECORD_FULL,
    RELEASE,
    ROUNDED,
    SUM_ROUNDING,
    TOO_MANY_PIECES,
    TOO_MANY_STEPS,
    WORST_ROUNDING,
)
from nldyn.flow.kernels.panel import new_panel, panel_columns, same_stops
from nldyn.flow.kernels.resolution import at_end
from nldyn.flow.kernels.rigid import (
    AT_START,
    SHUT,
    contact_forces,
    departure,
    hit_stop,
    hold,
    impact,
    settle,
    state_rate,
)

SHORTEST = 1e-10  # time apart, in rad of the excitation or the fastest mode: 1.6e-11 periods


@inner
def record_piece(fl, rec, before, phase, h, kind, event, w):
    """Append a piece; return its index, or -1 when the record is full."""
    n = rec.used[0]
    if n >= rec.phase.size:
        return -1
    rec.used[1] = max(rec.used[1], n + 1)  # what is remembered there is overwritten
    rec.phase[n] = before + phase
    rec.duration[n] = h
    rec.kind[n] = kind
    rec.event[n] = event
    turn = turned(phase)
    for i in range(w.size):
        rec.start[n, i] = w[i] + (fl.response[0, 0, i] * turn).real
    for k in range(fl.terms.kinds.size):
        e, _, _ = term(fl.terms, k, fl.omega, phase)
        for i in range(w.size):
            rec.start[n, i] += (fl.response[1 + k, 0, i] * e).real
    for a in range(rec.force.shape[1]):
        for i in range(rec.force.shape[2]):
            rec.force[n, a, i] = 0.0
            rec.depth[n, a, i] = 0.0
    rec.used[0] = n + 1
    return n


@inlined
def propagate(
    fl, tab, start, phase, duration, with_columns, rec, recording, end, jacobian, d_omega,
    d_parameters, closings,
):  # fmt: skip
    """Carry a state over one segment.

    Parameters
    ----------
    fl : FlowData
        Numbers of the system.
    tab : GaussTables
        Collocation tables.
    start : (2n,)
        State z at the start.
    phase, duration : float
        Forcing phase at the start; duration in s. The duration follows the frequency
        (fixed phase), and the derivative with respect to ω takes that into account.
    with_columns : bool
        Whether to carry sensitivities.
    rec, recording : Record, bool
        Where to record the pieces, and whether to.

    end : (2n,)
        Filled with the state at the end.
    jacobian : (2n, 2n)
        Filled with the derivative of the end with respect to the start, if wanted.
    d_omega : (2n,)
        Filled with the derivative of the end with respect to ω.
    d_parameters : (2n, n_parameters)
        Filled with the derivatives of the end with respect to the parameters.
    closings : (n_stops,)
        Increased by how often each stop closed.

    Returns
    -------
    status : int
    """
    size = start.size
    n_stops = fl.stops.shape[0]
    before = 2.0 * math.pi * math.floor(phase / (2.0 * math.pi))  # whole turns cost digits
    phase -= before
    turn = turned(phase)
    w = np.empty(size)
    n_parameters = fl.parameters.shape[0]
    last = size + n_parameters
    columns = np.zeros((size, last + 1))
    for i in range(size):
        w[i] = start[i] - (fl.response[0, 0, i] * turn).real
        columns[i, i] = 1.0
        columns[i, last] = -(fl.response[0, 1, i] * turn).real
        for c in range(n_parameters):
            columns[i, size + c] = -(fl.response[0, 2 + c, i] * turn).real
    add_growth(fl, phase, -1.0, w, columns)
    closed = np.zeros(n_stops, dtype=np.bool_)
    bounces = np.zeros(n_stops, dtype=np.int64)
    for s in range(n_stops):
        value, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
        left = output_noise(fl, s, w) if speed < 0.0 else 0.0  # it opens at this instant
        shut = value - fl.stops[s, GAP] > left and not is_rigid(fl, s)
        closed[s] = is_bond(fl, s) or shut
        if never_pulls(fl, s) and closed[s]:
            release = int(fl.stops[s, RELEASE])
            value, speed, _, _ = output_derivatives(fl, release, w, phase, 0.0)
            left = output_noise(fl, release, w) if speed < 0.0 else 0.0
            closed[s] = value - fl.stops[s, GAP] > left
    begin_on_rigid_stops(fl, phase, closed, closings, bounces, with_columns, w, columns)
    pushes = np.full(n_stops, np.nan)
    status = run_pieces(
        fl, tab, w, columns, phase, before, duration, closed, closings, bounces, with_columns, rec,
        recording, pushes,
    )  # fmt: skip
    end_phase = phase + fl.omega * duration
    turn = turned(end_phase)
    forces, _ = contact_forces(fl, w, end_phase, closed)
    for s in range(n_stops):
        if not np.isnan(pushes[s]):
            forces[s] = pushes[s]
    rate = state_rate(fl, w, forces)
    add_growth(fl, end_phase, 1.0, w, columns)
    for i in range(size):
        end[i] = w[i] + (fl.response[0, 0, i] * turn).real
        d_omega[i] = columns[i, last] + (fl.response[0, 1, i] * turn).real
        d_omega[i] -= rate[i] * (duration / fl.omega)
        if with_columns:
            for j in range(size):
                jacobian[i, j] = columns[i, j]
            for c in range(n_parameters):
                d_parameters[i, c] = columns[i, size + c] + (fl.response[0, 2 + c, i] * turn).real
    return status


@allocating
def begin_on_rigid_stops(fl, phase, closed, closings, bounces, with_columns, w, columns):
    """Let a body that begins at or beyond rigid stops rebound, rest or leave."""
    hit, _ = hit_stop(fl, w, phase, -1, AT_START)
    if hit >= 0:
        impact(
            fl, hit, False, phase, 0.0, closed, closings, bounces, with_columns, w, columns
        )  # fmt: skip
    else:
        struck, shift = np.zeros(closed.size, dtype=np.bool_), np.zeros(columns.shape[1])
        settle(fl, -1, phase, 0.0, shift, AT_START, closed, struck, with_columns, w, columns)


@allocating
def jump_columns(fl, stop, phase, t, closes, columns):
    """Change of the sensitivities as a dashpot begins or ceases to act, a time t after the start.

    The force jumps by c δ', and the switch moves by -dδ/δ' with the penetration there: together
    they change the velocities by c dδ [Aizerman and Gantmacher 1958].
    """
    never_inline()
    n = columns.shape[1]
    depth = output_columns(fl, stop, 0, phase, t, columns)
    for c in range(fl.parameters.shape[0]):
        if fl.parameters[c, 0] == GAP and fl.parameters[c, 1] == stop:
            depth[columns.shape[0] + c] -= 1.0
    impulse = -fl.stops[stop, DASHPOT] if closes else fl.stops[stop, DASHPOT]
    for k in range(columns.shape[0]):
        for c in range(n):
            columns[k, c] += impulse * fl.force[k, stop] * depth[c]


@inner
def leave_rigid_stops(fl, event, w, phase, closed, shortest, skips):
    """Times (n_stops,) to pass before a gap that has opened without speed is looked at again."""
    for s in range(closed.size):
        if is_rigid(fl, s) and not closed[s]:
            value, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
            shut = s == event or value - fl.stops[s, GAP] >= -SHUT * output_noise(fl, s, w)
            if shut and abs(speed) <= SHUT * rate_noise(fl, s, w):
                skips[s] = departure(fl, s, w, phase, shortest)


@inner
def jumps(fl, stop, w, phase):
    """Whether the force jumps as a stop opens or closes.

    That of one that never pulls does so only where it is hit, not where it lets go, or presses
    again: there the body moves out.
    """
    if never_pulls(fl, stop):
        _, speed, _, _ = output_derivatives(fl, stop, w, phase, 0.0)
        return speed > 0.0
    return fl.stops[stop, DASHPOT] > 0.0


@allocating
def switch(fl, stop, w, phase, t, closed, with_columns, columns):
    """Close a stop that is open, or open one that is closed, a time t after the start."""
    closed[stop] = not closed[stop]
    if with_columns and jumps(fl, stop, w, phase):
        jump_columns(fl, stop, phase, t, closed[stop], columns)


@allocating
def switch_with(fl, w, phase, t, h, closed, closings, with_columns, columns):
    """Open and close the stops that do so at the very instant of another one's event.

    Each to the small share of the length h of the panel before it to which it must be known.
    """
    for s in range(closed.size):
        if with_event(fl, s, w, phase, 10.0 * fl.stops[s, INSTANT] * h, closed):
            switch(fl, s, w, phase, t, closed, with_columns, columns)
            if closed[s]:
                closings[s] += 1


@inlined
def run_pieces(
    fl, tab, w, columns, phase, before, duration, closed, closings, bounces, with_columns, rec,
    recording, pushes,
):  # fmt: skip
    """Advance w and its sensitivities in place over a segment, piece by piece.

    `before` is the phase of the whole turns before it, which only the record shows. `pushes`
    (n_stops,) is filled with the forces at the end of stops that damp so strongly that they cannot
    be told from the state there. `bounces`: see `impact`.
    """
    m = tab.nodes.size
    n_stops = closed.size
    fastest = fastest_moved(fl.blocks, fl.force)
    # lengths of panels that resolve the fastest mode: the maps spread the nodes at one end
    h_even = fl.node_angle * m / fastest if fastest > 0.0 else np.inf
    h_mapped = MAPPED * h_even / tab.power
    panel = new_panel(fl, m, w.size, np.empty(0, dtype=np.int64))
    shortest = max(SHORTEST / max(fastest, fl.omega), SUM_ROUNDING * duration)
    t = 0.0
    start_switch = 0
    skips = np.zeros(n_stops)
    w_end = np.empty(w.size)
    unmoved = np.zeros(columns.shape[1])  # no instant moves while a body rests, or is let go
    # penetrations that are carried from panel to panel, and their rounding errors
    depth, doubt = np.zeros(n_stops), np.full(n_stops, np.inf)
    bonded = n_stops > 0 and is_bond(fl, n_stops - 1)
    reach = np.inf  # length of a panel that the bonds are likely to allow
    for s in range(n_stops):
        if is_bond(fl, s):
            reach = min(reach, bond_length(fl, s, w, phase))
    for _ in range(20000):
        remain = duration - t
        if remain <= 0.0:
            return OK
        here = phase + fl.omega * t
        pushes[:] = np.nan
        active = np.empty(n_stops, dtype=np.int64)
        n_active = 0
        for s in range(n_stops):
            if closed[s]:
                active[n_active] = s
                n_active += 1
            else:
                doubt[s] = np.inf
        if n_active == 0:
            first, stop = remain, -1
            for s in range(n_stops):
                at = closing_time(fl, s, w, here, skips[s], first, shortest)
                if at < 0.0:
                    return TOO_MANY_STEPS
                if at < first:
                    first, stop = at, s
            if recording and record_piece(fl, rec, before, here, first, FLIGHT, stop, w) < 0:
                return RECORD_FULL
            fly_state(fl.blocks, w, first)
            if with_columns:
                fly(fl, columns, first)
            t = duration if stop < 0 else t + first
            skips[:] = 0.0
            if stop >= 0:
                here = phase + fl.omega * t
                start_switch = 1
                if is_rigid(fl, stop):
                    start_switch = 0
                    impact(
                        fl, stop, True, here, t, closed, closings, bounces, with_columns, w, columns
                    )  # fmt: skip
                    leave_rigid_stops(fl, stop, w, here, closed, shortest, skips)
                else:
                    switch(fl, stop, w, here, t, closed, with_columns, columns)
                    closings[stop] += 1
                switch_with(fl, w, here, t, 0.0, closed, closings, with_columns, columns)
            continue
        active = active[:n_active]
        if not same_stops(active, panel.active):
            panel = new_panel(fl, m, w.size, active)
        lone = n_active == 1 and start_switch == 1
        if lone and not bonded and not is_rigid(fl, active[0]):
            peak, _, left = expected_contact(fl, active[0], w, here)
            noise = output_noise(fl, active[0], w)
            if lost_to_rounding(fl, active[0], w, peak, noise) > WORST_ROUNDING:
                return ROUNDED
            if peak <= 100.0 * noise:  # a touch without force
                switch(fl, active[0], w, here, t, closed, with_columns, columns)
                closings[active[0]] -= 1
                start_switch = 0
                calm = calm_time(fl, active[0], w, here, 100.0 * noise)
                skips[active[0]] = max(min(left, calm), shortest)
                continue
        h_max = min(remain, h_mapped if start_switch == 1 else h_even, reach)
        for a in range(n_active):
            noise = output_noise(fl, active[a], w)
            if doubt[active[a]] >= noise:  # the state knows it as well
                value = distance(fl, active[a], w, here)
                begins = start_switch == 1 and abs(value) <= noise
                depth[active[a]] = 0.0 if begins else value
                doubt[active[a]] = 0.0 if begins else noise
            panel.depth[0, a], panel.depth[1, a] = depth[active[a]], doubt[active[a]]
        status, kind, h, event = contact_panel(
            fl, tab, before, here, w, h_max, h_mapped, start_switch, closed, by_reference(panel),
            w_end, rec,
        )  # fmt: skip
        keep(panel)
        if status != OK:
            return status
        if bonded and h > 0.0:
            grown = growth_of_panel(fl, tab, by_reference(panel)) * h
            keep(panel)
            cut = event >= 0 or h >= remain or start_switch == 1
            reach = max(reach, grown) if cut else grown
        if h > 0.0:
            if not np.isfinite(w_end.sum()):
                return CONTACT_FAILED
            if recording:
                n = record_piece(fl, rec, before, here, h, kind, event, w)
                if n < 0:
                    return RECORD_FULL
                for a in range(n_active):
                    for i in range(m):
                        rec.force[n, active[a], i] = panel.F[a, i]
                        rec.depth[n, active[a], i] = panel.output[a, i]
            for a in range(n_active):
                if HALF_ULP * panel.decay[1, a] > WORST_ROUNDING:
                    return ROUNDED
                panel.decay[0, a] += panel.decay[1, a]
                if panel.decay[1, a] > DECAY:
                    pushes[active[a]] = at_end(tab, panel.F, a)
            if with_columns:
                panel_columns(fl, tab, kind, here, t, h, by_reference(panel), columns)
                keep(panel)
            for k in range(w.size):
                w[k] = w_end[k]
            t = duration if h >= remain else t + h
            hold(fl, phase + fl.omega * t, t, unmoved, closed, with_columns, w, columns)
            for a in range(n_active):
                depth[active[a]], doubt[active[a]] = panel.depth[2, a], panel.depth[3, a]
        start_switch = 0
        if event >= 0:
            panel.decay[:] = 0.0
            here = phase + fl.omega * t
            skips[:] = shortest if h < shortest else 0.0
            if is_rigid(fl, event):
                if closed[event]:
                    closed[event] = False
                else:
                    impact(
                        fl, event, True, here, t, closed, closings, bounces, with_columns, w,
                        columns,
                    )  # fmt: skip
                leave_rigid_stops(fl, event, w, here, closed, shortest, skips)
            else:
                switch(fl, event, w, here, t, closed, with_columns, columns)
                start_switch = 1
                if closed[event]:
                    closings[event] += 1
            switch_with(fl, w, here, t, h, closed, closings, with_columns, columns)
    return TOO_MANY_PIECES


@inlined
def shoot(
    system, tab, rec, recording, omega, nodes, phases, chained, with_columns, parameters, drive_by
):
    """Propagate each node (k, 2n) to the next phase; see `propagate` for what comes back.

    When `chained`, only the first node is used and each segment starts where the last one ended.
    Derivatives are also taken with respect to parameters (n, 2), see `FlowData`; drive_by
    (n, h, 3, 2n) is the derivative of `SystemData.drive` with respect to each.
    """
    numbers = at_frequency(system, omega, parameters, drive_by)
    fl = by_reference(numbers)
    k = phases.size - 1
    size = nodes.shape[1]
    ends = np.zeros((k, size))
    kept = k if with_columns else 1
    jacobians = np.zeros((kept, size, size))
    d_omegas = np.zeros((kept, size))
    d_parameters = np.zeros((kept, size, parameters.shape[0]))
    closings = np.zeros(system.stops.shape[0], dtype=np.int64)
    remember(rec)
    status = OK
    for i in range(k):
        start = ends[i - 1] if chained and i > 0 else nodes[i]
        duration = (phases[i + 1] - phases[i]) / omega
        j = i if with_columns else 0
        status = propagate(
            fl, tab, start, phases[i], duration, with_columns, rec, recording,
            ends[i], jacobians[j], d_omegas[j], d_parameters[j], closings,
        )  # fmt: skip
        if status != OK:
            break
    keep(numbers)
    return ends, jacobians, d_omegas, d_parameters, closings, status
