"""From a scene file to a component, a reduced model, a system and its branches.

This module joins `fem`, `cms` and `nldyn`.
"""

from __future__ import annotations

import logging
import re
import tomllib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from nldyn.base.errors import SceneError, SystemModelError
from nldyn.base.resources import data_directory
from nldyn.runtime.progress import Progress, Shares, silent
from nldyn.scene.checks import (
    check_computable,
    check_mesh_names,
    check_ratio_count,
    check_scene,
    check_structure_names,
    range_remark,
)
from nldyn.scene.described_parts import with_described_parts
from nldyn.scene.messages import KeyPath, from_validation, scene_error, table_at
from nldyn.scene.schema import ContinuationTable, ExcitationTable, PartTable, Scene, StopTable

if TYPE_CHECKING:
    import cms
    import fem
    from nldyn.flow.flow_map import FlowMap
    from nldyn.io.checkpoint import CheckpointFile
    from nldyn.reduction.candidates import Candidates
    from nldyn.reduction.selection import ModeSelection
    from nldyn.runtime.progress import Progress
    from nldyn.search.diagram import Diagram
    from nldyn.search.exploration import Exploration
    from nldyn.system.elements import Damper, Excitation, Stop
    from nldyn.system.system import System

__all__ = [
    "Scene",
    "SceneError",
    "build_candidates",
    "build_component",
    "build_reduced",
    "build_selection",
    "build_system",
    "compute",
    "explore_scene",
    "load_scene",
    "parse_scene",
]

logger = logging.getLogger("nldyn")
CHOICE = 1.0  # time to choose modes by a tolerance, relative to that of the diagram
LARGE = 20000  # degrees of freedom from which on the factorisation takes seconds
LARGEST_SCENE = 10_000_000  # bytes or letters
_WORD = r"""(?:(?<![\w-])[\w-]++|"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
MANY_DOTS = re.compile(rf"(?:{_WORD}[ \t]*+\.[ \t]*+){{100}}")


def load_scene(path: str | Path, mesh_folders: Iterable[str | Path] = ()) -> Scene:
    """Read and check a scene file.

    Parameters
    ----------
    path : str or Path
        A TOML file; ``docs/scene.md`` describes its keys. Its mesh is looked for relative to the
        folder of the file.
    mesh_folders : iterable of str or Path
        Folders from which its mesh may come, beside that of the scene and the current one.

    Returns
    -------
    Scene
        The checked scene; nothing is computed yet.

    Raises
    ------
    SceneError
        If the file cannot be read or a key in it is unknown, missing or out of range.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> load_scene(example("one_dof.toml")).continuation.range_hz
    [5.0, 90.0]
    """
    file = Path(path)
    try:
        check_regular(file)
        with file.open("rb") as stream:
            content = stream.read(LARGEST_SCENE + 1)
    except (OSError, ValueError) as error:
        raise scene_error(file, (), _unreadable(error)) from None
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise scene_error(file, (), "is not a TOML file (its text is not UTF-8)") from None
    return parse_scene(text, file, mesh_folders)


def parse_scene(
    text: str, file: str | Path = "scene.toml", mesh_folders: Iterable[str | Path] = ()
) -> Scene:
    """Check the text of a scene.

    Parameters
    ----------
    text : str
        TOML.
    file : str or Path
        Name used in errors; its folder is where the mesh is looked for.
    mesh_folders : iterable of str or Path
        As for `load_scene`.

    Raises
    ------
    SceneError
        As for `load_scene`.

    Examples
    --------
    >>> parse_scene('''
    ... [modal]
    ... frequencies_hz = [13.1]
    ... participation.tip = [0.6]
    ... ''').interface_names
    ['tip']
    """
    file = Path(file)
    if len(text) > LARGEST_SCENE:
        raise scene_error(file, (), f"is larger than {LARGEST_SCENE // 10**6} MB; use a mesh")
    if MANY_DOTS.search(text):  # reading it would take the square of their number
        raise scene_error(file, (), "has a key of more than 100 words with dots between them")
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        fault = f"is not valid TOML: {_toml_fault(str(error))}"
        raise scene_error(file, (), fault) from None
    return scene_from_tables(tables, file, text, mesh_folders)


def scene_from_tables(
    tables: dict[str, Any],
    file: str | Path,
    text: str = "",
    mesh_folders: Iterable[str | Path] = (),
) -> Scene:
    """Check the tables of a scene that have been read from a text or changed since.

    Raises
    ------
    SceneError
        As for `load_scene`.
    """
    file = Path(file)
    try:
        scene = Scene.model_validate(tables)
    except ValidationError as error:
        raise from_validation(file, Scene, error) from None
    scene._file, scene._text = file, text
    try:
        asked = (file.parent, Path(), *mesh_folders)
        scene._mesh_folders = tuple(Path(folder).resolve() for folder in asked)
    except (OSError, ValueError, RuntimeError) as error:  # the last one of links in a circle
        fault = _lower_first(str(error))
        raise SceneError(f"a folder for meshes cannot be used: {fault}") from None
    check_scene(scene, file)
    return scene


def build_component(scene: Scene, refinement: int = 1) -> fem.Component | fem.StructureComponent:
    """Assemble the mesh of a scene.

    Parameters
    ----------
    scene : Scene
        A scene with a ``[mesh]``.
    refinement : int
        Cut every line of a frame, or of a structure of lines alone, into this many.

    Returns
    -------
    fem.Component or fem.StructureComponent
        Sparse stiffness (N/m) and mass (kg), and the interfaces.

    Raises
    ------
    SceneError
        If the scene has no mesh, or the mesh is unreadable, empty or lacks a name used, or is of a
        structure and to be refined.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> list(build_component(load_scene(example("two_dof_xi_0.01.toml"))).interfaces)
    ['middle']
    """
    import fem

    if scene.mesh is None:
        raise scene_error(scene.file, ("mesh",), "is missing: the structure is not given by a mesh")
    path, ignore = _mesh_path(scene, scene.mesh.file), scene.mesh.ignore
    if scene.mesh.model == "structure":
        with _told_as(scene, ("mesh", "file"), fem.ModelError):
            structure = fem.read_structure(path, _mesh_places(scene), ignore)
            structure = _in_metres(scene, structure)
            if scene.mesh.merge:
                structure = fem.joined(
                    [structure], None if scene.mesh.merge is True else scene.mesh.merge
                )
        structure = _with_places(scene, structure)
        scene = with_described_parts(scene, structure)
        check_structure_names(scene, structure, scene.file)
        if refinement > 1:
            if set(structure.cells) - {"line", "vertex"}:
                fault = "has cells other than two-node lines; refine it in the mesher: --meshes"
                raise scene_error(scene.file, ("mesh", "file"), fault)
            structure = refined_structure(structure, refinement)
        with _told_as(scene, (), fem.ModelError):
            return fem.assemble(_structure_model(scene, structure))
    with _told_as(scene, ("mesh", "file"), fem.ModelError):
        mesh = _in_metres(scene, fem.read_mesh(path, _mesh_places(scene), ignore))
    mesh = _with_places(scene, mesh)
    scene = with_described_parts(scene, mesh)
    check_mesh_names(scene, mesh, scene.file)
    with _told_as(scene, (), fem.ModelError):
        if refinement > 1:
            mesh = refined_mesh(mesh, refinement)
        return fem.assemble(_frame_model(scene, mesh))


Mesh = TypeVar("Mesh", "fem.FrameMesh", "fem.StructureMesh")
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}


def _in_metres(scene: Scene, mesh: Mesh) -> Mesh:
    """The mesh with its coordinates in m; what else a file holds cannot be converted."""
    assert scene.mesh is not None
    unit = scene.mesh.unit
    if unit == "m":
        return mesh
    if mesh.attachments or scene.mesh.parts_from_file:
        fault = f"'{unit}' tells the unit of lengths alone, but masses, springs or parts are taken"
        raise scene_error(scene.file, ("mesh", "unit"), f"{fault} from the file, too")
    return mesh.with_points(METRES[unit] * mesh.points)


def _with_places(scene: Scene, mesh: Mesh) -> Mesh:
    """The mesh with the point sets of ``[places]``."""
    import fem

    sets = {}
    for name, place in scene.places.items():
        with _told_as(scene, ("places", name), fem.ModelError):
            if name in mesh.point_sets:
                raise fem.ModelError(f"{mesh.source}: has a point set of this name already")
            if place.at is not None:
                sets[name] = fem.node_at(mesh.points, place.at, mesh.source)
            else:
                assert place.box is not None
                sets[name] = fem.nodes_inside(mesh.points, place.box, mesh.source)
    return mesh.with_point_sets(sets) if sets else mesh


def build_reduced(
    scene: Scene,
    component: fem.Component | fem.StructureComponent | None = None,
    progress: Progress | None = None,
) -> cms.ReducedModel:
    """Reduce the mesh of a scene to the modes that it asks for.

    Parameters
    ----------
    scene : Scene
        A scene with a ``[mesh]`` and a ``[reduction]``.
    component : fem.Component or fem.StructureComponent, optional
        What `build_component` gave for this scene, if it is at hand.
    progress : callable, optional
        As for `nldyn.select_modes`, which chooses the modes of a scene with a tolerance.

    Returns
    -------
    cms.ReducedModel
        Modes with frequencies in Hz.

    Raises
    ------
    SceneError
        As for `build_component`, and if there are not as many modes as asked for.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> reduced = build_reduced(load_scene(example("two_dof_xi_0.01.toml")))
    >>> len(reduced.frequencies_hz)
    2
    """
    import cms

    component = component or build_component(scene)
    table = scene.reduction
    assert table is not None
    if table.tolerance is not None:
        selection = build_selection(scene, component, progress)
        logger.info(selection.report())
        return selection.reduced
    pieces = _count_pieces(len(component.model.mesh.points), component.model.links)
    hint = f"; the mesh is in {pieces} pieces that share no node" if pieces > 1 else ""
    with _told_as(scene, ("reduction",), cms.ReductionError, hint=hint):
        reduced = cms.reduce(
            component,
            modes=table.modes,
            cutoff_hz=table.cutoff_hz,
            method=table.method,
            residual=table.residual,
            progress=logger.info if component.mass.shape[0] > LARGE else None,
        )
        if pieces > 1 and reduced.rigid_body_modes:
            count = reduced.rigid_body_modes
            modes = f"{count} rigid-body mode{'s' if count > 1 else ''}"
            raise cms.ReductionError(f"the component floats ({modes})")
        return reduced


def build_candidates(
    scene: Scene, component: fem.Component | fem.StructureComponent | None = None
) -> Candidates:
    """The modes among which a scene with a tolerance chooses, by its linear response alone.

    Parameters
    ----------
    scene, component
        As for `build_selection`.

    Returns
    -------
    Candidates

    Raises
    ------
    SceneError
        As for `build_selection`, as far as the linear response tells.
    """
    import cms
    from nldyn.reduction.candidates import candidate_modes
    from nldyn.scene.load_case import load_case_of

    setting = load_case_of(scene)
    component = component or build_component(scene)
    with _told_as(scene, ("reduction",), cms.ReductionError, SystemModelError):
        return candidate_modes(component, setting)


def build_selection(
    scene: Scene,
    component: fem.Component | fem.StructureComponent | None = None,
    progress: Progress | None = None,
) -> ModeSelection:
    """Choose the modes of a scene by the tolerance of its ``[reduction]``.

    Parameters
    ----------
    scene : Scene
        A scene with a ``[mesh]`` and ``tolerance`` in ``[reduction]``.
    component : fem.Component or fem.StructureComponent, optional
        What `build_component` gave for this scene, if it is at hand.
    progress : callable, optional
        As for `nldyn.select_modes`.

    Returns
    -------
    ModeSelection
        As `nldyn.select_modes` gives it.

    Raises
    ------
    SceneError
        As for `build_component`, if there is nothing to compute, and if no model can be chosen.
    """
    import cms
    from nldyn.base.errors import ConvergenceError
    from nldyn.reduction.selection import select_modes
    from nldyn.scene.load_case import load_case_of

    table = scene.reduction
    assert table is not None and table.tolerance is not None
    setting = load_case_of(scene)
    component = component or build_component(scene)
    faults = (cms.ReductionError, ConvergenceError, SystemModelError)
    with _told_as(scene, ("reduction",), *faults):
        return select_modes(component, setting, tolerance=table.tolerance, progress=progress)


def build_system(scene: Scene, reduced: cms.ReducedModel | None = None) -> System:
    """Build the system with its stops, dampers and excitation.

    Parameters
    ----------
    scene : Scene
        Any scene.
    reduced : cms.ReducedModel, optional
        What `build_reduced` gave for this scene, if it is at hand.

    Returns
    -------
    System
        The equations in modal form, with the observed interface first.

    Raises
    ------
    SceneError
        As for `build_reduced`, and if the parts do not make a system.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> f"{build_system(load_scene(example('one_dof.toml'))).frequencies_hz[0]:.4f}"
    '13.1293'
    """
    from nldyn.reduction.load_case import with_first
    from nldyn.system.system import System

    with _told_as(scene, (), SystemModelError):
        stops, dampers, excitation = acting_elements(scene)
        acting: dict[str, Any] = {
            "modal_damping": scene.damping.modal_ratio,
            "stops": stops,
            "dampers": dampers,
            "excitation": excitation,
        }
        rayleigh = scene.damping.rayleigh
        if any(rayleigh) and scene.mesh is None:
            fault = "has Rayleigh's damping, which needs a [mesh]"
            raise scene_error(scene.file, ("damping",), fault)
        if scene.modal is not None:
            hz = scene.modal.frequencies_hz
            check_ratio_count(scene, len(hz), scene.file)
            first = _observed_first(scene, scene.modal.participation)
            return System.from_modal(hz, first, **acting)
        if scene.matrices is not None:
            table = scene.matrices
            check_ratio_count(scene, len(table.mass), scene.file)
            first = _observed_first(scene, table.interfaces)
            with _told_as(scene, ("matrices",), SystemModelError):
                return System.from_matrices(
                    table.mass, table.stiffness, first, damping=table.damping, **acting
                )
        reduced = reduced or build_reduced(scene)
        check_ratio_count(scene, len(reduced.frequencies_hz), scene.file)
        if any(rayleigh):
            reduced = reduced.with_damping(rayleigh=rayleigh)
        return System.from_reduced(with_first(reduced, scene.observed), **acting)


def compute(
    scene: Scene,
    progress: Progress | None = None,
    checkpoint: CheckpointFile | None = None,
    jobs: int = 1,
) -> Diagram:
    """Compute all branches that a scene asks for.

    The whole scene is built and checked before the first orbit is sought.

    Parameters
    ----------
    scene : Scene
        A scene with an ``[[excitation]]`` and a ``[continuation]``.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)`` at every orbit.
    checkpoint : CheckpointFile, optional
        File that keeps what is computed, see `nldyn.diagram`.
    jobs : int
        Processes that share the work, see `nldyn.diagram`.

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
    if scene.explore is not None:
        return explore_scene(scene, progress, checkpoint, jobs).diagram
    shares = _shares(scene, progress)
    flow, table = _to_follow(scene, shares)
    from nldyn.branches.options import ContinuationOptions
    from nldyn.search.diagram import Seed, diagram

    with _told_as(scene, ("continuation",), SystemModelError):
        found = diagram(
            flow,
            (table.range_hz[0], table.range_hz[1]),
            table.periods,
            seeds=[Seed(seed.period, seed.near_hz) for seed in scene.subharmonics],
            search_points=table.search_points,
            doublings=table.follow_doublings,
            options=ContinuationOptions(max_step=table.max_step),
            progress=shares.part("branches"),
            checkpoint=checkpoint,
            jobs=jobs,
        )
    return _remarked(scene, flow, found)


def _remarked(scene: Scene, flow: FlowMap, found: Diagram) -> Diagram:
    """A diagram with a note on what the model of the structure is not good for."""
    remark = range_remark(scene, float(flow.system.frequencies_hz.max()))
    return replace(found, notes=(*found.notes, remark)) if remark else found


def explore_scene(
    scene: Scene,
    progress: Progress | None = None,
    checkpoint: CheckpointFile | None = None,
    jobs: int = 1,
) -> Exploration:
    """Find the branches of a scene with an ``[explore]`` table, and tell how well it was searched.

    Parameters
    ----------
    scene : Scene
        A scene with an ``[[excitation]]``, a ``[continuation]`` and an ``[explore]``.
    progress, checkpoint, jobs
        As for `nldyn.explore`.

    Returns
    -------
    Exploration

    Raises
    ------
    SceneError
        As for `compute`.

    Examples
    --------
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
    >>> explore_scene(scene).settled_share
    1.0
    """
    shares = _shares(scene, progress)
    flow, table = _to_follow(scene, shares)
    from nldyn.branches.options import ContinuationOptions
    from nldyn.search.exploration import ExploreOptions
    from nldyn.search.explore import explore

    if scene.explore is None:
        raise scene_error(scene.file, ("explore",), "is missing")
    efforts = scene.explore.model_dump()
    with _told_as(scene, ("explore",), SystemModelError):
        found = explore(
            flow,
            (table.range_hz[0], table.range_hz[1]),
            efforts.pop("max_period"),
            effort=ExploreOptions(**efforts),
            options=ContinuationOptions(max_step=table.max_step),
            progress=shares.part("branches"),
            checkpoint=checkpoint,
            jobs=jobs,
        )
    return replace(found, diagram=_remarked(scene, flow, found.diagram))


def _shares(scene: Scene, progress: Progress | None) -> Shares:
    """The parts of a computation: to choose modes takes a while if a tolerance is given."""
    chosen = scene.reduction is not None and scene.reduction.tolerance is not None
    return Shares(progress or silent, {"model": CHOICE if chosen else 0.0, "branches": 1.0})


def _to_follow(scene: Scene, shares: Shares) -> tuple[FlowMap, ContinuationTable]:
    """Flow map of a scene that says what to compute."""
    check_computable(scene, scene.file)
    model = None
    if scene.mesh is not None:
        model = build_reduced(scene, progress=shares.part("model"))
    system = build_system(scene, model)
    shares.end("model")
    from nldyn.flow.flow_map import FlowMap
    from nldyn.flow.options import FlowOptions

    table = scene.continuation
    assert table is not None
    with _told_as(scene, ("continuation",), SystemModelError):
        return FlowMap(system, FlowOptions(table.rtol)), table


def acting_elements(
    scene: Scene,
) -> tuple[tuple[Stop, ...], tuple[Damper, ...], tuple[Excitation, ...]]:
    """The stops, dampers and excitation of a scene; a `SceneError` says what is wrong with one."""
    from nldyn.system.elements import Damper

    with _told_as(scene, (), SystemModelError):
        return (
            tuple(_stop(stop) for stop in scene.stops),
            tuple(Damper(damper.at, damper.coefficient) for damper in scene.dampers),
            tuple(_excitation(table) for table in scene.excitation),
        )


def _frame_model(scene: Scene, mesh: fem.FrameMesh) -> fem.FrameModel:
    import fem

    parts = {
        name: _truss(table) if table.kind == "truss" else _beam(table)
        for name, table in scene.parts.items()
    }
    separate = scene.mesh is not None and scene.mesh.separate
    return fem.FrameModel(mesh, parts, separate=separate, **_attached(scene))


def _structure_model(scene: Scene, mesh: fem.StructureMesh) -> fem.StructureModel:
    import fem

    return fem.StructureModel(
        mesh,
        parts={name: _part(table) for name, table in scene.parts.items()},
        couplings=[
            fem.Coupling(c.at, c.face, c.kind, c.place, tuple(c.directions))
            for c in scene.couplings
        ],
        foundations=[fem.Foundation(f.at, f.stiffness) for f in scene.foundations],
        separate=scene.mesh is not None and scene.mesh.separate,
        **_attached(scene),
    )


def _attached(scene: Scene) -> dict[str, Any]:
    """What holds, loads and joins the points of a frame or a structure."""
    import fem

    return {
        "supports": [fem.Support(s.at, tuple(s.fixed)) for s in scene.supports],
        "point_masses": [
            fem.PointMass(m.at, m.mass, m.rotary_inertia, m.offset or (0.0, 0.0, 0.0))
            for m in scene.point_masses
        ],
        "springs": [fem.PointSpring(s.at, s.direction, s.stiffness) for s in scene.springs],
        "hinges": [fem.Hinge(h.at, h.part) for h in scene.hinges],
        "interfaces": {
            name: fem.Interface(i.at, i.direction) for name, i in scene.interfaces.items()
        },
    }


def refined_mesh(mesh: fem.FrameMesh, times: int) -> fem.FrameMesh:
    """The mesh with every line cut into equal pieces; names of parts and points stay.

    Examples
    --------
    >>> import fem
    >>> mesh = fem.frame_mesh({"a": (0, 0), "b": (1, 0)}, [("arm", "a", "b", 2)])
    >>> len(refined_mesh(mesh, 3).lines)
    6
    """
    points, lines, pieces = cut_lines(mesh.points, mesh.lines, times)
    parts = {name: pieces[elements].ravel() for name, elements in mesh.parts.items()}
    types = {name: pieces[elements].ravel() for name, elements in mesh.element_types.items()}
    return replace(mesh, points=points, lines=lines, parts=parts, element_types=types)


def refined_structure(mesh: fem.StructureMesh, times: int) -> fem.StructureMesh:
    """The same for the lines of a structure."""
    points, lines, pieces = cut_lines(mesh.points, mesh.cells["line"], times)
    groups, types = (
        {
            name: {k: pieces[at].ravel() if k == "line" else at for k, at in group.items()}
            for name, group in named.items()
        }
        for named in (mesh.groups, mesh.element_types)
    )
    cells = {**mesh.cells, "line": lines}
    return replace(mesh, points=points, cells=cells, groups=groups, element_types=types)


def cut_lines(
    points: NDArray[np.float64], lines: NDArray[np.int64], times: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Points and lines where each line is cut into equal pieces, and their numbers (e, times)."""
    n, count = len(points), len(lines)
    first, last = (points[lines[:, end]] for end in (0, 1))
    share = np.arange(1, times)[None, :, None] / times
    inner = first[:, None] + share * (last - first)[:, None]
    numbers = n + np.arange(count * (times - 1)).reshape(count, times - 1)
    chain = np.hstack([lines[:, :1], numbers, lines[:, 1:]])
    cut = np.stack([chain[:, :-1], chain[:, 1:]], axis=-1).reshape(-1, 2)
    pieces = np.arange(count * times).reshape(count, times)
    return np.vstack([points, inner.reshape(-1, 3)]), cut, pieces


def _count_pieces(count: int, links: NDArray[np.int64]) -> int:
    """Count the pieces of a mesh of ``count`` nodes that share no node; links are pairs (m, 2)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = (links[:, 0], links[:, 1])
    graph = coo_array((np.ones(len(links)), ends), shape=(count, count))
    _, piece = connected_components(graph, directed=False)
    return len(np.unique(piece[links]))


def _truss(table: PartTable) -> fem.TrussPart:
    import fem

    assert table.area is not None
    material = fem.Material(table.youngs_modulus, table.density, table.poissons_ratio)
    return fem.TrussPart(material, table.area)


def _part(table: PartTable) -> fem.BeamPart | fem.TrussPart | fem.SolidPart | fem.ShellPart:
    import fem

    material = fem.Material(table.youngs_modulus, table.density, table.poissons_ratio)
    if table.kind == "solid":
        return fem.SolidPart(material, table.plane, table.thickness)
    if table.kind == "shell":
        assert table.thickness is not None and not isinstance(table.offset, list)
        return fem.ShellPart(material, table.thickness, table.offset or 0.0)
    return _truss(table) if table.kind == "truss" else _beam(table)


def _beam(table: PartTable) -> fem.BeamPart:
    import fem

    material = fem.Material(table.youngs_modulus, table.density, table.poissons_ratio)
    return fem.BeamPart(
        material,
        _section(table),
        table.theory or "euler-bernoulli",
        table.axial_force or 0.0,
        table.orientation,
        table.offset if isinstance(table.offset, list) else (0.0, 0.0),
    )


def _section(table: PartTable) -> fem.CrossSection | fem.TaperedSection:
    import fem

    sections: list[fem.RectangularSection | fem.CircularSection] = []
    for end in ("", "_end"):
        width, height, diameter, bore = (
            table.size(name, end) for name in ("width", "height", "diameter", "bore")
        )
        if width is not None and height is not None:
            sections.append(fem.RectangularSection(width, height))
        elif diameter is not None:
            sections.append(fem.CircularSection(diameter, bore or 0.0))
    if table.taper is not None:
        return fem.TaperedSection(sections[0], sections[1], table.taper[0], table.taper[1])
    if sections:
        return sections[0]
    assert table.area is not None and table.second_moment is not None
    return fem.Section(
        table.area,
        table.second_moment,
        table.second_moment_across,
        table.torsion_constant,
        table.shear_area,
        table.shear_area_across,
    )


def _stop(table: StopTable) -> Stop:
    from nldyn.system.elements import Stop, dissipation_for, hertz_stiffness

    stiffness = table.stiffness
    if stiffness is None:
        assert table.radius is not None and table.youngs_modulus is not None
        ratio = 0.3 if table.poissons_ratio is None else table.poissons_ratio
        stiffness = hertz_stiffness(table.radius, table.youngs_modulus, ratio)
    exponent = 1.0 if table.law == "linear" else table.exponent or 1.5
    loss = table.dissipation or 0.0
    if table.restitution is not None and table.impact_speed is not None:
        loss = dissipation_for(table.restitution, table.impact_speed)
    return Stop(table.at, stiffness, exponent, table.gap, table.direction, table.against, loss)


def _excitation(table: ExcitationTable) -> Excitation:
    from nldyn.system.elements import HarmonicForce, Unbalance

    if table.mass_times_radius is not None:
        return Unbalance(table.at, table.mass_times_radius, table.phase_deg)
    assert table.amplitude is not None
    return HarmonicForce(table.at, table.amplitude, table.phase_deg)


def _observed_first(scene: Scene, interfaces: Any) -> dict[str, Any]:
    """Put the observed interface first: orbits report the displacement of the first one."""
    names = sorted(interfaces, key=lambda name: name != scene.observed)
    return {name: interfaces[name] for name in names}


@contextmanager
def _told_as(scene: Scene, key: KeyPath, *kinds: type[Exception], hint: str = "") -> Iterator[None]:
    """Tell an error of a lower layer as one of this scene's."""
    try:
        yield
    except kinds as error:
        text = str(error).rstrip(".") + hint
        word, _, rest = text.partition(" ")
        table = table_at(Scene, key)
        if key and table is not None and word in table.model_fields:
            raise scene_error(scene.file, (*key, word), rest) from error
        raise scene_error(scene.file, key, text, sep=": ") from error


def _mesh_path(scene: Scene, name: str) -> Path:
    """Where the mesh is: a file that can be read, in one of the places it may come from."""
    path = scene.file.parent / name
    try:
        real = path.resolve()
        if not any(real.is_relative_to(place) for place in _mesh_places(scene)):
            advice = f"if that is meant, allow it with --mesh-folder {real.parent}"
            if not real.is_file():
                advice = "there is no such file: copy the mesh beside the scene"
            fault = f"leads to {real}, outside the folder of the scene and the current one"
            raise scene_error(scene.file, ("mesh", "file"), f"{fault}; {advice}")
        check_regular(path)
        path.open("rb").close()
    except SceneError:
        raise
    except (OSError, ValueError, RuntimeError) as error:  # the last one of links in a circle
        fault = f"names {path}, which {_unreadable(error)}"
        raise scene_error(scene.file, ("mesh", "file"), fault) from None
    return path


def _mesh_places(scene: Scene) -> list[Path]:
    """Folders below which the mesh of a scene may be: those asked for, and the package's own."""
    return [*scene.mesh_folders, (data_directory() / "meshes").resolve()]


def check_regular(path: Path) -> None:
    """Refuse what is no file: opening a pipe would wait without end, and a device has no end."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise ValueError("it is not a regular file")


def _unreadable(error: OSError | ValueError | RuntimeError) -> str:
    """Say why a file cannot be opened."""
    if isinstance(error, FileNotFoundError):
        return "does not exist"
    if isinstance(error, IsADirectoryError):
        return "is a folder"
    return f"cannot be read: {_lower_first(getattr(error, 'strerror', None) or str(error))}"


def _toml_fault(text: str) -> str:
    """What the TOML reader says, told in the words of TOML where it uses Python's."""
    text = _lower_first(text).replace("cannot overwrite a value", "a key or table is given twice")
    if "set_int_max_str_digits" in text:
        return "a whole number has thousands of digits"
    declared = re.match(r"cannot declare \((.*?),?\) twice", text)
    if declared is None:
        return text
    name = ".".join(re.findall(r"'(.*?)'", declared[1]))
    return f"the table [{name}] is given twice{text[declared.end() :]}"


def _lower_first(text: str) -> str:
    return text[:1].lower() + text[1:]
