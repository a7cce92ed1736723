"""What a moving base adds to displacements that are observed as absolute ones."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from nldyn.base.arrays import Complex, Real
from nldyn.system.loads import BaseMotion


class Ride(NamedTuple):
    """Motion Σ Re(a e^{imωt}) with the base, of a place that the base carries along.

    Parameters
    ----------
    orders : (k,)
        Multiples m of the excitation frequency.
    amplitudes : (k,)
        Complex amplitudes a in m, each in proportion to a power of ω.
    powers : (k,)
        These powers.
    """

    orders: Real
    amplitudes: Complex
    powers: Real

    @classmethod
    def of(cls, sources: Iterable[tuple[BaseMotion, float]], omega: float) -> Ride:
        """That on some bases, each by a factor, at ω (rad/s)."""
        rows = [
            (source.harmonic, factor * displacement(source, omega), source.power - 2)
            for source, factor in sources
        ]
        orders, amplitudes, powers = zip(*rows, strict=True) if rows else ((), (), ())
        return cls(np.array(orders, float), np.array(amplitudes, complex), np.array(powers, float))

    def at(self, phases: Real) -> Real:
        """Displacements (k,) in m at forcing phases (k,) in rad."""
        return np.asarray((self._turns(phases) @ self.amplitudes).real)

    def speed(self, phases: Real, omega: float | Real) -> Real:
        """Velocities (k,) in m/s."""
        return np.asarray(omega * (self._turns(phases) @ (1j * self.orders * self.amplitudes)).real)

    def by_log_omega(self, phases: Real) -> Real:
        """Derivatives (k,) of the displacements with respect to ln ω at fixed phases."""
        return np.asarray((self._turns(phases) @ (self.powers * self.amplitudes)).real)

    def _turns(self, phases: Real) -> Complex:
        return np.asarray(np.exp(1j * np.asarray(phases)[..., None] * self.orders))


ALIKE = 1e-6  # relative difference of two motions with the base that is rounding


def carried_apart(
    bases: Iterable[BaseMotion], some: Mapping[str, float], other: Mapping[str, float]
) -> bool:
    """Whether bases carry two places otherwise, by the factors with which each load takes them."""
    apart: dict[tuple[int, int], complex] = {}
    most = 0.0
    for base in bases:
        kind, off = (base.harmonic, base.power), some.get(base.at, 0.0) - other.get(base.at, 0.0)
        apart[kind] = apart.get(kind, 0.0) + base.phasor * off
        most = max(most, abs(base.phasor))
    return max(map(abs, apart.values()), default=0.0) > ALIKE * most


def told_apart(what: str, at: str, against: str) -> str:
    """Why a spring, damper or stop between two places that a base carries otherwise is refused."""
    return (
        f"{what}: a base carries '{at}' otherwise than '{against}', but displacements "
        "are relative to the base: move both by it, or give forces in place of it"
    )


NO_RIDE = Ride.of((), 0.0)  # of a place at rest


def displacement(source: BaseMotion, omega: float) -> complex:
    """Complex amplitude in m of a base's displacement: what it has of -x'' is (mω)² x."""
    pace = source.harmonic * omega
    return complex(source.phasor * pace ** (source.power - 2))
