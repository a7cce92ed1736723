"""Reduced integration: thin curved parts that do not lock, and no motion that costs nothing."""

import warnings

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve
from structures import STEEL, lowest_hz

import fem
from fem.elements.solids import gradients_and_volumes
from fem.mesh.cells import KINDS
from fem.mesh.element_types import integration


def ring(thickness, count, types=None):
    """A free ring of mean radius 1 m and width 0.2 m, of cells in one row."""
    bar = fem.box_mesh("ring", (1.0, thickness, 0.2), (count, 1, 1))
    x, y, z = bar.points.T
    turn, radius = 2 * np.pi * x, 1.0 + thickness / 2 - y
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])
    mesh = fem.joined([bar.with_points(points)])
    named = {types: {"hexahedron20": np.arange(count)}} if types else {}
    return fem.StructureMesh(mesh.points, mesh.cells, mesh.groups, element_types=named)


def assembled(mesh, **options):
    return fem.assemble(fem.StructureModel(mesh, {"ring": fem.SolidPart(STEEL, **options)}))


@pytest.mark.parametrize(("thickness", "count"), [(0.05, 16), (0.02, 24), (0.01, 24)])
def test_a_thin_ring_in_one_row_of_cells_bends_as_ring_theory_says(thickness, count):
    """omega² = n² (n² - 1)²/(n² + 1) E t²/(12 rho R⁴), two modes in the plane for n = 2."""
    wanted = np.sqrt(36 / 5 * STEEL.youngs_modulus * thickness**2 / (12 * STEEL.density))
    found = lowest_hz(assembled(ring(thickness, count)), 8)
    assert found[:6].max() < 0.01 * found[6]
    np.testing.assert_allclose(found[6:], wanted / (2 * np.pi), rtol=0.015)


@pytest.mark.parametrize(("thickness", "count"), [(0.05, 16), (0.02, 24), (0.01, 24)])
def test_the_warning_says_how_much_too_stiff_a_ring_in_full_is(thickness, count):
    """The square of the ratio of frequencies, at most a tenth more than what is said."""
    wanted = np.sqrt(36 / 5 * STEEL.youngs_modulus * thickness**2 / (12 * STEEL.density))
    with pytest.warns(fem.LockingWarning, match="times too stiff: they are curved by") as caught:
        component = assembled(ring(thickness, count), integration="full")
    said = float(str(caught[0].message).split("about ")[1].split(" times")[0])
    found = (lowest_hz(component, 8)[6] * 2 * np.pi / wanted) ** 2
    assert found == pytest.approx(said, rel=0.1)


def test_a_ring_of_short_cells_in_full_is_not_warned_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assembled(ring(0.05, 48), integration="full")


def plate_with_a_hole(around):
    """A disk of radius 1 m, 0.1 m thick, with a hole of 0.1 m in its middle."""
    mesh = fem.box_mesh("plate", (1.0, 1.0, 0.1), (around, 3, 1), kind="hexahedron27")
    a, b, z = mesh.points.T
    turn, radius = 2 * np.pi * a, 0.1 + 0.9 * b
    points = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z - 0.05])
    plate = fem.joined([mesh.with_points(points)])
    return fem.StructureModel(plate, {"plate": fem.SolidPart(STEEL)})


def stiffness_in_even_bending(component):
    """Over the right one: forces of a stress x'x z over the motion that they should cause."""
    mesh, material = component.model.mesh, component.model.parts["plate"].material
    kind, cells = KINDS["hexahedron27"], mesh.cells["hexahedron27"]
    places, weights = kind.quadrature
    gradients, volumes = gradients_and_volumes(kind, mesh.points[cells], places)
    weights = weights * np.abs(volumes)
    height = (mesh.points[cells] @ [0.0, 0.0, 1.0]) @ kind.basis(places)[0].T
    force = np.zeros(mesh.points.shape)
    np.add.at(force[:, 0], cells, np.einsum("eq,eqb->eb", weights * height, gradients[..., 0]))
    right = np.sum(weights * height**2) / material.youngs_modulus
    K = component.stiffness
    ridge = 1e-12 * K.diagonal().max() * sparse.eye_array(K.shape[0])
    return right / (force.ravel() @ spsolve(sparse.csc_array(K + ridge), force.ravel()))


def test_a_hole_in_a_wide_plate_is_not_taken_for_a_thin_part():
    """The wall of a hole is curved, but what lies behind it is not thin."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", fem.LockingWarning)
        component = fem.assemble(plate_with_a_hole(16))
    assert stiffness_in_even_bending(component) == pytest.approx(1.01, abs=0.01)


def test_curved_edges_in_the_plane_of_a_plate_stiffen_it():
    with pytest.warns(fem.LockingWarning, match="they are curved by") as caught:
        component = fem.assemble(plate_with_a_hole(8))
    said = float(str(caught[0].message).split("about ")[1].split(" times")[0])
    found = stiffness_in_even_bending(component)
    assert 1.05 < found < said < 1.0 + 5.0 * (found - 1.0)


@pytest.mark.parametrize(
    ("types", "same"),
    [("C3D20R", "reduced"), ("C3D20", "full"), (None, "reduced"), ("CHEXA", "reduced")],
)
def test_cells_are_integrated_as_the_file_says_that_names_their_type(types, same):
    said = assembled(ring(0.01, 24, types))
    asked = assembled(ring(0.01, 24, "C3D20"), integration=same)
    assert (said.stiffness != asked.stiffness).nnz == 0
    assert (said.mass != asked.mass).nnz == 0


def test_types_of_elements_say_how_they_are_integrated():
    said = {name: integration(name) for name in ("C3D20R", "CPS8R", "C3D20RH", "C3D20", "S8R")}
    assert said == {
        "C3D20R": "reduced", "CPS8R": "reduced", "C3D20RH": "reduced", "C3D20": "full", "S8R": None,
    }  # fmt: skip


def free_block(counts, integration, lean):
    kind = "quad8" if len(counts) == 2 else "hexahedron20"
    mesh = fem.box_mesh("block", [float(n) for n in counts], counts, kind=kind)
    moved = np.random.default_rng(3).uniform(-lean, lean, mesh.points.shape)
    moved[:, len(counts) :] = 0.0
    part = fem.SolidPart(
        fem.Material(1.0, 1.0, 0.3),
        *(("stress", 0.1) if kind == "quad8" else (None, None)),
        integration=integration,
    )
    model = fem.StructureModel(mesh.with_points(mesh.points + moved), {"block": part})
    return fem.assemble(model)


@pytest.mark.parametrize("size", [(5.0, 1.0, 1.0), (10.0, 10.0, 0.5), (1.0, 0.1, 0.02)])
def test_a_single_slender_cell_has_its_elastic_motions_first(size):
    """Bending and twist of one cell, which are strained at the places of integration, are exact."""
    found = []
    for each in ("full", "reduced"):
        mesh = fem.box_mesh("cell", size, (1, 1, 1))
        part = fem.SolidPart(fem.Material(1.0, 1.0, 0.3), integration=each)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", fem.DistortionWarning)
            component = fem.assemble(fem.StructureModel(mesh, {"cell": part}))
        found.append(lowest_hz(component, 9)[6:])
    np.testing.assert_allclose(found[1], found[0], rtol=1e-3)


@pytest.mark.parametrize("lean", [0.0, 0.05])
@pytest.mark.parametrize(
    "counts", [(1, 1), (2, 1), (2, 2), (1, 1, 1), (2, 1, 1), (4, 1, 1), (2, 2, 1), (2, 2, 2)]
)
def test_no_motion_but_rigid_ones_is_without_stiffness(counts, lean):
    """Frequencies are near those of full integration, of single cells and of rows of them, too."""
    rigid = 3 if len(counts) == 2 else 6
    full, reduced = (
        lowest_hz(free_block(counts, each, lean), rigid + 10) for each in ("full", "reduced")
    )
    assert reduced[:rigid].max() < 1e-6 * reduced[rigid]
    ratio = reduced[rigid:] / full[rigid:]
    assert ratio.min() > 0.8 and ratio.max() < 1.0 + 1e-9


def test_reduced_integration_of_cells_that_have_none_is_refused():
    mesh = fem.box_mesh("block", (1.0, 1.0, 1.0), (1, 1, 1), kind="tetra10")
    with pytest.raises(fem.ModelError, match="'block' has integration 'reduced', which is for qu"):
        fem.StructureModel(mesh, {"block": fem.SolidPart(STEEL, integration="reduced")})
    with pytest.raises(fem.ModelError, match="integration must be one of 'full', 'reduced', not"):
        fem.SolidPart(STEEL, integration="R")


def test_cells_in_full_that_lie_inside_others_have_no_face_to_look_below():
    """What looks below faces for cells that lock finds none there, and ends in no error."""
    box = fem.box_mesh("block", (3.0, 3.0, 3.0), (3, 3, 3), kind="hexahedron20")
    inside = np.arange(27) == 13
    groups = {
        name: {"hexahedron20": np.flatnonzero(own)}
        for name, own in (("inner", inside), ("outer", ~inside))
    }
    steel = fem.Material(2.1e11, 7800.0, 0.3)
    parts = {"inner": fem.SolidPart(steel, integration="full"), "outer": fem.SolidPart(steel)}
    mesh = fem.StructureMesh(box.points, dict(box.cells), groups)
    mass = fem.assemble(fem.StructureModel(mesh, parts)).rigid_mass
    assert mass[0, 0] == pytest.approx(27.0 * 7800.0)
