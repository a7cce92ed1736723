"""Shells against closed forms: patches, rigid bodies, plates, a cylinder, a leaf, folds."""

import numpy as np
import pytest
from shells import deflection, mapped, nearest, shell
from structures import CLAMP, STEEL, cantilever, flexibility, lowest_hz

import cms
import fem
from fem.elements.shells import corner_normals
from fem.mesh.shell_centres import with_centres
from fem.mesh.shell_facets import shell_kinds
from fem.render.colouring import surface_values
from fem.render.structure_surface import structure_surface

KINDS = sorted(shell_kinds())
E, NU, RHO = 2.0e11, 0.3, 8000.0


def distorted(kind, seed=0):
    """A patch of 1 m by 1 m whose inner nodes are moved at random, flat."""
    mesh = fem.box_mesh("shell", (1.0, 1.0), (3, 3), kind=kind)
    points = mesh.points.copy()
    inner = ((points[:, :2] > 1e-9) & (points[:, :2] < 1 - 1e-9)).all(axis=1)
    amount = 0.08 if kind in ("quad", "triangle") else 0.02
    points[inner, :2] += amount * np.random.default_rng(seed).uniform(-1, 1, (inner.sum(), 2))
    filled = with_centres(mesh.with_points(points), ["shell"])
    return filled, np.append(inner, np.ones(len(filled.points) - len(inner), dtype=bool))


def turned(points):
    """The points and the rotation by which they were put into no plane of the axes."""
    turn, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    return points @ turn.T, turn


STATES = {
    "stretch": lambda x, y: (1e-3 * x, -2e-3 * y, 0, 0, 0, 0),
    "shear": lambda x, y: (2e-3 * y, 1e-3 * x, 0, 0, 0, -0.5e-3),
    "bending": lambda x, y: (0, 0, x**2 / 2, 0, -x, 0),
    "twist": lambda x, y: (0, 0, x * y, x, -y, 0),
}


@pytest.mark.parametrize("state", STATES)
@pytest.mark.parametrize("kind", KINDS)
def test_constant_strains_and_curvatures_are_exact_on_distorted_cells(kind, state):
    flat, inner = distorted(kind)
    points, turn = turned(flat.points)
    component = shell(flat.with_points(points), E, NU, 0.01, ())
    local = np.array([STATES[state](x, y) for x, y, _ in flat.points])
    given = np.hstack([local[:, :3] @ turn.T, local[:, 3:] @ turn.T])
    dofs = component.numbering.dofs(np.arange(len(points)))
    u = np.zeros(len(component.free))
    u[dofs] = given
    force = component.stiffness @ u
    scale = np.abs(component.stiffness) @ np.abs(u)
    assert np.abs(force[dofs[inner]] / scale[dofs[inner]]).max() < 1e-12
    energy = {"stretch": None, "shear": None, "bending": 1.0, "twist": 2 * (1 - NU)}[state]
    if energy is not None:
        assert u @ force == pytest.approx(energy * E * 0.01**3 / (12 * (1 - NU**2)), rel=1e-8)


def saddle(kind, counts=(4, 3)):
    return mapped(kind, counts, lambda a, b: (a, 0.8 * b, 0.3 * a * b - 0.2 * a**2))[0]


def rigid_motions(component):
    points = component.model.mesh.points
    dofs = component.numbering.dofs(np.arange(len(points)))
    R = np.zeros((len(component.free), 6))
    for axis in range(3):
        R[dofs[:, axis], axis] = R[dofs[:, 3 + axis], 3 + axis] = 1.0
        R[dofs[:, :3], 3 + axis] = np.cross(np.eye(3)[axis], points)
    return R


@pytest.mark.parametrize("offset", [0.0, 0.02])
@pytest.mark.parametrize("kind", KINDS)
def test_a_warped_shell_has_six_rigid_motions_and_no_more(kind, offset):
    component = shell(saddle(kind), E, NU, 0.01, (), offset=offset)
    K = component.stiffness.toarray()
    R = rigid_motions(component)
    assert np.abs(K @ R).max() < 1e-12 * np.abs(K).max()
    scale = 1.0 / np.sqrt(component.mass.diagonal())
    squares = np.linalg.eigvalsh(K * np.outer(scale, scale))
    assert np.abs(squares[:6]).max() < 1e-8 * squares[6]


@pytest.mark.parametrize("kind", KINDS)
def test_a_plate_has_the_inertia_of_a_block(kind):
    mesh = fem.box_mesh("shell", (0.6, 0.4), (3, 2), kind=kind, origin=(-0.3, -0.2))
    component = shell(mesh, E, NU, 0.1, ())
    R = rigid_motions(component)
    mass = 0.6 * 0.4 * 0.1
    about = mass / 12 * np.array([0.4**2 + 0.1**2, 0.6**2 + 0.1**2, 0.6**2 + 0.4**2])
    np.testing.assert_allclose(R.T @ component.mass @ R, np.diag([*[mass] * 3, *about]), atol=1e-14)


def test_the_mass_is_positive_definite():
    for kind in KINDS:
        mass = shell(saddle(kind), E, NU, 0.01, ()).mass.toarray()
        scale = 1.0 / np.sqrt(mass.diagonal())
        assert np.linalg.eigvalsh(mass * np.outer(scale, scale))[0] > 1e-3


def plate(kind, n, thickness, held):
    mesh = fem.box_mesh("plate", (1.0, 1.0), (n, n), kind=kind)
    supports = [fem.Support(side, directions) for side, directions in held.items()]
    return fem.assemble(
        fem.StructureModel(mesh, {"plate": fem.ShellPart(STEEL, thickness)}, supports=supports)
    )


SIMPLE = dict.fromkeys(("x0", "x1", "y0", "y1"), ("x", "y", "z"))
PLATES = {
    "simply supported": (SIMPLE, np.pi**2 * np.array([2.0, 5.0, 5.0, 8.0])),
    "clamped": (dict.fromkeys(SIMPLE, CLAMP), np.array([35.985, 73.394, 73.394, 108.22])),
    "cantilever": ({"x0": CLAMP}, np.array([3.4710, 8.5065, 21.2844, 27.1990])),
}
"""Omega L² sqrt(rho t / D): closed form for the first; Leissa, Vibration of Plates (NASA SP-160,
1969), and Barton's and Young's beam functions improved by Leissa, J. Sound Vib. 31 (1973) 257."""


@pytest.mark.parametrize("case", PLATES)
@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_thin_plates_have_published_frequencies(kind, case):
    held, numbers = PLATES[case]
    t = 1e-3
    wanted = numbers * np.sqrt(E * t**2 / (12 * (1 - NU**2) * RHO)) / (2 * np.pi)
    errors = [lowest_hz(plate(kind, n, t, held), 4) / wanted - 1 for n in (8, 16)]
    # errors of second order, so that two meshes tell the limit
    limit = errors[1] + (errors[1] - errors[0]) / 3
    assert (np.abs(errors[1]) < 0.057).all() and np.abs(errors[1][0]) < 0.019
    assert np.abs(limit).max() < 0.013


@pytest.mark.parametrize("kind", KINDS)
def test_thinner_strips_do_not_lock(kind):
    """A clamped strip 1 m long, its sides held against turning about it, bends as a cylinder."""
    for t in (1e-1, 1e-2, 1e-3, 1e-4):
        n = 8 if kind in ("quad", "triangle") else 4
        mesh = fem.box_mesh("shell", (1.0, 0.25), (n, 2), kind=kind)
        held = [fem.Support("x0", CLAMP), fem.symmetry("y0", "y"), fem.symmetry("y1", "y")]
        component = shell(mesh, E, NU, t, held)
        tip = nearest(mesh.points[:, :2], (1.0, 0.125))
        load = [(node, 2, 1.0) for node in mesh.nodes("x1")]
        moved = deflection(component, load, (tip, 2)) / len(load)
        G = E / (2 * (1 + NU))
        wanted = 1 / (3 * E * 0.25 * t**3 / (12 * (1 - NU**2))) + 1 / (5 / 6 * G * 0.25 * t)
        assert moved == pytest.approx(wanted, rel=0.02 if n == 8 else 0.05)


def free_cylinder(kind, counts):
    mesh, _ = mapped(
        kind, counts, lambda a, b: (np.cos(2 * np.pi * a), np.sin(2 * np.pi * a), 2.0 * b)
    )
    return shell(fem.joined([mesh]), E / RHO, NU, 0.01, ())


@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_a_free_cylinder_has_the_inextensional_modes_of_rayleigh_and_love(kind):
    """J. W. S. Rayleigh, The Theory of Sound, articles 233 and 235c; as in Leissa, NASA SP-288."""
    found = lowest_hz(free_cylinder(kind, (64, 16)), 12)
    wanted = []
    for n in (2, 3):
        ring = E * 0.01**2 / (12 * (1 - NU**2) * RHO) * n**2 * (n**2 - 1) ** 2 / (n**2 + 1)
        length = 1 + 24 * (1 - NU) / (n**2 * 4)
        wanted += [ring, ring * length / (1 + 12 / (n**2 * (n**2 + 1) * 4))]
    wanted = np.sort(np.sqrt(wanted)) / (2 * np.pi)
    assert found[:6].max() < 1e-3 * wanted[0]
    np.testing.assert_allclose(found[6:].reshape(3, 2).mean(axis=1), wanted[:3], rtol=0.008)


def test_the_leaf_without_lateral_contraction_is_a_beam():
    """Length 0.113 m, width 0.075 m, thickness 1 mm, as the leaf spring of the paper."""
    beam = 4.730040744862704**2 / (2 * np.pi * 0.113**2) * np.sqrt(2.1e11 * 1e-6 / 12 / 7713)
    found = {}
    for nu in (0.0, 0.3):
        part = fem.ShellPart(fem.Material(2.1e11, 7713.0, nu), 1e-3)
        for n in (12, 24):
            mesh = fem.box_mesh("leaf", (0.113, 0.075), (n, 8), kind="quad")
            held = [fem.Support(end, CLAMP) for end in ("x0", "x1")]
            component = fem.assemble(fem.StructureModel(mesh, {"leaf": part}, supports=held))
            found[nu, n] = lowest_hz(component, 1)[0] / beam
    limits = {nu: found[nu, 24] + (found[nu, 24] - found[nu, 12]) / 3 for nu in (0.0, 0.3)}
    assert limits[0.0] == pytest.approx(1.0, abs=1e-3)
    # a plate that is wide against its length is stiffer by up to 1/(1 - nu²)
    assert 1.03 < limits[0.3] / limits[0.0] < 1.0483


def test_an_offset_of_the_whole_plate_changes_nothing_that_is_free():
    frequencies = []
    for offset in (0.0, 0.05):
        part = fem.ShellPart(STEEL, 0.02, offset=offset)
        mesh = fem.box_mesh("p", (1.0, 0.7), (5, 4), kind="quad")
        frequencies.append(lowest_hz(fem.assemble(fem.StructureModel(mesh, {"p": part})), 10)[6:])
    np.testing.assert_allclose(frequencies[1], frequencies[0], rtol=1e-7)


def test_a_stiffener_with_an_offset_makes_a_tee():
    """A strip of shell and a beam below it bend about their common centre."""
    material = fem.Material(E, RHO, 0.0)
    mesh = fem.box_mesh("flange", (1.0, 0.1), (40, 2), kind="quad")
    line = np.flatnonzero(np.isclose(mesh.points[:, 1], 0.05))
    line = line[np.argsort(mesh.points[line, 0])]
    mesh = fem.StructureMesh(
        mesh.points,
        {**mesh.cells, "line": np.stack([line[:-1], line[1:]], axis=1)},
        {**mesh.groups, "web": {"line": np.arange(len(line) - 1)}},
        {**mesh.point_sets, "tip": line[-1:]},
    )
    web = fem.BeamPart(
        material, fem.RectangularSection(0.01, 0.04), orientation=(0, 0, 1), offset=(-0.025, 0)
    )
    model = fem.StructureModel(
        mesh,
        {"flange": fem.ShellPart(material, 0.01), "web": web},
        supports=[fem.Support("x0", CLAMP)],
        interfaces={"tip": fem.Interface("tip", "z")},
    )
    centre = 0.0004 * 0.025 / 0.0014
    second = 0.1 * 0.01**3 / 12 + 0.001 * centre**2
    second += 0.01 * 0.04**3 / 12 + 0.0004 * (0.025 - centre) ** 2
    assert flexibility(fem.assemble(model), "tip") == pytest.approx(1 / (3 * E * second), rel=0.01)


def square_tube(kind, n, along):
    """A tube 2 m long with sides of 0.1 m and walls of 2 mm."""
    mesh, square = mapped(kind, (4 * n, along), lambda a, b: (a, b, 0.0))
    side = np.minimum(np.floor(4 * square[:, 0] + 1e-9).astype(int), 3)
    share = (4 * square[:, 0] - side)[:, None]
    corners = 0.1 * np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) - 0.05
    across = corners[side] * (1 - share) + corners[side + 1] * share
    mesh = fem.joined([mesh.with_points(np.column_stack([2.0 * square[:, 1], across]))])
    return fem.assemble(
        fem.StructureModel(
            mesh,
            {"shell": fem.ShellPart(STEEL, 0.002)},
            supports=[fem.Support("y0", CLAMP)],
            couplings=[fem.Coupling("tip", "y1", at=(2, 0, 0))],
            interfaces={name: fem.Interface("tip", name) for name in ("x", "y", "rotation_x")},
        )
    )


@pytest.mark.parametrize("kind", ["quad", "triangle"])
def test_a_folded_shell_is_a_beam_with_a_thin_wall(kind):
    tube = square_tube(kind, 4, 40)
    second, torsion, G = 2 / 3 * 0.1**3 * 0.002, 0.1**3 * 0.002, E / (2 * (1 + NU))
    bent = 8 / (3 * E * second) + 2 / (G * 0.44 * 0.0008)
    assert flexibility(tube, "y") == pytest.approx(bent, rel=0.01)
    assert flexibility(tube, "x") == pytest.approx(2 / (E * 0.0008), rel=0.01)
    assert flexibility(tube, "rotation_x") == pytest.approx(2 / (G * torsion), rel=0.04)


def test_a_beam_goes_on_where_a_shell_ends():
    """A strip whose end is coupled to a beam of the same section: one cantilever of 2 m."""
    material = fem.Material(E, RHO, 0.0)
    strip = fem.box_mesh("strip", (1.0, 0.1), (16, 2), kind="quad")
    rod = fem.frame_mesh({"joint": (1, 0.05, 0), "tip": (2, 0.05, 0)}, [("rod", "joint", "tip", 4)])
    section = fem.RectangularSection(width=0.01, height=0.1)
    model = fem.StructureModel(
        fem.joined([strip, rod]),
        {"strip": fem.ShellPart(material, 0.01), "rod": fem.BeamPart(material, section)},
        supports=[fem.Support("x0", CLAMP)],
        couplings=[fem.Coupling("joint", "x1")],
        interfaces={"tip": fem.Interface("tip", "z")},
    )
    whole = cantilever(fem.BeamPart(material, section), length=2.0)
    found = flexibility(fem.assemble(model), "tip")
    assert found == pytest.approx(flexibility(fem.assemble(whole), "z"), rel=0.005)


def test_normals_of_corners_stop_at_folds():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0, 1], [1, 1, 1.0]])
    normals = corner_normals(points, [np.array([[0, 1, 2, 3], [1, 2, 5, 4]])])[0]
    np.testing.assert_allclose(np.abs(normals[0]), np.tile([0, 0, 1.0], (4, 1)), atol=1e-15)


def block_and_plate(first):
    block = fem.box_mesh("block", (1.0, 1.0, 1.0), (4, 4, 1), kind="hexahedron")
    plate = fem.box_mesh("plate", (1.5, 1.0), (6, 4), origin=(first, 0.0, 1.0), kind="quad")
    return fem.StructureModel(
        fem.joined([block, plate]),
        {"block": fem.SolidPart(STEEL), "plate": fem.ShellPart(STEEL, 0.01)},
        supports=[fem.Support("block", ("x", "y", "z"))],
    )


def test_a_shell_at_the_edge_of_a_solid_is_told_to_be_a_hinge():
    with pytest.warns(fem.JointWarning, match=r"part 'plate' shares 5 nodes with solids.*hinge"):
        hinged = fem.assemble(block_and_plate(1.0))
    assert lowest_hz(hinged, 2)[0] < 0.01  # the plate swings


def test_a_shell_that_goes_on_along_the_solid_is_clamped(recwarn):
    lapped = fem.assemble(block_and_plate(0.5))
    assert not [w for w in recwarn if issubclass(w.category, fem.JointWarning)]
    # between a beam with an overhang, on supports where the nodes are, and one that is clamped
    points = {"a": (0, 0), "b": (0.25, 0), "c": (0.5, 0), "d": (1.5, 0)}
    mesh = fem.frame_mesh(points, [("s", "a", "b", 4), ("s", "b", "c", 4), ("s", "c", "d", 8)])
    stiff = fem.Material(E / (1 - NU**2), RHO)
    held = [fem.Support("a", ("x", "y")), fem.Support("b", "y"), fem.Support("c", "y")]
    beam = fem.StructureModel(
        mesh,
        {"s": fem.BeamPart(stiff, fem.RectangularSection(1.0, 0.01))},
        supports=held,
        plane=True,
    )
    clamped = 3.5160 / (2 * np.pi) * np.sqrt(E * 1e-4 / (12 * (1 - NU**2) * RHO))
    assert lowest_hz(fem.assemble(beam), 1)[0] < lowest_hz(lapped, 1)[0] < clamped


def test_a_strip_of_eight_node_cells_bends_as_a_beam_in_both_directions():
    """A cantilever of 6 m x 0.2 m x 0.1 m in one row of six cells, against Euler's beam."""
    strip = fem.box_mesh("strip", (6.0, 0.2), (6, 1), kind="quad8")
    held = [fem.Support("x0", CLAMP)]
    model = fem.StructureModel(strip, {"strip": fem.ShellPart(STEEL, 0.1)}, supports=held)
    wanted = 1.8751041**2 / (2 * np.pi * 36) * np.sqrt(E / RHO / 12) * np.array([0.1, 0.2])
    np.testing.assert_allclose(lowest_hz(fem.assemble(model), 2), wanted, rtol=0.01)


def test_middle_nodes_of_cells_belong_to_the_names_that_hold_the_cells():
    strip = fem.box_mesh("strip", (6.0, 1.0), (6, 1), kind="quad8")
    mesh = fem.StructureMesh(
        strip.points,
        strip.cells,
        {"shell": {"quad8": np.array([1, 2, 4])}, "skin": {"quad8": np.array([0, 2, 3])}},
        {"third": strip.cells["quad8"][2], "edge": strip.nodes("y0")},
        element_types={"S8": {"quad8": np.arange(6)}},
    )
    found = with_centres(mesh, ["shell"])
    middles = found.points[found.cells["quad9"]].mean(axis=1)[:, 0]
    np.testing.assert_allclose(middles, [1.5, 2.5, 4.5])
    others = found.points[found.cells["quad8"]].mean(axis=1)[:, 0]
    np.testing.assert_allclose(others, [0.5, 3.5, 5.5])
    np.testing.assert_allclose(found.points[-3:], [[1.5, 0.5, 0], [2.5, 0.5, 0], [4.5, 0.5, 0]])
    centre = len(strip.points) + 1
    assert found.part("skin")["quad8"].tolist() == [0, 1]
    assert found.part("skin")["quad9"].tolist() == [1]
    assert centre in found.nodes("third") and len(found.nodes("third")) == 9
    assert found.nodes("edge").tolist() == mesh.nodes("edge").tolist()
    assert found.element_types["S8"]["quad9"].tolist() == [0, 1, 2]


PLATE = fem.ShellPart(STEEL, 0.01)


def shell_of(points, cells, part=PLATE):
    kind = "quad" if len(cells[0]) == 4 else "triangle"
    mesh = fem.StructureMesh(points, {kind: cells}, {"s": {kind: np.arange(len(cells))}}, {}, "m")
    return fem.StructureModel(mesh, {"s": part})


SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0]]


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: fem.ShellPart(fem.Material(1.0, 1.0), 0.1), "shell part: its material needs a po"),
        (lambda: fem.ShellPart(STEEL, 0.0), "shell part: thickness must be positive"),
        (lambda: fem.ShellPart(STEEL, 0.1, offset=np.inf), "offset must be finite"),
        (
            lambda: fem.assemble(shell_of(SQUARE, [[0, 1, 1, 3]])),
            r"m: quad 0 at \(0.5, 0.25, 0\) has a node twice",
        ),
        (
            lambda: fem.assemble(shell_of(SQUARE, [[0, 1, 4]])),
            "the triangle with the nodes 0, 1, 4 is flat",
        ),
        (
            lambda: fem.assemble(
                shell_of(SQUARE, [[0, 1, 2, 3], [1, 2, 5, 4]], fem.ShellPart(STEEL, 0.01, 0.1))
            ),
            "has an offset, but two of its cells that meet at the nodes 1 and 2",
        ),
        (
            lambda: fem.StructureModel(fem.box_mesh("b", (1.0, 1.0, 1.0), (1, 1, 1)), {"b": PLATE}),
            "part 'b' is a ShellPart and needs cells out of 'quad', 'quad8', 'quad9', 'triangle'",
        ),
        (
            lambda: fem.StructureModel(
                fem.joined(
                    [
                        fem.box_mesh("a", (1.0, 1.0), (1, 1), kind="quad"),
                        fem.box_mesh("b", (1.0, 1.0), (1, 1), kind="quad", origin=(1.0, 0.0)),
                    ]
                ),
                {"a": PLATE, "b": fem.SolidPart(STEEL, "stress", 0.01)},
            ),
            "a structure in the plane has no shells",
        ),
    ],
)
def test_a_bad_shell_is_one_sentence(make, sentence):
    with pytest.raises(fem.ModelError, match=sentence) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_saved_shell_is_the_same(tmp_path):
    component = shell(saddle("quad"), E, NU, 0.01, [fem.Support("x0", CLAMP)], offset=0.003)
    component.save(tmp_path / "shell.npz")
    again = fem.Component.load(tmp_path / "shell.npz")
    assert again.model.parts == component.model.parts
    assert np.array_equal(again.stiffness.toarray(), component.stiffness.toarray())


def test_a_foundation_carries_a_shell():
    """A plate on a soft elastic bed tips and moves as a rigid body."""
    model = fem.StructureModel(
        fem.box_mesh("plate", (1.0, 1.0), (4, 4), kind="quad"),
        {"plate": fem.ShellPart(STEEL, 0.05)},
        foundations=[fem.Foundation("plate", (1e3, 1e3, 1e3))],
    )
    wanted = np.sqrt(1e3 / (RHO * 0.05)) / (2 * np.pi)
    tips = wanted / np.sqrt(1 + 0.05**2)
    found = lowest_hz(fem.assemble(model), 3)
    np.testing.assert_allclose(found, [tips, tips, wanted], rtol=1e-6)


def test_a_shell_keeps_its_digits_however_thin_it_is():
    """With the thickness t a frequency is a t - b t³: the differences fall by 100 with t/10."""
    mesh = fem.box_mesh("strip", (1.0, 0.1), (20, 2), kind="quad")
    mesh = mesh.with_point_sets({"tip": [nearest(mesh.points[:, :2], (1.0, 0.05))]})
    found = []
    for t in (1e-3, 1e-4, 1e-5):
        model = fem.StructureModel(
            mesh,
            {"strip": fem.ShellPart(fem.Material(E, RHO, 0.0), t)},
            supports=[fem.Support("x0", CLAMP)],
            interfaces={"tip": fem.Interface("tip", "z")},
        )
        found.append(cms.reduce(fem.assemble(model), modes=2).frequencies_hz[0] / t)
    assert (found[0] - found[1]) / (found[1] - found[2]) == pytest.approx(100.0, rel=0.01)


@pytest.mark.parametrize("kind", KINDS)
def test_stress_of_constant_states_is_that_of_plane_stress(kind):
    """Von Mises' on the outer face: strains (1e-3, -2e-3), and the curvature 1/m at t/2."""
    flat, _ = distorted(kind)
    points, turn = turned(flat.points)
    component = shell(flat.with_points(points), E, NU, 0.01, ())
    dofs = component.numbering.dofs(np.arange(len(points)))
    for state, strains in (("stretch", (1e-3, -2e-3)), ("bending", (-0.005, 0.0))):
        local = np.array([STATES[state](x, y) for x, y, _ in flat.points])
        u = np.zeros(len(component.free))
        u[dofs] = np.hstack([local[:, :3] @ turn.T, local[:, 3:] @ turn.T])
        first, second = E / (1 - NU**2) * np.array([[1, NU], [NU, 1]]) @ strains
        wanted = np.sqrt(first**2 - first * second + second**2)
        found = surface_values(structure_surface(component), u, "stress")
        np.testing.assert_allclose(found, wanted, rtol=1e-9)
