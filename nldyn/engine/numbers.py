"""Arrays as the engine takes them: one after the other in memory, of its own types."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nldyn.base.arrays import Complex, Real


def reals(values: ArrayLike) -> Real:
    """Floating-point numbers, row by row."""
    return np.ascontiguousarray(values, dtype=np.float64)


def complexes(values: ArrayLike) -> Complex:
    """Complex numbers, row by row."""
    return np.ascontiguousarray(values, dtype=np.complex128)


def flags(values: ArrayLike) -> NDArray[np.bool_]:
    """Truth values, a byte each."""
    return np.ascontiguousarray(values, dtype=np.bool_)
