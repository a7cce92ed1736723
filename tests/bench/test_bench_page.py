"""Targets, tables and diagrams from a few made-up numbers."""

import csv

import numpy as np
import pytest

from bench import run
from bench.figures import draw_model
from bench.measure import Sample
from bench.models import load_case
from bench.page import NOTES, write_page
from bench.run import auto_flip_points, auto_times, sample_row, special_point_rows
from bench.solids import OURS, PEER, SolidTime
from bench.studies import (
    BRANCHES,
    AtlasTime,
    BranchTime,
    FirstCall,
    GrazingError,
    ImpactTime,
    ModesTime,
    VainSearch,
    pair_up,
    profile_branch,
)
from bench.targets import (
    all_targets,
    atlas_target,
    fastest_rows,
    impact_target,
    ratio_rows,
    resonance_target,
    search_targets,
    throughput_targets,
)
from bench.throughput import (
    Row,
    Threads,
    by_fixed_steps,
    by_flow_map,
    by_solve_ivp,
    equal_error_table,
    rate_at,
    scaling_table,
)
from nldyn.runtime.result_directory import OutputError

ENGINES = ("nldyn", "solve_ivp DOP853", "solve_ivp DOP853 in numpy")


IMPACTS = [ImpactTime(4, 1e-4, 220), ImpactTime(20, 5e-4, 220)]
SEARCHES = [VainSearch(4, 4.9, True, "none"), VainSearch(20, 6.0, True, "none")]


def made_up_samples():
    return [
        Sample(model, engine, f"{k}", 1e-5 * factor * k, 3, 10.0**-k, 10.0**-k, 10.0**-k, 10.0**-k)
        for model in ("one_dof", "four_dof")
        for engine, factor in zip(ENGINES, (1.0, 400.0, 600.0), strict=True)
        for k in (4, 8, 12)
    ]


@pytest.fixture
def verdicts():
    branch = BranchTime(BRANCHES[0], 0.2, 10, 2, 0, 1e-10, (("PD", 33.0),), 2.4)
    slow = BranchTime(BRANCHES[1], 0.7, 10, 2, 1, 1e-10, (), 2.6)
    targets = all_targets(
        made_up_samples(),
        "8",
        [branch, slow],
        [ModesTime(4, 1.0, 1, 0.0), ModesTime(64, 15.0, 1, 0.0)],
        [GrazingError(0.1, 1.0, 0.0, 1e-9), GrazingError(0.01, 1.5, 0.0, 1e-10)],
        {"flow map": 0.6, "walk": 0.4},
        FirstCall(1.0, 31.0),
    )
    return {t.what: t.verdict for t in targets}


def test_verdicts_follow_from_the_numbers(verdicts):
    def of(*words):
        (found,) = [v for k, v in verdicts.items() if all(word in k for word in words)]
        return found

    assert of("one_dof", "numpy") == "met"
    assert of("four_dof", "compiled") == "met"
    assert of("sixteen_dof", "compiled") == "not measured"
    assert of("two_dof", "heyoka") == "not measured"
    assert of("one_dof", ", warm") == "met"
    assert of("four_dof", ", warm") == "missed"
    assert of("one_dof", "for each point") == "met"
    assert of("four_dof", "for each point") == "missed"
    assert of("one_dof", "1e-9") == "met"
    assert of("four_dof", "1e-9") == "missed"
    assert of("grazing") == "met"
    assert of("4 to 64 modes") == "met"
    assert of("default", "state") == "missed"
    assert of("default", "monodromy") == "met"
    assert of("tightest") == "met"
    assert of("share") == "met"
    assert of("first orbit") == "missed"


def test_the_atlas_takes_as_long_as_its_orbits():
    charts = [AtlasTime("a", 6.0, 100, 12000), AtlasTime("b", 1.0, 10, 6000)]
    found = atlas_target(charts)
    assert (found.measured, found.verdict) == ("22 min", "missed")


def test_fastest_engine_is_the_one_that_takes_least():
    (row,) = fastest_rows(made_up_samples(), ["one_dof"], [1e-8, 1e-14])
    assert row == {"model": "one_dof", "at 1e-08": "nldyn", "at 1e-14": "none"}


def test_nothing_measured_is_not_met():
    (first, *_) = all_targets([], "", [], [], [], {}, None)
    assert first.verdict == "not measured"


def test_page_holds_tables_and_diagrams(tmp_path):
    samples = made_up_samples()
    draw_model(samples, "one_dof", tmp_path, auto_flip_points())
    tables = {
        "Targets": [{"what": "speed", "verdict": "met"}],
        "Speed at equal error": ratio_rows(samples, ["one_dof"], ENGINES, [1e-8]),
        "Branches": auto_times(),
        "First call": [],
        "Work and precision": [sample_row(s) for s in samples],
    }
    page = write_page(tables, ["one_dof"], 1.0, tmp_path).read_text("utf-8")
    assert "| speed | met |" in page
    assert "| one_dof | solve_ivp DOP853 | 32 | 400 |" in page
    assert "AUTO-07p, NTST 400" in page
    assert "Nothing was measured." in page
    assert {f.name for f in tmp_path.iterdir()} == {
        "page.md",
        "targets.csv",
        "speed_at_equal_error.csv",
        "branches.csv",
        "first_call.csv",
        "work_and_precision.csv",
        "work_precision_one_dof.png",
        "work_precision_one_dof.svg",
    }
    with (tmp_path / "work_and_precision.csv").open(encoding="utf-8") as stream:
        assert len(list(csv.DictReader(stream))) == len(samples)


def test_folder_that_holds_something_else_is_refused_before_measuring(tmp_path, monkeypatch):
    (tmp_path / "thesis.txt").write_text("mine")
    monkeypatch.setattr(run, "measure_model", lambda model: pytest.fail("measured"))
    with pytest.raises(OutputError, match="not written by nldyn"):
        run.run(tmp_path)


def test_a_whole_run_writes_all_its_tables(tmp_path, monkeypatch):
    stub_measurements(monkeypatch)
    monkeypatch.setattr(run, "draw_model", lambda *_: None)
    text = run.run(tmp_path / "bench", ["one_dof"], first_call=False).read_text("utf-8")
    assert all(f"## {title}\n" in text for title in NOTES)


@pytest.mark.slow
def test_results_of_a_benchmark_that_stops_are_not_left_half_written(tmp_path, monkeypatch):
    stub_measurements(monkeypatch)
    folder = tmp_path / "bench"
    page = run.run(folder, ["one_dof"], first_call=False)
    assert page == folder / "page.md"
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    assert {"page.md", "targets.csv", "work_precision_one_dof.png"} <= set(before)

    def stops(*_):
        raise RuntimeError

    monkeypatch.setattr(run, "write_page", stops)
    with pytest.raises(RuntimeError):
        run.run(folder, ["one_dof"], first_call=False)
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


def stub_measurements(monkeypatch):
    samples = [s for s in made_up_samples() if s.model == "one_dof"]
    monkeypatch.setattr(run, "measure_model", lambda model: samples)
    studies = run.studies
    monkeypatch.setattr(run.throughput, "measure", lambda model: plain_simulations()[:4])
    monkeypatch.setattr(run.throughput, "scaling", lambda: [Threads("one_dof", 1, 1000.0, 1.0)])
    modes = [ModesTime(4, 1.0, 1, 0.0), ModesTime(64, 15.0, 1, 0.0)]
    monkeypatch.setattr(studies, "time_modes", lambda: modes)
    grazing = [GrazingError(0.1, 1.0, 0.0, 1e-9), GrazingError(0.01, 1.5, 0.0, 1e-10)]
    monkeypatch.setattr(studies, "grazing_errors", lambda: grazing)
    monkeypatch.setattr(
        studies, "time_branch", lambda task: BranchTime(task, 0.2, 10, 2, 0, 1e-10, (("PD", 33.0),))
    )
    monkeypatch.setattr(studies, "impact_times", lambda: IMPACTS)
    monkeypatch.setattr(studies, "atlas_times", lambda: [AtlasTime("one_dof", 2.0, 100, 6000)])
    monkeypatch.setattr(studies, "vain_searches", lambda: SEARCHES)
    solids = [SolidTime(way, 300, 9.0, 1.0, (50.0, 80.0)) for way in (OURS, PEER)]
    monkeypatch.setattr(run, "solid_times", lambda: solids)
    monkeypatch.setattr(run.throughput, "resonance_rates", lambda: {20.0: 3000.0})
    monkeypatch.setattr(studies, "profile_branch", lambda task: {"flow map": 0.6, "walk": 0.4})


def plain_simulations():
    return [
        Row("one_dof", "flow map", "a", 1e-6, 40000.0),
        Row("one_dof", "flow map", "b", 1e-10, 10000.0),
        Row("one_dof", "rk", "c", 1e-4, 400.0),
        Row("one_dof", "rk", "d", 1e-12, 4.0),
        Row("four_dof", "flow map", "a", 1e-9, 4000.0),
        Row("four_dof", "rk", "d", 1e-7, 4.0),
    ]


def test_rates_are_compared_at_equal_error():
    rows = plain_simulations()
    assert rate_at(rows, "one_dof", "flow map") == pytest.approx(20000.0)
    assert rate_at(rows, "one_dof", "rk") == pytest.approx(40.0)
    assert rate_at(rows, "four_dof", "rk") is None
    table = equal_error_table(rows)
    assert [row["flow map over it"] for row in table] == ["1", "500", "1", ""]
    verdicts = {t.what: t.verdict for t in throughput_targets(rows)}
    assert list(verdicts.values()) == ["met", "missed"]


def test_verdicts_on_impacts_searches_and_the_resonance_follow_from_the_numbers():
    assert impact_target(IMPACTS).verdict == "missed"
    assert [t.verdict for t in search_targets(SEARCHES)] == ["met", "missed"]
    assert search_targets([VainSearch(4, 1.0, False, "")])[0].verdict == "not measured"
    assert resonance_target({20.0: 15000.0, 25.0: 20000.0}).verdict == "met"
    assert resonance_target({20.0: 14000.0, 25.0: 20000.0}).verdict == "missed"


def test_threads_are_compared_with_one():
    one, two = Threads("one_dof", 1, 1000.0, 0.5), Threads("one_dof", 2, 3600.0, 2.0)
    row = scaling_table([one, two])[1]
    assert row["times one thread"] == "3.60"
    assert row["per core, times one thread"] == "0.90"


@pytest.mark.parametrize("model", ["one_dof", "four_dof"])
def test_engines_of_the_throughput_agree_on_a_period(model):
    case = load_case(model)
    exact = by_flow_map(case.system, case.omega, 1e-13)(case.start)
    size = np.linalg.norm(exact)
    for make, setting, error in ((by_solve_ivp, 1e-10, 1e-6), (by_fixed_steps, 16000, 1e-6)):
        found = make(case.system, case.omega, setting)(case.start)
        assert np.linalg.norm(found - exact) < error * size


def test_special_points_stand_beside_the_published_ones():
    timed = BranchTime(BRANCHES[0], 0.2, 10, 1, 0, 0.0, (("PD", 33.654364273 * (1 + 1e-9)),))
    row = special_point_rows(timed)[-1]
    assert row["nldyn"] == "1e-09"
    assert row["AUTO 200"] == "-5e-05"


def test_special_points_are_paired_by_frequency():
    a, b, alone = pair_up(np.array([1.0, 2.0, 3.0]), np.array([1.0 + 1e-9, 2.5, 3.0]))
    assert a.tolist() == [1.0, 3.0]
    assert b[1] == 3.0
    assert alone == 2


def test_shares_of_a_profile_make_a_whole():
    task = type(BRANCHES[0])("one_dof", 26.0, (25.0, 27.0))
    shares = profile_branch(task)
    assert sum(shares.values()) == pytest.approx(1.0)
    assert 0.0 < shares["flow map"] < 1.0
