"""What stands around a drawn structure: supports, lumped masses, and how far to the stop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.attachments import PointMass
from fem.mesh.cells import KINDS
from fem.model.structure import AXES, IN_PLANE, axis_index
from fem.render.structure_surface import (
    StructureSurface,
    nodes_on,
    reflected,
    swept_parts,
    symmetry_normal,
)

BLOCK_DENSITY = 7800.0
MARK_FRACTION = 0.02
ON_LINE = 1e-6  # of the structure's size: so near to a line a node lies on it
HALF_TURN_SLACK = 1e-6  # rad
ALONG_Z = 0.99  # cosine to the z axis from which a direction counts as along it
LIFT = 1e-3
"""Held faces are drawn this part of the structure's size off its surface."""


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
        From the structure to the stop, (x, y) or (x, y, z): the way the point moves to
        hit it.
    gap
        In m, from the undeformed structure to the stop; negative if they are pressed together.
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
    """A lumped mass drawn as a block that moves and turns with its node."""

    node: int
    pivot: FloatArray
    at_rest: FloatArray
    solid: Any

    def move(self, shape: FloatArray, scale: float) -> None:
        """Shift and turn the block with the node's six displacements from ``shape`` (n, 6)."""
        moved, turned = scale * shape[self.node, :3], scale * shape[self.node, 3:]
        arm = self.at_rest - self.pivot
        angle = float(np.linalg.norm(turned))
        if angle > 0.0:
            axis = turned / angle
            angle = math.atan(angle)
            along = np.outer(arm @ axis, axis)
            arm = along + math.cos(angle) * (arm - along) + math.sin(angle) * np.cross(axis, arm)
        self.solid.points = self.pivot + arm + moved


def size_of(drawing: StructureSurface) -> float:
    """Diagonal of the box around the structure, in m."""
    return float(np.linalg.norm(np.ptp(drawing.component.model.mesh.points, axis=0)))


def mark_of(drawing: StructureSurface) -> float:
    """Size in m of the marks beside a structure: a fixed part of its own."""
    return MARK_FRACTION * size_of(drawing)


def axes_along(direction: FloatArray) -> FloatArray:
    """Unit vectors (3, 3) along a direction, across it in the x-y plane, and across both.

    Examples
    --------
    >>> axes_along(np.array([2.0, 0.0, 0.0])).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    first = direction / np.linalg.norm(direction)
    second = np.cross([0.0, 0.0, 1.0] if abs(first[2]) < ALONG_Z else [0.0, 1.0, 0.0], first)
    second = second / np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)])


def ends_at(drawing: StructureSurface, node: int) -> FloatArray:
    """Unit vectors (k, 3) along the lines of beams that end at a node, pointing out of them."""
    points, found = drawing.component.model.mesh.points, [np.zeros((0, 3))]
    for _, lines in swept_parts(drawing.component.model).values():
        line, end = np.nonzero(lines == node)
        outward = points[node] - points[lines[line, 1 - end]]
        found.append(outward / np.linalg.norm(outward, axis=1)[:, None])
    return np.concatenate(found)


def box_along(centre: FloatArray, axes: FloatArray, lengths: tuple[float, float, float]) -> Any:
    """A box whose edges have lengths along unit vectors (3, 3)."""
    import pyvista

    a, b, c = (length / 2 for length in lengths)
    box = pyvista.Box(bounds=(-a, a, -b, b, -c, c)).triangulate()
    box.points = np.asarray(box.points, dtype=np.float64) @ axes + centre
    return box


def cone(tip: FloatArray, axis: FloatArray, height: float) -> Any:
    """A cone whose tip (3,) points along a unit vector (3,)."""
    import pyvista

    return pyvista.Cone(
        center=tip - height / 2 * axis,
        direction=axis,
        height=height,
        radius=0.55 * height,
        resolution=48,
    )


def support_marks(drawing: StructureSurface) -> Iterator[tuple[Any, bool]]:
    """Patches on held faces, marks at held nodes; with each whether it holds along one axis only.

    A plane of symmetry of beams is such a one, too; where the structure is repeated in it, it is
    not drawn.
    """
    model = drawing.component.model
    points, mark = model.mesh.points, mark_of(drawing)
    on_mirror = nodes_on(points, drawing.mirror)
    for support in model.attached.supports:
        held = {AXES[axis_index(direction)] for direction in support.directions}
        nodes = model.mesh.nodes(support.point)
        if not held or on_mirror[nodes].all():
            continue
        one_axis = len(held.intersection("xyz")) == 1
        facets = {} if model.plane else model.facets_on(support.point)
        solids = [(patch, one_axis) for patch in _patches(drawing, facets)]
        for node in [] if facets else nodes[spread(points[nodes], mark)]:
            if not on_mirror[node]:
                solids += node_marks(drawing, int(node), held)
        for solid, plane in solids:
            yield from ((each, plane) for each in with_image(drawing, solid))


def with_image(drawing: StructureSurface, solid: Any) -> list[Any]:
    """The solid, and its mirror image where the structure is repeated."""
    if drawing.mirror is None:
        return [solid]
    image = solid.copy()
    image.points = reflected(np.asarray(solid.points, dtype=np.float64), *drawing.mirror)
    return [solid, image]


def node_marks(drawing: StructureSurface, node: int, held: set[str]) -> Iterator[tuple[Any, bool]]:
    """The marks of a support at one node, with each whether it is a plane of symmetry.

    At lines of beams a block behind a clamp, a thin plate, or cones; a cube elsewhere.
    """
    at, mark = drawing.component.model.mesh.points[node], mark_of(drawing)
    ends = ends_at(drawing, node)
    one_axis = len(held.intersection("xyz")) == 1
    if not len(ends):
        edge = 0.6 * mark if one_axis else mark
        yield box_along(at, np.eye(3), (edge, edge, edge)), one_axis
        return
    known = IN_PLANE if drawing.component.model.plane else AXES
    moves = {axis for axis in known if axis in "xyz"}
    turns = set(known) - moves
    outward = ends.sum(axis=0)
    axes = axes_along(outward if np.linalg.norm(outward) >= 0.5 else np.array([0.0, -1.0, 0.0]))
    corners = drawing.sections_at(node)
    _, height, width = np.abs(corners @ axes.T).max(axis=0)
    normal = next((axis for axis in moves if held == {axis, *turns} - {f"rotation_{axis}"}), None)
    if held >= moves | turns:
        lengths = (0.9 * mark, 2 * max(2.0 * height, 1.2 * mark), 2.5 * width)
        yield box_along(at + 0.45 * mark * axes[0], axes, lengths), False
    elif normal is not None:
        axes = axes_along(np.eye(3)["xyz".index(normal)])
        sides = (0.02 * mark, 2 * (height + 1.5 * mark), 3.0 * width)
        yield box_along(at, axes, sides), True
    elif held <= turns:
        yield box_along(at, axes, (0.5 * mark, 2.6 * height, 2.6 * width)), False
    elif held >= moves:
        yield cone(at, -axes[0], mark), False
    else:
        for direction in sorted(held & moves):
            axis = np.eye(3)["xyz".index(direction)]
            yield cone(at - (corners @ axis).max() * axis, axis, mark), False


def spread(points: FloatArray, apart: float) -> IntArray:
    """Those of many points (n, 3) no two of which lie in one box of an edge length.

    Examples
    --------
    >>> spread(np.array([[0.0, 0, 0], [0.1, 0, 0], [1.2, 0, 0]]), 1.0).tolist()
    [0, 2]
    """
    boxes = np.floor((points - points.min(axis=0)) / apart).astype(np.int64)
    _, first = np.unique(boxes, axis=0, return_index=True)
    return np.sort(first)


def _patches(drawing: StructureSurface, facets: dict[str, IntArray]) -> Iterator[Any]:
    import pyvista

    points = drawing.component.model.mesh.points
    middle = points.mean(axis=0)
    for kind, cells in facets.items():
        corners = points[cells]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        outward = np.sum(normal * (corners.mean(axis=1) - middle), axis=1)
        normal = normal * np.where(outward < 0.0, -1.0, 1.0)[:, None]
        normal = normal / np.linalg.norm(normal, axis=1)[:, None]
        lifted = corners + LIFT * size_of(drawing) * normal[:, None, :]
        index = np.arange(lifted[..., 0].size).reshape(cells.shape)
        ring = list(range(len(KINDS[kind].corners)))
        faces = np.insert(index[:, ring], 0, len(ring), axis=1).ravel()
        yield pyvista.PolyData(lifted.reshape(-1, 3), faces=faces)


def mass_blocks(drawing: StructureSurface, stops: Sequence[StopSphere]) -> list[Block]:
    """A block of steel for each lumped mass.

    Blocks at the image of a mirrored structure do not move with it and are left out.
    """
    model, blocks = drawing.component.model, []
    for lump in model.point_masses:
        if lump.mass > 0.0:
            node = model.mesh.node(lump.point)
            solid = mass_block(drawing, lump, node, side_for_mass(drawing, lump, node, stops))
            at_rest = np.array(solid.points, dtype=np.float64)
            blocks.append(Block(node, model.mesh.points[node], at_rest, solid))
    return blocks


def side_for_mass(
    drawing: StructureSurface, lump: PointMass, node: int, stops: Sequence[StopSphere]
) -> FloatArray | None:
    """Unit vector (3,) to where a mass is drawn: away from a stop, or beside a beam; else None.

    Beside a beam it is where no line runs, and rather below.
    """
    mesh = drawing.component.model.mesh
    if any(lump.offset):
        return None
    stop = next((each for each in stops if mesh.node(each.point) == node), None)
    if stop is not None:
        return -direction_of(stop)
    ends = ends_at(drawing, node)
    if not len(ends):
        return None
    across = axes_along(ends[0])[1 : 2 if drawing.component.model.plane else 3]
    beside = np.round(np.concatenate([across, -across]), 9)
    best = min(beside, key=lambda side: (-round((ends @ side).min(), 6), side[1], -side[0]))
    return np.asarray(best)


def mass_block(
    drawing: StructureSurface, lump: PointMass, node: int, side: FloatArray | None
) -> Any:
    """The cube of one lumped mass: where its centre is, or on the given side (3,) of its node.

    On the plane of symmetry of a half model it is half of the cube that the whole model has.
    """
    model = drawing.component.model
    normal = symmetry_normal(drawing.component, lump.point)
    edge = ((lump.mass if normal is None else 2.0 * lump.mass) / BLOCK_DENSITY) ** (1 / 3)
    centre = model.mesh.points[node] + np.asarray(lump.offset)
    if side is None:
        return box_along(centre, np.eye(3), (edge, edge, edge))
    centre = centre + (reach(drawing, node, side) + edge / 2) * side
    axes, depth = axes_along(side), edge
    if normal is not None and abs(normal @ side) < 1e-9:
        axes = np.stack([side, normal, np.cross(side, normal)])
        if not nodes_on(model.mesh.points, drawing.mirror)[node]:
            depth = edge / 2
            centre = centre - edge / 4 * ends_at(drawing, node)[0]
    return box_along(centre, axes, (edge, depth, edge))


def direction_of(stop: StopSphere) -> FloatArray:
    """Unit vector (3,) from the structure to the stop."""
    way = np.array([*stop.direction, 0.0][:3], dtype=np.float64)
    return way / float(np.linalg.norm(way))


def reach(drawing: StructureSurface, node: int, towards: FloatArray) -> float:
    """How far the undeformed surface reaches from a node along a unit vector (3,), in m.

    Where only beams meet, that is how far their sections do.
    """
    sections = drawing.sections_at(node)
    if len(sections) and node not in drawing.nodes:
        return float((sections @ towards).max(initial=0.0))
    return reach_along(drawing, drawing.component.model.mesh.points[node], towards)


def reach_along(drawing: StructureSurface, point: FloatArray, towards: FloatArray) -> float:
    """How far the undeformed surface reaches from a point along a unit vector, in m.

    What lies beyond the end of the material, another arm of a fork, does not count.
    """
    surface, _ = drawing.place(np.zeros(len(drawing.component.free)))
    arm = surface - point
    along = arm @ towards
    aside = np.linalg.norm(arm - along[:, None] * towards, axis=1)
    mark = mark_of(drawing)
    near = aside <= aside.min() + 0.25 * mark
    near &= along <= end_of_material(drawing, point, towards) + mark
    return float(along[near].max(initial=0.0))


def end_of_material(drawing: StructureSurface, point: FloatArray, towards: FloatArray) -> float:
    """How far from a point (3,) along a unit vector cells follow each other, in m.

    Cells that the line through the point meets are taken from their first to their last node along
    it. If none is at the point, infinite.
    """
    mesh = drawing.component.model.mesh
    arm = mesh.points - point
    along = arm @ towards
    right = np.cross(towards, np.eye(3)[np.argmin(np.abs(towards))])
    across = arm @ np.stack([right, np.cross(towards, right)], axis=1)
    slack = ON_LINE * size_of(drawing)
    pieces = [np.zeros((0, 2))]
    for cells in mesh.cells.values():
        ends = along[cells[meet_origin(across[cells], slack)]]
        pieces.append(np.stack([ends.min(axis=1), ends.max(axis=1)], axis=1))
    begun = np.concatenate(pieces)
    begun = begun[np.argsort(begun[:, 0])]
    end = -math.inf
    for low, high in begun[begun[:, 1] >= -slack]:
        if low > max(end, 0.0) + slack:
            break
        end = max(end, high)
    return end if end > -math.inf else math.inf


def meet_origin(points: FloatArray, slack: float) -> NDArray[np.bool_]:
    """Whether convex hulls of points (c, k, 2) hold the origin, or a point is so near to it.

    Examples
    --------
    >>> triangle = np.array([[0.0, 0], [1, 0], [0, 1]])
    >>> at = np.array([[0.3, 0.3], [0.5, 0], [1, 0], [0.6, 0.6]])
    >>> meet_origin(triangle - at[:, None], 1e-9).tolist()
    [True, True, True, False]
    """
    angles = np.sort(np.arctan2(points[..., 1], points[..., 0]), axis=1)
    turn = np.diff(angles, axis=1, append=angles[:, :1] + 2.0 * math.pi)
    around = turn.max(axis=1) <= math.pi + HALF_TURN_SLACK
    near = np.hypot(points[..., 0], points[..., 1]).min(axis=1) <= slack
    return np.asarray(around | near)
