"""Step control of continuations."""

from __future__ import annotations

import math
from dataclasses import dataclass

from nldyn.base.errors import SystemModelError, check_whole, is_finite, shown

MOST_POINTS = 10**8  # in one direction
AIMED_ANGLE = 0.7  # of the largest angle: what the next step should turn by, as this one did
AIMED_MISS = 0.5  # of the largest miss, which grows with the square of a step
LEAST_ANGLE, LEAST_MISS = 1e-3, 1e-6  # below which both say no more of the next step
LARGEST_SHRINKAGE, LARGEST_GROWTH = 0.5, 1.6  # of a step after the one before


@dataclass(frozen=True)
class ContinuationOptions:
    """Step control. Lengths are relative: a step of 0.1 changes orbit or frequency by 10 %.

    Parameters
    ----------
    first_step, max_step, min_step : float
        Arclength steps.
    max_angle : float
        Largest angle between the tangents of two neighbouring points, in radians. With more than
        0.3 a step may leave the branch unseen where another one crosses it.
    max_miss : float
        Largest distance of a point from where it was predicted, relative to the step; more than
        0.2 is as doubtful.
    grazing_step : float
        Longest step over which the number of contacts may change.
    max_points : int
        Most points in one direction.

    Raises
    ------
    SystemModelError
        For a length or angle out of range, or steps out of order.
    """

    first_step: float = 0.01
    max_step: float = 0.05
    min_step: float = 1e-10
    max_angle: float = 0.25
    max_miss: float = 0.1
    grazing_step: float = 0.004
    max_points: int = 5000

    def __post_init__(self) -> None:
        for name in ("min_step", "first_step", "max_step", "max_angle", "max_miss", "grazing_step"):
            value = getattr(self, name)
            if not (is_finite(value) and value > 0.0):
                raise SystemModelError(
                    f"continuation: {name} must be positive and finite, got {shown(value)}"
                )
        if not self.min_step <= self.first_step <= self.max_step:
            raise SystemModelError(
                "continuation: steps must satisfy min_step <= first_step <= max_step, got "
                f"{self.min_step:g}, {self.first_step:g} and {self.max_step:g}"
            )
        if self.grazing_step < self.min_step:
            raise SystemModelError("continuation: grazing_step must not be below min_step")
        if self.max_angle >= 1.5:
            raise SystemModelError(
                f"continuation: max_angle must lie below 1.5, got {self.max_angle:g}"
            )
        check_whole("continuation: max_points", self.max_points, 2, MOST_POINTS)

    def next_step(self, step: float, angle: float, miss: float) -> float:
        """Length of the step after one, by its angle and its miss; one that fails is halved."""
        growth = AIMED_ANGLE * self.max_angle / max(angle, LEAST_ANGLE)
        growth = min(growth, math.sqrt(AIMED_MISS * self.max_miss / max(miss, LEAST_MISS)))
        growth = min(max(growth, LARGEST_SHRINKAGE), LARGEST_GROWTH)
        return min(step * growth, self.max_step)
