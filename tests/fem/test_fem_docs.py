"""The examples in the documentation run, and its table is what is computed."""

import doctest
import importlib
import re
from pathlib import Path

import numpy as np
import pytest
from frames import CLAMP, beam, bending_hz
from portals import THIN_BAR, THIN_MEMBERS, exact_portal_frequencies, portal

import cms
import fem

ROOT = Path(__file__).resolve().parents[2]
MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for path in sorted((ROOT / "fem").rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]
DRAWING = {f"fem.render.{name}" for name in ("gl", "pictures")}
TEXT = (ROOT / "docs" / "reference" / "fem.md").read_text(encoding="utf-8")


def test_examples_run_in_order(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    names = {}
    for block in re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL):
        exec(block, names)
    assert names["component"].stiffness.shape == (3 * 93 - 5, 3 * 93 - 5)
    assert names["fit"].converged
    assert "| length |" in capsys.readouterr().out


def test_examples_of_structures_run_in_order(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    text = (ROOT / "docs" / "reference" / "structures.md").read_text(encoding="utf-8")
    names = {}
    for block in re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL):
        exec(block.replace("bracket.html", str(tmp_path / "bracket.html")), names)
    assert len(names["component"].interfaces["hub"]) == len(names["component"].free)
    assert (tmp_path / "bracket.html").stat().st_size > 10_000


@pytest.mark.parametrize("name", sorted(set(MODULES) - DRAWING))
def test_examples_in_docstrings_run(monkeypatch, name):
    monkeypatch.chdir(ROOT)
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0
    assert result.failed == 0


def first_errors(elements):
    pinned = [fem.Support(end, ("x", "y")) for end in ("left", "right")]
    clamped = [fem.Support("left", CLAMP)]
    cases = (
        (beam(elements=elements, supports=pinned), bending_hz(np.pi)),
        (beam(elements=elements, supports=clamped), bending_hz(1.8751040687119611)),
        (portal(elements, part=THIN_BAR), exact_portal_frequencies(THIN_MEMBERS)[0]),
        (portal(elements), exact_portal_frequencies()[0]),
    )
    return [
        cms.reduce(fem.assemble(model), modes=1).frequencies_hz[0] / exact - 1
        for model, exact in cases
    ]


@pytest.mark.parametrize("elements", [2, 4, 8, 16, 32])
def test_convergence_table_is_what_is_computed(elements):
    block = TEXT.split("<!-- convergence -->")[1].split("<!-- end of convergence -->")[0]
    row = next(line for line in block.splitlines() if line.startswith(f"| {elements} |"))
    printed = [float(word) for word in row.strip("| ").split("|")[1:]]
    # the last digit, and the rounding of the determinant whose zero is exact: 4e-12, by 40 digits
    assert first_errors(elements) == pytest.approx(printed, rel=5e-3, abs=1e-11)
