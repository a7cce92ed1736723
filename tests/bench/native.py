"""The flow map of this package as one of the engines, and its derivatives in physical states."""

from __future__ import annotations

import math

import numpy as np

from bench.models import Case, Sensitivities
from nldyn.base.arrays import Real
from nldyn.flow.flow_map import FlowMap, Segments

PERIOD = np.array([0.0, 2.0 * math.pi])


def physical(flow: FlowMap, segments: Segments) -> Sensitivities:
    """Results over one period in physical states."""
    if segments.failure:
        raise RuntimeError(segments.failure)
    linear = flow.system.linear
    return Sensitivities(
        flow.to_modal(segments.ends[0]),
        linear.right @ segments.jacobians[0] @ linear.left,
        flow.to_modal(segments.d_omega[0]),
    )


def sensitivities(flow: FlowMap, start: Real, omega: float) -> Sensitivities:
    """Where a physical state goes in one period, by the flow map."""
    return physical(flow, flow.shoot(flow.to_state(start)[None], PERIOD, omega))


def closings(flow: FlowMap, case: Case) -> int:
    """How often the stop closes within the period of a case."""
    segments = flow.shoot(flow.to_state(case.start)[None], PERIOD, case.omega)
    return int(segments.closings.sum())
