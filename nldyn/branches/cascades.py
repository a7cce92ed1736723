"""Period-doubling cascades: from flip to flip, and the ratios of their distances."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from nldyn.base.errors import FAILURES, LocateError, SystemModelError, check_types, check_whole
from nldyn.bifurcations.normal_form_coefficients import (
    Estimate,
    doubled_parameter,
    flip,
    loop_of,
)
from nldyn.bifurcations.period_doubling import switch_at_flip
from nldyn.bifurcations.point import BranchNode, SpecialPoint, check_special, is_at, on_branch
from nldyn.bifurcations.sliding import sliding_points_between
from nldyn.bifurcations.within_step import special_points_between
from nldyn.branches.arclength import Stepper
from nldyn.branches.branch import Branch, check_branches
from nldyn.branches.continuation import make_branch
from nldyn.branches.endings import Ending
from nldyn.branches.step_control import ContinuationOptions
from nldyn.system.chart import BOUNDS, Chart, told_value

FEIGENBAUM = 4.669201609102991  # limit of the ratios, Feigenbaum (1978)
POINTS_BETWEEN = 8  # of a doubled branch up to its flip, if that lies where it is expected
SHORTEST = 1e-4  # of the longest step: one from which a doubled branch is not followed on


@dataclass(frozen=True, eq=False)
class Cascade:
    """Flips that follow each other: of an orbit, of its doubled orbit, and so on.

    Parameters
    ----------
    flips : tuple of SpecialPoint
        At the n-th the period goes from ``flips[n].orbit.period`` to twice that.
    branches : tuple of Branch
        The doubled branches from each flip up to the next, or as far as they were followed.
    stop_reason : str
        Why there are no more flips.
    """

    flips: tuple[SpecialPoint, ...]
    branches: tuple[Branch, ...]
    stop_reason: str

    def __repr__(self) -> str:
        """One line: the flips and why there are no more."""
        values = [flip.value for flip in self.flips]
        places = told_value(self.flips[0].point.parameter, *values, digits=8) if values else "none"
        return f"<Cascade of flips at {places.replace(' and ', ', ')}; {self.stop_reason}>"

    @property
    def ratios(self) -> list[Estimate]:
        r"""Ratios :math:`\delta_n = (p_n - p_{n-1}) / (p_{n+1} - p_n)` with their errors.

        They tend to 4.669 [Feigenbaum 1978], and do so once the damping over the doubled period is
        strong: as long as the determinant of the monodromy matrix is near 1 they stay near 8.72,
        the value of conservative systems [Zisook 1981].
        """
        found = []
        for n in range(1, len(self.flips) - 1):
            before, here, after = self.flips[n - 1 : n + 2]
            gap, next_gap = here.value - before.value, after.value - here.value
            errors = [s.value_error for s in (before, here, after)]
            share = (errors[0] + errors[1]) / abs(gap) + (errors[1] + errors[2]) / abs(next_gap)
            found.append(Estimate(gap / next_gap, abs(gap / next_gap) * share))
        return found

    @property
    def limit(self) -> float:
        """Where the cascade accumulates if the last ratio stayed; nan before there is one."""
        if not self.ratios:
            return math.nan
        ratio = self.ratios[-1].value
        last = self.flips[-1].value
        return last + (last - self.flips[-2].value) / (ratio - 1.0)

    def describe(self) -> str:
        """Say in a few lines where the flips are and what their ratios are."""
        lines = [f"{s.orbit.period} -> {2 * s.orbit.period} at {s.place(9)}" for s in self.flips]
        if self.ratios:
            ratios = ", ".join(f"{ratio.value:.4g}" for ratio in self.ratios)
            lines.append(f"ratios {ratios} (they tend to 4.669)")
        return "\n".join([*lines, f"then: {self.stop_reason}"])


def cascade(
    first: SpecialPoint,
    depth: int = 4,
    *,
    limits: tuple[float, float] | None = None,
    options: ContinuationOptions | None = None,
) -> Cascade:
    """Follow a period-doubling cascade from its first flip.

    From each flip the doubled branch is followed up to the flip at which it becomes unstable. Its
    steps are chosen by the normal form: the next flip is expected 4.669 times nearer than this one
    was, which lies at a known amplitude.

    Parameters
    ----------
    first : SpecialPoint
        A flip (PD).
    depth : int
        How many further flips to look for.
    limits : (float, float), optional
        Values of the branch's parameter within which to stay; from half to twice that of the flip
        unless given, or those of its branch where the parameter may be negative.
    options : ContinuationOptions, optional
        Step control; the steps become shorter with every doubling.

    Returns
    -------
    Cascade

    Raises
    ------
    SystemModelError
        If the special point is not a flip, or the range is empty.

    References
    ----------
    M. J. Feigenbaum (1978), *J. Stat. Phys.* 19; A. B. Zisook (1981), *Phys. Rev. A* 24.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, continue_branch, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> branch = continue_branch(solve_orbit(system, 33.0), (32.0, 34.0))
    >>> [flip.orbit.period for flip in cascade(branch.special_points[0], 2).flips]
    [1, 2, 4]
    """
    check_special("cascade", first, "PD", of_branch=False)
    check_types(options=(options, ContinuationOptions, None))
    check_whole("cascade: depth", depth, 1, 30)
    first = on_branch(first)
    chart = _window(first, limits)
    if not chart.low < first.value < chart.high:
        raise SystemModelError(
            f"the flip at {first.place()} lies outside {chart.range_name} = ({chart.low:g}, "
            f"{chart.high:g})"
        )
    window = chart.low, chart.high
    flips, branches, reason = [first], list[Branch](), f"depth {depth} reached"
    for _ in range(depth):
        try:
            branch, following = _up_to_flip(flips, window, options or ContinuationOptions())
        except LocateError as error:
            reason = str(error)
            break
        branches.append(branch)
        if following is None:
            reason = f"the branch of period {branch.period} has no such flip: {branch.stop_reason}"
            break
        flips.append(following)
    return Cascade(tuple(flips), tuple(branches), reason)


def _window(first: SpecialPoint, limits: tuple[float, float] | None) -> Chart:
    """The chart of the branch of a flip over a range."""
    chart = first.point.family.charts[0]
    if limits is not None:
        return chart.over(limits)
    if not chart.logarithmic:
        return chart
    least, most = BOUNDS.get(chart.parameter.name, (0.0, math.inf))
    return chart.over((max(0.5 * first.value, least), min(2.0 * first.value, most)))


def cascades_in(branches: Sequence[Branch]) -> list[Cascade]:
    """Cascades of at least three flips among branches that `nldyn.diagram` has found.

    Parameters
    ----------
    branches : sequence of Branch
        Those of a diagram with several doublings.

    Returns
    -------
    list of Cascade
        Each from the flip of an orbit that is not itself born at a flip.
    """
    check_branches("branches", branches)
    ends = [
        (b, end) for b in branches for end in (0, -1) if b.stop_reasons[end].ending is Ending.JOINS
    ]
    flips = [(b, special) for b in branches for special in b.special_points if special.kind == "PD"]
    born = {
        id(flip): (branch, end)
        for branch, end in ends
        for _, flip in flips
        if is_at(branch.nodes[end].orbit, flip, 2)
    }
    children = {id(branch) for branch, _ in born.values()}
    found = []
    for parent, first in flips:
        if id(parent) in children:
            continue
        passed, grown = [first], list[Branch]()
        while (following := born.get(id(passed[-1]))) is not None:
            grown.append(following[0])
            lost = _loss_of_stability(*following)
            if lost is None:
                break
            passed.append(lost)
        if len(passed) > 2:
            found.append(Cascade(tuple(passed), tuple(grown), "no further branch"))
    return found


def _loss_of_stability(branch: Branch, end: int) -> SpecialPoint | None:
    """The flip at which a branch, followed from one of its ends, loses its stability."""
    way = 1 if end == 0 else -1
    lengths = [node.arclength for node in branch.nodes]
    stable = [node.orbit.stable for node in branch.nodes]
    for special in branch.special_points[::way]:
        after = int(np.searchsorted(lengths, special.point.arclength))
        if special.kind == "PD" and 0 < after < len(stable):
            before_it, behind_it = stable[after - 1 : after + 1][::way]
            if before_it and not behind_it:
                return special
    return None


def _up_to_flip(
    flips: list[SpecialPoint], window: tuple[float, float], options: ContinuationOptions
) -> tuple[Branch, SpecialPoint | None]:
    """The branch born at the last flip, up to the flip where it loses its stability."""
    amplitude, options = _steps(flips, options)
    walk = Stepper(switch_at_flip(flips[-1], amplitude), window, options)
    nodes: list[BranchNode] = []
    specials: list[SpecialPoint] = []
    following = None
    for point, met in _with_special_points(walk):
        specials += met
        lost = [s for s in met if s.kind == "PD"]
        if lost and nodes[-1].orbit.stable and not point.orbit.stable:
            following = lost[0]
        nodes.append(point)
        if following is not None:
            break
    reason = walk.stop_reason if following is None else Ending.FLIP.told()
    first = Ending.BEGINS_AT_FLIP.told(place=flips[-1].place())
    return make_branch("", nodes, specials, (first, reason), []), following


def _special_points(a: BranchNode, b: BranchNode) -> list[SpecialPoint]:
    """All special points between two neighbouring points, in order."""
    found = [*special_points_between(a, b), *sliding_points_between(a, b)[0]]
    return sorted(found, key=lambda special: special.point.arclength)


def _with_special_points(walk: Stepper) -> Iterator[tuple[BranchNode, list[SpecialPoint]]]:
    """Points of a walk with the special points between each and the one before."""
    before: BranchNode | None = None
    for point in walk:
        yield point, [] if before is None else _special_points(before, point)
        before = point


def _steps(
    flips: list[SpecialPoint], options: ContinuationOptions
) -> tuple[float, ContinuationOptions]:
    """Amplitude of the first step off a flip, and step control up to the next one."""
    if len(flips) < 2:
        return 0.5 * options.max_step, options
    gap = abs(flips[-1].point.point[-1] - flips[-2].point.point[-1]) / FEIGENBAUM
    try:
        shift = doubled_parameter(flip(loop_of(flips[-1].point))[0]).value
    except FAILURES:
        shift = math.nan
    reach = math.sqrt(gap / abs(shift)) if shift else math.nan
    if not math.isfinite(reach):
        return 0.5 * options.max_step, options
    longest = min(options.max_step, reach / POINTS_BETWEEN)
    shorter = replace(
        options,
        max_step=longest,
        first_step=min(options.first_step, longest),
        grazing_step=min(options.grazing_step, longest),
        min_step=min(options.min_step, SHORTEST * longest),
    )
    return longest, shorter
