"""The command from its first moment: Ctrl-C while loading, the kernels' folder, progress."""

import io
import multiprocessing
import os
import subprocess
import sys
import time
import types

import numba
import pytest

from nldyn.app import command
from nldyn.paper.workers import _ended_at_failure
from nldyn.runtime import progress


def stop_loading(_):
    raise KeyboardInterrupt


def stop_loading_an_extension(_):
    try:
        stop_loading(_)
    except KeyboardInterrupt:
        raise ImportError("numpy could not be imported") from None


@pytest.mark.parametrize("load", [stop_loading, stop_loading_an_extension])
def test_ctrl_c_while_the_package_is_loaded(monkeypatch, capsys, load):
    unready = type("Unready", (types.ModuleType,), {"main": property(load)})("nldyn.app.cli")
    monkeypatch.setitem(sys.modules, "nldyn.app.cli", unready)
    with pytest.raises(SystemExit) as end:
        command.main()
    assert end.value.code == 130
    assert capsys.readouterr().err == "nldyn: stopped by Ctrl-C, nothing is written\n"


def test_ctrl_c_in_executed_text_gives_the_exit_code_all_the_same(tmp_path):
    """As in the making of a dataclass; with ``-m`` Python would end by the signal."""
    (tmp_path / "work.py").write_text(
        "from nldyn.app.command import answering\n"
        "answering(lambda: exec('raise KeyboardInterrupt'))\n",
        encoding="utf-8",
    )
    done = subprocess.run([sys.executable, "-m", "work"], cwd=tmp_path, check=False)
    assert done.returncode == 130


def test_other_errors_of_loading_are_not_hidden(monkeypatch):
    broken = type("Broken", (types.ModuleType,), {"main": property(lambda _: 1 / 0)})(
        "nldyn.app.cli"
    )
    monkeypatch.setitem(sys.modules, "nldyn.app.cli", broken)
    with pytest.raises(ZeroDivisionError):
        command.main()


def test_no_folder_for_compiled_code():
    """Without one, a temporary folder serves, one line says so, and nothing is left of it."""
    environment = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    environment["NUMBA_CACHE_LOCATOR_CLASSES"] = "UserProvidedCacheLocator"
    code = (
        "import nldyn.flow.flow_map, os; f = os.environ['NUMBA_CACHE_DIR']; print(f, os.listdir(f))"
    )
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    folder, _, content = run.stdout.strip().partition(" ")
    assert content != "[]" and not os.path.exists(folder)
    assert run.stderr.count("\n") == 1 and "NUMBA_CACHE_DIR" in run.stderr


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_terminal_gets_one_line_that_is_cleared_at_the_end(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setattr(progress, "TERMINAL_PAUSE", 0.0)
    monkeypatch.setenv("COLUMNS", "40")
    with progress.progress_line() as report:
        report("search", 88.0)
        report("1/2", 45.678)
        report("x" * 100, 45.678)
    shown = sys.stderr.getvalue().split("\r\x1b[K")
    assert shown[1:3] == ["00:00  0 orbits, search at 88.00 Hz", "00:00  1 orbits, 1/2 at 45.68 Hz"]
    assert len(shown[3]) == 39 and shown[4] == ""


def test_a_file_gets_a_line_a_minute(monkeypatch, capsys):
    seconds = iter([0.0, 59.0, 61.0, 62.0, 130.0])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(seconds))
    with progress.progress_line() as report:
        for hz in (10.0, 20.0, 30.0, 40.0):
            report("1/1", hz)
    assert capsys.readouterr().err == (
        "01:01  2 orbits, 1/1 at 20.00 Hz\n02:10  4 orbits, 1/1 at 40.00 Hz\n"
    )


def test_worker_processes_end_with_the_work():
    worker = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60.0,))
    worker.start()
    with pytest.raises(KeyboardInterrupt), _ended_at_failure():
        raise KeyboardInterrupt
    worker.join(10.0)
    assert not worker.is_alive()


def test_compilation_is_told_and_compiled_code_is_not():
    twice = numba.njit(lambda x: 2 * x)
    said = []
    with progress.compilation_told(lambda what, frequency_hz: said.append(what)):
        twice(1)
        assert said == ["compiling, about 20 s the first time"]
        twice(2)
    numba.njit(lambda x: 3 * x)(1)
    assert len(said) == 1
