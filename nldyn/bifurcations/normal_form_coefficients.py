"""Reduction to the critical direction: null vectors and normal-form coefficients of maps in a loop.

A periodic orbit is a fixed point of k maps, one after the other: x_{j+1} = Φ_j(x_j, P) with
x_{k+1} = x_1. Where a multiplier μ of it lies on the unit circle, the motion on the centre manifold
is that of one number ξ; its first nonlinear coefficient decides on which side the other orbits are
and whether they attract. The products of the maps are never formed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES, ComputationError, ConvergenceError
from nldyn.flow.sliding import slides_one_way
from nldyn.orbits.bordered import Place

LARGEST_STEP = 0.1  # in ξ, of the differences
SMALLEST_STEP = 1e-7
LOCATED = 1e-7  # of an orbit's size: branch points lie no further from where they are said to be
NEAR_CROSSING = 5e-3  # of an orbit's size: a turn within it may be a crossing
RATIO = 1.6  # of successive steps
STEPS = 8
ENOUGH = 1e-6  # relative error of a coefficient that needs no more steps
SAFETY = 3.0  # times the error seen in a table of differences, of which rounding is a part
LEAST_ERROR = 1e-8  # relative, of a coefficient: special points are located no better
DOUBLE = 1e-14  # cosine of left and right vectors, below which a multiplier is double
PLAIN = 0.01  # part of the frequency's derivative along the critical vector: no crossing is near

Evaluation = tuple[Real, Real, Hashable]
Vectors = NDArray[Any]  # real or complex


class CoefficientError(ComputationError):
    """A coefficient that cannot be computed; the text says why."""


@dataclass(frozen=True)
class Estimate:
    """A number with an estimate of its error.

    Examples
    --------
    >>> Estimate(-2.0, 0.1).sign, Estimate(-2.0, 3.0).sign
    (-1, 0)
    """

    value: float
    error: float

    @property
    def sign(self) -> int:
        """Sign of the value, 0 where three times the error hides it."""
        if not abs(self.value) > 3.0 * self.error:
            return 0
        return 1 if self.value > 0.0 else -1


@dataclass(frozen=True, eq=False)
class Loop:
    """k maps that lead from node to node and back to the first, at a fixed point.

    Parameters
    ----------
    nodes : (k, n)
        The fixed point.
    parameter : float
        P.
    evaluate : callable
        ``evaluate(nodes, parameter)`` gives the Jacobians (k, n, n), the derivatives with respect
        to P (k, n), and something hashable that stays the same where the maps are smooth (which
        stops are touched, say).
    scale : float
        Length of the root mean square of the nodes' changes that counts as ξ = 1.
    """

    nodes: Real
    parameter: float
    evaluate: Callable[[Real, float], Evaluation]
    scale: float = 1.0

    @cached_property
    def _here(self) -> Evaluation:
        return self.evaluate(self.nodes, self.parameter)

    @property
    def jacobians(self) -> Real:
        """Jacobians (k, n, n) at the fixed point."""
        return self._here[0]

    @property
    def pattern(self) -> Hashable:
        """What stays the same around the fixed point as long as the maps are smooth."""
        return self._here[2]

    @property
    def by_parameter(self) -> Real:
        """Derivatives (k, n) of the maps with respect to P."""
        return self._here[1]

    def operator(self, mu: complex) -> Vectors:
        """Matrix (kn, kn) of x ↦ Φ_j' x_j - x_{j+1} with x_{k+1} = μ x_1; real for a real μ."""
        k, n, _ = self.jacobians.shape
        last: complex = mu.real if mu.imag == 0.0 else mu
        matrix = np.zeros((k, n, k, n), dtype=type(last))
        for j in range(k):
            matrix[j, :, j] += self.jacobians[j]
            matrix[j, :, (j + 1) % k] -= np.eye(n) * (last if j == k - 1 else 1.0)
        return matrix.reshape(k * n, k * n)

    def critical(self, mu: complex) -> tuple[Vectors, Vectors]:
        """Right vectors q (k, n) and left vectors y (k, n) of a multiplier μ.

        Φ_j' q_j = q_{j+1} with q_{k+1} = μ q_1, and y_j is the adjoint vector at the end of the map
        j: y_j Φ_j' = y_{j-1} with y_0 = μ y_k. The q_j have the root mean square `scale`, and
        y_j Φ_j' q_j = 1.
        """
        left, _, right = np.linalg.svd(self.operator(mu))
        q = right[-1].conj().reshape(self.nodes.shape)
        y = left[:, -1].conj().reshape(self.nodes.shape)
        q = q * self.scale / self.size(q)
        if mu.imag == 0.0:  # the same sign whatever the linear algebra library
            q = q * np.sign(q.flat[np.argmax(np.abs(q))])
        product = np.einsum("ji,jil,jl->", y, self.jacobians, q) / len(q)
        if abs(product) < DOUBLE * np.linalg.norm(y) * np.linalg.norm(q):
            raise CoefficientError("the critical multiplier is double")
        return q, y / product

    def size(self, x: Vectors) -> float:
        """Root mean square of the nodes' changes, without `scale`."""
        return float(np.linalg.norm(x)) / math.sqrt(len(x))

    def solve(self, mu: complex, rest: Vectors) -> Vectors:
        """Solution x (k, n) of Φ_j' x_j + rest_j = x_{j+1} with x_{k+1} = μ x_1."""
        return np.asarray(np.linalg.solve(self.operator(mu), -rest.ravel()).reshape(rest.shape))

    def solve_beside(self, q: Real, y: Real, rest: Real) -> Real:
        """The same for μ = 1 where that is a multiplier: the solution normal to q.

        The share of `rest` that no x can balance is removed along y.
        """
        size = q.size
        bordered = np.zeros((size + 1, size + 1))
        bordered[:size, :size] = self.operator(1.0)
        bordered[:size, size], bordered[size, :size] = y.ravel(), q.ravel()
        right = np.append(-rest.ravel(), 0.0)
        return np.asarray(np.linalg.solve(bordered, right)[:size].reshape(q.shape))


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line through the fixed point of a loop, along which the maps are differentiated.

    Parameters
    ----------
    loop : Loop
        The maps.
    direction : (k, n)
        Change of the nodes for a step of 1.
    pace : float
        Change of P for a step of 1.
    """

    loop: Loop
    direction: Real
    pace: float = 0.0
    _known: dict[float, tuple[Real, Real, Real]] = field(default_factory=dict, repr=False)

    def differences(self, h: float) -> tuple[Real, Real, Real]:
        """First and second derivatives of the Jacobians, and the first of ∂Φ/∂P.

        Central differences with the step h, shapes (k, n, n), (k, n, n) and (k, n). Their errors
        are series in h².

        Raises
        ------
        CoefficientError
            If the maps are not smooth within the step.
        """
        if h not in self._known:
            loop = self.loop
            ends = [
                loop.evaluate(loop.nodes + step * self.direction, loop.parameter + step * self.pace)
                for step in (h, -h)
            ]
            if any(end[2] != loop.pattern for end in ends):
                raise CoefficientError("a stop is touched or left within the step")
            (first, first_by, _), (last, last_by, _) = ends
            self._known[h] = (
                (first - last) / (2.0 * h),
                (first - 2.0 * loop.jacobians + last) / h**2,
                (first_by - last_by) / (2.0 * h),
            )
        return self._known[h]


def estimated(value: Callable[[float], float], *lines: Line) -> Estimate:
    """Limit for h → 0 of a value that is made of differences along lines.

    The first step is at most `LARGEST_STEP`. It is shortened until nothing is touched or left at
    the ends of any step, and further: the derivatives of the maps grow towards the place where a
    stop is touched. The error is at least `LEAST_ERROR` of the value.

    Raises
    ------
    CoefficientError
        If a stop is touched or left within `SMALLEST_STEP`.
    """
    h = LARGEST_STEP
    while h > SMALLEST_STEP:
        first = h if h == LARGEST_STEP else h / RATIO
        try:
            for line in lines:
                line.differences(h)
            found = extrapolated(value, first)
        except CoefficientError:
            h /= RATIO
            continue
        return Estimate(found.value, SAFETY * found.error + LEAST_ERROR * abs(found.value))
    raise CoefficientError(
        "a contact begins, ends or grazes so close by that the flow map has no second derivative "
        "of use"
    )


def loop_of(place: Place) -> Loop:
    """The segments of an orbit as maps of its states and its parameter, with the finer flow map.

    P is the parameter's coordinate, ln ω for the frequency, and ξ = 1 a change of the orbit by its
    own size, as in the metric of the arclength. What must stay the same is how often each stop
    closes, and which are closed at the nodes.
    """
    family = place.family
    system = family.problem.flow.system
    if system.sliders:
        raise CoefficientError("dry friction bends the motion wherever something turns or sticks")
    if any(stop.friction for stop in system.round_stops.values()):
        here = family.at(place.point)
        flow, phases = here.problem.flow, here.problem.phases
        if not slides_one_way(flow.trajectory(here.nodes, phases, here.omega)):
            raise CoefficientError("what rubs in a round clearance turns or sticks on this motion")
    finer = replace(family, problem=replace(family.problem, flow=family.problem.flow.finer))
    nodes = place.point[:-1].reshape(family.segments, -1)

    def evaluate(nodes: Real, parameter: float) -> Evaluation:
        at = finer.at(np.append(nodes.ravel(), parameter))
        try:
            jacobians, pace = at.blocks, at.by_parameter(0)
        except ConvergenceError as error:
            raise CoefficientError(str(error)) from None
        flow = at.problem.flow
        stops = enumerate(flow.system.stops)
        closed = np.array([flow.outputs_at(i, at.nodes) > stop.gap for i, stop in stops])
        return jacobians, pace, (at.segments.closings.tobytes(), closed.tobytes())

    return Loop(nodes, float(place.point[-1]), evaluate, family.scale(place.point))


def turns_near_crossing(place: Place) -> bool:
    """Whether a branch that turns at an orbit may cross another one there, and not be folded.

    At a fold the equations' derivative with respect to P has a part that no change of the states
    balances; where branches cross it has none. The part changes along the branch: here it vanishes
    within `NEAR_CROSSING` of the orbit's size. An orbit for which this cannot be computed is a
    fold.
    """
    try:
        loop = loop_of(place)
        q, y = loop.critical(1.0)
        part = abs(float(np.sum(y * loop.by_parameter)))
        if part > PLAIN * float(np.linalg.norm(y) * np.linalg.norm(loop.by_parameter)):
            return False  # a plain fold, at no further cost
        return part < NEAR_CROSSING * abs(mixed_derivative(loop, q, y).value)
    except FAILURES:
        return False


def extrapolated(value: Callable[[float], float], first: float) -> Estimate:
    """Limit for h → 0 of a value whose error is a series in h², with its error.

    Richardson's extrapolation over falling steps: long steps suffer from the series, short ones
    from rounding. Of all entries of the table the one is taken that differs least from the two that
    it was made of (Ridders 1982). Such a difference may be small by chance: the error is the
    largest distance to the four next best entries. Steps end once the error is below `ENOUGH`.

    Examples
    --------
    >>> import math
    >>> found = extrapolated(lambda h: (math.exp(h) - math.exp(-h)) / (2 * h), 0.5)
    >>> abs(found.value - 1.0) <= found.error < 1e-6
    True
    """
    entries: list[tuple[float, float]] = []
    above: list[float] = []
    found = Estimate(math.nan, math.inf)
    for i in range(STEPS):
        row = [value(first / RATIO**i)]
        for j, coarser in enumerate(above):
            power = RATIO ** (2 * (j + 1))
            row.append(row[j] + (row[j] - coarser) / (power - 1.0))
            entries.append((max(abs(row[-1] - row[j]), abs(row[-1] - coarser)), row[-1]))
        above = row
        if len(entries) < 5:
            continue
        (error, best), *others = sorted(entries)[:5]
        found = Estimate(best, max(error, *(abs(best - other) for _, other in others)))
        if found.error < ENOUGH * abs(best):
            break
    return found


def _ratio(top: Estimate, bottom: Estimate) -> Estimate:
    """Quotient of two estimates."""
    value = top.value / bottom.value
    return Estimate(value, abs(value) * (_relative(top) + _relative(bottom)))


def _relative(number: Estimate) -> float:
    return number.error / abs(number.value) if number.value else math.inf


@dataclass(frozen=True)
class Coefficients:
    """ξ ↦ μ ξ (1 + slope·(P - P₀)) + nonlinear·(ξ², ξ³ or |ξ|²ξ); see the functions that give them.

    Parameters
    ----------
    slope : Estimate
        Of the linear term (for a fold of the constant term).
    nonlinear : Estimate
        First coefficient of a power of ξ.
    """

    slope: Estimate
    nonlinear: Estimate

    @property
    def parameter(self) -> Estimate:
        """(P - P₀)/ξ² on the branch of the other orbits."""
        found = _ratio(self.nonlinear, self.slope)
        return Estimate(-found.value, found.error)


def fold(loop: Loop) -> tuple[Coefficients, Real]:
    """ξ ↦ ξ + slope·(P - P₀) + a ξ², a = ½⟨p, B(q, q)⟩, and the vectors q (k, n).

    Source: Kuznetsov (2004), section 5.4.1.
    """
    q, y = loop.critical(1.0)

    line = Line(loop, q)

    def quadratic(h: float) -> float:
        return 0.5 * float(np.einsum("ji,jil,jl->", y, line.differences(h)[0], q))

    slope = float(np.sum(y * loop.by_parameter))
    known = Estimate(slope, LEAST_ERROR * float(np.sum(np.abs(y * loop.by_parameter))))
    return Coefficients(known, estimated(quadratic, line)), q


def slope_of_multiplier(loop: Loop, q: Vectors, y: Vectors, tangent: Real) -> Estimate:
    """Derivative of ln|μ| by P along the direction (`tangent`, 1)."""
    length = math.hypot(loop.size(tangent) / loop.scale, 1.0)
    line = Line(loop, tangent / length, 1.0 / length)

    def derivative(h: float) -> float:
        change = line.differences(h)[0]
        return float(np.einsum("ji,jil,jl->", y, change, q).real) / line.pace

    return estimated(derivative, line)


def flip(loop: Loop) -> tuple[Coefficients, Real]:
    """ξ ↦ -ξ (1 + slope·(P - P₀)) + c ξ³, and the vectors q (k, n).

    c = ⅙⟨p, C(q, q, q) + 3 B(q, (1 - A)⁻¹ B(q, q))⟩. The doubled orbit has
    ξ² = slope·(P - P₀)/c, one of its multipliers is 1 - 4 c ξ².

    Source: Kuznetsov (2004), section 5.4.2.
    """
    q, y = loop.critical(-1.0)
    line = Line(loop, q)

    def cubic(h: float) -> float:
        first, second, _ = line.differences(h)
        bend = loop.solve(1.0, np.einsum("jil,jl->ji", first, q))
        terms = np.einsum("jil,jl->ji", second, q) + 3.0 * np.einsum("jil,jl->ji", first, bend)
        return -float(np.sum(y * terms)) / 6.0  # y ends at -1 times the adjoint vector

    tangent = loop.solve(1.0, loop.by_parameter)
    slope = slope_of_multiplier(loop, q, y, tangent)
    return Coefficients(slope, estimated(cubic, line)), q


def doubled_parameter(form: Coefficients) -> Estimate:
    """(P - P₀)/ξ² of the doubled orbits at a flip."""
    return _ratio(form.nonlinear, form.slope)


def torus(loop: Loop, mu: complex) -> Coefficients:
    """|ξ| ↦ |ξ| (1 + slope·(P - P₀) + a |ξ|²): the first Lyapunov coefficient a of a pair.

    a = ½ Re e^{-iθ} ⟨p, C(q, q, q̄) + 2 B(q, (1 - A)⁻¹ B(q, q̄)) + B(q̄, (e^{2iθ} - A)⁻¹ B(q, q))⟩.

    Source: Kuznetsov (2004), section 5.4.3.
    """
    mu = mu / abs(mu)
    q, y = loop.critical(mu)
    r, s = Line(loop, q.real), Line(loop, q.imag)

    def cubic(h: float) -> float:
        by_r, by_rr, _ = r.differences(h)
        by_s, by_ss, _ = s.differences(h)
        by_q = by_r + 1j * by_s
        steady = loop.solve(1.0, np.einsum("jil,jl->ji", by_q, q.conj()).real)
        second = loop.solve(mu * mu, np.einsum("jil,jl->ji", by_q, q))
        terms = np.einsum("jil,jl->ji", by_rr + by_ss, q)  # q² q̄ = (r² + s²) q
        terms = terms + 2.0 * np.einsum("jil,jl->ji", by_q, steady)
        terms = terms + np.einsum("jil,jl->ji", by_q.conj(), second)
        return 0.5 * float(np.sum(y * terms).real)

    tangent = loop.solve(1.0, loop.by_parameter)
    slope = slope_of_multiplier(loop, q, y, tangent)
    return Coefficients(slope, estimated(cubic, r, s))


@dataclass(frozen=True)
class Crossing:
    """Two branches that cross at a branch point.

    Parameters
    ----------
    q : (k, n)
        Null vectors of the shooting equations at constant P.
    v : (k, n)
        With these, (v, 1) is the other direction in which the equations hold to first order.
    quadratic : (Estimate, Estimate, Estimate)
        Coefficients of α², 2αβ and β² in the branching equation, whose roots give the tangents
        (αq + βv, β).
    cubic : Estimate
        c of ξ ↦ ξ (1 + slope·(P - P₀)) + c ξ³; of use where the first coefficient vanishes.
    """

    q: Real
    v: Real
    quadratic: tuple[Estimate, Estimate, Estimate]
    cubic: Estimate

    @property
    def is_pitchfork(self) -> bool:
        """Whether one of the branches has the tangent (q, 0): its other half has the same P.

        So it is if the first coefficient vanishes within its error, or within what a shift of the
        orbit by `LOCATED` of its size would do.
        """
        aa = self.quadratic[0]
        return abs(aa.value) <= max(3.0 * aa.error, 6.0 * LOCATED * abs(self.cubic.value))

    @property
    def pitchfork(self) -> Coefficients:
        """Slope and cubic coefficient along the branch that keeps its symmetry."""
        return Coefficients(self.quadratic[1], self.cubic)

    @property
    def roots(self) -> tuple[tuple[float, float], ...]:
        """Both (α, β) with aa α² + 2 ab αβ + bb β² = 0, lengths 1, or none if they are not real."""
        aa, ab, bb = (number.value for number in self.quadratic)
        inner = ab * ab - aa * bb
        if inner <= 0.0:
            return ()
        far = -(ab + math.copysign(math.sqrt(inner), ab))
        pairs = ((far, aa), (bb, far))
        return tuple((a / math.hypot(a, b), b / math.hypot(a, b)) for a, b in pairs)


def mixed_derivative(loop: Loop, q: Real, y: Real) -> Estimate:
    """⟨y, G'' (q, 0) (v, 1)⟩ with the v of `Crossing`."""
    v = loop.solve_beside(q, y, loop.by_parameter)
    return slope_of_multiplier(loop, q, y, v)


def crossing(loop: Loop) -> Crossing:
    """Coefficients of the algebraic branching equation at a branch point.

    With the null vectors (q, 0) and (v, 1) of the equations and the left vector y it says
    ⟨y, G''(αq + βv, β)²⟩ = 0.

    Source: H. B. Keller (1977), the algebraic bifurcation equation; the pitchfork as for a flip.
    """
    q, y = loop.critical(1.0)
    v = loop.solve_beside(q, y, loop.by_parameter)
    length = math.hypot(loop.size(v) / loop.scale, 1.0)
    along_q, along_v = Line(loop, q), Line(loop, v / length, 1.0 / length)

    def project(change: Real, x: Real) -> float:
        return float(np.einsum("ji,jil,jl->", y, change, x))

    def twice_q(h: float) -> float:
        return project(along_q.differences(h)[0], q)

    def twice_v(h: float) -> float:
        change, _, by_parameter = along_v.differences(h)
        return (project(change, v) + float(np.sum(y * by_parameter))) * length

    def cubic(h: float) -> float:
        first, second, _ = along_q.differences(h)
        bend = loop.solve_beside(q, y, np.einsum("jil,jl->ji", first, q))
        return (project(second, q) + 3.0 * project(first, bend)) / 6.0

    quadratic = (
        estimated(twice_q, along_q),
        mixed_derivative(loop, q, y),
        estimated(twice_v, along_v),
    )
    return Crossing(q, v, quadratic, estimated(cubic, along_q))
