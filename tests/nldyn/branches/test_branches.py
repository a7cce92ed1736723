"""Other branches: doubled, closed, quasi-periodic; how a walk ends, steps and can be stopped."""

from __future__ import annotations

import itertools
import pickle

import numpy as np
import pytest
from independent import Motion
from legs import leg_from
from problems import RANGE_HZ, in_frequency, make_one_dof, torus_system
from scipy.optimize import minimize_scalar

from nldyn import (
    ContinuationOptions,
    ConvergenceError,
    FlowMap,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    diagram,
    find_orbits,
    solve_orbit,
)
from nldyn.base.errors import LocateError
from nldyn.base.resources import example
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.bifurcations.within_step import special_points_between
from nldyn.branches.arclength import Stepper
from nldyn.branches.continuation import start_point
from nldyn.branches.peaks import lowest_orbit, resonance_peaks
from nldyn.orbits import OrbitSearchOptions
from nldyn.orbits.bordered import FREE
from nldyn.orbits.critical_functions import branch_point_test, flip_test, torus_test
from nldyn.orbits.orbit import Orbit, minimal_period, same_orbit
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene


@pytest.fixture(scope="module")
def torus_branch():
    return continue_branch(solve_orbit(torus_system(), 60.0), (5.0, 80.0))


# --- flips and doubled branches ----------------------------------------------------------------


def flips(branch):
    return [s for s in branch.special_points if s.kind == "PD"]


@pytest.mark.parametrize("index", [-1, -2])
def test_doubled_branch_starts_at_the_flip(harmonic_branch, index):
    """Near a flip the amplitude of the period-2 part goes with the root of the distance."""
    flip = flips(harmonic_branch)[index]
    distances, parts = [], []
    for amplitude in (8e-3, 1.6e-2):
        point = switch_at_flip(flip, amplitude)
        orbit = point.orbit
        assert (orbit.period, minimal_period(orbit)) == (2, 2)
        distances.append(orbit.frequency_hz - flip.frequency_hz)
        nodes = orbit.problem.nodes(orbit.point)
        half = len(nodes) // 2
        parts.append(np.linalg.norm(nodes[:half] - nodes[half:]))
        assert abs(distances[-1]) < 1e-3 * flip.frequency_hz
    assert parts[1] / parts[0] == pytest.approx(2.0, rel=0.02)
    assert distances[1] / distances[0] == pytest.approx(4.0, rel=0.1)


def test_doubled_branch_joins_two_flips(harmonic_branch):
    """From the flip at 8.71 Hz to the one at 10.43 Hz, both ways round."""
    low, high = (f for f in flips(harmonic_branch) if 8.0 < f.frequency_hz < 11.0)
    for first, last in ((high, low), (low, high)):
        leg = leg_from(switch_at_flip(first), (5.7, 90.0))
        nodes, reason = leg.nodes, leg.reason
        assert reason.startswith("joins the branch of period 1 at the flip")
        end = nodes[-1].orbit
        assert end.frequency_hz == pytest.approx(last.frequency_hz, rel=1e-12)
        assert abs(end.multipliers - 1.0).min() < 1e-9
        assert minimal_period(end) == 1


@pytest.mark.parametrize("amplitude", [1e-2, 1.0001e-4, 1e-4, 9.999e-5, 9.99e-5, 9.9e-5, 1e-6])
def test_a_doubled_branch_can_be_started_right_beside_its_flip(harmonic_branch, amplitude):
    """Down to 1e-10 of the frequency beside it, which tells its orbits apart no longer."""
    low, high = (f for f in flips(harmonic_branch) if 8.0 < f.frequency_hz < 11.0)
    orbit = switch_at_flip(high, amplitude).orbit
    assert abs(orbit.frequency_hz / high.frequency_hz - 1.0) < 1e-5
    branch = continue_branch(orbit, RANGE_HZ)
    assert all(reason.startswith("joins the branch") for reason in branch.stop_reasons)
    ends = sorted(node.orbit.frequency_hz for node in (branch.nodes[0], branch.nodes[-1]))
    assert ends == pytest.approx([low.frequency_hz, high.frequency_hz], rel=1e-12)
    assert len(branch.points) > 20
    assert all(special.kind != "BP" for special in branch.special_points)


@pytest.fixture(scope="module")
def doubled_branch(harmonic_branch):
    flip = next(f for f in flips(harmonic_branch) if 8.0 < f.frequency_hz < 11.0)
    return continue_branch(switch_at_flip(flip).orbit, RANGE_HZ)


def beside(fold, distance):
    """An orbit of the branch at an arclength from a fold."""
    problem, across = fold.orbit.problem, fold.orbit.problem.metric(fold.orbit.point)
    place = fold.orbit.point + distance * fold.point.tangent
    return Orbit.of(problem, problem.correct(place, across * fold.point.tangent), "middle")


@pytest.mark.parametrize("distance", [-1e-8, -1e-10, 0.0, 1e-11, 1e-9])
def test_a_branch_started_at_one_of_its_folds_has_the_same_special_points(
    harmonic_branch, doubled_branch, distance
):
    for whole in (harmonic_branch, doubled_branch):
        for fold in (s for s in whole.special_points if s.kind == "LP"):
            low, high = 0.99 * fold.frequency_hz, 1.01 * fold.frequency_hz
            branch = continue_branch(beside(fold, distance), (low, high))
            met = sorted(s.frequency_hz for s in branch.special_points)
            known = [s for s in whole.special_points if low < s.frequency_hz < high]
            on_it = [s for s in known if branch.contains(s.orbit)]
            assert fold in on_it
            assert met == pytest.approx(sorted(s.frequency_hz for s in on_it), rel=1e-9)


def test_a_branch_started_at_a_fold_stays_in_the_range(harmonic_branch):
    """Beside its end it has few points if both sides of the fold lie beyond.

    Not at the very end, where rounding decides on which side of it the fold lies.
    """
    folds = [s for s in harmonic_branch.special_points if s.kind == "LP"]
    assert len(folds) > 2
    for fold in folds:
        hz = fold.frequency_hz
        counts = []
        beside = 1e-9 * hz
        for range_hz in ((0.99 * hz, hz + beside), (hz - beside, 1.01 * hz)):
            branch = continue_branch(fold.orbit, range_hz)
            met = [node.orbit.frequency_hz for node in branch.nodes]
            assert min(met) >= range_hz[0] * (1.0 - 1e-14)
            assert max(met) <= range_hz[1] * (1.0 + 1e-14)
            counts.append(len(met))
        assert min(counts) <= 5 < 10 < max(counts)


def test_a_flat_flank_is_no_fold():
    """Beside the top of a sharp resonance all change is of the amplitude, none of the frequency."""
    system = System.from_modal(
        [10.0], {"tip": [1.0]}, modal_damping=2e-6,
        excitation=[HarmonicForce("tip", 1e-4)], stops=[Stop("tip", 1e7, gap=10.0)],
    )  # fmt: skip
    start = solve_orbit(system, 9.99998)
    for range_hz in ((9.9, 9.99998), (9.99998, 10.1), (9.9, 10.1)):
        branch = continue_branch(start, range_hz)
        assert start.frequency_hz in [node.orbit.frequency_hz for node in branch.nodes]
        assert np.all(np.diff([node.arclength for node in branch.nodes]) > 0.0)


def test_flip_that_is_not_found_leaves_no_point_twice(harmonic_branch, monkeypatch):
    def fails(*_, **__):
        raise ConvergenceError("no orbit")

    flip = next(f for f in flips(harmonic_branch) if 8.0 < f.frequency_hz < 11.0)
    start = switch_at_flip(flip)
    monkeypatch.setattr("nldyn.bifurcations.period_doubling.correct", fails)
    leg = leg_from(start, (5.7, 90.0))
    nodes, reason = leg.nodes, leg.reason
    assert reason.startswith("meets the branch of period 1 beyond 10.4")
    assert np.all(np.diff([node.arclength for node in nodes]) > 0.0)


def test_switching_needs_a_flip(harmonic_branch):
    fold = next(s for s in harmonic_branch.special_points if s.kind == "LP")
    with pytest.raises(SystemModelError, match="needs a PD point, got LP"):
        switch_at_flip(fold)


# --- closed branches -----------------------------------------------------------------------------


def test_isola_is_walked_round_once(one_dof):
    """The 1/2 isola between 9.06 and 9.47 Hz closes on itself; its ends are folds."""
    isolas = []
    for orbit in find_orbits(one_dof, 9.3, 2):
        branch = continue_branch(orbit, RANGE_HZ)
        if branch.stop_reason.startswith("closed"):
            isolas.append(branch)
    assert isolas
    for branch in isolas:
        assert branch.stop_reasons == ("closed branch", "closed branch")
        frequencies = branch.frequency_hz
        assert frequencies.min() == pytest.approx(9.0624, abs=2e-3)
        assert frequencies.max() == pytest.approx(9.4742, abs=2e-3)
        folds = [s.frequency_hz for s in branch.special_points if s.kind == "LP"]
        assert len(folds) % 2 == 0
        assert min(folds) <= frequencies.min() and max(folds) >= frequencies.max()
        assert branch.span_hz == (min(folds), max(folds))
        assert all(minimal_period(orbit) == 2 for orbit in branch.points)
        assert branch.contains(branch.points[0])
    ends = [sorted(s.frequency_hz for s in b.special_points if s.kind == "LP") for b in isolas]
    for other in ends[1:]:
        assert other == pytest.approx(ends[0], rel=1e-9)


def test_top_of_an_isola_is_found_wherever_the_walk_starts(one_dof):
    branch = next(
        b for b in (continue_branch(o, RANGE_HZ) for o in find_orbits(one_dof, 9.3, 2)) if b.closed
    )
    tops = sorted(p.height for p in resonance_peaks(branch))
    assert tops
    highest = int(np.argmax(branch.max_abs_displacement))
    starts = [branch.points[(highest + k) % len(branch.points)] for k in (-1, 0, 1)]
    starts += [p.orbit for p in resonance_peaks(branch)]
    for start in starts:
        again = continue_branch(start, RANGE_HZ)
        assert sorted(p.height for p in resonance_peaks(again)) == pytest.approx(tops, rel=1e-7)


# --- Neimark-Sacker ------------------------------------------------------------------------------


def torus_points(branch):
    return [s for s in branch.special_points if s.kind == "NS"]


def test_neimark_sacker_point_has_a_complex_pair_on_the_unit_circle(torus_branch):
    points = torus_points(torus_branch)
    assert len(points) == 2
    for point in points:
        mu = point.orbit.multipliers
        pair = mu[np.argsort(np.abs(np.abs(mu) - 1.0))[:2]]
        assert np.abs(np.abs(pair) - 1.0).max() < 1e-7
        assert abs(pair[0].imag) > 0.1  # a pair, not a neutral saddle
        assert pair[0] == pytest.approx(np.conj(pair[1]), abs=1e-12)
        assert abs(torus_test(mu)) < 1e-7


def test_neimark_sacker_pair_under_runge_kutta(torus_branch):
    for point in torus_points(torus_branch):
        orbit = point.orbit
        start = orbit.states(np.array([0.0]))[0]
        _, jacobian, _ = Motion(torus_system()).run(start, (0.0, 2 * np.pi), orbit.omega)
        moduli = np.abs(np.linalg.eigvals(jacobian))
        assert np.sort(np.abs(moduli - 1.0))[1] < 1e-6


def test_pair_crosses_the_unit_circle_at_the_neimark_sacker_point(torus_branch):
    nodes = torus_branch.nodes
    for point in torus_points(torus_branch):
        i = next(k for k, n in enumerate(nodes) if n.arclength > point.point.arclength)
        inside, outside = sorted(abs(nodes[k].orbit.largest_multiplier) for k in (i - 1, i))
        assert inside < 1.0 < outside


def test_motion_beyond_the_neimark_sacker_point_is_a_torus(torus_branch):
    """Stroboscopic states fill a closed curve: bounded, never returning, no period up to 12."""
    first, last = sorted(s.frequency_hz for s in torus_points(torus_branch))
    frequency = 0.5 * (first + last)
    flow = FlowMap(torus_system())
    orbit = next(o for o in torus_branch.at(frequency) if abs(o.largest_multiplier.imag) > 0.1)
    assert not orbit.stable
    start = orbit.problem.nodes(orbit.point)[0] * (1 + 1e-3)
    phases = 2 * np.pi * np.arange(1501)
    states = flow.shoot(start[None], phases, orbit.omega, sensitivities=False, chained=True).ends[
        -400:
    ]
    size = np.ptp(states, axis=0).max()
    for period in range(1, 13):
        apart = np.abs(states[period:] - states[:-period]).max(axis=1)
        assert apart.max() > 1e-2 * size
    assert np.abs(states).max() < 100 * np.abs(start).max()


def test_neutral_saddle_is_not_a_neimark_sacker_point(torus_branch):
    """Two more times the test changes sign, where real multipliers pass μ₁μ₂ = 1."""
    points = [s.point.arclength for s in torus_points(torus_branch)]
    saddles = 0
    for a, b in itertools.pairwise(torus_branch.nodes):
        if torus_test(a.orbit.multipliers) * torus_test(b.orbit.multipliers) < 0.0:
            if any(a.arclength <= s <= b.arclength for s in points):
                continue
            saddles += 1
            real = [m.real for m in a.orbit.multipliers if m.imag == 0.0]
            assert max(real) > 1.0
    assert saddles == 2


@pytest.fixture(scope="module", params=[0.05, 0.02])
def lightly_damped(request):
    """The two-mode harmonic branch at 0.1 % damping between 37.5 and 46 Hz."""
    system = build_system(load_scene(example("two_dof_xi_0.001.toml")))
    options = ContinuationOptions(max_step=request.param)
    return system, continue_branch(solve_orbit(system, 38.0), (37.5, 46.0), options=options)


def test_neimark_sacker_point_close_to_a_fold_is_found(lightly_damped):
    """Within 1e-3 of arclength the branch folds, passes a neutral saddle, and a pair comes in.

    The torus test changes sign twice there; only the number of unstable multipliers tells.
    """
    system, branch = lightly_damped
    close = [s for s in branch.special_points if 42.4336 < s.frequency_hz < 42.43362]
    assert sorted(s.kind for s in close) == ["LP", "NS"]
    orbit = next(s.orbit for s in close if s.kind == "NS")
    start = orbit.states(np.array([0.0]))[0]
    _, jacobian, _ = Motion(system).run(start, (0.0, 2 * np.pi), orbit.omega)
    pair = max(np.linalg.eigvals(jacobian), key=lambda mu: mu.imag)
    assert pair.imag > 0.1
    assert abs(pair) == pytest.approx(1.0, abs=1e-5)


def test_number_of_unstable_multipliers_changes_at_special_points_only(lightly_damped):
    _, branch = lightly_damped
    where = [s.point.arclength for s in branch.special_points if s.kind != "GR"]
    assert len(where) > 5
    for a, b in itertools.pairwise(branch.nodes):
        if not any(a.arclength < x < b.arclength for x in where):
            outside = [int(np.sum(np.abs(n.orbit.multipliers) > 1.0)) for n in (a, b)]
            assert outside[0] == outside[1]


# --- test functions on made-up multipliers -------------------------------------------------------


def test_flip_test_changes_sign_at_every_flip():
    for other in (0.3, -0.4, 5.0):
        below, above = np.array([-0.99, other]), np.array([-1.01, other])
        assert flip_test(below) * flip_test(above) < 0.0
    assert flip_test(np.array([-1.0, 0.5])) == 0.0


def test_branch_point_test_changes_sign_at_one():
    below, above = np.array([0.99, 0.4]), np.array([1.01, 0.4])
    assert branch_point_test(below) * branch_point_test(above) < 0.0
    assert branch_point_test(np.array([1.0, 0.5])) == 0.0


def test_torus_test_is_the_bialternate_product():
    """det(Φ ⊙ Φ - I) in the basis e_i ∧ e_j is the product of μ_i μ_j - 1."""
    rng = np.random.default_rng(3)
    phi = rng.standard_normal((4, 4))
    pairs = list(itertools.combinations(range(4), 2))
    product = np.array(
        [[phi[p, r] * phi[q, s] - phi[q, r] * phi[p, s] for r, s in pairs] for p, q in pairs]
    )
    mu = np.linalg.eigvals(phi).astype(complex)
    scale = np.prod([1 + abs(mu[i] * mu[j]) for i, j in pairs])
    exact = np.linalg.det(product - np.eye(6)) / scale
    assert torus_test(mu) == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize("angle", [0.1, 1.0, 2.0, 3.0])
def test_torus_test_changes_sign_where_a_pair_leaves_the_circle(angle):
    pair = np.exp([1j * angle, -1j * angle])
    rest = np.array([0.7, -0.2 + 0j])
    inside, outside = (torus_test(np.concatenate([r * pair, rest])) for r in (0.999, 1.001))
    assert inside * outside < 0.0


# --- walking -------------------------------------------------------------------------------------


def test_walk_can_be_stopped_between_two_points_and_taken_up_again(one_dof):
    start = start_point(in_frequency(solve_orbit(one_dof, 45.0)), 1.0)
    walk = Stepper(start, (40.0, 60.0), ContinuationOptions())
    some = list(itertools.islice(walk, 4))
    assert [p.arclength for p in some] == sorted(p.arclength for p in some)
    assert some[0] is start
    assert walk.stop_reason == "not finished"
    rest = Stepper(some[-1], (40.0, 60.0), ContinuationOptions())
    points = list(rest)
    assert rest.stop_reason == "end of the frequency range"
    assert points[-1].orbit.frequency_hz == pytest.approx(60.0, rel=1e-14)


def test_walk_stops_after_the_most_points_it_may_compute(one_dof):
    branch = continue_branch(
        solve_orbit(one_dof, 45.0), (5.7, 90.0), options=ContinuationOptions(max_points=3)
    )
    assert branch.stop_reasons == ("3 points", "3 points")
    assert len(branch.points) == 7


def test_tangent_is_that_of_a_difference_along_the_branch(harmonic_branch):
    nodes = harmonic_branch.nodes
    for i in (40, 120, 250):
        node = nodes[i]
        weights = node.orbit.problem.metric(node.orbit.point)
        assert np.sum(weights * node.tangent**2) == pytest.approx(1.0, rel=1e-12)
        problem, point = node.orbit.problem, node.orbit.point
        h = 1e-5
        row = weights * node.tangent
        ends = [problem.correct(point + s * h * node.tangent, row).point for s in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * h)
        off = np.sqrt(np.sum(weights * (slope - node.tangent) ** 2))
        assert off < 1e-4


def test_progress_is_told_every_frequency(one_dof):
    heard = []
    branch = continue_branch(solve_orbit(one_dof, 45.0), (40.0, 50.0), progress=heard.append)
    assert len(heard) >= len(branch.points)
    assert min(heard) == pytest.approx(40.0) and max(heard) == pytest.approx(50.0)


def test_smaller_steps_give_the_same_special_points(one_dof):
    orbit = solve_orbit(one_dof, 14.0)
    coarse = continue_branch(orbit, (8.0, 15.0))
    fine = continue_branch(
        orbit, (8.0, 15.0),
        options=ContinuationOptions(max_step=0.03, max_angle=0.1),
    )  # fmt: skip
    assert len(fine.points) > 1.5 * len(coarse.points)
    for a, b in zip(coarse.special_points, fine.special_points, strict=True):
        assert a.kind == b.kind
        assert a.frequency_hz == pytest.approx(b.frequency_hz, rel=1e-9)


def test_points_from_another_process_are_free_as_before(harmonic_branch):
    """Walks ask for the one object that stands for no condition."""
    node = harmonic_branch.nodes[0]
    assert pickle.loads(pickle.dumps(node)).condition is node.condition is FREE


@pytest.mark.parametrize("middle_fails", [True, False])
def test_branch_notes_where_special_points_may_be_missing(one_dof, monkeypatch, middle_fails):
    def fails(*_):
        raise LocateError("no root found")

    monkeypatch.setattr("nldyn.branches.leg.special_points_between", fails)
    if middle_fails:
        monkeypatch.setattr("nldyn.branches.leg.Chord.at", fails)
    branch = continue_branch(solve_orbit(one_dof, 33.0), (32.9, 33.1))
    pieces = (1 if middle_fails else 16) * (len(branch.points) - 1)
    assert len(branch.notes) == pieces
    assert branch.notes[0].endswith("Hz may be missing: no root found")
    found = diagram(
        one_dof, (32.9, 33.1), [1], search_points=1, search=OrbitSearchOptions(starts=1)
    )
    assert any(
        note.startswith("branch 01 harmonic: special points between 3") for note in found.notes
    )


def test_no_special_points_between_the_same_two_points_in_either_direction(harmonic_branch):
    """Around the flip at 33.65 Hz, forwards and backwards: one flip each."""
    flip = flips(harmonic_branch)[-1]
    nodes = harmonic_branch.nodes
    i = next(k for k, n in enumerate(nodes) if n.arclength > flip.point.arclength)
    forward = special_points_between(nodes[i - 1], nodes[i])
    there, here = (node.reversed() for node in nodes[i - 1 : i + 1])
    backward = special_points_between(here, there)
    assert [s.kind for s in forward] == [s.kind for s in backward] == ["PD"]
    assert forward[0].frequency_hz == pytest.approx(backward[0].frequency_hz, rel=1e-9)


def test_branch_of_a_linear_system_is_its_receptance():
    system = System.from_modal(
        [13.1, 40.0], {"m": [0.6, 0.5]}, modal_damping=0.02, excitation=[Unbalance("m", 1e-5)]
    )
    branch = continue_branch(solve_orbit(system, 20.0), (5.0, 60.0))
    omega = 2 * np.pi * branch.frequency_hz
    natural = 2 * np.pi * np.array([13.1, 40.0])
    modal = np.array([0.6, 0.5]) ** 2 / (
        natural**2 - omega[:, None] ** 2 + 0.04j * natural * omega[:, None]
    )
    exact = np.abs(modal.sum(axis=1)) * 1e-5 * omega**2
    np.testing.assert_allclose(branch.max_abs_displacement, exact, rtol=1e-10)
    assert branch.special_points == ()
    assert branch.stable.all()


def test_lowest_orbit_is_the_antiresonance_of_the_receptance():
    natural, shape = 2 * np.pi * np.array([13.1, 40.0]), np.array([0.6, 0.5])

    def amplitude(hz):
        omega = 2 * np.pi * hz
        return abs(np.sum(shape**2 / (natural**2 - omega**2 + 0.04j * natural * omega))) * omega**2

    system = System.from_modal(
        natural / (2 * np.pi), {"m": shape}, modal_damping=0.02, excitation=[Unbalance("m", 1e-5)]
    )
    branch = continue_branch(solve_orbit(system, 20.0), (5.0, 60.0))
    exact = minimize_scalar(amplitude, bounds=(20.0, 39.0), method="bounded")
    found = lowest_orbit(branch, (20.0, 39.0))
    assert found.max_abs_displacement == pytest.approx(1e-5 * exact.fun, rel=1e-8)
    assert found.frequency_hz == pytest.approx(exact.x, rel=1e-4)
    assert lowest_orbit(branch, (70.0, 80.0)) is None


JUMP = {
    "frequencies_hz": [10.0, 26.2377],
    "participation": {"m": [0.635, 1.4387]},
    "modal_damping": 0.003,
    "stops": [Stop("m", stiffness=7.84e8, gap=1e-5)],
    "excitation": [Unbalance("m", 4.92e-6)],
}


@pytest.mark.parametrize("max_step", [0.05, 0.1])
def test_steps_near_a_linear_resonance_stay_on_the_branch(max_step):
    """The forced response alone is far larger than the motion with the stop here."""
    system = System.from_modal(**JUMP)
    guess = np.array([1.858e-5, -3.373e-6, 5.041e-5, -8.235e-5])
    orbit = solve_orbit(system, 10.0, guess=guess)
    ends = [
        continue_branch(orbit, (9.95, 10.05), options=ContinuationOptions(max_step=step)).points[0]
        for step in (max_step, 0.01)
    ]
    assert ends[0].frequency_hz == pytest.approx(ends[1].frequency_hz)
    assert same_orbit(*ends)


@pytest.mark.parametrize("start_hz", [35.42, 35.55, 35.56])
def test_long_steps_do_not_jump_over_a_fold(start_hz):
    """At 35.615 Hz a 1/2 branch folds close to another one, which lies straight ahead."""
    system = build_system(load_scene(example("two_dof_xi_0.01.toml")))
    guess = np.array([-1.6706e-05, -2.6698e-07, 6.2759e-05, 5.0713e-04])
    orbit = solve_orbit(system, start_hz, 2, guess=guess)
    long, short = (
        continue_branch(orbit, (35.3, 35.9), options=options)
        for options in (ContinuationOptions(first_step=0.05), ContinuationOptions(max_step=0.01))
    )
    assert [s.kind for s in short.special_points] == [s.kind for s in long.special_points]
    for a, b in zip(long.special_points, short.special_points, strict=True):
        assert a.frequency_hz == pytest.approx(b.frequency_hz, rel=1e-9)


def test_softer_stop_and_larger_unbalance_leave_the_special_points():
    """With zero gap only stiffness · force^(p-1) matters: the special points do not move."""
    base = continue_branch(solve_orbit(make_one_dof(), 20.0), (12.0, 20.0))
    scaled = continue_branch(
        solve_orbit(
            make_one_dof(
                stops=[Stop("middle", stiffness=5.17e8)],
                excitation=[Unbalance("middle", 4.92e-4)],
            ),
            20.0,
        ),
        (12.0, 20.0),
    )
    assert [s.kind for s in base.special_points] == [s.kind for s in scaled.special_points]
    assert len(base.special_points) >= 4
    for a, b in zip(base.special_points, scaled.special_points, strict=True):
        assert a.frequency_hz == pytest.approx(b.frequency_hz, rel=1e-9)
