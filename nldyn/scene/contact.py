"""Areas of contact of a scene: their points in the mesh, their gaps and their stops."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

import cms
import fem
from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError
from nldyn.scene.faults import told_as
from nldyn.scene.messages import scene_error
from nldyn.scene.schema.contacts import ALONG, ListedAreaTable, MeshAreaTable, exponent_of
from nldyn.scene.schema.scene import Scene
from nldyn.system.contact_area import contact_area, gap_beside
from nldyn.system.rigid_stop import RigidStop
from nldyn.system.stop import Stop

FAULTS = (fem.ModelError, cms.ReductionError, SystemModelError)
SKEW = 1e-6  # cosine of the angle between two axes that are perpendicular
TILTED = 0.5  # degrees between two surfaces from which on it is told

Component = fem.Component | cms.Matrices
Parts = Mapping[str, Component]


@dataclass(frozen=True)
class Found:
    """The points of an area of contact, as interfaces.

    Parameters
    ----------
    sides : six lists of str or None
        Interfaces of the points along the normal, of those on the other side, and of both along
        each of two tangents.
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
    pair : fem.ContactPair, optional
        The points of both sides, where two surfaces of meshes touch.
    areas : list of str
        What the reduced model calls the area, and the one on the other side.
    """

    sides: Sequence[Sequence[str] | None]
    weights: Real | None
    gaps: Real | float
    places: Real | None = None
    held: int = 0
    measure: str | None = None
    pair: fem.ContactPair | None = None
    areas: Sequence[str] = ()


@dataclass(frozen=True)
class _End:
    """Points of one component, and what it calls the area that they make."""

    part: str
    points: fem.ContactPoints
    name: str

    def names(self, word: str = "") -> list[str]:
        """Of the interfaces of the points."""
        return [f"{self.name} {i + 1}{word}" for i in range(len(self.points.places))]

    def touching(self, body: fem.Component, table: MeshAreaTable) -> fem.Component:
        """The component with interfaces at the points, along the normal and the surface.

        Along a surface that gives way they share attachment modes with those along the normal.
        """
        named = dict(zip(self.names(), self.points.vectors(), strict=True))
        stiffness = [(table.stiffness or 1.0) * self.points.weights]
        shared = list(named)
        for word, axis in _tangents(table):
            rows = self.points.vectors(_axis(axis))
            named |= zip(self.names(word), rows, strict=True)
            if table.tangential_stiffness is not None:
                shared += self.names(word)
                stiffness.append(table.tangential_stiffness * self.points.weights)
        modes, tolerance = table.attachment_modes, table.static_error
        area = cms.Area(shared, np.concatenate(stiffness), modes, tolerance)
        return body.with_interfaces(named, {self.name: area})

    def of_whole(self, name: str) -> str:
        """What the model of all components calls an interface or an area."""
        return f"{self.part}.{name}" if self.part else name


def with_areas(scene: Scene, parts: Parts) -> dict[str, Component]:
    """Components by name with the interfaces of the areas of contact of their scene.

    A scene without components has one, which is called "".

    Raises
    ------
    SceneError
        If a mesh has no such set, or it is none that can touch.
    """
    touching = dict(parts)
    found: list[Found] = []
    for number, table in enumerate(scene.contact_areas):
        if isinstance(table, ListedAreaTable):
            found.append(_listed(table))
            continue
        with told_as(scene, ("contact_areas", number), *FAULTS):
            found.append(_placed(scene, touching, table))
    scene._areas_found = tuple(scene.contact_areas), tuple(found)
    return touching


def check_one_mesh(scene: Scene) -> None:
    """Refuse to take another mesh where points of contact go with that of the scene."""
    if any(isinstance(table, MeshAreaTable) for table in scene.contact_areas):
        fault = "go with the mesh: compare modes or methods, not meshes"
        raise scene_error(scene.file, ("contact_areas",), fault)


def _listed(table: ListedAreaTable) -> Found:
    weights = None if table.weights is None else np.array(table.weights)
    sides = (table.at, table.against, *(getattr(table, key) for key in ALONG))
    return Found(sides, weights, _as_gaps(table.gap))


def _as_gaps(gap: float | list[float]) -> Real | float:
    return np.array(gap) if isinstance(gap, list) else gap


def _placed(scene: Scene, parts: dict[str, Component], table: MeshAreaTable) -> Found:
    """The points of an area of a mesh, with whose interfaces the components are replaced."""
    part, at = _part_and_set(scene, table.at)
    _check_tangents(table)
    points = fem.contact_points(
        _meshed(parts, part), at, _axis(table.direction), points=table.points,
        surface=table.surface,
    )  # fmt: skip
    if table.against is None:
        ends, pair = [_End(part, points, table.name or at)], None
    else:
        other, against = _part_and_set(scene, table.against)
        body, surface = _meshed(parts, other), table.surface_against
        pair = fem.opposite_points(body, points, against, surface=surface)
        ends = [_End(part, pair.near, table.name or at)]
        ends.append(_End(other, pair.far, f"{table.name or at} against"))
    points = ends[0].points
    words = ["", *(word for word, _ in _tangents(table))]
    sides: list[list[str] | None] = [None] * 6
    for number, end in enumerate(ends):
        parts[end.part] = end.touching(_meshed(parts, end.part), table)
        for place, word in enumerate(words):
            sides[number + 2 * place] = [end.of_whole(name) for name in end.names(word)]
    return Found(
        sides,
        points.weights,
        _gaps(table, points.places, pair),
        points.places,
        points.held,
        points.measure,
        pair,
        [end.of_whole(end.name) for end in ends],
    )


def _check_tangents(table: MeshAreaTable) -> None:
    """Refuse tangents that are not perpendicular to the normal and to each other."""
    given = {key: getattr(table, key) for key in ("direction", "along", "second_along")}
    axes = {
        key: fem.unit_vector(table.called, _axis(axis))
        for key, axis in given.items()
        if axis is not None
    }
    for other, key in itertools.combinations(axes, 2):
        if abs(axes[key] @ axes[other]) > SKEW:
            raise SystemModelError(f"'{key}' must be perpendicular to '{other}'")


def _tangents(table: MeshAreaTable) -> list[tuple[str, str | list[float]]]:
    """What interfaces along each tangent of an area are called, and its axis."""
    words = ((" along", table.along), (" across", table.second_along))
    return [(word, axis) for word, axis in words if axis is not None]


def _part_and_set(scene: Scene, name: str) -> tuple[str, str]:
    """The component and the set of its mesh; without components that is called ""."""
    if not scene.components:
        return "", name
    part, _, at = name.partition(".")
    return part, at


def _meshed(parts: Parts, name: str) -> fem.Component:
    component = parts[name]
    assert isinstance(component, fem.Component)  # as `nldyn.scene.checks` makes sure
    return component


def _axis(given: str | Sequence[float]) -> str | list[float]:
    return given if isinstance(given, str) else [float(each) for each in given]


def _gaps(table: MeshAreaTable, places: Real, pair: fem.ContactPair | None) -> Real:
    """The gap at each point (k,): what is given beside the distance of two surfaces."""
    if isinstance(table.gap, list) and len(table.gap) != len(places):
        raise SystemModelError(
            f"gap has {len(table.gap)} values, but the area has {len(places)} points"
        )
    centre = places.mean(axis=0) if table.centre is None else np.array(table.centre)
    axis = None if table.axis is None else fem.unit_vector(table.called, _axis(table.axis))
    normal = fem.unit_vector(table.called, _axis(table.direction))
    beside = gap_beside(places, normal, centre, slope=table.slope, radius=table.radius, axis=axis)
    apart = 0.0 if pair is None else pair.gaps
    return np.asarray(_as_gaps(table.gap) + beside + apart)


def areas_found(scene: Scene) -> tuple[Found, ...]:
    """The points of all areas of a scene; its mesh is assembled unless that was done already."""
    listed = [_listed(table) for table in scene.contact_areas if isinstance(table, ListedAreaTable)]
    if len(listed) == len(scene.contact_areas):
        return tuple(listed)
    if scene._areas_found is None or scene._areas_found[0] != tuple(scene.contact_areas):
        from nldyn.scene.build import build_any, build_parts  # which call `with_areas`

        (build_parts if scene.components else build_any)(scene)
    found: tuple[Found, ...] = scene._areas_found[1]
    return found


def told_of_areas(scene: Scene, reduced: cms.ReducedModel) -> list[str]:
    """What each area of a mesh is, and what the reduction gave to it, a sentence each."""
    sentences = []
    for table, found in zip(scene.contact_areas, areas_found(scene), strict=True):
        if found.places is None or found.weights is None:
            continue
        unit = {"area": "m²", "length": "m"}.get(found.measure or "")
        of = f" that stand for {found.weights.sum():.4g} {unit}" if unit else ""
        text = f"contact area '{table.called}': {len(found.places)} points{of}"
        text += "".join(f" ({told})" for told in _beside(found))
        for name, side in zip(found.areas, ("", " on the other side"), strict=False):
            if name in reduced.areas:
                given = reduced.areas[name]
                text += (
                    f"; {given.modes} attachment modes{side}, static error {given.static_error:.2g}"
                )
        sentences.append(text)
    return sentences


def _beside(found: Found) -> list[str]:
    """What is left out of an area, and how its surfaces lie."""
    told, pair = [], found.pair
    if found.held:
        told.append(f"{found.held} more are held by supports")
    if pair is None:
        return told
    if pair.alone:
        told.append(f"{pair.alone} more have nothing opposite and are left out")
    if pair.gaps.min() < 0.0:
        told.append(f"in the mesh the surfaces overlap by up to {-pair.gaps.min():.4g} m")
    if pair.gaps.max() > 0.0:
        told.append(f"in the mesh the surfaces are up to {pair.gaps.max():.4g} m apart")
    if pair.tilt > TILTED:
        told.append(f"the other surface is inclined by up to {pair.tilt:.3g} degrees")
    return told


def area_stops(scene: Scene) -> tuple[Stop | RigidStop, ...]:
    """The stops of all areas of contact of a scene."""
    stops: list[Stop | RigidStop] = []
    names: set[str] = set()
    tables = zip(scene.contact_areas, areas_found(scene), strict=True)
    for number, (table, found) in enumerate(tables):
        if table.called in names:
            fault = f"has the name '{table.called}' of another one: give it a 'name' of its own"
            raise scene_error(scene.file, ("contact_areas", number), fault)
        names.add(table.called)
        points, against, tangents, beside, across, across_beside = found.sides
        assert points is not None
        with told_as(scene, ("contact_areas", number), SystemModelError):
            stops += contact_area(
                table.called,
                points,
                math.inf if table.stiffness is None else table.stiffness,
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
                tangential_stiffness=table.tangential_stiffness,
                second_tangents=across,
                second_tangents_against=across_beside,
            )
    return tuple(stops)
