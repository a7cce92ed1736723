"""What sliders do in a period: against closed forms, the balance of energy, and integration."""

import csv
import math
from itertools import product

import numpy as np
import pytest
from sliding import Body, Contact, Wall

from nldyn import (
    FlowMap,
    FlowOptions,
    HarmonicForce,
    RigidStop,
    RoundStop,
    Stop,
    System,
    continue_branch,
    impacts,
    solve_orbit,
)
from nldyn.branches.tables import UNITS, orbit_columns
from nldyn.report.answer import answer_lines
from nldyn.report.offline import unpacked
from nldyn.report.results import tables_of, write_results
from nldyn.search.diagram import Diagram
from nldyn.system import DryFriction, Friction

MASS = np.diag([1.0, 2.0, 1.5])
STIFFNESS = np.array([[3.0, -1.0, 0.0], [-1.0, 3.0, -0.5], [0.0, -0.5, 2.0]])
DAMPING = 0.05 * STIFFNESS + 0.02 * MASS
FORCES = np.array([2.0, 1.0, 0.5])
FALLING = Friction(0.3, 0.45, 0.2, base_speed=0.1)
NAMES = ("x", "y", "z")


def block(share):
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, dampers=[DryFriction("x", 1.0, share)],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip


def structure(walled):
    """Three bodies: one slides where a spring stops another, one all the time."""
    walls = [RigidStop("x", 0.7, 0.9, -1)] if walled else []
    return System.from_matrices(
        MASS, STIFFNESS, dict(zip(NAMES, np.eye(3), strict=True)), damping=DAMPING,
        stops=[Stop("x", 60.0, 1.5, 0.3, friction=FALLING, tangent="y"), *walls],
        dampers=[DryFriction("z", 0.5, 0.6)],
        excitation=[HarmonicForce(name, f) for name, f in zip(NAMES, FORCES, strict=True)],
    )  # fmt: skip


@pytest.mark.parametrize("ratio", [0.6, 0.8, 1.25])
def test_a_block_that_slides_all_the_time_loses_four_times_friction_and_amplitude(ratio):
    """J. P. Den Hartog (1931): no stops at these ratios, and a way of four amplitudes."""
    orbit = solve_orbit(block(0.4), ratio / (2.0 * math.pi))
    (found,) = orbit.friction
    size = orbit.max_abs_displacement
    assert found.loss == pytest.approx(4.0 * 0.4 * size, rel=1e-11)
    assert found.distance == pytest.approx(4.0 * size, rel=1e-11)
    assert found.pressed_distance == pytest.approx(4.0 * size, rel=1e-11)  # of 1 N
    assert found.power == pytest.approx(found.loss / orbit.duration, rel=1e-14)
    assert found.peak_force == pytest.approx(0.4, rel=1e-12)
    assert (found.stuck, found.slid, found.open) == pytest.approx((0.0, 1.0, 0.0), abs=1e-14)


def test_a_block_that_is_held_loses_nothing_and_is_held_by_what_pulls_it():
    orbit = solve_orbit(FlowMap(block(1.5), FlowOptions(rtol=1e-11)), 0.1)
    (found,) = orbit.friction
    assert (found.stuck, found.slid, found.loss, found.distance) == (1.0, 0.0, 0.0, 0.0)
    spring = abs(orbit.max_abs_displacement)  # wherever it is held
    assert found.peak_force == pytest.approx(1.0 + spring, abs=1e-9)


def over_a_period(orbit):
    """Times that nodes of our own stand for, their phases, and places and speeds there."""
    ends = np.append(orbit.trajectory.record.phase, 2.0 * math.pi * orbit.period)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    half = 0.5 * np.diff(ends)[:, None]
    phases = (ends[:-1, None] + half * (1.0 + nodes)).ravel()
    rows = np.array([orbit.system.participation[name] for name in NAMES]).T
    places, speeds = np.split(orbit.states(phases), 2, axis=1)
    return (half * weights).ravel() / orbit.omega, phases, places @ rows, speeds @ rows


def left_over(orbit):
    """Work of the excitation in a period less what dampers take."""
    lengths, phases, _, speeds = over_a_period(orbit)
    work = lengths @ (np.cos(phases) * (speeds @ FORCES))
    return work - lengths @ ((speeds @ DAMPING) * speeds).sum(axis=1)


def brought_by_belt(orbit):
    """What the belts bring: the impulse of friction along y or z is that of the springs."""
    lengths, _, places, _ = over_a_period(orbit)
    springs = dict(zip(NAMES, lengths @ places @ STIFFNESS, strict=True))
    return math.fsum(
        speed * springs[at]
        for slider in orbit.system.sliders
        for (at, _), speed in zip(slider.ends, slider.friction.base_speeds, strict=False)
    )


def brought_by_surface(orbit):
    """The same of a surface in a round clearance that slides one way all the time."""
    lengths, _, places, _ = over_a_period(orbit)
    (ring,) = orbit.system.stops
    depth = np.hypot(*places[:, :2].T) - ring.clearance
    force = ring.stiffness * np.maximum(depth, 0.0) ** ring.exponent
    return abs(ring.sliding_speed) * ring.friction * (lengths @ force)


STICKING = pytest.mark.parametrize(("walled", "hz"), [(False, 0.3), (True, 0.1)])


@STICKING
def test_what_the_excitation_gives_is_what_dampers_friction_and_impacts_take(walled, hz):
    orbit = solve_orbit(structure(walled), hz)
    hits = impacts(orbit)
    rigid = math.fsum(hits.loss[hits.stop == 1])
    assert (rigid > 1e-2) == walled
    lost = [found.loss for found in orbit.friction]
    assert min(lost) > 1e-2
    given = left_over(orbit) + brought_by_belt(orbit)
    assert given == pytest.approx(math.fsum(lost) + rigid, rel=1e-9)


BELTS = (0.05, -2.0)
ELASTIC = ("force", "linear", "Hertz")
ALONG_Y = {
    "alone": {},
    "spring": {"tangential_stiffness": 5.0},
    "plane": {"tangential_stiffness": 5.0, "second_tangent": "z"},
}


def rubbing(stops=(), dampers=()):
    return System.from_matrices(
        MASS, STIFFNESS, dict(zip(NAMES, np.eye(3), strict=True)), damping=DAMPING, stops=stops,
        dampers=dampers,
        excitation=[HarmonicForce(name, f) for name, f in zip(NAMES, FORCES, strict=True)],
    )  # fmt: skip


def pressed_on(by, along, belt):
    """What slides along y, on a belt: pressed on by a force or a stop along x."""
    law = Friction(0.3, base_speed=(belt, -0.5 * belt) if along == "plane" else belt)
    if by == "force":
        return rubbing(dampers=[DryFriction("y", 1.5, law, **ALONG_Y[along])])
    if by == "rigid":
        return rubbing([RigidStop("x", 0.7, 0.9, friction=law, tangent="y")])
    how = {"friction": law, "tangent": "y", **ALONG_Y[along]}
    return rubbing([Stop("x", 60.0, 1.5 if by == "Hertz" else 1.0, 0.3, **how)])


@pytest.mark.parametrize("belt", BELTS)
@pytest.mark.parametrize(("by", "along"), [*product(ELASTIC, ALONG_Y), ("rigid", "alone")])
def test_losses_and_wear_are_what_the_balance_of_energy_leaves(by, along, belt):
    orbit = solve_orbit(pressed_on(by, along, belt), 0.3)
    (found,) = orbit.friction
    rigid = math.fsum(impacts(orbit).loss) if by == "rigid" else 0.0
    assert found.loss > 1e-3
    given = left_over(orbit) + brought_by_belt(orbit)
    assert found.loss + rigid == pytest.approx(given, rel=1e-9)
    if by != "rigid":
        assert found.pressed_distance == pytest.approx(found.loss / 0.3, rel=1e-12)
    if by == "force":
        assert found.distance == pytest.approx(found.loss / (0.3 * 1.5), rel=1e-9)


@pytest.mark.parametrize("surface", [0.0, 5.0, -5.0])
def test_losses_in_a_round_clearance_are_what_the_balance_of_energy_leaves(surface):
    ring = RoundStop(("x", "y"), 60.0, 0.3, 1.0, friction=0.2, surface_speed=surface)
    orbit = solve_orbit(rubbing([ring]), 0.3)
    (found,) = orbit.friction
    assert found.loss > 1e-3 and found.open > 0.0
    given = left_over(orbit) + (brought_by_surface(orbit) if surface else 0.0)
    assert found.loss == pytest.approx(given, rel=1e-9)
    assert found.pressed_distance == pytest.approx(found.loss / 0.2, rel=1e-12)


@STICKING
def test_shares_and_ways_are_those_of_integration_from_event_to_event(walled, hz):
    orbit = solve_orbit(structure(walled), hz)
    unit, at = np.eye(3), np.array([orbit.system.participation[name] for name in NAMES])
    contacts = [Contact(unit[1], FALLING, 0.0, unit[0], 60.0, 1.5, 0.3)]
    contacts.append(Contact(unit[2], Friction(0.6), 0.5))
    walls = [Wall(-unit[0], 0.9, 0.7)] if walled else []
    body = Body(
        MASS, DAMPING, STIFFNESS, lambda t: FORCES * math.cos(orbit.omega * t), contacts, walls
    )
    first = orbit.states(np.array([0.0]))[0]
    start = np.concatenate([at @ first[:3], at @ first[3:]])
    body.followed(start, orbit.duration, 0.2 / orbit.omega)
    assert body.stuck[0] > 0.01 * orbit.duration  # at the stop
    for i, found in enumerate(orbit.friction):
        assert found.stuck == pytest.approx(body.stuck[i] / orbit.duration, abs=1e-8)
        assert found.slid == pytest.approx(body.slid[i] / orbit.duration, abs=1e-8)
        assert found.distance == pytest.approx(body.way[i], rel=1e-8)
        assert found.stuck + found.slid + found.open == pytest.approx(1.0, abs=1e-14)


@pytest.fixture(scope="module")
def diagram_of_block():
    limits = (0.06, 0.1)
    branch = continue_branch(solve_orbit(block(0.4), 0.1), limits)
    return Diagram((branch,), limits, "x")


def test_tables_and_answer_tell_the_loss_of_a_period_and_how_long_it_sticks(diagram_of_block):
    orbits = diagram_of_block.branches[0].points
    table = orbit_columns(orbits)
    sizes = table["max_abs_displacement_m"]
    np.testing.assert_allclose(table["friction_loss_j"], 1.6 * sizes, rtol=1e-9)  # symmetric
    assert table["stuck_share"].min() == 0.0 and table["stuck_share"].max() > 0.3
    assert (UNITS["friction_loss_j"], UNITS["stuck_share"]) == ("J", "1")
    line = answer_lines(diagram_of_block, tables_of(diagram_of_block)["special_points"])[2]
    assert line.startswith(
        f"largest loss by friction: {1.6 * max(sizes):.4g} J per excitation period at 0.1 Hz"
    )


def test_the_report_has_a_row_for_each_slider_and_columns_over_the_branch(
    diagram_of_block, tmp_path
):
    folder = write_results(diagram_of_block, tmp_path / "out")
    with (folder / "branches.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    orbits = diagram_of_block.branches[0].points
    assert [float(row["stuck_share"]) for row in rows] == [o.friction[0].stuck for o in orbits]
    content = unpacked((folder / "report.html").read_text(encoding="utf-8"))
    assert content["friction"][:3] == ["slider", "largest friction (N)", "distance (m)"]
    assert (folder / "contact.png").is_file() and content["contact"]
    for shown in content["orbits"]:
        (row,) = shown["friction"]
        told = dict(zip(content["friction"], row, strict=True))
        assert told["slider"] == "friction at 'x'"
        assert told["loss (J)"] == pytest.approx(1.6 * shown["y"], rel=1e-9)
        assert told["stuck (share)"] + told["slid (share)"] == pytest.approx(1.0, abs=1e-14)
