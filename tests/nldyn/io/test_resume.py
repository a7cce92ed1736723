"""A continuation that goes on gives the points of one that was never interrupted."""

import dataclasses
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from branches_alike import assert_same_branches

from nldyn import (
    Branch,
    ContinuationOptions,
    HarmonicForce,
    Stop,
    System,
    SystemModelError,
    Unbalance,
    continue_branch,
    diagram,
    save,
    solve_orbit,
)
from nldyn.branches.arclength import Stepper
from nldyn.branches.checkpoint import Checkpoint
from nldyn.branches.endings import Ending
from nldyn.io import CheckpointFile
from nldyn.io.branches import load_branches
from nldyn.runtime import keeper
from nldyn.runtime.result_directory import OutputError

RANGE_HZ, AT = (11.0, 40.0), (12.2, 26.0, 33.0)


@pytest.fixture(scope="module")
def start(one_dof):
    return solve_orbit(one_dof, 26.0)


@pytest.fixture(scope="module")
def whole(start):
    return continue_branch(start, RANGE_HZ, at=AT)


@pytest.fixture
def often(monkeypatch):
    """Checkpoints are written at every point."""
    monkeypatch.setattr(keeper, "PAUSE", 0.0)
    monkeypatch.setattr(keeper, "SHARE", 0.0)


def stopper(count, error=RuntimeError):
    """Progress that raises an error at a point."""
    seen = iter(range(count))

    def report(*_):
        if next(seen, None) is None:
            raise error

    return report


WANTED = {"limits": (20.0, 60.0), "periods": [1, 2], "search_points": 4}


@pytest.fixture(scope="module")
def picture(one_dof):
    found = diagram(one_dof, **WANTED)
    assert any(b.stop_reasons[0].startswith("joins") for b in found.branches)
    assert any(b.closed for b in found.branches)
    return found


# --- extension -----------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [2, 250])
def test_a_run_stopped_after_some_points_goes_on_as_if_uninterrupted(start, whole, tmp_path, count):
    part = continue_branch(start, RANGE_HZ, options=ContinuationOptions(max_points=count), at=AT)
    assert len(part.nodes) < len(whole.nodes)
    save(part, tmp_path / "part.h5")
    loaded = load_branches(tmp_path / "part.h5")[0]
    assert_same_branches(continue_branch(loaded, options=ContinuationOptions()), whole)


@pytest.mark.parametrize("range_hz", [(26.0, 31.0), (11.9, 33.0)])
def test_a_wider_range_gives_the_points_of_one_continuation(start, whole, tmp_path, range_hz):
    part = continue_branch(start, range_hz)
    save(part, tmp_path / "part.h5")
    assert_same_branches(
        continue_branch(load_branches(tmp_path / "part.h5")[0], RANGE_HZ, at=AT), whole
    )


def test_extension_in_many_small_pieces(start, whole):
    branch = continue_branch(start, (25.0, 27.0))
    for width in (1.1, 1.15, 1.4):
        branch = continue_branch(branch, (25.0 / width, 27.0 * width))
    assert_same_branches(continue_branch(branch, RANGE_HZ, at=AT), whole)


def test_a_shorter_smallest_step_goes_on_where_the_longer_one_gave_up(start):
    part = continue_branch(start, (5.7, 27.0), options=ContinuationOptions(min_step=1e-3))
    assert any(reason.startswith("step below 0.001: ") for reason in part.stop_reasons)
    whole = continue_branch(start, (5.7, 27.0))
    assert_same_branches(continue_branch(part, options=ContinuationOptions()), whole)


def test_nothing_is_computed_where_nothing_is_to_be_done(whole):
    assert_same_branches(continue_branch(whole, progress=stopper(0)), whole)


def test_a_closed_branch_stays_as_it_is(picture):
    loop = next(branch for branch in picture.branches if branch.closed)
    assert_same_branches(continue_branch(loop, (20.0, 80.0), progress=stopper(0)), loop)


def test_a_branch_that_closes_in_a_wider_range_is_kept_once(picture):
    loop = next(branch for branch in picture.branches if branch.closed)
    hz = loop.frequency_hz
    first = loop.points[0]
    narrow = (0.5 * (hz.min() + first.frequency_hz), 0.5 * (first.frequency_hz + hz.max()))
    part = continue_branch(first, narrow)
    assert part.stop_reasons == ("end of the frequency range",) * 2
    longer, once = continue_branch(part, (20.0, 80.0)), continue_branch(first, (20.0, 80.0))
    assert once.stop_reasons == (Ending.CLOSED_BRANCH.value,) * 2
    assert_same_branches(longer, once)


def test_extensions_that_make_no_sense_are_refused(whole):
    with pytest.raises(SystemModelError, match=r"must contain the range of the branch, \(11, 40\)"):
        continue_branch(whole, (12.0, 38.0))
    with pytest.raises(SystemModelError, match="at: 95 Hz lies outside"):
        continue_branch(whole, at=[95.0])
    bare = Branch("bare", 1, whole.nodes, (), whole.stop_reasons)
    with pytest.raises(SystemModelError, match="'bare' cannot be extended"):
        continue_branch(bare)


# --- checkpoints ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "count", [2, 250, *(pytest.param(other, marks=pytest.mark.slow) for other in (0, 150))]
)
def test_an_interrupted_run_loses_nothing(start, whole, tmp_path, count):
    path = tmp_path / "run.h5"
    with pytest.raises(KeyboardInterrupt):
        continue_branch(
            start,
            RANGE_HZ,
            at=AT,
            progress=stopper(count, KeyboardInterrupt),
            checkpoint=CheckpointFile(path),
        )
    if count:
        part = load_branches(path)[0]
        assert len(part.nodes) >= count - 1
        assert Ending.NOT_FINISHED.value in part.stop_reasons
        assert_same_branches(continue_branch(part), whole)
    again = continue_branch(start, RANGE_HZ, at=AT, checkpoint=CheckpointFile(path))
    assert_same_branches(again, whole)
    assert_same_branches(load_branches(path)[0], whole)


def test_points_known_are_not_computed_again(start, tmp_path):
    path = tmp_path / "run.h5"
    with pytest.raises(RuntimeError):
        continue_branch(start, (20.0, 40.0), progress=stopper(60), checkpoint=CheckpointFile(path))
    known = len(load_branches(path)[0].nodes)
    seen = []
    branch = continue_branch(
        start, (20.0, 40.0), progress=seen.append, checkpoint=CheckpointFile(path)
    )
    assert len(seen) <= len(branch.nodes) - known + 2


def test_every_checkpoint_on_the_way_goes_on_to_the_same_branch(
    start, tmp_path, often, monkeypatch
):
    """As after a loss of power at any time."""
    path, range_hz = tmp_path / "run.h5", (25.5, 26.5)
    kept = []

    def keep(*_):
        if path.exists():
            kept.append(path.read_bytes())

    branch = continue_branch(start, range_hz, progress=keep, checkpoint=CheckpointFile(path))
    assert len(kept) > 20
    for number, content in enumerate(kept[::5]):
        file = tmp_path / f"{number}.h5"
        file.write_bytes(content)
        assert_same_branches(continue_branch(load_branches(file)[0]), branch)


KILLED = """
import os, signal
from nldyn import continue_branch, solve_orbit
from nldyn.io import CheckpointFile
from nldyn.runtime import keeper
from problems import make_one_dof

keeper.PAUSE = keeper.SHARE = 0.0
seen = iter(range(25))
die = lambda _: next(seen, None) is None and os.kill(os.getpid(), signal.SIGKILL)
kept = CheckpointFile("run.h5")
continue_branch(solve_orbit(make_one_dof(), 26.0), (11.0, 40.0), progress=die, checkpoint=kept)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_a_killed_run_goes_on(start, whole, tmp_path):
    tests = Path(__file__).parents[2]
    folders = os.pathsep.join([str(tests), str(tests.parent), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run(
        [sys.executable, "-c", KILLED], cwd=tmp_path, env={**os.environ, "PYTHONPATH": folders}
    )
    assert run.returncode == -signal.SIGKILL
    part = load_branches(tmp_path / "run.h5")[0]
    assert len(part.nodes) == 25
    assert_same_branches(continue_branch(part, at=AT), whole)


def test_an_interrupted_extension_goes_on(start, whole, tmp_path):
    """From the branch that was to be extended, and from what the file has of the extension."""
    part = continue_branch(start, (20.0, 40.0))
    kept = tmp_path / "part.h5"
    save(part, kept)
    for path in (kept, tmp_path / "other.h5"):
        with pytest.raises(RuntimeError):
            continue_branch(
                part, RANGE_HZ, at=AT, progress=stopper(30), checkpoint=CheckpointFile(path)
            )
        assert len(load_branches(path)[0].nodes) > len(part.nodes)
        seen = []
        longer = continue_branch(
            part, RANGE_HZ, at=AT, progress=seen.append, checkpoint=CheckpointFile(path)
        )
        assert_same_branches(longer, whole)
        assert_same_branches(load_branches(path)[0], whole)
        assert len(seen) < len(whole.nodes) - len(part.nodes) - 20


def test_an_extension_does_not_replace_another_branch(start, tmp_path):
    path = tmp_path / "run.h5"
    continue_branch(solve_orbit(start.system, 30.0), (29.0, 31.0), checkpoint=CheckpointFile(path))
    before = path.read_bytes()
    branch = continue_branch(start, (25.5, 26.5))
    with pytest.raises(SystemModelError, match="holds another continuation"):
        continue_branch(branch, (25.0, 27.0), checkpoint=CheckpointFile(path), progress=stopper(0))
    assert path.read_bytes() == before


def test_another_continuation_in_the_file_is_refused(one_dof, start, tmp_path):
    path = tmp_path / "run.h5"
    continue_branch(start, (25.0, 27.0), checkpoint=CheckpointFile(path))
    before = path.read_bytes()
    other = System.from_matrices(
        [[2.48]],
        [[16877.0]],
        {"middle": [1.0]},
        modal_damping=0.0142,
        stops=[Stop("middle", stiffness=5.17e9, dissipation=1e-6)],
        excitation=[Unbalance("middle", 4.92e-6)],
    )
    for orbit, range_hz, options in (
        (start, (25.0, 28.0), None),
        (start, (25.0, 27.0), ContinuationOptions(max_step=0.04)),
        (solve_orbit(one_dof, 26.1), (25.0, 27.0), None),
        (solve_orbit(other, 26.0), (25.0, 27.0), None),
    ):
        with pytest.raises(SystemModelError, match="holds another continuation"):
            continue_branch(
                orbit,
                range_hz,
                options=options,
                checkpoint=CheckpointFile(path),
                progress=stopper(0),
            )
    assert path.read_bytes() == before


def test_a_place_that_cannot_be_written_is_refused_before_the_work(start, tmp_path):
    with pytest.raises(OutputError, match="no such folder"):
        continue_branch(
            start,
            RANGE_HZ,
            checkpoint=CheckpointFile(tmp_path / "none" / "run.h5"),
            progress=stopper(0),
        )
    text = tmp_path / "text.h5"
    text.write_text("mine")
    with pytest.raises(SystemModelError, match="is not an HDF5 file"):
        continue_branch(start, RANGE_HZ, checkpoint=CheckpointFile(text), progress=stopper(0))
    assert text.read_text() == "mine"


def test_checkpoints_are_not_written_more_often_than_a_share_of_the_time(monkeypatch):
    now, written = [0.0], []

    def write(branches):
        written.append(now[0])
        now[0] += 1.0

    monkeypatch.setattr(keeper.time, "monotonic", lambda: now[0])
    kept = Checkpoint(write)
    for _ in range(1000):
        now[0] += 0.1
        kept.offer()
    assert keeper.PAUSE <= written[0] < keeper.PAUSE + 0.2
    assert np.diff(written).min() >= keeper.SHARE
    assert len(written) >= 4


def test_a_continuation_begun_at_a_fold_goes_on(whole, tmp_path, often):
    fold = next(s for s in whole.special_points if s.kind == "LP")
    range_hz = (0.99 * fold.frequency_hz, 1.01 * fold.frequency_hz)
    path = tmp_path / "branch.h5"
    with pytest.raises(RuntimeError):
        continue_branch(fold.orbit, range_hz, progress=stopper(5), checkpoint=CheckpointFile(path))
    assert len(load_branches(path)[0].nodes) >= 5
    resumed = continue_branch(fold.orbit, range_hz, checkpoint=CheckpointFile(path))
    assert_same_branches(resumed, continue_branch(fold.orbit, range_hz))


# --- diagrams ------------------------------------------------------------------------------------


def points_computed(monkeypatch):
    """Count the points that walks compute."""
    made = []
    advance = Stepper._advance

    def counted(*arguments):
        made.append(None)
        return advance(*arguments)

    monkeypatch.setattr(Stepper, "_advance", counted)
    return made


def test_branches_of_an_earlier_run_are_kept_until_they_are_reached(one_dof, picture, tmp_path):
    """A run that goes on and is soon stopped again has still all that the first one had."""
    path = tmp_path / "diagram.h5"
    total = sum(len(branch.nodes) for branch in picture.branches)
    for count in (int(0.8 * total), 0, 8):
        with pytest.raises(RuntimeError):
            diagram(one_dof, **WANTED, progress=stopper(count), checkpoint=CheckpointFile(path))
        found = load_branches(path)
        assert sum(len(branch.nodes) for branch in found) > 0.7 * total
        starts = {branch.points[branch.course.start].point.tobytes() for branch in found}
        assert len(starts) == len(found)


def test_a_file_of_another_diagram_is_refused_and_kept(one_dof, tmp_path):
    path = tmp_path / "diagram.h5"
    with pytest.raises(RuntimeError):
        diagram(one_dof, **WANTED, progress=stopper(8), checkpoint=CheckpointFile(path))
    kept = path.read_bytes()
    stop = dataclasses.replace(one_dof.stops[0], gap=1e-5)
    for system, wanted in (
        (dataclasses.replace(one_dof, stops=(stop,)), WANTED),
        (one_dof, {**WANTED, "limits": (20.0, 21.0)}),
    ):
        with pytest.raises(SystemModelError, match="another system, accuracy or range"):
            diagram(system, **wanted, checkpoint=CheckpointFile(path))
        assert path.read_bytes() == kept


@pytest.mark.parametrize("share", [0.2, pytest.param(0.8, marks=pytest.mark.slow)])
def test_an_interrupted_diagram_goes_on(one_dof, picture, tmp_path, monkeypatch, share):
    path = tmp_path / "diagram.h5"
    total = sum(len(branch.nodes) for branch in picture.branches)
    with pytest.raises(RuntimeError):
        diagram(
            one_dof, **WANTED, progress=stopper(int(share * total)), checkpoint=CheckpointFile(path)
        )
    known = sum(len(branch.nodes) for branch in load_branches(path))
    assert 0.5 * share * total < known < total
    made = points_computed(monkeypatch)
    again = diagram(one_dof, **WANTED, checkpoint=CheckpointFile(path))
    assert len(made) < 1.5 * (total - known) + 30
    assert [b.name for b in again.branches] == [b.name for b in picture.branches]
    assert again.notes == picture.notes
    for mine, other in zip(again.branches, picture.branches, strict=True):
        assert_same_branches(mine, other)
    save(again, tmp_path / "again.h5")
    save(picture, tmp_path / "once.h5")
    assert (tmp_path / "again.h5").read_bytes() == (tmp_path / "once.h5").read_bytes()


def test_a_file_of_a_system_with_a_law_of_its_own_is_gone_on_with(tmp_path):
    """A file cannot hold the law; the system that is asked about has it."""

    def law(depth, speed):
        return 3e5 * depth + 1e9 * depth**2, 3e5 + 2e9 * depth, 0.0 * speed

    system = System.from_modal(
        [20.0], {"m": [1.0]}, modal_damping=0.02,
        stops=[Stop("m", 3e5, 1.0, gap=2e-3, law=law)], excitation=[HarmonicForce("m", 10.0)],
    )  # fmt: skip
    start, path = solve_orbit(system, 30.0), tmp_path / "law.h5"
    with pytest.raises(KeyboardInterrupt):
        continue_branch(
            start,
            (15.0, 40.0),
            checkpoint=CheckpointFile(path),
            progress=stopper(20, KeyboardInterrupt),
        )
    resumed = continue_branch(start, (15.0, 40.0), checkpoint=CheckpointFile(path))
    whole = continue_branch(start, (15.0, 40.0))
    assert np.array_equal(resumed.frequency_hz, whole.frequency_hz)


def test_a_diagram_keeps_the_other_branches_of_its_file(one_dof, tmp_path):
    """A branch begun elsewhere stays there, also when the same call is made again."""
    path = tmp_path / "kept.h5"
    mine = continue_branch(
        solve_orbit(one_dof, 30.0), (29.0, 31.0), name="mine", checkpoint=CheckpointFile(path)
    )
    for _ in range(2):
        found = diagram(one_dof, (29.0, 31.0), (1,), checkpoint=CheckpointFile(path))
        kept = {branch.name: branch for branch in load_branches(path)}
        assert set(kept) == {"mine", *(branch.name for branch in found.branches)}
        assert_same_branches(kept["mine"], mine)
