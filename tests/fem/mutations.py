"""Small drafts, and changes of them that a reader must follow or refuse."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from drafts import FACES, Draft
from mixed import mixed_block

NAMES = ("left side", "Füße", "100%20", "a.b", "x-1_2", "part (3)", "surface 7", "12", "set:a")
"""Names that a file may hold beside plain ones."""


def solid(chance: random.Random) -> Draft:
    """A block of all four shapes in three parts, with the faces of one side."""
    turn = np.eye(3) + np.array([[chance.uniform(-0.2, 0.2) for _ in range(3)] for _ in range(3)])
    mesh = mixed_block("first order", lambda corners: corners @ turn, layers=1)
    flat = mesh.points @ np.linalg.inv(turn)
    nodes = {i + 1: tuple(place) for i, place in enumerate(mesh.points.tolist())}
    cells = [(kind, tuple(int(n) + 1 for n in c)) for kind, of in mesh.cells.items() for c in of]
    low = {i + 1 for i in np.flatnonzero(flat[:, 0] < 1e-9)}
    skin = [
        tuple(nodes_of[i] for i in face)
        for kind, nodes_of in cells
        for face in FACES[kind]
        if {nodes_of[i] for i in face} <= low
    ]
    faces = [("quad" if len(face) == 4 else "triangle", face) for face in skin]
    draft = _parted("solid", nodes, cells, faces)
    tip = int(np.argmax(flat.sum(axis=1))) + 1
    return replace(draft, sets=[("root", sorted(low)), ("tip", [tip])])


def shell(chance: random.Random) -> Draft:
    """A sheet of quadrilaterals and triangles in three parts."""
    nodes = {
        4 * j + i + 1: (i + chance.uniform(0, 0.2), j + chance.uniform(0, 0.2), 0.0)
        for j in range(3)
        for i in range(4)
    }
    cells: list[tuple[str, tuple[int, ...]]] = []
    for j in range(2):
        for i in range(3):
            a, b, c, d = (4 * j + i + k for k in (1, 2, 6, 5))
            split = (i + j) % 2
            cells += [("triangle", (a, b, c)), ("triangle", (a, c, d))] * split
            cells += [("quad", (a, b, c, d))] * (1 - split)
    draft = _parted("shell", nodes, cells, [])
    return replace(draft, sets=[("root", [1, 5, 9]), ("tip", [12])])


def frame(chance: random.Random) -> Draft:
    """A truss girder of beams in three parts."""
    nodes = {
        2 * i + j + 1: (i + chance.uniform(0, 0.2), j + chance.uniform(0, 0.2), 0.0)
        for i in range(4)
        for j in range(2)
    }
    ends = [(n, n + 2) for n in range(1, 7)] + [(n, n + 1) for n in (1, 3, 5, 7)]
    ends += [(n, n + 3) for n in (1, 3, 5)]
    draft = _parted("frame", nodes, [("line", pair) for pair in ends], [])
    return replace(draft, sets=[("root", [1, 2]), ("tip", [8])])


def _parted(
    model: str,
    nodes: dict[int, tuple[float, ...]],
    cells: list[tuple[str, tuple[int, ...]]],
    faces: list[tuple[str, tuple[int, ...]]],
) -> Draft:
    """Three parts, each of which has a third of the cells, and the faces as a group."""
    names = [(name, list(range(1 + k, len(cells) + 1, 3))) for k, name in enumerate("abc")]
    skin = list(range(len(cells) + 1, len(cells) + len(faces) + 1))
    return Draft(
        model,
        nodes,
        dict(enumerate([*cells, *faces], start=1)),
        names + [("skin", skin)] * bool(faces),
        [],
        {"a": 8000.0, "b": 3000.0, "c": 5000.0},
    )


def shuffle(draft: Draft, chance: random.Random, end: str) -> None:
    """Nodes, cells, names and members in another order."""

    def mixed(items):
        items = list(items)
        return chance.sample(items, len(items))

    draft.nodes = dict(mixed(draft.nodes.items()))
    draft.cells = dict(mixed(draft.cells.items()))
    draft.names = [(name, mixed(labels)) for name, labels in mixed(draft.names)]
    draft.sets = [(name, mixed(labels)) for name, labels in mixed(draft.sets)]


def renumber_nodes(draft: Draft, chance: random.Random, end: str) -> None:
    """Other numbers, with gaps."""
    new = dict(zip(draft.nodes, chance.sample(range(1, 5000), len(draft.nodes)), strict=True))
    draft.nodes = {new[label]: place for label, place in draft.nodes.items()}
    draft.cells = {
        label: (kind, tuple(new[n] for n in nodes)) for label, (kind, nodes) in draft.cells.items()
    }
    draft.sets = [(name, [new[n] for n in nodes]) for name, nodes in draft.sets]
    draft.masses = {new[node]: kg for node, kg in draft.masses.items()}


def renumber_cells(draft: Draft, chance: random.Random, end: str) -> None:
    """Other numbers, with gaps."""
    new = dict(zip(draft.cells, chance.sample(range(1, 5000), len(draft.cells)), strict=True))
    draft.cells = {new[label]: cell for label, cell in draft.cells.items()}
    draft.names = [(name, [new[label] for label in labels]) for name, labels in draft.names]


def rename_part(draft: Draft, chance: random.Random, end: str) -> None:
    """A part has another name, in the model too."""
    old, new = chance.choice(list(draft.densities)), _fresh(draft, chance)
    draft.names = [(new if name == old else name, labels) for name, labels in draft.names]
    draft.densities = {new if n == old else n: rho for n, rho in draft.densities.items()}


def rename_set(draft: Draft, chance: random.Random, end: str) -> None:
    """A point set has another name, in the model too."""
    old, new = draft.held, _fresh(draft, chance)
    draft.sets = [(new if name == old else name, nodes) for name, nodes in draft.sets]
    draft.held = new


def _fresh(draft: Draft, chance: random.Random) -> str:
    used = {name for name, _ in draft.names + draft.sets}
    return chance.choice([name for name in (*NAMES, "plain") if name not in used])


def rename_in_the_file_alone(draft: Draft, chance: random.Random, end: str) -> None:
    """A part or a point set has another name, which the model does not know."""
    old, new = chance.choice([*draft.densities, draft.held, draft.seen]), "other"
    draft.names = [(new if name == old else name, labels) for name, labels in draft.names]
    draft.sets = [(new if name == old else name, nodes) for name, nodes in draft.sets]
    draft.faults.append(re.escape(f"'{old}'"))


def unite_parts(draft: Draft, chance: random.Random, end: str) -> None:
    """Two parts have one name: they are one."""
    if len(draft.densities) < 2:
        return
    old, new = chance.sample(list(draft.densities), 2)
    draft.names = [(new if name == old else name, labels) for name, labels in draft.names]
    del draft.densities[old]


def unite_sets(draft: Draft, chance: random.Random, end: str) -> None:
    """Two point sets have one name: they are one."""
    if draft.held != draft.seen and any(name == draft.held for name, _ in draft.sets):
        draft.sets.append((draft.held, [chance.choice(list(draft.nodes))]))


def remove_cell(draft: Draft, chance: random.Random, end: str) -> None:
    """A cell less, in the groups too."""
    if len(draft.cells) > 2:
        gone = chance.choice(list(draft.cells))
        del draft.cells[gone]
        draft.names = [(name, [n for n in of if n != gone]) for name, of in draft.names]


def add_cell(draft: Draft, chance: random.Random, end: str) -> None:
    """A cell of a part more, on new nodes beside all others."""
    _add(draft, chance, [labels for name, labels in draft.names if name in draft.densities])


def add_mass(draft: Draft, chance: random.Random, end: str) -> None:
    """A point mass at a node of a part, where the format has them."""
    parts = [label for name, of in draft.names if name in draft.densities for label in of]
    if end == "inp" and parts and not draft.masses:
        draft.masses = {chance.choice(draft.cells[chance.choice(parts)][1]): 50.0}


def add_loose_face(draft: Draft, chance: random.Random, end: str) -> None:
    """A cell that is in no part and no face of one that is."""
    if _add(draft, chance, [labels for name, labels in draft.names if name == "skin"]):
        draft.faults.append("in no part")


def _add(draft: Draft, chance: random.Random, groups: list[list[int]]) -> bool:
    """Whether one of some groups has got a cell like one that it has."""
    groups = [labels for labels in groups if labels]
    if not groups:
        return False
    labels = chance.choice(groups)
    kind, nodes = draft.cells[chance.choice(labels)]
    new = {node: max(draft.nodes) + i for i, node in enumerate(nodes, start=1)}
    shift = (0.0, 20.0 + chance.random(), 0.0)
    for node, label in new.items():
        moved = zip(draft.nodes[node], shift, strict=True)
        draft.nodes[label] = tuple(a + b for a, b in moved)
    label = max(draft.cells) + 1
    draft.cells[label] = (kind, tuple(new[n] for n in nodes))
    labels.append(label)
    return True


def remove_part(draft: Draft, chance: random.Random, end: str) -> None:
    """A part less, with its cells."""
    if len(draft.densities) > 1:
        gone = chance.choice(list(draft.densities))
        labels = {label for name, of in draft.names if name == gone for label in of}
        draft.names = [
            (name, [n for n in of if n not in labels]) for name, of in draft.names if name != gone
        ]
        draft.cells = {n: cell for n, cell in draft.cells.items() if n not in labels}
        del draft.densities[gone]


def remove_name(draft: Draft, chance: random.Random, end: str) -> None:
    """A part or a point set has no name any more."""
    gone = chance.choice([*draft.densities, draft.held, draft.seen])
    draft.names = [pair for pair in draft.names if pair[0] != gone]
    draft.sets = [pair for pair in draft.sets if pair[0] != gone]
    draft.faults.append(re.escape(f"'{gone}'"))


def remove_name_of_model_too(draft: Draft, chance: random.Random, end: str) -> None:
    """Cells of a part stay in the file, of which neither it nor the model has the name."""
    gone = chance.choice(list(draft.densities))
    if len(draft.densities) > 1 and any(of for name, of in draft.names if name == gone):
        draft.names = [pair for pair in draft.names if pair[0] != gone]
        del draft.densities[gone]
        draft.faults.append("in no part")


def orphan(draft: Draft, chance: random.Random, end: str) -> None:
    """A cell is in no part any more."""
    name, labels = chance.choice([pair for pair in draft.names if pair[0] in draft.densities])
    if labels:
        labels.remove(chance.choice(labels))
        draft.faults.append("in no part" if labels else re.escape(f"'{name}'") + "|in no part")


def in_two_parts(draft: Draft, chance: random.Random, end: str) -> None:
    """A cell is in two parts."""
    if len(draft.densities) > 1:
        parts = [pair for pair in draft.names if pair[0] in draft.densities]
        (name, one), (other_name, other) = chance.sample(parts, 2)
        if one and name != other_name and not set(one) & set(other):
            other.append(chance.choice(one))
            draft.faults.append("is in more than one part|stands twice")


def double(draft: Draft, chance: random.Random, end: str) -> None:
    """A cell stands twice in its part."""
    _, labels = chance.choice([pair for pair in draft.names if pair[0] in draft.densities])
    if labels:
        label = max(draft.cells) + 1
        kind, nodes = draft.cells[chance.choice(labels)]
        draft.cells[label] = (kind, nodes)
        labels.append(label)
        draft.faults.append("stands twice|appears twice")


def move_member(draft: Draft, chance: random.Random, end: str) -> None:
    """A point set has a node less or more."""
    _, nodes = chance.choice([pair for pair in draft.sets if pair[0] == draft.held] or [("", [])])
    if len(nodes) > 1 and chance.random() < 0.5:
        nodes.remove(chance.choice(nodes))
    elif nodes:
        nodes.append(chance.choice([n for n in draft.nodes if n not in nodes] or nodes))


def remove_node(draft: Draft, chance: random.Random, end: str) -> None:
    """A node is missing that a cell has; in VTK nodes go by their place, so it is the last one."""
    last = list(draft.nodes)[-1]
    used = {node for _, nodes in draft.cells.values() for node in nodes}
    gone = last if end == "vtu" else chance.choice(sorted(used))
    if gone in used:
        draft.faults.append(f"node {gone}, which|a node that is not there")
        draft.sets = [(name, [n for n in of if n != gone]) for name, of in draft.sets]
        del draft.nodes[gone]


FOLLOWED: tuple[Callable[[Draft, random.Random, str], None], ...] = (
    shuffle, renumber_nodes, renumber_cells, rename_part, rename_set, unite_parts, unite_sets,
    remove_cell, add_cell, add_mass, remove_part, move_member,
)  # fmt: skip
REFUSED: tuple[Callable[[Draft, random.Random, str], None], ...] = (
    rename_in_the_file_alone, remove_name, remove_name_of_model_too, add_loose_face, orphan,
    in_two_parts, double, remove_node,
)  # fmt: skip


def mutated(chance: random.Random, end: str) -> Draft:
    """A draft with up to four changes, of which the last may be one to refuse."""
    draft = chance.choice((solid, shell, frame))(chance)
    for change in chance.choices(FOLLOWED, k=chance.randint(0, 3)):
        change(draft, chance, end)
    if end == "vtu":  # arrays have different names there
        for pairs in (draft.names, draft.sets):
            names = [name for name, _ in pairs]
            draft.faults += [
                f"two arrays 'set:{re.escape(n)}'" for n in names if names.count(n) > 1
            ]
    if not draft.faults and chance.random() < 0.4 and draft.component() is not None:
        chance.choice(REFUSED)(draft, chance, end)
    return draft


def contradicted(text: str, chance: random.Random, end: str) -> tuple[str, str]:
    """A file with something that it cannot mean, and what an error must say."""
    lines = text.splitlines()
    if end == "inp":
        wrong = [
            ("*element", "*elment", r"\*ELMENT"),
            ("type=", "tpe=", "'TPE'|no TYPE"),
            ("*nset", "*nste", r"\*NSTE"),
            ("*node", "*nodes", r"\*NODES"),
            ("*end", "*gap\n1.\n*end", r"\*GAP"),
            ("*element", "*element, type=gapuni\n900001, 1, 2\n*element", "GAPUNI.*900001"),
            ("*nset", "*elset, elset=more\n900002\n*nset", "element 900002, which is not"),
            ("*elset", "*nset, nset=more\n900003\n*elset", "node 900003, which is not"),
        ]
        old, new, said = chance.choice([w for w in wrong if w[0] in text.lower()])
        at = text.lower().index(old)
        return text[:at] + new + text[at + len(old) :], said
    if end == "vtu":
        wrong = [
            ('Name="connectivity" format="ascii">', "0 ", "."),
            ('Name="types" format="ascii">', "", "."),
            ('Name="offsets" format="ascii">', "", "."),
            ('format="ascii">0\n', "2\n", "0 or 1 is expected|."),
        ]
        old, new, said = chance.choice([w for w in wrong if w[0] in text])
        at = text.index(old) + len(old)
        return text[:at] + new + text[text.find("\n", at) + 1 :], said
    sections = ("$Nodes", "$Elements", "$PhysicalNames")
    name = chance.choice([s for s in sections if s in lines])
    first, last = lines.index(name) + 2, lines.index(f"$End{name[1:]}")
    at = chance.randrange(first, last)
    if chance.random() < 0.5:
        lines.insert(at, lines[at])
    else:
        del lines[at]
    return "\n".join([*lines, ""]), "."
