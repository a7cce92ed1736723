"""Orbits run through several times."""

from __future__ import annotations

import numpy as np

from nldyn import Orbit
from nldyn.orbits.newton import refine
from nldyn.orbits.shooting import shooting_problem


def run_through(orbit: Orbit, times: int) -> Orbit:
    """The same orbit as one of a multiple of its period."""
    base = orbit.problem
    problem = shooting_problem(base.flow, times * base.period, times * base.segments)
    nodes = np.tile(base.nodes(orbit.point), (times, 1))
    return refine(problem, nodes, orbit.omega, orbit.observe)
