"""Executive and case control: which sets of supports, equations and matrices a deck chooses."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from fem.formats.nastran.cards import Line

CHOICES = ("SPC", "MPC", "K2GG", "M2GG", "B2GG", "K2PP", "M2PP", "B2PP", "AUTOSPC")
BEGIN = re.compile(r"\s*BEGIN(\s+BULK|\s*$|\s+\w+\s*=)", re.IGNORECASE)
PARAM = re.compile(r"\s*PARAM\s*,", re.IGNORECASE)
"""A card that may stand before the bulk data, too."""
SUPER = re.compile(r"\s*BEGIN\s+(BULK\s+)?(SUPER|AUXMODEL)\s*=", re.IGNORECASE)


@dataclass
class Control:
    """What stands before the bulk data.

    Parameters
    ----------
    there
        Whether there is any case control.
    chosen
        All values of each choice, in the order of the cases.
    """

    there: bool = False
    chosen: dict[str, list[str]] = field(default_factory=dict)

    def first(self, name: str) -> str:
        """The value that the first case has which has one; an empty text without any."""
        return next(iter(self.chosen.get(name, [])), "")

    def others(self, name: str) -> list[str]:
        """Further values that later cases have."""
        return self.chosen.get(name, [])[1:]


def divided(lines: Sequence[Line]) -> tuple[Control, list[Line], list[Line]]:
    """The case control, the lines of the bulk data, and those that begin a superelement."""
    starts = [i for i, line in enumerate(lines) if BEGIN.match(line.text)]
    control, bulk = Control(), list(lines)
    if starts:
        for line in lines[: starts[0]]:
            _read(control, line.text)
        parameters = [line for line in lines[: starts[0]] if PARAM.match(line.text)]
        bulk = [*parameters, *lines[starts[0] + 1 :]]
    other = [line for line in lines if SUPER.match(line.text)]
    return control, bulk, other


def _read(control: Control, text: str) -> None:
    control.there = control.there or bool(re.match(r"\s*(CEND|SUBCASE)\b", text, re.IGNORECASE))
    found = re.match(r"\s*(\w+)(?:\(.*?\))?\s*=\s*(.+)", text)
    if found is None:
        return
    name = found[1].upper()
    if name in CHOICES:
        values = control.chosen.setdefault(name, [])
        value = found[2].strip().upper()
        if value not in values:
            values.append(value)
