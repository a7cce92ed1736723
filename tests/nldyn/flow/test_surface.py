"""Motions that begin on the surface of a stop."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from nldyn import ConstantForce, FlowMap, HarmonicForce, Stop, System

K = np.array([[2.0, -1.0], [-1.0, 2.0]])


@pytest.mark.parametrize("omega", [0.93, 1.03, 1.71])
def test_a_slow_start_at_a_stop_leaves_no_contact_of_another_one_out(omega):
    """b begins at its stop and presses on it as t⁴ only; a closes meanwhile."""
    system = System.from_matrices(
        np.eye(2), K, {"a": [1.0, 0.0], "b": [0.0, 1.0]},
        stops=[Stop("a", 500.0, 1.0, gap=0.1), Stop("b", 50.0, 1.0)],
        excitation=[HarmonicForce("a", 1.0), ConstantForce("a", 0.6)],
    )  # fmt: skip

    def rate(t, y):
        force = [np.cos(omega * t) + 0.6 - 500.0 * max(y[0] - 0.1, 0.0), -50.0 * max(y[1], 0.0)]
        return np.concatenate([y[2:], force - K @ y[:2]])

    end = solve_ivp(
        rate, (0.0, 2.0 * np.pi / omega), np.zeros(4), method="DOP853", rtol=1e-12, atol=1e-14,
        max_step=2e-3,
    ).y[:, -1]  # fmt: skip
    flow = FlowMap(system)
    found = flow.shoot(np.zeros((1, 4)), np.array([0.0, 2.0 * np.pi]), omega)
    assert not found.failure
    q = flow.to_modal(found.ends)[0]
    rows = np.array([system.participation[name] for name in "ab"])
    assert np.concatenate([rows @ q[:2], rows @ q[2:]]) == pytest.approx(end, abs=1e-9)
