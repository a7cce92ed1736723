"""From a special point of a branch or curve to the branches that leave it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from nldyn.base.errors import LocateError, SystemModelError, check_whole
from nldyn.bifurcations.beyond_rigid_grazing import switch_at_rigid_grazing
from nldyn.bifurcations.normal_forms import crossing_tangents, switch_at_branch_point
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.bifurcations.point import (
    BranchNode,
    SpecialPoint,
    check_special,
    is_of_branch,
    on_branch,
)
from nldyn.orbits.conditions import BranchPointCondition, Grazing, Singular
from nldyn.orbits.shooting import LONGEST_PERIOD


def switch_branch(special: SpecialPoint, *, times: int = 1) -> list[BranchNode]:
    """Starting points of the branches that leave a special point.

    Parameters
    ----------
    special : SpecialPoint
        A flip (PD), from which a branch of twice the period leaves, a branch point (BP), or a
        grazing of rigid stops (GR), at which orbits with slight impacts begin. Of a curve in two
        parameters it may be any mark at which one of these holds, as on a curve of flips; the
        branches are those in the frequency.
    times : int
        At a grazing, the period of the orbits sought over that of the one that grazes. With more
        than 1 they have one slight impact in it.

    Returns
    -------
    list of BranchNode
        One at a flip; at a branch point one for each new half-branch, of a curve for each that
        meets there; at a grazing one for each kind of impacts. `continue_branch` goes on from the
        ``orbit`` of each.

    Raises
    ------
    SystemModelError
        For anything but such a special point, or ``times`` that is no whole number or
        not of a grazing.
    ConvergenceError, LocateError
        If Newton's method finds no orbit beside the special point.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, continue_branch, solve_orbit, switch_branch
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> branch = continue_branch(solve_orbit(system, frequency_hz=33.0), (32.5, 34.5))
    >>> switch_branch(branch.special_points[0])[0].orbit.period
    2
    """
    check_special("switch_branch", special, of_branch=False)
    check_whole("times", times, 1, LONGEST_PERIOD)
    if is_of_branch(special):
        return _switched(special.kind, special, times)
    found: list[BranchNode] = []
    failure: Exception = SystemModelError(
        f"switch_branch: no other branch leaves the {special.kind} point at {special.place()}: "
        "neither a flip (PD), a branch point (BP) nor a grazing (GR) is there"
    )
    for kind in _holding(special):
        try:
            found += _switched(kind, on_branch(special), times)
        except (LocateError, SystemModelError) as error:
            failure = error
    if not found:
        raise failure
    return found


def _holding(special: SpecialPoint) -> Iterator[str]:
    """Which of flip, branch point and grazing a mark of a curve is, by its name and the curve's."""
    condition = special.point.condition
    holds = {
        "PD": isinstance(condition, Singular) and condition.kind == "PD",
        "BP": isinstance(condition, BranchPointCondition),
        "GR": isinstance(condition, Grazing),
    }
    return (kind for kind, here in holds.items() if here or kind in special.kind)


def _switched(kind: str, special: SpecialPoint, times: int) -> list[BranchNode]:
    """First points of the branches that leave a special point of a kind."""
    if kind == "GR":
        return switch_at_rigid_grazing(special, times)
    if times > 1:
        raise SystemModelError(
            f"switch_branch: times is of grazing (GR) points, not of {kind} points"
        )
    if kind == "PD":
        return [switch_at_flip(replace(special, kind=kind))]
    if kind != "BP":
        raise SystemModelError(
            f"switch_branch: a branch is switched to at PD, BP and GR points, not at {kind} points"
        )
    if special.point.tangent.any():
        return list(switch_at_branch_point(special))
    ways = [replace(special.point, tangent=along) for along in crossing_tangents(special)]
    crossing = [SpecialPoint(kind, way, special.error) for way in ways]
    return [node for special in crossing for node in switch_at_branch_point(special)]
