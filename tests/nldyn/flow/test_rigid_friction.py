"""Friction at rigid stops: closed forms, Routh's impacts, and an independent integration."""

import math
from dataclasses import replace

import numpy as np
import pytest
from rigid_friction import RubbingWalls, UndecidedError, Wall
from sliding import GRAVITY as G
from sliding import flown, thrown

from nldyn import (
    ConstantForce,
    FlowMap,
    HarmonicForce,
    Parameter,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    impacts,
    load,
    normal_form,
    save,
    simulate,
    solve_orbit,
)
from nldyn.flow.sliding import slider_measures
from nldyn.system import Friction
from nldyn.system.chart import value_of

TURN = 2.0 * math.pi


def block(restitution, friction, push=0.0, **law):
    """A block of 1 kg over a table, with its weight and a constant push along it."""
    law = Friction(friction, **law)
    stop = RigidStop("y", restitution, direction=-1, tangent="x", friction=law)
    loads = [ConstantForce("y", -G)] + ([ConstantForce("x", push)] if push else [])
    return System.from_matrices(
        np.eye(2), np.zeros((2, 2)), {"x": [1.0, 0.0], "y": [0.0, 1.0]}, stops=[stop],
        excitation=loads,
    )  # fmt: skip


@pytest.mark.parametrize("time", [0.2, 0.4, 0.8, 1.1, 2.0, 6.0])
@pytest.mark.parametrize(("friction", "restitution"), [(0.2, 0.6), (0.2, 0.0), (2.0, 0.6)])
def test_a_block_thrown_over_a_table_bounces_slides_and_stops(friction, restitution, time):
    q, found = flown(block(restitution, friction), [0.0, 0.3, 4.0, 0.0], time)
    assert found.failure == ""
    assert q[[0, 2]] == pytest.approx(thrown(0.3, 4.0, restitution, friction, time), abs=1e-9)


@pytest.mark.parametrize(("push", "friction"), [(3.0, 0.2), (1.0, 0.2)])
def test_a_pushed_block_slips_where_friction_does_not_hold_it(push, friction):
    q, _ = flown(block(0.5, friction, push), [0.0, 0.0, 0.0, 0.0], 2.0)
    pace = max(push - friction * G, 0.0)
    assert q == pytest.approx([2.0 * pace, 0.0, 2.0 * pace, 0.0], abs=1e-12)


def test_a_belt_under_the_block_takes_it_along():
    q, _ = flown(block(0.5, 0.3, base_speed=1.0), [0.0, 0.0, 0.0, 0.0], 1.0)
    until = 1.0 / (0.3 * G)
    assert q[[0, 2]] == pytest.approx([1.0 - 0.5 * until, 1.0], abs=1e-12)


def rod(angle, restitution, friction):
    """A rod of 1 kg and 1 m, inclined, of which one end is over a table: x, y and its turning.

    Speeds of the end: closing with (0, -1, cos/2), sliding with (1, 0, sin/2); for the moment of
    inertia 1/12 they take 1 + 3 cos², 3 sin cos and 1 + 3 sin² per unit impulse.
    """
    c, s = math.cos(angle), math.sin(angle)
    names = {"down": [0.0, -1.0, 0.5 * c], "along": [1.0, 0.0, 0.5 * s]}
    return System.from_matrices(
        np.diag([1.0, 1.0, 1.0 / 12.0]), np.zeros((3, 3)), names,
        stops=[RigidStop("down", restitution, tangent="along", friction=friction)],
    ), (1.0 + 3.0 * c * c, 3.0 * s * c, 1.0 + 3.0 * s * s)  # fmt: skip


def routh(mobilities, e, mu, v, u):
    """Impulses (P, Q) by Routh's cases, written out one by one, and their name."""
    nn, nt, tt = mobilities
    s = math.copysign(1.0, u)
    slides, slows = nn + s * mu * nt, s * nt + mu * tt
    at_rest = np.linalg.solve([[nn, nt], [nt, tt]], [v, u])[0]  # P where both speeds are zero
    turn = abs(u) / slows if slows > 0.0 else math.inf
    if slides > 0.0 and v / slides <= turn:
        P = (1.0 + e) * v / slides
        if turn >= P:
            return (P, s * mu * P), "slides"
        if abs(nt) <= mu * tt:
            return (P, (u - nt * P) / tt), "sticks in restitution"
        return (P, s * mu * turn - s * mu * (P - turn)), "turns in restitution"
    if abs(nt) <= mu * tt:
        P = (1.0 + e) * at_rest
        return (P, (u - nt * P) / tt), "sticks in compression"
    P = (1.0 + e) * (turn + (v - slides * turn) / (nn - s * mu * nt))
    return (P, s * mu * turn - s * mu * (P - turn)), "turns in compression"


RODS = [
    (0.6, 0.5, 0.2, 1.0, 9.0, "slides"),
    (0.6, 0.5, 0.2, 1.0, -9.0, "slides"),
    (1.2, 0.5, 0.8, 1.0, 2.2, "sticks in restitution"),
    (1.2, 0.5, 0.8, 1.0, 0.2, "sticks in compression"),
    (0.6, 0.5, 0.2, 1.0, 0.66, "turns in restitution"),
    (0.6, 0.5, 0.2, 1.0, 0.2, "turns in compression"),
    (0.9, 0.5, 2.0, 1.0, -0.5, "sticks in compression"),  # where only sticking ends compression
]


@pytest.mark.parametrize(("angle", "e", "mu", "v", "u", "case"), RODS)
def test_a_rod_that_falls_on_a_table_follows_rouths_cases(angle, e, mu, v, u, case):
    system, mobilities = rod(angle, e, mu)
    flow = FlowMap(system)
    rows = np.array([system.participation["down"], system.participation["along"]])

    def behind(speeds, restitution=e, friction=mu):
        here = FlowMap(rod(angle, restitution, friction)[0])
        modes = np.array(list(rod(angle, restitution, friction)[0].participation.values()))
        modal = np.linalg.lstsq(modes, np.array([speeds[0], speeds[1]]), rcond=None)[0]
        found = here.shoot(
            here.to_state(np.concatenate([np.zeros(3), modal]))[None], np.array([0.0, TURN]), TURN,
            parameters=[Parameter("restitution"), Parameter("friction")],
        )  # fmt: skip
        assert found.failure == ""
        return here, found, modes @ here.to_modal(found.ends)[0][3:]

    (P, Q), name = routh(mobilities, e, mu, v, u)
    assert name == case
    nn, nt, tt = mobilities
    here, found, after = behind((v, u))
    assert after == pytest.approx([v - nn * P - nt * Q, u - nt * P - tt * Q], abs=1e-13)
    energy = np.linalg.solve([[nn, nt], [nt, tt]], np.eye(2))
    assert after @ energy @ after < np.array([v, u]) @ energy @ np.array([v, u])
    by = np.array([here.to_modal(column[None])[0][3:] for column in found.d_parameters[0].T])
    step = 1e-6
    for row, change in zip(by @ rows.T, ((step, 0.0), (0.0, step)), strict=True):
        up, down = (behind((v, u), e + w * change[0], mu + w * change[1])[2] for w in (1, -1))
        assert row == pytest.approx((up - down) / (2.0 * step), abs=1e-7)
    assert flow.system.rigid_stops[0].tangent == "along"


def drawn(seed):
    """A random structure with walls and friction on them, the same for both ways."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    A, B = rng.normal(size=(n, n)), 0.35 * rng.normal(size=(n, n))
    M, K, unit = np.eye(n) + B @ B.T, A @ A.T + np.eye(n), np.eye(n)
    names = [f"x{i}" for i in range(n)]
    omega, force, constant = rng.uniform(0.5, 2.0), 3.0 * rng.random(n), 2.0 * rng.normal(size=n)
    walls, stops, tangents = [], [], set()
    for _ in range(int(rng.integers(1, 3))):
        a, b = (int(i) for i in rng.permutation(n)[:2])
        if b in tangents:
            continue
        tangents.add(b)
        sign, gap = int(rng.choice([1, -1])), float(rng.uniform(0.02, 0.4))
        e, mu = float(rng.choice([0.0, rng.uniform(0.0, 0.9)])), float(rng.uniform(0.05, 0.9))
        belt = float(rng.choice([0.0, 0.2]))
        walls.append(Wall(sign * unit[a] + 0.0, gap, e, unit[b], mu, belt))
        law = Friction(mu, base_speed=belt)
        stops.append(RigidStop(names[a], e, gap, sign, tangent=names[b], friction=law))
    x = np.zeros(n)
    start = np.concatenate([x, rng.normal(size=n)])
    system = System.from_matrices(
        M, K, dict(zip(names, unit, strict=True)), damping=0.05 * K, stops=stops,
        excitation=[HarmonicForce(*row) for row in zip(names, force, strict=True)]
        + [ConstantForce(*row) for row in zip(names, constant, strict=True)],
    )  # fmt: skip
    return system, RubbingWalls(M, K, 0.05 * K, force, constant, walls, omega), omega, start


def interface_rows(system):
    return np.array([system.participation[name] for name in system.interfaces])


def to_state(system, y):
    rows, n = interface_rows(system), system.size
    both = np.concatenate([np.linalg.solve(rows, y[:n]), np.linalg.solve(rows, y[n:])])
    return system.linear.left @ both


def from_state(system, z):
    rows, n = interface_rows(system), system.size
    modal = system.linear.right @ z
    return np.concatenate([rows @ modal[:n], rows @ modal[n:]])


def off_differences(flow, found, z, phases, omega, step):
    """How far the Jacobian is off that by central differences, of its size."""
    by = np.array([
        (flow.shoot(z + step * row, phases, omega, sensitivities=False).ends[0]
         - flow.shoot(z - step * row, phases, omega, sensitivities=False).ends[0]) / (2.0 * step)
        for row in np.eye(z.size)
    ]).T  # fmt: skip
    return np.abs(found.jacobians[0] - by).max() / max(np.abs(by).max(), 1.0)


def check_drawn(seed):
    """Agreement of states and Jacobians; which events there were, or none if nothing is decided."""
    system, body, omega, start = drawn(seed)
    phases = np.array([0.0, 1.3 * TURN])
    flow, z = FlowMap(system), to_state(system, start)[None]
    found = flow.shoot(z, phases, omega)
    try:
        end, _ = body.run(start, phases[1] / omega)
    except UndecidedError:
        assert "Painlevé" in found.failure or not found.failure
        return set()
    assert found.failure == ""
    size = 1.0 + np.abs(found.jacobians).max()
    np.testing.assert_allclose(from_state(system, found.ends[0]), end, atol=1e-9 * size)
    assert min(off_differences(flow, found, z, phases, omega, h) for h in (1e-6, 1e-7)) < 1e-5
    return {what for _, _, what in body.events}


def test_random_systems_hit_stick_and_slide_as_exponentials_say():
    seen = set().union(*(check_drawn(seed) for seed in range(12)))
    assert seen == {"hit", "leave", "slip", "stop"}


def test_what_rests_in_a_corner_and_rubs_on_is_told_to_be_undecided():
    """Friction and the other stop share a force at will, and the other stop's friction needs it."""
    system, _, omega, start = drawn(40)
    found = FlowMap(system).shoot(to_state(system, start)[None], [0.0, 1.3 * TURN], omega)
    assert "friction at another stop shares that force" in found.failure


@pytest.mark.slow
def test_more_random_systems_do():
    for seed in range(12, 120):
        if seed != 40:  # see above
            check_drawn(seed)


def oscillator(friction, rests):
    """Two coupled masses, one of which hits a stop, on which the other one rubs."""
    M, K = np.array([[1.0, 0.2], [0.2, 1.0]]), np.array([[2.0, -0.5], [-0.5, 1.0]])
    C, force = 0.1 * K, np.array([0.7, 0.5])
    constant = np.array([0.6 if rests else 0.0, 0.0])
    e, gap, omega = (0.3 if rests else 0.7), 0.1, 0.9
    system = System.from_matrices(
        M, K, {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=C,
        stops=[RigidStop("x", e, gap, tangent="y", friction=friction)],
        excitation=[HarmonicForce("x", 0.7), HarmonicForce("y", 0.5)]
        + ([ConstantForce("x", 0.6)] if rests else []),
    )  # fmt: skip
    wall = Wall(np.array([1.0, 0.0]), gap, e, np.array([0.0, 1.0]), friction)
    return system, RubbingWalls(M, K, C, force, constant, [wall], omega), omega / TURN


@pytest.mark.parametrize("rests", [False, True])
def test_a_forced_oscillator_with_friction_at_its_stop(rests):
    """Orbit to 1e-8 and multipliers to 1e-6 beside exponentials from event to event."""
    system, body, hertz = oscillator(0.3, rests)
    orbit = solve_orbit(system, hertz)
    start = from_state(system, to_state_of(orbit))
    end, rested = body.run(start, 1.0 / hertz)
    assert (rested > 0.0) == rests
    np.testing.assert_allclose(end, start, atol=1e-8)
    step = 1e-6
    beside = [
        [body.run(start + way * step * row, 1.0 / hertz)[0] for way in (1.0, -1.0)]
        for row in np.eye(4)
    ]
    columns = np.array([(up - down) / (2.0 * step) for up, down in beside]).T
    expected = np.sort(np.abs(np.linalg.eigvals(columns)))
    np.testing.assert_allclose(np.sort(np.abs(orbit.multipliers)), expected, atol=1e-6)


def to_state_of(orbit):
    flow = orbit.problem.flow
    return flow.to_state(orbit.states(np.array([0.0])))[0]


def test_the_energy_of_an_orbit_is_what_impacts_and_friction_take():
    """What the forces give is lost in dampers, impacts and sliding, those of impulses with it."""
    system, _, hertz = oscillator(0.3, rests=True)
    orbit = solve_orbit(system, hertz)
    flow, motion = orbit.problem.flow, orbit.trajectory
    x, weights = np.polynomial.legendre.leggauss(40)
    work = 0.0
    for piece in range(len(motion.record.phase)):
        phase, time = motion.record.phase[piece], motion.record.duration[piece]
        phases = phase + motion.omega * time * 0.5 * (x + 1.0)
        q = orbit.states(phases)
        v = q[:, 2:]
        force = np.array([system.participation["x"] * 0.7, system.participation["y"] * 0.5]).sum(0)
        power = np.cos(phases) * (v @ force) + v @ system.participation["x"] * 0.6
        power -= np.einsum("ki,ij,kj->k", v, system.total_damping, v)
        work += 0.5 * time * float(weights @ power)
    lost = impacts(orbit).loss.sum() + orbit.friction[0].loss
    assert lost == pytest.approx(work, rel=1e-9)
    assert flow.system.sliders[0].stop == 0


def test_a_thrown_block_loses_all_its_energy():
    system = block(0.6, 0.2)
    motion = simulate(system, 0.2, 1, start=[0.0, 0.3, 4.0, 0.0])
    sliding = slider_measures(motion.stretches[0])[0]
    assert impacts(motion).loss.sum() == pytest.approx(G * 0.3, rel=1e-12)
    assert sliding.loss == pytest.approx(8.0, rel=1e-12)
    assert sliding.pressed_distance == pytest.approx(8.0 / 0.2, rel=1e-12)
    force = motion.history(20).force[:, 0]
    assert force[-1] == pytest.approx(G, rel=1e-12)


def test_friction_of_zero_changes_nothing():
    """Flights and impacts to the bit; rest, where one row more is solved for, as both claim."""
    for rests in (False, True):
        system, _, hertz = oscillator(0.0, rests)
        plain = system.with_elements(stops=(RigidStop("x", 0.3 if rests else 0.7, 0.1),))
        z = np.array([[0.02, 0.01, 0.3, 0.2]])
        found, expected = (
            FlowMap(each).shoot(z, np.array([0.0, 3.0 * TURN]), TURN * hertz)
            for each in (system, plain)
        )
        assert np.abs(found.ends - expected.ends).max() <= (1e-13 if rests else 0.0)
        assert np.abs(found.jacobians - expected.jacobians).max() <= (1e-8 if rests else 0.0)


def test_what_friction_does_is_not_decided_where_no_force_holds_it():
    """Painlevé's rod, on its end at the angle of the least coefficient 4/3."""
    angle = math.atan(2.0)
    system, (nn, nt, _) = rod(angle, 0.0, 1.5)
    assert nn - 1.5 * nt < 0.0
    pressed = system.with_elements(excitation=(ConstantForce("down", 1.0),))
    modes = np.array(list(system.participation.values()))
    for slip, fails in ((-1.0, True), (1.0, False)):
        modal = np.linalg.lstsq(modes, np.array([0.0, slip]), rcond=None)[0]
        flow = FlowMap(pressed)
        z = flow.to_state(np.concatenate([np.zeros(3), modal]))[None]
        found = flow.shoot(z, np.array([0.0, 0.1]), 1.0)
        assert ("stop 0" in found.failure and "at phase 0 rad" in found.failure) == fails


def test_what_slips_at_rest_into_where_no_force_holds_it_is_told_at_once():
    """Painlevé's rod again, stuck under 1 N until 3 sin φ N along it are 1.5 times that."""
    system, _ = rod(math.atan(2.0), 0.0, 1.5)
    loads = (ConstantForce("down", 1.0), HarmonicForce("along", 3.0, phase_deg=90.0))
    flow = FlowMap(system.with_elements(excitation=loads))
    found = flow.shoot(np.zeros((1, 6)), np.array([0.0, 1.0]), 1.0)
    assert f"at phase {math.pi / 6.0:.6g} rad" in found.failure


def test_a_branch_in_the_friction_and_its_file(tmp_path):
    system, body, hertz = oscillator(0.3, rests=False)
    friction = Parameter("friction")
    branch = continue_branch(solve_orbit(system, hertz), (0.25, 0.35), parameter=friction)
    assert branch.stop_reason.count("end of the range of friction") == 2
    for orbit in (branch.points[0], last := branch.points[-1]):
        coefficient = value_of(orbit.system, hertz, friction)
        body.walls = [body.walls[0]._replace(friction=coefficient)]
        start = from_state(system, to_state_of(orbit))
        np.testing.assert_allclose(body.run(start, 1.0 / hertz)[0], start, atol=1e-8)
    assert coefficient == pytest.approx(0.35, abs=1e-12)
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert again.points[-1].system.stops == last.system.stops


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"friction": 0.2}, "needs both"),
        ({"tangent": "x"}, "needs both"),
        ({"tangent": "y", "friction": 0.2}, "another interface"),
        ({"tangent": "x", "friction": -0.2}, "coefficient"),
        ({"tangent": "x", "friction": Friction(0.2, 0.3, 0.1)}, "has one coefficient"),
    ],
)
def test_bad_numbers_are_refused_in_a_sentence(changes, words):
    with pytest.raises(SystemModelError, match=words):
        replace(block(0.5, 0.2), stops=(RigidStop("y", 0.5, **changes),))


def test_a_tangent_along_the_normal_is_refused():
    with pytest.raises(SystemModelError, match="acts on no motion along the rigid stop at 'x'"):
        System.from_matrices(
            [[1.0]], [[1.0]], {"x": [1.0], "t": [0.5]},
            stops=[RigidStop("x", 0.5, tangent="t", friction=0.1)],
        )  # fmt: skip


def test_a_stiff_elastic_stop_with_friction_tends_to_the_rigid_one():
    """Slid through, an impact takes μ times the normal impulse with both."""
    rigid = flown(block(1.0, 0.1), [0.0, 0.1, 2.0, 0.0], 0.25)[0]
    off = []
    for stiffness in (1e8, 1e10):
        stop = Stop("y", stiffness, 1.0, direction=-1, tangent="x", friction=0.1)
        soft = flown(block(1.0, 0.1).with_elements(stops=(stop,)), [0.0, 0.1, 2.0, 0.0], 0.25)[0]
        off.append(np.abs(soft - rigid).max())
    assert off[1] < 0.15 * off[0] < 1e-3  # as the duration of the contact, 1/√k


def test_friction_counts_in_what_follows_a_grazing():
    """The multiplier times the speed of a slight impact tends to what the normal form says."""
    M, K = np.array([[1.0, 0.2], [0.2, 1.0]]), np.array([[2.0, -0.5], [-0.5, 1.0]])
    system = System.from_matrices(
        M, K, {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=0.1 * K,
        stops=[RigidStop("x", 0.7, 0.3, tangent="y", friction=0.6)],
        excitation=[HarmonicForce("x", 0.7), HarmonicForce("y", 0.5)],
    )  # fmt: skip
    branch = continue_branch(solve_orbit(system, 0.2245), (0.224, 0.2252))
    (touch,) = (point for point in branch.special_points if point.kind == "GR")
    slight = [(o, hits.speed[0]) for o in branch.points if len(hits := impacts(o)) == 1]
    growth = [abs(o.multipliers[0]) * speed for o, speed in slight if 1e-5 < speed < 2e-4]
    assert growth
    assert growth == pytest.approx(len(growth) * [normal_form(touch).coefficient.value], rel=0.03)
