"""Poincaré sections, and bifurcation diagrams by brute force: what motions settle on."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_choice, check_range, check_types, check_whole
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.longterm.attractors import Attractor, AttractorOptions, Kind, attractor_from
from nldyn.longterm.impacts import check_stop, impacts
from nldyn.longterm.simulation import Motion
from nldyn.orbits.newton import check_bounded
from nldyn.orbits.orbit import check_observe
from nldyn.orbits.starts import random_states
from nldyn.runtime.executors import check_execution, values_of
from nldyn.runtime.progress import of_number, shows_progress
from nldyn.system.system import System

Direction = Literal["up", "down", "random"]
MOST_POINTS = 10**6


def stroboscopic_section(motion: Motion, interface: str | None = None) -> tuple[Real, Real]:
    """Displacement (m) and velocity (m/s) of an interface once per excitation period, each (k,).

    Parameters
    ----------
    motion : Motion
        What `nldyn.simulate` gave, with a transient left out.
    interface : str, optional
        The first unless given.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, simulate
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> y, v = stroboscopic_section(simulate(system, 36.0, periods=100, transient=100))
    >>> len(y)
    101
    """
    check_types(motion=(motion, Motion))
    return motion.strobed(interface)


def impact_section(motion: Motion, stop: int = 0) -> tuple[Real, Real]:
    """Forcing phase (degrees) and speed (m/s) at which a stop is hit, each (k,).

    Parameters
    ----------
    motion : Motion
        What `nldyn.simulate` gave, with a transient left out.
    stop : int
        Index of the stop.

    Raises
    ------
    SystemModelError
        If the system has no stops, or no such one.
    """
    check_types(motion=(motion, Motion))
    check_stop(motion.system, stop)
    found = impacts(motion)
    hit = found.stop == stop
    return found.phase_deg[hit], found.speed[hit]


@dataclass(frozen=True, eq=False)
class Column:
    """What a motion has settled on at one frequency.

    Parameters
    ----------
    direction : {"up", "down", "random"}
        Whether the start is the attractor of the frequency below, above, or a random state.
    attractor : Attractor
        The attractor.
    peaks : (k,)
        Largest absolute displacement of each recorded period in m; the largest of a periodic
        motion lies on the branch of its orbit.
    strobe : (k,)
        Displacement at forcing phase zero in m.
    impact_phase_deg, impact_speed : (j,)
        Forcing phase and speed (m/s) of each impact.
    """

    direction: Direction
    attractor: Attractor
    peaks: Real
    strobe: Real
    impact_phase_deg: Real
    impact_speed: Real

    @property
    def frequency_hz(self) -> float:
        """Excitation frequency in Hz."""
        return self.attractor.frequency_hz


@dataclass(frozen=True, eq=False)
class BruteForce:
    """A bifurcation diagram by brute force.

    Parameters
    ----------
    observe : str
        Interface whose displacement is shown.
    columns : tuple of Column
        Those of the sweep up, of the sweep down, then from random states.
    """

    observe: str
    columns: tuple[Column, ...]

    def ranges(self, kind: Kind = "chaotic") -> list[tuple[float, float]]:
        """Ranges of neighbouring frequencies (Hz) with an attractor of a kind in any column.

        They begin and end half way to the neighbouring frequencies without one, and a single
        frequency counts, too.
        """
        check_choice("kind", kind, get_args(Kind))
        frequencies = sorted({column.frequency_hz for column in self.columns})
        with_kind = {c.frequency_hz for c in self.columns if c.attractor.kind == kind}
        found: list[tuple[float, float]] = []
        open_range = False
        for index, hz in enumerate(frequencies):
            if hz in with_kind:
                low = 0.5 * (frequencies[max(index - 1, 0)] + hz)
                high = 0.5 * (frequencies[min(index + 1, len(frequencies) - 1)] + hz)
                found = [*found[:-1], (found[-1][0], high)] if open_range else [*found, (low, high)]
            open_range = hz in with_kind
        return found

    def share(self, low_hz: float, high_hz: float, kind: Kind = "chaotic") -> tuple[int, int]:
        """At how many frequencies from `low_hz` to `high_hz` a kind was found, and of how many."""
        check_choice("kind", kind, get_args(Kind))
        for name, hz in (("low_hz", low_hz), ("high_hz", high_hz)):
            check_types(**{name: (hz, numbers.Real)})
        inside = [c for c in self.columns if low_hz <= c.frequency_hz <= high_hz]
        with_kind = {c.frequency_hz for c in inside if c.attractor.kind == kind}
        return len(with_kind), len({c.frequency_hz for c in inside})


@shows_progress(of_number("motions"))
def brute_force(
    system: System | FlowMap,
    range_hz: tuple[float, float],
    *,
    points: int = 200,
    directions: Sequence[Direction] = ("up", "down"),
    starts: int = 0,
    recorded: int = 64,
    observe: str | None = None,
    options: AttractorOptions | None = None,
    seed: int = 20,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> BruteForce:
    """Simulate and classify the attractors over a range of frequencies.

    A sweep goes from frequency to frequency and starts from the attractor before, so that up and
    down differ where attractors coexist. Each direction is one computation, and so are the random
    starts of every eight frequencies.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    range_hz : (float, float)
        Frequencies in Hz, ascending.
    points : int
        Number of frequencies, equally spaced.
    directions : sequence of {"up", "down"}
        Sweeps.
    starts : int
        Random initial states at each frequency.
    recorded : int
        Excitation periods recorded on each attractor.
    observe : str, optional
        Interface whose displacement is shown; the first unless given.
    options : AttractorOptions, optional
        Effort of the classification.
    seed : int
        Of the random states.
    executor : concurrent.futures.Executor, optional
        Where to compute; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)`` after each computation.

    Returns
    -------
    BruteForce

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    TaskError
        If a computation ends in an error; a simulation that fails is a column of that kind.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance
    >>> from nldyn.longterm import brute_force
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = brute_force(system, (35.0, 40.0), points=6, directions=["up"])
    >>> found.columns[1].attractor.kind  # at 36 Hz
    'chaotic'
    """
    flow = flow_of(system)
    check_types(directions=(directions, Sequence), options=(options, AttractorOptions, None))
    check_execution(executor, progress)
    low, high = check_range(range_hz)
    check_whole("points", points, 1, MOST_POINTS)
    check_whole("starts", starts, 0, MOST_POINTS)
    check_whole("recorded", recorded, 1, MOST_POINTS)
    check_whole("seed", seed, 0)
    name = check_observe(flow.system, observe)
    for direction in directions:
        check_choice("directions", direction, ("up", "down"))
    if not directions and not starts:
        raise SystemModelError("brute_force needs a direction or random starts")
    frequencies = np.linspace(low, high, points).tolist()
    for hz in frequencies:
        check_bounded(flow, 2.0 * math.pi * hz)
    tasks: list[tuple[Direction, list[float]]] = [
        (direction, frequencies if direction == "up" else frequencies[::-1])
        for direction in directions
    ]
    if starts:
        tasks += [("random", frequencies[k : k + 8]) for k in range(0, points, 8)]
    task = partial(_columns, flow, name, options or AttractorOptions(), recorded, starts, seed)
    found = values_of(task, tasks, executor, progress)
    return BruteForce(name, tuple(column for columns in found for column in columns))


def _columns(
    flow: FlowMap, observe: str, options: AttractorOptions, recorded: int, starts: int, seed: int,
    task: tuple[Direction, list[float]],
) -> list[Column]:  # fmt: skip
    """Columns of one sweep, or from random states."""
    direction, frequencies = task
    columns = []
    state = np.zeros(2 * flow.system.size)
    for hz in frequencies:
        if direction == "random":
            fresh = random_states(flow, 2.0 * math.pi * hz, starts + 1, seed)[1:]
        else:
            fresh = state[None]
        for start in fresh:
            attractor = attractor_from(flow, hz, observe, options, start)
            columns.append(column_of(direction, attractor, observe, recorded))
            failed = attractor.kind == "failed"
            state = np.zeros_like(state) if failed else attractor.states[-1]
    return columns


def column_of(direction: Direction, attractor: Attractor, observe: str, recorded: int) -> Column:
    """Record the motion on an attractor."""
    if attractor.kind == "failed":
        return Column(direction, attractor, *(np.empty(0) for _ in range(4)))
    motion = attractor.motion(max(recorded, attractor.period))
    _, peaks = motion.period_peaks(observe)
    strobe, _ = stroboscopic_section(motion, observe)
    found = impacts(motion)
    attractor._cache.clear()  # recorded motions are large beside what is shown of them
    return Column(direction, attractor, peaks, strobe[1:], found.phase_deg, found.speed)
