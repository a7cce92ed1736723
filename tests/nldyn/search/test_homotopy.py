"""Isolas are found by way of a changed system, where other branches lead to them."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from independent import Motion

from nldyn import (
    CheckpointFile,
    ContinuationOptions,
    Damper,
    Diagram,
    HarmonicForce,
    Parameter,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    by_detour,
    continue_branch,
    find_orbits,
    index_sum,
    save,
    solve_orbit,
)
from nldyn.bifurcations.point import is_at
from nldyn.branches.checkpoint import Checkpoint
from nldyn.flow.flow_map import flow_of
from nldyn.io.branches import load_branches, load_diagram, save_branches
from nldyn.orbits.homotopy import Homotopy, _far, checked_factors
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.starts import orbit_near
from nldyn.paper.jobs import scene_system
from nldyn.paper.starts import read_starts
from nldyn.search.diagram import Collector

RANGE_HZ = (7.2, 11.0)
HALF = {"damping": 0.5}


def two_modes(modal_damping: float = 0.013513, size: float = 1.0) -> System:
    """A stop that touches one of two modes, whose harmonic branch leaves an isola beside it.

    Its motions are so many times as large as those of size 1, and otherwise the same.
    """
    return System.from_modal(
        [10.0, 30.307], {"tip": [1.0, -1.2178], "force": [1.0, 1.0309]},
        modal_damping=modal_damping, stops=[Stop("tip", 3.5791e7 * size**-0.5)],
        excitation=[HarmonicForce("force", 7.4926 * size)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def harmonic() -> Diagram:
    """The branch that is known."""
    branch = continue_branch(solve_orbit(two_modes(), 10.99), RANGE_HZ)
    return Diagram((branch,), RANGE_HZ, "tip", ())


@pytest.fixture(scope="module")
def found(harmonic) -> Diagram:
    """What less damping leads to."""
    return by_detour(harmonic, HALF, max_period=1, spacing=0.1)


def test_an_isola_that_joins_the_known_branch_at_less_damping_is_found(harmonic, found):
    assert found.branches[0] is harmonic.branches[0]
    (isola,) = found.branches[1:]
    assert isola.closed
    assert not any(harmonic.branches[0].contains(orbit) for orbit in isola.points)
    assert found.notes[-1].endswith("1 branch beside those given")
    less = continue_branch(solve_orbit(two_modes(0.5 * 0.013513), 10.99), RANGE_HZ)
    at_own, beside, at_less = (len(branch.at(8.0)) for branch in (*found.branches, less))
    assert at_less == at_own + beside > at_own


def test_it_says_whether_orbits_are_missing_for_certain(found):
    assert found.notes[-2].startswith(
        "indices of the fixed points of P add up to one from 7.2 to 11 Hz; isolas"
    )


def test_it_says_that_orbits_are_missing_where_only_the_isola_is_known(found):
    known = replace(found, branches=found.branches[1:])
    alone = by_detour(known, {"damping": 0.95}, max_period=1, spacing=0.5)
    assert len(alone.branches) == 1
    assert " but for P from 7.2 to 11 Hz: " in alone.notes[-2]
    assert alone.notes[-2].endswith("orbits are missing, or a branch was broken off")


@pytest.mark.slow
def test_less_excitation_leads_to_the_isola_as_well(harmonic, found):
    other = by_detour(harmonic, {"excitation": 0.8}, max_period=1, spacing=0.1)
    assert len(other.branches) == 2
    assert all(found.branches[1].contains(orbit) for orbit in other.branches[1].points)


def runge_kutta_gap(orbit: Orbit, system: System) -> float:
    """How far from closing an orbit of one period is by another integration, relative."""
    start = orbit.states([0.0])[0]
    end, _ = Motion(system).run(start, (0.0, 2.0 * np.pi), orbit.omega, tangent=False)
    scale = np.repeat([1.0, orbit.omega], 2) * np.abs(start[:2]).max()
    return float(np.abs((end - start) / scale).max())


def test_orbits_of_the_isola_close_under_runge_kutta(found):
    for orbit in found.branches[1].at(8.0):
        assert runge_kutta_gap(orbit, two_modes()) < 1e-8


def test_the_indices_add_up_to_one_with_the_isola_and_without(harmonic, found):
    for hz in (7.5, 8.0, 8.9, 10.0):
        assert index_sum(harmonic.branches, hz) == index_sum(found.branches, hz) == 1


SECOND = Parameter("natural_frequency_hz", 1)


@pytest.mark.parametrize(
    "factors",
    [
        {"damping": 0.2},
        {"damping": 0.9, "excitation": 1.1},
        {"damping": 3.0},
        {"excitation": 0.5},
        {"excitation": 1.5},
        {"stiffness": 2.0, SECOND: 0.97},
        {Parameter("coefficient"): 4.0},
    ],
)
def test_carried_by_a_detour_and_back_an_orbit_is_the_same(factors):
    system = replace(two_modes(), dampers=(Damper("tip", 0.3),))
    orbit = solve_orbit(system, 10.0)
    detour = Homotopy(orbit.problem.flow, checked_factors(system, factors))
    other = detour.carried(orbit, 0.0, 1.0)
    there, tiny = other.system, {"rtol": 1e-12}
    all_damping = factors.get("damping", 1.0)
    modal = all_damping * system.damping.diagonal() * [1.0, factors.get(SECOND, 1.0)]
    coefficient = 0.3 * all_damping * factors.get(Parameter("coefficient"), 1.0)
    assert np.allclose(there.damping, np.diag(modal), **tiny)
    assert there.dampers[0].coefficient == pytest.approx(coefficient, rel=1e-12)
    amplitude = 7.4926 * factors.get("excitation", 1.0)
    assert there.excitation[0].amplitude == pytest.approx(amplitude, rel=1e-12)
    assert there.stops[0].stiffness == pytest.approx(3.5791e7 * factors.get("stiffness", 1.0))
    assert np.allclose(there.frequencies_hz, [10.0, 30.307 * factors.get(SECOND, 1.0)], **tiny)
    assert other.frequency_hz == pytest.approx(10.0, rel=1e-14)
    assert runge_kutta_gap(other, there) < 1e-8
    back = detour.carried(other, 1.0, 0.0)
    assert np.abs(back.point - orbit.point).max() < 1e-9 * np.abs(orbit.point[:-1]).max()


@pytest.fixture(scope="module")
def three(harmonic) -> Diagram:
    """What a higher second natural frequency leads to."""
    return by_detour(harmonic, {SECOND: 1.05}, max_period=1, spacing=0.1)


@pytest.mark.parametrize("factors", [{"damping": 0.9}, {"excitation": 1.02}, {SECOND: 1.003}])
def test_a_fold_carried_there_and_back_is_the_same_and_moves_meanwhile(found, factors):
    (first, *_) = [s for s in found.branches[1].special_points if s.kind == "LP"]
    detour = Homotopy(first.orbit.problem.flow, checked_factors(two_modes(), factors))
    there = detour.carried_fold(first.orbit, 0.0, 1.0)
    assert runge_kutta_gap(there, detour.flow(1.0).system) < 1e-8
    assert np.abs(there.multipliers - 1.0).min() < 1e-6
    assert abs(there.frequency_hz / first.frequency_hz - 1.0) > 1e-5
    back = detour.carried_fold(there, 1.0, 0.0)
    assert back.frequency_hz == pytest.approx(first.frequency_hz, rel=1e-8)


def folds_of(diagram: Diagram) -> list[Orbit]:
    return [s.orbit for b in diagram.branches for s in b.special_points if s.kind == "LP"]


@pytest.fixture
def asked(monkeypatch) -> list[tuple[float, bytes]]:
    """Places on its way at which a fold is looked for, and from which guesses."""
    asked: list[tuple[float, bytes]] = []
    near = Homotopy._fold_near

    def noted(self, fold, share, guess):
        asked.append((share, guess.tobytes()))
        return near(self, fold, share, guess)

    monkeypatch.setattr(Homotopy, "_fold_near", noted)
    return asked


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("factor", [0.993, 1.007])
def test_every_fold_gets_to_a_natural_frequency_a_little_off(three, index, factor, asked):
    """Newton's method finds some from nowhere but near by: steps below 1e-3 are needed at first."""
    factors = checked_factors(two_modes(), {Parameter("natural_frequency_hz", index): factor})
    folds = folds_of(three)
    detour = Homotopy(folds[0].problem.flow, factors)
    assert len(folds) == 9
    for fold in folds:
        asked.clear()
        there = detour.carried_fold(fold, 0.0, 1.0)
        assert np.abs(there.multipliers - 1.0).min() < 1e-6
        assert there.frequency_hz != pytest.approx(fold.frequency_hz, rel=1e-5)
        assert len(set(asked)) == len(asked) >= 2


def test_a_fold_whose_way_is_smooth_takes_steps_each_longer_than_the_one_before(three, asked):
    fold = folds_of(three)[0]
    factors = checked_factors(two_modes(), {"excitation": 1.1})
    assert Homotopy(fold.problem.flow, factors).carried_fold(fold, 0.0, 1.0) is not None
    places = [place for place, _ in asked]
    steps = np.diff([0.0, *places])
    assert places[-1] == 1.0 and len(places) <= 8
    assert steps[1:-1] == pytest.approx(3.0 * steps[:-2])


@pytest.mark.parametrize(
    ("start_hz", "fold_hz", "factors"),
    [
        (20.4822, 20.566850, {"excitation": 1.1}),
        pytest.param(36.2940, 34.850836, {SECOND: 1.007}, marks=pytest.mark.slow),
    ],
)
def test_a_fold_is_not_changed_for_another_one_near_by_on_its_way(start_hz, fold_hz, factors):
    """Where its way ends beside another one, 0.005 of the orbit away, it is lost instead."""
    system = scene_system("two_dof_xi_0.001")
    starts = read_starts("two_dof_xi_0.001")
    start = min(starts, key=lambda s: abs(s.frequency_hz - start_hz))
    omega = 2.0 * np.pi * start.frequency_hz
    orbit = orbit_near(flow_of(system), start.state, 3, omega, "middle")
    branch = continue_branch(orbit, (18.0, 90.0), options=ContinuationOptions(max_points=250))
    (fold,) = (s for s in branch.special_points if abs(s.frequency_hz - fold_hz) < 2e-6)
    detour = Homotopy(orbit.problem.flow, checked_factors(system, factors))
    there = detour.carried_fold(fold.orbit, 0.0, 1.0)
    back = there and detour.carried_fold(there, 1.0, 0.0)
    assert back is None or is_at(back, fold)


def test_folds_of_small_motions_are_carried_as_those_of_large_ones():
    """A millionth of the motion: the same frequencies."""
    ends = []
    for size in (1.0, 1e-6):
        system = two_modes(size=size)
        branch = continue_branch(solve_orbit(system, 10.99), RANGE_HZ)
        detour = Homotopy(branch.points[0].problem.flow, checked_factors(system, HALF))
        folds = folds_of(Diagram((branch,), RANGE_HZ, "tip"))
        ends.append([detour.carried_fold(fold, 0.0, 1.0).frequency_hz for fold in folds])
    assert len(ends[0]) == 4
    assert ends[1] == pytest.approx(ends[0], rel=1e-8)


@pytest.mark.parametrize("size", [1.0, 1e-6])
@pytest.mark.parametrize(
    ("states", "frequency", "first_far"), [(0.1, 0.0, True), (0.0, 0.1, True), (3e-3, 4e-3, False)]
)
def test_far_is_told_of_states_and_of_frequencies(size, states, frequency, first_far):
    """What was missed, over the way, and for the first step over the orbit."""
    there = np.array([3.0 * size, 4.0 * size, 5.0])
    way = np.array([3.0 * size * states, 4.0 * size * states, frequency])
    before = [(0.0, there - 2.0 * way), (0.5, there - way)]
    for miss, far in ((0.25, False), (0.35, True)):
        assert _far(there, there - miss * way, before) == far
    assert _far(there, there - 0.25 * way, before[:1]) == first_far


def test_an_orbit_far_from_where_it_was_expected_is_not_taken(harmonic):
    orbit, other = (solve_orbit(two_modes(), hz) for hz in (10.0, 7.5))
    detour = Homotopy(orbit.problem.flow, checked_factors(two_modes(), HALF))
    asked = []

    def near(here, share, guess):
        asked.append(share)
        return orbit if share < 0.01 else other

    assert detour._led(orbit, 0.0, 1.0, near) is None
    assert max(asked) > 0.01 > min(asked)


def test_what_is_no_fold_in_the_end_is_not_taken(found, monkeypatch):
    fold = folds_of(found)[0]
    monkeypatch.setattr(
        "nldyn.orbits.homotopy.correct", lambda *_: SimpleNamespace(converged=False, orbit=fold)
    )
    detour = Homotopy(fold.problem.flow, checked_factors(two_modes(), HALF))
    assert detour.carried_fold(fold, 0.0, 1.0) is None


def test_all_folds_of_the_branches_there_and_no_other_points_are_carried_back(found):
    less = continue_branch(solve_orbit(two_modes(0.5 * 0.013513), 10.99), RANGE_HZ)
    tried = re.search(r" \d+ of (\d+) folds", found.notes[-1])
    assert int(tried[1]) == len(folds_of(Diagram((less,), RANGE_HZ, "tip")))


def test_folds_alone_lead_to_an_isola_that_lies_between_the_frequencies(
    harmonic, found, monkeypatch
):
    monkeypatch.setattr("nldyn.search.extend.steps_between", lambda low, high, spacing: 0)
    branch = continue_branch(harmonic.branches[0].at(8.9)[0], (7.4, 9.0))
    done = by_detour(Diagram((branch,), (7.4, 9.0), "tip"), HALF, max_period=1)
    assert ", 0 of 0 orbits carried back, " in done.notes[-1]
    (isola,) = done.branches[1:]
    assert isola.closed
    assert all(found.branches[1].contains(orbit) for orbit in isola.points)


def test_another_natural_frequency_leads_to_the_isola_and_to_a_branch_from_lower_frequencies(
    three, found
):
    """The other branch ends at the range's end, and does not join at less damping."""
    assert three.notes[-1].startswith("at 1.05 of natural_frequency_hz[1]: ")
    isola, lower = sorted(three.branches[1:], key=lambda branch: branch.closed, reverse=True)
    assert all(found.branches[1].contains(orbit) for orbit in isola.points)
    assert not lower.closed
    assert lower.frequency_hz.min() == pytest.approx(7.2)
    assert not any(b.contains(o) for b in found.branches for o in lower.points)
    for orbit in lower.at(7.5):
        assert runge_kutta_gap(orbit, two_modes()) < 1e-8


def test_what_is_known_is_not_found_again(found):
    again = by_detour(found, {"damping": 0.8}, max_period=1, spacing=0.2)
    assert len(again.branches) == 2
    assert again.notes[:-2] == (found.notes[-1],)  # the indices are told of once


def met_from_others(done: Diagram) -> tuple[int, int]:
    """How many branches of how many the note of a detour says that it met by way of others."""
    met, given = re.search(r" (\d+) of the (\d+) given met from others", done.notes[-1]).groups()
    return int(met), int(given)


@pytest.mark.parametrize(
    ("damping", "met"), [(0.5, 2), pytest.param(0.95, 0, marks=pytest.mark.slow)]
)
def test_known_branches_are_met_from_others_where_they_join_there(found, damping, met):
    """With half the damping both are one branch; with nearly all of it the isola is closed."""
    done = by_detour(found, {"damping": damping}, max_period=1, spacing=0.1)
    assert met_from_others(done) == (met, 2)


@pytest.mark.slow
def test_as_many_are_met_from_others_as_are_found_with_each_left_out(three):
    """Orbits of the grid come back to two of them only, folds to the third as well."""
    found_again = 0
    for branch in three.branches:
        others = replace(three, branches=tuple(b for b in three.branches if b is not branch))
        done = by_detour(others, {SECOND: 1.05}, max_period=1, spacing=0.5)
        middle = branch.points[len(branch.points) // 2]
        found_again += any(new.contains(middle) for new in done.branches[2:])
    done = by_detour(three, {SECOND: 1.05}, max_period=1, spacing=0.5)
    assert met_from_others(done) == (found_again, 3) == (3, 3)


def test_branches_of_longer_periods_than_wanted_do_not_count_as_given():
    system = System.from_modal(
        [13.1], {"middle": [0.635]}, modal_damping=0.0142,
        stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip
    range_hz = (50.0, 51.0)
    harmonic = continue_branch(solve_orbit(system, 50.5), range_hz)
    halves = [continue_branch(orbit, range_hz) for orbit in find_orbits(system, 50.5, 2)]
    known = Diagram((harmonic, *halves), range_hz, "middle")
    assert halves
    done = by_detour(known, {"damping": 0.9}, max_period=1, spacing=0.5)
    assert met_from_others(done) == (0, 1)


def test_interrupted_it_goes_on_with_what_it_has_found(harmonic, found, tmp_path):
    place, seen = tmp_path / "found.h5", []

    def interrupt(what: str, frequency_hz: float, done: float) -> None:
        seen.append(what)
        if seen.count("back") in (3, 4):
            raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            by_detour(
                harmonic,
                HALF,
                max_period=1,
                spacing=0.1,
                progress=interrupt,
                checkpoint=CheckpointFile(place),
            )
        assert len(load_branches(place)) == 1  # what is known is not kept
    resumed = by_detour(harmonic, HALF, max_period=1, spacing=0.1, checkpoint=CheckpointFile(place))
    assert [len(b.nodes) for b in resumed.branches] == [len(b.nodes) for b in found.branches]
    assert np.array_equal(resumed.branches[1].frequency_hz, found.branches[1].frequency_hz)
    assert met_from_others(resumed) == met_from_others(found) == (0, 1)


@pytest.fixture
def all_repeated(monkeypatch):
    """Every branch that is followed in the system itself turns out to repeat a known one.

    Those of folds are left out: each would be followed anew.
    """
    monkeypatch.setattr("nldyn.search.homotopy._folds_carried_back", lambda *_: "no folds")
    repeats = Collector._repeats
    monkeypatch.setattr(
        Collector, "_repeats", lambda box, b: box.checkpoint._write is not None or repeats(box, b)
    )


def test_a_branch_that_repeats_a_known_one_is_not_kept(
    harmonic, all_repeated, monkeypatch, tmp_path
):
    monkeypatch.setattr("nldyn.runtime.keeper.PAUSE", 1e9)  # written at the end only
    place = tmp_path / "found.h5"
    done = by_detour(harmonic, HALF, max_period=1, spacing=0.4, checkpoint=CheckpointFile(place))
    assert not re.search(r" 0 of \d+ orbits carried back", done.notes[-1])
    assert len(done.branches) == 1
    assert not place.exists()


@pytest.mark.slow
def test_a_branch_that_repeats_a_known_one_does_not_stay_in_the_file(
    harmonic, all_repeated, monkeypatch, tmp_path
):
    monkeypatch.setattr("nldyn.runtime.keeper.PAUSE", 0.0)
    monkeypatch.setattr("nldyn.runtime.keeper.SHARE", 0.0)
    place = tmp_path / "found.h5"
    by_detour(harmonic, HALF, max_period=1, spacing=0.3, checkpoint=CheckpointFile(place))
    assert load_branches(place) == []


def test_a_branch_of_the_file_that_turns_out_to_be_known_is_not_added(
    harmonic, found, all_repeated, tmp_path
):
    place = tmp_path / "found.h5"
    save_branches(place, found.branches[1:])
    done = by_detour(
        harmonic, {"damping": 0.95}, max_period=1, spacing=0.5, checkpoint=CheckpointFile(place)
    )
    assert len(done.branches) == 1


@pytest.mark.parametrize("at", ["test", "work"])
def test_no_branch_of_a_file_is_lost_to_an_interrupt(at):
    kept: list[str] = []
    given = ["known", "tested", "later"]

    def write(branches):
        kept[:] = branches

    held: list[str] = []
    checkpoint = Checkpoint(lambda some: write([*held, *some]), earlier=given, held=held)

    def is_known(branch: str) -> bool:
        if branch == "tested" and at == "test":
            raise KeyboardInterrupt
        return branch == "known"

    with pytest.raises(KeyboardInterrupt), checkpoint:
        for _ in checkpoint.new_branches(is_known):
            raise KeyboardInterrupt
    checkpoint.write()
    assert sorted(kept) == sorted(given)


def test_some_orbits_are_carried_back_however_wide_the_spacing(found):
    short = replace(found, range_hz=(7.95, 8.05))
    done = by_detour(short, HALF, max_period=1, spacing=0.5)
    tried = re.search(r" of (\d+) orbits carried back", done.notes[-1])
    assert int(tried[1]) > 0


def test_what_a_file_holds_stays_there_also_with_another_factor(harmonic, found, tmp_path):
    place = tmp_path / "known.h5"
    save_branches(place, harmonic.branches)
    by_detour(harmonic, HALF, max_period=1, spacing=0.1, checkpoint=CheckpointFile(place))
    another = {"damping": 0.95}
    again = by_detour(
        harmonic, another, max_period=1, spacing=0.5, checkpoint=CheckpointFile(place)
    )
    for branches in (again.branches, load_branches(place)):
        assert [len(b.nodes) for b in branches] == [len(b.nodes) for b in found.branches]
        assert np.array_equal(branches[1].frequency_hz, found.branches[1].frequency_hz)
    save(found, place)
    with pytest.raises(SystemModelError, match="holds a diagram or exploration"):
        by_detour(harmonic, HALF, max_period=1, spacing=0.1, checkpoint=CheckpointFile(place))
    assert len(load_diagram(place).branches) == 2


@pytest.mark.slow
def test_a_branch_of_a_wider_range_and_one_without_its_course_may_be_known(harmonic, tmp_path):
    whole = harmonic.branches[0]
    low, high = 7.3, 10.9
    inside = [i for i, point in enumerate(whole.nodes) if low < point.orbit.frequency_hz < high]
    stripped = replace(whole, nodes=whole.nodes[inside[0] : inside[-1] + 1], course=None)
    for branch in (whole, stripped):
        known = Diagram((branch,), [low, high], "tip")
        place = tmp_path / "found.h5"
        for _ in range(2):
            done = by_detour(
                known, HALF, max_period=1, spacing=0.1, checkpoint=CheckpointFile(place)
            )
            assert len(done.branches) == 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"factors": 0.5}, 'factors must be a mapping such as {"damping": 0.5}, got 0.5'),
        ({"factors": {}}, "factors must be a mapping"),
        ({"factors": {"damping": 1.0}}, "that of the damping must .* other than 1, got 1"),
        ({"factors": {"damping": 0.0}}, "must be a number from 0.001 to 1000 .* got 0"),
        ({"factors": {"damping": float("nan")}}, "that of the damping must be a number"),
        ({"factors": {"excitation": -2.0}}, "that of the excitation must be a number"),
        ({"factors": {SECOND: "half"}}, r"that of natural_frequency_hz\[1\] must be a number"),
        ({"factors": {"gap": 0.5}}, r"factors: gap\[0\] is zero, which no factor changes"),
        ({"factors": {"frequency_hz": 0.5}}, "carried at their own frequency_hz"),
        ({"factors": {Parameter("frequency_hz", 1): 0.5}}, "carried at their own frequency_hz"),
        ({"factors": {"exponent": 0.5}}, r"exponent\[0\] cannot be 0.5 times as large: .*must lie"),
        ({"factors": {"nonsense": 0.5}}, "'nonsense' is none of damping, excitation, gap, "),
        ({"factors": {Parameter("damping"): 0.5}}, "factors: 'damping' has no index"),
        ({"factors": {1: 0.5}}, "factors: 1 is none of damping, excitation, "),
        ({"factors": {Parameter("stiffness", 1): 0.5}}, "there is no stop 1"),
        ({"factors": {"stiffness": 2.0, Parameter("stiffness"): 0.5}}, "is named twice"),
        (
            {"factors": {Parameter("modal_damping"): 2.0, Parameter("modal_damping", -1): 2.0}},
            "different ratios",
        ),
        ({"spacing": 0.0}, "spacing must be at least 1e-06 and less than 1, got 0"),
        ({"max_period": 0}, "max_period must be"),
        ({"known": Diagram((), RANGE_HZ, "tip")}, "known: has no branches to begin with"),
        ({"known": Diagram((1,), RANGE_HZ, "tip")}, "known: branches must be a list of branches"),
    ],
)
def test_bad_input_is_refused(harmonic, change, message):
    with pytest.raises(SystemModelError, match=message):
        by_detour(**{"known": harmonic, "factors": HALF, **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"observe": "nose"}, "nose"),
        ({"notes": None}, "notes must be"),
        ({"range_hz": (9.0, 8.0)}, "range_hz must be two positive frequencies"),
        ({"range_hz": (7.0, 11.0)}, "was followed from 7.2 to 11 Hz, not over the range"),
    ],
)
def test_a_diagram_that_makes_no_sense_is_refused(harmonic, change, message):
    with pytest.raises(SystemModelError, match=message):
        by_detour(replace(harmonic, **change), HALF)


def test_branches_of_two_systems_are_refused(harmonic):
    other = continue_branch(solve_orbit(two_modes(0.02), 10.99), (10.9, 11.0))
    known = replace(harmonic, branches=(*harmonic.branches, replace(other, name="of another")))
    with pytest.raises(SystemModelError, match="branch 'of another' is of another system"):
        by_detour(known, HALF)


def known_of(system: System) -> Diagram:
    """The harmonic branch of a system, in a short range."""
    branch = continue_branch(solve_orbit(system, 10.99), (10.9, 11.0))
    return Diagram((branch,), (10.9, 11.0), "tip")


def test_a_system_without_damping_has_no_factor_of_it_and_no_sum_of_indices():
    known = known_of(replace(two_modes(), damping=np.zeros((2, 2))))
    with pytest.raises(SystemModelError, match="the damping is zero"):
        by_detour(known, HALF)
    done = by_detour(known, {"excitation": 1.1}, max_period=1, spacing=0.5)
    assert not any("indices" in note for note in done.notes)


def test_damping_is_that_of_dampers_too():
    dampers = (Damper("tip", 2.0),)
    known = known_of(replace(two_modes(), damping=np.zeros((2, 2)), dampers=dampers))
    done = by_detour(known, HALF, max_period=1, spacing=0.5)
    assert done.notes[-1].startswith("at 0.5 of the damping: 1 branch, ")


def test_it_says_so_where_no_orbit_gets_there(harmonic):
    done = by_detour(harmonic, {"excitation": 0.001}, max_period=1, spacing=0.5)
    assert done.notes[-1] == (
        "at 0.001 of the excitation: no orbit got there, as some may with factors nearer to 1, "
        "0 branches beside those given"
    )


@pytest.mark.filterwarnings("error")
def test_the_rest_of_a_system_without_excitation_is_carried_there_and_back():
    known = known_of(two_modes().with_elements(excitation=()))
    done = by_detour(known, HALF, max_period=1, spacing=0.5)
    assert "1 branch, 1 of 1 orbits carried back" in done.notes[-1]
    assert len(done.branches) == 1


def test_a_system_without_excitation_has_no_factor_of_it():
    known = known_of(two_modes().with_elements(excitation=()))
    with pytest.raises(SystemModelError, match="the excitation is zero"):
        by_detour(known, {"damping": 0.5, "excitation": 1.1})
