"""Read nodes, line elements and sets of Abaqus input files.

meshio 5.3 has a reader of its own, but it loses or mixes up sets in ordinary frame files: a set
that grows over several ``*ELEMENT`` keywords, a keyword in lower case, a second ``*NODE``, a set
named inside a set, the orientation node of a B31. This one reads these, and the result is the
same `meshio.Mesh`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import meshio
import numpy as np

from fem.errors import ModelError
from fem.mesh import IntArray

TWO_NODE_LINES: tuple[str, ...] = ("B21", "B23", "B31", "B31OS", "B33", "FRAME2D", "FRAME3D")
TWO_NODE_LINES += ("PIPE21", "PIPE31", "T2D2", "T3D2")
THREE_NODE_LINES = ("B22", "B32", "B32OS", "PIPE22", "PIPE32", "T2D3", "T3D3")

LONGEST_RANGE = 10_000_000


@dataclass(frozen=True)
class _Keyword:
    name: str
    parameters: dict[str, str]
    rows: list[list[str]]


@dataclass
class _Deck:
    path: Path
    nodes: dict[int, list[float]] = field(default_factory=dict)
    elements: dict[int, tuple[int, int]] = field(default_factory=dict)
    sets: dict[str, dict[str, tuple[str, list[int]]]] = field(
        default_factory=lambda: {"NSET": {}, "ELSET": {}}
    )

    def fail(self, text: str) -> ModelError:
        return ModelError(f"{self.path}: {text}")

    def grow(self, kind: str, name: str, labels: list[int]) -> None:
        self.sets[kind].setdefault(name.upper(), (name, []))[1].extend(labels)


def read_abaqus(path: str | Path) -> meshio.Mesh:
    """Read the frame of an Abaqus input file.

    Parameters
    ----------
    path
        Input file with ``*NODE``, ``*ELEMENT``, ``*NSET``, ``*ELSET`` (lists, names of sets,
        GENERATE) and ``*INCLUDE``; other keywords are passed over. Upper and lower case are the
        same, and a set keeps the spelling of its first occurrence.

    Returns
    -------
    meshio.Mesh
        Line cells of the beam, truss, pipe and frame elements, with cell sets and point sets.

    Raises
    ------
    ModelError
        For a label defined twice (several parts in one file), one that is not defined, an
        instance that is moved, or a second-order element.

    Examples
    --------
    >>> read_abaqus("meshes/half_beam.inp").cells[0].type
    'line'
    """
    deck = _Deck(Path(path))
    for keyword in _keywords(deck.path):
        if keyword.name in _ACTIONS:
            _ACTIONS[keyword.name](deck, keyword)
    if not deck.nodes:
        raise deck.fail("is not an Abaqus input file with nodes (there is no *NODE)")
    return _to_meshio(deck)


def _keywords(path: Path) -> Iterator[_Keyword]:
    current: _Keyword | None = None
    for line in _logical_lines(path):
        words = [word.strip() for word in line.split(",")]
        if line.startswith("*"):
            if current:
                yield from _included(path, current)
            current = _Keyword(words[0][1:].strip().upper(), _parameters(words[1:]), [])
        elif current:
            current.rows.append(words)
    if current:
        yield from _included(path, current)


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


def _included(path: Path, keyword: _Keyword) -> Iterator[_Keyword]:
    if keyword.name != "INCLUDE":
        yield keyword
        return
    other = path.parent / keyword.parameters.get("INPUT", "")
    if not other.is_file():
        raise ModelError(f"{path}: the included file {other} does not exist")
    yield from _keywords(other)


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
    if kind not in TWO_NODE_LINES:
        return
    for row in keyword.rows:
        label, start, stop = (int(word) for word in row[:3])
        if label in deck.elements:
            raise deck.fail(f"element {label} is defined twice (write one part to a file)")
        deck.elements[label] = (start, stop)
        if "ELSET" in keyword.parameters:
            deck.grow("ELSET", keyword.parameters["ELSET"], [label])


def _read_set(deck: _Deck, keyword: _Keyword) -> None:
    kind = keyword.name
    if kind not in keyword.parameters:
        raise deck.fail(f"a *{kind} has no name")
    name = keyword.parameters[kind]
    deck.grow(kind, name, [])
    for row in ([word for word in row if word] for row in keyword.rows):
        if "GENERATE" in keyword.parameters:
            first, last, step = [*(int(word) for word in row), 1][:3]
            if step < 1 or last - first > LONGEST_RANGE * step:
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
    element = {label: i for i, label in enumerate(deck.elements)}
    for label, ends in deck.elements.items():
        for end in ends:
            if end not in node:
                raise deck.fail(f"element {label} ends at node {end}, which is not defined")
    lines = [[node[start], node[stop]] for start, stop in deck.elements.values()]
    for name, labels in deck.sets["NSET"].values():
        missing = [label for label in labels if label not in node]
        if missing:
            raise deck.fail(f"set {name!r} holds node {missing[0]}, which is not defined")
    return meshio.Mesh(
        np.array(list(deck.nodes.values()), dtype=np.float64).reshape(-1, 3),
        [("line", np.array(lines, dtype=np.int64).reshape(-1, 2))],
        point_sets={name: _positions(labels, node) for name, labels in deck.sets["NSET"].values()},
        cell_sets={
            name: [_positions(labels, element)] for name, labels in deck.sets["ELSET"].values()
        },
    )


def _positions(labels: list[int], index: dict[int, int]) -> IntArray:
    return np.array(sorted({index[label] for label in labels if label in index}), dtype=np.int64)
