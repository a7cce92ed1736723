"""Skew matrices: gyroscopic ones and cross-coupled stiffness, against closed forms and exp(At)."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
import scipy.linalg as sla
from independent import Motion
from scipy.optimize import brentq

import nldyn
from nldyn import (
    FlowMap,
    HarmonicForce,
    SceneError,
    Spin,
    Spring,
    Stop,
    System,
    SystemModelError,
    Unbalance,
)
from nldyn.base.resources import example
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene, parse_scene

SKEW = np.array([[0.0, 1.0], [-1.0, 0.0]])
PLACES = {"x": [1.0, 0.0], "y": [0.0, 1.0]}


def rotor(k=4.0, c=0.4, g=0.0, kc=0.0, split=0.0, **more):
    return System.from_matrices(
        np.eye(2), np.diag([k, k * (1.0 + split)]), PLACES, damping=c * np.eye(2),
        gyroscopic=g * SKEW, circulatory=kc * SKEW, **more,
    )  # fmt: skip


def generator(k=4.0, c=0.4, g=0.0, kc=0.0, split=0.0):
    K = np.diag([k, k * (1.0 + split)]) + kc * SKEW
    return np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -c * np.eye(2) - g * SKEW]])


KINDS = {
    "gyroscopic": {"g": 1.3},
    "gyroscopic without damping": {"g": 1.3, "c": 0.0, "split": 0.2},
    "cross-coupled": {"kc": 0.7},
    "both, overdamped": {"kc": 0.7, "g": 2.0, "c": 9.0, "split": 0.3},
    "one direction soft": {"kc": 0.05, "split": -0.9},
}


@pytest.mark.parametrize("name", KINDS)
def test_flights_are_those_of_the_matrix_exponential(name):
    numbers = KINDS[name]
    system, flow = rotor(**numbers), FlowMap(rotor(**numbers))
    start, duration = np.array([0.3, -0.2, 0.5, 0.7]), 5.0
    omega = 2.0 * np.pi / duration
    exact = sla.expm(duration * generator(**numbers))
    phi = np.array([system.participation[name] for name in PLACES])  # u = phi q
    both = sla.block_diag(phi, phi)
    z = flow.to_state(np.linalg.solve(both, start))
    found = flow.shoot(z[None], np.array([0.0, 2.0 * np.pi]), omega)
    end = both @ flow.to_modal(found.ends[0])
    assert end == pytest.approx(exact @ start, rel=1e-12, abs=1e-13)
    values = np.concatenate([np.linalg.eigvals(block) for block in system.linear.blocks])
    for value in np.linalg.eigvals(generator(**numbers)):
        assert np.abs(values - value).min() < 1e-12 * np.abs(values).max()


def test_a_defective_matrix_is_computed_with_a_warning():
    """[[4, 1], [0, 4]] as stiffness: equal frequencies that share one direction."""
    K = np.array([[4.0, 1.0], [0.0, 4.0]])
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        system = System.from_matrices(
            np.eye(2), 0.5 * (K + K.T), PLACES, damping=0.2 * np.eye(2), circulatory=0.5 * (K - K.T)
        )
    assert any("coincide" in str(warning.message) for warning in told)
    flow, duration = FlowMap(system), 5.0
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -0.2 * np.eye(2)]])
    phi = np.array([system.participation[name] for name in PLACES])
    both, start = sla.block_diag(phi, phi), np.array([0.3, -0.2, 0.5, 0.7])
    z = flow.to_state(np.linalg.solve(both, start))
    found = flow.shoot(z[None], np.array([0.0, 2.0 * np.pi]), 2.0 * np.pi / duration)
    exact = sla.expm(duration * A) @ start
    assert both @ flow.to_modal(found.ends[0]) == pytest.approx(exact, rel=1e-8)


def test_forward_whirl_is_the_closed_form():
    """With u = x + iy: |u| = m e ω² / |k - ω² + g ω + i (c ω - k_c)| for u ~ exp(iωt)."""
    k, c, g, kc, me, omega = 4.0, 0.4, 0.3, 0.5, 0.02, 1.7
    system = rotor(k, c, g, kc, excitation=[Unbalance("x", me), Unbalance("y", me, -90.0)])
    orbit = nldyn.solve_orbit(system, omega / (2.0 * np.pi))
    # x'' + c x' + g y' + k x + k_c y: u'' + c u' - i g u' + (k - i k_c) u
    size = me * omega**2 / abs(k - omega**2 + g * omega + 1j * (c * omega - kc))
    assert orbit.max_abs_displacement == pytest.approx(size, rel=1e-9)
    assert orbit.liouville_error < 1e-12


def test_rubbing_orbits_are_those_of_runge_kutta():
    system = rotor(
        4.0, 0.3, 0.4, 0.3, 0.1,
        stops=[Stop("x", 40.0, 1.5, gap=0.05), Stop.linear("y", 20.0, gap=0.1, direction=-1)],
        excitation=[HarmonicForce("x", 0.8), HarmonicForce("y", 0.8, -90.0)],
        springs=[Spring("x", 0.4, "y")],
    )  # fmt: skip
    orbit = nldyn.solve_orbit(system, 0.25)
    assert orbit.impacts >= 2
    flow = orbit.problem.flow
    start = flow.to_modal(orbit.problem.nodes(orbit.point)[0])
    end, tangent, _ = Motion(system).run(start, (0.0, 2.0 * np.pi), orbit.omega, max_step=0.005)
    assert end == pytest.approx(start, abs=1e-8)
    exact = np.linalg.eigvals(tangent)
    for multiplier in orbit.multipliers:
        assert np.abs(exact - multiplier).min() < 1e-5
    assert orbit.liouville_error < 1e-7


def test_skew_matrices_go_through_files(tmp_path):
    system = rotor(kc=0.5, g=0.3, excitation=[Unbalance("x", 0.02)])
    branch = nldyn.continue_branch(nldyn.solve_orbit(system, 0.25), (0.24, 0.26))
    nldyn.save(branch, tmp_path / "b.h5")
    (back,) = nldyn.load(tmp_path / "b.h5")
    assert np.array_equal(back.points[0].system.circulatory, system.circulatory)
    assert not system.conservative
    assert rotor(c=0.0, g=1.0).conservative


def test_what_makes_no_sense_is_refused():
    with pytest.raises(SystemModelError, match=r"lets the motion at 0.31.* Hz grow"):
        rotor(c=0.1, kc=0.5)  # more than c ω
    with pytest.raises(SystemModelError, match="gyroscopic must be skew"):
        System.from_matrices(np.eye(2), np.eye(2), PLACES, gyroscopic=np.eye(2))
    with pytest.raises(SystemModelError, match=r"circulatory is .3, 3., it must be .2, 2."):
        System.from_matrices(np.eye(2), np.eye(2), PLACES, circulatory=np.zeros((3, 3)))
    with pytest.raises(SystemModelError, match="a skew part, as of rotors, is given as circulator"):
        System.from_matrices(np.eye(2), [[1.0, 0.2], [0.0, 1.0]], PLACES)
    text = example("rotor_against_stator.toml").read_text()
    with pytest.raises(SceneError, match=r"matrices.circulatory must be skew"):
        build_system(parse_scene(text.replace("-8e3", "8e3")))


def test_a_reduction_to_all_modes_keeps_the_circulatory_matrix():
    text = example("rotor_against_stator.toml").read_text()
    rates = [
        np.sort_complex(np.linalg.eigvals(build_system(parse_scene(each)).linear.blocks).ravel())
        for each in (text, text + "\n[reduction]\nmodes = 2\n")
    ]
    np.testing.assert_allclose(rates[1], rates[0], rtol=1e-9)


def test_the_example_touches_its_first_pad_where_the_closed_form_says():
    """Sag and whirl together reach the gap: Re W/(k - i k_c) + |U| = 0.4 mm."""
    k, c, kc, m, me, weight, gap = 4e5, 80.0, 8e3, 10.0, 1e-4, 98.1, 4e-4
    sag = (weight / (k - 1j * kc)).real

    def left(hz):
        w = 2.0 * np.pi * hz
        return gap - sag - me * w * w / abs(k - m * w * w + 1j * (c * w - kc))

    exact = brentq(left, 20.0, 31.0, xtol=1e-13)
    system = build_system(load_scene(example("rotor_against_stator.toml")))
    branch = nldyn.continue_branch(nldyn.solve_orbit(system, exact - 0.5), (exact - 1, exact + 0.2))
    grazing = [p.frequency_hz for p in branch.special_points if p.kind == "GR"]
    assert min(abs(hz - exact) for hz in grazing) < 1e-8 * exact


K, C, ME, IT, IP = 4.0, 0.1, 0.02, 1.0, 0.4


def disc(omega=1.2, stops=(), circulatory=None, c=C):
    """An overhung disc that tilts about two axes: its gyroscopic moment goes with the speed."""
    spin = Spin(omega / (2.0 * np.pi), IP * SKEW, circulatory)
    sources = [Unbalance("x", ME), Unbalance("y", ME, -90.0)]
    return System.from_matrices(
        IT * np.eye(2), K * np.eye(2), PLACES, damping=c * np.eye(2), spin=spin,
        excitation=sources, stops=stops,
    )  # fmt: skip


def whirl(omega):
    """Forward whirl of the disc at the speed of its unbalance."""
    return ME * omega**2 / abs(K - (IT - IP) * omega**2 + 1j * C * omega)


def touching(gap):
    """Speed in rad/s at which the whirl reaches a gap."""
    return brentq(lambda omega: whirl(omega) - gap, 1.2, 2.0, xtol=1e-14)


def test_a_disc_is_followed_in_its_speed_as_the_closed_form_says(tmp_path):
    stop = Stop.linear("x", 40.0, gap=0.03)
    system = disc(1.6, [stop])
    exact = touching(0.03) / (2.0 * np.pi)
    curve = nldyn.continue_branch(
        nldyn.solve_orbit(system, system.spin.hz), (0.25, exact + 1e-5), parameter="speed_hz"
    )
    assert len(curve.points) > 2
    for orbit in curve.points:
        assert orbit.system.spin.hz == pytest.approx(orbit.frequency_hz, rel=1e-14)
        if not orbit.impacts:
            assert orbit.max_abs_displacement == pytest.approx(whirl(orbit.omega), rel=1e-9)
    grazing = curve.special_points[0]
    assert grazing.kind == "GR" and grazing.frequency_hz == pytest.approx(exact, rel=1e-9)
    wide = nldyn.continue_special(
        grazing, ("speed_hz", "gap"), ((0.28, 0.286), (0.02, 0.04)),
        options=nldyn.ContinuationOptions(max_points=3),
    )  # fmt: skip
    assert np.ptp(wide.values[:, 1]) > 1e-4
    for hz, gap in wide.values:
        assert whirl(2.0 * np.pi * hz) == pytest.approx(gap, rel=1e-8)
    beyond = curve.points[-1]
    assert beyond.impacts == 1
    flow = beyond.problem.flow
    start = flow.to_modal(beyond.problem.nodes(beyond.point)[0])
    turned = System.from_matrices(
        IT * np.eye(2), K * np.eye(2), PLACES, damping=C * np.eye(2), stops=[stop],
        gyroscopic=beyond.omega * IP * SKEW, excitation=system.excitation,
    )  # fmt: skip
    end, tangent, _ = Motion(turned).run(start, (0.0, 2.0 * np.pi), beyond.omega, max_step=0.02)
    assert end == pytest.approx(start, abs=1e-8)
    exact_multipliers = np.linalg.eigvals(tangent)
    for multiplier in beyond.multipliers:
        assert np.abs(exact_multipliers - multiplier).min() < 1e-5
    nldyn.save(curve, tmp_path / "c.h5")
    (back,) = nldyn.load(tmp_path / "c.h5")
    assert back.points[-1].system.spin.hz == beyond.system.spin.hz
    assert back.values == pytest.approx(curve.values, rel=1e-15)


def test_the_speed_ends_where_internal_damping_lets_the_whirl_grow():
    """N = n Ω: the free whirl at σ grows from n Ω = c σ on, with σ² = G Ω σ + k."""
    n, c = 0.5, 0.25
    onset = np.sqrt(K / (n / c * (n / c - IP))) / (2.0 * np.pi)
    system = disc(0.9 * 2.0 * np.pi * onset, circulatory=n * SKEW, c=c)
    limits = (0.8 * onset, 1.2 * onset)
    curve = nldyn.continue_branch(
        nldyn.solve_orbit(system, system.spin.hz), limits, parameter="spin_hz"
    )
    assert curve.values.max() == pytest.approx(onset, rel=1e-6)
    assert curve.values.min() == pytest.approx(0.8 * onset, rel=1e-9)


SPINNING = """
[matrices]
mass = [[1.0, 0.0], [0.0, 1.0]]
stiffness = [[4.0, 0.0], [0.0, 4.0]]
damping = [[0.1, 0.0], [0.0, 0.1]]
interfaces.x = [1.0, 0.0]
interfaces.y = [0.0, 1.0]
[matrices.spin]
hz = 0.25
gyroscopic = [[0.0, 0.4], [-0.4, 0.0]]
[[excitation]]
at = "x"
kind = "unbalance"
mass_times_radius = 0.02
[[excitation]]
at = "y"
kind = "unbalance"
mass_times_radius = 0.02
phase_deg = -90.0
"""


@pytest.mark.parametrize("more", ["", "[reduction]\nmodes = 2\n"])
def test_a_scene_has_a_speed(more):
    system = build_system(parse_scene(SPINNING + more))
    orbit = nldyn.solve_orbit(system, 0.25)
    assert orbit.max_abs_displacement == pytest.approx(whirl(0.5 * np.pi), rel=1e-9)
    faster = nldyn.solve_orbit(system.with_spin(0.3), 0.3)
    assert faster.max_abs_displacement == pytest.approx(whirl(0.6 * np.pi), rel=1e-9)


def test_spins_that_make_no_sense_are_refused():
    with pytest.raises(SystemModelError, match="spin: gyroscopic must be skew"):
        Spin(1.0, np.eye(2))
    with pytest.raises(SystemModelError, match="spin needs a gyroscopic or a circulatory matrix"):
        Spin(1.0)
    with pytest.raises(SystemModelError, match="spin has matrices of 3 rows, the system 2"):
        System.from_matrices(np.eye(2), np.eye(2), PLACES, spin=Spin(1.0, np.zeros((3, 3))))
    start = nldyn.solve_orbit(disc(), 0.1)
    with pytest.raises(SystemModelError, match=r"spins at 0\.19.* Hz, but the excitation"):
        nldyn.continue_branch(start, (0.1, 0.2), parameter="speed_hz")
    still = nldyn.solve_orbit(rotor(excitation=[Unbalance("x", 0.02)]), 0.1)
    with pytest.raises(SystemModelError, match="'spin_hz': the system has no spin"):
        nldyn.continue_branch(still, (0.1, 0.2), parameter="spin_hz")
    with pytest.raises(SceneError, match=r"matrices.spin.gyroscopic must be skew"):
        parse_scene(SPINNING.replace("-0.4", "0.4"))
