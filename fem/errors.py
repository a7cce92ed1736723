"""The one exception of the package."""

from __future__ import annotations

import math
from numbers import Real
from typing import TypeGuard


class ModelError(ValueError):
    """A mesh or model that cannot be used; the text is one sentence that names item and place."""


def is_finite(value: object) -> TypeGuard[float]:
    """Whether a value is a finite real number: not text, not a truth value.

    Examples
    --------
    >>> is_finite(7746), is_finite("7746"), is_finite(float("nan"))
    (True, False, False)
    """
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond the floating-point numbers
        return False


def quoted(names: object) -> str:
    """List names in quotes for an error text, or say that there are none.

    Examples
    --------
    >>> quoted(["beam", "leaf"])
    "'beam', 'leaf'"
    >>> quoted([])
    'none'
    """
    return ", ".join(repr(str(name)) for name in names) or "none"  # type: ignore[attr-defined]


def check_positive(owner: object, **values: object) -> None:
    """Raise ModelError for the first value that is not a positive finite number."""
    for name, value in values.items():
        if not (is_finite(value) and value > 0.0):
            raise ModelError(f"{owner}: {name} must be positive and finite, not {value!r}")
