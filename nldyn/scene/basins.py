"""Basins of attraction of a scene."""

from __future__ import annotations

from collections.abc import Callable

from nldyn.base.errors import SystemModelError
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.options import FlowOptions
from nldyn.longterm.attractors import find_attractors
from nldyn.longterm.basins import MOTION, Basins, PlaneState, StatePlane, basins, check_has_basins
from nldyn.orbits.orbit import check_observe
from nldyn.runtime.executors import own_processes
from nldyn.runtime.progress import Progress, Shares, silent
from nldyn.scene.build import build_system
from nldyn.scene.faults import told_as
from nldyn.scene.schema import Scene
from nldyn.system.system import System

STARTS = 24  # states from which attractors are looked for
CHECKS = 40  # cells that are simulated once more
Range = tuple[float, float]


def basins_of(
    scene: Scene,
    frequency_hz: float,
    *,
    x: PlaneState | None = None,
    y: PlaneState | None = None,
    x_range: Range | None = None,
    y_range: Range | None = None,
    cells: int = 50,
    longest: int = 2000,
    progress: Progress | None = None,
    jobs: int = 1,
) -> Basins:
    """Basins of attraction of a scene in a plane of two of its initial states.

    All else begins undeformed and without speed, at forcing phase zero.

    Parameters
    ----------
    scene : Scene
        It needs no continuation, whose `rtol` counts if there is one.
    frequency_hz : float
        Excitation frequency in Hz.
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
    table = scene.continuation
    flow = FlowMap(build_system(scene), FlowOptions(table.rtol) if table else None)
    name = first_interface(flow.system)
    x, y = x or ("displacement", name), y or ("velocity", name)
    sought = 0 if x_range and y_range else STARTS
    shares = Shares(progress or silent, {
        "attractors": MOTION * sought, "cells": MOTION * (STARTS + CHECKS) + cells**2
    })  # fmt: skip
    with told_as(scene, (), SystemModelError), own_processes(jobs) as executor:
        check_has_basins(flow, frequency_hz)
        plane = StatePlane.spanned_by(flow.system, x, y, x_range or (-1.0, 1.0), y_range or (-1, 1))
        known = []
        if sought:
            found = find_attractors(
                flow, frequency_hz, starts=sought, executor=executor,
                progress=shares.counted("attractors", "motions to attractors"),
            )  # fmt: skip
            known = [share.attractor for share in found if share.attractor.lasting]
            plane = StatePlane.around(known, x, y, x_range=x_range, y_range=y_range)
        return basins(
            flow, frequency_hz, plane, shape=(cells, cells), attractors=known, starts=STARTS,
            longest=longest, checks=CHECKS, executor=executor,
            progress=_in_cells(shares.part("cells")),
        )  # fmt: skip


def first_interface(system: System) -> str:
    """The interface of the first stop, or the first one whose motion is relative."""
    if system.stops:
        return system.stops[0].at
    relative = [name for name in system.interfaces if name not in system.rides]
    return relative[0] if relative else check_observe(system, None)


def _in_cells(tell: Progress) -> Callable[[int, int], None]:
    return lambda done, total: tell(f"{done} of {total} cells", 0.0, done / max(total, 1))
