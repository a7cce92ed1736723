"""Heyoka's Taylor integrators on flights and contacts, with events.

No Taylor series exists in time where a contact begins. The contact phase therefore runs in a
fictitious time s with dφ/ds = u, u² being proportional to the penetration (see
`bench.exact`); heyoka by itself would have to be started a little behind the switch.
"""

from __future__ import annotations

from typing import Any

import heyoka as hy
import numpy as np

from bench import motion
from bench.models import Case
from nldyn.base.arrays import Real
from nldyn.system.loads import Unbalance

OMEGA, SIZE = hy.par[0], hy.par[1]


class TaylorPeriod:
    """Integrators for the flights and contacts of a system, compiled once.

    Parameters
    ----------
    case : Case
        Its system is compiled into the integrators; start and frequency may change.
    tolerance : float
        Heyoka's tolerance.
    """

    def __init__(self, case: Case, tolerance: float) -> None:
        system = case.system
        (self.stop,), (source,) = system.elastic_stops.values(), system.excitation
        assert isinstance(source, Unbalance)
        self.n = n = system.size
        self.frequency = system.natural_frequencies
        self.c = system.stop_vector(self.stop)
        self.load = source.mass_times_radius * system.participation[source.at]
        # damping: a diagonal and one point damper
        D = system.total_damping
        self.damper = D[0, 1] / (self.c[0] * self.c[1]) if n > 1 else 0.0
        self.damping = np.diag(D) - self.damper * self.c**2
        rest = D - np.diag(self.damping) - self.damper * np.outer(self.c, self.c)
        assert np.abs(rest).max() < 1e-12 * np.abs(D).max()
        self.unit = float(np.linalg.norm(case.start / case.scale)) / self.frequency[0] / 100.0
        y = list(hy.make_vars(*(f"y{i}" for i in range(2 * n * (2 * n + 2)))))
        u, phase = hy.make_vars("u", "phase")
        depth = SIZE * self._felt(y) - self.stop.gap
        directions = hy.event_direction
        rising = hy.t_event(depth, direction=directions.positive)
        falling = hy.t_event(u, direction=directions.negative)
        over = hy.t_event(phase - motion.PERIOD, direction=directions.positive)
        options: dict[str, Any] = {"tol": tolerance, "compact_mode": n > 2}
        flight = list(zip(y, self._rates(y, hy.time, None), strict=True))
        self.flight = hy.taylor_adaptive(flight, t_events=[rising], **options)
        speed = SIZE * hy.sum([self.c[k] * y[n + k] for k in range(n)])
        rates = [u * rate for rate in self._rates(y, phase, u)]
        contact = list(zip(y, rates, strict=True))
        contact += [(u, speed / (2.0 * OMEGA * self.unit)), (phase, u)]
        self.contact = hy.taylor_adaptive(contact, t_events=[falling, over], **options)

    def _felt(self, column: list[Any]) -> Any:
        """Displacement of a column of scaled unknowns at the stop."""
        return hy.sum([self.c[k] / self.frequency[k] * column[k] for k in range(self.n)])

    def _column_rates(self, column: list[Any], push: list[Any]) -> list[Any]:
        """Derivatives of a column of scaled unknowns by the phase."""
        n = self.n
        speed = self.damper * hy.sum([self.c[k] * column[n + k] for k in range(n)])
        rates = [self.frequency[k] * column[n + k] / OMEGA for k in range(n)]
        for k in range(n):
            own = self.frequency[k] * column[k] + self.damping[k] * column[n + k]
            rates.append((push[k] - own - self.c[k] * speed) / OMEGA)
        return rates

    def _rates(self, y: list[Any], phase: Any, u: Any) -> list[Any]:
        """Derivatives of all scaled unknowns by the phase; u is None in flight."""
        n, width, k = self.n, 2 * self.n, self.stop.stiffness
        turn = hy.cos(phase) * OMEGA**2 / SIZE
        force = 0.0 if u is None else k * self.unit**1.5 / SIZE * (u * u * u)
        slope = 0.0 if u is None else 1.5 * k * self.unit**0.5 * u
        push = [self.load[i] * turn - self.c[i] * force for i in range(n)]
        state = self._column_rates(y[:width], push)
        rates: list[Any] = [None] * len(y)
        rates[:width] = state
        for j in range(width + 1):
            last = j == width
            index = [width + i * width + j for i in range(width)]
            index = list(range(width + width**2, len(y))) if last else index
            column = [y[i] for i in index]
            felt = slope * self._felt(column)
            push = [
                (2.0 * self.load[i] * turn if last else 0.0) - self.c[i] * felt for i in range(n)
            ]
            found = self._column_rates(column, push)
            for place, i in enumerate(index):
                rates[i] = found[place] - state[place] if last else found[place]
        return rates

    def run(self, y: Real, parameters: Real) -> Real:
        """Scaled unknowns after one period."""
        size = y.size
        for integrator in (self.flight, self.contact):
            integrator.pars[:] = parameters[1:3]
        phase = 0.0
        depth = motion.penetration(parameters, y) * parameters[2] / self.frequency[0]
        u = np.sqrt(depth / self.unit) if depth > 0.0 else 0.0
        closed = depth > 0.0
        for _ in range(1000):
            integrator = self.contact if closed else self.flight
            integrator.reset_cooldowns()
            integrator.state[:size] = y
            if closed:
                integrator.state[size:] = u, phase
                integrator.time = 0.0
                integrator.propagate_until(1e9)
                phase = float(integrator.state[size + 1])
            else:
                integrator.time = phase
                integrator.propagate_until(motion.PERIOD)
                phase = float(integrator.time)
            y = integrator.state[:size].copy()
            if phase >= motion.PERIOD * (1.0 - 1e-15):
                return y
            closed, u = not closed, 0.0
        raise RuntimeError("more than 1000 switches")
