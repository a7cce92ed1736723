"""Branches as tables."""

import importlib

import numpy as np
import pytest

from nldyn import SystemModelError
from nldyn.branches.tables import UNITS
from nldyn.report.results import BRANCH_COLUMNS


def test_rows_belong_to_the_orbits(harmonic_branch):
    table = harmonic_branch.table()
    assert set(BRANCH_COLUMNS) - {"branch", "point"} <= set(table) <= set(UNITS)
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
