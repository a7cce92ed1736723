"""From a deck to the cells and names of a mesh."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.formats.abaqus.attached import Gathered
from fem.formats.abaqus.deck import Body, Deck, Label, bare
from fem.formats.abaqus.keywords import Keyword
from fem.formats.abaqus.sets import Resolver
from fem.formats.abaqus.surfaces import Surfaces
from fem.formats.abaqus.types import ORDERS
from fem.formats.content import CellBlock, MeshContent
from fem.formats.ignored import TYPE_PREFIX

OFF_FACE = 0.3  # of a cell's size: farther off, a node is not the one of its place in the row


@dataclass
class Cells:
    """Cells by kind: their nodes, and where each element went."""

    nodes: dict[str, list[list[int]]] = field(default_factory=dict)
    index: dict[Label, tuple[str, int]] = field(default_factory=dict)
    types: dict[str, list[tuple[str, int]]] = field(default_factory=dict)


def numbered_nodes(deck: Deck) -> tuple[dict[Label, int], dict[Label, FloatArray]]:
    """Positions of all nodes in the mesh, in the order of the file, and their places."""
    bodies = [body for name, body in deck.bodies.items() if name] + [deck.bodies[""]]
    places = {(body.name, label): place for body in bodies for label, place in body.nodes()}
    return {label: i for i, label in enumerate(places)}, places


def collected_cells(deck: Deck, resolver: Resolver, position: dict[Label, int]) -> Cells:
    """All elements that are cells."""
    cells = Cells()
    for body in deck.bodies.values():
        for label, element in body.elements():
            kind = element.type.kind
            if kind is None:
                continue
            nodes = [
                position.get((body.name, node), -1) if isinstance(node, int) else -1
                for node in element.nodes
            ]
            if min(nodes) < 0:  # of another instance, or not there
                nodes = [position[node] for node in resolver.nodes_of((body.name, label))]
            if len(nodes) != element.type.count:
                raise deck.fail(
                    f"{element.place}: element {label} of type {element.type.name} has"
                    f" {len(nodes)} nodes, not {element.type.count}"
                )
            rows = cells.nodes.setdefault(kind, [])
            cells.index[body.name, label] = (kind, len(rows))
            cells.types.setdefault(element.type.name, []).append((kind, len(rows)))
            rows.append([nodes[i] for i in ORDERS[kind]] if kind in ORDERS else nodes)
    return cells


def named_sets(
    deck: Deck, resolver: Resolver, kind: str, surfaces: Surfaces | None = None
) -> dict[str, list[Label]]:
    """All sets of a kind by the names that a scene uses.

    A set of the deck or of the assembly has its plain name. One of a part has it too, where no
    other part and not the assembly has the name; and always INSTANCE.NAME and PART.NAME, the
    latter over all instances.
    """
    plain: dict[str, tuple[str, list[Label]]] = {}
    root = deck.bodies[""]
    for name, labels in _sets_of(root, resolver, kind, surfaces):
        plain[name.upper()] = (name, labels)
    homes: dict[str, dict[str, tuple[str, list[Label]]]] = {}
    dotted: dict[str, list[Label]] = {}
    for body in deck.bodies.values():
        if body is root:
            continue
        home = body.scopes[0].name
        for name, labels in _sets_of(body, resolver, kind, surfaces):
            dotted[f"{body.name}.{name}"] = labels
            _, all_labels = homes.setdefault(name.upper(), {}).setdefault(home, (name, []))
            all_labels.extend(labels)
    for key, by_home in homes.items():
        for home, (name, labels) in by_home.items():
            if key not in plain and len(by_home) == 1:
                dotted[name] = labels
            dotted.setdefault(f"{home}.{name}", labels)
    return {**{name: labels for name, labels in plain.values()}, **dotted}


def _sets_of(
    body: Body, resolver: Resolver, kind: str, surfaces: Surfaces | None
) -> list[tuple[str, list[Label]]]:
    found: dict[str, tuple[str, list[Label]]] = {}
    for scope in body.scopes:
        for key, named in scope.sets[kind].items():
            place = named.keyword.place() if named.keyword else "its first line"
            found[key] = (named.name, resolver.labels(kind, body, named.name, place))
    if surfaces is not None:
        for keyword in _surfaces_of(body):
            name = keyword.name_of("NAME")
            key = name.upper() if name.upper() not in found else f"SURFACE {name.upper()}"
            shown = name if key == name.upper() else f"surface {name}"
            found[key] = (shown, surfaces.of(body, keyword))
    return list(found.values())


def _surfaces_of(body: Body) -> list[Keyword]:
    return [keyword for keyword in body.later() if keyword.name == "SURFACE"]


def _check_ignored(deck: Deck, elements: dict[str, list[Label]], cells: Cells) -> None:
    """Refuse to ignore a set of which masses, springs or dampers would stay."""
    for name in (name for name in elements if bare(name) in deck.ignore):
        stay = [label for label in elements[name] if label not in cells.index]
        if stay:
            raise deck.fail(
                f"{name!r} is to be ignored, but {len(stay)} of its elements (the first is"
                f" {stay[0][1]}) are masses, springs or dampers; take those out of the file"
            )


def content_of(
    deck: Deck,
    cells: Cells,
    gathered: Gathered,
    position: dict[Label, int],
    places: dict[Label, FloatArray],
    surfaces: Surfaces,
) -> MeshContent:
    """Points, cells and names."""
    kinds = list(cells.nodes)
    blocks = [(kind, np.array(nodes, dtype=np.int64)) for kind, nodes in cells.nodes.items()]
    points = np.array(list(places.values()), dtype=np.float64).reshape(-1, 3)
    _check_centres(deck, dict(blocks), points, cells)
    nodes = named_sets(deck, gathered.resolver, "NSET", surfaces) | gathered.sets
    elements = named_sets(deck, gathered.resolver, "ELSET")
    _check_ignored(deck, elements, cells)
    cell_sets = {name: _by_kind(kinds, cells, labels) for name, labels in elements.items()}
    for name, found in cells.types.items():
        cell_sets[TYPE_PREFIX + name] = [
            np.array([at for own, at in found if own == kind], dtype=np.int64) for kind in kinds
        ]
    point_sets = {
        name: np.unique(np.array([position[label] for label in labels], dtype=np.int64))
        for name, labels in nodes.items()
    }
    cells_of = [CellBlock(kind, nodes) for kind, nodes in blocks]
    return MeshContent(points, cells_of, point_sets=point_sets, cell_sets=cell_sets)


def _by_kind(kinds: list[str], cells: Cells, labels: list[Label]) -> list[IntArray]:
    """Positions of elements among the cells of each kind; masses and springs are no cells."""
    found: dict[str, list[int]] = {kind: [] for kind in kinds}
    for label in labels:
        if label in cells.index:
            kind, at = cells.index[label]
            found[kind].append(at)
    return [np.unique(np.array(found[kind], dtype=np.int64)) for kind in kinds]


def _check_centres(
    deck: Deck, blocks: dict[str, IntArray], points: FloatArray, cells: Cells
) -> None:
    """The last node of a hexahedron27 must be at its centre, whatever order the file has."""
    nodes = blocks.get("hexahedron27")
    if nodes is None:
        return
    corners = points[nodes[:, :8]]
    size = np.ptp(corners, axis=1).max(axis=1)
    for at in (*range(20, 26), 26):
        where = _FACE_CORNERS[at - 20] if at < 26 else list(range(8))
        off = np.linalg.norm(points[nodes[:, at]] - corners[:, where].mean(axis=1), axis=1)
        bad = np.flatnonzero(off > OFF_FACE * size)
        if len(bad):
            label = next(k for k, v in cells.index.items() if v == ("hexahedron27", bad[0]))
            raise deck.fail(f"element {label[1]}: nodes 21 to 27 are not its centre and its faces")


_FACE_CORNERS = ([0, 3, 7, 4], [1, 2, 6, 5], [0, 1, 5, 4], [2, 3, 7, 6], [0, 1, 2, 3], [4, 5, 6, 7])
