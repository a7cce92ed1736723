"""Whether cells that lie against each other have the same nodes there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.cell_checks import cell_at
from fem.mesh.cells import KINDS
from fem.mesh.pieces import COINCIDENT, place_of
from fem.mesh.shell_facets import facets_of
from fem.model.parts import ShellPart
from fem.model.structure import StructureModel, occurrences

BoolArray = npt.NDArray[np.bool_]
Sides = tuple[IntArray, IntArray, IntArray]
"""Corners of facets, and the kinds and numbers of their cells."""

NAMES = tuple(KINDS)

LEAST_OVERLAP = 1e-3
"""Width of an overlap that counts, relative to the smaller of the two facets."""
FACING = 10.0
"""What a difference of 1 between unit normals counts as, in radii of the facets."""


@dataclass(frozen=True, eq=False)
class Facets:
    """Straight edges or flat faces of cells; a triangle has its last corner twice.

    Parameters
    ----------
    nodes
        Corners, shape (f, c) with c = 2 or 4.
    kinds, numbers
        Place in `NAMES` and number of the cell that each is of, shape (f,).
    outer
        Whether no second cell has the same corners, shape (f,).
    places
        Of the corners in m, shape (f, c, 3).
    normals
        Unit vectors out of the cell, shape (f, 3); zero for the edges of shells.
    """

    nodes: IntArray
    kinds: IntArray
    numbers: IntArray
    outer: BoolArray
    places: FloatArray
    normals: FloatArray

    def __getitem__(self, at: IntArray | BoolArray) -> Facets:
        return Facets(*(getattr(self, entry.name)[at] for entry in fields(self)))

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def centres(self) -> FloatArray:
        """Means of the corners, shape (f, 3)."""
        return np.asarray(self.places.mean(axis=1), dtype=np.float64)

    @property
    def radii(self) -> FloatArray:
        """Distances of the farthest corners from the centres, shape (f,)."""
        away = np.linalg.norm(self.places - self.centres[:, None], axis=2)
        return np.asarray(away.max(axis=1), dtype=np.float64)


class Boundary(NamedTuple):
    """Where cells may lie against others; None without solids, without shells.

    Parameters
    ----------
    outer
        The outer faces of solids; in the plane, their outer edges.
    edges
        The edges of shells, each once.
    """

    outer: Facets | None
    edges: Facets | None


def boundary(model: StructureModel) -> Boundary:
    """The outer faces and the edges of a structure."""
    return Boundary(outer_facets(model), facets_of_shells(model))


def check_nothing_hangs(model: StructureModel, looked_at: Boundary) -> None:
    """Refuse cells that lie against each other but do not have the same nodes there.

    Looked at are the flat outer faces of solids, in the plane their straight outer edges, and the
    free edges of shells against all edges of shells. Left out are those of which couplings or
    equations hold all nodes that the other side has not, and slits, where the nodes of both sides
    are at the same places.

    Raises
    ------
    ModelError
        With how many faces or edges there are, and the place and both cells of one.

    Notes
    -----
    Where one cell lies against two, or two against three, the nodes between are joined to one side
    only: the body has a gap there that opens as it moves.

    Examples
    --------
    >>> import fem
    >>> plates = [
    ...     fem.box_mesh("plate", (1.0, 1.0), (1, n), kind="quad", origin=(x, 0.0, 0.0))
    ...     for x, n in ((0.0, 1), (1.0, 2))
    ... ]
    >>> part = {"plate": fem.ShellPart(fem.Material(2.1e11, 7800.0, 0.3), 0.01)}
    >>> model = fem.StructureModel(fem.joined(plates), part)
    >>> try:
    ...     check_nothing_hangs(model, boundary(model))
    ... except fem.ModelError as error:
    ...     print(str(error).split("; ")[0].split(": ", 1)[1])
    3 edges lie against others without having their nodes, the first at (1, 0.25, 0), between \
quad 0 at (0.5, 0.5, 0) and quad 1 at (1.5, 0.25, 0)
    """
    if model.separate:
        return
    for facets in looked_at:
        if facets is not None:
            _refuse(model, facets)


def _refuse(model: StructureModel, facets: Facets) -> None:
    held = held_nodes(model)
    tolerance = COINCIDENT * model.mesh.size
    found = [np.empty((0, 2), dtype=np.int64)]
    for pairs in _near(facets, tolerance):
        one, other = facets[pairs[:, 0]], facets[pairs[:, 1]]
        found.append(pairs[_misfit(one, other, held, tolerance)])
    pairs = np.concatenate(found)
    if not len(pairs):
        return
    met = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))[0]]
    first, second = met[np.lexsort((facets.numbers[met], facets.kinds[met]))]
    smaller = met[facets[met].radii.argmin()]
    raise ModelError(
        f"{model.mesh.source}: {len(np.unique(pairs))} {'edges' if _lines(facets) else 'faces'} lie"
        " against others without having their nodes, the first at"
        f" {place_of(facets.centres[smaller])}, between {told_cell(model, facets, first)} and"
        f" {told_cell(model, facets, second)}; give both sides the same nodes, or say that they are"
        " not joined there ('separate')"
    )


def told_cell(model: StructureModel, facets: Facets, at: int) -> str:
    kind, number = NAMES[facets.kinds[at]], int(facets.numbers[at])
    return cell_at(kind, number, model.mesh.points[model.mesh.cells[kind][number]])


def held_nodes(model: StructureModel) -> BoolArray:
    """Whether couplings or equations say how each node moves, shape (n,)."""
    held = np.zeros(len(model.mesh.points), dtype=np.bool_)
    for coupling in model.attached.couplings:
        held[model.mesh.nodes(coupling.face)] = True
    for equation in model.attached.equations:
        held[[model.mesh.node(point) for point in equation.points]] = True
    return held


def outer_facets(model: StructureModel) -> Facets | None:
    """The outer faces of solids; in the plane, their outer edges."""
    by_corners: dict[int, list[Sides]] = {}
    for name, (_, kinds) in model.solids.items():
        for kind, cells in kinds.items():
            for facet, nodes in KINDS[kind].facets_of(cells).items():
                corners = nodes[:, : len(KINDS[facet].corners)]
                sides = _sides(kind, model.mesh.part(name)[kind], corners)
                by_corners.setdefault(corners.shape[1], []).append(sides)
    found = []
    for blocks in by_corners.values():
        facets = _once(model, blocks)
        found.append(_with_normals(model, facets[facets.outer]))
    return _joined(found) if found else None


def facets_of_shells(model: StructureModel) -> Facets | None:
    """The edges of shells, each once."""
    blocks = []
    for name, part in model.parts.items():
        if isinstance(part, ShellPart):
            for kind, at in model.mesh.part(name).items():
                for facet, nodes in facets_of({kind: model.mesh.cells[kind][at]}).items():
                    blocks.append(_sides(kind, at, KINDS[facet].facets_of(nodes)["line"]))
    return _once(model, blocks) if blocks else None


def _sides(kind: str, cells: IntArray, nodes: IntArray) -> Sides:
    """Facets of cells, as many of each, by their corners, with the kind and number of the cell."""
    numbers = np.repeat(cells, len(nodes) // len(cells))
    return nodes, np.full(len(nodes), NAMES.index(kind)), numbers


def _once(model: StructureModel, blocks: list[Sides]) -> Facets:
    """Each facet once, without normals."""
    nodes, kinds, numbers = (np.concatenate(column) for column in zip(*blocks, strict=True))
    first, count = occurrences(nodes)
    corners = nodes[first]
    if corners.shape[1] == 3:
        corners = corners[:, [0, 1, 2, 2]]
    normals = np.zeros((len(first), 3))
    places = model.mesh.points[corners]
    return Facets(corners, kinds[first], numbers[first], count == 1, places, normals)


def _with_normals(model: StructureModel, facets: Facets) -> Facets:
    """The same with unit normals that point away from the middle of each cell's corners.

    The middle of all nodes of a thin curved cell may lie beyond the plane of a face's corners.
    """
    corners = facets.places
    if _lines(facets):
        normals = (corners[:, 1] - corners[:, 0])[:, [1, 0, 2]] * [1.0, -1.0, 0.0]
    else:
        normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    inside = np.empty_like(normals)
    for code in np.unique(facets.kinds):
        of_kind = facets.kinds == code
        cells = model.mesh.cells[NAMES[code]][facets.numbers[of_kind]]
        corners_only = cells[:, : len(KINDS[NAMES[code]].corners)]
        inside[of_kind] = model.mesh.points[corners_only].mean(axis=1)
    outward = np.sign(np.einsum("fi,fi->f", normals, facets.centres - inside))
    length = np.maximum(np.linalg.norm(normals, axis=1), np.finfo(np.float64).tiny)
    return replace(facets, normals=normals * (outward / length)[:, None])


def _joined(blocks: list[Facets]) -> Facets:
    names = [entry.name for entry in fields(Facets)]
    return Facets(*(np.concatenate([getattr(block, name) for block in blocks]) for name in names))


def _lines(facets: Facets) -> bool:
    return bool(facets.nodes.shape[1] == 2)


def _near(facets: Facets, tolerance: float) -> Iterator[IntArray]:
    """Pairs (p, 2) of facets, one of them outer, that may lie against each other.

    Facets of one size, within a factor of two, are looked for at a time, so that a few large ones
    do not make a mesh of small ones slow.
    """
    radii, centres = facets.radii, facets.centres
    sizes = np.frexp(radii)[1]
    every = np.arange(len(facets))
    for size, other_size in product(np.unique(sizes), repeat=2):
        one, other = every[facets.outer & (sizes == size)], every[sizes == other_size]
        if len(one):
            reach = radii[one].max() + radii[other].max()
            facing = FACING * reach * facets.normals
            tree = cKDTree(np.hstack([centres[one], facing[one]]))
            others = cKDTree(np.hstack([centres[other], -facing[other]]))
            near = tree.sparse_distance_matrix(others, reach, output_type="ndarray")
            pairs = np.stack([one[near["i"]], other[near["j"]]], axis=1)
            pairs = pairs[~facets.outer[pairs[:, 1]] | (pairs[:, 0] < pairs[:, 1])]
            between = centres[pairs[:, 1]] - centres[pairs[:, 0]]
            off = np.abs(np.einsum("pi,psi->ps", between, facets.normals[pairs])).min(axis=1)
            yield pairs[off <= tolerance]


def _misfit(one: Facets, other: Facets, held: BoolArray, tolerance: float) -> BoolArray:
    """Which pairs lie against each other, but neither as a slit does nor with all nodes held."""
    found = (_lines_overlap if _lines(one) else _faces_overlap)(one, other, tolerance)
    at = np.flatnonzero(found)
    one, other = one[at], other[at]
    apart = np.linalg.norm(one.places[:, :, None] - other.places[:, None], axis=3) > tolerance
    slit = ~(apart.all(axis=2).any(axis=1) | apart.all(axis=1).any(axis=1))
    same = one.nodes[:, :, None] == other.nodes[:, None]
    tied = (held[one.nodes] | same.any(axis=2)).all(axis=1)
    tied |= (held[other.nodes] | same.any(axis=1)).all(axis=1)
    found[at] = ~slit & ~tied
    return found


def _lines_overlap(one: Facets, other: Facets, tolerance: float) -> BoolArray:
    """Which pairs of edges are in one line and have a part of it in common."""
    longer = (one.radii >= other.radii)[:, None, None]
    long = np.where(longer, one.places, other.places)
    short = np.where(longer, other.places, one.places)
    span = long[:, 1] - long[:, 0]
    length = np.linalg.norm(span, axis=1)
    axis = span / length[:, None]
    away = short - long[:, :1]
    along = np.einsum("pci,pi->pc", away, axis)
    off = np.linalg.norm(away - along[:, :, None] * axis[:, None], axis=2).max(axis=1)
    common = np.minimum(along.max(axis=1), length) - np.maximum(along.min(axis=1), 0.0)
    least = LEAST_OVERLAP * np.minimum(one.radii, other.radii)
    return np.asarray((off <= tolerance) & (common > least))


def _faces_overlap(one: Facets, other: Facets, tolerance: float) -> BoolArray:
    """Which pairs of faces are in one plane and have an area in common.

    Two convex polygons have none if, seen along an edge of either, one is beside the other.
    """
    off = np.minimum(_off_plane(one, other), _off_plane(other, one))
    found = np.asarray(off <= tolerance)
    at = np.flatnonzero(found)
    one, other = one[at], other[at]
    common = np.full(len(at), np.inf)
    for corners, i in product((one.places, other.places), range(4)):
        edge = corners[:, i] - corners[:, i - 1]
        length = np.linalg.norm(edge, axis=1)
        across = np.cross(one.normals, edge) / np.maximum(length, tolerance)[:, None]
        own = np.einsum("pci,pi->pc", one.places, across)
        its = np.einsum("pci,pi->pc", other.places, across)
        width = np.minimum(own.max(axis=1), its.max(axis=1)) - np.maximum(
            own.min(axis=1), its.min(axis=1)
        )
        common = np.where(length > tolerance, np.minimum(common, width), common)
    found[at] = common > LEAST_OVERLAP * np.minimum(one.radii, other.radii)
    return found


def _off_plane(one: Facets, other: Facets) -> FloatArray:
    """Distance of the farthest corner of the others from the planes of the first, shape (p,)."""
    away = other.places - one.centres[:, None]
    return np.asarray(np.abs(np.einsum("pci,pi->pc", away, one.normals)).max(axis=1))
