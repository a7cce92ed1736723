"""What a mesh says of itself: pieces, cells that stand twice, names, places, what was read."""

from __future__ import annotations

import re
from dataclasses import replace

import meshio
import numpy as np
import pytest
import pyvista
from scipy.linalg import eigh
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

import fem
from fem.assembly.summary import volume
from fem.mesh.cells import KINDS

STEEL = fem.Material(2.1e11, 7800.0, 0.3)
BAR = {"bar": fem.SolidPart(STEEL)}
ENDS = [fem.Support("left", ("x", "y", "z")), fem.Support("right", ("x", "y", "z"))]


def two_boxes(distance: float = 0.0) -> fem.StructureMesh:
    """Two bars of 0.5 m one after the other, whose nodes are not merged."""
    first, second = (
        fem.box_mesh("bar", (0.5, 0.05, 0.05), (4, 1, 1), origin=(x, 0.0, 0.0))
        for x in (0.0, 0.5 + distance)
    )
    count = len(first.points)
    kind = "hexahedron20"
    return fem.StructureMesh(
        np.vstack([first.points, second.points]),
        {kind: np.vstack([first.cells[kind], second.cells[kind] + count])},
        {"bar": {kind: np.arange(8)}},
        {"left": first.point_sets["x0"], "right": second.point_sets["x1"] + count},
        "boxes",
    )


def lowest_hz(component) -> float:
    squares = eigh(component.stiffness.toarray(), component.mass.toarray(), eigvals_only=True)
    return float(np.sqrt(squares[0]) / (2.0 * np.pi))


def test_pieces_that_touch_but_share_no_node_are_refused():
    model = fem.StructureModel(two_boxes(), BAR, supports=ENDS)
    with pytest.raises(
        fem.ModelError,
        match=r"boxes: 2 pieces of the mesh touch but share no node: 16 nodes are at the place of"
        r" another one, the first at \(0.5, ",
    ):
        fem.assemble(model)
    assert fem.pieces_of(model).count == 2


def test_merged_they_are_one_bar_and_separate_two():
    whole = fem.box_mesh("bar", (1.0, 0.05, 0.05), (8, 1, 1))
    held = [fem.Support(point, ("x", "y", "z")) for point in ("x0", "x1")]
    expected = lowest_hz(fem.assemble(fem.StructureModel(whole, BAR, supports=held)))
    merged = fem.joined([two_boxes()])
    found = lowest_hz(fem.assemble(fem.StructureModel(merged, BAR, supports=ENDS)))
    assert found == pytest.approx(expected, rel=1e-9)
    half = fem.box_mesh("bar", (0.5, 0.05, 0.05), (4, 1, 1))
    clamped = lowest_hz(fem.assemble(fem.StructureModel(half, BAR, supports=held[:1])))
    apart = fem.StructureModel(two_boxes(), BAR, supports=ENDS, separate=True)
    assert lowest_hz(fem.assemble(apart)) == pytest.approx(clamped, rel=1e-9)
    said = fem.summary(fem.assemble(apart))
    assert "the model is in 2 pieces that are not joined: 56 nodes from (0, 0, 0) to" in said
    assert "16 nodes of different pieces are at the place of another node" in said


def test_pieces_at_a_distance_are_told():
    model = fem.StructureModel(two_boxes(0.1), BAR, supports=ENDS)
    assert "the model is in 2 pieces that are not joined" in fem.summary(fem.assemble(model))


def test_merging_tells_how_many_nodes_and_how_far():
    assert fem.joined([two_boxes()]).notes == ("8 nodes are merged into others, at most 0 m away",)
    assert fem.joined([two_boxes(0.001)], 0.002).notes == (
        "8 nodes are merged into others, at most 0.001 m away",
    )


def test_springs_between_nodes_that_are_merged_are_refused():
    boxes = two_boxes()
    touching = fem.pieces_of(fem.StructureModel(boxes, BAR)).touching[0]
    places = {"a": [touching[0]], "b": [touching[1]], "far": [0]}
    mesh = replace(
        boxes.with_point_sets(places),
        attachments=fem.Attachments(links=[fem.Link("a", "b", ("x", "x"), stiffness=1e6)]),
    )
    with pytest.raises(
        fem.ModelError,
        match=r"boxes: 1 springs or dampers are between nodes that are merged .*: 'a' and 'b'; do",
    ):
        fem.joined([mesh])
    kept = [fem.Link("far", "b", ("x", "x"), stiffness=1e6), fem.Link("a", None, ("x",), 1e6)]
    merged = fem.joined([replace(mesh, attachments=fem.Attachments(links=kept))])
    assert list(merged.attachments.links) == kept


@pytest.mark.parametrize("order", [[0, 1, 2, 3, 4, 5, 6, 7], [1, 2, 3, 0, 5, 6, 7, 4]])
def test_a_cell_that_stands_twice_is_refused(order):
    box = fem.box_mesh("bar", (1.0, 0.1, 0.1), (3, 1, 1), kind="hexahedron")
    cells = box.cells["hexahedron"]
    mesh = fem.StructureMesh(
        box.points,
        {"hexahedron": np.vstack([cells, cells[1:2, order]])},
        {"bar": {"hexahedron": np.arange(4)}},
    )
    with pytest.raises(
        fem.ModelError,
        match=r"mesh: hexahedron 3 at \(0.5, 0.05, 0.05\) stands twice, also as hexahedron 1",
    ):
        fem.StructureModel(mesh, BAR)


def test_solids_of_two_parts_may_not_be_one_but_beams_may():
    box = fem.box_mesh("bar", (1.0, 0.1, 0.1), (1, 1, 1))
    kind = "hexahedron20"
    mesh = fem.StructureMesh(
        box.points,
        {kind: np.vstack([box.cells[kind]] * 2), "line": np.array([[0, 1], [0, 1]])},
        {"bar": {kind: [0]}, "again": {kind: [1]}, "a": {"line": [0]}, "b": {"line": [1]}},
    )
    with pytest.raises(fem.ModelError, match=r"hexahedron20 1 at .* stands twice, also as"):
        fem.StructureModel(mesh, {name: BAR["bar"] for name in ("bar", "again")})
    beam = fem.BeamPart(STEEL, fem.CircularSection(0.01))
    lines = fem.frame_mesh({"p": (0, 0), "q": (1, 0)}, [("a", "p", "q", 1)])
    twice = fem.StructureMesh(
        lines.points,
        {"line": np.array([[0, 1], [0, 1]])},
        {"a": {"line": [0]}, "b": {"line": [1]}},
        lines.point_sets,
    )
    held = [fem.Support("p", ("x", "y", "z", "rotation", "rotation_x", "rotation_y"))]
    single = fem.assemble(fem.StructureModel(lines, {"a": beam}, supports=held))
    double = fem.assemble(fem.StructureModel(twice, {"a": beam, "b": beam}, supports=held))
    assert (
        abs(double.stiffness - 2.0 * single.stiffness).max() <= 1e-12 * abs(single.stiffness).max()
    )


GMSH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
3
1 7 "edge"
2 8 "edge"
3 9 "body"
$EndPhysicalNames
$Nodes
4
1 0 0 0
2 1 0 0
3 0 1 0
4 0 0 1
$EndNodes
$Elements
{count}
1 1 2 7 1 1 2
2 2 2 8 1 1 2 3
3 4 2 9 1 1 2 3 4
{more}$EndElements
"""


def test_a_name_of_a_curve_and_of_a_surface_means_neither(tmp_path):
    path = tmp_path / "two.msh"
    path.write_text(GMSH.format(count=3, more=""))
    mesh = fem.read_mesh(path)
    assert set(mesh.groups) == {"edge (curve)", "edge (surface)", "body"}
    assert mesh.nodes("edge (curve)").tolist() == [0, 1]
    assert mesh.nodes("edge (surface)").tolist() == [0, 1, 2]
    with pytest.raises(fem.ModelError, match=r"there is no point or face 'edge'; there are .*cur"):
        mesh.nodes("edge")


def test_an_element_written_once_for_each_of_two_groups_counts_once(tmp_path):
    path = tmp_path / "two.msh"
    path.write_text(GMSH.format(count=4, more="4 4 2 11 1 1 2 3 4\n"))
    mesh = fem.read_mesh(path)
    assert len(mesh.cells["tetra"]) == 1
    assert mesh.part("body").keys() == mesh.part("11").keys() == {"tetra"}
    model = fem.StructureModel(mesh, {"body": fem.SolidPart(STEEL)})
    assert fem.mass_properties(fem.assemble(model)).mass == pytest.approx(7800.0 / 6.0, rel=1e-12)


def test_one_of_another_volume_with_the_same_nodes_is_refused(tmp_path):
    path = tmp_path / "two.msh"
    path.write_text(GMSH.format(count=4, more="4 4 2 9 2 1 2 3 4\n"))
    with pytest.raises(fem.ModelError, match=r"tetra 1 at .* stands twice"):
        fem.StructureModel(fem.read_mesh(path), {"body": fem.SolidPart(STEEL)})


def test_a_name_of_points_and_of_other_cells_is_told_apart():
    box = fem.box_mesh("bar", (1.0, 0.1, 0.1), (2, 1, 1))
    mesh = box.with_point_sets({"bar": [0, 1]})
    with pytest.raises(fem.ModelError, match="'bar' means two things, a set of 2 points and a"):
        mesh.nodes("bar")
    assert mesh.nodes("bar (points)").tolist() == [0, 1]
    assert len(mesh.nodes("bar (cells)")) == len(box.points)
    same = box.with_point_sets({"bar": np.arange(len(box.points))})
    assert len(same.nodes("bar")) == len(box.points)


def content() -> meshio.Mesh:
    """A square of two triangles, one of which is in no group, and a line beside it."""
    return meshio.Mesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [("triangle", [[0, 1, 2], [0, 2, 3]]), ("line", [[0, 1]])],
        cell_data={"set:sheet": [[1, 0], [0]], "set:edge": [[0, 0], [1]]},
        point_data={"set:corner": [1, 0, 0, 0]},
    )


@pytest.mark.parametrize(
    ("ignore", "left"),
    [
        (["ungrouped"], {"triangle": 1, "line": 1}),
        (["line"], {"triangle": 2}),
        (["edge"], {"triangle": 2}),
        (["sheet", "ungrouped"], {"line": 1}),
    ],
)
def test_cells_are_left_out_by_name_and_told(tmp_path, ignore, left):
    path = tmp_path / "square.vtu"
    meshio.write(path, content())
    mesh = fem.read_mesh(path, ignore=ignore)
    assert {kind: len(cells) for kind, cells in mesh.cells.items()} == left
    assert len(mesh.notes) == len(ignore)
    assert mesh.nodes("corner").tolist() == [0]
    for name, cells in (("sheet", "triangle"), ("edge", "line")):
        if name in mesh.groups:
            assert mesh.part(name)[cells].tolist() == [0]


def test_a_frame_reads_without_the_surfaces_that_are_to_be_ignored(tmp_path):
    path = tmp_path / "square.vtu"
    meshio.write(path, content())
    mesh = fem.read_mesh(path, ignore=["triangle"])
    assert {kind: len(cells) for kind, cells in mesh.cells.items()} == {"line": 1}
    assert list(mesh.notes) == ['2 triangle left out, as "triangle" is to be ignored']


def test_a_name_to_ignore_that_is_not_there_is_refused(tmp_path):
    path = tmp_path / "square.vtu"
    meshio.write(path, content())
    with pytest.raises(
        fem.ModelError,
        match="there is no cell of 'plate' to ignore; there are 'sheet', 'edge', 'triangle', ",
    ):
        fem.read_mesh(path, ignore=["plate"])


def test_places_by_coordinates_and_by_a_box():
    mesh = fem.box_mesh("bar", (1.0, 0.1, 0.2), (2, 1, 1))
    assert mesh.points[fem.node_at(mesh.points, (1.0, 0.1, 0.2), "m")[0]].tolist() == [
        1.0,
        0.1,
        0.2,
    ]
    face = fem.nodes_inside(mesh.points, ((1.0, -1.0, -1.0), (2.0, 1.0, 1.0)), "m")
    assert face.tolist() == mesh.point_sets["x1"].tolist()
    with pytest.raises(fem.ModelError, match=r"no node is at \(0.9, 0, 0\); the nearest one, at"):
        fem.node_at(mesh.points, (0.9, 0.0, 0.0), "m")
    with pytest.raises(fem.ModelError, match=r"no node is in the box from \(2, 0, 0\)"):
        fem.nodes_inside(mesh.points, ((2.0, 0.0, 0.0), (3.0, 1.0, 1.0)), "m")
    with pytest.raises(fem.ModelError, match="is empty"):
        fem.nodes_inside(mesh.points, ((2.0, 0.0, 0.0), (1.0, 1.0, 1.0)), "m")


def test_mass_and_centre_of_a_structure_with_an_offset_mass():
    """A block of 7800 kg/m³ and a lump beside it, whatever is held."""
    model = fem.StructureModel(
        fem.box_mesh("bar", (1.0, 0.2, 0.1), (2, 2, 1), origin=(1.0, 2.0, 3.0)),
        BAR,
        supports=[fem.Support("x0", ("x", "y", "z"))],
        couplings=[fem.Coupling("hub", "x1")],
        point_masses=[fem.PointMass("hub", 44.0, 0.1, (0.5, 0.25, -0.125))],
    )
    block, lump = 7800.0 * 0.02, 44.0
    hub = np.array([2.5, 2.35, 2.925])
    centre = (block * np.array([1.5, 2.1, 3.05]) + lump * hub) / (block + lump)
    found = fem.mass_properties(fem.assemble(model))
    assert found.mass == pytest.approx(block + lump, rel=1e-11)
    assert found.centre == pytest.approx(centre, rel=1e-9)


def test_mass_and_centre_of_a_frame():
    mesh = fem.frame_mesh(
        {"a": (0, 0), "b": (3, 0), "c": (3, 4)}, [("beam", "a", "b", 2), ("post", "b", "c", 3)]
    )
    section = fem.RectangularSection(0.1, 0.2)
    model = fem.StructureModel(
        mesh,
        {"beam": fem.BeamPart(STEEL, section), "post": fem.BeamPart(STEEL, section)},
        supports=[fem.Support("a", ("x", "y", "rotation"))],
        point_masses=[fem.PointMass("c", 100.0)],
        plane=True,
    )
    beam, post = 7800.0 * 0.02 * 3.0, 7800.0 * 0.02 * 4.0
    total = beam + post + 100.0
    found = fem.mass_properties(fem.assemble(model))
    assert found.mass == pytest.approx(total, rel=1e-11)
    assert found.centre == pytest.approx(
        ((1.5 * beam + 3.0 * post + 300.0) / total, (2.0 * post + 400.0) / total, 0.0), rel=1e-9
    )


@pytest.mark.parametrize("kind", ["tetra", "tetra10", "triangle", "triangle6"])
def test_cells_that_are_turned_over_are_refused_and_mirrored_ones_taken(kind):
    """The middle node beyond its neighbours: the volumes of the cells are more than the body's."""
    size = 2 if kind.startswith("triangle") else 3
    box = fem.box_mesh("bar", (1.0,) * size, (2,) * size, kind=kind)
    part = fem.SolidPart(STEEL, "stress", 1.0) if size == 2 else fem.SolidPart(STEEL)
    corners = KINDS[kind].corners.shape[0]
    first = fem.StructureModel(box, {"bar": part})
    middle = np.flatnonzero(np.abs(box.points[:, :size] - 0.5).max(axis=1) < 1e-9)[0]
    points = box.points.copy()
    points[middle, 0] = 1.3
    for cells in box.cells.values():  # nodes on edges stay in the middle
        points[cells] = KINDS[kind].filled(points[cells[:, :corners]])
    folded = fem.StructureModel(box.with_points(points), {"bar": part})
    assert volume(folded) > 1.1 > volume(first)
    with pytest.raises(fem.ModelError, match=rf"pairs of cells overlap, .* {kind} \d+ at .*folded"):
        fem.assemble(folded)
    order = {"tetra": [1, 0, 2, 3], "tetra10": [1, 0, 2, 3, 4, 6, 5, 8, 7, 9]}
    order |= {"triangle": [1, 0, 2], "triangle6": [1, 0, 2, 3, 5, 4]}
    mirrored = box.cells[kind].copy()
    mirrored[::2] = mirrored[::2][:, order[kind]]
    turned = replace(box, cells={kind: mirrored})
    found = fem.mass_properties(fem.assemble(fem.StructureModel(turned, {"bar": part}))).mass
    assert found == pytest.approx(7800.0, rel=1e-12)


def test_the_volume_of_every_kind_of_part_is_told():
    rod = fem.frame_mesh({"a": (0, 0), "b": (3, 0)}, [("bar", "a", "b", 3)])
    round_bars = fem.CircularSection(0.2), fem.CircularSection(0.1)
    cone = fem.BeamPart(STEEL, fem.TaperedSection(*round_bars, "a", "b"))
    box = fem.box_mesh("bar", (1.0, 0.2, 0.1), (2, 2, 1))
    sheet = fem.box_mesh("bar", (1.0, 0.2), (2, 2))
    for model, expected in (
        (fem.StructureModel(box, BAR), 0.02),
        (fem.StructureModel(sheet, {"bar": fem.SolidPart(STEEL, "stress", 0.03)}), 0.006),
        (fem.StructureModel(sheet, {"bar": fem.ShellPart(STEEL, 0.01)}), 0.002),
        (fem.StructureModel(rod, {"bar": fem.TrussPart(STEEL, 0.004)}), 0.012),
        (fem.StructureModel(rod, {"bar": cone}), np.pi / 4.0 * 0.07),
        (fem.StructureModel(rod, {"bar": cone}, plane=True), np.pi / 4.0 * 0.07),
        (fem.StructureModel(rod, {"bar": fem.TrussPart(STEEL, 0.004)}, plane=True), 0.012),
    ):
        assert volume(model) == pytest.approx(expected, rel=1e-12)
    assert "\nvolume: 0.02 m³\n" in fem.summary(fem.assemble(fem.StructureModel(box, BAR)))


def test_a_line_that_is_no_edge_of_a_solid_is_lost_and_one_that_is_names_a_place():
    box = fem.box_mesh("bar", (1.0, 0.1, 0.1), (1, 1, 1), kind="hexahedron")
    (cell,) = box.cells["hexahedron"]

    def with_line(ends):
        cells = {**box.cells, "line": np.array([ends])}
        return fem.StructureMesh(box.points, cells, {**box.groups, "brace": {"line": [0]}})

    edge = fem.StructureModel(with_line([cell[0], cell[1]]), BAR)
    assert edge.mesh.nodes("brace").tolist() == sorted([cell[0], cell[1]])
    far = len(box.points)
    mesh = fem.StructureMesh(
        np.vstack([box.points, [[2.0, 0.0, 0.0]]]),
        {**box.cells, "line": np.array([[cell[1], far]])},
        {**box.groups, "brace": {"line": [0]}},
    )
    with pytest.raises(
        fem.ModelError, match=r"1 line \(in 'brace'\) are in no part of the model, the first line 0"
    ):
        fem.StructureModel(mesh, BAR)


def test_a_slit_within_one_piece_is_told():
    """Two boxes joined by a coupling of their far ends, with unmerged nodes between them."""
    mesh = two_boxes()
    ends = np.concatenate([mesh.point_sets["left"], mesh.point_sets["right"]])
    mesh = mesh.with_point_sets({"ends": ends})
    model = fem.StructureModel(mesh, BAR, couplings=[fem.Coupling("frame", "ends")])
    with pytest.warns(fem.JointWarning, match="16 nodes are at the place of another one that they"):
        fem.assemble(model)


@pytest.mark.parametrize("mark", [1, 8, 32])
def test_ghosts_of_vtk_are_refused(tmp_path, mark):
    name = "vtkGhostType"
    for extension in (".vtu", ".vtk"):
        path = tmp_path / f"square{extension}"
        marked = content()
        marked.cell_data[name] = [
            np.full(len(block.data), mark * (block.type == "triangle")) for block in marked.cells
        ]
        meshio.write(path, marked)
        with pytest.raises(fem.ModelError, match=rf"'{name}' says that 2 cells .* are hidden"):
            fem.read_mesh(path)
        marked.cell_data[name] = [np.zeros(len(block.data), int) for block in marked.cells]
        meshio.write(path, marked)
        assert len(fem.read_mesh(path).cells["triangle"]) == 2


@pytest.mark.parametrize("place", ["<Piece", "<Points>"])
def test_what_a_vtk_file_says_of_the_whole_is_passed_over(tmp_path, place):
    """ParaView writes the time of a step there, and texts."""
    path = tmp_path / "square.vtu"
    meshio.write(path, content(), binary=False)
    time = (
        '<FieldData><DataArray type="Float64" Name="TimeValue" NumberOfTuples="1" format="ascii">'
        "0.5</DataArray></FieldData>"
    )
    plain = fem.read_mesh(path)
    path.write_text(path.read_text().replace(place, time + place))
    assert (fem.read_mesh(path).points == plain.points).all()


@pytest.mark.parametrize("compressed", [False, True])
def test_appended_data_of_the_whole_are_passed_over(tmp_path, compressed):
    """As ParaView writes the time of a step, with blanks after the offsets."""
    box = fem.box_mesh("bar", (1.0, 0.1, 0.1), (4, 1, 1), kind="hexahedron")
    grid = pyvista.UnstructuredGrid({12: box.cells["hexahedron"]}, box.points)
    grid.field_data["TimeValue"] = np.array([0.5])
    path = tmp_path / "bar.vtu"
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(grid)
    writer.SetDataModeToAppended()
    writer.EncodeAppendedDataOff()
    if not compressed:
        writer.SetCompressorTypeToNone()
    assert writer.Write()
    text = path.read_bytes()
    assert b"<FieldData>" in text and b'format="appended"' in text
    path.write_bytes(re.sub(rb'(offset="\d+)"', rb'\1     "', text))
    found = fem.read_mesh(path)
    assert (found.points == box.points).all()
    assert (found.cells["hexahedron"] == box.cells["hexahedron"]).all()


def test_the_advice_for_other_vtk_files_makes_them_readable(tmp_path):
    plane = pyvista.Plane(i_resolution=2, j_resolution=1)
    plane.save(tmp_path / "plane.vtk")
    with pytest.raises(fem.ModelError, match=r"holds POLYDATA.*cast_to_unstructured_grid\(\)"):
        fem.read_mesh(tmp_path / "plane.vtk")
    pyvista.read(tmp_path / "plane.vtk").cast_to_unstructured_grid().save(tmp_path / "mesh.vtu")
    assert len(fem.read_mesh(tmp_path / "mesh.vtu").cells["quad"]) == 2
    meshio.write(tmp_path / "one.vtu", content(), binary=False)
    text = (tmp_path / "one.vtu").read_text()
    piece = text[text.index("<Piece") : text.index("</UnstructuredGrid>")]
    (tmp_path / "two.vtu").write_text(text.replace(piece, 2 * piece))
    with pytest.raises(fem.ModelError, match=r"has 2 pieces, not one; pyvista\.read\(file\)\.save"):
        fem.read_mesh(tmp_path / "two.vtu")
    pyvista.read(tmp_path / "two.vtu").save(tmp_path / "joined.vtu")
    one, both = (fem.read_mesh(tmp_path / f"{name}.vtu") for name in ("one", "joined"))
    for kind, cells in one.cells.items():
        assert len(both.cells[kind]) == 2 * len(cells)
