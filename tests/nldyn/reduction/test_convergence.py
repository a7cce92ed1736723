"""Convergence studies: against models solved on their own, and what they write."""

from __future__ import annotations

import csv
import re
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner
from problems import MASSES, SETTING, string

import cms
import fem
from nldyn import (
    ConvergenceError,
    Damper,
    HarmonicForce,
    LoadCase,
    RigidStop,
    SceneError,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    convergence_study,
    select_modes,
    solve_orbit,
)
from nldyn.app.cli import main
from nldyn.base.resources import example
from nldyn.orbits.axis import Axis
from nldyn.reduction import convergence, model_errors, studied
from nldyn.reduction.convergence import QUANTITIES
from nldyn.reduction.model_errors import (
    contact_time,
    distance,
    errors_of,
    harmonic_branch,
    harmonic_pieces,
    largest_force,
    massless_receptance,
    matched,
    measured_linear,
    noted,
    receptance,
)
from nldyn.reduction.studied import Alone, Reference, receptance_bound
from nldyn.report.convergence import plot_special_points, write_study
from nldyn.report.convergence_page import panels
from nldyn.report.offline import unpacked
from nldyn.scene.component import build_component
from nldyn.scene.convergence import convergence_study_of, with_mesh
from nldyn.scene.read import load_scene


@pytest.fixture(scope="module")
def study():
    return convergence_study(
        string(),
        SETTING,
        modes=(1, 3, 7, 15),
        methods=("rubin", "truncation"),
        at=36.0,
        full=True,
    )


def test_the_full_model_is_the_reference(study):
    full = SETTING.system(cms.reduce(string(), modes=MASSES))
    orbit = solve_orbit(full, 36.0)
    assert study.reference.size == 21  # the modes that the middle sees
    assert largest_force(study.reference.orbit) == pytest.approx(largest_force(orbit), rel=1e-6)
    found = study.reference.orbit.max_abs_displacement
    assert found == pytest.approx(orbit.max_abs_displacement, rel=1e-6)


def test_the_reference_of_a_large_component_has_a_bound_of_its_own_error(monkeypatch):
    for module in (convergence, studied):
        monkeypatch.setattr(module, "ALL_MODES_UP_TO", 40)
    monkeypatch.setattr(model_errors, "FEWEST_REFERENCE_MODES", 6)
    study = convergence_study(string(), SETTING, modes=(1, 2))
    assert (study.reference.label, study.reference.modes) == ("reference", 6)
    assert "reference: rubin with 6 modes (its undamped receptance is within" in study.report()
    with pytest.raises(SystemModelError, match="up to 40 degrees of freedom, this one has 41"):
        convergence_study(string(), SETTING, modes=(1,), full=True)


def test_the_bound_of_the_reference_holds():
    setting, grid = replace(SETTING, modal_damping=0.0), np.linspace(*SETTING.range_hz, 400)
    reduced = cms.reduce(string(), modes=2)
    known = Reference(reduced, False, 0, {"": reduced})
    linear = measured_linear("", "", reduced, setting)
    bound = receptance_bound(Alone(string()), known, linear, setting)
    full = receptance(cms.reduce(string(), modes=MASSES), setting, grid)
    error = distance(receptance(reduced, setting, grid), full)
    assert 0.5 * bound < error < bound


def test_contacts_are_compared_only_where_there_are_any():
    far = replace(SETTING, stops=(Stop("middle", stiffness=2e7, gap=1.0),))
    study = convergence_study(string(), far, modes=(1, 3))
    assert all(np.isnan((error.force, error.contact)).all() for error in study.errors)
    assert "no stop is touched at 36.7423 Hz" in study.report()
    assert "contact force" not in study.report()


def test_impacts_on_a_rigid_stop_have_no_force_to_compare(tmp_path):
    rigid = replace(SETTING, stops=(RigidStop("middle", 0.8),), limits=(36.0, 36.2))
    study = convergence_study(string(), rigid, modes=(1, 2))
    assert all(model.orbit.impacts > 0 for model in study.models if model.orbit)
    assert [panel["name"] for panel in panels(study)] == ["eigenfrequencies"]
    write_study(study, tmp_path)
    with (tmp_path / "convergence.csv").open() as file:
        assert {row["force_n"] for row in csv.DictReader(file)} == {""}


def test_a_structure_that_nothing_holds_is_told():
    K = 1e5 * (np.diag([1.0, 2.0, 1.0]) - np.eye(3, k=1) - np.eye(3, k=-1))
    loads = {"middle": np.eye(3)[1], "end": np.eye(3)[2]}
    free = cms.reduce(cms.Matrices(K, np.eye(3), loads), modes=3)
    setting = replace(SETTING, stops=(), excitation=(Unbalance("middle", 1e-4),))
    with pytest.raises(ConvergenceError, match="nothing holds the structure: it has 1 mode at 0"):
        harmonic_branch(setting.system(free), setting, print)


def test_where_there_is_no_orbit_at_the_upper_end_the_branch_comes_from_the_lower_one(monkeypatch):
    """A linear system: its branch reaches the upper end, where no orbit was found to begin with."""
    far = replace(SETTING, stops=())
    system = far.system(cms.reduce(string(), modes=2))
    low, high = far.limits
    orbit_at = model_errors._orbit_at

    def fails_at_the_end(axis, system, value, setting):
        if value > 0.99 * high:
            raise ConvergenceError("no orbit")
        return orbit_at(axis, system, value, setting)

    monkeypatch.setattr(model_errors, "_orbit_at", fails_at_the_end)
    (branch,), (note,) = harmonic_pieces(system, far, high, lambda hz: None)
    assert branch.span == pytest.approx((low, high), rel=1e-8)
    assert note == f"a branch through {high:g} Hz is missing: no orbit"


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


OVER_THE_GAP = replace(SETTING, limits=(0.0, 2e-3), parameter="gap", frequency_hz=23.0)


@pytest.fixture(scope="module")
def over_gap():
    return convergence_study(string(), OVER_THE_GAP, modes=(1, 3, 7), at=3e-4, full=True)


def test_over_the_gap_the_orbit_is_that_of_the_full_model_with_the_gap(over_gap):
    setting = replace(SETTING, stops=(Stop("middle", stiffness=2e7, gap=3e-4),))
    seven, full = (
        largest_force(solve_orbit(setting.system(cms.reduce(string(), modes=count)), 23.0))
        for count in (7, MASSES)
    )
    assert over_gap.reference.size == 21
    assert largest_force(over_gap.reference.orbit) == pytest.approx(full, rel=1e-6)
    assert over_gap.errors[2].force == pytest.approx(abs(seven / full - 1.0), rel=1e-4)


def test_over_the_gap_folds_are_those_of_the_frequency_at_their_gap(over_gap):
    folds = over_gap.best.special_values["LP"]
    assert len(folds) == 2
    reduced = cms.reduce(string(), modes=7)
    for gap in folds:
        stop = Stop("middle", stiffness=2e7, gap=gap)
        branch = harmonic_branch(
            replace(SETTING, stops=(stop,)).system(reduced),
            replace(SETTING, stops=(stop,), limits=(15.0, 30.0)), lambda hz: None,
        )  # fmt: skip
        met = [s.frequency_hz for s in branch.special_points if s.kind == "LP"]
        assert min(abs(hz / 23.0 - 1.0) for hz in met) < 1e-8
    assert over_gap.errors[2].counts == (0, 0) and over_gap.errors[0].fold_flip > 0.0


def test_over_the_gap_all_is_told_of_the_gap(over_gap, tmp_path):
    assert "orbits at gap = 0.0003 m" in over_gap.report()
    write_study(over_gap, tmp_path)
    with (tmp_path / "convergence.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert "peak_gap" in rows[0]
    with (tmp_path / "special_points_by_model.csv").open() as file:
        told = [float(row["gap"]) for row in csv.DictReader(file) if row["label"] == "rubin"]
    assert told == [
        value
        for model in over_gap.models[:-1]
        for values in model.special_values.values()
        for value in values
    ]
    ax = plot_special_points(over_gap)
    assert ax.get_xlabel().startswith("gap of folds") and ax.get_xlabel().endswith("(mm)")


def test_modes_are_chosen_over_the_gap():
    """The orbits of the chosen model are those of the full one, at gaps that it was not asked."""
    stop = Stop.linear("middle", 1e5)
    asked = replace(OVER_THE_GAP, stops=(stop,), limits=(1e-4, 4e-4))
    chosen = select_modes(string(), asked, tolerance=0.05).reduced
    assert chosen.modes < 7
    for gap in (1.5e-4, 3e-4):
        setting = replace(SETTING, stops=(replace(stop, gap=gap),))
        own, full = (
            solve_orbit(setting.system(model), 23.0)
            for model in (chosen, cms.reduce(string(), modes=MASSES))
        )
        assert own.max_abs_displacement == pytest.approx(full.max_abs_displacement, rel=0.05)


def test_contact_time_is_the_time_of_positive_penetration():
    orbit = solve_orbit(SETTING.system(cms.reduce(string(), modes=5)), 36.0)
    history = orbit.history(200000)
    closed = np.count_nonzero(history.penetration[:-1, 0] > 0.0) / 200000
    assert contact_time(orbit) == pytest.approx(closed * orbit.duration, rel=2e-3)


def test_special_points_are_paired_nearest_first():
    exact, axis = {"LP": (10.0, 20.0), "PD": (30.0, 30.1)}, Axis.in_frequency((5.0, 60.0))
    own = {"LP": (10.01,), "PD": (30.11, 30.02, 50.0)}
    worst, missing, extra = matched(own, exact, axis)
    assert worst == pytest.approx(1e-3)
    assert (missing, extra) == (1, 1)
    assert matched(exact, exact, axis) == (0.0, 0, 0)


def test_the_report_says_from_where_on(study):
    said = study.report()
    assert "rubin, receptance: 1 % from" in said
    assert "truncation, contact force:" in said


def test_files(study, tmp_path):
    folder = tmp_path
    write_study(study, folder, "A string")
    with (folder / "convergence.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["label"] for row in rows] == ["rubin"] * 4 + ["truncation"] * 4 + ["full"]
    assert float(rows[1]["force_error"]) == study.errors[1].force
    assert not any(value in ("nan", "inf") for row in rows for value in row.values())
    for name in ("convergence.png", "speed_against_error.svg", "special_points_by_model.csv"):
        assert (folder / name).stat().st_size > 0
    page = unpacked((folder / "convergence.html").read_text(encoding="utf-8"))
    force = next(panel for panel in page["panels"] if panel["name"] == "contact force")
    assert [value for row in force["values"] for value in row] == pytest.approx(
        [float(row["force_n"]) for row in rows]
    )
    assert force["reference"] == force["values"][-1]  # the full model's orbit
    flips = page["models"][0]["special"]["PD"]
    assert (len(flips), len(page["exact"]["PD"])) == (int(rows[0]["flips"]), int(rows[3]["flips"]))
    assert [row[0] for row in page["tables"]["models"]["rows"]] == [row["label"] for row in rows]


def test_the_band_of_a_reference_holds_the_models_with_half_its_modes(study):
    """The next smaller one alone would hide a mode that the interface hardly sees."""
    best = study.best
    assert (best.label, best.modes) == ("rubin", 15)
    height = next(panel for panel in panels(study) if panel["name"] == "peak height")
    seven, most = (study.models[i].peak.max_abs_displacement for i in study.series()["rubin"][2:])
    low, high = height["span"]
    assert high / low == pytest.approx(max(seven, most) / min(seven, most))


def test_advice_is_kept_by_all_larger_models(study):
    rubin = study.series()["rubin"]
    (said,) = [line for line in study.advice(0.05) if line.startswith("advice: rubin: ")]
    enough = int(re.search(r"(\d+) modes? suffice", said)[1])
    worst = {
        study.models[i].modes: max(
            error
            for quantity in QUANTITIES
            if quantity != "eigenfrequency"
            and np.isfinite(error := getattr(study.errors[i], quantity))
        )
        for i in rubin
    }
    assert all((modes >= enough) == (error <= 0.05) for modes, error in worst.items())
    assert study.advice(1e-15)[0].startswith("advice: rubin: no count of this study suffices")


AT_TIP = LoadCase(
    (30.0, 40.0),
    stops=(Stop("tip", stiffness=1e8),),
    excitation=(Unbalance("tip", 1e-4),),
    dampers=(Damper("tip", 1.0),),
    modal_damping=0.02,
)


def cantilever(count):
    mesh = fem.frame_mesh({"root": (0, 0), "tip": (0.5, 0)}, [("arm", "root", "tip", count)])
    part = fem.BeamPart(fem.Material(2.1e11, 7800.0), fem.RectangularSection(0.02, 0.01))
    model = fem.StructureModel(
        mesh,
        {"arm": part},
        supports=[fem.Support("root", ("x", "y", "rotation"))],
        interfaces={"tip": fem.Interface("tip", "y")},
        plane=True,
    )
    return fem.assemble(model)


@pytest.fixture(scope="module")
def small():
    """Two elements, of whose six modes the tip sees the four that bend."""
    return convergence_study(cantilever(2), AT_TIP, modes=(2, 3, 6), full=True)


def test_where_all_modes_are_kept_the_report_says_that_nothing_is_left_out(small):
    """Against the orbit of the full model, found on its own; the residual mode is the fourth."""
    assert [small.is_exact(model) for model in small.models] == [False, True, True, True]
    assert all(error.force < 1e-9 and error.contact < 1e-9 for error in small.errors[1:])
    said = small.report()
    assert "rubin with 3 modes leaves nothing out: the interfaces see no other modes" in said
    assert "rubin, peak height: 1 % from 3 modes, 0.01 % from 3 modes" in said
    assert not re.search(r"\binf\b|not reached|\bref\b", said)


def test_a_model_is_no_proof_of_itself(small):
    """With two modes the contact force is wrong by more than 1 %, of which two cannot know."""
    assert small.errors[0].force > 0.01
    two, full = small.models[0], replace(small.models[-1], orbit=None)
    errors = tuple(errors_of(model, full, two, False, small.axis) for model in (two, two, full))
    alone = replace(small, models=(replace(two, modes=1), two, full), errors=errors, best=two)
    said = alone.report()
    assert "how wrong rubin with 2 modes is itself, only a study with more modes can say" in said
    assert alone.enough("force", 0.01, [1]) is None
    assert said.splitlines()[2].split()[6:13] == ["-", "-", "ref", "0", "0", "ref", "ref"]


def test_special_points_of_which_none_is_matched_have_no_error(small):
    other = replace(small.models[0], special_values={"LP": (1.0,), "PD": ()})
    errors = errors_of(other, small.reference, small.best, True, small.axis)
    assert np.isnan(errors.fold_flip)
    assert errors.counts == (sum(map(len, small.best.special_values.values())), 1)


def test_a_reference_without_a_bound_is_told_in_words(small):
    """The range has the second mode in it, which the reference leaves out."""
    wide = replace(AT_TIP, limits=(30.0, 1000.0))
    whole = cms.reduce(cantilever(2), modes=1)
    linear = measured_linear("", "reference", whole, wide)
    known = Reference(whole, False, 0, {"": whole})
    bound = receptance_bound(Alone(cantilever(2)), known, linear, wide)
    assert bound == np.inf
    models = (*small.models[:-1], replace(linear, orbit=small.reference.orbit))
    said = replace(small, models=models, reference_error=bound).report()
    assert "rubin with 1 mode (without a bound of its error: a mode that it leaves out may" in said
    assert "inf" not in said


@pytest.fixture(scope="module")
def meshes():
    """A cantilever of 2 to 16 elements, by Rubin's and MacNeal's methods."""
    components = {f"{count} elements": cantilever(count) for count in (2, 4, 8, 16)}
    return convergence_study(components, AT_TIP, modes=(3,), methods=("rubin", "macneal"))


def test_errors_of_a_beam_fall_with_the_fourth_power_of_its_elements(meshes):
    """As those of its frequencies; against 16 elements the order seen is a little above."""
    indices = meshes.mesh_series()["rubin, 3 modes"]
    assert [meshes.models[i].dofs for i in indices] == [6, 12, 24, 48]
    for quantity in ("eigenfrequency", "receptance", "force"):
        errors = [getattr(meshes.errors[i], quantity) for i in indices]
        assert 10 < errors[1] / errors[2] < 25, quantity
    assert meshes.best.label == "16 elements rubin"
    assert meshes.best.dofs == 48


def test_macneals_method_is_compared_by_its_linear_numbers(meshes):
    """One power of the squared frequency worse than Rubin's, and no branch."""
    rubin, macneal = (meshes.mesh_series()[f"{name}, 3 modes"][-1] for name in ("rubin", "macneal"))
    errors = meshes.errors[macneal]
    assert meshes.errors[rubin].receptance < 0.1 * errors.receptance < 1e-5
    assert np.isnan(errors.force) and errors.counts is None
    said = meshes.report()
    assert said.count("so that a stop has no equation of motion") == 1
    assert "rubin, 3 modes, receptance: 1 % from 12 degrees of freedom" in said


@pytest.mark.slow
def test_a_study_of_meshes_is_drawn_over_their_size(meshes, tmp_path):
    folder = tmp_path
    write_study(meshes, folder, "A cantilever")
    assert (folder / "meshes.png").is_file()
    assert not (folder / "convergence.png").exists()
    with (folder / "convergence.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["dofs"] for row in rows[:4]] == ["6", "6", "12", "12"]
    assert rows[1]["missing"] == rows[1]["force_error"] == ""
    assert "no equation of motion" in rows[1]["note"]


def test_dampers_close_a_receptance_of_modes_and_flexibility():
    """Against the modal equations with all dampers, where everything has mass."""
    setting = replace(SETTING, dampers=(Damper("middle", 3.0), Damper("quarter", 5.0)))
    whole = cms.reduce(string({"quarter": np.eye(MASSES)[10]}), modes=MASSES, method="truncation")
    hz = np.linspace(20.0, 60.0, 9)
    np.testing.assert_allclose(
        massless_receptance(whole, setting, hz), receptance(whole, setting, hz), rtol=1e-10
    )


def test_the_reference_of_models_of_one_size_is_the_one_with_the_best_receptance():
    for methods in (("craig-bampton", "rubin"), ("rubin", "craig-bampton")):
        study = convergence_study(string(), SETTING, modes=(4,), methods=methods, at=36.0)
        assert study.best.label == "rubin"


def test_refined_meshes_converge_to_the_frequencies_of_the_beam():
    """Twice the elements: the names stay, and the frequencies move by h^4."""
    scene = load_scene(example("four_dof_xi_0.01.toml"))
    components = [build_component(scene, times) for times in (1, 2)]
    hz = [cms.reduce(c, modes=3).frequencies_hz[:3] for c in components]
    assert components[1].stiffness.shape[0] > 1.9 * components[0].stiffness.shape[0]
    np.testing.assert_allclose(hz[1], hz[0], rtol=1e-6)


PAIR = np.array([[650.0, -20.0], [-20.0, 3220.0]])  # stiffness of two masses of 1 kg
UP_TO_A_FOLD = LoadCase(
    (3.0, 10.2),
    stops=tuple(Stop("high", 3000.0, 1.0, gap=0.02, direction=way) for way in (1, -1)),
    excitation=(HarmonicForce("high", 10.0),),
    modal_damping=0.02,
    observe="low",
)


@pytest.fixture(scope="module")
def folded():
    """At 10.2 Hz the motion from rest touches no stop; its branch folds, and goes back there."""
    interfaces = {"low": np.eye(2)[0], "high": np.eye(2)[1]}
    pair = cms.Matrices(PAIR, np.eye(2), interfaces)
    return convergence_study(pair, UP_TO_A_FOLD, modes=(1, 2), at=6.0)


def test_a_branch_that_folds_back_is_followed_from_the_other_end_too(folded):
    """The highest peak is that of the linear response near 4 Hz, which reaches no stop."""
    (fold,) = folded.best.special_values["LP"]
    assert fold > 9.0
    squares, shapes = np.linalg.eigh(PAIR)
    omega = 2 * np.pi * np.linspace(4.05, 4.06, 10001)[:, None]
    damping = 2j * 0.02 * omega * np.sqrt(squares)
    response = 10.0 * np.abs(np.sum(shapes[0] * shapes[1] / (squares - omega**2 + damping), axis=1))
    peak = folded.best.peak
    assert peak.max_abs_displacement == pytest.approx(response.max(), rel=1e-7)
    assert peak.frequency_hz == pytest.approx(omega[response.argmax(), 0] / (2 * np.pi), rel=1e-5)
    assert folded.best.orbit.frequency_hz == pytest.approx(6.0)
    assert not folded.notes()


def with_spans(study, spans):
    """A study as if its models had such branches, without an orbit for contacts."""
    cut = [
        replace(model, spans=(span,), orbit=None)
        for model, span in zip(study.models[:-1], spans, strict=True)
    ]
    full, axis = study.reference, study.axis
    models = tuple(noted(model, cut[-1], None, axis, study.at) for model in cut)
    errors = [errors_of(model, full, models[-1], False, axis) for model in (*models, full)]
    return replace(study, models=(*models, full), errors=tuple(errors), best=models[-1])


def test_pieces_of_other_frequencies_are_not_compared_and_the_note_says_why(folded):
    cut = with_spans(folded, [(9.68, 10.2), (3.0, 10.2)])
    error = cut.errors[0]
    assert np.isnan((error.peak_at, error.peak_height, error.fold_flip)).all()
    assert error.counts is None
    assert cut.errors[1].counts == (0, 0)
    assert cut.models[0].note == (
        "the branch covers 9.68 to 10.2 Hz of 3 to 10.2 Hz, that of the reference 3 to 10.2 Hz: "
        "peaks, folds and flips are not compared; "
        "no orbit of the branch at 6 Hz, so that its contacts are unknown"
    )
    assert cut.models[1].note.startswith("no orbit of the branch at 6 Hz")
    assert "note: rubin, 1 mode: the branch covers 9.68" in cut.report()


def test_nothing_is_advised_on_peaks_if_the_branch_of_reference_is_a_piece(folded):
    (said,) = with_spans(folded, [(9.69, 10.2), (9.68, 10.2)]).advice()
    assert said.startswith("advice: rubin: 1 mode suffices for 1 % in receptance; nothing on peaks")
    assert said.endswith("the reference's branch covers 9.68 to 10.2 Hz of 3 to 10.2 Hz")


SPACE_FRAME = """
mesh = {file = "frame.inp", model = "structure"}
parts.mast = {youngs_modulus = 2.1e11, density = 7800, poissons_ratio = 0.3, diameter = 0.02}
parts.arm = {youngs_modulus = 2.1e11, density = 7800, poissons_ratio = 0.3, diameter = 0.02}
interfaces.tip = {at = "tip", direction = "z"}
reduction.modes = 3
[[supports]]
at = "foot"
fixed = ["x", "y", "z", "rotation_x", "rotation_y", "rotation_z"]
"""


@pytest.fixture
def space_frame(tmp_path):
    """A scene with a mast and an arm on it, of four and eight elements in two files."""
    points = {"foot": (0, 0, 0), "top": (0, 0, 1), "tip": (1, 0, 1)}
    for file, count in (("frame.inp", 2), ("finer.inp", 4)):
        members = [("mast", "foot", "top", count), ("arm", "top", "tip", count)]
        fem.write_mesh(fem.frame_mesh(points, members), tmp_path / file)
    (tmp_path / "scene.toml").write_text(SPACE_FRAME, encoding="utf-8")
    return load_scene(tmp_path / "scene.toml")


def test_lines_of_a_structure_are_cut_as_a_mesher_does(space_frame):
    cut = cms.reduce(build_component(space_frame, 2), modes=4).frequencies_hz
    finer = cms.reduce(build_component(with_mesh(space_frame, "finer.inp")), modes=4)
    coarse = cms.reduce(build_component(space_frame), modes=4).frequencies_hz
    np.testing.assert_allclose(cut, finer.frequencies_hz, rtol=1e-9)
    assert np.all(coarse[:4] > cut[:4])


def test_solids_are_refined_in_the_mesher():
    with pytest.raises(SceneError, match="has cells other than two-node lines; refine it"):
        build_component(load_scene(example("plate.toml")), 2)


def test_the_counts_that_are_not_given_fit_the_model():
    """Three masses on a string, the last maybe nothing; of equal ones a mode is unseen."""
    K = 1e5 * (2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1))
    for masses, methods, counts in (
        ([1.0, 1.0, 2.0], ("rubin",), {1, 2, 3}),
        ([1.0, 1.0, 1.0], ("rubin",), {1, 2}),
        ([1.0, 1.0, 2.0], ("craig-bampton",), {1, 2}),
        ([1.0, 1.0, 1.0], ("craig-bampton",), {1}),
        ([1.0, 1.0, 0.0], ("rubin",), {1, 2}),
    ):
        chain = cms.Matrices(K, np.diag(masses), {"middle": np.eye(3)[1]})
        found = convergence_study(chain, SETTING, methods=methods)
        assert {model.modes for model in found.models if model.method in methods} == counts


@pytest.mark.parametrize(
    "changed, words",
    [
        ({"modes": ()}, "at least one component, count and method"),
        ({"at": 100.0}, "at must lie in the range"),
    ],
)
def test_faults_are_told(changed, words):
    with pytest.raises(SystemModelError, match=words):
        convergence_study(string(), SETTING, **{"modes": (1,), **changed})


def test_a_setting_without_excitation_is_refused():
    with pytest.raises(SystemModelError, match="no excitation"):
        LoadCase((10.0, 20.0))
    with pytest.raises(SystemModelError, match="two positive frequencies, ascending"):
        LoadCase((20.0, 10.0), excitation=(Unbalance("middle", 1.0),))


@pytest.mark.parametrize(
    "options, words",
    [
        (["--modes", "one"], "is not a list of whole numbers"),
        (["--modes", "3-1"], "the range 3-1 runs downwards"),
        (["--methods", "mcneal", "--modes", "1"], "each method must be one of rubin, cr"),
        (["--methods", "macneal", "--modes", "1"], "has a harmonic branch: its interfaces have no"),
        (["--modes", "999"], "999"),
        (["--meshes", "a.msh,b.msh"], "mesh.file names"),
        (["--meshes", "a.msh", "--refinements", "2"], "give either refinements or meshes"),
        (["--at", "500", "--modes", "1"], "at must lie in the range"),
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
    with pytest.raises(SystemModelError, match="no equation of motion: only stops"):
        SETTING.system(macneal)
    wrong = replace(cms.reduce(string(), modes=3), damping=np.full((4, 4), 1.0) + np.eye(4))
    assert System.from_reduced(wrong).size == 4


@pytest.mark.slow
def test_two_processes_give_the_same_study():
    scene = load_scene(example("portal.toml"))
    studies = [convergence_study_of(scene, modes=(1, 2, 3), jobs=jobs) for jobs in (1, 2)]
    for one, other in zip(*(study.models for study in studies), strict=True):
        assert (one.label, one.modes, one.note) == (other.label, other.modes, other.note)
        assert one.special_values == other.special_values
        assert (one.peak is None) == (other.peak is None)
        if one.peak is not None and other.peak is not None:
            assert np.array_equal(one.peak.point, other.peak.point)
