"""Multiple shooting: the boundary value problem of a periodic orbit and its Newton iterations.

Unknowns are the states at k equally spaced phases of the orbit's period and p = ln ω;
the equations say that each segment ends where the next one starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_whole
from nldyn.engine.newton import Corrector
from nldyn.flow.flow_map import FlowMap, Solution, Trajectory, pinned

SEGMENTS_PER_PERIOD = 2
LONGEST_PERIOD = 10**4  # excitation periods of an orbit
MOST_SEGMENTS = 10**5

TOLERANCE = 1e-11  # relative length of a Newton step after which to stop
ITERATIONS = 12  # most Newton steps
LONGEST = 1e3  # relative length of a first Newton step
FROM_NEAR = 8  # the same from a point that was predicted or nearly found: more mean it went astray
LOOSE = 1e-3  # relative length of a last step from which on nothing shows that there is an orbit
AT_REST = 1e-6  # size of an orbit, relative to the guess, that may be rounding
MUCH_SMALLER = 0.1  # of the start: an orbit whose steps are to be judged anew
BROKEN = 1e-8  # asymmetry of an orbit that is more than rounding


@dataclass(frozen=True)
class ShootingProblem:
    """Periodic orbits of period multiple n on k segments.

    Parameters
    ----------
    flow : FlowMap
        The flow map.
    period : int
        Period multiple n: the orbit repeats after n excitation periods.
    segments : int
        Number k of shooting segments.
    start : float
        Forcing phase of the first state.
    """

    flow: FlowMap
    period: int
    segments: int
    start: float = 0.0

    @cached_property
    def phases(self) -> Real:
        """Forcing phases of the segment ends, shape (k + 1,)."""
        return self.start + np.linspace(0.0, 2.0 * np.pi * self.period, self.segments + 1)

    @cached_property
    def size(self) -> int:
        """Number of real coordinates of a state z."""
        return self.flow.system.state_size

    def nodes(self, point: Real) -> Real:
        """States (k, 2n) of a point."""
        return point[: self.segments * self.size].reshape(self.segments, self.size)

    def scale(self, point: Real) -> float:
        """Root mean square of the modal displacements, the unit of relative steps."""
        states = point[: self.segments * self.size]
        return math.sqrt(float(states @ states) / self.segments) or 1.0

    def metric(self, point: Real) -> Real:
        """Weights g of the arclength: ds² = Σ g Δ², relative in states and frequency."""
        weights = np.empty(point.size)
        weights[:-1], weights[-1] = 1.0 / (self.segments * self.scale(point) ** 2), 1.0
        return weights

    def jacobians(self, point: Real, parts: int) -> Real | None:
        """Jacobians (k · parts, 2n, 2n) of the segments cut into equal parts.

        Each segment starts from its own state, so that errors grow over one segment only. None if
        the flow map fails.
        """
        pieces = []
        ends = zip(self.nodes(point), self.phases[:-1], self.phases[1:], strict=True)
        for state, start, end in ends:
            phases, omega = np.linspace(start, end, parts + 1), math.exp(point[-1])
            found = self.flow.shoot(state[None], phases, omega, chained=True)
            if found.failure:
                return None
            pieces.append(found.jacobians)
        return pinned(self.flow.system, np.concatenate(pieces))

    def correct(
        self,
        guess: Real,
        row: Real,
        *,
        offset: float | None = None,
        longest: float = LONGEST,
        max_iterations: int = ITERATIONS,
        like: Trajectory | None = None,
        aim: Real | None = None,
        closings: int = -1,
        turn: float = 0.0,
    ) -> Solution:
        """Newton's method on the plane ``row @ point = offset`` (through the guess by default).

        A row (N + 1,) that is zero but for its last entry holds the frequency. A first step farther
        than `longest` (relative, as in `metric`) from `aim`, the guess by default, means failure.
        The contacts of a motion `like` the one sought, if one is known, are where those are looked
        for first. See `engine.newton.Corrector` for the other arguments.
        """
        level = float(row @ guess) if offset is None else offset
        row = np.ascontiguousarray(row, dtype=float)

        def solved(
            start: Real, size: float, near: Trajectory | None, expected: Real
        ) -> tuple[Solution, float]:
            corrector = Corrector(
                row, level, 1.0 / (self.segments * size**2), TOLERANCE, longest, max_iterations,
                expected, closings, turn,
            )  # fmt: skip
            found = self.flow.newton(start, corrector, self.phases, near)
            return found, self.scale(found.point)

        guess = np.ascontiguousarray(guess, dtype=float)
        before = self.scale(guess)
        found, size = solved(guess, before, like, guess if aim is None else aim)
        # steps count relative to the start, and may still be large beside a much smaller orbit;
        # motions at rest are not found any better
        while found.converged and size < MUCH_SMALLER * before:
            finer, finer_size = solved(found.point, size, None, found.point)
            if not finer.converged and size < AT_REST * before:
                break
            before, found, size = size, finer, finer_size
        if found.converged and found.last_step > LOOSE:
            largest = float(np.abs(found.jacobians).max())
            return found._replace(failure=f"Jacobians of {largest:.1e} make too much of rounding")
        return found

    def tangent(self, found: Solution, towards: Real) -> Real:
        """Unit tangent of the branch at a solution, on the side of the vector `towards`."""
        along = found.along
        weighted = self.metric(found.point) * along
        length = math.sqrt(float(along @ weighted))
        return along / (length if float(towards @ weighted) >= 0.0 else -length)


def metric_length(weights: Real, vector: Real) -> float:
    """Length of a vector (N + 1,) in a metric, see `ShootingProblem.metric`."""
    return math.sqrt(float(vector @ (weights * vector)))


def asymmetry(problem: ShootingProblem, point: Real) -> float:
    """How far half a period is from mirroring an orbit, x(t + T/2) = -x(t), relative to it.

    Infinite where it cannot, for an even period, or its nodes do not tell, for odd segments.
    """
    if problem.period % 2 == 0 or problem.segments % 2:
        return math.inf
    nodes, half = problem.nodes(point), problem.segments // 2
    return float(np.abs(nodes[:half] + nodes[half:]).max()) / problem.scale(point)


def shifts(problem: ShootingProblem, point: Real) -> list[Real]:
    """Unknowns (N + m,) of an orbit shifted by each of its excitation periods."""
    size, every = problem.segments * problem.size, problem.segments // problem.period * problem.size
    twice = np.concatenate([point[:size], point[:size]])
    moves = range(size - every, 0, -every)
    return [point, *(np.append(twice[move : move + size], point[size:]) for move in moves)]


def shooting_problem(flow: FlowMap, period: int, segments: int | None = None) -> ShootingProblem:
    """Shooting equations with two segments per excitation period unless told otherwise."""
    check_whole("period", period, 1, LONGEST_PERIOD)
    if segments is None:
        segments = SEGMENTS_PER_PERIOD * period
    check_whole("segments", segments, 1, MOST_SEGMENTS)
    if segments % period:
        raise SystemModelError(f"segments must be a multiple of period {period}, got {segments}")
    return ShootingProblem(flow, period, segments)
