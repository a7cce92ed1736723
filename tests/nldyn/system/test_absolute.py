"""Absolute displacements on a shaken base, against the closed form of the transmissibility."""

from __future__ import annotations

import numpy as np
import pytest
from problems import in_frequency

import nldyn
from nldyn import BaseMotion, Damper, SceneError, Spring, Stop, System, SystemModelError
from nldyn.base.resources import example
from nldyn.orbits.conditions import max_abs_displacement, output_slope
from nldyn.orbits.harmonics import modal_row
from nldyn.scene.backbone import undamped
from nldyn.scene.build import build_system
from nldyn.scene.read import load_scene, parse_scene

M, K, C = 2.0, 800.0, 3.0
HZ = 4.0
OMEGA = 2.0 * np.pi * HZ


def shaken(*bases: BaseMotion, stops=()) -> System:
    system = System.from_matrices(
        [[M]], [[K]], {"mass": [1.0]}, damping=[[C]], loads={"table": [M]}, excitation=bases,
        stops=stops,
    )  # fmt: skip
    return system.with_absolute("mass", {"table": 1.0})


def transmitted(omega):
    """Absolute displacement over that of the base: (k + i ω c)/(k - m ω² + i ω c)."""
    return (K + 1j * omega * C) / (K - M * omega**2 + 1j * omega * C)


BASES = {
    "displacement": (BaseMotion("table", 1e-3, phase_deg=30.0), 1e-3),
    "velocity": (BaseMotion("table", 0.02, "velocity"), 0.02 / OMEGA),
    "acceleration": (BaseMotion("table", 0.5, "acceleration"), 0.5 / OMEGA**2),
}


@pytest.mark.parametrize("quantity", BASES)
def test_a_linear_oscillator_moves_as_its_transmissibility_says(quantity):
    base, amplitude = BASES[quantity]
    exact = amplitude * abs(transmitted(OMEGA))
    orbit = nldyn.solve_orbit(shaken(base), HZ)
    assert orbit.observe == "mass absolute"
    assert orbit.max_abs_displacement == pytest.approx(exact, rel=1e-10)
    assert max_abs_displacement(orbit) == pytest.approx(exact, rel=1e-10)
    assert nldyn.harmonics(orbit).amplitude[1] == pytest.approx(exact, rel=1e-10)
    told = orbit.history(360).displacement
    phase = np.angle(base.phasor * transmitted(OMEGA) / OMEGA ** (2 - base.power))
    wave = np.cos(np.linspace(0.0, 2.0 * np.pi, 361) + phase)
    assert told["mass absolute"] == pytest.approx(exact * wave, abs=1e-10 * exact)
    assert np.abs(told["mass"] - told["mass absolute"]).max() > 0.1 * amplitude


def test_two_harmonics_of_a_base_add_up():
    bases = BaseMotion("table", 1e-3), BaseMotion("table", 4e-4, phase_deg=70.0, harmonic=3)
    orbit = nldyn.solve_orbit(shaken(*bases), HZ)
    phases = np.linspace(0.0, 2.0 * np.pi, 20001)
    wave = sum(
        (b.amplitude * np.exp(1j * np.radians(b.phase_deg)) * transmitted(b.harmonic * OMEGA)
         * np.exp(1j * b.harmonic * phases)).real
        for b in bases
    )  # fmt: skip
    assert orbit.max_abs_displacement == pytest.approx(np.abs(wave).max(), rel=1e-7)
    assert len(orbit.observed_extremes.values) == np.count_nonzero(np.diff(np.sign(np.diff(wave))))


def test_simulations_and_sections_follow_the_base():
    base, amplitude = BASES["velocity"]
    motion = nldyn.simulate(shaken(base), HZ, periods=5, transient=200)
    exact = amplitude * transmitted(OMEGA) * -1j
    assert motion.period_peaks()[1] == pytest.approx(abs(exact) * np.ones(5), rel=1e-7)
    y, v = nldyn.longterm.stroboscopic_section(motion)
    assert y == pytest.approx(exact.real * np.ones(6), rel=1e-7)
    assert v == pytest.approx((1j * OMEGA * exact).real * np.ones(6), rel=1e-7)
    told = motion.history(100).displacement["mass absolute"]
    assert told == pytest.approx((exact * np.exp(1j * np.linspace(0, 10 * np.pi, 101))).real,
                                 abs=1e-7 * abs(exact))  # fmt: skip


def test_the_derivative_by_the_frequency_is_that_of_the_closed_form():
    base, _ = BASES["acceleration"]
    orbit = nldyn.solve_orbit(shaken(base), HZ)
    extremes = orbit.observed_extremes
    phase = float(extremes.phases[0])
    segment, row, along = output_slope(in_frequency(orbit), 0, phase)
    nodes = (
        np.linalg.inv(np.eye(2) - orbit.monodromy)
        @ orbit.problem.flow.shoot(
            orbit.problem.nodes(orbit.point)[:1], np.array([0.0, 2.0 * np.pi]), orbit.omega
        ).d_omega[0]
        * orbit.omega
    )
    assert segment == 0
    moved = float(row @ nodes)
    h = 1e-5

    def absolute(omega):
        return (-0.5 / omega**2 * transmitted(omega) * np.exp(1j * phase)).real * -1.0

    slope = (absolute(OMEGA * (1 + h)) - absolute(OMEGA * (1 - h))) / (2.0 * h)
    assert abs(moved + along) == pytest.approx(abs(slope), rel=1e-6)


def test_a_branch_with_a_stop_keeps_its_absolute_displacement_in_a_file(tmp_path):
    """The absolute motion is the relative one and the base's, at the nodes of a dense sampling."""
    base, amplitude = BASES["displacement"]
    system = shaken(base, stops=[Stop.linear("mass", 4000.0, gap=5e-4)])
    branch = nldyn.continue_branch(nldyn.solve_orbit(system, 3.6), (3.5, 3.7))
    orbit = branch.points[0]
    assert orbit.impacts
    told = orbit.history(2000).displacement
    phases = np.linspace(0.0, 2.0 * np.pi, 2001)
    base_moves = amplitude * np.cos(phases + np.radians(30.0))
    assert told["mass absolute"] == pytest.approx(told["mass"] + base_moves, abs=1e-12)
    assert orbit.max_abs_displacement == pytest.approx(
        np.abs(told["mass absolute"]).max(), rel=1e-5
    )
    nldyn.save(branch, tmp_path / "b.h5")
    (back,) = nldyn.load(tmp_path / "b.h5")
    assert back.points[0].max_abs_displacement == orbit.max_abs_displacement


def test_scenes_ask_for_it():
    text = example("bumper.toml").read_text()
    asked = text + '\n[observe]\nat = "instrument"\nabsolute = true\n'
    system = build_system(parse_scene(asked))
    assert system.interfaces[0] == "instrument absolute"
    assert system.rides == {"instrument absolute": {"table": 1.0}}
    orbit = nldyn.solve_orbit(system, 14.0)
    assert not orbit.impacts
    omega = 2.0 * np.pi * 14.0
    share = (3200.0 + 4j * omega) / (3200.0 - 2.0 * omega**2 + 4j * omega)
    assert orbit.max_abs_displacement == pytest.approx(1.5 / omega**2 * abs(share), rel=1e-10)
    assert undamped(parse_scene(asked)).observe.absolute is False
    with pytest.raises(SceneError, match=r"absolute needs an .*excitation.* of kind 'base'"):
        parse_scene(example("one_dof.toml").read_text() + '[observe]\nat="middle"\nabsolute=true\n')


def test_a_mesh_rides_where_its_interface_has_the_direction_of_the_base(tmp_path):
    text = example("two_dof_xi_0.01.toml").read_text()
    base = '[[excitation]]\nkind = "base"\ndirection = "{}"\namplitude = 1e-5\n'
    for direction, factor in (("y", 1.0), ("x", 0.0)):
        more = base.format(direction) + '[observe]\nat = "middle"\nabsolute = true\n'
        path = example("two_dof_xi_0.01.toml").parent / "absolute.toml"
        system = build_system(parse_scene(text + more, path))
        assert system.rides == {"middle absolute": {f"base {direction}": factor}}


def test_what_makes_no_sense_is_refused():
    system = shaken(BASES["displacement"][0])
    for call, words in (
        (lambda: system.with_absolute("mass absolute", {}), "unknown interface 'mass absolute'"),
        (lambda: system.with_absolute("mass", {}), "there is an interface 'mass absolute' already"),
        (lambda: system.with_absolute("mass", {"floor": 1.0}), "'floor' is not a load vector"),
        (lambda: shaken(stops=[Stop("mass absolute", 1e5)]), "unknown interface"),
        (lambda: system.with_elements(stops=(Stop("mass absolute", 1e5),)), "is only observed"),
        (lambda: nldyn.StatePlane.at_interface(system, (-1, 1), (-1, 1)), "rides on a base"),
        (lambda: modal_row(system, "mass absolute"), "only a relative displacement"),
    ):
        with pytest.raises(SystemModelError, match=words):
            call()
    assert load_scene(example("bumper.toml")).observe is None


@pytest.mark.parametrize(
    ("kind", "element"),
    [
        ("stops", Stop.linear("a", 1e6, gap=5e-4, against="b")),
        ("springs", Spring("a", 10.0, against="b")),
        ("dampers", Damper("a", 1.0, against="b")),
    ],
)
def test_what_ties_places_that_a_base_carries_otherwise_is_refused(kind, element):
    """With the masses 1 and 2 kg a base moves both by one under the load (1, 2) kg."""

    def shaken(*loads):
        return System.from_matrices(
            np.diag([1.0, 2.0]), 4e5 * np.eye(2), {"a": [1.0, 0.0], "b": [0.0, 1.0]},
            loads={str(number): load for number, load in enumerate(loads)},
            excitation=[BaseMotion(str(number), 1e-3) for number in range(len(loads))],
            **{kind: [element]},
        )  # fmt: skip

    with pytest.raises(SystemModelError, match=rf"{kind}\[0\]: a base carries 'a' otherwise"):
        shaken([1.0, 0.0])
    assert shaken([1.0, 2.0]).size == shaken([1.0, 0.0], [0.0, 2.0]).size == 2
