"""Past what is in the way of a walk: nodes of shooting at impacts, touches, crossings, corners."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES
from nldyn.bifurcations.branch_crossing import crossing_beside
from nldyn.bifurcations.on_curve import shot_from
from nldyn.bifurcations.point import BranchNode
from nldyn.bifurcations.within_step import differs, may_hide
from nldyn.branches.guards import (
    KINK,
    is_shifted,
    loses_impact,
    mends_symmetry,
)
from nldyn.orbits.bordered import FREE, correct
from nldyn.orbits.impact_phases import (
    impact_behind_node,
    impacts_by_segment,
    nodes_to_impacts,
    start_far_from_impacts,
)
from nldyn.orbits.shooting import FROM_NEAR, asymmetry, metric_length

LONGER_CROSSINGS = (1.0, 10.0, 100.0)  # steps from a crossing, over `SHORTEST_CROSSING`
FARTHEST_CROSSING = 1e-4  # distance of one from which a step may begin
NEAR_NODE = 1e-4  # rad from an impact to a phase of shooting, from which a short step may pass it
FASTEST = 20.0  # rad by which an impact's phase changes at most, over the arclength
AT_NODE = 1e-7  # rad from an impact to a phase of shooting, which are too few
PAST_NODE = 1e-6, 1e-5, 1e-4, 1e-3  # short steps past it, in arclength
CLEAR_OF_NODES = 3e-3  # rad from an impact to one, from which derivatives do not reach across it
MOST_OVER_NODE = 8  # steps, none of which leads clear of it where the impact moves slowly
SHARES = (1.0, 0.8, 0.6, 0.4, 0.25)  # of a step that leads over a phase of shooting


class Advance(NamedTuple):
    """A step of a walk: the points on its way, the last one first asked for, and how it bends.

    Parameters
    ----------
    way : tuple of BranchNode
        The next point, behind a corner that lies before it.
    step : float
        Arclength of the step to it.
    angle, miss : float
        Between the tangents at its ends, and from where it was predicted, relative to it.
    """

    way: tuple[BranchNode, ...]
    step: float
    angle: float
    miss: float

    @property
    def there(self) -> BranchNode:
        """The next point."""
        return self.way[-1]


def over_node(
    here: BranchNode,
    steps: Sequence[float],
    near: float,
    straight_on: Callable[[BranchNode, float], Advance | None],
) -> Advance | None:
    """Next point where the phase of an impact passes one of shooting, or None.

    The state there jumps from that before the impact to that behind it, or back, and differences
    of a condition must not reach across it. So the walk is made with the states at other phases:
    the first of `steps` that leads past it, or along a curve some of them, up to a point clear of
    it. The impact must be as near to that phase as told.
    """
    if nodes_to_impacts(here.orbit) > near:
        return None
    free = here.condition is FREE
    try:
        shot = shot_from(here, start_far_from_impacts(here.orbit))
        for _ in range(1 if free else MOST_OVER_NODE):
            first = None
            for step in steps:
                beyond = straight_on(shot, step)
                if beyond is None:
                    continue
                first = first or beyond.there
                there = shot_from(beyond.there, 0.0)
                if is_past_node(here, there) if free else clear_of_nodes(there):
                    return beyond._replace(way=(there,), step=steps[0])
            if first is None:
                break
            shot = first
    except FAILURES:
        pass
    return None


def is_past_node(here: BranchNode, there: BranchNode) -> bool:
    """Whether an impact at a phase of shooting has passed it, and nothing else happens between.

    What may hide between two points is not looked for across such a phase.
    """
    before, behind = impact_behind_node(here.orbit), impact_behind_node(there.orbit)
    stays = (impacts_by_segment(there.orbit) == impacts_by_segment(here.orbit)).all()
    if abs(behind) < AT_NODE or (stays and abs(before) > AT_NODE and before * behind > 0.0):
        return False
    hides = differs(here, there) or may_hide(None, here, there, None)
    return not (hides or loses_impact(there.orbit))


def clear_of_nodes(node: BranchNode) -> bool:
    """Whether all impacts are far from the phases of shooting."""
    return nodes_to_impacts(node.orbit) > CLEAR_OF_NODES


def across_touch(here: BranchNode, step: float, row: Real) -> Advance | None:
    """Next point on the other side of a grazing point, or None.

    A stiff stop may bend the branch by more than a right angle within 1e-8, back from every
    plane across its tangent. The depth of the touch, whose slope is the row, rises or falls all the
    way, and where it is held the stop's force hardly depends on the orbit.
    """
    family = here.family
    weights = here.weights
    guess = here.point + step * here.tangent / metric_length(weights, here.tangent)
    found = correct(family, guess, FREE, row, longest=2.0 * KINK, max_iterations=FROM_NEAR)
    after = asymmetry(family.problem, found.point)
    if not found.converged or mends_symmetry(family, here.asymmetry, after):
        return None
    if is_shifted(family, here.point, guess, found.point):
        return None
    length = metric_length(weights, found.point - here.point)
    if length > KINK or found.orbit.impacts == here.orbit.impacts:
        return None
    tangent = found.tangent(here.tangent)
    if float(row @ tangent) * float(row @ here.tangent) < 0.0:
        tangent = -tangent
    return Advance((BranchNode.of(found, tangent, here.arclength + length),), step, 0.0, 0.0)


def crossing_ahead(here: BranchNode) -> BranchNode | None:
    """Where another branch crosses that of a point right beside there, on its tangent.

    It may lie a little behind.
    """
    crossing = crossing_beside(here)
    if crossing is None:
        return None
    way = crossing.point - here.point
    weights = here.weights
    if metric_length(weights, way) > FARTHEST_CROSSING:
        return None
    ahead = float(way @ (weights * here.tangent)) / metric_length(weights, here.tangent)
    return BranchNode.of(crossing, here.tangent, here.arclength + ahead)
