"""Floquet multipliers from the sequence of segment matrices, and how sure they are."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import mpmath as mp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import make_one_dof
from repeated import run_through
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.special import mathieu_a, mathieu_b

from nldyn import (
    Damper,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Stop,
    System,
    Unbalance,
    find_orbits,
    solve_orbit,
)
from nldyn.orbits.multipliers import (
    MultiplierError,
    Stability,
    floquet_spectrum,
    log_determinant,
    uncertainties,
)

EPS = 2.0**-52


def exact_multipliers(factors, digits=120):
    """Eigenvalues of the product by mpmath, largest first, and the logarithms of their moduli."""
    with mp.workdps(digits):
        product = mp.eye(factors.shape[1])
        for factor in factors:
            product = mp.matrix(factor.tolist()) * product
        values = sorted(mp.eig(product, left=False, right=False), key=lambda mu: -abs(mu))
        logarithms = [float(mp.log(abs(mu))) if mu else -math.inf for mu in values]
        return np.array([complex(mu) for mu in values]), np.array(logarithms)


def well_conditioned(rng, n):
    """A matrix with singular values between 1 and 2."""
    left, right = (np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(2))
    return left @ np.diag(rng.uniform(1.0, 2.0, n)) @ right


def graded(rng, decades, k):
    """k factors of which each multiplies its share of 10**decades to skew directions."""
    n = len(decades)
    bases = [well_conditioned(rng, n) for _ in range(k)]
    shares = np.diag(10.0 ** (np.asarray(decades) / k))
    return np.array([bases[(j + 1) % k] @ shares @ np.linalg.inv(bases[j]) for j in range(k)])


# --- products with known eigenvalues -------------------------------------------------------------


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 8, 12])
@pytest.mark.parametrize("k", [1, 2, 3, 7, 30])
def test_random_products_have_the_eigenvalues_of_high_precision(n, k):
    """Between neighbours of nearly the same modulus the order is free: compare as a set."""
    factors = np.random.default_rng(10 * n + k).normal(size=(k, n, n))
    found = floquet_spectrum(factors)
    exact, logarithms = exact_multipliers(factors)
    np.testing.assert_allclose(found.log_moduli, logarithms, rtol=0, atol=1e-10)
    for mu in exact:
        assert np.abs(found.multipliers - mu).min() < 1e-10 * abs(mu)
    np.testing.assert_allclose(np.log(np.abs(found.multipliers)), found.log_moduli, atol=1e-11)


@pytest.mark.parametrize(
    ("decades", "k"),
    [([8, -12], 4), ([12, -12], 6), ([8, 0, 0, -12], 8), ([12, 4, 4, -4, -4, -12], 8),
     ([12, 9, 3, 1, -1, -3, -9, -12], 12), ([-12, 12, -12, 12], 16)],
)  # fmt: skip
def test_large_and_tiny_multipliers_are_both_right(decades, k):
    factors = graded(np.random.default_rng(7), decades, k)
    _, logarithms = exact_multipliers(factors)
    # in one factor the directions spread by 10^(spread / k), which is what rounding grows by
    spread = 10.0 ** ((max(decades) - min(decades)) / k)
    repeated = len(set(decades)) < len(decades)
    error = 1e3 * k * len(decades) * EPS * spread
    assert error < 1e-6
    error = math.sqrt(error) if repeated else error
    np.testing.assert_allclose(floquet_spectrum(factors).log_moduli, logarithms, rtol=0, atol=error)
    assert logarithms[-1] == pytest.approx(min(decades) * math.log(10.0), abs=1e-3)


def test_product_formed_first_loses_the_tiny_multipliers_that_the_sequence_keeps():
    factors = graded(np.random.default_rng(3), [8, 0.3, -12], 6)
    _, logarithms = exact_multipliers(factors)
    formed = np.linalg.multi_dot(factors[::-1])
    lost = np.sort(np.log(np.abs(np.linalg.eigvals(formed))))[0]
    assert abs(lost - logarithms[-1]) > 1.0
    assert abs(floquet_spectrum(factors).log_moduli[-1] - logarithms[-1]) < 1e-10


def test_very_long_periods_neither_overflow_nor_underflow():
    factors = np.tile(graded(np.random.default_rng(5), [1.5, 0.2, -2.5], 3), (400, 1, 1))
    _, logarithms = exact_multipliers(factors[:3])
    found = floquet_spectrum(factors)
    np.testing.assert_allclose(found.log_moduli, 400 * logarithms, rtol=1e-12)
    assert found.multipliers[2] == 0.0
    assert math.isinf(abs(found.multipliers[0]))
    assert found.multipliers[1].real == pytest.approx(math.exp(400 * logarithms[1]), rel=1e-9)


def test_factors_of_extreme_size_are_no_worse():
    factors = np.random.default_rng(2).normal(size=(4, 4, 4))
    sizes = np.array([1e200, 1e-250, 1e150, 1e-90])[:, None, None]
    np.testing.assert_allclose(
        floquet_spectrum(sizes * factors).log_moduli - 10 * math.log(10.0),
        floquet_spectrum(factors).log_moduli, rtol=0, atol=1e-11,
    )  # fmt: skip


@pytest.mark.parametrize("k", [1, 2, 5])
def test_rotation_and_growth_make_a_conjugate_pair(k):
    """Damped rotation by 0.3 per factor beside a saddle: μ = (0.9 e^{±0.3i})^k, 3^k, (-0.2)^k."""
    turn = 0.9 * np.array([[math.cos(0.3), -math.sin(0.3)], [math.sin(0.3), math.cos(0.3)]])
    block = np.zeros((4, 4))
    block[:2, :2], block[2, 2], block[3, 3] = turn, 3.0, -0.2
    basis = well_conditioned(np.random.default_rng(1), 4)
    found = floquet_spectrum(np.tile(basis @ block @ np.linalg.inv(basis), (k, 1, 1))).multipliers
    pair = (0.9 * np.exp(0.3j)) ** k
    np.testing.assert_allclose(found, [3.0**k, pair, pair.conjugate(), (-0.2) ** k], rtol=1e-13)


# --- repeated, defective and zero multipliers ----------------------------------------------------


def test_repeated_multipliers_with_independent_directions_are_exact():
    basis = well_conditioned(np.random.default_rng(4), 4)
    factor = basis @ np.diag([2.0, 2.0, 0.5, 0.5]) @ np.linalg.inv(basis)
    found = floquet_spectrum(np.tile(factor, (3, 1, 1)))
    np.testing.assert_allclose(found.multipliers, [8.0, 8.0, 0.125, 0.125], rtol=1e-13)
    unsure = uncertainties(np.tile(factor, (3, 1, 1)), found, 1e-8)
    assert np.all(unsure < 1e-6)


@pytest.mark.parametrize("order", [2, 3])
def test_defective_multipliers_are_as_sure_as_the_root_of_the_error(order):
    """μ of a Jordan block of order m moves by the m-th root of a perturbation."""
    block = 0.5 * np.eye(4)
    block[np.arange(order - 1), np.arange(1, order)] = 1.0
    block[3, 3] = 1e-6
    basis = well_conditioned(np.random.default_rng(6), 4)
    factor = (basis @ block @ np.linalg.inv(basis))[None]
    found = floquet_spectrum(factor)
    assert np.abs(found.log_moduli[:order] - math.log(0.5)).max() < 30.0 * EPS ** (1.0 / order)
    error = 1e-9
    unsure = uncertainties(factor, found, error)[0]
    assert 0.1 * error ** (1.0 / order) < unsure < 100.0 * error ** (1.0 / order)


@pytest.mark.parametrize("k", [2, 3, 6])
@pytest.mark.parametrize("place", [0, 1, 2, 3])
def test_zero_of_a_triangular_factor_is_an_exactly_zero_multiplier(k, place):
    """Any place of the zero; the other multipliers are those of high precision."""
    factors = np.triu(np.random.default_rng(8).normal(size=(k, 4, 4)))
    factors[-1] += np.tril(np.random.default_rng(9).normal(size=(4, 4)), -1)
    factors[0, place, place] = 0.0
    found = floquet_spectrum(factors)
    assert np.sum(found.multipliers == 0.0) == 1
    assert found.log_moduli[-1] == -math.inf
    _, logarithms = exact_multipliers(factors)
    np.testing.assert_allclose(found.log_moduli[:3], logarithms[:3], rtol=0, atol=1e-11)


def test_two_zeros_in_different_factors_are_two_zero_multipliers():
    factors = np.triu(np.random.default_rng(12).normal(size=(4, 5, 5)))
    factors[-1] += np.tril(np.random.default_rng(13).normal(size=(5, 5)), -1)
    factors[0, 3, 3] = factors[2, 1, 1] = 0.0
    found = floquet_spectrum(factors)
    assert np.sum(found.multipliers == 0.0) == 2
    _, logarithms = exact_multipliers(factors)
    np.testing.assert_allclose(found.log_moduli[:3], logarithms[:3], rtol=0, atol=1e-11)


def test_singular_full_matrices_leave_the_other_multipliers_right():
    """A rank lost by rounding shows as a multiplier at rounding level, of which nothing is sure."""
    rng = np.random.default_rng(14)
    factors = rng.normal(size=(3, 4, 4))
    factors[1] -= np.outer(factors[1] @ np.ones(4), np.ones(4)) / 4.0
    found = floquet_spectrum(factors)
    _, logarithms = exact_multipliers(factors)
    np.testing.assert_allclose(found.log_moduli[:3], logarithms[:3], rtol=0, atol=1e-11)
    assert found.log_moduli[3] < math.log(EPS) + 7.0
    assert found.squeeze < 1e-14
    assert uncertainties(factors, found, 1e-12)[3] > 1.0
    assert np.all(floquet_spectrum(factors * 0.0).multipliers == 0.0)


def test_nilpotent_product_is_zero():
    up, down = np.diag([1.0, 2.0], 1), np.diag([3.0, 0.0, 1.0])
    assert np.all(floquet_spectrum(np.array([up, down])).multipliers == 0.0)


def test_matrices_that_are_not_finite_are_refused():
    factors = np.full((2, 2, 2), 1.0)
    factors[1, 0, 1] = math.inf
    with pytest.raises(MultiplierError):
        floquet_spectrum(factors)


# --- laws ----------------------------------------------------------------------------------------

SEQUENCES = st.tuples(
    st.integers(1, 7), st.integers(1, 6), st.floats(0.0, 14.0), st.integers(0, 2**31)
)


def sequence(case):
    """k factors of n directions, spread over so many decades and in any order."""
    k, n, decades, seed = case
    rng = np.random.default_rng(seed)
    return graded(rng, rng.uniform(-decades / 2.0, decades / 2.0, n), k)


@given(SEQUENCES, st.integers(1, 6))
def test_multipliers_do_not_depend_on_where_the_period_begins(case, shift):
    """Differences are of rounding size, as `uncertainties` estimates it."""
    factors = sequence(case)
    found, shifted = floquet_spectrum(factors), floquet_spectrum(np.roll(factors, shift, axis=0))
    bound = 100.0 * uncertainties(factors, found, 4.0 * EPS * factors.shape[1]) + 1e-14
    assert np.all(np.abs(found.log_moduli - shifted.log_moduli) <= bound)


@given(SEQUENCES, st.integers(0, 2**31))
def test_coordinates_between_the_segments_do_not_matter(case, seed):
    factors = sequence(case)
    k, n, _ = factors.shape
    rng = np.random.default_rng(seed)
    bases = [np.linalg.qr(rng.normal(size=(n, n)))[0] for _ in range(k)]
    turned = np.array([bases[(j + 1) % k] @ factors[j] @ bases[j].T for j in range(k)])
    found, other = floquet_spectrum(factors), floquet_spectrum(turned)
    bound = 100.0 * uncertainties(factors, found, 4.0 * EPS * n) + 1e-14
    assert np.all(np.abs(found.log_moduli - other.log_moduli) <= bound)


@given(SEQUENCES)
def test_log_moduli_add_up_to_the_log_determinant(case):
    factors = sequence(case)
    factors[:, :, 0] *= np.sign(np.linalg.det(factors))[:, None]
    value, rounding = log_determinant(factors)
    found = floquet_spectrum(factors)
    unsure = uncertainties(factors, found, 4.0 * EPS * factors.shape[1])
    assert abs(found.log_moduli.sum() - value) <= 100.0 * (unsure.sum() + rounding) + 1e-12


MOTIONS = {
    "light damping": ([[0.0, 1.0], [-1.0, -0.02]], 6.0),
    "critical damping": ([[0.0, 1.0], [-1.0, -2.0]], 20.0),
    "strong damping": ([[0.0, 1.0], [-1.0, -30.0]], 10.0),
    "two modes, one strongly damped": (
        [[0, 1, 0, 0], [-1, -0.1, 0.3, 0.5], [0, 0, 0, 1], [0.2, 0, -25, -20.0]], 12.0),
    "saddle": ([[0.0, 1.0], [4.0, -3.0]], 5.0),
}  # fmt: skip


@pytest.mark.parametrize("name", MOTIONS)
def test_constant_matrices_give_the_exponentials_for_any_number_of_segments(name):
    """μ = exp(λT), whatever the number of segments, as soon as one segment keeps its directions."""
    matrix, period = MOTIONS[name]
    rates = np.linalg.eigvals(np.array(matrix, dtype=float)) * period
    logarithms = -np.sort(-rates.real)
    defective = name == "critical damping"
    for k in (30, 100, 301):
        piece = expm(np.array(matrix) * period / k)
        found = floquet_spectrum(np.tile(piece, (k, 1, 1)))
        tolerance = 1e-6 * k if defective else 1e-10
        np.testing.assert_allclose(found.log_moduli, logarithms, rtol=0, atol=tolerance)


# --- Mathieu's equation --------------------------------------------------------------------------


def mathieu_segments(a, q, k, rtol=1e-12):
    """Segments of y'' + (a - 2q cos 2x) y = 0 over its period π."""

    def rate(x, y):
        return np.concatenate([y[2:], -(a - 2.0 * q * math.cos(2.0 * x)) * y[:2]])

    pieces = []
    for start, end in pairwise(np.linspace(0.0, math.pi, k + 1)):
        ends = solve_ivp(rate, (start, end), [1.0, 0.0, 0.0, 1.0], "DOP853", rtol=rtol, atol=1e-14)
        pieces.append(ends.y[:, -1].reshape(2, 2))
    return np.array(pieces)


@pytest.mark.parametrize("k", [1, 2, 8])
@pytest.mark.parametrize(
    ("function", "order", "sign"),
    [(mathieu_a, 0, 1), (mathieu_b, 1, -1), (mathieu_a, 1, -1), (mathieu_b, 2, 1)],
)
def test_mathieus_multipliers_meet_on_the_edges_of_the_tongues(k, function, order, sign):
    """Characteristic values a(q), b(q) are where both multipliers are +1 or both are -1."""
    q = 2.0
    edge = float(function(order, q))
    segments = mathieu_segments(edge, q, k)
    found = floquet_spectrum(segments)
    np.testing.assert_allclose(found.multipliers, [sign, sign], atol=1e-4)
    unsure = uncertainties(segments, found, 1e-10)
    assert Stability(found.multipliers[0], found.log_moduli[0], unsure[0]).verdict == "undecided"
    inside, outside = [], []
    for a in (edge - 0.05, edge + 0.05):
        spread = floquet_spectrum(mathieu_segments(a, q, k)).log_moduli
        assert spread.sum() == pytest.approx(0.0, abs=1e-9)  # Liouville: no damping
        (inside if spread[0] < 1e-9 else outside).append(a)
    assert len(inside) == len(outside) == 1


# --- uncertainty ---------------------------------------------------------------------------------


def worst_first_order_change(factors):
    """√k (Σ (‖A‖ ‖y‖ ‖x‖ / |yᵀ A x|)²)^½ of each multiplier, from its vectors along the period."""
    k, n, _ = factors.shape
    product = np.linalg.multi_dot([np.eye(n), *factors[::-1]])
    values, right = np.linalg.eig(product)
    changes = []
    for index in np.argsort(-np.abs(values)):
        x = [right[:, index]]
        for factor in factors:
            x.append(factor @ x[-1])
        lefts, vectors = np.linalg.eig(product.T)
        y = [vectors[:, np.argmin(np.abs(lefts - values[index]))]]
        for factor in factors[::-1]:
            y.append(factor.T @ y[-1])
        y = y[::-1]
        terms = [
            np.linalg.norm(factors[j]) * np.linalg.norm(x[j]) * np.linalg.norm(y[j + 1])
            / abs(y[j + 1] @ factors[j] @ x[j])
            for j in range(k)
        ]  # fmt: skip
        changes.append(math.sqrt(k) * np.linalg.norm(terms))
    return np.array(changes)


@pytest.mark.parametrize("seed", range(12))
def test_uncertainty_agrees_with_the_first_order_worst_case(seed):
    """For simple multipliers within the factor ten of four samples [Kenney and Laub 1994]."""
    rng = np.random.default_rng(seed)
    k, n = int(rng.integers(1, 5)), int(rng.integers(2, 7))
    factors = graded(rng, np.linspace(2.0, -2.0, n) + rng.uniform(-0.1, 0.1, n), k)
    found = floquet_spectrum(factors)
    assert np.all(found.multipliers.imag == 0.0)
    ratio = uncertainties(factors, found, 1e-9) / (1e-9 * worst_first_order_change(factors))
    assert np.all((ratio > 0.1) & (ratio < 10.0))


# --- real orbits ---------------------------------------------------------------------------------


def damped_and_light(damping=0.6) -> System:
    """A lightly damped mode that impacts and a strongly damped one."""
    return System.from_modal(
        [13.1, 60.0], {"middle": [0.635, 0.3]}, modal_damping=[0.002, damping],
        stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip


def test_multipliers_are_those_of_high_precision_of_the_orbits_own_matrices():
    """An unstable orbit of period 7 with five impacts: multipliers of 5e2 and 3e-12."""
    orbit = max(find_orbits(damped_and_light(), 58.0, 7), key=lambda found: found.log_moduli[0])
    assert orbit.impacts == 5
    assert orbit.log_moduli[0] > math.log(500.0)
    assert orbit.log_moduli[-1] < math.log(3e-12)
    _, exact = exact_multipliers(orbit.jacobians)
    np.testing.assert_allclose(orbit.log_moduli, exact, rtol=0, atol=1e-11)


def test_multipliers_agree_with_a_finer_map_on_many_more_segments():
    orbit = max(find_orbits(damped_and_light(), 58.0, 7), key=lambda found: found.log_moduli[0])
    fine = replace(orbit.problem, flow=orbit.problem.flow.finer)
    pieces = fine.jacobians(orbit.point, 12)
    assert len(pieces) == 12 * len(orbit.jacobians)
    change = np.abs(floquet_spectrum(pieces).log_moduli - orbit.log_moduli)
    assert np.all(change < orbit.log_modulus_uncertainties)
    assert np.all(change < 1e-7)


@pytest.mark.parametrize("times", [5, 12, 30])
def test_orbit_run_through_many_times_has_the_powers_of_its_multipliers(times):
    """12 times: 2e9 and 3e-13 in one orbit, beside a pair of 4e-40 that is damped strongly."""
    system = System.from_modal(
        [13.1, 125.1], {"middle": [0.635, 0.8]}, modal_damping=[0.005, 0.6],
        stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip
    once = solve_orbit(system, 60.0)
    often = run_through(once, times)
    np.testing.assert_allclose(often.log_moduli, times * once.log_moduli, rtol=1e-11)
    assert often.multipliers[0] == pytest.approx(once.multipliers[0] ** times, rel=1e-10)
    assert often.multipliers[1] == pytest.approx(once.multipliers[1] ** times, rel=1e-10)
    assert often.liouville_error < 1e-11
    assert often.stability.verdict == "unstable"


@pytest.mark.parametrize("segments", [1, 2, 3, 8, 20])
def test_multipliers_do_not_depend_on_the_number_of_shooting_segments(segments):
    """Within the uncertainty that one of the orbits states for its own multipliers."""
    system = damped_and_light()
    base = solve_orbit(system, 60.0)
    start = base.problem.flow.to_modal(base.problem.nodes(base.point))[:1]
    orbit = solve_orbit(system, 60.0, guess=start, segments=segments)
    change = np.abs(orbit.log_moduli - base.log_moduli)
    assert np.all(change <= base.log_modulus_uncertainties)
    assert np.all(change < 1e-7)


def overdamped(times=1.0) -> System:
    """Two coupled coordinates of which one impacts; T tr D is 1000 `times` at 5 Hz."""
    return System.from_matrices(
        np.diag([2.0, 1.0]), [[2e4, -6e3], [-6e3, 1.2e4]], {"a": [1.0, 0.0]},
        damping=np.array([[4000.0, -500.0], [-500.0, 3000.0]]) * times,
        stops=[Stop.linear("a", 1e6)], excitation=[HarmonicForce("a", 10.0 * times)],
    )  # fmt: skip


def test_segments_that_squeeze_a_direction_below_rounding_are_cut():
    """Multipliers down to e^-621: a run on 400 segments and a finer map gives them again."""
    orbit = solve_orbit(overdamped(), 5.0)
    assert orbit.impacts == 1
    lost = np.abs(floquet_spectrum(orbit.jacobians).log_moduli[2:] - orbit.log_moduli[2:])
    assert np.all(lost > 10.0)
    fine = replace(orbit.problem, flow=orbit.problem.flow.finer).jacobians(orbit.point, 200)
    change = np.abs(floquet_spectrum(fine).log_moduli - orbit.log_moduli)
    assert np.all(change < 1e-9)
    assert orbit.log_moduli.sum() == pytest.approx(-1000.0, abs=1e-9)
    assert orbit.multipliers[-1].real == pytest.approx(math.exp(orbit.log_moduli[-1]), rel=1e-9)


def test_a_pair_beside_a_multiplier_that_is_far_smaller_converges_when_perturbed():
    """Three coupled modes of which a damper holds one: multipliers from e^-0.04 to e^-4800."""
    system = System.from_modal(
        [10.0, 70.0, 490.0],
        {"a": [1.4490123494225093, 1.4439612142167686, 0.114296]},
        modal_damping=[0.000138054, 0.316228, 0.280733],
        dampers=[Damper("a", 1e4)],
        excitation=[HarmonicForce("a", 1.0)],
    )
    omega, n = system.natural_frequencies, system.size
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(omega**2), -system.total_damping]])
    orbit = solve_orbit(FlowMap(system, FlowOptions(1e-5)), 5.01187)
    exact = np.sort(np.linalg.eigvals(state).real)[::-1] / 5.01187
    sure = orbit.log_modulus_uncertainties
    assert np.isfinite(sure[:5]).all()
    assert np.all(np.abs(orbit.log_moduli - exact)[:3] <= sure[:3])
    assert abs(orbit.log_moduli[0] / exact[0] - 1.0) < 1e-6


def test_multipliers_lost_to_damping_say_so():
    """A decay by e^-6000 is beyond 64 cuts: the large multipliers are sure, the small are not."""
    orbit = solve_orbit(overdamped(10.0), 5.0)
    assert np.all(orbit.log_modulus_uncertainties[:2] < 1e-4)
    assert np.all(orbit.log_modulus_uncertainties[2:] > 1.0)
    assert math.isnan(orbit.liouville_error)
    assert orbit.stability.verdict == "stable"


def test_liouvilles_discrepancy_shows_a_wrong_matrix():
    """A change of a Jacobian that changes its determinant by 1e-5 is told as 1e-5."""
    orbit = solve_orbit(make_one_dof(), 60.0)
    assert orbit.liouville_error < 1e-8
    wrong = replace(orbit, jacobians=orbit.jacobians * np.array([1.0 + 5e-6, 1.0])[:, None, None])
    assert wrong.liouville_error == pytest.approx(1e-5, rel=1e-3)


# --- stability -----------------------------------------------------------------------------------


def test_bifurcations_are_undecided_and_the_branch_points_beside_them_are_sure(harmonic_branch):
    for special in harmonic_branch.special_points:
        if special.kind in ("LP", "PD"):
            assert special.orbit.stability.verdict == "undecided"
    for orbit in harmonic_branch.points[::10]:
        stability = orbit.stability
        assert stability.verdict == ("stable" if orbit.stable else "unstable")
        expected = math.log(abs(orbit.multipliers[0]))
        assert stability.log_modulus == pytest.approx(expected, abs=1e-12)


def test_stated_uncertainty_holds_against_a_finer_map(harmonic_branch):
    """It is an estimate for the worst Jacobian: never too small here, and not beyond all use."""
    shares = []
    for orbit in harmonic_branch.points[::10]:
        fine = replace(orbit.problem, flow=orbit.problem.flow.finer).jacobians(orbit.point, 1)
        change = abs(floquet_spectrum(fine).log_moduli[0] - orbit.log_moduli[0])
        shares.append(change / orbit.stability.uncertainty)
        assert orbit.stability.uncertainty < 1e-4
    assert max(shares) < 1.0


@pytest.mark.parametrize(
    ("log_modulus", "uncertainty", "verdict"),
    [(-1e-3, 1e-4, "stable"), (1e-3, 1e-4, "unstable"), (-1e-5, 1e-4, "undecided"),
     (1e-5, 1e-4, "undecided"), (0.5, math.inf, "undecided"), (-1.0, math.nan, "undecided")],
)  # fmt: skip
def test_verdict(log_modulus, uncertainty, verdict):
    assert Stability(1.0 + 0j, log_modulus, uncertainty).verdict == verdict


def test_stability_of_a_linear_mode_is_its_decay():
    """μ = exp(-ζΩT) in modulus, surely."""
    system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
                               excitation=[Unbalance("middle", 4.92e-6)])  # fmt: skip
    stability = solve_orbit(FlowMap(system), 20.0).stability
    assert stability.log_modulus == pytest.approx(-0.0142 * 2 * math.pi * 13.1 / 20.0, rel=1e-12)
    assert stability.uncertainty < 1e-6
    assert stability.verdict == "stable"
