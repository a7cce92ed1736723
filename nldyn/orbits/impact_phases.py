"""Where impacts with rigid stops lie between the phases of shooting."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.flow.rigid import rigid_impacts
from nldyn.orbits.orbit import Orbit
from nldyn.system.rigid_stop import RigidStop

STARTS = 32  # first phases of shooting among which the one farthest from all impacts is chosen


def _impact_phases(orbit: Orbit) -> Real:
    """Phases of all impacts with rigid stops."""
    stops = [i for i, stop in enumerate(orbit.system.stops) if isinstance(stop, RigidStop)]
    phases = [rigid_impacts(orbit.trajectory, stop).phase for stop in stops]
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
    """Number of impacts with rigid stops in each segment of shooting, (k,)."""
    problem = orbit.problem
    segment = np.searchsorted(problem.phases, _impact_phases(orbit), side="right") - 1
    return np.bincount(np.clip(segment, 0, None), minlength=problem.segments)


def start_far_from_impacts(orbit: Orbit) -> float:
    """A first phase of shooting that keeps all of them far from impacts."""
    phases, length = _impact_phases(orbit), 2.0 * math.pi * orbit.period / orbit.problem.segments
    starts = length * np.arange(1, STARTS) / STARTS
    return float(max(starts, key=lambda start: abs(_to_nodes(phases, start, orbit))))
