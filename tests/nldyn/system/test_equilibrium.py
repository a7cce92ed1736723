"""Structures that their stops press upon: where they rest, and orbits that close."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from nldyn import (
    ConstantForce,
    ConvergenceError,
    HarmonicForce,
    PolynomialSpring,
    Stop,
    System,
    SystemModelError,
    find_orbits,
    solve_orbit,
)
from nldyn.system.equilibrium import rest, rest_positions, tangent_stiffness

OWN = 20.0 * math.pi  # rad/s


def pressed(stiffness: float, gap: float, force: float) -> System:
    return System.from_modal(
        [10.0], {"m": [1.0]}, modal_damping=0.01, stops=[Stop("m", stiffness, gap=gap)],
        excitation=[HarmonicForce("m", force)],
    )  # fmt: skip


def depth_at_rest(stiffness: float, gap: float) -> float:
    """The spring pulls back with own² (gap + δ), the stop pushes with k δ^1.5."""
    found = brentq(lambda d: OWN**2 * (gap + d) + stiffness * d**1.5, 0.0, -gap, xtol=1e-300)
    return float(found)


@given(stiffness=st.floats(3.0, 16.0), gap=st.floats(-6.0, 0.0))
def test_a_mass_rests_where_its_forces_balance(stiffness, gap):
    k, g = 10.0**stiffness, -(10.0**gap)
    found = float(rest(pressed(k, g, 0.0))[0])
    assert found == pytest.approx(g + depth_at_rest(k, g), rel=1e-12)


@given(seed=st.integers(0, 10**6))
def test_several_stops_and_modes_are_in_balance_at_rest(seed):
    rng = np.random.default_rng(seed)
    stops = [
        Stop(at, 10.0 ** rng.uniform(5, 12), rng.uniform(1.0, 2.5), rng.uniform(-1e-3, 1e-3), side)
        for at in "ab"
        for side in (1, -1)
    ]
    modes = {"a": rng.standard_normal(3), "b": rng.standard_normal(3)}
    system = System.from_modal([3.0, 11.0, 40.0], modes, stops=stops)
    q = rest(system)
    pushes = [
        stop.stiffness * max(stop.direction * modes[stop.at] @ q - stop.gap, 0.0) ** stop.exponent
        for stop in stops
    ]
    force = system.natural_frequencies**2 * q
    for stop, push in zip(stops, pushes, strict=True):
        force = force + push * stop.direction * modes[stop.at]
    assert np.abs(np.linalg.solve(tangent_stiffness(system, q), force)).max() <= 1e-12  # m


def test_without_preload_a_structure_rests_at_zero():
    assert not np.any(rest(pressed(1e9, 1e-6, 1.0)))


@pytest.mark.parametrize("stiffness", [1e6, 1e9, 1e10, 1e12])
def test_small_motion_about_a_held_rest_is_found_without_a_guess(stiffness):
    """Against the amplitude of the linear motion with the slope of the stop's force."""
    gap, force, hz = -1e-3, 1e-3, 13.0
    depth = depth_at_rest(stiffness, gap)
    slope = OWN**2 + 1.5 * stiffness * math.sqrt(depth) - (2.0 * math.pi * hz) ** 2
    for orbit in (
        solve_orbit(pressed(stiffness, gap, force), hz),
        *find_orbits(pressed(stiffness, gap, force), hz, 1),
    ):
        places = orbit.states(np.linspace(0.0, 2.0 * math.pi, 400))[:, 0]
        assert orbit.stable and orbit.impacts == 0
        assert places.mean() == pytest.approx(gap + depth, rel=1e-6)
        assert 0.5 * np.ptp(places) == pytest.approx(force / slope, rel=0.02)


@pytest.mark.parametrize(
    ("stiffness", "gap", "force"),
    [
        pytest.param(1e15, -1.0, 1e-9, marks=pytest.mark.slow),  # 50 s
        pytest.param(1e15, -1.0, 30.0, marks=pytest.mark.slow),
        pytest.param(1e13, -1.0, 1e-9, marks=pytest.mark.slow),
        (1e11, -1.0, 1e-9),
        pytest.param(1e15, -1e-3, 1.0, marks=pytest.mark.slow),  # 15 s
    ],
)
def test_an_orbit_that_is_told_closes(stiffness, gap, force):
    """Newton's steps were short where the stop is stiff, without coming nearer to an orbit."""
    try:
        orbit = solve_orbit(pressed(stiffness, gap, force), 13.0)
    except ConvergenceError:
        return
    problem = orbit.problem
    nodes = problem.nodes(orbit.point)
    found = problem.flow.shoot(nodes, problem.phases, orbit.omega)
    open_by = np.linalg.norm(found.ends - np.roll(nodes, -1, axis=0))
    assert open_by <= 1e-7 * np.linalg.norm(nodes)


@pytest.mark.parametrize(
    ("stiffness", "coefficients", "force", "rests"),
    [
        (1.0, [-1.0, 0.0, 1.0], 0.1, [0.1 ** (1 / 3)]),  # no stiffness at zero
        (0.0, [0.0, 0.0, 1.0], 0.5, [0.5 ** (1 / 3)]),
        (0.0, [0.0, 0.0, 0.0, 0.0, 1.0], 0.5, [0.5**0.2]),
        (1.0, [-1.0, 0.0, 1.0], 0.0, [0.0]),
        (1.0, [-1.0, 0.0, -1.0], 0.0, []),  # it falls away by the fourth power
        (1.0, [-1.0, 1.0], -0.1, []),
        (1.0, [-1.0], 0.1, []),
    ],
)
def test_rest_on_a_spring_that_has_no_stiffness_at_zero(stiffness, coefficients, force, rests):
    system = System.from_matrices(
        [[1.0]], [[stiffness]], {"x": [1.0]}, springs=[PolynomialSpring("x", coefficients)],
        excitation=[ConstantForce("x", force)],
    )  # fmt: skip
    if not rests:
        with pytest.raises(SystemModelError, match="has no rest position"):
            rest_positions(system)
    else:
        assert [q[0] for q in rest_positions(system)] == pytest.approx(rests, abs=1e-12)


def test_a_free_mass_beside_a_nonlinear_spring_falls_on_its_stop():
    system = System.from_matrices(
        np.eye(2), np.zeros((2, 2)), {"a": [1.0, 0.0], "b": [0.0, 1.0]},
        springs=[PolynomialSpring("a", [0.0, 0.0, 1.0])],
        stops=[Stop.linear("b", 50.0, gap=0.1)],
        excitation=[ConstantForce("a", 0.3), ConstantForce("b", 2.0)],
    )  # fmt: skip
    (q,) = rest_positions(system)
    rows = np.array([system.participation[name] for name in "ab"])
    assert rows @ q == pytest.approx([0.3 ** (1 / 3), 0.14], rel=1e-9)
