"""Where a branch comes near another one, or near the shifts of its own orbits, it is not left."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hard.continuation import beam as four_modes
from problems import between_stops, in_frequency, make_one_dof
from test_uncoupled import oscillator

from nldyn import (
    ContinuationOptions,
    ConvergenceError,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Stop,
    System,
    Unbalance,
    continue_branch,
    diagram,
    solve_orbit,
)
from nldyn.base.errors import LocateError
from nldyn.base.resources import example
from nldyn.bifurcations import locate as special
from nldyn.bifurcations.branch_crossing import distance, lies_on_crossing
from nldyn.bifurcations.normal_forms import is_symmetric, switch_at_branch_point
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.bifurcations.point import BranchNode
from nldyn.bifurcations.within_step import special_points_between
from nldyn.branches import arclength as walk
from nldyn.branches import guards
from nldyn.branches.continuation import _without_repeat, start_point
from nldyn.branches.guards import BY_TOLERANCE
from nldyn.branches.leg import Leg
from nldyn.orbits.shooting import asymmetry, metric_length
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene

SHORT = ContinuationOptions(first_step=0.005, max_step=0.005)
LONG = ContinuationOptions(first_step=0.05)


@pytest.fixture(scope="module")
def beam() -> System:
    """The two-mode model at low damping."""
    return build_system(load_scene(example("two_dof_xi_0.001.toml")))


def test_steps_do_not_jump_between_the_shifts_of_an_orbit(beam):
    """At 36.05 Hz a 1/3 branch turns by 120° beside an orbit of period 1.

    Its shifts by one and by two periods turn there as well, so that another of the three branches
    lies straight ahead of each.
    """
    guess = np.array([-9.25373e-06, 8.53828e-07, 2.147340e-05, 3.81546e-05])
    short = continue_branch(solve_orbit(beam, 36.2, 3, guess=guess), (35.9, 36.3), options=SHORT)
    for start_hz in (36.2, 36.08):
        long = continue_branch(short.at(start_hz)[0], (35.9, 36.3), options=LONG)
        assert not long.notes
        for end in (0, -1):
            found, expected = (branch.nodes[end].orbit.point for branch in (long, short))
            assert np.abs(found - expected).max() < 1e-6 * np.abs(expected[:-1]).max()


def test_branch_is_not_left_for_another_that_it_nearly_crosses(beam):
    """Two 1/3 branches come near one another at 37.16 Hz, where one of them has a fold."""
    guess = np.array([-9.25469e-06, 7.28332e-07, 5.27980e-05, 4.86787e-04])
    short = continue_branch(solve_orbit(beam, 37.0, 3, guess=guess), (36.9, 37.3), options=SHORT)
    for start_hz in (37.0, 37.08):
        long = continue_branch(short.at(start_hz)[0], (36.9, 37.3))
        assert not long.notes
        assert special_points(long) == [
            (kind, pytest.approx(hz, rel=1e-9)) for kind, hz in special_points(short)
        ]


def test_no_folds_are_found_on_another_branch_within_a_step():
    """From 50.83 Hz a step leads over a narrow resonance with another branch beside it."""
    above = continue_branch(solve_orbit(four_modes(0.001), 55.5), (50.4, 55.6))
    orbit = above.at(50.8308)[0]
    long, short = (continue_branch(orbit, (49.0, 52.5), options=o) for o in (LONG, SHORT))
    assert special_points(long) == [
        (kind, pytest.approx(hz, rel=1e-9)) for kind, hz in special_points(short)
    ]


def test_doubled_branch_does_not_go_on_along_the_one_that_it_comes_from():
    """The usual step across its second flip is longer than what is left of it."""
    system = build_system(load_scene(example("four_dof_xi_0.001.toml")))
    displacements = [-1.54709e-05, 4.83617e-07, -4.48871e-07, -4.75199e-07]
    velocities = [4.57389e-03, -1.24879e-03, 2.06469e-03, -6.21826e-04]
    guess = np.array([*displacements, *velocities])
    branch = continue_branch(solve_orbit(system, 22.0472, 2, guess=guess), (22.0, 22.1))
    ends = [branch.nodes[end].orbit for end in (0, -1)]
    first = ends[0].states(np.array([0.0]))[0]
    parent = continue_branch(solve_orbit(system, ends[0].frequency_hz, guess=first), (22.03, 22.1))
    flips = [s.frequency_hz for s in parent.special_points if s.kind == "PD"]
    assert [end.frequency_hz for end in ends] == pytest.approx(flips, rel=1e-10)
    assert all(reason.startswith("joins the branch of period 1") for reason in branch.stop_reasons)


def test_branches_of_an_imperfect_pitchfork_are_told_apart():
    """Two pitchforks become one branch, and a closed one with two folds.

    The distance of the two grows with the cube root of the mismatch: 3e-4 of the states at 1e-9.
    At 1e-11 rounding decides whether a step takes the one for the other; then the walk says so.
    """
    perfect = continue_branch(solve_orbit(between_stops(), 11.0), (11.0, 11.8))
    pitchforks = [s.frequency_hz for s in perfect.special_points if s.kind == "BP"]
    for mismatch in (1e-7, 1e-10):
        system = between_stops(mismatch)
        main = continue_branch(solve_orbit(system, 11.0), (11.0, 11.8))
        half_later = -main.at(11.3)[0].states(np.array([np.pi]))[0]
        isola = continue_branch(solve_orbit(system, 11.3, guess=half_later), (11.0, 11.8))
        assert main.stop_reasons == ("end of the frequency range",) * 2
        assert {s.kind for s in main.special_points} == {"PD", "GR"}
        assert isola.closed
        turns = sorted(s.frequency_hz for s in isola.special_points if s.kind in ("LP", "BP"))
        assert [s.kind for s in isola.special_points].count("LP") == 2
        # a fold leaves the pitchfork with the power 2/3 of the mismatch
        assert turns == pytest.approx(sorted(pitchforks), rel=2.0 * mismatch ** (2 / 3) + 1e-9)


def test_special_points_where_a_closed_branch_closes_are_told_once():
    """Its last step leads beyond the start, over a flip that lies there."""
    symmetric = oscillator()
    first, second = symmetric.stops
    system = replace(symmetric, stops=(first, replace(second, gap=1.001 * second.gap)))
    branch = continue_branch(solve_orbit(system, 0.55), (0.5, 1.0))
    elsewhere = continue_branch(branch.at(0.54)[0], (0.5, 1.0))
    assert branch.stop_reasons == elsewhere.stop_reasons == ("closed branch", "closed branch")
    assert sorted(special_points(branch)) == [
        (kind, pytest.approx(hz, rel=1e-8)) for kind, hz in sorted(special_points(elsewhere))
    ]


def test_flip_of_a_doubled_branch_close_to_its_birth_is_found(beam):
    """It lies between the flip at 35.67148 Hz and the usual first point of a doubled branch."""
    parent = solve_orbit(beam, 36.0)
    flip = next(s for s in continue_branch(parent, (35.5, 36.5)).special_points if s.kind == "PD")
    both_ways = continue_branch(switch_at_flip(flip).orbit, (35.5, 36.5))
    found = diagram(parent.problem.flow, (35.5, 36.5), [1], doublings=1, search_points=1)
    born = next(b for b in found.branches if b.stop_reasons[0].startswith("joins"))
    close, expected = (
        [s.frequency_hz for s in b.special_points if s.kind == "PD" and s.frequency_hz < 35.672]
        for b in (born, both_ways)
    )
    assert len(expected) == 1 and close == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("max_step", [0.05, pytest.param(0.005, marks=pytest.mark.slow)])
def test_halves_of_a_broken_symmetry_do_not_depend_on_the_step(max_step):
    """At a pitchfork the equations have two tangents; that of the branch is known beside it."""
    system = System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.02, excitation=[HarmonicForce("m", 2.0)],
        stops=[Stop.linear("m", 1e6, gap=1e-3, direction=side) for side in (1, -1)],
    )  # fmt: skip
    options = ContinuationOptions(max_step=max_step, first_step=0.005)
    symmetric = continue_branch(solve_orbit(system, 4.0), (4.0, 12.0), options=options)
    points = [s for s in symmetric.special_points if s.kind == "BP"]
    assert [p.frequency_hz for p in points] == pytest.approx([7.0298072, 9.4031911], rel=1e-7)
    for point in points:
        halves = [half.orbit for half in switch_at_branch_point(point)]
        assert len(halves) == 2 and not any(is_symmetric(orbit) for orbit in halves)
    branch = continue_branch(halves[0], (9.0, 9.5), options=options)
    turns = [s for s in branch.special_points if abs(s.frequency_hz - 9.4031911) < 1e-6]
    assert [s.kind for s in turns] == ["BP"]


def test_walk_from_a_branch_point_says_that_branches_cross_there():
    branch = continue_branch(solve_orbit(facing_stops(), 8.0), (6.5, 8.5))
    point = next(s for s in branch.special_points if s.kind == "BP")
    with pytest.raises(ConvergenceError, match=r"branches cross at the orbit at 7\.\d+ Hz"):
        continue_branch(point.orbit, (6.5, 8.5))


def special_points(branch):
    return [(s.kind, s.frequency_hz) for s in branch.special_points]


def on_springs(ratio: float, force: float, *stops: Stop) -> System:
    """A mass of 1 kg, 10 Hz."""
    return System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=ratio, stops=stops,
        excitation=[HarmonicForce("m", force)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def flips_around_grazing():
    """A branch of period 4, and its special points with short steps."""
    system = on_springs(0.02, 5.0, *(Stop("m", 1e7, gap=1e-3, direction=side) for side in (1, -1)))
    guess = np.array([0.00096285, -0.00178918])
    start = solve_orbit(system, 8.856826796779755, 4, guess=guess)
    fine = ContinuationOptions(max_step=0.0005, first_step=0.0005)
    expected = special_points(continue_branch(start, (8.8, 8.9), options=fine))
    assert [kind for kind, _ in expected].count("PD") == 4
    return continue_branch(start, (8.8, 8.9)), expected


@pytest.mark.parametrize("place", [2, 30])
def test_flips_on_both_sides_of_a_grazing_point_within_a_step_are_found(
    flips_around_grazing, place
):
    """Between 8.8543 and 8.8578 Hz two pairs of flips lie around the grazing points of a branch."""
    branch, expected = flips_around_grazing
    usual = continue_branch(branch.points[place], (8.8, 8.9))
    assert sorted(special_points(usual)) == [
        (kind, pytest.approx(hz, rel=1e-9)) for kind, hz in sorted(expected)
    ]


@pytest.mark.parametrize("which", [pytest.param(0, marks=pytest.mark.slow), 1])
def test_doubled_branch_of_a_doubled_branch_comes_to_its_flip(which):
    """Its own determinant changes sign there, as where another branch is crossed."""
    system = on_springs(0.01, 6.0, Stop("m", 1e8, gap=-1e-4))
    first = continue_branch(solve_orbit(system, 14.0), (9.5, 16.0))
    low = min((s for s in first.special_points if s.kind == "PD"), key=lambda s: s.frequency_hz)
    second = continue_branch(switch_at_flip(low).orbit, (9.5, 16.0))
    flips = sorted(s.frequency_hz for s in second.special_points if s.kind == "PD")
    flip = next(s for s in second.special_points if s.frequency_hz == flips[which])
    doubled = continue_branch(switch_at_flip(flip).orbit, (9.5, 16.0))
    joined = [
        doubled.nodes[end].orbit.frequency_hz
        for end in (0, -1)
        if doubled.stop_reasons[end].startswith("joins")
    ]
    assert any(hz == pytest.approx(flip.frequency_hz, rel=1e-6) for hz in joined)


def test_grazing_point_beside_a_flip_is_found_where_the_contact_is_too_slight_to_count():
    """At 10.10698 Hz a contact ends 4e-6 of the frequency beside a flip."""
    system = System.from_modal(
        [10.0, 22.0], {"a": [1.0, 0.8], "b": [0.6, -1.0]}, modal_damping=[0.005, 0.01],
        stops=[Stop.linear("a", 1e5, gap=-1e-4), Stop.linear("b", 2e5, gap=7e-4, direction=-1)],
        excitation=[HarmonicForce("b", 4.0)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 12.0), (8.0, 13.0))
    near = [s for s in special_points(branch) if 10.1068 < s[1] < 10.1073]
    assert sorted(near) == [
        ("GR", pytest.approx(10.106984343837, rel=1e-10)),
        ("PD", pytest.approx(10.107024341771, rel=1e-10)),
    ]


@pytest.mark.slow
@pytest.mark.parametrize("every", [6])
def test_end_of_a_doubled_branch_is_told_as_no_fold(every):
    """The branch turns at its flip; from this start rounding put two folds there."""
    ratio, stop = 0.037775752970254865, Stop("m", 24402899.633555975, gap=0.00028860699650216725)
    system = on_springs(ratio, 7.065386225652446, stop)
    found = diagram(system, (6.5, 16.0), (1, 2), doublings=1, search_points=4)
    branch = next(b for b in found.branches if b.period == 2 and b.frequency_hz.min() < 9.7)
    expected = sorted(special_points(branch))
    for start in branch.points[6:-6:every]:
        again = continue_branch(start, (6.5, 16.0))
        assert sorted(special_points(again)) == [
            (kind, pytest.approx(hz, rel=1e-8)) for kind, hz in expected
        ]


def test_a_walk_that_comes_back_to_where_it_was_says_so(monkeypatch):
    """Made to jump at a nearly perfect pitchfork, it would go round the closed branch for ever.

    Rounding decides from which step on it jumps.
    """
    for module in (walk, guards):
        monkeypatch.setattr(module, "SHORTEST_CROSSING", 1e-4)
    monkeypatch.setattr(guards, "is_crossing", lambda orbit: True)
    start = solve_orbit(between_stops(1e-9), 11.0)
    branches = (
        continue_branch(start, (11.0, 11.8), options=ContinuationOptions(first_step=step))
        for step in (0.05, 0.04, 0.03, 0.02)
    )
    told = "comes back to where it had been"
    came_back = next(b for b in branches if any(t.startswith(told) for t in b.stop_reasons))
    assert any(note.startswith(told) for note in came_back.notes)


@pytest.mark.parametrize("first_step", [0.02728, 0.0011177628])
def test_halves_of_a_broken_symmetry_are_the_same_from_any_step(first_step):
    """Some steps end so near to a pitchfork that Newton's method cannot tell the branches there."""
    system = between_stops()
    symmetric = continue_branch(solve_orbit(system, 11.0), (11.0, 11.8))
    pitchforks = [s for s in symmetric.special_points if s.kind == "BP"]
    half = switch_at_branch_point(pitchforks[0])[0].orbit
    options = ContinuationOptions(first_step=first_step)
    halves = continue_branch(half, (11.0, 11.8), options=options)
    assert halves.stop_reasons == ("closed branch", "closed branch")
    assert Counter(s.kind for s in halves.special_points) == {"BP": 2, "PD": 4, "GR": 4}
    met = sorted(s.frequency_hz for s in halves.special_points if s.kind == "BP")
    assert met == pytest.approx(sorted(s.frequency_hz for s in pitchforks), rel=1e-9)


@pytest.fixture(scope="module")
def facing():
    """Branch of a mass between two stiff linear stops, which the motion of a period touches."""
    return continue_branch(solve_orbit(facing_stops(), 8.0), (6.5, 8.5))


def facing_stops() -> System:
    return on_springs(0.02, 2.0, *(Stop("m", 1e7, direction=side) for side in (1, -1)))


@pytest.mark.parametrize(
    ("amplitude", "side"),
    [(5e-6, 0), (1e-6, 1), (7.580391653224309e-07, 0), (4.1630532849205377e-07, 1)],
)
def test_a_half_begun_beside_its_pitchfork_has_that_once_and_no_fold(facing, amplitude, side):
    """Its frequency falls all the way; a tangent within 1e-6 of the pitchfork may be of both."""
    special = [s for s in facing.special_points if s.kind == "BP"][1]
    hz = special.frequency_hz
    half = switch_at_branch_point(special, amplitude)[side].orbit
    branch = continue_branch(half, (0.99 * hz, 1.01 * hz))
    assert not branch.notes
    (only,) = branch.special_points
    assert only.kind == "BP"
    assert only.frequency_hz == pytest.approx(hz, rel=1e-9)


def test_a_tangent_that_jumps_beside_a_pitchfork_tells_of_that_and_of_no_fold(facing, monkeypatch):
    """It may be steeper where it is of both branches than at a tenth of the step farther on."""
    pitchfork = [s for s in facing.special_points if s.kind == "BP"][1]
    half = switch_at_branch_point(pitchfork, 5e-6)[0]
    branch = continue_branch(
        half.orbit, (0.99 * pitchfork.frequency_hz, 1.01 * pitchfork.frequency_hz)
    )
    far = next(o for o in branch.nodes if 5e-3 < distance(half, o) < 5e-2)
    secant, length = far.point - half.point, distance(half, far)
    first, last = (
        BranchNode.of(place, secant / length, s) for place, s in ((half, 0.0), (far, length))
    )
    tests = special.tests

    def mixed(point):
        steep = 2e-3 if point.arclength < 1e-4 else -5e-3
        return tests(point) | ({"LP": steep} if point.arclength < 1.5e-3 else {})

    monkeypatch.setattr(special, "tests", mixed)
    (found,) = special._located("LP", special.Chord(first, last))
    assert found.kind == "BP"
    assert found.frequency_hz == pytest.approx(pitchfork.frequency_hz, rel=1e-9)


@pytest.mark.parametrize("kind", ["LP", "BP", "PD"])
def test_a_test_that_jumps_where_no_multiplier_is_critical_tells_of_no_point(
    facing, kind, monkeypatch
):
    """No branch is known on which one does so within a step: it is made to."""
    first, last = facing.nodes[3:5]
    tests, middle = special.tests, 0.5 * (first.arclength + last.arclength)
    assert abs(abs(first.orbit.multipliers) - 1.0).min() > 0.1

    def jumping(point):
        return tests(point) | {kind: 1.0 if point.arclength < middle else -1e-3}

    monkeypatch.setattr(special, "tests", jumping)
    with pytest.raises(LocateError, match="jumps"):
        special._located(kind, special.Chord(first, last))


def half_of(facing, index, side, amplitude):
    """A half of the branch that is born at one of two pitchforks, begun at a distance from it."""
    special = [s for s in facing.special_points if s.kind == "BP"][index]
    return continue_branch(switch_at_branch_point(special, amplitude)[side].orbit, (6.5, 8.5))


HALVES = [(0, 0), *(pytest.param(at, marks=pytest.mark.slow) for at in [(0, 1), (1, 0), (1, 1)])]


@pytest.fixture(scope="module", params=HALVES)
def far_half(facing, request):
    """Begun far from its pitchfork, with its place."""
    return half_of(facing, *request.param, 1e-2), *request.param


@pytest.mark.parametrize("amplitude", [1e-5, 4.1630532849205377e-07])
def test_a_closed_half_begun_beside_its_pitchfork_has_that_once(facing, far_half, amplitude):
    """The first step or the last may tell it, or both; as many as one begun far from it has."""
    far, index, side = far_half
    near = half_of(facing, index, side, amplitude)
    for branch in (far, near):
        assert branch.closed and not branch.notes
    kinds, hz = zip(*[told_by(branch) for branch in (far, near)], strict=True)
    assert kinds[0] == kinds[1] == 2 * ["BP"] + 4 * ["LP"]
    assert hz[1] == pytest.approx(hz[0], rel=1e-9)


def told_by(branch):
    """Kinds and frequencies of the special points of a branch, sorted."""
    told = sorted((s.kind, s.frequency_hz) for s in branch.special_points)
    return [kind for kind, _ in told], [hz for _, hz in told]


def test_a_symmetric_branch_is_followed_with_a_coarse_flow_map(facing):
    """Its orbits are as asymmetric as the error of the map, which breaks no symmetry."""
    coarse = FlowMap(facing_stops(), FlowOptions(rtol=3e-5))
    branch = continue_branch(solve_orbit(coarse, 8.0), (6.5, 8.5))
    assert branch.stop_reasons == ("end of the frequency range",) * 2
    fine = [s.frequency_hz for s in facing.special_points]
    assert [s.frequency_hz for s in branch.special_points] == pytest.approx(fine, rel=3e-5)


@pytest.mark.parametrize("rtol", [1e-3])
def test_symmetric_orbits_are_no_more_asymmetric_than_taken_for_error(rtol):
    """What is more than that breaks the symmetry, for a walk."""
    coarse = FlowMap(facing_stops(), FlowOptions(rtol=rtol))
    branch = continue_branch(solve_orbit(coarse, 8.0), (6.5, 8.5))
    largest = max(asymmetry(p.orbit.problem, p.orbit.point) for p in branch.nodes)
    assert largest < 0.5 * BY_TOLERANCE * rtol


def test_one_branch_point_passed_twice_far_from_the_start_is_told_twice(facing):
    """Only one beside the start is met by both legs in the same place."""
    special = next(s for s in facing.special_points if s.kind == "BP")

    def leg(arclength):
        there = replace(special, point=replace(special.point, arclength=arclength))
        return Leg([], [there], [], "", None)

    for arclength, told in ((0.5, 2), (1e-5, 1)):
        legs = _without_repeat(leg(arclength), leg(arclength))
        assert sum(len(one.special_points) for one in legs) == told


def test_only_orbits_beside_a_crossing_lie_on_it():
    """Not beside a fold, and not where the branches of an imperfect pitchfork come close."""
    symmetric = continue_branch(solve_orbit(between_stops(), 11.0), (11.0, 11.8))
    pitchfork = next(s for s in symmetric.special_points if s.kind == "BP")
    assert lies_on_crossing(pitchfork.point, 1e-8)
    (beside,) = symmetric.at(pitchfork.frequency_hz * (1.0 + 1e-7))
    assert lies_on_crossing(in_frequency(beside), 3e-7)
    assert not lies_on_crossing(in_frequency(beside), 1e-7)
    (near,) = continue_branch(solve_orbit(between_stops(1e-6), 11.0), (11.0, 11.4)).at(
        pitchfork.frequency_hz
    )
    assert not lies_on_crossing(in_frequency(near), 1.0)
    bent = make_one_dof(stops=[Stop("middle", stiffness=5.17e9, gap=2e-6)])
    resonance = continue_branch(solve_orbit(bent, 15.0), (15.0, 30.0))
    fold = next(s for s in resonance.special_points if s.kind == "LP")
    assert not lies_on_crossing(fold.point, 1.0)


@pytest.mark.parametrize("beyond", [0.0, 2e-8, -2e-8])
def test_no_step_ends_where_branches_cross(beyond):
    """The first step would."""
    symmetric = continue_branch(solve_orbit(between_stops(), 11.0), (11.0, 11.8))
    pitchfork = next(s for s in symmetric.special_points if s.kind == "BP")
    (before,) = symmetric.at(pitchfork.frequency_hz * (1.0 - 1e-5))
    weights = before.problem.metric(before.point)
    reach = metric_length(weights, pitchfork.orbit.point - before.point) + beyond
    walk = continue_branch(before, (11.0, 11.4), options=ContinuationOptions(first_step=reach))
    nearest = min(metric_length(weights, p.point - pitchfork.orbit.point) for p in walk.points)
    assert 2.9e-7 < nearest < reach
    assert [s.kind for s in walk.special_points].count("BP") == 1


@pytest.mark.parametrize("first_step", [0.02, pytest.param(0.01, marks=pytest.mark.slow)])
def test_ill_conditioned_pitchforks_are_crossed_and_located_from_any_step(first_step):
    """Between equal Hertz stops without gaps: beside a pitchfork Newton's method ends at 1e-8."""
    system = System.from_modal(
        [10.0], {"a": [1.0]}, modal_damping=0.03,
        stops=[Stop("a", stiffness=1.2e8, direction=side) for side in (1, -1)],
        excitation=[HarmonicForce("a", 0.15)],
    )  # fmt: skip
    options = ContinuationOptions(first_step=first_step)
    symmetric = continue_branch(solve_orbit(system, 12.0), (10.0, 17.0), options=options)
    assert symmetric.stop_reasons == ("end of the frequency range",) * 2
    crossings = [s for s in symmetric.special_points if s.kind == "BP"]
    assert len(crossings) == 4
    half = continue_branch(switch_at_branch_point(crossings[-1])[0].orbit, (10.0, 17.0))
    met = sorted(s.frequency_hz for s in half.special_points if s.kind == "BP")
    assert met == pytest.approx([s.frequency_hz for s in crossings[-2:]], rel=1e-10)


@pytest.fixture(scope="module")
def with_pitchfork():
    """A symmetric branch that ends behind a pitchfork."""
    stops = [Stop("a", stiffness=1.07e9, direction=side) for side in (1, -1)]
    system = System.from_modal(
        [18.98], {"a": [0.597]}, modal_damping=0.00647, stops=stops,
        excitation=[Unbalance("a", 2.49e-5)],
    )  # fmt: skip
    return continue_branch(solve_orbit(system, 20.0), (20.0, 26.8))


@pytest.mark.parametrize(
    ("beside", "first_step"),
    [(-1e-5, 0.01), (-3e-6, 0.002), (-1e-6, 0.01), (1e-6, 0.002), (3e-6, 0.01), (1e-5, 0.002)],
)
def test_walk_that_begins_beside_a_pitchfork_crosses_it(with_pitchfork, beside, first_step):
    """The way from its start to where Newton's method ends is too short to tell where to go on."""
    pitchfork = [s for s in with_pitchfork.special_points if s.kind == "BP"][-1]
    start = with_pitchfork.at(pitchfork.frequency_hz * (1.0 + beside))[0]
    options = ContinuationOptions(first_step=first_step)
    branch = continue_branch(start, (25.0, 26.8), options=options)
    assert branch.stop_reasons == ("end of the frequency range",) * 2
    assert special_points(branch) == [("BP", pytest.approx(pitchfork.frequency_hz, rel=1e-10))]
    assert all(is_symmetric(orbit) for orbit in branch.points)


@pytest.mark.parametrize(
    "first_step", [0.01, *(pytest.param(step, marks=pytest.mark.slow) for step in (0.02, 0.00144))]
)
def test_two_pitchforks_within_a_step_are_found(first_step):
    """The look between two points of the symmetric branch meets its halves."""
    stops = [Stop("a", stiffness=4e6, gap=-5.66e-6, direction=side) for side in (1, -1)]
    system = System.from_modal(
        [10.0], {"a": [1.0]}, modal_damping=0.0077, stops=stops,
        excitation=[HarmonicForce("a", 0.29256)],
    )  # fmt: skip
    options = ContinuationOptions(first_step=first_step)
    branch = continue_branch(solve_orbit(system, 6.4), (6.4, 7.5), options=options)
    crossings = [s.frequency_hz for s in branch.special_points if s.kind == "BP"]
    fine = ContinuationOptions(first_step=0.005, max_step=0.005)
    again = continue_branch(solve_orbit(system, 6.6), (6.6, 6.8), options=fine)
    expected = [s.frequency_hz for s in again.special_points if s.kind == "BP"]
    assert len(expected) == 2
    assert sorted(crossings) == pytest.approx(sorted(expected), rel=1e-9)
    short = continue_branch(solve_orbit(system, 6.4), (6.4, 7.0), options=options)
    assert short.notes or [s.kind for s in short.special_points].count("BP") == 2


@pytest.mark.parametrize("before_hz", [54.71, 54.72])
def test_neimark_sacker_points_in_a_small_part_of_a_step_are_found(before_hz):
    """One pair enters the unit circle and another one leaves it within 0.5 % of a step."""
    displacements = [-5.915547e-06, 5.06379e-07, -2.0477e-07, 1.48661e-08]
    velocities = [1.960015e-05, 1.296549e-04, -7.218754e-04, 1.250489e-04]
    guess = np.array([*displacements, *velocities])
    branch = continue_branch(
        solve_orbit(four_modes(0.001), 54.6987555, guess=guess), (54.6826, 54.73), options=SHORT
    )
    points = []
    for hz in (before_hz, 54.6987555, 54.6851172, 54.6826535):
        orbit = branch.at(hz)[0]
        way = orbit.point - points[-1].orbit.point if points else np.zeros(orbit.point.size)
        length = metric_length(orbit.problem.metric(orbit.point), way)
        arclength = points[-1].arclength + length if points else 0.0
        points.append(replace(start_point(in_frequency(orbit), -1.0), arclength=arclength))
    z, a, b, c = points
    found = special_points_between(a, b, z, c)
    walked = [s for s in branch.special_points if 54.6851172 < s.frequency_hz < 54.6987555]
    assert [s.kind for s in found] == ["NS", "NS", "PD"]
    assert [s.frequency_hz for s in found] == [
        pytest.approx(s.frequency_hz, rel=1e-9) for s in reversed(walked)
    ]


def two_modes_between_stops(
    frequencies: list[float], shape: list[float], damping: float, stiffness: float, gap: float
) -> System:
    stops = [Stop("m", stiffness, 1.0, gap=gap, direction=side) for side in (1, -1)]
    return System.from_modal(
        frequencies, {"m": shape}, modal_damping=damping, stops=stops,
        excitation=[Unbalance("m", 4.92e-6)],
    )  # fmt: skip


@pytest.mark.parametrize("first_step", [0.01, pytest.param(0.003, marks=pytest.mark.slow)])
def test_halves_of_a_broken_symmetry_are_not_left_beside_a_grazing_point(first_step):
    """A step with a new contact may bend by any angle: towards the symmetric branch, too."""
    system = two_modes_between_stops([8.77, 33.98], [0.721, 0.32], 0.0286, 1.38e5, 7.57e-6)
    symmetric = continue_branch(solve_orbit(system, 9.0), (9.0, 14.0))
    pitchforks = [s for s in symmetric.special_points if s.kind == "BP"]
    ends = [pytest.approx(s.frequency_hz, rel=1e-9) for s in pitchforks]
    options = ContinuationOptions(first_step=first_step)
    for pitchfork in pitchforks:
        half = switch_at_branch_point(pitchfork)[0].orbit
        branch = continue_branch(half, (7.0, 16.0), options=options)
        assert branch.stop_reasons == ("closed branch", "closed branch")
        assert min(asymmetry(orbit.problem, orbit.point) for orbit in branch.points) > 1e-7
        assert sorted(s.frequency_hz for s in branch.special_points if s.kind == "BP") == ends


@pytest.mark.parametrize(
    "which", [0, *(pytest.param(other, marks=pytest.mark.slow) for other in (1, 2))]
)
def test_branches_are_switched_at_a_pitchfork_beside_a_grazing_point(which):
    """The halves bend within 1e-6 of the pitchforks, where they touch one stop more or less."""
    system = two_modes_between_stops([9.5, 48.3], [0.4325, -0.4255], 0.0272, 2.19e6, 3.38e-6)
    symmetric = continue_branch(solve_orbit(system, 9.0), (9.0, 14.1))
    found = symmetric.special_points
    grazing = np.array([s.frequency_hz for s in found if s.kind == "GR"])
    beside = [
        s for s in found if s.kind == "BP" and np.abs(grazing / s.frequency_hz - 1.0).min() < 2e-5
    ]
    assert len(beside) == 3
    start, other = switch_at_branch_point(beside[which])
    branch = continue_branch(start.orbit, (6.0, 40.0))
    assert branch.contains(other.orbit)
    assert branch.stop_reasons == ("closed branch", "closed branch")
    turns = [s.frequency_hz for s in branch.special_points if s.kind == "BP"]
    assert len(turns) == 2 and pytest.approx(beside[which].frequency_hz, rel=1e-9) in turns


@pytest.mark.parametrize(
    ("frequencies", "shapes", "damping", "stiffnesses", "gaps", "flip_hz"),
    [
        ([9.96, 49.6], [[0.523, 0.852], [-0.218, -0.124]], 0.00799, [9.08e5, 3.04e5],
         [4.24e-6, 2.64e-6], 11.234673865),
        pytest.param(
            [10.5, 47.6], [[-0.492, -0.342], [0.436, 0.562]], 0.0141, [6.8e6, 7.18e6],
            [5.23e-6, 3.87e-6], 11.186347125, marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_folds_of_a_doubled_branch_beside_its_flip_are_told(
    frequencies, shapes, damping, stiffnesses, gaps, flip_hz
):
    """A grazing point beside the flip turns the branch: its fold is not the flip itself."""
    stops = [
        Stop(at, stiffness, 1.0, gap=gap, direction=side)
        for at, stiffness, gap, side in zip("mn", stiffnesses, gaps, (1, -1), strict=True)
    ]
    system = System.from_modal(
        frequencies, dict(zip("mn", shapes, strict=True)), modal_damping=damping, stops=stops,
        excitation=[Unbalance("m", 4.92e-6)],
    )  # fmt: skip
    parent = continue_branch(solve_orbit(system, 9.0), (9.0, 14.0))
    flip = min(
        (s for s in parent.special_points if s.kind == "PD"),
        key=lambda s: abs(s.frequency_hz - flip_hz),
    )
    branch = continue_branch(switch_at_flip(flip).orbit, (9.0, 14.0))
    fold = next(
        s for s in branch.special_points
        if s.kind == "LP" and abs(s.frequency_hz / flip_hz - 1.0) < 1e-5
    )  # fmt: skip
    first, second = fold.orbit.problem.nodes(fold.orbit.point).reshape(2, -1)
    assert np.linalg.norm(first - second) > 1e-5 * np.linalg.norm(first)
    assert np.abs(fold.orbit.multipliers - 1.0).min() < 1e-6
    told = [s.point.arclength for s in branch.special_points if s.kind != "GR"]
    for a, b in pairwise(branch.nodes[1:-1]):
        before, after = (int((np.abs(p.orbit.multipliers) > 1.0).sum()) for p in (a, b))
        if before != after:
            assert any(a.arclength <= place <= b.arclength for place in told)


@pytest.mark.slow
def test_folds_on_both_sides_of_a_grazing_point_beside_a_flip_are_no_branch_points():
    """A doubled branch turns twice within 5e-4 of its flip, with a grazing point between."""
    displacements = [-7.020505e-06, 8.182906e-07, 2.297047e-08, 1.579987e-08]
    velocities = [3.705808e-05, -1.086527e-04, -4.737369e-05, -2.274158e-05]
    guess = np.array([*displacements, *velocities])
    range_hz = 38.4535, 38.454
    parent = continue_branch(solve_orbit(four_modes(0.01), 38.4538, 3, guess=guess), range_hz)
    (flip,) = parent.special_points
    start = switch_at_flip(flip).orbit
    branch = continue_branch(start, range_hz)
    assert [s.kind for s in branch.special_points] == ["LP", "GR", "LP"]
    fine = ContinuationOptions(first_step=2e-6, max_step=1e-5, max_points=60)
    walked = continue_branch(start, range_hz, options=fine).frequency_hz
    inner = walked[1:-1]
    turns = inner[(inner - walked[:-2]) * (inner - walked[2:]) > 0.0]
    folds = [s.frequency_hz for s in branch.special_points if s.kind == "LP"]
    assert sorted(folds) == pytest.approx(sorted(turns), abs=1e-8)
    assert abs(folds[0] - folds[1]) > 1e-6
