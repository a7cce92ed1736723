"""Cells with nodes on their edges, integrated at 2 places in each direction, free of hourglasses.

Integrated in full these cells are too stiff where a thin part is curved; at Gauss's 2 x 2 x 2
places they are not [1]_, but have motions that strain no place: in the plane of two directions a
and b of the reference cell (from -1 to 1)

    u = a (b² - 1/3) along a,    -b (a² - 1/3) along b,

which in a hexahedron is constant or fades linearly along the third. In a row of single cells they
go on from one to the next. Each is given the stiffness that it has in full, after [2]_. It is seen
by how the strain along a changes with b², and that along b with a², less what constant strains
have of this in a cell that is out of shape. Bending, also of curved cells, has none.

.. [1] O. C. Zienkiewicz, R. L. Taylor and J. M. Too, Reduced integration technique in general
   analysis of plates and shells, International Journal for Numerical Methods in Engineering 3
   (1971) 275-290.
.. [2] D. P. Flanagan and T. Belytschko, A uniform strain hexahedron and quadrilateral with
   orthogonal hourglass control, International Journal for Numerical Methods in Engineering 17
   (1981) 679-706.
"""

from __future__ import annotations

import itertools

import numpy as np

from fem.base.arrays import FloatArray
from fem.elements.solids import gradients_and_volumes, mapped_volumes
from fem.mesh.cells import CellKind

SQUARE_MEAN = 4.0 / 45.0
"""Of b² - 1/3 squared, from -1 to 1."""


def hourglass_rows(
    kind: CellKind, coordinates: FloatArray, shear_modulus: float
) -> tuple[FloatArray, FloatArray]:
    """Amplitudes (e, r, b, d) of the motions that reduced integration does not see, and stiffness.

    Parameters
    ----------
    kind
        "quad8", which has one such motion, or "hexahedron20", which has six.
    coordinates
        Of the nodes in m, shape (e, b, d).
    shear_modulus
        In N/m².

    Returns
    -------
    rows, stiffness
        The latter in N/m for a thickness of 1 m where the cells are plane, shape (e, r).

    Notes
    -----
    In a cube of sides 2 s the amplitude 1 m² (of the displacement times s) has the strains
    (b² - 1/3)/s² and -(a² - 1/3)/s², whose energy with the shear modulus G is half of
    2 G V (4/45 + 4/45)/s⁴; a third of it where they fade. In other cells s² is the product of half
    the sides along a and b.

    Examples
    --------
    >>> from fem.mesh.cells import KINDS
    >>> quad = KINDS["quad8"]
    >>> x, y = (2.0 * quad.nodes - 1.0).T
    >>> u = np.column_stack([x * (y**2 - 1 / 3), -y * (x**2 - 1 / 3)])
    >>> rows, stiffness = hourglass_rows(quad, np.column_stack([x, y])[None], 1.0)
    >>> round(float(np.einsum("erbi,bi->er", rows, u)[0, 0]), 12)
    1.0
    """
    d = kind.dimension
    middle = np.full((1, d), 0.5)
    sides = np.einsum("ebi,bj->eji", coordinates, kind.basis(middle)[1][0])
    squares = np.sum(sides**2, axis=2) / 4.0
    at, weights = kind.reduced_quadrature
    volume = np.abs(mapped_volumes(kind, coordinates, at) @ weights)
    rows, stiffness = [], []
    for a, b in itertools.combinations(range(d), 2):
        bent = [
            squares[:, i, None, None, None] * second_differences(kind, coordinates, i, j)
            for i, j in ((a, b), (b, a))
        ]
        rows.append((bent[0] - bent[1]) / 2.0)
        full = 4.0 * SQUARE_MEAN * shear_modulus * volume / (squares[:, a] * squares[:, b])
        stiffness.append(np.stack([full, full / 3.0][: d - 1], axis=1))
    if d == 3:
        rows += [bent_shear(kind, coordinates, along) for along in range(3)]
        stiffness.append(np.outer(SQUARE_MEAN * shear_modulus * volume, np.ones(3)))
    gradients, _ = gradients_and_volumes(kind, coordinates, middle)
    found = np.concatenate(rows, axis=1)
    of_linear = np.einsum("erbi,ebj->erij", found, coordinates)
    found -= np.einsum("erij,ebj->erbi", of_linear, gradients[:, 0])
    return found, np.concatenate(stiffness, axis=1)


def second_differences(
    kind: CellKind, coordinates: FloatArray, along: int, across: int
) -> FloatArray:
    """Half of the second difference, across the middle, of the strain along a direction.

    Rows (e, r, b, d): one of a plane cell; of a hexahedron the mean of those on its two faces in
    the third direction, and half of their difference.
    """
    d = kind.dimension
    faces = [np.full(d, 0.5)] if d == 2 else [np.full(d, each) for each in (0.0, 1.0)]
    found = []
    for face in faces:
        places = np.tile(face, (3, 1))
        places[:, along], places[:, across] = 0.5, (0.0, 0.5, 1.0)
        slope = kind.basis(places)[1][..., along]
        sides = np.einsum("ebi,qb->eqi", coordinates, slope)
        sides /= np.sum(sides**2, axis=2, keepdims=True)
        found.append(np.einsum("q,qb,eqi->ebi", (0.5, -1.0, 0.5), slope, sides))
    if d == 2:
        return np.stack(found, axis=1)
    return np.stack([found[1] + found[0], found[1] - found[0]], axis=1) / 2.0


def bent_shear(kind: CellKind, coordinates: FloatArray, along: int) -> FloatArray:
    """Half of the second difference (e, 1, b, d), along a direction, of the shear across it."""
    b, c = (i for i in range(3) if i != along)
    places = np.full((3, 3), 0.5)
    places[:, along] = 0.0, 0.5, 1.0
    slopes = kind.basis(places)[1]
    sides = np.einsum("ebi,qbj->eqji", coordinates, slopes)
    sides /= np.prod(np.linalg.norm(sides[:, :, [b, c]], axis=3), axis=2)[..., None, None]
    found = np.zeros((len(coordinates), *coordinates.shape[1:]))
    for one, other in ((b, c), (c, b)):
        share = np.einsum("q,qb->qb", (0.5, -1.0, 0.5), slopes[..., one])
        found += np.einsum("qb,eqi->ebi", share, sides[:, :, other])
    return found[:, None]
