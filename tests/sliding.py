"""Motions with dry friction, computed without the flow map: integration from event to event."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from nldyn.system import Friction

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Contact:
    """Where a body slides along `tangent`, pressed on by a constant force or by a stop.

    The stop is k (normal . q - gap)^p.
    """

    tangent: Vector
    law: Friction
    force: float = 0.0
    normal: Vector | None = None
    stiffness: float = 0.0
    exponent: float = 1.0
    gap: float = 0.0

    def depth(self, y: Vector) -> float:
        return float(self.normal @ y[: self.normal.size]) - self.gap

    def pressed(self, y: Vector) -> float:
        if self.normal is None:
            return self.force
        return self.stiffness * max(self.depth(y), 0.0) ** self.exponent

    def slip(self, y: Vector) -> float:
        return float(self.tangent @ y[self.tangent.size :]) - self.law.base_speed


@dataclass(frozen=True)
class Wall:
    """A rigid stop that ``normal . q`` hits at a gap."""

    normal: Vector
    gap: float
    restitution: float

    def open(self, y: Vector) -> float:
        return self.gap - float(self.normal @ y[: self.normal.size])


@dataclass
class Body:
    """M q'' + C q' + K q = load(t) - contact forces, with a mode of each contact.

    It rebounds from walls, and does not come to rest on them.

    Modes: nan for an open one, 0 where it sticks, else the sign of its speed. Times and ways are
    what `followed` adds up: how long each contact sticks and slides, and how far.
    """

    mass: Vector
    damping: Vector
    stiffness: Vector
    load: Callable[[float], Vector]
    contacts: list[Contact]
    walls: list[Wall] = field(default_factory=list)
    modes: list[float] = field(default_factory=list)
    stuck: Vector = field(default_factory=lambda: np.zeros(0))
    slid: Vector = field(default_factory=lambda: np.zeros(0))
    way: Vector = field(default_factory=lambda: np.zeros(0))

    def acting(self, t: float, y: Vector) -> tuple[Vector, dict[int, float]]:
        """All forces, and what holds those that stick."""
        n = y.size // 2
        total = self.load(t) - self.damping @ y[n:] - self.stiffness @ y[:n]
        held = []
        for i, (contact, mode) in enumerate(zip(self.contacts, self.modes, strict=True)):
            normal = contact.pressed(y)
            if contact.normal is not None:
                total = total - contact.normal * normal
            if mode == 0.0:
                held.append(i)
            elif not np.isnan(mode):
                law = float(contact.law.at(contact.slip(y)))
                total = total - contact.tangent * mode * law * normal
        if not held:
            return total, {}
        rows = np.array([self.contacts[i].tangent for i in held])
        moved = np.linalg.solve(self.mass, np.column_stack([rows.T, total]))
        forces = np.linalg.solve(rows @ moved[:, :-1], rows @ moved[:, -1])
        return total - rows.T @ forces, dict(zip(held, forces.tolist(), strict=True))

    def rate(self, t: float, y: Vector) -> Vector:
        n = y.size // 2
        return np.concatenate([y[n:], np.linalg.solve(self.mass, self.acting(t, y)[0])])

    def let_slip(self, t: float, y: Vector) -> None:
        """Let those slide that need more than their friction to stick, one by one."""
        for _ in self.contacts:
            loads = {
                i: abs(force) / max(self.grip(i, y), 1e-300)
                for i, force in self.acting(t, y)[1].items()
            }
            if not loads or max(loads.values()) <= 1.0:
                return
            worst = max(loads, key=loads.__getitem__)
            self.modes[worst] = float(np.sign(self.acting(t, y)[1][worst]))

    def grip(self, i: int, y: Vector) -> float:
        return float(self.contacts[i].law.at(0.0)) * self.contacts[i].pressed(y)

    def begin(self, t: float, y: Vector) -> None:
        self.modes = [
            np.nan if c.normal is not None and c.depth(y) < 0.0 else self.pressed_mode(c, y)
            for c in self.contacts
        ]
        self.let_slip(t, y)

    def pressed_mode(self, contact: Contact, y: Vector) -> float:
        return float(np.sign(contact.slip(y))) if abs(contact.slip(y)) > 1e-12 else 0.0

    def events(self) -> list[tuple[int, str, Callable[[float, Vector], float]]]:
        found: list[tuple[int, str, Callable[[float, Vector], float]]] = []
        for i, (contact, mode) in enumerate(zip(self.contacts, self.modes, strict=True)):
            if contact.normal is not None:
                sign = -1.0 if np.isnan(mode) else 1.0
                found.append((i, "switch", lambda t, y, c=contact, s=sign: s * c.depth(y)))
            if mode == 0.0:
                found.append((i, "slip", lambda t, y, i=i: self._margin(t, y, i)))
            elif not np.isnan(mode):
                found.append((i, "stop", lambda t, y, c=contact, s=mode: s * c.slip(y)))
        for i, wall in enumerate(self.walls):
            found.append((i, "hit", lambda t, y, w=wall: w.open(y)))
        for _, _, event in found:
            event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        return found

    def _margin(self, t: float, y: Vector, i: int) -> float:
        return self.grip(i, y) - abs(self.acting(t, y)[1][i])

    def pass_event(self, t: float, y: Vector, i: int, kind: str) -> Vector:
        if kind == "hit":
            return self.rebound(t, y, self.walls[i])
        contact = self.contacts[i]
        if kind == "slip":
            self.modes[i] = float(np.sign(self.acting(t, y)[1][i]))
        elif kind == "switch":
            opens = not np.isnan(self.modes[i])
            self.modes[i] = np.nan if opens else self.pressed_mode(contact, y)
            self.let_slip(t, y)
        else:
            self.modes[i] = 0.0
            push = np.linalg.solve(self.mass, contact.tangent)
            y = y.copy()
            y[push.size :] -= push * contact.slip(y) / float(contact.tangent @ push)
            self.let_slip(t, y)
        return y

    def rebound(self, t: float, y: Vector, wall: Wall) -> Vector:
        """The state behind an impact; what acts then slides or sticks by its new speed."""
        n, push = y.size // 2, np.linalg.solve(self.mass, wall.normal)
        y = y.copy()
        speed = float(wall.normal @ y[n:])
        y[n:] -= push * (1.0 + wall.restitution) * speed / float(wall.normal @ push)
        self.modes = [
            mode if np.isnan(mode) else self.pressed_mode(contact, y)
            for contact, mode in zip(self.contacts, self.modes, strict=True)
        ]
        self.let_slip(t, y)
        return y

    def followed(self, y: Vector, end: float, longest: float) -> tuple[Vector, int]:
        """The state at a time, from one at zero on, and how many events there were."""
        t, count = 0.0, 0
        self.stuck, self.slid, self.way = np.zeros((3, len(self.contacts)))
        self.begin(t, y)
        while t < end:
            events = self.events()
            run = solve_ivp(
                self.rate, (t, end), y, method="DOP853", rtol=1e-12, atol=1e-15,
                max_step=longest, events=[event for _, _, event in events],
            )  # fmt: skip
            self.add_up(float(run.t[-1]) - t, run.y[:, -1] - y)
            t, y = float(run.t[-1]), run.y[:, -1]
            for (i, kind, _), times in zip(events, run.t_events or [], strict=True):
                if run.status == 1 and times.size:
                    y = self.pass_event(t, y, i, kind)
                    count += 1
        return y, count

    def add_up(self, time: float, change: Vector) -> None:
        """Count a time without events, in which the state changes by so much."""
        for i, (contact, mode) in enumerate(zip(self.contacts, self.modes, strict=True)):
            self.stuck[i] += time * (mode == 0.0)
            if abs(mode) == 1.0:
                moved = float(contact.tangent @ change[: contact.tangent.size])
                self.slid[i] += time
                self.way[i] += abs(moved - contact.law.base_speed * time)
