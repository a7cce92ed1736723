"""Beams: from material and section to the matrices of elements."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.elements.straight_beams import (
    bending_matrices,
    bending_numbers,
    congruent,
    mean,
    stretching_matrices,
)
from fem.model.parts import BeamPart
from fem.model.sections import (
    CircularSection,
    SectionRun,
    TaperedSection,
    added,
    section_number,
    shear_areas,
)

UPRIGHT = np.array([0, 0, 1.0])
IN_PLANE = np.array([1, 5, 7, 11])
OUT_OF_PLANE = np.array([2, 4, 8, 10])
TURNED_SIGNS = np.array([1.0, -1.0, 1.0, -1.0])
"""A positive rotation about the local y lowers w along x."""
ALONG = 1e-6  # sine of the angle between two directions that are one


@dataclass(frozen=True)
class Bending:
    """Numbers of bending in one plane: EI in N m², kGA in N or None, rho I in kg m or None.

    Of a tapered part they are arrays (e, q) at the places of integration.
    """

    stiffness: float | FloatArray
    shear_stiffness: float | FloatArray | None
    inertia_per_length: float | FloatArray | None

    def matrices(
        self, lengths: FloatArray, mass_per_length: float | FloatArray, axial_force: float
    ) -> tuple[FloatArray, FloatArray]:
        """Stiffness and mass (e, 4, 4) of elements of these lengths (e,)."""

        def or_none(value: float | FloatArray | None) -> FloatArray | None:
            return None if value is None else each(value, lengths)

        return bending_matrices(
            lengths,
            each(self.stiffness, lengths),
            each(mass_per_length, lengths),
            or_none(self.shear_stiffness),
            or_none(self.inertia_per_length),
            or_none(axial_force or None),
        )


def each(value: float | FloatArray, lengths: FloatArray) -> FloatArray:
    """A number for every element, shape (e,); those at places along it, (e, q), as they are."""
    return value if isinstance(value, np.ndarray) else np.full(len(lengths), value)


def plane_bending(part: BeamPart, what: str) -> Bending:
    """Bending along the height of the section."""
    stiffness = part.material.youngs_modulus * part.section.second_moment
    if part.theory == "euler-bernoulli":
        return Bending(stiffness, None, None)
    areas = shear_areas(part.section, part.material.poissons_ratio_for(what), what, 1)
    inertia = part.material.density * part.section.second_moment
    return Bending(stiffness, shear_modulus(part, what) * areas[0], inertia)


def across_bending(part: BeamPart, what: str) -> Bending:
    """Bending along the width of the section."""
    second_moment = section_number(part.section, "second_moment_across", what)
    stiffness = part.material.youngs_modulus * second_moment
    if part.theory == "euler-bernoulli":
        return Bending(stiffness, None, None)
    areas = shear_areas(part.section, part.material.poissons_ratio_for(what), what)
    inertia = part.material.density * second_moment
    return Bending(stiffness, shear_modulus(part, what) * areas[1], inertia)


def shear_modulus(part: BeamPart, what: str) -> float:
    """G = E / (2 (1 + nu)) in N/m²."""
    return part.material.youngs_modulus / (2.0 * (1.0 + part.material.poissons_ratio_for(what)))


def spatial_matrices(
    part: BeamPart, lengths: FloatArray, what: str, plane: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Stiffness and mass (e, 12, 12) in local axes; in the plane of the height alone if asked so.

    The degrees of freedom are (u, v, w) and the rotations about x, y and z at the first end, then
    at the second; x runs along the beam, y along the height of the section and z along its width.
    Torsion is Saint-Venant's: GJ, and rho (Iy + Iz) with the section's added inertia; warping is
    free.
    """
    upright = _bending(part, lengths, plane_bending(part, what))
    pieces = [(np.array([0, 6]), _stretching(part, lengths)), (IN_PLANE, upright)]
    if plane:
        return _composed(12, pieces)
    across = _bending(part, lengths, across_bending(part, what))
    signs = TURNED_SIGNS[:, None] * TURNED_SIGNS
    material, section = part.material, part.section
    torsion = shear_modulus(part, what) * section_number(section, "torsion_constant", what)
    polar = section.second_moment + section_number(section, "second_moment_across", what)
    inertia = material.density * polar + added(section, "added_inertia")
    twisting = stretching_matrices(lengths, each(torsion, lengths), each(inertia, lengths))
    bending = across[0] * signs, across[1] * signs
    return _composed(12, [*pieces, (OUT_OF_PLANE, bending), (np.array([3, 9]), twisting)])


def spatial_rows(
    part: BeamPart, lengths: FloatArray, what: str, plane: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Rows (e, 8, 9) of the natural form and their stiffness (e, 8), see `natural.line_rows`.

    In local axes, for (u, v, w)2 - (u, v, w)1 and six rotations. In the plane of the height alone
    they are (e, 4, 9) and (e, 4).
    """
    stretching = part.material.youngs_modulus * mean(each(part.section.area, lengths)) / lengths
    bending, first = bending_rows(plane_bending(part, what), lengths, part.axial_force)
    upright = np.zeros((len(lengths), 4, 9))
    upright[:, 0, 0] = 1.0
    upright[:, 1:, [1, 5, 8]] = bending
    stiffness = np.column_stack([stretching, first])
    if plane:
        return upright, stiffness
    constant = section_number(part.section, "torsion_constant", what)
    torsion = shear_modulus(part, what) * mean(each(constant, lengths))
    across, second = bending_rows(across_bending(part, what), lengths, part.axial_force)
    rows = np.zeros((len(lengths), 4, 9))
    rows[:, 0, [3, 6]] = -1.0, 1.0
    rows[:, 1:, [2, 4, 7]] = across * np.array([1.0, -1.0, -1.0])
    weights = np.column_stack([stiffness, torsion / lengths, second])
    return np.concatenate([upright, rows], axis=1), weights


def bending_rows(
    numbers: Bending, lengths: FloatArray, axial_force: float
) -> tuple[FloatArray, FloatArray]:
    """Rows (e, 3, 3) for (w2 - w1, r1, r2) in which bending is diagonal, and its numbers (e, 3).

    The rows are r1 - r2, r1 + r2 less twice the chord's turn c, and c. With p as in
    `straight_beams.bending_matrices` and the axial force P the numbers are EI/L + PL/12,
    3 EI/(L (1 + p)) + PL/(20 (1 + p)²) and PL. A taper mixes the first two; the first row then
    takes so much of the second that they do not mix.
    """
    first, mixed, odd = bending_numbers(lengths, each(numbers.stiffness, lengths))
    tension = axial_force * lengths
    sheared, leaning = np.ones(len(lengths)), np.zeros(len(lengths))
    if numbers.shear_stiffness is not None:
        carried = mean(each(numbers.shear_stiffness, lengths)) * lengths
        sheared = 1.0 / (1.0 + 4.0 * odd / carried)
        leaning = 4.0 * mixed / carried * sheared
    even = first - leaning * mixed + tension / 12.0 + tension / 20.0 * leaning**2
    mixed = mixed * sheared - tension / 20.0 * sheared * leaning
    odd = odd * sheared + tension / 20.0 * sheared**2
    rows = np.zeros((len(lengths), 3, 3))
    rows[:, 0] = 0.0, 1.0, -1.0
    rows[:, 1] = 0.0, 1.0, 1.0
    rows[:, 1, 0], rows[:, 2, 0] = -2.0 / lengths, 1.0 / lengths
    rows[:, 0] += (mixed / even)[:, None] * rows[:, 1]
    return rows, np.column_stack([even, odd - mixed**2 / even, tension])


def _stretching(part: BeamPart, lengths: FloatArray) -> tuple[FloatArray, FloatArray]:
    stiffness = part.material.youngs_modulus * part.section.area
    return stretching_matrices(
        lengths, each(stiffness, lengths), each(mass_per_length(part), lengths)
    )


def mass_per_length(part: BeamPart) -> Any:
    """Density times area and what is added, in kg/m, at all places of a tapered part."""
    return part.material.density * part.section.area + added(part.section, "added_mass")


def _bending(
    part: BeamPart, lengths: FloatArray, numbers: Bending
) -> tuple[FloatArray, FloatArray]:
    return numbers.matrices(lengths, mass_per_length(part), part.axial_force)


def _composed(
    size: int, pieces: list[tuple[FloatArray, tuple[FloatArray, FloatArray]]]
) -> tuple[FloatArray, FloatArray]:
    count = len(pieces[0][1][0])
    stiffness, mass = np.zeros((count, size, size)), np.zeros((count, size, size))
    for dofs, pair in pieces:
        at = np.ix_(np.arange(count), dofs, dofs)
        stiffness[at], mass[at] = pair
    return stiffness, mass


def run(part: BeamPart, spans: FloatArray, what: str) -> FloatArray:
    """Spans (e, 3) of the axes of lines with these spans between their nodes."""
    if part.end_offsets is None:
        return spans
    first, second = np.moveaxis(_for_lines(part.end_offsets, 2, len(spans), what), 1, 0)
    found = np.asarray(spans + second - first, dtype=np.float64)
    short = np.flatnonzero(~(np.linalg.norm(found, axis=1) > 0.0))
    if len(short):
        raise ModelError(f"{what}: line {short[0]} has no length between its end offsets")
    return found


def _for_lines(values: object, rank: int, count: int, what: str) -> FloatArray:
    """Numbers of one rank for each of so many lines, if they are not given for each."""
    given = np.array(values, dtype=np.float64)
    if given.ndim == rank:
        return np.asarray(np.broadcast_to(given, (count, *given.shape)))
    if len(given) != count:
        raise ModelError(
            f"{what}: it has {count} lines, but orientations or offsets of {len(given)}; the mesh"
            " was changed after they were given"
        )
    return given


def local_axes(part: BeamPart, spans: FloatArray, what: str) -> FloatArray:
    """Unit vectors x, y, z of the elements as rows, (e, 3, 3), from their nodes' spans (e, 3).

    Raises
    ------
    ModelError
        If the orientation lies along an element, or is missing for one along z.
    """
    spans = run(part, spans, what)
    x = spans / np.linalg.norm(spans, axis=1)[:, None]
    if part.orientation is None:
        z = UPRIGHT - x * x[:, 2:]
        section = part.section.taper if isinstance(part.section, SectionRun) else part.section
        section = section.start if isinstance(section, TaperedSection) else section
        if isinstance(section, CircularSection) and not any(part.offset):
            z[np.linalg.norm(z, axis=1) < ALONG] = (1.0, 0.0, 0.0)  # round: any direction will do
        fault = "runs along z, so it needs an orientation (the direction of the section's height)"
    else:
        height = _for_lines(part.orientation, 1, len(spans), what)
        z = np.cross(x, height / np.linalg.norm(height, axis=1)[:, None])
        fault = f"runs along its orientation {part.orientation}"
    size = np.linalg.norm(z, axis=1)
    along = np.flatnonzero(size < ALONG)
    if len(along):
        if np.ndim(part.orientation) == 2:
            fault = f"runs along its orientation {part.orientation[along[0]]}"
        raise ModelError(f"{what}: line {along[0]} {fault}")
    z = z / size[:, None]
    return np.stack([x, np.cross(z, x), z], axis=1)


def to_nodes(part: BeamPart, axes: FloatArray) -> FloatArray:
    """The matrices (e, 12, 12) from the nodes' displacements to those of the axis, in local axes.

    The nodes have (ux, uy, uz) and the rotations about x, y and z at the first end, then at the
    second; the axis lies off the line between them by the part's offsets.
    """
    offset = np.einsum("i,eij->ej", np.array([0.0, *part.offset]), axes)
    ends = np.zeros((len(axes), 2, 3))
    if part.end_offsets is not None:
        ends = _for_lines(part.end_offsets, 2, len(axes), "part")
    T = np.zeros((len(axes), 12, 12))
    for end, first in enumerate((0, 6)):
        T[:, first : first + 3, first : first + 3] = axes
        T[:, first + 3 : first + 6, first + 3 : first + 6] = axes
        T[:, first : first + 3, first + 3 : first + 6] = axes @ -cross_matrix(offset + ends[:, end])
    return T


def cross_matrix(vectors: FloatArray) -> FloatArray:
    """The matrices [a]x of vectors a (..., 3), so that [a]x b is the cross product of a and b."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    return np.stack(
        [np.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))], axis=-2
    )


def release(part: BeamPart, count: int, what: str) -> FloatArray | None:
    """Which local displacements (e, 12) of both ends are not joined to the nodes, as 1 and 0."""
    if part.released is None:
        return None
    given = part.released
    each = [given] * count if not given or not _nested(given) else list(given)
    if len(each) != count:
        raise ModelError(f"{what}: it has {count} lines, but released directions of {len(each)}")
    found = np.zeros((count, 12))
    for row, ends in enumerate(each):
        for end, directions in enumerate(ends):
            found[row, [6 * end + direction for direction in directions]] = 1.0
    return found


def _nested(released: Any) -> bool:
    """Whether released directions are given for each line, and not once for all."""
    return any(isinstance(one, tuple) for each in released for one in each)


def without_released(rows: FloatArray, stiffness: FloatArray, released: FloatArray) -> FloatArray:
    """The matrices (e, 12, 12) that give released displacements their values of least energy.

    Where an end that is released costs no energy at all, it stays.
    """
    K = np.einsum("eri,er,erj->eij", rows, stiffness, rows, optimize=True)
    free = released[:, :, None] * released[:, None, :]
    scale = np.abs(K).max(axis=(1, 2), keepdims=True)
    inverse = np.linalg.pinv(K * free / scale, rcond=1e-12, hermitian=True) / scale
    kept = 1.0 - released
    found = -(released[:, :, None] * (inverse @ (K * kept[:, None, :])))
    found[:, range(12), range(12)] += kept
    return np.asarray(found, dtype=np.float64)


def to_neutral_axis(part: BeamPart, all_directions: bool) -> FloatArray:
    """The matrix (12, 12) from the line of shear centres to that of centroids, in local axes.

    The stiffness takes only the stretching at the centroids, since bending moves and twisting
    turns the shear centres; the mass moves with the centroids in all directions.
    """
    y, z = part.neutral_axis
    T = np.eye(12)
    for first in (0, 6):
        T[first, first + 4], T[first, first + 5] = z, -y
        if all_directions:
            T[first + 1, first + 3], T[first + 2, first + 3] = -z, y
    return T


def local_rows(
    part: BeamPart, spans: FloatArray, what: str, plane: bool = False
) -> tuple[FloatArray, FloatArray, FloatArray | None]:
    """Rows (e, r, 12) for both ends in local axes, stiffness (e, r), and what releases leave.

    The last are the matrices (e, 12, 12) of `without_released`, which the rows hold already.
    """
    lengths = np.linalg.norm(run(part, spans, what), axis=1)
    relative, stiffness = spatial_rows(part, lengths, what, plane)
    rows = np.zeros((*stiffness.shape, 12))
    rows[:, :, :3], rows[:, :, 6:9] = -relative[:, :, :3], relative[:, :, :3]
    rows[:, :, 3:6], rows[:, :, 9:] = relative[:, :, 3:6], relative[:, :, 6:]
    if any(part.neutral_axis):
        rows = rows @ to_neutral_axis(part, all_directions=False)
    released = release(part, len(spans), what)
    if released is None:
        return rows, stiffness, None
    left = without_released(rows, stiffness, released)
    return rows @ left, stiffness, left


def in_plane(part: BeamPart, plane: bool) -> bool:
    """Whether a beam of a plane structure bends along its height alone: no orientation turns it."""
    return plane and part.orientation is None


def element_rows(
    part: BeamPart, spans: FloatArray, what: str, plane: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Rows (e, r, 9) of the natural form for the nodes' displacements, and stiffness (e, r).

    There are 8 rows, or 4 of a beam that bends in the x-y plane only.
    """
    rows, stiffness, _ = local_rows(part, spans, what, in_plane(part, plane))
    T = to_nodes(part, local_axes(part, spans, what))
    # that all nodes move alike deforms nothing: only their difference counts
    relative = np.zeros((len(spans), 12, 9))
    relative[:, :6, 3:6], relative[:, 6:, 6:] = T[:, :6, 3:6], T[:, 6:, 9:]
    relative[:, 6:, :3] = T[:, 6:, 6:9]
    return rows @ relative, stiffness


def element_matrices(
    part: BeamPart, spans: FloatArray, what: str, plane: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Stiffness and mass (e, 12, 12) of beams for their nodes' displacements.

    In the x-y plane what a beam needs to bend out of it, or to twist, may be unknown.
    """
    T = to_nodes(part, local_axes(part, spans, what))
    lengths = np.linalg.norm(run(part, spans, what), axis=1)
    plane = in_plane(part, plane)
    stiffness, mass = spatial_matrices(part, lengths, what, plane)
    if any(part.neutral_axis):
        stiff, heavy = (to_neutral_axis(part, every) for every in (False, True))
        count = (len(spans), 12, 12)
        stiffness = congruent(stiffness, np.broadcast_to(stiff, count))
        mass = congruent(mass, np.broadcast_to(heavy, count))
    if part.released is not None:
        left = local_rows(part, spans, what, plane)[2]
        assert left is not None
        T = left @ T
    return congruent(stiffness, T), congruent(mass, T)
