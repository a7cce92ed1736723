"""A computation that fails is a result: how far it came and why, never a number that is none."""

import csv
import json
import math

import numpy as np
import pytest
from limited_commands import command

from nldyn import (
    ConvergenceError,
    ExploreOptions,
    HarmonicForce,
    StatePlane,
    Stop,
    System,
    Unbalance,
    basins,
    explore,
    find_attractors,
    solve_orbit,
    sweep,
)

ONE = """
[matrices]
mass = [[1.0]]
stiffness = [[1e4]]
interfaces.a = [1.0]
[damping]
modal_ratio = {damping}
[[stops]]
at = "a"
stiffness = {stiffness}
gap = {gap}
[[excitation]]
at = "a"
kind = "harmonic"
amplitude = {force}
[continuation]
range_hz = {range_hz}
periods = [1]
search_points = 2
rtol = 1e-7
"""
PLAIN = {"damping": 0.01, "stiffness": 1e8, "gap": 1e-4, "force": 1.0, "range_hz": [14.0, 18.0]}


def computed(folder, **values):
    """Exit code, what is said, and the tables of a scene with other values."""
    file, out = folder / "scene.toml", folder / "out"
    file.write_text(ONE.format(**{**PLAIN, **values}))
    result = command("run", file, "--out", out, "--quiet", seconds=150.0)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    tables = {}
    for name in ("branches", "ends", "special_points"):
        with (out / f"{name}.csv").open(newline="") as table:
            tables[name] = list(csv.DictReader(table))
    check_numbers(tables)
    assert (out / "diagram.png").stat().st_size > 1000
    assert "nan" not in (out / "diagram.svg").read_text().lower()
    json.loads((out / "summary.json").read_text(), parse_constant=lambda text: pytest.fail(text))
    return result, tables


def check_numbers(tables):
    """Check that all numbers are finite; only what may be unknown is empty."""
    for row in tables["branches"]:
        for name, value in row.items():
            if name not in ("branch", "relative_uncertainty", "liouville_error"):
                assert math.isfinite(float(value)), (name, value)
    for table in tables.values():
        assert not any(value in ("nan", "inf", "-inf") for row in table for value in row.values())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gap", "reason"),
    [(1e9, "grows without bound towards 15.9154943 Hz"), (1e3, "the orbit at 16.")],
    ids=["out of reach", "met at a million times the first amplitude"],
)
def test_an_undamped_resonance_ends_the_branch_with_its_sentence_and_last_point(
    tmp_path, gap, reason
):
    result, tables = computed(tmp_path, damping=0.0, gap=gap, range_hz=[15.5, 16.5])
    assert result.exit_code == 0
    broken = [end for end in tables["ends"] if end["broken_off"] == "1"]
    assert broken
    for end in broken:
        assert end["reason"].startswith(reason)
        last = [row for row in tables["branches"] if row["branch"] == end["branch"]]
        row = last[0 if end["end"] == "first" else -1]
        assert end["frequency_hz"] == row["frequency_hz"]
        assert end["max_abs_displacement_m"] == row["max_abs_displacement_m"]
        assert f"branch {end['branch']} was broken off at" in result.stdout


@pytest.mark.parametrize(
    "values",
    [
        {"stiffness": 1e50},
        pytest.param({"force": 1e40}, marks=pytest.mark.slow),
        pytest.param({"gap": -1e4}, marks=pytest.mark.slow),  # 12 s
        pytest.param({"gap": -1e10}, marks=pytest.mark.slow),  # 50 s of steps in contact
        pytest.param({"stiffness": 1e20, "force": 1e6}, marks=pytest.mark.slow),  # 15 s
    ],
)
def test_a_hopeless_scene_says_so(tmp_path, values):
    """The tables may be empty, and then the exit code is 1 and the notes say what was tried."""
    result, tables = computed(tmp_path, **values)
    assert result.exit_code == (0 if tables["branches"] else 1)
    if not tables["branches"]:
        assert "note: " in result.stdout
        assert result.stderr.splitlines()[-1] == (
            "nldyn: no periodic orbit was found; the tables are empty"
        )


@pytest.mark.parametrize("force", [1e-40, pytest.param(1e30, marks=pytest.mark.slow)])
def test_tiny_and_huge_forces_give_the_answer_of_the_linear_system(tmp_path, force):
    """No stop is reached: the top of the resonance is F / (2 k zeta sqrt(1 - zeta^2))."""
    _, tables = computed(tmp_path, force=force, gap=force)
    assert {(end["end"], end["broken_off"], end["reason"]) for end in tables["ends"]} == {
        ("first", "0", "end of the frequency range"),
        ("last", "0", "end of the frequency range"),
    }
    top = max(float(row["max_abs_displacement_m"]) for row in tables["branches"])
    zeta = PLAIN["damping"]
    wanted = force / (2e4 * zeta * math.sqrt(1.0 - zeta**2))
    assert 0.99 * wanted < top <= wanted * (1.0 + 1e-6)  # points lie beside the top


# --- long-term behaviour ------------------------------------------------------------------------

HIDDEN = "a contact is hidden by rounding"


def rigid_stop(stiffness=1e50, unbalance=4.92e-6):
    """A stop so stiff that no contact can be computed."""
    return System.from_matrices(
        [[2.48]], [[16877.0]], {"middle": [1.0]}, modal_damping=0.0142,
        stops=[Stop("middle", stiffness=stiffness)], excitation=[Unbalance("middle", unbalance)],
    )  # fmt: skip


@pytest.mark.filterwarnings("error")
def test_basins_say_why_no_cell_leads_anywhere():
    system = rigid_stop()
    plane = StatePlane.at_interface(system, displacement=(-4e-4, 5e-5), velocity=(-0.06, 0.06))
    found = basins(system, 22.8, plane, shape=(4, 4), starts=4, checks=2)
    assert np.all(found.labels == -1)
    assert sum(int(note.split()[0]) for note in found.notes) == 4
    assert any(HIDDEN in note for note in found.notes)


@pytest.mark.filterwarnings("error")
def test_basins_say_why_single_cells_fail():
    """Beside an orbit of 1e30 m the cells lie at rest, and begin with too many contacts."""
    system = rigid_stop(5.17e9, 1e30)
    plane = StatePlane.at_interface(system, displacement=(-4e-4, 5e-5), velocity=(-0.06, 0.06))
    shares = find_attractors(system, 20.0, starts=3)
    known = [share.attractor for share in shares if share.attractor.kind == "periodic"]
    found = basins(system, 20.0, plane, attractors=known, shape=(3, 3), starts=1, checks=0)
    assert len(found.attractors) == 1
    assert np.all(found.labels == -1)
    failed = [note.split(":")[0] for note in found.notes if "cells" in note]
    assert failed == ["9 of 9 cells failed"]


def test_failures_with_one_reason_are_one_attractor():
    shares = find_attractors(rigid_stop(), 22.8, starts=6)
    assert sum(share.count for share in shares) == 6
    reasons = [share.attractor.failure for share in shares]
    assert all(reasons)
    assert len(set(reasons)) == len(reasons)


def test_an_exploration_says_how_many_simulations_failed():
    effort = ExploreOptions(spacing=0.02, starts=2, settling=500)
    found = explore(rigid_stop(), (49.0, 51.0), max_period=2, effort=effort)
    total = sum(c.failed for c in found.coverage)
    assert total > 0
    assert f"{total} simulations could not be computed, at 4 frequencies from 49 to 51 Hz" in (
        found.report()
    )


def test_a_sweep_of_no_time_says_so():
    with pytest.raises(ConvergenceError, match="2e-30 s are too short"):
        sweep(rigid_stop(5.17e9), (20.0, 22.0), 1e30)


def test_a_free_structure_that_touches_nothing_has_no_place():
    system = System.from_matrices(
        np.diag([1.0, 2.0]), [[1e4, -1e4], [-1e4, 1e4]], {"a": [1.0, 0.0]},
        damping=[[1.0, -1.0], [-1.0, 1.0]], stops=[Stop("a", 1e7, gap=1.0)],
        excitation=[HarmonicForce("a", 5.0)],
    )  # fmt: skip
    with pytest.raises(ConvergenceError, match="free to move as a whole"):
        solve_orbit(system, 15.0)
