"""What `explore` finds without guesses: coexisting branches, isolas, and what it admits to miss."""

import math
from dataclasses import replace
from functools import partial
from itertools import combinations

import h5py
import numpy as np
import pytest
from branches_alike import assert_same_branches
from problems import THREE_HZ, between_stops

from nldyn import (
    ContinuationOptions,
    ExploreOptions,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    SpecialPoint,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    describe_special,
    diagram,
    explore,
    find_orbits,
    index_sum,
    save,
    solve_orbit,
)
from nldyn.base.errors import LocateError
from nldyn.base.resources import example
from nldyn.bifurcations.normal_forms import switch_at_branch_point
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.branches import at_frequency as crossings
from nldyn.io import CheckpointFile
from nldyn.io.branches import load_branches, load_diagram, load_exploration
from nldyn.orbits.axis import Axis
from nldyn.orbits.deflation import deflated_orbit
from nldyn.orbits.orbit import stroboscopic
from nldyn.orbits.starts import random_states, settling_periods
from nldyn.runtime import keeper
from nldyn.runtime.progress import silent
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene
from nldyn.search import explore as survey
from nldyn.search.collector import Collector, middle_orbit
from nldyn.search.exploration import chao_lower_bound

NOTHING_MORE = {"pseudo_orbits": 0, "mixtures": 0, "walks": 0}  # beside motions and deflation


def system_of(name):
    return build_system(load_scene(example(f"{name}.toml")))


@pytest.fixture(scope="module")
def around_37():
    """The 1-DOF model where section 3 of the paper has a 1/3 branch that nothing leads to."""
    return explore(system_of("one_dof"), (36.8, 37.4), 4, effort=ExploreOptions(spacing=0.01))


def test_isolated_third_subharmonic_is_found_unaided(around_37):
    """Its peak lies near 37.1 Hz (section 3 of the paper)."""
    thirds = around_37.diagram.of_period(3)
    assert any(36.9 < branch.frequency_hz.max() < 37.3 for branch in thirds)


@pytest.mark.parametrize(
    ("near", "period"),
    [
        (58.0, 7),
        pytest.param(62.2, 5, marks=pytest.mark.slow),
        pytest.param(83.0, 10, marks=pytest.mark.slow),
    ],
)
def test_listed_subharmonics_are_found_unaided(near, period):
    """Orders and places of section 3 of the paper; the peaks are stable over 0.1 Hz or less."""
    found = explore(
        system_of("one_dof"),
        (near - 0.1, near + 0.1),
        period,
        effort=ExploreOptions(spacing=0.0005, unstable_period=0),
    )
    assert found.diagram.of_period(period)


def test_both_harmonic_branches_of_two_modes_are_found():
    """Section 4 of the paper: two separate harmonic branches near 23 Hz, three orbits there."""
    effort = ExploreOptions(spacing=0.02)
    found = explore(system_of("two_dof_xi_0.01"), (22.5, 23.5), 1, effort=effort)
    assert sum(len(branch.at(23.0)) for branch in found.diagram.of_period(1)) >= 3
    assert len(found.diagram.of_period(1)) >= 2


def test_no_branch_is_found_twice(around_37):
    for a, b in combinations(around_37.diagram.branches, 2):
        if a.period == b.period:
            assert not any(b.contains(orbit) for orbit in a.points[1:-1:20])


def test_every_simulation_is_accounted_for(around_37):
    """Twelve random starts at each frequency, and those carried over from the one before."""
    frequencies = np.array([c.value for c in around_37.coverage])
    assert (frequencies[1:] / frequencies[:-1]).max() <= 1.01 * (1 + 1e-12)
    for c in around_37.coverage:
        assert c.settled + c.unsettled + c.failed >= 12
        assert all(period <= 4 for period in c.periods)
        assert bool(c.periods) == (c.settled > 0)


@pytest.mark.parametrize("found_by", [3, None])
def test_a_frequency_is_searched_until_the_indices_of_its_orbits_add_up(
    three, found_by, monkeypatch
):
    """The harmonic is given; the other branches are found by the third search, or never."""
    searched, search = [], survey._Survey._search

    def given_in_the_end(self, starts, known, **others):
        searched.append(known.here.value)
        if len(searched) == found_by:
            self.box.from_orbits(map(middle_orbit, three.branches))
            known.take()
        return search(self, starts[:0], known, **others)

    monkeypatch.setattr(survey._Survey, "_search", given_in_the_end)
    known = replace(three, branches=tuple(three.of_period(1)))
    effort = ExploreOptions(spacing=0.02, starts=1, **NOTHING_MORE)
    flow = three.branches[0].points[0].problem.flow
    found = explore(flow, THREE_HZ, 3, effort=effort, known=known)
    counts = [searched.count(c.value) for c in found.coverage]
    branches, report = found.diagram.branches, found.report()
    sums = {index_sum(branches, hz, n) for hz in (36.2, 36.8) for n in (1, 2, 3)}
    if found_by is None:
        assert counts == [2 + survey.AGAIN] * len(counts)
        assert sums != {1} and "orbits are missing" in report
    else:
        assert counts == [found_by + 1] + [2] * (len(counts) - 1)  # on the way up and down
        assert sums == {1}
        assert "P to P^3 add up to one from 36 to 38.5 Hz; isolas that are missing" in report


@pytest.mark.parametrize(
    ("given", "left_out", "guesses", "said"),
    [
        ((1, 2), 3, {"pseudo_orbits": 50}, "up to 50 pseudo-orbits of each length up to 3 orbits"),
        ((1, 3), 2, {"mixtures": 50}, "beside 50 mixtures of each length up to 3 orbits"),
        ((1,), 3, {"walks": 50}, "beside up to 50 closed walks of each length up to 3 orbits"),
    ],
)
def test_further_guesses_on_the_way_down_lead_to_further_branches(
    three, given, left_out, guesses, said, monkeypatch
):
    """Some branches are given, and no motion is followed; those left out meet none of them."""
    monkeypatch.setattr(survey._Survey, "_motion", lambda *_: (None, None))
    monkeypatch.setattr(survey, "AGAIN", 0)
    known = replace(three, branches=tuple(b for b in three.branches if b.period in given))
    few = ExploreOptions(spacing=0.02, starts=1, walk_states=1000, **NOTHING_MORE)
    without, found = (
        explore(three.branches[0].points[0].problem.flow, THREE_HZ, 3, known=known, effort=effort)
        for effort in (few, replace(few, **guesses))
    )
    assert without.diagram.branches == known.branches
    assert found.diagram.branches[: len(known.branches)] == known.branches
    (wanted,), (more,) = three.of_period(left_out), found.diagram.of_period(left_out)
    assert all(wanted.contains(orbit) for orbit in more.points)
    assert said in found.report()
    assert " of each length" not in without.report()
    way_up = replace(found, stage=replace(found.stage, steps=1, ends=()))
    assert "not finished: 1 of " in way_up.report()
    assert " of each length" not in way_up.report()


def test_report_tells_what_was_tried(around_37):
    text = around_37.report()
    assert f"simulations at {len(around_37.coverage)} frequencies" in text
    assert "harmonic" in text and "1/3" in text
    assert "may be missing all the same: isolas that no motion came near" in text
    assert "unstable orbits of periods above 3 were not looked for" in text


@pytest.mark.slow
def test_repeated_exploration_gives_the_same_branches():
    effort = ExploreOptions(spacing=0.02, starts=3)
    first, second = (explore(system_of("one_dof"), (49.0, 51.0), 2, effort=effort) for _ in "ab")
    for a, b in zip(first.diagram.branches, second.diagram.branches, strict=True):
        np.testing.assert_array_equal(a.frequency_hz, b.frequency_hz)


def test_linear_system_has_one_branch_on_which_everything_settles():
    system = System.from_modal(
        [10.0], {"tip": [1.0]}, modal_damping=0.05, excitation=[Unbalance("tip", 1e-5)]
    )
    found = explore(system, (8.0, 14.0), 2, effort=ExploreOptions(spacing=0.2))
    assert [branch.period for branch in found.diagram.branches] == [1]
    assert found.settled_share == 1.0
    assert found.unsettled_ranges() == []
    assert found.report().startswith("8 to 14 Hz: 1 branch (1 harmonic)\n")
    assert repr(found).startswith("<Exploration of 8 to 14 Hz: 1 branch, 100.0 % ")


def test_unstable_orbits_are_found_beside_motions(monkeypatch):
    """At 50 Hz motions settle on the 1/2 orbit; the harmonic one is unstable there."""
    monkeypatch.setattr(survey._Survey, "_deflate", lambda *_: None)
    effort = ExploreOptions(spacing=0.02, starts=2, **NOTHING_MORE)
    found = explore(system_of("one_dof"), (49.5, 50.5), 1, effort=effort)
    (harmonic,) = found.diagram.of_period(1)
    assert not harmonic.stable.any()


def test_deflation_leaves_a_known_orbit_for_another_one():
    """Two modes at 23 Hz have several harmonic orbits; with one known, Newton finds others."""
    flow = FlowMap(system_of("two_dof_xi_0.01"))
    first = solve_orbit(flow, 23.0)
    state = stroboscopic(first)[0]
    starts = random_states(flow, first.omega, 8, seed=1)
    found = [deflated_orbit(flow, start, 1, first.omega, [first], "middle") for start in starts]
    others = [orbit for orbit in found if orbit is not None]
    assert others
    for other in others:
        assert other.error < 1e-9
        assert np.abs(stroboscopic(other)[0] - state).max() > 1e-3 * np.abs(state).max()


def test_deflation_finds_nothing_where_there_is_one_orbit():
    system = System.from_modal(
        [10.0], {"tip": [1.0]}, modal_damping=0.05, excitation=[Unbalance("tip", 1e-5)]
    )
    orbit = solve_orbit(system, 12.0)
    start = 1.5 * stroboscopic(orbit)[0]
    assert deflated_orbit(orbit.problem.flow, start, 1, orbit.omega, [orbit], "tip") is None


def test_settling_time_follows_the_slowest_decay():
    """ζω = 0.01 · 2π · 10 /s: e^-4 after 6.37 s, at 20 Hz that is 128 periods."""
    system = System.from_modal([10.0, 50.0], {"tip": [1.0, 1.0]}, modal_damping=0.01)
    assert settling_periods(system, 20.0) == 128
    free = System.from_modal([0.0], {"tip": [1.0]}, modal_damping=0.0, stops=[Stop("tip", 1e9)])
    assert settling_periods(free, 20.0) == 600


def lightly_damped(ratio=1e-4):
    return System.from_modal(
        [10.0], {"tip": [1.0]}, modal_damping=ratio, excitation=[HarmonicForce("tip", 1.0)]
    )


def test_lightly_damped_motions_have_time_to_settle():
    """ζω = 1e-4 · 2π · 10 /s: e^-4 takes 12 732 periods at 20 Hz, 600 leave 83 % of the motion."""
    effort = ExploreOptions(spacing=0.1, starts=3)
    found = explore(lightly_damped(), (19.0, 21.0), 2, effort=effort)
    assert settling_periods(lightly_damped(), 20.0) == 12733
    assert found.settled_share == 1.0
    assert "settling was cut" not in found.report()


def test_report_says_where_settling_is_cut():
    effort = ExploreOptions(spacing=0.1, starts=3, settling=600)
    found = explore(lightly_damped(), (19.0, 21.0), 2, effort=effort)
    longest = settling_periods(lightly_damped(), 21.0)
    assert found.settled_share < 1.0
    assert (
        f"settling was cut at 600 periods from 19 to 21 Hz; the slowest motion takes up to "
        f"{longest} there" in found.report()
    )


# --- rounds --------------------------------------------------------------------------------------


def test_a_round_without_news_is_the_last():
    """A linear system has one branch, which each motion comes to in both rounds."""
    system = System.from_modal(
        [10.0], {"tip": [1.0]}, modal_damping=0.05, excitation=[Unbalance("tip", 1e-5)]
    )
    effort = ExploreOptions(spacing=0.2, starts=2, rounds=9)
    found = explore(system, (8.0, 14.0), 2, effort=effort)
    assert found.finished and found.new_branches == (1, 0)
    assert found.meetings == (2,) and found.unmet_branches == 0.0
    assert "branches up to period 2 that the rounds added: 1, 0" in found.report()


def test_a_round_at_work_does_not_count_in_the_estimate(whole):
    begun = np.vstack([whole.stage.met, np.ones((1, whole.stage.branches), dtype=bool)])
    going_on = replace(whole, stage=replace(whole.stage, met=begun))
    assert going_on.meetings == whole.meetings
    assert going_on.unmet_branches == whole.unmet_branches < np.inf


def test_a_frequency_is_searched_again_from_random_states_only(monkeypatch):
    """Of one state each time none is rest, from which the first search has begun."""
    tried, search = [], survey._Survey._search

    def noted(self, starts, known, **others):
        tried.append(starts)
        return search(self, starts, known, **others)

    monkeypatch.setattr(survey._Survey, "_search", noted)
    monkeypatch.setattr(survey, "AGAIN", 3)
    monkeypatch.setattr(survey._Known, "incomplete", lambda *_: True)
    effort = ExploreOptions(spacing=0.5, starts=1, settling=30)
    explore(system_of("one_dof"), (36.0, 38.0), 1, effort=effort)
    first, *again = tried[:4]
    assert not first.any()
    states = [start for starts in again for start in starts]
    assert len(states) == 3 and all(state.any() for state in states)
    assert len({state.tobytes() for state in states}) == 3


@pytest.mark.slow
def test_a_finished_exploration_goes_on_with_more_rounds(whole, tmp_path):
    path = tmp_path / "found.h5"
    for rounds in (1, 2):
        effort = replace(EFFORT, rounds=rounds)
        found = explore(
            system_of("one_dof"), **QUESTION, effort=effort, checkpoint=CheckpointFile(path)
        )
    assert_same_exploration(found, whole)


def test_chao_bound_is_what_is_missing_where_all_are_met_alike():
    """Of n kinds met with probability p a round, n(1-p)^r are missing after r rounds."""
    n, r, p = 10**6, 5, 0.25
    expected = [round(n * math.comb(r, k) * p**k * (1 - p) ** (r - k)) for k in range(r + 1)]
    counts = [k for k in range(1, r + 1) for _ in range(expected[k])]
    assert chao_lower_bound(counts, r) == pytest.approx(expected[0], rel=1e-4)
    assert str(chao_lower_bound([2, 2], 2)) == "0.0"  # not -0.0


def test_chao_bound_is_low_where_some_are_met_rarely():
    """Half of the kinds four times rarer than the others: more are missing than it says."""
    n, r = 10**6, 5
    expected = [
        sum(round(n / 2 * math.comb(r, k) * p**k * (1 - p) ** (r - k)) for p in (0.1, 0.4))
        for k in range(r + 1)
    ]
    counts = [k for k in range(1, r + 1) for _ in range(expected[k])]
    assert chao_lower_bound(counts, r) < expected[0]  # by Cauchy and Schwarz's inequality
    assert math.isnan(chao_lower_bound([1, 1], 1))


# --- the way up and down, interruption and files -------------------------------------------------

QUESTION = {"limits": (36.0, 38.0), "max_period": 3}
EFFORT = ExploreOptions(
    spacing=0.02, starts=4, rounds=2, doubled_period=4,
    pseudo_orbits=2, mixtures=3, walks=3, walk_states=100,
)  # fmt: skip


@pytest.fixture(scope="module")
def whole():
    return explore(system_of("one_dof"), **QUESTION, effort=EFFORT)


def stopped_at(step, orbits=0):
    """Progress that stops as Ctrl-C does, some orbits after a step has begun."""
    steps, seen = 0, 0

    def report(what, hz, done):
        nonlocal steps, seen
        steps += what == "explore"
        seen += steps >= step
        if seen > orbits:
            raise KeyboardInterrupt

    return report


def interrupt(path, *place):
    with pytest.raises(KeyboardInterrupt):
        explore(
            system_of("one_dof"),
            **QUESTION,
            effort=EFFORT,
            progress=stopped_at(*place),
            checkpoint=CheckpointFile(path),
        )


def assert_same_exploration(some, other):
    assert (some.coverage, some.finished) == (other.coverage, other.finished)
    assert (some.new_branches, some.meetings) == (other.new_branches, other.meetings)
    assert some.diagram.notes == other.diagram.notes
    assert [b.name for b in some.diagram.branches] == [b.name for b in other.diagram.branches]
    for a, b in zip(some.diagram.branches, other.diagram.branches, strict=True):
        assert_same_branches(a, b)


def test_motions_are_carried_up_and_down(whole):
    """At each frequency four random states, and what came before on the way up and down."""
    counts = [c.settled + c.unsettled + c.failed for c in whole.coverage]
    assert min(counts) >= 5
    assert len(counts) == 4 + 3 and whole.stage.steps == 2 * len(counts)


def test_each_round_lies_between_those_before(whole):
    """Halves, then quarters of the first round's steps, on a logarithmic axis."""
    steps = np.log([whole.question.values(turn) for turn in range(1, 4)])
    first = np.log(whole.question.values(0))
    shares = (steps - first[:-1]) / np.diff(first)
    np.testing.assert_allclose(shares, np.repeat([[0.5], [0.25], [0.75]], 3, axis=1), rtol=1e-9)


@pytest.mark.parametrize(
    "places",
    [
        pytest.param([(1,)], marks=pytest.mark.slow),
        pytest.param([(1, 40)], marks=pytest.mark.slow),
        pytest.param([(11,)], marks=pytest.mark.slow),
        [(1, 60), (1, 90), (4, 2), (6, 3)],
    ],
)
def test_an_interrupted_exploration_goes_on_to_the_last_digit(whole, tmp_path, places):
    """Stopped before anything is found, on a branch, in the second round, and several times."""
    path = tmp_path / "found.h5"
    for place in places:
        interrupt(path, *place)
        if path.exists():
            part = load_exploration(path)
            assert not part.finished and "not finished" in part.report()
            assert len(part.diagram.branches) == len(load_branches(path)) > 0
            assert part.stage.steps >= place[0] - 1
            assert len(part.coverage) <= min(part.stage.steps, len(whole.coverage))
    steps = []
    again = explore(
        system_of("one_dof"),
        **QUESTION,
        effort=EFFORT,
        progress=lambda what, hz, done: steps.extend([hz] if what == "explore" else []),
        checkpoint=CheckpointFile(path),
    )
    assert_same_exploration(again, whole)
    assert_same_exploration(load_exploration(path), whole)
    assert len(steps) == whole.stage.steps - part.stage.steps


# --- with branches that are known ----------------------------------------------------------------


@pytest.fixture(scope="module")
def harmonic():
    """The harmonic branch alone."""
    return diagram(system_of("one_dof"), (36.0, 38.0), (1,))


def test_known_branches_are_taken_over_and_others_found(whole, harmonic):
    found = explore(system_of("one_dof"), **QUESTION, effort=EFFORT, known=harmonic)
    assert found.diagram.branches[0] is harmonic.branches[0]
    assert sum(found.new_branches) == sum(whole.new_branches) - 1
    assert [b.period for b in found.diagram.branches].count(1) == 1
    for branch in whole.diagram.branches:
        middle = branch.points[len(branch.points) // 2]
        assert sum(other.contains(middle) for other in found.diagram.branches) == 1


def test_what_known_branches_lead_to_is_followed(monkeypatch):
    """The harmonic branch of the 1-DOF model flips at 10.434 Hz; no motion is simulated."""
    monkeypatch.setattr(survey._Survey, "_motion", lambda *_: (None, None))
    system, effort = system_of("one_dof"), ExploreOptions(spacing=0.1, unstable_period=0)
    known = diagram(system, (10.3, 10.6), (1,))
    found = explore(system, (10.3, 10.6), 2, effort=effort, known=known).diagram
    (flip,) = [s for branch in known.branches for s in branch.special_points if s.kind == "PD"]
    assert flip.frequency_hz == pytest.approx(10.434049887, abs=1e-8)
    assert len(found.of_period(2)) == 1
    ends = found.of_period(2)[0].frequency_hz[[0, -1]]
    assert np.abs(ends - flip.frequency_hz).min() < 1e-6


def test_an_exploration_beside_known_branches_is_another_one_than_without(harmonic, tmp_path):
    path = tmp_path / "found.h5"
    ask = partial(explore, system_of("one_dof"), **QUESTION, effort=EFFORT, known=harmonic)
    with pytest.raises(KeyboardInterrupt):
        ask(progress=stopped_at(2), checkpoint=CheckpointFile(path))
    assert load_exploration(path).stage.given == 1
    with pytest.raises(SystemModelError, match=r"holds another .* or known branches"):
        explore(system_of("one_dof"), **QUESTION, effort=EFFORT, checkpoint=CheckpointFile(path))
    with pytest.raises(SystemModelError, match=r"holds another .* or known branches"):
        ask(known=replace(harmonic, notes=("some note",)), checkpoint=CheckpointFile(path))


@pytest.mark.slow
@pytest.mark.parametrize("place", [(1, 30), (3,)])
def test_exploration_beside_known_branches_goes_on_to_the_last_digit(harmonic, tmp_path, place):
    path = tmp_path / "found.h5"
    ask = partial(explore, system_of("one_dof"), **QUESTION, effort=EFFORT, known=harmonic)
    with pytest.raises(KeyboardInterrupt):
        ask(progress=stopped_at(*place), checkpoint=CheckpointFile(path))
    assert_same_exploration(ask(checkpoint=CheckpointFile(path)), ask())


def test_known_branches_of_something_else_are_refused(harmonic):
    with pytest.raises(SystemModelError, match="known: is of 36 to 38 Hz, but 36 to 39 Hz"):
        explore(system_of("one_dof"), (36.0, 39.0), 3, known=harmonic)
    finer = FlowMap(system_of("one_dof"), FlowOptions(rtol=1e-12))
    with pytest.raises(SystemModelError, match="known: branch '01 harmonic' is of another system"):
        explore(finer, **QUESTION, known=harmonic)
    with pytest.raises(SystemModelError, match="known must be"):
        explore(system_of("one_dof"), **QUESTION, known=harmonic.branches)
    short = continue_branch(solve_orbit(system_of("one_dof"), 37.0), (36.5, 37.5))
    for change, message in (
        ({"branches": (1,)}, "known: branches must be a list of branches"),
        ({"notes": None}, "known: notes must be"),
        ({"observe": "nose"}, "nose"),
        ({"branches": (short,)}, "followed from 36.5 to 37.5 Hz, not over the range"),
    ):
        with pytest.raises(SystemModelError, match=message):
            explore(system_of("one_dof"), **QUESTION, known=replace(harmonic, **change))


def test_coverage_is_kept_where_no_branch_is_found(tmp_path, monkeypatch):
    """Undamped free flight between impacts settles on nothing."""
    monkeypatch.setattr(keeper, "PAUSE", 0.0)
    system = System.from_modal(
        [10.0], {"tip": [1.0]}, stops=[Stop("tip", 1e9, gap=1e-3)],
        excitation=[HarmonicForce("tip", 1.0)],
    )  # fmt: skip
    path = tmp_path / "found.h5"
    effort = ExploreOptions(spacing=0.02, starts=2, settling=30, unstable_period=0)
    found = explore(system, (20.0, 21.0), 1, effort=effort, checkpoint=CheckpointFile(path))
    kept = load_exploration(path)
    assert kept.coverage == found.coverage and not kept.diagram.branches
    assert sum(c.unsettled + c.failed for c in kept.coverage) > 0


def test_a_saved_exploration_is_read_with_its_coverage(whole, tmp_path):
    path = tmp_path / "found.h5"
    save(whole, path)
    loaded = load_exploration(path)
    assert_same_exploration(loaded, whole)
    assert loaded.report() == whole.report()
    assert loaded.question.same(whole.question)
    assert len(load_diagram(path).branches) == len(whole.diagram.branches)


def test_what_a_file_does_not_tell_of_was_not_done(whole, tmp_path):
    """One of a version that made no further guesses goes on without them."""
    path = tmp_path / "found.h5"
    save(whole, path)
    with h5py.File(path, "r+") as file:
        efforts = [
            (group, name)
            for group in [file, *(file[key] for key in file if isinstance(file[key], h5py.Group))]
            for name in (f"effort {key}" for key in (*NOTHING_MORE, "walk_states"))
            if name in group.attrs
        ]
        for group, name in efforts:
            del group.attrs[name]
    assert len(efforts) == 4
    without = replace(EFFORT, **NOTHING_MORE, walk_states=ExploreOptions.walk_states)
    assert load_exploration(path).question.effort == without
    explore(system_of("one_dof"), **QUESTION, effort=without, checkpoint=CheckpointFile(path))
    with pytest.raises(SystemModelError, match="holds another exploration"):
        explore(system_of("one_dof"), **QUESTION, effort=EFFORT, checkpoint=CheckpointFile(path))


def test_another_exploration_in_the_file_is_refused_and_kept(whole, tmp_path):
    path = tmp_path / "found.h5"
    save(whole, path)
    before = path.read_bytes()
    other = replace(EFFORT, seed=21)
    asked = [
        {**QUESTION, "effort": other},
        {**QUESTION, "effort": EFFORT, "limits": (36.0, 39.0)},
        {**QUESTION, "effort": EFFORT, "max_period": 4},
        {**QUESTION, "effort": EFFORT, "options": ContinuationOptions(max_step=0.04)},
    ]
    for question in asked:
        with pytest.raises(SystemModelError, match="holds another exploration"):
            explore(system_of("one_dof"), **question, checkpoint=CheckpointFile(path))
    with pytest.raises(SystemModelError, match="holds another exploration"):
        explore(
            system_of("two_dof_xi_0.01"), **QUESTION, effort=EFFORT, checkpoint=CheckpointFile(path)
        )
    assert path.read_bytes() == before


def test_a_file_without_exploration_or_with_a_damaged_one_is_refused(whole, tmp_path):
    path = tmp_path / "found.h5"
    save(whole.diagram, path)
    with pytest.raises(SystemModelError, match="holds no exploration"):
        load_exploration(path)
    save(whole, path)
    with h5py.File(path, "r+") as file:
        file["exploration"].attrs["steps"] = 3
    with pytest.raises(SystemModelError, match="'/exploration/steps' is 3 with 7 values"):
        load_exploration(path)


def test_long_doubled_branches_are_broken_off_where_told(whole):
    """Branches of periods looked for are followed to their ends, those beyond not."""
    short = explore(system_of("one_dof"), **QUESTION, effort=replace(EFFORT, doubled_points=10))
    for branch, full in zip(short.diagram.branches, whole.diagram.branches, strict=True):
        assert branch.period == full.period
        if branch.period <= 3:
            assert_same_branches(branch, full)
        else:
            assert len(branch.nodes) < len(full.nodes)
            assert any(branch.name in note and "10 points" in note for note in short.diagram.notes)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"spacing": 0.0}, "spacing must be at least 1e-06"),
        ({"spacing": float("nan")}, "spacing must be at least 1e-06"),
        ({"starts": 0}, "explore: starts"),
        ({"rounds": 0}, "explore: rounds"),
        ({"unstable_period": -1}, "explore: unstable_period"),
        ({"seed": 0.5}, "explore: seed"),
        ({"settling": 0}, "explore: settling"),
        ({"doubled_period": 0}, "explore: doubled_period"),
        ({"doubled_points": 1}, "explore: doubled_points"),
        ({"pseudo_orbits": -1}, "explore: pseudo_orbits"),
        ({"mixtures": 1.5}, "explore: mixtures"),
        ({"walks": -1}, "explore: walks"),
        ({"walk_states": 0}, "explore: walk_states"),
        ({"walk_states": 10**6, "unstable_period": 11}, "explore: walk_states must be"),
    ],
)
def test_bad_efforts_are_refused_by_name(given, says):
    with pytest.raises(SystemModelError, match=says):
        ExploreOptions(**given)


@pytest.mark.parametrize(
    ("range_hz", "period", "says"),
    [
        ((10.0, 5.0), 2, "the range of"),
        ((5.0, 10.0), 0, "max_period"),
        ((5.0, 10.0), 1.5, "max_period"),
    ],
)
def test_bad_questions_are_refused_before_any_simulation(range_hz, period, says):
    with pytest.raises(SystemModelError, match=says):
        explore(system_of("one_dof"), range_hz, period)


def test_a_doubled_branch_begins_at_its_flip():
    """What lies between the flip and the orbit from which the branch is followed belongs to it."""
    flow = FlowMap(system_of("one_dof"))
    box = Collector(flow, Axis.in_frequency((28.0, 60.0)), "middle", ContinuationOptions(), silent)
    box.from_orbits([solve_orbit(flow, 50.0)])
    flip = next(s for s in box.branches[0].special_points if s.kind == "PD")
    box.from_flip(flip)
    assert [branch.period for branch in box.branches] == [1, 2]
    assert box.branches[1].nodes[0].orbit.frequency_hz == pytest.approx(
        flip.frequency_hz, rel=1e-10
    )
    for amplitude in (1e-2, 1e-3):
        assert box.branches[1].contains(switch_at_flip(flip, amplitude).orbit)


def test_where_a_doubled_branch_comes_to_its_flip_the_other_one_has_half_the_period():
    """Followed on as a branch of the doubled period it would be the same orbits twice."""
    flow, axis = FlowMap(system_of("one_dof")), Axis.in_frequency((28.0, 60.0))
    box, other = (Collector(flow, axis, "middle", ContinuationOptions(), silent) for _ in range(2))
    box.from_orbits([solve_orbit(flow, 50.0)])
    harmonic = box.branches[0]
    box.from_flip(next(s for s in harmonic.special_points if s.kind == "PD"))
    doubled = box.branches[1]
    end = SpecialPoint("BP", doubled.nodes[0], 0.0)
    with pytest.raises(LocateError, match="is one of period 1: solve for its orbits"):
        switch_at_branch_point(end)
    assert "is one of period 1, at a flip of a branch of that period" in describe_special(end)
    box.from_branch_point(end)
    assert box.branches == [harmonic, doubled] and not box.notes
    other.take([doubled], [])
    other.from_branch_point(end, ContinuationOptions(max_points=5))
    assert [branch.period for branch in other.branches] == [2, 1]
    single = other.branches[1]
    assert single.stop_reasons == ("5 points",) * 2
    assert harmonic.contains(single.nodes[0].orbit)


def test_orbits_of_a_branch_are_known_where_newtons_method_at_their_frequency_fails(monkeypatch):
    """So near to a flip its steps end in rounding."""

    def fail(*given):
        raise LocateError("no orbit")

    flow = FlowMap(system_of("one_dof"))
    branch = continue_branch(solve_orbit(flow, 50.0), (45.0, 60.0))
    orbit = branch.at(48.7)[0]
    monkeypatch.setattr(crossings, "_held", fail)
    assert branch.contains(orbit)
    assert branch.at(48.7)[0].frequency_hz == pytest.approx(48.7, rel=1e-12)


def test_orbits_beside_the_ends_of_a_doubled_branch_are_known():
    """At the frequency of one beside a flip, Newton's method may come to the single period."""
    flow = FlowMap(system_of("two_dof_xi_0.01"))
    box = Collector(flow, Axis.in_frequency((17.9, 18.9)), "middle", ContinuationOptions(), silent)
    box.from_orbits([solve_orbit(flow, 18.4), *find_orbits(flow, 18.6, 2)])
    harmonic = box.branches[0]
    flips = [s for s in harmonic.special_points if s.kind == "PD"]
    beside = [switch_at_flip(f, amplitude=a).orbit for f in flips for a in (1e-3, 1e-4)]
    assert len(beside) == 4
    box.from_orbits(beside)
    assert len(box.branches) == 2


def test_branches_taken_back_leave_a_search_as_it_was():
    """Where they were broken off, meet flips and cross is known as in the run that found them."""
    orbit = solve_orbit(between_stops(), 11.0)
    options = ContinuationOptions(max_points=32)
    axis = Axis.in_frequency((11.0, 11.8))
    first, again = (
        Collector(orbit.problem.flow, axis, "m", options, lambda *at: None) for _ in range(2)
    )
    first.follow(orbit, 2, 2, None)
    again.take_back(first.branches, first.notes)
    assert again.branches == first.branches and again.notes == first.notes
    assert again.flip_ends == first.flip_ends != []
    assert again.crossings == first.crossings != []
    assert again.open_ends.keys() == first.open_ends.keys() != set()
    for like, rows in first.open_ends.items():
        np.testing.assert_array_equal(again.open_ends[like].so_far(), rows.so_far())


def test_mirror_image_of_a_branch_of_a_symmetric_system_is_followed_too():
    """A closed 1/3 branch between two equal stops, which is not symmetric itself."""
    orbit = solve_orbit(between_stops(), 11.26, 3, guess=[7.9058e-06, 9.9213e-05])
    axis = Axis.in_frequency((11.0, 12.0))
    box = Collector(orbit.problem.flow, axis, "m", ContinuationOptions(), lambda *at: None)
    box.follow(orbit, 3, 3, None)
    one, image = box.branches
    assert one.closed and image.closed and not one.contains(middle_orbit(image))
    folds = [
        sorted(s.frequency_hz for s in branch.special_points if s.kind == "LP")
        for branch in (one, image)
    ]
    assert len(folds[0]) == 2 and folds[0] == pytest.approx(folds[1], rel=1e-9)


def test_a_system_is_symmetric_if_each_stop_has_one_opposite_to_it():
    def system(*stops):
        return System.from_modal([13.0, 50.0], {"a": [0.6, 0.2], "b": [0.1, 0.3]}, stops=stops)

    pair = Stop("a", 1e6, gap=1e-3), Stop("a", 1e6, gap=1e-3, direction=-1)
    assert system().symmetric and system(*pair).symmetric
    assert not system(pair[0]).symmetric
    assert not system(pair[0], pair[0], pair[1]).symmetric
    assert not system(pair[0], replace(pair[1], gap=2e-3)).symmetric
    assert not system(pair[0], replace(pair[1], at="b")).symmetric
    assert system(*pair, replace(pair[0], against="b"), replace(pair[1], against="b")).symmetric
