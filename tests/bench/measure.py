"""Time and error of every engine at every setting."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.engines import Engine
from bench.job import EngineError, Prepared
from bench.models import Case, Flip, Sensitivities, load_orbit_start
from nldyn.base.arrays import Real

CALM = 0.15  # seconds of repeats for one median
SLOW = 0.4  # seconds of one run, beyond which it is not repeated
PATIENCE = 1.5  # seconds of one run, beyond which no tighter setting is tried


@dataclass(frozen=True)
class Sample:
    """One engine on one model at one setting.

    Parameters
    ----------
    model, engine, setting : str
        What was run.
    seconds : float
        Median time of one period.
    repeats : int
        Number of runs behind the median.
    state, monodromy, d_omega : float
        Relative errors in the energy norm; nan where the engine does not give it.
    flip : float
        Relative error of the flip's frequency.
    note : str
        Why there is nothing, where there is nothing.
    """

    model: str
    engine: str
    setting: str
    seconds: float = math.nan
    repeats: int = 0
    state: float = math.nan
    monodromy: float = math.nan
    d_omega: float = math.nan
    flip: float = math.nan
    note: str = ""

    @property
    def worst(self) -> float:
        """Largest of the errors of state, monodromy matrix and frequency derivative."""
        return max(self.state, self.monodromy, self.d_omega)


def median_seconds(
    run: Callable[[], Any], at_least: int = 3, calm: float = CALM
) -> tuple[float, int]:
    """Median time of a call that is warm, and the number of calls.

    The time is that of the processor, so that other programs on the machine do not count.
    """
    times: list[float] = []
    while len(times) < at_least or (sum(times) < calm and len(times) < 400):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
        if times[0] > SLOW:
            break
    return statistics.median(times), len(times)


def errors(case: Case, found: Sensitivities) -> tuple[float, float, float]:
    """Relative errors of state, monodromy matrix and frequency derivative in the energy norm."""
    exact, unit = case.exact, case.scale

    def relative(a: Real, b: Real) -> float:
        return float(np.linalg.norm(a - b) / np.linalg.norm(b))

    return (
        relative(found.state / unit, exact.state / unit),
        relative(found.monodromy / unit[:, None] * unit, exact.monodromy / unit[:, None] * unit),
        relative(found.d_omega / unit, exact.d_omega / unit),
    )


def flip_frequency_error(flip: Flip, prepared: Prepared, found: Sensitivities) -> float:
    """Relative error of the flip's frequency as an engine locates it.

    Two steps of Newton's method with the Jacobian of the reference, from the exact orbit.
    """
    case = flip.case
    unknown = np.append(case.start, case.omega)
    for step in range(2):
        if step:
            job = prepared(unknown[:-1], float(unknown[-1]))
            found = job.read(job.run())
        if not np.all(np.isfinite(found.monodromy)):
            return math.nan
        size = case.start.size
        determinant = np.linalg.det(found.monodromy + np.eye(size))
        residual = np.append(found.state - unknown[:-1], determinant)
        unknown = unknown - flip.inverse @ residual
        if not np.all(np.isfinite(unknown)) or abs(unknown[-1] / flip.omega - 1.0) > 0.1:
            return math.nan
    return abs(float(unknown[-1]) / flip.omega - 1.0)


def measure(engine: Engine, flip: Flip, setting: Any) -> Sample:
    """Time and errors of one setting."""
    case = flip.case
    label = setting_label(setting)
    try:
        prepared = engine.prepare(case, setting)
        job = prepared(case.start, case.omega)
        first = job.read(job.run())
        seconds, repeats = median_seconds(job.run)
        if not engine.has_monodromy:
            wanted = load_orbit_start(case.name)
            size = np.linalg.norm(wanted / case.scale)
            state = float(np.linalg.norm((first.state - wanted) / case.scale) / size)
            return Sample(case.name, engine.name, label, seconds, repeats, state)
        frequency = flip_frequency_error(flip, prepared, first)
    except (EngineError, ValueError, RuntimeError, np.linalg.LinAlgError) as error:
        return Sample(case.name, engine.name, label, note=str(error).split("\n")[0][:120])
    return Sample(case.name, engine.name, label, seconds, repeats, *errors(case, first), frequency)


def measure_engine(engine: Engine, flip: Flip) -> Iterator[Sample]:
    """All settings of an engine, from coarse to fine, until it becomes too slow."""
    name, size = flip.case.name, flip.case.size
    if not engine.installed:
        yield Sample(name, engine.name, "", note=f"{engine.needs} is not installed")
        return
    if size > engine.largest:
        yield Sample(
            name, engine.name, "", note=f"not tried: {2 * size * (2 * size + 2)} equations"
        )
        return
    for setting in engine.settings:
        sample = measure(engine, flip, setting)
        yield sample
        if sample.seconds > PATIENCE:
            return


def curve(
    samples: Sequence[Sample], model: str, engine: str, error: str
) -> list[tuple[float, float]]:
    """Points (error, seconds) of an engine on a model."""
    return [
        (getattr(s, error), s.seconds)
        for s in samples
        if s.model == model and s.engine == engine and math.isfinite(getattr(s, error))
    ]


def setting_label(setting: Any) -> str:
    """A setting in a few words."""
    if isinstance(setting, float):
        return f"{setting:.0e}"
    if isinstance(setting, int):
        return f"{setting} steps"
    return f"rtol {setting.rtol:.0e}"
