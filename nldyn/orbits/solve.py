"""One periodic orbit at a frequency, from a guess, a simulation from rest, or more damping."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    FAILURES,
    ConvergenceError,
    check_frequency,
    check_positive,
    check_types,
)
from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.orbits.homotopy import Homotopy
from nldyn.orbits.newton import check_bounded, first_orbit, guessed_nodes, spread
from nldyn.orbits.orbit import Orbit, check_observe
from nldyn.orbits.shooting import ShootingProblem, shooting_problem
from nldyn.orbits.starts import near_returns
from nldyn.orbits.time_limit import OutOfTimeError, TimeLimit
from nldyn.runtime.progress import Progress, shows_progress
from nldyn.system.equilibrium import at_rest, held_motion, rest
from nldyn.system.system import System

MORE_DAMPING = 7.0, 20.0, 55.0  # factors that may leave one orbit only
SECONDS = 5.0
PERIODS = 200  # of the simulation from rest
BUNCH = 4  # pieces simulated between two looks at the clock


@shows_progress()
def solve_orbit(
    system: System | FlowMap,
    frequency_hz: float,
    period: int = 1,
    *,
    guess: Real | None = None,
    observe: str | None = None,
    segments: int | None = None,
    seconds: float = SECONDS,
    progress: Progress | None = None,
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
    seconds : float
        Processor time in s, about, that the search without a guess may take.
    progress : callable, optional
        Called meanwhile as ``progress(what, frequency_hz, done)``, with the share of that time.

    Returns
    -------
    Orbit

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    ConvergenceError
        If nothing excites the system and nothing damps it, or only what moves beneath friction
        moves it; if the simulation fails, if Newton's method does not converge or comes to an orbit
        of a shorter period, or if the time is spent; the text says why.

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
    check_positive("seconds", seconds)
    check_types(progress=(progress, Callable, None))
    observe = check_observe(flow.system, observe)
    problem = shooting_problem(flow, period, segments)
    omega = 2.0 * math.pi * frequency_hz
    check_bounded(flow, omega)
    if flow.system.conservative and not flow.system.driven:
        raise ConvergenceError(
            "nothing excites the system and nothing damps it, so that its free motions are a "
            "family over the energy and none of them stands alone: give excitation or damping, or "
            "follow the family by backbone"
        )
    if flow.system.carried and not flow.system.driven:
        raise ConvergenceError(
            "nothing excites the system but what moves beneath its friction, so that no period is "
            "given: find its motion, with the frequency, by limit_cycle"
        )
    if guess is not None:
        return first_orbit(problem, [guessed_nodes(problem, guess, omega)], omega, observe)
    pieces = (segments or period) // period  # of one excitation period
    limit = TimeLimit(seconds, frequency_hz, progress)
    try:
        with limit.held():
            return _searched(problem, omega, observe, pieces, limit)
    except OutOfTimeError as error:
        raise ConvergenceError(
            f"no orbit of period {period} found at {frequency_hz:g} Hz within {seconds:g} s, spent "
            f"up to {error}; more `seconds` of solve_orbit, a guess or find_orbits may find one"
        ) from None


def _searched(
    problem: ShootingProblem, omega: float, observe: str, pieces: int, limit: TimeLimit
) -> Orbit:
    """The orbit that a motion from rest leads to, here or at more damping."""
    try:
        return first_orbit(problem, _simulated(problem, omega, pieces, limit), omega, observe)
    except ConvergenceError as failure:
        by_damping = problem.period == 1
        try:
            orbit = _by_more_damping(problem, omega, observe, pieces, limit) if by_damping else None
        except OutOfTimeError:
            raise ConvergenceError(
                f"{failure}; the time was spent on ways from more damping, and more `seconds` of "
                "solve_orbit may find one"
            ) from None
        if orbit is None:
            raise
        return orbit


def _simulated(
    problem: ShootingProblem, omega: float, pieces: int, limit: TimeLimit
) -> Iterator[Real]:
    """States at the shooting phases that a motion from rest comes near, the likeliest first.

    It is simulated in pieces of the excitation period.
    """
    flow, period = problem.flow, problem.period
    q = rest(flow.system)
    start = flow.to_state(at_rest(q))
    warm = np.linspace(0.0, 2.0 * PERIODS * np.pi, PERIODS * pieces + 1)
    ends = start[None]
    for first in range(0, warm.size - 1, BUNCH):
        limit.look(f"period {first // pieces} of {PERIODS} of the motion from rest")
        some = warm[first : first + BUNCH + 1]
        found = flow.shoot(ends[-1:], some, omega, sensitivities=False, chained=True)
        if found.failure:
            raise ConvergenceError(
                f"the simulation from rest at {limit.frequency_hz:g} Hz failed: {found.failure}; "
                "give a guess"
            )
        ends = np.concatenate([ends, found.ends])
    strobe = ends[pieces::pieces][20:]
    # beside a subharmonic attractor lies, in its middle, the orbit that it branched from
    counts = (2, 3, 4, len(strobe)) if period == 1 else ()
    middles = [strobe[-count:].mean(axis=0) for count in counts]
    near = strobe[near_returns(strobe, period, 8)]
    # at a sharp resonance the motion from rest takes too long to grow
    linear = [] if flow.system.grows(omega) else [flow.system.steady(omega)]
    starts = _spread(problem, (strobe[-1], *near, *middles, *linear), omega, limit)
    if not np.any(q) and not flow.system.bonds:
        return starts
    held = held_motion(flow.system, q, omega, problem.phases[:-1])
    return itertools.chain(starts, [flow.to_state(held)])


def _spread(
    problem: ShootingProblem, states: Iterable[Real], omega: float, limit: TimeLimit
) -> Iterator[Real]:
    """Each of some states at phase zero as states at all shooting phases, while there is time."""
    for state in states:
        limit.look("Newton's method")
        yield spread(problem, state, omega)


def _by_more_damping(
    problem: ShootingProblem, omega: float, observe: str, pieces: int, limit: TimeLimit
) -> Orbit | None:
    """Orbit at more damping, which a motion from rest comes near, carried back, or None."""
    if not np.any(problem.flow.system.total_damping):
        return None
    for factor in MORE_DAMPING:
        way = Homotopy(problem.flow, factor)
        try:
            more = replace(problem, flow=way.flow(1.0))
            orbit = first_orbit(more, _simulated(more, omega, pieces, limit), omega, observe)
        except FAILURES:
            continue
        found = way.carried(orbit, 1.0, 0.0, lambda: limit.look("a way back from more damping"))
        if found is not None:
            return found
    return None
