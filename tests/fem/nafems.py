"""Free vibration benchmarks of NAFEMS: what is built, and what is published.

Dimensions and reference values are those of "Selected Benchmarks for Natural Frequency Analysis"
(NAFEMS R0015, 1987) as quoted in the verification manual of OptiStruct (OS-V 0400 to 0455,
help.altair.com), for FV3 in that of SOLIDWORKS Simulation (help.solidworks.com), and for FV5 the
issue of 1989 on caesarsystems.co.uk/NAFEMS_benchmarks. For the seventh mode of FV52 the manual
prints 265.81 Hz beside a ratio that belongs to 167.89 Hz.
"""

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.polynomial import legendre
from scipy.linalg import eigh
from structures import CLAMP, STEEL, lowest_hz

import fem


@dataclass(frozen=True)
class Benchmark:
    """One benchmark: its model, how many of its lowest frequencies are rigid, what is published.

    The tolerance is relative to the `reference`.
    """

    name: str
    build: object
    rigid: int
    published: tuple[float, ...]
    note: str
    tolerance: float
    exact: tuple[float, ...] = ()

    @property
    def reference(self):
        """What is computed in another way where that is more exact than what is published."""
        return self.exact or self.published

    @cached_property
    def computed(self):
        """Natural frequencies in Hz without the rigid ones, as many as are published."""
        component = fem.assemble(self.build())
        return lowest_hz(component, self.rigid + len(self.published))[self.rigid :]


def double_cross():
    """FV2: eight arms of 5 m, 0.125 m square, pinned at their ends, in the plane."""
    angles = np.arange(8) * np.pi / 4
    ends = {f"end{i}": (5 * np.cos(a), 5 * np.sin(a)) for i, a in enumerate(angles)}
    mesh = fem.frame_mesh(
        {"middle": (0.0, 0.0), **ends}, [("arms", "middle", end, 8) for end in ends]
    )
    return fem.StructureModel(
        mesh,
        {"arms": fem.BeamPart(STEEL, fem.RectangularSection(0.125, 0.125))},
        supports=[fem.Support(end, ("x", "y")) for end in ends],
        plane=True,
    )


def off_centre_masses():
    """FV4: a clamped bar of 10 m, 0.5 m thick, with 10 t and 1 t at 2 m from its tip."""
    mesh = fem.frame_mesh({"a": (0, 0, 0), "b": (10, 0, 0)}, [("bar", "a", "b", 5)])
    return fem.StructureModel(
        mesh,
        {"bar": fem.BeamPart(STEEL, fem.CircularSection(0.5))},
        supports=[fem.Support("a", CLAMP)],
        point_masses=[
            fem.PointMass("b", 10000.0, offset=(0.0, -2.0, 0.0)),
            fem.PointMass("b", 1000.0, offset=(0.0, 2.0, 0.0)),
        ],
    )


def square_frame():
    """FV3: a free frame of 10 m by 10 m, bars 0.25 m square, in its plane."""
    corners = {"a": (0, 0, 0), "b": (10, 0, 0), "c": (10, 10, 0), "d": (0, 10, 0)}
    bars = [("bars", p, q, 8) for p, q in ("ab", "bc", "cd", "da")]
    section = fem.BeamPart(STEEL, fem.RectangularSection(0.25, 0.25))
    return fem.StructureModel(fem.frame_mesh(corners, bars), {"bars": section}, plane=True)


def deep_beam():
    """FV5: a simply supported beam of 10 m, 2 m square."""
    mesh = fem.frame_mesh({"a": (0, 0, 0), "b": (10, 0, 0)}, [("beam", "a", "b", 20)])
    return fem.StructureModel(
        mesh,
        {"beam": fem.BeamPart(STEEL, fem.RectangularSection(2.0, 2.0), theory="timoshenko")},
        supports=[fem.Support("a", ("x", "y", "z", "rotation_x")), fem.Support("b", ("y", "z"))],
    )


def thin_plate_hz(clamped, count):
    """Frequencies of FV12 or FV16 by Kirchhoff's theory, without the rigid ones.

    By Ritz's method with 18 by 18 Legendre polynomials; those of 16 by 16 agree to 2e-5.
    """
    places, weights = legendre.leggauss(24)
    x, weights = (places + 1.0) / 2.0, weights / 2.0
    terms = [legendre.Legendre.basis(i, domain=[0.0, 1.0]) for i in range(18)]
    edge = legendre.Legendre([0.5, 0.5], domain=[0.0, 1.0])  # the coordinate x itself
    X, Y = (
        np.array([[(p * factor).deriv(d)(x) for d in range(3)] for p in terms])
        for factor in (edge**2 if clamped else 1.0, 1.0)
    )

    def energy(a, b, c, d):
        """Of the derivatives a and b along x, c and d along y."""
        return np.kron((X[:, a] * weights) @ X[:, b].T, (Y[:, c] * weights) @ Y[:, d].T)

    E, nu, rho = STEEL.youngs_modulus, STEEL.poissons_ratio, STEEL.density
    bent = energy(2, 2, 0, 0) + energy(0, 0, 2, 2) + 2.0 * (1.0 - nu) * energy(1, 1, 1, 1)
    bent += nu * (energy(2, 0, 0, 2) + energy(0, 2, 2, 0))
    rigid = 0 if clamped else 3
    last = rigid + count - 1
    squares = eigh(bent, energy(0, 0, 0, 0), eigvals_only=True, subset_by_index=[rigid, last])
    speed = 0.05 * np.sqrt(E / (12.0 * rho * (1.0 - nu**2)))
    return tuple(np.sqrt(squares) * speed / (2.0 * np.pi * 10.0**2))


def plate():
    return fem.box_mesh("plate", (10.0, 10.0, 0.05), (16, 16, 1))


def middle_plane(mesh):
    """Nodes in the middle of the thickness."""
    return np.flatnonzero(np.abs(mesh.points[:, 2] - 0.025) < 1e-9)


def free_plate():
    """FV12: a free plate, 10 m square and 0.05 m thick, that moves out of its plane only."""
    mesh = plate()
    mesh = mesh.with_point_sets({"middle": middle_plane(mesh)})
    return fem.StructureModel(
        mesh, {"plate": fem.SolidPart(STEEL)}, supports=[fem.Support("middle", ("x", "y"))]
    )


def cantilevered_plate():
    """FV16: the same plate, clamped at one edge."""
    return fem.StructureModel(
        plate(), {"plate": fem.SolidPart(STEEL)}, supports=[fem.Support("x0", ("x", "y", "z"))]
    )


def rhombic_plate(thickness, counts):
    """FV15 and FV22: a clamped plate with sides of 10 m at 45 degrees, out of its plane only."""
    mesh = fem.box_mesh("plate", (10.0, 10.0, thickness), counts)
    x, y, z = mesh.points.T
    mesh = mesh.with_points(np.column_stack([x + y / np.sqrt(2.0), y / np.sqrt(2.0), z]))
    middle = np.flatnonzero(np.isclose(z, thickness / 2.0))
    edges = [fem.Support(side, ("x", "y", "z")) for side in ("x0", "x1", "y0", "y1")]
    return fem.StructureModel(
        mesh.with_point_sets({"middle": middle}),
        {"plate": fem.SolidPart(STEEL)},
        supports=[fem.Support("middle", ("x", "y")), *edges],
    )


def tapered_membrane():
    """FV32: a sheet of 10 m, 5 m wide at the clamp and 1 m at the tip, 0.05 m thick."""
    mesh = fem.box_mesh("sheet", (10.0, 1.0), (16, 8))
    points = mesh.points.copy()
    points[:, 1] = (points[:, 1] - 0.5) * (5.0 - 0.4 * points[:, 0])
    return fem.StructureModel(
        mesh.with_points(points),
        {"sheet": fem.SolidPart(STEEL, "stress", 0.05)},
        supports=[fem.Support("x0", ("x", "y"))],
    )


def solid_plate():
    """FV52: a block 10 m square and 1 m thick, its lower edges held in z."""
    mesh = fem.box_mesh("plate", (10.0, 10.0, 1.0), (4, 4, 1))
    x, y, z = mesh.points.T
    edge = (z < 1e-9) & (np.isclose(x % 10.0, 0.0) | np.isclose(y % 10.0, 0.0))
    mesh = mesh.with_point_sets({"edges": np.flatnonzero(edge)})
    return fem.StructureModel(
        mesh,
        {"plate": fem.SolidPart(STEEL, integration="full")},
        supports=[fem.Support("edges", "z")],
    )


def shell_plate(thickness, held, skew=False, kind="quad", n=16):
    """FV12, FV15, FV16 and FV22 as shells: the middle plane, 10 m by 10 m."""
    mesh = fem.box_mesh("plate", (10.0, 10.0), (n, n), kind=kind)
    x, y, z = mesh.points.T
    if skew:
        mesh = mesh.with_points(np.column_stack([x + y / np.sqrt(2.0), y / np.sqrt(2.0), z]))
    supports = [fem.Support("plate", ("x", "y", "rotation_z"))]
    supports += [fem.Support(side, CLAMP) for side in held]
    return fem.StructureModel(mesh, {"plate": fem.ShellPart(STEEL, thickness)}, supports=supports)


SIDES = ("x0", "x1", "y0", "y1")
BENCHMARKS = [
    Benchmark(
        "FV2 pin-ended double cross", double_cross, 0,
        (11.336, *[17.709] * 7, 45.345, *[57.390] * 7), "plane frame, 8 elements per arm", 0.006,
    ),
    Benchmark(
        "FV3 free square frame", square_frame, 3,
        (3.261, 5.668, 11.136, 11.136, 12.849, 24.570, 28.695, 28.695),
        "plane frame, 8 elements per bar", 0.003,
    ),
    Benchmark(
        "FV4 cantilever, masses off centre", off_centre_masses, 0,
        (1.723, 1.727, 7.413, 9.972, 18.155, 26.957), "5 beams in space, masses with offset", 0.002,
    ),
    Benchmark(
        "FV5 deep simply supported beam", deep_beam, 0,
        (42.650, 42.650, 71.20, 125.00, 148.15, 148.15, 213.61, 283.47, 283.47),
        "20 Timoshenko beams", 0.004,
    ),
    Benchmark(
        "FV12 free thin square plate", free_plate, 3,
        (1.622, 2.360, 2.922, 4.233, 4.233, 7.416), "16 x 16 x 1 hexahedron20", 0.001,
        thin_plate_hz(False, 6),
    ),
    Benchmark(
        "FV15 clamped thin rhombic plate", partial(rhombic_plate, 0.05, (32, 32, 1)), 0,
        (7.938, 12.835, 17.941, 19.133, 24.009, 27.922), "32 x 32 x 1 hexahedron20", 0.008,
    ),
    Benchmark(
        "FV16 cantilevered thin square plate", cantilevered_plate, 0,
        (0.421, 1.029, 2.582, 3.306, 3.753, 6.555), "16 x 16 x 1 hexahedron20", 0.008,
        thin_plate_hz(True, 6),
    ),
    Benchmark(
        "FV22 clamped thick rhombic plate", partial(rhombic_plate, 1.0, (16, 16, 2)), 0,
        (133.95, 201.41, 265.81, 283.68, 334.45, 386.62), "16 x 16 x 2 hexahedron20", 0.028,
    ),
    Benchmark(
        "FV12 free thin square plate", partial(shell_plate, 0.05, ()), 3,
        (1.622, 2.360, 2.922, 4.233, 4.233, 7.416), "shell, 16 x 16 quad", 0.015,
    ),
    Benchmark(
        "FV15 clamped thin rhombic plate", partial(shell_plate, 0.05, SIDES, skew=True, n=32), 0,
        (7.938, 12.835, 17.941, 19.133, 24.009, 27.922), "shell, 32 x 32 quad", 0.011,
    ),
    Benchmark(
        "FV16 cantilevered thin square plate",
        partial(shell_plate, 0.05, ("x0",), kind="triangle"), 0,
        (0.421, 1.029, 2.582, 3.306, 3.753, 6.555), "shell, 16 x 16 x 2 triangle", 0.0125,
    ),
    Benchmark(
        "FV22 clamped thick rhombic plate", partial(shell_plate, 1.0, SIDES, skew=True, n=32), 0,
        (133.95, 201.41, 265.81, 283.68, 334.45, 386.62), "shell, 32 x 32 quad", 0.022,
    ),
    Benchmark(
        "FV32 cantilevered tapered membrane", tapered_membrane, 0,
        (44.623, 130.03, 162.70, 246.05, 379.90, 391.44), "16 x 8 quad8, plane stress", 0.0002,
    ),
    Benchmark(
        "FV52 simply supported solid square plate", solid_plate, 3,
        (45.897, 109.44, 109.44, 167.89, 193.59, 206.19, 206.19),
        "4 x 4 x 1 hexahedron20 in full",
        0.025,
    ),
]  # fmt: skip
