"""What facets of shells at free edges make of bending in their plane."""

from __future__ import annotations

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.checks.bent import surface_through
from fem.checks.columns import Columns
from fem.checks.excess import settled, summed
from fem.elements.shells import FLAT, corner_normals, shell_rows
from fem.mesh.cells import CellKind
from fem.model.parts import ShellPart


def strip_excess(
    points: FloatArray, part: ShellPart, kind: CellKind, nodes: IntArray, columns: Columns
) -> FloatArray:
    """Excess (f,) of stiffness in their plane of the facets (e, b) at free edges of strips.

    The right energy is that which they have when they are stretched evenly, times the square of
    the distance from the middle of the strip. NaN stands where a facet lies across the plane of
    the strip, as a plate below its rib.
    """
    face, cell = columns.pairs.T
    used, place = np.unique(cell, return_inverse=True)
    (normals,) = corner_normals(points, [nodes[used]])
    rows, stiffness = shell_rows(part, kind, points, nodes[used], normals)
    K = (rows.transpose(0, 2, 1) * stiffness[:, None]) @ rows
    K = K[place]
    ends = columns.faces.places[:, :2]
    surface = surface_through(ends, columns.faces.normals, columns.thickness)[face]
    nu = part.material.poissons_ratio_for("shell part")
    local = np.einsum("eij,ekj->eki", surface.axes, points[nodes[cell]] - surface.centres[:, None])
    x, height = local[..., 0], local[..., 2] + surface.thickness[:, None] / 2.0
    none = np.zeros_like(x)
    moved = np.stack(
        [
            np.stack([x * height, none, -(x**2 + nu * height**2) / 2.0, none, x, none], axis=-1),
            np.stack([x, none, -nu * height, none, none, none], axis=-1),
        ],
        axis=1,
    ).reshape(len(face), 2, -1, 2, 3)
    u = (moved @ surface.axes[:, None, None]).reshape(len(face), 2, -1)
    even = np.einsum("ei,eij,ej->e", u[:, 1], K, u[:, 1])
    at, weights = kind.quadrature
    values, slopes = kind.basis(at)
    area = np.linalg.det(np.einsum("eki,qkj->eqij", local[..., [0, 2]], slopes))
    area = np.abs(area) * weights
    whole = area.sum(axis=1)
    whole[whole < FLAT * columns.thickness[face] ** 2] = np.nan
    square = (area * (height @ values.T) ** 2).sum(axis=1) / whole
    dofs = 6 * (face[:, None] * len(points) + nodes[cell])[..., None] + np.arange(6)
    turns = np.flatnonzero(np.arange(6 * kind.node_count) % 6 > 2)
    bent_u = settled(K, u[:, :1], 0.0 * u[:, :1], dofs.reshape(len(face), -1), turns)
    energy = np.einsum("emi,eij,emj->e", bent_u, K, bent_u)
    more = summed(energy - even * square, face, len(columns.cells))
    return more / (summed(even, face, len(columns.cells)) * columns.thickness**2 / 12.0)
