"""Scripts of docs/gallery run, find their number, and have a picture and a place in a page."""

import ast
import runpy
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

GALLERY = Path(__file__).parents[2] / "docs" / "gallery"
SCRIPTS = sorted(GALLERY.glob("*.py"))
# above two seconds
SLOW = {"block_in_circles", "leaf_spring", "lyapunov", "run_up", "tongue", "two_wells"}


def test_there_are_twenty_or_more():
    assert len(SCRIPTS) >= 20
    assert {path.stem for path in SCRIPTS} >= SLOW


@pytest.mark.parametrize(
    "script",
    [pytest.param(p, marks=[pytest.mark.slow] if p.stem in SLOW else []) for p in SCRIPTS],
    ids=lambda path: path.stem,
)
def test_an_example_finds_its_number(script, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    matplotlib.use("Agg")
    runpy.run_path(str(script))  # its own assertion fails where the number is another
    assert plt.get_fignums()
    plt.close("all")


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_an_example_is_short_and_has_its_picture(script):
    text = script.read_text(encoding="utf-8")
    assert 20 <= len(text.splitlines()) <= 60
    assert any(isinstance(node, ast.Assert) for node in ast.walk(ast.parse(text)))
    assert (GALLERY / "images" / f"{script.stem}.png").is_file()


def test_the_page_of_the_gallery_is_what_the_scripts_say():
    made = runpy.run_path(str(GALLERY.parent / "_site" / "gallery.py"))
    assert (GALLERY / "README.md").read_text(encoding="utf-8") == made["page"]()
