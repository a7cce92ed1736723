"""Backbones: the periodic free motions of a system that nothing damps, from a linear mode on.

The orbits of a conservative system come in families over the energy; each has its own frequency.
So the frequency is an unknown, and two more equations belong to the shooting equations: one that
fixes the phase, and one that says how far along the family the next orbit lies. As the flow keeps
the energy, the equations are one too many and consistent: Newton's steps are least-squares
solutions. [Muñoz-Almaraz et al. 2003 have a parameter that breaks the conservation instead.]
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    ConvergenceError,
    LocateError,
    SystemModelError,
    check_types,
    check_whole,
    is_finite,
)
from nldyn.base.optional import optional
from nldyn.bifurcations.roots import root
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.orbits.newton import spread
from nldyn.orbits.orbit import Orbit, check_observe
from nldyn.orbits.shooting import ShootingProblem, shooting_problem
from nldyn.system.equilibrium import (
    at_rest,
    constant_force,
    force_at,
    potential_at,
    rest,
    tangent_stiffness,
)
from nldyn.system.system import System

if TYPE_CHECKING:
    import pandas

FIRST_STEP, LONGEST_STEP, SHORTEST_STEP = 0.05, 0.3, 1e-6  # relative to the size of the orbit
CLOSED = 1e-10  # last step of Newton's method, relative
MOST_ITERATIONS = 12
LONGEST_TURN = 0.3  # of the family from one orbit to the next, in rad
SURELY = 1e-6  # beyond the unit circle, from which an orbit counts as unstable
UNSEEN = 1e-12  # share of a mode at an interface that is rounding
STRAIGHT = 1e-6  # turn of the tangent, below which it says no more of the next step


@dataclass(frozen=True, eq=False)
class Backbone:
    """A family of free periodic motions, in the order in which it was followed.

    Parameters
    ----------
    orbits : tuple of Orbit
        The orbits; their excitation frequency is that of the free motion.
    energy : (k,)
        Energy of each in J, above that of rest.
    mode : int
        Linear mode at which the family begins, counted from 1.
    reason : str
        Why it ends.
    rest_m : float
        Displacement at rest of the observed interface.

    Examples
    --------
    >>> from nldyn import PolynomialSpring, System
    >>> duffing = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]},
    ...     springs=[PolynomialSpring("x", [0.0, 0.0, 1.0])])
    >>> found = backbone(duffing, amplitude_m=(0.01, 1.0))
    >>> found.orbits[-1].frequency_hz > found.orbits[0].frequency_hz
    True
    """

    orbits: tuple[Orbit, ...]
    energy: Real
    mode: int
    reason: str
    rest_m: float = 0.0

    def __repr__(self) -> str:
        """One line: mode, range of frequencies and amplitudes, and why it ends."""
        hz, size = self.frequency_hz, self.amplitude
        return (
            f"<Backbone of mode {self.mode}: {len(self.orbits)} orbits from {hz[0]:.6g} to "
            f"{hz[-1]:.6g} Hz, {size[0]:.4g} to {size[-1]:.4g} m at '{self.orbits[0].observe}'; "
            f"{self.reason}>"
        )

    @cached_property
    def frequency_hz(self) -> Real:
        """Frequencies in Hz, (k,)."""
        return np.array([orbit.frequency_hz for orbit in self.orbits])

    @cached_property
    def amplitude(self) -> Real:
        """Largest displacements from rest in m at the observed interface, (k,)."""
        return np.array([farthest_from(self.rest_m, orbit) for orbit in self.orbits])

    @cached_property
    def stable(self) -> np.ndarray:
        """Whether no multiplier of an orbit lies outside the unit circle, (k,).

        Two multipliers are 1 in theory, one along the motion and one along the family; rounding
        parts them by up to the root of the flow map's error, which is allowed.
        """
        return np.array([_stable(orbit) for orbit in self.orbits])

    def to_pandas(self) -> pandas.DataFrame:
        """Frequency, energy, amplitude, impacts, stability and error of each orbit."""
        return optional("pandas", "to_pandas").DataFrame(
            {
                "frequency_hz": self.frequency_hz,
                "energy_j": self.energy,
                "amplitude_m": self.amplitude,
                "impacts": [orbit.impacts for orbit in self.orbits],
                "stable": self.stable,
                "error": [orbit.error for orbit in self.orbits],
            }
        )


def farthest_from(place_m: float, orbit: Orbit) -> float:
    """Largest distance in m of the observed displacement from a place."""
    return float(np.abs(orbit.observed_extremes.values - place_m).max(initial=0.0))


def _stable(orbit: Orbit) -> bool:
    sizes = np.abs(orbit.multipliers)
    allowed = max(SURELY, 10.0 * math.sqrt(orbit.problem.flow.options.rtol))
    return bool(sizes.max() < 1.0 + allowed)


def backbone(
    system: System | FlowMap,
    mode: int = 1,
    *,
    amplitude_m: tuple[float, float],
    observe: str | None = None,
    max_orbits: int = 500,
) -> Backbone:
    """Follow the free motions of an undamped system from a linear mode on.

    Parameters
    ----------
    system : System or FlowMap
        Without damping and without excitation, but for constant forces.
    mode : int
        Mode of the small vibrations about the rest position, counted from 1.
    amplitude_m : (float, float)
        Smallest and largest displacement from rest in m at the observed interface: where the family
        begins and ends.
    observe : str, optional
        Interface; the first unless given.
    max_orbits : int
        Most orbits.

    Returns
    -------
    Backbone

    Raises
    ------
    SystemModelError
        For a system that is damped, loses energy at its stops, is excited or has no such mode, and
        for input that makes no sense.
    ConvergenceError
        If no orbit of the smallest amplitude is found.

    References
    ----------
    G. Kerschen, M. Peeters, J. C. Golinval, A. F. Vakakis (2009), *Mech. Syst. Signal Process.* 23,
    170-194; F. J. Muñoz-Almaraz et al. (2003), *Physica D* 181, 1-38.

    Examples
    --------
    >>> import numpy as np
    >>> from nldyn import Stop, System
    >>> bilinear = System.from_matrices([[1.0]], [[1.0]], {"x": [1.0]},
    ...     stops=[Stop.linear("x", 3.0)])
    >>> found = backbone(bilinear, amplitude_m=(0.01, 0.1))
    >>> exact = 2.0 / (1.0 + 0.5) / (2.0 * np.pi)  # half at 1 rad/s, half at 2 rad/s
    >>> bool(np.allclose(found.frequency_hz, exact, rtol=1e-9))
    True
    """
    flow = flow_of(system)
    name = check_observe(flow.system, observe)
    check_whole("mode", mode, 1, flow.system.size)
    check_whole("max_orbits", max_orbits, 2)
    low, high = _checked_range(amplitude_m)
    _check_conservative(flow.system)
    family = _Family(flow, name)
    here, tangent = family.begin(mode, low)
    orbits, reason, step = [here], f"{max_orbits} orbits", FIRST_STEP
    while len(orbits) < max_orbits:
        found = None
        while found is None and step >= SHORTEST_STEP:
            found = family.next(here, tangent, step)
            step *= 0.5 if found is None else 1.0
        if found is None:
            reason = f"step below {SHORTEST_STEP:g}: {family.obstacle}"
            break
        if family.amplitude(found[0]) > high:
            reason = "end of the range of amplitudes"
            orbits.append(family.at_end(here, tangent, step, high) or found[0])
            break
        here, tangent, turn = found
        step = min(LONGEST_STEP, step * min(1.5, 0.5 * LONGEST_TURN / max(turn, STRAIGHT)))
        orbits.append(here)
    energy = np.array([family.energy(orbit) for orbit in orbits])
    return Backbone(tuple(orbits), energy, mode, reason, family.rest_m)


def _checked_range(amplitude_m: object) -> tuple[float, float]:
    check_types(amplitude_m=(amplitude_m, (tuple, list)))
    values: Any = amplitude_m
    if len(values) != 2 or not all(map(is_finite, values)) or not 0.0 < values[0] < values[1]:
        raise SystemModelError(
            f"amplitude_m must be two ascending positive numbers, got {amplitude_m}"
        )
    return float(values[0]), float(values[1])


def _check_conservative(system: System) -> None:
    if not system.conservative:
        raise SystemModelError(
            "a backbone needs a system that nothing damps: leave out modal_damping, dampers, and "
            "what stops and springs take by their speed"
        )
    if np.any(system.total_damping):
        raise SystemModelError("backbones are not followed with gyroscopic matrices")
    if system.rigid_stops:
        raise SystemModelError(
            "backbones are not followed against rigid stops: give the stop a high stiffness"
        )
    if system.driven:
        raise SystemModelError(
            "a backbone is that of free motions: leave out all excitation but constant forces"
        )


class _Family:
    """The equations of one family of free motions."""

    def __init__(self, flow: FlowMap, observe: str) -> None:
        self.flow, self.observe = flow, observe
        self.problem: ShootingProblem = shooting_problem(flow, 1)
        self.rest = rest(flow.system)
        self.push = constant_force(flow.system)
        self.rest_m = float(self.rest @ flow.system.participation[observe])
        self.origin = flow.to_state(at_rest(self.rest))
        self.obstacle = ""

    def begin(self, mode: int, amplitude: float) -> tuple[Orbit, Real]:
        """The orbit of a small amplitude near a linear mode, and the direction of the family."""
        system = self.flow.system
        squares, shapes = np.linalg.eigh(tangent_stiffness(system, self.rest))
        if not squares[mode - 1] > 0.0:
            raise SystemModelError(
                f"mode {mode} does not vibrate about the rest position: it is free or unstable"
            )
        shape = shapes[:, mode - 1]
        seen = float(shape @ system.participation[self.observe])
        if abs(seen) <= UNSEEN * np.linalg.norm(system.participation[self.observe]):
            raise SystemModelError(
                f"mode {mode} does not move interface '{self.observe}': observe another one"
            )
        omega = math.sqrt(squares[mode - 1])
        q = self.rest + amplitude / seen * shape
        start = self.flow.to_state(np.append(q, np.zeros(system.size)))
        guess = np.append(spread(self.problem, start, omega).ravel(), math.log(omega))
        outward = np.append(self.deviation(guess), 0.0)
        found = self.solve(guess, guess, outward / np.linalg.norm(outward), 0.0)
        if found is None:
            raise ConvergenceError(
                f"no free motion of {amplitude:g} m at '{self.observe}' was found near mode "
                f"{mode}: {self.obstacle}; begin with another amplitude"
            )
        orbit, tangent = found
        scaled = outward / self.size(guess)
        return orbit, tangent if float(tangent @ scaled) >= 0.0 else -tangent

    def deviation(self, point: Real) -> Real:
        """States at the shooting phases from rest, (k · 2n,)."""
        return point[:-1] - np.tile(self.origin, self.problem.segments)

    def size(self, point: Real) -> float:
        """Unit of the states."""
        return float(np.linalg.norm(self.deviation(point))) or 1.0

    def next(self, here: Orbit, tangent: Real, step: float) -> tuple[Orbit, Real, float] | None:
        """Orbit a step along the tangent, the tangent there, and the angle between the two."""
        unit = np.append(np.full(here.point.size - 1, self.size(here.point)), 1.0)
        guess = here.point + step * unit * tangent
        found = self.solve(guess, here.point, tangent, step)
        if found is None:
            return None
        orbit, along = found
        cosine = float(along @ tangent)
        along, cosine = (along, cosine) if cosine >= 0.0 else (-along, -cosine)
        turn = math.acos(min(cosine, 1.0))
        if turn > LONGEST_TURN:
            self.obstacle = "the family turns by more than a step can follow"
            return None
        return orbit, along, turn

    def amplitude(self, orbit: Orbit) -> float:
        """Largest displacement of an orbit from rest in m."""
        return farthest_from(self.rest_m, orbit)

    def at_end(self, here: Orbit, tangent: Real, step: float, amplitude: float) -> Orbit | None:
        """Orbit of an amplitude, which is passed within a step; None if there is none."""
        known: dict[float, Orbit] = {0.0: here}

        def beyond(share: float) -> float:
            if share:
                found = self.next(here, tangent, share * step)
                if found is None:
                    raise LocateError(self.obstacle)
                known[share] = found[0]
            return self.amplitude(known[share]) / amplitude - 1.0

        try:
            return known[root(beyond)[0]]
        except LocateError:
            return None

    def solve(
        self, guess: Real, reference: Real, tangent: Real, step: float
    ) -> tuple[Orbit, Real] | None:
        """Newton's method in least squares on the plane across a tangent; states in their unit."""
        problem, point = self.problem, guess.copy()
        unit = np.append(np.full(point.size - 1, self.size(reference)), 1.0)
        rate = np.zeros(point.size)
        rate[: self.origin.size] = self.rate(reference[: self.origin.size])
        rate /= np.linalg.norm(rate) or 1.0
        last = math.inf
        for _ in range(MOST_ITERATIONS):
            equations = self.shooting(point, unit)
            if equations is None:
                return None
            matrix, sides, jacobians = equations
            off = (point - reference) / unit
            rows = np.vstack([matrix, rate, tangent])
            sides = np.concatenate([sides, [-float(rate @ off), step - float(tangent @ off)]])
            change = np.linalg.lstsq(rows, sides, rcond=None)[0]
            point, last = point + unit * change, float(np.linalg.norm(change))
            if not last < 10.0:
                break
            if last < CLOSED:
                orbit = Orbit(problem, point, jacobians, last, self.observe)
                *_, right = np.linalg.svd(np.vstack([matrix, rate]))
                return orbit, right[-1]
        self.obstacle = f"Newton's method did not converge, last relative step {last:.1e}"
        return None

    def shooting(self, point: Real, unit: Real) -> tuple[Real, Real, Real] | None:
        """Matrix and right-hand side of the shooting equations in units, and the Jacobians."""
        problem, omega = self.problem, math.exp(point[-1])
        nodes = problem.nodes(point)
        found = self.flow.shoot(nodes, problem.phases, omega)
        if found.failure:
            self.obstacle = found.failure
            return None
        k, size = nodes.shape
        matrix = np.zeros((k * size, point.size))
        for s in range(k):
            rows, following = slice(s * size, (s + 1) * size), (s + 1) % k
            matrix[rows, rows] += found.jacobians[s]
            matrix[rows, following * size : (following + 1) * size] -= np.eye(size)
            matrix[rows, -1] = omega * found.d_omega[s] / unit[0]
        sides = (np.roll(nodes, -1, axis=0) - found.ends).ravel() / unit[0]
        return matrix, sides, found.jacobians

    def rate(self, state: Real) -> Real:
        """Rate of change of a state z (2n,)."""
        q, v = np.split(self.flow.to_modal(state), 2)
        force = force_at(self.flow.system, self.push, q)
        return self.flow.to_state(np.append(v, -force))

    def energy(self, orbit: Orbit) -> float:
        """Energy of an orbit in J, above that of rest."""
        q, v = np.split(self.flow.to_modal(orbit.point[: self.origin.size]), 2)
        system, push = self.flow.system, self.push
        kept = potential_at(system, push, q) - potential_at(system, push, self.rest)
        return kept + 0.5 * float(v @ v)
