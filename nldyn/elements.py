"""Stops, dampers and excitation: what acts on a reduced model at its interface points."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from nldyn.errors import SystemModelError


def _finite(owner: str, name: str, value: float) -> None:
    if not math.isfinite(value):
        raise SystemModelError(f"{owner}: {name} must be a finite number, got {value}")


def _positive(owner: str, name: str, value: float) -> None:
    _finite(owner, name, value)
    if value <= 0.0:
        raise SystemModelError(f"{owner}: {name} must be positive, got {value:g}")


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
    _positive(owner, "radius", radius)
    compliance = 0.0
    for modulus, ratio in (
        (youngs_modulus, poissons_ratio),
        (
            youngs_modulus if other_youngs_modulus is None else other_youngs_modulus,
            poissons_ratio if other_poissons_ratio is None else other_poissons_ratio,
        ),
    ):
        _positive(owner, "youngs_modulus", modulus)
        _finite(owner, "poissons_ratio", ratio)
        if not -1.0 < ratio <= 0.5:
            raise SystemModelError(f"{owner}: poissons_ratio must lie in (-1, 0.5], got {ratio:g}")
        compliance += (1.0 - ratio**2) / modulus
    return 4.0 / 3.0 * math.sqrt(radius) / compliance


@dataclass(frozen=True)
class Stop:
    r"""One-sided contact with the force :math:`F = k\,\delta^p` for a penetration δ > 0.

    The penetration is ``direction * (displacement at `at` - displacement at `against`) - gap``.

    Parameters
    ----------
    at : str
        Interface that hits the stop.
    stiffness : float
        k in N/m^p.
    exponent : float
        p: 1.5 for Hertz's law, 1 for a linear one-sided spring; at least 1.
    gap : float
        Distance in m at rest; a negative gap preloads the stop.
    direction : {1, -1}
        Sign of the displacement that closes the gap.
    against : str, optional
        Interface on the other side; the ground unless given.

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

    def __post_init__(self) -> None:
        owner = f"stop at '{self.at}'"
        _positive(owner, "stiffness", self.stiffness)
        _finite(owner, "exponent", self.exponent)
        if self.exponent < 1.0:
            raise SystemModelError(f"{owner}: exponent must be at least 1, got {self.exponent:g}")
        _finite(owner, "gap", self.gap)
        if self.against == self.at:
            raise SystemModelError(f"{owner}: against must be another interface")
        if self.direction not in (1, -1):
            raise SystemModelError(f"{owner}: direction must be +1 or -1, got {self.direction}")

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
        gap, direction
            As for `Stop`.

        Examples
        --------
        >>> f"{Stop.hertz('middle', radius=0.005, youngs_modulus=2.1e11).stiffness:.4e}"
        '1.0879e+10'
        """
        stiffness = hertz_stiffness(radius, youngs_modulus, poissons_ratio)
        return cls(at, stiffness, 1.5, gap, direction)

    @classmethod
    def linear(cls, at: str, stiffness: float, *, gap: float = 0.0, direction: int = 1) -> Stop:
        """Linear one-sided spring (the bilinear oscillator's), stiffness in N/m.

        Examples
        --------
        >>> Stop.linear("middle", 1.33e7).exponent
        1.0
        """
        return cls(at, stiffness, 1.0, gap, direction)


@dataclass(frozen=True)
class Damper:
    """Linear viscous damper from an interface to the ground.

    Parameters
    ----------
    at : str
        Interface.
    coefficient : float
        Damping in N s/m, zero or positive.

    Examples
    --------
    >>> Damper("middle", 5.81).coefficient
    5.81
    """

    at: str
    coefficient: float

    def __post_init__(self) -> None:
        owner = f"damper at '{self.at}'"
        _finite(owner, "coefficient", self.coefficient)
        if self.coefficient < 0.0:
            raise SystemModelError(
                f"{owner}: coefficient must not be negative, got {self.coefficient:g}"
            )


@dataclass(frozen=True)
class HarmonicForce:
    """Force ``amplitude * cos(ωt + phase)`` at an interface.

    Parameters
    ----------
    at : str
        Interface.
    amplitude : float
        Amplitude in N.
    phase_deg : float
        Phase in degrees.

    Examples
    --------
    >>> HarmonicForce("middle", 2.0).phasor
    (2+0j)
    """

    order: ClassVar[int] = 0  # the force is phasor * ω**order

    at: str
    amplitude: float
    phase_deg: float = 0.0

    def __post_init__(self) -> None:
        _check_excitation(self.at, "amplitude", self.amplitude, self.phase_deg)

    @property
    def phasor(self) -> complex:
        """Complex amplitude in N."""
        return self.amplitude * _turn(self.phase_deg)


@dataclass(frozen=True)
class Unbalance:
    """Rotating unbalance: force ``mass_times_radius * ω² * cos(ωt + phase)`` at an interface.

    Parameters
    ----------
    at : str
        Interface.
    mass_times_radius : float
        Unbalanced mass times its radius in kg m.
    phase_deg : float
        Phase in degrees.

    Examples
    --------
    >>> Unbalance("middle", 2.0).phasor
    (2+0j)
    """

    order: ClassVar[int] = 2

    at: str
    mass_times_radius: float
    phase_deg: float = 0.0

    def __post_init__(self) -> None:
        _check_excitation(self.at, "mass_times_radius", self.mass_times_radius, self.phase_deg)

    @property
    def phasor(self) -> complex:
        """Complex amplitude over ω² in kg m."""
        return self.mass_times_radius * _turn(self.phase_deg)


Excitation = HarmonicForce | Unbalance


def _check_excitation(at: str, name: str, value: float, phase_deg: float) -> None:
    owner = f"excitation at '{at}'"
    _finite(owner, name, value)
    if value < 0.0:
        raise SystemModelError(f"{owner}: {name} must not be negative, got {value:g}")
    _finite(owner, "phase_deg", phase_deg)


def _turn(phase_deg: float) -> complex:
    phase = math.radians(phase_deg)
    return complex(math.cos(phase), math.sin(phase))
