"""The example in the docs runs."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs" / "cms.md"


def test_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code = re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), flags=re.S)
    assert len(code) == 1
    exec(code[0], {})
    printed = capsys.readouterr().out.split("\n")
    assert abs(float(printed[-3]) - 200) < 1e-9
    assert abs(float(printed[-2]) - 100) < 1e-9
