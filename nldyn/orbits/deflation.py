"""Newton's method with the orbits that are known divided out."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from nldyn.base.arrays import TINY, Real
from nldyn.base.errors import FAILURES
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.newton import refine, spread
from nldyn.orbits.orbit import Orbit, minimal_period, same_orbit
from nldyn.orbits.shooting import shifts, shooting_problem
from nldyn.orbits.starts import GUESS_ITERATIONS

LONGEST = 0.5  # step of an iteration, relative to the orbit
ITERATIONS = 20
FOUND, WITHIN = 1e-4, 0.1  # last step, over the orbit's size and the way to the nearest known one


def deflated_orbit(
    flow: FlowMap, start: Real, period: int, omega: float, known: Sequence[Orbit], observe: str
) -> Orbit | None:
    """Orbit other than the known ones, by Newton's method on the deflated equations.

    The equations are multiplied by ∏ (1/|x - xᵢ|² + 1) over the known orbits and their shifts, so
    that Newton's steps are only stretched [Farrell, Birkisson and Funke 2015, section 2]; long
    steps are shortened.
    """
    problem = shooting_problem(flow, period)
    try:
        point = np.append(spread(problem, start, omega).ravel(), math.log(omega))
    except FAILURES:
        return None
    row = np.zeros(point.size)
    row[-1] = 1.0
    repelled = [x[:-1] for orbit in known for x in shifts(problem, orbit.point)]
    for _ in range(ITERATIONS):
        step = problem.correct(point, row, max_iterations=1).point - point
        size = problem.scale(point) * math.sqrt(problem.segments)
        length = float(np.linalg.norm(step)) / size
        if not math.isfinite(length):
            return None
        away = min((float(np.linalg.norm(point[:-1] - x)) / size for x in repelled), default=1.0)
        if length == 0.0 or length < min(FOUND, WITHIN * away):
            break
        stretch = _stretch(point[:-1], step[:-1], repelled, size)
        point = point + step * math.copysign(min(abs(stretch), LONGEST / length), stretch)
    else:
        return None
    try:
        orbit = refine(problem, problem.nodes(point), omega, observe, GUESS_ITERATIONS)
    except FAILURES:
        return None
    if minimal_period(orbit) < period or any(same_orbit(orbit, other) for other in known):
        return None
    return orbit


def _stretch(x: Real, step: Real, repelled: Sequence[Real], size: float) -> float:
    """Factor 1/(1 - m'·step/m) of a Newton step, m being the product that repels."""
    slope = 0.0
    for other in repelled:
        away = (x - other) / size
        square = float(away @ away) or TINY
        slope += -2.0 * float(away @ step) / size / (square * (1.0 + square))
    return 1.0 / (1.0 - slope) if slope != 1.0 else 1.0
