"""Long branches at low damping, walked in both directions."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from functools import cache, partial

import numpy as np
from paper.jobs import scene_system

from hard.case import Case, Measured
from nldyn.bifurcations.point import SpecialPoint
from nldyn.branches.branch import Branch
from nldyn.branches.continuation import continue_branch
from nldyn.branches.step_control import ContinuationOptions
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.solve import solve_orbit
from nldyn.system.system import System

SUBJECT = "continuation at low damping"
RANGE = (18.0, 90.0)
BUDGET = 150.0  # s of processor time for one walk, beyond which it is cut
USUAL = ContinuationOptions(max_points=50000)
FINE = ContinuationOptions(max_points=50000, max_step=0.01, max_angle=0.1)


class OutOfTimeError(RuntimeError):
    """A walk has used up its budget."""


def beam(ratio: float) -> System:
    """The 4-DOF model with a modal damping; the damper at the middle stays."""
    scene = scene_system("four_dof_xi_0.001")
    damping = np.diag(2.0 * ratio * scene.natural_frequencies)
    return System(
        scene.natural_frequencies,
        damping,
        scene.participation,
        scene.stops,
        scene.dampers,
        scene.excitation,
    )


def walked(orbit: Orbit, options: ContinuationOptions) -> Branch:
    """The branch through the whole range; OutOfTimeError says how far it came."""
    start = time.process_time()

    def watch(hz: float) -> None:
        if time.process_time() - start > BUDGET:
            raise OutOfTimeError(f"cut at {hz:.3f} Hz after {BUDGET:.0f} s")

    return continue_branch(orbit, RANGE, options=options, progress=watch)


@cache
def downwards(ratio: float, options: ContinuationOptions) -> Branch:
    """The harmonic branch from the upper end on."""
    return walked(solve_orbit(beam(ratio), RANGE[1]), options)


@cache
def upwards(ratio: float, options: ContinuationOptions) -> Branch:
    """The branch from the other end of the one above on."""
    ends = (downwards(ratio, options).points[0], downwards(ratio, options).points[-1])
    return walked(min(ends, key=lambda orbit: orbit.frequency_hz), options)


def directions_error(ratio: float, options: ContinuationOptions) -> Measured:
    """Largest relative difference of a special point between the two directions."""
    down, up = downwards(ratio, options), upwards(ratio, options)
    pairs, lost, extra = matched(down.special_points, up.special_points)
    off = max((abs(a.frequency_hz / b.frequency_hz - 1.0) for a, b in pairs), default=math.inf)
    note = (
        f"{len(down.points)} and {len(up.points)} points; {len(pairs)} special points in both, "
        f"which agree to {off:.1e}"
    )
    for title, missed in (("upwards", lost), ("downwards", extra)):
        if missed:
            where = ", ".join(f"{s.kind} {s.frequency_hz:.3f}" for s in missed)
            note += f"; {len(missed)} not found {title}: {where} Hz"
    notes = [*down.notes, *up.notes]
    if notes:
        note += "; " + "; ".join(notes)
    return Measured(math.inf if lost or extra else off, note)


Pairs = list[tuple[SpecialPoint, SpecialPoint]]


def matched(
    some: Sequence[SpecialPoint], others: Sequence[SpecialPoint]
) -> tuple[Pairs, list[SpecialPoint], list[SpecialPoint]]:
    """Special points of the same kind at one frequency and amplitude, and those left of either."""
    left = list(others)
    pairs, lost = [], []
    for point in some:
        near = [other for other in left if alike(point, other)]
        if near:
            best = min(near, key=lambda other: abs(other.frequency_hz - point.frequency_hz))
            left.remove(best)
            pairs.append((point, best))
        else:
            lost.append(point)
    return pairs, lost, left


def alike(a: SpecialPoint, b: SpecialPoint) -> bool:
    """Whether two special points may be the same."""
    heights = a.orbit.max_abs_displacement, b.orbit.max_abs_displacement
    return (
        a.kind == b.kind
        and abs(a.frequency_hz / b.frequency_hz - 1.0) < 1e-6
        and abs(heights[0] / heights[1] - 1.0) < 1e-3
    )


CASES = tuple(
    Case(
        SUBJECT,
        f"4-DOF model, damping ratio {ratio:g}, from 90 Hz down and from 18 Hz up{how}",
        "needles of resonances, hundreds of special points, pairs of them within a step",
        "the walk in the other direction",
        1e-8,
        "asked for: the same special points to 1e-8",
        partial(directions_error, ratio, options),
        quick=False,
    )
    for ratio in (1e-3, 1e-4)
    for options, how in ((USUAL, ""), (FINE, ", steps of a fifth"))
)
