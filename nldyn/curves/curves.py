"""Continuation in two parameters: curves of special points, and of a held quantity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Any, Literal, Protocol, get_args

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    ConvergenceError,
    KeptWorkError,
    LocateError,
    SystemModelError,
    check_choice,
    check_types,
    is_finite,
    shown,
)
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.on_curve import met_on_curve
from nldyn.bifurcations.point import BranchNode, SpecialPoint, check_special
from nldyn.bifurcations.roots import root
from nldyn.branches.arclength import Stepper
from nldyn.branches.branch import Branch, Course
from nldyn.branches.checkpoint import Checkpoint
from nldyn.branches.conditioned import start_on
from nldyn.branches.continuation import alike, going_on, on_charts, start_point
from nldyn.branches.endings import Ending, StopReasons, has_ending
from nldyn.branches.step_control import ContinuationOptions
from nldyn.branches.tables import orbit_columns
from nldyn.orbits.bordered import Condition, OrbitFamily
from nldyn.orbits.conditions import Held, Monitor, defined_by
from nldyn.orbits.orbit import Orbit, check_minimal, same_orbit
from nldyn.runtime.keeper import KeptFile
from nldyn.runtime.progress import of_place, shows_progress
from nldyn.system.chart import Chart, checked_parameter, parameter_name, value_of
from nldyn.system.parameters import Parameter
from nldyn.system.system import System

CurvePart = Literal["points", "marks"]
CLOSE = 1e-3  # how far the defining condition of a start may be off
SAME_VALUE = 1e-8  # relative difference of parameters of one place


class CurveFile(KeptFile, Protocol):
    """A file that keeps a curve; `nldyn.io.CheckpointFile` is one."""

    def remove(self) -> None:
        """Delete it, if it is there."""

    def read_curves(self, system: System, monitor: Monitor | None) -> list[Curve]:
        """The curves of a system that it holds."""

    def write_curves(self, curves: Sequence[Curve]) -> None:
        """Keep curves in place of what it holds."""


@dataclass(frozen=True, eq=False, repr=False)
class Curve:
    """A curve of periodic orbits in two parameters.

    Parameters
    ----------
    kind : str
        What the orbits have in common: LP, PD, NS, BP, GR, or the name of a monitor.
    branch : Branch
        The orbits as a branch, whose nodes have the condition that they meet.
    """

    kind: str
    branch: Branch

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What changes."""
        return tuple(chart.parameter for chart in self.branch.nodes[0].family.charts)

    @property
    def points(self) -> tuple[BranchNode, ...]:
        """Its points, in order."""
        return self.branch.nodes

    @property
    def marks(self) -> tuple[SpecialPoint, ...]:
        """Points at which a further condition is met, in the same order."""
        return self.branch.special_points

    @property
    def stop_reasons(self) -> StopReasons:
        """Why the continuation stopped at the first and at the last point."""
        return self.branch.stop_reasons

    @property
    def notes(self) -> tuple[str, ...]:
        """What may be missing."""
        return self.branch.notes

    @property
    def orbits(self) -> list[Orbit]:
        """The orbits, in order."""
        return [point.orbit for point in self.points]

    @property
    def values(self) -> Real:
        """Values of the parameters, shape (k, n_parameters)."""
        return np.array([point.values for point in self.points])

    @property
    def residuals(self) -> Real:
        """Largest residual at each point, shape (k,)."""
        return np.array([point.residual for point in self.points])

    def __repr__(self) -> str:
        """One line, in place of all numbers of all orbits."""
        names = " and ".join(parameter.name for parameter in self.parameters)
        marks = ", ".join(mark.kind for mark in self.marks) or "none"
        return (
            f"<Curve of {self.kind} in {names}: {len(self.points)} points, marks: {marks}; "
            f"{' / '.join(self.stop_reasons)}>"
        )

    def table(self, part: CurvePart = "points") -> dict[str, NDArray[Any]]:
        """Columns of numbers, one row per orbit; ``pandas.DataFrame`` takes them as they are.

        Parameters
        ----------
        part : {"points", "marks"}
            Which orbits: row i belongs to ``curve.points[i]`` or ``curve.marks[i]``.

        Returns
        -------
        dict of str to (n,) array
            The parameters under their names, with the index where it is not 0, in SI units, then
            the columns of `Branch.table`, and the residual.

        Raises
        ------
        SystemModelError
            For an unknown part.
        """
        check_choice("table: part", part, get_args(CurvePart))
        rows = self.points if part == "points" else self.marks
        columns: dict[str, NDArray[Any]] = {}
        if part == "marks":
            columns["type"] = np.array([mark.kind for mark in self.marks], dtype=str)
        values = np.array([row.values for row in rows], dtype=float)
        by_parameter = values.reshape(-1, len(self.parameters)).T
        columns.update(zip(map(parameter_name, self.parameters), by_parameter, strict=True))
        for name, column in orbit_columns([row.orbit for row in rows]).items():
            columns.setdefault(name, column)
        columns["residual"] = np.array([row.residual for row in rows], dtype=float)
        if part == "points":
            columns["arclength"] = np.array([point.arclength for point in self.points])
        return columns

    def extend(
        self,
        ranges: Sequence[tuple[float, float]],
        *,
        options: ContinuationOptions | None = None,
        progress: Callable[[Real], None] | None = None,
        checkpoint: CurveFile | None = None,
    ) -> Curve:
        """Follow the curve beyond its ends, or finish it.

        Its points are those of one continuation through the new ranges on the scale of the old
        ones, to the last digit; those at the ends of the old ranges are left out. A curve of a file
        of an earlier version is followed anew.

        Parameters
        ----------
        ranges : one of (float, float) for each parameter
            Values between which to stay, which contain those of the curve.
        options : ContinuationOptions, optional
            Step control from here on; that of before unless given.
        progress, checkpoint
            As for `continue_special`; the file may be the one that holds this curve.

        Returns
        -------
        Curve

        Raises
        ------
        SystemModelError
            For ranges that do not contain the curve, or a file that holds something else.
        """
        wider = _charts(self.orbits[0], self.parameters, ranges, options, progress)
        for chart, column in zip(wider, self.values.T, strict=True):
            chart.check_start(float(column.min()))
            chart.check_start(float(column.max()))
        pairs = zip(self.points[0].family.charts, wider, strict=True)
        charts = tuple(old.over(_range(new)) for old, new in pairs)
        whole = on_charts(_begun(self.branch), charts)
        assert whole.course is not None
        first, *others = map(_range, charts)
        course = replace(
            whole.course,
            limits=first,
            further=tuple(others),
            options=options or whole.course.options,
        )
        start = whole.nodes[course.start]
        with _kept(self.kind, start, checkpoint) as kept:
            return Curve(self.kind, going_on("", whole, start, course, progress, kept))

    def at(self, parameter: str | Parameter, value: float) -> list[Orbit]:
        """All orbits of the curve at which a parameter has a value, corrected there, each once.

        Of two that are close to a turn of the parameter, nearer than 1e-7 of it, none may be found.

        Parameters
        ----------
        parameter : str or Parameter
            One of the curve's, or its name: as in the table, or without index if only one has it.
        value : float
            Its value.

        Raises
        ------
        SystemModelError
            If the curve does not change the parameter.
        """
        if not is_finite(value):
            raise SystemModelError(f"value must be a finite number, got {shown(value)}")
        which = self._index_of(parameter)
        found: list[BranchNode] = []
        for point in met_on_curve(self.points, which, value):
            if not any(_same_place(point, other) for other in found):
                found.append(point)
        return [point.orbit for point in found]

    def _index_of(self, wanted: str | Parameter) -> int:
        """Place of a parameter among the curve's."""
        own = list(enumerate(self.parameters))
        matches = [i for i, p in own if wanted in (p, parameter_name(p))]
        matches = matches or [i for i, p in own if wanted == p.name]
        if len(matches) != 1:
            columns = ", ".join(map(parameter_name, self.parameters))
            raise SystemModelError(
                f"the curve has no parameter {shown(wanted)}; there are: {columns}"
            )
        return matches[0]


@shows_progress(of_place("curve"))
def continue_special(
    special: SpecialPoint,
    parameters: Sequence[str | Parameter],
    ranges: Sequence[tuple[float, float]],
    *,
    options: ContinuationOptions | None = None,
    progress: Callable[[Real], None] | None = None,
    checkpoint: CurveFile | None = None,
) -> Curve:
    """Continue a fold, flip, Neimark-Sacker, branch or grazing point in two parameters.

    A branch point is followed where both parameters leave the symmetry as it is that brings it
    about; otherwise it is a single point of their plane.

    Parameters
    ----------
    special : SpecialPoint
        LP, PD, NS, BP or GR.
    parameters : two of str or Parameter
        See `nldyn.system.chart.checked_parameter`.
    ranges : two of (float, float)
        Values between which to stay.
    options : ContinuationOptions, optional
        Step control.
    progress : callable, optional
        Called with the parameters' values at every point.
    checkpoint : CheckpointFile, optional
        File that keeps the curve, written now and then, at the end, and when an exception such as
        Ctrl-C ends the computation. If it holds this very curve, that one goes on and gives the
        points of an uninterrupted one.

    Returns
    -------
    Curve
        Its marks are points of codimension two.

    Raises
    ------
    SystemModelError
        For a kind that cannot be followed, a parameter that there is not, a range that does
        not hold the start, or a branch point that dissolves when the parameters change.
    ConvergenceError
        If Newton's method does not meet the point again.

    References
    ----------
    Yu. A. Kuznetsov (2004), *Elements of Applied Bifurcation Theory*, section 10.3.
    """
    check_special("continue_special", special, of_branch=False)
    charts = _charts(special.orbit, parameters, ranges, options, progress)
    curve = _curve(special.kind, special_start(special, charts), options, progress, checkpoint)
    if len(curve.points) == 1 and has_ending(curve.stop_reasons, Ending.DISSOLVED):
        if checkpoint is not None:
            checkpoint.remove()
        names = " or ".join(chart.parameter.name for chart in charts)
        raise SystemModelError(
            f"the BP at {special.orbit.frequency_hz:g} Hz is a single point: it dissolves when "
            f"{names} changes, as the symmetry does that brings it about"
        )
    return curve


def special_start(special: SpecialPoint, charts: tuple[Chart, ...]) -> BranchNode:
    """First point of a curve of special points of a kind, heading up in its first parameter.

    Raises
    ------
    ConvergenceError, SystemModelError
        As `continue_special`.
    """
    orbit = special.orbit
    family, condition = defined_by(special.kind, OrbitFamily.around(orbit, charts), orbit)
    _check_special(special.kind, family, orbit, condition)
    return start_on(family, orbit, condition)


@shows_progress(of_place("curve"))
def continue_constant(
    orbit: Orbit,
    monitor: Monitor,
    parameters: Sequence[str | Parameter],
    ranges: Sequence[tuple[float, float]],
    *,
    value: float | None = None,
    options: ContinuationOptions | None = None,
    progress: Callable[[Real], None] | None = None,
    checkpoint: CurveFile | None = None,
) -> Curve:
    """Continue an orbit in two parameters so that a monitored quantity stays constant.

    Parameters
    ----------
    orbit : Orbit
        Where to start.
    monitor : {"peak_force", "max_penetration", "max_abs_displacement", "phase_lag_deg"} or callable
        What to hold, over all stops or of the observed interface; or a function of an orbit. The
        lag is that of the observed displacement behind the only source that swings.
    parameters, ranges
        As for `continue_special`.
    value : float, optional
        Value to hold; the orbit's own unless given. The orbit is first followed in the first
        parameter alone, both ways within its range, up to where it has the value.
    options, progress, checkpoint
        As for `continue_special`; the way to the value is not kept.

    Returns
    -------
    Curve
        Its marks are the special points LP, PD, NS and GR.

    Raises
    ------
    SystemModelError
        For bad input, also a monitor that is zero on the orbit.
    ConvergenceError
        If no orbit with the value is found on the way; the text says which values are.
    """
    charts = _charts(orbit, parameters, ranges, options, progress)
    condition = Held.of(monitor, value, orbit)
    orbit = _with_value(orbit, condition, charts[0], options or ContinuationOptions())
    start = start_on(OrbitFamily.around(orbit, charts), orbit, condition)
    return _curve(condition.name, start, options, progress, checkpoint)


def _with_value(orbit: Orbit, condition: Held, chart: Chart, options: ContinuationOptions) -> Orbit:
    """The orbit that has the value to be held, on the branch in one parameter."""
    present = condition.monitor(orbit)
    if abs(present / condition.target - 1.0) < CLOSE:
        return orbit
    start = start_point(OrbitFamily.around(orbit, (chart,)).place(orbit), 1.0)
    ends, met = [start, start.reversed()], [present]
    walks = (Stepper(end, (chart.low, chart.high), options) for end in ends)
    for pair in zip_longest(*walks):
        for side, point in enumerate(pair):
            if point is None:
                continue
            try:
                found = _between(condition, ends[side], point)
            except LocateError as error:
                raise ConvergenceError(f"{condition.name} was not reached: {error}") from None
            if found is not None:
                return found
            ends[side] = point
            met.append(condition.monitor(point.orbit))
    name, places = chart.parameter.name, sorted(end.value for end in ends)
    raise ConvergenceError(
        f"no orbit with {condition.name} = {condition.target:g} was found: it is {present:g} at "
        f"the start and from {min(met):g} to {max(met):g} where {name} goes from {places[0]:g} to "
        f"{places[1]:g}; start at another orbit, or widen the range of {name}"
    )


def _between(condition: Held, a: BranchNode, b: BranchNode) -> Orbit | None:
    """The orbit with the value to be held between two points of a branch, if they lie about it."""

    def off(point: BranchNode) -> float:
        return float(condition.monitor(point.orbit)) / condition.target - 1.0

    if not off(a) * off(b) <= 0.0:
        return None
    chord = Chord(a, b)
    return chord.at(root(lambda sigma: off(chord.at(sigma)))[0]).orbit


def _check_special(kind: str, family: OrbitFamily, orbit: Orbit, condition: Condition) -> None:
    """Refuse a start that is not nearly a special point of its kind."""
    off = float(np.abs(condition.value(family.at(family.unknowns(orbit)))).max())
    if off > CLOSE:
        raise SystemModelError(
            f"the orbit at {orbit.frequency_hz:g} Hz is no {kind}: its defining condition "
            f"is off by {off:.1e}; locate it first, see refine_special"
        )


def _charts(
    orbit: Orbit,
    parameters: Sequence[str | Parameter],
    ranges: Sequence[tuple[float, float]],
    options: ContinuationOptions | None,
    progress: Callable[[Real], None] | None,
) -> tuple[Chart, ...]:
    """Charts of the parameters, checked against the start; other arguments are checked as well."""
    check_types(
        orbit=(orbit, Orbit),
        parameters=(parameters, list, tuple),
        ranges=(ranges, list, tuple),
        options=(options, ContinuationOptions, None),
        progress=(progress, Callable, None),
    )
    check_minimal(orbit)
    if orbit.self_excited:
        raise SystemModelError(
            "curves in two parameters are those of forced motions: the frequency of this one is "
            "found; follow it over one parameter by continue_branch"
        )
    if len(parameters) != 2:
        raise SystemModelError(f"a curve of this kind needs two parameters, got {len(parameters)}")
    if len(ranges) != 2:
        raise SystemModelError("give as many ranges as parameters, one pair of numbers each")
    chosen = [checked_parameter(orbit.system, parameter) for parameter in parameters]
    if len(set(chosen)) < len(chosen):
        raise SystemModelError(f"parameter '{chosen[0].name}' is given twice")
    charts = tuple(Chart.of(p, limits) for p, limits in zip(chosen, ranges, strict=True))
    for chart in charts:
        chart.check_start(value_of(orbit.system, orbit.frequency_hz, chart.parameter))
    return charts


def _curve(
    kind: str,
    start: BranchNode,
    options: ContinuationOptions | None,
    progress: Callable[[Real], None] | None,
    checkpoint: CurveFile | None,
) -> Curve:
    """Walk both ways from the start and mark what is met, or go on with what a file holds."""
    course = _course(start.family, options)
    with _kept(kind, start, checkpoint) as kept:
        return Curve(kind, going_on("", None, start, course, progress, kept))


def _course(family: OrbitFamily, options: ContinuationOptions | None = None) -> Course:
    """That of a curve through the ranges of its charts."""
    first, *others = map(_range, family.charts)
    chosen = options or ContinuationOptions()
    return Course(first, chosen, alike(family, []), further=tuple(others))


def _range(chart: Chart) -> tuple[float, float]:
    return chart.low, chart.high


def _begun(branch: Branch) -> Branch:
    """A curve that goes on; one that does not tell how it was followed, anew from its start."""
    if branch.course is not None:
        return branch
    start = int(np.argmin([abs(node.arclength) for node in branch.nodes]))
    course = replace(_course(branch.nodes[0].family), start=start)
    return replace(branch, course=course, stop_reasons=(Ending.NOT_FINISHED.told(),) * 2)


def _kept(kind: str, start: BranchNode, place: CurveFile | None) -> Checkpoint:
    """The checkpoint of one curve of a kind in a file."""
    if place is None:
        return Checkpoint()
    place.check_writable()
    condition = start.condition
    monitor = condition.monitor if isinstance(condition, Held) else None
    held = place.read_curves(start.orbit.system, monitor) if place.exists() else []
    if any(curve.kind != kind for curve in held):
        raise KeptWorkError(f"{place.name}: holds another curve; choose another file, or delete it")

    def write(branches: Sequence[Branch]) -> None:
        place.write_curves([Curve(kind, branch) for branch in branches])

    return Checkpoint(write, earlier=[curve.branch for curve in held], strict=place.name)


def _same_place(a: BranchNode, b: BranchNode) -> bool:
    """Whether two points have the same orbit of the same system."""
    same = np.allclose(a.values, b.values, rtol=SAME_VALUE, atol=0.0)
    return same and same_orbit(a.orbit, b.orbit)
