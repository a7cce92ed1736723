"""Motions with dry friction, computed without the flow map: integration from event to event."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import OdeSolution, solve_ivp

from nldyn import FlowMap, System
from nldyn.flow.flow_map import Segments
from nldyn.system import Friction

Vector = NDArray[np.float64]
GRAVITY = 9.81
FIRST_STEP = 1e-9  # beside springs: behind an event, which another one may follow at once
ROUNDED = 1.0 + 1e-12  # times its friction: what slips no more than a rounding before


@dataclass(frozen=True)
class Contact:
    """Where a body slides along `tangent`, pressed on by a constant force or by a stop.

    The stop is k (normal . q - gap)^p. A spring may give way before what slides.
    """

    tangent: Vector
    law: Friction
    force: float = 0.0
    normal: Vector | None = None
    stiffness: float = 0.0
    exponent: float = 1.0
    gap: float = 0.0
    spring: float | None = None

    def depth(self, y: Vector) -> float:
        return float(self.normal @ y[: self.normal.size]) - self.gap

    def pressed(self, y: Vector) -> float:
        if self.normal is None:
            return self.force
        return self.stiffness * max(self.depth(y), 0.0) ** self.exponent

    def slip(self, y: Vector) -> float:
        n = self.tangent.size
        return float(self.tangent @ y[n : 2 * n]) - self.law.base_speed

    def sliding_share(self, y: Vector) -> float:
        """Friction per normal force as it slides, from the first instant on."""
        if self.law.fading_speed is None:
            return self.law.coefficient
        return float(self.law.at(self.slip(y)))

    def pressing_pace(self, y: Vector) -> float:
        if self.normal is None or self.depth(y) <= 0.0:
            return 0.0
        n, p = self.normal.size, self.exponent
        return self.stiffness * p * self.depth(y) ** (p - 1.0) * float(self.normal @ y[n : 2 * n])

    def place_pace(self, y: Vector, mode: float) -> float:
        """Speed of what slides behind a spring, beside what it slides on."""
        if mode == 0.0:
            return 0.0
        if np.isnan(mode):
            return self.slip(y)
        assert self.spring is not None
        return self.slip(y) - mode * self.law.coefficient * self.pressing_pace(y) / self.spring


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

    It rebounds from walls, and does not come to rest on them. After q and q' the state has the
    places of what slides behind springs.

    Modes: nan for an open one, 0 where it sticks, else the sign of its speed. Times and ways are
    what `followed` adds up: how long each contact sticks and slides, and how far. If asked for, it
    keeps the modes between events with the motion there, as a function of time.
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
    keeps: bool = False
    kept: list[tuple[list[float], OdeSolution]] = field(default_factory=list)

    def acting(self, t: float, y: Vector) -> tuple[Vector, dict[int, float]]:
        """All forces, and what holds those that stick."""
        n = len(self.mass)
        total = self.load(t) - self.damping @ y[n : 2 * n] - self.stiffness @ y[:n]
        held = []
        for i, (contact, mode) in enumerate(zip(self.contacts, self.modes, strict=True)):
            normal = contact.pressed(y)
            if contact.normal is not None:
                total = total - contact.normal * normal
            if mode == 0.0 and contact.spring is not None:
                total = total - contact.tangent * self.pull(i, y)
            elif mode == 0.0:
                held.append(i)
            elif not np.isnan(mode):
                total = total - contact.tangent * mode * contact.sliding_share(y) * normal
        if not held:
            return total, {}
        rows = np.array([self.contacts[i].tangent for i in held])
        moved = np.linalg.solve(self.mass, np.column_stack([rows.T, total]))
        forces = np.linalg.solve(rows @ moved[:, :-1], rows @ moved[:, -1])
        return total - rows.T @ forces, dict(zip(held, forces.tolist(), strict=True))

    def rate(self, t: float, y: Vector) -> Vector:
        n = len(self.mass)
        places = [
            contact.place_pace(y, mode) + contact.law.base_speed
            for contact, mode in zip(self.contacts, self.modes, strict=True)
            if contact.spring is not None
        ]
        accelerations = np.linalg.solve(self.mass, self.acting(t, y)[0])
        return np.concatenate([y[n : 2 * n], accelerations, places])

    def strain(self, i: int, y: Vector) -> float:
        contact = self.contacts[i]
        return float(contact.tangent @ y[: len(self.mass)]) - float(y[self.place_entry(i)])

    def place_entry(self, i: int) -> int:
        """Where in the state the place of what slides behind the spring of a contact is."""
        before = sum(other.spring is not None for other in self.contacts[:i])
        return 2 * len(self.mass) + before

    def pull(self, i: int, y: Vector) -> float:
        return float(self.contacts[i].spring or 0.0) * self.strain(i, y)

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
        for i, contact in enumerate(self.contacts):
            if contact.spring is not None and not np.isnan(self.modes[i]):
                self.modes[i] = self.sprung_mode(i, y)
        self.let_slip(t, y)

    def sprung_mode(self, i: int, y: Vector) -> float:
        """Whether what is behind a spring slides on, where its friction is reached."""
        contact, force, most = self.contacts[i], self.pull(i, y), self.grip(i, y)
        if abs(force) < most * (1.0 - 1e-9):
            return 0.0
        way = float(np.sign(force if most > 1e-12 else contact.slip(y)))
        return way if way * contact.place_pace(y, way) > 1e-12 else 0.0

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
            elif not np.isnan(mode) and contact.spring is not None:
                pace = lambda t, y, c=contact, s=mode: s * c.place_pace(y, s)  # noqa: E731
                found.append((i, "stop", pace))
            elif not np.isnan(mode):
                found.append((i, "stop", lambda t, y, c=contact, s=mode: s * c.slip(y)))
        for i, wall in enumerate(self.walls):
            found.append((i, "hit", lambda t, y, w=wall: w.open(y)))
        for _, _, event in found:
            event.terminal, event.direction = True, -1  # type: ignore[attr-defined]
        return found

    def _margin(self, t: float, y: Vector, i: int) -> float:
        return ROUNDED * self.grip(i, y) - abs(self.holding(t, y, i))

    def holding(self, t: float, y: Vector, i: int) -> float:
        return self.pull(i, y) if self.contacts[i].spring else self.acting(t, y)[1][i]

    def pass_event(self, t: float, y: Vector, i: int, kind: str) -> Vector:
        if kind == "hit":
            return self.rebound(t, y, self.walls[i])
        contact, y = self.contacts[i], self.placed(y)
        if kind == "slip":
            self.modes[i] = float(np.sign(self.holding(t, y, i)))
            for j, other in enumerate(self.contacts):  # a chain that came to rest at once
                held = other.spring is not None and self.modes[j] == 0.0
                if held and self._margin(t, y, j) < 1e-9 * self.grip(j, y):
                    self.modes[j] = self.sprung_mode(j, y)
            self.let_slip(t, y)  # forces jump where friction drops
        elif kind == "switch":
            opens = not np.isnan(self.modes[i])
            self.modes[i] = np.nan if opens else self.pressed_mode(contact, y)
            if contact.spring is not None and not opens:
                self.modes[i] = self.closing_mode(i, y)
            self.let_slip(t, y)
        elif contact.spring is not None:
            for j, other in enumerate(self.contacts):  # a chain comes to rest at once
                slides = other.spring is not None and abs(self.modes[j]) == 1.0
                if slides and abs(other.place_pace(y, self.modes[j])) < 1e-9:
                    self.modes[j] = 0.0
            self.modes[i] = 0.0
        else:
            self.modes[i] = 0.0
            push = np.linalg.solve(self.mass, contact.tangent)
            y = y.copy()
            y[push.size : 2 * push.size] -= push * contact.slip(y) / float(contact.tangent @ push)
            self.let_slip(t, y)
        return y

    def placed(self, y: Vector) -> Vector:
        """The state with what slides behind springs, or is free, exactly where it is."""
        y = y.copy()
        for j, contact in enumerate(self.contacts):
            if contact.spring is None or self.modes[j] == 0.0:
                continue
            pull = 0.0 if np.isnan(self.modes[j]) else self.modes[j] * self.grip(j, y)
            free = float(contact.tangent @ y[: len(self.mass)])
            y[self.place_entry(j)] = free - pull / contact.spring
        return y

    def closing_mode(self, i: int, y: Vector) -> float:
        """The mode behind a spring from a touch on, where both forces grow from nothing."""
        contact = self.contacts[i]
        n, speed = len(self.mass), contact.slip(y)
        growth = 0.0
        if contact.exponent == 1.0 and contact.normal is not None:
            growth = contact.stiffness * float(contact.normal @ y[n : 2 * n])
        slides = float(contact.spring or 0.0) * abs(speed) > contact.law.coefficient * growth
        return float(np.sign(speed)) if slides else 0.0

    def rebound(self, t: float, y: Vector, wall: Wall) -> Vector:
        """The state behind an impact; what acts then slides or sticks by its new speed."""
        n, push = len(self.mass), np.linalg.solve(self.mass, wall.normal)
        y = y.copy()
        speed = float(wall.normal @ y[n : 2 * n])
        y[n : 2 * n] -= push * (1.0 + wall.restitution) * speed / float(wall.normal @ push)
        self.modes = [
            mode
            if np.isnan(mode)
            else self.pressed_mode(contact, y)
            if contact.spring is None
            else self.sprung_mode(i, y)
            for i, (contact, mode) in enumerate(zip(self.contacts, self.modes, strict=True))
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
            sprung = any(contact.spring is not None for contact in self.contacts)
            run = solve_ivp(
                self.rate, (t, end), y, method="DOP853", rtol=1e-12, atol=1e-15,
                max_step=longest, first_step=min(FIRST_STEP, end - t) if sprung else None,
                events=[event for _, _, event in events], dense_output=self.keeps,
            )  # fmt: skip
            if self.keeps:
                self.kept.append((list(self.modes), run.sol))
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


def off_differences(flow, found, z, phases, omega, step):
    """How far derivatives by the state and by ω are off those by differences, of their size."""

    def slope(by_state, by_omega):
        up, down = (
            flow.shoot(z + way * step * by_state, phases, omega * (1.0 + way * step * by_omega))
            for way in (1.0, -1.0)
        )
        return (up.ends[0] - down.ends[0]) / (2.0 * step)

    directions = [*((row, 0.0) for row in np.eye(z.size)), (np.zeros(z.size), 1.0)]
    exact = [*found.jacobians[0].T, omega * found.d_omega[0]]
    off = [slope(*way) - column for way, column in zip(directions, exact, strict=True)]
    return np.abs(off).max() / max(np.abs(exact).max(), 1.0)


def monodromy(orbit):
    """By differences of a period's end."""
    flow, node = orbit.problem.flow, orbit.problem.nodes(orbit.point)[0]
    turn = np.array([0.0, 2.0 * np.pi])
    columns = [
        (flow.shoot((node + step)[None], turn, orbit.omega).ends[0]
         - flow.shoot((node - step)[None], turn, orbit.omega).ends[0]) / 2e-6
        for step in 1e-6 * np.eye(node.size)
    ]  # fmt: skip
    return np.array(columns).T


def flown(system: System, start: object, time: float, **more: bool) -> tuple[Vector, Segments]:
    """Displacements and speeds after a time, and what the flow map says."""
    flow = FlowMap(system)
    z = flow.to_state(np.asarray(start, dtype=float))[None]
    turn = 2.0 * math.pi
    found = flow.shoot(z, np.array([0.0, turn]), turn / time, **more)
    return flow.to_modal(found.ends)[0], found


def thrown(
    height: float, slip: float, restitution: float, friction: float, time: float
) -> tuple[float, float]:
    """Way and speed along a floor of what is thrown over it: it bounces, then slides to rest."""
    t = math.sqrt(2.0 * height / GRAVITY)
    x, speed = slip * min(t, time), GRAVITY * t
    for _ in range(300):
        if t >= time:
            return x, slip
        slip = max(slip - friction * (1.0 + restitution) * speed, 0.0)
        speed *= restitution
        flight = 2.0 * speed / GRAVITY
        x += slip * min(flight, time - t)
        t += flight
    left = min(time - t, slip / (friction * GRAVITY))
    return x + slip * left - 0.5 * friction * GRAVITY * left**2, slip - friction * GRAVITY * left
