"""The displacement and the stress of thin parts that are bent, below their outer faces.

A face lies on a surface of second order. In its tangent plane, with x and y from its middle and z
out of the part, that is z = c + s x + ... + (b11 x² + 2 b12 x y + b22 y²)/2; the middle of the part
is half its thickness below. A curvature k of bending moves the middle by w = -(k11 x² + 2 k12 x y +
k22 y²)/2 along z and by cubics u in its plane that leave its lengths as they are, as far as a
surface of this shape can bend so [1]_:

    u_a,b + u_b,a + z_,a w_,b + z_,b w_,a = 0.

A fibre at the height h turns with the middle and gets thicker by nu/(1 - nu) of what it gets
shorter; the strain is h k, and the stress that of a thin plate.

.. [1] L. H. Donnell, Beams, Plates, and Shells, McGraw-Hill, 1976, for shallow shells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.base.arrays import FloatArray, IntArray

CUBICS = ((3, 0), (2, 1), (1, 2), (0, 3))
SQUARES = ((2, 0), (1, 1), (0, 2))
"""Powers of x and y."""
ENGINEERING = np.array([1.0, 1.0, 2.0])
"""From strains 11, 22, 12 to those that are worked with."""
FOOT_STEPS = 3
"""Steps of the search for the place of the middle that a point lies over."""


def _strains_of_cubics() -> FloatArray:
    """Coefficients (9, 8) of the strains 11, 22 and 2 x 12 from those of u_1 and u_2."""
    found = np.zeros((3, 3, 2, 4))
    for number, (p, q) in enumerate(CUBICS):
        for power, times, along in (((p - 1, q), p, 0), ((p, q - 1), q, 1)):
            if times:
                at = SQUARES.index(power)
                found[along, at, along, number] += times
                found[2, at, 1 - along, number] += times
    return found.reshape(9, 8)


STRAINS = _strains_of_cubics()
CANCELLING = -np.linalg.pinv(STRAINS)


@dataclass(frozen=True, eq=False)
class Surface:
    """What outer faces are part of, one for each of n faces.

    Parameters
    ----------
    centres
        Of the faces in m, shape (n, 3).
    axes
        Unit vectors along x, y and the normal as rows, shape (n, 3, 3).
    shape
        c and the slopes and curvatures of its height: of 1, x, y, x²/2, x y, y²/2, shape (n, 6).
    thickness
        Of the part below in m, shape (n,).
    """

    centres: FloatArray
    axes: FloatArray
    shape: FloatArray
    thickness: FloatArray

    def __getitem__(self, at: IntArray) -> Surface:
        return Surface(
            *(each[at] for each in (self.centres, self.axes, self.shape, self.thickness))
        )


@dataclass(frozen=True, eq=False)
class Field:
    """Displacements (n, m, k, 3) of m motions, their stresses and strains (n, m, k, 3, 3)."""

    displacement: FloatArray
    stress: FloatArray
    strain: FloatArray


def surface_through(places: FloatArray, normals: FloatArray, thickness: FloatArray) -> Surface:
    """The surface through nodes (n, k, 3) of faces with some normals (n, 3).

    Examples
    --------
    >>> x = np.array([[0.0, 2.0, 1.0]])
    >>> arc = np.stack([x, 0 * x, 0.25 * x**2], axis=-1)
    >>> found = surface_through(arc, np.array([[-0.5, 0.0, 1.0]]) / 1.25**0.5, np.ones(1))
    >>> bool(abs(found.shape[0, 3] - 0.5 / 1.25**1.5) < 0.02)
    True
    """
    ways = places - places[:, :1]
    far = np.linalg.norm(ways, axis=2).argmax(axis=1)
    first = ways[np.arange(len(far)), far]
    first = first - np.sum(first * normals, axis=1)[:, None] * normals
    first /= np.linalg.norm(first, axis=1)[:, None]
    axes = np.stack([first, np.cross(normals, first), normals], axis=1)
    centres = places.mean(axis=1)
    x, y, z = np.moveaxis(_turned(places - centres[:, None], axes), -1, 0)
    size = np.hypot(x, y).max(axis=1)[:, None]
    powers = _shape_terms(x / size, y / size)
    shape = np.einsum("nck,nk->nc", np.linalg.pinv(powers, rcond=1e-6), z)
    shape /= size ** np.array([0, 1, 1, 2, 2, 2])
    return Surface(centres, axes, shape, thickness)


def _turned(vectors: FloatArray, axes: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("nij,nkj->nki", axes, vectors), dtype=np.float64)


def _shape_terms(x: FloatArray, y: FloatArray) -> FloatArray:
    return np.stack([np.ones_like(x), x, y, x**2 / 2.0, x * y, y**2 / 2.0], axis=-1)


def _over_middle(surface: Surface, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Feet (n, k, 2) of points (n, k, 3) on the middle, heights over it (n, k) and normals."""
    local = _turned(points - surface.centres[:, None], surface.axes)
    foot = local[..., :2]
    _, s1, s2, b11, b12, b22 = surface.shape.T[..., None]
    for _ in range(FOOT_STEPS):
        x, y = np.moveaxis(foot, -1, 0)
        level = np.einsum("nc,nkc->nk", surface.shape, _shape_terms(x, y))
        level -= surface.thickness[:, None] / 2.0
        normal = np.stack([-s1 - b11 * x - b12 * y, -s2 - b12 * x - b22 * y, 1.0 + 0.0 * x], -1)
        normal /= np.linalg.norm(normal, axis=-1)[..., None]
        height = np.einsum("nki,nki->nk", local - np.stack([x, y, level], axis=-1), normal)
        foot = local[..., :2] - height[..., None] * normal[..., :2]
    return foot, height, normal


def bent(
    surface: Surface, curvatures: FloatArray, points: FloatArray, modulus: float, nu: float
) -> Field:
    """Bending with curvatures (m, 3), as k11, k22 and k12, at points (n, k, 3)."""
    foot, height, normal = _over_middle(surface, points)
    x, y = np.moveaxis(foot[:, None], -1, 0)
    k11, k22, k12 = curvatures.T[..., None]
    one, two = k11 * x + k12 * y, k12 * x + k22 * y
    cubics, stretched = _in_plane(surface, curvatures)
    terms = np.stack([x**p * y**q for p, q in CUBICS], axis=-1)
    u = np.einsum("nmac,nmkc->nmka", cubics, np.broadcast_to(terms, (*one.shape, 4)))
    middle = np.concatenate([u, -(x * one + y * two)[..., None] / 2.0], axis=-1)
    lean = normal[:, None] / normal[:, None, :, 2:]
    rise = -(lean[..., 0] * one + lean[..., 1] * two)
    fibre = np.stack([one, two, rise], axis=-1)
    height = height[:, None, :, None]
    thicker = -nu / (1.0 - nu) * (k11 + k22)[..., None] * height**2 / 2.0
    local = middle + height * fibre + thicker * normal[:, None]
    squares = np.stack([x**p * y**q for p, q in SQUARES], axis=-1)
    strain = np.einsum("nmsc,nmkc->nmks", stretched, np.broadcast_to(squares, (*one.shape, 3)))
    strain = strain + height * (curvatures * ENGINEERING)[:, None]
    return Field(
        np.einsum("nmki,nij->nmkj", local, surface.axes),
        _tensors(strain @ plate_law(modulus, nu), normal, surface.axes),
        _tensors(strain / ENGINEERING, normal, surface.axes),
    )


def _in_plane(surface: Surface, curvatures: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients of the cubics, (n, m, 2, 4), and of the strains they leave, (n, m, 3, 3)."""
    b11, b12, b22 = surface.shape[:, 3:, None].transpose(1, 0, 2)
    k11, k22, k12 = -curvatures.T[:, None]
    strains = [
        np.stack([b11 * k11, b11 * k12 + b12 * k11, b12 * k12], axis=-1),
        np.stack([b12 * k12, b12 * k22 + b22 * k12, b22 * k22], axis=-1),
        np.stack(
            [
                b11 * k12 + b12 * k11,
                b11 * k22 + 2.0 * b12 * k12 + b22 * k11,
                b12 * k22 + b22 * k12,
            ],
            axis=-1,
        ),
    ]
    given = np.concatenate(strains, axis=-1)
    cubics = given @ CANCELLING.T
    left = given + cubics @ STRAINS.T
    shape = given.shape[:2]
    return cubics.reshape(*shape, 2, 4), left.reshape(*shape, 3, 3)


def _tensors(plane: FloatArray, normal: FloatArray, axes: FloatArray) -> FloatArray:
    """Tensors (n, m, k, 3, 3) in space from 11, 22 and 12 (n, m, k, 3) in the tangent planes."""
    first = np.zeros_like(normal)
    first[..., 0], first[..., 2] = normal[..., 2], -normal[..., 0]
    first /= np.linalg.norm(first, axis=-1)[..., None]
    tangents = np.stack([first, np.cross(normal, first)], axis=-2) @ axes[:, None]
    full = plane[..., [[0, 2], [2, 1]]]
    return np.asarray(tangents[:, None].swapaxes(-1, -2) @ full @ tangents[:, None])


def plate_law(modulus: float, nu: float) -> FloatArray:
    """Stresses 11, 22, 12 from strains 11, 22, 2 x 12 in plane stress."""
    law = np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, (1.0 - nu) / 2.0]])
    return np.asarray(modulus / (1.0 - nu**2) * law, dtype=np.float64)


def bending_energy(curvatures: FloatArray, modulus: float, nu: float) -> FloatArray:
    """Twice the energy (m, m) of curvatures (m, 3) per volume and square of the height."""
    flat = curvatures * ENGINEERING
    return np.asarray(flat @ plate_law(modulus, nu) @ flat.T)


def bendable(
    surface: Surface, lengths: FloatArray, curvatures: FloatArray, nu: float
) -> FloatArray:
    """Matrices (n, m, m) that leave out the curvatures that would stretch the middle.

    Those are b22 k11 + b11 k22 - 2 b12 k12, by Gauss's theorem. Over a length L they stretch it by
    a 24th of this times L²; they are left out where this is much beside the strain of bending.
    """
    b11, b12, b22 = surface.shape[:, 3:].T
    gauss = np.stack([b22, b11, -2.0 * b12], axis=-1) @ curvatures.T
    ease = np.linalg.inv(bending_energy(curvatures, 1.0, nu))
    much = lengths**4 / (48.0 * surface.thickness**2)
    share = much / (1.0 + much * np.einsum("ni,ij,nj->n", gauss, ease, gauss))
    return np.asarray(
        np.eye(len(curvatures)) - np.einsum("n,ij,nj,nk->nik", share, ease, gauss, gauss)
    )


def widened(surface: Surface, points: FloatArray, shear_modulus: float) -> Field:
    """A tube, round as the face is where it is most curved, under pressure, at points (n, k, 3).

    The displacement r/|r|² from the axis keeps its volume, whatever Poisson's ratio is (Lamé). It
    is scaled by the square of the radius; where a face is flat it is a translation.
    """
    b11, b12, b22 = surface.shape[:, 3:].T
    values, vectors = np.linalg.eigh(np.stack([b11, b12, b12, b22], axis=-1).reshape(-1, 2, 2))
    most = np.abs(values).argmax(axis=1)
    every = np.arange(len(most))
    curvature = values[every, most]
    radius = 1.0 / np.where(curvature == 0.0, np.finfo(np.float32).tiny, curvature)
    along = np.einsum("nj,nji->ni", vectors[every, :, 1 - most], surface.axes[:, :2])
    middle = surface.centres + (surface.shape[:, 0] + radius)[:, None] * surface.axes[:, 2]
    arm = points - middle[:, None]
    arm = arm - np.einsum("nki,ni->nk", arm, along)[..., None] * along[:, None]
    far = np.linalg.norm(arm, axis=-1)[..., None]
    across = np.eye(3) - along[:, None, :, None] * along[:, None, None, :]
    unit = arm / far
    strain = (across - 2.0 * unit[..., None] * unit[..., None, :]) / far[..., None] ** 2
    scale = (radius**2)[:, None, None]
    strain = (strain * scale[..., None])[:, None]
    return Field((arm / far**2 * scale)[:, None], 2.0 * shear_modulus * strain, strain)
