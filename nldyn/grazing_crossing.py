"""A branch point beside a grazing point, so close that planes across the branch do not part them.

On such a plane Newton's method may find an orbit of either branch. So the orbits between are sought
by the depth of the extreme that grazes, their component along the null vector held. Where a stop is
touched sharply, multipliers are smooth functions of the root of that depth.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from nldyn._events import branch_point_test
from nldyn.bordered import length_unit
from nldyn.branch import BranchPoint, SpecialPoint
from nldyn.conditions import Grazing
from nldyn.critical import correct_across
from nldyn.linear import Real
from nldyn.orbit import ConvergenceError, Orbit
from nldyn.special import (
    BEND,
    Chord,
    LocateError,
    Touch,
    accounted,
    changed,
    root,
    touches_sharply,
    touching_extremes,
)

MET = 1e-13  # of an orbit's size: how well a depth is met
ROUNDED = 1e-11  # the same where rounding forbids more
MOST_STEPS = 8
UNFOLDED = 1e-10  # what must be added to an orbit's equations, relative to it, if that is rounding


@dataclass(frozen=True)
class ByDepth:
    """The orbits of a short piece of a branch by the depth of an extreme that becomes zero there.

    Parameters
    ----------
    chord : Chord
        The piece.
    touch : Touch
        The extreme.
    """

    chord: Chord
    touch: Touch
    _known: dict[float, Orbit] = field(default_factory=dict, init=False, repr=False)

    @property
    def ends(self) -> tuple[float, float]:
        """Signed roots of the depths at the ends of the chord."""
        first, last = (self.touch.depth(end) for end in (self.chord.first, self.chord.last))
        return _signed_root(first), _signed_root(last)

    def at(self, signed_root: float) -> Orbit:
        """The orbit of the branch whose extreme has a depth, given by its signed root.

        Raises
        ------
        LocateError
            If none is found, or the branch does not lead from one end of the chord to the other.
        """
        depth = signed_root * abs(signed_root)
        for start in self._guesses(depth):
            orbit = self._with_depth(depth, start)
            if orbit is not None:
                self._known[depth] = orbit
                return orbit
        raise LocateError("no orbit with a given depth was found")

    def _guesses(self, depth: float) -> Iterator[Real]:
        """Points near the orbit sought: on the chord, then the orbits found, the nearest first."""
        first, last = (s * abs(s) for s in self.ends)
        yield self.chord.between((depth - first) / (last - first))
        for _, orbit in sorted(self._known.items(), key=lambda known: abs(known[0] - depth)):
            yield orbit.point

    def _with_depth(self, depth: float, point: Real) -> Orbit | None:
        """The orbit with a depth, by Newton's method from a point."""
        a = self.chord.first.orbit
        touch, row = self.touch, self.chord.row
        grazing = Grazing(touch.output, touch.is_maximum, touch.phase, length_unit(a))
        offset, miss = float(row @ point), math.inf
        for _ in range(MOST_STEPS):
            found = correct_across(a.problem, point, row, offset)
            if found is None or found[2] > UNFOLDED:
                return None
            orbit, before = Orbit(a.problem, *found, a.observe), miss
            phase, reached = grazing.extreme(orbit)
            miss = abs(reached - depth) / grazing.unit
            if miss < MET or 0.5 * before < miss < ROUNDED:
                return orbit
            point, row = orbit.point, grazing.slope(orbit, phase)
            offset = float(row @ point) + depth - reached
        return None


def crossing_at_grazing(a: BranchPoint, b: BranchPoint) -> list[SpecialPoint]:
    """The grazing point and the branch point of a short step of a branch, in order.

    Empty if the step has not these two, or others as well, or is long.
    """
    touches = touching_extremes(a.orbit, b.orbit)
    if not (touches and touches_sharply(a.orbit.system) and changed(a, b) == ["BP"]):
        return []
    if abs(b.arclength - a.arclength) > BEND:
        return []
    chord = Chord(a, b)
    orbits = ByDepth(chord, touches[0])
    first, last = orbits.ends
    try:
        share, _ = root(
            lambda x: branch_point_test(orbits.at(first + x * (last - first)).multipliers)
        )
        crossing = orbits.at(first + share * (last - first))
        grazing = orbits.at(0.0)
    except (LocateError, ConvergenceError):
        return []
    found = [_special("BP", crossing, chord), _special("GR", grazing, chord)]
    if share > first / (first - last):
        found.reverse()
    return found if accounted(a.orbit, found, b.orbit) else []


def _signed_root(depth: float) -> float:
    return math.copysign(math.sqrt(abs(depth)), depth)


def _special(kind: str, orbit: Orbit, chord: Chord) -> SpecialPoint:
    """A special point of a branch, with place and tangent of its chord."""
    a, b = chord.first, chord.last
    sigma = chord.place(BranchPoint(orbit, a.tangent, a.arclength))
    arclength = a.arclength + sigma * (b.arclength - a.arclength)
    error = orbit.error + max(a.orbit.error, b.orbit.error)  # the ends' part along the null vector
    return SpecialPoint(kind, BranchPoint(orbit, chord.direction(sigma), arclength), error)
