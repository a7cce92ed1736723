"""Basins of scenes: shares by symmetry, one basin of a linear structure, and rigid stops."""

import csv
import re

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

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
WELLS = """
[matrices]
mass = [[1.0]]
stiffness = [[0.0]]
damping = [[0.25]]
interfaces.x = [1.0]
[[springs]]
at = "x"
coefficients = [-1.0, 0.0, 1.0]
"""
WALL = """
[[stops]]
at = "x"
law = "rigid"
restitution = 0.5
gap = 0.5
"""
HZ = ("--frequency-hz", "0.1")


def told(folder, text, *more):
    scene = folder / "scene.toml"
    scene.write_text(text)
    options = ("--out", str(folder / "out"), "--jobs", "1", *more)
    return CliRunner().invoke(main, ["basins", str(scene), *options])


def rows(file):
    with file.open() as open_file:
        return list(csv.DictReader(open_file))


def wells(_, z):
    return [z[1], z[0] - z[0] ** 3 - 0.25 * z[1]]


def test_two_wells_have_the_same_share_and_each_cell_ends_in_its_own(tmp_path):
    """By symmetry half of a plane about the hill belongs to each; motions by Runge-Kutta."""
    ranges = ("--x-range", "-2", "2", "--y-range", "-1.5", "1.5")
    result = told(tmp_path, WELLS, *HZ, *ranges, "--cells", "8")
    assert result.exit_code == 0, result.stderr
    said = re.findall(r"\d: 50.0 ± 6.1 %, period 1, no impacts, (\S+) to (\S+) m", result.stdout)
    assert sorted(said) == [("-1", "-1"), ("1", "1")]  # ± sqrt(1/4 / (64 + 4))
    assert "undecided" not in result.stdout
    assert "0 of 40 cells that were simulated once more" in result.stdout
    shares = [float(row["share"]) for row in rows(tmp_path / "out" / "attractors.csv")]
    assert shares == [0.5, 0.5]
    cells = rows(tmp_path / "out" / "basins.csv")
    assert len(cells) == 64
    sides = {"1": set(), "2": set()}
    for cell in cells[3::9]:
        start = [float(cell["displacement of x (m)"]), float(cell["velocity of x (m/s)"])]
        end = solve_ivp(wells, (0.0, 60.0), start, rtol=1e-8, atol=1e-10).y[:, -1]
        assert abs(end[0]) == pytest.approx(1.0, abs=1e-3)
        sides[cell["attractor"]].add(np.sign(end[0]))
    assert sorted(map(sorted, sides.values())) == [[-1.0], [1.0]]
    assert (tmp_path / "out" / "basins.png").stat().st_size > 1000


def test_a_linear_structure_has_one_basin_in_a_plane_of_twice_its_steady_motion(tmp_path):
    """|x| = 1/|1 - w² + 0.2 i w|; the range is twice that, the velocity's w times as much."""
    result = told(tmp_path, LINEAR, *HZ, "--cells", "4")
    assert result.exit_code == 0, result.stderr
    (row,) = rows(tmp_path / "out" / "attractors.csv")
    assert (row["name"], float(row["share"])) == ("period 1", 1.0)
    assert float(row["largest_exponent_per_s"]) == pytest.approx(-0.1, rel=1e-6)
    cells = rows(tmp_path / "out" / "basins.csv")
    rate = 0.2 * np.pi
    for name, size in (("displacement of x (m)", 1.0), ("velocity of x (m/s)", rate)):
        values = [float(cell[name]) for cell in cells]
        edge = 2.0 * size / abs(1.0 - rate**2 + 0.2j * rate)
        assert (min(values), max(values)) == pytest.approx((-0.75 * edge, 0.75 * edge), rel=1e-4)


def test_the_plane_of_what_is_observed_absolutely_is_relative(tmp_path):
    shaken = LINEAR.replace('at = "x"\nkind = "harmonic"', 'at = "base"\nkind = "base"')
    shaken = shaken.replace("interfaces.x", "loads.base = [1.0]\ninterfaces.x")
    observed = 'quantity = "displacement"\n[observe]\nat = "x"\nabsolute = true\n'
    result = told(tmp_path, shaken + observed, *HZ, "--cells", "2")
    assert result.exit_code == 0, result.stderr
    (row,) = rows(tmp_path / "out" / "attractors.csv")
    rate = 0.2 * np.pi
    exact = abs(1.0 + 0.2j * rate) / abs(1.0 - rate**2 + 0.2j * rate)  # transmissibility
    assert float(row["max_displacement_m"]) == pytest.approx(exact, rel=1e-6)
    assert "displacement of x (m)" in rows(tmp_path / "out" / "basins.csv")[0]


def test_states_behind_a_rigid_stop_do_not_count(tmp_path):
    ranges = ("--x-range", "-1", "1", "--y-range", "-1", "1")
    result = told(tmp_path, LINEAR + WALL, *HZ, *ranges, "--cells", "8")
    assert result.exit_code == 0, result.stderr
    assert "25.0 % of the plane lies behind a rigid stop" in result.stdout
    (row,) = rows(tmp_path / "out" / "attractors.csv")
    assert float(row["share"]) == 1.0 and float(row["impacts_per_period"]) >= 1.0
    for cell in rows(tmp_path / "out" / "basins.csv"):
        behind = float(cell["displacement of x (m)"]) > 0.5
        assert cell["attractor"] == ("-1" if behind else "1")


OVER = """
[continuation]
parameter = "excitation.0.amplitude"
range = [1.0, 3.0]
frequency_hz = 0.1
"""


def test_over_the_force_a_linear_motion_grows_with_it(tmp_path):
    result = told(tmp_path, LINEAR + OVER, "--over", "3", "--cells", "2")
    assert result.exit_code == 0, result.stderr
    found = rows(tmp_path / "out" / "attractors.csv")
    assert [float(row["amplitude"]) for row in found] == [1.0, 2.0, 3.0]
    rate = 0.2 * np.pi
    for row in found:
        exact = float(row["amplitude"]) / abs(1.0 - rate**2 + 0.2j * rate)
        assert float(row["max_displacement_m"]) == pytest.approx(exact, rel=1e-6)
        assert float(row["share"]) == 1.0
    cells = rows(tmp_path / "out" / "basins.csv")
    assert len(cells) == 12
    places = [float(cell["displacement of x (m)"]) for cell in cells]  # of the largest motion
    assert max(places) == pytest.approx(0.5 * 2.0 * exact, rel=1e-4)
    assert (tmp_path / "out" / "basins.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("text", "more", "fault"),
    [
        (LINEAR, ("--over", "3"), "continuation is missing: it says over which parameter"),
        (LINEAR + OVER, (), "needs either '--frequency-hz' or '--over'"),
        (LINEAR + OVER, (*HZ, "--over", "3"), "needs either '--frequency-hz' or '--over'"),
    ],
)
def test_values_to_go_over_are_those_of_a_continuation(tmp_path, text, more, fault):
    result = told(tmp_path, text, *more)
    assert result.exit_code == 2 and fault in result.stderr
    assert result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "more", "fault"),
    [
        (LINEAR, ("--x", "place:x"), "'place:x' is neither displacement:INTERFACE nor velocity"),
        (LINEAR, ("--x", "displacement:y"), "nldyn: 'y' is not an interface; known: 'x' (--x)"),
        (LINEAR, ("--x", "velocity:x"), "the velocity of 'x' moves with that of 'x'"),
        (LINEAR, ("--x-range", "1", "-1"), "x_range must be two ascending numbers"),
        (LINEAR.replace("0.2", "0.0"), (), "a system without damping has no attractors"),
        (LINEAR.partition("[[exc")[0], (), "no attractor moves 'x' or 'x', so the ranges"),
        (LINEAR + WALL, ("--x-range", "1", "2", "--y-range", "-1", "1"), "all of it lies behind"),
    ],
)
def test_what_makes_no_sense_is_told(tmp_path, text, more, fault):
    result = told(tmp_path, text, *HZ, *more)
    assert result.exit_code == 2 and fault in result.stderr
    assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
