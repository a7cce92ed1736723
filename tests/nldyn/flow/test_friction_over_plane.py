"""Friction over a plane against closed forms, differences and an independent integration."""

import math

import numpy as np
import pytest
from plane_sliding import Body, Disc
from sliding import monodromy, off_differences

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
    solve_orbit,
)
from nldyn.system import DryFriction, Friction
from nldyn.system.chart import value_of, with_value


def drawn(seed, kinds):
    """A random structure with friction of the kinds given, the same for both ways."""
    rng = np.random.default_rng(seed)
    n = 3
    A = rng.normal(size=(n, n))
    M, K = np.diag(rng.uniform(0.5, 2.0, n)), A @ A.T + np.eye(n)
    C, names, unit = 0.05 * K + 0.02 * M, [f"x{i}" for i in range(n)], np.eye(n)
    omega, forces, turns = rng.uniform(0.5, 2.0), 3.0 * rng.random(n), rng.uniform(0.0, 360.0, n)
    discs, stops, dampers = [], [], []
    for kind in kinds:  # stops first
        a, b, c = rng.permutation(n)
        spring, mu = float(10.0 ** rng.uniform(0.0, 2.0)), float(rng.uniform(0.05, 0.8))
        belt = float(rng.choice([0.0, 0.3]))
        law = Friction(mu, base_speed=(belt, -0.5 * belt))
        if kind == "constant":
            force = float(rng.uniform(0.3, 2.0))
            discs.append(Disc(unit[[b, c]], mu, spring, force, base_speed=law.base_speeds))
            dampers.append(
                DryFriction(names[b], force, law, None, spring, second_tangent=names[c])
            )  # fmt: skip
            continue
        sign, p = int(rng.choice([1, -1])), float(rng.choice([1.0, 1.5]))
        k, gap = float(rng.uniform(20.0, 200.0)), float(rng.uniform(-0.1, 0.5))
        discs.append(
            Disc(unit[[b, c]], mu, spring, 0.0, sign * unit[a], k, p, gap, law.base_speeds)
        )  # fmt: skip
        stops.append(
            Stop(names[a], k, p, gap, sign, friction=law, tangent=names[b],
                 tangential_stiffness=spring, second_tangent=names[c])
        )  # fmt: skip
    turn = np.radians(turns)
    body = Body(M, C, K, lambda t: forces * np.cos(omega * t + turn), discs)
    system = System.from_matrices(
        M, K, dict(zip(names, unit, strict=True)), damping=C, stops=stops, dampers=dampers,
        excitation=[HarmonicForce(*row) for row in zip(names, forces, turns, strict=True)],
    )  # fmt: skip
    start = 0.7 * rng.normal(size=2 * n)
    places = [disc.tangents @ start[:n] for disc in discs]
    return system, body, omega, np.concatenate([start, *places]), float(rng.uniform(1.0, 3.0))


def bases(system):
    return np.array([system.participation[name] for name in system.interfaces])


def to_state(flow, y):
    """Of displacements, velocities, and the places of each slider along both tangents."""
    n, rows = flow.system.size, bases(flow.system)
    modal = [np.linalg.solve(rows, y[:n]), np.linalg.solve(rows, y[n : 2 * n])]
    return flow.to_state(np.concatenate([*modal, *y[2 * n :].reshape(-1, 2).T]))


def from_state(flow, z):
    n, rows, modal = flow.system.size, bases(flow.system), flow.to_start(z)
    places = modal[2 * n :].reshape(2, -1).T.ravel()
    return np.concatenate([rows @ modal[:n], rows @ modal[n : 2 * n], places])


def agrees(seed, kinds):
    system, body, omega, start, turns = drawn(seed, kinds)
    phases, flow = np.array([0.0, 2.0 * math.pi * turns]), FlowMap(system)
    expected = body.followed(start, phases[1] / omega, 0.2 / omega)
    z = to_state(flow, start)[None]
    found = flow.shoot(z, phases, omega)
    assert found.failure == ""
    np.testing.assert_allclose(
        from_state(flow, found.ends[0]), expected, atol=1e-8 * np.abs(expected).max()
    )
    steps = (1e-4, 1e-5, 1e-6)  # the state is good to 1e-10, the differences to that over a step
    assert min(off_differences(flow, found, z, phases, omega, step) for step in steps) < 1e-5
    return set(body.events_met)


@pytest.mark.parametrize(
    ("kinds", "seed", "met"),
    [
        (["constant"], 3, {"slip", "stick"}),
        (["stop"], 10, {"open", "close", "slip"}),
        (["stop"], 6, {"open", "slip"}),
    ],
)
def test_random_systems_agree_with_integration_from_event_to_event(kinds, seed, met):
    assert agrees(seed, kinds) >= met


@pytest.mark.slow
@pytest.mark.parametrize("kinds", [["constant"], ["stop"]])
@pytest.mark.parametrize("seed", [0, 1, 2, 4, 5, 7, 8, 11])
def test_more_random_systems_agree(seed, kinds):
    agrees(seed, kinds)


def table(spring=20.0, friction=0.3, size=1.0, turn=90.0, damper=None):
    """Mass 1 on springs 1 to both sides of a plane, on which 2 N press it."""
    rub = damper or DryFriction("x", 2.0, friction, None, spring, second_tangent="y")
    return System.from_matrices(
        np.eye(2), np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=0.05 * np.eye(2),
        dampers=[rub],
        excitation=[HarmonicForce("x", 1.0), HarmonicForce("y", size, turn)],
    )  # fmt: skip


OMEGA = 0.8
HZ = OMEGA / (2.0 * math.pi)


def test_a_slider_led_around_a_circle_loses_what_the_closed_form_says():
    """A steady force μN turns with the motion, at an angle whose sine is the slider's way over it.

    Its place goes around a circle of sqrt(X² - (μN/k)²), and so 2π μN sqrt(X² - (μN/k)²) is lost.
    """
    orbit = solve_orbit(table(), HZ)
    (found,) = orbit.friction
    x = orbit.states(np.linspace(0.0, 2.0 * math.pi, 9))[:, :2]
    size = np.hypot(x[:, 0], x[:, 1])
    np.testing.assert_allclose(size, size[0], rtol=1e-10)
    way = 2.0 * math.pi * math.sqrt(size[0] ** 2 - (0.6 / 20.0) ** 2)
    assert found.loss == pytest.approx(0.6 * way, rel=1e-9)
    assert found.distance == pytest.approx(way, rel=1e-9)
    assert found.pressed_distance == pytest.approx(2.0 * way, rel=1e-9)
    assert found.peak_force == pytest.approx(0.6, rel=1e-9)
    assert (found.stuck, found.slid, found.open) == (0.0, pytest.approx(1.0), pytest.approx(0.0))
    # X itself: (1 - ω² + 0.05iω) X + μN (cos a + i sin a) = 1, with cos a = μN/(k X)
    lag = math.acos(0.6 / 20.0 / size[0])
    pull = 0.6 * complex(math.cos(lag), math.sin(lag))
    assert abs((1.0 - OMEGA**2 + 0.05j * OMEGA) * size[0] + pull) == pytest.approx(1.0, rel=1e-9)


def test_along_one_tangent_it_is_friction_along_a_line():
    one = table(damper=DryFriction("x", 2.0, 0.3, None, 20.0))
    start, phases = np.array([0.3, 0.0, -0.2, 0.0]), np.array([0.0, 17.0])
    still = {"excitation": [HarmonicForce("x", 1.0)]}
    line, plane = (FlowMap(each.with_elements(**still)) for each in (one, table()))
    expected = line.shoot(line.to_state(np.append(start, 0.3))[None], phases, OMEGA)
    found = plane.shoot(plane.to_state(np.append(start, [0.3, 0.0]))[None], phases, OMEGA)
    np.testing.assert_allclose(found.ends[0, :6], expected.ends[0], atol=1e-12)
    along = np.ix_([0, 1, 4, 5], [0, 1, 4, 5])  # across the line friction acts in one of both
    np.testing.assert_allclose(found.jacobians[0][along], expected.jacobians[0][along], atol=1e-10)


def test_tangents_may_be_turned_in_their_plane():
    a = 0.7
    turn = np.array([[math.cos(a), math.sin(a)], [-math.sin(a), math.cos(a)]])
    names = {"x": [1.0, 0.0], "y": [0.0, 1.0], "u": turn[0], "v": turn[1]}
    ends = []
    for first, second in (("x", "y"), ("u", "v")):
        system = System.from_matrices(
            np.eye(2), np.diag([1.0, 1.7]), names, damping=0.05 * np.eye(2),
            dampers=[DryFriction(first, 2.0, 0.3, None, 20.0, second_tangent=second)],
            excitation=[HarmonicForce("x", 1.0), HarmonicForce("y", 0.7, 40.0)],
        )  # fmt: skip
        flow = FlowMap(system)
        start = flow.to_state(np.array([0.1, 0.2, 0.3, -0.2]))[None]
        ends.append(flow.to_modal(flow.shoot(start, np.array([0.0, 17.0]), OMEGA).ends[0]))
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-11)


def rubbing(gap=0.3, friction=0.3, beside=True):
    """Pressed on where a spring stops it, over the plane of both other directions."""
    rub = DryFriction("y", 0.5, 0.6, None, 3.0, second_tangent="z")
    return System.from_matrices(
        np.diag([1.0, 2.0, 1.5]), [[3.0, -1.0, 0.0], [-1.0, 3.0, 0.5], [0.0, 0.5, 2.0]],
        {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]},
        modal_damping=0.03,
        stops=[
            Stop("x", 60.0, 1.0, gap, friction=friction, tangent="y", tangential_stiffness=5.0,
                 second_tangent="z")
        ],
        dampers=[rub] if beside else [],
        excitation=[
            HarmonicForce("x", 2.0), HarmonicForce("y", 1.0), HarmonicForce("z", 1.0, 60.0)
        ],
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
    system, parameter = rubbing(), Parameter(name, index)
    phases, omega, flow = np.array([0.0, 7.0]), 1.3, FlowMap(system)
    start = flow.to_state(np.array([0.1, 0.3, 0.1, -0.2, 0.1, 0.3]))[None]
    exact = flow.shoot(start, phases, omega, parameters=[parameter]).d_parameters[0, :, 0]
    value = value_of(system, 1.0, parameter)
    ends = [
        FlowMap(with_value(system, parameter, value * (1.0 + way))).shoot(start, phases, omega).ends
        for way in (1e-6, -1e-6)
    ]
    slope = (ends[0] - ends[1])[0] / (2e-6 * value)
    np.testing.assert_allclose(exact, slope, atol=1e-6 * np.abs(exact).max())


def test_orbits_multipliers_and_balances():
    """The multipliers are those of the monodromy matrix by differences."""
    orbit = solve_orbit(table(size=0.7, turn=40.0), HZ)
    largest = np.sort(np.abs(np.linalg.eigvals(monodromy(orbit))))[::-1]
    np.testing.assert_allclose(np.abs(orbit.multipliers)[:4], largest[:4], atol=1e-6)
    # what the forces give is what friction and the dashpots take
    phases = np.linspace(0.0, 2.0 * math.pi, 4001)
    speed = orbit.states(phases)[:, 2:] @ bases(orbit.system).T
    drive = np.array([np.cos(phases), 0.7 * np.cos(phases + math.radians(40.0))]).T
    power = ((drive - 0.05 * speed) * speed).sum(axis=1)
    (found,) = orbit.friction
    assert np.trapezoid(power, phases) / OMEGA == pytest.approx(found.loss, rel=1e-6)


def test_a_branch_in_the_stiffness_is_kept_in_files(tmp_path):
    orbit = solve_orbit(table(size=0.7, turn=40.0), HZ)
    branch = continue_branch(orbit, (15.0, 25.0), parameter=Parameter("tangential_stiffness", 0))
    assert branch.points[-1].system.sliders[0].tangential_stiffness in (15.0, 25.0)
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert again.points[-1].system.dampers == branch.points[-1].system.dampers
    np.testing.assert_array_equal(again.points[-1].multipliers, branch.points[-1].multipliers)


def pressed_by_a_stop(friction=0.3):
    return rubbing(0.1, friction, beside=False)


def test_orbits_at_a_stop_their_multipliers_and_balances():
    """What the forces give is lost in the modes and at the stop; wear follows from that."""
    orbit = solve_orbit(pressed_by_a_stop(), 0.3)
    (found,) = orbit.friction
    assert min(found.open, found.slid, found.stuck) > 0.01
    largest = np.sort(np.abs(np.linalg.eigvals(monodromy(orbit))))[::-1]
    np.testing.assert_allclose(np.abs(orbit.multipliers)[:6], largest[:6], atol=1e-6)
    phases = np.linspace(0.0, 2.0 * math.pi, 40001)
    states, system = orbit.states(phases), orbit.system
    speed = states[:, 3:] @ bases(system).T
    drive = np.array(
        [2.0 * np.cos(phases), np.cos(phases), np.cos(phases + math.radians(60.0))]
    ).T  # fmt: skip
    lost = (states[:, 3:] @ system.damping * states[:, 3:]).sum(axis=1)
    given = np.trapezoid((drive * speed).sum(axis=1) - lost, phases) / orbit.omega
    assert given == pytest.approx(found.loss, rel=1e-6)
    assert found.pressed_distance == pytest.approx(found.loss / 0.3, rel=1e-9)


def test_a_branch_in_the_friction_at_a_stop_ends_at_orbits_of_their_own_and_is_kept(tmp_path):
    orbit = solve_orbit(pressed_by_a_stop(), 0.3)
    branch = continue_branch(orbit, (0.2, 0.4), parameter=Parameter("friction", 0))
    end = branch.points[-1]
    value = end.system.sliders[0].friction.coefficient
    alone = solve_orbit(pressed_by_a_stop(value), 0.3)
    assert value in (0.2, 0.4)
    assert end.max_abs_displacement == pytest.approx(alone.max_abs_displacement, rel=1e-8)
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert again.points[-1].system.stops == end.system.stops
    np.testing.assert_array_equal(again.points[-1].multipliers, end.multipliers)


def test_friction_of_zero_over_a_plane_changes_nothing():
    phases, start = np.array([0.0, 9.0]), np.array([0.3, -0.2, 0.1, 0.4])
    plain = System.from_matrices(
        np.eye(2), np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=0.05 * np.eye(2),
        excitation=[HarmonicForce("x", 1.0), HarmonicForce("y", 1.0, 90.0)],
    )  # fmt: skip
    expected = FlowMap(plain).shoot(start[None], phases, OMEGA)
    flow = FlowMap(table(friction=0.0))
    found = flow.shoot(np.append(start, np.zeros(4))[None], phases, OMEGA)
    np.testing.assert_allclose(found.ends[0, :4], expected.ends[0], atol=1e-12)
    np.testing.assert_allclose(found.jacobians[0, :4, :4], expected.jacobians[0], atol=1e-12)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: DryFriction("x", 1.0, 0.3, None, 5.0, "x"), "another interface"),
        (lambda: DryFriction("x", 1.0, 0.3, None, 5.0, None, "y"), "needs a second_tangent"),
        (lambda: Stop("x", 1.0, second_tangent="z"), "needs both friction and tangent"),
        (
            lambda: Stop("x", 1.0, tangent="y", friction=0.3, tangential_stiffness=5.0,
                         second_tangent="x"),
            "another interface",
        ),
        (lambda: table(damper=DryFriction("x", 1.0, 0.3, None, 5.0, "w")), "unknown interface 'w'"),
        (
            lambda: DryFriction("x", 1.0, Friction(0.3, base_speed=(0.1, 0.2)), None, 5.0),
            "base_speed of two needs a second_tangent",
        ),
        (
            lambda: RigidStop("x", 0.5, tangent="y", friction=Friction(0.3, base_speed=(0.1, 0.2))),
            "base_speed of two needs a second_tangent",
        ),
        (lambda: Friction(0.3, base_speed=(0.1, 0.2, 0.3)), "along each of two tangents, got 3"),
        (
            lambda: System.from_modal(
                [1.0, 2.0], {"x": [1.0, 0.5], "y": [-2.0, -1.0]},
                dampers=[DryFriction("x", 1.0, 0.3, None, 5.0, "y")],
            ),
            "acts over no plane with 'y': in the 2 modes both tangents are one motion",
        ),
    ],
)  # fmt: skip
def test_bad_numbers_are_refused_in_a_sentence(make, told):
    with pytest.raises(SystemModelError, match=told):
        make()
