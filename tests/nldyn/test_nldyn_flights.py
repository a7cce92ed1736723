"""Flights: the linear motion between contacts, against the matrix exponential."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as sla
from independent import packed_map

from nldyn import Damper, FlowMap, HarmonicForce, System, Unbalance

RNG = np.random.default_rng(1)
FACTOR = RNG.standard_normal((4, 4))
MASS = np.diag([1.0, 2.0, 0.5, 1.5]) + 0.1 * np.ones((4, 4))
STIFFNESS = 4e4 * (FACTOR @ FACTOR.T + 0.2 * np.eye(4))

SYSTEMS = {
    "non-proportional damper": {"dampers": [Damper("a", 30.0)], "modal_damping": 0.01},
    "overdamped mode": {"modal_damping": [0.02, 3.0, 0.02, 0.1]},
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


def exact_flight(
    system: System, x0: np.ndarray, phases: tuple[float, float], omega: float
) -> tuple[np.ndarray, np.ndarray]:
    """End state and Jacobian from one matrix exponential of the system and its oscillator."""
    n = system.size
    A = np.zeros((2 * n + 2, 2 * n + 2))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, :n] = -np.diag(system.natural_frequencies**2)
    A[n : 2 * n, n : 2 * n] = -system.total_damping
    A[-2:, -2:] = [[0.0, -omega], [omega, 0.0]]  # (cos ωt, sin ωt)
    for source in system.excitation:
        f, _ = source.complex_amplitude(omega)
        A[n : 2 * n, -2:] += np.outer(system.participation[source.at], [f.real, -f.imag])
    E = sla.expm(A * (phases[1] - phases[0]) / omega)
    start = np.concatenate([x0, [np.cos(phases[0]), np.sin(phases[0])]])
    return (E @ start)[: 2 * n], E[: 2 * n, : 2 * n]


@pytest.mark.parametrize("name", SYSTEMS)
def test_flight_is_the_matrix_exponential(name):
    system = make(name)
    flow = FlowMap(system)
    omega, phases = 2 * np.pi * 17.0, (0.4, 0.4 + 1.7 * np.pi)
    x0 = RNG.standard_normal(8) * np.repeat([1e-3, 0.1], 4)
    exact, exact_jacobian = exact_flight(system, x0, phases, omega)
    start = flow.to_packed(x0, phases[0], omega)
    found = flow.shoot(start[None], np.array(phases), omega)
    end = flow.to_physical(found.ends[0], phases[1], omega)
    scale = np.repeat([np.abs(exact[:4]).max(), np.abs(exact[4:]).max()], 4)
    assert np.abs((end - exact) / scale).max() < 1e-12
    L = packed_map(system)
    jacobian = np.linalg.solve(L, found.jacobians[0] @ L)
    assert np.abs(jacobian - exact_jacobian).max() < 1e-12 * np.abs(exact_jacobian).max()


@pytest.mark.parametrize("name", SYSTEMS)
def test_packing_is_undone_by_unpacking(name):
    flow = FlowMap(make(name))
    states = RNG.standard_normal((3, 8))
    packed = flow.to_packed(states, 0.7, 90.0)
    np.testing.assert_allclose(flow.to_physical(packed, 0.7, 90.0), states, rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", SYSTEMS)
def test_flight_derivative_with_respect_to_frequency(name):
    """In packed coordinates a flight is e^{λT} with T = Δφ/ω: its derivative is -λ T w / ω."""
    system = make(name)
    flow = FlowMap(system)
    omega, phases = 2 * np.pi * 17.0, np.array([0.4, 0.4 + 1.7 * np.pi])
    start = RNG.standard_normal(8)
    found = flow.shoot(start[None], phases, omega)
    L = packed_map(system)
    n = system.size
    A = np.block(
        [[np.zeros((n, n)), np.eye(n)],
         [-np.diag(system.natural_frequencies**2), -system.total_damping]]
    )  # fmt: skip
    exact = -(phases[1] - phases[0]) / omega**2 * (L @ A @ np.linalg.solve(L, found.ends[0]))
    np.testing.assert_allclose(found.d_omega[0], exact, rtol=0, atol=1e-11 * np.abs(exact).max())


def test_forced_response_is_the_receptance_of_the_matrices():
    system = make("full damping matrix")
    omega = 2 * np.pi * 23.0
    damping = SYSTEMS["full damping matrix"]["damping"]
    load = np.array([1.0, 0, 0, 0]) * 3e-4 * omega**2 * np.exp(1j * np.radians(25.0))
    load = load + np.array([0, 0, 1.0, -1.0]) * 2.0
    u = np.linalg.solve(STIFFNESS - omega**2 * MASS + 1j * omega * damping, load)
    flow = FlowMap(system)
    for phase in (0.0, 1.3):
        state = flow.to_physical(np.zeros(8), phase, omega)
        found = state[:4] @ system.participation["b"]
        exact = ((u[2] - u[3]) * np.exp(1j * phase)).real
        assert abs(found - exact) < 1e-12 * abs(u[2] - u[3])


def test_frequency_derivative_of_the_forced_response():
    """d_positive and d_negative against a fourth-order difference of the response itself."""
    system = make("overdamped mode")
    omega, step = 2 * np.pi * 23.0, 1e-3
    values = [system.forced_response(omega + k * step).at_phase(0.9) for k in (-2, -1, 1, 2)]
    five_point = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
    forced = system.forced_response(omega)
    turn = np.exp(0.9j)
    slope = forced.d_positive * turn + forced.d_negative / turn
    np.testing.assert_allclose(slope, five_point, rtol=0, atol=1e-9 * np.abs(slope).max())


def test_rigid_body_mode_with_a_damper():
    system = System.from_modal(
        [0.0, 20.0], {"tip": [1.0, 0.7]}, dampers=[Damper("tip", 4.0)],
        excitation=[HarmonicForce("tip", 3.0)],
    )  # fmt: skip
    flow = FlowMap(system)
    omega, phases = 2 * np.pi * 3.0, (0.0, 2.0 * np.pi)
    x0 = np.array([0.2, -0.1, 0.5, 3.0])
    exact, _ = exact_flight(system, x0, phases, omega)
    found = flow.shoot(flow.to_packed(x0, 0.0, omega)[None], np.array(phases), omega)
    end = flow.to_physical(found.ends[0], phases[1], omega)
    np.testing.assert_allclose(end, exact, rtol=0, atol=1e-11)


def test_segments_chained_and_apart_agree(one_dof):
    flow = FlowMap(one_dof)
    omega = 2 * np.pi * 26.0
    phases = np.linspace(0.0, 4 * np.pi, 6)
    start = flow.to_packed(np.array([-3e-6, 2e-3]), 0.0, omega)
    chained = flow.shoot(start[None], phases, omega, chained=True)
    nodes = np.vstack([start, chained.ends[:-1]])
    apart = flow.shoot(nodes, phases, omega)
    np.testing.assert_array_equal(chained.ends, apart.ends)
    np.testing.assert_array_equal(chained.jacobians, apart.jacobians)
    plain = flow.shoot(start[None], phases, omega, chained=True, sensitivities=False)
    np.testing.assert_array_equal(plain.ends, apart.ends)
