"""Whole runs of random scenes: refused in one sentence, or computed; nothing else happens.

Scenes ask for little, so that they take a second; one that takes long must answer Ctrl-C.
"""

import os

import pytest
from click.testing import CliRunner
from hypothesis import given
from limited_runs import check_ended, limited_run
from random_scenes import altered_scene, random_scene
from small_meshes import fuzz, write_meshes

from nldyn.app.cli import main

QUICK, FULL = 2, 150
SOON = 2  # s of processor time

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")

PLAIN = """
[modal]
frequencies_hz = [10.0, 30.0]
participation.a = [1.0, 0.5]
[damping]
modal_ratio = 0.05
[[stops]]
at = "a"
stiffness = 1e9
[[excitation]]
at = "a"
kind = "harmonic"
amplitude = 1.0
[continuation]
range_hz = [12.0, 13.0]
periods = [1]
search_points = 1
rtol = 1e-5
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with the meshes; a run in this process, so that its children need load nothing."""
    place = tmp_path_factory.mktemp("runs")
    write_meshes(place)
    (place / "plain.toml").write_text(PLAIN)
    arguments = ["run", str(place / "plain.toml"), "--out", str(place / "plain"), "--quiet"]
    assert CliRunner().invoke(main, arguments).exit_code == 0
    return place


def judge(folder, text, **limits):
    """Check what `nldyn run` makes of a scene."""
    scene, out = folder / "scene.toml", folder / "out"
    scene.write_bytes(text.encode("utf-8", "surrogatepass"))
    check_ended(limited_run(scene, out, **limits), scene, out)


@fuzz(QUICK)
@given(text=random_scene())
def test_a_random_scene_is_computed(folder, text):
    judge(folder, text, seconds=SOON)


@fuzz(QUICK)
@given(text=altered_scene())
def test_a_run_of_other_values_is_refused_or_computed(folder, text):
    judge(folder, text, seconds=SOON)


@pytest.mark.slow
@fuzz(FULL)
@given(text=random_scene())
def test_hundreds_of_random_scenes(folder, text):
    judge(folder, text)


@pytest.mark.slow
@fuzz(FULL)
@given(text=altered_scene())
def test_hundreds_of_runs_of_other_values(folder, text):
    judge(folder, text)
