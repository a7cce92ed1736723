"""Words and units of what an interface does."""

from __future__ import annotations

from collections.abc import Sequence

LENGTHS = ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm"))
ANGLES = ((1.0, "rad"), (1e-3, "mrad"), (1e-6, "µrad"), (1e-9, "nrad"))


def is_angle(direction: str) -> bool:
    """Whether an interface turns, by its direction."""
    return direction.startswith("rotation")


def units_of(direction: str) -> Sequence[tuple[float, str]]:
    """The units of what an interface does, the largest first."""
    return ANGLES if is_angle(direction) else LENGTHS


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
