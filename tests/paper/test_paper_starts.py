"""Orbits from which the branches of the larger models are followed."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from nldyn import ContinuationOptions, ExploreOptions, SystemModelError, explore, index_sum
from nldyn.branches.continuation import broken_off
from nldyn.flow.flow_map import FlowMap
from nldyn.orbits.orbit import stroboscopic
from nldyn.orbits.starts import orbit_near
from nldyn.runtime.progress import silent
from nldyn.runtime.result_directory import OutputError
from nldyn.search.collector import middle_orbit
from nldyn.search.fixed_point_index import index_note
from paper.atlas import (
    CHARTS,
    LONG,
    atlas_folder,
    chart_named,
    follow_family,
    joined,
    odd_part,
    start_path,
)
from paper.jobs import scene_system
from paper.starts import Start, follow_starts, read_starts, starts_path, write_starts

WITHOUT_DOUBLED = (1, 50)


@pytest.fixture(scope="module")
def found():
    """Branches of the 2-DOF model in a short range, by exploring it."""
    effort = ExploreOptions(spacing=0.01, starts=6)
    return explore(scene_system("two_dof_xi_0.01"), (35.5, 36.5), 3, effort=effort).diagram


@pytest.mark.parametrize("name", [chart.name for chart in CHARTS])
def test_starts_are_orbits_of_their_period(name):
    """Every tenth of them; `make paper` and the atlas solve for all, and tell which are none."""
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
    again = follow_starts(system, starts, found.limits, options, WITHOUT_DOUBLED)
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
    assert f"but for P^{through.period} from " in index_note(others, found.axis, 3)


def test_what_is_no_orbit_among_the_starts_is_counted(found):
    """Far from every orbit, or beside one of the period."""
    orbit = middle_orbit(found.branches[0])
    state = stroboscopic(orbit)[0]
    states = state, np.array([1.0, -1.0, 1.0, -1.0]), 1.0001 * state
    starts = [Start(orbit.period, orbit.frequency_hz, state) for state in states]
    again = follow_starts(
        scene_system("two_dof_xi_0.01"), starts, found.limits, ContinuationOptions(),
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
            scene_system("two_dof_xi_0.01"), [Start(1, 36.0, np.zeros(2))], found.limits,
            ContinuationOptions(), WITHOUT_DOUBLED,
        )  # fmt: skip


@pytest.fixture
def short_chart(found, monkeypatch, tmp_path):
    """A chart of a short range, with the starts that the search gave."""
    name = "two_dof_xi_0.01"
    chart = replace(chart_named(name), range_hz=found.limits, doubled=(4, 10))
    write_starts(starts_path(name, tmp_path), found.branches)
    starts = read_starts(name, tmp_path)
    monkeypatch.setattr("paper.atlas.CHARTS", (chart,))
    monkeypatch.setattr("paper.atlas.read_starts", lambda name: starts)
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
        patch.setattr("paper.starts.orbit_near", orbit_until_interrupted)
        with pytest.raises(KeyboardInterrupt):
            follow_family(chart.name, 1, tmp_path, silent)
    start_path(tmp_path, chart.name, 1, 1).write_bytes(b"cut")  # that one is followed again
    calls = []
    monkeypatch.setattr("paper.starts.orbit_near", lambda *a: calls.append(a) or orbit_near(*a))
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
    monkeypatch.setattr("paper.atlas.stamp", lambda: "another")
    with pytest.raises(OutputError, match="is an atlas of another version"):
        atlas_folder(place)
