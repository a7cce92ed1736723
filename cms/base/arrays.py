"""Names of arrays."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32 | np.int64]
SparseMatrix: TypeAlias = "sparse.csc_array[np.float64]"
