"""Orbits are found beside short motions that begin at disturbed states of others."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from nldyn import (
    Diagram,
    ExploreOptions,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    by_disturbed_orbits,
    continue_branch,
    explore,
    index_gaps,
    index_sum,
    load_branches,
    solve_orbit,
)
from nldyn.disturbed_orbits import DISTURBANCE, LESS_DAMPED, NEIGHBOURS, States, flows_of
from nldyn.exploration import steps_between
from nldyn.paper.jobs import scene_system

RANGE_HZ = (36.0, 38.5)


@pytest.fixture(scope="module")
def three() -> Diagram:
    """The branches of periods 1, 2 and 3, the last of which ends at a fold."""
    system = System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142,
        stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip
    found = explore(system, RANGE_HZ, 3, effort=ExploreOptions(spacing=0.01, starts=2)).diagram
    assert sorted(branch.period for branch in found.branches) == [1, 2, 3]
    return found


def without(known: Diagram, branch) -> Diagram:
    return replace(known, branches=tuple(b for b in known.branches if b is not branch))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("period", [1, 2, 3])
def test_a_branch_is_found_from_disturbed_states_of_the_others(three, period, seed):
    (left_out,) = three.of_period(period)
    done = by_disturbed_orbits(without(three, left_out), motions=20, seed=seed)
    (found,) = done.branches[2:]
    assert found.period == period
    assert all(left_out.contains(orbit) for orbit in found.points)
    assert done.notes[-1].endswith("1 branch beside those given")
    assert [index_sum(done.branches, 36.5, n) for n in (1, 2, 3)] == [1, 1, 1]


def test_what_is_known_is_met_and_not_found_again(three):
    done = by_disturbed_orbits(three, motions=20)
    assert len(done.branches) == 3
    assert ", and to 3 of the 3 given from states of others, 0 branches" in done.notes[-1]
    assert done.notes[:-2] == tuple(n for n in three.notes if not n.startswith("indices"))


def test_the_harmonic_alone_leads_to_others():
    """Two modes from 28.5 to 30.5 Hz, where orbits of period 2 are missing from the indices."""
    system, range_hz = scene_system("two_dof_xi_0.01"), (28.5, 30.5)
    harmonic = continue_branch(solve_orbit(system, 29.5), range_hz)
    known = Diagram((harmonic,), range_hz, "middle")
    assert index_gaps(known.branches, range_hz, 2)
    done = by_disturbed_orbits(known, max_period=2, motions=50)
    assert not index_gaps(done.branches, range_hz, 2)
    assert ", and to 0 of the 1 given from states of others" in done.notes[-1]


def test_no_longer_orbits_are_looked_for_than_wanted(three):
    (third,) = three.of_period(3)
    done = by_disturbed_orbits(without(three, third), max_period=2, motions=20)
    assert len(done.branches) == 2
    assert " of the 2 given from" in done.notes[-1]


def test_no_more_motions_are_made_than_wanted(three):
    """Each comes back to three states at most, of each period."""
    frequencies = []
    done = by_disturbed_orbits(
        three, motions=2, spacing=0.02, progress=lambda what, hz: frequencies.append((what, hz))
    )
    made = [hz for what, hz in frequencies if what == "disturbed"]
    assert len(made) == 2 * steps_between(*RANGE_HZ, 0.02)
    assert 0 < int(re.search(r"of (\d+) states", done.notes[-1])[1]) <= 9 * len(made)


def test_the_same_seed_gives_the_same_and_another_one_other_motions(three):
    notes = [by_disturbed_orbits(three, motions=5, seed=seed).notes[-1] for seed in (1, 1, 2)]
    assert notes[0] == notes[1] != notes[2]


def test_states_are_changed_by_independent_normal_numbers():
    states, rng = (
        States(np.array([7]), np.array([[1.0, -2.0, 0.5, 1e-3]])),
        np.random.default_rng(0),
    )
    drawn = [states.disturbed(rng) for _ in range(3000)]
    assert {branch for branch, _ in drawn} == {7}
    changes = (np.array([state for _, state in drawn]) / states.states - 1.0) / DISTURBANCE
    assert np.abs(np.cov(changes.T) - np.eye(4)).max() < 5.0 * np.sqrt(2.0 / 3000)
    assert np.abs(changes.mean(axis=0)).max() < 5.0 / np.sqrt(3000)


def test_the_branches_nearest_in_frequency_give_states(three):
    """One that ends below the frequency, if there are not so many others that reach it."""
    (harmonic,), (third,) = three.of_period(1), three.of_period(3)
    above = 1.001 * third.frequency_hz.max()
    for others, used in ((NEIGHBOURS - 1, True), (NEIGHBOURS, False)):
        states = States.of([third, *[harmonic] * others], above)
        assert (0 in states.branch) == used
        assert len(set(states.branch.tolist())) == NEIGHBOURS


@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_every_other_motion_has_a_tenth_of_the_damping_if_there_is_any(damping):
    system = System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=damping, stops=[Stop.linear("m", 1e5, gap=1e-3)],
        excitation=[HarmonicForce("m", 1.0)],
    )  # fmt: skip
    flow = solve_orbit(system, 5.0).problem.flow
    ratios = [other.system.total_damping[0, 0] for other in flows_of(flow)]
    assert ratios[0] == system.total_damping[0, 0]
    assert ratios[1:] == ([pytest.approx(LESS_DAMPED * ratios[0])] if damping else [])


def test_interrupted_it_keeps_what_it_has_found(three, tmp_path):
    (left_out,) = three.of_period(3)
    place, known = tmp_path / "found.h5", without(three, left_out)
    seen = []

    def interrupt(what: str, frequency_hz: float) -> None:
        seen.append(what)
        if what == "disturbed" and "1/3" in seen:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        by_disturbed_orbits(known, motions=20, progress=interrupt, checkpoint=place)
    (kept,) = load_branches(place)
    resumed = by_disturbed_orbits(known, motions=20, checkpoint=place)
    assert len(resumed.branches) == 3
    assert np.array_equal(resumed.branches[2].frequency_hz, kept.frequency_hz)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"motions": 0}, "motions must be"),
        ({"motions": 1.5}, "motions must be"),
        ({"seed": -1}, "seed must be"),
        ({"max_period": 0}, "max_period must be"),
        ({"spacing": 0.0}, "spacing must lie between 1e-06 and 1, got 0"),
        ({"known": None}, "known must be a Diagram"),
        ({"progress": 3}, "progress must be"),
    ],
)
def test_what_makes_no_sense_is_refused(three, change, message):
    known = change.get("known", three)
    options = {key: value for key, value in change.items() if key != "known"}
    with pytest.raises(SystemModelError, match=message):
        by_disturbed_orbits(known, **options)
