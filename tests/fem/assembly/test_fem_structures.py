"""Structures of solids and beams against closed forms, scikit-fem's own forms and each other."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import skfem
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree
from skfem.models.elasticity import lame_parameters, linear_elasticity
from structures import CLAMP, STEEL, TURNS, cantilever, flexibility, lowest_hz

import fem
from fem.assembly.constraints import number_blocks
from fem.assembly.structure import solid_matrices
from fem.mesh.cells import KINDS

NO_CONTRACTION = fem.Material(2.0e11, 8000.0, 0.0)
BAR = fem.BeamPart(STEEL, fem.RectangularSection(width=0.03, height=0.02))
SOLIDS = [name for name, kind in KINDS.items() if kind.dimension > 1]
MESHES = {
    "triangle": skfem.MeshTri1, "triangle6": skfem.MeshTri1, "quad": skfem.MeshQuad1,
    "quad8": skfem.MeshQuad1, "quad9": skfem.MeshQuad1, "tetra": skfem.MeshTet1,
    "tetra10": skfem.MeshTet1, "hexahedron": skfem.MeshHex1, "hexahedron20": skfem.MeshHex1,
    "hexahedron27": skfem.MeshHex1, "wedge": skfem.MeshWedge1,
}  # fmt: skip


def _is_tapered(kind):
    """Where a bilinear map leaves every edge straight with its node in the middle."""
    return kind.startswith(("quad", "hexa")) or kind in ("wedge", "pyramid")


def skewed_block(kind):
    """A small mesh of cells that are not rectangular but have straight edges."""
    dimension = KINDS[kind].dimension
    mesh = fem.box_mesh("block", (1.0, 0.7, 0.5)[:dimension], (2, 2, 1)[:dimension], kind=kind)
    points = mesh.points.copy()
    points[:, 0] += 0.3 * points[:, 1]
    if _is_tapered(kind):
        points[:, 1] *= 1.0 + 0.4 * mesh.points[:, 0]
    return mesh.with_points(points)


def stock_matrices(mesh, kind, plane=None):
    """Stiffness and mass by scikit-fem's forms, with the node and direction of each dof."""
    cell = KINDS[kind]
    corners = mesh.cells[kind][:, : len(cell.corners)]
    reference = np.array(MESHES[kind].elem.doflocs)
    order = [int(np.argmin(np.abs(cell.corners - place).sum(axis=1))) for place in reference]
    used, number = np.unique(corners, return_inverse=True)
    t = number.reshape(corners.shape)[:, order].T
    own = MESHES[kind](
        np.ascontiguousarray(mesh.points[used, : cell.dimension].T), np.ascontiguousarray(t)
    )
    element = skfem.ElementWedge1() if kind == "wedge" else cell.element
    places, weights = cell.quadrature  # that of scikit-fem, but for wedges
    basis = skfem.Basis(own, skfem.ElementVector(element), quadrature=(places.T, weights))
    E, nu = STEEL.youngs_modulus, STEEL.poissons_ratio
    law = {None: lame_parameters, "strain": lame_parameters}.get(plane)
    if plane == "stress":
        first, mu = lame_parameters(E, nu)
        constants = (2 * first * mu / (first + 2 * mu), mu)
    else:
        constants = law(E, nu)
    K = linear_elasticity(*constants).assemble(basis)

    @skfem.BilinearForm
    def product(u, v, w):
        return sum(u[i] * v[i] for i in range(cell.dimension))

    M = STEEL.density * product.assemble(basis)
    points = mesh.points[:, : cell.dimension]
    _, node = cKDTree(points).query(basis.doflocs.T)
    direction = np.zeros(basis.N, dtype=int)
    dofs = basis.get_dofs(elements=True)
    for axis in range(cell.dimension):
        direction[dofs.all([f"u^{axis + 1}"])] = axis
    return K, M, 3 * node + direction


@pytest.mark.parametrize("kind", MESHES)
def test_batched_matrices_are_those_of_the_stock_forms(kind):
    mesh = skewed_block(kind)
    plane = "stress" if KINDS[kind].dimension == 2 else None
    part = fem.SolidPart(STEEL, plane, 1.0 if plane else None, integration="full")
    model = fem.StructureModel(mesh, {"block": part})
    K, M = solid_matrices(model, number_blocks(model))
    stock_K, stock_M, at = stock_matrices(mesh, kind, plane)
    assert abs(K[at][:, at] - stock_K).max() < 1e-13 * abs(stock_K).max()
    assert abs(M[at][:, at] - stock_M).max() < 1e-13 * abs(stock_M).max()


def test_plane_strain_is_that_of_the_stock_form():
    mesh = skewed_block("quad8")
    part = fem.SolidPart(STEEL, "strain", 0.2, integration="full")
    model = fem.StructureModel(mesh, {"block": part})
    K, _ = solid_matrices(model, number_blocks(model))
    stock_K, _, at = stock_matrices(mesh, "quad8", "strain")
    assert abs(K[at][:, at] - 0.2 * stock_K).max() < 1e-13 * abs(stock_K).max()


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_free_body_has_its_mass_and_its_rigid_motions(kind):
    mesh = skewed_block(kind)
    dimension = KINDS[kind].dimension
    part = fem.SolidPart(STEEL, *(("stress", 0.1) if dimension == 2 else ()))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fem.LockingWarning)
        component = fem.assemble(fem.StructureModel(mesh, {"block": part}))
    x, y, z = mesh.points.T
    motions = [np.tile(np.eye(3)[axis], (len(x), 1)) for axis in range(dimension)]
    motions.append(np.stack([-y, x, 0 * z], axis=1))
    if dimension == 3:
        motions.append(np.stack([z, 0 * x, -x], axis=1))
    for motion in motions:
        u = motion[:, :dimension].ravel()
        assert np.abs(component.stiffness @ u).max() < 1e-12 * abs(component.stiffness).max()
    one = motions[0][:, :dimension].ravel()
    volume = 0.7 * (1.158 if _is_tapered(kind) else 1.0) * (0.5, 0.1)[dimension == 2]
    assert one @ component.mass @ one == pytest.approx(8000.0 * volume, rel=1e-12)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (1, 2, 0.5), (-0.3, 0.2, 0.9)])
@pytest.mark.parametrize("theory", ["euler-bernoulli", "timoshenko"])
def test_statics_of_a_beam_in_space_are_exact(direction, theory):
    part = fem.BeamPart(STEEL, BAR.section, theory=theory, orientation=(0.1, 0.5, 0.7))
    component = fem.assemble(cantilever(part, direction, length=0.5, elements=3))
    section, E, L = part.section, STEEL.youngs_modulus, 0.5
    G = E / 2.6
    shear = 0.0 if theory == "euler-bernoulli" else L / (G * section.shear_areas(0.3)[0])
    x = np.array(direction) / np.linalg.norm(direction)
    z = np.cross(x, part.orientation)
    z /= np.linalg.norm(z)
    y = np.cross(z, x)
    tip = np.stack([component.interfaces[name] for name in "xyz"], axis=1)
    turn = np.stack([component.interfaces[name] for name in TURNS], axis=1)

    def moved(load, seen):
        return seen @ spsolve(component.stiffness.tocsc(), load)

    assert moved(tip @ x, tip @ x) == pytest.approx(L / (E * section.area), rel=1e-9)
    for axis, second in ((y, section.second_moment), (z, section.second_moment_across)):
        wanted = L**3 / (3 * E * second) + shear
        assert moved(tip @ axis, tip @ axis) == pytest.approx(wanted, rel=1e-9)
    slope = L**2 / (2 * E * section.second_moment)
    assert moved(tip @ y, turn @ z) == pytest.approx(slope, rel=1e-9)
    slope = L**2 / (2 * E * section.second_moment_across)
    assert moved(tip @ z, turn @ y) == pytest.approx(-slope, rel=1e-9)
    wanted = L / (G * section.torsion_constant)
    assert moved(turn @ x, turn @ x) == pytest.approx(wanted, rel=1e-9)


def test_the_torsion_constant_of_a_rectangle_is_the_published_one():
    # Timoshenko and Goodier, table 7: coefficients of 1, 2 and 10
    for ratio, published in ((1.0, 0.1406), (2.0, 0.229), (10.0, 0.312)):
        found = fem.RectangularSection(ratio, 1.0).torsion_constant / ratio
        assert found == pytest.approx(published, abs=6e-4)


@pytest.mark.parametrize(
    "placed", [{}, {"offset": (0.02, 0.0)}, {"orientation": (0.3, 0.1, 1.0), "offset": (0.0, 0.02)}]
)
def test_a_frame_in_its_plane_is_the_same_as_a_structure(placed):
    mesh = fem.frame_mesh(
        {"a": (0, 0), "b": (0, 1), "c": (1, 1.3), "d": (1.2, 0)},
        [("bars", "a", "b", 3), ("bars", "b", "c", 3), ("bars", "c", "d", 3)],
    )
    supports = [fem.Support("a", ("x", "y", "rotation")), fem.Support("d", ("x", "y"))]
    attached = {
        "point_masses": [fem.PointMass("b", 0.3, 0.01)],
        "springs": [fem.PointSpring("c", "x", 1e5), fem.PointSpring("c", "rotation", 1e3)],
    }
    part = fem.BeamPart(STEEL, BAR.section, theory="timoshenko", axial_force=500.0, **placed)
    frame = fem.assemble(fem.StructureModel(mesh, {"bars": part}, supports, **attached, plane=True))
    nodes = np.arange(len(mesh.points))
    flat = mesh.with_point_sets({"all": nodes})
    out = fem.Support("all", ("z", "rotation_x", "rotation_y"))
    space = fem.assemble(fem.StructureModel(flat, {"bars": part}, [*supports, out], **attached))
    np.testing.assert_allclose(lowest_hz(space, 8), lowest_hz(frame, 8), rtol=1e-9)


def test_a_hinge_in_space_turns_freely():
    mesh = fem.frame_mesh(
        {"a": (0, 0, 0), "m": (1, 0, 0), "b": (2, 0, 0)}, [("l", "a", "m", 2), ("r", "m", "b", 2)]
    )
    model = fem.StructureModel(
        mesh,
        {"l": BAR, "r": BAR},
        supports=[fem.Support("a", CLAMP), fem.Support("b", ("x", "y", "z", "rotation_x"))],
        hinges=[fem.Hinge("m", "r")],
        springs=[fem.PointSpring("m", "y", 1.0)],
        interfaces={"m": fem.Interface("m", "y")},
    )
    component = fem.assemble(model)
    # the right bar only hangs on: a cantilever of the left one
    held = 3 * STEEL.youngs_modulus * BAR.section.second_moment
    u = np.linalg.lstsq(component.stiffness.toarray(), component.interfaces["m"], rcond=None)[0]
    assert component.interfaces["m"] @ u == pytest.approx(1 / (held + 1.0), rel=1e-6)


def timoshenko_hz(part, length, n):
    """Frequency n of a simply supported Timoshenko beam: the lower root of its quartic."""
    E, rho, nu = 2.0e11, 8000.0, 0.3
    A, second = part.section.area, part.section.second_moment
    kGA = E / (2 * (1 + nu)) * part.section.shear_areas(nu)[0]
    k = n * np.pi / length
    # det [[kGA k² - rho A w², -kGA k], [-kGA k, EI k² + kGA - rho I w²]] = 0
    a = rho * A * rho * second
    b = -(rho * A * (E * second * k**2 + kGA) + rho * second * kGA * k**2)
    c = kGA * k**2 * E * second * k**2
    return np.sqrt((-b - np.sqrt(b * b - 4 * a * c)) / (2 * a)) / (2 * np.pi)


def test_a_deep_beam_converges_to_timoshenko():
    # the shear strain is constant in an element, so its share converges with the second power
    part = fem.BeamPart(STEEL, fem.RectangularSection(2.0, 2.0), theory="timoshenko")
    errors = []
    for elements in (4, 8, 16):
        mesh = fem.frame_mesh({"a": (0, 0), "b": (10, 0)}, [("beam", "a", "b", elements)])
        ends = [fem.Support("a", ("x", "y")), fem.Support("b", "y")]
        component = fem.assemble(fem.StructureModel(mesh, {"beam": part}, ends, plane=True))
        errors.append(lowest_hz(component, 1)[0] / timoshenko_hz(part, 10.0, 1) - 1)
    assert 0 < errors[-1] < 2e-4
    assert errors[0] / errors[1] > 3.8 and errors[1] / errors[2] > 3.8


@pytest.mark.parametrize("share", [-0.9, -0.5, 1.0, 10.0])
def test_an_axial_force_changes_the_frequency_of_a_pinned_beam_as_in_the_closed_form(share):
    euler = np.pi**2 * STEEL.youngs_modulus * BAR.section.second_moment
    mesh = fem.frame_mesh({"a": (0, 0), "b": (1, 0)}, [("bar", "a", "b", 16)])
    ends = [fem.Support("a", ("x", "y")), fem.Support("b", "y")]

    def first(force):
        part = fem.BeamPart(STEEL, BAR.section, axial_force=force)
        return lowest_hz(
            fem.assemble(fem.StructureModel(mesh, {"bar": part}, ends, plane=True)), 1
        )[0]

    assert first(share * euler) / first(0.0) == pytest.approx(np.sqrt(1 + share), rel=1e-5)


def test_two_eccentric_bars_bend_as_one_section():
    mesh = fem.frame_mesh({"root": (0, 0, 0), "tip": (1, 0, 0)}, [("low", "root", "tip", 30)])
    lines = mesh.cells["line"]
    count = len(lines)
    both = fem.StructureMesh(
        mesh.points,
        {"line": np.vstack([lines, lines])},
        {"low": {"line": np.arange(count)}, "high": {"line": np.arange(count, 2 * count)}},
        mesh.point_sets,
    )
    away = 0.05
    parts = {
        name: fem.BeamPart(STEEL, BAR.section, offset=(side * away, 0.0))
        for name, side in (("low", -1), ("high", 1))
    }
    component = fem.assemble(
        fem.StructureModel(
            both, parts, [fem.Support("root", CLAMP)], interfaces={"tip": fem.Interface("tip", "y")}
        )
    )
    second = 2 * (BAR.section.second_moment + BAR.section.area * away**2)
    # between the nodes, where nothing joins them, the bars bend on their own as between battens
    battens = (1 / count) ** 2 / (24 * STEEL.youngs_modulus * BAR.section.second_moment)
    wanted = 1 / (3 * STEEL.youngs_modulus * second) + battens
    assert flexibility(component, "tip") == pytest.approx(wanted, rel=1e-3)


def test_a_mass_with_an_offset_is_a_mass_on_a_rigid_arm():
    heavy = fem.PointMass("tip", 3.0, (0.02, 0.03, 0.05), offset=(0.2, -0.1, 0.3))
    offset = fem.assemble(cantilever(BAR, point_masses=[heavy]))
    mesh = fem.frame_mesh({"root": (0, 0, 0), "tip": (1, 0, 0)}, [("arm", "root", "tip", 4)])
    arm = fem.StructureModel(
        mesh,
        {"arm": BAR},
        supports=[fem.Support("root", CLAMP)],
        couplings=[fem.Coupling("mass", "tip", at=(1.2, -0.1, 0.3))],
        point_masses=[fem.PointMass("mass", 3.0, (0.02, 0.03, 0.05))],
    )
    np.testing.assert_allclose(lowest_hz(offset, 6), lowest_hz(fem.assemble(arm), 6), rtol=1e-9)


def bar_of_solids(kind="averaging", **attached):
    mesh = fem.box_mesh("bar", (1.0, 0.1, 0.2), (4, 2, 2))
    return fem.StructureModel(
        mesh,
        {"bar": fem.SolidPart(NO_CONTRACTION)},
        supports=[fem.Support("x0", ("x", "y", "z"))],
        couplings=[fem.Coupling("tip", "x1", kind)],
        interfaces={name: fem.Interface("tip", name) for name in ("x", "y", "z", *TURNS)},
        **attached,
    )


@pytest.mark.parametrize("kind", ["rigid", "averaging"])
def test_a_coupled_face_carries_forces_and_moments(kind):
    # without lateral contraction stretching and pure bending are exact on these cells
    component = fem.assemble(bar_of_solids(kind))
    E = NO_CONTRACTION.youngs_modulus
    assert flexibility(component, "x") == pytest.approx(1.0 / (E * 0.02), rel=1e-9)
    second = {"rotation_z": 0.2 * 0.1**3 / 12, "rotation_y": 0.1 * 0.2**3 / 12}
    for name, moment in second.items():
        assert flexibility(component, name) == pytest.approx(1.0 / (E * moment), rel=1e-9)
    wanted = 0.5 / (E * second["rotation_z"])
    assert flexibility(component, "rotation_z", "y") == pytest.approx(wanted, rel=1e-9)


def test_an_averaged_face_is_softer_than_a_rigid_one():
    twist = [
        flexibility(fem.assemble(bar_of_solids(kind)), "rotation_x")
        for kind in ("averaging", "rigid")
    ]
    assert twist[0] > twist[1]


def test_a_beam_goes_on_where_the_solid_ends():
    solid = fem.box_mesh("solid", (0.5, 0.02, 0.03), (10, 1, 1))
    points = solid.points - np.array([0.0, 0.01, 0.015])
    solid = solid.with_points(points)
    beam = fem.frame_mesh({"joint": (0.5, 0, 0), "tip": (1, 0, 0)}, [("beam", "joint", "tip", 8)])
    part = fem.BeamPart(NO_CONTRACTION, BAR.section, theory="timoshenko")
    count = len(solid.points)
    mixed = fem.StructureMesh(
        np.vstack([solid.points, beam.points]),
        {**solid.cells, "line": beam.cells["line"] + count},
        {**solid.groups, **beam.groups},
        {
            **solid.point_sets,
            **{name: nodes + count for name, nodes in beam.point_sets.items()},
        },
    )
    model = fem.StructureModel(
        mixed,
        {"solid": fem.SolidPart(NO_CONTRACTION), "beam": part},
        supports=[fem.Support("x0", ("x", "y", "z"))],
        couplings=[fem.Coupling("joint", "x1")],
    )
    whole = fem.assemble(cantilever(part, elements=24))
    np.testing.assert_allclose(lowest_hz(fem.assemble(model), 4), lowest_hz(whole, 4), rtol=5e-3)


def test_a_line_of_three_nodes_is_two_beams():
    """As a mesher of second order makes them along a curve."""
    two = cantilever(BAR, elements=4)
    lines = two.mesh.cells["line"]
    assert (lines[:-1, 1] == lines[1:, 0]).all()
    threes = np.column_stack([lines[::2, 0], lines[1::2, 1], lines[::2, 1]])
    mesh = fem.StructureMesh(
        two.mesh.points, {"line3": threes}, {"arm": {"line3": [0, 1]}}, two.mesh.point_sets
    )
    three = fem.assemble(replace(two, mesh=mesh))
    np.testing.assert_allclose(lowest_hz(three, 6), lowest_hz(fem.assemble(two), 6), rtol=1e-9)


def threes(points, cells, **sets):
    return fem.StructureMesh(
        points, {"line3": cells}, {"arm": {"line3": np.arange(len(cells))}}, sets, "arm"
    )


@pytest.mark.parametrize("middle", [0.5, 0.3])
def test_a_middle_node_anywhere_on_a_straight_beam_keeps_statics_and_mass(middle):
    """One line of three nodes, clamped: the tip under a unit load, and its rigid body's inertia."""
    mesh = threes([[0, 0, 0], [1, 0, 0], [middle, 0, 0]], [[0, 1, 2]], root=[0], tip=[1])
    model = fem.StructureModel(
        mesh,
        {"arm": BAR},
        supports=[fem.Support("root", CLAMP)],
        interfaces={"tip": fem.Interface("tip", "y")},
    )
    wanted = 1.0 / (3.0 * STEEL.youngs_modulus * BAR.section.second_moment)
    assert flexibility(fem.assemble(model), "tip") == pytest.approx(wanted, rel=1e-12)
    free = fem.assemble(fem.StructureModel(mesh, {"arm": BAR}))
    dofs = free.numbering.dofs(np.arange(3))
    turn = np.zeros(len(free.free))
    turn[dofs[:, 1]], turn[dofs[:, 5]] = mesh.points[:, 0], 1.0
    mass = STEEL.density * BAR.section.area
    assert turn @ free.mass @ turn == pytest.approx(mass / 3.0, rel=1e-12)


def test_curved_lines_of_three_nodes_follow_a_quarter_of_a_ring():
    """Its tip under a radial force moves by pi P R³/(4 E I), and R P pi/(4 E A) by stretching."""
    errors = []
    for count in (4, 8):
        turn = np.linspace(0.0, np.pi / 2, 2 * count + 1)
        points = np.column_stack([np.sin(turn), np.cos(turn), 0.0 * turn])
        first = 2 * np.arange(count)
        mesh = threes(
            points, np.column_stack([first, first + 2, first + 1]), root=[0], tip=[2 * count]
        )
        model = fem.StructureModel(
            mesh,
            {"arm": BAR},
            supports=[fem.Support("root", CLAMP)],
            interfaces={"tip": fem.Interface("tip", "x")},
        )
        E, section = STEEL.youngs_modulus, BAR.section
        wanted = np.pi / 4 / (E * section.second_moment) + np.pi / 4 / (E * section.area)
        errors.append(flexibility(fem.assemble(model), "tip") / wanted - 1)
    assert abs(errors[1]) < 0.005
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_a_round_bar_along_z_needs_no_orientation():
    round_bar = replace(BAR, section=fem.CircularSection(0.03, bore=0.02))
    upright = fem.assemble(cantilever(round_bar, (0.0, 0.0, 1.0)))
    lying = fem.assemble(cantilever(round_bar))
    np.testing.assert_allclose(lowest_hz(upright, 8), lowest_hz(lying, 8), rtol=1e-7)


@pytest.mark.parametrize("turns", [(), TURNS])
def test_rotations_held_on_a_face_of_a_solid_are_those_of_its_translations(turns):
    model = fem.StructureModel(
        fem.box_mesh("bar", (1.0, 0.1, 0.2), (3, 1, 1)),
        {"bar": fem.SolidPart(STEEL)},
        supports=[fem.Support("x0", ("x", "y", "z", *turns)), fem.symmetry("x1", "x")],
    )
    assert fem.assemble(model).stiffness.shape[0] == 3 * (2 * 8 + 3 * 4) + 2 * 8


def test_half_a_structure_with_symmetry_has_the_symmetric_modes():
    part = {"bar": fem.SolidPart(STEEL)}
    whole = fem.box_mesh("bar", (1.0, 0.05, 0.08), (8, 1, 1))
    ends = [fem.Support("x0", ("x", "y", "z")), fem.Support("x1", ("x", "y", "z"))]
    all_modes = lowest_hz(fem.assemble(fem.StructureModel(whole, part, ends)), 12)
    half = fem.box_mesh("bar", (0.5, 0.05, 0.08), (4, 1, 1))
    cut = [ends[0], fem.symmetry("x1", "x")]
    for frequency in lowest_hz(fem.assemble(fem.StructureModel(half, part, cut)), 4):
        assert np.abs(all_modes / frequency - 1).min() < 1e-9


def test_a_beam_on_a_foundation_has_the_frequencies_of_the_closed_form():
    mesh = fem.frame_mesh({"a": (0, 0, 0), "b": (1, 0, 0)}, [("bar", "a", "b", 12)])
    bed = 3.0e6
    model = fem.StructureModel(
        mesh,
        {"bar": BAR},
        supports=[fem.Support("a", ("x", "y", "z", "rotation_x")), fem.Support("b", ("y", "z"))],
        foundations=[fem.Foundation("bar", (0.0, bed, 0.0))],
    )
    mass = STEEL.density * BAR.section.area
    k = np.pi * np.arange(1, 3)
    y = np.sqrt((STEEL.youngs_modulus * BAR.section.second_moment * k**4 + bed) / mass)
    z = np.sqrt(STEEL.youngs_modulus * BAR.section.second_moment_across * k**4 / mass)
    wanted = np.sort(np.concatenate([y, z]))[:3] / (2 * np.pi)
    np.testing.assert_allclose(lowest_hz(fem.assemble(model), 3), wanted, rtol=1e-4)


def test_a_block_on_a_foundation_sinks_by_its_load_over_its_area():
    model = fem.StructureModel(
        fem.box_mesh("block", (0.4, 0.3, 0.1), (2, 2, 1)),
        {"block": fem.SolidPart(fem.Material(1e15, 8000.0, 0.3))},
        foundations=[fem.Foundation("z0", (1e6, 2e6, 5e7))],
        couplings=[fem.Coupling("top", "z1", "averaging")],
        interfaces={name: fem.Interface("top", name) for name in "xyz"},
    )
    component = fem.assemble(model)
    assert flexibility(component, "z") == pytest.approx(1 / (5e7 * 0.12), rel=1e-5)


@pytest.mark.parametrize("ratio", [5.0, 10.0])
def test_the_warning_of_locking_says_how_much_too_stiff(ratio):
    height, cells = 0.01, int(100 / ratio)
    mesh = fem.box_mesh("leaf", (1.0, height, 1.0), (cells, 1, cells), kind="hexahedron")
    model = fem.StructureModel(
        mesh,
        {"leaf": fem.SolidPart(NO_CONTRACTION)},
        supports=[
            fem.Support("x0", ("x", "y", "z")),
            *(fem.Support(face, "z") for face in ("z0", "z1", "tip")),
        ],
        couplings=[fem.Coupling("tip", "x1", directions=("x", "y"))],
        interfaces={"tip": fem.Interface("tip", "y")},
    )
    with pytest.warns(fem.LockingWarning, match="times too stiff") as caught:
        component = fem.assemble(model)
    said = float(str(caught[0].message).split("about ")[1].split(" times")[0])
    exact = 1 / (3 * NO_CONTRACTION.youngs_modulus * height**3 / 12)
    assert exact / flexibility(component, "tip") == pytest.approx(said, rel=0.15)


def test_second_order_cells_are_not_warned_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fem.assemble(bar_of_solids())


@pytest.mark.slow
def test_a_solid_of_1e5_dofs_has_the_energy_of_a_uniform_strain():
    mesh = fem.box_mesh("block", (1.0, 0.5, 0.25), (40, 20, 10))
    component = fem.assemble(fem.StructureModel(mesh, {"block": fem.SolidPart(STEEL)}))
    assert len(component.free) > 1e5
    strain = np.array([[1.0, 0.2, -0.3], [0.2, -0.5, 0.1], [-0.3, 0.1, 0.7]])
    u = (mesh.points @ strain).ravel()
    first, mu = lame_parameters(STEEL.youngs_modulus, STEEL.poissons_ratio)
    density = first * np.trace(strain) ** 2 + 2 * mu * np.sum(strain**2)
    assert u @ component.stiffness @ u == pytest.approx(density * 0.125, rel=1e-11)


def test_displacements_come_back_node_by_node():
    component = fem.assemble(bar_of_solids("rigid"))
    u = spsolve(component.stiffness.tocsc(), component.interfaces["rotation_z"])
    shape = component.shape(u)
    tip = component.model.mesh.node("tip")
    face = component.model.mesh.nodes("x1")
    arms = component.model.mesh.points[face] - component.model.mesh.points[tip]
    wanted = shape[tip, :3] + np.cross(shape[tip, 3:], arms)
    np.testing.assert_allclose(shape[face, :3], wanted, atol=1e-9 * np.abs(wanted).max())
    with pytest.raises(fem.ModelError, match="a displacement of the component has shape"):
        component.shape(u[:-1])


def test_a_structure_is_saved_and_loaded(tmp_path):
    model = bar_of_solids(
        point_masses=[fem.PointMass("tip", 0.5, (1e-3, 2e-3, 3e-3), offset=(0.1, 0, 0))],
        springs=[fem.PointSpring("tip", "rotation_x", 10.0)],
        foundations=[fem.Foundation("y0", (0.0, 1e6, 0.0))],
    )
    component = fem.assemble(model)
    component.save(tmp_path / "bar.npz")
    again = fem.Component.load(tmp_path / "bar.npz")
    assert abs(again.stiffness - component.stiffness).max() == 0.0
    assert abs(again.mass - component.mass).max() == 0.0
    assert all((again.interfaces[n] == v).all() for n, v in component.interfaces.items())
