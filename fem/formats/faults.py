"""What the errors of Python and numpy say of a file, for one who wrote it."""

from __future__ import annotations

import re

FAULTS = (
    (r"invalid literal for int\(\) with base 10: (.*)", r"\1 is not a whole number"),
    (r"could not convert string to float: (.*)", r"\1 is not a number"),
    (r".* codec can't decode .*", "it holds characters that are not UTF-8"),
    (r"(not enough values|cannot reshape|setting an array element).*", "numbers are missing"),
    (r"No (closing quotation|escaped character)", "a quoted name has no end"),
)


def reason_of(error: BaseException) -> str:
    """What is wrong with a file, by the error of its reader."""
    said = " ".join(str(error).split())
    if isinstance(error, KeyError):
        return f"{said} is missing"
    for pattern, words in FAULTS:
        said = re.sub(f"^{pattern}$", words, said)
    return said or "it is damaged or cut off"
