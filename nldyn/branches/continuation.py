"""Pseudo-arclength continuation of periodic orbits in the frequency or another parameter."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from nldyn.base.arrays import SLACK, Real
from nldyn.base.errors import ConvergenceError, SystemModelError, check_types, numbers
from nldyn.bifurcations.branch_crossing import (
    NEIGHBOUR,
    ON_CROSSING,
    correct_across,
    distance,
    lies_on_crossing,
    same_crossing,
)
from nldyn.bifurcations.chord import CROSSING_ERROR
from nldyn.bifurcations.events import Events, check_values, checked_events
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.branches.at_frequency import check_requested, requested
from nldyn.branches.branch import Branch, Course
from nldyn.branches.checkpoint import BranchFile, Checkpoint, checkpoint_at
from nldyn.branches.conditioned import start_on
from nldyn.branches.endings import Ending, StopReason, StopReasons
from nldyn.branches.leg import Leg, LegBuilder, Progress
from nldyn.branches.step_control import ContinuationOptions
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.bordered import FREE, OrbitFamily, Place, correct
from nldyn.orbits.conditions import Turning
from nldyn.orbits.limit_cycle import of_self_excited
from nldyn.orbits.orbit import Orbit, check_minimal
from nldyn.orbits.shooting import shifts
from nldyn.runtime.prefetch import Ahead
from nldyn.runtime.progress import of_value, shows_progress
from nldyn.runtime.threads import one_thread
from nldyn.system.chart import (
    FREQUENCY,
    Chart,
    checked_parameter,
    moves_frequency,
    told_value,
    value_of,
)
from nldyn.system.parameters import Parameter

FROM_FOLD = 1e-4  # arclength from a fold to the point at which a branch through it begins
MIDDLE = 0.1  # of that, within which it lies
NEARLY_FLAT = 1e-3  # frequency part of a tangent, up to which it may be that of a fold
ALONG = 0.99  # least cosine between two tangents of a branch at one place
MET_AGAIN = 1e-6  # longest Newton step by which a solved orbit is met again across its branch


@shows_progress(of_value("branch"))
def continue_branch(
    start: Orbit | Branch,
    limits: tuple[float, float] | None = None,
    *,
    parameter: str | Parameter | None = None,
    name: str = "",
    options: ContinuationOptions | None = None,
    progress: Callable[[float], None] | None = None,
    open_ends: Sequence[Real] = (),
    at: Sequence[float] | None = None,
    events: Events | None = None,
    checkpoint: BranchFile | Checkpoint | None = None,
) -> Branch:
    """Continue an orbit in both directions through a range of a parameter, or go on with a branch.

    The parameter is the excitation frequency unless another one is named; all others are held. Of
    a self-excited motion, as of `limit_cycle`, one must be named, and its frequency goes along. A
    branch is finished where it was interrupted, and followed beyond the ends of its range. Its
    points are those of one continuation through the new range on its scale, to the last digit;
    those at the ends of the old range are left out.

    Parameters
    ----------
    start : Orbit or Branch
        Where to start. The value of an orbit must lie in the range; from a fold the first point is
        1e-4 of arclength away.
    limits : (float, float)
        Frequencies in Hz, or values of the parameter, ascending. The ends are met exactly. For a
        branch it contains the range of before, which is kept unless given.
    parameter : str or Parameter, optional
        See `nldyn.system.chart.checked_parameter`; that of a branch is its own.
    name : str
        Name of the branch; one that goes on keeps its own.
    options : ContinuationOptions, optional
        Step control; for a branch from here on. With more `max_points`, or a smaller `min_step`,
        an end goes on that had come to the limit.
    progress : callable, optional
        Called with the parameter's value at every point.
    open_ends : sequence of (N + 1,) arrays
        Where other branches were broken off, see `Stepper`.
    at : sequence of float, optional
        Values at which orbits are wanted: `Branch.requested` has all of them, at each passage of
        the branch. For a branch those of before unless given.
    events : sequence of str, Event or callable, optional
        Further special points to mark: "amplitude resonance", "amplitude antiresonance", "phase
        resonance", an `Event` of your own, or a function of an orbit that is zero there. For a
        branch those of before unless given.
    checkpoint : CheckpointFile, optional
        File that keeps what is computed, written now and then, at the end, and when an exception
        such as Ctrl-C ends the computation. If it holds this very continuation, that one goes on
        and gives the points of an uninterrupted one.

    Returns
    -------
    Branch

    Raises
    ------
    SystemModelError
        If the range is empty, the orbit, a requested value or the range of before lies outside,
        there is no such parameter, the branch was put together by hand, or `checkpoint` holds
        something else.
    OutputError
        If `checkpoint` cannot be written.
    ConvergenceError
        If Newton's method does not meet the orbit again at its own value, or branches cross there.

    References
    ----------
    H. B. Keller (1977), pseudo-arclength continuation; E. Doedel et al., AUTO-07p manual.

    Examples
    --------
    >>> from nldyn import System, Unbalance, continue_branch, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> orbit = solve_orbit(system, frequency_hz=10.0)
    >>> longer = continue_branch(continue_branch(orbit, (9.0, 12.0)), (5.0, 20.0))
    >>> whole = continue_branch(orbit, (5.0, 20.0))
    >>> longer.frequency_hz.tolist() == whole.frequency_hz.tolist()
    True
    >>> weaker = continue_branch(orbit, (0.01, 0.02), parameter="modal_damping")
    >>> weaker.values[[0, -1]].tolist()
    [0.01, 0.02]
    """
    check_types(
        start=(start, Orbit, Branch),
        name=(name, str),
        options=(options, ContinuationOptions, None),
        progress=(progress, Callable, None),
        open_ends=(open_ends, Sequence),
    )
    known = None
    if isinstance(start, Branch):
        known, before = over_range(start, limits, parameter)
        first = known.nodes[before.start]
    else:
        if limits is None:
            raise SystemModelError(
                "continue_branch: an orbit needs limits, the range of its parameter"
            )
        family = family_over(start, limits, parameter)
        avoided = alike(family, [numbers("open_ends", end) for end in open_ends])
        before = Course(limits, ContinuationOptions(), avoided, further=further_ranges(family))
        first = first_point(family, start)
    chart = first.family.charts[0]
    course = replace(
        before,
        limits=(chart.low, chart.high),
        options=options or before.options,
        at=check_requested(before.at if at is None else at, chart),
        events=before.events if events is None else checked_events(events),
    )
    check_values(course.events, first.orbit)
    with checkpoint_at(checkpoint, first.family.system) as kept:
        return going_on(name, known, first, course, progress, kept)


def family_over(
    orbit: Orbit, limits: tuple[float, float], parameter: str | Parameter | None = None
) -> OrbitFamily:
    """The family of an orbit in one parameter over a range, checked.

    That of a self-excited motion has its frequency as a second one.

    Raises
    ------
    SystemModelError
        If the range is empty or does not hold the orbit, there is no such parameter, it is the
        frequency of a self-excited motion, or the orbit is one of a shorter period.
    """
    check_minimal(orbit)
    chosen = checked_parameter(orbit.system, FREQUENCY if parameter is None else parameter)
    chart = Chart.of(chosen, limits)
    chart.check_start(value_of(orbit.system, orbit.frequency_hz, chart.parameter))
    if not orbit.self_excited:
        return OrbitFamily.around(orbit, (chart,))
    if moves_frequency(chosen):
        raise SystemModelError(
            "the frequency of a self-excited motion is found, not given: name another parameter"
        )
    return of_self_excited(orbit, chart)


def first_point(family: OrbitFamily, orbit: Orbit) -> BranchNode:
    """Where the branch of an orbit begins, heading up in the parameter; see `start_point`."""
    if orbit.self_excited:
        return start_on(family, orbit, Turning())
    return start_point(family.place(orbit), 1.0)


def further_ranges(family: OrbitFamily) -> tuple[tuple[float, float], ...]:
    """Values of what goes along with the parameter, between which to stay."""
    return tuple((other.low, other.high) for other in family.charts[1:])


def going_on(
    name: str,
    branch: Branch | None,
    start: BranchNode,
    course: Course,
    progress: Progress | None,
    checkpoint: Checkpoint,
    ahead: Ahead | None = None,
) -> Branch:
    """A branch or curve from a start, from what is known of it, here or by a checkpoint.

    Parameters
    ----------
    name : str
        Name of one that is new.
    branch : Branch, optional
        One to finish, or to follow through wider ranges on the scale that it has.
    start, course, progress, checkpoint, ahead
        As for `complete`.
    """
    before = branch and branch.course
    kept = checkpoint.branch_from(start, course, *([before] if before else []))
    if kept is not None and kept.course is not None and kept.course.ranges == course.ranges:
        branch = kept  # this very one was begun before
    if branch is None:
        return complete(name, None, None, start, course, progress, checkpoint, ahead)
    forward, backward = split(branch)
    start = forward.nodes[0]
    return complete(branch.name, forward, backward, start, course, progress, checkpoint, ahead)


def finished(branch: Branch, progress: Progress | None, checkpoint: Checkpoint) -> Branch:
    """A branch followed to the ends of its course."""
    course = branch.course
    assert course is not None
    return going_on("", branch, branch.nodes[course.start], course, progress, checkpoint)


def over_range(
    branch: Branch, limits: tuple[float, float] | None, parameter: str | Parameter | None
) -> tuple[Branch, Course]:
    """A branch with a range that contains the one of before, and its course.

    Raises
    ------
    SystemModelError
        If the range does not contain that, the branch has another parameter or no course.
    """
    course = branch.course
    if course is None:
        raise SystemModelError(
            f"branch '{branch.name}' cannot be extended: it does not tell how it was continued; "
            "follow one of its points anew"
        )
    if parameter not in (None, branch.parameter, branch.parameter.name):
        raise SystemModelError(
            f"branch '{branch.name}' was followed in {branch.parameter.name}: begin at one of its "
            "orbits to follow another parameter"
        )
    chart, *others = branch.nodes[0].family.charts
    low, high = course.limits
    wider = chart.over(course.limits if limits is None else limits)
    if not wider.low <= low < high <= wider.high:
        raise SystemModelError(
            f"{chart.range_name} = ({wider.low:g}, {wider.high:g}) must contain the range of the "
            f"branch, ({low:g}, {high:g})"
        )
    return on_charts(branch, (wider, *others)), course


def on_charts(branch: Branch, charts: tuple[Chart, ...]) -> Branch:
    """The same branch with other ranges on the same scales."""
    families: dict[int, OrbitFamily] = {}

    def moved(node: BranchNode) -> BranchNode:
        family = node.family
        known = families.setdefault(id(family), replace(family, charts=charts))
        return replace(node, family=known)

    special = tuple(replace(s, point=moved(s.point)) for s in branch.special_points)
    return replace(
        branch,
        nodes=tuple(map(moved, branch.nodes)),
        special_points=special,
        requested=tuple(map(moved, branch.requested)),
    )


@one_thread()
def complete(
    name: str,
    forward: Leg | None,
    backward: Leg | None,
    start: BranchNode,
    course: Course,
    progress: Progress | None,
    checkpoint: Checkpoint,
    ahead: Ahead | None = None,
) -> Branch:
    """Walk the legs of a branch that are missing or may go on, forward first, and join them.

    Parameters
    ----------
    name : str
        Name of the branch.
    forward, backward : Leg, optional
        What is known.
    start : BranchNode
        Where both began, heading forward.
    course : Course
        Range, options and requested values.
    progress : callable, optional
        Called with the parameter's value at every point.
    checkpoint : Checkpoint
        Keeps what is computed.
    ahead : Ahead, optional
        May have walked legs already, and walks the one backward while that forward is walked here.
    """
    ahead = ahead or Ahead(start.family.problem.flow)

    def walked(
        leg: Leg | None, first: BranchNode, whole: Callable[[Leg | None], Branch | None]
    ) -> Leg:
        if leg is not None and not goes_on(leg, course):
            return leg
        trail = LegBuilder.going_on(leg or Leg.of(first), course)
        checkpoint.work = lambda: whole(trail.so_far())
        return ahead.value(
            leg_key(first, course),
            lambda _: trail.follow(progress, kept),
            meanwhile=progress and partial(progress, first.value),
        )

    def kept() -> None:
        checkpoint.offer()
        ahead.look()

    back = start.reversed()
    if forward is None:
        offer_leg(ahead, back, course, first=True)
    forward = walked(forward, start, lambda leg: join(name, leg, backward, course) if leg else None)
    if forward.reason.closes:
        ahead.forget(leg_key(back, course))
        backward = None
    else:
        done = forward
        backward = walked(backward, back, lambda leg: join(name, done, leg, course))
    branch = join(name, forward, backward, course)
    points, lost = requested(branch.places, course.at)
    lost = [note for note in lost if note not in branch.notes]
    branch = replace(branch, requested=tuple(points), notes=(*branch.notes, *lost))
    branch = branch.with_events(course.events)
    checkpoint.work = lambda: branch
    checkpoint.offer()
    return branch


def walked_leg(
    flow: FlowMap, first: BranchNode, course: Course, look: Callable[[], None] | None = None
) -> Leg:
    """The leg of a branch from a point on, whole; ``look`` is called on the way."""
    return LegBuilder.going_on(Leg.of(first), course).follow(keep=look)


def leg_key(first: BranchNode, course: Course) -> Hashable:
    """What a leg depends on, beside the flow map and how orbits are told."""
    family = first.family
    return (
        family.period, family.segments, family.observe, family.scales, first.point.tobytes(),
        first.tangent.tobytes(), course.limits, course.options, course.open_ends.tobytes(),
    )  # fmt: skip


def offer_leg(
    ahead: Ahead,
    start: BranchNode,
    course: Course,
    *,
    group: Hashable = None,
    member: Hashable = None,
    first: bool = False,
) -> None:
    """Let a leg be walked ahead."""
    key = leg_key(start, course)
    ahead.offer(key, walked_leg, start, course, group=group, member=member, first=first)


def offer_branch(ahead: Ahead, start: BranchNode, course: Course, group: Hashable = None) -> None:
    """Let both legs of a branch be walked ahead."""
    member = leg_key(start, course)
    for point in (start, start.reversed()):
        offer_leg(ahead, point, course, group=group, member=member)


def start_point(place: Place, direction: float) -> BranchNode:
    """Branch point at an orbit of a family, heading up (+1) or down (-1) in its parameter.

    Beside a flip or a fold, where the parameter hardly tells the orbits of a branch apart, the
    orbit is met again on the plane across the branch. From a fold it is a short way to the point,
    if that lies in the range: at the fold itself rounding decides on which side the orbit is.

    Raises
    ------
    ConvergenceError
        If Newton's method does not meet the orbit again, or branches cross so near to it that it
        may be of either.
    """
    family, point = place.family, place.point
    chart = family.charts[0]
    where = told_value(chart.parameter, chart.value(float(point[-1])))
    if lies_on_crossing(place, ON_CROSSING):
        raise ConvergenceError(
            f"branches cross at the orbit at {where}: begin farther from there, or with one of "
            "switch_branch"
        )
    towards = np.zeros(point.size)
    towards[-1] = direction
    try:
        here = BranchNode.of(place, _tangent_at(place, towards), 0.0)
    except ConvergenceError as error:
        raise ConvergenceError(f"no orbit at {where}: {error}") from None
    beside = _beside_fold(here, direction)
    return beside if beside and chart.low <= beside.value <= chart.high else here


def _tangent_at(place: Place, towards: Real) -> Real:
    """Unit tangent of a branch at an orbit that Newton's method meets again.

    It is met at its parameter, or, where that may be another one, across its branch. Exactly at a
    fold the parameter may hold the orbit and give a direction that is rounding. Right beside a
    crossing the steps of Newton's method may be rounding, too, but for those of `correct_across`.

    Raises
    ------
    ConvergenceError
        If it is not met.
    """
    family, point = place.family, place.point
    found = correct(family, point, FREE, towards)
    known = found.converged or found.solution is not None
    here = found if known else replace(found, at=family.at(point))
    if not (np.isfinite(here.along).all() and here.along.any()):
        raise ConvergenceError(found.failure or "the motion has no finite derivatives")
    along = here.tangent(towards)
    across = family.metric(point) * along
    again = correct(family, point, FREE, across, longest=MET_AGAIN)
    astray = again.converged and abs(float(again.tangent(along) @ across)) < ALONG
    if astray or (again.converged and not found.converged):
        return again.tangent(towards)
    if found.converged:
        return along
    row = across / np.linalg.norm(across)
    met = correct_across(family, point, row, float(row @ point))
    if met is None or met.orbit.error > CROSSING_ERROR or distance(place, met) > MET_AGAIN:
        raise ConvergenceError(again.failure)
    return along


def _beside_fold(here: BranchNode, direction: float) -> BranchNode | None:
    """Point a short way from a fold that is here, where the branch heads up (+1) or down (-1).

    None if no fold is here: the branch turns in the middle between the points on both sides.
    """
    if abs(float(here.tangent[-1])) > NEARLY_FLAT:
        return None
    family, place = here.family, here.point
    across = family.metric(place) * here.tangent
    sides = [
        correct(family, place + way * here.tangent, FREE, across, longest=FROM_FOLD)
        for way in (-FROM_FOLD, FROM_FOLD)
    ]
    if not all(side.converged for side in sides):
        return None
    tangents = [side.tangent(here.tangent) for side in sides]
    first, last = (float(tangent[-1]) for tangent in tangents)
    if abs(first + last) > MIDDLE * abs(first - last):
        return None
    index = int(last * direction > 0.0)
    return BranchNode.of(sides[index], tangents[index], 0.0)


def goes_on(leg: Leg, course: Course) -> bool:
    """Whether a walk would go on with the range and the options of a course."""
    end, options = leg.end, course.options
    ending = leg.reason.ending
    if ending is Ending.NOT_FINISHED:
        return True
    if end is None:
        return False
    if ending in (Ending.RANGE_END, Ending.PARAMETER_RANGE_END, Ending.NO_ORBIT_AT_RANGE_END):
        ranges = np.array(course.ranges)
        slack = SLACK * np.abs(ranges).max(axis=1)
        values = leg.nodes[-1].values
        return bool(np.all((ranges[:, 0] + slack < values) & (values < ranges[:, 1] - slack)))
    if ending is Ending.MOST_POINTS:
        return options.max_points > end.count
    if ending is Ending.SHORT_STEP:
        return leg.reason.values["step"] != f"{options.min_step:g}"
    return False


def join(name: str, forward: Leg, backward: Leg | None, course: Course) -> Branch:
    """Branch of two legs from one start."""
    if backward is None:
        first = forward.reason if forward.reason.closes else Ending.NOT_FINISHED.told()
        backward = Leg([forward.nodes[0]], [], [], first, None)
    forward, backward = _without_repeat(forward, backward)
    branch = make_branch(
        name,
        [point.reversed() for point in backward.nodes[:0:-1]] + forward.nodes,
        [_reversed_special(s) for s in reversed(backward.special_points)] + forward.special_points,
        (backward.reason, forward.reason),
        backward.notes + forward.notes,
    )
    whole = replace(
        course,
        start=len(backward.nodes) - 1,
        special_points_before=len(backward.special_points),
        notes_before=len(backward.notes),
        ends=(backward.end, forward.end),
    )
    return replace(branch, course=whole)


def _without_repeat(forward: Leg, backward: Leg) -> tuple[Leg, Leg]:
    """Two legs from one start, of which only one tells a branch point that lies at it.

    There rounding decides the sign of the branch point's test, so that both may have met it; it is
    left out of the leg of which it lies behind the start.
    """
    if not (forward.special_points and backward.special_points):
        return forward, backward
    a, b = forward.special_points[0], backward.special_points[0]
    farthest = max(abs(a.point.arclength), abs(b.point.arclength))
    if not (farthest < NEIGHBOUR and same_crossing(a, b)):
        return forward, backward
    if a.point.arclength < 0.0:
        return _without_first(forward), backward
    return forward, _without_first(backward)


def _without_first(leg: Leg) -> Leg:
    """A leg without its first special point."""
    end = leg.end and replace(leg.end, special_points=max(leg.end.special_points - 1, 0))
    return replace(leg, special_points=leg.special_points[1:], end=end)


def split(branch: Branch) -> tuple[Leg, Leg | None]:
    """The legs of which a branch was joined: forward and, if it was begun, backward."""
    nodes, notes, course = branch.nodes, branch.notes, branch.course
    assert course is not None
    special = branch.bifurcations
    start, specials, lines = course.start, course.special_points_before, course.notes_before
    first, last = branch.stop_reasons
    forward = Leg(
        list(nodes[start:]), list(special[specials:]), list(notes[lines:]), last, course.ends[1]
    )
    if course.ends[0] is None:
        return forward, None
    backward = Leg(
        [point.reversed() for point in nodes[start::-1]],
        [_reversed_special(s) for s in reversed(special[:specials])],
        list(notes[:lines]),
        first,
        course.ends[0],
    )
    return forward, backward


def make_branch(
    name: str,
    nodes: list[BranchNode],
    special: list[SpecialPoint],
    reasons: StopReasons,
    notes: list[str],
) -> Branch:
    """Branch from its parts; the period is that of its orbits."""
    period = nodes[0].orbit.period
    return Branch(name, period, tuple(nodes), tuple(special), reasons, tuple(notes))


def _reversed_special(special: SpecialPoint) -> SpecialPoint:
    return replace(special, point=special.point.reversed())


def broken_off(branch: Branch) -> list[tuple[BranchNode, StopReason]]:
    """The ends at which a branch was broken off, and why."""
    ends = zip((branch.nodes[0], branch.nodes[-1]), branch.stop_reasons, strict=True)
    return [(end, why) for end, why in ends if why.broken_off]


def open_ends(branch: Branch) -> list[Real]:
    """Unknowns where a branch was broken off, shifted by all its excitation periods."""
    ends = [end for end, _ in broken_off(branch)]
    return [place for end in ends for place in shifts(end.family.problem, end.point)]


def alike(family: OrbitFamily, places: Sequence[Real]) -> Real:
    """Those of some unknowns that are as many as a family's, (m, N + 1)."""
    size = family.n_states + family.n_free
    return np.array([place for place in places if place.size == size]).reshape(-1, size)
