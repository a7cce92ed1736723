"""Meshes of structures: cells of all kinds, named groups of cells, named points and faces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError, quoted
from fem.mesh.attachments import Attachments, LeftOut
from fem.mesh.cell_checks import cell_at, check_cells
from fem.mesh.cells import CUBE, KINDS, PYRAMID, TETRAHEDRON, TRIANGLE, WEDGE
from fem.mesh.checked_arrays import index_sets, numbers

POINTS, CELLS = " (points)", " (cells)"
"""After a name that a point set and a group share, to tell which is meant."""
SAME_PLACE = 1e-9  # of the mesh: distance of nodes that are merged, unless given


@dataclass(frozen=True, eq=False, repr=False)
class StructureMesh:
    """A mesh of lines, surfaces and volumes.

    Parameters
    ----------
    points
        Coordinates in m, shape (n, 3). Points on no cell may be points to which faces are
        coupled; the others do no harm.
    cells
        Node indices (e, b) by the kind of cell, such as "hexahedron20", in VTK's order.
    groups
        Cells by name: for each kind, indices into its array. A model names those that are its
        parts; the others name places, such as the triangles of a face.
    point_sets
        Node indices by name.
    source
        Where the mesh comes from; error texts begin with it.
    notes
        What a reader took otherwise than it stands in the file, a sentence each.
    attachments
        Masses, springs, couplings and equations that the file holds beside its cells.
    element_types
        Cells by the type that the file gives them, such as "B31" or "S8R".
    described
        Material and section of parts, by the name of the part, as far as the file gives them.
    left_out
        What the file holds and the mesh, by intention, does not.
    unit
        Unit of lengths that the file states, whatever the coordinates are taken to be in.

    Raises
    ------
    ModelError
        For an empty mesh, coordinates that are not finite, indices out of range, cells with the
        wrong number of nodes, with a node twice or with two nodes at one place, or second-order
        cells whose nodes are in another order.

    Examples
    --------
    >>> mesh = StructureMesh(
    ...     [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
    ...     {"quad": [[0, 1, 2, 3]], "line": [[0, 3]]},
    ...     {"sheet": {"quad": [0]}, "edge": {"line": [0]}},
    ... )
    >>> mesh
    <StructureMesh mesh: 4 points, 1 quad, 1 line; names: 'sheet', 'edge'>
    >>> mesh.nodes("edge")
    array([0, 3])
    """

    points: FloatArray
    cells: Mapping[str, IntArray]
    groups: Mapping[str, Mapping[str, IntArray]] = field(default_factory=dict)
    point_sets: Mapping[str, IntArray] = field(default_factory=dict)
    source: str = "mesh"
    notes: Sequence[str] = ()
    attachments: Attachments = field(default_factory=Attachments)
    element_types: Mapping[str, Mapping[str, IntArray]] = field(default_factory=dict)
    described: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    left_out: Sequence[LeftOut] = ()
    unit: str = ""

    def __post_init__(self) -> None:
        points = numbers(f"{self.source}: points", self.points, np.float64)
        cells = {
            str(kind): numbers(f"{self.source}: cells of kind {kind!r}", nodes, np.int64)
            for kind, nodes in self.cells.items()
            if len(nodes)
        }
        groups = {
            str(name): {
                kind: found
                for kind, found in index_sets(f"{self.source}: group {name!r}", group).items()
                if len(found)
            }
            for name, group in self.groups.items()
        }
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "cells", cells)
        object.__setattr__(self, "groups", groups)
        types = {
            str(name): index_sets(f"{self.source}: type {name!r}", found)
            for name, found in self.element_types.items()
        }
        object.__setattr__(self, "element_types", types)
        sets = index_sets(f"{self.source}: point", self.point_sets)
        object.__setattr__(self, "point_sets", sets)
        object.__setattr__(self, "notes", tuple(self.notes))
        self._check()

    def __repr__(self) -> str:
        cells = ", ".join(f"{len(nodes)} {kind}" for kind, nodes in self.cells.items())
        names = ", ".join(map(repr, self.names)) or "none"
        return f"<StructureMesh {self.source}: {len(self.points)} points, {cells}; names: {names}>"

    def part(self, name: str) -> Mapping[str, IntArray]:
        """Cells of a group by kind; a `ModelError` lists the groups if the name is unknown."""
        if name not in self.groups:
            raise ModelError(
                f"{self.source}: there is no part {name!r}; there are {quoted(self.groups)}"
            )
        return self.groups[name]

    @property
    def names(self) -> list[str]:
        """All names that stand for nodes: of point sets and of groups."""
        return list(dict.fromkeys([*self.point_sets, *self.groups]))

    def nodes(self, name: str) -> IntArray:
        """Nodes of a point set or of the cells of a group, in ascending order.

        Raises
        ------
        ModelError
            If there is neither of the name, both with other nodes, or it is empty. ``NAME
            (points)`` and ``NAME (cells)`` tell the two apart.
        """
        if name in self.point_sets:
            found = self.point_sets[name]
            self._check_one_meaning(name)
        elif name in self.groups:
            found = self._nodes_of_group(name)
        elif name.removesuffix(POINTS) in self.point_sets:
            found = self.point_sets[name.removesuffix(POINTS)]
        elif name.removesuffix(CELLS) in self.groups:
            found = self._nodes_of_group(name.removesuffix(CELLS))
        else:
            raise ModelError(
                f"{self.source}: there is no point or face {name!r}; there are {quoted(self.names)}"
            )
        if len(found) == 0:
            raise ModelError(f"{self.source}: {name!r} holds no node")
        return found

    def _nodes_of_group(self, name: str) -> IntArray:
        cells = [self.cells[kind][at].ravel() for kind, at in self.groups[name].items()]
        return np.unique(np.concatenate(cells)) if cells else np.zeros(0, dtype=np.int64)

    def _check_one_meaning(self, name: str) -> None:
        """Refuse a name of a point set and of a group of cells that have other nodes."""
        if name in self.groups:
            points, group = self.point_sets[name], self._nodes_of_group(name)
            if not np.array_equal(points, group):
                raise ModelError(
                    f"{self.source}: {name!r} means two things, a set of {len(points)} points and a"
                    f" group of cells with {len(group)} nodes; use {name + POINTS!r} or"
                    f" {name + CELLS!r}"
                )

    def node(self, name: str) -> int:
        """The one node of a name; a `ModelError` says so if it holds more."""
        found = self.nodes(name)
        if len(found) != 1:
            raise ModelError(
                f"{self.source}: {name!r} must be a single point, but holds {len(found)} nodes;"
                " couple them to a point"
            )
        return int(found[0])

    @cached_property
    def size(self) -> float:
        """The longest side of the box around the points, in m."""
        return float(np.ptp(self.points, axis=0).max())

    def with_points(self, points: npt.ArrayLike) -> StructureMesh:
        """The same cells and names on other coordinates, shape (n, 3) in m."""
        return replace(self, points=np.asarray(points, dtype=np.float64))

    def with_point_sets(self, sets: Mapping[str, npt.ArrayLike]) -> StructureMesh:
        """The same mesh with further point sets, or others of the same names.

        Examples
        --------
        >>> mesh = box_mesh("block", (0.2, 0.1, 0.1), (2, 1, 1))
        >>> tip = np.flatnonzero(mesh.points[:, 0] > 0.1999)
        >>> len(mesh.with_point_sets({"tip": tip}).nodes("tip"))
        8
        """
        return replace(self, point_sets={**self.point_sets, **sets})  # type: ignore[dict-item]

    def _check(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise ModelError(
                f"{self.source}: points must have shape (n, 3), not {self.points.shape}"
            )
        if len(self.points) == 0 or not self.cells:
            raise ModelError(f"{self.source}: the mesh is empty (no cells)")
        bad = np.flatnonzero(~np.isfinite(self.points).all(axis=1))
        if len(bad):
            raise ModelError(
                f"{self.source}: the coordinates of node {bad[0]} are not finite numbers"
            )
        for kind, cells in self.cells.items():
            self._check_cells(kind, cells)
        for name, group in self.groups.items():
            for kind, found in group.items():
                if kind not in self.cells:
                    raise ModelError(
                        f"{self.source}: group {name!r} names cells of kind {kind!r},"
                        f" but there are {quoted(self.cells)}"
                    )
                self._check_range(f"group {name!r}", found, len(self.cells[kind]))
        for name, nodes in self.point_sets.items():
            self._check_range(f"point set {name!r}", nodes, len(self.points))

    def _check_cells(self, kind: str, cells: IntArray) -> None:
        if cells.ndim != 2:
            raise ModelError(
                f"{self.source}: cells of kind {kind!r} must have shape (e, b), not {cells.shape}"
            )
        self._check_range(f"cells of kind {kind!r}", cells, len(self.points))
        if kind not in KINDS:
            return
        count = KINDS[kind].node_count
        if cells.shape[1] != count:
            raise ModelError(
                f"{self.source}: a cell of kind {kind!r} has {count} nodes, not {cells.shape[1]}"
            )
        check_cells(self.source, kind, cells, self.points)

    def where(self, kind: str, cell: int) -> str:
        """A cell by its kind, number and place, for error texts.

        Examples
        --------
        >>> box_mesh("plate", (1.0, 1.0), (2, 2), kind="quad").where("quad", 3)
        'quad 3 at (0.75, 0.75, 0)'
        """
        return cell_at(kind, cell, self.points[self.cells[kind][cell]])

    def _check_range(self, what: str, indices: IntArray, count: int) -> None:
        if indices.size and not (indices.min() >= 0 and indices.max() < count):
            raise ModelError(f"{self.source}: {what} has an index outside 0 to {count - 1}")


def joined(meshes: Sequence[StructureMesh], tolerance: float | None = None) -> StructureMesh:
    """One mesh of several, in which nodes at the same place are one node.

    Parameters
    ----------
    meshes
        Groups and point sets of the same name are united.
    tolerance
        Distance in m below which nodes are one; by default 1e-9 of the size of the whole.

    Returns
    -------
    StructureMesh
        Its notes tell how many nodes are gone, and how far away those are that stand for them.

    Raises
    ------
    ModelError
        If a spring or damper is between nodes that become one.

    Examples
    --------
    >>> left = box_mesh("left", (1.0, 1.0, 1.0), (1, 1, 1))
    >>> right = box_mesh("right", (1.0, 1.0, 1.0), (1, 1, 1), origin=(1.0, 0.0, 0.0))
    >>> len(joined([left, right]).points)
    32
    """
    if not meshes:
        raise ModelError("there are no meshes to join")
    points = np.concatenate([mesh.points for mesh in meshes])
    number, kept = _merged(points, tolerance)
    cells: dict[str, list[IntArray]] = {}
    groups: dict[str, dict[str, list[IntArray]]] = {}
    types: dict[str, dict[str, list[IntArray]]] = {}
    _check_attached_names(meshes)
    sets: dict[str, list[IntArray]] = {}
    first = 0
    for mesh in meshes:
        before = {kind: sum(len(block) for block in blocks) for kind, blocks in cells.items()}
        for kind, nodes in mesh.cells.items():
            cells.setdefault(kind, []).append(number[nodes + first])
        for named, into in ((mesh.groups, groups), (mesh.element_types, types)):
            for name, group in named.items():
                for kind, found in group.items():
                    blocks = into.setdefault(name, {}).setdefault(kind, [])
                    blocks.append(found + before.get(kind, 0))
        for name, nodes in mesh.point_sets.items():
            sets.setdefault(name, []).append(number[nodes + first])
        _check_links(mesh, number[first : first + len(mesh.points)])
        first += len(mesh.points)
    moved = np.linalg.norm(points - points[kept][number], axis=1).max()
    said = f"{len(points) - len(kept)} nodes are merged into others, at most {moved:.3g} m away"
    return StructureMesh(
        points[kept],
        {kind: np.concatenate(blocks) for kind, blocks in cells.items()},
        _in_one(groups),
        {name: np.concatenate(nodes) for name, nodes in sets.items()},
        " + ".join(dict.fromkeys(mesh.source for mesh in meshes)),
        notes=[*(note for mesh in meshes for note in mesh.notes), said],
        attachments=sum((mesh.attachments for mesh in meshes), Attachments()),
        element_types=_in_one(types),
        described={name: keys for mesh in meshes for name, keys in mesh.described.items()},
        left_out=[item for mesh in meshes for item in mesh.left_out],
    )


def _in_one(
    named: Mapping[str, Mapping[str, Sequence[IntArray]]],
) -> dict[str, dict[str, IntArray]]:
    return {
        name: {kind: np.concatenate(blocks) for kind, blocks in group.items()}
        for name, group in named.items()
    }


def _check_attached_names(meshes: Sequence[StructureMesh]) -> None:
    """Refuse points of attachments that another mesh has a name for, too."""
    for mesh in meshes:
        names = set(mesh.attachments.points)
        for other in meshes:
            both = sorted(names & set(other.names)) if other is not mesh else []
            if both:
                raise ModelError(
                    f"{mesh.source}: something is attached to {both[0]!r}, and {other.source} has"
                    " this name, too; rename one of them before they are joined"
                )


def _check_links(mesh: StructureMesh, number: IntArray) -> None:
    """Refuse springs and dampers whose two nodes get one number."""
    lost = []
    for link in mesh.attachments.links:
        ends = [mesh.node(point) for point in link.points]
        if len(set(ends)) > len(set(number[ends].tolist())):
            lost.append(f"{link.first!r} and {link.second!r}")
    if lost:
        pairs = list(dict.fromkeys(lost))
        told = "; ".join(pairs[:5]) + ("; ..." if len(pairs) > 5 else "")
        raise ModelError(
            f"{mesh.source}: {len(lost)} springs or dampers are between nodes that are merged into"
            f" one, where they would do nothing: {told}; do without 'merge' or without these"
        )


def _merged(points: FloatArray, tolerance: float | None) -> tuple[IntArray, IntArray]:
    """New number of every point, and which points are kept."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    near = SAME_PLACE * float(np.ptp(points, axis=0).max()) if tolerance is None else tolerance
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
    count = len(points)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, label = connected_components(links, directed=False)
    _, kept, number = np.unique(label, return_index=True, return_inverse=True)
    return np.asarray(number, dtype=np.int64), np.asarray(kept, dtype=np.int64)


def box_mesh(
    part: str,
    lengths: Sequence[float],
    counts: Sequence[int],
    *,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    kind: str | None = None,
    source: str = "box_mesh",
) -> StructureMesh:
    """A rectangle or a block of equal cells, for tests and first trials.

    Its faces are the point sets "x0", "x1", "y0", ... for the lowest and highest coordinate.

    Parameters
    ----------
    part
        Name of the group of all cells.
    lengths
        Along x and y (a rectangle in the plane), or x, y and z, in m.
    counts
        Number of cells in each direction; for other kinds than quadrilaterals and hexahedra, of
        the boxes that are cut into 2 triangles, 2 wedges along z, 6 tetrahedra, or 6 pyramids
        with their apex in the middle.
    origin
        The corner with the lowest coordinates.
    kind
        Any kind of cell of the dimension; by default "quad8" or "hexahedron20".
    source
        Name of the mesh in error texts.

    Raises
    ------
    ModelError
        For an unknown kind, or lengths and counts that are not positive or do not match it.

    Examples
    --------
    >>> box_mesh("plate", (1.0, 1.0), (2, 2)).cells["quad8"].shape
    (4, 8)
    """
    dimension = len(lengths)
    name = kind or {2: "quad8", 3: "hexahedron20"}.get(dimension, "")
    if name not in KINDS or KINDS[name].dimension != dimension or len(counts) != dimension:
        raise ModelError(
            f"{source}: lengths {list(lengths)}, counts {list(counts)} and kind {name!r} do not"
            " agree on two or three directions"
        )
    if min(lengths) <= 0.0 or min(counts) < 1:
        raise ModelError(f"{source}: lengths and counts must be positive")
    wanted = KINDS[name]
    corner = np.stack(np.meshgrid(*[np.arange(c) for c in counts], indexing="ij"), axis=-1)
    boxes = corner.reshape(-1, dimension)
    unit = _unit_cells(name)
    places = (boxes[:, None, None, :] + unit).reshape(-1, *unit.shape[1:])
    quarters = np.rint(4 * places.reshape(-1, dimension)).astype(np.int64)
    grid, inverse = np.unique(quarters, axis=0, return_inverse=True)
    points = np.zeros((len(grid), 3))
    points[:, :dimension] = grid / 4.0 * (np.asarray(lengths) / np.asarray(counts))
    sets = {
        f"{axis}{side}": np.flatnonzero(grid[:, i] == 4 * side * counts[i])
        for i, axis in enumerate("xyz"[:dimension])
        for side in (0, 1)
    }
    cells = inverse.reshape(-1, wanted.node_count)
    return StructureMesh(
        points + np.asarray([*origin, 0.0, 0.0][:3], dtype=np.float64),
        {name: cells},
        {part: {name: np.arange(len(cells))}},
        sets,
        source,
    )


def _unit_cells(name: str) -> FloatArray:
    """Nodes of the cells that fill the unit box, shape (cells, b, d)."""
    kind = KINDS[name]
    return kind.filled(_UNIT_CORNERS.get(kind.shape, kind.corners[None]))


_HALVES = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], dtype=np.float64)
_ALONG = ((0, 1, 2), (1, 2, 0), (2, 0, 1), (0, 2, 1), (2, 1, 0), (1, 0, 2))


def _kuhn() -> FloatArray:
    """Corners of Kuhn's six tetrahedra around the diagonal: they match from box to box."""
    paths = [np.cumsum([np.zeros(3), *np.eye(3)[list(order)]], axis=0) for order in _ALONG]
    return np.array([p if i < 3 else p[[0, 2, 1, 3]] for i, p in enumerate(paths)])


_UNIT_CORNERS = {
    TRIANGLE: _HALVES,
    TETRAHEDRON: _kuhn(),
    WEDGE: np.stack([np.vstack([np.insert(t, 2, z, axis=1) for z in (0, 1)]) for t in _HALVES]),
    PYRAMID: np.stack(
        [np.vstack([CUBE.corners[list(face[::-1])], np.full(3, 0.5)]) for face in CUBE.faces]
    ),
}
"""Corners of the cells (cells, c, d) that fill the unit box, by their shape."""
