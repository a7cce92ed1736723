"""A branch point beside a grazing point, so close that planes across the branch do not part them.

On such a plane Newton's method may find an orbit of either branch. So the orbits between are sought
by the depth of the extreme that grazes, their component along the null vector held. Where a stop is
touched sharply, multipliers are smooth functions of the root of that depth.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES, LocateError
from nldyn.bifurcations.branch_crossing import CROSSES, NEAR_CRITICAL, correct_across
from nldyn.bifurcations.chord import BEND, CROSSING_ERROR, Chord
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.bifurcations.roots import root
from nldyn.bifurcations.sign_changes import accounted, changed
from nldyn.bifurcations.touching import Touch, touches_sharply, touching_extremes
from nldyn.orbits.bordered import Place, length_unit
from nldyn.orbits.conditions import Grazing
from nldyn.orbits.critical_functions import branch_point_test

MET = 1e-13  # of an orbit's size: how well a depth is met
ROUNDED = 1e-11  # the same where rounding forbids more
MOST_STEPS = 8
BESIDE = 0.01  # part of a step by which an orbit of the branch may lie off its chord


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
    _known: dict[float, Place] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def ends(self) -> tuple[float, float]:
        """Signed roots of the depths at the ends of the chord."""
        first, last = (self.touch.depth(end) for end in (self.chord.first, self.chord.last))
        return _signed_root(first), _signed_root(last)

    def at(self, signed_root: float) -> Place:
        """The orbit of the branch whose extreme has a depth, given by its signed root.

        Raises
        ------
        LocateError
            If none is found beside the chord.
        """
        depth = signed_root * abs(signed_root)
        for start in self._guesses(depth):
            found = self._with_depth(depth, start)
            if found is not None:
                self._known[depth] = found
                return found
        raise LocateError("no orbit with a given depth was found")

    def _guesses(self, depth: float) -> Iterator[Real]:
        """Points near the orbit sought: on the chord, then the orbits known, the nearest first."""
        first, last = (s * abs(s) for s in self.ends)
        yield self.chord.between((depth - first) / (last - first))
        known: dict[float, Place] = self._known | {first: self.chord.first, last: self.chord.last}
        for _, place in sorted(known.items(), key=lambda pair: abs(pair[0] - depth)):
            yield place.point

    def _with_depth(self, depth: float, point: Real) -> Place | None:
        """The orbit with a depth, by Newton's method from a point, if it lies on this branch."""
        a, family = self.chord.first.orbit, self.chord.first.family
        touch, row = self.touch, self.chord.row
        grazing = Grazing(touch.output, touch.is_maximum, touch.phase, length_unit(a))
        offset, miss = float(row @ point), math.inf
        unsure = max(CROSSES, a.error, self.chord.last.orbit.error)  # of what leads to the guess
        for _ in range(MOST_STEPS):
            found = correct_across(family, point, row, offset)
            if found is None or found.orbit.error > CROSSING_ERROR:
                return None
            orbit, before = found.orbit, miss
            phase, reached = grazing.extreme(orbit)
            miss = abs(reached - depth) / grazing.unit
            if orbit.error <= unsure and (miss < MET or 0.5 * before < miss < ROUNDED):
                return found if self.chord.passes(found, BESIDE) else None
            point, row = found.point, grazing.slope(found, phase)
            offset = float(row @ point) + depth - reached
        return None


def special_points_at_grazing(a: BranchNode, b: BranchNode) -> list[SpecialPoint]:
    """The grazing point of a short step beside a branch point, and that point if it is within.

    In order. Empty if the step has none, or other points as well, or is longer than 1e-4.
    """
    touches = touching_extremes(a.orbit, b.orbit)
    alike = 0 < len(touches) == abs(a.orbit.impacts - b.orbit.impacts)  # begin or end together
    if not (alike and touches_sharply(a.orbit.system) and abs(b.arclength - a.arclength) < BEND):
        return []
    changes = changed(a, b)
    near_one = min(np.abs(end.orbit.multipliers - 1.0).min() for end in (a, b)) < NEAR_CRITICAL
    if changes != ["BP"] and (changes or not near_one):
        return []
    orbits = ByDepth(Chord(a, b), touches[0])
    first, last = orbits.ends
    try:
        found = [_special("GR", orbits.at(0.0), orbits.chord)]
        if changes:
            share, _ = root(
                lambda x: branch_point_test(orbits.at(first + x * (last - first)).orbit.multipliers)
            )
            crossing = orbits.at(first + share * (last - first))
            before = share < first / (first - last)
            found.insert(0 if before else 1, _special("BP", crossing, orbits.chord))
    except FAILURES:
        return []
    return found if accounted(a.orbit, found, b.orbit) else []


def _signed_root(depth: float) -> float:
    return math.copysign(math.sqrt(abs(depth)), depth)


def _special(kind: str, place: Place, chord: Chord) -> SpecialPoint:
    """A special point of a branch, with place and tangent of its chord."""
    ends = max(chord.first.orbit.error, chord.last.orbit.error)  # their part along the null vector
    return SpecialPoint(kind, chord.with_place(place), place.orbit.error + ends)
