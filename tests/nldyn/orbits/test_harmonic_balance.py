"""Orbits with friction are what harmonic balance tends to with its harmonics."""

import math

import numpy as np
import pytest
from harmonic_balance import HarmonicBalance, jenkins

from nldyn import HarmonicForce, PolynomialSpring, Stop, System, solve_orbit
from nldyn.system import DryFriction

NAMES = ("x1", "x2", "x3")
MASS, STIFFNESS = np.eye(3), 2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)
PULL = np.array([0.0, 1.0, 0.0])


def chain():
    """Example 07 of NLvib 1.3 (M. Krack and J. Gross 2019, Harmonic Balance for Nonlinear Vibration
    Problems, Springer): two Jenkins elements, two cubic springs and a one-sided spring."""
    before = {"tangential_stiffness": 20.0}
    return System.from_matrices(
        MASS, STIFFNESS, dict(zip(NAMES, np.eye(3), strict=True)), damping=0.02 * STIFFNESS,
        dampers=[
            DryFriction("x1", 1.0, 1.0, **before),
            DryFriction("x2", 1.0, 1.0, against="x1", **before),
        ],
        springs=[
            PolynomialSpring("x2", (0.0, 0.0, 1.0)),
            PolynomialSpring("x3", (0.0, 0.0, 1.0), against="x2"),
        ],
        stops=[Stop.linear("x3", 1.0, gap=0.25)],
        excitation=[HarmonicForce("x2", 1.0)],
    )  # fmt: skip


def forces(moved):
    """Those of its five elements, at displacements (steps, 3, k)."""
    first, second, third = moved.swapaxes(0, 1)
    ground, between = jenkins(first, 20.0, 1.0), jenkins(second - first, 20.0, 1.0)
    cubic, joint = second**3, (third - second) ** 3
    stop = np.maximum(third - 0.25, 0.0)
    return np.stack([ground - between, between + cubic - joint, joint + stop], axis=1)


def series(phases, harmonics):
    """Waves (k, 2 harmonics + 1) at phases: the constant, cosines and sines."""
    turn = np.outer(phases, np.arange(1, harmonics + 1))
    return np.hstack([np.ones((len(phases), 1)), np.cos(turn), np.sin(turn)])


def off_balance(balance, orbit):
    """Coefficients by harmonic balance, and how far its motion is off an orbit, of its size."""
    phases = math.tau * np.arange(4096) / 4096
    history = orbit.history_at(phases)
    moved = np.column_stack([history.displacement[name] for name in orbit.system.interfaces])
    waves = series(phases, balance.harmonics)
    found = balance.solved(orbit.omega, np.linalg.lstsq(waves, moved, rcond=None)[0])
    return found, np.abs(waves @ found - moved).max() / np.abs(moved).max()


@pytest.mark.parametrize("omega", [1.2, 1.8])
def test_nlvibs_chain_with_jenkins_elements_tends_to_the_orbit_with_the_harmonics(omega):
    """Both sliders stick and slide. NLvib keeps 7 harmonics of 1024 instants."""
    orbit, matrices = solve_orbit(chain(), omega / math.tau), (MASS, 0.02 * STIFFNESS, STIFFNESS)
    assert all(0.2 < slider.stuck < 0.9 for slider in orbit.friction)
    off = [
        off_balance(HarmonicBalance(matrices, forces, PULL, harmonics, steps), orbit)[1]
        for harmonics, steps in ((7, 1024), (15, 2048), (31, 4096))
    ]
    assert off[0] < 0.01
    assert off[1] < off[0] / 8.0
    assert off[2] < off[1] / 8.0
    assert off[2] < 5e-5


def test_what_pyharm_finds_with_a_jenkins_element_tends_to_the_orbit():
    """The element of its case "jenkins" (µ 1, N 5, k 200; 7 harmonics of 1024 instants) at a small
    mass on a larger one: norms of the coefficients that pyharm-os 1.2.2 gives at this frequency."""
    mass, stiffness = np.diag([1.0, 0.5]), np.array([[840.0, -200.0], [-200.0, 200.0]])
    system = System.from_matrices(
        mass, stiffness, {"x1": [1.0, 0.0], "x2": [0.0, 1.0]}, damping=1e-3 * stiffness,
        dampers=[DryFriction("x2", 5.0, 1.0, tangential_stiffness=200.0)],
        excitation=[HarmonicForce("x1", 10.0)],
    )  # fmt: skip

    def rubbing(moved):
        held = jenkins(moved[:, 1], 200.0, 5.0)
        return np.stack([np.zeros_like(held), held], axis=1)

    orbit = solve_orbit(system, 31.35307642419477 / math.tau)
    matrices, pull = (mass, 1e-3 * stiffness, stiffness), np.array([10.0, 0.0])
    few, off = off_balance(HarmonicBalance(matrices, rubbing, pull, 7, 1024), orbit)
    known = [0.158078706829, 0.119073325512]
    assert np.linalg.norm(few, axis=0) == pytest.approx(known, rel=1e-9)
    assert off < 1e-4
    many = HarmonicBalance(matrices, rubbing, pull, 31, 4096)
    assert off_balance(many, orbit)[1] < 1e-6
    assert 0.2 < orbit.friction[0].stuck < 0.4
