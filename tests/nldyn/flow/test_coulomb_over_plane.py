"""Coulomb's friction over a plane without a spring: closed forms and an independent integration."""

import math

import numpy as np
import pytest
from hard_plane import Body
from sliding import monodromy, off_differences

from nldyn import (
    FlowMap,
    HarmonicForce,
    Parameter,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    load,
    save,
    solve_orbit,
)
from nldyn.system import DryFriction, Friction
from nldyn.system.chart import value_of, with_value

OMEGA = 0.8
HZ = OMEGA / (2.0 * math.pi)
TURN = np.array([0.0, 2.0 * math.pi])


def block(friction=0.3, size=1.0, turn=90.0, second="y", spring=None):
    """Mass 1 on springs 1 to both sides of a plane, on which 2 N press it."""
    return System.from_matrices(
        np.eye(2), np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=0.05 * np.eye(2),
        dampers=[DryFriction("x", 2.0, friction, None, spring, second)],
        excitation=[HarmonicForce("x", 1.0), HarmonicForce("y", size, turn)],
    )  # fmt: skip


def drawn(seed, kind):
    """A random structure that slides over a plane, the same for both ways."""
    rng = np.random.default_rng(seed)
    n = 3
    A = rng.normal(size=(n, n))
    M, K = np.diag(rng.uniform(0.5, 2.0, n)), A @ A.T + np.eye(n)
    C, names, unit = 0.05 * K + 0.02 * M, [f"x{i}" for i in range(n)], np.eye(n)
    omega, forces, turns = rng.uniform(0.5, 2.0), 3.0 * rng.random(n), rng.uniform(0.0, 360.0, n)
    a, b, c = rng.permutation(n)
    mu, belt = float(rng.uniform(0.05, 0.8)), float(rng.choice([0.0, 0.3]))
    law = Friction(mu, base_speed=(belt, -0.5 * belt))
    more = {"tangents": unit[[b, c]], "coefficient": mu, "base_speed": law.base_speeds}
    stops, dampers = [], []
    if kind == "constant":
        more["force"] = float(rng.uniform(2.0, 8.0))
        dampers = [DryFriction(names[b], more["force"], law, second_tangent=names[c])]
    else:
        sign, p = int(rng.choice([1, -1])), float(rng.choice([1.0, 1.5]))
        k, gap = float(rng.uniform(20.0, 200.0)), float(rng.uniform(-0.1, 0.5))
        more |= {"normal": sign * unit[a], "spring": k, "exponent": p, "gap": gap}
        rough = {"friction": law, "tangent": names[b], "second_tangent": names[c]}
        stops = [Stop(names[a], k, p, gap, sign, **rough)]
    turn = np.radians(turns)
    body = Body(M, C, K, lambda t: forces * np.cos(omega * t + turn), **more)
    system = System.from_matrices(
        M, K, dict(zip(names, unit, strict=True)), damping=C, stops=stops, dampers=dampers,
        excitation=[HarmonicForce(*row) for row in zip(names, forces, turns, strict=True)],
    )  # fmt: skip
    return system, body, omega, 0.7 * rng.normal(size=2 * n), float(rng.uniform(1.0, 3.0))


def bases(system):
    return np.array([system.participation[name] for name in system.interfaces])


def agrees(seed, kind):
    system, body, omega, start, turns = drawn(seed, kind)
    phases, flow, rows = turns * TURN, FlowMap(system), bases(system)
    modal = np.linalg.solve(rows, start.reshape(2, -1).T).T.ravel()
    z = flow.to_state(modal)[None]
    found, expected = flow.shoot(z, phases, omega), body.followed(start, phases[1] / omega)
    assert found.failure == ""
    ends = (rows @ flow.to_start(found.ends[0]).reshape(2, -1).T).T.ravel()
    np.testing.assert_allclose(ends, expected, atol=1e-8 * np.abs(expected).max())
    steps = (1e-4, 1e-5, 1e-6)
    assert min(off_differences(flow, found, z, phases, omega, step) for step in steps) < 1e-5
    return set(body.met)


@pytest.mark.parametrize(
    ("kind", "seed", "met"),
    [("constant", 26, {"stick", "slip"}), ("constant", 3, set()), ("stop", 3, {"open", "close"})],
)
def test_random_systems_agree_with_integration_from_event_to_event(kind, seed, met):
    assert agrees(seed, kind) >= met


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["constant", "stop"])
@pytest.mark.parametrize("seed", range(15))
def test_more_random_systems_agree(seed, kind):
    agrees(seed, kind)


def test_what_is_let_go_where_its_stop_lets_go_soon_leaves_in_one_panel():
    """Its friction falls with the force of the stop, which must be known before it can leave."""
    M, size, omega = np.diag([1.0, 2.0, 1.5]), np.array([2.0, 1.0, 0.5]), 0.6 * math.pi
    K = np.array([[3.0, -1.0, 0.0], [-1.0, 3.0, -0.5], [0.0, -0.5, 2.0]])
    C, unit, law = 0.05 * K + 0.02 * M, np.eye(3), Friction(0.3, base_speed=(0.05, -0.025))
    system = System.from_matrices(
        M, K, dict(zip("xyz", unit, strict=True)), damping=C,
        stops=[Stop("x", 60.0, 1.0, 0.3, friction=law, tangent="y", second_tangent="z")],
        excitation=[HarmonicForce(name, force) for name, force in zip("xyz", size, strict=True)],
    )  # fmt: skip
    body = Body(M, C, K, lambda t: size * np.cos(omega * t), unit[1:], 0.3, normal=unit[0],
                spring=60.0, gap=0.3, base_speed=law.base_speeds)  # fmt: skip
    flow, phases = FlowMap(system), 4.0 * TURN
    motion = flow.trajectory(flow.to_state(np.zeros(6))[None], phases, omega)
    expected = body.followed(np.zeros(6), phases[1] / omega)
    assert "slip" in body.met
    ends = flow.to_start(motion.states(phases[1:])[0]).reshape(2, -1) @ bases(system).T
    np.testing.assert_allclose(ends.ravel(), expected, atol=1e-9 * np.abs(expected).max())
    assert motion.record.used < 40


@pytest.mark.parametrize("friction", [0.1, 0.2, 0.4])
def test_along_one_tangent_it_is_friction_along_a_line(friction):
    """It turns where it comes to rest, stays and is let go; across, nothing is left of a speed."""
    line, plane = (FlowMap(block(friction, size=0.0, second=name)) for name in (None, "y"))
    start, phases = np.array([1.3, 0.0, -0.2, 0.0]), np.array([0.0, 17.0])
    expected = line.shoot(line.to_state(start)[None], phases, OMEGA)
    found = plane.shoot(plane.to_state(start)[None], phases, OMEGA)
    np.testing.assert_allclose(found.ends, expected.ends, atol=1e-9)
    np.testing.assert_allclose(found.jacobians[0, :2], expected.jacobians[0, :2], atol=1e-9)


def test_a_block_led_around_a_circle_goes_as_the_closed_form_says():
    """The force μN is against its speed: (1 - ω²)² X² + (0.05ω X + μN)² = 1; 2π X μN is lost."""
    orbit = solve_orbit(block(), HZ)
    a, b = (1.0 - OMEGA**2) ** 2 + (0.05 * OMEGA) ** 2, 0.05 * OMEGA * 0.6
    size = (-b + math.sqrt(b**2 + a * (1.0 - 0.6**2))) / a
    x = orbit.states(np.linspace(0.0, 2.0 * math.pi, 9))[:, :2]
    np.testing.assert_allclose(np.hypot(*x.T), size, rtol=1e-9)
    lag = math.atan2(0.05 * OMEGA * size + 0.6, (1.0 - OMEGA**2) * size)
    first = orbit.states(np.zeros(1))[0, :2] @ bases(orbit.system).T
    np.testing.assert_allclose(first, size * np.array([math.cos(lag), math.sin(lag)]), atol=1e-9)
    (found,) = orbit.friction
    assert found.loss == pytest.approx(0.6 * 2.0 * math.pi * size, rel=1e-9)
    assert found.distance == pytest.approx(2.0 * math.pi * size, rel=1e-9)
    assert found.pressed_distance == pytest.approx(4.0 * math.pi * size, rel=1e-9)
    assert found.peak_force == pytest.approx(0.6, rel=1e-9)
    assert (found.stuck, found.slid, found.open) == (0.0, pytest.approx(1.0), pytest.approx(0.0))


SLOW = 0.3  # ω of a motion that rests


def resting(friction=0.45, spring=None):
    return block(friction, 0.7, 40.0, spring=spring)


def test_an_orbit_that_rests_its_multipliers_and_balance():
    orbit = solve_orbit(resting(), SLOW / (2.0 * math.pi))
    largest = np.sort(np.abs(np.linalg.eigvals(monodromy(orbit))))[::-1]
    np.testing.assert_allclose(np.abs(orbit.multipliers), largest, atol=1e-6)
    (found,) = orbit.friction
    assert min(found.stuck, found.slid) > 0.2 and found.stuck + found.slid == pytest.approx(1.0)
    phases = np.linspace(0.0, 2.0 * math.pi, 40001)
    speed = orbit.states(phases)[:, 2:] @ bases(orbit.system).T
    drive = np.array([np.cos(phases), 0.7 * np.cos(phases + math.radians(40.0))]).T
    given = np.trapezoid(((drive - 0.05 * speed) * speed).sum(axis=1), phases) / SLOW
    assert given == pytest.approx(found.loss, rel=1e-6)
    assert found.loss == pytest.approx(0.45 * found.pressed_distance, rel=1e-9)


def test_a_branch_in_the_friction_is_kept_in_files(tmp_path):
    branch = continue_branch(
        solve_orbit(resting(0.35), SLOW / (2.0 * math.pi)),
        (0.3, 0.4),
        parameter=Parameter("friction", 0),
    )
    end = branch.points[-1]
    value = end.system.sliders[0].friction.coefficient
    alone = solve_orbit(resting(value), SLOW / (2.0 * math.pi))
    assert end.max_abs_displacement == pytest.approx(alone.max_abs_displacement, rel=1e-8)
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert again.points[-1].system.dampers == end.system.dampers
    np.testing.assert_array_equal(again.points[-1].multipliers, end.multipliers)


@pytest.mark.parametrize("name", ["friction", "normal_force"])
def test_derivatives_by_numbers_are_those_of_differences(name):
    system, parameter = resting(), Parameter(name, 0)
    phases, flow = np.array([0.0, 17.0]), FlowMap(system)
    start = flow.to_state(np.array([0.5, 0.3, 0.4, -0.2]))[None]
    exact = flow.shoot(start, phases, OMEGA, parameters=[parameter]).d_parameters[0, :, 0]
    value = value_of(system, 1.0, parameter)
    ends = [
        FlowMap(with_value(system, parameter, value * (1.0 + way))).shoot(start, phases, OMEGA).ends
        for way in (1e-6, -1e-6)
    ]
    slope = (ends[0] - ends[1])[0] / (2e-6 * value)
    np.testing.assert_allclose(exact, slope, atol=1e-6 * np.abs(exact).max())


def test_a_coefficient_that_changes_is_refused_in_a_sentence():
    with pytest.raises(SystemModelError, match="with a second_tangent has one coefficient"):
        DryFriction("x", 1.0, Friction(0.3, 0.4, 0.1), second_tangent="y")


@pytest.mark.parametrize("seed", [0, 4])
def test_derivatives_pass_sliding_over_one_plane_beside_rest_on_another(seed):
    rng, n, names = np.random.default_rng(seed), 5, "xyzuv"
    A, B = rng.normal(size=(n, n)), 0.3 * rng.normal(size=(n, n))
    M, K = np.eye(n) + B @ B.T, A @ A.T + np.eye(n)
    forces, phases = 3.0 * rng.random(n), rng.uniform(0.0, 360.0, n)
    dampers = [
        DryFriction("x", 0.5, 1.0, second_tangent="y"),
        DryFriction("z", 2.5, 1.0, second_tangent="u"),
    ]
    system = System.from_matrices(
        M, K, dict(zip(names, np.eye(n), strict=True)), damping=0.05 * K, dampers=dampers,
        excitation=[HarmonicForce(*row) for row in zip(names, forces, phases, strict=True)],
    )  # fmt: skip
    flow, turns = FlowMap(system), np.array([0.0, 0.6 * np.pi])
    z = flow.to_state(0.3 * rng.normal(size=2 * n))[None]
    found = flow.shoot(z, turns, 1.3)
    assert found.failure == ""
    steps = (1e-5, 1e-6)
    assert min(off_differences(flow, found, z, turns, 1.3, step) for step in steps) < 1e-6
