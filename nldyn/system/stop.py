"""Stops that give way under a force, and the coefficients of their laws."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from nldyn.base.arrays import TINY, Real
from nldyn.base.errors import SystemModelError, check_types, shown
from nldyn.system.contact_law import ContactLaw, check_law, power_law
from nldyn.system.friction import (
    Across,
    Friction,
    across_of,
    as_friction,
    check_plane,
    check_spring,
)
from nldyn.system.values import check_finite, check_not_negative, check_positive, check_sides

LARGEST_EXPONENT = 4.0
SMOOTH_TOUCH = 1.5  # exponent from which on multipliers have a slope at a touch
NO_LOSS = 1e-5  # 1 - restitution up to which two terms of the dissipation's series tell all digits
SERIES = 0.1  # argument up to which y - ln(1 + y) is its series
DIGITS = 1e-14  # relative error of a root
CRITICAL = 1e-6  # distance of a damping ratio from 1, within which two terms of a series do


def hertz_stiffness(
    radius: float,
    youngs_modulus: float,
    poissons_ratio: float = 0.3,
    *,
    other_youngs_modulus: float | None = None,
    other_poissons_ratio: float | None = None,
) -> float:
    r"""Stiffness of Hertz's law for a sphere on a plane, :math:`k = \tfrac43 E^*\sqrt{R}`.

    Parameters
    ----------
    radius : float
        Radius of the sphere in m.
    youngs_modulus, poissons_ratio : float
        Elastic constants of the sphere (Pa, 1).
    other_youngs_modulus, other_poissons_ratio : float, optional
        Elastic constants of the plane body; those of the sphere unless given.

    Returns
    -------
    float
        Stiffness in N/m^1.5.

    Raises
    ------
    SystemModelError
        For a radius or modulus that is not positive, or a Poisson's ratio outside (-1, 0.5].

    References
    ----------
    K. L. Johnson (1985), *Contact Mechanics*, eq. 4.22-4.23.

    Examples
    --------
    >>> f"{hertz_stiffness(0.005, 2.1e11, 0.3):.4e}"
    '1.0879e+10'
    """
    owner = "hertz_stiffness"
    check_positive(owner, "radius", radius)
    compliance = 0.0
    for modulus, ratio in (
        (youngs_modulus, poissons_ratio),
        (
            youngs_modulus if other_youngs_modulus is None else other_youngs_modulus,
            poissons_ratio if other_poissons_ratio is None else other_poissons_ratio,
        ),
    ):
        check_positive(owner, "youngs_modulus", modulus)
        check_finite(owner, "poissons_ratio", ratio)
        if not -1.0 < ratio <= 0.5:
            raise SystemModelError(f"{owner}: poissons_ratio must lie in (-1, 0.5], got {ratio:g}")
        compliance += (1.0 - ratio**2) / modulus
    return 4.0 / 3.0 * math.sqrt(radius) / compliance


def dissipation_for(restitution: float, speed: float, *, law: str = "exact") -> float:
    r"""Dissipation a of a `Stop` for a coefficient of restitution at an impact speed.

    Parameters
    ----------
    restitution : float
        Coefficient of restitution e, above 0 and at most 1.
    speed : float
        Impact speed v in m/s at which it holds; slower impacts lose less.
    law : {"exact", "lankarani-nikravesh", "hunt-crossley"}
        A free mass whose force is :math:`k\,\delta^p (1 + a\,\dot\delta)` keeps
        :math:`\int F\,d\delta` between the same depths, so that :math:`h(av) = h(-aev)` with
        :math:`h(y) = y - \ln(1 + y)`, whatever its mass, k and p: that is solved for a. Published
        are :math:`a = \tfrac34 (1 - e^2)/v` and :math:`\tfrac32 (1 - e)/v`, to first order in
        1 - e: with them a body asked for e = 0.5 rebounds with 0.725 and 0.663.

    Returns
    -------
    float
        Dissipation in s/m.

    Raises
    ------
    SystemModelError
        For values out of range or an unknown law.

    References
    ----------
    K. H. Hunt, F. R. E. Crossley (1975), *J. Appl. Mech.* 42, 440-445, eq. 11;
    H. M. Lankarani, P. E. Nikravesh (1990), *J. Mech. Des.* 112, 369-376, eq. 14.

    Examples
    --------
    >>> round(dissipation_for(0.9, 0.05), 3), round(dissipation_for(0.5, 0.05), 2)
    (3.33, 28.66)
    """
    owner = "dissipation_for"
    check_positive(owner, "restitution", restitution)
    check_positive(owner, "speed", speed)
    if restitution > 1.0:
        raise SystemModelError(f"{owner}: restitution must be at most 1, got {restitution:g}")
    if law == "exact":
        return _exact_loss(restitution) / speed
    if law == "lankarani-nikravesh":
        return 0.75 * (1.0 - restitution**2) / speed
    if law == "hunt-crossley":
        return 1.5 * (1.0 - restitution) / speed
    raise SystemModelError(
        f"{owner}: law must be 'exact', 'lankarani-nikravesh' or 'hunt-crossley', got '{law}'"
    )


def _exact_loss(restitution: float) -> float:
    """Solve h(x) = h(-e x) for x = a v, with h(y) = y - ln(1 + y)."""
    lost = 1.0 - restitution
    if lost < NO_LOSS:
        return 1.5 * lost * (1.0 + lost)  # + O(lost^3)

    def root(y: float) -> float:
        """sign(y) √h(y), which is as good as linear about zero."""
        if abs(y) < SERIES:
            return y * math.sqrt(sum((-y) ** k / (k + 2) for k in range(17)))
        return math.copysign(math.sqrt(y - math.log1p(y)), y)

    def faster(u: float) -> float:
        """Of what goes in beside what comes out, at u = e x."""
        return root(u / restitution) + root(-u)

    least, most = 0.375 * restitution * (1.0 - restitution**2), math.nextafter(1.0, 0.0)
    if faster(most) >= 0.0:
        return 1.0 / restitution
    return float(brentq(faster, least, most, xtol=TINY, rtol=DIGITS)) / restitution


def dashpot_for(restitution: float, stiffness: float, mass: float, *, pulls: bool = True) -> float:
    r"""Dashpot c of a linear `Stop` for a coefficient of restitution, the same at every speed.

    A free mass m on k δ + c δ' is linear, so that speeds go out as a share of those with which they
    come in. With :math:`\zeta = c/2\sqrt{km}` a stop that pulls is left after half a swing, with
    :math:`e = \exp(-\pi\zeta/\sqrt{1 - \zeta^2})`; one that never pulls where k δ + c δ' = 0, with
    :math:`e = \exp(-2\zeta\arccos\zeta/\sqrt{1 - \zeta^2})`, also for ζ > 1 [1]_.

    Parameters
    ----------
    restitution : float
        Coefficient of restitution e, above 0 and at most 1.
    stiffness : float
        k of the stop in N/m.
    mass : float
        m in kg of the free body.
    pulls : bool
        As that of the `Stop`.

    Returns
    -------
    float
        c in N s/m.

    Raises
    ------
    SystemModelError
        For values out of range.

    References
    ----------
    .. [1] T. Schwager, T. Pöschel (2007), *Granular Matter* 9, 465-469.

    Examples
    --------
    >>> round(dashpot_for(0.8, 1e4, 1.0), 3), round(dashpot_for(0.8, 1e4, 1.0, pulls=False), 3)
    (14.17, 14.871)
    """
    owner = "dashpot_for"
    for name, value in (("restitution", restitution), ("stiffness", stiffness), ("mass", mass)):
        check_positive(owner, name, value)
    if restitution > 1.0:
        raise SystemModelError(f"{owner}: restitution must be at most 1, got {restitution:g}")
    lost = -math.log(restitution)
    ratio = lost / math.hypot(math.pi, lost) if pulls else _ratio_without_pull(lost)
    return 2.0 * ratio * math.sqrt(stiffness * mass)


def _ratio_without_pull(lost: float) -> float:
    """Solve 2 ζ arccos(ζ)/√(1 - ζ²) = lost for ζ."""

    def excess(ratio: float) -> float:
        off = 1.0 - ratio
        if abs(off) < CRITICAL:
            share = 1.0 + off / 3.0
        elif off > 0.0:
            share = math.acos(ratio) / math.sqrt(off * (1.0 + ratio))
        else:
            share = math.acosh(ratio) / math.sqrt(-off * (1.0 + ratio))
        return 2.0 * ratio * share - lost

    return float(brentq(excess, 0.0, max(1.0, math.exp(0.5 * lost)), xtol=TINY, rtol=DIGITS))


def check_tangent(
    owner: str,
    sides: tuple[str, str | None],
    ends: tuple[str | None, str | None],
    friction: Friction | float | None,
) -> Friction | None:
    """The law of friction along a stop's tangent; None without any.

    Given are the interfaces at both sides, along the normal and along the tangent.

    Raises
    ------
    SystemModelError
        Where friction or its tangent is missing, or the tangent is no interface of its own.
    """
    tangent, beside = ends
    for name, end in (("tangent", tangent), ("tangent_against", beside)):
        check_types(**{f"{owner}: {name}": (end, str, None)})
    if friction is None and tangent is None and beside is None:
        return None
    if friction is None or tangent is None:
        raise SystemModelError(f"{owner}: friction needs both friction and tangent")
    if tangent in (sides[0], beside):
        raise SystemModelError(f"{owner}: tangent must be another interface")
    check_other_side(owner, "tangent_against", beside, sides[1])
    return as_friction(owner, friction)


def check_other_side(owner: str, name: str, beside: str | None, against: str | None) -> None:
    """Refuse a tangent of the other side where the stop has none but the ground."""
    if beside is not None and against is None:
        raise SystemModelError(f"{owner}: {name} needs the 'against' of the same side")


@dataclass(frozen=True)
class Stop:
    r"""One-sided contact: :math:`F = k\,\delta^p (1 + a\dot\delta) + c\,\dot\delta` for δ > 0.

    The penetration δ is ``direction * (displacement at `at` - displacement at `against`) - gap``.

    Parameters
    ----------
    at : str
        Interface that hits the stop.
    stiffness : float
        k in N/m^p.
    exponent : float
        p: 1.5 for Hertz's law, 1 for a linear one-sided spring; from 1 to 4.
    gap : float
        Distance in m at rest; a negative gap preloads the stop.
    direction : {1, -1}
        Sign of the displacement that closes the gap.
    against : str, optional
        Interface on the other side; the ground unless given.
    dissipation : float
        a in s/m (Hunt and Crossley 1975, eq. 9, with a = 1.5 α). The force vanishes with the
        penetration, as that of a dashpot would not; a body that leaves faster than 1/a is held
        back. See `dissipation_for`.
    law : callable, optional
        Another law: ``law(penetration, speed)`` gives the force and its derivatives with respect
        to both, for a positive penetration. numba (``pip install 'nldyn[laws]'``) must be able to
        compile it; a function of a library of C is a `nldyn.system.CompiledLaw`. It vanishes with
        the penetration, where `stiffness` and `exponent` say how: as k δ^p. Beyond that it must be
        smooth: one with a kink is several stops with gaps of their own.
    dashpot : float
        c in N s/m, parallel to the spring (Kelvin and Voigt's model for a linear one): the force
        jumps at the contact, and pulls at the end of it unless `pulls` forbids that.
    pulls : bool
        False: the force of a linear stop with a dashpot is never negative. It lets go where
        k δ + c δ' falls below zero, and presses again where that rises above it within the stop.
    tangent : str, optional
        Interface at the same place whose displacement lies along the surface: there friction acts.
    friction : Friction or float, optional
        Its law, or a coefficient μ: where the stop is closed, μ times its force acts against the
        sliding along `tangent`; where that rests, it sticks as long as friction can hold it.
    tangent_against : str, optional
        The same interface of what is on the other side; the ground unless given.
    area : str, optional
        Name of the area of contact that it is a point of, see `contact_area`.
    share : float
        What of that area it stands for: its weight in m² or m, or 1 node by node.
    tangential_stiffness : float, optional
        k_t in N/m of a spring along the surface, before the friction: where that sticks, the spring
        gives way. Without it nothing does.
    second_tangent : str, optional
        Interface at the same place along the surface, perpendicular to `tangent`: the body slides
        over the plane of both, and the force of friction is against its sliding there. A
        `tangential_stiffness` is the same in all directions.
    second_tangent_against : str, optional
        The same interface of what is on the other side; the ground unless given.

    Raises
    ------
    SystemModelError
        For a value that is out of range.

    Examples
    --------
    >>> Stop("middle", stiffness=5.17e9).exponent
    1.5
    """

    at: str
    stiffness: float
    exponent: float = 1.5
    gap: float = 0.0
    direction: int = 1
    against: str | None = None
    dissipation: float = 0.0
    law: ContactLaw | None = None
    dashpot: float = 0.0
    pulls: bool = True
    tangent: str | None = None
    friction: Friction | float | None = None
    tangent_against: str | None = None
    area: str | None = None
    share: float = 1.0
    tangential_stiffness: float | None = None
    second_tangent: str | None = None
    second_tangent_against: str | None = None
    impulsive: ClassVar[bool] = False  # whether velocities jump where it is hit

    def __post_init__(self) -> None:
        check_types(**{"stop: at": (self.at, str), "stop: against": (self.against, str, None)})
        owner = f"stop at '{self.at}'"
        check_positive(owner, "stiffness", self.stiffness)
        check_finite(owner, "exponent", self.exponent)
        if not 1.0 <= self.exponent <= LARGEST_EXPONENT:
            raise SystemModelError(
                f"{owner}: exponent must lie in [1, {LARGEST_EXPONENT:g}], "
                f"got {shown(self.exponent)}"
            )
        for name in ("dissipation", "dashpot"):
            check_not_negative(owner, name, getattr(self, name))
            if self.law is not None and getattr(self, name):
                raise SystemModelError(f"{owner}: give either {name} or a law of your own")
        if self.law is not None:
            check_law(owner, self.law, self.stiffness, self.exponent)
        if not isinstance(self.pulls, bool | np.bool_):
            raise SystemModelError(f"{owner}: pulls must be True or False, got {shown(self.pulls)}")
        plain = self.exponent == 1.0 and self.law is None and not self.dissipation
        if not self.pulls and not (plain and self.dashpot):
            raise SystemModelError(
                f"{owner}: pulls = False is for a linear stop (exponent 1) with a dashpot; others "
                "without one never pull, but for a loss by dissipation"
            )
        check_finite(owner, "gap", self.gap)
        check_sides(owner, self.at, self.against, self.direction)
        check_types(**{f"{owner}: area": (self.area, str, None)})
        check_positive(owner, "share", self.share)
        self._check_friction(owner)

    def _check_friction(self, owner: str) -> None:
        ends = (self.tangent, self.tangent_against)
        law = check_tangent(owner, (self.at, self.against), ends, self.friction)
        across = self.across
        if law is None and self.tangential_stiffness is None and across is None:
            return
        if law is None:
            raise SystemModelError(f"{owner}: friction needs both friction and tangent")
        if (self.dashpot and self.pulls) or self.dissipation or self.law is not None:
            raise SystemModelError(
                f"{owner}: friction needs a force that never pulls: no dissipation, no law of your "
                "own, and a dashpot only with pulls = False"
            )
        if self.dashpot and self.tangential_stiffness is not None:
            raise SystemModelError(f"{owner}: give either a dashpot or a tangential_stiffness")
        object.__setattr__(self, "friction", law)
        check_spring(owner, self.tangential_stiffness, law)
        first = (self.at, self.against, *ends)
        check_plane(owner, first, across, law)
        beside = self.second_tangent_against
        check_other_side(owner, "second_tangent_against", beside, self.against)

    @property
    def across(self) -> Across:
        """Ends of its second tangent, if it has one."""
        return across_of(self.second_tangent, self.second_tangent_against)

    @property
    def law_of_friction(self) -> Friction:
        """The law of its friction; one that has none has a coefficient of zero."""
        return self.friction if isinstance(self.friction, Friction) else Friction(0.0)

    @property
    def is_linear(self) -> bool:
        """Whether it is a one-sided linear spring."""
        return self.exponent == 1.0

    @property
    def sharp(self) -> bool:
        """Whether it is so stiff from the first touch that multipliers have no slope there."""
        return self.exponent < SMOOTH_TOUCH

    @property
    def jumps(self) -> bool:
        """Whether the force jumps where it is hit."""
        return self.dashpot != 0.0

    @property
    def depends_on_speed(self) -> bool:
        """Whether the force may depend on the speed of penetration."""
        return self.law is not None or self.dissipation != 0.0 or self.dashpot != 0.0

    def force(self, penetration: ArrayLike, speed: ArrayLike = 0.0) -> Real:
        """Force in N at penetrations (m) and speeds (m/s).

        Examples
        --------
        >>> Stop("middle", stiffness=2.0, exponent=1.0).force([-1.0, 3.0]).tolist()
        [0.0, 6.0]
        """
        return self._evaluate(penetration, speed)[0]

    def viscosity(self, penetration: ArrayLike, speed: ArrayLike = 0.0) -> Real:
        """Derivative of the force with respect to the speed in N s/m.

        Examples
        --------
        >>> Stop("middle", 2.0, 1.0, dissipation=0.1).viscosity(3.0).item()
        0.6000000000000001
        """
        return self._evaluate(penetration, speed)[1]

    def _evaluate(self, penetration: ArrayLike, speed: ArrayLike) -> tuple[Real, Real]:
        delta, rate = np.broadcast_arrays(np.asarray(penetration, float), np.asarray(speed, float))
        law = self.law or partial(
            power_law, self.stiffness, self.exponent, self.dissipation, self.dashpot
        )
        values = [
            (0.0, 0.0, 0.0) if x <= 0.0 else law(x, v)
            for x, v in zip(delta.ravel().tolist(), rate.ravel().tolist(), strict=True)
        ]
        if not self.pulls:
            values = [(0.0, 0.0, 0.0) if value[0] < 0.0 else value for value in values]
        table = np.array(values, dtype=float).reshape((*delta.shape, 3))
        return table[..., 0], table[..., 2]

    @classmethod
    def hertz(
        cls,
        at: str,
        *,
        radius: float,
        youngs_modulus: float,
        poissons_ratio: float = 0.3,
        gap: float = 0.0,
        direction: int = 1,
        against: str | None = None,
        dissipation: float = 0.0,
    ) -> Stop:
        """Stop of a sphere against the structure, both of one material.

        Parameters
        ----------
        at : str
            Interface that hits the stop.
        radius : float
            Radius of the sphere in m.
        youngs_modulus, poissons_ratio : float
            Elastic constants (Pa, 1), see `hertz_stiffness`.
        gap, direction, against, dissipation
            As for `Stop`.

        Examples
        --------
        >>> f"{Stop.hertz('middle', radius=0.005, youngs_modulus=2.1e11).stiffness:.4e}"
        '1.0879e+10'
        """
        stiffness = hertz_stiffness(radius, youngs_modulus, poissons_ratio)
        return cls(at, stiffness, 1.5, gap, direction, against, dissipation)

    @classmethod
    def linear(
        cls,
        at: str,
        stiffness: float,
        *,
        gap: float = 0.0,
        direction: int = 1,
        against: str | None = None,
        dissipation: float = 0.0,
        dashpot: float = 0.0,
        pulls: bool = True,
    ) -> Stop:
        """Linear one-sided spring (the bilinear oscillator's), stiffness in N/m.

        The other parameters are as for `Stop`.

        Examples
        --------
        >>> Stop.linear("middle", 1.33e7).exponent
        1.0
        """
        return cls(at, stiffness, 1.0, gap, direction, against, dissipation, None, dashpot, pulls)
