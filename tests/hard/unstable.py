"""Very unstable orbits: long period multiples in a chaotic range."""

from __future__ import annotations

import math
from functools import cache, partial

import numpy as np
from bench.exact import Precision

from hard.case import Case, Measured
from hard.multiprecision import JACOBIAN, ORIGIN, ExactOrbit, exact_orbit
from hard.stiffness import beam_with_stop
from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.newton import refine
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import ShootingProblem, shooting_problem

SUBJECT = "unstable orbits"
HZ = 36.0  # the 1-DOF model is chaotic there
OMEGA = 2.0 * math.pi * HZ
RECORDED = 20_000
DIGITS = Precision(26, 32, 18)
# period multiples, with at least which multiplier, and whether the tests have the time
WANTED = ((30, 1e6, True), (80, 1e12, False), (110, 1e16, False))


@cache
def chaotic_states() -> Real:
    """States z at every half period of a chaotic motion of the 1-DOF model."""
    flow = FlowMap(beam_with_stop(5.17e9))
    start: Real = flow.strobe(np.zeros(2), OMEGA, 300).ends[-1]
    phases: Real = np.linspace(0.0, 2.0 * np.pi * RECORDED, 2 * RECORDED + 1)
    found = flow.shoot(start[None], phases, OMEGA, sensitivities=False, chained=True)
    return np.vstack([start[None], found.ends])


@cache
def unstable_orbit(period: int, multiplier: float) -> Orbit:
    """The first orbit of a period, from the closest returns on, with so large a multiplier."""
    problem = shooting_problem(FlowMap(beam_with_stop(5.17e9)), period)
    states = chaotic_states()
    strobe = states[::2]
    distance = np.linalg.norm(strobe[period:] - strobe[:-period], axis=1)
    for index in np.argsort(distance, kind="stable")[:400]:
        nodes = states[2 * index : 2 * (index + period)]
        try:
            orbit = refine(problem, nodes, OMEGA, "middle")
        except ConvergenceError:
            continue
        if abs(orbit.multipliers[0]) >= multiplier and is_primitive(orbit):
            return orbit
    raise ConvergenceError(f"no orbit of period {period} with a multiplier of {multiplier:.0e}")


def is_primitive(orbit: Orbit) -> bool:
    """Whether an orbit does not repeat after a part of its period."""
    strobe = orbit.problem.nodes(orbit.point)[::2]
    size = float(np.linalg.norm(strobe))
    parts = [m for m in range(1, orbit.period) if orbit.period % m == 0]
    return all(np.linalg.norm(np.roll(strobe, m, axis=0) - strobe) > 1e-6 * size for m in parts)


@cache
def reference(period: int, multiplier: float) -> ExactOrbit:
    """The orbit in multiple precision."""
    return exact_orbit(unstable_orbit(period, multiplier), DIGITS)


def orbit_error(period: int, multiplier: float) -> Measured:
    """Distance of the orbit from the exact one."""
    exact = reference(period, multiplier)
    orbit = unstable_orbit(period, multiplier)
    note = f"multiplier {orbit.multipliers[0].real:.3e}, {orbit.impacts} impacts"
    return Measured(exact.correction, note)


def multiplier_error(period: int, multiplier: float) -> Measured:
    """Error of ln|μ| of both multipliers; the small one by Liouville's formula."""
    exact = reference(period, multiplier)
    orbit = unstable_orbit(period, multiplier)
    large = math.log(abs(complex(exact.multipliers()[0])))
    small = -float(np.trace(orbit.system.total_damping)) * orbit.duration - large
    off = np.abs(orbit.log_moduli - [large, small])
    said = orbit.log_modulus_uncertainties
    note = (
        f"large {off[0]:.1e}, small {off[1]:.1e} of {math.exp(small):.1e}; the program says at "
        f"most {said[0]:.0e} and {said[1]:.0e}"
    )
    return Measured(float(off.max()), note)


def single_shooting(period: int, multiplier: float) -> Measured:
    """Newton step of multiple shooting from the same chaotic motion, where single shooting fails.

    Both start from the states of the close return. The error is infinite where multiple shooting
    fails, and where single shooting does not: then the case would show nothing.
    """
    orbit = unstable_orbit(period, multiplier)
    flow = orbit.problem.flow
    strobe = orbit.problem.nodes(orbit.point)[0]
    guess, row = np.append(strobe, math.log(OMEGA)), np.array([0.0, 0.0, 1.0])
    single = ShootingProblem(flow, period, 1).correct(guess, row, max_iterations=50)
    note = (
        f"single shooting from the orbit itself: {single.failure or 'converged'}, last relative "
        f"step {single.last_step:.0e}"
    )
    return Measured(orbit.error if single.failure else math.inf, note)


CASES = (
    *(
        Case(
            SUBJECT,
            f"period {period} at 36 Hz, multiplier above {multiplier:.0e}",
            "an error of the start grows by the multiplier",
            ORIGIN + ", Newton step",
            1e-9,
            "the promise of the state over one segment (docs/explanation/theory.md)",
            partial(orbit_error, period, multiplier),
            quick,
        )
        for period, multiplier, quick in WANTED
    ),
    *(
        Case(
            SUBJECT,
            f"multipliers of the orbit of period {period}",
            "the product of the segments hides the small multiplier",
            ORIGIN + "; Liouville's formula",
            2 * period * JACOBIAN,
            "of the logarithms: the promise of the Jacobian, added up over the segments",
            partial(multiplier_error, period, multiplier),
            quick,
        )
        for period, multiplier, quick in WANTED
    ),
    *(
        Case(
            SUBJECT,
            f"multiple shooting where single shooting fails, period {period}",
            "single shooting sees nothing but the growth",
            "single shooting from the orbit itself must fail",
            1e-9,
            "last Newton step; the error left is far below it",
            partial(single_shooting, period, multiplier),
            quick,
        )
        for period, multiplier, quick in WANTED[1:]
    ),
)
