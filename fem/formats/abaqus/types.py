"""Element types of Abaqus and CalculiX: cells, order of nodes, faces."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from fem.mesh.cells import KINDS

TWO_NODE_LINES: tuple[str, ...] = ("B21", "B23", "B31", "B31OS", "B33", "FRAME2D", "FRAME3D")
TWO_NODE_LINES += ("PIPE21", "PIPE31", "T2D2", "T3D2")
THREE_NODE_LINES = ("B22", "B32", "B32OS", "PIPE22", "PIPE32", "T2D3", "T3D3")

_PLANE = {"3": "triangle", "4": "quad", "6": "triangle6", "8": "quad8"}
SOLIDS = {f"{p}{count}": kind for p in ("CPS", "CPE") for count, kind in _PLANE.items()}
SOLIDS |= {"C3D4": "tetra", "C3D5": "pyramid", "C3D6": "wedge", "C3D8": "hexahedron"}
SOLIDS |= {"C3D10": "tetra10", "C3D13": "pyramid13", "C3D15": "wedge15", "C3D20": "hexahedron20"}
SOLIDS |= {"C3D27": "hexahedron27"}
"""Solid elements by the kind of their cells; a suffix for another integration changes nothing."""
SHELLS = {f"{p}{count}": kind for p in ("S", "M3D") for count, kind in _PLANE.items()}
SHELLS |= {"STRI3": "triangle", "STRI65": "triangle6", "S8R5": "quad8", "S4R5": "quad"}
SHELLS |= {"S9R5": "quad9", "M3D9": "quad9"}
"""Shells and membranes by the kind of their cells."""

ORDERS = {"line3": (0, 2, 1), "hexahedron27": (*range(20), 26, 24, 23, 25, 21, 22, 20)}
"""Where VTK's nodes are among those of the file, for kinds whose order is another.

A line of three nodes has the middle one second in the file; a C3D27 has its centre before its
faces, and these in the order of the faces' numbers.
"""

POINT_TYPES = {"MASS": 1, "ROTARYI": 1, "SPRING1": 1, "SPRING2": 2, "SPRINGA": 2}
POINT_TYPES |= {"DASHPOT1": 1, "DASHPOT2": 2, "DASHPOTA": 2, "DCOUP3D": 1, "DCOUP2D": 1}
"""Elements that are no cells, and their number of nodes."""


@dataclass(frozen=True)
class ElementType:
    """What an element type is: its name, the kind of its cells or none, its number of nodes."""

    name: str
    kind: str | None
    count: int
    oriented: bool = False


@cache
def element_type(name: str) -> ElementType | None:
    """The element type of a name, in any case; None for one that is not read.

    Examples
    --------
    >>> element_type("c3d20rh"), element_type("GAPUNI")
    (ElementType(name='C3D20RH', kind='hexahedron20', count=20, oriented=False), None)
    """
    name = name.strip().upper()
    if name in POINT_TYPES:
        return ElementType(name, None, POINT_TYPES[name])
    for lines, kind, count in ((TWO_NODE_LINES, "line", 2), (THREE_NODE_LINES, "line3", 3)):
        if any(re.fullmatch(f"{known}[RHT]*", name) for known in lines):
            return ElementType(name, kind, count, not name.startswith("T"))
    for table, suffix in ((SOLIDS, "[RIHMTS]*"), (SHELLS, "[RST]*")):
        for known, kind in table.items():
            if re.fullmatch(known + suffix, name):
                return ElementType(name, kind, KINDS[kind].node_count)
    return None


_TRIANGLE, _SQUARE = ((0, 1), (1, 2), (2, 0)), ((0, 1), (1, 2), (2, 3), (3, 0))
_TETRAHEDRON = ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0))
_PYRAMID = ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0))
_WEDGE = ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0))
_CUBE = ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0))
_FACES = {3: _TRIANGLE, 4: _SQUARE, 5: _PYRAMID, 6: _WEDGE, 8: _CUBE}


@cache
def faces(kind: str) -> tuple[tuple[int, ...], ...]:
    """Local nodes of the faces S1, S2, ... (of plane cells: edges), with those between corners.

    Examples
    --------
    >>> faces("tetra10")[1]
    (0, 3, 1, 7, 8, 4)
    """
    cell = KINDS[kind]
    count = len(cell.corners)
    found = _TETRAHEDRON if kind.startswith("tetra") else _FACES[count]
    if cell.order == 1:
        return tuple(found)
    middle = {frozenset(edge): node for node, edge in enumerate(cell.edges, count)}
    return tuple(
        face + tuple(middle[frozenset(pair)] for pair in dict.fromkeys(_around(face)))
        for face in found
    )


def _around(face: tuple[int, ...]) -> list[tuple[int, int]]:
    pairs = list(zip(face, face[1:] + face[:1], strict=True))
    return pairs if len(face) > 2 else pairs[:1]
