"""Liouville's formula: the determinant of the monodromy matrix is exp(-∫ tr D dt)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from problems import THREE_MODES_AT, THREE_MODES_HZ, THREE_MODES_STATES, make_one_dof, three_modes

from nldyn import FlowMap, FlowOptions, HarmonicForce, Stop, System, solve_orbit


@given(
    THREE_MODES_STATES,
    st.sampled_from([1.0, 1.5, 2.0]),
    st.floats(-2e-6, 2e-6),
    st.sampled_from([None, 1.0]),
    st.floats(0.0, 6.0),
    st.floats(0.5, 7.0),
)
def test_volume_shrinks_as_liouville_says(state, exponent, gap, second, phase, turn):
    """det of the Jacobian = exp(-tr D Δt) through any contacts: the stops take no part in it."""
    stops = [Stop("middle", stiffness=5e9 * 4e-6 ** (1.5 - exponent), exponent=exponent, gap=gap)]
    if second:
        stops.append(Stop("end", stiffness=3e9, gap=1e-6, direction=-1))
    system = three_modes(stops=stops)
    flow = FlowMap(system, FlowOptions(tail=1e-6))
    omega = 2 * np.pi * 25.0
    phases = np.array([phase, phase + turn])
    start = flow.to_state(state)
    found = flow.shoot(start[None], phases, omega)
    assert found.failure == ""
    modal = sum(2 * 0.01 * 2 * np.pi * f for f in THREE_MODES_HZ)
    damper = 6.0 * sum(p * p for p in THREE_MODES_AT["end"])
    sign, logarithm = np.linalg.slogdet(found.jacobians[0])
    assert sign > 0
    assert logarithm == pytest.approx(-(modal + damper) * turn / omega, abs=1e-7)


@pytest.mark.parametrize("frequency", [8.0, 26.0, 45.0, 70.0])
def test_liouville_error_of_an_orbit_is_small(one_dof, frequency):
    orbit = solve_orbit(one_dof, frequency)
    trace = 2 * 0.0142 * math.sqrt(16877.0 / 2.48)
    determinant = float(np.linalg.det(orbit.monodromy))
    assert determinant == pytest.approx(math.exp(-trace / frequency), rel=1e-8)
    assert orbit.liouville_error < 1e-8


def test_liouvilles_formula_is_judged_where_rounding_hides_the_products_determinant():
    system = System.from_matrices(
        np.diag([2.0, 1.0]),
        [[2e4, -6e3], [-6e3, 1.2e4]],
        {"a": [1.0, 0.0]},
        damping=[[4000.0, -500.0], [-500.0, 3000.0]],
        stops=[Stop.linear("a", 1e6)],
        excitation=[HarmonicForce("a", 10.0)],
    )
    orbit = solve_orbit(system, 5.0)
    assert orbit.impacts == 1 and orbit.error < 1e-10
    assert np.finfo(float).eps * np.linalg.cond(orbit.monodromy) > 1.0
    assert orbit.liouville_error < 1e-8


@pytest.mark.parametrize("frequency_hz", [26.0, 12.0, 60.0])
def test_liouvilles_formula_counts_the_damping_of_the_contact(frequency_hz):
    system = make_one_dof(stops=[Stop("middle", 5.17e9, dissipation=4.0)])
    orbit = solve_orbit(system, frequency_hz)
    assert orbit.impacts > 0
    assert orbit.liouville_error < 1e-8
    lossless = math.exp(-np.trace(system.total_damping) * orbit.duration)
    assert np.linalg.det(orbit.monodromy) < (1 - 1e-4) * lossless


def test_a_stop_that_all_but_holds_has_no_error_of_liouvilles_formula_to_tell():
    """The weight on its dashpot, 17 N, damps at a F/m = 7e4/s: e^-3400 of an area in a period."""
    system = make_one_dof(stops=[Stop("middle", 5.17e9, gap=-1e-3, dissipation=1e4)])
    orbit = solve_orbit(system, 20.0)
    assert math.isnan(orbit.liouville_error)
    assert abs(orbit.multipliers[1]) < 1e-15 < abs(orbit.multipliers[0]) < 1.0
