"""Points of a surface that lie opposite to those of an area of contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem.assembly.component import Component
from fem.assembly.contact import (
    Block,
    ContactPoints,
    beam_block,
    check_surface,
    facet_shapes,
    gathered,
    node_block,
)
from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.cells import KINDS, TRIANGLE
from fem.model.structure import StructureModel

OFF = 1e-6  # of the size of a mesh, or of a cell: how far off its opposite a point may lie
STEEP = 0.5  # cosine of the angle between a surface and the direction from which on it is opposite
BULGE = 0.2  # of the size of a curved facet: how far it may reach beyond its nodes
ROUNDED = 1e-12  # of the size of a mesh: a distance that is none
STEPS = 20  # of Newton's method, to a place on a facet
PAIRS = 2_000_000  # of points and facets at once


@dataclass(frozen=True, eq=False, repr=False)
class ContactPair:
    """Points of an area of contact, and those that lie opposite to them on another surface.

    Parameters
    ----------
    near, far
        Points of the area, and of the other surface, one for each: at the same place but for their
        distance along the direction of both.
    gaps
        These distances in m, shape (k,), below 0 where the surfaces overlap.
    alone
        How many points of the area have nothing opposite, and are left out.
    tilt
        Largest angle in degrees between the other surface and the plane across the direction.
    """

    near: ContactPoints
    far: ContactPoints
    gaps: FloatArray
    alone: int
    tilt: float

    def __repr__(self) -> str:
        """One line: how many points, between what, and how far apart."""
        return (
            f"<ContactPair: {len(self.gaps)} points of {self.near.at!r} against {self.far.at!r}, "
            f"{self.gaps.min():.6g} to {self.gaps.max():.6g} m apart, {self.alone} alone>"
        )


@dataclass(frozen=True, eq=False)
class _Cells:
    """Cells (f,) of one kind that a surface is made of.

    Parameters
    ----------
    kind
        Of the cells.
    corners
        Their nodes (f, b, 3).
    behind
        The middle (f, 3) of the solid cell of each; nan where there is none.
    block
        What moves at one place each (m, d) of some of them (m,).
    """

    kind: str
    corners: FloatArray
    behind: FloatArray
    block: Callable[[IntArray, FloatArray], Block]


@dataclass(frozen=True, eq=False)
class _Met:
    """Where lines through points meet cells: the points (m,), the cells, and places (m, d) there.

    The distances (m,) from the points are along the lines, the cosines those of the angles between
    the cells and the plane across.
    """

    points: IntArray
    cells: IntArray
    places: FloatArray
    distances: FloatArray
    cosines: FloatArray

    def only(self, kept: npt.NDArray[np.bool_]) -> _Met:
        """Some of the points."""
        places, distances = self.places[kept], self.distances[kept]
        return _Met(self.points[kept], self.cells[kept], places, distances, self.cosines[kept])


def opposite_points(
    component: Component,
    points: ContactPoints,
    at: str,
    *,
    surface: float = 0.0,
) -> ContactPair:
    """Points of a surface that lie opposite to those of an area, along its direction.

    The meshes need not match: points lie anywhere on a cell, and move as its shape functions tell.

    Parameters
    ----------
    component
        What was assembled, of which the other surface is: the same as that of the area or another
        one, whose mesh has the same coordinates.
    points
        Those of the area.
    at
        The other surface: a face of solids or shells, an edge of plane solids, beams, or nodes that
        lie opposite to nodes.
    surface
        Distance in m, against the direction, of the surface from the axis of the other beams or the
        middle of the other shells.

    Returns
    -------
    ContactPair
        The points that have something opposite, in their order.

    Raises
    ------
    ModelError
        If there is no such set, nothing of it lies opposite to any point, or it faces away.

    Examples
    --------
    >>> import fem
    >>> places = {"a": (0, 0), "b": (2, 0), "c": (0, 0.1), "d": (1.5, 0.1)}
    >>> mesh = fem.frame_mesh(places, [("low", "a", "b", 4), ("high", "c", "d", 5)])
    >>> beam = fem.BeamPart(fem.Material(2e11, 7800.0), fem.Section(1e-3, 1e-8))
    >>> pair = fem.assemble(fem.StructureModel(
    ...     mesh,
    ...     parts={"low": beam, "high": beam},
    ...     supports=[fem.Support(end, ("x", "y", "rotation")) for end in ("a", "c")],
    ...     separate=True,
    ...     plane=True,
    ... ))
    >>> low = fem.contact_points(pair, "low", "y", points=1)
    >>> fem.opposite_points(pair, low, "high")
    <ContactPair: 3 points of 'low' against 'high', 0.1 to 0.1 m apart, 1 alone>
    """
    mesh, n = component.model.mesh, points.direction
    owner = f"{mesh.source}: contact of {points.at!r} against {at!r}"
    size = float(np.ptp(mesh.points, axis=0).max())
    surfaces = _surfaces(component, at, surface, n) or [_nodes(component, at, -surface * n)]
    met = [_met(cells, points.places, n, OFF * size) for cells in surfaces]
    chosen = _nearest(met, len(points.places))
    numbers = np.concatenate([each.points for each in chosen])
    if not len(numbers):
        raise ModelError(
            f"{owner}: nothing of that lies opposite to any of its {len(points.places)} points, "
            f"or it faces away: does ({', '.join(f'{x:g}' for x in n)}) lead from one to the other?"
        )
    pairs = [pair for pair in zip(surfaces, chosen, strict=True) if len(pair[1].points)]
    places, _, motion = gathered(component, [cells.block(m.cells, m.places) for cells, m in pairs])
    near = points.only(np.sort(numbers))
    far = ContactPoints(at, n, places, points.weights[numbers], motion, points.measure)
    far = far.only(np.argsort(numbers))
    gaps = (far.places - near.places) @ n
    gaps[np.abs(gaps) < ROUNDED * size] = 0.0
    if gaps.max() < 0.0 and not any(np.isfinite(cells.behind).any() for cells in surfaces):
        raise ModelError(f"{owner}: all of that lies behind the points, by {-gaps.max():g} m")
    cosine = min(1.0, *(each.cosines.min() for _, each in pairs))
    tilt = float(np.degrees(np.arccos(cosine)))
    return ContactPair(near, far, gaps, len(points.places) - len(numbers), tilt)


def _surfaces(component: Component, at: str, surface: float, n: FloatArray) -> list[_Cells]:
    """The facets or beams all of whose nodes are in a set."""
    model, arm = component.model, -surface * n
    facets, beams = model.facets_on(at), model.beams_on(at)
    if facets and beams:
        raise ModelError(f"{model.mesh.source}: contact at {at!r}: has both facets and beams")
    check_surface(component, at, surface)
    found = [_facets(component, kind, nodes, arm) for kind, nodes in facets.items()]
    return found + [_lines(component, name, lines, arm) for name, lines in beams.items()]


def _facets(component: Component, kind: str, facets: IntArray, arm: FloatArray) -> _Cells:
    corners = component.model.mesh.points[facets]

    def block(cells: IntArray, places: FloatArray) -> Block:
        values = KINDS[kind].basis(places)[0][:, None]
        at = np.einsum("fqb,fbi->fqi", values, corners[cells]) + arm
        return at, np.ones((len(cells), 1)), *facet_shapes(component, facets[cells], values, arm)

    return _Cells(kind, corners, _behind(component.model, kind, facets), block)


def _lines(component: Component, name: str, lines: IntArray, arm: FloatArray) -> _Cells:
    corners = component.model.mesh.points[component.model.beams[name][1][lines]]

    def block(cells: IntArray, places: FloatArray) -> Block:
        return beam_block(component, name, lines[cells], places, np.ones(1), arm)

    return _Cells("line", corners, np.full((len(lines), 3), np.nan), block)


def _nodes(component: Component, at: str, arm: FloatArray) -> _Cells:
    nodes = component.model.mesh.nodes(at)

    def block(cells: IntArray, _: FloatArray) -> Block:
        return node_block(component, at, nodes[cells], arm)

    corners = component.model.mesh.points[nodes][:, None]
    return _Cells("node", corners, np.full((len(nodes), 3), np.nan), block)


def _behind(model: StructureModel, kind: str, facets: IntArray) -> FloatArray:
    """The middle (f, 3) of the solid cell behind each of some outer facets; nan of shells."""
    inside = np.zeros(len(model.mesh.points), dtype=np.bool_)
    inside[facets] = True
    count = len(KINDS[kind].corners)
    keys, middles = [], []
    for _, kinds in model.solids.values():
        for cell_kind, cells in kinds.items():
            local = KINDS[cell_kind].facets.get(kind)
            if local is None:
                continue
            nodes = cells[:, local[:, :count]]
            at, which = np.nonzero(inside[nodes].all(axis=2))
            keys.append(nodes[at, which])
            middles.append(model.mesh.points[cells].mean(axis=1)[at])
    known = np.sort(np.concatenate([facets[:, :count], *keys]), axis=1)
    _, number = np.unique(known, axis=0, return_inverse=True)
    number, found = number.ravel(), np.full((len(known), 3), np.nan)
    found[number[len(facets) :]] = np.concatenate([found[:0], *middles])
    return np.asarray(found[number[: len(facets)]])


def _met(cells: _Cells, points: FloatArray, n: FloatArray, off: float) -> _Met:
    """Where lines through points (k, 3) along n meet cells that face them, nearest to each."""
    across = np.linalg.svd(n[None])[2][1:].T
    facing = np.flatnonzero(_facing(cells, n, across))
    corners, at = cells.corners[facing], points @ across
    point, cell = _candidates(corners @ across, at, off)
    places, on = _places(cells.kind, corners[cell] @ across, at[point], off)
    point, cell, places = point[on], cell[on], places[on]
    values, gradients = _basis(cells.kind, places)
    distances = (np.einsum("mb,mbi->mi", values, corners[cell]) - points[point]) @ n
    order = np.lexsort((np.abs(distances), point))
    _, first = np.unique(point[order], return_index=True)
    best = order[first]
    cosines = _cosines(corners[cell[best]], gradients[best], across)
    return _Met(point[best], facing[cell[best]], places[best], distances[best], cosines)


def _nearest(met: list[_Met], count: int) -> list[_Met]:
    """What each of so many points meets, without that of which another surface has a nearer one."""
    off = np.full((len(met), count), np.inf)
    for row, each in zip(off, met, strict=True):
        row[each.points] = np.abs(each.distances)
    first = off.argmin(axis=0)
    return [each.only(first[each.points] == number) for number, each in enumerate(met)]


def _facing(cells: _Cells, n: FloatArray, across: FloatArray) -> npt.NDArray[np.bool_]:
    """Which cells (f,) lines along n meet from outside, and not along the surface."""
    corners = cells.corners
    middle = np.mean(KINDS[cells.kind].corners, axis=0) if cells.kind in KINDS else np.zeros(0)
    gradients = _basis(cells.kind, np.broadcast_to(middle, (len(corners), middle.size)))[1]
    seen = _cosines(corners, gradients, across) >= STEEP
    solid = np.isfinite(cells.behind[:, 0])
    if not solid.any():
        return seen
    J = np.einsum("fbi,fbj->fji", corners, gradients)
    normals = np.cross(J[:, 0], J[:, 1] if J.shape[1] == 2 else np.array([0.0, 0.0, 1.0]))
    outward = np.einsum("fi,fi->f", normals, corners.mean(axis=1) - cells.behind)
    return np.asarray(seen & ~(solid & ((normals @ n) * outward > 0.0)))


def _cosines(corners: FloatArray, gradients: FloatArray, across: FloatArray) -> FloatArray:
    """Of the angles (m,) between cells (m, b, 3) and the plane across, by gradients (m, b, d)."""
    sizes = []
    for nodes in (corners @ across, corners):
        J = np.einsum("mbi,mbj->mij", nodes, gradients)
        sizes.append(np.linalg.det(J.swapaxes(1, 2) @ J))
    return np.asarray(np.sqrt(np.maximum(sizes[0], 0.0) / sizes[1]))


def _candidates(flat: FloatArray, points: FloatArray, off: float) -> tuple[IntArray, IntArray]:
    """Pairs of points (k, 2) and cells (f, b, 2) in whose box they lie."""
    low, high = flat.min(axis=1), flat.max(axis=1)
    margin = BULGE * (high - low) + off
    low, high = low - margin, high + margin
    step, found = max(1, PAIRS // max(len(flat), 1)), [np.zeros((2, 0), dtype=np.int64)]
    for first in range(0, len(points), step):
        some = points[first : first + step, None]
        point, cell = np.nonzero(np.all((some >= low) & (some <= high), axis=2))
        found.append(np.stack([point + first, cell]))
    point, cell = np.hstack(found)
    return point, cell


def _places(
    kind: str, flat: FloatArray, points: FloatArray, off: float
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Places (m, d) on cells (m, b, 2) where points (m, 2) are, and whether they are on them."""
    if kind == "node":
        return np.zeros((len(flat), 0)), np.linalg.norm(flat[:, 0] - points, axis=1) <= off
    shape = KINDS[kind].shape
    at = np.tile(shape.corners.mean(axis=0), (len(flat), 1))
    for _ in range(STEPS):
        values, gradients = _basis(kind, at)
        away = points - np.einsum("mb,mbi->mi", values, flat)
        J = np.einsum("mbi,mbj->mij", flat, gradients)
        to = J.swapaxes(1, 2)
        step = np.linalg.solve(to @ J, to @ away[:, :, None])[:, :, 0]
        at = np.clip(at + step, -0.5, 1.5)
    missed = points - np.einsum("mb,mbi->mi", _basis(kind, at)[0], flat)
    inside = np.all((at >= -OFF) & (at <= 1.0 + OFF), axis=1)
    if shape is TRIANGLE:
        inside &= at.sum(axis=1) <= 1.0 + OFF
    return at, inside & (np.linalg.norm(missed, axis=1) <= off)


def _basis(kind: str, places: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Shape functions (m, b) and their gradients (m, b, d) at places (m, d)."""
    if kind == "node":
        return np.ones((len(places), 1)), np.zeros((len(places), 1, 0))
    return KINDS[kind].basis(np.asarray(places))
