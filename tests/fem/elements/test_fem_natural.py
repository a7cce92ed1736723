"""The natural factor: the same stiffness, without the cost of rigid motion."""

import numpy as np
import pytest

import fem

STEEL = fem.Material(2e11, 7800.0, 0.3)
ENDS = {"a": (0.0, 0.0, 0.0), "b": (2.0, 1.0, 0.0), "c": (3.0, 0.0, 0.0)}
LINES = [("p", "a", "b", 3), ("q", "b", "c", 4)]


def frame(theory="euler-bernoulli", axial_force=0.0, **attached):
    section = fem.RectangularSection(0.1, 0.05)
    part = fem.BeamPart(STEEL, section, theory=theory, axial_force=axial_force)
    return fem.StructureModel(
        fem.frame_mesh(ENDS, LINES),
        parts={"p": part, "q": part},
        supports=[fem.Support("a", ("x", "y", "rotation"))],
        springs=[fem.PointSpring("b", "y", 1e6)],
        **attached,
        plane=True,
    )


def beams(theory, axial_force=0.0, offset=(0.0, 0.0)):
    section = fem.RectangularSection(0.1, 0.05)
    ends = {**ENDS, "c": (3.0, 0.0, 1.0)}
    part = fem.BeamPart(
        STEEL, section, theory=theory, axial_force=axial_force, offset=offset,
        orientation=(0.0, 1.0, 0.3),
    )  # fmt: skip
    return fem.StructureModel(
        fem.frame_mesh(ends, LINES),
        parts={"p": part, "q": part},
        supports=[fem.Support("a", ("x", "y", "z"))],
        springs=[fem.PointSpring("b", "rotation_y", 1e4)],
        hinges=[fem.Hinge("b", "p")],
    )


def block(kind, lengths=(1.0, 0.05, 0.02), poisson=0.3, thickness=None, plane=None):
    mesh = fem.box_mesh("s", lengths, (4, 2, 1)[: len(lengths)], kind=kind)
    part = fem.SolidPart(fem.Material(2e11, 7800.0, poisson), thickness=thickness, plane=plane)
    turned = len(lengths) == 3
    return fem.StructureModel(
        mesh,
        parts={"s": part},
        supports=[fem.Support("x0", ("x", "y", "z")[: len(lengths)])],
        couplings=[fem.Coupling("tip", "x1", at=(1.0, 0.02, 0.01))] if turned else (),
        foundations=[fem.Foundation("y0", (0.0, 1e8, 0.0))],
    )


def trusses():
    part = fem.TrussPart(STEEL, 1e-4)
    held = [fem.Support("a", ("x", "y")), fem.Support("c", "y")]
    return fem.StructureModel(
        fem.frame_mesh({"a": (0, 0), "b": (1, 2), "c": (2, 0.5)}, [("p", "a", "b", 1),
                       ("p", "b", "c", 1), ("p", "a", "c", 1)]),
        parts={"p": part}, supports=held,
        plane=True,
    )  # fmt: skip


def curved_truss():
    points = [[0, 0, 0], [1, 0, 0.2], [0.45, 0.2, 0.1]]
    mesh = fem.StructureMesh(points, {"line3": [[0, 1, 2]]}, {"p": {"line3": [0]}}, {"a": [0]})
    held = [fem.Support("a", ("x", "y", "z")), fem.Support("p", "z")]
    return fem.StructureModel(mesh, {"p": fem.TrussPart(STEEL, 1e-4)}, supports=held)


def shell(kind, offset=0.0):
    mesh = fem.box_mesh("s", (1.0, 0.5), (4, 3), kind=kind)
    x, y, _ = mesh.points.T
    points = np.column_stack([x, y, 0.2 * x**2 - 0.3 * x * y])
    return fem.StructureModel(
        mesh.with_points(points),
        parts={"s": fem.ShellPart(STEEL, 1e-3, offset)},
        supports=[fem.Support("x0", ("x", "y", "z"))],
    )


MODELS = {
    "frame": frame(),
    "Timoshenko's frame": frame("timoshenko"),
    "frame under tension": frame("timoshenko", 1e6),
    "frame under compression": frame("timoshenko", -1e6),
    "frame with a hinge": frame(hinges=[fem.Hinge("b", "p")]),
    "beams": beams("euler-bernoulli"),
    "Timoshenko's beams under tension": beams("timoshenko", 1e6),
    "beams with an offset": beams("timoshenko", offset=(0.02, 0.03)),
    "hexahedra": block("hexahedron"),
    "hexahedra, 20 nodes": block("hexahedron20"),
    "wedges, 15 nodes": block("wedge15"),
    "pyramids, 13 nodes": block("pyramid13"),
    "tetrahedra, 10 nodes, negative Poisson's ratio": block("tetra10", poisson=-0.3),
    "shell of quadrilaterals": shell("quad"),
    "trusses": trusses(),
    "curved truss of three nodes": curved_truss(),
    "shell of triangles with an offset": shell("triangle", 0.01),
    "quadrilaterals in plane stress": block("quad8", (1.0, 0.05), thickness=0.01, plane="stress"),
}


@pytest.mark.parametrize("name", MODELS)
def test_factor_times_itself_is_the_stiffness(name):
    component = fem.assemble(MODELS[name])
    form, K = component.natural_form, component.stiffness.toarray()
    A, d = form.deformations, form.stiffness
    found = A.T @ (d[:, None] * (A @ np.eye(len(K))))
    scale = np.sqrt(np.outer(np.diag(K), np.diag(K)))
    assert (np.abs(found - K) / scale).max() < 1e-12
