"""Ways of orbits through systems with more or less damping."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import krogh_interpolate

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.newton import check_bounded, first_orbit, guessed_nodes
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import shooting_problem
from nldyn.system.friction import DryFriction
from nldyn.system.system import System

PROBE, SHORTEST_STEP = 1e-4, 1e-5  # in the logarithm of the factor
LONGER, SHORTER = 3.0, 0.4  # the next step, after one that led on and one that did not
MISS = 0.3  # distance of an orbit from where it was expected, over its way
FIRST_MISS = 3e-3  # the same after the first step, over the orbit
ROUNDING = 1e-6  # of an orbit, relative


@dataclass(frozen=True)
class Homotopy:
    """A way from a system to one with other damping; its places are shares of it.

    Parameters
    ----------
    own : FlowMap
        Of the system where it begins.
    factor : float
        Of the damping of all modes and dampers where it ends; before, powers of it.
    """

    own: FlowMap
    factor: float

    @property
    def length(self) -> float:
        """Of the way, in the logarithm of the factor."""
        return abs(math.log(self.factor))

    def flow(self, share: float) -> FlowMap:
        """The flow map after a share of the way."""
        if share == 0.0:
            return self.own
        return FlowMap(_more_damped(self.own.system, self.factor**share), self.own.options)

    def carried(
        self, orbit: Orbit, start: float, end: float, look: Callable[[], None] = lambda: None
    ) -> Orbit | None:
        """The orbit of the same frequency at another place, or None where its way there ends.

        It ends at a fold, as a rule. The orbit is led from place to place by Newton's method, from
        the curve through the last: the first step is short and gives a line, of which the second is
        a multiple; then a parabola goes through the last three orbits. One is taken only if it is
        near where it was expected, beside the way to it. `look` is called before each step.
        """
        step = PROBE / self.length
        known = [(start, _unknowns(orbit))]
        while (x := known[-1][0]) != end:
            look()
            step = min(step, abs(end - x))
            y = end if step == abs(end - x) else x + math.copysign(step, end - start)
            places, values = zip(*known[-3:], strict=True)
            guess = krogh_interpolate(places, values, y)
            found = self._near(orbit, y, guess)
            if found is None or _far(there := _unknowns(found), guess, known):
                step *= SHORTER
                if step * self.length < SHORTEST_STEP:
                    return None
                continue
            step *= LONGER
            orbit = found
            known.append((y, there))
        return orbit

    def _near(self, orbit: Orbit, share: float, guess: Real) -> Orbit | None:
        """The orbit near a guess at a place, if it is of the same period."""
        segments = orbit.problem.segments
        omega = 2.0 * math.pi * orbit.frequency_hz
        try:
            flow = self.flow(share)
            check_bounded(flow, omega)
            problem = shooting_problem(flow, orbit.period, segments)
            nodes = guessed_nodes(problem, guess[:-1].reshape(segments, -1), omega)
            return first_orbit(problem, [nodes], omega, orbit.observe)
        except FAILURES:
            return None


def _more_damped(system: System, factor: float) -> System:
    """The system with all of its damping but dry friction times a factor."""
    dampers = tuple(
        d if isinstance(d, DryFriction) else replace(d, coefficient=factor * d.coefficient)
        for d in system.dampers
    )
    return replace(system, damping=factor * system.damping, dampers=dampers)


def _far(unknowns: Real, guess: Real, known: Sequence[tuple[float, Real]]) -> bool:
    """Whether an orbit is not where it was expected from those known, beside its way."""
    off = _length(unknowns - guess, unknowns)
    if len(known) == 1:
        return off > FIRST_MISS
    return off > MISS * _length(unknowns - known[-1][1], unknowns) + ROUNDING


def _length(way: Real, unknowns: Real) -> float:
    """Of a way between orbits, relative to one of them unless it is at rest."""
    size = float(np.linalg.norm(unknowns[:-1])) or 1.0
    return math.hypot(float(np.linalg.norm(way[:-1])) / size, float(way[-1]))


def _unknowns(orbit: Orbit) -> Real:
    """States at the shooting phases, in coordinates that do not depend on the damping, and ln ω."""
    return np.append(orbit.states(orbit.problem.phases[:-1]).ravel(), math.log(orbit.omega))
