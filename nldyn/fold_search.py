"""Folds of a system that lead to further ones when its damping or excitation changes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

from nldyn.branch import SpecialPoint
from nldyn.continuation import ContinuationOptions
from nldyn.curve_walk import CLOSED_CURVE, CurvePoint, CurveWalk, on_chart_plane
from nldyn.curves import special_start
from nldyn.errors import SystemModelError
from nldyn.orbit import Orbit
from nldyn.parameter_values import EVERY_MODE, FREQUENCY, Chart, checked_parameter, value_of
from nldyn.parameters import Parameter
from nldyn.system import System

MOST_POINTS = 400  # of a curve in one direction
MOST_DAMPING = 0.5  # ratio up to which modes stay oscillators


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
        if value_of(system, 1.0, parameter) > 0.0:
            return parameter
    return None


def connected_folds(
    fold: SpecialPoint,
    parameter: Parameter,
    factor: float,
    range_hz: tuple[float, float],
    options: ContinuationOptions,
) -> Iterator[Orbit]:
    """Orbits of the same system to which the curve of folds through one comes back.

    It is followed in frequency and a parameter, which is divided and multiplied by up to a factor.

    Raises
    ------
    ConvergenceError, SystemModelError
        If the curve does not begin.
    """
    orbit = fold.orbit
    value = value_of(orbit.system, orbit.frequency_hz, parameter)
    most = factor * value
    if parameter.name == "modal_damping":
        most = max(min(most, MOST_DAMPING), 1.001 * value)
    limits = value / factor, most
    charts = Chart.of(Parameter(FREQUENCY), range_hz), Chart.of(parameter, limits)
    options = replace(options, max_points=min(options.max_points, MOST_POINTS))
    start = special_start(fold, charts)
    for end in (start, start.reversed()):
        walk = CurveWalk(end, options)
        for a, b in pairwise(walk):
            if a is not end and _passes(a, b, value):
                there = on_chart_plane(a, b, 1, value)
                if there is not None:
                    yield replace(there.orbit, problem=orbit.problem)
        if walk.stop_reason == CLOSED_CURVE:
            return


def _passes(a: CurvePoint, b: CurvePoint, value: float) -> bool:
    return float(a.values[1] - value) * float(b.values[1] - value) <= 0.0
