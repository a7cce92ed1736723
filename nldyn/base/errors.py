"""The errors that nldyn raises: for bad input, and for computations that fail."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from contextlib import ContextDecorator
from difflib import get_close_matches
from numbers import Integral, Real
from reprlib import repr as shortened
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

SMALLEST_FREQUENCY, LARGEST_FREQUENCY = 1e-12, 1e12  # Hz, of an excitation
LARGEST_DENSE = 500  # rows of a sparse matrix that is taken as it is


class SystemModelError(ValueError):
    """A system, stop, damper or excitation that cannot be modelled; one sentence says why."""


class KeptWorkError(SystemModelError):
    """A file of unfinished work that holds that of something else; one sentence says what."""


class SceneError(ValueError):
    """A scene file that cannot be used; one sentence names the file, the key and the reason."""


def shown(value: object) -> str:
    """A value as an error text shows it: shortened to about 40 characters."""
    return shortened(value)


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Give the known name that ``name`` is most likely a typing error of."""
    matches = get_close_matches(name.lower(), list(known), n=1, cutoff=0.6)
    return matches[0] if matches else None


def is_finite(value: object) -> TypeGuard[float]:
    """Whether a value is a finite real number: not text, not a truth value."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number beyond the floating-point numbers
        return False


def check_frequency(name: str, value: object) -> None:
    """Refuse anything but a frequency in Hz that an excitation can have, under its name."""
    if not (is_finite(value) and SMALLEST_FREQUENCY <= value <= LARGEST_FREQUENCY):
        raise SystemModelError(
            f"{name} must be positive, from {SMALLEST_FREQUENCY:g} to {LARGEST_FREQUENCY:g}, "
            f"got {shown(value)}"
        )


def check_range(range_hz: tuple[float, float], name: str = "range_hz") -> tuple[float, float]:
    """A frequency range as two floats, or a SystemModelError that says what is wrong."""
    ends = numbers(name, range_hz)
    if ends.shape != (2,):
        raise SystemModelError(f"{name} must be two frequencies, got {shown(range_hz)}")
    low, high = ends.tolist()
    if not SMALLEST_FREQUENCY <= low < high <= LARGEST_FREQUENCY:
        raise SystemModelError(
            f"{name} must be two positive frequencies, ascending, from {SMALLEST_FREQUENCY:g} "
            f"to {LARGEST_FREQUENCY:g}; got ({low:g}, {high:g})"
        )
    return low, high


def numbers(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """An array of finite floats, or a SystemModelError under the name."""
    if sparse.issparse(values):
        values = dense(name, values)
    try:
        if values is None or np.iscomplexobj(values):
            raise TypeError
        array = np.array(values, dtype=float)  # a copy: the caller may change the original
    except (TypeError, ValueError, OverflowError):
        raise SystemModelError(f"{name} must hold numbers only") from None
    if not np.all(np.isfinite(array)):
        raise SystemModelError(f"{name} has an entry that is not finite")
    return array


def dense(name: str, values: Any) -> NDArray[Any]:
    """A sparse matrix as an array, or a SystemModelError where it is too large for a system."""
    if max(values.shape) > LARGEST_DENSE:
        raise SystemModelError(
            f"{name} is a sparse matrix of {values.shape[0]} rows, more than {LARGEST_DENSE}: "
            "reduce the component first, by cms.reduce, and use System.from_reduced"
        )
    return np.asarray(values.toarray())


def check_types(**arguments: tuple[Any, ...]) -> None:
    """Refuse arguments of a wrong type: each a value with its classes, None if optional.

    Examples
    --------
    >>> check_types(name=(3, str))
    Traceback (most recent call last):
        ...
    nldyn.base.errors.SystemModelError: name must be a str, got 3
    """
    for name, (value, *classes) in arguments.items():
        if not any(value is None if c is None else isinstance(value, c) for c in classes):
            words = " or ".join(_article(c) for c in classes)
            raise SystemModelError(f"{name} must be {words}, got {shown(value)}")


def _article(kind: Any) -> str:
    if kind is None or kind is Callable:
        return "None" if kind is None else "a function"
    name: str = kind.__name__
    return f"an {name}" if name[0] in "AEIOU" else f"a {name}"


def check_choice(name: str, value: object, choices: Iterable[str]) -> None:
    """Refuse anything but one of some words, under its name."""
    words = tuple(choices)
    if not (isinstance(value, str) and value in words):
        raise SystemModelError(f"{name} must be one of {', '.join(words)}, got {shown(value)}")


def check_positive(name: str, value: object) -> None:
    """Refuse anything but a positive, finite number, under its name."""
    if not (is_finite(value) and value > 0.0):
        raise SystemModelError(f"{name} must be a positive number, got {shown(value)}")


def check_whole(name: str, value: object, least: int, most: int | None = None) -> None:
    """Refuse anything but a whole number from ``least`` to ``most``, under its name."""
    whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not whole or value < least or (most is not None and value > most):  # type: ignore[operator]
        wanted = f"of at least {least}" if most is None else f"from {least} to {most}"
        raise SystemModelError(f"{name} must be a whole number {wanted}, got {shown(value)}")


class ComputationError(RuntimeError):
    """A computation that fails though what it was given is sound."""


class ConvergenceError(ComputationError):
    """No orbit was found; the text says how far Newton's method came."""


class LocateError(ComputationError):
    """An orbit between two points of a branch could not be corrected."""


# What a computation from sound input may end in: its steps may lead to numbers that no system can
# have, that are too large, or to equations that have no solution.
FAILURES = (ComputationError, SystemModelError, ArithmeticError, np.linalg.LinAlgError)


class _FailingAs(ContextDecorator):
    """See `failing_as`."""

    def __init__(self, kind: type[ComputationError]) -> None:
        self.kind = kind

    def __enter__(self) -> None:
        """Nothing to prepare."""

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Raise a failure of the kind in place of any other."""
        if isinstance(error, FAILURES) and not isinstance(error, self.kind):
            raise self.kind(str(error)) from error


def failing_as(kind: type[ComputationError]) -> _FailingAs:
    """Tell what a computation from sound input ends in as one kind of failure.

    So that a number beyond all systems, met on the way, is not told as a fault of what was given.
    It may be written above a function, too.

    Examples
    --------
    >>> with failing_as(LocateError):
    ...     math.exp(1e3)
    Traceback (most recent call last):
        ...
    nldyn.base.errors.LocateError: math range error
    """
    return _FailingAs(kind)


def must_be_symmetric(name: str) -> str:
    """What is said of a matrix that is not, and where its skew part belongs."""
    skew = {"stiffness": "circulatory", "damping": "gyroscopic"}.get(name)
    hint = f"; a skew part, as of rotors, is given as {skew}" if skew else ""
    return f"must be symmetric{hint}"
