"""``python -m bench.throughput``: forcing periods per second of plain simulation.

The same motions by the flow map, by `scipy.integrate.solve_ivp` and by a compiled Runge-Kutta
scheme of fourth order with fixed steps, each with finer and finer settings until its error over a
period is below 1e-8. Rates at equal error are interpolated between them. Times are processor times
on one core. Two threads are measured by the wall clock and by the processor time that they get
meanwhile, since other programs may take a core.
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

from bench.models import load_case
from bench.page import markdown
from bench.ratios import seconds_at
from nldyn.base.arrays import Real
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.options import FlowOptions
from nldyn.system.system import System

WANTED = 1e-8  # error over a period
STATES = 12  # along the motion, from which errors are measured
MODELS = ("one_dof", "two_dof", "four_dof")
RESONANCE_HZ = (20.0, 21.0, 22.0, 23.0, 24.0, 25.0)
FLOW_SETTINGS = (1e-3, 1e-5, 1e-7, 1e-9, 1e-11)
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
    (stop,), (source,) = system.elastic_stops.values(), system.excitation
    load = source.phasor.real * omega**source.power * system.participation[source.at]
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


FLOW = "flow map"
ENGINES: tuple[tuple[str, Any, Sequence[float], str], ...] = (
    (FLOW, by_flow_map, FLOW_SETTINGS, "rtol {:g}"),
    ("solve_ivp, DOP853", by_solve_ivp, IVP_SETTINGS, "rtol {:g}"),
    ("compiled RK4, fixed steps", by_fixed_steps, FIXED_STEPS, "{:g} steps"),
)


def measure(model: str) -> list[Row]:
    """All engines on one model, each from its coarsest setting to the first that is good enough."""
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
            error = _median_error([advance(state) for state in states], ends, system.size)
            plain = engine == FLOW
            rate = _plain_rate(system, omega, setting) if plain else _rate(advance, states)
            rows.append(Row(model, engine, label.format(setting), error, rate))
            if error <= WANTED:
                break
    return rows


def rate_at(rows: Sequence[Row], model: str, engine: str) -> float | None:
    """Periods per second of an engine at the error wanted; None if it does not reach it."""
    curve = [(r.error, 1.0 / r.rate) for r in rows if (r.model, r.engine) == (model, engine)]
    seconds = seconds_at(curve, WANTED)
    return None if seconds is None else 1.0 / seconds


def equal_error_table(rows: Sequence[Row]) -> list[dict[str, str]]:
    """Rates at the error wanted, and by how many times the flow map's is larger."""
    found = []
    for model, engine in dict.fromkeys((row.model, row.engine) for row in rows):
        rate, ours = rate_at(rows, model, engine), rate_at(rows, model, FLOW)
        found.append(
            {
                "model": model,
                "engine": engine,
                f"periods per second at {WANTED:.0e}": "" if rate is None else f"{rate:.0f}",
                "flow map over it": f"{ours / rate:.3g}" if ours and rate else "",
            }
        )
    return found


def settings_table(rows: Sequence[Row]) -> list[dict[str, str]]:
    """Every setting that was measured."""
    return [
        {
            "model": row.model,
            "engine": row.engine,
            "setting": row.setting,
            "error over a period": f"{row.error:.1e}",
            "periods per second": f"{row.rate:.0f}",
        }
        for row in rows
    ]


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


def resonance_rates() -> dict[float, float]:
    """Periods per second of the 4-DOF model by frequency in Hz, default options."""
    system = load_case("four_dof").system
    rtol = FlowOptions().rtol
    return {hz: _plain_rate(system, 2.0 * math.pi * hz, rtol) for hz in RESONANCE_HZ}


@dataclass(frozen=True)
class Threads:
    """Plain simulations on several threads of one process at once.

    Parameters
    ----------
    model : str
        What was simulated.
    workers : int
        Number of threads, each with a simulation of its own.
    rate : float
        Periods of all threads per second of wall clock.
    busy : float
        Cores that they had meanwhile.
    """

    model: str
    workers: int
    rate: float
    busy: float

    @property
    def rate_per_core(self) -> float:
        """Periods per second of processor time, on which other programs have little influence."""
        return self.rate / self.busy


def threads(model: str, workers: int, periods: int = 6400) -> Threads:
    """Simulate on so many threads."""
    case = load_case(model)
    phases = np.linspace(0.0, 128.0 * np.pi, 65)
    size = 2 * case.system.size

    def simulate(_: int) -> None:
        flow = FlowMap(case.system)
        state = np.zeros((1, size))
        for _ in range(0, periods, 64):
            found = flow.shoot(state, phases, case.omega, sensitivities=False, chained=True)
            state = found.ends[-1:]

    simulate(0)
    with ThreadPoolExecutor(workers) as pool:
        wall, processor = time.perf_counter(), time.process_time()
        list(pool.map(simulate, range(workers)))
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
    rate, busy = workers * periods / wall, processor / wall
    return Threads(model, workers, rate, busy)


def scaling(models: Sequence[str] = MODELS, repeats: int = 3) -> list[Threads]:
    """One and two threads in turn; the run with the most wall clock rate of each."""
    found = []
    for model in models:
        runs = [threads(model, workers) for _ in range(repeats) for workers in (1, 2)]
        for workers in (1, 2):
            found.append(max((r for r in runs if r.workers == workers), key=lambda r: r.rate))
    return found


def scaling_table(found: Sequence[Threads]) -> list[dict[str, str]]:
    """Threads beside each other, with the ratios to one thread."""
    rows = []
    for run in found:
        one = next(r for r in found if (r.model, r.workers) == (run.model, 1))
        rows.append(
            {
                "model": run.model,
                "threads": str(run.workers),
                "periods per second": f"{run.rate:.0f}",
                "times one thread": f"{run.rate / one.rate:.2f}",
                "cores busy": f"{run.busy:.2f}",
                "per core, times one thread": f"{run.rate_per_core / one.rate_per_core:.2f}",
            }
        )
    return rows


def main() -> None:
    """Print the tables."""
    rows = [row for model in MODELS for row in measure(model)]
    for table in (equal_error_table(rows), settings_table(rows), scaling_table(scaling())):
        print(markdown(table) + "\n")


if __name__ == "__main__":
    main()
