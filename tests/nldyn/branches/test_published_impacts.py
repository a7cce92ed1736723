"""Published numbers of impact oscillators, to the digits that were printed."""

import math

import numpy as np
import pytest
from one_impact import OneImpact

from nldyn import (
    ConstantForce,
    HarmonicForce,
    RigidStop,
    System,
    Unbalance,
    cascade,
    continue_branch,
    impacts,
    solve_orbit,
)

G, TABLE = 9.81, 1e-4  # a table that moves by 0.01 cm
TURN = 2.0 * math.pi


def test_the_impacting_orbit_of_recipes_for_continuation():
    """x'' + 0.1 x' + x = A cos t against a stop at 1 with the restitution 0.8.

    Dankowicz and Schilder (2013), *Recipes for Continuation*, SIAM, example 15.2, begin at A = 1
    with an orbit through (-0.98, -0.29) at half the period that leaves the stop at the phase 0.076
    with -1.36 (their `demo_impact.m`). Followed in A, it grazes, where the linear response reaches
    the stop, behind a fold, where impacts reach it at one phase only.
    """
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.1]], stops=[RigidStop("x", 0.8, 1.0)],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    orbit = solve_orbit(system, 1.0 / TURN)
    hits = impacts(orbit)
    assert 0.8 * hits.speed == pytest.approx([1.36], abs=0.005)
    assert np.radians(hits.phase_deg) == pytest.approx([0.076], abs=0.0005)
    assert orbit.states(np.array([math.pi]))[0] == pytest.approx([-0.98, -0.29], abs=0.005)
    curve = continue_branch(orbit, (0.01, 1.05), parameter="amplitude")
    assert [special.kind for special in curve.special_points] == ["GR", "LP"]
    shape = OneImpact([[1.0]], [[1.0]], [[0.1]], [1.0], [1.0], 1.0, 0.8)
    graze, fold = (special.value for special in curve.special_points)
    assert graze == pytest.approx(0.1, rel=1e-10)
    assert fold == pytest.approx(1.0 / shape.reach(1.0, 1), rel=1e-9)


def ball(restitution, table):
    """A ball of 1 kg seen from a table that moves by `table` m, and its start from one impact.

    It hits the table with g T / (1 + e) once in each of its periods T = 1/60 s.
    """
    period, omega = 1.0 / 60.0, TURN * 60.0
    speed = G * period / (1.0 + restitution)
    phase = -math.asin(0.5 * (1.0 - restitution) * speed / (table * omega))
    t = -phase / omega
    swing = math.cos(phase) - omega * t * math.sin(phase) - 1.0
    start = [
        restitution * speed * t - 0.5 * G * t**2 + table * swing,
        restitution * speed - G * t - table * omega * math.sin(phase),
    ]
    system = System.from_matrices(
        [[1.0]], [[0.0]], {"ball": [1.0]}, stops=[RigidStop("ball", restitution, direction=-1)],
        excitation=[Unbalance("ball", table), ConstantForce("ball", -G)],
    )  # fmt: skip
    return system, start


def shaking(hz, table=TABLE):
    """Largest acceleration of the table over g."""
    return table * (TURN * hz) ** 2 / G


def lost_stability(restitution):
    """Shaking at which the ball's orbit of period 1 flips.

    √(π² (1 - e)² + 4 (1 + e²)²/(1 + e)²) / (1 + e) [Luck and Mehta 1993, *Phys. Rev. E* 48, 3988].
    """
    e = restitution
    return math.hypot(math.pi * (1.0 - e), 2.0 * (1.0 + e * e) / (1.0 + e)) / (1.0 + e)


def test_the_cascade_of_the_bouncing_ball():
    """The first two flips at table amplitudes of 0.0106 and 0.0115 cm, and the numbers behind.

    Tufillaro, Abbott and Reilly (1992), *An Experimental Approach to Nonlinear Dynamics and Chaos*,
    Addison-Wesley, figure 1.16 (e = 0.5). Their ratio does not depend on the frequency. The first
    orbit is born at π (1 - e) / (1 + e). Ratios of the steps tend to 4.669 [Feigenbaum 1978].
    """
    system, start = ball(0.5, TABLE)
    branch = continue_branch(solve_orbit(system, 60.0, guess=start), (45.0, 70.0))
    fold, flip = branch.special_points
    assert (fold.kind, flip.kind) == ("LP", "PD")
    assert shaking(fold.frequency_hz) == pytest.approx(math.pi / 3.0, rel=1e-10)
    assert shaking(flip.frequency_hz) == pytest.approx(lost_stability(0.5), rel=1e-9)
    flips = np.array([special.frequency_hz for special in cascade(flip, depth=3).flips])
    amplitudes = flips[:2] ** 2
    assert 0.01145 / 0.01065 < amplitudes[1] / amplitudes[0] < 0.01155 / 0.01055
    steps = np.diff(shaking(flips))
    assert steps[-2] / steps[-1] == pytest.approx(4.669, abs=0.05)


def test_a_ball_without_restitution_flips():
    """Where it leaves the table at once the orbit of period 1 is lost at √(π² + 4) = 3.7242."""
    table = 3.4 * G / (TURN * 60.0) ** 2
    system, start = ball(0.0, table)
    branch = continue_branch(solve_orbit(system, 60.0, guess=start), (59.0, 64.0))
    (flip,) = branch.special_points
    assert flip.kind == "PD"
    assert shaking(flip.frequency_hz, table) == pytest.approx(math.hypot(math.pi, 2.0), rel=1e-9)
