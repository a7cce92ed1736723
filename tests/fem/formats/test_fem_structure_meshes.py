"""Meshes of solids from files. The files gmsh_bracket.* and gmsh_hex*.msh are Gmsh 4.15's own."""

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from structures import STEEL, lowest_hz

import fem

DATA = Path(__file__).parents[1] / "data"
CLAMPED = ("x", "y", "z")


def bracket(name):
    mesh = fem.read_mesh(DATA / name)
    return fem.StructureModel(
        mesh,
        {"bracket": fem.SolidPart(STEEL)},
        supports=[fem.Support("foot", CLAMPED)],
        couplings=[fem.Coupling("hub", "bore", at=(0.075, 0.03, 0.01))],
        point_masses=[fem.PointMass("hub", 0.2, 1e-5)],
        interfaces={"hub": fem.Interface("hub", "z")},
    )


def test_a_bracket_is_the_same_from_both_files_of_gmsh():
    found = [
        lowest_hz(fem.assemble(bracket(name)), 4)
        for name in ("gmsh_bracket.msh", "gmsh_bracket.inp")
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-9)


def test_the_volume_of_the_bracket_is_that_of_the_block_less_the_bore():
    mesh = fem.read_mesh(DATA / "gmsh_bracket.msh")
    component = fem.assemble(fem.StructureModel(mesh, {"bracket": fem.SolidPart(STEEL)}))
    volume = component.mass.sum() / 3 / STEEL.density
    assert volume == pytest.approx(0.1 * 0.06 * 0.02 - np.pi * 0.012**2 * 0.02, rel=1e-4)


@pytest.mark.parametrize("kind", ["hexahedron20", "hexahedron27"])
def test_hexahedra_of_gmsh_have_the_nodes_where_they_are_expected(kind):
    ours = fem.box_mesh("block", (0.3, 0.1, 0.05), (2, 2, 1), kind=kind)
    theirs = fem.read_mesh(DATA / f"gmsh_hex{kind[-2:]}.msh")
    parts = {"block": fem.SolidPart(STEEL)}
    found = [
        lowest_hz(fem.assemble(fem.StructureModel(m, parts, [fem.Support(at, CLAMPED)])), 5)
        for m, at in ((ours, "x0"), (theirs, "root"))
    ]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-8)


@pytest.mark.parametrize("extension", [".vtu", ".inp"])
def test_a_written_mesh_of_solids_comes_back_to_the_last_bit(tmp_path, extension):
    block = fem.box_mesh("block", (1 / 3, 0.1, np.pi), (2, 1, 2))
    tail = fem.frame_mesh({"a": (0, 0, 0), "b": (-1, 0, 0)}, [("t", "a", "b", 2)])
    mesh = fem.joined([block, tail])
    assert len(mesh.points) == len(block.points) + len(tail.points) - 1
    path = tmp_path / f"mesh{extension}"
    fem.write_mesh(mesh, path)
    back = fem.read_mesh(path)
    assert np.array_equal(back.points, mesh.points)
    assert all(np.array_equal(back.cells[kind], cells) for kind, cells in mesh.cells.items())
    assert back.part("t").keys() == {"line"} and back.part("block").keys() == {"hexahedron20"}
    for name in mesh.names:
        assert np.array_equal(back.nodes(name), mesh.nodes(name))
    with pytest.raises(fem.ModelError, match="only a mesh of two-node lines is written as"):
        fem.write_mesh(mesh, tmp_path / "mesh.msh")


@pytest.mark.parametrize("kind", ["triangle6", "quad8", "tetra10", "hexahedron"])
def test_abaqus_files_keep_every_kind_of_cell(tmp_path, kind):
    lengths = (1.0, 0.5, 0.25)[: 2 if kind[0] in "tq" and kind != "tetra10" else 3]
    mesh = fem.box_mesh("block", lengths, (2, 1, 1)[: len(lengths)], kind=kind)
    fem.write_mesh(mesh, tmp_path / "block.inp")
    back = fem.read_mesh(tmp_path / "block.inp")
    assert np.array_equal(back.cells[kind], mesh.cells[kind])


def test_cells_that_abaqus_does_not_have_are_told(tmp_path):
    mesh = fem.box_mesh("block", (1.0, 1.0), (1, 1), kind="quad9")
    with pytest.raises(fem.ModelError, match="no elements for cells of kind 'quad9'"):
        fem.write_mesh(mesh, tmp_path / "block.inp")


def test_elements_of_abaqus_may_go_on_over_lines(tmp_path):
    nodes = fem.box_mesh("b", (1.0, 1.0, 1.0), (1, 1, 1))
    rows = ["*NODE"] + [
        f"{i + 1}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(nodes.points.tolist())
    ]
    cell = [str(i + 1) for i in nodes.cells["hexahedron20"][0]]
    rows += ["*Element, type=C3D20R, elset=cube", f"7, {', '.join(cell[:15])},"]
    rows += [", ".join(cell[15:]), "*NSET, NSET=root", "1, 2"]
    path = tmp_path / "cube.inp"
    path.write_text("\n".join(rows) + "\n")
    mesh = fem.read_mesh(path)
    assert np.array_equal(mesh.cells["hexahedron20"], nodes.cells["hexahedron20"])
    assert mesh.part("cube")["hexahedron20"].tolist() == [0]
    path.write_text("\n".join(rows).replace(f"{cell[-1]}\n*NSET", "\n*NSET") + "\n")
    with pytest.raises(fem.ModelError, match=r"line 23: .*element 7 of type C3D20R has 19 nodes"):
        fem.read_mesh(path)


def block(**options):
    mesh = fem.box_mesh("block", (1.0, 0.2, 0.2), (4, 1, 1), source="block.msh")
    return fem.StructureModel(mesh, **{"parts": {"block": fem.SolidPart(STEEL)}, **options})


def beam_and_sheet(**options):
    mesh = fem.box_mesh("sheet", (1.0, 1.0), (2, 2), source="sheet.msh")
    return fem.StructureModel(
        mesh, **{"parts": {"sheet": fem.SolidPart(STEEL, "stress", 0.1)}, **options}
    )


def folded():
    mesh = fem.box_mesh("block", (1.0, 0.2, 0.2), (2, 1, 1), kind="hexahedron", source="f.msh")
    points = mesh.points.copy()
    points[mesh.cells["hexahedron"][1, 0]] += (2.0, 0.0, 0.0)
    return fem.StructureModel(mesh.with_points(points), {"block": fem.SolidPart(STEEL)})


def held_block(place, directions):
    mesh = fem.box_mesh("bar", (1.0, 0.1, 0.1), (2, 1, 1)).with_point_sets({"corner": [0]})
    support = fem.Support(place, directions)
    return fem.StructureModel(mesh, {"bar": fem.SolidPart(STEEL)}, supports=[support])


def upright(**options):
    mesh = fem.frame_mesh({"a": (0, 0, 0), "b": (0, 0, 1)}, [("mast", "a", "b", 2)], "m.msh")
    section = options.pop("section", fem.RectangularSection(0.1, 0.1))
    return fem.StructureModel(
        mesh, {"mast": fem.BeamPart(options.pop("material", STEEL), section, **options)}
    )


PLAIN = fem.Material(2e11, 8000.0)
UP = {"orientation": (1.0, 0.0, 0.0)}


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: fem.Material(1.0, 1.0, 0.5), "poissons_ratio must be above -1 and below 0.5"),
        (lambda: fem.SolidPart(PLAIN), "solid part: its material needs a poissons_ratio"),
        (lambda: fem.SolidPart(STEEL, "stress"), "thickness must be positive"),
        (lambda: fem.SolidPart(STEEL, None, 0.1), "thickness goes with plane 'stress', 'strain'"),
        (lambda: fem.Coupling("a", "b", "loose"), "kind must be 'rigid' or 'averaging'"),
        (lambda: fem.Coupling("a", "b", directions=("x", "w")), "directions must be out of"),
        (lambda: fem.Coupling("a", "b", "averaging", directions=("x",)), "has all directions"),
        (lambda: fem.Coupling("a", "b", at=(0.0, 1.0)), "at must be 3 finite numbers"),
        (lambda: fem.Foundation("a", (0.0, 0.0, 0.0)), "not be negative and not all zero"),
        (lambda: fem.symmetry("a", "w"), "normal must be 'x', 'y' or 'z'"),
        (lambda: fem.PointMass("a", 0.0, 1.0, offset=(1, 0, 0)), "an offset needs a mass"),
        (lambda: fem.BeamPart(STEEL, None), "section must have an area"),
        (
            lambda: fem.BeamPart(STEEL, fem.CircularSection(1.0), theory="vlasov"),
            "theory must be one of 'euler-bernoulli', 'timoshenko', not 'vlasov'",
        ),
        (
            lambda: fem.BeamPart(STEEL, fem.CircularSection(1.0), orientation=(0, 0, 0)),
            "orientation must not be the zero vector",
        ),
        (lambda: fem.box_mesh("a", (1.0, 1.0), (1, 1, 1)), "do not agree on two or three direct"),
        (lambda: fem.box_mesh("a", (1.0, -1.0), (1, 1)), "must be positive"),
        (lambda: fem.StructureModel(None, {}), "mesh must be a StructureMesh, not None"),
        (lambda: fem.assemble(None), "needs a StructureModel, not None"),
        (lambda: block(parts={}), "block.msh: hexahedron20 0 is in no part of the model"),
        (lambda: block(parts={"b": fem.SolidPart(STEEL)}), "no part 'b'; there are 'block'"),
        (lambda: block(parts={"block": 1}), "parts must be a dictionary by name"),
        (
            lambda: block(parts={"block": fem.BeamPart(STEEL, fem.CircularSection(0.1))}),
            "'block' is a BeamPart and needs cells out of 'line', 'line3', but has 'hexahedron20'",
        ),
        (
            lambda: block(parts={"block": fem.SolidPart(STEEL, "stress", 0.1)}),
            "'block' is a SolidPart and needs cells out of 'quad', .* but has 'hexahedron20'",
        ),
        (lambda: block(supports=[fem.Support("end", "x")]), "no point or face 'end'; there are"),
        (
            lambda: fem.assemble(block(supports=[fem.Support("x0", "rotation_x")])),
            "support at 'x0' holds nothing: its nodes do not have rotation_x",
        ),
        (lambda: block(interfaces={"i": fem.Interface("x1", "y")}), "single point, but holds 8"),
        (lambda: block(hinges=[fem.Hinge("x1", "block")]), "single point, but holds 8"),
        (
            lambda: fem.assemble(
                block(
                    supports=[fem.Support("x0", CLAMPED)],
                    couplings=[fem.Coupling("p", "x0")],
                )
            ),
            "coupling of 'x0' to 'p': a support holds a direction of its face",
        ),
        (
            lambda: fem.assemble(
                block(couplings=[fem.Coupling("p", "x0"), fem.Coupling("q", "y0")])
            ),
            "coupling of 'y0' to 'q': the coupling of 'x0' to 'p' moves some of the same",
        ),
        (
            lambda: fem.assemble(
                block(couplings=[fem.Coupling("p", "x0"), fem.Coupling("q", "y0", "averaging")])
            ),
            "coupling of 'y0' to 'q' rests on nodes that the coupling of 'x0' to 'p' moves",
        ),
        (
            lambda: block(
                couplings=[
                    fem.Coupling("p", "x0", at=(0, 0, 0)),
                    fem.Coupling("p", "x1", at=(0, 0, 0)),
                ]
            ),
            "the mesh has a point of this name; leave out 'at'",
        ),
        (
            lambda: fem.assemble(
                block(
                    couplings=[fem.Coupling("p", "x0", "averaging")],
                    supports=[fem.Support("p", "x")],
                )
            ),
            "a support holds a direction of its point",
        ),
        (
            lambda: fem.assemble(
                fem.StructureModel(
                    block().mesh.with_point_sets({"two": [0, 1]}),
                    block().parts,
                    foundations=[fem.Foundation("two", (0.0, 0.0, 1e6))],
                )
            ),
            "foundation of 'two': there is no outer face, edge or beam whose nodes are all in it",
        ),
        (
            lambda: beam_and_sheet(supports=[fem.Support("x0", "z")]),
            "a structure in the plane has no direction 'z'",
        ),
        (
            lambda: fem.assemble(
                beam_and_sheet(
                    couplings=[fem.Coupling("p", "x0", "averaging")],
                    interfaces={"i": fem.Interface("p", "z")},
                )
            ),
            "interface 'i': a structure in the plane has no direction 'z'",
        ),
        (lambda: fem.assemble(folded()), "f.msh: part 'block': hexahedron: cell 1 of the part, at"),
        (lambda: fem.assemble(upright()), "part 'mast': line 0 runs along z, so it needs an orie"),
        (
            lambda: fem.assemble(upright(orientation=(0.0, 0.0, 2.0))),
            "line 0 runs along its orientation",
        ),
        (
            lambda: fem.assemble(upright(material=PLAIN, **UP)),
            "part 'mast': its material needs a poissons_ratio",
        ),
        (
            lambda: fem.assemble(upright(section=fem.Section(1e-3, 1e-6), **UP)),
            "a beam in space needs the section's second_moment_across",
        ),
        (
            lambda: fem.assemble(
                upright(section=fem.Section(1e-3, 1e-6, 1e-6, 2e-6), theory="timoshenko", **UP)
            ),
            "a Timoshenko beam needs the section's shear_area",
        ),
        (
            lambda: fem.StructureMesh([[0, 0, 0]] * 3, {"triangle": [[0, 1, 3]]}),
            "cells of kind 'triangle' has an index outside 0 to 2",
        ),
        (
            lambda: fem.StructureMesh([[0, 0, 0]] * 3, {"quad": [[0, 1, 2]]}),
            "a cell of kind 'quad' has 4 nodes, not 3",
        ),
        (lambda: fem.StructureMesh([[0, 0, 0]], {}), "the mesh is empty"),
        (lambda: fem.joined([]), "there are no meshes to join"),
        (
            lambda: fem.assemble(held_block("x0", ("x", "rotation_x"))),
            "support at 'x0': its nodes are of solids and have no rotation_x",
        ),
        (
            lambda: fem.assemble(held_block("corner", ("x", "y", "z", "rotation_y"))),
            "support at 'corner': its nodes are of solids and have no rotation_y",
        ),
    ],
)
def test_a_bad_structure_is_one_sentence(make, sentence):
    with pytest.raises(fem.ModelError, match=sentence) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_nodes_in_another_order_are_found_out():
    mesh = fem.box_mesh("block", (1.0, 1.0, 1.0), (1, 1, 1))
    cells = mesh.cells["hexahedron20"][:, [*range(8), *range(16, 20), *range(8, 16)]]
    with pytest.raises(fem.ModelError, match=r"hexahedron20 0 at .* are not near the middle"):
        fem.StructureMesh(mesh.points, {"hexahedron20": cells})


@pytest.mark.parametrize(
    ("attached", "sentence"),
    [
        ({"supports": [fem.Support("a", ("x", "z"))]}, "support at 'a': a structure in the plane"),
        ({"springs": [fem.PointSpring("b", "rotation_x", 1.0)]}, "spring at 'b': a structure in"),
        ({"interfaces": {"i": fem.Interface("b", "z")}}, "interface 'i': a structure in the plane"),
        (
            {"mesh": fem.Attachments(links=[fem.Link("b", None, ("z",), 1.0)])},
            "link at 'b': a structure",
        ),
    ],
)
def test_a_plane_frame_refuses_what_acts_out_of_its_plane(attached, sentence):
    mesh = fem.frame_mesh({"a": (0, 0), "b": (1, 0)}, [("bar", "a", "b", 1)], "bar.msh")
    mesh = replace(mesh, attachments=attached.get("mesh", fem.Attachments()))
    given = {name: items for name, items in attached.items() if name != "mesh"}
    bar = fem.BeamPart(STEEL, fem.CircularSection(0.1))
    with pytest.raises(fem.ModelError, match=sentence):
        fem.StructureModel(mesh, {"bar": bar}, **given, plane=True)


def test_cells_of_an_unknown_kind_are_told_and_not_dropped():
    """One of 64 nodes among others, by kind, count, group and block."""
    block = fem.box_mesh("block", (1.0, 1.0, 1.0), (2, 1, 1), kind="hexahedron27")
    cells = block.cells["hexahedron27"]
    content = meshio.Mesh(
        block.points,
        [("hexahedron27", cells[:1]), ("hexahedron64", np.resize(cells[1:], (1, 64)))],
        cell_data={"set:block": [[1], [1]]},
    )
    with pytest.raises(fem.ModelError, match=r"not read: 1 hexahedron64 \(in 'block'; block 1 of"):
        fem.from_meshio(content)
    content = meshio.Mesh(np.zeros((4, 3)), [("vertex", [[0], [1]])])
    with pytest.raises(fem.ModelError, match=r"no cells \(it has 4 nodes and 2 vertices\)"):
        fem.from_meshio(content)
