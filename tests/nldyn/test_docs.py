"""The examples in the theory and the README run and print what is said there."""

from __future__ import annotations

import ast
import math
import re
from pathlib import Path

import numpy as np
import pytest

from nldyn.branches.tables import UNITS
from nldyn.system.chart import NAMES
from nldyn.system.chart import UNITS as UNITS_OF_PARAMETERS
from nldyn.system.parameters import EXACT

ROOT = Path(__file__).parents[2]
BRANCHES = (ROOT / "docs" / "how-to" / "branches.md").read_text(encoding="utf-8")
THEORY = ROOT / "docs" / "explanation" / "theory.md"


def test_example_runs(capsys):
    code = re.findall(r"```python\n(.*?)```", THEORY.read_text(encoding="utf-8"), flags=re.S)
    assert len(code) == 1
    exec(code[0], {})
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "1 True"
    assert printed[-3:] == ["PD 15.773081", "PD 33.654364", "2"]
    kinds = [line.split()[0] for line in printed[1:-1]]
    assert kinds == ["LP", "LP", "GR", "PD", "PD", "PD"]


def test_example_of_the_curves_runs(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "how-to" / "curves.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    exec(code, {})
    said = re.findall(r"^print.*?# (.*)$", code, flags=re.M)
    assert capsys.readouterr().out.splitlines() == said
    assert len(said) == 5
    assert (tmp_path / "curves.png").is_file()


def test_example_of_the_loads_prints_the_folds(capsys):
    text = (ROOT / "docs" / "how-to" / "loads.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    for code in re.findall(r"```python\n(.*?)```", text, flags=re.S):
        exec(code, names)
    said = (ast.literal_eval(line) for line in capsys.readouterr().out.splitlines())
    at_rest, folds, stable = said
    assert stable is True
    assert at_rest[0] == pytest.approx((0, 0.1, 0.1))
    assert sorted(folds) == pytest.approx([0.112687, 0.131854], abs=5e-7)


def test_example_of_the_elements_prints_folds_and_wells(capsys):
    """The folds are those of harmonic balance, see `test_bonds`; the whirl has a closed form."""
    text = (ROOT / "docs" / "how-to" / "elements.md").read_text(encoding="utf-8")
    for code in re.findall(r"```python\n(.*?)```", text, flags=re.S):
        exec(code, {})
    folds, wells, whirl = (ast.literal_eval(line) for line in capsys.readouterr().out.splitlines())
    speed = 2.0 * np.pi * 0.41
    exact = 0.02 * speed**2 / abs(4.0 - 0.6 * speed**2 + 0.1j * speed)
    assert whirl == pytest.approx(exact, abs=6e-10)
    assert sorted(folds) == pytest.approx([0.210759, 0.283251], abs=5e-7)
    assert wells == [2.0, 2.0]


def printed_by(page, capsys):
    """Lines that the only example of a page prints."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    exec(code, {})
    return capsys.readouterr().out.splitlines()


def test_examples_of_rigid_stops_print_what_the_pages_say(capsys):
    """The frequencies of the first are closed forms, see `test_impact_oscillator`."""
    _, *told = printed_by("how-to/rigid_stops.md", capsys)
    assert [line.split()[0] for line in told] == ["Fold", "Grazing", "Flip", "Grazing"]
    found = [float(line.split()[2]) for line in told]
    assert found == pytest.approx([0.143228, 0.135786, 0.329426, 0.331059], abs=5e-7)
    (line,) = printed_by("results/rigid_stops.md", capsys)
    text = (ROOT / "docs" / "results" / "rigid_stops.md").read_text(encoding="utf-8")
    pattern = r"rigid, e = 0.7 \|.*\| (.*?) \| grazes at (.*?) Hz, flips at (.*?) and (.*?) Hz"
    ((flips, *lower),) = re.findall(pattern, text)
    kinds = [*zip(["GR", "PD", "PD"], lower, strict=True)][::-1]
    kinds += [("PD", hz) for hz in flips.split(", ")]
    assert ast.literal_eval(line) == [(kind, float(hz)) for kind, hz in kinds]


def test_example_of_round_clearances_is_a_circular_whirl(capsys):
    """Whose radius r solves |(k - mω² + icω) r + (1 + iμ) k_r (r - c)| = U ω²."""
    (line,) = printed_by("how-to/round_clearances.md", capsys)
    depth, force = (float(x) for x in re.findall(r"[\d.]+(?= mm| N)", line))
    w, radius = 60.0 * math.pi, 6e-4 + 1e-3 * depth
    pull = (4e5 - 10.0 * w**2 + 300j * w) * radius + (1.0 + 0.08j) * 2e3 * depth
    assert abs(pull) == pytest.approx(2e-3 * w**2, rel=2e-3)
    assert force == pytest.approx(2e3 * depth, abs=0.2) and line.endswith("stable: True")


def test_example_of_backbones_keeps_its_energy(capsys):
    """Farthest from the stop all of it is in the springs; forced orbits are near the free ones."""
    text = (ROOT / "docs" / "how-to" / "backbones.md").read_text(encoding="utf-8")
    names = {}
    for code in re.findall(r"```python\n(.*?)```", text, flags=re.S):
        exec(code, names)
    said, last, resonant = capsys.readouterr().out.splitlines()
    free, forced = names["family"], names["resonant"]
    sizes = [orbit.max_abs_displacement for orbit in forced.orbits]
    inside = np.array(sizes) < free.amplitude[-1]
    beside = np.interp(sizes, free.amplitude, free.frequency_hz)
    assert forced.values[inside, 0] == pytest.approx(beside[inside], rel=3e-3)
    assert resonant.startswith("<Curve of phase_lag_deg")
    assert said.startswith("<Backbone of mode 1:")
    _, size, energy = map(float, last.strip("[]").split())
    assert energy == pytest.approx(0.5 * size**2 + 0.025 * size**4, rel=1e-6)


def test_every_kind_of_special_point_is_in_the_table():
    text = THEORY.read_text(encoding="utf-8")
    for kind in ("LP", "PD", "BP", "NS", "GR"):
        assert re.search(rf"^\| {kind} \|", text, flags=re.M)


def test_example_of_the_readme_prints_what_it_says(capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    exec(code, {})
    (said,) = re.findall(r"^It prints `(.*?)`", text, flags=re.M)
    assert capsys.readouterr().out == f"{said}\n"


def test_example_of_the_branches_prints_what_it_says(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, over_gap, events = re.findall(r"```python\n(.*?)```", BRANCHES, flags=re.S)
    exec(code, {})
    (said,) = re.findall(r"It prints\n\n```\n(.*?)```", BRANCHES, flags=re.S)
    assert capsys.readouterr().out == said
    assert {path.name for path in tmp_path.iterdir()} == {
        "harmonic.h5",
        "harmonic.png",
        "force.png",
        "peak.csv",
    }
    exec(over_gap, {})
    (said,) = re.findall(r"^It prints `(.*?)`", BRANCHES, flags=re.M)
    assert capsys.readouterr().out == f"{said}\n"
    exec(events, {})
    first, last = re.findall(r"# (10 µm \S+), ..., (.*)", events)[0]
    *rows, end = capsys.readouterr().out.splitlines()
    assert (rows[0], end) == (first, last)


def test_every_column_of_a_table_is_documented():
    rows = re.findall(r"^\| `(\w+)` \| (.*?) ?\|", BRANCHES, flags=re.M)
    assert dict(rows) == {"type": "", **{key: u.strip("1") for key, u in UNITS.items()}}


def test_every_parameter_is_in_the_table_of_the_curves_with_its_unit_and_derivatives():
    text = (ROOT / "docs" / "how-to" / "curves.md").read_text(encoding="utf-8")
    table = text.split("## Parameters")[1].split("\n\n")[1]
    said = {}
    for row in table.splitlines()[2:]:
        names, _, units, derivatives = (cell.strip() for cell in row.strip("|").split("|"))
        listed, each = re.findall(r"`(\w+)`", names), units.split(", ")
        if each == ["N/m^power"]:
            each = [f"N/m^{name[1:]}" for name in listed]
        for name, unit in zip(listed, each, strict=True):
            said[name] = unit, derivatives
    exact = {name: "exact" for name in (*EXACT, "frequency_hz")}
    assert said == {
        name: (UNITS_OF_PARAMETERS[name], exact.get(name, "differences")) for name in NAMES
    }


@pytest.mark.slow
def test_example_of_exploring_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / "how-to" / "exploring.md").read_text(encoding="utf-8")
    exec("".join(re.findall(r"```python\n(.*?)```", text, flags=re.S)), {})
    said = capsys.readouterr().out
    assert "1/3" in said and said.endswith("[1, 1, 1]\n[]\n")
    assert (tmp_path / "explored.png").is_file()


def test_tests_named_in_the_table_of_special_points_exist():
    text = (ROOT / "docs" / "reference" / "special_points.md").read_text(encoding="utf-8")
    tests = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "tests").rglob("test_*.py"))
    defined = set(re.findall(r"^def (test_\w+)\(", tests, flags=re.M))
    named = set(re.findall(r"`(test_\w+)`", text))
    assert len(named) > 20
    assert named - defined == set()


def test_every_cell_of_the_table_of_special_points_says_no_or_names_a_test():
    text = (ROOT / "docs" / "reference" / "special_points.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line.startswith("|")]
    rows = [row for row in rows if not row.startswith(("| kind", "|---"))]
    kinds = ",".join(row.split("|")[1] for row in rows)
    for kind in ("LP", "PD", "NS", "BP", "GR", "CP", "GPD", "LPPD", "R1", "R4", "GRGR", "GGR"):
        assert re.search(rf"\b{kind}\b", kinds)
    for row in rows:
        cells = [cell.strip() for cell in row.strip("|").split("|")]
        assert len(cells) == 7
        on_curve = re.fullmatch(r"[A-Z]+(, [A-Z]+)*", cells[1])  # else it is its meaning
        for cell in cells[3 if on_curve else 2 :]:
            assert re.match(r"no(:|;|$| coefficient)", cell) or "`test_" in cell, cell
