"""What the elements of a system are called in sentences and pictures."""

from __future__ import annotations

from collections.abc import Sequence

from nldyn.system.rigid_stop import AnyStop


def is_angle(direction: str) -> bool:
    """Whether an interface turns, by its direction."""
    return direction.startswith("rotation")


def moment_unit(unit: str) -> str:
    """Unit of what acts along a displacement of a unit.

    Examples
    --------
    >>> moment_unit("rad"), moment_unit("m")
    ('N m', 'N')
    """
    return "N m" if unit == "rad" else "N"


def stop_name(stops: Sequence[AnyStop], index: int) -> str:
    """Name a stop by its interfaces and, where several share them, by its direction and gap.

    Numbers are no names: Python and the keys of a scene count from 0, people from 1.

    Examples
    --------
    >>> from nldyn import Stop
    >>> pair = [Stop.linear("tip", 1e6, gap=1e-3, direction=d) for d in (1, -1)]
    >>> stop_name(pair, 1), stop_name(pair[:1], 0)
    ("stop at 'tip', direction -1", "stop at 'tip'")
    """
    stop = stops[index]
    name = f"stop at '{stop.at}'" + (f" against '{stop.against}'" if stop.against else "")
    alike = [other for other in stops if (other.at, other.against) == (stop.at, stop.against)]
    if any(other.direction != stop.direction for other in alike):
        name += f", direction {stop.direction:+d}"
    if any(other.direction == stop.direction and other.gap != stop.gap for other in alike):
        name += f", gap {stop.gap:g} m"
    return name
