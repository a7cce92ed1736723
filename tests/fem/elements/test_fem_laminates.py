"""Plates with layers and directions against one material, offsets and closed forms."""

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve
from structures import lowest_hz

import fem
from fem.model.plates import strain_turn

E, NU, RHO = 2.1e11, 0.3, 7800.0
STEEL = fem.Material(E, RHO, NU)
T = 0.01
PLY = fem.Layer([[1.4e11, 3e9, 0], [3e9, 1e10, 0], [0, 0, 5e9]], [[5e9, 0], [0, 3e9]], 1600.0, 2e-3)


def turned(layer, angle, thickness=2e-3):
    return fem.Layer(layer.law, layer.shear, layer.density, thickness, angle)


def shell(section, **more):
    return fem.ShellPart(STEEL, T, section=section, **more)


def curved(kind):
    """A part of a cylinder, whose cells are neither flat nor rectangular."""
    mesh = fem.box_mesh("sheet", (1.0, 0.5), (4, 3), kind=kind)
    x, y, _ = mesh.points.T
    return mesh.with_points(np.column_stack([x + 0.1 * y, y, 0.2 * np.sin(2.0 * x + 0.3 * y)]))


@pytest.mark.parametrize("kind", ["quad", "triangle", "quad9", "triangle6"])
@pytest.mark.parametrize("direction", [35.0, (1.0, 2.0, 0.5)])
def test_layers_of_one_material_are_a_plate_of_it(kind, direction):
    layers = [fem.Layer.isotropic(E, NU, RHO, share * T) for share in (0.2, 0.5, 0.3)]
    mesh = curved(kind)
    one = fem.assemble(fem.StructureModel(mesh, {"sheet": fem.ShellPart(STEEL, T)}))
    part = shell(fem.layered(layers), direction=direction)
    other = fem.assemble(fem.StructureModel(mesh, {"sheet": part}))
    for name in ("stiffness", "mass"):
        given, found = (getattr(c, name).toarray() for c in (one, other))
        np.testing.assert_allclose(found, given, atol=1e-9 * np.abs(given).max())
    A, d = other.natural_form.deformations, other.natural_form.stiffness
    rows = A @ np.eye(A.shape[1])
    K = other.stiffness.toarray()
    np.testing.assert_allclose(rows.T @ (d[:, None] * rows), K, atol=1e-9 * np.abs(K).max())


def strip(section, offset=0.0, cells=(10, 1), direction=(1.0, 0.0, 0.0)):
    """A cantilever 1 m long and 0.1 m wide, loaded at its tip by 1 N: its deflection."""
    mesh = fem.box_mesh("sheet", (1.0, 0.1), cells, kind="quad")
    part = section
    if not isinstance(section, fem.ShellPart):
        part = shell(section, offset=offset, direction=direction)
    clamp = fem.Support("x0", ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z"))
    model = fem.StructureModel(
        mesh.with_point_sets({"tip": np.flatnonzero(mesh.points[:, 0] > 1 - 1e-9)}),
        {"sheet": part},
        [clamp],
        couplings=[fem.Coupling("end", "tip", at=(1.0, 0.05, 0.0))],
        interfaces={"end": fem.Interface("end", "z")},
    )
    found = fem.assemble(model)
    tip = found.interfaces["end"]
    return float(tip @ spsolve(found.stiffness.tocsc(), tip))


def test_a_strip_of_two_unlike_layers_bends_about_its_neutral_axis():
    """Without Poisson's effect: 1/(3 (D - B²/A) b) with A, B and D by hand."""
    stiff, soft = (fem.Layer.isotropic(e, 0.0, 1.0, t) for e, t in ((2e11, 4e-3), (5e10, 8e-3)))
    low, middle, high = -6e-3, -2e-3, 6e-3
    A = 2e11 * (middle - low) + 5e10 * (high - middle)
    B = (2e11 * (middle**2 - low**2) + 5e10 * (high**2 - middle**2)) / 2
    D = (2e11 * (middle**3 - low**3) + 5e10 * (high**3 - middle**3)) / 3
    expected = 1.0 / (3.0 * (D - B**2 / A) * 0.1)
    assert strip(fem.layered([stiff, soft])) == pytest.approx(expected, rel=5e-3)


def test_a_plate_whose_layers_begin_at_its_points_is_as_if_offset():
    one = fem.Layer.isotropic(E, NU, RHO, T)
    given = strip(fem.ShellPart(STEEL, T, offset=T / 2))
    assert strip(fem.layered([one], bottom=0.0)) == pytest.approx(given, rel=1e-2)


def test_directions_turn_the_stiffness():
    """A layer across its fibres, turned by its own angle, by the part's, and by a vector."""
    along = strip(fem.layered([turned(PLY, 0.0)]))
    across = strip(fem.layered([turned(PLY, 90.0)]))
    assert along * 10 < across
    for other in (
        strip(fem.layered([PLY]), direction=(0.0, 1.0, 0.0)),
        strip(fem.layered([PLY]), direction=90.0),
        strip(fem.layered([turned(PLY, 30.0)]), direction=60.0),
    ):
        assert other == pytest.approx(across, rel=1e-9)


def test_an_orthotropic_plate_swings_as_in_the_book():
    """Simply supported: omega² = pi⁴ (D11/a⁴ + 2 (D12 + 2 D66)/(a b)² + D22/b⁴)/m (Whitney)."""
    a, b = 1.0, 0.6
    section = fem.layered([turned(PLY, angle) for angle in (0, 90, 90, 0)])
    D = np.array(section.bending)
    term = D[0, 0] / a**4 + 2 * (D[0, 1] + 2 * D[2, 2]) / (a * b) ** 2 + D[1, 1] / b**4
    expected = np.pi / 2 * np.sqrt(term / section.mass)
    mesh = fem.box_mesh("sheet", (a, b), (20, 12), kind="quad")
    ends = [fem.Support("x0", ("z", "rotation_x")), fem.Support("x1", ("z", "rotation_x"))]
    sides = [fem.Support("y0", ("z", "rotation_y")), fem.Support("y1", ("z", "rotation_y"))]
    inside = [fem.Support("x0", ("x", "y")), fem.Support("x1", ("x", "y"))]
    model = fem.StructureModel(
        mesh, {"sheet": shell(section, direction=(1, 0, 0))}, [*ends, *sides, *inside]
    )
    assert lowest_hz(fem.assemble(model), 1)[0] == pytest.approx(expected, rel=1e-2)


def test_the_shear_stiffness_of_a_sandwich_is_that_of_its_core():
    """Thin stiff faces of thickness t on a core c: G (c + t)²/c, Allen 1969."""
    face = fem.Layer.isotropic(7e10, 0.3, 2700.0, 1e-4)
    core = fem.Layer([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]], [[3e7, 0], [0, 2e7]], 50.0, 0.02)
    shear = np.array(fem.layered([face, core, face]).shear)
    expected = np.array([3e7, 2e7]) * (0.02 + 1e-4) ** 2 / 0.02
    np.testing.assert_allclose(np.diag(shear), expected, rtol=2e-3)


def test_turning_strains_is_turning_the_axes():
    """A strain tensor in axes turned by 25 degrees."""
    angle, tensor = np.radians(25.0), np.array([[1.0, 0.4], [0.4, -0.5]])
    R = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    expected = R @ tensor @ R.T
    found = strain_turn(angle) @ np.array([1.0, -0.5, 0.8])
    np.testing.assert_allclose(found, [expected[0, 0], expected[1, 1], 2 * expected[0, 1]])


def test_a_section_is_kept_in_files_and_bad_ones_are_named(tmp_path):
    mesh = fem.box_mesh("sheet", (1.0, 0.5), (1, 1), kind="quad")
    model = fem.StructureModel(mesh, {"sheet": shell(fem.layered([PLY]), direction=(1, 0, 0))})
    fem.assemble(model).save(tmp_path / "sheet.npz")
    assert fem.Component.load(tmp_path / "sheet.npz").model.parts == model.parts
    with pytest.raises(fem.ModelError, match="make an energy that can be negative"):
        zero = np.zeros((3, 3)).tolist()
        fem.PlateSection(np.diag([1.0, -1.0, 1.0]).tolist(), zero, zero, [[1, 0], [0, 1]], 1.0)
