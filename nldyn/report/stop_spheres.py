"""The stops of a scene as spheres to be drawn."""

from __future__ import annotations

from fem.render import StopSphere
from nldyn.scene.build import place
from nldyn.scene.followed import followed_parameter
from nldyn.scene.schema.scene import Scene
from nldyn.system.naming import is_angle
from nldyn.system.parameters import Parameter

AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def side(scene: Scene, name: str) -> tuple[Scene, str, str]:
    """The scene of the component that has an interface, its point as drawn, and its direction.

    Point and direction are empty where the component has no mesh.
    """
    part, of = scene, ""
    if scene.components:
        component, name = place(name)
        part, of = scene.component_scenes[component], f"{component}."
    interface = part.interfaces.get(name) if part.mesh is not None else None
    if interface is None:
        return part, "", ""
    return part, of + interface.at, interface.direction


def why_not_drawn(scene: Scene, index: int) -> str:
    """Why a stop cannot be drawn; empty where it can."""
    if followed_parameter(scene) == Parameter("gap", index):
        return "has a gap that changes from orbit to orbit"
    stop = scene.stops[index]
    sides = [side(scene, name) for name in (stop.at, stop.against) if name is not None]
    directions = [direction for _, _, direction in sides]
    if any(map(is_angle, directions)):
        return "acts on a rotation"
    if not all(directions):
        return "has no mesh at one side" if any(directions) else "has no mesh"
    return "acts along two axes" if len(set(directions)) > 1 else ""


def stop_sphere(scene: Scene, index: int) -> StopSphere | None:
    """Give a stop as a sphere to be drawn, if it can be."""
    if why_not_drawn(scene, index):
        return None
    stop = scene.stops[index]
    part, point, direction = side(scene, stop.at)
    against = None if stop.against is None else side(scene, stop.against)[1]
    way = tuple(stop.direction * along for along in AXES[direction])
    if part.mesh is None or part.mesh.model == "frame":
        way = way[:2]
    return StopSphere(point, getattr(stop, "radius", None), way, stop.gap, against)


def stops_to_draw(scene: Scene) -> list[StopSphere]:
    """All stops that can be drawn: those of meshes that act along an axis."""
    spheres = (stop_sphere(scene, index) for index in range(len(scene.stops)))
    return [sphere for sphere in spheres if sphere is not None]


def not_drawn(scene: Scene) -> list[str]:
    """Which stops cannot be drawn, each with the reason."""
    flat = [
        f"stop at '{stop.at}'{f' against {stop.against!r}' if stop.against else ''}, which {why}"
        for index, stop in enumerate(scene.stops)
        if (why := why_not_drawn(scene, index))
    ]
    return (
        flat
        + [
            f"round clearance at '{table.plane[0]}' and '{table.plane[1]}', which is all around"
            for table in scene.round_clearances
        ]
        + [f"contact area '{table.called}', which is many points" for table in scene.contact_areas]
    )


def with_stops_not_drawn(title: str, scene: Scene) -> str:
    """A title that also says which stops are missing in the picture, and why.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> with_stops_not_drawn("deepest contact", load_scene(example("two_dof_xi_0.01.toml")))
    'deepest contact'
    """
    missing = not_drawn(scene)
    if not missing:
        return title
    more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
    return f"{title}; not drawn: {missing[0]}{more}"
