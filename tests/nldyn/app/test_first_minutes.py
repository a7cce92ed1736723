"""What a new user meets first: examples to copy, results kept."""

import os
import subprocess
import sys

import pytest
from click.testing import CliRunner

import nldyn.scene.run
from nldyn.app.cli import main
from nldyn.base.resources import copy_example, example, example_titles
from nldyn.runtime.result_directory import result_directory
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene

ONE_DOF = example("one_dof.toml")


def invoke(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.mark.parametrize("name", example_titles())
def test_every_example_is_complete_when_copied(name, tmp_path, monkeypatch):
    """Its mesh lies beside it, also where the installed meshes are not allowed."""
    monkeypatch.setattr("nldyn.scene.component.data_directory", lambda: tmp_path / "nowhere")
    scene = load_scene(copy_example(name, tmp_path / "mine"))
    if scene.mesh is not None:
        assert (tmp_path / "mine" / scene.mesh.file).is_file()
        assert build_component(scene).mass.shape[0] > 0


def test_new_lists_copies_and_overwrites_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "one_dof               1-DOF model\n" in invoke("new").stdout
    assert invoke("new", "two_dof_xi_0.01.toml").exit_code == 0
    scene = tmp_path / "two_dof_xi_0.01" / "two_dof_xi_0.01.toml"
    assert "nldyn run two_dof_xi_0.01/two_dof_xi_0.01.toml --out" in invoke(
        "new", "two_dof_xi_0.01", "other"
    ).stdout.replace("other/", "two_dof_xi_0.01/")
    scene.write_text("mine")
    again = invoke("new", "two_dof_xi_0.01")
    assert (again.exit_code, scene.read_text()) == (2, "mine")
    assert again.stderr.endswith("is there already; choose another folder\n")
    assert "there is no example 'none'; there are bilinear" in invoke("new", "none").stderr
    for name, meant in (("two_dof", "two_dof_xi_0.001"), ("brumper", "bumper")):
        assert f"no example '{name}'; did you mean '{meant}'? There" in invoke("new", name).stderr


def test_results_of_another_scene_are_not_replaced_without_a_word(tmp_path, monkeypatch):
    monkeypatch.setattr(nldyn.scene.run, "results_of", lambda *_: pytest.fail("computed"))
    out, scene = tmp_path / "out", tmp_path / "scene.toml"
    out.mkdir()
    (out / ".nldyn.json").write_text("{}")
    text = ONE_DOF.read_text()
    (out / "scene.toml").write_text(text)
    scene.write_text(text.replace("gap = 0.0", "gap = 1e-4"))
    result = invoke("run", scene, "--out", out)
    assert result.exit_code == 2 and result.stderr.count("\n") == 1
    assert "holds the results of a scene that says something else" in result.stderr
    for same in (text, "# a remark\n" + text.replace('"1-DOF model"', '"another title"')):
        scene.write_text(same)
        with pytest.raises(pytest.fail.Exception, match="computed"):
            CliRunner().invoke(main, ["run", str(scene), "--out", str(out)], catch_exceptions=False)
    scene.write_text(text.replace("gap = 0.0", "gap = 1e-4"))
    replaced = ["run", str(scene), "--out", str(out), "--replace"]
    with pytest.raises(pytest.fail.Exception, match="computed"):
        CliRunner().invoke(main, replaced, catch_exceptions=False)


@pytest.mark.parametrize(
    "command", [["modes"], ["render"], ["backbone", "--amplitude-m", "1e-3"], ["converge"]]
)
def test_no_command_mixes_the_results_of_two_scenes(tmp_path, command):
    out, scene = tmp_path / "out", tmp_path / "scene.toml"
    scene.write_text(ONE_DOF.read_text())
    assert invoke("modes", scene, "--out", out).exit_code == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    scene.write_text(ONE_DOF.read_text().replace("gap = 0.0", "gap = 1e-4"))
    result = invoke(*command, scene, "--out", out)
    assert result.exit_code == 2 and result.stderr.count("\n") == 1
    assert "holds the results of a scene that says something else" in result.stderr
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_what_replaces_another_scene_leaves_nothing_of_it(tmp_path):
    out, scene = tmp_path / "out", tmp_path / "scene.toml"
    scene.write_text(ONE_DOF.read_text())
    assert invoke("modes", scene, "--out", out).exit_code == 0
    with result_directory(out, "run") as folder:
        (folder / "branches.csv").write_text("of the first scene")
    (out / "mine.txt").write_text("mine")
    scene.write_text(ONE_DOF.read_text().replace("gap = 0.0", "gap = 1e-4"))
    result = invoke("modes", scene, "--out", out, "--replace")
    assert result.exit_code == 0, result.stderr
    assert {path.name for path in out.iterdir()} == {
        ".nldyn.json", "mine.txt", "modes.csv", "scene.toml"
    }  # fmt: skip


def test_the_shell_completes_commands():
    asked = {"_NLDYN_COMPLETE": "bash_complete", "COMP_WORDS": "nldyn r", "COMP_CWORD": "1"}
    told = subprocess.run(
        [sys.executable, "-c", "from nldyn.app.cli import main; main(prog_name='nldyn')"],
        env={**os.environ, **asked}, capture_output=True, text=True, check=True,
    ).stdout.splitlines()  # fmt: skip
    assert told == ["plain,render", "plain,report", "plain,run"]
