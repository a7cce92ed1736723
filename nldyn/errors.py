"""The errors that nldyn raises for bad input."""

from __future__ import annotations

from numbers import Integral


class SystemModelError(ValueError):
    """A system, stop, damper or excitation that cannot be modelled; one sentence says why."""


class SceneError(ValueError):
    """A scene file that cannot be used; one sentence names the file, the key and the reason."""


def check_whole(name: str, value: object, least: int, most: int | None = None) -> None:
    """Refuse anything but a whole number from ``least`` to ``most``, under its name."""
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not whole or value < least or (most is not None and value > most):  # type: ignore[operator]
        wanted = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise SystemModelError(f"{name} must be a whole number {wanted}, got {value}")
