"""How a branch or a curve goes on behind a grazing of rigid stops.

Two families meet there, one with the slight impact and one without; each begins in proportion to
the speed of the impact, or to the miss (Nordmark 1991; di Bernardo, Budd, Champneys and Kowalczyk
2008, *Piecewise-smooth Dynamical Systems*, ch. 6). Where several touches graze at once, there may
be one with each mixture of impacts and misses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES, ConvergenceError, LocateError, SystemModelError
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.bifurcations.rigid_grazing import MOST_TOUCHES, Beside, RootMap, turned
from nldyn.bifurcations.rigid_touch import Touches
from nldyn.bifurcations.sign_changes import accounted
from nldyn.bifurcations.touching import rigid_touches
from nldyn.orbits.bordered import FREE, Corrected, OrbitFamily, correct, length_unit
from nldyn.orbits.conditions import Grazing
from nldyn.orbits.orbit import Orbit, minimal_period
from nldyn.orbits.shooting import BROKEN, FROM_NEAR, asymmetry, metric_length

SLIGHT = 1e-5, 1e-4, 1e-3  # first impacts and misses looked for, depth over the orbit's size
SLIGHTER = 1e-6, 1e-7  # misses, where the motion at the touch hardly changes with the frequency
SLIGHTEST = 1e-6  # impact that is followed: multipliers go with its inverse
FOLLOWED = 2.0 * SLIGHTEST  # least impact with which a branch can begin
DIFFERENCED = 1e-3  # slightest impact that is followed where differences serve as derivatives
SLIGHT_BY_DIFFERENCES = 2.0 * DIFFERENCED, 10.0 * DIFFERENCED
AS_ASKED = 0.1  # relative difference of the depth found from it
LIMITS = 10.0  # over the largest multiplier: how far others may be from their limits at grazing
PROPORTIONAL = 0.2  # most by which the way from the grazing is not in proportion to the depth


def beyond_rigid_grazing(at: BranchNode, before: Orbit) -> BranchNode | None:
    """First point of a branch behind a grazing.

    Of the orbits that begin there it is the one with the symmetry of those before, but with other
    impacts. It comes from the grazing in proportion to impacts and misses.

    Parameters
    ----------
    at : BranchNode
        The grazing.
    before : Orbit
        An orbit right before it.

    Returns
    -------
    BranchNode or None
        Heading away from the grazing; None if there is no such orbit, or more than one.
    """
    found = orbit_beyond(at.orbit, before, at.family)
    if found is None:
        return None
    beyond = _as_node(at, found)
    return replace(beyond, arclength=at.arclength + beyond.arclength)


def orbit_beyond(exact: Orbit, before: Orbit, family: OrbitFamily) -> Corrected | None:
    """First orbit of a family in one parameter behind a grazing, as `beyond_rigid_grazing`."""
    try:
        touches = Touches.of(exact, family=family)
        ahead = _ahead(touches, exact, before)
        if ahead is None or _slight_touches(exact) != len(touches.stops):
            return None
        shares = (*SLIGHT, *SLIGHTER) if family.is_exact else SLIGHT_BY_DIFFERENCES
        return first_beside(exact, touches, ahead, shares)
    except FAILURES:
        return None


def switch_at_rigid_grazing(special: SpecialPoint, times: int = 1) -> list[BranchNode]:
    """First points of the branches with slight impacts that begin at a grazing of rigid stops.

    Parameters
    ----------
    special : SpecialPoint
        The grazing (GR).
    times : int
        Over how many of its periods those are periodic. With more than one they have one slight
        impact in all of them: the maximal orbits of Nordmark (1991).

    Returns
    -------
    list of BranchNode
        One for each kind of impacts of which an orbit is found, heading away from the grazing.

    Raises
    ------
    SystemModelError
        If no rigid stop is grazed.
    LocateError
        If no such orbits begin there, or none is found.
    """
    exact, hz = special.orbit, special.place()
    if not Grazing.of(exact).half:
        raise SystemModelError(f"no branch leaves the grazing at {hz}, which is of an elastic stop")
    try:
        touches = Touches.of(exact, times, family=special.point.family)
        form = RootMap.of(touches)
        kinds = form.beside if times == 1 else form.with_one_hit(len(touches.stops) // times)
        found = [
            first_beside(exact, touches, kind, _shares(exact, touches, form, kind))
            for kind in kinds
            if any(kind.hits)
        ]
    except FAILURES as error:
        raise LocateError(f"no orbit is found beside the grazing at {hz}: {error}") from None
    period = times * exact.period
    if not found:
        if len(touches.stops) > MOST_TOUCHES:
            raise LocateError(f"too many touches graze at {hz} to tell which orbits begin there")
        raise LocateError(f"no orbit of period {period} with an impact begins at {hz}")
    nodes = [_as_node(special.point, orbit) for orbit in found if orbit is not None]
    if not nodes:
        raise LocateError(
            f"no orbit of period {period} is found beside the grazing at {hz}, though one begins "
            "there: its impacts may be too slow"
        )
    return nodes


def _shares(exact: Orbit, touches: Touches, form: RootMap, kind: Beside) -> Sequence[float]:
    """Sizes of the first impacts looked for, over that of the orbit.

    With one impact in several periods the speed goes with the distance up to where the multiplier
    has fallen to about 1, beyond with its root.
    """
    if sum(kind.hits) > 1:
        return SLIGHT
    growth = abs(form.growth(kind.hits.index(True))) / (touches.omega * length_unit(exact))
    share = min(0.1 * growth, SLIGHT[-1])
    return [part for part in (share, 0.3 * share, 0.1 * share, *SLIGHT) if part <= share]


def first_beside(
    exact: Orbit, touches: Touches, beside: Beside, shares: Sequence[float] = SLIGHT
) -> Corrected | None:
    """The orbit of a kind with the first of some sizes that is found.

    Raises
    ------
    ConvergenceError, SystemModelError
        If none can be looked for.
    """
    followed = [share for share in shares if share > FOLLOWED or not any(beside.hits)]
    found = (_beside(exact, touches, beside, share) for share in followed)
    return next((orbit for orbit in found if orbit is not None), None)


def _as_node(at: BranchNode, found: Corrected) -> BranchNode:
    """An orbit beside a grazing as a point of a branch heading away, with its distance."""
    times = found.orbit.period // at.orbit.period
    family = at.family.repeated(times)
    grazing = np.append(np.tile(at.point[:-1], times), at.point[-1])
    way = found.point - grazing
    length = metric_length(family.metric(grazing), way)
    tangent = found.tangent(way)
    return BranchNode(family, found.point, found.orbit, tangent, length)


def _ahead(touches: Touches, exact: Orbit, before: Orbit) -> Beside | None:
    """The orbits with which a branch goes on, None if there are several kinds or none."""
    come = tuple((_depths(touches, before) > 0.0).tolist())
    if len(come) == 1:  # with the impact or without it, on either side
        return Beside((not come[0],), 0, (1.0,))
    form, m = RootMap.of(touches), len(come)
    shifts = range(0, m, m * minimal_period(exact) // exact.period)
    mirrored = exact.system.symmetric and asymmetry(exact.problem, exact.point) < BROKEN
    turns = [*shifts, *((shift + m // 2) % m for shift in shifts if mirrored)]

    def kept(hits: tuple[bool, ...]) -> list[bool]:
        return [turned(hits, turn) == hits for turn in turns]

    same = [turned(come, shift) for shift in shifts]
    others = [each for each in form.beside if kept(each.hits) == kept(come)]
    others = [each for each in others if each.hits not in same]
    kinds = {min(turned(each.hits, shift) for shift in shifts) for each in others}
    return others[0] if len(kinds) == 1 else None


def crosses_beside(at: Orbit, beside: Orbit, slightest: float = SLIGHT[-1]) -> bool:
    """Whether a multiplier crosses, or may cross, the unit circle from a grazing to an orbit by it.

    Without the slight impact multipliers change steadily. With it the largest tends to infinity as
    the inverse of its speed, and the others to limits by as little as the speed; that of a single
    mode to zero, as the product of both is fixed. An impact is slight up to a share of the
    orbit's size.
    """
    slight = slightest * length_unit(beside)
    if not any(0.0 < depth < slight for *_, depth in rigid_touches(beside)):
        return not accounted(at, [], beside)
    *others, largest = np.sort(np.abs(beside.multipliers))
    near = LIMITS / largest if len(others) > 1 else 0.0
    return bool(largest <= 1.0 or np.any(np.abs(np.array(others) - 1.0) < near))


def _depths(touches: Touches, orbit: Orbit) -> Real:
    """Depths (m,) of the touches of a grazing on a neighbouring orbit: of impacts, or misses."""
    full, found = 2.0 * np.pi * orbit.period, rigid_touches(orbit)

    def depth(stop: int, phase: float) -> float:
        apart = {
            abs((other - phase + 0.5 * full) % full - 0.5 * full): value
            for of, other, value in found
            if of == stop
        }
        if not apart:
            raise ConvergenceError("a touch has vanished")
        return apart[min(apart)]

    phases = touches.phases.tolist()
    return np.array([depth(*each) for each in zip(touches.stops, phases, strict=True)])


def _slight_touches(orbit: Orbit) -> int:
    """How many impacts and near misses of rigid stops are as slight as those looked for."""
    least = SLIGHT[0] * length_unit(orbit)
    return sum(abs(depth) < least for _, _, depth in rigid_touches(orbit))


def _beside(exact: Orbit, touches: Touches, beside: Beside, share: float) -> Corrected | None:
    """The orbit whose least impact or miss is a share of the grazing's size."""
    hit, depth, family = np.array(beside.hits), share * length_unit(exact), touches.family
    unit = np.where(hit, touches.omega, 1.0)
    sizes = beside.amounts / unit
    lead = int(np.argmin(np.where(hit, sizes, np.inf) if hit.any() else sizes))
    shape = np.array(beside.amounts) * unit[lead] / beside.amounts[lead]
    places = []
    for size in (0.5 * depth, depth):
        try:
            moved, amounts = touches.moved(beside.hits, size * shape, lead)
        except ConvergenceError:
            return None
        places.append(moved.unknowns(np.where(hit, amounts, 0.0)))
    grazing = touches.unknowns(np.zeros(hit.size))
    weights = family.metric(grazing)
    near, far = (place - grazing for place in places)
    way = metric_length(weights, far)
    if metric_length(weights, far - 2.0 * near) > PROPORTIONAL * way:
        return None
    held = np.zeros(grazing.size)
    held[-1] = 1.0
    found = correct(
        family, places[1], FREE, held, max_iterations=FROM_NEAR, longest=AS_ASKED * way,
    )  # fmt: skip
    if not found.converged:
        return None
    found_depths = _depths(touches, found.orbit)
    as_asked = abs(abs(found_depths[lead]) - depth) < AS_ASKED * depth
    return found if as_asked and ((found_depths > 0.0) == hit).all() else None
