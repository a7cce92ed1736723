"""Motions computed without the flow map: Runge-Kutta methods, and the matrix exponential."""

from __future__ import annotations

import cmath
import math
from itertools import pairwise
from typing import Any

import numpy as np
import scipy.linalg as sla
from scipy.integrate import solve_ivp

from nldyn import CubicDamper, PolynomialSpring, Spring, Stop, System


def contact(stop: Stop, depth: float, speed: float) -> tuple[float, float, float]:
    """Force k δ^p (1 + a δ') + c δ' and its derivatives, or what the stop's own law gives."""
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    if stop.law is not None:
        return stop.law(depth, speed)
    k, p, a, c = stop.stiffness, stop.exponent, stop.dissipation, stop.dashpot
    lossy = 1.0 + a * speed
    force = k * depth**p * lossy + c * speed
    if force < 0.0 and not stop.pulls:
        return 0.0, 0.0, 0.0
    return force, p * k * depth ** (p - 1.0) * lossy, a * k * depth**p + c


class Motion:
    """q'' + D q' + Ω² q = Σ p Re(f e^{iφ}) - Σ c F(c·q - gap, c·q'), with φ = ωt as time.

    The state holds modal displacements, then velocities.
    """

    def __init__(self, system: System) -> None:
        n = system.size
        self.n = n
        self.A = np.zeros((2 * n, 2 * n))
        self.A[:n, n:] = np.eye(n)
        self.A[n:, :n] = -np.diag(system.natural_frequencies**2)
        self.A[n:, n:] = -system.damping
        if system.circulatory is not None:
            self.A[n:, :n] -= system.circulatory
        self.springs, self.dampers = [], []
        for element in (*system.springs, *system.dampers):
            c = system.participation[element.at].copy()
            if element.against is not None:
                c -= system.participation[element.against]
            if isinstance(element, PolynomialSpring):
                self.springs.append((c, element.coefficients))
            elif isinstance(element, CubicDamper):
                self.dampers.append((c, element))
            elif isinstance(element, Spring):
                self.A[n:, :n] -= element.stiffness * np.outer(c, c)
            else:
                self.A[n:, n:] -= element.coefficient * np.outer(c, c)
        self.stops = [(system.stop_vector(s), s) for s in system.stops]
        self.sources = [(system.load_vector(e.at), e) for e in system.excitation]

    def rate(self, phase: float, x: np.ndarray, omega: float) -> np.ndarray:
        """Time derivative of the state."""
        dx = self.A @ x
        for shape, source in self.sources:
            amplitude = source.phasor * (source.harmonic * omega) ** source.power
            dx[self.n :] += shape * (amplitude * np.exp(1j * source.harmonic * phase)).real
        for c, stop in self.stops:
            dx[self.n :] -= c * contact(stop, c @ x[: self.n] - stop.gap, c @ x[self.n :])[0]
        for c, coefficients in self.springs:
            u = c @ x[: self.n]
            dx[self.n :] -= c * sum(k * u**j for j, k in enumerate(coefficients, 1))
        for c, damper in self.dampers:
            u, v = c @ x[: self.n], c @ x[self.n :]
            dx[self.n :] -= c * damper.coefficient * v * (v if damper.by == "speed" else u) ** 2
        return dx

    def tangent_matrix(self, x: np.ndarray) -> np.ndarray:
        """Derivative of the rate with respect to the state."""
        J = self.A.copy()
        for c, stop in self.stops:
            _, stiff, viscous = contact(stop, c @ x[: self.n] - stop.gap, c @ x[self.n :])
            J[self.n :, : self.n] -= stiff * np.outer(c, c)
            J[self.n :, self.n :] -= viscous * np.outer(c, c)
        for c, coefficients in self.springs:
            u = c @ x[: self.n]
            slope = sum(j * k * u ** (j - 1) for j, k in enumerate(coefficients, 1))
            J[self.n :, : self.n] -= slope * np.outer(c, c)
        for c, damper in self.dampers:
            u, v = c @ x[: self.n], c @ x[self.n :]
            by_u, by_v = (0.0, 3.0 * v * v) if damper.by == "speed" else (2.0 * u * v, u * u)
            J[self.n :, : self.n] -= damper.coefficient * by_u * np.outer(c, c)
            J[self.n :, self.n :] -= damper.coefficient * by_v * np.outer(c, c)
        return J

    def run(
        self,
        state: np.ndarray,
        phases: tuple[float, float],
        omega: float,
        *,
        tangent: bool = True,
        max_step: float = 0.05,
    ) -> tuple[np.ndarray, np.ndarray]:
        """End state and its derivative with respect to the start, good to 1e-12 and 5e-11.

        The steps (radians of the forcing phase) must be shorter than every contact. None holds the
        beginning or the end of a contact, where the derivative of a Hertz force is not smooth.
        """
        size = 2 * self.n
        y = np.concatenate([state, (np.eye(size) if tangent else np.zeros((size, 0))).ravel()])
        atol = self._tolerances(state, omega)[: y.size]
        passed = self._integrated(state, phases, omega, atol[:size], max_step).t_events
        switches = sorted(float(phase) for of_stop in passed for phase in of_stop)
        for piece in pairwise([phases[0], *switches, phases[1]]):
            y = self._integrated(y, piece, omega, atol, max_step).y[:, -1]
        return y[:size], y[size:].reshape(size, -1)

    def stiff_end(
        self, state: np.ndarray, phases: tuple[float, float], omega: float, atol: float = 1e-19
    ) -> np.ndarray:
        """End state where a stop damps fast, by Radau's method of order 5."""
        return solve_ivp(
            lambda time, x: self.rate(omega * time, x, omega),
            np.array(phases) / omega,
            state,
            method="Radau",
            rtol=1e-12,
            atol=atol,
            jac=lambda _, x: self.tangent_matrix(x),
        ).y[:, -1]

    def closings(
        self, state: np.ndarray, phases: tuple[float, float], omega: float, max_step: float = 0.05
    ) -> list[int]:
        """How often each stop closes: its depth turns positive from one step to the next."""
        atol = self._tolerances(state, omega)[: 2 * self.n]
        q = self._integrated(state, phases, omega, atol, max_step).y[: self.n]
        depths = [c @ q - stop.gap for c, stop in self.stops]
        return [int(np.sum((d[:-1] <= 0.0) & (d[1:] > 0.0))) for d in depths]

    def _tolerances(self, state: np.ndarray, omega: float) -> np.ndarray:
        """Errors allowed in the state, then in its derivative."""
        fastest = max(np.abs(np.linalg.eigvals(self.A)).max(), omega)
        length = max(np.abs(state[: self.n]).max(), np.abs(state[self.n :]).max() / fastest)
        scale = np.repeat([length, length * fastest], self.n)
        return 1e-14 * np.concatenate([scale, (scale[:, None] / scale).ravel()])

    def _integrated(
        self,
        y: np.ndarray,
        phases: tuple[float, float],
        omega: float,
        atol: np.ndarray,
        max_step: float,
    ) -> Any:
        """State and, if it is given, its derivative, by steps; and where stops open or close."""
        size = 2 * self.n

        def extended(phase: float, y: np.ndarray) -> np.ndarray:
            x, X = y[:size], y[size:].reshape(size, -1)
            dx = self.rate(phase, x, omega) / omega
            return np.concatenate([dx, (self.tangent_matrix(x) @ X).ravel() / omega])

        return solve_ivp(
            extended,
            phases,
            y,
            method="DOP853",
            rtol=2e-13,
            atol=atol,
            max_step=max_step,
            events=[
                lambda _, y, c=c, stop=stop: c @ y[: self.n] - stop.gap for c, stop in self.stops
            ],
        )


def exact_flight(
    system: System, x0: np.ndarray, phases: tuple[float, float], omega: float
) -> tuple[np.ndarray, np.ndarray]:
    """End state and Jacobian from one matrix exponential of the system and its oscillators."""
    n, orders = system.size, sorted({source.harmonic for source in system.excitation})
    size = 2 * n + 2 * len(orders)
    A = np.zeros((size, size))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -np.diag(system.natural_frequencies**2)
    A[n : 2 * n, n : 2 * n] = -system.total_damping
    start = list(x0)
    for h, order in enumerate(orders):  # (cos mωt, sin mωt)
        pair = slice(2 * n + 2 * h, 2 * n + 2 * h + 2)
        A[pair, pair] = order * np.array([[0.0, -omega], [omega, 0.0]])
        start += [np.cos(order * phases[0]), np.sin(order * phases[0])]
        for source in system.excitation:
            if source.harmonic == order:
                f = source.phasor * (order * omega) ** source.power
                A[n : 2 * n, pair] += np.outer(system.load_vector(source.at), [f.real, -f.imag])
    E = sla.expm(A * (phases[1] - phases[0]) / omega)
    return (E @ start)[: 2 * n], E[: 2 * n, : 2 * n]


def state_map(system: System) -> np.ndarray:
    """Matrix L with z = L @ x for modal displacements and velocities x, (2n, 2n)."""
    return system.linear.left


def mathieu_multipliers_of(omega, spring, swing, damping):
    """Multipliers of y'' + c y' + (k + s cos ωt) y = 0 by Hill's determinant.

    E. T. Whittaker and G. N. Watson, A Course of Modern Analysis, 19.42.
    """
    a, q = 4.0 * (spring - 0.25 * damping**2) / omega**2, 2.0 * swing / omega**2
    n = np.arange(-4000, 4001)
    xi = q / (4.0 * n**2 - a)
    determinant, before = 1.0, 1.0
    for product in xi[1:] * xi[:-1]:
        determinant, before = determinant - product * before, determinant
    cosine = 1.0 - determinant * (1.0 - math.cos(math.pi * math.sqrt(a)))
    root = cmath.sqrt(cosine**2 - 1.0)
    decay = math.exp(-math.pi * damping / omega)
    return decay * np.array([cosine + root, cosine - root])
