"""Finite elements and units: thin parts, slender cells, numbers far from one."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import eigsh, spsolve

import cms
import fem
from hard.case import Case, Measured
from hard.multiprecision import DIGITS, mp
from nldyn.base.resources import example
from nldyn.base.resources import mesh as mesh_file
from nldyn.branches.branch import Branch
from nldyn.branches.continuation import continue_branch
from nldyn.orbits.solve import solve_orbit
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene
from nldyn.system.loads import Unbalance
from nldyn.system.stop import Stop
from nldyn.system.system import System

SUBJECT = "finite elements and units"
STEEL = fem.Material(2.1e11, 7800.0, 0.0)  # without lateral contraction beam theory is exact
CELLS = 50
SCALED = 1e-10
ASKED = "asked for: a scaled scene gives the scaled answer"
ROUNDING = "of what the rounding of the stiffness matrix costs: 2^-53 times its condition"
ROOT = "of what the root of the condition leaves of double precision"


def cantilever(thickness: float, cells: int = CELLS) -> fem.Component:
    """A strip of 1 m by 50 mm in one layer of second-order cells, clamped at one end."""
    mesh = fem.box_mesh("strip", (1.0, 0.05, thickness), (cells, 1, 1))
    model = fem.StructureModel(
        mesh,
        parts={"strip": fem.SolidPart(STEEL)},
        supports=[fem.Support("x0", ("x", "y", "z"))],
        couplings=[fem.Coupling("tip", "x1", at=(1.0, 0.025, 0.5 * thickness))],
        interfaces={"turn": fem.Interface("tip", "rotation_y")},
    )
    return fem.assemble(model)


def flexibility_error(component: fem.Component, name: str, exact: float) -> Measured:
    """Error of a flexibility, in roundings 2^-53 of the stiffness matrix times its condition."""
    load, K = component.interfaces[name], component.stiffness.tocsc()
    off = abs(float(load @ spsolve(K, load)) / exact - 1.0)
    cost = condition(component)
    return Measured(off / (2.0**-53 * cost), f"relative error {off:.1e}, condition {cost:.0e}")


def condition(component: fem.Component) -> float:
    """Largest over smallest eigenvalue of the stiffness matrix."""
    K = component.stiffness.tocsc()
    largest, smallest = (
        float(eigsh(K, 1, return_eigenvectors=False, **which)[0])
        for which in ({"which": "LM"}, {"sigma": 0.0})
    )
    return largest / smallest


def bending_error(thickness: float) -> Measured:
    """Rotation of the tip under a moment, L/EI."""
    exact = 12.0 / (STEEL.youngs_modulus * 0.05 * thickness**3)
    return flexibility_error(cantilever(thickness), "turn", exact)


def reduced_bending_error(thickness: float) -> Measured:
    """Rotation of the tip under a moment by a reduced model, in 2^-53 times root of condition."""
    exact = 12.0 / (STEEL.youngs_modulus * 0.05 * thickness**3)
    component = cantilever(thickness)
    off = abs(cms.reduce(component, modes=2).static_flexibility("turn") / exact - 1.0)
    root = math.sqrt(condition(component))
    return Measured(off / (2.0**-53 * root), f"relative error {off:.1e}, root {root:.0e}")


def fine_beam_error(count: int) -> Measured:
    """Three frequencies of a beam on two pins, cut into many elements, against its exact matrices.

    Node j moves by sin(kπj/n) and turns by cos(kπj/n) times numbers that solve K x = λ M x with
    matrices of two rows.
    """
    mesh = fem.frame_mesh({"a": (0.0, 0.0), "b": (2.0, 0.0)}, [("beam", "a", "b", count)])
    section = fem.RectangularSection(0.1, 0.05)
    model = fem.StructureModel(
        mesh,
        parts={"beam": fem.BeamPart(STEEL, section)},
        supports=[fem.Support("a", ("x", "y")), fem.Support("b", ("x", "y"))],
        interfaces={"end": fem.Interface("a", "rotation")},
        plane=True,
    )
    found = cms.reduce(fem.assemble(model), modes=3).frequencies_hz[:3]
    mass, bending = STEEL.density * section.area, STEEL.youngs_modulus * section.second_moment
    scale = math.sqrt(bending / mass) * (count / 2.0) ** 2 / (2.0 * math.pi)
    exact = [scale * math.sqrt(lowest_square(count, number)) for number in (1, 2, 3)]
    return Measured(float(np.abs(found / exact - 1.0).max()))


def lowest_square(count: int, number: int) -> float:
    """The lower λ of wave ``number`` with elements of length, EI and ρA of one, in 34 digits."""
    with mp.workdps(DIGITS.digits):
        angle = mp.pi * number / count
        c, s = mp.cos(angle), mp.sin(angle)
        K = mp.matrix([[24 - 24 * c, -12 * s], [-12 * s, 8 + 4 * c]])
        M = mp.matrix([[312 + 108 * c, 26 * s], [26 * s, 8 - 6 * c]]) / 420
        half = (K[0, 0] * M[1, 1] + K[1, 1] * M[0, 0]) / 2 - K[0, 1] * M[0, 1]
        root = mp.sqrt(half**2 - mp.det(K) * mp.det(M))
        return float(mp.det(K) / (half + root))


def frequency_error(thickness: float) -> Measured:
    """Lowest frequency, 1.8751² √(EI/ρA)/L²."""
    found = float(cms.reduce(cantilever(thickness), modes=1).frequencies_hz[0])
    speed = math.sqrt(STEEL.youngs_modulus * thickness**2 / (12.0 * STEEL.density))
    exact = 1.8751040687119611**2 * speed / (2.0 * math.pi)
    return Measured(abs(found / exact - 1.0), f"{exact:.6f} Hz")


def slender_error(aspect: float) -> Measured:
    """Elongation of a bar of ten cells of 1 m under a force, L/EA."""
    side = 1.0 / aspect
    mesh = fem.box_mesh("bar", (10.0, side, side), (10, 1, 1))
    model = fem.StructureModel(
        mesh,
        parts={"bar": fem.SolidPart(STEEL)},
        supports=[fem.Support("x0", ("x", "y", "z"))],
        couplings=[fem.Coupling("tip", "x1", at=(10.0, 0.5 * side, 0.5 * side))],
        interfaces={"pull": fem.Interface("tip", "x")},
    )
    component = fem.assemble(model)
    load = component.interfaces["pull"]
    found = float(load @ spsolve(component.stiffness.tocsc(), load))
    exact = 10.0 / (STEEL.youngs_modulus * side**2)
    return Measured(abs(found / exact - 1.0))


# N, mm, t, s in place of N, m, kg, s
MILLIMETRES = {
    "youngs_modulus": 1e-6,
    "density": 1e-12,
    "width": 1e3,
    "height": 1e3,
    "mass": 1e-3,
    "coefficient": 1e-3,
    "stiffness": 1e3**-1.5,
    "gap": 1e3,
    "mass_times_radius": 1.0,
}


def in_millimetres(folder: Path) -> Path:
    """Write the scene of the 4-DOF model, and its mesh, in mm, t and s."""
    lines = []
    for line in example("four_dof_xi_0.01.toml").read_text("utf-8").splitlines():
        key, equals, rest = line.partition("=")
        name = key.strip()
        if equals and name in MILLIMETRES:
            number = float(rest.partition("#")[0])
            lines.append(f"{name} = {number * MILLIMETRES[name]!r}")
        elif name == "file":
            lines.append('file = "half_beam.vtu"')
        elif name != "mirror":
            lines.append(line)
    mesh = fem.read_mesh(mesh_file("half_beam.msh"))
    fem.write_mesh(mesh.with_points(1e3 * mesh.points), folder / "half_beam.vtu")
    scene = folder / "scene.toml"
    scene.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return scene


@cache
def scene_branch(millimetres: bool) -> tuple[System, Branch]:
    """System and harmonic branch of the 4-DOF model, 25 to 40 Hz, in either units."""
    with tempfile.TemporaryDirectory() as folder:
        file = in_millimetres(Path(folder)) if millimetres else example("four_dof_xi_0.01.toml")
        scene = load_scene(file)
        system = build_system(scene)
    return system, continue_branch(solve_orbit(system, 35.0), (25.0, 40.0))


def scaled_frequencies_error() -> Measured:
    """Modal frequencies in mm, t, s against those in SI."""
    found, exact = (scene_branch(millimetres)[0].frequencies_hz for millimetres in (True, False))
    return Measured(float(np.abs(found / exact - 1.0).max()))


def scaled_branch_error() -> Measured:
    """Special points in mm, t, s against those in SI: kinds, frequencies, amplitudes."""
    found, exact = (points_of(scene_branch(mm)[1]) for mm in (True, False))
    return compared(found, [(kind, hz, 1e3 * height) for kind, hz, height in exact])


SpecialRow = tuple[str, float, float]


def points_of(branch: Branch) -> list[SpecialRow]:
    """Kind, frequency in Hz and largest displacement of the special points, in order."""
    return [(s.kind, s.frequency_hz, s.orbit.max_abs_displacement) for s in branch.special_points]


def compared(found: Sequence[SpecialRow], exact: Sequence[SpecialRow]) -> Measured:
    """Largest relative difference of a frequency; infinite where the kinds differ.

    Amplitudes count a hundredth: at a fold they change with the root of the frequency.
    """
    if [row[0] for row in found] != [row[0] for row in exact]:
        return Measured(math.inf, f"{len(found)} special points in place of {len(exact)}")
    hz = max(abs(a[1] / b[1] - 1.0) for a, b in zip(found, exact, strict=True))
    height = max(abs(a[2] / b[2] - 1.0) for a, b in zip(found, exact, strict=True))
    note = f"{len(found)} special points, frequencies {hz:.1e}, amplitudes {height:.1e}"
    return Measured(max(hz, 0.01 * height), note)


def one_dof(mass: float = 1.0, length: float = 1.0, time: float = 1.0) -> System:
    """The 1-DOF model of the paper in other units: kg, m and s times these numbers."""
    rate = mass / time**2
    return System.from_matrices(
        [[2.48 * mass]],
        [[16877.0 * rate]],
        {"middle": [1.0]},
        modal_damping=0.0142,
        stops=[Stop("middle", 5.17e9 * rate / math.sqrt(length))],
        excitation=[Unbalance("middle", 4.92e-6 * mass * length)],
    )


def branch_in(mass: float, length: float, time: float) -> Branch:
    """The harmonic branch from 11 to 36 Hz in these units."""
    system = one_dof(mass, length, time)
    return continue_branch(solve_orbit(system, 26.0 / time), (11.0 / time, 36.0 / time))


def units_error(mass: float, length: float, time: float) -> Measured:
    """Special points in other units against those in SI."""
    exact = points_of(branch_in(1.0, 1.0, 1.0))
    found = points_of(branch_in(mass, length, time))
    return compared(found, [(kind, hz / time, height * length) for kind, hz, height in exact])


CASES = (
    *(
        Case(
            SUBJECT,
            f"cantilever with thickness {thickness:g} of its length, moment",
            f"cells of 20 by {1e3 * thickness:g} mm in one layer: locking",
            "closed form L/EI",
            1.0,
            ROUNDING,
            partial(bending_error, thickness),
        )
        for thickness in (1e-2, 1e-3)
    ),
    Case(
        SUBJECT,
        "cantilever with thickness 0.001 of its length, moment, reduced model",
        "the stiffness matrix, with a condition of 5e13, has lost nearly all digits of it",
        "closed form L/EI",
        1.0,
        ROOT,
        partial(reduced_bending_error, 1e-3),
    ),
    Case(
        SUBJECT,
        "beam of 1000 elements, three frequencies",
        "condition of 1e13: the exact eigenvalues of the rounded matrix are off by 1e-6",
        "closed form of the assembled beam, in 34 digits",
        SCALED,
        "what units are asked to keep",
        partial(fine_beam_error, 1000),
    ),
    Case(
        SUBJECT,
        "cantilever with thickness 1e-3 of its length, frequency",
        f"{CELLS} cells of 20 by 1 mm in one layer: locking",
        "closed form 1.8751² √(EI/ρA)/L²",
        0.25 / CELLS**2,
        "1/(4n²): curvature that is constant in each of n cells",
        partial(frequency_error, 1e-3),
    ),
    *(
        Case(
            SUBJECT,
            f"bar of cells with aspect ratio {aspect:g}",
            "stiffness along and across differ by its square",
            "closed form L/EA",
            4.0 * 100.0 * aspect**2 * 2.0**-52,
            "estimate: rounding of sums over 8 points in each of 2 cells, √16, times the squares "
            "of aspect ratio and number of cells",
            partial(slender_error, aspect),
        )
        for aspect in (1e3, 1e4)
    ),
    Case(
        SUBJECT,
        "scene in mm, t and s, modal frequencies",
        "numbers from 1e-9 to 1e5",
        "the same scene in SI",
        SCALED,
        ASKED,
        scaled_frequencies_error,
    ),
    Case(
        SUBJECT,
        "scene in mm, t and s, special points from 25 to 40 Hz",
        "numbers from 1e-9 to 1e5",
        "the same scene in SI",
        SCALED,
        ASKED,
        scaled_branch_error,
    ),
    *(
        Case(
            SUBJECT,
            f"units of {mass:g} kg, {length:g} m, {time:g} s: special points from 11 to 36 Hz",
            "parameters of 1e-12 and 1e12",
            "the same model in SI",
            SCALED,
            ASKED,
            partial(units_error, mass, length, time),
        )
        for mass, length, time in (
            (1e-12, 1.0, 1.0),
            (1e12, 1.0, 1.0),
            (1.0, 1e-12, 1.0),
            (1.0, 1e12, 1.0),
            (1.0, 1.0, 1e-6),
            (1.0, 1.0, 1e12),
            (1e12, 1e-12, 1e-6),
        )
    ),
)
