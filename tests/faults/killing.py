"""Run the command in a child process, and end that at some moment without a warning."""

from __future__ import annotations

import csv
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

from PIL import Image

from nldyn.app.cli import main
from nldyn.io.branches import load_branches, load_diagram
from nldyn.runtime import keeper
from nldyn.runtime.result_directory import MANIFEST

TABLES = ("branches.csv", "special_points.csv", "ends.csv", "branches.h5", "summary.json")
PICTURES = ("diagram.png", "diagram.svg")


def forked(work: Callable[[], None], log: Path, seconds: float | None = None) -> int:
    """Exit code of a child that does some work; -9 if it was killed, after so many seconds."""
    pid = os.fork()
    if pid == 0:
        code = 99
        try:
            output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
            os.dup2(output, 1)
            os.dup2(output, 2)
            work()
            code = 0
        except SystemExit as end:
            code = int(end.code or 0)
        finally:
            os._exit(code)
    if seconds is not None:
        time.sleep(seconds)
        os.kill(pid, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def die_at(event: int) -> Callable[[str, tuple[object, ...]], None]:
    """An audit hook that kills the process at one of its accesses to files."""
    left = event

    def hook(name: str, what: tuple[object, ...]) -> None:
        nonlocal left
        writes = name == "open" and isinstance(what[2], int) and what[2] & 3
        if writes or name in ("os.rename", "os.mkdir", "os.remove", "os.rmdir", "os.link"):
            left -= 1
            if left < 0:
                os.kill(os.getpid(), signal.SIGKILL)

    return hook


def run(scene: Path, out: Path, event: int | None = None) -> Callable[[], None]:
    """The work of `nldyn run`, which keeps what it has twenty times a second."""

    def work() -> None:
        keeper.PAUSE, keeper.SHARE = 0.05, 0.0
        if event is not None:
            sys.addaudithook(die_at(event))
        main(["run", str(scene), "--out", str(out), "--quiet"])

    return work


def check_whole(out: Path) -> None:
    """Check that the files of results, and of an unfinished run, are whole or absent."""
    if out.exists():
        check_results(out)
    unfinished = out.with_name(out.name + ".unfinished.h5")
    if unfinished.exists():
        load_branches(unfinished)


def check_results(out: Path) -> None:
    """Read all the results of a run."""
    for name in json.loads((out / MANIFEST).read_text())["run"]:
        assert (out / name).is_file()
    with (out / "branches.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert all(None not in row.values() and None not in row for row in rows)
    points = sum(len(branch.points) for branch in load_diagram(out / "branches.h5").branches)
    assert json.loads((out / "summary.json").read_text())["points"] == points == len(rows)
    with (out / "special_points.csv").open(newline="") as file:
        assert all(None not in row.values() for row in csv.DictReader(file))
    ElementTree.parse(out / "diagram.svg")
    with Image.open(out / "diagram.png") as picture:
        picture.load()


def same_results(out: Path, whole: Path, names: tuple[str, ...] = (*TABLES, *PICTURES)) -> None:
    """Check that two runs left the same bytes."""
    for name in names:
        assert (out / name).read_bytes() == (whole / name).read_bytes(), name
