"""What a model can be but hardly is: masses nowhere or twice, cells upon others, wrong units."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.elements.tapers import along
from fem.mesh.cells import measures
from fem.mesh.pieces import place_of
from fem.model.structure import StructureModel

THICK = 0.5
"""Thickness of a shell over the side of a square of its area."""
DIRECTIONS = 1e5  # steps of a component, within one of which two directions are the same
FLAT = 1e-9  # of the largest: area of a facet that has none


class UnlikelyWarning(UserWarning):
    """A mass or a cell that is there twice, a shell as thick as wide, a beam as thick as long."""


def check_masses_carried(model: StructureModel) -> None:
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
    for name in model.attached.loose:  # where nothing joins them, they are held
        carried[mesh.nodes(name)] = True
    for lump in model.attached.point_masses:
        node = mesh.node(lump.point)
        if not carried[node]:
            raise ModelError(
                f"{mesh.source}: the point mass at {lump.point!r}, {place_of(mesh.points[node])}, "
                "is at no part of the model, and nothing joins it to one"
            )


def unlikely(model: StructureModel) -> Iterator[str]:
    """A sentence for whatever is possible but looks like a mistake."""
    mesh = model.mesh
    heavy = [lump for lump in model.attached.point_masses if lump.mass > 0.0]
    count = Counter(mesh.node(lump.point) for lump in heavy)
    brought = {mesh.node(lump.point) for lump in mesh.attachments.point_masses}
    for node, name in {mesh.node(lump.point): lump.point for lump in heavy}.items():
        if count[node] > 1:
            also = " (of the file, too)" if node in brought else ""
            yield f"{mesh.source}: {count[node]} point masses are at {name!r}{also}: all are taken"
    for many, node, what in _upon_each_other(model):
        if many:
            yield (
                f"{mesh.source}: {what} lie upon others ({many} times; the first leave the node at"
                f" {place_of(mesh.points[node])} in one direction): mass and stiffness count twice"
            )
    for name, thickness, width, what in _proportions(model):
        if thickness > THICK * width:
            yield (
                f"{mesh.source}: part {name!r} is {thickness:.3g} m thick and {what} {width:.3g} m:"
                " is that its unit?"
            )


def _upon_each_other(model: StructureModel) -> Iterator[tuple[int, int, str]]:
    """How many beams and facets of shells leave a node or an edge as another does; a node; what.

    Of parts without an offset. Beams that leave one node in one direction lie upon each other, and
    so do flat facets that leave an edge inwards in one direction.
    """
    points = model.mesh.points
    beams = model.beams.values()
    lines = [ends for part, ends in beams if not any(part.offset) and part.end_offsets is None]
    if lines:
        ends = np.concatenate(lines)
        ends = np.concatenate([ends, ends[:, ::-1]])
        yield *_alike(ends[:, :1], points[ends[:, 1]] - points[ends[:, 0]]), "beams"
    edges, inwards = [np.empty((0, 2), dtype=np.int64)], [np.empty((0, 3))]
    for shell, kinds in model.shells.values():
        for nodes in kinds.values() if not shell.offset else ():
            pairs = np.stack([nodes, np.roll(nodes, -1, axis=1)], axis=2)
            centre = points[nodes].mean(axis=1)[:, None] - points[pairs[..., 0]]
            along = points[pairs[..., 1]] - points[pairs[..., 0]]
            part = (centre * along).sum(axis=2) / (along**2).sum(axis=2)
            inwards.append((centre - part[..., None] * along).reshape(-1, 3))
            edges.append(np.sort(pairs.reshape(-1, 2), axis=1))
    yield *_alike(np.concatenate(edges), np.concatenate(inwards)), "facets of shells"


def _alike(nodes: IntArray, directions: FloatArray) -> tuple[int, int]:
    """How many rows have the nodes and, to 1e-5, the direction of an earlier one; a node of one."""
    length = np.linalg.norm(directions, axis=1)
    some = length > FLAT * np.max(length, initial=0.0)  # flat facets are refused elsewhere
    nodes, unit = nodes[some], directions[some] / length[some, None]
    keys = np.column_stack([nodes, np.rint(DIRECTIONS * unit).astype(np.int64)])
    _, first = np.unique(keys, axis=0, return_index=True)
    again = np.setdiff1d(np.arange(len(keys)), first)
    return len(again), int(nodes[again[0], 0]) if len(again) else -1


def _proportions(model: StructureModel) -> Iterator[tuple[str, float, float, str]]:
    """Thickness of shells, or side of a square of a beam's area; what to compare it with; words."""
    points = model.mesh.points
    for name, (shell, facets) in model.shells.items():
        area = sum(float(measures(kind, points[nodes]).sum()) for kind, nodes in facets.items())
        yield name, shell.thickness, float(np.sqrt(area)), "as large as a square of"
    for name, (beam, ends) in model.beams.items():
        area = np.max(along(beam, model.mesh, ends, f"part {name!r}").section.area)
        yield name, float(np.sqrt(area)), _length(points, ends), "in all as long as"


def _length(points: FloatArray, ends: IntArray) -> float:
    """Of all lines together in m."""
    return float(np.linalg.norm(points[ends[:, 1]] - points[ends[:, 0]], axis=1).sum())
