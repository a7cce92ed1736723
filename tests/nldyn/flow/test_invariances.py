"""Laws that hold for every system: scaling, time shift, energy, choice of coordinates."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from problems import THREE_MODES_AT, THREE_MODES_STATES, make_one_dof, three_modes

from nldyn import Damper, FlowMap, HarmonicForce, Stop, System, Unbalance, solve_orbit


@given(THREE_MODES_STATES, st.sampled_from([1.0, 1.5, 2.0, 1.3]), st.floats(-3.0, 3.0))
def test_without_a_gap_motion_scales_with_force(state, exponent, decades):
    """y → s y, force → s force, stiffness → s^(1-p) stiffness; for p = 1 nothing else changes."""
    # at the very surface rounding decides whether the contact begins before the start or after
    assume(abs(np.dot(THREE_MODES_AT["middle"], state[:3])) > 1e-12 * np.abs(state).max())
    s = 10.0**decades
    stiffness = 5e9 * 4e-6 ** (1.5 - exponent)
    omega, phases = 2 * np.pi * 25.0, np.array([0.3, 4.0])

    def run(scale):
        stop = Stop("middle", stiffness=stiffness * scale ** (1 - exponent), exponent=exponent)
        system = three_modes(stops=[stop], excitation=[Unbalance("middle", 5e-6 * scale)])
        flow = FlowMap(system)
        start = flow.to_state(scale * state)
        found = flow.shoot(start[None], phases, omega)
        return found.ends[0] / scale, found.jacobians[0], found.closings[0]

    base, base_jacobian, base_closings = run(1.0)
    end, jacobian, closings = run(s)
    assert closings == base_closings
    np.testing.assert_allclose(end, base, rtol=0, atol=1e-9 * np.abs(base).max())
    size = np.abs(base_jacobian).max()
    np.testing.assert_allclose(jacobian, base_jacobian, rtol=0, atol=1e-6 * size)


@pytest.mark.parametrize("scale", [1e-6, 0.3, 1e3])
def test_orbit_scales_with_force(one_dof, scale):
    orbit = solve_orbit(one_dof, 45.0)
    scaled = solve_orbit(
        make_one_dof(
            stops=[Stop("middle", stiffness=5.17e9 / math.sqrt(scale))],
            excitation=[Unbalance("middle", 4.92e-6 * scale)],
        ),
        45.0,
    )
    assert scaled.max_abs_displacement == pytest.approx(
        scale * orbit.max_abs_displacement, rel=1e-9
    )
    assert scaled.max_penetration == pytest.approx(scale * orbit.max_penetration, rel=1e-8)
    np.testing.assert_allclose(scaled.multipliers, orbit.multipliers, rtol=1e-7)


@given(THREE_MODES_STATES, st.floats(-360.0, 360.0), st.sampled_from(["force", "unbalance"]))
def test_phase_of_the_excitation_shifts_time(state, degrees, kind):
    def excitation(phase_deg):
        if kind == "force":
            return [HarmonicForce("end", 0.3, phase_deg)]
        return [Unbalance("middle", 5e-6, phase_deg)]

    omega, phases, shift = 2 * np.pi * 25.0, np.array([0.3, 4.0]), math.radians(degrees)

    def run(phase_deg, offset):
        flow = FlowMap(three_modes(excitation=excitation(phase_deg)))
        start = flow.to_state(state)
        end = flow.shoot(start[None], phases + offset, omega, sensitivities=False).ends[0]
        return flow.to_modal(end)

    early, late = run(degrees, 0.0), run(0.0, shift)
    np.testing.assert_allclose(early[:3], late[:3], rtol=0, atol=1e-9 * np.abs(late[:3]).max())
    np.testing.assert_allclose(early[3:], late[3:], rtol=0, atol=1e-9 * np.abs(late[3:]).max())


def test_orbit_of_a_shifted_excitation_is_the_shifted_orbit():
    base = solve_orbit(make_one_dof(), 26.0)
    shifted = solve_orbit(make_one_dof(excitation=[Unbalance("middle", 4.92e-6, 70.0)]), 26.0)
    phases = np.linspace(0.0, 4.9, 50)
    later = base.states(phases + math.radians(70.0))
    scale = np.abs(later).max(axis=0)
    np.testing.assert_allclose(shifted.states(phases) / scale, later / scale, rtol=0, atol=1e-8)
    assert shifted.max_abs_displacement == pytest.approx(base.max_abs_displacement, rel=1e-10)


@pytest.mark.parametrize("build", [make_one_dof, three_modes], ids=["one mode", "three modes"])
def test_work_of_the_excitation_is_what_the_dampers_take(build):
    """Over one period of an orbit the stops give back all that they took."""
    system = build()
    orbit = solve_orbit(system, 26.0)
    history = orbit.history(20000)
    v = history.modal_velocity[:-1]
    omega = orbit.omega
    step = history.time[1]
    unbalance = system.excitation[0].mass_times_radius * omega**2
    force = unbalance * np.cos(omega * history.time[:-1])
    work = step * float(force @ (v @ system.participation["middle"]))
    taken = step * float(np.einsum("ti,ij,tj->", v, system.total_damping, v))
    assert work == pytest.approx(taken, rel=1e-8)
    stop_work = step * float(history.force[:-1, 0] @ (v @ system.participation["middle"]))
    stop = system.stops[0]
    stored = stop.stiffness * orbit.max_penetration**2.5 / 2.5
    assert abs(stop_work) < 1e-7 * stored


def test_momentum_balance_of_an_orbit(one_dof):
    """Mean contact force + k times mean displacement = 0 over a period."""
    history = solve_orbit(one_dof, 26.0).history(20000)
    force = history.force[:-1, 0].mean()
    spring = 16877.0 * history.displacement["middle"][:-1].mean()
    assert force == pytest.approx(-spring, rel=1e-8)


def test_history_obeys_the_equation_of_motion(one_dof):
    """m x'' + c x' + k x + F = m_e r_e ω² cos ωt, with x'' from differences in a flight."""
    orbit = solve_orbit(one_dof, 26.0)
    history = orbit.history(4000)
    x, t = history.displacement["middle"], history.time
    v = history.modal_velocity[:, 0] * orbit.system.participation["middle"][0]
    h = t[1]
    inner = slice(2, -2)
    a = (v[:-4] - 8 * v[1:-3] + 8 * v[3:-1] - v[4:]) / (12 * h)
    c = 2 * 0.0142 * math.sqrt(2.48 * 16877.0)
    rest = 2.48 * a + c * v[inner] + 16877.0 * x[inner]
    rest -= 4.92e-6 * orbit.omega**2 * np.cos(orbit.omega * t[inner])
    free = np.convolve(history.penetration[:, 0] > 0, np.ones(5), "valid") == 0
    assert free.sum() > 3000
    assert np.abs(rest[free]).max() < 1e-8 * 16877.0 * np.abs(x).max()


# --- the same system, told differently ---------------------------------------------------------

MASS = np.array([[2.0, 0.3], [0.3, 1.0]])
STIFFNESS = np.array([[3e4, -1e4], [-1e4, 2e4]])
ELEMENTS = {
    "stops": [Stop("first", stiffness=2e9)],
    "excitation": [Unbalance("second", 1e-5)],
    "dampers": [Damper("second", 3.0)],
}


def assert_same_orbit(a: System, b: System, length: float = 1.0) -> None:
    """Equal amplitude (b in units of `length`), penetration and multipliers."""
    one, two = solve_orbit(a, 31.0), solve_orbit(b, 31.0)
    assert one.impacts == two.impacts > 0
    assert two.max_abs_displacement == pytest.approx(one.max_abs_displacement / length, rel=1e-9)
    assert two.max_penetration == pytest.approx(one.max_penetration / length, rel=1e-9)
    np.testing.assert_allclose(
        np.sort_complex(two.multipliers), np.sort_complex(one.multipliers), rtol=0, atol=1e-7
    )


def two_masses(**changes) -> System:
    return System.from_matrices(
        MASS, STIFFNESS, {"first": [1.0, 0.0], "second": [0.0, 1.0]}, modal_damping=0.05,
        **{**ELEMENTS, **changes},
    )  # fmt: skip


def test_modal_data_and_matrices_give_the_same_orbit():
    whole = two_masses()
    squared, modes = np.linalg.eigh(
        np.linalg.solve(np.linalg.cholesky(MASS), STIFFNESS)
        @ np.linalg.inv(np.linalg.cholesky(MASS)).T
    )
    modes = np.linalg.inv(np.linalg.cholesky(MASS)).T @ modes
    modal = System.from_modal(
        np.sqrt(squared) / (2 * np.pi), {"first": modes[0], "second": modes[1]},
        modal_damping=0.05, **ELEMENTS,
    )  # fmt: skip
    assert_same_orbit(whole, modal)


def test_order_and_sign_of_the_modes_do_not_matter():
    whole = two_masses()
    turned = System.from_modal(
        whole.frequencies_hz[::-1],
        {name: -phi[::-1] for name, phi in whole.participation.items()},
        modal_damping=0.05,
        **ELEMENTS,
    )
    assert_same_orbit(whole, turned)


def test_coordinates_of_the_matrices_do_not_matter():
    """x = T z turns M into TᵀMT, K into TᵀKT and an interface vector b into Tᵀb."""
    T = np.array([[1.0, 2.0], [-0.5, 1.5]])
    turned = System.from_matrices(
        T.T @ MASS @ T,
        T.T @ STIFFNESS @ T,
        {"first": T.T @ [1.0, 0.0], "second": T.T @ [0.0, 1.0]},
        modal_damping=0.05,
        **ELEMENTS,
    )
    assert_same_orbit(two_masses(), turned)


def test_damping_matrix_and_point_damper_give_the_same_orbit():
    matrix = two_masses(dampers=[], damping=[[0.0, 0.0], [0.0, 3.0]])
    assert_same_orbit(two_masses(), matrix)


def test_units_do_not_matter():
    """Tonnes, millimetres and seconds: forces stay in N."""
    tonnes = System.from_matrices(
        MASS * 1e-3, STIFFNESS * 1e-3, {"first": [1.0, 0.0], "second": [0.0, 1.0]},
        modal_damping=0.05,
        stops=[Stop("first", stiffness=2e9 * 1e-3**1.5)],
        excitation=[Unbalance("second", 1e-5)],
        dampers=[Damper("second", 3e-3)],
    )  # fmt: skip
    assert_same_orbit(two_masses(), tonnes, length=1e-3)


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_two_stops_at_one_place_are_one_stop_of_their_stiffness(exponent):
    stiffness = 2e9 * 4e-6 ** (1.5 - exponent)
    one = two_masses(stops=[Stop("first", stiffness, exponent)])
    two = two_masses(stops=[Stop("first", share * stiffness, exponent) for share in (0.3, 0.7)])
    a, b = solve_orbit(one, 31.0), solve_orbit(two, 31.0)
    assert 2 * a.impacts == b.impacts > 0
    assert b.max_abs_displacement == pytest.approx(a.max_abs_displacement, rel=1e-9)
    np.testing.assert_allclose(a.multipliers, b.multipliers, rtol=0, atol=1e-7)


def test_a_mode_that_no_interface_sees_changes_nothing():
    whole = two_masses()
    more = System.from_modal(
        [*whole.frequencies_hz, 77.0],
        {name: [*phi, 0.0] for name, phi in whole.participation.items()},
        modal_damping=0.05, **ELEMENTS,
    )  # fmt: skip
    one, two = solve_orbit(whole, 31.0), solve_orbit(more, 31.0)
    assert two.max_abs_displacement == pytest.approx(one.max_abs_displacement, rel=1e-10)
    nu = 2 * np.pi * 77.0
    unseen = np.exp(nu * (-0.05 + 1j * math.sqrt(1 - 0.05**2)) / 31.0)
    assert np.abs(two.multipliers - unseen).min() < 1e-10
