"""The stops of a scene as spheres to be drawn."""

from __future__ import annotations

from fem.render import StopSphere
from nldyn.scene.build import place
from nldyn.scene.schema import Scene


def stop_sphere(scene: Scene, index: int) -> StopSphere | None:
    """Give a stop as a sphere to be drawn, if it stands on the ground and acts along an axis."""
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    stop = scene.stops[index]
    if stop.against is not None:
        return None
    part, name, of = scene, stop.at, ""
    if scene.components:
        component, name = place(stop.at)
        part, of = scene.component_scenes[component], f"{component}."
    interface = part.interfaces.get(name)
    if interface is None or interface.direction not in axes:
        return None
    way = tuple(stop.direction * along for along in axes[interface.direction])
    if part.mesh is None or part.mesh.model == "frame":
        way = way[:2]
    return StopSphere(of + interface.at, stop.radius, way, stop.gap)


def stops_to_draw(scene: Scene) -> list[StopSphere]:
    """All stops that can be drawn: those on the ground that act along an axis."""
    spheres = (stop_sphere(scene, index) for index in range(len(scene.stops)))
    return [sphere for sphere in spheres if sphere is not None]


def not_drawn(scene: Scene) -> list[str]:
    """Which stops cannot be drawn, each with the reason."""
    return [
        f"stop at '{stop.at}' "
        + (f"against '{stop.against}', between two interfaces" if stop.against else "of a rotation")
        for index, stop in enumerate(scene.stops)
        if stop_sphere(scene, index) is None
    ]


def with_stops_not_drawn(title: str, scene: Scene) -> str:
    """A title that also says how many stops are missing in the picture.

    Examples
    --------
    >>> from nldyn.base.resources import example
    >>> from nldyn.scene.read import load_scene
    >>> with_stops_not_drawn("deepest contact", load_scene(example("two_dof_xi_0.01.toml")))
    'deepest contact'
    """
    missing = len(not_drawn(scene))
    if not missing:
        return title
    return f"{title}; not drawn: {missing} of {len(scene.stops)} stops"
