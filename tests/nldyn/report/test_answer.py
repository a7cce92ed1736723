"""The five lines with which a run and its report begin."""

from dataclasses import replace

import numpy as np
import pytest

from nldyn import RigidStop, Stop, System, Unbalance, continue_branch, diagram, solve_orbit
from nldyn.report.answer import answer_lines
from nldyn.report.results import tables_of
from nldyn.search.diagram import Diagram

MASS, STIFFNESS, RATIO, UNBALANCE = 2.48, 16877.0, 0.0142, 4.92e-6
NATURAL = np.sqrt(STIFFNESS / MASS)


def oscillator(**more):
    return System.from_matrices(
        [[MASS]], [[STIFFNESS]], {"middle": [1.0]}, modal_damping=RATIO,
        excitation=[Unbalance("middle", UNBALANCE)], **more,
    )  # fmt: skip


def diagram_of(system, limits=(10.0, 18.0)):
    branch = continue_branch(solve_orbit(system, 10.0), limits)
    return Diagram((branch,), limits, "middle")


def lines_of(found):
    return answer_lines(found, tables_of(found)["special_points"])


def test_a_linear_resonance_has_its_peak_where_theory_says_and_is_stable_throughout():
    """Unbalance: the peak is at ω_n / sqrt(1 - 2 ζ²), u / m / (2 ζ sqrt(1 - ζ²)) high."""
    found = diagram(oscillator(), (10.0, 16.0), [1], search_points=1)
    peak, force, stable, missing, jumps = lines_of(found)
    value, unit, _, hz, *_ = peak.split(": ")[1].split()
    exact = UNBALANCE / MASS / (2.0 * RATIO * np.sqrt(1.0 - RATIO**2))
    assert unit == "µm" and float(value) == pytest.approx(1e6 * exact, rel=2e-3)
    at = NATURAL / np.sqrt(1.0 - 2.0 * RATIO**2) / (2.0 * np.pi)
    assert float(hz) == pytest.approx(at, rel=2e-3)
    assert force.endswith("there are no stops")
    assert stable == "stable and periodic: 10 to 16 Hz"
    assert missing == "ranges where nothing stable was found: none"
    assert jumps == "jumps: none was found"


def test_a_branch_that_folds_jumps_at_its_folds_and_leaves_nothing_beyond_the_flip():
    """Hardening by a stop: up to a fold where the frequency rises, down to one where it falls."""
    system = oscillator(stops=[Stop.linear("middle", 5e3, gap=2e-5)])
    found = diagram_of(system)
    (branch,) = found.branches
    folds = [p.frequency_hz for p in branch.special_points if p.kind == "LP"]
    assert len(folds) == 2
    *_, stable, missing, jumps = lines_of(found)
    assert stable == "stable and periodic: 10 to 18 Hz" and missing.endswith(": none")
    assert jumps == (
        f"jumps: as the frequency rises past {max(folds):.5g} Hz; "
        f"as the frequency falls past {min(folds):.5g} Hz"
    )
    force = lines_of(found)[1]
    depth = max(orbit.max_penetration for orbit in branch.points if orbit.stable)
    assert f"{5e6 * depth:.4g} mN" in force and "(stable" in force


def test_rotations_are_told_in_rad_and_their_contacts_in_newton_metres():
    """The same numbers as of a displacement, in other words and units."""
    system = oscillator(stops=[Stop.linear("middle", 5e3, gap=2e-5)])
    straight, turned = (
        lines_of(diagram_of(each))
        for each in (system, replace(system, rotations=frozenset({"middle"})))
    )
    assert turned[0] == straight[0].replace("displacement", "rotation").replace("µm", "µrad")
    assert turned[1] == straight[1].replace("force", "moment").replace(" mN ", " mN m ")
    assert turned[2:] == straight[2:]


def test_forces_and_impulses_are_told_apart_where_stops_are_of_both_kinds():
    """An elastic stop on one side, a rigid one on the other: each with its own largest."""
    stops = [Stop.linear("middle", 5e3, gap=2e-5), RigidStop("middle", 0.6, gap=4e-5, direction=-1)]
    system = oscillator(stops=stops)
    found = diagram_of(system, (10.0, 12.6))
    (branch,), lines = found.branches, lines_of(found)
    assert [line.split(":")[0] for line in lines[1:3]] == [
        "largest contact force", "largest impulse of an impact"
    ]  # fmt: skip
    hits = [hit for orbit in branch.points for hit in orbit.impact_list]
    rigid = [hit.impulse for hit in hits if hit.force is None]
    assert lines[1].split(": ")[1].split()[1] in ("N", "mN")
    told = lines[2].split(": ")[1]
    assert told.startswith(f"{max(rigid):.4g} N s") if rigid else "no such stop" in told


def test_a_stop_that_never_opens_is_told_with_its_force():
    """Under a preload of 0.1 mm the mass swings on both springs."""
    found = diagram(oscillator(stops=[Stop.linear("middle", 5e3, gap=-1e-4)]), (10.0, 11.0), [1])
    (branch,) = found.branches
    assert not any(orbit.impacts for orbit in branch.points)
    value, unit, *_ = lines_of(found)[1].split(": ")[1].split()
    pressed = float(value) * {"N": 1.0, "mN": 1e-3}[unit]
    held = 5e3 * 1e-4 * STIFFNESS / (STIFFNESS + 5e3)  # what it bears at rest
    swings = branch.points[-1].max_abs_displacement + 1e-4
    assert held < pressed < 5e3 * swings


def test_stops_that_no_orbit_touches_are_told_in_one_line():
    """Also where they are of several kinds."""
    stops = [Stop.linear("middle", 5e3, gap=1.0), RigidStop("middle", 0.6, gap=1.0, direction=-1)]
    found = diagram(oscillator(stops=stops), (10.0, 11.0), [1], search_points=1)
    assert lines_of(found)[1] == "largest contact force: none, no stop is touched"
    assert len(lines_of(found)) == 5


def test_what_no_branch_covers_is_told(one_dof):
    """Beyond its flip the branch is unstable."""
    branch = continue_branch(solve_orbit(one_dof, 30.0), (30.0, 35.0))
    (flip,) = [p.frequency_hz for p in branch.special_points if p.kind == "PD"]
    *_, stable, missing, _ = lines_of(Diagram((branch,), (30.0, 35.0), "middle"))
    assert stable == f"stable and periodic: 30 to {flip:.5g} Hz"
    assert missing == f"ranges where nothing stable was found: {flip:.5g} to 35 Hz"
