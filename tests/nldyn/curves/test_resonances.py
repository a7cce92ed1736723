"""Phase resonance against linear and bilinear oscillators, and Duffing's exact backbone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ellipk

from nldyn import (
    ContinuationOptions,
    HarmonicForce,
    PolynomialSpring,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    backbone,
    continue_constant,
    harmonics,
    phase_resonance,
    solve_orbit,
)
from nldyn.orbits.harmonics import line_by_balance

FEW = ContinuationOptions(max_points=6, max_step=0.3)


def oscillator(c=0.0, force=(), cubic=0.0, stop=0.0):
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[c]],
        springs=[PolynomialSpring("x", [0.0, 0.0, cubic])] if cubic else [],
        stops=[Stop.linear("x", stop)] if stop else [], excitation=force,
    )  # fmt: skip


PUSH = (HarmonicForce("x", 1.0, phase_deg=25.0),)


def test_a_linear_oscillator_is_in_phase_resonance_at_its_undamped_frequency():
    c = 0.2
    free = backbone(oscillator(), amplitude_m=(0.5, 1.0)).orbits[0]
    curve = phase_resonance(oscillator(c, PUSH), free, (0.01, 0.5), (0.1, 0.3), options=FEW)
    assert np.ptp(curve.values[:, 1]) > 0.01
    assert 2.0 * np.pi * curve.values[:, 0] == pytest.approx(1.0, rel=1e-10)
    for orbit, (_, force) in zip(curve.orbits, curve.values, strict=True):
        assert orbit.max_abs_displacement == pytest.approx(force / c, rel=1e-9)


def exact_hz(amplitude):
    """Of u'' + u + u^3 = 0."""
    share = amplitude**2 / (2.0 * (1.0 + amplitude**2))
    return np.sqrt(1.0 + amplitude**2) / (4.0 * ellipk(share))


def test_a_lightly_damped_duffing_oscillator_keeps_to_its_backbone():
    """It is off by the square of the damping."""
    free = backbone(oscillator(cubic=1.0), amplitude_m=(0.1, 1.4)).orbits[-1]
    off = []
    for c in (0.03, 0.003):
        forced = oscillator(c, PUSH, cubic=1.0)
        curve = phase_resonance(forced, free, (0.5 * c, 5.0 * c), (0.15, 0.5), options=FEW)
        sizes = np.array([orbit.max_abs_displacement for orbit in curve.orbits])
        assert sizes.max() > 1.2
        off.append(np.abs(curve.values[:, 0] / exact_hz(sizes) - 1.0).max())
    assert off[1] < 1e-7
    assert off[1] / off[0] == pytest.approx(0.01, rel=0.5)


def test_a_bilinear_oscillator_has_one_frequency_at_any_force():
    """Amplitude and force go together; with light damping it is that of the two half swings."""
    free = backbone(oscillator(stop=3.0), amplitude_m=(0.1, 1.0)).orbits[0]
    curve = phase_resonance(
        oscillator(1e-3, PUSH, stop=3.0), free, (1e-5, 1.0), (0.15, 0.3), options=FEW
    )
    hz, forces = curve.values.T
    assert np.ptp(forces) > 0.1 * forces.max()
    assert hz == pytest.approx(hz[0], rel=1e-9)
    assert hz[0] == pytest.approx(2.0 / 1.5 / (2.0 * np.pi), rel=1e-5)


def test_a_forced_orbit_is_led_to_a_lag():
    c = 0.2
    start = solve_orbit(oscillator(c, PUSH), 0.12)
    curve = phase_resonance(oscillator(c, PUSH), start, (0.8, 1.2), (0.11, 0.2))
    assert 2.0 * np.pi * curve.values[:, 0] == pytest.approx(1.0, rel=1e-9)
    third = continue_constant(
        start, "phase_lag_deg", ("frequency_hz", "amplitude"), ((0.11, 0.2), (0.8, 1.2)),
        value=60.0,
    )  # fmt: skip
    omega = 2.0 * np.pi * third.values[:, 0]
    assert np.degrees(np.arctan2(c * omega, 1.0 - omega**2)) == pytest.approx(60.0, rel=1e-9)


def test_an_order_by_the_balance_of_forces_is_that_of_samples():
    system = System.from_modal(
        [10.0, 25.0], {"a": [1.0, 0.8], "b": [0.5, -1.0]}, modal_damping=0.02,
        stops=[Stop("a", 1e6, gap=1e-3)], excitation=[HarmonicForce("b", 20.0, 30.0)],
    )  # fmt: skip
    orbit = solve_orbit(system, 10.3)
    assert orbit.impacts
    for at in ("a", "b"):
        lines = harmonics(orbit, at).phasor
        for order in (1, 3):
            exact = lines[order * orbit.period]
            assert abs(line_by_balance(orbit, at, order) - exact) < 1e-9 * abs(lines[1])


def test_what_has_no_phase_resonance_is_told():
    free = backbone(oscillator(), amplitude_m=(0.5, 1.0)).orbits[0]
    two = System.from_modal([1.0, 2.0], {"x": [1.0, 1.0]}, modal_damping=0.1, excitation=PUSH)
    rigid = System.from_modal(
        [1.0], {"x": [1.0]}, modal_damping=0.1, excitation=PUSH, stops=[RigidStop("x", 0.5, 10.0)]
    )
    for system, words in (
        (oscillator(0.0, PUSH), "needs a system with damping"),
        (oscillator(0.1), "one source that swings, but there are 0"),
        (oscillator(0.1, PUSH * 2), "one source that swings, but there are 2"),
        (oscillator(0.1, (HarmonicForce("x", 1.0, harmonic=2),)), "a source of harmonic 1"),
        (two, "one of another structure"),
        (rigid, "not followed against rigid stops"),
    ):
        with pytest.raises(SystemModelError, match=words):
            phase_resonance(system, free, (0.01, 0.5), (0.1, 0.3))
