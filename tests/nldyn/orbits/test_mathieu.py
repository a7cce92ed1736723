"""Multipliers, flips and branch points of an orbit whose variational equation is Mathieu's.

Two uncoupled coordinates x and y and three stops with quadratic law that never open, at x + y,
x - y and -x, have together the potential 4k(p + x) y²/2 + 8kp x²/2, up to a constant. The force on
x then makes it vibrate as a linear oscillator, x = A cos(ωt + φ), y = 0 is an orbit, and a small
y obeys y'' + c y' + (ω₂² + 4kp + 4kA cos(ωt + φ)) y = 0: Mathieu's equation with damping, exactly.
It proves the Jacobians of motions with three closed stops, and what is located by them.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from independent import mathieu_multipliers_of
from scipy.special import mathieu_a, mathieu_b

from nldyn import (
    HarmonicForce,
    Stop,
    System,
    continue_branch,
    continue_special,
    describe_special,
    solve_orbit,
)
from nldyn.curves import refine_special
from nldyn.orbits.orbit import Orbit

STIFFNESS, PRELOAD = 1.0, 1.0
OWN_X, OWN_Y = 1.0, 1.0  # squared frequencies of the coordinates without the stops
DAMPING_X = 0.1


def parametric_system(force: float, damping: float = 0.0) -> System:
    stops = [Stop(at, STIFFNESS, 2.0, gap=-PRELOAD) for at in ("x + y", "x - y")]
    third = Stop("x", 2.0 * STIFFNESS, 2.0, gap=-PRELOAD, direction=-1)
    return System.from_matrices(
        np.eye(2), np.diag([OWN_X, OWN_Y]),
        {"x": [1.0, 0.0], "x + y": [1.0, 1.0], "x - y": [1.0, -1.0]},
        damping=np.diag([DAMPING_X, damping]), stops=[*stops, third],
        excitation=[HarmonicForce("x", force)],
    )  # fmt: skip


def steady_response(omega, force):
    """Complex amplitude of x."""
    return force / (OWN_X + 8.0 * STIFFNESS * PRELOAD - omega**2 + 1j * DAMPING_X * omega)


def mathieu_numbers(omega, force, damping=0.0):
    """The numbers a and q of u'' + (a - 2q cos 2z) u = 0, with z = ωt/2 and y = u exp(-ct/2)."""
    a = 4.0 * (OWN_Y + 4.0 * STIFFNESS * PRELOAD - 0.25 * damping**2) / omega**2
    return a, 8.0 * STIFFNESS * abs(steady_response(omega, force)) / omega**2


def mathieu_multipliers(omega, force, damping):
    """Multipliers of y."""
    spring = OWN_Y + 4.0 * STIFFNESS * PRELOAD
    swing = 4.0 * STIFFNESS * abs(steady_response(omega, force))
    return mathieu_multipliers_of(omega, spring, swing, damping)


def orbit_at(omega: float, force: float, damping: float = 0.0) -> Orbit:
    """The orbit with y = 0, also where that is unstable."""
    response = steady_response(omega, force)
    system = parametric_system(force, damping)
    start = np.zeros(4)
    shape = system.participation["x"]
    start[:2], start[2:] = shape * response.real, shape * (1j * omega * response).real
    return solve_orbit(system, omega / (2.0 * math.pi), guess=start)


def omega_of(point) -> float:
    return 2.0 * math.pi * point.frequency_hz


@pytest.mark.parametrize("damping", [0.0, 0.15])
@pytest.mark.parametrize(
    ("omega", "force"),
    [(1.3, 4.0), (1.5, 5.0), (2.2, 2.5), (2.6, 1.5), (4.2, 5.0), (4.47, 9.0), (4.6, 9.0)],
)  # fmt: skip
def test_multipliers_are_those_of_mathieus_equation(omega, force, damping):
    orbit = orbit_at(omega, force, damping)
    assert orbit.max_abs_displacement == pytest.approx(abs(steady_response(omega, force)), rel=1e-9)
    spring = OWN_X + 8.0 * STIFFNESS * PRELOAD
    roots = np.roots([1.0, DAMPING_X, spring])
    expected = [
        *mathieu_multipliers(omega, force, damping),
        *np.exp(roots * 2.0 * math.pi / omega),
    ]
    left = list(orbit.multipliers)
    for mu in expected:
        nearest = min(left, key=lambda other, mu=mu: abs(other - mu))
        left.remove(nearest)
        assert abs(nearest - mu) < 1e-8 * max(1.0, abs(mu))


def test_flips_and_branch_points_of_a_branch_are_where_mathieu_has_them():
    """Multipliers of y at -1 and at 1, to either side of the tongues."""
    force, damping = 2.0, 0.05
    for window, kind, target in (((0.31, 0.41), "BP", 1.0), ((0.55, 0.8), "PD", -1.0)):
        branch = continue_branch(orbit_at(2.0 * math.pi * window[0], force, damping), window)
        assert [s.kind for s in branch.special_points] == [kind, kind]
        for special in branch.special_points:
            mu = mathieu_multipliers(omega_of(special), force, damping)
            assert np.abs(mu - target).min() < 1e-8
            # the motion of x is half-wave symmetric; what breaks is y = 0, of a system that is not
            assert ("pitchfork" in describe_special(special)) == (kind == "BP")
            assert "mirror" not in describe_special(
                special
            ) and "x(t + T/2)" not in describe_special(special)


def test_no_neimark_sacker_point_where_a_coordinate_has_no_damping():
    """Outside of its tongues the multipliers of y lie on the unit circle, and stay there."""
    branch = continue_branch(orbit_at(2.0 * math.pi * 0.31, 2.0), (0.31, 0.41))
    assert [s.kind for s in branch.special_points] == ["BP", "BP"]


def test_curve_of_flips_goes_round_the_first_tongue():
    """In frequency and force: the chart of Ince and Strutt, with a round tip due to damping."""
    damping = 0.05
    start = refine_special(SimpleNamespace(kind="PD", orbit=orbit_at(4.6, 2.0, damping)))
    window = ((0.6, 0.9), (0.1, 3.0))  # where x stays below the preload
    curve = continue_special(start, ("frequency_hz", "amplitude"), window)
    frequencies, forces = curve.values.T
    assert forces[[0, -1]] == pytest.approx([3.0, 3.0])
    assert forces.min() < 1.0
    for frequency_hz, force in curve.values[::3]:
        mu = mathieu_multipliers(2.0 * math.pi * frequency_hz, force, damping)
        assert np.abs(mu + 1.0).min() < 1e-8
    own = math.sqrt(OWN_Y + 4.0 * STIFFNESS * PRELOAD)
    ends = 2.0 * math.pi * frequencies[[0, -1]]
    assert (ends.min() - 2.0 * own) * (ends.max() - 2.0 * own) < 0.0


@pytest.mark.slow
def test_curve_of_branch_points_goes_round_the_second_tongue():
    """There y leaves zero to either side; the branch points are multipliers 1 of Mathieu's."""
    damping = 0.02
    branch = continue_branch(orbit_at(2.0 * math.pi * 0.31, 2.0, damping), (0.31, 0.41))
    curve = continue_special(
        branch.special_points[0], ("frequency_hz", "amplitude"), ((0.3, 0.4), (0.3, 2.5))
    )
    assert curve.values[[0, -1], 1] == pytest.approx([2.5, 2.5])
    assert curve.values[:, 1].min() < 1.5
    assert curve.residuals.max() < 1e-8
    for frequency_hz, force in curve.values[::3]:
        mu = mathieu_multipliers(2.0 * math.pi * frequency_hz, force, damping)
        assert np.abs(mu - 1.0).min() < 1e-8


@pytest.mark.parametrize(
    ("kind", "characteristic", "order", "window"),
    [
        ("PD", mathieu_b, 1, (4.0, 5.5)),
        ("PD", mathieu_a, 1, (3.5, 4.4)),
        ("BP", mathieu_b, 2, (2.0, 2.6)),
        ("BP", mathieu_a, 2, (1.5, 2.6)),
    ],
)
def test_edge_of_a_tongue_is_a_characteristic_value(kind, characteristic, order, window):
    """Without damping of y the edges of the unstable tongues are a = a_r(q) and a = b_r(q)."""
    force = 2.0

    def off(omega):
        a, q = mathieu_numbers(omega, force)
        return a - characteristic(order, q)

    omegas = np.linspace(*window, 2001)
    place = int(np.flatnonzero(np.diff(np.sign(off(omegas))))[0])
    guess = orbit_at(omegas[place], force)
    located = refine_special(SimpleNamespace(kind=kind, orbit=guess))
    a, q = mathieu_numbers(omega_of(located), force)
    assert a == pytest.approx(characteristic(order, q), rel=1e-9)
