"""The report: what it shows is what the tables say, and what independent formulas say."""

import base64
import csv
import json
import re

import numpy as np
import pytest
from click.testing import CliRunner

import cms
import fem
from nldyn import Stop, System, Unbalance, diagram, load
from nldyn.app.cli import main
from nldyn.base.resources import example
from nldyn.io.branches import save_branches
from nldyn.report import offline, orbit_content
from nldyn.report import page as pages
from nldyn.report.again import kept_surface
from nldyn.report.deflection import surface_content
from nldyn.report.offline import unpacked
from nldyn.report.page import Drawn, kept_points
from nldyn.report.results import write_results
from nldyn.scene.build import build_structure
from nldyn.scene.read import load_scene

MASS, STIFFNESS, UNBALANCE, RATIO = 2.48, 16877.0, 4.92e-6, 0.0142


def numbers(text, kind="<f4"):
    return np.frombuffer(base64.b64decode(text), kind)


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results of the one-DOF model around its first flip."""
    system = System.from_matrices(
        [[MASS]], [[STIFFNESS]], {"middle": [1.0]}, modal_damping=RATIO,
        stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", UNBALANCE)],
    )  # fmt: skip
    found = diagram(system, (32.0, 35.0), [1], search_points=1, doublings=0)
    return write_results(found, tmp_path_factory.mktemp("report") / "out")


@pytest.fixture(scope="module")
def content(results):
    return unpacked((results / "report.html").read_text(encoding="utf-8"))


def test_the_page_has_the_numbers_of_the_tables(results, content):
    points, special = rows(results / "branches.csv"), rows(results / "special_points.csv")
    table = content["tables"]["points"]
    assert [[str(value) for value in row] for row in table["rows"]] == [
        list(row.values()) for row in points
    ]
    (flip,) = [row for row in special if row["type"] == "PD"]
    (mark,) = [mark for mark in content["special"] if mark["kind"] == "PD"]
    assert mark["sentence"] == flip["meaning"]
    assert mark["text"].replace("<br>", " ") == flip["meaning"]
    assert mark["x"] == pytest.approx(float(flip["frequency_hz"]), rel=1e-8)
    drawn = [x for branch in content["branches"] for x in branch["x"]]
    assert drawn == pytest.approx([float(row["frequency_hz"]) for row in points], rel=1e-8)


def test_stable_and_unstable_lines_meet_at_the_flip(content):
    """Below it the orbit is stable; the line changes at the special point itself."""
    (flip,) = [mark["x"] for mark in content["special"] if mark["kind"] == "PD"]
    for run in content["branches"][0]["runs"]:
        ends = np.min(run["x"]), np.max(run["x"])
        assert ends[1] <= flip * (1 + 1e-9) if run["stable"] else ends[0] >= flip * (1 - 1e-9)


def test_every_special_point_has_an_orbit_and_its_multiplier(content):
    marks = [(mark["branch"], mark["index"]) for mark in content["special"]]
    shown = [(o["branch"], o["special"]) for o in content["orbits"] if o["special"] >= 0]
    assert sorted(shown) == sorted(marks)
    flips = [o for o in content["orbits"] if o["name"].endswith("(PD)")]
    for orbit in flips:
        nearest = min(abs(complex(*value) + 1.0) for value in orbit["multipliers"])
        assert nearest < 1e-6


def test_the_motion_obeys_newtons_law(content):
    """m y'' + b y' + k y = unbalance - force: the impulse over a period, and the work."""
    for orbit in content["orbits"]:
        t, y, v, force = (
            numbers(text).astype(float)
            for text in (orbit["time"], orbit["displacement"], orbit["velocity"], *orbit["forces"])
        )
        impulse = np.trapezoid(force, t)
        spring = -STIFFNESS * np.trapezoid(y, t)  # the other forces have no mean over a period
        assert impulse == pytest.approx(spring, rel=2e-3)
        assert y[0] == pytest.approx(y[-1], abs=1e-5 * np.abs(y).max())
        assert np.trapezoid(v, t) == pytest.approx(0.0, abs=2e-3 * np.abs(v).max() * t[-1])
        depth = [hit[2] for hit in orbit["impacts"]]
        assert max(hit[3] for hit in orbit["impacts"]) == pytest.approx(5.17e9 * max(depth) ** 1.5)
        assert force.max() == pytest.approx(max(hit[3] for hit in orbit["impacts"]), rel=1e-2)


def test_a_motion_without_contact_is_the_linear_one(tmp_path):
    system = System.from_matrices(
        [[MASS]], [[STIFFNESS]], {"middle": [1.0]}, modal_damping=RATIO,
        stops=[Stop("middle", stiffness=5.17e9, gap=1.0)],
        excitation=[Unbalance("middle", UNBALANCE)],
    )  # fmt: skip
    found = diagram(system, (19.0, 20.0), [1], search_points=1)
    write_results(found, tmp_path / "out")
    shown = unpacked((tmp_path / "out" / "report.html").read_text(encoding="utf-8"))
    natural = np.sqrt(STIFFNESS / MASS)
    for orbit in shown["orbits"]:
        omega = 2.0 * np.pi * orbit["hz"]
        size = (
            UNBALANCE
            * omega**2
            / MASS
            / np.hypot(natural**2 - omega**2, 2 * RATIO * natural * omega)
        )
        assert np.abs(numbers(orbit["displacement"])).max() == pytest.approx(size, rel=1e-4)
        assert orbit["lines"] == [1] and orbit["amplitudes"] == pytest.approx([size], rel=1e-5)
        decay = np.exp(-RATIO * natural / orbit["hz"])
        assert [abs(complex(*m)) for m in orbit["multipliers"]] == pytest.approx([decay] * 2)
        assert orbit["impacts"] == [] and not numbers(orbit["forces"][0]).any()


def test_the_page_loads_nothing_and_has_plotly_once(results):
    text = (results / "report.html").read_text(encoding="utf-8")
    assert text.count("* plotly.js v") == 1 and len(text) < 10_000_000
    files = ("page.html", "convergence.html", "common.css", "common.js")
    template = "".join((offline.HERE / name).read_text(encoding="utf-8") for name in files)
    assert re.findall(r"""(?:src|href)\s*=\s*["'](?!data:)""", template) == []
    assert "http" not in template


def test_a_large_diagram_is_thinned_and_the_page_says_so(results, monkeypatch):
    found = load(results / "branches.h5")
    monkeypatch.setattr(pages, "MOST_POINTS", 10)
    count = sum(len(branch.points) for branch in found.branches)
    (numbers_,) = kept_points(found.branches)
    assert len(numbers_) == 10 and (numbers_[0], numbers_[-1]) == (0, count - 1)
    said = pages.limits(found, [], [numbers_])
    assert said[-1].startswith(f"The diagram is thinned: it shows 10 of {count} points")


def test_the_moves_of_modes_add_up_to_the_deflected_surface():
    scene = load_scene(example("two_dof_xi_0.01.toml"))
    structure = build_structure(scene)
    shown = surface_content(structure.component, structure.reduced, "middle")
    state = np.array([1e-6, -2e-6])
    moves = [
        quantum * numbers(move, "<i2").reshape(-1, 3)
        for quantum, move in zip(shown["quanta"], shown["moves"], strict=True)
    ]
    drawing = fem.render.pictures.surface_of(structure.component, "middle")
    deflected, size = drawing.place(structure.reduced.expand(state))
    rest = numbers(shown["points"]).reshape(-1, 3)[: shown["count"]]
    moves = [move[: shown["count"]] for move in moves]
    np.testing.assert_allclose(
        rest + np.tensordot(state, moves, 1), deflected, atol=1e-3 * size.max() + 1e-7
    )


def test_a_surface_too_large_for_the_page_is_told(monkeypatch):
    monkeypatch.setattr("nldyn.report.deflection.MOST_NUMBERS", 100)
    structure = build_structure(load_scene(example("two_dof_xi_0.01.toml")))
    assert isinstance(structure.reduced, cms.ReducedModel)
    told = surface_content(
        Drawn(structure.component, structure.reduced).component, structure.reduced
    )
    assert "this page has room for 11" in told["fault"]


# --- nldyn report --------------------------------------------------------------------------------


def report(*arguments):
    return CliRunner().invoke(main, ["report", *map(str, arguments), "--quiet"])


def test_the_report_of_finished_results_is_the_same(results, content):
    (results / "report.html").unlink()
    result = report(results)
    assert (result.exit_code, result.stderr) == (0, "")
    assert result.stdout == f"written to {results / 'report.html'}\n"
    assert unpacked((results / "report.html").read_text(encoding="utf-8")) == content


def test_the_report_of_an_unfinished_run(results, content, tmp_path):
    branches = list(load(results / "branches.h5").branches)
    save_branches(tmp_path / "out.unfinished.h5", branches)
    result = report(tmp_path / "out")
    assert result.exit_code == 0, result.stderr
    assert "note: The run has not ended" in result.stdout
    shown = unpacked((tmp_path / "out" / "report.html").read_text(encoding="utf-8"))
    assert shown["notes"][0] == "The run has not ended: this is what it had computed."
    assert shown["tables"] == content["tables"]
    assert [p.name for p in (tmp_path / "out").iterdir() if p.name[0] != "."] == ["report.html"]


def test_no_results_no_report(tmp_path):
    result = report(tmp_path)
    assert result.exit_code == 2
    assert (
        result.stderr
        == f"nldyn: {tmp_path}: holds no results of 'nldyn run', finished or unfinished\n"
    )


def test_a_scene_of_other_results_is_refused(results):
    result = report(results, "--scene", example("two_dof_xi_0.01.toml"))
    assert result.exit_code == 2 and "has other modes than the results" in result.stderr


def test_results_are_not_shown_with_the_stop_of_another_scene(results, tmp_path):
    """Its modes are the same: nothing but the text tells the scenes apart."""
    text = example("one_dof.toml").read_text(encoding="utf-8")
    other = tmp_path / "other.toml"
    other.write_text(text.replace("gap = 0.0", "gap = 1e-4"), encoding="utf-8")
    (tmp_path / "branches.h5").write_bytes((results / "branches.h5").read_bytes())
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    result = report(tmp_path, "--scene", other)
    assert (result.exit_code, result.stderr.count("\n")) == (2, 1)
    assert f"{other}: says something else than {tmp_path / 'scene.toml'}" in result.stderr
    assert not (tmp_path / "report.html").exists()


def test_damaged_tables_are_one_sentence(results, tmp_path):
    for name in ("branches.h5", "branches.csv", "special_points.csv", "ends.csv", ".nldyn.json"):
        (tmp_path / name).write_bytes((results / name).read_bytes())
    (tmp_path / "summary.json").write_text("{")
    result = report(tmp_path)
    assert result.exit_code == 2 and result.stderr.count("\n") == 1
    assert "summary.json: cannot be read" in result.stderr
    (tmp_path / "summary.json").write_text(json.dumps({}))
    (tmp_path / "branches.csv").write_text("branch,point\na\n")
    assert "branches.csv: cannot be read" in report(tmp_path).stderr


def test_the_structure_of_the_page_before_is_kept_where_the_mesh_is_not_found(results, tmp_path):
    """It is shown again if it moves by as many modes as the results have."""
    found, page = load(results / "branches.h5"), tmp_path / "report.html"
    for moves, kept in ((["of one mode"], True), (["of one", "of two"], False)):
        text = offline.packed({"surface": {"moves": moves}})
        page.write_text(f'<script id="data" type="text/plain">{text}</script>', encoding="utf-8")
        assert (kept_surface(page, found) is not None) == kept
    assert kept_surface(tmp_path / "nowhere.html", found) is None
    page.write_text("no page of ours", encoding="utf-8")
    assert kept_surface(page, found) is None


def test_special_points_beside_stable_orbits_are_kept_first(results, monkeypatch):
    """And of every branch the highest stable orbit, below the highest of all."""
    found = load(results / "branches.h5")
    heights = [branch.max_abs_displacement for branch in found.branches]
    (flip,) = [p for branch in found.branches for p in branch.special_points if p.kind == "PD"]
    for most, kept in ((600, len(found.branches[0].special_points)), (1, 1)):
        monkeypatch.setattr(orbit_content, "MOST_SPECIAL", most)
        chosen = orbit_content.chosen_orbits(found.branches, heights, most=0)
        assert len([each for each in chosen if each.special >= 0]) == kept
        assert any(each.orbit is flip.orbit for each in chosen)
        stable = [each.orbit.max_abs_displacement for each in chosen if each.orbit.stable]
        branch = found.branches[0]
        assert max(stable) == max(branch.max_abs_displacement[branch.stable])
