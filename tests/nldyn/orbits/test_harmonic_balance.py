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


@pytest.mark.parametrize("omega", [1.2, 1.8])
def test_nlvibs_chain_with_jenkins_elements_tends_to_the_orbit_with_the_harmonics(omega):
    """Both sliders stick and slide. NLvib keeps 7 harmonics of 1024 instants."""
    orbit = solve_orbit(chain(), omega / math.tau)
    assert all(0.2 < slider.stuck < 0.9 for slider in orbit.friction)
    phases = math.tau * np.arange(4096) / 4096
    history = orbit.history_at(phases)
    moved = np.column_stack([history.displacement[name] for name in NAMES])
    off = []
    for harmonics, steps in ((7, 1024), (15, 2048), (31, 4096)):
        turn = np.outer(phases, np.arange(1, harmonics + 1))
        waves = np.hstack([np.ones((phases.size, 1)), np.cos(turn), np.sin(turn)])
        balance = HarmonicBalance(
            (MASS, 0.02 * STIFFNESS, STIFFNESS), forces, PULL, harmonics, steps
        )
        guess = np.linalg.lstsq(waves, moved, rcond=None)[0]
        found = waves @ balance.solved(omega, guess)
        off.append(np.abs(found - moved).max() / np.abs(moved).max())
    assert off[0] < 0.01
    assert off[1] < off[0] / 8.0
    assert off[2] < off[1] / 8.0
    assert off[2] < 5e-5
