"""What the continuation of a scene changes: the frequency, or the number of another key."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nldyn.base.errors import SceneError, SystemModelError
from nldyn.scene.faults import told_as
from nldyn.scene.messages import KeyPath, scene_error, unknown_name
from nldyn.scene.schema.scene import STEADY, Scene
from nldyn.scene.stops_and_loads import slider_of, sources_before
from nldyn.system.chart import EVERY_MODE, SPEED, SPIN, THE_FREQUENCY
from nldyn.system.parameters import OF_STOPS, SHARED, SOURCES, Parameter
from nldyn.system.system import System

if TYPE_CHECKING:
    from nldyn.orbits.axis import Axis

KEY: KeyPath = ("continuation", "parameter")
OF_LISTS = {  # the keys of each list of tables that may change
    "stops": OF_STOPS,
    "excitation": SOURCES,
    "dampers": ("coefficient",),
    "friction": ("coefficient", "normal_force", "tangential_stiffness", "base_speed"),
    "round_clearances": (
        *SHARED, "restitution", "clearance", "friction", "surface_speed", "eccentricity",
    ),
    "contact_areas": ("gap", "stiffness", "friction"),
    "springs": ("stiffness", "coefficients"),
}  # fmt: skip
SHORT = {
    **{name: f"stops.0.{name}" for name in OF_STOPS},
    "damping": "damping.modal_ratio",
    "spin": "matrices.spin.hz",
}
SPEEDS = {"matrices.spin.hz": SPIN, "speed": SPEED}


def axis_of(scene: Scene, system: System) -> Axis:
    """What a scene's branches are followed over.

    Raises
    ------
    SceneError
        If there is no continuation, the system has no such number, or it cannot have these values.
    """
    from nldyn.orbits.axis import Axis  # check computes nothing

    table = scene.continuation
    if table is None:
        fault = "is missing: it says over which parameter and range"
        raise scene_error(scene.file, ("continuation",), fault)
    parameter = followed_parameter(scene)
    key = KEY if table.parameter else ("continuation",)
    with told_as(scene, key, SystemModelError):
        return Axis.of(system, table.limits, parameter, table.frequency_hz)


def followed_parameter(scene: Scene) -> Parameter:
    """The parameter of a system that the key named in the scene is.

    Raises
    ------
    SceneError
        If there is no such key, or it is not one that may change.
    """
    table = scene.continuation
    if table is None or table.parameter is None:
        return THE_FREQUENCY
    name = SHORT.get(table.parameter, table.parameter)
    if name == "force":
        name = _force(scene)
    if name in SPEEDS:
        return Parameter(SPEEDS[name])
    kind, *rest = name.split(".")
    if kind == "damping" and rest[:1] == ["modal_ratio"] and len(rest) <= 2:
        mode = _number(scene, rest[1], "mode", None) if rest[1:] else EVERY_MODE
        return Parameter("modal_damping", mode)
    if kind not in OF_LISTS or len(rest) < 2:
        known = ["force", *SHORT, *SPEEDS, "excitation.0.amplitude"]
        raise _refused(scene, unknown_name(table.parameter, known, "a key that may change"))
    number = _number(scene, rest[0], kind, len(getattr(scene, kind)))
    listed = rest[1] in ("coefficients", "eccentricity")
    if rest[1] not in OF_LISTS[kind] or len(rest) > 2 + listed:
        refused = f"a key of {kind}.{number} that may change"
        raise _refused(scene, unknown_name(".".join(rest[1:]), OF_LISTS[kind], refused))
    return _of_element(scene, kind, number, rest[1:])


def _of_element(scene: Scene, kind: str, number: int, key: list[str]) -> Parameter:
    """The parameter that is the key of a table of a list."""
    table = getattr(scene, kind)[number]
    name = f"{kind}.{number}.{key[0]}"
    if kind == "dampers" and table.law != "linear":
        raise _refused(scene, f"names '{name}', but only that of a linear damper may change")
    if kind == "friction":
        if getattr(table, key[0]) is None:
            why = "no spring is before that"
            if key[0] == "normal_force":
                why = "a stop presses that on"
            raise _refused(scene, f"names '{name}', but {why}")
        return Parameter(
            "friction" if key[0] == "coefficient" else key[0], slider_of(scene, number)
        )
    if kind == "round_clearances":
        if key[0] == "eccentricity":
            place = _number(scene, key[1] if key[1:] else "", f"{name}, a list,", 2)
            key = [("first_eccentricity", "second_eccentricity")[place]]
        own = "rubbing_friction" if key[0] == "friction" else key[0]
        return Parameter(own, len(scene.stops) + number)
    if kind == "contact_areas":
        return Parameter(f"area_{key[0]}", number)
    if kind == "excitation":
        if getattr(table, key[0], None) is None or table.kind == "base":
            fault = f"names '{name}', which one of kind '{table.kind}' has not, or must keep"
            raise _refused(scene, fault)
        return Parameter(key[0], sources_before(scene, number))
    if kind != "springs":
        return Parameter(key[0], number)
    if number not in scene.interface_springs:
        raise _refused(scene, f"names '{name}', but that spring is part of the mesh")
    index = list(scene.interface_springs).index(number)
    if key[0] == "stiffness":
        return Parameter("spring_stiffness", index)
    place = _number(scene, key[1] if key[1:] else "", f"{name}, a list,", None)
    return Parameter(f"k{place + 1}", index)


def _force(scene: Scene) -> str:
    """The key with the strength of the only load that moves the structure."""
    shaking = [n for n, each in enumerate(scene.excitation) if each.kind not in STEADY]
    if len(shaking) != 1:
        fault = f"is 'force', but {len(shaking)} loads move the structure; name one, such as "
        raise _refused(scene, f"{fault}'excitation.0.amplitude'")
    unbalance = scene.excitation[shaking[0]].kind == "unbalance"
    return f"excitation.{shaking[0]}.{'mass_times_radius' if unbalance else 'amplitude'}"


def _number(scene: Scene, text: str, what: str, count: int | None) -> int:
    """The number of a table of a list, counted from 0."""
    if not text.isdecimal() or (count is not None and int(text) >= count):
        of = "" if count is None else f"; there are {count}" if count else "; there are none"
        raise _refused(scene, f"needs a number in {what}, counted from 0, not '{text[:20]}'{of}")
    return int(text)


def _refused(scene: Scene, fault: str) -> SceneError:
    return scene_error(scene.file, KEY, fault)
