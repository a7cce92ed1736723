"""The harmonic branch of equation 3.1 against an independent shooting code (see the data's README).

The tabulated values carry nine decimals of a Hz and eight of a µm; that code agrees with itself
to 2e-10 relative.
"""

from __future__ import annotations

import csv
import math
from importlib.resources import files

import numpy as np
import pytest
from independent import Motion
from problems import RANGE_HZ

from nldyn import continue_branch, solve_orbit
from nldyn.branches.peaks import resonance_peaks


def table(name: str) -> list[dict[str, str]]:
    text = (files("paper") / "data" / name).read_text(encoding="utf-8")
    return list(csv.DictReader(text.splitlines()))


REFERENCE = sorted(
    (
        float(row["fe_Hz_shooting"]),
        row["type"],
        1e-6 * float(row["max_abs_y_um_shooting"]),
        int(row["contact_transitions"]) // 2,
    )
    for row in table("auto_special_points_harmonic.csv")
)


def bifurcations(branch):
    """Frequency, kind, amplitude and impacts of all special points but grazing, by frequency."""
    return sorted(
        (s.frequency_hz, s.kind, s.orbit.max_abs_displacement, s.orbit.impacts)
        for s in branch.special_points
        if s.kind != "GR"
    )


def of_kind(branch, kind):
    return [s for s in branch.special_points if s.kind == kind]


def test_no_fold_or_flip_is_missing_and_none_is_invented(harmonic_branch):
    found = bifurcations(harmonic_branch)
    assert [kind for _, kind, _, _ in found] == [kind for _, kind, _, _ in REFERENCE]
    assert len(found) == 14


@pytest.mark.parametrize("index", range(len(REFERENCE)))
def test_fold_or_flip_agrees_with_the_reference(harmonic_branch, index):
    frequency, kind, amplitude, impacts = bifurcations(harmonic_branch)[index]
    reference = REFERENCE[index]
    assert kind == reference[1]
    assert frequency == pytest.approx(reference[0], rel=1e-9)
    assert amplitude == pytest.approx(reference[2], rel=2e-7)
    assert impacts == reference[3]


@pytest.mark.parametrize("row", table("auto_peaks_harmonic.csv"), ids=lambda row: row["peak"])
def test_peak_agrees_with_the_reference(harmonic_branch, row):
    """At a top the height does not depend on the place: 1e-10 of it leaves 1e-5 of the place."""
    frequency = float(row["fe_Hz"])
    tops = resonance_peaks(harmonic_branch, (0.999 * frequency, 1.001 * frequency))
    assert len(tops) == 1
    assert tops[0].height == pytest.approx(1e-6 * float(row["max_abs_y_um"]), rel=2e-8)
    assert tops[0].frequency_hz == pytest.approx(frequency, rel=1e-6)


def test_branch_has_these_four_peaks_only(harmonic_branch):
    assert len(resonance_peaks(harmonic_branch, RANGE_HZ)) == 4


@pytest.mark.parametrize("start", [20.0, 45.0])
def test_points_do_not_depend_on_where_the_continuation_starts(one_dof, harmonic_branch, start):
    other = continue_branch(solve_orbit(one_dof, start), RANGE_HZ)
    for a, b in zip(bifurcations(harmonic_branch), bifurcations(other), strict=True):
        assert a[1] == b[1]
        assert a[0] == pytest.approx(b[0], rel=1e-9)
    first, second = of_kind(harmonic_branch, "GR"), of_kind(other, "GR")
    for s, t in zip(first, second, strict=True):
        assert s.frequency_hz == pytest.approx(t.frequency_hz, rel=1e-9)


def test_range_ends_are_met_exactly(harmonic_branch):
    frequencies = harmonic_branch.frequency_hz
    assert frequencies[0] == pytest.approx(RANGE_HZ[0], rel=1e-14)
    assert frequencies[-1] == pytest.approx(RANGE_HZ[1], rel=1e-14)
    assert frequencies.min() > RANGE_HZ[0] * (1 - 1e-14)
    assert frequencies.max() < RANGE_HZ[1] * (1 + 1e-14)
    assert harmonic_branch.stop_reasons == ("end of the frequency range",) * 2
    assert harmonic_branch.stop_reason.count("end of the frequency range") == 2


def test_fold_has_a_multiplier_of_one_and_turns_the_branch(harmonic_branch):
    folds = of_kind(harmonic_branch, "LP")
    assert len(folds) == 6
    for fold in folds:
        assert np.abs(fold.orbit.multipliers - 1.0).min() < 1e-6
        assert abs(fold.point.tangent[-1]) < 1e-6
        lengths = np.array([node.arclength for node in harmonic_branch.nodes])
        i = int(np.searchsorted(lengths, fold.point.arclength))
        before = harmonic_branch.nodes[i - 1].tangent[-1]
        after = harmonic_branch.nodes[i].tangent[-1]
        assert before * after < 0.0


def test_flip_has_a_multiplier_of_minus_one(harmonic_branch):
    flips = of_kind(harmonic_branch, "PD")
    assert len(flips) == 8
    for flip in flips:
        assert np.abs(flip.orbit.multipliers + 1.0).min() < 1e-6
        others = np.abs(np.abs(flip.orbit.multipliers) - 1.0)
        assert np.sort(others)[1] > 1e-3


@pytest.mark.parametrize("index", [0, -1])
def test_monodromy_at_a_flip_agrees_with_runge_kutta(one_dof, harmonic_branch, index):
    """-1 is an eigenvalue of the variational equations too, integrated without the flow map."""
    orbit = of_kind(harmonic_branch, "PD")[index].orbit
    start = orbit.states(np.array([0.0]))[0]
    _, jacobian, _ = Motion(one_dof).run(start, (0.0, 2 * np.pi), orbit.omega)
    assert np.abs(np.linalg.eigvals(jacobian) + 1.0).min() < 1e-7


def test_stability_changes_at_folds_and_flips_only(harmonic_branch):
    events = sorted(s.point.arclength for s in harmonic_branch.special_points if s.kind != "GR")
    lengths = np.array([node.arclength for node in harmonic_branch.nodes])
    stable = harmonic_branch.stable
    changes = np.flatnonzero(stable[1:] != stable[:-1])
    assert len(changes) == len(events)
    for event, i in zip(events, changes, strict=True):
        assert lengths[i] <= event <= lengths[i + 1]


def test_grazing_points_touch_and_nothing_else_happens_there(harmonic_branch):
    points = of_kind(harmonic_branch, "GR")
    assert len(points) == 3
    for grazing in points:
        depths = grazing.orbit.extremes(0).values
        assert np.abs(depths).min() < 1e-12
        moduli = np.abs(grazing.orbit.multipliers)
        assert np.abs(moduli - 1.0).min() > 1e-3


def test_number_of_impacts_changes_at_grazing_points_only(harmonic_branch):
    lengths = np.array([node.arclength for node in harmonic_branch.nodes])
    events = sorted(s.point.arclength for s in of_kind(harmonic_branch, "GR"))
    impacts = np.array([orbit.impacts for orbit in harmonic_branch.points])
    changes = np.flatnonzero(np.diff(impacts))
    assert len(changes) == len(events)
    for event, i in zip(events, changes, strict=True):
        assert lengths[i] <= event <= lengths[i + 1]
        assert abs(impacts[i + 1] - impacts[i]) == 1


def test_special_points_come_in_the_order_of_the_branch(harmonic_branch):
    lengths = [s.point.arclength for s in harmonic_branch.special_points]
    assert lengths == sorted(lengths)
    arclengths = np.array([node.arclength for node in harmonic_branch.nodes])
    assert np.all(np.diff(arclengths) > 0.0)


def test_located_frequency_is_good_to_what_it_says(harmonic_branch):
    reference = {f: kind for f, kind, _, _ in REFERENCE}
    for special in harmonic_branch.special_points:
        assert 0.0 <= special.frequency_error < 1e-8
        if special.kind != "GR":
            nearest = min(reference, key=lambda f: abs(f - special.frequency_hz))
            assert math.isclose(nearest, special.frequency_hz, rel_tol=1e-9)


def test_every_point_of_the_branch_is_a_solution(harmonic_branch):
    for orbit in harmonic_branch.points:
        assert orbit.error < 1e-8
        assert orbit.liouville_error < 1e-7
