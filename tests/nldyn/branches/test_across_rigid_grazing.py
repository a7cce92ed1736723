"""Branches that go on where they graze a rigid stop, against closed forms of one impact."""

import math

import numpy as np
import pytest
from event_driven import PiecewiseLinear
from one_impact import OneImpact
from scipy.linalg import expm
from scipy.optimize import brentq

from nldyn import (
    ContinuationOptions,
    HarmonicForce,
    RigidStop,
    System,
    continue_branch,
    impacts,
    normal_form,
    solve_orbit,
)
from nldyn.branches.endings import Ending

GAP, RESTITUTION = 0.3, 0.8
TURN = 2.0 * math.pi
TWO = np.eye(2), np.array([[2.0, -1.0], [-1.0, 3.0]]), np.array([[0.1, -0.05], [-0.05, 0.15]])
# matrices, force, calm start, range; whether both orbits exist on the same side
ACROSS = {
    "in its place": (([[1.0]], [[1.0]], [[0.1]]), [1.0], 0.45, (0.25, 0.5), False),
    "overdamped": (([[1.0]], [[1.0]], [[2.5]]), [1.0], 0.3, (0.15, 0.35), False),
    "beside it": (TWO, [1.0, 0.3], 0.5, (0.36, 0.55), True),
}


def system_of(matrices, force, stops):
    mass, stiffness, damping = matrices
    rows = np.eye(len(force))
    return System.from_matrices(
        mass, stiffness, {f"x{i}": row for i, row in enumerate(rows)}, damping=damping,
        stops=stops, excitation=[HarmonicForce(f"x{i}", f) for i, f in enumerate(force)],
    )  # fmt: skip


def across(name):
    matrices, force, hz, range_hz, _ = ACROSS[name]
    system = system_of(matrices, force, [RigidStop("x0", RESTITUTION, GAP)])
    return continue_branch(solve_orbit(system, hz), range_hz)


@pytest.mark.parametrize("name", ACROSS)
def test_the_calm_branch_goes_on_with_the_slight_impact(name):
    """Down to a speed of 1e-5 of the orbit's, each orbit is that of the closed form."""
    matrices, force, _, _, folds = ACROSS[name]
    branch = across(name)
    shape = OneImpact(*matrices, force, np.eye(len(force))[0], GAP, RESTITUTION)
    touch = next(special for special in branch.special_points if special.orbit.impacts == 0)
    assert abs(shape.response(touch.orbit.omega)[0]) == pytest.approx(GAP, rel=1e-10)
    hit = [orbit for orbit in branch.points if orbit.impacts == 1]
    calm = [orbit for orbit in branch.points if orbit.impacts == 0]
    assert min(impacts(orbit).speed[0] for orbit in hit) < 1e-4 * GAP * touch.orbit.omega
    near = min(hit, key=lambda orbit: abs(orbit.frequency_hz - touch.frequency_hz))
    assert (near.frequency_hz > touch.frequency_hz) == folds
    assert min(orbit.frequency_hz for orbit in calm) > touch.frequency_hz
    for orbit in hit:
        speed = impacts(orbit).speed[0]
        exact = [motion.speed for motion in shape.motions(orbit.omega, 1)]
        # the height that the motion would reach goes with v², and v with the root of it
        fastest = orbit.max_abs_displacement * orbit.omega
        assert min(abs(speed**2 - v**2) for v in exact) < 1e-10 * fastest**2


@pytest.mark.parametrize("name", ACROSS)
def test_from_either_side_the_branch_is_the_same(name):
    branch = across(name)
    hit = next(orbit for orbit in branch.points if orbit.impacts == 1)
    again = continue_branch(hit, branch.course.limits)
    told, found = (
        sorted((special.kind, special.frequency_hz) for special in b.special_points)
        for b in (branch, again)
    )
    assert [kind for kind, _ in found] == [kind for kind, _ in told]
    assert [hz for _, hz in found] == pytest.approx([hz for _, hz in told], rel=1e-9)


def test_a_branch_that_has_crossed_a_grazing_is_extended_to_the_same_digits():
    matrices, force, hz, (low, high), _ = ACROSS["in its place"]
    system = system_of(matrices, force, [RigidStop("x0", RESTITUTION, GAP)])
    orbit = solve_orbit(system, hz)
    longer = continue_branch(continue_branch(orbit, (0.33, high)), (low, high))
    whole = continue_branch(orbit, (low, high))
    assert longer.frequency_hz.tolist() == whole.frequency_hz.tolist()
    assert [s.kind for s in longer.special_points] == [s.kind for s in whole.special_points]


def between_two_stops(restitution=RESTITUTION):
    stops = [RigidStop("x0", e, GAP, side) for side, e in ((1, RESTITUTION), (-1, restitution))]
    return system_of(ACROSS["in its place"][0], [1.0], stops)


def pair_of_impacts():
    return OneImpact([[1.0]], [[1.0]], [[0.1]], [1.0], [1.0], GAP, RESTITUTION)


def test_two_stops_grazed_at_once_by_symmetry_are_passed_by_a_pair_of_impacts():
    """The slower one of both mirrored motions of the closed form, from either side."""
    shape = pair_of_impacts()
    branch = continue_branch(solve_orbit(between_two_stops(), 0.45), (0.25, 0.5))
    (touch,) = branch.special_points
    assert touch.orbit.impacts == 0
    assert abs(shape.response(touch.orbit.omega)[0]) == pytest.approx(GAP, rel=1e-10)
    form = normal_form(touch)
    assert (touch.kind, form.name, form.side) == ("GR", "multiple rigid grazing", 1)
    assert "without an impact, with an impact at each touch" in form.sentence
    pairs = [orbit for orbit in branch.points if orbit.impacts]
    assert len(pairs) > 10
    assert min(impacts(orbit).speed[0] for orbit in pairs) < 1e-4 * GAP * touch.orbit.omega
    for orbit in pairs:
        exact = shape.motions(orbit.omega, 0.5)[-1].speed
        fastest = orbit.max_abs_displacement * orbit.omega
        assert np.abs(impacts(orbit).speed ** 2 - exact**2).max() < 1e-10 * fastest**2
    again = continue_branch(pairs[len(pairs) // 2], (0.25, 0.5))
    (back,) = again.special_points
    assert back.frequency_hz == pytest.approx(touch.frequency_hz, rel=1e-10)
    assert not again.notes
    assert min(orbit.impacts for orbit in again.points) == 0


def test_two_stops_grazed_at_once_are_passed_without_symmetry():
    """The stops differ in their restitution: the orbit behind has an impact at each of them."""
    branch = continue_branch(solve_orbit(between_two_stops(0.6), 0.45), (0.25, 0.5))
    (touch,) = branch.special_points
    assert abs(pair_of_impacts().response(touch.orbit.omega)[0]) == pytest.approx(GAP, rel=1e-10)
    assert [reason.ending for reason in branch.stop_reasons] == [Ending.RANGE_END] * 2
    last = max((orbit for orbit in branch.points if orbit.impacts), key=lambda o: o.frequency_hz)
    hits = impacts(last)
    assert last.frequency_hz == pytest.approx(0.5)
    assert (hits.impulse / hits.speed)[np.argsort(hits.stop)] == pytest.approx([1.8, 1.6])


def test_two_stops_tuned_to_graze_at_once_end_a_branch_where_three_kinds_of_orbits_begin():
    """Each alone is that of the closed form: the other mass stays clear of its stop."""
    matrices, force = TWO, [1.0, 0.3]
    omega, rows = TURN * 0.52, np.eye(2)
    linear = OneImpact(*matrices, force, rows[0], 1.0, 1.0)
    gaps = np.abs(linear.response(omega)[:2])
    stops = [RigidStop(f"x{i}", 0.8, gaps[i]) for i in range(2)]
    branch = continue_branch(solve_orbit(system_of(matrices, force, stops), 0.56), (0.48, 0.58))
    (touch,) = branch.special_points
    assert touch.frequency_hz == pytest.approx(0.52, rel=1e-10)
    assert branch.stop_reasons[0].ending is Ending.GRAZES_RIGID
    sentence = normal_form(touch).sentence
    assert "above 0.52 Hz without an impact; below 0.52 Hz" in sentence
    for i, j in ((0, 1), (1, 0)):
        assert f"with an impact at touch {i + 1} alone" in sentence
        shape = OneImpact(*matrices, force, rows[i], gaps[i], 0.8)
        assert not [m for m in shape.motions(1.0001 * omega, 1) if m.speed < 0.01]
        motion = shape.motions(0.9999 * omega, 1)[-1]
        assert 0.0 < motion.speed < 0.01
        way = [
            shape.state(0.9999 * omega, motion, motion.phase + p)[j]
            for p in np.linspace(0.0, TURN, 2000)
        ]
        assert max(way) < gaps[j]


def test_a_branch_with_rest_steps_over_all_impacts_that_pass_a_phase_of_shooting():
    """Some 60 impacts a period pass it one after another; each orbit comes back to its state."""
    matrices, force = ([[1.0]], [[1.0]], [[0.1]]), [1.0]
    system = system_of(matrices, force, [RigidStop("x0", RESTITUTION, GAP)])
    branch = continue_branch(solve_orbit(system, 0.035), (0.033, 0.039))
    assert not branch.notes
    assert len(branch.points) < 60
    for orbit in branch.points[:: max(len(branch.points) // 3, 1)]:
        exact = PiecewiseLinear(
            *map(np.array, matrices), np.array(force), np.zeros(1), [([1.0], GAP, RESTITUTION)],
            orbit.omega,
        )  # fmt: skip
        state = orbit.problem.flow.to_modal(orbit.problem.nodes(orbit.point)[:1])[0]
        state = state * system.participation["x0"][0]
        end, _, rested = exact.run(state, TURN / orbit.omega)
        assert rested > 0.1 * TURN / orbit.omega
        assert np.abs(end - state).max() < 1e-9


def test_a_near_miss_right_behind_an_impact_is_seen():
    """Strongly damped, each bounce is shorter: the branch wins impact after impact by grazing."""
    matrices, force, hz, *_ = ACROSS["overdamped"]
    system = system_of(matrices, force, [RigidStop("x0", RESTITUTION, GAP)])
    branch = continue_branch(solve_orbit(system, hz), (0.0935, 0.35))
    assert branch.stop_reasons[0].ending is Ending.RANGE_END
    won = [special.orbit.impacts for special in branch.special_points if special.kind == "GR"]
    assert won == [7, 6, 5, 4, 3, 2, 1, 0]


@pytest.mark.parametrize("range_hz", [(0.08, 0.1), (0.12, 0.17)])
def test_steps_of_any_length_find_the_same_special_points(range_hz):
    """Impacts pass a phase of shooting at 0.087 and 0.158 Hz, in long steps and in short ones."""
    matrices, force, *_ = ACROSS["in its place"]
    system = system_of(matrices, force, [RigidStop("x0", RESTITUTION, GAP)])
    orbit = solve_orbit(system, 0.5 * sum(range_hz))
    long, short = (
        continue_branch(
            orbit, range_hz, options=ContinuationOptions(first_step=0.005, max_step=step)
        )
        for step in (0.2, 0.005)
    )
    told, found = (
        sorted((special.kind, special.frequency_hz) for special in branch.special_points)
        for branch in (short, long)
    )
    assert not long.notes
    assert [kind for kind, _ in found] == [kind for kind, _ in told]
    assert [hz for _, hz in found] == pytest.approx([hz for _, hz in told], rel=1e-9)


def test_a_flip_right_beside_a_grazing_is_told_or_noted():
    """The multiplier of six impacts comes from minus infinity: it passes -1, however near.

    All grazings count, also where the last step leads from the range to orbits with rest.
    """
    damped = [[1.0]], [[1.0]], [[3.0]]
    system = system_of(damped, [1.0], [RigidStop("x0", 0.3, GAP)])
    branch = continue_branch(solve_orbit(system, 0.1345), (0.134083, 0.1346))
    assert [special.kind for special in branch.special_points] == ["GR", "PD", "GR"]
    lost = branch.special_points[0].frequency_hz
    last = min(branch.points, key=lambda orbit: orbit.frequency_hz)
    assert last.impacts == 6
    assert -1.0 < last.multipliers.real.min() < 0.0
    (note,) = branch.notes
    assert note.startswith(f"special points near {lost:.8g} Hz may be missing")


def test_an_impact_right_before_a_grazing_is_not_left_out_with_it():
    """Two masses on a spring of a hundred times the frequency, tuned to graze 0.047 rad behind.

    The multiplier of the second impact over its speed is that of the closed form of the first:
    flight to it, what it makes of a small change, and flight to the touch. The extremes beside the
    touch are 0.015 rad away.
    """
    omega, fast, mass = 1.7, 170.0, 1.5239841666482334
    reduced = mass / (1.0 + mass)
    spring = fast**2 * reduced * np.array([[1.0, -1.0], [-1.0, 1.0]])
    ground = np.diag([1.0 + mass, 0.0])
    matrices = np.diag([1.0, mass]), ground + spring, 0.1 * ground + 0.04 / fast * spring
    force, e = [1.0 + mass, 0.0], 0.9
    shape = OneImpact(*matrices, force, [0.0, 1.0], GAP, e)
    motion = shape.motions(omega, 1)[0]
    later = brentq(
        lambda p: shape.state(omega, motion, motion.phase + p)[3], 4.3 / 100.0, 5.2 / 100.0,
        xtol=1e-16,
    )  # fmt: skip
    top = shape.state(omega, motion, motion.phase + later)
    assert top[1] == pytest.approx(GAP, rel=1e-12)
    flown, back = (expm(shape.rates * p / omega) for p in (later, TURN - later))
    impact = np.linalg.solve(flown @ back, shape.map_between(omega, 1, *motion[:3]))
    kick = np.array([0.0, 0.0, 0.0, 1.0])
    pace = shape.rates @ top + shape.push * math.cos(motion.phase + later)
    growth = (1.0 + e) * pace[3] * (flown @ impact @ back @ kick)[1]

    system = system_of(matrices, force, [RigidStop("x1", e, GAP)])
    begin = shape.state(omega * 0.98, shape.motions(omega * 0.98, 1)[0], TURN).reshape(2, 2)
    rows = np.array([system.participation[name] for name in ("x0", "x1")])
    start = np.concatenate([np.linalg.solve(rows, part) for part in begin])
    orbit = solve_orbit(system, 0.98 * omega / TURN, guess=start)
    branch = continue_branch(orbit, (0.975 * omega / TURN, 1.01 * omega / TURN))
    touch = next(special for special in branch.special_points if special.kind == "GR")
    # its height goes with 0.002 of ln ω, and is known to 1e-12 of the orbit's size
    assert touch.frequency_hz == pytest.approx(omega / TURN, rel=2e-9)
    assert normal_form(touch).coefficient.value == pytest.approx(growth, rel=1e-6)
    assert [reason.ending for reason in branch.stop_reasons] == [Ending.RANGE_END] * 2
    assert {orbit.impacts for orbit in branch.points} == {1, 2}


def test_grazings_that_accumulate_end_a_branch_where_impacts_come_to_rest():
    """The frequency told parts orbits with very many impacts from those that rest."""
    matrices, force = ([[1.0]], [[1.0]], [[0.1]]), [1.0]
    system = system_of(matrices, force, [RigidStop("x0", RESTITUTION, GAP)])
    branch = continue_branch(solve_orbit(system, 0.06299), (0.062, 0.063))
    told = branch.stop_reasons[0]
    assert told.ending is Ending.TO_REST
    assert not branch.notes
    grazings = [special for special in branch.special_points if special.kind == "GR"]
    assert grazings[0].orbit.impacts > 25
    gaps = np.diff([special.frequency_hz for special in grazings])
    assert gaps[1:3] / gaps[:2] == pytest.approx(1.0 / RESTITUTION, rel=0.01)
    limit = float(told.values["place"].removesuffix(" Hz"))
    behind, before = (solve_orbit(system, limit * (1.0 + off)) for off in (-1e-5, 1e-5))
    assert behind.rests
    assert not before.rests
    assert before.impacts > 30
