"""How a branch goes on behind a grazing of a rigid stop.

Two families meet there, one with the slight impact and one without; each begins in proportion to
the speed of the impact, or to the miss (Nordmark 1991; di Bernardo, Budd, Champneys and Kowalczyk
2008, *Piecewise-smooth Dynamical Systems*, ch. 6).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nldyn.base.errors import ConvergenceError, SystemModelError
from nldyn.bifurcations.point import BranchNode
from nldyn.bifurcations.rigid_touch import Touch
from nldyn.bifurcations.sign_changes import accounted
from nldyn.bifurcations.touching import rigid_grazing, rigid_touches
from nldyn.orbits.bordered import length_unit
from nldyn.orbits.conditions import Grazing
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import FROM_NEAR, metric_length

SLIGHT = 1e-5, 1e-4, 1e-3  # first impacts and misses looked for, depth over the orbit's size
AS_ASKED = 0.1  # relative difference of the depth found from it
LIMITS = 10.0  # over the largest multiplier: how far others may be from their limits at grazing
PROPORTIONAL = 0.2  # most by which the way from the grazing is not in proportion to the depth


def beyond_rigid_grazing(at: BranchNode, before: Orbit) -> BranchNode | None:
    """First point of a branch behind a grazing.

    If the orbits before have the slight impact, those behind are without it, and the other way
    round. They are of the branch if they come from the grazing in proportion to impact or miss.

    Parameters
    ----------
    at : BranchNode
        The grazing.
    before : Orbit
        An orbit right before it.

    Returns
    -------
    BranchNode or None
        Heading away from the grazing; None if there is no such orbit, or more than one touch.
    """
    exact, grazed = at.orbit, rigid_grazing(before)
    if grazed is None or _slight_touches(exact) != 1:
        return None
    try:
        touch = Touch.of(exact, Grazing.of(exact))
        for share in SLIGHT:
            found = _beside(exact, touch, share, impact=grazed[2] < 0.0)
            if found is not None:
                weights = exact.problem.metric(exact.point)
                way = metric_length(weights, found.orbit.point - exact.point)
                return replace(found, arclength=at.arclength + way)
    except (ConvergenceError, SystemModelError, np.linalg.LinAlgError):
        pass
    return None


def crosses_beside(at: Orbit, beside: Orbit) -> bool:
    """Whether a multiplier crosses, or may cross, the unit circle from a grazing to an orbit by it.

    Without the slight impact multipliers change steadily. With it the largest tends to infinity as
    the inverse of its speed, and the others to limits by as little as the speed; that of a single
    mode to zero, as the product of both is fixed.
    """
    grazed = rigid_grazing(beside)
    if grazed is None or grazed[2] < 0.0:
        return not accounted(at, [], beside)
    *others, largest = np.sort(np.abs(beside.multipliers))
    near = LIMITS / largest if len(others) > 1 else 0.0
    return bool(largest <= 1.0 or np.any(np.abs(np.array(others) - 1.0) < near))


def _slight_touches(orbit: Orbit) -> int:
    """How many impacts and near misses of rigid stops are as slight as those looked for."""
    least = SLIGHT[0] * length_unit(orbit)
    return sum(abs(depth) < least for _, _, depth in rigid_touches(orbit))


def _beside(exact: Orbit, touch: Touch, share: float, impact: bool) -> BranchNode | None:
    """The orbit whose impact or miss is a share of the grazing's size, heading away from it."""
    depth = share * length_unit(exact)
    places = []
    for size in (0.5 * depth, depth):
        speed, clearance = (size * touch.omega, 0.0) if impact else (0.0, size)
        places.append(touch.moved(speed, clearance).unknowns(speed))
    problem = exact.problem
    weights = problem.metric(exact.point)
    near, far = (place - exact.point for place in places)
    if metric_length(weights, far - 2.0 * near) > PROPORTIONAL * metric_length(weights, far):
        return None
    by_frequency = np.zeros(exact.point.size)
    by_frequency[-1] = 1.0
    found = problem.correct(
        places[1], by_frequency, longest=AS_ASKED * metric_length(weights, far),
        max_iterations=FROM_NEAR,
    )  # fmt: skip
    if not found.converged:
        return None
    orbit = Orbit.of(problem, found, exact.observe)
    grazed = rigid_grazing(orbit)
    if grazed is None or abs(grazed[2] - (depth if impact else -depth)) > AS_ASKED * depth:
        return None
    return BranchNode(orbit, problem.tangent(found, far), 0.0)
