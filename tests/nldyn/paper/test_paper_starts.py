"""Orbits from which the branches of the larger models are followed."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from nldyn import ContinuationOptions, ExploreOptions, SystemModelError, explore, index_sum
from nldyn.branches.continuation import broken_off
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.orbit import stroboscopic
from nldyn.orbits.starts import orbit_near
from nldyn.paper.atlas import (
    LONG,
    atlas_folder,
    chart_named,
    follow_family,
    joined,
    odd_part,
    start_path,
)
from nldyn.paper.jobs import scene_system
from nldyn.paper.search import MODELS, known_branches, main, search, search_by_detour
from nldyn.paper.starts import Start, follow_starts, read_starts, starts_path, write_starts
from nldyn.runtime.progress import silent
from nldyn.runtime.result_directory import OutputError
from nldyn.search.diagram import middle_orbit
from nldyn.search.exploration import steps_between
from nldyn.search.fixed_point_index import index_note

WITHOUT_DOUBLED = (1, 50)


@pytest.fixture(scope="module")
def found():
    """Branches of the 2-DOF model in a short range, by exploring it."""
    effort = ExploreOptions(spacing=0.01, starts=6)
    return explore(scene_system("two_dof_xi_0.01"), (35.5, 36.5), 3, effort=effort).diagram


@pytest.mark.parametrize("name", MODELS)
def test_starts_are_orbits_of_their_period(name):
    """Every tenth of them; `nldyn paper` and the atlas solve for all, and tell which are none."""
    chart = chart_named(name)
    flow = FlowMap(scene_system(name))
    starts = read_starts(name)
    assert {start.period for start in starts} == {1, 2, 3}
    for start in starts:
        assert chart.range_hz[0] <= start.frequency_hz <= chart.range_hz[1]
    for start in starts[::10]:
        orbit = orbit_near(flow, start.state, start.period, start.omega, "middle")
        assert orbit is not None and orbit.period == start.period
        off = np.linalg.norm(stroboscopic(orbit)[0] - start.state)
        assert off < 1e-7 * np.linalg.norm(start.state)


def test_what_is_followed_from_starts_is_what_the_search_found(found, tmp_path):
    write_starts(starts_path("some", tmp_path), found.branches)
    starts = read_starts("some", tmp_path)
    assert len(starts) == len(found.branches)
    options = ContinuationOptions()
    system = scene_system("two_dof_xi_0.01")
    again = follow_starts(system, starts, found.range_hz, options, WITHOUT_DOUBLED)
    assert all(orbit.motion is None for branch in again.branches for orbit in branch.points)
    assert len(again.branches) == len(found.branches) > 5
    for branch in found.branches:
        middle = branch.points[len(branch.points) // 2]
        assert sum(other.contains(middle) for other in again.branches) == 1
    first = f"from {len(starts)} starts of period 1, 2, 3, each an orbit"
    assert again.notes[0] == first


def test_a_missing_branch_is_told_by_its_indices(found):
    through = next(b for b in found.branches if index_sum([b], 36.0, b.period) not in (0, 1))
    others = [branch for branch in found.branches if branch is not through]
    assert f"but for P^{through.period} from " in index_note(others, found.range_hz, 3)


def test_what_is_no_orbit_among_the_starts_is_counted(found):
    """Far from every orbit, or beside one of the period."""
    orbit = middle_orbit(found.branches[0])
    state = stroboscopic(orbit)[0]
    states = state, np.array([1.0, -1.0, 1.0, -1.0]), 1.0001 * state
    starts = [Start(orbit.period, orbit.frequency_hz, state) for state in states]
    again = follow_starts(
        scene_system("two_dof_xi_0.01"), starts, found.range_hz, ContinuationOptions(),
        WITHOUT_DOUBLED,
    )  # fmt: skip
    assert again.notes[0].startswith("from 3 starts of period ")
    assert again.notes[0].endswith(", 2 of which are no orbits")


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], "has no starts"),
        (["period,frequency_hz,state_0"], "has no starts"),
        (["period,frequency_hz,state_0", "1,20"], "line 2: has 2 columns, not 3"),
        (["period,frequency_hz", "1,20"], "line 2: has 2 columns, not 3"),
        (["period,frequency_hz,state_0", "1,20,0", "1,20,abc"], "line 3 must hold numbers only"),
        (["period,frequency_hz,state_0", "1,20,nan"], "line 2 has an entry that is not finite"),
        (["period,frequency_hz,state_0", "1.5,20,0"], "line 2: period must be"),
        (["period,frequency_hz,state_0", "1,-20,0"], "line 2: frequency_hz must be positive"),
    ],
)
def test_a_damaged_file_of_starts_is_told_by_its_line(lines, message, tmp_path):
    starts_path("some", tmp_path).write_text("".join(f"{x}\n" for x in lines), encoding="utf-8")
    with pytest.raises(SystemModelError, match=rf"starts_some\.csv: {message}"):
        read_starts("some", tmp_path)


def test_starts_of_another_model_are_refused(found):
    with pytest.raises(SystemModelError, match="start 1: has a state of 2 numbers, the system one"):
        follow_starts(
            scene_system("two_dof_xi_0.01"), [Start(1, 36.0, np.zeros(2))], found.range_hz,
            ContinuationOptions(), WITHOUT_DOUBLED,
        )  # fmt: skip


@pytest.fixture
def short_chart(found, monkeypatch, tmp_path):
    """A chart of a short range, with the starts that the search gave."""
    name = "two_dof_xi_0.01"
    chart = replace(chart_named(name), range_hz=found.range_hz, doubled=(4, 10))
    write_starts(starts_path(name, tmp_path), found.branches)
    starts = read_starts(name, tmp_path)
    monkeypatch.setattr("nldyn.paper.atlas.CHARTS", (chart,))
    monkeypatch.setattr("nldyn.paper.atlas.read_starts", lambda name: starts)
    return chart, starts


def family_of(chart, starts, family, folder):
    place = partial(start_path, folder, chart.name, family)
    (folder / chart.name).mkdir(exist_ok=True)
    chosen = [start for start in starts if odd_part(start.period) == family]
    system = scene_system(chart.name)
    return follow_starts(system, chosen, chart.range_hz, LONG, chart.doubled, keep_at=place)


@pytest.mark.slow  # 12 s
def test_families_followed_apart_are_the_diagram_followed_at_once(short_chart, tmp_path):
    """Flips lead from periods 1 and 2 to 4, but not from period 3 to these or back."""
    chart, starts = short_chart
    assert chart.families == (1, 3)
    parts = [family_of(chart, starts, family, tmp_path) for family in chart.families]
    whole = joined(parts, chart)
    system = scene_system(chart.name)
    once = follow_starts(system, starts, chart.range_hz, LONG, chart.doubled)
    assert sorted(b.period for b in whole.branches) == sorted(b.period for b in once.branches)
    for branch in once.branches:
        assert any(other.contains(middle_orbit(branch)) for other in whole.branches)
    assert whole.notes[-1].endswith(
        "of P to P^3 add up to one from 35.5 to 36.5 Hz; isolas that are missing as a whole would "
        "not change that"
    )
    ends = sum(len(broken_off(branch)) for branch in whole.branches)
    assert whole.notes[0] == f"{ends} ends of branches broken off: 10 points"


@pytest.mark.slow
def test_what_starts_lead_to_is_kept_when_an_atlas_is_interrupted(
    short_chart, monkeypatch, tmp_path
):
    """The resumed run asks only for the starts left, and gives what one at once gives.

    The first start leads to no orbit.
    """
    chart, starts = short_chart
    starts[:] = [start for start in starts if start.period < 3]
    starts.insert(0, replace(starts[0], state=np.array([1.0, -1.0, 1.0, -1.0])))
    asked = []

    def orbit_until_interrupted(*arguments):
        if len(asked) == 3:
            raise KeyboardInterrupt
        asked.append(arguments)
        return orbit_near(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr("nldyn.paper.starts.orbit_near", orbit_until_interrupted)
        with pytest.raises(KeyboardInterrupt):
            follow_family(chart.name, 1, tmp_path, silent)
    start_path(tmp_path, chart.name, 1, 1).write_bytes(b"cut")  # that one is followed again
    calls = []
    monkeypatch.setattr(
        "nldyn.paper.starts.orbit_near", lambda *a: calls.append(a) or orbit_near(*a)
    )
    resumed = family_of(chart, starts, 1, tmp_path)
    assert len(calls) == len(starts) - 2 > 2
    (other := tmp_path / "other").mkdir()
    once = family_of(chart, starts, 1, other)
    assert resumed.notes == once.notes
    assert resumed.notes[0].endswith(", 1 of which is no orbit")
    assert [branch.name for branch in resumed.branches] == [branch.name for branch in once.branches]
    for branch, same in zip(resumed.branches, once.branches, strict=True):
        assert branch.stop_reasons == same.stop_reasons
        points = [[orbit.point for orbit in b.points] for b in (branch, same)]
        np.testing.assert_array_equal(*points)


def test_the_atlas_of_other_code_is_refused(tmp_path, monkeypatch):
    place = tmp_path / "atlas"
    assert atlas_folder(place) == atlas_folder(place) == place
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").touch()
    with pytest.raises(OutputError, match="other: holds something else than an atlas"):
        atlas_folder(tmp_path / "other")
    monkeypatch.setattr("nldyn.paper.atlas.stamp", lambda: "another")
    with pytest.raises(OutputError, match="is an atlas of another version"):
        atlas_folder(place)


@pytest.fixture
def two_known(monkeypatch, tmp_path):
    """A short range of the 2-DOF model, and a directory with two starts."""
    job = chart_named("two_dof_xi_0.01")
    low, high = 35.5, 35.95
    monkeypatch.setattr("nldyn.paper.atlas.CHARTS", (replace(job, range_hz=(low, high)),))
    head, *rows = starts_path(job.name).read_text(encoding="utf-8").splitlines(keepends=True)
    within = [row for row in rows if low < float(row.split(",")[1]) < high]
    starts_path(job.name, tmp_path).write_text("".join([head, *within[:2]]), encoding="utf-8")
    return job.name, tmp_path


@pytest.mark.slow
def test_a_detour_gives_starts(two_known):
    name, folder = two_known
    known = read_starts(name, folder)
    done = search_by_detour(name, folder, {"excitation": 2.0})
    assert done.notes[-1].startswith("at 2 of the excitation: ")
    assert len(read_starts(name, folder)) == len(done.branches) > len(known) == 2


@pytest.mark.parametrize(
    ("way", "what"),
    [
        ("pseudo-orbits", "pseudo-orbits"),
        ("crossover", "mixtures"),
        pytest.param("closed-walks", "closed walks", marks=pytest.mark.slow),
    ],
)
def test_guesses_give_starts(way, what, two_known, monkeypatch, capsys):
    name, folder = two_known
    command = ["search", str(folder), name, f"--{way}", "3", "--range", "35.6", "35.95"]
    numbers = ["--periods", "1", "2", "--spacing", "0.005", "--tries", "30"]
    monkeypatch.setattr("sys.argv", command + numbers)
    main()
    last = capsys.readouterr().out.splitlines()[-1]
    tried = 2 * 30 * steps_between(35.6, 35.95, 0.005)
    assert f" {what} led to an orbit" in last
    made = int(re.search(r" of (\d+) ", last)[1])
    assert made == tried if way == "crossover" else 0 < made <= tried
    added = int(re.search(r", (\d+) branch(es)? beside those given", last)[1])
    assert len(read_starts(name, folder)) == 2 + added > 2


@pytest.mark.slow  # 27 s
def test_a_search_is_kept_and_gives_starts_from_which_the_next_one_begins(two_known, monkeypatch):
    name, folder = two_known
    first = starts_path(name, folder).read_bytes()
    nothing_more = {"pseudo_orbits": 0, "mixtures": 0, "walks": 0}
    effort = ExploreOptions(spacing=0.02, starts=1, settling=100, **nothing_more)
    done = search(name, folder, effort)
    found = read_starts(name, folder)
    assert len(found) == len(done.diagram.branches) > done.stage.given == 2
    monkeypatch.setattr("nldyn.paper.search.follow_starts", None)  # all are followed already
    more = search_by_detour(name, folder, {"damping": 0.5})
    assert len(read_starts(name, folder)) == len(more.branches) >= len(found)
    starts_path(name, folder).write_bytes(first)
    again = search(name, folder, effort)
    assert again.question.effort.seed == done.question.effort.seed + 1
    ended = [path.read_text() for path in folder.glob("*.searches.csv")]
    assert [text.count("\n") for text in ended] == [3]  # a line of names, and two searches
    assert not list(folder.glob("*.searched.h5"))
    assert again.stage.given == 2


def test_the_command_tells_all_notes(two_known, monkeypatch, capsys):
    name, folder = two_known
    factors = ["damping=0.5", "natural_frequency_hz[1]=1.01"]
    monkeypatch.setattr("sys.argv", ["search", str(folder), name, "--detour", *factors])
    main()
    first, *others, last = capsys.readouterr().out.splitlines()
    assert first == f"{name}: from 2 starts of period 2, 3, each an orbit"
    assert any(note.startswith("indices of the fixed points of P to P^3 ") for note in others)
    assert last.startswith("at 0.5 of the damping and 1.01 of natural_frequency_hz[1]: ")


def test_branches_of_another_model_are_refused(two_known, monkeypatch):
    """Their file is named after the starts, which lead to orbits of a changed model as well."""
    name, folder = two_known
    chart = chart_named(name)
    known, _, _ = known_branches(chart, folder, silent)
    assert len(known.branches) == 2
    system = scene_system(name)
    changed = replace(system, damping=1.001 * system.damping)
    monkeypatch.setattr("nldyn.paper.search.scene_system", lambda name: changed)
    with pytest.raises(SystemModelError, match="are of another model; delete them"):
        known_branches(chart, folder, silent)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["damping"], "'damping' is not of the form NAME=FACTOR or NAME[INDEX]=FACTOR"),
        (["stiffness[a]=2"], "is not of the form"),
        (["damping=half"], "is not of the form"),
        (["damping=0.5", "damping=0.3"], "names something twice"),
        (["damping=0.5", "--detour", "damping=0.3"], "names something twice"),
        (
            ["damping=0.5", "--pseudo-orbits", "1"],
            "--pseudo-orbits: not allowed with argument --detour",
        ),
        (["damping=0.5", "--crossover", "1"], "--crossover: not allowed with argument --detour"),
        (["damping=0.5", "--crossover", "-1"], "'-1' is no whole number from zero on"),
        (["gap=2"], "two_dof_xi_0.01: factors: gap[0] is zero, which no factor changes"),
        (["natural_frequency_hz[2]=2"], "there is no mode 2"),
        (["modal_damping[-1]=1"], "that of modal_damping of all modes must be a number"),
        (["nonsense=2"], "'nonsense' is none of damping, "),
        (
            ["damping=0.5", "--tries", "3"],
            "--tries: goes only with --pseudo-orbits, --crossover and --closed-walks",
        ),
    ],
)
def test_detours_that_make_no_sense_are_refused(two_known, given, message, monkeypatch, capsys):
    name, folder = two_known
    new = folder / "new"
    monkeypatch.setattr("sys.argv", ["search", str(new), name, "--detour", *given])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert message in capsys.readouterr().err
    assert not new.exists()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--range", "30", "35.9"], "range_hz = (30, 35.9) must lie within that of the branches"),
        (["--range", "36", "35"], "range_hz must be two positive frequencies, ascending"),
        (["--periods", "1", "4"], "--periods must be two, ascending"),
        (["--periods", "3", "2"], "--periods must be two, ascending"),
        (["--spacing", "0"], "--spacing must be at least"),
        (["--tries", "0"], "--tries must be"),
        (["--states", "0"], "--states must be"),
        (["--states", "9"], "argument --states: goes only with --closed-walks"),
    ],
)
def test_numbers_that_make_no_sense_are_refused(two_known, given, message, monkeypatch, capsys):
    name, folder = two_known
    new = folder / "new"
    monkeypatch.setattr("sys.argv", ["search", str(new), name, "--crossover", "1", *given])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert message in capsys.readouterr().err
    assert not new.exists()
