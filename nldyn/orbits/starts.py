"""Starting orbits from time simulations: stroboscopic states that nearly return."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    FAILURES,
    ConvergenceError,
    check_frequency,
    check_types,
    check_whole,
)
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.flow.rigid import before_rigid_stops
from nldyn.orbits.axis import Section
from nldyn.orbits.bordered import FREE, OrbitFamily, correct
from nldyn.orbits.newton import check_bounded, refine, spread
from nldyn.orbits.orbit import Orbit, check_observe, minimal_period, same_orbit, stroboscopic
from nldyn.orbits.shooting import (
    FROM_NEAR,
    SEGMENTS_PER_PERIOD,
    ShootingProblem,
    metric_length,
    shooting_problem,
)
from nldyn.runtime.progress import Progress, Shares, shows_progress, silent
from nldyn.system.equilibrium import at_rest, rest
from nldyn.system.round_stop import RoundStop
from nldyn.system.system import System

DECAYS = 4.0  # time allowed for settling, over the slowest decay time of the linear part
FEWEST, UNDAMPED = 30, 600  # periods of it: at least, and where nothing decays


MOST_COUNT = 10**7  # of starts, periods and candidates
PARAMETER_WEIGHT = 10.0  # of a relative change of the parameter against one of the states
NEARBY = 1e-3  # a step of least length that is short enough to end with
GUESS_ITERATIONS = 10  # Newton steps from a state that may lead nowhere
LONG_STEPS = 0.5, 14  # of least length: the longest, and how many at most
SHORT_STEPS = 0.1, 30  # lead to nine in ten of the orbits that 80 lead to
PARAMETER_SHIFT = 0.05  # how far the parameter may go, relative
RETURNS, APART = 0.3, 0.01  # of a motion's size: to where it comes back; between two starts


@dataclass(frozen=True)
class OrbitSearchOptions:
    """How long to simulate and how many candidates to try.

    Parameters
    ----------
    starts : int
        Number of initial states: rest, then random ones.
    transient, recorded : int
        Excitation periods simulated before and during the recording.
    candidates : int
        Near returns tried for each start, closest first: attractors, and saddles on the way.
    seed : int
        Seed of the random initial states: results are repeatable.

    Raises
    ------
    SystemModelError
        For numbers that make no sense.
    """

    starts: int = 10
    transient: int = 5
    recorded: int = 175
    candidates: int = 5
    seed: int = 20

    def __post_init__(self) -> None:
        for name in ("starts", "recorded", "candidates"):
            check_whole(f"search: {name}", getattr(self, name), 1, MOST_COUNT)
        check_whole("search: transient", self.transient, 0, MOST_COUNT)
        check_whole("search: seed", self.seed, 0)


@dataclass(frozen=True, eq=False)
class Strobe:
    """Stroboscopic states of several simulations at one frequency.

    Parameters
    ----------
    omega : float
        Excitation frequency in rad/s.
    runs : tuple of (k, 2n) arrays
        States at the start of each recorded excitation period.
    failures : tuple of str
        Why each of the other simulations failed.
    """

    omega: float
    runs: tuple[Real, ...]
    failures: tuple[str, ...]


def simulate_strobe(
    flow: FlowMap, frequency_hz: float, options: OrbitSearchOptions, tell: Progress = silent
) -> Strobe:
    """Simulate from rest and from random states and record once per excitation period.

    The random states are up to ten times as large as the linear response, the size of resonant
    motion, or as the smallest state that closes a gap, if that is larger.
    """
    omega = 2.0 * math.pi * frequency_hz
    starts = random_states(flow, omega, options.starts, options.seed)
    return simulate(flow, omega, starts, options.transient, options.recorded, tell)


def random_states(flow: FlowMap, omega: float, count: int, seed: int | Sequence[int]) -> Real:
    """Initial states (count, 2n): rest, then random ones, see `simulate_strobe`."""
    n = flow.system.state_size
    rng = np.random.default_rng(seed)
    size = max(response_size(flow.system, omega), reach(flow.system))
    states = np.empty((count, n))
    for index in range(count):
        scale = 0.0 if index == 0 else size * 10.0 ** rng.uniform(-0.5, 1.0)
        states[index] = scale * rng.standard_normal(n) / math.sqrt(n)
    states[0] = flow.to_state(at_rest(rest(flow.system)))
    return before_rigid_stops(flow, states)


def simulate(
    flow: FlowMap,
    omega: float,
    starts: Real,
    transient: int,
    recorded: int,
    tell: Progress = silent,
) -> Strobe:
    """Simulate from each state (k, 2n) and record the state after each period of the excitation."""
    total = transient + recorded
    runs, failures = [], []
    hz = omega / (2.0 * math.pi)
    for number, start in enumerate(starts):
        tell(f"motion {number + 1} of {len(starts)}", hz, number / len(starts))
        found = flow.strobe(start, omega, total)
        if found.failure:
            failures.append(found.failure)
        else:
            runs.append(found.ends[transient:])
    return Strobe(omega, tuple(runs), tuple(failures))


def response_size(system: System, omega: float) -> float:
    """Size of the linear response at ω (rad/s), for modes near resonance within one period.

    Examples
    --------
    >>> from nldyn import HarmonicForce
    >>> system = System.from_modal([10.0], {"tip": [1.0]}, excitation=[HarmonicForce("tip", 1.0)])
    >>> bool(np.isfinite(response_size(system, 20.0 * np.pi)))
    True
    """
    return system.response(omega).size(omega)


def reach(system: System) -> float:
    """Size of the smallest state that closes one of the gaps; zero where none is open at rest.

    Examples
    --------
    >>> from nldyn import Stop
    >>> system = System.from_modal([10.0], {"tip": [2.0]}, modal_damping=0.1,
    ...     stops=[Stop("tip", 1e9, gap=1e-3)])
    >>> state = np.zeros(2)
    >>> row = system.displacement_row(system.stop_vector(system.stops[0]))
    >>> float(round(reach(system) * np.linalg.norm(row), 12))
    0.001
    """
    needed = [
        max(stop.room if isinstance(stop, RoundStop) else stop.gap, 0.0)
        / float(np.linalg.norm(row))
        for stop in system.stops
        for c in system.stop_vectors(stop)
        if np.any(row := system.displacement_row(c))
    ]
    return min(needed, default=0.0)


def orbits_from_strobe(
    flow: FlowMap,
    strobe: Strobe,
    period: int,
    observe: str,
    options: OrbitSearchOptions,
    tell: Progress = silent,
) -> list[Orbit]:
    """Orbits of one minimal period that Newton's method finds from near returns."""
    problem = shooting_problem(flow, period)
    found: list[Orbit] = []
    for number, states in enumerate(strobe.runs):
        hz = strobe.omega / (2.0 * math.pi)
        tell(f"near returns of motion {number + 1}", hz, number / len(strobe.runs))
        starts = [states[i] for i in near_returns(states, period, options.candidates)]
        orbits = [_refined(problem, start, strobe.omega, observe) for start in starts]
        if not any(orbits):  # an undamped motion goes round an orbit without coming near it
            middle = states[::period].mean(axis=0)
            orbits = [_refined(problem, middle, strobe.omega, observe)]
        for orbit in orbits:
            if orbit is None or minimal_period(orbit) != period:
                continue
            if not any(same_orbit(orbit, other) for other in found):
                found.append(orbit)
    return found


def orbit_near(flow: FlowMap, start: Real, period: int, omega: float, observe: str) -> Orbit | None:
    """Orbit that Newton's method finds from a state z, by its minimal period; None if none."""
    problem = shooting_problem(flow, period)
    try:
        orbit = refine(problem, spread(problem, start, omega), omega, observe, GUESS_ITERATIONS)
        shorter = minimal_period(orbit)
        if shorter < period:
            problem = shooting_problem(flow, shorter)
            nodes = spread(problem, stroboscopic(orbit)[0], omega)
            orbit = refine(problem, nodes, omega, observe, GUESS_ITERATIONS)
    except FAILURES:
        return None
    return orbit


def orbit_beside(section: Section, start: Real, period: int, observe: str) -> Orbit | None:
    """Orbit beside a state z of a section, by its minimal period; None if none is found.

    See `nearest_orbit`.
    """
    try:
        nodes = spread(shooting_problem(section.flow, period), start, section.omega)
    except FAILURES:
        return None
    nodes = section.to_base(nodes.reshape(period, SEGMENTS_PER_PERIOD, -1))
    return nearest_orbit(section, nodes, observe, SHORT_STEPS)


def nearest_orbit(
    section: Section, nodes: Real, observe: str, steps: tuple[float, int]
) -> Orbit | None:
    """Orbit near some states, at a value of the parameter near that of a section; None if none.

    The parameter is free, and each Newton step is the shortest of those that solve the linearised
    equations, the Gauss-Newton method of Allgower and Georg [1990, chapter 3]. So states beside
    a branch that does not reach the section lead to it, and folds do no harm. With more states in a
    period, these equations hold farther. The orbit has its minimal period.

    Parameters
    ----------
    section : Section
        Where the states are.
    nodes : (period, k, 2n) array
        States z, in the coordinates of the section's base, at k equidistant phases of each
        excitation period, a multiple of the usual number of shooting segments.
    observe : str
        Interface whose displacement is reported.
    steps : (float, int)
        Longest step, over the size of the states, and how many at most.
    """
    period, count, _ = nodes.shape
    family = section.family(shooting_problem(section.base, period), observe)
    finer = section.family(shooting_problem(section.base, period, period * count), observe)
    try:
        solution = _least_length_solution(finer, nodes, section.coordinate, *steps)
        if solution is None:
            return None
        point, row = (_thinned(vector, nodes.shape) for vector in solution)
        found = correct(family, point, FREE, row, max_iterations=FROM_NEAR)
        if not found.converged:
            return None
        orbit = found.orbit
    except FAILURES:
        return None
    shorter = minimal_period(orbit)
    if shorter == orbit.period:
        return orbit
    flow = orbit.problem.flow
    return orbit_near(flow, stroboscopic(orbit)[0], shorter, orbit.omega, observe)


def _least_length_solution(
    family: OrbitFamily, nodes: Real, coordinate: float, longest: float, most: int
) -> tuple[Real, Real] | None:
    """Point that Newton steps of least length lead to, and the row that they fix; None if none."""
    point = np.append(nodes.ravel(), coordinate)
    row = np.zeros(point.size)
    row[-1] = 1.0
    for _ in range(most):
        found = correct(family, point, FREE, row, max_iterations=1)
        if not np.any(found.along):
            return None
        metric = family.metric(point)
        metric[-1] *= PARAMETER_WEIGHT
        row = metric * found.along
        step = found.point - point
        step -= found.along * float(row @ step) / float(row @ found.along)
        length = metric_length(metric, step)
        point = point + step * min(1.0, longest / length if length else 1.0)
        if not abs(point[-1] - coordinate) < PARAMETER_SHIFT:
            return None
        if length < NEARBY:
            return point, row
    return None


def _thinned(vector: Real, shape: tuple[int, ...]) -> Real:
    """A point, or a row, with the usual number of segments in a period."""
    every = shape[1] // SEGMENTS_PER_PERIOD
    return np.append(vector[:-1].reshape(shape)[:, ::every].ravel(), vector[-1])


def _refined(problem: ShootingProblem, start: Real, omega: float, observe: str) -> Orbit | None:
    """Orbit that Newton's method finds from a state at phase zero, if it finds one soon."""
    try:
        return refine(problem, spread(problem, start, omega), omega, observe, GUESS_ITERATIONS)
    except FAILURES:
        return None


@shows_progress()
def find_orbits(
    system: System | FlowMap,
    frequency_hz: float,
    period: int,
    *,
    observe: str | None = None,
    options: OrbitSearchOptions | None = None,
    progress: Progress | None = None,
) -> list[Orbit]:
    """Orbits of period multiple n at one frequency, started from time simulations.

    The system is simulated from several initial states. Attractors of period n are found because
    the states repeat; unstable orbits because chaotic motion passes near them and nearly repeats.
    Every near return is refined by multiple shooting. Not finding an orbit proves nothing.

    Parameters
    ----------
    system : System or FlowMap
        What to search.
    frequency_hz : float
        Excitation frequency in Hz.
    period : int
        Period multiple n; orbits whose true period is shorter are left out.
    observe : str, optional
        Interface whose displacement is reported.
    options : OrbitSearchOptions, optional
        Effort.
    progress : callable, optional
        Called as ``progress(what, frequency_hz, done)``.

    Returns
    -------
    list of Orbit
        Different orbits (not shifts of each other), in the order found.

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    ConvergenceError
        If every simulation fails.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, find_orbits
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> orbits = find_orbits(system, frequency_hz=50.0, period=2)
    >>> any(orbit.stable for orbit in orbits)
    True
    """
    flow = flow_of(system)
    check_frequency("frequency_hz", frequency_hz)
    check_bounded(flow, 2.0 * math.pi * frequency_hz)
    check_types(progress=(progress, Callable, None))
    options = options or OrbitSearchOptions()
    whole = Shares(progress or silent, {"motions": 1.0, "orbits": 1.0})
    strobe = simulate_strobe(flow, frequency_hz, options, whole.part("motions"))
    if not strobe.runs:
        raise ConvergenceError(
            f"every simulation at {frequency_hz:g} Hz failed: {strobe.failures[0]}"
        )
    name, tell = check_observe(flow.system, observe), whole.part("orbits")
    return orbits_from_strobe(flow, strobe, period, name, options, tell)


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
    nearest_here = (distance <= before) & (distance <= after)
    returns = np.flatnonzero(nearest_here & (distance < RETURNS * scale))
    chosen: list[int] = []
    for index in returns[np.argsort(distance[returns], kind="stable")]:
        if len(chosen) == count:
            break
        apart = [np.linalg.norm(states[index] - states[c]) for c in chosen]
        if all(a > APART * scale for a in apart):
            chosen.append(int(index))
    return chosen


def settling_periods(system: System, frequency_hz: float) -> int:
    """Excitation periods after which the slowest linear motion has decayed to e^-4, at least 30.

    A motion without damping does not settle; 600 periods show where it goes.

    Examples
    --------
    >>> from nldyn import System
    >>> system = System.from_modal([10.0], {"tip": [1.0]}, modal_damping=0.01)
    >>> settling_periods(system, 10.0)
    64
    """
    slowest = system.linear.slowest_decay
    if slowest <= 0.0:
        return UNDAMPED
    return max(math.ceil(DECAYS * frequency_hz / slowest), FEWEST)
