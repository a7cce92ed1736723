"""Simulations under forces of two frequencies."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from nldyn import (
    ConstantForce,
    HarmonicForce,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    basins,
    classify_attractor,
    diagram,
    find_orbits,
    impacts,
    lyapunov_exponents,
    simulate,
    solve_orbit,
    sweep,
)
from nldyn.longterm.basins import StatePlane
from nldyn.scene.build import build_system
from nldyn.scene.read import parse_scene

M, C, K = (
    np.array(rows)
    for rows in (
        [[2.0, 0.0], [0.0, 1.0]],
        [[0.8, -0.3], [-0.3, 0.9]],
        [[800.0, -300.0], [-300.0, 500.0]],
    )
)
HZ, OTHER = 3.0, 2.1 * np.sqrt(2.0)
FIRST = HarmonicForce("a", 2.0, 20.0)
PLACES = {"a": [1.0, 0.0], "b": [0.0, 1.0]}


def make(*sources, stops=()) -> System:
    return System.from_matrices(M, K, PLACES, damping=C, excitation=sources, stops=stops)


def steady(t, *forces) -> np.ndarray:
    """Displacements of a and b, then velocities, (4, k), as a sum of steady states."""
    found = np.zeros((4, t.size))
    for hz, force in forces:
        w = 2j * np.pi * hz
        z = np.linalg.solve(K + w * C + w * w * M, force)[:, None] * np.exp(w * t)
        found += np.vstack([z, w * z]).real
    return found


def physical(system: System) -> np.ndarray:
    """Matrix from modal states to displacements and velocities of a and b."""
    shapes = np.array([system.participation[name] for name in PLACES])
    return np.kron(np.eye(2), shapes)


def test_a_linear_motion_is_the_sum_of_two_steady_states():
    system = make(FIRST, HarmonicForce("b", 1.5, -40.0, frequency_hz=OTHER))
    turned = np.exp(1j * np.radians([20.0, -40.0]))
    forces = (HZ, 2.0 * turned[0] * np.eye(2)[0]), (OTHER, 1.5 * turned[1] * np.eye(2)[1])
    to_ab = physical(system)
    start = np.linalg.solve(to_ab, steady(np.zeros(1), *forces)[:, 0])
    motion = simulate(system, HZ, 40, start=start, transient=31)
    t = np.sort(np.random.default_rng(1).uniform(motion.start_time, motion.end_time, 200))
    exact = steady(t, *forces)
    assert to_ab @ motion.states(t).T == pytest.approx(exact, abs=1e-12 * np.abs(exact).max())
    again = pickle.loads(pickle.dumps(motion))
    assert np.array_equal(again.states(t), motion.states(t))


@pytest.mark.parametrize("range_hz", [(3.0, 2.5), (2.0, 2.6)])
def test_a_second_frequency_does_not_follow_a_sweep(range_hz):
    system = make(HarmonicForce("b", 1.5, -40.0, frequency_hz=OTHER))
    force = OTHER, 1.5 * np.exp(-1j * np.radians(40.0)) * np.eye(2)[1]
    to_ab = physical(system)
    start = np.linalg.solve(to_ab, steady(np.zeros(1), force)[:, 0])
    motion = sweep(system, range_hz, 0.1, start=start)
    t = np.linspace(motion.start_time, motion.end_time, 201)
    exact = steady(t, force)
    assert to_ab @ motion.states(t).T == pytest.approx(exact, abs=1e-11 * np.abs(exact).max())


STOPS = (
    Stop.linear("a", 5e3, gap=4e-3, dashpot=3.0),
    Stop("b", 2e4, gap=5e-3, direction=-1),
    RigidStop("b", 0.7, gap=6e-3),
)
MEAN = ConstantForce("a", 0.7)


def test_motions_at_stops_are_those_of_two_orders_of_a_lower_frequency():
    """3 and 4.2 Hz are orders 5 and 7 of 0.6 Hz: the same motion by terms that are known."""
    two = make(FIRST, HarmonicForce("b", 1.5, -40.0, frequency_hz=4.2), MEAN, stops=STOPS)
    orders = HarmonicForce("a", 2.0, 20.0, 5), HarmonicForce("b", 1.5, -40.0, 7)
    one = make(*orders, MEAN, stops=STOPS)
    motion, same = simulate(two, 3.0, 50, transient=10), simulate(one, 0.6, 10, transient=2)
    t = np.linspace(motion.start_time, motion.end_time, 501)
    exact = same.states(t)
    assert motion.states(t) == pytest.approx(exact, abs=1e-10 * np.abs(exact).max())
    hits, known = impacts(motion), impacts(same)
    assert len(hits) == len(known) > 100
    assert hits.time == pytest.approx(known.time, abs=1e-10)
    assert hits.speed == pytest.approx(known.speed, rel=1e-8)
    found = lyapunov_exponents(two, 3.0, transient=50, periods=200)
    exact = lyapunov_exponents(one, 0.6, transient=10, periods=40)
    assert found.exponents == pytest.approx(exact.exponents, rel=1e-8)


def test_what_needs_a_period_refuses_in_one_sentence():
    system = make(FIRST, HarmonicForce("b", 1.5, frequency_hz=OTHER), stops=STOPS[:1])
    plane = StatePlane(np.zeros(4), np.eye(4)[0], np.eye(4)[2], (-1.0, 1.0), (-1.0, 1.0))
    for compute in (
        lambda: solve_orbit(system, 3.0),
        lambda: find_orbits(system, 3.0, 2),
        lambda: diagram(system, (2.0, 3.0)),
        lambda: classify_attractor(system, 3.0),
        lambda: basins(system, 3.0, plane),
    ):
        with pytest.raises(
            SystemModelError, match=r"at 'b' has a frequency of its own, 2.96985 Hz"
        ):
            compute()
    with pytest.raises(SystemModelError, match="either harmonic or frequency_hz"):
        HarmonicForce("b", 1.0, 0.0, 2, frequency_hz=3.0)


def test_a_scene_with_two_frequencies_can_be_simulated():
    scene = parse_scene(
        "[matrices]\nmass = [[1.0]]\nstiffness = [[100.0]]\ndamping = [[1.0]]\n"
        "interfaces.x = [1.0]\n"
        '[[excitation]]\nkind = "harmonic"\nat = "x"\namplitude = 1.0\n'
        '[[excitation]]\nkind = "harmonic"\nat = "x"\namplitude = 2.0\nphase_deg = 30.0\n'
        "frequency_hz = 1.7\n"
    )
    motion = simulate(build_system(scene), 1.0, 10, transient=60)
    t = np.linspace(motion.start_time, motion.end_time, 101)
    exact = np.zeros(101)
    for hz, force in ((1.0, 1.0), (1.7, 2.0 * np.exp(1j * np.pi / 6))):
        w = 2j * np.pi * hz
        exact += (force * np.exp(w * t) / (w * w + w + 100.0)).real
    assert motion.history(100).displacement["x"] == pytest.approx(exact, abs=1e-12)
