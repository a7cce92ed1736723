"""The command from its first moment: Ctrl-C while loading, progress."""

import io
import math
import multiprocessing
import re
import subprocess
import sys
import time
import types

import pytest
import tqdm.std
from paper.workers import ended_at_failure

from nldyn.app import command
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


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """Time that goes on as told."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(tqdm.std, "time", lambda: now[0])
    return now


def shown_lines(terminal):
    """What follows the clock and the bar."""
    lines = [line.rstrip() for line in terminal.getvalue().split("\r")]
    return [re.sub(r"\|.*\| ?", "| ", line) for line in lines if line]


def test_terminal_gets_one_line_that_is_cleared_at_the_end(monkeypatch, clock):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("COLUMNS", "80")
    with progress.progress_line() as report:
        for seconds, done in ((0.0, 0.0), (30.0, 0.05), (60.0, 0.25), (60.01, 0.3), (90.0, 0.5)):
            clock[0] = seconds
            report("1/2", 45.678, done)
        clock[0] = 100.0
        report("x" * 100, 0.0, 0.5)
    shown = shown_lines(sys.stderr)
    assert shown[1:4] == [
        "00:30   5 % done | 1/2 at 45.68 Hz",  # less than a tenth tells too little
        "01:00  25 % done | about 2 min left: 1/2 at 45.68 Hz",  # 20 % in the last 30 s
        "01:30  50 % done | about 1 min left: 1/2 at 45.68 Hz",  # that of 0.01 s is left out
    ]
    widest = max(len(line) for line in sys.stderr.getvalue().split("\r"))
    assert len(shown) == 5 and widest <= 80 and sys.stderr.getvalue().endswith("\r")


def test_the_time_left_grows_where_the_work_stands_still(clock):
    """82 % in a minute, then nothing: after as long again nobody can tell."""
    line = progress.ProgressLine()
    for clock[0], done in ((0.0, 0.0), (30.0, 0.41), (60.0, 0.82)):
        line("1/1", 20.0, done)
    told = []
    for clock[0] in (60.0, 90.0, 118.0, 130.0):
        line("1/1", 20.0, 0.82)
        told.append(line.left())
    standing = [0.18 / 0.41 * seconds for seconds in (30.0, 60.0, 88.0)]
    assert told[:3] == pytest.approx(standing) and math.isnan(told[3])


def test_a_long_call_of_the_library_shows_a_line_of_its_own_and_only_one(monkeypatch, clock):
    """It appears after two seconds; what it calls shows none, nor what is told elsewhere."""

    @progress.shows_progress()
    def inner(progress=None):
        progress and progress("inner", 0.0, 0.9)

    @progress.shows_progress()
    def outer(seconds, progress=None):
        clock[0] += seconds
        inner()
        progress("outer", 0.0, 0.5)

    monkeypatch.setattr(sys, "stderr", Terminal())
    outer(1.0)
    assert not shown_lines(sys.stderr)
    told = []
    outer(3.0, progress=lambda *news: told.append(news))
    assert told == [("outer", 0.0, 0.5)] and not shown_lines(sys.stderr)
    outer(3.0)
    assert shown_lines(sys.stderr) == ["00:03  50 % done | outer"]
    inner()
    assert len(shown_lines(sys.stderr)) == 1


@pytest.mark.parametrize("quiet", [True, False])
def test_a_file_gets_no_line(capsys, clock, quiet):
    with progress.progress_line(quiet) as report:
        for clock[0] in (0.0, 100.0, 200.0):
            report("1/1", 20.0, 0.1)
    assert capsys.readouterr().err == ""


def test_what_an_earlier_run_did_takes_no_time(clock):
    line = progress.ProgressLine()
    line("1/1", 20.0, 0.5)
    clock[0] = 10.0
    line("1/1", 20.0, 0.75)
    assert line.left() == pytest.approx(10.0)  # 25 % took 10 s
    line("1/1", 20.0, 0.7)  # never back
    assert line.done == 0.75


def test_shares_add_up_with_their_weights():
    told = []
    whole = progress.Shares(lambda what, hz, done: told.append(done), {"a": 1.0, "b": 3.0})
    whole.part("a")("...", 0.0, 0.5)
    whole.counted("b", "motions")(2, 3)
    whole.weigh("c", 4.0)
    whole.end("b")
    whole.part("c")("...", 0.0, 7.0)
    assert told == pytest.approx([0.125, 0.625, 0.9375])


def test_worker_processes_end_with_the_work():
    worker = multiprocessing.get_context("spawn").Process(target=time.sleep, args=(60.0,))
    worker.start()
    with pytest.raises(KeyboardInterrupt), ended_at_failure():
        raise KeyboardInterrupt
    worker.join(10.0)
    assert not worker.is_alive()
