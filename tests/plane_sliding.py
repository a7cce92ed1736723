"""Motions that slide over planes, computed without the flow map, from event to event."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Vector = NDArray[np.float64]
FIRST_STEP = 1e-9
OPEN, STICKS, SLIDES = "open", "sticks", "slides"


@dataclass(frozen=True)
class Disc:
    """Where a body slides over the plane of two `tangents` (2, n) behind a spring.

    It is pressed on by a constant force or by a stop k (normal . q - gap)^p. What it slides on
    moves along both tangents.
    """

    tangents: Vector
    coefficient: float
    spring: float
    force: float = 0.0
    normal: Vector | None = None
    stiffness: float = 0.0
    exponent: float = 1.0
    gap: float = 0.0
    base_speed: tuple[float, float] = (0.0, 0.0)

    def depth(self, y: Vector) -> float:
        return float(self.normal @ y[: self.normal.size]) - self.gap

    def grip(self, y: Vector) -> float:
        if self.normal is None:
            return self.coefficient * self.force
        return self.coefficient * self.stiffness * max(self.depth(y), 0.0) ** self.exponent

    def grip_pace(self, y: Vector) -> float:
        if self.normal is None or self.depth(y) <= 0.0:
            return 0.0
        n, p = self.normal.size, self.exponent
        rate = self.stiffness * p * self.depth(y) ** (p - 1.0)
        return self.coefficient * rate * float(self.normal @ y[n : 2 * n])

    def speed(self, y: Vector) -> Vector:
        n = self.tangents.shape[1]
        return self.tangents @ y[n : 2 * n] - np.array(self.base_speed)


@dataclass
class Body:
    """M q'' + C q' + K q = load(t) - contact forces; the state ends with the sliders' places."""

    mass: Vector
    damping: Vector
    stiffness: Vector
    load: Callable[[float], Vector]
    contacts: list[Disc]
    modes: list[str] = field(default_factory=list)
    events_met: list[str] = field(default_factory=list)

    def strain(self, i: int, y: Vector) -> Vector:
        n = len(self.mass)
        return self.contacts[i].tangents @ y[:n] - y[2 * n + 2 * i : 2 * n + 2 * i + 2]

    def along(self, i: int, y: Vector) -> Vector:
        """Direction of the strain; that of the speed where there is none."""
        e = self.strain(i, y)
        if np.hypot(*e) < 1e-14:
            e = self.contacts[i].speed(y)
        return np.asarray(e / np.hypot(*e))

    def pace(self, i: int, y: Vector) -> float:
        """Speed of sliding along the strain."""
        contact = self.contacts[i]
        return float(self.along(i, y) @ contact.speed(y)) - contact.grip_pace(y) / contact.spring

    def margin(self, i: int, y: Vector) -> float:
        contact = self.contacts[i]
        force = contact.spring * float(np.hypot(*self.strain(i, y)))
        return contact.grip(y) * (1.0 + 1e-12) - force

    def rate(self, t: float, y: Vector) -> Vector:
        n = len(self.mass)
        total = self.load(t) - self.damping @ y[n : 2 * n] - self.stiffness @ y[:n]
        places = []
        for i, (contact, mode) in enumerate(zip(self.contacts, self.modes, strict=True)):
            belt = np.array(contact.base_speed)
            if contact.normal is not None:
                total = total - contact.normal * contact.grip(y) / contact.coefficient
            if mode == OPEN:
                places.append(contact.tangents @ y[n : 2 * n])
            elif mode == STICKS:
                total = total - contact.spring * self.strain(i, y) @ contact.tangents
                places.append(belt)
            else:
                total = total - contact.grip(y) * self.along(i, y) @ contact.tangents
                places.append(self.pace(i, y) * self.along(i, y) + belt)
        return np.concatenate([y[n : 2 * n], np.linalg.solve(self.mass, total), *places])

    def placed(self, y: Vector) -> Vector:
        """The state with what slides or is free exactly where it is."""
        y, n = y.copy(), len(self.mass)
        for i, (contact, mode) in enumerate(zip(self.contacts, self.modes, strict=True)):
            if mode == STICKS:
                continue
            size = 0.0 if mode == OPEN else contact.grip(y) / contact.spring
            free = contact.tangents @ y[:n]
            y[2 * n + 2 * i : 2 * n + 2 * i + 2] = free - size * self.along(i, y)
        return y

    def pass_event(self, y: Vector, i: int, kind: str) -> Vector:
        contact, y = self.contacts[i], self.placed(y)
        self.events_met.append(kind)
        if kind == "close":
            growth = 0.0
            if contact.exponent == 1.0 and contact.normal is not None:
                n = len(self.mass)
                pace = float(contact.normal @ y[n : 2 * n])
                growth = contact.coefficient * contact.stiffness * pace
            fast = contact.spring * float(np.hypot(*contact.speed(y))) > growth
            self.modes[i] = SLIDES if fast else STICKS
        else:
            self.modes[i] = {"open": OPEN, "slip": SLIDES, "stick": STICKS}[kind]
        return self.placed(y)

    def events(self) -> list[tuple[int, str, Callable[[float, Vector], float]]]:
        found: list[tuple[int, str, Callable[[float, Vector], float]]] = []
        for i, (contact, mode) in enumerate(zip(self.contacts, self.modes, strict=True)):
            if contact.normal is not None:
                sign, kind = (-1.0, "close") if mode == OPEN else (1.0, "open")
                found.append((i, kind, lambda t, y, c=contact, s=sign: s * c.depth(y)))
            if mode == STICKS:
                found.append((i, "slip", lambda t, y, i=i: self.margin(i, y)))
            elif mode == SLIDES:
                found.append((i, "stick", lambda t, y, i=i: self.pace(i, y)))
        for _, _, event in found:
            event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        return found

    def followed(self, y: Vector, end: float, longest: float) -> Vector:
        """The state at a time, from one without strain at zero on."""
        t = 0.0
        self.events_met = []
        self.modes = [
            OPEN if c.normal is not None and c.depth(y) < 0.0 else STICKS for c in self.contacts
        ]
        while t < end:
            events = self.events()
            run = solve_ivp(
                self.rate, (t, end), y, method="DOP853", rtol=1e-12, atol=1e-15,
                max_step=longest, first_step=min(FIRST_STEP, end - t),
                events=[event for _, _, event in events],
            )  # fmt: skip
            t, y = float(run.t[-1]), run.y[:, -1]
            for (i, kind, _), times in zip(events, run.t_events or [], strict=True):
                if run.status == 1 and times.size:
                    y = self.pass_event(y, i, kind)
        return self.placed(y)
