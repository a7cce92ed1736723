"""What stands around a drawn structure: held faces and points, lumped masses, the stop."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.base.arrays import FloatArray, IntArray
from fem.mesh.cells import KINDS
from fem.render.frame_scenery import (
    BLOCK_DENSITY,
    MARK_FRACTION,
    StopSphere,
)
from fem.render.structure_surface import StructureSurface

ON_LINE = 1e-6  # of the structure's size: so near to a line a node lies on it
HALF_TURN_SLACK = 1e-6  # rad
LIFT = 1e-3
"""Held faces are drawn this part of the structure's size off its surface."""


@dataclass(frozen=True, eq=False)
class Cube:
    """A lumped mass drawn as a cube that moves and turns with its node."""

    node: int
    pivot: FloatArray
    at_rest: FloatArray
    solid: Any

    def move(self, shape: FloatArray, scale: float) -> None:
        """Shift and turn the cube with the node's six displacements from ``shape`` (n, 6)."""
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


def support_marks(drawing: StructureSurface) -> Iterator[tuple[Any, bool]]:
    """A patch on each held face, cubes at other held nodes; with each whether one axis is held."""
    import pyvista

    model = drawing.component.model
    mark = MARK_FRACTION * size_of(drawing)
    for support in model.attached.supports:
        translations = {"x", "y", "z"} & set(support.directions)
        one_axis = len(translations) == 1
        facets = {} if model.is_plane else model.facets_on(support.point)
        for patch in _patches(drawing, facets):
            yield patch, one_axis
        if facets or not support.directions:
            continue
        edge = mark if len(translations) > 1 else 0.6 * mark
        for centre in spread(model.mesh.points[model.mesh.nodes(support.point)], mark):
            cube = pyvista.Cube(center=centre, x_length=edge, y_length=edge, z_length=edge)
            yield cube, one_axis


def spread(points: FloatArray, apart: float) -> FloatArray:
    """Points no two of which lie in one box of an edge length, of many.

    Examples
    --------
    >>> spread(np.array([[0.0, 0, 0], [0.1, 0, 0], [1.2, 0, 0]]), 1.0)[:, 0].tolist()
    [0.0, 1.2]
    """
    boxes = np.floor((points - points.min(axis=0)) / apart).astype(np.int64)
    _, first = np.unique(boxes, axis=0, return_index=True)
    return points[np.sort(first)]


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


def mass_cubes(drawing: StructureSurface, stops: Sequence[StopSphere]) -> list[Cube]:
    """A cube of steel for each lumped mass, with its centre where the mass has it.

    One without an offset at a point that hits a stop stands on the side away from it.
    """
    import pyvista

    model = drawing.component.model
    cubes = []
    for lump in model.point_masses:
        if lump.mass > 0.0:
            node = model.mesh.node(lump.point)
            edge = (lump.mass / BLOCK_DENSITY) ** (1 / 3)
            centre = model.mesh.points[node] + np.asarray(lump.offset)
            stop = next((each for each in stops if model.mesh.node(each.point) == node), None)
            if stop is not None and not any(lump.offset):
                away = -direction_of(stop)
                centre = centre + (reach_along(drawing, centre, away) + edge / 2.0) * away
            solid = pyvista.Cube(center=centre, x_length=edge, y_length=edge, z_length=edge)
            at_rest = np.array(solid.points, dtype=np.float64)
            cubes.append(Cube(node, model.mesh.points[node], at_rest, solid))
    return cubes


def direction_of(stop: StopSphere) -> FloatArray:
    """Unit vector (3,) from the structure to the stop."""
    way = np.array([*stop.direction, 0.0][:3], dtype=np.float64)
    return way / float(np.linalg.norm(way))


def reach_along(drawing: StructureSurface, point: FloatArray, towards: FloatArray) -> float:
    """How far the undeformed surface reaches from a point along a unit vector, in m.

    What lies beyond the end of the material, another arm of a fork, does not count.
    """
    surface, _ = drawing.place(np.zeros(len(drawing.component.free)))
    arm = surface - point
    along = arm @ towards
    aside = np.linalg.norm(arm - along[:, None] * towards, axis=1)
    mark = MARK_FRACTION * size_of(drawing)
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
