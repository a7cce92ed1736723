"""Keywords, parameters and data lines of an Abaqus or CalculiX input file."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from fem.base.errors import ModelError

MOST_INCLUDED = 100  # files, each counted as often as it is included


@dataclass
class Keyword:
    """A keyword with its parameters and data lines.

    Parameters
    ----------
    name
        In capitals and without blanks, such as "SOLIDSECTION".
    shown
        As the file has it, such as "*Solid Section".
    parameters
        Values by the parameter's name in capitals; a parameter without a value has an empty one.
    source, file, line
        The file that is read, the one that holds the keyword, and the line there.
    rows, lines
        Words of the data lines, and where each stands (after ``file``, unless ``INPUT`` names
        another).
    """

    name: str
    shown: str
    parameters: dict[str, str]
    source: Path
    file: Path
    line: int
    rows: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)

    def place(self, row: int | None = None) -> str:
        """Where the keyword or one of its rows is: "line 12", with the file if it is another."""
        line = self.line if row is None else self.lines[row]
        return f"line {line}" if self.file == self.source else f"{self.file.name} line {line}"

    def fail(self, text: str, row: int | None = None) -> ModelError:
        """An error that names the file, the line and the keyword."""
        return ModelError(f"{self.source}: {self.place(row)}: {self.shown}: {text}")

    def name_of(self, *keys: str) -> str:
        """The value of the first of some parameters that is there, else an error."""
        found = next((self.parameters[key] for key in keys if key in self.parameters), "")
        if not found:
            raise self.fail(f"has no {keys[0]}" if len(keys) == 1 else "has no name")
        return found

    def only(self, *known: str) -> None:
        """Take the parameters by their full names; refuse those that are not known.

        A parameter may be cut short to three letters or more, and its blanks do not count.
        """
        found = {}
        for given, value in self.parameters.items():
            short = given.replace(" ", "")
            full = [name for name in known if name.replace(" ", "") == short] or [
                name for name in known if len(short) > 2 and name.replace(" ", "").startswith(short)
            ]
            if len(full) != 1:
                raise self.fail(f"its parameter {given!r} is not read")
            found[full[0]] = value
        self.parameters = found

    def whole(self, word: str, row: int | None) -> int:
        """A word as a whole number."""
        try:
            if "_" in word:  # Python would take 1_0 for 10
                raise ValueError
            return int(word)
        except ValueError:
            raise self.fail(f"{word!r} is not a whole number{_commas(word)}", row) from None

    def number(self, word: str, row: int | None) -> float:
        """A word as a number; an empty one is 0, and D stands for E."""
        try:
            if "_" in word:
                raise ValueError
            return float(word.upper().replace("D", "E") or 0.0) if word else 0.0
        except ValueError:
            raise self.fail(f"{word!r} is not a number{_commas(word)}", row) from None

    def words(self, row: int) -> list[str]:
        """The words of a row without the empty ones at its end; an empty row is an error."""
        found = filled(self.rows[row])
        if not found or not found[0]:
            raise self.fail("a line has nothing before its first comma", row)
        return found

    def numbers(self, row: int) -> list[float]:
        """All words of a row as numbers."""
        return [self.number(word, row) for word in filled(self.rows[row])]


def _commas(word: str) -> str:
    """What to say of words that a blank holds together."""
    return " (numbers need commas between them)" if re.search(r"\S\s+\S", word) else ""


def filled(words: list[str]) -> list[str]:
    """The words without the empty ones at the end.

    Examples
    --------
    >>> filled(["1", "", "2", "", ""])
    ['1', '', '2']
    """
    end = len(words)
    while end and not words[end - 1]:
        end -= 1
    return words[:end]


@dataclass
class Reading:
    """Which file is read, from which folders it may include others, and how many it did."""

    source: Path
    folders: list[Path]
    included: int = 0

    def keywords(self) -> Iterator[Keyword]:
        """All keywords, with those of included files in place."""
        return self._of(self.source)

    def _of(self, path: Path) -> Iterator[Keyword]:
        current: Keyword | None = None
        for number, line in logical_lines(path):
            if line.startswith("*"):
                if current:
                    yield from self._ready(current)
                current = self._keyword(path, number, line)
            elif current:
                current.rows.append([word.strip() for word in line.split(",")])
                current.lines.append(number)
        if current:
            yield from self._ready(current)

    def _keyword(self, path: Path, number: int, line: str) -> Keyword:
        words = next(csv.reader([line], skipinitialspace=True))
        shown = " ".join(words[0].split())
        name = "".join(shown[1:].split()).upper()
        parameters = {}
        for word in words[1:]:
            key, _, value = word.partition("=")
            if key.strip():
                parameters[" ".join(key.split()).upper()] = value.strip().strip("\"'").strip()
        return Keyword(name, shown, parameters, self.source, path, number)

    def _ready(self, keyword: Keyword) -> Iterator[Keyword]:
        """A keyword whose lines are complete, with those of another file if it names one."""
        if keyword.name == "INCLUDE":
            keyword.only("INPUT", "FILE")
            yield from self._of(self._other(keyword))
            return
        if keyword.name in ("NODE", "ELEMENT", "NSET", "ELSET", "EQUATION") and (
            "INPUT" in keyword.parameters
        ):
            keyword.file = self._other(keyword)
            for number, line in logical_lines(keyword.file):
                if line.startswith("*"):
                    raise keyword.fail(f"the file {keyword.file} holds the keyword {line!r}")
                keyword.rows.append([word.strip() for word in line.split(",")])
                keyword.lines.append(number)
        yield keyword

    def _other(self, keyword: Keyword) -> Path:
        """The file that a keyword names with INPUT, if it may be read."""
        name = keyword.name_of("INPUT", "FILE").replace("\\", "/")
        other = keyword.file.parent / name
        if not any(other.resolve().is_relative_to(folder) for folder in self.folders):
            raise keyword.fail(f"the included file {other} is in a folder that is not allowed")
        if not other.is_file():
            raise keyword.fail(f"the included file {other} does not exist")
        self.included += 1
        if self.included > MOST_INCLUDED:
            raise keyword.fail(f"more than {MOST_INCLUDED} files are included (in a circle?)")
        return other


def logical_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Numbered lines without comments; a keyword that ends in a comma goes on in the next line."""
    pending, first = "", 0
    for number, raw in enumerate(decoded(path.read_bytes()).splitlines(), start=1):
        line = raw.strip()
        if not line or line.startswith("**"):
            continue
        if pending and (line[0].isdigit() or line.startswith("*")):
            yield first, pending.rstrip(",")  # its last comma has nothing after it
            pending = ""
        if not pending:
            first = number
        line = pending + line
        pending = line if line.startswith("*") and line.endswith(",") else ""
        if not pending:
            yield first, line
    if pending:
        yield first, pending.rstrip(",")


def decoded(content: bytes) -> str:
    """Text of a file in UTF-8, in UTF-16 with its mark, or else in Latin-1.

    Examples
    --------
    >>> decoded("Träger".encode()), decoded("Träger".encode("latin-1"))
    ('Träger', 'Träger')
    """
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")
