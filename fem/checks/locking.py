"""Solids and shells that are too stiff on the actual mesh, found by a test of their cells.

Cells below outer faces of thin parts, and at the edges of strips of shells, get the exact motion of
a part that bends (`bent.py`), in all directions and also twisted; at round faces of solids also
that of a tube under pressure. What the stiffness of these cells makes of it is compared with the
energy that is right (`excess.py`). Reduced integration has no excess.

Cells that pass this test can still be too long for a mode, or not fit together where a curvature
changes: that is seen in the modes (`Component.mesh_errors`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.checks.bent_solids import bending_excess, pressing_excess, roundness
from fem.checks.bent_strips import strip_excess
from fem.checks.columns import (
    columns_below,
    distances_across,
    edge_normals,
    evenly,
)
from fem.checks.hanging import NAMES, Boundary, Facets
from fem.mesh.cells import KINDS, CellKind
from fem.model.parts import ShellPart
from fem.model.structure import SolidCells, StructureModel

TOLERABLE = 0.05
"""Excess of stiffness above which a part is warned of."""
MOST = 0.9
"""Quantile of the excess over the faces of a part that stands for it."""
FACES = 48
"""Faces of a model that are looked at, but of each part some."""
LEAST_FACES = 8
ROUND = 0.02
"""Least curvature of a face, times its longest edge, with which a tube is tried."""

SHORT = (
    "they are of first order and their length is {:.2g} of the thickness; use second-order cells"
)
CURVED = (
    "they are curved by {:.2g} of the thickness on their length; use hexahedron20 (with reduced"
    " integration), shells or shorter cells"
)
PRESSED = (
    "with Poisson's ratio {:.6g} they cannot follow a round face under pressure; use hexahedron20"
    " (with reduced integration) or shorter cells"
)
SLANTING = (
    "they slant, with edges {:.2g} times as long as the strip is wide; use cells near to rectangles"
    " there, or several across"
)

Finding = tuple[FloatArray, str]
"""Excess and a figure for each face, (f, 2), and the sentence that the figure goes into."""


def locking_warnings(model: StructureModel, looked_at: Boundary) -> Iterator[tuple[str, bool]]:
    """A sentence for all cells of a kind in a part that are likely to be over 5 % too stiff.

    With each whether it is that they are curved, which modes show better.
    """
    outer, edges = looked_at
    pieces = [piece for piece in model.solid_cells if not piece.reduced]
    strips = [
        (name, part, KINDS[kind], nodes)
        for name, (part, kinds) in model.shells.items()
        for kind, nodes in kinds.items()
    ]
    count = max(FACES // max(len(pieces) + len(strips), 1), LEAST_FACES)
    if outer is not None and pieces:
        owned = [own_cells(model, piece, outer, count) for piece in pieces]
        for piece, (own, faces, across) in zip(pieces, with_distances(outer, owned), strict=True):
            found = _of_piece(model.mesh.points, piece, faces, across, own)
            yield from _told(model, piece.name, piece.kind, "where it bends", found)
    if edges is not None and edges.outer.any():
        rim = edges[edges.outer]
        rim = replace(rim, normals=edge_normals(model, rim))
        owned = [own_facets(model.mesh.points, nodes, rim, count) for *_, nodes in strips]
        for strip, (own, faces, across) in zip(strips, with_distances(rim, owned), strict=True):
            found = _of_strip(model.mesh.points, *strip[1:], faces, across, own)
            yield from _told(model, strip[0], strip[2], "where it bends in its plane", found)


def _told(
    model: StructureModel, name: str, kind: CellKind, where: str, found: list[Finding]
) -> Iterator[tuple[str, bool]]:
    """The sentence on the greatest of some findings, if there is one to tell."""
    most, why, curved = TOLERABLE, "", False
    for values, words in found:
        values = values[np.isfinite(values[:, 0])]
        if len(values):
            order = np.argsort(values[:, 0])
            excess_there, figure = values[order[min(int(MOST * len(order)), len(order) - 1)]]
            if excess_there > most:
                most, why, curved = excess_there, words.format(figure), words == CURVED
    if why:
        text = (
            f"{model.mesh.source}: part {name!r}: {where}, its {kind.name} are likely about"
            f" {1.0 + most:.3g} times too stiff: {why}"
        )
        yield text, curved


def own_cells(
    model: StructureModel, piece: SolidCells, outer: Facets, count: int
) -> tuple[IntArray, IntArray]:
    """Some of the outer faces that cells of a piece have, and which cells these are, (f,)."""
    name = piece.kind.name
    of_kind = outer.kinds == NAMES.index(name)
    place = np.full(len(model.mesh.cells[name]), -1)
    place[model.mesh.part(piece.name)[name][piece.numbers]] = np.arange(len(piece.nodes))
    own = np.where(of_kind, place[np.where(of_kind, outer.numbers, 0)], -1)
    at = evenly((own >= 0) & outer.normals.any(axis=1), count)
    return at, own[at]


def own_facets(
    points: FloatArray, nodes: IntArray, rim: Facets, count: int
) -> tuple[IntArray, IntArray]:
    """Some of the free edges that facets (e, b) of shells have, and which facets these are."""
    inside = np.zeros(len(points), dtype=np.bool_)
    inside[nodes] = True
    at = evenly(np.asarray(inside[rim.nodes].all(axis=1)), count)
    near = np.zeros_like(inside)
    near[rim.nodes[at]] = True
    some = np.flatnonzero(near[nodes].sum(axis=1) > 1)
    met = (nodes[some][None, :, :, None] == rim.nodes[at][:, None, None]).any(axis=2).all(axis=2)
    edge, facet = np.nonzero(met)
    return at[edge], some[facet]


def with_distances(
    outer: Facets, owned: list[tuple[IntArray, IntArray]]
) -> Iterator[tuple[IntArray, Facets, FloatArray]]:
    """Own cells, faces and the distances across from them, of each piece."""
    across = distances_across(outer, outer[np.concatenate([at for at, _ in owned])])
    ends = np.cumsum([len(at) for at, _ in owned])[:-1]
    for (at, own), each in zip(owned, np.split(across, ends), strict=True):
        yield own, outer[at], each


def _of_piece(
    points: FloatArray, piece: SolidCells, faces: Facets, across: FloatArray, own: IntArray
) -> list[Finding]:
    """What bending and pressure find of solid cells below some faces."""
    kind = piece.kind
    columns = columns_below(faces, across, points, kind, piece.nodes, own)
    nu = piece.part.material.poissons_ratio_for("solid part")
    found = []
    round_ = roundness(piece, points, columns) > ROUND
    if round_.any() and len(kind.corners) == 2**kind.dimension:
        pressed = pressing_excess(piece, points, columns[round_])
        found.append((np.column_stack([pressed, np.full(len(pressed), nu)]), PRESSED))
    columns = columns[np.isfinite(columns.thickness)]
    if not len(columns.cells):
        return found
    bending = bending_excess(piece, points, columns)
    long = columns.lengths[:, 0] / columns.thickness
    if kind.order == 1:
        return [*found, (np.column_stack([bending, long]), SHORT)]
    off = edge_offs(kind, points[piece.nodes[columns.cells]]) / columns.thickness
    found.append((np.column_stack([bending, off]), CURVED))
    return found


def edge_offs(kind: CellKind, places: FloatArray) -> FloatArray:
    """How far at most the nodes between the ends of edges lie off the middles, (f,) in m."""
    first = len(kind.corners)
    ends = places[:, np.array(kind.edges)]
    off = places[:, first : first + len(kind.edges)] - ends.mean(axis=2)
    return np.asarray(np.linalg.norm(off, axis=2).max(axis=1), dtype=np.float64)


def _of_strip(
    points: FloatArray,
    part: ShellPart,
    kind: CellKind,
    nodes: IntArray,
    edges: Facets,
    across: FloatArray,
    own: IntArray,
) -> list[Finding]:
    """What bending in the plane finds of facets (e, b) of shells at some free edges."""
    columns = columns_below(edges, across, points, kind, nodes, own)
    columns = columns[np.isfinite(columns.thickness)]
    if not len(columns.cells):
        return []
    slender = columns.lengths[:, 0] / columns.thickness
    return [
        (np.column_stack([strip_excess(points, part, kind, nodes, columns), slender]), SLANTING)
    ]
