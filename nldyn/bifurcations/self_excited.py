"""What branches of self-excited motions meet: corners where sticking begins or ends, and rest.

Where it ends the slip of a slider has a minimum that touches zero (grazing-sliding), and the branch
may turn. Sticking forgets: on that side multipliers are zero that are not on the other. A limit
cycle shrinks to rest at a Hopf point.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from nldyn.base.arrays import TINY, Real
from nldyn.base.errors import FAILURES
from nldyn.bifurcations.branch_crossing import distance
from nldyn.bifurcations.chord import Chord
from nldyn.bifurcations.kinds import GRAZING_SLIDING
from nldyn.bifurcations.point import BranchNode, node_of
from nldyn.orbits.bordered import Corrected, correct
from nldyn.orbits.conditions import Turning
from nldyn.orbits.orbit import Orbit
from nldyn.orbits.self_excited import SAMPLES, samples
from nldyn.orbits.shooting import metric_length

HOPF = "Hopf"
SMALL = 1e-3  # swing beside that a step before, at which a limit cycle counts as rest
LOST = 10.0  # times the error of the multiplier along it, which is that of so small a motion
BEHIND = (1e-4, 1e-3)  # distances from the corner at which an orbit behind it is looked for
FARTHEST = 10.0  # times these: how far Newton's method may lead
MOST_SECANTS = 50
MET = 1e-9  # slip beside the fastest one, at which it touches zero
OF_PARAMETER = 10.0  # error of a parameter there over that, relative


def sticking(orbit: Orbit) -> tuple[bool, ...]:
    """Which sliders stick for a while."""
    return tuple(each.stuck > 0.0 for each in orbit.friction)


def past_corner(here: BranchNode) -> list[BranchNode]:
    """The corner ahead and a point behind it, where sticking begins or ends; else none.

    The branch goes on ahead, or it turns to motions that are a little smaller or larger.
    """
    before = sticking(here.orbit)
    for away in BEHIND:
        for guess, across in _guesses(here, away):
            row = across / np.linalg.norm(across)
            found = correct(here.family, guess, here.condition, row, float(row @ guess))
            if not found.converged or sticking(found.orbit) == before:
                continue
            if metric_length(here.weights, found.point - here.point) > FARTHEST * away:
                continue
            there = node_of(found, found.point - here.point, here.arclength)
            corner = _corner(here, there)
            if corner is not None:
                return _in_order(here, corner, there)
    return []


def _guesses(here: BranchNode, away: float) -> list[tuple[Real, Real]]:
    """Points to begin from, and normals of the planes through them to stay on.

    They lie ahead, or have states a little nearer to the middle of the motion, or farther.
    """
    ahead = here.point + away * here.tangent
    found = [(ahead, here.weights * here.tangent)]
    middle = samples(here.orbit.trajectory).mean(axis=0)
    if here.at.change is not None:
        middle = here.at.change[1] @ middle
    n = here.family.n_states
    outwards = np.zeros(here.point.size)
    outwards[:n] = here.point[:n] - np.tile(middle, here.family.segments)
    outwards /= metric_length(here.weights, outwards)
    across = here.weights * outwards
    return [*found, *((here.point + way * away * outwards, across) for way in (-1.0, 1.0))]


def _corner(here: BranchNode, there: BranchNode) -> BranchNode | None:
    """The orbit at the corner, found from the side on which a slider does not stick."""
    a, b = sticking(here.orbit), sticking(there.orbit)
    which = next(i for i, (before, after) in enumerate(zip(a, b, strict=True)) if before != after)
    base = there if a[which] else here
    towards = (here if a[which] else there).point - base.point
    ahead = base.tangent * np.sign(towards @ (base.weights * base.tangent))
    across = base.weights * ahead
    row = across / np.linalg.norm(across)

    def solved(way: float) -> Corrected:
        guess = base.point + way * ahead
        return correct(base.family, guess, base.condition, row, float(row @ guess))

    way, last = 0.0, slowest_slip(base.orbit, which)
    step = 0.1 * distance(here, there)
    for _ in range(MOST_SECANTS):
        found = solved(way + step)
        if not found.converged or sticking(found.orbit)[which]:
            step *= 0.5  # beyond the corner, where there may be no orbit
            continue
        slip = slowest_slip(found.orbit, which)
        way += step
        if slip < MET:
            return node_of(found, ahead, 0.0, GRAZING_SLIDING)
        if not slip < last:
            return None
        step, last = slip * step / (last - slip), slip
    return None


def slowest_slip(orbit: Orbit, which: int) -> float:
    """Smallest speed of a slider beside its largest one, on what it slides on."""
    motion = orbit.trajectory
    phases = np.linspace(*motion.span, SAMPLES)
    slips = _slips(orbit, which, samples(motion))
    slips = np.where(np.isnan(slips), np.nanmax(slips), slips)
    place = int(np.argmin(slips))
    around = phases[max(place - 1, 0)], phases[min(place + 1, SAMPLES - 1)]

    def slip(phase: float) -> float:
        now = float(_slips(orbit, which, motion.states(np.array([phase])))[0])
        return float(slips.max()) if np.isnan(now) else now

    found = minimize_scalar(slip, bounds=around, method="bounded", options={"xatol": 1e-9})
    return float(found.fun) / float(slips.max())


def _slips(orbit: Orbit, which: int, states: Real) -> Real:
    """Speeds (k,) of sliding at states z (k, 2n); nan where a round clearance is open."""
    flow, system = orbit.trajectory.flow, orbit.system
    slider = system.rubbing[which]
    if which < len(system.sliders):
        return np.asarray(np.linalg.norm(flow.slips(which, states), axis=1))
    at = system.round_polar(system.round_stops[slider.stop], flow.to_modal(states))
    return np.where(at.depth > 0.0, np.abs(at.sliding), np.nan)


def _in_order(here: BranchNode, corner: BranchNode, there: BranchNode) -> list[BranchNode]:
    """The corner and the point behind it, with their arclengths."""
    first = here.arclength + distance(here, corner)
    last = first + distance(corner, there)
    away = there.point - corner.point
    sense = 1.0 if float(away @ (there.weights * there.tangent)) > 0.0 else -1.0
    return [
        replace(corner, arclength=first),
        replace(there, arclength=last, tangent=sense * there.tangent),
    ]


def swing(orbit: Orbit) -> float:
    """Displacement at the start of a self-excited motion, where it turns, from its mean.

    It changes its sign where a branch of limit cycles passes rest.
    """
    motion, system = orbit.trajectory, orbit.system
    row = motion.flow.rows[system.output(orbit.observe)]
    start = orbit.problem.nodes(orbit.point)[0]
    return float((start - samples(motion).mean(axis=0)) @ row)


def at_rest_between(a: BranchNode, b: BranchNode) -> BranchNode | None:
    """The smallest limit cycle found between two points, if the branch passes rest there.

    The parameter goes with the square of the swing, which goes with the arclength.
    """
    if not isinstance(a.condition, Turning):
        return None
    start, last = swing(a.orbit), swing(b.orbit)
    if not start * last < 0.0:
        return None
    # rest itself has no frequency
    aim = 0.5 * SMALL * start
    first, last = start - aim, last - aim
    chord, low, high, end = Chord(a, b), 0.0, 1.0, a
    for _ in range(MOST_SECANTS):
        share = low + (high - low) * first / (first - last)
        try:
            end = chord.at(share)
        except FAILURES:
            break
        found = swing(end.orbit) - aim
        if abs(found) < 0.5 * abs(aim):
            break
        if found * last < 0.0:
            low, first = share, found
        else:
            high, last = share, found
    return replace(end, corner=HOPF)


def corner_error(a: BranchNode, corner: BranchNode) -> float:
    """Error of a corner, or of the smallest limit cycle in place of a Hopf point."""
    if corner.corner != HOPF:
        met = OF_PARAMETER * MET if corner.corner == GRAZING_SLIDING else 0.0
        return max(corner.orbit.error, met)
    place = corner.family.n_states
    squares = swing(a.orbit) ** 2, swing(corner.orbit) ** 2
    left = squares[1] / max(abs(squares[0] - squares[1]), TINY)
    lost = abs((corner.orbit.multiplier_along or 1.0) - 1.0)
    return left * abs(float(corner.point[place] - a.point[place])) + LOST * lost
