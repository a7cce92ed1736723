"""Errors against the flow in multiple precision (`bench.exact`): another method and code."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import reduce

import mpmath
import numpy as np
from bench.exact import ExactEnd, ExactFlow, Number, Precision, Series

from hard.case import Measured
from nldyn.base.arrays import Real
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.orbit import Orbit
from nldyn.system.system import System

mp = mpmath.mp
DIGITS = Precision(34, 34, 24)
ORIGIN = "Taylor series in 34 digits (tests/bench/exact.py), another method and code"
STATE, JACOBIAN = 1e-9, 1e-8  # what the default FlowOptions promise, docs/explanation/theory.md
PROMISE = "the promise of the default tolerance (docs/explanation/theory.md)"


def exact_end(
    system: System, start: Real | Series, omega: Number, precision: Precision = DIGITS
) -> ExactEnd:
    """Where a modal state (2n,) goes in one excitation period, with all derivatives."""
    return ExactFlow(system, omega, precision).period(start)


def flow_error(
    flow: FlowMap,
    start: Real,
    omega: float,
    precision: Precision = DIGITS,
    instead: System | None = None,
) -> Measured:
    """Error of one period from a modal state (2n,): that of the Jacobian, or ten of the state's.

    Both are relative, in the norm of the coordinates z. The reference may be of another system
    `instead`, which hardly differs.
    """
    found = flow.shoot(flow.to_state(start)[None], np.array([0.0, 2.0 * np.pi]), omega)
    if found.failure:
        return Measured(math.nan, found.failure)
    exact = exact_end(instead or flow.system, start, omega, precision)
    state, jacobian = in_coordinates(flow, exact)
    off = relative(found.ends[0], state), relative(found.jacobians[0], jacobian)
    note = f"state {off[0]:.1e}, Jacobian {off[1]:.1e}, {exact.contacts} contacts begin"
    return Measured(max(10.0 * off[0], off[1]), note)


def orbit_flow_error(
    orbit: Orbit, precision: Precision = DIGITS, instead: System | None = None
) -> Measured:
    """The same from the state of an orbit at phase zero."""
    start = orbit.problem.flow.to_modal(orbit.problem.nodes(orbit.point)[0])
    return flow_error(orbit.problem.flow, start, orbit.omega, precision, instead)


def in_coordinates(flow: FlowMap, end: ExactEnd) -> tuple[Real, Real]:
    """State and Jacobian of the coordinates z, rounded."""
    linear = flow.system.linear
    state = np.array([float(x) for x in end.state])
    monodromy = np.array([[float(x) for x in row] for row in end.monodromy])
    return linear.left @ state, linear.left @ monodromy @ linear.right


def relative(found: Real, exact: Real) -> float:
    """Length of a difference over that of the exact value."""
    return float(np.linalg.norm(found - exact) / np.linalg.norm(exact))


@dataclass(frozen=True)
class ExactOrbit:
    """A periodic orbit in multiple precision.

    Parameters
    ----------
    periods : list of ExactEnd
        What each excitation period gives.
    correction : float
        Length of the Newton step that led there, relative to the orbit: the error of the orbit
        that it came from. The orbit is as long as the states at all its nodes: the one at phase
        zero alone may be any share of it.
    """

    periods: list[ExactEnd]
    correction: float

    def multipliers(self) -> Series:
        """Multipliers from the product of the periods' monodromy matrices, largest first."""
        matrices = [mp.matrix(end.monodromy) for end in self.periods]
        values, _ = mp.eig(reduce(lambda product, matrix: matrix * product, matrices))
        return sorted(values, key=abs, reverse=True)


def exact_orbit(orbit: Orbit, precision: Precision = DIGITS) -> ExactOrbit:
    """One Newton step in multiple precision from an orbit, one segment per excitation period."""
    omega, moved, correction = newton_step(orbit, precision)
    periods = [exact_end(orbit.system, start, omega, precision) for start in moved]
    return ExactOrbit(periods, correction)


def newton_step(orbit: Orbit, precision: Precision = DIGITS) -> tuple[Number, list[Series], float]:
    """ω, the states to which a Newton step leads, and its length: the error of the orbit."""
    mp.dps = precision.digits
    problem, system = orbit.problem, orbit.system
    omega = mp.exp(mp.mpf(float(orbit.point[-1])))
    each = problem.segments // problem.period
    whole = problem.flow.to_modal(problem.nodes(orbit.point))
    nodes = whole[::each]
    starts: list[Series] = [[mp.mpf(float(x)) for x in node] for node in nodes]
    moves = newton_steps(starts, [exact_end(system, s, omega, precision) for s in starts])
    correction = length(problem.flow, moves) / length(problem.flow, [*map(list, whole)])
    moved = [[x + d for x, d in zip(s, m, strict=True)] for s, m in zip(starts, moves, strict=True)]
    return omega, moved, correction


def newton_steps(starts: list[Series], periods: list[ExactEnd]) -> list[Series]:
    """Newton steps of the states: the first from the product, the others one after the other."""
    size = len(starts[0])
    product, shift = mp.eye(size), mp.zeros(size, 1)
    following = [*starts[1:], starts[0]]
    for end, after in zip(periods, following, strict=True):
        matrix = mp.matrix(end.monodromy)
        product = matrix * product
        shift = matrix * shift + mp.matrix(end.state) - mp.matrix(after)
    move = mp.lu_solve(mp.eye(size) - product, shift)
    moves = [list(move)]
    for end, after in zip(periods[:-1], following[:-1], strict=True):
        move = mp.matrix(end.monodromy) * move + mp.matrix(end.state) - mp.matrix(after)
        moves.append(list(move))
    return moves


def length(flow: FlowMap, states: list[Series]) -> float:
    """Root of the mean square of states in the coordinates z."""
    z = flow.to_state(np.array([[float(x) for x in state] for state in states]))
    return float(np.linalg.norm(z) / math.sqrt(len(states)))
