"""Simulations of scenes, against the closed form of a linear oscillator that begins at rest."""

import csv
import math
import re

import numpy as np
import pytest
from click.testing import CliRunner
from problems import make_one_dof

from nldyn import ConstantForce, System, simulate, sweep
from nldyn.app.cli import main
from nldyn.plot.longterm import plot_sweep
from nldyn.report.simulation import Drawn, plot_motion

SCENE = """
[matrices]
mass = [[1.0]]
stiffness = [[1.0]]
interfaces.x = [1.0]
[[stops]]
at = "x"
law = "linear"
stiffness = 3.0
gap = 10.0
[[excitation]]
at = "x"
kind = "harmonic"
amplitude = 1.0
[[excitation]]
at = "x"
kind = "harmonic"
amplitude = 0.5
frequency_hz = 0.11
"""


def told(folder, text, *more):
    scene = folder / "scene.toml"
    scene.write_text(text)
    return CliRunner().invoke(main, ["simulate", str(scene), "--out", str(folder / "out"), *more])


def columns(file):
    with file.open() as open_file:
        rows = list(csv.DictReader(open_file))
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def test_two_frequencies_beat_as_the_closed_form_says(tmp_path):
    """Σ F (cos νt - cos t)/(1 - ν²) without damping."""
    result = told(tmp_path, SCENE, "--frequency-hz", "0.3", "--periods", "20")
    assert result.exit_code == 0, result.stderr
    assert "Motion of 66.6667 s" in result.stdout and "Impacts: none" in result.stdout
    found = columns(tmp_path / "out" / "motion.csv")
    t, exact = found["time_s"], 0.0
    for force, hz in ((1.0, 0.3), (0.5, 0.11)):
        rate = 2 * np.pi * hz
        exact = exact + force * (np.cos(rate * t) - np.cos(t)) / (1 - rate**2)
    assert t.size > 1000
    assert found["displacement_m[x]"] == pytest.approx(exact, abs=1e-9 * np.abs(exact).max())
    assert (tmp_path / "out" / "simulation.png").stat().st_size > 1000


def test_a_push_against_a_stop_has_the_impact_of_its_closed_form(tmp_path):
    """From rest m x'' = F up to the gap g; then m x'' + k d = F from the speed v on."""
    m, k, force, gap = 2.0, 50.0, 3.0, 0.1
    text = f"""
    [matrices]
    mass = [[{m}]]
    stiffness = [[0.0]]
    interfaces.x = [1.0]
    [[stops]]
    at = "x"
    law = "linear"
    stiffness = {k}
    gap = {gap}
    [[excitation]]
    at = "x"
    kind = "constant"
    force = {force}
    """
    result = told(tmp_path, text, "--frequency-hz", "0.4", "--periods", "1")
    assert result.exit_code == 0, result.stderr
    assert "Impacts: 1 from" in result.stdout
    hit = {name: values[0] for name, values in columns(tmp_path / "out" / "impacts.csv").items()}
    begin, v, w = math.sqrt(2 * m * gap / force), math.sqrt(2 * force * gap / m), math.sqrt(k / m)
    duration = 2.0 / w * math.atan2(v / w, -force / k)
    peak = force + k * math.hypot(force / k, v / w)
    exact = {
        "stop": 0.0, "rotation": 0.0, "time": begin, "phase_deg": 360.0 * 0.4 * begin,
        "duration": duration,
        "speed": v, "rebound_speed": v, "penetration": peak / k, "peak_force": peak,
        "impulse": 2.0 * m * v + force * duration, "work": 0.5 * peak**2 / k, "frequency_hz": 0.4,
    }  # fmt: skip
    assert hit.pop("loss") == pytest.approx(0.0, abs=1e-6)
    assert hit == pytest.approx(exact, rel=1e-4)
    motion = columns(tmp_path / "out" / "motion.csv")
    assert motion["force_n[0]"].max() == pytest.approx(peak, rel=1e-2)


def test_what_is_observed_is_simulated_from_rest_on_its_shaken_base(tmp_path):
    """Absolute displacement of a mass on a base a cos νt: that of the base less that of rest."""
    text = """
    [matrices]
    mass = [[1.0]]
    stiffness = [[1.0]]
    interfaces.x = [1.0]
    loads.base = [1.0]
    [[excitation]]
    at = "base"
    kind = "base"
    quantity = "displacement"
    amplitude = 0.2
    [observe]
    at = "x"
    absolute = true
    """
    result = told(tmp_path, text, "--frequency-hz", "0.05", "--periods", "3")
    assert result.exit_code == 0, result.stderr
    found = columns(tmp_path / "out" / "motion.csv")
    rate = 0.1 * math.pi
    base = 0.2 * np.cos(rate * found["time_s"])
    swing = np.cos(rate * found["time_s"]) - np.cos(found["time_s"])
    relative = 0.2 * rate**2 / (1.0 - rate**2) * swing
    assert found["displacement_m[x]"] == pytest.approx(relative, abs=1e-9)
    assert found["displacement_m[x absolute]"] == pytest.approx(relative + base, abs=1e-9)


def test_pieces_of_a_long_motion_are_the_whole_and_a_picture_of_it_is_as_high():
    """Of x = 1 - cos t, and of any number of samples, the picture shows the lowest and highest."""
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, excitation=[ConstantForce("x", 1.0)]
    )
    motion = simulate(system, 0.1, 5)
    curve = Drawn("x", each=7)
    pieces = [curve.seen(piece) for piece in motion.histories(1000, 91)]
    assert [piece.time.size for piece in pieces] == 11 * [91]
    whole = motion.history(1000)
    time = np.concatenate([piece.time for piece in pieces])
    assert time == pytest.approx(whole.time, rel=1e-14)
    joined = np.concatenate([piece.displacement["x"] for piece in pieces])
    assert joined == pytest.approx(1.0 - np.cos(time), abs=1e-12)
    drawn = np.concatenate(curve.values)
    assert drawn.size == 2 * 143
    assert (drawn.min(), drawn.max()) == (joined.min(), joined.max())
    assert np.all(drawn[1::2] >= drawn[::2])


def test_lyapunov_exponent_and_run_up(tmp_path):
    """Both exponents are -c/2; slowly run up, the peak in a period is that of the steady motion."""
    text = SCENE.partition('[[excitation]]\nat = "x"\nkind = "harmonic"\namplitude = 0.5')[0]
    text = text.replace("interfaces", "damping = [[1.0]]\ninterfaces")
    result = told(tmp_path, text, "--frequency-hz", "0.3", "--periods", "1", "--lyapunov")
    assert result.exit_code == 0, result.stderr
    said = re.search(r"largest (\S+) \+- (\S+) 1/s", result.stdout)
    assert float(said[1]) == pytest.approx(-0.5, rel=1e-3)
    way = ("--to-hz", "0.2", "--rate-hz-per-s", "1e-4", "--transient", "50", "--replace")
    result = told(tmp_path, text, "--frequency-hz", "0.3", *way)
    assert result.exit_code == 0, result.stderr
    found = columns(tmp_path / "out" / "peaks.csv")
    rate = 2 * math.pi * found["frequency_hz"]
    steady = 1.0 / np.abs(1.0 - rate**2 + 1j * rate)
    assert found["max_abs_displacement_m"] == pytest.approx(steady, rel=2e-3)
    assert rate[0] > 2 * math.pi * 0.299 and rate[-1] < 2 * math.pi * 0.201


@pytest.mark.parametrize(
    ("more", "fault"),
    [
        (("--to-hz", "2.0"), "'--to-hz' and '--rate-hz-per-s' go together"),
        (("--rate-hz-per-s", "2.0"), "'--to-hz' and '--rate-hz-per-s' go together"),
        (("--to-hz", "2.0", "--rate-hz-per-s", "1.0", "--periods", "9"), "are for one frequency"),
        (
            ("--to-hz", "1.0", "--rate-hz-per-s", "1.0"),
            "scene.toml: range_hz: the sweep begins and ends",
        ),
    ],
)
def test_what_makes_no_sense_is_told(tmp_path, more, fault):
    result = told(tmp_path, SCENE, "--frequency-hz", "1.0", *more)
    assert result.exit_code == 2 and fault in result.stderr
    assert not (tmp_path / "out").exists()


def test_a_sweep_that_is_over_at_once_is_told(tmp_path):
    way = ("--to-hz", "2.0", "--rate-hz-per-s", "1e12")
    result = told(tmp_path, SCENE, "--frequency-hz", "1.0", *way)
    assert result.exit_code == 1
    assert result.stderr.splitlines()[-1].startswith("nldyn: the sweep from 1 Hz failed at once")


def test_a_rotation_is_drawn_in_radians():
    """A quarter of a milliradian, in place of a quarter of a millimetre."""
    curve = Drawn("joint", 1, [np.array([0.0, 1.0])], [np.array([0.0, 2.5e-4])])
    assert plot_motion(curve, "rotation_z").get_ylabel() == "rotation of joint about z (µrad)"
    assert plot_motion(curve, "y").get_ylabel() == "displacement of joint along y (µm)"
    motion = sweep(make_one_dof(), (20.0, 21.0), 1.0)
    labelled = plot_sweep(motion, direction="rotation").get_ylabel()
    assert labelled.startswith("largest rotation in a period (") and labelled.endswith("rad)")
