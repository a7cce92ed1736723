"""Compute what a scene asks for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from nldyn.base.errors import SystemModelError
from nldyn.branches.step_control import ContinuationOptions
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.options import FlowOptions
from nldyn.io.checkpoint import CheckpointFile
from nldyn.orbits.axis import Axis
from nldyn.orbits.conditions import driving_source
from nldyn.runtime.progress import Progress, Shares, silent
from nldyn.scene.build import Structure, build_structure, build_system
from nldyn.scene.checks import check_computable, check_held_to_follow, remarks
from nldyn.scene.faults import told_as
from nldyn.scene.followed import axis_of
from nldyn.scene.schema.computation import ContinuationTable
from nldyn.scene.schema.scene import Scene
from nldyn.scene.simulation import start_of
from nldyn.search.diagram import Diagram, SubharmonicSeed, diagram
from nldyn.search.exploration import Exploration, ExploreOptions
from nldyn.search.explore import explore
from nldyn.system.equilibrium import rest_positions

CHOICE = 1.0  # time to choose modes by a tolerance, relative to that of the diagram


def compute(
    scene: Scene,
    progress: Progress | None = None,
    checkpoint: CheckpointFile | None = None,
    jobs: int = 1,
    structure: Structure | None = None,
) -> Diagram:
    """Compute all branches that a scene asks for.

    The whole scene is built and checked before the first orbit is sought.

    Parameters
    ----------
    scene : Scene
        A scene with a ``[continuation]``, and with an ``[[excitation]]`` or motions that excite
        themselves.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)`` at every orbit.
    checkpoint : CheckpointFile, optional
        File that keeps what is computed, see `nldyn.diagram`.
    jobs : int
        Processes that share the work, see `nldyn.diagram`.
    structure : Structure, optional
        What `structure_of` gave for this scene, if it is at hand.

    Returns
    -------
    Diagram
        Branches with their points and special points.

    Raises
    ------
    SceneError
        As for `build_system`, and if the scene has nothing to compute.

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
    ... [continuation]
    ... range_hz = [10.0, 16.0]
    ... periods = [1]
    ... ''')
    >>> len(compute(scene).branches)     # without a stop there is only the resonance curve
    1
    """
    found = results_of(scene, progress, checkpoint, jobs, structure)
    return found.diagram if isinstance(found, Exploration) else found


def results_of(
    scene: Scene,
    progress: Progress | None = None,
    checkpoint: CheckpointFile | None = None,
    jobs: int = 1,
    structure: Structure | None = None,
) -> Diagram | Exploration:
    """The branches of a scene; with an ``[explore]`` table also how well they were searched.

    Parameters
    ----------
    scene, progress, checkpoint, jobs, structure
        As for `compute`.

    Raises
    ------
    SceneError
        As for `compute`.

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
    ... [continuation]
    ... range_hz = [10.0, 16.0]
    ... [explore]
    ... max_period = 2
    ... spacing = 0.1
    ... ''')
    >>> results_of(scene).settled_share
    1.0
    """
    shares = parts_of_work(scene, progress, built=structure is not None)
    structure = structure or structure_of(scene, shares.part("model"))
    shares.end("model")
    flow, table, axis = _to_follow(scene, structure)
    given: dict[str, Any] = {
        "parameter": axis.parameter,
        "frequency_hz": axis.frequency_hz,
        "options": ContinuationOptions(max_step=table.max_step),
        "progress": shares.part("branches"),
        "checkpoint": checkpoint,
        "jobs": jobs,
    }
    if scene.explore is not None:
        efforts = scene.explore.model_dump()
        longest = efforts.pop("max_period")
        with told_as(scene, ("explore",), SystemModelError):
            searched = explore(
                flow, axis.limits, longest, effort=ExploreOptions(**efforts), **given
            )
        return replace(searched, diagram=_remarked(scene, flow, searched.diagram))
    with told_as(scene, ("continuation",), SystemModelError):
        found = diagram(
            flow,
            axis.limits,
            table.periods,
            seeds=[SubharmonicSeed(seed.period, seed.place) for seed in scene.subharmonics],
            start=start_of(scene, flow.system) if axis.self_excited else None,
            search_points=table.search_points,
            doublings=table.follow_doublings,
            **given,
        )
    return _remarked(scene, flow, found)


def structure_of(scene: Scene, progress: Progress | None = None) -> Structure:
    """Build the structure of a scene that says what to compute, after a check of the whole scene.

    Raises
    ------
    SceneError
        As for `compute`.
    """
    check_computable(scene, scene.file)
    return build_structure(scene, progress)


def parts_of_work(scene: Scene, progress: Progress | None, *, built: bool = False) -> Shares:
    """The parts ``model`` and ``branches``: to choose modes by a tolerance takes a while."""
    chosen = scene.reduction is not None and scene.reduction.tolerance is not None
    weight = CHOICE if chosen and not built else 0.0
    return Shares(progress or silent, {"model": weight, "branches": 1.0})


def _to_follow(scene: Scene, structure: Structure) -> tuple[FlowMap, ContinuationTable, Axis]:
    """Flow map of a scene that says what to compute, how, and over what."""
    system = build_system(scene, structure.reduced)
    table = scene.continuation
    assert table is not None
    check_held_to_follow(scene, system)
    axis = axis_of(scene, system)
    with told_as(scene, ("continuation",), SystemModelError):
        if system.bonds:  # searches start where it rests
            rest_positions(system)
        if "phase resonance" in table.events:
            driving_source(system)
        return FlowMap(system, FlowOptions(table.rtol)), table, axis


def _remarked(scene: Scene, flow: FlowMap, found: Diagram) -> Diagram:
    """A diagram with its events, and notes on what looks like a mistake in the units."""
    assert scene.continuation is not None
    if scene.continuation.events:
        found = found.with_events(scene.continuation.events)
    said = remarks(scene, flow.system)
    return replace(found, notes=(*found.notes, *said)) if said else found
