"""One panel of a contact: the Volterra equation of the forces at its Gauss nodes."""

from __future__ import annotations

import numpy as np

from nldyn.flow.kernels.compiling import allocating, always_inline, inner
from nldyn.flow.kernels.flights import (
    add_forced_by,
    add_rates,
    flown,
    fly,
    fly_state,
    forced_output,
    free_output,
    output_derivatives,
    swelling,
    swings,
    swollen,
    swung,
    swung_there_and_back,
    there_and_back,
    turned,
)
from nldyn.flow.kernels.law import closed_law, is_rigid, law, law_by, needs_speed
from nldyn.flow.kernels.layout import DECAY, GAP, SUM_ROUNDING, Panel
from nldyn.flow.kernels.resolution import at_end, largest

SETTLED = 1e-10  # of the largest force: its difference from that of its own penetration
SOLVED = 1e-13  # relative change of the penetrations that Newton's method would still make
SLOWEST = 1e-3  # 1 - rate of its convergence, at least, in the estimate of that
STALE = 0.1  # rate from which its matrix is factored anew


@allocating
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
def output_order(fl, stop, rate):
    """Which row of a stop an output of a panel is: a rigid stop's is its acceleration."""
    return 2 if rate == 0 and is_rigid(fl, stop) else rate


@inner
def between(fl, stop, other):
    """Speed that a unit impulse at another stop takes from the closing of a stop's gap, in 1/kg."""
    mobility = 0.0
    for k in range(fl.force.shape[0]):
        mobility += fl.rows[1, stop, k] * fl.force[k, other]
    return mobility


@allocating
def panel_responses(fl, tab, kind, h, panel):
    """Fill what a panel of length h needs to know of the linear part: to, rise, back and G."""
    m = tab.nodes.size
    na = panel.active.size
    to, back, G = panel.to, panel.back, panel.G
    if panel.made[0] == kind and panel.made[1] == h:
        return
    panel.made[0], panel.made[1] = kind, h
    times, waves = np.empty(m), np.empty((4, m))
    for i in range(m):
        times[i] = h * tab.chi[kind, i]
    decay, less, sine, cosine = waves[0], waves[1], waves[2], waves[3]
    for b in range(fl.blocks.shape[0]):
        j, block = 2 * b, fl.blocks[b]
        rate = swings(block, times, decay, less, sine, cosine)
        for i in range(m):
            if rate > 0.0:
                e00, e01, e10, e11, i00, i01, i10, i11, d00, d11 = swung_there_and_back(
                    block, rate, less[i], decay[i], sine[i], cosine[i]
                )
            else:
                e00, e01, e10, e11, i00, i01, i10, i11, d00, d11 = there_and_back(block, times[i])
            for o in range(to.shape[0]):
                stop = panel.active[o % na]
                order = output_order(fl, stop, o // na)
                x, y = fl.rows[order, stop, j], fl.rows[order, stop, j + 1]
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
            if o < na and a != o and is_rigid(fl, panel.active[o]):  # what acts at once
                kick = between(fl, panel.active[o], panel.active[a])
                for i in range(m):
                    G[o * m + i, a * m + i] += kick


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
            order = output_order(fl, panel.active[o % na], o // na)
            if order == 2:
                value = -fl.omega * fl.omega * (steady * (start + swing)).real
                for k in range(w.size):
                    value += panel.to[o, i, k] * w[k]
            elif order == 0:
                value = panel.depth[0, o] + (steady * swing).real
                for k in range(w.size):
                    value += panel.rise[o, i, k] * w[k]
            else:
                value = -fl.omega * (steady * (start + swing)).imag
                for k in range(w.size):
                    value += panel.to[o, i, k] * w[k]
            free[o * m + i] = value
    if fl.terms.kinds.size > 0:
        for o in range(panel.to.shape[0]):
            stop = panel.active[o % na]
            for i in range(m):
                t = h * tab.chi[kind, i]
                order = output_order(fl, stop, o // na)
                if order == 0:
                    more = swollen(fl, stop, phase, t)
                else:
                    here = phase + fl.omega * t
                    _, rate, acceleration, _ = swelling(fl, stop, here)
                    more = rate if order == 1 else acceleration
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
        allowed = SETTLED * largest(panel.F, a)
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
        error += SUM_ROUNDING * moved * abs(panel.slope[o, i])
    return error


@allocating
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
        left = change * change if fresh else change * rate / max(1.0 - rate, SLOWEST)
        if left <= SOLVED and (fresh or before < np.inf or change == 0.0):
            panel_forces(fl, panel, slope)
            if consistent(panel, force, noise):  # that estimate trusts in the order of convergence
                return True
            rate = 1.0
        if rate > STALE:
            panel.kept[0] = False
        before = change
    panel.kept[0] = False
    return False


@allocating
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


@allocating
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


@allocating
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
            order = output_order(fl, stop, o // na)
            add_forced_by(fl, stop, order, phase + fl.omega * t, t0 + t, slope, forces[p])
            for c in range(fl.parameters.shape[0]):
                own = fl.parameters[c, 1] == stop and fl.parameters[c, 0] >= GAP
                if own and order == 0:
                    speed = panel.output[na + o, i] if panel.slope.shape[0] > na else 0.0
                    by = law_by(fl, stop, fl.parameters[c, 0], panel.output[o, i], speed)
                    forces[p, columns.shape[0] + c] += by
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


@allocating
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
