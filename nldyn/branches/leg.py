"""A walk with the special points that lie on its way."""

from __future__ import annotations

import math
from bisect import bisect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from operator import attrgetter
from typing import Any

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES
from nldyn.bifurcations.beyond_rigid_grazing import (
    SLIGHT,
    SLIGHT_BY_DIFFERENCES,
    beyond_rigid_grazing,
    crosses_beside,
)
from nldyn.bifurcations.branch_crossing import NEIGHBOUR, distance, same_crossing, without_repeats
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.marks import marks_between
from nldyn.bifurcations.point import BranchNode, SpecialPoint, place_of
from nldyn.bifurcations.sliding import sliding_points_between
from nldyn.bifurcations.touching import grazes_exactly, rigid_grazing, rigid_touches
from nldyn.bifurcations.within_step import insert_dip, special_points_between
from nldyn.branches.arclength import Stepper, StepperState
from nldyn.branches.branch import Course, WalkEnd
from nldyn.branches.endings import Ending, StopReason
from nldyn.orbits.bordered import FREE, Solved, length_unit
from nldyn.orbits.conditions import Turning, grazing_beside
from nldyn.orbits.orbit import Orbit, same_orbit
from nldyn.system.chart import FREQUENCY, told_value

AT_FLIP = 1e-5  # distance of a turn of a doubled branch from its end that may be the flip itself
FLAT = 1e-4  # frequency part of tangents beside such a turn, below which it is
SHORTEST_DETOUR = 1e-6  # first step of a walk that looks closely at what lies within a step
MOST_DETOUR = 500  # points of such a walk
STRAIGHT = 1.1  # its length over that of the step, up to which it leads straight there
TOGETHER = 1e-9  # arclength between two special points that rounding may exchange
BEYOND = 0.25  # of the step: how far in ln ω one that searches the last may leave the range
LONG_SERIES = 10  # impacts before a grazing, each slower than the last, that many would follow
SHORT_SERIES = 3  # the same where the branch is followed no farther
SLOWEST = 1.2e-3  # depth over size of the last of them: those behind are hardly told apart
DETOUR_STEPS, DETOUR_GROWTH = 64.0, 8.0  # its first steps in the one it replaces, its longest


Progress = Callable[[Any], None]


@dataclass(frozen=True, eq=False)
class Leg:
    """What a walk in one direction has found, in its own order.

    Parameters
    ----------
    nodes, special_points, notes : list
        As in `Branch`.
    reason : StopReason
        Why the walk stopped.
    end : WalkEnd, optional
        How it would go on.
    """

    nodes: list[BranchNode]
    special_points: list[SpecialPoint]
    notes: list[str]
    reason: StopReason
    end: WalkEnd | None

    @classmethod
    def of(cls, first: BranchNode) -> Leg:
        """One that is to begin at a point."""
        return cls([first], [], [], Ending.NOT_FINISHED.told(), None)


@dataclass
class LegBuilder:
    """A walk with what is found on the way.

    Special points of a pair of neighbouring points are located as soon as the next point is known,
    since that may put another point between them.

    Parameters
    ----------
    walk : Stepper
        The walk.
    nodes, special_points, notes : list
        What was found before, if the walk goes on; of the pairs of nodes all but the last have
        been searched.
    """

    walk: Stepper
    nodes: list[BranchNode] = field(default_factory=list)
    special_points: list[SpecialPoint] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._piece = self._begin_of_piece()  # first node behind the last rigid grazing
        self._searched = max(len(self.nodes) - 2, self._piece)
        self._mark = self._here() if self.nodes else None

    @classmethod
    def going_on(cls, leg: Leg, course: Course) -> LegBuilder:
        """The same walk with the end of the range and the options of a course."""
        walk = Stepper(leg.nodes[0], course.limits, course.options, course.open_ends)
        end = leg.end
        if end is None:
            return cls(walk)
        here = leg.nodes[end.node]
        walk.stride = StepperState(here, end.step, end.behind, end.count)
        walk.visited = list(leg.nodes[: end.kept])
        return cls(
            walk,
            [*leg.nodes[: end.kept], here],
            leg.special_points[: end.special_points],
            leg.notes[: end.notes],
        )

    def follow(
        self,
        progress: Progress | None = None,
        keep: Callable[[], None] | None = None,
    ) -> Leg:
        """Walk to the end.

        Parameters
        ----------
        progress : callable, optional
            Called with the parameter's value at every point, of several with all of them.
        keep : callable, optional
            Called after every point, when `so_far` tells of it.
        """
        while True:
            try:
                self._follow(progress, keep)
                if not self._passes_grazing():
                    break
            except FAILURES as error:
                place = place_of(self.nodes[-1], 9)
                self.walk.stop_reason = Ending.FAILS.told(place=place, obstacle=error)
                break
            if progress is not None:
                progress(_told(self.nodes[-1]))
        ending = self.walk.stop_reason.ending
        if ending is Ending.COMES_BACK:
            self.notes.append(self.walk.stop_reason)
        special = self.special_points
        if ending is Ending.JOINS:
            special = [s for s in special if not self._is_flip_at_end(s)]
        elif self.walk.stop_reason.closes:  # the last step leads beyond the start
            special = self._once_around()
            last = self.nodes.pop()  # a dip may have put others there
            self.nodes = [*(p for p in self.nodes if not self._is_repeated(p)), last]
        end = self._end(next(i for i, p in enumerate(self.nodes) if p is self._stride.here))
        notes = [*self.notes, *not_told_apart(special)]
        return Leg(self.nodes, special, notes, self.walk.stop_reason, end)

    def _follow(self, progress: Progress | None, keep: Callable[[], None] | None) -> None:
        """Walk until the walk ends, and search all that it has passed."""
        for point in self.walk:
            self.nodes.append(point)
            if progress is not None:
                progress(_told(point))
            if self._free and len(self.nodes) - self._piece > 2:
                insert_dip(self.nodes, len(self.nodes) - 2)
            regular = self.walk.stride is not None and self.walk.stride.here is point
            self._search(len(self.nodes) - 2, closely=regular)
            if regular:
                self._mark = self._here()
                if keep is not None:
                    keep()
        self._search(len(self.nodes) - 1, closely=False)

    def _passes_grazing(self) -> bool:
        """Whether the walk has ended where a rigid stop is grazed, and goes on behind that.

        Either way the grazing is a special point.
        """
        walk, last = self.walk, self.nodes[-1]
        if not self._free or walk.stop_reason.ending is not Ending.GRAZES_RIGID:
            return False
        grazing = _grazing_at_end(self.nodes)
        if self._piece and same_orbit(grazing.orbit, self.special_points[-1].orbit):
            walk.stop_reason = walk.too_short()
            return False
        self.special_points.append(grazing)
        if _nears_rest(grazing.orbit, last.orbit, LONG_SERIES):
            walk.stop_reason = self._to_rest()
            return False
        beyond = None
        if grazing.orbit is not last.orbit:
            beyond = beyond_rigid_grazing(grazing.point, last.orbit)
            slight = SLIGHT if last.family.is_exact else SLIGHT_BY_DIFFERENCES
            sides = [last.orbit] if beyond is None else [last.orbit, beyond.orbit]
            if any(crosses_beside(grazing.orbit, side, slight[-1]) for side in sides):
                self.notes.append(
                    f"special points near {grazing.place(8)} may be missing: "
                    "multipliers may cross the unit circle right beside the grazing"
                )
        if beyond is None:
            ends = _nears_rest(grazing.orbit, last.orbit, SHORT_SERIES)
            reason = Ending.GRAZES_RIGID.told(place=grazing.place(9))
            walk.stop_reason = self._to_rest() if ends else reason
            return False
        walk.begin_anew(beyond, beyond.arclength - grazing.point.arclength)
        self.nodes.append(beyond)
        self._piece = self._searched = len(self.nodes) - 1
        self._mark = self._here()
        return True

    def _to_rest(self) -> StopReason:
        limit = limit_of_grazings(self.special_points)
        parameter = self.nodes[0].parameter
        what = "frequencies" if parameter.name == FREQUENCY else f"values of {parameter.name}"
        return Ending.TO_REST.told(what=what, place=told_value(parameter, limit, digits=7))

    def _once_around(self) -> list[SpecialPoint]:
        """The special points of a closed branch, whose last step leads beyond the start.

        What lies there was told after the start. Of a branch point beside that rounding decides
        whether the first step or the last tells it, or both.
        """
        before = self._stride.here.arclength
        near = self.nodes[-1].arclength - before + NEIGHBOUR
        told: list[SpecialPoint] = []
        for special in self.special_points:
            beside = [s for s in told if s.point.arclength < near]
            if special.point.arclength > before and any(same_crossing(special, s) for s in beside):
                continue
            if special.kind == "BP" or not self._is_repeated(special.point):
                told.append(special)
        return told

    def so_far(self) -> Leg | None:
        """What was found up to the last complete point; None before the first."""
        if self._mark is None:
            return None
        kept, special, notes, stride = self._mark
        return Leg(
            [*self.nodes[:kept], stride.here],
            self.special_points[:special],
            self.notes[:notes],
            Ending.NOT_FINISHED.told(),
            self._end(kept),
        )

    def _begin_of_piece(self) -> int:
        """Number of the first node behind the last grazing of a rigid stop that was passed."""
        passed = [
            special.point.arclength
            for special in self.special_points
            if self._free and special.kind == "GR" and grazes_exactly(special.orbit)
        ]
        return bisect(self.nodes, passed[-1], key=attrgetter("arclength")) if passed else 0

    def _is_flip_at_end(self, special: SpecialPoint) -> bool:
        """Whether a turn of a doubled branch is where it joins the one that it comes from."""
        if special.kind not in ("BP", "LP"):
            return False
        if distance(self.nodes[-1], special.point) > AT_FLIP:
            return False
        after = bisect(self.nodes, special.point.arclength, key=attrgetter("arclength"))
        beside = self.nodes[max(after - 1, 0) : after + 1]
        return special.kind == "BP" or min(abs(float(p.tangent[-1])) for p in beside) < FLAT

    def _is_repeated(self, point: BranchNode) -> bool:
        """Whether a point of a closed branch lies where the walk has begun again."""
        here = self._stride.here
        return point.arclength > here.arclength and self.walk.closes(here, point)

    @property
    def _free(self) -> bool:
        """Whether the orbits meet no condition, as those of a curve do."""
        return self.walk.start.condition is FREE

    @property
    def _stride(self) -> StepperState:
        assert self.walk.stride is not None
        return self.walk.stride

    def _here(self) -> tuple[int, int, int, StepperState]:
        """How much will stay as it is, whatever follows."""
        return len(self.nodes) - 1, len(self.special_points), len(self.notes), self._stride

    def _end(self, node: int) -> WalkEnd | None:
        if self._mark is None:
            return None
        kept, special, notes, stride = self._mark
        return WalkEnd(stride.step, stride.behind, stride.count, node, kept, special, notes)

    def _walk_closely(self) -> bool:
        """Put the points of a walk with shorter steps into the step searched, if it led on.

        A narrow resonance may lie within one step: the branch leaves at its foot and comes back
        beside it. What lies behind is moved by the length of the detour.
        """
        a, b = self.nodes[self._searched : self._searched + 2]
        between = _detour(a, b, self.walk, self.walk.limits)
        if between is None:
            return False
        longer = _arclength_behind(between, b) - b.arclength
        behind = self.nodes[self._searched + 1 :]
        moved = [replace(p, arclength=p.arclength + longer) for p in behind]
        self.nodes[self._searched + 1 :] = [*between, *moved]
        self.walk.stride = replace(self._stride, here=moved[-1])
        return True

    def _search(self, pairs: int, closely: bool = True) -> None:
        """Locate the special points of the first pairs of nodes, as far as that is not done.

        Where that fails, the step is walked again with shorter ones, whose points are kept; not at
        the end of the walk, whose last steps a longer one does anew.
        """
        known = len(self.special_points)
        ahead = len(self.nodes) - pairs  # nodes that stay beyond those searched
        while self._searched < len(self.nodes) - ahead:
            a, b = self.nodes[self._searched : self._searched + 2]
            if not b.point[:-1].any():  # rest, of which the others are multiples
                break
            before = self.nodes[self._searched - 1] if self._searched > self._piece else None
            after = next(iter(self.nodes[self._searched + 2 :]), None)
            if not self._free:
                found, lost = marks_between(a, b)
                self.special_points += found
                self.notes += lost
                self._searched += 1
                continue
            try:
                self.special_points += special_points_between(a, b, before, after)
            except FAILURES as error:
                if closely and self._walk_closely():
                    continue
                found, lost = _by_halves(a, b, error)
                every = self._along_straight_way(a, b) if lost and not closely else None
                if every is not None:
                    found, lost = every, []
                self.special_points += found
                self.notes += lost
            self._add_sliding(a, b)
            self._searched += 1
        if self._free and len(self.special_points) > known:
            self.special_points = without_repeats(self.special_points)

    def _add_sliding(self, a: BranchNode, b: BranchNode) -> None:
        """Add where a motion begins or ceases to stick between two points, the last searched."""
        found, lost = sliding_points_between(a, b)
        self.notes += lost
        if found:
            first = bisect(self.special_points, a.arclength, key=_length)
            found += self.special_points[first:]
            self.special_points[first:] = sorted(found, key=_length)

    def _along_straight_way(self, a: BranchNode, b: BranchNode) -> list[SpecialPoint] | None:
        """All special points on a walk with shorter steps, if it leads from a to b straight.

        To know b again it must pass it, also at the end of the range. None if any may be missing.
        """
        step, chart = b.arclength - a.arclength, a.family.charts[0]
        low, high = map(chart.coordinate, self.walk.limits)
        beyond = chart.value(low - BEYOND * step), chart.value(high + BEYOND * step)
        between = _detour(a, b, self.walk, beyond)
        if between is None:
            return None
        longer = (_arclength_behind(between, b) - a.arclength) / step
        if longer > STRAIGHT:
            return None
        lengths = (a.arclength + (p.arclength - a.arclength) / longer for p in between)
        way = [replace(p, arclength=x) for p, x in zip(between, lengths, strict=True)]
        found, lost = _in_pieces([a, *way, b])
        return None if lost else found


def _length(special: SpecialPoint) -> float:
    return special.point.arclength


def _told(node: BranchNode) -> float | Real:
    """The parameter's value at a point, or the values of several; of a frequency found none."""
    alone = len(node.family.charts) == 1 or isinstance(node.condition, Turning)
    return node.value if alone else node.values


def _grazing_at_end(nodes: Sequence[BranchNode]) -> SpecialPoint:
    """The grazing of a rigid stop at which a walk has ended, solved by its defining system.

    Where that fails it is the last point, with what is left of the way to the grazing.
    """
    last = nodes[-1]
    met = grazing_beside(last)
    if met is not None:
        exact = Solved(last.family, met.point, met.orbit)
        length = last.arclength + distance(exact, last)
        return SpecialPoint("GR", BranchNode.of(exact, last.tangent, length), met.orbit.error)
    error = last.orbit.error
    here = rigid_grazing(last.orbit)
    before = rigid_grazing(nodes[-2].orbit) if len(nodes) > 1 else None
    if here and before and before[2] != here[2]:
        way = float(last.point[-1] - nodes[-2].point[-1])
        error += abs(way * here[2] / (before[2] - here[2]))
    return SpecialPoint("GR", last, error)


def _nears_rest(at: Orbit, before: Orbit, count: int) -> bool:
    """Whether a slight impact begins behind some ever slower ones, of which more would follow."""
    grazed, here = rigid_grazing(at), rigid_grazing(before)
    if grazed is None or here is None or here[2] > 0.0:
        return False
    found = sorted(each[1:] for each in rigid_touches(at) if each[0] == grazed[0])
    place = found.index(grazed[1:])
    depths = [depth for _, depth in [*found, *found][: place + len(found)][-count:]]
    slowest = SLOWEST * length_unit(at)
    return 0.0 < depths[-1] < slowest and depths == sorted(depths, reverse=True)


def limit_of_grazings(found: Sequence[SpecialPoint]) -> float:
    """Value to which grazings tend at distances of a geometric series, or the last one.

    So do those of impacts that come to rest (Budd and Dux 1994, *Phil. Trans. R. Soc. Lond. A* 347,
    365-389).
    """
    *_, first, middle, last = [math.nan] * 3 + [s.value for s in found if s.kind == "GR"]
    ratio = (last - middle) / (middle - first) if middle != first else math.nan
    return last + (last - middle) * ratio / (1.0 - ratio) if 0.0 < ratio < 1.0 else last


def not_told_apart(found: Sequence[SpecialPoint]) -> list[str]:
    """Notes on special points as close together as orbits are exact, if branches cross there.

    A fold beside a grazing point is told from it at any distance, but not three of them or more.
    """
    groups: list[list[SpecialPoint]] = []
    for special in found:
        place = special.point.arclength
        if groups and abs(place - groups[-1][-1].point.arclength) < TOGETHER:
            groups[-1].append(special)
        else:
            groups.append([special])
    return [
        f"{', '.join(s.kind for s in group)} near {group[0].place(8)} lie so close "
        "together that neither their order nor their kinds are sure"
        for group in groups
        if len(group) > 2 or (len(group) == 2 and "BP" in [s.kind for s in group])
    ]


def _detour(
    a: BranchNode, b: BranchNode, walk: Stepper, limits: tuple[float, float]
) -> list[BranchNode] | None:
    """Points of a walk with shorter steps from a that passes b in its direction, or None."""
    first_step = (b.arclength - a.arclength) / DETOUR_STEPS
    if first_step < max(SHORTEST_DETOUR, walk.options.min_step):
        return None
    options = replace(
        walk.options,
        first_step=first_step,
        max_step=DETOUR_GROWTH * first_step,
        max_points=MOST_DETOUR,
    )
    inner = Stepper(a, limits, options, b.point[None])
    between = list(inner)[1:-1]
    if inner.stop_reason.ending is not Ending.MEETS_OPEN_END or not between:
        return None
    last = between[-1]
    ahead = float((b.point - last.point) @ (last.weights * b.tangent))
    return between if ahead > 0.0 else None


def _arclength_behind(way: Sequence[BranchNode], b: BranchNode) -> float:
    """Arclength of a point that is met behind a way."""
    last = way[-1]
    return last.arclength + distance(last, b)


def _by_halves(
    a: BranchNode, b: BranchNode, reason: Exception, depth: int = 0
) -> tuple[list[SpecialPoint], list[str]]:
    """Special points of a chord on which a correction failed: try again on its halves.

    With notes on the pieces where it failed again.
    """
    try:
        if depth > 3:
            raise reason
        middle = Chord(a, b).at(0.5)
    except FAILURES as error:
        place = told_value(a.parameter, *sorted((a.value, b.value)), digits=8)
        where = "between" if " and " in place else "near"
        return [], [f"special points {where} {place} may be missing: {error}"]
    return _in_pieces([a, middle, b], depth + 1)


def _in_pieces(
    points: Sequence[BranchNode], depth: int = 0
) -> tuple[list[SpecialPoint], list[str]]:
    """Special points between some points of a branch, with notes on what could not be searched."""
    found: list[SpecialPoint] = []
    notes: list[str] = []
    for a, b in pairwise(points):
        try:
            found += special_points_between(a, b)
        except FAILURES as error:
            more, lost = _by_halves(a, b, error, depth)
            found += more
            notes += lost
    return found, notes
