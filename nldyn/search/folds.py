"""Folds of a system that lead to further ones when its damping or excitation changes."""

from __future__ import annotations

from dataclasses import replace

from nldyn.base.errors import SystemModelError
from nldyn.bifurcations.point import SpecialPoint
from nldyn.branches.endings import AT_RANGE_END, Ending
from nldyn.branches.options import ContinuationOptions
from nldyn.curves.curves import special_start
from nldyn.curves.walk import CurveWalk, passages
from nldyn.orbits.orbit import Orbit
from nldyn.system.chart import EVERY_MODE, FREQUENCY, Chart, checked_parameter, value_of
from nldyn.system.parameters import Parameter
from nldyn.system.system import System


def leading_parameter(system: System) -> Parameter | None:
    """What is changed: the damping ratio of all modes if they share one, or the excitation.

    Isolas shrink with damping, and their two folds meet; with less damping they join others. None
    where there is neither.
    """
    candidates = [Parameter("modal_damping", EVERY_MODE)]
    candidates += [Parameter(name) for name in ("mass_times_radius", "amplitude")]
    for parameter in candidates:
        try:
            checked_parameter(system, parameter)
        except SystemModelError:
            continue
        if 0.0 < value_of(system, 1.0, parameter) < _highest(parameter):
            return parameter
    return None


def _highest(parameter: Parameter) -> float:
    """Value up to which a system stays of its kind: modes with more damping do not oscillate."""
    return 1.0 if parameter.name == "modal_damping" else float("inf")


def connected_folds(
    fold: SpecialPoint,
    parameter: Parameter,
    factor: float,
    range_hz: tuple[float, float],
    options: ContinuationOptions,
) -> tuple[list[Orbit], list[str]]:
    """Orbits of the same system to which the curve of folds through one comes back.

    It is followed in frequency and a parameter, which is divided and multiplied by up to a factor.
    With why it was broken off, if it was.

    Raises
    ------
    ConvergenceError, SystemModelError
        If the curve does not begin.
    """
    orbit = fold.orbit
    value = value_of(orbit.system, orbit.frequency_hz, parameter)
    limits = value / factor, min(factor * value, _highest(parameter))
    charts = Chart.of(Parameter(FREQUENCY), range_hz), Chart.of(parameter, limits)
    start = special_start(fold, charts)
    found: list[Orbit] = []
    broken: list[str] = []
    for end in (start, start.reversed()):
        walk = CurveWalk(end, options)
        met = passages(walk, 1, value)
        found += [replace(point.orbit, problem=orbit.problem) for point in met]
        if walk.stop_reason.ending is Ending.CLOSED_CURVE:
            break
        if walk.stop_reason.ending not in AT_RANGE_END:
            broken.append(walk.stop_reason)
    return found, broken
