"""Stops that grow stiff: orbits and flips tend to those of the impact oscillator.

The limit is x'' + c x' + k x = f cos ωt, x <= 0, with restitution 1. Its motion with one impact per
period has a closed form, and so has its monodromy matrix: the flight's exponential times the
saltation matrix of the impact [Shaw and Holmes 1983; Nordmark 1991]. A stop of force s δ^p is
closed for a time of the order s^(-1/(p+1)), so all differences fall with that power of s.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.linalg as sla
from scipy.optimize import brentq

from nldyn import FlowMap, HarmonicForce, RigidStop, Stop, System, continue_branch, solve_orbit

DAMPING, STIFFNESS, FORCE = 0.1, 1.0, 1.0


def one_stop(exponent: float, stop: float) -> System:
    return System.from_matrices(
        [[1.0]], [[STIFFNESS]], {"m": [1.0]}, damping=[[DAMPING]],
        stops=[Stop("m", stop, exponent)], excitation=[HarmonicForce("m", FORCE)],
    )  # fmt: skip


def rigid(omega: float) -> tuple[float, float, np.ndarray]:
    """Phase and speed of the impact, and the monodromy matrix, of the motion with one impact.

    From (0, -v) the flight leads to (0, v) after a period. Less the steady response (X, V) at the
    impact, it is linear: (E - 1)(X, V) = E (0, -v) - (0, v), which gives (X, V) = v (α, β), and X,
    V/ω are the two components of an amplitude that is known.
    """
    flight = sla.expm(np.array([[0.0, 1.0], [-STIFFNESS, -DAMPING]]) * 2.0 * math.pi / omega)
    rates = np.linalg.solve(flight - np.eye(2), flight @ [0.0, -1.0] - [0.0, 1.0])
    response = FORCE / (STIFFNESS - omega**2 + 1j * DAMPING * omega)
    speed = abs(response) / math.hypot(rates[0], rates[1] / omega)
    turned = speed * complex(rates[0], -rates[1] / omega)  # response times exp(i phase)
    phase = np.angle(turned / response)
    before = FORCE * math.cos(phase) - DAMPING * speed
    after = FORCE * math.cos(phase) + DAMPING * speed
    saltation = np.array([[-1.0, 0.0], [(before + after) / speed, -1.0]])
    return phase % (2.0 * math.pi), speed, flight @ saltation


def flip_of_rigid(low_hz: float, high_hz: float) -> float:
    def beyond(hz):
        return np.linalg.det(rigid(2.0 * math.pi * hz)[2] + np.eye(2))

    return brentq(beyond, low_hz, high_hz, xtol=1e-14)


def powers(stiffnesses, differences):
    """Exponents with which differences fall from one stiffness to the next."""
    return -np.diff(np.log(np.abs(differences)), axis=0) / np.diff(np.log(stiffnesses))[:, None]


def test_an_impact_with_a_rigid_stop_tells_its_speed_and_impulse():
    """A mass of 1 kg that comes back as fast as it came: twice the speed of the closed form."""
    hz = 0.3
    phase, speed, _ = rigid(2.0 * math.pi * hz)
    system = System.from_matrices(
        [[1.0]], [[STIFFNESS]], {"m": [1.0]}, damping=[[DAMPING]],
        stops=[RigidStop("m", 1.0)], excitation=[HarmonicForce("m", FORCE)],
    )  # fmt: skip
    start = np.array([0.0, -speed])
    nodes = FlowMap(system).shoot(start[None], np.array([phase, 2.0 * math.pi]), 2.0 * math.pi * hz)
    (impact,) = solve_orbit(system, hz, guess=nodes.ends[0]).impact_list
    assert impact.force is None and impact.penetration == 0.0
    assert impact.time == pytest.approx(phase / (2.0 * math.pi * hz), rel=1e-8)
    assert (impact.speed, impact.impulse) == pytest.approx((speed, 2.0 * speed), rel=1e-8)
    assert "m/s and" in repr(impact) and "inf" not in repr(impact)


@pytest.mark.parametrize(("exponent", "stops"), [(1.0, (1e6, 1e8)), (1.5, (1e8, 1e10))])
def test_orbit_tends_to_the_impact_oscillators_with_the_duration_of_contact(exponent, stops):
    hz = 0.3
    phase, speed, monodromy = rigid(2.0 * math.pi * hz)
    differences = []
    for stop in stops:
        orbit = solve_orbit(one_stop(exponent, stop), hz)
        (impact,) = orbit.impact_list
        fastest = math.sqrt(2.0 * stop / (exponent + 1.0) * impact.penetration ** (exponent + 1.0))
        differences.append(
            [
                impact.time * 2.0 * math.pi * hz - phase,
                fastest - speed,  # the work of the contact is the energy of the impact
                np.trace(orbit.monodromy) - np.trace(monodromy),
            ]
        )
    found = powers(stops, differences).ravel()
    assert found == pytest.approx([1.0 / (exponent + 1.0)] * 3, rel=0.02)


@pytest.mark.parametrize(("exponent", "stops"), [(1.0, (1e6, 1e8)), (1.5, (1e8, 1e10))])
def test_flips_tend_to_the_impact_oscillators_with_the_duration_of_contact(exponent, stops):
    expected = flip_of_rigid(0.36, 0.48)
    differences = []
    for stop in stops:
        branch = continue_branch(solve_orbit(one_stop(exponent, stop), 0.36), (0.36, 0.48))
        (flip,) = (s for s in branch.special_points if s.kind == "PD")
        differences.append([flip.frequency_hz - expected])
    assert powers(stops, differences).item() == pytest.approx(1.0 / (exponent + 1.0), rel=0.02)


def bounces(speed: float) -> tuple[float, int]:
    """Speed after one period, and bounces, of Y'' = cos τ at a wall at Y <= 0 that it leaves.

    From each bounce on, Y = (V - sin τ0) s + cos τ0 - cos(τ0 + s) exactly.
    """
    start, speed, count = 0.0, -speed, 1
    while True:

        def height(s, start=start, speed=speed):
            fall = 2.0 * math.sin(start + 0.5 * s) * math.sin(0.5 * s)  # cos τ0 - cos(τ0 + s)
            return (speed - math.sin(start)) * s + fall

        times = np.linspace(0.0, 2.0 * math.pi - start, 20001)[1:]
        above = np.flatnonzero(np.array([height(s) for s in times]) > 0.0)
        if not above.size:
            return speed - math.sin(start), count
        until = brentq(height, times[above[0] - 1], times[above[0]], xtol=1e-15)
        speed = -(speed + math.sin(start + until) - math.sin(start))
        start, count = start + until, count + 1


@pytest.mark.parametrize(
    ("omega", "force"), [(1e-7, 1e-4), (1e-7, 1.0), (1e-5, 1.0), (1e-5, 1e-10), (1e-3, 1e-5)]
)
def test_a_free_body_far_out_bounces_as_at_a_wall_or_rounding_is_blamed(omega, force):
    """The excursions are up to 1e17 times the gap, the contacts 1e-12 of a period."""
    system = System.from_modal(
        [0.0], {"a": [1.0]}, stops=[Stop("a", 1e9, gap=1e-3)],
        excitation=[HarmonicForce("a", force)],
    )  # fmt: skip
    flow = FlowMap(system)
    start = flow.to_state(np.array([[1e-3 * (1.0 - 1e-12), 0.01 * force / omega]]))
    found = flow.shoot(start, np.array([0.0, 2.0 * np.pi]), omega)
    if force / omega**2 > 1e9:  # rounding of the excursion is not small beside the penetration
        assert "rounding" in found.failure
    else:
        speed, _ = bounces(0.01)
        assert flow.to_modal(found.ends)[0, 1] * omega / force == pytest.approx(speed, rel=1e-5)
