"""The impact oscillator: the limit of an infinitely stiff stop, and what a short contact adds.

The limit is x'' + c x' + k x = f cos ωt, x <= 0, with restitution 1. Its motion with one impact per
period has a closed form, and so has its monodromy matrix: the flight's exponential times the
saltation matrix of the impact [Shaw and Holmes 1983; Nordmark 1991]. A stop of force s δ^p is
closed for a time of the order s^(-1/(p+1)), so all differences fall with that power of s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import mpmath
import numpy as np
import scipy.linalg as sla
from scipy.optimize import brentq

from nldyn.base.arrays import Real
from nldyn.system.loads import HarmonicForce
from nldyn.system.stop import Stop
from nldyn.system.system import System

mp = mpmath.mp


@dataclass(frozen=True)
class ImpactOscillator:
    """The numbers of the oscillator, of unit mass.

    Parameters
    ----------
    damping, stiffness, force : float
        c in 1/s, k in 1/s², f in m/s².
    """

    damping: float = 0.1
    stiffness: float = 1.0
    force: float = 1.0

    def with_stop(self, stop: float, exponent: float = 1.5) -> System:
        """The same with an elastic stop of a stiffness in N/m^p."""
        return System.from_matrices(
            [[1.0]],
            [[self.stiffness]],
            {"m": [1.0]},
            damping=[[self.damping]],
            stops=[Stop("m", stop, exponent)],
            excitation=[HarmonicForce("m", self.force)],
        )

    def rigid(self, omega: float) -> tuple[float, float, Real]:
        """Phase and speed of the impact, and the monodromy matrix, of the motion with one impact.

        From (0, -v) the flight leads to (0, v) after a period. Less the steady response (X, V) at
        the impact, it is linear: (E - 1)(X, V) = E (0, -v) - (0, v), which gives
        (X, V) = v (α, β), and X, V/ω are the two components of an amplitude that is known.
        """
        matrix = np.array([[0.0, 1.0], [-self.stiffness, -self.damping]])
        flight = sla.expm(matrix * 2.0 * math.pi / omega)
        rates = np.linalg.solve(flight - np.eye(2), flight @ [0.0, -1.0] - [0.0, 1.0])
        response = self.force / (self.stiffness - omega**2 + 1j * self.damping * omega)
        speed = abs(response) / math.hypot(rates[0], rates[1] / omega)
        turned = speed * complex(rates[0], -rates[1] / omega)  # response times exp(i phase)
        phase = float(np.angle(turned / response))
        push = self.force * math.cos(phase)
        before, after = push - self.damping * speed, push + self.damping * speed
        saltation = np.array([[-1.0, 0.0], [(before + after) / speed, -1.0]])
        return phase % (2.0 * math.pi), float(speed), flight @ saltation

    def rigid_start(self, omega: float) -> Real:
        """Displacement and velocity of that motion at phase zero, a good guess for stiff stops."""
        phase, speed, _ = self.rigid(omega)
        response = self.force / (self.stiffness - omega**2 + 1j * self.damping * omega)
        turn = response * np.exp(1j * np.array([phase, 0.0]))
        steady = np.array([turn.real, (1j * omega * turn).real])
        matrix = np.array([[0.0, 1.0], [-self.stiffness, -self.damping]])
        flight = sla.expm(matrix * (2.0 * math.pi - phase) / omega)
        return np.asarray(steady[:, 1] + flight @ ([0.0, -speed] - steady[:, 0]))

    def rigid_flip(self, low_hz: float, high_hz: float) -> float:
        """Frequency in Hz, between two others, at which a multiplier of the limit is -1."""

        def beyond(hz: float) -> float:
            return float(np.linalg.det(self.rigid(2.0 * math.pi * hz)[2] + np.eye(2)))

        return float(brentq(beyond, low_hz, high_hz, xtol=1e-14))

    def dwelling(self, omega: float, stop: float) -> tuple[float, float]:
        """Phase and speed at which the contact with a Hertz stop begins, but for its square.

        Where a contact is short, it is that of a free body [Johnson 1985, 11.4]: it lasts
        τ = 2.94 δ/v with δ = (5 v²/4s)^(2/5), and damping takes c ∫ δ'² dt from the energy. What
        is left out goes with the square of τ.
        """
        with mp.workdps(40):
            w, c, k, f = (mp.mpf(x) for x in (omega, self.damping, self.stiffness, self.force))
            response = f / (k - w**2 + 1j * c * w)
            own = mp.sqrt(k - c**2 / 4)
            last = 2 * mp.mpf(2) / 5 * mp.beta(mp.mpf(2) / 5, mp.mpf(1) / 2)
            work = 2 * mp.mpf(2) / 5 * mp.beta(mp.mpf(2) / 5, mp.mpf(3) / 2)

            def steady(phase: mpmath.mpf) -> mpmath.matrix:
                turn = response * mp.mpc(mp.cos(phase), mp.sin(phase))  # expj fails in findroot
                return mp.matrix([turn.real, (1j * w * turn).real])

            def off(phase: mpmath.mpf, speed: mpmath.mpf) -> list[mpmath.mpf]:
                depth = (5 * speed**2 / (4 * stop)) ** mp.mpf("0.4")
                duration = last * depth / speed
                t = 2 * mp.pi / w - duration
                cos, sin = mp.cos(own * t), mp.sin(own * t) / own
                flight = mp.exp(-c * t / 2) * mp.matrix(
                    [[cos + c / 2 * sin, sin], [-k * sin, cos - c / 2 * sin]]
                )
                leaving = mp.matrix([0, c * work * depth - speed])
                end = steady(phase) + flight * (leaving - steady(phase + w * duration))
                return [end[0], end[1] - speed]

            found = mp.findroot(off, self.rigid(omega)[:2], solver="mdnewton")
            return float(found[0]), float(found[1])
