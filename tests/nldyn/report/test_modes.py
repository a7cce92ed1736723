"""Modes of a scene: effective masses of a cantilever, and what the commands say and draw."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import cms
import fem.render
from fem.render.views import axes_of_view
from nldyn.app.cli import main
from nldyn.app.describe import described_as_json
from nldyn.base.resources import example
from nldyn.report.modes import mode_table
from nldyn.scene.build import Structure
from nldyn.scene.read import load_scene
from nldyn.system.system import System

BEAM = example("four_dof_xi_0.01.toml")


def invoke(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def test_effective_masses_of_a_cantilever_are_those_of_euler_and_bernoulli():
    """(2 sigma_k / lambda_k)**2 of its mass, with cos(l) cosh(l) = -1."""
    mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 40)])
    part = fem.BeamPart(fem.Material(2e11, 7800.0), fem.RectangularSection(0.1, 0.02))
    component = fem.assemble(
        fem.StructureModel(
            mesh, {"arm": part}, [fem.Support("root", ("x", "y", "rotation"))],
            interfaces={"tip": fem.Interface("tip", "y")},
            plane=True,
        )
    )  # fmt: skip
    structure = Structure(component, cms.reduce(component, modes=3, residual=False))
    table = mode_table(load_scene(BEAM), structure)
    roots = np.array([1.8751040687, 4.6940911330, 7.8547574382])
    sigma = (np.sinh(roots) - np.sin(roots)) / (np.cosh(roots) + np.cos(roots))
    mass = 7800.0 * 0.1 * 0.02
    assert table.mass == pytest.approx(mass)
    np.testing.assert_allclose(
        table.effective_mass[:, 1] / mass, (2 * sigma / roots) ** 2, rtol=1e-4
    )
    assert np.all(table.effective_mass[:, 0] < 1e-12 * mass)
    assert "effective mass of 3 modes: x 0 kg, y " in table.report()  # no rounding is told


def test_modes_are_told_and_written(tmp_path, monkeypatch):
    monkeypatch.setattr("fem.render.gl_available", lambda: (False, "install libegl1"))
    result = invoke("modes", BEAM, "--modes", "1,3", "--out", tmp_path / "out")
    assert result.exit_code == 3 and result.stderr == "nldyn: install libegl1\n"
    rows = [line.split()[0] for line in result.stdout.splitlines()[1:3]]
    assert rows == ["1", "3"]
    assert f"written to {tmp_path / 'out'}: mode_shapes.html, modes.csv" in result.stdout
    with (tmp_path / "out" / "modes.csv").open() as file:
        table = list(csv.DictReader(file))
    told = json.loads(invoke("modes", BEAM, "--json").stdout)["modes"]
    assert [float(row["frequency_hz"]) for row in table] == [row["frequency_hz"] for row in told]
    assert told[0]["frequency_hz"] == pytest.approx(13.1, rel=2e-3)  # published
    page = (tmp_path / "out" / "mode_shapes.html").read_text(encoding="utf-8")
    assert "mode 1: 13.1 Hz" in page and "mode 2" not in page and "mode 3" in page


def test_modes_that_are_not_there_and_other_views_are_refused(tmp_path):
    for command in (("modes", BEAM), ("render", BEAM, "--out", tmp_path / "out")):
        result = invoke(*command, "--modes", "9")
        assert result.exit_code == 2 and "has modes 1 to 4, no mode 9" in result.stderr
        assert "is not one of 'motion', 'oblique'" in invoke(*command, "--view", "under").stderr
    assert not (tmp_path / "out").exists()
    assert invoke("modes", BEAM, "--open").stderr == "nldyn: '--open' needs '--out'\n"


def test_a_scene_without_a_mesh_has_a_table_only(tmp_path):
    result = invoke("modes", example("one_dof.toml"), "--out", tmp_path / "out")
    assert result.exit_code == 0 and result.stdout.endswith(": modes.csv, scene.toml\n")


def test_check_and_run_tell_numbers_as_json(tmp_path):
    told = json.loads(invoke("check", example("one_dof.toml"), "--json").stdout)
    assert told["static_flexibility_m_per_n"]["middle"] == pytest.approx(1 / 16877.0, rel=1e-12)
    scene = tmp_path / "short.toml"
    text = example("one_dof.toml").read_text().replace("[1, 2, 3]", "[1]\nfollow_doublings = 0")
    scene.write_text(text.replace("[5.0, 90.0]", "[33.0, 34.0]\nsearch_points = 1"))
    result = invoke("run", scene, "--out", tmp_path / "out", "--json", "--quiet", "--jobs", "1")
    told = json.loads(result.stdout)
    assert told["special_points"] == {"PD": 1} and told["branches"][0]["special_points"] == 1
    kept = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert {name: told[name] for name in kept} == kept


def test_flexibilities_of_rotations_are_in_rad_for_a_moment():
    """A key of their own: no number stands under a unit that is not its own."""
    stiffness = np.diag([50.0, 200.0])
    vectors = {"tip": [1.0, 0.0], "joint": [0.0, 1.0]}
    system = System.from_matrices(np.eye(2), stiffness, vectors)
    system = replace(system, rotations=frozenset({"joint"}))
    told = described_as_json(system)
    assert told["static_flexibility_m_per_n"] == {"tip": pytest.approx(0.02)}
    assert told["static_flexibility_rad_per_n_m"] == {"joint": pytest.approx(0.005)}


@pytest.mark.parametrize("view", fem.render.VIEWS)
def test_a_view_looks_along_its_direction(view):
    """The directions of the picture are at right angles; of the top view x is to the right."""
    pyvista = pytest.importorskip("pyvista")
    plotter = pyvista.Plotter(off_screen=True)
    plotter.add_mesh(pyvista.Box((0.0, 3.0, 0.0, 2.0, 0.0, 1.0)))
    axes = axes_of_view(view, np.zeros((1, 3)), np.zeros((1, 3)))
    back = np.array(fem.render.VIEWS[view]) / np.linalg.norm(fem.render.VIEWS[view])
    fem.render.pictures.fit_camera(plotter, (800, 600), axes)
    eye, focus, up = map(np.array, plotter.camera_position)
    np.testing.assert_allclose((eye - focus) / np.linalg.norm(eye - focus), back, atol=1e-12)
    assert abs(up @ back) < 1e-12
    assert (up[1] > 0.0) if view != "top" else np.allclose(np.cross(up, back), (1.0, 0.0, 0.0))
    plotter.close()


def test_a_window_is_opened_where_there_is_a_screen(monkeypatch):
    shown = []

    class Window:
        def show(self):
            shown.append(self)

    def drawn(_component, shapes, titles, **kinds):
        assert shapes.shape[1] == len(titles) == 2 and kinds["view"] == "top"
        return Window()

    monkeypatch.setattr("fem.render.render_modes", drawn)
    asked = ("modes", BEAM, "--modes", "1,3", "--view", "top")
    for screen, windows in ((True, 1), (False, 0)):
        shown.clear()
        monkeypatch.setattr("fem.render.gl.has_screen", lambda there=screen: there)
        result = invoke(*asked, "--window")
        assert (result.exit_code, len(shown)) == (0, windows)
        assert ("no window can be opened here" in result.stderr) == (not screen)
        assert invoke(*asked).exit_code == 0 and len(shown) == windows  # no terminal, no window
