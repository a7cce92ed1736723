"""Rigid stops: impacts, rest and their sensitivities, against closed forms and an integrator."""

import math
from dataclasses import replace

import numpy as np
import pytest
from event_driven import MOST_HITS, PiecewiseLinear, integrate
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from nldyn import (
    BaseMotion,
    ConstantForce,
    ConvergenceError,
    Damper,
    FlowMap,
    HarmonicForce,
    Parameter,
    PolynomialSpring,
    RigidStop,
    Spring,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    impacts,
    simulate,
    solve_orbit,
)
from nldyn.orbits.starts import random_states
from nldyn.system import CubicDamper

G = 9.81
TURN = 2.0 * np.pi
PERIOD = np.array([0.0, TURN])


def ball(restitution, table=0.0, frequency_hz=10.0):
    """A ball of 1 kg on a table that shakes with the acceleration -table g cos ωt, seen from it."""
    return System.from_matrices(
        [[1.0]], [[0.0]], {"ball": [1.0]}, stops=[RigidStop("ball", restitution, direction=-1)],
        excitation=[HarmonicForce("ball", table * G), ConstantForce("ball", -G)],
    )  # fmt: skip


def random_system(rng):
    """1 to 4 masses with 1 to 3 rigid stops, and what `integrate` needs to know of them."""
    n, count = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    root = rng.normal(size=(n, n))
    stiffness = root @ root.T + np.eye(n)
    damping = 0.05 * stiffness
    names = {f"x{i}": np.eye(n)[i] for i in range(n)}
    stops, plain = [], []
    for _ in range(count):
        at, direction = int(rng.integers(n)), int(rng.choice([-1, 1]))
        against = int(rng.integers(n)) if n > 1 and rng.random() < 0.3 else at
        gap, restitution = float(rng.uniform(0.05, 0.5)), float(rng.uniform(0.5, 1.0))
        c = direction * (np.eye(n)[at] - (np.eye(n)[against] if against != at else 0.0))
        other = f"x{against}" if against != at else None
        stops.append(RigidStop(f"x{at}", restitution, gap, direction, other))
        plain.append((c, gap, restitution))
    force = np.abs(rng.normal(size=n))
    system = System.from_matrices(
        np.eye(n), stiffness, names, damping=damping, stops=stops,
        excitation=[HarmonicForce(f"x{i}", float(force[i])) for i in range(n)],
    )  # fmt: skip
    return system, stiffness, damping, force, plain


def check_random(seed, max_step=0.2):
    rng = np.random.default_rng(seed)
    system, stiffness, damping, force, plain = random_system(rng)
    omega, n = float(rng.uniform(0.5, 2.0)), system.size
    start = np.concatenate([np.zeros(n), rng.normal(size=n)])
    duration = 2.0 * np.pi / omega
    end, hits, slowest = integrate(
        np.eye(n), stiffness, damping, lambda t: force * np.cos(omega * t), plain, start, duration,
        max_step,
    )  # fmt: skip
    if slowest < 1e-2 or hits.sum() > MOST_HITS:  # errors grow near a graze; it knows no rest
        return 0
    flow = FlowMap(system)
    modal = np.concatenate([to_modal(system, start[:n]), to_modal(system, start[n:])])
    found = flow.shoot(flow.to_state(modal)[None], PERIOD, omega)
    assert not found.failure
    assert found.closings.tolist() == hits.tolist()
    rows = np.array([system.participation[f"x{i}"] for i in range(n)])
    q = flow.to_modal(found.ends)[0]
    seen = np.concatenate([rows @ q[:n], rows @ q[n:]])
    growth = 1.0 + np.abs(found.jacobians).max()
    assert np.abs(seen - end).max() < 1e-10 * growth
    return int(hits.sum())


def to_modal(system, x):
    rows = np.array([system.participation[f"x{i}"] for i in range(system.size)])
    return np.linalg.solve(rows, x)


def test_random_systems_move_as_an_integrator_with_events_says():
    """1e-12 of the integrator, times what the motion makes of an error."""
    assert sum(check_random(seed) for seed in range(25)) > 40


@pytest.mark.slow
def test_hundreds_of_random_systems_do():
    assert sum(check_random(seed, max_step=0.02) for seed in range(25, 500)) > 500


def pressed_system(rng):
    """1 to 8 masses, some pressed on 1 to 6 rigid stops, and what `PiecewiseLinear` needs."""
    n = int(rng.integers(1, 9))
    root = rng.normal(size=(n, n))
    stiffness = root @ root.T / n + 0.3 * np.eye(n)
    force, constant = np.abs(rng.normal(size=n)), np.abs(rng.normal(size=n)) * (rng.random() < 0.6)
    stops, plain, used = [], [], set()
    for _ in range(int(rng.integers(1, 7))):
        at, direction, other = int(rng.integers(n)), int(rng.choice([-1, 1])), int(rng.integers(n))
        against = other if rng.random() < 0.3 else at
        if (at, against, direction) in used or (against, at, -direction) in used:
            continue
        used.add((at, against, direction))
        gap = float(rng.uniform(0.02, 0.5))
        e = float(rng.choice([0.0, rng.uniform(0.1, 0.6), rng.uniform(0.6, 1.0)]))
        c = direction * (np.eye(n)[at] - (np.eye(n)[against] if against != at else 0.0))
        stops.append(RigidStop(f"x{at}", e, gap, direction, None if against == at else f"x{other}"))
        plain.append((c, gap, e))
    system = System.from_matrices(
        np.eye(n), stiffness, {f"x{i}": np.eye(n)[i] for i in range(n)}, damping=0.05 * stiffness,
        stops=stops, excitation=[HarmonicForce(f"x{i}", float(force[i])) for i in range(n)]
        + [ConstantForce(f"x{i}", float(constant[i])) for i in range(n)],
    )  # fmt: skip
    omega = float(rng.uniform(0.5, 2.0))
    return (
        system,
        PiecewiseLinear(np.eye(n), stiffness, 0.05 * stiffness, force, constant, plain, omega),
        omega,
    )


def check_pressed(seed):
    """State to 1e-9 of the growth; error of the Jacobian beside differences, and time of rest."""
    rng = np.random.default_rng(seed)
    system, exact, omega = pressed_system(rng)
    n, flow = system.size, FlowMap(system)
    start = np.concatenate([np.zeros(n), rng.normal(size=n)])
    rows = np.kron(np.eye(2), np.array([system.participation[f"x{i}"] for i in range(n)]))
    end, _, rested = exact.run(start, 2.0 * np.pi / omega)
    state = flow.to_state(np.linalg.solve(rows, start))
    found = flow.shoot(state[None], PERIOD, omega)
    assert not found.failure
    growth = 1.0 + np.abs(found.jacobians).max()
    assert np.abs(rows @ flow.to_modal(found.ends)[0] - end).max() < 1e-9 * growth
    # beside grazing their error goes with the square of the step, up to 6e-6, and is extrapolated
    wide, narrow = (differences(system, state, omega, PERIOD, h)[0] for h in (2e-5, 1e-5))
    by_start = (4.0 * narrow - wide) / 3.0
    return np.abs(found.jacobians[0] - by_start).max() / growth, rested


def test_random_systems_hit_and_rest_as_exponentials_say():
    """To 1e-8 of the growth. Two stops of number 9 end by one chatter, 341 and 348 nearly graze."""
    errors, rested = np.array([check_pressed(seed) for seed in (*range(10), 341, 348)]).T
    assert errors.max() < 1e-8
    assert np.sum(rested > 0.0) > 5


def differences(system, start, omega, phases, step=1e-6):
    """Central differences of the flow by the start, (2n, 2n), and by ω, (2n,)."""
    flow = FlowMap(system)

    def end(state, omega):
        found = flow.shoot(state[None], phases, omega, sensitivities=False)
        assert not found.failure
        return found.ends[0]

    by_start = [
        (end(start + step * d, omega) - end(start - step * d, omega)) / (2.0 * step)
        for d in np.eye(start.size)
    ]
    return np.array(by_start).T, (end(start, omega + step) - end(start, omega - step)) / (2 * step)


K2 = np.array([[2.0, -1.0], [-1.0, 2.0]])
PAIRS = {
    "two rigid": [RigidStop("a", 0.7, 0.1), RigidStop("b", 0.5, 0.1, -1)],
    "no rebound, beside a linear one": [RigidStop("a", 0.0, 0.1), Stop("b", 50.0, 1.0, 0.01)],
    "between the masses": [
        RigidStop("a", 0.3, 0.1, against="b"),
        Stop("b", 50.0, 1.5, 0.01, dissipation=0.3),
    ],
    "beside a dashpot": [RigidStop("a", 0.3, 0.1), Stop("b", 50.0, 1.0, 0.01, dashpot=1.0)],
}


@pytest.mark.parametrize("name", PAIRS)
def test_sensitivities_are_those_of_differences(name):
    """With impacts, rest and release on the way; differences are good to 1e-8 of the Jacobian."""
    system = System.from_matrices(
        np.eye(2), K2, {"a": [1.0, 0.0], "b": [0.0, 1.0]}, damping=0.05 * K2, stops=PAIRS[name],
        excitation=[HarmonicForce("a", 1.0), ConstantForce("a", 0.6)],
    )  # fmt: skip
    flow = FlowMap(system)
    start = flow.to_state(np.array([0.05, 0.1, 0.3, -0.2]))
    found = flow.shoot(start[None], 2.0 * PERIOD, 1.7)
    assert found.closings.min() > 0
    by_start, by_omega = differences(system, start, 1.7, 2.0 * PERIOD)
    size = np.abs(found.jacobians).max()
    assert np.abs(found.jacobians[0] - by_start).max() < 3e-8 * size
    assert np.abs(found.d_omega[0] - by_omega).max() < 3e-8 * np.abs(by_omega).max()


GYROSCOPIC, CIRCULATORY = np.array([[0.0, 0.3], [-0.3, 0.0]]), np.array([[0.0, 0.2], [-0.2, 0.0]])
BASE = np.array([1.0, 1.0])  # M r in kg of a base that carries both alike


def beside_all_elements():
    """Two masses with a rigid and an elastic stop, springs, dampers, skew matrices and loads."""
    return System.from_matrices(
        np.eye(2), K2, {"a": [1.0, 0.0], "b": [0.0, 1.0]}, damping=0.05 * K2,
        gyroscopic=GYROSCOPIC, circulatory=CIRCULATORY, loads={"base": BASE},
        stops=[RigidStop("a", 0.7, 0.1), Stop("b", 50.0, 1.5, 0.3, direction=-1)],
        springs=[PolynomialSpring("a", [-0.5, 0.0, 2.0], "b"), Spring("b", 0.4)],
        dampers=[Damper("a", 0.1, "b"), CubicDamper("b", 0.3)],
        excitation=[
            HarmonicForce("a", 1.0), HarmonicForce("b", 0.4, 30.0, harmonic=2),
            ConstantForce("a", 0.2), BaseMotion("base", 0.3),
        ],
    )  # fmt: skip


def rate_beside_all_elements(t, y, omega):
    """The same by hand."""
    x, v = y[:2], y[2:]
    apart, beneath = x[0] - x[1], max(-x[1] - 0.3, 0.0)
    between = -0.5 * apart + 2.0 * apart**3 + 0.1 * (v[0] - v[1])
    force = -K2 @ x - 0.05 * K2 @ v - GYROSCOPIC @ v - CIRCULATORY @ x
    force += BASE * 0.3 * omega**2 * math.cos(omega * t)
    force[0] += math.cos(omega * t) + 0.2 - between
    force[1] += 0.4 * math.cos(2.0 * omega * t + math.pi / 6.0) + between
    force[1] += 50.0 * beneath**1.5 - 0.4 * x[1] - 0.3 * v[1] ** 3
    return np.concatenate([v, force])


def test_impacts_beside_all_elements_are_those_of_runge_kutta():
    system, omega = beside_all_elements(), 1.7
    flow = FlowMap(system)

    def reaches(t, y):
        return y[0] - 0.1

    reaches.terminal, reaches.direction = True, 1
    x, v = [0.05, 0.1], [0.3, -0.2]
    t, y, hits, last = 0.0, np.array([*x, *v]), 0, 2.0 * TURN / omega
    while t < last:
        run = solve_ivp(
            lambda t, y: rate_beside_all_elements(t, y, omega), (t, last), y, "DOP853",
            events=reaches, rtol=1e-12, atol=1e-13, max_step=0.02,
        )  # fmt: skip
        t, y = run.t[-1], run.y[:, -1].copy()
        if run.status:
            hits += 1
            y[2] *= -0.7
    start = flow.to_state(flow_start(system, x, v))
    found = flow.shoot(start[None], 2.0 * PERIOD, omega)
    assert hits > 2
    assert found.closings.tolist() == [hits, 2]
    rows = np.array([system.participation[name] for name in "ab"])
    q = flow.to_modal(found.ends)[0]
    growth = max(np.abs(found.jacobians).max(), 1.0)
    assert np.abs(np.append(rows @ q[:2], rows @ q[2:]) - y).max() < 1e-9 * growth
    by_start, by_omega = differences(system, start, omega, 2.0 * PERIOD)
    assert np.abs(found.jacobians[0] - by_start).max() < 3e-8 * growth
    assert np.abs(found.d_omega[0] - by_omega).max() < 3e-8 * np.abs(by_omega).max()


@pytest.mark.parametrize("restitution", [0.0, 0.3])
def test_sensitivities_of_endless_impacts_within_one_instant(restitution):
    """One body rests on a stop and another hits it: it goes to and fro between the two at once."""
    stops = [RigidStop("a", restitution, 0.1), RigidStop("b", 0.0, 0.1, against="a")]
    system = System.from_matrices(
        np.eye(2), K2, {"a": [1.0, 0.0], "b": [0.0, 1.0]}, damping=0.05 * K2, stops=stops,
        excitation=[HarmonicForce("a", 1.0), ConstantForce("a", 0.6)],
    )  # fmt: skip
    flow = FlowMap(system)
    start = flow.to_state(flow_start(system, [0.0, -0.2], [0.5, 1.0]))
    found = flow.shoot(start[None], PERIOD, 1.2)
    assert found.closings[1] > 30
    by_start, by_omega = differences(system, start, 1.2, PERIOD, 1e-5)
    assert np.abs(found.jacobians[0] - by_start).max() < 3e-8 * np.abs(found.jacobians).max()
    assert np.abs(found.d_omega[0] - by_omega).max() < 3e-8 * np.abs(by_omega).max()


def test_a_body_bounces_to_rest_beside_one_that_rests():
    """x'' = D - x from a stop at 0 is back after 2 arctan(v / D): no bounce is cut into steps."""
    restitution, pull = 0.59, 0.8
    system = System.from_matrices(
        np.eye(2), np.eye(2), {"a": [1.0, 0.0], "b": [0.0, 1.0]},
        stops=[RigidStop("a", 0.0), RigidStop("b", restitution)],
        excitation=[ConstantForce("a", 1.0), ConstantForce("b", pull)],
    )  # fmt: skip
    start = flow_start(system, [0.0, 0.0], [0.0, -1.0])
    hits = impacts(simulate(system, 0.05, 1, start=start))
    hits = hits.time[hits.stop == 1], hits.speed[hits.stop == 1]
    speeds = restitution ** np.arange(len(hits[0]))
    assert speeds[-1] < 1e-5
    assert np.abs(hits[1] - speeds).max() < 1e-9
    assert np.abs(hits[0] - np.cumsum(2.0 * np.arctan(speeds / pull))).max() < 1e-9


def test_a_bar_that_falls_on_its_ends_in_turn_comes_to_rest():
    """Without rebound: while one end rests the other falls with 2g/3, and lifts it with v/3.

    The ends have the inertia matrix of a bar with the square of its radius of inertia half that of
    their distance: an impulse on one moves the other by a third. Each flight takes v/g, so that all
    of them end 3v/2g after an impact of the speed v.
    """
    arm = math.sqrt(0.5)
    ends = {"left": [1.0, -arm], "right": [1.0, arm]}
    system = System.from_matrices(
        np.eye(2), np.zeros((2, 2)), {**ends, "middle": [1.0, 0.0]},
        stops=[RigidStop(end, 0.0, direction=-1) for end in ends],
        excitation=[ConstantForce("middle", -G)],
    )  # fmt: skip
    height, fall = 0.1, 2.0 * G / 3.0
    rows = np.array([system.participation[end] for end in ends])
    start = np.append(np.linalg.solve(rows, [height, 0.0]), np.zeros(2))
    motion = simulate(system, 1.0, 1, start=start)
    hits = impacts(motion)
    first, speed = math.sqrt(2.0 * height / fall), math.sqrt(2.0 * height * fall)
    speeds = speed * 3.0 ** -np.arange(float(len(hits)))
    assert 10 < len(hits) < 30
    assert hits.stop.tolist() == [0, 1] * (len(hits) // 2) + [0] * (len(hits) % 2)
    assert np.abs(hits.speed - speeds).max() < 1e-9
    times = first + np.append(0.0, np.cumsum(speeds)[:-1]) / G
    assert np.abs(hits.time - times).max() < 1e-9
    left = 1.5 * speeds[-1] / G  # of flights lower than the rounding of the gap
    assert left < 1e-6
    assert hits.time[-1] + left == pytest.approx(first + 1.5 * speed / G, abs=1e-9)
    assert np.abs(motion.end).max() < 1e-12


def slower(speed):
    """Restitution that falls with the speed."""
    return 0.9 / (1.0 + 0.5 * speed), -0.45 / (1.0 + 0.5 * speed) ** 2


@pytest.mark.parametrize("restitution", [0.8, slower], ids=["constant", "of the speed"])
def test_derivatives_by_parameters_and_speed(restitution):
    system = System.from_matrices(
        [[1.0]], [[1.0]], {"a": [1.0]}, damping=[[0.05]],
        stops=[RigidStop("a", restitution, 0.2)], excitation=[HarmonicForce("a", 1.0)],
    )  # fmt: skip
    flow = FlowMap(system)
    start = np.array([0.1, 0.3])
    names = ["gap", "amplitude"] + (["restitution"] if restitution == 0.8 else [])
    found = flow.shoot(start[None], PERIOD, 2.3, parameters=[Parameter(name) for name in names])
    assert found.closings.tolist() == [1]
    by_start, by_omega = differences(system, start, 2.3, PERIOD)
    assert np.abs(found.jacobians[0] - by_start).max() < 1e-8
    assert np.abs(found.d_omega[0] - by_omega).max() < 1e-8

    def end(name, value):
        (stop,), (force,) = system.stops, system.excitation
        if name == "amplitude":
            other = system.with_elements(excitation=(replace(force, amplitude=value),))
        else:
            other = system.with_elements(stops=(replace(stop, **{name: value}),))
        return FlowMap(other).shoot(start[None], PERIOD, 2.3, sensitivities=False).ends[0]

    for column, (name, value) in enumerate(zip(names, [0.2, 1.0, 0.8], strict=False)):
        change = (end(name, value + 1e-6) - end(name, value - 1e-6)) / 2e-6
        assert np.abs(found.d_parameters[0, :, column] - change).max() < 1e-8


@pytest.mark.parametrize("restitution", [0.5, 0.8, 0.95])
def test_a_ball_on_a_table_comes_to_rest_when_the_series_says(restitution):
    """Dropped from h it rests after √(2h/g) (1 + e) / (1 - e), with all impacts before."""
    height = 0.3
    fall = math.sqrt(2.0 * height / G)
    duration = fall * (1.0 + restitution) / (1.0 - restitution)
    flow = FlowMap(ball(restitution))
    start = flow.to_state(np.array([height, 0.0]))[None]
    omega = 2.0 * np.pi / (1.001 * duration)
    found = flow.shoot(start, PERIOD, omega)
    q = flow.to_modal(found.ends)[0]
    assert np.abs(q).max() < 1e-13
    assert np.abs(found.jacobians).max() < 1e-10  # both directions are lost
    before = flow.to_modal(flow.shoot(start, 0.9 * PERIOD, omega).ends)[0]
    assert before[0] > 0.0
    hits = impacts(simulate(ball(restitution), 1.0 / (1.001 * duration), 1, start=[height, 0.0]))
    speeds = math.sqrt(2.0 * G * height) * restitution ** np.arange(len(hits))
    # an instant is known to rounding of the height, 1e-16 m, over the speed
    assert np.abs(hits.speed[:10] - speeds[:10]).max() < 1e-11
    flights = 2.0 * fall * restitution ** np.arange(1, 10)
    times = fall + np.concatenate([[0.0], np.cumsum(flights)])
    assert np.abs(hits.time[:10] - times).max() < 1e-10


def test_rest_ends_where_the_table_falls_faster_than_the_ball():
    """With e = 0 and 1.5 g: it leaves at cos ωt = 1/1.5 and lands at the root of its way."""
    omega, table = 2.0 * np.pi * 10.0, 1.5
    leaves = -math.acos(1.0 / table) / omega  # the force exceeds the weight from there on

    def way(t):
        """Height over the table at a time t, left at `leaves` without speed."""
        swing = np.cos(omega * t) - np.cos(omega * leaves)
        swing += omega * (t - leaves) * np.sin(omega * leaves)
        return -table * G * swing / omega**2 - 0.5 * G * (t - leaves) ** 2

    lands = brentq(way, leaves + 0.02, leaves + 0.09, xtol=1e-15)
    speed = -(
        -table * G * (np.sin(omega * leaves) - np.sin(omega * lands)) / omega - G * (lands - leaves)
    )
    hits = impacts(simulate(ball(0.0, table), 10.0, 4, start=[0.0, 0.0]))
    assert hits.speed[1:] == pytest.approx(speed, rel=1e-10)
    assert hits.time[1:] % 0.1 == pytest.approx(lands, abs=1e-12)


def test_the_force_of_rest_is_the_weight_less_the_shaking():
    motion = simulate(ball(0.3, 0.5), 10.0, 1, start=[0.0, 0.0])
    history = motion.history(50)
    exact = G * (1.0 - 0.5 * np.cos(2.0 * np.pi * 10.0 * history.time))
    assert history.force[:, 0] == pytest.approx(exact, rel=1e-12)
    assert np.abs(history.penetration).max() < 1e-15


def test_two_stops_hit_at_once_take_energy_one_after_the_other():
    """Symmetric: both masses hit at one instant and each rebounds with its own restitution."""
    system = System.from_matrices(
        np.eye(2), np.eye(2), {"a": [1.0, 0.0], "b": [0.0, 1.0]},
        stops=[RigidStop("a", 0.5, 0.1), RigidStop("b", 0.25, 0.1)],
    )  # fmt: skip
    flow = FlowMap(system)
    state = flow.to_state(flow_start(system, [0.0, 0.0], [1.0, 1.0]))
    hit = math.asin(0.1)
    found = flow.shoot(state[None], np.array([0.0, hit + 1e-9]), 1.0)
    q = flow.to_modal(found.ends)[0]
    rows = np.array([system.participation[name] for name in "ab"])
    fast = math.cos(hit)
    assert found.closings.tolist() == [1, 1]
    assert rows @ q[2:] == pytest.approx([-0.5 * fast, -0.25 * fast], abs=1e-8)


def flow_start(system, x, v):
    rows = np.array([system.participation[name] for name in "ab"])
    return np.concatenate([np.linalg.solve(rows, x), np.linalg.solve(rows, v)])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"restitution": 1.2}, "restitution must lie between 0 and 1, got 1.2"),
        ({"restitution": -0.1}, "restitution must lie between 0 and 1"),
        ({"gap": -1e-3}, "a preload needs a stop with a stiffness"),
        ({"direction": 2}, "direction must be"),
        ({"against": "a"}, "against must be another interface"),
        ({"restitution": lambda v: (2.0, 0.0)}, r"restitution\(1e-12\) must lie between 0 and 1"),
        ({"restitution": lambda v: (0.5, 1.0)}, "restitution says 1 for its derivative"),
        ({"restitution": lambda v: 0.5}, "must give two numbers"),
    ],
)
def test_what_makes_no_sense_is_refused(changes, words):
    with pytest.raises(SystemModelError, match=words):
        RigidStop(**{"at": "a", "restitution": 0.5, **changes})


def test_a_rigid_stop_has_no_stiffness_and_an_elastic_one_no_restitution():
    system = ball(0.5).with_elements(stops=(RigidStop("ball", 0.5), Stop("ball", 1.0)))
    for name, index in (("stiffness", 0), ("restitution", 1)):
        with pytest.raises(SystemModelError, match=f"without {name}"):
            FlowMap(system).shoot(
                np.zeros((1, 2)), PERIOD, 1.0, parameters=[Parameter(name, index)]
            )


def test_random_states_lie_in_front_of_all_rigid_stops():
    """Also where two shut the same gap of no width, and only the middle is left."""
    pair = [RigidStop("a", 0.5, gap=1.0), RigidStop("a", 0.5, gap=2.0, direction=-1)]
    shut = [RigidStop("b", 0.5), RigidStop("b", 0.5, direction=-1)]
    system = System.from_matrices(
        np.eye(2), [[2.0, -1.0], [-1.0, 2.0]], {"a": [1.0, 0.0], "b": [0.0, 1.0]},
        modal_damping=0.1, stops=pair + shut, excitation=[HarmonicForce("a", 1.0)],
    )  # fmt: skip
    flow = FlowMap(system)
    states = flow.to_modal(random_states(flow, 1.0, 50, 3))
    a, b = (states[:, :2] @ system.participation[name] for name in "ab")
    assert np.all((a <= 1.0 + 1e-8) & (a >= -2.0 - 1e-8))
    assert np.abs(b).max() < 1e-9 and np.ptp(states[:, 2:] @ system.participation["b"]) > 0.0
    flow = FlowMap(system.with_elements(stops=pair))
    states = flow.to_modal(random_states(flow, 1.0, 50, 3))
    a = states[:, :2] @ system.participation["a"]
    assert np.all((a <= 1.0 + 1e-8) & (a >= -2.0 - 1e-8))
    assert np.ptp(a) > 1.0 and np.ptp(states[:, 2:]) > 0.0


def test_a_motion_behind_a_rigid_stop_is_no_orbit():
    """The free motion swings about 2 m, far behind the stop, which it never meets from there."""
    free = System.from_matrices(
        np.eye(2), np.eye(2), {"z": [1.0, 0.0], "x": [0.0, 1.0]}, damping=0.1 * np.eye(2),
        excitation=[ConstantForce("z", 2.0), HarmonicForce("x", 0.3)],
    )  # fmt: skip
    beyond = solve_orbit(free, 0.15).states([0.0])[0]
    system = free.with_elements(stops=[RigidStop("z", 0.5, gap=0.1)])
    with pytest.raises(ConvergenceError, match="behind a rigid stop"):
        solve_orbit(system, 0.15, guess=beyond)
    swings = free.with_elements(excitation=[ConstantForce("z", 2.0), HarmonicForce("z", 0.3)])
    along = solve_orbit(swings.with_elements(stops=[RigidStop("z", 0.5, gap=3.0)]), 0.15)
    branch = continue_branch(along, (1.0, 3.0), parameter=Parameter("gap", 0))
    nodes = [orbit.states(np.linspace(0.0, 2.0 * np.pi, 20))[:, 0] for orbit in branch.points]
    gaps = [orbit.system.rigid_stops[0].gap for orbit in branch.points]
    assert len(gaps) > 3
    assert max(z.max() - gap for z, gap in zip(nodes, gaps, strict=True)) < 1e-6
