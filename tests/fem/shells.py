"""What the tests of shells share: curved meshes, loads, and published static benchmarks."""

from functools import cache

import numpy as np
from scipy.sparse.linalg import spsolve
from structures import CLAMP

import fem


def mapped(kind, counts, place):
    """A mesh of the unit square put in space by a function of (a, b), with the (a, b) of nodes.

    Its edges keep the names "x0", "x1", "y0" and "y1".
    """
    mesh = fem.box_mesh("shell", (1.0, 1.0), counts, kind=kind)
    square = mesh.points[:, :2].copy()
    return mesh.with_points(np.array([place(a, b) for a, b in square])), square


def shell(mesh, modulus, poisson, thickness, supports, **options):
    """The assembled shell; its density is 1 kg/m³."""
    part = fem.ShellPart(fem.Material(modulus, 1.0, poisson), thickness, **options)
    return fem.assemble(fem.StructureModel(mesh, {"shell": part}, supports=supports))


def nearest(square, place):
    return int(np.argmin(((square - place) ** 2).sum(axis=1)))


def deflection(component, loads, seen):
    """Displacement at (node, axis) under loads (node, axis, force)."""
    dofs = component.numbering.dofs(np.arange(len(component.model.mesh.points)))
    force = np.zeros(3 * component.numbering.count)
    for node, axis, value in loads:
        force[dofs[node, axis]] += value
    T = component.constraints.transformation
    return component.shape(spsolve(component.stiffness.tocsc(), T.T @ force))[seen]


def along_edge(mesh, name, square, column):
    """Shares of a unit load that is constant along an edge of two-node sides."""
    nodes = mesh.nodes(name)
    ends = np.isin(square[nodes, column], (0.0, 1.0))
    weights = np.where(ends, 0.5, 1.0)
    return list(zip(nodes, weights / weights.sum(), strict=True))


def hemisphere(kind, n):
    """A quarter of a hemisphere of radius 10 with a hole of 18 degrees, pulled and pressed."""

    def place(a, b):
        turn, height = a * np.pi / 2, b * np.radians(72)
        ring = 10.0 * np.cos(height)
        return ring * np.cos(turn), ring * np.sin(turn), 10.0 * np.sin(height)

    mesh, square = mapped(kind, (n, n), place)
    first, last = nearest(square, (0, 0)), nearest(square, (1, 0))
    mesh = mesh.with_point_sets({"first": [first]})
    held = [fem.symmetry("x0", "y"), fem.symmetry("x1", "x"), fem.Support("first", "z")]
    component = shell(mesh, 6.825e7, 0.3, 0.04, held)
    return deflection(component, [(first, 0, 1.0), (last, 1, -1.0)], (first, 0))


@cache
def twisted_beam(kind, counts, thickness):
    """A strip of 12 by 1.1 twisted by 90 degrees: deflections along and across the width."""

    def place(a, b):
        turn, width = a * np.pi / 2, 1.1 * (b - 0.5)
        return 12.0 * a, width * np.cos(turn), width * np.sin(turn)

    mesh, square = mapped(kind, counts, place)
    component = shell(mesh, 29e6, 0.22, thickness, [fem.Support("x0", CLAMP)])
    tip, ends = nearest(square, (1, 0.5)), along_edge(mesh, "x1", square, 1)
    return [
        deflection(component, [(node, axis, share) for node, share in ends], (tip, axis))
        for axis in (2, 1)
    ]


def roof(kind, n):
    """Scordelis and Lo's roof under its weight of 90 per area: sag of the middle of a free edge."""

    def place(a, b):
        turn = np.radians(40) * a
        return 25.0 * np.sin(turn), 25.0 * b, 25.0 * np.cos(turn)

    mesh, square = mapped(kind, (n, n), place)
    held = [fem.symmetry("x0", "x"), fem.symmetry("y1", "y"), fem.Support("y0", ("x", "z"))]
    component = shell(mesh, 4.32e8, 0.0, 0.25, held)
    free = shell(mesh, 4.32e8, 0.0, 0.25, ())
    dofs = free.numbering.dofs(np.arange(len(mesh.points)))
    down = np.zeros(len(free.free))
    down[dofs[:, 2]] = -1.0
    weight = free.mass @ down * 90.0 / 0.25
    loads = [(node, axis, weight[dofs[node, axis]]) for node, axis in np.ndindex(dofs.shape)]
    return -deflection(component, loads, (nearest(square, (1, 1)), 2))


def pinched_cylinder(kind, n):
    """An eighth of a cylinder with end diaphragms, pinched in the middle by unit forces."""

    def place(a, b):
        turn = np.pi / 2 * a
        return 300.0 * np.sin(turn), 300.0 * b, 300.0 * np.cos(turn)

    mesh, square = mapped(kind, (n, n), place)
    held = [
        fem.symmetry("x0", "x"),
        fem.symmetry("x1", "z"),
        fem.symmetry("y1", "y"),
        fem.Support("y0", ("x", "z")),
    ]
    component = shell(mesh, 3e6, 0.3, 3.0, held)
    top = nearest(square, (0, 1))
    return -deflection(component, [(top, 2, -0.25)], (top, 2))


def curved_beam(kind, counts):
    """A quarter of a ring in its plane, radially loaded at its tip."""

    def place(a, b):
        radius, turn = 4.12 + 0.2 * b, np.pi / 2 * a
        return radius * np.sin(turn), radius * np.cos(turn), 0.0

    mesh, square = mapped(kind, counts, place)
    component = shell(mesh, 1e7, 0.25, 0.1, [fem.Support("x0", CLAMP)])
    ends = along_edge(mesh, "x1", square, 1)
    moved = deflection(component, [(node, 0, share) for node, share in ends], (slice(None), 0))
    return sum(share * moved[node] for node, share in ends)


def straight_beam(kind, times, shape):
    """A beam of 6 by 0.2, bent in its plane, of six slanting cells, each cut into times²."""
    leans = {"trapezoids": (0.1, -0.1), "parallelograms": (0.1, 0.1)}[shape]

    def place(a, b):
        column = min(int(6 * a + 1e-9), 5)
        share = 6 * a - column
        left, right = (0.0 if i in (0, 6) else leans[i % 2] for i in (column, column + 1))
        return 6 * a + ((1 - share) * left + share * right) * (2 * b - 1), 0.2 * b, 0.0

    mesh, square = mapped(kind, (6 * times, times), place)
    component = shell(mesh, 1e7, 0.3, 0.1, [fem.Support("x0", CLAMP)])
    ends = along_edge(mesh, "x1", square, 1)
    moved = deflection(component, [(node, 1, share) for node, share in ends], (slice(None), 1))
    return sum(share * moved[node] for node, share in ends)
