"""Poincaré sections, and bifurcation diagrams by brute force: what motions settle on."""

from __future__ import annotations

import numbers
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_choice, check_types, check_whole
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.longterm.attractors import Attractor, AttractorOptions, Kind, attractor_from
from nldyn.longterm.impacts import check_stop, impacts
from nldyn.longterm.simulation import Motion
from nldyn.orbits.axis import Axis
from nldyn.orbits.newton import check_bounded
from nldyn.orbits.orbit import check_observe
from nldyn.orbits.starts import random_states
from nldyn.runtime.executors import check_execution, values_of
from nldyn.runtime.progress import of_number, shows_progress
from nldyn.system.chart import THE_FREQUENCY, value_of, words_of
from nldyn.system.parameters import Parameter
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
    """What a motion has settled on at one frequency, or value of another parameter.

    Parameters
    ----------
    direction : {"up", "down", "random"}
        Whether the start is the attractor of the value below, above, or a random state.
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
    parameter : Parameter
        What changes from column to column.
    """

    observe: str
    columns: tuple[Column, ...]
    parameter: Parameter = THE_FREQUENCY

    def __repr__(self) -> str:
        """One line: how many motions at how many values, and what they settled on."""
        kinds = Counter(column.attractor.kind for column in self.columns)
        told = ", ".join(f"{kind}: {count}" for kind, count in kinds.items())
        many = f"{len(self.columns)} motions at {len(set(self.values))} values"
        return f"<BruteForce over {words_of(self.parameter)}: {many}, {told}>"

    @property
    def values(self) -> list[float]:
        """Value of the parameter of each column, Hz of the frequency."""
        return [
            value_of(c.attractor.flow.system, c.frequency_hz, self.parameter) for c in self.columns
        ]

    def _with_kind(self, kind: Kind) -> dict[float, bool]:
        """Whether there is an attractor of a kind at each value, ascending."""
        check_choice("kind", kind, get_args(Kind))
        found = dict.fromkeys(sorted(self.values), False)
        for value, column in zip(self.values, self.columns, strict=True):
            found[value] = found[value] or column.attractor.kind == kind
        return found

    def ranges(self, kind: Kind = "chaotic") -> list[tuple[float, float]]:
        """Ranges of neighbouring values with an attractor of a kind in any column.

        They begin and end half way to the neighbouring values without one, and a single
        value counts, too.
        """
        with_kind = self._with_kind(kind)
        values = list(with_kind)
        found: list[tuple[float, float]] = []
        open_range = False
        for index, (value, here) in enumerate(with_kind.items()):
            if here:
                low = 0.5 * (values[max(index - 1, 0)] + value)
                high = 0.5 * (values[min(index + 1, len(values) - 1)] + value)
                found = [*found[:-1], (found[-1][0], high)] if open_range else [*found, (low, high)]
            open_range = here
        return found

    def share(self, low: float, high: float, kind: Kind = "chaotic") -> tuple[int, int]:
        """At how many values from `low` to `high` a kind was found, and of how many."""
        for name, end in (("low", low), ("high", high)):
            check_types(**{name: (end, numbers.Real)})
        inside = [here for value, here in self._with_kind(kind).items() if low <= value <= high]
        return sum(inside), len(inside)


@shows_progress(of_number("motions"))
def brute_force(
    system: System | FlowMap,
    limits: tuple[float, float],
    *,
    parameter: str | Parameter | None = None,
    frequency_hz: float | None = None,
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
    """Simulate and classify the attractors over a range of frequencies, or another parameter.

    A sweep goes from value to value and starts from the attractor before, so that up and
    down differ where attractors coexist. Each direction is one computation, and so are the random
    starts of every eight values. A start that would lie behind a rigid stop begins at it.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    limits : (float, float)
        Frequencies in Hz, or values of the parameter, ascending.
    parameter, frequency_hz
        As for `nldyn.diagram`: what changes, and the excitation frequency where that is held.
    points : int
        Number of values, equally spaced.
    directions : sequence of {"up", "down"}
        Sweeps.
    starts : int
        Random initial states at each value.
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
    >>> over = brute_force(system, (1e-6, 1e-4), parameter="gap", frequency_hz=34.0, points=2)
    >>> [column.attractor.name for column in over.columns], over.values[:2]
    (['period 3', 'period 1', 'period 1', 'period 3'], [1e-06, 0.0001])
    """
    flow = flow_of(system)
    check_types(directions=(directions, Sequence), options=(options, AttractorOptions, None))
    check_execution(executor, progress)
    axis = Axis.of(flow.system, limits, parameter, frequency_hz)
    check_whole("points", points, 1, MOST_POINTS)
    check_whole("starts", starts, 0, MOST_POINTS)
    check_whole("recorded", recorded, 1, MOST_POINTS)
    check_whole("seed", seed, 0)
    name = check_observe(flow.system, observe)
    for direction in directions:
        check_choice("directions", direction, ("up", "down"))
    if not directions and not starts:
        raise SystemModelError("brute_force needs a direction or random starts")
    values = np.linspace(*axis.limits, points).tolist()
    for value in values:
        here = axis.at(flow, value)
        check_bounded(here.flow, here.omega)
    tasks: list[tuple[Direction, list[float]]] = [
        (direction, values if direction == "up" else values[::-1]) for direction in directions
    ]
    if starts:
        tasks += [("random", values[k : k + 8]) for k in range(0, points, 8)]
    effort = options or AttractorOptions()
    task = partial(_columns, flow, axis, name, effort, recorded, starts, seed)
    found = values_of(task, tasks, executor, progress)
    columns = tuple(column for columns in found for column in columns)
    return BruteForce(name, columns, axis.parameter)


def _columns(
    flow: FlowMap, axis: Axis, observe: str, options: AttractorOptions, recorded: int, starts: int,
    seed: int, task: tuple[Direction, list[float]],
) -> list[Column]:  # fmt: skip
    """Columns of one sweep, or from random states."""
    direction, values = task
    columns = []
    state = np.zeros(flow.system.state_size)
    for value in values:
        here = axis.at(flow, value)
        if direction == "random":
            fresh = random_states(here.flow, here.omega, starts + 1, seed)[1:]
        else:
            fresh = here.taken_over(state[None])
        for start in fresh:
            attractor = attractor_from(here.flow, here.frequency_hz, observe, options, start)
            columns.append(column_of(direction, attractor, observe, recorded))
            failed = attractor.kind == "failed"
            state = np.zeros_like(state) if failed else here.to_base(attractor.states[-1])
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
