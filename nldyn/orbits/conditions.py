"""Defining conditions of special points, and monitors held constant: scalar functions of orbits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import FAILURES, ConvergenceError, SystemModelError, is_finite, shown
from nldyn.flow.flow_map import Segments
from nldyn.orbits.bordered import (
    DIFFERENCE,
    Condition,
    Corrected,
    Evaluation,
    OrbitFamily,
    Place,
    Solved,
    correct,
    length_unit,
    reach_of_grazing,
)
from nldyn.orbits.extremes import nearest
from nldyn.orbits.harmonics import line_by_balance
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.passage import Passage, peak_past
from nldyn.orbits.shooting import metric_length
from nldyn.system.equilibrium import constant_force, force_at
from nldyn.system.loads import BaseMotion, ConstantForce, HarmonicForce, Unbalance
from nldyn.system.system import System

KINDS = ("LP", "PD", "NS", "BP", "GR")

BESIDE = 3e-3  # of an orbit's size: a crossing within it belongs to a turn
BESIDE_BY_DIFFERENCES = 0.1  # the same where no slighter impact is followed, see `Stepper`
TOUCH = 1e-6  # of an orbit's size: depth of a touch beside its grazing point
LEVEL, ALIKE = 1e-4, 1e-9  # relative difference of two extremes about to change places, or one
SAME_EXTREME = 1e-2  # rad between an extreme and itself on a neighbouring orbit
TOGETHER = 1e-10  # of an orbit's size: depth of touches that graze at once
ALL_GRAZE = 1e-4  # of an orbit's size: depth in each excitation period that grazes in each
CLEAR = 1e-12  # of an orbit's size: distance to a sharp touch that counts as none
WIDEST_PASSAGE = 0.5  # rad on either side of a grazing, in which a rigid stop is not there
SMALLEST_OVERLAP = 1e-3  # of null vectors: it vanishes where a multiplier is double
FARTHEST = 0.01  # of the orbit's size: depth of an extreme that may be said to graze
FOLLOWED_EXTREME = 0.2  # rad between two extremes that are one on neighbouring orbits
UNFOLDED = 1e-6  # unfolding number from which a branch point has dissolved
AT_NODE = 1e-12  # rad from a node of shooting, at which an extreme has the state of that

Monitor = str | Callable[[Orbit], float]


def bialternate(matrix: Real) -> Real:
    """Bialternate product of a matrix (m, m) with itself: its eigenvalues are μᵢμⱼ with i < j.

    Parameters
    ----------
    matrix : (m, m) array
        Any matrix.

    Returns
    -------
    (m (m - 1) / 2, m (m - 1) / 2) array

    References
    ----------
    Yu. A. Kuznetsov (2004), *Elements of Applied Bifurcation Theory*, section 10.2.2.

    Examples
    --------
    >>> bialternate(np.diag([2.0, 3.0, 5.0])).diagonal().tolist()
    [6.0, 10.0, 15.0]
    """
    p, q = np.triu_indices(matrix.shape[0], 1)
    return np.asarray(
        matrix[np.ix_(p, p)] * matrix[np.ix_(q, q)] - matrix[np.ix_(q, p)] * matrix[np.ix_(p, q)]
    )


def critical_matrix(kind: str, monodromy: Real) -> Real:
    """Matrix that is singular at a fold (LP), a flip (PD) or a Neimark-Sacker point (NS)."""
    if kind == "LP":
        return monodromy - np.eye(len(monodromy))
    if kind == "PD":
        return monodromy + np.eye(len(monodromy))
    product = bialternate(monodromy)
    return np.asarray(product - np.eye(len(product)))


@dataclass(frozen=True, eq=False)
class Singular:
    """A matrix of the monodromy is singular: the last entry g of the bordered system's solution,

    [[A, b], [cᵀ, 0]] [v, g] = [0, 1], is zero (Govaerts 2000, ch. 3; Kuznetsov 2004, 10.3).

    The value is g/bᵀc: nearly the distance of the multiplier, or of the product of two, from where
    it should be.

    Parameters
    ----------
    kind : {"LP", "PD", "NS"}
        Which matrix A.
    left, right : arrays
        Borders b and c: unit singular vectors of A to its smallest singular value.
    """

    kind: str
    left: Real
    right: Real

    @classmethod
    def of(cls, kind: str, orbit: Orbit) -> Singular:
        """The condition with the borders of an orbit."""
        return cls.bordering(kind, orbit.monodromy)

    @classmethod
    def bordering(cls, kind: str, monodromy: Real) -> Singular:
        """The condition with the borders of a monodromy matrix."""
        u, _, vh = np.linalg.svd(critical_matrix(kind, monodromy))
        return cls(kind, u[:, -1], vh[-1])

    def value(self, at: Evaluation) -> Real:
        """Relative value of g, shape (1,)."""
        matrix = critical_matrix(self.kind, at.segments.monodromy)
        size = len(matrix)
        bordered = np.zeros((size + 1, size + 1))
        bordered[:size, :size] = matrix
        bordered[:size, -1], bordered[-1, :size] = self.left, self.right
        overlap = max(abs(float(self.left @ self.right)), SMALLEST_OVERLAP)
        return np.linalg.solve(bordered, np.eye(size + 1)[-1])[-1:] / overlap

    def reach(self, at: Evaluation) -> float:
        """Not across a grazing."""
        return reach_of_grazing(at)

    def renewed(self, at: Evaluation) -> Singular:
        """The same with the borders of another orbit, of the same sense."""
        other = Singular.bordering(self.kind, at.segments.monodromy)
        left, right = other.left, other.right
        return Singular(
            self.kind,
            left if left @ self.left >= 0.0 else -left,
            right if right @ self.right >= 0.0 else -right,
        )


@dataclass(frozen=True, eq=False)
class BranchPointCondition:
    """[R_u, R_p] has lost a rank (Moore 1980): with a left border ψ and right borders c₁, c₂

    ψᵀ[R_u, R_p] + h₁c₁ᵀ + h₂c₂ᵀ = 0 with ψᵀb = 1 gives h₁ = h₂ = 0. The equations are unfolded,
    R + λb = 0, which makes the system for (u, p, λ) regular; at a true branch point λ = 0.

    Parameters
    ----------
    left : (N,) array
        b.
    right : (2, N + 1) array
        c₁ and c₂.
    unit : (N + 1,) array
        Units of the unknowns, so that h has no dimension.
    """

    left: Real
    right: Real
    unit: Real

    @classmethod
    def of(cls, at: Evaluation) -> BranchPointCondition:
        """The condition with the borders of a point, by the states and the first parameter."""
        n = at.family.n_states
        unit = 1.0 / np.sqrt(at.family.metric(at.point)[: n + 1])
        u, _, vh = np.linalg.svd(at.jacobian[:, : n + 1] * unit)
        return cls(u[:, -1], vh[-2:], unit)

    def value(self, at: Evaluation) -> Real:
        """h₁ and h₂, relative to the size of the states, shape (2,)."""
        n = self.left.size
        matrix = np.zeros((n + 2, n + 2))
        matrix[:n, : n + 1] = at.jacobian[:, : n + 1] * self.unit / self.unit[0]
        matrix[:n, -1] = self.left
        matrix[n:, : n + 1] = self.right
        return np.linalg.solve(matrix.T, np.eye(n + 2)[-1])[n:]

    def reach(self, at: Evaluation) -> float:
        """Not across a grazing."""
        return reach_of_grazing(at)

    def renewed(self, at: Evaluation) -> BranchPointCondition:
        """The same with the borders of another point."""
        return BranchPointCondition.of(at)


@dataclass(frozen=True, eq=False)
class Grazing:
    """An extreme of a stop's penetration is zero.

    A rigid stop lets the motion pass there: see `nldyn.orbits.passage`.

    Parameters
    ----------
    stop : int
        Which stop.
    is_maximum : bool
        Whether a contact begins there; else one splits.
    phase : float
        Forcing phase: the extreme nearest to it is meant.
    unit : float
        Length by which the depth is divided, in m.
    depth : float
        Value of the extreme in that unit, if it is not to be zero.
    half : float
        Phase on either side in which a rigid stop is not there; zero for an elastic one.
    every : float
        Phase after which that comes again, see `Passage`.
    others : tuple of Passage
        Of other touches of rigid stops, which may graze at the same time.
    """

    stop: int
    is_maximum: bool
    phase: float
    unit: float
    depth: float = 0.0
    half: float = 0.0
    every: float = 0.0
    others: tuple[Passage, ...] = ()

    @classmethod
    def of(cls, orbit: Orbit) -> Grazing:
        """The extreme nearest to zero of all stops.

        Raises
        ------
        SystemModelError
            If the orbit has none within 1 % of its size.
        """
        unit = length_unit(orbit)
        best, shortest = None, FARTHEST * unit
        for stop in range(len(orbit.system.stops)):
            found = orbit.touches(stop)
            rigid = orbit.system.stops[stop].impulsive
            for phase, depth, kind in zip(
                found.phases, found.values, found.is_maximum, strict=True
            ):
                if abs(depth) < shortest and (kind or not rigid):
                    shortest = abs(float(depth))
                    best = cls(stop, bool(kind), float(phase), unit)
        if best is None:
            raise SystemModelError(f"the orbit at {orbit.frequency_hz:g} Hz does not graze a stop")
        return best._beside(orbit)

    def _beside(self, orbit: Orbit) -> Grazing:
        """The same with the width of the passage of a rigid stop."""
        if not orbit.system.stops[self.stop].impulsive:
            return self
        full, found = 2.0 * math.pi * orbit.period, orbit.touches(self.stop)
        apart = np.abs((found.phases - self.phase + 0.5 * full) % full - 0.5 * full)
        others = apart[apart > SAME_EXTREME]
        half = min(0.5 * float(others.min(initial=full)), WIDEST_PASSAGE)
        slight = found.is_maximum & (np.abs(found.values) < ALL_GRAZE * self.unit)
        later = (found.phases[slight] - self.phase) % (2.0 * math.pi)
        alike = int(np.sum(np.minimum(later, 2.0 * math.pi - later) < SAME_EXTREME))
        every = 2.0 * math.pi if alike == orbit.period else full
        return replace(self, half=half, every=every)

    def with_others(self, orbit: Orbit) -> Grazing:
        """The same where all other touches of rigid stops that may graze, too, are let past."""
        if not self.half:
            return self
        let_past = [Passage(self.stop, self.phase, self.half, self.every)]
        for stop in orbit.system.rigid_stops:
            found = orbit.touches(stop)
            slight = found.is_maximum & (np.abs(found.values) < ALL_GRAZE * self.unit)
            for phase in found.phases[slight].tolist():
                if not any(one.stop == stop and one.holds(phase) for one in let_past):
                    other = Grazing(stop, True, phase, self.unit)._beside(orbit)
                    let_past.append(Passage(stop, phase, other.half, other.every))
        return replace(self, others=tuple(let_past[1:]))

    def grazing_too(self, orbit: Orbit) -> Grazing:
        """The same on an orbit that grazes, with those others that do so, too, within rounding.

        Raises
        ------
        ConvergenceError
            If the flow map fails, or another touch that was let past is an impact.
        """
        together, nodes = [], orbit.problem.nodes(orbit.point)
        for which, other in enumerate(self.others, 1):
            depth = peak_past(orbit.problem, self.passages, nodes, orbit.omega, which)[1]
            if depth > TOGETHER * self.unit:
                raise ConvergenceError("an impact was let past")
            if depth > -TOGETHER * self.unit:
                together.append(other)
        return replace(self, others=tuple(together))

    @property
    def passages(self) -> tuple[Passage, ...]:
        """Where rigid stops let the motion pass, that of this grazing first."""
        own = Passage(self.stop, self.phase, self.half, self.every)
        return (own, *self.others) if self.half else ()

    def value(self, at: Evaluation) -> Real:
        """Depth of the extreme, shape (1,).

        With a touch of depth d of a stop that is stiff from the first touch on, Jacobians change
        with its root, and so would show the rounding of d = 0; those of a contact that does not
        quite begin, or split, do not. An impact with a rigid stop does not quite happen either.
        """
        sharp = at.family.system.stops[self.stop].sharp
        clear = (CLEAR if self.is_maximum else -CLEAR) if sharp else 0.0
        return np.array([self._reached(at)[1] / self.unit - self.depth + clear])

    def _reached(self, at: Evaluation) -> tuple[float, float]:
        """Phase and depth of the extreme, also beyond a rigid stop."""
        if not self.passages:
            return self.extreme(at.orbit)
        return peak_past(at.problem, self.passages, at.nodes, at.omega)

    def reach(self, at: Evaluation) -> float:
        """The depth of an extreme has a continuous derivative also where it is zero.

        In a narrow passage between two others it is there for a short way only.
        """
        return DIFFERENCE * (self.half / WIDEST_PASSAGE if self.half else 1.0)

    def renewed(self, at: Evaluation) -> Grazing:
        """The same with the phase of another orbit."""
        renewed = replace(self, phase=self._reached(at)[0], unit=length_unit(at.orbit))
        return renewed._beside(at.orbit) if self.half else renewed

    def is_of(self, stop: int, is_maximum: bool, phase: float, period: int) -> bool:
        """Whether an extreme near a phase is this one."""
        full = 2.0 * math.pi * period
        apart = abs((phase - self.phase + 0.5 * full) % full - 0.5 * full)
        return stop == self.stop and is_maximum == self.is_maximum and apart < FOLLOWED_EXTREME

    def extreme(self, orbit: Orbit) -> tuple[float, float]:
        """Phase and depth of the extreme."""
        full = 2.0 * math.pi * orbit.period
        found = nearest(orbit.touched, self.stop, self.is_maximum, self.phase, full)
        if found is None:
            raise ConvergenceError("an extreme has vanished")
        phase = float(found[0])
        return phase, exact_output(orbit, self.stop, phase) - orbit.system.stops[self.stop].gap

    def slope(self, place: Place, phase: float) -> Real:
        """Derivative (N + 1,) of the depth at a phase with respect to the unknowns of a family."""
        slope = np.zeros(place.point.size)
        states = slope[:-1].reshape(place.family.segments, -1)
        segment, row, pace = output_slope(place, self.stop, phase)
        states[segment] = row
        slope[-1] = pace
        return slope


def depth_row(place: Place) -> Real | None:
    """Derivative (N + 1,) of the depth of a touch beside its grazing point, None without one.

    None at a rigid stop, where the depth has no derivative.
    """
    try:
        touch = Grazing.of(place.orbit)
        if touch.half:
            return None
        phase, depth = touch.extreme(place.orbit)
        return touch.slope(place, phase) if abs(depth) <= TOUCH * touch.unit else None
    except FAILURES:
        return None


def output_slope(place: Place, output: int, phase: float) -> tuple[int, Real, float]:
    """Derivatives of an output at a phase, of a stop's that of the depth.

    Returns
    -------
    segment, row, pace : int, (2n,), float
        The segment of the phase, the derivative by its unknowns and that by the parameter.
    """
    family, orbit = place.family, place.orbit
    if not family.in_frequency_alone:
        return _output_slope_by_parameter(place, output, phase)
    flow = orbit.problem.flow
    carried = float(flow.ride(output, orbit.omega).by_log_omega(np.array(phase)))
    segment, found = _flown_to(orbit, phase, sensitivities=True)
    row = flow.output_row(output, _state_of(orbit, segment, found))
    if found is None:
        return segment, row, carried
    by_omega = orbit.omega * float(row @ found.d_omega[0])
    return segment, row @ found.jacobians[0], by_omega + carried


def _output_slope_by_parameter(place: Place, output: int, phase: float) -> tuple[int, Real, float]:
    """The same for a parameter other than the frequency, whose part is a difference."""
    at = place.family.at(place.point)
    segment, found = _flown_to(place.orbit, phase, sensitivities=True)
    row = place.orbit.problem.flow.output_row(output, _state_of(place.orbit, segment, found))
    row = row if found is None else row @ found.jacobians[0]
    if at.change is not None:
        row = row @ at.change[0]

    def depth(at: Evaluation) -> Real:
        value = exact_output(at.orbit, output, phase)
        stops = at.problem.flow.system.stops
        return np.array([value - stops[output].gap if output < len(stops) else value])

    pace = at.difference(place.point.size - 1, depth)
    return segment, row, float(pace[0])


def exact_output(orbit: Orbit, output: int, phase: float) -> float:
    """An output of `FlowMap.rows` at a phase, by the flow map from the segment's start.

    The recorded motion is a polynomial inside a contact, good to 1e-6; at an extreme, whose phase
    it gives, an error of the phase matters to second order only.
    """
    segment, found = _flown_to(orbit, phase, sensitivities=False)
    state = _state_of(orbit, segment, found)
    flow = orbit.problem.flow
    carried = flow.ride(output, orbit.omega).at(np.array(phase))
    return float(flow.outputs_at(output, state[None])[0] + carried)


def _state_of(orbit: Orbit, segment: int, found: Segments | None) -> Real:
    """State (2n,) where a flow from the start of a segment has come to, if there is one."""
    start = orbit.problem.nodes(orbit.point)[segment]
    return np.asarray(start if found is None else found.ends[0])


def _flown_to(orbit: Orbit, phase: float, sensitivities: bool) -> tuple[int, Segments | None]:
    """Segment of a phase, and the flow from its start to there; None if that is its start."""
    problem = orbit.problem
    phases = problem.phases
    phase = phase % phases[-1]
    j = min(int(np.searchsorted(phases, phase, side="right")) - 1, problem.segments - 1)
    if phase - phases[j] <= AT_NODE:
        return j, None
    node = problem.nodes(orbit.point)[j]
    found = problem.flow.shoot(
        node[None], np.array([phases[j], phase]), orbit.omega, sensitivities=sensitivities
    )
    if found.failure:
        raise ConvergenceError(found.failure)
    return j, found


def max_penetration(orbit: Orbit) -> float:
    """Deepest penetration over all stops in m, zero if none is touched."""
    return max(0.0, *(depth for _, depth in _depths(orbit)), 0.0)


def peak_force(orbit: Orbit) -> float:
    """Largest contact force over all stops in N, zero if none is touched.

    Where a force depends on the speed, it is that of the recorded motion.
    """
    stops = orbit.system.elastic_stops
    if orbit.system.rigid_stops or any(stop.depends_on_speed for stop in stops.values()):
        return max(
            (math.inf if hit.force is None else hit.force for hit in orbit.impact_list), default=0.0
        )
    return max((float(stops[i].force(depth)) for i, depth in _depths(orbit)), default=0.0)


def max_abs_displacement(orbit: Orbit) -> float:
    """Largest absolute displacement of the observed interface in m."""
    extremes = orbit.observed_extremes
    if not extremes.values.size:
        return 0.0
    phase = float(extremes.phases[int(np.argmax(np.abs(extremes.values)))])
    output = orbit.system.output(orbit.observe)
    return abs(exact_output(orbit, output, phase))


def phase_lag_deg(orbit: Orbit) -> float:
    """Lag in degrees of the observed displacement behind the excitation, from -90 to 270.

    Of the part with the frequency of the one source that swings.

    Raises
    ------
    SystemModelError
        If there is no such source, or several.
    """
    source, _ = driving_source(orbit.system)
    line = line_by_balance(orbit, orbit.observe, source.harmonic)
    lag = math.degrees(float(np.angle(source.phasor) - np.angle(line)))
    return (lag + 90.0) % 360.0 - 90.0


def driving_source(system: System) -> tuple[HarmonicForce | Unbalance | BaseMotion, int]:
    """The only source of excitation that swings, with its number.

    Raises
    ------
    SystemModelError
        If there is none, or several.
    """
    swinging = [
        (source, number)
        for number, source in enumerate(system.excitation)
        if not isinstance(source, ConstantForce)
    ]
    if len(swinging) != 1:
        raise SystemModelError(
            f"a phase lag is that behind one source that swings, but there are {len(swinging)}"
        )
    return swinging[0]


def _depths(orbit: Orbit) -> list[tuple[int, float]]:
    """Each stop with the depth of its deepest penetration."""
    found = []
    for index, peaks in enumerate(orbit.penetration_peaks):
        if peaks.values.size and index in orbit.system.elastic_stops:
            phase = float(peaks.phases[int(np.argmax(peaks.values))])
            depth = exact_output(orbit, index, phase) - orbit.system.stops[index].gap
            found.append((index, depth))
    return found


def _extremes_of(monitor: Callable[[Orbit], float], orbit: Orbit) -> list[float]:
    """What a monitor of this module is the largest of, from the recorded motion."""
    if monitor is max_abs_displacement:
        return [float(x) for x in np.abs(orbit.observed_extremes.values)]
    peaks = orbit.penetration_peaks
    depths = [
        (stop, float(depth))
        for index, stop in orbit.system.elastic_stops.items()
        for depth in peaks[index].values
    ]
    if monitor is max_penetration:
        return [depth for _, depth in depths]
    return [float(stop.force(depth)) for stop, depth in depths] if monitor is peak_force else []


MONITORS: dict[str, Callable[[Orbit], float]] = {
    "peak_force": peak_force,
    "max_penetration": max_penetration,
    "max_abs_displacement": max_abs_displacement,
    "phase_lag_deg": phase_lag_deg,
}


@dataclass(frozen=True, eq=False)
class Both:
    """Two conditions at once.

    Parameters
    ----------
    first, second : Condition
        Both are to hold.
    """

    first: Condition
    second: Condition

    def value(self, at: Evaluation) -> Real:
        """Values of both."""
        return np.append(self.first.value(at), self.second.value(at))

    def reach(self, at: Evaluation) -> float:
        """The shorter one."""
        return min(self.first.reach(at), self.second.reach(at))

    def renewed(self, at: Evaluation) -> Both:
        """Both renewed."""
        return Both(self.first.renewed(at), self.second.renewed(at))


@dataclass(frozen=True, eq=False)
class Held:
    """A monitored quantity has a given value.

    Parameters
    ----------
    name : str
        What is held.
    monitor : callable
        A number of an orbit.
    target : float
        Its value.
    """

    name: str
    monitor: Callable[[Orbit], float]
    target: float

    @classmethod
    def of(cls, monitor: Monitor, target: float | None, orbit: Orbit) -> Held:
        """The condition, checked; without a target, the orbit's own value is held.

        Raises
        ------
        SystemModelError
            For an unknown monitor, one that is zero on the orbit, or a target that is zero or of
            the other sign.
        """
        if isinstance(monitor, str):
            if monitor not in MONITORS:
                raise SystemModelError(
                    f"unknown monitor {shown(monitor)}; there are: {', '.join(MONITORS)}, "
                    "or a function of an orbit"
                )
            function = MONITORS[monitor]
        elif callable(monitor):
            function = monitor
        else:
            raise SystemModelError(
                f"monitor must be a name or a function of an orbit, got {shown(monitor)}"
            )
        name = getattr(monitor, "__name__", "monitor") if callable(monitor) else monitor
        if name == "max_abs_displacement":
            name = f"{name} of {orbit.observe}"
        present = function(orbit)
        if not is_finite(present) or (present == 0.0 and target is None):
            raise SystemModelError(f"the start has {name} = {shown(present)}, which cannot be held")
        if target is None:
            target = present
        if not (is_finite(target) and target != 0.0 and target * present >= 0.0):
            raise SystemModelError(
                f"{name} to be held must be finite and of the sign of the start's "
                f"({present:g}), got {shown(target)}"
            )
        return cls(name, function, float(target))

    def changes_extreme(self, orbit: Orbit) -> bool:
        """Whether a second extreme is nearly as large as the largest one, which is held.

        Where they change places the quantity has a corner. Those that are alike by symmetry do not.
        """
        *_, second, first = [0.0, 0.0, *sorted(_extremes_of(self.monitor, orbit))]
        return ALIKE * first < first - second < LEVEL * first

    def value(self, at: Evaluation) -> Real:
        """Relative difference from the target, shape (1,)."""
        return np.array([self.monitor(at.orbit) / self.target - 1.0])

    def reach(self, at: Evaluation) -> float:
        """Not across a grazing."""
        return reach_of_grazing(at)

    def renewed(self, at: Evaluation) -> Held:
        """The same."""
        return self


@dataclass(frozen=True, eq=False)
class Phase:
    """A free motion begins on the plane across the path of another one, where that begins.

    Parameters
    ----------
    begin : (2n,) array
        First state of the other.
    path : (2n,) array
        Its rate of change there, over its length and the size of the orbit.
    """

    begin: Real
    path: Real

    @classmethod
    def of(cls, at: Evaluation) -> Phase:
        """The condition by the motion of a point."""
        flow, begin = at.problem.flow, at.nodes[0]
        q, v = np.split(flow.to_modal(begin), 2)
        force = force_at(flow.system, constant_force(flow.system), q)
        rate = flow.to_state(np.append(v, -force))
        return cls(begin, rate / (np.linalg.norm(rate) * at.family.scale(at.point)))

    def value(self, at: Evaluation) -> Real:
        """Relative distance of the first state from the plane, shape (1,)."""
        return np.array([self.path @ (at.nodes[0] - self.begin)])

    def reach(self, at: Evaluation) -> float:
        """Any, as it is linear."""
        return DIFFERENCE

    def renewed(self, at: Evaluation) -> Phase:
        """The same with the path of another motion."""
        return Phase.of(at)


@dataclass(frozen=True, eq=False)
class Turning:
    """A self-excited motion begins where the observed displacement turns."""

    def value(self, at: Evaluation) -> Real:
        """Speed there, relative to the size of the orbit, shape (1,)."""
        flow = at.problem.flow
        row = flow.rate_rows[flow.system.output(at.family.observe)]
        return np.array([row @ at.nodes[0] / (np.linalg.norm(row) * at.family.scale(at.point))])

    def reach(self, at: Evaluation) -> float:
        """Any, as it is linear."""
        return DIFFERENCE

    def renewed(self, at: Evaluation) -> Turning:
        """The same."""
        return self


def nearest_crossing(place: Place, longest: float = math.inf) -> tuple[Solved, float] | None:
    """The crossing of branches beside an orbit, and its unfolding relative to the orbit.

    The unfolding is what must be added to the shooting equations for branches to cross: zero, but
    for rounding, where they do. None where no crossing is found, or where the first step of
    Newton's method, which is about the distance, is longer than said.

    References
    ----------
    G. Moore (1980), *Numer. Funct. Anal. Optim.* 2, 441-472.
    """
    found = _beside("BP", place, longest)
    if found is None:
        return None
    return Solved(place.family, found.point[:-1], found.orbit), abs(float(found.point[-1]))


def nearest_flip(place: Place) -> Solved | None:
    """The flip of the branch of an orbit, if it has one beside it."""
    found = _beside("PD", place)
    return None if found is None else Solved(place.family, found.point, found.orbit)


def grazing_beside(place: Place) -> Corrected | None:
    """The grazing of a rigid stop in a family with one parameter, without the slight impact.

    Where several touches graze at once, without any of these.
    """
    orbit = place.orbit
    try:
        alone = Grazing.of(orbit)
        together = alone.with_others(orbit)
    except SystemModelError:
        return None
    for grazing in (together, alone) if together.others else (alone,):
        found = _solved(orbit, place.family.past(grazing.passages), grazing)
        if found is None:
            continue
        try:
            grazing.grazing_too(found.orbit)
            return found
        except ConvergenceError:
            continue
    return None


def _beside(kind: str, place: Place, longest: float = math.inf) -> Corrected | None:
    """The special point of a kind beside an orbit."""
    try:
        family, condition = defined_by(kind, place.family, place.orbit)
    except FAILURES:
        return None
    return _solved(place.orbit, family, condition, longest)


def _solved(
    orbit: Orbit, family: OrbitFamily, condition: Condition, longest: float = math.inf
) -> Corrected | None:
    """What meets a condition beside an orbit, in the family in which that is solved."""
    try:
        guess = family.unknowns(orbit)
        found = correct(family, guess, condition, longest=longest)
    except FAILURES:
        return None
    apart = metric_length(family.metric(guess), found.point - guess)
    farthest = BESIDE if family.is_exact else BESIDE_BY_DIFFERENCES
    return found if found.converged and apart <= farthest else None


def defined_by(kind: str, family: OrbitFamily, orbit: Orbit) -> tuple[OrbitFamily, Condition]:
    """Defining condition of a special point near an orbit, and the family in which it is solved.

    Raises
    ------
    SystemModelError
        For a kind that has none here, or an orbit that has no such point.
    """
    if kind == "BP":
        guess = family.unknowns(orbit)
        condition = BranchPointCondition.of(family.at(guess))
        return family.unfolded(condition.left * family.scale(guess)), condition
    if kind == "GR":
        grazing = Grazing.of(orbit)
        return family.past(grazing.passages), grazing
    if kind in KINDS:
        if kind == "NS" and orbit.system.size < 2:
            raise SystemModelError("a Neimark-Sacker point needs at least two modes")
        return family, Singular.of(kind, orbit)
    raise SystemModelError(
        f"no defining system is known of {shown(kind)} points; there are those of: "
        f"{', '.join(KINDS)}"
    )
