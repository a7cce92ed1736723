"""Sliding bifurcations: where along a branch a motion begins or ceases to stick.

On one side of such a point a motion has a time of sticking, or of sliding between two of these,
that it has not on the other side: it takes no time at the point itself. As it does so the phases
of a motion change smoothly, so that the parameter is a power series of that time t. It begins with
t where what slides turns and the force that would hold it passes its friction (crossing-sliding),
and with t² where the speed of sliding touches zero (grazing-sliding) or, as it sticks, the force
that holds it touches its friction (adding-sliding): that force, or speed, is a parabola there.

M. di Bernardo, C. J. Budd, A. R. Champneys, P. Kowalczyk (2008), *Piecewise-smooth Dynamical
Systems*, ch. 8; Yu. A. Kuznetsov, S. Rinaldi, A. Gragnani (2003), *Int. J. Bifurcation Chaos* 13,
2157-2188. Their "sliding" on a surface of discontinuity is sticking here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np

from nldyn.base.errors import FAILURES, LocateError
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.kinds import ADDING_SLIDING, CROSSING_SLIDING, GRAZING_SLIDING
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.flow.stretches import OPEN, STUCK, Stretch, stretches, without
from nldyn.orbits.orbit import Orbit
from nldyn.system.chart import told_value
from nldyn.system.naming import slider_name
from nldyn.system.system import System

BRIEF = 1e-5  # rad: a stretch that counts as none, as rounding may make it or leave it out
POWERS = {CROSSING_SLIDING: 1, GRAZING_SLIDING: 2, ADDING_SLIDING: 2}  # of time, see above
MOST_SHORT = 8  # stretches of which some may be what begins
MOST_BORN = 4  # stretches that begin at once: a symmetric motion has two, four from sticking alone
TOGETHER = 1e-3  # relative difference of the times of such
SHORT, SHRUNK = 1e-3, 0.2  # times, in rad and of the first one, that are on the way to none
DEEPEST = 12  # times that a step is halved
MOST_TRIALS = 16  # orbits by which a point is found
CLOSER = 0.4  # of the time of what is born: that of the next orbit
ENOUGH = 4  # of these at least
LONGEST_SERIES = 6  # powers of the time by which the point is told
PRECISION = 1e-9  # of the step: how far another power moves it, at which it is found,
ROUNDED = 1e-10  # and in arclength where the step is short,
LOOSE = 1e-5  # the same where it is as good as can be,
CLOSE = 1e-9  # or how near to each other orbits on both sides are
SHORTEST_STEP = 1e-6  # arclength of a step in which there may be no orbits between
SAME_PLACE = 1e-8  # arclength within which contacts that are alike begin to stick at once
BESIDE = (0.0, 0.01, -0.01, 0.1, -0.1, 1.0, -1.0)  # of that: where its orbit is if none is there
NEARLY_CLOSE = 1e-8  # the same where there are none between
NUDGES = (0.0, 0.1, -0.1, 0.3, 1.0)  # of a way: where else orbits are looked for


@lru_cache(maxsize=16)  # of a step both ends are asked for, by all that look into it
def words(orbit: Orbit) -> tuple[tuple[Stretch, ...], ...]:
    """Stretches of each of `System.rubbing` in a period, without those that are rounding."""
    motion = orbit.trajectory
    return tuple(_clear(stretches(motion, k)) for k in range(len(orbit.system.rubbing)))


def _clear(word: Sequence[Stretch]) -> tuple[Stretch, ...]:
    """Stretches without those that count as none."""
    return tuple(without(word, [i for i, each in enumerate(word) if each.length < BRIEF]))


def sticks(word: Sequence[Stretch]) -> int:
    """How often something comes to rest and leaves it in a period, -1 if it rests all the time."""
    if [each.mode for each in word] == [STUCK]:
        return -1
    return sum(each.mode == STUCK for each in word)


@lru_cache(maxsize=4)
def watched(system: System) -> tuple[int, ...]:
    """Numbers of those of `System.rubbing` whose sticking makes special points.

    Not of the points of areas: there they are those of the quadrature.
    """
    of_areas = {place for places in system.areas.values() for place in places}
    return tuple(k for k, each in enumerate(system.rubbing) if each.stop not in of_areas)


@dataclass(frozen=True)
class Birth:
    """What begins between two motions: a kind, and the stretches of the one that has them.

    Parameters
    ----------
    kind : str
        That of the special point.
    stretches : tuple of Stretch
        They are the shortest ones: what is left without them are those of the other motion.
    """

    kind: str
    stretches: tuple[Stretch, ...]

    @property
    def time(self) -> float:
        """Mean of their lengths, in rad."""
        return float(np.mean([each.length for each in self.stretches]))

    @property
    def at_once(self) -> bool:
        """Whether they take equal times, as by a symmetry."""
        times = [each.length for each in self.stretches]
        return max(times) - min(times) <= TOGETHER * max(times)


def born(bare: Sequence[Stretch], rich: Sequence[Stretch]) -> Birth | None:
    """What some stretches have beside others: those without which they are most like these.

    None if the words differ otherwise, or by several kinds.

    Examples
    --------
    >>> turns = [Stretch(1, 0.0, 3.0), Stretch(-1, 3.0, 3.3)]
    >>> rests = [Stretch(1, 0.0, 3.0), Stretch(0, 3.0, 0.1), Stretch(-1, 3.1, 3.2)]
    >>> born(turns, rests)
    Birth(kind='CS', stretches=(Stretch(mode=0, phase=3.0, length=0.1),))
    """
    shortest = sorted(range(len(rich)), key=lambda i: rich[i].length)[:MOST_SHORT]
    most = min(MOST_BORN, len(rich) - 1)
    choices = [some for count in range(1, most + 1) for some in combinations(shortest, count)]
    differences = [_difference(without(rich, some), bare) for some in choices]
    least = min(differences, default=math.inf)
    if least == math.inf:
        return None
    some = choices[differences.index(least)]
    kinds = {_kind_of(rich, i) for i in some}
    kind = kinds.pop()
    return None if kinds or not kind else Birth(kind, tuple(rich[i] for i in some))


def _difference(a: Sequence[Stretch], b: Sequence[Stretch]) -> float:
    """Largest difference of the lengths of like modes, whatever these are counted from."""
    if len(a) != len(b):
        return math.inf
    modes, lengths = ([each.mode for each in b], [each.length for each in b])
    turns = [[*a[i:], *a[:i]] for i in range(len(a))]
    return min(
        (
            max(abs(each.length - length) for each, length in zip(turn, lengths, strict=True))
            for turn in turns
            if [each.mode for each in turn] == modes
        ),
        default=math.inf,
    )


def _kind_of(word: Sequence[Stretch], place: int) -> str:
    """What it is called where a stretch takes no time, by those beside it; empty without a name."""
    before, after = word[place - 1].mode, word[(place + 1) % len(word)].mode
    if word[place].mode != STUCK:
        return ADDING_SLIDING if before == after == STUCK else ""
    if before == after:
        return "" if before == OPEN else GRAZING_SLIDING
    return CROSSING_SLIDING


def sliding_points_between(a: BranchNode, b: BranchNode) -> tuple[list[SpecialPoint], list[str]]:
    """Sliding bifurcations between two neighbouring points, in order, and what may be missing."""
    if a.orbit.self_excited or not watched(a.orbit.system):
        return [], []
    here, there = words(a.orbit), words(b.orbit)
    found: list[SpecialPoint] = []
    notes: list[str] = []
    for number in watched(a.orbit.system):
        if sticks(here[number]) == sticks(there[number]):
            continue
        try:
            found += Between(Chord(a, b), number).points(0.0, 1.0)
        except FAILURES as error:
            within = _within(a, b, born(*sorted((here[number], there[number]), key=len)), number)
            if within is not None:
                found.append(within)
                continue
            place = told_value(a.parameter, 0.5 * (a.value + b.value), digits=8)
            name = slider_name(a.orbit.system, number)
            notes.append(f"{name}: it begins or ceases to stick near {place}: {error}")
    found.sort(key=lambda s: s.point.arclength, reverse=bool(b.arclength < a.arclength))
    return _at_once(found), notes


def _within(a: BranchNode, b: BranchNode, birth: Birth | None, number: int) -> SpecialPoint | None:
    """The end of a very short step that has what begins in it, where no orbits are between."""
    length = abs(b.arclength - a.arclength)
    if birth is None or length > SHORTEST_STEP or birth.time > 10.0 * SHORT:
        return None
    rich = max((a, b), key=lambda node: len(words(node.orbit)[number]))
    return SpecialPoint(birth.kind, rich, length + rich.orbit.error)


def _at_once(found: Sequence[SpecialPoint]) -> list[SpecialPoint]:
    """Special points in order, of several contacts that are alike one."""
    kept: list[SpecialPoint] = []
    for special in found:
        alike = [s for s in kept if s.kind == special.kind]
        if not alike or abs(special.point.arclength - alike[-1].point.arclength) > SAME_PLACE:
            kept.append(special)
    return kept


@dataclass(frozen=True)
class Between:
    """Where one of `System.rubbing` begins or ceases to stick on a chord.

    Parameters
    ----------
    chord : Chord
        The piece of the branch.
    number : int
        Which one.
    """

    chord: Chord
    number: int

    def points(self, low: float, high: float, depth: int = 0) -> list[SpecialPoint]:
        """The special points between two places on the chord, in order."""
        first, last = (self._at(sigma) for sigma in (low, high))
        if sticks(first) == sticks(last):
            return []
        bare, rich = (low, high) if len(first) < len(last) else (high, low)
        birth = born(*sorted((first, last), key=len))
        if birth is not None:
            special = self._located(bare, rich, birth.kind)
            if special is not None:
                return [special]
        if depth == DEEPEST:
            if self.chord.at(low).orbit.impacts != self.chord.at(high).orbit.impacts:
                return []  # what a contact brings with it
            raise LocateError("what begins there does not take less and less time towards it")
        middle = self._found(0.5 * (low + high), 0.5 * (high - low))
        return [*self.points(low, middle, depth + 1), *self.points(middle, high, depth + 1)]

    def _located(self, bare: float, rich: float, kind: str) -> SpecialPoint | None:
        """The point between two places of which one has what begins, None if it is not so.

        Orbits come closer to it from that side, and the power series of their places by the time
        of what begins is continued to none.
        """
        least, close = self._at(bare), max(PRECISION, ROUNDED / self.length)
        known: list[tuple[float, float]] = []
        limit, off, trial = bare, math.inf, rich
        for _ in range(MOST_TRIALS):
            time = self._time(trial, least, kind)
            if time > 0.0:
                known.append((time, trial))
            elif len(known) >= ENOUGH:  # slips as short as that are passed over
                break
            elif time < 0.0 or not known:
                return None
            else:
                bare = trial
            last, before = known[-1][1], limit
            limit = _continued(known[-LONGEST_SERIES:], POWERS[kind])
            off = abs(limit - before)
            if abs(last - bare) * self.length < CLOSE and known[-1][0] < SHORT:
                return self._special(kind, 0.5 * (last + bare), abs(last - bare))
            if time > 0.0 and len(known) >= ENOUGH and off < close:
                break
            if len(known) < 2 or not min(bare, last) <= limit <= max(bare, last):
                limit = 0.5 * (bare + last)
            try:
                way = (last - limit) * CLOSER ** POWERS[kind]
                trial = self._found(limit + way, way)
            except FAILURES:
                if len(known) >= ENOUGH:
                    break
                if abs(last - bare) * self.length < NEARLY_CLOSE and known[-1][0] < SHORT:
                    return self._special(kind, limit, abs(last - bare))
                raise
        else:
            return None
        vanishes = known[-1][0] < max(SHORT, SHRUNK * known[0][0])
        return self._special(kind, limit, off) if vanishes and off < LOOSE else None

    def _time(self, sigma: float, least: Sequence[Stretch], kind: str) -> float:
        """How long what begins takes at a place, beside a motion without it.

        Zero where it is not there, and -1 where there is anything else.
        """
        word = self._at(sigma)
        if sticks(word) == sticks(least):
            return 0.0
        birth = born(least, word)
        alike = birth is not None and (birth.at_once or sticks(least) == -1)
        return birth.time if birth is not None and alike and birth.kind == kind else -1.0

    def _special(self, kind: str, sigma: float, off: float) -> SpecialPoint:
        """The special point at a place that is so much off, or right beside that."""
        place = self._found(sigma, CLOSE / self.length, BESIDE)
        point, off = self.chord.at(place), off + abs(place - sigma)
        return SpecialPoint(kind, point, off * abs(self.chord.pace(point)) + point.orbit.error)

    def _found(self, sigma: float, way: float, nudges: Sequence[float] = NUDGES) -> float:
        """A place at which there is an orbit, or a part of a way from there.

        Right where a contact begins to slide or to stick its panels may not be resolved.
        """
        for share in nudges:
            try:
                self.chord.at(sigma + share * way)
                return sigma + share * way
            except FAILURES as error:
                failure = error
        raise failure

    @cached_property
    def length(self) -> float:
        """Arclength of the chord."""
        return abs(self.chord.last.arclength - self.chord.first.arclength)

    def _at(self, sigma: float) -> tuple[Stretch, ...]:
        """Stretches at a place, of a motion recorded after the last step of Newton's method."""
        orbit = self.chord.at(sigma).orbit
        problem = orbit.problem
        motion = problem.flow.trajectory(problem.nodes(orbit.point), problem.phases, orbit.omega)
        if motion.failure:
            raise LocateError(motion.failure)
        return _clear(stretches(motion, self.number))


def _continued(known: Sequence[tuple[float, float]], power: int) -> float:
    """Where a power series through places (time, σ) begins, without terms below a power.

    It is nan where they do not tell, as of equal times.
    """
    times, places = (np.array(each) for each in zip(*known, strict=True))
    scaled = times / times.max()
    powers = [0, *range(power, power + len(known) - 1)]
    try:
        return float(np.linalg.solve(scaled[:, None] ** powers, places)[0])
    except np.linalg.LinAlgError:
        return math.nan
