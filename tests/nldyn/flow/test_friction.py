"""Dry friction against closed forms, differences and an independent integration."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from sliding import Body, Contact, Wall, off_differences

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
    load,
    save,
    solve_orbit,
)
from nldyn.system import DryFriction, Friction
from nldyn.system.chart import value_of, with_value


def block(share, *, damping=0.0, force=1.0, **law):
    """Mass 1 on a spring 1, pressed on by 1 N."""
    return System.from_matrices(
        [[1.0]],
        [[1.0]],
        {"x": [1.0]},
        damping=[[damping]],
        dampers=[DryFriction("x", 1.0, Friction(share, **law))],
        excitation=[HarmonicForce("x", force)] if force else [],
    )


def to_state(system, y):
    """State z of displacements and speeds (2n,) of all interfaces."""
    n = system.size
    rows = np.array([system.participation[name] for name in system.interfaces])
    modal = np.concatenate([np.linalg.solve(rows, y[:n]), np.linalg.solve(rows, y[n:])])
    return system.linear.left @ modal


def from_state(system, z):
    n = system.size
    rows = np.array([system.participation[name] for name in system.interfaces])
    modal = system.linear.right @ z
    return np.concatenate([rows @ modal[:n], rows @ modal[n:]])


@pytest.mark.parametrize(
    ("swings", "where"), [(1, -0.8), (2, 0.6), (3, -0.4), (4, 0.2), (5, 0.0), (9, 0.0)]
)
def test_a_block_loses_twice_its_friction_in_each_half_swing_and_sticks(swings, where):
    system = block(0.1, force=0.0)
    found = FlowMap(system).shoot(
        to_state(system, np.array([1.0, 0.0]))[None], np.array([0.0, swings * math.pi]), 1.0
    )
    assert found.failure == ""
    np.testing.assert_allclose(from_state(system, found.ends[0]), [where, 0.0], atol=1e-14)


@pytest.mark.parametrize("ratio", [0.6, 0.8, 1.25, 1.5])
@pytest.mark.parametrize("share", [0.1, 0.4])
def test_den_hartogs_amplitude_of_motion_without_stops(ratio, share):
    """J. P. Den Hartog (1931), Trans. ASME 53, for Coulomb's friction alone."""
    swing = math.sin(math.pi / ratio) / (ratio * (1.0 + math.cos(math.pi / ratio)))
    amplitude = math.sqrt(1.0 / (1.0 - ratio**2) ** 2 - (swing * share) ** 2)
    orbit = solve_orbit(block(share), ratio / (2.0 * math.pi))
    assert orbit.max_abs_displacement == pytest.approx(amplitude, rel=1e-9)
    # the excitation gives what friction takes: 4 F X
    phases = np.linspace(0.0, 2.0 * math.pi, 4001)
    states = orbit.states(phases)
    rate = states @ orbit.trajectory.flow.rate_rows[0]
    work = np.trapezoid(np.cos(phases) * rate, phases) / ratio
    assert work == pytest.approx(4.0 * share * amplitude, rel=1e-5)  # of the trapezoids


def drawn(seed, walled=False, drops=False):
    """A random structure with friction at stops and all the time, the same for both ways."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    A = rng.normal(size=(n, n))
    M, K = np.diag(rng.uniform(0.5, 2.0, n)) + 0.2 * drops, A @ A.T + np.eye(n)
    C, names, unit = 0.05 * K + 0.02 * M, [f"x{i}" for i in range(n)], np.eye(n)
    omega, forces, phases = rng.uniform(0.5, 2.0), 3.0 * rng.random(n), rng.uniform(0.0, 360.0, n)
    contacts, stops, dry, walls = [], [], [], []
    for b in rng.permutation(n)[: int(rng.integers(1, n + 1))]:
        law = Friction(float(rng.uniform(0.05, 0.8)), base_speed=float(rng.choice([0.0, 0.3])))
        if rng.random() < 0.4 or drops:
            fading = None if drops else 0.2
            law = Friction(law.coefficient, 1.5 * law.coefficient, fading, law.base_speed)
        if rng.random() < 0.5:
            force = float(rng.uniform(0.3, 2.0))
            contacts.append(Contact(unit[b], law, force))
            dry.append(DryFriction(names[b], force, law))
            continue
        a = int(rng.choice([i for i in range(n) if i != b]))
        sign, p = int(rng.choice([1, -1])), float(rng.choice([1.0, 1.5]))
        k, gap = float(rng.uniform(20.0, 200.0)), float(rng.uniform(-0.1, 0.8))
        contacts.append(Contact(unit[b], law, 0.0, sign * unit[a], k, p, gap))
        stops.append(Stop(names[a], k, p, gap, sign, friction=law, tangent=names[b]))
    if walled:
        a, sign, gap = int(rng.integers(n)), int(rng.choice([1, -1])), float(rng.uniform(0.1, 0.6))
        if all(contact.tangent[a] == 0.0 for contact in contacts):
            walls.append(Wall(sign * unit[a] + 0.0, gap, 0.7))
            stops.append(RigidStop(names[a], 0.7, gap, sign))
    turn = np.radians(phases)
    body = Body(M, C, K, lambda t: forces * np.cos(omega * t + turn), contacts, walls)
    system = System.from_matrices(
        M, K, dict(zip(names, unit, strict=True)), damping=C, stops=stops, dampers=dry,
        excitation=[HarmonicForce(*row) for row in zip(names, forces, phases, strict=True)],
    )  # fmt: skip
    return system, body, omega, 0.7 * rng.normal(size=2 * n), float(rng.uniform(1.0, 3.0))


def agrees(seed, walled=False, drops=False):
    system, body, omega, start, turns = drawn(seed, walled, drops)
    phases = np.array([0.0, 2.0 * math.pi * turns])
    expected, _ = body.followed(start, phases[1] / omega, 0.2 / omega)
    flow, z = FlowMap(system), to_state(system, start)[None]
    found = flow.shoot(z, phases, omega)
    assert found.failure == ""
    size = np.abs(expected).max()
    np.testing.assert_allclose(from_state(system, found.ends[0]), expected, atol=1e-8 * size)
    steps = (1e-5, 1e-6)  # states are good to 1e-10, and the longer step may pass over a corner
    assert min(off_differences(flow, found, z, phases, omega, step) for step in steps) < 3e-5


@pytest.mark.parametrize("seed", range(20))
def test_random_systems_agree_with_integration_from_event_to_event(seed):
    agrees(seed)


@pytest.mark.parametrize("seed", range(12))
def test_impacts_on_rigid_stops_turn_what_slides(seed):
    agrees(seed, walled=True)


@pytest.mark.parametrize("seed", range(10))
def test_random_systems_whose_friction_drops_at_once_agree(seed):
    agrees(seed, drops=True)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 7, 15, 20, 25, 27, 33, 41, 49])  # none begins beyond its wall
def test_impacts_on_rigid_stops_turn_what_slides_with_a_drop_at_once(seed):
    agrees(seed, walled=True, drops=True)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 50))
def test_more_random_systems_whose_friction_drops_at_once_agree(seed):
    agrees(seed, drops=True)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20, 320))
def test_more_random_systems_agree(seed):
    agrees(seed)


@pytest.mark.parametrize("law", [Friction(3.0), Friction(0.3), Friction(0.2, 0.3)])
def test_derivatives_pass_a_dashpot_that_is_hit_while_something_sticks(law):
    """Its force jumps: what sticks takes its share, or slips at once."""
    system = System.from_matrices(
        [[1.0, 0.5], [0.5, 1.0]], np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        damping=0.05 * np.eye(2), stops=[Stop("x", 20.0, 1.0, 0.3, dashpot=2.0)],
        dampers=[DryFriction("y", 1.0, law)], excitation=[HarmonicForce("x", 0.05)],
    )  # fmt: skip
    flow, z = FlowMap(system), to_state(system, np.array([0.0, 0.0, 0.8, 0.0]))[None]
    phases = np.array([0.0, 1.2])
    found = flow.shoot(z, phases, 1.0)
    assert found.closings[0] == 1
    assert off_differences(flow, found, z, phases, 1.0, 1e-6) < 5e-6


@pytest.mark.parametrize(
    "other", [DryFriction("w", 3.0, 1.0, tangential_stiffness=20.0), DryFriction("w", 30.0, 1.0)]
)
@pytest.mark.parametrize("seed", [0, 4])
def test_derivatives_pass_friction_that_fades_beside_what_sticks(seed, other):
    """What sticks moves the stop, and with it what presses on the slider."""
    rng, n, names = np.random.default_rng(seed), 4, "xyzw"
    A, B = rng.normal(size=(n, n)), 0.3 * rng.normal(size=(n, n))
    M, K = np.eye(n) + B @ B.T, A @ A.T + np.eye(n)
    forces, phases = 3.0 * rng.random(n), rng.uniform(0.0, 360.0, n)
    system = System.from_matrices(
        M, K, dict(zip(names, np.eye(n), strict=True)), damping=0.05 * K,
        stops=[Stop("x", 60.0, 1.0, 0.05, tangent="y", friction=Friction(0.3, 0.5, 0.2))],
        dampers=[other],
        excitation=[HarmonicForce(*row) for row in zip(names, forces, phases, strict=True)],
    )  # fmt: skip
    flow, turns = FlowMap(system), np.array([0.0, 2.2 * math.pi])
    z = flow.to_state(0.3 * rng.normal(size=2 * n))[None]
    found = flow.shoot(z, turns, 1.3)
    assert found.failure == "" and found.closings[0] > 0
    steps = (1e-5, 1e-6)
    assert min(off_differences(flow, found, z, turns, 1.3, step) for step in steps) < 1e-6


@pytest.mark.parametrize("speed", [1e-1, 1e-3, 1e-4])
@pytest.mark.parametrize("drop", [0.0, 0.1])
def test_derivatives_by_a_slow_touch_that_lets_something_slip_are_in_closed_form(drop, speed):
    """A touch that comes later by dx/v takes what it changes of the forces, M dv = -ΔF dx/v.

    Pulled with h, half the dashpot's share less than friction at rest holds, it slips at once: the
    forces change by c v in x, and by what is no longer held in y. With one coefficient that share
    goes with v; where friction drops at once it does not, and a grazing has no derivatives.
    """
    mass, c, gap, soon = np.array([[1.0, 0.5], [0.5, 1.0]]), 2.0, 0.3, 1e-6
    held = 1.0 + drop - 0.25 * c * speed
    system = System.from_matrices(
        mass, np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=np.zeros((2, 2)),
        stops=[Stop("x", 20.0, 1.0, gap, dashpot=c)],
        dampers=[DryFriction("y", 1.0, Friction(1.0, 1.0 + drop))],
        excitation=[ConstantForce("y", held - 0.5 * gap)],  # at rest y takes its share of x'' = -x
    )  # fmt: skip
    back = [gap - (speed + 0.5 * gap * soon) * soon, 0.0, speed + gap * soon, 0.0]  # x'' = -gap
    flow, start = FlowMap(system), to_state(system, np.array(back))[None]
    found = flow.shoot(start, np.array([0.0, 2.0 * soon]), 1.0)
    assert not found.failure and found.closings[0] == 1
    by_x = from_state(system, found.jacobians[0] @ to_state(system, np.eye(4)[0]))
    exact = np.linalg.solve(mass, [-c, (held - 1.0) / speed])
    assert by_x[2:] == pytest.approx(exact, rel=2e-5)  # the spring of 20 N/m acts for 1e-6 s


@pytest.mark.parametrize(("name", "index"), [("friction", 0), ("friction", 1), ("normal_force", 1)])
@pytest.mark.parametrize(
    "laws", [(Friction(0.3, 0.5, 0.2), 0.4), (Friction(0.3, 0.5), Friction(0.4, 0.6))]
)
def test_derivatives_by_the_numbers_of_sliders_are_those_of_differences(name, index, laws):
    system = System.from_matrices(
        np.diag([1.0, 2.0]),
        [[3.0, -1.0], [-1.0, 2.0]],
        {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        modal_damping=0.02,
        stops=[Stop("x", 50.0, 1.5, 0.1, friction=laws[0], tangent="y")],
        dampers=[DryFriction("x", 0.3, laws[1])],
        excitation=[HarmonicForce("x", 2.0), HarmonicForce("y", 1.0)],
    )
    parameter, step = Parameter(name, index), 1e-6
    z, phases = to_state(system, np.array([0.3, 0.5, 0.2, -0.4]))[None], np.array([0.0, 9.0])
    found = FlowMap(system).shoot(z, phases, 1.1, parameters=[parameter])
    value = value_of(system, 1.0, parameter)
    up, down = (
        FlowMap(with_value(system, parameter, value + way * step)).shoot(z, phases, 1.1).ends[0]
        for way in (1.0, -1.0)
    )
    np.testing.assert_allclose(found.d_parameters[0, :, 0], (up - down) / (2.0 * step), atol=1e-7)


def test_a_branch_goes_on_where_a_block_begins_to_stick_and_is_saved(tmp_path):
    """Den Hartog's motion gets stops: the branch has a corner there, and is passed."""
    branch = continue_branch(solve_orbit(block(0.4, damping=0.05), 0.13), (0.05, 0.25))
    assert branch.stop_reason == "end of the frequency range / end of the frequency range"
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    first = branch.points[0]
    assert again.points[0].system.sliders == first.system.sliders
    for orbit in branch.points[:: max(len(branch.points) // 7, 1)]:
        alone = solve_orbit(orbit.system, orbit.frequency_hz)
        assert orbit.max_abs_displacement == pytest.approx(alone.max_abs_displacement, rel=1e-8)


def pushed(swing):
    """A block on friction that a constant force holds against a rigid wall."""
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.1]], stops=[RigidStop("x", 0.5, 0.5)],
        dampers=[DryFriction("x", 1.0, 0.3)],
        excitation=[ConstantForce("x", 2.0), HarmonicForce("x", swing)],
    )  # fmt: skip


def test_a_block_on_friction_rests_against_a_wall_and_is_let_go():
    for swing in (0.0, 3.0):
        system = pushed(swing)
        phases = np.array([0.0, 40.0 * math.pi]) + math.pi * (swing > 0.0)
        start = to_state(system, np.array([0.0, 0.0]))[None]
        found = FlowMap(system).shoot(start, phases, 0.3)
        assert found.failure == ""
        x, v = from_state(system, found.ends[0])
        if swing == 0.0:
            assert abs(x - 0.5) < 1e-12
            assert abs(v) < 1e-12
        else:
            assert x < 0.4
    orbit = solve_orbit(pushed(3.0), 0.3 / (2.0 * math.pi))
    assert orbit.rests
    assert orbit.flow_error.state < 1e-8
    history = orbit.history(500)
    resting = history.force[:, 0] != 0.0
    assert 0.1 < resting.mean() < 0.9
    # the wall alone holds it: what pulls, less the spring
    pull = 2.0 + 3.0 * np.cos(orbit.omega * history.time) - 0.5
    np.testing.assert_allclose(history.force[resting, 0], pull[resting], atol=1e-9)


@pytest.mark.parametrize("fading", [1e-3, 1e-4, 1e-5])
def test_a_slip_grows_as_fast_as_its_friction_falls(fading):
    law = Friction(0.3, 0.4, fading, base_speed=0.1)

    def rate(_, y):  # of displacement and slip behind the belt
        return [law.base_speed - y[1], y[0] - float(law.at(y[1]))]

    found = solve_ivp(rate, (0.0, 1.0), [0.4, 0.0], "DOP853", rtol=1e-13, atol=1e-17)
    belt = [DryFriction("x", 1.0, law)]
    flow = FlowMap(System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]}, dampers=belt))
    begin = flow.to_state(np.array([0.4 - 0.1 * law.base_speed, law.base_speed]))
    end = flow.to_modal(flow.shoot(begin[None], np.array([0.0, 1.1]), 1.0).ends[0])
    off = end - [found.y[0, -1], law.base_speed - found.y[1, -1]]
    assert np.abs(off).max() < 1e-9


def test_friction_of_zero_changes_nothing():
    plain = System.from_matrices(
        np.eye(2), [[2.0, -1.0], [-1.0, 2.0]], {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        modal_damping=0.05, stops=[Stop("x", 100.0, gap=0.2)], excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    smooth = plain.with_elements(stops=(Stop("x", 100.0, gap=0.2, friction=0.0, tangent="y"),))
    orbits = [solve_orbit(system, 0.15) for system in (plain, smooth)]
    sizes = [orbit.max_abs_displacement for orbit in orbits]
    assert orbits[0].impacts > 0
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-9)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: Friction(-0.1), "coefficient must not be negative"),
        (lambda: Friction(0.2, 0.1, 1.0), "at_rest must be at least"),
        (lambda: Friction(0.2, 0.1), "at_rest must be at least"),
        (lambda: Friction(0.2, fading_speed=0.1), "needs the at_rest that fades"),
        (
            lambda: Stop("x", 1.0, friction=0.2, tangent="y", tangent_against="z"),
            "tangent_against needs the 'against'",
        ),
        (
            lambda: DryFriction("x", 1.0, Friction(0.2, 0.3), tangential_stiffness=1.0),
            "nothing tells how far the spring leaps",
        ),
        (lambda: DryFriction("x", 0.0, 0.2), "normal_force must be positive"),
        (lambda: DryFriction("x", 1.0, 0.2, "x"), "against must be another"),
        (lambda: Stop("x", 1.0, friction=0.2), "needs both friction and tangent"),
        (lambda: Stop("x", 1.0, friction=0.2, tangent="x"), "tangent must be another"),
        (
            lambda: Stop("x", 1.0, 1.0, dashpot=0.1, tangent="y", friction=0.2),
            "never pulls",
        ),
        (
            lambda: Stop("x", 1.0, dissipation=0.1, tangent="y", friction=0.2),
            "never pulls",
        ),
    ],
)
def test_bad_numbers_are_refused_in_a_sentence(make, told):
    with pytest.raises(SystemModelError, match=told):
        make()


def test_what_one_mode_cannot_tell_apart_is_refused():
    rough = {"tangent": "y", "friction": 0.2}
    both_sides = [Stop("x", 1.0, gap=0.1, direction=sign, **rough) for sign in (1, -1)]
    names = {"x": [1.0, 0.0], "y": [0.0, 1.0]}
    System.from_modal([1.0, 2.0], names, stops=both_sides)
    for elements in (
        {"dampers": [DryFriction("x", 1.0, 0.1), DryFriction("y", 1.0, 0.1)]},
        {"stops": [Stop("x", 1.0, gap=0.1, **rough), Stop("x", 9.0, gap=0.2, **rough)]},
    ):
        rows = {"x": [1.0], "y": [2.0]} if len(elements.get("dampers", ())) == 2 else names
        with pytest.raises(SystemModelError, match="not independent"):
            System.from_modal([1.0, 2.0][: len(rows["x"])], rows, **elements)
