"""Whole runs in child processes, with limits of processor time and memory, and what they leave."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import resource
import shutil
import signal
import sys
import tomllib
import traceback
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from killing import check_results

from nldyn.app.command import main
from nldyn.io.branches import load_diagram

PROCESSOR_SECONDS = 20  # after which Ctrl-C comes
PATIENCE = 60  # more of them, after which it counts as not answered
STOPPED = 130
MEMORY = 2_000_000_000  # bytes beyond what the process has at the start
UNKNOWN = {"relative_uncertainty", "liouville_error"}  # columns that may be empty
SENTENCE = re.compile(r"nldyn: [^\n]{1,2000}\n\Z")


@dataclass(frozen=True)
class Ended:
    """How a run ended: exit code (negative for a signal), and what it said."""

    code: int
    output: str
    errors: str


def limited_run(scene: Path, out: Path, seconds: int = PROCESSOR_SECONDS) -> Ended:
    """Call ``nldyn run`` in a child that has so much processor time."""
    shutil.rmtree(out, ignore_errors=True)
    texts = [scene.with_suffix(end) for end in (".output", ".errors")]
    pid = os.fork()
    if pid == 0:
        code = 99
        try:
            sys.stdout, sys.stderr = (text.open("w", errors="replace") for text in texts)
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            memory = pages * resource.getpagesize() + MEMORY
            resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + PATIENCE))
            signal.signal(signal.SIGXCPU, interrupt)
            sys.argv = ["nldyn", "run", str(scene), "--out", str(out), "--quiet", "--jobs", "1"]
            main()
            code = 0
        except SystemExit as end:
            code = int(end.code or 0)
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    return Ended(code, *(text.read_text(errors="replace") for text in texts))


def interrupt(*_: object) -> None:
    """What Ctrl-C does, once."""
    signal.signal(signal.SIGXCPU, signal.SIG_IGN)
    raise KeyboardInterrupt


def check_ended(ended: Ended, scene: Path, out: Path) -> None:
    """Check that a run was refused in one sentence that names a key, or left whole results.

    Or it had to be ended by Ctrl-C, and answered that.
    """
    assert "Traceback" not in ended.errors, ended.errors
    assert ended.code in (0, 1, 2, STOPPED), ended
    if ended.code == STOPPED:
        assert ended.errors.splitlines()[-1].startswith("nldyn: stopped by Ctrl-C")
        if out.exists():  # it came when all was written
            check_results(out)
        return
    if ended.code == 2:
        assert SENTENCE.search(ended.errors), ended.errors
        assert not out.exists()
        check_names_key(ended.errors.splitlines()[-1], scene)
        return
    check_results(out)
    check_tables(out)
    empty = not load_diagram(out / "branches.h5").branches
    assert (ended.code == 1) == empty
    if empty:
        assert "note: " in ended.output
        assert ended.errors.endswith("nldyn: no periodic orbit was found; the tables are empty\n")


def check_names_key(sentence: str, scene: Path) -> None:
    """Check that a refusal names the file and one of its tables, or one that it lacks."""
    assert sentence.startswith(f"nldyn: {scene}: "), sentence
    try:
        tables = tomllib.loads(scene.read_text())
    except tomllib.TOMLDecodeError:
        return
    fault = sentence.removeprefix(f"nldyn: {scene}: ")
    assert any(word in fault for word in keys(tables) | {"excitation", "continuation"}), sentence


def keys(tree: Any) -> set[str]:
    """All keys of a tree of tables and lists."""
    if isinstance(tree, dict):
        return set(tree).union(*map(keys, tree.values()))
    return set().union(*map(keys, tree)) if isinstance(tree, list) else set()


def check_tables(out: Path) -> None:
    """Check that all numbers of the tables and of the picture are finite."""
    json.loads((out / "summary.json").read_text(), parse_constant=refuse)
    for file in out.glob("*.csv"):
        with file.open(newline="") as table:
            for row in csv.DictReader(table):
                for name, value in row.items():
                    assert value not in ("nan", "inf", "-inf"), (file.name, name)
                    if file.name == "branches.csv" and name not in UNKNOWN | {"branch"}:
                        assert math.isfinite(float(value)), (name, value)
    assert "nan" not in re.sub(r"<!--.*?-->", "", (out / "diagram.svg").read_text().lower())


def refuse(text: str) -> None:
    """Refuse what JSON has no word for."""
    raise AssertionError(text)
