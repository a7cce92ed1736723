"""Constant forces, several harmonics, and motions of the base."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from independent import Motion, exact_flight
from scipy.integrate import solve_ivp

from nldyn import (
    BaseMotion,
    ConstantForce,
    ConvergenceError,
    FlowMap,
    FlowOptions,
    HarmonicForce,
    Orbit,
    Parameter,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    find_orbits,
    load,
    save,
    solve_orbit,
)
from nldyn.base.resources import example
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene
from nldyn.system.equilibrium import closed_at_rest, rest

HZ = 3.0
OMEGA = 2 * np.pi * HZ
EXACT = FlowOptions(rtol=1e-13)
SOURCES = (
    HarmonicForce("a", 2.0, 20.0),
    ConstantForce("a", 3.0),
    ConstantForce("weight", -9.81),
    Unbalance("b", 2e-3, 70.0, 2),
    HarmonicForce("b", 1.5, -40.0, 5),
    BaseMotion("weight", 1e-3, "displacement", 10.0),
    BaseMotion("weight", 2e-3, "velocity", 0.0, 3),
    BaseMotion("weight", 0.1, "acceleration", 35.0, 2),
)
# modes in Hz: free, so slow that it counts as free beside the excitation, at the excitation's own
# frequency, at its third harmonic, any
STOPS = (
    Stop("a", 4e3, gap=2e-3),
    Stop("b", 900.0, 1.0, gap=-1e-3, direction=-1),
    Stop("a", 600.0, 1.0, gap=3e-3, direction=-1),
    Stop("b", 2e3, gap=4e-3),
)
KINDS = {
    "free": ([0.0, 7.7], 0.0),
    "free and damped": ([0.0, 7.7], 0.3),
    "slow": ([1e-4, 5e-3, 7.7], 0.0),
    "slow and damped": ([1e-4, 5e-3, 7.7], 2e-4),
    "held": ([1.1, 7.7, 31.0], 0.5),
    "at resonance": ([HZ, 3 * HZ * (1 + 1e-9), 31.0], 0.0),
}


def make(kind: str, **changes) -> System:
    hz, damping = KINDS[kind]
    shapes = np.random.default_rng(5).normal(size=(3, len(hz)))
    system = System.from_modal(
        hz,
        {"a": shapes[0], "b": shapes[1]},
        loads={"weight": shapes[2]},
        excitation=changes.get("excitation", SOURCES),
        stops=changes.get("stops", ()),
    )
    return replace(system, damping=damping * np.eye(system.size))


def start_of(system: System) -> np.ndarray:
    q = 1e-2 * np.random.default_rng(6).normal(size=2 * system.size)
    q[system.size :] *= 30.0
    return q


@pytest.mark.parametrize("kind", KINDS)
def test_flights_are_those_of_one_matrix_exponential(kind):
    system = make(kind)
    flow, x0 = FlowMap(system), start_of(system)
    for phases in ((0.0, 2 * np.pi), (1.3, 4.0)):
        found = flow.shoot(flow.to_state(x0)[None], np.array(phases), OMEGA)
        end, jacobian = exact_flight(system, x0, phases, OMEGA)
        to_state = system.linear.left
        size = np.abs(end).max()
        assert flow.to_modal(found.ends[0]) == pytest.approx(end, rel=1e-11, abs=1e-12 * size)
        exact = to_state @ jacobian @ np.linalg.inv(to_state)
        assert found.jacobians[0] == pytest.approx(exact, abs=1e-11 * np.abs(exact).max())


@pytest.mark.parametrize("kind", KINDS)
def test_contacts_are_those_of_a_runge_kutta_method(kind):
    system = make(kind, stops=STOPS)
    flow, x0 = FlowMap(system, EXACT), start_of(system)
    found = flow.shoot(flow.to_state(x0)[None], np.array([0.4, 0.4 + 2 * np.pi]), OMEGA)
    end, *_ = Motion(system).run(x0, (0.4, 0.4 + 2 * np.pi), OMEGA, tangent=False, max_step=0.01)
    assert found.closings.sum() > 0
    assert flow.to_modal(found.ends[0]) == pytest.approx(end, abs=1e-9 * np.abs(end).max())


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_are_those_of_differences(kind):
    system = make(kind, stops=STOPS)
    start = FlowMap(system).to_state(start_of(system))[None]
    phases = np.array([0.4, 0.4 + 2 * np.pi])
    parameters = [
        Parameter("force", 1), Parameter("force", 2), Parameter("mass_times_radius", 3),
        Parameter("amplitude", 6), Parameter("gap", 1),
    ]  # fmt: skip

    def end(system: System, omega: float = OMEGA) -> np.ndarray:
        return FlowMap(system, EXACT).shoot(start, phases, omega, sensitivities=False).ends[0]

    def other(parameter: Parameter, change: float) -> System:
        if parameter.name == "gap":
            stop = replace(system.stops[1], gap=system.stops[1].gap + change)
            return system.with_elements(stops=(system.stops[0], stop, *system.stops[2:]))
        sources = list(system.excitation)
        old = sources[parameter.index]
        sources[parameter.index] = replace(
            old, **{parameter.name: getattr(old, parameter.name) + change}
        )
        return system.with_elements(excitation=tuple(sources))

    found = FlowMap(system, EXACT).shoot(start, phases, OMEGA, parameters=parameters)
    steps = {"force": 1e-4, "mass_times_radius": 1e-7, "amplitude": 1e-7, "gap": 1e-8}
    for column, parameter in enumerate(parameters):
        h = steps[parameter.name]
        difference = (end(other(parameter, h)) - end(other(parameter, -h))) / (2 * h)
        exact = found.d_parameters[0][:, column]
        assert exact == pytest.approx(difference, abs=3e-6 * np.abs(difference).max()), parameter
    h = 1e-6 * OMEGA
    difference = (end(system, OMEGA + h) - end(system, OMEGA - h)) / (2 * h)
    assert found.d_omega[0] == pytest.approx(difference, abs=3e-6 * np.abs(difference).max())


def test_extremes_and_states_between_are_those_of_the_motion():
    """A body that falls and is thrown: y = v t - g t²/2, with its top at v²/2g."""
    system = System.from_matrices(
        [[2.0]], [[0.0]], {"y": [1.0]}, loads={"weight": [2.0]},
        excitation=[ConstantForce("weight", -9.81)],
    )  # fmt: skip
    flow = FlowMap(system)
    motion = flow.trajectory(flow.to_state(np.array([0.0, 1.0]))[None], np.array([0.0, 6.0]), OMEGA)
    t = np.linspace(0.0, 6.0, 7) / OMEGA
    y = flow.to_modal(motion.states(t * OMEGA)) @ np.array([1.0, 0.0]) / math.sqrt(2.0)
    fall = t / math.sqrt(2.0) - 0.5 * 9.81 * t**2
    assert y == pytest.approx(fall, rel=1e-13, abs=1e-16)
    top = motion.extremes(0)[0]
    v = 1.0 / math.sqrt(2.0)
    assert top[1] == pytest.approx(v * v / (2 * 9.81), rel=1e-12)
    assert top[0] == pytest.approx(OMEGA * v / 9.81, rel=1e-9)


def test_a_constant_force_on_a_held_structure_shifts_its_stops():
    """q = q₀ + y, with Ω² q₀ the force: y meets stops that are nearer by c q₀."""
    shapes = {"a": [1.0, 0.7], "b": [0.4, -1.1]}
    stops = [Stop("a", 1e6, gap=1e-3)]
    harmonic = HarmonicForce("b", 30.0, 15.0)
    loaded = System.from_modal(
        [9.0, 33.0], shapes, modal_damping=0.03, stops=stops,
        excitation=[harmonic, ConstantForce("b", 4.0)],
    )  # fmt: skip
    q0 = 4.0 * np.array(shapes["b"]) / (2 * np.pi * np.array([9.0, 33.0])) ** 2
    nearer = [replace(stops[0], gap=1e-3 - float(np.array(shapes["a"]) @ q0))]
    shifted = System.from_modal(
        [9.0, 33.0], shapes, modal_damping=0.03, stops=nearer, excitation=[harmonic]
    )
    one, other = solve_orbit(loaded, 8.0), solve_orbit(shifted, 8.0)
    assert one.impacts == other.impacts >= 1
    assert one.multipliers == pytest.approx(other.multipliers, rel=1e-8)
    moved = one.states(np.array([0.7]))[0] - other.states(np.array([0.7]))[0]
    assert moved == pytest.approx([*q0, 0.0, 0.0], abs=1e-9 * np.abs(q0).max())


@pytest.mark.parametrize("quantity", ["displacement", "velocity", "acceleration"])
def test_a_shaken_base_moves_the_body_as_the_closed_form_says(quantity):
    """|y/X| = r²/|1 - r² + 2iζr| for a base that moves by X cos ωt [Den Hartog 1956, 2.12]."""
    zeta, r, own = 0.05, 0.8, 2 * np.pi * 10.0
    system = System.from_matrices(
        [[3.0]], [[3.0 * own**2]], {"y": [1.0]}, modal_damping=zeta, loads={"base": [3.0]},
        excitation=[BaseMotion("base", 2e-3, quantity)],
    )  # fmt: skip
    power = {"displacement": 0, "velocity": 1, "acceleration": 2}[quantity]
    size = 2e-3 / (r * own) ** power
    expected = size * r * r / abs(1 - r * r + 2j * zeta * r)
    orbit = solve_orbit(system, 10.0 * r)
    assert orbit.max_abs_displacement == pytest.approx(expected, rel=1e-10)


def gear_pair() -> System:
    """x'' + 0.1 x' + g(x) = 0.1 + 0.05 ω² cos ωt, g the dead zone of ±1."""
    return System.from_matrices(
        [[1.0]], [[0.0]], {"x": [1.0]}, damping=[[0.1]],
        stops=[Stop.linear("x", 1.0, gap=1.0, direction=d) for d in (1, -1)],
        excitation=[Unbalance("x", 0.05), ConstantForce("x", 0.1)],
    )  # fmt: skip


def test_a_gear_pair_with_a_mean_load_folds_where_it_should():
    """At folds computed independently from the closed forms of the equation's linear pieces."""
    ends = (0.0477, 0.2387)
    harmonic = continue_branch(solve_orbit(gear_pair(), 0.2387), ends)
    (doubled, *_) = (continue_branch(o, ends) for o in find_orbits(gear_pair(), 0.23, 2))
    folds = [
        p.frequency_hz for b in (harmonic, doubled) for p in b.special_points if p.kind == "LP"
    ]
    assert sorted(folds) == pytest.approx([0.112687, 0.131854, 0.215853], abs=5e-7)
    for orbit in (*harmonic.points, *doubled.points):
        assert max(orbit.log_modulus_uncertainties) < 1e-5


def test_rest_under_a_constant_force():
    system = gear_pair()
    assert rest(system) == pytest.approx([1.1], rel=1e-12)
    ((number, depth, force),) = closed_at_rest(system, rest(system))
    assert (number, depth, force) == (0, pytest.approx(0.1), pytest.approx(0.1))
    hertz = System.from_modal(
        [0.0, 12.0], {"x": [0.5, 0.3]}, stops=[Stop("x", 1e7, gap=1e-3)],
        excitation=[ConstantForce("x", 5.0)],
    )  # fmt: skip
    q = rest(hertz)
    depth = hertz.participation["x"] @ q - 1e-3
    assert 1e7 * depth**1.5 == pytest.approx(5.0, rel=1e-10)
    assert q[1] == pytest.approx(0.0, abs=1e-12)  # the stop carries all of it


def test_what_nothing_holds_is_refused():
    away = System.from_matrices(
        [[1.0]], [[0.0]], {"x": [1.0]}, damping=[[0.1]],
        stops=[Stop.linear("x", 1.0, gap=1.0, direction=-1)],
        excitation=[HarmonicForce("x", 0.5), ConstantForce("x", 0.1)],
    )  # fmt: skip
    with pytest.raises((SystemModelError, ConvergenceError), match="nor a stop holds against it"):
        solve_orbit(away, 0.2)
    with pytest.raises(SystemModelError, match="hold the body by a spring or a stop"):
        solve_orbit(replace(away, stops=()), 0.2)


@pytest.mark.parametrize(
    ("make_source", "words"),
    [
        (lambda: ConstantForce("a", math.inf), "force must be a finite number"),
        (lambda: HarmonicForce("a", 1.0, 0.0, 0), "whole number from 1 to 1000.*half orders"),
        (lambda: HarmonicForce("a", 1.0, 0.0, 1.5), "whole number from 1 to 1000.*half orders"),
        (lambda: BaseMotion("a", 1.0, "speed"), "'displacement', 'velocity', 'acceleration'"),
    ],
)
def test_sources_that_make_no_sense(make_source, words):
    with pytest.raises(SystemModelError, match=words):
        make_source()


def test_a_base_does_not_move_by_the_vector_of_an_interface():
    with pytest.raises(SystemModelError, match=r"'y' is not a load vector M r.*there are: base"):
        System.from_matrices(
            [[3.0]], [[1.0]], {"y": [1.0]}, loads={"base": [3.0]}, excitation=[BaseMotion("y", 1.0)]
        )


def test_load_vectors_are_no_interfaces():
    with pytest.raises(SystemModelError, match="stop at unknown interface 'weight'"):
        make("held", stops=[Stop("weight", 1.0)])
    with pytest.raises(SystemModelError, match=r"unknown interface 'wind'.*load vectors: weight"):
        make("held", excitation=[ConstantForce("wind", 1.0)])
    with pytest.raises(SystemModelError, match="'a' names both"):
        System.from_modal([1.0], {"a": [1.0]}, loads={"a": [1.0]})


def test_a_branch_under_all_loads_comes_back_from_its_file(tmp_path):
    stops = [Stop("a", 4e3, gap=2e-3)]
    system = make("held", stops=stops)
    branch = continue_branch(solve_orbit(system, HZ), (2.9, 3.1))
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    found = again.points[0].problem.flow.system
    assert found.excitation == SOURCES
    assert np.array_equal(found.loads["weight"], system.loads["weight"])


def test_even_harmonics_break_the_symmetry_of_opposed_stops():
    stops = [Stop.linear("a", 10.0, gap=1e-3, direction=d) for d in (1, -1)]
    odd = [HarmonicForce("a", 1.0), HarmonicForce("a", 1.0, 0.0, 3)]
    assert make("held", stops=stops, excitation=odd).symmetric
    for source in (HarmonicForce("a", 1.0, 0.0, 2), ConstantForce("a", 1.0)):
        assert not make("held", stops=stops, excitation=[*odd, source]).symmetric


def test_opposed_stops_between_two_bodies_that_slide_are_symmetric():
    vectors = dict(zip("abcd", np.eye(4), strict=True))
    both = [
        Stop("a", 10.0, gap=1e-3, direction=d, against="b", tangent="c", friction=0.3,
             tangent_against="d")
        for d in (1, -1)
    ]  # fmt: skip
    for stops, same in ((both, True), (both[:1], False)):
        system = System.from_matrices(
            np.eye(4), np.eye(4), vectors, stops=stops, excitation=[HarmonicForce("a", 1.0)]
        )
        assert system.symmetric is same


@pytest.mark.parametrize(
    ("name", "hz"),
    [
        ("gear_pair.toml", 0.12),
        ("ship_between_fenders.toml", 0.5),
        ("bumper.toml", 6.0),
        ("tube_between_baffles.toml", 30.0),
    ],
)
def test_an_example_under_loads_is_periodic_by_a_runge_kutta_method(name, hz):
    """From the orbit's state one period by small steps leads back to it."""
    system = build_system(load_scene(example(name)))
    orbit = solve_orbit(system, hz)
    assert orbit.max_penetration > 0.0
    start = orbit.states(np.zeros(1))[0]
    end, *_ = Motion(system).run(
        start, (0.0, 2 * np.pi), 2 * np.pi * hz, tangent=False, max_step=2e-3
    )
    sizes = np.abs(orbit.states(np.linspace(0.0, 2 * np.pi, 50))).max(axis=0)
    assert (np.abs(end - start)[: system.size] < 3e-6 * sizes[: system.size].max()).all()


def test_the_instrument_touches_its_bumper_where_the_closed_form_says():
    """a/|k/m - ω² + iωc/m| = gap: a quadratic in ω²."""
    a, k, c, gap = 1.5, 3200.0 / 2.0, 4.0 / 2.0, 2e-3
    half = k - 0.5 * c**2
    square = half - math.sqrt(half**2 - k**2 + (a / gap) ** 2)
    exact = math.sqrt(square) / (2 * math.pi)
    system = build_system(load_scene(example("bumper.toml")))
    branch = continue_branch(solve_orbit(system, 4.5), (4.5, 4.7))
    (touch,) = (p.frequency_hz for p in branch.special_points if p.kind == "GR")
    assert touch == pytest.approx(exact, rel=1e-9)
    assert exact == pytest.approx(4.646333, abs=5e-7)


def test_a_stop_out_of_reach_gives_no_rest_position():
    """0.1 N against 1 N/m beyond 10⁹ m: x = 10⁹ + 0.1 m is not computed, 10⁸ + 0.1 m is."""
    free = System.from_modal([0.0], {"x": [1.0]}, excitation=[ConstantForce("x", 0.1)])
    near, far = (free.with_elements(stops=[Stop.linear("x", 1.0, gap=gap)]) for gap in (1e8, 1e9))
    assert rest(near) == pytest.approx([1e8 + 0.1], rel=1e-14)
    with pytest.raises(SystemModelError, match="rests farther away than 1e\\+09 m √kg"):
        rest(far)


def test_a_tube_lies_in_its_baffle_with_the_force_of_beam_theory():
    """Three supports, the middle one a spring of 1e6 N/m that is 0.3 mm lower."""
    system = build_system(load_scene(example("tube_between_baffles.toml")))
    area = np.pi / 4 * (0.025**2 - 0.021**2)
    bending = 2.1e11 * np.pi / 64 * (0.025**4 - 0.021**4)
    sag = 5 * 7850.0 * area * 9.81 * 1.8**4 / (384 * bending)
    reaction = (sag - 3e-4) / (1.8**3 / (48 * bending) + 1e-6)
    ((number, _, force),) = closed_at_rest(system, rest(system))
    assert (number, force) == (1, pytest.approx(reaction, rel=1e-9))


M, C = np.diag([2.0, 1.0]), np.diag([1.0, 0.6])
K, R = np.array([[900.0, -400.0], [-400.0, 600.0]]), np.array([1.0, 0.0])
SHAKE, GAP = 2e-3, 1e-3


def shaken(stop: Stop | RigidStop) -> System:
    """The documented system, whose stop moves while its supports stand."""
    return System.from_matrices(
        M, K, {"x1": [1.0, 0.0], "x2": [0.0, 1.0]}, damping=C, stops=[stop],
        loads={"M r": M @ R, "C r": C @ R, "K r": K @ R},
        excitation=[
            BaseMotion("M r", SHAKE), BaseMotion("C r", SHAKE, "velocity"),
            HarmonicForce("K r", SHAKE, 180.0),
        ],
    ).with_absolute("x1", {"M r": 1.0})  # fmt: skip


def in_the_ground(orbit: Orbit, phase: float) -> np.ndarray:
    """Displacements and velocities (4,) beside the ground, where the stop moves."""
    state, turn = orbit.states(np.array([phase])), np.array([phase])
    pairs = [orbit.system.displacement(n, state, turn, orbit.omega) for n in ("x1 absolute", "x2")]
    return np.array(pairs)[:, :, 0].T.ravel()


def test_a_stop_that_moves_is_three_loads():
    """In the coordinates of the ground, by scipy."""
    k, hz = 2e4, 3.2
    orbit = solve_orbit(shaken(Stop.linear("x1", k, gap=GAP)), hz)

    def rates(t, x):
        depth = x[0] - SHAKE * np.cos(orbit.omega * t) - GAP
        push = np.array([k * max(depth, 0.0), 0.0])
        return np.append(x[2:], np.linalg.solve(M, -C @ x[2:] - K @ x[:2] - push))

    assert orbit.max_penetration > 1e-4
    start = in_the_ground(orbit, 0.0)
    for share, phase in ((0.4, 0.8 * np.pi), (1.0, 0.0)):
        end = solve_ivp(rates, (0.0, share / hz), start, rtol=1e-11, atol=1e-13, max_step=1e-3)
        expected = in_the_ground(orbit, phase)
        assert end.y[:, -1] == pytest.approx(expected, abs=1e-8 * np.abs(start).max())


def test_a_rigid_stop_that_moves_is_three_loads():
    """In the coordinates of the ground: the mass leaves the stop e times as fast as it came."""
    hz, e = 2.8, 0.6
    orbit = solve_orbit(shaken(RigidStop("x1", e, gap=GAP)), hz)
    omega = orbit.omega

    def rates(t, x):
        return np.append(x[2:], np.linalg.solve(M, -C @ x[2:] - K @ x[:2]))

    def way(t, x):
        return GAP + SHAKE * np.cos(omega * t) - x[0]

    way.terminal, way.direction = True, -1
    t, x, hits = 0.0, in_the_ground(orbit, 0.0), 0
    while t < 1.0 / hz:
        found = solve_ivp(rates, (t, 1.0 / hz), x, events=way, rtol=1e-11, atol=1e-13)
        t, x = found.t[-1], found.y[:, -1]
        if found.status == 1:
            stop = -omega * SHAKE * np.sin(omega * t)
            x[2] = stop - e * (x[2] - stop)
            hits += 1
    assert hits == orbit.impacts == 1
    assert x == pytest.approx(in_the_ground(orbit, 0.0), abs=1e-8 * np.abs(x).max())
