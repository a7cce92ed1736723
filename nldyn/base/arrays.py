"""Names of the kinds of arrays, and what rounding may do to numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

SLACK = 1e-9  # relative difference of two numbers that were meant to be one
TINY = 1e-300  # in place of a divisor that is zero: the quotient stays finite
