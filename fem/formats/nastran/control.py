"""Executive and case control: which sets of supports, equations and matrices a deck chooses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fem.base.errors import ModelError
from fem.formats.nastran.cards import CASES, Line

CHOICES = ("SPC", "MPC", "K2GG", "M2GG", "B2GG", "K2PP", "M2PP", "B2PP", "AUTOSPC")
BEGIN = re.compile(r"\s*BEGIN(\s+BULK|\s*$|\s+\w+\s*=)", re.IGNORECASE)
GOES_ON = re.compile(r"\s*[KMB]2(GG|PP)\s*=.*,$", re.IGNORECASE)
"""A line whose sum of matrices goes on in the next one."""
PARAM = re.compile(r"\s*PARAM\s*,", re.IGNORECASE)
"""A card that may stand before the bulk data, too."""
SUPER = re.compile(r"\s*BEGIN\s+(BULK\s+)?(SUPER|AUXMODEL)\s*=", re.IGNORECASE)


CASE = re.compile(r"\s*(SUBCASE|SUBCOM|SYM|SYMCOM|REPCASE)\b", re.IGNORECASE)
"""A line that begins a case; what stands above the first one holds where a case says nothing."""


@dataclass(frozen=True)
class Choice:
    """What a line of case control chooses."""

    value: str
    line: Line


@dataclass
class Control:
    """What stands before the bulk data.

    Parameters
    ----------
    there
        Whether there is any case control.
    above
        Choices above the first case, by name.
    cases
        Those of each case.
    """

    there: bool = False
    above: dict[str, Choice] = field(default_factory=dict)
    cases: list[dict[str, Choice]] = field(default_factory=list)

    def choices(self, name: str) -> list[Choice]:
        """What the cases choose, each value once: a case's own choice, or that above all cases."""
        found: dict[str, Choice] = {}
        for case in self.cases or [{}]:
            if choice := case.get(name, self.above.get(name)):
                found.setdefault(choice.value, choice)
        return list(found.values())


def divided(lines: Sequence[Line], source: Path) -> tuple[Control, list[Line], list[Line]]:
    """The case control, the lines of the bulk data, and those that begin a superelement.

    Raises
    ------
    ModelError
        If one case chooses twice, or the line that begins the bulk data is misspelt.
    """
    starts = [i for i, line in enumerate(lines) if BEGIN.match(line.text)]
    control, bulk = Control(), list(lines)
    for line in lines if not starts else ():
        if re.match(r"\s*BEGIN", line.text, re.IGNORECASE):
            raise ModelError(
                f"{source}: {line.place(source)}: {line.text.strip()}: write it as BEGIN BULK"
            )
    if starts:
        before = lines[: starts[0]]
        parameters = [line for line in before if PARAM.match(line.text)]
        bulk = [*parameters, *lines[starts[0] + 1 :]]
        begun: Line | None = None
        for line in before:
            if begun is not None:
                line = Line(begun.text + line.text, begun.file, begun.number)
            begun = line if GOES_ON.match(line.text.rstrip()) else None
            if begun is None:
                _read(control, line, source)
        if begun is not None:
            raise ModelError(
                f"{source}: {begun.place(source)}: {begun.text.strip()}: ends with a comma, and no"
                " line goes on; take the comma away"
            )
    other = [line for line in lines if SUPER.match(line.text)]
    return control, bulk, other


def _read(control: Control, line: Line, source: Path) -> None:
    case = CASE.match(line.text)
    control.there = control.there or bool(case or CASES.match(line.text))
    if case:
        control.cases.append({})
    found = re.match(r"\s*(\w+)(?:\(.*?\))?\s*=\s*(.+)", line.text)
    if found is None or (name := found[1].upper()) not in CHOICES:
        return
    choice = Choice(found[2].strip().upper(), line)
    before = (control.cases[-1] if control.cases else control.above).setdefault(name, choice)
    if before.value != choice.value:
        raise ModelError(
            f"{source}: {line.place(source)}: {name} = {choice.value}: its case chooses"
            f" {name} = {before.value} already, in {before.line.place(source)}; keep one"
        )
