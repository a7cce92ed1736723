"""Convergence studies of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import cms
from nldyn.base.errors import ConvergenceError, SystemModelError, check_choice
from nldyn.reduction.convergence import METHODS, ConvergenceStudy, convergence_study
from nldyn.scene.component import build_component
from nldyn.scene.load_case import load_case_of
from nldyn.scene.messages import scene_error

if TYPE_CHECKING:
    import cms
    from nldyn.runtime.progress import Progress
    from nldyn.scene.schema import Scene


def convergence_study_of(
    scene: Scene,
    *,
    modes: Sequence[int] | None = None,
    methods: Sequence[str] = ("rubin",),
    refinements: Sequence[int] = (1,),
    meshes: Sequence[str] = (),
    at_hz: float | None = None,
    full: bool = False,
    progress: Progress | None = None,
    jobs: int = 1,
) -> ConvergenceStudy:
    """The convergence study of a scene with a mesh, see `convergence_study`.

    Parameters
    ----------
    scene : Scene
        Its ``[reduction]`` is not used.
    modes, methods, at_hz, full, progress, jobs
        As for `convergence_study`.
    refinements : sequence of int
        Meshes: every line is cut into so many.
    meshes : sequence of str
        Mesh files to compare instead of the scene's, from coarse to fine, as ``file`` in
        ``[mesh]``.

    Raises
    ------
    SceneError
        As `build_component`, and if a model cannot be made or no branch is found.
    """
    if scene.components:
        fault = "cannot be compared by 'nldyn converge'; a study can vary"
        wanted = f"{fault} 'components.NAME.reduction.modes'"
        raise scene_error(scene.file, ("components",), wanted)
    setting = load_case_of(scene)
    if min(refinements) < 1:
        raise SystemModelError("converge: a refinement must be 1 or more")
    for method in methods:
        check_choice("converge: each method", method, METHODS)
    if meshes:
        if tuple(refinements) != (1,):
            raise SystemModelError("converge: give either refinements or meshes")
        components = {file: build_component(with_mesh(scene, file)) for file in meshes}
    else:
        components = {
            "" if len(refinements) == 1 else f"x{times}": build_component(scene, times)
            for times in sorted(refinements)
        }
    try:
        return convergence_study(
            components,
            setting,
            modes=modes,
            methods=methods,
            at_hz=at_hz,
            full=full,
            progress=progress,
            jobs=jobs,
        )
    except (cms.ReductionError, ConvergenceError) as error:
        raise scene_error(scene.file, ("reduction",), str(error), sep=": ") from None


def with_mesh(scene: Scene, file: str) -> Scene:
    """The scene with another mesh file."""
    if scene.mesh is None:
        return scene
    return scene.model_copy(update={"mesh": scene.mesh.model_copy(update={"file": file})})
