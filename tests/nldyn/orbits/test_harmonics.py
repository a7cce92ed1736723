"""Fourier coefficients of an orbit against closed forms and the balance of forces."""

import numpy as np
import pytest
from repeated import run_through

from nldyn import (
    HarmonicForce,
    RigidStop,
    Stop,
    System,
    SystemModelError,
    find_orbits,
    harmonics,
    solve_orbit,
)


def test_a_linear_system_answers_at_the_frequency_of_the_force():
    system = System.from_modal(
        [13.0, 40.0],
        {"tip": [0.6, 0.3]},
        modal_damping=0.02,
        excitation=[HarmonicForce("tip", 2.0, 25.0)],
    )
    lines = harmonics(run_through(solve_orbit(system, 17.0), 2), orders=3)
    omega, natural = 2.0 * np.pi * 17.0, 2.0 * np.pi * np.array([13.0, 40.0])
    transfer = 1.0 / (natural**2 - omega**2 + 0.04j * natural * omega)
    phasor = 2.0 * np.exp(1j * np.radians(25.0)) * np.sum(transfer * np.array([0.6, 0.3]) ** 2)
    assert lines.frequency_hz == pytest.approx(8.5 * np.arange(7))
    assert lines.phasor[2] == pytest.approx(phasor, rel=1e-9)
    assert np.delete(lines.amplitude, 2).max() < 1e-10 * lines.amplitude[2]


@pytest.mark.parametrize(("frequency", "period"), [(25.3, 1), (45.0, 2)])
def test_lines_are_the_response_to_force_and_contact(one_dof, frequency, period):
    """Every line of a mode is its transfer function times that of the forces on it.

    The lines of the contact force come from the quadrature of the collocation.
    """
    orbit = find_orbits(one_dof, frequency, period)[0]
    lines = harmonics(orbit, orders=40)
    phases, weights = orbit.trajectory.contact_quadrature()
    (stop,) = one_dof.stops
    v, states = one_dof.stop_vector(stop), orbit.states(phases)
    force = stop.force(states[:, :1] @ v - stop.gap, states[:, 1:] @ v)
    multiples = np.arange(lines.phasor.size)
    turns = np.exp(-1j * np.outer(multiples, phases) / period)
    contact = 2.0 * (turns @ (weights * force)) / orbit.duration
    contact[0] *= 0.5
    omega, natural = orbit.omega * multiples / period, one_dof.natural_frequencies[0]
    drive = np.zeros(multiples.size, dtype=complex)
    (source,) = one_dof.excitation
    drive[period] = source.phasor * orbit.omega**2
    damping = one_dof.total_damping[0, 0]
    transfer = v[0] ** 2 / (natural**2 - omega**2 + 1j * damping * omega)
    assert lines.phasor == pytest.approx(
        transfer * (drive - contact), rel=1e-7, abs=1e-9 * lines.amplitude.max()
    )


@pytest.mark.parametrize(("frequency", "impacts"), [(9.0, 4), (17.0, 1)])
def test_lines_are_the_response_to_force_and_impulses(frequency, impacts):
    """Every mode answers by its transfer function; velocities jump, and no sample need see it."""
    shape, natural = np.array([0.6, 0.3]), 2.0 * np.pi * np.array([13.0, 40.0])
    system = System.from_modal(
        natural / (2.0 * np.pi), {"tip": shape}, modal_damping=0.02,
        stops=[RigidStop("tip", 0.7, gap=1e-5)], excitation=[HarmonicForce("tip", 2.0, 25.0)],
    )  # fmt: skip
    orbit = find_orbits(system, frequency, 1)[0]
    assert orbit.impacts == impacts
    lines = harmonics(orbit, orders=40)
    orders = np.arange(lines.phasor.size)
    turns = np.exp(-1j * np.outer(orders, [orbit.omega * hit.time for hit in orbit.impact_list]))
    forces = -2.0 / orbit.duration * turns @ [hit.impulse for hit in orbit.impact_list]
    forces[0] *= 0.5
    forces[1] += 2.0 * np.exp(1j * np.radians(25.0))
    omega = orders[:, None] * orbit.omega
    transfer = shape**2 / (natural**2 - omega**2 + 0.04j * natural * omega)
    assert lines.phasor == pytest.approx(
        forces * transfer.sum(axis=1), rel=1e-7, abs=1e-9 * lines.amplitude.max()
    )


def test_requests_that_make_no_sense_are_refused(one_dof):
    orbit = solve_orbit(one_dof, 26.0)
    with pytest.raises(SystemModelError, match="orders must be a whole number"):
        harmonics(orbit, orders=0)
    with pytest.raises(SystemModelError, match="unknown interface 'nose'"):
        harmonics(orbit, "nose")


def test_a_system_at_rest_has_no_lines():
    system = System.from_modal(
        [13.0], {"tip": [0.6]}, modal_damping=0.02, stops=[Stop("tip", 1e9, gap=1e-3)]
    )
    assert harmonics(solve_orbit(system, 10.0), orders=2).amplitude.tolist() == [0.0, 0.0, 0.0]
