"""Continuation in any parameter, curves of special points and of held quantities."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from legs import leg_from
from problems import RANGE_HZ, between_stops, make_one_dof, torus_system

from nldyn import (
    ContinuationOptions,
    ConvergenceError,
    Damper,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    LocateError,
    Parameter,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    continue_constant,
    continue_special,
    normal_form,
    solve_orbit,
    switch_branch,
)
from nldyn.base.resources import example
from nldyn.bifurcations import codimension_two as codimension
from nldyn.bifurcations.codimension_two import along_tori, flip_coefficient, is_torus
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.branches.endings import Ending
from nldyn.curves import refine_special
from nldyn.orbits.bordered import OrbitFamily
from nldyn.orbits.conditions import Singular, bialternate, max_abs_displacement, peak_force
from nldyn.orbits.orbit import Orbit, minimal_period
from nldyn.orbits.shooting import shooting_problem
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene
from nldyn.system.chart import EVERY_MODE, Chart, value_of, with_value

MASS, NATURAL, RATIO = 2.0, 2.0 * math.pi * 10.0, 0.03


def test_a_curve_that_begins_at_the_end_of_a_range_ends_there():
    """A stop without dissipation: beyond the end there are no systems."""
    orbit = solve_orbit(make_one_dof(), 25.3)
    curve = continue_branch(orbit, (0.0, 1.0), parameter="dissipation")
    assert curve.stop_reasons == ("end of the range of dissipation",) * 2
    assert curve.values[[0, -1]].tolist() == [0.0, 1.0]


@pytest.mark.parametrize(("parameter", "low"), [("dissipation", 0.0), ("exponent", 1.0)])
def test_curves_of_folds_begin_at_the_bound_of_a_number(parameter, low):
    """Newton's method would leave it by rounding, on one of the two folds at least."""
    stop = Stop.linear("m", 2e4, gap=2e-4)
    system = System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.03, stops=[stop], excitation=[HarmonicForce("m", 3.0)]
    )
    branch = continue_branch(solve_orbit(system, 7.0), (6.0, 8.0))
    folds = [special for special in branch.special_points if special.kind == "LP"]
    assert len(folds) == 2
    for fold in folds:
        curve = continue_special(fold, ("frequency_hz", parameter), ((6.0, 8.0), (low, low + 1.0)))
        ends = curve.values[[0, -1], 1]
        assert low in ends
        here = curve.values[np.flatnonzero(curve.values[:, 1] == low), 0]
        assert np.abs(here - fold.frequency_hz).min() < 1e-9


def linear_stop(gap=1e-3, stiffness=2e4, unbalance=2e-4) -> System:
    return System.from_matrices(
        [[MASS]], [[MASS * NATURAL**2]], {"m": [1.0]}, modal_damping=RATIO,
        stops=[Stop.linear("m", stiffness, gap=gap)], excitation=[Unbalance("m", unbalance)],
    )  # fmt: skip


def amplitude(frequency_hz, unbalance=2e-4):
    """Steady amplitude of the oscillator without its stop."""
    omega = 2.0 * math.pi * np.asarray(frequency_hz)
    dynamic = np.hypot(NATURAL**2 - omega**2, 2.0 * RATIO * NATURAL * omega)
    return unbalance * omega**2 / (MASS * dynamic)


def of_kind(branch, kind, low=0.0, high=1e9):
    return [s for s in branch.special_points if s.kind == kind and low < s.frequency_hz < high]


def fold(harmonic_branch):
    return of_kind(harmonic_branch, "LP", 12.2, 12.4)[0]


def flip(harmonic_branch):
    return of_kind(harmonic_branch, "PD", 15.0, 16.0)[0]


def grazing(harmonic_branch):
    return of_kind(harmonic_branch, "GR", 5.7, 6.0)[0]


# --- special points on their own defining systems ------------------------------------------------


def test_every_special_point_of_the_branch_solves_its_defining_system(harmonic_branch):
    assert len(harmonic_branch.special_points) > 15
    for special in harmonic_branch.special_points:
        refined = refine_special(special)
        assert refined.residual < 1e-11
        assert refined.frequency_hz == pytest.approx(special.frequency_hz, rel=2e-10)


def test_branches_leave_a_point_that_knows_no_direction(harmonic_branch, symmetric_branch):
    """Those of the branch on which it was found, and at a branch point also along that."""
    special = flip(harmonic_branch)
    (one,), (other,) = switch_branch(refine_special(special)), switch_branch(special)
    assert one.orbit.period == 2
    assert one.orbit.frequency_hz == pytest.approx(other.orbit.frequency_hz, rel=1e-9)
    special = of_kind(symmetric_branch, "BP")[0]
    all_ways = [node.orbit for node in switch_branch(refine_special(special))]
    assert len(all_ways) == 4
    for node in switch_branch(special):
        away = [np.abs(orbit.point - node.orbit.point).max() for orbit in all_ways]
        assert min(away) < 1e-6 * np.abs(node.orbit.point).max()
    with pytest.raises(SystemModelError, match="no other branch leaves the LP point"):
        switch_branch(refine_special(fold(harmonic_branch)))


@pytest.mark.parametrize(("kind", "low", "target"), [("LP", 12.2, 1.0), ("PD", 15.0, -1.0)])
def test_newton_finds_a_special_point_from_an_orbit_beside_it(harmonic_branch, kind, low, target):
    special = of_kind(harmonic_branch, kind, low)[0]
    nodes = harmonic_branch.nodes
    i = next(k for k, n in enumerate(nodes) if n.arclength > special.point.arclength)
    for node in nodes[i - 2], nodes[i + 1]:
        beside = SimpleNamespace(kind=kind, orbit=node.orbit)
        refined = refine_special(beside)
        assert refined.frequency_hz == pytest.approx(special.frequency_hz, rel=1e-10)
        assert np.abs(refined.orbit.multipliers - target).min() < 1e-9


def test_a_special_point_can_be_located_in_another_parameter(harmonic_branch):
    """A flip solved for the gap at its frequency is a flip in frequency at that gap."""
    orbit = harmonic_branch.at(15.9)[0]
    in_gap = refine_special(SimpleNamespace(kind="PD", orbit=orbit), "gap")
    assert in_gap.frequency_hz == pytest.approx(15.9, rel=1e-14)
    back = refine_special(SimpleNamespace(kind="PD", orbit=in_gap.orbit))
    assert back.frequency_hz == pytest.approx(15.9, rel=1e-10)
    assert abs(in_gap.values[0]) > 1e-9


def test_branch_point_of_doubled_orbits_is_the_flip(harmonic_branch):
    """The harmonic branch, run through twice, meets the doubled branch at its flip."""
    special = flip(harmonic_branch)
    orbit = harmonic_branch.at(special.frequency_hz * 1.001)[0]
    problem = shooting_problem(orbit.problem.flow, 2)
    nodes = np.tile(orbit.problem.nodes(orbit.point), (2, 1))
    twice = Orbit(
        problem,
        np.append(nodes.ravel(), orbit.point[-1]),
        orbit.monodromy @ orbit.monodromy,
        orbit.error,
        orbit.observe,
    )
    found = refine_special(SimpleNamespace(kind="BP", orbit=twice))
    assert found.residual < 1e-10
    assert found.frequency_hz == pytest.approx(special.frequency_hz, rel=1e-10)


def between_two_stops(**changes) -> System:
    upper = Stop.linear("m", 3000.0, gap=0.01)
    lower = replace(upper, direction=-1, **changes)
    return System.from_matrices(
        [[1.0]], [[100.0]], {"m": [1.0]}, modal_damping=0.02, stops=[upper, lower],
        excitation=[HarmonicForce("m", 1.0)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def symmetric_branch():
    return continue_branch(solve_orbit(between_two_stops(), 1.0), (0.5, 1.0))


def test_branch_point_at_which_a_symmetry_breaks(symmetric_branch):
    """There the orbit is still its own mirror image half a period later; λ is zero.

    With unequal stops there is no such point: λ stays, in proportion to what they differ by.
    """
    specials = of_kind(symmetric_branch, "BP")
    assert specials
    for special in specials:
        found = refine_special(special)
        assert found.residual < 1e-9
        assert found.frequency_hz == pytest.approx(special.frequency_hz, rel=1e-9)
        first, second = found.orbit.problem.nodes(found.orbit.point)
        assert np.abs(first + second).max() < 1e-10 * np.abs(first).max()
        assert np.abs(found.orbit.multipliers - 1.0).min() < 1e-8
    left = []
    for excess in (1e-6, 4e-6):
        problem = shooting_problem(FlowMap(between_two_stops(gap=0.01 * (1.0 + excess))), 1)
        unequal = replace(found.orbit, problem=problem, motion=None)
        left.append(refine_special(SimpleNamespace(kind="BP", orbit=unequal)).residual)
    assert left[0] > 1e-7
    assert left[1] / left[0] == pytest.approx(4.0, rel=1e-3)


def test_bialternate_product_has_the_products_of_eigenvalues():
    matrix = np.random.default_rng(5).standard_normal((4, 4))
    mu = np.linalg.eigvals(matrix)
    products = [mu[i] * mu[j] for j in range(4) for i in range(j)]
    found = np.linalg.eigvals(bialternate(matrix))
    assert np.sort_complex(found) == pytest.approx(np.sort_complex(products), rel=1e-10)


# --- one parameter -------------------------------------------------------------------------------


def two_modes() -> System:
    return System.from_modal(
        [13.1, 40.0], {"m": [0.635, 0.3], "n": [0.2, -0.6]}, modal_damping=[0.02, 0.03],
        stops=[Stop("m", 1e7, 1.3, gap=1e-6, dissipation=1.0)], dampers=[Damper("n", 3.0)],
        excitation=[Unbalance("m", 1e-5), HarmonicForce("n", 0.02)],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("parameter", "value"),
    [
        (Parameter("gap"), -1e-6),
        (Parameter("stiffness"), 3e7),
        (Parameter("exponent"), 1.6),
        (Parameter("dissipation"), 5.0),
        (Parameter("mass_times_radius"), 2e-5),
        (Parameter("amplitude", 1), 0.1),
        (Parameter("coefficient"), 8.0),
        (Parameter("modal_damping", 1), 0.06),
        (Parameter("natural_frequency_hz", 1), 55.0),
    ],
    ids=lambda x: x.name if isinstance(x, Parameter) else "",
)
def test_end_of_a_continuation_is_the_orbit_of_the_changed_system(parameter, value):
    system = two_modes()
    start = solve_orbit(system, 20.0)
    old = value_of(system, 20.0, parameter)
    curve = continue_branch(start, (min(old, value), max(old, value)), parameter=parameter)
    end = curve.points[0 if value < old else -1]
    assert value_of(end.system, end.frequency_hz, parameter) == pytest.approx(value, rel=1e-14)
    changed = with_value(system, parameter, value)
    again = solve_orbit(FlowMap(changed), 20.0, guess=end.states(np.array([0.0])))
    assert again.max_abs_displacement == pytest.approx(end.max_abs_displacement, rel=1e-7)
    assert again.multipliers == pytest.approx(end.multipliers, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("name", ["exponent", "dissipation", "coefficient"])
def test_a_range_may_end_where_the_parameter_does(name):
    """There is no exponent below 1, and no dissipation or damping below zero."""
    least = 1.0 if name == "exponent" else 0.0
    start = solve_orbit(two_modes(), 20.0)
    value = value_of(start.system, 20.0, Parameter(name))
    curve = continue_branch(start, (least, value), parameter=name)
    assert least in curve.values[[0, -1]]
    assert max(orbit.error for orbit in curve.points) < 1e-9


def test_a_curve_of_flips_ends_at_the_linear_law():
    soft = make_one_dof(stops=[Stop("middle", 1e6, 1.2)])
    branch = continue_branch(solve_orbit(soft, 26.0), (15.0, 40.0))
    special = of_kind(branch, "PD")[0]
    curve = continue_special(special, ("frequency_hz", "exponent"), ((10.0, 60.0), (1.0, 1.3)))
    end = min((curve.points[0], curve.points[-1]), key=lambda p: p.values[1])
    assert end.values[1] == 1.0
    linear = make_one_dof(stops=[Stop("middle", 1e6, 1.0)])
    other = continue_branch(solve_orbit(linear, 26.0), (10.0, 60.0))
    found = np.array([s.frequency_hz for s in of_kind(other, "PD")])
    assert np.abs(found / end.values[0] - 1.0).min() < 1e-8


def test_damping_of_all_modes_at_once():
    system = replace(two_modes(), damping=two_modes().damping * 0.5)
    with pytest.raises(SystemModelError, match="different ratios"):
        value_of(system, 20.0, Parameter("modal_damping", EVERY_MODE))
    same = with_value(with_value(system, Parameter("modal_damping"), 0.02),
                      Parameter("modal_damping", 1), 0.02)  # fmt: skip
    both = with_value(same, Parameter("modal_damping", EVERY_MODE), 0.05)
    assert [value_of(both, 20.0, Parameter("modal_damping", i)) for i in (0, 1, -1)] == [0.05] * 3


@pytest.mark.parametrize("name", ["natural_frequency_hz", "coefficient", "modal_damping"])
def test_derivatives_without_kernels_of_their_own(name):
    """The shooting equations change as the Jacobian says: the error falls with the square."""
    orbit = solve_orbit(two_modes(), 20.0)
    value = value_of(orbit.system, 20.0, Parameter(name))
    family = OrbitFamily.around(orbit, (Chart(Parameter(name), 0.5 * value, 2.0 * value),))
    at = family.at(family.unknowns(orbit))
    misses = []
    for h in (4e-3, 2e-3):
        step = np.zeros(at.point.size)
        step[-1] = h
        change = family.at(at.point + step).residual - at.residual
        misses.append(np.linalg.norm(change - h * at.jacobian[:, -1]))
    assert misses[0] / misses[1] == pytest.approx(4.0, rel=0.05)


# --- two parameters: closed forms ----------------------------------------------------------------


@pytest.fixture(scope="module")
def first_touch():
    """Where the linear oscillator at 8 Hz first touches its stop as the gap closes."""
    orbit = solve_orbit(linear_stop(), 8.0)
    assert orbit.impacts == 0
    curve = continue_branch(orbit, (0.8 * amplitude(8.0), 2e-3), parameter="gap")
    (mark,) = [s for s in curve.special_points if s.kind == "GR"]
    assert mark.value == pytest.approx(amplitude(8.0), rel=1e-11)
    return mark


def test_grazing_in_frequency_and_gap_is_the_linear_resonance_curve(first_touch):
    curve = continue_special(first_touch, ("frequency_hz", "gap"), ((7.0, 12.0), (1e-5, 1e-2)))
    frequency, gap = curve.values.T
    assert frequency[[0, -1]] == pytest.approx([7.0, 12.0], rel=1e-14)
    assert np.abs(gap / amplitude(frequency) - 1.0).max() < 1e-10
    assert gap.max() > 5.0 * gap[0]  # over the resonance


def test_grazing_in_unbalance_and_gap_is_a_straight_line(first_touch):
    """Down to rest, if both ranges end there; the walk on its own scale would have no end."""
    parameters = "mass_times_radius", "gap"
    whole = continue_special(first_touch, parameters, ((0.0, 1e-3), (0.0, 1e-2)))
    assert whole.stop_reasons[0].ending is Ending.SCALES_TO_REST
    assert len(whole.points) < 60
    curve = continue_special(first_touch, parameters, ((1e-4, 1e-3), (1e-5, 1e-2)))
    unbalance, gap = curve.values.T
    assert np.abs(gap / unbalance * 2e-4 / first_touch.value - 1.0).max() < 1e-10
    assert len(curve.points) > 5


def test_folds_of_a_linear_stop_scale_with_unbalance_and_gap():
    """Force and gap times s give displacements times s: multipliers stay as they are."""
    branch = continue_branch(solve_orbit(linear_stop(), 20.0), (6.0, 20.0))
    special = of_kind(branch, "LP")[0]
    curve = continue_special(special, ("mass_times_radius", "gap"), ((5e-5, 1e-3), (1e-5, 1e-2)))
    unbalance, gap = curve.values.T
    assert unbalance.max() > 10.0 * unbalance.min()
    assert np.abs(gap / unbalance / 5.0 - 1.0).max() < 1e-9
    heights = [orbit.max_abs_displacement for orbit in curve.orbits]
    assert np.ptp(heights / gap) < 1e-8 * heights[0] / gap[0]
    for orbit in curve.orbits[:: len(curve.points) // 4]:
        assert orbit.multipliers == pytest.approx(special.orbit.multipliers, abs=1e-8)


@pytest.mark.slow
def test_flips_of_doubled_orbits_scale_with_force_and_stiffness(harmonic_branch):
    """Without a gap, force times s and stiffness times s^(1-p) give displacements times s."""
    start = switch_at_flip(of_kind(harmonic_branch, "PD", 33.0)[0])
    located = leg_from(start, (27.0, 40.0)).special_points
    special = next(s for s in located if s.kind == "PD")
    assert special.orbit.period == 2
    curve = continue_special(
        special, ("mass_times_radius", "stiffness"), ((1e-6, 2e-5), (1e9, 2e10))
    )
    unbalance, stiffness = curve.values.T
    assert unbalance.max() > 4.0 * unbalance.min()
    expected = 5.17e9 * np.sqrt(4.92e-6 / unbalance)
    assert np.abs(stiffness / expected - 1.0).max() < 1e-7


# --- two parameters: against continuation in frequency -------------------------------------------


@pytest.mark.parametrize(
    ("pick", "parameter", "value"),
    [
        (fold, "mass_times_radius", 9e-6),
        (fold, "gap", -1e-7),
        (fold, "stiffness", 2e9),
        (flip, "gap", -3e-7),
        (flip, "modal_damping", 0.03),
        (grazing, "mass_times_radius", 9e-6),
    ],
)
def test_curve_passes_through_the_special_points_of_other_branches(
    one_dof, harmonic_branch, pick, parameter, value
):
    special = pick(harmonic_branch)
    old = value_of(one_dof, 1.0, Parameter(parameter))
    curve = continue_special(
        special, ("frequency_hz", parameter), (RANGE_HZ, (min(old, value), max(old, value)))
    )
    assert curve.residuals.max() < 1e-7
    end = min((curve.points[0], curve.points[-1]), key=lambda p: abs(p.values[1] - value))
    assert end.values[1] == pytest.approx(value, rel=1e-12)
    start = solve_orbit(with_value(one_dof, Parameter(parameter), value), 26.0)
    frequency = end.values[0]
    branch = continue_branch(start, (0.97 * frequency, 26.0))
    found = [s.frequency_hz for s in of_kind(branch, special.kind)]
    assert np.abs(np.array(found) / frequency - 1.0).min() < 1e-8


@pytest.fixture(scope="module")
def torus_curve():
    system = torus_system()
    branch = continue_branch(solve_orbit(system, 20.0), (10.0, 20.0))
    parameters = ("frequency_hz", Parameter("natural_frequency_hz", 1))
    window = ((10.5, 14.0), (30.0, 38.0))
    special, fold = of_kind(branch, "NS")[0], of_kind(branch, "LP")[0]
    return system, *(continue_special(start, parameters, window) for start in (special, fold))


def test_neimark_sacker_curve_keeps_a_pair_on_the_unit_circle(torus_curve):
    _, curve, _ = torus_curve
    for orbit in curve.orbits[1:-1]:
        mu = orbit.multipliers
        assert is_torus(mu)
        assert np.sort(np.abs(np.abs(mu) - 1.0))[1] < 1e-8


def test_neimark_sacker_curve_passes_through_those_of_another_structure(torus_curve):
    system, curve, _ = torus_curve
    parameter = Parameter("natural_frequency_hz", 1)
    crossing = curve.at("natural_frequency_hz", 33.8)
    assert crossing
    branch = continue_branch(solve_orbit(with_value(system, parameter, 33.8), 20.0), (10.0, 20.0))
    frequencies = np.array([s.frequency_hz for s in of_kind(branch, "NS")])
    for orbit in crossing:
        assert np.abs(frequencies / orbit.frequency_hz - 1.0).min() < 1e-8


@pytest.fixture(scope="module")
def four_modes() -> System:
    """The paper's beam with four modes and 1 % damping."""
    return build_system(load_scene(example("four_dof_xi_0.01.toml")))


@pytest.mark.slow
def test_neimark_sacker_curve_is_followed_round_a_narrow_tip():
    """A slight contact makes a tip 4e-6 of the frequency wide; branches at three dampings agree."""
    points = {}
    for ratio in (0.0308, 0.031, 0.0311):
        system = System.from_modal(
            [13.1, 31.0], {"m": [0.6, 0.4], "b": [0.3, -0.7]}, modal_damping=ratio,
            stops=[Stop("m", 5.17e9, gap=5e-6), Stop.linear("b", 3e5, gap=4e-5, direction=-1)],
            excitation=[Unbalance("m", 4.92e-6)],
        )  # fmt: skip
        branch = continue_branch(solve_orbit(system, 11.0), (10.99, 11.26))
        points[ratio] = [s for s in branch.special_points if s.kind == "NS"]
    assert not points[0.0311]
    damping, ranges = Parameter("modal_damping", EVERY_MODE), ((11.2, 11.3), (0.0307, 0.0311))
    curve = continue_special(points[0.0308][0], ("frequency_hz", damping), ranges)
    assert curve.stop_reasons == ("end of the range of modal_damping",) * 2
    assert max(curve.values[:, 1]) < 0.0311
    for ratio in (0.0308, 0.031):
        met = sorted(orbit.frequency_hz for orbit in curve.at("modal_damping", ratio))
        assert met == pytest.approx([s.frequency_hz for s in points[ratio]], rel=1e-9)


def test_symmetry_breaks_on_a_curve_where_both_parameters_keep_it(symmetric_branch):
    """Branches at other forces have their branch points on it, and λ stays zero."""
    special = of_kind(symmetric_branch, "BP")[0]
    window = ((0.3, 2.0), (0.94, 1.01))
    curve = continue_special(special, ("frequency_hz", "amplitude"), window)
    assert curve.residuals.max() < 1e-7
    found = curve.at("amplitude", 0.95)
    assert found
    changed = with_value(between_two_stops(), Parameter("amplitude"), 0.95)
    other = continue_branch(solve_orbit(changed, 1.0), (0.5, 1.0))
    places = np.array([s.frequency_hz for s in of_kind(other, "BP")])
    for orbit in found:
        assert np.abs(places / orbit.frequency_hz - 1.0).min() < 1e-8


def test_a_branch_point_whose_symmetry_goes_is_a_single_point(symmetric_branch):
    special = of_kind(symmetric_branch, "BP")[0]
    with pytest.raises(SystemModelError, match="dissolves when frequency_hz or gap changes"):
        continue_special(special, ("frequency_hz", "gap"), ((0.3, 2.0), (0.005, 0.02)))


# --- points of codimension two -------------------------------------------------------------------


def test_curves_of_flips_and_of_grazing_meet_where_both_say(harmonic_branch):
    """The two are followed by different equations; on the flips' side the curve has a corner."""
    window = ((5.7, 7.2), (-2.5e-7, 1e-9))
    pair = (grazing(harmonic_branch), of_kind(harmonic_branch, "PD", 6.6, 6.7)[0])
    places = []
    for special in pair:
        curve = continue_special(special, ("frequency_hz", "gap"), window)
        places.append([m.values for m in curve.marks if m.kind == "GRPD"])
        (doubled,) = switch_branch(next(m for m in curve.marks if m.kind == "GRPD"))
        assert minimal_period(doubled.orbit) == 2
        assert doubled.orbit.frequency_hz == pytest.approx(places[-1][0][0], rel=1e-3)
    (first,), (second,) = places
    assert first == pytest.approx(second, rel=1e-7)


@pytest.fixture(scope="module")
def preloaded() -> System:
    """Pressed against its stop: softening, as the contact opens with larger amplitudes."""
    return System.from_matrices(
        [[1.0]], [[100.0]], {"m": [1.0]}, modal_damping=0.05,
        stops=[Stop("m", 1e4, gap=-1e-2)], excitation=[HarmonicForce("m", 0.2)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def folds_of_preloaded(preloaded):
    branch = continue_branch(solve_orbit(preloaded, 1.0), (1.0, 12.0))
    folds = of_kind(branch, "LP")
    assert len(folds) == 2
    window = ((1.5, 6.5), (0.02, 0.25))
    return [continue_special(fold, ("frequency_hz", "amplitude"), window) for fold in folds]


def test_curve_through_a_cusp_joins_the_two_folds(folds_of_preloaded):
    """Started at either fold, it passes the same cusp and the same corner at a grazing point."""
    first, second = folds_of_preloaded
    for kind in ("CP", "GRLP"):
        (one,), (other,) = ([m for m in c.marks if m.kind == kind] for c in (first, second))
        assert one.values == pytest.approx(other.values, rel=1e-8)
    for curve in (first, second):
        assert curve.residuals.max() < 1e-10
        assert curve.values[[0, -1], 1] == pytest.approx([0.25, 0.25], rel=1e-14)
    ends = [sorted(curve.values[[0, -1], 0]) for curve in (first, second)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-9)


def test_folds_come_together_in_a_cusp(preloaded, folds_of_preloaded):
    """Two folds beyond it, apart by the distance to the power 3/2, and none before it."""
    (cusp,) = [m for m in folds_of_preloaded[0].marks if m.kind == "CP"]
    frequency, amplitude = cusp.values
    apart = []
    for distance in (-1e-3, 1e-3, 4e-3):
        changed = with_value(preloaded, Parameter("amplitude"), amplitude * (1.0 + distance))
        start = solve_orbit(changed, 1.5 * frequency)
        branch = continue_branch(start, (0.8 * frequency, 1.5 * frequency))
        folds = [s.frequency_hz for s in of_kind(branch, "LP")]
        assert len(folds) == (0 if distance < 0.0 else 2)
        if folds:
            apart.append(abs(folds[1] - folds[0]))
    assert apart[1] / apart[0] == pytest.approx(8.0, rel=0.02)


def test_special_points_of_four_modes(four_modes):
    """Each solves its defining system; grazing and Neimark-Sacker curves meet in one GRNS."""
    branch = continue_branch(solve_orbit(four_modes, 25.6), (25.0, 26.6))
    assert {s.kind for s in branch.special_points} == {"LP", "PD", "NS", "GR"}
    for special in branch.special_points:
        refined = refine_special(special)
        assert refined.residual < 1e-10
        assert refined.frequency_hz == pytest.approx(special.frequency_hz, rel=1e-9)
    window = ((25.0, 26.0), (3.5e-6, 5.2e-6))
    places = []
    for start in (of_kind(branch, "GR")[0], of_kind(branch, "NS")[0]):
        curve = continue_special(start, ("frequency_hz", "mass_times_radius"), window)
        places += [m.values for m in curve.marks if m.kind == "GRNS"]
    assert len(places) == 2
    assert places[0] == pytest.approx(places[1], rel=1e-7)


def test_coefficient_of_a_flip_tells_on_which_side_doubled_orbits_are(harmonic_branch):
    """Positive: they are where the orbit itself is unstable (Kuznetsov 2004, section 5.4)."""
    signs = set()
    flips = of_kind(harmonic_branch, "PD")
    for special in flips:
        condition = Singular.of("PD", special.orbit)
        b = flip_coefficient(special.orbit, condition.left, condition.right)
        doubled = switch_at_flip(special, 5e-3).orbit
        single = solve_orbit(
            special.orbit.problem.flow,
            doubled.frequency_hz,
            guess=special.orbit.states(np.array([0.0])),
        )
        unstable = bool(single.multipliers.real.min() < -1.0)
        assert (b > 0.0) == unstable
        signs.add(b > 0.0)
    assert len(flips) == 8
    assert signs == {True, False}


def test_generalised_flip_is_where_the_normal_form_changes_its_sign(harmonic_branch):
    """The coefficient along the curve and that of `normal_form` are computed in different ways."""
    special = of_kind(harmonic_branch, "PD", 12.7, 12.8)[0]
    window = ((12.0, 14.0), (0.014, 0.065))
    curve = continue_special(special, ("frequency_hz", "modal_damping"), window)
    (mark,) = [m for m in curve.marks if m.kind == "GPD"]
    signs = []
    for share in (0.995, 1.005):
        (orbit,) = curve.at("modal_damping", share * mark.values[1])
        form = normal_form(SimpleNamespace(kind="PD", orbit=orbit, frequency_hz=orbit.frequency_hz))
        signs.append(form.coefficient.sign)
    assert sorted(signs) == [-1, 1]


@pytest.mark.parametrize(
    ("along", "held", "name", "target"),
    [
        ("along_folds", [1.0], "LPPD", -1.0),
        ("along_folds", [1.0], "R1", 1.0),
        ("along_folds", [1.0], "LPNS", None),
        ("along_flips", [-1.0], "LPPD", 1.0),
        ("along_flips", [-1.0], "R2", -1.0),
        ("along_flips", [-1.0], "PDNS", None),
        ("along_tori", [np.exp(1.2j), np.exp(-1.2j)], "LPNS", 1.0),
        ("along_tori", [np.exp(1.2j), np.exp(-1.2j)], "PDNS", -1.0),
        ("along_tori", [np.exp(1.2j), np.exp(-1.2j)], "NSNS", None),
        ("along_branch_points", [1.0], "R1", 1.0),
        ("along_branch_points", [1.0], "BPPD", -1.0),
        ("along_branch_points", [1.0], "BPNS", None),
    ],
)
def test_second_points_are_told_by_the_other_multipliers(monkeypatch, along, held, name, target):
    """A real multiplier passes its target, or a pair the unit circle: only that test changes."""
    for coefficient in ("fold_coefficient", "flip_coefficient"):
        monkeypatch.setattr(codimension, coefficient, lambda *_: 1.0)
    tests = []
    for size in (0.99, 1.01):
        pair = size * np.exp([0.7j, -0.7j])
        moving = pair if target is None else np.array([size * target])
        mu = np.concatenate([held, moving, [0.3 + 0.1j, 0.3 - 0.1j]])
        condition = Singular("LP", np.ones(1), np.ones(1))
        arguments = (mu,) if along == "along_branch_points" else (condition, None, mu)
        tests.append(getattr(codimension, along)(*arguments))
    changed = [key for key in tests[0] if tests[0][key] * tests[1][key] < 0.0]
    assert changed == [name]


@pytest.mark.parametrize(
    ("name", "kind", "angle"),
    [("R3", "NS", 2.0 * math.pi / 3.0), ("R4", "NS", 0.5 * math.pi), ("R1", "NS", 0.0)],
)
def test_resonances_are_told_by_the_angle_of_the_pair(name, kind, angle):
    rest = np.array([0.3 + 0.1j, 0.3 - 0.1j])
    values = []
    for turned in (angle - 0.01, angle + 0.01):
        pair = (
            np.exp([1j * turned, -1j * turned]) if angle else [1.0 + turned, 1.0 / (1.0 + turned)]
        )
        mu = np.concatenate([pair, rest])
        values.append(along_tori(None, None, mu)[name])
    if angle:
        assert values[0] * values[1] < 0.0
    else:  # behind the resonance the pair is real
        assert max(values) < 0.0


def test_fold_and_neimark_sacker_curves_share_their_resonances(torus_curve):
    """Where the angle of the pair comes to zero, a second multiplier of a fold is 1, too."""
    _, tori, folds = torus_curve
    first = sorted(tuple(m.values) for m in tori.marks if m.kind == "R1")
    second = sorted(tuple(m.values) for m in folds.marks if m.kind == "R1")
    assert len(first) == 2
    assert np.array(first) == pytest.approx(np.array(second), rel=1e-7)
    assert all(reason.endswith("at a resonance") for reason in tori.stop_reasons)


# --- held quantities -----------------------------------------------------------------------------


def finer_orbit(orbit: Orbit) -> Orbit:
    flow = FlowMap(orbit.system, FlowOptions(rtol=1e-12))
    return solve_orbit(flow, orbit.frequency_hz, guess=orbit.states(np.array([0.0])))


def test_peak_force_is_held_in_frequency_and_gap(one_dof):
    start = solve_orbit(one_dof, 26.0)
    target = 1.1 * peak_force(start)
    curve = continue_constant(
        start, "peak_force", ("frequency_hz", "gap"), ((20.0, 32.0), (-5e-6, 2e-5)), value=target
    )
    assert curve.residuals.max() < 1e-9
    assert np.ptp(curve.values[:, 1]) > 1e-6
    for orbit in curve.orbits[:: len(curve.points) // 6]:
        again = finer_orbit(orbit)
        recorded = max(impact.force for impact in again.impact_list)
        assert recorded == pytest.approx(target, rel=1e-7)


@pytest.mark.parametrize(("times", "first"), [(0.2, "frequency_hz"), (4.0, "mass_times_radius")])
def test_a_value_far_from_the_starts_is_walked_to(one_dof, times, first):
    """Also over a fold: the force falls to a fifth on another part of the branch only."""
    start = solve_orbit(one_dof, 26.0)
    target = times * peak_force(start)
    window = {"frequency_hz": (11.0, 36.0), "mass_times_radius": (1e-6, 1e-4)}[first]
    curve = continue_constant(
        start, "peak_force", (first, "gap"), (window, (-1e-7, 1e-7)), value=target
    )
    assert curve.residuals.max() < 1e-9
    assert [peak_force(o) for o in curve.orbits] == pytest.approx([target] * len(curve.orbits))


def test_a_curve_that_ends_where_another_force_gets_as_large_says_so():
    """Two stops; both are pressed with 50 N at that end, one of them with less at the other."""
    system = System.from_modal(
        [11.0, 27.0], {"a": [0.8, 0.5], "b": [0.3, -0.9]}, modal_damping=[0.01, 0.02],
        stops=[
            Stop("a", stiffness=2e8, gap=7e-4),
            Stop("a", against="b", stiffness=1e6, exponent=1.0, gap=1e-3),
        ],
        excitation=[Unbalance("a", 2e-4, phase_deg=30.0), HarmonicForce("b", 3.0)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 9.0), (9.0, 20.0))
    start = min(branch.at(14.4), key=lambda orbit: abs(peak_force(orbit) - 50.0))
    parameters, window = ("frequency_hz", Parameter("gap", 0)), ((14.3, 14.6), (5.8e-4, 7.2e-4))
    curve = continue_constant(start, "peak_force", parameters, window, value=50.0)
    told = [Ending.OTHER_EXTREME.value, "end of the range of gap"]
    assert sorted(curve.stop_reasons) == sorted(told)
    by_end = [forces_by_stop(orbit) for orbit in (curve.orbits[0], curve.orbits[-1])]
    assert sorted(abs(a / b - 1.0) < 1e-4 for a, b in by_end) == [False, True]


def forces_by_stop(orbit):
    """Largest force at each of two stops, by the motion of a finer orbit."""
    impacts = finer_orbit(orbit).impact_list
    return [max((i.force for i in impacts if i.stop == n), default=0.0) for n in (0, 1)]


def test_a_force_can_be_asked_for_where_nothing_is_touched_yet():
    start = solve_orbit(linear_stop(gap=5e-3), 8.0)
    assert start.impacts == 0
    parameters = ("mass_times_radius", "gap")
    window = ((1e-4, 1e-2), (1e-3, 1e-2))
    curve = continue_constant(start, "peak_force", parameters, window, value=20.0)
    assert [peak_force(o) for o in curve.orbits] == pytest.approx([20.0] * len(curve.orbits))


def test_a_function_of_ones_own_is_held_as_the_monitor_of_that_name_is(one_dof):
    def largest(orbit):
        return max_abs_displacement(orbit)

    start = solve_orbit(one_dof, 40.0)
    window = ((30.0, 50.0), (2e-6, 1e-5))
    parameters = ("frequency_hz", "mass_times_radius")
    own = continue_constant(start, largest, parameters, window)
    named = continue_constant(start, "max_abs_displacement", parameters, window)
    assert own.kind == "largest"
    assert named.kind == "max_abs_displacement of middle"
    assert own.values == pytest.approx(named.values, rel=1e-10)
    heights = [orbit.max_abs_displacement for orbit in named.orbits]
    assert heights == pytest.approx([start.max_abs_displacement] * len(heights), rel=1e-7)


def test_depth_and_unbalance_of_a_linear_stop_scale():
    """Deeper by s at a gap and an unbalance greater by s: one orbit after scaling."""
    start = solve_orbit(linear_stop(gap=1e-4), 12.0)
    assert start.impacts == 1
    window = ((1e-4, 5e-4), (2e-5, 1e-3))
    curve = continue_constant(start, "max_penetration", ("mass_times_radius", "gap"), window)
    unbalance, gap = curve.values[-1]
    depth = start.max_penetration
    scaled = solve_orbit(linear_stop(gap=5.0 * gap, unbalance=5.0 * unbalance), 12.0)
    assert scaled.max_penetration == pytest.approx(5.0 * depth, rel=1e-6)


# --- bad input -----------------------------------------------------------------------------------

WINDOW = ((20.0, 30.0), (-1e-6, 1e-6))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda o: continue_branch(o, (1.0, 2.0), parameter="mass"),
            "unknown parameter 'mass'; there are",
        ),
        (
            lambda o: continue_branch(o, (0.0, 1.0), parameter=Parameter("gap", 3)),
            "no stop 3; there are 1",
        ),
        (
            lambda o: continue_branch(o, (0, 1), parameter=Parameter("modal_damping", 4)),
            "no mode 4; there are 1",
        ),
        (
            lambda o: continue_branch(o, (0.0, 1.0), parameter="coefficient"),
            "no damper 0; the system has none",
        ),
        (
            lambda o: continue_branch(o, (0.0, 1.0), parameter="amplitude"),
            "excitation 0 has no amplitude",
        ),
        (
            lambda o: continue_branch(o, (1e-6, 2e-6), parameter="gap"),
            "the orbit at gap = 0 m lies outside",
        ),
        (
            lambda o: continue_branch(o, (1e-6, math.nan), parameter="gap"),
            "two finite numbers, ascending",
        ),
        (
            lambda o: continue_branch(o, (1e-6, -1e-6), parameter="gap"),
            "two finite numbers, ascending",
        ),
        (lambda o: continue_branch(o, 1.0, parameter="gap"), "must be two numbers, got 1.0"),
        (lambda o: continue_branch(o, (-1.0, 30.0), parameter="spin_hz"), "has no spin"),
        (
            lambda o: continue_branch(o, (0.0, 6e9), parameter="stiffness"),
            "must begin above zero, got (0.0, 6",
        ),
        (
            lambda o: continue_branch(o, (-1.0, 6e9), parameter="stiffness"),
            "must be 0 at least, got (-1.0, 6",
        ),
        (
            lambda o: continue_constant(o, "torque", ("frequency_hz", "gap"), WINDOW),
            "unknown monitor 'torque'; there are: peak_force",
        ),
        (
            lambda o: continue_constant(
                o, "peak_force", ("frequency_hz", "gap"), WINDOW, value=-5.0
            ),
            "of the sign of the start's",
        ),
        (
            lambda o: continue_constant(o, lambda _: 0.0, ("frequency_hz", "gap"), WINDOW),
            "which cannot be held",
        ),
        (
            lambda o: continue_constant(o, "peak_force", ("gap", "gap"), (WINDOW[1],) * 2),
            "'gap' is given twice",
        ),
        (
            lambda o: continue_constant(o, "peak_force", ("gap",), (WINDOW[1],)),
            "needs two parameters, got 1",
        ),
        (
            lambda o: continue_constant(o, "peak_force", ("gap", "exponent"), WINDOW[:1]),
            "as many ranges as parameters",
        ),
        (
            lambda o: continue_special(
                SimpleNamespace(kind="GR", orbit=o), ("frequency_hz", "gap"), WINDOW
            ),
            "does not graze a stop",
        ),
        (
            lambda o: continue_special(
                SimpleNamespace(kind="BP", orbit=o), ("frequency_hz", "gap"), WINDOW
            ),
            "the orbit at 26 Hz is no BP",
        ),
        (
            lambda o: continue_special(
                SimpleNamespace(kind="CP", orbit=o), ("frequency_hz", "gap"), WINDOW
            ),
            "no defining system is known of 'CP' points; there are those of: LP, PD, NS, BP, GR",
        ),
        (
            lambda o: refine_special(SimpleNamespace(kind="NS", orbit=o)),
            "at least two modes",
        ),
    ],
)
def test_bad_input_is_told_in_one_sentence(one_dof, call, words):
    orbit = solve_orbit(one_dof, 26.0)
    with pytest.raises(SystemModelError) as told:
        call(orbit)
    assert words in str(told.value)
    assert "\n" not in str(told.value)


def test_a_start_that_is_no_special_point_is_refused(one_dof):
    beside = SimpleNamespace(kind="LP", orbit=solve_orbit(one_dof, 26.0))
    with pytest.raises(SystemModelError, match="the orbit at 26 Hz is no LP"):
        continue_special(beside, ("frequency_hz", "gap"), WINDOW)
    with pytest.raises(LocateError, match="LP near 26 Hz was not refined: Newton's method did not"):
        refine_special(beside, max_iterations=1)


def test_a_value_that_no_orbit_has_is_told_with_those_that_there_are(one_dof):
    start = solve_orbit(one_dof, 26.0)
    with pytest.raises(ConvergenceError) as told:
        continue_constant(start, "peak_force", ("frequency_hz", "gap"), WINDOW, value=1e9)
    branch = continue_branch(start, WINDOW[0])
    forces = [peak_force(orbit) for orbit in branch.points]
    assert str(told.value) == (
        f"no orbit with peak_force = 1e+09 was found: it is {peak_force(start):g} at the start and "
        f"from {min(forces):g} to {max(forces):g} where frequency_hz goes from 20 to 30; start at "
        "another orbit, or widen the range of frequency_hz"
    )


@pytest.fixture(scope="module")
def between_stiff_stops():
    """Branch from 7 to 10 Hz of an oscillator between two equal stops."""
    stop = Stop.linear("m", 2e5, gap=2e-4)
    system = System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.03, stops=[stop, replace(stop, direction=-1)],
        excitation=[HarmonicForce("m", 3.0)],
    )  # fmt: skip
    guess = np.array([3.0e-4, 3.0e-2]) * np.random.default_rng(0).normal(size=2)
    return continue_branch(solve_orbit(system, 8.4, guess=guess), (7.0, 10.0))


def test_a_curve_of_branch_points_tells_of_the_grazing_at_which_it_ends(between_stiff_stops):
    """Two equal stops, at which the next pair of extremes is zero in the end."""
    special = max(
        (point for point in between_stiff_stops.special_points if point.kind == "BP"),
        key=lambda point: point.frequency_hz,
    )
    curve = continue_special(special, ("frequency_hz", "amplitude"), ((8.5, 9.0), (2.9, 6.0)))
    grazed, end = curve.stop_reasons
    assert grazed == "a stop is grazed, where the curve has a corner that is not followed"
    assert end == "end of the range of amplitude"
    sizes = [np.abs(curve.orbits[0].extremes(stop).values) for stop in (0, 1)]
    assert max(size.min() / size.max() for size in sizes) < 1e-5


def test_each_of_two_parameters_of_one_name_has_its_own_orbits():
    """The gaps of two stops; a name without index means the first, as elsewhere."""
    gaps = Parameter("gap", 0), Parameter("gap", 1)
    options = ContinuationOptions(max_points=3)
    start = solve_orbit(between_two_stops(gap=0.011), 1.5)
    stops = start.system.stops
    ranges = [(0.5 * stop.gap, 2.0 * stop.gap) for stop in stops]
    curve = continue_constant(start, "peak_force", gaps, ranges, options=options)
    assert {"gap", "gap_1"} <= set(curve.table())
    for which, value in enumerate(curve.values[1]):
        for name in (gaps[which], ("gap", "gap_1")[which]):
            (orbit,) = curve.at(name, value)
            assert orbit.system.stops[which].gap == pytest.approx(value, rel=1e-12)
    with pytest.raises(SystemModelError, match="no parameter 'gap_2'; there are: gap, gap_1"):
        curve.at("gap_2", 1.0)


@pytest.mark.slow
def test_a_curve_of_folds_goes_on_behind_a_grazing_of_a_linear_stop():
    """Two folds of a 1/2 branch, with a grazing between them, are ends of one curve.

    At a damping of 0.056 it turns at a grazing, where its condition has the slope of a root.
    """
    orbit = solve_orbit(between_stops(), 11.51992, 2, guess=[7.93079e-06, 1.42423e-04])
    branch = continue_branch(orbit, (11.519, 11.521))
    folds = [s for s in branch.special_points if s.kind == "LP"]
    assert len(folds) == 2
    curve = continue_special(
        folds[0], ("frequency_hz", "modal_damping"), ((5.0, 60.0), (0.0199, 0.06))
    )
    assert curve.stop_reasons == ("end of the range of modal_damping",) * 2
    assert "GRLP" in [mark.kind for mark in curve.marks]
    found = sorted(orbit.frequency_hz for orbit in curve.at("modal_damping", 0.02))
    assert found == pytest.approx(sorted(fold.frequency_hz for fold in folds), rel=1e-11)


@pytest.mark.slow
def test_pole_of_a_flips_coefficient_at_a_fold_flip_is_no_generalised_flip():
    """The coefficient changes its sign through infinity where another multiplier passes 1."""
    gap = 2.55e-4
    system = System.from_modal(
        [10.0, 35.70456605487722], {"a": [1.0, 1.030839148656023]},
        modal_damping=0.013704142864357437,
        stops=[Stop("a", stiffness=16275079.11928816, gap=0.0002550118966991442)],
        excitation=[HarmonicForce("a", 0.18513265822659616)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 10.5), (10.0, 11.5))
    flips = [special for special in branch.special_points if special.kind == "PD"]
    flip = min(flips, key=lambda special: abs(special.frequency_hz - 11.19497))
    ranges = (11.1, 11.35), (gap / 1.7, gap * 1.7)
    curve = continue_special(flip, ("frequency_hz", "gap"), ranges)
    assert [mark.kind for mark in curve.marks] == ["LPPD"]
