"""The bilinear oscillator solved piece by piece with thirty digits, without the flow map.

x'' + c x' + k x + s max(x - g, 0) = f cos(ωt) has closed forms on either side of x = g. An orbit
is given by the phase and the speed of its first entry and the times between its switches, which
meet x = g at each switch and close. The force is continuous, so that the monodromy matrix is the
product of the pieces' matrix exponentials [Shaw and Holmes 1983].
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import mpmath as mp
import numpy as np

from nldyn import HarmonicForce, Stop, System
from nldyn.orbits.orbit import Orbit

mp.mp.dps = 30
SAMPLES = 20000


@dataclass(frozen=True)
class Bilinear:
    """The numbers of the oscillator, of unit mass."""

    damping: float
    stiffness: float
    stop: float
    gap: float
    force: float

    @property
    def system(self) -> System:
        """The same for nldyn."""
        return System.from_matrices(
            [[1.0]], [[self.stiffness]], {"m": [1.0]}, damping=[[self.damping]],
            stops=[Stop.linear("m", self.stop, gap=self.gap)],
            excitation=[HarmonicForce("m", self.force)],
        )  # fmt: skip

    def motion(self, closed, omega, t, x, v, duration):
        """Displacement, speed and matrix exponential after a time on one side of the switch."""
        c = mp.mpf(self.damping)
        k = mp.mpf(self.stiffness) + (self.stop if closed else 0)
        rest = mp.mpf(self.stop) * self.gap / k if closed else mp.mpf(0)
        response = self.force / (k - omega**2 + 1j * c * omega)

        def steady(time):
            turn = response * mp.mpc(mp.cos(omega * time), mp.sin(omega * time))
            return mp.matrix([rest + turn.real, (1j * omega * turn).real])

        own = mp.sqrt(k - c**2 / 4)
        cos, sin = mp.cos(own * duration), mp.sin(own * duration) / own
        matrix = mp.exp(-c * duration / 2) * mp.matrix(
            [[cos + c / 2 * sin, sin], [-k * sin, cos - c / 2 * sin]]
        )
        return steady(t + duration) + matrix * (mp.matrix([x, v]) - steady(t)), matrix


@dataclass(frozen=True)
class PiecewiseOrbit:
    """Unknowns of an orbit: phase and speed of the first entry, then the times between switches."""

    oscillator: Bilinear
    period: int
    omega: mp.mpf
    unknowns: tuple

    @classmethod
    def near(cls, oscillator: Bilinear, orbit: Orbit) -> PiecewiseOrbit:
        """A guess from a sampled orbit: its switches are good to three digits or so.

        The last flight is the one that comes nearest to the stop.
        """
        history = orbit.history(SAMPLES)
        depth, omega = history.penetration[:, 0], orbit.omega
        inside = depth > 1e-6 * np.ptp(depth)  # a touch of less is none
        entries = np.flatnonzero(~inside & np.roll(inside, -1))
        exits = np.flatnonzero(inside & ~np.roll(inside, -1))
        tops = (depth > np.roll(depth, 1)) & (depth >= np.roll(depth, -1)) & ~inside
        if tops.any():
            top = np.flatnonzero(tops)[np.argmax(depth[tops])]
            entries = np.roll(entries, -np.searchsorted(entries, top))
        first = entries[0]
        span = 2.0 * np.pi * orbit.period / omega
        switches = np.sort((np.r_[entries, exits] - first) % SAMPLES) * span / SAMPLES
        times = np.diff(np.append(switches, span))
        speed = (depth[(first + 1) % SAMPLES] - depth[first]) / (span / SAMPLES)
        return cls(
            oscillator, orbit.period, mp.mpf(omega), (history.time[first] * omega, speed, *times)
        )

    @property
    def frequency_hz(self) -> float:
        """Excitation frequency in Hz."""
        return float(self.omega / (2 * mp.pi))

    def conditions(self) -> list:
        """Zero for an orbit: x - g at all switches, and how far speed and time are from closing."""
        off = []
        t, v = self.unknowns[0] / self.omega, self.unknowns[1]
        start, x = v, mp.mpf(self.oscillator.gap)
        for number, duration in enumerate(self.unknowns[2:]):
            closed = number % 2 == 0
            (x, v), _ = self.oscillator.motion(closed, self.omega, t, x, v, duration)
            off.append(x - self.oscillator.gap)
            t, x = t + duration, mp.mpf(self.oscillator.gap)
        span = 2 * mp.pi * self.period / self.omega
        return [*off, v - start, sum(self.unknowns[2:]) - span]

    def monodromy(self):
        """Product of the pieces' matrix exponentials."""
        product = mp.eye(2)
        for number, duration in enumerate(self.unknowns[2:]):
            piece = self.oscillator.motion(number % 2 == 0, self.omega, 0, 0, 0, duration)[1]
            product = piece * product
        return product

    def beyond(self, multiplier: int):
        """Determinant of the monodromy matrix less a multiplier: zero at a fold or a flip."""
        return mp.det(self.monodromy() - multiplier * mp.eye(2))

    def last_flight(self, share):
        """Distance from the stop and speed after a share of the last flight."""
        oscillator, t = self.oscillator, self.unknowns[0] / self.omega
        x, v = mp.mpf(oscillator.gap), self.unknowns[1]
        for number, duration in enumerate(self.unknowns[2:-1]):
            (x, v), _ = oscillator.motion(number % 2 == 0, self.omega, t, x, v, duration)
            t = t + duration
        (x, v), _ = oscillator.motion(False, self.omega, t, x, v, share * self.unknowns[-1])
        return [x - oscillator.gap, v]

    def solved(self) -> PiecewiseOrbit:
        """The orbit at this frequency."""
        found = _newton(lambda *u: replace(self, unknowns=u).conditions(), self.unknowns)
        return replace(self, unknowns=tuple(found))

    def at_multiplier(self, multiplier: int) -> PiecewiseOrbit:
        """The orbit at the frequency at which a multiplier has a value."""

        def equations(omega, *u):
            trial = replace(self, omega=omega, unknowns=u)
            return [*trial.conditions(), trial.beyond(multiplier)]

        omega, *found = _newton(equations, (self.omega, *self.unknowns))
        return replace(self, omega=omega, unknowns=tuple(found))

    def at_touch(self, share: float) -> PiecewiseOrbit:
        """The orbit at the frequency at which the last flight just touches the stop."""

        def equations(omega, part, *u):
            trial = replace(self, omega=omega, unknowns=u)
            return [*trial.conditions(), *trial.last_flight(part)]

        omega, _, *found = _newton(equations, (self.omega, mp.mpf(share), *self.unknowns))
        return replace(self, omega=omega, unknowns=tuple(found))


def _newton(equations, guess):
    start = [mp.mpf(float(x)) for x in guess]
    return list(mp.findroot(equations, start, solver="mdnewton", tol=1e-45, maxsteps=30))
