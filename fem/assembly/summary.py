"""What was read and assembled, for a person: cells, names, mass, centre, extents, pieces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fem.assembly.component import Component
from fem.base.arrays import FloatArray, IntArray
from fem.elements.tapers import along
from fem.mesh.cells import measures
from fem.mesh.pieces import described, place_of
from fem.mesh.structure_mesh import StructureMesh
from fem.model.parts import BeamPart
from fem.model.structure import StructureModel

MOST_NAMES = 30


@dataclass(frozen=True)
class MassProperties:
    """Mass of a component without regard to its supports.

    Parameters
    ----------
    mass
        In kg.
    centre
        Centre of mass (x, y, z) in m.

    Examples
    --------
    >>> import fem
    >>> model = fem.StructureModel(
    ...     fem.box_mesh("bar", (2.0, 0.1, 0.1), (2, 1, 1)),
    ...     {"bar": fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))})
    >>> mass_properties(fem.assemble(model))
    MassProperties(mass=156.0, centre=(1.0, 0.05, 0.05))
    """

    mass: float
    centre: tuple[float, float, float]


def mass_properties(component: Component) -> MassProperties:
    """Mass and centre of mass of everything that a component is made of, supports apart.

    Notes
    -----
    With the mass matrix M of all degrees of freedom, t the translation and r the rotation about an
    axis, m = tᵀMt, and tᵀMr is m times a coordinate of the centre.
    """
    rigid = component.rigid_mass
    mass = rigid[0, 0]
    moments = np.array([rigid[1, 5], -rigid[0, 5], rigid[0, 4]])
    x, y, z = (float(f"{value:.12g}") + 0.0 for value in (moments / mass if mass else np.zeros(3)))
    return MassProperties(float(f"{mass:.12g}"), (x, y, z))


def volume(model: StructureModel) -> float:
    """Volume in m³ of everything that a model is made of, hinges and masses at points apart.

    Examples
    --------
    >>> import fem
    >>> rod = fem.BeamPart(fem.Material(2.1e11, 7800.0), fem.RectangularSection(0.1, 0.02))
    >>> mesh = fem.frame_mesh({"a": (0, 0), "b": (3, 0)}, [("rod", "a", "b", 2)])
    >>> round(volume(fem.StructureModel(mesh, {"rod": rod})), 12)
    0.006
    """
    mesh, found = model.mesh, 0.0
    for solid, kinds in model.solids.values():
        found += (solid.thickness or 1.0) * _size(mesh.points, kinds)
    for shell, kinds in model.shells.values():
        found += shell.thickness * _size(mesh.points, kinds)
    for truss, kinds in model.trusses.values():
        found += truss.area * _size(mesh.points, kinds)
    for name, (part, ends) in model.beams.items():
        lengths = np.linalg.norm(mesh.points[ends[:, 1]] - mesh.points[ends[:, 0]], axis=1)
        found += float(np.sum(lengths * _mean_area(part, mesh, ends, name)))
    return found


def _size(points: FloatArray, kinds: Mapping[str, IntArray]) -> float:
    return sum(float(measures(kind, points[cells]).sum()) for kind, cells in kinds.items())


def _mean_area(part: BeamPart, mesh: StructureMesh, ends: IntArray, name: str) -> FloatArray:
    """Of each line, in m², by Simpson's rule, which is exact where lengths change linearly."""
    section = along(part, mesh, ends, name, np.array([0.0, 0.5, 1.0])).section
    areas = np.broadcast_to(np.asarray(section.area), (len(ends), 3))
    return areas @ [1 / 6, 4 / 6, 1 / 6]


def summary(component: Component) -> str:
    """What a component was made of, in lines for a person.

    Examples
    --------
    >>> import fem
    >>> model = fem.StructureModel(
    ...     fem.box_mesh("bar", (2.0, 0.1, 0.1), (2, 1, 1)),
    ...     {"bar": fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))})
    >>> print(summary(fem.assemble(model)).splitlines()[0])
    mesh box_mesh: 32 nodes; 2 hexahedron20
    """
    mesh = component.model.mesh
    used = mesh.points
    low, high = used.min(axis=0), used.max(axis=0)
    properties = mass_properties(component)
    cells = ", ".join(f"{len(nodes)} {kind}" for kind, nodes in mesh.cells.items())
    lines = [
        f"mesh {mesh.source}: {len(mesh.points)} nodes; {cells}",
        f"extents: {place_of(low)} to {place_of(high)} m",
        f"volume: {volume(component.model):.8g} m³",
        f"mass: {properties.mass:.8g} kg, centre at {place_of(np.array(properties.centre))} m",
        *_names(component),
        *described(component.model),
        *mesh.notes,
        *(f"left out of the file: {item}" for item in mesh.left_out),
    ]
    if mesh.attachments:
        lines.append(f"taken from the file: {mesh.attachments}")
    return "\n".join(lines)


def _names(component: Component) -> list[str]:
    """Groups of cells and sets of points, each with how much it holds."""
    mesh = component.model.mesh
    groups = {
        name: ", ".join(f"{len(at)} {kind}" for kind, at in found.items())
        for name, found in mesh.groups.items()
    }
    parts = set(component.model.parts)
    told = [
        f"{name!r} ({what}{', a part' if name in parts else ''})" for name, what in groups.items()
    ]
    points = [f"{name!r} ({len(nodes)})" for name, nodes in mesh.point_sets.items()]
    return [
        f"{what}: {', '.join(names[:MOST_NAMES])}"
        + (f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else "")
        for what, names in (("groups of cells", told), ("sets of points", points))
        if names
    ]
