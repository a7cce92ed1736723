"""Friction over a plane at rigid stops: closed forms, and an independent integration."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rigid_plane import Body, UndecidedError
from sliding import GRAVITY as G
from sliding import flown, off_differences, thrown

from nldyn import (
    ConstantForce,
    FlowMap,
    HarmonicForce,
    Parameter,
    RigidStop,
    System,
    SystemModelError,
    continue_branch,
    impacts,
    load,
    save,
    simulate,
    solve_orbit,
)
from nldyn.flow.rigid import rest_forces
from nldyn.flow.sliding import slider_measures
from nldyn.system import DryFriction, Friction
from nldyn.system.chart import value_of, with_value

TURN = 2.0 * math.pi
ANGLE = np.array([math.cos(0.7), math.sin(0.7)])


def puck(restitution, friction, push=(0.0, 0.0), **law):
    """A puck of 1 kg over a floor, with its weight and a constant push along it."""
    stop = RigidStop(
        "z", restitution, direction=-1, tangent="x", second_tangent="y",
        friction=Friction(friction, **law),
    )  # fmt: skip
    pushed = [ConstantForce(name, size) for name, size in zip("xy", push, strict=True) if size]
    return System.from_matrices(
        np.eye(3), np.zeros((3, 3)), dict(zip("xyz", np.eye(3), strict=True)), stops=[stop],
        excitation=[ConstantForce("z", -G), *pushed],
    )  # fmt: skip


@pytest.mark.parametrize("time", [0.2, 0.4, 0.8, 1.1, 2.0, 6.0])
@pytest.mark.parametrize(("friction", "restitution"), [(0.2, 0.6), (0.2, 0.0), (2.0, 0.6)])
def test_a_puck_thrown_obliquely_keeps_its_direction(friction, restitution, time):
    q, found = flown(puck(restitution, friction), [0.0, 0.0, 0.3, *(4.0 * ANGLE), 0.0], time)
    assert found.failure == ""
    way, speed = thrown(0.3, 4.0, restitution, friction, time)
    np.testing.assert_allclose(q[:2], way * ANGLE, atol=1e-12)
    np.testing.assert_allclose(q[3:5], speed * ANGLE, atol=1e-12)


@pytest.mark.parametrize(("push", "friction"), [(3.0, 0.2), (1.0, 0.2)])
def test_a_pushed_puck_slips_where_friction_does_not_hold_it(push, friction):
    q, _ = flown(puck(0.5, friction, tuple(push * ANGLE)), np.zeros(6), 2.0)
    pace = max(push - friction * G, 0.0)
    expected = np.concatenate([2.0 * pace * ANGLE, [0.0]])
    np.testing.assert_allclose(q, np.concatenate([expected, expected]), atol=1e-12)


def test_a_belt_under_the_puck_takes_it_along():
    q, _ = flown(puck(0.5, 0.3, base_speed=tuple(ANGLE)), np.zeros(6), 1.0)
    until = 1.0 / (0.3 * G)
    np.testing.assert_allclose(q[:2], (1.0 - 0.5 * until) * ANGLE, atol=1e-12)
    np.testing.assert_allclose(q[3:5], ANGLE, atol=1e-12)


def test_a_pushed_puck_slides_in_the_curve_of_its_hodograph():
    """With a push P along x and the angle a of v from it, |v| sin a = C tan(a/2)^(μmg/P)."""
    push, mu = 0.1 * G, 0.3
    q, found = flown(puck(0.5, mu, (push, 0.0)), [0.0, 0.0, 0.0, 0.0, 2.0, 0.0], 0.4)
    assert found.failure == ""

    def constant(speed):
        a = math.atan2(speed[1], speed[0])
        return float(np.hypot(*speed)) * math.sin(a) / math.tan(0.5 * a) ** (mu * G / push)

    assert 0.2 < math.atan2(q[4], q[3]) < 1.4
    assert constant(q[3:5]) == pytest.approx(constant((0.0, 2.0)), rel=1e-11)


def test_a_thrown_puck_loses_all_its_energy():
    motion = simulate(puck(0.6, 0.2), 0.2, 1, start=[0.0, 0.0, 0.3, *(4.0 * ANGLE), 0.0])
    sliding = slider_measures(motion.stretches[0])[0]
    assert impacts(motion).loss.sum() == pytest.approx(G * 0.3, rel=1e-11)
    assert sliding.loss == pytest.approx(8.0, rel=1e-11)
    assert sliding.pressed_distance == pytest.approx(8.0 / 0.2, rel=1e-11)
    assert motion.history(20).force[-1, 0] == pytest.approx(G, rel=1e-12)


def drawn(seed, coupled=0.35):
    """A random structure with a stop and friction over it, the same for both ways."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 5))
    A, B = rng.normal(size=(n, n)), coupled * rng.normal(size=(n, n))
    M, K, unit = np.eye(n) + B @ B.T, A @ A.T + np.eye(n), np.eye(n)
    C, names = 0.05 * K, [f"x{i}" for i in range(n)]
    omega = float(rng.uniform(0.5, 2.0))
    force, constant, phases = 3.0 * rng.random(n), 2.0 * rng.normal(size=n), rng.uniform(0, 360, n)
    a, b, c = rng.permutation(n)[:3]
    sign, gap = int(rng.choice([1, -1])), float(rng.uniform(0.02, 0.4))
    e, mu = float(rng.choice([0.0, rng.uniform(0.0, 0.9)])), float(rng.uniform(0.05, 0.9))
    belt = float(rng.choice([0.0, 0.2]))
    law, turn = Friction(mu, base_speed=(belt, -0.5 * belt)), np.radians(phases)
    body = Body(
        M, C, K, lambda t: constant + force * np.cos(omega * t + turn), sign * unit[a],
        unit[[b, c]], gap, e, mu, law.base_speeds,
    )  # fmt: skip
    rough = {"tangent": names[b], "second_tangent": names[c], "friction": law}
    system = System.from_matrices(
        M, K, dict(zip(names, unit, strict=True)), damping=C,
        stops=[RigidStop(names[a], e, gap, sign, **rough)],
        excitation=[HarmonicForce(*row) for row in zip(names, force, phases, strict=True)]
        + [ConstantForce(*row) for row in zip(names, constant, strict=True)],
    )  # fmt: skip
    return system, body, omega, np.concatenate([np.zeros(n), rng.normal(size=n)])


def two_at_once(link):
    """Two pucks in bowls, shaken, and what links them; each is thrown on a floor of its own."""
    K = np.kron(np.diag([1.0, 1.6]), np.diag([1.0, 1.3, 0.7])) + link * np.ones((6, 6))
    one = np.array([[1.0, 0.1, 0.2], [0.1, 1.2, -0.2], [0.2, -0.2, 1.5]])
    M = np.kron(np.diag([1.0, 1.4]), one)
    names = ["x", "y", "z", "u", "v", "w"]
    stops = [
        RigidStop("z", 0.5, 0.05, -1, tangent="x", second_tangent="y", friction=0.4),
        RigidStop("w", 0.3, 0.02, -1, tangent="u", second_tangent="v", friction=0.25),
    ]
    sizes, turns = [0.8, 0.6, 1.8] * 2, range(0, 360, 60)
    drive = [HarmonicForce(*each) for each in zip(names, sizes, turns, strict=True)]
    pressed = [ConstantForce("z", -1.5), ConstantForce("w", -1.2)]
    return System.from_matrices(
        M, K, dict(zip(names, np.eye(6), strict=True)), damping=0.2 * K, stops=stops,
        excitation=[*drive, *pressed],
    ), M, K  # fmt: skip


def test_two_stops_at_once_are_each_as_alone():
    system, M, K = two_at_once(0.0)
    start, phases = np.tile([0.1, 0.2, 0.3], 4), np.array([0.0, 4.0 * TURN])
    flow = FlowMap(system)
    found = flow.shoot(to_state(flow, start)[None], phases, 0.9)
    assert found.failure == ""
    end = from_state(flow, found.ends[0])
    for i, names in enumerate((["x", "y", "z"], ["u", "v", "w"])):
        part, own = slice(3 * i, 3 * i + 3), system.stops[i : i + 1]
        alone = System.from_matrices(
            M[part, part], K[part, part], dict(zip(names, np.eye(3), strict=True)),
            damping=0.2 * K[part, part], stops=own,
            excitation=[each for each in system.excitation if each.at in names],
        )  # fmt: skip
        expected = FlowMap(alone)
        one = expected.shoot(to_state(expected, start[:6])[None], phases, 0.9)
        both = end.reshape(2, 6)[:, part].ravel()
        np.testing.assert_allclose(both, from_state(expected, one.ends[0]), atol=1e-9)
        motion = flow.trajectory(to_state(flow, start)[None], phases, 0.9)
        friction = slider_measures(motion)[i]
        assert min(friction.stuck, friction.slid, friction.open) > 0.01


@pytest.mark.parametrize("link", [0.1, pytest.param(0.4, marks=pytest.mark.slow)])
def test_derivatives_of_two_stops_at_once_are_those_of_differences(link):
    system, *_ = two_at_once(link)
    flow, phases = FlowMap(system), np.array([0.0, 1.5 * TURN])
    z = to_state(flow, np.tile([0.1, 0.2, 0.3], 4))[None]
    found = flow.shoot(z, phases, 0.9)
    assert found.failure == ""
    steps = (1e-5, 1e-6)
    assert min(off_differences(flow, found, z, phases, 0.9, step) for step in steps) < 1e-6


def bases(system):
    return np.array([system.participation[name] for name in system.interfaces])


def to_state(flow, y):
    return flow.to_state(np.linalg.solve(bases(flow.system), y.reshape(2, -1).T).T.ravel())


def from_state(flow, z):
    return (flow.to_start(z).reshape(2, -1) @ bases(flow.system).T).ravel()


def agrees(seed, coupled=0.35):
    """Agreement of states and Jacobians with the integration; the events there were."""
    system, body, omega, start = drawn(seed, coupled)
    phases, flow = np.array([0.0, 1.3 * TURN]), FlowMap(system)
    z = to_state(flow, start)[None]
    found = flow.shoot(z, phases, omega)
    try:
        expected = body.followed(start, phases[1] / omega)
    except UndecidedError:
        assert "Painlevé" in found.failure
        return set()
    assert found.failure == ""
    size = 1.0 + np.abs(found.jacobians).max()
    np.testing.assert_allclose(from_state(flow, found.ends[0]), expected, atol=1e-9 * size)
    steps = (1e-5, 1e-6, 1e-7)
    assert min(off_differences(flow, found, z, phases, omega, step) for step in steps) < 1e-5
    return set(body.met)


@pytest.mark.parametrize(
    ("seed", "coupled", "met"),
    [
        (0, 0.35, set()),
        (6, 0.35, {"hit", "leave", "slip"}),
        (209, 1.0, {"hit", "stick", "stop"}),
        (223, 1.0, {"hit"}),
    ],
)
def test_random_systems_agree_with_integration_from_event_to_event(seed, coupled, met):
    assert agrees(seed, coupled) == met


@pytest.mark.slow
@pytest.mark.parametrize(
    ("coupled", "seeds"), [(0.35, range(30)), (0.7, range(35, 60)), (1.0, range(200, 260))]
)
def test_more_random_systems_do(coupled, seeds):
    for seed in seeds:
        agrees(seed, coupled)


def oscillator(friction=0.3, rests=False, second="z", coupled=0.2, size=0.4):
    """Three coupled masses, one of which hits a stop, over which both others slide."""
    M = np.array([[1.0, 0.2, -0.1], [0.2, 1.0, coupled], [-0.1, coupled, 1.5]])
    K = np.array([[2.0, -0.5, 0.3], [-0.5, 1.0, 0.1], [0.3, 0.1, 1.7]])
    C, force = 0.1 * K, np.array([0.7, 0.5, size])
    constant = np.array([0.6 if rests else 0.0, 0.0, 0.0])
    e, gap, omega = (0.3 if rests else 0.7), 0.1, 0.9
    turn = np.radians([0.0, 0.0, 50.0])
    rough = {"tangent": "y", "second_tangent": second, "friction": friction}
    system = System.from_matrices(
        M, K, dict(zip("xyz", np.eye(3), strict=True)), damping=C,
        stops=[RigidStop("x", e, gap, **(rough if friction is not None else {}))],
        excitation=[
            HarmonicForce("x", 0.7), HarmonicForce("y", 0.5), HarmonicForce("z", size, 50.0),
            *([ConstantForce("x", 0.6)] if rests else []),
        ],
    )  # fmt: skip
    body = Body(M, C, K, lambda t: constant + force * np.cos(omega * t + turn),
                np.eye(3)[0], np.eye(3)[1:], gap, e, friction or 0.0)  # fmt: skip
    return system, body, omega / TURN


@pytest.mark.parametrize("rests", [False, True])
def test_a_forced_oscillator_with_friction_over_its_stop(rests):
    """Orbit to 1e-8 and multipliers to 1e-6 beside an integration from event to event."""
    system, body, hertz = oscillator(rests=rests)
    orbit = solve_orbit(system, hertz)
    flow = orbit.problem.flow
    start = from_state(flow, flow.to_state(orbit.states(np.zeros(1)))[0])
    assert body.open(start) > 0.01
    np.testing.assert_allclose(body.followed(start, 1.0 / hertz), start, atol=1e-8)
    assert ("slip" in body.met or "leave" in body.met) == rests
    step = 1e-5
    beside = [
        [body.followed(start + way * step * row, 1.0 / hertz) for way in (1.0, -1.0)]
        for row in np.eye(6)
    ]
    columns = np.array([(up - down) / (2.0 * step) for up, down in beside]).T
    expected = np.sort(np.abs(np.linalg.eigvals(columns)))
    np.testing.assert_allclose(np.sort(np.abs(orbit.multipliers)), expected, atol=1e-6)


@pytest.mark.parametrize("rests", [False, True])
def test_along_one_tangent_it_is_friction_along_a_line(rests):
    """The third mass is on its own and still: nothing leaves the line."""
    ends = []
    for second in (None, "z"):
        system, *_ = oscillator(rests=rests, second=second, coupled=0.0, size=0.0)
        M, K = np.eye(3), np.diag([2.0, 1.0, 1.7])
        M[0, 1] = M[1, 0] = 0.2
        K[0, 1] = K[1, 0] = -0.5
        system = System.from_matrices(
            M, K, dict(zip("xyz", np.eye(3), strict=True)), damping=0.1 * K, stops=system.stops,
            excitation=[each for each in system.excitation if each.at != "z"],
        )  # fmt: skip
        flow = FlowMap(system)
        z = to_state(flow, np.array([0.02, 0.01, 0.0, 0.3, 0.2, 0.0]))[None]
        found = flow.shoot(z, np.array([0.0, 3.0 * TURN]), 0.9)
        assert found.failure == ""
        rows = np.kron(np.eye(2), np.linalg.inv(bases(system)))
        to = np.array([flow.to_state(column) for column in rows.T]).T
        jacobian = np.linalg.solve(to, found.jacobians[0] @ to)
        ends.append((from_state(flow, found.ends[0]), jacobian[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])]))
    np.testing.assert_allclose(ends[1][0], ends[0][0], atol=1e-12)
    np.testing.assert_allclose(ends[1][1], ends[0][1], atol=1e-9 if rests else 1e-11)


@pytest.mark.parametrize("rests", [False, True])
def test_tangents_may_be_turned_in_their_plane(rests):
    system, *_ = oscillator(rests=rests)
    a, y, z = 0.7, system.participation["y"], system.participation["z"]
    turned = {"u": math.cos(a) * y + math.sin(a) * z, "v": math.cos(a) * z - math.sin(a) * y}
    (stop,) = system.stops
    rough = {"tangent": "u", "second_tangent": "v", "friction": 0.3}
    other = replace(
        system,
        participation={**system.participation, **turned},
        stops=(RigidStop("x", stop.restitution, stop.gap, **rough),),
    )
    ends = []
    for each in (system, other):
        flow = FlowMap(each)
        start = flow.to_state(np.array([0.02, 0.01, -0.03, 0.3, 0.2, 0.1]))[None]
        ends.append(flow.to_modal(flow.shoot(start, np.array([0.0, 3.0 * TURN]), 0.9).ends[0]))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-11)


@pytest.mark.parametrize("rests", [False, True])
def test_friction_of_zero_changes_nothing(rests):
    found, expected = (
        FlowMap(oscillator(friction, rests)[0]).shoot(
            np.array([[0.02, 0.01, 0.0, 0.3, 0.2, 0.1]]), np.array([0.0, 3.0 * TURN]), 0.9
        )
        for friction in (0.0, None)
    )
    assert np.abs(found.ends - expected.ends).max() <= 1e-13
    assert np.abs(found.jacobians - expected.jacobians).max() <= (1e-8 if rests else 1e-12)


@pytest.mark.parametrize("rests", [False, True])
@pytest.mark.parametrize("name", ["friction", "restitution", "gap"])
def test_derivatives_by_numbers_are_those_of_differences(rests, name):
    system, *_ = oscillator(rests=rests)
    z, phases = np.array([[0.02, 0.01, 0.0, 0.3, 0.2, 0.1]]), np.array([0.0, 3.0 * TURN])
    parameter = Parameter(name)
    exact = FlowMap(system).shoot(z, phases, 0.9, parameters=[parameter]).d_parameters[0, :, 0]
    value = value_of(system, 1.0, parameter)
    ends = [
        FlowMap(with_value(system, parameter, value + way)).shoot(z, phases, 0.9).ends[0]
        for way in (1e-6, -1e-6)
    ]
    np.testing.assert_allclose(exact, (ends[0] - ends[1]) / 2e-6, atol=1e-6)


def test_the_energy_of_an_orbit_is_what_impacts_and_friction_take():
    system, _, hertz = oscillator(rests=True)
    orbit = solve_orbit(system, hertz)
    motion = orbit.trajectory
    flow = motion.flow
    x, weights = np.polynomial.legendre.leggauss(40)
    work, base = 0.0, system.participation
    for phase, time in zip(motion.record.phase, motion.record.duration, strict=True):
        phases = phase + motion.omega * time * 0.5 * (x + 1.0)
        v = orbit.states(phases)[:, 3:]
        drive = 0.7 * np.cos(phases) * (v @ base["x"]) + 0.6 * (v @ base["x"])
        drive += 0.5 * np.cos(phases) * (v @ base["y"])
        drive += 0.4 * np.cos(phases + math.radians(50.0)) * (v @ base["z"])
        drive -= np.einsum("ki,ij,kj->k", v, system.total_damping, v)
        work += 0.5 * time * float(weights @ drive)
    (friction,) = orbit.friction
    assert impacts(orbit).loss.sum() + friction.loss == pytest.approx(work, rel=1e-9)
    assert friction.loss == pytest.approx(0.3 * friction.pressed_distance, rel=1e-9)
    assert min(friction.slid, friction.open) > 0.1
    rests = motion.record.kind >= 0
    times = motion.record.duration[rests, None] * flow.tables.chi[motion.record.kind[rests]]
    phases = (motion.record.phase[rests, None] + motion.omega * times).ravel()
    forces = rest_forces(motion, phases, motion.states(phases))[:, 0]
    np.testing.assert_allclose(forces, motion.record.force[rests, 0].ravel(), rtol=0.0, atol=1e-8)


def test_a_branch_in_the_friction_and_its_file(tmp_path):
    system, body, hertz = oscillator()
    friction = Parameter("friction")
    branch = continue_branch(solve_orbit(system, hertz), (0.25, 0.35), parameter=friction)
    assert branch.stop_reason.count("end of the range of friction") == 2
    last = branch.points[-1]
    body.coefficient = value_of(last.system, hertz, friction)
    assert body.coefficient == pytest.approx(0.35, abs=1e-12)
    flow = last.problem.flow
    start = from_state(flow, flow.to_state(last.states(np.zeros(1)))[0])
    np.testing.assert_allclose(body.followed(start, 1.0 / hertz), start, atol=1e-8)
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert again.points[-1].system.stops == last.system.stops
    np.testing.assert_array_equal(again.points[-1].multipliers, last.multipliers)


def rod(angles, friction, push=1.0):
    """A rod of 1 kg and 1 m whose end is over a floor, leaning along both tangents.

    Speeds of the end: closing (0, 0, -1) and sliding, with what its turning about two axes adds.
    """
    a, b = np.cos(angles), np.sin(angles)
    lean = 0.5 * np.array([b[0], b[1]])
    rows = {
        "down": [0.0, 0.0, -1.0, 0.5 * a[0], 0.5 * a[1]],
        "along": [1.0, 0.0, 0.0, lean[0], 0.0],
        "aside": [0.0, 1.0, 0.0, 0.0, lean[1]],
    }
    rough = {"tangent": "along", "second_tangent": "aside", "friction": friction}
    return System.from_matrices(
        np.diag([1.0, 1.0, 1.0, 1.0 / 12.0, 1.0 / 12.0]), np.zeros((5, 5)), rows,
        stops=[RigidStop("down", 0.0, **rough)], excitation=[ConstantForce("down", push)],
    )  # fmt: skip


def moving(system, speeds):
    """The state with speeds of the three interfaces."""
    modes = np.array([system.participation[name] for name in ("down", "along", "aside")])
    modal = np.linalg.lstsq(modes, np.array(speeds, dtype=float), rcond=None)[0]
    return FlowMap(system).to_state(np.concatenate([np.zeros(5), modal]))[None]


def test_what_friction_does_is_not_decided_where_no_force_holds_it():
    """Painlevé's rod in space: m_nn + μ m_nt . u may be negative, so that it slides in vain."""
    angles = np.array([math.atan(2.0), 0.9])
    system, friction = rod(angles, 2.0), 2.0
    a, b = np.cos(angles), np.sin(angles)
    own, both = 1.0 + 3.0 * (a @ a), 3.0 * a * b
    u = -both / np.hypot(*both)
    for way, fails in ((u, True), (-u, False)):
        assert (own + friction * both @ way < 0.0) == fails
        found = FlowMap(system).shoot(moving(system, [0.0, *way]), np.array([0.0, 0.1]), 1.0)
        assert ("stop 0" in found.failure and "at phase 0 rad" in found.failure) == fails


def test_what_sticks_in_a_corner_is_told_to_be_undecided():
    """A puck at rest on the floor beside a wall: friction and the wall share what pushes it on."""
    (floor,) = puck(0.5, 0.3).stops
    system = puck(0.5, 0.3, (1.0, 0.0)).with_elements(stops=(floor, RigidStop("x", 0.5)))
    found = FlowMap(system).shoot(np.zeros((1, 6)), np.array([0.0, 1.0]), 1.0)
    assert "stop 1" in found.failure and "shares that force" in found.failure
    _, free = flown(system, [-0.1, 0.0, 0.0, 0.0, 0.0, 0.0], 1.0)
    assert free.failure == ""


def test_a_puck_between_walls_rebounds_and_slides_on():
    """Sliding along the floor against a wall: speed along it kept, that against it turned."""
    (floor,) = puck(0.5, 0.3).stops
    system = puck(0.5, 0.3).with_elements(stops=(floor, RigidStop("x", 0.8, gap=0.2)))
    q, found = flown(system, [0.0, 0.0, 0.0, 3.0, 2.0, 0.0], 0.2)
    assert found.failure == ""
    first = np.array([3.0, 2.0])
    way = first / np.hypot(*first)
    t = (1.0 - math.sqrt(1.0 - 2.0 * 0.3 * G * 0.2 / way[0] / (first @ first))) * (
        np.hypot(*first) / (0.3 * G)
    )
    v = (np.hypot(*first) - 0.3 * G * t) * way * np.array([-0.8, 1.0])
    there = np.array([0.2, 0.2 * way[1] / way[0]])
    left, size = 0.2 - t, np.hypot(*v)
    expected = there + v * left - 0.5 * 0.3 * G * left**2 * v / size
    np.testing.assert_allclose(q[:2], expected, atol=1e-12)
    np.testing.assert_allclose(q[3:5], v - 0.3 * G * left * v / size, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: RigidStop("z", 0.5, second_tangent="y"), "needs both friction and tangent"),
        (
            lambda: RigidStop("z", 0.5, tangent="x", friction=0.3, second_tangent="z"),
            "another interface",
        ),
        (
            lambda: RigidStop("z", 0.5, tangent="x", friction=Friction(0.3, 0.4, 0.1),
                              second_tangent="y"),
            "has one coefficient",
        ),
        (
            lambda: System.from_modal(
                [1.0, 2.0], {"x": [1.0, 0.5], "y": [-2.0, 1.0], "z": [1.0, 1.0]},
                stops=[RigidStop("z", 0.5, tangent="x", friction=0.3, second_tangent="y")],
            ),
            "its normal is a motion of both tangents",
        ),
        (
            lambda: System.from_matrices(
                np.eye(2), np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]},
                stops=[RigidStop("x", 0.5, 1.0)],
                dampers=[DryFriction("x", 1.0, 0.3, second_tangent="y")],
            ),
            "needs a tangential_stiffness beside rigid stops that do not press on it",
        ),
    ],
)  # fmt: skip
def test_bad_numbers_are_refused_in_a_sentence(make, told):
    with pytest.raises(SystemModelError, match=told):
        make()
