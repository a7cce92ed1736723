"""Periodic orbits: how they are found, and what an engineer wants to know of one."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from nldyn.base.errors import SystemModelError, check_frequency, check_types, check_whole, numbers
from nldyn.flow.flow_map import FlowError, FlowMap, Solution, Trajectory, chain, flow_of
from nldyn.orbits.multipliers import (
    COARSE,
    MOST_PARTS,
    MultiplierError,
    Spectrum,
    Stability,
    log_determinant,
    parts_for,
    spectrum,
    uncertainties,
)
from nldyn.orbits.shooting import ShootingProblem
from nldyn.system.elements import Stop
from nldyn.system.linear import Real
from nldyn.system.rest import at_rest, held_motion, rest
from nldyn.system.system import System

SEGMENTS_PER_PERIOD = 2
LONGEST_PERIOD = 10**4  # excitation periods of an orbit
MOST_SEGMENTS = 10**5
# contact force over the excitation, and penetration over displacement, up to which a free body
# counts as untouched
TOUCH = 1e-7
MORE_DAMPING = 7.0, 20.0, 55.0  # factors that may leave one orbit only
NOT_HELD = "the structure is free to move in a way that no stop limits, and nothing tells its place"
NO_PLACE = (
    "the structure is free to move as a whole, and where the motion touches no stop, nothing tells "
    "its place; give a guess that touches one"
)


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


@dataclass(frozen=True, eq=False)
class History:
    """A motion sampled in time.

    Parameters
    ----------
    time : (k,)
        Time in s from forcing phase zero.
    modal : (k, n)
        Modal displacements q.
    modal_velocity : (k, n)
        Modal velocities.
    displacement : dict of str to (k,)
        Displacement of each interface in m.
    penetration, force : (k, n_stops)
        Penetration (m, negative when open) and contact force (N) of each stop.
    """

    time: Real
    modal: Real
    modal_velocity: Real
    displacement: dict[str, Real]
    penetration: Real
    force: Real


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
    force : float
        Largest contact force in N.
    """

    stop: int
    time: float
    penetration: float
    force: float


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

    @classmethod
    def of(cls, problem: ShootingProblem, found: Solution, observe: str) -> Orbit:
        """Orbit from a solution of its equations."""
        return cls(problem, found.point, found.jacobians, found.last_step, observe, found.motion)

    @property
    def system(self) -> System:
        """The system."""
        return self.problem.flow.system

    @property
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

    @property
    def multipliers(self) -> NDArray[np.complex128]:
        """Floquet multipliers, largest first, shape (2n,)."""
        return self._spectrum[0].multipliers

    @property
    def log_moduli(self) -> Real:
        """Natural logarithms of the moduli of the multipliers, (2n,), however small these are.

        Minus infinity where a segment's Jacobian shows nothing of a direction, as where a stop
        damps it to less than rounding.
        """
        return self._spectrum[0].log_moduli

    @cached_property
    def _spectrum(self) -> tuple[Spectrum, Real]:
        """Multipliers and the Jacobians they come from.

        Segments that squeeze a direction almost to their own rounding error are cut into parts.
        """
        try:
            found, jacobians = spectrum(self.jacobians), self.jacobians
            parts = parts_for(found.squeeze)
            while found.squeeze < COARSE and parts <= MOST_PARTS:
                finer = self.problem.jacobians(self.point, parts)
                if finer is None:
                    break
                found, jacobians = spectrum(finer), finer
                parts *= 2
        except MultiplierError as error:
            raise ConvergenceError(str(error)) from None
        return found, jacobians

    @cached_property
    def log_modulus_uncertainties(self) -> Real:
        """Estimate of how far each of the `log_moduli` may be off, (2n,).

        Of each segment's Jacobian a relative error of ten times the flow map's `rtol` is assumed
        (or of ten times `error`, where that is more); see `nldyn.orbits.multipliers.uncertainties`.
        """
        found, jacobians = self._spectrum
        error = 10.0 * max(self.problem.flow.options.rtol, self.error)
        return uncertainties(jacobians, found, error)

    @property
    def stability(self) -> Stability:
        """The multiplier that decides stability, how far from the unit circle, and how sure."""
        return Stability(
            self.largest_multiplier,
            float(self.log_moduli[0]),
            float(self.log_modulus_uncertainties[0]),
        )

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
        """|det Φ / exp(-∫ (tr D + Σ v² ∂F/∂δ') dt) - 1|: Liouville's formula.

        v² is the velocity jump per unit impulse at a stop whose force depends on the speed. The
        determinant is the product of those of the segments. The error is nan where damping is so
        strong that rounding hides the third digit of 1e-6 even so.
        """
        value, rounding = log_determinant(self._spectrum[1])
        if rounding > 1e-6:
            return math.nan
        exact = -float(np.trace(self.system.total_damping)) * self.duration
        exact -= contact_damping(self.problem.flow, self.trajectory)
        return math.inf if math.isnan(value) else abs(math.expm1(min(value - exact, 700.0)))

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
            self._extremes[output] = self._find_extremes(output)
        return self._extremes[output]

    @cached_property
    def _extremes(self) -> dict[int, Extremes]:
        return {}

    def _find_extremes(self, output: int) -> Extremes:
        found = self.trajectory.extremes(output)
        stops = self.system.stops
        offset = stops[output].gap if output < len(stops) else 0.0
        return Extremes(found[:, 0], found[:, 1] - offset, found[:, 2] > 0.0)

    @cached_property
    def observed_extremes(self) -> Extremes:
        """Local extremes of the observed displacement."""
        return self.extremes(len(self.system.stops) + self.system.interfaces.index(self.observe))

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
        values = self.observed_extremes.values
        return float(np.max(np.abs(values))) if values.size else 0.0

    @cached_property
    def max_penetration(self) -> float:
        """Deepest penetration over all stops in m (zero if none is touched)."""
        values = [float(p.values.max()) for p in self.penetration_peaks if p.values.size]
        return max(0.0, *values) if values else 0.0

    @cached_property
    def impacts(self) -> int:
        """Number of contact phases in one period of the orbit, over all stops."""
        return int(self.trajectory.closings.sum())

    @cached_property
    def impact_list(self) -> tuple[Impact, ...]:
        """Contact peaks in the order of time (a double-peaked contact counts twice here)."""
        impacts = [
            Impact(
                index,
                float(phase / self.omega),
                float(depth),
                self._largest_force(index, float(phase), float(depth)),
            )
            for index, (stop, peaks) in enumerate(
                zip(self.system.stops, self.penetration_peaks, strict=True)
            )
            for phase, depth in zip(peaks.phases, peaks.values, strict=True)
            if depth > 0.0
        ]
        return tuple(sorted(impacts, key=lambda impact: impact.time))

    def _largest_force(self, index: int, phase: float, depth: float) -> float:
        """Largest force of the contact whose penetration is deepest at a phase."""
        stop = self.system.stops[index]
        if not stop.depends_on_speed:
            return float(stop.force(depth))

        def force(where: float) -> float:
            state = self.states(np.array([where]))
            return stop.force(*_depth_and_speed(self.system, stop, state)).item()

        pieces = self.trajectory.record
        within = (pieces.kind >= 0) & (pieces.force[:, index].max(axis=1) > 0.0)
        reach = self.omega * float(pieces.duration[within].max(initial=0.0))
        found = minimize_scalar(
            lambda where: -force(where),
            bounds=(phase - reach, phase),
            method="bounded",
            options={"xatol": 1e-9 * max(reach, 1e-9)},
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
        states = np.empty((phases.size, 2 * self.system.size))
        states[order] = self.trajectory.states(within[order])
        return self.problem.flow.to_modal(states)

    def penetration(self, stop: int, phases: Real) -> Real:
        """Penetration of a stop (m, negative when open) at any forcing phases."""
        check_whole("penetration: stop", stop, 0, len(self.system.stops) - 1)
        states = self.states(phases)
        return _depth_and_speed(self.system, self.system.stops[stop], states)[0]

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
        return history_of(self.system, phases / self.omega, self.states(phases))


def history_of(system: System, time: Real, states: Real) -> History:
    """Displacements and forces at modal states (k, 2n), with their times (k,) in s."""
    q = states[:, : system.size]
    depth = np.empty((len(system.stops), time.size))
    force = np.empty_like(depth)
    for row, stop in enumerate(system.stops):
        depth[row], speed = _depth_and_speed(system, stop, states)
        force[row] = stop.force(depth[row], speed)
    return History(
        time,
        q,
        states[:, system.size :],
        {name: q @ phi for name, phi in system.participation.items()},
        depth.T,
        force.T,
    )


def contact_damping(flow: FlowMap, motion: Trajectory) -> float:
    """∫ Σ v² ∂F/∂δ' dt over the contacts of a motion, by the quadrature of their panels."""
    system = flow.system
    if not any(stop.depends_on_speed for stop in system.stops):
        return 0.0
    phases, weights = motion.contact_quadrature()
    states = flow.to_modal(motion.states(phases))
    total = 0.0
    for stop in system.stops:
        v = system.stop_vector(stop)
        total += float(v @ v * weights @ stop.viscosity(*_depth_and_speed(system, stop, states)))
    return total


def _depth_and_speed(system: System, stop: Stop, states: Real) -> tuple[Real, Real]:
    """Penetration of a stop (negative when open) and its rate at modal states (k, 2n)."""
    v = system.stop_vector(stop)
    return states[:, : system.size] @ v - stop.gap, states[:, system.size :] @ v


def check_observe(system: System, observe: str | None) -> str:
    """Interface to observe: the given one, else the system's first."""
    check_types(system=(system, System), observe=(observe, str, None))
    if not system.interfaces:
        raise SystemModelError("the system has no interface to observe")
    if observe is None:
        return system.interfaces[0]
    if observe not in system.interfaces:
        raise SystemModelError(
            f"observe: unknown interface '{observe}'; there are: {', '.join(system.interfaces)}"
        )
    return observe


def shooting_problem(flow: FlowMap, period: int, segments: int | None = None) -> ShootingProblem:
    """Shooting equations with two segments per excitation period unless told otherwise."""
    check_whole("period", period, 1, LONGEST_PERIOD)
    if segments is None:
        segments = SEGMENTS_PER_PERIOD * period
    check_whole("segments", segments, 1, MOST_SEGMENTS)
    if segments % period:
        raise SystemModelError(f"segments must be a multiple of period {period}, got {segments}")
    return ShootingProblem(flow, period, segments)


class ConvergenceError(RuntimeError):
    """No orbit was found; the text says how far Newton's method came."""


def solve_orbit(
    system: System | FlowMap,
    frequency_hz: float,
    period: int = 1,
    *,
    guess: Real | None = None,
    observe: str | None = None,
    segments: int | None = None,
) -> Orbit:
    """Find a periodic orbit at a given frequency by multiple shooting.

    Parameters
    ----------
    system : System or FlowMap
        What to solve.
    frequency_hz : float
        Excitation frequency in Hz.
    period : int
        Period multiple n.
    guess : (2n,) or (k, 2n) array, optional
        Modal displacements and velocities at phase zero, or at the k shooting phases. Without it
        the system is simulated from rest for 200 periods; where the motion does not settle,
        Newton's method starts where it nearly repeats, and from the small motion about a rest that
        a stop holds. Where all that fails, an orbit of period 1 is carried here from up to 55 times
        the modal damping.
    observe : str, optional
        Interface whose displacement is reported; the first unless given.
    segments : int, optional
        Number k of shooting segments; where given, the simulation from rest is cut as finely.

    Returns
    -------
    Orbit

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    ConvergenceError
        If the simulation fails, or Newton's method does not converge or comes to an orbit of a
        shorter period; the text says why.

    Examples
    --------
    >>> from nldyn import System, Unbalance
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> orbit = solve_orbit(system, frequency_hz=20.0)
    >>> orbit.impacts
    0
    """
    flow = flow_of(system)
    check_frequency("frequency_hz", frequency_hz)
    observe = check_observe(flow.system, observe)
    problem = shooting_problem(flow, period, segments)
    omega = 2.0 * math.pi * frequency_hz
    check_bounded(flow.system, omega)
    if guess is not None:
        return _first_orbit(problem, [_guessed(problem, guess, omega)], omega, observe)
    pieces = (segments or period) // period  # of one excitation period
    try:
        return _first_orbit(problem, _simulated(problem, omega, pieces), omega, observe)
    except ConvergenceError:
        orbit = _by_more_damping(problem, omega, observe, pieces) if period == 1 else None
        if orbit is None:
            raise
        return orbit


def _guessed(problem: ShootingProblem, guess: Real, omega: float) -> Real:
    """States (k, 2n) at the shooting phases from a guess, checked."""
    guess = np.atleast_2d(numbers("guess", guess))
    if guess.shape not in ((1, problem.size), (problem.segments, problem.size)):
        raise SystemModelError(
            f"guess must have {problem.size} entries (or {problem.segments} such rows), "
            f"got shape {guess.shape}"
        )
    if guess.shape[0] == problem.segments:
        return problem.flow.to_state(guess)
    return spread(problem, problem.flow.to_state(guess[0]), omega)


def _simulated(problem: ShootingProblem, omega: float, pieces: int) -> Iterator[Real]:
    """States at the shooting phases that a motion from rest comes near, the likeliest first.

    It is simulated in pieces of the excitation period.
    """
    flow, period = problem.flow, problem.period
    q = rest(flow.system)
    start = flow.to_state(at_rest(q))
    warm = np.linspace(0.0, 400.0 * np.pi, 200 * pieces + 1)
    found = flow.shoot(start[None], warm, omega, sensitivities=False, chained=True)
    if found.failure:
        raise ConvergenceError(
            f"the simulation from rest at {omega / (2.0 * math.pi):g} Hz failed: {found.failure}; "
            "give a guess"
        )
    strobe = found.ends[pieces - 1 :: pieces][20:]
    # beside a subharmonic attractor lies, in its middle, the orbit that it branched from
    counts = (2, 3, 4, len(strobe)) if period == 1 else ()
    middles = [strobe[-count:].mean(axis=0) for count in counts]
    near = strobe[near_returns(strobe, period, 8)]
    # at a sharp resonance the motion from rest takes too long to grow
    linear = [] if flow.system.grows(omega) else [flow.system.steady(omega).real]
    starts = (spread(problem, z, omega) for z in (strobe[-1], *near, *middles, *linear))
    if not np.any(q):
        return starts
    held = held_motion(flow.system, q, omega, problem.phases[:-1])
    return itertools.chain(starts, [flow.to_state(held)])


def _first_orbit(
    problem: ShootingProblem, starts: Iterable[Real], omega: float, observe: str
) -> Orbit:
    """The first orbit of the problem's own period that Newton's method finds from some states."""
    failure = ConvergenceError()
    for nodes in starts:
        try:
            orbit = refine(problem, nodes, omega, observe)
        except ConvergenceError as error:
            failure = error
            continue
        shortest = minimal_period(orbit)
        if shortest == problem.period:
            return orbit
        failure = ConvergenceError(
            f"no orbit of period {problem.period} found at {omega / (2.0 * math.pi):g} Hz: "
            f"Newton's method came to one of period {shortest}; give a guess beside the orbit, or "
            "try find_orbits"
        )
    raise failure


def _by_more_damping(
    problem: ShootingProblem, omega: float, observe: str, pieces: int
) -> Orbit | None:
    """Orbit at more damping, which a motion from rest comes near, carried back, or None."""
    from nldyn.orbits.homotopy import DAMPING, Detour

    if not np.any(problem.flow.system.total_damping):
        return None
    for factor in MORE_DAMPING:
        detour = Detour(problem.flow, {DAMPING: factor})
        try:
            more = replace(problem, flow=detour.flow(1.0))
            orbit = _first_orbit(more, _simulated(more, omega, pieces), omega, observe)
        except (ConvergenceError, SystemModelError):
            continue
        found = detour.carried(orbit, 1.0, 0.0)
        if found is not None:
            return found
    return None


def check_bounded(system: System, omega: float) -> None:
    """Refuse the resonance of an undamped mode where no stop can limit the motion."""
    if not system.stops:
        system.steady(omega)


def near_returns(states: Real, period: int, count: int) -> list[int]:
    """Indices where the state comes back after `period` more nearly than before and after.

    A motion that settles on an attractor also lingers near the saddles that it passes. The
    closest returns come first; states near a chosen one are left out.
    """
    if len(states) <= period:
        return []
    distance = np.linalg.norm(states[period:] - states[:-period], axis=1)
    scale = float(np.linalg.norm(states, axis=1).max()) or 1.0
    before, after = np.append(np.inf, distance[:-1]), np.append(distance[1:], np.inf)
    returns = np.flatnonzero((distance <= before) & (distance <= after) & (distance < 0.3 * scale))
    chosen: list[int] = []
    for index in returns[np.argsort(distance[returns], kind="stable")]:
        if len(chosen) == count:
            break
        apart = [np.linalg.norm(states[index] - states[c]) for c in chosen]
        if all(a > 1e-2 * scale for a in apart):
            chosen.append(int(index))
    return chosen


def _is_left_free(system: System) -> bool:
    """Whether the stops leave a mode of zero frequency, or a combination of such modes, free."""
    free = system.natural_frequencies == 0.0
    held = np.array([system.stop_vector(stop)[free] for stop in system.stops])
    held = held.reshape(-1, int(free.sum()))  # without stops, too
    return int(np.linalg.matrix_rank(held)) < held.shape[1]


def _touches_only(system: System, motion: Trajectory, omega: float) -> bool:
    """Whether contacts push, but by no more than rounding of the drive and of the motion."""
    force = float(motion.record.force.max(initial=0.0))
    depth = float(motion.record.depth.max(initial=0.0))
    drive = sum(abs(source.phasor) * omega**source.order for source in system.excitation)
    reach = np.abs(motion.record.start @ motion.flow.rows[: len(system.stops)].T).max(initial=0.0)
    return 0.0 < force <= TOUCH * drive and depth <= TOUCH * reach


def refine(
    problem: ShootingProblem,
    nodes: Real,
    omega: float,
    observe: str,
    max_iterations: int = 25,
) -> Orbit:
    """Newton's method at fixed frequency from states (k, 2n)."""
    guess = np.append(nodes.ravel(), math.log(omega))
    row = np.zeros(guess.size)
    row[-1] = 1.0
    found = problem.correct(guess, row, max_iterations=max_iterations)
    where = f"no orbit of period {problem.period} found at {omega / (2 * math.pi):g} Hz"
    drifts = bool(np.any(problem.flow.system.natural_frequencies == 0.0))
    if drifts and _touches_only(problem.flow.system, found.motion, omega):
        raise ConvergenceError(f"{where}: {NO_PLACE}")
    if not found.converged:
        contact = np.any(found.motion.record.kind >= 0)
        if not contact and problem.flow.system.grows(omega):
            raise ConvergenceError(
                f"{where}: an undamped mode is excited at its own frequency, and its motion grows "
                "without bound where it touches no stop"
            )
        if drifts and _is_left_free(problem.flow.system):
            raise ConvergenceError(f"{where}: {NOT_HELD}")
        if not contact and drifts:
            raise ConvergenceError(f"{where}: {NO_PLACE}")
        step = f", last relative step {found.last_step:.1e}" if found.last_step < math.inf else ""
        raise ConvergenceError(
            f"{where}: {found.failure}{step} after {found.iterations} "
            f"iteration{'' if found.iterations == 1 else 's'}; another guess or find_orbits may "
            f"find one{', or continue_branch from calm motion' if problem.period == 1 else ''}"
        )
    return Orbit.of(problem, found, observe)


def spread(problem: ShootingProblem, start: Real, omega: float) -> Real:
    """States at all shooting phases by integrating from the first."""
    if problem.segments == 1:
        return start[None]
    ends = problem.flow.shoot(
        start[None], problem.phases[:-1], omega, sensitivities=False, chained=True
    ).ends
    return np.vstack([start[None], ends])


def stroboscopic(orbit: Orbit) -> Real:
    """States (n, 2n_modes) at the start of each excitation period."""
    problem = orbit.problem
    return problem.nodes(orbit.point)[:: problem.segments // problem.period]


def same_orbit(a: Orbit, b: Orbit, rtol: float = 1e-5) -> bool:
    """Whether two orbits at one frequency agree up to a shift by whole excitation periods."""
    if a.period != b.period or not math.isclose(a.omega, b.omega, rel_tol=1e-9):
        return False
    return shifted_alike(stroboscopic(a), stroboscopic(b), rtol * a.problem.scale(a.point))


def shifted_alike(a: Real, b: Real, size: float) -> bool:
    """Whether two cycles of states (n, 2n_modes) agree within a size up to a shift."""
    return any(
        float(np.abs(a - np.roll(b, shift, axis=0)).max()) <= size for shift in range(len(a))
    )


def minimal_period(orbit: Orbit, rtol: float = 1e-6) -> int:
    """Smallest number of excitation periods after which the orbit really repeats."""
    states = stroboscopic(orbit)
    scale = orbit.problem.scale(orbit.point)
    for n in range(1, orbit.period):
        if orbit.period % n == 0:
            shifted = np.roll(states, n, axis=0)
            if float(np.abs(states - shifted).max()) <= rtol * scale:
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
