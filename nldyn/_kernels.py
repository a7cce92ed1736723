"""Compiled kernels of the flow map: flights, contact phases, segments.

All kernels that are called from here are in this one file, because the compile cache looks only
at the file of the function that is called; see `kernel_cache.resting_on` for the others.

The state z is a list of pairs that move by themselves between contacts, z_b' = A_b z_b with real
2×2 blocks; w is z without the response to the excitation: the steady one, but for a mode excited
at, or almost at, an eigenvalue λ of its own, whose share in it starts from rest at phase zero
(`growth`), since the steady one would be huge, or none.

**Flights** are propagated in closed form; the first contact is found with steps that are bounded
by the third derivative of the gap, so that none is passed over.

**Contact phases**: the modes see one scalar force per stop, so the penetrations at the Gauss nodes
of a panel satisfy a small Volterra equation

    δ_a(t_i) = free_a(t_i) - Σ_b Σ_j h W_ij K_ab(t_i - t_j) F_b(t_j),

K being the impulse response between two stops, and so do their rates if a force depends on them.
Newton's matrix for the forces also gives all sensitivities. The end state is a Gauss quadrature:
order 2m with m nodes.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from nldyn import nearness
from nldyn.kernel_cache import ensure_cache, resting_on
from nldyn.nearness import NEAR

ensure_cache()

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

njit: Any = numba.njit  # its stubs lack the options that spare what only Python callers need
# kernels that are called by other kernels only
inner = njit(cache=True, error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True)
# those with one caller: every level of calls is optimised anew, so this saves compile time
inlined = njit(cache=True, error_model="numpy", inline="always")

(
    OK, TOO_MANY_PIECES, CONTACT_FAILED, DIVERGED, SINGULAR, NOT_CONVERGED, RECORD_FULL, ROUNDED,
    TOO_MANY_STEPS,
) = range(9)  # fmt: skip
FLIGHT = -1


# share of the speed at a stop that rounding of the penetration may cost in one contact, and share
# of the modes' speeds there that their rounding may cost where a stop's damping decides them
WORST_ROUNDING = 1e-6

MOST_STEPS = 10_000_000  # in the search for one contact: a second

# what a stop damps: a panel shows decay by e^-8 to 14 digits, and nothing is left of e^-40 of it
DECAY, FADED = 8.0, 40.0
# below this exponent a slope sets in almost at once: there nodes at the switch count, and less than
# the usual tail is accepted
ROUND, SHARP_TAIL = 1.5, 0.1
CREEP = 100.0  # such an exponent over an elastic contact: the damping alone decides the speed

# an orbit closes to this share of its size, or to this one times the largest entry of its segments'
# Jacobians, which is what rounding costs; a short step of Newton's method does not tell
OPEN, NOISE = 1e-7, 1e-12
STEADY = 1e-3  # share by which the Jacobians may change in a step that only shows rounding

HALF_CONTACT = 2.5  # phase of the stiffness of a stop in half a contact, at most, in rad

# the share of a slope in a Jacobian's error, kick (4 tail)², is less than rtol, (tail / 0.3)², as
# long as KICK kick is less than one
KICK = 1.5

# columns of `stops`
GAP, STIFFNESS, EXPONENT, DISSIPATION, MOBILITY, DURATION, INSTANT = range(7)


class SystemData(NamedTuple):
    """Numbers of a system, as the kernels need them: few arrays, since each one costs compile time.

    Outputs are the penetrations of the stops, then the observed displacements.
    """

    blocks: Real  # (n, 2, 2)
    rows: Real  # (3, n_out, 2n) outputs, their velocities and accelerations in flight
    bound3: Real  # (n_out, 2n) |third derivative| <= Σ_b |bound3_b| |w_b| at any later time
    force: Real  # (2n, n_stops): w' = A w - force @ F
    drive: Complex  # (2, 2n) excitation Re((drive[0] + ω² drive[1]) e^{iωt}) of z
    # (n_stops, 7): gap; stiffness, exponent and dissipation; velocity jump per unit impulse in
    # 1/kg; duration of a free contact over (peak penetration / speed); error allowed in the
    # instant of an event, as a share of the panel
    stops: Real
    laws: NDArray[np.int64]  # (n_stops,) address of a compiled law, or 0 for the power law
    tail: float  # largest relative Legendre tail accepted on a contact panel
    node_angle: float  # phase of the fastest mode from node to node, in rad


class FlowData(NamedTuple):
    """Numbers of a system at one excitation frequency; see `SystemData`."""

    blocks: Real
    rows: Real
    bound3: Real
    force: Real
    stops: Real
    laws: NDArray[np.int64]
    near: Complex  # (k,) eigenvalues near iω; k = 0 for most systems
    # (1 + k, 2 + n_parameters, 2n): amplitude of the steady response, z = w + Re(response[0, 0]
    # e^{iωt}), and of the `growth` of each near eigenvalue; then their derivatives with respect to
    # ω and to each parameter
    response: Complex
    forced: Complex  # (1 + k, 2 + n_parameters, n_out) the same of the outputs
    # (n_parameters, 2): column of `stops`, or -1 for the excitation; and the index of the stop
    parameters: NDArray[np.int64]
    omega: float
    tail: float
    node_angle: float


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
    swing, odd = -2.0 * s * s, 2.0 * s * c / rate  # cos - 1, sin / rate
    even = 1.0 + swing
    a, b, c, d = odd * half, odd * block[0, 1], odd * block[1, 0], 1.0 / size
    return (
        size * (even + a), size * b, size * c, size * (even - a),
        d * (even - a), -d * b, -d * c, d * (even + a),
        less + size * (swing + a), less + size * (swing - a),
    )  # fmt: skip


@intrinsic
def never_inline(typing):
    """Keep the function apart from which it is called: rare code that would cost compile time."""
    return types.void(), _marking("noinline")


@intrinsic
def always_inline(typing):
    """Inline the function from which it is called, though rare code makes it look long."""
    return types.void(), _marking("alwaysinline")


def _marking(attribute):
    """Code generator that only gives the function at hand an attribute."""

    def codegen(context, builder, signature, arguments):
        builder.function.attributes.add(attribute)
        return context.get_dummy_value()

    return codegen


@inner
def turned(phase):
    """e^{i phase}."""
    return complex(math.cos(phase), math.sin(phase))


@inner
def from_rest(rate, t):
    """∫ exp(rate u) du from 0 to t for a complex rate, to full precision also where it is small."""
    x, y = rate.real * t, rate.imag * t
    square = x * x + y * y
    if square < 1e-18:
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
def swelling(near, forced, omega, out, phase):
    """Value, two time derivatives, and bound of the third over a period, of an output's growth.

    e grows by at most the time that passes, since no eigenvalue grows.
    """
    never_inline()
    value, first, second, bound = 0.0, 0.0, 0.0, 0.0
    for k in range(near.size):
        share, rate = forced[1 + k, 0, out], near[k]
        e, turn = growth(rate, omega, phase)
        size, later = abs(rate), abs(e) + 2.0 * math.pi / omega
        value += (share * e).real
        e = rate * e + turn
        first += (share * e).real
        second += (share * (rate * e + 1j * omega * turn)).real
        bound += abs(share) * (size * size * (size * later + 1.0) + omega * (size + omega))
    return value, first, second, bound


@inner
def swollen(near, forced, omega, out, phase, t):
    """Change of an output's growth in a time t from a phase on, to its own precision."""
    never_inline()
    change = 0.0
    for k in range(near.size):
        rate = near[k]
        e, turn = growth(rate, omega, phase)
        fresh = turn * turned(omega * t) * from_rest(rate - 1j * omega, t)
        change += (forced[1 + k, 0, out] * (e * rate * from_rest(rate, t) + fresh)).real
    return change


@inner
def add_swelling_by(near, forced, omega, out, phase, t, rate, factor, sums):
    """Add the derivatives of an output's growth, or its rate's, at time t after a fixed phase.

    sums (n_columns,) ends with the columns of the parameters and of ω, as in `panel_columns`.
    """
    never_inline()
    last = sums.size - 1
    first = sums.size + 1 - forced.shape[1]
    for k in range(near.size):
        e, turn = growth(near[k], omega, phase)
        e1 = near[k] * e + turn
        d = growth_by_omega(near[k], omega, phase) + e1 * (t / omega)
        if rate:
            e, d = e1, near[k] * d + 1j * t * turn
        sums[last] += factor * (forced[1 + k, 1, out] * e + forced[1 + k, 0, out] * d).real
        for c in range(first, last):
            sums[c] += factor * (forced[1 + k, 2 + c - first, out] * e).real


@inner
def add_growth(near, response, omega, phase, sign, w, columns):
    """Add sign times the growth to the state w (2n,) and its derivatives to its last columns."""
    never_inline()
    last = columns.shape[1] - 1
    first = columns.shape[1] + 1 - response.shape[1]
    for k in range(near.size):
        e, _ = growth(near[k], omega, phase)
        d = sign * growth_by_omega(near[k], omega, phase)
        e *= sign
        for i in range(w.size):
            w[i] += (response[1 + k, 0, i] * e).real
            columns[i, last] += (response[1 + k, 1, i] * e + response[1 + k, 0, i] * d).real
            for c in range(first, last):
                columns[i, c] += (response[1 + k, 2 + c - first, i] * e).real


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
    if fl.near.size > 0:
        s, s1, s2, s3 = swelling(fl.near, fl.forced, fl.omega, out, phase + fl.omega * t)
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
    """Sum of the sizes of an output's terms (order 0), or of those of its rate (order 1)."""
    pace = fl.omega if order == 1 else 1.0
    total = abs(fl.forced[0, 0, out]) * pace
    for k in range(fl.near.size):
        total += abs(fl.forced[1 + k, 0, out]) * (2.0 * math.pi / fl.omega) * pace
    for j in range(w.size):
        total += abs(fl.rows[order, out, j] * w[j])
    return total


@inner
def output_noise(fl, out, w):
    """Rounding error to expect in an output: 4 units in the last place of its terms."""
    return 1e-15 * output_size(fl, out, w, 0)


@inner
def rate_noise(fl, out, w):
    """The same in the output's rate."""
    return 1e-15 * output_size(fl, out, w, 1)


@inner
def carried_noise(fl, stop, w, phase, depth, h):
    """The same in a penetration that is carried on from a depth over a time h."""
    change = abs(fl.forced[0, 0, stop]) * fl.omega * h
    for k in range(fl.near.size):
        e, _ = growth(fl.near[k], fl.omega, phase)
        change += h * abs(fl.forced[1 + k, 0, stop]) * (abs(fl.near[k] * e) + 1.0)
    for j in range(w.size):
        change += h * (abs(fl.rows[1, stop, j]) + h * abs(fl.rows[2, stop, j])) * abs(w[j])
    return 1e-15 * (abs(depth) + change)


@inner
def fastest_moved(blocks, force):
    """Largest |eigenvalue|, in 1/s, of the blocks that stops move by more than rounding."""
    fastest, least = 0.0, 0.0
    if force.size > 0:
        least = 1e-14 * np.abs(force).max()
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
        if abs(step) <= 1e-15 * tau:
            break
    return max(tau, 0.0)


@inner
def closing_time(fl, stop, w, phase, start, end, shortest):
    """First time in [start, end] at which a stop closes, or inf; no contact is passed over.

    Every step is bounded by the third derivative, so that it cannot cross a contact; the steps
    converge to the contact at order three. Only contacts that are shorter than `shortest` or no
    deeper than rounding can be stepped over, and only where the approach is so slow that the
    acceleration stops it in that time. Negative if it takes too many steps.
    """
    longest = 2.0 * math.pi / fl.omega
    noise = output_noise(fl, stop, w)
    t = start
    for _ in range(MOST_STEPS):
        if t > end:
            return np.inf
        value, h1, h2, bound = output_derivatives(fl, stop, w, phase, t)
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
    value += swollen(fl.near, fl.forced, fl.omega, stop, phase, t)
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


class Record(NamedTuple):
    """Pieces of a trajectory, enough to evaluate the state at any instant.

    Parameters
    ----------
    phase, duration : (n_pieces,)
        Forcing phase at the start, duration in s.
    kind : (n_pieces,)
        -1 for a flight, else the kind of the panel's ends.
    event : (n_pieces,)
        Stop that opens or closes at the end, or -1.
    start : (n_pieces, 2n)
        State z at the start.
    force, depth : (n_pieces, n_stops, m)
        Forces and penetrations at the nodes of a panel (zero where a stop is open).
    used : (2,)
        Number of pieces in use; number of pieces of the motion before, which are overwritten one
        by one and serve as guesses.
    """

    phase: NDArray[np.float64]
    duration: NDArray[np.float64]
    kind: NDArray[np.int64]
    event: NDArray[np.int64]
    start: NDArray[np.float64]
    force: NDArray[np.float64]
    depth: NDArray[np.float64]
    used: NDArray[np.int64]


@intrinsic
def call_law(typing, address, delta, speed):
    """Call ``void law(double delta, double speed, double out[3])`` at an address."""
    signature = types.UniTuple(types.float64, 3)(types.int64, types.float64, types.float64)

    def codegen(context, builder, signature, arguments):
        double = ir.DoubleType()
        kind = ir.FunctionType(ir.VoidType(), [double, double, double.as_pointer()])
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        out = cgutils.alloca_once(builder, double, size=3)
        builder.call(function, [arguments[1], arguments[2], out])
        values = [builder.load(cgutils.gep_inbounds(builder, out, i)) for i in range(3)]
        return context.make_tuple(builder, signature.return_type, values)

    return signature, codegen


@inner
def law(fl, stop, delta, speed):
    """Contact force and its derivatives with respect to penetration and speed."""
    if delta <= 0.0:
        return 0.0, 0.0, 0.0
    if fl.laws[stop] != 0:
        return call_law(fl.laws[stop], delta, speed)
    exponent = fl.stops[stop, EXPONENT]
    slope = fl.stops[stop, STIFFNESS]
    if exponent == 1.5:
        slope *= math.sqrt(delta)
    elif exponent != 1.0:
        slope *= delta ** (exponent - 1.0)
    loss = fl.stops[stop, DISSIPATION]
    factor = 1.0 + loss * speed
    return slope * delta * factor, exponent * slope * factor, loss * slope * delta


@inner
def closed_law(fl, stop, delta, speed):
    """The same within a panel on which the stop is closed.

    There a law whose slope sets in almost at once goes on beyond the switch, as an odd function:
    the outermost node may come to lie on its other side, and would drop the whole stiffness.
    """
    if delta < 0.0 and fl.stops[stop, EXPONENT] < ROUND:
        force, stiffness, viscosity = law(fl, stop, -delta, speed)
        return -force, stiffness, -viscosity
    return law(fl, stop, delta, speed)


@inner
def depends_on_speed(fl, stop):
    """Whether a force depends on the speed of penetration, as far as one knows."""
    return fl.laws[stop] != 0 or fl.stops[stop, DISSIPATION] != 0.0


@inner
def needs_speed(fl, stop):
    """Whether a force depends on the speed, or is to be differentiated by what makes it do so."""
    needed = depends_on_speed(fl, stop)
    for c in range(fl.parameters.shape[0]):
        wanted = fl.parameters[c, 0] == DISSIPATION and fl.parameters[c, 1] == stop
        needed = needed or wanted
    return needed


@inner
def law_by(fl, stop, column, delta, speed):
    """Derivative of a stop's force with respect to its own number in a column of `stops`."""
    force, slope, _ = closed_law(fl, stop, delta, speed)
    if column == GAP:
        return -slope
    if column == STIFFNESS:
        return force / fl.stops[stop, STIFFNESS]
    if column == EXPONENT:
        return force * math.log(delta) if delta > 0.0 else 0.0
    factor = 1.0 + fl.stops[stop, DISSIPATION] * speed  # column == DISSIPATION
    return speed * force / factor


class Panel(NamedTuple):
    """Arrays of a contact panel with na stops, m nodes and n modes.

    They are filled by `solve_panel`; what depends on kind and length alone serves the next panel
    of the same stops too. Outputs are the na penetrations and, if a force depends on them, their
    na rates.
    """

    active: NDArray[np.int64]  # (na,) closed stops
    output: Real  # (n_outputs, m) values at the nodes
    F: Real  # (na, m) forces
    slope: Real  # (n_outputs, m) derivative of the force with respect to the output
    to: Real  # (n_outputs, m, 2n) row exp(A t_i)
    back: Real  # (na, 2n, m) exp(-A t_j) force
    G: Real  # (n_outputs m, na m) outputs at the nodes per force at the nodes
    factors: Real  # (na m, na m) of the matrix 1 + slope G, at these slopes or earlier ones
    order: NDArray[np.int64]  # (na m,) its row swaps
    kept: NDArray[np.bool_]  # (1,) whether `factors` are worth keeping
    made: Real  # (2,) kind and length for which to, back and G were filled
    rise: Real  # (na, m, 2n) row (exp(A t_i) - 1) of the penetrations
    # (4, na) penetration at the start and its rounding error, the same at the end: carried apart
    # from the state, in which rounding is a share of the displacement
    depth: Real
    # (2, na) exponent by which each stop has damped fast motion, before this panel and in it, since
    # the segment began, the last event, or another stop began to count
    decay: Real


@inner
def new_panel(fl, m, n_states, active):
    """An empty panel."""
    na = active.size
    outputs = na
    for a in range(na):
        if needs_speed(fl, active[a]):
            outputs = 2 * na
    return Panel(
        active,
        np.zeros((outputs, m)),
        np.empty((na, m)),
        np.empty((outputs, m)),
        np.empty((outputs, m, n_states)),
        np.empty((na, n_states, m)),
        np.empty((outputs * m, na * m)),
        np.empty((na * m, na * m)),
        np.empty(na * m, dtype=np.int64),
        np.zeros(1, dtype=np.bool_),
        np.zeros(2),
        np.empty((na, m, n_states)),
        np.empty((4, na)),
        np.zeros((2, na)),
    )


@inner
def same_stops(active, other):
    """Whether two lists of stops are equal."""
    equal = active.size == other.size
    for a in range(min(active.size, other.size)):
        equal = equal and active[a] == other[a]
    return equal


@inner
def panel_responses(fl, tab, kind, h, panel):
    """Fill what a panel of length h needs to know of the linear part: to, rise, back and G."""
    m = tab.nodes.size
    na = panel.active.size
    to, back, G = panel.to, panel.back, panel.G
    if panel.made[0] == kind and panel.made[1] == h:
        return
    panel.made[0], panel.made[1] = kind, h
    for i in range(m):
        t = h * tab.chi[kind, i]
        for b in range(fl.blocks.shape[0]):
            j = 2 * b
            e00, e01, e10, e11, i00, i01, i10, i11, d00, d11 = there_and_back(fl.blocks[b], t)
            for o in range(to.shape[0]):
                stop = panel.active[o % na]
                x, y = fl.rows[o // na, stop, j], fl.rows[o // na, stop, j + 1]
                to[o, i, j] = x * e00 + y * e10
                to[o, i, j + 1] = x * e01 + y * e11
                if o < na:
                    panel.rise[o, i, j] = x * d00 + y * e10
                    panel.rise[o, i, j + 1] = x * e01 + y * d11
            for a in range(na):
                x, y = fl.force[j, panel.active[a]], fl.force[j + 1, panel.active[a]]
                back[a, j, i] = i00 * x + i01 * y
                back[a, j + 1, i] = i10 * x + i11 * y
    product = np.empty((m, m))
    for o in range(to.shape[0]):
        for a in range(na):
            np.dot(to[o], back[a], product)
            for i in range(m):
                for j in range(m):
                    G[o * m + i, a * m + j] = h * tab.integrate[kind, i, j] * product[i, j]


@inner
def lu_factor(A, order):
    """Replace A by its LU factors with the inverses of the pivots, order (n,) by the row swaps."""
    n = A.shape[0]
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        order[k] = pivot
        if pivot != k:
            for j in range(n):
                A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
        A[k, k] = 1.0 / A[k, k] if A[k, k] != 0.0 else np.inf
        for i in range(k + 1, n):
            A[i, k] *= A[k, k]
            factor = A[i, k]
            if factor != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= factor * A[k, j]


@inner
def lu_apply(A, order, B):
    """Solve for the columns of B (n, n_rhs) in place with the factors of `lu_factor`."""
    n, n_rhs = B.shape
    for k in range(n):
        if order[k] != k:
            for j in range(n_rhs):
                B[k, j], B[order[k], j] = B[order[k], j], B[k, j]
    for i in range(1, n):
        for k in range(i):
            factor = A[i, k]
            for j in range(n_rhs):
                B[i, j] -= factor * B[k, j]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            factor = A[i, k]
            for j in range(n_rhs):
                B[i, j] -= factor * B[k, j]
        for j in range(n_rhs):
            B[i, j] *= A[i, i]


@inner
def lu_apply_vector(A, order, b):
    """The same for one right-hand side (n,)."""
    n = b.size
    for k in range(n):
        b[k], b[order[k]] = b[order[k]], b[k]
    for i in range(1, n):
        total = b[i]
        for k in range(i):
            total -= A[i, k] * b[k]
        b[i] = total
    for i in range(n - 1, -1, -1):
        total = b[i]
        for k in range(i + 1, n):
            total -= A[i, k] * b[k]
        b[i] = total * A[i, i]


@inner
def forced_output(fl, out, phase):
    """Response of an output to the excitation at a forcing phase."""
    value, _, _, _ = swelling(fl.near, fl.forced, fl.omega, out, phase)
    return value + (fl.forced[0, 0, out] * turned(phase)).real


@inner
def free_outputs(fl, tab, kind, phase, w, h, panel, free):
    """Fill the panel's outputs at the nodes (n_outputs m,) without contact forces.

    Penetrations are what they were at the start of the panel, and their changes.
    """
    always_inline()
    m = tab.nodes.size
    na = panel.active.size
    start = turned(phase)
    for i in range(m):
        swing = swung(start, fl.omega * h * tab.chi[kind, i])
        for o in range(panel.to.shape[0]):
            steady = fl.forced[0, 0, panel.active[o % na]]
            if o < na:
                value = panel.depth[0, o] + (steady * swing).real
                for k in range(w.size):
                    value += panel.rise[o, i, k] * w[k]
            else:
                value = -fl.omega * (steady * (start + swing)).imag
                for k in range(w.size):
                    value += panel.to[o, i, k] * w[k]
            free[o * m + i] = value
    if fl.near.size > 0:
        for o in range(panel.to.shape[0]):
            stop = panel.active[o % na]
            for i in range(m):
                t = h * tab.chi[kind, i]
                if o < na:
                    more = swollen(fl.near, fl.forced, fl.omega, stop, phase, t)
                else:
                    here = phase + fl.omega * t
                    _, more, _, _ = swelling(fl.near, fl.forced, fl.omega, stop, here)
                free[o * m + i] += more


@inner
def panel_forces(fl, panel, slope):
    """Fill F from the outputs at the nodes, and its derivatives into `slope`."""
    na, m = panel.F.shape
    for a in range(na):
        for i in range(m):
            speed = panel.output[na + a, i] if slope.shape[0] > na else 0.0
            force, stiffness, viscosity = closed_law(fl, panel.active[a], panel.output[a, i], speed)
            panel.F[a, i] = force
            slope[a, i] = stiffness
            if slope.shape[0] > na:
                slope[na + a, i] = viscosity


@inner
def factor_panel(panel):
    """Factor the matrix 1 + slope G."""
    na, m = panel.F.shape
    A, G, slope = panel.factors, panel.G, panel.slope
    for a in range(na):
        for i in range(m):
            p = a * m + i
            for q in range(na * m):
                A[p, q] = slope[a, i] * G[p, q]
            if slope.shape[0] > na:
                for q in range(na * m):
                    A[p, q] += slope[na + a, i] * G[na * m + p, q]
            A[p, p] += 1.0
    lu_factor(A, panel.order)


@inner
def less_forced(G, free, force, o, i, m):
    """Output o at node i: what is free minus what the forces (na m,) take away."""
    p = o * m + i
    total = free[p]
    for q in range(force.size):
        total -= G[p, q] * force[q]
    return total


@inner
def guess_rates(fl, panel, free, slope, force):
    """Fill the rates of the outputs with what the guessed penetrations lead to without them."""
    na, m = panel.F.shape
    for o in range(na, panel.output.shape[0]):
        for i in range(m):
            panel.output[o, i] = 0.0
    panel_forces(fl, panel, slope)
    for p in range(force.size):
        force[p] = panel.F[p // m, p % m]
    for o in range(na, panel.output.shape[0]):
        for i in range(m):
            panel.output[o, i] = less_forced(panel.G, free, force, o, i, m)


@inner
def consistent(panel, force, noise):
    """Whether the forces (na m,) are those of the penetrations that they lead to."""
    na, m = panel.F.shape
    for a in range(na):
        allowed = 1e-10 * largest(panel.F, a)
        for o in range(a, noise.size, na):
            allowed += 10.0 * noise[o] * largest(panel.slope, o)
        for i in range(m):
            off = abs(panel.F[a, i] - force[a * m + i])
            if off > allowed and off > allowed + rounded_force(panel, force, a, i):
                return False
    return True


@inner
def rounded_force(panel, force, a, i):
    """Rounding error of stop a's force at node i by what all forces (na m,) have moved so far."""
    na, m = panel.F.shape
    error = 0.0
    for o in range(a, panel.output.shape[0], na):
        moved = 0.0
        for p in range(na * m):
            moved += abs(panel.G[o * m + i, p] * force[p])
        error += 1e-15 * moved * abs(panel.slope[o, i])
    return error


@inner
def solve_panel(fl, tab, kind, phase, w, h, noise, panel):
    """Newton's method for the forces at the nodes; the penetrations in `output` are the guess.

    noise (n_outputs,) is the rounding error to expect in each output. Returns whether it converged,
    with the panel filled. The factors of its matrix serve as long as they bring an error down
    tenfold per step, also those that the call before has left.
    """
    na, m = panel.F.shape
    size = na * m
    outputs = panel.to.shape[0]
    output, slope = panel.output, panel.slope
    panel_responses(fl, tab, kind, h, panel)
    free = np.empty(outputs * m)
    free_outputs(fl, tab, kind, phase, w, h, panel, free)
    new = np.empty(slope.shape)
    force = np.empty(size)
    step = np.zeros(size)
    if outputs > na:
        guess_rates(fl, panel, free, new, force)
    before = np.inf
    for iteration in range(60):
        panel_forces(fl, panel, new)
        fresh = not panel.kept[0]
        if fresh:
            for o in range(outputs):
                for i in range(m):
                    slope[o, i] = new[o, i]
            factor_panel(panel)
            panel.kept[0] = True
        for a in range(na):
            for i in range(m):
                p = a * m + i
                if iteration > 0:
                    step[p] = panel.F[a, i] - force[p]
                else:
                    force[p] = panel.F[a, i]
        if iteration == 0:  # the guess is not what its forces lead to
            for o in range(outputs):
                for i in range(m):
                    off = less_forced(panel.G, free, force, o, i, m) - output[o, i]
                    step[(o % na) * m + i] += slope[o, i] * off
        lu_apply_vector(panel.factors, panel.order, step)
        for p in range(size):
            force[p] += step[p]
        change = 0.0
        for o in range(outputs):
            scale, longest, total = 0.0, 0.0, 0.0
            for i in range(m):
                value = less_forced(panel.G, free, force, o, i, m)
                scale = max(scale, abs(output[o, i]))
                longest = max(longest, abs(value - output[o, i]))
                total += value
                output[o, i] = value
            if not np.isfinite(total):  # a maximum may pass over nan
                panel.kept[0] = False
                return False
            if o < na and longest > noise[o]:
                change = max(change, longest / scale)
        # the error left: goes with the square after a step with a fresh matrix, else linearly
        # nothing moves where forces are too weak to: they may still not be the penetrations' own
        rate = change / before if change > 0.0 else 0.0
        left = change * change if fresh else change * rate / max(1.0 - rate, 1e-3)
        if left <= 1e-13 and (fresh or before < np.inf or change == 0.0):
            panel_forces(fl, panel, slope)
            if consistent(panel, force, noise):  # that estimate trusts in the order of convergence
                return True
            rate = 1.0
        if rate > 0.1:
            panel.kept[0] = False
        before = change
    panel.kept[0] = False
    return False


@inner
def panel_end(fl, tab, kind, phase, w, h, panel, w_end):
    """State w_end and penetrations at the end of a panel from the forces at its nodes.

    `decay` has been filled.
    """
    for a in range(panel.active.size):
        panel.depth[2, a] = panel.depth[0, a]
    for k in range(w.size):
        kick = 0.0  # what the forces have added, taken back to the start
        for a in range(panel.active.size):
            for j in range(tab.nodes.size):
                kick -= h * tab.weights[kind, j] * panel.F[a, j] * panel.back[a, k, j]
        w_end[k] = w[k] + kick
        for a in range(panel.active.size):
            panel.depth[2, a] += fl.rows[0, panel.active[a], k] * kick
    for a in range(panel.active.size):
        panel.depth[2, a] += flown(fl, panel.active[a], phase, w_end, h)
    fly_state(fl.blocks, w_end, h)
    hold(fl, tab, kind, phase + fl.omega * h, h, panel, w_end)


@inner
def hold(fl, tab, kind, end_phase, h, panel, w_end):
    """Correct the end of a panel by the speeds of the stops that damp strongly.

    An error of such a force is a much smaller one of the speed, by its slope. So the nodes' speeds,
    and the one at which the law gives the force of the end, are known better than what the forces
    integrate to. Where several stops damp, they count by how strongly they do.
    """
    if largest(panel.decay, 1) <= DECAY:
        return
    na = panel.active.size
    viscosity, off, order = np.zeros(na), np.zeros(na), np.empty(na, dtype=np.int64)
    for a in range(na):
        if panel.decay[1, a] > DECAY:
            _, speed, _, _ = output_derivatives(fl, panel.active[a], w_end, end_phase, 0.0)
            _, _, viscosity[a] = law(fl, panel.active[a], panel.depth[2, a], speed)
            gained = 0.0
            for i in range(tab.nodes.size):
                gained += h * tab.weights[kind, i] * panel.output[na + a, i]
            off[a] = h * viscosity[a] * (panel.depth[0, a] + gained - panel.depth[2, a])
    matrix = np.empty((na, na))  # 1 + h viscosity mobility
    for a in range(na):
        for b in range(na):
            mobility = 0.0
            for k in range(w_end.size):
                mobility += fl.rows[1, panel.active[a], k] * fl.force[k, panel.active[b]]
            matrix[a, b] = (a == b) + h * viscosity[a] * mobility
    lu_factor(matrix, order)
    shift, kick = np.zeros(w_end.size), np.zeros(w_end.size)
    lu_apply_vector(matrix, order, off)
    add_kicks(fl, panel.active, off, kick)
    add_rates(fl.blocks, kick, shift)  # without the end of a kick in time: displacements
    for k in range(w_end.size):
        w_end[k] += shift[k]
        for a in range(na):
            panel.depth[2, a] += fl.rows[0, panel.active[a], k] * shift[k]
    for _ in range(2):  # the slopes are those before the shift
        for a in range(na):
            off[a] = 0.0
            if viscosity[a] > 0.0:
                _, speed, _, _ = output_derivatives(fl, panel.active[a], w_end, end_phase, 0.0)
                force, _, _ = law(fl, panel.active[a], panel.depth[2, a], speed)
                off[a] = h * (at_end(tab, panel.F, a) - force)
        lu_apply_vector(matrix, order, off)
        add_kicks(fl, panel.active, off, w_end)


@inner
def add_kicks(fl, stops, kicks, w):
    """Add to w (2n,) what impulses (n_stops,) in the sense of the gaps change."""
    for a in range(stops.size):
        for k in range(w.size):
            w[k] += fl.force[k, stops[a]] * kicks[a]


@inner
def add_rates(blocks, w, rate):
    """Add the rates of change of w (2n,) in free vibration."""
    for b in range(blocks.shape[0]):
        for i in range(2):
            for j in range(2):
                rate[2 * b + i] += blocks[b, i, j] * w[2 * b + j]


@inner
def panel_columns(fl, tab, kind, phase, t0, h, panel, columns):
    """Advance sensitivities (2n, n_columns) in place over a panel.

    After those of the start come the derivatives with respect to parameters; the last column is
    that with respect to ω at fixed time; t0 is the time from the start of the segment at which its
    phase is fixed.
    """
    na, m = panel.F.shape
    n_columns = columns.shape[1]
    forces = np.zeros((na * m, n_columns))
    part = np.empty((m, n_columns))
    for o in range(panel.to.shape[0]):
        stop = panel.active[o % na]
        np.dot(panel.to[o], columns, part)
        for i in range(m):
            p = (o % na) * m + i
            slope = panel.slope[o, i]
            for c in range(n_columns):
                forces[p, c] += slope * part[i, c]
            t = h * tab.chi[kind, i]
            turn = turned(phase + fl.omega * t)
            d_omega = fl.forced[0, 1, stop] + 1j * (t0 + t) * fl.forced[0, 0, stop]
            if o < na:
                forces[p, n_columns - 1] += slope * (d_omega * turn).real
            else:
                d_omega = fl.omega * d_omega + fl.forced[0, 0, stop]
                forces[p, n_columns - 1] -= slope * (d_omega * turn).imag
            if fl.near.size > 0:
                add_swelling_by(
                    fl.near, fl.forced, fl.omega, stop, phase + fl.omega * t, t0 + t, o >= na,
                    slope, forces[p],
                )  # fmt: skip
            for c in range(fl.parameters.shape[0]):
                q = columns.shape[0] + c
                by = fl.forced[0, 2 + c, stop] * turn
                forces[p, q] += slope * (by.real if o < na else -fl.omega * by.imag)
                if o < na and fl.parameters[c, 1] == stop and fl.parameters[c, 0] >= GAP:
                    speed = panel.output[na + o, i] if panel.slope.shape[0] > na else 0.0
                    forces[p, q] += law_by(fl, stop, fl.parameters[c, 0], panel.output[o, i], speed)
    factor_panel(panel)
    lu_apply(panel.factors, panel.order, forces)
    change = np.empty(columns.shape)
    for a in range(na):
        for j in range(m):
            for c in range(n_columns):
                part[j, c] = h * tab.weights[kind, j] * forces[a * m + j, c]
        np.dot(panel.back[a], part, change)
        for k in range(columns.shape[0]):
            for c in range(n_columns):
                columns[k, c] -= change[k, c]
    fly(fl, columns, h)


@inner
def legendre_coefficient(tab, values, a, degree):
    """Legendre coefficient of the polynomial through row a of values."""
    total = 0.0
    for j in range(tab.nodes.size):
        total += tab.to_legendre[degree, j] * values[a, j]
    return total


@inner
def legendre_tail(tab, values, a):
    """Larger of the last two of these coefficients."""
    m = tab.nodes.size
    return max(
        abs(legendre_coefficient(tab, values, a, m - 2)),
        abs(legendre_coefficient(tab, values, a, m - 1)),
    )


@inner
def at_end(tab, values, a):
    """Value at the end of the panel of the same polynomial: each of Legendre's is 1 there."""
    total = 0.0
    for degree in range(tab.nodes.size):
        total += legendre_coefficient(tab, values, a, degree)
    return total


@inner
def largest(values, a):
    """Largest absolute value in row a."""
    found = 0.0
    for j in range(values.shape[1]):
        found = max(found, abs(values[a, j]))
    return found


@inner
def nearly_opens(tab, kind, values, a, noise):
    """Whether row a of penetrations has a minimum so low that its slope is nearly singular there.

    The parabola through it vanishes at a complex pair nearer than a quarter of the panel.
    """
    for i in range(1, values.shape[1] - 1):
        if values[a, i - 1] >= values[a, i] <= values[a, i + 1]:
            left = tab.chi[kind, i - 1] - tab.chi[kind, i]
            right = tab.chi[kind, i + 1] - tab.chi[kind, i]
            slope, curvature = parabola(
                left, right, values[a, i - 1], values[a, i], values[a, i + 1]
            )
            if curvature > 0.0:
                lowest = values[a, i] - 0.25 * slope * slope / curvature
                if noise < lowest < curvature / 16.0:
                    return True
    return False


@inner
def singular_slope(fl, stop):
    """Whether the slope of a stop's force is singular at its switch."""
    exponent = fl.stops[stop, EXPONENT]
    return fl.laws[stop] != 0 or exponent != math.floor(exponent)


@inner
def resolved(fl, tab, kind, h, noise, panel):
    """Whether the Legendre tails of each force and of its slopes are small beside their largest.

    Where the rate of penetration comes close to one without force, its rounding is all there is to
    see. A slope counts as it does in the sensitivities: times dχ/ds. Where contacts are short
    against the period, it kicks them to many times their final size, and its error, the square of
    the tail, with them. What a force or a slope does over a panel is off by the product of its
    tail and that of the response to it, or of the response's square.

    A force that hardly changes tells nothing of how a change of the motion sways on the closed
    stops: their stiffness is held to the bound of the structure's fastest mode.
    """
    na = panel.active.size
    stiffness = 0.0
    for a in range(na):
        stiffness += fl.stops[panel.active[a], MOBILITY] * largest(panel.slope, a)
    longest = fl.node_angle * tab.nodes.size * (1.0 if kind == 0 else 0.75 / tab.power)
    if h * math.sqrt(stiffness) > max(longest, HALF_CONTACT):
        return False
    slopes = np.empty(panel.slope.shape)
    for o in range(slopes.shape[0]):
        for i in range(slopes.shape[1]):
            slopes[o, i] = panel.slope[o, i] * tab.slope[kind, i]
    forced, swayed = np.empty(na), np.empty(na)  # tails of the response and of its square
    for a in range(na):
        back = panel.back[a]
        forced[a] = swayed[a] = max(response_tail(fl, tab, panel.active[a], back), fl.tail)
        if forced[a] > fl.tail:  # what a slope acts on sways like what it leads to
            swayed[a] = max(forced[a], response_tail(fl, tab, panel.active[a], back * back))
    for o in range(slopes.shape[0]):
        a = o % na
        deepest = largest(panel.output, a)
        if deepest <= 10.0 * noise[a]:
            continue
        singular = o < na and singular_slope(fl, panel.active[a])
        if singular and nearly_opens(tab, kind, panel.output, a, 10.0 * noise[a]):
            return False
        goal = fl.tail if panel.decay[1, a] <= DECAY else 0.01 * fl.tail  # see `hold`
        if 1.0 < fl.stops[panel.active[a], EXPONENT] < ROUND:
            goal *= SHARP_TAIL
        floor = 20.0 * noise[a] / deepest
        tail = max(goal * fl.tail / forced[a], floor)
        shake = 0.0  # of the force by the rounding of the rate
        if o < na < slopes.shape[0]:
            shake = 20.0 * noise[na + a] * largest(panel.slope, na + a)
        if o < na and legendre_tail(tab, panel.F, a) > tail * largest(panel.F, a) + shake:
            return False
        shake *= fl.stops[panel.active[a], EXPONENT] / deepest * largest(tab.slope, kind)
        size = largest(slopes, o)
        if o >= na and largest(panel.output, o) > 0.0:  # by speed: its share in the force counts
            size = max(size, largest(panel.F, a) / largest(panel.output, o))
        kick = 1.0
        if o < na:
            kick = KICK * fl.stops[panel.active[a], MOBILITY] * largest(panel.slope, o)
            kick = max(kick * h / fl.omega, 1.0)
        tail = max(goal * fl.tail / (swayed[a] * math.sqrt(kick)), floor)
        if legendre_tail(tab, slopes, o) > 4.0 * (tail * size + shake):
            return False
    return True


@inner
def response_tail(fl, tab, stop, back):
    """Legendre tail, beside its largest, of the response (2n, m) of the modes to a stop.

    Each mode counts by its share in the mobility.
    """
    worst, mobility = 0.0, 1e-300
    for b in range(fl.blocks.shape[0]):
        tail, size, share = 0.0, 1e-300, 0.0
        for k in (2 * b, 2 * b + 1):
            row = abs(fl.rows[1, stop, k])
            tail = max(tail, row * legendre_tail(tab, back, k))
            size = max(size, row * largest(back, k))
            share += row * abs(fl.force[k, stop])
        worst = max(worst, share * tail / size)
        mobility += share
    return worst / mobility


@inner
def shows_decay(fl, tab, kind, h, panel):
    """Whether a panel shows what each stop damps, or nothing is left of it; fills `decay`."""
    na, m = panel.F.shape
    shown = True
    for o in range(na, panel.slope.shape[0]):
        a = o - na
        total = 0.0
        for i in range(m):
            rate = fl.stops[panel.active[a], MOBILITY] * panel.slope[o, i]
            total += h * tab.weights[kind, i] * rate
        panel.decay[1, a] = total
        shown = shown and (total <= DECAY or panel.decay[0, a] > FADED)
    return shown


@inner
def record_piece(fl, rec, before, phase, h, kind, event, w):
    """Append a piece; return its index, or -1 when the record is full."""
    n = rec.used[0]
    if n >= rec.phase.size:
        return -1
    rec.phase[n] = before + phase
    rec.duration[n] = h
    rec.kind[n] = kind
    rec.event[n] = event
    turn = turned(phase)
    for i in range(w.size):
        rec.start[n, i] = w[i] + (fl.response[0, 0, i] * turn).real
    for k in range(fl.near.size):
        e, _ = growth(fl.near[k], fl.omega, phase)
        for i in range(w.size):
            rec.start[n, i] += (fl.response[1 + k, 0, i] * e).real
    for a in range(rec.force.shape[1]):
        for i in range(rec.force.shape[2]):
            rec.force[n, a, i] = 0.0
            rec.depth[n, a, i] = 0.0
    rec.used[0] = n + 1
    return n


@inner
def expected_contact(fl, stop, w, phase):
    """Peak penetration, duration and time to release of a free impact through the present state.

    From the energy of the contact spring and the local mobility; a push (positive acceleration
    without speed) counts as an impact as deep as its static penetration. All zero when the stop
    is left at once.
    """
    value, speed, accel, _ = output_derivatives(fl, stop, w, phase, 0.0)
    depth = max(value - fl.stops[stop, GAP], 0.0)
    p = fl.stops[stop, EXPONENT]
    rate = fl.stops[stop, STIFFNESS] * fl.stops[stop, MOBILITY]
    static = (max(accel, 0.0) / rate) ** (1.0 / p)
    energy = 0.5 * speed * speed + rate * (depth ** (p + 1.0) + static ** (p + 1.0)) / (p + 1.0)
    if energy <= 0.0:
        return 0.0, 0.0, 0.0
    top_speed = np.sqrt(2.0 * energy)
    peak = (energy * (p + 1.0) / rate) ** (1.0 / (p + 1.0))
    duration = fl.stops[stop, DURATION] * peak / top_speed
    left = duration * (0.5 + np.arcsin(speed / top_speed) / np.pi)
    if speed >= 0.0 and depth < static:  # pushed in from near rest
        left = duration
    elif speed < 0.0:
        left = min(0.5 * duration, -depth / speed)
    if accel < 0.0 and left > 0.0:
        root = np.sqrt(speed * speed - 2.0 * accel * depth)
        if speed > 0.0:  # a slow touch is turned back by the deceleration
            turned = (speed + root) / -accel
            share = turned / (turned + left)
            left *= share
            duration *= share
            peak *= share
        else:  # (speed + root) / -accel without cancellation, for an acceleration of any size
            left = min(left, 2.0 * depth / (root - speed))
    return peak, duration, left


@inner
def profile_guess(tab, kind, h, peak, duration, left, delta_row):
    """Half-sine penetrations at the nodes to start Newton's method from."""
    for i in range(delta_row.size):
        t = h * tab.chi[kind, i]
        x = np.pi * min((duration - left + t) / duration, 1.0)
        delta_row[i] = max(peak * np.sin(x), 1e-2 * peak)


@inner
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


@inner
def map_fraction(tab, kind, s):
    """Fraction of the panel that belongs to the stretched time s (see `gauss.time_map`)."""
    if kind == 0:
        return s
    if kind == 1:
        left = (1.0 - s) * (1.0 - s)
        return 1.0 - (left if tab.power == 2 else left * left)
    if kind == 2:
        return s * s if tab.power == 2 else s * s * s * s
    if tab.power == 2:
        return 0.5 - 0.5 * np.cos(np.pi * s)
    return s * s * s * s * (35.0 - s * (84.0 - s * (70.0 - 20.0 * s)))


@inner
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


@inner
def parabola(left, right, below, here, above):
    """Slope and curvature, at its middle, of the parabola through values at left, 0 and right."""
    up, on = (below - here) / left, (above - here) / right
    curvature = (on - up) / (right - left)
    return up - curvature * left, curvature


@inner
def minimum_beside(tab, values, places, heights):
    """Where the polynomial through `values` is lowest between three places, and how low."""
    here, here_value = places[1], heights[1]
    left, right = places[0], places[2]
    below, above = heights[0], heights[2]
    for _ in range(3):
        if not left < here < right:
            break
        slope, curvature = parabola(left - here, right - here, below, here_value, above)
        if not curvature > 0.0:
            break
        reach = 0.05 * (right - left)
        here = min(max(here - 0.5 * slope / curvature, left), right)
        left, right = max(here - reach, places[0]), min(here + reach, places[2])
        here_value = interpolate(tab, values, here)
        below, above = interpolate(tab, values, left), interpolate(tab, values, right)
    return here, here_value


@inner
def refined(tab, values):
    """Polynomial through `values` on a grid four times as fine as the nodes."""
    fine = np.empty(tab.fine_grid.size)
    for i in range(fine.size):
        total = 0.0
        for j in range(values.size):
            total += tab.to_fine[i, j] * values[j]
        fine[i] = total
    return fine


@inner
def first_root(tab, values, fine, noise, edge):
    """First s at which the polynomial through `values` falls below -noise, at its end edge, or 2.

    It is looked at on the fine grid, and at the minima between.
    """
    grid = tab.fine_grid
    n = grid.size
    for i in range(1, n):
        below = -1.0
        if fine[i] < (-noise if i < n - 1 else edge):
            below = grid[i]
        elif (
            i < n - 1
            and fine[i - 1] >= fine[i] <= fine[i + 1]
            and fine[i] < 0.5 * max(fine[i - 1], fine[i + 1])  # near zero between the places
        ):
            bottom, value = minimum_beside(tab, values, grid[i - 1 : i + 2], fine[i - 1 : i + 2])
            if value < -noise:
                below = bottom
        if below < 0.0:
            continue
        last = i - 1
        while last > 0 and fine[last] <= 0.0:
            last -= 1
        if fine[last] <= 0.0:
            return 0.5 * below
        low, high = grid[last], below
        above, under = fine[last], interpolate(tab, values, below)
        for step in range(60):
            middle = 0.5 * (low + high)
            if step % 3 != 2:
                middle = low + (high - low) * above / (above - under)
            value = interpolate(tab, values, middle)
            if value > 0.0:
                low, above = middle, value
            else:
                high, under = middle, value
            if high - low <= 1e-6 * high or value == 0.0:
                break
        return high
    return 2.0


@inner
def first_doubt(tab, values, fine, rounding, error):
    """Where the polynomial through `values` first dips to zero within an error, or 2.

    Beside a switch at an end of the panel, where the value is rounding, it must have left that band
    before and leave it behind.
    """
    if fine.min() > 0.1 * fine.max():  # not near zero between the places either
        return 2.0
    last, where = fine.size - 1, 2.0
    came = fine[0] > 100.0 * rounding
    for i in range(1, fine.size):
        came = came or fine[i - 1] > 10.0 * error
        if came and where > 1.0 and i > 1 and fine[i - 2] > fine[i - 1] <= fine[i]:
            heights = fine[i - 2 : i + 1]
            bottom, value = minimum_beside(tab, values, tab.fine_grid[i - 2 : i + 1], heights)
            if abs(value) <= error:
                where = bottom
        left_behind = fine[i] > 10.0 * error or (i == last and fine[i] > 100.0 * rounding)
        if where <= 1.0 and left_behind:
            return where
    return 2.0


@inner
def first_event(fl, tab, kind, phase, w, h, closed, panel, w_end):
    """Stop that first opens or closes within a panel and the fraction of the panel, or (-1, 2).

    With the fraction at which one first comes so near to it that only the state can tell, or 2.
    """
    m = tab.nodes.size
    event, where, doubtful = -1, 2.0, 2.0
    position = -1
    inner = np.empty((1, m))
    values = np.empty(m + 2)
    for s in range(closed.size):
        noise = output_noise(fl, s, w)
        start, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
        end, _, _, _ = output_derivatives(fl, s, w_end, phase + fl.omega * h, 0.0)
        sign = 1.0 if closed[s] else -1.0  # the values are positive as long as nothing happens
        if closed[s]:
            position += 1
            for i in range(m):
                inner[0, i] = panel.output[position, i]
        else:
            node_outputs(fl, tab, kind, phase, w, h, panel, s, inner)
            for i in range(m):
                inner[0, i] = fl.stops[s, GAP] - inner[0, i]
        values[0], values[m + 1] = (
            sign * (start - fl.stops[s, GAP]),
            sign * (end - fl.stops[s, GAP]),
        )
        for i in range(m):
            values[i + 1] = inner[0, i]
        fine = refined(tab, values)
        tail = 4.0 * legendre_tail(tab, inner, 0)
        below, edge = noise + tail, 0.0
        if sign * speed > 0.0:  # the panel may begin a little before the event that it begins with
            below += 2.0 * max(-values[0], 0.0)
            edge = min(2.0 * values[0], 0.0)
        root = first_root(tab, values, fine, below, edge)
        if root <= 1.0:
            fraction = map_fraction(tab, kind, root)
            if fraction < where:
                event, where = s, fraction
        elif tail > 10.0 * noise:
            low = first_doubt(tab, values, fine, noise, tail)
            if low < 1.0:
                doubtful = min(doubtful, map_fraction(tab, kind, low))
    return event, where, doubtful if doubtful < where else 2.0


@inner
def node_outputs(fl, tab, kind, phase, w, h, panel, out, values):
    """Fill an output at the nodes of a panel, (1, m), with the forces at work."""
    m = tab.nodes.size
    driven = np.empty(w.size)
    for i in range(m):
        t = h * tab.chi[kind, i]
        for k in range(w.size):
            driven[k] = w[k]
        for a in range(panel.active.size):
            for k in range(w.size):
                for j in range(m):
                    z = h * tab.integrate[kind, i, j] * panel.F[a, j]
                    driven[k] -= z * panel.back[a, k, j]
        values[0, i] = free_output(fl, out, driven, t) + forced_output(
            fl, out, phase + fl.omega * t
        )


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
def creep(fl, stop, w, phase, duration):
    """Depth and speed of a body that creeps out of a stop, its speed held by the damping, or zeros.

    So it does where an elastic contact would take much longer than the damping to act.
    """
    if fl.laws[stop] != 0 or fl.stops[stop, DISSIPATION] == 0.0:
        return 0.0, 0.0
    value, speed, _, _ = output_derivatives(fl, stop, w, phase, 0.0)
    depth = value - fl.stops[stop, GAP]
    if speed >= 0.0 or depth <= 0.0:
        return 0.0, 0.0
    _, _, viscosity = law(fl, stop, depth, speed)
    if viscosity * fl.stops[stop, MOBILITY] * duration < CREEP:
        return 0.0, 0.0
    return depth, speed


@inner
def guess_panel(fl, tab, phase, w, h, h_mapped, start_switch, panel):
    """Choose the kind and length of a panel and guess its penetrations.

    h bounds the length, h_mapped that of a panel that is to end with a release.

    A contact is covered by two panels, so that no panel has to resolve more than a quarter wave.
    """
    active, delta = panel.active, panel.output
    ends = False
    length = h
    for a in range(active.size):
        _, duration, left = expected_contact(fl, active[a], w, phase)
        depth, speed = creep(fl, active[a], w, phase, duration)
        if depth > 0.0:
            if -0.5 * depth / speed < length:
                ends = False
                length = -0.5 * depth / speed
        elif left > min(0.6 * duration, h_mapped):
            if 0.5 * left < length:
                ends = False
                length = 0.5 * left
        elif left < length:
            ends = True
            length = left
    kind = 2 * start_switch + (1 if ends else 0)
    for a in range(active.size):
        peak, duration, left = expected_contact(fl, active[a], w, phase)
        depth, speed = creep(fl, active[a], w, phase, duration)
        if depth > 0.0:
            for i in range(tab.nodes.size):
                later = depth + speed * length * tab.chi[kind, i]
                delta[a, i] = max(later, 1e-3 * depth)
        elif duration > 0.0:
            profile_guess(tab, kind, length, peak, duration, left, delta[a])
        else:
            for i in range(tab.nodes.size):
                delta[a, i] = 0.0
    return kind, length


@inner
def remembered_panel(rec, start_switch, h_max, panel):
    """Kind, length and event of the same panel of the motion before, or (-1, 0, -1).

    Fills the penetrations.
    """
    n = rec.used[0]
    if n >= rec.used[1] or rec.kind[n] == FLIGHT or rec.kind[n] // 2 != start_switch:
        return -1, 0.0, -1
    for a in range(panel.active.size):
        for i in range(panel.F.shape[1]):
            panel.output[a, i] = rec.depth[n, panel.active[a], i]
        if largest(panel.output, a) == 0.0:
            return -1, 0.0, -1
    kind, h, event = rec.kind[n], rec.duration[n], rec.event[n]
    if h > h_max or (event < 0 and h > 0.98 * h_max):
        return kind, h_max, -1
    return kind, h, event


@inner
def keep_profile(tab, kind, new_kind, ratio, panel, guess):
    """Carry all penetrations over to a panel `ratio` times as long."""
    for a in range(panel.active.size):
        stretch_profile(tab, kind, new_kind, ratio, panel.output[a], guess)
        top = 0.0
        for i in range(guess.size):
            top = max(top, guess[i])
        for i in range(guess.size):
            panel.output[a, i] = max(guess[i], 1e-3 * top)


@inner
def time_to_event(fl, stop, closed, w, phase):
    """Time (of either sign) to the instant at which a stop opens or closes in flight, or inf.

    The nearer root of the parabola through the present; inf where the gap changes the wrong way.
    """
    always_inline()
    value, speed, accel, _ = output_derivatives(fl, stop, w, phase, 0.0)
    value -= fl.stops[stop, GAP]
    if (speed >= 0.0) if closed else (speed <= 0.0):
        return np.inf
    square = speed * speed - 2.0 * accel * value
    root = math.sqrt(square) if square > 0.0 else abs(speed)
    return -2.0 * value / (speed + math.copysign(root, speed))


@inner
def coarsest_instant(fl):
    """Largest error allowed in the instant of an event, as a share of a panel."""
    found = 0.0
    for s in range(fl.stops.shape[0]):
        found = max(found, fl.stops[s, INSTANT])
    return found


@inner
def at_switch(fl, stop, w, phase, allowed):
    """Whether a stop is just at its surface, to within a time allowed or rounding."""
    value, speed, _, _ = output_derivatives(fl, stop, w, phase, 0.0)
    reach = allowed * abs(speed) + 10.0 * output_noise(fl, stop, w)
    return abs(value - fl.stops[stop, GAP]) <= reach


@inner
def with_event(fl, stop, w, phase, allowed, closed):
    """Whether a stop is to open or close now, to within a time allowed or rounding."""
    if not at_switch(fl, stop, w, phase, allowed):
        return False
    _, speed, _, _ = output_derivatives(fl, stop, w, phase, 0.0)
    return closed[stop] != (speed > 0.0)


@inner
def instant_with(fl, aim, w, phase, h, closed):
    """Error allowed in the instant at which a stop and others with it open or close."""
    allowed = fl.stops[aim, INSTANT] * h
    for s in range(closed.size):
        share = fl.stops[s, INSTANT] * h
        if share < allowed and with_event(fl, s, w, phase, 10.0 * coarsest_instant(fl) * h, closed):
            allowed = share
    return allowed


@inner
def stop_at_switch(fl, w, phase, h, closed):
    """Stop that is to open or close now, to within a share of a length h of time, or -1."""
    stop, nearest = -1, np.inf
    allowed = 10.0 * coarsest_instant(fl) * h
    for s in range(closed.size):
        late = abs(time_to_event(fl, s, closed[s], w, phase))
        gap = abs(distance(fl, s, w, phase))
        here = late <= allowed or gap <= 10.0 * output_noise(fl, s, w)
        if late < nearest and here:
            stop, nearest = s, late
    return stop


@inner
def graded_length(fl, active, w, phase, h, sign, switched, event):
    """Longest panel on which the slopes of stops that closed a little before (sign 1) are smooth.

    With sign -1 the same at the end of a panel, of stops that open a little after it, `event` left
    out. A law with a power that is not whole is singular at its switch; at a distance τ from it,
    4 τ is a length on which Legendre coefficients fall by 2.6 from one to the next (Bernstein's
    ellipse). Where a map has its nodes crowded there (switched), a switch within the error allowed
    in its instant does not count.
    """
    longest = np.inf
    for a in range(active.size):
        s = active[a]
        if s == event or not singular_slope(fl, s):
            continue
        value, speed, accel, _ = output_derivatives(fl, s, w, phase, 0.0)
        delta = value - fl.stops[s, GAP]
        if delta <= 10.0 * output_noise(fl, s, w):
            continue
        if accel > 0.0 and speed * speed < 2.0 * accel * delta:  # it nearly opens: a complex pair
            away = math.sqrt(2.0 * delta / accel)
        elif sign * speed > 0.0:
            away = delta / abs(speed)
        else:
            continue
        if not switched or away > 10.0 * fl.stops[s, INSTANT] * h:
            longest = min(longest, 4.0 * away)
    return longest


@inner
def far_off(fl, phase, w, h, tried, panel, event, where):
    """Whether a panel holds another solution of the force laws than the motion.

    It opens a stop at once that is not about to, or lets one feed as much as it should damp.
    """
    if event < 0:
        return not panel.decay[1].min() > -DECAY
    allowed = 10.0 * coarsest_instant(fl) * h
    return not (h * where > 1e-12 * tried or at_switch(fl, event, w, phase, allowed))


@inner
def contact_panel(fl, tab, phase, w, h_max, h_mapped, start_switch, closed, panel, w_end, rec):
    """Solve one panel and choose its length, at most h_max, and h_mapped to aim at an event.

    Returns (status, kind, h, event): a panel that ends where stop `event` opens or closes, or
    (event = -1) one short enough to be resolved.
    """
    active = panel.active
    panel.kept[0] = False
    guess = np.empty(tab.nodes.size)
    rounding = np.empty(panel.output.shape[0])
    for a in range(active.size):
        rounding[a] = output_noise(fl, active[a], w)  # events are found in the state
    for o in range(active.size, rounding.size):
        rounding[o] = rate_noise(fl, active[o - active.size], w)
    noise = rounding.copy()
    smooth, switch = 2 * start_switch, 2 * start_switch + 1
    limit = h_max
    kind, h, aim = remembered_panel(rec, start_switch, h_max, panel)
    if kind < 0:
        kind, h = guess_panel(fl, tab, phase, w, limit, h_mapped, start_switch, panel)
    graded = graded_length(fl, active, w, phase, h, 1.0, start_switch == 1, -1)
    if h > 1.5 * graded:
        aim = -1
        kind, h = guess_panel(fl, tab, phase, w, graded, h_mapped, start_switch, panel)
    tried = h
    looked = False
    for attempt in range(100):
        if h <= 1e-16 * tried or phase + fl.omega * h == phase:
            if aim < 0 or not at_switch(fl, aim, w, phase, 10.0 * coarsest_instant(fl) * tried):
                aim = stop_at_switch(fl, w, phase, tried, closed)
            return OK if aim >= 0 else CONTACT_FAILED, kind, 0.0, aim
        for a in range(active.size):
            more = carried_noise(fl, active[a], w, phase, panel.depth[0, a], h)
            panel.depth[3, a] = panel.depth[1, a] + more
            noise[a] = min(panel.depth[3, a], rounding[a])
        found = solve_panel(fl, tab, kind, phase, w, h, noise, panel)
        if found:
            decays = shows_decay(fl, tab, kind, h, panel)
            panel_end(fl, tab, kind, phase, w, h, panel, w_end)
            event, where, doubtful = first_event(
                fl, tab, kind, phase, w, h, closed, panel, w_end
            )
            found = not far_off(fl, phase, w, h, tried, panel, event, where)
        if not found:
            limit = 0.4 * min(h, tried)
            aim = -1
            kind, h = guess_panel(fl, tab, phase, w, limit, h_mapped, start_switch, panel)
            tried = h
            continue
        end_phase = phase + fl.omega * h
        fine = decays and resolved(fl, tab, kind, h, rounding, panel)
        if fine:
            to_switch = kind % 2 == 1
            fine = h <= 1.5 * graded_length(
                fl, active, w_end, end_phase, h, -1.0, to_switch, aim if to_switch else -1
            )
        if 1e-6 < doubtful < 1.0 - 1e-6 and not looked:  # the state at the end of a panel is exact
            looked = True
            keep_profile(tab, kind, smooth, doubtful, panel, guess)
            kind, aim = smooth, -1
            h *= doubtful
            continue
        near_end = 1e-3
        if event >= 0 and event != aim:  # so near that `switch_with` will find it
            near_end = max(min(5.0 * fl.stops[event, INSTANT], 1e-7), 1e-12)
        at_end = where > 1.0 - near_end
        lost = attempt % 20 == 19  # the instant that is aimed at goes to and fro
        if event >= 0 and (aim < 0 or not at_end) and not lost:
            goal = switch
            aim = event
            if h * where > h_mapped:  # half the way first
                goal, aim, where = smooth, -1, 0.5 * where
            keep_profile(tab, kind, goal, where, panel, guess)
            kind = goal
            h *= where
            continue
        if aim < 0 and kind % 2 == 1 and h < h_max:  # a release was expected here: follow it
            for a in range(active.size):
                if (
                    aim < 0
                    and time_to_event(fl, active[a], closed[active[a]], w_end, end_phase) < h
                ):
                    aim = active[a]
        if aim >= 0 and not lost:
            dh = time_to_event(fl, aim, closed[aim], w_end, end_phase)
            if abs(dh) <= instant_with(fl, aim, w_end, end_phase, h, closed) or (
                dh < np.inf and abs(distance(fl, aim, w_end, end_phase)) <= output_noise(fl, aim, w)
            ):
                if fine:
                    return OK, kind, h, aim
            elif -0.5 * h < dh < h and (dh < 0.0 or h < h_max):
                h = min(h + dh, h_max)
                continue
            elif dh > 0.0 and fine:  # the contact goes on
                return OK, kind, h, -1
        elif fine and not lost:
            return OK, kind, h, -1
        aim = -1
        keep_profile(tab, kind, smooth, 0.5, panel, guess)
        kind = smooth
        h *= 0.5
    return CONTACT_FAILED, kind, h, -1


@inner
def lost_to_rounding(fl, stop, w, peak, noise):
    """Share of the speed at a stop that rounding of the penetration costs in a contact so deep."""
    if peak <= 0.0:
        return 0.0
    p = fl.stops[stop, EXPONENT]
    rate = fl.stops[stop, STIFFNESS] * fl.stops[stop, MOBILITY]
    impact_speed = math.sqrt(2.0 * rate * peak ** (p + 1.0) / (p + 1.0))
    speed = impact_speed + output_size(fl, stop, w, 0) * fl.omega
    for j in range(w.size):
        speed += abs(fl.rows[1, stop, j] * w[j])
    return noise / peak * impact_speed / speed


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
    add_growth(fl.near, fl.response, fl.omega, phase, -1.0, w, columns)
    closed = np.zeros(n_stops, dtype=np.bool_)
    for s in range(n_stops):
        value, speed, _, _ = output_derivatives(fl, s, w, phase, 0.0)
        left = output_noise(fl, s, w) if speed < 0.0 else 0.0  # it opens at this instant
        closed[s] = value - fl.stops[s, GAP] > left
    pushes = np.full(n_stops, np.nan)
    status = run_pieces(
        fl, tab, w, columns, phase, before, duration, closed, closings, with_columns, rec,
        recording, pushes,
    )  # fmt: skip
    end_phase = phase + fl.omega * duration
    turn = turned(end_phase)
    rate = np.zeros(size)
    add_rates(fl.blocks, w, rate)
    for s in range(n_stops):
        value, speed, _, _ = output_derivatives(fl, s, w, end_phase, 0.0)
        force, _, _ = law(fl, s, value - fl.stops[s, GAP], speed)
        if not np.isnan(pushes[s]):
            force = pushes[s]
        for i in range(size):
            rate[i] -= fl.force[i, s] * force
    add_growth(fl.near, fl.response, fl.omega, end_phase, 1.0, w, columns)
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


@inner
def switch_with(fl, w, phase, h, closed, closings):
    """Open and close the stops that do so at the very instant of another one's event.

    Each to the small share of the length h of the panel before it to which it must be known.
    """
    for s in range(closed.size):
        if with_event(fl, s, w, phase, 10.0 * fl.stops[s, INSTANT] * h, closed):
            closed[s] = not closed[s]
            if closed[s]:
                closings[s] += 1


@inlined
def run_pieces(
    fl, tab, w, columns, phase, before, duration, closed, closings, with_columns, rec, recording,
    pushes,
):  # fmt: skip
    """Advance w and its sensitivities in place over a segment, piece by piece.

    `before` is the phase of the whole turns before it, which only the record shows. `pushes`
    (n_stops,) is filled with the forces at the end of stops that damp so strongly that they cannot
    be told from the state there.
    """
    m = tab.nodes.size
    n_stops = closed.size
    fastest = fastest_moved(fl.blocks, fl.force)
    # lengths of panels that resolve the fastest mode: the maps spread the nodes at one end
    h_even = fl.node_angle * m / fastest if fastest > 0.0 else np.inf
    h_mapped = 0.75 * h_even / tab.power
    panel = new_panel(fl, m, w.size, np.empty(0, dtype=np.int64))
    # 1.6e-11 periods of the excitation or of the fastest mode, but more than rounding of the time
    shortest = max(1e-10 / max(fastest, fl.omega), 1e-15 * duration)
    t = 0.0
    start_switch = 1 if duration < 0.0 else 0  # written so that one version is compiled, not two
    skip = 0.0
    flight, none = (FLIGHT, -1) if duration >= 0.0 else (0, 0)  # as above
    w_end = np.empty(w.size)
    # penetrations that are carried from panel to panel, and their rounding errors
    depth, doubt = np.zeros(n_stops), np.full(n_stops, np.inf)
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
            first, stop = remain, none
            for s in range(n_stops):
                at = closing_time(fl, s, w, here, skip, first, shortest)
                if at < 0.0:
                    return TOO_MANY_STEPS
                if at < first:
                    first, stop = at, s
            if recording and record_piece(fl, rec, before, here, first, flight, stop, w) < 0:
                return RECORD_FULL
            fly_state(fl.blocks, w, first)
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
        active = active[:n_active]
        if not same_stops(active, panel.active):
            panel = new_panel(fl, m, w.size, active)
        if n_active == 1 and start_switch == 1:
            peak, _, left = expected_contact(fl, active[0], w, here)
            noise = output_noise(fl, active[0], w)
            if lost_to_rounding(fl, active[0], w, peak, noise) > WORST_ROUNDING:
                return ROUNDED
            if peak <= 100.0 * noise:  # a touch without force
                closed[active[0]] = False
                closings[active[0]] -= 1
                start_switch, skip = 0, max(left, shortest)
                continue
        h_max = min(remain, h_mapped if start_switch == 1 else h_even)
        for a in range(n_active):
            noise = output_noise(fl, active[a], w)
            if doubt[active[a]] >= noise:  # the state knows it as well
                value = distance(fl, active[a], w, here)
                begins = start_switch == 1 and abs(value) <= noise
                depth[active[a]] = 0.0 if begins else value
                doubt[active[a]] = 0.0 if begins else noise
            panel.depth[0, a], panel.depth[1, a] = depth[active[a]], doubt[active[a]]
        status, kind, h, event = contact_panel(
            fl, tab, here, w, h_max, h_mapped, start_switch, closed, panel, w_end, rec
        )
        if status != OK:
            return status
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
                if 1e-16 * panel.decay[1, a] > WORST_ROUNDING:
                    return ROUNDED
                panel.decay[0, a] += panel.decay[1, a]
                if panel.decay[1, a] > DECAY:
                    pushes[active[a]] = at_end(tab, panel.F, a)
            if with_columns:
                panel_columns(fl, tab, kind, here, t, h, panel, columns)
            for k in range(w.size):
                w[k] = w_end[k]
            t = duration if h >= remain else t + h
            for a in range(n_active):
                depth[active[a]], doubt[active[a]] = panel.depth[2, a], panel.depth[3, a]
        start_switch = 0
        if event >= 0:
            panel.decay[:] = 0.0
            closed[event] = not closed[event]
            start_switch = 1
            if closed[event]:
                closings[event] += 1
            switch_with(fl, w, phase + fl.omega * t, h, closed, closings)
            skip = shortest if h < shortest else 0.0
    return TOO_MANY_PIECES


@inner
def near_rate(block, omega):
    """Eigenvalue λ of a block with |λ - iω| < NEAR ω, or zero."""
    mean = 0.5 * (block[0, 0] + block[1, 1])
    half = 0.5 * (block[0, 0] - block[1, 1])
    square = half * half + block[0, 1] * block[1, 0]
    rate = math.sqrt(abs(square))
    near = square < 0.0 and math.hypot(mean, rate - omega) < NEAR * omega
    return complex(mean, rate) if near else complex(0.0, 0.0)


@inner
def respond(blocks, omega, x, row, response):
    """Fill a row of `FlowData.response` with what an excitation x (2n,) brings about.

    That is (iω - A)⁻¹ x, but for a block with a near eigenvalue λ. There x falls into its parts
    along the two eigenvectors: that of λ is the drive of the growth, that of its conjugate has a
    steady response.
    """
    k = 0
    for b in range(blocks.shape[0]):
        block = blocks[b]
        i, j = 2 * b, 2 * b + 1
        u, v = x[i], x[j]
        rate = near_rate(block, omega)
        if rate.imag > 0.0:
            k += 1
            half = 0.5 * (block[0, 0] - block[1, 1])
            p = 0.5 * u - 0.5j * (half * u + block[0, 1] * v) / rate.imag
            q = 0.5 * v - 0.5j * (block[1, 0] * u - half * v) / rate.imag
            for c in range(x.size):
                response[k, row, c] = 0.0
            response[k, row, i], response[k, row, j] = p, q
            away = complex(-rate.real, omega + rate.imag)
            response[0, row, i], response[0, row, j] = (u - p) / away, (v - q) / away
        else:
            m00, m01 = 1j * omega - block[0, 0], -block[0, 1]
            m10, m11 = -block[1, 0], 1j * omega - block[1, 1]
            det = m00 * m11 - m01 * m10
            response[0, row, i] = (m11 * u - m01 * v) / det
            response[0, row, j] = (m00 * v - m10 * u) / det


@inner
def at_frequency(system, omega, parameters, drive_by):
    """Numbers of the system at an excitation frequency (rad/s), see `shoot`."""
    blocks, rows, drive = system.blocks, system.rows, system.drive
    near = np.empty(blocks.shape[0], dtype=np.complex128)
    k = 0
    for b in range(blocks.shape[0]):
        near[k] = near_rate(blocks[b], omega)
        if near[k].imag > 0.0:
            k += 1
    x = np.empty(drive.shape[1], dtype=np.complex128)
    response = np.empty((1 + k, 2 + parameters.shape[0], x.size), dtype=np.complex128)
    for row in range(response.shape[1]):
        for i in range(x.size):
            if row == 0:
                x[i] = drive[0, i] + omega * omega * drive[1, i]
            elif row == 1:
                x[i] = 2.0 * omega * drive[1, i] - 1j * response[0, 0, i]
            else:
                x[i] = drive_by[row - 2, 0, i] + omega * omega * drive_by[row - 2, 1, i]
        respond(blocks, omega, x, row, response)
    forced = np.zeros((1 + k, response.shape[1], rows.shape[1]), dtype=np.complex128)
    for p in range(1 + k):
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
        near[:k],
        response,
        forced,
        parameters,
        omega,
        system.tail,
        system.node_angle,
    )


@inlined
def shoot(
    system, tab, rec, recording, omega, nodes, phases, chained, with_columns, parameters, drive_by
):
    """Propagate each node (k, 2n) to the next phase; see `propagate` for what comes back.

    When `chained`, only the first node is used and each segment starts where the last one ended.
    Derivatives are also taken with respect to parameters (n, 2), see `FlowData`; drive_by
    (n, 2, 2n) is the derivative of `SystemData.drive` with respect to each.
    """
    fl = at_frequency(system, omega, parameters, drive_by)
    k = phases.size - 1
    size = nodes.shape[1]
    ends = np.zeros((k, size))
    kept = k if with_columns else 1
    jacobians = np.zeros((kept, size, size))
    d_omegas = np.zeros((kept, size))
    d_parameters = np.zeros((kept, size, parameters.shape[0]))
    closings = np.zeros(system.stops.shape[0], dtype=np.int64)
    rec.used[1] = rec.used[0] if recording else 0
    rec.used[0] = 0
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
    return ends, jacobians, d_omegas, d_parameters, closings, status


class Corrector(NamedTuple):
    """What Newton's method for the shooting equations needs to know.

    Parameters
    ----------
    row, level : (N + 1,), float
        The plane ``row @ point = level`` on which to stay.
    state_weight : float
        Weight of a state's square in the squared length of a step (that of ln ω is 1).
    rtol : float
        Longest last step.
    longest : float
        Longest first step: a longer one means failure.
    max_iterations : int
        Most steps; none means the flow map alone.
    """

    row: NDArray[np.float64]
    level: float
    state_weight: float
    rtol: float
    longest: float
    max_iterations: int


@resting_on(njit(cache=True, nogil=True, error_model="numpy"), nearness.__file__)
def newton(
    system, tab, rec, recording, omega, point, phases, chained, with_columns, parameters, drive_by,
    corrector,
):  # fmt: skip
    """Newton's method for the shooting equations on a plane, in place, or the flow map alone.

    All compiled work begins here, since a second entry would be compiled anew.

    Parameters
    ----------
    system, tab, rec, recording : SystemData, GaussTables, Record, bool
        See `propagate`.
    omega : float
        Excitation frequency, of the flow map alone.
    point : (N + 1,)
        States at the k phases and ln ω; the guess, then the solution.
    phases : (k + 1,)
        Forcing phases of the segment ends.
    chained, with_columns, parameters, drive_by
        See `shoot`.
    corrector : Corrector
        The plane and when to stop.

    Returns
    -------
    outcome : int
        `OK`, `DIVERGED`, `SINGULAR`, `NOT_CONVERGED` or why the flow map failed.
    iterations : int
    first, last : float
        Lengths of the first and the last step.
    along : (N + 1,)
        Vector along the branch, of no particular length.
    ends, jacobians, d_omegas, d_parameters, closings
        What `shoot` gives at the point before the last step, where the record is from, too.
    """
    row, max_iterations = corrector.row, corrector.max_iterations
    k = phases.size - 1
    size = 2 * system.blocks.shape[0]
    unknowns = point.size
    equations = unknowns if max_iterations > 0 else 0
    matrix = np.empty((equations, equations))
    sides = np.empty((equations, 2))
    order = np.empty(equations, dtype=np.int64)
    nodes = np.empty((unknowns // size, size))
    along = np.zeros(unknowns)
    first, last = np.inf, np.inf
    outcome = NOT_CONVERGED
    iteration = 0
    known = np.full((k, size, size), np.inf)
    while True:
        iteration += 1
        if max_iterations > 0:
            omega = math.exp(point[unknowns - 1])
        for i in range(unknowns - 1):
            nodes[i // size, i % size] = point[i]
        ends, jacobians, d_omegas, d_parameters, closings, status = shoot(
            system, tab, rec, recording, omega, nodes, phases, chained, with_columns,
            parameters, drive_by,
        )  # fmt: skip
        if status != OK or max_iterations == 0:
            outcome = status
            break
        for i in range(unknowns):
            sides[i, 0], sides[i, 1] = 0.0, 0.0
            for j in range(unknowns):
                matrix[i, j] = 0.0
        for s in range(k):
            following = (s + 1) % k
            for i in range(size):
                r = s * size + i
                sides[r, 0] = nodes[following, i] - ends[s, i]
                matrix[r, following * size + i] -= 1.0
                for j in range(size):
                    matrix[r, s * size + j] += jacobians[s, i, j]
                matrix[r, unknowns - 1] = omega * d_omegas[s, i]
        opening = 0.0
        for i in range(unknowns - 1):
            opening += corrector.state_weight * sides[i, 0] ** 2
        opening = math.sqrt(opening)
        noise = NOISE * np.abs(jacobians).max()
        sides[unknowns - 1, 0] = corrector.level
        for j in range(unknowns):
            matrix[unknowns - 1, j] = row[j]
            sides[unknowns - 1, 0] -= row[j] * point[j]
        sides[unknowns - 1, 1] = 1.0
        lu_factor(matrix, order)
        lu_apply(matrix, order, sides)
        before = last
        length = sides[unknowns - 1, 0] ** 2
        for i in range(unknowns - 1):
            length += corrector.state_weight * sides[i, 0] ** 2
        last = math.sqrt(length)
        if iteration == 1:
            first = last
        if not np.isfinite(last):
            outcome = SINGULAR
            break
        longest = corrector.longest if iteration == 1 else 1e3
        if last >= longest or abs(sides[unknowns - 1, 0]) >= 0.5:
            outcome = DIVERGED
            break
        for i in range(unknowns):
            point[i] += sides[i, 0]
            along[i] = sides[i, 1]
        converged = last <= corrector.rtol and opening <= max(OPEN, noise)
        # the rounding level, or steps to and fro where there is no orbit, across a sharp touch
        stagnant = last < 1e-8 and last > 0.5 * before and opening <= max(OPEN, noise)
        if stagnant and opening > max(NOISE, noise):
            stagnant = np.abs(jacobians - known).max() <= STEADY * np.abs(jacobians).max()
        known = jacobians
        if converged or stagnant:
            outcome = OK
            break
        if iteration == max_iterations:
            break
        if last > 0.5 * before:  # panels that change with what is remembered may keep it going
            rec.used[0] = 0
    return (
        outcome, iteration, first, last, along, ends, jacobians, d_omegas, d_parameters, closings
    )  # fmt: skip
