"""Motions in which something just comes to rest on friction that drops at once.

If it came a little slower it would stay for a while, if it were pulled a little more it would not
stay at all: motions on both sides are not alike, and a branch ends there or has a corner.
"""

from __future__ import annotations

import numpy as np

from nldyn.base.arrays import Real
from nldyn.flow.sliding import held_in_pieces
from nldyn.orbits.orbit import Orbit
from nldyn.system.friction import Slider

SHORT = 1e-6  # of the motion: rest that counts as none
BESIDE = 1e-4  # of it: so long before and behind an instant the slip tells how fast it changes
SLOW = 0.01  # of the fastest change: that of a slip that turns where it comes to rest
TOUCH = 1e-6  # of the fastest slip: a slowest one that counts as none
NONE = 1e-12  # the same as it sticks
ALIKE = 2e-3  # relative: the friction at rest and the force by which it turns at once


def just_sticks(orbit: Orbit) -> Slider | None:
    """A slider that all but begins or ceases to stick, where its friction drops at once."""
    for number, slider in enumerate(orbit.system.sliders):
        law = slider.friction
        drops = law.adhesion > 0.0 and law.fading_speed is None
        if drops and (_touches_rest(orbit, number) or _turns_or_stays(orbit, number)):
            return slider
    return None


def _touches_rest(orbit: Orbit, number: int) -> bool:
    """Whether its slip becomes zero, or all but that, without a change of its sense."""
    slips = _slips(orbit, number, np.linspace(*orbit.trajectory.span, 4000))
    slips[np.abs(slips) < NONE * np.abs(slips).max()] = 0.0
    size = np.abs(slips)
    turns = (size[1:-1] < np.minimum(size[:-2], size[2:])) & (slips[:-2] * slips[2:] > 0.0)
    return bool(size[1:-1][turns].min(initial=np.inf) < TOUCH * size.max())


def _turns_or_stays(orbit: Orbit, number: int) -> bool:
    """Whether it all but does not rest, or not come to rest, or turns by its friction at rest."""
    motion, law = orbit.trajectory, orbit.system.sliders[number].friction
    record, held = motion.record, held_in_pieces(motion, number)
    length = motion.span[1] - motion.span[0]
    alone = held & ~np.roll(held, 1) & ~np.roll(held, -1)
    comes = np.roll(record.event == len(orbit.system.stops) + number, 1) & ~np.roll(held, 1)
    pace = {side: _pace(orbit, number, record.phase, side * BESIDE * length) for side in (-1, 1)}
    before, behind = pace[-1][comes & ~held], pace[1][comes & ~held]
    force = law.coefficient * (before + behind) / (before - behind)  # over what presses it on
    stops = pace[-1][comes & held]
    return bool(
        motion.omega * record.duration[alone].min(initial=np.inf) < SHORT * length
        or stops.min(initial=np.inf) < SLOW * pace[-1].max()
        or (np.abs(force / (law.coefficient + law.adhesion) - 1.0) < ALIKE).any()
    )


def _pace(orbit: Orbit, number: int, phases: Real, away: float) -> Real:
    """Change of a slip from zero at phases, by that so far away."""
    return np.abs(_slips(orbit, number, phases + away)) / abs(away)


def _slips(orbit: Orbit, number: int, phases: Real) -> Real:
    """Speeds of a slider on what it slides on, at ascending phases."""
    motion, base = orbit.trajectory, orbit.system.sliders[number].friction.base_speed
    begin, end = motion.span
    within = (phases - begin) % (end - begin) + begin
    order = np.argsort(within, kind="stable")
    row = motion.flow.rate_rows[len(orbit.system.stops) + number]
    found = np.empty(len(phases))
    found[order] = motion.states(within[order]) @ row - base
    return found
