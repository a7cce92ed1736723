"""Further branches beside known ones: what all strategies have in common, and what each finds."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from branches_alike import without
from paper.jobs import scene_system
from problems import THREE_HZ, between_stops, make_one_dof

from nldyn import (
    Diagram,
    SystemModelError,
    continue_branch,
    extend_diagram,
    index_sum,
    save,
    solve_orbit,
)
from nldyn.branches.endings import Ending
from nldyn.io import CheckpointFile
from nldyn.io.branches import load_branches, load_diagram
from nldyn.orbits.axis import Axis
from nldyn.search import ClosedWalks, Mixtures, PseudoOrbits
from nldyn.search.fixed_point_index import index_gaps

FEW = {
    "mixtures": Mixtures(tries=3),
    "pseudo-orbits": PseudoOrbits(tries=3),
    "closed walks": ClosedWalks(states=200, tries=3),
}


def agree(found, wanted):
    """Whether one branch passes through all orbits of another."""
    return all(wanted.contains(orbit) for orbit in found.points)


@pytest.mark.parametrize(
    ("strategy", "left_out"),
    [
        (PseudoOrbits(tries=50), (3,)),
        (Mixtures(tries=50), (2,)),
        (ClosedWalks(states=1000, tries=50), (2, 3)),
        pytest.param(PseudoOrbits(tries=50), (2,), marks=pytest.mark.slow),
        pytest.param(Mixtures(tries=200), (3,), marks=pytest.mark.slow),
    ],
    ids=repr,
)
def test_branches_are_found_from_the_others(three, strategy, left_out):
    """Mixtures find period 3 from stretches of period 2 that do not close, one in 200 or so."""
    known = replace(three, branches=tuple(b for b in three.branches if b.period not in left_out))
    done = extend_diagram(known, strategy, spacing=0.02)
    assert sorted(branch.period for branch in done.branches) == [1, 2, 3]
    for branch in three.branches:
        (found,) = done.of_period(branch.period)
        assert agree(found, branch)
    assert re.search(rf"{len(left_out)} branch(es)? beside those given$", done.notes[-1])
    assert [index_sum(done.branches, 36.5, n) for n in (1, 2, 3)] == [1, 1, 1]


@pytest.mark.parametrize(
    "strategy", [Mixtures(20), PseudoOrbits(20), ClosedWalks(1000, 20)], ids=repr
)
def test_what_is_known_is_met_and_not_found_again(three, strategy):
    done = extend_diagram(three, strategy, spacing=0.02)
    assert done.branches == three.branches
    met = re.search(r" to (\d) of the 3 given there, 0 branches beside those", done.notes[-1])
    assert int(met[1]) >= 2
    assert (", not made of them," in done.notes[-1]) == strategy.of_known
    assert done.notes[:-2] == tuple(n for n in three.notes if not n.startswith("indices"))


@pytest.mark.parametrize("what", FEW)
def test_only_the_periods_and_frequencies_wanted_are_tried(three, what):
    """And as many of each length as wanted, of pseudo-orbits as many as there are at most."""
    tried = set()
    done = extend_diagram(
        three, FEW[what], min_period=2, max_period=2, limits=(37.2, 38.0), spacing=0.005,
        progress=lambda what, hz, done: tried.add(hz),
    )  # fmt: skip
    assert 37.2 < min(tried) < max(tried) < 38.0
    assert len(tried) == Axis.in_frequency((37.2, 38.0)).steps(0.005)
    count = int(re.search(rf"of (\d+) {what} led to", done.notes[-1])[1])
    assert count == 3 * len(tried) or (what == "pseudo-orbits" and 0 < count < 3 * len(tried))
    assert " of the 1 given there, " in done.notes[-1]  # period 3 ends below


@pytest.mark.parametrize("what", ["mixtures", "closed walks"])
def test_the_same_seed_gives_the_same_and_another_one_others(three, what):
    done = [extend_diagram(three, replace(FEW[what], seed=n), spacing=0.02) for n in (1, 1, 2)]
    notes = [found.notes[-1] for found in done]
    assert notes[0] == notes[1] != notes[2]


def test_no_longer_orbits_are_looked_for_than_wanted(three):
    (third,) = three.of_period(3)
    done = extend_diagram(without(three, third), Mixtures(tries=5), max_period=2)
    assert len(done.branches) == 2
    assert " of the 2 given" in done.notes[-1]


def test_what_its_own_orbits_lead_to_is_not_met_from_others(three):
    """The harmonic alone: every mixture is of two of its orbits."""
    known = replace(three, branches=tuple(three.of_period(1)))
    done = extend_diagram(known, Mixtures(tries=20), max_period=1)
    came, met = re.search(r"^(\d+) of .*, to (\d+) of the 1 given", done.notes[-1]).groups()
    assert int(came) > 0
    assert met == "0"


def test_an_orbit_alone_gives_no_pseudo_orbit(three):
    """The harmonic changes so little within 0.1 % that its pieces give nothing else."""
    harmonic = Diagram(tuple(three.of_period(1)), THREE_HZ, "middle")
    done = extend_diagram(harmonic, PseudoOrbits(), spacing=0.001)
    assert len(done.branches) == 1
    assert done.notes[-1].startswith("0 of 0 pseudo-orbits led to an orbit")


def test_different_orbits_of_one_branch_lead_to_others():
    """Two modes from 28.5 to 30.5 Hz, the harmonic alone known; nothing is met without it."""
    system, range_hz = scene_system("two_dof_xi_0.01"), (28.5, 30.5)
    harmonic = continue_branch(solve_orbit(system, 29.5), range_hz)
    known = Diagram((harmonic,), range_hz, "middle")
    assert index_gaps(known.branches, range_hz, 2)
    done = extend_diagram(known, PseudoOrbits(tries=200), max_period=2)
    assert not index_gaps(done.branches, range_hz, 2)
    assert " and, not made of them, to 0 of the 1 given" in done.notes[-1]


def test_a_branch_that_was_begun_is_finished(three, tmp_path):
    """Interrupted on the way along it, and with the known branches read from a file."""
    (left_out,) = three.of_period(3)
    place, known = tmp_path / "found.h5", tmp_path / "known.h5"
    save(without(three, left_out), known)
    seen, search = [], PseudoOrbits(tries=50)

    def interrupt(what: str, frequency_hz: float, done: float) -> None:
        seen.append(what)
        if seen.count("1/3") == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        extend_diagram(
            load_diagram(known), search, progress=interrupt, checkpoint=CheckpointFile(place)
        )
    (begun,) = load_branches(place)
    assert Ending.NOT_FINISHED.value in begun.stop_reasons
    done = extend_diagram(load_diagram(known), search, checkpoint=CheckpointFile(place))
    (found,) = done.branches[2:]
    assert len(begun.points) < len(found.points)
    assert Ending.NOT_FINISHED.value not in found.stop_reasons
    ends = [special.frequency_hz for special in found.special_points if special.kind == "LP"]
    wanted = [special.frequency_hz for special in left_out.special_points if special.kind == "LP"]
    assert sorted(ends) == pytest.approx(sorted(wanted), rel=1e-9)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"max_period": 0}, "max_period must be"),
        ({"min_period": 0}, "min_period must be"),
        ({"min_period": 3, "max_period": 2}, "min_period must be"),
        ({"limits": (30.0, 37.0)}, r"\(30, 37\) must lie within those of .*, \(36, 38.5\)"),
        ({"limits": (37.0, 37.0)}, "two finite numbers, ascending"),
        ({"spacing": 0.0}, "spacing must be at least 1e-06 and less than 1, got 0"),
        ({"spacing": float("nan")}, "spacing must be at least"),
        ({"known": None}, "known must be a Diagram"),
        ({"progress": 3}, "progress must be"),
        ({"strategy": Mixtures}, "strategy must be a strategy such as Mixtures\\(\\), got"),
        ({"strategy": ClosedWalks(10**6), "max_period": 11}, "states must be .* from 1 to 909090"),
    ],
)
def test_what_makes_no_sense_is_refused(three, change, message):
    given = {"known": three, "strategy": Mixtures(), **change}
    with pytest.raises(SystemModelError, match=message):
        extend_diagram(**given)


@pytest.mark.parametrize(
    ("kind", "numbers", "message"),
    [
        (Mixtures, {"tries": 0}, "Mixtures: tries must be"),
        (ClosedWalks, {"tries": 1.5}, "ClosedWalks: tries must be"),
        (PseudoOrbits, {"seed": -1}, "PseudoOrbits: seed must be"),
        (ClosedWalks, {"states": 0}, "ClosedWalks: states must be"),
        (ClosedWalks, {"states": 10.5}, "ClosedWalks: states must be"),
    ],
)
def test_strategies_refuse_numbers_that_make_no_sense(kind, numbers, message):
    with pytest.raises(SystemModelError, match=message):
        kind(**numbers)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"branches": ()}, "known: has no branches to begin with"),
        ({"branches": (1,)}, "known: branches must be a list of branches"),
        ({"observe": "nose"}, "nose"),
        ({"notes": None}, "notes must be"),
        ({"limits": (37.0, 36.5)}, "two finite numbers, ascending"),
        ({"limits": (35.0, 37.0)}, "was followed from 36 to 38.5 Hz, not over the range"),
    ],
)
def test_a_diagram_that_makes_no_sense_is_refused(three, change, message):
    with pytest.raises(SystemModelError, match=message):
        extend_diagram(replace(three, **change), Mixtures())


def test_branches_of_two_systems_are_refused(three):
    other = continue_branch(solve_orbit(make_one_dof(), 37.0), THREE_HZ, name="of another")
    changed = continue_branch(solve_orbit(make_one_dof(stops=[]), 37.0), THREE_HZ, name="other")
    assert extend_diagram(replace(three, branches=(other,)), Mixtures(1), spacing=0.5).branches
    known = replace(three, branches=(*three.branches, changed))
    with pytest.raises(SystemModelError, match="branch 'other' is of another system"):
        extend_diagram(known, Mixtures())


def test_a_system_without_damping_has_no_sum_of_indices():
    system = between_stops()
    free = replace(system, damping=0.0 * system.damping)
    branch = continue_branch(solve_orbit(free, 20.0), (20.0, 20.1))
    known = Diagram((branch,), (20.0, 20.1), "m")
    done = extend_diagram(known, Mixtures(tries=1), max_period=1, spacing=0.5)
    assert not any("indices" in note for note in done.notes)
