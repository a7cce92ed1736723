"""What stands around a drawn frame: supports, point masses, the stop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.assembly.frame import Component
from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.elements.tapers import along
from fem.mesh.attachments import PointMass, Support
from fem.render.frame_surface import FrameSurface, nodes_on, outline, reflected, symmetry_normal

BLOCK_DENSITY = 7800.0
MARK_FRACTION = 0.02


@dataclass(frozen=True)
class StopSphere:
    """A spherical stop to be drawn.

    Parameters
    ----------
    point
        The point of the mesh that hits it.
    radius
        In m; unless given it is drawn with a hundredth of the structure's size.
    direction
        From the beam to the stop, (x, y) or in a structure (x, y, z): the way the point moves to
        hit it.
    gap
        In m, from the undeformed beam to the stop; negative if they are pressed together.
    against
        The point of the mesh that carries the stop; unless given it stands on the ground.

    Raises
    ------
    ModelError
        If the radius is not positive, the gap not finite, or the direction has no length.

    Examples
    --------
    >>> StopSphere("middle", radius=0.005).direction
    (0.0, 1.0)
    """

    point: str
    radius: float | None = None
    direction: tuple[float, ...] = (0.0, 1.0)
    gap: float = 0.0
    against: str | None = None

    def __post_init__(self) -> None:
        if self.radius is not None and not (math.isfinite(self.radius) and self.radius > 0.0):
            raise ModelError(f"stop at {self.point!r}: radius must be positive, not {self.radius}")
        if not math.isfinite(self.gap):
            raise ModelError(f"stop at {self.point!r}: gap must be finite, not {self.gap}")
        length = math.hypot(*self.direction)
        if not (math.isfinite(length) and length > 0.0):
            raise ModelError(
                f"stop at {self.point!r}: {self.direction} is no direction, it has no length"
            )


@dataclass(frozen=True, eq=False)
class Block:
    """A point mass drawn as a block that moves with its node."""

    node: int
    pivot: FloatArray
    at_rest: FloatArray
    solid: Any

    def move(self, shape: FloatArray, scale: float) -> None:
        """Shift and turn the block with the node's (ux, uy, rotation) from ``shape`` (n, 3)."""
        ux, uy, rotation = shape[self.node]
        angle = math.atan(scale * rotation)
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        points = self.at_rest.copy()
        points[:, :2] = (points[:, :2] - self.pivot) @ turn.T + self.pivot
        points[:, :2] += scale * np.array([ux, uy])
        self.solid.points = points


def ends_at(component: Component, node: int) -> FloatArray:
    """Unit vectors (k, 2) along the elements that meet at a node, pointing out of them."""
    mesh = component.model.mesh
    elements, ends = np.nonzero(mesh.lines == node)
    outward = mesh.spans[elements, :2] * np.where(ends == 1, 1.0, -1.0)[:, None]
    return np.asarray(outward / mesh.lengths[elements, None], dtype=np.float64)


def reach(component: Component, node: int, direction: FloatArray) -> tuple[float, float]:
    """How far the sections at a node reach along a direction (2,), and half their width, in m."""
    mesh = component.model.mesh
    across, width = 0.0, 0.0
    for name, elements in component.model.element_parts().items():
        for element in elements[np.any(mesh.lines[elements] == node, axis=1)]:
            line = mesh.lines[[element]]
            ends = along(component.model.parts[name], mesh, line, name, np.array([0.0, 1.0]))
            corners = outline(ends.section)
            if corners.ndim > 2:
                corners = corners[0, int(np.argmax(line[0] == node))]
            tangent = mesh.spans[element, :2] / mesh.lengths[element]
            normal = np.array([-tangent[1], tangent[0]])
            across = max(across, abs(float(direction @ normal)) * float(corners[:, 0].max()))
            width = max(width, float(corners[:, 1].max()))
    return across, width


def mark_size(component: Component) -> float:
    """Size in m of the marks for supports: a fixed part of the frame's."""
    return MARK_FRACTION * float(np.linalg.norm(np.ptp(component.model.mesh.points, axis=0)))


def oriented_box(centre: FloatArray, along: FloatArray, lengths: tuple[float, float, float]) -> Any:
    """A box with its first edge along a unit vector (2,) in the plane and its last along z."""
    import pyvista

    a, b, c = (length / 2 for length in lengths)
    box = pyvista.Box(bounds=(-a, a, -b, b, -c, c)).triangulate()
    axes = np.array([[along[0], -along[1], 0.0], [along[1], along[0], 0.0], [0.0, 0.0, 1.0]])
    box.points = np.asarray(box.points, dtype=np.float64) @ axes.T + centre
    return box


def support_solids(drawing: FrameSurface) -> Iterator[tuple[Any, bool]]:
    """Marks of all supports; with each whether it is the plane of symmetry of a half model."""
    for support in drawing.component.model.supports:
        plane = set(support.directions) in ({"x", "rotation"}, {"y", "rotation"})
        for node in drawing.component.model.mesh.nodes(support.point):
            if on_mirror(drawing, node):
                continue
            for solid in support_solid(drawing.component, support, node):
                yield from ((each, plane) for each in with_image(drawing, solid))


def support_solid(component: Component, support: Support, node: int) -> Iterator[Any]:
    """The mark of one support at a node: a block behind a clamp, a thin plate, or cones."""
    mark = mark_size(component)
    at = component.model.mesh.points[node]
    held = set(support.directions)
    outward = ends_at(component, node).sum(axis=0)
    if np.linalg.norm(outward) < 0.5:
        outward = np.array([0.0, -1.0])
    outward = outward / np.linalg.norm(outward)
    across = np.array([-outward[1], outward[0]])
    height, width = reach(component, node, across)
    if held == {"x", "y", "rotation"}:
        lengths = (0.9 * mark, 2 * max(2.0 * height, 1.2 * mark), 2.5 * width)
        yield oriented_box(at + 0.45 * mark * np.append(outward, 0.0), outward, lengths)
    elif held in ({"x", "rotation"}, {"y", "rotation"}):
        normal = np.array([1.0, 0.0] if "x" in held else [0.0, 1.0])
        yield oriented_box(at, normal, (0.02 * mark, 2 * (height + 1.5 * mark), 3.0 * width))
    elif held == {"rotation"}:
        yield oriented_box(at, outward, (0.5 * mark, 2.6 * height, 2.6 * width))
    elif held == {"x", "y"}:
        yield cone(at, -outward, mark)
    else:
        for direction in sorted(held - {"rotation"}):
            axis = np.array([1.0, 0.0] if direction == "x" else [0.0, 1.0])
            yield cone(at - np.append(reach(component, node, axis)[0] * axis, 0.0), axis, mark)


def cone(tip: FloatArray, axis: FloatArray, height: float) -> Any:
    """A cone whose tip (3,) points along a unit vector (2,)."""
    import pyvista

    return pyvista.Cone(
        center=tip - height / 2 * np.append(axis, 0.0),
        direction=np.append(axis, 0.0),
        height=height,
        radius=0.55 * height,
        resolution=48,
    )


def mass_blocks(drawing: FrameSurface, stops: Sequence[StopSphere]) -> list[Block]:
    """A cube of steel for each point mass, beside the beam and away from a stop.

    At the plane of symmetry of a half model it is half of the cube that the whole model has.
    Blocks at the image of a mirrored frame do not move with it and are left out.
    """
    mesh = drawing.component.model.mesh
    blocks = []
    for lump in drawing.component.model.point_masses:
        if lump.mass > 0.0:
            node = mesh.node(lump.point)
            solid = mass_block(drawing, lump, side_for_mass(drawing.component, node, stops))
            at_rest = np.array(solid.points, dtype=np.float64)
            blocks.append(Block(node, mesh.points[node, :2], at_rest, solid))
    return blocks


def side_for_mass(component: Component, node: int, stops: Sequence[StopSphere]) -> FloatArray:
    """Unit vector (2,) to where a mass is drawn: away from a stop, or below the beam."""
    stop = next((each for each in stops if component.model.mesh.node(each.point) == node), None)
    if stop is not None:
        return -np.array(stop.direction) / math.hypot(*stop.direction)
    outward = ends_at(component, node)[0]
    below = np.array([outward[1], -outward[0]])
    return below if below[1] < 0.0 or (below[1] == 0.0 and below[0] > 0.0) else -below


def mass_block(drawing: FrameSurface, lump: PointMass, side: FloatArray) -> Any:
    """The block of one point mass on the given side (2,) of its node."""
    component = drawing.component
    mesh = component.model.mesh
    node = mesh.node(lump.point)
    normal = symmetry_normal(component, lump.point)
    whole = lump.mass if normal is None else 2.0 * lump.mass
    edge = (whole / BLOCK_DENSITY) ** (1 / 3)
    centre = mesh.points[node].copy()
    centre[:2] += (reach(component, node, side)[0] + edge / 2) * side
    halved = normal is not None and not on_mirror(drawing, node) and abs(normal @ side) < 1e-9
    if halved:
        centre[:2] -= edge / 4 * ends_at(component, node)[0]
    return oriented_box(centre, side, (edge, edge / 2 if halved else edge, edge))


def on_mirror(drawing: FrameSurface, node: int) -> bool:
    """Whether a node lies on the plane in which the frame is repeated."""
    return bool(nodes_on(drawing.component, drawing.mirror)[node])


def with_image(drawing: FrameSurface, solid: Any) -> list[Any]:
    """The solid, and its mirror image where the frame is repeated."""
    if drawing.mirror is None:
        return [solid]
    image = solid.copy()
    image.points = reflected(np.asarray(solid.points, dtype=np.float64), *drawing.mirror)
    return [solid, image]
