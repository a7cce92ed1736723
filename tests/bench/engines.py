"""The engines of the benchmark, all asked the same: one period with all derivatives.

An engine is prepared for a case at one of its settings; what it gives then takes a state and a
frequency to a `Job`, whose `run` is what the clock sees.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from bench import motion, native
from bench.adaptive import Advance, adaptive, cvode_advance, scipy_advance
from bench.collocation import collocation
from bench.job import Job, Prepared
from bench.models import Case
from nldyn.base.arrays import Real
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.options import FlowOptions

FLOW_OPTIONS = [FlowOptions(rtol) for rtol in (1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13)]
TOLERANCES = [1e-4, 1e-6, 1e-8, 1e-10, 1e-12]
STEPS = [50, 200, 800, 3200, 12800]


@dataclass(frozen=True)
class Engine:
    """A way to compute one period.

    Parameters
    ----------
    name : str
        Name in tables and legends.
    settings : sequence
        From coarse to fine.
    prepare : callable
        ``prepare(case, setting)`` gives a function from (start, omega) to a `Job`.
    largest : int
        Most degrees of freedom that are tried.
    needs : str
        Module that must be installed.
    has_monodromy : bool
        Whether it gives derivatives; else only the state of the periodic orbit.
    """

    name: str
    settings: Sequence[Any]
    prepare: Callable[[Case, Any], Prepared]
    largest: int = 16
    needs: str = ""
    has_monodromy: bool = True

    @property
    def installed(self) -> bool:
        """Whether what it needs is there."""
        return not self.needs or find_spec(self.needs) is not None


# The flow map


def flow_map(case: Case, options: FlowOptions) -> Prepared:
    """The flow map at some options. Two frequencies alternate, so that nothing can be reused."""
    flow = FlowMap(case.system, options)

    def job(start: Real, omega: float) -> Job:
        both = itertools.cycle([omega, float(np.nextafter(omega, np.inf))])
        state = flow.to_state(start)[None]
        return Job(
            lambda: flow.shoot(state, native.PERIOD, next(both)),
            lambda segments: native.physical(flow, segments),
        )

    return job


# Explicit Runge-Kutta methods of equal steps

RK4_A = np.array([[0, 0, 0, 0], [0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 1.0, 0]])
RK4_B = np.array([1.0, 2.0, 2.0, 1.0]) / 6.0
RK4_C = np.array([0.0, 0.5, 0.5, 1.0])


def fixed_steps(A: Real, B: Real, C: Real) -> Callable[[Case, int], Prepared]:
    """A compiled Runge-Kutta method of equal steps that knows nothing of the switch."""

    def prepare(case: Case, steps: int) -> Prepared:
        def job(start: Real, omega: float) -> Job:
            p = motion.pack_parameters(case.system, start, omega)
            y = motion.initial(p, start)
            return Job(
                lambda: motion.runge_kutta(y, p, A, B, C, steps),
                lambda end: motion.to_sensitivities(p, end),
            )

        return job

    return prepare


# Taylor series


def taylor(case: Case, tolerance: float) -> Prepared:
    """Heyoka's Taylor integrators, see `bench.taylor`."""
    from bench.taylor import TaylorPeriod

    period = TaylorPeriod(case, tolerance)

    def job(start: Real, omega: float) -> Job:
        p = motion.pack_parameters(case.system, start, omega)
        y = motion.initial(p, start)
        return Job(lambda: period.run(y, p), lambda end: motion.to_sensitivities(p, end))

    return job


NLDYN = "nldyn"
HALF = TOLERANCES[:3]


def plain_and_events(
    name: str, settings: Sequence[float], make: Callable[[float], Advance], **limits: Any
) -> list[Engine]:
    """An adaptive method as two engines: as it comes, and restarted at every switch."""
    return [
        Engine(name, settings, adaptive(make, False), **limits),
        Engine(f"{name}, events", settings, adaptive(make, True), **limits),
    ]


ENGINES = [
    Engine(NLDYN, FLOW_OPTIONS, flow_map),
    Engine(
        "solve_ivp DOP853 in numpy",
        TOLERANCES,
        adaptive(scipy_advance("DOP853", motion.numpy_rate), False),
    ),
    *plain_and_events("solve_ivp DOP853", TOLERANCES, scipy_advance("DOP853")),
    *plain_and_events("solve_ivp LSODA", TOLERANCES, scipy_advance("LSODA")),
    *plain_and_events("solve_ivp Radau", HALF, scipy_advance("Radau"), largest=2),
    Engine("RK4, equal steps", STEPS, fixed_steps(RK4_A, RK4_B, RK4_C)),
    Engine(
        "RK8, equal steps",
        STEPS,
        fixed_steps(np.array(DOP853.A), np.array(DOP853.B), np.array(DOP853.C)),
    ),
    *plain_and_events("CVODE Adams", TOLERANCES, cvode_advance, largest=4, needs="sksundae"),
    Engine("heyoka, events, regularised", TOLERANCES, taylor, needs="heyoka"),
    Engine("solve_bvp", [1e-3, 1e-4, 1e-5, 1e-6], collocation, largest=4, has_monodromy=False),
]
