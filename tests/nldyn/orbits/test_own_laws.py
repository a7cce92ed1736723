"""Orbits under laws of one's own say where their contacts are not resolved."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit

from nldyn import ConvergenceError, HarmonicForce, Stop, System, solve_orbit

K, TURN = 1e5, 1e-5


def turning(width: float):
    """K up to the depth TURN and 20 K from there on, over a width within which it is smooth."""

    @njit
    def law(depth, speed):
        x, start = (depth - TURN) / width, TURN / width
        grown = abs(x) + math.log1p(math.exp(-2.0 * abs(x)))
        grown -= start + math.log1p(math.exp(-2.0 * start))
        force = K * depth + 9.5 * K * (depth + width * grown)
        return force, K + 9.5 * K * (1.0 + math.tanh(x)), 0.0

    return law


def orbit_of(stops, **given):
    system = System.from_matrices(
        [[1.0]],
        [[4000.0]],
        {"x": [1.0]},
        modal_damping=0.02,
        stops=stops,
        excitation=[HarmonicForce("x", 2.0)],
    )
    return solve_orbit(system, 10.0, **given)


def test_a_steep_part_that_is_not_resolved_is_told():
    exact = orbit_of([Stop.linear("x", K, gap=1e-3), Stop.linear("x", 19 * K, gap=1e-3 + TURN)])
    own = orbit_of([Stop("x", K, 1.0, gap=1e-3, law=turning(1e-11))])
    assert np.max(np.abs(own.multipliers - exact.multipliers)) > 1e-5  # they are wrong,
    assert not own.resolved and "contacts resolved to" in repr(own)  # and it is told
    assert own.stability.verdict == "undecided"
    assert exact.resolved and "resolved" not in repr(exact)


def test_a_law_that_is_resolved_is_as_sure_as_a_stop_of_the_same_law():
    @njit
    def spring(depth, speed):
        return K * depth, K, 0.0

    exact = orbit_of([Stop.linear("x", K, gap=1e-3)])
    own = orbit_of([Stop("x", K, 1.0, gap=1e-3, law=spring)])
    assert own.resolved and "resolved" not in repr(own)
    assert own.multipliers == pytest.approx(exact.multipliers, abs=1e-8)
    assert own.stability.verdict == "stable" and own.stability.uncertainty < 1e-6


@pytest.mark.parametrize(
    "stops",
    [[Stop("x", 1.0, 3.0, direction=d) for d in (1, -1)], [Stop.linear("x", 3.0)]],
    ids=["cubic", "bilinear"],
)
def test_free_motions_without_damping_are_a_family(stops):
    system = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]}, stops=stops)
    with pytest.raises(
        ConvergenceError, match=r"family over the energy.*give excitation or damping"
    ):
        solve_orbit(system, 0.2, guess=np.array([0.5, 0.0]))
