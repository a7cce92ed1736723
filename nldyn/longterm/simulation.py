"""Time simulation with exact events: transients, and sweeps of the excitation frequency."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any, overload

import numpy as np

from nldyn.base.arrays import SLACK, TINY, Real
from nldyn.base.errors import (
    ConvergenceError,
    SystemModelError,
    check_frequency,
    check_whole,
    is_finite,
    numbers,
    shown,
)
from nldyn.flow.flow_map import FlowMap, Trajectory, flow_of
from nldyn.flow.rigid import behind_rigid_stops, rest_forces
from nldyn.flow.settling import periods_at_once, settling_runs
from nldyn.orbits.history import History
from nldyn.orbits.newton import check_bounded
from nldyn.orbits.orbit import Orbit, check_observe, history_of
from nldyn.runtime.executors import check_execution, values_of
from nldyn.runtime.progress import of_number, shows_progress, silent_count
from nldyn.system.system import System

Counted = Callable[[int, int], None]  # told how many of how many are done
BLOCK = 64  # periods recorded in one call
PIECE = 2000  # periods of a transient whose states are held at once
MOST_STEPS = 10**6  # of a sweep, and
MOST_RECORDED = 10**6  # periods of a recorded motion: 1 to 5 kB each with 1 to 4 modes
MOST_PERIODS = 10**8
WHOLE = 1e-6  # of a period: what may be missing at its end


@dataclass(frozen=True, eq=False)
class Motion:
    """A simulated motion: exact at any instant, not a table of samples.

    It consists of stretches, in each of which the frequency is constant.

    Parameters
    ----------
    flow : FlowMap
        What made it.
    stretches : tuple of Trajectory
        One after the other.
    begins : (k + 1,)
        Times in s at which the k stretches begin, and at which the last one ends.
    failure : str
        Empty, or why the simulation ended early.
    rate_hz_per_s : float
        Rate at which the excitation frequency changes; negative in a run-down, zero at constant
        frequency.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, simulate
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> motion = simulate(system, frequency_hz=20.0, periods=200)
    >>> motion.end_time
    10.0
    """

    flow: FlowMap
    stretches: tuple[Trajectory, ...]
    begins: Real
    failure: str = ""
    rate_hz_per_s: float = 0.0

    def __repr__(self) -> str:
        """One line: duration, frequencies, what ended it."""
        ended = f"; ended early: {self.failure}" if self.failure else ""
        rate = f", {self.rate_hz_per_s:+.4g} Hz/s" if self.rate_hz_per_s else ""
        return f"<Motion of {self.begins[-1] - self.begins[0]:.6g} s{rate}{ended}>"

    @property
    def system(self) -> System:
        """The system."""
        return self.flow.system

    @property
    def start_time(self) -> float:
        """Time in s at which the recorded motion begins."""
        return float(self.begins[0])

    @property
    def end_time(self) -> float:
        """Time in s at which it ends."""
        return float(self.begins[-1])

    @property
    def duration(self) -> float:
        """Length of the recorded motion in s."""
        return self.end_time - self.start_time

    def frequency_hz(self, time: Real | float) -> Real:
        """Excitation frequency in Hz at times in s within the motion, that of the stretch.

        Raises
        ------
        SystemModelError
            For a time before the beginning or after the end.
        """
        hz = np.array([stretch.omega for stretch in self.stretches]) / (2.0 * np.pi)
        return np.asarray(hz[self._stretch_at(self._checked(time))])

    def states(self, time: Real) -> Real:
        """Modal displacements and velocities (k, 2n) at times (k,) in s within the motion.

        Raises
        ------
        SystemModelError
            For a time before the beginning or after the end.
        """
        time = self._checked(time)
        if time.ndim != 1:
            raise SystemModelError(f"time must be a list of times, got shape {time.shape}")
        order = np.argsort(time, kind="stable")
        where = self._stretch_at(time[order])
        states = np.empty((time.size, self.system.state_size))
        for k in np.unique(where):
            within = order[where == k]
            stretch = self.stretches[k]
            phases = stretch.record.phase[0] + stretch.omega * (time[within] - self.begins[k])
            states[within] = stretch.states(phases)
        return self.flow.to_modal(states)

    def _checked(self, time: Real | float) -> Real:
        """Times within the motion as an array."""
        time = numbers("time", time)
        slack = SLACK * max(abs(self.end_time), TINY)
        if time.size and (
            time.min() < self.start_time - slack or time.max() > self.end_time + slack
        ):
            raise SystemModelError(
                f"time must lie between {self.start_time:g} and {self.end_time:g} s, "
                f"got {time.min():g} to {time.max():g}"
            )
        return time

    def _stretch_at(self, time: Real) -> np.ndarray:
        last = len(self.stretches) - 1
        return np.clip(np.searchsorted(self.begins, time, side="right") - 1, 0, last)

    @property
    def end(self) -> Real:
        """Modal displacements and velocities (2n,) at the end: where to go on.

        Then come the places in m of sliders behind springs.
        """
        return np.asarray(self.flow.to_start(end_state(self.stretches[-1])))

    def history(self, samples: int = 1000) -> History:
        """Sample the motion: displacements, penetrations and contact forces.

        Parameters
        ----------
        samples : int
            Number of equal time steps; the result has one sample more. A contact shorter than a
            step may fall between two samples; `nldyn.impacts` misses none.

        Raises
        ------
        SystemModelError
            If `samples` is not a whole number from 1 to 100 million.
        """
        check_whole("history: samples", samples, 1, MOST_PERIODS)
        return self._history_at(np.linspace(self.start_time, self.end_time, samples + 1))

    def histories(self, samples: int, at_once: int) -> Iterator[History]:
        """As `history`, in pieces of so many samples: of a long motion none holds all."""
        check_whole("histories: samples", samples, 1)
        check_whole("histories: at_once", at_once, 1)
        step = (self.end_time - self.start_time) / samples
        for first in range(0, samples + 1, at_once):
            time = self.start_time + step * np.arange(first, min(first + at_once, samples + 1))
            yield self._history_at(np.minimum(time, self.end_time))

    def _history_at(self, time: Real) -> History:
        """The motion at some instants."""
        states, where = self.states(time), self._stretch_at(time)
        rest = np.zeros((time.size, len(self.system.stops)))
        turns, pace = np.zeros(time.size), np.zeros(time.size)
        for k in np.unique(where):
            within, stretch = where == k, self.stretches[k]
            phases = stretch.record.phase[0] + stretch.omega * (time[within] - self.begins[k])
            turns[within], pace[within] = phases, stretch.omega
            rest[within] = rest_forces(stretch, phases, self.flow.to_state(states[within]))
        return history_of(self.system, time, turns, pace, states, rest)

    def extremes(self, interface: str | None = None) -> tuple[Real, Real]:
        """Times (k,) in s and values (k,) in m of the local extremes of a displacement.

        Parameters
        ----------
        interface : str, optional
            The first unless given.
        """
        system = self.system
        name = check_observe(system, interface)
        output = system.output(name)
        times, values = [np.empty(0)], [np.empty(0)]
        for begin, stretch in zip(self.begins, self.stretches, strict=False):
            found = stretch.extremes(output)
            first = stretch.record.phase[0]
            found = found[found[:, 0] > first]  # without the one that closes a periodic motion
            times.append(begin + (found[:, 0] - first) / stretch.omega)
            values.append(found[:, 1])
        return np.concatenate(times), np.concatenate(values)

    def period_peaks(self, interface: str | None = None) -> tuple[Real, Real]:
        """Frequencies (k,) in Hz and largest absolute displacements (k,) in m of each period.

        Only whole excitation periods count, from the beginning on. The largest displacement may
        be a local extreme within the period or lie at either end of it.
        """
        times, values = self.extremes(interface)
        ends, hz = self._periods
        index = np.searchsorted(ends, times, side="right") - 1
        at_ends, _ = self.strobed(interface)
        peaks = np.maximum(np.abs(at_ends[:-1]), np.abs(at_ends[1:]))
        inside = (index >= 0) & (index < hz.size)
        np.maximum.at(peaks, index[inside], np.abs(values[inside]))
        return hz, peaks

    def strobed(self, interface: str | None = None) -> tuple[Real, Real]:
        """Displacement and velocity (k + 1,) of an interface after each whole excitation period.

        Where a base moves and its frequency changes, that of the period before counts.
        """
        system, states = self.system, self.strobe
        name = check_observe(system, interface)
        if name not in system.rides:
            phi = system.participation[name]
            return states[:, : phi.size] @ phi, states[:, phi.size :] @ phi
        _, hz = self._periods
        phase = np.array([self.stretches[0].record.phase[0]])
        paces = 2.0 * np.pi * np.append(hz[:1], hz)
        found = [
            system.displacement(name, state[None], phase, pace)
            for state, pace in zip(states, paces.tolist(), strict=True)
        ]
        u, v = np.array(found)[:, :, 0].T
        return u, v

    @cached_property
    def _periods(self) -> tuple[Real, Real]:
        """Times (k + 1,) at which whole excitation periods end, and their frequencies (k,)."""
        turns = [0.0]
        for stretch in self.stretches:
            turns.append(turns[-1] + end_phase(stretch) - float(stretch.record.phase[0]))
        total = math.floor(turns[-1] / (2.0 * math.pi) + WHOLE)
        ends = np.interp(2.0 * np.pi * np.arange(total + 1), turns, self.begins)
        return ends, 1.0 / np.diff(ends)

    @property
    def strobe(self) -> Real:
        """Modal displacements and velocities (k + 1, 2n) after each whole excitation period."""
        ends, _ = self._periods
        return self.states(np.clip(ends, self.start_time, self.end_time))


def end_phase(stretch: Trajectory) -> float:
    """Forcing phase at which a recorded motion ends."""
    record = stretch.record
    return float(record.phase[-1] + stretch.omega * record.duration[-1])


def end_state(stretch: Trajectory) -> Real:
    """State z (2n,) at which a recorded motion ends."""
    return np.asarray(stretch.states(np.array([end_phase(stretch)]))[0])


def motion_of(orbit: Orbit, turns: int = 1) -> Motion:
    """A periodic orbit as a motion, run through several times.

    Examples
    --------
    >>> from nldyn import System, Unbalance, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> round(motion_of(solve_orbit(system, frequency_hz=20.0), 3).duration, 12)
    0.15
    """
    begins = np.asarray(orbit.duration * np.arange(turns + 1), dtype=float)
    return Motion(orbit.problem.flow, (orbit.trajectory,) * turns, begins)


@overload
def simulate(
    system: System | FlowMap,
    frequency_hz: float,
    periods: int,
    *,
    start: Real | None = ...,
    transient: int = ...,
    executor: Executor | None = ...,
    progress: Callable[[int, int], None] | None = ...,
) -> Motion: ...


@overload
def simulate(
    system: System | FlowMap,
    frequency_hz: Sequence[float] | Real,
    periods: int,
    *,
    start: Real | None = ...,
    transient: int = ...,
    executor: Executor | None = ...,
    progress: Callable[[int, int], None] | None = ...,
) -> list[Motion]: ...


@shows_progress(of_number("simulated"))
def simulate(
    system: System | FlowMap,
    frequency_hz: float | Sequence[float] | Real,
    periods: int,
    *,
    start: Real | None = None,
    transient: int = 0,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Motion | list[Motion]:
    """Simulate a motion at constant excitation frequency, or several.

    Flights are exact, contact phases resolved to the tolerance of the flow map; no contact is
    passed over.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    frequency_hz : float or sequence of k
        Excitation frequency in Hz. A list of them gives a list of motions, each a computation of
        its own.
    periods : int
        Excitation periods to record, at most a million: all of the motion is kept.
    start : (2n,) or (k, 2n) array, optional
        Modal displacements and velocities at forcing phase zero; undeformed and still unless
        given. One for
        all, or one for each frequency.
    transient : int
        Excitation periods before the recording.
    executor : concurrent.futures.Executor, optional
        Where to compute a list; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)``: excitation periods of one motion, or motions of a list.

    Returns
    -------
    Motion or list of Motion
        Its time counts from the start, transient included.

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    ConvergenceError
        If the transient cannot be simulated, or nothing of the recording. One that fails later is
        kept up to there, with the reason in `Motion.failure`.
    TaskError
        In place of a ConvergenceError, for one of a list.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> motion = simulate(system, frequency_hz=50.0, periods=10, transient=500)
    >>> len(motion.strobe)
    11
    """
    flow = flow_of(system, periodic=False)
    check_execution(executor, progress)
    check_whole("periods", periods, 1, MOST_RECORDED)
    check_whole("transient", transient, 0, MOST_PERIODS)
    cases = cases_at(flow, frequency_hz, start)
    if is_list(frequency_hz):
        task = partial(_simulated, flow, periods, transient)
        return values_of(task, cases, executor, progress)
    return _simulated(flow, periods, transient, cases[0], progress or silent_count)


def is_list(value: object) -> bool:
    """Whether an argument lists several values: not a number, not a text."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    return isinstance(value, Sequence) and not isinstance(value, str | bytes)


def cases_at(
    flow: FlowMap, frequency_hz: float | Sequence[float] | Real, start: Real | None
) -> list[tuple[float, Real]]:
    """Checked frequencies, one or several, with the state z from which each motion begins."""
    given: Any = frequency_hz
    frequencies = list(given) if is_list(given) else [given]
    if not frequencies:
        raise SystemModelError("frequency_hz must name at least one frequency, got an empty list")
    for hz in frequencies:
        check_frequency("frequency_hz", hz)
        omega = 2.0 * math.pi * hz
        check_bounded(flow.at(omega, 0.0), omega)
    return list(zip(map(float, frequencies), _starts(flow, start, len(frequencies)), strict=True))


def _starts(flow: FlowMap, start: Real | None, count: int) -> list[Real]:
    """States z from which several motions begin: one for all, or one for each."""
    modal = None if start is None else numbers("start", start)
    if modal is None or modal.ndim != 2:
        return [starting_state(flow, modal)] * count
    if len(modal) != count:
        raise SystemModelError(f"start has {len(modal)} states for {count} motions")
    return [starting_state(flow, row) for row in modal]


def _simulated(
    flow: FlowMap,
    periods: int,
    transient: int,
    case: tuple[float, Real],
    tell: Counted = silent_count,
) -> Motion:
    """The motion at a frequency in Hz from a state z at phase zero."""
    frequency_hz, state = case
    omega = 2.0 * math.pi * frequency_hz
    total = transient + periods
    before = transient_end(flow, state, omega, transient, lambda done: tell(done, total))
    block = periods_at_once(flow, BLOCK)
    stretches, failure = _recorded(
        _blocks(flow, before, omega, transient, periods),
        lambda number: tell(min(transient + number * block, total), total),
    )
    if not stretches:
        raise ConvergenceError(f"the motion at {frequency_hz:g} Hz failed at once: {failure}")
    turns = transient + np.minimum(block * np.arange(len(stretches) + 1.0), periods)
    lost = stretches[-1]
    if lost.failure:
        turns[-1] = turns[-2] + (end_phase(lost) - lost.record.phase[0]) / (2.0 * math.pi)
    begins = np.asarray(turns / frequency_hz, dtype=float)
    return Motion(flow, tuple(stretches), begins, failure)


def _recorded(
    pieces: Iterable[Trajectory], tell: Callable[[int], None]
) -> tuple[list[Trajectory], str]:
    """Pieces of a motion up to the one that fails, and why; tells how many are done."""
    stretches = []
    for number, piece in enumerate(pieces, start=1):
        if piece.record.phase.size:
            stretches.append(piece)
        if piece.failure:
            return stretches, piece.failure
        tell(number)
    return stretches, ""


def starting_state(flow: FlowMap, start: Real | None) -> Real:
    """State z (2n,) of a modal one that a user gave; undeformed and still for none."""
    size = 2 * flow.system.size
    if start is None:
        return np.zeros(flow.system.state_size)
    modal = numbers("start", start)
    if modal.shape not in ((size,), (size + len(flow.system.place_ends),)):
        raise SystemModelError(
            f"start must have {size} entries, displacements and velocities of "
            f"{flow.system.size} modes, got shape {modal.shape}"
        )
    state = flow.to_state(modal)
    if behind_rigid_stops(flow, state[None])[0]:
        raise SystemModelError("start lies behind a rigid stop, where no motion can begin")
    return state


def transient_end(
    flow: FlowMap,
    state: Real,
    omega: float,
    periods: int,
    tell: Callable[[int], None] = lambda done: None,
) -> Real:
    """State z after some periods from phase zero on; tells how many are done.

    Raises
    ------
    ConvergenceError
        If it cannot be simulated.
    """
    done = 0
    try:
        for run in settling_runs(flow, state, omega, periods, PIECE):
            state, done = run[-1], done + len(run)
            tell(done)
    except ConvergenceError as error:
        hz = omega / (2.0 * math.pi)
        raise ConvergenceError(f"the transient at {hz:g} Hz failed: {error}") from None
    return state


def _blocks(
    flow: FlowMap, state: Real, omega: float, before: int, periods: int
) -> Iterator[Trajectory]:
    """Recorded motions of some periods, one after the other, after those `before`."""
    at_once = periods_at_once(flow, BLOCK)
    for done in range(0, periods, at_once):
        count = min(periods - done, at_once)
        phases = np.linspace(0.0, 2.0 * np.pi * count, count + 1)
        here = flow.at(omega, (before + done) * 2.0 * math.pi / omega)
        trajectory = here.trajectory(state[None], phases, omega, chained=True)
        yield trajectory
        state = end_state(trajectory)


@overload
def sweep(
    system: System | FlowMap,
    range_hz: tuple[float, float],
    rate_hz_per_s: float,
    *,
    start: Real | None = ...,
    steps_per_period: int = ...,
    executor: Executor | None = ...,
    progress: Callable[[int, int], None] | None = ...,
) -> Motion: ...


@overload
def sweep(
    system: System | FlowMap,
    range_hz: Sequence[tuple[float, float]],
    rate_hz_per_s: float,
    *,
    start: Real | None = ...,
    steps_per_period: int = ...,
    executor: Executor | None = ...,
    progress: Callable[[int, int], None] | None = ...,
) -> list[Motion]: ...


@shows_progress(of_number("simulated"))
def sweep(
    system: System | FlowMap,
    range_hz: tuple[float, float] | Sequence[tuple[float, float]],
    rate_hz_per_s: float,
    *,
    start: Real | None = None,
    steps_per_period: int = 4,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Motion | list[Motion]:
    """Simulate the run-up or run-down of a machine: the frequency changes at a constant rate.

    The forcing phase goes as ``2π (f₀ t ± rate t²/2)``, and the excitation has the phasor of the
    momentary frequency. Flights have a closed form at constant frequency only, so that the
    frequency is constant over each step, at the value that gives it its exact duration, and the
    phase right on average: what a motion gathers of the error of a smooth force goes with the
    fourth power of the step. What a rotor's angular acceleration itself adds to an unbalance
    (``rate / (2π f²)`` of it) is not modelled.

    Parameters
    ----------
    system : System or FlowMap
        What to simulate.
    range_hz : (float, float) or sequence of k pairs
        First and last frequency in Hz; a descending pair runs down. A list of pairs, such as
        ``[(20.0, 30.0), (30.0, 20.0)]``, gives a list of motions, each a computation of its own.
    rate_hz_per_s : float
        Size of the rate of change in Hz/s.
    start : (2n,) or (k, 2n) array, optional
        Modal displacements and velocities at forcing phase zero; undeformed and still unless
        given. One for
        all, or one for each sweep.
    steps_per_period : int
        Steps of constant frequency in an excitation period.
    executor : concurrent.futures.Executor, optional
        Where to compute a list; here unless given.
    progress : callable, optional
        Called as ``progress(done, total)``: steps of one sweep, or sweeps of a list.

    Returns
    -------
    Motion or list of Motion

    Raises
    ------
    SystemModelError
        For input that makes no sense, or a sweep of more than a million steps.
    ConvergenceError
        If the motion fails at once.
    TaskError
        In place of a ConvergenceError, for one of a list.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> run_up = sweep(system, (22.0, 24.0), rate_hz_per_s=1.0)
    >>> hz, peaks = run_up.period_peaks()
    >>> len(hz)
    46
    """
    flow = flow_of(system, periodic=False)
    check_execution(executor, progress)
    given: Any = range_hz
    several = is_list(given) and len(given) > 0 and all(map(is_list, given))
    ranges = [_sweep_range(ends) for ends in (given if several else [given])]
    if not (is_finite(rate_hz_per_s) and rate_hz_per_s > 0.0):
        raise SystemModelError(
            f"rate_hz_per_s must be positive and finite, got {shown(rate_hz_per_s)}"
        )
    check_whole("steps_per_period", steps_per_period, 1, MOST_STEPS)
    for ends in ranges:
        _chirp_count(*ends, rate_hz_per_s, steps_per_period)
    cases = list(zip(ranges, _starts(flow, start, len(ranges)), strict=True))
    if several:
        task = partial(_swept, flow, float(rate_hz_per_s), steps_per_period)
        return values_of(task, cases, executor, progress)
    return _swept(flow, float(rate_hz_per_s), steps_per_period, cases[0], progress or silent_count)


def _swept(
    flow: FlowMap,
    rate: float,
    steps: int,
    case: tuple[tuple[float, float], Real],
    tell: Counted = silent_count,
) -> Motion:
    """The sweep over a range in Hz from a state z at phase zero."""
    (first, last), state = case
    phases, times = chirp_steps(first, last, rate, steps)
    slope = math.copysign(rate, last - first)

    def pieces(state: Real) -> Iterator[Trajectory]:
        for k in range(len(times) - 1):
            omega = (phases[k + 1] - phases[k]) / (times[k + 1] - times[k])
            # the phase goes with a parabola whose mean lies this much above its chord
            above = -math.pi * slope * (times[k + 1] - times[k]) ** 2 / 6.0
            step = np.array([phases[k], phases[k + 1]]) + above
            step -= 2.0 * math.pi * math.floor(step[0] / (2.0 * math.pi))
            here = flow.at(float(omega), times[k] - step[0] / omega)
            trajectory = here.trajectory(state[None], step, float(omega))
            yield trajectory
            state = end_state(trajectory)

    stretches, failure = _recorded(pieces(state), lambda number: tell(number, len(times) - 1))
    if not stretches:
        why = failure or f"{abs(last - first) / rate:g} s are too short to be simulated"
        raise ConvergenceError(f"the sweep from {first:g} Hz failed at once: {why}")
    begins = np.array(times[: len(stretches) + 1])
    lost = stretches[-1]
    if lost.failure:
        begins[-1] = begins[-2] + (end_phase(lost) - lost.record.phase[0]) / lost.omega
    return Motion(flow, tuple(stretches), begins, failure, slope)


def chirp_steps(first: float, last: float, rate: float, steps: int) -> tuple[Real, Real]:
    """Phases and times (k + 1,) of a sweep from one frequency (Hz) to another, in equal phases.

    Examples
    --------
    >>> phases, times = chirp_steps(10.0, 12.0, 1.0, 1)
    >>> float(times[-1]), float(round(phases[-1] / (2.0 * np.pi), 9))
    (2.0, 22.0)
    """
    count, total = _chirp_count(first, last, rate, steps)
    slope = math.copysign(rate, last - first)
    phases = np.minimum(2.0 * np.pi / steps * np.arange(count + 1), total)
    frequency = np.sqrt(first**2 + slope * phases / np.pi)
    # f - f0 without cancellation
    times = phases / (np.pi * (frequency + first))
    return phases, times


def _chirp_count(first: float, last: float, rate: float, steps: int) -> tuple[int, float]:
    """Number of steps of a sweep, and the phase at its end."""
    total = math.pi * abs(last**2 - first**2) / rate
    count = math.ceil(total * steps / (2.0 * math.pi) - SLACK)
    if count > MOST_STEPS:
        raise SystemModelError(
            f"the sweep takes {count} steps of constant frequency, at most {MOST_STEPS} are "
            "allowed: choose a higher rate or fewer steps_per_period"
        )
    return count, total


def _sweep_range(range_hz: tuple[float, float]) -> tuple[float, float]:
    try:
        first, last = range_hz
    except (TypeError, ValueError):
        raise SystemModelError(f"range_hz must be two frequencies, got {shown(range_hz)}") from None
    check_frequency("range_hz: first", first)
    check_frequency("range_hz: last", last)
    if first == last:
        raise SystemModelError(f"range_hz: the sweep begins and ends at {first:g} Hz")
    return float(first), float(last)
