"""From overdamped to undamped."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import mpmath
import numpy as np
from bench.exact import Precision
from paper.jobs import BILINEAR_ALPHA, STIFFNESS, scene_system
from scipy.special import gamma

from hard.case import Case, Measured
from hard.multiprecision import (
    DIGITS,
    JACOBIAN,
    ORIGIN,
    PROMISE,
    STATE,
    exact_orbit,
    orbit_flow_error,
)
from nldyn.base.arrays import Real
from nldyn.flow.flow_map import FlowMap
from nldyn.flow.options import FlowOptions
from nldyn.longterm.impacts import Impacts, impacts
from nldyn.longterm.simulation import simulate
from nldyn.orbits.solve import solve_orbit
from nldyn.system.loads import HarmonicForce
from nldyn.system.stop import Stop
from nldyn.system.system import System

mp = mpmath.mp
SUBJECT = "damping"
MASS = 2.48
PERIODS = 100_000
COUNTED = 50  # of them, in which flights and panels are counted
MORE = Precision(75, 60, 30)  # strong damping costs 36


def damped(ratio: float) -> System:
    """The mass and spring of the 1-DOF model with another damping, and a force of its own."""
    return System.from_matrices(
        [[MASS]],
        [[STIFFNESS]],
        {"middle": [1.0]},
        modal_damping=ratio,
        stops=[Stop("middle", 5.17e9)],
        excitation=[HarmonicForce("middle", 1.0)],
    )


def damping_error(ratio: float) -> Measured:
    """Flow on an orbit at 19 Hz.

    A defective matrix has no eigenvectors for the reference, which takes 1e-12 more damping.
    """
    orbit = solve_orbit(damped(ratio), 19.0)
    return orbit_flow_error(orbit, DIGITS, damped(ratio * (1.0 + 1e-12)) if ratio == 1.0 else None)


def multiplier_error(ratio: float) -> Measured:
    """Multipliers of the same orbit, relative to each."""
    orbit = solve_orbit(damped(ratio), 19.0)
    exact = sorted(
        (complex(mu) for mu in exact_orbit(orbit, precision=MORE).multipliers()), key=abs
    )
    found = sorted(orbit.multipliers, key=abs)
    off = [
        min(abs(a - b), abs(a - b.conjugate())) / abs(b) for a, b in zip(found, exact, strict=True)
    ]
    return Measured(max(off), f"moduli {abs(exact[0]):.1e}, {abs(exact[1]):.1e}")


def energy(system: System, modal: Real) -> float:
    """Energy of modal displacements and velocities (2n,), with that of the stops."""
    q, v = modal[: system.size], modal[system.size :]
    total = 0.5 * float(v @ v) + 0.5 * float(np.sum((system.natural_frequencies * q) ** 2))
    for stop in system.elastic_stops.values():
        depth = max(float(system.stop_vector(stop) @ q) - stop.gap, 0.0)
        total += stop.stiffness * depth ** (stop.exponent + 1.0) / (stop.exponent + 1.0)
    return total


def conservative(name: str) -> System:
    """The system of a scene without damping and without force."""
    scene = scene_system(name)
    return replace(scene, damping=0.0 * scene.damping, dampers=(), excitation=())


def energy_change(name: str) -> Measured:
    """Change of the energy over 1e5 periods of 20 Hz, in roundings of the state.

    The state is rounded once in each flight and each panel of a contact, which may change the
    energy by 2^-52 of itself. They are counted over the last periods.
    """
    system = conservative(name)
    start = np.zeros(2 * system.size)
    start[: system.size] = -1e-3 * np.sign(system.participation["middle"])
    flow = FlowMap(system, FlowOptions(rtol=1e-13, nodes=24))
    motion = simulate(flow, 20.0, COUNTED, start=start, transient=PERIODS - COUNTED)
    pieces = sum(stretch.record.used for stretch in motion.stretches) / COUNTED
    change = energy(system, motion.end) / energy(system, start) - 1.0
    note = f"relative change {change:.1e}, {pieces:.1f} flights and panels in a period"
    return Measured(abs(change) / (PERIODS * pieces * 2.0**-52), note)


def free_vibration(stop: Stop, amplitude: float, periods: int) -> Impacts:
    """Impacts of the undamped mass on its spring beside a stop, without any force."""
    system = System.from_matrices([[MASS]], [[STIFFNESS]], {"middle": [1.0]}, stops=[stop])
    start = np.array([-amplitude * math.sqrt(MASS), 0.0])
    return impacts(simulate(system, system.frequencies_hz[0], periods, start=start))


def frequency_of(found: Impacts) -> float:
    """Mean frequency in Hz of impacts that repeat."""
    return float((len(found) - 1) / (found.time[-1] - found.time[0]))


def bilinear_frequency_error(amplitude: float) -> Measured:
    """Frequency of a free vibration against a linear stop."""
    own = math.sqrt(STIFFNESS / MASS) / (2.0 * math.pi)
    root = math.sqrt(1.0 + BILINEAR_ALPHA)
    exact = 2.0 * root / (1.0 + root) * own
    stop = Stop.linear("middle", BILINEAR_ALPHA * STIFFNESS)
    found = frequency_of(free_vibration(stop, amplitude, 1000))
    return Measured(abs(found / exact - 1.0), f"{exact:.6f} Hz")


def hertz_backbone_error(amplitude: float) -> Measured:
    """Frequency of a free vibration against the Hertz stop of the paper."""
    with mp.workdps(40):
        stiff, hertz = mp.mpf(STIFFNESS) / MASS, mp.mpf(5.17e9) / MASS
        twice = stiff * mp.mpf(amplitude) ** 2  # the energy over half the mass

        def rest(x: mpmath.mpf) -> mpmath.mpf:
            return 1 - (stiff * x**2 + mp.mpf(4) / 5 * hertz * x ** mp.mpf("2.5")) / twice

        free = (5 * twice / (4 * hertz)) ** mp.mpf("0.4")
        depth = mp.findroot(rest, (free / 2, free), solver="anderson")

        def slowness(s: mpmath.mpf) -> mpmath.mpf:
            """Time by s with x = depth (1 - s²), which takes the root out of the end."""
            lost = -mp.expm1(mp.mpf("2.5") * mp.log1p(-(s**2))) / s**2 if s else mp.mpf("2.5")
            left = stiff * depth**2 * (2 - s**2)
            return 2 * depth / mp.sqrt(left + mp.mpf(4) / 5 * hertz * depth ** mp.mpf("2.5") * lost)

        exact = 1 / (mp.pi / mp.sqrt(stiff) + 2 * mp.quad(slowness, [0, 1]))
    found = frequency_of(free_vibration(Stop("middle", 5.17e9), amplitude, 1000))
    return Measured(abs(found / float(exact) - 1.0), f"{float(exact):.6f} Hz")


def duration_error(stiffness: float, speed: float) -> Measured:
    """Duration of the impact of a free body of 1 kg, from a hundred depths before the stop."""
    system = System.from_modal([0.0], {"m": [1.0]}, stops=[Stop("m", stiffness)])
    depth = (1.25 * speed**2 / stiffness) ** 0.4
    away = 100.0 * depth
    found = impacts(simulate(system, speed / (3.0 * away), 1, start=np.array([-away, speed])))
    exact = 2.0 * math.sqrt(math.pi) * gamma(1.4) / gamma(0.9) * depth / speed
    off = abs(found.duration[0] / exact - 1.0)
    return Measured(float(off), f"{exact:.3g} s, rebound {found.rebound_speed[0] / speed:.12f}")


def dissipation_error(loss: float) -> Measured:
    """Depth and rebound of a free body of 1 kg at 1 m/s on a stop with a dissipation in s/m."""
    stiffness = 1e9
    with mp.workdps(60):

        def spent(v: mpmath.mpf) -> mpmath.mpf:
            return v / loss - mp.log1p(loss * v) / mp.mpf(loss) ** 2

        deepest = float((mp.mpf(2.5) * spent(mp.mpf(1)) / stiffness) ** mp.mpf(0.4))
        start = 1 + mp.mpf(loss)  # u = 1 + a v at the end has the same u e^-u: Lambert's function
        rebound = float((1 + mp.lambertw(-start * mp.exp(-start))) / loss)
    system = System.from_modal([0.0], {"m": [1.0]}, stops=[Stop("m", stiffness, dissipation=loss)])
    flow, lasting = FlowMap(system), 10.0 * deepest * (1.0 + loss)
    before = flow.to_state(np.array([[-deepest, 1.0]]))
    phases = np.array([0.0, 2.0 * np.pi])
    motion = flow.trajectory(before, phases, 2.0 * np.pi / lasting)
    speed = -flow.to_modal(motion.states(phases))[1, 1]
    depth = motion.extremes(0)[:, 1].max()
    off = max(abs(speed / rebound - 1.0), abs(depth / deepest - 1.0))
    return Measured(float(off), f"rebound {rebound:.6g} m/s")


CASES = (
    *(
        Case(
            SUBJECT,
            f"damping ratio {ratio:g}",
            hard,
            ORIGIN,
            JACOBIAN,
            PROMISE,
            partial(damping_error, ratio),
        )
        for ratio, hard in (
            (10.0, "one decay is 400 times as fast as the other"),
            (1.0, "the linear part is defective"),
            (0.1, "an ordinary case"),
            (1e-3, "light damping"),
            (1e-6, "next to none"),
            (0.0, "nothing makes up for an error"),
        )
    ),
    *(
        Case(
            SUBJECT,
            f"multipliers at damping ratio {ratio:g}",
            hard,
            ORIGIN,
            JACOBIAN,
            PROMISE,
            partial(multiplier_error, ratio),
        )
        for ratio, hard in (
            (10.0, "one is tiny beside the other"),
            (1e-6, "their moduli differ from 1 by 1e-6"),
            (0.0, "their moduli are 1"),
        )
    ),
    *(
        Case(
            SUBJECT,
            f"energy of the {title} over 1e5 periods, in roundings",
            "errors add up in a motion that nothing damps",
            "theory: it stays as it is",
            1.0,
            "of the roundings that double arithmetic makes: 2^-52 in each flight and panel",
            partial(energy_change, name),
            quick,
        )
        for title, name, quick in (
            ("1-DOF model", "one_dof", True),
            ("4-DOF model", "four_dof_xi_0.01", False),
        )
    ),
    *(
        Case(
            SUBJECT,
            f"free vibration against a linear stop, {amplitude:g} m",
            "a backbone that does not depend on the amplitude",
            "closed form: bilinear frequency, eq. 3.2 of the paper",
            STATE,
            PROMISE,
            partial(bilinear_frequency_error, amplitude),
        )
        for amplitude in (1e-9, 1e-3, 1e3)
    ),
    *(
        Case(
            SUBJECT,
            f"free vibration against a Hertz stop, {amplitude:g} m",
            "a backbone that bends",
            "quadrature of the energy equation in 40 digits",
            STATE,
            PROMISE,
            partial(hertz_backbone_error, amplitude),
        )
        for amplitude in (1e-9, 1e-5, 1e-1)
    ),
    *(
        Case(
            SUBJECT,
            f"Hertz contact of {stiffness:.0e} N/m^1.5 at {speed:g} m/s",
            "how long a contact lasts",
            "closed form 2.94 (5m/4k)^(2/5) v^(-1/5) [Johnson 1985, eq. 11.24]",
            STATE,
            PROMISE,
            partial(duration_error, stiffness, speed),
        )
        for stiffness, speed in ((1e6, 1e-3), (1e9, 1.0), (1e12, 1e-6), (1e15, 10.0), (1e15, 1e-9))
    ),
    *(
        Case(
            SUBJECT,
            f"impact at 1 m/s on a Hertz stop with a dissipation of {loss:g} s/m",
            hard,
            "closed form: first integral of m v dv = -k δ^p (1 + a v) dδ [Hunt and Crossley 1975]",
            STATE,
            PROMISE,
            partial(dissipation_error, loss),
        )
        for loss, hard in (
            (1e-3, "next to no loss"),
            (1.0, "an ordinary case"),
            (40.0, "1 + a v falls to a rounding error: the body creeps out"),
            (1e4, "nearly all of the contact is creep"),
            (1e8, "the body all but sticks"),
        )
    ),
)
