"""Branches of periodic orbits: points, special points, and orbits between the points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_choice, check_types, shown
from nldyn.base.html_tables import html_table
from nldyn.bifurcations.events import Event, Events, checked_events, events_along
from nldyn.bifurcations.kinds import KINDS
from nldyn.bifurcations.point import BranchNode, SpecialPoint
from nldyn.branches.at_frequency import Places, crossings, passes
from nldyn.branches.endings import StopReasons
from nldyn.branches.tables import Part, point_columns, special_columns, to_pandas, to_xarray
from nldyn.orbits.bordered import FREE
from nldyn.orbits.orbit import Orbit, same_orbit
from nldyn.system.chart import FREQUENCY, label_of, parameter_name, told_value
from nldyn.system.parameters import Parameter

if TYPE_CHECKING:
    import pandas
    import xarray

    from nldyn.branches.step_control import ContinuationOptions


def check_branches(name: str, branches: object) -> None:
    """Refuse anything but a list of branches, or what has their columns, under its name.

    Raises
    ------
    SystemModelError
        As said.
    """
    columns = ("period", "points", "special_points", "stop_reasons")
    if not isinstance(branches, list | tuple) or not all(
        isinstance(branch, Branch) or all(hasattr(branch, column) for column in columns)
        for branch in branches
    ):
        raise SystemModelError(f"{name} must be a list of branches, got {shown(branches)}")


@dataclass(frozen=True, eq=False)
class WalkEnd:
    """How a continuation would go on from one end of a branch as if it had not stopped.

    Parameters
    ----------
    step : float
        Arclength of the next step.
    behind : (2m, N + 1)
        Unknowns and tangent of the points before the one to go on from, the last one
        first; no rows at a start.
    count : int
        Steps made.
    node : int
        Number of the point to go on from, counted from where the continuation started.
    kept : int
        Number of points before it that stay, whatever follows.
    special_points, notes : int
        How many belong to these.
    """

    step: float
    behind: Real
    count: int
    node: int
    kept: int
    special_points: int
    notes: int


@dataclass(frozen=True, eq=False)
class Course:
    """How a branch was continued, as far as its extension depends on that.

    Parameters
    ----------
    limits : (float, float)
        Values of the parameter between which to stay, of several the first.
    options : ContinuationOptions
        Step control.
    open_ends : (m, N + 1) array
        Where other branches were broken off.
    at : sequence of float
        Values at which orbits were requested.
    start : int
        Point at which the continuation started; it went forward, then backward.
    special_points_before, notes_before : int
        How many of these were found on the way backward.
    ends : pair of WalkEnd
        How the ways backward and forward would go on; None for a way that there is not.
    events : tuple of Event
        What else its special points are, searched when the branch is whole.
    further : tuple of (float, float)
        Values of further parameters between which to stay.
    """

    limits: tuple[float, float]
    options: ContinuationOptions
    open_ends: Real
    at: Sequence[float] = ()
    start: int = 0
    special_points_before: int = 0
    notes_before: int = 0
    ends: tuple[WalkEnd | None, WalkEnd | None] = (None, None)
    events: tuple[Event, ...] = ()
    further: tuple[tuple[float, float], ...] = ()

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """Values of all parameters between which to stay."""
        return self.limits, *self.further


@dataclass(frozen=True, eq=False, repr=False)
class Branch:
    """A curve of periodic orbits of one period multiple, in the frequency or another parameter.

    So is one in two parameters whose orbits meet a condition, see `nldyn.curves.Curve`.

    Parameters
    ----------
    name : str
        Name in tables and legends.
    period : int
        Period multiple n.
    nodes : tuple of BranchNode
        Computed points in order along the branch.
    special_points : tuple of SpecialPoint
        In the same order.
    stop_reasons : tuple of StopReason
        Why the continuation stopped at the first and at the last point.
    notes : tuple of str
        What may be missing.
    requested : tuple of BranchNode
        Points at the requested values, in order along the branch.
    course : Course, optional
        How it was continued.
    """

    name: str
    period: int
    nodes: tuple[BranchNode, ...]
    special_points: tuple[SpecialPoint, ...]
    stop_reasons: StopReasons
    notes: tuple[str, ...] = ()
    requested: tuple[BranchNode, ...] = ()
    course: Course | None = None

    def __repr__(self) -> str:
        """One line, in place of all numbers of all orbits."""
        values = self.values
        span = told_value(self.parameter, float(values.min()), float(values.max()))
        return (
            f"<Branch '{self.name}': period {self.period}, {len(values)} points from "
            f"{span.replace(' and ', ' to ')}, {len(self.special_points)} special points; "
            f"{self.stop_reason}>"
        )

    def _repr_html_(self) -> str:
        """The special points, a row each."""
        rows = [(s.kind, f"{s.value:.9g}", f"{s.error:.1g}") for s in self.special_points]
        return html_table(repr(self), ("kind", label_of(self.parameter), "relative error"), rows)

    @property
    def parameter(self) -> Parameter:
        """What changes along the branch."""
        return self.nodes[0].parameter

    @property
    def values(self) -> Real:
        """Values of the parameter at the points."""
        return np.array([node.value for node in self.nodes])

    @property
    def span(self) -> tuple[float, float]:
        """Lowest and highest value of the parameter, also of the special points."""
        reached = [place.value for place in self.places.points]
        return min(reached), max(reached)

    @property
    def points(self) -> list[Orbit]:
        """The orbits, in order."""
        return [node.orbit for node in self.nodes]

    @property
    def closed(self) -> bool:
        """Whether the branch ends where it began: its last point lies just beyond its first."""
        return any(reason.closes for reason in self.stop_reasons)

    @property
    def stop_reason(self) -> str:
        """Why the continuation stopped at either end, in one line."""
        return " / ".join(self.stop_reasons)

    @property
    def frequency_hz(self) -> Real:
        """Frequencies of the points in Hz; folds lie between them, see `span_hz`."""
        return np.array([orbit.frequency_hz for orbit in self.points])

    @property
    def span_hz(self) -> tuple[float, float]:
        """Lowest and highest frequency in Hz, also of the special points between the points."""
        reached = [place.orbit.frequency_hz for place in self.places.points]
        return min(reached), max(reached)

    @property
    def max_abs_displacement(self) -> Real:
        """Largest absolute displacements in m."""
        return np.array([orbit.max_abs_displacement for orbit in self.points])

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Stability of the points."""
        return np.array([orbit.stable for orbit in self.points])

    @cached_property
    def places(self) -> Places:
        """Points and special points together, in order along the branch."""
        points = [*self.nodes, *(special.point for special in self.special_points)]
        return Places(tuple(sorted(points, key=lambda point: point.arclength)))

    def at(self, value: float) -> list[Orbit]:
        """All orbits of the branch at one value of its parameter, in order along it.

        Parameters
        ----------
        value : float
            A frequency in Hz, or in the parameter's unit; that of the orbits differs from it by the
            rounding error of its logarithm only, very near to the end of a doubled branch by up to
            1e-12 of it.

        Returns
        -------
        list of Orbit
            One for each passage of the branch, also of both that are close to a fold; an orbit
            passed again, if only shifted by whole periods of the excitation, counts once.

        Raises
        ------
        SystemModelError
            If the parameter cannot have this value.

        Examples
        --------
        >>> from nldyn import System, Unbalance, continue_branch, solve_orbit
        >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
        ...     excitation=[Unbalance("middle", 4.92e-6)])
        >>> branch = continue_branch(solve_orbit(system, frequency_hz=10.0), (5.0, 20.0))
        >>> [round(orbit.frequency_hz, 12) for orbit in branch.at(12.5)]
        [12.5]
        """
        found: list[Orbit] = []
        for point in crossings(self.places, value):
            if not any(same_orbit(point.orbit, other) for other in found):
                found.append(point.orbit)
        return found

    @property
    def bifurcations(self) -> list[SpecialPoint]:
        """The special points that are no events."""
        on_curve = self.nodes[0].condition is not FREE
        return [s for s in self.special_points if on_curve or s.kind in KINDS]

    def with_events(self, events: Events) -> Branch:
        """The same branch, whose special points beside bifurcations and grazings are some events.

        Parameters
        ----------
        events : sequence of str, Event or callable
            As for `continue_branch`.

        Returns
        -------
        Branch
            It goes on with them.

        Raises
        ------
        SystemModelError
            For events that make no sense.
        """
        chosen = checked_events(events)
        special, notes = self.bifurcations, list(self.notes)
        for event in chosen:
            found, lost = events_along(event, self.nodes, closed=self.closed)
            special += found
            notes += [note for note in lost if note not in notes]
        special.sort(key=lambda s: s.point.arclength)
        course = self.course and replace(self.course, events=chosen)
        return replace(self, special_points=tuple(special), notes=tuple(notes), course=course)

    def table(self, part: Part = "points") -> dict[str, NDArray[Any]]:
        """Columns of numbers, one row per orbit; ``pandas.DataFrame`` takes them as they are.

        Parameters
        ----------
        part : {"points", "special_points", "requested"}
            Which orbits: row i belongs to ``branch.points[i]``, ``branch.special_points[i]`` or
            ``branch.requested[i]``.

        Returns
        -------
        dict of str to (n,) array
            Units stand in the names, but for those of a parameter that is not the frequency: its
            values stand first, in SI units. `largest_multiplier` is a modulus, `error` relative.

        Raises
        ------
        SystemModelError
            For an unknown part.
        """
        check_choice("table: part", part, get_args(Part))
        course = self.course
        known = (*course.limits, *course.at) if course else ()
        columns = point_columns(self._part(part), known)
        if self.parameter.name != FREQUENCY:
            values = [node.value for node in self._part(part)]
            columns = {parameter_name(self.parameter): np.array(values, dtype=float), **columns}
        if part == "special_points":
            return special_columns(self.special_points, columns, self.parameter)
        return columns

    def _part(self, part: Part) -> Sequence[BranchNode]:
        """The points of which a table is made."""
        if part == "special_points":
            return [special.point for special in self.special_points]
        return self.nodes if part == "points" else self.requested

    def to_pandas(self, part: Part = "points") -> pandas.DataFrame:
        """As `table`, as a DataFrame (needs pandas)."""
        return to_pandas(self.table(part), {"branch": self.name})

    def to_xarray(self, part: Part = "points") -> xarray.Dataset:
        """As `table`, with the Floquet multipliers, as a Dataset over ``point`` (needs xarray)."""
        about = {"branch": self.name, "stop_reasons": list(self.stop_reasons)}
        return to_xarray(self.table(part), self.multipliers(part), about)

    def multipliers(self, part: Part = "points") -> NDArray[np.complex128]:
        """Floquet multipliers (k, 2n) of the orbits of a `table`."""
        size = self.nodes[0].orbit.multipliers.size
        found = [point.orbit.multipliers for point in self._part(part)]
        return np.array(found, dtype=complex).reshape(-1, size)

    def contains(self, orbit: Orbit) -> bool:
        """Whether the branch passes through an orbit (up to a shift by whole periods)."""
        check_types(orbit=(orbit, Orbit))
        return orbit.period == self.period and passes(self.places, orbit)
