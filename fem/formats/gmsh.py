"""Read Gmsh files of versions 2.2 and 4.1, ASCII and binary.

The reader of meshio takes what a damaged file says: a node that is not there counts from the end of
the list, an element with a number too many or too few gets other nodes, and a declared number of
nodes is allocated before the first one is read. This one refuses these. Physical groups are cell
sets.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.formats.content import CellBlock, MeshContent, dimension_of

VERSIONS = {"2": "2.2", "2.2": "2.2", "4.1": "4.1"}  # Gmsh writes 4 for 4.0
TYPES = {
    1: ("line", 2), 2: ("triangle", 3), 3: ("quad", 4), 4: ("tetra", 4), 5: ("hexahedron", 8),
    6: ("wedge", 6), 7: ("pyramid", 5), 8: ("line3", 3), 9: ("triangle6", 6), 10: ("quad9", 9),
    11: ("tetra10", 10), 12: ("hexahedron27", 27), 13: ("wedge18", 18), 14: ("pyramid14", 14),
    15: ("vertex", 1), 16: ("quad8", 8), 17: ("hexahedron20", 20), 18: ("wedge15", 15),
    19: ("pyramid13", 13),
}  # fmt: skip
"""Kinds of cells and their numbers of nodes by Gmsh's numbers, up to the second order."""
NODE_COUNTS = dict(TYPES.values())
NODES = {
    "tetra10": (*range(8), 9, 8),
    "pyramid13": (*range(5), 5, 8, 10, 6, 7, 9, 11, 12),
    "pyramid14": (*range(5), 5, 8, 10, 6, 7, 9, 11, 12, 13),
    "wedge15": (*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11),
    "wedge18": (*range(6), 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16),
    "hexahedron20": (*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15),
    "hexahedron27": (
        *(*range(8), 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15),
        *(22, 23, 21, 24, 20, 25, 26),
    ),
}
"""Where Gmsh has the nodes of a cell in VTK's order."""
Groups = dict[tuple[int, int], IntArray]
DIMENSION_NAMES = ("point", "curve", "surface", "volume")
WITHOUT_CELLS = ("Comments", "GhostElements", "Periodic", "Parametrizations", "NodeData",
                 "ElementData", "ElementNodeData", "InterpolationScheme")  # fmt: skip
"""Sections that say nothing about nodes, cells or groups; ghosts are cells told already."""
READ = ("MeshFormat", "PhysicalNames", "Entities", "PartitionedEntities", "Nodes", "Elements")
SECTION = re.compile(rb"^[ \t]*\$(\w+)[ \t\r]*$", re.MULTILINE)


@dataclass
class _Numbers:
    """The numbers of a section, one after the other."""

    body: bytes
    binary: bool
    size_type: str = "<u8"
    at: int = 0
    words: list[bytes] = field(default_factory=list)

    def __post_init__(self) -> None:
        if not self.binary:
            self.words = self.body.split()

    def take(self, count: int, kind: str) -> np.ndarray:
        """The next so many numbers of a kind: "<i4", "<f8", "u1" or the size type."""
        width = np.dtype(kind).itemsize if self.binary else 1
        end = self.at + count * width
        if count < 0 or end > len(self.body if self.binary else self.words):
            raise ValueError(f"{count} numbers are declared, but the section ends before")
        if self.binary:
            found = np.frombuffer(self.body[self.at : end], kind)
        elif kind == "<f8":
            found = _reals(self.words[self.at : end])
        else:
            found = np.array([_whole(word) for word in self.words[self.at : end]], dtype=np.int64)
        self.at = end
        return found if kind == "<f8" else found.astype(np.int64)

    def integers(self, count: int) -> IntArray:
        return self.take(count, "<i4")

    def sizes(self, count: int) -> IntArray:
        return self.take(count, self.size_type)

    def reals(self, count: int) -> FloatArray:
        return self.take(count, "<f8")

    def line(self) -> int:
        """The whole number on a line of its own, which binary files have too."""
        if not self.binary:
            return int(self.take(1, "<i4")[0])
        end = self.body.find(b"\n", self.at)
        text, self.at = self.body[self.at : end], end + 1
        return _whole(text)

    def end(self) -> None:
        """Refuse numbers beyond those declared."""
        rest = self.body[self.at :].strip() if self.binary else self.words[self.at :]
        if rest:
            raise ValueError("a section goes on after the numbers that it declares")


@dataclass
class _Block:
    """Elements of a type: numbers of their nodes (e, b) and physical groups (e, g), 0 for none."""

    kind: str
    nodes: IntArray
    groups: IntArray
    labels: IntArray  # (e,), their own numbers
    entities: IntArray | None = None  # (e,), of version 2.2


def read_gmsh(path: Path) -> MeshContent:
    """Read the nodes, elements and physical groups of a Gmsh file.

    Parameters
    ----------
    path
        Version 2.2 or 4.1, ASCII or binary (little-endian).

    Returns
    -------
    MeshContent
        One block of cells for each entity (4.1) or run of elements of one type (2.2), and the
        physical groups as cell sets; a group without a name goes by its number.

    Raises
    ------
    ModelError
        If the file is not one of Gmsh or is cut off.
    ValueError, OverflowError
        If it contradicts itself; the text says how.

    References
    ----------
    C. Geuzaine, J.-F. Remacle, *Gmsh reference manual*, section "Gmsh file formats".

    Examples
    --------
    >>> read_gmsh(Path("meshes/half_beam.msh")).cells[0].type
    'line'
    """
    content = path.read_bytes()
    if content.startswith(b"$NOD"):
        raise ModelError(f"{path}: is a Gmsh file of version 1; export it as 4.1 or 2.2")
    if b"$MeshFormat" not in content:
        raise ModelError(f"{path}: is not a Gmsh file (there is no $MeshFormat)")
    if b"$EndElements" not in content:
        raise ModelError(f"{path}: the Gmsh file is cut off (there is no $EndElements)")
    return _mesh(content)


def _mesh(content: bytes) -> MeshContent:
    sections = _sections(content)
    version, binary, size_type = _header(sections["MeshFormat"])
    unknown = sorted(set(sections) - {*READ, *WITHOUT_CELLS})
    if unknown:
        raise ValueError(f"its section ${unknown[0]} is not understood")
    for name in ("Nodes", "Elements"):
        if name not in sections:
            raise ValueError(f"there is no ${name}")
    nodes, elements, entities = (
        _Numbers(sections.get(name, b""), binary, size_type)
        for name in ("Nodes", "Elements", "Entities")
    )
    if version == "2.2":
        labels, points = _nodes_22(nodes)
        blocks = _binary_22(elements) if binary else _lines_22(sections["Elements"])
        _check_labels(blocks)
        blocks = _once(blocks)
    else:
        labels, points = _nodes_41(nodes)
        groups = _entities(entities) if "Entities" in sections else {}
        if "PartitionedEntities" in sections:
            parts = _Numbers(sections["PartitionedEntities"], binary, size_type)
            groups |= _partitioned(parts, groups)
        blocks = _elements_41(elements, groups)
        _check_labels(blocks)
    order = np.argsort(labels, kind="stable")
    if (np.diff(labels[order]) == 0).any():
        raise ValueError("two nodes have the same number")
    cells = [
        CellBlock(block.kind, _in_order_of_vtk(block.kind, _positions(block.nodes, labels, order)))
        for block in blocks
    ]
    names = _names(sections.get("PhysicalNames", b"0"))
    return MeshContent(points, cells, cell_sets=_cell_sets(blocks, names))


def _cell_sets(
    blocks: list[_Block], names: dict[tuple[int, int], str]
) -> dict[str, list[IntArray]]:
    """Elements of each physical group, one list for each block."""
    sets: dict[str, list[IntArray]] = {}
    named = _apart(blocks, names)
    for number, block in enumerate(blocks):
        for group in np.unique(block.groups[block.groups != 0]):
            name = named[dimension_of(block.kind), int(group)]
            empty = [np.zeros(0, dtype=np.int64)] * len(blocks)
            found = np.flatnonzero((block.groups == group).any(axis=1))
            of_blocks = sets.setdefault(name, empty)
            of_blocks[number] = np.union1d(of_blocks[number], found)
    return sets


def _apart(blocks: list[_Block], names: dict[tuple[int, int], str]) -> dict[tuple[int, int], str]:
    """A name for each group; with the dimension where curves, surfaces or volumes share it.

    A point set and one group of cells may share a name, since a mesh keeps them apart.
    """
    used = {
        (dimension_of(block.kind), int(group))
        for block in blocks
        for group in np.unique(block.groups[block.groups != 0])
    }
    plain = {key: names.get(key, str(key[1])) for key in used}
    dimensions: dict[str, set[int]] = {}
    for (dimension, _), name in plain.items():
        dimensions.setdefault(name, set()).add(dimension)
    return {
        key: f"{name} ({DIMENSION_NAMES[key[0]]})" if len(dimensions[name] - {0}) > 1 else name
        for key, name in plain.items()
    }


def _check_labels(blocks: list[_Block]) -> None:
    """Refuse a number that two elements have which are not one, of several groups."""
    labels = np.concatenate([np.zeros(0, dtype=np.int64), *(block.labels for block in blocks)])
    numbers, counts = np.unique(labels, return_counts=True)
    if len(numbers) == len(labels):
        return
    first: dict[int, tuple[str, list[int]]] = {}
    for block in blocks:
        for row in np.flatnonzero(np.isin(block.labels, numbers[counts > 1])):
            label, element = int(block.labels[row]), (block.kind, block.nodes[row].tolist())
            if first.setdefault(label, element) != element:
                raise ValueError(f"two elements have the number {label}")


def _once(blocks: list[_Block]) -> list[_Block]:
    """Elements of version 2.2 that stand once for each of their groups, as one in all of these.

    They have the same type, the same nodes in the same order and the same geometrical entity. One
    that stands twice for the same group, or for none, stays twice.
    """
    by_kind: dict[str, list[_Block]] = {}
    for block in blocks:
        by_kind.setdefault(block.kind, []).append(block)
    found = {kind: _in_all_groups(kind, of_kind) for kind, of_kind in by_kind.items()}
    if all(sum(len(b.nodes) for b in by_kind[kind]) == len(b.nodes) for kind, b in found.items()):
        return blocks
    return list(found.values())


def _in_all_groups(kind: str, blocks: list[_Block]) -> _Block:
    nodes = np.concatenate([block.nodes for block in blocks])
    groups = np.concatenate([block.groups[:, 0] for block in blocks])
    labels = np.concatenate([block.labels for block in blocks])
    entities = np.concatenate(
        [np.zeros(len(b.nodes), np.int64) if b.entities is None else b.entities for b in blocks]
    )
    of_element: dict[tuple[int, ...], list[tuple[int, int]]] = {}
    for row, key in enumerate(np.column_stack([entities, nodes]).tolist()):
        of_element.setdefault(tuple(key), []).append((row, int(groups[row])))
    kept: list[tuple[int, list[int]]] = []
    for same in of_element.values():
        rows = {group: row for row, group in reversed(same)}  # the first of each group
        if 0 in rows:
            rows = {}
        elif rows:
            kept.append((min(rows.values()), list(rows)))
        taken = set(rows.values())
        kept.extend((row, [group]) for row, group in same if row not in taken)
    kept.sort()
    widest = max(len(numbers) for _, numbers in kept)
    table = np.zeros((len(kept), widest), dtype=np.int64)
    for row, (_, numbers) in enumerate(kept):
        table[row, : len(numbers)] = numbers
    first = [row for row, _ in kept]
    return _Block(kind, nodes[first], table, labels[first])


def _sections(content: bytes) -> dict[str, bytes]:
    """What stands between ``$NAME`` and ``$EndNAME``."""
    found: dict[str, bytes] = {}
    at = 0
    while True:
        start = SECTION.search(content, at)
        between = content[at : start.start() if start else len(content)]
        if between.strip():
            raise ValueError("there is text between the sections")
        if start is None:
            return found
        name = start[1].decode()
        end = content.find(b"$End" + start[1], start.end())
        if end < 0:
            raise ValueError(f"${name} has no end")
        if name in found and name in ("MeshFormat", "Nodes", "Elements", "Entities"):
            raise ValueError(f"${name} is there twice")
        found[name] = content[start.end() : end].removeprefix(b"\n")
        at = end + len(b"$End" + start[1])


def _header(body: bytes) -> tuple[str, bool, str]:
    """Version, whether the file is binary, and the type of its sizes."""
    words = body.split()[:3]
    if len(words) < 3 or words[1] not in (b"0", b"1") or words[2] not in (b"4", b"8"):
        raise ValueError("its format is not told as by Gmsh")
    version = VERSIONS.get(words[0].decode())
    if version is None:
        raise ValueError(f"its version is {words[0].decode()}; export it as 4.1 or 2.2")
    binary = words[1] == b"1"
    if binary and body.partition(b"\n")[2][:4] != b"\x01\x00\x00\x00":
        raise ValueError("its numbers are in another order of bytes")
    return version, binary, f"<u{words[2].decode()}"


def _names(body: bytes) -> dict[tuple[int, int], str]:
    """Names of the physical groups by dimension and number."""
    count, *lines = body.strip().splitlines()
    if len(lines) != _whole(count):
        raise ValueError(f"there are {len(lines)} names of physical groups, not {_whole(count)}")
    names = {}
    for line in lines:
        words = shlex.split(line.decode())
        if len(words) != 3:
            raise ValueError("a name of a physical group is not told as by Gmsh")
        names[_whole(words[0].encode()), _whole(words[1].encode())] = words[2]
    return names


def _whole(word: bytes) -> int:
    try:
        return int(word)
    except ValueError:
        raise ValueError(f"{_shown(word)} is not a whole number") from None


def _reals(words: list[bytes]) -> FloatArray:
    try:
        return np.array(words, dtype="S").astype(np.float64)
    except ValueError:
        wrong = next(word for word in words if not _is_real(word))
        raise ValueError(f"{_shown(wrong)} is not a number") from None


def _is_real(word: bytes) -> bool:
    try:
        np.array([word]).astype(np.float64)
    except ValueError:
        return False
    return True


def _shown(word: bytes) -> str:
    """A word of the file in quotes, without what cannot be printed."""
    return ascii(word[:40].decode("latin-1"))


def _nodes_22(numbers: _Numbers) -> tuple[IntArray, FloatArray]:
    count = numbers.line()
    if numbers.binary:
        row = np.dtype([("label", "<i4"), ("place", "<f8", 3)])
        data = np.frombuffer(numbers.take(count * row.itemsize, "u1").astype(np.uint8), row)
        labels, points = data["label"].astype(np.int64), data["place"].astype(np.float64)
    else:
        words = numbers.words[1:]
        if len(words) != 4 * count:
            there = f"{len(words) // 4} are" if len(words) % 4 == 0 else f"{len(words)} numbers are"
            raise ValueError(f"{count} nodes are declared, but {there} there")
        labels = np.array([_whole(word) for word in words[::4]], dtype=np.int64)
        points = np.stack([_reals(words[k::4]) for k in (1, 2, 3)], axis=1)
        numbers.at = len(numbers.words)
    numbers.end()
    return labels, points


def _lines_22(body: bytes) -> list[_Block]:
    count, *lines = body.strip().splitlines()
    if len(lines) != _whole(count):
        raise ValueError(f"{_whole(count)} elements are declared, but {len(lines)} are there")
    runs: list[tuple[str, list[list[int]], list[int], list[int], list[int]]] = []
    for line in lines:
        label, code, tags, *rest = (_whole(word) for word in line.split())
        kind = _kind(code)
        if tags < 0 or len(rest) != tags + NODE_COUNTS[kind]:
            raise ValueError(f"element {label} does not have the numbers of its type")
        if not runs or runs[-1][0] != kind:
            runs.append((kind, [], [], [], []))
        runs[-1][1].append(rest[tags:])
        runs[-1][2].append(abs(rest[0]) if tags else 0)
        runs[-1][3].append(label)
        runs[-1][4].append(rest[1] if tags > 1 else 0)
    return [
        _Block(
            kind,
            np.array(nodes, dtype=np.int64),
            np.array(groups, dtype=np.int64)[:, None],
            np.array(labels, dtype=np.int64),
            np.array(entities, dtype=np.int64),
        )
        for kind, nodes, groups, labels, entities in runs
    ]


def _binary_22(numbers: _Numbers) -> list[_Block]:
    count, blocks = numbers.line(), []
    while count > 0:
        code, here, tags = numbers.integers(3).tolist()
        kind = _kind(code)
        if here < 1 or tags < 0:
            raise ValueError("a block of elements is empty")
        width = 1 + tags + NODE_COUNTS[kind]
        rows = numbers.integers(here * width).reshape(here, width)
        groups = np.abs(rows[:, 1:2]) if tags else np.zeros((here, 1), dtype=np.int64)
        entities = rows[:, 2] if tags > 1 else np.zeros(here, dtype=np.int64)
        blocks.append(_Block(kind, rows[:, 1 + tags :], groups, rows[:, 0], entities))
        count -= here
    numbers.end()
    return blocks


def _entities(numbers: _Numbers) -> Groups:
    """Physical groups of each entity, by dimension and number."""
    groups: Groups = {}
    for dimension, count in enumerate(numbers.sizes(4).tolist()):
        for _ in range(count):
            tag = int(numbers.integers(1)[0])
            numbers.reals(6 if dimension else 3)
            groups[dimension, tag] = np.abs(numbers.integers(int(numbers.sizes(1)[0])))
            if dimension:
                numbers.integers(int(numbers.sizes(1)[0]))
    numbers.end()
    return groups


def _partitioned(numbers: _Numbers, whole: Groups) -> Groups:
    """Physical groups of the pieces into which entities are partitioned.

    A piece without groups of its own has those of its parent of the same dimension.
    """
    groups: Groups = {}
    numbers.sizes(1)
    numbers.integers(2 * int(numbers.sizes(1)[0]))
    for dimension, count in enumerate(numbers.sizes(4).tolist()):
        for _ in range(count):
            tag, *parent = numbers.integers(3).tolist()
            numbers.integers(int(numbers.sizes(1)[0]))
            numbers.reals(6 if dimension else 3)
            own = np.abs(numbers.integers(int(numbers.sizes(1)[0])))
            if dimension:
                numbers.integers(int(numbers.sizes(1)[0]))
            if not len(own) and parent[0] == dimension:
                own = whole.get((dimension, parent[1]), own)
            groups[dimension, tag] = own
    numbers.end()
    return groups


def _nodes_41(numbers: _Numbers) -> tuple[IntArray, FloatArray]:
    blocks, count = numbers.sizes(4).tolist()[:2]
    labels, points = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for _ in range(blocks):
        dimension, _, parametric = numbers.integers(3).tolist()
        width = 3 + (dimension if parametric else 0)
        here = int(numbers.sizes(1)[0])
        labels.append(numbers.sizes(here))
        points.append(numbers.reals(width * here).reshape(here, width)[:, :3])
    numbers.end()
    if sum(map(len, labels)) != count:
        raise ValueError(f"{count} nodes are declared, but {sum(map(len, labels))} are there")
    return np.concatenate(labels), np.concatenate(points)


def _elements_41(numbers: _Numbers, groups: Groups) -> list[_Block]:
    blocks, count = numbers.sizes(4).tolist()[:2]
    found = []
    for _ in range(blocks):
        dimension, tag, code = numbers.integers(3).tolist()
        kind, here = _kind(code), int(numbers.sizes(1)[0])
        width = 1 + NODE_COUNTS[kind]
        rows = numbers.sizes(here * width).reshape(here, width)
        of_entity = groups.get((dimension, tag), np.zeros(0, dtype=np.int64))
        found.append(_Block(kind, rows[:, 1:], np.tile(of_entity, (here, 1)), rows[:, 0]))
    numbers.end()
    if sum(len(block.nodes) for block in found) != count:
        raise ValueError(f"{count} elements are declared, but others are there")
    return found


def _kind(code: int) -> str:
    if code not in TYPES:
        raise ValueError(
            f"an element has the type {code}, which is not read; cells of the first and second"
            " order are"
        )
    return TYPES[code][0]


def _in_order_of_vtk(kind: str, nodes: IntArray) -> IntArray:
    return nodes[:, NODES[kind]] if kind in NODES else nodes


def _positions(nodes: IntArray, labels: IntArray, order: IntArray) -> IntArray:
    """Places in the list of nodes of those that are named by their numbers."""
    if not nodes.size:
        return nodes
    at = np.searchsorted(labels, nodes, sorter=order).clip(max=max(len(labels) - 1, 0))
    if not len(labels) or (labels[order[at]] != nodes).any():
        raise ValueError("an element has a node that is not there")
    return np.asarray(order[at], dtype=np.int64)
