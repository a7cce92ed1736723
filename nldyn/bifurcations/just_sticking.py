"""Motions in which something just comes to rest, or loose, on friction that drops at once.

If it came a little slower it would stay for a while, if it were pulled a little more it would not
stay at all: motions on both sides are not alike, and a branch ends there or has a corner. If it
were pulled a little less it would not come loose at all, and a branch ends.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Legendre

from nldyn.base.arrays import Real
from nldyn.flow.sliding import held_in_pieces
from nldyn.orbits.orbit import Orbit
from nldyn.system.friction import Slider

SHORT = 1e-6  # of the motion: rest that counts as none
BESIDE = 1e-4  # of it: so long before and behind an instant the slip tells how fast it changes
# of the fastest change: that of a slip that turns where it comes to rest. Differences over BESIDE
# leave 16 of it at the end of a branch over a belt's speed, and 134 at a speed lower by 5e-4
SLOW = 100.0 * BESIDE
TOUCH = 1e-6  # of the fastest slip: a slowest one that counts as none
NONE = 1e-12  # the same as it sticks
SAMPLES = 4000
# relative: the friction at rest and the force by which it turns at once. Differences over BESIDE
# leave 2.2 and 2.7 of it at both ends of a branch of a driven block, and 258 within it
ALIKE = 20.0 * BESIDE


def just_sticks(orbit: Orbit) -> Slider | None:
    """A slider that all but begins or ceases to stick, where its friction drops at once."""
    phases = np.linspace(*orbit.trajectory.span, SAMPLES)
    for number, slider in enumerate(orbit.system.sliders):
        law = slider.friction
        if law.adhesion == 0.0 or law.fading_speed is not None:
            continue
        slips = _slips(orbit, number, phases)
        fastest = np.abs(np.diff(slips)).max() / (phases[1] - phases[0])
        if _touches_rest(slips) or _turns_or_stays(orbit, number, fastest):
            return slider
    return None


def just_slips(orbit: Orbit) -> Slider | None:
    """A slider that is only just pulled loose, where its friction drops at once.

    The pull has all but its peak there: the instant, and with it a multiplier, goes with the root
    of what is left, so that it tends to infinity.
    """
    for number, slider in enumerate(orbit.system.sliders):
        law = slider.friction
        if law.adhesion == 0.0 or law.fading_speed is not None:
            continue
        slopes, fastest = _last_slopes(orbit, number)
        if np.abs(slopes).min(initial=np.inf) < SLOW * fastest:
            return slider
    return None


def _last_slopes(orbit: Orbit, number: int) -> tuple[Real, float]:
    """Rates at which friction at rest lets go, and the fastest of what it has left meanwhile."""
    motion, slider = orbit.trajectory, orbit.system.sliders[number]
    record, tables = motion.record, motion.flow.tables
    row, law = len(orbit.system.stops) + number, slider.friction
    held = held_in_pieces(motion, number)
    loose = held & ~np.roll(held, -1) & (record.event == row)
    slopes, fastest = [], 0.0
    for piece in np.flatnonzero(held):
        at = tables.chi[record.kind[piece]]
        pressing = np.full(at.size, slider.normal_force)
        if slider.stop >= 0:
            pressing = motion.contacts_at_nodes[1][piece, slider.stop]
        force = record.force[piece, row]
        left = (law.coefficient + law.adhesion) * pressing - np.sign(force[-1]) * force
        rate = Legendre.fit(at, left, at.size - 1, domain=[0.0, 1.0]).deriv()
        scale = record.duration[piece]
        fastest = max(fastest, float(np.abs(rate(at)).max()) / scale)
        if loose[piece]:
            slopes.append(float(rate(1.0)) / scale)
    return np.array(slopes), fastest


def _touches_rest(slips: Real) -> bool:
    """Whether a slip becomes zero, or all but that, without a change of its sense."""
    size = np.abs(slips)
    slides = size > NONE * size.max()
    turns = (size[1:-1] < np.minimum(size[:-2], size[2:])) & (slips[:-2] * slips[2:] > 0.0)
    turns &= slides[:-2] & slides[2:]
    return bool(size[1:-1][turns].min(initial=np.inf) < TOUCH * size.max())


def _turns_or_stays(orbit: Orbit, number: int, fastest: float) -> bool:
    """Whether it all but does not rest, or not come to rest, or turns by its friction at rest."""
    motion, law = orbit.trajectory, orbit.system.sliders[number].friction
    record, held = motion.record, held_in_pieces(motion, number)
    length = motion.span[1] - motion.span[0]
    alone = held & ~np.roll(held, 1) & ~np.roll(held, -1)
    if motion.omega * record.duration[alone].min(initial=np.inf) < SHORT * length:
        return True
    comes = np.roll(record.event == len(orbit.system.stops) + number, 1) & ~np.roll(held, 1)
    stops, turns = record.phase[comes & held], record.phase[comes & ~held]
    if _pace(orbit, number, stops, -BESIDE).min(initial=np.inf) < SLOW * fastest:
        return True
    before, behind = (_pace(orbit, number, turns, side * BESIDE) for side in (-1, 1))
    most = (law.coefficient + law.adhesion) * (before - behind)  # the same of friction at rest
    return bool((np.abs(law.coefficient * (before + behind) - most) < ALIKE * most).any())


def _pace(orbit: Orbit, number: int, phases: Real, share: float) -> Real:
    """Change of a slip from zero at phases, by that a share of the motion away."""
    away = share * (orbit.trajectory.span[1] - orbit.trajectory.span[0])
    return np.abs(_slips(orbit, number, phases + away)) / abs(away)


def _slips(orbit: Orbit, number: int, phases: Real) -> Real:
    """Speeds of a slider on what it slides on, at ascending phases."""
    motion = orbit.trajectory
    begin, end = motion.span
    within = (phases - begin) % (end - begin) + begin
    order = np.argsort(within, kind="stable")
    found = np.empty(len(phases))
    found[order] = motion.flow.slips(number, motion.states(within[order]))[:, 0]
    return found
