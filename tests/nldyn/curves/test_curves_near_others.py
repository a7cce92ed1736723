"""Curves that pass light contacts, neutral saddles and touches of several stops at once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from nldyn import (
    ContinuationOptions,
    HarmonicForce,
    Parameter,
    Stop,
    System,
    continue_branch,
    continue_special,
    solve_orbit,
)
from nldyn.bifurcations import marks
from nldyn.bifurcations.corners import extremes_meet

SECOND = Parameter("natural_frequency_hz", 1)


def two_modes() -> System:
    """Two modes of which the second one meets a Hertz stop."""
    return System.from_modal(
        [10.0, 23.0], {"a": [1.0, 0.6], "b": [0.4, -1.0]}, modal_damping=0.02,
        stops=[Stop("b", 1e9, gap=5e-4)], excitation=[HarmonicForce("a", 0.5)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def harmonic():
    return continue_branch(solve_orbit(two_modes(), 8.0), (4.0, 45.0))


@pytest.mark.slow
def test_a_flip_is_followed_past_contacts_of_a_few_nanometres(harmonic):
    """A difference by the mode's frequency reaches across them unless it is short."""
    flip = [p for p in harmonic.special_points if p.kind == "PD"][2]
    curve = continue_special(flip, ("frequency_hz", SECOND), ((4.0, 10.15), (20.5, 23.1)))
    assert all(reason.startswith("end of the range") for reason in curve.stop_reasons)
    orbit = min(curve.at("natural_frequency_hz", 20.8), key=lambda orbit: orbit.frequency_hz)
    other = continue_branch(orbit, (orbit.frequency_hz - 1e-3, orbit.frequency_hz + 1e-3))
    flips = [p.frequency_hz for p in other.special_points if p.kind == "PD"]
    assert flips == [pytest.approx(orbit.frequency_hz, rel=1e-9)]


@pytest.mark.slow
def test_a_neimark_sacker_curve_does_not_go_over_to_neutral_saddles(harmonic):
    """Some lie so near to its start that a step of usual length led there."""
    start = next(p for p in harmonic.special_points if p.kind == "NS")
    curve = continue_special(start, ("frequency_hz", "gap"), ((4.0, 45.0), (1e-4, 2e-3)))
    assert curve.stop_reasons == ("becomes a curve of neutral saddles at a resonance",) * 2
    assert curve.notes == ()
    assert [mark.kind for mark in curve.marks] == ["R1", "LPNS", "R1"]
    for mark in curve.marks:
        mu = mark.orbit.multipliers
        if mark.kind == "R1":  # both multipliers of a pair
            assert np.sort(np.abs(mu - 1.0))[1] < 1e-3
        if mark.kind == "LPNS":
            assert np.abs(mu - 1.0).min() < 1e-6
            pair = mu[np.abs(mu.imag) > 1e-3]
            assert np.abs(np.abs(pair) - 1.0).max() < 1e-6
    inner = np.array([orbit.multipliers for orbit in curve.orbits[1:-1]])
    off = np.abs(np.abs(inner) - 1.0) + (np.abs(inner.imag) < 1e-9)
    assert off.min(axis=1).max() < 1e-6


def cubic(depth: float, speed: float) -> tuple[float, float, float]:
    stiffness, third = 0.5 * (20.0 * math.pi) ** 2, (20.0 * math.pi) ** 2 / 1e-6
    return stiffness * depth + third * depth**3, stiffness + 3.0 * third * depth**2, 0.0


def test_stops_touched_at_once_by_symmetry_are_one_mark():
    """Two stops with a law of one's own; their contacts are split at one orbit."""
    stops = [Stop("m", 200.0 * np.pi**2, 1.0, law=cubic, direction=side) for side in (1, -1)]
    system = System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.03, stops=stops,
        excitation=[HarmonicForce("m", 45.0)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 10.9), (10.6, 10.9))
    (broken,) = [p for p in branch.special_points if p.kind == "BP"]
    curve = continue_special(broken, ("frequency_hz", "amplitude"), ((10.0, 11.0), (44.0, 48.0)))
    assert curve.notes == ()
    (mark,) = [mark for mark in curve.marks if mark.kind == "GRBP"]
    for stop in (0, 1):
        values = mark.orbit.extremes(stop).values
        assert np.abs(values).min() < 1e-9 * np.abs(values).max()


def bilinear() -> System:
    """One mode and a linear stop four times as stiff as it."""
    return System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.03, stops=[Stop.linear("m", 15791.0, gap=1e-3)],
        excitation=[HarmonicForce("m", 1.0)],
    )  # fmt: skip


def test_a_closed_curve_has_each_orbit_once_at_a_value():
    branch = continue_branch(solve_orbit(bilinear(), 8.0), (5.0, 20.0))
    folds = [p for p in branch.special_points if p.kind == "LP"]
    curve = continue_special(folds[-1], ("frequency_hz", "gap"), ((3.0, 40.0), (1e-4, 5e-3)))
    assert curve.stop_reasons == ("closed curve", "closed curve")
    for gap in (1e-3, 1.0001e-3):
        first, last = sorted(orbit.frequency_hz for orbit in curve.at("gap", gap))
        assert last - first > 1.0


def test_a_curve_of_grazings_tells_where_its_extreme_vanishes():
    """The minimum that splits a contact meets the maximum beside it: value and slope are zero."""
    system = System.from_modal(
        [10.0, 18.56], {"a": [1.4746, -0.3626], "b": [0.5771, 0.7398]}, modal_damping=0.01432,
        stops=[Stop.linear("b", 36784.0, gap=2.24e-4)], excitation=[HarmonicForce("a", 0.5)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 9.0), (8.9, 9.2))
    (split,) = [p for p in branch.special_points if p.kind == "GR" and 9.05 < p.frequency_hz < 9.1]
    curve = continue_special(split, ("frequency_hz", "gap"), ((8.9, 60.0), (2e-4, 2e-3)))
    assert curve.stop_reasons[1] == "the extreme that grazes meets another one, and both vanish"
    assert [extremes_meet(point) for point in curve.points].index(True) > len(curve.points) - 10
    extremes = curve.orbits[-1].extremes(0)
    near = np.abs(extremes.values) < 1e-9 * np.abs(extremes.values).max()
    assert set(extremes.is_maximum[near]) == {True, False}
    assert np.ptp(extremes.phases[near]) < 0.01


def test_a_change_of_sign_at_a_jump_is_a_note_and_no_mark(harmonic, monkeypatch):
    fold = next(p for p in harmonic.special_points if p.kind == "LP")
    options, gap = ContinuationOptions(max_points=3), fold.orbit.system.stops[0].gap * (1.0 + 1e-6)
    monkeypatch.setattr(
        marks, "curve_tests", lambda point: {"R1": -1.0 if point.values[1] < gap else 1.0}
    )
    window = ((4.0, 45.0), (1e-4, 2e-3))
    curve = continue_special(fold, ("frequency_hz", "gap"), window, options=options)
    assert curve.marks == ()
    (note,) = curve.notes
    assert note.startswith("R1 near ") and note.endswith("may be missing: its test jumps there")
