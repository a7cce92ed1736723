"""Compiled driver of one shooting segment: flights and contact panels in turn."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from nldyn._contact import (
    free_output,
    legendre_tail,
    panel_columns,
    panel_end,
    solve_panel,
)
from nldyn._flight import closing_time, fly, fly_columns, output_derivatives

OK, TOO_MANY_PIECES, CONTACT_FAILED = range(3)
FLIGHT = -1


class Record(NamedTuple):
    """Pieces of a trajectory, enough to evaluate the state at any instant.

    Parameters
    ----------
    phase, duration : (n_pieces,)
        Forcing phase at the start, duration in s.
    kind : (n_pieces,)
        -1 for a flight, else the kind of the panel's ends.
    w : (n_pieces, nz) complex
        State at the start.
    force : (n_pieces, n_stops, m)
        Forces at the nodes of a panel.
    count : (1,)
        Number of pieces in use.
    """

    phase: NDArray[np.float64]
    duration: NDArray[np.float64]
    kind: NDArray[np.int64]
    w: NDArray[np.complex128]
    force: NDArray[np.float64]
    count: NDArray[np.int64]


@njit(cache=True)
def record_piece(rec, phase, h, kind, w):
    """Append a piece; return its index, or -1 when the record is full."""
    n = rec.count[0]
    if n >= rec.phase.size:
        return -1
    rec.phase[n] = phase
    rec.duration[n] = h
    rec.kind[n] = kind
    rec.w[n, :] = w
    rec.force[n, :, :] = 0.0
    rec.count[0] = n + 1
    return n


@njit(cache=True)
def expected_contact(fl, stop, w, phase):
    """Peak penetration, duration and time to release of a free impact through the present state.

    From the energy of the contact spring and the local mobility; a push (positive acceleration
    without speed) counts as an impact as deep as its static penetration. All zero when the stop
    is left at once.
    """
    value, speed, accel, _ = output_derivatives(fl, stop, w, phase, 0.0)
    depth = max(value - fl.gap[stop], 0.0)
    p = fl.exponent[stop]
    rate = fl.stiffness[stop] * fl.mobility[stop]
    static = (max(accel, 0.0) / rate) ** (1.0 / p)
    energy = 0.5 * speed * speed + rate * (depth ** (p + 1.0) + static ** (p + 1.0)) / (p + 1.0)
    if energy <= 0.0:
        return 0.0, 0.0, 0.0
    top_speed = np.sqrt(2.0 * energy)
    peak = (energy * (p + 1.0) / rate) ** (1.0 / (p + 1.0))
    duration = fl.duration_factor[stop] * peak / top_speed
    left = duration * (0.5 + np.arcsin(speed / top_speed) / np.pi)
    if accel < 0.0 and left > 0.0:  # a slow touch is turned back by the deceleration
        turned = (speed + np.sqrt(speed * speed - 2.0 * accel * depth)) / -accel
        share = turned / (turned + left)
        left *= share
        duration *= share
        peak *= share
    return peak, duration, left


@njit(cache=True)
def profile_guess(tab, kind, h, peak, duration, left, delta_row):
    """Half-sine penetrations at the nodes to start Newton's method from."""
    for i in range(delta_row.size):
        t = h * tab.chi[kind, i]
        x = np.pi * min((duration - left + t) / duration, 1.0)
        delta_row[i] = max(peak * np.sin(x), 1e-2 * peak)


@njit(cache=True)
def stretch_profile(tab, old_kind, new_kind, ratio, old, new):
    """Carry node values over to a panel `ratio` times as long, linearly in time."""
    m = old.size
    for i in range(m):
        x = tab.chi[new_kind, i] * ratio
        j = 0
        while j < m and tab.chi[old_kind, j] < x:
            j += 1
        if j == 0:
            new[i] = old[0] * x / tab.chi[old_kind, 0] if old_kind >= 2 else old[0]
        elif j == m:
            new[i] = old[m - 1]
        else:
            x0, x1 = tab.chi[old_kind, j - 1], tab.chi[old_kind, j]
            new[i] = old[j - 1] + (old[j] - old[j - 1]) * (x - x0) / (x1 - x0)


@njit(cache=True)
def crossing(x0, y0, x1, y1):
    """Where the line through two points meets zero."""
    return x0 + (x1 - x0) * y0 / (y0 - y1)


@njit(cache=True)
def first_event(fl, tab, kind, phase, w, h, closed, active, delta, F, E, E_inv, w_end):
    """Stop that first opens or closes within a panel and the fraction of the panel, or (-1, 1)."""
    m = tab.nodes.size
    event, where = -1, 2.0
    position = -1
    for s in range(closed.size):
        if closed[s]:
            position += 1
        end, _, _, _ = output_derivatives(fl, s, w_end, phase + fl.omega * h, 0.0)
        sign = 1.0 if closed[s] else -1.0
        x0, y0 = 0.0, 0.0
        for i in range(m + 1):
            if i == m:
                x1, y1 = 1.0, sign * (end - fl.gap[s])
            elif closed[s]:
                x1 = tab.chi[kind, i]
                y1 = delta[position, i]
            else:
                x1 = tab.chi[kind, i]
                y1 = fl.gap[s] - node_output(fl, tab, kind, phase, w, h, active, F, E, E_inv, s, i)
            if y1 < 0.0:
                x = crossing(x0, y0, x1, y1) if y0 > 0.0 else 0.5 * (x0 + x1)
                if x < where:
                    event, where = s, x
                break
            x0, y0 = x1, y1
    return event, where


@njit(cache=True)
def node_output(fl, tab, kind, phase, w, h, active, F, E, E_inv, out, i):
    """Output at node i of a panel, with the forces at work."""
    value = free_output(fl, out, w, E, i, phase + fl.omega * h * tab.chi[kind, i])
    for k in range(fl.eigenvalues.size):
        total = 0.0j
        for a in range(active.size):
            for j in range(tab.nodes.size):
                share = h * tab.integrate[kind, i, j] * F[a, j]
                total += fl.force[k, active[a]] * share * E_inv[j, k]
        value -= (fl.rows[out, k] * E[i, k] * total).real
    return value


@njit(cache=True)
def guess_panel(fl, tab, phase, w, h, start_switch, active, delta):
    """Choose the kind and length of a panel and guess its penetrations; h bounds the length.

    A contact is covered by two panels, so that no panel has to resolve more than a quarter wave.
    """
    ends = False
    length = h
    for a in range(active.size):
        _, duration, left = expected_contact(fl, active[a], w, phase)
        if left > 0.6 * duration:
            if 0.5 * left < length:
                ends = False
                length = 0.5 * left
        elif left < length:
            ends = True
            length = left
    kind = 2 * start_switch + (1 if ends else 0)
    for a in range(active.size):
        peak, duration, left = expected_contact(fl, active[a], w, phase)
        if duration > 0.0:
            profile_guess(tab, kind, length, peak, duration, left, delta[a])
        else:
            delta[a, :] = 0.0
    return kind, length


@njit(cache=True)
def keep_profile(tab, kind, new_kind, ratio, delta, guess):
    """Carry all node values over to a panel `ratio` times as long."""
    for a in range(delta.shape[0]):
        stretch_profile(tab, kind, new_kind, ratio, delta[a], guess)
        delta[a, :] = np.maximum(guess, 1e-3 * np.max(guess))


@njit(cache=True)
def contact_panel(fl, tab, phase, w, h_max, start_switch, closed, active, delta, work, w_end):
    """Solve one panel and choose its length, at most h_max.

    Returns (status, kind, h, event): a panel that ends where stop `event` opens or closes, or
    (event = -1) one short enough to be resolved. `work` holds (F, dF, E, E_inv, G).
    """
    F, dF, E, E_inv, G = work
    guess = np.empty(tab.nodes.size)
    aim = -1
    limit = h_max
    kind, h = guess_panel(fl, tab, phase, w, limit, start_switch, active, delta)
    for _ in range(100):
        if h <= 0.0 or phase + fl.omega * h == phase:
            return OK, kind, 0.0, active[0] if aim < 0 else aim
        if not solve_panel(fl, tab, kind, phase, w, h, active, delta, F, dF, E, E_inv, G):
            limit = 0.4 * h
            aim = -1
            kind, h = guess_panel(fl, tab, phase, w, limit, start_switch, active, delta)
            continue
        panel_end(fl, tab, kind, w, h, active, F, E_inv, w_end)
        end_phase = phase + fl.omega * h
        if aim >= 0:
            value, speed, _, _ = output_derivatives(fl, aim, w_end, end_phase, 0.0)
            approaching = speed < 0.0 if closed[aim] else speed > 0.0
            dh = (fl.gap[aim] - value) / speed if approaching else np.inf
            # the force vanishes there with its slope: an error ε of the instant costs ε^2.5
            if abs(dh) <= 1e-9 * h:
                if legendre_tail(tab, F) <= fl.tail:
                    return OK, kind, h, aim
            elif h < h_max and h + dh >= h_max:
                h = h_max
                continue
            elif abs(dh) < 0.5 * h and h + dh < h_max:
                h += dh
                continue
            aim = -1
            keep_profile(tab, kind, 2 * start_switch, 0.5, delta, guess)
            kind = 2 * start_switch
            h *= 0.5
            continue
        event, where = first_event(
            fl, tab, kind, phase, w, h, closed, active, delta, F, E, E_inv, w_end
        )
        if event >= 0:
            aim = event
            keep_profile(tab, kind, 2 * start_switch + 1, where, delta, guess)
            kind = 2 * start_switch + 1
            h *= where
            continue
        if kind % 2 == 1 and h < h_max:  # the release was expected here: follow it
            for a in range(active.size):
                value, speed, _, _ = output_derivatives(fl, active[a], w_end, end_phase, 0.0)
                dh = (fl.gap[active[a]] - value) / speed if speed < 0.0 else np.inf
                if dh < 0.5 * h:
                    aim = active[a]
                    h = min(h + dh, h_max)
                    break
            if aim >= 0:
                continue
        if legendre_tail(tab, F) > fl.tail:
            keep_profile(tab, kind, 2 * start_switch, 0.5, delta, guess)
            kind = 2 * start_switch
            h *= 0.5
            continue
        return OK, kind, h, -1
    return CONTACT_FAILED, kind, h, -1


@njit(cache=True)
def propagate(fl, tab, packed, phase, duration, with_columns, rec, recording):
    """Carry a packed state over one segment.

    Parameters
    ----------
    fl, tab : FlowData, GaussTables
    packed : (2n,)
        Real coordinates of w at the start.
    phase, duration : float
        Forcing phase at the start; duration in s. The duration follows the frequency
        (fixed phase), and the derivative with respect to ω takes that into account.
    with_columns : bool
        Whether to carry sensitivities.
    rec, recording : Record, bool
        Where to record the pieces, and whether to.

    Returns
    -------
    end : (2n,)
    jacobian : (2n, 2n)
        Derivative of the end with respect to the start.
    d_omega : (2n,)
        Derivative of the end with respect to ω.
    closings : (n_stops,)
        How often each stop closed.
    status : int
    """
    nz = fl.eigenvalues.size
    size = fl.pack_mode.size
    n_stops = fl.gap.size
    m = tab.nodes.size
    w = np.zeros(nz, dtype=np.complex128)
    columns = np.zeros((nz, size + 1), dtype=np.complex128)
    for c in range(size):
        w[fl.pack_mode[c]] += packed[c] * fl.pack_unit[c]
        columns[fl.pack_mode[c], c] = fl.pack_unit[c]
    closings = np.zeros(n_stops, dtype=np.int64)
    closed = np.zeros(n_stops, dtype=np.bool_)
    for s in range(n_stops):
        value, _, _, _ = output_derivatives(fl, s, w, phase, 0.0)
        closed[s] = value - fl.gap[s] > 0.0
    status = run_pieces(
        fl, tab, w, columns, phase, duration, closed, closings, with_columns, rec, recording, m
    )
    end = np.empty(size)
    jacobian = np.empty((size, size))
    d_omega = np.empty(size)
    rate = np.empty(nz, dtype=np.complex128)
    end_phase = phase + fl.omega * duration
    for k in range(nz):
        rate[k] = fl.eigenvalues[k] * w[k]
    for s in range(n_stops):
        value, _, _, _ = output_derivatives(fl, s, w, end_phase, 0.0)
        delta = value - fl.gap[s]
        if delta > 0.0:
            force = fl.stiffness[s] * delta ** fl.exponent[s]
            for k in range(nz):
                rate[k] -= fl.force[k, s] * force
    for r in range(size):
        mode = fl.pack_mode[r]
        turn = np.conj(fl.pack_unit[r])
        end[r] = (w[mode] * turn).real
        for c in range(size):
            jacobian[r, c] = (columns[mode, c] * turn).real
        total = columns[mode, size] - rate[mode] * (duration / fl.omega)
        d_omega[r] = (total * turn).real
    return end, jacobian, d_omega, closings, status


@njit(cache=True)
def run_pieces(
    fl, tab, w, columns, phase, duration, closed, closings, with_columns, rec, recording, m
):
    """Advance w and its sensitivities in place over a segment, piece by piece."""
    nz = w.size
    n_stops = closed.size
    fastest = 0.0
    for k in range(nz):
        fastest = max(fastest, abs(fl.eigenvalues[k]))
    h_cap = 0.6 * m / fastest
    shortest = 1e-10 / max(fastest, fl.omega)
    t = 0.0
    start_switch = 0
    skip = 0.0
    w_end = np.empty(nz, dtype=np.complex128)
    for _ in range(100000):
        remain = duration - t
        if remain <= 0.0:
            return OK
        here = phase + fl.omega * t
        n_active = 0
        for s in range(n_stops):
            if closed[s]:
                n_active += 1
        if n_active == 0:
            first, stop = remain, -1
            for s in range(n_stops):
                at = closing_time(fl, s, w, here, skip, first)
                if at < first:
                    first, stop = at, s
            if recording and record_piece(rec, here, first, FLIGHT, w) < 0:
                return TOO_MANY_PIECES
            fly(fl, w, first)
            if with_columns:
                fly_columns(fl, columns, first)
            t = duration if stop < 0 else t + first
            skip = 0.0
            if stop >= 0:
                closed[stop] = True
                closings[stop] += 1
                start_switch = 1
            continue
        active = np.flatnonzero(closed)
        if n_active == 1 and start_switch == 1:
            _, _, left = expected_contact(fl, active[0], w, here)
            if left < min(shortest, remain):  # a touch without force
                closed[active[0]] = False
                closings[active[0]] -= 1
                start_switch, skip = 0, shortest
                continue
        delta = np.empty((n_active, m))
        work = (
            np.empty((n_active, m)),
            np.empty((n_active, m)),
            np.empty((m, nz), dtype=np.complex128),
            np.empty((m, nz), dtype=np.complex128),
            np.empty((n_active * m, n_active * m)),
        )
        h_max = min(remain, h_cap)
        status, kind, h, event = contact_panel(
            fl, tab, here, w, h_max, start_switch, closed, active, delta, work, w_end
        )
        if status != OK:
            return status
        F, dF, E, E_inv, G = work
        if h > 0.0:
            if recording:
                n = record_piece(rec, here, h, kind, w)
                if n < 0:
                    return TOO_MANY_PIECES
                for a in range(n_active):
                    rec.force[n, active[a], :] = F[a]
            if with_columns:
                panel_columns(fl, tab, kind, here, t, h, active, dF, E, E_inv, G, columns)
            w[:] = w_end
            t = duration if h >= remain else t + h
        start_switch = 0
        if event >= 0:
            closed[event] = not closed[event]
            start_switch = 1
            if closed[event]:
                closings[event] += 1
            skip = shortest if h < shortest else 0.0
    return TOO_MANY_PIECES
