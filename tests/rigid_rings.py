"""Motions in rigid round clearances, without the flow map: integration from event to event."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Vector = NDArray[Any]
OPEN = -2  # what a ring does; 1 or -1 is the sense in which its surface slides, 0 that it sticks
LOW = 1e-7  # m/s: a rebound that is the last of its series
SOON = 1e-5  # of the longest step: in which what has been let go does not come back


@dataclass(frozen=True)
class RigidRing:
    """A rigid ring (`sense` 1) or pin (-1), with restitution, and friction across.

    `rows` (2, n) give the displacements along both directions; `surface` is the speed of the body's
    surface on the other one, from the first direction to the second.
    """

    rows: Vector
    restitution: float
    clearance: float
    centre: tuple[float, float] = (0.0, 0.0)
    sense: float = 1.0
    friction: float = 0.0
    surface: float = 0.0

    def place(self, q: Vector) -> tuple[Vector, Vector, float]:
        """Unit vectors to where it presses and across, and the distance from the centre."""
        away = self.rows @ q - self.centre
        radius = float(np.hypot(*away))
        n = away / radius
        return self.sense * n, np.array([-n[1], n[0]]), radius

    def depth(self, q: Vector) -> float:
        return self.sense * (self.place(q)[2] - self.clearance)

    def slip(self, q: Vector, v: Vector) -> float:
        return float(self.place(q)[1] @ self.rows @ v) + self.surface


def blow(M: Vector, e: float, mu: float, closing: float, slip: float) -> Vector:
    """Impulses (2,) along the normal and across, of Routh's method: M (2, 2) are the mobilities."""
    speeds, total, compressed = np.array([closing, slip]), np.zeros(2), None
    way = float(np.sign(slip))
    for _ in range(6):
        if way == 0.0:  # sticks, or slides on as it is driven
            sticks = -M[0, 1] / M[1, 1]
            share = sticks if abs(sticks) <= mu else float(np.copysign(mu, sticks))
        else:
            share = way * mu
        taken = M @ np.array([1.0, share])
        left = np.inf if compressed is None else (1.0 + e) * compressed - total[0]
        if compressed is None and taken[0] > 0.0:
            left = min(left, speeds[0] / taken[0])
        stops = speeds[1] / taken[1] if way != 0.0 and way * taken[1] > 0.0 else np.inf
        step = min(left, stops)
        total, speeds = total + step * np.array([1.0, share]), speeds - step * taken
        if stops <= left:
            way, speeds[1] = 0.0, 0.0
        elif compressed is None:
            compressed = total[0]
        else:
            return total
        if compressed is not None and (1.0 + e) * compressed <= total[0]:
            return total
    raise AssertionError("an impact that does not end")


@dataclass
class RigidRotor:
    """M q'' + C q' + K q = load(t) - forces of rigid rings."""

    mass: Vector
    damping: Vector
    stiffness: Vector
    load: Callable[[float], Vector]
    rings: list[RigidRing]

    def __post_init__(self) -> None:
        self.n, self.inverse = len(self.mass), np.linalg.inv(self.mass)
        self.hits, self.rested, self.turned = 0, 0.0, 0
        self.ways = [OPEN] * len(self.rings)

    def motion(self, t: float, y: Vector) -> tuple[Vector, Vector]:
        """Accelerations (n,), and forces (rings, 2) along the normal and across."""
        q, v = y[: self.n], y[self.n :]
        moved = self.inverse @ (self.load(t) - self.damping @ v - self.stiffness @ q)
        pulls, columns, paces, of = [], [], [], []
        for i, (ring, way) in enumerate(zip(self.rings, self.ways, strict=True)):
            if way == OPEN:
                continue
            n, across, radius = ring.place(q)
            w, u = across @ ring.rows @ v, ring.sense * (n @ ring.rows @ v)
            pulls.append(ring.rows.T @ n)
            paces.append(-ring.sense * w * w / radius)
            columns.append(ring.rows.T @ (n + way * ring.friction * across))
            of.append((i, 0))
            if way == 0:
                columns[-1] = ring.rows.T @ n
                pulls.append(ring.rows.T @ across)
                columns.append(pulls[-1])
                paces.append(w * u / radius)
                of.append((i, 1))
        forces = np.zeros((len(self.rings), 2))
        if pulls:
            pull, column = np.array(pulls), np.array(columns).T
            held = np.linalg.solve(pull @ self.inverse @ column, pull @ moved - np.array(paces))
            moved = moved - self.inverse @ column @ held
            for place, force in zip(of, held, strict=True):
                forces[place] = force
            for i, way in enumerate(self.ways):
                if way in (1, -1):
                    forces[i, 1] = way * self.rings[i].friction * forces[i, 0]
        return moved, forces

    def rates(self, t: float, y: Vector) -> Vector:
        return np.concatenate([y[self.n :], self.motion(t, y)[0]])

    def margin(self, t: float, y: Vector, i: int) -> float:
        """What changes its sign, downwards, where the surface comes to rest or slips."""
        if self.ways[i] != 0:
            return self.ways[i] * self.rings[i].slip(y[: self.n], y[self.n :])
        normal, across = self.motion(t, y)[1][i]
        return float(self.rings[i].friction * normal - abs(across))

    def events(self, late: bool) -> tuple[list[Any], list[tuple[int, str]]]:
        events: list[Any] = []
        of = []
        for i, (ring, way) in enumerate(zip(self.rings, self.ways, strict=True)):

            def touch(t: float, y: Vector, ring: RigidRing = ring) -> float:
                return ring.depth(y[: self.n])

            def leave(t: float, y: Vector, i: int = i) -> float:
                return float(self.motion(t, y)[1][i, 0])

            def turn(t: float, y: Vector, i: int = i) -> float:
                return self.margin(t, y, i)

            kinds = [("touch", touch, 1.0)] if way == OPEN and late else []
            if way != OPEN:
                kinds = [("leave", leave, -1.0)]
            if way != OPEN and ring.friction > 0.0:
                kinds.append(("turn", turn, -1.0))
            for kind, event, direction in kinds:
                event.terminal, event.direction = True, direction
                events.append(event)
                of.append((i, kind))
        return events, of

    def press(self, t: float, y: Vector, i: int) -> Vector:
        """The state with a ring closed on which it comes to rest, if that holds it."""
        ring, y = self.rings[i], y.copy()
        n = ring.place(y[: self.n])[0]
        for part, value in ((0, ring.depth(y[: self.n])), (1, n @ ring.rows @ y[self.n :])):
            pull = self.inverse @ ring.rows.T @ n
            y[part * self.n : (part + 1) * self.n] -= pull * value / (n @ ring.rows @ pull)
        slip = ring.slip(y[: self.n], y[self.n :])
        self.ways[i] = 1 if ring.friction == 0.0 else int(np.sign(slip))
        if ring.friction > 0.0 and abs(slip) < LOW:
            self.ways[i] = 0
            if self.margin(t, y, i) < 0.0:
                self.ways[i] = int(np.sign(self.motion(t, y)[1][i, 1]))
        if self.motion(t, y)[1][i, 0] <= 0.0:
            self.ways[i] = OPEN
        return y

    def closing(self, y: Vector, i: int) -> float:
        """Speed at which a ring closes."""
        ring = self.rings[i]
        return float(ring.place(y[: self.n])[0] @ ring.rows @ y[self.n :])

    def pushed(self, t: float, y: Vector, i: int) -> float:
        """Acceleration at which it does."""
        ring = self.rings[i]
        n, across, radius = ring.place(y[: self.n])
        w = float(across @ ring.rows @ y[self.n :])
        return float(n @ ring.rows @ self.motion(t, y)[0]) + ring.sense * w * w / radius

    def hit(self, y: Vector, i: int, e: float) -> Vector:
        """The state behind an impact with restitution e."""
        ring, y = self.rings[i], y.copy()
        n, across, _ = ring.place(y[: self.n])
        pull = ring.rows.T @ np.array([n, across]).T
        M, slip = pull.T @ self.inverse @ pull, ring.slip(y[: self.n], y[self.n :])
        impulse = blow(M, e, ring.friction, self.closing(y, i), slip)
        y[self.n :] -= self.inverse @ pull @ impulse
        return y

    def strike(self, t: float, y: Vector, first: int) -> tuple[Vector, float]:
        """The state behind an impact, with those that follow it at once, the fastest first.

        And the time of the shortest flight behind it.
        """
        shut = [i for i, way in enumerate(self.ways) if way != OPEN or i == first]
        pushes = {i: self.pushed(t, y, i) for i in shut}
        while True:
            i = max(shut, key=lambda i: self.closing(y, i))
            speed = self.closing(y, i)
            if speed <= 1e-13:
                break
            e = self.rings[i].restitution
            y = self.hit(y, i, 0.0 if e * speed < LOW and pushes[i] > 0.0 else e)
            self.hits += 1
        for i in shut:
            self.ways[i] = OPEN
        for i in shut:
            if abs(self.closing(y, i)) < 1e-12:
                y = self.press(t, y, i)
        flights = [
            -2.0 * self.closing(y, i) / push
            for i in shut
            if self.ways[i] == OPEN and (push := self.pushed(t, y, i)) > 0.0
        ]
        return y, min((each for each in flights if each > 0.0), default=np.inf)

    def turn(self, t: float, y: Vector, i: int) -> None:
        self.turned += 1
        if self.ways[i] == 0:
            self.ways[i] = int(np.sign(self.motion(t, y)[1][i, 1]))
            return
        self.ways[i] = 0
        if self.margin(t, y, i) < 0.0:
            self.ways[i] = int(np.sign(self.motion(t, y)[1][i, 1]))

    def followed(self, y: Vector, end: float, longest: float) -> Vector:
        """The state at a time, from one at zero on."""
        t, flight, late = 0.0, np.inf, True
        for i, ring in enumerate(self.rings):
            shut = abs(ring.depth(y[: self.n])) < 1e-12 * ring.clearance
            if shut and abs(ring.place(y[: self.n])[0] @ ring.rows @ y[self.n :]) < LOW:
                y = self.press(t, y, i)
        while t < end:
            goal = end if late else t + SOON * longest
            if flight < 4.0 * longest:
                goal = min(goal, t + 2.0 * flight)
            events, of = self.events(late)
            run = solve_ivp(
                self.rates, (t, min(goal, end)), y, method="DOP853", rtol=1e-12, atol=1e-15,
                max_step=min(longest, 0.4 * flight), events=events,
            )  # fmt: skip
            self.rested += float(run.t[-1] - t) * any(way != OPEN for way in self.ways)
            t, y, late, flight = float(run.t[-1]), run.y[:, -1].copy(), True, np.inf
            if run.status != 1:
                continue
            (i, kind) = next(p for p, at in zip(of, run.t_events or [], strict=True) if at.size)
            if kind == "touch":
                y, flight = self.strike(t, y, i)
            elif kind == "leave":
                self.ways[i], late = OPEN, False
            else:
                self.turn(t, y, i)
        return y
