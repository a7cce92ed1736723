"""What a diagram is drawn over: the frequency, or another number of the system at a frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_frequency
from nldyn.flow.flow_map import FlowMap, same_flow
from nldyn.flow.rigid import before_rigid_stops
from nldyn.orbits.bordered import SAME_FREQUENCY, OrbitFamily, Place
from nldyn.orbits.limit_cycle import of_self_excited
from nldyn.orbits.orbit import Orbit, stroboscopic
from nldyn.orbits.shooting import ShootingProblem
from nldyn.system.chart import (
    FREQUENCY,
    THE_FREQUENCY,
    Chart,
    checked_parameter,
    moves_frequency,
    parameter_name,
    told_value,
    value_of,
    with_unit,
    with_value,
    words_of,
)
from nldyn.system.parameters import Parameter
from nldyn.system.system import System


@dataclass(frozen=True)
class Axis:
    """A parameter over a range, and the excitation frequency where that is another number.

    Parameters
    ----------
    chart : Chart
        The parameter and its range.
    frequency_hz : float, optional
        Excitation frequency in Hz, held; None where it changes, and where nothing excites the
        motions, whose frequencies are found.
    """

    chart: Chart
    frequency_hz: float | None = None

    @classmethod
    def of(
        cls,
        system: System,
        limits: tuple[float, float],
        parameter: str | Parameter | None = None,
        frequency_hz: float | None = None,
    ) -> Axis:
        """The axis of a parameter of a system, checked; of the frequency for None.

        Raises
        ------
        SystemModelError
            If there is no such parameter, it cannot have these values, or the frequency is given
            where it changes or is found, or missing where it is neither.
        """
        chosen = checked_parameter(system, FREQUENCY if parameter is None else parameter)
        name = parameter_name(chosen)
        given = moves_frequency(chosen) or frequency_hz is not None
        if given and system.carried and not system.driven:
            raise SystemModelError(
                "nothing excites the system but what moves beneath its friction: its frequency is "
                "found, not given; name another parameter, and no frequency_hz"
            )
        if moves_frequency(chosen):
            if frequency_hz is not None:
                raise SystemModelError(
                    f"frequency_hz is what parameter '{name}' changes: give it with another one"
                )
        elif frequency_hz is not None:
            check_frequency("frequency_hz", frequency_hz)
        elif system.driven:
            raise SystemModelError(
                f"parameter '{name}': needs frequency_hz, the excitation frequency that is held"
            )
        return cls(Chart.of(chosen, limits), frequency_hz)

    @classmethod
    def in_frequency(cls, limits: tuple[float, float]) -> Axis:
        """That of the excitation frequency in Hz."""
        return cls(Chart(THE_FREQUENCY, *limits))

    @property
    def parameter(self) -> Parameter:
        """What changes."""
        return self.chart.parameter

    @property
    def self_excited(self) -> bool:
        """Whether nothing excites the motions, whose frequencies are found."""
        return self.frequency_hz is None and not moves_frequency(self.parameter)

    def check_driven(self) -> None:
        """Refuse motions that nothing excites, for what needs their frequency.

        Raises
        ------
        SystemModelError
            If nothing excites them.
        """
        if self.self_excited:
            raise SystemModelError(
                "nothing excites the system, whose motions have frequencies of their own: find "
                "them by limit_cycle, continue_branch or diagram"
            )

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest value."""
        return self.chart.low, self.chart.high

    def holds(self, value: float) -> bool:
        """Whether a value lies in the range."""
        return self.chart.low <= value <= self.chart.high

    def at(self, flow: FlowMap, value: float) -> Section:
        """The motions of a system at a value."""
        return Section(self, flow, value)

    def value(self, orbit: Orbit) -> float:
        """Value at an orbit."""
        return value_of(orbit.system, orbit.frequency_hz, self.parameter)

    def family(self, flow: FlowMap, orbit: Orbit) -> OrbitFamily:
        """The family along the axis that an orbit belongs to, in the coordinates of a system."""
        if self.self_excited:
            family = of_self_excited(orbit, self.chart)
        else:
            family = OrbitFamily.around(orbit, (self.chart,))
        return replace(family, problem=replace(orbit.problem, flow=flow))

    def is_along(self, place: Place) -> bool:
        """Whether an orbit belongs to a family in the parameter, at the frequency that is held."""
        charts, held = place.family.charts, self.frequency_hz
        hz = place.orbit.frequency_hz
        same_hz = held is None or math.isclose(hz, held, rel_tol=SAME_FREQUENCY)
        followed = [self.parameter, *[THE_FREQUENCY] * self.self_excited]
        return same_hz and [chart.parameter for chart in charts] == followed

    def is_of(self, flow: FlowMap, other: FlowMap) -> bool:
        """Whether two flow maps are one but for the value of the parameter."""
        if same_flow(flow, other):
            return True
        try:
            value = value_of(flow.system, self.frequency_hz or math.nan, self.parameter)
            changed = with_value(other.system, self.parameter, value)
        except (SystemModelError, IndexError, AttributeError):  # no such number there
            return False
        return same_flow(flow, FlowMap(changed, other.options))

    def spread(self, count: int) -> Real:
        """So many values from one end of the range to the other, equally far on its scale."""
        return self.chart.spread(count)

    def middles(self, count: int) -> list[float]:
        """Middles of so many equal parts of the range, on its scale."""
        edges = self.spread(count + 1)
        middles = 0.5 * (edges[:-1] + edges[1:])
        if self.chart.logarithmic:
            middles = np.sqrt(edges[:-1] * edges[1:])
        return [float(value) for value in middles]

    def between(self, a: float, b: float, share: float) -> float:
        """Value a share of the way between two."""
        return a * (b / a) ** share if self.chart.logarithmic else a + share * (b - a)

    def moved(self, value: float, share: float) -> float:
        """A value changed by a share of it, or where that is its scale, of the range's width."""
        if self.chart.logarithmic:
            return value * (1.0 + share)
        return value + share * (self.chart.high - self.chart.low)

    def apart(self, a: float, b: float) -> float:
        """How far a value lies from another one, over this, or over the range's width."""
        if self.chart.logarithmic:
            return abs(a / b - 1.0)
        return abs(a - b) / (self.chart.high - self.chart.low)

    def around(self, value: float, share: float) -> tuple[float, float]:
        """The values a share, as in `moved`, on either side of one."""
        if self.chart.logarithmic:
            return value / (1.0 + share), value * (1.0 + share)
        return self.moved(value, -share), self.moved(value, share)

    def steps(self, spacing: float) -> int:
        """Number of equal steps of at most a share, as in `moved`, through the range."""
        if self.chart.logarithmic:
            return math.ceil(math.log(self.chart.high / self.chart.low) / math.log1p(spacing))
        return math.ceil(1.0 / spacing)

    def told(self, *values: float, digits: int = 6) -> str:
        """Values in words, with their unit."""
        return told_value(self.parameter, *values, digits=digits)

    def told_span(self, low: float, high: float, digits: int = 6) -> str:
        """From one value to another, in words."""
        return self.told(low, high, digits=digits).replace(" and ", " to ")

    def told_ranges(self, ranges: Sequence[tuple[float, float]]) -> str:
        """Ranges of values, with the unit once: ``5-6, 7 Hz``."""
        listed = [f"{a:.4g}-{b:.4g}" if a < b else f"{a:.4g}" for a, b in ranges]
        return with_unit(self.parameter, ", ".join(listed))

    @property
    def noun(self) -> str:
        """What one value is called."""
        return words_of(self.parameter)

    def counted(self, count: int) -> str:
        """So many values, in words."""
        if self.parameter.name == FREQUENCY:
            return f"{count} frequenc{'y' if count == 1 else 'ies'}"
        return f"{count} value{'s' * (count != 1)} of the {self.noun}"

    def told_range(self) -> str:
        """The range in words, and the frequency that is held."""
        return self.told_span(*self.limits) + self._told_at

    def told_held(self) -> str:
        """The parameter in words, and the frequency that is held."""
        the = "the " * (self.parameter.name == FREQUENCY)
        return f"{the}{self.noun}{self._told_at}"

    @property
    def _told_at(self) -> str:
        return "" if self.frequency_hz is None else f" at {self.frequency_hz:g} Hz"


@dataclass(frozen=True, eq=False)
class Section:
    """The motions of a system at one value of an axis.

    Parameters
    ----------
    axis : Axis
        What changes.
    base : FlowMap
        Of the system at another value, whose coordinates branches along the axis have.
    value : float
        The value.
    """

    axis: Axis
    base: FlowMap
    value: float

    @cached_property
    def flow(self) -> FlowMap:
        """The flow map here."""
        system = with_value(self.base.system, self.axis.parameter, self.value)
        return self.base if system is self.base.system else FlowMap(system, self.base.options)

    @property
    def frequency_hz(self) -> float:
        """Excitation frequency in Hz.

        Raises
        ------
        SystemModelError
            If nothing excites the system.
        """
        self.axis.check_driven()
        return self.value if self.axis.frequency_hz is None else self.axis.frequency_hz

    @property
    def omega(self) -> float:
        """Excitation frequency in rad/s."""
        return 2.0 * math.pi * self.frequency_hz

    @property
    def coordinate(self) -> float:
        """Coordinate of the value."""
        return self.axis.chart.coordinate(self.value)

    def family(self, problem: ShootingProblem, observe: str) -> OrbitFamily:
        """The family along the axis of the shooting equations of the base."""
        return OrbitFamily(problem, observe, self.frequency_hz, (self.axis.chart,))

    def to_base(self, states: Real) -> Real:
        """States (..., 2n) in the coordinates of the base."""
        here, base = self.flow.system.linear, self.base.system.linear
        return states if here is base else np.asarray(states @ base.coordinates_of(here).T)

    def states_of(self, orbit: Orbit) -> Real:
        """States (n, 2n_modes) of an orbit at another value, at the start of each period."""
        here, there = self.flow.system.linear, orbit.system.linear
        states = stroboscopic(orbit)
        return states if here is there else np.asarray(states @ here.coordinates_of(there).T)

    def taken_over(self, states: Real) -> Real:
        """States (k, 2n) of the base as motions here may begin: not behind rigid stops."""
        here, base = self.flow.system.linear, self.base.system.linear
        if here is not base:
            states = states @ here.coordinates_of(base).T
        return states if self.flow is self.base else before_rigid_stops(self.flow, states)
