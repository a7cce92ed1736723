"""Ways of orbits through systems with other numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from scipy.interpolate import krogh_interpolate

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError, SystemModelError, is_finite, shown
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.bordered import OrbitFamily, correct
from nldyn.orbits.conditions import Singular
from nldyn.orbits.newton import check_bounded, first_orbit, guessed_nodes
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.shooting import shooting_problem
from nldyn.system.chart import (
    EVERY_MODE,
    FREQUENCY,
    NAMES,
    Chart,
    checked_parameter,
    value_of,
    with_value,
)
from nldyn.system.elements import Excitation
from nldyn.system.parameters import Parameter, size_of, strength
from nldyn.system.system import System

DAMPING: Final = "damping"
EXCITATION: Final = "excitation"
What = Literal["damping", "excitation"] | Parameter  # changes: all of it, or one number
MOST = 1e3  # factor
PROBE, SHORTEST_STEP = 1e-4, 1e-5  # in the logarithms of the factors
LONGER, SHORTER = 3.0, 0.4  # the next step, after one that led on and one that did not
MISS = 0.3  # distance of an orbit from where it was expected, over its way
FIRST_MISS = 3e-3  # the same after the first step, over the orbit
ROUNDING = 1e-6  # of an orbit, relative


@dataclass(frozen=True)
class Homotopy:
    """A way from a system to one with other numbers; its places are shares of it.

    Parameters
    ----------
    own : FlowMap
        Of the system where it begins.
    factors : mapping of What to float
        Factors where it ends, see `checked_factors`; before, powers of them.
    """

    own: FlowMap
    factors: Mapping[What, float]

    @property
    def length(self) -> float:
        """Of the way, in the logarithms of the factors."""
        return math.hypot(*map(math.log, self.factors.values()))

    def flow(self, share: float) -> FlowMap:
        """The flow map after a share of the way."""
        if share == 0.0:
            return self.own
        system = self.own.system
        for what, factor in self.factors.items():
            system = times(system, what, factor**share)
        return FlowMap(system, self.own.options)

    def carried(
        self, orbit: Orbit, start: float, end: float, look: Callable[[], None] | None = None
    ) -> Orbit | None:
        """The orbit of the same frequency at another place, or None where its way there ends.

        It ends at a fold, as a rule. `look` is called before each step.
        """
        return self._led(orbit, start, end, self._near, look)

    def carried_fold(self, fold: Orbit, start: float, end: float) -> Orbit | None:
        """The fold at another place, at a frequency of its own, or None where its way there ends.

        It ends where two folds meet, or beside another one that attracts Newton's method; seldom
        that one is taken unseen.
        """
        return self._led(fold, start, end, self._fold_near)

    def _led(
        self,
        orbit: Orbit,
        start: float,
        end: float,
        near: Callable[[Orbit, float, Real], Orbit | None],
        look: Callable[[], None] | None = None,
    ) -> Orbit | None:
        """The orbit led from place to place by Newton's method, from the curve through the last.

        The first step is short and gives a line, of which the second is a multiple; then a parabola
        goes through the last three orbits. One is taken only if it is near where it was expected,
        beside the way to it.
        """
        step = PROBE / self.length
        known = [(start, _unknowns(orbit))]
        while (x := known[-1][0]) != end:
            if look is not None:
                look()
            step = min(step, abs(end - x))
            y = end if step == abs(end - x) else x + math.copysign(step, end - start)
            places, values = zip(*known[-3:], strict=True)
            guess = krogh_interpolate(places, values, y)
            found = near(orbit, y, guess)
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
            check_bounded(flow.system, omega)
            problem = shooting_problem(flow, orbit.period, segments)
            nodes = guessed_nodes(problem, guess[:-1].reshape(segments, -1), omega)
            return first_orbit(problem, [nodes], omega, orbit.observe)
        except (ConvergenceError, SystemModelError):
            return None

    def _fold_near(self, fold: Orbit, share: float, guess: Real) -> Orbit | None:
        """The fold near a guess at a place, from the borders of another one."""
        segments = fold.problem.segments
        try:
            flow = self.flow(share)
            hz = math.exp(guess[-1]) / (2.0 * math.pi)
            chart = Chart.of(Parameter(FREQUENCY), (0.5 * hz, 2.0 * hz))
            family = OrbitFamily(
                flow.system, flow.options, fold.period, segments, fold.observe, hz, (chart,)
            )
            nodes = flow.to_state(guess[:-1].reshape(segments, -1))
            point = np.append(nodes.ravel(), chart.coordinate(hz))
            found = correct(family, point, Singular.of("LP", fold))
        except SystemModelError:
            return None
        return found.orbit if found.converged else None


def times(system: System, what: What, factor: float) -> System:
    """The system with all of its damping, all of its excitation, or a parameter times a factor."""
    if isinstance(what, Parameter):
        return with_value(system, what, factor * value_of(system, math.nan, what))
    if what == DAMPING:
        dampers = tuple(replace(d, coefficient=factor * d.coefficient) for d in system.dampers)
        return replace(system, damping=factor * system.damping, dampers=dampers)
    sources = tuple(_scaled(source, factor) for source in system.excitation)
    return system.with_elements(excitation=sources)


def checked_factors(system: System, factors: Mapping[str | Parameter, float]) -> dict[What, float]:
    """Factors of "damping", "excitation" and parameters, of which a name alone means index 0.

    Raises
    ------
    SystemModelError
        For no factor, one that is 1 or out of bounds, and one of what the system does not have,
        what is zero, was named before, or cannot be so many times as large.
    """
    if not (isinstance(factors, Mapping) and factors):
        raise SystemModelError(
            f'factors must be a mapping such as {{"damping": 0.5}}, got {shown(factors)}'
        )
    checked: dict[What, float] = {}
    for name, factor in factors.items():
        what = _checked_name(system, name)
        if what in checked:
            raise SystemModelError(f"factors: {named(what)} is named twice")
        if not (is_finite(factor) and 1.0 / MOST <= factor <= MOST and factor != 1.0):
            raise SystemModelError(
                f"factors: that of {named(what)} must be a number from {1.0 / MOST:g} to {MOST:g} "
                f"other than 1, got {shown(factor)}"
            )
        checked[what] = float(factor)
        try:
            system = times(system, what, checked[what])
        except SystemModelError as error:
            raise SystemModelError(
                f"factors: {named(what)} cannot be {factor:g} times as large: {error}"
            ) from None
    return checked


def _checked_name(system: System, name: object) -> What:
    """What a factor is of, if the system has it and it is not zero."""
    text = name.name if isinstance(name, Parameter) else name
    what: What
    if text == FREQUENCY:
        raise SystemModelError(f"factors: orbits are carried at their own {FREQUENCY}")
    if name == DAMPING:
        what, there = DAMPING, bool(np.any(system.total_damping))
    elif name == EXCITATION:
        what, there = EXCITATION, any(strength(source) != 0.0 for source in system.excitation)
    elif isinstance(name, str | Parameter) and text in NAMES:
        what = checked_parameter(system, name)
        there = value_of(system, math.nan, what) != 0.0
    else:
        known = ", ".join([DAMPING, EXCITATION, *(other for other in NAMES if other != FREQUENCY)])
        reason = "has no index" if text in (DAMPING, EXCITATION) else f"is none of {known}"
        raise SystemModelError(f"factors: {shown(text)} {reason}")
    if not there:
        raise SystemModelError(f"factors: {named(what)} is zero, which no factor changes")
    return what


def named(what: What) -> str:
    """What a factor is of, in a note or message."""
    if isinstance(what, str):
        return f"the {what}"
    return f"{what.name} of all modes" if what.index == EVERY_MODE else f"{what.name}[{what.index}]"


def _scaled(source: Excitation, factor: float) -> Excitation:
    """A source of excitation, times a factor."""
    changed: dict[str, Any] = {size_of(source): factor * strength(source)}
    return replace(source, **changed)


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
