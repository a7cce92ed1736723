"""Periodic motions by harmonic balance, with forces from the time: shares no code with nldyn.

T. M. Cameron and J. H. Griffin (1989), J. Appl. Mech. 56, 149-154. Forces with memory are those of
the second of two equal periods.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Force = Callable[[Vector], Vector]  # of displacements (steps, n, k), the same of forces


def jenkins(strain: Vector, stiffness: float, limit: float) -> Vector:
    """Forces (steps, k) of sliders behind springs, from displacements in periodic motion."""
    force = np.zeros(strain.shape[1])
    found, last = np.empty_like(strain), strain[-1]
    for _ in range(2):
        for i, here in enumerate(strain):
            force = np.clip(force + stiffness * (here - last), -limit, limit)
            found[i], last = force, here
    return found


class HarmonicBalance:
    """M q'' + C q' + K q + force(q) = pull cos ωt, with so many harmonics.

    Coefficients (2 harmonics + 1, n) are those of the constant, the cosines and the sines.
    """

    def __init__(
        self, matrices: tuple[Vector, Vector, Vector], force: Force, pull: Vector, harmonics: int,
        steps: int,
    ) -> None:  # fmt: skip
        self.matrices, self.force, self.pull, self.harmonics = matrices, force, pull, harmonics
        turn = 2.0 * np.pi * np.outer(np.arange(steps) / steps, np.arange(1, harmonics + 1))
        self.waves = np.hstack([np.ones((steps, 1)), np.cos(turn), np.sin(turn)])
        self.analysis = 2.0 * self.waves.T / steps
        self.analysis[0] *= 0.5

    def linear(self, omega: float) -> Vector:
        """Matrix ((2 h + 1) n,) of the linear forces in the coefficients."""
        mass, damping, stiffness = self.matrices
        order, n, h = omega * np.arange(1, self.harmonics + 1), len(mass), self.harmonics
        found = np.zeros((2 * h + 1, n, 2 * h + 1, n))
        found[0, :, 0] = stiffness
        for k, w in enumerate(order, 1):
            found[k, :, k] = found[h + k, :, h + k] = stiffness - w**2 * mass
            found[k, :, h + k], found[h + k, :, k] = w * damping, -w * damping
        return found.reshape((2 * h + 1) * n, -1)

    def residual(self, linear: Vector, points: Vector) -> Vector:
        """What is missing (size, k) at coefficients (size, k)."""
        n, k = len(self.pull), points.shape[1]
        moved = np.tensordot(self.waves, points.reshape(-1, n, k), 1)
        acting = np.tensordot(self.analysis, self.force(moved), 1).reshape(-1, k)
        found = linear @ points + acting
        found[n : 2 * n] -= self.pull[:, None]
        return np.asarray(found)

    def solved(self, omega: float, guess: Vector) -> Vector:
        """Coefficients by Newton's method with differences, from a guess of the same shape."""
        n, linear = len(self.pull), self.linear(omega)
        point = guess.ravel()
        for _ in range(60):
            steps = 1e-7 * np.eye(point.size)
            tried = self.residual(linear, point[:, None] + np.hstack([steps, 0.0 * steps[:, :1]]))
            step = np.linalg.solve((tried[:, :-1] - tried[:, -1:]) / 1e-7, -tried[:, -1])
            point = point + step * min(1.0, 0.3 / np.abs(step).max())
            if np.abs(step).max() < 1e-11:
                return point.reshape(-1, n)
        raise RuntimeError("harmonic balance did not converge")
