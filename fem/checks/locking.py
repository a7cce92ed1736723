"""Solids that are too stiff in bending, found by what their cells make of it on the actual mesh.

The energy of a bent part, as a cell interpolates the exact displacement, is greater than it should
be by the strains that the cell adds. Beside bending with the curvature k of a part of thickness t,
whose mean square strain is k² t²/12, these are, in a cell of length L,

- of first order: shear k s at s from its middle, which adds (G/E) (L/t)², however many cells lie
  through the thickness;
- of second order on a curved part, whose edges lie by f off their chords: the membrane strain
  (k/R) (L²/12 - s²) with L²/R = 8 f, as the tangential displacement k s³/(3 R) is cubic; it adds
  (64/15) (f/t)². Where a face of sides 2 a and 2 b is warped, by h at its corners, the shear
  strain likewise adds (16/15) (G/E) (a h/(b t))². Reduced integration sees neither: they vanish at
  Gauss's two places;
- of second order with triangular faces on a thin plate: where the curvature changes by k' per
  length, the shear k' (s²/2 - L²/24), which adds (G/E) (L/t)² (k' L/k)²/60. Rectangular faces can
  undo it, as can rows of cells, where only one of two directions is long beside the thickness. The
  curvature is taken to change as in a half wave over the longest extent of the part.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fem.base.arrays import FloatArray, IntArray
from fem.mesh.cells import KINDS, CellKind, facet_keys, measures
from fem.model.structure import SolidCells, StructureModel

TOLERABLE = 0.05
"""Parasitic stiffness in bending, relative, above which a part is warned of."""
MOST = 0.9
"""Quantile of this stiffness over the faces of a part that stands for it."""
NEAREST = 24
"""Faces among which the one across the thickness is looked for."""
FACING = -0.8
"""Cosine of the normals of faces on two sides of a thin part, at most."""


@dataclass(frozen=True, eq=False)
class Sides:
    """Outer faces (in the plane: edges) of cells of one piece.

    Parameters
    ----------
    kind
        What they are.
    places
        Of their nodes in m, shape (f, k, 3).
    centres, normals
        Shape (f, 3).
    depths
        How deep their cells are under them in m, shape (f,).
    """

    kind: CellKind
    places: FloatArray
    centres: FloatArray
    normals: FloatArray
    depths: FloatArray

    @property
    def lengths(self) -> FloatArray:
        """Of their edges, shape (f, r)."""
        ends = self.places[:, np.array(self.kind.edges)]
        return np.asarray(np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2))

    @property
    def offs(self) -> FloatArray:
        """How far the middles of their edges lie off the chords, along the normal, (f, r)."""
        ends = self.places[:, np.array(self.kind.edges)]
        first = len(self.kind.corners)
        middles = self.places[:, first : first + len(self.kind.edges)]
        offs = np.einsum("fri,fi->fr", middles - ends.mean(axis=2), self.normals)
        return np.asarray(np.abs(offs), dtype=np.float64)

    @property
    def warps(self) -> FloatArray:
        """How far the corners of quadrilaterals lie off a plane, times length over width, (f,)."""
        if len(self.kind.corners) != 4:
            return np.zeros(len(self.places))
        heights = np.einsum(
            "fki,k,fi->f", self.places[:, :4], (0.25, -0.25, 0.25, -0.25), self.normals
        )
        slender = self.lengths.max(axis=1) / self.lengths.min(axis=1)
        return np.asarray(np.abs(heights) * slender, dtype=np.float64)


def locking_warnings(model: StructureModel) -> Iterator[str]:
    """One sentence for all cells of a kind in a part that are likely to be over 5 % too stiff."""
    pieces = model.solid_cells
    found = outer_sides(model, pieces)
    if not found:
        return
    thick = thicknesses([sides for _, sides in found])
    for number, piece in enumerate(pieces):
        own = [(s, t) for (at, s), t in zip(found, thick, strict=True) if at == number]
        excess, worst = 0.0, ""
        for way, why in ((_short, _SHORT), (_curved, _CURVED), (_triangular, _TRIANGULAR)):
            each = [np.zeros((0, 2)), *(way(piece, model.mesh.points, s, t) for s, t in own)]
            values = np.concatenate(each)
            values = values[np.isfinite(values[:, 0])]
            if not len(values):
                continue
            at = np.argsort(values[:, 0])[min(int(MOST * len(values)), len(values) - 1)]
            if values[at, 0] > max(excess, TOLERABLE):
                excess, worst = float(values[at, 0]), why.format(values[at, 1])
        if excess:
            yield (
                f"{model.mesh.source}: part {piece.name!r}: where it bends, its {piece.kind.name}"
                f" are likely about {1.0 + excess:.3g} times too stiff: {worst}"
            )


_SHORT = (
    "they are of first order and their length is {:.2g} of the thickness; use second-order cells"
)
_CURVED = (
    "they are curved by {:.2g} of the thickness on their length; use hexahedron20 (with reduced"
    " integration), shells or shorter cells"
)
_TRIANGULAR = (
    "their triangles are {:.2g} times as long as the part is thick; use hexahedra of second order,"
    " shells or shorter cells"
)


def _short(piece: SolidCells, points: FloatArray, sides: Sides, thick: FloatArray) -> FloatArray:
    """Excess (f, 2) of first-order cells, and their length over the thickness."""
    if piece.kind.order > 1:
        return np.zeros((0, 2))
    ratio = sides.lengths.max(axis=1) / thick
    return np.column_stack([shear_share(piece) * ratio**2, ratio])


def _curved(piece: SolidCells, points: FloatArray, sides: Sides, thick: FloatArray) -> FloatArray:
    """Excess (f, 2) of curved second-order cells, and how far their edges are off the chords."""
    if piece.kind.order == 1 or piece.reduced:
        return np.zeros((0, 2))
    ratio = sides.offs.max(axis=1) / thick
    warped = sides.warps / thick
    excess = 64.0 / 15.0 * ratio**2 + 16.0 / 15.0 * shear_share(piece) * warped**2
    return np.column_stack([excess, np.maximum(ratio, warped)])


def _triangular(
    piece: SolidCells, points: FloatArray, sides: Sides, thick: FloatArray
) -> FloatArray:
    """Excess (f, 2) of second-order triangles on thin plates, and their length over thickness."""
    few = len(sides.kind.corners) == 3 or piece.kind.name.startswith("pyramid")
    if piece.kind.order == 1 or piece.kind.dimension == 2 or not few:
        return np.zeros((0, 2))
    lengths = sides.lengths
    extent = np.ptp(points[np.unique(piece.nodes)], axis=0).max()
    ratio = lengths.min(axis=1) / thick
    change = np.pi * lengths.max(axis=1) / extent
    return np.column_stack([shear_share(piece) * (ratio * change) ** 2 / 60.0, ratio])


def shear_share(piece: SolidCells) -> float:
    """Shear modulus over Young's."""
    return 0.5 / (1.0 + piece.part.material.poissons_ratio_for("solid part"))


def outer_sides(model: StructureModel, pieces: list[SolidCells]) -> list[tuple[int, Sides]]:
    """The outer faces of all pieces, each with the number of its piece."""
    found: dict[str, list[tuple[int, IntArray, FloatArray, FloatArray]]] = {}
    for number, piece in enumerate(pieces):
        places = model.mesh.points[piece.nodes]
        middles = places[:, : len(piece.kind.corners)].mean(axis=1)
        volumes = measures(piece.kind.name, places[..., : piece.kind.dimension]).sum(axis=1)
        for kind, nodes in piece.kind.facets_of(piece.nodes).items():
            times = len(nodes) // len(middles)
            inside, volume = np.repeat(middles, times, axis=0), np.repeat(volumes, times)
            found.setdefault(kind, []).append((number, nodes, inside, volume))
    sides = []
    for kind, blocks in found.items():
        outer = _once(np.concatenate([n[:, : len(KINDS[kind].corners)] for _, n, _, _ in blocks]))
        first = 0
        for number, nodes, inside, volume in blocks:
            own = outer[first : first + len(nodes)]
            first += len(nodes)
            if own.any():
                places = model.mesh.points[nodes[own]]
                depth = depths(pieces[number].kind, kind, places, volume[own])
                sides.append((number, _sides(kind, places, inside[own], depth)))
    return sides


def _once(corners: IntArray) -> npt.NDArray[np.bool_]:
    """Which facets (f, c) are there once only."""
    keys = facet_keys(np.sort(corners, axis=1)[:, :3])
    _, number, count = np.unique(keys, return_inverse=True, return_counts=True)
    return np.asarray(count[number.ravel()] == 1)


def depths(cell: CellKind, kind: str, places: FloatArray, volumes: FloatArray) -> FloatArray:
    """How deep (f,) cells of some volumes are under their faces."""
    area = measures(kind, places).sum(axis=1)
    if cell.dimension == 2 or len(cell.corners) == 8:
        times = 2.0 if len(cell.corners) == 3 else 1.0
    elif len(cell.corners) == 6:
        times = 1.0 if len(KINDS[kind].corners) == 3 else 2.0
    else:
        times = 3.0
    return np.asarray(times * volumes / area, dtype=np.float64)


def _sides(kind: str, places: FloatArray, inside: FloatArray, depth: FloatArray) -> Sides:
    """Faces with their normals outwards, away from the middle of their cell."""
    corners = places[:, : len(KINDS[kind].corners)]
    if corners.shape[1] == 2:
        along = corners[:, 1] - corners[:, 0]
        normals = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(along))])
    else:
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    with np.errstate(invalid="ignore"):
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    centres = corners.mean(axis=1)
    outwards = np.sign(np.einsum("fi,fi->f", normals, centres - inside))
    return Sides(KINDS[kind], places, centres, normals * outwards[:, None], depth)


def thicknesses(sides: list[Sides]) -> list[FloatArray]:
    """Thickness in m under every face (f,), for each of ``sides``; infinite where none is near.

    It is the distance, along the normal, from a face that looks the other way and lies beside it
    by no more than the longest edge; at least the depth of the cell.

    Examples
    --------
    >>> import fem
    >>> steel = fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))
    >>> leaf = fem.box_mesh("leaf", (1.0, 1.0, 0.1), (4, 4, 2))
    >>> model = fem.StructureModel(leaf, {"leaf": steel})
    >>> (_, sides), = outer_sides(model, model.solid_cells)
    >>> wide = np.abs(sides.normals[:, 2]) > 0.5
    >>> np.unique(np.round(thicknesses([sides])[0][wide], 12))
    array([0.1])
    """
    from scipy.spatial import cKDTree

    centres = np.concatenate([each.centres for each in sides])
    normals = np.concatenate([each.normals for each in sides])
    reach = np.concatenate([each.lengths.max(axis=1) for each in sides])
    _, near = cKDTree(centres).query(centres, k=min(NEAREST, len(centres)))
    near = near.reshape(len(centres), -1)
    way = centres[:, None] - centres[near]
    away = np.einsum("fki,fi->fk", way, normals)
    aside = np.linalg.norm(way - away[..., None] * normals[:, None], axis=2)
    facing = np.einsum("fki,fi->fk", normals[near], normals) < FACING
    away = np.where(facing & (aside <= reach[:, None]), np.abs(away), np.inf).min(axis=1)
    found = np.maximum(away, np.concatenate([each.depths for each in sides]))
    return np.split(found, np.cumsum([len(each.centres) for each in sides])[:-1])
