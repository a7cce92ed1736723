"""Impacts on both sides, the impact damper, and folds and flips of one impact per n periods."""

import math

import numpy as np
import pytest
from one_impact import OneImpact
from scipy.optimize import brentq

from nldyn import (
    FlowMap,
    HarmonicForce,
    RigidStop,
    System,
    continue_branch,
    impacts,
    solve_orbit,
)

TURN = 2.0 * math.pi


def pair(restitution=0.7, gap=0.4, stiffness=0.0, damping=0.0):
    """A mass between two stops, alike on both sides, and its closed form."""
    numbers = [[1.0]], [[stiffness]], [[damping]]
    system = System.from_matrices(
        numbers[0], numbers[1], {"x": [1.0]}, damping=numbers[2],
        stops=[RigidStop("x", restitution, gap, side) for side in (1, -1)],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    return system, OneImpact(*numbers, [1.0], [1.0], gap, restitution)


def damper(mass=0.1, clearance=0.6, restitution=0.6):
    """An oscillator with a container in which a mass moves freely, and its closed form.

    [Masri and Caughey 1966, *J. Appl. Mech.* 33, 586-592]
    """
    matrices = np.diag([1.0, mass]), np.diag([1.0, 0.0]), np.diag([0.04, 0.0])
    system = System.from_matrices(
        matrices[0], matrices[1], {"box": [1.0, 0.0], "ball": [0.0, 1.0]}, damping=matrices[2],
        stops=[RigidStop("ball", restitution, clearance, side, "box") for side in (1, -1)],
        excitation=[HarmonicForce("box", 0.1)],
    )  # fmt: skip
    return system, OneImpact(*matrices, [0.1, 0.0], [-1.0, 1.0], clearance, restitution)


def begin(shape, omega, motion):
    """Displacements and velocities at phase zero: half a period mirrors the motion."""
    if motion.phase >= math.pi:
        state = shape.state(omega, motion, TURN)
    else:
        state = -shape.state(omega, motion, math.pi)
    return state.reshape(2, -1)


def check_pair(system, shape, names, omega):
    """The orbit, with speed, phase and multipliers of the closed form to 1e-9."""
    motion = shape.motions(omega, 0.5)[0]
    rows = np.array([system.participation[name] for name in names])
    start = np.concatenate([np.linalg.solve(rows, y) for y in begin(shape, omega, motion)])
    orbit = solve_orbit(system, omega / TURN, guess=start)
    hits = impacts(orbit)
    assert hits.speed == pytest.approx([motion.speed] * 2, rel=1e-9)
    apart = (np.radians(hits.phase_deg) - motion.phase) % math.pi
    assert np.minimum(apart, math.pi - apart).max() < 1e-9
    off = np.abs(orbit.multipliers[:, None] - motion.multipliers)
    assert off.min(axis=0).max() < 1e-9 * np.abs(motion.multipliers).max()
    assert orbit.liouville_error < 1e-9
    return orbit


@pytest.mark.parametrize(
    ("numbers", "omega", "between"),
    [((0.7, 0.4, 0.0, 0.0), 2.3, (1.85, 1.9)), ((0.8, 0.3, 1.0, 0.1), 0.95, (1.0, 1.09))],
    ids=["free", "on a spring"],
)
def test_a_mass_hits_two_stops_in_turn_until_its_symmetry_breaks(numbers, omega, between):
    """An impact pair: the map over half a period, mirrored, has the eigenvalue -1 there."""
    system, shape = pair(*numbers)
    orbit = check_pair(system, shape, ["x"], omega)

    def broken(omega):
        motion = shape.motions(omega, 0.5)[0]
        return np.linalg.det(shape.map_between(omega, 0.5, *motion[:3]) + np.eye(2))

    edge = brentq(broken, *between, xtol=1e-14) / TURN
    hz = omega / TURN
    branch = continue_branch(orbit, (min(hz, 0.99 * edge), max(hz, 1.01 * edge)))
    (special,) = branch.special_points
    assert special.kind == "BP"
    assert special.frequency_hz == pytest.approx(edge, rel=1e-9)


def test_an_impact_damper_hits_both_sides_in_turn():
    check_pair(*damper(), ["box", "ball"], 1.1)


@pytest.mark.parametrize(
    ("periods", "folds", "flips"), [(2, (3.4, 3.7), (2.6, 2.8)), (3, (4.9, 5.1), (4.0, 4.3))]
)
def test_folds_and_flips_of_one_impact_in_n_periods(periods, folds, flips):
    """The gap is the farthest that impacts can be at a fold; -1 is an eigenvalue at a flip."""
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.1]], stops=[RigidStop("x", 0.8, 0.3)],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    shape = OneImpact([[1.0]], [[1.0]], [[0.1]], [1.0], [1.0], 0.3, 0.8)
    edge = brentq(lambda omega: shape.reach(omega, periods) - 0.3, *folds, xtol=1e-14)

    def doubled(omega):
        motion = shape.motions(omega, periods)[0]
        return np.linalg.det(shape.map_between(omega, periods, *motion[:3]) + np.eye(2))

    flip = brentq(doubled, *flips, xtol=1e-14)
    omega = 0.5 * (edge + flip)
    motion = shape.motions(omega, periods)[0]
    start = shape.state(omega, motion, TURN * math.ceil(motion.phase / TURN))
    orbit = solve_orbit(system, omega / TURN, period=periods, guess=start)
    branch = continue_branch(orbit, (0.99 * flip / TURN, 1.1 * edge / TURN))
    found = {special.kind: special.frequency_hz for special in branch.special_points}
    assert found["PD"] == pytest.approx(flip / TURN, rel=1e-9)
    assert found["LP"] == pytest.approx(edge / TURN, rel=1e-9)


def test_beside_grazing_the_map_has_the_root_with_the_coefficient_of_nordmark():
    """A motion that would exceed the gap by d hits it with v = √(2 a d) (1 + O(d)).

    That changes its velocity by (1 + e) v, and derivatives by (1 + e) a / v [Nordmark 1991]. Here
    in closed form: x'' + x = 0 with the amplitude 1 + d.
    """
    e = 0.6
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, stops=[RigidStop("x", e, 1.0)],
        excitation=[HarmonicForce("x", 0.0)],
    )  # fmt: skip
    flow = FlowMap(system)
    for excess in (1e-3, 1e-5, 1e-7):
        speed = math.sqrt(excess * (2.0 + excess))
        start = flow.to_state(np.array([-1.0 - excess, 0.0]))[None]
        found = flow.shoot(start, np.array([0.0, TURN]), 1.0)
        assert found.closings.tolist() == [1]
        off = flow.to_modal(found.ends)[0] - [-1.0 - excess, 0.0]
        # the kick of the velocity at an angle atan(v) before the top, turned to the end
        kick, angle = -(1.0 + e) * speed, math.pi + math.atan(speed)
        assert off == pytest.approx([kick * math.sin(angle), kick * math.cos(angle)], abs=1e-9)
        assert np.abs(off).max() == pytest.approx((1.0 + e) * math.sqrt(2.0 * excess), rel=excess)
        saltation = np.array([[-e, 0.0], [-(1.0 + e) / speed, -e]])
        first, last = turn(math.pi - math.atan(speed)), turn(math.pi + math.atan(speed))
        exact = last @ saltation @ first
        modal = [flow.to_modal((found.jacobians[0] @ z)[None])[0] for z in flow.to_state(np.eye(2))]
        assert np.abs(np.array(modal).T - exact).max() < 1e-9 / speed


def turn(angle):
    """Flight of x'' + x = 0."""
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
