"""Basins of attraction of a scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor

from nldyn.base.errors import SystemModelError
from nldyn.flow.flow_map import FlowMap
from nldyn.longterm.attractors import Attractor, find_attractors
from nldyn.longterm.basin_shares import BasinsOver, values_over
from nldyn.longterm.basins import MOTION, Basins, PlaneState, StatePlane, basins, check_has_basins
from nldyn.orbits.axis import Axis
from nldyn.orbits.orbit import check_observe
from nldyn.runtime.executors import own_processes
from nldyn.runtime.progress import Progress, Shares, silent
from nldyn.scene.build import build_flow
from nldyn.scene.faults import told_as
from nldyn.scene.followed import axis_of
from nldyn.scene.schema.scene import Scene
from nldyn.system.system import System

STARTS = 24  # states from which attractors are looked for
CHECKS = 40  # cells that are simulated once more
Range = tuple[float, float]


def basins_of(
    scene: Scene,
    frequency_hz: float | None = None,
    *,
    over: int = 1,
    x: PlaneState | None = None,
    y: PlaneState | None = None,
    x_range: Range | None = None,
    y_range: Range | None = None,
    cells: int = 50,
    longest: int = 2000,
    progress: Progress | None = None,
    jobs: int = 1,
) -> Basins | BasinsOver:
    """Basins of attraction of a scene in a plane of two of its initial states.

    All else begins undeformed and without speed, at forcing phase zero.

    Parameters
    ----------
    scene : Scene
        It needs no continuation unless that is what they are computed over; its `rtol` counts if
        there is one.
    frequency_hz : float, optional
        Excitation frequency in Hz; over the range of the continuation unless given.
    over : int
        Number of values of the continuation's parameter, equally spaced.
    x, y : ({"displacement", "velocity"}, str), optional
        What is on either axis, of which interface: displacement and velocity of that of the first
        stop, or of the first one if there is no stop, unless given.
    x_range, y_range : (float, float), optional
        In m or m/s; twice what the attractors do that are found from a few random states, unless
        given.
    cells : int
        On either side of the plane.
    longest : int
        Excitation periods after which a motion is given up.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``.
    jobs : int
        Processes that share the work.

    Raises
    ------
    SceneError
        As `build_system`, and for what `nldyn.basins` refuses.

    Examples
    --------
    >>> from nldyn.scene.read import parse_scene
    >>> scene = parse_scene('''
    ... [modal]
    ... frequencies_hz = [13.1]
    ... participation.tip = [0.6]
    ... [damping]
    ... modal_ratio = 0.02
    ... [[excitation]]
    ... at = "tip"
    ... kind = "harmonic"
    ... amplitude = 1.0
    ... ''')
    >>> print(basins_of(scene, 10.0, cells=16).report())
    1: 100.0 ± 0.5 %, period 1, no impacts, -0.000127 to 0.000127 m at 'tip'
    0 of 40 cells that were simulated once more came to another result
    """
    flow = build_flow(scene)
    name = first_interface(flow.system)
    x, y = x or ("displacement", name), y or ("velocity", name)
    given = frequency_hz is not None and not scene.self_excited
    axis = None if given else axis_of(scene, flow.system)
    with told_as(scene, (), SystemModelError), own_processes(jobs) as executor:
        values = [] if axis is None else values_over(flow, axis, over)
        cases = _cases(flow, axis, values, frequency_hz)
        shares = Shares(progress or silent)
        for k in range(len(cases)):
            shares.weigh(f"cells {k}", MOTION * (STARTS + CHECKS) + cells**2)
        plane = StatePlane.spanned_by(flow.system, x, y, x_range or (-1.0, 1.0), y_range or (-1, 1))
        known: list[list[Attractor]] = [[] for _ in cases]
        if not (x_range and y_range):
            known = _attractors(cases, shares, executor)
            every = [attractor for each in known for attractor in each]
            plane = StatePlane.around(every, x, y, x_range=x_range, y_range=y_range)
        maps = [
            basins(
                here, hz, plane, shape=(cells, cells), attractors=known[k], starts=STARTS,
                longest=longest, checks=CHECKS, executor=executor,
                progress=_in_cells(shares.part(f"cells {k}")),
            )
            for k, (here, hz) in enumerate(cases)
        ]  # fmt: skip
    return maps[0] if axis is None else BasinsOver(axis, tuple(values), tuple(maps))


def _cases(
    flow: FlowMap, axis: Axis | None, values: Sequence[float], frequency_hz: float | None
) -> list[tuple[FlowMap, float]]:
    """Flow map and frequency in Hz of each plane, at which there are attractors."""
    if axis is None:
        assert frequency_hz is not None
        check_has_basins(flow, frequency_hz)
        return [(flow, frequency_hz)]
    sections = [axis.at(flow, value) for value in values]
    return [(here.flow, here.frequency_hz) for here in sections]


def _attractors(
    cases: Sequence[tuple[FlowMap, float]], shares: Shares, executor: Executor | None
) -> list[list[Attractor]]:
    """What motions from a few random states of each case come to."""
    for k in range(len(cases)):
        shares.weigh(f"attractors {k}", MOTION * STARTS)
    found = [
        find_attractors(
            flow, hz, starts=STARTS, executor=executor,
            progress=shares.counted(f"attractors {k}", "motions to attractors"),
        )
        for k, (flow, hz) in enumerate(cases)
    ]  # fmt: skip
    return [[share.attractor for share in each if share.attractor.lasting] for each in found]


def first_interface(system: System) -> str:
    """The interface of the first stop, or the first one whose motion is relative."""
    if system.stops:
        return system.stops[0].at
    relative = [name for name in system.interfaces if name not in system.rides]
    return relative[0] if relative else check_observe(system, None)


def _in_cells(tell: Progress) -> Callable[[int, int], None]:
    return lambda done, total: tell(f"{done} of {total} cells", 0.0, done / max(total, 1))
