"""Branches in parameters other than the frequency: the care is the same."""

import re

import numpy as np
import pytest
from bilinear import Bilinear, PiecewiseOrbit
from one_impact import OneImpact
from scipy.optimize import brentq

import nldyn
from nldyn import (
    ConstantForce,
    ContinuationOptions,
    Damper,
    HarmonicForce,
    PolynomialSpring,
    RigidStop,
    RoundStop,
    Spring,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    solve_orbit,
    switch_branch,
)
from nldyn.branches.endings import Ending
from nldyn.system.chart import OwnParameter, with_value
from nldyn.system.parameters import Parameter
from nldyn.system.spin import Spin

HZ = 20.0
RANGES = {  # inner and outer
    "gap": ((1.5e-6, 1e-5), (1e-6, 5e-5)),
    "mass_times_radius": ((3e-6, 6e-6), (1e-6, 1e-5)),
    "modal_damping": ((0.013, 0.016), (0.01, 0.03)),
}


def beam() -> System:
    return System.from_modal(
        [13.1, 60.0], {"middle": [0.635, 0.5], "tip": [1.0, -0.8]}, modal_damping=0.0142,
        stops=[Stop("middle", stiffness=5.17e9, gap=2e-6)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )  # fmt: skip


def rigid(restitution: float = 0.7, gap: float = 0.0721) -> System:
    return System.from_matrices(
        [[1.0]], [[1.0]], {"m": [1.0]}, damping=[[0.1]],
        stops=[RigidStop("m", gap=gap, restitution=restitution)],
        excitation=[HarmonicForce("m", 1.0)],
    )  # fmt: skip


@pytest.fixture(scope="module", params=RANGES)
def whole(request):
    return continue_branch(solve_orbit(beam(), HZ), RANGES[request.param][1],
                           parameter=request.param)  # fmt: skip


def duffing() -> System:
    return System.from_matrices(
        [[1.0]], [[0.8]], {"m": [1.0]}, damping=[[0.1]], dampers=[Damper("m", 0.02)],
        springs=[PolynomialSpring("m", [0.1, 0.0, 0.5]), Spring("m", 0.1)],
        stops=[Stop("m", 20.0, 1.5, gap=0.8, dissipation=0.1)],
        excitation=[HarmonicForce("m", 0.3), ConstantForce("m", 0.1)],
    )  # fmt: skip


def whirl(*stops: Stop | RoundStop) -> System:
    return System.from_matrices(
        np.eye(2), np.diag([1.0, 1.2]), {"x": [1.0, 0.0], "y": [0.0, 1.0]},
        damping=0.2 * np.eye(2), spin=Spin(0.2, gyroscopic=[[0.0, 0.1], [-0.1, 0.0]]),
        stops=stops,
        excitation=[HarmonicForce("x", 0.4), HarmonicForce("y", 0.4, phase_deg=-90.0)],
    )  # fmt: skip


def rotor() -> System:
    return whirl(Stop("x", 50.0, gap=0.5))


def rotor_in_a_ring() -> System:
    return whirl(RoundStop(("x", "y"), 50.0, 0.5, friction=0.1, surface_speed=1.0))


WEIGHT = OwnParameter(
    name="weight over spring",
    value=lambda system: system.excitation[1].force / 0.8,
    changed=lambda system, ratio: with_value(system, Parameter("force", 1), 0.8 * ratio),
)
IN_EVERY = {  # the system and a frequency, the parameter and its range
    (beam, HZ): [("stiffness", (1e9, 2e10)), ("gap", (-5e-5, 1e-5))],
    (rigid, 0.4): [("restitution", (0.4, 0.95)), ("amplitude", (0.5, 2.0))],
    (duffing, 0.2): [
        ("amplitude", (0.1, 1.0)),
        (Parameter("force", 1), (-0.3, 0.5)),
        ("coefficient", (0.0, 0.1)),
        ("k3", (0.0, 2.0)),
        (Parameter("spring_stiffness", 1), (-0.1, 0.4)),
        ("exponent", (1.0, 2.5)),
        ("dissipation", (0.0, 1.0)),
        ("natural_frequency_hz", (0.1, 0.2)),
        (WEIGHT, (0.0, 0.4)),
    ],
    (rotor, 0.21): [("spin_hz", (-0.2, 0.6))],
    (rotor_in_a_ring, 0.21): [("clearance", (0.3, 1.0)), ("rubbing_friction", (0.0, 0.3))],
}
ROWS = [(*begin, *row) for begin, rows in IN_EVERY.items() for row in rows]


def check_same(a, b):
    for x, y in zip(a.nodes, b.nodes, strict=True):
        assert np.array_equal(x.point, y.point)
        assert np.array_equal(x.tangent, y.tangent)
    assert [(s.kind, s.value) for s in a.special_points] == [
        (s.kind, s.value) for s in b.special_points
    ]
    assert a.stop_reasons == b.stop_reasons


def saved(branch, path):
    nldyn.save([branch], path)
    return nldyn.load(path)[0]


def test_a_branch_that_goes_on_is_one_that_was_never_interrupted(whole, tmp_path):
    name = whole.parameter.name
    inner, outer = RANGES[name]
    few, orbit = ContinuationOptions(max_points=6), solve_orbit(beam(), HZ)
    begun = saved(continue_branch(orbit, outer, parameter=name, options=few), tmp_path / "few.h5")
    check_same(continue_branch(begun, options=ContinuationOptions()), whole)
    part = saved(continue_branch(orbit, inner, parameter=name), tmp_path / "part.h5")
    check_same(continue_branch(part, outer), whole)


@pytest.mark.parametrize(("make", "hz", "parameter", "limits"), ROWS)
def test_a_branch_goes_on_to_the_last_bit_in_every_parameter(make, hz, parameter, limits):
    few, more = ContinuationOptions(max_points=4), ContinuationOptions(max_points=12)
    orbit = solve_orbit(make(), hz)
    whole = continue_branch(orbit, limits, parameter=parameter, options=more)
    begun = continue_branch(orbit, limits, parameter=parameter, options=few)
    assert len(begun.nodes) < len(whole.nodes)
    check_same(continue_branch(begun, options=more), whole)


def test_special_points_are_those_of_a_branch_in_the_frequency(whole):
    """At the value of the parameter there, the frequency is that of the other branch."""
    for special in whole.special_points[::3]:
        system = with_value(beam(), whole.parameter, special.value)
        assert special.orbit.system.stops == system.stops
        few = ContinuationOptions(max_points=6)
        near = continue_branch(special.orbit, (0.999 * HZ, 1.001 * HZ), options=few)
        beside = near.points[-1]
        branch = continue_branch(beside, (0.998 * HZ, 1.002 * HZ))
        same = [s.frequency_hz for s in branch.special_points if s.kind == special.kind]
        assert min(abs(hz / HZ - 1.0) for hz in same) < 1e-8


def test_branches_switch_at_points_of_a_branch_in_the_gap():
    branch = continue_branch(solve_orbit(beam(), HZ), (1e-6, 5e-5), parameter="gap")
    flip = next(s for s in branch.special_points if s.kind == "PD")
    start = switch_branch(flip)[0]
    doubled = continue_branch(start.orbit, (1e-6, 5e-5), parameter="gap")
    assert doubled.period == 2
    assert doubled.stop_reasons[1].ending is Ending.JOINS
    assert doubled.values[-1] == pytest.approx(flip.value, rel=1e-9)


def test_orbits_of_a_branch_at_a_value():
    branch = continue_branch(solve_orbit(beam(), HZ), (1e-6, 5e-5), parameter="gap", at=[2e-5])
    (orbit,) = branch.at(2e-5)
    assert orbit.system.stops[0].gap == pytest.approx(2e-5, rel=1e-14)
    assert orbit.frequency_hz == pytest.approx(HZ, rel=1e-14)
    assert branch.contains(orbit)
    assert branch.requested[0].value == pytest.approx(2e-5, rel=1e-14)


def test_flip_of_a_bilinear_oscillator_over_the_ratio_of_stiffnesses():
    oscillator = Bilinear(0.1, 1.0, 5.0, 0.3, 1.0)
    branch = continue_branch(solve_orbit(oscillator.system, 0.33), (0.5, 60.0),
                             parameter="stiffness")  # fmt: skip
    (flip,) = branch.special_points
    exact = Bilinear(0.1, 1.0, flip.value, 0.3, 1.0)
    at_flip = PiecewiseOrbit.near(exact, flip.orbit).solved().at_multiplier(-1)
    assert flip.kind == "PD"
    assert at_flip.frequency_hz == pytest.approx(0.33, rel=1e-8)


def test_flip_of_a_rigid_impact_oscillator_over_the_restitution():
    omega = 0.8 * np.pi
    branch = continue_branch(solve_orbit(rigid(), 0.4), (0.3, 0.98), parameter="restitution")

    def off(restitution):
        exact = OneImpact(1.0, 1.0, 0.1, [1.0], [1.0], 0.0721, restitution)
        return np.prod(exact.motions(omega, 1)[0].multipliers + 1.0).real

    flips = [s.value for s in branch.special_points if s.kind == "PD"]
    assert flips == pytest.approx([brentq(off, 0.3, 0.98, xtol=1e-14)], rel=1e-8)


@pytest.mark.parametrize(
    ("name", "limits"),
    [("restitution", (0.0, 1.0)), ("modal_damping", (0.0, 0.1)), ("gap", (0.0, 0.1))],
)
def test_a_branch_ends_where_there_are_no_systems_beyond(name, limits):
    branch = continue_branch(solve_orbit(rigid(), 0.4), limits, parameter=name)
    assert sorted(branch.values[[0, -1]]) == list(limits)
    assert {reason.ending for reason in branch.stop_reasons} == {Ending.PARAMETER_RANGE_END}


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("stops.0.gap", "did you mean Parameter('gap', 0)?"),
        ("excitation.1.amplitude", "did you mean Parameter('amplitude', 1)?"),
        ("preload", "did you mean 'gap', which is negative"),
        ("static_force", "did you mean 'force'"),
        ("damping", "did you mean 'modal_damping'?"),
        ("width", "there are: frequency_hz, gap"),
    ],
)
def test_the_name_that_is_meant_is_told(name, meant):
    with pytest.raises(SystemModelError, match=re.escape(f"unknown parameter '{name}'; {meant}")):
        continue_branch(solve_orbit(beam(), HZ), (1.0, 2.0), parameter=name)


def test_bad_parameters_are_named(whole):
    orbit = solve_orbit(beam(), HZ)
    with pytest.raises(SystemModelError, match="unknown parameter 'width'"):
        continue_branch(orbit, (1.0, 2.0), parameter="width")
    with pytest.raises(SystemModelError, match=r"'clearance': stops.0. is no round clearance"):
        continue_branch(orbit, (1.0, 2.0), parameter="clearance")
    with pytest.raises(SystemModelError, match="the orbit at gap = 2e-06 m lies outside"):
        continue_branch(orbit, (1e-5, 2e-5), parameter=Parameter("gap"))
    with pytest.raises(SystemModelError, match=f"was followed in {whole.parameter.name}"):
        continue_branch(whole, (1.0, 2.0), parameter="restitution")
