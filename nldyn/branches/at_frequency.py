"""Where a branch passes a frequency: all of its orbits there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from nldyn.base.arrays import Real
from nldyn.base.errors import LocateError, SystemModelError, check_frequency, failing_as, shown
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.point import BranchNode
from nldyn.bifurcations.roots import root
from nldyn.orbits.orbit import Orbit, same_orbit, stroboscopic

SAME = 4e-15  # difference of two logarithms of a frequency that is rounding
NEARLY_SAME = 1e-12  # the same, of an orbit solved for and not held there
BESIDE = 2.0  # an orbit further from a chord, in its lengths, is not on the branch between its ends
SAME_STATE = 1e-5  # of its size: distance of states that are one
LEFT = 0.0625  # squared distance, over that of the neighbours, of an orbit of another branch


@dataclass(frozen=True, eq=False)
class Places:
    """Points and special points of a branch together, in order along it.

    Parameters
    ----------
    points : tuple of BranchNode
        In this order.
    """

    points: tuple[BranchNode, ...]

    @cached_property
    def log_frequencies(self) -> Real:
        """Logarithms of ω (rad/s)."""
        return np.array([point.orbit.point[-1] for point in self.points])

    @cached_property
    def stroboscopic_states(self) -> Real:
        """States (places, n, 2n_modes) at the start of each excitation period."""
        return np.array([stroboscopic(point.orbit) for point in self.points])


def crossings(places: Places, frequency_hz: float) -> list[BranchNode]:
    """Points of a branch at one frequency, one for each passage, in order along the branch.

    A passage lies between two neighbours among the computed and the special points, so that on
    either side of a fold there may be one.

    Raises
    ------
    SystemModelError
        If the frequency is not a positive number.
    """
    return _crossings(places, frequency_hz)[0]


def passes(places: Places, orbit: Orbit) -> bool:
    """Whether a branch passes through an orbit of its period (up to a shift by whole periods).

    The branch is solved for only where its chord comes near the orbit.
    """
    p = float(orbit.point[-1])
    on, passed = _passages(places, p)
    if any(same_orbit(places.points[i].orbit, orbit) for i in on):
        return True
    for i in passed[_chords_beside(places, passed, orbit)]:
        try:
            found = _crossing(places.points[i], places.points[i + 1], p)
        except LocateError:
            continue
        if same_orbit(found.orbit, orbit):
            return True
    return False


def _chords_beside(places: Places, first: NDArray[np.intp], orbit: Orbit) -> NDArray[np.bool_]:
    """Which chords, given by the number of their first point, come near an orbit."""
    level = places.log_frequencies - orbit.point[-1]
    states, target = places.stroboscopic_states, stroboscopic(orbit)
    share = level[first] / (level[first] - level[first + 1])
    chords = states[first + 1] - states[first]
    line = states[first] + share[:, None, None] * chords
    twice, n = np.concatenate([target, target]), orbit.period
    away = [np.linalg.norm(line - twice[shift : shift + n], axis=(1, 2)) for shift in range(n)]
    lengths = np.linalg.norm(chords, axis=(1, 2))
    near: NDArray[np.bool_] = np.min(away, axis=0) <= BESIDE * lengths + SAME_STATE * float(
        np.linalg.norm(target)
    )
    return near


def requested(places: Places, at: Sequence[float]) -> tuple[list[BranchNode], list[str]]:
    """Points of a branch at some frequencies, in order along it.

    With notes on passages whose orbit was not found.
    """
    points: list[BranchNode] = []
    notes: list[str] = []
    for frequency in at:
        found, lost = _crossings(places, frequency)
        points += found
        notes += lost
    return sorted(points, key=_arclength), notes


def check_requested(at: Sequence[float], range_hz: tuple[float, float]) -> tuple[float, ...]:
    """The requested frequencies, or a SystemModelError if one of them is outside of the range."""
    try:
        wanted = tuple(at)
    except TypeError:
        raise SystemModelError(f"at must be a list of frequencies, got {shown(at)}") from None
    low, high = range_hz
    for frequency in wanted:
        check_frequency("at: each frequency", frequency)
        if not low <= frequency <= high:
            raise SystemModelError(
                f"at: {frequency:g} Hz lies outside range_hz = ({low:g}, {high:g})"
            )
    return tuple(float(frequency) for frequency in wanted)


def _arclength(point: BranchNode) -> float:
    return point.arclength


def _crossings(places: Places, frequency_hz: float) -> tuple[list[BranchNode], list[str]]:
    check_frequency("frequency_hz", frequency_hz)
    p = math.log(2.0 * math.pi * frequency_hz)
    on, passed = _passages(places, p)
    points, exact = places.points, set(on.tolist())
    found: list[BranchNode] = []
    lost: list[str] = []
    for i in np.sort(np.append(on, passed)):
        if i in exact:
            found.append(points[i])
            continue
        try:
            found.append(_crossing(points[i], points[i + 1], p))
        except LocateError as error:
            lost.append(f"the orbit of the branch at {frequency_hz:.8g} Hz is missing: {error}")
    return found, lost


def _passages(places: Places, p: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Numbers of the places at ln ω = p, and of those between which and the next one it lies."""
    level = places.log_frequencies - p
    on = np.abs(level) <= SAME
    passed = (level[:-1] * level[1:] < 0.0) & ~on[:-1] & ~on[1:]
    return np.flatnonzero(on), np.flatnonzero(passed)


def _log_frequency(point: BranchNode) -> float:
    return float(point.orbit.point[-1])


@failing_as(LocateError)
def _crossing(a: BranchNode, b: BranchNode, p: float) -> BranchNode:
    """Point between two neighbours with ln ω = p.

    Beside a fold Newton's method at a fixed frequency may miss; then the point is first located
    along the branch. Very near to the end of a doubled branch it misses from there too, as rounding
    makes its steps; then the point located is the answer, whose ln ω is p to 1e-12.

    Raises
    ------
    LocateError
        If no such orbit is found.
    """
    chord = Chord(a, b)
    sigma = float(brentq(lambda x: chord.between(x)[-1] - p, 0.0, 1.0))
    try:
        return _held(chord, sigma, chord.between(sigma), p)
    except LocateError:
        sigma, _ = root(lambda x: _log_frequency(chord.at(x)) - p)
        point = chord.at(sigma)
        try:
            return _held(chord, sigma, point.orbit.point, p)
        except LocateError:
            if abs(_log_frequency(point) - p) > NEARLY_SAME:
                raise
            return point


def _held(chord: Chord, sigma: float, guess: Real, p: float) -> BranchNode:
    """Point of the branch at a fixed frequency, near a guess at σ of a chord."""
    a, b = chord.first, chord.last
    problem = a.orbit.problem
    start = np.append(guess[:-1], p)
    row = np.zeros(start.size)
    row[-1] = 1.0
    found = problem.correct(start, row)
    if not found.converged:
        raise LocateError(found.failure)
    secant = b.orbit.point - a.orbit.point
    weights = problem.metric(a.orbit.point)
    off = found.point - start
    if float(off @ (weights * off)) > LEFT * float(secant @ (weights * secant)):
        raise LocateError("Newton's method left the branch")
    length = a.arclength + sigma * (b.arclength - a.arclength)
    orbit = Orbit.of(problem, found, a.orbit.observe)
    return BranchNode(orbit, problem.tangent(found, secant), length)
