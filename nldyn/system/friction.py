"""Dry friction: Coulomb's law, and what slides by it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types
from nldyn.system.values import check_ends, check_finite, check_not_negative, check_positive


@dataclass(frozen=True)
class Friction:
    r"""Coefficient of Coulomb's friction, which may be larger at rest than of sliding.

    At rest friction is what it must be to stay, up to :math:`\mu_0` times the normal force. From
    there it drops to :math:`\mu` at once or, with a fading speed, falls by
    :math:`\mu(v) = \mu + (\mu_0 - \mu)\,e^{-|v|/v_0}`, with v the speed beside that of what it
    slides on.

    Parameters
    ----------
    coefficient : float
        μ of fast sliding.
    at_rest : float, optional
        μ₀, at least μ; the same unless given.
    fading_speed : float, optional
        v₀ in m/s. Unless given, friction drops at once where sliding begins.
    base_speed : float or (float, float)
        Speed in m/s at which what it slides on moves along: a belt, the surface of a rotor; over a
        plane along both tangents.

    Raises
    ------
    SystemModelError
        For a value out of range.

    References
    ----------
    R. Stribeck (1902), *Z. VDI* 46; B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit (1994),
    *Automatica* 30, 1083-1138, for the law; S. W. Shaw (1986), *J. Sound Vib.* 108, 305-325, for
    the drop.

    Examples
    --------
    >>> falling = Friction(0.2, at_rest=0.3, fading_speed=0.1)
    >>> falling.at([0.0, 1e9]).tolist()
    [0.3, 0.2]
    >>> Friction(0.2, at_rest=0.3).at([0.0, 1e-9]).tolist()
    [0.3, 0.2]
    """

    coefficient: float
    at_rest: float | None = None
    fading_speed: float | None = None
    base_speed: float | tuple[float, float] = 0.0

    def __post_init__(self) -> None:
        owner = "friction"
        check_not_negative(owner, "coefficient", self.coefficient)
        if isinstance(self.base_speed, list | tuple):
            if len(self.base_speed) != 2:
                raise SystemModelError(
                    f"{owner}: base_speed must be a number, or one along each of two tangents, got "
                    f"{len(self.base_speed)}"
                )
            first, second = self.base_speed
            object.__setattr__(self, "base_speed", (first, second))
        for speed in self.base_speeds:
            check_finite(owner, "base_speed", speed)
        if self.at_rest is not None:
            check_finite(owner, "at_rest", self.at_rest)
            if self.at_rest < self.coefficient:
                raise SystemModelError(
                    f"friction: at_rest must be at least the coefficient, {self.coefficient:g}, "
                    f"got {self.at_rest:g}"
                )
        if self.fading_speed is not None:
            check_positive(owner, "fading_speed", self.fading_speed)
            if self.at_rest is None:
                raise SystemModelError(f"{owner}: fading_speed needs the at_rest that fades")

    def with_coefficient(self, coefficient: float) -> Friction:
        """The same with another coefficient, at rest by as much another one."""
        at_rest = None if self.at_rest is None else coefficient + self.adhesion
        return replace(self, coefficient=coefficient, at_rest=at_rest)

    @property
    def base_speeds(self) -> tuple[float, float]:
        """Speeds along both tangents of what it slides on."""
        return self.base_speed if isinstance(self.base_speed, tuple) else (self.base_speed, 0.0)

    def with_base_speed(self, speed: float) -> Friction:
        """The same with another speed along the first tangent of what it slides on."""
        both = (speed, self.base_speeds[1])
        return replace(self, base_speed=both if isinstance(self.base_speed, tuple) else speed)

    @property
    def adhesion(self) -> float:
        """By how much the coefficient at rest is larger."""
        return 0.0 if self.at_rest is None else self.at_rest - self.coefficient

    def at(self, speed: ArrayLike) -> Real:
        """Coefficient at speeds of sliding in m/s, of either sign."""
        slow = np.equal(speed, 0.0)
        if self.fading_speed is not None:
            slow = np.exp(-np.abs(speed) / self.fading_speed)
        return np.asarray(self.coefficient + self.adhesion * slow)


def as_friction(owner: str, given: Friction | float) -> Friction:
    """A law of friction, of a coefficient alone if it is a number."""
    check_types(**{f"{owner}: friction": (given, Friction, float, int)})
    return given if isinstance(given, Friction) else Friction(given)


def check_spring(owner: str, stiffness: float | None, law: Friction) -> None:
    """Refuse a tangential stiffness that is none, or before a coefficient that changes."""
    if stiffness is None:
        return
    check_positive(owner, "tangential_stiffness", stiffness)
    if law.adhesion:
        raise SystemModelError(
            f"{owner}: behind a tangential_stiffness friction has one coefficient, at rest and "
            "sliding, since nothing tells how far the spring leaps where it drops: leave out "
            "at_rest and fading_speed, or the tangential_stiffness"
        )


Across = tuple[str | None, str | None] | None  # ends of a second tangent


def across_of(second: str | None, against: str | None) -> Across:
    """Ends of a second tangent, None if there is nothing of one."""
    return None if second is None and against is None else (second, against)


def check_plane(owner: str, first: tuple[str | None, ...], across: Across, law: Friction) -> None:
    """Refuse a second tangent that is no interface of its own, and a base without one along it."""
    if across is None:
        if isinstance(law.base_speed, tuple):
            raise SystemModelError(f"{owner}: a base_speed of two needs a second_tangent")
        return
    for name, end in zip(("second_tangent", "second_tangent_against"), across, strict=True):
        check_types(**{f"{owner}: {name}": (end, str, None)})
    if across[0] is None:
        raise SystemModelError(f"{owner}: second_tangent_against needs a second_tangent")
    if across[0] in (*first, across[1]):
        raise SystemModelError(f"{owner}: second_tangent must be another interface")
    if law.adhesion:
        raise SystemModelError(
            f"{owner}: friction with a second_tangent has one coefficient, at rest and sliding: "
            "leave out at_rest and fading_speed"
        )


@dataclass(frozen=True)
class DryFriction:
    r"""Dry friction that acts all the time: :math:`F = \mu(v)\,N\,\mathrm{sign}\,v`, exactly.

    Where the speed is zero it sticks, without giving way, as long as that takes no more than
    :math:`\mu_0 N`. Given among the `dampers` of a `System`.

    Parameters
    ----------
    at : str
        Interface that slides.
    normal_force : float
        N, that presses it on, in N.
    friction : Friction or float
        The law, or a coefficient μ.
    against : str, optional
        Interface that it slides on; the ground unless given.
    tangential_stiffness : float, optional
        k_t in N/m of a spring between the interface and the slider: Jenkins' element. Where it
        sticks, the force is k_t times the strain of the spring, where it slides, μ N. Several at
        one interface are an Iwan chain. Without it nothing gives way.
    second_tangent : str, optional
        Interface at the same place, perpendicular to `at`, of what slides over a plane: its force
        is μ N against its speed, in any direction of the plane, or along the strain of the spring.
        That is as stiff in all directions.
    second_tangent_against : str, optional
        The same interface of what it slides on; the ground unless given.

    Raises
    ------
    SystemModelError
        For a value out of range, one interface at both ends, or a coefficient that changes with
        the speed behind a spring.

    References
    ----------
    G. M. Jenkins (1962), *Brit. J. Appl. Phys.* 13, 225-229; W. D. Iwan (1966), *J. Appl. Mech.*
    33, 893-900.

    Examples
    --------
    >>> DryFriction("block", 10.0, 0.3).friction.coefficient
    0.3
    >>> chain = [DryFriction("joint", 1.0, share, tangential_stiffness=1e3) for share in (0.1, 0.2)]
    """

    at: str
    normal_force: float
    friction: Friction | float
    against: str | None = None
    tangential_stiffness: float | None = None
    second_tangent: str | None = None
    second_tangent_against: str | None = None

    def __post_init__(self) -> None:
        check_ends("dry friction", self.at, self.against)
        owner = f"dry friction at '{self.at}'"
        check_positive(owner, "normal_force", self.normal_force)
        object.__setattr__(self, "friction", as_friction(owner, self.friction))
        check_spring(owner, self.tangential_stiffness, self.law)
        ends = (self.at, self.against)
        check_plane(owner, ends, self.across, self.law)

    @property
    def law(self) -> Friction:
        """The law of friction."""
        return as_friction(self.at, self.friction)

    @property
    def across(self) -> Across:
        """Ends of its second tangent, if it has one."""
        return across_of(self.second_tangent, self.second_tangent_against)


@dataclass(frozen=True)
class Slider:
    """What slides in a system: where, by which law, and what presses it on.

    Parameters
    ----------
    at, against : str
        As for `DryFriction`.
    friction : Friction
    stop : int
        Number of the stop whose force presses it on, or -1.
    normal_force : float
        Force in N that does so in place of a stop's.
    tangential_stiffness : float, optional
        Stiffness in N/m of the spring before it.
    across : (str, str or None), optional
        The same interfaces along the second tangent of what slides over a plane.
    """

    at: str
    against: str | None
    friction: Friction
    stop: int = -1
    normal_force: float = 0.0
    tangential_stiffness: float | None = None
    across: Across = None

    @property
    def ends(self) -> tuple[tuple[str, str | None], ...]:
        """The interface and that on the other side, along each tangent."""
        first = (self.at, self.against)
        if self.across is None or self.across[0] is None:
            return (first,)
        return (first, (self.across[0], self.across[1]))
