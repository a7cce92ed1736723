"""Checks of the values of stops, springs, dampers and loads."""

from __future__ import annotations

import numpy as np

from nldyn.base.errors import SystemModelError, check_types, is_finite, shown

# entries of a matrix that are meant to be equal, or both zero: relative to themselves, the largest
SAME_ENTRY, ZERO_ENTRY = 1e-10, 1e-12


def check_finite(owner: str, name: str, value: float) -> None:
    """Refuse what is no finite number."""
    if not is_finite(value):
        raise SystemModelError(f"{owner}: {name} must be a finite number, got {shown(value)}")


def check_positive(owner: str, name: str, value: float) -> None:
    """Refuse what is no finite number above zero."""
    check_finite(owner, name, value)
    if value <= 0.0:
        raise SystemModelError(f"{owner}: {name} must be positive, got {value:g}")


def check_not_negative(owner: str, name: str, value: float) -> None:
    """Refuse what is no finite number, or below zero."""
    check_finite(owner, name, value)
    if value < 0.0:
        raise SystemModelError(f"{owner}: {name} must not be negative, got {value:g}")


def check_restitution(owner: str, value: float | None) -> None:
    """Refuse what is no coefficient of restitution."""
    if value is None or not (is_finite(value) and 0.0 <= value <= 1.0):
        raise SystemModelError(f"{owner}: restitution must lie between 0 and 1, got {shown(value)}")


def check_ends(kind: str, at: object, against: object) -> None:
    """Refuse what names no interface, and one interface at both ends of an element."""
    check_types(**{f"{kind}: at": (at, str), f"{kind}: against": (against, str, None)})
    if against == at:
        raise SystemModelError(f"{kind} at '{at}': against must be another interface")


def check_sides(owner: str, at: str, against: str | None, direction: int) -> None:
    """Refuse a stop between an interface and itself, and a direction that is no sign."""
    if against == at:
        raise SystemModelError(f"{owner}: against must be another interface")
    if isinstance(direction, bool | np.bool_) or direction not in (1, -1):
        raise SystemModelError(f"{owner}: direction must be +1 or -1, got {direction}")
