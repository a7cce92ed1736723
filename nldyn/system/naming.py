"""What the elements of a system are called in sentences and pictures."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TYPE_CHECKING

from nldyn.system.round_stop import RoundStop
from nldyn.system.stop import Stop

if TYPE_CHECKING:
    from nldyn.system.system import System


def is_angle(direction: str) -> bool:
    """Whether an interface turns, by its direction."""
    return direction.startswith("rotation")


def turned(unit: str) -> str:
    """What stands for a unit where something turns: rad for m, and N m for N.

    Examples
    --------
    >>> turned("m/s"), turned("N s/m"), turned("N/m^exponent"), turned("N/m per m²")
    ('rad/s', 'N m s/rad', 'N m/rad^exponent', 'N m/rad per m²')
    """
    if unit == "kg m":  # of an unbalance, which times a squared speed is a force
        return "kg m²"
    unit, per, area = unit.partition(" per ")  # what an area is measured in does not turn
    return re.sub(r"\bN\b", "N m", re.sub(r"\bm\b", "rad", unit)) + per + area


def moment_unit(unit: str) -> str:
    """Unit of what acts along a displacement of a unit.

    Examples
    --------
    >>> moment_unit("rad"), moment_unit("m")
    ('N m', 'N')
    """
    return turned("N") if unit == "rad" else "N"


def stop_name(system: System, index: int) -> str:
    """Name a stop by its interfaces and, where several share them, by its direction and gap.

    Numbers are no names: Python and the keys of a scene count from 0, people from 1.

    Examples
    --------
    >>> from nldyn import Stop, System
    >>> pair = [Stop.linear("tip", 1e6, gap=1e-3, direction=d) for d in (1, -1)]
    >>> stop_name(System.from_modal([10.0], {"tip": [1.0]}, stops=pair), 1)
    "stop at 'tip', direction -1"
    """
    stops, stop = system.stops, system.stops[index]
    if isinstance(stop, RoundStop):
        return _round_name(system, stop)
    if isinstance(stop, Stop) and stop.area is not None:
        points = system.areas[stop.area]
        return f"'{stop.area}', point {points.index(index) + 1} of {len(points)}"
    name = f"stop at '{stop.at}'" + (f" against '{stop.against}'" if stop.against else "")
    alike = [other for other in stops if (other.at, other.against) == (stop.at, stop.against)]
    if any(other.direction != stop.direction for other in alike):
        name += f", direction {stop.direction:+d}"
    if any(other.direction == stop.direction and other.gap != stop.gap for other in alike):
        name += f", gap {stop.gap:g} {system.unit(stop.at)}"
    return name


def _round_name(system: System, stop: RoundStop) -> str:
    """Name a round clearance by its plane and, where several share it, by its size."""
    name = f"{'ring' if stop.inside else 'pin'} at {quoted(stop.plane)}"
    name += f" against {quoted(stop.against_plane)}" if stop.against_plane else ""
    alike = [other for other in system.round_stops.values() if other.ends == stop.ends]
    return name if len(alike) == 1 else f"{name}, clearance {stop.clearance:g} m"


def slider_name(system: System, number: int) -> str:
    """Name one of all that rubs by its interfaces, and by the stop that presses it on.

    Examples
    --------
    >>> from nldyn import Stop, System
    >>> system = System.from_modal([10.0, 20.0], {"x": [1.0, 0.0], "y": [0.0, 1.0]},
    ...     stops=[Stop("x", 1e6, tangent="y", friction=0.3)])
    >>> slider_name(system, 0)
    "friction at 'y', stop at 'x'"
    """
    slider = system.rubbing[number]
    if slider.stop in system.round_stops:
        return f"friction, {stop_name(system, slider.stop)}"
    plane = "" if slider.across is None else f", '{slider.across[0]}'"
    name = f"friction at '{slider.at}'{plane}"
    name += f" against '{slider.against}'" if slider.against else ""
    return f"{name}, {stop_name(system, slider.stop)}" if slider.stop >= 0 else name


def quoted(names: Iterable[str]) -> str:
    """Some names in a sentence.

    Examples
    --------
    >>> quoted(["x", "y"])
    "'x', 'y'"
    """
    return ", ".join(f"'{name}'" for name in names)
