"""Motion between rigid stops by a general integrator and its events: shares no code with nldyn.

Impacts follow each other, the fastest first, where several happen within rounding. `integrate`
knows no rest, `PiecewiseLinear` does.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

MOST_HITS = 25  # after which a motion is left where it is


def integrate(mass, stiffness, damping, force, stops, state, duration, max_step=0.2):
    """State (2n,) after a duration, impacts per stop, and the least speed of an impact.

    ``force(t)`` (n,) acts; stops are (vector, gap, restitution) with the gap closed at c x = gap.
    What reaches beyond a stop and back within one step of at most `max_step` is not seen.
    """
    n = len(mass)
    inverse = np.linalg.inv(mass)

    def rate(t, y):
        x, v = y[:n], y[n:]
        return np.concatenate([v, inverse @ (force(t) - stiffness @ x - damping @ v)])

    def closing(c, gap):
        def event(t, y):
            return c @ y[:n] - gap

        event.terminal, event.direction = True, 1.0
        return event

    events = [closing(c, gap) for c, gap, _ in stops]
    t, y = 0.0, np.array(state, dtype=float)
    hits, slowest = np.zeros(len(stops), dtype=int), np.inf
    while t < duration and hits.sum() <= MOST_HITS:
        found = solve_ivp(
            rate, (t, duration), y, method="DOP853", events=events, rtol=1e-12, atol=1e-13,
            max_step=max_step,
        )  # fmt: skip
        t, y = float(found.t[-1]), found.y[:, -1]
        if found.status == 0:
            break
        for _ in range(100):
            speeds = [c @ y[n:] if abs(c @ y[:n] - gap) < 1e-11 else -1.0 for c, gap, _ in stops]
            hit = int(np.argmax(speeds))
            if speeds[hit] <= 1e-12:
                break
            c, gap, restitution = stops[hit]
            hits[hit] += 1
            slowest = min(slowest, speeds[hit])
            jump = inverse @ c
            y[n:] -= (1.0 + restitution) * speeds[hit] * jump / (c @ jump)
            y[:n] -= (c @ y[:n] - gap + 1e-15) * jump / (c @ jump)
    return y, hits, slowest


class PiecewiseLinear:
    """The same by exponentials of the whole linear system between events, with rest on stops.

    Forces are f cos ωt and constant ones. A body rests on stops where it would bounce no higher
    than rounding, under the forces that keep their gaps' accelerations at zero, until one of them
    would have to pull.
    """

    STEP = 0.06  # of the time constant of the fastest mode: between two looks at all gaps

    def __init__(self, mass, stiffness, damping, force, constant, stops, omega):
        self.n, self.inverse = len(mass), np.linalg.inv(mass)
        self.c, self.gap, self.e = (np.array(column) for column in zip(*stops, strict=True))
        n = self.n
        rates = np.zeros((2 * n + 3, 2 * n + 3))  # of x, v, cos ωt, sin ωt and 1
        rates[:n, n : 2 * n] = np.eye(n)
        rates[n : 2 * n, :n] = -self.inverse @ stiffness
        rates[n : 2 * n, n : 2 * n] = -self.inverse @ damping
        rates[n : 2 * n, 2 * n] = self.inverse @ force
        rates[n : 2 * n, 2 * n + 2] = self.inverse @ constant
        rates[2 * n, 2 * n + 1], rates[2 * n + 1, 2 * n] = -omega, omega
        self.rates, self.fastest = rates, np.abs(np.linalg.eigvals(rates)).max()

    def held(self, closed):
        """Rates with the forces of closed stops, and the rows that give these forces."""
        n, c = self.n, self.c[closed]
        jump = self.inverse @ c.T
        rows = np.linalg.solve(c @ jump, c @ self.rates[n : 2 * n])
        rates = self.rates.copy()
        rates[n : 2 * n] -= jump @ rows
        return rates, rows

    def run(self, state, duration):
        """State (2n,) after a duration, impacts per stop and how long any stop was rested on."""
        y, t, closed = np.concatenate([state, [1.0, 0.0, 1.0]]), 0.0, []
        hits, rested = np.zeros(len(self.gap), dtype=int), 0.0
        while t < duration:
            rates, rows = self.held(closed)
            after, event = self.next_event(rates, rows, y, duration - t, closed)
            y = expm(rates * after) @ y
            t, rested = t + after, rested + (after if closed else 0.0)
            if event is None:
                break
            if event in closed:
                closed = [stop for stop in closed if stop != event]
                away = 1e-5 / self.fastest  # the gap opens with the third power of the time
                y, t = expm(self.held(closed)[0] * away) @ y, t + away
            else:
                closed = self.strike(y, closed, event, hits)
        return y[: 2 * self.n], hits, rested

    def next_event(self, rates, rows, y, left, closed):
        """Time to the first event and its stop; None if there is none in the time left."""
        count = int(np.ceil(left * self.fastest / self.STEP))
        h, n = left / count, self.n
        step = expm(rates * h)
        for k in range(count):
            z = step @ y
            found = []
            for s, c in enumerate(self.c):
                if s in closed:
                    row = rows[closed.index(s)]
                    if row @ z < 0.0 <= row @ y:
                        found.append((self.root(rates, y, row, 0.0, h), s))
                    continue
                depth = np.concatenate([c, np.zeros(n), [0.0, 0.0, -self.gap[s]]])
                speed = np.concatenate([np.zeros(n), c, np.zeros(3)])
                top = h
                if speed @ y > 0.0 > speed @ z:  # a hump
                    top = self.root(rates, y, speed, 0.0, h)
                low = 0.0
                if depth @ y >= 0.0 and speed @ y < 0.0 < speed @ z:  # left just now
                    low = self.root(rates, y, speed, 0.0, h)
                first, last = (depth @ expm(rates * x) @ y for x in (low, top))
                if first < 0.0 <= last:
                    found.append((self.root(rates, y, depth, low, top), s))
                elif first >= 0.0 and speed @ y > 1e-13:
                    found.append((0.0, s))
            if found:
                after, event = min(found)
                return k * h + after, event
            y = z
        return left, None

    def root(self, rates, y, row, low, high):
        """Time at which a row of the state is zero."""
        return brentq(lambda x: row @ expm(rates * x) @ y, low, high, xtol=1e-15)

    def strike(self, y, closed, first, hits):
        """Impacts at one instant, on the state in place; the stops on which the body rests then."""
        n, size = self.n, max(1.0, np.abs(y[: 2 * self.n]).max())
        shut = np.abs(self.c @ y[:n] - self.gap) < 1e-12 * size
        shut[first] = True
        while True:
            speeds = np.where(shut, self.c @ y[n : 2 * n], -1.0)
            hit = int(np.argmax(speeds))
            if speeds[hit] <= 1e-13 * size:
                break
            jump = self.inverse @ self.c[hit] / (self.c[hit] @ self.inverse @ self.c[hit])
            push = self.c[hit] @ (self.held(closed)[0] @ y)[n : 2 * n]
            low = push > 0.0 and (self.e[hit] * speeds[hit]) ** 2 < 2e-14 * size * push
            hits[hit] += 1
            y[n : 2 * n] -= (1.0 if low else 1.0 + self.e[hit]) * speeds[hit] * jump
            y[:n] -= (self.c[hit] @ y[:n] - self.gap[hit]) * jump
        slow = np.abs(self.c @ y[n : 2 * n]) < 1e-12 * size
        rests = np.flatnonzero(shut & slow).tolist()
        while rests:
            forces = self.held(rests)[1] @ y
            if forces.min() > 0.0:
                break
            rests.pop(int(np.argmin(forces)))
        return rests
