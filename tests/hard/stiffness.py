"""Stops from soft to rigid."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from hard.case import Case, Measured
from hard.impact_oscillator import ImpactOscillator
from hard.multiprecision import JACOBIAN, ORIGIN, PROMISE, STATE, orbit_flow_error
from nldyn.branches.continuation import continue_branch
from nldyn.flow.flow_map import FlowMap
from nldyn.longterm.impacts import impacts
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.solve import solve_orbit
from nldyn.system.loads import Unbalance
from nldyn.system.stop import Stop
from nldyn.system.system import System

SUBJECT = "stiffness"
OSCILLATOR = ImpactOscillator()
HZ = 0.3
OMEGA = 2.0 * math.pi * HZ
RIGID = "closed form of the impact oscillator with restitution 1 [Shaw and Holmes 1983]"
RATE = 0.4  # a Hertz contact lasts s^(-2/5)
SECOND = "(ωτ)² of the contact's duration τ, the first term left out, or the promise of the state"


def beam_with_stop(stiffness: float) -> System:
    """The 1-DOF model of the paper with another stop."""
    return System.from_matrices(
        [[2.48]],
        [[16877.0]],
        {"middle": [1.0]},
        modal_damping=0.0142,
        stops=[Stop("middle", stiffness)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )


def beam_error(stiffness: float) -> Measured:
    """Flow on the orbit of the 1-DOF model at 20 Hz."""
    return orbit_flow_error(solve_orbit(beam_with_stop(stiffness), 20.0))


def stiff_orbit(stiffness: float) -> Orbit:
    """The oscillator's orbit with one impact; at rest on a stiff stop it would only tremble."""
    flow = FlowMap(OSCILLATOR.with_stop(stiffness))
    return solve_orbit(flow, HZ, guess=OSCILLATOR.rigid_start(OMEGA))


def stiff_flow_error(stiffness: float) -> Measured:
    """Flow on an orbit whose amplitude is many times the penetration."""
    orbit = stiff_orbit(stiffness)
    found = orbit_flow_error(orbit)
    share = orbit.max_penetration / orbit.max_abs_displacement
    return Measured(found.error, f"{found.note}, penetration {share:.0e} of the amplitude")


def rate_error(stiffnesses: tuple[float, float]) -> Measured:
    """How far the rates of phase, speed and trace of the monodromy matrix are from 2/5."""
    phase, speed, monodromy = OSCILLATOR.rigid(OMEGA)
    differences = []
    for stiffness in stiffnesses:
        orbit = stiff_orbit(stiffness)
        found = impacts(orbit)
        trace = float(np.trace(orbit.monodromy) - np.trace(monodromy))
        differences.append([found.time[0] * OMEGA - phase, found.speed[0] - speed, trace])
    rates = -np.diff(np.log(np.abs(differences)), axis=0)[0] / math.log(
        stiffnesses[1] / stiffnesses[0]
    )
    note = "rates of phase, speed, trace: " + ", ".join(f"{rate:.5f}" for rate in rates)
    return Measured(float(np.abs(rates / RATE - 1.0).max()), note)


def flip_rate_error(stiffnesses: tuple[float, float]) -> Measured:
    """How far the rate of a flip's frequency is from 2/5."""
    exact = OSCILLATOR.rigid_flip(0.36, 0.48)
    off = []
    for stiffness in stiffnesses:
        branch = continue_branch(solve_orbit(OSCILLATOR.with_stop(stiffness), 0.36), (0.36, 0.48))
        (flip,) = (s for s in branch.special_points if s.kind == "PD")
        off.append(flip.frequency_hz - exact)
    rate = math.log(off[0] / off[1]) / math.log(stiffnesses[1] / stiffnesses[0])
    return Measured(abs(rate / RATE - 1.0), f"rate {rate:.5f}, flip {off[1]:.1e} Hz off the limit")


def dwelling_error(stiffness: float) -> Measured:
    """Phase and speed of the impact against the limit with a contact of finite duration."""
    found = impacts(stiff_orbit(stiffness))
    phase, speed = OSCILLATOR.dwelling(OMEGA, stiffness)
    off = max(abs(found.time[0] * OMEGA - phase), abs(found.speed[0] / speed - 1.0))
    return Measured(float(off), f"contact of {1e9 * found.duration[0]:.3g} ns")


def second_order(stiffness: float) -> float:
    """(ωτ)² of the contact's duration τ at the speed of the limit."""
    speed = OSCILLATOR.rigid(OMEGA)[1]
    duration = 2.9432 * (1.25 * speed**2 / stiffness) ** 0.4 / speed
    return float(max((OMEGA * duration) ** 2, STATE))


CASES = (
    *(
        Case(
            SUBJECT,
            f"1-DOF model at 20 Hz, stop of {stiffness:.0e} N/m^1.5",
            "contact and motion have times of their own",
            ORIGIN,
            JACOBIAN,
            PROMISE,
            partial(beam_error, stiffness),
        )
        for stiffness in (1e6, 1e8, 1e10, 1e12, 1e14, 1e15)
    ),
    *(
        Case(
            SUBJECT,
            f"1 kg that swings 1 m, stop of {stiffness:.0e} N/m^1.5",
            "rounding of the displacement is a share of the penetration",
            ORIGIN,
            JACOBIAN,
            PROMISE,
            partial(stiff_flow_error, stiffness),
        )
        for stiffness in (1e6, 1e9, 1e12, 1e15)
    ),
    *(
        Case(
            SUBJECT,
            f"rate from {low:.0e} to {high:.0e} N/m^1.5",
            "the orbit becomes that of a rigid stop",
            RIGID + "; rate 2/5 of Hertz's law",
            bound,
            "of the rate; the next term is of the size of the contact's share of the period",
            partial(rate_error, (low, high)),
        )
        for low, high, bound in (
            (1e6, 1e8, 1.2e-1),
            (1e8, 1e10, 2e-2),
            (1e10, 1e12, 5e-3),
            (1e12, 1e15, 8e-4),
        )
    ),
    Case(
        SUBJECT,
        "rate of a flip, 1e8 to 1e10 N/m^1.5",
        "special points of the limit",
        RIGID + "; rate 2/5 of Hertz's law",
        2e-2,
        "two digits of the rate; the next term is of the size of the contact's share",
        partial(flip_rate_error, (1e8, 1e10)),
    ),
    *(
        Case(
            SUBJECT,
            f"impact beyond the limit, {stiffness:.0e} N/m^1.5",
            hard,
            "the limit with a free Hertz contact's duration and loss [Johnson 1985], 40 digits",
            second_order(stiffness),
            SECOND,
            partial(dwelling_error, stiffness),
        )
        for stiffness, hard in (
            (1e10, "short contacts"),
            (1e12, "short contacts"),
            (1e15, "contacts of microseconds in a period of 3 s"),
            (1e21, "contacts of ten nanoseconds in a period of 3 s"),
            (1e24, "contacts of half a nanosecond in a period of 3 s"),
        )
    ),
)
