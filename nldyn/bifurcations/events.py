"""Further special points of a branch: where a function of its orbits is zero or extremal."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, get_args

from nldyn.base.errors import (
    FAILURES,
    LocateError,
    SystemModelError,
    check_choice,
    is_finite,
    shown,
)
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.kinds import KINDS
from nldyn.bifurcations.locate import locate
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.orbits.bordered import FREE, correct
from nldyn.orbits.conditions import max_abs_displacement, phase_lag_deg
from nldyn.orbits.orbit import Orbit
from nldyn.system.chart import told_value

Where = Literal["zero", "maximum", "minimum"]
REACH = 3e-3  # arclength of a difference, whose error falls with its fourth power
ZERO = 1e-3  # of the values beside it, below which a function is zero where its sign changes
QUADRATURE_DEG = 90.0  # lag of a displacement at the resonance of its phase


@dataclass(frozen=True)
class Event:
    """A condition whose orbits are special points of a branch, beside bifurcations and grazings.

    Parameters
    ----------
    kind : str
        Short name in tables, legends and reports.
    function : callable
        Number of an orbit, smooth along a branch.
    where : {"zero", "maximum", "minimum"}
        What the function is there, along the branch. Two zeros between neighbouring points are
        missed, as is an extreme between them.

    Raises
    ------
    SystemModelError
        For a kind that is one of the bifurcations, or what is no function.

    Examples
    --------
    >>> from nldyn import System, Unbalance, continue_branch, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.1,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> wide = Event("9 µm", lambda orbit: orbit.max_abs_displacement - 9e-6)
    >>> branch = continue_branch(
    ...     solve_orbit(system, 10.0), (5.0, 20.0), events=["amplitude resonance", wide])
    >>> [special.kind for special in branch.special_points]
    ['9 µm', 'amplitude resonance', '9 µm']
    >>> round(branch.special_points[1].frequency_hz / 13.1 * (1 - 2 * 0.1**2) ** 0.5, 9)
    1.0
    """

    kind: str
    function: Callable[[Orbit], float]
    where: Where = "zero"

    def __post_init__(self) -> None:
        if not isinstance(self.kind, str) or not self.kind or self.kind in KINDS:
            raise SystemModelError(f"event: kind must be a name of its own, got {shown(self.kind)}")
        if not callable(self.function):
            raise SystemModelError(
                f"event '{self.kind}': function must be one of an orbit, got {shown(self.function)}"
            )
        check_choice(f"event '{self.kind}': where", self.where, get_args(Where))


Events = Sequence[str | Event | Callable[[Orbit], float]]


def _off_quadrature(orbit: Orbit) -> float:
    return phase_lag_deg(orbit) - QUADRATURE_DEG


EVENTS = {
    event.kind: event
    for event in (
        Event("amplitude resonance", max_abs_displacement, "maximum"),
        Event("amplitude antiresonance", max_abs_displacement, "minimum"),
        Event("phase resonance", _off_quadrature),
    )
}


def event_of(kind: str) -> Event:
    """An event by its kind; of one that is not of this module no file holds the function."""

    def missing(orbit: Orbit) -> float:
        raise SystemModelError(
            f"the event '{kind}' is a function of yours, which no file holds: pass events= again"
        )

    return EVENTS.get(kind) or Event(kind, missing)


def check_values(events: Sequence[Event], orbit: Orbit) -> None:
    """Refuse events whose functions give no number of an orbit."""
    for event in events:
        _value(event, orbit)


def checked_events(events: Events) -> tuple[Event, ...]:
    """Events from their names, themselves, or functions that are zero there.

    Raises
    ------
    SystemModelError
        For anything else, and for two of one kind.
    """
    if isinstance(events, str) or not isinstance(events, Sequence):
        raise SystemModelError(f"events must be a list, got {shown(events)}")
    found = []
    for event in events:
        if isinstance(event, str):
            check_choice("events", event, tuple(EVENTS))
            found.append(EVENTS[event])
        elif isinstance(event, Event):
            found.append(event)
        else:
            found.append(Event(getattr(event, "__name__", shown(event)), event))
    kinds = [event.kind for event in found]
    for kind in kinds:
        if kinds.count(kind) > 1:
            raise SystemModelError(f"events: '{kind}' is given twice")
    for event in found:
        if EVENTS.get(event.kind, event) != event:
            raise SystemModelError(f"event: the kind '{event.kind}' is that of another event")
    return tuple(found)


def events_along(
    event: Event, nodes: Sequence[BranchNode], *, closed: bool = False
) -> tuple[list[SpecialPoint], list[str]]:
    """Where an event happens along a branch, in order, and notes on what may be missing.

    Of a closed branch, the last point lies just beyond the first.

    Raises
    ------
    SystemModelError
        If the function gives no number.
    """
    sense = -1.0 if event.where == "minimum" else 1.0
    values = [sense * _value(event, node.orbit) for node in nodes]
    before, after = (values[-2], values[1]) if closed else (-math.inf, -math.inf)
    padded = [before, *values, after]
    found: list[SpecialPoint] = []
    notes: list[str] = []
    for number, (a, b) in enumerate(pairwise(nodes)):
        try:
            if event.where == "zero":
                found += _zero_between(event, a, b)
            else:
                found += _top_between(event, sense, a, b, padded[number : number + 4])
        except FAILURES as error:
            place = told_value(a.parameter, *sorted((a.value, b.value)), digits=8)
            notes.append(f"{event.kind} near {place} may be missing: {error}")
    return found, notes


def _value(event: Event, orbit: Orbit) -> float:
    value = event.function(orbit)
    if not is_finite(value):
        raise SystemModelError(
            f"event '{event.kind}': its function gives {shown(value)} at {orbit!r}"
        )
    return float(value)


def _zero_between(event: Event, a: BranchNode, b: BranchNode) -> list[SpecialPoint]:
    """Where the function is zero between two neighbouring points, if its sign changes there."""
    ends = _value(event, a.orbit), _value(event, b.orbit)
    if (ends[0] < 0.0) == (ends[1] < 0.0):
        return []
    special = locate(event.kind, Chord(a, b), lambda node: _value(event, node.orbit))
    if abs(_value(event, special.orbit)) > ZERO * max(map(abs, ends)):
        raise LocateError("its function jumps there")
    return [special]


def _top_between(
    event: Event, sense: float, a: BranchNode, b: BranchNode, values: Sequence[float]
) -> list[SpecialPoint]:
    """Where the function is extremal between two points, of which the neighbours tell.

    The values are those at four neighbours, the two points in the middle.
    """
    before, first, last, after = values
    rises = before <= first > last and sense * slope(event, a) > 0.0
    falls = first < last >= after and sense * slope(event, b) < 0.0
    if not (rises or falls):
        return []
    special = locate(event.kind, Chord(a, b), lambda node: slope(event, node))
    return [replace(special, error=special.error + REACH**4)]


def slope(event: Event, node: BranchNode) -> float:
    """Derivative of the function by the arclength of the branch, from four orbits beside.

    Raises
    ------
    LocateError
        If one of them is not found.
    """
    row = node.family.metric(node.point) * node.tangent

    def beside(steps: int) -> float:
        guess = node.point + steps * REACH * node.tangent
        found = correct(node.family, guess, FREE, row, like=node.orbit.motion)
        if not found.converged:
            raise LocateError(found.failure)
        return _value(event, found.orbit)

    return (8.0 * (beside(1) - beside(-1)) - beside(2) + beside(-2)) / (12.0 * REACH)
