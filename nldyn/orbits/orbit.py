"""Periodic orbits: how they are found, and what an engineer wants to know of one."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from nldyn.base.arrays import SLACK, Real
from nldyn.base.errors import ConvergenceError, SystemModelError, check_types, check_whole, numbers
from nldyn.engine.sample import of_stop
from nldyn.flow.flow_map import SHALLOW, FlowError, FlowMap, Solution, Trajectory, chain
from nldyn.flow.rigid import (
    impacts_in_order,
    rest_forces,
    rests_in_pieces,
    rests_on_rigid_stop,
    series_to_rest,
)
from nldyn.flow.rigid_impacts import rigid_impacts
from nldyn.flow.sliding import SliderMeasures, slider_measures, slides_one_way
from nldyn.orbits.areas import AreaMeasures, area_measures
from nldyn.orbits.critical_functions import Critical
from nldyn.orbits.history import History
from nldyn.orbits.multipliers import (
    COARSE,
    MOST_PARTS,
    FloquetSpectrum,
    MultiplierError,
    Stability,
    floquet_spectrum,
    log_determinant,
    parts_for,
    uncertainties,
)
from nldyn.orbits.self_excited import across, along, moves, paces
from nldyn.orbits.shooting import ShootingProblem
from nldyn.system.round_stop import RoundStop
from nldyn.system.system import System

AREA_SAMPLES = 1000  # of a forcing period
SAME_PHASE = 1e-9  # in rad: an extreme and an impact
LIFTS_OFF = 1e-5  # rad behind rest, where a flight that grows with their cube is rounding
SAME = 1e-5  # distance of orbits that are one, relative to their size
STEADY = 1e-9  # share of a depth by which it swings, where that is rounding
REPEATS = 1e-6  # the same of an orbit from itself some periods later
LARGEST_EXPONENT = 700.0  # of a finite exponential
LOST = 1e-6  # rounding of a determinant's logarithm, above which it tells nothing


@dataclass(frozen=True, eq=False)
class Extremes:
    """Local extremes of one output over an orbit.

    Parameters
    ----------
    phases : (k,)
        Forcing phases.
    values : (k,)
        Values of the output (m; for a stop its penetration, negative when open).
    is_maximum : (k,) bool
        Whether each is a maximum.
    """

    phases: Real
    values: Real
    is_maximum: NDArray[np.bool_]

    def __repr__(self) -> str:
        """One line: how many, and between which values."""
        if not self.values.size:
            return "<Extremes: none>"
        low, high = self.values.min(), self.values.max()
        return f"<Extremes: {self.values.size} from {low:.4g} to {high:.4g} m>"


@dataclass(frozen=True)
class Impact:
    """One contact phase of an orbit.

    Parameters
    ----------
    stop : int
        Index of the stop.
    time : float
        Instant of deepest penetration in s from forcing phase zero.
    penetration : float
        Deepest penetration in m.
    force : float or None
        Largest contact force in N; None at a rigid stop, whose force lasts no time.
    speed, impulse : float or None
        At a rigid stop the speed in m/s at which it is hit, and the impulse in N s; else None, see
        `nldyn.impacts`.
    """

    stop: int
    time: float
    penetration: float
    force: float | None
    speed: float | None = None
    impulse: float | None = None

    def __repr__(self) -> str:
        """One line: where, when and how hard."""
        told = f"<Impact on stop {self.stop} at {self.time:.6g} s, "
        if self.force is None:
            return f"{told}{self.speed:.4g} m/s and {self.impulse:.4g} N s>"
        return f"{told}{self.penetration:.4g} m deep and {self.force:.4g} N>"


@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic orbit of a system.

    Parameters
    ----------
    problem : ShootingProblem
        The equations that it solves.
    point : (N + 1,)
        States z at the shooting phases and ln ω.
    jacobians : (k, 2n, 2n)
        Derivatives of the states z at the ends of the shooting segments with respect to those at
        their starts.
    error : float
        Length of the last Newton step relative to the orbit: an estimate of its error.
    observe : str
        Interface whose displacement is reported.
    motion : Trajectory, optional
        The recorded motion, if it is known already.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, solve_orbit
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> orbit = solve_orbit(system, frequency_hz=60.0)
    >>> orbit.impacts, orbit.stable
    (1, False)
    """

    problem: ShootingProblem
    point: Real
    jacobians: Real
    error: float
    observe: str
    motion: Trajectory | None = field(default=None, repr=False)

    def __repr__(self) -> str:
        """One line: period, frequency, amplitude, impacts, stability."""
        try:
            impacts = "1 impact" if self.impacts == 1 else f"{self.impacts} impacts"
            size = f"{self.told_size} at '{self.observe}', {impacts}"
            stability: str = self.stability.verdict
        except ConvergenceError as error:
            size, stability = str(error), "stability unknown"
        if not self.resolved:
            stability += f", contacts resolved to {self.flow_error.monodromy:.1e} only"
        return f"<Orbit of period {self.period} at {self.frequency_hz:.6g} Hz: {size}, {stability}>"

    @property
    def told_size(self) -> str:
        """The largest displacement in words, of a rotation in rad."""
        return f"{self.max_abs_displacement:.4g} {self.system.unit(self.observe)}"

    @classmethod
    def of(cls, problem: ShootingProblem, found: Solution, observe: str) -> Orbit:
        """Orbit from a solution of its equations.

        The motion that comes with it begins each segment as before the last step. That may be a
        little beside a rigid stop on which the body rests; then it is recorded anew.
        """
        motion = None if rests_on_rigid_stop(found.motion) else found.motion
        return cls(problem, found.point, found.jacobians, found.last_step, observe, motion)

    @property
    def system(self) -> System:
        """The system."""
        return self.problem.flow.system

    @cached_property
    def omega(self) -> float:
        """Excitation frequency in rad/s."""
        return float(np.exp(self.point[-1]))

    @property
    def frequency_hz(self) -> float:
        """Excitation frequency in Hz."""
        return self.omega / (2.0 * math.pi)

    @property
    def period(self) -> int:
        """Period multiple n: the orbit repeats after n excitation periods."""
        return self.problem.period

    @property
    def duration(self) -> float:
        """Period of the orbit in s."""
        return self.period / self.frequency_hz

    @cached_property
    def monodromy(self) -> Real:
        """Derivative of the state z after a period with respect to the one before, (2n, 2n).

        It is the product of the Jacobians, in which large multipliers drown the small ones.
        """
        return chain(self.jacobians)

    @cached_property
    def self_excited(self) -> bool:
        """Whether nothing excites the motion, which loses and gains energy: a limit cycle."""
        system = self.system
        if system.driven or system.conservative:
            return False
        return moves(self.problem, self.point, self._paces)

    @cached_property
    def _paces(self) -> Real:
        return paces(self.problem, self.point)

    @property
    def multiplier_along(self) -> float | None:
        """The multiplier along a self-excited motion, which is 1 but for errors; else None.

        It stands in none of the `multipliers`, and has no part in the stability.
        """
        return along(self.jacobians, self._paces) if self.self_excited else None

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers, largest first, shape (2n,).

        Of a self-excited motion those across it, (2n - 1,): see `multiplier_along`.
        """
        return self._spectrum[0].multipliers

    @property
    def log_moduli(self) -> Real:
        """Natural logarithms of the moduli of the multipliers, (2n,), however small these are.

        Minus infinity where a segment's Jacobian shows nothing of a direction, as where a stop
        damps it to less than rounding.
        """
        return self._spectrum[0].log_moduli

    @property
    def critical(self) -> Critical:
        """Test functions of the multipliers."""
        return self._spectrum[0].critical

    @cached_property
    def _spectrum(self) -> tuple[FloquetSpectrum, Real]:
        """Multipliers and the Jacobians they come from.

        Segments that squeeze a direction almost to their own rounding error are cut into parts.
        """
        try:
            if self.self_excited:
                jacobians = across(self.jacobians, self._paces)
                return floquet_spectrum(jacobians), jacobians
            found, jacobians = floquet_spectrum(self.jacobians), self.jacobians
            parts = parts_for(found.squeeze)
            while found.squeeze < COARSE and parts <= MOST_PARTS:
                finer = self.problem.jacobians(self.point, parts)
                if finer is None:
                    break
                found, jacobians = floquet_spectrum(finer), finer
                parts *= 2
        except MultiplierError as error:
            raise ConvergenceError(str(error)) from None
        return found, jacobians

    @cached_property
    def log_modulus_uncertainties(self) -> Real:
        """Estimate of how far each of the `log_moduli` may be off, (2n,).

        Of each segment's Jacobian a relative error of ten times the flow map's `rtol` is assumed
        (or of ten times `error`, where that is more, with a law of one's own the `flow_error`, and
        of a self-excited motion how far `multiplier_along` is off);
        see `nldyn.orbits.multipliers.uncertainties`.
        """
        found, jacobians = self._spectrum
        error = max(self.problem.flow.options.rtol, self.error)
        if self._own_laws:
            error = max(error, self.flow_error.monodromy)
        if self.self_excited:
            error = max(error, abs(along(self.jacobians, self._paces) - 1.0))
        if not error < 1.0:
            return np.full(found.log_moduli.shape, np.inf)
        return uncertainties(jacobians, found, 10.0 * error)

    @property
    def _own_laws(self) -> bool:
        return any(stop.law is not None for stop in self.system.stops)

    @property
    def resolved(self) -> bool:
        """Whether the contacts are resolved: always with the stops' own kinds of force.

        A law of one's own may have a steep part or a kink; then `flow_error` is computed, and an
        orbit whose monodromy matrix is wrong by more than 1000 times the flow map's `rtol` is not
        resolved.
        """
        if not self._own_laws:
            return True
        return self.flow_error.monodromy <= 1000.0 * self.problem.flow.options.rtol

    @property
    def stability(self) -> Stability:
        """The multiplier that decides stability, how far from the unit circle, and how sure.

        Where all multipliers are zero, at rest, it is sure if errors cannot make one as large as 1.
        """
        largest, uncertainty = self.log_moduli[0], self.log_modulus_uncertainties[0]
        if largest == -math.inf:
            norms = np.linalg.norm(self.jacobians, 2, axis=(1, 2))
            error = 10.0 * max(self.problem.flow.options.rtol, self.error)
            uncertainty = 0.0 if error * len(norms) * np.prod(norms) < 1.0 else math.inf
        return Stability(self.largest_multiplier, float(largest), float(uncertainty))

    @property
    def largest_multiplier(self) -> complex:
        """The multiplier that decides stability (of a complex pair the upper one)."""
        value = complex(self.multipliers[0])
        return complex(value.real, abs(value.imag))

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle."""
        return bool(abs(self.multipliers[0]) < 1.0)

    @cached_property
    def flow_error(self) -> FlowError:
        """Error of the flow map on this orbit, by a finer one; infinite where either fails."""
        problem = self.problem
        return problem.flow.error(problem.nodes(self.point), problem.phases, self.omega)

    @cached_property
    def liouville_error(self) -> float:
        """``|det Φ / exp(-∫ (tr D + Σ v² ∂F/∂δ') dt) - 1|``: Liouville's formula.

        v² is the velocity jump per unit impulse at a stop whose force depends on the speed. An
        impact with a rigid stop multiplies the determinant by e (e + v de/dv). The
        determinant is the product of those of the segments. The error is nan where damping is so
        strong that rounding hides the third digit of 1e-6 even so, and with dry friction, in round
        clearances where it turns or sticks.
        """
        if self.system.sliders:
            return math.nan
        value, rounding = log_determinant(self._spectrum[1])
        if rounding > LOST:
            return math.nan
        exact = -float(np.trace(self.system.total_damping)) * self.duration
        exact -= contact_damping(self.problem.flow, self.trajectory)
        if not math.isfinite(exact):  # at rest, without rebound, or stuck: directions are lost
            return math.nan
        off = min(value - exact, LARGEST_EXPONENT)
        return math.inf if math.isnan(value) else abs(math.expm1(off))

    @cached_property
    def trajectory(self) -> Trajectory:
        """The recorded motion over one period of the orbit."""
        if self.motion is not None:
            return self.motion
        problem = self.problem
        motion = problem.flow.trajectory(problem.nodes(self.point), problem.phases, self.omega)
        if motion.failure:
            raise ConvergenceError(
                f"the orbit at {self.frequency_hz:g} Hz could not be recorded: {motion.failure}"
            )
        return motion

    def extremes(self, output: int) -> Extremes:
        """Local extremes of an output: the stops' penetrations first, then the interfaces."""
        if output not in self._extremes:
            self._extremes[output] = self._as_extremes(self.trajectory.extremes(output), output)
        return self._extremes[output]

    def touches(self, stop: int) -> Extremes:
        """Local extremes of a stop's penetration, of which those near zero are exact.

        The others have an error of 1e-6 of the deepest, and need no further flow.
        """
        if stop not in self._touches:
            phases, values, keys, _ = of_stop(self.touched, stop).T
            self._touches[stop] = Extremes(phases, values, keys % 2.0 > 0.0)
        return self._touches[stop]

    @cached_property
    def touched(self) -> Real:
        """The same of all stops, as `nldyn.orbits.extremes` compares them, (k, 4)."""
        found, shallow = self.trajectory.recorded_touches
        if not (self.system.rigid_stops or any(shallow)):
            return found
        parts = [np.empty((0, 4))]
        for number, stop in enumerate(self.system.stops):
            own = of_stop(found, number)
            if shallow[number]:
                depths = np.abs(own[:, 1])
                near = depths <= SHALLOW * depths.max()
                places, values = self.trajectory.exact_values(own, number, near)
                own[places, 1] = values - stop.gap
            parts.append(self._off_rigid_stop(own, number) if stop.impulsive else own)
        return np.concatenate(parts)

    @cached_property
    def touch_counts(self) -> tuple[int, ...]:
        """How many extremes each stop's penetration has."""
        numbers = (self.touched[:, 2] // 2.0).tolist()
        return tuple(numbers.count(stop) for stop in range(len(self.system.stops)))

    @cached_property
    def _extremes(self) -> dict[int, Extremes]:
        return {}

    @cached_property
    def _touches(self) -> dict[int, Extremes]:
        return {}

    def _as_extremes(self, found: Real, output: int) -> Extremes:
        stops = self.system.stops
        offset = stops[output].gap if output < len(stops) else 0.0
        found = found - np.array([0.0, offset, 0.0])
        if output in self.system.rigid_stops:
            found = self._off_rigid_stop(found, output)
        phases, values, kinds = found.T
        return Extremes(phases, values, kinds > 0.0)

    def _off_rigid_stop(self, found: Real, stop: int) -> Real:
        """Extremes (k, ...) of a rigid stop's penetration without those where a body rests."""
        phases = found[:, 0]
        depths, hit = self._beyond_rigid_stop(stop, phases, found[:, 1])
        free = np.where(hit, ~self._settles(stop, phases), ~self._rests(stop, phases))
        found = found.copy()
        found[:, 1] = depths
        return found[free]

    def _settles(self, stop: int, phases: Real) -> NDArray[np.bool_]:
        """Whether impacts at phases belong to a series that ends in rest."""
        hits = rigid_impacts(self.trajectory, stop)
        series = series_to_rest(self.trajectory, stop, hits)
        of_series = hits.phase[series.follows | series.soft]
        return np.asarray(np.isclose(phases[:, None], of_series, rtol=0.0, atol=SAME_PHASE).any(1))

    def _rests(self, stop: int, phases: Real) -> NDArray[np.bool_]:
        """Whether the gap of a rigid stop stays shut at or beside phases: it has no extremes."""
        record = self.trajectory.record
        rests = rests_in_pieces(self.trajectory, stop)
        found = np.zeros(phases.size, dtype=bool)
        for near in (phases - LIFTS_OFF, phases, phases + SAME_PHASE):
            piece = np.searchsorted(record.phase, near, side="right") - 1
            found |= rests[np.clip(piece, 0, None)]
        return found

    def _beyond_rigid_stop(
        self, stop: int, phases: Real, values: Real
    ) -> tuple[Real, NDArray[np.bool_]]:
        """Extremes of the penetration, with the speed over ω for the depth where a body hits.

        And whether it does.

        So an impact is no near miss, whatever rounding makes of a gap that is just closed.
        """
        hits = rigid_impacts(self.trajectory, stop)
        full = 2.0 * math.pi * self.period
        deep, hit = values.copy(), np.zeros(phases.size, dtype=bool)
        for phase, speed in zip(hits.phase, hits.speed, strict=True):
            apart = np.abs((phases - phase + 0.5 * full) % full - 0.5 * full)
            deep[apart <= SAME_PHASE] = speed / self.omega
            hit |= apart <= SAME_PHASE
        return deep, hit

    @cached_property
    def observed_extremes(self) -> Extremes:
        """Local extremes of the observed displacement."""
        return self.extremes(self.system.output(self.observe))

    @cached_property
    def penetration_peaks(self) -> tuple[Extremes, ...]:
        """Local maxima of each stop's penetration, negative ones being near misses."""
        peaks = []
        for index in range(len(self.system.stops)):
            found = self.extremes(index)
            keep = found.is_maximum
            peaks.append(Extremes(found.phases[keep], found.values[keep], keep[keep]))
        return tuple(peaks)

    @cached_property
    def max_abs_displacement(self) -> float:
        """Largest absolute displacement of the observed interface in m."""
        output = self.system.output(self.observe)
        return self._highest(output, lambda found: np.abs(found.values))

    @cached_property
    def max_penetration(self) -> float:
        """Deepest penetration over all stops in m (zero if none is touched).

        Of stops of rotations in rad; `deepest_penetration` tells them apart.
        """
        return max(self._penetrations.values(), default=0.0)

    @cached_property
    def touches_stops(self) -> bool:
        """Whether a stop is touched: hit, pressed, or rested on."""
        return bool(self.impacts or self.max_penetration > 0.0 or self.rests)

    def deepest_penetration(self, unit: str) -> float:
        """Deepest penetration over the stops of which it has this unit, m or rad."""
        system, depths = self.system, self._penetrations
        among = (depth for i, depth in depths.items() if system.unit(system.stops[i].at) == unit)
        return max(among, default=0.0)

    @cached_property
    def _penetrations(self) -> dict[int, float]:
        """Deepest penetration of each stop that is not rigid."""
        return {
            index: self._highest(index, lambda found: np.where(found.is_maximum, found.values, 0.0))
            for index in self.system.elastic_stops
        }

    def _highest(self, output: int, height: Callable[[Extremes], Real]) -> float:
        """Largest height of an output's extremes; only those that may have it are solved for."""
        if output in self._extremes:
            return float(height(self._extremes[output]).max(initial=0.0))
        found = self.trajectory.recorded_extremes(output)
        extremes = self._as_extremes(found, output)
        heights, error = height(extremes), SHALLOW * np.abs(extremes.values).max(initial=0.0)
        near = heights >= heights.max(initial=0.0) - error
        exact = self.trajectory.with_exact_values(found, output, near)
        return float(height(self._as_extremes(exact[near], output)).max(initial=0.0))

    @cached_property
    def impacts(self) -> int:
        """Number of contact phases in one period of the orbit, over all stops.

        Impacts with a rigid stop that end in rest count as one.
        """
        if not self.rests:
            return sum(self.trajectory.closings.tolist())
        count = 0
        for index, stop in enumerate(self.system.stops):
            if stop.impulsive:
                hits = rigid_impacts(self.trajectory, index)
                count += int(np.sum(~series_to_rest(self.trajectory, index, hits).follows))
            else:
                count += int(self.trajectory.closings[index])
        return count

    @cached_property
    def rests(self) -> bool:
        """Whether a body rests on a rigid stop for a while."""
        return rests_on_rigid_stop(self.trajectory)

    @cached_property
    def impact_list(self) -> tuple[Impact, ...]:
        """Contact peaks in the order of time (a double-peaked contact counts twice here).

        What is pressed alike all the time, as what goes in a circle in its ring, counts once.
        Of impacts with a rigid stop that end in rest the first counts.
        """
        found = []
        for index, stop in enumerate(self.system.stops):
            of_stop = self._rigid_list if stop.impulsive else self._elastic_list
            found += of_stop(index)
        return tuple(sorted(found, key=lambda impact: impact.time))

    @cached_property
    def friction(self) -> tuple[SliderMeasures, ...]:
        """What each of `System.rubbing` does in a period of the orbit."""
        return slider_measures(self.trajectory)

    @cached_property
    def areas(self) -> tuple[AreaMeasures, ...]:
        """What each of the `System.areas` does in a period, by 1000 samples of a forcing period."""
        force = self.history(AREA_SAMPLES * self.period).force[:-1]
        return tuple(
            area_measures(name, self.system.area_stops(name), force[:, list(places)])
            for name, places in self.system.areas.items()
        )

    def _elastic_list(self, index: int) -> list[Impact]:
        """Contact peaks at a stop that gives way."""
        peaks, depths = self.penetration_peaks[index], self.extremes(index).values
        pairs = list(zip(peaks.phases.tolist(), peaks.values.tolist(), strict=True))
        if depths.size and np.ptp(depths) <= STEADY * depths.min():  # but for rounding
            pairs = pairs[:1]
        return [
            Impact(index, phase / self.omega, depth, self._largest_force(index, phase, depth))
            for phase, depth in pairs
            if depth > 0.0
        ]

    def _rigid_list(self, index: int) -> list[Impact]:
        """Impacts with a rigid stop."""
        hits = rigid_impacts(self.trajectory, index)
        keep = ~series_to_rest(self.trajectory, index, hits).follows
        columns = (hits.phase / self.omega, hits.speed, hits.impulse)
        return [
            Impact(index, time, 0.0, None, speed, impulse)
            for time, speed, impulse in zip(*(each[keep].tolist() for each in columns), strict=True)
        ]

    def _largest_force(self, index: int, phase: float, depth: float) -> float:
        """Largest force of the contact whose penetration is deepest at a phase."""
        stop = self.system.elastic_stops[index]
        if not stop.depends_on_speed:
            return float(stop.force(depth))

        def force(where: float) -> float:
            state = self.states(np.array([where]))
            return stop.force(*self.system.depth_and_speed(stop, state)).item()

        pieces, force_at_nodes = self.trajectory.record, self.trajectory.contacts_at_nodes[1]
        within = (pieces.kind >= 0) & (force_at_nodes[:, index].max(axis=1) > 0.0)
        reach = self.omega * float(pieces.duration[within].max(initial=0.0))
        found = minimize_scalar(
            lambda where: -force(where),
            bounds=(phase - reach, phase),
            method="bounded",
            options={"xatol": SLACK * max(reach, SLACK)},
        )
        return max(-float(found.fun), force(phase))

    def states(self, phases: Real) -> Real:
        """Modal displacements and velocities (k, 2n) at any forcing phases (k,) in radians.

        Raises
        ------
        SystemModelError
            If the phases are not a list of finite numbers.
        """
        phases = numbers("phases", phases)
        if phases.ndim != 1:
            raise SystemModelError(f"phases must be a list of phases, got shape {phases.shape}")
        within = phases % (2.0 * np.pi * self.period)
        order = np.argsort(within, kind="stable")
        states = np.empty((phases.size, self.system.state_size))
        states[order] = self.trajectory.states(within[order])
        return self.problem.flow.to_modal(states)

    def penetration(self, stop: int, phases: Real) -> Real:
        """Penetration of a stop (m, negative when open) at any forcing phases."""
        check_whole("penetration: stop", stop, 0, len(self.system.stops) - 1)
        states = self.states(phases)
        return self.system.depth_and_speed(self.system.stops[stop], states)[0]

    def history(self, samples: int = 1000) -> History:
        """Sample one period of the orbit.

        Parameters
        ----------
        samples : int
            Number of equal time steps; the result has one sample more.

        Returns
        -------
        History

        Raises
        ------
        SystemModelError
            If `samples` is not a whole number of at least 1.
        """
        check_whole("history: samples", samples, 1)
        phases = np.linspace(0.0, 2.0 * np.pi * self.period, samples + 1)
        return self.history_at(phases)

    def history_at(self, phases: Real, states: Real | None = None) -> History:
        """Sample the orbit at forcing phases (k,) in radians; modal states there may be known."""
        states = self.states(phases) if states is None else states
        rest = rest_forces(
            self.trajectory,
            phases % (2.0 * np.pi * self.period),
            self.problem.flow.to_state(states),
        )
        return history_of(self.system, phases / self.omega, phases, self.omega, states, rest)


def history_of(
    system: System, time: Real, phases: Real, omega: float | Real, states: Real, rest: Real
) -> History:
    """Displacements and forces at modal states (k, 2n), with their times (k,) in s.

    `phases` (k,) are those of the excitation, `omega` its frequencies in rad/s, one or (k,). `rest`
    (k, n_stops) are the forces of rigid stops on what rests on them.
    """
    q = states[:, : system.size]
    depth, speed = system.depths_and_speeds(states)
    force = rest.copy()
    for row, stop in system.elastic_stops.items():
        force[:, row] = stop.force(depth[:, row], speed[:, row])
    return History(
        time,
        q,
        states[:, system.size :],
        {
            name: q @ phi + _carried(system, name, phases, omega)
            for name, phi in system.participation.items()
        },
        depth,
        force,
        {name: system.unit(name) for name in system.interfaces},
        tuple(system.unit(stop.at) for stop in system.stops),
    )


def _carried(system: System, interface: str, phases: Real, omega: float | Real) -> Real:
    """What a moving base adds to the displacement of an interface, (k,)."""
    found = np.zeros(phases.size)
    if interface in system.rides:
        paces = np.broadcast_to(omega, phases.shape)
        for pace in np.unique(paces):
            within = paces == pace
            found[within] = system.ride(interface, float(pace)).at(phases[within])
    return found


def contact_damping(flow: FlowMap, motion: Trajectory) -> float:
    """∫ Σ v² ∂F/∂δ' dt over the contacts of a motion, by the quadrature of their panels.

    With -ln of what impacts with rigid stops make of a volume of states. It is nan where what rubs
    in a round clearance turns or sticks.
    """
    system = flow.system
    if not slides_one_way(motion):
        return math.nan
    contraction = impact_contraction(motion)
    if not system.loses_by_speed:
        return contraction
    phases, weights = motion.contact_quadrature()
    states = flow.to_modal(motion.states(phases))
    total = contraction
    for stop in system.elastic_stops.values():
        viscosity = stop.viscosity(*system.depth_and_speed(stop, states))
        if isinstance(stop, RoundStop):
            at, rows = system.round_polar(stop, states), np.array(system.stop_vectors(stop))
            moved = stop.sense * at.normal @ rows
            viscosity = viscosity * (moved * (stop.along(at) @ rows)).sum(axis=1)
            total += float(weights @ viscosity)
            continue
        v = system.stop_vector(stop)
        total += float(v @ v * weights @ viscosity)
    for bond in system.bonds:
        v = system.vector_between(bond.at, bond.against)
        q, rates = states[:, : system.size], states[:, system.size :]
        total += float(v @ v * weights @ bond.viscosity(q @ v, rates @ v))
    return total


def impact_contraction(motion: Trajectory) -> float:
    """-Σ ln(e (e + v de/dv)) over the impacts with rigid stops; infinite where a body rests."""
    if rests_on_rigid_stop(motion):
        return math.inf
    total = 0.0
    for index, speed in impacts_in_order(motion):
        factor = motion.flow.system.rigid_stops[index].determinant(speed)
        total += -math.log(factor) if factor > 0.0 else math.inf
    return total


def check_observe(system: System, observe: str | None, called: str = "observe") -> str:
    """Interface to observe: the given one, else the system's first."""
    check_types(**{"system": (system, System), called: (observe, str, None)})
    if not system.interfaces:
        raise SystemModelError("the system has no interface to observe")
    if observe is None:
        return system.interfaces[0]
    if observe not in system.interfaces:
        raise SystemModelError(
            f"{called}: unknown interface '{observe}'; there are: {', '.join(system.interfaces)}"
        )
    return observe


def stroboscopic(orbit: Orbit) -> Real:
    """States (n, 2n_modes) at the start of each excitation period."""
    problem = orbit.problem
    return problem.nodes(orbit.point)[:: problem.segments // problem.period]


def same_orbit(a: Orbit, b: Orbit) -> bool:
    """Whether two orbits at one frequency agree up to a shift by whole excitation periods."""
    if a.period != b.period or not math.isclose(a.omega, b.omega, rel_tol=SLACK):
        return False
    return shifted_alike(stroboscopic(a), stroboscopic(b), SAME * a.problem.scale(a.point))


def shifted_alike(a: Real, b: Real, size: float) -> bool:
    """Whether two cycles of states (n, 2n_modes) agree within a size up to a shift."""
    return any(
        float(np.abs(a - np.roll(b, shift, axis=0)).max()) <= size for shift in range(len(a))
    )


def minimal_period(orbit: Orbit) -> int:
    """Smallest number of excitation periods after which the orbit really repeats."""
    states = stroboscopic(orbit)
    scale = orbit.problem.scale(orbit.point)
    for n in range(1, orbit.period):
        if orbit.period % n == 0:
            shifted = np.roll(states, n, axis=0)
            if float(np.abs(states - shifted).max()) <= REPEATS * scale:
                return n
    return orbit.period


def check_minimal(orbit: Orbit) -> None:
    """Refuse an orbit of a shorter period that is run through several times.

    Raises
    ------
    SystemModelError
        As said.
    """
    shortest = minimal_period(orbit)
    if shortest < orbit.period:
        raise SystemModelError(
            f"the orbit of period {orbit.period} at {orbit.frequency_hz:g} Hz is one of period "
            f"{shortest}, run through {orbit.period // shortest} times: solve for that"
        )
