"""Adaptive methods on the equations of motion, with or without stopping at the switches."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from bench import motion
from bench.job import EngineError, Job, Prepared
from bench.models import Case
from nldyn.base.arrays import Real

# (from phase, unknowns, parameters, direction of the switch to stop at or 0) -> phase, unknowns
Advance = Callable[[float, Real, Real, int], tuple[float, Real]]


def through_switches(advance: Advance, y: Real, parameters: Real) -> Real:
    """Integrate flights and contacts in turn, stopped and restarted at every switch."""
    modes = [motion.in_mode(parameters, mode) for mode in (motion.FLIGHT, motion.CONTACT)]
    closed = motion.penetration(parameters, y) > 0.0
    phase = 0.0
    for _ in range(1000):
        phase, y = advance(phase, y, modes[closed], -1 if closed else 1)
        if phase >= motion.PERIOD:
            return y
        closed = not closed
    raise EngineError("more than 1000 switches")


def adaptive(make: Callable[[float], Advance], events: bool) -> Callable[[Case, float], Prepared]:
    """An adaptive method, with or without stopping at the switches."""

    def prepare(case: Case, rtol: float) -> Prepared:
        advance = make(rtol)

        def job(start: Real, omega: float) -> Job:
            p = motion.pack_parameters(case.system, start, omega)
            y = motion.initial(p, start)

            def run() -> Real:
                return through_switches(advance, y, p) if events else advance(0.0, y, p, 0)[1]

            return Job(run, lambda end: motion.to_sensitivities(p, end))

        return job

    return prepare


def compiled_rate(phase: float, y: Real, parameters: Real) -> Real:
    """The equations of motion, compiled."""
    out = np.empty(y.size)
    motion.rate(phase, np.ascontiguousarray(y), parameters, out)
    return out


def scipy_advance(method: Any, equations: Any = compiled_rate) -> Callable[[float], Advance]:
    """`scipy.integrate.solve_ivp`."""

    def make(rtol: float) -> Advance:
        def advance(phase: float, y: Real, p: Real, direction: int) -> tuple[float, Real]:
            def rate(t: float, y: Real) -> Any:
                return equations(t, y, p)

            def switch(t: float, y: Real) -> float:
                return float(motion.penetration(p, y))

            switch.terminal = True  # type: ignore[attr-defined]
            switch.direction = direction  # type: ignore[attr-defined]
            found = solve_ivp(
                rate,
                (phase, motion.PERIOD),
                y,
                method=method,
                rtol=rtol,
                atol=rtol,
                events=switch if direction else None,
            )
            if found.status < 0:
                raise EngineError(found.message)
            return float(found.t[-1]), found.y[:, -1]

        return advance

    return make


def cvode_advance(rtol: float) -> Advance:
    """CVODE of SUNDIALS by scikit-sundae, Adams' method."""
    from sksundae.cvode import CVODE

    current = np.zeros(0)

    def rate(t: float, y: Real, yp: Real) -> None:
        motion.rate(t, y, current, yp)

    def switch(t: float, y: Real, events: Real) -> None:
        events[0] = motion.penetration(current, y)

    solvers: dict[int, Any] = {}

    def solver(direction: int) -> Any:
        if direction not in solvers:
            options: dict[str, Any] = {
                "method": "Adams", "rtol": rtol, "atol": rtol, "max_num_steps": 10**6
            }  # fmt: skip
            if direction:

                def directed(t: float, y: Real, events: Real) -> None:
                    switch(t, y, events)

                directed.terminal = [True]  # type: ignore[attr-defined]
                directed.direction = [direction]  # type: ignore[attr-defined]
                options |= {"eventsfn": directed, "num_events": 1}
            solvers[direction] = CVODE(rate, **options)
        return solvers[direction]

    def advance(phase: float, y: Real, p: Real, direction: int) -> tuple[float, Real]:
        nonlocal current
        current = p
        found = solver(direction).solve(np.array([phase, motion.PERIOD]), y)
        if not found.success:
            raise EngineError(found.message)
        return float(found.t[-1]), found.y[-1].copy()

    return advance
