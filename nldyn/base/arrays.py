"""Names of the kinds of arrays, and what rounding may do to numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

SLACK = 1e-9  # relative difference of two numbers that were meant to be one
TINY = 1e-300  # in place of a divisor that is zero: the quotient stays finite


def hermite(x: float, first: Real, last: Real, start: Real, end: Real) -> Real:
    """Cubic at x in [0, 1] through two points, with slopes there by x.

    Examples
    --------
    >>> float(hermite(0.5, np.array(0.0), np.array(1.0), np.array(0.0), np.array(2.0)))  # x²
    0.25
    """
    return np.asarray(
        (1.0 + 2.0 * x) * (1.0 - x) ** 2 * first
        + x * (1.0 - x) ** 2 * start
        + x * x * (3.0 - 2.0 * x) * last
        + x * x * (x - 1.0) * end
    )
