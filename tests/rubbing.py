"""Motions in round clearances, computed without the flow map: integration from event to event."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Ring:
    """A ring (`sense` 1) or a pin (-1): k δ^p (1 + a δ') along the radius, μ times it across.

    `rows` (2, n) give the displacements along both directions; μ has the sign of the sliding.
    """

    rows: Vector
    stiffness: float
    clearance: float
    exponent: float = 1.0
    centre: tuple[float, float] = (0.0, 0.0)
    sense: float = 1.0
    dissipation: float = 0.0
    rub: float = 0.0

    def depth(self, q: Vector) -> float:
        return float(self.sense * (np.hypot(*(self.rows @ q - self.centre)) - self.clearance))

    def force(self, q: Vector, v: Vector) -> Vector:
        """Force (2,) on what is held back, where it touches, by complex numbers, too."""
        away, moves = self.rows @ q - self.centre, self.rows @ v
        radius = np.sqrt(away @ away)
        n = away / radius
        depth, rate = self.sense * (radius - self.clearance), self.sense * (n @ moves)
        power = depth * (depth * depth) ** (0.5 * (self.exponent - 1.0))  # odd beyond the switch
        pressed = self.stiffness * power * (1.0 + self.dissipation * rate)
        return pressed * (self.sense * n + self.rub * np.array([-n[1], n[0]]))

    def work_rate(self, q: Vector, v: Vector, surface: float) -> float:
        """Normal force times the speed of sliding of a surface that itself moves so fast."""
        away = self.rows @ q - self.centre
        n = away / np.hypot(*away)
        x, y = self.rows @ v
        across = float(n[0] * y - n[1] * x)
        return float(self.sense * (self.force(q, v) @ n)) * abs(across + surface)


@dataclass(frozen=True)
class Rotor:
    """M q'' + C q' + K q = load(t) - forces of rings."""

    mass: Vector
    damping: Vector
    stiffness: Vector
    load: Callable[[float], Vector]
    rings: list[Ring]
    surface: float = 0.0  # speed of what turns

    def acceleration(self, t: float, q: Vector, v: Vector, closed: list[bool]) -> Vector:
        total = self.load(t) - self.damping @ v - self.stiffness @ q
        for ring, touches in zip(self.rings, closed, strict=True):
            if touches:
                total = total - ring.rows.T @ ring.force(q, v)
        return np.linalg.solve(self.mass, total)

    def jacobian(self, t: float, y: Vector, closed: list[bool]) -> Vector:
        """Of the rates by the state, by complex steps."""
        n = y.size // 2
        found = np.zeros((2 * n, 2 * n))
        found[:n, n:] = np.eye(n)
        for j in range(2 * n):
            there = y.astype(complex)
            there[j] += 1e-30j
            found[n:, j] = self.acceleration(t, there[:n], there[n:], closed).imag / 1e-30
        return found

    def followed(
        self, y: Vector, end: float, longest: float, *, columns: bool = False
    ) -> tuple[Vector, Vector, int, float]:
        """State and its derivatives by the start at a time, from zero on, and the events passed.

        And how much the rings have worked: normal force times way of sliding.
        """
        n, t, count = y.size // 2, 0.0, 0
        closed = [ring.depth(y[:n]) > 0.0 for ring in self.rings]
        z = np.concatenate([y, np.eye(2 * n).ravel() if columns else [], [0.0]])

        def rate(t: float, z: Vector) -> Vector:
            q, v = z[:n], z[n : 2 * n]
            moved = [v, self.acceleration(t, q, v, closed)]
            if columns:
                by = self.jacobian(t, z[: 2 * n], closed)
                moved.append((by @ z[2 * n : -1].reshape(2 * n, -1)).ravel())
            rubbing = zip(self.rings, closed, strict=True)
            moved.append([sum(r.work_rate(q, v, self.surface) for r, now in rubbing if now)])
            return np.concatenate(moved)

        while t < end:
            events = []
            for ring, touches in zip(self.rings, closed, strict=True):

                def event(t: float, z: Vector, ring: Ring = ring) -> float:
                    return ring.depth(z[:n])

                event.terminal = True  # type: ignore[attr-defined]
                event.direction = -1.0 if touches else 1.0  # type: ignore[attr-defined]
                events.append(event)
            run = solve_ivp(
                rate, (t, end), z, method="DOP853", rtol=1e-12, atol=1e-15, max_step=longest,
                events=events,
            )  # fmt: skip
            t, z = float(run.t[-1]), run.y[:, -1]
            for i, times in enumerate(run.t_events or []):
                if run.status == 1 and times.size:
                    closed[i] = not closed[i]
                    count += 1
        by = z[2 * n : -1].reshape(2 * n, -1) if columns else np.eye(0)
        return z[: 2 * n], by, count, float(z[-1])
