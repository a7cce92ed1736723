"""Where a branch of doubled period begins and ends: at flips of the branch that it comes from."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from nldyn.base.arrays import Real
from nldyn.base.errors import LocateError, check_positive, failing_as
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.point import BranchNode, SpecialPoint, check_special
from nldyn.orbits.conditions import nearest_flip
from nldyn.orbits.newton import refine
from nldyn.orbits.orbit import Orbit, minimal_period
from nldyn.orbits.shooting import ShootingProblem, metric_length

OPPOSITE = 0.8  # cosine from which two differences of halves point opposite ways
SHARES = (1.0, 0.25, 0.05, 0.01, 2e-3, 4e-4)  # of the amplitude, that a branch may need to begin
NEAR_ONE = 0.3  # distance of a multiplier from 1 on a branch that has just begun


def passed_flip(a: Orbit, b: Orbit) -> bool:
    """Whether an even-period orbit turned into its own shift: a branch of half the period met.

    At the flip the two halves of the orbit are equal; behind it they have changed places.
    """
    if a.period % 2:
        return False
    first = half_difference(a.problem, a.point)
    second = half_difference(b.problem, b.point)
    product = float(first @ second)
    return product < -OPPOSITE * float(np.linalg.norm(first) * np.linalg.norm(second))


def flip_between(a: BranchNode, b: BranchNode) -> BranchNode:
    """The orbit of half the period near the flip between a and b, run through twice.

    The shooting equations of the doubled branch are singular at the flip, so the point where the
    halves agree is interpolated and solved as an orbit of half the period; from there Newton's
    method goes to the flip, unless it fails.

    Raises
    ------
    ConvergenceError
        If Newton's method finds no such orbit.
    """
    chord = Chord(a, b)
    problem = a.orbit.problem
    reference = half_difference(problem, a.orbit.point)

    def difference(sigma: float) -> float:
        return float(reference @ half_difference(problem, chord.between(sigma)))

    sigma = float(brentq(difference, 0.0, 1.0))
    point = chord.between(sigma)
    nodes = problem.nodes(point)
    half = nodes.shape[0] // 2
    single = ShootingProblem(problem.flow, problem.period // 2, half)
    mean = 0.5 * (nodes[:half] + nodes[half:])
    orbit = refine(single, mean, float(np.exp(point[-1])), a.orbit.observe)
    orbit = nearest_flip(orbit) or orbit
    states = np.tile(single.nodes(orbit.point), (2, 1)).ravel()
    doubled = Orbit(
        problem,
        np.append(states, orbit.point[-1]),
        np.concatenate([orbit.jacobians, orbit.jacobians]),
        orbit.error,
        orbit.observe,
    )
    return BranchNode(doubled, a.tangent, a.arclength + sigma * (b.arclength - a.arclength))


def half_difference(problem: ShootingProblem, point: Real) -> Real:
    """First half of the states minus the second: zero for an orbit of half the period."""
    nodes = problem.nodes(point)
    half = nodes.shape[0] // 2
    return (nodes[:half] - nodes[half:]).ravel()


def switch_at_flip(special: SpecialPoint, amplitude: float = 0.02) -> BranchNode:
    """First point of the doubled branch at a flip, heading away from it.

    Parameters
    ----------
    special : SpecialPoint
        A flip (PD).
    amplitude : float
        Relative size of the first step off the branch; smaller ones are tried until no contact has
        changed and the multiplier that was (-1)² at the flip is still near 1.

    Returns
    -------
    BranchNode
        An orbit of twice the period.

    Raises
    ------
    SystemModelError
        If the special point is not a flip, or the amplitude not positive.
    LocateError
        If no orbit of twice the period is found.
    """
    check_special("switch_at_flip", special, "PD", of_branch=False)
    check_positive("amplitude", amplitude)
    with failing_as(LocateError):
        return _beside_flip(special, amplitude)


def _beside_flip(special: SpecialPoint, amplitude: float) -> BranchNode:
    """The first point of the doubled branch that Newton's method finds."""
    orbit = special.orbit
    base = orbit.problem
    problem = ShootingProblem(base.flow, 2 * base.period, 2 * base.segments)
    values, vectors = np.linalg.eig(orbit.monodromy)
    v = vectors[:, int(np.argmin(np.abs(values + 1.0)))].real
    jacobians = base.flow.shoot(base.nodes(orbit.point), base.phases, orbit.omega).jacobians
    modes = [v]
    for jacobian in jacobians[:-1]:
        modes.append(jacobian @ modes[-1])
    shape = np.array(modes)
    direction = np.append(np.concatenate([shape, -shape]).ravel(), 0.0)
    nodes = base.nodes(orbit.point)
    doubled = np.append(np.concatenate([nodes, nodes]).ravel(), orbit.point[-1])
    weights = problem.metric(doubled)
    direction /= metric_length(weights, direction)
    row = weights * direction
    first: BranchNode | None = None
    for share in SHARES:
        size = share * amplitude
        found = problem.correct(doubled + size * direction, row / np.linalg.norm(row))
        if found.converged:
            twin = Orbit.of(problem, found, orbit.observe)
            if minimal_period(twin) < problem.period:
                continue
            first = BranchNode(twin, problem.tangent(found, direction), 0.0)
            near = np.abs(twin.multipliers - 1.0).min() < NEAR_ONE
            if twin.impacts == 2 * orbit.impacts and near:
                break
    if first is not None:
        return first
    raise LocateError(
        f"no orbit of period {problem.period} found beside the flip at "
        f"{orbit.frequency_hz:.6g} Hz: {found.failure or 'only such of a shorter period'}"
    )
