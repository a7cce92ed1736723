"""Orbits under laws of one's own say where their contacts are not resolved."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numba import njit

from nldyn import (
    ConstantForce,
    ConvergenceError,
    HarmonicForce,
    RigidStop,
    Stop,
    System,
    Unbalance,
    continue_branch,
    solve_orbit,
)

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


E, SHAKE, G, STIFF = 0.8, 1e-3, 9.81, 1e7  # a ball on a table that shakes


def constant_restitution(v0: float):
    """A hysteresis that sets in within a speed of v0 and loses the same share at any other one."""
    loss = (1 - E**2) / (1 + E**2)

    @njit
    def law(depth, speed):
        t = math.tanh(speed / v0)
        grown = STIFF * (1.0 + loss * t)
        return depth * grown, grown, STIFF * depth * loss * (1.0 - t * t) / v0

    return law


def bouncing(stop):
    """The orbit at 15 Hz with one impact, at the phase at which the rigid table has it."""
    system = System.from_matrices(
        [[1.0]], [[0.0]], {"x": [1.0]}, stops=[stop],
        excitation=[Unbalance("x", SHAKE), ConstantForce("x", -G)],
    )  # fmt: skip
    rate, leave = 2 * math.pi * 15.0, 0.5 * G / 15.0  # half a period of free fall
    hit = math.asin(leave * (1 - E) / (1 + E) / (SHAKE * rate))
    since = hit / rate
    place = SHAKE * math.cos(hit) + leave * since - 0.5 * G * since**2 - SHAKE
    return solve_orbit(system, 15.0, guess=np.array([place, leave - G * since]))


def test_a_steep_hysteresis_is_resolved_or_told():
    """Multipliers of the modulus e, but for the weight beside the force of the contact."""
    close = G / (0.29 * math.sqrt(STIFF))
    for v0, resolved in ((0.01, True), (0.001, False)):
        orbit = bouncing(Stop("x", STIFF, 1.0, direction=-1, law=constant_restitution(v0)))
        assert orbit.impacts == 1
        assert abs(orbit.multipliers) == pytest.approx(E, rel=close)
        assert orbit.resolved == resolved
        assert orbit.stability.verdict == ("stable" if resolved else "undecided")


def test_a_rigid_table_flips_where_the_closed_form_says():
    """1 + tr + e² = 0: with r = (1 - e)/(1 + e), Aω² = g times the hypotenuse of 1 + r² and πr."""
    branch = continue_branch(bouncing(RigidStop("x", E, direction=-1)), (14.9, 16.5))
    r = (1 - E) / (1 + E)
    exact = math.sqrt(G * math.hypot(1 + r**2, math.pi * r) / SHAKE) / (2 * math.pi)
    (flip,) = branch.special_points
    assert flip.kind == "PD" and flip.frequency_hz == pytest.approx(exact, rel=1e-8)
    assert exact == pytest.approx(16.3123, abs=5e-5)


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
