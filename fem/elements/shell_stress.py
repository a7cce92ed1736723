"""Stress in shells."""

from __future__ import annotations

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.elements.shells import TRIANGLES, shell_rows
from fem.mesh.cells import CellKind
from fem.model.parts import ShellPart


def outer_stress(
    part: ShellPart,
    kind: CellKind,
    points: FloatArray,
    nodes: IntArray,
    normals: FloatArray,
    shape: FloatArray,
) -> FloatArray:
    """Von Mises' stress (e,) in Pa on that face of each facet where it is greater.

    From the means over the facet of the strains of its middle surface and of its curvatures.

    Parameters
    ----------
    part, kind, points, nodes, normals
        As `fem.elements.shells.shell_rows` takes them.
    shape
        Six displacements of every node of the mesh, shape (n, 6).
    """
    if part.section is not None:
        raise ModelError("stress is not computed in shells with layers or a section of their own")
    rows, weights = shell_rows(part, kind, points, nodes, normals)
    found = np.einsum("erj,ej->er", rows, shape[nodes].reshape(len(nodes), -1))
    pieces = TRIANGLES[kind.name]
    triangles = found[:, : 6 * len(pieces)].reshape(len(nodes), -1, 6)[..., :3]
    area = weights[:, : 6 * len(pieces)].reshape(len(nodes), -1, 6)[..., :1]
    middle = (triangles * area).sum(axis=1) / area.sum(axis=1)
    places = found[:, 6 * len(pieces) :].reshape(len(nodes), -1, 5)[..., :3]
    area = weights[:, 6 * len(pieces) :].reshape(len(nodes), -1, 5)[..., :1]
    bent = (places * area).sum(axis=1) / area.sum(axis=1) * part.thickness / 2.0
    faces = [von_mises_of(part, middle + side * bent) for side in (1.0, -1.0)]
    return np.asarray(np.maximum(*faces), dtype=np.float64)


def von_mises_of(part: ShellPart, strains: FloatArray) -> FloatArray:
    """Von Mises' stress of plane stress from sum, difference and shear of strains (e, 3).

    Examples
    --------
    >>> from fem.model.parts import Material
    >>> part = ShellPart(Material(100.0, 1.0, 0.3), 1.0)
    >>> float(np.round(von_mises_of(part, np.array([[0.7, 1.3, 0.0]])), 12)[0])
    100.0
    """
    nu = part.material.poissons_ratio_for("shell part")
    E = part.material.youngs_modulus
    mean = E / (1.0 - nu) * strains[:, 0] / 2.0
    half, shear = (E / (1.0 + nu) * strains[:, i] / 2.0 for i in (1, 2))
    return np.asarray(np.sqrt(mean**2 + 3.0 * (half**2 + shear**2)), dtype=np.float64)
