"""``python -m nldyn.bench.throughput``: forcing periods per second of plain simulation.

The same motions by the flow map, by `scipy.integrate.solve_ivp` and by a compiled Runge-Kutta
scheme of fourth order with fixed steps, each at the coarsest setting whose error over a period is
below 1e-8, or else at its finest. Times are processor times on one core. Two threads are measured
by the wall clock and by the processor time that they get meanwhile, since other programs may take
a core.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from scipy.integrate import solve_ivp

from nldyn.bench.models import load_case
from nldyn.flow import FlowMap, FlowOptions
from nldyn.linear import Real
from nldyn.system import System

WANTED = 1e-8  # error over a period
STATES = 12  # along the motion, from which errors are measured
MODELS = ("one_dof", "two_dof", "four_dof")
FLOW_SETTINGS = (1e-5, 1e-7, 1e-9, 1e-11)
IVP_SETTINGS = (1e-6, 1e-8, 1e-10, 1e-12)
FIXED_STEPS = (1000, 4000, 16000, 64000)

Advance = Callable[[Real], Real]  # modal state after a period


@dataclass(frozen=True)
class Row:
    """One engine on one model.

    Parameters
    ----------
    model, engine, setting : str
        What was measured.
    error : float
        Median over the states of the relative error after a period.
    rate : float
        Periods per second of processor time.
    """

    model: str
    engine: str
    setting: str
    error: float
    rate: float


@njit(cache=True, error_model="numpy")
def plain_rate(phase, x, numbers, out):
    """Derivative by the forcing phase of modal displacements and velocities, one Hertzian stop.

    numbers: n, ω, stiffness, gap; then n each of Ω², stop vector, load; then D row by row.
    """
    n = int(numbers[0])
    omega = numbers[1]
    depth = -numbers[3]
    for k in range(n):
        depth += numbers[4 + n + k] * x[k]
    force = numbers[2] * depth * math.sqrt(depth) if depth > 0.0 else 0.0
    turn = math.cos(phase)
    for k in range(n):
        out[k] = x[n + k] / omega
        total = turn * numbers[4 + 2 * n + k] - numbers[4 + k] * x[k] - numbers[4 + n + k] * force
        for j in range(n):
            total -= numbers[4 + 3 * n + k * n + j] * x[n + j]
        out[n + k] = total / omega


@njit(cache=True, error_model="numpy")
def fixed_steps(start, numbers, steps):
    """State after a period by the classical Runge-Kutta scheme with equal steps."""
    h = 2.0 * math.pi / steps
    x = start.copy()
    size = x.size
    a, b, c, d, y = (
        np.empty(size), np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    )  # fmt: skip
    for step in range(steps):
        phase = step * h
        plain_rate(phase, x, numbers, a)
        for i in range(size):
            y[i] = x[i] + 0.5 * h * a[i]
        plain_rate(phase + 0.5 * h, y, numbers, b)
        for i in range(size):
            y[i] = x[i] + 0.5 * h * b[i]
        plain_rate(phase + 0.5 * h, y, numbers, c)
        for i in range(size):
            y[i] = x[i] + h * c[i]
        plain_rate(phase + h, y, numbers, d)
        for i in range(size):
            x[i] += h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i])
    return x


def pack(system: System, omega: float) -> Real:
    """All numbers of the equations in one vector, as `plain_rate` wants them."""
    (stop,), (source,) = system.stops, system.excitation
    load = source.phasor.real * omega**source.order * system.participation[source.at]
    head = [float(system.size), omega, stop.stiffness, stop.gap]
    return np.concatenate(
        [
            head,
            system.natural_frequencies**2,
            system.stop_vector(stop),
            load,
            system.total_damping.ravel(),
        ]
    )


def by_flow_map(system: System, omega: float, rtol: float) -> Advance:
    """The flow map of `nldyn`."""
    flow = FlowMap(system, FlowOptions(rtol))
    phases = np.array([0.0, 2.0 * np.pi])

    def advance(modal: Real) -> Real:
        start = flow.to_state(modal)[None]
        return flow.to_modal(flow.shoot(start, phases, omega, sensitivities=False).ends[0])

    return advance


def by_solve_ivp(system: System, omega: float, rtol: float) -> Advance:
    """DOP853 of scipy on the compiled equations, with steps that cannot miss a contact."""
    numbers = pack(system, omega)
    size = 2 * system.size
    out = np.empty(size)

    def rate(phase: float, x: Real) -> Real:
        plain_rate(phase, x, numbers, out)
        return out.copy()

    def advance(modal: Real) -> Real:
        atol = rtol * np.maximum(np.abs(modal).reshape(2, -1).max(axis=1), 1e-300)
        found = solve_ivp(
            rate, (0.0, 2.0 * np.pi), modal, "DOP853", rtol=rtol,
            atol=np.repeat(atol, size // 2), max_step=0.05,
        )  # fmt: skip
        return np.asarray(found.y[:, -1])

    return advance


def by_fixed_steps(system: System, omega: float, steps: float) -> Advance:
    """The compiled scheme with fixed steps."""
    numbers = pack(system, omega)

    def advance(modal: Real) -> Real:
        return np.asarray(fixed_steps(modal, numbers, int(steps)))

    return advance


ENGINES: tuple[tuple[str, Any, Sequence[float], str], ...] = (
    ("flow map", by_flow_map, FLOW_SETTINGS, "rtol {:g}"),
    ("solve_ivp, DOP853", by_solve_ivp, IVP_SETTINGS, "rtol {:g}"),
    ("compiled RK4, fixed steps", by_fixed_steps, FIXED_STEPS, "{:g} steps"),
)


def measure(model: str) -> list[Row]:
    """All engines on one model."""
    case = load_case(model)
    system, omega = case.system, case.omega
    flow = FlowMap(system)
    phases = np.linspace(0.0, 2.0 * np.pi * STATES, STATES + 1)
    start = flow.to_state(case.start)[None]
    states = list(flow.to_modal(flow.shoot(start, phases, omega, chained=True).ends))
    exact = by_flow_map(system, omega, 1e-13)
    ends = [exact(state) for state in states]
    rows = []
    for engine, make, settings, label in ENGINES:
        for setting in settings:
            advance = make(system, omega, setting)
            found = [advance(state) for state in states]
            error = _median_error(found, ends, system.size)
            if error <= WANTED or setting == settings[-1]:
                break
        rate = _plain_rate(system, omega, setting) if engine == "flow map" else 0.0
        rows.append(
            Row(model, engine, label.format(setting), error, rate or _rate(advance, states))
        )
    return rows


def _median_error(found: Sequence[Real], exact: Sequence[Real], n: int) -> float:
    """Relative error of displacements or velocities, whichever is larger."""
    errors = [
        max(
            float(np.linalg.norm(a[part] - b[part]) / np.linalg.norm(b[part]))
            for part in (slice(0, n), slice(n, 2 * n))
        )
        for a, b in zip(found, exact, strict=True)
    ]
    return float(np.median(errors))


def _rate(advance: Advance, states: Sequence[Real], seconds: float = 0.5) -> float:
    """Periods per second of processor time."""
    advance(states[0])
    start = time.process_time()
    count = 0
    while time.process_time() - start < seconds:
        advance(states[count % len(states)])
        count += 1
    return count / (time.process_time() - start)


def _plain_rate(system: System, omega: float, rtol: float, seconds: float = 0.5) -> float:
    """Periods per second of processor time in a simulation of 64 periods at a time."""
    flow = FlowMap(system, FlowOptions(rtol))
    phases = np.linspace(0.0, 128.0 * np.pi, 65)
    state = np.zeros((1, 2 * system.size))
    count = 0
    start = -1.0
    while start < 0.0 or time.process_time() - start < seconds:
        if count == 256 and start < 0.0:  # compiled, and past the first transient
            count, start = 0, time.process_time()
        state = flow.shoot(state, phases, omega, sensitivities=False, chained=True).ends[-1:]
        count += 64
    return count / (time.process_time() - start)


def threads(model: str, workers: int, periods: int = 6400) -> tuple[float, float]:
    """Periods per second of wall clock, and cores that were busy, with so many threads."""
    case = load_case(model)
    phases = np.linspace(0.0, 128.0 * np.pi, 65)
    size = 2 * case.system.size

    def simulate(_: int) -> None:
        flow = FlowMap(case.system)
        state = np.zeros((1, size))
        for _ in range(0, periods, 64):
            state = flow.shoot(
                state, phases, case.omega, sensitivities=False, chained=True
            ).ends[-1:]

    simulate(0)
    with ThreadPoolExecutor(workers) as pool:
        wall, processor = time.perf_counter(), time.process_time()
        list(pool.map(simulate, range(workers)))
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
    return workers * periods / wall, processor / wall


def main() -> None:
    """Print the table."""
    print("| model | engine | setting | error over a period | periods per second |")
    print("|---|---|---|---|---|")
    for model in MODELS:
        for row in measure(model):
            print(
                f"| {row.model} | {row.engine} | {row.setting} | {row.error:.1e} | "
                f"{row.rate:,.0f} |"
            )
    print("\n| model | threads | periods per second of wall clock | cores busy |")
    print("|---|---|---|---|")
    for model in MODELS:
        for workers in (1, 2):
            rate, busy = threads(model, workers)
            print(f"| {model} | {workers} | {rate:,.0f} | {busy:.2f} |")


if __name__ == "__main__":
    main()
