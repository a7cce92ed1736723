"""From a scene to a reduced model and a system."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

import cms
import fem
from cms.reduction.boundary import told_of_massless
from cms.reduction.doubt import check_unreduced
from cms.reduction.seen import told_of_seen
from fem.assembly.component import MOST_ERROR, CurvedCellsWarning
from nldyn.base.arrays import Real
from nldyn.base.errors import LARGEST_DENSE, ConvergenceError, SystemModelError
from nldyn.reduction.candidates import Candidates, candidate_modes
from nldyn.reduction.load_case import system_of_reduced
from nldyn.runtime.progress import Progress
from nldyn.scene.checks import check_ratio_count
from nldyn.scene.component import build_component
from nldyn.scene.contact import area_stops, told_of_areas, with_areas
from nldyn.scene.faults import told_as, within_component
from nldyn.scene.load_case import load_case_of
from nldyn.scene.matrices import build_matrices, skew_matrices
from nldyn.scene.messages import scene_error
from nldyn.scene.schema.scene import Scene
from nldyn.scene.stops_and_loads import acting_elements
from nldyn.system.loads import BaseMotion
from nldyn.system.ride import carried_apart, told_apart
from nldyn.system.spin import Spin
from nldyn.system.system import Elements, System

if TYPE_CHECKING:
    from nldyn.flow.flow_map import FlowMap
    from nldyn.reduction.selection import ModeSelection

Given = TypeVar("Given")
AnyComponent = fem.Component | cms.Matrices
logger = logging.getLogger("nldyn")
ESTIMATED = 4  # lowest elastic modes whose error by the mesh is estimated
TOLD_ERROR = (
    0.025  # of a frequency: above it the true one is over 2 %, see docs/results/elements.md
)
LARGE = 20000  # degrees of freedom from which on the factorisation takes seconds


def build_any(scene: Scene) -> AnyComponent:
    """The component of a scene that is to be reduced: of its mesh or its matrices.

    Raises
    ------
    SceneError
        As `build_component` and `build_matrices`.
    """
    return build_component(scene) if scene.matrices is None else build_matrices(scene)


@dataclass(frozen=True)
class Structure:
    """The structure of a scene: its component, and what this is reduced to.

    Parameters
    ----------
    component : fem.Component or cms.Matrices, optional
        None where the scene gives modes, several components, or matrices that are not reduced.
    reduced : cms.ReducedModel, optional
        None where nothing is reduced.
    parts : dict of str to component
        The components of a scene that has several, by name.
    candidates : Candidates, optional
        The modes among which a tolerance is to choose, where `reduced` has all of them.
    """

    component: AnyComponent | None = None
    reduced: cms.ReducedModel | None = None
    parts: Mapping[str, AnyComponent] = field(default_factory=dict)
    candidates: Candidates | None = None


def build_structure(
    scene: Scene, progress: Progress | None = None, *, chosen: bool = True
) -> Structure:
    """Build the component of a scene and reduce it, as `build_any` and `build_reduced` do.

    Unless modes are to be chosen by a tolerance, which takes long, all candidates are kept.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> build_structure(load_scene(example("one_dof.toml")))
    Structure(component=None, reduced=None, parts={}, candidates=None)
    """
    if scene.components:
        parts = build_parts(scene)
        return Structure(None, join(scene, parts), parts)
    if scene.reduction is None:
        return Structure()
    with doubts_until_modes() as doubts:
        component, candidates = build_any(scene), None
        if scene.reduction.tolerance is not None and not chosen:
            candidates = build_candidates(scene, component)
        reduced = candidates.reduced() if candidates else build_reduced(scene, component, progress)
        if tell_mesh_errors(component, reduced):
            doubts.clear()
    return Structure(component, reduced, candidates=candidates)


@contextmanager
def doubts_until_modes() -> Iterator[list[tuple[Warning | str, type[Warning], str, int]]]:
    """Hold warnings of curved cells back; those that are left in the list at the end are shown."""
    held: list[tuple[Warning | str, type[Warning], str, int]] = []
    with warnings.catch_warnings():
        shown = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if issubclass(category, CurvedCellsWarning):
                held.append((message, category, filename, lineno))
            else:
                shown(message, category, filename, lineno, file, line)

        warnings.showwarning = show
        try:
            yield held
        finally:
            for each in held:
                shown(*each)


def tell_mesh_errors(component: AnyComponent | None, reduced: cms.ReducedModel) -> bool:
    """Warn of the mesh where it makes some of the lowest modes' frequencies likely too high.

    Returns
    -------
    bool
        Whether there are such modes, of a mesh, and none is likely too high.
    """
    if not isinstance(component, fem.Component):
        return False
    elastic = np.flatnonzero(reduced.frequencies_hz > 0.0)
    at = elastic[elastic < len(reduced.frequencies_hz) - reduced.residual_modes][:ESTIMATED]
    if not len(at):
        return False
    errors = component.mesh_errors(reduced.expand(np.eye(len(reduced.frequencies_hz))[:, at]))
    told = [
        f"mode {mode + 1} ({frequency:.4g} Hz) by "
        + (f"{100.0 * error:.2g} %" if error < MOST_ERROR else "100 % or more")
        for mode, frequency, error in zip(at, reduced.frequencies_hz[at], errors, strict=True)
        if error > TOLD_ERROR
    ]
    if told:
        text = (
            f"{component.model.mesh.source}: the mesh makes frequencies too high: likely"
            f" {', '.join(told)}; take shorter cells, or cells of second order"
        )
        warnings.warn(text, fem.MeshWarning, stacklevel=3)
    return not told


def build_reduced(
    scene: Scene,
    component: AnyComponent | None = None,
    progress: Progress | None = None,
) -> cms.ReducedModel:
    """Reduce the mesh or the matrices of a scene to the modes that it asks for.

    Parameters
    ----------
    scene : Scene
        A scene with a ``[mesh]`` or ``[matrices]``, and a ``[reduction]``, or one with components.
    component : optional
        What `build_any` gave for this scene, if it is at hand.
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
    >>> from nldyn.scene.read import load_scene
    >>> reduced = build_reduced(load_scene(example("two_dof_xi_0.01.toml")))
    >>> len(reduced.frequencies_hz)
    2
    """
    if scene.components:
        return join(scene)
    component = component or build_any(scene)
    table = scene.reduction
    if table is None:
        return _unreduced_model(scene, component)
    if table.tolerance is not None:
        selection = build_selection(scene, component, progress)
        logger.info(selection.report())
        return selection.reduced
    pieces = 1 if isinstance(component, cms.Matrices) else fem.pieces_of(component.model).count
    hint = f"; the mesh is in {pieces} pieces that share no node" if pieces > 1 else ""
    coupled = scene.matrices is not None and bool(scene.matrices.skew)
    with told_as(scene, ("reduction",), cms.ReductionError, hint=hint):
        reduced = cms.reduce(
            component,
            modes=table.modes,
            cutoff_hz=table.cutoff_hz,
            method=table.method,
            residual=table.residual,
            unseen=coupled,
            massless=table.massless or None,
            progress=logger.info if component.mass.shape[0] > LARGE else None,
        )
        if pieces > 1 and reduced.rigid_body_modes:
            count = reduced.rigid_body_modes
            modes = f"{count} rigid-body mode{'s' if count > 1 else ''}"
            raise cms.ReductionError(f"the component floats ({modes})")
        if reduced.unseen_modes and not coupled:
            numbers = ", ".join(map(str, reduced.unseen_modes))
            alone = (
                "" if getattr(component, "damping", None) is not None else "; they change nothing"
            )
            logger.info(f"kept modes that no interface can see: {numbers}{alone}")
        for sentence in (
            *told_of_seen(reduced, table.modes),
            *told_of_massless(reduced),
            *told_of_areas(scene, reduced),
        ):
            logger.info(sentence)
        return reduced


def _unreduced_model(scene: Scene, component: AnyComponent) -> cms.ReducedModel:
    """All modes of a component of matrices that are small enough."""
    rows = component.mass.shape[0]
    _check_small(scene, rows)
    with told_as(scene, ("matrices",), cms.ReductionError):
        return cms.reduce(component, modes=rows, unseen=True)


def _check_small(scene: Scene, rows: int) -> None:
    if rows > LARGEST_DENSE:
        fault = f"is missing: matrices of {rows} rows, more than {LARGEST_DENSE}, must be reduced"
        raise scene_error(scene.file, ("reduction",), f"{fault}, as by modes = 10")


def build_flow(scene: Scene) -> FlowMap:
    """The flow map of a scene, as exact as its continuation says, if it has one.

    Raises
    ------
    SceneError
        As `build_system`.
    """
    from nldyn.flow.flow_map import FlowMap, FlowOptions  # check computes nothing

    table = scene.continuation
    return FlowMap(build_system(scene), FlowOptions(table.rtol) if table else None)


def build_parts(scene: Scene) -> dict[str, AnyComponent]:
    """The components of a scene by name, before they are reduced and joined.

    Raises
    ------
    SceneError
        As `build_any`, with the name of the component.
    """
    parts: dict[str, AnyComponent] = {}
    for name, part in scene.component_scenes.items():
        with within_component(scene, name):
            parts[name] = build_any(part)
    return with_areas(scene, parts)


def join(scene: Scene, parts: Mapping[str, AnyComponent] | None = None) -> cms.ReducedModel:
    """Reduce the components of a scene, each by itself, and join them.

    Parameters
    ----------
    scene : Scene
        A scene with ``[components]``.
    parts : mapping, optional
        What `build_parts` gave for this scene, if it is at hand.

    Returns
    -------
    cms.ReducedModel
        Its interfaces are named "component.interface".

    Raises
    ------
    SceneError
        As `build_reduced`, and if the joints leave nothing that moves.
    """
    parts = parts or build_parts(scene)
    models = {}
    for name, part in scene.component_scenes.items():
        with within_component(scene, name):
            models[name] = build_reduced(part, parts[name])
    _tell_of_crossed_joints(scene)
    with told_as(scene, ("joints",), cms.ReductionError):
        whole = cms.couple(models, joints_of(scene))
    for sentence in told_of_areas(scene, whole):
        logger.info(sentence)
    return whole


def joints_of(scene: Scene) -> list[cms.Joint]:
    """The joints of a scene."""
    return [
        cms.Joint(place(joint.at), None if joint.against is None else place(joint.against))
        for joint in scene.joints
    ]


def _tell_of_crossed_joints(scene: Scene) -> None:
    """Warn of joints that make displacements along different axes equal."""
    for joint in scene.joints:
        along = {}
        for end in joint.joined:
            component, name = place(end)
            interface = scene.components[component].interfaces.get(name)
            if interface is not None:
                along[end] = interface.direction
        if len(set(along.values())) > 1:
            (one, axis), (other, across) = along.items()
            warnings.warn(
                f"joint of '{one}', along {axis}, with '{other}', along {across}: they move as one "
                "all the same, which is right only if the meshes have axes of their own",
                stacklevel=2,
            )


def place(interface: str) -> tuple[str, str]:
    """Component and interface that "component.interface" names.

    Examples
    --------
    >>> place("arm.tip")
    ('arm', 'tip')
    """
    component, _, name = interface.partition(".")
    return component, name


def build_candidates(scene: Scene, component: AnyComponent | None = None) -> Candidates:
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
    setting = load_case_of(scene)
    component = component or build_any(scene)
    with told_as(scene, ("reduction",), cms.ReductionError, SystemModelError):
        return candidate_modes(component, setting)


def build_selection(
    scene: Scene,
    component: AnyComponent | None = None,
    progress: Progress | None = None,
) -> ModeSelection:
    """Choose the modes of a scene by the tolerance of its ``[reduction]``.

    Parameters
    ----------
    scene : Scene
        A scene with ``tolerance`` in ``[reduction]``.
    component : optional
        What `build_any` gave for this scene, if it is at hand.
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
    from nldyn.reduction.selection import select_modes  # which loads the compiler

    table = scene.reduction
    assert table is not None and table.tolerance is not None
    setting = load_case_of(scene)
    component = component or build_any(scene)
    faults = (cms.ReductionError, ConvergenceError, SystemModelError)
    with told_as(scene, ("reduction",), *faults):
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
    >>> from nldyn.scene.read import load_scene
    >>> f"{build_system(load_scene(example('one_dof.toml'))).frequencies_hz[0]:.4f}"
    '13.1293'
    """
    system = _relative_system(scene, reduced)
    _check_rides(scene, system)
    system = replace(system, rotations=scene.rotations)
    if scene.observe is None or not scene.observe.absolute:
        return system
    with told_as(scene, ("observe", "absolute"), SystemModelError):
        return system.with_absolute(scene.observe.at, _carried(scene, system, scene.observe.at))


def _check_rides(scene: Scene, system: System) -> None:
    """Refuse stops, springs and dampers of which a moving base carries one end and not the other.

    Displacements are relative to the base, so that their difference is not the distance. Where
    only modes are known, these rides are not; whole matrices are checked by `System`.
    """
    if scene.modal is not None:
        return
    bases = [source for source in system.excitation if isinstance(source, BaseMotion)]
    for table, number, at, against in scene.ties if bases else ():
        some, other = (_carried(scene, system, end) for end in (at, against))
        if carried_apart(bases, some, other):
            told = told_apart(f"{table}[{number}]", at, against)
            raise scene_error(scene.file, (), told, sep=": ")


def _carried(scene: Scene, system: System, interface: str) -> dict[str, float]:
    """How far an interface goes with each moving base, by its load vector."""
    part, at, of = scene, interface, ""
    if scene.components:
        name, at = place(interface)
        part, of = scene.component_scenes[name], f"{name}."
    bases = {source.at for source in system.excitation if isinstance(source, BaseMotion)}
    loads = [base.removeprefix(of) for base in sorted(bases) if base.startswith(of)]
    if part.matrices is None:
        directions = {load: load.removeprefix("base ") for load in loads}
        along = part.interfaces[at].direction
        return {f"{of}{load}": float(axis == along) for load, axis in directions.items()}
    with within_component(scene, of.rstrip(".")):
        component = build_matrices(part)
    return {f"{of}{load}": _follows(component, at, load) for load in loads}


def _follows(component: cms.Matrices, at: str, load: str) -> float:
    """How far an interface moves in the rigid-body motion r of a load vector M r."""
    moved = spsolve(sparse.csc_array(component.mass), component.interfaces[load])
    return float(component.interfaces[at] @ np.atleast_1d(moved))


def _relative_system(scene: Scene, reduced: cms.ReducedModel | None) -> System:
    with told_as(scene, (), SystemModelError):
        acting = acting_elements(scene)
        ratio = scene.damping.modal_ratio
        rayleigh = scene.damping.rayleigh
        if any(rayleigh) and scene.reduction is None and not scene.components:
            fault = "has Rayleigh's damping, which needs a [reduction]"
            raise scene_error(scene.file, ("damping",), fault)
        if scene.modal is not None:
            hz = scene.modal.frequencies_hz
            check_ratio_count(scene, len(hz), scene.file)
            first = _observed_first(scene, scene.modal.participation)
            return System.from_modal(
                hz,
                first,
                modal_damping=ratio,
                loads=scene.modal.loads,
                **acting,
            )
        if scene.matrices is not None and scene.reduction is None:
            return _unreduced(scene, build_matrices(scene), acting)
        reduced = reduced or build_reduced(scene)
        check_ratio_count(scene, len(reduced.frequencies_hz), scene.file)
        projected = _projected_skew(scene, reduced)
        if scene.components:
            check_held(scene, reduced)
        return system_of_reduced(
            reduced,
            scene.observed,
            rayleigh,
            modal_damping=ratio,
            **acting,
            **projected,
        )


def check_held(scene: Scene, reduced: cms.ReducedModel) -> None:
    """Refuse what nothing holds: rigid-body motions that no spring and no stop feels."""
    rigid = reduced.frequencies_hz == 0.0
    ends = [end for stop in (*scene.stops, *scene.round_clearances) for end in stop.ends]
    ends += [(stop.at, stop.against) for stop in area_stops(scene)]
    ends += [(spring.at, spring.against) for spring in scene.interface_springs.values()]
    seen = [_stretch(reduced, *pair) for pair in ends]
    felt = np.array([row[rigid] / np.abs(row).max() for row in seen if row.any()])
    count = np.count_nonzero(rigid)
    loose = count - (np.linalg.matrix_rank(felt, tol=1e-9) if felt.size else 0)
    if loose > 0:
        motions = "motion" if loose == 1 else "motions"
        fault = f"float: {loose} rigid-body {motions} of the whole, which no support, joint, spring"
        raise scene_error(scene.file, ("components",), f"{fault} or stop holds")


def _stretch(reduced: cms.ReducedModel, at: str, against: str | None) -> Real:
    """How each mode moves an interface, as seen from another one or from the ground."""
    moved = reduced.participation[at]
    return moved if against is None else moved - reduced.participation[against]


def _projected_skew(scene: Scene, reduced: cms.ReducedModel) -> dict[str, Any]:
    """The skew matrices of a scene, or of all its components, on the modes of the whole."""
    total: dict[str, Any] = {}
    rows = dict(reduced.components) or {"": (0, reduced.basis.shape[0])}
    parts = scene.component_scenes or {"": scene}
    for component, part in parts.items():
        if part.matrices is None:
            continue
        basis = reduced.basis[slice(*rows[component])]
        with within_component(scene, component):
            for name, A in skew_matrices(part, basis.shape[0]).items():
                total[name] = total.get(name, 0.0) + basis.T @ (A @ basis)
            if part.matrices.spin is not None:
                if "spin" in total:
                    raise scene_error(scene.file, ("matrices", "spin"), "is a second shaft")
                total["spin"] = _spin(part, basis)
    return total


def _spin(scene: Scene, basis: Real) -> Spin:
    """The speed of the shaft, and what goes with it on some modes (n, r)."""
    assert scene.matrices is not None and scene.matrices.spin is not None
    given = skew_matrices(scene, basis.shape[0], "spin")
    return Spin(
        scene.matrices.spin.hz, **{name: basis.T @ (A @ basis) for name, A in given.items()}
    )


def _unreduced(scene: Scene, component: cms.Matrices, acting: Elements) -> System:
    """The system of matrices that are small enough as they are."""
    assert scene.matrices is not None
    rows = component.mass.shape[0]
    _check_small(scene, rows)
    check_ratio_count(scene, rows, scene.file)
    with told_as(scene, ("matrices",), cms.ReductionError):
        check_unreduced(component)
    loads = {name: component.interfaces[name] for name in component.load_vectors}
    interfaces = {name: v for name, v in component.interfaces.items() if name not in loads}
    spin = None if scene.matrices.spin is None else _spin(scene, np.eye(rows))
    with told_as(scene, ("matrices",), SystemModelError):
        return System.from_matrices(
            component.mass,
            component.stiffness,
            _observed_first(scene, interfaces),
            damping=component.damping,
            modal_damping=scene.damping.modal_ratio,
            loads=loads,
            spin=spin,
            **{name: skew.toarray() for name, skew in skew_matrices(scene, rows).items()},
            **acting,
        )


def _observed_first(scene: Scene, interfaces: Mapping[str, Given]) -> dict[str, Given]:
    """Put the observed interface first: orbits report the displacement of the first one."""
    names = sorted(interfaces, key=lambda name: name != scene.observed)
    return {name: interfaces[name] for name in names}
