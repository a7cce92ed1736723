"""The flow map of this package as one of the engines, and its derivatives in physical states."""

from __future__ import annotations

import math

import numpy as np

from nldyn.bench.models import Case, Sensitivities
from nldyn.flow import FlowMap, Segments
from nldyn.system import Real

PERIOD = np.array([0.0, 2.0 * math.pi])


def packed_start(flow: FlowMap, start: Real, omega: float) -> Real:
    """A physical state at phase zero as the flow map wants it, shape (1, 2n)."""
    return flow.to_packed(start, 0.0, omega)[None]


def physical(flow: FlowMap, segments: Segments, omega: float) -> Sensitivities:
    """Results over one period, from packed to physical states.

    The start is held in physical states, whose packed ones move with the steady response.
    """
    if segments.failure:
        raise RuntimeError(segments.failure)
    linear = flow.system.linear
    to_packed = linear.pack(linear.left.T).T
    forced = flow.system.forced_response(omega)
    slope = linear.pack(forced.d_positive + forced.d_negative)
    jacobian = segments.jacobians[0]
    d_omega = segments.d_omega[0] - jacobian @ slope + slope
    return Sensitivities(
        flow.to_physical(segments.ends[0], 0.0, omega),
        np.linalg.solve(to_packed, jacobian @ to_packed),
        np.linalg.solve(to_packed, d_omega),
    )


def sensitivities(flow: FlowMap, start: Real, omega: float) -> Sensitivities:
    """Where a physical state goes in one period, by the flow map."""
    return physical(flow, flow.shoot(packed_start(flow, start, omega), PERIOD, omega), omega)


def closings(flow: FlowMap, case: Case) -> int:
    """How often the stop closes within the period of a case."""
    segments = flow.shoot(packed_start(flow, case.start, case.omega), PERIOD, case.omega)
    return int(segments.closings.sum())
