"""Pairs of special points within a step, told by Jacobians interpolated beside it."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from hard.continuation import beam
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from nldyn import ContinuationOptions, continue_branch, solve_orbit
from nldyn.bifurcations.hidden_multipliers import dips_towards_circle
from nldyn.bifurcations.hidden_pairs import Between

PLACES = (-0.8, 0.0, 1.0, 1.9)


def turned(logarithm):
    """Real matrix with the eigenvalues of exp of a complex matrix, and their conjugates."""
    a = expm(np.asarray(logarithm, dtype=complex))
    return np.block([[a.real, -a.imag], [a.imag, a.real]])


def looked(family, places=PLACES):
    """What is said of a step of a family of matrices, whose ends are at 0 and 1."""
    orbits = []
    for place in places:
        matrix = family(place)
        values = np.linalg.eigvals(matrix).astype(complex)
        orbits.append(SimpleNamespace(jacobians=matrix[None], multipliers=values))
    return Between(orbits, places).where_to_look()


def bubble(off, coupling, where, speed=0.4, angle=1.0):
    """Two pairs of opposite signature that pass one another: ln μ = iθ - off ± √(κ² - (Δθ/2)²)."""

    def at(sigma):
        half = 0.5 * speed * (sigma - where)
        upper, lower = 1j * (angle + half) - off, 1j * (angle - half) - off
        return turned([[upper, coupling], [coupling, lower]])

    return at


@given(
    off=st.floats(1e-3, 0.015),
    above=st.floats(1.05, 1.5),
    where=st.floats(0.15, 0.85),
)
def test_pairs_that_meet_and_leave_the_circle_within_a_step_are_looked_at(off, above, where):
    """Multipliers at both ends are off the circle by the same; between they come out."""
    family = bubble(off, above * off, where)
    for sigma in (0.0, 1.0):
        assert np.abs(np.linalg.eigvals(family(sigma))).max() < 1.0
    assert np.abs(np.linalg.eigvals(family(where))).max() > 1.0
    assert looked(family) is not None


@given(off=st.floats(0.01, 0.03), share=st.floats(0.0, 0.6), where=st.floats(0.1, 0.9))
def test_pairs_that_meet_well_inside_are_not_looked_at(off, share, where):
    """Orbits are computed only where they may tell something."""
    assert looked(bubble(off, share * off, where)) is None


def alone(top, low):
    """One pair whose modulus rises to a top half-way through the step, and one far inside."""

    def at(sigma):
        rise = top - low * (2.0 * sigma - 1.0) ** 2
        return turned(np.diag([rise + 1j * (0.7 + 0.1 * sigma), -1.0 + 2.0j]))

    return at


def test_a_pair_that_comes_to_the_circle_alone_is_looked_at():
    assert looked(alone(1e-3, 0.02)) is not None
    assert looked(alone(-1e-2, 0.02)) is None


def test_one_pair_out_and_another_in_are_looked_at():
    """As many are outside at both ends, and the product of all tests has the same sign."""

    def at(sigma):
        return turned(np.diag([0.05 * (sigma - 0.6) + 1.0j, 0.05 * (0.4 - sigma) + 2.0j]))

    assert looked(at) is not None
    assert looked(lambda sigma: at(0.3 * sigma)) is None


def test_a_pair_that_becomes_real_and_returns_is_looked_at():
    """On the negative axis the two part; the larger one passes -1 twice, two flips."""

    def at(sigma, reach=0.05):
        away = 0.02 + 4.0 * reach * (sigma - 0.5) ** 2 - 0.025  # (θ - π)², below 0: two real ones
        matrix = -np.exp(-0.05) * expm(np.array([[0.0, -away], [1.0, 0.0]]))
        rest = 0.3 * np.eye(2)
        return np.block([[matrix, np.zeros((2, 2))], [np.zeros((2, 2)), rest]])

    values = np.linalg.eigvals(at(0.5))
    assert values.real.min() < -1.0 and np.abs(np.linalg.eigvals(at(0.0))).max() < 1.0
    assert looked(at) is not None


def test_multipliers_that_only_turn_are_not_looked_at():
    def at(sigma):
        return turned(np.diag([1j * (1.0 + 0.1 * sigma) - 0.01, 1j * (2.0 + 0.3 * sigma) - 0.01]))

    assert looked(at) is None


def test_two_points_alone_are_looked_between():
    """Nothing tells what multipliers near the circle do between two points without a third."""
    assert looked(bubble(0.01, 0.005, 0.5), (0.0, 1.0)) == 0.5


# --- branches of the 4-DOF model -----------------------------------------------------------------

SHORT = ContinuationOptions(first_step=0.0005, max_step=0.0005)
LONG = ContinuationOptions(first_step=0.02)


@cache
def found(start, ends, options):
    """Neimark-Sacker points of the harmonic branch at ξ = 0.001, from an orbit at a frequency."""
    branch = continue_branch(solve_orbit(beam(1e-3), start), ends, options=options)
    assert not branch.notes
    return sorted(s.frequency_hz for s in branch.special_points if s.kind == "NS")


# two pairs pass one another, and for 0.003 Hz one of them is outside, by 1e-5; 0.016 Hz apart one
# pair comes in and another goes out, so that as many as before are outside
TOUCH = (63.61, (63.55, 63.75), 3, (63.3, 64.0), [63.40, 63.45, 63.50, 63.55, 63.75])
EXCHANGE = (28.74, (28.715, 28.765), 2, (28.55, 29.1), [28.60, 28.68, 28.70, 28.90, 29.0])


@pytest.mark.parametrize(
    ("middle", "range_hz", "count", "wide_hz", "start"),
    [(*case, start) for *case, starts in (TOUCH, EXCHANGE) for start in starts],
)
def test_pairs_at_the_circle_are_found_from_any_start(middle, range_hz, count, wide_hz, start):
    expected = found(middle, range_hz, SHORT)
    assert len(expected) == count
    inside = [hz for hz in found(start, wide_hz, LONG) if range_hz[0] < hz < range_hz[1]]
    assert inside == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize(
    ("roots", "near"), [((0.75, 0.87), True), ((0.6, 0.6001), True), ((1.5, 2.5), False)]
)
def test_a_multiplier_that_comes_to_the_circle_beside_the_middle_of_three_is_found(roots, near):
    """Its ln|μ| is a parabola, whose roots are known: within the three sets or behind them."""
    places = np.array([0.0, 0.5, 1.0])
    heights = -0.01 * (places - roots[0]) * (places - roots[1])
    sets = np.array([[np.exp(complex(h, 1.0)), np.exp(complex(h, -1.0))] for h in heights])
    assert dips_towards_circle(places, sets, np.zeros(3)).tolist() == [False, near, False]
