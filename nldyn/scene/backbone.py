"""The free motions of a scene: its backbones."""

from __future__ import annotations

from typing import TypeVar

from nldyn.base.errors import SystemModelError
from nldyn.branches.step_control import ContinuationOptions
from nldyn.curves.backbone import Backbone, backbone
from nldyn.curves.curves import Curve
from nldyn.curves.resonances import phase_resonance, strength_of
from nldyn.orbits.conditions import driving_source
from nldyn.scene.build import build_reduced, build_system
from nldyn.scene.faults import told_as
from nldyn.scene.schema.connections import DampingTable
from nldyn.scene.schema.contacts import ALONG
from nldyn.scene.schema.scene import Scene
from nldyn.scene.schema.structures import StructureTables
from nldyn.system.parameters import strength

Given = TypeVar("Given", bound=StructureTables)
LONG_STEPS = ContinuationOptions(max_step=0.2)  # along a curve that bends little
RUBBING = {"friction", "tangential_stiffness", *ALONG}  # keys of an area
BEGIN = 1e-3  # smallest amplitude, relative to the largest


def undamped(scene: Scene) -> Scene:
    """The scene without its damping and without what swings; mean loads stay.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> free = undamped(load_scene(example("one_dof.toml")))
    >>> free.damping.modal_ratio, free.excitation, len(free.stops)
    (0.0, [], 1)
    """
    changed: dict[str, object] = {
        "damping": DampingTable(),
        "dampers": [],
        "friction": [],
        "contact_areas": [
            table.model_copy(update=dict.fromkeys(RUBBING & type(table).model_fields.keys()))
            for table in scene.contact_areas
        ],
        "round_clearances": [
            table.model_copy(update={"friction": 0.0}) for table in scene.round_clearances
        ],
        "excitation": [e for e in scene.excitation if e.kind in ("constant", "weight")],
    }
    if scene.observe is not None:
        changed["observe"] = scene.observe.model_copy(update={"absolute": False})
    changed["components"] = {name: _without_damping(c) for name, c in scene.components.items()}
    return _without_damping(scene).model_copy(update=changed)


def _without_damping(tables: Given) -> Given:
    """A structure without the damping matrix that may come with its others."""
    if tables.matrices is None:
        return tables
    return tables.model_copy(
        update={"matrices": tables.matrices.model_copy(update={"damping": None})}
    )


def phase_resonance_of(scene: Scene, found: Backbone) -> Curve:
    """The forced motions of a scene in phase resonance beside its backbone.

    From a thousandth of the scene's own strength of excitation to that strength.

    Raises
    ------
    SceneError
        For what `phase_resonance` refuses, and if no free motion of the backbone needs a strength
        within this range.
    ConvergenceError
        As `phase_resonance`.
    """
    system = build_system(scene)
    with told_as(scene, (), SystemModelError):
        source, _ = driving_source(system)
        most = strength(source)
        least = 1e-3 * most
        need = (strength_of(system, orbit) for orbit in found.orbits)
        beside = [o for o, s in zip(found.orbits, need, strict=True) if 1.2 * least < s < most]
        if not beside:
            raise SystemModelError(
                f"excitation of strength {most:g} drives no free motion of the backbone against "
                "the damping: follow it to other amplitudes"
            )
        hz = found.frequency_hz
        range_hz = 0.5 * float(hz.min()), 2.0 * float(hz.max())
        return phase_resonance(system, beside[0], (least, most), range_hz, options=LONG_STEPS)


def backbone_of(scene: Scene, amplitude_m: float, mode: int = 1) -> Backbone:
    """Follow the free motions of a scene from a linear mode up to an amplitude, see `backbone`.

    Parameters
    ----------
    scene : Scene
        Its damping and its swinging excitation are left out.
    amplitude_m : float
        Largest displacement in m at the observed interface, where the family ends; it begins at a
        thousandth of it.
    mode : int
        Mode of the small vibrations about the rest position, counted from 1.

    Raises
    ------
    SceneError
        As `build_system`, and for what `backbone` refuses, as stops that lose energy.
    ConvergenceError
        As `backbone`.
    """
    free = undamped(scene)
    if scene.reduction is not None and scene.reduction.tolerance is not None:
        reduced = build_reduced(scene)  # as 'nldyn run' chooses them: by the damped response
    else:
        reduced = None
    system = build_system(free, reduced)
    with told_as(scene, (), SystemModelError):
        return backbone(system, mode, amplitude_m=(BEGIN * amplitude_m, amplitude_m))
