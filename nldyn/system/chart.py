"""Numbers of a system that a continuation may change: read, set, and measured on a scale."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from nldyn.base.arrays import SLACK, Real
from nldyn.base.errors import (
    LARGEST_FREQUENCY,
    SMALLEST_FREQUENCY,
    SystemModelError,
    is_finite,
    nearest,
    shown,
)
from nldyn.system.friction import DryFriction
from nldyn.system.naming import turned
from nldyn.system.parameters import (
    EXACT,
    OF_AREAS,
    OF_ROUND,
    OF_SLIDERS,
    OF_SPRINGS,
    OF_STOPS,
    SOURCES,
    Parameter,
    check_exact,
    check_index,
    check_round,
)
from nldyn.system.springs_dampers import PolynomialSpring
from nldyn.system.stop import LARGEST_EXPONENT
from nldyn.system.system import System

FREQUENCY = "frequency_hz"
SPIN, SPEED = "spin_hz", "speed_hz"  # of a shaft; the same with the excitation, once per turn
EVERY_MODE = -1

_OF_DAMPERS = ("coefficient",)
BASE_SPEED, SURFACE_SPEED = "base_speed", "surface_speed"  # of a slider, a round clearance
_OF_SPRINGS = {"spring_stiffness": "stiffness"}  # and what it is called there
_OF_MODES = ("modal_damping", "natural_frequency_hz")
OF_ELEMENTS = (*EXACT, BASE_SPEED, SURFACE_SPEED, *_OF_DAMPERS, *_OF_SPRINGS)
UNITS = {
    "frequency_hz": "Hz",
    SPIN: "Hz",
    SPEED: "Hz",
    "gap": "m",
    "stiffness": "N/m^exponent",
    "exponent": "1",
    "dissipation": "s/m",
    "dashpot": "N s/m",
    "restitution": "1",
    "area_gap": "m",
    "area_stiffness": "N/m^exponent per m² or m",
    "area_friction": "1",
    "clearance": "m",
    "rubbing_friction": "1",
    "first_eccentricity": "m",
    "second_eccentricity": "m",
    "amplitude": "N",
    "mass_times_radius": "kg m",
    "force": "N",
    "friction": "1",
    "normal_force": "N",
    "tangential_stiffness": "N/m",
    BASE_SPEED: "m/s",
    SURFACE_SPEED: "m/s",
    "coefficient": "N s/m",
    "spring_stiffness": "N/m",
    "modal_damping": "1",
    "natural_frequency_hz": "Hz",
} | {name: f"N/m^{name[1:]}" for name in OF_SPRINGS}
BOUNDS = {
    name: (0.0, math.inf)
    for name in (
        *("stiffness", "dissipation", "dashpot", *SOURCES, *OF_SLIDERS),
        *("area_stiffness", "area_friction"),
        *("clearance", "rubbing_friction", *_OF_DAMPERS, *_OF_MODES),
    )
    if name != "force"  # has either sign
} | {  # between which there are systems
    "exponent": (1.0, LARGEST_EXPONENT),
    "restitution": (0.0, 1.0),
}
POSITIVE = (
    "clearance",
    "stiffness",
    "area_stiffness",
    "normal_force",
    "tangential_stiffness",
    "natural_frequency_hz",
)  # there is no system where they are zero
NAMES = (FREQUENCY, *OF_ELEMENTS, *_OF_MODES, SPIN, SPEED)
OF_TABLES = {"stops": OF_STOPS, "excitation": SOURCES, "dampers": _OF_DAMPERS}  # of scenes
MEANT = {  # by words for what has another name
    "preload": "'gap', which is negative for a preload",
    "static_force": "'force', with the index of the ConstantForce",
    "constant_force": "'force', with the index of the ConstantForce",
}
THE_FREQUENCY = Parameter(FREQUENCY)
LAST_DIGIT = 1e-14  # relative: a value so near to the end of its range is that


@dataclass(frozen=True, kw_only=True)
class OwnParameter(Parameter):
    """A number of your own: a function of what a system is made of.

    Branches, diagrams and curves are followed along it as along any other parameter, with
    differences in place of derivatives. Files of results hold no code, so they refuse it.

    Parameters
    ----------
    name : str
        Name in tables, messages and on axes, other than those of the numbers of systems.
    value : callable
        Takes a `System`, gives its number.
    changed : callable
        Takes a `System` and a value, gives the system with that value, of as many modes.
    unit : str
        "1" if it has none.

    Raises
    ------
    SystemModelError
        If the name is one of a system's numbers, or the functions cannot be called.

    Examples
    --------
    >>> from nldyn import HarmonicForce, Stop, System, continue_branch, solve_orbit
    >>> from nldyn.system import OwnParameter
    >>> system = System.from_matrices([[1.0]], [[4.0]], {"x": [1.0]}, modal_damping=0.05,
    ...     stops=[Stop.linear("x", 8.0)], excitation=[HarmonicForce("x", 1.0)])
    >>> ratio = OwnParameter(
    ...     name="stiffness ratio",
    ...     value=lambda system: system.stops[0].stiffness / 4.0,
    ...     changed=lambda system, value: system.with_elements(
    ...         stops=[Stop.linear("x", 4.0 * value)]
    ...     ),
    ... )
    >>> branch = continue_branch(solve_orbit(system, 0.2), (1.0, 3.0), parameter=ratio)
    >>> branch.at(3.0)[0].system.stops[0].stiffness
    12.0
    """

    value: Callable[[System], float]
    changed: Callable[[System, float], System]
    unit: str = "1"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name in NAMES:
            raise SystemModelError(f"OwnParameter: '{self.name}' is a number of systems itself")
        for part in ("value", "changed"):
            if not callable(getattr(self, part)):
                raise SystemModelError(f"OwnParameter '{self.name}': {part} must be a function")


def has_exact_derivatives(parameter: Parameter) -> bool:
    """Whether the flow map differentiates by the parameter itself."""
    return parameter.name in EXACT


def checked_parameter(system: System, parameter: str | Parameter) -> Parameter:
    """A parameter, of which a name alone means index 0.

    Parameters
    ----------
    system : System
        The system that must have it.
    parameter : str or Parameter
        An `OwnParameter`, or frequency_hz; gap, stiffness, exponent, dissipation, dashpot or
        restitution of a stop; amplitude, mass_times_radius or force of an excitation; friction or
        normal_force of a slider, or base_speed of what it slides on; surface_speed of a round
        clearance; area_gap, area_stiffness or area_friction of an area of contact; coefficient of a
        damper; spring_stiffness of a linear spring; k1, k2, ... of a polynomial one;
        modal_damping (ratio) or natural_frequency_hz of a mode; spin_hz of a system with a `Spin`,
        or speed_hz, which is spin and frequency in one where they are equal. The index -1 of
        modal_damping means all modes, which then have one ratio.

    Raises
    ------
    SystemModelError
        If there is no such number.
    """
    if isinstance(parameter, OwnParameter):
        _own_value(system, parameter)
        return parameter
    if isinstance(parameter, str):
        parameter = Parameter(parameter)
    if not isinstance(parameter, Parameter) or parameter.name not in NAMES:
        name = parameter.name if isinstance(parameter, Parameter) else parameter
        raise SystemModelError(f"unknown parameter {shown(name)}; {_meant(name)}")
    if has_exact_derivatives(parameter):
        check_exact(system, parameter)
    elif parameter.name == BASE_SPEED:
        check_index(parameter, "slider", len(system.sliders))
    elif parameter.name == SURFACE_SPEED:
        check_round(system, parameter, turns=True)
    elif parameter.name in _OF_DAMPERS:
        check_index(parameter, "damper", len(system.dampers))
        if isinstance(system.dampers[parameter.index], DryFriction):
            raise SystemModelError(
                f"parameter 'coefficient': damper {parameter.index} is dry friction: follow "
                "'friction' or 'normal_force'"
            )
    elif parameter.name in _OF_SPRINGS:
        check_index(parameter, "spring", len(system.springs))
        if isinstance(system.springs[parameter.index], PolynomialSpring):
            raise SystemModelError(
                f"parameter 'spring_stiffness': spring {parameter.index} has k1, k2, ... instead"
            )
    elif parameter.name in _OF_MODES and parameter != Parameter("modal_damping", EVERY_MODE):
        check_index(parameter, "mode", system.size)
    if parameter.name == "modal_damping":
        _damping_ratio(system, parameter.index)
    if parameter.name in (SPIN, SPEED):
        spin_of(system, parameter)
    return parameter


def _meant(name: object) -> str:
    """The parameter that is likely meant by a name that is none, or all that there are."""
    name = name if isinstance(name, str) else ""
    if name in MEANT:
        return f"did you mean {MEANT[name]}?"
    table, number, key = [*name.split("."), "", ""][:3]
    if number.isdecimal() and key in OF_TABLES.get(table, ()):
        return f"did you mean Parameter('{key}', {number})?"
    guess = nearest(name, NAMES)
    return f"did you mean '{guess}'?" if guess else f"there are: {', '.join(NAMES)}"


def told_value(parameter: Parameter, *values: float, digits: int = 6) -> str:
    """Values of a parameter in words, with their unit; the frequency without its name.

    Examples
    --------
    >>> told_value(Parameter(FREQUENCY), 23.5), told_value(Parameter("gap", 1), 2e-5)
    ('23.5 Hz', 'gap_1 = 2e-05 m')
    """
    numbers = " and ".join(dict.fromkeys(f"{value:.{digits}g}" for value in values))
    return with_unit(parameter, numbers)


def with_unit(parameter: Parameter, numbers: str) -> str:
    """Numbers that are values of a parameter, with its unit and its name; Hz without a name."""
    unit = unit_of(parameter)
    number = numbers if unit == "1" else f"{numbers} {unit}"
    return number if parameter.name == FREQUENCY else f"{parameter_name(parameter)} = {number}"


def parameter_name(parameter: Parameter) -> str:
    """Name of a parameter, with its number where that is not 0: ``gap_1``."""
    return f"{parameter.name}_{parameter.index}" if parameter.index else parameter.name


def label_of(parameter: Parameter) -> str:
    """Name of a parameter with its unit, for an axis or the head of a column.

    Examples
    --------
    >>> label_of(Parameter(FREQUENCY)), label_of(Parameter("gap"))
    ('frequency (Hz)', 'gap (m)')
    """
    words, unit = words_of(parameter), unit_of(parameter)
    return words if unit == "1" else f"{words} ({unit})"


def unit_of(parameter: Parameter) -> str:
    """Unit of a parameter, 1 if it has none."""
    return parameter.unit if isinstance(parameter, OwnParameter) else UNITS[parameter.name]


def unit_within(system: System, parameter: Parameter) -> str:
    """Unit of a parameter of a system, whose elements may act on rotations."""
    unit = unit_of(parameter)
    if parameter.name not in OF_ELEMENTS:
        return unit
    at = elements_of(system, parameter.name)[parameter.index].at
    return turned(unit) if system.unit(at) == "rad" else unit


def words_of(parameter: Parameter) -> str:
    """Name of a parameter in words."""
    return parameter_name(parameter).removesuffix("_hz").replace("_", " ")


def moves_frequency(parameter: Parameter) -> bool:
    """Whether a parameter is, or goes with, the excitation frequency."""
    return parameter.name in (FREQUENCY, SPEED)


def spin_of(system: System, parameter: Parameter) -> float:
    """Speed in Hz of a system that has a `Spin`.

    Raises
    ------
    SystemModelError
        If it has none.
    """
    if system.spin is None:
        raise SystemModelError(
            f"parameter '{parameter.name}': the system has no spin; give System.from_matrices a "
            "Spin with what goes with the speed"
        )
    return system.spin.hz


def value_of(system: System, frequency_hz: float, parameter: Parameter) -> float:
    """Present value of a parameter.

    Examples
    --------
    >>> from nldyn import System
    >>> value_of(System.from_modal([10.0], {}, modal_damping=0.02), 5.0,
    ...     Parameter("modal_damping"))
    0.02
    """
    name, index = parameter.name, parameter.index
    if isinstance(parameter, OwnParameter):
        return _own_value(system, parameter)
    if name == FREQUENCY:
        return frequency_hz
    if name in (SPIN, SPEED):
        hz = spin_of(system, parameter)
        if name == SPEED and abs(hz - frequency_hz) > SLACK * frequency_hz:
            raise SystemModelError(
                f"parameter '{SPEED}': the shaft spins at {hz:g} Hz, but the excitation has "
                f"{frequency_hz:g} Hz; begin where they are equal"
            )
        return hz
    if name == "modal_damping":
        return _damping_ratio(system, index)
    if name == "natural_frequency_hz":
        return float(system.frequencies_hz[index])
    if name in OF_SPRINGS:
        return float(_polynomial(system, index).coefficients[int(name[1:]) - 1])
    if name in OF_AREAS:
        points = system.area_stops(index)
        if name == "area_friction":
            return points[0].law_of_friction.coefficient
        if name == "area_gap":
            return min(stop.gap for stop in points)
        return points[0].stiffness / points[0].share
    if name == BASE_SPEED:
        return system.sliders[index].friction.base_speeds[0]
    if name == "friction":
        return system.sliders[index].friction.coefficient
    if name in OF_ROUND or name == SURFACE_SPEED:
        return system.round_stops[index].number(name)
    return float(getattr(elements_of(system, name)[index], _OF_SPRINGS.get(name, name)))


def elements_of(system: System, name: str) -> Sequence[Any]:
    """The elements of a system of which a parameter of some name is a number."""
    if name in (*OF_SLIDERS, BASE_SPEED):
        return system.sliders
    if name in OF_AREAS:
        return [system.stops[places[0]] for places in system.areas.values()]
    if name in SOURCES:
        return system.excitation
    if name in _OF_DAMPERS:
        return system.dampers
    return system.springs if name in (*_OF_SPRINGS, *OF_SPRINGS) else system.stops


def with_value(system: System, parameter: Parameter, value: float) -> System:
    """The system with one number changed; a mode keeps its damping ratio with its frequency.

    Raises
    ------
    SystemModelError
        For a value that the number cannot have.
    """
    name, index = parameter.name, parameter.index
    if isinstance(parameter, OwnParameter):
        changed = parameter.changed(system, value)
        if not (isinstance(changed, System) and changed.size == system.size):
            raise SystemModelError(
                f"parameter '{name}': its function must give a System of {system.size} modes"
            )
        return changed
    if name == FREQUENCY:
        return system
    if name in (SPIN, SPEED):
        return system.with_spin(value)
    if name in OF_STOPS:
        return system.with_elements(stops=_replaced(system.stops, index, name, value))
    if name in OF_AREAS:
        return system.with_area(index, OF_AREAS[name], value)
    if name in OF_ROUND or name == SURFACE_SPEED:
        other = system.round_stops[index].with_number(name, value)
        stops = (*system.stops[:index], other, *system.stops[index + 1 :])
        return system.with_elements(stops=stops)
    if name in OF_SPRINGS:
        values = list(_polynomial(system, index).coefficients)
        values[int(name[1:]) - 1] = value
        return system.with_elements(
            springs=_replaced(system.springs, index, "coefficients", tuple(values))
        )
    if name in (*OF_SLIDERS, BASE_SPEED):
        return system.with_slider(index, OF_SLIDERS.get(name, name), value)
    if name in SOURCES:
        return system.with_elements(excitation=_replaced(system.excitation, index, name, value))
    if name in _OF_DAMPERS:
        return replace(system, dampers=_replaced(system.dampers, index, name, value))
    if name in _OF_SPRINGS:
        springs = _replaced(system.springs, index, _OF_SPRINGS[name], value)
        return replace(system, springs=springs)
    modes = np.arange(system.size) if index == EVERY_MODE else np.array([index])
    damping, natural = np.array(system.damping), np.array(system.natural_frequencies)
    if name == "modal_damping":
        damping[modes, modes] = 2.0 * value * natural[modes]
    else:
        if not value > 0.0:
            raise SystemModelError(f"natural_frequency_hz must be positive, got {value:g}")
        natural[index] = 2.0 * math.pi * value
        damping[index, index] *= value / system.frequencies_hz[index]
    return replace(system, natural_frequencies=natural, damping=damping)


def _own_value(system: System, parameter: OwnParameter) -> float:
    """What the function of a user's own parameter gives, checked."""
    value = parameter.value(system)
    if not is_finite(value):
        raise SystemModelError(
            f"parameter '{parameter.name}': its function must give a number, got {shown(value)}"
        )
    return float(value)


def _polynomial(system: System, index: int) -> PolynomialSpring:
    spring = system.springs[index]
    assert isinstance(spring, PolynomialSpring)
    return spring


def _replaced(elements: tuple[Any, ...], index: int, name: str, value: object) -> tuple[Any, ...]:
    values: dict[str, object] = {name: value}
    if name == "dashpot" and value == 0.0:
        values["pulls"] = True  # without a dashpot no stop pulls, and none is said not to
    changed = replace(elements[index], **values)
    return (*elements[:index], changed, *elements[index + 1 :])


def _damping_ratio(system: System, index: int) -> float:
    """Damping ratio of a mode, or of all modes if they have one.

    Raises
    ------
    SystemModelError
        For a mode at 0 Hz, or if all modes are asked for and their ratios differ.
    """
    modes = np.arange(system.size) if index == EVERY_MODE else np.array([index])
    natural = system.natural_frequencies[modes]
    if np.any(natural == 0.0):
        raise SystemModelError("parameter 'modal_damping': a mode at 0 Hz has no damping ratio")
    ratios = system.damping[modes, modes] / (2.0 * natural)
    if np.ptp(ratios) > SLACK * np.abs(ratios).max():
        raise SystemModelError(
            "parameter 'modal_damping': the modes have different ratios; change one mode's"
        )
    return float(ratios[0])


@dataclass(frozen=True)
class Chart:
    """A parameter on the scale on which it is followed.

    A positive range is followed in the logarithm of the value, so that a step of 0.1 is 10 % of
    it; any other range in units of its width. The excitation frequency is followed in ln ω.

    Parameters
    ----------
    parameter : Parameter
        What is followed.
    low, high : float
        Values between which to stay.
    unit : float
        What counts as 1 where the value itself is followed; the width of the range unless given.
    """

    parameter: Parameter
    low: float
    high: float
    unit: float = 0.0

    @classmethod
    def of(cls, parameter: Parameter, limits: tuple[float, float]) -> Chart:
        """Chart over a range that is checked.

        Raises
        ------
        SystemModelError
            If the limits are not two finite numbers, ascending, that the parameter can have.
        """
        name = parameter.name
        try:
            low, high = limits
        except (TypeError, ValueError):
            raise SystemModelError(
                f"the range of {name} must be two numbers, got {shown(limits)}"
            ) from None
        if not (is_finite(low) and is_finite(high) and low < high):
            raise SystemModelError(
                f"the range of {name} must be two finite numbers, ascending; got {shown(limits)}"
            )
        if moves_frequency(parameter) and not SMALLEST_FREQUENCY <= low < high <= LARGEST_FREQUENCY:
            raise SystemModelError(
                f"the range of {name} must be positive, from {SMALLEST_FREQUENCY:g} to "
                f"{LARGEST_FREQUENCY:g}, got {shown(limits)}"
            )
        if name in BOUNDS and not BOUNDS[name][0] <= low < high <= BOUNDS[name][1]:
            least, most = BOUNDS[name]
            upper = "" if most == math.inf else f" and {most:g} at most"
            raise SystemModelError(
                f"the range of {name} must be {least:g} at least{upper}, got {shown(limits)}"
            )
        if name in POSITIVE and low == 0.0:
            raise SystemModelError(
                f"the range of {name} must begin above zero, got {shown(limits)}"
            )
        return cls(parameter, float(low), float(high))

    def spread(self, count: int) -> Real:
        """So many values from one end of the range to the other, equally far on its scale."""
        spaced = np.geomspace if self.logarithmic else np.linspace
        return spaced(self.low, self.high, count)

    @property
    def range_name(self) -> str:
        """How messages call the range."""
        return f"the range of {parameter_name(self.parameter)}"

    def check_start(self, value: float) -> None:
        """Refuse an orbit outside the range."""
        slack = SLACK * max(abs(self.low), abs(self.high))
        if not self.low - slack <= value <= self.high + slack:
            raise SystemModelError(
                f"the orbit at {told_value(self.parameter, value)} lies outside {self.range_name} "
                f"= ({self.low:g}, {self.high:g})"
            )

    @property
    def logarithmic(self) -> bool:
        """Whether the logarithm is followed."""
        return self.low > 0.0 and not self.unit

    @property
    def _width(self) -> float:
        return self.unit or self.high - self.low

    @property
    def scale(self) -> tuple[Parameter, bool, float]:
        """The parameter, whether its logarithm is followed, and else what counts as 1."""
        linear = not (self.logarithmic or self.parameter.name == FREQUENCY)
        return self.parameter, not linear, self._width if linear else 0.0

    def over(self, limits: tuple[float, float]) -> Chart:
        """The same scale over another range.

        Raises
        ------
        SystemModelError
            If the parameter cannot have these values, or the scale is that of the logarithm, which
            does not reach down to zero.
        """
        wanted = Chart.of(self.parameter, limits)
        if not self.logarithmic:
            return replace(wanted, unit=self._width)
        if not wanted.logarithmic:
            raise SystemModelError(
                f"{self.range_name} was followed on a logarithmic scale, which does not reach "
                f"{wanted.low:g}: begin anew with a range that does"
            )
        return wanted

    def coordinate(self, value: float) -> float:
        """Coordinate of a value."""
        if self.parameter.name == FREQUENCY:
            return math.log(2.0 * math.pi * value)
        return math.log(value) if self.logarithmic else value / self._width

    def value(self, coordinate: float) -> float:
        """Value at a coordinate; rounding does not carry it past an end of the range."""
        value = math.exp(coordinate) if self.logarithmic else coordinate * self._width
        if self.parameter.name == FREQUENCY:
            value /= 2.0 * math.pi
        for end in (self.low, self.high):
            if abs(value - end) <= LAST_DIGIT * max(abs(self.low), abs(self.high)):
                return end
        return value

    def slope(self, coordinate: float) -> float:
        """Derivative of the value with respect to the coordinate."""
        if self.parameter.name == FREQUENCY:
            return math.exp(coordinate) / (2.0 * math.pi)
        return math.exp(coordinate) if self.logarithmic else self._width
