"""Motions against a rigid stop with friction over a plane, computed without the flow map.

From event to event: sliding and impacts are integrated over s, with dt or dP = |u| ds, in which
what comes to rest does so as an exponential and all right-hand sides are smooth; an impact goes in
the velocities of all coordinates.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

Vector = NDArray[np.float64]
NONE = 1e-12  # of the speeds: one that is none
GONE = 1e-13  # the same of sliding in an impact, where it ends
LOW = 1e-14  # height of a rebound that is not followed
AWAY = 1e-4  # time after which what leaves the stop is off it
BEGUN = 1e-6  # time after which what is let go is on its way
STIFF = 1e-2  # the same until which a method for stiff equations takes it there


class UndecidedError(Exception):
    """What is at rest may go on in no way, or in several."""


@dataclass
class Body:
    """M q'' + C q' + K q = load(t) - forces of a stop at normal . q = gap.

    What touches it slides over two `tangents` (2, n), beside a base that moves along both. `met`
    tells the events.
    """

    mass: Vector
    damping: Vector
    stiffness: Vector
    load: Callable[[float], Vector]
    normal: Vector
    tangents: Vector
    gap: float
    restitution: float
    coefficient: float
    base_speed: tuple[float, float] = (0.0, 0.0)
    longest: float = 0.2
    met: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rows = np.vstack([self.normal, self.tangents])
        self.pushes = np.linalg.solve(self.mass, self.rows.T)
        self.yields = self.rows @ self.pushes  # speeds that unit impulses take

    @property
    def size(self) -> int:
        return len(self.mass)

    def speeds(self, y: Vector) -> Vector:
        """Of closing, and of sliding along both tangents."""
        return np.asarray(self.rows @ y[self.size :] - np.array([0.0, *self.base_speed]))

    def open(self, y: Vector) -> float:
        return self.gap - float(self.normal @ y[: self.size])

    def rate(self, t: float, y: Vector, forces: Vector) -> Vector:
        n = self.size
        total = self.load(t) - self.damping @ y[n:] - self.stiffness @ y[:n]
        return np.concatenate([y[n:], np.linalg.solve(self.mass, total) - self.pushes @ forces])

    def paces(self, t: float, y: Vector) -> Vector:
        """Accelerations along the normal and both tangents without forces of the stop."""
        return np.asarray(self.rows @ self.rate(t, y, np.zeros(3))[self.size :])

    def sliding(self, t: float, y: Vector, u: Vector) -> Vector:
        """Forces of the stop where it slides along u."""
        share = np.array([1.0, *(self.coefficient * u)])
        return np.asarray(share * self.paces(t, y)[0] / (self.yields[0] @ share))

    def holding(self, t: float, y: Vector) -> Vector:
        return np.asarray(np.linalg.solve(self.yields, self.paces(t, y)))

    def free(self, t: float, y: Vector) -> Vector:
        return self.rate(t, y, np.zeros(3))

    def margin(self, t: float, y: Vector) -> float:
        """How much friction could hold beyond what it does."""
        force = self.holding(t, y)
        return float(self.coefficient * force[0] * (1.0 + 1e-13) - np.hypot(*force[1:]))

    def slid(self, t: float, y: Vector) -> Vector:
        u = self.speeds(y)[1:]
        return self.rate(t, y, self.sliding(t, y, u / np.hypot(*u)))

    def run(
        self, rate: Callable[[float, Vector], Vector], t: float, y: Vector, end: float,
        events: list[Callable[[float, Vector], float]], method: str = "DOP853",
        longest: float = np.inf,
    ) -> tuple[float, Vector, int]:  # fmt: skip
        """To the first event, whose number is told, or to the end, -1."""
        for event in events:
            event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        found = solve_ivp(rate, (t, end), y, method, rtol=2e-13, atol=1e-14, events=events,
                          max_step=longest)  # fmt: skip
        hit = [i for i, times in enumerate(found.t_events or []) if times.size]
        return float(found.t[-1]), found.y[:, -1], hit[0] if found.status == 1 else -1

    def held(self, y: Vector, count: int) -> Vector:
        """The state on the stop, without speed along the first so many of normal and tangents."""
        y, n, own = y.copy(), self.size, self.pushes[:, :count]
        y[n:] -= own @ np.linalg.solve(self.yields[:count, :count], self.speeds(y)[:count])
        y[:n] += self.pushes[:, 0] / self.yields[0, 0] * self.open(y)
        return y

    def ways(self, t: float, y: Vector) -> list[tuple[float, Vector]]:
        """Directions in which what is at rest gets faster as it slides along them, and by what."""
        pace = self.paces(t, y)

        def gains(angle: float) -> Vector:
            u = np.array([np.cos(angle), np.sin(angle)])
            return pace[1:] - (self.yields @ self.sliding(t, y, u))[1:]

        def aside(angle: float) -> float:
            return float(np.cos(angle) * gains(angle)[1] - np.sin(angle) * gains(angle)[0])

        angles = np.linspace(0.0, 2.0 * np.pi, 721) + 0.1
        values, found = [aside(a) for a in angles], []
        for a, b, left, right in zip(angles, angles[1:], values, values[1:], strict=False):
            if left * right < 0.0:
                angle = brentq(aside, a, b, xtol=1e-15)
                u = np.array([np.cos(angle), np.sin(angle)])
                if self.sliding(t, y, u)[0] > 0.0:
                    found.append((float(u @ gains(angle)), u))
        return sorted(found, key=lambda way: way[0])

    def blow(self, y: Vector, restitution: float) -> Vector:
        """The state behind an impact."""
        n, mu, own, B = self.size, self.coefficient, self.pushes, self.yields[1:, 1:]
        begun, last = float(np.abs(y[n:]).max()), np.inf

        def rate(_: float, z: Vector) -> Vector:
            u = self.speeds(z[:-1])[1:]
            size = float(np.hypot(*u))
            moved = -size * own[:, 0] - mu * own[:, 1:] @ u
            return np.concatenate([np.zeros(n), moved, [size]])

        events = [
            lambda s, z: self.speeds(z[:-1])[0],
            lambda s, z: float(np.hypot(*self.speeds(z[:-1])[1:])) - GONE * begun,
        ]
        z = np.append(y, 0.0)
        if np.hypot(*self.speeds(y)[1:]) > NONE:
            _, z, which = self.run(rate, 0.0, z, 1e9, events)
            if which == 0:
                last = (1.0 + restitution) * z[-1]
                if restitution == 0.0:
                    return z[:-1]
                _, z, which = self.run(rate, 0.0, z, 1e9, [lambda s, z: last - z[-1], events[1]])
                if which == 0:
                    return z[:-1]
            left = np.linalg.solve(B, self.speeds(z[:-1])[1:])
            z[n:-1] -= own[:, 1:] @ left
        share = self.behind()
        lost = own @ np.array([1.0, *share])
        if last == np.inf:
            last = (1.0 + restitution) * (z[-1] + self.speeds(z[:-1])[0] / (self.normal @ lost))
        z[n:-1] -= lost * (last - z[-1])
        return z[:-1]

    def behind(self) -> Vector:
        """Friction per normal impulse from where nothing slides on."""
        B, both, mu = self.yields[1:, 1:], self.yields[1:, 0], self.coefficient
        share = np.linalg.solve(B, -both)
        if np.hypot(*share) <= mu:
            return share

        def along(more: float) -> Vector:
            return np.linalg.solve(mu * B + more * np.eye(2), -both)

        more = brentq(lambda x: np.hypot(*along(x)) - 1.0, 0.0, np.hypot(*both) + 1.0, xtol=1e-16)
        return mu * along(more)

    def strike(self, t: float, y: Vector) -> tuple[str, Vector]:
        self.met.append("hit")
        push, speed = self.paces(t, y)[0], self.speeds(y)[0]
        low = push > 0.0 and (self.restitution * speed) ** 2 < 2.0 * LOW * push
        restitution = 0.0 if low else self.restitution
        y = self.blow(y, restitution)
        if restitution > 0.0 and self.speeds(y)[0] < 0.0:
            return "leaves the stop", y
        return self.settled(t, y)

    def settled(self, t: float, y: Vector) -> tuple[str, Vector]:
        """What touches the stop without speed does, with the state in place."""
        u = self.speeds(y)[1:]
        if np.hypot(*u) > NONE * max(1.0, np.abs(y).max()):
            if self.yields[0] @ [1.0, *(self.coefficient * u / np.hypot(*u))] <= 0.0:
                raise UndecidedError
            if self.sliding(t, y, u / np.hypot(*u))[0] <= 0.0:
                return "leaves the stop", y
            return "slides", self.held(y, 1)
        y = self.held(y, 3)
        force, pace = self.holding(t, y), self.paces(t, y)[0]
        sticks = force[0] > 0.0 and np.hypot(*force[1:]) <= self.coefficient * force[0]
        ways = [way for way in self.ways(t, y) if way[0] > 1e-7]
        if sticks + (pace <= 0.0) + len(ways) != 1:
            raise UndecidedError
        if sticks:
            self.met.append("stick")
            return "sticks", y
        return ("leaves the stop", y) if pace <= 0.0 else ("leaves", y)

    def leave(self, t: float, y: Vector, end: float) -> tuple[float, Vector]:
        """From rest on to where it is on its way."""
        self.met.append("slip")
        more, u = self.ways(t, y)[-1]
        if not more > -1e-6:
            raise UndecidedError
        y = y + BEGUN * self.rate(t, y, self.sliding(t, y, u))
        y = self.held(y, 3)
        v = u * max(more * BEGUN, BEGUN**2)
        y[self.size :] += self.pushes @ np.linalg.solve(self.yields, np.array([0.0, *v]))
        t, y, _ = self.run(self.slid, t + BEGUN, y, min(t + STIFF, end), [], "Radau")
        return t, self.held(y, 1)

    def slide(self, t: float, y: Vector, end: float) -> tuple[float, Vector, int]:
        """To rest (0), to where the stop lets go (1), or to the end (-1)."""
        fastest = max(float(np.hypot(*self.speeds(y)[1:])), 0.1)

        def extended(_: float, z: Vector) -> Vector:
            fast = np.hypot(*self.speeds(z[:-1])[1:])
            return np.asarray(fast * np.append(self.slid(z[-1], z[:-1]), 1.0))

        events = [
            lambda s, z: float(np.hypot(*self.speeds(z[:-1])[1:])) - NONE * fastest,
            lambda s, z: end - z[-1],
            lambda s, z: float(self.paces(z[-1], z[:-1])[0]),
        ]
        _, z, which = self.run(extended, 0.0, np.append(y, t), 1e9, events)
        return float(z[-1]), z[:-1], {0: 0, 1: -1, 2: 1}[which]

    def followed(self, y: Vector, end: float) -> Vector:
        """The state at a time, from one that is open at zero on."""
        t, self.met, mode = 0.0, [], "open"
        while t < end:
            if mode == "leaves the stop":
                back = -2.0 * self.speeds(y)[0] / max(self.paces(t, y)[0], NONE)
                away = min(AWAY, 0.5 * back) if self.speeds(y)[0] < -NONE else AWAY
                t, y, _ = self.run(self.free, t, y, min(t + away, end), [])
                mode = "open"
            elif mode == "open":
                left = [lambda t, y: self.open(y)]
                t, y, which = self.run(self.free, t, y, end, left, longest=self.longest)
                if which >= 0:
                    mode, y = self.strike(t, y)
            elif mode == "slides":
                t, y, which = self.slide(t, y, end)
                if which < 0:
                    break
                if which == 1:
                    self.met.append("leave")
                    mode = "leaves the stop"
                else:
                    self.met.append("stop")
                    mode, y = self.settled(t, self.held(y, 3))
            elif mode == "leaves":
                t, y = self.leave(t, y, end)
                mode = "slides"
            else:
                margins = [
                    lambda t, y: float(self.holding(t, y)[0]),
                    lambda t, y: self.margin(t, y),
                ]
                t, y, which = self.run(
                    lambda t, y: self.rate(t, y, self.holding(t, y)), t, y, end, margins,
                    longest=self.longest,
                )  # fmt: skip
                y = self.held(y, 3)
                if which == 0:
                    self.met.append("leave")
                mode = {0: "leaves the stop", 1: "leaves", -1: "sticks"}[which]
        return y
