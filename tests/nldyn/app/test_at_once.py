"""What is answered at once: the engine and the large libraries are not even loaded."""

import json
import subprocess
import sys
from functools import cache

import pytest

from nldyn.base.resources import example

SLOW = {
    "nldyn.engine.newton",
    "nldyn.flow.flow_map",
    "matplotlib",
    "pyvista",
    "h5py",
}
REPORT = """
import json, sys
from nldyn.app.cli import main
try:
    main(sys.argv[1:])
except SystemExit as end:
    print(json.dumps([end.code, sorted(sys.modules)]), file=sys.stderr)
"""


@cache
def answer(*arguments):
    """Exit code, what was said on stdout and stderr, and which slow modules were loaded."""
    run = subprocess.run(
        [sys.executable, "-c", REPORT, *map(str, arguments)],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    *said, last = run.stderr.splitlines()
    code, modules = json.loads(last)
    return code, run.stdout, said, SLOW & set(modules)


@pytest.mark.parametrize(
    "name", ["one_dof", "portal", "plate"], ids=["modal", "frame with tolerance", "structure"]
)
def test_check_computes_nothing(name):
    code, said, _, slow = answer("check", example(f"{name}.toml"))
    assert code == 0 and "no fault found" in said
    assert not slow


def test_check_tells_which_modes_a_tolerance_chooses_from():
    _, said, _, _ = answer("check", example("portal.toml"))
    modes = [line for line in said.splitlines() if line[:4].strip().isdigit()]
    cutoff = float(said.partition("modes up to ")[2].partition(" Hz")[0])
    kept = [line for line in modes if "residual" not in line]
    assert kept and all(float(line.split()[1]) <= cutoff for line in kept)
    assert "as many as tolerance = 0.02 needs" in said


@pytest.mark.parametrize("arguments", [["--version"], ["run", "--help"]], ids=lambda a: " ".join(a))
def test_help_loads_nothing(arguments):
    code, said, _, slow = answer(*arguments)
    assert code == 0 and said and not slow


@pytest.mark.parametrize("command", ["run", "render", "converge"])
def test_a_scene_is_refused_at_once(tmp_path, command):
    scene = tmp_path / "scene.toml"
    scene.write_text(example("one_dof.toml").read_text() + "\n[continuaton]\n")
    code, _, errors, slow = answer(command, scene, "--out", tmp_path / "out")
    assert code == 2 and len(errors) == 1 and "continuaton" in errors[0] and not slow


def test_a_file_in_the_place_of_the_results_is_refused_at_once(tmp_path):
    (tmp_path / "file").write_text("taken")
    code, _, errors, slow = answer("run", example("one_dof.toml"), "--out", tmp_path / "file")
    assert code == 2 and len(errors) == 1 and "is a file" in errors[0] and not slow
