"""Many impacts, impacts at one instant, and contacts that never end or never begin."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
from bench.exact import Precision
from scipy.optimize import brentq

from hard.case import Case, Measured
from hard.multiprecision import JACOBIAN, ORIGIN, PROMISE, STATE, newton_step, orbit_flow_error
from hard.stiffness import beam_with_stop
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.solve import solve_orbit
from nldyn.system.loads import HarmonicForce
from nldyn.system.stop import Stop
from nldyn.system.system import System

SUBJECT = "chatter and sustained contact"
FEWER = Precision(24, 30, 16)  # a reference of minutes otherwise
OWN = 2.0 * math.pi * 10.0


def mass(*stops: Stop, force: float = 1.0, ratio: float = 0.01) -> System:
    """A mass of 1 kg on a spring, 10 Hz."""
    return System.from_modal(
        [10.0],
        {"m": [1.0]},
        modal_damping=ratio,
        stops=stops,
        excitation=[HarmonicForce("m", force)],
    )


def chattering_orbit(hz: float) -> Orbit:
    """A slow mode carries a fast one on to a stop, where it bounces until it rests."""
    system = System.from_modal(
        [1.0, 50.0],
        {"m": [1.0, 1.0]},
        modal_damping=0.05,
        stops=[Stop("m", 1e9)],
        excitation=[HarmonicForce("m", 1.0)],
    )
    return solve_orbit(system, hz, seconds=600.0)


def chatter_error(hz: float) -> Measured:
    """Flow over a period with many impacts."""
    orbit = chattering_orbit(hz)
    found = orbit_flow_error(orbit, FEWER)
    return Measured(found.error, f"{found.note}, {orbit.impacts} impacts in a period")


def chatter_orbit_error() -> Measured:
    """Error of an orbit of more than fifty impacts."""
    orbit = chattering_orbit(0.2)
    if orbit.impacts < 50:
        return Measured(math.nan, f"only {orbit.impacts} impacts")
    return Measured(newton_step(orbit, FEWER)[2], f"{orbit.impacts} impacts in a period")


def halves_error() -> Measured:
    """Two stops at one place that share the stiffness, against the single one."""
    single = solve_orbit(beam_with_stop(5.17e9), 20.0)
    two = replace(single.system, stops=(Stop("middle", 3.0e9), Stop("middle", 2.17e9)))
    return difference(solve_orbit(two, 20.0), single)


def chattering_halves_error(hz: float) -> Measured:
    """The same in a motion with many impacts, at which both stops close at one instant."""
    single = chattering_orbit(hz)
    two = replace(single.system, stops=(Stop("m", 3e8), Stop("m", 7e8)))
    return motions_apart(solve_orbit(two, hz, seconds=600.0), single)


def chattering_twins_error(hz: float) -> Measured:
    """Two chattering systems side by side, each with its stop and force, against one of them."""
    twins = System.from_modal(
        [1.0, 1.0, 50.0, 50.0],
        {"m": [1.0, 0.0, 1.0, 0.0], "n": [0.0, 1.0, 0.0, 1.0]},
        modal_damping=0.05,
        stops=[Stop("m", 1e9), Stop("n", 1e9)],
        excitation=[HarmonicForce("m", 1.0), HarmonicForce("n", 1.0)],
    )
    return motions_apart(solve_orbit(twins, hz, seconds=600.0), chattering_orbit(hz))


def motions_apart(found: Orbit, exact: Orbit) -> Measured:
    """Relative difference of the displacement at m over a period; infinite if impacts are lost."""
    phases = np.linspace(0.0, 2.0 * math.pi, 1000)
    one, other = (
        orbit.states(phases)[:, : orbit.system.size] @ orbit.system.participation["m"]
        for orbit in (found, exact)
    )
    off = float(np.abs(one - other).max() / np.abs(other).max())
    lost = found.impacts != 2 * exact.impacts
    return Measured(math.inf if lost else off, f"{found.impacts} impacts in a period")


def twins_error() -> Measured:
    """Two equal masses side by side, each with its stop and force, against one of them."""
    single = mass(Stop("m", 1e9))
    twins = System.from_modal(
        [10.0, 10.0],
        {"m": [1.0, 0.0], "n": [0.0, 1.0]},
        modal_damping=0.01,
        stops=[Stop("m", 1e9), Stop("n", 1e9)],
        excitation=[HarmonicForce("m", 1.0), HarmonicForce("n", 1.0)],
    )
    return difference(solve_orbit(twins, 13.0), solve_orbit(single, 13.0))


def difference(found: Orbit, exact: Orbit) -> Measured:
    """Relative difference in amplitude, and that of the multipliers."""
    height = abs(found.max_abs_displacement / exact.max_abs_displacement - 1.0)
    values = exact.multipliers
    off = max(float(np.abs(values - mu).min()) for mu in found.multipliers)
    note = f"amplitude {height:.1e}, multipliers {off:.1e}, {found.impacts} impacts"
    return Measured(max(10.0 * height, off), note)


def rest_depth(stiffness: float, gap: float, own: float = OWN) -> float:
    """Penetration at rest of a unit mass on its spring against a Hertz stop with preload.

    The spring pulls back with own² (gap + δ), the stop pushes with k δ^1.5.
    """
    return float(
        brentq(
            lambda d: own**2 * (gap + d) + stiffness * d**1.5, 0.0, -gap, xtol=1e-300, rtol=1e-15
        )
    )


def preload_error(stiffness: float, gap: float) -> Measured:
    """Rest under preload and the multipliers of small motions about it.

    The stop's slope adds 1.5 k √δ to the squared frequency.
    """
    hz, ratio = 13.0, 0.01
    depth = rest_depth(stiffness, gap)
    near = np.array([gap + 0.9 * depth, 0.0])
    orbit = solve_orbit(mass(Stop("m", stiffness, gap=gap), force=0.0), hz, guess=near)
    squared = OWN**2 + 1.5 * stiffness * math.sqrt(depth)
    decay = ratio * OWN
    mu = np.exp(complex(-decay, math.sqrt(squared - decay**2)) / hz)
    off = max(min(abs(mu - x), abs(mu.conjugate() - x)) for x in orbit.multipliers)
    start = orbit.states(np.array([0.0]))[0]
    place = abs(start[0] / (gap + depth) - 1.0)
    note = f"place {place:.1e}, multipliers {off:.1e}, depth {depth:.3g} m"
    return Measured(float(max(10.0 * place, off)), note)


def held_error(stiffness: float) -> Measured:
    """A preloaded mass that a force shakes without opening its Hertz stop."""
    return orbit_flow_error(solve_orbit(mass(Stop("m", stiffness, gap=-1e-3)), 13.0))


def linear_hold_error() -> Measured:
    """A preloaded mass on a linear stop that never opens: the linear response."""
    stiffness, gap, hz, force = 1e6, -1e-3, 13.0, 1.0
    orbit = solve_orbit(mass(Stop("m", stiffness, 1.0, gap)), hz)
    omega = 2.0 * math.pi * hz
    squared = OWN**2 + stiffness
    response = force / complex(squared - omega**2, 0.02 * OWN * omega)
    rest = stiffness * gap / squared
    start = orbit.states(np.array([0.0]))[0]
    exact = np.array([rest + response.real, (1j * omega * response).real])
    scale = np.array([abs(rest), abs(rest) * OWN])
    return Measured(float(np.abs((start - exact) / scale).max()), f"{orbit.impacts} impacts")


def unreached_error(gap: float) -> Measured:
    """A stop that is never reached: the linear response."""
    hz = 13.0
    orbit = solve_orbit(mass(Stop("m", 1e9, gap=gap)), hz)
    omega = 2.0 * math.pi * hz
    response = 1.0 / complex(OWN**2 - omega**2, 0.02 * OWN * omega)
    return Measured(abs(orbit.max_abs_displacement / abs(response) - 1.0))


def mirrored_error() -> Measured:
    """Two stops without a gap on either side hand over at one instant: the motion is symmetric."""
    system = mass(Stop("m", 1e6), Stop("m", 1e6, direction=-1), ratio=0.05)
    orbit = solve_orbit(system, 13.0)
    states = orbit.states(np.array([0.0, math.pi]))
    size = np.abs(orbit.states(np.linspace(0.0, 6.0, 50))).max(axis=0)
    off = float(np.abs(states.sum(axis=0) / size).max())
    return Measured(max(off, orbit.liouville_error), f"{orbit.impacts} impacts")


CASES = (
    Case(
        SUBJECT,
        "period with 12 impacts",
        "short contacts, ever slower ones",
        ORIGIN,
        JACOBIAN,
        PROMISE,
        partial(chatter_error, 0.4),
    ),
    Case(
        SUBJECT,
        "orbit with more than 50 impacts",
        "short contacts, ever slower ones; errors grow four thousand times on the way",
        ORIGIN + ", Newton step",
        STATE,
        PROMISE,
        chatter_orbit_error,
        quick=False,
    ),
    Case(
        SUBJECT,
        "two stops at one place",
        "they open and close at the same instant",
        "one stop of the summed stiffness",
        JACOBIAN,
        PROMISE,
        halves_error,
    ),
    *(
        Case(
            SUBJECT,
            f"more than 100 impacts on {where}",
            "chatter against several stops that are hit at the same instant",
            reference,
            STATE,
            PROMISE,
            partial(measure, 0.2),
            quick=False,
        )
        for where, reference, measure in (
            ("two stops at one place", "one stop of the summed stiffness", chattering_halves_error),
            ("two equal structures", "one of them", chattering_twins_error),
        )
    ),
    Case(
        SUBJECT,
        "two equal masses side by side",
        "their stops open and close at the same instant, their frequencies are equal",
        "one of them",
        JACOBIAN,
        PROMISE,
        twins_error,
    ),
    Case(
        SUBJECT,
        "stops on both sides without a gap",
        "one opens at the instant at which the other closes",
        "the motion is symmetric; Liouville's formula",
        STATE,
        PROMISE,
        mirrored_error,
    ),
    *(
        Case(
            SUBJECT,
            f"rest under preload, {stiffness:.0e} N/m^1.5, gap {gap:g} m",
            "contact without end, no force",
            "closed form: balance of forces and the stiffness there",
            JACOBIAN,
            PROMISE,
            partial(preload_error, stiffness, gap),
        )
        for stiffness, gap in ((1e6, -1e-3), (1e9, -1e-3), (1e9, -1.0), (1e6, -1e-9))
    ),
    *(
        Case(
            SUBJECT,
            f"shaken under preload, {stiffness:.0e} N/m^1.5",
            "contact that lasts through the period",
            ORIGIN,
            JACOBIAN,
            PROMISE,
            partial(held_error, stiffness),
        )
        for stiffness in (1e4, 1e6, 1e8)
    ),
    Case(
        SUBJECT,
        "linear stop that never opens",
        "contact that lasts through the period",
        "closed form: the linear response",
        STATE,
        PROMISE,
        linear_hold_error,
    ),
    *(
        Case(
            SUBJECT,
            f"stop that is never reached, gap {gap:g} m",
            "nothing may come of it",
            "closed form: the linear response",
            STATE,
            PROMISE,
            partial(unreached_error, gap),
        )
        for gap in (1e-2, 1e12)
    ),
)
