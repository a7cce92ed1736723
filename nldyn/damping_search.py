"""Further branches by way of less damping, where they are joined to others."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from nldyn.branch import Branch
from nldyn.checkpoint import checkpoint_of_several
from nldyn.continuation import ContinuationOptions
from nldyn.damping import carried, damped
from nldyn.diagrams import Collector, Diagram, Progress
from nldyn.errors import SystemModelError, check_types, check_whole, is_finite, shown
from nldyn.flow import FlowMap
from nldyn.orbit import Orbit, same_orbit

FINEST_SPACING = 1e-5
PLACES = 3  # orbits of each branch that are carried to less damping


def by_less_damping(
    known: Diagram,
    factor: float = 0.5,
    *,
    max_period: int = 3,
    spacing: float = 0.002,
    options: ContinuationOptions | None = None,
    progress: Progress | None = None,
    checkpoint: str | Path | None = None,
) -> Diagram:
    """Find further branches where the modal damping is less and the branches known lead to them.

    Closed branches (isolas) grow when the damping falls, and join others. So the branches known are
    followed at a share of the damping; the orbits of these, at frequencies next to each other, are
    carried back to the damping of the system, and what lies on no known branch is on a new one.
    Isolas that join none of the branches known are not found; another factor may find more, as may
    another call with the branches found.

    Parameters
    ----------
    known : Diagram
        Branches of a system, from `diagram` or `explore`, with their orbits.
    factor : float
        Of the modal damping, between 0 and 1. Point dampers stay as they are.
    max_period : int
        Longest orbits carried, and wanted.
    spacing : float
        Largest relative distance of the frequencies at which orbits are carried back.
    options : ContinuationOptions, optional
        Step control.
    progress : callable, optional
        Called as ``progress(what, frequency_hz)``.
    checkpoint : str or Path, optional
        File that keeps the branches computed so far, as for `diagram`.

    Returns
    -------
    Diagram
        The branches known, then those found, with a note on what was tried.

    Raises
    ------
    SystemModelError
        For input that makes no sense, and for a system without modal damping.
    OutputError
        If `checkpoint` cannot be written.

    Examples
    --------
    >>> from nldyn import ExploreOptions, Stop, System, Unbalance, explore
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = explore(system, (48.0, 52.0), 2, effort=ExploreOptions(spacing=0.05, starts=4))
    >>> more = by_less_damping(found.diagram, max_period=2, spacing=0.02)
    >>> len(more.branches) >= len(found.diagram.branches)
    True
    """
    _check(known, factor, max_period, spacing, options, progress)
    own = known.branches[0].points[0].problem.flow
    low, high = known.range_hz
    options, progress = options or ContinuationOptions(), progress or (lambda what, hz: None)
    box = Collector(own, known.range_hz, known.observe, options, progress)
    box.checkpoint = checkpoint_of_several(checkpoint, box.branches, own, known.range_hz)
    box.take(known.branches, known.notes)
    for branch in known.branches:  # an interrupted run kept them, too
        if branch.course is not None:
            box.checkpoint.branch_from(branch.nodes[branch.course.start].orbit, branch.course)
    with box.checkpoint:
        less = _followed(known, own, math.log(factor), max_period, options, progress)
        count = math.ceil(math.log(high / low) / math.log1p(spacing))
        tried = came = 0
        for frequency in np.geomspace(low, high, count + 1)[1:-1].tolist():
            progress("back", frequency)
            orbits = [orbit for branch in less for orbit in branch.at(frequency)]
            carriages = (carried(own, orbit, math.log(factor), 0.0) for orbit in orbits)
            back = [orbit for orbit in carriages if orbit is not None]
            tried, came = tried + len(orbits), came + len(back)
            _follow_new(box, back, max_period)
    new = len(box.branches) - len(known.branches)
    box.notes.append(
        f"at {factor:g} of the damping: {_counted(len(less))}, {came} of {tried} orbits carried "
        f"back, {_counted(new)} found so"
    )
    return Diagram(tuple(box.branches), known.range_hz, known.observe, tuple(box.notes))


def _counted(number: int) -> str:
    return f"{number} branch" if number == 1 else f"{number} branches"


def _check(
    known: Diagram,
    factor: float,
    max_period: int,
    spacing: float,
    options: ContinuationOptions | None,
    progress: Progress | None,
) -> None:
    check_types(
        known=(known, Diagram),
        options=(options, ContinuationOptions, None),
        progress=(progress, Callable, None),
    )
    check_whole("max_period", max_period, 1)
    if not (is_finite(factor) and 0.0 < factor < 1.0):
        raise SystemModelError(f"factor must lie between 0 and 1, got {shown(factor)}")
    if not (is_finite(spacing) and FINEST_SPACING <= spacing < 1.0):
        raise SystemModelError(
            f"spacing must lie between {FINEST_SPACING:g} and 1, got {shown(spacing)}"
        )
    if not known.branches:
        raise SystemModelError("known: has no branches to begin with")
    if not np.any(known.branches[0].points[0].system.damping):
        raise SystemModelError("known: is of a system without modal damping")


def _followed(
    known: Diagram,
    own: FlowMap,
    log_factor: float,
    max_period: int,
    options: ContinuationOptions,
    progress: Progress,
) -> list[Branch]:
    """Branches at another damping to which those known lead."""
    box = Collector(damped(own, log_factor), known.range_hz, known.observe, options, progress)
    for branch in known.branches:
        if branch.period > max_period:
            continue
        for orbit in _spread(branch.points):
            progress("less damping", orbit.frequency_hz)
            other = carried(own, orbit, 0.0, log_factor)
            if other is not None:
                box.follow(other, max_period, max_period, None)
    return box.branches


def _spread(orbits: Sequence[Orbit]) -> list[Orbit]:
    """A few of some orbits, from the inside."""
    places = np.linspace(0.0, len(orbits) - 1.0, PLACES + 2)[1:-1]
    return [orbits[i] for i in sorted({round(place) for place in places.tolist()})]


def _follow_new(box: Collector, orbits: Sequence[Orbit], max_period: int) -> None:
    """Follow the orbits, all of one frequency, that lie on no branch of the box."""
    here: list[Orbit] = []
    seen = 0
    for orbit in orbits:
        for branch in box.branches[seen:]:
            here += branch.at(orbit.frequency_hz)
        seen = len(box.branches)
        if not any(same_orbit(orbit, other) for other in here):
            box.follow(orbit, max_period, max_period, None)
