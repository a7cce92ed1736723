"""The paper's half beam in solids against the frame, and what makes the difference."""

from dataclasses import replace

import make_meshes
import numpy as np
import pytest

import cms
import fem


@pytest.fixture(scope="module")
def dimensions():
    return make_meshes.read_dimensions()


@pytest.fixture(scope="module")
def frame(dimensions):
    mesh = fem.read_mesh(make_meshes.HERE / "half_beam.msh")
    return fem.assemble(make_meshes.half_beam_model(mesh, dimensions.middle_mass))


def solid(dimensions, poissons_ratio):
    mesh = fem.read_mesh(make_meshes.HERE / "half_beam_solid.vtu")
    model = make_meshes.solid_half_beam_model(mesh, dimensions.middle_mass, poissons_ratio)
    return fem.assemble(model)


@pytest.fixture(scope="module")
def solids(dimensions):
    return {nu: solid(dimensions, nu) for nu in (0.0, 0.3)}


def test_the_mesh_is_what_the_script_makes(dimensions):
    made = make_meshes.solid_half_beam_mesh(dimensions)
    read = fem.read_mesh(make_meshes.HERE / "half_beam_solid.vtu")
    np.testing.assert_allclose(read.points, made.points, atol=1e-15)
    for kind, cells in made.cells.items():
        assert np.array_equal(read.cells[kind], cells)


def test_without_lateral_contraction_solids_are_a_frame_of_timoshenko_beams(dimensions, solids):
    parts = {
        name: fem.BeamPart(
            fem.Material(part.material.youngs_modulus, part.material.density, 0.0),
            part.section,
            theory="timoshenko",
        )
        for name, part in make_meshes.PARTS.items()
    }
    plain = make_meshes.half_beam_model(
        make_meshes.half_beam_mesh(dimensions), dimensions.middle_mass
    )
    deep = fem.assemble(replace(plain, parts=parts))
    beam = cms.reduce(deep, modes=4, residual=False).frequencies_hz
    solid = cms.reduce(solids[0.0], modes=4, residual=False).frequencies_hz
    np.testing.assert_allclose(solid[:3], beam[:3], rtol=7e-4)
    slender = cms.reduce(fem.assemble(plain), modes=3, residual=False).frequencies_hz
    assert (np.abs(solid - beam)[1:3] < 0.5 * np.abs(solid[:3] - slender)[1:3]).all()
    assert solid[3] == pytest.approx(beam[3], rel=4e-3)


def test_lateral_contraction_stiffens_the_leaf_as_a_plate(frame, solids):
    found = [cms.reduce(solids[nu], modes=4, residual=False).frequencies_hz for nu in (0.0, 0.3)]
    beam = cms.reduce(frame, modes=4, residual=False).frequencies_hz
    # a plate that is wide against its length has the limit 1/sqrt(1 - nu²) = 1.0483
    assert 1.04 < found[1][3] / found[0][3] < 1.0483
    np.testing.assert_allclose(found[1][:3], beam[:3], rtol=4e-3)


def test_the_reduced_models_agree(frame, solids):
    reduced = [cms.reduce(component, modes=3) for component in (frame, solids[0.3])]
    np.testing.assert_allclose(reduced[1].frequencies_hz, reduced[0].frequencies_hz, rtol=7e-3)
    seen = [np.abs(model.participation["middle"]) for model in reduced]
    np.testing.assert_allclose(seen[1][:3], seen[0][:3], rtol=2e-3)
    flexible = [model.static_flexibility("middle") for model in reduced]
    assert flexible[1] == pytest.approx(flexible[0], rel=2e-3)
