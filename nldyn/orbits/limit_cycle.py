"""Limit cycles: self-excited motions, whose frequency is found, not given."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError, SystemModelError, check_frequency, numbers
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.orbits.bordered import OrbitFamily
from nldyn.orbits.newton import spread
from nldyn.orbits.orbit import Orbit, check_observe
from nldyn.orbits.self_excited import samples
from nldyn.orbits.shooting import ShootingProblem, shooting_problem
from nldyn.system.chart import THE_FREQUENCY, Chart
from nldyn.system.equilibrium import at_rest, rest
from nldyn.system.system import System

TRANSIENT, RECORDED = 200, 20  # cycles of a simulation: those let pass, and those looked at
ITERATIONS = 25
MOST_TURNS = 30  # largest displacements in one cycle of a limit cycle
STILL = 1e-8  # way of a state, relative to it, that is rounding
SAME = 1e-6  # distance of two states, relative to the motion, that are one
COMES_BACK = 1e-2  # distance of a state from itself a cycle later, relative to the motion
WIDEST = 1e3  # of the frequencies of a family, on either side of the first one
NO_LONGER = 3.0  # times the shortest distance: a cycle that is run through once


def limit_cycle(
    system: System | FlowMap,
    start: Real | None = None,
    *,
    frequency_hz: float | None = None,
    observe: str | None = None,
    segments: int = 1,
) -> Orbit:
    """Find a self-excited motion: a periodic one of a system without excitation.

    A motion is simulated until it repeats itself nearly; then Newton's method finds states and
    frequency. The orbit begins where the observed displacement is largest.

    Parameters
    ----------
    system : System or FlowMap
        Without excitation, but for constant forces: a body on a belt, a rotor that rubs.
    start : (2n,) array, optional
        Modal displacements and velocities from which to simulate; without speed at the rest
        position unless given.
    frequency_hz : float, optional
        About the frequency in Hz, as a unit of time for the simulation: 200 cycles are let pass.
        The lowest natural one unless given.
    observe : str, optional
        Interface whose displacement is reported; the first unless given.
    segments : int
        Number of shooting segments.

    Returns
    -------
    Orbit
        Its frequency is that found. Of its multipliers the one along the motion is left out, see
        `Orbit.multiplier_along`.

    Raises
    ------
    SystemModelError
        For a system that is excited or that nothing damps, and for input that makes no sense.
    ConvergenceError
        If the motion comes to rest, does not repeat itself, or Newton's method fails.

    References
    ----------
    R. Seydel (2010), *Practical Bifurcation and Stability Analysis*, section 7.1: the period as an
    unknown, and the phase by where an output turns.

    Examples
    --------
    >>> import math
    >>> from nldyn import System
    >>> from nldyn.system import DryFriction, Friction
    >>> belt = Friction(0.2, at_rest=0.4, fading_speed=0.1, base_speed=0.1)
    >>> block = System.from_matrices([[1.0]], [[1.0]], {"block": [1.0]},
    ...     dampers=[DryFriction("block", 1.0, belt)])
    >>> cycle = limit_cycle(block)
    >>> cycle.frequency_hz < 1.0 / (2.0 * math.pi), cycle.stable, round(cycle.multiplier_along, 6)
    (True, True, 1.0)
    """
    flow = flow_of(system)
    _check_self_excited(flow.system)
    name = check_observe(flow.system, observe)
    if frequency_hz is not None:
        check_frequency("frequency_hz", frequency_hz)
    problem = shooting_problem(flow, 1, segments)
    state, omega = _repeated(flow, _start(flow, start), _unit_of_time(flow, frequency_hz), name)
    found = limit_cycle_near(problem, state, omega, name)
    cycles = _cycles_within(found)
    if cycles == 1:
        return found
    state = problem.nodes(found.point)[0]
    return limit_cycle_near(problem, state, cycles * found.omega, name)


def _cycles_within(orbit: Orbit) -> int:
    """How often a motion comes back to its start within a period that was found.

    One that settles slowly repeats itself better after several cycles than after one.
    """
    motion, (begin, end) = orbit.trajectory, orbit.trajectory.span
    size = float(np.ptp(samples(motion), axis=0).max())
    counts = np.arange(MOST_TURNS, 1, -1)
    away = motion.states(begin + (end - begin) / counts) - motion.states(np.array([begin]))
    back = counts[np.linalg.norm(away, axis=1) <= SAME * size]
    return int(back.max(initial=1))


def limit_cycle_near(problem: ShootingProblem, state: Real, omega: float, observe: str) -> Orbit:
    """The limit cycle near a state (2n,) at which the observed displacement turns."""
    guess = np.append(spread(problem, state, omega).ravel(), math.log(omega))
    row = np.zeros(guess.size)
    row[: state.size] = problem.flow.rate_rows[problem.flow.system.output(observe)]
    row /= np.linalg.norm(row)
    found = problem.correct(guess, row, offset=0.0, max_iterations=ITERATIONS)
    hz = omega / (2.0 * math.pi)
    if not found.converged:
        raise ConvergenceError(f"no limit cycle found near {hz:g} Hz: {found.failure}")
    orbit = Orbit.of(problem, found, observe)
    if not orbit.self_excited:
        raise ConvergenceError(
            f"no limit cycle found near {hz:g} Hz: Newton's method came to rest; another start may "
            "lead to one"
        )
    return orbit


def of_self_excited(orbit: Orbit, chart: Chart) -> OrbitFamily:
    """The family of a self-excited motion in a parameter, whose frequency goes along."""
    hz = orbit.frequency_hz
    found = Chart(THE_FREQUENCY, hz / WIDEST, hz * WIDEST)
    size = float(np.linalg.norm(samples(orbit.trajectory), axis=1).max())
    return replace(OrbitFamily.around(orbit, (chart, found)), least=size)


def _check_self_excited(system: System) -> None:
    if system.driven:
        raise SystemModelError(
            "a limit cycle is a motion without excitation: leave out all but constant forces, or "
            "find a forced motion by solve_orbit"
        )
    if system.conservative:
        raise SystemModelError(
            "nothing damps or feeds the system, so that its free motions are a family over the "
            "energy: follow it by backbone"
        )


def _start(flow: FlowMap, start: Real | None) -> Real:
    """State z (2n,) from which to simulate, checked."""
    if start is None:
        return flow.to_state(at_rest(rest(flow.system)))
    modal = numbers("start", start)
    if modal.ndim != 1:
        raise SystemModelError(f"start must be one state, got shape {modal.shape}")
    return flow.to_state(modal)


def _unit_of_time(flow: FlowMap, frequency_hz: float | None) -> float:
    """Frequency in rad/s in whose cycles the simulation counts."""
    if frequency_hz is not None:
        return 2.0 * math.pi * frequency_hz
    natural = flow.system.natural_frequencies
    if not natural.any():
        raise SystemModelError(
            "limit_cycle: no mode has a natural frequency: give frequency_hz, about that of the "
            "motion"
        )
    return float(natural[natural > 0.0].min())


def _repeated(flow: FlowMap, state: Real, omega: float, observe: str) -> tuple[Real, float]:
    """State at the highest maximum of the last cycle of a simulation, and the rate of cycles."""
    warm = flow.strobe(state, omega, TRANSIENT)
    if warm.failure:
        raise ConvergenceError(f"the simulation failed: {warm.failure}; give another start")
    phases = np.array([0.0, 2.0 * math.pi * RECORDED])
    motion = flow.trajectory(warm.ends[-1:], phases, omega)
    if motion.failure:
        raise ConvergenceError(f"the simulation failed: {motion.failure}; give another start")
    tops = motion.extremes(flow.system.output(observe))
    tops = tops[(tops[:, 2] > 0.0) & (tops[:, 0] > 0.0) & (tops[:, 0] < phases[-1])]
    inside, heights = tops[np.argsort(tops[:, 0]), :2].T
    states = motion.states(inside)
    size = float(np.ptp(states, axis=0).max(initial=0.0)) if len(states) else 0.0
    whole = motion.states(np.linspace(0.0, phases[-1], 200))
    size = max(size, float(np.ptp(whole, axis=0).max()))
    if len(states) < 2 or size <= STILL * float(np.linalg.norm(whole, axis=1).max()):
        raise ConvergenceError(
            f"the motion comes to rest, or no cycle ends within {TRANSIENT} of "
            f"{omega / (2.0 * math.pi):g} Hz: give another start, or frequency_hz"
        )
    away = np.linalg.norm(states[-2 : -2 - MOST_TURNS : -1] - states[-1], axis=1)
    if not away.min() <= COMES_BACK * size:
        raise ConvergenceError(
            f"the motion does not repeat itself within {TRANSIENT} cycles of "
            f"{omega / (2.0 * math.pi):g} Hz: it may come to rest slowly, or be chaotic; another "
            "start may lead to a limit cycle"
        )
    back = int(np.flatnonzero(away <= max(NO_LONGER * away.min(), SAME * size))[0]) + 2
    period = float(inside[-1] - inside[-back]) / omega
    highest = int(np.argmax(heights[1 - back :])) + 1 - back
    return states[highest], 2.0 * math.pi / period
