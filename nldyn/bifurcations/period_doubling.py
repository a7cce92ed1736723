"""Where a branch of doubled period begins and ends: at flips of the branch that it comes from."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError, LocateError, check_positive, failing_as
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.point import BranchNode, SpecialPoint, check_special, on_branch, place_of
from nldyn.orbits.bordered import FREE, OrbitFamily, Place, Solved, correct
from nldyn.orbits.conditions import nearest_flip
from nldyn.orbits.orbit import minimal_period
from nldyn.orbits.shooting import metric_length

OPPOSITE = 0.8  # cosine from which two differences of halves point opposite ways
MOST_ITERATIONS = 25  # of Newton's method from where two halves agree
SHARES = (1.0, 0.25, 0.05, 0.01, 2e-3, 4e-4)  # of the amplitude, that a branch may need to begin
NEAR_ONE = 0.3  # distance of a multiplier from 1 on a branch that has just begun


def passed_flip(a: Place, b: Place) -> bool:
    """Whether an even-period orbit turned into its own shift: a branch of half the period met.

    At the flip the two halves of the orbit are equal; behind it they have changed places.
    """
    if a.orbit.period % 2:
        return False
    first, second = half_difference(a.family, a.point), half_difference(b.family, b.point)
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
    chord, family = Chord(a, b), a.family
    reference = half_difference(family, a.point)

    def difference(sigma: float) -> float:
        return float(reference @ half_difference(family, chord.between(sigma)))

    sigma = float(brentq(difference, 0.0, 1.0))
    first, second = np.split(chord.between(sigma)[:-1], 2)
    guess = np.append(0.5 * (first + second), chord.between(sigma)[-1])
    held = np.zeros(guess.size)
    held[-1] = 1.0
    found = correct(family.halved, guess, FREE, held, max_iterations=MOST_ITERATIONS)
    if not found.converged:
        raise ConvergenceError(f"no orbit of period {family.halved.period}: {found.failure}")
    single = nearest_flip(found) or found
    length = a.arclength + sigma * (b.arclength - a.arclength)
    return BranchNode.of(twice(single, family), a.tangent, length)


def twice(single: Place, family: OrbitFamily) -> Solved:
    """An orbit run through twice, in a family of twice its period."""
    orbit = single.orbit
    point = np.append(np.tile(single.point[:-1], 2), single.point[-1])
    jacobians = np.concatenate([orbit.jacobians, orbit.jacobians])
    return Solved(family, point, family.at(point).orbit_by(jacobians, orbit.error))


def half_difference(family: OrbitFamily, point: Real) -> Real:
    """First half of the states minus the second: zero for an orbit of half the period."""
    first, second = np.split(point[: family.n_states], 2)
    return np.asarray(first - second)


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
    place = on_branch(special).point
    base, family = place.family, place.family.repeated(2)
    values, vectors = np.linalg.eig(orbit.monodromy)
    v = vectors[:, int(np.argmin(np.abs(values + 1.0)))].real
    at = base.at(place.point)
    modes = [v if at.change is None else at.change[1] @ v]
    for jacobian in at.blocks[:-1]:
        modes.append(jacobian @ modes[-1])
    shape = np.array(modes).ravel()
    direction = np.concatenate([shape, -shape, [0.0]])
    doubled = np.append(np.tile(place.point[:-1], 2), place.point[-1])
    weights = family.metric(doubled)
    direction /= metric_length(weights, direction)
    row = weights * direction
    first: BranchNode | None = None
    for share in SHARES:
        size = share * amplitude
        found = correct(family, doubled + size * direction, FREE, row / np.linalg.norm(row))
        if found.converged:
            twin = found.orbit
            if minimal_period(twin) < family.period:
                continue
            first = BranchNode.of(found, found.tangent(direction), 0.0)
            near = np.abs(twin.multipliers - 1.0).min() < NEAR_ONE
            if twin.impacts == 2 * orbit.impacts and near:
                break
    if first is not None:
        return first
    raise LocateError(
        f"no orbit of period {family.period} found beside the flip at {place_of(place)}: "
        f"{found.failure or 'only such of a shorter period'}"
    )
