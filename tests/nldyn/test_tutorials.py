"""The tutorials run, print what they say, and draw the pictures that they show."""

import re
import runpy
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import pytest

DOCS = Path(__file__).parents[2] / "docs"
blocks = runpy.run_path(str(DOCS / "_site" / "tutorials.py"))["blocks"]
PAGES = [page for page in sorted((DOCS / "tutorials").glob("*.md")) if blocks(page, "text")]
SLOW = {"all_branches", "chaos_and_basins"}  # above three seconds


def test_there_are_five():
    assert len(PAGES) == 5


@pytest.mark.parametrize(
    "page",
    [pytest.param(p, marks=[pytest.mark.slow] if p.stem in SLOW else []) for p in PAGES],
    ids=lambda page: page.stem,
)
def test_a_tutorial_prints_what_it_says(page, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    matplotlib.use("Agg")
    exec(blocks(page, "python"), {})
    plt.close("all")
    assert capsys.readouterr().out == blocks(page, "text")
    shown = re.findall(r"!\[.*?\]\(\.\./images/(.*?)\)", page.read_text(encoding="utf-8"))
    assert {path.name for path in tmp_path.glob("*.png")} == set(shown) == {f"{page.stem}.png"}
