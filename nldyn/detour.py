"""Ways of orbits through systems with other numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from nldyn.elements import Excitation
from nldyn.errors import SystemModelError
from nldyn.flow import FlowMap
from nldyn.linear import Real
from nldyn.orbit import ConvergenceError, Orbit, solve_orbit
from nldyn.parameter_values import value_of, with_value
from nldyn.parameters import SOURCES, Parameter
from nldyn.system import System

DAMPING, EXCITATION = "damping", "excitation"
FIRST_STEP, SHORTEST_STEP = 0.25, 1e-3  # in the logarithms of the factors
LONGER, SHORTER = 1.5, 0.4  # the next step, after one that led on and one that did not
MISS = 0.3  # of an orbit: distance from where it was expected


@dataclass(frozen=True)
class Detour:
    """A way from a system to one with other numbers; its places are shares of it.

    Parameters
    ----------
    own : FlowMap
        Of the system where it begins.
    factors : mapping of str or Parameter to float
        Factors of numbers of the system where it ends; before, powers of them. See `by_detour`.
    """

    own: FlowMap
    factors: Mapping[str | Parameter, float]

    @property
    def length(self) -> float:
        """Of the way, in the logarithms of the factors."""
        return math.hypot(*map(math.log, self.factors.values()))

    def flow(self, share: float) -> FlowMap:
        """The flow map after a share of the way."""
        if share == 0.0:
            return self.own
        system = self.own.system
        for name, factor in self.factors.items():
            system = times(system, name, factor**share)
        return FlowMap(system, self.own.options)

    def carried(self, orbit: Orbit, start: float, end: float) -> Orbit | None:
        """The orbit of the same frequency at another place, or None where its way there ends.

        It ends at a fold, as a rule. Newton's method starts from the line through the two orbits
        before.
        """
        x, step = start, math.copysign(FIRST_STEP / self.length, end - start)
        here = _states(orbit)
        slope = np.zeros_like(here)
        while x != end:
            y = x + step if abs(step) < abs(end - x) else end
            guess = here + slope * (y - x)
            found = self._near(orbit, y, guess)
            if found is None:
                step *= SHORTER
                if abs(step) * self.length < SHORTEST_STEP:
                    return None
                continue
            states = _states(found)
            slope = (states - here) / (y - x)
            orbit, here, x = found, states, y
            step *= LONGER
        return orbit

    def _near(self, orbit: Orbit, share: float, guess: Real) -> Orbit | None:
        """The orbit near a guess at a place, if it is of the same period."""
        try:
            found = solve_orbit(
                self.flow(share),
                orbit.frequency_hz,
                orbit.period,
                guess=guess,
                observe=orbit.observe,
                segments=orbit.problem.segments,
            )
            states = _states(found)
        except (ConvergenceError, SystemModelError):
            return None
        far = float(np.linalg.norm(states - guess)) > MISS * float(np.linalg.norm(states))
        return None if far else found


def has_damping(system: System) -> bool:
    """Whether any mode or damper takes energy away."""
    return bool(np.any(system.damping)) or any(d.coefficient > 0.0 for d in system.dampers)


def times(system: System, name: str | Parameter, factor: float) -> System:
    """The system with a number, all of its damping, or all of its excitation times a factor."""
    if name == DAMPING:
        dampers = tuple(replace(d, coefficient=factor * d.coefficient) for d in system.dampers)
        return replace(system, damping=factor * system.damping, dampers=dampers)
    if name == EXCITATION:
        sources = tuple(_scaled(source, factor) for source in system.excitation)
        return system.with_elements(excitation=sources)
    parameter = Parameter(name) if isinstance(name, str) else name
    return with_value(system, parameter, factor * value_of(system, math.nan, parameter))


def _scaled(source: Excitation, factor: float) -> Excitation:
    """A source of excitation, times a factor."""
    name = next(name for name in SOURCES if hasattr(source, name))
    return replace(source, **{name: factor * getattr(source, name)})


def _states(orbit: Orbit) -> Real:
    """States (k, 2n) at the shooting phases, in coordinates that do not depend on the damping."""
    return orbit.states(orbit.problem.phases[:-1])
