"""Areas of contact: interfaces that share a few attachment modes."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError


@dataclass(frozen=True, eq=False)
class Area:
    """Interfaces that are the points of an area of contact.

    They get as few attachment modes as the static deflection under the contact's load needs, in
    place of one for each point.

    Parameters
    ----------
    points
        Names of the interfaces.
    stiffness
        Stiffness in N/m of the contact at each of them, (n,).
    modes
        How many attachment modes, at most; chosen by the tolerance unless given.
    tolerance
        Static error that is allowed: share of the deflection of structure and contact together that
        may be missing, under any load at the points.

    Raises
    ------
    ReductionError
        For no points, or a number out of range.

    Examples
    --------
    >>> Area(("left", "right"), [1e5, 1e5]).tolerance
    0.01
    """

    points: Sequence[str]
    stiffness: Sequence[float] | FloatArray
    modes: int | None = None
    tolerance: float = 1e-2

    def __post_init__(self) -> None:
        stiffness = np.asarray(self.stiffness, dtype=np.float64)
        if not len(self.points) or stiffness.shape != (len(self.points),):
            raise ReductionError(
                f"an area needs a stiffness at each of its {len(self.points)} points, not of "
                f"shape {stiffness.shape}"
            )
        if not (np.all(np.isfinite(stiffness)) and np.all(stiffness > 0.0)):
            raise ReductionError("an area's stiffness must be positive at each point")
        if self.modes is not None and operator.index(self.modes) < 0:
            raise ReductionError(f"an area has {self.modes} attachment modes: 0 at least")
        if not 0.0 <= self.tolerance < np.inf:
            raise ReductionError(f"an area's tolerance is {self.tolerance}: 0 at least")


@dataclass(frozen=True)
class Attached:
    """What an area was given.

    Attributes
    ----------
    modes : int
        Number of its attachment modes.
    static_error : float
        Largest share of the deflection of structure and contact together that is missing, under
        any load at the points.
    """

    modes: int
    static_error: float


def gathered(
    areas: Mapping[str, Area], names: Sequence[str], loads: FloatArray, residual: FloatArray
) -> tuple[FloatArray, dict[str, Attached]]:
    """Combinations (m, p) of loads (N, m) whose residuals (N, m) a model needs, and what of areas.

    Those of an area are the loads that the kept modes leave softest beside the contact: with its
    stiffnesses k on the diagonal and the flexibility G that is left between its points they are
    the eigenvectors of √k G √k. What is left out of G is at most the next eigenvalue times the
    contact's own flexibility 1/k, whatever the load.
    """
    column = {name: place for place, name in enumerate(names)}
    single = np.ones(len(names), dtype=np.bool_)
    parts, told = [], {}
    for name, area in areas.items():
        for point in area.points:
            if point not in column:
                known = ", ".join(names) or "none"
                raise ReductionError(
                    f"area '{name}': there is no interface '{point}' (there are: {known})"
                )
        places = np.array([column[point] for point in area.points])
        single[places] = False
        root = np.sqrt(np.asarray(area.stiffness, dtype=np.float64))
        G = loads[:, places].T @ residual[:, places]
        shares, vectors = linalg.eigh(root[:, None] * (G + G.T) / 2.0 * root)
        shares, vectors = shares[::-1], vectors[:, ::-1]
        needed = int(np.count_nonzero(shares > area.tolerance))
        count = needed if area.modes is None else min(operator.index(area.modes), places.size)
        left = float(shares[count]) if count < places.size else 0.0
        told[name] = Attached(count, max(left, 0.0))
        part = np.zeros((len(names), count))
        part[places] = root[:, None] * vectors[:, :count]
        parts.append(part)
    return np.hstack([np.eye(len(names))[:, single], *parts]), told
