"""Newton's method for periodic orbits that meet conditions, in chosen parameters.

The unknowns are the shooting states u, parameters p and, for a branch point, an unfolding number:
N + m of them. The N shooting equations R(u, p) = 0 have exact derivatives; where these have full
rank they leave a surface of m dimensions, and only along its m tangents are the derivatives of the
conditions g needed. There they are central differences.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES, ConvergenceError, SystemModelError
from nldyn.flow.flow_map import FlowMap, Segments, Solution, Trajectory, pinned
from nldyn.flow.options import FlowOptions
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.passage import Passage, shoot_past
from nldyn.orbits.shooting import ITERATIONS, LONGEST, ShootingProblem, metric_length
from nldyn.system.chart import (
    FREQUENCY,
    Chart,
    has_exact_derivatives,
    moves_frequency,
    value_of,
    with_value,
)
from nldyn.system.parameters import Parameter
from nldyn.system.system import System

# A central difference of a function g with the error ε errs by ε/h + h² g(3)/6. Monodromy matrices
# are good to about 1e-10 and conditions of them bend where they change by one: a difference over
# which g changes by 1e-4 to 1e-3 is good to about five digits, and a Newton step gains as many.
# Where an extreme of a penetration comes near to zero, the second derivative of the motion jumps
# there: a difference then reaches only a fifth of the way, but not below the shortest. Where g
# bends on a shorter length, its second difference against the first tells: h g''/g' is 2 BENT at
# most, so that h² g(3)/6 is about 1e-4 of the slope if g(3)/g' is about the square of g''/g'. No
# bend is seen in rounding. A difference to one side is wrong by h g''/2, so it is always short.
# The ends of motions change smoothly with a parameter, but on a short length beside light contacts;
# so does what the flow map errs by, and rounding of 1e-13 allows short differences.
DIFFERENCE = 1e-4
END_DIFFERENCE = 1e-6
OF_SQUARE, LEAST_END_DIFFERENCE = 0.02, 1e-9  # beside a slight impact, of its depth's square
LARGEST_CHANGE = 1e-3
SHORTEST_DIFFERENCE = 1e-7
BENT, SHORTEST_BEND = 0.02, 3e-6
ROUNDING_BEND = 1e-9  # second difference that four values good to 1e-10 may have
ROUNDING = 1e-7  # a Newton step below this that is no shorter than the last has met rounding
KEEP_SLOPES = 1e-3  # after a Newton step shorter than this the slopes of g still serve
CONVERGED = 1e-9  # relative length of a Newton step after which to stop
SATISFIED = 1e-7  # residual of a condition up to which a solution counts
CLEAR = 0.2  # of the way to the nearest grazing: a difference that does not reach it
FAST, STAGNANT = 0.1, 0.3  # rates of Newton's steps: slopes are kept; rounding is all that is left
SAME_FREQUENCY = 1e-12  # relative, of two that are held alike
SINGULAR = 1e-14  # least over largest pivot of a Jacobian without a tangent
SHORTER = 0.2  # of the length that the change would allow: the next difference


@dataclass(frozen=True, eq=False)
class OrbitFamily:
    """Periodic orbits of a system in which chosen numbers may change.

    Parameters
    ----------
    problem : ShootingProblem
        At the start; its coordinates z are those of the unknowns. Where it begins at a phase other
        than zero, the unknowns have other states of the orbits than these.
    observe : str
        Interface whose displacement is reported.
    frequency_hz : float
        Excitation frequency where that is no parameter.
    charts : tuple of Chart
        The parameters.
    unfolding : (N,) array, optional
        Direction that is added to the shooting equations, times one more unknown.
    passages : tuple of Passage
        Where rigid stops let the motions pass.
    origin : (N,) array, optional
        States from which the size of orbits counts; zero unless given.
    least : float
        Unit of relative lengths where orbits are smaller: where a limit cycle shrinks to rest.
    """

    problem: ShootingProblem
    observe: str
    frequency_hz: float
    charts: tuple[Chart, ...]
    unfolding: Real | None = None
    passages: tuple[Passage, ...] = ()
    origin: Real | None = None
    least: float = 0.0

    @classmethod
    def around(cls, orbit: Orbit, charts: tuple[Chart, ...]) -> OrbitFamily:
        """The family that an orbit belongs to."""
        return cls(orbit.problem, orbit.observe, orbit.frequency_hz, charts)

    @classmethod
    def in_frequency(cls, orbit: Orbit) -> OrbitFamily:
        """That in the excitation frequency alone, up to an octave away."""
        hz = orbit.frequency_hz
        return cls.around(orbit, (Chart(Parameter(FREQUENCY), 0.5 * hz, 2.0 * hz),))

    def unfolded(self, direction: Real) -> OrbitFamily:
        """The family with a direction added to its equations."""
        return replace(self, unfolding=direction)

    def past(self, passages: tuple[Passage, ...]) -> OrbitFamily:
        """The family of motions past rigid stops."""
        return self if passages == self.passages else replace(self, passages=passages)

    def shot_from(self, start: float) -> OrbitFamily:
        """The family by its states at the phases of shooting from a first one on."""
        return replace(self, problem=replace(self.problem, start=start))

    def repeated(self, times: int) -> OrbitFamily:
        """The family of the same orbits, run through several times."""
        if times == 1:
            return self
        base = self.problem
        period, segments = times * base.period, times * base.segments
        return replace(self, problem=replace(base, period=period, segments=segments))

    @cached_property
    def halved(self) -> OrbitFamily:
        """The family of orbits of half the period, on half the segments."""
        base = self.problem
        halved = replace(base, period=base.period // 2, segments=base.segments // 2)
        return replace(self, problem=halved)

    @property
    def system(self) -> System:
        """The system at the start."""
        return self.problem.flow.system

    @property
    def options(self) -> FlowOptions:
        """Accuracy of the flow map."""
        return self.problem.flow.options

    @property
    def period(self) -> int:
        """Period multiple n."""
        return self.problem.period

    @property
    def segments(self) -> int:
        """Number k of shooting segments."""
        return self.problem.segments

    @property
    def start(self) -> float:
        """Forcing phase of the first state, less than a segment's: orbits have it at zero."""
        return self.problem.start

    @cached_property
    def in_frequency_alone(self) -> bool:
        """Whether the unknowns are those of an orbit: its states and ln ω."""
        alone = len(self.charts) == 1 and self.charts[0].parameter.name == FREQUENCY
        return alone and self.unfolding is None and not (self.passages or self.start)

    @property
    def is_exact(self) -> bool:
        """Whether the flow map differentiates by all parameters, so that no differences do."""
        return all(
            has_exact_derivatives(c.parameter) or c.parameter.name == FREQUENCY for c in self.charts
        )

    @cached_property
    def n_states(self) -> int:
        """Number N of states, and of shooting equations."""
        return self.problem.size * self.problem.segments

    @property
    def n_free(self) -> int:
        """Number m of parameters, and of the unfolding number."""
        return len(self.charts) + (self.unfolding is not None)

    def unknowns(self, orbit: Orbit) -> Real:
        """Unknowns (N + m,) of an orbit of the family."""
        nodes = orbit.problem.nodes(orbit.point)
        if self.start:
            carried = [
                _carried(orbit.problem, self.passages, node, phase, phase + self.start, orbit.omega)
                for node, phase in zip(nodes, orbit.problem.phases.tolist(), strict=False)
            ]
            nodes = np.array(carried)
        here, start = orbit.system.linear, self.system.linear
        if here is not start:  # an orbit of the family has coordinates of its own
            nodes = nodes @ start.coordinates_of(here).T
        if self.in_frequency_alone and here is start:
            return orbit.point
        point = np.zeros(self.n_states + self.n_free)
        point[: self.n_states] = nodes.ravel()
        for place, chart in enumerate(self.charts, self.n_states):
            if chart.parameter.name == FREQUENCY:
                point[place] = orbit.point[-1]
                continue
            value = value_of(orbit.system, orbit.frequency_hz, chart.parameter)
            point[place] = chart.coordinate(value)
        return point

    @property
    def scales(self) -> tuple[tuple[Parameter, bool, float], ...]:
        """The parameters, and on which scale each is followed."""
        return tuple(chart.scale for chart in self.charts)

    def holds(self, orbit: Orbit) -> bool:
        """Whether an orbit of the family's period has the frequency that is held, if one is."""
        if any(moves_frequency(chart.parameter) for chart in self.charts):
            return True
        return math.isclose(orbit.frequency_hz, self.frequency_hz, rel_tol=SAME_FREQUENCY)

    def place(self, orbit: Orbit) -> Solved:
        """An orbit of the family, of the system that the values of its parameters give."""
        point = self.unknowns(orbit)
        if not self.in_frequency_alone:
            orbit = self.at(point).orbit_by(orbit.jacobians, orbit.error)
        return Solved(self, point, orbit)

    def values(self, point: Real) -> Real:
        """Values of the parameters."""
        coordinates = point[self.n_states :]
        return np.array(
            [c.value(x) for c, x in zip(self.charts, coordinates.tolist(), strict=False)]
        )

    def at(self, point: Real) -> Evaluation:
        """The equations at a point."""
        return Evaluation(self, point)

    def scale(self, point: Real) -> float:
        """Root mean square of the states: the unit of relative lengths."""
        states = point[: self.n_states] if self.origin is None else self.from_origin(point)
        size = math.sqrt(float(states @ states) / self.problem.segments)
        return max(size, self.least) or 1.0

    def from_origin(self, point: Real) -> Real:
        """States (N,) counted from the origin."""
        return point[: self.n_states] - (0.0 if self.origin is None else self.origin)

    def metric(self, point: Real) -> Real:
        """Weights g of the arclength ds² = Σ g Δ², relative in the states."""
        n, weights = self.n_states, np.empty(point.size)
        weights[:n] = 1.0 / (self.problem.segments * self.scale(point) ** 2)
        weights[n:] = 1.0
        return weights


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The shooting equations of a family at a point; what is asked for is computed once.

    Parameters
    ----------
    family : OrbitFamily
        Whose equations.
    point : (N + m,) array
        The unknowns.
    """

    family: OrbitFamily
    point: Real

    @cached_property
    def values(self) -> Real:
        """Values of the parameters."""
        return self.family.values(self.point)

    @cached_property
    def problem(self) -> ShootingProblem:
        """Shooting equations of the changed system."""
        family = self.family
        system = family.system
        for chart, value in zip(family.charts, self.values.tolist(), strict=True):
            system = with_value(system, chart.parameter, value)
        if system is family.system:
            return family.problem
        return replace(family.problem, flow=FlowMap(system, family.options))

    @cached_property
    def log_omega(self) -> float:
        """Logarithm of the excitation frequency in rad/s."""
        hz = self.family.frequency_hz
        coordinates = self.point[self.family.n_states :].tolist()
        for chart, coordinate in zip(self.family.charts, coordinates, strict=False):
            if chart.parameter.name == FREQUENCY:
                return float(coordinate)
            if moves_frequency(chart.parameter):
                hz = chart.value(coordinate)
        return math.log(2.0 * math.pi * hz)

    @property
    def omega(self) -> float:
        """Excitation frequency in rad/s."""
        return math.exp(self.log_omega)

    @cached_property
    def change(self) -> tuple[Real, Real] | None:
        """Matrices from the coordinates of the family's system to those here, and back."""
        here, start = self.problem.flow.system.linear, self.family.system.linear
        if here is start:
            return None
        return here.coordinates_of(start), start.coordinates_of(here)

    @cached_property
    def nodes(self) -> Real:
        """States (k, 2n) in the coordinates of the changed system."""
        nodes = self.point[: self.family.n_states].reshape(self.family.segments, -1)
        return nodes if self.change is None else nodes @ self.change[0].T

    @cached_property
    def segments(self) -> Segments:
        """The segments, in the coordinates of the changed system."""
        exact = [c.parameter for c in self.family.charts if has_exact_derivatives(c.parameter)]
        return self._shot(True, exact)

    def _shot(self, sensitivities: bool, parameters: Sequence[Parameter] = ()) -> Segments:
        problem, passages = self.problem, self.family.passages
        return shoot_past(
            problem, passages, self.nodes, problem.phases, self.omega, sensitivities, parameters
        )

    def _back(self, ends: Real) -> Real:
        """Vectors (k, 2n) in the coordinates of the family's system."""
        return ends if self.change is None else ends @ self.change[1].T

    def _ends(self) -> Real:
        return self._back(self._shot(False).ends)

    @cached_property
    def residual(self) -> Real:
        """R(u, p), shape (N,)."""
        family = self.family
        states = self.point[: family.n_states].reshape(family.segments, -1)
        gap = (self._back(self.segments.ends) - np.roll(states, -1, axis=0)).ravel()
        if family.unfolding is not None:
            gap = gap + self.point[-1] * family.unfolding
        return np.asarray(gap)

    @property
    def blocks(self) -> Real:
        """Jacobians (k, 2n, 2n) of the segments, in the coordinates of the family's system."""
        blocks = pinned(self.problem.flow.system, self.segments.jacobians)
        return blocks if self.change is None else self.change[1] @ blocks @ self.change[0]

    def by_parameter(self, which: int) -> Real:
        """Derivatives (k, 2n) of the segments' ends by the coordinate of a parameter."""
        charts, place = self.family.charts, self.family.n_states + which
        chart = charts[which]
        if has_exact_derivatives(chart.parameter):
            exact = sum(has_exact_derivatives(c.parameter) for c in charts[:which])
            slope = chart.slope(float(self.point[place]))
            return slope * self._back(self.segments.d_parameters[:, :, exact])
        if chart.parameter.name == FREQUENCY:
            return self.omega * self._back(self.segments.d_omega)
        return self.difference(place, Evaluation._ends)

    @cached_property
    def jacobian(self) -> Real:
        """Derivatives of R, shape (N, N + m)."""
        family, blocks = self.family, self.blocks
        n, k, size = family.n_states, family.segments, family.system.state_size
        matrix = np.zeros((n, n + family.n_free))
        for j in range(k):
            rows = slice(j * size, (j + 1) * size)
            matrix[rows, rows] += blocks[j]
            after = (j + 1) % k * size
            matrix[rows, after : after + size] -= np.eye(size)
        for which in range(len(family.charts)):
            matrix[:, n + which] = self.by_parameter(which).ravel()
        if family.unfolding is not None:
            matrix[:, -1] = family.unfolding
        return matrix

    def difference(self, place: int, function: Callable[[Evaluation], Real]) -> Real:
        """Derivative of a function by a parameter, from two changed systems."""
        step = np.zeros(self.point.size)
        step[place] = self._end_difference
        before, after, length = _pair(self, step, function)
        return np.asarray((after - before) / (length * self._end_difference))

    @cached_property
    def _end_difference(self) -> float:
        """Over which ends are differenced; the speed of an impact goes with the root of a way.

        A motion past a grazing is smooth.
        """
        if not self.family.system.rigid_stops or self.family.passages:
            return END_DIFFERENCE
        way = OF_SQUARE * nearest_depth(self.orbit) ** 2
        return min(max(way, LEAST_END_DIFFERENCE), END_DIFFERENCE)

    @cached_property
    def orbit(self) -> Orbit:
        """The orbit of this point; none that closes unless the residual vanishes."""
        return self.make_orbit(math.inf)

    def make_orbit(self, error: float) -> Orbit:
        """The orbit with an estimate of its relative error."""
        if self.family.start:
            return self._at_phase_zero().make_orbit(error)
        return self.orbit_by(pinned(self.problem.flow.system, self.segments.jacobians), error)

    def orbit_by(self, jacobians: Real, error: float) -> Orbit:
        """The orbit with Jacobians (k, 2n, 2n) that are known."""
        point = np.append(self.nodes.ravel(), self.log_omega)
        return Orbit(self.problem, point, jacobians, error, self.family.observe)

    def _at_phase_zero(self) -> Evaluation:
        """The same orbit by its states at the phases that orbits have."""
        family, phases = self.family, self.problem.phases.tolist()
        ends = [
            _carried(self.problem, family.passages, node, first, last - family.start, self.omega)
            for node, first, last in zip(self.nodes, phases, phases[1:], strict=False)
        ]
        point = self.point.copy()
        point[: family.n_states] = np.roll(self._back(np.array(ends)), 1, axis=0).ravel()
        return Evaluation(family.shot_from(0.0), point)


def _carried(
    problem: ShootingProblem,
    passages: tuple[Passage, ...],
    state: Real,
    first: float,
    last: float,
    omega: float,
) -> Real:
    """State (2n,) at a later phase."""
    phases = np.array([first, last])
    return np.asarray(shoot_past(problem, passages, state[None], phases, omega, False).ends[0])


class Condition(Protocol):
    """Scalar equations beside those of shooting."""

    def value(self, at: Evaluation) -> Real:
        """Values g at a point, shape (n_conditions,), without dimension."""

    def reach(self, at: Evaluation) -> float:
        """Relative length over which g may be differenced."""

    def renewed(self, at: Evaluation) -> Condition:
        """The same condition with the borders or phases that suit a solution."""


@dataclass(frozen=True, eq=False)
class Free:
    """No condition; there is one such object, also of another process."""

    def __reduce__(self) -> str:
        return "FREE"

    def value(self, at: Evaluation) -> Real:
        """Nothing to hold, shape (0,)."""
        return np.zeros(0)

    def reach(self, at: Evaluation) -> float:
        """Any."""
        return DIFFERENCE

    def renewed(self, at: Evaluation) -> Condition:
        """The same."""
        return self


def reach_of_grazing(at: Evaluation) -> float:
    """Length of a difference that does not carry an extreme of a penetration through zero."""
    depth = nearest_depth(at.orbit)
    return min(max(CLEAR * depth, SHORTEST_DIFFERENCE), DIFFERENCE)


def nearest_depth(orbit: Orbit) -> float:
    """Smallest absolute value of an extreme of a penetration, relative to the orbit's size."""
    stops = len(orbit.system.stops)
    values = [np.abs(orbit.touches(stop).values).min(initial=math.inf) for stop in range(stops)]
    return float(min(values, default=math.inf)) / length_unit(orbit)


def length_unit(orbit: Orbit) -> float:
    """Displacement at a stop that goes with the size of the orbit, in m."""
    rows = orbit.problem.flow.stop_rows
    size = orbit.problem.scale(orbit.point)
    return size * (float(np.linalg.norm(rows, axis=1).max()) if rows.size else 1.0)


class Place(Protocol):
    """An orbit of a family: a point of a branch, or what Newton's method has found."""

    @property
    def family(self) -> OrbitFamily:
        """The family."""

    @property
    def point(self) -> Real:
        """Its unknowns (N + m,)."""

    @property
    def orbit(self) -> Orbit:
        """The orbit."""


@dataclass(frozen=True, eq=False)
class Solved:
    """An orbit of a family that meets a condition; see `Place`."""

    family: OrbitFamily
    point: Real
    orbit: Orbit


@dataclass(frozen=True, eq=False)
class Corrected:
    """Outcome of Newton's method.

    Parameters
    ----------
    at : Evaluation
        The equations at the last point.
    condition : Condition
        What was to be met.
    step : float
        Relative length of the last Newton step.
    iterations : int
        Number of steps.
    failure : str
        Empty, or why no solution was found.
    solution : Solution, optional
        That of the compiled method, if it was used.
    """

    at: Evaluation
    condition: Condition
    step: float
    iterations: int
    failure: str
    solution: Solution | None = None

    @property
    def family(self) -> OrbitFamily:
        """Whose orbit was sought."""
        return self.at.family

    @property
    def point(self) -> Real:
        """The last point (N + m,)."""
        return self.at.point

    @cached_property
    def along(self) -> Real:
        """Direction (N + m,) of the curve, if one is left free: of no particular length or sense.

        Raises
        ------
        ConvergenceError
            If the equations have no derivatives there.
        """
        if self.solution is not None:
            return self.solution.along
        _, surface = tangent_surface(self.at)
        by_surface = gradient(self.at, surface, self.condition)
        return np.asarray(surface @ np.linalg.svd(by_surface, full_matrices=True)[2][-1])

    def tangent(self, towards: Real) -> Real:
        """Unit tangent of the curve, on the side of the vector `towards`."""
        along = self.along
        weighted = self.weights * along
        length = math.sqrt(float(along @ weighted))
        return along / (length if float(towards @ weighted) >= 0.0 else -length)

    @cached_property
    def weights(self) -> Real:
        """Metric (N + m,) at the point."""
        return self.family.metric(self.point)

    @property
    def converged(self) -> bool:
        """Whether a solution was found."""
        return not self.failure

    @cached_property
    def orbit(self) -> Orbit:
        """The orbit found."""
        if self.solution is not None:
            return Orbit.of(self.family.problem, self.solution, self.family.observe)
        return self.at.make_orbit(self.step)

    def residual(self, condition: Condition) -> float:
        """Largest of the relative error of closing and the condition."""
        return residual_at(self.at, condition)


def residual_at(at: Evaluation, condition: Condition) -> float:
    """Largest of the relative error of closing and a condition."""
    closing = float(np.linalg.norm(at.residual))
    closing /= math.sqrt(at.family.segments) * at.family.scale(at.point)
    return max(closing, float(np.abs(condition.value(at)).max(initial=0.0)))


FREE = Free()


def correct(
    family: OrbitFamily,
    guess: Real,
    condition: Condition = FREE,
    row: Real | None = None,
    level: float | None = None,
    *,
    max_iterations: int = ITERATIONS,
    longest: float = math.inf,
    aim: Real | None = None,
    like: Trajectory | None = None,
    closings: int = -1,
    turn: float = 0.0,
) -> Corrected:
    """Newton's method for R = 0, g = 0 and, if a row is given, ``row @ point = level``.

    With `FREE` as condition, orbits in the frequency alone are found by the compiled method.

    Parameters
    ----------
    family : OrbitFamily
        Whose orbits.
    guess : (N + m,) array
        Where to start.
    condition : Condition
        g, with m values, or m - 1 if a row is given.
    row : (N + m,) array, optional
        Normal of a plane.
    level : float, optional
        Offset of the plane, which leads through the guess unless given.
    max_iterations : int
        Most steps.
    longest : float
        Relative length of the way from `aim` after the first step, beyond which none is made.
    aim : (N + m,) array, optional
        The guess unless given.
    like, closings, turn
        For the compiled method, see `ShootingProblem.correct`; the other takes no notice.

    Returns
    -------
    Corrected
    """
    if row is not None and level is None:
        level = float(row @ guess)
    if row is not None and condition is FREE and family.in_frequency_alone:
        found = family.problem.correct(
            guess, row, offset=level, longest=min(longest, LONGEST), max_iterations=max_iterations,
            like=like, aim=aim, closings=closings, turn=turn,
        )  # fmt: skip
        at = Evaluation(family, found.point)
        return Corrected(at, condition, found.last_step, found.iterations, found.failure, found)
    return _bordered(family, guess, condition, row, level or 0.0, max_iterations, longest, aim)


def _bordered(
    family: OrbitFamily,
    guess: Real,
    condition: Condition,
    row: Real | None,
    level: float,
    max_iterations: int,
    longest: float,
    aim: Real | None,
) -> Corrected:
    """Newton's method with differences of the condition; see `correct`."""
    point, before, step = guess, math.inf, math.inf
    slopes = None
    for iteration in range(1, max_iterations + 1):
        try:
            if not (step < KEEP_SLOPES and step < FAST * before):
                slopes = None
            before = step
            change, slopes = _newton_step(family.at(point), condition, slopes, row, level)
            weights = family.metric(point)
            step = metric_length(weights, change)
            point = point + change
            if iteration == 1 and longest < math.inf:
                way = step if aim is None else metric_length(weights, point - aim)
                if way > longest:
                    raise ConvergenceError("the first step is too long")
            if not step < 2.0:
                raise ConvergenceError("Newton's method diverged")
            if step <= CONVERGED or (step < ROUNDING and step > STAGNANT * before):
                found = Corrected(family.at(point), condition, step, iteration, "")
                if found.residual(condition) < SATISFIED:
                    return found
        except FAILURES as error:
            return Corrected(family.at(point), condition, step, iteration, str(error))
    failure = f"Newton's method did not converge, last relative step {step:.1e}"
    return Corrected(family.at(point), condition, step, max_iterations, failure)


def _newton_step(
    at: Evaluation, condition: Condition, slopes: Real | None, row: Real | None, level: float
) -> tuple[Real, Real]:
    """The change of the unknowns, and g'.

    The derivatives of g, as rows (n_conditions, N + m) that hold on the surface, are computed
    unless given.
    """
    normal, surface = tangent_surface(at)
    if slopes is None:
        by_surface = gradient(at, surface, condition)
        slopes = by_surface @ surface.T * at.family.metric(at.point)
    else:
        by_surface = slopes @ surface
    try:
        g = condition.value(at.family.at(at.point + normal))
    except SystemModelError:  # beyond what a parameter can be; the next step starts nearer
        g = condition.value(at)
    rows, right = by_surface, -g
    if row is not None:
        rows = np.vstack([by_surface, row @ surface])
        right = np.append(right, level - float(row @ (at.point + normal)))
    change = normal + surface @ np.linalg.solve(rows, right)
    if not np.all(np.isfinite(change)):
        raise ConvergenceError("singular Jacobian")
    return change, slopes


def tangent_surface(at: Evaluation) -> tuple[Real, Real]:
    """Shortest Newton step for R = 0 alone, and m unit tangents (N + m, m) of R = 0."""
    family = at.family
    n = family.n_states
    unit = 1.0 / np.sqrt(family.metric(at.point))
    if not (np.isfinite(at.jacobian).all() and np.isfinite(at.residual).all()):
        raise ConvergenceError("the motion has no finite derivatives")
    q, r = np.linalg.qr((at.jacobian * unit).T, mode="complete")
    if np.abs(np.diag(r)).min() < SINGULAR * np.abs(r).max():
        raise ConvergenceError("singular Jacobian")
    normal = q[:, :n] @ solve_triangular(r[:n], -at.residual, trans="T")
    return unit * normal, unit[:, None] * q[:, n:]


def gradient(at: Evaluation, directions: Real, condition: Condition) -> Real:
    """Derivatives of g along unit directions (N + m, d), shape (n_conditions, d)."""
    here = condition.value(at)
    return np.array([_slope(at, direction, condition, here) for direction in directions.T]).T


def _slope(at: Evaluation, direction: Real, condition: Condition, here: Real) -> Real:
    """Derivatives of g along a unit direction, over a length on which it hardly bends."""
    h = condition.reach(at)
    while True:
        first, last, length = _pair(at, h * direction, condition.value)
        change = float(np.abs(last - first).max(initial=0.0))
        bend = float(np.abs(last - 2.0 * here + first).max(initial=0.0))
        if change > LARGEST_CHANGE and h > SHORTEST_DIFFERENCE:
            h = max(SHORTER * LARGEST_CHANGE / change * h, SHORTEST_DIFFERENCE)
        elif bend > max(BENT * change, ROUNDING_BEND) and h > SHORTEST_BEND:
            h = max(0.5 * BENT * change / bend * h, SHORTEST_BEND)
        else:
            return (last - first) / (h * length)


def _pair(
    at: Evaluation, step: Real, function: Callable[[Evaluation], Real]
) -> tuple[Real, Real, float]:
    """A function a step before and a step behind a point, and how many steps are between.

    Where the system has no such value on one side (a damping below zero), the point itself serves.
    """
    found, length = [], 0.0
    for sign in (-1.0, 1.0):
        try:
            found.append(function(at.family.at(at.point + sign * step)))
            length += 1.0
        except SystemModelError:
            found.append(function(at))
    if not length:
        raise ConvergenceError("no derivative, for there are no systems on either side")
    return found[0], found[1], length
