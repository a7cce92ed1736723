"""Periodic motions of linear systems with one impact per n periods, or two that mirror each other.

With the state Z before the impact, R what that makes of velocities, E the flight's exponential over
the time between impacts and the steady response S, E (R Z - S) + σS = σZ: σ = 1 for whole periods;
half a period turns S and Z into -S and -Z. So Z = (σ - ER)⁻¹(σ - E) S, in which S goes as a cosine
of the phase of the impact, that follows from the gap [Shaw and Holmes 1983; Masri and Caughey
1966].
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm


class Motion(NamedTuple):
    """Speed and phase of the impact, state (x, v) before it, and all multipliers of a period."""

    speed: float
    phase: float
    before: np.ndarray
    multipliers: np.ndarray


class OneImpact:
    """A system M, K, C with forces f cos ωt and a gap c x = gap; periods between impacts or 1/2."""

    def __init__(self, mass, stiffness, damping, force, c, gap, restitution):
        self.mass, self.stiffness, self.damping = map(np.atleast_2d, (mass, stiffness, damping))
        self.force, self.c = np.atleast_1d(force), np.atleast_1d(c).astype(float)
        self.gap, self.restitution, n = gap, restitution, len(self.force)
        inverse = np.linalg.inv(self.mass)
        self.rates = np.block([
            [np.zeros((n, n)), np.eye(n)], [-inverse @ self.stiffness, -inverse @ self.damping]
        ])  # fmt: skip
        self.push = np.concatenate([np.zeros(n), inverse @ self.force])
        jump = inverse @ self.c / (self.c @ inverse @ self.c)
        self.rebound = np.eye(2 * n)
        self.rebound[n:, n:] -= (1.0 + restitution) * np.outer(jump, self.c)
        self.to_gap = np.concatenate([self.c, np.zeros(n)])
        self.to_speed = np.concatenate([np.zeros(n), self.c])

    def response(self, omega):
        """Complex amplitude (2n,) of the steady response."""
        dynamic = self.stiffness - omega**2 * self.mass + 1j * omega * self.damping
        x = np.linalg.solve(dynamic, self.force)
        return np.concatenate([x, 1j * omega * x])

    def at_impact(self, omega, periods):
        """Complex amplitude (2n,) of Z over the phase of the impact."""
        sign = -1.0 if periods == 0.5 else 1.0
        flown, one = expm(self.rates * 2.0 * math.pi * periods / omega), np.eye(len(self.push))
        return np.linalg.solve(
            sign * one - flown @ self.rebound, (sign * one - flown) @ self.response(omega)
        )

    def reach(self, omega, periods):
        """Largest c x at impacts of any phase: the gap at a fold."""
        return abs(self.to_gap @ self.at_impact(omega, periods))

    def motions(self, omega, periods):
        """All that have the gap closed at the impact, at a positive speed, the faster one first."""
        z = self.at_impact(omega, periods)
        reach = self.to_gap @ z
        if abs(reach) < self.gap:
            return []
        found = []
        for side in (-1.0, 1.0):
            phase = side * math.acos(self.gap / abs(reach)) - np.angle(reach)
            before = (z * np.exp(1j * phase)).real
            speed = float(self.to_speed @ before)
            if speed > 0.0:
                found.append(self._motion(omega, periods, speed, phase, before))
        return sorted(found, key=lambda motion: -motion.speed)

    def _motion(self, omega, periods, speed, phase, before):
        map_ = self.map_between(omega, periods, speed, phase, before)
        multipliers = np.linalg.eigvals(map_ @ map_ if periods == 0.5 else map_)
        return Motion(speed, phase % (2.0 * math.pi), before, multipliers)

    def map_between(self, omega, periods, speed, phase, before):
        """Derivative of the map from impact to impact, mirrored after half a period."""
        after = self.rebound @ before
        f_before, f_after = (self.rates @ z + self.push * math.cos(phase) for z in (before, after))
        saltation = self.rebound + np.outer(f_after - self.rebound @ f_before, self.to_gap) / speed
        sign = -1.0 if periods == 0.5 else 1.0
        return sign * expm(self.rates * 2.0 * math.pi * periods / omega) @ saltation

    def state(self, omega, motion, phase):
        """State (2n,) at a phase after that of the impact, before the next one."""
        response = self.response(omega)
        steady = [(response * np.exp(1j * p)).real for p in (motion.phase, phase)]
        flown = expm(self.rates * (phase - motion.phase) / omega)
        return flown @ (self.rebound @ motion.before - steady[0]) + steady[1]
