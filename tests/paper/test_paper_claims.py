"""How a claim of the paper is judged, and what is written of it."""

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from fakes import FakeBranch, FakeDiagram, FakeNode, FakeOrbit, FakeSpecialPoint, resonance

import paper.checks
from paper.checks import CHECKS
from paper.claims import judged, last_digit, verdict_counts, write_claims
from paper.evidence import Finding, published_claims
from paper.page import write_page


def claim(published="100", kind="number"):
    head = {"id": "made.up", "section": "3", "model": "1-DOF", "quantity": "a", "unit": "Hz"}
    return {**head, "published": published, "kind": kind}


def verdict(published, finding, kind="number"):
    return judged(claim(published, kind), lambda results: finding, {}).verdict


def test_every_claim_has_a_check_and_every_check_a_claim():
    assert {row["id"] for row in published_claims()} == set(CHECKS)


def test_claims_that_the_documentation_names_exist():
    text = (Path(__file__).parents[2] / "docs" / "results" / "paper.md").read_text(encoding="utf-8")
    differences = text.split("## Where we differ, and why")[1]
    named = set(re.findall(r"`((?:fig|hertz|undamped|damping)[\w./]*)`", differences))
    assert len(named) > 10
    assert named <= set(CHECKS)


@pytest.mark.parametrize(
    ("published", "computed", "expected"),
    [
        ("100.0", 100.99, "agrees"),  # 1 % is what a reader can measure in a plot
        ("100.0", 101.01, "differs"),
        ("100.0", 98.99, "differs"),
        ("23", 23.49, "agrees"),  # half a unit of the last digit is more than 1 % here
        ("23", 22.49, "differs"),
        ("2", 3.0, "differs"),
        ("4.5e-6", 4.54e-6, "agrees"),
        ("4.5e-6", 4.56e-6, "differs"),
    ],
)
def test_number_agrees_within_what_was_printed_or_can_be_read(published, computed, expected):
    assert verdict(published, Finding(computed)) == expected


@pytest.mark.parametrize(("computed", "expected"), [(1e-9, "agrees"), (4.51e-6, "differs")])
def test_bound_is_met_from_below_only(computed, expected):
    assert verdict("4.5e-6", Finding(computed), "bound") == expected


@pytest.mark.parametrize(
    ("holds", "expected"), [(True, "agrees"), (False, "differs"), (np.bool_(False), "differs")]
)
def test_statement_is_judged_by_whether_it_holds(holds, expected):
    assert verdict("", Finding(holds=holds, text="found"), "statement") == expected


@pytest.mark.parametrize(
    ("computed", "holds", "expected"),
    [(27.4, True, "agrees"), (26.16, True, "differs"), (27.0, False, "differs")],
)
def test_statement_with_a_number_agrees_if_both_do(computed, holds, expected):
    row = judged(
        claim("27", "statement"), lambda results: Finding(computed, holds, "tops: ..."), {}
    )
    assert (row.verdict, row.computed) == (expected, "tops: ...")
    assert row.deviation == f"{100 * (computed / 27 - 1):+.2f} %"


@dataclass(frozen=True)
class FoundPeak:
    frequency_hz: float
    height: float
    orbit: FakeOrbit


def split_tops(monkeypatch, *frequencies):
    tops = [FoundPeak(hz, 1e-5, FakeOrbit(hz, 1e-5)) for hz in frequencies]
    monkeypatch.setattr(paper.checks, "resonance_peaks", lambda branch, range_hz: tops)
    row = {**claim("27", "statement"), "id": "fig7.split"}
    return judged(row, CHECKS["fig7.split"], {"four_dof_xi_0.01": FakeDiagram([resonance()])})


def test_split_peak_agrees_only_near_where_the_paper_has_it(monkeypatch):
    row = split_tops(monkeypatch, 24.8, 25.6, 26.16)
    assert (row.verdict, row.deviation) == ("differs", "-3.11 %")
    assert split_tops(monkeypatch, 24.8, 25.6, 26.8).verdict == "agrees"
    assert split_tops(monkeypatch, 26.4, 26.9).verdict == "differs"
    assert split_tops(monkeypatch).verdict == "differs"


@pytest.mark.parametrize(
    ("owner", "stable", "expected"),
    [("separate", False, "agrees"), ("separate", True, "differs"), ("main", False, "differs")],
)
def test_branch_b_is_judged_on_the_separate_branch_alone(monkeypatch, owner, stable, expected):
    def node(hz):
        return FakeNode(FakeOrbit(hz, 1e-5), 0.0)

    points = [("LP", 21.75), ("LP", 23.71), ("GR", 21.76)]
    special = [FakeSpecialPoint(kind, node(hz)) for kind, hz in points]
    main = FakeBranch("main", 1, [node(hz) for hz in (15.0, 23.0, 90.0)], special)
    separate = FakeBranch("separate", 1, [node(hz) for hz in (21.75, 23.71)], special)
    top = FoundPeak(23.14, 7.5e-5, FakeOrbit(23.14, 7.5e-5, 1, stable, 2))

    def highest_peak(branches, low_hz, high_hz):
        return next(((b, top) for b in branches if b.name == owner), None)

    monkeypatch.setattr(paper.checks, "highest_peak", highest_peak)
    found = FakeDiagram([main, separate])
    results = dict.fromkeys(("two_dof_xi_0.01", "two_dof_xi_0.001"), found)
    row = judged(claim("23", "statement"), CHECKS["fig4.branch.b"], results)
    assert row.verdict == expected


def test_claim_without_evidence_is_not_decided():
    assert verdict("100", Finding(note="why")) == "not decided"
    assert judged(claim(), None, {}).verdict == "not decided"


@pytest.mark.parametrize(
    ("number", "unit"), [("13.1", 0.1), ("16877", 1.0), ("5.17e9", 1e7), ("6.6e-6", 1e-7)]
)
def test_last_digit_of_a_printed_number(number, unit):
    assert last_digit(number) == pytest.approx(unit, rel=1e-12)


def test_table_and_page_hold_every_claim(tmp_path):
    rows = [
        judged(claim("100"), lambda results: Finding(100.5, note="a < b"), {}),
        judged(claim("", "statement"), lambda results: Finding(holds=False, text="none"), {}),
    ]
    assert verdict_counts(rows) == "1 agrees, 1 differs, 0 not decided"
    write_claims(rows, tmp_path / "claims.csv")
    with (tmp_path / "claims.csv").open(encoding="utf-8") as file:
        written = list(csv.DictReader(file))
    assert [row["deviation"] for row in written] == ["+0.50 %", ""]
    write_page(rows, {}, 12.0, tmp_path)
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "2 claims: 1 agrees, 1 differs, 0 not decided; computed in 12 s" in page
    assert "a &lt; b" in page
