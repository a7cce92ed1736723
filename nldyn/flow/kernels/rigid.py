"""Rigid stops: impacts, at which velocities jump, and rest, in which a force holds the gap closed.

An impact takes the impulse J = (1 + e) v / Σ c² from the modes, with the speed v at which the gap
closes and the restitution e. Where several stops are hit at once, impacts follow each other within
the instant, the fastest first, each with its own restitution, until no gap closes: energy never
grows.

A body rests on a stop where it would bounce no higher than rounding. The impacts that would
follow have a finite sum in time and impulse: with the acceleration a towards the stop they take
(1 + e) v + e v (1 + e) + ... = v + a Δt within Δt = 2 e v / (a (1 - e)), which is what an impact
without rebound and the force of rest take.
"""

from __future__ import annotations

import numpy as np

from nldyn.flow.kernels.compiling import allocating, inner, never_inline
from nldyn.flow.kernels.flights import (
    add_rates,
    output_columns,
    output_derivatives,
    output_noise,
    rate_noise,
)
from nldyn.flow.kernels.law import is_rigid, law, restitution_at
from nldyn.flow.kernels.layout import GAP, MOBILITY, RESTITUTION
from nldyn.flow.kernels.panel import between, lu_apply, lu_apply_vector, lu_factor

ROUNDS = 100  # of impacts within one instant with restitution; then without
SHUT = 10.0  # roundings of a gap that is shut, and of a rate that is none
AT_START = 1e5  # the same at the start of a segment, whose state is known less well
SLOW = 1e-7  # share of the first speed below which impacts of one instant are no longer told apart
LOW = 10.0  # a body that would rebound no higher than this many roundings of the gap stays
AT_ONCE = 1e-3  # rad of the excitation, within which a body that pushes off hits again


@allocating
def resting_stops(fl, closed):
    """The rigid stops on which a body rests, (k,)."""
    found = np.empty(closed.size, dtype=np.int64)
    n = 0
    for s in range(closed.size):
        if closed[s] and is_rigid(fl, s):
            found[n] = s
            n += 1
    return found[:n]


@allocating
def mobilities(fl, stops):
    """Speeds of closing per unit impulse of each stop (k, k), factored, and the row swaps (k,)."""
    matrix = np.empty((stops.size, stops.size))
    for a in range(stops.size):
        for b in range(stops.size):
            matrix[a, b] = between(fl, stops[a], stops[b])
    order = np.empty(stops.size, dtype=np.int64)
    lu_factor(matrix, order)
    return matrix, order


@allocating
def contact_forces(fl, w, phase, closed):
    """Forces (n_stops,) of the closed stops, and the closing accelerations with them, (n_stops,).

    Those of rigid stops keep their accelerations at zero.
    """
    n = closed.size
    forces, rates = np.zeros(n), np.empty(n)
    for s in range(n):
        value, speed, rates[s], _ = output_derivatives(fl, s, w, phase, 0.0)
        if closed[s]:
            forces[s], _, _ = law(fl, s, value - fl.stops[s, GAP], speed)
    for s in range(n):
        for b in range(n):
            if forces[b] != 0.0:
                rates[s] -= between(fl, s, b) * forces[b]
    stops = resting_stops(fl, closed)
    if stops.size > 0:
        matrix, order = mobilities(fl, stops)
        holding = rates[stops]
        lu_apply_vector(matrix, order, holding)
        for a in range(stops.size):
            forces[stops[a]] = holding[a]
            for s in range(n):
                rates[s] -= between(fl, s, stops[a]) * holding[a]
    return forces, rates


@allocating
def state_rate(fl, w, forces):
    """Rate of change (2n,) of the homogeneous state with forces (n_stops,) at work."""
    rate = np.zeros(w.size)
    add_rates(fl.blocks, w, rate)
    for s in range(forces.size):
        for k in range(w.size):
            rate[k] -= fl.force[k, s] * forces[s]
    return rate


@inner
def hit_stop(fl, w, phase, first, roundings):
    """Rigid stop whose gap is shut and closes fastest, or -1, and that speed.

    That of the stop `first` counts as shut. Rates up to so many `roundings` are none.
    """
    hit, fastest = -1, 0.0
    for s in range(fl.stops.shape[0]):
        if is_rigid(fl, s):
            value, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
            shut = s == first or value - fl.stops[s, GAP] >= -SHUT * output_noise(fl, s, w)
            if shut and speed > max(fastest, roundings * rate_noise(fl, s, w)):
                hit, fastest = s, speed
    return hit, fastest


@inner
def low(fl, stop, w, rebound, push):
    """Whether a rebound against an acceleration is lost in the rounding of the gap."""
    return push > 0.0 and rebound * rebound <= 2.0 * LOW * output_noise(fl, stop, w) * push


@allocating
def impact(fl, first, crossed, phase, t, closed, closings, bounces, with_columns, w, columns):
    """Impacts at the instant at which rigid stop `first` is hit, a time t after the start.

    Of those stops the ones on which the body comes to rest are closed afterwards. `crossed` tells
    that the instant is that of the gap's closing, and moves with it. `bounces` (n_stops,) counts
    impacts since the last release: those that end in rest count as one of `closings`.

    Sensitivities change by the saltation [Aizerman and Gantmacher 1958; Müller 1995]: an earlier
    instant, by τ, is seen with the rates before it, the jump is differentiated, and the rates after
    it lead back. Of several impacts each has an instant of its own, which moves with its own gap:
    they stay in this order. A body at rest on a stop strikes it at the very instant at which
    another impact drives it on.
    """
    never_inline()
    n = columns.shape[1] if with_columns else 0
    shift = np.zeros(n)
    forces, pushes = contact_forces(fl, w, phase, closed)
    struck = np.zeros(closed.size, dtype=np.bool_)
    still, fastest = closed.copy(), 0.0
    for step in range(10 * ROUNDS):
        hit, speed = hit_stop(fl, w, phase, first if step == 0 else -1, SHUT)
        moves = hit if step > 0 else first
        fastest = max(fastest, speed)
        if step > 0 and hit >= 0 and (still[hit] or speed < SLOW * fastest):
            moves = -1
        if with_columns and crossed and moves >= 0:
            if step > 0:
                forces, _ = contact_forces(fl, w, phase, closed)
            rate = state_rate(fl, w, forces)
            move(columns, rate, -shift)
            shift = instant_shift(fl, moves, w, phase, t, columns)
            move(columns, rate, shift)
        if hit < 0:
            break
        restitution, slope = restitution_at(fl, hit, speed)
        if step > ROUNDS or low(fl, hit, w, restitution * speed, pushes[hit]):
            restitution, slope = 0.0, 0.0
        strike(fl, hit, speed, restitution, slope, phase, t, shift, with_columns, w, columns)
        struck[hit] = True
        still[hit] = restitution == 0.0
        leave_parting(fl, w, phase, still)
        bounces[hit] += 1
        closings[hit] += 1
    settle(fl, first, phase, t, shift, SHUT, closed, struck, with_columns, w, columns)
    for s in range(closed.size):
        if struck[s] and closed[s] and bounces[s] > 0:
            closings[s] -= bounces[s] - 1
            bounces[s] = 0
    if with_columns:
        forces, _ = contact_forces(fl, w, phase, closed)
        move(columns, state_rate(fl, w, forces), -shift)


@inner
def leave_parting(fl, w, phase, still):
    """Leave out of the stops on which a body is at rest those that it parts from."""
    for s in range(still.size):
        if still[s]:
            _, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
            still[s] = speed >= -SHUT * rate_noise(fl, s, w)


@allocating
def instant_shift(fl, stop, w, phase, t, columns):
    """Change (n_columns,) of the instant at which a gap closes."""
    _, speed, _, _ = output_derivatives(fl, stop, w, phase, 0.0)
    depth = output_columns(fl, stop, 0, phase, t, columns)
    for c in range(fl.parameters.shape[0]):
        if fl.parameters[c, 0] == GAP and fl.parameters[c, 1] == stop:
            depth[columns.shape[0] + c] -= 1.0
    return -depth / speed


@inner
def move(columns, rate, shift):
    """Add to sensitivities what a rate (2n,) makes of a shift in time (n_columns,)."""
    for k in range(columns.shape[0]):
        for c in range(columns.shape[1]):
            columns[k, c] += rate[k] * shift[c]


@allocating
def shifted_columns(fl, stop, order, phase, t, shift, w, columns):
    """Sensitivities of an output (order 0) or its rate at an instant that shifts, (n_columns,).

    `columns` has the states' own.
    """
    found = output_columns(fl, stop, order, phase, t, columns)
    # the excitation's share of the rate alone: that of the state is in the columns
    parts = output_derivatives(fl, stop, np.zeros(w.size), phase, 0.0)
    for c in range(found.size):
        found[c] += parts[order + 1] * shift[c]
    return found


@allocating
def strike(fl, stop, speed, restitution, slope, phase, t, shift, with_columns, w, columns):
    """One impact: the impulse on the state, and its sensitivities."""
    mobility = fl.stops[stop, MOBILITY]
    impulse = (1.0 + restitution) * speed / mobility
    if with_columns:
        by = shifted_columns(fl, stop, 1, phase, t, shift, w, columns)
        for c in range(by.size):
            by[c] *= (1.0 + restitution + slope * speed) / mobility
        for c in range(fl.parameters.shape[0]):
            if fl.parameters[c, 0] == RESTITUTION and fl.parameters[c, 1] == stop:
                by[columns.shape[0] + c] += speed / mobility
        for k in range(w.size):
            for c in range(by.size):
                columns[k, c] -= fl.force[k, stop] * by[c]
    for k in range(w.size):
        w[k] -= fl.force[k, stop] * impulse


@allocating
def settle(fl, first, phase, t, shift, roundings, closed, struck, with_columns, w, columns):
    """Close the rigid stops on which the body rests now and open the others.

    A gap and a rate of so many `roundings` are none. A body that an impact on another stop has
    lifted comes back, and stays where that is lost in the rounding of the gap: impacts on several
    stops in turn end so, as those on one do.

    Resting is what is shut, does not part and is pushed on, together with all that does: stops
    that would have to pull are left out one by one.
    """
    for s in range(closed.size):
        if is_rigid(fl, s):
            value, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
            shut = s == first or closed[s] or struck[s]
            shut = shut or value - fl.stops[s, GAP] >= -roundings * output_noise(fl, s, w)
            closed[s] = shut and abs(speed) <= roundings * rate_noise(fl, s, w)
    _, pushes = contact_forces(fl, w, phase, closed)
    for s in range(closed.size):
        if is_rigid(fl, s) and not closed[s]:
            value, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
            shut = value - fl.stops[s, GAP] >= -roundings * output_noise(fl, s, w)
            closed[s] = shut and speed < 0.0 and low(fl, s, w, -speed, pushes[s])
    for _ in range(closed.size):
        forces, _ = contact_forces(fl, w, phase, closed)
        weakest = -1
        for s in range(closed.size):
            pulls = closed[s] and is_rigid(fl, s) and forces[s] <= 0.0
            if pulls and (weakest < 0 or forces[s] < forces[weakest]):
                weakest = s
        if weakest < 0:
            break
        closed[weakest] = False
    hold(fl, phase, t, shift, closed, with_columns, w, columns)


@allocating
def hold(fl, phase, t, shift, closed, with_columns, w, columns):
    """Shut the gaps of the stops that a body rests on, and stop their rates, in all sensitivities.

    By a shift of the displacements along what an impulse moves, and by an impulse.
    """
    stops = resting_stops(fl, closed)
    if stops.size == 0:
        return
    matrix, order = mobilities(fl, stops)
    n = columns.shape[1] if with_columns else 0
    for rate in range(2):
        off = np.zeros((stops.size, 1 + n))
        for a in range(stops.size):
            s = stops[a]
            value, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
            off[a, 0] = speed if rate == 1 else value - fl.stops[s, GAP]
            if with_columns:
                shifted = shifted_columns(fl, s, rate, phase, t, shift, w, columns)
                for c in range(n):
                    off[a, 1 + c] = shifted[c]
                for c in range(fl.parameters.shape[0]):
                    if rate == 0 and fl.parameters[c, 0] == GAP and fl.parameters[c, 1] == s:
                        off[a, 1 + columns.shape[0] + c] -= 1.0
        lu_apply(matrix, order, off)
        kick, along = np.empty(w.size), np.empty(w.size)
        for a in range(stops.size):
            for k in range(w.size):
                kick[k] = fl.force[k, stops[a]]
                along[k] = 0.0 if rate == 0 else kick[k]
            if rate == 0:
                add_rates(fl.blocks, kick, along)
            for k in range(w.size):
                w[k] -= along[k] * off[a, 0]
                for c in range(n):
                    columns[k, c] -= along[k] * off[a, 1 + c]


@inner
def departure(fl, stop, w, phase, shortest):
    """Time after which a gap that opens without speed is open by 100 roundings."""
    noise = 100.0 * output_noise(fl, stop, w)
    t = shortest
    for _ in range(60):
        value, speed, _, _ = output_derivatives(fl, stop, w, phase, t)
        if value - fl.stops[stop, GAP] < -noise and speed < 0.0:
            return t
        t *= 2.0
        if fl.omega * t > AT_ONCE:
            break
    return shortest
