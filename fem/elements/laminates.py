"""Flat facets of plates whose stiffness has directions and couples stretching and bending.

The energy of strains e and curvatures k is that of e + A⁻¹Bk with A, and of k with D - BA⁻¹B. The
first is taken with the means over the triangles that carry the membrane, the second at the places
of integration; both are exact for constant strains and curvatures, and neither can be negative.
"""

from __future__ import annotations

import numpy as np

from fem.base.arrays import FloatArray
from fem.elements.membranes import (
    areas,
    corner_rotations,
    from_edges,
    mean_strains,
    turning_stiffness,
)
from fem.elements.plates import condensed, curvatures, quad_shears, triangle_shears, unknowns
from fem.mesh.cells import CellKind
from fem.model.plates import PlateSection, shear_turn, strain_turn

Pieces = tuple[tuple[float, tuple[int, ...]], ...]


def root(matrices: FloatArray) -> FloatArray:
    """Matrices R (..., n, n) so that RᵀR are given ones, whose energy is not negative."""
    values, vectors = np.linalg.eigh(matrices)
    return np.asarray(np.sqrt(np.maximum(values, 0.0))[..., :, None] * np.swapaxes(vectors, -1, -2))


def section_rows(
    section: PlateSection,
    kind: CellKind,
    plane: FloatArray,
    angles: FloatArray,
    pieces: Pieces,
    quadrature: tuple[FloatArray, FloatArray],
    reduction: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Deformations (e, r, b, 6) of flat facets and their stiffness (e, r), in local axes.

    Parameters
    ----------
    section
        Of all facets.
    kind, plane
        "triangle" or "quad", and places (e, b, 2) of the corners in the plane.
    angles
        From the x axis of each facet to that of the section, in radians, (e,).
    pieces
        Triangles that carry the membrane, each with its share.
    quadrature
        Places (q, 2) and weights (q,) of integration.
    reduction
        Factors (e,) on the stiffness against the corners' rotations.
    """
    count, b = plane.shape[:2]
    T = np.array([strain_turn(a) for a in angles])
    S = np.array([shear_turn(a) for a in angles])
    A, B, D = (
        T.transpose(0, 2, 1) @ np.array(m) @ T
        for m in (section.membrane, section.coupling, section.bending)
    )
    mixed = np.linalg.pinv(A, rcond=1e-12, hermitian=True) @ B
    stretch, bend = root(A), root(D - B @ mixed)
    size = unknowns(kind)
    rows, stiffness = [], []
    for share, corners in pieces:
        at = list(corners)
        strains, turning, area = _membrane(plane[:, at], A, stretch)
        block = np.zeros((count, 6, b, 6))
        block[:, :, np.array(at)[:, None], [0, 1, 5]] = np.concatenate(
            [strains, turning], axis=1
        ).reshape(count, 6, 3, 3)
        middle = kind.corners[at].mean(axis=0)[None]
        bent = (stretch @ mixed @ curvatures(kind, plane, middle)[0][:, 0])[:, :, : 3 * b]
        block[:, :3, :, 2:5] += bent.reshape(count, 3, b, 3)
        rows.append(block)
        turned = np.repeat(reduction[:, None], 3, axis=1)
        stiffness.append(
            share * np.concatenate([np.repeat(area[:, None], 3, axis=1), turned], axis=1)
        )
    places, weights = quadrature
    curved, jacobian = curvatures(kind, plane, places)
    shears = (quad_shears if kind.name == "quad" else triangle_shears)(kind, plane, places)
    shear = root(S.transpose(0, 2, 1) @ np.array(section.shear) @ S)
    own = np.concatenate([bend[:, None] @ curved, shear[:, None] @ shears], axis=2)
    own = own.reshape(count, -1, size)
    volume = np.repeat(jacobian * weights, 5, axis=1)
    block = np.zeros((count, own.shape[1], b, 6))
    block[..., 2:5] = condensed(own, volume, 3 * b).reshape(count, -1, b, 3)
    return np.concatenate([*rows, block], axis=1), np.concatenate([*stiffness, volume], axis=1)


def _membrane(
    corners: FloatArray, law: FloatArray, stretch: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rows of mean strains (e, 3, 9) and of the corners' rotations (e, 3, 9), and areas (e,)."""
    area = areas(corners)
    mean = stretch @ mean_strains(corners, area)
    diagonal = law[:, 0, 0] * law[:, 1, 1]
    nu = np.where(
        diagonal > 0.0, law[:, 0, 1] / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0)), 0.0
    )
    turning = root(turning_stiffness(corners, area, stretch @ from_edges(corners), nu))
    return mean, turning @ corner_rotations(corners, area), area
