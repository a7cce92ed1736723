"""Whether a panel resolves the contact, and where what it shows changes its sign."""

from __future__ import annotations

import math

import numpy as np

from nldyn.base.arrays import TINY
from nldyn.flow.kernels.compiling import allocating, inner
from nldyn.flow.kernels.law import is_bond, is_rigid, singular_slope
from nldyn.flow.kernels.layout import (
    BLIND,
    DECAY,
    EXPONENT,
    FADED,
    HALF_CONTACT,
    KICK,
    MAPPED,
    MOBILITY,
    REST_TAIL,
    ROUND,
    SHARP_TAIL,
)

SHALLOW = 16.0  # a lowest point less than so a part of the curvature high all but opens the stop
DAMPED_TAIL = 0.01  # of the usual one, where a stop damps strongly
REACH = 0.05  # of the interval: where the next parabola's places lie beside its lowest point
CLEAR = 0.1  # of the largest: a lowest value above it is not near zero between the places either
PLACED = 1e-6  # relative: error of the place where a panel is to be cut


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
def at_start(tab, values, a):
    """Its value at the start, where Legendre's polynomials alternate."""
    total, sign = 0.0, 1.0
    for degree in range(tab.nodes.size):
        total += sign * legendre_coefficient(tab, values, a, degree)
        sign = -sign
    return total


@inner
def slope_at_end(tab, values, a):
    """Its slope at the end over the stretched time of a panel: n (n + 1) of each of Legendre's."""
    total = 0.0
    for degree in range(tab.nodes.size):
        total += degree * (degree + 1) * legendre_coefficient(tab, values, a, degree)
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
                if noise < lowest < curvature / SHALLOW:
                    return True
    return False


@allocating
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
        if not is_rigid(fl, panel.active[a]):
            stiffness += fl.stops[panel.active[a], MOBILITY] * largest(panel.slope, a)
    longest = fl.node_angle * tab.nodes.size * (1.0 if kind == 0 else MAPPED / tab.power)
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
        goal = fl.tail if panel.decay[1, a] <= DECAY else DAMPED_TAIL * fl.tail  # see `hold`
        if 1.0 < fl.stops[panel.active[a], EXPONENT] < ROUND:
            goal *= SHARP_TAIL
        if is_rigid(fl, panel.active[a]):
            goal *= REST_TAIL
        floor = BLIND * noise[a] / deepest
        tail = max(goal * fl.tail / forced[a], floor)
        shake = 0.0  # of the force by rounding: terms of a bond cancel where it is at rest
        if is_bond(fl, panel.active[a]):
            shake = BLIND * noise[a] * largest(panel.slope, a)
        if o < na < slopes.shape[0]:
            shake += BLIND * noise[na + a] * largest(panel.slope, na + a)
        if o < na and legendre_tail(tab, panel.F, a) > tail * largest(panel.F, a) + shake:
            return False
        shake *= fl.stops[panel.active[a], EXPONENT] / deepest * largest(tab.slope, kind)
        size = largest(slopes, o)
        if o >= na and largest(panel.output, o) > 0.0:  # by speed: its share in the force counts
            size = max(size, largest(panel.F, a) / largest(panel.output, o))
        kick = 1.0
        if o < na and not is_rigid(fl, panel.active[a]):
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
    worst, mobility = 0.0, TINY
    for b in range(fl.blocks.shape[0]):
        tail, size, share = 0.0, TINY, 0.0
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
        reach = REACH * (right - left)
        here = min(max(here - 0.5 * slope / curvature, left), right)
        left, right = max(here - reach, places[0]), min(here + reach, places[2])
        here_value = interpolate(tab, values, here)
        below, above = interpolate(tab, values, left), interpolate(tab, values, right)
    return here, here_value


@allocating
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
            if high - low <= PLACED * high or value == 0.0:
                break
        return high
    return 2.0


@inner
def first_doubt(tab, values, fine, rounding, error):
    """Where the polynomial through `values` first dips to zero within an error, or 2.

    Beside a switch at an end of the panel, where the value is rounding, it must have left that band
    before and leave it behind.
    """
    if fine.min() > CLEAR * fine.max():  # not near zero between the places either
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
