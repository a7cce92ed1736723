"""Loads: harmonic and constant forces, unbalance, motion of the base."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from nldyn.base.errors import SystemModelError, check_frequency, check_types, shown
from nldyn.system.values import check_finite, check_not_negative

LARGEST_PHASE = 1e6  # in degrees: rounded to 1e-10 degrees


@dataclass(frozen=True)
class HarmonicForce:
    """Force ``amplitude * cos(m ωt + phase)`` at an interface, or one of a frequency of its own.

    Parameters
    ----------
    at : str
        Interface, or load vector.
    amplitude : float
        Amplitude in N.
    phase_deg : float
        Phase in degrees.
    harmonic : int
        Multiple m of the excitation frequency, from 1 to 1000. Where half orders act, as in a
        four-stroke engine, the excitation frequency is that of the whole cycle.
    frequency_hz : float, optional
        A frequency of its own in Hz, which does not change with that of the excitation: two without
        a common period have no periodic response, so that such a force can only be simulated. The
        time counts from the start of the simulation.

    Examples
    --------
    >>> HarmonicForce("middle", 2.0).phasor
    (2+0j)
    """

    at: str
    amplitude: float
    phase_deg: float = 0.0
    harmonic: int = 1
    frequency_hz: float | None = None

    power: ClassVar[int] = 0  # the force is Re(phasor (mω)**power e^{i m ωt})

    def __post_init__(self) -> None:
        _check_excitation(self.at, "amplitude", self.amplitude, self.phase_deg, self.harmonic)
        if self.frequency_hz is None:
            return
        owner = f"excitation at '{self.at}'"
        check_frequency(f"{owner}: frequency_hz", self.frequency_hz)
        if self.harmonic != 1:
            raise SystemModelError(f"{owner}: give either harmonic or frequency_hz")

    @property
    def phasor(self) -> complex:
        """Complex amplitude in N."""
        return self.amplitude * turn(self.phase_deg)


@dataclass(frozen=True)
class Unbalance:
    """Rotating unbalance: force ``mass_times_radius * (mω)² * cos(m ωt + phase)``.

    Parameters
    ----------
    at : str
        Interface, or load vector.
    mass_times_radius : float
        Unbalanced mass times its radius in kg m.
    phase_deg : float
        Phase in degrees.
    harmonic : int
        Multiple m of the excitation frequency, from 1 to 1000.

    Examples
    --------
    >>> Unbalance("middle", 2.0).phasor
    (2+0j)
    """

    at: str
    mass_times_radius: float
    phase_deg: float = 0.0
    harmonic: int = 1

    power: ClassVar[int] = 2

    def __post_init__(self) -> None:
        _check_excitation(
            self.at, "mass_times_radius", self.mass_times_radius, self.phase_deg, self.harmonic
        )

    @property
    def phasor(self) -> complex:
        """Complex amplitude over (mω)² in kg m."""
        return self.mass_times_radius * turn(self.phase_deg)


@dataclass(frozen=True)
class ConstantForce:
    """Force that does not change: a mean load, or a weight where it acts on a load vector.

    Parameters
    ----------
    at : str
        Interface, or load vector (then a factor of it: in m/s² for one of a weight).
    force : float
        In N, of either sign.

    Examples
    --------
    >>> ConstantForce("gear", -0.1).phasor
    (-0.1+0j)
    """

    at: str
    force: float

    power: ClassVar[int] = 0
    harmonic: ClassVar[int] = 0

    def __post_init__(self) -> None:
        check_types(**{"excitation: at": (self.at, str)})
        check_finite(f"excitation at '{self.at}'", "force", self.force)

    @property
    def phasor(self) -> complex:
        """The force in N, as a complex number."""
        return complex(self.force)


@dataclass(frozen=True)
class BaseMotion:
    r"""Motion of the supports, by which a structure that is described relative to them is shaken.

    Relative to the base the structure feels the force :math:`-M r \ddot x_b(t)`. The load vector
    ``at`` is :math:`M r`, with r the displacement of the whole structure when the base moves by
    one. Displacements are relative to the base.

    Parameters
    ----------
    at : str
        Load vector in kg.
    amplitude : float
        Amplitude of the base's displacement, velocity or acceleration in m, m/s or m/s².
    quantity : {"displacement", "velocity", "acceleration"}
        What keeps this amplitude at every frequency.
    phase_deg : float
        Phase in degrees.
    harmonic : int
        Multiple of the excitation frequency, from 1 to 1000.

    Examples
    --------
    >>> BaseMotion("base", 1e-3).power
    2
    """

    at: str
    amplitude: float
    quantity: str = "displacement"
    phase_deg: float = 0.0
    harmonic: int = 1

    def __post_init__(self) -> None:
        _check_excitation(self.at, "amplitude", self.amplitude, self.phase_deg, self.harmonic)
        if self.quantity not in _BASE_QUANTITIES:
            raise SystemModelError(
                f"excitation at '{self.at}': quantity must be "
                f"{', '.join(map(repr, _BASE_QUANTITIES))}, got {shown(self.quantity)}"
            )

    @property
    def power(self) -> int:
        """Power of the frequency with which the force goes."""
        return _BASE_QUANTITIES[self.quantity][0]

    @property
    def phasor(self) -> complex:
        """Complex amplitude of minus the acceleration over (mω)**power."""
        return self.amplitude * _BASE_QUANTITIES[self.quantity][1] * turn(self.phase_deg)


# power of ω in minus the acceleration, and its factor
_BASE_QUANTITIES = {"displacement": (2, 1.0), "velocity": (1, -1j), "acceleration": (0, -1.0)}

Excitation = HarmonicForce | Unbalance | ConstantForce | BaseMotion
MOST_HARMONIC = 1000


def _check_excitation(at: str, name: str, value: float, phase_deg: float, harmonic: int) -> None:
    check_types(**{"excitation: at": (at, str)})
    owner = f"excitation at '{at}'"
    check_not_negative(owner, name, value)
    check_finite(owner, "phase_deg", phase_deg)
    if abs(phase_deg) > LARGEST_PHASE:
        raise SystemModelError(
            f"{owner}: phase_deg must lie between -{LARGEST_PHASE:g} and {LARGEST_PHASE:g}, "
            f"got {phase_deg!r}"
        )
    whole = isinstance(harmonic, int | np.integer) and not isinstance(harmonic, bool)
    if not whole or not 1 <= harmonic <= MOST_HARMONIC:
        raise SystemModelError(
            f"{owner}: harmonic must be a whole number from 1 to {MOST_HARMONIC}, got "
            f"{shown(harmonic)}; where half orders act, let the excitation frequency be that of "
            "the whole cycle; two frequencies without a common period have no periodic response: "
            "simulate them, one as frequency_hz of a HarmonicForce, or take a lower one of which "
            "both are multiples, nearly (5 and 7 for a ratio of 1.4)"
        )


def turn(phase_deg: float) -> complex:
    """Complex number of length 1 at a phase."""
    phase = math.radians(phase_deg)
    return complex(math.cos(phase), math.sin(phase))
