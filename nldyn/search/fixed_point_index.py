"""Indices of fixed points: they add up to one at any value, unless orbits are missing there."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_whole, is_finite, shown
from nldyn.branches.branch import Branch, check_branches
from nldyn.branches.endings import Ending
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.axis import Axis
from nldyn.orbits.orbit import Orbit
from nldyn.system.chart import moves_frequency
from nldyn.system.system import System

RESOLVED = 1e-8  # relative width of a range of frequencies that counts
CLEAR = 1e-6  # distance of |1 - μ| from where an index changes, to be told from it
NOTE = "indices of the fixed points of "  # how the note on them begins
SAME = 1e-12  # relative difference of frequencies that are one


def index_sum(branches: Iterable[Branch], value: float, period: int = 1) -> int:
    """Sum of the indices of all fixed points of Pⁿ on some branches, at one value.

    P takes the state over one period of the excitation. A fixed point has the index +1 or -1, the
    sign of det(I - DPⁿ), that is of ∏(1 - μᵢ). Motions of a structure with damping in all of its
    modes, forced periodically and held back by stops, end in a ball that Pⁿ maps into itself,
    whatever the stiffness of the stops; then the indices of all fixed points of Pⁿ add up to one
    [Krasnosel'skii 1968, chapter 2]. Another sum proves that orbits whose period divides n are
    missing from the branches, or that a branch was broken off.

    The converse does not hold: the two halves of an isola have opposite indices.

    Parameters
    ----------
    branches : iterable of Branch
        Of one system, each of them once; those of a `Diagram`, for example.
    value : float
        Excitation frequency in Hz, or value of the parameter, within the range that the branches
        were followed in.
    period : int
        Number n of excitation periods.

    Returns
    -------
    int
        Every orbit of period p counts p times, once for each of its points.

    Raises
    ------
    SystemModelError
        If the value or the period is none, the value lies outside the range that a branch
        was followed in, there is no branch, they are of several systems, or a mode is not damped.

    References
    ----------
    M. A. Krasnosel'skii (1968), *The Operator of Translation along the Trajectories of Differential
    Equations*, American Mathematical Society.

    Examples
    --------
    At 12.15 Hz the superharmonic resonance has two stable orbits and an unstable one.

    >>> from nldyn import Stop, System, Unbalance, continue_branch, index_sum, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> branch = continue_branch(solve_orbit(system, 13.0), (11.0, 14.0))
    >>> [orbit.stable for orbit in branch.at(12.15)], index_sum([branch], 12.15)
    ([True, False, True], 1)
    """
    given = _checked("index_sum", branches, period, value, value)
    return sum_of_indices([o for branch in given for o in branch.at(value)], period)


def index_gaps(
    branches: Iterable[Branch], limits: tuple[float, float], period: int = 1
) -> list[tuple[float, float]]:
    """Ranges in which the indices of the fixed points of Pⁿ do not add up to one.

    Along each branch the index is that of the computed orbits; it changes at folds, where branches
    cross and, for even multiples of the branch's period, at flips. So the sum is known all over the
    range, without solving for any orbit. Within the ranges given orbits are missing, see
    `index_sum`, or a closed branch that was broken off, behind where it had begun, is there twice.
    Ranges narrower than 1e-8 of the frequency are left out: a branch may not end quite at the flip
    where it is born.

    Parameters
    ----------
    branches : iterable of Branch
        Of one system, each of them once; those of a `Diagram`, for example.
    limits : (float, float)
        Frequencies in Hz, or values of the parameter, ascending, within the range that the branches
        were followed in.
    period : int
        Number n of excitation periods.

    Returns
    -------
    list of (float, float)
        Ascending; none if the sum is one everywhere.

    Raises
    ------
    SystemModelError
        As `index_sum`.

    Examples
    --------
    From a flip of the harmonic branch on, its doubled branch is not among those given.

    >>> from nldyn import Stop, System, Unbalance, continue_branch, solve_orbit
    >>> from nldyn.search.fixed_point_index import index_gaps
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> branch = continue_branch(solve_orbit(system, 40.0), (30.0, 60.0))
    >>> index_gaps([branch], (30.0, 60.0))
    []
    >>> [(round(a, 2), round(b, 2)) for a, b in index_gaps([branch], (30.0, 60.0), 2)]
    [(33.65, 60.0)]
    """
    low, high = limits
    given = _checked("index_gaps", branches, period, low, high)
    chart = given[0].nodes[0].family.charts[0]
    ends, rise = _changes(given, period)
    first, last = chart.coordinate(low), chart.coordinate(high)
    wrong: list[tuple[float, float]] = []
    order = np.argsort(ends, kind="stable")
    ends = np.concatenate([[first], np.clip(ends[order], first, last), [last]])
    sums = np.concatenate([[0], np.cumsum(rise[order])])
    for a, b, total in zip(ends[:-1], ends[1:], sums, strict=True):
        if total == 1 or b <= a:
            continue
        if wrong and wrong[-1][1] == a:
            wrong[-1] = (wrong[-1][0], b)
        else:
            wrong.append((a, b))
    wide = [gap for gap in wrong if gap[1] - gap[0] > RESOLVED]
    return [(chart.value(a), chart.value(b)) for a, b in wide]


def _checked(
    caller: str, branches: Iterable[Branch], period: int, low: float, high: float
) -> list[Branch]:
    """Those of some branches whose period divides n, checked.

    Raises
    ------
    SystemModelError
        As `index_sum`.
    """
    branches = list(branches) if isinstance(branches, Iterable) else branches
    check_branches("branches", branches)
    check_whole("period", period, 1)
    if not (is_finite(low) and is_finite(high) and low <= high):
        asked = shown(low if low is high else (low, high))
        raise SystemModelError(f"{caller}: needs finite values, ascending, got {asked}")
    if not branches:
        raise SystemModelError(f"{caller}: branches must not be empty")
    first = branches[0].nodes[0].family
    held = None if moves_frequency(first.charts[0].parameter) else first.frequency_hz
    axis = Axis(first.charts[0], held)
    for branch in branches:
        a, b = branch.course.limits if branch.course else (-math.inf, math.inf)
        if not a - SAME * abs(a) <= low <= high <= b + SAME * abs(b):
            raise SystemModelError(
                f"{caller}: branch '{branch.name}' was followed from {axis.told_span(a, b)}, "
                f"which does not tell of {axis.told_span(low, high)}"
            )
    flow = first.problem.flow
    if not all(
        axis.is_along(branch.nodes[0]) and axis.is_of(flow, branch.nodes[0].family.problem.flow)
        for branch in branches
    ):
        raise SystemModelError(
            f"{caller}: the branches must be of one system and accuracy, in one parameter"
        )
    counted = [branch for branch in branches if period % branch.period == 0]
    if not all(is_damped(axis.at(flow, value).flow.system) for value in {low, high}):
        raise SystemModelError(
            f"{caller}: the indices add up to one only where every mode is damped, but one is not"
        )
    return counted


def _changes(branches: Sequence[Branch], period: int) -> tuple[Real, NDArray[np.int_]]:
    """Places on the parameter's scale at which the sum of the indices changes, and by how much."""
    ends, rises = [np.empty(0)], [np.empty(0, dtype=int)]
    for branch in branches:
        x, signs = _along(branch, period // branch.period)
        a, b = np.minimum(x[:-1], x[1:]), np.maximum(x[:-1], x[1:])
        ends += [a, b]
        rises += [branch.period * signs, -branch.period * signs]
    return np.concatenate(ends), np.concatenate(rises)


def _along(branch: Branch, times: int) -> tuple[Real, NDArray[np.int_]]:
    """Places of a branch on the parameter's scale, and the index between each and the next one.

    That is that of the end whose multipliers are clear of where it changes, or follows from what is
    next to it along the branch. At a branch point it changes unless what is clear on both sides
    says that it does not: a branch that leaves there to one side only comes back with the same.
    """
    places = list(branch.places.points)
    if branch.stop_reasons[1].ending is Ending.CLOSED_BRANCH:
        places[-1] = places[0]  # beyond which it lies
    changing = {"LP", "BP", "PD"} if times % 2 == 0 else {"LP", "BP"}
    special = {id(s.point): s.kind for s in branch.special_points if s.kind in changing}
    kinds = [special.get(id(place), "") for place in places]
    clear = [
        0.0 if kind else _distance(place.orbit, times)
        for place, kind in zip(places, kinds, strict=True)
    ]
    signs = []
    for i in range(len(places) - 1):
        best = i if clear[i] >= clear[i + 1] else i + 1
        signs.append(index(places[best].orbit, times) if clear[best] > CLEAR else 0)
    _fill(signs, kinds)
    return np.array([place.point[-1] for place in places]), np.array(signs, dtype=int)


def _fill(signs: list[int], kinds: Sequence[str]) -> None:
    """Set the signs that are not clear, zero so far, from those that are.

    `kinds` names the special points, among the places between them, at which the sign may change.
    """
    turn = [-1 if kind else 1 for kind in kinds]
    known = [i for i, sign in enumerate(signs) if sign]
    for a, b in pairwise(known):
        crossings = [i for i in range(a + 1, b + 1) if kinds[i] == "BP"]
        if crossings and signs[a] * math.prod(turn[a + 1 : b + 1]) != signs[b]:
            turn[crossings[0]] = 1
    for i in range(1, len(signs)):
        signs[i] = signs[i] or signs[i - 1] * turn[i]
    for i in range(len(signs) - 2, -1, -1):
        signs[i] = signs[i] or signs[i + 1] * turn[i + 1]


def _distance(orbit: Orbit, times: int) -> float:
    """How far an orbit is from where its index changes: the smallest of |1 - μᵢ^times|."""
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.nanmin(np.abs(orbit.multipliers**times - 1.0), initial=math.inf))


def index_note(branches: Sequence[Branch], axis: Axis, longest: int) -> str:
    """Whether the indices of the fixed points of P to P^longest add up to one, in a sentence."""
    powers = "P" if longest == 1 else f"P to {_power(longest)}"
    told = f"{NOTE}{powers} add up to one from {axis.told_span(*axis.limits)}"
    wrong = []
    for n in range(1, longest + 1):
        gaps = index_gaps(branches, axis.limits, n) if branches else [axis.limits]
        if gaps:
            ranges = f"in {len(gaps)} ranges " if len(gaps) > 1 else ""
            span = axis.told_span(gaps[0][0], gaps[-1][1], digits=10)
            wrong.append(f"{_power(n)} {ranges}from {span}")
    if not wrong:
        return f"{told}; isolas that are missing as a whole would not change that"
    return f"{told} but for {', '.join(wrong)}: orbits are missing, or a branch was broken off"


def _power(n: int) -> str:
    return "P" if n == 1 else f"P^{n}"


def without_index_note(notes: Iterable[str]) -> list[str]:
    """Notes but those of `index_note`, which hold no longer once branches are added."""
    return [note for note in notes if not note.startswith(NOTE)]


def sum_of_indices(orbits: Iterable[Orbit], period: int) -> int:
    """Sum of the indices of the fixed points of Pⁿ on orbits, whose own period divides n."""
    return sum(o.period * index(o, period // o.period) for o in orbits if period % o.period == 0)


def index(orbit: Orbit, times: int = 1) -> int:
    """Sign of det(I - DPⁿ) with n = `times` periods of an orbit: the sign of ∏(1 - μᵢ^times).

    Complex multipliers come in pairs that contribute a positive factor, so that only real ones
    outside of the unit circle count.
    """
    real = np.real(orbit.multipliers[np.imag(orbit.multipliers) == 0.0])
    outside = np.abs(real) > 1.0 if times % 2 == 0 else real > 1.0
    return 1 - 2 * (int(np.count_nonzero(outside)) % 2)


def is_damped(system: System) -> bool:
    """Whether every mode of the structure without its stops loses energy."""
    return system.linear.slowest_decay > 0.0


def is_damped_along(axis: Axis, flow: FlowMap) -> bool:
    """Whether every mode loses energy at both ends of a range and in its middle."""
    places = (*axis.limits, axis.between(*axis.limits, 0.5))
    return all(is_damped(axis.at(flow, value).flow.system) for value in places)
