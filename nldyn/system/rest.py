"""Rest under preload: where a structure lies that its stops press upon, and small motions there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from nldyn.base.arrays import Complex, Real
from nldyn.system.contact_law import power_law
from nldyn.system.elements import Stop
from nldyn.system.system import System

MOST_STEPS = 200
SHORTEST = 1e-14  # last step, relative
SHARE = 0.1  # of the decrease that the slope foretells, with which a step is taken


def rest(system: System) -> Real:
    """Modal displacements (n,) at which the structure rests when nothing excites it.

    They are zero unless a stop is closed there (a negative gap). The forces of the structure and of
    the stops have the potential ``q Ω² q / 2 + Σ k δ^(m + 1) / (m + 1)``, which is convex: Newton's
    method with shortened steps [Nocedal and Wright 2006, section 3.1] comes to its only minimum. A
    stop with a law of its own counts with its stiffness and exponent.

    Examples
    --------
    >>> from nldyn import Stop
    >>> stop = Stop.linear("tip", (20.0 * np.pi) ** 2, gap=-1e-3)
    >>> system = System.from_modal([10.0], {"tip": [1.0]}, stops=[stop])
    >>> float(rest(system)[0].round(9))
    -0.0005
    """
    q = np.zeros(system.size)
    for _ in range(MOST_STEPS):
        slope, stiffness = _slope(system, q), tangent_stiffness(system, q)
        step = -np.linalg.lstsq(stiffness, slope, rcond=None)[0]
        size, potential, steepness = 1.0, _potential(system, q), float(np.linalg.norm(slope))
        while size > SHORTEST:
            there = q + size * step
            foretold = potential + SHARE * size * float(slope @ step)
            # near the minimum the potential is rounding, the forces are not
            if _potential(system, there) <= foretold or _steepness(system, there) < steepness:
                break
            size *= 0.5
        else:
            break
        q = there
        if size * float(np.linalg.norm(step)) <= SHORTEST * float(np.linalg.norm(q)):
            break
    return q


def held_response(system: System, q: Real, omega: float) -> Complex:
    """Amplitude (n,) of the small steady motion q + Re(a e^{iωt}) about a rest position q."""
    force = np.zeros(system.size, dtype=complex)
    for source in system.excitation:
        force += source.phasor * omega**source.order * system.participation[source.at]
    matrix = tangent_stiffness(system, q) - omega**2 * np.eye(system.size)
    found = np.linalg.lstsq(matrix + 1j * omega * system.total_damping, force, rcond=None)[0]
    return np.asarray(found)


def at_rest(q: Real) -> Real:
    """Modal displacements and velocities (2n,) of a structure that rests at q."""
    return np.append(q, np.zeros_like(q))


def held_motion(system: System, q: Real, omega: float, phases: Real) -> Real:
    """Modal displacements and velocities (k, 2n) of `held_response` at forcing phases (k,)."""
    turning = np.exp(1j * phases)[:, None] * held_response(system, q, omega)
    return np.hstack([q + turning.real, (1j * omega * turning).real])


def tangent_stiffness(system: System, q: Real) -> Real:
    """Stiffness (n, n) of the structure with its closed stops at modal displacements q."""
    matrix = np.diag(system.natural_frequencies**2)
    for stop, c, depth in _closed(system, q):
        matrix += _elastic(stop, depth)[1] * np.outer(c, c)
    return matrix


def _closed(system: System, q: Real) -> Iterator[tuple[Stop, Real, float]]:
    """The stops that are closed at modal displacements q, with their vectors and penetrations."""
    for stop in system.stops:
        c = system.stop_vector(stop)
        depth = float(c @ q) - stop.gap
        if depth > 0.0:
            yield stop, c, depth


def _elastic(stop: Stop, depth: float) -> tuple[float, float]:
    """Force and stiffness of a closed stop at rest."""
    force, stiffness, _ = power_law(stop.stiffness, stop.exponent, 0.0, depth, 0.0)
    return force, stiffness


def _slope(system: System, q: Real) -> Real:
    slope = system.natural_frequencies**2 * q
    for stop, c, depth in _closed(system, q):
        slope = slope + _elastic(stop, depth)[0] * c
    return np.asarray(slope)


def _steepness(system: System, q: Real) -> float:
    return float(np.linalg.norm(_slope(system, q)))


def _potential(system: System, q: Real) -> float:
    energy = 0.5 * float(system.natural_frequencies**2 @ q**2)
    for stop, _, depth in _closed(system, q):
        energy += _elastic(stop, depth)[0] * depth / (stop.exponent + 1.0)
    return energy
