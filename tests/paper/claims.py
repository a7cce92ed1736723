"""The paper's statements, one by one, against what we compute."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from nldyn.report.results import write_table
from nldyn.search.diagram import Diagram
from paper.chaos import CLAIMS, Chaos
from paper.checks import CHECKS
from paper.evidence import READING_TOLERANCE, Finding, published_claims

Results = Mapping[str, Diagram]


@dataclass(frozen=True)
class Claim:
    """One row of the table of claims.

    Parameters
    ----------
    id, published, unit, kind, quantity, model
        As in ``data/claims.csv``.
    computed : str
        Our value or what we found.
    deviation : str
        Relative deviation in per cent, or empty.
    verdict : {"agrees", "differs", "not decided"}
    note : str
        Why, where it is known.
    """

    id: str
    published: str
    unit: str
    kind: str
    quantity: str
    model: str
    computed: str
    deviation: str
    verdict: str
    note: str


def evaluate(results: Results, chaos: Chaos | None = None) -> list[Claim]:
    """Every published claim with our value and a verdict.

    Without Lyapunov exponents the chaotic ranges are not decided.
    """
    return [judged(row, _check(row, chaos), results) for row in published_claims()]


def _check(row: Mapping[str, str], chaos: Chaos | None) -> Callable[[Results], Finding] | None:
    """The check of a claim; with the exponents where it needs them."""
    check = CHECKS.get(row["id"])
    if chaos is None:
        return check
    if row["id"] in CLAIMS:
        return lambda results: chaos.finding(CLAIMS[row["id"]], row["published"])
    if row["id"] == "damping" and check is not None:
        return lambda results: chaos.with_damping(check(results))
    return check


def write_claims(rows: Sequence[Claim], path: Path) -> None:
    """Write the columns id, published, computed, deviation, verdict, note."""
    columns = ("id", "published", "computed", "deviation", "verdict", "note")
    write_table(path, columns, ([getattr(row, c) for c in columns] for row in rows))


def verdict_counts(rows: Sequence[Claim]) -> str:
    """How many claims agree, differ and are not decided, in words."""
    verdicts = [row.verdict for row in rows]
    return ", ".join(f"{verdicts.count(v)} {v}" for v in ("agrees", "differs", "not decided"))


def judged(
    row: Mapping[str, str], check: Callable[[Results], Finding] | None, results: Results
) -> Claim:
    """A published claim with the verdict on what its check finds."""
    finding = check(results) if check else Finding(None, note="not computed")
    head = (row["id"], row["published"], row["unit"], row["kind"], row["quantity"], row["model"])
    if finding.value is None and finding.holds is None:
        return Claim(*head, finding.text, "", "not decided", finding.note)
    agrees, deviation = finding.holds is None or bool(finding.holds), ""
    if finding.value is not None:
        agrees = agrees and number_agrees(finding.value, row["published"], row["kind"])
        deviation = f"{100 * (finding.value / float(row['published']) - 1.0):+.2f} %"
    computed = finding.text or f"{finding.value:.6g}"
    return Claim(*head, computed, deviation, "agrees" if agrees else "differs", finding.note)


def number_agrees(value: float, published: str, kind: str) -> bool:
    """Whether a number is what was printed, within what was printed or can be read in a plot."""
    printed = float(published)
    if kind == "bound":
        return value <= printed
    tolerance = max(READING_TOLERANCE * abs(printed), 0.5 * last_digit(published))
    return abs(value - printed) <= tolerance


def last_digit(number: str) -> float:
    """Value of one unit in the last digit of a printed number."""
    mantissa, _, exponent = number.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return 10.0 ** (int(exponent or 0) - decimals)
