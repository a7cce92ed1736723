"""The surface of a structure: faces of solids, shells, and cross-sections swept along beams."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fem.assembly.component import Component
from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.elements.beams import local_axes, run, to_nodes
from fem.elements.straight_beams import hermite
from fem.elements.tapers import along
from fem.elements.trusses import chords
from fem.mesh.cells import KINDS, SPANS
from fem.model.parts import BeamPart
from fem.model.structure import AXES, IN_PLANE, StructureModel, axis_index
from fem.render.swept import BoolArray, PartSurface, open_ends, outline

SHARP_DEGREES = 30.0
ON_PLANE = 1e-9  # of the size: so near to a mirror a node lies on it
PIECES: dict[str, tuple[tuple[int, ...], ...]] = {
    **SPANS,
    "triangle": ((0, 1, 2),),
    "triangle6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad": ((0, 1, 2, 3),),
    "quad8": ((0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3)),
    "quad9": ((0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3)),
}
"""How a facet of a kind is cut into flat polygons; 8 is the middle of one with eight nodes."""
BEHIND = 2e-3
"""An undeformed plane structure is drawn this part of its size behind the deflected one."""


@dataclass(frozen=True, eq=False)
class StructureSurface:
    """The surface of a whole structure, made by `structure_surface`.

    The points are first the nodes of the solids' faces and of shells, then the middles of the faces
    with eight nodes, then those of the beams, part by part; where it is repeated in a mirror, the
    same again.

    Parameters
    ----------
    component
        The assembled structure.
    nodes
        Nodes of the mesh on the solids' faces and on shells, shape (p,).
    eights
        Faces with eight nodes, as positions among `nodes`, shape (c, 8).
    polygons, sharp
        The faces cut into polygons, and pairs of points along sharp edges.
    beams
        Names of beam parts and how they are swept.
    mirror
        None, or a point (3,) and a unit normal (3,) of the plane in which all is repeated.
    """

    component: Component
    nodes: IntArray
    eights: IntArray
    polygons: tuple[IntArray, ...]
    sharp: IntArray
    beams: tuple[tuple[str, PartSurface], ...]
    mirror: tuple[FloatArray, FloatArray] | None = None

    def place(
        self, u: FloatArray, scale: float = 1.0, shrinkage: float = 1.0
    ) -> tuple[FloatArray, FloatArray]:
        """Points of the deflected surface.

        The sections of beams stay across the drawn axis and keep their size at any scale.

        Parameters
        ----------
        u
            Displacements of the free degrees of freedom, shape (N,).
        scale
            Factor on the displacements.
        shrinkage
            Factor on the sections of beams; solids keep their size.

        Returns
        -------
        points, displacement
            In m, shape (P, 3), and the length of the displacement in m, not scaled, shape (P,);
            that of a beam is of its axis.
        """
        moved = self.with_middles(self.component.shape(u)[self.nodes, :3])
        rest = self.with_middles(self.component.model.mesh.points[self.nodes])
        if self.component.model.plane and shrinkage < 1.0:
            rest = rest - np.array([0.0, 0.0, BEHIND * self.component.model.mesh.size])
        points = [rest + scale * moved]
        size = [np.linalg.norm(moved, axis=1)]
        for name, swept in self.beams:
            at, displacement = self._sweep(name, swept, u, scale, shrinkage)
            points.append(at)
            size.append(displacement)
        if self.mirror is not None:
            points.append(reflected(np.concatenate(points), *self.mirror))
        return np.concatenate(points), self.with_image(np.concatenate(size))

    def with_image(self, values: FloatArray) -> FloatArray:
        """Values of points, and again those of their images."""
        return values if self.mirror is None else np.concatenate([values, values])

    def with_middles(self, values: FloatArray) -> FloatArray:
        """Values at `nodes` (p, ...), followed by those in the middle of the faces of `eights`.

        The middle has half of the sum over the edges less a quarter of that over the corners, as
        the shape functions of eight nodes say.
        """
        corners, edges = values[self.eights[:, :4]], values[self.eights[:, 4:]]
        middle = edges.sum(axis=1) / 2.0 - corners.sum(axis=1) / 4.0
        return np.concatenate([values, middle])

    def faces(self) -> list[IntArray]:
        """Arrays of polygons, each of shape (f, number of corners)."""
        swept = (part.faces() for _, part in self.beams)
        return self._with_images([*self.polygons, *self._shifted(swept)])

    def edges(self) -> list[IntArray]:
        """Arrays of index pairs of the sharp edges, each of shape (f, 2)."""
        swept = (part.edges() for _, part in self.beams)
        return self._with_images([self.sharp, *self._shifted(swept)])

    @cached_property
    def starts(self) -> IntArray:
        """Index of the first point of every beam part, and of the image of all."""
        counts = [int(np.prod(part.shape)) for _, part in self.beams]
        first = len(self.nodes) + len(self.eights)
        return first + np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)

    def sections_at(self, node: int) -> FloatArray:
        """Corners (c, 3) of the sections of the lines that end at a node, at rest, from there."""
        rest, _ = self.place(np.zeros(len(self.component.free)))
        found = [np.zeros((0, 3))]
        for (name, swept), start in zip(self.beams, self.starts, strict=False):
            index = start + np.arange(np.prod(swept.shape)).reshape(swept.shape)
            lines = swept_parts(self.component.model)[name][1]
            found += [rest[index[line, -end]] for line, end in np.argwhere(lines == node)]
        return np.asarray(np.concatenate(found) - self.component.model.mesh.points[node])

    def _with_images(self, cells: list[IntArray]) -> list[IntArray]:
        return cells if self.mirror is None else cells + [each + self.starts[-1] for each in cells]

    def _shifted(self, cells: Iterator[Iterator[IntArray]]) -> Iterator[IntArray]:
        for arrays, start in zip(cells, self.starts, strict=False):
            for array in arrays:
                yield array + start

    def _sweep(
        self, name: str, swept: PartSurface, u: FloatArray, scale: float, shrinkage: float
    ) -> tuple[FloatArray, FloatArray]:
        model = self.component.model
        part, lines = swept_parts(model)[name]
        start = model.mesh.points[lines[:, 0]]
        spans = model.mesh.points[lines[:, 1]] - start
        what = f"{model.mesh.source}: part {name!r}"
        axes = local_axes(part, spans, what)
        spans = run(part, spans, what)
        if part.end_offsets is not None:
            start = start + np.array(part.end_offsets)[..., 0, :]
        ends = line_shape(self.component, u, name).reshape(-1, 12)
        local = np.einsum("eij,ej->ei", to_nodes(part, axes), ends)
        moved, slope, twist = local_deflection(local, np.linalg.norm(spans, axis=1), swept.places)
        offset = np.array([0.0, *part.offset])
        along = np.zeros((len(lines), len(swept.places), 3))
        along[..., 0] = swept.places * np.linalg.norm(spans, axis=1)[:, None]
        axis = along + offset + scale * moved
        frame = section_frames(scale * slope, scale * twist)
        corners = np.broadcast_to(shrinkage * swept.outline, (*swept.shape, 2))
        local_points = axis[:, :, None, :] + np.einsum("emkc,emcj->emkj", corners, frame)
        points = start[:, None, None, :] + np.einsum("emkj,ejx->emkx", local_points, axes)
        size = np.repeat(np.linalg.norm(moved, axis=-1)[..., None], swept.shape[2], axis=-1)
        return points.reshape(-1, 3), size.ravel()


def swept_parts(model: StructureModel) -> dict[str, tuple[BeamPart, IntArray]]:
    """Beam parts, and trusses as round bars, with the node pairs (e, 2) of their lines."""
    bars = {
        name: (
            BeamPart(part.material, part.section),
            np.concatenate([chords(nodes) for nodes in kinds.values()]),
        )
        for name, (part, kinds) in model.trusses.items()
    }
    return {**model.beams, **bars}


def line_shape(component: Component, u: FloatArray, name: str) -> FloatArray:
    """Six displacements at both ends of lines, (e, 2, 6); a truss turns as its ends move."""
    model = component.model
    if name in model.beams:
        return component.element_shape(u, name)
    lines = swept_parts(model)[name][1]
    ends = component.shape(u)[lines]
    span = model.mesh.points[lines[:, 1]] - model.mesh.points[lines[:, 0]]
    turn = np.cross(span, ends[:, 1, :3] - ends[:, 0, :3])
    ends[:, :, 3:] = (turn / np.sum(span**2, axis=1)[:, None])[:, None]
    return ends


def local_deflection(
    local: FloatArray, lengths: FloatArray, s: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Displacement and slope of the axis (e, m, 3) and twist (e, m) at places s (m,).

    ``local`` (e, 12) are translations and rotations in local axes at both ends.
    """
    L = lengths[:, None]
    u = local[:, :1] * (1 - s) + local[:, 6:7] * s
    stretch = np.broadcast_to((local[:, 6:7] - local[:, :1]) / L, u.shape)
    v = np.concatenate([local[:, [1]], L * local[:, [5]], local[:, [7]], L * local[:, [11]]], 1)
    w = np.concatenate([local[:, [2]], -L * local[:, [4]], local[:, [8]], -L * local[:, [10]]], 1)
    cubics, slopes = hermite(s)
    moved = np.stack([u, v @ cubics, w @ cubics], axis=-1)
    turns = (v @ slopes / L, w @ slopes / L)
    twist = local[:, 3:4] * (1 - s) + local[:, 9:10] * s
    return moved, np.stack([stretch, *turns], axis=-1), twist


def section_frames(slope: FloatArray, twist: FloatArray) -> FloatArray:
    """Unit vectors along height and width of turned sections, (e, m, 2, 3), in local axes."""
    tangent = np.array([1.0, 0.0, 0.0]) + slope
    tangent = tangent / np.linalg.norm(tangent, axis=-1, keepdims=True)
    height = np.zeros_like(tangent)
    height[..., 1], height[..., 2] = np.cos(np.arctan(twist)), np.sin(np.arctan(twist))
    height = height - np.sum(height * tangent, axis=-1, keepdims=True) * tangent
    height = height / np.linalg.norm(height, axis=-1, keepdims=True)
    return np.stack([height, np.cross(tangent, height)], axis=-2)


def structure_surface(
    component: Component, mirror: str | None = None, places: int | None = None
) -> StructureSurface:
    """The surface of a structure, with the true sections of its beams.

    A shell is drawn as the surface through its nodes, without its thickness; a truss as a round
    bar.

    Parameters
    ----------
    component
        The assembled structure.
    mirror
        A point or face on a plane of symmetry, to draw a half model whole. The supports there must
        hold what `fem.symmetry` does and so say which way the plane lies.
    places
        How many places along each line of beams; by default as many as make the whole smooth.

    Raises
    ------
    ModelError
        If there is no such point, or no support makes it one of a plane of symmetry.

    Examples
    --------
    >>> import fem
    >>> model = fem.StructureModel(
    ...     fem.box_mesh("bar", (1.0, 0.1, 0.1), (2, 1, 1)),
    ...     {"bar": fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))},
    ... )
    >>> surface = structure_surface(fem.assemble(model))
    >>> points, _ = surface.place(np.zeros(len(surface.component.free)))
    >>> points.max(axis=0).tolist()
    [1.0, 0.1, 0.1]
    """
    model = component.model
    plane = None if mirror is None else symmetry_plane(component, mirror)
    joined = nodes_on(model.mesh.points, plane)
    facets = {
        kind: cells[~joined[cells].all(axis=1)] for kind, cells in drawn_facets(component).items()
    }
    used = [np.unique(cells) for cells in facets.values()]
    nodes = np.unique(np.concatenate(used)) if used else np.zeros(0, dtype=np.int64)
    position = np.full(len(model.mesh.points), -1)
    position[nodes] = np.arange(len(nodes))
    eights = position[facets.get("quad8", np.zeros((0, 8), dtype=np.int64))]
    middles = len(nodes) + np.arange(len(eights))
    polygons = tuple(
        (np.column_stack([position[cells], middles]) if kind == "quad8" else position[cells])[
            :, list(piece)
        ]
        for kind, cells in facets.items()
        for piece in PIECES[kind]
    )
    ends = sharp_edges(facets, model.mesh.points)
    sharp = position[ends[~joined[ends].all(axis=1)]]
    lines = sum(len(pairs) for _, pairs in swept_parts(model).values())
    if places is None:
        places = int(np.clip(600 // max(lines, 1), 4, 32)) + 1
    s = np.linspace(0.0, 1.0, places)
    beams = tuple(_beams(component, s, joined))
    return StructureSurface(component, nodes, eights, polygons, sharp, beams, plane)


def _beams(
    component: Component, s: FloatArray, joined: BoolArray
) -> Iterator[tuple[str, PartSurface]]:
    for name, (part, lines) in swept_parts(component.model).items():
        shape = outline(along(part, component.model.mesh, lines, f"part {name!r}", s).section)
        yield name, PartSurface(len(lines), shape, s, open_ends(lines, joined))


def drawn_facets(component: Component) -> dict[str, IntArray]:
    """The outer faces of solids, or the cells themselves of solids in the plane and of shells."""
    model = component.model
    flat = [*(model.solids.values() if model.plane else ()), *model.shells.values()]
    found: dict[str, list[IntArray]] = {}
    for kinds in ({} if model.plane else model.facets, *(kinds for _, kinds in flat)):
        for kind, cells in kinds.items():
            found.setdefault(kind, []).append(cells)
    return {kind: np.concatenate(blocks) for kind, blocks in found.items()}


def sharp_edges(facets: dict[str, IntArray], points: FloatArray) -> IntArray:
    """Pairs of nodes (f, 2) along the edges at which the surface ends or turns by 30°."""
    pairs, middles, normals = [], [], []
    for kind, cells in facets.items():
        cell = KINDS[kind]
        corners = points[cells[:, : len(cell.corners)]]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normal = normal / np.linalg.norm(normal, axis=1)[:, None]
        for index, (a, b) in enumerate(cell.edges):
            middle = cells[:, len(cell.corners) + index] if cell.order == 2 else cells[:, b]
            pairs.append(np.sort(cells[:, [a, b]], axis=1))
            middles.append(middle)
            normals.append(normal)
    if not pairs:
        return np.zeros((0, 2), dtype=np.int64)
    ends, middle, normal = (np.concatenate(blocks) for blocks in (pairs, middles, normals))
    key = ends[:, 0] * (ends.max() + 1) + ends[:, 1]
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(key[order]) != 0))
    count = np.diff(np.append(first, len(order)))
    one, other = normal[order[first]], normal[order[first + count - 1]]
    turned = np.abs(np.sum(one * other, axis=1)) < np.cos(np.radians(SHARP_DEGREES))
    kept = order[first[(count == 1) | turned]]
    halves = [
        np.stack([ends[kept, 0], middle[kept]], axis=1),
        np.stack([middle[kept], ends[kept, 1]], axis=1),
    ]
    found = np.concatenate(halves)
    return np.asarray(found[found[:, 0] != found[:, 1]], dtype=np.int64)


def symmetry_plane(component: Component, name: str) -> tuple[FloatArray, FloatArray]:
    """Point (3,) and unit normal (3,) of the plane of symmetry that the supports make somewhere."""
    model = component.model
    normal = symmetry_normal(component, name)
    if normal is None:
        told = "('x', 'rotation') or ('y', 'rotation')" if model.plane else "what fem.symmetry does"
        raise ModelError(
            f"{model.mesh.source}: {name!r} is not on a plane of symmetry, where supports hold"
            f" {told}"
        )
    return model.mesh.points[model.mesh.nodes(name)[0]], normal


def symmetry_normal(component: Component, name: str) -> FloatArray | None:
    """Unit normal (3,) of the plane of symmetry that the supports at a name make, if they do.

    They hold what `fem.symmetry` does and no more; nodes that do not turn need no hold of it.
    """
    model = component.model
    nodes = model.mesh.nodes(name)
    turning = (component.numbering.rotation[nodes] >= 0).any()
    held = {
        AXES[axis_index(direction)]
        for support in model.attached.supports
        if np.isin(nodes, model.mesh.nodes(support.point)).all()
        for direction in support.directions
    }
    for index, axis in enumerate("xy" if model.plane else "xyz"):
        mirrored = {axis, *(f"rotation_{other}" for other in "xyz" if other != axis)}
        known = mirrored.intersection(IN_PLANE) if model.plane else mirrored
        if (known if turning else {axis}) <= held <= known:
            return np.asarray(np.eye(3)[index])
    return None


def nodes_on(points: FloatArray, plane: tuple[FloatArray, FloatArray] | None) -> BoolArray:
    """Which points (n, 3) lie on a plane given by a point and a unit normal, shape (n,)."""
    if plane is None:
        return np.zeros(len(points), dtype=np.bool_)
    distance = np.abs((points - plane[0]) @ plane[1])
    return np.asarray(distance < ON_PLANE * np.linalg.norm(np.ptp(points, axis=0)), dtype=np.bool_)


def reflected(points: FloatArray, origin: FloatArray, normal: FloatArray) -> FloatArray:
    """Points (P, 3) reflected in the plane through a point (3,) with a unit normal (3,)."""
    return points - 2.0 * ((points - origin) @ normal)[:, None] * normal
