"""Published cases of dry friction: J. P. Den Hartog's block, and code_aster's SDND100, 102, 104."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from den_hartog import response, with_two_stops
from scipy.optimize import brentq
from sliding import Body, Contact, Wall

from nldyn import (
    FlowMap,
    HarmonicForce,
    RigidStop,
    Stop,
    System,
    Unbalance,
    continue_branch,
    solve_orbit,
)
from nldyn.bifurcations.just_sticking import just_slips, just_sticks
from nldyn.branches.endings import Ending
from nldyn.flow.sliding import slider_measures
from nldyn.report.answer import answer_lines
from nldyn.report.results import tables_of
from nldyn.search.diagram import Diagram
from nldyn.system import DryFriction, Friction

TURN = 2.0 * math.pi


def block(share, rest=None, *, damping=0.0, stops=()):
    """Mass 1 on a spring 1, pressed on by 1 N and pulled by 1 N to and fro."""
    return System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[damping]], stops=stops,
        dampers=[DryFriction("x", 1.0, Friction(share, rest))],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip


@pytest.mark.parametrize("ratio", [0.6, 0.8, 1.25, 1.5])
@pytest.mark.parametrize("share", [0.1, 0.4])
def test_den_hartogs_phase_of_motion_without_stops(ratio, share):
    """It turns V cos(phi) away where the phase of the force is phi: sin(phi) = -f U / V."""
    size, swing = response(ratio)
    shift = -math.asin(share * swing / size)
    phase = shift if size > 0.0 else math.pi - shift
    found = solve_orbit(block(share), ratio / TURN).observed_extremes
    top = found.phases[np.argmax(found.values)]
    assert math.remainder(top - phase, TURN) == pytest.approx(0.0, abs=1e-9)
    assert found.values.max() == pytest.approx(size * math.cos(phase), rel=1e-9)


@pytest.mark.parametrize("ratio", [0.6, 0.8, 1.25])
def test_stops_begin_where_den_hartog_says(ratio):
    """From f = |V| / sqrt(U² + 1/β⁴) on the force does not turn it at once."""
    size, swing = response(ratio)
    limit = abs(size) / math.hypot(swing, ratio**-2)
    before, behind = (solve_orbit(block(limit * (1.0 + d)), ratio / TURN) for d in (-1e-5, 1e-5))
    assert before.friction[0].stuck == 0.0
    assert 0.0 < behind.friction[0].stuck < 0.01
    assert behind.max_abs_displacement == pytest.approx(limit / ratio**2, rel=5e-4)


@pytest.mark.parametrize(
    ("ratio", "share"), [(0.8, 0.9), (0.6, 0.85), (0.5, 0.8), (0.9, 0.95), (0.7, 0.88)]
)
def test_two_stops_a_cycle_are_those_of_pieces_in_closed_form(ratio, share):
    known = with_two_stops(ratio, share)
    orbit = solve_orbit(block(share), ratio / TURN)
    (found,) = orbit.friction
    assert known.rests > 0.1
    assert orbit.max_abs_displacement == pytest.approx(known.top, rel=1e-9)
    assert found.stuck == pytest.approx(known.rests, abs=1e-8)
    assert found.loss == pytest.approx(4.0 * share * known.top, rel=1e-9)


SHAW = [(0.6, 0.5, 0.6), (0.5, 0.4, 0.6), (0.5, 0.6, 0.8), (0.7, 0.7, 0.8), (0.45, 0.7, 0.9)]


@pytest.mark.parametrize(("ratio", "share", "rest"), SHAW)
def test_two_stops_with_more_friction_at_rest_are_those_of_pieces_in_closed_form(
    ratio, share, rest
):
    """S. W. Shaw (1986): the place of a stop tells the next one, by half a cycle's slope."""
    known = with_two_stops(ratio, share, rest)
    orbit = solve_orbit(block(share, rest), ratio / TURN)
    assert orbit.max_abs_displacement == pytest.approx(known.top, rel=1e-9)
    assert orbit.friction[0].stuck == pytest.approx(known.rests, abs=1e-8)
    assert orbit.friction[0].loss == pytest.approx(4.0 * share * known.top, rel=1e-9)
    largest, least = sorted(np.abs(orbit.multipliers), reverse=True)
    assert largest == pytest.approx(known.slope**2, abs=1e-8)
    assert least < 1e-12  # what sticks forgets its speed


def test_more_friction_at_rest_takes_the_stability_of_two_stops():
    """There half a cycle changes the place of a stop by as much as that before it was changed."""
    start = solve_orbit(block(0.4, 0.8), 0.5 / TURN)
    branch = continue_branch(start, (0.5 / TURN, 0.65 / TURN))
    (lost,) = branch.special_points

    def slope(ratio):
        return with_two_stops(ratio, 0.4, 0.8).slope ** 2 - 1.0

    assert lost.kind == "BP"
    turned = brentq(slope, 0.55, 0.65, xtol=1e-14)
    assert TURN * lost.frequency_hz == pytest.approx(turned, rel=1e-9)
    last = branch.points[-1]
    known = with_two_stops(0.65, 0.4, 0.8)
    assert not last.stable
    assert last.max_abs_displacement == pytest.approx(known.top, rel=1e-8)
    assert np.abs(last.multipliers).max() == pytest.approx(known.slope**2, rel=1e-6)


def test_motions_with_one_stop_a_cycle_end_where_that_takes_no_time():
    """Of unequal halves; with none at the upper end, and one more at the lower one."""
    branch = continue_branch(solve_orbit(block(0.4, 0.8), 0.62 / TURN), (0.5 / TURN, 0.75 / TURN))
    assert {reason.ending for reason in branch.stop_reasons} == {Ending.JUST_STICKS}
    last = max(branch.points, key=lambda orbit: orbit.omega)

    def missing(ratio):
        """Friction at rest beyond the force with which motion without stops turns."""
        size, swing = response(ratio)
        return 0.8 - ratio**2 * math.sqrt(size**2 - (0.4 * swing) ** 2)

    assert last.omega == pytest.approx(brentq(missing, 0.62, 0.75, xtol=1e-14), rel=1e-8)
    assert last.friction[0].stuck < 1e-6
    assert just_sticks(last) is not None
    assert just_sticks(branch.points[len(branch.points) // 2]) is None
    assert just_sticks(solve_orbit(block(0.4, 0.8), 0.7 / TURN)) is None


def test_a_branch_ends_where_the_pull_just_reaches_the_friction_at_rest():
    """Its peak: the whole force of 1 N with that of the spring of 1 N/m at the place of rest."""
    law = Friction(0.9, at_rest=1.0)
    pulled = System.from_matrices(
        [[1.0]], [[1.0]], {"x": [1.0]}, damping=[[0.05]], dampers=[DryFriction("x", 1.0, law)],
        excitation=[HarmonicForce("x", 1.0)],
    )  # fmt: skip
    start = solve_orbit(pulled, 0.4 / TURN)
    branch = continue_branch(start, (0.89, 1.0), parameter="friction")
    end, reason = branch.nodes[-1], branch.stop_reasons[1]
    assert reason.ending is Ending.JUST_SLIPS and reason.values["at"] == "x"
    place = abs(float(end.orbit.states(np.array([math.pi]))[0, 0]))
    assert end.value + 0.1 == pytest.approx(1.0 + place, rel=1e-9)
    assert abs(end.orbit.multipliers[0]) > 1e6
    assert just_slips(end.orbit) is not None and just_slips(start) is None


def test_a_block_slides_up_to_where_the_whole_force_is_friction():
    """From μN = P on it never slips, wherever it lies within its friction."""
    branch = continue_branch(solve_orbit(block(0.9), 0.3 / TURN), (0.9, 1.5), parameter="friction")
    (reason,) = (each for each in branch.stop_reasons if each.ending is Ending.STICKS)
    assert reason.values == {"at": "x", "place": "friction = 1"}
    assert not reason.broken_off
    assert branch.values.max() < 1.0
    found = Diagram((branch,), (0.9, 1.5), "x", parameter=branch.parameter)
    *_, missing, _ = answer_lines(found, tables_of(found)["special_points"])
    assert "nothing stable" in missing and missing.endswith(reason)


@pytest.mark.parametrize(("mu", "ratio"), [(0.5, math.sqrt(0.5)), (0.9, math.sqrt(0.9))])
def test_a_block_slides_down_to_where_the_force_of_an_unbalance_is_its_friction(mu, ratio):
    pushed = replace(block(mu, damping=0.1), excitation=[Unbalance("x", 1.0)])
    branch = continue_branch(solve_orbit(pushed, 1.2 / TURN), (0.2 / TURN, 1.2 / TURN))
    (reason,) = (each for each in branch.stop_reasons if each.ending is Ending.STICKS)
    assert float(reason.values["place"].split()[0]) == pytest.approx(ratio / TURN, rel=1e-5)


def test_what_sticks_in_series_with_a_mass_is_a_clamp_for_it():
    """The force of the spring between x, which has friction, and y, with x held."""
    stiffness = np.array([[2.0, -1.0], [-1.0, 2.0]])
    system = System.from_matrices(
        np.eye(2), stiffness, {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=0.1 * np.eye(2),
        dampers=[DryFriction("x", 1.0, 0.3)], excitation=[HarmonicForce("y", 1.0)],
    )  # fmt: skip
    omega = 0.75
    branch = continue_branch(solve_orbit(system, omega / TURN), (0.2, 1.5), parameter="friction")
    (reason,) = (each for each in branch.stop_reasons if each.ending is Ending.STICKS)
    held = 1.0 / abs(complex(2.0 - omega**2, 0.1 * omega))
    assert float(reason.values["place"].split()[-1]) == pytest.approx(held, rel=1e-5)


@pytest.mark.parametrize(("ratio", "larger"), [(0.6, 1.2), (0.7, 1.2), (0.7, 2.0)])
def test_more_friction_at_rest_stops_what_turns_with_less_force(ratio, larger):
    """Without stops it turns with the force β² k X, whatever friction would be at rest."""
    size, swing = response(ratio)
    limit = size / math.hypot(swing, larger / ratio**2)
    before, behind = (
        solve_orbit(block(share, larger * limit), ratio / TURN)
        for share in (limit * (1.0 - 1e-5), limit * (1.0 + 1e-5))
    )
    assert before.friction[0].stuck == 0.0
    assert 0.0 < behind.friction[0].stuck < 0.01
    assert before.max_abs_displacement == pytest.approx(larger * limit / ratio**2, rel=5e-4)


@pytest.mark.parametrize(("ratio", "share"), [(0.8, 0.3), (0.5, 0.6)])
def test_a_block_between_rigid_stops_moves_as_in_an_independent_integration(ratio, share):
    gap, restitution = 0.4, 0.7
    stops = [RigidStop("x", restitution, gap, sign) for sign in (1, -1)]
    orbit = solve_orbit(block(share, damping=0.1, stops=stops), ratio / TURN)
    assert orbit.impacts > 0 and orbit.friction[0].loss > 0.0
    one = np.eye(1)
    body = Body(
        one, 0.1 * one, one, lambda t: np.cos(ratio * t) * np.ones(1),
        [Contact(np.ones(1), Friction(share), 1.0)],
        [Wall(sign * np.ones(1), gap, restitution) for sign in (1.0, -1.0)],
    )  # fmt: skip
    start = orbit.states(np.zeros(1))[0]
    end, _ = body.followed(start, orbit.duration, 0.2 / ratio)
    assert end == pytest.approx(start, abs=1e-8)
    assert orbit.friction[0].distance == pytest.approx(body.way[0], rel=1e-8)
    assert orbit.friction[0].stuck == pytest.approx(body.stuck[0] / orbit.duration, abs=1e-8)


def test_a_shoe_that_is_let_go_turns_where_code_aster_says():
    """V5.01.100, SDND100, along Y: half swings of 0.85 mm, less 0.2 mm each."""
    shoe = System.from_matrices(
        [[1.0]], [[1e4]], {"y": [1.0]}, dampers=[DryFriction("y", 10.0, 0.1)]
    )
    flow, start = FlowMap(shoe), np.array([0.85e-3, 0.0])
    ends = [-4.596e-4, 3.182e-4, -1.768e-4, 3.536e-5, 3.536e-5]
    for half, told in enumerate(ends, 1):
        found = flow.shoot(flow.to_state(start[None]), np.array([0.0, half * math.pi]), 100.0)
        along = flow.to_modal(found.ends)[0, 0] * math.sqrt(0.5)
        assert along == pytest.approx(told, rel=2e-4)  # four digits are told


def shoe_on_a_table(acceleration, spring):
    """A mass of 1 kg, pressed on by 10 N, on a table that is shaken once a second."""
    return System.from_matrices(
        [[1.0]], [[spring]], {"x": [1.0]}, dampers=[DryFriction("x", 10.0, 0.1)],
        excitation=[HarmonicForce("x", acceleration, phase_deg=-90.0)],
    )  # fmt: skip


def work_rate(system):
    """Its mean from the 4th to the 12th second after rest, in W."""
    flow, times = FlowMap(system), 2.0 * math.pi * np.array([0.0, 4.0, 12.0])
    start = flow.shoot(np.zeros((1, system.state_size)), times[:2], TURN).ends[:1]
    (found,) = slider_measures(flow.trajectory(start, times[1:], TURN))
    return found.work_rate


def slid_in_pieces(acceleration):
    """The same without a spring, from one end of sliding to the next in closed form."""
    pull, way, sign, phase = acceleration / TURN, 0.0, 0.0, 0.0

    def place(start, sign, end):
        turned = end - start
        swung = math.cos(start) * turned - math.sin(end) + math.sin(start)
        return (pull * swung - 0.5 * sign * turned**2 / TURN) / TURN

    def speed(start, sign, end):
        return pull * (math.cos(start) - math.cos(end)) - sign * (end - start) / TURN

    while phase < 12.0 * TURN:
        if sign == 0.0:  # it rests until the table takes more than its friction
            least = math.asin(1.0 / acceleration)
            turns = math.ceil((phase - least) / math.pi - 1e-12)
            inside = abs(acceleration * math.sin(phase)) >= 1.0
            phase = phase if inside else turns * math.pi + least
            sign = math.copysign(1.0, math.sin(phase))
        ahead = phase + np.linspace(1e-3, 2.0 * TURN, 4000)
        rates = np.array([sign * speed(phase, sign, each) for each in ahead])
        first = int(np.argmax(rates < 0.0))
        end = brentq(partial(speed, phase, sign), ahead[first - 1], ahead[first])
        low, high = max(phase, 4.0 * TURN), min(end, 12.0 * TURN)
        if low < high:
            way += abs(place(phase, sign, high) - place(phase, sign, low))
        slides = abs(acceleration * math.sin(end)) > 1.0
        sign, phase = (math.copysign(1.0, math.sin(end)) if slides else 0.0), end
    return 10.0 * way / 8.0


@pytest.mark.parametrize(
    ("acceleration", "told", "digits"),
    [(15.0, 15.2671, 5e-5), (1.5, 0.409062, 5e-6), (1.01, 2.26164e-4, 5e-6)],
)
def test_the_work_rate_of_a_shoe_on_a_table_is_that_of_code_aster(acceleration, told, digits):
    """V5.01.104, SDND104, whose own tolerance is 5e-4; it slides all the time, or sticks, too."""
    assert work_rate(shoe_on_a_table(acceleration, 3e-5)) == pytest.approx(told, rel=digits)
    free = work_rate(shoe_on_a_table(acceleration, 0.0))
    assert free == pytest.approx(slid_in_pieces(acceleration), rel=1e-8)


def test_a_shoe_that_the_table_takes_with_it_wears_nothing():
    """V5.01.104: at 0.99 m/s² friction holds it."""
    assert work_rate(shoe_on_a_table(0.99, 3e-5)) == 0.0


def test_two_masses_meet_as_one_meets_a_wall():
    """V5.01.102, SDND102, without friction: supports shaken against each other.

    The places that code_aster gives come from small steps, good to 3e-5 m by its own tolerance.
    """
    m, k, w, gap = 25.0, 98696.0, 20.0 * math.pi, 5e-4
    c = 0.14 * math.sqrt(k * m)

    def shaken(name, turned):
        """Forces of a support that is displaced by -sin(ωt)/ω², or against that."""
        return [
            HarmonicForce(name, k / w**2, phase_deg=90.0 + turned),
            HarmonicForce(name, c / w, phase_deg=180.0 + turned),
        ]

    one = System.from_matrices(
        [[m]], [[k]], {"x": [1.0]}, damping=[[c]], stops=[Stop.linear("x", 5.76e7, gap=gap)],
        excitation=shaken("x", 0.0),
    )  # fmt: skip
    two = System.from_matrices(
        m * np.eye(2), k * np.eye(2), {"x": [1.0, 0.0], "y": [0.0, 1.0]}, damping=c * np.eye(2),
        stops=[Stop.linear("x", 2.88e7, gap=2.0 * gap, against="y")],
        excitation=[*shaken("x", 0.0), *shaken("y", 180.0)],
    )  # fmt: skip
    told = {0.05: -3.58082e-4, 0.156: -1.22321e-4, 0.25: -1.8876e-4, 0.4: -1.89772e-4,
            0.5: -6.84454e-5, 0.8: -1.11982e-4, 0.9: -1.20103e-4, 1.0: -1.07178e-4}  # fmt: skip
    speeds = np.array([-1.0, 1.0]) / w
    for time, place in told.items():
        at = []
        for system in (one, two):
            n, flow = system.size, FlowMap(system)
            rows = np.array([system.participation[name] for name in system.interfaces])
            start = np.concatenate([np.zeros(n), np.linalg.solve(rows, speeds[:n])])
            found = flow.shoot(flow.to_state(start[None]), np.array([0.0, w * time]), w)
            at.append(float(rows[0] @ flow.to_modal(found.ends)[0, :n]))
        assert at[1] == pytest.approx(at[0], abs=1e-9 * gap)
        assert at[0] == pytest.approx(place, abs=3e-6)
