"""Sweeps of scenes over the frequency and over another parameter."""

import csv

import numpy as np
import pytest
from click.testing import CliRunner

from nldyn.app.cli import main

LINEAR = """
[matrices]
mass = [[1.0]]
stiffness = [[1.0]]
damping = [[0.2]]
interfaces.x = [1.0]
[[excitation]]
at = "x"
kind = "harmonic"
amplitude = 1.0
"""
FORCE = """
[continuation]
parameter = "force"
range = [1.0, 3.0]
frequency_hz = 0.1
"""
FREQUENCY = "[continuation]\nrange_hz = [0.05, 0.15]\n"


def told(folder, text, *more):
    scene = folder / "scene.toml"
    scene.write_text(text)
    options = ("--out", str(folder / "out"), "--jobs", "1", *more)
    return CliRunner().invoke(main, ["sweep", str(scene), *options])


@pytest.mark.parametrize(
    ("continuation", "column", "values"),
    [(FORCE, "amplitude", [1.0, 2.0, 3.0]), (FREQUENCY, "frequency_hz", [0.05, 0.1, 0.15])],
)
def test_a_linear_structure_moves_as_its_transfer_function_says(
    tmp_path, continuation, column, values
):
    result = told(tmp_path, LINEAR + continuation, "--points", "3")
    assert result.exit_code == 0, result.stderr
    assert "6 motions at 3 values, periodic: 6" in result.stdout
    with (tmp_path / "out" / "sweep.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row[column]) for row in rows] == pytest.approx([*values, *values[::-1]])
    assert [row["direction"] for row in rows] == ["up"] * 3 + ["down"] * 3
    for row in rows:
        force = float(row.get("amplitude", 1.0))
        rate = 2.0 * np.pi * float(row.get("frequency_hz", 0.1))
        exact = force / abs(1.0 - rate**2 + 0.2j * rate)
        assert float(row["max_abs_displacement_m"]) == pytest.approx(exact, rel=1e-4)
        assert float(row["largest_exponent_per_s"]) == pytest.approx(-0.1, rel=1e-6)
        assert (row["period"], float(row["impacts_per_period"])) == ("1", 0.0)
    assert (tmp_path / "out" / "sweep.png").stat().st_size > 1000


def test_each_period_of_a_motion_that_hits_a_rigid_stop_has_its_impact(tmp_path):
    """At a gap beyond the linear amplitude no motion touches the stop."""
    wall = '[[stops]]\nat = "x"\nlaw = "rigid"\nrestitution = 0.5\ngap = 0.5\n'
    ranged = FORCE.replace("force", "gap")
    result = told(tmp_path, LINEAR + wall + ranged, "--points", "2")
    assert result.exit_code == 0, result.stderr
    with (tmp_path / "out" / "sweep.csv").open() as file:
        rows = list(csv.DictReader(file))
    rate = 0.2 * np.pi
    assert 1.0 < 1.0 / abs(1.0 - rate**2 + 0.2j * rate) < 3.0
    for row in rows:
        hits = float(row["impacts_per_period"])
        assert hits == round(hits)
        assert (hits == 0.0) == (float(row["gap"]) == 3.0)


def test_a_scene_without_a_range_is_told_so(tmp_path):
    result = told(tmp_path, LINEAR)
    assert result.exit_code == 2
    assert "continuation is missing: it says over which parameter and range" in result.stderr
    assert not (tmp_path / "out").exists()
