"""The examples in the theory and the README run and print what is said there."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
THEORY = ROOT / "docs" / "theory.md"


def test_example_runs(capsys):
    code = re.findall(r"```python\n(.*?)```", THEORY.read_text(encoding="utf-8"), flags=re.S)
    assert len(code) == 1
    exec(code[0], {})
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == "1 True"
    assert printed[-3:] == ["PD 15.773081", "PD 33.654364", "2"]
    kinds = [line.split()[0] for line in printed[1:-1]]
    assert kinds == ["LP", "LP", "GR", "PD", "PD", "PD"]


def test_example_of_the_curves_runs(capsys):
    text = (ROOT / "docs" / "curves.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    exec(code, {})
    said = re.findall(r"^print.*?# (.*)$", code, flags=re.M)
    assert capsys.readouterr().out.splitlines() == said
    assert len(said) == 4


def test_every_kind_of_special_point_is_in_the_table():
    text = THEORY.read_text(encoding="utf-8")
    for kind in ("LP", "PD", "BP", "NS", "GR"):
        assert re.search(rf"^\| {kind} \|", text, flags=re.M)


def test_example_of_the_readme_prints_what_it_says(capsys):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.S)
    exec(code, {})
    (said,) = re.findall(r"^It prints `(.*?)`", text, flags=re.M)
    assert capsys.readouterr().out == f"{said}\n"
