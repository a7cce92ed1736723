"""Spring-mass chains, whose frequencies are known in closed form."""

from __future__ import annotations

import numpy as np
from scipy import sparse

import cms


def chain(size, left=1.0, right=0.0, stiffness=1.0, mass=1.0, interfaces=None):
    """Unit chain; ``left`` and ``right`` are the ground springs in units of ``stiffness``."""
    main = np.full(size, 2.0)
    main[0], main[-1] = 1.0 + left, 1.0 + right
    if size == 1:
        main[0] = left + right
    off = -np.ones(size - 1)
    matrix = sparse.diags_array([off, main, off], offsets=[-1, 0, 1], format="csc")
    if interfaces is None:
        interfaces = {"tip": size - 1}
    vectors = {name: np.eye(1, size, at)[0] for name, at in interfaces.items()}
    return cms.Matrices(stiffness * matrix, mass * sparse.eye_array(size, format="csc"), vectors)


def fixed_free_hz(size, stiffness=1.0, mass=1.0):
    k = np.arange(1, size + 1)
    omega = 2 * np.sqrt(stiffness / mass) * np.sin((2 * k - 1) * np.pi / (2 * (2 * size + 1)))
    return omega / (2 * np.pi)


def free_free_hz(size):
    return 2 * np.sin(np.arange(size) * np.pi / (2 * size)) / (2 * np.pi)
