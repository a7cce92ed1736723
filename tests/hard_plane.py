"""Motions that slide over a plane without a spring, computed without the flow map.

Sliding is integrated over s with dt = |v| ds, in which what comes to rest does so as an
exponential, and all right-hand sides are smooth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Vector = NDArray[np.float64]
NO_SPEED = 1e-12  # times the fastest: what is left where it rests
PULLED, LET_GO = 1e-6, 1e-4  # time after which what leaves with a pull, or without, is on its way
SURE = 1e-3  # the same after which its speed is far above what it is computed with


@dataclass
class Body:
    """M q'' + C q' + K q = load(t) - contact forces of one that slides over two `tangents` (2, n).

    It is pressed on by a constant force or by a stop k (normal . q - gap)^p, and what it slides on
    moves along both tangents. `met` tells the events.
    """

    mass: Vector
    damping: Vector
    stiffness: Vector
    load: Callable[[float], Vector]
    tangents: Vector
    coefficient: float
    force: float = 0.0
    normal: Vector | None = None
    spring: float = 0.0
    exponent: float = 1.0
    gap: float = 0.0
    base_speed: tuple[float, float] = (0.0, 0.0)
    mode: str = "slides"
    met: list[str] = field(default_factory=list)

    @property
    def size(self) -> int:
        return len(self.mass)

    def depth(self, y: Vector) -> float:
        assert self.normal is not None
        return float(self.normal @ y[: self.size]) - self.gap

    def pressed(self, y: Vector) -> float:
        if self.normal is None:
            return self.force
        return self.spring * max(self.depth(y), 0.0) ** self.exponent

    def speed(self, y: Vector) -> Vector:
        return np.asarray(self.tangents @ y[self.size :] - np.array(self.base_speed))

    def without_friction(self, t: float, y: Vector) -> Vector:
        """All other forces."""
        n = self.size
        total = self.load(t) - self.damping @ y[n:] - self.stiffness @ y[:n]
        return total if self.normal is None else total - self.normal * self.pressed(y)

    def mobility(self) -> Vector:
        return np.asarray(self.tangents @ np.linalg.solve(self.mass, self.tangents.T))

    def holding(self, t: float, y: Vector) -> Vector:
        """What would keep the speed along the plane."""
        paces = self.tangents @ np.linalg.solve(self.mass, self.without_friction(t, y))
        return np.linalg.solve(self.mobility(), paces)

    def rate(self, t: float, y: Vector, friction: Vector) -> Vector:
        total = self.without_friction(t, y) - friction @ self.tangents
        return np.concatenate([y[self.size :], np.linalg.solve(self.mass, total)])

    def slid(self, t: float, y: Vector) -> Vector:
        v = self.speed(y)
        return self.rate(t, y, self.coefficient * self.pressed(y) * v / np.hypot(*v))

    def slowing(self, t: float, y: Vector) -> Vector:
        """The stiff part of the derivatives of `slid`: that of the direction of friction."""
        n, v = self.size, self.speed(y)
        across = np.eye(2) - np.outer(v, v) / (v @ v)
        turn = self.coefficient * self.pressed(y) / np.hypot(*v) * across
        J = np.zeros((2 * n, 2 * n))
        J[:n, n:] = np.eye(n)
        J[n:, n:] = -np.linalg.solve(self.mass, self.tangents.T @ turn @ self.tangents)
        return J

    def held(self, t: float, y: Vector) -> Vector:
        return self.rate(t, y, self.holding(t, y))

    def free(self, t: float, y: Vector) -> Vector:
        return self.rate(t, y, np.zeros(2))

    def margin(self, t: float, y: Vector) -> float:
        return self.coefficient * self.pressed(y) * (1.0 + 1e-13) - float(
            np.hypot(*self.holding(t, y))
        )

    def openings(self) -> list[Callable[[float, Vector], float]]:
        return [] if self.normal is None else [lambda t, y: self.depth(y)]

    def run(
        self, rate: Callable[[float, Vector], Vector], t: float, y: Vector, end: float,
        events: list[Callable[[float, Vector], float]], method: str = "DOP853",
        longest: float = 0.2,
    ) -> tuple[float, Vector, int]:  # fmt: skip
        """To the first event, whose number is told, or to the end, -1."""
        for event in events:
            event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        stiff = {"jac": self.slowing} if method != "DOP853" else {}
        found = solve_ivp(rate, (t, end), y, method, rtol=2e-13, atol=1e-14, events=events,
                          max_step=longest, **stiff)  # fmt: skip
        hit = [i for i, times in enumerate(found.t_events or []) if times.size]
        return float(found.t[-1]), found.y[:, -1], hit[0] if found.status == 1 else -1

    def stopped(self, y: Vector) -> Vector:
        """The state without what is left of the speed."""
        y = y.copy()
        pulled = np.linalg.solve(self.mobility(), self.speed(y))
        y[self.size :] -= np.linalg.solve(self.mass, pulled @ self.tangents)
        return y

    def leave(self, t: float, y: Vector, end: float) -> tuple[float, Vector]:
        """From rest on, along u with (R B + σ) u = B h, to where it is on its way."""
        B, h, most = self.mobility(), self.holding(t, y), self.coefficient * self.pressed(y)

        def along(more: float) -> Vector:
            return np.linalg.solve(most * B + more * np.eye(2), B @ h)

        def excess(more: float) -> float:
            return float(np.hypot(*along(more))) - 1.0

        more = brentq(excess, 0.0, 2.0 * float(np.hypot(*(B @ h)))) if excess(0.0) > 1e-9 else 0.0
        u = along(more)
        begun = PULLED if more > 0.0 else LET_GO
        t, y, _ = self.run(self.held, t, y, t + begun, [])
        # what would hold it grows, and friction with what presses it on
        lacks = float(u @ (self.holding(t, y) - h)) - (self.coefficient * self.pressed(y) - most)
        v = u * begun * (more + 0.5 * lacks / float(u @ np.linalg.solve(B, u)))
        y[self.size :] += np.linalg.solve(self.mass, np.linalg.solve(B, v) @ self.tangents)
        t, y, _ = self.run(self.slid, t, y, min(t + SURE, end), [], "Radau")
        return t, y

    def speed_up(self, t: float, y: Vector, end: float) -> tuple[float, Vector, int]:
        """To its fastest (0), to where the stop opens (1), or to the end (-1).

        It is so slow at first that the equations are stiff.
        """

        def growth(t: float, y: Vector) -> float:
            return float(self.speed(y) @ self.tangents @ self.slid(t, y)[self.size :])

        return self.run(self.slid, t, y, end, [growth, *self.openings()], "LSODA")

    def slide(self, t: float, y: Vector, end: float) -> tuple[float, Vector, int]:
        """To rest (0), to where the stop opens (1), or to the end (-1)."""
        fastest = max(float(np.hypot(*self.speed(y))), 1e-3)

        def extended(_: float, z: Vector) -> Vector:
            fast = np.hypot(*self.speed(z[:-1]))
            return np.asarray(fast * np.append(self.slid(z[-1], z[:-1]), 1.0))

        opens = [lambda s, z, f=f: f(z[-1], z[:-1]) for f in self.openings()]
        events = [
            lambda s, z: float(np.hypot(*self.speed(z[:-1]))) - NO_SPEED * fastest,
            lambda s, z: end - z[-1],
            *opens,
        ]
        _, z, which = self.run(extended, 0.0, np.append(y, t), 1e9, events, longest=np.inf)
        return float(z[-1]), z[:-1], {0: 0, 1: -1, 2: 1}[which]

    def followed(self, y: Vector, end: float) -> Vector:
        """The state at a time, from one that slides or is open at zero on."""
        t, left, self.met = 0.0, False, []
        self.mode = "open" if self.normal is not None and self.depth(y) < 0.0 else "slides"
        while t < end:
            if self.mode == "open":
                t, y, which = self.run(self.free, t, y, end, [lambda t, y: -self.depth(y)])
                if which < 0:
                    break
                self.mode = "slides"
                self.met.append("close")
            elif self.mode == "slides":
                ways = [self.speed_up, self.slide] if left else [self.slide]
                left = False
                for way in ways:
                    t, y, which = way(t, y, end)
                    if which != 0:
                        break
                if which < 0:
                    break
                if which == 1:
                    self.mode = "open"
                    self.met.append("open")
                    continue
                y = self.stopped(y)
                if self.margin(t, y) > 0.0:
                    self.mode = "sticks"
                    self.met.append("stick")
                else:
                    t, y = self.leave(t, y, end)
                    left = True
                    self.met.append("turn")
            else:
                t, y, which = self.run(self.held, t, y, end, [lambda t, y: self.margin(t, y)])
                if which < 0:
                    break
                self.mode = "slides"
                self.met.append("slip")
                t, y = self.leave(t, self.stopped(y), end)
                left = True
        return y
