"""Motions in round clearances, computed without the flow map: integration from event to event."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Vector = NDArray[Any]
OPEN = -2  # what a ring does; 1 or -1 is the sense in which its surface slides, 0 that it sticks


@dataclass(frozen=True)
class Ring:
    """A ring (`sense` 1) or a pin (-1): k δ^p (1 + a δ') along the radius, friction across.

    `rows` (2, n) give the displacements along both directions; `surface` is the speed of the body's
    surface on the other one, from the first direction to the second.
    """

    rows: Vector
    stiffness: float
    clearance: float
    exponent: float = 1.0
    centre: tuple[float, float] = (0.0, 0.0)
    sense: float = 1.0
    dissipation: float = 0.0
    friction: float = 0.0
    surface: float = 0.0

    def turned(self, q: Vector) -> tuple[Vector, Vector, Any]:
        """Unit vectors away from the centre and across, and the distance from it."""
        away = self.rows @ q - self.centre
        radius = np.sqrt(away @ away)
        n = away / radius
        return n, np.array([-n[1], n[0]]), radius

    def depth(self, q: Vector) -> float:
        return float(self.sense * (self.turned(q)[2] - self.clearance))

    def slip(self, q: Vector, v: Vector) -> Any:
        """Speed of sliding."""
        return self.turned(q)[1] @ (self.rows @ v) + self.surface

    def pressed(self, q: Vector, v: Vector) -> Any:
        """Normal force where it touches."""
        n, _, radius = self.turned(q)
        depth, rate = self.sense * (radius - self.clearance), self.sense * (n @ (self.rows @ v))
        power = depth * (depth * depth) ** (0.5 * (self.exponent - 1.0))  # odd beyond the switch
        return self.stiffness * power * (1.0 + self.dissipation * rate)


@dataclass(frozen=True)
class Rotor:
    """M q'' + C q' + K q = load(t) - forces of rings."""

    mass: Vector
    damping: Vector
    stiffness: Vector
    load: Callable[[float], Vector]
    rings: list[Ring]

    def motion(self, t: float, q: Vector, v: Vector, ways: list[int]) -> tuple[Vector, list[Any]]:
        """Accelerations, and the force across of each ring: by complex numbers, too."""
        total = self.load(t) - self.damping @ v - self.stiffness @ q
        held, pace, across = [], [], [0.0 * q[0] for _ in ways]
        for i, (ring, way) in enumerate(zip(self.rings, ways, strict=True)):
            if way == OPEN:
                continue
            n, turned, radius = ring.turned(q)
            pressed, moves = ring.pressed(q, v), ring.rows @ v
            across[i] = way * ring.friction * pressed
            total = total - ring.rows.T @ (ring.sense * pressed * n + across[i] * turned)
            if way == 0:
                held.append((i, ring.rows.T @ turned))
                pace.append((turned @ moves) * (n @ moves) / radius)
        moved = np.linalg.solve(self.mass, total)
        if held:
            pull = np.array([row for _, row in held])
            yields = np.linalg.solve(self.mass, pull.T)
            forces = np.linalg.solve(pull @ yields, pull @ moved - np.array(pace))
            moved = moved - yields @ forces
            for (i, _), force in zip(held, forces, strict=True):
                across[i] = force
        return moved, across

    def rates(self, t: float, y: Vector, ways: list[int]) -> Vector:
        n = y.size // 2
        return np.concatenate([y[n:], self.motion(t, y[:n], y[n:], ways)[0]])

    def margin(self, t: float, y: Vector, i: int, ways: list[int]) -> float:
        """What changes its sign, downwards, where a ring begins to do something else."""
        n, ring = y.size // 2, self.rings[i]
        if ways[i] != 0:
            return float(ways[i] * ring.slip(y[:n], y[n:]))
        across = self.motion(t, y[:n], y[n:], ways)[1][i]
        return float(ring.friction * ring.pressed(y[:n], y[n:]) - abs(across))

    def met(self, t: float, y: Vector, i: int, ways: list[int]) -> list[int]:
        """What the rings do where one has come to rest: it sticks, or slides the other way."""
        found = [*ways[:i], 0, *ways[i + 1 :]]
        if self.margin(t, y, i, found) < 0.0:
            n = y.size // 2
            found[i] = int(np.sign(self.motion(t, y[:n], y[n:], found)[1][i]))
        return found

    def closed(self, y: Vector, i: int) -> int:
        """What a ring does as it closes."""
        n, ring = y.size // 2, self.rings[i]
        return int(np.sign(ring.slip(y[:n], y[n:]))) if ring.friction else 1

    def followed(
        self, y: Vector, end: float, longest: float, *, columns: bool = False
    ) -> tuple[Vector, Vector, list[list[int]], float]:
        """State and its derivatives by the start at a time, from zero on, and all that rings did.

        And how much the rings have worked: normal force times way of sliding.
        """
        n, t = y.size // 2, 0.0
        ways = [
            self.closed(y, i) if ring.depth(y[:n]) > 0.0 else OPEN
            for i, ring in enumerate(self.rings)
        ]
        passed = [ways]
        z = np.concatenate([y, np.eye(2 * n).ravel() if columns else [], [0.0]])

        def rate(t: float, z: Vector) -> Vector:
            q, v = z[:n], z[n : 2 * n]
            moved = [self.rates(t, z[: 2 * n], ways)]
            if columns:
                by = differentiated(lambda y: self.rates(t, y, ways), z[: 2 * n])
                moved.append((by @ z[2 * n : -1].reshape(2 * n, -1)).ravel())
            work = [
                ring.pressed(q, v) * abs(ring.slip(q, v))
                for ring, way in zip(self.rings, ways, strict=True)
                if way not in (OPEN, 0)
            ]
            return np.concatenate([*moved, [sum(work)]])

        while t < end:
            events, of = self._events(ways)
            run = solve_ivp(
                rate, (t, end), z, method="DOP853", rtol=1e-12, atol=1e-15, max_step=longest,
                events=events,
            )  # fmt: skip
            t, z = float(run.t[-1]), run.y[:, -1].copy()
            for (i, turns), times in zip(of, run.t_events or [], strict=True):
                if run.status != 1 or not times.size:
                    continue
                before, ways = ways, self._after(t, z[: 2 * n], i, ways, turns)
                passed.append(ways)
                if columns and turns and before[i] != 0:
                    self._jump(t, z, i, before, ways)
        by = z[2 * n : -1].reshape(2 * n, -1) if columns else np.eye(0)
        return z[: 2 * n], by, passed, float(z[-1])

    def _events(self, ways: list[int]) -> tuple[list[Any], list[tuple[int, bool]]]:
        """What may happen next, of which ring, and whether that sticks, slips or turns."""
        n, events, of = self.mass.shape[0], [], []
        for i, ring in enumerate(self.rings):

            def touch(t: float, z: Vector, ring: Ring = ring) -> float:
                return ring.depth(z[:n])

            def turn(t: float, z: Vector, i: int = i) -> float:
                return self.margin(t, z[: 2 * n], i, ways)

            touch.terminal = turn.terminal = True  # type: ignore[attr-defined]
            touch.direction = 1.0 if ways[i] == OPEN else -1.0  # type: ignore[attr-defined]
            turn.direction = -1.0  # type: ignore[attr-defined]
            rubs = ways[i] != OPEN and ring.friction > 0.0
            events += [touch, turn] if rubs else [touch]
            of += [(i, False), (i, True)] if rubs else [(i, False)]
        return events, of

    def _after(self, t: float, y: Vector, i: int, ways: list[int], turns: bool) -> list[int]:
        """What the rings do after an event of one."""
        n = y.size // 2
        if turns and ways[i] != 0:
            return self.met(t, y, i, ways)
        if turns:
            new = int(np.sign(self.motion(t, y[:n], y[n:], ways)[1][i]))
        else:
            new = self.closed(y, i) if ways[i] == OPEN else OPEN
        return [*ways[:i], new, *ways[i + 1 :]]

    def _jump(self, t: float, z: Vector, i: int, before: list[int], after: list[int]) -> None:
        """Derivatives at an instant that shifts, at which forces jump."""
        n = self.mass.shape[0]
        y, ring = z[: 2 * n], self.rings[i]
        old, new = self.rates(t, y, before), self.rates(t, y, after)
        slope = differentiated(lambda y: np.array([ring.slip(y[:n], y[n:])]), y)[0]
        by = z[2 * n : -1].reshape(2 * n, -1)
        z[2 * n : -1] = (by + np.outer(new - old, slope @ by) / (slope @ old)).ravel()


def differentiated(function: Callable[[Vector], Vector], y: Vector) -> Vector:
    """Jacobian of a function, by complex steps."""
    columns = []
    for j in range(y.size):
        there = y.astype(complex)
        there[j] += 1e-30j
        columns.append(function(there).imag / 1e-30)
    return np.array(columns).T


def turns(passed: list[list[int]]) -> tuple[int, int, int]:
    """How often rings stick, slip, and slide the other way at once."""
    pairs = [(a, b) for old, new in pairwise(passed)
             for a, b in zip(old, new, strict=True) if OPEN not in (a, b)]  # fmt: skip
    return (
        sum(a != 0 and b == 0 for a, b in pairs),
        sum(a == 0 and b != 0 for a, b in pairs),
        sum(a * b < 0 for a, b in pairs),
    )
