"""Newton's method on the shooting equations at a fixed frequency."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from nldyn.base.arrays import Real
from nldyn.base.errors import ConvergenceError, SystemModelError, numbers
from nldyn.flow.flow_map import FlowMap, Trajectory
from nldyn.orbits.orbit import Orbit, minimal_period
from nldyn.orbits.self_excited import samples
from nldyn.orbits.shooting import ShootingProblem
from nldyn.system.system import NOT_HELD, System

# contact force over the excitation, and penetration over displacement, up to which a free body
# counts as untouched
TOUCH = 1e-7
TOO_DEEP = 1e-6  # depth behind a rigid stop, as a share of the motion there, that is no rounding
TOUCH_ONE = "give a guess that touches one"
NO_PLACE = (
    "the structure is free to move as a whole, and where the motion touches no stop, nothing tells "
    "its place"
)


def guessed_nodes(problem: ShootingProblem, guess: Real, omega: float) -> Real:
    """States (k, 2n) at the shooting phases from a guess, checked."""
    guess = np.atleast_2d(numbers("guess", guess))
    size = 2 * problem.flow.system.size
    if guess.shape not in ((1, size), (problem.segments, size)):
        raise SystemModelError(
            f"guess must have {size} entries (or {problem.segments} such rows), "
            f"got shape {guess.shape}"
        )
    if guess.shape[0] == problem.segments:
        return problem.flow.to_state(guess)
    return spread(problem, problem.flow.to_state(guess[0]), omega)


def first_orbit(
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


def check_bounded(flow: FlowMap, omega: float) -> None:
    """Refuse the resonance of an undamped mode where nothing else can limit the motion."""
    system = flow.system
    if not (system.stops or system.bonds or system.sliders):
        flow.response(omega).steady(omega)


def _touches_only(system: System, motion: Trajectory, omega: float) -> bool:
    """Whether contacts push, but by no more than rounding of the drive and of the motion."""
    depth, force = (float(each.max(initial=0.0)) for each in motion.contacts_at_nodes)
    drive = sum(
        abs(source.phasor) * (source.harmonic * omega) ** source.power
        for source in system.excitation
    )
    reach = np.abs(motion.record.start @ motion.flow.stop_rows.T).max(initial=0.0)
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
    drifts = problem.flow.system.free_modes > 0
    if drifts and _touches_only(problem.flow.system, found.motion, omega):
        raise ConvergenceError(f"{where}: {NO_PLACE}; {TOUCH_ONE}")
    if not found.converged:
        contact = np.any(found.motion.record.kind >= 0)
        fault = None if contact else problem.flow.system.response(omega).unbounded(omega)
        if fault is not None:
            raise ConvergenceError(
                f"{where}: {fault[0]}, and its motion grows without bound where it touches no stop"
            )
        if drifts and problem.flow.system.left_free:
            raise ConvergenceError(f"{where}: {NOT_HELD}")
        if not contact and drifts:
            raise ConvergenceError(f"{where}: {NO_PLACE}; {TOUCH_ONE}")
        step = f", last relative step {found.last_step:.1e}" if found.last_step < math.inf else ""
        raise ConvergenceError(
            f"{where}: {found.failure}{step} after {found.iterations} "
            f"iteration{'' if found.iterations == 1 else 's'}; another guess or find_orbits may "
            f"find one{', or continue_branch from calm motion' if problem.period == 1 else ''}"
        )
    if _behind_a_rigid_stop(found.motion):
        raise ConvergenceError(
            f"{where}: Newton's method came to a motion behind a rigid stop, which it never meets; "
            "give a guess in front of it"
        )
    return Orbit.of(problem, found, observe)


def _behind_a_rigid_stop(motion: Trajectory) -> bool:
    """Whether a motion is where none can be: what begins behind a rigid stop never meets it."""
    flow, states = motion.flow, samples(motion)
    for i, stop in flow.system.rigid_stops.items():
        outputs = flow.outputs_at(i, states)
        size = float(np.abs(outputs).max()) + stop.reach
        if outputs.max() - stop.gap > TOO_DEEP * size:
            return True
    return False


def spread(problem: ShootingProblem, start: Real, omega: float) -> Real:
    """States at all shooting phases by integrating from the first."""
    if problem.segments == 1:
        return start[None]
    ends = problem.flow.shoot(
        start[None], problem.phases[:-1], omega, sensitivities=False, chained=True
    ).ends
    return np.vstack([start[None], ends])
