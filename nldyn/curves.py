"""Continuation in any parameter: branches, curves of special points, curves of a held quantity."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from nldyn.bordered import Condition, Free, OrbitFamily, correct, gradient, tangent_surface
from nldyn.conditions import Held, Monitor, condition_of, monitor_name
from nldyn.continuation import ContinuationOptions
from nldyn.curve_marks import Located, LocatedPoint, marks_between
from nldyn.curve_walk import CLOSED_CURVE, CurvePoint, CurveWalk, curve_point, on_chart_plane
from nldyn.errors import SystemModelError, shown
from nldyn.linear import Real
from nldyn.orbit import ConvergenceError, Orbit
from nldyn.parameter_values import Chart, checked_parameter, value_of
from nldyn.parameters import Parameter

CLOSE = 1e-3  # how far the defining condition of a start may be off


@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of periodic orbits in one or two parameters.

    Parameters
    ----------
    kind : str
        What the orbits have in common: LP, PD, NS, GR, the name of a monitor, or orbit.
    parameters : tuple of Parameter
        What changes.
    points : tuple of CurvePoint
        In order along the curve.
    marks : tuple of LocatedPoint
        Points at which a further condition is met, in the same order.
    stop_reasons : tuple of str
        Why the continuation stopped at the first and at the last point.
    notes : tuple of str
        What may be missing.
    """

    kind: str
    parameters: tuple[Parameter, ...]
    points: tuple[CurvePoint, ...]
    marks: tuple[LocatedPoint, ...]
    stop_reasons: tuple[str, str]
    notes: tuple[str, ...] = ()

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

    def at(self, name: str, value: float) -> list[Orbit]:
        """All orbits of the curve at which a parameter has a value, corrected there.

        Parameters
        ----------
        name : str
            Name of one of the curve's parameters.
        value : float
            Its value.

        Raises
        ------
        SystemModelError
            If the curve does not change the parameter.
        """
        names = [parameter.name for parameter in self.parameters]
        if name not in names:
            raise SystemModelError(
                f"the curve has no parameter {shown(name)}; there are: {', '.join(names)}"
            )
        which = names.index(name)
        found: list[Orbit] = []
        for a, b in pairwise(self.points):
            if (a.values[which] - value) * (b.values[which] - value) <= 0.0:
                end = on_chart_plane(a, b, which, value)
                if end is not None and (b is self.points[-1] or b.values[which] != value):
                    found.append(end.orbit)
        return found


def continue_in(
    orbit: Orbit,
    parameter: str | Parameter,
    limits: tuple[float, float],
    *,
    options: ContinuationOptions | None = None,
    progress: Callable[[Real], None] | None = None,
) -> Curve:
    """Continue an orbit in one parameter, all others held.

    Parameters
    ----------
    orbit : Orbit
        Where to start.
    parameter : str or Parameter
        See `nldyn.parameter_values.checked_parameter`.
    limits : (float, float)
        Values between which to stay; ends are met exactly.
    options : ContinuationOptions, optional
        Step control.
    progress : callable, optional
        Called with the parameter's value at every point.

    Returns
    -------
    Curve
        Its marks are the special points LP, PD, NS, BP and GR.

    Raises
    ------
    SystemModelError
        For a parameter that there is not, or a range that does not hold the start.
    ConvergenceError
        If Newton's method does not meet the orbit again.

    Examples
    --------
    >>> from nldyn import System, Stop, Unbalance, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     stops=[Stop("middle", stiffness=5.17e9, gap=2e-6)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> curve = continue_in(solve_orbit(system, 20.0), "gap", (1e-6, 1e-5))
    >>> [f"{value:.6g}" for value in curve.values[[0, -1], 0]]
    ['1e-06', '1e-05']
    """
    charts = _charts(orbit, [parameter], [limits])
    return _curve("orbit", orbit, charts, Free(), options, progress)


def continue_special(
    special: Located,
    parameters: Sequence[str | Parameter],
    ranges: Sequence[tuple[float, float]],
    *,
    options: ContinuationOptions | None = None,
    progress: Callable[[Real], None] | None = None,
) -> Curve:
    """Continue a fold, flip, Neimark-Sacker or grazing point in two parameters.

    Parameters
    ----------
    special : SpecialPoint or LocatedPoint
        LP, PD, NS or GR.
    parameters : two of str or Parameter
        See `nldyn.parameter_values.checked_parameter`.
    ranges : two of (float, float)
        Values between which to stay.
    options : ContinuationOptions, optional
        Step control.
    progress : callable, optional
        Called with the parameters' values at every point.

    Returns
    -------
    Curve
        Its marks are points of codimension two.

    Raises
    ------
    SystemModelError
        For a kind that cannot be followed, a parameter that there is not, or a range that does
        not hold the start.
    ConvergenceError
        If Newton's method does not meet the point again.

    References
    ----------
    Yu. A. Kuznetsov (2004), *Elements of Applied Bifurcation Theory*, section 10.3.
    """
    orbit = special.orbit
    charts = _charts(orbit, parameters, ranges)
    _check_special(special, charts)
    return _curve(special.kind, orbit, charts, condition_of(special.kind, orbit), options, progress)


def continue_constant(
    orbit: Orbit,
    monitor: Monitor,
    parameters: Sequence[str | Parameter],
    ranges: Sequence[tuple[float, float]],
    *,
    value: float | None = None,
    options: ContinuationOptions | None = None,
    progress: Callable[[Real], None] | None = None,
) -> Curve:
    """Continue an orbit in two parameters so that a monitored quantity stays constant.

    Parameters
    ----------
    orbit : Orbit
        Where to start.
    monitor : {"peak_force", "max_penetration", "max_abs_displacement"} or callable
        What to hold, over all stops or of the observed interface; or a function of an orbit.
    parameters, ranges
        As for `continue_special`.
    value : float, optional
        Value to hold; the orbit's own unless given. The orbit is first changed until it has the
        value, in the first parameter alone.
    options, progress
        As for `continue_special`.

    Returns
    -------
    Curve
        Its marks are the special points LP, PD, NS and GR.

    Raises
    ------
    SystemModelError
        For bad input, also a monitor that is zero on the orbit.
    ConvergenceError
        If no orbit with the value is found near the start.
    """
    charts = _charts(orbit, parameters, ranges)
    condition = Held.of(monitor, value, orbit)
    return _curve(monitor_name(monitor), orbit, charts, condition, options, progress)


def _check_special(special: Located, charts: tuple[Chart, ...]) -> None:
    """Refuse a start that is not nearly a special point of its kind."""
    orbit = special.orbit
    family = OrbitFamily.around(orbit, charts)
    condition = condition_of(special.kind, orbit)
    off = float(np.abs(condition.value(family.at(family.unknowns(orbit)))).max())
    if off > CLOSE:
        raise SystemModelError(
            f"the orbit at {orbit.frequency_hz:g} Hz is no {special.kind}: its defining condition "
            f"is off by {off:.1e}; locate it first, see refine_special"
        )


def _charts(
    orbit: Orbit,
    parameters: Sequence[str | Parameter],
    ranges: Sequence[tuple[float, float]],
) -> tuple[Chart, ...]:
    """Charts of the parameters, checked against the start."""
    if isinstance(parameters, str) or len(parameters) != len(ranges):
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
    orbit: Orbit,
    charts: tuple[Chart, ...],
    condition: Condition,
    options: ContinuationOptions | None,
    progress: Callable[[Real], None] | None,
) -> Curve:
    """Walk both ways from the start and mark what is met."""
    if len(charts) != 1 + (not isinstance(condition, Free)):
        raise SystemModelError(f"a curve of this kind needs two parameters, got {len(charts)}")
    start = _start(OrbitFamily.around(orbit, charts), orbit, condition)
    options = options or ContinuationOptions()
    up = CurveWalk(start, options)
    points = _collected(up, progress)
    reasons = (up.stop_reason, up.stop_reason)
    if up.stop_reason != CLOSED_CURVE:
        down = CurveWalk(start.reversed(), options)
        before = _collected(down, progress)
        points = [point.reversed() for point in before[:0:-1]] + points
        reasons = (down.stop_reason, up.stop_reason)
    marks: list[LocatedPoint] = []
    notes: list[str] = []
    for a, b in pairwise(points):
        more, lost = marks_between(a, b)
        marks += more
        notes += lost
    return Curve(
        kind,
        tuple(chart.parameter for chart in charts),
        tuple(points),
        tuple(marks),
        reasons,
        tuple(notes),
    )


def _collected(walk: CurveWalk, progress: Callable[[Real], None] | None) -> list[CurvePoint]:
    points = []
    for point in walk:
        points.append(point)
        if progress is not None:
            progress(point.values)
    return points


def _start(family: OrbitFamily, orbit: Orbit, condition: Condition) -> CurvePoint:
    """First point of a curve, heading up in its first parameter."""
    guess = family.unknowns(orbit)
    first = family.n_states
    if isinstance(condition, Held):
        towards = np.zeros(guess.size)
        towards[-1] = 1.0
        found = correct(family, guess, condition, towards, float(guess[-1]), max_iterations=25)
    else:
        at = family.at(guess)
        _, surface = tangent_surface(at)
        by_surface = gradient(at, surface, condition)
        along = surface @ np.linalg.svd(by_surface)[2][-1] if by_surface.size else surface[:, 0]
        row = family.metric(guess) * along
        row /= np.linalg.norm(row)
        found = correct(family, guess, condition, row, float(row @ guess))
    if not found.converged:
        raise ConvergenceError(
            f"the start of the curve at {orbit.frequency_hz:g} Hz was not found: {found.failure}"
        )
    for chart, value in zip(family.charts, found.at.values.tolist(), strict=True):
        chart.check_start(value)
    up = np.zeros(guess.size)
    up[first] = 1.0
    return curve_point(found, condition, up, 0.0)
