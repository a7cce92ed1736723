"""Sharp and flat resonances, orbits that nearly coincide, folds close together, cusps."""

from __future__ import annotations

import math
from functools import cache, partial

import numpy as np
from bench.exact import Series

from hard.case import Case, Measured
from hard.multiprecision import (
    DIGITS,
    JACOBIAN,
    ORIGIN,
    PROMISE,
    STATE,
    exact_end,
    mp,
    orbit_flow_error,
)
from hard.stiffness import beam_with_stop
from nldyn.base.arrays import Real
from nldyn.bifurcations.normal_forms import normal_form, switch_at_branch_point
from nldyn.bifurcations.point import SpecialPoint
from nldyn.branches.branch import Branch
from nldyn.branches.continuation import continue_branch
from nldyn.branches.step_control import ContinuationOptions
from nldyn.curves.curves import continue_special
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.solve import solve_orbit
from nldyn.orbits.starts import find_orbits
from nldyn.system.loads import HarmonicForce, Unbalance
from nldyn.system.stop import Stop
from nldyn.system.system import System

SUBJECT = "resonances, folds and cusps"
LOCATED = 1e-8
LOCATED_FROM = "relative, location of special points (docs/explanation/theory.md)"
MANY = ContinuationOptions(max_points=20000)


def linear(ratio: float) -> System:
    """A mass on a spring, 10 Hz, out of reach of its stop."""
    return System.from_modal(
        [10.0],
        {"m": [1.0]},
        modal_damping=ratio,
        stops=[Stop("m", 1e9, gap=1e9)],
        excitation=[HarmonicForce("m", 1.0)],
    )


def peak_error(ratio: float) -> Measured:
    """Height at the resonance Ω √(1 - 2ζ²), F / (2ζΩ² √(1 - ζ²)), solved for there."""
    own = 2.0 * math.pi * 10.0
    hz = 10.0 * math.sqrt(1.0 - 2.0 * ratio**2)
    exact = 1.0 / (2.0 * ratio * own**2 * math.sqrt(1.0 - ratio**2))
    orbit = solve_orbit(linear(ratio), hz)
    return Measured(abs(orbit.max_abs_displacement / exact - 1.0), f"{exact:.3g} m")


def passage_error(ratio: float) -> Measured:
    """Heights of a branch through the resonance against |F/(Ω² - ω² + 2iζΩω)| at each point."""
    own = 2.0 * math.pi * 10.0
    branch = continue_branch(solve_orbit(linear(ratio), 9.9), (9.9, 10.1))
    off, top = 0.0, 0.0
    for orbit in branch.points:
        w = orbit.omega
        exact = 1.0 / math.hypot((own - w) * (own + w), 2.0 * ratio * own * w)
        off = max(off, abs(orbit.max_abs_displacement / exact - 1.0))
        top = max(top, orbit.max_abs_displacement)
    reached = top * 2.0 * ratio * own**2
    note = f"{len(branch.points)} points, highest {reached:.6f} of the peak"
    return Measured(off, note)


@cache
def beam_branch() -> Branch:
    """The harmonic branch of the 1-DOF model of the paper."""
    return continue_branch(solve_orbit(beam_with_stop(5.17e9), 26.0), (5.7, 90.0))


def beam_damped(ratio: float) -> System:
    """The 1-DOF model of the paper at another damping ratio."""
    beam = beam_with_stop(5.17e9)
    return System.from_modal(
        beam.frequencies_hz,
        beam.participation,
        modal_damping=ratio,
        stops=beam.stops,
        excitation=beam.excitation,
    )


def flat_contact_error(ratio: float) -> Measured:
    """Flow at the top of the resonance against the stop, which is nearly level."""
    branch = continue_branch(solve_orbit(beam_damped(ratio), 20.0), (5.7, 90.0))
    height = np.array([orbit.max_abs_displacement for orbit in branch.points])
    hz = np.array([orbit.frequency_hz for orbit in branch.points])
    level = hz[height > 0.99 * height.max()]
    found = orbit_flow_error(branch.points[int(height.argmax())])
    note = f"{found.note}; within 1 % of the top from {level.min():.1f} to {level.max():.1f} Hz"
    return Measured(found.error, note)


def sharp_contact_error() -> Measured:
    """Flow at the highest point of the resonance against the stop at Q = 1e6."""
    system = beam_damped(5e-7)
    branch = continue_branch(solve_orbit(beam_with_stop(5.17e9), 28.0), (20.0, 28.0))
    damped = max(branch.points, key=lambda orbit: orbit.frequency_hz)
    start = solve_orbit(system, 28.0, guess=damped.states(np.array([0.0]))[0])
    branch = continue_branch(start, (20.0, 28.0), options=MANY)
    top = max(branch.points, key=lambda orbit: orbit.max_abs_displacement)
    found = orbit_flow_error(top)
    note = f"{found.note}; top {top.max_abs_displacement:.3g} m at {top.frequency_hz:.6f} Hz"
    return Measured(found.error, note)


def fold_error(fold: SpecialPoint) -> Measured:
    """Relative error of a fold's frequency, by a Newton step in multiple precision.

    Along the left null vector y of Φ - 1 the equations Φ(z, ω) = z cannot be met by z, so that
    y·(end - z) + y·(dΦ/dω) Δω = 0. How far the orbit is from the fold itself, ξ, counts with its
    square: the multiplier is 1 + 2aξ with the coefficient a of the normal form.
    """
    orbit, form = fold.orbit, normal_form(fold)
    assert form.coefficient is not None and form.frequency_shift is not None
    mp.dps = DIGITS.digits
    omega = mp.exp(mp.mpf(float(orbit.point[-1])))
    z: Series = [mp.mpf(float(x)) for x in orbit.states(np.array([0.0]))[0]]
    product, slope, state = mp.eye(len(z)), mp.zeros(len(z), 1), z
    for _ in range(orbit.period):
        end = exact_end(orbit.system, state, omega)
        matrix = mp.matrix(end.monodromy)
        product, slope, state = matrix * product, matrix * slope + mp.matrix(end.d_omega), end.state
    values, left = mp.eig(product, left=True, right=False)
    index = min(range(len(values)), key=lambda i: abs(values[i] - 1))
    y = left[index, :]
    shift = (y * (mp.matrix(state) - mp.matrix(z)))[0] / (y * slope)[0] / omega
    beyond = abs(complex(values[index] - 1))
    along = abs(form.frequency_shift.value) * (0.5 * beyond / form.coefficient.value) ** 2
    note = f"{orbit.frequency_hz:.9f} Hz, multiplier off by {beyond:.0e}"
    return Measured(abs(complex(shift)) + along, note)


def worst(found: list[Measured]) -> Measured:
    """The largest error, with all notes."""
    return Measured(max(one.error for one in found), "; ".join(one.note for one in found))


def top_of_third_error() -> Measured:
    """The folds at the top of the 1/3 peak."""
    orbit = find_orbits(beam_with_stop(5.17e9), 76.0, 3)[0]
    branch = continue_branch(orbit, (74.0, 78.0))
    return worst([fold_error(s) for s in branch.special_points if s.kind == "LP"])


def harmonic_folds_error() -> Measured:
    """The six folds of the harmonic branch."""
    return worst([fold_error(s) for s in beam_branch().special_points if s.kind == "LP"])


def pair_rate_error() -> Measured:
    """Two orbits that are about to meet in a fold: their distance goes with the root."""
    folds = [s for s in beam_branch().special_points if s.kind == "LP"]
    fold = max(folds, key=lambda s: s.frequency_hz)
    form = normal_form(fold)
    distances = []
    for share in (1e-10, 1e-12):
        hz = fold.frequency_hz * (1.0 + form.side * share)
        branch = continue_branch(fold_side(fold), (0.99 * hz, 1.01 * hz), at=[hz])
        near = [p.orbit for p in branch.requested if differs_little(p.orbit, fold.orbit)]
        if len(near) != 2:
            return Measured(math.inf, f"{len(near)} orbits at {hz:.12f} Hz")
        distances.append(distance(*near))
    rate = math.log10(distances[0] / distances[1]) / 2.0
    note = "relative distances " + ", ".join(f"{d:.2e}" for d in distances) + f", rate {rate:.5f}"
    return Measured(abs(rate - 0.5), note)


def uncoupled(**sizes: float) -> System:
    """Masses that do not know of each other; "y" has a stop on either side, "x" on one."""
    stops = [Stop.linear(at, 3000.0, gap=0.01 * size) for at, size in sizes.items()]
    if "y" in sizes:
        stops.append(Stop.linear("y", 3000.0, gap=0.01 * sizes["y"], direction=-1))
    return System.from_modal(
        [5.0 / math.pi] * len(sizes),
        dict(zip(sizes, np.eye(len(sizes)), strict=True)),
        modal_damping=0.02,
        stops=stops,
        excitation=[HarmonicForce(at, size) for at, size in sizes.items()],
    )


def close_branches_error(scale: float) -> Measured:
    """Motion of a small mass beside a large one, followed on one half of a broken symmetry.

    The other half and the symmetric orbit are `scale` away; a jump there would change the small
    motion by its own size.
    """
    symmetric = continue_branch(solve_orbit(uncoupled(y=1.0), 1.0), (0.5, 1.0))
    breaking = [s for s in symmetric.special_points if s.kind == "BP"][-1]
    alone = continue_branch(switch_at_branch_point(breaking)[0].orbit, (0.5, 1.0))
    small, large = alone.at(0.6)[0], solve_orbit(uncoupled(x=1.0), 0.6)
    start = np.column_stack([at_phase_zero(large), scale * at_phase_zero(small)]).ravel()
    followed = continue_branch(
        solve_orbit(uncoupled(x=1.0, y=scale), 0.6, guess=start), (0.55, 0.66)
    )
    off = 0.0
    for orbit in followed.points:
        found = at_phase_zero(orbit)[1::2] / scale
        exact = [
            at_phase_zero(o)
            for o in alone.at(orbit.frequency_hz)
            if leaning(o) * leaning(small) > 0.0
        ]
        if len(exact) != 1:
            return Measured(math.inf, f"{len(exact)} halves at {orbit.frequency_hz:.6g} Hz")
        off = max(off, float(np.linalg.norm(found - exact[0]) / np.linalg.norm(exact[0])))
    return Measured(off, f"{len(followed.points)} points")


def at_phase_zero(orbit: Orbit) -> Real:
    """Modal displacements, then velocities."""
    return np.asarray(orbit.states(np.array([0.0]))[0])


def leaning(orbit: Orbit) -> float:
    """Displacement plus that of half a period later: zero for the symmetric orbits."""
    return float(orbit.states(np.array([0.0, math.pi]))[:, 0].sum())


def fold_side(fold: SpecialPoint) -> Orbit:
    """An orbit of the harmonic branch beside a fold."""
    points = [o for o in beam_branch().points if abs(o.frequency_hz / fold.frequency_hz - 1) < 5e-3]
    return min(points, key=lambda orbit: abs(distance(orbit, fold.orbit) - 0.05))


def distance(a: Orbit, b: Orbit) -> float:
    """Distance of two orbits' states relative to their size."""
    return float(np.linalg.norm(a.point[:-1] - b.point[:-1]) / np.linalg.norm(a.point[:-1]))


def differs_little(a: Orbit, b: Orbit) -> bool:
    """Whether two orbits are within a thousandth of each other."""
    return distance(a, b) < 1e-3


def resonance_with_gap(gap: float) -> System:
    """One mode and a stop at a small distance, as in docs/how-to/curves.md."""
    return System.from_modal(
        [13.1],
        {"middle": [0.635]},
        modal_damping=0.0142,
        stops=[Stop("middle", stiffness=5.17e9, gap=gap)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )


def folds_at(gap: float) -> list[float]:
    """Frequencies in Hz of the folds of the resonance at a gap."""
    branch = continue_branch(solve_orbit(resonance_with_gap(gap), 20.0), (20.0, 40.0))
    return sorted(s.frequency_hz for s in branch.special_points if s.kind == "LP")


@cache
def cusp() -> tuple[float, float]:
    """Frequency in Hz and gap in m of the cusp in which the folds vanish."""
    branch = continue_branch(solve_orbit(resonance_with_gap(2e-6), 15.0), (10.0, 40.0))
    fold = next(s for s in branch.special_points if s.kind == "LP")
    curve = continue_special(fold, ("frequency_hz", "gap"), ((5.0, 60.0), (1e-6, 1e-5)))
    mark = next(mark for mark in curve.marks if mark.kind == "CP")
    return float(mark.values[0]), float(mark.values[1])


def cusp_error() -> Measured:
    """Gap of the cusp against where the distance of the folds, to the power 2/3, vanishes."""
    hz, gap = cusp()
    gaps = [gap * (1.0 + share) for share in (1e-3, 2e-3)]
    apart = [np.ptp(folds_at(g)) ** (2.0 / 3.0) for g in gaps]
    found = gaps[0] - apart[0] * (gaps[1] - gaps[0]) / (apart[1] - apart[0])
    return Measured(abs(found / gap - 1.0), f"{hz:.6f} Hz, {1e6 * gap:.6f} um")


def close_folds_error(share: float) -> Measured:
    """Rate with which two folds approach each other near their cusp."""
    gap = cusp()[1]
    near, far = folds_at(gap * (1.0 + share)), folds_at(gap * (1.0 + 10.0 * share))
    if len(near) != 2:
        return Measured(math.inf, f"{len(near)} folds found")
    rate = math.log10(float(np.ptp(far) / np.ptp(near)))
    return Measured(abs(rate - 1.5), f"folds {np.ptp(near):.2e} Hz apart, rate {rate:.4f}")


CASES = (
    *(
        Case(
            SUBJECT,
            f"peak of a linear resonance, Q = {0.5 / ratio:.4g}",
            hard,
            "closed form of the linear response",
            STATE,
            PROMISE,
            partial(peak_error, ratio),
        )
        for ratio, hard in (
            (5e-7, "a width of 1e-6"),
            (0.05, "an ordinary peak"),
            (0.707, "a peak that is flat to 1e-7"),
        )
    ),
    Case(
        SUBJECT,
        "branch through a linear resonance, Q = 1e6",
        "the amplitude grows by 1e4 within 1e-6 of the frequency",
        "closed form of the linear response",
        STATE,
        PROMISE,
        partial(passage_error, 5e-7),
    ),
    Case(
        SUBJECT,
        "resonance against the stop, Q = 1",
        "a top so flat that its frequency is hardly there",
        ORIGIN,
        JACOBIAN,
        PROMISE,
        partial(flat_contact_error, 0.5),
    ),
    Case(
        SUBJECT,
        "resonance against the stop, Q = 1e6",
        "the branch ends in a needle",
        ORIGIN,
        JACOBIAN,
        PROMISE,
        sharp_contact_error,
        quick=False,
    ),
    Case(
        SUBJECT,
        "folds of the harmonic branch, 1-DOF model",
        "the equations are singular",
        ORIGIN + ", Newton step",
        LOCATED,
        LOCATED_FROM,
        harmonic_folds_error,
    ),
    Case(
        SUBJECT,
        "folds at the top of the 1/3 peak, 1-DOF model",
        "two folds 0.06 Hz apart at the top of a peak",
        ORIGIN + ", Newton step",
        LOCATED,
        LOCATED_FROM,
        top_of_third_error,
    ),
    Case(
        SUBJECT,
        "two orbits of a branch 2e-5 apart",
        "Newton's method may take one for the other",
        "theory: at a fold the distance goes with the root of the frequency's",
        0.01,
        "two digits of the rate",
        pair_rate_error,
    ),
    Case(
        SUBJECT,
        "three branches within 1e-6 of each other",
        "a step of the continuation is longer than what lies between them",
        "the small one of two uncoupled masses, alone and in its own size",
        1e-5,
        "accuracy of an orbit, 1e-11, over 1e-6",
        partial(close_branches_error, 1e-6),
    ),
    Case(
        SUBJECT,
        "gap at which two folds vanish in a cusp",
        "the derivatives of the equations are singular twice",
        "theory: semicubical parabola through four folds of branches",
        4e-6,
        "square of the distance 2e-3 over which it is extrapolated",
        cusp_error,
    ),
    *(
        Case(
            SUBJECT,
            f"folds {title} apart",
            "two changes of sign within a step",
            "theory: near a cusp the distance goes with the power 3/2",
            0.02,
            "two digits of the rate",
            partial(close_folds_error, share),
        )
        for title, share in (("1e-5 Hz", 1e-3), ("3e-7 Hz", 1e-4))
    ),
)
