"""What the tolerance of the flow map means, against references of fifty digits."""

from __future__ import annotations

import numpy as np
import pytest

from nldyn import FlowMap, FlowOptions, Orbit
from nldyn.bench.models import load_case
from nldyn.shooting import ShootingProblem

CASES = ["one_dof", "two_dof", "four_dof", "sixteen_dof"]


def orbit_at(case, rtol: float) -> Orbit:
    """The reference's start as an orbit in one segment."""
    flow = FlowMap(case.system, FlowOptions(rtol=rtol))
    point = np.append(flow.to_state(case.start), np.log(case.omega))
    return Orbit(ShootingProblem(flow, 1, 1), point, np.eye(2 * case.size)[None], 0.0, "")


def true_errors(case, orbit: Orbit) -> tuple[float, float]:
    flow = orbit.problem.flow
    found = flow.shoot(orbit.problem.nodes(orbit.point), orbit.problem.phases, orbit.omega)
    basis = flow.system.linear
    state = flow.to_state(case.exact.state)
    monodromy = basis.left @ case.exact.monodromy @ basis.right
    return (
        float(np.linalg.norm(found.ends[0] - state) / np.linalg.norm(state)),
        float(np.linalg.norm(found.monodromy - monodromy) / np.linalg.norm(monodromy)),
    )


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-9, 1e-10, 1e-12])
@pytest.mark.parametrize("name", CASES)
def test_errors_are_within_the_tolerance(name, rtol):
    case = load_case(name)
    state, monodromy = true_errors(case, orbit_at(case, rtol))
    assert state < rtol
    assert monodromy < 10.0 * rtol


@pytest.mark.parametrize("name", CASES)
def test_the_tightest_setting_reaches_twelve_digits(name):
    case = load_case(name)
    assert max(true_errors(case, orbit_at(case, 1e-13))) < 1e-12


@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8, 1e-9, 1e-10])
@pytest.mark.parametrize("name", CASES)
def test_error_estimates_are_true_within_a_factor_of_ten(name, rtol):
    case = load_case(name)
    orbit = orbit_at(case, rtol)
    rounding = 1e-13
    for estimate, true in zip(
        (orbit.flow_error.state, orbit.flow_error.monodromy),
        true_errors(case, orbit),
        strict=True,
    ):
        assert 0.1 * true - rounding < estimate < 10.0 * true + rounding
