"""Subharmonic orbits of equation 3.1, started from simulations."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from independent import Motion
from problems import make_one_dof

from nldyn import (
    ContinuationOptions,
    ConvergenceError,
    Damper,
    Diagram,
    FlowMap,
    HarmonicForce,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    diagram,
    find_orbits,
    solve_orbit,
)
from nldyn.branches.continuation import open_ends
from nldyn.orbits import OrbitSearchOptions
from nldyn.orbits.axis import Axis
from nldyn.orbits.orbit import minimal_period, same_orbit, stroboscopic
from nldyn.orbits.starts import orbit_beside, orbit_near
from nldyn.search import SubharmonicSeed
from nldyn.search.diagram import shortened

# where the paper's text sees subharmonics: 1/3 near 37.1, 1/5 near 62.2, 1/7 near 58, 1/13 near 81
PLACES = [(3, 37.1), (5, 62.2), (7, 58.0), (13, 80.19), (2, 50.6), (3, 76.0)]


@pytest.mark.parametrize(("period", "frequency"), PLACES)
def test_subharmonic_is_found_with_the_period_asked_for(one_dof, period, frequency):
    orbits = find_orbits(one_dof, frequency, period)
    assert orbits
    for orbit in orbits:
        assert orbit.period == minimal_period(orbit) == period
        assert orbit.frequency_hz == pytest.approx(frequency, rel=1e-13)
        assert orbit.liouville_error < 1e-7
    assert any(orbit.stable for orbit in orbits)
    for i, orbit in enumerate(orbits):
        assert not any(same_orbit(orbit, other) for other in orbits[:i])


def test_subharmonic_returns_under_runge_kutta_after_its_period_only(one_dof):
    orbit = next(o for o in find_orbits(one_dof, 62.2, 5) if o.stable)
    states = orbit.states(2 * np.pi * np.arange(5))
    scale = np.abs(orbit.history(500).modal).max() * np.array([1.0, orbit.omega])
    x, *_ = Motion(one_dof).run(states[0], (0.0, 10 * np.pi), orbit.omega, tangent=False)
    assert np.abs((x - states[0]) / scale).max() < 1e-7
    for other in states[1:]:
        assert np.abs((other - states[0]) / scale).max() > 1e-2


@pytest.mark.parametrize("beyond", [1e-5, 1e-4, 1e-3])
def test_steps_of_least_length_find_the_branch_that_a_frequency_just_misses(
    harmonic_branch, beyond
):
    folds = [s for s in harmonic_branch.special_points if s.kind == "LP"]
    assert len(folds) >= 2
    axis = Axis.in_frequency((5.7, 90.0))
    for fold in folds:
        state, flow = stroboscopic(fold.orbit)[0], fold.orbit.problem.flow
        before, after = (
            len(harmonic_branch.at(fold.frequency_hz * (1.0 + s * 1e-5))) for s in (-1.0, 1.0)
        )
        omega = fold.orbit.omega * (1.0 + (beyond if before > after else -beyond))
        held = orbit_near(flow, state, 1, omega, "middle")
        if held is not None:  # another part of the branch
            assert np.linalg.norm(stroboscopic(held)[0] - state) > 0.1 * np.linalg.norm(state)
        found = orbit_beside(axis.at(flow, omega / (2.0 * np.pi)), state, 1, "middle")
        assert found is not None
        assert harmonic_branch.contains(found)
        assert np.linalg.norm(stroboscopic(found)[0] - state) < 0.1 * np.linalg.norm(state)
        assert abs(math.log(found.omega / fold.orbit.omega)) < beyond


def test_search_is_repeatable(one_dof):
    first, second = (find_orbits(one_dof, 62.2, 5) for _ in range(2))
    assert len(first) == len(second)
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.point, b.point)


def test_flow_map_serves_as_well_as_the_system(one_dof):
    flow = FlowMap(one_dof)
    orbits = find_orbits(flow, 37.1, 3)
    assert orbits[0].problem.flow is flow
    assert same_orbit(orbits[0], find_orbits(one_dof, 37.1, 3)[0])


def test_period_that_does_not_exist_gives_an_empty_list(one_dof):
    """A linear system has its forced orbit only."""
    linear = make_one_dof(stops=[])
    assert find_orbits(linear, 26.0, 2, options=OrbitSearchOptions(starts=2)) == []
    assert len(find_orbits(linear, 26.0, 1)) == 1


def test_diagram_finds_the_doubled_branch_between_two_flips(one_dof):
    found = diagram(one_dof, (8.0, 12.0), periods=(1, 2), search_points=2)
    assert [b.period for b in found.branches].count(1) == 1
    doubled = [b for b in found.of_period(2) if "8.7" in b.stop_reason and "10.4" in b.stop_reason]
    assert len(doubled) == 1
    assert found.limits == (8.0, 12.0)
    assert found.observe == "middle"
    names = [b.name for b in found.branches]
    assert len(set(names)) == len(names)


def test_doublings_are_followed_whatever_other_periods_are_wanted(one_dof):
    effort = OrbitSearchOptions(starts=1)
    for doublings, count in ((1, 0), (2, 1)):
        found = diagram(
            one_dof, (8.0, 11.0), [1, 3], search_points=1, doublings=doublings, search=effort
        )
        assert any("flip at 8.7" in branch.stop_reason for branch in found.of_period(2))
        assert len(found.of_period(4)) == count


def test_branch_that_was_broken_off_is_not_followed_twice():
    """Pieces of few points from several frequencies overlap by no more than the last step."""
    found = diagram(
        make_one_dof(stops=[]), (20.0, 30.0), [1], search_points=3,
        search=OrbitSearchOptions(starts=1, transient=200),
        options=ContinuationOptions(max_points=20, first_step=1e-2, max_step=1e-2),
    )  # fmt: skip
    reasons = [reason for branch in found.branches for reason in branch.stop_reasons]
    assert "20 points" in reasons
    assert "meets another branch where that was broken off" in reasons
    for one, other in itertools.permutations(found.branches, 2):
        assert sum(other.contains(orbit) for orbit in one.points) <= 1


def test_walk_meets_an_open_end_whatever_the_shift_of_the_orbit(one_dof):
    options = ContinuationOptions(max_points=5)
    short = continue_branch(find_orbits(one_dof, 37.1, 3)[0], (37.0, 37.2), options=options)
    long = continue_branch(
        short.points[5], (37.0, 37.2), options=dataclasses.replace(options, max_points=15)
    )
    beyond = long.points[-1]
    states = beyond.states(2 * np.pi + beyond.problem.phases[:-1])
    shifted = solve_orbit(one_dof, beyond.frequency_hz, 3, guess=states)
    assert same_orbit(shifted, beyond) and not np.allclose(shifted.point, beyond.point)
    ends = open_ends(short)
    rest = continue_branch(shifted, (37.0, 37.2), options=options, open_ends=ends)
    assert "meets another branch where that was broken off" not in rest.stop_reasons
    rest = continue_branch(shifted, (37.0, 37.2), open_ends=ends)
    assert "meets another branch where that was broken off" in rest.stop_reasons
    assert sum(short.contains(orbit) for orbit in rest.points) <= 1


def test_diagram_says_which_orbit_it_could_not_follow(monkeypatch):
    def fails(place, *_, **__):
        raise ConvergenceError(f"no orbit at {place.orbit.frequency_hz:g} Hz: singular Jacobian")

    monkeypatch.setattr("nldyn.branches.continuation.start_point", fails)
    found = diagram(make_one_dof(stops=[]), (25.0, 27.0), periods=(1,), search_points=1)
    assert found.branches == ()
    assert found.notes[0].startswith("orbit of period 1 found but not followed: no orbit at 25.98")


def test_diagram_says_what_it_did_not_find(one_dof):
    found = diagram(
        make_one_dof(stops=[]), (20.0, 30.0), periods=(1,), search_points=1,
        seeds=[SubharmonicSeed(2, 26.0)], search=OrbitSearchOptions(starts=1, transient=200),
    )  # fmt: skip
    assert [b.period for b in found.branches] == [1]
    assert found.notes == ("no 1/2 orbit found near 26 Hz",)
    with pytest.raises(SystemModelError, match="near = 95 lies outside"):
        diagram(one_dof, (84.0, 88.0), seeds=[SubharmonicSeed(2, 95.0)])


@pytest.fixture
def failing_simulations(monkeypatch):
    shoot = FlowMap.shoot

    def fails(*arguments, chained=False, **options):
        found = shoot(*arguments, chained=chained, **options)
        return dataclasses.replace(found, failure="too many contacts") if chained else found

    monkeypatch.setattr(FlowMap, "shoot", fails)


@pytest.mark.usefixtures("failing_simulations")
def test_simulations_that_fail_are_told():
    system = make_one_dof(stops=[])
    with pytest.raises(ConvergenceError, match="from rest at 26 Hz failed: too many contacts"):
        solve_orbit(system, 26.0)
    with pytest.raises(ConvergenceError, match="every simulation at 26 Hz failed: too many"):
        find_orbits(system, 26.0, 1)
    effort = OrbitSearchOptions(starts=3)
    found = diagram(system, (25.0, 27.0), [1], search_points=1, search=effort)
    assert found.notes[0] == "3 of 3 simulations at 25.9808 Hz failed: too many contacts"


def test_orbit_whose_motion_cannot_be_recorded_says_why(monkeypatch):
    orbit = dataclasses.replace(solve_orbit(make_one_dof(stops=[]), 26.0), motion=None)
    motion = dataclasses.replace(orbit.trajectory, failure="too many contacts")
    monkeypatch.setattr(FlowMap, "trajectory", lambda *_: motion)
    with pytest.raises(ConvergenceError, match="26 Hz could not be recorded: too many contacts"):
        _ = dataclasses.replace(orbit).impacts


def two_modes_before_a_gap(gap):
    """The 2-DOF model: from 20 Hz on it either stays off a stop 10 µm away or hits it hard."""
    return System.from_modal(
        [13.1, 125.1],
        {"middle": [0.6343, 0.6811]},
        modal_damping=0.01,
        dampers=[Damper("middle", 5.81)],
        stops=[Stop("middle", 5.17e9, gap=gap)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )


def test_orbits_that_hit_a_stop_are_found_beside_those_that_miss_it():
    system = two_modes_before_a_gap(1e-5)
    branch = continue_branch(solve_orbit(system, 13.0), (12.0, 22.0))
    (hitting,) = [orbit for orbit in branch.at(20.5) if orbit.stable and orbit.impacts]
    for seed in (1, 2, 3):
        effort = OrbitSearchOptions(starts=2, seed=seed)
        found = diagram(system, (20.0, 30.0), [1], search=effort)
        assert any(branch.contains(hitting) for branch in found.branches)
        assert found.notes == ()


def test_stop_that_nothing_touches_is_told():
    (note,) = diagram(two_modes_before_a_gap(1.0), (20.0, 22.0), [1], search_points=1).notes
    assert note.startswith("no orbit that touches a stop was found")
    pressed = two_modes_before_a_gap(-1e-5)
    assert diagram(pressed, (90.0, 91.0), [1], search_points=1).notes == ()
    rigid = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.1]],
        stops=[RigidStop("x", 0.8, gap=0.3)], excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    assert diagram(rigid, (0.26, 0.28), [1], search_points=1).notes == ()


def test_what_is_done_counts_a_search_for_contact_until_contact_is_found():
    """It comes last where no stop is in reach: all is done then, and not before."""
    for gap, last in ((1.0, "search for contact"), (1e-7, "1/1")):
        told = []
        system = System.from_modal(
            [13.1], {"m": [0.635]}, modal_damping=0.1, stops=[Stop("m", 5e6, gap=gap)],
            excitation=[Unbalance("m", 4.92e-6)],
        )  # fmt: skip
        diagram(
            system, (10.0, 12.0), [1], search_points=3, search=OrbitSearchOptions(starts=1),
            progress=lambda what, _, done, told=told: told.append((what, done)),
        )  # fmt: skip
        stages = [what for what, _ in told]
        assert stages[-1] == last and (last == "1/1") is ("search for contact" not in stages)
        done = [share for what, share in told if what == stages[-1]]
        assert done == sorted(done) and done[0] < 0.75 and max(done) <= 1.0


def test_a_diagram_as_one_table(harmonic_branch):
    """Rows of all branches below each other, in pandas and xarray."""
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    other = dataclasses.replace(harmonic_branch, name="again")
    whole = Diagram((harmonic_branch, other), (5.0, 90.0), "middle", ("a note",))
    frame, data = whole.to_pandas("special_points"), whole.to_xarray()
    table = harmonic_branch.table("special_points")
    assert list(frame.columns) == ["branch", *table]
    assert frame[frame["branch"] == "again"]["frequency_hz"].tolist() == [*table["frequency_hz"]]
    assert frame.attrs["observe"] == data.attrs["observe"] == "middle"
    count = len(harmonic_branch.nodes)
    assert data.sizes["point"] == 2 * count
    assert np.array_equal(data["multipliers"][count:], data["multipliers"][:count])
    with pytest.raises(SystemModelError, match="the diagram has no branch"):
        Diagram((), (5.0, 90.0), "middle").to_xarray()


def test_a_search_that_would_take_hours_is_shortened():
    """A string of 25 modes that lies on three stops, and the same with one mode."""

    def held(modes: int) -> FlowMap:
        numbers = np.arange(1, modes + 1)
        places = {f"p{k}": np.sin(numbers * np.pi * k / 7.0) for k in (1, 2, 3)}
        stops = [Stop.linear(at, 1e6, gap=-1e-5) for at in places]
        force = HarmonicForce("p2", 30.0)
        return FlowMap(
            System.from_modal(
                20.0 * numbers, places, modal_damping=0.01, stops=stops, excitation=[force]
            )
        )

    whole, axis = OrbitSearchOptions(), Axis.in_frequency((20.0, 30.0))
    large = shortened(axis.at(held(25), 25.0), whole, 12, (1, 2, 3))
    assert (large.starts, large.candidates, large.recorded) == (2, 1, 43)
    assert shortened(axis.at(held(1), 25.0), whole, 12, (1, 2, 3)) == whole
