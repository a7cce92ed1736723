"""Read universal files (UNV), as Salome, Gmsh and I-deas write them, with their groups."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fem.base.arrays import IntArray
from fem.base.errors import ModelError
from fem.formats.abaqus.keywords import decoded
from fem.formats.content import CellBlock, MeshContent
from fem.mesh.attachments import LeftOut
from fem.mesh.cells import KINDS as CELLS

NODES, ELEMENTS, UNITS, GROUPS = 2411, 2412, 164, (2435, 2452, 2467, 2477)
LEFT_OUT = (55, 56, 57, 58, 151, 2400, 2414, 2420)
"""Datasets of results, headers and systems of axes, none of which move a node."""
KINDS: dict[int | tuple[int, int], str] = {
    **dict.fromkeys((11, 21, 22), "line"),
    24: "line3",
    (22, 3): "line3",
    **dict.fromkeys((41, 51, 91), "triangle"),
    **dict.fromkeys((42, 52, 92), "triangle6"),
    **dict.fromkeys((44, 54, 94), "quad"),
    **dict.fromkeys((45, 55, 95), "quad8"),
    111: "tetra", 112: "wedge", 113: "wedge15", 114: "pyramid13", 312: "pyramid",
    115: "hexahedron", 116: "hexahedron20", 118: "tetra10",
}  # fmt: skip
"""Kinds of cells by the number of the element: beams, plane elements, shells and solids.

Salome writes quadratic edges as tapered beams (22) of three nodes, and has numbers for pyramids.
"""
BEAMS = (11, 21, 22, 24)
ORDERS = {
    "line3": (0, 2, 1),
    "triangle6": (0, 2, 4, 1, 3, 5),
    "quad8": (0, 2, 4, 6, 1, 3, 5, 7),
    "tetra10": (0, 2, 4, 9, 1, 3, 5, 6, 7, 8),
    "pyramid13": (0, 2, 4, 6, 12, 1, 3, 5, 7, 8, 9, 10, 11),
    "wedge15": (0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8),
    "hexahedron20": (0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11),
}
"""Where VTK's nodes are in a file, which goes around each face from corner to corner."""
PER_METRE = {1.0: "m", 100.0: "cm", 1000.0: "mm", 39.37: "inch"}
"""Units of length by how many there are in a metre, to four digits."""
NODE, ELEMENT = 7, 8
"""Kinds of members of a group."""


@dataclass
class Dataset:
    """A dataset of a universal file: its number, its lines, and the number of the first of them."""

    number: int
    lines: list[str]
    first: int


@dataclass
class Elements:
    """The elements of a universal file: nodes by kind and label, and what else they say.

    Attributes
    ----------
    cells
        Labels of the nodes, in VTK's order.
    properties
        Labels of the elements of each number of a physical property.
    first
        The first line of the elements.
    beams
        The lines of the beams, which say how these are turned and which sections they have.
    unread
        The lines of the elements that are not read.
    """

    cells: dict[str, dict[int, list[int]]] = field(default_factory=dict)
    properties: dict[int, list[int]] = field(default_factory=dict)
    first: int = 0
    beams: list[int] = field(default_factory=list)
    unread: dict[str, list[int]] = field(default_factory=dict)


def read_unv(path: Path) -> tuple[MeshContent, list[LeftOut]]:
    """Read the nodes, elements and groups of a universal file.

    Parameters
    ----------
    path
        With datasets 2411 (nodes), 2412 (elements), 2467 or an older one (groups), 164 (units).

    Returns
    -------
    mesh
        One block for each kind of cell; groups as cell sets and point sets. In a file without
        groups of elements each of several physical properties is a cell set, "property 3". The
        ``info`` is the unit that the file states.
    left_out
        Properties and sections of the elements, and groups without members.

    Raises
    ------
    ModelError
        For datasets and elements that are not read, by their numbers, how many there are and the
        line of the first; for labels that stand twice or are not there.

    References
    ----------
    *SDRC I-DEAS universal file format*, https://www.ceas3.uc.edu/sdrluff.
    """
    points: dict[int, list[float]] = {}
    elements = Elements()
    groups: list[tuple[str, list[tuple[int, int]]]] = []
    left: list[LeftOut] = []
    unit = ""
    unread = elements.unread
    for data in _datasets(path):
        try:
            if data.number == NODES:
                _read_nodes(path, data, points)
            elif data.number == ELEMENTS:
                _read_elements(path, data, elements)
            elif data.number in GROUPS:
                groups += _read_groups(data, left)
            elif data.number == UNITS:
                per_metre = float(data.lines[1].replace("D", "E").split()[0])
                unit = PER_METRE.get(float(f"{per_metre:.4g}"), f"{1 / per_metre:g} m")
            elif data.number not in LEFT_OUT:
                unread.setdefault(f"dataset {data.number}", []).append(data.first)
        except (IndexError, ValueError) as error:
            raise ModelError(
                f"{path}: dataset {data.number} from line {data.first} on is cut off or damaged"
                f" ({error})"
            ) from error
    if unread:
        told = ", ".join(
            f"{what} ({len(at)}, first in line {at[0]})" for what, at in unread.items()
        )
        raise ModelError(f"{path}: holds what is not read: {told}")
    if not points or not elements.cells:
        raise ModelError(f"{path}: is no universal file with nodes (2411) and elements (2412)")
    named = any(kind == ELEMENT for _, members in groups for kind, _ in members)
    if len(elements.properties) > 1 and not named:
        for number, labels in sorted(elements.properties.items()):
            groups.append((f"property {number}", [(ELEMENT, label) for label in labels]))
    content = _content(path, points, elements.cells, groups)
    content.unit = unit
    return content, [*left, *_left_out(elements)]


def _left_out(elements: Elements) -> Iterator[LeftOut]:
    """What the elements say of sections and materials."""
    given = "materials and sections are given by the scene"
    if len(elements.properties) > 1:
        count, place = len(elements.properties), f"line {elements.first}"
        yield LeftOut("physical properties of elements", count, place, given)
    if elements.beams:
        count, place = len(elements.beams), f"line {elements.beams[0]}"
        yield LeftOut("orientations and cross sections of beams", count, place, given)


def _datasets(path: Path) -> Iterator[Dataset]:
    lines = decoded(path.read_bytes()).splitlines()
    marks = [i for i, line in enumerate(lines) if line.strip() == "-1"]
    if len(marks) % 2:
        raise ModelError(f"{path}: the dataset that begins in line {marks[-1] + 1} has no end")
    for begin, end in zip(marks[::2], marks[1::2], strict=True):
        word = lines[begin + 1].strip()
        if not word.isdigit():
            raise ModelError(f"{path}: line {begin + 2}: {word!r} is no number of a dataset")
        yield Dataset(int(word), lines[begin + 2 : end], begin + 3)


def _read_nodes(path: Path, data: Dataset, points: dict[int, list[float]]) -> None:
    for i in range(0, len(data.lines), 2):
        label = int(data.lines[i].split()[0])
        if label in points:
            raise ModelError(f"{path}: line {data.first + i}: node {label} is defined twice")
        x, y, z = data.lines[i + 1].replace("D", "E").replace("d", "e").split()
        points[label] = [float(x), float(y), float(z)]


def _read_elements(path: Path, data: Dataset, found: Elements) -> None:
    found.first = found.first or data.first
    i = 0
    while i < len(data.lines):
        line = data.first + i
        label, number, of_property, _, _, count = (int(word) for word in data.lines[i].split())
        if number in BEAMS:
            found.beams.append(line + 1)
        i += 2 if number in BEAMS else 1
        nodes: list[int] = []
        while len(nodes) < count:
            nodes += [int(word) for word in data.lines[i].split()]
            i += 1
        kind = KINDS.get((number, count), KINDS.get(number))
        if kind is None:
            found.unread.setdefault(f"element {number} of {count} nodes", []).append(line)
            continue
        if any(label in of_kind for of_kind in found.cells.values()):
            raise ModelError(f"{path}: line {line}: element {label} is defined twice")
        order = ORDERS.get(kind, range(CELLS[kind].node_count))
        if len(nodes) != len(order):
            raise ModelError(
                f"{path}: line {line}: element {label} has {len(nodes)} nodes where {len(order)}"
                " are needed"
            )
        found.cells.setdefault(kind, {})[label] = [nodes[at] for at in order]
        found.properties.setdefault(of_property, []).append(label)


def _read_groups(data: Dataset, left: list[LeftOut]) -> Iterator[tuple[str, list[tuple[int, int]]]]:
    """Name of each group with the kind and label of its members; empty ones are left out."""
    i = 0
    while i < len(data.lines):
        if not data.lines[i].strip():  # Salome's end of an empty group
            i += 1
            continue
        count, name = int(data.lines[i].split()[7]), data.lines[i + 1].strip()
        if not count:
            left.append(LeftOut(f"group {name!r}", 1, f"line {data.first + i}", "it is empty"))
        i += 2
        words: list[int] = []
        while len(words) < 4 * count:
            words += [int(word) for word in data.lines[i].split()]
            i += 1
        if count:
            yield name, list(zip(words[::4], words[1::4], strict=True))


def _without_lost_points(
    members: list[tuple[int, int]], elements: set[int]
) -> list[tuple[int, int]]:
    """A group without the elements of one node that Gmsh names but leaves out, beside its nodes."""
    named = [n for kind, n in members if kind == ELEMENT]
    nodes = [(kind, n) for kind, n in members if kind == NODE]
    lost = len(named) == len(nodes) and elements.isdisjoint(named)
    return nodes if lost and len(named) + len(nodes) == len(members) else members


def _content(
    path: Path,
    points: dict[int, list[float]],
    cells: dict[str, dict[int, list[int]]],
    groups: list[tuple[str, list[tuple[int, int]]]],
) -> MeshContent:
    place = {label: at for at, label in enumerate(points)}
    used = (node for of_kind in cells.values() for nodes in of_kind.values() for node in nodes)
    missing = next((node for node in used if node not in place), None)
    if missing is not None:
        raise ModelError(f"{path}: an element has the node {missing}, which is not defined")
    blocks = [
        CellBlock(kind, np.array([[place[n] for n in nodes] for nodes in of_kind.values()]))
        for kind, of_kind in cells.items()
    ]
    where = [{label: at for at, label in enumerate(of_kind)} for of_kind in cells.values()]
    elements_known = {label for at in where for label in at}
    known: dict[int, Collection[int]] = {NODE: place, ELEMENT: elements_known}
    cell_sets: dict[str, list[IntArray]] = {}
    point_sets: dict[str, IntArray] = {}
    for name, listed in groups:
        members = _without_lost_points(listed, elements_known)
        bad = next(((k, n) for k, n in members if n not in known.get(k, ())), None)
        if bad is not None:
            raise ModelError(
                f"{path}: group {name!r} has member {bad[1]} of kind {bad[0]}, which is not defined"
                f" ({NODE} are nodes and {ELEMENT} elements; others are not read); Gmsh leaves out "
                "elements of one node: let it save groups of nodes (Mesh.SaveGroupsOfNodes = 1)"
            )
        elements = [n for k, n in members if k == ELEMENT]
        nodes = [place[n] for k, n in members if k == NODE]
        for sets, found in ((cell_sets, elements), (point_sets, nodes)):
            if found and name in sets:
                raise ModelError(f"{path}: has two groups of the name {name!r}")
        if elements:
            cell_sets[name] = [np.array([at[n] for n in elements if n in at]) for at in where]
        if nodes:
            point_sets[name] = np.unique(nodes)
    return MeshContent(
        np.array(list(points.values())), blocks, point_sets=point_sets, cell_sets=cell_sets
    )
