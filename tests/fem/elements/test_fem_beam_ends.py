"""Ends of beams: offsets, released directions; orientations and sections of single lines."""

import numpy as np
import pytest

import fem
from fem.elements.beams import element_matrices, element_rows

STEEL = fem.Material(2.1e11, 7800.0, 0.3)
SECTION = fem.Section(1e-3, 8e-8, 2e-8, 5e-8)
ALL = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
LENGTH = 2.0
E, SECOND = STEEL.youngs_modulus, SECTION.second_moment


def line(points, **more):
    mesh = fem.StructureMesh(points, {"line": [[0, 1]]}, {"arm": {"line": [0]}})
    mesh = mesh.with_point_sets({"a": [0], "b": [1]})
    part = fem.BeamPart(STEEL, SECTION, orientation=(0.0, 1.0, 0.0), **more)
    return fem.StructureModel(mesh, {"arm": part})


def matrices(model):
    found = fem.assemble(model)
    A, d = found.natural_form.deformations, found.natural_form.stiffness
    rows = A @ np.eye(A.shape[1])
    K = found.stiffness.toarray()
    np.testing.assert_allclose(rows.T @ (d[:, None] * rows), K, atol=1e-9 * np.abs(K).max())
    return K, found.mass.toarray()


def test_ends_off_their_nodes_are_as_if_joined_to_them_by_rigid_bodies():
    """Against nodes at the ends that couplings join to the others."""
    offsets = np.array([[0.1, 0.2, -0.3], [-0.2, 0.1, 0.15]])
    nodes = np.array([[0.0, 0.0, 0.0], [LENGTH, 0.5, 0.2]])
    given = matrices(line(nodes, end_offsets=offsets))
    mesh = fem.StructureMesh(
        np.vstack([nodes, nodes + offsets]),
        {"line": [[2, 3]]},
        {"arm": {"line": [0]}},
        {"a": [0], "b": [1], "a'": [2], "b'": [3]},
    )
    joined = fem.StructureModel(
        mesh,
        {"arm": fem.BeamPart(STEEL, SECTION, orientation=(0.0, 1.0, 0.0))},
        couplings=[fem.Coupling("a", "a'"), fem.Coupling("b", "b'")],
    )
    for one, other in zip(given, matrices(joined), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9 * np.abs(other).max())


@pytest.mark.parametrize(
    ("released", "direction", "stiffness"),
    [
        (None, "y", 12 * E * SECOND / LENGTH**3),
        (((), (5,)), "y", 3 * E * SECOND / LENGTH**3),
        (((5,), ()), "y", 3 * E * SECOND / LENGTH**3),
        (((5,), (5,)), "y", 0.0),
        (((), (4,)), "y", 12 * E * SECOND / LENGTH**3),
        (((), (4,)), "z", 3 * E * SECTION.second_moment_across / LENGTH**3),
        (((0,), ()), "x", 0.0),
        ((((), (3, 4, 5)),), "x", E * SECTION.area / LENGTH),  # for each line
    ],
)
def test_released_ends_resist_as_beams_with_pins_do(released, direction, stiffness):
    part = fem.BeamPart(STEEL, SECTION, orientation=(0.0, 1.0, 0.0), released=released)
    (K,), (M,) = element_matrices(part, np.array([[LENGTH, 0.0, 0.0]]), "arm")
    at = 6 + ALL.index(direction)
    assert K[at, at] == pytest.approx(stiffness, rel=1e-9, abs=1e-6)
    (rows,), (weights,) = element_rows(part, np.array([[LENGTH, 0.0, 0.0]]), "arm")
    relative = np.hstack([-rows[:, :3], rows[:, 3:6], rows[:, :3], rows[:, 6:]])
    natural = relative.T @ (weights[:, None] * relative)
    np.testing.assert_allclose(natural, K, atol=1e-9 * np.abs(K).max())
    shift = np.zeros(12)
    shift[[1, 7]] = 1.0  # both ends along y
    assert shift @ M @ shift == pytest.approx(STEEL.density * SECTION.area * LENGTH)


def test_each_line_may_have_its_own_orientation():
    """Two lines whose heights are turned by a right angle, as two parts."""
    points = [[0, 0, 0], [1, 0, 0], [2, 0, 0]]
    ways = [(0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    mesh = fem.StructureMesh(points, {"line": [[0, 1], [1, 2]]}, {"all": {"line": [0, 1]}})
    one = fem.StructureModel(mesh, {"all": fem.BeamPart(STEEL, SECTION, orientation=ways)})
    groups = {"first": {"line": [0]}, "second": {"line": [1]}}
    parts = {
        name: fem.BeamPart(STEEL, SECTION, orientation=way)
        for name, way in zip(groups, ways, strict=True)
    }
    mesh = fem.StructureMesh(points, mesh.cells, groups)
    for given, other in zip(matrices(one), matrices(fem.StructureModel(mesh, parts)), strict=True):
        np.testing.assert_allclose(given, other, rtol=1e-12, atol=1e-12 * np.abs(other).max())
    changed = fem.refined(one.mesh, 2)
    with pytest.raises(fem.ModelError, match="it has 4 lines, but orientations or offsets of 2"):
        fem.assemble(fem.StructureModel(changed, one.parts))


def test_a_section_that_changes_linearly_stretches_and_bends_by_its_mean():
    """Uniform stretching and uniform curvature of one element cost the mean of EA and of EI."""
    end = fem.Section(3e-3, 2e-8, 1e-8, 5e-8)
    mesh = line([[0, 0, 0], [LENGTH, 0, 0]]).mesh
    part = fem.BeamPart(STEEL, fem.LinearSection(SECTION, end), orientation=(0.0, 1.0, 0.0))
    model = fem.StructureModel(mesh, {"arm": part})
    K, M = matrices(model)
    dofs = fem.assemble(model).numbering.dofs(np.arange(2))
    stretch, bend = np.zeros(12), np.zeros(12)
    stretch[dofs[1, 0]] = 1.0
    bend[dofs[1, 5]], bend[dofs[0, 5]] = 0.5, -0.5
    assert stretch @ K @ stretch == pytest.approx(E * 2e-3 / LENGTH)
    assert bend @ K @ bend == pytest.approx(E * 5e-8 / LENGTH)
    shift = np.zeros(12)
    shift[dofs[:, 1]] = 1.0
    assert shift @ M @ shift == pytest.approx(STEEL.density * 2e-3 * LENGTH)


def test_a_beam_twists_about_its_shear_centre_and_stretches_at_its_centroid():
    """A cantilever whose nodes lie at the shear centres: four tip loads in closed form."""
    y, z = 0.03, 0.05
    model = line([[0, 0, 0], [LENGTH, 0, 0]], neutral_axis=(y, z))
    K, M = matrices(model)
    dofs = fem.assemble(model).numbering.dofs(np.arange(2))[1]
    flexibility = np.linalg.inv(K[np.ix_(dofs, dofs)])
    G = E / 2.6
    bending = LENGTH**3 / (3 * E * SECOND)
    assert flexibility[1, 1] == pytest.approx(bending)  # along y through the shear centre
    assert flexibility[3, 1] == pytest.approx(0.0, abs=1e-12 * flexibility[3, 3])  # no twist
    assert flexibility[3, 3] == pytest.approx(LENGTH / (G * SECTION.torsion_constant))
    # pulled aside of the centroid it stretches and bends by the moments of the eccentric force
    across = y**2 * LENGTH / (E * SECOND) + z**2 * LENGTH / (E * SECTION.second_moment_across)
    assert flexibility[0, 0] == pytest.approx(LENGTH / (E * SECTION.area) + across)
    spin = np.zeros(12)
    every = fem.assemble(model).numbering.dofs(np.arange(2))
    spin[every[:, 3]] = 1.0  # both ends about the line of shear centres
    polar = SECTION.second_moment + SECTION.second_moment_across + SECTION.area * (y**2 + z**2)
    assert spin @ M @ spin == pytest.approx(STEEL.density * polar * LENGTH)


def test_what_beams_have_is_kept_in_files(tmp_path):
    model = line([[0, 0, 0], [LENGTH, 0, 0]], end_offsets=np.eye(3)[:2], released=((), (5,)))
    fem.assemble(model).save(tmp_path / "arm.npz")
    assert fem.Component.load(tmp_path / "arm.npz").model.parts == model.parts


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"released": ((), (6,))}, "released must be directions out of 0 to 5"),
        ({"end_offsets": [[1.0, 2.0]]}, r"end_offsets must be finite numbers of shape \(2, 3\)"),
    ],
)
def test_bad_ends_are_named(more, said):
    with pytest.raises(fem.ModelError, match=said):
        fem.BeamPart(STEEL, SECTION, **more)
