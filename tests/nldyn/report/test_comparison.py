"""Modes of two meshes against each other: against the shapes of Euler and Bernoulli, and solids."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import cms
import fem
from nldyn.app.cli import main
from nldyn.base.errors import SceneError
from nldyn.base.resources import example
from nldyn.report.comparison import compare_modes
from nldyn.scene.build import Structure, build_structure
from nldyn.scene.read import load_scene

BEAM = load_scene(example("four_dof_xi_0.01.toml"))
STEEL = fem.Material(2.1e11, 7800.0, poissons_ratio=0.3)
ROOTS = np.array([1.8751040687, 4.6940911330, 7.8547574382])


def cantilever(elements, modes=3, length=1.0):
    mesh = fem.frame_mesh({"root": (0, 0), "tip": (length, 0)}, [("arm", "root", "tip", elements)])
    part = fem.BeamPart(fem.Material(2e11, 7800.0), fem.RectangularSection(0.1, 0.02))
    held = [fem.Support("root", ("x", "y", "rotation"))]
    component = fem.assemble(fem.StructureModel(mesh, {"arm": part}, held, plane=True))
    return Structure(component, cms.reduce(component, modes=modes, method="truncation"))


def euler_bernoulli(x):
    sigma = (np.cosh(ROOTS) + np.cos(ROOTS)) / (np.sinh(ROOTS) + np.sin(ROOTS))
    z = np.outer(x, ROOTS)
    return np.cosh(z) - np.cos(z) - sigma * (np.sinh(z) - np.sin(z))


@pytest.mark.parametrize("finer", [20, 37])  # with the nodes of the coarse mesh, and without
def test_the_criterion_is_that_of_the_exact_shapes_at_the_coarser_nodes(finer):
    coarse = cantilever(10)
    exact = euler_bernoulli(coarse.component.model.mesh.points[:, 0])
    for pair in ((coarse, cantilever(finer)), (cantilever(finer), coarse)):
        found = compare_modes(BEAM, pair[0], BEAM, pair[1])
        np.testing.assert_allclose(found.mac, cms.mac(exact, exact), atol=2e-3)
        assert found.partners == [0, 1, 2]


def test_signs_turn_the_others_to_the_same_side():
    here = cantilever(10)
    there = cantilever(20)
    found = compare_modes(BEAM, here, BEAM, there)
    tips = [s.component.shape(s.reduced.basis[:, 1]) for s in (here, there)]
    ends = [
        t[s.component.model.mesh.points[:, 0].argmax(), 1]
        for t, s in zip(tips, (here, there), strict=True)
    ]
    assert np.sign(ends[0]) == found.signs[1] * np.sign(ends[1])


def test_more_modes_leave_the_kept_ones_alone():
    found = compare_modes(BEAM, cantilever(10, 2), BEAM, cantilever(10, 3))
    assert found.mac.shape == (2, 3)
    assert found.mac[[0, 1], [0, 1]] == pytest.approx([1.0, 1.0], abs=1e-12)


def test_a_frame_and_solids_of_one_beam_have_the_same_modes():
    solid = load_scene(example("solid_beam.toml"))
    found = compare_modes(BEAM, build_structure(BEAM), solid, build_structure(solid))
    assert found.partners[:3] == [0, 1, 2]
    assert found.mac[[0, 1, 2], [0, 1, 2]].min() > 0.999


def test_modes_of_one_frequency_are_compared_as_a_space():
    """Rigid-body modes, and the two bending modes of a square bar in any two directions."""
    free, square = [], []
    for shape in ((4, 1, 1), (7, 1, 1)):
        box = fem.box_mesh("bar", (0.4, 0.02, 0.02), shape, kind="hexahedron20")
        for of, held in ((free, []), (square, [fem.Support("x0", ("x", "y", "z"))])):
            model = fem.StructureModel(box, {"bar": fem.SolidPart(STEEL)}, held)
            component = fem.assemble(model)
            of.append((component, cms.reduce(component, modes=6, method="truncation")))
    found = compare_modes(BEAM, Structure(*free[0]), BEAM, Structure(*free[1]))
    np.testing.assert_allclose(found.mac.max(axis=1), 1.0, atol=1e-9)
    assert sorted(found.partners) == list(range(6))
    component, reduced = square[1]
    turned = reduced.basis.copy()
    turned[:, :2] = turned[:, :2] @ [[0.8, -0.6], [0.6, 0.8]]
    other = Structure(component, replace(reduced, basis=turned))
    found = compare_modes(BEAM, Structure(*square[0]), BEAM, other)
    assert found.partners[:2] == [0, 1]
    assert found.mac[:2].max(axis=1).min() > 0.999


def test_another_structure_and_none_are_refused():
    with pytest.raises(SceneError, match=r"is no mesh of the structure in .*, whose node at \("):
        compare_modes(BEAM, cantilever(10), BEAM, cantilever(10, length=2.0))
    with pytest.raises(SceneError, match="has no mesh, so that its modes cannot be compared"):
        compare_modes(BEAM, cantilever(10), load_scene(example("one_dof.toml")), Structure())


def test_the_command_tells_and_writes_the_comparison(tmp_path, monkeypatch):
    monkeypatch.setattr("fem.render.gl_available", lambda: (False, "install libegl1"))
    scenes = [str(example(f"{n}_dof_xi_0.01.toml")) for n in ("four", "two")]
    arguments = ["modes", scenes[0], "--against", scenes[1]]
    result = CliRunner().invoke(main, [*arguments, "--out", str(tmp_path / "out")])
    assert "most like" in result.stdout and (tmp_path / "out" / "mac.csv").is_file()
    assert (tmp_path / "out" / "mac.png").is_file()
    told = json.loads(CliRunner().invoke(main, [*arguments, "--json"]).stdout)["against"]
    assert told[0]["partner"] == 1 and told[0]["mac_with_1"] == pytest.approx(1.0, abs=1e-9)
    refused = CliRunner().invoke(main, ["modes", scenes[0], "--animate"])
    assert refused.stderr == "nldyn: '--animate' needs '--out'\n"
