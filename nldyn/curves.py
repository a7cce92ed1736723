"""Continuation in any parameter: branches, curves of special points, curves of a held quantity."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Protocol

import numpy as np

from nldyn.bordered import (
    SHORTEST_DIFFERENCE,
    Condition,
    Corrected,
    Evaluation,
    Free,
    OrbitFamily,
    correct,
    gradient,
    tangent_surface,
)
from nldyn.codimension import codimension_tests, is_torus, torus_pair
from nldyn.conditions import (
    Both,
    BranchPoint,
    Grazing,
    Held,
    Monitor,
    Singular,
    condition_of,
    monitor_name,
)
from nldyn.continuation import ContinuationOptions, passed_flip
from nldyn.errors import SystemModelError, shown
from nldyn.linear import Real
from nldyn.orbit import ConvergenceError, Orbit
from nldyn.parameter_values import FREQUENCY, Chart, checked_parameter, value_of
from nldyn.parameters import Parameter
from nldyn.special import LocateError, root, touching_extremes

RANGE_END = "end of the range of "
RESONANCE_END = "becomes a curve of neutral saddles at a resonance"


class Located(Protocol):
    """A special point of a branch or of a curve."""

    @property
    def kind(self) -> str:
        """LP, PD, NS, BP or GR."""

    @property
    def orbit(self) -> Orbit:
        """Its orbit."""


@dataclass(frozen=True, eq=False)
class LocatedPoint:
    """A special point found by Newton's method, or a point marked on a curve.

    Parameters
    ----------
    kind : str
        LP, PD, NS, BP, GR; on curves also CP, GPD, LPPD, R1 to R4 and pairs, see the theory.
    orbit : Orbit
        The orbit.
    parameters : tuple of Parameter
        The numbers that were free.
    values : (n_parameters,) array
        Their values.
    residual : float
        Largest of the relative error of closing and the defining conditions.
    error : float
        Relative length of the last step: of Newton's method, or along the curve.
    """

    kind: str
    orbit: Orbit
    parameters: tuple[Parameter, ...]
    values: Real
    residual: float
    error: float

    @property
    def frequency_hz(self) -> float:
        """Excitation frequency in Hz."""
        return self.orbit.frequency_hz


@dataclass(frozen=True, eq=False)
class CurvePoint:
    """An orbit on a curve.

    Parameters
    ----------
    found : Corrected
        The solution.
    condition : Condition
        The condition that it meets, with borders of its own.
    tangent : (N + m,) array
        Unit tangent in the family's metric.
    arclength : float
        Relative arclength from the start.
    corner : str
        Kind of the mark where the curve has a corner at a grazing point, else empty.
    """

    found: Corrected
    condition: Condition
    tangent: Real
    arclength: float

    corner: str = ""

    @property
    def point(self) -> Real:
        """Unknowns of the family."""
        return self.found.at.point

    @property
    def values(self) -> Real:
        """Values of the parameters."""
        return self.found.at.values

    @property
    def orbit(self) -> Orbit:
        """The orbit."""
        return self.found.orbit

    @cached_property
    def residual(self) -> float:
        """Largest of the relative error of closing and the condition."""
        return self.found.residual(self.condition)

    @cached_property
    def tests(self) -> dict[str, float]:
        """Test functions of what may be met on the curve."""
        one = isinstance(self.condition, Free)
        return codimension_tests(
            self.condition, self.found.at, float(self.tangent[-1]) if one else None
        )

    def reversed(self) -> CurvePoint:
        """The same point of the curve run through the other way."""
        return replace(self, tangent=-self.tangent, arclength=-self.arclength)


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
                end = _on_chart_plane(a, b, which, value)
                if end is not None and (b is self.points[-1] or b.values[which] != value):
                    found.append(end.orbit)
        return found


# --- one point ----------------------------------------------------------------------------------


def refine_special(
    special: Located, parameter: str | Parameter = FREQUENCY, *, max_iterations: int = 12
) -> LocatedPoint:
    """Solve the defining system of a special point by Newton's method in one parameter.

    Parameters
    ----------
    special : SpecialPoint or LocatedPoint
        LP, PD, NS, GR or BP.
    parameter : str or Parameter
        Which number is free: see `nldyn.parameter_values.checked_parameter`.
    max_iterations : int
        Most steps.

    Returns
    -------
    LocatedPoint

    Raises
    ------
    SystemModelError
        For an unknown kind or parameter.
    LocateError
        If Newton's method does not converge.

    References
    ----------
    G. Moore (1980), *Numer. Funct. Anal. Optim.* 2, 441-472 (branch points);
    W. J. F. Govaerts (2000); Yu. A. Kuznetsov (2004), section 10.3.
    """
    orbit = special.orbit
    chosen = checked_parameter(orbit.system, parameter)
    value = value_of(orbit.system, orbit.frequency_hz, chosen)
    span = (0.5 * value, 2.0 * value) if value > 0.0 else (value - 1.0, value + 1.0)
    if chosen.name == "gap" and value <= 0.0:
        size = orbit.max_abs_displacement
        span = (value - size, value + size)
    family = OrbitFamily.around(orbit, (Chart(chosen, *span),))
    guess = family.unknowns(orbit)
    condition: Condition
    if special.kind == "BP":
        condition = BranchPoint.of(family.at(guess))
        family = family.unfolded(condition.left * family.scale(guess))
        guess = np.append(guess, 0.0)
    else:
        condition = condition_of(special.kind, orbit)
    found = correct(family, guess, condition, max_iterations=max_iterations)
    if not found.converged:
        raise LocateError(
            f"{special.kind} near {orbit.frequency_hz:.6g} Hz was not refined: {found.failure}"
        )
    values = found.at.values
    residual = found.residual(condition)
    if special.kind == "BP":  # an unfolding that stays is a branch point that is none
        residual = max(residual, abs(float(found.at.point[-1])))
    return LocatedPoint(special.kind, found.orbit, (chosen,), values, residual, found.step)


# --- curves -------------------------------------------------------------------------------------


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
    up = np.zeros(guess.size)
    up[first] = 1.0
    return _curve_point(found, condition, up, 0.0)


def _curve_point(
    found: Corrected, condition: Condition, towards: Real, arclength: float
) -> CurvePoint:
    """Curve point from a solution, its tangent on the side of a vector."""
    weighted = found.at.family.metric(found.at.point) * found.along
    length = math.sqrt(float(found.along @ weighted))
    if float(towards @ weighted) < 0.0:
        length = -length
    return CurvePoint(found, condition.renewed(found.at), found.along / length, arclength)


# --- walking ------------------------------------------------------------------------------------

CLOSED_CURVE = "closed curve"
CORNER_STEP = 1e-3  # a step shorter than this may have met a corner


def corner_ahead(here: CurvePoint, options: ContinuationOptions) -> CurvePoint | None:
    """The grazing point close ahead at which a curve has a corner, with its tangent behind it.

    The derivative of the monodromy matrix jumps at a grazing, and with it the direction of a
    curve on which a condition of that matrix holds.
    """
    if not isinstance(here.condition, Singular):
        return None
    try:
        grazing = Grazing.of(here.orbit)
        family = here.found.at.family
        found = correct(family, here.point, Both(here.condition, grazing), max_iterations=25)
        weights = family.metric(here.point)
        way = found.at.point - here.point
        length = _length(weights, way)
        ahead = float(way @ (weights * here.tangent)) > 0.9 * length
        if not (found.converged and ahead and length < 10.0 * options.grazing_step):
            return None
        before = float(grazing.value(here.found.at)[0])
        tangent = _tangent_behind(found.at, here.condition, grazing, before < 0.0)
    except (ConvergenceError, SystemModelError, np.linalg.LinAlgError):
        return None
    condition = here.condition.renewed(found.at)
    kind = f"GR{here.condition.kind}"
    return CurvePoint(found, condition, tangent, here.arclength + length, kind)


def _tangent_behind(at: Evaluation, condition: Condition, grazing: Grazing, deep: bool) -> Real:
    """Unit tangent of a curve on the side of a grazing where the extreme is positive, or not."""
    _, surface = tangent_surface(at)
    by_surface = gradient(at, surface, grazing)
    slopes = by_surface[0] if deep else -by_surface[0]
    across = slopes / np.linalg.norm(slopes)
    beside = np.array([-across[1], across[0]])
    # both legs of the differences lead to the same side of the grazing
    legs = [surface @ (across + sign * 0.5 * beside) for sign in (-1.0, 1.0)]
    h = 10.0 * SHORTEST_DIFFERENCE
    g = [
        (condition.value(at.family.at(at.point + h * leg)) - condition.value(at))[0] for leg in legs
    ]
    by_beside, by_across = g[1] - g[0], 0.5 * (g[0] + g[1])
    tangent = surface @ (by_beside * across - by_across * beside)
    return np.asarray(tangent / math.copysign(math.hypot(by_beside, by_across), by_beside))


@dataclass
class CurveWalk:
    """Iterator over the points of a curve in one direction, as `Walk` is over a branch's.

    Parameters
    ----------
    start : CurvePoint
        First point, yielded first; its tangent gives the direction.
    options : ContinuationOptions
        Step control.
    """

    start: CurvePoint
    options: ContinuationOptions
    stop_reason: str = "not finished"

    def __iter__(self) -> Iterator[CurvePoint]:
        """Walk along the curve."""
        here, step = self.start, self.options.first_step
        curvature = np.zeros(here.tangent.size)
        yield here
        for _ in range(self.options.max_points):
            attempt = None
            seen = bool(here.corner)
            while attempt is None:
                attempt = self._advance(here, curvature, step)
                if attempt is None:
                    step *= 0.5
                    if step < CORNER_STEP and not seen:
                        seen = True
                        corner = corner_ahead(here, self.options)
                        if corner is not None:
                            attempt = corner, self.options.max_angle, self.options.max_miss
                    if step < self.options.min_step:
                        self.stop_reason = f"step below {self.options.min_step:g}"
                        return
            there, angle, miss = attempt
            last = self._end(here, there)
            if last is not None:
                yield from last
                return
            yield there
            curvature = (there.tangent - here.tangent) / (there.arclength - here.arclength)
            if there.corner:
                curvature = np.zeros(here.tangent.size)
            here = there
            growth = 0.7 * self.options.max_angle / max(angle, 1e-3)
            growth = min(growth, math.sqrt(0.5 * self.options.max_miss / max(miss, 1e-6)))
            step = min(step * min(max(growth, 0.5), 1.6), self.options.max_step)
        self.stop_reason = f"{self.options.max_points} points"

    def _advance(
        self, here: CurvePoint, curvature: Real, step: float
    ) -> tuple[CurvePoint, float, float] | None:
        """Next point, its angle to this one and its relative distance from the predictor.

        None when the step must be shorter.
        """
        family = here.found.at.family
        weights = family.metric(here.point)
        direction = here.tangent
        straight = here.point + step * direction
        row = weights * direction
        row /= np.linalg.norm(row)
        predicted = straight + 0.5 * step**2 * curvature
        found = correct(
            family, predicted, here.condition, row, float(row @ straight), max_iterations=8
        )
        if not found.converged:
            return None
        miss = _length(weights, found.at.point - predicted) / step
        off = _length(weights, found.at.point - straight)
        if miss > self.options.max_miss or off > 0.75 * self.options.max_angle * step:
            return None
        try:
            there = _curve_point(found, here.condition, direction, here.arclength + step)
        except ConvergenceError:
            return None
        cosine = float(direction @ (weights * there.tangent)) / _length(weights, there.tangent)
        angle = math.acos(min(max(cosine, -1.0), 1.0))
        if angle > self.options.max_angle:
            return None
        touched = there.orbit.impacts != here.orbit.impacts
        grazes = isinstance(here.condition, Grazing)
        if step > self.options.grazing_step and touched and not grazes:
            return None
        return there, angle, miss

    def _end(self, here: CurvePoint, there: CurvePoint) -> list[CurvePoint] | None:
        """The last points of the walk if it ends in this step."""
        charts = here.found.at.family.charts
        ends = []
        for which, chart in enumerate(charts):
            a, b = float(here.values[which]), float(there.values[which])
            if not chart.low <= b <= chart.high:
                limit = chart.low if b < chart.low else chart.high
                share = 1.0 if a == b else (limit - a) / (b - a)
                ends.append((share, which, limit))
        if ends:
            share, which, limit = min(ends)
            self.stop_reason = f"{RANGE_END}{charts[which].parameter.name}"
            end = _on_chart_plane(here, there, which, limit) if share > 1e-9 else None
            return [] if end is None else [end]
        if passed_flip(here.orbit, there.orbit):
            self.stop_reason = f"meets orbits of period {here.orbit.period // 2}"
            return []
        if _is_torus_curve(here.condition) and not is_torus(there.orbit.multipliers):
            self.stop_reason = RESONANCE_END
            return [there]
        if self._closed(here, there):
            self.stop_reason = CLOSED_CURVE
            return [there]
        return None

    def _closed(self, a: CurvePoint, b: CurvePoint) -> bool:
        """Whether the walk from a to b passes the start again, in the same direction."""
        start = self.start
        if b.arclength - start.arclength < 10.0 * (b.arclength - a.arclength):
            return False
        weights = start.found.at.family.metric(start.point)
        step, way = b.point - a.point, start.point - a.point
        length2 = float(step @ (weights * step))
        along = float(step @ (weights * way))
        if float(step @ (weights * start.tangent)) <= 0.0 or not 0.0 <= along <= length2:
            return False
        off = way - along / length2 * step
        return float(off @ (weights * off)) < 0.01 * length2


def _is_torus_curve(condition: Condition) -> bool:
    return isinstance(condition, Singular) and condition.kind == "NS"


def _length(weights: Real, vector: Real) -> float:
    """Length of a vector in the metric of the arclength."""
    return math.sqrt(float(vector @ (weights * vector)))


# --- between two points -------------------------------------------------------------------------


@dataclass
class CurveChord:
    """The piece of a curve between two neighbouring points, as a function of σ in [0, 1]."""

    first: CurvePoint
    last: CurvePoint

    def __post_init__(self) -> None:
        self._known: dict[float, CurvePoint] = {0.0: self.first, 1.0: self.last}

    def at(self, sigma: float) -> CurvePoint:
        """Point of the curve on the plane through σ of the secant.

        Raises
        ------
        LocateError
            If Newton's method fails there.
        """
        sigma = min(max(sigma, 0.0), 1.0)
        if sigma not in self._known:
            a, b = self.first, self.last
            family = a.found.at.family
            secant = b.point - a.point
            row = family.metric(a.point) * secant
            row /= np.linalg.norm(row)
            level = float(row @ (a.point + sigma * secant))
            found = correct(family, self._between(sigma), a.condition, row, level)
            if not found.converged:
                raise LocateError(found.failure)
            length = a.arclength + sigma * (b.arclength - a.arclength)
            self._known[sigma] = _curve_point(found, a.condition, secant, length)
        return self._known[sigma]

    def _between(self, sigma: float) -> Real:
        """Cubic interpolation of the unknowns between the nearest known points."""
        below = max(s for s in self._known if s < sigma)
        above = min(s for s in self._known if s > sigma)
        a, b = self._known[below], self._known[above]
        x, span = (sigma - below) / (above - below), b.arclength - a.arclength
        return np.asarray(
            (1.0 + 2.0 * x) * (1.0 - x) ** 2 * a.point
            + x * (1.0 - x) ** 2 * span * a.tangent
            + x * x * (3.0 - 2.0 * x) * b.point
            + x * x * (x - 1.0) * span * b.tangent
        )


def _on_chart_plane(a: CurvePoint, b: CurvePoint, which: int, value: float) -> CurvePoint | None:
    """Point of the curve between a and b at which a parameter has a value."""
    family = a.found.at.family
    place = family.n_states + which
    target = family.charts[which].coordinate(value)
    if a.point[place] == b.point[place]:
        return None
    share = (target - float(a.point[place])) / float(b.point[place] - a.point[place])
    row = np.zeros(a.point.size)
    row[place] = 1.0
    guess = (1.0 - share) * a.point + share * b.point
    guess[place] = target
    found = correct(family, guess, a.condition, row, target)
    if not found.converged:
        return None
    length = a.arclength + share * (b.arclength - a.arclength)
    return _curve_point(found, a.condition, b.point - a.point, length)


def marks_between(a: CurvePoint, b: CurvePoint) -> tuple[list[LocatedPoint], list[str]]:
    """What is met between two neighbouring points of a curve, in order, and what may be missing."""
    chord = CurveChord(a, b)
    found: list[tuple[float, LocatedPoint]] = []
    notes: list[str] = []
    for name, test in _changes_of_sign(a, b):
        try:
            sigma, error = root(lambda x, test=test: test(chord.at(x)))  # type: ignore[misc]
            point = chord.at(sigma)
            if _is_true(name, point):
                found.append((sigma, _marked(name, point, error * (b.arclength - a.arclength))))
        except (LocateError, ConvergenceError) as error:
            notes.append(f"{name} near {_place(a)} may be missing: {error}")
    if b.corner:
        found.append((1.0, _marked(b.corner, b, b.found.step)))
    found.sort(key=lambda pair: pair[0])
    return [mark for _, mark in found], notes


def _changes_of_sign(
    a: CurvePoint, b: CurvePoint
) -> list[tuple[str, Callable[[CurvePoint], float]]]:
    """Tests that change sign between two points, with the names of what they tell of."""
    names = [name for name in a.tests if a.tests[name] * b.tests[name] < 0.0]
    if "LP" in names and "BP" in names:  # at a fold both change sign
        names.remove("BP")
    found: list[tuple[str, Callable[[CurvePoint], float]]] = [
        (name, lambda point, name=name: point.tests[name])  # type: ignore[misc]
        for name in names
    ]
    condition = a.condition
    if a.corner or b.corner:
        return found
    for touch in touching_extremes(a.orbit, b.orbit):
        own = isinstance(condition, Grazing) and condition.is_of(
            touch.output, touch.is_maximum, touch.phase, a.orbit.period
        )
        if not own:
            found.append((_touch_name(condition), touch.depth))  # type: ignore[arg-type]
    return found


def _touch_name(condition: Condition) -> str:
    if isinstance(condition, Grazing):
        return "GRGR"
    return f"GR{condition.kind}" if isinstance(condition, Singular) else "GR"


def _is_true(name: str, point: CurvePoint) -> bool:
    """Whether a pair of multipliers is complex where a test tells of one on the unit circle."""
    mu = point.orbit.multipliers
    if name in ("NS", "GRNS"):
        return is_torus(mu)
    if name in ("LPNS", "PDNS") and not _is_torus_curve(point.condition):
        target = 1.0 if name == "LPNS" else -1.0
        return is_torus(np.delete(mu, int(np.argmin(np.abs(mu - target)))))
    if name == "NSNS":
        return is_torus(np.delete(mu, torus_pair(mu)))
    if name == "CP":  # the parameters turn back
        return bool(np.abs(point.tangent[-2:]).max() < 1e-3)
    return True


def _marked(name: str, point: CurvePoint, error: float) -> LocatedPoint:
    """A mark on a curve; on a branch in one parameter it is polished by its defining system."""
    parameters = tuple(chart.parameter for chart in point.found.at.family.charts)
    mark = LocatedPoint(name, point.orbit, parameters, point.values, point.residual, abs(error))
    if isinstance(point.condition, Free):
        try:
            return refine_special(mark, parameters[0])
        except LocateError:
            return mark
    return mark


def _place(point: CurvePoint) -> str:
    charts = point.found.at.family.charts
    pairs = zip(charts, point.values.tolist(), strict=True)
    return ", ".join(f"{chart.parameter.name} = {value:.8g}" for chart, value in pairs)
