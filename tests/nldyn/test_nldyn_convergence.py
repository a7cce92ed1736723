"""Convergence studies: against models solved on their own, and what they write."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from strings import MASSES, SETTING, string

import cms
from nldyn import Setting, System, SystemModelError, Unbalance, converge, solve_orbit
from nldyn.cli import main
from nldyn.convergence import contact_time, largest_force, matched
from nldyn.convergence_output import write_study
from nldyn.resources import example
from nldyn.scene import build_component, load_scene


@pytest.fixture(scope="module")
def study():
    return converge(
        string(),
        SETTING,
        modes=(1, 3, 7, 15),
        methods=("rubin", "truncation"),
        at_hz=36.0,
        full=True,
    )


def test_the_full_model_is_the_reference(study):
    full = SETTING.system(cms.reduce(string(), modes=MASSES))
    orbit = solve_orbit(full, 36.0)
    assert study.reference.size == 21  # the modes that the middle sees
    assert largest_force(study.reference.orbit) == pytest.approx(largest_force(orbit), rel=1e-6)
    found = study.reference.orbit.max_abs_displacement
    assert found == pytest.approx(orbit.max_abs_displacement, rel=1e-6)


def test_errors_fall_with_the_number_of_modes(study):
    for label, factor in (("rubin", 0.05), ("truncation", 0.3)):
        for quantity in ("receptance", "force", "contact"):
            errors = [getattr(study.errors[i], quantity) for i in study.series()[label]]
            assert errors[-1] < factor * errors[0], (label, quantity)


def test_residual_flexibility_beats_truncation(study):
    """At equal counts, in the receptance and in the contact force."""
    rubin, plain = (study.series()[label] for label in ("rubin", "truncation"))
    for a, b in zip(rubin, plain, strict=True):
        assert study.errors[a].receptance < study.errors[b].receptance
    assert study.errors[rubin[1]].force < 0.5 * study.errors[plain[1]].force


def test_kept_frequencies_are_exact(study):
    index = study.series()["rubin"][2]
    assert study.errors[index].eigenfrequency < 1e-9


def test_contact_time_is_the_time_of_positive_penetration():
    orbit = solve_orbit(SETTING.system(cms.reduce(string(), modes=5)), 36.0)
    history = orbit.history(200000)
    closed = np.count_nonzero(history.penetration[:-1, 0] > 0.0) / 200000
    assert contact_time(orbit) == pytest.approx(closed * orbit.duration, rel=2e-3)


def test_special_points_are_paired_nearest_first():
    exact = {"LP": (10.0, 20.0), "PD": (30.0, 30.1)}
    own = {"LP": (10.01,), "PD": (30.11, 30.02, 50.0)}
    worst, missing, extra = matched(own, exact)
    assert worst == pytest.approx(1e-3)
    assert (missing, extra) == (1, 1)
    assert matched(exact, exact) == (0.0, 0, 0)


def test_the_report_says_from_where_on(study):
    said = study.report()
    assert "rubin, receptance: 1 % from" in said
    assert "truncation, contact force:" in said


def test_files(study, tmp_path):
    folder = write_study(study, tmp_path / "out", "A string")
    with (folder / "convergence.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["label"] for row in rows] == ["rubin"] * 4 + ["truncation"] * 4 + ["full"]
    assert float(rows[1]["force_error"]) == study.errors[1].force
    for name in ("convergence.png", "speed_against_error.svg", "special_points_by_model.csv"):
        assert (folder / name).stat().st_size > 0


def test_refined_meshes_converge_to_the_frequencies_of_the_beam():
    """Twice the elements: the names stay, and the frequencies move by h^4."""
    scene = load_scene(example("four_dof_xi_0.01.toml"))
    components = [build_component(scene, times) for times in (1, 2)]
    hz = [cms.reduce(c, modes=3).frequencies_hz[:3] for c in components]
    assert components[1].stiffness.shape[0] > 1.9 * components[0].stiffness.shape[0]
    np.testing.assert_allclose(hz[1], hz[0], rtol=1e-6)


@pytest.mark.parametrize(
    "changed, words",
    [
        ({"modes": ()}, "at least one component, count and method"),
        ({"at_hz": 100.0}, "at_hz must lie in the range"),
    ],
)
def test_faults_are_told(changed, words):
    with pytest.raises(SystemModelError, match=words):
        converge(string(), SETTING, **{"modes": (1,), **changed})


def test_a_setting_without_excitation_is_refused():
    with pytest.raises(SystemModelError, match="no excitation"):
        Setting((10.0, 20.0))
    with pytest.raises(SystemModelError, match="from low to high"):
        Setting((20.0, 10.0), excitation=(Unbalance("middle", 1.0),))


@pytest.mark.parametrize(
    "options, words",
    [
        (["--modes", "one"], "is not a list of whole numbers"),
        (["--methods", "macneal", "--modes", "1"], "no method 'macneal' for a scene"),
        (["--modes", "999"], "999"),
        (["--at-hz", "500", "--modes", "1"], "at_hz must lie in the range"),
    ],
)
def test_faults_on_the_command_line(tmp_path, options, words):
    scene = str(example("four_dof_xi_0.01.toml"))
    result = CliRunner().invoke(main, ["converge", scene, "--out", str(tmp_path / "o"), *options])
    assert result.exit_code == 2
    assert words in result.stderr
    assert result.stderr.count("\n") == 1


def test_command(tmp_path):
    text = example("four_dof_xi_0.01.toml").read_text(encoding="utf-8")
    mesh = (example("four_dof_xi_0.01.toml").parent / "../../meshes/half_beam.msh").resolve()
    text = text.replace("../../meshes/half_beam.msh", mesh.as_posix())
    text = text.replace("range_hz = [15.0, 90.0]", "range_hz = [87.0, 90.0]")
    scene = tmp_path / "scene.toml"
    scene.write_text(text, encoding="utf-8")
    arguments = ["converge", str(scene), "--out", str(tmp_path / "out"), "--quiet"]
    result = CliRunner().invoke(main, [*arguments, "--modes", "1-2", "--methods", "rubin"])
    assert result.exit_code == 0, result.output
    assert "reference: the full model" in result.stdout
    assert (tmp_path / "out" / "report.txt").is_file()


def test_damping_of_a_reduced_model_is_carried_over():
    """Rayleigh damping by the reduced model or mode by mode: one system."""
    reduced = cms.reduce(string(), modes=3)
    omega = 2 * np.pi * reduced.frequencies_hz
    damped = System.from_reduced(reduced.with_damping(rayleigh=(2.0, 1e-5)), modal_damping=0.01)
    ratios = 0.01 + (2.0 / omega + 1e-5 * omega) / 2
    by_hand = System.from_reduced(reduced, modal_damping=ratios)
    np.testing.assert_allclose(damped.damping, by_hand.damping, rtol=1e-12)


def test_a_craig_bampton_model_runs_as_one_by_rubin():
    """The same orbit of the string with all modes by either method."""
    orbits = [
        solve_orbit(SETTING.system(cms.reduce(string(), modes=k, method=method)), 36.0)
        for method, k in (("craig-bampton", 40), ("rubin", 41))
    ]
    sizes = [orbit.max_abs_displacement for orbit in orbits]
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-8)


def test_massless_interfaces_are_refused():
    macneal = cms.reduce(string(), modes=3, method="macneal")
    with pytest.raises(SystemModelError, match="no equation of motion; reduce by 'rubin'"):
        System.from_reduced(macneal)
    wrong = replace(cms.reduce(string(), modes=3), damping=np.full((4, 4), 1.0) + np.eye(4))
    assert System.from_reduced(wrong).size == 4
