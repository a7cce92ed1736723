"""Normal forms against explicit maps, and against the branches that are born at special points."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from legs import leg_from
from problems import in_frequency, make_one_dof, torus_system

from nldyn import (
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    cascade,
    continue_branch,
    describe_special,
    diagram,
    normal_form,
    solve_orbit,
)
from nldyn.bifurcations.chord import CROSSING_ERROR
from nldyn.bifurcations.normal_form_coefficients import (
    CoefficientError,
    Estimate,
    Loop,
    crossing,
    doubled_parameter,
    estimated,
    flip,
    fold,
    loop_of,
    torus,
)
from nldyn.bifurcations.normal_forms import is_symmetric, resonance, switch_at_branch_point
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.bifurcations.point import SpecialPoint
from nldyn.branches.cascades import FEIGENBAUM, cascades_in
from nldyn.orbits.newton import refine
from nldyn.orbits.shooting import shooting_problem


def of_kind(branch, kind):
    return [s for s in branch.special_points if s.kind == kind]


# --- explicit maps -------------------------------------------------------------------------------


def loop_of_maps(maps, nodes, parameter):
    """Loop of maps that give Jacobian and parameter derivative at a point."""

    def evaluate(nodes, parameter):
        values = [f(x, parameter) for f, x in zip(maps, nodes, strict=True)]
        return (*(np.array(part, dtype=float) for part in zip(*values, strict=True)), 0)

    return Loop(np.array(nodes, dtype=float), parameter, evaluate)


def logistic(x, r):
    return [[r * (1.0 - 2.0 * x[0])]], [x[0] * (1.0 - x[0])]


def test_flip_of_the_logistic_map():
    """At r = 3 f'' = -6 and f''' = 0: c = ¼ f''² + ⅙ f''' = 9; the multiplier is 2 - r."""
    form, q = flip(loop_of_maps([logistic], [[2.0 / 3.0]], 3.0))
    assert q.item() == 1.0
    assert form.nonlinear.value == pytest.approx(9.0, rel=1e-11)
    assert form.slope.value == pytest.approx(1.0, rel=1e-11)
    r = 3.0001  # exact 2-cycle
    x = (r + 1.0 + np.array([1.0, -1.0]) * math.sqrt((r - 3.0) * (r + 1.0))) / (2.0 * r)
    amplitude = 0.5 * abs(x[0] - x[1])
    assert (r - 3.0) / amplitude**2 == pytest.approx(doubled_parameter(form).value, rel=1e-3)


def henon(b):
    return lambda x, a: ([[-2.0 * a * x[0], 1.0], [b, 0.0]], [-(x[0] ** 2), 0.0])


@pytest.mark.parametrize("b", [0.3, -0.5])
def test_flip_of_the_henon_map(b):
    """The 2-cycle of x' = 1 - a x² + y, y' = b x is known: x₁ + x₂ = (1 - b)/a."""
    a0 = 0.75 * (1.0 - b) ** 2
    x0 = (-(1.0 - b) + math.sqrt((1.0 - b) ** 2 + 4.0 * a0)) / (2.0 * a0)
    form, q = flip(loop_of_maps([henon(b)], [[x0, b * x0]], a0))
    assert form.nonlinear.sign == 1
    a = a0 + 1e-6
    half = math.sqrt(((1.0 - b) / a) ** 2 / 4.0 - ((1.0 - b) ** 2 / a**2 - 1.0 / a))
    amplitude = half / abs(q[0, 0])
    assert (a - a0) / amplitude**2 == pytest.approx(doubled_parameter(form).value, rel=1e-4)
    cycle = 0.5 * (1.0 - b) / a + half * np.array([1.0, -1.0])
    product = henon(b)([cycle[1]], a)[0] @ np.array(henon(b)([cycle[0]], a)[0])
    largest = max(np.linalg.eigvals(product).real)
    assert 1.0 - largest == pytest.approx(4.0 * form.nonlinear.value * amplitude**2, rel=1e-3)


def test_torus_of_the_delayed_logistic_map():
    """Kuznetsov (2004), chapter 4: at r = 2 θ = π/3 and a(0) = -2 for |q|² = 2."""

    def delayed(x, r):
        return [[r * (1.0 - x[1]), -r * x[0]], [1.0, 0.0]], [x[0] * (1.0 - x[1]), 0.0]

    loop = loop_of_maps([delayed], [[0.5, 0.5]], 2.0)
    form = torus(loop, cmath.exp(1j * math.pi / 3.0))
    assert form.nonlinear.value == pytest.approx(-2.0 / 2.0, rel=1e-11)
    assert form.slope.value == pytest.approx(0.5, rel=1e-11)  # |μ|² = r - 1


@given(
    st.floats(0.3, 2.8), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0),
    st.floats(-1.0, 1.0), st.floats(-1.0, 1.0),
)  # fmt: skip
def test_torus_of_a_polynomial_map(theta, a20, a11, a02, c, d):
    """z' = e^{iθ}z + ½g20 z² + g11 z z̄ + ½g02 z̄² + (c + id) z² z̄ [Kuznetsov 2004, ch. 4]."""
    if min(abs(theta - angle) for angle in (math.pi / 2, 2 * math.pi / 3)) < 0.1:
        return
    mu = cmath.exp(1j * theta)
    g20, g11, g02, g21 = a20 + 0.3j, a11 - 0.2j, a02 + 0.1j, 2.0 * (c + 1j * d)

    def f(x, p):
        z = complex(*x)
        w = z.conjugate()
        by_z = mu * (1.0 + p) + g20 * z + g11 * w + g21 * z * w
        by_w = g11 * z + g02 * w + 0.5 * g21 * z * z
        to_x, to_y, to_p = by_z + by_w, 1j * (by_z - by_w), mu * z
        return [[to_x.real, to_y.real], [to_x.imag, to_y.imag]], [to_p.real, to_p.imag]

    exact = (mu.conjugate() * g21 / 2.0).real - abs(g11) ** 2 / 2.0 - abs(g02) ** 2 / 4.0
    exact -= ((1.0 - 2.0 * mu) * mu.conjugate() ** 2 / (2.0 * (1.0 - mu)) * g20 * g11).real
    form = torus(loop_of_maps([f], [[0.0, 0.0]], 0.0), mu)
    assert form.nonlinear.value == pytest.approx(2.0 * exact, abs=1e-8)  # |z| = √2 |ξ|
    assert form.slope.value == pytest.approx(1.0, rel=1e-9)


def test_fold_of_an_explicit_map():
    form, q = fold(loop_of_maps([lambda x, p: ([[1.0 - 2.0 * x[0]]], [3.0])], [[0.0]], 0.0))
    assert (form.slope.value, form.nonlinear.value) == (3.0, pytest.approx(-1.0))
    assert form.parameter.value == pytest.approx(1.0 / 3.0)  # x = ±√(3p)
    assert q.item() == 1.0


def test_pitchfork_and_transcritical_of_explicit_maps():
    fork = crossing(loop_of_maps([lambda x, p: ([[1 + p - 3 * x[0] ** 2]], [x[0]])], [[0.0]], 0.0))
    assert fork.is_pitchfork
    assert fork.pitchfork.parameter.value == pytest.approx(1.0)  # p = x²
    ways = np.abs(fork.roots)  # a tangent has two senses
    assert ways[0] == pytest.approx((1.0, 0.0), abs=1e-9)
    assert ways[1] == pytest.approx((0.0, 1.0), abs=1e-9)
    cross = crossing(
        loop_of_maps([lambda x, p: ([[1 + p - 4 * x[0]]], [x[0]])], [[0.0]], 0.0)  # x p - 2 x²
    )
    assert not cross.is_pitchfork
    slopes = sorted(a / b for a, b in cross.roots)
    assert slopes == pytest.approx([0.0, 0.5], abs=1e-9)  # x = 0 and x = p/2


def test_isolated_fixed_point_has_no_branches():
    """x' = x + x² + p² has the fixed point 0 for p = 0 only."""
    alone = crossing(loop_of_maps([lambda x, p: ([[1 + 2 * x[0]]], [2 * p])], [[0.0]], 0.0))
    assert alone.roots == ()


def test_two_maps_in_a_row_have_the_coefficients_of_their_product():
    """f = h∘g with g = sin x and h(y) = μ(1 + p) y + a y² + b y³ beside h∘g in one piece."""
    mu, a, b = -1.0, 0.7, 0.4

    def first(x, p):
        return [[math.cos(x[0])]], [0.0]

    def last(y, p):
        return [[mu * (1.0 + p) + 2 * a * y[0] + 3 * b * y[0] ** 2]], [mu * y[0]]

    def both(x, p):
        y = [math.sin(x[0])]
        (slope,), by_parameter = last(y, p)
        return [[slope[0] * math.cos(x[0])]], by_parameter

    whole, _ = flip(loop_of_maps([both], [[0.0]], 0.0))
    parts, _ = flip(loop_of_maps([first, last], [[0.0], [0.0]], 0.0))
    third = 6.0 * b - mu  # (h∘g)''' with g''' = -1
    assert whole.nonlinear.value == pytest.approx((2.0 * a) ** 2 / 4.0 + third / 6.0, rel=1e-9)
    assert parts.nonlinear.value == pytest.approx(whole.nonlinear.value, rel=1e-9)
    assert parts.slope.value == pytest.approx(whole.slope.value, rel=1e-9)


def test_a_map_with_a_corner_close_by_has_no_coefficient():
    def evaluate(nodes, parameter):
        return np.array([[[-1.0]]]), np.zeros((1, 1)), bool(nodes[0, 0] > 1e-9)

    with pytest.raises(CoefficientError, match="contact begins, ends or grazes so close"):
        flip(Loop(np.zeros((1, 1)), 0.0, evaluate))


def test_sign_within_the_error_is_unknown():
    assert [Estimate(v, 0.1).sign for v in (1.0, -1.0, 0.2, -0.2)] == [1, -1, 0, 0]
    assert Estimate(math.nan, math.nan).sign == 0


def test_steps_end_where_something_is_touched():
    """Smooth up to |ξ| = 0.01: the steps stay within, and the derivative is exact."""

    def evaluate(nodes, parameter):
        x = nodes[0, 0]
        return np.array([[[math.exp(x)]]]), np.zeros((1, 1)), bool(abs(x) > 0.01)

    form, _ = fold(Loop(np.zeros((1, 1)), 0.0, evaluate))
    assert form.nonlinear.value == pytest.approx(0.5, rel=1e-9)
    assert abs(form.nonlinear.value - 0.5) <= form.nonlinear.error + 1e-12
    assert estimated(lambda h: 1.0 + h * h).value == pytest.approx(1.0, abs=1e-14)


# --- folds ---------------------------------------------------------------------------------------


def beside(special, q, size):
    """Orbit of the branch at a distance along q, on the plane normal to q."""
    orbit = special.orbit
    step = np.append(size * q.ravel(), 0.0)
    found = orbit.problem.correct(orbit.point + step, step / np.linalg.norm(step))
    assert found.converged
    return type(orbit).of(orbit.problem, found, orbit.observe)


@pytest.mark.parametrize("index", range(6))
def test_fold_bends_as_its_coefficient_says(harmonic_branch, index):
    special = of_kind(harmonic_branch, "LP")[index]
    form, q = fold(loop_of(special.point))
    told = normal_form(special)
    size = min(1e-3 / abs(form.nonlinear.value), 1e-3)
    sides = [beside(special, q, s * size) for s in (1.0, -1.0)]
    bend = np.mean([o.point[-1] - special.orbit.point[-1] for o in sides]) / size**2
    assert bend == pytest.approx(told.frequency_shift.value, rel=1e-4)
    critical = [min(o.multipliers, key=lambda mu: abs(mu - 1.0)).real for o in sides]
    slope = (critical[0] - critical[1]) / (2.0 * size)
    assert slope == pytest.approx(2.0 * form.nonlinear.value, rel=1e-3)
    assert all((o.frequency_hz > special.frequency_hz) == (told.side > 0) for o in sides)
    stable, unstable = sorted(sides, key=lambda o: not o.stable)
    assert stable.stable and not unstable.stable and told.stable
    larger = stable.max_abs_displacement > unstable.max_abs_displacement
    assert f"the one of {'larger' if larger else 'smaller'} displacement is stable" in told.sentence


# --- flips ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("index", range(8))
def test_doubled_branch_is_where_the_flip_says(harmonic_branch, index):
    """f = f₀(1 + shift·ξ²) with the amplitude ξ of the doubled orbits; their multiplier 1 - 4cξ².

    Rounding moves f by 1e-12/ξ: the amplitudes are as small as leaves four digits of ξ³.
    """
    special = of_kind(harmonic_branch, "PD")[index]
    told = normal_form(special)
    shifts, drops = [], []
    least = 3e-3 * abs(told.coefficient.value) ** (-1.0 / 3.0)
    for amplitude in (least, 2.0 * least):
        orbit = switch_at_flip(special, amplitude).orbit
        nodes = orbit.problem.nodes(orbit.point)
        half = len(nodes) // 2
        part = 0.5 * np.linalg.norm(nodes[:half] - nodes[half:]) / math.sqrt(half)
        xi = part / special.orbit.problem.scale(special.orbit.point)
        assert xi == pytest.approx(amplitude, rel=1e-6)
        shifts.append((orbit.point[-1] - special.orbit.point[-1]) / xi**2)
        drops.append((1.0 - max(orbit.multipliers.real)) / xi**2)
        assert (orbit.frequency_hz > special.frequency_hz) == (told.side > 0)
        assert orbit.stable == told.stable
    for values, exact in (
        (shifts, told.frequency_shift.value),
        (drops, 4.0 * told.coefficient.value),
    ):
        limit = (4.0 * values[0] - values[1]) / 3.0  # without the term of order ξ²
        assert limit == pytest.approx(exact, rel=1e-3)


def test_flip_is_told_in_plain_words(harmonic_branch):
    special = of_kind(harmonic_branch, "PD")[-1]
    assert describe_special(special) == (
        "Flip at 33.6544 Hz, supercritical: a stable orbit of twice the period (59.43 ms) exists "
        "above 33.6544 Hz."
    )


def test_subcritical_flip(harmonic_branch):
    special = next(s for s in of_kind(harmonic_branch, "PD") if 12.0 < s.frequency_hz < 13.0)
    told = normal_form(special)
    assert told.name == "subcritical flip" and told.side == -1 and told.stable is False
    nodes = leg_from(switch_at_flip(special), (12.0, 13.0)).nodes
    assert nodes[1].orbit.frequency_hz < special.frequency_hz
    assert not nodes[1].orbit.stable


@pytest.mark.parametrize("segments", [1, 4, 6])
def test_coefficients_do_not_depend_on_the_segments(harmonic_branch, segments):
    """ξ is measured by other states, so that c ξ² at the first state is compared."""
    special = of_kind(harmonic_branch, "PD")[-1]
    orbit = special.orbit
    problem = shooting_problem(orbit.problem.flow, 1, segments)
    phases = problem.phases[:-1]
    nodes = problem.flow.to_state(orbit.states(phases))
    again = refine(problem, nodes, orbit.omega, orbit.observe)
    invariants = []
    for loop in (loop_of(special.point), loop_of(in_frequency(again))):
        form, q = flip(loop)
        unit = np.linalg.norm(q[0])
        invariants.append([form.nonlinear.value / unit**2, form.slope.value])
    assert invariants[1] == pytest.approx(invariants[0], rel=1e-6)


@pytest.mark.parametrize("longest", [0.05, 0.02])
def test_error_of_a_coefficient_covers_other_steps(harmonic_branch, monkeypatch, longest):
    for special in harmonic_branch.special_points:
        if special.kind == "GR":
            continue
        first = normal_form(special).coefficient
        with monkeypatch.context() as patch:
            patch.setattr("nldyn.bifurcations.normal_form_coefficients.LARGEST_STEP", longest)
            other = normal_form(special).coefficient
        assert abs(other.value - first.value) <= first.error + other.error
        assert first.error < 1e-5 * abs(first.value)


# --- Neimark-Sacker ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def torus_points():
    """A pair leaves the unit circle at 11.47 Hz, and returns at 11.88."""
    branch = continue_branch(solve_orbit(torus_system(), 60.0), (9.0, 61.0))
    return sorted(of_kind(branch, "NS"), key=lambda s: s.frequency_hz)


def torus_radius2(special, shift, periods=3000):
    """Mean |ξ|² of a simulation at the frequency f₀(1 + shift) that starts on the torus."""
    orbit, told = special.orbit, normal_form(special)
    loop = loop_of(special.point)
    mu = max(orbit.multipliers, key=lambda value: value.imag)
    q, y = loop.critical(mu / abs(mu))
    adjoint = mu / abs(mu) * y[-1]  # at the first node
    omega = orbit.omega * math.exp(shift)
    centre = refine(orbit.problem, loop.nodes, omega, orbit.observe)
    start = centre.problem.nodes(centre.point)[0]
    radius = math.sqrt(shift / told.frequency_shift.value)
    state = start + 2.0 * radius * q[0].real
    phases = 2.0 * np.pi * np.arange(periods + 1)
    states = centre.problem.flow.shoot(
        state[None], phases, omega, sensitivities=False, chained=True
    ).ends
    xi = (states[-1000:] - start) @ adjoint
    return float(np.mean(np.abs(xi) ** 2))


@pytest.mark.parametrize("index", [0, 1])
def test_torus_has_the_size_that_the_lyapunov_coefficient_says(torus_points, index):
    special = torus_points[index]
    told = normal_form(special)
    assert told.name == "supercritical torus" and told.stable
    assert told.side == (1, -1)[index]
    ratios = []
    for shift in (8e-4, 2e-4):
        found = torus_radius2(special, told.side * shift)
        ratios.append(found * told.frequency_shift.value / (told.side * shift))
    limit = (4.0 * ratios[1] - ratios[0]) / 3.0  # without the term of order ξ²
    assert limit == pytest.approx(1.0, rel=5e-3)


def test_torus_is_told_with_its_angle(torus_points):
    said = describe_special(torus_points[0])
    assert "supercritical: a stable torus" in said and "exists above 11.4727 Hz" in said
    mu = max(torus_points[0].orbit.multipliers, key=lambda value: value.imag)
    assert f"{math.degrees(cmath.phase(mu)):.4g} degrees per period" in said


@pytest.mark.parametrize(
    ("degrees", "order", "near"),
    [(2.0, 1, True), (178.0, 2, True), (118.0, 3, True), (91.0, 4, True), (60.0, 4, False)],
)
def test_strong_resonances(degrees, order, near):
    said = resonance(cmath.exp(1j * math.radians(degrees)))
    assert f"1:{order}" in said
    assert ("decides" in said) == near


# --- branch points -------------------------------------------------------------------------------


def facing_stops() -> System:
    """Two equal stops face each other, and x(t + T/2) = -x(t) is possible."""
    stops = [Stop("m", 1e5, 1.0, gap=1e-5, direction=side) for side in (1, -1)]
    return System.from_matrices(
        [[1.0]], [[1e4]], {"m": [1.0]}, modal_damping=0.02, stops=stops,
        excitation=[HarmonicForce("m", 1.0)],
    )  # fmt: skip


@pytest.fixture(scope="module")
def symmetric_branch():
    return continue_branch(solve_orbit(facing_stops(), 27.0), (11.8, 27.5))


@pytest.fixture(scope="module")
def broken_branch():
    return continue_branch(solve_orbit(facing_stops(), 20.0), (11.8, 27.5))


def upper_branch_point(branch):
    return max(of_kind(branch, "BP"), key=lambda s: s.frequency_hz)


def test_symmetry_breaks_at_the_same_frequencies_on_both_branches(symmetric_branch, broken_branch):
    assert all(is_symmetric(orbit) for orbit in symmetric_branch.points)
    meetings = [s.frequency_hz for s in broken_branch.special_points if s.kind == "BP"]
    for orbit in broken_branch.points:
        # as it is where the two branches meet, and nowhere else; rounding by 1e-15 moves an orbit
        # that is 3e-7 beside the crossing, as near as a step may end, by their quotient
        if is_symmetric(orbit, 1e-6):
            assert min(abs(orbit.frequency_hz / hz - 1.0) for hz in meetings) < 1e-15 / 3e-7 * 3.0
    symmetric, broken = (
        sorted(round(s.frequency_hz, 7) for s in of_kind(b, "BP"))
        for b in (symmetric_branch, broken_branch)
    )
    assert len(broken) == 2
    assert broken_branch.closed
    assert set(broken) <= set(symmetric)
    assert not symmetric_branch.notes


def test_orbit_at_a_branch_point_solves_its_equations(symmetric_branch):
    for special in of_kind(symmetric_branch, "BP"):
        orbit = special.orbit
        nodes = orbit.problem.nodes(orbit.point)
        ends = orbit.problem.flow.shoot(nodes, orbit.problem.phases, orbit.omega).ends
        scale = orbit.problem.scale(orbit.point)
        assert np.abs(ends - np.roll(nodes, -1, axis=0)).max() < 1e-9 * scale
        assert min(abs(orbit.multipliers - 1.0)) < 1e-5
        assert special.frequency_error < CROSSING_ERROR * special.frequency_hz


def test_halves_of_a_broken_symmetry_are_mirror_images(symmetric_branch):
    starts = switch_at_branch_point(upper_branch_point(symmetric_branch))
    first = starts[0].orbit
    second = refine(
        first.problem, first.problem.nodes(starts[1].orbit.point), first.omega, first.observe
    )
    a, b = (orbit.problem.nodes(orbit.point) for orbit in (first, second))
    assert not is_symmetric(first)
    assert np.abs(a + np.roll(b, 1, axis=0)).max() < 1e-9 * np.abs(a).max()
    assert starts[0].tangent[:-1] @ starts[1].tangent[:-1] < 0.0
    mu, other = first.multipliers, second.multipliers
    assert mu == pytest.approx(other, abs=1e-8)


@pytest.mark.parametrize("which", ["symmetric_branch", "broken_branch"])
def test_pitchfork_opens_as_its_coefficient_says(which, request):
    """Found on either of the two branches it is the same point with the same coefficient."""
    special = upper_branch_point(request.getfixturevalue(which))
    told = normal_form(special)
    assert told.name == "supercritical pitchfork"
    assert (told.side, told.stable) == (-1, True)
    assert told.sentence == (
        "Branch point at 24.358 Hz, pitchfork (the symmetry x(t + T/2) = -x(t) breaks), "
        "supercritical: two stable orbits, mirror images of each other, exist below 24.358 Hz."
    )
    base = upper_branch_point(request.getfixturevalue("symmetric_branch"))
    for start in switch_at_branch_point(base, 1e-2):
        xi = np.linalg.norm(start.orbit.point[:-1] - base.orbit.point[:-1])
        xi /= math.sqrt(base.orbit.problem.segments) * base.orbit.problem.scale(base.orbit.point)
        shift = (start.orbit.point[-1] - base.orbit.point[-1]) / xi**2
        assert shift == pytest.approx(told.frequency_shift.value, rel=5e-3)
        assert start.orbit.stable


def test_from_the_broken_branch_one_comes_to_the_symmetric_one(broken_branch, symmetric_branch):
    for start in switch_at_branch_point(upper_branch_point(broken_branch)):
        assert is_symmetric(start.orbit)
        assert symmetric_branch.contains(start.orbit)


def test_diagram_follows_both_halves_of_a_broken_symmetry():
    """Simulation finds the symmetric orbit only; the others come from the branch point."""
    found = diagram(facing_stops(), (24.0, 27.5), [1], search_points=1)
    symmetric, halves = found.branches
    assert is_symmetric(symmetric.points[0])
    assert halves.stop_reasons == ("end of the frequency range", "end of the frequency range")
    assert [s.frequency_hz for s in halves.special_points if s.kind == "BP"] == [
        pytest.approx(24.358, abs=1e-4)
    ]
    first, second = halves.points[0], halves.points[-1]
    assert not is_symmetric(first)
    a, b = (orbit.problem.nodes(orbit.point) for orbit in (first, second))
    assert np.abs(a + np.roll(b, 1, axis=0)).max() < 1e-9 * np.abs(a).max()
    assert not found.notes


def test_switching_needs_a_branch_point(harmonic_branch):
    special = of_kind(harmonic_branch, "LP")[0]
    with pytest.raises(SystemModelError, match="needs a BP point, got LP"):
        switch_at_branch_point(special)


# --- grazing -------------------------------------------------------------------------------------


@pytest.mark.parametrize("index", range(3))
def test_contact_exists_where_the_grazing_point_says(harmonic_branch, index):
    special = of_kind(harmonic_branch, "GR")[index]
    told = normal_form(special, harmonic_branch.special_points)
    nodes, where = harmonic_branch.nodes, special.point.arclength
    a, b = next((a, b) for a, b in pairwise(nodes) if a.arclength < where < b.arclength)
    more = max((a, b), key=lambda node: node.orbit.impacts).orbit
    assert a.orbit.impacts != b.orbit.impacts
    assert told.name == "new contact"
    assert (more.frequency_hz > special.frequency_hz) == (told.side > 0)
    side = "above" if told.side > 0 else "below"
    assert f"the contact exists {side} {special.frequency_hz:.6g} Hz" in told.sentence


def test_multipliers_are_continuous_at_a_grazing_point(harmonic_branch):
    """Their change over ±1e-9 of arclength is small, and grows with it."""
    special = of_kind(harmonic_branch, "GR")[-1]
    orbit, tangent = special.orbit, special.point.tangent
    row = tangent / np.linalg.norm(tangent)
    changes = []
    for size in (1e-9, 1e-7):
        ends = [
            type(orbit).of(orbit.problem, orbit.problem.correct(orbit.point + s * tangent, row), "")
            for s in (size, -size)
        ]
        assert ends[0].impacts != ends[1].impacts
        changes.append(abs(ends[0].multipliers[0] - ends[1].multipliers[0]))
    assert changes[0] < 1e-3 and changes[0] < changes[1]


def test_special_point_close_to_a_grazing_point_is_named(harmonic_branch):
    special = min(of_kind(harmonic_branch, "GR"), key=lambda s: s.frequency_hz)
    assert "LP at 5.7461 Hz" in describe_special(special, harmonic_branch.special_points)
    assert "close by" not in describe_special(special)


def test_kind_without_a_normal_form(harmonic_branch):
    """A mark that knows no direction of a branch is no event of one."""
    node = harmonic_branch.nodes[0]
    special = SpecialPoint("XX", replace(node, tangent=np.zeros(node.tangent.size)), 0.0)
    with pytest.raises(SystemModelError, match="'XX'"):
        normal_form(special)


# --- cascades ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def damped_cascade():
    system = System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.2,
        stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 33.0), (32.0, 34.0))
    return cascade(of_kind(branch, "PD")[0], 5)


def test_ratios_of_a_cascade_tend_to_feigenbaums_number(damped_cascade):
    assert [s.orbit.period for s in damped_cascade.flips] == [1, 2, 4, 8, 16, 32]
    ratios = damped_cascade.ratios
    off = [abs(ratio.value / FEIGENBAUM - 1.0) for ratio in ratios]
    assert off[0] > off[1] > off[2] > off[3]
    assert off[2] < 0.03 and off[3] < 0.005
    assert all(ratio.error < 1e-6 for ratio in ratios)
    assert "ratios" in damped_cascade.describe()


def test_flips_of_a_cascade_lie_before_its_limit(damped_cascade):
    hz = [s.frequency_hz for s in damped_cascade.flips]
    assert hz == sorted(hz)
    assert hz[-1] < damped_cascade.limit < hz[-1] + 0.5 * (hz[-1] - hz[-2])
    for branch, start in zip(damped_cascade.branches, damped_cascade.flips, strict=False):
        assert branch.period == 2 * start.orbit.period
        assert branch.points[0].stable


def test_lightly_damped_cascade_begins_near_the_conservative_ratio(harmonic_branch):
    """8.72 in conservative systems; less as the determinant of the doubled period shrinks."""
    found = cascade(of_kind(harmonic_branch, "PD")[-1], 5)
    ratios = [ratio.value for ratio in found.ratios]
    assert max(ratios) == pytest.approx(8.72, rel=0.06)
    assert ratios[-1] < ratios[-2] < ratios[-3]
    assert ratios[-1] > FEIGENBAUM


def test_flips_of_a_cascade_are_those_of_the_diagram():
    system = make_one_dof()
    branch = continue_branch(solve_orbit(system, 33.0), (32.0, 34.0))
    found = cascade(of_kind(branch, "PD")[0], 1)
    special = leg_from(switch_at_flip(of_kind(branch, "PD")[0]), (33.0, 35.0)).special_points
    first = next(s for s in special if s.kind == "PD")
    assert found.flips[1].frequency_hz == pytest.approx(first.frequency_hz, rel=1e-9)


def test_diagram_with_doublings_holds_the_cascade():
    system = make_one_dof()
    found = diagram(system, (33.0, 35.5), [1], search_points=1, doublings=3)
    (picked,) = cascades_in(found.branches)
    assert [s.orbit.period for s in picked.flips] == [1, 2, 4, 8]
    alone = cascade(picked.flips[0], 3)
    for a, b in zip(picked.flips, alone.flips, strict=True):
        assert a.frequency_hz == pytest.approx(b.frequency_hz, rel=1e-8)
    ratios = [ratio.value for ratio in picked.ratios]
    assert ratios == pytest.approx([ratio.value for ratio in alone.ratios], rel=1e-4)
    assert [branch.period for branch in picked.branches] == [2, 4, 8]


def test_cascade_ends_where_the_doubled_branch_comes_back():
    """With ten per cent of damping the doubled branch joins two flips and has none of its own."""
    system = System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.1,
        stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 14.0), (13.0, 16.0))
    low, high = sorted(s.frequency_hz for s in of_kind(branch, "PD"))
    found = cascade(min(of_kind(branch, "PD"), key=lambda s: s.frequency_hz), 2)
    assert len(found.flips) == 1
    assert f"joins the branch of period 1 at the flip at {high:.6g} Hz" in found.stop_reason
    assert low < high and not found.ratios and math.isnan(found.limit)


def test_cascade_needs_a_flip(harmonic_branch):
    with pytest.raises(SystemModelError, match="needs a PD point, got LP"):
        cascade(of_kind(harmonic_branch, "LP")[0])
    with pytest.raises(SystemModelError, match="depth"):
        cascade(of_kind(harmonic_branch, "PD")[0], 0)
