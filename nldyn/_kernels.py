"""Compiled kernels of the flow map: flights, contact phases, segments.

All kernels that `shoot` calls are in this one file, because the compile cache looks only at the
file of the function that is called: a change in another file would go unnoticed.

The state z is a list of pairs that move by themselves between contacts, z_b' = A_b z_b with real
2×2 blocks; w is z without the steady response to the excitation.

**Flights** are propagated in closed form; the first contact is found with steps that are bounded
by the third derivative of the gap, so that none is passed over.

**Contact phases**: the modes see one scalar force per stop, so the penetrations at the Gauss nodes
of a panel satisfy a small Volterra equation

    δ_a(t_i) = free_a(t_i) - Σ_b Σ_j h W_ij K_ab(t_i - t_j) F_b(t_j),

K being the impulse response between two stops. Its Newton matrix also gives all sensitivities.
The end state is a Gauss quadrature: order 2m with m nodes.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from nldyn.gauss import GaussTables

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

OK, TOO_MANY_PIECES, CONTACT_FAILED = range(3)
FLIGHT = -1


class SystemData(NamedTuple):
    """Numbers of a system, as the kernels need them.

    The first rows of `rows` are the stops' penetration rows, then the observed outputs.
    """

    blocks: Real  # (n, 2, 2)
    rows: Real  # (n_out, 2n)
    rows1: Real  # (n_out, 2n) rows of the velocities: rows @ A
    rows2: Real  # (n_out, 2n) rows of the accelerations
    bound3: Real  # (n_out, n) |third derivative| <= bound3 |w_b| at any later time
    force: Real  # (2n, n_stops): w' = A w - force @ F
    drive: Complex  # (2, 2n) excitation Re((drive[0] + ω² drive[1]) e^{iωt}) of z
    gap: Real  # (n_stops,)
    stiffness: Real  # (n_stops,)
    exponent: Real  # (n_stops,)
    mobility: Real  # (n_stops,) velocity jump per unit impulse, 1/kg
    duration_factor: Real  # (n_stops,) contact duration = factor * peak / speed
    tail: float  # largest relative Legendre tail accepted on a contact panel


class FlowData(NamedTuple):
    """Numbers of a system at one excitation frequency; see `SystemData`."""

    blocks: Real
    rows: Real
    rows1: Real
    rows2: Real
    bound3: Real
    force: Real
    steady: Complex  # (2n,) z = w + Re(steady e^{iωt})
    d_steady: Complex  # (2n,) its derivative with respect to ω
    forced: Complex  # (n_out,) steady amplitude of each output
    d_forced: Complex  # (n_out,) its derivative with respect to ω
    gap: Real
    stiffness: Real
    exponent: Real
    mobility: Real
    duration_factor: Real
    omega: float
    tail: float


@njit(cache=True, error_model="numpy")
def block_exponential(block, t):
    """The four entries of exp(block t), row by row (also for equal or zero eigenvalues)."""
    mean = 0.5 * (block[0, 0] + block[1, 1])
    half = 0.5 * (block[0, 0] - block[1, 1])
    square = half * half + block[0, 1] * block[1, 0]
    if square < 0.0:
        rate = math.sqrt(-square)
        size = math.exp(mean * t)
        even = size * math.cos(rate * t)
        odd = size * math.sin(rate * t) / rate
    else:
        rate = math.sqrt(square)
        if abs(rate * t) < 1.0:
            size = math.exp(mean * t)
            even = size * math.cosh(rate * t)
            odd = size * (math.sinh(rate * t) / rate if rate > 0.0 else t)
        else:
            up, down = math.exp((mean + rate) * t), math.exp((mean - rate) * t)
            even = 0.5 * (up + down)
            odd = 0.5 * (up - down) / rate
    return even + odd * half, odd * block[0, 1], odd * block[1, 0], even - odd * half


@njit(cache=True, error_model="numpy")
def output_derivatives(fl, out, w, phase, t):
    """Value and first two time derivatives of output `out`, and a bound on the third, after t."""
    turn = fl.forced[out] * np.exp(1j * (phase + fl.omega * t))
    value = turn.real
    first = -fl.omega * turn.imag
    second = -fl.omega * fl.omega * turn.real
    bound = abs(turn) * fl.omega**3
    for b in range(fl.blocks.shape[0]):
        j = 2 * b
        x, y = w[j], w[j + 1]
        if t != 0.0:
            e00, e01, e10, e11 = block_exponential(fl.blocks[b], t)
            x, y = e00 * x + e01 * y, e10 * x + e11 * y
        value += fl.rows[out, j] * x + fl.rows[out, j + 1] * y
        first += fl.rows1[out, j] * x + fl.rows1[out, j + 1] * y
        second += fl.rows2[out, j] * x + fl.rows2[out, j + 1] * y
        bound += fl.bound3[out, b] * math.sqrt(x * x + y * y)
    return value, first, second, bound


@njit(cache=True, error_model="numpy")
def output_noise(fl, out, w):
    """Rounding error to expect in an output: 4 units in the last place of its terms."""
    total = abs(fl.forced[out])
    for j in range(w.size):
        total += abs(fl.rows[out, j] * w[j])
    return 1e-15 * total


@njit(cache=True, error_model="numpy")
def fastest_rate(fl):
    """Largest |eigenvalue| of the blocks, in 1/s."""
    fastest = 0.0
    for b in range(fl.blocks.shape[0]):
        block = fl.blocks[b]
        mean = 0.5 * (block[0, 0] + block[1, 1])
        square = 0.25 * (block[0, 0] - block[1, 1]) ** 2 + block[0, 1] * block[1, 0]
        rate = math.sqrt(abs(square))
        fastest = max(fastest, math.hypot(mean, rate) if square < 0.0 else abs(mean) + rate)
    return fastest


@njit(cache=True, error_model="numpy")
def safe_step(h, h1, h2, bound):
    """First positive root of h + h1 τ + h2 τ²/2 + bound τ³/6, for h <= 0.

    No function with these derivatives and a third derivative below `bound` reaches zero sooner.
    """
    if bound <= 0.0:  # a parabola
        if h >= 0.0:
            return -2.0 * h1 / h2 if h1 < 0.0 < h2 else (0.0 if h1 >= 0.0 else np.inf)
        square = h1 * h1 - 2.0 * h * h2
        top = h1 + math.sqrt(square) if square >= 0.0 else 0.0
        return -2.0 * h / top if top > 0.0 else np.inf
    if h >= 0.0:
        if h1 >= 0.0:
            return 0.0
        # leave the root at zero out: h1 + h2 τ/2 + bound τ²/6 = 0
        return (-0.5 * h2 + math.sqrt(0.25 * h2 * h2 - 2.0 / 3.0 * bound * h1)) * 3.0 / bound
    turning = h2 * h2 - 2.0 * bound * h1
    tau = -1.0
    if h2 < 0.0 and h1 > 0.0 and turning >= 0.0:
        top = 2.0 * h1 / (-h2 + math.sqrt(turning))
        if h + top * (h1 + top * (0.5 * h2 + top * bound / 6.0)) >= 0.0:
            tau = 0.0  # the root lies on the concave rise before the top: Newton from the left
    if tau < 0.0:  # beyond the inflection: Newton from an upper bound of all roots
        tau = 2.0 * max(
            3.0 * abs(h2) / bound,
            max(math.sqrt(6.0 * abs(h1) / bound), (6.0 * abs(h) / bound) ** (1.0 / 3.0)),
        )
    for _ in range(60):
        p = h + tau * (h1 + tau * (0.5 * h2 + tau * bound / 6.0))
        p1 = h1 + tau * (h2 + 0.5 * tau * bound)
        if p1 <= 0.0:
            break
        step = p / p1
        tau -= step
        if abs(step) <= 1e-15 * tau:
            break
    return max(tau, 0.0)


@njit(cache=True, error_model="numpy")
def closing_time(fl, stop, w, phase, start, end):
    """First time in [start, end] at which a stop closes, or inf; no contact is passed over.

    Every step is bounded by the third derivative, so that it cannot cross a contact; the steps
    converge to the contact at order three. Only contacts shorter than 1e-9 periods of the
    fastest mode can be stepped over, and these carry no force.
    """
    shortest = 1e-10 / max(fl.omega, fastest_rate(fl))
    t = start
    while t <= end:
        value, h1, h2, bound = output_derivatives(fl, stop, w, phase, t)
        h = value - fl.gap[stop]
        if h >= 0.0 and h1 > 0.0:
            return t
        tau = safe_step(min(h, 0.0), h1, h2, bound)
        if tau < shortest:
            if h1 > 0.0 and h + h1 * shortest >= 0.0:
                return min(t + max(tau, 0.0), end)
            tau = shortest
        t += tau
    return np.inf


@njit(cache=True, error_model="numpy")
def fly(fl, columns, t):
    """Advance states or sensitivities (2n, n_columns) in place by a flight of duration t."""
    for b in range(fl.blocks.shape[0]):
        e00, e01, e10, e11 = block_exponential(fl.blocks[b], t)
        for c in range(columns.shape[1]):
            x, y = columns[2 * b, c], columns[2 * b + 1, c]
            columns[2 * b, c] = e00 * x + e01 * y
            columns[2 * b + 1, c] = e10 * x + e11 * y


class Record(NamedTuple):
    """Pieces of a trajectory, enough to evaluate the state at any instant.

    Parameters
    ----------
    phase, duration : (n_pieces,)
        Forcing phase at the start, duration in s.
    kind : (n_pieces,)
        -1 for a flight, else the kind of the panel's ends.
    w : (n_pieces, 2n)
        State at the start without the steady response.
    force : (n_pieces, n_stops, m)
        Forces at the nodes of a panel.
    used : (1,)
        Number of pieces in use.
    """

    phase: NDArray[np.float64]
    duration: NDArray[np.float64]
    kind: NDArray[np.int64]
    w: NDArray[np.float64]
    force: NDArray[np.float64]
    used: NDArray[np.int64]


@njit(cache=True, error_model="numpy")
def law(delta, stiffness, exponent):
    """Contact force and its derivative with respect to the penetration."""
    if delta <= 0.0:
        return 0.0, 0.0
    if exponent == 1.5:
        root = np.sqrt(delta)
        return stiffness * delta * root, 1.5 * stiffness * root
    if exponent == 1.0:
        return stiffness * delta, stiffness
    slope = stiffness * delta ** (exponent - 1.0)
    return slope * delta, exponent * slope


@njit(cache=True, error_model="numpy")
def panel_responses(fl, tab, kind, h, active, to, back, G):
    """Fill what a panel of length h needs to know of the linear part.

    to[a, i] = row_a exp(A t_i) and back[a, j] = exp(-A t_j) force_a, both (na, m, 2n), and
    G = h W_ij K_ab(t_i - t_j) with the impulse response K_ab(t) = row_a exp(A t) force_b.
    """
    m = tab.nodes.size
    na = active.size
    for i in range(m):
        t = h * tab.chi[kind, i]
        for b in range(fl.blocks.shape[0]):
            j = 2 * b
            e00, e01, e10, e11 = block_exponential(fl.blocks[b], t)
            i00, i01, i10, i11 = block_exponential(fl.blocks[b], -t)
            for a in range(na):
                x, y = fl.rows[active[a], j], fl.rows[active[a], j + 1]
                to[a, i, j] = x * e00 + y * e10
                to[a, i, j + 1] = x * e01 + y * e11
                x, y = fl.force[j, active[a]], fl.force[j + 1, active[a]]
                back[a, i, j] = i00 * x + i01 * y
                back[a, i, j + 1] = i10 * x + i11 * y
    for a in range(na):
        for b in range(na):
            for i in range(m):
                for j in range(m):
                    total = 0.0
                    for k in range(to.shape[2]):
                        total += to[a, i, k] * back[b, j, k]
                    G[a * m + i, b * m + j] = h * tab.integrate[kind, i, j] * total


@njit(cache=True, error_model="numpy")
def lu_solve(A, B):
    """Solve A X = B in place (X overwrites B, LU overwrites A), with row pivoting."""
    n = A.shape[0]
    n_rhs = B.shape[1]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        if pivot != k:
            for j in range(n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
            for j in range(n_rhs):
                B[k, j], B[pivot, j] = B[pivot, j], B[k, j]
        inverse = 1.0 / A[k, k] if A[k, k] != 0.0 else np.inf
        for i in range(k + 1, n):
            factor = A[i, k] * inverse
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]
                for j in range(n_rhs):
                    B[i, j] -= factor * B[k, j]
    for k in range(n - 1, -1, -1):
        inverse = 1.0 / A[k, k] if A[k, k] != 0.0 else np.inf
        for j in range(n_rhs):
            total = B[k, j]
            for i in range(k + 1, n):
                total -= A[k, i] * B[i, j]
            B[k, j] = total * inverse


@njit(cache=True, error_model="numpy")
def forced_output(fl, out, phase):
    """Steady output at a forcing phase."""
    return (fl.forced[out] * np.exp(1j * phase)).real


@njit(cache=True, error_model="numpy")
def solve_panel(fl, tab, kind, phase, w, h, active, noise, delta, F, dF, to, back, G):
    """Newton's method for the penetrations at the nodes; delta (na, m) holds the guess.

    noise (na,) is the rounding error to expect in each. Returns whether it converged, with F, dF,
    to, back and G filled.
    """
    m = tab.nodes.size
    na = active.size
    size = na * m
    panel_responses(fl, tab, kind, h, active, to, back, G)
    free = np.empty(size)
    for a in range(na):
        for i in range(m):
            value = forced_output(fl, active[a], phase + fl.omega * h * tab.chi[kind, i])
            for k in range(w.size):
                value += to[a, i, k] * w[k]
            free[a * m + i] = value - fl.gap[active[a]]
    J = np.empty((size, size))
    step = np.empty((size, 1))
    flat, flat_F, flat_dF = delta.reshape(size), F.reshape(size), dF.reshape(size)
    for _ in range(40):
        panel_forces(fl, active, delta, F, dF)
        for p in range(size):
            total = free[p] - flat[p]
            for q in range(size):
                total -= G[p, q] * flat_F[q]
                J[p, q] = G[p, q] * flat_dF[q]
            J[p, p] += 1.0
            step[p, 0] = total
        lu_solve(J, step)
        converged = True
        for a in range(na):
            scale, change = 0.0, 0.0
            for i in range(m):
                scale = max(scale, abs(delta[a, i]))
                change = max(change, abs(step[a * m + i, 0]))
                delta[a, i] += step[a * m + i, 0]
            if not np.isfinite(change):
                return False
            converged = converged and change <= max(1e-11 * scale, noise[a])
        if converged:
            panel_forces(fl, active, delta, F, dF)
            return True
    return False


@njit(cache=True, error_model="numpy")
def panel_forces(fl, active, delta, F, dF):
    """Fill F and its derivative dF at all nodes from the penetrations."""
    for a in range(active.size):
        for i in range(delta.shape[1]):
            F[a, i], dF[a, i] = law(delta[a, i], fl.stiffness[active[a]], fl.exponent[active[a]])


@njit(cache=True, error_model="numpy")
def panel_end(fl, tab, kind, w, h, active, F, back, w_end):
    """State w_end at the end of a panel from the forces at its nodes."""
    w_end[:] = w
    for a in range(active.size):
        for j in range(tab.nodes.size):
            impulse = h * tab.weights[kind, j] * F[a, j]
            for k in range(w.size):
                w_end[k] -= impulse * back[a, j, k]
    fly(fl, w_end.reshape(w.size, 1), h)


@njit(cache=True, error_model="numpy")
def panel_columns(fl, tab, kind, phase, t0, h, active, dF, to, back, G, columns):
    """Advance sensitivities (2n, n_columns) in place over a panel.

    The last column is the derivative with respect to ω at fixed time; t0 is the time from the
    start of the segment at which its phase is fixed.
    """
    m = tab.nodes.size
    na = active.size
    size = na * m
    n_columns = columns.shape[1]
    J = np.empty((size, size))
    rhs = np.zeros((size, n_columns))
    flat_dF = dF.reshape(size)
    for p in range(size):
        for q in range(size):
            J[p, q] = G[p, q] * flat_dF[q]
        J[p, p] += 1.0
    for a in range(na):
        for i in range(m):
            p = a * m + i
            for k in range(columns.shape[0]):
                z = to[a, i, k]
                for c in range(n_columns):
                    rhs[p, c] += z * columns[k, c]
            t = h * tab.chi[kind, i]
            turn = np.exp(1j * (phase + fl.omega * t))
            slope = fl.d_forced[active[a]] + 1j * (t0 + t) * fl.forced[active[a]]
            rhs[p, n_columns - 1] += (slope * turn).real
    lu_solve(J, rhs)
    for a in range(na):
        for j in range(m):
            share = h * tab.weights[kind, j] * dF[a, j]
            for k in range(columns.shape[0]):
                z = share * back[a, j, k]
                for c in range(n_columns):
                    columns[k, c] -= z * rhs[a * m + j, c]
    fly(fl, columns, h)


@njit(cache=True, error_model="numpy")
def legendre_tail(tab, values):
    """Larger of the last two Legendre coefficients of the polynomial through node values."""
    m = values.size
    worst = 0.0
    for row in range(m - 2, m):
        total = 0.0
        for j in range(m):
            total += tab.to_legendre[row, j] * values[j]
        worst = max(worst, abs(total))
    return worst


@njit(cache=True, error_model="numpy")
def resolved(fl, tab, noise, delta, F, dF):
    """Whether the Legendre tails of each force and of its slope are small beside their largest."""
    for a in range(F.shape[0]):
        deepest = np.max(delta[a])
        if deepest <= 10.0 * noise[a]:
            continue
        tail = max(fl.tail, 20.0 * noise[a] / deepest)
        if legendre_tail(tab, F[a]) > tail * np.max(F[a]):
            return False
        if legendre_tail(tab, dF[a]) > 10.0 * tail * np.max(dF[a]):
            return False
    return True


@njit(cache=True, error_model="numpy")
def record_piece(rec, phase, h, kind, w):
    """Append a piece; return its index, or -1 when the record is full."""
    n = rec.used[0]
    if n >= rec.phase.size:
        return -1
    rec.phase[n] = phase
    rec.duration[n] = h
    rec.kind[n] = kind
    rec.w[n, :] = w
    rec.force[n, :, :] = 0.0
    rec.used[0] = n + 1
    return n


@njit(cache=True, error_model="numpy")
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
    if speed >= 0.0 and depth < static:  # pushed in from near rest
        left = duration
    elif speed < 0.0:
        left = min(0.5 * duration, -depth / speed)
    if accel < 0.0 and left > 0.0:
        turned = (speed + np.sqrt(speed * speed - 2.0 * accel * depth)) / -accel
        if speed > 0.0:  # a slow touch is turned back by the deceleration
            share = turned / (turned + left)
            left *= share
            duration *= share
            peak *= share
        else:
            left = min(left, turned)
    return peak, duration, left


@njit(cache=True, error_model="numpy")
def profile_guess(tab, kind, h, peak, duration, left, delta_row):
    """Half-sine penetrations at the nodes to start Newton's method from."""
    for i in range(delta_row.size):
        t = h * tab.chi[kind, i]
        x = np.pi * min((duration - left + t) / duration, 1.0)
        delta_row[i] = max(peak * np.sin(x), 1e-2 * peak)


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def map_fraction(kind, s):
    """Fraction of the panel that belongs to the stretched time s (see `gauss.time_map`)."""
    if kind == 0:
        return s
    if kind == 1:
        return s * (2.0 - s)
    if kind == 2:
        return s * s
    return 0.5 - 0.5 * np.cos(np.pi * s)


@njit(cache=True, error_model="numpy")
def interpolate(tab, values, s):
    """Polynomial through the values at 0, the nodes and 1, at s (barycentric formula)."""
    top, bottom = 0.0, 0.0
    for j in range(values.size):
        distance = s - tab.ends_nodes[j]
        if distance == 0.0:
            return values[j]
        weight = tab.barycentric[j] / distance
        top += weight * values[j]
        bottom += weight
    return top / bottom


@njit(cache=True, error_model="numpy")
def first_root(tab, values, noise):
    """First s at which the polynomial through `values` falls below -noise, or 2.

    It is looked at on a grid four times as fine as the nodes, and at the minima between.
    """
    grid = tab.fine_grid
    n = grid.size
    fine = np.empty(n)
    for i in range(n):
        total = 0.0
        for j in range(values.size):
            total += tab.to_fine[i, j] * values[j]
        fine[i] = total
    for i in range(1, n):
        below = -1.0
        if fine[i] < (-noise if i < n - 1 else 0.0):
            below = grid[i]
        elif i < n - 1 and fine[i - 1] >= fine[i] <= fine[i + 1]:
            left, right = grid[i - 1] - grid[i], grid[i + 1] - grid[i]
            up, on = (fine[i - 1] - fine[i]) / left, (fine[i + 1] - fine[i]) / right
            curvature = (on - up) / (right - left)
            slope = up - curvature * left
            if curvature > 0.0 and fine[i] - 0.25 * slope * slope / curvature < -0.5 * noise:
                bottom = grid[i] - 0.5 * slope / curvature
                if interpolate(tab, values, bottom) < -noise:
                    below = bottom
        if below < 0.0:
            continue
        last = i - 1
        while last > 0 and fine[last] <= 0.0:
            last -= 1
        if fine[last] <= 0.0:
            return 0.5 * below
        low, high = grid[last], below
        for _ in range(60):
            middle = 0.5 * (low + high)
            if interpolate(tab, values, middle) > 0.0:
                low = middle
            else:
                high = middle
            if high - low <= 1e-9 * high:
                break
        return high
    return 2.0


@njit(cache=True, error_model="numpy")
def first_event(fl, tab, kind, phase, w, h, closed, active, delta, F, back, w_end):
    """Stop that first opens or closes within a panel and the fraction of the panel, or (-1, 2)."""
    m = tab.nodes.size
    event, where = -1, 2.0
    position = -1
    values = np.empty(m + 2)
    for s in range(closed.size):
        noise = output_noise(fl, s, w)
        start, _, _, _ = output_derivatives(fl, s, w, phase, 0.0)
        end, _, _, _ = output_derivatives(fl, s, w_end, phase + fl.omega * h, 0.0)
        if closed[s]:
            position += 1
            values[0], values[m + 1] = start - fl.gap[s], end - fl.gap[s]
            values[1 : m + 1] = delta[position]
        else:
            values[0], values[m + 1] = fl.gap[s] - start, fl.gap[s] - end
            node_outputs(fl, tab, kind, phase, w, h, active, F, back, s, values[1 : m + 1])
            for i in range(m):
                values[i + 1] = fl.gap[s] - values[i + 1]
        root = first_root(tab, values, noise + 4.0 * legendre_tail(tab, values[1 : m + 1]))
        if root <= 1.0:
            fraction = map_fraction(kind, root)
            if fraction < where:
                event, where = s, fraction
    return event, where


@njit(cache=True, error_model="numpy")
def node_outputs(fl, tab, kind, phase, w, h, active, F, back, out, values):
    """Fill an output at the nodes of a panel, with the forces at work."""
    m = tab.nodes.size
    driven = np.empty(w.size)
    for i in range(m):
        t = h * tab.chi[kind, i]
        driven[:] = w
        for a in range(active.size):
            for j in range(m):
                impulse = h * tab.integrate[kind, i, j] * F[a, j]
                for k in range(w.size):
                    driven[k] -= impulse * back[a, j, k]
        values[i] = free_output(fl, out, driven, t) + forced_output(fl, out, phase + fl.omega * t)


@njit(cache=True, error_model="numpy")
def free_output(fl, out, w, t):
    """Output of the homogeneous state w after a flight of duration t."""
    value = 0.0
    for b in range(fl.blocks.shape[0]):
        j = 2 * b
        e00, e01, e10, e11 = block_exponential(fl.blocks[b], t)
        value += fl.rows[out, j] * (e00 * w[j] + e01 * w[j + 1])
        value += fl.rows[out, j + 1] * (e10 * w[j] + e11 * w[j + 1])
    return value


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def keep_profile(tab, kind, new_kind, ratio, delta, guess):
    """Carry all node values over to a panel `ratio` times as long."""
    for a in range(delta.shape[0]):
        stretch_profile(tab, kind, new_kind, ratio, delta[a], guess)
        delta[a, :] = np.maximum(guess, 1e-3 * np.max(guess))


@njit(cache=True, error_model="numpy")
def contact_panel(fl, tab, phase, w, h_max, start_switch, closed, active, delta, work, w_end):
    """Solve one panel and choose its length, at most h_max.

    Returns (status, kind, h, event): a panel that ends where stop `event` opens or closes, or
    (event = -1) one short enough to be resolved. `work` holds (F, dF, to, back, G).
    """
    F, dF, to, back, G = work
    guess = np.empty(tab.nodes.size)
    noise = np.empty(active.size)
    for a in range(active.size):
        noise[a] = output_noise(fl, active[a], w)
    smooth, switch = 2 * start_switch, 2 * start_switch + 1
    aim = -1
    limit = h_max
    kind, h = guess_panel(fl, tab, phase, w, limit, start_switch, active, delta)
    tried = h
    for _ in range(100):
        if h <= 0.0 or phase + fl.omega * h == phase:
            return OK, kind, 0.0, active[0] if aim < 0 else aim
        if not solve_panel(fl, tab, kind, phase, w, h, active, noise, delta, F, dF, to, back, G):
            limit = 0.4 * min(h, tried)
            aim = -1
            kind, h = guess_panel(fl, tab, phase, w, limit, start_switch, active, delta)
            tried = h
            continue
        panel_end(fl, tab, kind, w, h, active, F, back, w_end)
        end_phase = phase + fl.omega * h
        fine = resolved(fl, tab, noise, delta, F, dF)
        event, where = first_event(
            fl, tab, kind, phase, w, h, closed, active, delta, F, back, w_end
        )
        at_end = where > (0.999 if event == aim else 1.0 - 1e-7)
        if event >= 0 and (aim < 0 or not at_end):
            aim = event
            keep_profile(tab, kind, switch, where, delta, guess)
            kind = switch
            h *= where
            continue
        if aim >= 0:
            value, speed, _, _ = output_derivatives(fl, aim, w_end, end_phase, 0.0)
            approaching = speed < 0.0 if closed[aim] else speed > 0.0
            value -= fl.gap[aim]
            dh = -value / speed if approaching else np.inf
            # the force vanishes there with its slope: an error ε of the instant costs ε^2.5
            tight = 1e-9 if fl.exponent[aim] >= 1.5 else 1e-13  # a jump of the slope costs more
            if abs(dh) <= tight * h or (approaching and abs(value) <= output_noise(fl, aim, w)):
                if fine:
                    return OK, kind, h, aim
            elif -0.5 * h < dh < h and (dh < 0.0 or h < h_max):
                h = min(h + dh, h_max)
                continue
            elif dh > 0.0 and fine:  # the contact goes on
                return OK, kind, h, -1
            aim = -1
            keep_profile(tab, kind, smooth, 0.5, delta, guess)
            kind = smooth
            h *= 0.5
            continue
        if kind % 2 == 1 and h < h_max:  # the release was expected here: follow it
            for a in range(active.size):
                value, speed, _, _ = output_derivatives(fl, active[a], w_end, end_phase, 0.0)
                dh = (fl.gap[active[a]] - value) / speed if speed < 0.0 else np.inf
                if dh < h:
                    aim = active[a]
                    h = min(h + dh, h_max)
                    break
            if aim >= 0:
                continue
        if not fine:
            keep_profile(tab, kind, smooth, 0.5, delta, guess)
            kind = smooth
            h *= 0.5
            continue
        return OK, kind, h, -1
    return CONTACT_FAILED, kind, h, -1


@njit(cache=True, error_model="numpy")
def propagate(fl, tab, start, phase, duration, with_columns, rec, recording):
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
    size = start.size
    n_stops = fl.gap.size
    turn = np.exp(1j * phase)
    w = start - (fl.steady * turn).real
    columns = np.zeros((size, size + 1))
    for c in range(size):
        columns[c, c] = 1.0
    columns[:, size] = -(fl.d_steady * turn).real
    closings = np.zeros(n_stops, dtype=np.int64)
    closed = np.zeros(n_stops, dtype=np.bool_)
    for s in range(n_stops):
        value, _, _, _ = output_derivatives(fl, s, w, phase, 0.0)
        closed[s] = value - fl.gap[s] > 0.0
    status = run_pieces(
        fl, tab, w, columns, phase, duration, closed, closings, with_columns, rec, recording
    )
    end_phase = phase + fl.omega * duration
    turn = np.exp(1j * end_phase)
    rate = np.zeros(size)
    for b in range(fl.blocks.shape[0]):
        for i in range(2):
            for j in range(2):
                rate[2 * b + i] += fl.blocks[b, i, j] * w[2 * b + j]
    for s in range(n_stops):
        value, _, _, _ = output_derivatives(fl, s, w, end_phase, 0.0)
        force, _ = law(value - fl.gap[s], fl.stiffness[s], fl.exponent[s])
        rate -= fl.force[:, s] * force
    end = w + (fl.steady * turn).real
    d_omega = columns[:, size] + (fl.d_steady * turn).real - rate * (duration / fl.omega)
    return end, columns[:, :size].copy(), d_omega, closings, status


@njit(cache=True, error_model="numpy")
def switch_with(fl, w, phase, h, closed, closings):
    """Open and close the stops that do so at the very instant of another one's event.

    The instant is known to 1e-9 of the length h of the panel before it.
    """
    for s in range(closed.size):
        value, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
        reach = 1e-8 * h * abs(speed) + 10.0 * output_noise(fl, s, w)
        if abs(value - fl.gap[s]) <= reach and closed[s] != (speed > 0.0):
            closed[s] = speed > 0.0
            if closed[s]:
                closings[s] += 1


@njit(cache=True, error_model="numpy")
def run_pieces(
    fl, tab, w, columns, phase, duration, closed, closings, with_columns, rec, recording
):
    """Advance w and its sensitivities in place over a segment, piece by piece."""
    m = tab.nodes.size
    n_stops = closed.size
    fastest = fastest_rate(fl)
    h_cap = 0.6 * m / fastest if fastest > 0.0 else np.inf
    shortest = 1e-10 / max(fastest, fl.omega)
    t = 0.0
    start_switch = 0
    skip = 0.0
    w_end = np.empty(w.size)
    for _ in range(5000):
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
            fly(fl, w.reshape(w.size, 1), first)
            if with_columns:
                fly(fl, columns, first)
            t = duration if stop < 0 else t + first
            skip = 0.0
            if stop >= 0:
                closed[stop] = True
                closings[stop] += 1
                switch_with(fl, w, phase + fl.omega * t, 0.0, closed, closings)
                start_switch = 1
            continue
        active = np.flatnonzero(closed)
        if n_active == 1 and start_switch == 1:
            peak, _, left = expected_contact(fl, active[0], w, here)
            if peak <= 100.0 * output_noise(fl, active[0], w):  # a touch without force
                closed[active[0]] = False
                closings[active[0]] -= 1
                start_switch, skip = 0, max(left, shortest)
                continue
        delta = np.empty((n_active, m))
        work = (
            np.empty((n_active, m)),
            np.empty((n_active, m)),
            np.empty((n_active, m, w.size)),
            np.empty((n_active, m, w.size)),
            np.empty((n_active * m, n_active * m)),
        )
        h_max = min(remain, h_cap)
        status, kind, h, event = contact_panel(
            fl, tab, here, w, h_max, start_switch, closed, active, delta, work, w_end
        )
        if status != OK:
            return status
        F, dF, to, back, G = work
        if h > 0.0:
            if recording:
                n = record_piece(rec, here, h, kind, w)
                if n < 0:
                    return TOO_MANY_PIECES
                for a in range(n_active):
                    rec.force[n, active[a], :] = F[a]
            if with_columns:
                panel_columns(fl, tab, kind, here, t, h, active, dF, to, back, G, columns)
            w[:] = w_end
            t = duration if h >= remain else t + h
        start_switch = 0
        if event >= 0:
            closed[event] = not closed[event]
            start_switch = 1
            if closed[event]:
                closings[event] += 1
            switch_with(fl, w, phase + fl.omega * t, h, closed, closings)
            skip = shortest if h < shortest else 0.0
    return TOO_MANY_PIECES


@njit(cache=True, error_model="numpy")
def steady_response(blocks, drive, omega):
    """Amplitude of the steady response to drive[0] + ω² drive[1] and its derivative, (2n,)."""
    size = drive.shape[1]
    steady = np.empty(size, dtype=np.complex128)
    d_steady = np.empty(size, dtype=np.complex128)
    for b in range(blocks.shape[0]):
        i, j = 2 * b, 2 * b + 1
        m00, m01 = 1j * omega - blocks[b, 0, 0], -blocks[b, 0, 1]
        m10, m11 = -blocks[b, 1, 0], 1j * omega - blocks[b, 1, 1]
        det = m00 * m11 - m01 * m10
        x = drive[0, i] + omega * omega * drive[1, i]
        y = drive[0, j] + omega * omega * drive[1, j]
        steady[i] = (m11 * x - m01 * y) / det
        steady[j] = (m00 * y - m10 * x) / det
        x = 2.0 * omega * drive[1, i] - 1j * steady[i]
        y = 2.0 * omega * drive[1, j] - 1j * steady[j]
        d_steady[i] = (m11 * x - m01 * y) / det
        d_steady[j] = (m00 * y - m10 * x) / det
    return steady, d_steady


@njit(cache=True, error_model="numpy")
def output_amplitudes(rows, amplitude):
    """Rows (n_out, 2n) times a complex amplitude (2n,)."""
    outputs = np.zeros(rows.shape[0], dtype=np.complex128)
    for out in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            outputs[out] += rows[out, j] * amplitude[j]
    return outputs


@njit(cache=True, nogil=True, error_model="numpy")
def shoot(
    blocks,
    rows,
    rows1,
    rows2,
    bound3,
    force,
    drive,
    gap,
    stiffness,
    exponent,
    mobility,
    duration_factor,
    tail,
    chi,
    integrate,
    weights,
    to_legendre,
    gauss_nodes,
    ends_nodes,
    barycentric,
    fine_grid,
    to_fine,
    rec_phase,
    rec_duration,
    rec_kind,
    rec_w,
    rec_force,
    rec_count,
    omega,
    nodes,
    phases,
    chained,
    with_columns,
    recording,
):
    """Propagate each node (k, 2n) to the next phase; see `propagate` for what comes back.

    When `chained`, only the first node is used and each segment starts where the last one ended.
    """
    steady, d_steady = steady_response(blocks, drive, omega)
    fl = FlowData(
        blocks,
        rows,
        rows1,
        rows2,
        bound3,
        force,
        steady,
        d_steady,
        output_amplitudes(rows, steady),
        output_amplitudes(rows, d_steady),
        gap,
        stiffness,
        exponent,
        mobility,
        duration_factor,
        omega,
        tail,
    )
    tab = GaussTables(
        chi,
        integrate,
        weights,
        to_legendre,
        gauss_nodes,
        ends_nodes,
        barycentric,
        fine_grid,
        to_fine,
    )
    rec = Record(rec_phase, rec_duration, rec_kind, rec_w, rec_force, rec_count)
    k = phases.size - 1
    size = drive.shape[1]
    ends = np.zeros((k, size))
    kept = k if with_columns else 1
    jacobians = np.zeros((kept, size, size))
    d_omegas = np.zeros((kept, size))
    closings = np.zeros(gap.size, dtype=np.int64)
    for i in range(k):
        start = ends[i - 1] if chained and i > 0 else nodes[i]
        duration = (phases[i + 1] - phases[i]) / omega
        end, jacobian, d_omega, closed, status = propagate(
            fl, tab, start, phases[i], duration, with_columns, rec, recording
        )
        ends[i] = end
        if with_columns:
            jacobians[i] = jacobian
            d_omegas[i] = d_omega
        closings += closed
        if status != OK:
            return ends, jacobians, d_omegas, closings, status
    return ends, jacobians, d_omegas, closings, OK
