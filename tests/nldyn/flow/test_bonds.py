"""Polynomial springs and cubic dampers, against closed forms and Runge-Kutta's method."""

import math

import numpy as np
import pytest
from independent import Motion
from scipy.optimize import minimize_scalar, root
from scipy.special import ellipj, ellipk

import nldyn
from nldyn import FlowMap, HarmonicForce, Parameter, PolynomialSpring, Spring, Stop, System
from nldyn.base.errors import SystemModelError
from nldyn.orbits.orbit import contact_damping
from nldyn.system import CubicDamper

WELLS = PolynomialSpring("a", [-1.0, 0.0, 1.0])


def one(stiffness=1.0, damping=0.1, force=0.3, **elements):
    return System.from_matrices(
        [[1.0]], [[stiffness]], {"a": [1.0]}, damping=[[damping]],
        excitation=[HarmonicForce("a", force)], **elements,
    )  # fmt: skip


def chain(**more):
    """Three masses with quadratic and cubic coupling, cubic damping, and a stop at the last."""
    names = ("a", "b", "c")
    return System.from_matrices(
        np.diag([1.0, 1.5, 0.7]), np.diag([1.0, 0.0, 0.4]),
        {name: np.eye(3)[i].tolist() for i, name in enumerate(names)},
        damping=0.05 * np.eye(3),
        springs=[
            PolynomialSpring("a", [1.0, 0.3, 2.0], "b"),
            PolynomialSpring("b", [0.5, 0.0, 1.0], "c"),
            Spring("a", 0.2, "c"),
        ],
        dampers=[CubicDamper("b", 0.2, "c"), CubicDamper("a", 0.1, by="displacement")],
        excitation=[HarmonicForce("a", 0.8), HarmonicForce("c", 0.2, 40.0, 2)],
        **more,
    )  # fmt: skip


SYSTEMS = {
    "hardening": one(springs=[PolynomialSpring("a", [0.0, 0.0, 1.0])]),
    "two wells": one(0.0, 0.15, springs=[WELLS]),
    "quadratic, seventh power": one(springs=[PolynomialSpring("a", [0.2, 0.4, 0, 0, 0, 0, 0.5])]),
    "damping": one(0.0, 0.02, springs=[WELLS], dampers=[
        CubicDamper("a", 0.3), CubicDamper("a", 0.4, by="displacement")]),
    "chain": chain(),
    "chain with stops": chain(stops=[Stop.linear("c", 30.0, gap=0.1), Stop("b", 50.0, gap=0.2,
                                     direction=-1, against="a")]),
}  # fmt: skip


@pytest.mark.parametrize("name", SYSTEMS)
def test_motions_and_derivatives_are_those_of_runge_kutta(name):
    system, omega = SYSTEMS[name], 1.3
    flow = FlowMap(system)
    modal = 0.4 * np.cos(np.arange(2.0 * system.size))
    phases = (0.3, 0.3 + (2.0 if system.stops else 4.0) * math.pi)
    step = 0.01 if system.stops else 0.05
    state, tangent, _ = Motion(system).run(modal, phases, omega, max_step=step)
    found = flow.shoot(flow.to_state(modal)[None], np.array(phases), omega)
    assert not found.failure
    assert bool(found.closings.sum()) == bool(system.stops)
    size = np.abs(state).max()
    assert flow.to_modal(found.ends[0]) == pytest.approx(state, rel=0.0, abs=1e-9 * size)
    linear = system.linear
    jacobian = linear.right @ found.jacobians[0] @ linear.left
    error = np.abs(jacobian - tangent).max() / np.abs(tangent).max()
    assert error < (3e-6 if system.stops else 2e-8)  # that of the Hertz contact's tangent


@pytest.mark.parametrize("name", ["damping", "chain with stops"])
def test_derivatives_by_frequency_and_coefficients_are_differences(name):
    system, omega = SYSTEMS[name], 1.3
    flow = FlowMap(system)
    state = flow.to_state(0.4 * np.cos(np.arange(2.0 * system.size)))[None]
    phases = np.array([0.3, 6.0])
    names = [Parameter("k1"), Parameter("k3"), Parameter("amplitude")]
    found = flow.shoot(state, phases, omega, parameters=names)

    def difference(end, step=1e-5):
        """Of fourth order."""
        near, far = end(step) - end(-step), end(2.0 * step) - end(-2.0 * step)
        return (8.0 * near - far) / (12.0 * step)

    by_omega = difference(lambda h: flow.shoot(state, phases, omega + h).ends[0])
    assert found.d_omega[0] == pytest.approx(by_omega, rel=1e-6, abs=1e-7 * abs(by_omega).max())
    for column, parameter in enumerate(names):

        def moved(h, parameter=parameter):
            value = nldyn.system.chart.value_of(system, 0.0, parameter)
            other = nldyn.system.chart.with_value(system, parameter, value + h)
            return FlowMap(other).shoot(state, phases, omega).ends[0]

        slope = difference(moved)
        exact = found.d_parameters[0][:, column]
        assert exact == pytest.approx(slope, rel=1e-6, abs=1e-7 * abs(slope).max())


def test_the_free_undamped_oscillation_is_jacobis_cosine():
    """u'' + u + u³ = 0 from u = A: A cn(sqrt(1 + A²) t | A²/(2 + 2A²))."""
    amplitude = 3.0
    rate, m = math.sqrt(1.0 + amplitude**2), amplitude**2 / (2.0 + 2.0 * amplitude**2)
    period = 4.0 * ellipk(m) / rate
    flow = FlowMap(one(damping=0.0, force=0.0, springs=[PolynomialSpring("a", [0.0, 0.0, 1.0])]))
    omega = 2.0 * math.pi / period
    motion = flow.trajectory(
        flow.to_state(np.array([amplitude, 0.0]))[None], np.array([0.0, 2.0 * math.pi]), omega
    )
    assert motion.record.phase.size < 12
    phases = np.linspace(0.0, 2.0 * math.pi, 40)
    u = flow.to_modal(motion.states(phases))[:, 0]
    assert u == pytest.approx(amplitude * ellipj(rate * phases / omega, m)[1], abs=1e-9)


def harmonic_balance(delta, force, lag, guess, harmonics=12, samples=256):
    """ω and the harmonics 1, 3, ... of u'' + δu' + u + u³ = F cos(ωt + lag), u_1 being real."""
    turns = 2.0 * np.pi * np.arange(samples) / samples
    orders = 2 * np.arange(harmonics) + 1
    waves = np.exp(1j * np.outer(turns, orders))

    def residual(x):
        c = np.append(x[1], x[2 : harmonics + 1] + 1j * x[harmonics + 1 :])
        u = (waves @ c).real
        cubes = 2.0 * (waves.conj().T @ u**3) / samples
        left = (1.0 - (orders * x[0]) ** 2 + 1j * delta * orders * x[0]) * c + cubes
        left[0] -= force * np.exp(1j * lag)
        return np.concatenate([left.real, left.imag])

    found = root(residual, guess, tol=1e-14)
    assert np.abs(found.fun).max() < 1e-12
    return found.x


def test_folds_of_duffings_equation_are_those_of_harmonic_balance():
    delta, force, harmonics = 0.1, 0.3, 12
    lags = np.linspace(0.3, 3.1, 71)
    points = []
    for lag in lags:
        if not points:  # by one harmonic
            amplitudes = np.linspace(0.01, 2.0, 20000)
            w = force * np.sin(lag) / (delta * amplitudes)
            off = (1.0 - w * w) * amplitudes + 0.75 * amplitudes**3 - force * np.cos(lag)
            best = int(np.abs(off).argmin())
            guess = np.zeros(2 * harmonics)
            guess[:2] = w[best], amplitudes[best]
        points.append(harmonic_balance(delta, force, lag, guess))
        guess = points[-1]
    omega = np.array([point[0] for point in points])
    turns = np.flatnonzero(np.diff(np.sign(np.diff(omega)))) + 1
    exact = []
    for i in turns:
        sign = np.sign(omega[i] - omega[i - 1])
        found = minimize_scalar(
            lambda lag, i=i, sign=sign: -sign * harmonic_balance(delta, force, lag, points[i])[0],
            bracket=(lags[i - 1], lags[i], lags[i + 1]), tol=1e-7,
        )  # fmt: skip
        exact.append(abs(found.fun) / (2.0 * np.pi))
    system = SYSTEMS["hardening"]
    branch = nldyn.continue_branch(nldyn.solve_orbit(system, 0.15), (0.12, 0.4))
    folds = [point.frequency_hz for point in branch.special_points if point.kind == "LP"]
    assert len(folds) == 2
    assert sorted(folds) == pytest.approx(sorted(exact), rel=1e-9)
    ends = [abs(p.liouville_error) for p in branch.points[:: len(branch.points) // 5]]
    assert max(ends) < 1e-9


def test_growth_over_a_chaotic_stretch_and_the_sum_of_the_exponents():
    """Singular values of the tangent of ten periods; the sum is minus the damping, exactly."""
    system = one(0.0, 0.15, springs=[WELLS])
    start = np.array([0.5, 0.0])
    _, tangent, _ = Motion(system).run(start, (0.0, 20.0 * math.pi), 1.0)
    flow = FlowMap(system)
    found = flow.shoot(flow.to_state(start)[None], np.array([0.0, 20.0 * math.pi]), 1.0)
    J = system.linear.right @ found.jacobians[0] @ system.linear.left
    grown, exact = (np.linalg.svd(matrix, compute_uv=False)[0] for matrix in (J, tangent))
    assert exact > 10.0
    assert grown == pytest.approx(exact, rel=1e-6)
    spectrum = nldyn.lyapunov_exponents(system, 1.0 / (2.0 * math.pi), periods=50, transient=20)
    assert spectrum.exponents.sum() == pytest.approx(-0.15, abs=1e-10)


def test_liouvilles_formula_with_cubic_damping():
    orbit = nldyn.solve_orbit(SYSTEMS["damping"], 1.3 / (2.0 * math.pi))
    assert contact_damping(orbit.problem.flow, orbit.trajectory) > 0.05
    assert orbit.liouville_error < 1e-9


def test_symmetry_needs_odd_powers():
    assert SYSTEMS["hardening"].symmetric
    assert not SYSTEMS["quadratic, seventh power"].symmetric


def test_a_body_that_runs_away_is_told():
    flow = FlowMap(one(springs=[PolynomialSpring("a", [0.0, 0.0, -1.0])]))
    found = flow.shoot(flow.to_state(np.array([1.5, 1.0]))[None], np.array([0.0, 20.0]), 1.0)
    assert "runs away" in found.failure


def test_orbits_of_bonds_go_through_files(tmp_path):
    system = SYSTEMS["damping"]
    orbit = nldyn.solve_orbit(system, 1.3 / (2.0 * math.pi))
    branch = nldyn.continue_branch(orbit, (0.2, 0.21))
    nldyn.save(branch, tmp_path / "b.h5")
    (back,) = nldyn.load(tmp_path / "b.h5")
    assert back.points[0].system.springs == system.springs
    assert back.points[0].system.dampers == system.dampers
    assert np.array_equal(back.max_abs_displacement, branch.max_abs_displacement)


def test_what_makes_no_sense_is_refused():
    for coefficients, words in (
        ([], "must be a list of 1 to 9 numbers"),
        ([1.0] * 10, "must be a list of 1 to 9 numbers"),
        ([0.0, 0.0], "must not all be zero"),
        ([np.inf], "spring at 'a': coefficients"),
    ):
        with pytest.raises(SystemModelError, match=words):
            PolynomialSpring("a", coefficients)
    with pytest.raises(SystemModelError, match="by must be 'speed' or 'displacement'"):
        CubicDamper("a", 1.0, by="time")
    with pytest.raises(SystemModelError, match="coefficient must be positive"):
        CubicDamper("a", 0.0)
    with pytest.raises(SystemModelError, match="has no such coefficient"):
        nldyn.continue_branch(
            nldyn.solve_orbit(SYSTEMS["hardening"], 0.1), (0.0, 1.0), parameter=Parameter("k4")
        )


def test_a_fold_in_two_parameters_obeys_the_scaling_of_duffings_equation():
    """With u = v/sqrt(k3), F² k3 alone decides where the folds are."""
    system = SYSTEMS["hardening"]
    branch = nldyn.continue_branch(nldyn.solve_orbit(system, 0.15), (0.12, 0.4))
    fold = branch.special_points[0]
    curve = nldyn.continue_special(
        fold, ("frequency_hz", Parameter("k3")), ((0.05, 0.6), (0.9, 2.1))
    )
    (there,) = curve.at(Parameter("k3"), 2.0)
    other = one(force=0.3 * math.sqrt(2.0), springs=[PolynomialSpring("a", [0.0, 0.0, 1.0])])
    folds = nldyn.continue_branch(nldyn.solve_orbit(other, 0.15), (0.12, 0.5)).special_points
    near = min(folds, key=lambda point: abs(point.frequency_hz - there.frequency_hz))
    assert there.frequency_hz == pytest.approx(near.frequency_hz, rel=1e-9)
    assert there.frequency_hz > 1.1 * fold.frequency_hz


def test_both_wells_hold_an_orbit_and_a_motion_settles_in_one():
    system = one(0.0, 0.25, 0.1, springs=[WELLS])
    orbits = nldyn.find_orbits(system, 1.0 / (2.0 * math.pi), period=1)
    phases = np.linspace(0.0, 2.0 * math.pi, 64, endpoint=False)
    means = sorted(float(orbit.states(phases)[:, 0].mean()) for orbit in orbits)
    assert means[0] < -0.5
    assert means[0] == pytest.approx(-means[-1], abs=1e-8)
    assert nldyn.classify_attractor(system, 1.0 / (2.0 * math.pi)).kind == "periodic"


def test_a_motion_comes_to_rest_where_the_terms_of_a_force_cancel():
    system = one(0.0, 0.2, 0.0, springs=[WELLS])
    motion = nldyn.simulate(system, 0.15, periods=200, start=np.array([0.5, 0.3]))
    assert not motion.failure
    displacement, velocity = motion.states([motion.end_time])[0]
    assert abs(displacement) == pytest.approx(1.0, rel=1e-14)
    assert abs(velocity) < 1e-14
