"""Basins of attraction at several values of a parameter: what becomes of their shares."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import check_types, check_whole
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.longterm.attractors import Attractor, AttractorOptions
from nldyn.longterm.basins import Basins, StatePlane, basins, check_has_basins, standard_error
from nldyn.orbits.axis import Axis
from nldyn.runtime.executors import check_execution
from nldyn.runtime.progress import of_number, shows_progress, silent_count
from nldyn.system.chart import parameter_name
from nldyn.system.parameters import Parameter
from nldyn.system.system import System

MOST_VALUES = 10**4
UNDECIDED_NAME = "undecided"


@dataclass(frozen=True, eq=False)
class BasinsOver:
    """Basins in one plane at several values of a parameter.

    Parameters
    ----------
    axis : Axis
        What changes, and the excitation frequency where that is held.
    values : tuple of float
        Values of the parameter, ascending.
    maps : tuple of Basins
        The basins at each.
    """

    axis: Axis
    values: tuple[float, ...]
    maps: tuple[Basins, ...]

    def __repr__(self) -> str:
        """One line: what changes, and which motions attract."""
        names = "; ".join(self.shares())
        many = f"{len(self.maps)} planes"
        return f"<BasinsOver {self.axis.told_range()}: {many}, attractors: {names}>"

    def shares(self) -> dict[str, Real]:
        """Share (k,) of the plane at each value that leads to motions of a name.

        Periodic motions are told apart by their period and number of impacts, others by their kind;
        several of one name count together. What led to no attractor in time is undecided.
        """
        found: dict[str, Real] = {}
        for index, each in enumerate(self.maps):
            for basin in each.basins:
                share = found.setdefault(name_of(basin.attractor), np.zeros(len(self.maps)))
                share[index] += basin.share
        undecided = np.array([each.undecided for each in self.maps])
        return {**found, UNDECIDED_NAME: undecided} if undecided.any() else found

    def uncertainty(self, share: Real) -> Real:
        """Standard errors (k,) of such a share, from as many random states as there are cells."""
        cells = [int(each.possible.sum()) for each in self.maps]
        pairs = zip(share.tolist(), cells, strict=True)
        return np.array([standard_error(round(part * count), count) for part, count in pairs])

    def report(self) -> str:
        """Lines for a reader: the basins at each value."""
        return "\n".join(
            f"{self.axis.told(value)}:\n{each.report()}"
            for value, each in zip(self.values, self.maps, strict=True)
        )

    @property
    def column(self) -> str:
        """Name of the column of values in tables."""
        return parameter_name(self.axis.parameter)


def name_of(attractor: Attractor) -> str:
    """Such as ``period 3, 2 impacts`` or ``chaotic``."""
    return attractor.title if attractor.orbit is not None else attractor.name


@shows_progress(of_number("planes"))
def basins_over(
    system: System | FlowMap,
    limits: tuple[float, float],
    plane: StatePlane,
    *,
    points: int = 9,
    parameter: str | Parameter | None = None,
    frequency_hz: float | None = None,
    shape: tuple[int, int] = (30, 30),
    starts: int = 24,
    longest: int = 2000,
    checks: int = 40,
    seed: int = 20,
    observe: str | None = None,
    options: AttractorOptions | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> BasinsOver:
    """Basins of attraction in one plane of initial states at values of a parameter.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    limits : (float, float)
        Frequencies in Hz, or values of the parameter, ascending.
    plane : StatePlane
        The initial states.
    points : int
        Number of values, equally spaced.
    parameter, frequency_hz
        As for `nldyn.diagram`: what changes, and the excitation frequency where that is held.
    shape, starts, longest, checks, seed, observe, options, executor
        As for `nldyn.basins`, at each value.
    progress : callable, optional
        Called as ``progress(done, total)`` after each value.

    Returns
    -------
    BasinsOver

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    TaskError
        If a computation ends in an error.

    Examples
    --------
    >>> from nldyn import StatePlane, Stop, System, Unbalance
    >>> from nldyn.longterm import basins_over
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> plane = StatePlane.at_interface(system, (-2e-4, 0.0), (-0.05, 0.05))
    >>> over = basins_over(system, (1e-5, 5e-5), plane, points=2, parameter="gap",
    ...     frequency_hz=23.0, shape=(6, 6), checks=2)
    >>> sorted(over.shares())
    ['period 1, 1 impact', 'period 1, no impacts']
    >>> float(over.shares()["period 1, no impacts"][1])  # no motion hits a stop so far away
    1.0
    """
    flow = flow_of(system)
    axis = Axis.of(flow.system, limits, parameter, frequency_hz)
    check_types(plane=(plane, StatePlane))
    check_execution(executor, progress)
    maps = []
    values = values_over(flow, axis, points)
    for value in values:
        here = axis.at(flow, value)
        maps.append(
            basins(
                here.flow, here.frequency_hz, plane, shape=shape, starts=starts, longest=longest,
                checks=checks, seed=seed, observe=observe, options=options, executor=executor,
                progress=silent_count,
            )
        )  # fmt: skip
        if progress is not None:
            progress(len(maps), points)
    return BasinsOver(axis, tuple(values), tuple(maps))


def values_over(flow: FlowMap, axis: Axis, points: int) -> list[float]:
    """So many values, equally spaced, at each of which there are basins.

    Raises
    ------
    SystemModelError
        If there are none at one of them.
    """
    axis.check_driven()
    check_whole("points", points, 2, MOST_VALUES)
    values: Sequence[float] = np.linspace(*axis.limits, points).tolist()
    for value in values:
        here = axis.at(flow, value)
        check_has_basins(here.flow, here.frequency_hz)
    return list(values)
