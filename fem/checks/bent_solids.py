"""What solid cells make of the motions of the part that they stand for."""

from __future__ import annotations

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.checks.bent import Field, Surface, bendable, bending_energy, bent, surface_through, widened
from fem.checks.columns import Columns, face_nodes
from fem.checks.excess import excess, settled, summed
from fem.elements.solids import gradients_and_volumes, stiffness_matrices
from fem.model.structure import SolidCells


def surface_of(piece: SolidCells, points: FloatArray, columns: Columns) -> Surface:
    """The surfaces that the faces of columns are part of."""
    nodes = face_nodes(piece.kind, piece.nodes[columns.cells], columns.faces.nodes)
    return surface_through(points[nodes], columns.faces.normals, columns.thickness)


def roundness(piece: SolidCells, points: FloatArray, columns: Columns) -> FloatArray:
    """Greatest curvature of faces times their longest edge, (f,)."""
    shape = surface_of(piece, points, columns).shape
    return np.asarray(np.abs(shape[:, 3:]).max(axis=1) * columns.lengths[:, 0])


def bending_excess(piece: SolidCells, points: FloatArray, columns: Columns) -> FloatArray:
    """Excess (f,) of stiffness in bending of the cells below faces of thin parts."""
    E, nu = piece.part.material.youngs_modulus, piece.part.material.poissons_ratio_for("solid part")
    moments = np.array([[1.0, -nu, 0.0], [-nu, 1.0, 0.0], [0.0, 0.0, 1.0 + nu]])
    if piece.kind.dimension == 2:
        moments = moments[:1] * [1.0, float(piece.part.plane == "stress"), 1.0]
    cells = SolidColumns(piece, points, columns.pairs, piece.part.lame)
    surface = surface_of(piece, points, columns)
    field = bent(surface[columns.pairs[:, 0]], moments, cells.places, E, nu)
    energy, work, exact, volume = cells.energies(field, len(surface.thickness), cells.between)
    whole = bending_energy(moments, E, nu) * (volume * surface.thickness**2 / 12.0)[:, None, None]
    return excess(energy, work, exact, whole, bendable(surface, columns.lengths[:, 0], moments, nu))


def pressing_excess(piece: SolidCells, points: FloatArray, columns: Columns) -> FloatArray:
    """Excess (f,) of stiffness of the cells below round faces, as of a tube under pressure.

    The tube keeps its volume everywhere; the excess is what cells resist with that do not.
    """
    first, mu = piece.part.lame
    cells = SolidColumns(piece, points, columns.pairs, (first, 0.0))
    surface = surface_of(piece, points, columns)
    field = widened(surface[columns.pairs[:, 0]], cells.places, mu)
    swelling, _, exact, _ = cells.energies(field, len(surface.thickness), cells.between[:0])
    return np.asarray((swelling / exact)[:, 0, 0], dtype=np.float64)


class SolidColumns:
    """Solid cells below faces, each as often as it is below one, in full integration.

    Parameters
    ----------
    piece, points
        The cells, and the nodes of the mesh in m, shape (n, 3).
    pairs
        Face and cell, shape (e, 2).
    lame
        Lamé's constants in N/m².
    """

    def __init__(
        self, piece: SolidCells, points: FloatArray, pairs: IntArray, lame: tuple[float, float]
    ) -> None:
        self.face, cell = pairs.T
        self.kind, d = piece.kind, piece.kind.dimension
        nodes = piece.nodes[cell]
        places, weights = self.kind.quadrature
        self.gradients, volumes = gradients_and_volumes(self.kind, points[nodes][..., :d], places)
        self.weights = np.abs(volumes) * weights
        K = stiffness_matrices(self.gradients, self.weights, lame)
        self.stiffness = K.reshape(len(pairs), nodes.shape[1] * d, -1)
        self.between = np.arange(d * len(self.kind.corners), d * nodes.shape[1])
        self.places = np.concatenate(
            [points[nodes], self.kind.basis(places)[0] @ points[nodes]], axis=1
        )
        numbers = (self.face[:, None] * len(points) + nodes)[..., None] * d + np.arange(d)
        self.numbers = numbers.reshape(len(pairs), -1)

    def __repr__(self) -> str:
        return f"SolidColumns({len(self.face)} {self.kind.name})"

    def energies(self, field: Field, count: int, free: IntArray) -> tuple[FloatArray, ...]:
        """U, F and G (f, m, m) of the cells below each face in a field, and their volume (f,)."""
        b, d = self.kind.node_count, self.kind.dimension
        u = field.displacement[:, :, :b, :d].reshape(len(self.face), -1, b * d)
        stress, strain = field.stress[:, :, b:, :d, :d], field.strain[:, :, b:, :d, :d]
        f = np.einsum(
            "eq,eqbj,emqij->embi", self.weights, self.gradients, stress, optimize=True
        ).reshape(u.shape)
        u = settled(self.stiffness, u, f, self.numbers, free)
        exact = np.einsum("eq,emqij,enqij->emn", self.weights, stress, strain, optimize=True)
        moved = u.transpose(0, 2, 1)
        each = (u @ self.stiffness @ moved, f @ moved, exact, self.weights.sum(axis=1))
        return tuple(summed(values, self.face, count) for values in each)
