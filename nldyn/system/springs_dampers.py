"""Springs and dampers that act all the time, between interfaces or to the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, numbers, shown
from nldyn.system.values import check_ends, check_finite, check_not_negative, check_positive

LARGEST_DEGREE = 9
DRAGS = ("speed", "displacement")


@dataclass(frozen=True)
class Spring:
    """Linear spring from an interface to the ground, or to another interface.

    It becomes part of the linear structure, exactly. `modal_damping` stays that of the structure
    without it.

    Parameters
    ----------
    at : str
        Interface.
    stiffness : float
        In N/m; a negative one must leave the structure stable.
    against : str, optional
        Interface at the other end; the ground unless given.

    Raises
    ------
    SystemModelError
        For a stiffness that is no finite number, or one interface at both ends.

    Examples
    --------
    >>> from nldyn import System
    >>> chain = System.from_matrices([[1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, 1.0]],
    ...     {"a": [1.0, 0.0], "b": [0.0, 1.0]}, springs=[Spring("a", 1.5, "b")])
    >>> chain.linear.frequencies_hz.round(6).tolist()  # 1/(2 pi) and 2/(2 pi)
    [0.159155, 0.31831]
    """

    at: str
    stiffness: float
    against: str | None = None

    def __post_init__(self) -> None:
        check_ends("spring", self.at, self.against)
        check_finite(f"spring at '{self.at}'", "stiffness", self.stiffness)


@dataclass(frozen=True)
class PolynomialSpring:
    r"""Nonlinear spring that acts all the time: :math:`F = k_1 u + k_2 u^2 + ... + k_9 u^9`.

    u is the displacement at `at`, less that at `against`. Any coefficient may be negative: that of
    a softening spring, or of one with two wells.

    Parameters
    ----------
    at : str
        Interface.
    coefficients : sequence of float
        :math:`k_1, k_2, ...` in N/m, N/m², ...; up to nine.
    against : str, optional
        Interface at the other end; the ground unless given.

    Raises
    ------
    SystemModelError
        For no coefficient, too many, ones that are no finite numbers, or all of them zero.

    Examples
    --------
    >>> wells = PolynomialSpring("tip", [-1.0, 0.0, 1.0])
    >>> wells.coefficients
    (-1.0, 0.0, 1.0)
    """

    at: str
    coefficients: Sequence[float]
    against: str | None = None

    def __post_init__(self) -> None:
        check_ends("spring", self.at, self.against)
        owner = f"spring at '{self.at}'"
        values = numbers(f"{owner}: coefficients", self.coefficients)
        if values.ndim != 1 or not 1 <= values.size <= LARGEST_DEGREE:
            raise SystemModelError(
                f"{owner}: coefficients must be a list of 1 to {LARGEST_DEGREE} numbers, of u, u², "
                f"u³, ...; got {shown(self.coefficients)}"
            )
        if not np.any(values):
            raise SystemModelError(f"{owner}: coefficients must not all be zero")
        object.__setattr__(self, "coefficients", tuple(values.tolist()))


@dataclass(frozen=True)
class Damper:
    """Linear viscous damper from an interface to the ground, or to another interface.

    Parameters
    ----------
    at : str
        Interface.
    coefficient : float
        Damping in N s/m, zero or positive.
    against : str, optional
        Interface at the other end; the ground unless given.

    Examples
    --------
    >>> Damper("middle", 5.81).coefficient
    5.81
    """

    at: str
    coefficient: float
    against: str | None = None

    def __post_init__(self) -> None:
        check_ends("damper", self.at, self.against)
        check_not_negative(f"damper at '{self.at}'", "coefficient", self.coefficient)


@dataclass(frozen=True)
class CubicDamper:
    r"""Nonlinear damper that acts all the time: :math:`F = c\,u'^3`, or :math:`F = c\,u^2 u'`.

    Parameters
    ----------
    at : str
        Interface.
    coefficient : float
        c in N s³/m³, or in N s/m³ where it goes with the displacement; above zero.
    against : str, optional
        Interface at the other end; the ground unless given.
    by : {"speed", "displacement"}
        Whether the damping grows with the speed (isolators, valves) or with the displacement
        (small resonators).

    Raises
    ------
    SystemModelError
        For a value out of range.

    Examples
    --------
    >>> CubicDamper("tip", 0.2, by="displacement").coefficient
    0.2
    """

    at: str
    coefficient: float
    against: str | None = None
    by: str = "speed"

    def __post_init__(self) -> None:
        check_ends("damper", self.at, self.against)
        owner = f"damper at '{self.at}'"
        check_positive(owner, "coefficient", self.coefficient)
        if self.by not in DRAGS:
            raise SystemModelError(
                f"{owner}: by must be {' or '.join(map(repr, DRAGS))}, got {shown(self.by)}"
            )


@dataclass(frozen=True)
class Bond:
    """All that acts nonlinearly, and all the time, between the same two places.

    The force is Σ k_j u^j + (drag u² + cubic u'²) u'.

    Parameters
    ----------
    at, against : str
        As for `Spring`.
    coefficients : tuple of float
        k_1, k_2, ...
    drag, cubic : float
        Of the damping.
    """

    at: str
    against: str | None
    coefficients: tuple[float, ...] = ()
    drag: float = 0.0
    cubic: float = 0.0

    @property
    def depends_on_speed(self) -> bool:
        """Whether it damps."""
        return self.drag != 0.0 or self.cubic != 0.0

    @property
    def odd(self) -> bool:
        """Whether the force changes its sign with the motion."""
        return not any(self.coefficients[1::2])

    @property
    def bounded(self) -> bool:
        """Whether the spring alone holds what is at its ends, however far away."""
        last = max(j for j, k in enumerate((1.0, *self.coefficients)) if k)
        return last % 2 == 1 and self.coefficients[last - 1] > 0.0

    def force(self, u: ArrayLike, speed: ArrayLike = 0.0) -> Real:
        """Force in N at displacements and speeds."""
        viscous = self.drag * np.square(u) + self.cubic * np.square(speed)
        return np.asarray(self._power(u, 0) + viscous * np.asarray(speed))

    def viscosity(self, u: ArrayLike, speed: ArrayLike) -> Real:
        """Derivative of the force with respect to the speed in N s/m."""
        return np.asarray(self.drag * np.square(u) + 3.0 * self.cubic * np.square(speed))

    def stiffness(self, u: ArrayLike) -> Real:
        """Derivative with respect to the displacement, at rest, in N/m."""
        return self._power(u, 1)

    def energy(self, u: ArrayLike) -> Real:
        """Potential of the spring in J."""
        return self._power(u, -1)

    def _power(self, u: ArrayLike, derivative: int) -> Real:
        polynomial = np.polynomial.Polynomial([0.0, *self.coefficients])
        if derivative < 0:
            polynomial = polynomial.integ()
        elif derivative > 0:
            polynomial = polynomial.deriv()
        return np.asarray(polynomial(np.asarray(u, dtype=float)))


def bonds_of(
    springs: Sequence[Spring | PolynomialSpring], dampers: Sequence[object]
) -> tuple[Bond, ...]:
    """What acts nonlinearly all the time, by its places, in the order of the elements.

    Examples
    --------
    >>> bonds_of([PolynomialSpring("a", [0.0, 0.0, 1.0])], [CubicDamper("a", 0.1)])
    (Bond(at='a', against=None, coefficients=(0.0, 0.0, 1.0), drag=0.0, cubic=0.1),)
    """
    found: dict[tuple[str, str | None], Bond] = {}
    for element in (*springs, *dampers):
        if not isinstance(element, PolynomialSpring | CubicDamper):
            continue
        place = element.at, element.against
        old = found.get(place, Bond(*place))
        new, drag, cubic = old.coefficients, old.drag, old.cubic
        if isinstance(element, PolynomialSpring):
            size = max(len(new), len(element.coefficients))
            padded = [(*each, *[0.0] * (size - len(each))) for each in (new, element.coefficients)]
            new = tuple(float(a + b) for a, b in zip(*padded, strict=True))
        elif element.by == "speed":
            cubic += element.coefficient
        else:
            drag += element.coefficient
        found[place] = Bond(*place, new, drag, cubic)
    return tuple(found.values())
