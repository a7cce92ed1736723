"""Plates and rings of all kinds of cells: how much too high their first frequency is."""

import warnings
from functools import cache

import numpy as np
from scipy.sparse.linalg import eigsh
from structures import CLAMP

import fem
from nldyn.scene.build import TOLD_ERROR

SHELLS = ("quad", "triangle", "quad8", "triangle6")
SOLIDS = ("hexahedron20", "hexahedron20 in full", "hexahedron27", "wedge15", "tetra10")
FIRST = ("hexahedron", "wedge", "tetra")
STEEL = fem.Material(2.1e11, 7800.0, 0.3)
TABLES = {"errors of shells": SHELLS, "errors of solids": SOLIDS, "errors of first order": FIRST}


def assembled(kind, mesh, thickness, supports):
    integration = "full" if kind.endswith("full") else None
    part = (
        fem.ShellPart(STEEL, thickness)
        if kind in SHELLS
        else fem.SolidPart(STEEL, integration=integration)
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return fem.assemble(fem.StructureModel(mesh, {"part": part}, supports=supports))


def plate(kind, n, thickness, held):
    """A square plate of 1 m, clamped or simply supported at its edges."""
    flat = kind in SHELLS
    sizes, counts = ((1.0, 1.0), (n, n)) if flat else ((1.0, 1.0, thickness), (n, n, 1))
    mesh = fem.box_mesh("part", sizes, counts, kind=kind.removesuffix(" in full"))
    sides = {"x0": "x", "x1": "x", "y0": "y", "y1": "y"}
    if held == "clamped":
        edge = np.unique(np.concatenate([mesh.nodes(side) for side in sides]))
        mesh = mesh.with_point_sets({"edge": edge})
        return assembled(
            kind, mesh, thickness, [fem.Support("edge", CLAMP if flat else ("x", "y", "z"))]
        )
    along = {"x": ("y", "z", "rotation_x"), "y": ("x", "z", "rotation_y")}
    supports = [fem.Support(s, along[a][: 3 if flat else 2]) for s, a in sides.items()]
    return assembled(kind, mesh, thickness, supports)


def ring(kind, n, thickness, held="free"):
    """A quarter of a ring of radius 1 m and width 0.2 m that is of n cells in all."""
    flat = kind in SHELLS
    counts = (n // 4, 1) if flat else (n // 4, 1, 1)
    mesh = fem.box_mesh("part", (1.0,) * len(counts), counts, kind=kind.removesuffix(" in full"))
    a, b, c = mesh.points.T
    radius = 1.0 if flat else 1.0 + thickness * (c - 0.5)
    turn = np.pi / 2 * a
    mesh = mesh.with_points(np.stack([radius * np.cos(turn), radius * np.sin(turn), 0.2 * b], 1))
    rotations = (("rotation_x", "rotation_z"), ("rotation_y", "rotation_z")) if flat else ((), ())
    supports = [fem.Support("x0", ("y", *rotations[0])), fem.Support("x1", ("x", *rotations[1]))]
    return assembled(kind, mesh, thickness, [*supports, fem.Support("y0", "z")])


def angle(kind, n, thickness=0.02):
    """Two square plates of 1 m at a right angle, of n x n cells each, clamped at one end."""
    if kind in SHELLS:
        mesh = fem.box_mesh("part", (2.0, 1.0), (2 * n, n), kind=kind)
        a, b, _ = mesh.points.T
        mesh = mesh.with_points(np.stack([np.minimum(a, 1.0), b, np.maximum(a - 1.0, 0.0)], 1))
        return assembled(kind, mesh, thickness, [fem.Support("x0", CLAMP)])
    t = thickness
    boxes = [
        ((1.0, 1.0, t), (n, n, 1), (0.0, 0.0, 0.0)),
        ((t, 1.0, t), (1, n, 1), (1.0, 0.0, 0.0)),
        ((t, 1.0, 1.0), (1, n, n), (1.0, 0.0, t)),
    ]
    mesh = fem.joined([fem.box_mesh("part", *box[:2], origin=box[2], kind=kind) for box in boxes])
    mesh = mesh.with_point_sets({"root": np.flatnonzero(mesh.points[:, 0] == 0.0)})
    return assembled(kind, mesh, thickness, [fem.Support("root", ("x", "y", "z"))])


def first_mode(component):
    return lowest_modes(component, 1)


def lowest_modes(component, count):
    squares, modes = eigsh(component.stiffness.tocsc(), count, component.mass.tocsc(), sigma=-1.0)
    order = np.argsort(squares)
    return np.sqrt(squares[order]) / (2.0 * np.pi), modes[:, order]


@cache
def fine(make, kind, thickness, held):
    """The frequency with a fine mesh, of shells or of solids."""
    best, n = ("quad8", 24) if kind in SHELLS else ("hexahedron20", 20)
    return first_mode(make(best, {plate: n, ring: 96}[make], thickness, held))[0][0]


def errors(make, kind, n, thickness, held):
    """True and estimated error of the first frequency."""
    component = make(kind, n, thickness, held)
    (frequency,), mode = first_mode(component)
    true = frequency / fine(make, kind, thickness, held) - 1.0
    return true, float(component.mesh_errors(mode)[0])


MESHES = [
    *(
        (plate, n, t, held)
        for held in ("clamped", "supported")
        for t in (0.1, 0.01)
        for n in (4, 6, 8, 12)
    ),
    *((ring, n, t, "free") for t in (0.1, 0.01) for n in (8, 16, 32, 64)),
]


def rows(kinds):
    """Lines of a table: true and estimated error in percent."""
    for make, n, thickness, held in MESHES:
        found = [errors(make, kind, n, thickness, held) for kind in kinds]
        values = " | ".join(f"{entry(true)}, {entry(said)}" for true, said in found)
        name = f"{held} plate, {n} x {n}" if make is plate else f"ring of {n}"
        yield f"| {name}, {thickness} | {values} |"


def entry(value):
    return "over 100" if value >= 1.0 else f"{100 * value + 0.0:.1f}"


def counts(table):
    """Hits (over 5 % and told), misses, false alarms (below 2 %) and those in between, of lines."""
    pairs = [
        [float(each.replace("over ", "")) for each in cell.split(", ")]
        for line in table
        for cell in line.strip(" |").split(" | ")[1:]
    ]
    told = [said > 100 * TOLD_ERROR for _, said in pairs]
    wrong = [true for true, _ in pairs]
    both = list(zip(wrong, told, strict=True))
    return {
        "hits": sum(t > 5.0 and w for t, w in both),
        "misses": sum(t > 5.0 and not w for t, w in both),
        "false alarms": sum(t < 2.0 and w for t, w in both),
        "rightly silent": sum(t < 2.0 and not w for t, w in both),
        "between": sum(2.0 <= t <= 5.0 for t, _ in both),
    }
