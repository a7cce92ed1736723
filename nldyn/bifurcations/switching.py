"""From a special point of a branch to the branches that leave it."""

from __future__ import annotations

from nldyn.base.errors import SystemModelError, check_whole
from nldyn.bifurcations.beyond_rigid_grazing import switch_at_rigid_grazing
from nldyn.bifurcations.normal_forms import switch_at_branch_point
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.bifurcations.point import BranchNode, SpecialPoint, check_special
from nldyn.orbits.shooting import LONGEST_PERIOD


def switch_branch(special: SpecialPoint, *, times: int = 1) -> list[BranchNode]:
    """Starting points of the branches that leave a special point.

    Parameters
    ----------
    special : SpecialPoint
        A flip (PD), from which a branch of twice the period leaves, a branch point (BP), or a
        grazing of rigid stops (GR), at which orbits with slight impacts begin.
    times : int
        At a grazing, the period of the orbits sought over that of the one that grazes. With more
        than 1 they have one slight impact in it.

    Returns
    -------
    list of BranchNode
        One at a flip; at a branch point one for each new half-branch; at a grazing one for each
        kind of impacts. `continue_branch` goes on from the ``orbit`` of each.

    Raises
    ------
    SystemModelError
        For anything but such a special point of a branch, or ``times`` that is no whole number or
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
    check_special("switch_branch", special)
    check_whole("times", times, 1, LONGEST_PERIOD)
    if special.kind == "GR":
        return switch_at_rigid_grazing(special, times)
    if times > 1:
        raise SystemModelError(
            f"switch_branch: times is of grazing (GR) points, not of {special.kind} points"
        )
    if special.kind == "PD":
        return [switch_at_flip(special)]
    if special.kind == "BP":
        return list(switch_at_branch_point(special))
    raise SystemModelError(
        "switch_branch: a branch is switched to at PD, BP and GR points, not at "
        f"{special.kind} points"
    )
