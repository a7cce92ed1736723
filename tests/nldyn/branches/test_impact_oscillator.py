"""Orbits and branches against rigid stops: closed forms of the impact oscillator and the ball."""

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from nldyn import (
    ConstantForce,
    HarmonicForce,
    RigidStop,
    System,
    continue_branch,
    describe_special,
    impacts,
    load,
    lyapunov_exponents,
    save,
    solve_orbit,
)
from nldyn.branches.endings import Ending

DAMPING, RESTITUTION, GAP = 0.1, 0.8, 0.3
A = np.array([[0.0, 1.0], [-1.0, -DAMPING]])


def oscillator(restitution=RESTITUTION):
    """x'' + 0.1 x' + x = cos ωt against a stop at 0.3 [Shaw and Holmes 1983]."""
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[DAMPING]],
        stops=[RigidStop("x", restitution, GAP)], excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip


def one_impact(omega, periods):
    """Speed and phase of the impact, state at phase zero and multipliers of the orbits, exactly.

    The motion over n periods is the steady response and a free one; the state at the impact is
    linear in the speed, and the amplitude of the response is known: a quadratic equation.
    """
    size = 1.0 / abs(1.0 - omega**2 + 1j * DAMPING * omega)
    angle = -np.angle(1.0 - omega**2 + 1j * DAMPING * omega)
    flown = expm(A * (2.0 * np.pi * periods / omega))
    by_gap, by_speed = np.array([GAP, 0.0]), np.array([0.0, 1.0])
    by_speed = np.linalg.solve(np.eye(2) - flown, by_speed + RESTITUTION * flown @ by_speed)
    p, q = by_gap / [1.0, omega], by_speed / [1.0, omega]
    for speed in np.roots([q @ q, 2.0 * p @ q, p @ p - size**2]):
        if abs(speed.imag) > 0.0 or speed.real <= 0.0:
            continue
        v = float(speed.real)
        steady = by_gap + by_speed * v
        phase = (math.atan2(-steady[1] / omega, steady[0]) - angle) % (2.0 * np.pi)
        after = np.array([GAP, -RESTITUTION * v]) - steady
        left = 2.0 * np.pi * periods - phase
        begin = expm(A * (left / omega)) @ after
        begin += size * np.array([np.cos(angle), -omega * np.sin(angle)])
        force = np.cos(phase)
        before, behind = (force - DAMPING * u - GAP for u in (v, -RESTITUTION * v))
        jump = np.array([[-RESTITUTION, 0.0], [(RESTITUTION * before + behind) / v, -RESTITUTION]])
        yield v, phase, begin, np.linalg.eigvals(jump @ flown)


@pytest.mark.parametrize(("omega", "periods"), [(1.7, 1), (2.8, 2), (4.3, 3)])
def test_one_impact_in_n_periods(omega, periods):
    """Speed, phase and multipliers to 1e-9 of the closed form, for each orbit that exists."""
    found = 0
    for speed, phase, begin, multipliers in one_impact(omega, periods):
        orbit = solve_orbit(
            oscillator(), omega / (2.0 * np.pi), period=periods, guess=begin, seconds=20.0
        )
        hits = impacts(orbit)
        if len(hits) != 1:  # the closed form lets the mass through the stop between impacts
            continue
        assert hits.speed[0] == pytest.approx(speed, rel=1e-9)
        assert np.radians(hits.phase_deg[0]) == pytest.approx(phase, abs=1e-9)
        exact, seen = (sorted(m, key=lambda x: (x.real, x.imag)) for m in (
            multipliers, orbit.multipliers
        ))  # fmt: skip
        assert np.abs(np.array(exact) - seen).max() < 1e-9 * np.abs(multipliers).max()
        assert orbit.liouville_error < 1e-9
        found += 1
    assert found


@pytest.fixture(scope="module")
def branch():
    orbit = solve_orbit(oscillator(), 1.7 / (2.0 * np.pi))
    return continue_branch(orbit, (0.13, 0.4))


def test_the_flip_is_that_of_the_closed_form(branch):
    def unity(omega):
        *_, multipliers = max(one_impact(omega, 1), key=lambda orbit: orbit[0])
        return float(np.prod(multipliers + 1.0).real)

    (flip,) = [special for special in branch.special_points if special.kind == "PD"]
    exact = brentq(unity, 2.06, 2.075, xtol=1e-15) / (2.0 * np.pi)
    assert flip.frequency_hz == pytest.approx(exact, rel=1e-10)


def test_a_branch_grazes_where_the_linear_response_reaches_the_stop(branch):
    """From the orbits with the impact and from those without. Phases of impact pass a node."""

    def reaches(omega):
        return 1.0 / abs(1.0 - omega**2 + 1j * DAMPING * omega) - GAP

    exact = brentq(reaches, 1.5, 3.0, xtol=1e-15) / (2.0 * np.pi)
    last = branch.special_points[-1]
    assert last.kind == "GR"
    assert branch.stop_reasons[1].ending is Ending.RANGE_END
    assert last.frequency_hz == pytest.approx(exact, rel=1e-10)
    assert "multiplier goes to infinity" in describe_special(last)
    calm = continue_branch(solve_orbit(oscillator(), 0.45), (0.3305, 0.8))
    (first,) = calm.special_points
    assert first.kind == "GR"
    assert first.frequency_hz == pytest.approx(exact, rel=1e-10)
    assert "jumps" in describe_special(first)


def test_branches_come_back_from_files(branch, tmp_path):
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert again.points[3].system.stops == (RigidStop("x", RESTITUTION, GAP),)
    assert [s.kind for s in again.special_points] == [s.kind for s in branch.special_points]


def test_a_ball_on_a_shaking_table():
    """It hits once a period T with g T / (1 + e), from which the phase follows."""
    g, hz, e, table = 9.81, 10.0, 0.5, 2.0
    system = System.from_matrices(
        [[1.0]], [[0.0]], {"ball": [1.0]}, stops=[RigidStop("ball", e, direction=-1)],
        excitation=[HarmonicForce("ball", table * g), ConstantForce("ball", -g)],
    )  # fmt: skip
    speed = g / hz / (1.0 + e)
    omega = 2.0 * np.pi * hz
    # the table moves as table g cos(ωt) / ω²; at the impact it rises with g T (1 - e) / 2 (1 + e)
    phase = -math.asin(g * (1.0 - e) / (2.0 * hz * (1.0 + e)) * omega / (table * g))
    period = 2.0 * np.pi / omega
    start = -phase / omega  # time from the impact to phase zero
    height = e * speed * start - 0.5 * g * start**2
    height += (
        table
        * g
        / omega**2
        * (np.cos(phase) - omega * start * np.sin(phase) - np.cos(phase + omega * start))
    )
    swing = np.sin(phase) - np.sin(phase + omega * start)
    pace = e * speed - g * start - table * g / omega * swing
    orbit = solve_orbit(system, hz, guess=[height, pace])
    hits = impacts(orbit)
    assert hits.speed == pytest.approx([speed], rel=1e-10)
    assert hits.time[0] % period == pytest.approx(phase / omega % period, abs=1e-12)


def test_lyapunov_exponents_see_impacts():
    """Their sum is the mean of what damping and impacts, e² each, make of areas."""
    found = lyapunov_exponents(oscillator(), 2.7 / (2.0 * np.pi))
    assert found.sum_error < 1e-8


def same_from_any_start(branch, range_hz, every):
    told = sorted((special.kind, special.frequency_hz) for special in branch.special_points)
    for start in branch.points[:: max(len(branch.points) // 10, 1)][1:10:every]:
        again = continue_branch(start, range_hz)
        found = sorted((special.kind, special.frequency_hz) for special in again.special_points)
        assert [kind for kind, _ in found] == [kind for kind, _ in told]
        assert [hz for _, hz in found] == pytest.approx([hz for _, hz in told], rel=1e-10)
        assert not again.notes


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.slow)])
def test_any_start_gives_one_set_of_special_points(branch, every):
    """From orbits all along the branch, also right beside the impact at a phase of shooting."""
    same_from_any_start(branch, (0.13, 0.4), every)


@pytest.mark.slow
def test_any_start_gives_one_set_over_a_chain_of_grazings(branch):
    """Down to where impacts become ever more, at rest in the end: 0.063 Hz."""
    range_hz = 0.05, 0.8
    long = continue_branch(solve_orbit(oscillator(), 1.7 / (2.0 * np.pi)), range_hz)
    assert len(long.special_points) > len(branch.special_points)
    same_from_any_start(long, range_hz, 3)
