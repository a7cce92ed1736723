"""The examples in the docs run."""

from __future__ import annotations

import re
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs" / "reference" / "cms.md"


def test_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code = re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), flags=re.S)
    names = {}
    exec(code[0], names)
    printed = capsys.readouterr().out.split("\n")
    assert abs(float(printed[-3]) - 200) < 1e-9
    assert abs(float(printed[-2]) - 100) < 1e-9
    exec(code[1], names)
    printed = capsys.readouterr().out.split("\n")
    exact = [float(line.split()[-1]) for line in printed[:4]]
    assert max(abs(exact[i] - 200) for i in (0, 1, 3)) < 1e-6
    assert 150 < exact[2] < 199
    exec(code[2], names)
    assert len(code) == 3
