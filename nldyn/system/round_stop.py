"""Round clearances: a body in a ring, or around a pin, with radial contact."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import ArrayLike

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_types, shown
from nldyn.system.contact_law import ContactLaw
from nldyn.system.stop import Stop
from nldyn.system.values import (
    check_finite,
    check_not_negative,
    check_positive,
    check_restitution,
)

_CALLED = {"rubbing_friction": "friction"}  # here
_CENTRES = ("first_eccentricity", "second_eccentricity")
_NUMBERS = ("stiffness", "clearance", "exponent", "dissipation", "friction")
_OF_ELASTIC = {"exponent": 1.5, "dissipation": 0.0, "law": None}  # and what a rigid one leaves them


class Polar(NamedTuple):
    """Where a body is in a round clearance, each (k,).

    Parameters
    ----------
    radius : (k,)
        Distance from the centre in m.
    normal : (k, 2)
        Unit vectors away from the centre.
    depth, rate : (k,)
        Penetration in m, negative where it is open, and its rate in m/s.
    sliding : (k,)
        Speed in m/s of the surface of the body on that of the other side, from the first direction
        to the second.
    """

    radius: Real
    normal: Real
    depth: Real
    rate: Real
    sliding: Real

    @property
    def across(self) -> Real:
        """Unit vectors (k, 2) a quarter turn from the normal, from the first to the second."""
        return np.stack([-self.normal[:, 1], self.normal[:, 0]], axis=1)


@dataclass(frozen=True)
class RoundStop:
    r"""Round clearance: contact along the radius, all around.

    With the displacement r of a place in a plane and the eccentricity e, the penetration is
    :math:`\delta = |r - e| - c` in a ring of radial clearance c, and :math:`c - |r - e|` around a
    pin that stands c away from touching. The force :math:`N = k\,\delta^p (1 + a\dot\delta)` acts
    along the radius.

    With friction :math:`\mu N` acts along the circle, against the speed at which the surface of the
    body slides: by its whirl, and by its turning, where it turns. Where that speed is zero it
    sticks, without giving way, as long as that takes no more than :math:`\mu N`: it rolls.

    `rigid` makes one that does not give way: there velocities jump as at a `RigidStop`, along the
    radius, and a body rests on it under the force that keeps it at :math:`|r - e| = c` until that
    would have to pull.

    Parameters
    ----------
    plane : (str, str)
        Interfaces of the place: its displacements along two perpendicular directions.
    stiffness : float
        k in N/m^p; infinite of a rigid one.
    clearance : float
        c in m, above 0.
    exponent : float
        p: 1.5 for Hertz's law, 1 for a linear spring; from 1 to 4.
    eccentricity : (float, float)
        e in m: where the centre of the ring or pin lies beside the place at rest.
    inside : bool
        True for a ring, in which the body is; False for a pin, from which it stays away.
    against_plane : (str, str), optional
        Interfaces of what is on the other side; the ground unless given.
    dissipation : float
        a in s/m, see `Stop`.
    law : callable, optional
        Another law of the normal force, see `Stop`.
    friction : float, optional
        Coefficient μ, sliding and at rest.
    surface_speed : float, optional
        Speed in m/s of the surface that turns, ΩR of a rotor, needed where there is friction, and
        only there, if of 0; positive if the body turns from the first direction to the second, 0 if
        it does not turn.
    restitution : float, optional
        Coefficient e from 0 to 1 of a rigid one.

    Raises
    ------
    SystemModelError
        For a value that is out of range.

    Examples
    --------
    >>> ring = RoundStop(("x", "y"), stiffness=1e6, exponent=1.0, clearance=1e-3)
    >>> float(ring.polar([[3e-3, 4e-3]], [[0.0, 0.0]]).depth[0].round(12))
    0.004
    """

    plane: tuple[str, str]
    stiffness: float
    clearance: float
    exponent: float = 1.5
    eccentricity: tuple[float, float] = (0.0, 0.0)
    inside: bool = True
    against_plane: tuple[str, str] | None = None
    dissipation: float = 0.0
    law: ContactLaw | None = None
    friction: float = cast(float, None)  # not given: zero
    surface_speed: float | None = None
    restitution: float | None = None
    dashpot: ClassVar[float] = 0.0
    pulls: ClassVar[bool] = True
    direction: ClassVar[int] = 1
    tangent: ClassVar[None] = None
    tangent_against: ClassVar[None] = None

    def __post_init__(self) -> None:
        _check_pair("round clearance", "plane", self.plane)
        owner = f"round clearance at '{self.plane[0]}', '{self.plane[1]}'"
        if self.against_plane is not None:
            _check_pair(owner, "against_plane", self.against_plane)
            object.__setattr__(self, "against_plane", tuple(self.against_plane))
            if set(self.plane) & set(self.against_plane or ()):
                raise SystemModelError(f"{owner}: against_plane must be other interfaces")
        object.__setattr__(self, "plane", tuple(self.plane))
        check_positive(owner, "clearance", self.clearance)
        if not (isinstance(self.eccentricity, tuple | list) and len(self.eccentricity) == 2):
            raise SystemModelError(
                f"{owner}: eccentricity must be two numbers, got {shown(self.eccentricity)}"
            )
        for value in self.eccentricity:
            check_finite(owner, "eccentricity", value)
        object.__setattr__(self, "eccentricity", tuple(float(x) for x in self.eccentricity))
        if not isinstance(self.inside, bool | np.bool_):
            raise SystemModelError(f"{owner}: inside must be True or False, got {self.inside!r}")
        fault = fault_of_rubbing(self.friction, self.surface_speed)
        object.__setattr__(self, "friction", 0.0 if self.friction is None else self.friction)
        check_not_negative(owner, "friction", self.friction)
        if self.surface_speed is not None:
            check_finite(owner, "surface_speed", self.surface_speed)
            object.__setattr__(self, "surface_speed", float(self.surface_speed))
        if fault:
            raise SystemModelError(f"{owner} {fault}")
        object.__setattr__(self, "inside", bool(self.inside))
        if self.restitution is None:
            _ = self.normal
        else:
            self._check_rigid(owner)
        for name in _NUMBERS:
            object.__setattr__(self, name, float(getattr(self, name)))

    def _check_rigid(self, owner: str) -> None:
        check_restitution(owner, self.restitution)
        given = [name for name, none in _OF_ELASTIC.items() if getattr(self, name) != none]
        if self.stiffness != math.inf or given:
            name = given[0] if given else "stiffness"
            raise SystemModelError(f"{owner}: give either a restitution, if it is rigid, or {name}")
        object.__setattr__(self, "restitution", float(self.restitution or 0.0))
        if self.room < 0.0:
            raise SystemModelError(
                f"{owner}: the place at rest lies {-self.room:g} m behind it, and it is rigid: "
                "change clearance or eccentricity"
            )

    @classmethod
    def rigid(
        cls,
        plane: tuple[str, str],
        restitution: float,
        clearance: float,
        *,
        eccentricity: tuple[float, float] = (0.0, 0.0),
        inside: bool = True,
        against_plane: tuple[str, str] | None = None,
        friction: float = cast(float, None),
        surface_speed: float | None = None,
    ) -> RoundStop:
        """One that does not give way: impacts along the radius, and rest.

        Parameters
        ----------
        plane, clearance, eccentricity, inside, against_plane, friction, surface_speed
            As for `RoundStop`.
        restitution : float
            Coefficient e, from 0 to 1: what closes at v opens at e v.

        Examples
        --------
        >>> RoundStop.rigid(("x", "y"), 0.8, 1e-3).impulsive
        True
        """
        return cls(
            plane, math.inf, clearance, eccentricity=eccentricity, inside=inside,
            against_plane=against_plane, friction=friction, surface_speed=surface_speed,
            restitution=restitution,
        )  # fmt: skip

    @property
    def impulsive(self) -> bool:
        """Whether it is rigid: velocities jump where it is hit."""
        return self.restitution is not None

    def restitution_at(self, speed: float) -> float:
        """Coefficient of restitution of a rigid one, the same at all impact speeds in m/s."""
        return self.restitution or 0.0

    def determinant(self, speed: float) -> float:
        """Factor e² by which an impact at a speed changes volumes of states."""
        return self.restitution_at(speed) ** 2

    @property
    def reach(self) -> float:
        """Displacement in m of the size of those with which it is touched."""
        return self.clearance + float(np.hypot(*self.eccentricity))

    def out_of_reach(self, size: float) -> RoundStop:
        """The same where what moves no farther than `size` from rest does not hit it."""
        if self.inside:
            return replace(self, clearance=self.clearance + size)
        return replace(self, eccentricity=(self.clearance + size + abs(self.eccentricity[0]), 0.0))

    @cached_property
    def normal(self) -> Stop:
        """A stop with the law of the normal force."""
        return Stop(
            self.plane[0],
            self.stiffness,
            self.exponent,
            dissipation=self.dissipation,
            law=self.law,
        )

    @property
    def at(self) -> str:
        """The first of the interfaces."""
        return self.plane[0]

    @property
    def against(self) -> str | None:
        """The first of those on the other side."""
        return None if self.against_plane is None else self.against_plane[0]

    @property
    def ends(self) -> tuple[tuple[str, str | None], tuple[str, str | None]]:
        """Both directions: the interface, and that on the other side."""
        x, y = self.plane
        other = self.against_plane or (None, None)
        return (x, other[0]), (y, other[1])

    @property
    def sense(self) -> float:
        """1 of a ring, -1 of a pin."""
        return 1.0 if self.inside else -1.0

    @property
    def gap(self) -> float:
        """What the penetration lacks to the distance from the centre, which counts as `sense`."""
        return self.sense * self.clearance

    @property
    def room(self) -> float:
        """Distance in m at rest to where it touches; negative where it is closed."""
        return self.gap - self.sense * float(np.hypot(*self.eccentricity))

    @property
    def sliding_speed(self) -> float:
        """Speed of the surface, without the whirl, where it touches: from first to second."""
        return self.sense * (self.surface_speed or 0.0) + 0.0  # never -0.0, whose sense is another

    @property
    def rub(self) -> float:
        """Coefficient of friction in the sense of the surface that turns, without the whirl."""
        return float(np.copysign(self.friction, self.sliding_speed))

    @property
    def jumps(self) -> bool:
        """Whether a force or velocity may jump: friction does where the surface turns."""
        return self.friction > 0.0 or self.impulsive

    @property
    def is_linear(self) -> bool:
        """Whether the normal force goes with the penetration."""
        return not self.impulsive and self.normal.is_linear

    @property
    def sharp(self) -> bool:
        """Whether it is so stiff from the first touch that multipliers have no slope there."""
        return self.impulsive or self.normal.sharp

    @property
    def depends_on_speed(self) -> bool:
        """Whether the normal force may depend on the speed, or an impact takes energy out."""
        if self.impulsive:
            return self.restitution != 1.0
        return self.normal.depends_on_speed

    @property
    def concentric(self) -> bool:
        """Whether the centre lies at the place at rest."""
        return self.eccentricity == (0.0, 0.0)

    def number(self, name: str) -> float:
        """One of its numbers that can be followed.

        Examples
        --------
        >>> ring = RoundStop(("x", "y"), 1e6, 1e-3, eccentricity=(0.0, 2e-4))
        >>> ring.number("second_eccentricity"), ring.with_number("clearance", 2e-3).clearance
        (0.0002, 0.002)
        """
        if name in _CENTRES:
            return self.eccentricity[_CENTRES.index(name)]
        return float(getattr(self, _CALLED.get(name, name)))

    def with_number(self, name: str, value: float) -> RoundStop:
        """The same with another value of one of them."""
        if name in _CENTRES:
            x, y = self.eccentricity
            return replace(self, eccentricity=(value, y) if name == _CENTRES[0] else (x, value))
        change: dict[str, Any] = {_CALLED.get(name, name): value}
        return replace(self, **change)

    def force(self, penetration: ArrayLike, speed: ArrayLike = 0.0) -> Real:
        """Normal force in N at penetrations (m) and their rates (m/s)."""
        return self.normal.force(penetration, speed)

    def viscosity(self, penetration: ArrayLike, speed: ArrayLike = 0.0) -> Real:
        """Its derivative by the rate in N s/m."""
        return self.normal.viscosity(penetration, speed)

    def polar(self, place: ArrayLike, speed: ArrayLike) -> Polar:
        """Where the body is, at displacements and velocities (k, 2) along both directions."""
        away = np.asarray(place, dtype=float) - self.eccentricity
        moves = np.asarray(speed, dtype=float)
        radius = np.hypot(away[:, 0], away[:, 1])
        normal = away / np.where(radius > 0.0, radius, 1.0)[:, None]
        normal[radius == 0.0] = 1.0, 0.0
        depth, rate = self.sense * radius - self.gap, self.sense * (normal * moves).sum(axis=1)
        whirl = normal[:, 0] * moves[:, 1] - normal[:, 1] * moves[:, 0]
        return Polar(radius, normal, depth, rate, whirl + self.sliding_speed)

    def along(self, at: Polar) -> Real:
        """Forces (k, 2) that hold the body back where it slides, per unit of the normal force."""
        return self.sense * at.normal + (self.friction * np.sign(at.sliding))[:, None] * at.across


def fault_of_rubbing(friction: float | None, surface_speed: float | None) -> str | None:
    """What is wrong with friction and the speed of a surface, of which None is not given.

    Examples
    --------
    >>> fault_of_rubbing(None, 5.0)
    'has a surface_speed, which needs a friction, or 0'
    >>> fault_of_rubbing(0.0, 5.0)
    """
    if friction and surface_speed is None:
        return "has friction, which needs the surface_speed of what turns, or 0"
    if friction is None and surface_speed is not None:
        return "has a surface_speed, which needs a friction, or 0"
    return None


def _check_pair(owner: str, name: str, pair: object) -> None:
    """Refuse what is no pair of different interfaces."""
    if not (isinstance(pair, tuple | list) and len(pair) == 2):
        raise SystemModelError(
            f"{owner}: {name} must be two interfaces, along perpendicular directions, got "
            f"{shown(pair)}"
        )
    for each in pair:
        check_types(**{f"{owner}: {name}": (each, str)})
    if pair[0] == pair[1]:
        raise SystemModelError(f"{owner}: {name} must be two different interfaces")
