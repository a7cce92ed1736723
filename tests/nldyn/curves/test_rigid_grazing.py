"""Grazing of rigid stops by its own equations, and curves of orbits with impacts."""

import math
from itertools import pairwise

import numpy as np
import pytest
from one_impact import OneImpact
from scipy.linalg import expm
from scipy.optimize import brentq

from nldyn import (
    ConstantForce,
    ConvergenceError,
    HarmonicForce,
    RigidStop,
    System,
    continue_branch,
    continue_special,
    impacts,
    load,
    normal_form,
    save,
    solve_orbit,
)
from nldyn.branches.endings import Ending
from nldyn.curves import refine_special
from nldyn.system.chart import checked_parameter, with_value

DAMPING, RESTITUTION, GAP = 0.1, 0.8, 0.3
TURN = 2.0 * math.pi
TWO = np.eye(2), np.array([[2.0, -1.0], [-1.0, 3.0]]), np.array([[0.1, -0.05], [-0.05, 0.15]])


def oscillator(gap=GAP, restitution=RESTITUTION):
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[DAMPING]],
        stops=[RigidStop("x", restitution, gap)], excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip


def exact(gap=GAP, restitution=RESTITUTION):
    return OneImpact([[1.0]], [[1.0]], [[DAMPING]], [1.0], [1.0], gap, restitution)


def amplitude(hz):
    omega = TURN * np.asarray(hz)
    return 1.0 / np.abs(1.0 - omega**2 + 1j * DAMPING * omega)


@pytest.fixture(scope="module")
def branch():
    return continue_branch(solve_orbit(oscillator(), 1.7 / TURN), (0.13, 0.4))


def test_grazing_is_solved_from_the_side_with_the_impact_and_from_the_other(branch):
    touch = brentq(lambda hz: amplitude(hz) - GAP, 0.3, 0.4, xtol=1e-15)
    (calm,) = continue_branch(solve_orbit(oscillator(), 0.45), (0.3305, 0.5)).special_points
    for special in (branch.special_points[-1], calm):
        found = refine_special(special)
        assert found.frequency_hz == pytest.approx(touch, rel=1e-11)
        assert found.orbit.impacts == 0
        assert found.residual < 1e-11


def test_grazing_in_frequency_and_gap_is_the_resonance_curve(branch, tmp_path):
    """From the orbit with the slight impact; and again from a file.

    Where a free vibration of the frequency Ω makes half a turn in a period an impact leaves no
    trace: c A b = exp(-0.05 T) sin(Ω T)/Ω.
    """
    curve = continue_special(
        branch.special_points[-1], ("frequency_hz", "gap"), ((0.25, 0.4), (0.1, 12.0))
    )
    hz, gap = curve.values.T
    assert hz[[0, -1]] == pytest.approx([0.25, 0.4], rel=1e-14)
    assert np.abs(gap / amplitude(hz) - 1.0).max() < 1e-10
    assert gap.max() > 3.0 * gap.min()
    (mark,) = curve.marks
    traceless = 2.0 * math.sqrt(1.0 - 0.25 * DAMPING**2) / TURN
    assert mark.kind == "GGR"
    assert mark.values == pytest.approx([traceless, amplitude(traceless)], rel=1e-9)
    save(curve, tmp_path / "curve.h5")
    (again,) = load(tmp_path / "curve.h5")
    assert again.points[5].residual < 1e-10


def test_an_impact_leaves_no_trace_of_two_modes_where_their_exponential_says():
    mass, stiffness, damping = TWO
    system = System.from_matrices(
        mass, stiffness, {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=damping,
        stops=[RigidStop("x", RESTITUTION, GAP)], excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    calm = continue_branch(solve_orbit(system, 0.5), (0.3, 0.6))
    touch = next(s for s in calm.special_points if s.kind == "GR" and s.orbit.impacts == 0)
    hz = 0.999 * touch.frequency_hz, 0.41
    curve = continue_special(touch, ("frequency_hz", "gap"), (hz, (0.01, 1.0)))
    rates = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
    grid = np.linspace(*hz, 50)

    def trace(hz):
        return expm(rates / hz)[0, 2]

    zeros = [brentq(trace, a, b) for a, b in pairwise(grid) if trace(a) * trace(b) < 0.0]
    found = sorted(mark.values[0] for mark in curve.marks if mark.kind == "GGR")
    assert zeros
    assert found == pytest.approx(zeros, rel=1e-9)


def room(hz, periods):
    """What the highest flight of the motion with one impact per n periods leaves of the gap."""
    shape, omega = exact(), TURN * hz
    motion = shape.motions(omega, periods)[0]
    phases = motion.phase + np.linspace(0.2, TURN * periods - 0.5, 200)
    x, v = np.array([shape.state(omega, motion, phase) for phase in phases]).T
    tops = [k for k in range(199) if v[k] > 0.0 >= v[k + 1]]
    k = max(tops, key=lambda k: x[k])
    top = brentq(lambda p: shape.state(omega, motion, p)[1], *phases[k : k + 2], xtol=1e-15)
    return shape.state(omega, motion, top)[0] - GAP


@pytest.mark.parametrize(
    ("periods", "start_hz", "between"), [(1, 0.27, (0.134, 0.138)), (2, 0.4456, (0.364, 0.368))]
)
def test_a_second_impact_grazes_where_the_closed_form_says(periods, start_hz, between):
    """Of the orbit with one impact per period, and of a subharmonic one."""
    shape, omega = exact(), TURN * start_hz
    motion = shape.motions(omega, periods)[0]
    begin = shape.state(omega, motion, TURN * math.ceil(motion.phase / TURN))
    orbit = solve_orbit(oscillator(), start_hz, period=periods, guess=begin)
    branch = continue_branch(orbit, (0.1, start_hz + 0.01))
    touch = brentq(room, *between, args=(periods,), xtol=1e-14)
    found = [special.frequency_hz for special in branch.special_points if special.kind == "GR"]
    assert min(abs(hz / touch - 1.0) for hz in found) < 1e-10


def test_a_curve_goes_on_where_an_impact_passes_a_phase_of_shooting(branch):
    """It goes on across two grazings."""
    assert [special.kind for special in branch.special_points] == ["LP", "GR", "PD", "GR"]
    assert {reason.ending for reason in branch.stop_reasons} == {Ending.RANGE_END}
    assert not branch.notes


def response(hz, ratio=0.5 * DAMPING):
    """Amplitude with another damping ratio of the mode."""
    omega = TURN * hz
    return 1.0 / abs(1.0 - omega**2 + 2j * ratio * omega)


# excitation frequency, range, and what is zero where the linear response reaches the stop
ACROSS = {
    "gap": (0.27, (0.3, 1.5), lambda gap: response(0.27) - gap),
    "amplitude": (0.27, (0.2, 1.0), lambda force: force * response(0.27) - GAP),
    "modal_damping": (0.27, (0.6, 1.0), lambda ratio: response(0.27, ratio=ratio) - GAP),
}


@pytest.mark.parametrize("name", ACROSS)
def test_a_curve_in_any_parameter_goes_on_across_a_grazing(name):
    """From the orbit with the impact, and from the one without."""
    hz, (low, high), room_left = ACROSS[name]
    touch = brentq(room_left, low, high, xtol=1e-15)
    for value in (low, high):
        system = with_value(oscillator(), checked_parameter(oscillator(), name), value)
        curve = continue_branch(solve_orbit(system, hz), (low, high), parameter=name)
        (graze,) = [mark for mark in curve.special_points if mark.kind == "GR"]
        assert graze.value == pytest.approx(touch, rel=1e-9)
        assert {reason.ending for reason in curve.stop_reasons} == {Ending.PARAMETER_RANGE_END}
        assert {orbit.impacts for orbit in curve.points} == {0, 1}


@pytest.mark.parametrize(
    ("hz", "natural_hz", "limits"), [(0.32, 1.0 / TURN, (0.13, 0.16)), (0.3, 0.07, (0.07, 0.08))]
)
def test_a_grazing_in_the_natural_frequency_is_that_of_the_linear_response(hz, natural_hz, limits):
    """From the orbit with the impact, and from that without; impacts begin far from it."""

    def room_left(natural_hz):
        omega, natural = TURN * hz, TURN * natural_hz
        return 1.0 / abs(natural**2 - omega**2 + 1j * DAMPING * natural * omega) - GAP

    own = checked_parameter(oscillator(), "natural_frequency_hz")
    curve = continue_branch(
        solve_orbit(with_value(oscillator(), own, natural_hz), hz), limits, parameter=own
    )
    (graze,) = [mark for mark in curve.special_points if mark.kind == "GR"]
    assert graze.value == pytest.approx(brentq(room_left, *limits, xtol=1e-15), rel=1e-9)
    assert {orbit.impacts for orbit in curve.points} == {0, 1}
    assert not curve.notes


def test_a_ball_that_ceases_to_fly_ends_a_curve_without_a_grazing():
    """Without rebound it lies still on a table that shakes by less than g."""
    g = 9.81
    ball = System.from_matrices(
        [[1.0]], [[0.0]], {"x": [1.0]}, stops=[RigidStop("x", 0.0, direction=-1)],
        excitation=[HarmonicForce("x", 1.2 * g), ConstantForce("x", -g)],
    )  # fmt: skip
    curve = continue_branch(solve_orbit(ball, 10.0), (0.9 * g, 1.21 * g), parameter="amplitude")
    assert curve.values.min() == pytest.approx(g, rel=1e-3)
    assert not curve.special_points
    assert curve.stop_reasons[0].ending is Ending.FAILS


def test_a_curve_goes_on_where_two_stops_are_grazed_at_once():
    """Between two equal stops, behind which the orbit has an impact at each."""
    system = oscillator()
    both = [RigidStop("x", RESTITUTION, GAP, direction) for direction in (1, -1)]
    orbit = solve_orbit(system.with_elements(stops=tuple(both)), 0.45)
    curve = continue_branch(orbit, (0.9, 3.0), parameter="amplitude")
    assert [mark.kind for mark in curve.special_points] == ["GR"]
    assert curve.special_points[0].value == pytest.approx(GAP / response(0.45), rel=1e-10)
    assert {orbit.impacts for orbit in curve.points} == {0, 2}
    assert {reason.ending for reason in curve.stop_reasons} == {Ending.PARAMETER_RANGE_END}


def test_orbits_behind_a_grazing_in_the_gap_are_those_of_the_closed_form(tmp_path):
    """They lie on the same side as those without; the curve is extended across it from a file."""
    short = continue_branch(solve_orbit(oscillator(), 0.27), (0.3, 0.8), parameter="gap")
    save(short, tmp_path / "curve.h5")
    (again,) = load(tmp_path / "curve.h5")
    curve = continue_branch(again, (0.3, 1.5))
    omega = TURN * 0.27
    hit = [node for node in curve.nodes if node.orbit.impacts]
    slightest = min(impacts(node.orbit).speed[0] for node in hit)
    assert slightest < 1e-4 * GAP * omega
    for node in hit:
        speeds = [motion.speed for motion in exact(node.value).motions(omega, 1)]
        speed = impacts(node.orbit).speed[0]
        fastest = node.orbit.max_abs_displacement * omega
        assert min(abs(speed**2 - v**2) for v in speeds) < 1e-10 * fastest**2
    assert not short.special_points
    assert [mark.kind for mark in curve.special_points] == ["LP", "GR"]


def test_a_curve_of_folds_is_that_of_the_closed_form():
    """The subharmonic orbits of period 2: at a fold the gap is the farthest an impact can be."""
    shape, omega = exact(), 2.8
    motion = shape.motions(omega, 2)[0]
    begin = shape.state(omega, motion, TURN * math.ceil(motion.phase / TURN))
    orbit = solve_orbit(oscillator(), omega / TURN, period=2, guess=begin)
    branch = continue_branch(orbit, (0.4, 0.7))
    (fold,) = [special for special in branch.special_points if special.kind == "LP"]
    edge = brentq(lambda omega: shape.reach(omega, 2) - GAP, 3.4, 3.7, xtol=1e-14)
    assert fold.frequency_hz == pytest.approx(edge / TURN, rel=1e-10)
    curve = continue_special(fold, ("frequency_hz", "gap"), ((0.55, 0.58), (0.2, 0.4)))
    assert len(curve.points) > 4
    reach = [shape.reach(TURN * hz, 2) for hz in curve.values[:, 0]]
    assert curve.values[:, 1] == pytest.approx(reach, rel=1e-9)


def test_a_body_at_rest_on_a_stop_grazes_nothing():
    """Pressed on it by twice what shakes it; beyond that it lifts off and lands, each period."""
    stiffness = np.array([[2.0, -1.0], [-1.0, 2.0]])
    system = System.from_matrices(
        np.eye(2), stiffness, {"a": [1.0, 0.0], "b": [0.0, 1.0]}, damping=0.1 * stiffness,
        stops=[RigidStop("a", 0.3, 0.2)],
        excitation=[HarmonicForce("a", 0.3), ConstantForce("a", 2.0)],
    )  # fmt: skip
    orbit = solve_orbit(system, 0.1)
    assert orbit.impacts == 0
    curve = continue_branch(orbit, (0.25, 2.2), parameter="amplitude")
    assert not curve.special_points
    assert not curve.notes
    assert [orbit.impacts for orbit in (curve.points[0], curve.points[-1])] == [0, 1]


NORMAL_FORMS = {
    "jumps": (([[1.0]], [[1.0]], [[0.1]]), [1.0], 0.45, "where the one without ends"),
    "overdamped": (([[1.0]], [[1.0]], [[2.5]]), [1.0], 0.3, "periods that grow by one follow"),
    "of two masses": (TWO, [1.0, 0.3], 0.5, "on the same side as the one without"),
}


@pytest.mark.parametrize("name", NORMAL_FORMS)
def test_the_normal_form_of_grazing_is_the_limit_of_the_closed_form(name):
    """Multiplier times speed of the slight impact, and change of the frequency over that speed.

    Orbits without impacts exist above the frequency of each.
    """
    matrices, force, hz, words = NORMAL_FORMS[name]
    n = len(force)
    system = System.from_matrices(
        matrices[0], matrices[1], {f"x{i}": np.eye(n)[i] for i in range(n)}, damping=matrices[2],
        stops=[RigidStop("x0", RESTITUTION, GAP)],
        excitation=[HarmonicForce(f"x{i}", force[i]) for i in range(n)],
    )  # fmt: skip
    across = continue_branch(solve_orbit(system, hz), (0.2, 1.1 * hz))
    special = next(s for s in across.special_points if s.orbit.impacts == 0)
    form = normal_form(special)
    assert (special.kind, form.name) == ("GR", "rigid grazing")
    shape = OneImpact(*matrices, force, np.eye(n)[0], GAP, RESTITUTION)
    step, omega = form.side * 1e-5, TURN * special.frequency_hz
    near = []
    for change in (step, 2.0 * step):
        motion = shape.motions(omega * math.exp(change), 1)[-1]
        largest = motion.multipliers[np.argmax(np.abs(motion.multipliers))]
        near.append((largest.real * motion.speed, change / motion.speed))
    growth, change = 2.0 * np.array(near[0]) - near[1]  # to speed zero
    assert form.coefficient.value == pytest.approx(growth, rel=1e-6)
    assert form.frequency_shift.value == pytest.approx(change, rel=1e-6)
    assert words in form.sentence


def test_an_orbit_that_loses_all_directions_at_rest_is_stable():
    """Long chatter ends in rest in each period."""
    orbit = solve_orbit(oscillator(), 0.02)
    assert np.abs(orbit.multipliers).max() == 0.0
    assert orbit.stability.verdict == "stable"


@pytest.mark.parametrize("hz", [18.5, 20.0, 20.5, 21.5])
def test_steps_as_long_as_the_motion_are_no_orbit(hz):
    """Without loss slight impacts make Jacobians of 1e12, whose rounding is as large as it."""
    system = System.from_modal(
        [13.1, 125.3], {"x": [0.4, 1.0]}, modal_damping=0.01, stops=[RigidStop("x", 1.0)],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    try:
        error = solve_orbit(system, hz, seconds=5.0).error
    except ConvergenceError as failure:
        error = 0.0
        assert "no orbit of period 1" in str(failure)
    assert error < 1e-3
