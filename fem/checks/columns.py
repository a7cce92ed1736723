"""Cells below outer faces of thin parts, and how thick these are there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from fem.base.arrays import FloatArray, IntArray
from fem.checks.hanging import NAMES, Facets
from fem.mesh.cells import KINDS, CellKind, measures
from fem.model.structure import StructureModel

NEAREST = 24
"""Faces among which the one across the thickness is looked for."""
FACING = -0.8
"""Cosine of the normals of faces on two sides of a thin part, at most."""
BESIDE = 0.6
"""Of the longest edge of a face: how far beside its middle cells are taken for below it."""


@dataclass(frozen=True, eq=False)
class Columns:
    """Cells of one kind below some of the outer faces (in the plane, and of shells: edges).

    Parameters
    ----------
    faces
        The faces.
    cells
        The cell of each, shape (f,).
    thickness
        Of the part in m, infinite where nothing is across it, shape (f,).
    pairs
        Faces and the cells below them, shape (p, 2).
    """

    faces: Facets
    cells: IntArray
    thickness: FloatArray
    pairs: IntArray

    def __getitem__(self, kept: npt.NDArray[np.bool_]) -> Columns:
        pairs = self.pairs[kept[self.pairs[:, 0]]]
        pairs = np.stack([(np.cumsum(kept) - 1)[pairs[:, 0]], pairs[:, 1]], axis=1)
        return Columns(self.faces[kept], self.cells[kept], self.thickness[kept], pairs)

    @property
    def lengths(self) -> FloatArray:
        """Longest and shortest edge of each face in m, shape (f, 2)."""
        return extremes(self.faces)


def extremes(faces: Facets) -> FloatArray:
    """Longest and shortest edge of faces in m, shape (f, 2)."""
    length = np.linalg.norm(np.roll(faces.places, -1, axis=1) - faces.places, axis=2)
    shortest = np.where(length > 0.0, length, np.inf).min(axis=1)
    return np.stack([length.max(axis=1), shortest], axis=1)


def middles(faces: Facets) -> FloatArray:
    """Means of the corners of faces, of which a triangle has its last one twice, (f, 3)."""
    corners = faces.places
    if corners.shape[1] == 4:
        twice = (faces.nodes[:, 2] == faces.nodes[:, 3])[:, None]
        found = np.where(twice, corners[:, :3].mean(axis=1), corners.mean(axis=1))
        return np.asarray(found, dtype=np.float64)
    return faces.centres


def edge_normals(model: StructureModel, edges: Facets) -> FloatArray:
    """Unit vectors (f, 3) in the surface of shells, away from the cells that edges are of."""
    inside = np.empty((len(edges), 3))
    for code in np.unique(edges.kinds):
        of_kind = edges.kinds == code
        cells = model.mesh.cells[NAMES[code]][edges.numbers[of_kind]]
        inside[of_kind] = model.mesh.points[cells].mean(axis=1)
    along = edges.places[:, 1] - edges.places[:, 0]
    away = edges.centres - inside
    away -= (np.sum(away * along, axis=1) / np.sum(along**2, axis=1))[:, None] * along
    return np.asarray(away / np.linalg.norm(away, axis=1)[:, None], dtype=np.float64)


def evenly(candidates: npt.NDArray[np.bool_], count: int) -> IntArray:
    """At most so many of the places where a condition holds, as evenly as can be."""
    at = np.flatnonzero(candidates)
    if len(at) <= count:
        return np.asarray(at)
    return np.asarray(at[np.linspace(0, len(at) - 1, count).astype(np.int64)])


def distances_across(outer: Facets, faces: Facets) -> FloatArray:
    """Distance in m along the normal from faces to one that faces them, infinite without one.

    It lies beside the face by no more than its longest edge.
    """
    centres = middles(outer)
    count = min(NEAREST, len(centres))
    _, near = cKDTree(centres).query(middles(faces), k=count)
    near = near.reshape(len(faces), count)
    way = middles(faces)[:, None] - centres[near]
    away = np.einsum("fki,fi->fk", way, faces.normals)
    aside = np.linalg.norm(way - away[..., None] * faces.normals[:, None], axis=2)
    facing = np.einsum("fki,fi->fk", outer.normals[near], faces.normals) < FACING
    facing &= (away > 0.0) & (aside <= extremes(faces)[:, :1])
    return np.asarray(np.where(facing, away, np.inf).min(axis=1), dtype=np.float64)


def columns_below(
    faces: Facets,
    across: FloatArray,
    points: FloatArray,
    kind: CellKind,
    nodes: IntArray,
    own: IntArray,
) -> Columns:
    """The cells (e, b) of a kind below some outer faces, whose own cells (f,) are known.

    The thickness is the distance across from `distances_across`, at least how deep the own cell is.

    Examples
    --------
    >>> import fem
    >>> from fem.checks.hanging import outer_facets
    >>> leaf = fem.box_mesh("leaf", (1.0, 1.0, 0.1), (4, 4, 1))
    >>> part = fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))
    >>> outer = outer_facets(fem.StructureModel(leaf, {"leaf": part}))
    >>> top = outer[outer.normals[:, 2] > 0.5]
    >>> kind, cells = KINDS["hexahedron20"], leaf.cells["hexahedron20"]
    >>> across = distances_across(outer, top)
    >>> found = columns_below(top, across, leaf.points, kind, cells, top.numbers)
    >>> np.unique(np.round(found.thickness, 12)), bool((found.pairs[:, 1] == found.cells).all())
    (array([0.1]), True)
    """
    thickness = np.maximum(across, _depths(kind, points[nodes[own]], faces))
    near = np.zeros(len(points), dtype=np.bool_)
    near[faces.nodes] = True
    corners = nodes[:, : len(kind.corners)]
    some = np.flatnonzero(near[corners].any(axis=1))
    way = middles(faces)[:, None] - points[corners[some]].mean(axis=1)
    depth = np.einsum("fci,fi->fc", way, faces.normals)
    aside = np.linalg.norm(way - depth[..., None] * faces.normals[:, None], axis=2)
    below = (depth > 0.0) & (depth < thickness[:, None])
    below &= aside < BESIDE * extremes(faces)[:, :1]
    below |= some == own[:, None]
    face, cell = np.nonzero(below)
    return Columns(faces, own, thickness, np.stack([face, some[cell]], axis=1))


def _depths(kind: CellKind, places: FloatArray, faces: Facets) -> FloatArray:
    """How deep in m cells with nodes at some places (f, b, 3) are under their faces."""
    corners = faces.places
    if corners.shape[1] == 2:
        area = extremes(faces)[:, 0]
        times: float | FloatArray = 2.0 if len(kind.corners) == 3 else 1.0
    else:
        area = (
            np.linalg.norm(
                np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1
            )
            / 2.0
        )
        flat = faces.nodes[:, 2] == faces.nodes[:, 3]
        times = np.where(flat, 1.0, 2.0) if len(kind.corners) == 6 else 3.0
        times = 1.0 if len(kind.corners) == 8 else times
    return np.asarray(times * measures(kind.name, places).sum(axis=1) / area, dtype=np.float64)


def face_nodes(kind: CellKind, cells: IntArray, corners: IntArray) -> IntArray:
    """Nodes (f, k) of the faces of cells (f, b) that have some corners, (f, c).

    Faces with fewer nodes than others have some twice.
    """
    most = max(local.shape[1] for local in kind.facets.values())
    found = np.zeros((len(cells), most), dtype=np.int64)
    for name, facets in kind.facets.items():
        for local in facets:
            ends = cells[:, local[: len(KINDS[name].corners)]]
            met = ends[:, :, None] == corners[:, None]
            same = met.any(axis=2).all(axis=1) & met.any(axis=1).all(axis=1)
            found[same] = np.resize(local, most)
    return np.take_along_axis(cells, found, axis=1)
