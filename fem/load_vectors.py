"""Load vectors of what acts on a whole component: weight, and motions of the base."""

from __future__ import annotations

from collections.abc import Container, Sequence

import numpy as np

from fem.errors import ModelError
from fem.mesh import FloatArray


def inertia_load(
    inertia: FloatArray, names: Container[str], name: str, acceleration: Sequence[float]
) -> FloatArray:
    """Load vector (N,) of an acceleration, by the ``inertia`` (N, 2 or 3) of a component.

    Raises
    ------
    ModelError
        If the name is among those in use, or no mass is moved that way.
    """
    if name in names:
        raise ModelError(f"there is an interface named '{name}' already")
    axes = inertia.shape[1]
    along = np.zeros(3)
    along[: len(acceleration)] = acceleration
    if np.any(along[axes:]):
        raise ModelError("a plane frame cannot be accelerated along z, out of its plane")
    vector = inertia @ along[:axes]
    if not np.any(vector):
        raise ModelError(f"nothing moves along the acceleration {along.tolist()}")
    vector.setflags(write=False)
    return np.asarray(vector)
