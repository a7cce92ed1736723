"""Arrays that users hand over, checked and kept from being written to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from fem.base.arrays import IntArray
from fem.base.errors import ModelError

Number = TypeVar("Number", np.float64, np.int64)


def numbers(what: str, values: npt.ArrayLike, dtype: type[Number]) -> npt.NDArray[Number]:
    """A copy that cannot be written to, or a ModelError that says what holds no numbers."""
    try:
        array = np.array(values, dtype=dtype)
    except (TypeError, ValueError):
        raise ModelError(f"{what} must be numbers, as many in each row") from None
    array.setflags(write=False)
    return array


def index_sets(what: str, sets: Mapping[str, npt.ArrayLike]) -> dict[str, IntArray]:
    found = {}
    for name, indices in sets.items():
        owner = f"{what} {name!r}"
        found[str(name)] = numbers(owner, np.unique(numbers(owner, indices, np.int64)), np.int64)
    return found
