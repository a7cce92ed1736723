"""Motion between rigid stops by a general integrator and its events: shares no code with nldyn.

Impacts follow each other, the fastest first, where several happen within rounding; rest is not
modelled.
"""

import numpy as np
from scipy.integrate import solve_ivp

MOST_HITS = 25  # after which a motion is left where it is


def integrate(mass, stiffness, damping, force, stops, state, duration):
    """State (2n,) after a duration, impacts per stop, and the least speed of an impact.

    ``force(t)`` (n,) acts; stops are (vector, gap, restitution) with the gap closed at c x = gap.
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
            max_step=0.2,
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
