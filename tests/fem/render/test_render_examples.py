"""The examples of the docstrings run."""

from __future__ import annotations

import doctest
import importlib
import re
from pathlib import Path

import pytest
import pyvista

from fem.render import gl_available

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "modes.md"


@pytest.mark.parametrize("name", ["gl", "pictures"])
def test_examples(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
    results = doctest.testmod(importlib.import_module(f"fem.render.{name}"))
    assert results.attempted > 0
    assert results.failed == 0


def test_the_page_on_modes_shows_them(monkeypatch):
    available, advice = gl_available()
    if not available:
        pytest.skip(advice)
    titles = []

    def show(plotter):
        titles.extend(field.actors["title"].input for field in plotter.renderers[:3])

    monkeypatch.setattr(pyvista.Plotter, "show", show)
    text = PAGE.read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    exec(code, {})
    in_table = re.findall(r"^ +\d +([\d.]+) +\d", text, flags=re.M)
    assert titles == [f"{float(hz):.1f} Hz, along y" for hz in in_table]
    assert len(titles) == 3
