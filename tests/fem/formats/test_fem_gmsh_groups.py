"""Groups, partitions and parametric coordinates of Gmsh files, written by Gmsh itself."""

import numpy as np
import pytest
import skfem
from scipy.sparse.linalg import eigsh
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity
from structures import STEEL, lowest_hz
from with_gmsh import gmsh_at_work

import fem


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A box in two groups, with a surface and a curve of one name, in all dialects."""
    place = tmp_path_factory.mktemp("gmsh")
    with gmsh_at_work() as gmsh:
        box = gmsh.model.occ.addBox(0, 0, 0, 0.3, 0.1, 0.1)
        gmsh.model.occ.synchronize()
        model = gmsh.model
        model.addPhysicalGroup(3, [box], name="body")
        model.addPhysicalGroup(3, [box], name="also")
        model.addPhysicalGroup(2, [1], name="root")
        model.addPhysicalGroup(1, [9], name="root")
        model.addPhysicalGroup(0, [7], name="tip")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.1)
        model.mesh.generate(3)
        gmsh.option.setNumber("Mesh.SaveParametric", 0)
        for version in (2.2, 4.1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            for binary in (0, 1):
                gmsh.option.setNumber("Mesh.Binary", binary)
                gmsh.write(str(place / f"{version}_{binary}.msh"))
        gmsh.option.setNumber("Mesh.Binary", 0)
        gmsh.option.setNumber("Mesh.SaveParametric", 1)
        gmsh.write(str(place / "parametric.msh"))
        gmsh.option.setNumber("Mesh.SaveParametric", 0)
        gmsh.option.setNumber("Mesh.PartitionCreateGhostCells", 1)
        model.mesh.partition(2)
        for version in (2.2, 4.1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.write(str(place / f"partitioned_{version}.msh"))
    return place


def assembled(path):
    mesh = fem.read_mesh(path)
    tip = fem.Interface("tip", "z")
    supports = [fem.Support("root (surface)", ("x", "y", "z"))]
    return fem.assemble(
        fem.StructureModel(mesh, {"body": fem.SolidPart(STEEL)}, supports, interfaces={"tip": tip})
    )


NAMES = ("2.2_0", "2.2_1", "4.1_0", "4.1_1", "parametric", "partitioned_2.2", "partitioned_4.1")


@pytest.mark.parametrize("name", NAMES)
def test_every_dialect_of_gmsh_is_the_same_component(folder, name):
    found, first = assembled(folder / f"{name}.msh"), assembled(folder / "4.1_0.msh")
    assert fem.mass_properties(found).mass == pytest.approx(0.003 * STEEL.density, rel=1e-12)
    np.testing.assert_allclose(lowest_hz(found, 3), lowest_hz(first, 3), rtol=1e-9)
    mesh = found.model.mesh
    assert set(mesh.groups) == {"body", "also", "root (surface)", "root (curve)"}
    assert len(mesh.part("also")["tetra"]) == len(mesh.part("body")["tetra"])


def test_a_surface_and_a_curve_of_one_name_stay_apart(folder):
    mesh = fem.read_mesh(folder / "4.1_0.msh")
    assert set(mesh.groups["root (surface)"]) == {"triangle"}
    assert set(mesh.groups["root (curve)"]) == {"line"}
    with pytest.raises(fem.ModelError, match=r"no point or face 'root'; .*'root \(surface\)'"):
        mesh.nodes("root")


def test_an_element_that_stands_twice_in_one_group_stays_twice_and_is_refused(folder, tmp_path):
    lines = (folder / "2.2_0.msh").read_text().splitlines()
    start = lines.index("$Elements")
    last = lines.index("$EndElements")
    again = lines[last - 1]
    lines[start + 1] = str(int(lines[start + 1]) + 1)
    lines.insert(last, again)
    path = tmp_path / "twice.msh"
    path.write_text("\n".join(lines) + "\n")
    name = "also" if "also" in fem.read_mesh(path).groups else "body"
    with pytest.raises(fem.ModelError, match="stands twice"):
        fem.StructureModel(fem.read_mesh(path), {name: fem.SolidPart(STEEL)})


def test_a_section_that_is_not_understood_is_refused_by_name(folder, tmp_path):
    path = tmp_path / "more.msh"
    path.write_text((folder / "4.1_0.msh").read_text() + "$Springs\n1\n$EndSprings\n")
    with pytest.raises(fem.ModelError, match=r"section \$Springs is not understood"):
        fem.read_mesh(path)


@pytest.fixture(scope="module")
def boxes(tmp_path_factory):
    """Two boxes that touch, each meshed by itself, in one group."""
    path = tmp_path_factory.mktemp("boxes") / "boxes.msh"
    with gmsh_at_work() as gmsh:
        both = [gmsh.model.occ.addBox(x, 0, 0, 0.2, 0.04, 0.02) for x in (0.0, 0.2)]
        gmsh.model.occ.synchronize()
        gmsh.model.addPhysicalGroup(3, both, name="all")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.03)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(path))
    mesh = fem.read_mesh(path)
    x = mesh.points[:, 0]
    return mesh.with_point_sets({"ends": np.flatnonzero((x < 1e-9) | (x > 0.4 - 1e-9))})


def conforming_hz(boxes):
    """Lowest frequency by scikit-fem's own quadratic tetrahedra between the corners, each once."""
    tetrahedra = boxes.cells["tetra10"][:, :4]
    used, corners = np.unique(tetrahedra, return_inverse=True)
    places, first, same = np.unique(
        boxes.points[used].round(9), axis=0, return_index=True, return_inverse=True
    )
    assert len(places) < len(used)
    points = boxes.points[used][first]
    mesh = skfem.MeshTet(points.T.copy(), same.ravel()[corners].reshape(-1, 4).T.copy())
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP2()), intorder=4)
    lame = lame_parameters(STEEL.youngs_modulus, STEEL.poissons_ratio)
    forms = linear_elasticity(*lame), skfem.BilinearForm(lambda u, v, _: STEEL.density * dot(u, v))
    free = basis.complement_dofs(basis.get_dofs(lambda x: (x[0] < 1e-9) | (x[0] > 0.4 - 1e-9)))
    K, M = (form.assemble(basis)[free][:, free].tocsc() for form in forms)
    square = eigsh(K, 1, M, sigma=0.0, return_eigenvectors=False)[0]
    return np.sqrt(square) / (2 * np.pi)


def test_boxes_that_touch_are_refused_and_merged_are_one_conforming_mesh(boxes):
    held = [fem.Support("ends", ("x", "y", "z"))]
    part = {"all": fem.SolidPart(STEEL)}
    with pytest.raises(fem.ModelError, match=r"2 pieces of the mesh touch but share no node: \d+"):
        fem.assemble(fem.StructureModel(boxes, part, held))
    merged = fem.assemble(fem.StructureModel(fem.joined([boxes]), part, held))
    assert lowest_hz(merged, 1)[0] == pytest.approx(conforming_hz(boxes), rel=1e-9)
