"""What slight impacts make of an orbit that grazes a rigid stop: the map with a root.

Where the motion would rise h beyond the stop it hits it with v = √(2 a h), a the deceleration at
the touch, and leaves it with (1 + e) v less. Over a period that is z ↦ A z - (1 + e) v A b, with
the Jacobian A without the impact and the change b of the state by an impulse that gives the gap
the speed 1. With the row c of the penetration, its height h after k periods changes by
-(1 + e) v c Aᵏ b.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from nldyn.base.arrays import Real
from nldyn.bifurcations.normal_form_coefficients import CoefficientError
from nldyn.bifurcations.rigid_touch import Touch
from nldyn.orbits.conditions import Grazing
from nldyn.orbits.orbit import Orbit

SLIGHT = 1e-12  # speed in m/s at which restitution is that of the slightest impact
FORGOTTEN = 1e-6  # share of a kick that is none
MOST_PERIODS = 1000  # in which it is looked for


@dataclass(frozen=True)
class RigidGrazing:
    """The normal form of a grazing.

    Parameters
    ----------
    growth : float
        Multiplier times speed v of the orbit with one impact per period as v goes to zero, in m/s:
        -(1 + e) a c A b.
    speed_change : float
        dv/d ln ω of that orbit in m/s, d' / ((1 + e) c (1 - A)⁻¹ A b), where d' is that of the
        highest point without the impact: it exists where v > 0.
    height_change : float
        d' in m: without impacts the orbit exists where that has led below the stop.
    lowers : bool
        Whether an impact lowers the motion in each of the following periods: all c Aᵏ b > 0.

    References
    ----------
    A. B. Nordmark (1991), *J. Sound Vib.* 145, 279-297; M. H. Fredriksson and A. B. Nordmark
    (1997), *Proc. R. Soc. A* 453, 1261-1276.
    """

    growth: float
    speed_change: float
    height_change: float
    lowers: bool


def rigid_grazing_form(orbit: Orbit, grazing: Grazing) -> RigidGrazing:
    """Normal form of an orbit that grazes a rigid stop.

    Raises
    ------
    CoefficientError
        If it does not graze, or the flow map fails.
    ConvergenceError, SystemModelError
        The same.
    """
    touch = Touch.of(orbit, grazing)
    state, phase, omega, kick = touch.state, touch.phase, touch.omega, touch.kick
    flow = orbit.problem.flow
    row, rate = flow.rows[grazing.stop], flow.rate_rows[grazing.stop]
    around = touch.shoot(state, phase, phase + 2.0 * math.pi * orbit.period)
    jacobian, deceleration = around.jacobians[0], -omega * float(rate @ touch.rate(state, phase))
    if not deceleration > 0.0:
        raise CoefficientError("the motion does not turn at the stop")
    loss = touch.loss(SLIGHT)
    ways = np.linalg.solve(np.eye(len(row)) - jacobian, np.column_stack(
        [jacobian @ kick, omega * around.d_omega[0]]
    ))  # fmt: skip
    first, height_change = row @ ways
    if first == 0.0:
        raise CoefficientError("an impact leaves no trace over a period")
    return RigidGrazing(
        growth=float(-loss * deceleration * (row @ jacobian @ kick)),
        speed_change=float(height_change / (loss * first)),
        height_change=float(height_change),
        lowers=_lowers(jacobian, row, kick),
    )


def _lowers(jacobian: Real, row: Real, kick: Real) -> bool:
    """Whether all effects of a kick on a penetration, period after period, are positive."""
    effect, largest = kick, 0.0
    for _ in range(MOST_PERIODS):
        effect = jacobian @ effect
        size = float(np.abs(row) @ np.abs(effect))
        largest = max(largest, size)
        if size <= FORGOTTEN * largest:
            return True
        if row @ effect <= 0.0:
            return False
    return True
