"""The order of the nodes of every kind of cell in the files of Gmsh, VTK and Abaqus."""

import warnings

import meshio
import numpy as np
import pytest
from mixed import FAMILIES, STRETCH, jiggled, mixed_block, patch_error
from structures import STEEL, lowest_hz
from with_gmsh import gmsh_at_work

import fem
from fem.formats.gmsh import NODES
from fem.mesh.cells import KINDS

CODES = {"line3": 8, "triangle6": 9, "quad9": 10, "quad8": 16, "tetra": 4, "tetra10": 11,
         "hexahedron": 5, "hexahedron20": 17, "hexahedron27": 12, "wedge": 6, "wedge15": 18,
         "wedge18": 13, "pyramid": 7, "pyramid13": 19, "pyramid14": 14}  # fmt: skip
VTK_CELLS = {
    "line3": "QuadraticEdge", "triangle6": "QuadraticTriangle", "quad8": "QuadraticQuad",
    "quad9": "BiQuadraticQuad", "tetra": "Tetra", "tetra10": "QuadraticTetra",
    "hexahedron": "Hexahedron", "hexahedron20": "QuadraticHexahedron",
    "hexahedron27": "TriQuadraticHexahedron", "wedge15": "QuadraticWedge",
    "wedge18": "BiQuadraticQuadraticWedge", "pyramid": "Pyramid", "pyramid13": "QuadraticPyramid",
}  # fmt: skip


def same_cell(kind, places):
    """Whether nodes (b, d) are those of the reference cell or of an affine image of it."""
    corners = len(KINDS[kind].corners)
    ones = np.column_stack([KINDS[kind].nodes, np.ones(len(places))])
    image, *_ = np.linalg.lstsq(ones[:corners], places[:corners])
    return np.linalg.matrix_rank(image) == ones.shape[1] and np.allclose(ones @ image, places)


@pytest.mark.parametrize("kind", CODES)
def test_gmsh_tells_the_nodes_where_they_are_taken_from(kind):
    with gmsh_at_work() as gmsh:
        _, dimension, order, count, places, _ = gmsh.model.mesh.getElementProperties(CODES[kind])
    assert (dimension, order, count) == (
        KINDS[kind].dimension, KINDS[kind].order, KINDS[kind].node_count
    )  # fmt: skip
    own = np.reshape(places, (count, dimension))[list(NODES.get(kind, range(count)))]
    assert same_cell(kind, np.column_stack([own, np.ones(count)]))


@pytest.mark.parametrize("kind", VTK_CELLS)
def test_vtk_tells_the_nodes_where_they_are_taken_from(kind):
    model = pytest.importorskip("vtkmodules.vtkCommonDataModel")
    cell = getattr(model, f"vtk{VTK_CELLS[kind]}")()
    places = np.zeros(3 * KINDS[kind].node_count)
    assert cell.GetNumberOfPoints() == KINDS[kind].node_count
    own = np.array([cell.GetParametricCoords()[i] for i in range(len(places))]).reshape(-1, 3)
    if kind.startswith("pyramid"):  # its parameters are those of a collapsed cube
        own[:, :2] = 0.5 + (own[:, :2] - 0.5) * (1.0 - own[:, 2:])
    assert same_cell(kind, np.column_stack([own[:, : KINDS[kind].dimension], np.ones(len(own))]))


ABAQUS = {
    "C3D5": ("pyramid", ()),
    "C3D6": ("wedge", ()),
    "C3D15": ("wedge15", "1-2 2-3 3-1 4-5 5-6 6-4 1-4 2-5 3-6"),
    "C3D10": ("tetra10", "1-2 2-3 3-1 1-4 2-4 3-4"),
    "C3D20": ("hexahedron20", "1-2 2-3 3-4 4-1 5-6 6-7 7-8 8-5 1-5 2-6 3-7 4-8"),
    "CPS6": ("triangle6", "1-2 2-3 3-1"),
    "CPS8": ("quad8", "1-2 2-3 3-4 4-1"),
}
"""Elements, their kinds, and between which corners each further node lies, by Abaqus' manual."""


@pytest.mark.parametrize("name", ABAQUS)
def test_abaqus_has_the_nodes_where_they_are_taken_from(name, tmp_path):
    kind, between = ABAQUS[name]
    corners = np.pad(KINDS[kind].corners, ((0, 0), (0, 3 - KINDS[kind].dimension)))
    pairs = [[int(n) - 1 for n in pair.split("-")] for pair in (between.split() if between else ())]
    places = [*corners, *(corners[pair].mean(axis=0) for pair in pairs)]
    rows = [f"{n}, {x}, {y}, {z}" for n, (x, y, z) in enumerate(places, 1)]
    labels = [str(n) for n in range(len(places) + 1)]
    labels[0] = "7"
    element = [", ".join(labels[i : i + 16]) for i in range(0, len(labels), 16)]
    path = tmp_path / "cell.inp"
    lines = ["*NODE", *rows, f"*ELEMENT, TYPE={name}, ELSET=body", ",\n".join(element)]
    path.write_text("\n".join(lines) + "\n")
    mesh = fem.read_mesh(path)
    assert np.array_equal(mesh.points[mesh.cells[kind][0], : KINDS[kind].dimension],
                          KINDS[kind].nodes)  # fmt: skip


def frequencies(mesh, part="body"):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fem.LockingWarning)
        return lowest_hz(fem.assemble(fem.StructureModel(mesh, {part: fem.SolidPart(STEEL)})), 9)


def write_gmsh_22(mesh, path):
    """A mesh of a structure as Gmsh 2.2 writes it, in Gmsh's order of nodes."""
    rows = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "1", '3 1 "body"']
    rows += ["$EndPhysicalNames", "$Nodes", str(len(mesh.points))]
    rows += [f"{n} {x!r} {y!r} {z!r}" for n, (x, y, z) in enumerate(mesh.points.tolist(), 1)]
    rows += ["$EndNodes", "$Elements", str(sum(map(len, mesh.cells.values())))]
    label = 0
    for kind, cells in mesh.cells.items():
        back = np.argsort(NODES.get(kind, range(cells.shape[1])))
        for nodes in (cells[:, back] + 1).tolist():
            label += 1
            rows.append(" ".join(map(str, [label, CODES[kind], 2, 1, 1, *nodes])))
    path.write_text("\n".join([*rows, "$EndElements"]) + "\n")


@pytest.mark.parametrize("family", FAMILIES)
def test_mixed_meshes_come_back_from_every_format(family, tmp_path):
    """The distorted patch in the order of Gmsh, VTK and Abaqus: counts, frequencies, stretch."""
    mesh = mixed_block(family, jiggled)
    expected = frequencies(mesh)[6:]
    assert expected.min() > 1.0
    write_gmsh_22(mesh, tmp_path / "mixed.msh")
    names = ["mixed.msh"]
    if family != "complete":  # VTK has no pyramid of 14 nodes, Abaqus nothing of this family
        names += ["mixed.vtu", "mixed.inp"]
        for name in names[1:]:
            fem.write_mesh(mesh, tmp_path / name)
    for name in names:
        back = fem.read_mesh(tmp_path / name)
        assert {k: len(c) for k, c in back.cells.items()} == {
            k: len(c) for k, c in mesh.cells.items()
        }
        np.testing.assert_allclose(frequencies(back)[6:], expected, rtol=1e-9)
        component = fem.assemble(fem.StructureModel(back, {"body": fem.SolidPart(STEEL)}))
        assert patch_error(component, back.points @ STRETCH) < 1e-12


def test_a_cell_that_a_format_has_not_is_told(tmp_path):
    mesh = mixed_block("complete")
    with pytest.raises(fem.ModelError, match=r"VTK has no cells of kind 'pyramid14'"):
        fem.write_mesh(mesh, tmp_path / "mixed.vtu")
    with pytest.raises(fem.ModelError, match=r"no elements for cells of kind '[wp]"):
        fem.write_mesh(mesh, tmp_path / "mixed.inp")


@pytest.fixture(scope="module")
def gmsh_files(tmp_path_factory):
    """Prisms, and pyramids between quadrilaterals and tetrahedra, as Gmsh meshes them."""
    folder = tmp_path_factory.mktemp("gmsh")
    with gmsh_at_work() as gmsh:
        for shape in ("wedge", "pyramid"):
            for order, incomplete in ((1, 0), (2, 0), (2, 1)):
                gmsh.clear()
                _block_of_gmsh(gmsh, shape, order, incomplete)
                for version, binary in ((2.2, 0), (2.2, 1), (4.1, 0), (4.1, 1)):
                    gmsh.option.setNumber("Mesh.MshFileVersion", version)
                    gmsh.option.setNumber("Mesh.Binary", binary)
                    name = f"{shape}{order}{incomplete}_{version}_{binary}.msh"
                    gmsh.write(str(folder / name))
    return folder


def _block_of_gmsh(gmsh, shape, order, incomplete):
    if shape == "wedge":
        floor = gmsh.model.occ.addRectangle(0, 0, 0, 1, 0.5)
        gmsh.model.occ.extrude([(2, floor)], 0, 0, 0.4, [2], recombine=True)
        gmsh.model.occ.synchronize()
    else:
        gmsh.model.occ.addBox(0, 0, 0, 1, 0.5, 0.4)
        gmsh.model.occ.synchronize()
        for _, curve in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(curve, 6)
        _, face = gmsh.model.getEntities(2)[0]
        gmsh.model.mesh.setTransfiniteSurface(face)
        gmsh.model.mesh.setRecombine(2, face)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
    gmsh.option.setNumber("Mesh.ElementOrder", order)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
    gmsh.model.addPhysicalGroup(3, [v for _, v in gmsh.model.getEntities(3)], name="body")
    gmsh.model.mesh.generate(3)


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("wedge10", {"wedge"}), ("wedge20", {"wedge18"}), ("wedge21", {"wedge15"}),
        ("pyramid10", {"pyramid", "tetra"}), ("pyramid20", {"pyramid14", "tetra10"}),
        ("pyramid21", {"pyramid13", "tetra10"}),
    ],
)  # fmt: skip
def test_blocks_of_gmsh_have_their_volume_and_frequencies(gmsh_files, name, kinds):
    found = []
    for path in sorted(gmsh_files.glob(f"{name}_*.msh")):
        mesh = fem.read_mesh(path)
        assert mesh.cells.keys() == kinds
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", fem.LockingWarning)
            component = fem.assemble(fem.StructureModel(mesh, {"body": fem.SolidPart(STEEL)}))
        assert component.mass.sum() / 3.0 == pytest.approx(8000.0 * 0.2, rel=1e-12)
        found.append(lowest_hz(component, 9)[6:])
    assert len(found) == 4
    np.testing.assert_allclose(found, np.tile(found[0], (4, 1)), rtol=1e-9)
    if name[-2] == "2":
        finer = frequencies(fem.box_mesh("body", (1.0, 0.5, 0.4), (6, 4, 4)))[6:]
        # five edges along the block: tetrahedra alone twist 1.25 % too high
        np.testing.assert_allclose(found[0], finer, rtol=0.015 if "pyramid" in name else 0.004)


def test_the_wedges_of_a_vtk_file_are_all_there(tmp_path):
    """A hexahedron and two wedges of 1 m³ and 0.5 m³ each: the mass is 15,700 kg."""
    points = np.array([(x, y, z) for x in (0, 1, 2) for y in (0, 1) for z in (0, 1)], float)
    bottom = [0, 4, 6, 2]
    triangles = [[4, 8, 6], [8, 10, 6]]
    content = meshio.Mesh(
        points,
        [("hexahedron", [[*bottom, *(n + 1 for n in bottom)]]),
         ("wedge", [[*t, *(n + 1 for n in t)] for t in triangles])],
        cell_data={"set:body": [np.ones(1, int), np.ones(2, int)]},
    )  # fmt: skip
    meshio.write(tmp_path / "wedges.vtu", content)
    mesh = fem.read_mesh(tmp_path / "wedges.vtu")
    part = fem.SolidPart(fem.Material(2.1e11, 7850.0, poissons_ratio=0.3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fem.LockingWarning)
        component = fem.assemble(fem.StructureModel(mesh, {"body": part}))
    assert component.mass.sum() / 3.0 == pytest.approx(15_700.0, rel=1e-12)
