"""The load case of a scene."""

from __future__ import annotations

from typing import Any

from nldyn.base.errors import SystemModelError
from nldyn.reduction.load_case import LoadCase
from nldyn.scene.checks import check_computable
from nldyn.scene.faults import told_as
from nldyn.scene.followed import KEY, followed_parameter
from nldyn.scene.messages import scene_error
from nldyn.scene.schema.scene import Scene
from nldyn.scene.stops_and_loads import acting_elements


def load_case_of(scene: Scene) -> LoadCase:
    """The load case of a scene.

    Raises
    ------
    SceneError
        If the scene has no reduction, nothing to compute, or damping ratios for a certain number of
        modes.
    """
    check_computable(scene, scene.file)
    if scene.components:
        if all(part.reduction is None for part in scene.components.values()):
            fault = "are not reduced: none has a [components.NAME.reduction]"
            raise scene_error(scene.file, ("components",), fault)
    elif scene.reduction is None:
        raise scene_error(scene.file, ("reduction",), "is missing: nothing is reduced")
    if scene.observe is not None and scene.observe.absolute:
        fault = "is not told where the modes are chosen or compared: leave it out there"
        raise scene_error(scene.file, ("observe", "absolute"), fault)
    if isinstance(scene.damping.modal_ratio, list):
        fault = "must be one number where the number of modes is open"
        raise scene_error(scene.file, ("damping", "modal_ratio"), fault)
    table = scene.continuation
    assert table is not None
    acting: dict[str, Any] = {**acting_elements(scene)}
    with told_as(scene, KEY if table.parameter else (), SystemModelError):
        return LoadCase(
            table.limits,
            parameter=followed_parameter(scene) if table.parameter else None,
            frequency_hz=table.frequency_hz,
            **acting,
            modal_damping=scene.damping.modal_ratio,
            observe=scene.observed,
            rayleigh=scene.damping.rayleigh,
            rotations=scene.rotations,
        )
