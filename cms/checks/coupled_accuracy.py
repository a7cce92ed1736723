"""How wrong a coupled model is, from what is known of its components' errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg

from cms.base.arrays import FloatArray
from cms.base.errors import ReductionError
from cms.checks.accuracy import Accuracy, Bounds, negative
from cms.reduction.coupling import Joint, check_joints, couple, side_by_side

FIRST_STEP = 1e-9  # no band is narrower, because of rounding
GROWTH = 4.0
BISECTIONS = 12
DEPENDENT = 1e-9  # singular value of unit conditions that depend on each other


@dataclass(frozen=True, eq=False)
class CoupledAccuracy:
    r"""What is known of components that are joined, by `coupled_accuracy`.

    Attributes
    ----------
    components : mapping of str to Accuracy
        What is known of each.
    joints : tuple of Joint
        Their joints; dampers do not count.
    rows : (j, m) array
        The matrix J of the notes.

    Notes
    -----
    The receptances H of the components at all interfaces lie between two known symmetric matrices
    in the order of quadratic forms, :math:`H_0 \le H \le H_1` (`Accuracy.bounds`). Joints with the
    signed rows J and the compliances S of their springs make of H

    .. math:: H_c = H - H J^T W^{-1} J H, \qquad W = J H J^T + S .

    Its differential :math:`T\,dH\,T^T` with :math:`T = I - H J^T W^{-1} J` keeps the order as long
    as W is regular on the way. Eigenvalues of W grow with H, so where W has as many negative ones
    at :math:`H_0` as at :math:`H_1`, it is regular for all H between, and :math:`H_c` lies between
    its two values.

    By Sylvester's law of inertia, the structure has as many frequencies below Ω as its components
    have free, less the number of negative eigenvalues of W [1]_. Bounds of the one are bounds of
    the other, and a band of a frequency is where the count is not certain.

    References
    ----------
    .. [1] Wittrick, W.H. and Williams, F.W. (1971) A general algorithm for computing natural
       frequencies of elastic structures. Quarterly Journal of Mechanics and Applied Mathematics
       24(3), 263-284.
    """

    components: Mapping[str, Accuracy]
    joints: tuple[Joint, ...]
    rows: FloatArray

    @property
    def next_hz(self) -> float:
        """Frequency up to which there are bands: the lowest of the components' ``next_hz``."""
        return min(known.next_hz for known in self.components.values())

    def frequency_bands_hz(self, count: int) -> FloatArray:
        """Bands (count, 2) in Hz in which the lowest frequencies of the structure lie.

        Parameters
        ----------
        count : int
            How many, with the rigid-body modes, whose bands are (0, 0).

        Returns
        -------
        (count, 2) array
            Where nothing is known, 0 or infinity.

        Raises
        ------
        ReductionError
            If the coupled model has no such number of frequencies.
        """
        model = couple(
            {name: known.reduced for name, known in self.components.items()}, self.joints
        )
        if not 0 <= count <= model.size:
            raise ReductionError(f"count = {count}, but the coupled model has {model.size} modes")
        found = np.zeros((count, 2))
        for number in np.flatnonzero(model.frequencies_hz[:count] > 0.0):
            hz = float(model.frequencies_hz[number])
            found[number] = self._edge(hz, int(number), -1.0), self._edge(hz, int(number), 1.0)
        return found

    def _edge(self, hz: float, number: int, side: float) -> float:
        """Nearest frequency found on one side of a guess that is beyond the sought one."""

        def beyond(away: float) -> bool:
            place = hz + side * away
            if not 0.0 < place < self.next_hz:
                return False
            fewest, most = self.counted(place)
            return most <= number if side < 0.0 else fewest > number

        inner = outer = FIRST_STEP * hz
        while not beyond(outer):
            inner, outer = outer, GROWTH * outer
            if not 0.0 < hz + side * outer < self.next_hz:
                return 0.0 if side < 0.0 else np.inf
        for _ in range(BISECTIONS):
            middle = (inner + outer) / 2.0
            inner, outer = (inner, middle) if beyond(middle) else (middle, outer)
        return hz + side * outer

    def counted(self, frequency_hz: float) -> tuple[float, float]:
        """Fewest and most frequencies that the structure may have below a given one, in Hz."""
        bounds = self._bounds(frequency_hz)
        if bounds is None:
            return 0.0, np.inf
        free = sum(each.free for each in bounds)
        low, high = (self._joined(receptance) for receptance in sides(bounds))
        return free - negative(low), free - negative(high)

    def receptance_band(self, frequency_hz: ArrayLike, at: str, excited: str) -> FloatArray:
        """Band (k, 2) in m/N of the structure's undamped receptance.

        Parameters
        ----------
        frequency_hz : float or (k,) array_like
            Frequencies in Hz.
        at, excited : str
            Interfaces of the displacement and of the force, named "component.interface".

        Returns
        -------
        (k, 2) array
            Infinite where a resonance may lie in the band, and from `next_hz` on.

        Raises
        ------
        ReductionError
            If there is no such interface.

        Examples
        --------
        >>> import numpy as np, cms
        >>> n = 40
        >>> K = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        >>> half = cms.Matrices(K, np.eye(n), {"end": np.eye(n)[-1]})
        >>> known = cms.accuracy(half, cms.reduce(half, modes=2))
        >>> spring = cms.Joint(("a", "end"), ("b", "end"), stiffness=1.0)
        >>> both = cms.coupled_accuracy({"a": known, "b": known}, [spring])
        >>> low, high = both.receptance_band(0.003, "a.end", "a.end")[0]
        >>> whole = 2 * np.eye(2 * n) - np.eye(2 * n, k=1) - np.eye(2 * n, k=-1)
        >>> whole[n - 1, n - 1] = whole[n, n] = 3.0
        >>> unit = np.eye(2 * n)[n - 1]
        >>> exact = unit @ np.linalg.solve(whole - (2 * np.pi * 0.003) ** 2 * np.eye(2 * n), unit)
        >>> bool(low <= exact <= high <= 1.001 * low)
        True
        """
        names = [f"{name}.{each}" for name, known in self.components.items()
                 for each in known.reduced.interfaces]  # fmt: skip
        for name in (at, excited):
            if name not in names:
                raise ReductionError(f"there is no interface '{name}' (there are: {names})")
        i, j = names.index(at), names.index(excited)
        return np.array(
            [self._band(float(hz), i, j) for hz in np.atleast_1d(np.asarray(frequency_hz))]
        )

    def _band(self, hz: float, i: int, j: int) -> tuple[float, float]:
        bounds = self._bounds(hz)
        if bounds is None:
            return -np.inf, np.inf
        low, high = sides(bounds)
        if negative(self._joined(low)) != negative(self._joined(high)):
            return -np.inf, np.inf
        first, last = self._closed(low), self._closed(high)
        middle = (first + last)[i, j] / 2.0
        spread = np.maximum(np.diag(last - first), 0.0)
        reach = np.sqrt(spread[i] * spread[j]) / 2.0
        return middle - reach, middle + reach

    def _bounds(self, hz: float) -> list[Bounds] | None:
        """What is known of every component; None if there is one of which nothing is known."""
        found = [known.bounds(hz) for known in self.components.values()]
        known = [each for each in found if each is not None]
        return known if len(known) == len(found) else None

    def _joined(self, receptance: FloatArray) -> FloatArray:
        """The matrix W (j, j)."""
        series = [0.0 if each.stiffness is None else 1.0 / each.stiffness for each in self.joints]
        return np.asarray(self.rows @ receptance @ self.rows.T + np.diag(series))

    def _closed(self, receptance: FloatArray) -> FloatArray:
        """The receptance of the structure at all interfaces."""
        through = self.rows @ receptance
        return np.asarray(
            receptance - through.T @ linalg.solve(self._joined(receptance), through, assume_a="sym")
        )


def coupled_accuracy(
    components: Mapping[str, Accuracy], joints: Sequence[Joint]
) -> CoupledAccuracy:
    """What is known of a structure of reduced components, without solving the full one.

    Parameters
    ----------
    components : mapping of str to Accuracy
        What `accuracy` says of each component.
    joints : sequence of Joint
        As for `couple`.

    Returns
    -------
    CoupledAccuracy

    Raises
    ------
    ReductionError
        As `couple`, and where a rigid joint follows from others.
    """
    check_joints({name: known.reduced for name, known in components.items()}, joints)
    acting = tuple(joint for joint in joints if joint.stiffness != 0.0)
    assembly = side_by_side({name: known.reduced for name, known in components.items()})
    rigid = assembly.joint_rows([joint for joint in acting if joint.stiffness is None])
    motions = rigid @ np.hstack([assembly.rows, assembly.flexibility])
    lengths = np.linalg.norm(motions, axis=1, keepdims=True)
    if not np.all(lengths) or np.linalg.matrix_rank(motions / lengths, tol=DEPENDENT) < len(rigid):
        raise ReductionError(
            "the error of a coupled model is known only where no rigid joint follows from others"
        )
    return CoupledAccuracy(dict(components), acting, assembly.joint_rows(acting))


def sides(bounds: Sequence[Bounds]) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bound of the receptance of all components beside each other."""
    return (
        np.asarray(linalg.block_diag(*[each.low for each in bounds])),
        np.asarray(linalg.block_diag(*[each.high for each in bounds])),
    )
