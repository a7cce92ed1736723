"""Whether a mesh hangs together: its pieces, nodes that coincide without being one, loose nodes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError

COINCIDENT = 1e-6
"""Distance below which two nodes are at one place, relative to the size of the mesh."""
MOST_TOLD = 5


class Points(Protocol):
    """What is needed of a mesh."""

    @property
    def points(self) -> FloatArray:
        """Coordinates in m, shape (n, 3)."""

    @property
    def source(self) -> str:
        """Where it comes from."""


class Joined(Protocol):
    """What is needed of a model."""

    @property
    def mesh(self) -> Points:
        """Its mesh."""

    @property
    def links(self) -> IntArray:
        """Pairs of nodes that are joined, shape (m, 2)."""

    @property
    def separate(self) -> bool:
        """Whether nodes at one place may belong to different pieces."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of a model, which share no node and are joined by nothing.

    Parameters
    ----------
    of_node
        Number of the piece of each node, from 0; -1 where nothing is at the node. Shape (n,).
    touching
        Pairs of nodes of different pieces at one place, shape (m, 2).
    coincident
        Pairs of nodes of one piece at one place that nothing joins directly, shape (k, 2).
    """

    of_node: IntArray
    touching: IntArray
    coincident: IntArray

    @property
    def count(self) -> int:
        """How many pieces there are."""
        return int(self.of_node.max(initial=-1)) + 1

    def __repr__(self) -> str:
        return f"<Pieces: {self.count}, touching at {len(self.touching)} nodes>"


def pieces_of(model: Joined) -> Pieces:
    """The pieces of a model.

    Examples
    --------
    >>> import fem
    >>> boxes = [fem.box_mesh("bar", (1.0, 1.0, 1.0), (1, 1, 1), origin=(x, 0.0, 0.0))
    ...     for x in (0.0, 1.0)]
    >>> part = {"bar": fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))}
    >>> pieces_of(fem.StructureModel(fem.joined(boxes), part))
    <Pieces: 1, touching at 0 nodes>
    """
    points, links = model.mesh.points, model.links
    count = len(points)
    graph = coo_array((np.ones(len(links)), (links[:, 0], links[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    used = np.unique(links)
    of_node = np.full(count, -1, dtype=np.int64)
    _, of_node[used] = np.unique(label[used], return_inverse=True)
    size = float(np.ptp(points[used], axis=0).max(initial=0.0))
    near = cKDTree(points[used]).query_pairs(COINCIDENT * size, output_type="ndarray")
    pairs = np.sort(used[np.asarray(near, dtype=np.int64).reshape(-1, 2)], axis=1)
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
    apart = of_node[pairs[:, 0]] != of_node[pairs[:, 1]]
    return Pieces(of_node, pairs[apart], _not_linked(pairs[~apart], links))


def _not_linked(pairs: IntArray, links: IntArray) -> IntArray:
    """Those of some pairs of nodes, each in ascending order, that are no link."""
    if not len(pairs):
        return pairs
    base = int(links.max()) + 1
    return pairs[~np.isin(pairs @ [base, 1], np.sort(links, axis=1) @ [base, 1])]


def check_joined(model: Joined) -> list[str]:
    """Refuse pieces that touch but share no node; a sentence about slits within one, if any are.

    Neither if the model says that nodes at one place are meant.

    Raises
    ------
    ModelError
        With how many nodes there are at one place, and the first of them.
    """
    if model.separate:
        return []
    found = pieces_of(model)
    if len(found.touching):
        nodes = len(np.unique(found.touching))
        raise ModelError(
            f"{model.mesh.source}: {found.count} pieces of the mesh touch but share no node:"
            f" {nodes} nodes are at the place of another one, the first at"
            f" {place_of(model.mesh.points[found.touching[0, 0]])}; merge them"
            " ('merge' in a scene, fem.joined), or say that they are meant ('separate')"
        )
    if not len(found.coincident):
        return []
    return [
        f"{model.mesh.source}: {len(np.unique(found.coincident))} nodes are at the place of another"
        " one that they are not joined with, the first at"
        f" {place_of(model.mesh.points[found.coincident[0, 0]])}: the model has a slit there unless"
        " they are merged"
    ]


def described(model: Joined) -> list[str]:
    """Sentences about the pieces, nodes at one place and loose nodes of a model, for a person."""
    found, points = pieces_of(model), model.mesh.points
    said = []
    if found.count > 1:
        boxes = [_box(points[found.of_node == piece]) for piece in range(found.count)]
        more = f", and {found.count - MOST_TOLD} more" if found.count > MOST_TOLD else ""
        said.append(
            f"the model is in {found.count} pieces that are not joined: "
            + "; ".join(boxes[:MOST_TOLD])
            + more
        )
    for pairs, whose in ((found.touching, "different pieces"), (found.coincident, "one piece")):
        if len(pairs):
            place = place_of(points[pairs[0, 0]])
            said.append(
                f"{len(np.unique(pairs))} nodes of {whose} are at the place of another node that"
                f" they are not joined with, the first at {place}"
            )
    loose = int((found.of_node < 0).sum())
    if loose:
        said.append(f"{loose} nodes belong to no part of the model")
    return said


def _box(points: FloatArray) -> str:
    return (
        f"{len(points)} nodes from {place_of(points.min(axis=0))} to {place_of(points.max(axis=0))}"
    )


def place_of(point: FloatArray) -> str:
    """Coordinates in m, for a person.

    Examples
    --------
    >>> place_of(np.array([0.0, 1.5, -2.0]))
    '(0, 1.5, -2)'
    """
    return "(" + ", ".join(f"{value + 0.0:.6g}" for value in point) + ")"
