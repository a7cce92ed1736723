"""Multiple shooting: the boundary value problem of a periodic orbit and its Newton iterations.

Unknowns are the states at k equally spaced phases of the orbit's period and p = ln ω;
the equations say that each segment ends where the next one starts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nldyn.flow import FlowMap
from nldyn.linear import Real


@dataclass(frozen=True)
class Linearisation:
    """Residual and derivatives of the shooting equations at one point.

    Parameters
    ----------
    residual : (N,)
        End minus next start, all segments; N = 2nk.
    jacobian : (N, N + 1)
        Derivatives with respect to the states and p = ln ω.
    monodromy : (2n, 2n)
        Product of the segments' Jacobians.
    failure : str
        Empty, or why the flow map failed.
    """

    residual: Real
    jacobian: Real
    monodromy: Real
    failure: str = ""


@dataclass(frozen=True)
class Correction:
    """Outcome of Newton's method.

    Parameters
    ----------
    point : (N + 1,)
        States and p.
    lin : Linearisation
        At the point before the last step.
    converged : bool
    iterations : int
    first_step : float
        Length of the first Newton step, relative.
    last_step : float
        Length of the last Newton step, relative: the error left is far below.
    failure : str
        Empty, or why it did not converge.
    """

    point: Real
    lin: Linearisation
    converged: bool
    iterations: int
    first_step: float
    last_step: float
    failure: str = ""


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
    """

    flow: FlowMap
    period: int
    segments: int

    @cached_property
    def phases(self) -> Real:
        """Forcing phases of the segment ends, shape (k + 1,)."""
        return np.linspace(0.0, 2.0 * np.pi * self.period, self.segments + 1)

    @cached_property
    def _following(self) -> NDArray[np.int64]:
        return (np.arange(self.segments) + 1) % self.segments

    @property
    def size(self) -> int:
        """Number of real coordinates of a state, 2n."""
        return 2 * self.flow.system.size

    def nodes(self, point: Real) -> Real:
        """States (k, 2n) of a point."""
        return point[:-1].reshape(self.segments, self.size)

    def scale(self, point: Real) -> float:
        """Root mean square of the modal displacements, the unit of relative steps."""
        states = point[:-1]
        return math.sqrt(float(states @ states) / self.segments) or 1.0

    def metric(self, point: Real) -> Real:
        """Weights g of the arclength: ds² = Σ g Δ², relative in states and frequency."""
        weights = np.full(point.size, 1.0 / (self.segments * self.scale(point) ** 2))
        weights[-1] = 1.0
        return weights

    def linearise(self, point: Real) -> Linearisation:
        """Residual and Jacobian at a point (N + 1,)."""
        omega = float(np.exp(point[-1]))
        nodes = self.nodes(point)
        segments = self.flow.shoot(nodes, self.phases, omega)
        k, n = self.segments, self.size
        residual = segments.ends - nodes[self._following]
        jacobian = np.zeros((k * n, k * n + 1))
        blocks = jacobian[:, :-1].reshape(k, n, k, n)
        index = np.arange(k)
        blocks[index, :, index, :] = segments.jacobians
        blocks[index, :, self._following, :] -= np.eye(n)
        jacobian[:, -1] = omega * segments.d_omega.ravel()
        monodromy = segments.jacobians[0]
        for block in segments.jacobians[1:]:
            monodromy = block @ monodromy
        return Linearisation(residual.ravel(), jacobian, monodromy, segments.failure)

    def correct(
        self,
        guess: Real,
        row: Real,
        *,
        offset: float | None = None,
        rtol: float = 1e-10,
        max_iterations: int = 12,
    ) -> Correction:
        """Newton's method on the plane ``row @ point = offset`` (through the guess by default).

        A row (N + 1,) that is zero but for its last entry holds the frequency.
        """
        point = guess.copy()
        weights = self.metric(guess)
        level = float(row @ guess) if offset is None else offset
        first = last = np.inf
        for iteration in range(1, max_iterations + 1):
            lin = self.linearise(point)
            if lin.failure:
                return Correction(point, lin, False, iteration, first, last, lin.failure)
            matrix = np.vstack([lin.jacobian, row])
            target = np.append(-lin.residual, level - row @ point)
            try:
                step = np.linalg.solve(matrix, target)
            except np.linalg.LinAlgError:
                return Correction(point, lin, False, iteration, first, last, "singular Jacobian")
            before, last = last, float(np.sqrt(np.sum(weights * step**2)))
            if iteration == 1:
                first = last
            if not (last < 1e3 and abs(step[-1]) < 0.5):
                return Correction(point, lin, False, iteration, first, last, "Newton diverged")
            point = point + step
            stagnant = last < 1e-8 and last > 0.5 * before  # at the rounding level
            if last <= rtol or stagnant:
                return Correction(point, lin, True, iteration, first, last)
        return Correction(point, lin, False, max_iterations, first, last, "Newton did not converge")

    def tangent(self, lin: Linearisation, weights: Real, towards: Real) -> Real:
        """Unit tangent (in the metric) of the branch, on the side of `towards`."""
        matrix = np.vstack([lin.jacobian, weights * towards])
        rhs = np.zeros(matrix.shape[0])
        rhs[-1] = 1.0
        tangent = np.linalg.solve(matrix, rhs)
        return np.asarray(tangent / np.sqrt(np.sum(weights * tangent**2)))
