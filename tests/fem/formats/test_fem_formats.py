"""One mesh in several formats is one component, with the same names."""

from __future__ import annotations

import h5py
import meshio
import numpy as np
import pytest
import pyvista as pv
from structures import lowest_hz
from universal_files import write_unv
from with_gmsh import gmsh_at_work

import fem
from fem.formats.med import KINDS
from fem.mesh.cells import KINDS as KINDS_OF_CELLS

STEEL = fem.Material(2.1e11, 7800.0, 0.3)


def block() -> fem.StructureMesh:
    """Two parts of second-order solids, a face and two sets of points."""
    mesh = fem.box_mesh("whole", (0.4, 0.1, 0.05), (4, 2, 1))
    kind = "hexahedron20"
    face = mesh.cells[kind][:, [0, 1, 5, 4, 8, 17, 12, 16]]
    root = face[(mesh.points[face][..., 1] == 0.0).all(axis=1)]
    return fem.StructureMesh(
        mesh.points,
        {kind: mesh.cells[kind], "quad8": root},
        {
            "left": {kind: np.arange(4)},
            "right": {kind: np.arange(4, 8)},
            "skin": {"quad8": np.arange(len(root))},
        },
        {"root": mesh.point_sets["x0"], "tip": mesh.point_sets["x1"][:1]},
    )


def as_meshio(mesh: fem.StructureMesh) -> meshio.Mesh:
    """The mesh as meshio has it, with names as arrays."""
    kinds = list(mesh.cells)
    marks = {
        f"set:{name}": [
            np.isin(np.arange(len(mesh.cells[kind])), group.get(kind, [])).astype(int)
            for kind in kinds
        ]
        for name, group in mesh.groups.items()
    }
    points = {
        f"set:{name}": np.isin(np.arange(len(mesh.points)), nodes).astype(int)
        for name, nodes in mesh.point_sets.items()
    }
    return meshio.Mesh(
        mesh.points, [(kind, mesh.cells[kind]) for kind in kinds], points, cell_data=marks
    )


def write_med(mesh: fem.StructureMesh, path) -> None:
    """As Salome writes it: the kinds of cells that are in no group have no families."""
    names = {kind: name for name, kind in KINDS.items()}
    with h5py.File(path, "w") as file:
        root = file.create_group("ENS_MAA/block")
        root.attrs["ESP"] = 3
        step = root.create_group("-0000000000000000001-0000000000000000001")
        step["NOE/COO"] = mesh.points.T.ravel()
        numbers: dict[tuple[str, ...], int] = {}

        def families(what: str, sets, count: int) -> np.ndarray:
            """Number of the family of each member, which holds all of its groups."""
            found = np.zeros(count, dtype=np.int64)
            for i in range(count):
                key = (what, *(name for name, at in sets.items() if i in at))
                if len(key) > 1:
                    sign = -1 if what == "ELEME" else 1
                    found[i] = numbers.setdefault(key, sign * (len(numbers) + 1))
            return found

        step["NOE/FAM"] = families("NOEUD", mesh.point_sets, len(mesh.points))
        for kind, nodes in mesh.cells.items():
            cells = step.create_dataset(f"MAI/{names[kind]}/NOD", data=nodes.T.ravel() + 1)
            cells.attrs["NBR"] = len(nodes)
            groups = {name: group.get(kind, []) for name, group in mesh.groups.items()}
            of_cells = families("ELEME", groups, len(nodes))
            if of_cells.any():
                step[f"MAI/{names[kind]}/FAM"] = of_cells
        for (what, *of_family), number in numbers.items():
            family = file.create_group(f"FAS/block/{what}/FAM_{number}_{'_'.join(of_family)}")
            family.attrs["NUM"] = number
            letters = np.zeros((len(of_family), 80), dtype=np.int8)
            for row, name in zip(letters, of_family, strict=True):
                row[: len(name)] = list(name.encode())
            family["GRO/NOM"] = letters


def write(mesh: fem.StructureMesh, path) -> None:
    if path.suffix == ".unv":
        write_unv(mesh, path)
    elif path.suffix == ".med":
        write_med(mesh, path)
    elif path.suffix == ".vtk":
        meshio.write(path, as_meshio(mesh), file_format="vtk")
    else:
        fem.write_mesh(mesh, path)


def component(mesh: fem.StructureMesh):
    part = fem.SolidPart(STEEL)
    return fem.assemble(
        fem.StructureModel(
            mesh,
            {"left": part, "right": part},
            [fem.Support("root", ("x", "y", "z"))],
            interfaces={"tip": fem.Interface("tip", "z")},
        )
    )


@pytest.mark.parametrize("extension", [".vtu", ".vtk", ".med", ".unv"])
def test_every_format_gives_the_same_component(tmp_path, extension):
    mesh, path = block(), tmp_path / f"block{extension}"
    write(mesh, path)
    found = fem.read_mesh(path)
    assert set(found.groups) == set(mesh.groups)
    for name in mesh.groups:
        assert {k: len(at) for k, at in found.part(name).items()} == {
            k: len(at) for k, at in mesh.part(name).items()
        }
    for name, nodes in mesh.point_sets.items():
        assert found.point_sets[name].tolist() == nodes.tolist()
    known, read = component(mesh), component(found)
    assert fem.mass_properties(read).mass == pytest.approx(15.6, rel=1e-12)
    np.testing.assert_allclose(lowest_hz(read, 4), lowest_hz(known, 4), rtol=1e-9)


@pytest.mark.parametrize(
    ("kind", "shape"),
    [
        ("tetra10", "Tetrahedron"),
        ("wedge15", "Prism"),
        ("hexahedron20", "Hexahedron"),
        ("quad8", "Quadrangle"),
        ("triangle6", "Triangle"),
    ],
)
def test_a_universal_file_of_gmsh_has_the_nodes_of_each_cell_in_their_places(tmp_path, kind, shape):
    own = KINDS_OF_CELLS[kind]
    size = own.dimension
    made = fem.box_mesh("whole", (1.0, 2.0, 3.0)[:size], (1, 1, 1)[:size], kind=kind)
    with gmsh_at_work() as gmsh:
        code = gmsh.model.mesh.getElementType(shape, 2, True)
        local = gmsh.model.mesh.getElementProperties(code)[4].reshape(-1, size)
        local = (local - local.min(axis=0)) / np.ptp(local, axis=0)
        order = [int(np.abs(own.nodes - place).sum(axis=1).argmin()) for place in local]
        gmsh.model.addDiscreteEntity(size, 1)
        labels = np.arange(1, len(made.points) + 1)
        gmsh.model.mesh.addNodes(size, 1, labels, made.points.ravel())
        nodes = made.cells[kind][:, order] + 1
        gmsh.model.mesh.addElementsByType(1, code, [], nodes.ravel())
        gmsh.model.addPhysicalGroup(size, [1], name="whole")
        gmsh.option.setNumber("Mesh.SaveGroupsOfElements", 1)
        gmsh.write(str(tmp_path / "box.unv"))
    found = fem.read_mesh(tmp_path / "box.unv")
    assert list(found.groups) == ["whole"]
    assert (found.points[found.cells[kind]] == made.points[made.cells[kind]]).all()


def test_points_that_gmsh_names_beside_elements_it_leaves_out_are_read(tmp_path):
    with gmsh_at_work() as gmsh:
        volume = gmsh.model.occ.addBox(0.0, 0.0, 0.0, 1.0, 1.0, 1.0)
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [volume], name="block")
        (corner,) = gmsh.model.getEntitiesInBoundingBox(0.9, 0.9, 0.9, 1.1, 1.1, 1.1, 0)
        gmsh.model.addPhysicalGroup(0, [corner[1]], name="corner")
        gmsh.model.mesh.generate(3)
        gmsh.write(str(tmp_path / "without.unv"))
        gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
        gmsh.write(str(tmp_path / "box.unv"))
    found = fem.read_mesh(tmp_path / "box.unv")
    assert found.points[found.point_sets["corner"]].tolist() == [[1.0, 1.0, 1.0]]
    with pytest.raises(fem.ModelError, match=r"'corner' has member 1 of kind 8, .* Gmsh"):
        fem.read_mesh(tmp_path / "without.unv")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("       116", "       117", "element 117 of 20 nodes \\(8, first in line 190"),
        ("  2467\n", "   781\n", "dataset 781 \\(1, first in line"),
        ("    -1\n  2411", "  2411", "has no end"),
        ("1.0000000000000001E-01", "1.00000000x", "dataset 2411 from line 9 on is cut off or"),
        ("       116         2         1         7        20", "       116         2         1"
         "         7         8", "element 1 has 8 nodes where 20"),
        ("         8         1         0", "         9         1         0", "of kind 9, which is"),
    ],
)  # fmt: skip
def test_what_is_not_read_of_a_universal_file_is_refused(tmp_path, old, new, said):
    path = tmp_path / "block.unv"
    write_unv(block(), path)
    text = path.read_text().replace("D+", "E+").replace("D-", "E-")
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(fem.ModelError, match=said):
        fem.read_mesh(path)


def step_of(file):
    return next(iter(file["ENS_MAA/block"].values()))


def lose_families(file):
    families = step_of(file)["MAI/H20/FAM"][:-1]
    del step_of(file)["MAI/H20/FAM"]
    step_of(file)["MAI/H20/FAM"] = families


def undefine_the_skin(file):
    del file["FAS/block/ELEME/FAM_-5_skin"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda file: file.move("ENS_MAA", "OTHER"), "is not a MED file with a mesh"),
        (lambda file: file.copy("ENS_MAA/block", "ENS_MAA/again"), "holds 2 meshes, not one"),
        (
            lambda file: file.copy(step_of(file)["MAI/QU8"], step_of(file)["MAI"], "POG"),
            "has cells of kinds that are not read: 4 POG",
        ),
        (
            lambda file: step_of(file).move("MAI/QU8", "FAC/QU8"),
            "has cells under names that are not read: 'FAC'",
        ),
        (lose_families, "H20 has 8 members, but families for 7"),
        (undefine_the_skin, "QU8 is in family -5, which FAS does not define"),
        (
            lambda file: file.create_group("JNT/block/to_second"),
            "is one piece of a mesh .* the joints 'to_second' to others",
        ),
        (
            lambda file: file.create_group("INFOS_GENERALES").attrs.update(MAJ=2, MIN=3, REL=6),
            r"is of MED 2\.3\.6, and 3 or later is read",
        ),
    ],
)
def test_what_a_med_file_holds_otherwise_is_refused(tmp_path, change, said):
    path = tmp_path / "block.med"
    write_med(block(), path)
    with h5py.File(path, "a") as file:
        change(file)
    with pytest.raises(fem.ModelError, match=said):
        fem.read_mesh(path)


def test_what_is_no_med_file_is_refused(tmp_path):
    path = tmp_path / "block.med"
    path.write_text("no")
    with pytest.raises(fem.ModelError, match="is not a MED file, or is cut off"):
        fem.read_mesh(path)


@pytest.mark.parametrize(
    ("extension", "said"),
    [
        (".e", "export it as one of these from the program that"),
        (".cdb", r"no conversion .* is known; the matrices that Ansys writes by HBMAT are read"),
    ],
)
def test_other_formats_are_refused_with_what_to_do(tmp_path, extension, said):
    path = tmp_path / f"block{extension}"
    path.write_text("")
    with pytest.raises(fem.ModelError, match=said):
        fem.read_mesh(path)


LEGACY = """# vtk DataFile Version 4.2
one brick
ASCII
DATASET UNSTRUCTURED_GRID
POINTS 8 double
0 0 0  1 0 0  1 1 0  0 1 0  0 0 1  1 0 1  1 1 1  0 1 1
CELLS 1 9
8 0 1 2 3 4 5 6 7
CELL_TYPES 1
12
CELL_DATA 1
FIELD FieldData 2
set:left%20side 1 1 int
1
set:100%25 1 1 int
1
POINT_DATA 8
FIELD FieldData 1
set:root 1 8 int
1 0 0 1 1 0 0 1
"""


def test_names_of_vtk_legacy_files_are_as_they_were_given(tmp_path):
    path = tmp_path / "brick.vtk"
    path.write_text(LEGACY)
    mesh = fem.read_mesh(path)
    assert set(mesh.groups) == {"left side", "100%"}
    assert mesh.nodes("root").tolist() == [0, 3, 4, 7]


@pytest.mark.parametrize("extension", [".vtk", ".vtu"])
def test_two_arrays_of_one_name_are_refused(tmp_path, extension):
    path = tmp_path / f"brick{extension}"
    if extension == ".vtk":
        path.write_text(LEGACY.replace("set:100%25", "set:left%20side"))
    else:
        write(block(), path)
        path.write_bytes(path.read_bytes().replace(b'"set:right"', b'"set:left"'))
    with pytest.raises(fem.ModelError, match=r"has two arrays 'set:left"):
        fem.read_mesh(path)


def test_a_vtk_legacy_file_that_is_not_understood_is_refused_with_advice(tmp_path):
    path = tmp_path / "brick.vtk"
    path.write_text(LEGACY.replace("POINTS 8 double", "POINTS 8 quaternion"))
    with pytest.raises(fem.ModelError, match=r"type 'quaternion', .* as '\.vtu'"):
        fem.read_mesh(path)


FIELD_UNV = {
    "quadratic edge": """    -1
  2411
         1         1         1        11
   0.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00
         2         1         1        11
   1.0000000000000000D+00   0.0000000000000000D+00   0.0000000000000000D+00
         3         1         1        11
   5.0000000000000000D-01   1.0000000000000000D-01   0.0000000000000000D+00
    -1
    -1
  2412
         7        22         2         1         7         3
         0         1         1
         1         3         2
    -1
""",
    "empty groups": """    -1
  2467
         1         0         0         0         0         0         0         0
first

         2         0         0         0         0         0         0         1
edge
         8         7         0         0
         3         0         0         0         0         0         0         0
last

    -1
""",
}


def test_an_edge_and_empty_groups_of_salome_are_read(tmp_path):
    path = tmp_path / "edge.unv"
    path.write_text("".join(FIELD_UNV.values()))
    mesh = fem.read_mesh(path)
    assert mesh.points[mesh.cells["line3"][0]][:, 0].tolist() == [0.0, 1.0, 0.5]
    assert mesh.part("edge") == {"line3": [0]}
    told = "; ".join(map(str, mesh.left_out))
    assert "group 'first' (1, first in line 18): it is empty; group 'last' (1, first in" in told
    assert "orientations and cross sections of beams (1, first in line 13)" in told


@pytest.mark.parametrize("kind", ["pyramid", "pyramid13"])
def test_pyramids_of_salome_are_read(tmp_path, kind):
    own = KINDS_OF_CELLS[kind]
    mesh = fem.StructureMesh(own.nodes, {kind: [range(own.node_count)]})
    write_unv(mesh, tmp_path / "pyramid.unv")
    found = fem.read_mesh(tmp_path / "pyramid.unv")
    assert found.cells[kind].tolist() == [list(range(own.node_count))]


def test_properties_tell_the_elements_of_a_universal_file_without_groups_apart(tmp_path):
    path = tmp_path / "beam.unv"
    text = FIELD_UNV["quadratic edge"].replace("         7        22", "         7        24")
    cell = text.split("  2412\n")[1].removesuffix("    -1\n")
    other = cell.replace("         7        24         2", "         8        24         5")
    for cells, groups in ((cell + cell.replace("  7   ", "  8   ", 1), []),
                          (cell + other, ["property 2", "property 5"])):  # fmt: skip
        path.write_text(text.replace(cell, cells))
        mesh = fem.read_mesh(path)
        assert sorted(mesh.groups) == groups
        told = [item.keyword for item in mesh.left_out]
        assert ("physical properties of elements" in told) == bool(groups)
    assert mesh.part("property 5") == {"line3": [1]}


@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("version", [42, 51])
def test_all_data_that_vtk_writes_beside_a_mesh_is_passed(tmp_path, version, binary):
    """Normals, colours, labels, tensors and arrays of all numbers hide no array of a set."""
    from vtkmodules.vtkCommonCore import vtkLookupTable
    from vtkmodules.vtkIOLegacy import vtkUnstructuredGridWriter

    box = fem.box_mesh("block", (2.0, 1.0, 1.0), (2, 1, 1), kind="hexahedron")
    grid = pv.UnstructuredGrid({pv.CellType.HEXAHEDRON: box.cells["hexahedron"]}, box.points)
    for data, count in ((grid.GetPointData(), 12), (grid.GetCellData(), 2)):
        values = iter(np.random.default_rng(0).random((20, count, 9)))

        def array(name, columns, kind=float, values=values, count=count):
            made = pv.convert_array((99 * next(values)[:, :columns]).astype(kind), name)
            return made

        colours = array("colours", 1)
        table = vtkLookupTable()
        table.SetNumberOfTableValues(5)
        table.Build()
        colours.SetLookupTable(table)
        data.SetScalars(colours)
        data.SetVectors(array("v", 3))
        data.SetNormals(array("n", 3))
        data.SetTCoords(array("places", 2))
        data.SetTensors(array("six", 6))
        data.SetGlobalIds(array("label", 1, np.int64))
        data.SetPedigreeIds(array("origin", 1, np.int64))
        for kind in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4"):
            data.AddArray(array(kind, 2, kind))
    data.AddArray(pv.convert_array(np.array([0, 1], dtype=np.int32), "set:right"))
    writer = vtkUnstructuredGridWriter()
    writer.SetInputData(grid)
    writer.SetFileVersion(version)
    writer.SetFileType(2 if binary else 1)
    writer.SetFileName(str(tmp_path / "box.vtk"))
    writer.Write()
    found = fem.read_mesh(tmp_path / "box.vtk")
    assert (found.points == box.points).all()
    assert (found.cells["hexahedron"] == box.cells["hexahedron"]).all()
    assert found.part("right") == {"hexahedron": [1]}
    data.SetScalars(array("rgb", 3, "u1"))
    writer.Write()
    assert fem.read_mesh(tmp_path / "box.vtk").part("right") == {"hexahedron": [1]}


def test_med_in_other_coordinates_is_refused_and_another_unit_told(tmp_path):
    path, box = tmp_path / "box.med", fem.box_mesh("block", (1.0, 1.0, 1.0), (1, 1, 1))
    write_med(box, path)
    assert not fem.read_mesh(path).notes
    for system, name in ((1, "cylindrical"), (2, "spherical")):
        with h5py.File(path, "r+") as file:
            file["ENS_MAA/block"].attrs["REP"] = system
        with pytest.raises(fem.ModelError, match=rf"are {name} \(REP = {system}\)"):
            fem.read_mesh(path)
    for unit, told in (("m", False), ("", False), ("INCONNUE", False), ("mm", True)):
        with h5py.File(path, "r+") as file:
            file["ENS_MAA/block"].attrs["REP"] = 0
            file["ENS_MAA/block"].attrs["UNI"] = np.bytes_(3 * f"{unit:16}")
        mesh = fem.read_mesh(path)
        assert (mesh.points == box.points).all()
        assert len(mesh.notes) == told and all("the unit 'mm'" in note for note in mesh.notes)
        assert mesh.unit == ("mm" if told else "")
