"""The page of the hard cases: one table for each subject."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from bench.page import Row, machine, markdown

from hard.case import Result
from nldyn.report.results import write_table


def row(result: Result) -> Row:
    """A result as a row of the table."""
    case, measured = result.case, result.measured
    notes = [measured.note, *([case.fault] if not result.passed else [])]
    cells = {
        "case": case.name,
        "what is hard": case.hard,
        "reference": case.reference,
        "error": f"{measured.error:.1e}",
        "bound": f"{case.bound:.0e}, {case.bound_from}",
        "s": f"{result.seconds:.1f}",
        "verdict": "passed" if result.passed else "**FAILED**",
        "note": "; ".join(note for note in notes if note),
    }
    return {title: " ".join(cell.replace("|", "/").split()) for title, cell in cells.items()}


def write_page(results: Sequence[Result], seconds: float, folder: Path) -> Path:
    """Write ``page.md`` and ``hard_cases.csv``.

    Parameters
    ----------
    results : sequence of Result
        In the order of their subjects.
    seconds : float
        Time of the whole suite.
    folder : Path
        Where to write.
    """
    passed = sum(result.passed for result in results)
    parts = [
        "# Hard cases",
        machine(),
        f"{len(results)} cases, {passed} passed, {len(results) - passed} failed; "
        f"computed in {seconds:.0f} s. How to read the tables: docs/results/hard_cases.md.",
    ]
    for subject, group in groupby(results, lambda result: result.case.subject):
        parts += [f"## {subject.capitalize()}", markdown([row(result) for result in group])]
    table = [{"subject": r.case.subject, **row(r)} for r in results]
    columns = list(table[0]) if table else []
    write_table(folder / "hard_cases.csv", columns, ([line[c] for c in columns] for line in table))
    page = folder / "page.md"
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return page
