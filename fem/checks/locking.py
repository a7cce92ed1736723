"""First-order solids that are too stiff in bending, found before they give wrong numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.mesh.cells import KINDS, all_facets, measures
from fem.model.parts import SolidPart
from fem.model.structure import StructureModel, once

TOLERABLE = 0.05
"""Parasitic stiffness in bending, relative, above which a part is warned of."""


def locking_warnings(model: StructureModel) -> Iterator[str]:
    """One sentence for every part of first-order cells that is thin against its cells.

    Notes
    -----
    A linear cell of length h cannot bend; it shears by the curvature times the distance from its
    middle. In a beam of thickness t this adds (G/E)(h/t)² = (h/t)²/(2 (1 + nu)) to the bending
    stiffness of 1, however many cells lie through the thickness. The thickness of a part is
    estimated as twice its volume over its surface, which is that of a plate or a thin beam.
    """
    for name, (part, kinds) in model.solids.items():
        linear = [kind for kind in kinds if KINDS[kind].order == 1]
        thick = thickness(model.mesh.points, kinds) if linear else 0.0
        for kind in linear:
            ratio = thick / typical_length(model.mesh.points, kind, kinds[kind])
            excess = stiffening(part, ratio)
            if excess > TOLERABLE:
                yield (
                    f"{model.mesh.source}: part {name!r} is of first-order cells ({kind}) and"
                    f" its thickness is {ratio:.2g} of their length; where it bends along them"
                    f" it is about {1.0 + excess:.3g} times too stiff; use second-order cells"
                )


def stiffening(part: SolidPart, ratio: float) -> float:
    """Parasitic share of the bending stiffness at a ratio of thickness to cell length."""
    return 1.0 / (2.0 * (1.0 + part.material.poissons_ratio_for("solid part")) * ratio**2)


def thickness(points: FloatArray, kinds: Mapping[str, IntArray]) -> float:
    """Of a part in m: twice the volume of its cells over the surface around all of them."""
    volume = sum(float(measures(kind, points[nodes]).sum()) for kind, nodes in kinds.items())
    outer = {kind: once(facets, kind) for kind, facets in all_facets([kinds]).items()}
    surface = sum(float(measures(kind, points[nodes]).sum()) for kind, nodes in outer.items())
    return 2.0 * volume / surface


def typical_length(points: FloatArray, kind: str, nodes: IntArray) -> float:
    """The longest edge of a cell in m, the median over the cells."""
    ends = points[nodes[:, np.array(KINDS[kind].edges)]]
    longest = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1)
    return float(np.median(longest))
