"""Where impacts with rigid stops lie between the phases of shooting."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.flow.rigid import series_to_rest
from nldyn.flow.rigid_impacts import rigid_impacts
from nldyn.orbits.orbit import Orbit

STARTS = 32  # first phases of shooting among which the one farthest from all impacts is chosen


def _impact_phases(orbit: Orbit) -> Real:
    """Phases of all impacts with rigid stops."""
    phases = [rigid_impacts(orbit.trajectory, stop).phase for stop in orbit.system.rigid_stops]
    return np.concatenate(phases) if phases else np.empty(0)


def _to_nodes(phases: Real, start: float, orbit: Orbit) -> float:
    """Least distance of phases from those of shooting that begins at one, positive behind it."""
    length = 2.0 * math.pi * orbit.period / orbit.problem.segments
    apart = (phases - start + 0.5 * length) % length - 0.5 * length
    return float(min(apart, key=abs, default=math.inf))


def impact_behind_node(orbit: Orbit) -> float:
    """Phase in rad of the impact with a rigid stop that is nearest to a phase of shooting, from it.

    Negative for one that lies before; infinite without impacts.
    """
    return _to_nodes(_impact_phases(orbit), 0.0, orbit)


def nodes_to_impacts(orbit: Orbit) -> float:
    """Least distance in rad of impacts with rigid stops from phases of shooting."""
    return abs(impact_behind_node(orbit))


def impacts_by_segment(orbit: Orbit) -> NDArray[np.intp]:
    """Number of impacts with rigid stops in each segment of shooting, (k,).

    Of a series that ends in rest, the last segment has infinitely many: only its first impact
    counts there. An impact rounded onto the last phase of shooting is one of the last segment.
    """
    problem, motion = orbit.problem, orbit.trajectory
    count = np.zeros(problem.segments, dtype=np.intp)
    for index in orbit.system.rigid_stops:
        hits = rigid_impacts(motion, index)
        segment = np.searchsorted(problem.phases, hits.phase, side="right") - 1
        segment = np.clip(segment, 0, problem.segments - 1)
        follows = series_to_rest(motion, index, hits).follows
        endless = follows & (segment == _last_of_series(segment, follows))
        count += np.bincount(segment[~endless], minlength=problem.segments)
    return count


def _last_of_series(segment: NDArray[np.intp], follows: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Segment of the last impact of the series to which each belongs, round a period."""
    last = segment.copy()
    for i in range(2 * segment.size - 2, -1, -1):
        here, following = i % segment.size, (i + 1) % segment.size
        if follows[following]:
            last[here] = last[following]
    return last


def start_far_from_impacts(orbit: Orbit) -> float:
    """A first phase of shooting that keeps all of them far from impacts."""
    phases, length = _impact_phases(orbit), 2.0 * math.pi * orbit.period / orbit.problem.segments
    starts = length * np.arange(1, STARTS) / STARTS
    return float(max(starts, key=lambda start: abs(_to_nodes(phases, start, orbit))))
