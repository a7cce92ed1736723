"""How a claim of the paper is judged, and what is written of it."""

import csv
import re
from pathlib import Path

import pytest

from nldyn.paper.checks import CHECKS
from nldyn.paper.claims import (
    judged,
    last_digit,
    published_claims,
    verdict_counts,
    write_claims,
)
from nldyn.paper.evidence import Finding
from nldyn.paper.page import write_page


def claim(published="100", kind="number"):
    head = {"id": "made.up", "section": "3", "model": "1-DOF", "quantity": "a", "unit": "Hz"}
    return {**head, "published": published, "kind": kind}


def verdict(published, finding, kind="number"):
    return judged(claim(published, kind), lambda results: finding, {}).verdict


def test_every_claim_has_a_check_and_every_check_a_claim():
    assert {row["id"] for row in published_claims()} == set(CHECKS)


def test_claims_that_the_documentation_names_exist():
    text = (Path(__file__).parents[2] / "docs" / "paper.md").read_text(encoding="utf-8")
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


@pytest.mark.parametrize(("holds", "expected"), [(True, "agrees"), (False, "differs")])
def test_statement_is_judged_by_whether_it_holds(holds, expected):
    assert verdict("", Finding(holds=holds, text="found"), "statement") == expected


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
