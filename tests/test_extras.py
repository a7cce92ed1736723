"""Without an extra: what needs none works, and what needs one says so before any work."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
HIDE = """
import sys
class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {hidden}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
import importlib.util as found
known = found.find_spec
found.find_spec = lambda name, *more: None if name in {hidden} else known(name, *more)
sys.meta_path.insert(0, Hidden())
"""
REPORT, RENDER = ("matplotlib", "plotly"), ("pyvista", "vtkmodules", "imageio")
OF_TESTS = ("meshio", "gmsh")
COMMAND = "from nldyn.app.cli import main; main(sys.argv[1:])"


def without(hidden: tuple[str, ...], code: str, *arguments: str, folder: Path):
    return subprocess.run(
        [sys.executable, "-c", HIDE.format(hidden=hidden) + code, *arguments],
        cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def small_scene(tmp_path_factory) -> Path:
    """A plate of a mesh."""
    folder = tmp_path_factory.mktemp("small")
    text = (ROOT / "docs" / "examples" / "plate.toml").read_text("utf-8")
    scene = folder / "scene.toml"
    scene.write_text(text.replace("../../meshes", str(ROOT / "meshes")), encoding="utf-8")
    return scene


def test_matrices_and_meshes_need_neither(tmp_path):
    code = """
import fem
from nldyn import Stop, System, Unbalance, continue_branch, load, save, solve_orbit
made = fem.box_mesh("bar", (1.0, 0.1, 0.1), (2, 1, 1))
fem.write_mesh(made, "bar.vtu")
assert (fem.read_mesh("bar.vtu").points == made.points).all()
system = System.from_matrices(
    [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142,
    stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)],
)
branch = continue_branch(solve_orbit(system, frequency_hz=33.0), (33.0, 34.0))
save(branch, "branch.h5")
print([point.kind for point in load("branch.h5")[0].special_points])
"""
    run = without((*REPORT, *RENDER, *OF_TESTS), code, folder=tmp_path)
    assert run.stdout == "['PD']\n", run.stderr


def test_what_draws_says_which_extra_it_needs(tmp_path):
    run = without(REPORT, "from nldyn.plot import plot_diagram", folder=tmp_path)
    said = 'needs matplotlib, which is not installed: pip install "nldyn[report]"'
    assert run.stderr.splitlines()[-1] == f"ModuleNotFoundError: nldyn.plot.plot_diagram {said}"
    code = """
import fem.render
mesh, steel = fem.box_mesh("bar", (1.0, 0.1, 0.1), (2, 1, 1)), fem.Material(2e11, 7800, 0.3)
bar = fem.assemble(fem.StructureModel(mesh, {"bar": fem.SolidPart(steel)}))
print(fem.render.gl_available()[1])
import numpy as np
fem.render.write_page(bar, np.zeros((bar.stiffness.shape[0], 1)), ["rest"], "bar.html")
"""
    run = without(RENDER, code, folder=tmp_path)
    said = "what is drawn of a mesh needs pyvista and imageio, which are not installed: "
    assert run.stdout.startswith(said)
    assert run.stderr.splitlines()[-1].startswith(f"fem.render.gl.RenderError: {said}")


@pytest.mark.parametrize("command", ["run", "converge"])
def test_a_command_that_writes_pictures_says_so_before_any_work(tmp_path, small_scene, command):
    run = without(REPORT, COMMAND, command, str(small_scene), "--out", "out", folder=tmp_path)
    assert (run.returncode, run.stdout) == (3, ""), run.stderr
    assert run.stderr.startswith("nldyn: what this command draws needs ")
    assert run.stderr.count("\n") == 1 and 'pip install "nldyn[report]"' in run.stderr
    assert not (tmp_path / "out").exists()


def test_modes_are_told_without_any_and_drawn_by_the_extra(tmp_path, small_scene):
    scene = str(small_scene)
    run = without((*REPORT, *RENDER), COMMAND, "modes", scene, folder=tmp_path)
    assert run.returncode == 0 and "Hz" in run.stdout, run.stderr
    assert without((*REPORT, *RENDER), COMMAND, "check", scene, folder=tmp_path).returncode == 0
    run = without(RENDER, COMMAND, "modes", scene, "--out", "out", folder=tmp_path)
    assert run.returncode == 3 and "Hz" in run.stdout
    assert 'pip install "nldyn[render]"' in run.stderr and run.stderr.count("\n") == 1
    assert (tmp_path / "out" / "modes.csv").exists()
