"""Meshes by labels, whatever they hold, and writers of them by hand for four formats.

A reader is compared with the draft, never with another reader.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from xml.sax.saxutils import quoteattr

import numpy as np

import fem
from fem.mesh.attachments import Attachments

Label = int
CLAMP = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
GMSH = {"line": 1, "triangle": 2, "quad": 3, "tetra": 4, "hexahedron": 5, "wedge": 6, "pyramid": 7}
VTK = {"line": 3, "triangle": 5, "quad": 9, "tetra": 10, "hexahedron": 12, "wedge": 13}
VTK |= {"pyramid": 14}
DIMENSION = {"line": 1, "triangle": 2, "quad": 2}
SHELLS = {"triangle": "S3", "quad": "S4", "line": "T3D2"}
SOLIDS = {"tetra": "C3D4", "hexahedron": "C3D8", "wedge": "C3D6", "pyramid": "C3D5"}
SOLIDS |= {"triangle": "CPS3", "quad": "CPS4"}
ABAQUS = {"solid": SOLIDS, "shell": SHELLS, "frame": {"line": "B21"}}
FACES = {
    "tetra": ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)),
    "pyramid": ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "wedge": ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6),
                   (3, 0, 4, 7)),
}  # fmt: skip
"""Corners of the faces, seen from outside all the same way round."""


@dataclass
class Draft:
    """A mesh by labels; `names` and `sets` are lists, since a file may use a name twice."""

    model: str
    nodes: dict[Label, tuple[float, ...]]
    cells: dict[Label, tuple[str, tuple[Label, ...]]]
    names: list[tuple[str, list[Label]]]
    sets: list[tuple[str, list[Label]]]
    densities: dict[str, float]
    held: str = "root"
    seen: str = "tip"
    masses: dict[Label, float] = field(default_factory=dict)
    """In kg at nodes; only a deck can say so."""
    faults: list[str] = field(default_factory=list)
    """What an error must say, one of them; without any, the draft must be read."""

    def mass(self) -> float:
        """Of the point masses and of all cells that are in parts, by their corners alone."""
        of_part = {
            name: {label for other, labels in self.names if other == name for label in labels}
            for name in self.densities
        }
        return sum(self.masses.values()) + sum(
            self.densities[name] * self._measure(label)
            for name, labels in of_part.items()
            for label in labels
        )

    def _measure(self, label: Label) -> float:
        """Volume of a solid, of a shell of 0.01 m, of a beam of 0.01 x 0.02 m."""
        kind, nodes = self.cells[label]
        corners = np.array([self.nodes[node] for node in nodes])
        if kind == "line":
            return float(np.linalg.norm(corners[1] - corners[0])) * 2e-4
        if kind in DIMENSION:
            return 0.01 * float(np.linalg.norm(_area(corners)))
        centre = corners.mean(axis=0)
        return abs(sum(_cone(corners[list(face)] - centre) for face in FACES[kind]))

    def mesh(self) -> fem.StructureMesh:
        """The mesh in memory."""
        place = {label: i for i, label in enumerate(self.nodes)}
        kinds: dict[str, list[Label]] = {}
        for label, (kind, _) in self.cells.items():
            kinds.setdefault(kind, []).append(label)
        cells = {
            kind: np.array([[place[n] for n in self.cells[label][1]] for label in labels])
            for kind, labels in kinds.items()
        }
        groups: dict[str, dict[str, list[int]]] = {}
        for name, members in self.names:
            for kind, labels in kinds.items():
                found = [i for i, label in enumerate(labels) if label in set(members)]
                groups.setdefault(name, {}).setdefault(kind, []).extend(found)
        sets: dict[str, list[int]] = {}
        for name, nodes in self.sets:
            sets.setdefault(name, []).extend(place[node] for node in nodes)
        masses = []
        for node, kg in self.masses.items():
            sets[f"node {node}"] = [place[node]]
            masses.append(fem.PointMass(f"node {node}", kg))
        brought = Attachments(masses)
        points = np.array(list(self.nodes.values()))
        return fem.StructureMesh(points, cells, groups, sets, "draft", (), brought)

    def assembled(self, mesh: fem.StructureMesh):
        """The component of a mesh with the parts and places of this draft."""
        materials = {n: fem.Material(2e11, density, 0.3) for n, density in self.densities.items()}
        at_tip = {"tip": fem.Interface(self.seen, "x")}
        if self.model == "frame":
            section = fem.RectangularSection(0.01, 0.02)
            beams = {name: fem.BeamPart(material, section) for name, material in materials.items()}
            held = [fem.Support(self.held, ("x", "y", "rotation"))]
            return fem.assemble(
                fem.StructureModel(mesh, beams, held, interfaces=at_tip, plane=True)
            )
        if self.model == "shell":
            parts = {n: fem.ShellPart(material, 0.01) for n, material in materials.items()}
            held = [fem.Support(self.held, CLAMP)]
        else:
            parts = {name: fem.SolidPart(material) for name, material in materials.items()}
            held = [fem.Support(self.held, ("x", "y", "z"))]
        return fem.assemble(fem.StructureModel(mesh, parts, held, interfaces=at_tip))

    def component(self):
        """The component without a file; None if it cannot be one."""
        try:
            return self.assembled(self.mesh())
        except (fem.ModelError, KeyError):
            return None

    def names_of(self, label: Label) -> list[int]:
        """Which of the names a cell has."""
        return [i for i, (_, members) in enumerate(self.names) if label in members]

    def runs(self) -> list[tuple[str, tuple[int, ...], list[Label]]]:
        """Cells in their order that follow each other with one kind and the same names."""

        def key(label: Label) -> tuple[str, tuple[int, ...]]:
            return self.cells[label][0], tuple(self.names_of(label))

        return [(*of_run, list(labels)) for of_run, labels in groupby(self.cells, key)]


def _area(corners: np.ndarray) -> np.ndarray:
    rest = corners[1:] - corners[0]
    return sum(np.cross(a, b) for a, b in pairwise(rest)) / 2.0


def _cone(face: np.ndarray) -> float:
    """Volume between the origin and a face, a bilinear one if it has four corners.

    That one halves the tetrahedron of its corners, so its cone is the mean over both diagonals.
    """
    if len(face) == 3:
        return float(np.linalg.det(face)) / 6.0
    halves = [(0, 1, 2), (0, 2, 3), (1, 2, 3), (1, 3, 0)]
    return sum(float(np.linalg.det(face[list(half)])) for half in halves) / 12.0


def _row(*words: object, by: str = " ") -> str:
    return by.join(repr(float(w)) if isinstance(w, float) else str(w) for w in words)


def _physical_names(draft: Draft) -> list[tuple[int, int, str]]:
    """Dimension, tag and name of the groups, first those of cells and then those of points."""
    found = []
    for tag, (name, labels) in enumerate(draft.names, start=1):
        found += [(DIMENSION.get(draft.cells[labels[0]][0], 3), tag, name)] if labels else []
    first = len(draft.names) + 1
    return found + [(0, tag, name) for tag, (name, _) in enumerate(draft.sets, start=first)]


def _head_of_gmsh(draft: Draft, version: str) -> list[str]:
    names = _physical_names(draft)
    rows = ["$MeshFormat", f"{version} 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(names))]
    return [*rows, *(f'{d} {tag} "{name}"' for d, tag, name in names), "$EndPhysicalNames"]


def gmsh_22(draft: Draft, chance: random.Random) -> str:
    """Gmsh 2.2, with a cell once for each of its groups."""
    rows = []
    for volume, (kind, names, labels) in enumerate(draft.runs(), start=1):
        for label in labels:
            for name in names or (-1,):
                nodes = draft.cells[label][1]
                rows.append(_row(len(rows) + 1, GMSH[kind], 2, name + 1, volume, *nodes))
    for tag, (_, nodes) in enumerate(draft.sets, start=len(draft.names) + 1):
        rows += [_row(len(rows) + i, 15, 2, tag, n, n) for i, n in enumerate(nodes, start=1)]
    return "\n".join(
        [*_head_of_gmsh(draft, "2.2"), "$Nodes", str(len(draft.nodes))]
        + [_row(label, *place) for label, place in draft.nodes.items()]
        + ["$EndNodes", "$Elements", str(len(rows)), *rows, "$EndElements", ""]
    )


def gmsh_41(draft: Draft, chance: random.Random) -> str:
    """Gmsh 4.1: an entity for each run of cells, nodes in some blocks."""
    runs = draft.runs()
    entities: dict[int, list[str]] = {d: [] for d in range(4)}
    blocks, count = [], 0
    for number, (kind, names, labels) in enumerate(runs, start=1):
        dimension = DIMENSION.get(kind, 3)
        tags = [name + 1 for name in names]
        box = "0 0 0 1 1 1"
        entities[dimension].append(_row(number, box, len(tags), *tags, 0))
        blocks.append(_row(dimension, number, GMSH[kind], len(labels)))
        for label in labels:
            count += 1
            blocks.append(_row(label, *draft.cells[label][1]))
    first = len(draft.names) + 1
    marked = {node for _, nodes in draft.sets for node in nodes}
    for node in draft.nodes:
        if node in marked:
            tags = [tag for tag, (_, ns) in enumerate(draft.sets, start=first) if node in ns]
            entities[0].append(_row(node, *draft.nodes[node], len(tags), *tags))
            blocks += [_row(0, node, 15, 1), _row(max(draft.cells) + node, node)]
            count += 1
    labels = list(draft.nodes)
    cut = chance.randint(0, len(labels))
    rows = []
    for block in (labels[:cut], labels[cut:]):
        rows += [_row(0, 1, 0, len(block)), *map(str, block)]
        rows += [_row(*draft.nodes[label]) for label in block]
    head = [*_head_of_gmsh(draft, "4.1"), "$Entities", _row(*(len(e) for e in entities.values()))]
    rows = [_row(2, len(labels), min(labels), max(labels)), *rows, "$EndNodes", "$Elements"]
    rows.append(_row(len(runs) + len(entities[0]), count, 1, count))
    tags = [row for of_dimension in entities.values() for row in of_dimension]
    return "\n".join([*head, *tags, "$EndEntities", "$Nodes", *rows, *blocks, "$EndElements", ""])


def vtu(draft: Draft, chance: random.Random) -> str:
    """VTK unstructured grid with arrays as text."""
    place = {label: i for i, label in enumerate(draft.nodes)}
    cells = list(draft.cells.values())
    connectivity = [_row(*(place.get(n, len(place)) for n in nodes)) for _, nodes in cells]
    offsets = np.cumsum([len(nodes) for _, nodes in cells]).tolist()

    def array(name: str, values: list[object], kind: str = "Int64", more: str = "") -> str:
        text = "\n".join(map(str, values))
        head = f'<DataArray type="{kind}" Name={quoteattr(name)}{more} format="ascii">'
        return f"{head}{text}</DataArray>"

    def marks(sets: list[tuple[str, list[Label]]], labels: list[Label]) -> list[str]:
        return [array(f"set:{name}", [int(x in of) for x in labels]) for name, of in sets]

    return "\n".join(
        [
            '<?xml version="1.0"?>',
            '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian">',
            f'<UnstructuredGrid><Piece NumberOfPoints="{len(place)}" NumberOfCells="{len(cells)}">',
            "<Points>",
            array("Points", [_row(*xyz) for xyz in draft.nodes.values()], "Float64",
                  ' NumberOfComponents="3"'),
            "</Points><Cells>",
            array("connectivity", connectivity),
            array("offsets", offsets),
            array("types", [VTK[kind] for kind, _ in cells]),
            "</Cells><PointData>",
            *marks(draft.sets, list(draft.nodes)),
            "</PointData><CellData>",
            *marks(draft.names, list(draft.cells)),
            "</CellData></Piece></UnstructuredGrid></VTKFile>",
        ]
    )  # fmt: skip


def deck(draft: Draft, chance: random.Random) -> str:
    """An input file of Abaqus in one of its dialects: flat, or a part with an instance."""
    case = chance.choice((str.upper, str.lower, str.title))
    on_element = chance.random() < 0.5
    rows = [case("*NODE")] + [_row(n, *place, by=", ") for n, place in draft.nodes.items()]
    named: dict[int, list[Label]] = {i: list(of) for i, (_, of) in enumerate(draft.names)}
    for kind, names, labels in draft.runs():
        head = f"*ELEMENT, TYPE={ABAQUS[draft.model][kind]}"
        if on_element and names:
            head += f', ELSET="{draft.names[names[0]][0]}"'
            named[names[0]] = [n for n in named[names[0]] if n not in labels]
        rows.append(case(head.partition("ELSET")[0]) + "".join(head.partition("ELSET")[1:]))
        rows += [_row(label, *draft.cells[label][1], by=", ") for label in labels]
    sets = [("ELSET", draft.names[i][0], of) for i, of in named.items()]
    for keyword, name, labels in [*sets, *(("NSET", name, of) for name, of in draft.sets)]:
        if labels:
            rows += [case(f"*{keyword}, {keyword}=") + f'"{name}"']
            rows += [_row(*labels[i : i + 9], by=", ") for i in range(0, len(labels), 9)]
    for label, (node, kg) in enumerate(draft.masses.items(), start=max(draft.cells) + 1):
        rows += [case("*ELEMENT, TYPE=MASS, ELSET=") + f"kg{label}", _row(label, node, by=", ")]
        rows += [case("*MASS, ELSET=") + f"KG{label}", repr(kg)]
    if not draft.masses and chance.random() < 0.4:
        shift = "*Instance, name=one, part=body\n0.5, 0.0, 0.0\n*End Instance"
        rows = ["*Part, name=body", *rows, "*End Part", "*Assembly, name=all", shift]
        rows.append("*End Assembly")
    return "\n".join([*rows, ""])


WRITERS = {"2.2.msh": gmsh_22, "4.1.msh": gmsh_41, "vtu": vtu, "inp": deck}
"""Writers by the end of the file's name."""
