"""Files of earlier versions are read, and what they hold goes on."""

from pathlib import Path

import numpy as np
import pytest
from problems import make_one_dof

import nldyn
from nldyn import ContinuationOptions, continue_branch, solve_orbit

DATA = Path(__file__).parent / "data"


def test_a_branch_of_version_2_goes_on():
    """Begun at 33 Hz with seven steps in either direction at most."""
    (begun,) = nldyn.load(DATA / "branches_of_version_2.h5")
    low, high = begun.course.limits
    assert begun.parameter.name == "frequency_hz"
    ended = continue_branch(begun, options=ContinuationOptions())
    whole = continue_branch(solve_orbit(make_one_dof(), 33.0), (low, high))
    assert ended.values == pytest.approx(whole.values, rel=1e-12)
    assert [s.kind for s in ended.special_points] == ["PD"]
    assert ended.special_points[0].value == pytest.approx(whole.special_points[0].value, rel=1e-9)


def test_a_curve_of_version_1_has_its_values_and_goes_on():
    """The scale of its frequency was that of the logarithm of Hz."""
    (curve,) = nldyn.load(DATA / "curves_of_version_1.h5")
    column = curve.table()["frequency_hz"]
    assert column == pytest.approx([orbit.frequency_hz for orbit in curve.orbits], rel=1e-12)
    assert np.all((column >= 31.0 * (1 - 1e-12)) & (column <= 36.0 * (1 + 1e-12)))
    assert curve.residuals.max() < 1e-7
    longer = curve.extend([(30.0, 36.0), (-1e-5, 1e-5)])
    assert len(longer.points) > len(curve.points)


def test_orbits_over_the_gap_of_version_2_are_a_branch():
    """At 12.2 Hz; earlier versions wrote them as a curve in one parameter."""
    (old,) = nldyn.load(DATA / "orbits_over_the_gap_of_version_2.h5")
    branch = continue_branch(old.points[0], (3e-4, 3e-3), parameter="gap")
    assert [s.kind for s in old.special_points] == ["LP", "LP", "GR"]
    values = [[s.value for s in found.special_points] for found in (old, branch)]
    assert values[0] == pytest.approx(values[1], rel=1e-9)
    found = [[orbit.max_abs_displacement for orbit in b.at(1e-3)] for b in (old, branch)]
    assert len(found[0]) == 3
    assert found[0] == pytest.approx(found[1], rel=1e-9)
