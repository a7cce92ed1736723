"""MacNeal and Harder's problems for any kind of shell or solid: computed over published deflection.

R. H. MacNeal and R. L. Harder, A proposed standard set of problems to test finite element accuracy,
Finite Elements in Analysis and Design 1 (1985) 3-20. The thinnest twisted beam is that of
T. Belytschko et al., Stress projection for membrane and shear locking in shell finite elements,
Computer Methods in Applied Mechanics and Engineering 51 (1985) 221-258. Meshes are the regular ones
of the paper, and the finest of those that it divides; it counts spaces between nodes, of which
cells of second order have two.
"""

import itertools
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.sparse.linalg import splu
from structures import CLAMP

import fem
from fem.mesh.cells import KINDS, measures

SHELLS = ("quad", "quad8", "quad9", "triangle", "triangle6")
FULL = "hexahedron20 in full"
SOLIDS = ("hexahedron20", FULL, "hexahedron27", "wedge15", "wedge18", "tetra10")
SOLIDS += ("pyramid13", "pyramid14")
FIRST_ORDER = ("hexahedron", "wedge", "tetra", "pyramid")


@dataclass(frozen=True, eq=False)
class Body:
    """An assembled part on the image of a square or a cube, and where its nodes were there."""

    component: fem.Component
    at: np.ndarray
    shell: bool

    def dofs(self):
        return self.component.numbering.dofs(np.arange(len(self.component.model.mesh.points)))

    def moved(self, force):
        """Displacements (n, 6) under forces (n, 6)."""
        full = np.zeros(3 * self.component.numbering.count + 1)
        dofs = self.dofs()
        np.add.at(full, dofs[dofs >= 0], force[dofs >= 0])
        T = self.component.constraints.transformation
        return self.component.shape(self.solved(T.T @ full[:-1]))

    def solved(self, load):
        """K⁻¹ load; what K has lost of its digits is refined by its natural form."""
        form, factor = self.component.natural_form, splu(self.component.stiffness.tocsc())
        A, d = form.deformations, form.stiffness
        found = factor.solve(load)
        for _ in range(20):
            change = factor.solve(load - A.rmatvec(d * A.matvec(found)))
            found += change
            if np.abs(change).max() <= 1e-8 * np.abs(found).max():
                return found
        raise AssertionError("rounding of K is larger than what it holds")

    def end(self, name):
        """Shares (n,) of a load that is constant along an edge or on a face."""
        mesh = self.component.model.mesh
        found = np.zeros(len(mesh.points))
        if self.shell:
            nodes = mesh.nodes(name)
            column = 1 if name[0] == "x" else 0
            order = nodes[np.argsort(self.at[nodes, column])]
            lengths = np.linalg.norm(np.diff(mesh.points[order], axis=0), axis=1)
            np.add.at(found, order[:-1], lengths / 2)
            np.add.at(found, order[1:], lengths / 2)
            return found / found.sum()
        for kind, facets in self.component.model.facets_on(name).items():
            places, _ = KINDS[kind].quadrature
            values, _ = KINDS[kind].basis(places)
            area = measures(kind, mesh.points[facets])
            np.add.at(found, facets, area @ values)
        return found / found.sum()

    def along(self, name, axis):
        """Mean displacement of an end under a unit load on it."""
        share = self.end(name)
        force = np.zeros((len(share), 6))
        force[:, axis] = share
        return share @ self.moved(force)[:, axis]

    def line(self, a, b):
        """Shares (n,) of a load at a place of the square, through the thickness."""
        here = np.flatnonzero((np.abs(self.at[:, :2] - (a, b)) < 1e-9).all(axis=1))
        middle = np.isclose(self.at[here, 2], 0.5)
        share = np.where(middle, 4.0, 1.0) if len(here) == 3 else np.ones(len(here))
        found = np.zeros(len(self.at))
        found[here] = share / share.sum()
        return found

    def weight(self, load, thickness):
        """Forces (n, 6) of a load along z per area of the surface."""
        mesh, model = self.component.model.mesh, self.component.model
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            free = fem.assemble(fem.StructureModel(mesh, model.parts))
        force = np.zeros((len(mesh.points), 6))
        dofs = free.numbering.dofs(np.arange(len(mesh.points)))
        inertia = np.append(free.inertia[:, 2], 0.0)
        force[:, :3] = inertia[dofs[:, :3]] * load / thickness
        return force


def body(kind, counts, place, thickness, modulus, poisson, supports):
    """A shell or one layer of solids where a function puts (a, b, height over the middle)."""
    shell = kind in SHELLS
    name = kind.removesuffix(" in full")
    size, counts = ((1.0, 1.0), counts) if shell else ((1.0, 1.0, 1.0), (*counts, 1))
    mesh = fem.box_mesh("body", size, counts, kind=name)
    at = mesh.points.copy()
    if shell:
        at[:, 2] = 0.5
    points = np.array([place(a, b, thickness * (c - 0.5)) for a, b, c in at])
    lowest = np.flatnonzero((at[:, :2] == 0.0).all(axis=1))[:1]
    mesh = mesh.with_point_sets({"lowest": lowest})
    material = fem.Material(modulus, 1.0, poisson)
    integration = "full" if kind == FULL else None
    part = (
        fem.ShellPart(material, thickness)
        if shell
        else fem.SolidPart(material, integration=integration)
    )
    held = [
        fem.Support(name, tuple(d for d in directions if shell or len(d) == 1))
        for name, directions in supports.items()
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fem.DistortionWarning)
        warnings.simplefilter("ignore", fem.UnlikelyWarning)
        model = fem.StructureModel(mesh.with_points(points), {"body": part}, supports=held)
        component = fem.assemble(model)
    more = len(model.mesh.points) - len(at)  # middles of quad8, where nothing is looked for
    return Body(component, np.vstack([at, np.full((more, 3), -1.0)]), shell)


def spaces(kind, n):
    """Cells (n, n) with so many spaces between the nodes along a side."""
    order = KINDS[kind.removesuffix(" in full")].order
    return (n // order, n // order)


@cache
def straight(kind, shape="rectangles"):
    """A cantilever of 6 x 0.2 x 0.1 in six cells."""
    leans = {"rectangles": (0, 0), "trapezoids": (0.1, -0.1), "parallelograms": (0.1, 0.1)}[shape]

    def place(a, b, h):
        column = min(int(6 * a + 1e-9), 5)
        share = 6 * a - column
        left, right = (0.0 if i in (0, 6) else leans[i % 2] for i in (column, column + 1))
        return 6 * a + ((1 - share) * left + share * right) * (2 * b - 1), 0.2 * b, h

    return body(kind, (6, 1), place, 0.1, 1e7, 0.3, {"x0": CLAMP})


def twisting(kind):
    """Turn of the straight beam's end under forces along z that are linear across the width."""
    beam = straight(kind)
    y = beam.component.model.mesh.points[:, 1] - 0.1
    share = beam.end("x1") * y
    force = np.zeros((len(y), 6))
    force[:, 2] = share / (share @ y)
    turn = beam.moved(force)[:, 2] @ (share / (share @ y))
    return turn


@cache
def curved(kind):
    """A quarter of a ring of 4.12 to 4.32, 0.1 thick, in six cells."""

    def place(a, b, h):
        radius, turn = 4.12 + 0.2 * b, np.pi / 2 * a
        return radius * np.sin(turn), radius * np.cos(turn), h

    return body(kind, (6, 1), place, 0.1, 1e7, 0.25, {"x0": CLAMP})


@cache
def twisted(kind, thickness):
    """A strip of 12 x 1.1 twisted by 90 degrees."""

    def place(a, b, h):
        turn, width = a * np.pi / 2, 1.1 * (b - 0.5)
        return (
            12.0 * a,
            width * np.cos(turn) - h * np.sin(turn),
            width * np.sin(turn) + h * np.cos(turn),
        )

    return body(kind, (12, 2), place, thickness, 29e6, 0.22, {"x0": CLAMP})


def plate(kind, length, held, load):
    """Deflection of the middle of a plate of 2 by the length, by a quarter of it."""
    thickness = 0.01
    edges = {
        "simple": {"x1": ("y", "z", "rotation_x"), "y1": ("x", "z", "rotation_y")},
        "clamped": {"x1": CLAMP, "y1": CLAMP},
    }[held]
    planes = {"x0": ("x", "rotation_y", "rotation_z"), "y0": ("y", "rotation_x", "rotation_z")}
    quarter = body(
        kind,
        spaces(kind, 8),
        lambda a, b, h: (a, length / 2 * b, h),
        thickness,
        1.7472e7,
        0.3,
        {**planes, **edges},
    )
    middle = quarter.line(0, 0)
    force = quarter.weight(1e-4, thickness) if load == "pressure" else np.zeros((len(middle), 6))
    if load == "force":
        force[:, 2] = 1e-4 * middle
    return middle @ quarter.moved(force)[:, 2]


def roof(kind):
    """Scordelis and Lo's roof under its weight: sag of the middle of a free edge."""

    def place(a, b, h):
        turn, radius = np.radians(40) * a, 25.0 + h
        return radius * np.sin(turn), 25.0 * b, radius * np.cos(turn)

    held = {
        "x0": ("x", "rotation_y", "rotation_z"),
        "y1": ("y", "rotation_x", "rotation_z"),
        "y0": ("x", "z"),
    }
    quarter = body(kind, spaces(kind, 10), place, 0.25, 4.32e8, 0.0, held)
    edge = quarter.line(1, 1)
    return -edge @ quarter.moved(-quarter.weight(90.0, 0.25))[:, 2]


def hemisphere(kind):
    """A quarter of a hemisphere with a hole of 18 degrees, pulled and pressed."""

    def place(a, b, h):
        turn, height, radius = a * np.pi / 2, b * np.radians(72), 10.0 + h
        ring = radius * np.cos(height)
        return ring * np.cos(turn), ring * np.sin(turn), radius * np.sin(height)

    held = {"x0": ("y", "rotation_x", "rotation_z"), "x1": ("x", "rotation_y", "rotation_z")}
    quarter = body(kind, spaces(kind, 12), place, 0.04, 6.825e7, 0.3, held | {"lowest": ("z",)})
    first, last = quarter.line(0, 0), quarter.line(1, 0)
    force = np.zeros((len(first), 6))
    force[:, 0], force[:, 1] = first, -last
    return first @ quarter.moved(force)[:, 0]


RADII = (3.0, 3.5, 4.2, 5.2, 6.75, 9.0)


def tube(a, b, h):
    """Where a quarter of the thick cylinder has its nodes."""
    turn, radius = np.pi / 2 * a, np.interp(5 * b, range(6), RADII)
    return radius * np.cos(turn), radius * np.sin(turn), h


def cylinder(kind, poisson):
    """A quarter of a thick cylinder in plane strain, 1 long, under a pressure of 1 inside."""
    held = {"x0": ("y",), "x1": ("x",), "z0": ("z",), "z1": ("z",)}
    quarter = body(kind, (9, 5), tube, 1.0, 1000.0, poisson, held)
    share = quarter.end("y0")
    points = quarter.component.model.mesh.points
    outwards = points * (1.0, 1.0, 0.0) / np.linalg.norm(points[:, :2], axis=1)[:, None]
    inside = 3.0 * np.pi / 2
    force = np.hstack([outwards * share[:, None] * inside, np.zeros_like(points)])
    moved = quarter.moved(force)[:, :3]
    return share @ np.einsum("ni,ni->n", moved, outwards)


@dataclass(frozen=True)
class Problem:
    """A deflection of any kind of cells, and the published one."""

    name: str
    deflection: Callable[[str], float]
    published: float


def ends(name, beam, axis, published):
    return Problem(name, lambda kind: beam(kind).along("x1", axis), published)


def plates(name, length, published):
    cases = itertools.product(("simple", "clamped"), ("pressure", "force"))
    words = {"simple": "simply supported", "clamped": "clamped"}
    return [
        Problem(
            f"{name} plate, {words[held]}, {load}",
            lambda kind, held=held, load=load: plate(kind, length, held, load),
            value * 1e-6,
        )
        for (held, load), value in zip(cases, published, strict=True)
    ]


def leaning(shape):
    return lambda kind: straight(kind, shape)


def twisted_of(thickness):
    return lambda kind: twisted(kind, thickness)


REGULAR = [
    ends("straight beam, in its plane", straight, 1, 0.1081),
    ends("straight beam, out of its plane", straight, 2, 0.4321),
    Problem("straight beam, twist", twisting, 0.03208),
    ends("curved beam, in its plane", curved, 0, 0.08734),
    ends("curved beam, out of its plane", curved, 2, 0.5022),
    ends("twisted beam, t = 0.32, along the width", twisted_of(0.32), 2, 5.424e-3),
    ends("twisted beam, t = 0.32, across it", twisted_of(0.32), 1, 1.754e-3),
    ends("twisted beam, t = 0.0032, along the width", twisted_of(0.0032), 2, 5256.0),
    ends("twisted beam, t = 0.0032, across it", twisted_of(0.0032), 1, 1294.0),
    *plates("square", 2, (4.062, 11.60, 1.26, 5.60)),
    *plates("long", 10, (12.97, 16.96, 2.56, 7.23)),
    Problem("Scordelis and Lo's roof", roof, 0.3024),
    Problem("hemisphere with a hole", hemisphere, 0.0940),
]
"""On the regular meshes."""
LEANING = [
    ends(f"straight beam of {shape}, {way}", leaning(shape), axis, published)
    for shape in ("trapezoids", "parallelograms")
    for way, axis, published in (("in its plane", 1, 0.1081), ("out of its plane", 2, 0.4321))
]
"""On the distorted ones."""
CYLINDER = [
    Problem(
        f"thick cylinder, Poisson's ratio {nu}",
        lambda kind, nu=nu: cylinder(kind, nu),
        value * 1e-3,
    )
    for nu, value in ((0.49, 5.0399), (0.499, 5.0602), (0.4999, 5.0623))
]
"""Of solids only."""


def problems(kind):
    """Those of a kind of cells."""
    return [*REGULAR, *LEANING, *(CYLINDER if kind not in SHELLS else [])]


@cache
def ratio(problem, kind):
    """Computed over published deflection."""
    return problem.deflection(kind) / problem.published
