"""What slight impacts make of an orbit that grazes rigid stops: the map with a root.

Where the motion would rise h beyond the stop it hits it with v = √(2 a h), a the deceleration at
the touch, and leaves it with (1 + e) v less. Over a period that is z ↦ A z - (1 + e) v A b, with
the Jacobian A without the impact and the change b of the state by an impulse that gives the gap
the speed 1. With the row c of the penetration, its height h after k periods changes by
-(1 + e) v c Aᵏ b.

Of an orbit that grazes in several touches at once the same holds from each to the next. To first
order its heights go with the parameter x and with the speeds of the impacts; each touch either has
an impact and no height, or a miss and no speed: a linear complementarity problem.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from nldyn.base.arrays import Real
from nldyn.bifurcations.normal_form_coefficients import CoefficientError
from nldyn.bifurcations.rigid_touch import Touches

SLIGHT = 1e-12  # speed in m/s at which restitution is that of the slightest impact
FORGOTTEN = 1e-6  # share of a kick that is none
MOST_PERIODS = 1000  # in which it is looked for
MOST_TOUCHES = 10  # of which all mixtures of impacts and misses are looked at


@dataclass(frozen=True)
class Beside:
    """Orbits that begin at a grazing, with impacts at some of its touches and misses at the others.

    Parameters
    ----------
    hits : tuple of bool
        Which touches are impacts.
    side : int
        +1 if they exist above the parameter of the grazing, -1 below.
    amounts : tuple of float
        Speeds of the impacts in m/s and clearances of the misses in m, over the distance in
        the parameter's coordinate: the logarithm, if it is the frequency.
    """

    hits: tuple[bool, ...]
    side: int
    amounts: tuple[float, ...]


def turned(hits: tuple[bool, ...], by: int) -> tuple[bool, ...]:
    """Touches in the order of time, beginning with another one."""
    return hits[by:] + hits[:by]


@dataclass(frozen=True, eq=False)
class RootMap:
    """The map of the motion beside a grazing, from touch to touch.

    Parameters
    ----------
    touches : Touches
        What it is of.
    jacobians : (m, 2n, 2n)
        From each touch to the next.
    rows, kicks : (m, 2n)
        c and b of the touches.
    losses, decelerations : (m,)
        1 + e, and a in m/s².

    References
    ----------
    A. B. Nordmark (1991), *J. Sound Vib.* 145, 279-297; M. H. Fredriksson and A. B. Nordmark
    (1997), *Proc. R. Soc. A* 453, 1261-1276.
    """

    touches: Touches
    jacobians: Real
    rows: Real
    kicks: Real
    losses: Real
    decelerations: Real

    @classmethod
    def of(cls, touches: Touches) -> RootMap:
        """That of an orbit that grazes.

        Raises
        ------
        CoefficientError
            If the motion does not turn at a stop.
        ConvergenceError
            If the flow map fails.
        """
        states, phases, omega = touches.states, touches.phases, touches.omega
        flights = [
            touches.shoot(*each)[1] for each in zip(states, phases, touches.ends, strict=True)
        ]
        pace = [touches.rate(*each) for each in zip(states, phases, strict=True)]
        rows, rates = touches.rows
        decelerations = -omega * (rates * pace).sum(1)
        if not (decelerations > 0.0).all():
            raise CoefficientError("the motion does not turn at the stop")
        losses = touches.losses(np.full(len(rows), SLIGHT))
        return cls(touches, np.array(flights), rows, touches.kicks, losses, decelerations)

    @cached_property
    def heights(self) -> tuple[Real, Real]:
        """Derivatives of the heights of periodic motions by x (m,) and by the speeds (m, m)."""
        m, n = self.rows.shape
        states = self.touches.states
        by_parameter = self.touches.by_parameter(lambda beside: beside.flights(states))
        own = self.touches.by_parameter(lambda beside: beside.heights)
        matrix, right = np.eye(m * n), np.zeros((m * n, m + 1))
        for i, follows in enumerate([*range(1, m), 0]):
            before, behind = slice(i * n, (i + 1) * n), slice(follows * n, (follows + 1) * n)
            matrix[behind, before] -= self.jacobians[i]
            right[behind, 0] = by_parameter[i]
            right[behind, i + 1] = -self.losses[i] * (self.jacobians[i] @ self.kicks[i])
        ways = np.linalg.solve(matrix, right).reshape(m, n, m + 1)
        found = np.einsum("mn,mnk->mk", self.rows, ways)
        return found[:, 0] + own, found[:, 1:]

    def effect(self, first: int) -> float:
        """Of an impact on its own touch, a period later: c A b."""
        effect, m = self.kicks[first], len(self.rows)
        for i in range(first, first + m):
            effect = self.jacobians[i % m] @ effect
        return float(self.rows[first] @ effect)

    @property
    def trace(self) -> float:
        """Effect of an impact on the next touch, c A b over the sizes of c and A b."""
        effect, row = self.jacobians[0] @ self.kicks[0], self.rows[1 % len(self.rows)]
        return float(row @ effect / (np.linalg.norm(row) * np.linalg.norm(effect)))

    def growth(self, first: int) -> float:
        """Multiplier times speed of orbits with an impact at one touch only: -(1 + e) a c A b."""
        return float(-self.losses[first] * self.decelerations[first] * self.effect(first))

    @property
    def lowers(self) -> bool:
        """Whether an impact lowers the motion at all touches that follow: c Aᵏ b > 0."""
        return all(self._lowers(first) for first in range(len(self.rows)))

    def _lowers(self, first: int) -> bool:
        effect, largest, m = self.kicks[first], 0.0, len(self.rows)
        for i in range(first, first + m * MOST_PERIODS):
            effect, row = self.jacobians[i % m] @ effect, self.rows[(i + 1) % m]
            size = float(np.abs(row) @ np.abs(effect))
            largest = max(largest, size)
            if size <= FORGOTTEN * largest:
                return True
            if row @ effect <= 0.0:
                return False
            grown = float(np.linalg.norm(effect))
            effect, largest = effect / grown, largest / grown  # else it may grow beyond all numbers
        return True

    def with_hits(self, hits: tuple[bool, ...]) -> Beside | None:
        """The orbits with impacts at some touches, if they begin at the grazing."""
        by_parameter, by_speed = self.heights
        hit, amounts = np.array(hits), np.empty(len(hits))
        amounts[hit] = np.linalg.solve(by_speed[hit][:, hit], -by_parameter[hit])
        amounts[~hit] = -by_parameter[~hit] - by_speed[~hit][:, hit] @ amounts[hit]
        side = int(np.sign(amounts[0]))
        if not (side * amounts > 0.0).all():
            return None
        return Beside(hits, side, tuple((side * amounts).tolist()))

    def with_one_hit(self, touches: int) -> list[Beside]:
        """The orbits with an impact at one of the first touches, and no other one."""
        m = len(self.rows)
        single = (tuple(i == first for i in range(m)) for first in range(touches))
        return [beside for hits in single if (beside := self.with_hits(hits)) is not None]

    @property
    def beside(self) -> list[Beside]:
        """All orbits that begin at the grazing, those without impacts first.

        Empty where there are too many touches to tell.
        """
        m = len(self.rows)
        mixtures = sorted(product((False, True), repeat=m), key=sum) if m <= MOST_TOUCHES else []
        found = (self.with_hits(hits) for hits in mixtures)
        return [beside for beside in found if beside is not None]


@dataclass(frozen=True)
class RigidGrazing:
    """The normal form of a grazing in one touch.

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
    """

    growth: float
    speed_change: float
    height_change: float
    lowers: bool

    @classmethod
    def of(cls, form: RootMap) -> RigidGrazing:
        """That of a map with one touch.

        Raises
        ------
        CoefficientError
            If an impact leaves no trace.
        """
        (height_change,), ((by_speed,),) = form.heights
        if by_speed == 0.0:
            raise CoefficientError("an impact leaves no trace over a period")
        return cls(
            growth=form.growth(0),
            speed_change=float(-height_change / by_speed),
            height_change=float(height_change),
            lowers=form.lowers,
        )
