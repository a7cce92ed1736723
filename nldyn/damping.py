"""Orbits at another damping."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from nldyn.errors import SystemModelError
from nldyn.flow import FlowMap
from nldyn.linear import Real
from nldyn.orbit import ConvergenceError, Orbit, minimal_period, solve_orbit

FIRST_STEP, SHORTEST_STEP = 0.25, 1e-3  # in the logarithm of the damping
LONGER, SHORTER = 1.5, 0.4  # the next step, after one that led on and one that did not
MISS = 0.3  # of an orbit: distance from where it was expected


def damped(own: FlowMap, log_factor: float) -> FlowMap:
    """The flow map of a system where its modal damping is multiplied by e^log_factor."""
    if log_factor == 0.0:
        return own
    system = replace(own.system, damping=math.exp(log_factor) * own.system.damping)
    return FlowMap(system, own.options)


def carried(own: FlowMap, orbit: Orbit, start: float, end: float) -> Orbit | None:
    """The orbit of the same frequency at another damping, or None where the way there ends.

    It ends at a fold, as a rule. Start and end are logarithms of the factor of the damping of a
    flow map. Newton's method starts from the line through the two orbits before.
    """
    x, step = start, math.copysign(FIRST_STEP, end - start)
    here = _states(orbit)
    slope = np.zeros_like(here)
    while x != end:
        y = x + step if abs(step) < abs(end - x) else end
        guess = here + slope * (y - x)
        found = _near(own, y, orbit, guess)
        if found is None:
            step *= SHORTER
            if abs(step) < SHORTEST_STEP:
                return None
            continue
        states = _states(found)
        slope = (states - here) / (y - x)
        orbit, here, x = found, states, y
        step *= LONGER
    return orbit


def _near(own: FlowMap, log_factor: float, orbit: Orbit, guess: Real) -> Orbit | None:
    """The orbit near a guess at another damping, if it is of the same period."""
    try:
        found = solve_orbit(
            damped(own, log_factor),
            orbit.frequency_hz,
            orbit.period,
            guess=guess,
            observe=orbit.observe,
            segments=orbit.problem.segments,
        )
        states = _states(found)
    except (ConvergenceError, SystemModelError):
        return None
    far = float(np.linalg.norm(states - guess)) > MISS * float(np.linalg.norm(states))
    return None if far or minimal_period(found) != orbit.period else found


def _states(orbit: Orbit) -> Real:
    """States (k, 2n) at the shooting phases, in coordinates that do not depend on the damping."""
    return orbit.states(orbit.problem.phases[:-1])
