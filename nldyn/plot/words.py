"""Words and units of what an interface does, and of what a diagram is drawn over."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from nldyn.base.errors import check_choice
from nldyn.orbits.history import told
from nldyn.system.chart import FREQUENCY, parameter_name, unit_of, unit_within, words_of
from nldyn.system.naming import is_angle, moment_unit
from nldyn.system.parameters import OF_SLIDERS, Parameter
from nldyn.system.system import System

LENGTHS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
ANGLES = ((1.0, "rad"), (1e-3, "mrad"), (1e-6, "µrad"), (1e-9, "nrad"))
FORCES = ((1e6, "MN"), (1e3, "kN"), (1.0, "N"), (1e-3, "mN"), (1e-6, "µN"))
ENERGIES = ((1e3, "kJ"), (1.0, "J"), (1e-3, "mJ"), (1e-6, "µJ"), (1e-9, "nJ"))
MOMENTS = tuple((factor, f"{name} m") for factor, name in FORCES)
PREFIXED = {"m": LENGTHS, "rad": ANGLES, "N": FORCES, "N m": MOMENTS, "J": ENERGIES}


@dataclass(frozen=True)
class Along:
    """How the values along a diagram are told: of the frequency, or of another parameter.

    Parameters
    ----------
    parameter : Parameter
        What changes.
    factor : float
        The unit that is told, in SI units.
    unit : str
        Its name, empty for a number without one.
    at : str
        Interface of what slides, where several do.

    Examples
    --------
    >>> from nldyn.system.chart import THE_FREQUENCY
    >>> gap = Along.of(Parameter("gap"), 5e-5)
    >>> gap.told(1.23e-5), gap.label, Along.of(THE_FREQUENCY, 90.0).told(23.0)
    ('gap 12.3 µm', 'gap (µm)', '23 Hz')
    """

    parameter: Parameter
    factor: float = 1.0
    unit: str = "Hz"
    at: str = ""

    @classmethod
    def of(cls, parameter: Parameter, largest: float, system: System | None = None) -> Along:
        """For values up to a largest one; of a system, whose stops may act on rotations."""
        unit = unit_of(parameter) if system is None else unit_within(system, parameter)
        several = system is not None and parameter.name in OF_SLIDERS and len(system.sliders) > 1
        at = system.sliders[parameter.index].at if system is not None and several else ""
        if unit in PREFIXED:
            return cls(parameter, *axis_unit(largest, PREFIXED[unit]), at)
        return cls(parameter, 1.0, "" if unit == "1" else unit, at)

    @property
    def in_frequency(self) -> bool:
        """Whether it is the excitation frequency that changes."""
        return self.parameter.name == FREQUENCY

    @property
    def column(self) -> str:
        """Name of the column of values in SI units."""
        return parameter_name(self.parameter)

    @property
    def noun(self) -> str:
        """What changes."""
        if self.at:
            return f"{words_of(Parameter(self.parameter.name))} of '{self.at}'"
        return words_of(self.parameter)

    @property
    def label(self) -> str:
        """Name with unit, for an axis."""
        return f"{'excitation ' * self.in_frequency}{self.head}"

    @property
    def head(self) -> str:
        """Name with unit, for the head of a column."""
        return f"{self.noun} ({self.unit})" if self.unit else self.noun

    def told(self, value: float, digits: int = 5) -> str:
        """A value in words."""
        name = "" if self.in_frequency else f"{self.noun} {'' if self.unit else '= '}"
        return f"{name}{self.number(value, digits=digits)}"

    def beside(self, value: float, digits: int = 5) -> str:
        """A value behind the frequency of an orbit; empty where it is that."""
        return "" if self.in_frequency else f", {self.told(value, digits)}"

    def number(self, *values: float, digits: int = 5, sep: str = ", ") -> str:
        """Values with their unit."""
        text = sep.join(f"{value / self.factor:.{digits}g}" for value in values)
        return f"{text} {self.unit}".rstrip()

    def span(self, low: float, high: float, digits: int = 5) -> str:
        """A range in words."""
        return self.number(*((low, high) if high > low else (low,)), digits=digits, sep=" to ")

    def range(self, low: float, high: float) -> str:
        """The range of a diagram in words."""
        return ("" if self.in_frequency else f"{self.noun} ") + self.span(low, high, 6)


def axis_unit(largest: float, units: Sequence[tuple[float, str]]) -> tuple[float, str]:
    """Choose one of some units, the largest first, for an axis that reaches up to a value.

    Examples
    --------
    >>> axis_unit(1.3e-3, ((1.0, "s"), (1e-3, "ms")))
    (0.001, 'ms')
    """
    size = abs(largest)
    for factor, name in units:
        if size >= 0.5 * factor:
            return factor, name
    return units[-1] if 0.0 < size < math.inf else units[0]


def units_of(direction: str) -> Sequence[tuple[float, str]]:
    """The units of what an interface does, the largest first."""
    return ANGLES if is_angle(direction) else LENGTHS


def direction_of(system: System, interface: str, told: str = "") -> str:
    """The direction of an interface as it was told, or that it is a rotation."""
    return told or ("rotation" if system.unit(interface) == "rad" else "")


def unit_in(measure: str, largest: float, chosen: str | None = None) -> tuple[float, str]:
    """Choose the unit for values in m, rad, N, N m or J up to a largest one; in another, that.

    Raises
    ------
    SystemModelError
        If a chosen unit is none of these.

    Examples
    --------
    >>> unit_in("m", 2.3e-4), unit_in("N m", 2300.0), unit_in("m, rad", 1e-5)
    ((1e-06, 'µm'), (1000.0, 'kN m'), (1.0, 'm, rad'))
    """
    units = PREFIXED.get(measure, ((1.0, measure),))
    if chosen is None:
        return axis_unit(largest, units)
    check_choice("unit", chosen, [name for _, name in units])
    return next(each for each in units if each[1] == chosen)


def told_of(system: System, interface: str, direction: str = "") -> str:
    """What is drawn of an interface of a system, in words; see `displacement_of`."""
    return displacement_of(interface, direction_of(system, interface, direction))


def forces_of(system: System) -> tuple[str, str]:
    """What the stops of a system act with, in words, and its unit.

    Examples
    --------
    >>> from nldyn import Stop
    >>> forces_of(System.from_modal([10.0], {"tip": [1.0]}, stops=[Stop("tip", 1e6)]))
    ('contact force', 'N')
    """
    unit = told(moment_unit(system.unit(stop.at)) for stop in system.stops) or "N"
    return "contact moment" if unit == "N m" else "contact force", unit


def displacement_of(name: str = "", direction: str = "") -> str:
    """What is drawn of an interface, with its direction where that is known.

    Examples
    --------
    >>> displacement_of("tip", "y"), displacement_of("tip"), displacement_of()
    ('displacement of tip along y', 'displacement of tip', 'displacement')
    >>> displacement_of("joint", "rotation_z")
    'rotation of joint about z'
    """
    what = "rotation" if is_angle(direction) else "displacement"
    of = f" of {name}" if name else ""
    axis = direction.removeprefix("rotation").removeprefix("_")
    way = f" {'about' if is_angle(direction) else 'along'} {axis}" if name and axis else ""
    return f"{what}{of}{way}"
