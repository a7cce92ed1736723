"""Whole runs of random machines with clearances: none raises, none is blamed for the program's.

Their scenes are sound. What fails within is a note, or the end of a branch with its sentence.
"""

import os

import pytest
from click.testing import CliRunner
from limited_runs import check_ended, limited_run
from machines import machine

from nldyn.app.cli import main

SEARCHED, TRIED = 500, 60
# those of the tried ones that are done within about a second
QUICK = (0, 2, 4, 5, 8, 10, 11, 14, 16, 18, 23, 25, 26, 29, 31, 32, 33, 39, 41, 45)
BEGUN, SOON, LONG = 1, 5, 30  # s of processor time

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")


@pytest.fixture(scope="module", autouse=True)
def loaded(tmp_path_factory):
    """A run in this process, so that its children need load nothing."""
    folder = tmp_path_factory.mktemp("machines")
    (folder / "scene.toml").write_text(machine(QUICK[2], brief=True))
    arguments = ["run", str(folder / "scene.toml"), "--out", str(folder / "out"), "--jobs", "1"]
    assert CliRunner().invoke(main, arguments).exit_code == 0


def judge(folder, text, seconds):
    """Check that a scene is computed, or answers Ctrl-C; and that it is not refused."""
    scene, out = folder / "scene.toml", folder / "out"
    scene.write_text(text)
    (folder / "out.unfinished.h5").unlink(missing_ok=True)
    ended = limited_run(scene, out, seconds)
    assert ended.code != 2, ended.errors
    check_ended(ended, scene, out)


@pytest.mark.parametrize("seed", range(TRIED))
def test_a_machine_is_computed(tmp_path, seed):
    """Near one frequency; most of the slow ones get Ctrl-C on the way."""
    judge(tmp_path, machine(seed, brief=True), SOON if seed in QUICK else BEGUN)


@pytest.mark.slow
@pytest.mark.parametrize("explored", [False, True], ids=["run", "explore"])
def test_hundreds_of_machines(tmp_path, explored):
    for seed in range(SEARCHED):
        judge(tmp_path, machine(seed, explored=explored), LONG)
