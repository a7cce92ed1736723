"""Flights: the linear motion between contacts, against the matrix exponential."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
import scipy.linalg as sla
from hypothesis import assume, example, given
from hypothesis import strategies as st
from independent import exact_flight, state_map

from nldyn import Damper, FlowMap, HarmonicForce, System, Unbalance
from nldyn.engine.library import function
from nldyn.engine.numbers import address_of
from nldyn.system.linear import _growth

RNG = np.random.default_rng(1)
SIZE_AND_ARRAYS = ctypes.c_int64, *[ctypes.c_void_p] * 3
SLOW_DECAY = 0.35  # exponent up to which the series is used
FACTOR = RNG.standard_normal((4, 4))
MASS = np.diag([1.0, 2.0, 0.5, 1.5]) + 0.1 * np.ones((4, 4))
STIFFNESS = 4e4 * (FACTOR @ FACTOR.T + 0.2 * np.eye(4))

SYSTEMS = {
    "non-proportional damper": {"dampers": [Damper("a", 30.0)], "modal_damping": 0.01},
    "overdamped mode": {"modal_damping": [0.02, 3.0, 0.02, 0.1]},
    "critically damped mode": {"modal_damping": [0.02, 1.0, 1.0 - 1e-9, 1.0 + 1e-12]},
    "undamped": {},
    "full damping matrix": {"damping": 5.0 * (FACTOR.T @ FACTOR)},
}


def make(name: str) -> System:
    return System.from_matrices(
        MASS,
        STIFFNESS,
        {"a": [1, 0, 0, 0], "b": [0, 0, 1, -1]},
        excitation=[Unbalance("a", 3e-4, phase_deg=25.0), HarmonicForce("b", 2.0)],
        **SYSTEMS[name],
    )


@pytest.mark.parametrize("name", SYSTEMS)
def test_flight_is_the_matrix_exponential(name):
    system = make(name)
    flow = FlowMap(system)
    omega, phases = 2 * np.pi * 17.0, (0.4, 0.4 + 1.7 * np.pi)
    x0 = RNG.standard_normal(8) * np.repeat([1e-3, 0.1], 4)
    exact, exact_jacobian = exact_flight(system, x0, phases, omega)
    start = flow.to_state(x0)
    found = flow.shoot(start[None], np.array(phases), omega)
    end = flow.to_modal(found.ends[0])
    scale = np.repeat([np.abs(exact[:4]).max(), np.abs(exact[4:]).max()], 4)
    assert np.abs((end - exact) / scale).max() < 1e-12
    L = state_map(system)
    jacobian = np.linalg.solve(L, found.jacobians[0] @ L)
    assert np.abs(jacobian - exact_jacobian).max() < 1e-12 * np.abs(exact_jacobian).max()


@pytest.mark.parametrize("name", SYSTEMS)
def test_states_and_modal_coordinates_are_inverse(name):
    flow = FlowMap(make(name))
    states = RNG.standard_normal((3, 8))
    np.testing.assert_allclose(flow.to_modal(flow.to_state(states)), states, rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", SYSTEMS)
def test_flight_derivative_with_respect_to_frequency(name):
    """At fixed phases and start, against a sixth-order difference of the matrix exponential."""
    system = make(name)
    flow = FlowMap(system)
    omega, phases = 2 * np.pi * 17.0, (0.4, 0.4 + 1.7 * np.pi)
    x0 = RNG.standard_normal(8) * np.repeat([1e-3, 0.1], 4)
    h = 1e-3 * omega
    ends = [exact_flight(system, x0, phases, omega + k * h)[0] for k in (-3, -2, -1, 1, 2, 3)]
    exact = np.array([-1, 9, -45, 45, -9, 1]) @ np.array(ends) / (60 * h)
    found = flow.shoot(flow.to_state(x0)[None], np.array(phases), omega)
    slope = flow.to_modal(found.d_omega[0])
    scale = np.repeat([np.abs(exact[:4]).max(), np.abs(exact[4:]).max()], 4)
    assert np.abs((slope - exact) / scale).max() < 1e-9


def test_forced_response_is_the_receptance_of_the_matrices():
    system = make("full damping matrix")
    omega = 2 * np.pi * 23.0
    damping = SYSTEMS["full damping matrix"]["damping"]
    load = np.array([1.0, 0, 0, 0]) * 3e-4 * omega**2 * np.exp(1j * np.radians(25.0))
    load = load + np.array([0, 0, 1.0, -1.0]) * 2.0
    u = np.linalg.solve(STIFFNESS - omega**2 * MASS + 1j * omega * damping, load)
    flow = FlowMap(system)
    for phase in (0.0, 1.3):
        state = flow.to_modal(system.steady(omega, phase))
        found = state[:4] @ system.participation["b"]
        exact = ((u[2] - u[3]) * np.exp(1j * phase)).real
        assert abs(found - exact) < 1e-12 * abs(u[2] - u[3])


ENTRY = st.tuples(st.floats(-1.0, 1.0), st.integers(-3, 3)).map(lambda e: e[0] * 10.0 ** e[1])
DECAY = st.just(0.0) | st.floats(1e-6, 10.0)


@given(st.tuples(ENTRY, ENTRY, ENTRY, ENTRY), DECAY)
@example((0.0, 1.0, -1.0, -2.0), 0.0)  # critically damped
@example((0.0, 10.0, -0.1, 0.0), 0.0)  # without decay
def test_growth_bounds_the_matrix_exponential_from_above_closely(entries, decay):
    block = np.array(entries).reshape(2, 2)
    size = np.abs(block).max()
    assume(size > 1e-3)
    block -= (max(np.linalg.eigvals(block).real.max(), 0.0) + decay * size) * np.eye(2)
    bound = _growth(block)
    rates = np.abs(np.linalg.eigvals(block))
    assume(rates.min() > 1e-5 * size)  # else the time is longer than can be sampled
    times = np.geomspace(1e-3 / rates.max(), 10.0 / rates.min(), 200)
    largest = np.linalg.norm(sla.expm(block * times[:, None, None]), 2, axis=(1, 2)).max()
    assert max(largest, 1.0) <= bound * (1.0 + 1e-7) <= 3.3 * max(largest, 1.0)


def test_growth_of_a_free_body_ends_with_a_damper_only():
    """From speed v it goes v/c far; without a damper there is no end."""
    assert _growth(np.array([[0.0, 1.0], [0.0, 0.0]])) == np.inf
    damped = _growth(np.array([[0.0, 1.0], [0.0, -1e-3]]))
    assert 1000.0 <= damped < 1002.0
    assert _growth(np.array([[-1e-320, 1.0], [0.0, -1e-3]])) == damped


def test_rigid_body_mode_with_a_damper():
    system = System.from_modal(
        [0.0, 20.0], {"tip": [1.0, 0.7]}, dampers=[Damper("tip", 4.0)],
        excitation=[HarmonicForce("tip", 3.0)],
    )  # fmt: skip
    flow = FlowMap(system)
    omega, phases = 2 * np.pi * 3.0, (0.0, 2.0 * np.pi)
    x0 = np.array([0.2, -0.1, 0.5, 3.0])
    exact, _ = exact_flight(system, x0, phases, omega)
    found = flow.shoot(flow.to_state(x0)[None], np.array(phases), omega)
    end = flow.to_modal(found.ends[0])
    np.testing.assert_allclose(end, exact, rtol=0, atol=1e-11)


def test_free_rigid_body():
    """No stiffness, no damping, no eigenvector basis: q'' = f cos ωt + the other mode's share."""
    system = System.from_modal(
        [0.0, 20.0], {"tip": [1.0, 0.7]}, excitation=[HarmonicForce("tip", 3.0)]
    )
    omega, phases = 2 * np.pi * 3.0, (0.3, 0.3 + 2.0 * np.pi)
    x0 = np.array([0.2, -0.1, 0.5, 3.0])
    exact, jacobian = exact_flight(system, x0, phases, omega)
    flow = FlowMap(system)
    found = flow.shoot(flow.to_state(x0)[None], np.array(phases), omega)
    np.testing.assert_allclose(flow.to_modal(found.ends[0]), exact, rtol=0, atol=1e-12)
    L = state_map(system)
    np.testing.assert_allclose(
        np.linalg.solve(L, found.jacobians[0] @ L), jacobian, rtol=0, atol=1e-11
    )


def test_segments_chained_and_apart_agree(one_dof):
    flow = FlowMap(one_dof)
    omega = 2 * np.pi * 26.0
    phases = np.linspace(0.0, 4 * np.pi, 6)
    start = flow.to_state(np.array([-3e-6, 2e-3]))
    chained = flow.shoot(start[None], phases, omega, chained=True)
    nodes = np.vstack([start, chained.ends[:-1]])
    apart = flow.shoot(nodes, phases, omega)
    np.testing.assert_array_equal(chained.ends, apart.ends)
    np.testing.assert_array_equal(chained.jacobians, apart.jacobians)
    plain = flow.shoot(start[None], phases, omega, chained=True, sensitivities=False)
    np.testing.assert_array_equal(plain.ends, apart.ends)


def test_sines_and_decays_of_a_panel_are_good_to_the_last_digit():
    x = np.concatenate([RNG.uniform(-1e4, 1e4, 400), np.arange(-40, 41) * np.pi / 2, [1e-300, 0.0]])
    sine, cosine = np.empty((2, x.size))
    sines = function("nldyn_sines", *SIZE_AND_ARRAYS, result=None)
    sines(x.size, address_of(x), address_of(sine), address_of(cosine))
    assert np.abs(sine - np.sin(x)).max() < 2.3e-16  # each within one unit of its last place
    assert np.abs(cosine - np.cos(x)).max() < 2.3e-16
    small = SLOW_DECAY * np.concatenate([np.linspace(-1.0, 1.0, 401), [1e-12, -1e-300]])
    grown = small.copy()
    function("nldyn_expm1", *SIZE_AND_ARRAYS[:2], result=None)(small.size, address_of(grown))
    np.testing.assert_allclose(grown, np.expm1(small), rtol=1e-15, atol=0)
