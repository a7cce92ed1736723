"""Names of the kinds of arrays, and the least number to divide by."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

TINY = 1e-300  # in place of a divisor that is zero: the quotient stays finite
