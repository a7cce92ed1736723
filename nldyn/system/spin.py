"""What in a rotor goes with its speed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nldyn.base.arrays import Real
from nldyn.base.errors import LARGEST_FREQUENCY, SystemModelError, is_finite, numbers, shown
from nldyn.system.values import SAME_ENTRY, ZERO_ENTRY


@dataclass(frozen=True, eq=False)
class Spin:
    r"""Speed Ω of a shaft, and the skew matrices that are in proportion to it.

    The damping of the system has :math:`\Omega G` more, its stiffness :math:`\Omega N`.

    Parameters
    ----------
    hz : float
        Speed Ω/2π in turns per second, of either sign.
    gyroscopic : (n, n) array_like, optional
        Skew matrix G in kg (moments of inertia in kg m² where rotations are coordinates).
    circulatory : (n, n) array_like, optional
        Skew matrix N in N s/m: of damping that turns with the shaft, or of a seal.

    Raises
    ------
    SystemModelError
        If the speed is no finite number, there is no matrix, or one is not skew.

    Examples
    --------
    >>> Spin(50.0, gyroscopic=[[0.0, 0.2], [-0.2, 0.0]])
    Spin at 50 Hz
    """

    hz: float
    gyroscopic: ArrayLike | None = None
    circulatory: ArrayLike | None = None

    def __post_init__(self) -> None:
        if not (is_finite(self.hz) and abs(self.hz) <= LARGEST_FREQUENCY):
            raise SystemModelError(
                f"spin: hz must be a number up to {LARGEST_FREQUENCY:g}, got {shown(self.hz)}"
            )
        first = self.circulatory if self.gyroscopic is None else self.gyroscopic
        if first is None:
            raise SystemModelError("spin needs a gyroscopic or a circulatory matrix")
        size = len(np.atleast_2d(numbers("spin: matrix", first)))
        for name in ("gyroscopic", "circulatory"):
            matrix = getattr(self, name)
            if matrix is not None:
                object.__setattr__(self, name, skew(f"spin: {name}", matrix, size))

    def __repr__(self) -> str:
        """The speed."""
        return f"Spin at {self.hz:g} Hz"

    def on(self, modes: Real) -> Spin:
        """The same in modal coordinates, of displacements ``modes @ q``."""
        return Spin(
            self.hz,
            *(
                None if matrix is None else modes.T @ np.asarray(matrix) @ modes
                for matrix in (self.gyroscopic, self.circulatory)
            ),
        )

    def added(self, turns: float, size: int) -> tuple[Real, Real]:
        """What so many more turns per second add to damping and stiffness, (size, size) each."""
        omega = 2.0 * math.pi * turns
        G, N = (
            np.zeros((size, size)) if matrix is None else omega * np.asarray(matrix)
            for matrix in (self.gyroscopic, self.circulatory)
        )
        if G.shape != (size, size) or N.shape != (size, size):
            raise SystemModelError(
                f"spin has matrices of {max(G.shape[0], N.shape[0])} rows, the system {size}"
            )
        return G, N


def skew(name: str, values: ArrayLike, size: int) -> Real:
    """A skew matrix (size, size) without the rounding of its entries.

    Raises
    ------
    SystemModelError
        If it is none.
    """
    matrix = np.atleast_2d(numbers(name, values))
    if matrix.shape != (size, size):
        raise SystemModelError(f"{name} is {matrix.shape}, it must be {(size, size)}")
    largest = float(np.abs(matrix).max())
    if not np.allclose(matrix, -matrix.T, rtol=SAME_ENTRY, atol=ZERO_ENTRY * largest):
        raise SystemModelError(f"{name} must be skew: its transpose must be minus itself")
    return np.asarray(0.5 * (matrix - matrix.T))


def same_spin(a: Spin | None, b: Spin | None) -> bool:
    """Whether two spins have the same numbers."""
    if a is None or b is None:
        return a is b
    size = max(len(np.atleast_2d(m)) for m in (a.gyroscopic, a.circulatory) if m is not None)
    if any(m is not None and np.shape(m) != (size, size) for m in (b.gyroscopic, b.circulatory)):
        return False
    pairs = zip(a.added(1.0, size), b.added(1.0, size), strict=True)
    return a.hz == b.hz and all(np.array_equal(one, other) for one, other in pairs)
