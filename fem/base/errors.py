"""The one exception of the package, and a warning."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import TypeGuard


class ModelError(ValueError):
    """A mesh or model that cannot be used; the text is one sentence that names item and place."""


class JointWarning(UserWarning):
    """Parts that share nodes but can move against each other there."""


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


def listed(source: str, name: str, given: object, kind: type[object]) -> tuple[object, ...]:
    """The items of a model's list as a tuple; ModelError unless all are of a kind."""
    if not (isinstance(given, Sequence) and all(isinstance(item, kind) for item in given)):
        raise ModelError(f"{source}: {name} must be a list of {kind.__name__}, not {given!r}")
    return tuple(given)


def by_name(source: str, name: str, given: object, kind: object, words: str) -> dict[str, object]:
    """The items of a model's table as a dictionary; ModelError unless all are of a kind."""
    items = given.values() if isinstance(given, Mapping) else [None]
    if not all(isinstance(item, kind) for item in items):  # type: ignore[arg-type]
        raise ModelError(f"{source}: {name} must be a dictionary {words}, not {given!r}")
    return dict(given)  # type: ignore[call-overload, no-any-return]
