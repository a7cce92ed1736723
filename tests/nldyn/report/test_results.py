"""Tables hold every digit; a failed picture leaves no directory."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from fakes import FakeBranch, FakeDiagram, FakeNode, FakeOrbit, FakeSpecialPoint, diagram

from nldyn.base.resources import example
from nldyn.orbits.multipliers import Stability
from nldyn.report.results import write_results
from nldyn.scene.read import load_scene

FILES = {
    "branches.csv",
    "special_points.csv",
    "ends.csv",
    "branches.h5",
    "diagram.png",
    "diagram.svg",
    "summary.json",
    "report.html",
}


def read(path):
    with path.open(newline="") as file:
        return list(csv.reader(file))


def names(place):
    return {p.name for p in place.iterdir() if not p.name.startswith(".")}


def test_files_and_columns(tmp_path):
    place = tmp_path / "out"
    scene = load_scene(example("one_dof.toml"))
    computed = diagram()
    assert write_results(computed, place, scene) == place
    assert names(place) == FILES | {"scene.toml"}
    assert (place / "scene.toml").read_text() == scene.text
    branches, special = read(place / "branches.csv"), read(place / "special_points.csv")
    assert ",".join(branches[0]) == (
        "branch,point,period,frequency_hz,max_abs_displacement_m,max_penetration_m,impacts,"
        "stable,largest_multiplier,multiplier_angle_deg,relative_uncertainty,liouville_error"
    )
    assert ",".join(special[0]) == (
        "branch,period,type,frequency_hz,max_abs_displacement_m,impacts,"
        "normal_form,coefficient,coefficient_error,relative_shift,meaning"
    )
    assert len(branches) == 1 + sum(len(b.points) for b in computed.branches)
    assert len(special) == 1 + sum(len(b.special_points) for b in computed.branches)
    assert {row[2] for row in special[1:]} == {"PD", "LP", "GR"}
    assert special[1][6:] == ["supercritical flip", "1.25", "0.001", "-0.5", "A flip, for example."]
    grazing = next(row for row in special if row[2] == "GR")
    assert grazing[6:] == ["new contact", "", "", "", "A touch, for example."]


def test_numbers_come_back_bit_for_bit(tmp_path):
    third, tiny = 100.0 / 3.0, 1.2345678901234567e-7
    orbit = FakeOrbit(third, tiny, 3, False, 2, tiny / 7, largest_multiplier=-1.1 + 0j)
    node = FakeNode(orbit, 0.0)
    branch = FakeBranch("a", 3, [node], [FakeSpecialPoint("PD", node)])
    write_results(FakeDiagram([branch]), tmp_path / "out")
    row = read(tmp_path / "out" / "branches.csv")[1]
    assert [float(row[3]), float(row[4]), float(row[5])] == [third, tiny, tiny / 7]
    assert row[:3] + row[6:] == ["a", "0", "3", "2", "0", "1.1", "180.0", "1e-07", "1e-12"]
    assert float(read(tmp_path / "out" / "special_points.csv")[1][3]) == third


def test_the_ends_of_the_range_are_written_as_they_were_given(tmp_path):
    stored = [float(np.exp(np.log(2 * np.pi * hz))) / (2 * np.pi) for hz in (5.0, 89.999, 90.0)]
    assert stored[2] != 90.0
    nodes = [FakeNode(FakeOrbit(hz, 1e-4), hz) for hz in stored]
    write_results(FakeDiagram([FakeBranch("a", 1, nodes, [])]), tmp_path / "out")
    written = [row[3] for row in read(tmp_path / "out" / "branches.csv")[1:]]
    assert written == ["5.0", repr(stored[1]), "90.0"]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["branches"][0]["range"] == [5.0, 90.0]


def test_summary(tmp_path):
    write_results(diagram(), tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["software"].startswith("nldyn ")
    assert summary["largest_relative_error"] == 1e-14
    assert summary["largest_liouville_error"] == 1e-12
    assert summary["stability_undecided"] == 0
    assert summary["cascades"] == []
    assert [b["stop_reason"] for b in summary["branches"]] == ["end of range"] * 3


def test_what_is_not_known_of_an_orbit_is_an_empty_cell_and_undecided(tmp_path):
    unsure = Stability(1.0 + 0j, 0.0, float("inf"))
    orbit = FakeOrbit(10.0, 1e-4, liouville_error=float("nan"), stability=unsure)
    nodes = [FakeNode(FakeOrbit(9.0, 1e-4), 9.0), FakeNode(orbit, 10.0)]
    write_results(FakeDiagram([FakeBranch("a", 1, nodes, [])]), tmp_path / "out")
    assert read(tmp_path / "out" / "branches.csv")[2][-2:] == ["", ""]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["stability_undecided"] == 1


@pytest.mark.parametrize("unknown", [float("nan"), float("inf")])
def test_an_error_that_is_no_number_is_null_in_the_summary(tmp_path, unknown):
    """JSON has no word for it."""
    orbits = [FakeOrbit(hz, 1e-4) for hz in (10.0, 20.0, 30.0)]
    orbits[1] = replace(orbits[1], liouville_error=unknown)
    nodes = [FakeNode(orbit, orbit.frequency_hz) for orbit in orbits]
    write_results(FakeDiagram([FakeBranch("a", 1, nodes, [])]), tmp_path / "out")

    def refuse(word):
        raise AssertionError(word)

    text = (tmp_path / "out" / "summary.json").read_text()
    summary = json.loads(text, parse_constant=refuse)
    assert summary["largest_liouville_error"] is None
    assert summary["largest_relative_error"] == 1e-14


def test_no_directory_if_the_picture_fails(tmp_path, monkeypatch):
    def fail(*_, **__):
        raise RuntimeError("no font")

    monkeypatch.setattr("nldyn.report.results.save_diagram", fail)
    with pytest.raises(RuntimeError, match="no font"):
        write_results(diagram(), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_pictures_are_the_same_on_every_run(tmp_path):
    for name in ("a", "b"):
        write_results(diagram(), tmp_path / name)
    for file in FILES:
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_diagram_without_branches(tmp_path):
    write_results(FakeDiagram([]), tmp_path / "out")
    assert names(tmp_path / "out") == FILES
