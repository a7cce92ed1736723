"""Stops whose forces move each other's at once, at points without mass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError

Flags = NDArray[np.bool_]
PIVOTS_PER_STOP = 100  # in the search for the closed ones, at most


@dataclass(frozen=True, eq=False)
class CoupledStops:
    r"""What stops are penetrated by that move each other at once.

    With the penetrations y of the modes, :math:`\delta = y - N F` with the forces F = k δ of the
    stops where δ > 0, and none elsewhere: a linear complementarity problem with one solution, as
    N + diag(1/k) is positive definite between stops that may be closed at once. So long as the
    same stops are closed, δ is linear in y.

    Parameters
    ----------
    common : (n, n) array
        N in m/N, with zeros on the diagonal.
    stiffness : (n,) array
        k in N/m.

    References
    ----------
    R.W. Cottle, J.-S. Pang, R.E. Stone (2009) *The Linear Complementarity Problem*, SIAM, sections
    2.3 and 4.2; K.G. Murty (1974) *Linear Algebra and its Applications* 9, 65-108.

    Examples
    --------
    >>> pair = CoupledStops(np.array([[0.0, 0.5], [0.5, 0.0]]), np.array([1.0, 1.0]))
    >>> pair.penetrations(np.array([[1.0, 0.2], [3.0, 3.0]])).tolist()
    [[1.0, -0.3], [2.0, 2.0]]
    >>> round(pair.whole_stiffness([0, 1]), 9)
    1.333333333
    """

    common: Real
    stiffness: Real

    def __repr__(self) -> str:
        return f"<CoupledStops: {np.count_nonzero(self._moved)} of {len(self.common)}>"

    @cached_property
    def _moved(self) -> Flags:
        return np.asarray(np.any(self.common != 0.0, axis=1))

    def involves(self, stop: int) -> bool:
        """Whether others move a stop at once."""
        return bool(self._moved[stop])

    def whole_stiffness(self, places: Sequence[int]) -> float:
        """Stiffness of linear stops that are penetrated alike, in N/m."""
        of = np.asarray(places, dtype=np.intp)
        give = self.common[np.ix_(of, of)] + np.diag(1.0 / self.stiffness[of])
        return float(np.linalg.solve(give, np.ones(of.size)).sum())

    def together(self, closed: Flags) -> Real:
        """What maps y to δ while some stops are closed, (n, n)."""
        places = np.flatnonzero(closed & self._moved)
        found = np.eye(len(self.common))
        if places.size:
            own = self.common[np.ix_(places, places)] + np.diag(1.0 / self.stiffness[places])
            found[:, places] -= np.linalg.solve(own, self.common[places]).T
        return found

    def maps(self, depths: Real) -> Real:
        """What maps y to δ, (k, n, n), at penetrations y (k, n) of the modes."""
        known: dict[bytes, Real] = {}
        found = []
        for y in depths:
            closed = np.zeros(y.size, dtype=bool)
            for _ in range(PIVOTS_PER_STOP * y.size):
                key = closed.tobytes()
                if key not in known:
                    known[key] = self.together(closed)
                wrong = self._moved & (closed != (known[key] @ y > 0.0))
                if not wrong.any():
                    break
                closed[int(np.argmax(wrong))] ^= True  # the first one: so it ends
            else:
                raise SystemModelError(
                    "which stops without mass are closed is not found: they have too much of "
                    "their flexibility in common"
                )
            found.append(known[key])
        return np.array(found).reshape(len(depths), *self.common.shape)

    def penetrations(self, depths: Real) -> Real:
        """Penetrations δ (k, n) by those of the modes."""
        return np.asarray(np.einsum("kij,kj->ki", self.maps(depths), depths))
