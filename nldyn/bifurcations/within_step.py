"""All special points of a step of a branch: a look at what may hide between its ends."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from operator import itemgetter

from nldyn.base.errors import LocateError, failing_as
from nldyn.bifurcations.branch_crossing import ON_CROSSING, lies_on_crossing
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.crossing_at_grazing import special_points_at_grazing
from nldyn.bifurcations.hidden_pairs import Between
from nldyn.bifurcations.locate import located_between
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.bifurcations.sign_changes import changed, leaves_circle, tests
from nldyn.bifurcations.touching import touches_sharply, touching_extremes
from nldyn.orbits.critical_functions import travel
from nldyn.orbits.extremes import dips
from nldyn.orbits.impact_phases import impacts_by_segment
from nldyn.orbits.shooting import metric_length

FAR = 0.1  # way of a multiplier near the unit circle within which it does not cross it twice
MOST_LOOKS = 12  # times that a step is cut at such points
MOST_HALVES = 8  # times that a step beside a grazing point is halved towards it
SHORTEST_LOOK = 1e-6  # arclength of a step, below which it is not cut there
CLOSE = 0.01  # part of a step within which a point beside it does not help
FAR_ALONE = 0.3  # the same of the only pair of a single mode
MOST_BENT = 10.0  # times that points may lie apart farther than their arclength says
DIVES = 8  # points at which to look for a change of sign between two others
WITHIN = 0.02  # share of a step next to its ends, in which no point is put


@failing_as(LocateError)
def special_points_between(
    a: BranchNode,
    b: BranchNode,
    before: BranchNode | None = None,
    after: BranchNode | None = None,
) -> list[SpecialPoint]:
    """All special points between two neighbouring points, in order.

    The points before and after them help to tell where two may hide.

    Raises
    ------
    LocateError
        If an orbit is not found where it should be.
    """
    if passes_node(a, b) and not differs(a, b):
        if may_hide(before, a, b, after):
            raise LocateError(
                "two of them may lie within one step, in which an impact passes a phase of shooting"
            )
        return []
    together = special_points_at_grazing(a, b)
    if together:
        return together
    _check_dips(before, a, b, after)
    coarse = [a, *beside_grazing(before, a, b, after), b]
    around = [before, *coarse, after]
    points = [a]
    for (first, last), z, c in zip(pairwise(coarse), around, around[3:], strict=False):
        points += [*_inside(z, first, last, c), last]
    for i in range(len(points) - 2, 0, -1):
        insert_dip(points, i)
    found = [special for pair in pairwise(points) for special in located_between(*pair)]
    grazed = a.orbit.impacts != b.orbit.impacts and bool(touching_extremes(a.orbit, b.orbit))
    if grazed and all(special.kind != "GR" for special in found):
        raise LocateError("a stop is touched, but no grazing point was found")
    return found


def passes_node(a: BranchNode, b: BranchNode) -> bool:
    """Whether an impact with a rigid stop passes a phase of shooting between two points.

    The state there jumps to that on the other side of the impact, however short the step is. The
    multipliers do not: they are those of the motion, wherever it is cut.
    """
    if not a.orbit.system.jumps:
        return False
    way = metric_length(a.weights, b.point - a.point)
    if way > MOST_BENT * abs(b.arclength - a.arclength):
        return True
    return bool((impacts_by_segment(a.orbit) != impacts_by_segment(b.orbit)).any())


def may_hide(z: BranchNode | None, a: BranchNode, b: BranchNode, c: BranchNode | None) -> bool:
    """Whether two special points may lie between a and b, by multipliers and extremes only.

    That is where a multiplier moves far, or where a test or an extreme dips; the extremes of a body
    that comes to rest are too many to be told apart. States and Jacobians of segments are not
    used: they jump where an impact passes a phase of shooting, and so does the tangent, LP.
    """
    before, after = a.orbit.multipliers, b.orbit.multipliers
    far = FAR if before.size > 2 else FAR_ALONE
    if travel(before, after) > far:
        return True
    low, high = sorted((a.arclength, b.arclength))
    for triple in ((z, a, b), (a, b, c)):
        if any(p is None for p in triple):
            continue
        places = hidden_dips(*(p for p in triple if p is not None))
        rests = any(p.orbit.rests for p in triple if p is not None)
        last = len(tests(a)) if rests else None
        if any(low < where < high for where in places[1:last]):  # the first is that of LP
            return True
    return False


def _inside(
    z: BranchNode | None, a: BranchNode, b: BranchNode, c: BranchNode | None
) -> list[BranchNode]:
    """Points between a and b, close enough that a multiplier crosses the circle once at most."""
    several = a.orbit.multipliers.size > 2
    if several and smooth(a, b):
        return looked_into(z, a, b, c)
    least = 2 if several and changed(a, b) else 0  # beside one change two others may hide
    if touches_sharply(a.orbit.system) and a.orbit.impacts != b.orbit.impacts:
        least = 3
    return resolved(a, b, least, 5 if several else 3, FAR if several else FAR_ALONE)


def beside_grazing(
    before: BranchNode | None, a: BranchNode, b: BranchNode, after: BranchNode | None
) -> list[BranchNode]:
    """Points between a and b, closer and closer to a grazing point beside them.

    Where a stop is touched sharply, multipliers go there with the root of the distance: the ends of
    a step that is long beside this distance do not tell what they do within.

    Raises
    ------
    LocateError
        If no orbit of the branch is found there.
    """
    if not touches_sharply(a.orbit.system) or a.orbit.impacts != b.orbit.impacts:
        return []
    length = abs(b.arclength - a.arclength)
    shares: set[float] = set()
    if before is not None and before.orbit.impacts != a.orbit.impacts:
        shares.update(_halves(length, abs(a.arclength - before.arclength)))
    if after is not None and after.orbit.impacts != b.orbit.impacts:
        shares.update(1.0 - x for x in _halves(length, abs(after.arclength - b.arclength)))
    chord = Chord(a, b)
    return [chord.at(share) for share in sorted(shares)]


def _halves(length: float, beside: float) -> list[float]:
    """Shares 1/2, 1/4, ... of a step, down to a quarter of the step beside it."""
    least = max(0.25 * beside, 0.5**MOST_HALVES * length)
    count = math.ceil(math.log2(max(length / least, 2.0)))
    return [0.5**k for k in range(1, count + 1)]


def _check_dips(
    before: BranchNode | None, a: BranchNode, b: BranchNode, after: BranchNode | None
) -> None:
    """Raise a LocateError unless a branch is found where two special points may hide on a chord."""
    for z, here, c in ((before, a, b), (a, b, after)):
        if z is None or c is None:
            continue
        for where in hidden_dips(z, here, c):
            share = (where - a.arclength) / (b.arclength - a.arclength)
            if 0.0 < share < 1.0:
                Chord(a, b).at(share)


def smooth(a: BranchNode, b: BranchNode) -> bool:
    """Whether multipliers may be interpolated between two points, and can cross the circle."""
    if a.orbit.system.conservative or a.orbit.impacts != b.orbit.impacts:
        return False
    return leaves_circle(a.orbit, b.orbit)


def looked_into(
    z: BranchNode | None,
    a: BranchNode,
    b: BranchNode,
    c: BranchNode | None,
    most: int = MOST_LOOKS,
) -> list[BranchNode]:
    """Points between a and b, so that between neighbours no multiplier crosses the circle twice.

    The points z before and c after them count where the number of contacts is the same.

    Raises
    ------
    LocateError
        If they may still do so when the step has been cut `most` times.
    """
    if abs(b.arclength - a.arclength) < SHORTEST_LOOK:
        return []
    chord = Chord(a, b)
    beside = [p for p in (z, c) if p is not None and p.orbit.impacts == a.orbit.impacts]
    places = {chord.place(p): p for p in beside}
    places = {x: p for x, p in places.items() if x < -CLOSE or x > 1.0 + CLOSE}
    near = sorted([*places.items(), (0.0, a), (1.0, b)], key=itemgetter(0))
    where = Between([p.orbit for _, p in near], [x for x, _ in near]).where_to_look()
    if where is None:
        return []
    if most == 0:
        raise LocateError("two special points may lie within one step")
    middle = chord.at(where)
    first = looked_into(z, a, middle, b, most - 1)
    return [*first, middle, *looked_into(a, middle, b, c, most - 1)]


def resolved(a: BranchNode, b: BranchNode, least: int, most: int, far: float) -> list[BranchNode]:
    """Points between two others, halved at least so often, until no multiplier moves far."""
    before, after = a.orbit.multipliers, b.orbit.multipliers
    if most == 0 or (least <= 0 and travel(before, after) <= far):
        return []
    middle = Chord(a, b).at(0.5)
    first = resolved(a, middle, least - 1, most - 1, far)
    return [*first, middle, *resolved(middle, b, least - 1, most - 1, far)]


def insert_dip(points: list[BranchNode], index: int) -> None:
    """Add a point beside one where a test or an extreme may have changed sign twice unseen."""
    z, a, b = points[index - 1 : index + 2]
    for number, where in enumerate(hidden_dips(z, a, b)):
        if math.isnan(where):
            continue
        try:
            extra = turned_over(z, a, b, number, where)
        except LocateError:  # met again when the step is searched
            continue
        if extra is not None:
            ahead = (extra.arclength - a.arclength) * (b.arclength - a.arclength) > 0.0
            points.insert(index + 1 if ahead else index, extra)
            return


def turned_over(
    z: BranchNode, a: BranchNode, b: BranchNode, number: int, where: float
) -> BranchNode | None:
    """Point between z and b at which a test or an extreme has changed its sign, or None.

    It is looked for at an arclength, then where the parabola through the points nearest to that
    dips; `number` counts the values of `hidden_dips`.

    Raises
    ------
    LocateError
        If no orbit of the branch is found there.
    """
    for _ in range(DIVES):
        if math.isnan(where):
            return None
        ahead = (where - a.arclength) * (b.arclength - a.arclength) > 0.0
        first, last = (a, b) if ahead else (z, a)
        span = last.arclength - first.arclength
        if abs(span) < SHORTEST_LOOK:
            return None
        sigma = min(max((where - first.arclength) / span, WITHIN), 1.0 - WITHIN)
        extra = Chord(first, last).at(sigma)
        if differs(a, extra):
            return None if lies_on_crossing(extra, ON_CROSSING) else extra
        triples = ((a, extra, b), (z, a, extra)) if ahead else ((z, extra, a), (extra, a, b))
        for triple in triples:
            where = hidden_dips(*triple)[number]
            if not math.isnan(where):
                z, a, b = triple
                break
    return None


@lru_cache(maxsize=8)  # three neighbours are asked about when they are met, and in both steps
def hidden_dips(z: BranchNode, a: BranchNode, b: BranchNode) -> tuple[float, ...]:
    """Arclengths between z and b at which a test or an extreme may touch zero unseen.

    See `orbits.extremes.dips`; the extremes are those of the stops' penetrations.
    """
    left, right = z.arclength - a.arclength, b.arclength - a.arclength
    found = dips(
        left,
        right,
        [value for point in (z, a, b) for value in tests(point).values()],
        len(a.orbit.system.stops),
        [point.orbit.touched for point in (z, a, b)],
        2.0 * math.pi * a.orbit.period,
    )
    return tuple(a.arclength + way for way in found)


def differs(a: BranchNode, b: BranchNode) -> bool:
    """Whether a test or an extreme changes its sign between two points."""
    return bool(changed(a, b) or touching_extremes(a.orbit, b.orbit))
