"""The stops around what is drawn: on the ground, or carried by a point that moves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.render.scenery import StopSphere, direction_of, mark_of, reach
from fem.render.several import SeveralSurfaces, Surface
from fem.render.structure_surface import StructureSurface

SINKING = 0.5
"""Part of its radius by which a stop sinks in at most, where the deflection is exaggerated."""


@dataclass(frozen=True, eq=False)
class StopBody:
    """A piece of a stop as it is drawn.

    Parameters
    ----------
    solid
        What is drawn.
    carrier
        The point of the mesh with which it moves; None on the ground.
    """

    solid: Any
    carrier: str | None = None

    def moved(self, drawing: Surface, u: FloatArray, scale: float) -> FloatArray | None:
        """How far it is shifted, (3,), in m; None on the ground."""
        return None if self.carrier is None else scale * point_move(drawing, u, self.carrier)


def stop_bodies(drawing: Surface, stop: StopSphere, scale: float) -> list[StopBody]:
    """The sphere at the surface plus ``scale`` times the gap, and what holds it.

    On the ground that is a post on a plate. Between two points it is a rod from the point that
    carries the sphere, and a disc marks where the sphere touches.
    """
    part, point = owner(drawing, stop.point)
    start, towards = touched(part, point, stop)
    radius = drawn_radius(drawing, stop)
    centre = start + (scale * stop.gap + radius) * towards
    if stop.against is not None:
        end = np.asarray(place_of(*owner(drawing, stop.against)))
        return [
            StopBody(sphere(centre, radius), stop.against),
            *(StopBody(rod, stop.against) for rod in rods(centre, end, 0.35 * radius)),
            StopBody(plate(start, towards, 0.8 * radius, 0.2 * radius), stop.point),
        ]
    mark = mark_of(part)
    post, width = max(1.6 * mark, 4.0 * radius), max(1.1 * mark, 3.0 * radius)
    foot = centre + post * towards
    return [
        StopBody(sphere(centre, radius)),
        *(StopBody(rod) for rod in rods(centre, foot, 0.55 * radius)),
        StopBody(plate(foot + 0.15 * width * towards, towards, width, 0.3 * width)),
    ]


def owner(drawing: Surface, name: str) -> tuple[StructureSurface, str]:
    """The surface on which a point lies, and what it is called there.

    Raises
    ------
    ModelError
        If there is no such component.
    """
    if not isinstance(drawing, SeveralSurfaces):
        return drawing, name
    part, _, point = name.partition(".")
    if part not in drawing.parts:
        raise ModelError(f"stop at {name!r}: there is no component {part!r}")
    return drawing.parts[part], point


def place_of(part: StructureSurface, point: str) -> FloatArray:
    """Where a point of the mesh lies, (3,), in m."""
    mesh = part.component.model.mesh
    return np.asarray(mesh.points[mesh.node(point)], dtype=np.float64)


def touched(part: StructureSurface, point: str, stop: StopSphere) -> tuple[FloatArray, FloatArray]:
    """Where the undeformed surface is touched, (3,) in m, and the unit vector (3,) to the stop."""
    towards, node = direction_of(stop), part.component.model.mesh.node(point)
    return place_of(part, point) + reach(part, node, towards) * towards, towards


def point_move(drawing: Surface, u: FloatArray, name: str) -> FloatArray:
    """Translation (3,) of a point of the mesh in m."""
    part, point = owner(drawing, name)
    pieces = drawing.component.pieces(u) if isinstance(drawing, SeveralSurfaces) else {}
    own = pieces[name.partition(".")[0]] if pieces else u
    return part.component.shape(own)[part.component.model.mesh.node(point), :3]


def penetration(drawing: Surface, u: FloatArray, stop: StopSphere) -> float:
    """How far a stop is sunk in, in m; negative where it is open."""
    return closing(drawing, u, stop) - stop.gap


def closing(drawing: Surface, u: FloatArray, stop: StopSphere) -> float:
    """By how much a displacement closes the gap of a stop, in m."""
    move = point_move(drawing, u, stop.point)
    if stop.against is not None:
        move = move - point_move(drawing, u, stop.against)
    return float(direction_of(stop) @ move)


def largest_scale(drawing: Surface, states: FloatArray, stops: Sequence[StopSphere]) -> float:
    """The factor on the deflection at which no stop sinks in by more than `SINKING` of its radius.

    Without contact it is infinite.
    """
    return min(
        (
            SINKING * drawn_radius(drawing, stop) / depth
            for stop in stops
            if (depth := max(penetration(drawing, u, stop) for u in states)) > 0.0
        ),
        default=math.inf,
    )


def drawn_radius(drawing: Surface, stop: StopSphere) -> float:
    """Radius in m with which a stop is drawn: its own, or half of a mark."""
    return stop.radius or 0.5 * mark_of(owner(drawing, stop.point)[0])


def sphere(centre: FloatArray, radius: float) -> Any:
    """A sphere."""
    import pyvista

    return pyvista.Sphere(radius=radius, center=centre, theta_resolution=32, phi_resolution=32)


def rods(begin: FloatArray, end: FloatArray, radius: float) -> list[Any]:
    """A round rod between two places (3,), or none where they are one."""
    import pyvista

    length = float(np.linalg.norm(end - begin))
    if length < radius:
        return []
    return [
        pyvista.Cylinder(
            center=(begin + end) / 2, direction=end - begin, radius=radius, height=length,
            resolution=32,
        )
    ]  # fmt: skip


def plate(centre: FloatArray, axis: FloatArray, radius: float, thickness: float) -> Any:
    """A round plate across an axis."""
    import pyvista

    return pyvista.Cylinder(
        center=centre, direction=axis, radius=radius, height=thickness, resolution=32
    )
