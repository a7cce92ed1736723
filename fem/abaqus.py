"""Read nodes, elements and sets of Abaqus input files.

meshio 5.3 has a reader of its own, but it loses or mixes up sets in ordinary frame files: a set
that grows over several ``*ELEMENT`` keywords, a keyword in lower case, a second ``*NODE``, a set
named inside a set, the orientation node of a B31. This one reads these, and the result is the
same `meshio.Mesh`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import meshio
import numpy as np

from fem.cells import KINDS
from fem.errors import ModelError
from fem.mesh import IntArray

TWO_NODE_LINES: tuple[str, ...] = ("B21", "B23", "B31", "B31OS", "B33", "FRAME2D", "FRAME3D")
TWO_NODE_LINES += ("PIPE21", "PIPE31", "T2D2", "T3D2")
THREE_NODE_LINES = ("B22", "B32", "B32OS", "PIPE22", "PIPE32", "T2D3", "T3D3")

_PLANE_SOLIDS = {"3": "triangle", "4": "quad", "6": "triangle6", "8": "quad8"}
SOLIDS = {f"{p}{count}": kind for p in ("CPS", "CPE") for count, kind in _PLANE_SOLIDS.items()}
SOLIDS |= {"C3D4": "tetra", "C3D8": "hexahedron", "C3D10": "tetra10", "C3D20": "hexahedron20"}
SOLIDS |= {"C3D6": "wedge", "C3D15": "wedge15", "C3D5": "pyramid", "C3D13": "pyramid13"}
"""Solid elements by the kind of their cells; a suffix for another integration changes nothing."""

LONGEST_RANGE = 10_000_000  # numbers, of all ranges of a file together
MOST_INCLUDED = 100  # files, each counted as often as it is included


@dataclass(frozen=True)
class _Keyword:
    name: str
    parameters: dict[str, str]
    rows: list[list[str]]


@dataclass
class _Deck:
    path: Path
    folders: list[Path] = field(default_factory=list)
    included: int = 0
    generated: int = 0
    nodes: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[int, tuple[str, tuple[int, ...]]] = field(default_factory=dict)
    sets: dict[str, dict[str, tuple[str, list[int]]]] = field(
        default_factory=lambda: {"NSET": {}, "ELSET": {}}
    )

    def fail(self, text: str) -> ModelError:
        return ModelError(f"{self.path}: {text}")

    def grow(self, kind: str, name: str, labels: list[int]) -> None:
        self.sets[kind].setdefault(name.upper(), (name, []))[1].extend(labels)


def read_abaqus(path: str | Path, include_folders: Iterable[str | Path] = ()) -> meshio.Mesh:
    """Read the nodes, elements and sets of an Abaqus input file.

    Parameters
    ----------
    path
        Input file with ``*NODE``, ``*ELEMENT``, ``*NSET``, ``*ELSET`` (lists, names of sets,
        GENERATE) and ``*INCLUDE``; other keywords are passed over. Upper and lower case are the
        same, and a set keeps the spelling of its first occurrence.
    include_folders
        Folders below which included files may be, beside that of the file.

    Returns
    -------
    meshio.Mesh
        Line cells of the beam, truss, pipe and frame elements and cells of the solid ones, with
        cell sets and point sets.

    Raises
    ------
    ModelError
        For a label defined twice (several parts in one file), one that is not defined, an
        instance that is moved, a second-order element, or an included file in another folder.

    Examples
    --------
    >>> read_abaqus("meshes/half_beam.inp").cells[0].type
    'line'
    """
    folders = [Path(path).parent, *map(Path, include_folders)]
    deck = _Deck(Path(path), [folder.resolve() for folder in folders])
    for keyword in _keywords(deck, deck.path):
        if keyword.name in _ACTIONS:
            _ACTIONS[keyword.name](deck, keyword)
    if not deck.nodes:
        raise deck.fail("is not an Abaqus input file with nodes (there is no *NODE)")
    return _to_meshio(deck)


def _keywords(deck: _Deck, path: Path) -> Iterator[_Keyword]:
    current: _Keyword | None = None
    for line in _logical_lines(path):
        words = [word.strip() for word in line.split(",")]
        if line.startswith("*"):
            if current:
                yield from _included(deck, path, current)
            current = _Keyword(words[0][1:].strip().upper(), _parameters(words[1:]), [])
        elif current:
            current.rows.append(words)
    if current:
        yield from _included(deck, path, current)


def _logical_lines(path: Path) -> Iterator[str]:
    """Lines without comments; a keyword that ends in a comma goes on in the next line."""
    pending = ""
    for raw in path.read_text(encoding="utf-8", errors="replace").splitlines():
        line = pending + raw.strip()
        if not line or line.startswith("**"):
            continue
        pending = line if line.startswith("*") and line.endswith(",") else ""
        if not pending:
            yield line


def _included(deck: _Deck, path: Path, keyword: _Keyword) -> Iterator[_Keyword]:
    if keyword.name != "INCLUDE":
        yield keyword
        return
    other = path.parent / keyword.parameters.get("INPUT", "")
    if not any(other.resolve().is_relative_to(folder) for folder in deck.folders):
        raise ModelError(f"{path}: the included file {other} is in a folder that is not allowed")
    if not other.is_file():
        raise ModelError(f"{path}: the included file {other} does not exist")
    deck.included += 1
    if deck.included > MOST_INCLUDED:
        raise ModelError(f"{path}: more than {MOST_INCLUDED} files are included (in a circle?)")
    yield from _keywords(deck, other)


def _parameters(words: list[str]) -> dict[str, str]:
    pairs = (word.partition("=") for word in words if word)
    return {name.strip().upper(): value.strip().strip('"') for name, _, value in pairs}


def _read_nodes(deck: _Deck, keyword: _Keyword) -> None:
    for row in keyword.rows:
        label = int(row[0])
        if label in deck.nodes:
            raise deck.fail(f"node {label} is defined twice (write one part to a file)")
        deck.nodes[label] = ([float(x or 0.0) for x in row[1:4]] + [0.0, 0.0, 0.0])[:3]
        if "NSET" in keyword.parameters:
            deck.grow("NSET", keyword.parameters["NSET"], [label])


def _read_elements(deck: _Deck, keyword: _Keyword) -> None:
    kind = keyword.parameters.get("TYPE", "").upper().removesuffix("H")
    if kind in THREE_NODE_LINES:
        raise deck.fail(f"elements of type {kind!r} are not straight two-node lines")
    solid = next((name for name in SOLIDS if re.fullmatch(f"{name}[RIMT]*", kind)), None)
    if kind not in TWO_NODE_LINES and solid is None:
        return
    cell = "line" if solid is None else SOLIDS[solid]
    count = KINDS[cell].node_count
    words = [word for row in keyword.rows for word in row if word]
    rows = keyword.rows if solid is None else _cut(deck, words, count + 1)
    for row in rows:
        label, *nodes = (int(word) for word in row[: count + 1])
        if label in deck.elements:
            raise deck.fail(f"element {label} is defined twice (write one part to a file)")
        deck.elements[label] = (cell, tuple(nodes))
        if "ELSET" in keyword.parameters:
            deck.grow("ELSET", keyword.parameters["ELSET"], [label])


def _cut(deck: _Deck, words: list[str], length: int) -> list[list[str]]:
    """The words of elements that may go on over several lines, one list for each element."""
    if len(words) % length:
        raise deck.fail(f"a list of elements does not hold {length - 1} nodes for each of them")
    return [words[first : first + length] for first in range(0, len(words), length)]


def _read_set(deck: _Deck, keyword: _Keyword) -> None:
    kind = keyword.name
    if kind not in keyword.parameters:
        raise deck.fail(f"a *{kind} has no name")
    name = keyword.parameters[kind]
    deck.grow(kind, name, [])
    for row in ([word for word in row if word] for row in keyword.rows):
        if "GENERATE" in keyword.parameters:
            first, last, step = [*(int(word) for word in row), 1][:3]
            deck.generated += max(0, last - first) // max(step, 1)
            if step < 1 or deck.generated > LONGEST_RANGE:
                raise deck.fail(f"set {name!r} cannot run from {first} to {last} by {step}")
            deck.grow(kind, name, list(range(first, last + 1, step)))
        else:
            for word in row:
                deck.grow(kind, name, _members(deck, kind, word))


def _members(deck: _Deck, kind: str, word: str) -> list[int]:
    word = word.strip('"')
    if word.isdigit():
        return [int(word)]
    if word.upper() not in deck.sets[kind]:
        raise deck.fail(f"a *{kind} names the set {word!r}, which is not defined before it")
    return list(deck.sets[kind][word.upper()][1])


def _read_instance(deck: _Deck, keyword: _Keyword) -> None:
    if keyword.rows:
        name = keyword.parameters.get("NAME", "")
        raise deck.fail(f"instance {name!r} is moved, which is not read; write a flat file")


_ACTIONS: dict[str, Callable[[_Deck, _Keyword], None]] = {
    "NODE": _read_nodes,
    "ELEMENT": _read_elements,
    "NSET": _read_set,
    "ELSET": _read_set,
    "INSTANCE": _read_instance,
}


def _to_meshio(deck: _Deck) -> meshio.Mesh:
    node = {label: i for i, label in enumerate(deck.nodes)}
    for label, (_, nodes) in deck.elements.items():
        for end in nodes:
            if end not in node:
                raise deck.fail(f"element {label} ends at node {end}, which is not defined")
    for name, labels in deck.sets["NSET"].values():
        missing = [label for label in labels if label not in node]
        if missing:
            raise deck.fail(f"set {name!r} holds node {missing[0]}, which is not defined")
    kinds = list(dict.fromkeys(kind for kind, _ in deck.elements.values())) or ["line"]
    labels_of = {
        kind: [label for label, (own, _) in deck.elements.items() if own == kind] for kind in kinds
    }
    index = {kind: {label: i for i, label in enumerate(labels_of[kind])} for kind in kinds}
    cells = [
        (
            kind,
            np.array(
                [[node[n] for n in deck.elements[label][1]] for label in labels_of[kind]],
                dtype=np.int64,
            ).reshape(-1, KINDS[kind].node_count),
        )
        for kind in kinds
    ]
    return meshio.Mesh(
        np.array(list(deck.nodes.values()), dtype=np.float64).reshape(-1, 3),
        cells,
        point_sets={name: _positions(labels, node) for name, labels in deck.sets["NSET"].values()},
        cell_sets={
            name: [_positions(labels, index[kind]) for kind in kinds]
            for name, labels in deck.sets["ELSET"].values()
        },
    )


def _positions(labels: list[int], index: dict[int, int]) -> IntArray:
    return np.array(sorted({index[label] for label in labels if label in index}), dtype=np.int64)
