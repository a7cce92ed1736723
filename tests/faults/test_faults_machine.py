"""A machine that fails or lacks something: one sentence, the right exit code, nothing lost."""

import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest
from killing import check_whole, run, same_results
from limited_commands import command, refusal

from nldyn.base.resources import example
from nldyn.branches.arclength import Stepper
from nldyn.report import results as output
from nldyn.runtime import keeper

START = "from nldyn.app.command import main; main()"


@pytest.fixture(autouse=True)
def ctrl_c_reaches_children():
    """A shell starts what runs in its background with Ctrl-C ignored, which children inherit."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    text = example("one_dof.toml").read_text()
    text = text.replace("[5.0, 90.0]", "[24.0, 26.0]\nsearch_points = 1\nrtol = 1e-7")
    file = tmp_path_factory.mktemp("scene") / "scene.toml"
    file.write_text(text.replace("periods = [1, 2, 3]", "periods = [1]"))
    return file


@pytest.fixture(scope="module")
def whole(scene):
    out = scene.parent / "whole"
    with pytest.raises(SystemExit) as end:
        run(scene, out)()
    assert end.value.code == 0
    return out


def invoke(scene, out, *more):
    return command("run", scene, "--out", out, "--quiet", *more, seconds=120.0)


def full(*_, **__):
    raise OSError(errno.ENOSPC, "No space left on device")


# --- a full disk ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("module", "name"),
    [
        (output, "write_table"),
        pytest.param(output, "save_diagram", marks=pytest.mark.slow),
        pytest.param(os, "fsync", marks=pytest.mark.slow),
    ],
)
def test_a_disk_that_is_full_at_the_end_keeps_what_was_computed(
    scene, whole, tmp_path, monkeypatch, module, name
):
    """And the same command goes on once there is space."""
    out = tmp_path / "out"
    with monkeypatch.context() as failing:
        failing.setattr(module, name, full)
        said = refusal(invoke(scene, out))
    assert said.startswith(f"{out}") and ": cannot be written: no space left on device" in said
    assert ".new" not in said
    assert ("keeps what was computed" in said) == (tmp_path / "out.unfinished.h5").exists()
    assert ("keeps what was computed" in said) == (name != "fsync")
    assert not out.exists()
    assert refusal(invoke(scene, out)) is None
    same_results(out, whole)
    assert [entry.name for entry in tmp_path.iterdir()] == ["out"]


@pytest.mark.slow
def test_a_disk_that_is_full_on_the_way_does_not_end_the_computation(
    scene, whole, tmp_path, monkeypatch
):
    """Only the file for going on is missing meanwhile; the results come as ever."""
    monkeypatch.setattr(keeper, "PAUSE", 0.05)
    monkeypatch.setattr(keeper, "SHARE", 0.0)
    fsync, calls = os.fsync, []

    def sometimes(handle):
        calls.append(handle)
        if len(calls) == 1:
            full()
        fsync(handle)

    monkeypatch.setattr(os, "fsync", sometimes)
    result = invoke(scene, tmp_path / "out")
    assert result.exit_code == 0 and len(calls) > 2
    assert result.stderr == (
        f"nldyn: warning: {tmp_path / 'out.unfinished.h5'}: cannot be written: no space left on "
        "device; the computation goes on without it\n"
    )
    same_results(tmp_path / "out", whole)


LIMITED = """
import resource, signal, sys
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # then the writing fails as on a full disk
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
from nldyn.app.command import main
main()
"""


@pytest.mark.slow
def test_files_that_the_system_refuses_to_grow(scene, tmp_path):
    arguments = ["run", str(scene), "--out", str(tmp_path / "out"), "--quiet"]
    end = subprocess.run(
        [sys.executable, "-c", LIMITED, *arguments], capture_output=True, text=True, timeout=300
    )
    assert end.returncode == 2
    assert all(line.startswith("nldyn: ") for line in end.stderr.splitlines()), end.stderr
    assert end.stderr.splitlines()[-1].endswith("branches.h5: cannot be written: file too large")
    assert not (tmp_path / "out").exists()
    check_whole(tmp_path / "out")


# --- folders that cannot be written to -----------------------------------------------------------


def test_a_folder_that_cannot_be_written_to_is_told_before_the_work(scene, tmp_path, monkeypatch):
    monkeypatch.setattr("nldyn.scene.run.results_of", lambda *_: pytest.fail("computed"))
    (tmp_path / "closed").mkdir(mode=0o555)
    for place in (tmp_path / "closed" / "out", "/proc/out", tmp_path / ("x" * 300)):
        said = refusal(invoke(scene, place))
        assert said.startswith(f"{place}: ")


def test_a_home_that_cannot_be_written_to(scene, tmp_path):
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    environment = {**os.environ, "HOME": str(closed)}
    drop = [] if os.getuid() else ["setpriv", "--reuid=65534", "--clear-groups"]
    if drop and shutil.which("setpriv") is None:
        pytest.skip("needs a user that is not root")
    if subprocess.run([*drop, sys.executable, "-c", ""], capture_output=True).returncode != 0:
        pytest.skip("that user cannot run Python")
    end = subprocess.run(
        [*drop, sys.executable, "-c", START, "check", str(example("one_dof.toml"))],
        capture_output=True, text=True, timeout=300, env=environment,
    )  # fmt: skip
    if end.returncode == 1 and "Permission denied" in end.stderr:
        pytest.skip("that user cannot read the package")
    assert end.returncode == 0, end.stderr
    assert "no fault found" in end.stdout
    assert end.stderr.count("\n") <= 1


# --- another process -----------------------------------------------------------------------------


def test_another_process_on_one_core_gives_the_same_bytes(scene, whole, tmp_path):
    """With another order of sets and dictionaries, and other numbers of threads."""
    code = f"import os; os.sched_setaffinity(0, [min(os.sched_getaffinity(0))]); {START}"
    arguments = ["run", str(scene), "--out", str(tmp_path / "out"), "--quiet"]
    threads = {f"{name}_NUM_THREADS": "2" for name in ("OPENBLAS", "OMP")}
    environment = {**os.environ, "PYTHONHASHSEED": "2", **threads}
    subprocess.run(
        [sys.executable, "-c", code, *arguments], check=True, timeout=300, env=environment
    )
    same_results(tmp_path / "out", whole)


# --- Ctrl-C --------------------------------------------------------------------------------------


def stopped_at(monkeypatch, owner, name, call):
    """Ctrl-C at one of the calls of a function."""
    function, calls = getattr(owner, name), []

    def interrupted(*arguments, **named):
        calls.append(None)
        if len(calls) == call:
            raise KeyboardInterrupt
        return function(*arguments, **named)

    monkeypatch.setattr(owner, name, interrupted)


STAGES = {
    "scene": ("nldyn.scene.read", "load_scene", 1, False),
    "search": ("nldyn.search.diagram", "simulate_strobe", 1, False),
    "walk": ("nldyn.branches.arclength.Stepper", "_advance", 20, True),
    "tables": ("nldyn.report.results", "write_table", 2, True),
    "picture": ("nldyn.report.results", "save_diagram", 1, True),
    "exchange": ("nldyn.runtime.result_directory", "_swap", 1, True),
}


@pytest.mark.parametrize(
    "stage",
    [pytest.param(stage, marks=[pytest.mark.slow] * (stage != "walk")) for stage in STAGES],
)
def test_ctrl_c_at_every_stage(scene, whole, tmp_path, monkeypatch, stage):
    place, name, call, kept = STAGES[stage]
    owner = sys.modules.get(place) or Stepper
    out = tmp_path / "out"
    with monkeypatch.context() as pressed:
        stopped_at(pressed, owner, name, call)
        result = invoke(scene, out, "--jobs", "1")  # the calls of this process are counted
    assert result.exit_code == 130
    assert result.stderr.startswith("nldyn: stopped by Ctrl-C") and result.stderr.count("\n") == 1
    assert ("keeps what was computed" in result.stderr) == kept
    assert (tmp_path / "out.unfinished.h5").exists() == kept
    assert not out.exists()
    assert refusal(invoke(scene, out)) is None
    same_results(out, whole)


def wait_until_it_had(child, seconds, without=frozenset()):
    """Wait until the processes of a child's session, but some, had so much processor time."""
    ticks = seconds * os.sysconf("SC_CLK_TCK")
    while child.poll() is None:
        had = ticks_of_session(child.pid)
        if sum(had[pid] for pid in had.keys() - without) >= ticks:
            return
        time.sleep(0.01)


def ticks_of_session(session):
    """Processor time of each process of a session, in ticks of the kernel: see proc(5)."""
    had = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            words = status.read_text().rpartition(")")[2].split()
            if int(words[3]) == session:
                had[int(status.parent.name)] = int(words[11]) + int(words[12])
    return had


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize(
    "seconds", [0.3, *(pytest.param(more, marks=pytest.mark.slow) for more in (1.0, 2.0, 4.0))]
)
def test_ctrl_c_from_the_terminal(tmp_path, seconds):
    """At any time from the first second of the process on, also within compiled code."""
    out = tmp_path / "out"
    scene = example("one_dof.toml")
    arguments = [sys.executable, "-c", START, "run", str(scene), "--out", str(out)]
    child = subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True, start_new_session=True)
    wait_until_it_had(child, seconds)
    os.killpg(child.pid, signal.SIGINT)
    _, said = child.communicate(timeout=300.0)
    if child.returncode == -signal.SIGINT:  # before Python has read the program
        assert seconds < 1.0
        return
    assert child.returncode == 130, said
    assert said.splitlines()[-1].startswith("nldyn: stopped by Ctrl-C"), said
    check_whole(out)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs /proc")
@pytest.mark.parametrize(
    "arguments",
    [["hard", "--only", "continuation at low damping"], ["bench"]],
    ids=["hard", "bench"],
)
def test_ctrl_c_while_a_suite_is_computed(tmp_path, arguments):
    start = [sys.executable, "-m", *arguments, "--out", str(tmp_path / "out")]
    suites = str(Path(__file__).parents[1])
    path = os.pathsep.join([suites, *filter(None, [os.environ.get("PYTHONPATH")])])
    child = subprocess.Popen(
        start,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    workers = arguments[0] == "hard"  # they do the work, once they are loaded
    wait_until_it_had(child, 4.0, {child.pid} if workers else set())
    os.killpg(child.pid, signal.SIGINT)  # as a terminal does, to its processes too
    _, said = child.communicate(timeout=300.0)
    assert child.returncode == 130, said
    assert said.splitlines()[-1] == "nldyn: stopped by Ctrl-C, nothing is written"
    assert "Traceback" not in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("after", ["raise RuntimeError", "while True: time.sleep(0.01)"])
def test_ctrl_c_in_a_destructor_is_not_lost(after):
    """Python drops what a destructor or a callback from C raises; the compiler has many."""
    start = f"""
import time
import nldyn.app.cli
from nldyn.app.command import main

class Swallower:
    def __del__(self):
        raise KeyboardInterrupt

def command(prog_name):
    Swallower()
    {after}

nldyn.app.cli.main = command
main()
"""
    arguments = [sys.executable, "-c", start]
    child = subprocess.run(arguments, capture_output=True, text=True, timeout=300.0)
    assert child.returncode == 130
    assert child.stderr == "nldyn: stopped by Ctrl-C, nothing is written\n"


POOL = """
import time
from concurrent.futures import ProcessPoolExecutor
from nldyn.runtime.executors import run_all

def second(x):
    end = time.monotonic() + 1.0
    while time.monotonic() < end:
        pass

if __name__ == "__main__":
    with ProcessPoolExecutor(3) as pool:
        run_all(second, range(100), pool, lambda *_: print("one", flush=True))
"""


@pytest.mark.parametrize("pause", [0.05, 0.5])
def test_two_ctrl_c_end_a_pool_of_processes(tmp_path, pause):
    """A process that gets the second one as it waits for work once left all others waiting."""
    script = tmp_path / "pool.py"
    script.write_text(POOL)
    child = subprocess.Popen(
        [sys.executable, str(script)], start_new_session=True, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    assert child.stdout.readline() == "one\n"
    try:
        for _ in range(2):
            os.killpg(child.pid, signal.SIGINT)
            time.sleep(pause)
            if child.poll() is not None:
                break
        child.wait(timeout=60)
    finally:
        if child.poll() is None:
            os.killpg(child.pid, signal.SIGKILL)
        child.stdout.close()
    assert child.returncode == -signal.SIGINT
