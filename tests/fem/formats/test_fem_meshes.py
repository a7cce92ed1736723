"""Reading and writing meshes. The files in data/gmsh* were written by Gmsh 4.15."""

import math
import re
from pathlib import Path

import make_meshes
import meshio
import numpy as np
import pytest
from frames import BAR

import fem
from fem.formats.gmsh import read_gmsh

DATA = Path(__file__).parents[1] / "data"
WHOLE_FILES = ["gmsh22.msh", "gmsh22_binary.msh", "gmsh41.msh", "gmsh41_binary.msh"]


def lengths(mesh, part=None):
    lines = mesh.cells["line"] if part is None else mesh.cells["line"][mesh.part(part)["line"]]
    return np.linalg.norm(mesh.points[lines[:, 1]] - mesh.points[lines[:, 0]], axis=1)


@pytest.mark.parametrize("name", [*WHOLE_FILES, "gmsh_export.inp"])
def test_files_of_gmsh_give_points_lines_parts_and_z(name):
    mesh = fem.read_mesh(DATA / name)
    assert {part: len(mesh.part(part)["line"]) for part in ("beam", "leaf")} == {
        "beam": 3,
        "leaf": 2,
    }
    expected = {"corner": [0, 0, 0.5], "middle": [0.66, 0, 0.5], "foot": [0, -0.12, 0.5]}
    for point, xyz in expected.items():
        assert mesh.points[mesh.node(point)].tolist() == xyz
    assert lengths(mesh, "beam") == pytest.approx(np.full(3, 0.22), rel=1e-11)
    assert lengths(mesh, "leaf") == pytest.approx(np.full(2, 0.06), rel=1e-11)


def test_gmsh_groups_may_overlap_and_have_no_name():
    mesh = fem.read_mesh(DATA / "gmsh41_groups.msh")
    assert len(mesh.part("all")["line"]) == 5
    assert mesh.points[mesh.node("77")].tolist() == [0.66, 0, 0.5]
    with pytest.raises(fem.ModelError, match="line 0 is in more than one part"):
        fem.StructureModel(mesh, {"all": BAR, "beam": BAR}, plane=True)


def test_curves_and_points_without_a_physical_group_are_in_no_part():
    mesh = fem.read_mesh(DATA / "gmsh41_save_all.msh")
    grouped = sum(len(group["line"]) for group in mesh.groups.values())
    assert 0 < grouped < len(mesh.cells["line"])


@pytest.mark.parametrize("name", ["gmsh22.msh", "gmsh41.msh"])
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ((r"(\$Elements.*) \d+ ?\n\$End", r"\1 0\n$End"), "a node that is not there"),
        ((r"(\$Elements.*) \d+ ?\n\$End", r"\1 99\n$End"), "a node that is not there"),
        ((r"(\$Elements.*) \d+ ?\n\$End", r"\1\n$End"), "the numbers of its type|declared"),
        ((r"(\$Elements.*\d) ?\n\$End", r"\1 3\n$End"), "the numbers of its type|goes on after"),
        ((r"\$EndNodes", "$EndNode"), r"\$Nodes has no end"),
        ((r"\$EndNodes\n", "$EndNodes\n6 0 0 0\n"), "text between the sections"),
        ((r"(\$Elements.*)\n[^\n]+\n\$End", r"\1\n$End"), "declared"),
    ],
)
def test_a_file_of_gmsh_that_contradicts_itself_is_refused(tmp_path, name, change, sentence):
    """meshio takes the last node for node 0, and other nodes where an element lacks a number."""
    text = (DATA / name).read_text()
    path = tmp_path / name
    path.write_text(re.sub(*change, text, count=1, flags=re.DOTALL))
    assert path.read_text() != text
    with pytest.raises(fem.ModelError, match=sentence):
        fem.read_mesh(path)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ("1 0 0 x", "'x' is not a number"),
        ("1 0 0 \x1b", r"'\\x1b' is not a number"),
        ("1.5 0 0 0", "'1.5' is not a whole number"),
        ("1 0 0", "2 nodes are declared, but 7 numbers are there"),
    ],
)
def test_a_word_that_is_no_number_is_quoted(tmp_path, wrong, sentence):
    file = tmp_path / "a.msh"
    file.write_text(
        f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n2\n{wrong}\n2 1 0 0\n$EndNodes\n"
        "$Elements\n1\n1 1 2 1 1 1 2\n$EndElements\n"
    )
    with pytest.raises(fem.ModelError, match=sentence):
        fem.read_mesh(file)


@pytest.mark.parametrize("name", sorted(path.name for path in DATA.glob("gmsh*.msh")))
def test_files_of_gmsh_hold_what_meshio_reads(name):
    if name in ("gmsh41_save_all.msh", "gmsh22_groups.msh"):
        pytest.skip("meshio loses which curves have a group, or has cells of two groups twice")
    ours, theirs = read_gmsh(DATA / name), meshio.gmsh.read(DATA / name)
    assert np.array_equal(ours.points, theirs.points)
    for kind in theirs.cells_dict:
        nodes = [block.data for block in ours.cells if block.type == kind]
        assert np.array_equal(np.concatenate(nodes), theirs.cells_dict[kind])
    mine, other = (fem.from_meshio(content) for content in (ours, theirs))
    assert mine.groups.keys() == other.groups.keys()
    for group in mine.groups:
        assert np.array_equal(mine.nodes(group), other.nodes(group))
    assert mine.point_sets.keys() == other.point_sets.keys()


def same_structure(mesh):
    model = make_meshes.half_beam_model(mesh, 0.4)
    return fem.assemble(model)


@pytest.mark.parametrize("extension", [".vtu", ".inp"])
def test_the_half_beam_is_the_same_in_every_format(extension):
    reference = same_structure(fem.read_mesh(make_meshes.HERE / "half_beam.msh"))
    other = same_structure(fem.read_mesh(make_meshes.HERE / f"half_beam{extension}"))
    for name in ("stiffness", "mass"):
        expected, found = getattr(reference, name), getattr(other, name)
        assert abs(found - expected).max() <= 1e-15 * abs(expected).max()
    assert np.array_equal(other.interfaces["middle"], reference.interfaces["middle"])


@pytest.mark.parametrize("extension", [".msh", ".vtu", ".inp"])
def test_a_written_mesh_comes_back_to_the_last_bit(tmp_path, extension):
    mesh = fem.frame_mesh(
        {"a": (1 / 3, 0.1, 0.7), "b": (math.pi, 2e-7, 0.7), "c": (-1e5, math.e, 0.7)},
        [("one", "a", "b", 20), ("two", "b", "c", 3), ("one", "c", "a", 1)],
    )
    fem.write_mesh(mesh, tmp_path / f"mesh{extension}")
    back = fem.read_mesh(tmp_path / f"mesh{extension}")
    assert np.array_equal(back.points, mesh.points)
    assert np.array_equal(back.cells["line"], mesh.cells["line"])
    assert back.groups.keys() == mesh.groups.keys()
    for name in mesh.groups:
        assert back.part(name)["line"].tolist() == mesh.part(name)["line"].tolist()
    expected = {name: nodes.tolist() for name, nodes in mesh.point_sets.items()}
    assert {name: nodes.tolist() for name, nodes in back.point_sets.items()} == expected


def test_nodes_off_a_frame_do_no_harm_and_cells_off_it_are_told():
    content = meshio.Mesh(
        [[9.0, 9.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0]],
        [("triangle", [[1, 2, 3]]), ("line", [[1, 2]])],
        cell_data={"set:rod": [[0], [1]], "set:web": [[1], [0]]},
        point_sets={"tip": [2], "outside": [0, 3]},
    )
    with pytest.raises(fem.ModelError, match="triangle 0 is in no part of the model"):
        fem.StructureModel(fem.from_meshio(content), {"rod": BAR}, plane=True)
    del content.cells[0]
    content.cell_data = {"set:rod": [[1]]}
    mesh = fem.from_meshio(content)
    rod = fem.assemble(fem.StructureModel(mesh, {"rod": BAR}, plane=True))
    assert rod.stiffness.shape == (6, 6) and mesh.node("tip") == 2
    with pytest.raises(fem.ModelError, match="'corner' has no direction 'x': it is on no part"):
        corner = mesh.with_point_sets({"corner": [3]})
        interfaces = {"i": fem.Interface("corner", "x")}
        fem.assemble(fem.StructureModel(corner, {"rod": BAR}, interfaces=interfaces, plane=True))


@pytest.mark.parametrize("mark", [-1, 2, 0.5, float("nan")])
def test_a_mark_of_a_set_that_is_neither_0_nor_1_is_refused(mark):
    points, line = [[0.0, 0.0], [1.0, 0.0]], [("line", [[0, 1]])]
    said = r"array 'set:end' holds .*, but 0 or 1 is expected"
    with pytest.raises(fem.ModelError, match=said):
        fem.from_meshio(meshio.Mesh(points, line, point_data={"set:end": [0, mark]}))
    with pytest.raises(fem.ModelError, match=said):
        fem.from_meshio(meshio.Mesh(points, line, cell_data={"set:end": [[mark]]}))


def test_cells_that_the_reader_would_leave_out_are_an_error(tmp_path):
    points, lines = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [("line", [[0, 1]])]
    path, marks = tmp_path / "bar.vtu", {"set:bar": [[1]]}
    meshio.write(path, meshio.Mesh(points, lines, cell_data=marks), binary=False)
    text = path.read_text()
    types = text.index('Name="types"')
    path.write_text(text[:types] + text[types:].replace("\n3\n", "\n99\n", 1))
    with pytest.raises(fem.ModelError, match=r"cells that are not read: 1 VTK type 99"):
        fem.read_mesh(path)


ABAQUS = """*HEADING
** a frame with everything that is ordinary in such files
*node, nset=all
 10, 0., 0., 1.
 20, 1., , 1.
*Node
 30, 2., 0., 1.
 40, 1., 5., 1.
*Element, type=B31, elset=bar
 1, 10, 20, 40
*ELEMENT, TYPE=b21h,
 ELSET=Bar
 7, 20, 30
*Element, type=T2D2, elset=stay
 9, 30, 40
*Element, type=MASS, elset=lump
 11, 20
*Mass, elset=lump
 2.5,
*Elset, elset=both
 bar, 9
*ELSET, ELSET=odd, GENERATE
 1, 9, 2
*NSET, NSET=ends
 10, tip
*Nset, nset=tip
 30,
*Nset, nset=ends
 40
*STEP
"""


def test_abaqus_sets_grow_nest_and_ignore_case(tmp_path):
    path = tmp_path / "frame.inp"
    path.write_text(ABAQUS)
    mesh = fem.read_mesh(path)
    assert mesh.points.tolist() == [[0, 0, 1], [1, 0, 1], [2, 0, 1], [1, 5, 1]]
    assert mesh.cells["line"].tolist() == [[0, 1], [1, 2], [2, 3]]
    assert {name: group["line"].tolist() for name, group in mesh.groups.items()} == {
        "bar": [0, 1],
        "stay": [2],
        "both": [0, 1, 2],
        "odd": [0, 1, 2],
    }
    assert {name: nodes.tolist() for name, nodes in mesh.point_sets.items()} == {
        "all": [0, 1],
        "tip": [2],
        "ends": [0, 2, 3],
        "node 20": [1],
    }
    assert mesh.attachments.point_masses == (fem.PointMass("node 20", 2.5),)
    assert {name: found["line"].tolist() for name, found in mesh.element_types.items()} == {
        "B31": [0],
        "B21H": [1],
        "T2D2": [2],
    }


def test_abaqus_elements_may_stand_before_their_nodes(tmp_path):
    path = tmp_path / "frame.inp"
    path.write_text("*ELEMENT, TYPE=B23, ELSET=rod\n1, 1, 2\n*NODE\n1, 0, 0\n2, 3, 4\n")
    assert lengths(fem.read_mesh(path)).tolist() == [5.0]


def test_abaqus_includes_another_file(tmp_path):
    (tmp_path / "nodes.inp").write_text("*NODE\n1, 0, 0\n2, 1, 0\n")
    (tmp_path / "main.inp").write_text(
        "*INCLUDE, INPUT=nodes.inp\n*ELEMENT, TYPE=B23, ELSET=rod\n1, 1, 2\n"
    )
    assert lengths(fem.read_mesh(tmp_path / "main.inp")).tolist() == [1.0]


def test_abaqus_file_written_by_meshio_reads_as_meshio_reads_it(tmp_path):
    content = meshio.Mesh(
        [[0.0, 0, 0], [1, 0, 0], [2, 1, 0]],
        [("line", [[0, 1], [1, 2]])],
        cell_sets={"a": [np.array([0])], "b": [np.array([1])]},
        point_sets={"tip": np.array([2])},
    )
    path = tmp_path / "mesh.inp"
    meshio.abaqus.write(path, content)
    ours, theirs = fem.read_mesh(path), fem.from_meshio(meshio.abaqus.read(path))
    assert np.array_equal(ours.cells["line"], theirs.cells["line"])
    assert np.array_equal(ours.points, theirs.points)
    assert ours.groups.keys() == theirs.groups.keys()
    assert ours.node("tip") == theirs.node("tip") == 2


NODES = "*NODE\n1, 0, 0\n2, 1, 0\n3, 2, 0\n"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (NODES, "the mesh has no line elements, surfaces or volumes"),
        ("", "the mesh file is empty"),
        (NODES + "*ELEMENT, TYPE=B22\n1, 1, 2\n", "element 1 of type B22 has 2 nodes where 3"),
        (NODES + "*ELEMENT, TYPE=B21\n1, 1, 8\n", "element 1 ends at node 8, which is not defined"),
        (NODES + "*ELEMENT, TYPE=B21\n1, 1, 2\n1, 2, 3\n", "element 1 is defined twice"),
        (NODES + "*NODE\n1, 5, 5\n", "node 1 is defined twice"),
        (NODES + "*ELEMENT, TYPE=B21\n1, 1, 2\n*NSET, NSET=a\n9\n", "'a' holds node 9"),
        (NODES + "*ELEMENT, TYPE=B21\n1, 1, 2\n*ELSET, ELSET=a\nb\n", "which is not defined"),
        (NODES + "*NSET\n1\n", r"line 5: \*NSET: has no name"),
        (NODES + "*INSTANCE, NAME=i, PART=p\n", "line 5: .* part 'p', which is not defined"),
        ("*INCLUDE, INPUT=no.inp\n", "included file .* does not exist"),
        (NODES + "*ELEMENT, TYPE=B21\n1, 1\n", "element 1 of type B21 has 1 nodes where"),
        ("*NODE\n1, zero, 0\n", r"line 2: \*NODE: 'zero' is not a number"),
        ("*NODE\none, 0, 0\n", r"line 2: \*NODE: 'one' is not a whole number"),
        (NODES + "*ELEMENT, TYPE=B21\n1, 1, 1\n", "has a node twice"),
        ("*NODE\n1, nan, 0\n2, 1, 0\n*ELEMENT, TYPE=B21\n1, 1, 2\n", "node 0 .* not finite"),
    ],
)
def test_a_bad_abaqus_file_is_one_sentence_with_its_name(tmp_path, text, sentence):
    path = tmp_path / "bad.inp"
    path.write_text(text)
    with pytest.raises(fem.ModelError, match=sentence) as caught:
        fem.read_mesh(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_an_element_of_two_groups_is_one_element():
    """Version 2.2 writes it once for each group."""
    mesh = fem.read_mesh(DATA / "gmsh22_groups.msh")
    lines, groups = mesh.cells["line"], [group["line"] for group in mesh.groups.values()]
    assert len(lines) == len(np.unique(np.sort(lines, axis=1), axis=0))
    assert np.unique(np.concatenate(groups)).tolist() == list(range(len(lines)))
    assert sum(map(len, groups)) > len(lines)


@pytest.mark.parametrize("name", ["missing.msh", "missing.vtu", "missing.inp"])
def test_a_missing_file_is_named(tmp_path, name):
    with pytest.raises(fem.ModelError, match=f"{name}: there is no such mesh file"):
        fem.read_mesh(tmp_path / name)


def test_an_unknown_extension_is_named(tmp_path):
    known = (
        "'.stl'; known are '.msh', '.vtu', '.vtk', '.med', '.unv', '.inp', '.bdf', '.dat', '.nas'"
    )
    with pytest.raises(fem.ModelError, match=re.escape(known)):
        fem.read_mesh(tmp_path / "mesh.stl")
    mesh = fem.frame_mesh({"a": (0, 0), "b": (1, 0)}, [("rod", "a", "b", 1)])
    with pytest.raises(fem.ModelError, match=r"'.stl'; known are"):
        fem.write_mesh(mesh, tmp_path / "mesh.stl")


@pytest.mark.parametrize("extension", [".msh", ".vtu", ".inp"])
@pytest.mark.parametrize("content", [b"", b"\x00\xff\xfe nonsense", b"<xml>", b"$MeshFormat\n"])
def test_nonsense_in_a_file_is_one_sentence(tmp_path, extension, content):
    path = tmp_path / f"nonsense{extension}"
    path.write_bytes(content)
    with pytest.raises(fem.ModelError) as caught:
        fem.read_mesh(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", WHOLE_FILES)
def test_a_file_that_is_cut_off_is_refused(tmp_path, name):
    whole = (DATA / name).read_bytes()
    path = tmp_path / name
    for end in range(len("$MeshFormat"), whole.rindex(b"$EndElements"), 7):
        path.write_bytes(whole[:end])
        with pytest.raises(fem.ModelError, match="cut off"):
            fem.read_mesh(path)


GMSH = b"$MeshFormat\n%s 0 8\n$EndMeshFormat\n%s\n0\n$EndNodes\n$Elements\n0\n$EndElements\n"


@pytest.mark.parametrize(
    ("name", "content", "sentence"),
    [
        ("a.vtu", b"", "the mesh file is empty"),
        ("a.vtu", b'<VTKFile type="UnstructuredGrid">', "damaged or cut off"),
        ("a.msh", b"<VTKFile>", r"is not a Gmsh file \(there is no \$MeshFormat\)"),
        ("a.msh", b"$NOD\n1\n1 0 0 0\n$ENDNOD\n", "of version 1; export it as 4.1 or 2.2"),
        ("a.msh", GMSH % (b"4", b"$Nodes"), r"its version is 4; export it as 4\.1 or 2\.2"),
        ("a.msh", GMSH % (b"2.2", b"$New\n0\n$EndNew\n$Nodes"), r"its section \$New is not under"),
        ("a.inp", b"<VTKFile>", r"is not an Abaqus input file with nodes \(there is no \*NODE\)"),
        ("a.inp", b"*NODE\n1,0\n*NSET, NSET=q, GENERATE\n1,9999999999\n", "'q' cannot run from 1"),
        ("a.inp", b"*NODE\n1,0\n*NSET, NSET=q, GENERATE\n1,2,0\n", "cannot run from 1 to 2 by 0"),
        ("a.inp", b"*NODE\n1,0\n2,1e99\n*ELEMENT,TYPE=B21\n1,1,2\n", "node 1 .* below 1e.50 m"),
    ],
)
def test_what_is_wrong_with_a_file_is_told(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(fem.ModelError, match=sentence):
        fem.read_mesh(tmp_path / name)


@pytest.mark.parametrize("again", ["1 1 2 1 1 2 3", "1 15 2 1 1 2"])
def test_a_number_of_two_gmsh_elements_is_refused(tmp_path, again):
    path = tmp_path / "rod.msh"
    text = (
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 2 0 0\n$EndNodes\n"
        f"$Elements\n2\n1 1 2 1 1 1 2\n{again}\n$EndElements\n"
    )
    path.write_text(text)
    with pytest.raises(fem.ModelError, match="two elements have the number 1"):
        fem.read_mesh(path)
    path.write_text(text.replace(again, f"2{again[1:]}"))
    assert lengths(fem.read_mesh(path)).tolist() == [1.0] * (2 if again.endswith("3") else 1)


@pytest.mark.parametrize("name", ["gmsh22.msh", "gmsh41.msh", "gmsh_export.inp"])
def test_a_file_with_a_hole_never_ends_in_a_traceback(tmp_path, name):
    whole = (DATA / name).read_bytes()
    path = tmp_path / name
    for start in range(0, len(whole), 11):
        path.write_bytes(whole[:start] + whole[start + 5 :])
        try:
            fem.read_mesh(path)
        except fem.ModelError as error:
            assert str(error).startswith(str(path))


LINE = {"points": [[0, 0, 0], [1, 0, 0], [2, 0, 0]], "cells": {"line": [[0, 1], [1, 2]]}}


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"points": np.zeros((0, 3)), "cells": {}}, "the mesh is empty"),
        ({"cells": {"line": np.zeros((0, 2))}}, "the mesh is empty"),
        ({"points": [["x", 0, 0], [1, 0, 0]]}, "my.msh: points must be numbers"),
        ({"points": [[0, 0, 0], [1, 0]]}, "points must be numbers, as many in each row"),
        ({"cells": {"line": [["a", "b"]]}}, "my.msh: cells of kind 'line' must be numbers"),
        ({"groups": {"p": {"line": ["a"]}}}, "my.msh: group 'p' 'line' must be numbers"),
        ({"points": [[0, 0], [1, 0]]}, r"points must have shape \(n, 3\)"),
        ({"cells": {"line": [[0, 1, 2]]}}, "a cell of kind 'line' has 2 nodes, not 3"),
        ({"points": [[0, 0, 0], [1, math.nan, 0], [2, 0, 0]]}, "coordinates of node 1"),
        ({"cells": {"line": [[0, 1], [1, 3]]}}, "kind 'line' has an index outside 0 to 2"),
        ({"groups": {"p": {"line": [5]}}}, "group 'p' has an index outside 0 to 1"),
        ({"point_sets": {"p": [-1]}}, "point set 'p' has an index outside 0 to 2"),
    ],
)
def test_a_bad_mesh_is_one_sentence(change, sentence):
    with pytest.raises(fem.ModelError, match=sentence):
        fem.StructureMesh(**{**LINE, **change}, source="my.msh")


@pytest.mark.parametrize(
    ("points", "members", "sentence"),
    [
        ({"a": (0, 0)}, [("rod", "a", "b", 1)], "ends at no point 'b'"),
        ({"a": (0, 0), "b": (1, 0)}, [("rod", "a", "b", 0)], "has 0 elements"),
        ({"a": (0, 0), "b": (1, 0)}, [("rod", "a", "b", "2")], "has '2' elements"),
        ({"a": (0, "y"), "b": (1, 0)}, [("rod", "a", "b", 1)], "coordinates of point 'a' must be"),
        ({"a": (0, 0), "b": (1,)}, [("rod", "a", "b", 1)], "'b' needs two or three coordinates"),
        ({}, [], "the mesh is empty"),
    ],
)
def test_a_bad_member_is_one_sentence(points, members, sentence):
    with pytest.raises(fem.ModelError, match=sentence):
        fem.frame_mesh(points, members)


def test_a_mesh_cannot_be_changed():
    mesh = fem.StructureMesh(**LINE, groups={"p": {"line": [0]}})
    for array in (mesh.points, mesh.cells["line"], mesh.groups["p"]["line"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize("extension", [".msh", ".vtu", ".inp"])
def test_a_folder_that_is_not_there_is_one_sentence_with_the_path_given(tmp_path, extension):
    target = tmp_path / "none" / f"mesh{extension}"
    with pytest.raises(fem.ModelError, match=f"^{target}: cannot be written: no such file or"):
        fem.write_mesh(fem.StructureMesh(**LINE), target)


def test_gmsh_cannot_be_written_with_overlapping_parts(tmp_path):
    mesh = fem.StructureMesh(**LINE, groups={"a": {"line": [0, 1]}, "b": {"line": [1]}})
    with pytest.raises(fem.ModelError, match="'b' overlaps another"):
        fem.write_mesh(mesh, tmp_path / "mesh.msh")
    mesh = fem.StructureMesh(**LINE, groups={"a": {"line": [0, 1]}}, point_sets={"a": [1]})
    with pytest.raises(fem.ModelError, match="'a' names both a group and a point"):
        fem.write_mesh(mesh, tmp_path / "mesh.msh")
