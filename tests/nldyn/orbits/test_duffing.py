"""Duffing's oscillator against its perturbation solution, with the order of what that leaves out.

Two stops with cubic law and no gap, one on either side, are the spring εx³ exactly. For
x'' + 2εμx' + x + εx³ = εf cos ωt with ω = 1 + εσ the method of multiple scales gives [Nayfeh and
Mook 1979, section 4.1.1]

x = a cos(ωt - γ) + (ε a³/32) cos 3(ωt - γ) + O(ε²),   (μ² + (σ - 3a²/8)²) a² = f²/4 + O(ε).
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from nldyn import HarmonicForce, Stop, System, continue_branch, harmonics, solve_orbit

MU, FORCE = 0.2, 1.0


def duffing(epsilon: float) -> System:
    stops = [Stop("m", epsilon, 3.0, direction=side) for side in (1, -1)]
    return System.from_matrices(
        [[1.0]], [[1.0]], {"m": [1.0]}, damping=[[2.0 * epsilon * MU]], stops=stops,
        excitation=[HarmonicForce("m", epsilon * FORCE)],
    )  # fmt: skip


def detuning(a, side):
    """σ on the upper (+1) or the lower (-1) side of the backbone."""
    return 0.375 * a**2 + side * np.sqrt(FORCE**2 / (4.0 * a**2) - MU**2)


def folds() -> list[float]:
    """Detunings at which the response curve turns: both on its upper side, where dσ/da = 0."""

    def slope(a):
        return 0.75 * a - FORCE**2 / (4.0 * a**3 * math.sqrt(FORCE**2 / (4.0 * a**2) - MU**2))

    largest = FORCE / (2.0 * MU)
    middle = 0.6 * largest
    ends = (brentq(slope, 0.1, middle), brentq(slope, middle, largest * (1.0 - 1e-12)))
    return sorted(detuning(a, 1) for a in ends)


def hertz(epsilon, sigma):
    return (1.0 + epsilon * sigma) / (2.0 * math.pi)


def test_fold_frequencies_err_by_the_square_of_the_small_parameter():
    expected = folds()
    left = []
    for epsilon in (0.02, 0.01):
        window = (hertz(epsilon, -2.0), hertz(epsilon, 4.0))
        branch = continue_branch(solve_orbit(duffing(epsilon), window[0]), window)
        found = sorted(s.frequency_hz for s in branch.special_points if s.kind == "LP")
        assert len(found) == 2
        left.append(np.array(found) * 2.0 * math.pi - 1.0 - epsilon * np.array(expected))
    assert left[0] / left[1] == pytest.approx([4.0, 4.0], rel=0.1)


@pytest.mark.parametrize("sigma", [-1.0, 0.5, 4.0])  # where there is one orbit
def test_amplitudes_err_by_the_next_power_of_the_small_parameter(sigma):
    roots = np.roots([9.0 / 64.0, -0.75 * sigma, sigma**2 + MU**2, -0.25 * FORCE**2])
    (square,) = roots.real[np.abs(roots.imag) < 1e-9]
    a = math.sqrt(square)
    errors = []
    for epsilon in (0.02, 0.01):
        lines = harmonics(solve_orbit(duffing(epsilon), hertz(epsilon, sigma))).amplitude
        errors.append((lines[1] - a, lines[3] - epsilon * a**3 / 32.0))
    (first, third), (first_half, third_half) = errors
    assert first / first_half == pytest.approx(2.0, rel=0.1)
    assert third / third_half == pytest.approx(4.0, rel=0.15)
