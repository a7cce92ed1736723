"""What is likely missing in a text that is not TOML."""

from __future__ import annotations

import re

from nldyn.scene.messages import shortened

PLACE = re.compile(r"\(at (?:line (\d+), column (\d+)|end of document)\)")
BARE_WORD = re.compile(r"[^\W\d][\w .-]*$")


def likely_missing(text: str, fault: str) -> str:
    """What is likely missing where a TOML reader found a fault; empty if it cannot be guessed.

    Parameters
    ----------
    text : str
        All of it.
    fault : str
        What the reader says, with the line and the column.

    Examples
    --------
    >>> likely_missing("at = tip", "Invalid value (at line 1, column 6)")
    'in \\'at = tip\\' quotes are likely missing: "tip"'
    """
    found = PLACE.search(fault)
    if found is None:
        return ""
    lines = text.splitlines() or [""]
    row, column = (int(found[1]), int(found[2])) if found[1] else (len(lines), len(lines[-1]) + 1)
    row = min(row, len(lines))
    if fault.startswith("Unclosed array"):
        row = _begin_of_array(lines, row)
    line = lines[row - 1]
    said = _guess(fault, line[: column - 1], line[column - 1 :].split("#")[0].strip())
    return f"in '{shortened(line.strip())}' {said}" if said else ""


def _begin_of_array(lines: list[str], row: int) -> int:
    """The line, from one on backwards, in which a list begins and does not end."""
    for k in range(row, 0, -1):
        if lines[k - 1].count("[") > lines[k - 1].count("]"):
            return k
    return row


def _guess(fault: str, before: str, after: str) -> str:
    """What the rest of a line, from the fault on, looks like."""
    for bracket in ("]]", "]"):
        if fault.startswith(f"Expected '{bracket}'"):
            return f"'{bracket}' is likely missing"
    if fault.startswith("Unclosed array"):
        return "']' is likely missing at the end of the list, or a comma between two values"
    if fault.startswith(("Illegal character '\\n'", 'Expected "\'"', "Expected '\"'")):
        return "a quotation mark is likely missing"
    if fault.startswith(("Unescaped '\\'", "Invalid hex value")):
        return "a path has \\: write / in its place, or single quotes around it"
    if fault.startswith("Invalid value"):
        return _guessed_value(after)
    if fault.startswith("Expected '='"):
        if after.startswith(":"):
            return "':' stands in place of '='"
        return "'=' is likely missing, or quotes around a name with blanks"
    if fault.startswith("Expected newline"):
        return _guessed_rest(before, after)
    return ""


def _guessed_value(after: str) -> str:
    """What was meant by something that is no value."""
    if not after:
        return "the value is missing"
    if after.lower() in ("true", "false", "yes", "no", "on", "off"):
        return "true or false is likely meant, in small letters"
    if re.match(r"[+-]?\.\d", after):
        return "a digit is missing before the decimal point: 0.5, not .5"
    if BARE_WORD.match(after):
        return f'quotes are likely missing: "{shortened(after)}"'
    return ""


def _guessed_rest(before: str, after: str) -> str:
    """What was meant by something that stands behind a value or a table."""
    if before.strip().endswith("]") and before.strip().startswith("["):
        return "a new line is missing behind the name of the table"
    if re.search(r"\d$", before) and re.match(r",\s*\d", after):
        return "a comma stands in place of a decimal point, or brackets are missing around a list"
    if re.search(r"\d$", before) and after.startswith("."):
        return "a digit is missing behind the decimal point: 1.0e-2, not 1.e-2"
    if re.search(r"\d$", before.rstrip()) and re.match(r"[^\W\d_]", after):
        return "a number stands without its unit: it is in SI units, 2.0e-4 for 0.2 mm"
    return ""
