"""A run that is killed loses little, leaves nothing broken, and ends as if it had not been."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from killing import TABLES, check_results, check_whole, forked, run, same_results

from nldyn import parameter_study
from nldyn.base.resources import example

QUICK, FULL = 1, 220
SHARED_MEMORY = Path("/dev/shm")

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")

RANGES = {"run": "[44.0, 44.5]\nsearch_points = 1", "explore": "[26.0, 28.0]"}
EXPLORE = "[explore]\nmax_period = 2\nspacing = 0.03\nstarts = 2\nwalk_states = 100\n"


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder, in memory where there is one: every orbit is written to the disk."""
    folder = tmp_path_factory.mktemp("kills")
    if SHARED_MEMORY.is_dir():
        folder = SHARED_MEMORY / f"nldyn-kills-{os.getpid()}"
        folder.mkdir()
    yield folder
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="module", params=["run", pytest.param("explore", marks=pytest.mark.slow)])
def task(request, place):
    """A scene, its results when nobody disturbs it, how long that takes, and its file accesses."""
    kind = request.param
    text = example("one_dof.toml").read_text().partition("[[subharmonics]]")[0]
    text = text.replace("[5.0, 90.0]", RANGES[kind] + "\nrtol = 1e-7\nmax_step = 0.1")
    periods = "periods = [1, 2]" if kind == "run" else ""
    scene = place / f"{kind}.toml"
    scene.write_text(text.replace("periods = [1, 2, 3]", periods) + EXPLORE * (kind == "explore"))
    with pytest.raises(SystemExit):  # here, so that the children need not load anything
        run(scene, place / f"{kind}_loaded")()
    start = time.perf_counter()
    assert forked(run(scene, place / f"{kind}_whole"), place / "log") == 0
    return scene, place / f"{kind}_whole", time.perf_counter() - start


def kill_and_go_on(task, place, kills, seed):
    """Kill runs at random moments; each is followed by one that goes on where it was.

    Half of the kills come after a random time, half at a random access to a file. After up to
    three kills in a row a run may end, and its results are compared.
    """
    scene, whole, seconds = task
    names = (*TABLES, "coverage.csv") if (whole / "coverage.csv").exists() else TABLES
    chance = random.Random(seed)
    out, log = place / "out", place / "log"
    done = {"kills": 0, "resumed": 0, "ends": 0}
    while done["kills"] < kills:
        shutil.rmtree(out, ignore_errors=True)
        if chance.random() < 0.3:
            shutil.copytree(whole, out)  # results that are to be replaced
        for _ in range(chance.randint(1, 3)):
            before = (place / "out.unfinished.h5").exists()
            if chance.random() < 0.5:
                code = forked(run(scene, out), log, chance.uniform(0.0, 1.05) * seconds)
            else:
                event = int(chance.choice((5, 40, 90)) * chance.random())
                code = forked(run(scene, out, event), log)
            assert code in (0, -signal.SIGKILL), log.read_text()[-2000:]
            check_whole(out)
            if code == 0:
                break
            done["kills"] += 1
            done["resumed"] += before
        assert forked(run(scene, out), log) == 0, log.read_text()[-2000:]
        same_results(out, whole, names)
        check_results(out)
        assert not [e.name for e in place.iterdir() if e.name.startswith((".", "out."))]
        done["ends"] += 1
    return done


def test_a_killed_run_is_whole_or_absent_and_goes_on(task, place):
    assert kill_and_go_on(task, place, QUICK, seed=1)["ends"] >= 1


@pytest.mark.slow
def test_hundreds_of_killed_runs(task, place, record_property):
    done = kill_and_go_on(task, place, FULL // 2, seed=2)
    print(done)
    for name, count in done.items():
        record_property(name, count)


START = "from nldyn.app.command import main; main()"


@pytest.mark.slow
def test_kills_from_the_first_moment_of_the_process(task, place):
    """Also while the package is loaded and the compiled code is read."""
    scene, whole, _ = task
    chance = random.Random(3)
    out = place / "out"
    shutil.rmtree(out, ignore_errors=True)
    for _ in range(12):
        arguments = [sys.executable, "-c", START, "run", str(scene), "--out", str(out), "--quiet"]
        child = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(chance.uniform(0.0, 8.0))
        child.kill()
        assert child.wait() in (0, -signal.SIGKILL)
        check_whole(out)
    assert forked(run(scene, out), place / "log") == 0
    same_results(out, whole, TABLES)


def test_results_that_a_killed_run_had_moved_away_are_put_back(task, place):
    """Killed between the two renamings that exchange old and new results."""
    whole = task[1]
    out = place / "out"
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(whole, place / ".out.0123abcd.old")
    shutil.copytree(whole, place / ".out.4567cdef.new")
    (place / ".out.unfinished.h5.89abcdef.new").write_bytes(b"half")
    assert forked(lambda: check(out), place / "log") == 0
    same_results(out, whole)
    assert not [entry.name for entry in place.iterdir() if entry.name.startswith(".out.4")]


def check(out):
    from nldyn.runtime.result_directory import check_directory

    check_directory(out)


def test_the_draft_of_a_run_at_work_is_left_alone(tmp_path):
    from nldyn.runtime.result_directory import check_directory, result_directory

    with result_directory(tmp_path / "out", "run") as draft:
        assert forked(lambda: check_directory(tmp_path / "out"), tmp_path / "log") == 0
        assert draft.is_dir()
        (draft / "table").write_text("1")
    assert (tmp_path / "out" / "table").read_text() == "1"


def measured(system):
    return {"hz": float(system.frequencies_hz[0])}


def test_a_killed_study_goes_on_with_the_cases_it_has(tmp_path):
    chance = random.Random(4)
    keep = tmp_path / "study.jsonl"
    values = {"stops.0.gap": [1e-6 * k for k in range(60)]}

    def work():
        parameter_study(example("one_dof.toml"), values, measured, keep=keep)

    work_once = parameter_study(example("one_dof.toml"), values, measured)
    kept = 0
    for _ in range(3):
        assert forked(work, tmp_path / "log", chance.uniform(0.03, 0.2)) in (0, -signal.SIGKILL)
        if keep.exists():
            lines = keep.read_text().splitlines()
            for line in lines[:-1]:
                json.loads(line)
            assert len(lines) >= kept
            kept = len(lines)
    found = parameter_study(example("one_dof.toml"), values, measured, keep=keep)
    assert found.identical(work_once)
