"""Special points that a user asks for: zeros and extremes of functions of orbits, resonances."""

import math

import numpy as np
import pytest

from nldyn import (
    ContinuationOptions,
    Event,
    HarmonicForce,
    SceneError,
    Stop,
    System,
    SystemModelError,
    continue_branch,
    describe_special,
    load,
    save,
    solve_orbit,
)
from nldyn.plot import plot_diagram
from nldyn.scene.read import parse_scene
from nldyn.scene.run import compute

RATIO, HZ, FORCE = 0.05, 10.0, 3.0
RESONANCES = ("amplitude resonance", "phase resonance")


def oscillator(stops=()):
    return System.from_modal(
        [HZ], {"m": [1.0]}, modal_damping=RATIO, stops=list(stops),
        excitation=[HarmonicForce("m", FORCE)],
    )  # fmt: skip


def height(hz):
    natural, omega = 2.0 * math.pi * HZ, 2.0 * math.pi * hz
    return FORCE / abs(natural**2 - omega**2 + 2j * RATIO * natural * omega)


def of_kind(branch, kind):
    return [special.value for special in branch.special_points if special.kind == kind]


@pytest.fixture(scope="module")
def branch():
    half = Event("half", lambda orbit: orbit.max_abs_displacement / height(HZ) - 0.5)
    return continue_branch(solve_orbit(oscillator(), 6.0), (5.0, 20.0), events=[*RESONANCES, half])


def test_resonances_are_where_the_linear_response_has_them(branch):
    """The amplitude is largest at f sqrt(1 - 2ζ²), the lag is a quarter of a turn at f."""
    assert of_kind(branch, RESONANCES[0]) == pytest.approx(
        [HZ * math.sqrt(1.0 - 2.0 * RATIO**2)], rel=1e-10
    )
    assert of_kind(branch, RESONANCES[1]) == pytest.approx([HZ], rel=1e-11)


def test_a_function_of_the_user_is_zero_at_its_points(branch):
    found = of_kind(branch, "half")
    assert len(found) == 2
    assert [height(hz) for hz in found] == pytest.approx([0.5 * height(HZ)] * 2, rel=1e-11)
    places = [special.point.arclength for special in branch.special_points]
    assert places == sorted(places)


def test_resonance_over_the_natural_frequency():
    """Driven at ω, the displacement is largest where that of 1/|ω₀² - ω² + 2iζω₀ω| is."""
    found = continue_branch(
        solve_orbit(oscillator(), 9.0), (6.0, 14.0), parameter="natural_frequency_hz",
        events=["amplitude resonance"],
    )  # fmt: skip
    assert of_kind(found, "amplitude resonance") == pytest.approx(
        [9.0 * math.sqrt(1.0 - 2.0 * RATIO**2)], rel=1e-8
    )


def test_the_resonance_against_a_stop_is_that_of_a_finer_search():
    """And stays where it is when the branch goes on, from a file too."""
    stop = Stop.linear("m", 2e3, gap=2e-3)
    start = solve_orbit(oscillator([stop]), 7.0)
    short = continue_branch(start, (6.0, 12.0), events=["amplitude resonance"])
    (hz,) = of_kind(short, "amplitude resonance")
    (top,) = short.at(hz)
    beside = [short.at(hz * (1.0 + way))[0] for way in (-1e-5, 1e-5)]
    assert all(orbit.max_abs_displacement < top.max_abs_displacement for orbit in beside)
    assert np.diff([o.max_abs_displacement for o in beside])[0] == pytest.approx(
        0.0, abs=1e-9 * top.max_abs_displacement
    )
    assert of_kind(continue_branch(short, (5.0, 13.0)), "amplitude resonance") == [hz]


def test_events_are_saved_told_and_drawn(branch, tmp_path):
    save(branch, tmp_path / "branch.h5")
    (again,) = load(tmp_path / "branch.h5")
    kinds = [special.kind for special in branch.special_points]
    assert again.table("special_points")["type"].tolist() == kinds
    with pytest.raises(SystemModelError, match="the event 'half' is a function of yours"):
        continue_branch(again, (4.0, 21.0))
    longer = continue_branch(again, (4.0, 21.0), events=branch.course.events)
    assert of_kind(longer, "half") == of_kind(branch, "half")
    resonance = branch.special_points[kinds.index(RESONANCES[0])]
    assert describe_special(resonance).startswith("Amplitude resonance at 9.97496")
    labels = {text.get_text() for text in plot_diagram([branch]).get_legend().get_texts()}
    assert {*RESONANCES, "half"} <= labels


SCENE = """
[matrices]
mass = [[1.0]]
stiffness = [[100.0]]
damping = [[1.0]]
interfaces.x = [1.0]
[[excitation]]
at = "x"
kind = "harmonic"
amplitude = 1.0
[continuation]
range_hz = [1.2, 2.0]
periods = [1]
search_points = 1
events = ["amplitude resonance", "phase resonance"]
"""


def test_a_scene_names_its_events():
    """ω₀ = 10 rad/s and ζ = 0.05."""
    (found,) = compute(parse_scene(SCENE)).branches
    hz = 10.0 / (2.0 * math.pi)
    assert [s.value for s in found.special_points] == pytest.approx(
        [hz * math.sqrt(1.0 - 2.0 * 0.05**2), hz], rel=1e-10
    )
    two = SCENE + '[[excitation]]\nat = "x"\nkind = "harmonic"\namplitude = 2.0\n'
    with pytest.raises(SceneError, match="behind one source that swings, but there are 2"):
        compute(parse_scene(two))


def test_an_event_that_jumps_is_a_note():
    step = Event("step", lambda orbit: 1.0 if orbit.frequency_hz > 9.0 else -1.0)
    found = continue_branch(solve_orbit(oscillator(), 6.0), (5.0, 20.0), events=[step])
    assert not found.special_points
    assert "step near" in found.notes[0] and "its function jumps there" in found.notes[0]


@pytest.mark.parametrize(
    ("events", "words"),
    [
        ("phase resonance", "events must be a list"),
        (["resonances"], "events must be one of"),
        ([3], "function must be one of an orbit"),
        ([lambda orbit: math.nan], "its function gives nan"),
        (["phase resonance"] * 2, "is given twice"),
    ],
)
def test_events_that_make_no_sense_are_refused(events, words):
    few = ContinuationOptions(max_points=2)
    with pytest.raises(SystemModelError, match=words):
        continue_branch(solve_orbit(oscillator(), 6.0), (5.0, 20.0), options=few, events=events)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("LP", len), "kind must be a name of its own"),
        (("far", 3), "function must be one of an orbit"),
        (("far", len, "top"), "where must be one of zero, maximum, minimum"),
    ],
)
def test_what_is_no_event_is_refused(arguments, words):
    with pytest.raises(SystemModelError, match=words):
        Event(*arguments)
