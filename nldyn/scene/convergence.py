"""Convergence studies of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import cms
from nldyn.base.errors import ConvergenceError, SystemModelError, check_choice
from nldyn.reduction.convergence import METHODS, Component, ConvergenceStudy, convergence_study
from nldyn.reduction.studied import JoinedComponents
from nldyn.scene.build import AnyComponent, build_reduced, check_held, join, joints_of
from nldyn.scene.component import build_component
from nldyn.scene.contact import check_one_mesh, with_areas
from nldyn.scene.faults import within_component
from nldyn.scene.load_case import load_case_of
from nldyn.scene.matrices import build_matrices
from nldyn.scene.messages import scene_error

if TYPE_CHECKING:
    from nldyn.runtime.progress import Progress
    from nldyn.scene.schema.scene import Scene


def convergence_study_of(
    scene: Scene,
    *,
    modes: Sequence[int] | None = None,
    methods: Sequence[str] = ("rubin",),
    refinements: Sequence[int] = (1,),
    meshes: Sequence[str] = (),
    components: Sequence[str] = (),
    at: float | None = None,
    full: bool = False,
    progress: Progress | None = None,
    jobs: int = 1,
) -> ConvergenceStudy:
    """The convergence study of a scene, see `convergence_study`.

    Parameters
    ----------
    scene : Scene
        Its ``[reduction]`` is not used; nor are those of its components, if it has several.
    modes, methods, at, full, progress, jobs
        As for `convergence_study`.
    refinements : sequence of int
        Meshes: every line is cut into so many.
    meshes : sequence of str
        Mesh files to compare instead of the scene's, from coarse to fine, as ``file`` in
        ``[mesh]``.
    components : sequence of str
        Of several components those whose modes are varied, while the others are as in the scene;
        by default all that the scene reduces.

    Raises
    ------
    SceneError
        As `build_component` and `build_matrices`, and if a model cannot be made or no branch is
        found.
    SystemModelError
        For options that make no sense together, or for this scene.
    """
    setting = load_case_of(scene)
    _check_no_skew(scene)
    if min(refinements) < 1:
        raise SystemModelError("converge: a refinement must be 1 or more")
    for method in methods:
        check_choice("converge: each method", method, METHODS)
    if max(refinements) > 1 and scene.matrices is not None:
        raise SystemModelError("converge: refinements cut meshes; this scene has matrices")
    if components and not scene.components:
        raise SystemModelError("converge: components are for a scene that joins several")
    for name in components:
        check_choice("converge: each component", name, scene.components)
    studied: dict[str, Component]
    if meshes:
        if tuple(refinements) != (1,):
            raise SystemModelError("converge: give either refinements or meshes")
        if scene.mesh is None:
            raise SystemModelError("converge: meshes are for a scene of one component with a mesh")
        check_one_mesh(scene)
        studied = {file: build_component(with_mesh(scene, file)) for file in meshes}
    else:
        studied = {
            "" if len(refinements) == 1 else f"x{times}": _studied(scene, times, components)
            for times in sorted(refinements)
        }
    try:
        return convergence_study(
            studied,
            setting,
            modes=modes,
            methods=methods,
            at=at,
            full=full,
            progress=progress,
            jobs=jobs,
        )
    except (cms.ReductionError, ConvergenceError) as error:
        key = "components" if scene.components else "reduction"
        raise scene_error(scene.file, (key,), str(error), sep=": ") from None


def _studied(scene: Scene, refinement: int, chosen: Sequence[str]) -> Component:
    """The component of a scene, or all of them, with those that are chosen to be reduced."""
    if not scene.components:
        return _component(scene, refinement)
    parts: dict[str, AnyComponent] = {}
    for name, part in scene.component_scenes.items():
        with within_component(scene, name):
            parts[name] = _component(part, refinement)
    if refinement > 1:
        check_one_mesh(scene)
    parts = with_areas(scene, parts)
    check_held(scene, join(scene, parts))
    reduced = {name: part for name, part in scene.component_scenes.items() if part.reduction}
    varied = {name: each for name, each in parts.items() if name in (chosen or reduced)}
    kept = {
        name: build_reduced(part, parts[name])
        for name, part in scene.component_scenes.items()
        if name not in varied
    }
    return JoinedComponents(varied, joints_of(scene), kept)


def _component(scene: Scene, refinement: int) -> AnyComponent:
    """The mesh of a scene, its lines cut into so many, or its matrices, which cannot be cut."""
    if scene.matrices is not None:
        return build_matrices(scene)
    return build_component(scene, refinement)


def _check_no_skew(scene: Scene) -> None:
    """Refuse matrices that couple what the others do not: a load case knows nothing of them."""
    parts = [(("components", name), part) for name, part in scene.component_scenes.items()]
    for above, part in [((), scene), *parts]:
        for key in part.matrices.skew if part.matrices else ():
            fault = "couples the modes, which a convergence study does not know: leave it out"
            raise scene_error(scene.file, (*above, "matrices", key), fault)


def with_mesh(scene: Scene, file: str) -> Scene:
    """The scene with another mesh file."""
    assert scene.mesh is not None
    return scene.model_copy(update={"mesh": scene.mesh.model_copy(update={"file": file})})
