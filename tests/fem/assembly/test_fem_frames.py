"""Frames: exact frequencies, symmetry, invariances, and the paper's beam."""

import make_meshes
import numpy as np
import pytest
from dynamic_stiffness import Member, natural_frequency
from frames import BAR, EA, EI, RHO_A, bending_hz, frequencies_hz, refined_frequencies_hz
from hypothesis import given
from hypothesis import strategies as st
from portals import THIN_BAR, THIN_MEMBERS, exact_portal_frequencies, portal

import fem


def test_dynamic_stiffness_gives_the_cantilever():
    found = natural_frequency([(0, 0), (1, 0)], [Member(0, 1, EA, EI, RHO_A)], [0, 1, 2], 10, 20)
    assert found == pytest.approx(bending_hz(1.8751040687119611), rel=1e-12)


def test_portal_frame_has_the_frequencies_of_the_continuous_frame():
    exact = np.array(exact_portal_frequencies())
    assert len(exact) == 2
    found = frequencies_hz(fem.assemble(portal(64)), 2)
    assert found == pytest.approx(exact, rel=1e-7)
    assert (found > exact).all()


def test_portal_frame_of_slender_bars_converges_with_the_fourth_power():
    exact = exact_portal_frequencies(THIN_MEMBERS)[0]
    errors = [
        frequencies_hz(fem.assemble(portal(n, part=THIN_BAR)), 1)[0] / exact - 1 for n in (2, 4, 8)
    ]
    assert np.diff(np.log(errors)) / -np.log(2) == pytest.approx([4, 4], abs=0.1)


def test_stretching_leaves_an_error_of_second_order():
    exact = exact_portal_frequencies()[0]
    errors = [frequencies_hz(fem.assemble(portal(n)), 1)[0] / exact - 1 for n in (32, 64)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)


REFERENCE = frequencies_hz(fem.assemble(portal(4)), 8)


@given(turn=st.floats(-10, 10), x=st.floats(-3, 3), y=st.floats(-3, 3))
def test_turning_and_moving_a_frame_changes_no_frequency(turn, x, y):
    found = frequencies_hz(fem.assemble(portal(4, turn, (x, y))), 8)
    assert found == pytest.approx(REFERENCE, rel=1e-10)


@given(a=st.floats(1e-3, 1e3), b=st.floats(1e-3, 1e3))
def test_frequencies_scale_with_the_root_of_stiffness_over_mass(a, b):
    material = fem.Material(a * BAR.material.youngs_modulus, b * BAR.material.density)
    found = frequencies_hz(fem.assemble(portal(4, part=fem.BeamPart(material, BAR.section))), 8)
    assert found == pytest.approx(REFERENCE * np.sqrt(a / b), rel=1e-10)


@given(scale=st.floats(0.01, 100))
def test_a_frame_of_another_size_has_frequencies_of_one_over_the_size(scale):
    model = portal(4)
    section = fem.RectangularSection(scale * 0.03, scale * 0.02)
    part = fem.BeamPart(BAR.material, section)
    scaled = fem.StructureModel(
        model.mesh.with_points(scale * model.mesh.points),
        {"post": part, "girder": part},
        supports=model.supports,
        plane=True,
    )
    found = frequencies_hz(fem.assemble(scaled), 8)
    assert found == pytest.approx(REFERENCE / scale, rel=1e-10)


@given(seed=st.integers(0, 2**32 - 1))
def test_order_and_direction_of_elements_change_no_frequency(seed):
    random = np.random.default_rng(seed)
    mesh = portal(4).mesh
    nodes = random.permutation(len(mesh.points))
    order = random.permutation(len(mesh.cells["line"]))
    place, back = np.argsort(nodes), np.argsort(order)
    lines = place[mesh.cells["line"][order]]
    flipped = random.random(len(lines)) < 0.5
    lines[flipped] = lines[flipped][:, ::-1]
    shuffled = fem.StructureMesh(
        mesh.points[nodes],
        {"line": lines},
        {name: {"line": back[group["line"]]} for name, group in mesh.groups.items()},
        {name: place[point] for name, point in mesh.point_sets.items()},
    )
    model = fem.StructureModel(
        shuffled, {"post": BAR, "girder": BAR}, supports=portal(4).supports, plane=True
    )
    assert frequencies_hz(fem.assemble(model), 8) == pytest.approx(REFERENCE, rel=1e-10)


def test_matrices_are_symmetric_to_the_last_bit_and_mass_is_positive_definite():
    component = fem.assemble(portal(6, turn=0.3))
    for matrix in (component.stiffness, component.mass):
        assert abs(matrix - matrix.T).max() == 0.0
    np.linalg.cholesky(component.mass.toarray())


def paper_members():
    def member(stop, part):
        section, material = part.section, part.material
        E = material.youngs_modulus
        return Member(
            0, stop, E * section.area, E * section.second_moment, material.density * section.area
        )

    return [member(1, make_meshes.BEAM), member(2, make_meshes.LEAF)]


def test_half_beam_is_within_1e_7_of_the_continuous_beam():
    dimensions = make_meshes.read_dimensions()
    nodes = [(0, 0), (dimensions.beam_length / 2, 0), (0, -dimensions.leaf_length)]
    lumps = {4: (0.0, dimensions.middle_mass / 2)}
    exact = [
        natural_frequency(nodes, paper_members(), [3, 5, 6, 7, 8], *bracket, lumps)
        for bracket in ((12, 14), (112, 122), (320, 332))
    ]
    mesh = fem.read_mesh(make_meshes.HERE / "half_beam.msh")
    model = make_meshes.half_beam_model(mesh, dimensions.middle_mass)
    assert refined_frequencies_hz(fem.assemble(model), 3) == pytest.approx(exact, rel=1e-7)


def test_half_and_full_beam_agree_on_the_symmetric_modes():
    mass = make_meshes.read_dimensions().middle_mass
    half = fem.assemble(
        make_meshes.half_beam_model(fem.read_mesh(make_meshes.HERE / "half_beam.msh"), mass)
    )
    full = fem.assemble(
        make_meshes.full_beam_model(fem.read_mesh(make_meshes.HERE / "full_beam.msh"), mass)
    )
    whole = refined_frequencies_hz(full, 12)
    for frequency in refined_frequencies_hz(half, 5):
        assert np.abs(whole / frequency - 1).min() < 1e-9


def test_half_and_full_beam_agree_on_the_static_flexibility_at_the_middle():
    dimensions = make_meshes.read_dimensions()
    components = [
        fem.assemble(model(mesh(dimensions, 9, 4), dimensions.middle_mass))
        for mesh, model in (
            (make_meshes.half_beam_mesh, make_meshes.half_beam_model),
            (make_meshes.full_beam_mesh, make_meshes.full_beam_model),
        )
    ]
    half, full = (
        c.interfaces["middle"] @ np.linalg.solve(c.stiffness.toarray(), c.interfaces["middle"])
        for c in components
    )
    assert half == pytest.approx(2 * full, rel=1e-9)


def test_shipped_meshes_are_those_of_the_calibrated_dimensions():
    dimensions = make_meshes.read_dimensions()
    for name, made in (
        ("half_beam.msh", make_meshes.half_beam_mesh(dimensions)),
        ("full_beam.msh", make_meshes.full_beam_mesh(dimensions)),
    ):
        read = fem.read_mesh(make_meshes.HERE / name)
        assert np.array_equal(read.points, made.points)
        assert np.array_equal(read.cells["line"], made.cells["line"])
