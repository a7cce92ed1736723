"""Compiled evaluation of recorded trajectories: states at any instant, local extremes."""

from __future__ import annotations

import numpy as np

from nldyn.base.arrays import SLACK
from nldyn.flow.kernels.compiling import FILES, allocating, inner, njit
from nldyn.flow.kernels.flights import (
    at_frequency,
    block_exponential,
    fastest_moved,
    fly_state,
    term_since,
    turned,
)
from nldyn.flow.kernels.layout import FLIGHT, SUM_ROUNDING
from nldyn.flow.kernels.resolution import map_fraction
from nldyn.runtime.kernel_cache import resting_on
from nldyn.system.linear import STEADY, Terms

compiled = resting_on(njit(cache=True, error_model="numpy"), *FILES)

UNSEEN = 1e-14  # share of a displacement that rounding may be
PER_HALF_WAVE = 8.0  # samples of the fastest motion that is seen, between which extremes are sought
AT_ONCE = 1e-6  # of the time to the next sample: a difference over it is the slope of a rate
MOST_SAMPLES = 3_000_000  # of a piece, a tenth of a second, in which no more extremes are told


@inner
def stretched_time(tab, kind, x):
    """Inverse of `map_fraction`."""
    x = min(max(x, 0.0), 1.0)
    if kind == 0:
        return x
    if kind == 1:
        left = np.sqrt(1.0 - x)
        return 1.0 - (left if tab.power == 2 else np.sqrt(left))
    if kind == 2:
        root = np.sqrt(x)
        return root if tab.power == 2 else np.sqrt(root)
    s = np.arccos(1.0 - 2.0 * x) / np.pi
    if tab.power == 4:
        low, high = 0.0, 1.0
        for _ in range(60):
            error = map_fraction(tab, kind, s) - x
            if error > 0.0:
                high = s
            else:
                low = s
            slope = 140.0 * (s * (1.0 - s)) ** 3
            step = error / slope if slope > 0.0 else np.inf
            s = s - step if low < s - step < high else 0.5 * (low + high)
            if abs(step) <= SUM_ROUNDING or high - low <= SUM_ROUNDING:
                break
    return s


@inner
def antiderivative_weights(tab, s, out):
    """Weights of the node values in the integral of their interpolant from 0 to s."""
    m = out.size
    for j in range(m):
        out[j] = 0.0
    x = 2.0 * s - 1.0
    before, here = 1.0, x  # Legendre polynomials of degree 0 and 1
    for degree in range(m):
        if degree == 0:
            integral = s
        else:
            following = ((2 * degree + 1) * x * here - degree * before) / (degree + 1)
            integral = 0.5 * (following - before) / (2 * degree + 1)
            before, here = here, following
        for j in range(m):
            out[j] += integral * tab.to_legendre[degree, j]


@inner
def impulses(blocks, force, tab, kind, h, forces, shares):
    """Fill shares (m, 2n): the nodes' impulses on the state, carried back to the panel's start."""
    for j in range(tab.nodes.size):
        slope = h * tab.slope[kind, j]
        for k in range(shares.shape[1]):
            shares[j, k] = 0.0
            for a in range(forces.shape[0]):
                shares[j, k] += slope * force[k, a] * forces[a, j]
        fly_state(blocks, shares[j], -h * tab.chi[kind, j])


@allocating
def state_at(blocks, tab, kind, h, start, shares, t, w):
    """Fill w with the homogeneous state a time t after the start of a piece."""
    if kind == FLIGHT:
        for k in range(w.size):
            w[k] = start[k]
        fly_state(blocks, w, t)
    else:
        weights = np.empty(shares.shape[0])
        antiderivative_weights(tab, stretched_time(tab, kind, t / h), weights)
        state_in_contact(blocks, start, shares, weights, t, w)


@inner
def state_in_contact(blocks, start, shares, weights, t, w):
    """As `state_at` in a panel, with the weights of the nodes up to t."""
    for k in range(w.size):
        w[k] = start[k]
        for j in range(weights.size):
            w[k] -= weights[j] * shares[j, k]
    fly_state(blocks, w, t)


@inner
def without_steady(terms, response, phase, state, w):
    """Fill w with a state less the steady responses, (2n,)."""
    for k in range(w.size):
        w[k] = state[k]
    for p in range(response.shape[0]):
        if p == 0 or terms.kinds[p - 1] == STEADY:
            turn = turned(phase if p == 0 else terms.orders[p - 1] * phase)
            for k in range(w.size):
                w[k] -= (response[p, k] * turn).real


@allocating
def responses(system, omega, orders):
    """What excitation brings about at a frequency, with steady terms of further orders at the end.

    Returns
    -------
    terms : Terms
        k of them.
    response : (1 + k, 2n)
        Amplitudes of the state, as of a `ForcedResponse`; those at the end are zero.
    """
    found = at_frequency(
        system, omega, np.zeros((0, 2), dtype=np.int64), np.zeros((0, 1, 3, 1), dtype=np.complex128)
    )
    k, size = found.terms.kinds.size, system.force.shape[0]
    count = k + orders.size
    terms = Terms(np.full(count, STEADY), np.zeros(count), np.zeros(count, dtype=np.complex128))
    response = np.zeros((1 + count, size), dtype=np.complex128)
    for p in range(1 + k):
        for i in range(size):
            response[p, i] = found.response[p, 0, i]
    for p in range(k):
        terms.kinds[p] = found.terms.kinds[p]
        terms.orders[p], terms.rates[p] = found.terms.orders[p], found.terms.rates[p]
    for p in range(k, count):
        terms.orders[p] = orders[p - k]
    return terms, response


@compiled
def sample_states(system, tab, rec, omega, phases):
    """States (n_phases, 2n) at ascending forcing phases; for the arguments see `local_extremes`."""
    blocks, force = system.blocks, system.force
    terms, response = responses(system, omega, np.empty(0))
    states = np.empty((phases.size, force.shape[0]))
    shares = np.empty((tab.nodes.size, force.shape[0]))
    start = np.empty(force.shape[0])
    piece, ready = 0, -1
    for i in range(phases.size):
        while piece + 1 < rec.used[0] and rec.phase[piece + 1] <= phases[i]:
            piece += 1
        kind, h = rec.kind[piece], rec.duration[piece]
        if ready != piece:
            without_steady(terms, response, rec.phase[piece], rec.start[piece], start)
            if kind != FLIGHT:
                impulses(blocks, force, tab, kind, h, rec.force[piece], shares)
            ready = piece
        t = (phases[i] - rec.phase[piece]) / omega
        state_at(blocks, tab, kind, h, start, shares, t, states[i])
        for p in range(response.shape[0]):
            e = turned(phases[i])
            if p > 0:
                e, _, _ = term_since(terms, p - 1, omega, phases[i], t)
            for j in range(states.shape[1]):
                states[i, j] += (response[p, j] * e).real
    return states


@inner
def output_rate(row, row1, terms, forced, omega, phase, t, w):
    """Value and rate of the output ``row @ w + Re(forced[0] e^{i phase})`` and its terms."""
    turn = forced[0] * turned(phase)
    value = turn.real
    rate = -omega * turn.imag
    for k in range(terms.kinds.size):
        e, e1, _ = term_since(terms, k, omega, phase, t)
        value += (forced[1 + k] * e).real
        rate += (forced[1 + k] * e1).real
    for k in range(w.size):
        value += row[k] * w[k]
        rate += row1[k] * w[k]
    return value, rate


@allocating
def leave_unseen(blocks, row, forced, w):
    """Set to zero what an output ``row @ w`` shows by rounding alone; fastest vibration in rad/s.

    Such are vibrations that ended long ago, of modes that may be very fast.
    """
    sizes = np.empty(blocks.shape[0])
    for b in range(sizes.size):
        j = 2 * b
        sizes[b] = np.hypot(row[j], row[j + 1]) * np.hypot(w[j], w[j + 1])
    least = UNSEEN * (np.abs(forced).sum() + sizes.sum())
    fastest = 0.0
    for b in range(sizes.size):
        if sizes[b] <= least:
            w[2 * b], w[2 * b + 1] = 0.0, 0.0
        else:
            half = 0.5 * (blocks[b, 0, 0] - blocks[b, 1, 1])
            square = half * half + blocks[b, 0, 1] * blocks[b, 1, 0]
            fastest = max(fastest, np.sqrt(max(-square, 0.0)))
    return fastest


@compiled
def local_extremes(system, tab, rec, omega, orders, amplitudes, out):
    """Phases, values and kinds (+1 maximum, -1 minimum) of all local extremes of an output.

    The rate is sampled sixteen times per period of the fastest mode that `leave_unseen` leaves, or
    that stops move in contact; its sign changes are refined. In flight, where a parabola through
    three samples of one sign comes near zero, it is looked for a change of sign there: two extremes
    closer than the samples. So it is behind the first, which may be an impact, by the rate's slope.
    The motion is taken as periodic: an extreme at its start counts once.

    Parameters
    ----------
    system, tab, rec : SystemData, GaussTables, Record
        The pieces of a motion, and of what.
    omega : float
        Excitation frequency.
    orders, amplitudes : (k,)
        Of a base on which the output rides: it adds Σ Re(amplitudes e^{i orders ωt}).
    out : int
        The output.
    """
    blocks, force = system.blocks, system.force
    row, row1 = system.rows[0, out], system.rows[1, out]
    terms, response = responses(system, omega, orders)
    forced = np.zeros(response.shape[0], dtype=np.complex128)
    for p in range(forced.size):
        for i in range(row.size):
            forced[p] += row[i] * response[p, i]
    for p in range(orders.size):
        forced[forced.size - orders.size + p] = amplitudes[p]
    found = np.empty((64, 3))
    n = 0
    w, v, start = np.empty(force.shape[0]), np.empty(force.shape[0]), np.empty(force.shape[0])
    shares = np.empty((tab.nodes.size, force.shape[0]))
    steps = np.empty((blocks.shape[0], 4))
    weights = np.empty((0, tab.nodes.size))
    moved = fastest_moved(blocks, force)
    first_value, first_sign, sign, t_old, rate_old = 0.0, 0, 0, 0.0, 0.0
    t_older, rate_older = 0.0, 0.0
    for piece in range(rec.used[0]):
        h = rec.duration[piece]
        kind = rec.kind[piece]
        without_steady(terms, response, rec.phase[piece], rec.start[piece], start)
        seen = max(omega, leave_unseen(blocks, row, forced, start))
        if kind != FLIGHT:
            seen = max(seen, moved)
        pieces = int(min(np.ceil(h * seen * (PER_HALF_WAVE / np.pi)), MOST_SAMPLES)) + 1
        if kind != FLIGHT:
            pieces += tab.nodes.size
            impulses(blocks, force, tab, kind, h, rec.force[piece], shares)
            if weights.shape[0] != pieces + 1:
                weights = np.empty((pieces + 1, tab.nodes.size))
                for i in range(pieces + 1):
                    antiderivative_weights(tab, i / pieces, weights[i])
        for b in range(blocks.shape[0]):
            e00, e01, e10, e11 = block_exponential(blocks[b], h / pieces)
            steps[b, 0], steps[b, 1], steps[b, 2], steps[b, 3] = e00, e01, e10, e11
        for i in range(pieces + 1):
            x = i / pieces
            t = h * (x if kind == FLIGHT else map_fraction(tab, kind, x))
            if kind != FLIGHT:
                state_in_contact(blocks, start, shares, weights[i], t, w)
            elif i == 0:
                for k in range(w.size):
                    w[k] = start[k]
            else:
                for b in range(blocks.shape[0]):
                    x, y = w[2 * b], w[2 * b + 1]
                    w[2 * b] = steps[b, 0] * x + steps[b, 1] * y
                    w[2 * b + 1] = steps[b, 2] * x + steps[b, 3] * y
            value, rate = output_rate(
                row, row1, terms, forced, omega, rec.phase[piece] + omega * t, t, w
            )
            new_sign = 1 if rate > 0.0 else -1 if rate < 0.0 else sign
            if piece == 0 and i == 0:
                first_value = value
            if first_sign == 0:
                first_sign = sign = new_sign
            if new_sign != sign:
                middle = t
                if i > 0:
                    middle, value = turning_point(
                        blocks, tab, kind, h, start, shares, row, row1, terms, forced, omega,
                        rec.phase[piece], h / pieces, sign, t_old, t, rate_old, rate, v,
                    )  # fmt: skip
                found, n = append_extreme(found, n, rec.phase[piece] + omega * middle, value, sign)
                sign = new_sign
            elif (
                kind == FLIGHT and rate_old * rate > 0.0 and (i == 1 or rate_older * rate_old > 0.0)
            ):
                # two extremes between samples of one sign: where their parabola comes to zero
                lo, hi, rate_lo, rate_hi = t_older, t, rate_older, rate
                middle, rate_middle = t_old, rate_old
                if i == 1:  # behind an impact, where the rate may turn fast: by its slope
                    lo, rate_lo = t_old, rate_old
                    state_at(blocks, tab, kind, h, start, shares, AT_ONCE * t, v)
                    value, slope = output_rate(
                        row, row1, terms, forced, omega, rec.phase[piece] + omega * AT_ONCE * t,
                        AT_ONCE * t, v,
                    )  # fmt: skip
                    slope = (slope - rate_old) / (AT_ONCE * t)
                for step in range(3):
                    if i == 1 and step == 0:
                        where = -2.0 * rate_old / slope if slope * rate_old < 0.0 else hi
                    else:
                        where = near_zero(lo, middle, hi, rate_lo, rate_middle, rate_hi)
                    if not lo < where < hi or where == middle:
                        break
                    state_at(blocks, tab, kind, h, start, shares, where, v)
                    value, rate_where = output_rate(
                        row, row1, terms, forced, omega, rec.phase[piece] + omega * where, where, v
                    )
                    if where < middle:
                        hi, rate_hi = middle, rate_middle
                    else:
                        lo, rate_lo = middle, rate_middle
                    if rate_where * sign < 0.0:
                        phase = rec.phase[piece]
                        first, value = turning_point(
                            blocks, tab, kind, h, start, shares, row, row1, terms, forced, omega,
                            phase, h / pieces, sign, lo, where, rate_lo, rate_where, v,
                        )  # fmt: skip
                        found, n = append_extreme(found, n, phase + omega * first, value, sign)
                        last, value = turning_point(
                            blocks, tab, kind, h, start, shares, row, row1, terms, forced, omega,
                            phase, h / pieces, -sign, where, hi, rate_where, rate_hi, v,
                        )  # fmt: skip
                        found, n = append_extreme(found, n, phase + omega * last, value, -sign)
                        rate_old = 0.0  # the next three samples would show the same pair
                        break
                    middle, rate_middle = where, rate_where
            t_older, rate_older = t_old, rate_old
            t_old, rate_old = t, rate
    if sign != first_sign:
        found, n = append_extreme(found, n, rec.phase[0], first_value, sign)
    return found[:n]


@allocating
def turning_point(
    blocks, tab, kind, h, start, shares, row, row1, terms, forced, omega,
    phase, spacing, sign, lo, hi, rate_lo, rate_hi, v,
):  # fmt: skip
    """Time and value at which the rate of an output changes its sign between two times of a piece.

    By the secant that weighs down an end kept twice (Anderson and Björck 1973).
    """
    middle, value = hi, 0.0
    for step in range(100):
        last = middle
        middle = lo - rate_lo * (hi - lo) / (rate_hi - rate_lo)
        if step > 10 and step % 2 == 0:
            middle = 0.5 * (lo + hi)
        state_at(blocks, tab, kind, h, start, shares, middle, v)
        value, rate_middle = output_rate(
            row, row1, terms, forced, omega, phase + omega * middle, middle, v
        )
        if rate_middle * sign > 0.0:
            if step > 0 and last < middle:
                rate_hi *= shrink(rate_middle, rate_lo)
            lo, rate_lo = middle, rate_middle
        else:
            if step > 0 and last > middle:
                rate_lo *= shrink(rate_middle, rate_hi)
            hi, rate_hi = middle, rate_middle
        if abs(middle - last) <= SLACK * spacing or rate_middle == 0.0:
            break
    return middle, value


@inner
def near_zero(a, b, c, rate_a, rate_b, rate_c):
    """Where the parabola through three rates of one sign comes within a quarter of zero, or nan."""
    first, last = (rate_b - rate_a) / (b - a), (rate_c - rate_b) / (c - b)
    curvature = (last - first) / (c - a)
    if curvature * rate_b <= 0.0:
        return np.nan
    slope = first + curvature * (b - a)
    where = b - 0.5 * slope / curvature
    value = rate_b - 0.25 * slope * slope / curvature
    least = min(abs(rate_a), abs(rate_b), abs(rate_c))
    return where if value * rate_b < 0.25 * least * abs(rate_b) else np.nan


@inner
def shrink(new, old):
    """Weight of the value at the far end when the near end moves once more on the same side."""
    weight = 1.0 - new / old if old != 0.0 else 0.5
    return weight if weight > 0.0 else 0.5


@allocating
def append_extreme(found, n, phase, value, sign):
    """Append to a table that grows; returns it and its length."""
    if n == found.shape[0]:
        larger = np.empty((2 * n, 3))
        for i in range(n):
            for j in range(3):
                larger[i, j] = found[i, j]
        found = larger
    found[n, 0], found[n, 1], found[n, 2] = phase, value, sign
    return found, n + 1
