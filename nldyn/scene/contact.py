"""Areas of contact of a scene: their points in the mesh, their gaps and their stops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import cms
import fem
from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError
from nldyn.scene.faults import told_as
from nldyn.scene.messages import scene_error
from nldyn.scene.schema.contacts import (
    ContactAreaTable,
    ListedAreaTable,
    MeshAreaTable,
    exponent_of,
)
from nldyn.scene.schema.scene import Scene
from nldyn.system.contact_area import contact_area, gap_beside
from nldyn.system.stop import Stop

SIDES = ("", " against", " along", " along against")


@dataclass(frozen=True)
class Found:
    """The points of an area of contact, as interfaces.

    Parameters
    ----------
    sides : four lists of str or None
        Interfaces of the points along the normal, of those on the other side, and of both along the
        surface.
    weights : (k,) or None
        What the points stand for.
    gaps : (k,) or float
        In m.
    places : (k, 3) or None
        Where the points are in the mesh, in m.
    held : int
        How many more points supports hold.
    measure : {"area", "length", "node"}, optional
        What the weights are: m², m, or nothing.
    """

    sides: Sequence[Sequence[str] | None]
    weights: Real | None
    gaps: Real | float
    places: Real | None = None
    held: int = 0
    measure: str | None = None


def with_areas(scene: Scene, component: fem.Component) -> fem.Component:
    """The component with the interfaces of the areas of contact of its scene.

    Raises
    ------
    SceneError
        If the mesh has no such set, or it is none that can touch.
    """
    found: list[Found] = []
    for number, table in enumerate(scene.contact_areas):
        key = ("contact_areas", number)
        if isinstance(table, ListedAreaTable):
            found.append(_listed(table))
            continue
        with told_as(scene, key, fem.ModelError, cms.ReductionError, SystemModelError):
            one, vectors = _placed(component, table)
            component = component.with_interfaces(vectors, _attached(table, one))
        found.append(one)
    scene._areas_found = tuple(scene.contact_areas), tuple(found)
    return component


def check_one_mesh(scene: Scene) -> None:
    """Refuse to take another mesh where points of contact go with that of the scene."""
    if any(isinstance(table, MeshAreaTable) for table in scene.contact_areas):
        fault = "go with the mesh: compare modes or methods, not meshes"
        raise scene_error(scene.file, ("contact_areas",), fault)


def _names(table: ContactAreaTable) -> tuple[str, str]:
    """What the reduction calls an area, and the one on the other side."""
    return table.called, f"{table.called} against"


def _attached(table: MeshAreaTable, one: Found) -> dict[str, cms.Area]:
    """The areas, on both sides if both move, that the reduction gives attachment modes to."""
    assert one.weights is not None
    stiffness = table.stiffness * one.weights
    return {
        name: cms.Area(tuple(points), stiffness, table.attachment_modes, table.static_error)
        for name, points in zip(_names(table), one.sides[:2], strict=True)
        if points is not None
    }


def _listed(table: ListedAreaTable) -> Found:
    weights = None if table.weights is None else np.array(table.weights)
    sides = (table.at, table.against, table.along, table.along_against)
    return Found(sides, weights, _as_gaps(table.gap))


def _as_gaps(gap: float | list[float]) -> Real | float:
    return np.array(gap) if isinstance(gap, list) else gap


def _placed(component: fem.Component, table: MeshAreaTable) -> tuple[Found, dict[str, Real]]:
    """The points of an area of a mesh, and the load vectors of their interfaces."""
    points = fem.contact_points(
        component, table.at, table.direction, points=table.points, surface=table.surface
    )
    vectors = [points.vectors(), None, None, None]
    along = None if table.along is None else _axis(table.along)
    if along is not None:
        vectors[2] = points.vectors(along)
    if table.against is not None:
        other = fem.opposite_points(component, points, table.against, surface=table.surface_against)
        vectors[1] = other.vectors()
        if along is not None:
            vectors[3] = other.vectors(along)
    count = len(points.places)
    sides = [
        None if rows is None else [f"{table.called} {i + 1}{side}" for i in range(count)]
        for rows, side in zip(vectors, SIDES, strict=True)
    ]
    named = {
        name: row
        for names, rows in zip(sides, vectors, strict=True)
        if names is not None and rows is not None
        for name, row in zip(names, rows, strict=True)
    }
    gaps = _gaps(table, points.places)
    found = Found(sides, points.weights, gaps, points.places, points.held, points.measure)
    return found, named


def _axis(given: str | Sequence[float]) -> str | list[float]:
    return given if isinstance(given, str) else [float(each) for each in given]


def _gaps(table: MeshAreaTable, places: Real) -> Real:
    """The gap at each point (k,)."""
    if isinstance(table.gap, list) and len(table.gap) != len(places):
        raise SystemModelError(
            f"gap has {len(table.gap)} values, but the area has {len(places)} points"
        )
    centre = places.mean(axis=0) if table.centre is None else np.array(table.centre)
    axis = None if table.axis is None else fem.unit_vector(table.called, _axis(table.axis))
    normal = fem.unit_vector(table.called, _axis(table.direction))
    beside = gap_beside(places, normal, centre, slope=table.slope, radius=table.radius, axis=axis)
    return np.asarray(_as_gaps(table.gap)) + beside


def areas_found(scene: Scene) -> tuple[Found, ...]:
    """The points of all areas of a scene; its mesh is assembled unless that was done already."""
    listed = [_listed(table) for table in scene.contact_areas if isinstance(table, ListedAreaTable)]
    if len(listed) == len(scene.contact_areas):
        return tuple(listed)
    if scene._areas_found is None or scene._areas_found[0] != tuple(scene.contact_areas):
        from nldyn.scene.component import build_component  # which calls `with_areas`

        build_component(scene)
    found: tuple[Found, ...] = scene._areas_found[1]
    return found


def told_of_areas(scene: Scene, reduced: cms.ReducedModel) -> list[str]:
    """What each area of a mesh is, and what the reduction gave to it, a sentence each."""
    sentences = []
    for table, found in zip(scene.contact_areas, areas_found(scene), strict=True):
        if not isinstance(table, MeshAreaTable) or found.places is None or found.weights is None:
            continue
        held = f" ({found.held} more are held by supports)" if found.held else ""
        unit = {"area": "m²", "length": "m"}.get(found.measure or "")
        of = f" that stand for {found.weights.sum():.4g} {unit}" if unit else ""
        text = f"contact area '{table.called}': {len(found.places)} points{of}{held}"
        for name, side in zip(_names(table), ("", " on the other side"), strict=True):
            if name in reduced.areas:
                given = reduced.areas[name]
                text += (
                    f"; {given.modes} attachment modes{side}, static error {given.static_error:.2g}"
                )
        sentences.append(text)
    return sentences


def area_stops(scene: Scene) -> tuple[Stop, ...]:
    """The stops of all areas of contact of a scene."""
    stops: list[Stop] = []
    names: set[str] = set()
    tables = zip(scene.contact_areas, areas_found(scene), strict=True)
    for number, (table, found) in enumerate(tables):
        if table.called in names:
            fault = f"has the name '{table.called}' of another one: give it a 'name' of its own"
            raise scene_error(scene.file, ("contact_areas", number), fault)
        names.add(table.called)
        points, against, tangents, beside = found.sides
        assert points is not None
        with told_as(scene, ("contact_areas", number), SystemModelError):
            stops += contact_area(
                table.called,
                points,
                table.stiffness,
                weights=found.weights,
                exponent=exponent_of(table),
                gap=found.gaps,
                direction=getattr(table, "closes", 1),
                against=against,
                dissipation=table.dissipation,
                dashpot=table.dashpot,
                pulls=table.pulls or not table.dashpot,
                friction=table.friction,
                tangents=tangents,
                tangents_against=beside,
            )
    return tuple(stops)
