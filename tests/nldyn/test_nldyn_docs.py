"""The example in the theory runs and prints what its comments say."""

from __future__ import annotations

import re
from pathlib import Path

THEORY = Path(__file__).parents[2] / "docs" / "theory.md"


def test_example_runs(capsys):
    code = re.findall(r"```python\n(.*?)```", THEORY.read_text(encoding="utf-8"), flags=re.S)
    assert len(code) == 1
    exec(code[0], {})
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "1 True"
    assert printed[-3:] == ["PD 15.773081", "PD 33.654364", "2"]
    kinds = [line.split()[0] for line in printed[1:-1]]
    assert kinds == ["LP", "LP", "GR", "PD", "PD", "PD"]


def test_every_kind_of_special_point_is_in_the_table():
    text = THEORY.read_text(encoding="utf-8")
    for kind in ("LP", "PD", "BP", "NS", "GR"):
        assert re.search(rf"^\| {kind} \|", text, flags=re.M)
