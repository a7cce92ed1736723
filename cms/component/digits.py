"""How many digits the entries of a matrix have, and what that leaves of it undetermined."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cms.base.errors import ReductionError

FloatArray = NDArray[np.float64]

EPS = float(np.finfo(np.float64).eps)
FEWEST_DIGITS = 6  # fewer are taken for exact numbers, such as 2 or 16877
FEWEST_IN_DOUBT = 4  # so few may be of either kind: what hangs on it is refused
MOST_DIGITS = 15  # from 16 on the rounding is that of double precision
SAMPLE = 4000
FEWEST_VALUES = 3
SHARE = 0.25
DEVIATIONS = 6.0
EXACT = 3
SECOND_ORDER = 2.0  # a mode is one of the rounded matrix and not of the exact one


def significant_digits(value: float) -> int:
    """Decimal digits that a number needs to be read back as it is.

    Examples
    --------
    >>> significant_digits(1200.0), significant_digits(0.25), significant_digits(1 / 3)
    (2, 2, 16)
    """
    mantissa = repr(abs(float(value))).split("e")[0].replace(".", "")
    return max(len(mantissa.strip("0")), 1)


def digits_of(entries: FloatArray) -> NDArray[np.intp]:
    """Significant digits of each number among the entries, or of a sample of them."""
    values = np.unique(np.abs(entries[entries != 0.0]))
    if values.size > SAMPLE:
        values = np.random.default_rng(0).choice(values, SAMPLE, replace=False)
    return np.array([significant_digits(value) for value in values], dtype=np.intp)


def entry_digits(entries: FloatArray) -> int | None:
    """Digits to which the entries have been rounded; None if they show no rounding.

    Rounded numbers differ from exact ones, such as 2 or 16877, in that many of them use all digits.
    """
    return _shown_digits(entries, FEWEST_DIGITS, MOST_DIGITS, FEWEST_VALUES)


def doubtful_digits(entries: FloatArray) -> int | None:
    """Digits to which the entries may have been rounded, or typed in; None if there are too few.

    A quarter of the numbers, and at least two, use all of 4 to 14 digits.
    """
    return _shown_digits(entries, FEWEST_IN_DOUBT, MOST_DIGITS - 1, FEWEST_VALUES - 1)


def _shown_digits(entries: FloatArray, fewest: int, most: int, values: int) -> int | None:
    """Digits, from fewest to most, that a share of the numbers, and so many, use; else None."""
    counts = digits_of(entries)
    if not counts.size or not fewest <= counts.max() <= most:
        return None
    full = np.count_nonzero(counts >= counts.max() - 1)
    return int(counts.max()) if full >= max(values, SHARE * counts.size) else None


def relative_rounding(digits: int | None) -> float:
    """Largest relative error of an entry that was rounded to so many decimal digits."""
    return 0.0 if digits is None or digits > MOST_DIGITS else 0.5 * 10.0 ** (1 - digits)


def checked_digits(given: object) -> int | None:
    """The digits that a component states, or ReductionError."""
    if given is None:
        return None
    if isinstance(given, bool) or not isinstance(given, int | np.integer) or not 3 <= given <= 17:
        raise ReductionError(f"digits = {given!r} must be a whole number from 3 to 17")
    return int(given)


def rounded_energies(matrix: Any, vectors: FloatArray, rounding: float) -> FloatArray:
    r"""What ``v^T E v`` (k,) may be if E is the rounding of the entries of a sparse matrix.

    Entries of one size have one error e between plus and minus ``rounding`` times that size; with
    :math:`s = \sum \pm v_i v_j` over them, the sum of all :math:`|e s|` is a bound, and six
    standard deviations of errors that are spread evenly are the smaller one where there are many.
    Entries that have three digits less than rounding left them are exact.
    """
    entries = matrix.tocoo()
    rows, columns = entries.coords
    sizes, group = np.unique(np.abs(entries.data), return_inverse=True)
    signs = np.sign(entries.data)
    error_of = rounding * sizes * inexact(sizes, rounding)
    found = []
    for vector in vectors.T:
        share = signs * vector[rows] * vector[columns]
        error = error_of * np.abs(np.bincount(group, share, sizes.size))
        found.append(min(np.sum(error), DEVIATIONS * np.sqrt(np.sum(error**2) / 3.0)))
    return SECOND_ORDER * np.array(found)


def inexact(sizes: FloatArray, rounding: float) -> NDArray[np.bool_]:
    """Whether numbers use the digits that rounding left them."""
    digits = round(1.0 - np.log10(2.0 * rounding))
    if sizes.size > SAMPLE:
        return np.ones(sizes.size, dtype=np.bool_)
    return np.array([significant_digits(size) > digits - EXACT for size in sizes])
