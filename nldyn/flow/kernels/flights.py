"""Motion between contacts in closed form, and the search for the first contact."""

from __future__ import annotations

import math

import numpy as np

from nldyn.flow.kernels.compiling import allocating, always_inline, inner, never_inline
from nldyn.flow.kernels.layout import GAP, MOST_STEPS, RELEASE, SUM_ROUNDING, FlowData
from nldyn.system.linear import DRIFT, DRIFT_ON, GROWTH, NEAR, STEADY, Terms

LINEAR = 1e-18  # |x|² below which (exp(x) - 1)/x is 1 + x/2 to all digits
UNMOVED = 1e-14  # of the largest: what a stop pushes a mode by that is rounding


@inner
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


@inner
def there_and_back(block, t):
    """The four entries of exp(block t), those of exp(-block t), the diagonal of exp(block t) - 1.

    The last has its own precision, also where it is small.
    """
    mean = 0.5 * (block[0, 0] + block[1, 1])
    half = 0.5 * (block[0, 0] - block[1, 1])
    square = half * half + block[0, 1] * block[1, 0]
    rate = math.sqrt(abs(square))
    less = math.expm1(mean * t)
    size = 1.0 + less if less > -0.5 else math.exp(mean * t)
    if square >= 0.0:
        e00, e01, e10, e11 = block_exponential(block, t)
        i00, i01, i10, i11 = block_exponential(block, -t)
        s, c = math.sinh(0.5 * rate * t), math.cosh(0.5 * rate * t)
        swing, a = 2.0 * s * s, half * (2.0 * s * c / rate if rate > 0.0 else t)
        d00, d11 = less + size * (swing + a), less + size * (swing - a)
        return e00, e01, e10, e11, i00, i01, i10, i11, d00, d11
    s, c = math.sin(0.5 * rate * t), math.cos(0.5 * rate * t)
    return swung_there_and_back(block, rate, less, size, s, c)


@inner
def swung_there_and_back(block, rate, less, size, s, c):
    """The same of a block that swings: by its decay, and that less 1, and by half its phase."""
    half = 0.5 * (block[0, 0] - block[1, 1])
    swing, odd = -2.0 * s * s, 2.0 * s * c / rate  # cos - 1, sin / rate
    even = 1.0 + swing
    a, b, c, d = odd * half, odd * block[0, 1], odd * block[1, 0], 1.0 / size
    return (
        size * (even + a), size * b, size * c, size * (even - a),
        d * (even - a), -d * b, -d * c, d * (even + a),
        less + size * (swing + a), less + size * (swing - a),
    )  # fmt: skip


@inner
def swings(block, times, decay, less, sine, cosine):
    """Fill what `swung_there_and_back` needs at some times (m,); its rate, or 0 for two decays."""
    mean = 0.5 * (block[0, 0] + block[1, 1])
    half = 0.5 * (block[0, 0] - block[1, 1])
    square = half * half + block[0, 1] * block[1, 0]
    if square >= 0.0:
        return 0.0
    rate, m = math.sqrt(-square), times.size
    for i in range(m):
        less[i] = mean * times[i]  # for the time being
        decay[i] = 0.5 * rate * times[i]
    sines(decay, sine, cosine)
    if abs(less[m - 1]) < SLOW_DECAY:
        series_expm1(less, less)
        for i in range(m):
            decay[i] = 1.0 + less[i]
    else:
        for i in range(m):
            decay[i], less[i] = math.exp(less[i]), math.expm1(less[i])
    return rate


# π/2 in three parts, of which multiples by whole numbers up to 2^20 are exact [Cody and Waite 1980]
HALF_TURN = (1.57079632673412561417e00, 6.07710050630396597660e-11, 2.02226624871116645580e-21)
WHOLE = 6755399441055744.0  # 1.5 2^52: a sum with it has no fraction
# coefficients of sin and cos up to π/4, the errors of which are below rounding [Ng, fdlibm 5.3]
SINE = (
    -1.66666666666666324348e-01, 8.33333333332248946124e-03, -1.98412698298579493134e-04,
    2.75573137070700676789e-06, -2.50507602534068634195e-08, 1.58969099521155010221e-10,
)  # fmt: skip
COSINE = (
    4.16666666666666019037e-02, -1.38888888888741095749e-03, 2.48015872894767294178e-05,
    -2.75573143513906633035e-07, 2.08757232129817482790e-09, -1.13596475577881948265e-11,
)  # fmt: skip
SLOW_DECAY = 0.35  # exponent up to which `series_expm1` is exact


@inner
def sines(x, sine, cosine):
    """Fill sines and cosines of x (m,), of up to 1e6; without calls, so that several go at once."""
    for i in range(x.size):
        k = (x[i] * (2.0 / math.pi) + WHOLE) - WHOLE
        r = ((x[i] - k * HALF_TURN[0]) - k * HALF_TURN[1]) - k * HALF_TURN[2]
        z = r * r
        s, c = SINE[5], COSINE[5]
        s, c = SINE[4] + z * s, COSINE[4] + z * c
        s, c = SINE[3] + z * s, COSINE[3] + z * c
        s, c = SINE[2] + z * s, COSINE[2] + z * c
        s, c = SINE[1] + z * s, COSINE[1] + z * c
        s, c = SINE[0] + z * s, COSINE[0] + z * c
        s, c = r + r * z * s, 1.0 - (0.5 * z - z * z * c)
        half = 0.5 * k
        odd = half != (half + WHOLE) - WHOLE
        turns = 0.5 * (half - 0.5) if odd else 0.5 * half
        back = turns != (turns + WHOLE) - WHOLE
        a, b = (c, -s) if odd else (s, c)
        sine[i] = -a if back else a
        cosine[i] = -b if back else b


@inner
def series_expm1(x, out):
    """Fill exp(x) - 1 by its power series, for |x| < `SLOW_DECAY`; without calls."""
    for i in range(x.size):
        total = 0.0
        total = x[i] * (1.0 / 15.0) * (1.0 + total)
        total = x[i] * (1.0 / 14.0) * (1.0 + total)
        total = x[i] * (1.0 / 13.0) * (1.0 + total)
        total = x[i] * (1.0 / 12.0) * (1.0 + total)
        total = x[i] * (1.0 / 11.0) * (1.0 + total)
        total = x[i] * (1.0 / 10.0) * (1.0 + total)
        total = x[i] * (1.0 / 9.0) * (1.0 + total)
        total = x[i] * (1.0 / 8.0) * (1.0 + total)
        total = x[i] * (1.0 / 7.0) * (1.0 + total)
        total = x[i] * (1.0 / 6.0) * (1.0 + total)
        total = x[i] * (1.0 / 5.0) * (1.0 + total)
        total = x[i] * (1.0 / 4.0) * (1.0 + total)
        total = x[i] * (1.0 / 3.0) * (1.0 + total)
        total = x[i] * (1.0 / 2.0) * (1.0 + total)
        out[i] = x[i] * (1.0 + total)


@inner
def turned(phase):
    """e^{i phase}."""
    return complex(math.cos(phase), math.sin(phase))


@inner
def from_rest(rate, t):
    """∫ exp(rate u) du from 0 to t for a complex rate, to full precision also where it is small."""
    x, y = rate.real * t, rate.imag * t
    square = x * x + y * y
    if square < LINEAR:
        return complex(t + 0.5 * t * x, 0.5 * t * y)
    half, size = math.sin(0.5 * y), math.expm1(x)
    real = size * math.cos(y) - 2.0 * half * half
    imag = (size + 1.0) * math.sin(y)
    share = t / square
    return complex((real * x + imag * y) * share, (imag * x - real * y) * share)


@inner
def growth(rate, omega, phase):
    """Solution of e' = rate e + e^{iωt} at rest at phase zero, and e^{iωt}, for a rate near iω.

    e = (e^{rate t} - e^{iωt})/(rate - iω) without its cancellation; at resonance e = t e^{iωt}.
    """
    never_inline()
    turn = turned(phase)
    return turn * from_rest(rate - 1j * omega, phase / omega), turn


@inner
def growth_by_omega(rate, omega, phase):
    """Derivative of `growth` with respect to ω at a fixed phase.

    With off = rate - iω it is e^{iφ} ∫ exp(off u) du from 0 to t = φ/ω, and its derivative
    -e^{iφ} (i ∫ u exp(off u) du + exp(off t) t/ω).
    """
    never_inline()
    e, turn = growth(rate, omega, phase)
    t = phase / omega
    off = rate - 1j * omega
    x = off * t
    end = turned(x.imag) * math.exp(x.real)
    if abs(x) > 1.0:
        by_rate = (t * end * turn - e) / off
    else:
        series, power = 0.0 * x, turn * (t * t)
        for j in range(18):
            series += power / (j + 2)
            power *= x / (j + 1)
        by_rate = series
    return -1j * by_rate - end * turn * (t / omega)


@inner
def drift(trace, determinant, t):
    """Scalars f and f_on with exp(At) = f + f_on A, and e and e_on of their integrals from 0 to t.

    A is any 2×2 matrix of that trace and determinant: by the series of its divided differences at
    a t so small that it converges, and then by doubling, ∫₀²ᵗ = (1 + exp(At)) ∫₀ᵗ.
    """
    size, halvings = (abs(trace) + math.sqrt(abs(determinant))) * abs(t), 0
    while size > 0.5:
        size *= 0.5
        halvings += 1
    s = t * 0.5**halvings
    h_old, h, power, f_on, e_on = 0.0, 1.0, s, 0.0, 0.0
    for j in range(16):
        f_on += h * power
        power *= s / (j + 2)
        e_on += h * power
        h, h_old = trace * h - determinant * h_old, h
    f, e = 1.0 - determinant * e_on, f_on - trace * e_on
    for _ in range(halvings):
        e, e_on = (
            e + f * e - determinant * f_on * e_on,
            e_on + f * e_on + f_on * e + trace * f_on * e_on,
        )
        f, f_on = f * f - determinant * f_on * f_on, 2.0 * f * f_on + trace * f_on * f_on
    return f, f_on, e, e_on


@inner
def term(terms, k, omega, phase):
    """Value and first two time derivatives of a term at a phase."""
    return term_since(terms, k, omega, phase, phase / omega)


@inner
def term_since(terms, k, omega, phase, t):
    """The same of one that was at rest a time t ago, if it is no steady one.

    The phase is that at its end.
    """
    never_inline()
    kind, pace, rate = terms.kinds[k], terms.orders[k] * omega, terms.rates[k]
    turn = turned(terms.orders[k] * phase)
    if kind == STEADY:
        return turn, 1j * pace * turn, -pace * pace * turn
    if kind == GROWTH:
        e = turn * from_rest(rate - 1j * pace, t)
        first = rate * e + turn
        return e, first, rate * first + 1j * pace * turn
    f, f_on, e, e_on = drift(rate.real, rate.imag, t)
    if kind == DRIFT:
        return complex(e, 0.0), complex(f, 0.0), complex(-rate.imag * f_on, 0.0)
    return complex(e_on, 0.0), complex(f_on, 0.0), complex(f + rate.real * f_on, 0.0)


@inner
def term_by_omega(terms, k, omega, phase, t):
    """Derivatives with respect to ω of a term, its rate and acceleration, t after a fixed phase.

    `phase` is that at the time.
    """
    never_inline()
    kind, order, rate = terms.kinds[k], terms.orders[k], terms.rates[k]
    e, first, second = term(terms, k, omega, phase)
    if kind == STEADY:
        by = 1j * order * t * e
        pace = 1j * order * omega
        return by, 1j * order * e + pace * by, pace * (2j * order * e + pace * by)
    if kind == GROWTH:
        turn = turned(order * phase)
        by = order * growth_by_omega(rate, order * omega, order * phase) + first * (t / omega)
        by_rate = rate * by + 1j * order * t * turn
        return by, by_rate, rate * by_rate + 1j * order * (1.0 + 1j * order * omega * t) * turn
    since = (t - phase / omega) / omega
    third = rate.real * second - rate.imag * first
    return first * since, second * since, third * since


@inner
def term_change(terms, k, omega, phase, t):
    """Change of a term in a time t from a phase on, to its own precision."""
    never_inline()
    kind, order, rate = terms.kinds[k], terms.orders[k], terms.rates[k]
    if kind == STEADY:
        return swung(turned(order * phase), order * omega * t)
    if kind == GROWTH:
        pace = order * omega
        e, turn = growth(rate, pace, order * phase)
        fresh = turn * turned(pace * t) * from_rest(rate - 1j * pace, t)
        return e * rate * from_rest(rate, t) + fresh
    # (exp(At) - 1) ∫ + ∫ over t, with exp(At) - 1 = f_on A - determinant e_on
    _, _, e, e_on = drift(rate.real, rate.imag, phase / omega)
    _, f_on, fresh, fresh_on = drift(rate.real, rate.imag, t)
    if kind == DRIFT:
        return complex(fresh - rate.imag * (fresh_on * e + f_on * e_on), 0.0)
    return complex(fresh_on - rate.imag * fresh_on * e_on + f_on * (e + rate.real * e_on), 0.0)


@inner
def term_sizes(terms, k, omega):
    """Sizes that a term and its rate may have within a period from rest."""
    kind, period = terms.kinds[k], 2.0 * math.pi / omega
    if kind == STEADY:
        return 1.0, terms.orders[k] * omega
    if kind == GROWTH:
        return period, period * terms.orders[k] * omega
    return (period, 1.0) if kind == DRIFT else (0.5 * period * period, period)


@inner
def third_bound(terms, k, omega, phase):
    """Bound on the third time derivative of a term within a period from a phase on.

    No eigenvalue grows: a growth gains by at most the time that passes, and |f_on| <= t.
    """
    kind, pace, rate = terms.kinds[k], terms.orders[k] * omega, terms.rates[k]
    if kind == STEADY:
        return pace**3
    if kind == GROWTH:
        e, _ = growth(rate, pace, terms.orders[k] * phase)
        size, later = abs(rate), abs(e) + 2.0 * math.pi / omega
        return size * size * (size * later + 1.0) + pace * (size + pace)
    t = (abs(phase) + 2.0 * math.pi) / omega
    trace, determinant = abs(rate.real), abs(rate.imag)
    second = 1.0 + 0.5 * determinant * t * t + trace * t  # of |f_on'|
    if kind == DRIFT:
        return determinant * second
    return determinant * t + trace * second


@inner
def swelling(fl, out, phase):
    """Value, two time derivatives, and bound of the third over a period, of an output's terms."""
    never_inline()
    value, first, second, bound = 0.0, 0.0, 0.0, 0.0
    for k in range(fl.terms.kinds.size):
        share = fl.forced[1 + k, 0, out]
        e, e1, e2 = term(fl.terms, k, fl.omega, phase)
        value += (share * e).real
        first += (share * e1).real
        second += (share * e2).real
        bound += abs(share) * third_bound(fl.terms, k, fl.omega, phase)
    return value, first, second, bound


@inner
def swollen(fl, out, phase, t):
    """Change of an output's terms in a time t from a phase on, to its own precision."""
    never_inline()
    change = 0.0
    for k in range(fl.terms.kinds.size):
        share = fl.forced[1 + k, 0, out]
        change += (share * term_change(fl.terms, k, fl.omega, phase, t)).real
    return change


@inner
def add_swelling_by(fl, out, order, phase, t, factor, sums):
    """Add the derivatives of an output's terms at time t after a fixed phase.

    Order 1 stands for those of their rates, 2 of their accelerations; `phase` is that at the time.
    sums (n_columns,) ends with the columns of the parameters and of
    ω, as in `panel_columns`.
    """
    never_inline()
    last = sums.size - 1
    first = sums.size + 1 - fl.forced.shape[1]
    for k in range(fl.terms.kinds.size):
        e, e1, e2 = term(fl.terms, k, fl.omega, phase)
        d, d1, d2 = term_by_omega(fl.terms, k, fl.omega, phase, t)
        if order > 0:
            e, d = (e1, d1) if order == 1 else (e2, d2)
        sums[last] += factor * (fl.forced[1 + k, 1, out] * e + fl.forced[1 + k, 0, out] * d).real
        for c in range(first, last):
            sums[c] += factor * (fl.forced[1 + k, 2 + c - first, out] * e).real


@inner
def add_forced_by(fl, out, order, phase, t, factor, sums):
    """Add the derivatives of an output's response to the excitation, as `add_swelling_by`."""
    last = sums.size - 1
    first = sums.size + 1 - fl.forced.shape[1]
    turn = turned(phase)
    steady = fl.forced[0, 0, out] * turn
    pace, slope = 1.0 + 0j, 0j  # (iω)^order and its derivative
    if order == 1:
        pace, slope = 1j * fl.omega, 1j
    elif order == 2:
        pace, slope = complex(-fl.omega * fl.omega, 0.0), complex(-2.0 * fl.omega, 0.0)
    by = fl.forced[0, 1, out] * turn + 1j * t * steady
    sums[last] += factor * (pace * by + slope * steady).real
    for c in range(first, last):
        sums[c] += factor * (pace * fl.forced[0, 2 + c - first, out] * turn).real
    if fl.terms.kinds.size > 0:
        add_swelling_by(fl, out, order, phase, t, factor, sums)


@allocating
def output_columns(fl, out, order, phase, t, columns):
    """Sensitivities (n_columns,) of an output, its rate or acceleration in flight (order 0 to 2).

    At a time t after a fixed phase; `phase` is that at the time. Columns as in `panel_columns`.
    """
    never_inline()
    found = np.zeros(columns.shape[1])
    for c in range(found.size):
        for k in range(columns.shape[0]):
            found[c] += fl.rows[order, out, k] * columns[k, c]
    add_forced_by(fl, out, order, phase, t, 1.0, found)
    return found


@inner
def add_growth(fl, phase, sign, w, columns):
    """Add sign times the terms to the state w (2n,) and their derivatives to its last columns."""
    never_inline()
    last = columns.shape[1] - 1
    first = columns.shape[1] + 1 - fl.response.shape[1]
    for k in range(fl.terms.kinds.size):
        e, _, _ = term(fl.terms, k, fl.omega, phase)
        d, _, _ = term_by_omega(fl.terms, k, fl.omega, phase, 0.0)
        e, d = sign * e, sign * d
        for i in range(w.size):
            w[i] += (fl.response[1 + k, 0, i] * e).real
            columns[i, last] += (fl.response[1 + k, 1, i] * e + fl.response[1 + k, 0, i] * d).real
            for c in range(first, last):
                columns[i, c] += (fl.response[1 + k, 2 + c - first, i] * e).real


@inner
def output_derivatives(fl, out, w, phase, t):
    """Value and first two time derivatives of output `out`, and a bound on the third, after t.

    The bound holds for one excitation period at least.
    """
    always_inline()
    turn = fl.forced[0, 0, out] * turned(phase + fl.omega * t)
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
        value += fl.rows[0, out, j] * x + fl.rows[0, out, j + 1] * y
        first += fl.rows[1, out, j] * x + fl.rows[1, out, j + 1] * y
        second += fl.rows[2, out, j] * x + fl.rows[2, out, j + 1] * y
        if fl.blocks[b, 0, 1] == 0.0 and fl.blocks[b, 1, 0] == 0.0:  # two decays
            bound += fl.bound3[out, j] * abs(x) + fl.bound3[out, j + 1] * abs(y)
        else:
            size = math.hypot(fl.bound3[out, j], fl.bound3[out, j + 1])
            bound += size * math.hypot(x, y)
    if fl.terms.kinds.size > 0:
        s, s1, s2, s3 = swelling(fl, out, phase + fl.omega * t)
        value += s
        first += s1
        second += s2
        bound += s3
    return value, first, second, bound


@inner
def distance(fl, stop, w, phase):
    """Penetration of a stop, negative when it is open."""
    always_inline()
    value, _, _, _ = output_derivatives(fl, stop, w, phase, 0.0)
    return value - fl.stops[stop, GAP]


@inner
def output_size(fl, out, w, order):
    """Sum of the sizes of an output's terms (order 0), or those of its rate or acceleration."""
    total = abs(fl.forced[0, 0, out]) * fl.omega**order
    for k in range(fl.terms.kinds.size):
        size, rate = term_sizes(fl.terms, k, fl.omega)
        share = size if order == 0 else rate * fl.omega ** (order - 1)
        total += abs(fl.forced[1 + k, 0, out]) * share
    for j in range(w.size):
        total += abs(fl.rows[order, out, j] * w[j])
    return total


@inner
def output_noise(fl, out, w):
    """Rounding error to expect in an output: 4 units in the last place of its terms."""
    return SUM_ROUNDING * output_size(fl, out, w, 0)


@inner
def rate_noise(fl, out, w):
    """The same in the output's rate."""
    return SUM_ROUNDING * output_size(fl, out, w, 1)


@inner
def carried_noise(fl, stop, w, phase, depth, h):
    """The same in a penetration that is carried on from a depth over a time h."""
    change = abs(fl.forced[0, 0, stop]) * fl.omega * h
    for k in range(fl.terms.kinds.size):
        _, rate = term_sizes(fl.terms, k, fl.omega)
        change += h * abs(fl.forced[1 + k, 0, stop]) * rate
    for j in range(w.size):
        change += h * (abs(fl.rows[1, stop, j]) + h * abs(fl.rows[2, stop, j])) * abs(w[j])
    return SUM_ROUNDING * (abs(depth) + change)


@allocating
def fastest_moved(blocks, force):
    """Largest |eigenvalue|, in 1/s, of the blocks that stops move by more than rounding."""
    fastest, least = 0.0, 0.0
    if force.size > 0:
        least = UNMOVED * np.abs(force).max()
    for b in range(blocks.shape[0]):
        if not np.abs(force[2 * b : 2 * b + 2]).sum() > least:
            continue
        block = blocks[b]
        mean = 0.5 * (block[0, 0] + block[1, 1])
        square = 0.25 * (block[0, 0] - block[1, 1]) ** 2 + block[0, 1] * block[1, 0]
        rate = math.sqrt(abs(square))
        fastest = max(fastest, math.hypot(mean, rate) if square < 0.0 else abs(mean) + rate)
    return fastest


@inner
def safe_step(h, h1, h2, bound):
    """First positive root of h + h1 τ + h2 τ²/2 + bound τ³/6, for h <= 0.

    No function with these derivatives and a third derivative below `bound` reaches zero sooner.
    """
    if h >= 0.0 and (h1 > 0.0 or (h1 == 0.0 and h2 > 0.0)):
        return 0.0
    if bound <= 0.0:  # a parabola
        if h >= 0.0:
            return -2.0 * h1 / h2 if h2 > 0.0 else np.inf
        square = h1 * h1 - 2.0 * h * h2
        if h1 < 0.0 and h2 > 0.0:  # it comes back: the root without cancellation
            return (math.sqrt(square) - h1) / h2
        top = h1 + math.sqrt(square) if square >= 0.0 else 0.0
        return -2.0 * h / top if top > 0.0 else np.inf
    if h >= 0.0:
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
        if abs(step) <= SUM_ROUNDING * tau:
            break
    return max(tau, 0.0)


@inner
def closing_time(fl, stop, w, phase, start, end, shortest):
    """First time in [start, end] at which a stop closes, or inf; no contact is passed over.

    One that never pulls closes within, too, where its force turns positive. Negative if the search
    takes too many steps.
    """
    release = int(fl.stops[stop, RELEASE])
    if release >= 0:
        value, _, _, _ = output_derivatives(fl, stop, w, phase, start)
        if value > fl.stops[stop, GAP]:
            at = rising_time(fl, stop, release, w, phase, start, end, shortest)
            if not 0.0 <= at <= end:
                return at
            value, _, _, _ = output_derivatives(fl, stop, w, phase, at)
            if value > fl.stops[stop, GAP]:
                return at
            start = at
    return rising_time(fl, stop, stop, w, phase, start, end, shortest)


@inner
def rising_time(fl, stop, out, w, phase, start, end, shortest):
    """First time in [start, end] at which an output rises to the gap of a stop, or inf.

    Every step is bounded by the third derivative, so that it cannot cross a contact; the steps
    converge to the contact at order three. Only contacts that are shorter than `shortest` or no
    deeper than rounding can be stepped over, and only where the approach is so slow that the
    acceleration stops it in that time. Negative if it takes too many steps.
    """
    longest = 2.0 * math.pi / fl.omega
    noise = output_noise(fl, out, w)
    t = start
    for _ in range(MOST_STEPS):
        if t > end:
            return np.inf
        value, h1, h2, bound = output_derivatives(fl, out, w, phase, t)
        h = value - fl.stops[stop, GAP]
        if h >= 0.0 and h1 > 0.0:
            return t
        tau = safe_step(min(h, 0.0), h1, h2, bound)
        if tau < shortest:
            if h1 > 0.0 and h + h1 * shortest >= 0.0:
                return min(t + max(tau, 0.0), end)
            tau = max(shortest, safe_step(min(h, 0.0) - noise, h1, h2, bound))
        t += min(tau, longest)
    return -1.0


@inner
def calm_time(fl, out, w, phase, change):
    """Time in which the third derivative of an output cannot make more than a change of it."""
    _, _, _, bound = output_derivatives(fl, out, w, phase, 0.0)
    return (6.0 * change / bound) ** (1.0 / 3.0) if bound > 0.0 else np.inf


@inner
def fly_state(blocks, w, t):
    """Advance a state (2n,) in place by a flight of duration t."""
    for b in range(blocks.shape[0]):
        e00, e01, e10, e11 = block_exponential(blocks[b], t)
        x, y = w[2 * b], w[2 * b + 1]
        w[2 * b], w[2 * b + 1] = e00 * x + e01 * y, e10 * x + e11 * y


@inner
def swung(turn, angle):
    """Change of a complex number as it turns by an angle, to its own precision."""
    s, c = math.sin(0.5 * angle), math.cos(0.5 * angle)
    return turn * complex(-2.0 * s * s, 2.0 * s * c)


@inner
def flown(fl, stop, phase, w, t):
    """Change of a penetration in a flight of duration t from the state w, to its own precision."""
    value = (fl.forced[0, 0, stop] * swung(turned(phase), fl.omega * t)).real
    value += swollen(fl, stop, phase, t)
    for b in range(fl.blocks.shape[0]):
        j = 2 * b
        _, e01, e10, _, _, _, _, _, d00, d11 = there_and_back(fl.blocks[b], t)
        value += fl.rows[0, stop, j] * (d00 * w[j] + e01 * w[j + 1])
        value += fl.rows[0, stop, j + 1] * (e10 * w[j] + d11 * w[j + 1])
    return value


@inner
def fly(fl, columns, t):
    """Advance sensitivities (2n, n_columns) in place by a flight of duration t."""
    for b in range(fl.blocks.shape[0]):
        e00, e01, e10, e11 = block_exponential(fl.blocks[b], t)
        for c in range(columns.shape[1]):
            x, y = columns[2 * b, c], columns[2 * b + 1, c]
            columns[2 * b, c] = e00 * x + e01 * y
            columns[2 * b + 1, c] = e10 * x + e11 * y


@inner
def forced_output(fl, out, phase):
    """Response of an output to the excitation at a forcing phase."""
    value, _, _, _ = swelling(fl, out, phase)
    return value + (fl.forced[0, 0, out] * turned(phase)).real


@inner
def add_rates(blocks, w, rate):
    """Add the rates of change of w (2n,) in free vibration."""
    for b in range(blocks.shape[0]):
        for i in range(2):
            for j in range(2):
                rate[2 * b + i] += blocks[b, i, j] * w[2 * b + j]


@inner
def free_output(fl, out, w, t):
    """Output of the homogeneous state w after a flight of duration t."""
    value = 0.0
    for b in range(fl.blocks.shape[0]):
        j = 2 * b
        e00, e01, e10, e11 = block_exponential(fl.blocks[b], t)
        value += fl.rows[0, out, j] * (e00 * w[j] + e01 * w[j + 1])
        value += fl.rows[0, out, j + 1] * (e10 * w[j] + e11 * w[j + 1])
    return value


@inner
def near_rate(block, pace):
    """Eigenvalue λ of a block with |λ - i pace| < NEAR pace, or zero."""
    mean = 0.5 * (block[0, 0] + block[1, 1])
    half = 0.5 * (block[0, 0] - block[1, 1])
    square = half * half + block[0, 1] * block[1, 0]
    rate = math.sqrt(abs(square))
    near = square < 0.0 and math.hypot(mean, rate - pace) < NEAR * pace
    return complex(mean, rate) if near else complex(0.0, 0.0)


@inner
def slow_rate(block, omega):
    """Trace + i determinant of a block of which an eigenvalue is slow beside ω, and whether."""
    trace = block[0, 0] + block[1, 1]
    determinant = block[0, 0] * block[1, 1] - block[0, 1] * block[1, 0]
    square = 0.25 * trace * trace - determinant
    fastest = math.sqrt(abs(determinant))
    if square >= 0.0:
        fastest = 0.5 * abs(trace) + math.sqrt(square)
    slow = fastest == 0.0 or abs(determinant) < NEAR * omega * fastest
    return complex(trace, determinant), slow


@allocating
def further_terms(blocks, orders, omega):
    """The terms of a system's response beside the steady one at order 1."""
    most = orders.size * (1 + 2 * blocks.shape[0])
    kinds = np.zeros(most, dtype=np.int64)
    numbers, rates = np.zeros(most), np.zeros(most, dtype=np.complex128)
    n = orders.size - 1
    for h in range(1, orders.size):
        kinds[h - 1], numbers[h - 1] = STEADY, orders[h]
    for h in range(orders.size):
        for b in range(blocks.shape[0]):
            if orders[h] == 0.0:
                rate, slow = slow_rate(blocks[b], omega)
                if slow:
                    kinds[n], kinds[n + 1] = DRIFT, DRIFT_ON
                    rates[n], rates[n + 1] = rate, rate
                    n += 2
            else:
                rate = near_rate(blocks[b], orders[h] * omega)
                if rate.imag > 0.0:
                    kinds[n], numbers[n], rates[n] = GROWTH, orders[h], rate
                    n += 1
    return Terms(kinds[:n], numbers[:n], rates[:n])


@inner
def respond(blocks, order, omega, x, row, steady, first, response):
    """Fill a row of `FlowData.response` with what an excitation x (2n,) at an order brings about.

    That is (i order ω - A)⁻¹ x in the term `steady`, but for a block with a near eigenvalue λ.
    There x falls into its parts along the two eigenvectors: that of λ is the drive of the growth,
    that of its conjugate has a steady response. `first` is the first growth or drift of this order.
    Returns the first of the next order.
    """
    pace, k = order * omega, first
    for b in range(blocks.shape[0]):
        block = blocks[b]
        i, j = 2 * b, 2 * b + 1
        u, v = x[i], x[j]
        if order == 0.0:
            rate, slow = slow_rate(block, omega)
            if slow:
                response[k, row, i], response[k, row, j] = u, v
                response[k + 1, row, i] = block[0, 0] * u + block[0, 1] * v
                response[k + 1, row, j] = block[1, 0] * u + block[1, 1] * v
                k += 2
            else:
                response[steady, row, i] = (block[0, 1] * v - block[1, 1] * u) / rate.imag
                response[steady, row, j] = (block[1, 0] * u - block[0, 0] * v) / rate.imag
            continue
        rate = near_rate(block, pace)
        if rate.imag > 0.0:
            half = 0.5 * (block[0, 0] - block[1, 1])
            p = 0.5 * u - 0.5j * (half * u + block[0, 1] * v) / rate.imag
            q = 0.5 * v - 0.5j * (block[1, 0] * u - half * v) / rate.imag
            response[k, row, i], response[k, row, j] = p, q
            k += 1
            away = complex(-rate.real, pace + rate.imag)
            response[steady, row, i] = (u - p) / away
            response[steady, row, j] = (v - q) / away
        else:
            m00, m01 = 1j * pace - block[0, 0], -block[0, 1]
            m10, m11 = -block[1, 0], 1j * pace - block[1, 1]
            det = m00 * m11 - m01 * m10
            response[steady, row, i] = (m11 * u - m01 * v) / det
            response[steady, row, j] = (m00 * v - m10 * u) / det
    return k


@allocating
def at_frequency(system, omega, parameters, drive_by):
    """Numbers of the system at an excitation frequency (rad/s), see `shoot`."""
    blocks, rows, drive, orders = system.blocks, system.rows, system.drive, system.orders
    terms = further_terms(blocks, orders, omega)
    count = 1 + terms.kinds.size
    x = np.empty(drive.shape[2], dtype=np.complex128)
    response = np.zeros((count, 2 + parameters.shape[0], x.size), dtype=np.complex128)
    first = orders.size
    for h in range(orders.size):
        after = first
        for row in range(response.shape[1]):
            for i in range(x.size):
                if row == 0:
                    x[i] = drive[h, 0, i] + omega * (drive[h, 1, i] + omega * drive[h, 2, i])
                elif row == 1:
                    x[i] = drive[h, 1, i] + 2.0 * omega * drive[h, 2, i]
                    x[i] -= 1j * orders[h] * response[h, 0, i]
                else:
                    by = drive_by[row - 2, h]
                    x[i] = by[0, i] + omega * (by[1, i] + omega * by[2, i])
            after = respond(blocks, orders[h], omega, x, row, h, first, response)
        first = after
    forced = np.zeros((count, response.shape[1], rows.shape[1]), dtype=np.complex128)
    for p in range(count):
        for row in range(response.shape[1]):
            for out in range(rows.shape[1]):
                for i in range(x.size):
                    forced[p, row, out] += rows[0, out, i] * response[p, row, i]
    return FlowData(
        blocks,
        rows,
        system.bound3,
        system.force,
        system.stops,
        system.laws,
        terms,
        response,
        forced,
        parameters,
        omega,
        system.tail,
        system.node_angle,
    )
