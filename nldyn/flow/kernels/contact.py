"""The course of a contact, panel after panel."""

from __future__ import annotations

import math

import numpy as np

from nldyn.flow.kernels.compiling import allocating, always_inline, inner
from nldyn.flow.kernels.flights import (
    carried_noise,
    output_derivatives,
    output_noise,
    output_size,
    rate_noise,
)
from nldyn.flow.kernels.law import (
    depends_on_speed,
    is_bond,
    is_rigid,
    law,
    never_pulls,
    singular_slope,
)
from nldyn.flow.kernels.layout import (
    BLIND,
    CONTACT_FAILED,
    CREEP,
    DASHPOT,
    DECAY,
    DURATION,
    EXPONENT,
    FIRST_POWER,
    FLIGHT,
    GAP,
    HALF_ULP,
    INSTANT,
    MOBILITY,
    OK,
    RELEASE,
    RELEASED,
    STIFFNESS,
    SUM_ROUNDING,
)
from nldyn.flow.kernels.panel import node_outputs, panel_end, solve_panel
from nldyn.flow.kernels.resolution import (
    at_end,
    at_start,
    first_doubt,
    first_root,
    interpolate,
    largest,
    legendre_tail,
    map_fraction,
    refined,
    resolved,
    shows_decay,
    slope_at_end,
)

LEAST_GUESS = 0.01  # of the peak: penetrations of a first guess where the sine begins and ends
LEAST_STRAIN = 1e-30  # Legendre tail of a force that a longer panel resolves as well
SAFETY = 0.9  # of the length that the tail allows the next panel
LEAST_GROWTH, MOST_GROWTH = 0.5, 1.6  # of a panel's length after the one before
MOST_LEFT = 0.6  # of a contact that one panel takes to its end; more of it is halved
ALL_BUT = 0.98  # of the time left: a known panel without an event that fills it ends with it
PRESSING_ROUNDING = 1e-14  # of its terms: the acceleration against which a rigid stop presses
AT_ONCE = 1e-12  # of a panel: so near its start, an event happens there
SHORTER = 0.4  # of a panel that was not solved: the next one tried
NEAR_END = 1e-3  # of a panel: an event that it aims at and that happens so near its end
INSTANTS, FARTHEST_END = 5.0, 1e-7  # the same of another event: in errors of its instant, at most
MISSED = 0.01  # of the panel first tried: no event in one so short means that it is farther off,
FARTHER = 10.0  # and the next panel is so many times longer
SMALLEST = 1e-3  # of the largest: a penetration that is guessed where none is expected
WITHIN = 1e-6  # of a panel: a doubtful place nearer to an end than so is that of a known switch


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
        delta_row[i] = max(peak * np.sin(x), LEAST_GUESS * peak)


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
def watched(fl, stop, closed, w, phase):
    """The output that tells when a stop opens or closes, by passing its gap.

    That is the penetration or, of one that never pulls and is penetrated, what its force goes with.
    """
    if never_pulls(fl, stop):
        if closed[stop]:
            return int(fl.stops[stop, RELEASE])
        value, _, _, _ = output_derivatives(fl, stop, w, phase, 0.0)
        if value - fl.stops[stop, GAP] > 10.0 * output_noise(fl, stop, w):
            return int(fl.stops[stop, RELEASE])
    return stop


@inner
def watched_pace(fl, stop, closed, w, phase):
    """What that output exceeds the gap by, and its first two rates, the first with all forces.

    The second leaves the forces out.
    """
    out = watched(fl, stop, closed, w, phase)
    value, speed, accel, _ = output_derivatives(fl, out, w, phase, 0.0)
    if out != stop:
        for s in range(closed.size):
            if closed[s]:
                depth, rate, _, _ = output_derivatives(fl, s, w, phase, 0.0)
                force, _, _ = law(fl, s, depth - fl.stops[s, GAP], rate)
                for k in range(w.size):
                    speed -= fl.rows[0, out, k] * fl.force[k, s] * force
        accel = 0.0
    return value - fl.stops[stop, GAP], speed, accel


@allocating
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
        if is_bond(fl, s):
            position += 1
            continue
        out = watched(fl, s, closed, w, phase)
        noise = output_noise(fl, out, w)
        start, speed, _, _ = output_derivatives(fl, out, w, phase, 0.0)
        end, _, _, _ = output_derivatives(fl, out, w_end, phase + fl.omega * h, 0.0)
        sign = 1.0 if closed[s] else -1.0  # the values are positive as long as nothing happens
        if closed[s]:
            position += 1
            for i in range(m):
                inner[0, i] = panel.output[position, i]
            if out != s:
                creep_time = fl.stops[s, DASHPOT] / fl.stops[s, STIFFNESS]
                for i in range(m):
                    inner[0, i] += creep_time * panel.output[panel.active.size + position, i]
            if is_rigid(fl, s):
                noise, speed = pressing_noise(fl, s, w), 0.0
                start = at_start(tab, panel.output, position) + fl.stops[s, GAP]
                end = at_end(tab, panel.output, position) + fl.stops[s, GAP]
        else:
            node_outputs(fl, tab, kind, phase, w, h, panel, out, inner)
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
            if not closed[s] and out != s:  # beyond the surface its force would press in vain
                node_outputs(fl, tab, kind, phase, w, h, panel, s, inner)
                for i in range(m):
                    values[i + 1] = inner[0, i]
                values[0], _, _, _ = output_derivatives(fl, s, w, phase, 0.0)
                values[m + 1], _, _, _ = output_derivatives(fl, s, w_end, phase + fl.omega * h, 0.0)
                if interpolate(tab, values, root) < fl.stops[s, GAP]:
                    doubtful = min(doubtful, fraction)
                    continue
            if fraction < where:
                event, where = s, fraction
        elif tail > 10.0 * noise:
            low = first_doubt(tab, values, fine, noise, tail)
            if low < 1.0:
                doubtful = min(doubtful, map_fraction(tab, kind, low))
    return event, where, doubtful if doubtful < where else 2.0


@inner
def creep(fl, stop, w, phase, duration):
    """Depth and speed of a body that creeps out of a stop, its speed held by the damping, or zeros.

    So it does where an elastic contact would take much longer than the damping to act.
    """
    if fl.laws[stop] != 0 or not depends_on_speed(fl, stop):
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
def bond_length(fl, stop, w, phase):
    """Length of a panel to try first on a bond: a radian of the free swing through the present.

    By a bound of the slope as far as the displacement and the speed carry.
    """
    value, speed, _, _ = output_derivatives(fl, stop, w, phase, 0.0)
    numbers = fl.stops[stop]
    rate = fl.omega
    for _ in range(6):
        reach, power, slope = abs(value) + abs(speed) / rate, 1.0, 0.0
        for c in range(FIRST_POWER, numbers.size):
            slope += (c - FIRST_POWER + 1) * abs(numbers[c]) * power
            power *= reach
        rate = math.sqrt(rate * max(math.sqrt(numbers[MOBILITY] * slope), fl.omega))
    return 1.0 / rate


@inner
def growth_of_panel(fl, tab, panel):
    """Factor by which the next panel may be longer than this one, as far as its bonds tell.

    A Legendre tail of degree m - 1 goes about with that power of the length.
    """
    na, m = panel.F.shape
    strain = LEAST_STRAIN
    for a in range(na):
        if is_bond(fl, panel.active[a]):
            for o in range(a, panel.slope.shape[0], na):
                top = largest(panel.slope, o)
                if top > 0.0:
                    strain = max(strain, legendre_tail(tab, panel.slope, o) / (4.0 * top))
            top = largest(panel.F, a)
            rounding = BLIND * panel.depth[1, a] * largest(panel.slope, a)
            if top > 0.0:
                strain = max(strain, (legendre_tail(tab, panel.F, a) - rounding) / top)
    growth = SAFETY * (fl.tail / strain) ** (1.0 / (m - 1))
    return min(max(growth, LEAST_GROWTH), MOST_GROWTH)


@inner
def hold_still(fl, phase, w, a, panel):
    """Guess a bond's displacements to be the present one: then one step is its linearisation."""
    value, _, _, _ = output_derivatives(fl, panel.active[a], w, phase, 0.0)
    for i in range(panel.output.shape[1]):
        panel.output[a, i] = value


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
        if is_bond(fl, active[a]) or is_rigid(fl, active[a]):
            continue
        _, duration, left = expected_contact(fl, active[a], w, phase)
        depth, speed = creep(fl, active[a], w, phase, duration)
        if depth > 0.0:
            if -0.5 * depth / speed < length:
                ends = False
                length = -0.5 * depth / speed
        elif left > min(MOST_LEFT * duration, h_mapped):
            if 0.5 * left < length:
                ends = False
                length = 0.5 * left
        elif left < length:
            ends = True
            length = left
    kind = 2 * start_switch + (1 if ends else 0)
    for a in range(active.size):
        if is_bond(fl, active[a]):
            hold_still(fl, phase, w, a, panel)
            continue
        if is_rigid(fl, active[a]):
            _, _, push, _ = output_derivatives(fl, active[a], w, phase, 0.0)
            for i in range(tab.nodes.size):
                delta[a, i] = push
            continue
        peak, duration, left = expected_contact(fl, active[a], w, phase)
        depth, speed = creep(fl, active[a], w, phase, duration)
        if depth > 0.0:
            for i in range(tab.nodes.size):
                later = depth + speed * length * tab.chi[kind, i]
                delta[a, i] = max(later, SMALLEST * depth)
        elif duration > 0.0:
            profile_guess(tab, kind, length, peak, duration, left, delta[a])
        else:
            for i in range(tab.nodes.size):
                delta[a, i] = 0.0
    return kind, length


@inner
def first_panel(fl, tab, rec, before, phase, w, h_max, h_mapped, start_switch, panel):
    """Kind, length and event of a panel to try first; fills the penetrations.

    The panel of a motion before serves, if it has one there. Of another orbit (`used[2]`) only one
    of the kind that the state asks for does, and its length only if it ends with an event: lengths
    that are handed on from orbit to orbit would become shorter and shorter.
    """
    n = rec.used[1]
    while n < rec.phase.size and rec.phase[n] + 0.5 * fl.omega * rec.duration[n] < before + phase:
        n += 1
    rec.used[1] = n
    other = rec.used[2] == 1
    known = n < rec.phase.size and rec.kind[n] != FLIGHT and rec.kind[n] // 2 == start_switch
    for a in range(panel.active.size):
        known = known and largest(rec.depth[n], panel.active[a]) > 0.0
    kind, h = -1, 0.0
    if other or not known:
        kind, h = guess_panel(fl, tab, phase, w, h_max, h_mapped, start_switch, panel)
        known = known and kind == rec.kind[n]
    if not known:
        return kind, h, -1
    for a in range(panel.active.size):
        for i in range(panel.F.shape[1]):
            panel.output[a, i] = rec.depth[n, panel.active[a], i]
    kind, length, event = rec.kind[n], rec.duration[n], rec.event[n]
    if other and event < 0:
        for a in range(panel.active.size):
            if is_bond(fl, panel.active[a]):
                hold_still(fl, phase, w, a, panel)
        return kind, h, -1
    if length > h_max or (event < 0 and length > ALL_BUT * h_max):
        return kind, h_max, -1
    return kind, length, event


@allocating
def remember(rec):
    """Keep what a motion before needs to serve as a guess at the end of its own record."""
    used, size = rec.used[0], rec.phase.size
    rec.used[0], rec.used[1] = 0, size
    if 2 * used > size:
        return
    for i in range(used - 1, -1, -1):
        n = size - used + i
        rec.phase[n], rec.duration[n] = rec.phase[i], rec.duration[i]
        rec.kind[n], rec.event[n] = rec.kind[i], rec.event[i]
        for a in range(rec.depth.shape[1]):  # to assign a row would take 5 s to compile
            for j in range(rec.depth.shape[2]):
                rec.depth[n, a, j] = rec.depth[i, a, j]
    rec.used[1] = size - used


@inner
def keep_profile(fl, tab, kind, new_kind, ratio, panel, guess):
    """Carry all penetrations over to a panel `ratio` times as long."""
    for a in range(panel.active.size):
        stretch_profile(tab, kind, new_kind, ratio, panel.output[a], guess)
        top = 0.0
        for i in range(guess.size):
            top = max(top, guess[i])
        for i in range(guess.size):
            bond = is_bond(fl, panel.active[a])
            panel.output[a, i] = guess[i] if bond else max(guess[i], SMALLEST * top)


@inner
def time_to_event(fl, stop, closed, w, phase):
    """Time (of either sign) to the instant at which a stop opens or closes in flight, or inf.

    The nearer root of the parabola through the present; inf where the gap changes the wrong way.
    """
    always_inline()
    value, speed, accel = watched_pace(fl, stop, closed, w, phase)
    if (speed >= 0.0) if closed[stop] else (speed <= 0.0):
        return np.inf
    square = speed * speed - 2.0 * accel * value
    root = math.sqrt(square) if square > 0.0 else abs(speed)
    return -2.0 * value / (speed + math.copysign(root, speed))


@inner
def pressing_noise(fl, stop, w):
    """Rounding error of the acceleration that a rigid stop takes from what rests on it."""
    return PRESSING_ROUNDING * output_size(fl, stop, w, 2)


@inner
def time_to_release(fl, tab, stop, kind, h, panel):
    """Time from the end of a panel to where a rigid stop's force changes its sign, or inf.

    The panel must not be stretched at its end.
    """
    for a in range(panel.active.size):
        if panel.active[a] == stop:
            slope = slope_at_end(tab, panel.output, a) / (h * (1.0 if kind == 0 else 2.0))
            if slope < 0.0:
                return -at_end(tab, panel.output, a) / slope
    return np.inf


@inner
def coarsest_instant(fl):
    """Largest error allowed in the instant of an event, as a share of a panel."""
    found = 0.0
    for s in range(fl.stops.shape[0]):
        found = max(found, fl.stops[s, INSTANT])
    return found


@inner
def at_switch(fl, stop, w, phase, allowed, closed):
    """Whether a stop is just about to switch, to within a time allowed or rounding.

    Of the state, and of the time: an instant is known no better than its phase.
    """
    value, speed, _ = watched_pace(fl, stop, closed, w, phase)
    out = watched(fl, stop, closed, w, phase)
    instant = allowed + 10.0 * SUM_ROUNDING * phase / fl.omega
    return abs(value) <= instant * abs(speed) + 10.0 * output_noise(fl, out, w)


@inner
def with_event(fl, stop, w, phase, allowed, closed):
    """Whether a stop is to open or close now, to within a time allowed or rounding.

    A rigid one does so by itself, see `rigid.impact`.
    """
    if is_bond(fl, stop) or is_rigid(fl, stop):
        return False
    if not at_switch(fl, stop, w, phase, allowed, closed):
        return False
    _, speed, _ = watched_pace(fl, stop, closed, w, phase)
    return closed[stop] != (speed > 0.0)


@inner
def resting(fl, stop, closed):
    """Whether a body rests on a stop that is rigid."""
    return closed[stop] and is_rigid(fl, stop)


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
    allowed = 10.0 * (coarsest_instant(fl) * h + SUM_ROUNDING * phase / fl.omega)
    for s in range(closed.size):
        if is_bond(fl, s) or (is_rigid(fl, s) and closed[s]):
            continue
        late = abs(time_to_event(fl, s, closed, w, phase))
        gap, _, _ = watched_pace(fl, s, closed, w, phase)
        out = watched(fl, s, closed, w, phase)
        here = late <= allowed or abs(gap) <= 10.0 * output_noise(fl, out, w)
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
def far_off(fl, phase, w, h, tried, panel, event, where, closed):
    """Whether a panel holds another solution of the force laws than the motion.

    It opens a stop at once that is not about to, or lets one feed as much as it should damp.
    """
    if event < 0:
        return not panel.decay[1].min() > -DECAY
    allowed = 10.0 * coarsest_instant(fl) * h
    return not (h * where > AT_ONCE * tried or at_switch(fl, event, w, phase, allowed, closed))


@allocating
def contact_panel(
    fl, tab, before, phase, w, h_max, h_mapped, start_switch, closed, panel, w_end, rec
):  # fmt: skip
    """Solve one panel and choose its length, at most h_max, and h_mapped to aim at an event.

    `before` is the phase of the whole turns before `phase`.

    Returns (status, kind, h, event): a panel that ends where stop `event` opens or closes, or
    (event = -1) one short enough to be resolved.
    """
    active = panel.active
    panel.kept[0] = False
    guess = np.empty(tab.nodes.size)
    rounding = np.empty(panel.output.shape[0])
    for a in range(active.size):
        rounding[a] = output_noise(fl, active[a], w)  # events are found in the state
        if is_rigid(fl, active[a]):
            rounding[a] = pressing_noise(fl, active[a], w)
    for o in range(active.size, rounding.size):
        rounding[o] = rate_noise(fl, active[o - active.size], w)
    noise = rounding.copy()
    smooth, switch = 2 * start_switch, 2 * start_switch + 1
    limit = h_max
    kind, h, aim = first_panel(fl, tab, rec, before, phase, w, limit, h_mapped, start_switch, panel)
    graded = graded_length(fl, active, w, phase, h, 1.0, start_switch == 1, -1)
    if h > 1.5 * graded:
        aim = -1
        kind, h = guess_panel(fl, tab, phase, w, graded, h_mapped, start_switch, panel)
    tried = h
    looked = False
    for attempt in range(100):
        if h <= HALF_ULP * tried or phase + fl.omega * h == phase:
            coarse = 10.0 * coarsest_instant(fl) * tried
            if aim < 0 or not at_switch(fl, aim, w, phase, coarse, closed):
                aim = stop_at_switch(fl, w, phase, tried, closed)
            return OK if aim >= 0 else CONTACT_FAILED, kind, 0.0, aim
        for a in range(active.size):
            more = carried_noise(fl, active[a], w, phase, panel.depth[0, a], h)
            panel.depth[3, a] = panel.depth[1, a] + more
            if not is_rigid(fl, active[a]):
                noise[a] = min(panel.depth[3, a], rounding[a])
        found = solve_panel(fl, tab, kind, phase, w, h, noise, panel)
        if found:
            decays = shows_decay(fl, tab, kind, h, panel)
            panel_end(fl, tab, kind, phase, w, h, panel, w_end)
            event, where, doubtful = first_event(fl, tab, kind, phase, w, h, closed, panel, w_end)
            found = not far_off(fl, phase, w, h, tried, panel, event, where, closed)
        if not found:
            limit = SHORTER * min(h, tried)
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
        if WITHIN < doubtful < 1.0 - WITHIN and not looked:  # the state at a panel's end is exact
            looked = True
            keep_profile(fl, tab, kind, smooth, doubtful, panel, guess)
            kind, aim = smooth, -1
            h *= doubtful
            continue
        near_end = NEAR_END
        if event >= 0 and event != aim:  # so near that `switch_with` will find it
            near_end = max(min(INSTANTS * fl.stops[event, INSTANT], FARTHEST_END), AT_ONCE)
        at_end = where > 1.0 - near_end
        lost = attempt % 20 == 19  # the instant that is aimed at goes to and fro
        if event >= 0 and (aim < 0 or not at_end) and not lost:
            aim = event
            goal = smooth if resting(fl, aim, closed) else switch
            if h * where > h_mapped:  # half the way first
                goal, aim, where = smooth, -1, 0.5 * where
            keep_profile(fl, tab, kind, goal, where, panel, guess)
            kind = goal
            h *= where
            continue
        if aim < 0 and kind % 2 == 1 and h < h_max:  # a release was expected here: follow it
            for a in range(active.size):
                s = active[a]
                elastic = aim < 0 and not (is_rigid(fl, s) or is_bond(fl, s))
                if elastic and time_to_event(fl, s, closed, w_end, end_phase) < h:
                    aim = s
        if aim >= 0 and not lost:
            dh = time_to_event(fl, aim, closed, w_end, end_phase)
            off, _, _ = watched_pace(fl, aim, closed, w_end, end_phase)
            there = abs(off) <= output_noise(fl, watched(fl, aim, closed, w_end, end_phase), w)
            if resting(fl, aim, closed):
                dh = time_to_release(fl, tab, aim, kind, h, panel)
                there = abs(dh) <= RELEASED * h
            if abs(dh) <= instant_with(fl, aim, w_end, end_phase, h, closed) or (
                dh < np.inf and there
            ):
                if fine:
                    return OK, kind, h, aim
            elif -0.5 * h < dh < h and (dh < 0.0 or h < h_max):
                h = min(h + dh, h_max)
                continue
            elif event < 0 and dh == np.inf and not closed[aim] and h < MISSED * tried:
                keep_profile(fl, tab, kind, kind, FARTHER, panel, guess)  # than it was seen
                h *= FARTHER
                continue
            elif dh > 0.0 and fine:  # the contact goes on
                return OK, kind, h, -1
        elif fine and not lost:
            return OK, kind, h, -1
        aim = -1
        keep_profile(fl, tab, kind, smooth, 0.5, panel, guess)
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
