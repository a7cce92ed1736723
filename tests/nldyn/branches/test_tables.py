"""Branches as tables."""

import importlib
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from nldyn import (
    Diagram,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    impacts,
    solve_orbit,
)
from nldyn.branches.tables import UNITS, orbit_columns
from nldyn.report.results import BRANCH_COLUMNS, columns_of


def test_rows_belong_to_the_orbits(harmonic_branch):
    table = harmonic_branch.table()
    assert {*columns_of(BRANCH_COLUMNS, Diagram((harmonic_branch,), (5.7, 90.0), "middle"))} - {
        "branch", "point"
    } <= set(table) <= set(UNITS)  # fmt: skip
    for i in (0, 100, -1):
        orbit = harmonic_branch.points[i]
        assert table["max_abs_displacement_m"][i] == orbit.max_abs_displacement
        assert table["max_penetration_m"][i] == orbit.max_penetration
        assert table["largest_multiplier"][i] == abs(orbit.multipliers).max()
        assert table["stable"][i] == orbit.stable
        assert table["arclength"][i] == harmonic_branch.nodes[i].arclength
    assert table["frequency_hz"][[0, -1]].tolist() == [5.7, 90.0]
    assert {column.shape for column in table.values()} == {(len(harmonic_branch.nodes),)}


def test_rows_of_special_points(harmonic_branch):
    table = harmonic_branch.table("special_points")
    assert table["type"].tolist() == [s.kind for s in harmonic_branch.special_points]
    assert table["frequency_error"].max() < 1e-6
    empty = harmonic_branch.table("requested")
    assert {column.shape for column in empty.values()} == {(0,)}


def test_columns_of_rotations_are_in_rad():
    """A beam that turns at one end, with a stop of each kind: every number is in its own column."""
    stops = [Stop.linear("turn", 5.0, gap=3e-4), Stop.linear("tip", 5e3, gap=1e-4)]
    system = System.from_modal(
        [10.0], {"turn": [2.0], "tip": [0.5]}, modal_damping=0.05, stops=stops,
        excitation=[HarmonicForce("tip", 0.5)],
    )  # fmt: skip
    system = replace(system, rotations=frozenset({"turn"}))
    orbit = solve_orbit(system, frequency_hz=9.5)
    table = orbit_columns([orbit])
    history = orbit.history(20_000)
    depths = history.penetration.max(axis=0)
    assert depths.min() > 0.0
    for unit, depth in zip(("rad", "m"), depths, strict=True):
        assert table[f"max_penetration_{unit}"][0] == pytest.approx(depth, rel=1e-5)
        assert UNITS[f"max_penetration_{unit}"] == unit
    assert table["max_abs_displacement_rad"][0] == orbit.max_abs_displacement
    assert "max_abs_displacement_m" not in table
    assert {"displacement_rad[turn]", "displacement_m[tip]", "penetration_rad[0]",
            "penetration_m[1]", "force_n_m[0]", "force_n[1]"} < set(history.table())  # fmt: skip
    found = impacts(orbit)
    assert np.array_equal(found.rotation, found.stop == 0) and set(found.stop) == {0, 1}
    assert found.units["penetration"] == "m or rad"
    assert "rad/s" in repr(found) and "N m" in repr(found)


def test_an_unknown_part_is_refused(harmonic_branch):
    with pytest.raises(SystemModelError, match="part must be one of points, special_points"):
        harmonic_branch.table("orbits")


@pytest.mark.parametrize("part", ["points", "special_points"])
def test_data_frame(harmonic_branch, part):
    pytest.importorskip("pandas")
    frame, table = harmonic_branch.to_pandas(part), harmonic_branch.table(part)
    assert list(frame.columns) == list(table)
    assert frame.index.name == "point"
    for name, column in table.items():
        assert frame[name].tolist() == column.tolist()


def test_dataset(harmonic_branch):
    pytest.importorskip("xarray")
    data = harmonic_branch.to_xarray()
    assert data.sizes == {"point": len(harmonic_branch.nodes), "multiplier": 2}
    assert data["max_abs_displacement_m"].attrs["units"] == "m"
    found = data["multipliers"].values
    assert np.array_equal(found, [orbit.multipliers for orbit in harmonic_branch.points])


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_pandas"), ("xarray", "to_xarray")])
def test_a_missing_package_is_named(harmonic_branch, monkeypatch, package, method):
    monkeypatch.setitem(importlib.import_module("sys").modules, package, None)
    with pytest.raises(SystemModelError, match=f"{method} needs {package}"):
        getattr(harmonic_branch, method)()


def cells(html: str) -> list[list[str]]:
    """Texts of the rows of a table below its head."""
    _, _, *rows = ElementTree.fromstring(html)
    return [["".join(cell.itertext()) for cell in row] for row in rows]


def test_a_notebook_shows_branches_and_diagrams_as_tables(harmonic_branch):
    shown = cells(harmonic_branch._repr_html_())
    assert [row[0] for row in shown] == [s.kind for s in harmonic_branch.special_points]
    told = [s.frequency_hz for s in harmonic_branch.special_points]
    assert [float(row[1]) for row in shown] == pytest.approx(told, rel=1e-8)
    named = replace(harmonic_branch, name="<a & b>")
    (row,) = cells(Diagram((named,), (5.7, 90.0), "middle", ())._repr_html_())
    special, points = len(named.special_points), len(named.points)
    assert row == ["<a & b>", "1", "5.7 to 90", str(points), str(special), named.stop_reason]
