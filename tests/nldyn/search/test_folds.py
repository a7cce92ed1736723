"""Further branches from known folds, by way of other dampings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from nldyn import (
    Branch,
    CheckpointFile,
    ContinuationOptions,
    ConvergenceError,
    Diagram,
    Exploration,
    ExploreOptions,
    HarmonicForce,
    Orbit,
    Parameter,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    explore,
    find_orbits,
    solve_orbit,
)
from nldyn.bifurcations.point import is_at
from nldyn.flow.flow_map import flow_of
from nldyn.io.branches import load_exploration
from nldyn.orbits.starts import orbit_near
from nldyn.paper.jobs import scene_system
from nldyn.paper.starts import read_starts
from nldyn.search import explore as survey
from nldyn.search.explore import _Survey
from nldyn.search.folds import connected_folds, leading_parameter


def two_modes() -> System:
    return scene_system("two_dof_xi_0.01")


def start_near(frequency_hz: float, period: int) -> Orbit:
    """Orbit of the two-mode model from the nearest of the kept starts."""
    starts = [start for start in read_starts("two_dof_xi_0.01") if start.period == period]
    start = min(starts, key=lambda start: abs(start.frequency_hz - frequency_hz))
    omega = 2.0 * np.pi * start.frequency_hz
    orbit = orbit_near(flow_of(two_modes()), start.state, period, omega, "middle")
    assert orbit is not None
    return orbit


@pytest.fixture(scope="module")
def isola() -> Branch:
    """A closed branch of unstable orbits of the two-mode model."""
    branch = continue_branch(start_near(29.51, 3), (29.2, 29.6))
    assert branch.stop_reasons == ("closed branch", "closed branch")
    return branch


@pytest.mark.slow
def test_curve_of_folds_of_an_isola_leads_to_another_branch(isola):
    """A third fold of the curve lies on a branch that other orbits lead to."""
    fold = min(isola.special_points, key=lambda special: special.frequency_hz)
    assert fold.kind == "LP"
    damping = leading_parameter(two_modes())
    found, broken = connected_folds(fold, damping, 1.2, (29.2, 29.6), ContinuationOptions())
    assert not broken
    (orbit,) = [orbit for orbit in found if not isola.contains(orbit)]
    assert np.abs(orbit.multipliers - 1.0).min() < 1e-5
    other = continue_branch(start_near(29.65, 3), (28.0, 32.0))
    assert any(is_at(orbit, special) for special in other.special_points if special.kind == "LP")


def test_curve_of_folds_that_only_turns_leads_back():
    """Both folds of a resonance vanish in each other when the excitation becomes weaker."""
    branch = continue_branch(solve_orbit(one_mode(), 15.0), (10.0, 40.0))
    upper, lower = (special for special in branch.special_points if special.kind == "LP")
    unbalance = Parameter("mass_times_radius")
    found, broken = connected_folds(upper, unbalance, 3.0, (5.0, 60.0), ContinuationOptions())
    assert [is_at(orbit, lower) for orbit in found] == [True]
    assert not broken


def test_curve_that_breaks_off_says_why():
    branch = continue_branch(solve_orbit(one_mode(), 15.0), (10.0, 40.0))
    fold = next(special for special in branch.special_points if special.kind == "LP")
    short = ContinuationOptions(max_points=2)
    _, broken = connected_folds(fold, Parameter("mass_times_radius"), 3.0, (5.0, 60.0), short)
    assert broken == ["2 points", "2 points"]


def one_mode(**changes) -> System:
    """A mode before a stop, as in docs/how-to/curves.md."""
    return System.from_modal(
        [13.1],
        {"middle": [0.635]},
        **{"modal_damping": 0.0142, "excitation": [Unbalance("middle", 4.92e-6)], **changes},
        stops=[Stop("middle", stiffness=5.17e9, gap=2e-6)],
    )


@pytest.mark.parametrize(
    ("changes", "name"),
    [
        ({}, "modal_damping"),
        ({"modal_damping": 0.0}, "mass_times_radius"),
        ({"modal_damping": 0.0, "excitation": [HarmonicForce("middle", 1.0)]}, "amplitude"),
    ],
)
def test_damping_is_changed_where_there_is_some_and_else_the_excitation(changes, name):
    assert leading_parameter(one_mode(**changes)).name == name


def test_nothing_is_changed_where_there_is_nothing():
    assert leading_parameter(one_mode(modal_damping=0.0, excitation=[])) is None


RANGE_HZ = (24.0, 35.0)
LITTLE = ExploreOptions(spacing=0.5, starts=1, settling=1, unstable_period=0, fold_factor=2.0)


@pytest.fixture
def looked_at(monkeypatch) -> list[float]:
    """Where folds are followed, which lead to an isola that little simulation does not find."""
    orbit = find_orbits(one_mode(), 34.0, 3)[0]
    frequencies: list[float] = []

    def lead(fold, parameter, factor, range_hz, options):
        assert (parameter.name, factor, range_hz) == ("modal_damping", 2.0, RANGE_HZ)
        frequencies.append(fold.frequency_hz)
        return [orbit], ["2 points"]

    monkeypatch.setattr(survey, "connected_folds", lead)
    return frequencies


@pytest.fixture(scope="module")
def harmonic() -> Diagram:
    """The branch that is known."""
    branch = continue_branch(solve_orbit(one_mode(), 24.0), RANGE_HZ)
    return Diagram((branch,), RANGE_HZ, "middle", ())


def explored(known: Diagram, effort: ExploreOptions = LITTLE, **more) -> Exploration:
    return explore(one_mode(), RANGE_HZ, 3, effort=effort, known=known, **more)


def test_branches_that_folds_lead_to_are_followed_and_their_folds_too(looked_at, harmonic):
    without = explored(harmonic, replace(LITTLE, fold_factor=1.0))
    assert not looked_at
    found = explored(harmonic)
    assert found.finished
    assert found.new_branches == (len(found.diagram.branches) - 1,)
    assert len(found.diagram.branches) > len(without.diagram.branches)
    assert "the fold of branch  at 25.2404 Hz broke off: 2 points" in found.report()
    assert f"the folds of the first {len(found.diagram.branches)} branches" in found.report()
    assert "folds" not in without.report()
    isola = next(b for b in found.diagram.branches if b.stop_reasons[0] == "closed branch")
    folds = [
        special.frequency_hz
        for branch in (*harmonic.branches, isola)
        for special in branch.special_points
        if special.kind == "LP"
    ]
    assert len(folds) >= 4
    assert set(folds) <= set(looked_at)


def test_interrupted_among_the_folds_it_goes_on_and_gives_the_same(
    looked_at, harmonic, tmp_path, monkeypatch
):
    whole = explored(harmonic)
    place, steps = tmp_path / "found.h5", []

    def stop(self) -> None:
        if steps:
            raise KeyboardInterrupt
        steps.append(follow(self))

    follow = _Survey.follow_folds
    monkeypatch.setattr(_Survey, "follow_folds", stop)
    with pytest.raises(KeyboardInterrupt):
        explored(harmonic, checkpoint=CheckpointFile(place))
    kept = load_exploration(place)
    assert kept.folds_due and not kept.finished
    assert "not finished: of round 1 the folds of 1 of" in kept.report()
    monkeypatch.setattr(_Survey, "follow_folds", follow)
    resumed = explored(harmonic, checkpoint=CheckpointFile(place))
    assert resumed.finished and load_exploration(place).finished
    assert resumed.new_branches == whole.new_branches
    for a, b in zip(resumed.diagram.branches, whole.diagram.branches, strict=True):
        np.testing.assert_array_equal(a.frequency_hz, b.frequency_hz)


def test_folds_that_cannot_be_followed_are_noted(harmonic, monkeypatch):
    def fail(*given):
        raise ConvergenceError("no start")

    monkeypatch.setattr(survey, "connected_folds", fail)
    found = explored(harmonic)
    notes = [note for note in found.diagram.notes if "was not followed in modal_damping" in note]
    folds = [s for b in found.diagram.branches for s in b.special_points if s.kind == "LP"]
    assert len(notes) == len(folds) > 0
    assert all(note.endswith(": no start") for note in notes)


@pytest.mark.parametrize("factor", [0.5, float("nan"), 1e3, "2", True])
def test_factors_that_make_no_sense_are_refused(factor):
    with pytest.raises(SystemModelError, match="explore: fold_factor must lie between 1 and 100"):
        ExploreOptions(fold_factor=factor)
