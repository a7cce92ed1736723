"""What a model can be but hardly is: masses that nothing carries or given twice, wrong units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from fem.constraints import measures
from fem.errors import ModelError
from fem.mesh import FloatArray, IntArray
from fem.model import BeamPart, FrameModel
from fem.pieces import place_of
from fem.structure import StructureModel
from fem.tapers import along

THICK = 0.5
"""Thickness of a shell over the side of a square of its area."""


class UnlikelyWarning(UserWarning):
    """A mass that is there twice, a shell as thick as it is wide, a beam as thick as long."""


def check_masses_carried(model: FrameModel | StructureModel) -> None:
    """Refuse point masses at nodes that no part, link, coupling, equation or spring holds.

    Raises
    ------
    ModelError
        With the name of the point and its place.
    """
    mesh = model.mesh
    carried = np.zeros(len(mesh.points), dtype=np.bool_)
    carried[model.links.ravel()] = True
    names = [point for link in model.attached.links for point in link.points]
    for name in (*names, *(spring.point for spring in model.springs)):
        carried[mesh.node(name)] = True
    for lump in model.attached.point_masses:
        node = mesh.node(lump.point)
        if not carried[node]:
            raise ModelError(
                f"{mesh.source}: the point mass at {lump.point!r}, {place_of(mesh.points[node])}, "
                "is at no part of the model, and nothing joins it to one"
            )


def unlikely(model: FrameModel | StructureModel) -> Iterator[str]:
    """A sentence for whatever is possible but looks like a mistake."""
    mesh = model.mesh
    heavy = [lump for lump in model.attached.point_masses if lump.mass > 0.0]
    count = Counter(mesh.node(lump.point) for lump in heavy)
    brought = {mesh.node(lump.point) for lump in mesh.attachments.point_masses}
    for node, name in {mesh.node(lump.point): lump.point for lump in heavy}.items():
        if count[node] > 1:
            also = " (of the file, too)" if node in brought else ""
            yield f"{mesh.source}: {count[node]} point masses are at {name!r}{also}: all are taken"
    for name, thickness, width, what in _proportions(model):
        if thickness > THICK * width:
            yield (
                f"{mesh.source}: part {name!r} is {thickness:.3g} m thick and {what} {width:.3g} m:"
                " is that its unit?"
            )


def _proportions(model: FrameModel | StructureModel) -> Iterator[tuple[str, float, float, str]]:
    """Thickness of shells, or side of a square of a beam's area; what to compare it with; words."""
    points = model.mesh.points
    if isinstance(model, StructureModel):
        for name, (shell, facets) in model.shells.items():
            area = sum(float(measures(kind, points[nodes]).sum()) for kind, nodes in facets.items())
            yield name, shell.thickness, float(np.sqrt(area)), "as large as a square of"
        beams = model.beams
    else:
        beams = {
            name: (part, model.mesh.lines[elements])
            for name, elements in model.element_parts().items()
            if isinstance(part := model.parts[name], BeamPart)
        }
    for name, (beam, ends) in beams.items():
        area = np.max(along(beam, model.mesh, ends, f"part {name!r}").section.area)
        yield name, float(np.sqrt(area)), _length(points, ends), "in all as long as"


def _length(points: FloatArray, ends: IntArray) -> float:
    """Of all lines together in m."""
    return float(np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1).sum())
