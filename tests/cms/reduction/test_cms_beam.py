"""The half beam: the reduced models' published frequencies.

"Periodic solutions of a multi-DOF beam system with impact", sections 4 and 5.
"""

from __future__ import annotations

import dataclasses
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

import cms
import fem

MESHES = Path(__file__).parents[3] / "meshes"


@pytest.fixture(scope="module")
def half_beam():
    numbers = tomllib.loads((MESHES / "half_beam.toml").read_text())
    section = fem.RectangularSection
    return fem.assemble(
        fem.StructureModel(
            fem.read_mesh(MESHES / "half_beam.msh"),
            parts={
                "beam": fem.BeamPart(fem.Material(2.1e11, 7746.0), section(0.09, 0.01)),
                "leaf": fem.BeamPart(fem.Material(2.1e11, 7713.0), section(0.075, 0.001)),
            },
            supports=[
                fem.Support("middle", ("x", "rotation")),
                fem.Support("foot", ("x", "y", "rotation")),
            ],
            point_masses=[fem.PointMass("middle", numbers["middle_mass"] / 2)],
            interfaces={"middle": fem.Interface("middle", "y")},
            plane=True,
        )
    )


@pytest.mark.parametrize("modes, published", [(1, [13.1, 125.1]), (3, [13.1, 117.5, 326.5, 749.5])])
def test_published_frequencies(half_beam, modes, published):
    """Within 0.2 %: the rounding of the published values and of the calibration to them."""
    np.testing.assert_allclose(
        cms.reduce(half_beam, modes=modes).frequencies_hz, published, rtol=2e-3
    )


@pytest.mark.parametrize("modes", [0, 1, 3, 12])
def test_static_flexibility_of_the_beam(half_beam, modes):
    middle = half_beam.interfaces["middle"]
    exact = middle @ spsolve(half_beam.stiffness.tocsc(), middle)
    reduced = cms.reduce(half_beam, modes=modes)
    assert reduced.static_flexibility("middle") == pytest.approx(exact, rel=1e-9)


def test_very_fine_mesh_loses_no_digits(half_beam):
    """The 72 elements of the mesh are within 1e-7 of the continuous beam, see the tests of fem."""
    model = half_beam.model
    coarse = model.mesh
    points = {name: coarse.points[coarse.node(name)] for name in coarse.point_sets}
    members = [("beam", "corner", "middle", 1000), ("leaf", "corner", "foot", 280)]
    fine = fem.assemble(dataclasses.replace(model, mesh=fem.frame_mesh(points, members)))
    frequencies = [cms.reduce(c, modes=1).frequencies_hz[0] for c in (half_beam, fine)]
    assert abs((frequencies[1] / frequencies[0]) ** 2 - 1) < 1e-7


def test_cutoff_of_the_four_dof_model(half_beam):
    """The paper calls it valid up to 500 Hz; the leaf's own bending lies above 400 Hz."""
    assert cms.reduce(half_beam, cutoff_hz=400.0).modes == 3


def test_error_estimates_of_the_beam(half_beam):
    reduced = cms.reduce(half_beam, modes=3)
    assert np.all(reduced.residuals[:3] < 1e-11)
    assert reduced.residuals[3] > 0.1


def test_expanded_modes_are_shapes_of_the_mesh(half_beam):
    reduced = cms.reduce(half_beam, modes=1)
    shape = half_beam.shape(reduced.expand([1.0, 0.0]))
    middle = half_beam.model.mesh.node("middle")
    assert shape[middle, 1] == pytest.approx(reduced.participation["middle"][0])
