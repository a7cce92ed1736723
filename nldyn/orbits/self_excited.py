"""Self-excited motions: what their multipliers are, beside the one along the motion."""

from __future__ import annotations

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError
from nldyn.flow.flow_map import Trajectory
from nldyn.orbits.shooting import ShootingProblem

SAMPLES = 400  # of a recorded motion: beside each extreme there is one
STANDS = 1e-8  # of the orbit's size in 1/ω: a rate of the state that is rounding


def samples(motion: Trajectory) -> Real:
    """States z (SAMPLES, 2n) of a recorded motion at equal steps, in contacts good to 1e-6."""
    return motion.recorded_states(np.linspace(*motion.span, SAMPLES))


def paces(problem: ShootingProblem, point: Real) -> Real:
    """Rates (k, 2n) of the state at the ends of the segments of a free motion, over ω.

    Phases are held while ω changes, so that its derivatives are those by the duration.
    """
    omega = float(np.exp(point[-1]))
    found = problem.flow.shoot(problem.nodes(point), problem.phases, omega)
    if found.failure:
        raise ConvergenceError(found.failure)
    return np.asarray(-omega * found.d_omega / np.diff(problem.phases)[:, None])


def moves(problem: ShootingProblem, point: Real, ends: Real) -> bool:
    """Whether states with these `paces` are no rest."""
    return bool(np.linalg.norm(ends, axis=1).max() > STANDS * problem.scale(point))


def across(jacobians: Real, ends: Real) -> Real:
    """Jacobians (k, 2n - 1, 2n - 1) across a periodic motion, whose `paces` these are.

    The map over a segment takes the pace at its start to that at its end: in bases that begin with
    these the rest of it is a block of its own. So the multiplier 1 along the motion is left out,
    and no other one that is near to it is touched.

    Parameters
    ----------
    jacobians : (k, 2n, 2n) array
        Of the segments.
    ends : (k, 2n) array
        Paces at their ends; none is zero.

    Examples
    --------
    >>> shear = np.array([[[1.0, 5.0], [0.0, 0.25]]])
    >>> across(shear, np.array([[3.0, 0.0]])).tolist()
    [[[0.25]]]
    """
    bases = np.array([np.linalg.qr(pace[:, None], mode="complete")[0][:, 1:] for pace in ends])
    begins = np.roll(bases, 1, axis=0)
    return np.asarray(bases.transpose(0, 2, 1) @ jacobians @ begins)


def along(jacobians: Real, ends: Real) -> float:
    """The multiplier along a periodic motion, 1 but for errors: a check of its Jacobians."""
    carried = ends[-1]
    for jacobian in jacobians:
        carried = jacobian @ carried
    return float(carried @ ends[-1] / (ends[-1] @ ends[-1]))
