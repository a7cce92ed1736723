"""Backbones of scenes, against the closed form of a mass between spring and stop."""

import csv
import math

import pytest
from click.testing import CliRunner

from nldyn.app.cli import main

SCENE = """
[matrices]
mass = [[1.0]]
stiffness = [[1.0]]
damping = [[0.1]]
interfaces.x = [1.0]
[damping]
modal_ratio = 0.1
[[stops]]
at = "x"
law = "linear"
stiffness = 3.0
[[excitation]]
at = "x"
kind = "harmonic"
amplitude = 1.0
"""


def told(folder, text, *more):
    scene = folder / "scene.toml"
    scene.write_text(text)
    out = str(folder / "out")
    return CliRunner().invoke(
        main, ["backbone", str(scene), "--amplitude-m", "0.1", "--out", out, *more]
    )


def test_bilinear_oscillator_has_one_frequency_at_any_amplitude(tmp_path):
    """Half a period at 1 rad/s, half at 2 rad/s; the scene's damping and drive are left out."""
    result = told(tmp_path, SCENE)
    assert result.exit_code == 0, result.stderr
    with (tmp_path / "out" / "backbone.csv").open() as file:
        rows = list(csv.DictReader(file))
    exact = 2.0 / (1.0 + 0.5) / (2.0 * math.pi)
    assert all(float(row["frequency_hz"]) == pytest.approx(exact, rel=1e-9) for row in rows)
    assert float(rows[-1]["amplitude_m"]) == pytest.approx(0.1, rel=1e-8)
    assert (tmp_path / "out" / "backbone.png").stat().st_size > 1000


def test_the_forced_curve_is_written_beside_it(tmp_path):
    """A linear oscillator: resonant at 1 rad/s, F over 2 zeta times the force of the damping."""
    text = SCENE.replace("stiffness = 3.0", "stiffness = 3.0\ngap = 1e3")
    text = text.replace("amplitude = 1.0", "amplitude = 0.02")
    result = told(tmp_path, text, "--forced")
    assert result.exit_code == 0, result.stderr
    with (tmp_path / "out" / "phase_resonance.csv").open() as file:
        rows = list(csv.DictReader(file))
    force = [float(row["amplitude"]) for row in rows]
    assert max(force) == pytest.approx(0.02, rel=1e-9) and min(force) < 0.01
    for row in rows:
        assert float(row["frequency_hz"]) == pytest.approx(1.0 / (2.0 * math.pi), rel=1e-9)
        size = float(row["max_abs_displacement_m"])
        assert size == pytest.approx(float(row["amplitude"]) / (0.1 + 2.0 * 0.1), rel=1e-8)


@pytest.mark.parametrize(
    ("old", "new", "more", "fault"),
    [
        ("stiffness = 3.0", "stiffness = 3.0\ndashpot = 0.1", (), "damp"),
        ("", "", ("--mode", "2"), "mode must be a whole number"),
    ],
)
def test_scenes_without_backbone_are_told(tmp_path, old, new, more, fault):
    result = told(tmp_path, SCENE.replace(old, new), *more)
    assert result.exit_code == 2
    assert "scene.toml: " in result.stderr and fault in result.stderr
    assert not (tmp_path / "out").exists()
