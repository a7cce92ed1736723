"""Friction behind springs against closed forms, differences and an independent integration."""

import math

import numpy as np
import pytest
from sliding import Body, Contact, Wall, off_differences

from nldyn import (
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
    simulate,
    solve_orbit,
)
from nldyn.system import DryFriction, Friction
from nldyn.system.chart import value_of, with_value


def drawn(seed, kinds):
    """A random structure with friction of the kinds given, the same for both ways.

    Kinds are constant (a spring before a constant force), stop (before that of a stop), hard
    (friction without a spring), and wall (a rigid stop beside them).
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    A = rng.normal(size=(n, n))
    M, K = np.diag(rng.uniform(0.5, 2.0, n)), A @ A.T + np.eye(n)
    C, names, unit = 0.05 * K + 0.02 * M, [f"x{i}" for i in range(n)], np.eye(n)
    omega, forces, turns = rng.uniform(0.5, 2.0), 3.0 * rng.random(n), rng.uniform(0.0, 360.0, n)
    at_stops, dry, stops, dampers, walls = [], [], [], [], []
    for b in rng.permutation(n)[: int(rng.integers(1, n + 1))]:
        law = Friction(float(rng.uniform(0.05, 0.8)), base_speed=float(rng.choice([0.0, 0.3])))
        kind = str(rng.choice([each for each in kinds if each != "wall"]))
        spring = float(10.0 ** rng.uniform(0.0, 2.5))
        if kind == "hard":
            force = float(rng.uniform(0.3, 2.0))
            dry.append(Contact(unit[b], law, force))
            dampers.append(DryFriction(names[b], force, law))
        elif kind == "constant":
            for _ in range(int(rng.integers(1, 4))):  # several are a chain
                force, each = float(rng.uniform(0.3, 2.0)), spring * float(rng.uniform(0.5, 2.0))
                dry.append(Contact(unit[b], law, force, spring=each))
                dampers.append(DryFriction(names[b], force, law, tangential_stiffness=each))
        else:
            a = int(rng.choice([i for i in range(n) if i != b]))
            sign, p = int(rng.choice([1, -1])), float(rng.choice([1.0, 1.5]))
            k, gap = float(rng.uniform(20.0, 200.0)), float(rng.uniform(-0.1, 0.8))
            at_stops.append(Contact(unit[b], law, 0.0, sign * unit[a], k, p, gap, spring))
            stops.append(
                Stop(names[a], k, p, gap, sign, friction=law, tangent=names[b],
                     tangential_stiffness=spring)
            )  # fmt: skip
    if "wall" in kinds:
        a, sign, gap = int(rng.integers(n)), int(rng.choice([1, -1])), float(rng.uniform(0.1, 0.6))
        walls.append(Wall(sign * unit[a] + 0.0, gap, 0.7))
        stops.append(RigidStop(names[a], 0.7, gap, sign))
    turn = np.radians(turns)
    contacts = at_stops + dry
    body = Body(M, C, K, lambda t: forces * np.cos(omega * t + turn), contacts, walls)
    system = System.from_matrices(
        M, K, dict(zip(names, unit, strict=True)), damping=C, stops=stops, dampers=dampers,
        excitation=[HarmonicForce(*row) for row in zip(names, forces, turns, strict=True)],
    )  # fmt: skip
    start = 0.7 * rng.normal(size=2 * n)
    if walls:  # not behind it
        start[a] = sign * min(sign * start[a], 0.5 * gap)
    return system, body, omega, start, float(rng.uniform(1.0, 3.0))


def placed(body, start):
    """A start with what is behind springs where these have no strain."""
    n = len(body.mass)
    places = [c.tangent @ start[:n] for c in body.contacts if c.spring is not None]
    return np.concatenate([start, places])


def to_state(flow, y):
    system = flow.system
    n = system.size
    rows = np.array([system.participation[name] for name in system.interfaces])
    modal = [np.linalg.solve(rows, y[:n]), np.linalg.solve(rows, y[n : 2 * n]), y[2 * n :]]
    return flow.to_state(np.concatenate(modal))


def from_state(flow, z):
    system = flow.system
    n = system.size
    rows = np.array([system.participation[name] for name in system.interfaces])
    modal = flow.to_start(z)
    return np.concatenate([rows @ modal[:n], rows @ modal[n : 2 * n], modal[2 * n :]])


def agrees(seed, kinds):
    system, body, omega, start, turns = drawn(seed, kinds)
    phases, flow = np.array([0.0, 2.0 * math.pi * turns]), FlowMap(system)
    start = placed(body, start)
    expected, _ = body.followed(start, phases[1] / omega, 0.2 / omega)
    z = to_state(flow, start)[None]
    found = flow.shoot(z, phases, omega)
    assert found.failure == ""
    np.testing.assert_allclose(
        from_state(flow, found.ends[0]), expected, atol=1e-8 * np.abs(expected).max()
    )
    steps = (1e-5, 1e-6)  # the longer one may pass over a corner
    assert min(off_differences(flow, found, z, phases, omega, step) for step in steps) < 3e-5


KINDS = {
    "constant": ["constant"],
    "stop": ["stop"],
    "mixed": ["constant", "stop", "hard"],
    "walled": ["constant", "stop", "hard", "wall"],
}


@pytest.mark.parametrize(
    ("kinds", "seed"), [("constant", 0), ("stop", 0), ("mixed", 0), ("walled", 1)]
)
def test_random_systems_agree_with_integration_from_event_to_event(kinds, seed):
    agrees(seed, KINDS[kinds])


@pytest.mark.slow
@pytest.mark.parametrize("kinds", ["constant", "stop", "mixed"])
@pytest.mark.parametrize("seed", range(1, 40))
def test_more_random_systems_agree(seed, kinds):
    agrees(seed, KINDS[kinds])


def block(*springs, force=1.0, friction=0.4, damping=0.05):
    """Mass 1 on a spring 1, with friction of 0.4 N behind each of some springs."""
    dry = [DryFriction("x", 1.0, friction, tangential_stiffness=spring) for spring in springs]
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[damping]], dampers=dry,
        excitation=[HarmonicForce("x", force)],
    )  # fmt: skip


OMEGA = 1.1
HZ = OMEGA / (2.0 * math.pi)


def test_a_chain_loses_in_a_cycle_what_jenkins_elements_do():
    """4 μN (X - μN/k_t) of each that slides, where X is the amplitude; none of the last."""
    springs = (0.5, 2.0, 0.05)
    orbit = solve_orbit(block(*springs), HZ)
    size = orbit.max_abs_displacement
    for spring, found in zip(springs, orbit.friction, strict=True):
        slides = max(size - 0.4 / spring, 0.0)
        assert found.loss == pytest.approx(4.0 * 0.4 * slides, rel=1e-12, abs=1e-12)
        assert found.distance == pytest.approx(4.0 * slides, rel=1e-12, abs=1e-12)
        assert found.peak_force == pytest.approx(min(0.4, spring * size), rel=1e-9)
        assert found.stuck + found.slid == pytest.approx(1.0, abs=1e-14)
    # the excitation gives what friction and the dashpot take
    phases = np.linspace(0.0, 2.0 * math.pi, 20001)
    speed = orbit.states(phases)[:, 1] * orbit.system.participation["x"]
    work = np.trapezoid((np.cos(phases) - 0.05 * speed) * speed, phases) / OMEGA
    assert work == pytest.approx(sum(found.loss for found in orbit.friction), rel=1e-6)


def test_what_always_sticks_is_a_spring_and_keeps_its_place():
    orbit = solve_orbit(block(2.0, friction=4.0), HZ)
    exact = 1.0 / abs(3.0 - OMEGA**2 + 0.05j * OMEGA)
    assert orbit.max_abs_displacement == pytest.approx(exact, rel=1e-12)
    (found,) = orbit.friction
    assert (found.stuck, found.loss) == (1.0, 0.0)
    rate = np.exp(-0.05 * math.pi / OMEGA)
    assert np.abs(orbit.multipliers) == pytest.approx([rate, rate, 0.0, 0.0], rel=1e-9)
    branch = continue_branch(orbit, (0.9 * HZ, 1.1 * HZ))
    assert branch.special_points == ()
    places = [
        point.problem.flow.places(point.problem.nodes(point.point)) for point in branch.points
    ]
    assert np.abs(places).max() == 0.0


def test_a_stiff_spring_is_next_to_none():
    """A turn takes it a time that goes with the root of 1/k_t, and so does the impulse it lacks."""
    hard = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.05]], dampers=[DryFriction("x", 1.0, 0.4)],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    exact = solve_orbit(hard, HZ).max_abs_displacement
    off = [
        abs(solve_orbit(block(spring), HZ).max_abs_displacement / exact - 1.0)
        for spring in (1e4, 1e5, 1e6)
    ]
    assert off[0] / off[1] == pytest.approx(math.sqrt(10.0), rel=0.01)
    assert off[1] / off[2] == pytest.approx(math.sqrt(10.0), rel=0.01)


def test_friction_of_zero_behind_a_spring_changes_nothing():
    plain = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.05]], excitation=[HarmonicForce("x", 1.0)]
    )
    phases, start = np.array([0.0, 9.0]), np.array([0.3, -0.2])
    expected = FlowMap(plain).shoot(start[None], phases, OMEGA)
    found = FlowMap(block(2.0, friction=0.0)).shoot(
        np.append(start, [0.0, 0.0])[None], phases, OMEGA
    )
    np.testing.assert_allclose(found.ends[0, :2], expected.ends[0], rtol=1e-12)
    np.testing.assert_allclose(found.jacobians[0, :2, :2], expected.jacobians[0], atol=1e-12)


def rubbing(spring):
    """Pressed on where a spring stops it, with a Jenkins element beside it."""
    return System.from_matrices(
        np.diag([1.0, 2.0]), [[3.0, -1.0], [-1.0, 3.0]], {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        modal_damping=0.03,
        stops=[
            Stop("x", 60.0, 1.0, 0.3, friction=0.3, tangent="y", tangential_stiffness=spring)
        ],
        dampers=[DryFriction("y", 0.5, 0.6, tangential_stiffness=3.0)],
        excitation=[HarmonicForce("x", 2.0), HarmonicForce("y", 1.0)],
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "index"),
    [
        *(("friction", i) for i in (0, 1)),
        ("normal_force", 1),
        *(("tangential_stiffness", i) for i in (0, 1)),
        *((name, 0) for name in ("gap", "stiffness")),
    ],
)
def test_derivatives_by_numbers_are_those_of_differences(name, index):
    system, parameter = rubbing(5.0), Parameter(name, index)
    phases, omega = np.array([0.0, 14.0]), 1.3
    start = np.array([[0.1, -0.2, 0.3, 0.1, 0.1, 0.0, -0.05, 0.0]])
    flow = FlowMap(system)
    exact = flow.shoot(start, phases, omega, parameters=[parameter]).d_parameters[0, :, 0]
    value = value_of(system, 1.0, parameter)
    ends = [
        FlowMap(with_value(system, parameter, value * (1.0 + way))).shoot(start, phases, omega).ends
        for way in (1e-6, -1e-6)
    ]
    slope = (ends[0] - ends[1])[0] / (2e-6 * value)
    np.testing.assert_allclose(exact, slope, atol=1e-6 * np.abs(exact).max())


def test_orbits_multipliers_and_files(tmp_path):
    """The multipliers are those of the monodromy matrix by differences."""
    orbit = solve_orbit(rubbing(5.0), 0.2)
    problem = orbit.problem
    node, turn = problem.nodes(orbit.point)[0], np.array([0.0, 2.0 * math.pi])
    flow = problem.flow
    columns = [
        (flow.shoot((node + step)[None], turn, orbit.omega).ends[0]
         - flow.shoot((node - step)[None], turn, orbit.omega).ends[0]) / 2e-6
        for step in 1e-6 * np.eye(node.size)
    ]  # fmt: skip
    expected = np.linalg.eigvals(np.array(columns).T)
    largest = np.sort(np.abs(expected))[::-1]
    np.testing.assert_allclose(np.abs(orbit.multipliers)[:4], largest[:4], atol=1e-6)
    branch = continue_branch(orbit, (1.0, 20.0), parameter=Parameter("tangential_stiffness", 0))
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert again.points[-1].system.stops == branch.points[-1].system.stops
    np.testing.assert_array_equal(again.points[-1].multipliers, branch.points[-1].multipliers)


def test_a_simulation_goes_on_from_where_another_one_ended():
    system = rubbing(5.0)
    whole, first = (simulate(system, 0.2, periods=n) for n in (6, 3))
    second = simulate(system, 0.2, periods=3, start=first.end)
    assert first.end.size == 6
    np.testing.assert_allclose(second.end, whole.end, atol=1e-9)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: DryFriction("x", 1.0, 0.3, tangential_stiffness=0.0), "must be positive"),
        (lambda: DryFriction("x", 1.0, Friction(0.3, 0.4, 0.1), None, 5.0), "one coefficient"),
        (lambda: Stop("x", 1.0, tangential_stiffness=5.0), "needs both friction and tangent"),
        (
            lambda: Stop("x", 1.0, tangent="y", friction=0.3, tangential_stiffness=math.inf),
            "finite",
        ),
        (
            lambda: System.from_matrices(
                np.eye(2), np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 0.0]},
                dampers=[DryFriction("y", 1.0, 0.3, tangential_stiffness=5.0)],
            ),
            "none of the 2 modes moves there",
        ),
        (
            lambda: continue_branch(
                solve_orbit(block(2.0), HZ),
                (1.0, 2.0),
                parameter=Parameter("tangential_stiffness", 1),
            ),
            "there is no slider 1",
        ),
    ],
)  # fmt: skip
def test_bad_numbers_are_refused_in_a_sentence(make, told):
    with pytest.raises(SystemModelError, match=told):
        make()
