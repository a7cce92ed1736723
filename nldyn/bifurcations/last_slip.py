"""Where a slider ceases to slide: motions in which it slides less and less, up to none.

Behind that it sticks all the time, anywhere within its friction: those are no branch. While what
is left is a short slip at the peak of the force, the way goes with a power of how far the
parameter is from the limit: with friction alone its square, for the excess goes with its distance
and the time with the root of that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from nldyn.base.arrays import Real
from nldyn.bifurcations.point import BranchNode
from nldyn.bifurcations.sliding import sticks, words
from nldyn.flow.flow_map import Trajectory
from nldyn.flow.sliding import held_in_pieces
from nldyn.orbits.orbit import Orbit
from nldyn.system.friction import Slider

LEAST = 1e-6  # of the longest way of the walk: one that counts as the last, and
LITTLE = 1e-3  # where a walk cannot go on
STICKS = 0.5  # least share of the time in which it does
SPREAD = 2.0  # factor between the ways by which the limit is found
JUST = 1e-5  # of friction: a difference of the largest force from it that is none
FARTHEST = 10.0  # times the way of the parameter between these


def last_slip(path: Sequence[BranchNode], least: float = LEAST) -> tuple[Slider, float] | None:
    """The slider that ceases to slide ahead of the last point of a walk, and the parameter there.

    None if none slides so little, beside the most on the walk. One with a spring goes on.
    """
    orbit = path[-1].orbit
    for number, slider in enumerate(orbit.system.sliders):
        if slider.tangential_stiffness is not None or _stuck(orbit.trajectory, number) < STICKS:
            continue
        ways = np.array([node.orbit.friction[number].distance for node in path])
        if ways[-1] > least * ways.max():
            continue
        limit = _limit(ways, np.array([node.value for node in path]))
        if limit is not None:
            return slider, limit
    return None


def first_slip(orbit: Orbit) -> Slider | None:
    """The slider that sticks behind its spring all the time, and just needs all its friction.

    Where it is tells the first place of many in which it would slide.
    """
    for number, slider in enumerate(orbit.system.sliders):
        if slider.tangential_stiffness is None or slider.stop >= 0:
            continue
        found, most = orbit.friction[number], slider.friction.coefficient * slider.normal_force
        if sticks(words(orbit)[number]) == -1 and abs(found.peak_force - most) < JUST * most:
            return slider
    return None


def _stuck(motion: Trajectory, number: int) -> float:
    """Share of the time in which a slider sticks, at less cost than all its measures."""
    duration = motion.record.duration
    return float(duration[held_in_pieces(motion, number)].sum() / duration.sum())


def _limit(ways: Real, values: Real) -> float | None:
    """Where a power of the distance through the last of some ways and two before is zero."""
    last = len(ways) - 1
    places = [last]
    for _ in range(2):
        longer = np.flatnonzero(ways[: places[-1]] > SPREAD * ways[places[-1]])
        if not longer.size:
            return None
        places.append(int(longer[-1]))
    a, b, c = np.log(ways[places])
    x, y = values[places[:2]]
    if x == y:
        return None
    sense = np.sign(x - y)

    def off(beyond: float) -> float:
        """Difference of the powers between both pairs, with zero so far beyond the last point."""
        near, middle, far = np.log(np.abs(x - values[places]) + beyond)
        return float((b - a) * (far - middle) - (c - b) * (middle - near))

    nearest, farthest = (share * float(abs(x - y)) for share in (1e-6, FARTHEST))
    if not off(nearest) * off(farthest) < 0.0:
        return None
    return float(x + sense * brentq(off, nearest, farthest, xtol=1e-12 * farthest))
