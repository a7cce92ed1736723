"""Structures from meshers with names of their own, from the file to special points."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import cms
import fem
from nldyn.app.cli import main
from nldyn.base.resources import example
from nldyn.scene.component import build_component
from nldyn.scene.read import load_scene

DOCS = Path(__file__).parents[3] / "docs"


def first_hz(name):
    return cms.reduce(build_component(load_scene(example(f"{name}.toml"))), modes=1).frequencies_hz[
        0
    ]


def test_the_beam_of_the_tutorial_has_the_frequency_of_a_cantilever(tmp_path, monkeypatch):
    """Its scripts make the mesh, its scene is read; 1.8751^2 / 2 pi sqrt(EI / rho A) / L^2."""
    pytest.importorskip("gmsh")
    monkeypatch.chdir(tmp_path)
    text = (DOCS / "tutorials" / "own_mesh.md").read_text(encoding="utf-8")
    scripts = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    (scene,) = re.findall(r"```toml\n(.*?)```", text, flags=re.S)
    for script, file in zip(scripts, ("beam.msh", "beam.vtu"), strict=True):
        subprocess.run([sys.executable, "-c", script], check=True, capture_output=True)
        (tmp_path / "beam.toml").write_text(scene.replace("beam.msh", file), encoding="utf-8")
        result = CliRunner().invoke(main, ["check", "beam.toml", "--json"])
        assert result.exit_code == 0, result.output
        found = json.loads(result.stdout)["modes"][0]["frequency_hz"]
        known = 1.87510407**2 / (2 * np.pi) * np.sqrt(2.1e11 * 0.01**2 / 12 / 7850.0) / 0.5**2
        assert found == pytest.approx(known, rel=1e-6)


def test_plate_of_gmsh_lies_between_beam_and_wide_plate():
    """0.1615 t / l^2 sqrt(E / rho) of a beam, 1 / sqrt(1 - nu^2) more if it cannot contract."""
    beam = 3.516 / (2 * np.pi) * np.sqrt(7.0e10 / 2700.0 / 12.0) * 0.004 / 0.3**2
    assert beam < first_hz("plate") < beam / np.sqrt(1 - 0.33**2)


def test_portal_of_an_abaqus_file_sways_as_handbooks_say():
    """Sway stiffness of a portal with clamped feet, with 13/35 of the uprights' mass."""
    column, cross = 0.04 * 0.008**3 / 12, 0.04 * 0.02**3 / 12
    ratio = (cross / 0.8) / (column / 0.6)
    stiffness = 24 * 2.1e11 * column / 0.6**3 * (1 + 6 * ratio) / (4 + 6 * ratio)
    mass = 3.0 + 7850 * 0.04 * (0.8 * 0.02 + 2 * 13 / 35 * 0.6 * 0.008)
    expected = np.sqrt(stiffness / mass) / (2 * np.pi)
    assert first_hz("portal") == pytest.approx(expected, rel=3e-3)


def test_hook_of_gmsh_is_near_a_frame_of_deep_beams():
    """Two Timoshenko beams along the middle lines; where they meet nothing is known to 5 %."""
    part = fem.BeamPart(
        fem.Material(2.1e11, 7850.0, 0.3),
        fem.RectangularSection(width=0.003, height=0.02),
        theory="timoshenko",
    )
    mesh = fem.frame_mesh(
        {"foot": (0.01, 0.0), "corner": (0.01, 0.11), "tip": (0.15, 0.11)},
        [("upright", "foot", "corner", 20), ("arm", "corner", "tip", 20)],
    )
    model = fem.StructureModel(
        mesh,
        {"upright": part, "arm": part},
        supports=[fem.Support("foot", ("x", "y", "rotation"))],
        interfaces={"tip": fem.Interface("tip", "y")},
        plane=True,
    )
    frame = cms.reduce(fem.assemble(model), modes=1).frequencies_hz[0]
    assert first_hz("hook") == pytest.approx(frame, rel=0.05)


@pytest.mark.parametrize(
    "name, interface, force, gap, ratio",
    [
        pytest.param("plate", "corner", 0.3, 1e-3, 0.02, marks=pytest.mark.slow),
        ("portal", "push", 20.0, 2e-3, 0.02),
        pytest.param("hook", "tip", 5.0, 5e-5, 0.02, marks=pytest.mark.slow),  # 17 s
    ],
)
def test_run_ends_and_the_stop_is_first_touched_where_the_linear_response_reaches_it(
    tmp_path, name, interface, force, gap, ratio
):
    out = tmp_path / "out"
    arguments = ["run", str(example(f"{name}.toml")), "--out", str(out), "--quiet"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 0, result.output
    with (out / "special_points.csv").open(encoding="utf-8") as file:
        points = list(csv.DictReader(file))
    grazing = [
        float(point["frequency_hz"])
        for point in points
        if point["type"] == "GR" and abs(float(point["max_abs_displacement_m"]) - gap) < 1e-9
    ]
    assert len(grazing) > 0
    reduced = cms.reduce(build_component(load_scene(example(f"{name}.toml"))), modes=12)
    for hz in grazing:
        size = force * abs(reduced.receptance(hz, interface, interface, modal_damping=ratio))
        assert size == pytest.approx(gap, rel=2e-3)


def test_a_material_in_which_sound_is_too_fast_is_told(tmp_path):
    """Steel in MPa and t/mm^3: sqrt(E / rho) is 5.2e6 instead of 5.2e3 m/s."""
    text = example("hook.toml").read_text(encoding="utf-8")
    mesh = example("hook.toml").parents[2] / "meshes" / "hook.msh"
    text = re.sub(r'file = ".*"', f'file = "{mesh.as_posix()}"', text)
    text = re.sub(r"youngs_modulus = [\d.e]+", "youngs_modulus = 2.1e5", text, count=1)
    text = re.sub(r"density = [\d.e]+", "density = 7.85e-9", text, count=1)
    (tmp_path / "hook.toml").write_text(text, encoding="utf-8")
    result = CliRunner().invoke(main, ["check", str(tmp_path / "hook.toml")])
    assert "sound would travel at 5.2e+06 m/s" in result.output
