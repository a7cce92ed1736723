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
