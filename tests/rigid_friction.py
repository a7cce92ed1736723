"""Motion between rigid stops with friction, from event to event: shares no code with nldyn.

Flights, rest and sliding are exponentials of the whole linear system; an impact goes along its
impulse from instant to instant in the velocities of all coordinates; what rests on stops is found
by trying all combinations of leaving, sticking and sliding.
"""

import itertools
from typing import NamedTuple

import numpy as np
from event_driven import PiecewiseLinear
from scipy.linalg import expm

SLOW = 1e-12  # of the state: a speed that is none
SHUT = 1e-12  # the same of a gap
LOW = 1e-14  # the same of a rebound, whose height is not followed


class Wall(NamedTuple):
    """A stop at c x = gap with friction along t, on what moves with the speed `belt` there."""

    c: np.ndarray
    gap: float
    restitution: float
    t: np.ndarray
    friction: float
    belt: float = 0.0


class UndecidedError(Exception):
    """No combination of modes is possible, or more than one."""


class RubbingWalls(PiecewiseLinear):
    """A linear system between walls; modes are 0 where it sticks, else the sign of the slip."""

    def __init__(self, mass, stiffness, damping, force, constant, walls, omega):
        super().__init__(
            mass, stiffness, damping, force, constant, [wall[:3] for wall in walls], omega
        )
        self.walls, self.mass, self.losses = walls, mass, 0.0

    def held(self, modes):
        """Rates with the forces of walls that are rested on, rows of these forces, N and T."""
        n = self.n
        sticks = [s for s, mode in modes.items() if mode == 0]
        if not modes:
            return self.rates, {}
        rows = [self.walls[s].c for s in modes] + [self.walls[s].t for s in sticks]
        pulls = [
            self.walls[s].c + mode * self.walls[s].friction * self.walls[s].t
            for s, mode in modes.items()
        ] + [self.walls[s].t for s in sticks]
        jump = self.inverse @ np.array(pulls).T
        found = np.linalg.solve(np.array(rows) @ jump, np.array(rows) @ self.rates[n : 2 * n])
        rates = self.rates.copy()
        rates[n : 2 * n] -= jump @ found
        forces = {}
        for place, (s, mode) in enumerate(modes.items()):
            along = mode * self.walls[s].friction * found[place]
            if mode == 0:
                along = found[len(modes) + sticks.index(s)]
            forces[s] = found[place], along
        return rates, forces

    def slip_row(self, s):
        row = np.zeros(2 * self.n + 3)
        row[self.n : 2 * self.n], row[-1] = self.walls[s].t, -self.walls[s].belt
        return row

    def watched(self, forces, modes):
        """Rows that are positive until something happens at what is rested on, and what."""
        for s, (normal, along) in forces.items():
            yield normal, (s, "leave")
            if modes[s] == 0:
                for side in (1, -1):
                    yield self.walls[s].friction * normal - side * along, (s, "slip")
            else:
                yield modes[s] * self.slip_row(s), (s, "stop")

    def next_event(self, rates, forces, y, left, modes):
        """Time to the first event, and what; None if there is none in the time left."""
        count = int(np.ceil(left * self.fastest / self.STEP))
        h, n = left / count, self.n
        step = expm(rates * h)
        rows = list(self.watched(forces, modes))
        for k in range(count):
            z = step @ y
            found = []
            for row, event in rows:
                if row @ z < 0.0 <= row @ y:
                    found.append((self.root(rates, y, row, 0.0, h), event))
                elif row @ z < 0.0 and k == 0:  # begun with
                    found.append((0.0, event))
            for s, wall in enumerate(self.walls):
                if s in modes:
                    continue
                depth = np.concatenate([wall.c, np.zeros(n), [0.0, 0.0, -wall.gap]])
                speed = np.concatenate([np.zeros(n), wall.c, np.zeros(3)])
                top, low = h, 0.0
                if speed @ y > 0.0 > speed @ z:  # a hump
                    top = self.root(rates, y, speed, 0.0, h)
                if depth @ y >= 0.0 and speed @ y < 0.0 < speed @ z:  # left just now
                    low = self.root(rates, y, speed, 0.0, h)
                first, last = (depth @ expm(rates * x) @ y for x in (low, top))
                if first < 0.0 <= last:
                    found.append((self.root(rates, y, depth, low, top), (s, "hit")))
                elif first >= 0.0 and speed @ y > 1e-13:
                    found.append((0.0, (s, "hit")))
            if found:
                after, event = min(found)
                return k * h + after, event
            y = z
        return left, None

    def run(self, state, duration):
        """State (2n,) after a duration, impacts, and how long any wall was rested on."""
        y, t = np.concatenate([state, [1.0, 0.0, 1.0]]), 0.0
        modes, self.events = {}, []
        rested, self.losses = 0.0, 0.0
        while t < duration:
            rates, forces = self.held(modes)
            after, event = self.next_event(rates, forces, y, duration - t, modes)
            y = expm(rates * after) @ y
            t, rested = t + after, rested + (after if modes else 0.0)
            if event is None:
                break
            self.events.append((t, *event))
            modes = self.passed(y, modes, *event)
            if event[1] != "hit":  # leave it by more than rounding
                away = min(1e-6 / self.fastest, duration - t)
                y, t = expm(self.held(modes)[0] * away) @ y, t + away
        return y[: 2 * self.n], rested

    def passed(self, y, modes, s, what):
        """Modes after an event, with the state in place."""
        if what == "hit":
            return self.strike(y, modes, s)
        modes = dict(modes)
        if what == "leave":
            del modes[s]
        elif what == "slip":
            modes[s] = int(np.sign(self.held(modes)[1][s][1] @ y))
        else:
            n, push = self.n, self.inverse @ self.walls[s].t
            y[n : 2 * n] -= push * (self.slip_row(s) @ y) / (self.walls[s].t @ push)
            return self.settled(y, list(modes), {s})
        return modes

    def strike(self, y, modes, first):
        """Impacts at one instant, on the state in place; the modes of what is rested on then."""
        n, size = self.n, max(1.0, np.abs(y[: 2 * self.n]).max())
        shut = np.abs(self.c @ y[:n] - self.gap) < SHUT * size
        shut[first] = True
        while True:
            speeds = np.where(shut, self.c @ y[n : 2 * n], -1.0)
            hit = int(np.argmax(speeds))
            if speeds[hit] <= 0.1 * SLOW * size:
                break
            push = self.c[hit] @ (self.held(modes)[0] @ y)[n : 2 * n]
            low = push > 0.0 and (self.e[hit] * speeds[hit]) ** 2 < 2.0 * LOW * size * push
            self.blow(y, self.walls[hit], 0.0 if low else self.e[hit])
            jump = self.inverse @ self.c[hit]
            y[:n] -= (self.c[hit] @ y[:n] - self.gap[hit]) * jump / (self.c[hit] @ jump)
        slow = np.abs(self.c @ y[n : 2 * n]) < SLOW * size
        return self.settled(y, np.flatnonzero(shut & slow).tolist(), set())

    def blow(self, y, wall, restitution):
        """An impact: the velocities along the growing normal impulse, from instant to instant."""
        n, size = self.n, max(1.0, np.abs(y[: 2 * self.n]).max())
        v = y[n : 2 * n]
        before = 0.5 * v @ self.mass @ v
        impulse, last = 0.0, np.inf
        while impulse < last:
            slip = wall.t @ v - wall.belt
            pace = self.pace(wall, 0.0 if abs(slip) < SLOW * size else np.sign(slip))
            left = last - impulse
            if wall.t @ pace * slip < 0.0 and abs(slip) >= SLOW * size:
                left = min(left, -slip / (wall.t @ pace))
            if last == np.inf and wall.c @ pace < 0.0:
                left = min(left, -(wall.c @ v) / (wall.c @ pace))
            v += pace * left
            impulse += left
            if last == np.inf and wall.c @ v <= 1e-15 * size:
                last = (1.0 + restitution) * impulse
        self.losses += before - 0.5 * v @ self.mass @ v

    def pace(self, wall, way):
        """Change of the velocities per normal impulse, as it slides one way or is at rest."""

        def with_share(share):
            return -self.inverse @ (wall.c + share * wall.t)

        if way:
            return with_share(way * wall.friction)
        tried = [with_share(side * wall.friction) for side in (1.0, -1.0)]
        ahead, back = (wall.t @ each for each in tried)
        if ahead <= 0.0 <= back:  # friction can hold it
            return with_share(-wall.t @ self.inverse @ wall.c / (wall.t @ self.inverse @ wall.t))
        return tried[0] if ahead > 0.0 else tried[1]

    def settled(self, y, candidates, still):
        """The one combination of modes that is possible for what touches without speed."""
        n, size = self.n, max(1.0, np.abs(y[: 2 * self.n]).max())
        slips = {s: self.slip_row(s) @ y for s in candidates}
        choices = [
            (None, 0, 1, -1)
            if s in still or abs(slips[s]) < SLOW * size
            else (None, int(np.sign(slips[s])))
            for s in candidates
        ]
        found = []
        for chosen in itertools.product(*choices):
            modes = {s: m for s, m in zip(candidates, chosen, strict=True) if m is not None}
            try:
                rates, forces = self.held(modes)
            except np.linalg.LinAlgError:
                continue
            pace = (rates @ y)[n : 2 * n]
            good = True
            for s, mode in zip(candidates, chosen, strict=True):
                wall = self.walls[s]
                if mode is None:
                    good &= bool(wall.c @ pace < 0.0)
                    continue
                normal, along = (row @ y for row in forces[s])
                good &= bool(normal > 0.0)
                if mode == 0:
                    good &= bool(abs(along) <= wall.friction * normal)
                elif abs(slips[s]) < SLOW * size or s in still:
                    good &= bool(mode * (wall.t @ pace) > 0.0)
            if good:
                found.append(modes)
        if len(found) != 1:
            raise UndecidedError(f"{len(found)} combinations for {candidates}")
        return found[0]
