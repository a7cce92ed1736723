"""Where a branch passes a value of its parameter: all of its orbits there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    LocateError,
    SystemModelError,
    check_frequency,
    failing_as,
    is_finite,
    shown,
)
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.on_curve import met_on_curve
from nldyn.bifurcations.point import BranchNode
from nldyn.bifurcations.roots import root
from nldyn.orbits.bordered import FREE, correct
from nldyn.orbits.orbit import Orbit, same_orbit, stroboscopic
from nldyn.system.chart import FREQUENCY, Chart, told_value, value_of

SAME = 4e-15  # difference of two coordinates (logarithms of a frequency) that is rounding
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
    def coordinates(self) -> Real:
        """Coordinates of the parameter, ln ω for the frequency."""
        return np.array([point.point[-1] for point in self.points])

    @cached_property
    def stroboscopic_states(self) -> Real:
        """States (places, n, 2n_modes) at the start of each excitation period."""
        return np.array([stroboscopic(point.orbit) for point in self.points])


def crossings(places: Places, value: float) -> list[BranchNode]:
    """Points of a branch at one value of its parameter, one for each passage, in order along it.

    A passage lies between two neighbours among the computed and the special points, so that on
    either side of a fold there may be one.

    Raises
    ------
    SystemModelError
        If the parameter cannot have this value.
    """
    chart = places.points[0].family.charts[0]
    check_value("frequency_hz" if chart.parameter.name == FREQUENCY else "value", chart, value)
    return _crossings(places, value)[0]


def passes(places: Places, orbit: Orbit) -> bool:
    """Whether a branch passes through an orbit of its period (up to a shift by whole periods).

    The branch is solved for only where its chord comes near the orbit.
    """
    family = places.points[0].family
    if places.points[0].condition is not FREE:
        value = value_of(orbit.system, orbit.frequency_hz, family.charts[0].parameter)
        return any(same_orbit(p.orbit, orbit) for p in met_on_curve(places.points, 0, value))
    p = float(family.unknowns(orbit)[-1])
    if not family.holds(orbit):
        return False
    on, passed = _passages(places, p)
    if any(same_orbit(places.points[i].orbit, orbit) for i in on):
        return True
    for i in passed[_chords_beside(places, passed, orbit, p)]:
        try:
            found = _crossing(places.points[i], places.points[i + 1], p)
        except LocateError:
            continue
        if same_orbit(found.orbit, orbit):
            return True
    return False


def _chords_beside(
    places: Places, first: NDArray[np.intp], orbit: Orbit, p: float
) -> NDArray[np.bool_]:
    """Which chords, given by the number of their first point, come near an orbit."""
    level = places.coordinates - p
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
    """Points of a branch at some values of its parameter, in order along it.

    With notes on passages whose orbit was not found.
    """
    points: list[BranchNode] = []
    notes: list[str] = []
    for value in at:
        found, lost = _crossings(places, value)
        points += found
        notes += lost
    return sorted(points, key=_arclength), notes


def check_requested(at: Sequence[float], chart: Chart) -> tuple[float, ...]:
    """The requested values, or a SystemModelError if one of them is outside of the range."""
    name = chart.parameter.name
    name = "frequencies" if name == FREQUENCY else f"values of {name}"
    try:
        wanted = tuple(at)
    except TypeError:
        raise SystemModelError(f"at must be a list of {name}, got {shown(at)}") from None
    for value in wanted:
        check_value("at: each value", chart, value)
        if not chart.low <= value <= chart.high:
            place = told_value(chart.parameter, value)
            raise SystemModelError(
                f"at: {place} lies outside {chart.range_name} = ({chart.low:g}, {chart.high:g})"
            )
    return tuple(float(value) for value in wanted)


def check_value(name: str, chart: Chart, value: float) -> None:
    """Refuse what is no value that a parameter can be followed to."""
    if chart.parameter.name == FREQUENCY:
        check_frequency(name.replace("value", "frequency"), value)
    elif not is_finite(value) or (chart.logarithmic and value <= 0.0):
        positive = "positive and " if chart.logarithmic else ""
        raise SystemModelError(f"{name} must be {positive}finite, got {shown(value)}")


def _arclength(point: BranchNode) -> float:
    return point.arclength


def _crossings(places: Places, value: float) -> tuple[list[BranchNode], list[str]]:
    chart = places.points[0].family.charts[0]
    if places.points[0].condition is not FREE:
        return list(met_on_curve(places.points, 0, value)), []
    p = chart.coordinate(value)
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
            place = told_value(chart.parameter, value, digits=8)
            lost.append(f"the orbit of the branch at {place} is missing: {error}")
    return found, lost


def _passages(places: Places, p: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Numbers of the places at a coordinate p, and of those between which and the next it lies."""
    level = places.coordinates - p
    on = np.abs(level) <= SAME
    passed = (level[:-1] * level[1:] < 0.0) & ~on[:-1] & ~on[1:]
    return np.flatnonzero(on), np.flatnonzero(passed)


@failing_as(LocateError)
def _crossing(a: BranchNode, b: BranchNode, p: float) -> BranchNode:
    """Point between two neighbours at a coordinate p.

    Beside a fold Newton's method at a fixed value may miss; then the point is first located
    along the branch. Very near to the end of a doubled branch it misses from there too, as rounding
    makes its steps; then the point located is the answer, whose coordinate is p to 1e-12.

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
        sigma, _ = root(lambda x: float(chord.at(x).point[-1]) - p)
        point = chord.at(sigma)
        try:
            return _held(chord, sigma, point.point, p)
        except LocateError:
            if abs(float(point.point[-1]) - p) > NEARLY_SAME:
                raise
            return point


def _held(chord: Chord, sigma: float, guess: Real, p: float) -> BranchNode:
    """Point of the branch at a fixed coordinate, near a guess at σ of a chord."""
    a, b = chord.first, chord.last
    start = np.append(guess[:-1], p)
    row = np.zeros(start.size)
    row[-1] = 1.0
    found = correct(a.family, start, FREE, row)
    if not found.converged:
        raise LocateError(found.failure)
    secant = b.point - a.point
    weights = a.weights
    off = found.point - start
    if float(off @ (weights * off)) > LEFT * float(secant @ (weights * secant)):
        raise LocateError("Newton's method left the branch")
    length = a.arclength + sigma * (b.arclength - a.arclength)
    return BranchNode.of(found, found.tangent(secant), length)
