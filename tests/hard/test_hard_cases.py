"""The quick half of the hard cases, and what becomes of cases in the tables."""

import math

import pytest

from hard.case import Case, Measured
from hard.cases import CASES
from hard.page import row, write_page
from hard.run import measure, run
from nldyn.runtime.result_directory import OutputError

# of processor time they take two thirds; `make hard` computes them all, and -m slow these
LONG = (
    "1 kg that swings 1 m, stop of 1e+06 N/m^1.5",
    "energy of the 1-DOF model over 1e5 periods, in roundings",
    "free vibration against a Hertz stop, 1e-05 m",
    "free vibration against a Hertz stop, 0.1 m",
    "period 30 at 36 Hz, multiplier above 1e+06",
    "multipliers of the orbit of period 30",
    "free body between two stops, a thousand impacts",
    "period with 12 impacts",
    "folds of the harmonic branch, 1-DOF model",
    "three branches within 1e-6 of each other",
    "scene in mm, t and s, modal frequencies",
    "scene in mm, t and s, special points from 25 to 40 Hz",
    "gap at which two folds vanish in a cusp",
    "forced free body between two stops",
    "two frequencies 1e-09 apart",
    *(
        f"damper {distance} from a defective eigenproblem"
        for distance in ("0.01", "1e-06", "1e-10")
    ),
)


def marks(case):
    known = [pytest.mark.xfail(strict=True, reason=case.fault)] if case.fault else []
    return known + [pytest.mark.slow] * (case.name in LONG)


QUICK = [
    pytest.param(case, id=f"{case.subject}: {case.name}", marks=marks(case))
    for case in CASES
    if case.quick
]


@pytest.mark.parametrize("case", QUICK)
def test_hard_case_stays_within_its_bound(case):
    result = measure(case)
    assert result.passed, f"{result.measured.error:.1e} > {case.bound:.0e}: {result.measured.note}"


def test_the_long_cases_are_among_the_quick_ones():
    assert {case.name for case in CASES if case.quick}.issuperset(LONG)


def made_up(run, bound=1.0, fault=""):
    return Case("subject", "name | x", "hard", "reference", bound, "origin", run, fault=fault)


def failing():
    raise ZeroDivisionError("no\nway")


@pytest.mark.parametrize(
    ("error", "passed"),
    [(0.5, True), (1.0, True), (1.5, False), (math.nan, False), (math.inf, False)],
)
def test_a_case_passes_within_its_bound_only(error, passed):
    assert measure(made_up(lambda: Measured(error))).passed is passed


def test_an_exception_is_a_failed_row_that_says_why():
    result = measure(made_up(failing, fault="known"))
    line = row(result)
    assert line["verdict"] == "**FAILED**"
    assert line["note"] == "ZeroDivisionError: no way; known"
    assert line["case"] == "name / x"


def test_the_page_counts_what_failed(tmp_path):
    good, bad = made_up(lambda: Measured(0.5, "fine")), made_up(failing)
    page = write_page([measure(good), measure(bad)], 1.0, tmp_path)
    text = page.read_text("utf-8")
    assert "2 cases, 1 passed, 1 failed" in text
    assert "## Subject" in text
    table = (tmp_path / "hard_cases.csv").read_text("utf-8").splitlines()
    assert len(table) == 3


def test_the_suite_refuses_a_file_as_its_folder(tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    with pytest.raises(OutputError, match="is a file"):
        run(file)


def test_every_case_is_told_apart():
    names = [(case.subject, case.name) for case in CASES]
    assert len(set(names)) == len(names)
    assert all(
        case.bound > 0.0 and case.hard and case.reference and case.bound_from for case in CASES
    )


def test_a_subject_that_there_is_not_is_named(tmp_path):
    with pytest.raises(ValueError, match="'chatter' is no subject of hard cases; there are stiff"):
        run(tmp_path / "out", only="chatter")
    assert not (tmp_path / "out").exists()
