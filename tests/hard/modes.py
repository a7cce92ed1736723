"""Many modes: far apart, close together, free, and hardly separable."""

from __future__ import annotations

import math
import warnings
from functools import partial

import numpy as np
from bench.exact import ExactFlow, Precision

from hard.case import Case, Measured
from hard.multiprecision import (
    DIGITS,
    JACOBIAN,
    ORIGIN,
    PROMISE,
    STATE,
    in_coordinates,
    mp,
    orbit_flow_error,
    relative,
)
from nldyn.longterm.impacts import impacts
from nldyn.longterm.simulation import simulate
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.solve import solve_orbit
from nldyn.orbits.starts import find_orbits
from nldyn.system.loads import HarmonicForce
from nldyn.system.springs_dampers import Damper
from nldyn.system.stop import Stop
from nldyn.system.system import System

SUBJECT = "modes"
FORCE = HarmonicForce("m", 1.0)
MORE = Precision(50, 40, 24)  # near a defective matrix half of them are lost


def spread_error() -> Measured:
    """Four modes from 1 Hz to 1e5 Hz."""
    system = System.from_modal(
        [1.0, 50.0, 3000.0, 1e5],
        {"m": [1.0, 1.0, 1.0, 1.0]},
        modal_damping=0.05,
        stops=[Stop("m", 1e11)],
        excitation=[FORCE],
    )
    return orbit_flow_error(solve_orbit(system, 1.7, seconds=600.0), Precision(24, 30, 16))


def close_system(detuning: float) -> System:
    """Three modes, two of which have nearly or exactly the same frequency."""
    return System.from_modal(
        [10.0, 10.0 * (1.0 + detuning), 31.0],
        {"m": [1.0, 0.7, 0.5]},
        modal_damping=0.01,
        stops=[Stop("m", 1e9)],
        excitation=[FORCE],
    )


def close_error(detuning: float) -> Measured:
    """Flow on an orbit of modes that are close together."""
    return orbit_flow_error(solve_orbit(close_system(detuning), 13.0))


def repeated_error() -> Measured:
    """Orbit and multipliers of a repeated frequency against those of one mode in its place.

    In the plane of two modes of one frequency only the direction (1, 0.7) is seen by the
    interface; the other one vibrates by itself.
    """
    orbit = solve_orbit(close_system(0.0), 13.0)
    single = System.from_modal(
        [10.0, 31.0],
        {"m": [math.hypot(1.0, 0.7), 0.5]},
        modal_damping=0.01,
        stops=[Stop("m", 1e9)],
        excitation=[FORCE],
    )
    other = solve_orbit(single, 13.0)
    own = 2.0 * math.pi * 10.0 * complex(-0.01, math.sqrt(1.0 - 0.01**2))
    alone = np.exp(own / 13.0)
    expected = [*other.multipliers, alone, alone.conjugate()]
    off = max(min(abs(mu - e) for mu in orbit.multipliers) for e in expected)
    height = abs(orbit.max_abs_displacement / other.max_abs_displacement - 1.0)
    return Measured(max(off, height), f"multipliers {off:.1e}, amplitude {height:.1e}")


def bouncing_error() -> Measured:
    """A free body between two stops: time of a thousand impacts.

    Both stops are hit at one speed v and 2 mm apart; a round takes 2 (2 mm / v + duration).
    """
    stops = [Stop("m", 1e9, gap=1e-3), Stop("m", 1e9, gap=1e-3, direction=-1)]
    system = System.from_modal([0.0], {"m": [1.0]}, stops=stops)
    found = impacts(simulate(system, 50.0, 1100, start=np.array([0.0, 0.1])))
    depth = (1.25 * 0.1**2 / 1e9) ** 0.4
    last = 2.0 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9) * depth / 0.1
    count = 1000
    exact = count * (2e-3 / 0.1 + last)
    off = abs((found.time[count] - found.time[0]) / exact - 1.0)
    return Measured(float(off), f"{len(found)} impacts in {simulated(found.time)}")


def simulated(time: np.ndarray) -> str:
    """How long a motion lasted, in words."""
    return f"{time[-1]:.0f} s"


def symmetric_orbit() -> Orbit:
    """A free body with one flexible mode that hits stops on either side in turn."""
    stops = [Stop("m", 1e6, gap=1e-3), Stop("m", 1e6, gap=1e-3, direction=-1)]
    system = System.from_modal(
        [0.0, 40.0],
        {"m": [1.0, 0.3]},
        modal_damping=[0.0, 0.05],
        dampers=[Damper("m", 10.0)],
        stops=stops,
        excitation=[FORCE],
    )
    turned = np.array([0.0, math.pi])
    found = [orbit for orbit in find_orbits(system, 3.0, 1) if orbit.impacts == 2]
    return min(found, key=lambda orbit: float(np.abs(orbit.states(turned).sum(axis=0)).max()))


def free_body_error() -> Measured:
    """Half a period of a forced free body, in which it hits the first stop alone."""
    orbit = symmetric_orbit()
    flow, start = orbit.problem.flow, orbit.states(np.array([0.0]))[0]
    system = orbit.system
    one_stop = System(
        system.natural_frequencies,
        system.damping,
        system.participation,
        system.stops[:1],
        system.dampers,
        system.excitation,
    )
    half = ExactFlow(one_stop, orbit.omega, DIGITS)
    half.T = mp.pi / mp.mpf(orbit.omega)
    exact = half.period(start)
    found = flow.shoot(flow.to_state(start)[None], np.array([0.0, np.pi]), orbit.omega)
    state, jacobian = in_coordinates(flow, exact)
    off = relative(found.ends[0], state), relative(found.jacobians[0], jacobian)
    mirrored = relative(state, -flow.to_state(start))
    note = f"state {off[0]:.1e}, Jacobian {off[1]:.1e}; half a period mirrors it to {mirrored:.1e}"
    return Measured(max(10.0 * off[0], off[1], 10.0 * mirrored), note)


def nearly_defective(distance: float) -> System:
    """Two modes that a damper makes coincide at distance 0, and a third one.

    With frequencies W/√r and W√r (squares W²/r, W²r) and a damper on (1, √r), the eigenvalues λ
    obey s² + c(1 + r)s + W²(r + 1/r - 2) = 0 with s = λ + W²/λ, since the equation is the same for
    W²/λ. s is double, and so are the λ, where c = 2W(r - 1)/(√r (1 + r)).
    """
    hz, r = 10.0, 1.1
    critical = 4.0 * math.pi * hz * (r - 1.0) / (math.sqrt(r) * (1.0 + r))
    return System.from_modal(
        [hz / math.sqrt(r), hz * math.sqrt(r), 31.0],
        {"m": [1.0, 0.5, 0.3], "d": [1.0, math.sqrt(r), 0.0]},
        dampers=[Damper("d", critical * (1.0 + distance))],
        stops=[Stop("m", 1e9)],
        excitation=[FORCE],
    )


def defective_error(distance: float) -> Measured:
    """Flow on an orbit of modes that damping makes hardly separable, or not at all."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that a frequency is moved: the error has its share
        system = nearly_defective(distance)
    found = orbit_flow_error(solve_orbit(system, 13.0), MORE)
    return Measured(found.error, f"{found.note}, condition {system.linear.condition:.0e}")


CASES = (
    Case(
        SUBJECT,
        "frequencies of 1, 50, 3000 and 1e5 Hz",
        "30 periods of the fastest mode in a contact, 6e4 in a period",
        ORIGIN,
        JACOBIAN,
        PROMISE,
        spread_error,
        quick=False,
    ),
    *(
        Case(
            SUBJECT,
            f"two frequencies {detuning:g} apart" if detuning else "two equal frequencies",
            "eigenvectors are hardly determined" if detuning else "they are not determined",
            ORIGIN,
            JACOBIAN,
            PROMISE,
            partial(close_error, detuning),
        )
        for detuning in (1e-3, 1e-9, 1e-14, 0.0)
    ),
    Case(
        SUBJECT,
        "two equal frequencies, orbit and multipliers",
        "one direction is not seen by the interface",
        "one mode in their place, and a free vibration in closed form",
        JACOBIAN,
        PROMISE,
        repeated_error,
    ),
    Case(
        SUBJECT,
        "free body between two stops, a thousand impacts",
        "a frequency of zero, no damping, no force",
        "closed form: uniform motion and Hertz's duration",
        STATE,
        PROMISE,
        bouncing_error,
    ),
    Case(
        SUBJECT,
        "forced free body between two stops",
        "a frequency of zero; nothing but the stops holds it",
        ORIGIN + "; over half a period, after which it is mirrored",
        JACOBIAN,
        PROMISE,
        free_body_error,
    ),
    *(
        Case(
            SUBJECT,
            f"damper {distance:g} from a defective eigenproblem",
            "two planes of eigenvectors coincide",
            ORIGIN,
            JACOBIAN,
            PROMISE,
            partial(defective_error, distance),
        )
        for distance in (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 0.0)
    ),
)
