"""The verbs of the command line, their output and their exit codes."""

import csv
import math
import subprocess
import sys
from dataclasses import replace

import pytest
import scipy.io
import scipy.sparse
from click.testing import CliRunner
from fakes import diagram

import nldyn.runtime.progress
import nldyn.scene.run
from nldyn import System
from nldyn.app.cli import main
from nldyn.app.describe import static_flexibility
from nldyn.base.resources import example, mesh
from nldyn.branches.arclength import Stepper
from nldyn.io.branches import load_branches, load_diagram, load_exploration, save_branches
from nldyn.search import explore as survey

ONE_DOF = str(example("one_dof.toml"))


def invoke(*arguments):
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


@pytest.fixture
def computed(monkeypatch):
    """Let every scene give the same ready diagram."""

    def compute(scene, progress, checkpoint, jobs, structure):
        progress("harmonic branch", 25.3, 0.5)
        return replace(diagram(), notes=("no 1/5 orbit found near 62.2 Hz",))

    monkeypatch.setattr(nldyn.scene.run, "results_of", compute)


def test_run(tmp_path, computed):
    result = invoke("run", ONE_DOF, "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert result.stderr == ""
    assert "note: no 1/5 orbit found near 62.2 Hz" in result.stdout
    assert "3 branches with 1100 points" in result.stdout
    assert "special points: 3 GR, 3 LP, 6 PD" in result.stdout
    assert (tmp_path / "out" / "branches.csv").is_file()


def test_short_run_from_end_to_end(tmp_path):
    scene = tmp_path / "short.toml"
    text = example("one_dof.toml").read_text()
    text = text.replace("[5.0, 90.0]", "[24.0, 27.0]\nsearch_points = 1")
    scene.write_text(text.replace("periods = [1, 2, 3]", "periods = [1]"))
    result = invoke("run", scene, "--out", tmp_path / "out", "--log")
    assert result.exit_code == 0, result.output
    with (tmp_path / "out" / "branches.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(rows[i]["frequency_hz"]) for i in (0, -1)] == pytest.approx([24.0, 27.0])
    highest = max(float(row["max_abs_displacement_m"]) for row in rows)
    assert highest == pytest.approx(225.46e-6, rel=5e-3)
    assert {row["stable"] for row in rows} == {"1"}


def test_run_again_into_the_same_directory(tmp_path, computed):
    for _ in range(2):
        assert invoke("run", ONE_DOF, "--out", tmp_path / "out", "--quiet").exit_code == 0


def test_short_run_into_a_file_says_nothing_on_the_way(tmp_path, computed):
    assert invoke("run", ONE_DOF, "--out", tmp_path / "out").stderr == ""


def test_quiet_run_says_nothing_on_stderr(tmp_path, computed):
    assert invoke("run", ONE_DOF, "--out", tmp_path / "out", "--quiet").stderr == ""


def test_somebody_elses_directory_is_refused_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr(nldyn.scene.run, "results_of", lambda *_: pytest.fail("computed"))
    (tmp_path / "mine.txt").write_text("")
    result = invoke("run", ONE_DOF, "--out", tmp_path)
    assert result.exit_code == 2
    assert "not written by nldyn" in result.stderr and result.stderr.count("\n") == 1


def stop(*_):
    raise KeyboardInterrupt


def stop_in_compiled_code(*_):
    inner = SystemError("returned a result with an exception set")
    inner.__cause__ = KeyboardInterrupt()
    raise SystemError("and once more") from inner


@pytest.mark.parametrize("interrupt", [stop, stop_in_compiled_code])
def test_ctrl_c(tmp_path, monkeypatch, interrupt):
    monkeypatch.setattr(nldyn.scene.run, "results_of", interrupt)
    result = invoke("run", ONE_DOF, "--out", tmp_path / "out", "--quiet")
    assert result.exit_code == 130
    assert result.stderr == "nldyn: stopped by Ctrl-C, nothing is written\n"
    assert list(tmp_path.iterdir()) == []


def short_scene(folder):
    """A scene of the harmonic branch between 20 and 30 Hz."""
    text = example("one_dof.toml").read_text()
    text = text.replace("[5.0, 90.0]", "[20.0, 30.0]\nsearch_points = 1")
    scene = folder / "short.toml"
    scene.write_text(text.replace("periods = [1, 2, 3]", "periods = [1]"))
    return scene


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The results of the short scene."""
    folder = tmp_path_factory.mktemp("short")
    assert invoke("run", short_scene(folder), "--out", folder / "whole", "--quiet").exit_code == 0
    return folder / "whole"


def test_a_run_goes_on_after_ctrl_c(whole, tmp_path, monkeypatch):
    scene, out = short_scene(tmp_path), tmp_path / "new" / "out"
    advance = Stepper._advance
    steps = []

    def counted(*arguments):
        steps.append(None)
        if len(steps) == limit:
            raise KeyboardInterrupt
        return advance(*arguments)

    monkeypatch.setattr(Stepper, "_advance", counted)
    limit = 60
    own = ("--quiet", "--jobs", "1")  # the steps of this process are counted
    stopped = invoke("run", scene, "--out", out, *own)
    unfinished = tmp_path / "new" / "out.unfinished.h5"
    assert stopped.exit_code == 130
    assert stopped.stderr == (
        f"nldyn: stopped by Ctrl-C; {unfinished} keeps what was computed, and the same command "
        "goes on from there\n"
    )
    assert [entry.name for entry in out.parent.iterdir()] == [unfinished.name]
    known = len(load_branches(unfinished)[0].nodes)
    steps.clear()
    limit = None
    assert invoke("run", scene, "--out", out, *own).exit_code == 0
    assert [entry.name for entry in out.parent.iterdir()] == ["out"]
    for name in ("branches.csv", "special_points.csv", "branches.h5", "summary.json"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()
    (branch,) = load_diagram(out / "branches.h5").branches
    assert known > 20 and len(steps) < 1.5 * (len(branch.nodes) - known)


EXPLORE = "[explore]\nmax_period = 2\nspacing = 0.03\nstarts = 2\n"


def explored_scene(folder, more=EXPLORE):
    """A scene of the harmonic branch between 26 and 27.5 Hz, to be found without guesses."""
    text = example("one_dof.toml").read_text().partition("[[subharmonics]]")[0]
    text = text.replace("[5.0, 90.0]", "[26.0, 27.5]").replace("periods = [1, 2, 3]\n", "")
    scene = folder / "explored.toml"
    scene.write_text(f"{text}\n{more}")
    return scene


@pytest.fixture(scope="module")
def explored(tmp_path_factory):
    """What the exploration of the scene says, with the folder of its results."""
    folder = tmp_path_factory.mktemp("explored")
    result = invoke("run", explored_scene(folder), "--out", folder / "out", "--quiet")
    assert result.exit_code == 0, result.output
    return result, folder / "out"


def test_a_scene_is_explored(explored):
    result, out = explored
    assert "simulations at 3 frequencies, 100.0 % ended on one of the branches" in result.stdout
    with (out / "coverage.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [rows[i]["frequency_hz"] for i in (0, -1)] == ["26.0", "27.5"]
    assert all(row["periods"] == "1" and int(row["settled"]) >= 3 for row in rows)
    found = load_exploration(out / "branches.h5")
    assert [branch.period for branch in found.diagram.branches] == [1]
    assert found.finished and len(found.coverage) == len(rows)


def test_an_exploration_goes_on_after_ctrl_c(explored, tmp_path, monkeypatch):
    scene, out = explored_scene(tmp_path), tmp_path / "out"
    step = survey._Survey.step
    steps = []

    def counted(*arguments):
        steps.append(None)
        if len(steps) == 5:
            raise KeyboardInterrupt
        step(*arguments)

    monkeypatch.setattr(survey._Survey, "step", counted)
    stopped = invoke("run", scene, "--out", out, "--quiet")
    assert stopped.exit_code == 130 and "goes on from there" in stopped.stderr
    assert load_exploration(tmp_path / "out.unfinished.h5").stage.steps == 4
    assert invoke("run", scene, "--out", out, "--quiet").exit_code == 0
    assert len(steps) == 5 + 6 - 4
    for name in ("branches.csv", "coverage.csv", "branches.h5", "summary.json"):
        assert (out / name).read_bytes() == (explored[1] / name).read_bytes()


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("[explore]\nspacing = 0.0\n", "explore.spacing must"),
        ("[explore]\nperiods = [1]\n", "explore.periods is not a known key"),
        (EXPLORE + "[[subharmonics]]\nperiod = 2\nnear_hz = 27.0\n", "subharmonics is of no use"),
    ],
)
def test_faults_of_an_explored_scene(tmp_path, more, says):
    result = invoke("run", explored_scene(tmp_path, more), "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1 and says in result.stderr


def test_places_to_look_at_are_refused_beside_explore(tmp_path):
    scene = explored_scene(tmp_path)
    scene.write_text(scene.read_text().replace("[26.0, 27.5]", "[26.0, 27.5]\nsearch_points = 3"))
    result = invoke("check", scene)
    assert result.exit_code == 2
    assert "continuation.search_points is of no use beside [explore]" in result.stderr


def test_an_unfinished_run_of_another_scene_is_kept_unless_it_shall_be_replaced(whole, tmp_path):
    scene, out = short_scene(tmp_path), tmp_path / "out"
    scene.write_text(scene.read_text().replace("4.92e-6", "4.93e-6"))
    unfinished = tmp_path / "out.unfinished.h5"
    save_branches(unfinished, load_branches(whole / "branches.h5"))
    before = unfinished.read_bytes()
    result = invoke("run", scene, "--out", out, "--quiet")
    assert result.exit_code == 2 and not out.exists()
    assert result.stderr == (
        f"nldyn: {unfinished}: holds branches of another system, accuracy or range; choose another "
        "file, or delete it, or begin anew with --replace\n"
    )
    assert unfinished.read_bytes() == before
    assert invoke("run", scene, "--out", out, "--quiet", "--replace").exit_code == 0
    assert out.exists() and not unfinished.exists()


def test_a_foreign_file_in_the_place_of_an_unfinished_run_is_named(tmp_path):
    (tmp_path / "out.unfinished.h5").write_text("mine")
    result = invoke("run", ONE_DOF, "--out", tmp_path / "out", "--quiet")
    assert result.exit_code == 2
    assert result.stderr.count("\n") == 1 and "is not an HDF5 file" in result.stderr
    assert "or delete it to begin anew" in result.stderr
    assert (tmp_path / "out.unfinished.h5").read_text() == "mine"


def test_check_prints_the_model():
    result = invoke("check", ONE_DOF)
    assert result.exit_code == 0
    for text in ("13.129310", "0.635001", "5.92522e-05", "5.17e+09 N/m^1.5", "no fault found"):
        assert text in result.stdout


def test_a_range_above_the_modes_of_a_mesh_is_remarked(tmp_path):
    """The two-DOF model ends with its residual mode, at 125.3 Hz."""
    text = example("two_dof_xi_0.01.toml").read_text().replace("../../meshes/", "")
    (tmp_path / "half_beam.msh").write_bytes(mesh("half_beam.msh").read_bytes())
    for top, remarked in ((125.0, False), (126.0, True)):
        scene = tmp_path / "scene.toml"
        scene.write_text(text.replace("range_hz = [15.0, 90.0]", f"range_hz = [120.0, {top}]"))
        said = invoke("check", scene).stdout
        assert ("note: range_hz goes up to 126 Hz, but the model" in said) is remarked
        assert "no fault found" in said


FREE = """
[modal]
frequencies_hz = [0.0, 20.0]
participation.tip = [1.0, 0.5]
[damping]
modal_ratio = 0.01
[[excitation]]
at = "tip"
kind = "harmonic"
amplitude = 1.0
[continuation]
range_hz = [10.0, 30.0]
"""


def test_check_refuses_what_run_refuses_in_the_same_words(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(FREE)
    checked = invoke("check", scene)
    ran = invoke("run", scene, "--out", tmp_path / "out", "--quiet")
    assert checked.exit_code == ran.exit_code == 2
    assert checked.stderr == ran.stderr and "free to move" in checked.stderr
    assert "no fault" not in checked.stdout


def test_check_takes_a_constant_force_that_is_only_simulated(tmp_path):
    """With a range of frequencies it is meant to be followed, which it cannot be."""
    scene = tmp_path / "scene.toml"
    step = FREE.replace('"harmonic"\namplitude', '"constant"\nforce').replace("[0.0,", "[10.0,")
    scene.write_text(step[: step.index("[continuation]")])
    checked = invoke("check", scene)
    assert checked.exit_code == 0 and "no fault found for 'nldyn simulate'" in checked.stdout
    done = invoke(
        "simulate", scene, "--out", tmp_path / "out", "--frequency-hz", 10, "--periods", 2
    )
    assert done.exit_code == 0
    scene.write_text(step)
    refused = invoke("check", scene)
    assert refused.exit_code == 2 and "excitation is constant" in refused.stderr


def test_check_names_what_takes_long(tmp_path):
    """No damping, and modes that swing thousands of times in a period."""
    scene = tmp_path / "scene.toml"
    held = FREE.replace("[0.0,", "[12.0,")
    for text, notes in (
        (held, ()),
        (held.replace("modal_ratio = 0.01", "modal_ratio = 0.0"), ("nothing takes energy out",)),
        (held.replace("20.0]", "20000.0]"), ("holds 2000 oscillations of the mode at 2e+04 Hz",)),
    ):
        scene.write_text(text)
        said = [line for line in invoke("check", scene).stdout.splitlines() if "note:" in line]
        assert len(said) == len(notes)
        assert all(note in line for note, line in zip(notes, said, strict=True))


def test_a_finished_scene_is_not_computed_again_unless_asked(tmp_path):
    """What its files hold by now counts: its text alone does not tell."""
    scene = tmp_path / "scene.toml"
    one = '[matrices]\nmass = "m.mtx"\nstiffness = "k.mtx"\ninterfaces.tip = [1.0]\n[damping]'
    ranged = FREE[FREE.index("modal_ratio") :].replace("[10.0, 30.0]", "[0.9, 1.1]\nperiods = [1]")
    scene.write_text(f"{one}\n{ranged}")
    for name, value in (("m", 1.0), ("k", 40.0)):
        scipy.io.mmwrite(tmp_path / f"{name}.mtx", scipy.sparse.coo_array([[value]]))
    run = ("run", scene, "--out", tmp_path / "out", "--quiet", "--jobs", "1")
    first = invoke(*run)
    assert first.exit_code == 0 and "computed before" not in first.stdout
    page = tmp_path / "out" / "report.html"
    written = page.stat().st_mtime_ns
    assert "all of it was computed before" in invoke(*run).stdout
    assert page.stat().st_mtime_ns == written
    assert "computed before" not in invoke(*run, "--replace").stdout
    assert page.stat().st_mtime_ns != written
    scipy.io.mmwrite(tmp_path / "k.mtx", scipy.sparse.coo_array([[41.0]]))
    assert "computed before" not in invoke(*run).stdout


def test_summaries_of_commands_are_not_cut():
    said = invoke("--help").stdout
    assert "..." not in said.partition("Commands:")[2]
    words = " ".join(said.split())
    assert "basins Find which initial states of a scene lead to which attractor, in a" in words


def test_check_tells_the_residual_mode_from_the_others():
    """The two-DOF model has one of each."""
    lines = invoke("check", example("two_dof_xi_0.01.toml")).stdout.splitlines()
    rows = [line for line in lines if line.split()[0] in ("1", "2")]
    assert [row.endswith("  residual") for row in rows] == [False, True]


def test_version_and_help():
    assert invoke("--version").stdout.startswith("nldyn")
    help_text = invoke("--help").stdout
    for verb in ("run", "check", "render"):
        assert verb in help_text


def test_missing_option_is_a_user_error():
    result = invoke("run", ONE_DOF)
    assert (result.exit_code, result.stderr) == (2, "nldyn: missing option '--out'\n")


def test_unknown_option_before_the_command_is_a_user_error():
    result = invoke("--quiet", "run", ONE_DOF)
    told = result.stderr.replace("'", "").replace(":", "")  # versions of click differ in these
    assert (result.exit_code, told) == (2, "nldyn no such option --quiet\n")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--frequency-hz", "1e300"], "is not in the range 1e-06<=x<="),
        (["--frequency-hz", "-3"], "invalid value for '--frequency-hz': -3.0 is not in the range"),
        (["--frequency"], "no such option"),
        (["--frequency-hz", "22", "--period", "101"], "101 is not in the range 1<=x<=100"),
        (["--period", "2"], "'--period' needs '--frequency-hz'"),
        (["--video", "avi"], "'avi' is not one of 'gif', 'mp4'"),
    ],
)
def test_render_options_are_checked_first(tmp_path, options, words):
    result = invoke("render", "none.toml", "--out", tmp_path, *options)
    assert result.exit_code == 2
    assert result.stderr.startswith("nldyn: ") and words in result.stderr
    assert result.stderr.count("\n") == 1 and result.stderr.endswith("\n")


def test_orbit_cannot_be_drawn_without_a_range(tmp_path):
    text = example("two_dof_xi_0.01.toml").read_text()
    text = text.replace("../../meshes/half_beam.msh", mesh("half_beam.msh").as_posix())
    scene = tmp_path / "scene.toml"
    scene.write_text(text[: text.index("[continuation]")])
    result = invoke("render", scene, "--out", tmp_path / "out", "--frequency-hz", "22")
    assert result.exit_code == 2
    assert result.stderr.startswith(f"nldyn: {scene}: continuation is missing")


def test_help_imports_nothing_heavy_of_its_own():
    code = (
        "import sys, nldyn; a = set(sys.modules); import nldyn.app.cli; "
        "print(*set(sys.modules) - a)"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    heavy = {"numba", "scipy", "matplotlib", "pyvista", "skfem", "pydantic"}
    assert heavy.isdisjoint(loaded)


def test_a_free_motion_that_an_interface_sees_by_rounding_only_leaves_its_flexibility():
    """One spring of (2 pi)² N/m, beside a free motion of which rounding shows 1e-14."""
    free = System.from_modal([0.0, 1.0], {"tip": [1e-14, 1.0], "far": [0.5, 1.0]})
    assert static_flexibility(free, "tip") == pytest.approx(1.0 / (2.0 * math.pi) ** 2, rel=1e-12)
    assert static_flexibility(free, "far") == math.inf
