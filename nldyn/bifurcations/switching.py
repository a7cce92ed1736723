"""From a special point of a branch to the branches that leave it."""

from __future__ import annotations

from nldyn.base.errors import SystemModelError
from nldyn.bifurcations.normal_forms import switch_at_branch_point
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.bifurcations.point import BranchNode, SpecialPoint, check_special


def switch_branch(special: SpecialPoint) -> list[BranchNode]:
    """Starting points of the branches that leave a special point.

    Parameters
    ----------
    special : SpecialPoint
        A flip (PD), from which a branch of twice the period leaves, or a branch point (BP).

    Returns
    -------
    list of BranchNode
        One at a flip; at a branch point one for each new half-branch. `continue_branch` goes on
        from the ``orbit`` of each.

    Raises
    ------
    SystemModelError
        For anything but such a special point of a branch.
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
    if special.kind == "PD":
        return [switch_at_flip(special)]
    if special.kind == "BP":
        return list(switch_at_branch_point(special))
    raise SystemModelError(
        f"switch_branch: a branch is switched to at PD and BP points, not at {special.kind} points"
    )
