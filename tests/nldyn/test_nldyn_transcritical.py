"""Two branches of orbits that cross: a transcritical branch point.

To the system of `test_nldyn_mathieu` two stops at y are added whose forces cancel at y = 0 but
bend differently, k(p + y)² against k(p - y)³ with p = 1. So y = 0 still is an orbit, on which y
obeys Mathieu's equation, but y and -y are no longer alike: where a multiplier of y is 1, another
branch goes through from y > 0 to y < 0.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from test_nldyn_mathieu import mathieu_multipliers_of

from nldyn import (
    ContinuationOptions,
    HarmonicForce,
    Parameter,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    continue_special,
    describe,
    refine_special,
    solve_orbit,
    switch_at_branch_point,
)

FORCE, DAMPING_X, DAMPING_Y = 9.0, 0.1, 0.02
OWN_X, OWN_Y, PRELOAD = 20.0, 1.0, 1.0
SPRING_X, SPRING_Y = OWN_X + 8.0, OWN_Y + 4.0 + 2.0 + 3.0


def system() -> System:
    quadratic = [Stop(at, 1.0, 2.0, gap=-PRELOAD) for at in ("x + y", "x - y", "y")]
    others = [Stop("x", 2.0, 2.0, -PRELOAD, -1), Stop("y", 1.0, 3.0, -PRELOAD, -1)]
    return System.from_matrices(
        np.eye(2), np.diag([OWN_X, OWN_Y]),
        {"x": [1.0, 0.0], "y": [0.0, 1.0], "x + y": [1.0, 1.0], "x - y": [1.0, -1.0]},
        damping=np.diag([DAMPING_X, DAMPING_Y]), stops=[*quadratic, *others],
        excitation=[HarmonicForce("x", FORCE)],
    )  # fmt: skip


def multipliers_of_y(hz, force=FORCE):
    omega = 2.0 * math.pi * hz
    amplitude = abs(force / (SPRING_X - omega**2 + 1j * DAMPING_X * omega))
    return mathieu_multipliers_of(omega, SPRING_Y, 4.0 * amplitude, DAMPING_Y)


@pytest.fixture(scope="module")
def branch():
    hz = 0.45
    omega = 2.0 * math.pi * hz
    response = FORCE / (SPRING_X - omega**2 + 1j * DAMPING_X * omega)
    shape = system().participation["x"]
    start = np.outer([response.real, (1j * omega * response).real], shape).ravel()
    return continue_branch(solve_orbit(system(), hz, guess=start, observe="y"), (hz, 0.56))


def test_branch_points_are_where_a_multiplier_of_mathieus_equation_is_one(branch):
    points = branch.special_points
    assert [s.kind for s in points] == ["BP", "BP"]
    for special in points:
        assert np.abs(multipliers_of_y(special.frequency_hz) - 1.0).min() < 1e-8
        refined = refine_special(special)
        assert refined.frequency_hz == pytest.approx(special.frequency_hz, rel=1e-9)
        assert "transcritical" in describe(special)


@pytest.mark.parametrize("index", [0, 1])
def test_the_other_branch_goes_through_and_exchanges_stability(branch, index):
    """To either side of the point it has the multiplier on the other side of 1."""
    special = branch.special_points[index]
    starts = switch_at_branch_point(special, 1e-3)
    sides = np.sign([s.orbit.frequency_hz - special.frequency_hz for s in starts])
    assert sorted(sides) == [-1.0, 1.0]
    for start in starts:
        assert start.orbit.max_abs_displacement > 1e-5  # of y, zero on the first branch
        own = multipliers_of_y(start.orbit.frequency_hz)
        critical = own[np.argmin(np.abs(own - 1.0))].real
        mu = start.orbit.multipliers
        other = mu[np.argmin(np.abs(mu - 1.0))].real
        assert (critical - 1.0) / (other - 1.0) == pytest.approx(-1.0, rel=0.1)


def test_transcritical_points_are_followed_where_y_can_stay_zero(branch):
    """Force and frequency leave y = 0 an orbit; the gap of a stop at y does not."""
    special = branch.special_points[0]
    few = ContinuationOptions(max_points=5)
    window = ((0.4, 0.6), (7.0, 12.0))
    curve = continue_special(special, ("frequency_hz", "amplitude"), window, options=few)
    assert np.ptp(curve.values[:, 1]) > 0.5
    for hz, force in curve.values:
        assert np.abs(multipliers_of_y(hz, force) - 1.0).min() < 1e-8
    gap = Parameter("gap", 2)
    with pytest.raises(SystemModelError, match="dissolves when frequency_hz or gap changes"):
        continue_special(special, ("frequency_hz", gap), ((0.4, 0.6), (-1.1, -0.9)))
