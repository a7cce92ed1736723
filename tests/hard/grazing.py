"""Contacts that hardly begin."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from bench.measure import median_seconds

from hard.case import Case, Measured
from hard.multiprecision import JACOBIAN, ORIGIN, PROMISE, flow_error, orbit_flow_error
from hard.stiffness import beam_with_stop
from nldyn.branches.branch import Branch
from nldyn.branches.continuation import continue_branch
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.solve import solve_orbit
from nldyn.system.loads import HarmonicForce
from nldyn.system.stop import Stop
from nldyn.system.system import System

SUBJECT = "grazing"
SPEEDS = (1.0, 1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 0.0)
GAP, HZ = 1e-3, 10.0
RANGE = (12.0, 60.0)
LOCATED = 1e-8  # of grazing points, docs/explanation/theory.md


def touching(stiffness: float = 1e9) -> System:
    """A mass of 1 kg at 20 Hz that swings about a millimetre, as far as its stop."""
    return System.from_modal(
        [20.0],
        {"m": [1.0]},
        modal_damping=0.01,
        stops=[Stop("m", stiffness, gap=GAP)],
        excitation=[HarmonicForce("m", 1.0)],
    )


def speed_error(speed: float) -> Measured:
    """One period from the stop itself at a speed into it, while the spring pulls back.

    The start is at the gap and the speed is a number of the start, so that both are exact.
    """
    return flow_error(FlowMap(touching()), np.array([GAP, speed]), 2.0 * math.pi * HZ)


def slowest_over_deepest() -> Measured:
    """Time of the slowest touch over that of the deepest of one motion."""
    flow, phases = FlowMap(touching()), np.array([0.0, 2.0 * np.pi])
    starts = [flow.to_state(np.array([GAP, speed]))[None] for speed in SPEEDS[1:]]
    times = [
        median_seconds(partial(flow.shoot, start, phases, 2.0 * math.pi * HZ), 21)[0]
        for start in starts
    ]
    note = ", ".join(f"{1e6 * time:.0f}" for time in times)
    return Measured(max(times[1:]) / times[0], f"microseconds from 0.01 m/s to 0: {note}")


def branch_to_the_stop() -> Branch:
    """The resonance of a mass that reaches its stop on either side of the peak."""
    system = System.from_modal(
        [20.0],
        {"m": [1.0]},
        modal_damping=0.05,
        stops=[Stop("m", 1e9, gap=GAP)],
        excitation=[HarmonicForce("m", 5.0)],
    )
    return continue_branch(solve_orbit(system, 12.0), RANGE)


def touching_frequencies() -> tuple[float, float]:
    """Frequencies in Hz at which the linear amplitude 5/|Ω² - ω² + 2iζΩω| is the gap.

    (Ω² - ω²)² + (2ζΩω)² = (5/gap)² is quadratic in ω².
    """
    own, ratio, level = 2.0 * math.pi * 20.0, 0.05, 5.0 / GAP
    half = own**2 * (1.0 - 2.0 * ratio**2)
    root = math.sqrt(half**2 - own**4 + level**2)
    low, high = (math.sqrt(half + sign * root) / (2.0 * math.pi) for sign in (-1.0, 1.0))
    return low, high


def grazing_frequency_error() -> Measured:
    """Grazing points of a continued branch against the linear amplitude."""
    found = [s.frequency_hz for s in branch_to_the_stop().special_points if s.kind == "GR"]
    exact = touching_frequencies()
    first = min(abs(hz / exact[0] - 1.0) for hz in found)
    last = min(abs(hz / exact[1] - 1.0) for hz in found)
    note = f"{len(found)} grazing points: " + ", ".join(f"{hz:.9f} Hz" for hz in found)
    return Measured(max(first, last), note)


def grazing_multiplier_error() -> Measured:
    """Multipliers at the grazing points against those of the linear system, exp(-ζΩT ± iφ)."""
    own, ratio = 2.0 * math.pi * 20.0, 0.05
    rate = own * complex(-ratio, math.sqrt(1.0 - ratio**2))
    worst = 0.0
    for exact in touching_frequencies():
        points = [s for s in branch_to_the_stop().special_points if s.kind == "GR"]
        orbit = min((p.orbit for p in points), key=lambda o: abs(o.frequency_hz - exact))
        linear = np.exp(rate / orbit.frequency_hz)
        pair = np.array([linear, linear.conjugate()])
        worst = max(worst, *(float(np.abs(pair - mu).min()) for mu in orbit.multipliers))
    return Measured(worst)


def accuracy_around() -> Measured:
    """Largest flow error of the branch's points next to its grazing points."""
    branch = branch_to_the_stop()
    places = touching_frequencies()
    near = [
        min(branch.points, key=lambda orbit: abs(orbit.frequency_hz - hz * (1.0 + side)))
        for hz in places
        for side in (-1e-3, 1e-3)
    ]
    found = [orbit_flow_error(orbit) for orbit in near]
    return max(found, key=lambda measured: measured.error)


def step_loss() -> Measured:
    """Points of the branch per those of the same branch with the stop out of reach."""
    with_stop = branch_to_the_stop()
    grazings = touching_frequencies()
    system = with_stop.points[0].system
    counts = []
    for hz in grazings:
        near = [o for o in with_stop.points if abs(o.frequency_hz / hz - 1.0) < 0.01]
        counts.append(len(near))
    free = System(
        system.natural_frequencies,
        system.damping,
        system.participation,
        (Stop("m", 1e9, gap=1.0),),
        (),
        system.excitation,
    )
    plain = continue_branch(solve_orbit(free, 12.0), RANGE)
    most = 0.0
    for hz, count in zip(grazings, counts, strict=True):
        usual = [o for o in plain.points if abs(o.frequency_hz / hz - 1.0) < 0.01]
        most = max(most, count / max(len(usual), 1))
    return Measured(most, f"points within 1 % of the grazing points: {counts}")


def jump_rate_error() -> Measured:
    """How far the change of the multipliers over grazing is from the first power of the distance.

    The orbits on either side are those of the same branch: Newton's method starts at the grazing
    orbit.
    """
    branch = continue_branch(solve_orbit(beam_with_stop(5.17e9), 26.0), (5.7, 90.0))
    special = [s for s in branch.special_points if s.kind == "GR"]
    worst, notes = 0.0, []
    for point in special:
        near, far = (change_over(point.orbit, shift) for shift in (1e-8, 1e-7))
        rate = math.log10(far / near)
        worst = max(worst, abs(rate - 1.0))
        notes.append(f"{near:.0e} over 2e-8 at {point.frequency_hz:.4f} Hz, rate {rate:.3f}")
    others = [s.frequency_hz for s in branch.special_points if s.kind != "GR"]
    nearest = min(abs(hz / p.frequency_hz - 1.0) for hz in others for p in special)
    notes.append(f"the nearest bifurcation is {nearest:.0e} of the frequency away")
    return Measured(worst, "; ".join(notes))


def change_over(orbit: Orbit, shift: float) -> float:
    """Largest change of a multiplier from one side of an orbit's frequency to the other."""
    low, high = beside(orbit, -shift), beside(orbit, shift)
    return float(np.abs(low.multipliers - high.multipliers).max())


def beside(orbit: Orbit, shift: float) -> Orbit:
    """The orbit at a frequency that is relatively a little higher."""
    problem = orbit.problem
    guess = problem.flow.to_modal(problem.nodes(orbit.point))
    hz = orbit.frequency_hz * (1.0 + shift)
    return solve_orbit(problem.flow, hz, orbit.period, guess=guess, segments=problem.segments)


CASES = (
    *(
        Case(
            SUBJECT,
            f"touch at {speed:g} m/s",
            "the force starts and ends within an instant"
            if speed > 1e-6
            else "the contact is shorter or less deep than rounding shows",
            ORIGIN,
            JACOBIAN,
            PROMISE,
            partial(speed_error, speed),
        )
        for speed in SPEEDS
    ),
    Case(
        SUBJECT,
        "time of a touch, slowest over deepest",
        "step sizes collapse where contacts are short",
        "the deepest touch of the same motion",
        2.0,
        "as `make bench` asks: no touch takes twice the time of the deepest",
        slowest_over_deepest,
        quick=False,  # a busy machine must not fail the tests
    ),
    Case(
        SUBJECT,
        "continuation through two grazing points",
        "the depth of contact goes with the square of what is left to it",
        "closed form: the linear amplitude is the gap",
        LOCATED,
        "docs/explanation/theory.md, location of special points",
        grazing_frequency_error,
    ),
    Case(
        SUBJECT,
        "multipliers at these points",
        "the Jacobian of a rigid stop is singular there",
        "closed form: those of the linear system",
        JACOBIAN,
        PROMISE,
        grazing_multiplier_error,
    ),
    Case(
        SUBJECT,
        "accuracy within 1e-3 of these points",
        "contacts of any depth",
        ORIGIN,
        JACOBIAN,
        PROMISE,
        accuracy_around,
    ),
    Case(
        SUBJECT,
        "points of the branch beside them, over those without the stop",
        "step sizes collapse where contacts begin",
        "the same branch with the stop out of reach",
        12.5,
        "no loss of step size beyond its options: max_step over grazing_step",
        step_loss,
    ),
    Case(
        SUBJECT,
        "change of multipliers over grazing, 1-DOF model",
        "the paper: no bifurcation sits on it",
        "theory: for Hertz's law it goes with the first power of the distance "
        "(docs/explanation/theory.md)",
        0.01,
        "two digits of the rate",
        jump_rate_error,
    ),
)
