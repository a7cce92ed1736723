"""Some of the hard cases, and what becomes of cases in the tables."""

import math

import pytest

from hard.case import Case, Measured
from hard.cases import CASES
from hard.page import row, write_page
from hard.run import measure, run
from nldyn.runtime.result_directory import OutputError

# one to three of each subject; `make hard` computes all, and -m slow those that are quick
IN_THE_GATE = (
    "1-DOF model at 20 Hz, stop of 1e+10 N/m^1.5",
    "1 kg that swings 1 m, stop of 1e+12 N/m^1.5",
    "impact beyond the limit, 1e+24 N/m^1.5",
    "touch at 1e-08 m/s",
    "continuation through two grazing points",
    "damping ratio 0",
    "free vibration against a linear stop, 0.001 m",
    "impact at 1 m/s on a Hertz stop with a dissipation of 40 s/m",
    "two equal frequencies, orbit and multipliers",
    "two stops at one place",
    "shaken under preload, 1e+06 N/m^1.5",
    "peak of a linear resonance, Q = 1e+06",
    "resonance against the stop, Q = 1",
    "cantilever with thickness 0.001 of its length, moment, reduced model",
    "bar of cells with aspect ratio 10000",
    "units of 1e+12 kg, 1e-12 m, 1e-06 s: special points from 11 to 36 Hz",
    "a ball comes to rest, e = 0.8",
    "two stops are hit at one instant",
)


def marks(case):
    known = [pytest.mark.xfail(strict=True, reason=case.fault)] if case.fault else []
    return known + [pytest.mark.slow] * (case.name not in IN_THE_GATE)


QUICK = [
    pytest.param(case, id=f"{case.subject}: {case.name}", marks=marks(case))
    for case in CASES
    if case.quick
]


@pytest.mark.parametrize("case", QUICK)
def test_hard_case_stays_within_its_bound(case):
    result = measure(case)
    assert result.passed, f"{result.measured.error:.1e} > {case.bound:.0e}: {result.measured.note}"


def test_the_cases_in_the_gate_are_among_the_quick_ones():
    assert {case.name for case in CASES if case.quick}.issuperset(IN_THE_GATE)


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
