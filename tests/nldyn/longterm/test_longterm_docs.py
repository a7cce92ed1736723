"""The examples on long-term behaviour run and print what is said beside them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[3] / "docs" / "how-to"
PAGES = ["lyapunov", "basins", "cluster", "initial_states"]


@pytest.mark.parametrize("page", [*PAGES, pytest.param("simulation", marks=pytest.mark.slow)])
def test_examples_print_what_they_say(page, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = (DOCS / f"{page}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    assert blocks
    for code in blocks:
        exec(code, {"__name__": "__main__"})
        said = re.findall(r"^ *print\(.*?\) +# (.*)$", code, flags=re.M)
        printed = capsys.readouterr().out.splitlines()
        assert ", ".join(printed) == ", ".join(said)
