"""Compiled kernels of the flow map: flights, contact phases, segments.

Python calls one of them, `newton`, since a second entry would be compiled anew.

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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from nldyn.flow.kernels.compiling import allocating, by_reference, entry, inner
from nldyn.flow.kernels.layout import (
    DIVERGED,
    GAP,
    NOISE,
    NOT_CONVERGED,
    OK,
    OPEN,
    OTHER_CONTACTS,
    PRELOADED,
    SINGULAR,
    STEADY,
)
from nldyn.flow.kernels.panel import lu_apply, lu_factor
from nldyn.flow.kernels.segments import shoot

LAST_DIGITS = 1e-8  # relative step that may go to and fro at the rounding level


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
        Farthest distance of the first corrected point from `aim`: more means failure.
    max_iterations : int
        Most steps; none means the flow map alone.
    aim : (N + 1,)
        Where the point is expected.
    closings : int
        How often stops close in the motion from the guess, or it fails; -1 for any number.
    turn : float
        Least cosine of the first tangent and the normal of the plane, in the metric, or it fails.
    """

    row: NDArray[np.float64]
    level: float
    state_weight: float
    rtol: float
    longest: float
    max_iterations: int
    aim: NDArray[np.float64]
    closings: int
    turn: float


@inner
def cosine(row, along, state_weight):
    """Cosine, in the metric of the steps, of the normal of a plane and a direction, either way."""
    last = row.size - 1
    product, length, pace = row[last] * along[last], row[last] ** 2, along[last] ** 2
    for i in range(last):
        product += row[i] * along[i]
        length += row[i] ** 2 / state_weight
        pace += state_weight * along[i] ** 2
    return abs(product) / math.sqrt(length * pace)


@allocating
def preloaded(system):
    """Size of the state that would relieve the most preloaded stop."""
    largest = 0.0
    for s in range(system.stops.shape[0]):
        square = (system.rows[0, s] ** 2).sum()
        if square > 0.0:
            largest = max(largest, -system.stops[s, GAP] / math.sqrt(square))
    return largest


@entry
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
    tables, pieces = by_reference(tab), by_reference(rec)
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
    preload = preloaded(system) * math.sqrt(corrector.state_weight)
    while True:
        iteration += 1
        if max_iterations > 0:
            omega = math.exp(point[unknowns - 1])
        for i in range(unknowns - 1):
            nodes[i // size, i % size] = point[i]
        ends, jacobians, d_omegas, d_parameters, closings, status = shoot(
            system, tables, pieces, recording, omega, nodes, phases, chained, with_columns,
            parameters, drive_by,
        )  # fmt: skip
        if status != OK or max_iterations == 0:
            outcome = status
            break
        if iteration == 1 and 0 <= corrector.closings != closings.sum():
            outcome = OTHER_CONTACTS
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
        pressed = PRELOADED * preload * math.sqrt(rec.used[0])  # roundings of many pieces add up
        noise = (NOISE + pressed) * np.abs(jacobians).max()
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
        far = last
        if iteration == 1:
            far = (point[unknowns - 1] + sides[unknowns - 1, 0] - corrector.aim[unknowns - 1]) ** 2
            for i in range(unknowns - 1):
                off = point[i] + sides[i, 0] - corrector.aim[i]
                far += corrector.state_weight * off**2
            far = math.sqrt(far)
            if cosine(corrector.row, sides[:, 1], corrector.state_weight) < corrector.turn:
                outcome = DIVERGED
                break
        longest = corrector.longest if iteration == 1 else 1e3
        if far >= longest or abs(sides[unknowns - 1, 0]) >= 0.5:
            outcome = DIVERGED
            break
        for i in range(unknowns):
            point[i] += sides[i, 0]
            along[i] = sides[i, 1]
        converged = last <= corrector.rtol and opening <= max(OPEN, noise)
        # the rounding level, or steps to and fro where there is no orbit, across a sharp touch
        stalls = last < max(LAST_DIGITS, noise) and last > 0.5 * before
        stagnant = stalls and opening <= max(OPEN, noise)
        if stagnant and opening > max(NOISE, noise):
            stagnant = np.abs(jacobians - known).max() <= STEADY * np.abs(jacobians).max()
        known = jacobians
        if converged or stagnant:
            outcome = OK
            break
        if iteration == max_iterations:
            break
        rec.used[2] = 0
        if last > 0.5 * before:  # panels that change with what is remembered may keep it going
            rec.used[0] = 0
    return (
        outcome, iteration, first, last, along, ends, jacobians, d_omegas, d_parameters, closings
    )  # fmt: skip
