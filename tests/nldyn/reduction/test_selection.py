"""Modes chosen for a setting, and the stated error against the full model."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from problems import MASSES, SETTING, string

import cms
import fem
from nldyn import (
    LoadCase,
    Parameter,
    RoundStop,
    Stop,
    SystemModelError,
    Unbalance,
    select_modes,
    solve_orbit,
)
from nldyn.base.resources import example
from nldyn.branches.peaks import resonance_peaks
from nldyn.orbits.axis import Axis
from nldyn.reduction.candidates import candidate_modes, contact_duration
from nldyn.reduction.model_errors import harmonic_branch, largest_force, matched, special_points_of
from nldyn.scene.component import build_component
from nldyn.scene.load_case import load_case_of
from nldyn.scene.read import load_scene


@pytest.fixture(scope="module")
def selection():
    return select_modes(string(), SETTING, tolerance=0.02)


def test_modes_that_the_middle_cannot_see_are_dropped(selection):
    assert all(number % 2 for number in selection.kept)
    unseen = {m.number for m in selection.left_out if m.reason == "no interface in use sees it"}
    assert unseen == {n for n in range(1, max(unseen) + 1) if n % 2 == 0}
    np.testing.assert_allclose(
        selection.reduced.frequencies_hz[: len(selection.kept)],
        cms.reduce(string(), modes=max(selection.kept), unseen=True).frequencies_hz[
            np.array(selection.kept) - 1
        ],
        rtol=1e-9,
    )


def test_both_directions_of_a_round_clearance_see_modes():
    """Modes 1 to 3 move along x alone, 4 to 6 along y."""
    rows = np.kron(np.eye(2), np.ones(3))
    squares = (2.0 * np.pi * np.array([20.0, 50.0, 90.0, 25.0, 60.0, 100.0])) ** 2
    plane = cms.Matrices(np.diag(squares), np.eye(6), {"x": rows[0], "y": rows[1]})
    rub = RoundStop(("x", "y"), 1e5, 1e-3, 1.0)
    setting = LoadCase((10.0, 70.0), stops=(rub,), excitation=(Unbalance("x", 1e-3),))
    found = candidate_modes(plane, setting)
    hz = found.whole.frequencies_hz
    assert [round(float(hz[n - 1])) for n in found.seen] == [20, 25, 50, 60, 90, 100]


def test_the_cutoff_of_a_range_of_a_parameter_does_not_depend_on_its_present_value():
    setting = replace(
        SETTING, limits=(1e6, 1e9), parameter=Parameter("stiffness"), frequency_hz=38.0
    )
    soft, stiff = (
        replace(setting, stops=(Stop("middle", stiffness=k),)) for k in (1e6, 1e9)
    )  # fmt: skip
    alone = replace(stiff, limits=(38.0, 38.1), parameter=None, frequency_hz=None)
    found = [candidate_modes(string(), case) for case in (soft, stiff, alone)]
    assert found[0].numbers == found[1].numbers
    assert found[0].cutoff_hz == pytest.approx(found[1].cutoff_hz, rel=1e-12)
    # the stiffest of them has the shortest contact
    assert found[0].contact_s == pytest.approx(found[2].contact_s, rel=0.02)


def test_a_frequency_that_is_held_and_changes_is_refused():
    with pytest.raises(SystemModelError, match="frequency_hz is held"):
        LoadCase((5.0, 60.0), excitation=(Unbalance("x", 1e-3),), frequency_hz=20.0)


def test_an_interface_that_is_not_in_use_does_not_count():
    """The quarter point would see every second mode, but nothing acts there."""
    quarter = {"quarter": np.eye(MASSES)[MASSES // 4]}
    found = select_modes(string(quarter), SETTING, tolerance=0.02)
    assert all(number % 2 for number in found.kept)


def true_error(component, setting, reduced, modes):
    """Error of displacement and force at five frequencies, against a model solved on its own."""
    full = setting.system(cms.reduce(component, modes=modes))
    small = setting.system(reduced)
    worst = 0.0
    strongest = 0.0
    changes = []
    for hz in np.geomspace(*setting.range_hz, 7)[1:-1]:
        exact = solve_orbit(full, hz)
        found = solve_orbit(small, hz)
        strongest = max(strongest, largest_force(exact))
        changes.append(abs(largest_force(exact) - largest_force(found)))
        size = exact.max_abs_displacement
        worst = max(worst, abs(found.max_abs_displacement - size) / size)
    return max(worst, max(changes) / strongest)


def test_true_error_lies_within_the_stated_band(selection):
    """Of a string, against all of its 41 modes."""
    _, high = selection.error
    assert high < 0.1
    assert true_error(string(), SETTING, selection.reduced, MASSES) <= high * 1.05


@pytest.mark.parametrize(
    "stiffness, range_hz",
    [
        (4e4, (39.0, 48.0)),
        pytest.param(1e4, (18.0, 60.0), marks=pytest.mark.slow),
        pytest.param(4e4, (18.0, 60.0), marks=pytest.mark.slow),
    ],
)
def test_true_error_of_folds_and_flips_lies_within_the_stated_band(stiffness, range_hz):
    """Of a string that meets a spring, against all of its 41 modes."""
    setting = replace(
        SETTING,
        limits=range_hz,
        stops=(Stop.linear("middle", stiffness),),
        modal_damping=0.01,
    )
    found = select_modes(string(), setting, tolerance=0.02, special_points=True)
    models = (cms.reduce(string(), modes=MASSES), found.reduced)
    exact, own = (
        special_points_of([harmonic_branch(setting.system(m), setting, lambda hz: None)])
        for m in models
    )
    assert len(exact["PD"]) >= 2
    error, missing, extra = matched(own, exact, Axis.in_frequency(range_hz))
    low, high = found.special_error
    assert 0.95 * low <= error <= 1.05 * high < 0.01
    assert abs(missing - found.missing) + abs(extra - found.extra) <= found.doubtful
    assert f"folds and flips: error {low:.1e} to {high:.1e}" in found.report()


@pytest.mark.slow
def test_true_error_of_a_solid_lies_within_the_stated_band():
    """A cantilever of second-order hexahedra with a stop below its tip, against 24 modes."""
    mesh = fem.box_mesh("bar", (0.3, 0.02, 0.01), (6, 1, 1))
    tip = int(np.argmin(np.linalg.norm(mesh.points - [0.3, 0.01, 0.0], axis=1)))
    model = fem.StructureModel(
        mesh.with_point_sets({"tip": [tip]}),
        {"bar": fem.SolidPart(fem.Material(2.1e11, 7800.0, 0.3))},
        supports=[fem.Support("x0", ("x", "y", "z"))],
        interfaces={"tip": fem.Interface("tip", "z")},
    )
    component = fem.assemble(model)
    setting = LoadCase(
        (95.0, 130.0),
        stops=(Stop("tip", stiffness=2e7),),
        excitation=(Unbalance("tip", 1e-5),),
        modal_damping=0.03,
    )
    selection = select_modes(component, setting, tolerance=0.05)
    _, high = selection.error
    assert high < 0.2
    assert true_error(component, setting, selection.reduced, 24) <= high * 1.05


def test_a_smaller_tolerance_keeps_more(selection):
    finer = select_modes(string(), SETTING, tolerance=0.001)
    assert len(finer.kept) > len(selection.kept)
    assert finer.error[1] < selection.error[1]


def test_the_report_says_what_was_kept_and_left_out(selection):
    said = selection.report()
    assert said.startswith("modes kept: 1 (")
    assert "left out, no interface in use sees it: 2 (" in said
    assert "estimated error of the harmonic response" in said


def test_contact_of_a_linear_spring_lasts_half_a_period():
    stop = Stop.linear("middle", 4e6)
    assert contact_duration(stop, 2.0, 0.3) == pytest.approx(np.pi * np.sqrt(2.0 / 4e6))


def test_contact_of_a_sphere_is_hertz_formula():
    """Johnson (1985), eq. 11.24: 2.94 times depth over speed."""
    depth = (1.25 * 2.0 * 0.1**2 / 1e9) ** 0.4
    found = contact_duration(Stop("middle", 1e9), 2.0, 0.1)
    assert found == pytest.approx(2.94 * depth / 0.1, rel=1e-2)


@pytest.mark.parametrize("tolerance", [0.0, 1.0, np.nan, "small"])
def test_a_tolerance_out_of_range_is_told(tolerance):
    with pytest.raises(SystemModelError, match="tolerance must lie in"):
        select_modes(string(), SETTING, tolerance=tolerance)


@pytest.mark.slow
def test_true_error_of_the_beam_lies_within_the_stated_band():
    """Harmonic branches of the chosen model and of 20 modes, at seven frequencies and the peak."""
    scene = load_scene(example("four_dof_xi_0.01.toml"))
    component, setting = build_component(scene), load_case_of(scene)
    selection = select_modes(component, setting, tolerance=0.01)
    models = (cms.reduce(component, modes=20), selection.reduced)
    full, small = (harmonic_branch(setting.system(m), setting, lambda hz: None) for m in models)
    pairs = [
        (full.at(float(hz))[0], small.at(float(hz))[0])
        for hz in np.geomspace(*setting.range_hz, 9)[1:-1]
    ]
    tops = [max(resonance_peaks(b), key=lambda p: p.height).orbit for b in (full, small)]
    pairs.append((tops[0], tops[1]))
    strongest = max(largest_force(exact) for exact, _ in pairs)
    errors = [
        max(
            abs(found.max_abs_displacement / exact.max_abs_displacement - 1.0),
            abs(largest_force(found) - largest_force(exact)) / strongest,
        )
        for exact, found in pairs
    ]
    assert max(errors) <= selection.error[1] * 1.05


@pytest.mark.slow
def test_the_example_of_the_docs(capsys):
    """The mode at 430 Hz is left out, the one at 639 Hz is not; 20 modes confirm the band."""
    page = Path(__file__).parents[3] / "docs" / "how-to" / "reduction_studies.md"
    names: dict = {}
    exec(re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.S)[0], names)
    assert "modes kept: 1 (13.12 Hz), 2 (117.4 Hz), 3 (326.1 Hz), 5 (639.4 Hz)" in (
        capsys.readouterr().out
    )
    selection, setting = names["selection"], names["load_case_of"](names["scene"])
    component = names["build_component"](names["scene"])
    full = setting.system(cms.reduce(component, modes=20))
    for hz in (20.0, 60.0, 85.0):
        exact = solve_orbit(full, hz)
        found = solve_orbit(setting.system(selection.reduced), hz)
        error = abs(largest_force(found) / largest_force(exact) - 1)
        assert error < selection.error[1]
