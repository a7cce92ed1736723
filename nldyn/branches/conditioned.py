"""Branches and curves of orbits that meet a condition: where they begin."""

from __future__ import annotations

import numpy as np

from nldyn.base.errors import ConvergenceError
from nldyn.bifurcations.point import BranchNode, node_of
from nldyn.orbits.bordered import Condition, OrbitFamily, correct, gradient, tangent_surface
from nldyn.orbits.orbit import Orbit

CROSSES_END = 1e-3  # component of a unit tangent that leads to or from the end of a range


def start_on(family: OrbitFamily, orbit: Orbit, condition: Condition) -> BranchNode:
    """First point of a curve, heading up in its first parameter.

    Raises
    ------
    ConvergenceError
        If the orbit that meets the condition is not found beside a given one.
    SystemModelError
        If it lies outside the ranges.
    """
    guess = family.unknowns(orbit)
    first = family.n_states
    at = family.at(guess)
    _, surface = tangent_surface(at)
    by_surface = gradient(at, surface, condition)
    along = surface @ np.linalg.svd(by_surface)[2][-1] if by_surface.size else surface[:, 0]
    row = family.metric(guess) * along
    for place, chart in enumerate(family.charts, first):
        at_end = chart.value(float(guess[place])) in (chart.low, chart.high)
        if at_end and abs(along[place]) > CROSSES_END * np.linalg.norm(along):
            row = np.zeros(guess.size)  # held there, as behind it there may be no system
            row[place] = 1.0
    row /= np.linalg.norm(row)
    found = correct(family, guess, condition, row, float(row @ guess))
    if not found.converged:
        raise ConvergenceError(
            f"the start of the curve at {orbit.frequency_hz:g} Hz was not found: {found.failure}"
        )
    for chart, value in zip(family.charts, found.at.values.tolist(), strict=True):
        chart.check_start(value)
    up = np.zeros(guess.size)
    up[first] = 1.0
    return node_of(found, up, 0.0)
