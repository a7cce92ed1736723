"""The stored reference against integrators that share nothing with it."""

import mpmath
import numpy as np
import pytest
from hard.stiffness import beam_with_stop
from scipy.integrate import solve_ivp

from bench import motion
from bench.exact import ExactFlow, Precision
from bench.measure import errors
from bench.models import MODELS, Case, load_case, load_grazing, stored, to_system, to_table
from bench.reference import model_system
from nldyn.flow.flow_map import FlowMap


def by_runge_kutta(case: Case, rtol: float):
    """One period by DOP853 on the equations as they stand, without events."""
    p = motion.pack_parameters(case.system, case.start, case.omega)
    found = solve_ivp(
        motion.numpy_rate,
        (0.0, motion.PERIOD),
        motion.initial(p, case.start),
        args=(p,),
        method="DOP853",
        rtol=rtol,
        atol=rtol,
        max_step=0.05,
    )
    return motion.to_sensitivities(p, found.y[:, -1])


@pytest.mark.parametrize("name", ["one_dof", "two_dof"])
def test_stored_values_agree_with_an_integrator_of_low_precision(name):
    case = load_case(name)
    assert max(errors(case, by_runge_kutta(case, 1e-10))) < 1e-7


@pytest.mark.parametrize("name", MODELS)
def test_stored_values_obey_liouvilles_formula(name):
    case = load_case(name)
    exact = -float(np.trace(case.system.total_damping)) * motion.PERIOD / case.omega
    sign, value = np.linalg.slogdet(case.exact.monodromy)
    assert sign == 1.0
    assert value == pytest.approx(exact, abs=1e-9)


def test_references_of_the_small_models_have_forty_digits():
    assert all(load_case(name).digits >= 40.0 for name in ("one_dof", "two_dof"))
    assert all(case.digits >= 40.0 for case in load_grazing().values())


def test_reference_is_the_same_when_computed_again_with_fewer_digits():
    table = stored()["models"]["one_dof"]
    flow = ExactFlow(to_system(table["system"]), table["omega"], Precision(34, 40, 30))
    end = flow.period(table["start"])
    assert end.contacts == table["contacts"] == 1
    for here, there in zip(end.state + end.d_omega, table["state"] + table["d_omega"], strict=True):
        assert abs(here / mpmath.mpf(there) - 1) < 1e-24


@pytest.mark.parametrize("name", ["one_dof", "four_dof"])
def test_stored_systems_are_those_of_the_example_scenes(name):
    known, made = stored()["models"][name]["system"], to_table(model_system(name))
    for key in ("natural_frequencies", "stop_stiffness", "mass_times_radius"):
        assert np.allclose(known[key], made[key], rtol=1e-9)
    assert np.allclose(np.abs(known["participation"]), np.abs(made["participation"]), rtol=1e-9)


def test_a_contact_at_the_start_of_the_period_is_carried_on():
    table = stored()["models"]["one_dof"]
    system = to_system(table["system"])
    start = np.array([1e-6, 1e-3])  # inside the stop
    precision = Precision(34, 40, 30)
    end = ExactFlow(system, table["omega"], precision).period(start)
    p = motion.pack_parameters(system, start, table["omega"])
    found = solve_ivp(
        motion.numpy_rate, (0.0, motion.PERIOD), motion.initial(p, start), args=(p,),
        method="DOP853", rtol=1e-11, atol=1e-11, max_step=0.05,
    )  # fmt: skip
    other = motion.to_sensitivities(p, found.y[:, -1])
    assert np.allclose([float(a) for a in end.state], other.state, rtol=1e-6)
    assert np.allclose([float(a) for a in end.d_omega], other.d_omega, rtol=1e-5)


def test_period_that_ends_just_before_a_contact_does():
    """The Taylor steps in a fictitious time reach past both ends, where time runs backwards."""
    system = beam_with_stop(5.17e9)
    start, omega = np.array([-2.13485578e-05, -4.72967275e-04]), 72.0 * np.pi
    end = ExactFlow(system, omega, Precision(26, 32, 18)).period(start)
    flow = FlowMap(system)
    found = flow.shoot(flow.to_state(start)[None], np.array([0.0, 2.0 * np.pi]), omega)
    depth, speed = (float(value) for value in end.state)
    assert 0.0 < depth < 1e-8
    np.testing.assert_allclose(flow.to_modal(found.ends)[0], [depth, speed], rtol=1e-7)
