"""Where motions begin or cease to stick, against closed forms and an integration of its own."""

import math
from itertools import pairwise

import numpy as np
import pytest
from den_hartog import Swing, response
from scipy.linalg import eigh
from scipy.optimize import brentq, minimize_scalar
from sliding import Body, Contact

from nldyn import (
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    continue_special,
    describe_special,
    load,
    normal_form,
    save,
    solve_orbit,
    switch_branch,
)
from nldyn.bifurcations.sliding import born, sticks, words
from nldyn.branches.endings import Ending
from nldyn.flow.stretches import OPEN, STUCK, Stretch
from nldyn.system import DryFriction

AXES = np.eye(2)
TURN = 2.0 * math.pi
SLIDING = ("CS", "GS", "AS")


def block(share, *, damping=0.0, spring=None, second=None):
    """Mass 1 on a spring 1, pulled by 1 N to and fro, with friction of a share of 1 N."""
    dry = [DryFriction("x", 1.0, share, tangential_stiffness=spring)]
    if second is not None:
        dry.append(DryFriction("x", 1.0, second, tangential_stiffness=spring))
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[damping]], dampers=dry,
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip


def sliding_points(branch):
    return [special for special in branch.special_points if special.kind in SLIDING]


def changes_only_there(branch, number=0):
    """How often it sticks changes at each sliding bifurcation, and nowhere else between points."""
    found = sliding_points(branch)
    for a, b in pairwise(branch.nodes):
        between = [s for s in found if a.arclength < s.point.arclength <= b.arclength]
        here, there = (sticks(words(node.orbit)[number]) for node in (a, b))
        assert (here != there) == (len(between) % 2 == 1)


def limit(ratio):
    """Den Hartog's friction over force, from which on the block stops at both ends of its swing."""
    size, swing = response(ratio)
    return abs(size) / math.hypot(swing, ratio**-2)


def test_stops_begin_over_frequency_where_den_hartog_says():
    branch = continue_branch(solve_orbit(block(0.8), 0.14), (0.11, 0.16))
    first, last = sliding_points(branch)
    for special, low, high in ((first, 0.7, 0.9), (last, 0.9, 0.99)):
        assert special.kind == "CS"
        exact = brentq(lambda ratio: limit(ratio) - 0.8, low, high, xtol=1e-15)
        assert special.orbit.omega == pytest.approx(exact, rel=1e-9)
        assert special.error < 1e-9
    changes_only_there(branch)
    assert [sticks(words(branch.at(hz)[0])[0]) for hz in (0.115, 0.14, 0.158)] == [2, 0, 2]
    assert branch.notes == ()


@pytest.mark.parametrize("ratio", [0.6, 0.8, 1.25])
def test_stops_begin_over_friction_where_den_hartog_says(ratio):
    start = solve_orbit(block(0.5), ratio / TURN)
    branch = continue_branch(start, (0.4, 0.97), parameter="friction")
    (special,) = sliding_points(branch)
    assert special.kind == "CS"
    assert np.all(np.diff(branch.values) > 0.0)  # where a multiplier touches 1 nothing turns
    assert "LP" not in {mark.kind for mark in branch.special_points}
    assert special.value == pytest.approx(limit(ratio), rel=1e-9)


def swings(ratio, share):
    """Motions with two stops a cycle, by time of sliding, whether more happens in them or not."""

    def off(time):
        try:
            return Swing(ratio, time, 0.0).share - share
        except (ValueError, StopIteration):
            return math.nan

    times = np.linspace(0.2, 0.999, 400) * math.pi / ratio
    gaps = [off(time) for time in times]
    return [
        Swing(ratio, brentq(off, a, b, xtol=1e-15), 0.0)
        for a, b, before, behind in zip(times, times[1:], gaps, gaps[1:], strict=False)
        if before * behind <= 0.0
    ]


def slowest(swing):
    """Largest speed, least below zero, in the middle of a slide."""
    times = np.linspace(0.3, 0.7, 2001) * swing.time
    k = int(np.argmax(swing.speed(times)))
    fit = np.polynomial.Polynomial.fit(times[k - 3 : k + 4], swing.speed(times[k - 3 : k + 4]), 4)
    (top,) = [t.real for t in fit.deriv().roots() if times[k - 1] <= t.real <= times[k + 1]]
    return float(swing.speed(top))


def test_slow_blocks_stop_once_more_where_the_closed_form_says():
    """Within a slide the speed touches zero; at rest the force P - X reaches the friction."""
    share = 0.3
    branch = continue_branch(solve_orbit(block(share), 0.2 / TURN), (0.19 / TURN, 0.25 / TURN))
    grazing, adding = sliding_points(branch)
    assert (grazing.kind, adding.kind) == ("GS", "AS")
    touch = brentq(lambda r: slowest(swings(r, share)[-1]), 0.197, 0.199, xtol=1e-14)
    assert grazing.orbit.omega == pytest.approx(touch, rel=1e-9)
    reached = brentq(lambda r: swings(r, share)[0].top - (1.0 - share), 0.22, 0.25, xtol=1e-14)
    assert adding.orbit.omega == pytest.approx(reached, rel=1e-9)
    changes_only_there(branch)
    told = [describe_special(special) for special in (grazing, adding)]
    assert "the speed of sliding just falls to zero; it sticks 4 times in a period above" in told[0]
    assert "what sticks just needs all its friction; it sticks 4 times in a period below" in told[1]
    assert all("friction at 'x' (" in sentence for sentence in told)


SPRING, DAMPING = 2.0, 0.05


def amplitude(omega):
    """Of the block on both springs."""
    return 1.0 / abs(1.0 + SPRING - omega**2 + 1j * DAMPING * omega)


@pytest.mark.parametrize(  # sliding, and sticking on both sides
    "start", [0.25, *(pytest.param(hz, marks=pytest.mark.slow) for hz in (0.1, 0.6))]
)
def test_jenkins_element_begins_to_slide_where_its_spring_pulls_with_its_friction(start):
    system = block(1.0, damping=DAMPING, spring=SPRING)
    branch = continue_branch(solve_orbit(system, start), (0.05, 0.8))
    found = sliding_points(branch)
    assert [special.kind for special in found] == ["AS", "AS"]
    for special, low, high in zip(found, (0.5, 2.0), (1.5, 3.0), strict=True):
        exact = brentq(lambda omega: SPRING * amplitude(omega) - 1.0, low, high, xtol=1e-15)
        assert special.orbit.omega == pytest.approx(exact, rel=1e-9)
        assert "all the time" in describe_special(special)
    assert [sticks(words(branch.at(hz)[0])[0]) for hz in (0.1, 0.25, 0.6)] == [-1, 2, -1]


def test_jenkins_element_ceases_to_slide_with_more_friction():
    omega = 1.3
    start = solve_orbit(block(0.4, damping=DAMPING, spring=SPRING), omega / TURN)
    branch = continue_branch(start, (0.2, 3.0), parameter="friction")
    (special,) = sliding_points(branch)
    assert special.value == pytest.approx(SPRING * amplitude(omega), rel=1e-9)
    assert branch.values.max() == pytest.approx(3.0)


def test_a_platform_damper_slides_between_the_frequencies_of_the_linear_response():
    """As in docs/examples/platform_damper.toml: where it sticks it is a spring of 4e5 N/m."""
    mass, spring, ratio, most = np.diag([0.3, 1.0]), 4e5, 0.01, 4.0
    stiffness = np.array([[1e5, -1e5], [-1e5, 1.6e6]])
    system = System.from_matrices(
        mass, stiffness, {"blade": AXES[0], "platform": AXES[1]}, modal_damping=ratio,
        dampers=[DryFriction("platform", 8.0, 0.5, tangential_stiffness=spring)],
        excitation=[HarmonicForce("blade", 1.0)],
    )  # fmt: skip
    squares, shapes = eigh(stiffness, mass)
    damping = mass @ shapes @ np.diag(2.0 * ratio * np.sqrt(squares)) @ shapes.T @ mass

    def left(hz):
        omega = TURN * hz
        dynamic = stiffness + spring * np.diag(AXES[1]) - omega**2 * mass + 1j * omega * damping
        return most - spring * abs(np.linalg.solve(dynamic, AXES[0])[1])

    branch = continue_branch(solve_orbit(system, 89.0), (85.0, 93.0))
    found = sliding_points(branch)
    assert [special.kind for special in found] == ["AS", "AS"]
    for special, low, high in zip(found, (85.0, 89.0), (88.0, 93.0), strict=True):
        exact = brentq(left, low, high, xtol=1e-13)
        assert special.frequency_hz == pytest.approx(exact, rel=1e-9)
    changes_only_there(branch)


def over_a_plane(friction=1.0):
    """What a spring holds on a plane, pulled on an ellipse; it does the same in all directions."""
    pull = (1.0, 0.5)
    dry = DryFriction("y", 1.0, friction, second_tangent="z", tangential_stiffness=SPRING)
    return System.from_matrices(
        AXES, AXES, {"y": AXES[0], "z": AXES[1]}, damping=DAMPING * AXES, dampers=[dry],
        excitation=[HarmonicForce("y", pull[0]), HarmonicForce("z", pull[1], 90.0)],
    )  # fmt: skip


def test_over_a_plane_it_slides_from_where_the_longer_axis_of_its_ellipse_says():
    branch = continue_branch(solve_orbit(over_a_plane(), 0.345), (0.34, 0.37))
    (special,) = sliding_points(branch)
    exact = brentq(lambda omega: SPRING * amplitude(omega) - 1.0, 2.0, 3.0, xtol=1e-15)
    assert special.kind == "AS"
    assert special.orbit.omega == pytest.approx(exact, rel=1e-9)


def test_what_sticks_beside_its_middle_ends_where_its_force_reaches_its_friction():
    branch = continue_branch(solve_orbit(over_a_plane(), 0.37), (0.33, 0.38))
    (reason,) = (each for each in branch.stop_reasons if each.ending is Ending.BEGINS_TO_SLIDE)
    assert reason.values["at"] == "y"
    assert not reason.broken_off
    orbit = min(branch.points, key=lambda each: each.omega)
    assert reason.values["place"] == f"{orbit.frequency_hz:.9g} Hz"
    ellipse = np.exp(1j * np.array([0.0, 0.5 * math.pi])) * [1.0, 0.5]
    swing = ellipse / (1.0 + SPRING - orbit.omega**2 + 1j * DAMPING * orbit.omega)
    flow = orbit.problem.flow
    middle = SPRING / (1.0 + SPRING) * flow.places(orbit.problem.nodes(orbit.point))[0]
    places = flow.places(orbit.problem.nodes(orbit.point))[0]
    phases = np.linspace(0.0, TURN, 100001)
    strain = middle - places + np.real(np.exp(1j * phases)[:, None] * swing)
    assert SPRING * np.hypot(*strain.T).max() == pytest.approx(1.0, rel=1e-6)


def test_meaning_files_and_what_is_refused(tmp_path):
    branch = continue_branch(solve_orbit(block(0.8), 0.13), (0.12, 0.14))
    (special,) = branch.special_points
    form = normal_form(special)
    assert (form.name, form.side, form.stable) == ("crossing-sliding", -1, True)
    place = f"{brentq(lambda ratio: limit(ratio) - 0.8, 0.7, 0.9, xtol=1e-15) / TURN:.6g} Hz"
    assert f"it sticks twice in a period below {place}, and never above it" in form.sentence
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    assert [s.kind for s in again.special_points] == ["CS"]
    assert describe_special(again.special_points[0]) == form.sentence
    wider = continue_branch(again, (0.12, 0.158))
    assert [s.kind for s in sliding_points(wider)] == ["CS", "CS"]
    with pytest.raises(SystemModelError, match="not at CS points"):
        switch_branch(special)
    with pytest.raises(SystemModelError, match="no defining system is known of 'CS' points"):
        continue_special(special, ["frequency_hz", "friction"], [(0.1, 0.2), (0.7, 0.9)])


def word(*stretches):
    """Stretches of these modes and lengths, one after the other."""
    ends = np.cumsum([0.0, *(length for _, length in stretches)]).tolist()
    return [
        Stretch(mode, end, length) for (mode, length), end in zip(stretches, ends, strict=False)
    ]


@pytest.mark.parametrize(
    ("bare", "rich", "kind", "lengths"),
    [
        (word((1, 3.0), (-1, 3.0)), word((1, 3.0), (STUCK, 0.1), (-1, 2.9)), "CS", [0.1]),
        (word((OPEN, 5.0), (1, 1.0)), word((OPEN, 5.0), (STUCK, 0.1), (1, 0.9)), "CS", [0.1]),
        (word((1, 6.0)), word((1, 2.0), (STUCK, 0.2), (1, 3.8)), "GS", [0.2]),
        (
            word((STUCK, 6.0)),
            word((STUCK, 2.9), (1, 0.1), (STUCK, 2.9), (-1, 0.1)),
            "AS",
            [0.1] * 2,
        ),
        (  # the shortest one is none of them
            word((1, 3.0), (STUCK, 0.1), (1, 1.0), (STUCK, 2.0)),
            word((1, 3.0), (STUCK, 0.1), (1, 1.0), (STUCK, 0.8), (1, 0.3), (STUCK, 0.9)),
            "AS",
            [0.3],
        ),
    ],
)
def test_what_begins_is_told_by_what_is_left_without_it(bare, rich, kind, lengths):
    found = born(bare, rich)
    assert found.kind == kind
    assert [each.length for each in found.stretches] == lengths


@pytest.mark.parametrize(
    ("bare", "rich"),
    [
        (
            word((1, 3.0), (STUCK, 3.0)),
            word((1, 2.5), (-1, 0.5), (STUCK, 3.0)),
        ),  # it sticks as often
        (word((OPEN, 6.0)), word((OPEN, 5.0), (STUCK, 1.0))),  # a contact
        (word((1, 3.0), (-1, 3.0)), word((STUCK, 6.0))),
    ],
)
def test_what_is_no_sliding_bifurcation_has_no_name(bare, rich):
    assert born(bare, rich) is None


def two(stops=(), dampers=(), contacts=()):
    """Two masses that are pulled, with what rubs, and the same for an integration of its own."""
    mass, stiffness = np.diag([1.0, 2.0]), np.array([[3.0, -1.0], [-1.0, 3.0]])
    damping, pull, turns = 0.06 * mass + 0.01 * stiffness, np.array([2.0, 1.0]), [0.0, 60.0]
    system = System.from_matrices(
        mass, stiffness, {"x": AXES[0], "y": AXES[1]}, damping=damping, stops=stops,
        dampers=dampers,
        excitation=[HarmonicForce(*each) for each in zip("xy", pull, turns, strict=True)],
    )  # fmt: skip

    def body(omega):
        return Body(
            mass, damping, stiffness, lambda t: pull * np.cos(omega * t + np.radians(turns)),
            list(contacts), keeps=True,
        )  # fmt: skip

    return system, body


def pressed(spring=None):
    """Pressed on where a spring stops it."""
    stop = Stop("x", 60.0, 1.0, 0.3, friction=0.3, tangent="y", tangential_stiffness=spring)
    contact = Contact(AXES[1], stop.friction, 0.0, AXES[0], 60.0, 1.0, 0.3, spring)
    return two([stop], contacts=[contact])


def rubbed(spring=None):
    """Pressed on all the time."""
    dry = DryFriction("y", 1.0, 0.9, tangential_stiffness=spring)
    return two(dampers=[dry], contacts=[Contact(AXES[1], dry.law, 1.0, spring=spring)])


def first_state(orbit):
    """Displacements, speeds and places as the integration has them, where a period begins."""
    flow, system = orbit.problem.flow, orbit.system
    rows = np.array([system.participation[name] for name in "xy"])
    q, v, places = np.split(flow.to_start(orbit.problem.nodes(orbit.point)[0]), [2, 4])
    return np.concatenate([rows @ q, rows @ v, places])


def lowest(function, begin, end):
    """Least value of a function within a time, at its ends none."""
    times = np.linspace(begin, end, 2001)
    values = np.array([function(t) for t in times])
    inner = np.flatnonzero((values[1:-1] < values[:-2]) & (values[1:-1] < values[2:])) + 1
    found = [
        minimize_scalar(
            function, bounds=(times[k - 1], times[k + 1]), method="bounded",
            options={"xatol": 1e-12},
        ).fun
        for k in inner
    ]  # fmt: skip
    return min(found, default=math.inf)


def off(special, body):
    """How far the motion of a special point is from what defines it, by its own integration.

    Where the integration sticks, or slides, for a time that begins there, the square of its phase.
    """
    omega = special.orbit.omega
    start, body = first_state(special.orbit), body(omega)
    end, _ = body.followed(start, TURN / omega, 0.05 / omega)
    np.testing.assert_allclose(end, start, atol=1e-8 * np.abs(start).max())
    (contact,), found = body.contacts, [math.inf]
    fastest = max(abs(contact.slip(m(t))) for _, m in body.kept for t in m.ts)
    following = [*body.kept[1:], body.kept[0]]
    for (modes, motion), (after, later) in zip(body.kept, following, strict=True):
        (mode,), begin, last = modes, motion.t_min, motion.t_max
        body.modes = modes
        short = omega * (last - begin)
        if special.kind == "GS" and abs(mode) == 1.0:
            pace = lambda t, m=motion, s=mode: s * contact.place_pace(m(t), s)  # noqa: E731
            slip = lambda t, m=motion, s=mode: s * contact.slip(m(t))  # noqa: E731
            found.append(abs(lowest(pace if contact.spring else slip, begin, last)) / fastest)
        elif special.kind == "AS" and mode == 0.0:
            need = lambda t, m=motion: body.grip(0, m(t)) - abs(body.holding(t, m(t), 0))  # noqa: E731
            found.append(abs(lowest(need, begin, last)) / body.grip(0, motion(begin)))
        elif special.kind == "CS" and abs(mode) == 1.0 and not np.isnan(after[0]):
            body.modes, y = [0.0], later(later.t_min)
            found.append(abs(abs(body.holding(later.t_min, y, 0)) / body.grip(0, y) - 1.0))
        elif special.kind == "CS" and np.isnan(mode) and contact.spring:
            y = later(later.t_min)
            speed = contact.stiffness * float(contact.normal @ y[2:4])
            most = contact.law.coefficient * speed
            found.append(abs(contact.spring * abs(contact.slip(y)) / most - 1.0))
        if (special.kind == "GS" and mode == 0.0) or (special.kind == "AS" and abs(mode) == 1.0):
            found.append(short**2)
    return min(found)


@pytest.mark.parametrize(
    ("made", "start", "limits", "kinds"),
    [
        (pressed(), 0.202, (0.195, 0.203), ["GS", "GS"]),
        (pressed(), 0.142, (0.1405, 0.1425), ["CS", "CS"]),
        (pressed(40.0), 0.19, (0.187, 0.192), ["CS"]),
        pytest.param(rubbed(), 0.1, (0.02, 0.14), ["AS", "CS"], marks=pytest.mark.slow),
        (rubbed(3.0), 0.1, (0.08, 0.14), ["AS"]),
    ],
)
def test_two_masses_begin_to_stick_where_an_integration_of_its_own_says(made, start, limits, kinds):
    system, body = made
    branch = continue_branch(solve_orbit(system, start), limits)
    found = sliding_points(branch)
    assert [special.kind for special in found] == kinds
    for special in found:
        assert off(special, body) < 1e-8
    changes_only_there(branch)
    assert branch.notes == ()
