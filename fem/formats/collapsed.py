"""Cells some of whose nodes are repeated: the wedges, pyramids, tetrahedra and triangles they mean.

Codes without wedges write one as a hexahedron two of whose edges are a point each. With eight nodes
the functions of the collapsed hexahedron are those of the wedge, the pyramid or the tetrahedron
exactly; with twenty they are not, and what is meant is the cell of second order [1]_.

.. [1] R. E. Newton, Degeneration of brick-type isoparametric elements, International Journal for
   Numerical Methods in Engineering 7 (1973) 579-581.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from itertools import permutations

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.cell_checks import cell_at, has_repeated_nodes
from fem.mesh.cells import KINDS, CellKind

Equals = tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class _Rule:
    """Corners that are one node each, and what the cell then is, of which of its corners."""

    equal: Equals
    shape: str
    corners: tuple[int, ...]


RULES: dict[str, tuple[_Rule, ...]] = {
    "quad": (_Rule(((2, 3),), "triangle", (0, 1, 2)),),
    "hexahedron": (
        _Rule(((2, 3), (6, 7)), "wedge", (0, 1, 2, 4, 5, 6)),
        _Rule(((4, 5, 6, 7),), "pyramid", (0, 1, 2, 3, 4)),
        _Rule(((0, 3), (1, 2), (4, 5), (6, 7)), "tetra", (0, 1, 4, 6)),
    ),
    "wedge": (
        _Rule(((2, 5),), "pyramid", (0, 1, 4, 3, 2)),
        _Rule(((3, 4, 5),), "tetra", (0, 1, 2, 3)),
    ),
    "pyramid": (_Rule(((2, 3),), "tetra", (0, 1, 2, 4)),),
}
"""By shape, one after the other; each holds however the shape is turned or mirrored."""

SECOND_ORDER = {
    "triangle": "triangle6",
    "quad": "quad8",
    "tetra": "tetra10",
    "pyramid": "pyramid13",
    "wedge": "wedge15",
    "hexahedron": "hexahedron20",
}
"""Kinds without nodes inside faces, which a collapsed face has no place for."""
FIRST_ORDER = {kind: shape for shape, kind in SECOND_ORDER.items()} | {s: s for s in SECOND_ORDER}

Named = Mapping[str, Mapping[str, IntArray]]


def uncollapsed(
    points: FloatArray, cells: Mapping[str, IntArray], groups: Named, source: str
) -> tuple[dict[str, IntArray], dict[str, dict[str, IntArray]], list[str]]:
    """The cells of a mesh without repeated nodes.

    Parameters
    ----------
    points
        Coordinates in m, shape (n, 3), for error texts.
    cells
        Node indices (e, b) by kind.
    groups
        Cells by name: for each kind, indices into its array.
    source
        Where the mesh comes from; error texts begin with it.

    Returns
    -------
    cells, groups, notes
        The same with the cells that had repeated nodes as what they mean, at the end of those of
        their new kind, and one sentence for each change.

    Raises
    ------
    ModelError
        For a cell whose repeated nodes leave no cell of another kind, by its number and place.

    Examples
    --------
    >>> cells = {"quad": np.array([[0, 1, 2, 2]])}
    >>> found, groups, notes = uncollapsed(np.eye(3), cells, {"sheet": {"quad": [0]}}, "mesh")
    >>> found["triangle"], groups["sheet"]["triangle"], notes
    (array([[0, 1, 2]]), array([0]), ['mesh: 1 quad with repeated nodes is taken as 1 triangle'])
    """
    kept: dict[str, list[IntArray]] = {}
    origin: dict[str, list[tuple[str, IntArray]]] = {}
    counts: Counter[tuple[str, str]] = Counter()
    for kind, nodes in cells.items():
        repeated = has_repeated_nodes(nodes) if kind in FIRST_ORDER else np.zeros(len(nodes), bool)
        whole = np.flatnonzero(~repeated)
        kept.setdefault(kind, []).insert(0, nodes[whole])
        origin.setdefault(kind, []).insert(0, (kind, whole))
        for target, at, found in _meant(kind, nodes, np.flatnonzero(repeated), points, source):
            kept.setdefault(target, []).append(found)
            origin.setdefault(target, []).append((kind, at))
            counts[kind, target] += len(at)
    if not counts:
        return dict(cells), {name: dict(group) for name, group in groups.items()}, []
    notes = [
        f"{source}: {count} {kind} with repeated nodes {'is' if count == 1 else 'are'} taken as"
        f" {count} {target}"
        for (kind, target), count in counts.items()
    ]
    renumbered = {name: _renumbered(group, cells, origin) for name, group in groups.items()}
    joined = {kind: np.concatenate(blocks) for kind, blocks in kept.items()}
    return {kind: nodes for kind, nodes in joined.items() if len(nodes)}, renumbered, notes


def _renumbered(
    group: Mapping[str, IntArray],
    cells: Mapping[str, IntArray],
    origin: Mapping[str, list[tuple[str, IntArray]]],
) -> dict[str, IntArray]:
    """The indices of a group's cells after the change."""
    inside = {kind: np.zeros(len(nodes), dtype=np.bool_) for kind, nodes in cells.items()}
    for kind, at in group.items():
        inside[kind][at] = True
    marks = {
        kind: np.concatenate([inside[old][at] for old, at in blocks])
        for kind, blocks in origin.items()
    }
    return {kind: np.flatnonzero(mark) for kind, mark in marks.items() if mark.any()}


def _meant(
    kind: str, nodes: IntArray, at: IntArray, points: FloatArray, source: str
) -> list[tuple[str, IntArray, IntArray]]:
    """Kind, indices and nodes of what the cells at some indices mean, by pattern."""
    found = []
    own = nodes[at]
    same = own[:, :, None] == own[:, None, :]
    patterns, which = np.unique(same.argmax(axis=2), axis=0, return_inverse=True)
    for number, pattern in enumerate(patterns):
        of_pattern = at[which.ravel() == number]
        meaning = _meaning(kind, tuple(pattern.tolist()))
        if meaning is None:
            cell = int(of_pattern[0])
            first = cell_at(kind, cell, points[nodes[cell]])
            raise ModelError(
                f"{source}: {first} has repeated nodes, but is no wedge, pyramid, tetrahedron or"
                f" triangle by them ({len(of_pattern)} such cells)"
            )
        target, local = meaning
        found.append((target, of_pattern, nodes[of_pattern][:, list(local)]))
    return found


@cache
def _meaning(kind: str, pattern: tuple[int, ...]) -> tuple[str, tuple[int, ...]] | None:
    """What kind a pattern of repeated nodes means, and which of the nodes are its own.

    A pattern has for each node the first one that it is the same as.
    """
    cell, shape = KINDS[kind], FIRST_ORDER[kind]
    count = len(cell.corners)
    found = _corners_of(shape, tuple(pattern[:count]))
    if found is None:
        return None
    target, corners = found
    if cell.order == 1:
        return target, corners
    between = _middles(cell, pattern)
    if between is None:
        return None
    further: list[int] = []
    for a, b in KINDS[target].edges:
        middle = between.get(frozenset((pattern[corners[a]], pattern[corners[b]])), ())
        if len(middle) != 1:
            return None
        further.extend(middle)
    if len({*further, *corners}) < len(further) + len(corners):
        return None
    return SECOND_ORDER[target], (*corners, *further)


def _middles(cell: CellKind, pattern: tuple[int, ...]) -> dict[frozenset[int], set[int]] | None:
    """Nodes between each two corners; None if an edge of no length has one of its own."""
    found: dict[frozenset[int], set[int]] = {}
    for number, (a, b) in enumerate(cell.edges, start=len(cell.corners)):
        ends = frozenset((pattern[a], pattern[b]))
        if len(ends) == 2:
            found.setdefault(ends, set()).add(pattern[number])
        elif pattern[number] not in ends:
            return None
    return found


def _corners_of(shape: str, pattern: tuple[int, ...]) -> tuple[str, tuple[int, ...]] | None:
    """The shape that is left when corners are repeated, and its corners among those given."""
    if len(set(pattern)) == len(pattern):
        return shape, tuple(range(len(pattern)))
    for turned in _symmetries(shape):
        own = tuple(pattern[i] for i in turned)
        for rule in RULES.get(shape, ()):
            if all(len({own[i] for i in corners}) == 1 for corners in rule.equal):
                inner = _corners_of(rule.shape, tuple(own[i] for i in rule.corners))
                if inner is not None:
                    return inner[0], tuple(turned[rule.corners[i]] for i in inner[1])
    return None


@cache
def _symmetries(shape: str) -> tuple[tuple[int, ...], ...]:
    """All ways to number the corners of a shape by which its edges stay edges."""
    kind = KINDS[shape]
    count = len(kind.corners)
    orders = np.array(list(permutations(range(count))))
    is_edge = np.zeros((count, count), dtype=np.bool_)
    for a, b in kind.edges:
        is_edge[a, b] = is_edge[b, a] = True
    ends = np.array(kind.edges)
    kept = is_edge[orders[:, ends[:, 0]], orders[:, ends[:, 1]]].all(axis=1)
    return tuple(tuple(order) for order in orders[kept].tolist())
