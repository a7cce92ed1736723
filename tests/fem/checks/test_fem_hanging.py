"""Cells that lie against others without having their nodes, and beams on one node of a solid."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from structures import CLAMP, STEEL, flexibility, lowest_hz
from with_gmsh import gmsh_at_work

import fem
from fem.checks.hanging import boundary, check_nothing_hangs
from fem.checks.overlapping import overlap_warnings

E, LENGTH, THICKNESS = 2.0e11, 2.0, 0.01
SOFT_SIDED = fem.Material(E, 8000.0, 0.0)
SHEET = fem.SolidPart(SOFT_SIDED, "stress", THICKNESS)
SHELL = fem.ShellPart(SOFT_SIDED, THICKNESS)


def halves(rows, other_rows, kind="quad", gap=0.0):
    """Two squares or cubes beside each other along x, with rows of cells across x."""
    sides = len(rows) + 1
    return [
        fem.box_mesh("bar", (1.0,) * sides, (1, *n), origin=(x, 0.0, 0.0), kind=kind)
        for x, n in ((0.0, rows), (1.0 + gap, other_rows))
    ]


def model_of(mesh, part, **more):
    return fem.StructureModel(mesh, {name: part for name in mesh.groups}, **more)


@pytest.mark.parametrize(
    ("rows", "other_rows", "kind", "part"),
    [
        ((1,), (2,), "quad", SHELL),
        ((1,), (3,), "quad", SHELL),
        ((8,), (7,), "quad", SHELL),
        ((1,), (8,), "triangle", SHELL),
        ((2,), (3,), "quad8", SHEET),
        ((1,), (2,), "triangle", SHEET),
        ((1, 1), (2, 2), "hexahedron", fem.SolidPart(STEEL)),
        ((3, 1), (1, 3), "hexahedron", fem.SolidPart(STEEL)),
        ((2, 2), (3, 3), "hexahedron20", fem.SolidPart(STEEL)),
        ((1, 2), (2, 1), "hexahedron", fem.SolidPart(STEEL)),
        ((2, 4), (2, 5), "wedge", fem.SolidPart(STEEL)),
        ((1, 1), (2, 2), "tetra10", fem.SolidPart(STEEL)),
    ],
)
def test_cells_that_hang_are_refused_with_how_many_and_both_cells(rows, other_rows, kind, part):
    faces = np.prod(rows) + np.prod(other_rows)
    faces *= 2 if kind.startswith("tetra") else 1
    what = "edges" if len(rows) == 1 else "faces"
    said = (
        rf"box_mesh.*: {faces} {what} lie against others without having their nodes, the first at"
        rf" \(1, .*\), between {kind} \d+ at \(0\.\d+, .*\) and {kind} \d+ at \(1\.\d+, "
    )
    with pytest.raises(fem.ModelError, match=said):
        fem.assemble(model_of(fem.joined(halves(rows, other_rows, kind)), part))


def test_a_web_with_more_cells_than_the_flange_it_stands_on_is_refused():
    flange = fem.box_mesh("flange", (1.0, 1.0), (2, 2), kind="quad")
    web = fem.box_mesh("web", (1.0, 1.0), (4, 1), kind="quad")
    upright = web.with_points(web.points[:, [0, 2, 1]] + [0.0, 0.5, 0.0])
    with pytest.raises(fem.ModelError, match=r"6 edges lie against others .* quad 0 at"):
        fem.assemble(model_of(fem.joined([flange, upright]), SHELL))
    finer = fem.box_mesh("flange", (1.0, 1.0), (4, 2), kind="quad")
    model = model_of(fem.joined([finer, upright]), SHELL)
    check_nothing_hangs(model, boundary(model))


def pulled(mesh, part, **more):
    """Elongation of a bar of 2 m under 1 N, in shares of length / (E area)."""
    model = model_of(
        mesh,
        part,
        supports=[fem.Support("left", CLAMP if part is SHELL else ("x", "y"))],
        couplings=[fem.Coupling("tip", "right")],
        interfaces={"x": fem.Interface("tip", "x")},
        **more,
    )
    return flexibility(fem.assemble(model), "x") * E * THICKNESS / LENGTH


def named(mesh):
    """The same with the names of its ends, and of the nodes between its halves."""
    x, y, _ = mesh.points.T
    sets = {"left": np.flatnonzero(x == 0.0), "right": np.flatnonzero(x == LENGTH)}
    for name, height in (("low", 0.0), ("between", 0.5), ("high", 1.0)):
        sets[name] = np.flatnonzero((x == 1.0) & (y == height))
    return mesh.with_point_sets(sets)


@pytest.mark.parametrize("part", [SHEET, SHELL])
def test_triangles_between_one_row_and_two_make_the_bar_whole(part):
    """Uniform stress is exact on a mesh that conforms, and passed over where a node hangs."""
    left = fem.box_mesh("bar", (0.5, 1.0), (1, 1), kind="quad")
    right = fem.box_mesh("bar", (1.0, 1.0), (2, 2), kind="quad", origin=(1.0, 0.0, 0.0))
    corners = np.array([[0.5, 0, 0], [0.5, 1, 0], [1, 0, 0], [1, 0.5, 0], [1, 1, 0]])
    fan = np.array([[0, 2, 3], [0, 3, 1], [1, 3, 4]])
    between = fem.StructureMesh(corners, {"triangle": fan}, {"bar": {"triangle": np.arange(3)}})
    whole = named(fem.joined([left, between, right]))
    assert pulled(whole, part) == pytest.approx(1.0, rel=1e-9)
    torn = named(fem.joined(halves((1,), (2,))))
    assert pulled(torn, part, separate=True) > 1.02


def test_a_node_that_equations_tie_to_the_edge_it_lies_on_does_not_hang():
    mesh = named(fem.joined(halves((1,), (2,))))
    ties = [
        fem.LinearEquation([("between", way, 1.0), ("low", way, -0.5), ("high", way, -0.5)])
        for way in ("x", "y")
    ]
    tied = replace(mesh, attachments=fem.Attachments(equations=ties))
    assert pulled(tied, SHEET) == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize(
    ("meshes", "part"),
    [
        (halves((2, 2), (3, 3), "hexahedron", gap=1e-3), fem.SolidPart(STEEL)),
        (halves((2,), (3,), gap=1e-3), SHELL),
        (halves((3, 3), (3, 3), "hexahedron"), fem.SolidPart(STEEL)),
        ([*halves((1,), (1,)), fem.box_mesh("up", (1.0, 1.0), (2, 2), kind="quad",
                                           origin=(2.0, 1.0, 0.0))], SHELL),
    ],
)  # fmt: skip
def test_gaps_conforming_halves_and_corners_are_let_be(meshes, part):
    model = model_of(fem.joined(meshes), part)
    check_nothing_hangs(model, boundary(model))


@pytest.mark.parametrize("order", [1, 2])
def test_a_mesh_of_gmsh_in_which_sizes_change_is_let_be(order, tmp_path):
    with gmsh_at_work() as gmsh:
        block = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
        arm = gmsh.model.occ.addBox(1, 0.2, 0.2, 1, 0.5, 0.5)
        ball = gmsh.model.occ.addSphere(0.5, 0.5, 1, 0.3)
        gmsh.model.occ.fragment([(3, block)], [(3, arm), (3, ball)])
        gmsh.model.occ.synchronize()
        bodies = [tag for _, tag in gmsh.model.getEntities(3)]
        gmsh.model.addPhysicalGroup(3, bodies, name="body")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.2)
        gmsh.model.mesh.setSize(gmsh.model.getEntitiesInBoundingBox(1.9, 0, 0, 2.1, 1, 1, 0), 0.05)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(order)
        gmsh.write(str(tmp_path / "body.msh"))
    model = model_of(fem.read_mesh(tmp_path / "body.msh"), fem.SolidPart(STEEL))
    check_nothing_hangs(model, boundary(model))
    assert not list(overlap_warnings(model, boundary(model)))


def ring(radius, around, kind):
    """A sector of 1 rad between two radii, as high as it is thick."""
    flat = fem.box_mesh("ring", (0.5, 1.0, 0.5), (1, around, 1), origin=(radius, 0, 0), kind=kind)
    r, angle, z = flat.points.T
    return flat.with_points(np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1))


@pytest.mark.parametrize(
    ("kind", "around", "nodes"),
    [
        ("hexahedron20", 2, 10),  # in the middles of 4 arcs above and below, of 2 lines upwards
        ("hexahedron20", 3, 14),
        ("hexahedron27", 2, 12),
        ("wedge15", 2, 10),
        ("tetra10", 2, 12),
        ("hexahedron", 8, 16),
    ],
)
def test_cells_that_hang_on_a_curved_face_are_told_of(kind, around, nodes):
    other = around + 1 if around == 3 else 2 * around
    part = fem.SolidPart(STEEL)
    torn = model_of(fem.joined([ring(0.5, around, kind), ring(1.0, other, kind)]), part)
    [said] = overlap_warnings(torn, boundary(torn))
    assert f": {nodes} nodes lie on curved faces of cells that do not have them" in said
    assert not list(overlap_warnings(replace(torn, separate=True), boundary(torn)))
    whole = model_of(fem.joined([ring(r, around, kind) for r in (0.5, 1.0)]), part)
    assert not list(overlap_warnings(whole, boundary(whole)))


def test_a_hanging_curved_face_is_told_when_the_model_is_assembled():
    torn = fem.joined([ring(0.5, 2, "hexahedron20"), ring(1.0, 4, "hexahedron20")])
    with pytest.warns(fem.JointWarning, match="10 nodes lie on curved faces"):
        fem.assemble(model_of(torn, fem.SolidPart(STEEL)))


def rod_on_block(inner=None, couplings=(), pinned=()):
    """A round rod of 1 m from the middle of a face of a cube, or from a place within the cube."""
    block = fem.box_mesh("block", (1.0, 1.0, 1.0), (2, 2, 2), kind="hexahedron20")
    ends = {"face": (1.0, 0.5, 0.5), "tip": (2.0, 0.5, 0.5)}
    members = [("rod", "face", "tip", 8)]
    if inner is not None:
        ends["inner"] = (inner, 0.5, 0.5)
        members.append(("rod", "inner", "face", 1))
    rod = fem.frame_mesh(ends, members)
    return fem.StructureModel(
        fem.joined([block, rod]),
        {
            "block": fem.SolidPart(STEEL),
            "rod": fem.BeamPart(STEEL, fem.CircularSection(0.02)),
        },
        supports=[fem.Support("x0", ("x", "y", "z"))],
        couplings=couplings,
        pinned=pinned,
    )


def test_a_beam_on_one_node_of_a_solid_is_told_to_be_a_ball_joint():
    said = (
        r"part 'rod' shares 1 nodes with solids, the first 'face' at \(1, 0.5, 0.5\).*ball joint"
        r".*'couplings'"
    )
    with pytest.warns(fem.JointWarning, match=said):
        hinged = fem.assemble(rod_on_block())
    assert lowest_hz(hinged, 3)[2] < 0.1  # it swings two ways and spins


def test_a_beam_that_a_coupling_clamps_has_the_frequency_of_a_cantilever():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        clamped = fem.assemble(rod_on_block(couplings=[fem.Coupling("face", "x1")]))
    expected = 3.516015 / (2 * np.pi) * np.sqrt(STEEL.youngs_modulus * 0.02**2 / 16 / 8000.0)
    assert lowest_hz(clamped, 2) == pytest.approx([expected] * 2, rel=1e-4)


def test_a_beam_that_goes_on_within_a_cell_is_not_told_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fem.assemble(rod_on_block(inner=0.5))


def test_a_joint_that_is_meant_is_not_told_of(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        meant = fem.assemble(rod_on_block(pinned=["rod"]))
    assert lowest_hz(meant, 3)[2] < 0.1
    meant.save(tmp_path / "rod.npz")
    assert fem.Component.load(tmp_path / "rod.npz").model.pinned == ("rod",)
    with pytest.raises(fem.ModelError, match="'rods' of 'pinned' is no part; there are 'block', "):
        rod_on_block(pinned=["rods"])
    with pytest.raises(fem.ModelError, match="'rod' of 'pinned' meets no solid in nodes that it"):
        fem.assemble(rod_on_block(inner=0.5, pinned=["rod"]))


@pytest.mark.parametrize(("place", "nodes"), [((1.0, 1.0, 0.0), 3), ((1.0, 1.0, 1.0), 1)])
def test_solids_that_meet_in_an_edge_or_a_node_are_told_of(place, nodes):
    cubes = [
        fem.box_mesh(name, (1.0, 1.0, 1.0), (1, 1, 1), origin=at)
        for name, at in (("one", (0.0, 0.0, 0.0)), ("other", place))
    ]
    model = model_of(fem.joined(cubes), fem.SolidPart(STEEL))
    said = f"solids of 'one', 'other' meet in {nodes} nodes, but in no face there"
    with pytest.warns(fem.JointWarning, match=said):
        fem.assemble(model)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fem.assemble(replace(model, pinned=["other"]))
