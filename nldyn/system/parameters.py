"""Numbers of a system with respect to which motions have exact derivatives."""

from __future__ import annotations

from dataclasses import dataclass

from nldyn.base.arrays import SLACK
from nldyn.base.errors import SystemModelError, check_types, check_whole
from nldyn.system.loads import Excitation
from nldyn.system.round_stop import RoundStop
from nldyn.system.springs_dampers import LARGEST_DEGREE, PolynomialSpring
from nldyn.system.system import System

OF_STOPS = ("gap", "stiffness", "exponent", "dissipation", "dashpot", "restitution")
# of round clearances, and the numbers of stops that they have, too
OF_ROUND = ("clearance", "rubbing_friction", "first_eccentricity", "second_eccentricity")
SHARED = ("stiffness", "exponent", "dissipation")
OF_SPRINGS = tuple(f"k{power}" for power in range(1, LARGEST_DEGREE + 1))
OF_SLIDERS = {  # and what it is there
    "friction": "coefficient",
    "normal_force": "normal_force",
    "tangential_stiffness": "tangential_stiffness",
}
OF_AREAS = {  # and which number of their stops it is
    "area_gap": "gap",
    "area_stiffness": "stiffness",
    "area_friction": "friction",
}
SOURCES = ("amplitude", "mass_times_radius", "force")
EXACT = (*OF_STOPS, *OF_AREAS, *OF_ROUND, *SOURCES, *OF_SLIDERS, *OF_SPRINGS)


def strength_name(source: Excitation) -> str:
    """Name of the number that says how strong a source of excitation is."""
    return next(name for name in SOURCES if hasattr(source, name))


def strength(source: Excitation) -> float:
    """How strong a source of excitation is, in the unit of its kind."""
    return float(getattr(source, strength_name(source)))


@dataclass(frozen=True)
class Parameter:
    """A number of a system.

    Motions have exact derivatives by the numbers of stops and excitations. `continue_branch`
    and the like know those of dampers and modes, too, see `nldyn.system.chart`.

    Parameters
    ----------
    name : str
        gap, stiffness, exponent, dissipation, dashpot or restitution of a stop (not of one with a
        law of its own, but for the gap); clearance, rubbing_friction (the coefficient),
        first_eccentricity or second_eccentricity of a round clearance; amplitude,
        mass_times_radius or force of an excitation; k1, k2, ..., the coefficients of a polynomial
        spring; friction (the coefficient), normal_force and
        tangential_stiffness of a slider; area_gap (the smallest),
        area_stiffness (per m² or m) and area_friction of an area of contact.
    index : int
        Which of the stops, excitations, springs, sliders (`System.sliders`), areas
        (`System.areas`), dampers or modes of the system.

    Raises
    ------
    SystemModelError
        If the name is no text, or the index no whole number of at least -1.

    Examples
    --------
    >>> import numpy as np
    >>> from nldyn import FlowMap, Parameter, Stop, System, Unbalance
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> flow = FlowMap(system)
    >>> segments = flow.shoot(np.zeros((1, 2)), np.array([0.0, 2 * np.pi]), 160.0,
    ...     parameters=[Parameter("gap"), Parameter("mass_times_radius")])
    >>> segments.d_parameters.shape
    (1, 2, 2)
    """

    name: str
    index: int = 0

    def __post_init__(self) -> None:
        check_types(**{"Parameter: name": (self.name, str)})
        check_whole("Parameter: index", self.index, -1)


def check_exact(system: System, parameter: Parameter) -> None:
    """Refuse a parameter with exact derivatives that the system does not have.

    Raises
    ------
    SystemModelError
        As said.
    """
    name, index = parameter.name, parameter.index
    if name in OF_STOPS:
        check_index(parameter, "stop", len(system.stops))
        stop = system.stops[index]
        around = isinstance(stop, RoundStop)
        of_ring = ("restitution",) if stop.impulsive else SHARED
        if not hasattr(stop, name) or (around and name not in of_ring):
            kind = "rigid" if stop.impulsive else "a round clearance" if around else "elastic"
            raise SystemModelError(f"parameter '{name}': stops[{index}] is {kind}, without {name}")
        if name != "gap" and stop.law is not None:
            raise SystemModelError(
                f"parameter '{name}': stops[{index}] has a law of its own, which knows no {name}"
            )
    elif name in OF_AREAS:
        check_index(parameter, "area of contact", len(system.areas))
        points = system.area_stops(index)
        if name == "area_friction" and points[0].friction is None:
            raise SystemModelError(f"parameter '{name}': area '{points[0].area}' has no friction")
        if name == "area_stiffness" and any(stop.law is not None for stop in points):
            raise SystemModelError(
                f"parameter '{name}': area '{points[0].area}' has a law of its own, which knows no "
                "stiffness"
            )
        each = [stop.stiffness / stop.share for stop in points]
        together = any(map(system.coupled.involves, list(system.areas.values())[index]))
        if name == "area_stiffness" and (together or max(each) - min(each) > SLACK * max(each)):
            raise SystemModelError(
                f"parameter '{name}': the points of area '{points[0].area}' have no mass, so that "
                "the stiffness of each is in series with what gives way at once"
            )
    elif name in OF_ROUND:
        check_round(system, parameter, turns=name == "rubbing_friction")
    elif name in SOURCES:
        check_index(parameter, "excitation", len(system.excitation))
        if not hasattr(system.excitation[index], name):
            raise SystemModelError(f"parameter '{name}': excitation {index} has no {name}")
    elif name in OF_SPRINGS:
        check_index(parameter, "spring", len(system.springs))
        spring = system.springs[index]
        degree = len(spring.coefficients) if isinstance(spring, PolynomialSpring) else 0
        if int(name[1:]) > degree:
            raise SystemModelError(
                f"parameter '{name}': spring {index} has no such coefficient"
                + ("; that of a linear one is spring_stiffness" if degree == 0 else "")
            )
    elif name in OF_SLIDERS:
        check_index(parameter, "slider", len(system.sliders))
        if name == "normal_force" and system.sliders[index].stop >= 0:
            raise SystemModelError(
                f"parameter '{name}': a stop presses slider {index} on, no constant force"
            )
        if name == "tangential_stiffness" and index not in system.sprung:
            raise SystemModelError(
                f"parameter '{name}': slider {index} has no spring before it: give its friction a "
                "tangential_stiffness"
            )
    else:
        raise SystemModelError(f"unknown parameter '{name}'; there are: {', '.join(EXACT)}")


def check_round(system: System, parameter: Parameter, *, turns: bool) -> None:
    """Refuse the number of a stop that is no round clearance, or has no speed of its surface."""
    name, index = parameter.name, parameter.index
    check_index(parameter, "stop", len(system.stops))
    if index not in system.round_stops:
        raise SystemModelError(f"parameter '{name}': stops[{index}] is no round clearance")
    if turns and system.round_stops[index].surface_speed is None:
        raise SystemModelError(
            f"parameter '{name}': stops[{index}] has no surface_speed, which friction needs"
        )


def check_index(parameter: Parameter, kind: str, count: int) -> None:
    """Refuse the number of an element that there is not."""
    if not 0 <= parameter.index < count:
        known = f"there are {count}, counted from 0" if count else "the system has none"
        raise SystemModelError(
            f"parameter '{parameter.name}': there is no {kind} {parameter.index}; {known}"
        )
