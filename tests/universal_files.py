"""Universal files (UNV), written as Salome writes them."""

from __future__ import annotations

import fem
from fem.mesh.cells import KINDS

UNV_NUMBERS = {"line": 21, "line3": 24, "triangle": 91, "triangle6": 92, "quad": 94, "quad8": 95}
UNV_NUMBERS |= {"tetra": 111, "tetra10": 118, "wedge": 112, "wedge15": 113, "hexahedron": 115}
UNV_NUMBERS |= {"hexahedron20": 116, "pyramid": 312, "pyramid13": 114}
UNV_RINGS = {
    "line3": ((0,), (1,)),
    "triangle6": ((0, 1, 2),),
    "quad8": ((0, 1, 2, 3),),
    "tetra10": ((0, 1, 2), (3,)),
    "pyramid13": ((0, 1, 2, 3), (4,)),
    "wedge15": ((0, 1, 2), (3, 4, 5)),
    "hexahedron20": ((0, 1, 2, 3), (4, 5, 6, 7)),
}
"""Corners of the lower and the upper face of cells of second order."""


def unv_order(kind: str) -> list[int]:
    """Around the lower face from corner to corner, upwards between them, around the upper face."""
    own = KINDS[kind]
    if kind not in UNV_RINGS:
        return list(range(own.node_count))
    middle = {frozenset(edge): len(own.corners) + i for i, edge in enumerate(own.edges)}
    low, *high = UNV_RINGS[kind]

    def around(ring):
        pairs = zip(ring, ring[1:] + ring[:1], strict=True)
        return [n for a, b in pairs for n in (a, *filter(None, [middle.get(frozenset((a, b)))]))]

    upwards = [middle[frozenset((a, b))] for top in high for a in low for b in top
               if frozenset((a, b)) in middle]  # fmt: skip
    return around(low) + upwards + [n for top in high for n in around(top)]


def _row(numbers) -> str:
    return "".join(f"{number:10}" for number in numbers)


def write_unv(mesh: fem.StructureMesh, path, per_metre: float = 1.0) -> None:
    """As Salome writes it: units, nodes, elements, groups of elements and of nodes."""
    lines = ["    -1", "   164", f"{1:10}{'SI: Meter (newton)':20}{2:10}"]
    lines += [f"{per_metre:25.16E}{1:25.16E}{1:25.16E}".replace("E", "D"), f"{273.15:25.16E}"]
    lines += ["    -1", "    -1", "  2411"]
    for label, place in enumerate(mesh.points, start=1):
        lines.append(f"{label:10}{1:10}{1:10}{11:10}")
        lines.append("".join(f"{value:25.16E}" for value in place).replace("E", "D"))
    lines += ["    -1", "    -1", "  2412"]
    first = {}
    label = 0
    for kind, cells in mesh.cells.items():
        first[kind] = label + 1
        for nodes in cells[:, unv_order(kind)] + 1:
            label += 1
            lines.append(_row([label, UNV_NUMBERS[kind], 2, 1, 7, len(nodes)]))
            if kind.startswith("line"):
                lines.append(f"{0:10}{1:10}{1:10}")
            lines += [_row(nodes[at : at + 8]) for at in range(0, len(nodes), 8)]
    lines += ["    -1", "    -1", "  2467"]
    members = [
        (name, [(8, first[kind] + at) for kind, found in group.items() for at in found])
        for name, group in mesh.groups.items()
    ]
    members += [(name, [(7, n + 1) for n in nodes]) for name, nodes in mesh.point_sets.items()]
    for number, (name, of) in enumerate(members, start=1):
        lines += [_row([number, *6 * [0], len(of)]), name]
        words = [f"{kind:10}{at:10}{0:10}{0:10}" for kind, at in of]
        lines += ["".join(words[i : i + 2]) for i in range(0, len(words), 2)]
    path.write_text("\n".join([*lines, "    -1", ""]))
