"""Cards of Nastran bulk data: their fields, and the lines of all files that hold them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from fem.base.errors import ModelError
from fem.formats.abaqus.keywords import decoded

REAL = re.compile(
    r"([+-]?(?:\d+\.?\d*|\.\d+))(?: *[ED]? *([+-] *\d+)| *[ED] *(\d+))?", re.IGNORECASE
)
WHOLE = re.compile(r"[+-]?\d+")
MOST_INCLUDED = 200  # files, each counted as often as it is included
EQUATION = "DEQATN"
"""A card whose fields are text."""
INCLUDE = re.compile(r"\s*INCLUDE\b\s*(.*)", re.IGNORECASE)
CASES = re.compile(r"\s*CEND\b", re.IGNORECASE)
"""The line after which executive control ends."""
MARK = re.compile(r"[+*]\S+")
Given = TypeVar("Given")


@dataclass(frozen=True)
class Line:
    """A line of text, the file that holds it and its number there."""

    text: str
    file: Path
    number: int

    def place(self, source: Path) -> str:
        """The number, with the file if it is an included one."""
        own = self.file == source
        return f"line {self.number}" if own else f"{self.file.name} line {self.number}"


@dataclass
class Card:
    """A card with the fields after its name, and the line that it begins in.

    Fields count from 0, the one after the name.
    """

    name: str
    fields: list[str]
    line: Line
    source: Path
    mark: str = field(default="", repr=False)

    @property
    def place(self) -> str:
        """Where the card begins: "line 12", with the file if it is an included one."""
        own = self.line.file == self.source
        return (
            f"line {self.line.number}" if own else f"{self.line.file.name} line {self.line.number}"
        )

    def fail(self, text: str) -> ModelError:
        """An error that names the file, the line and the card."""
        return ModelError(f"{self.source}: {self.place}: {self.name}: {text}")

    def field(self, at: int) -> str:
        """How a field is called: "field 3", or "field 3 of its line 2"."""
        line, place = divmod(at, 8)
        return f"field {place + 2}" + (f" of its line {line + 1}" if line else "")

    def text(self, at: int) -> str:
        """A field in capitals; an empty text where there is none."""
        return self.fields[at].upper() if at < len(self.fields) else ""

    def texts(self, first: int) -> list[str]:
        """All fields from one on that are not blank, in capitals."""
        return [word.upper() for word in self.fields[first:] if word]

    def whole(self, at: int, default: int | None = None) -> int:
        """A whole number; a blank field is the default, if there is one."""
        word = self.text(at)
        if not word and default is not None:
            return default
        if not WHOLE.fullmatch(word):
            raise self.fail(f"{word!r} in {self.field(at)} is not a whole number")
        return int(word)

    def real(self, at: int, default: float | None = 0.0) -> float:
        """A real number, whose exponent may lack its letter; a blank field is the default.

        A number without point and exponent is a whole one, which Nastran does not take for a real.
        """
        word = self.text(at)
        if not word and default is not None:
            return default
        if WHOLE.fullmatch(word):
            raise self.fail(
                f"{word!r} in {self.field(at)} is a whole number where a real one belongs; write"
                f" '{word}.'"
            )
        found = REAL.fullmatch(word)
        if found is None:
            raise self.fail(f"{word!r} in {self.field(at)} is not a real number")
        exponent = (found[2] or found[3] or "0").replace(" ", "")
        return float(f"{found[1]}e{exponent}")

    def reals(self, first: int, count: int) -> list[float]:
        """Several real numbers; blank ones are 0."""
        return [self.real(first + i) for i in range(count)]

    def is_real(self, at: int) -> bool:
        """Whether a field holds a number that is no whole one."""
        return bool(REAL.fullmatch(self.text(at))) and not WHOLE.fullmatch(self.text(at))

    def wholes(self, first: int) -> list[int]:
        """Whole numbers from a field to the end, with ``THRU`` and ``BY``; blanks do not count."""
        words, found, at = self.texts(first), [], 0
        while at < len(words):
            start = self._number(words[at])
            if at + 1 < len(words) and words[at + 1] == "THRU":
                if at + 2 >= len(words):
                    raise self.fail("ends with THRU")
                stop, step = self._number(words[at + 2]), 1
                at += 3
                if at + 1 < len(words) and words[at] == "BY":
                    step, at = self._number(words[at + 1]), at + 2
                if step < 1 or stop < start:
                    raise self.fail(f"cannot run from {start} to {stop} by {step}")
                found += [*range(start, stop + 1, step)]
                if found[-1] != stop:
                    found.append(stop)
            else:
                found.append(start)
                at += 1
        return found

    def _number(self, word: str) -> int:
        if not WHOLE.fullmatch(word):
            raise self.fail(f"{word!r} is not a whole number")
        return int(word)

    def given(self, at: int, size: int) -> bool:
        """Whether a group of fields holds anything; then it needs the first of them."""
        more = [i for i in range(at, at + size) if self.text(i)]
        if more and more[0] != at:
            raise self.fail(
                f"has {self.text(more[0])!r} in {self.field(more[0])}, but nothing in"
                f" {self.field(at)}, which goes with it"
            )
        return bool(more)

    def check_fields(self, lines: str) -> None:
        """Refuse what stands in fields that must be blank (-) and behind the last one.

        Parameters
        ----------
        lines
            As in `known.FIELDS`, such as "xxxxxxx- *-xxxxxx-".
        """
        first, _, further = lines.partition(" *")
        known = first.replace(" ", "") + further * (len(self.fields) // 8)
        for at, word in enumerate(self.fields):
            if word in ("", "+") or known[at : at + 1] == "x":
                continue
            if at < len(known):
                raise self.fail(f"has {word!r} in {self.field(at)}, which must be blank")
            raise self.fail(
                f"has {word!r} in {self.field(at)}, behind its last one; an element or a point"
                " needs a card of its own"
            )

    def components(self, at: int) -> list[int]:
        """Directions out of 1 to 6, such as "1346"."""
        word = self.text(at).replace(" ", "")
        if not re.fullmatch(r"[1-6]+", word):
            raise self.fail(f"{word!r} in {self.field(at)} are not directions out of 1 to 6")
        return [int(digit) for digit in dict.fromkeys(word)]


def lines_of(path: Path, folders: Sequence[Path]) -> Iterator[Line]:
    """The lines of a file without comments and blank ones, with those of included files.

    Files that executive control includes, before ``CEND``, hold no bulk data and are not opened:
    their lines stay.

    Parameters
    ----------
    path
        The file.
    folders
        Below which included files may be, resolved.

    Raises
    ------
    ModelError
        If an included file is not there, in another folder or includes itself.
    """
    count = [0]
    yield from _lines(path, path, folders, count)


def _lines(path: Path, source: Path, folders: Sequence[Path], count: list[int]) -> Iterator[Line]:
    texts = decoded(path.read_bytes()).splitlines()
    executive = next((i for i, text in enumerate(texts) if CASES.match(text)), 0)
    raw = iter(enumerate(texts, start=1))
    for number, text in raw:
        words = text.partition("$")[0].rstrip()
        if not words.strip():
            continue
        found = INCLUDE.match(words)
        if found is None or number <= executive:
            yield Line(words, path, number)
            continue
        name = found[1].strip()
        while name[:1] in ("'", '"') and name.count(name[0]) < 2:  # goes on in the next line
            name += next(raw, (0, name[0]))[1].strip()
        other = _other(path, name.strip("'\" ").replace("\\", "/"))
        told = f"{source}: {path.name} line {number}: INCLUDE: the file {other}"
        if not any(other.resolve().is_relative_to(folder) for folder in folders):
            raise ModelError(
                f"{told} is in a folder that is not allowed; put it beside the deck or below, or"
                " give its folder as one of include_folders"
            )
        if not other.is_file():
            raise ModelError(f"{told} does not exist")
        count[0] += 1
        if count[0] > MOST_INCLUDED:
            raise ModelError(f"{told}: more than {MOST_INCLUDED} files are included (in a circle?)")
        yield from _lines(other, source, folders, count)


def _other(path: Path, name: str) -> Path:
    """The included file; names are compared without case where the file system does."""
    plain = path.parent / name
    if plain.is_file() or not plain.parent.is_dir():
        return plain
    alike = [p for p in plain.parent.iterdir() if p.name.lower() == plain.name.lower()]
    return alike[0] if alike else plain


def cards_of(lines: Sequence[Line], source: Path) -> Iterator[Card]:
    """The cards of bulk data, each with its continuations, up to ``ENDDATA``.

    Raises
    ------
    ModelError
        For a line that continues no card or another one than that before it, and for one with
        more fields than a line can have.
    """
    card: Card | None = None
    for line in lines:
        if (name := line.text[:8].strip().upper())[:6] == EQUATION:
            if card is not None:
                yield card
            card = Card(EQUATION, [name], line, source)
            continue
        if card is not None and card.name == EQUATION and line.text[0] in " +*,":
            continue  # its text goes on
        first, fields, rest = _fields(line.text)
        where = f"{source}: {line.place(source)}"
        free = "," in line.text
        if any(re.match(r"[\d.-]", word) for word in rest if free) or any(rest[1:]):
            raise ModelError(f"{where} has more fields than a line can have")
        mark = rest[0] if rest else ""
        if first.upper().rstrip("*") == "ENDDATA":
            break
        if not first or first[0] in "+*":
            if card is None:
                raise ModelError(f"{where} goes on with a card that is not there")
            if MARK.fullmatch(first) and MARK.fullmatch(card.mark) and not _alike(first, card.mark):
                raise ModelError(
                    f"{where} goes on with the mark {first!r}, but {card.name} before it has"
                    f" {card.mark!r}; put the lines of a card one below the other"
                )
            card.fields += fields
            card.mark = mark
            continue
        if card is not None:
            yield card
        card = Card(first.upper().rstrip("*").rstrip(), fields, line, source, mark)
    if card is not None:
        yield card


def _alike(first: str, mark: str) -> bool:
    """Whether two marks are one from the second column on; that of a card may begin there."""
    return first[1:].upper() in (mark[1:].upper(), mark.upper())


def _fields(line: str) -> tuple[str, list[str], list[str]]:
    """The first field of a line, the four or eight after it, and the mark of a continuation."""
    if "," in line:
        first, *words = (word.strip() for word in line.split(","))
        most = 4 if "*" in first else 8
    else:
        line = line.expandtabs(8)
        first = line[:8].strip()
        width, most = (16, 4) if "*" in first else (8, 8)
        words = [line[at : at + width].strip() for at in range(8, 8 + most * width, width)]
        words.append(line[8 + most * width :][:8].strip())
    return first, [*words, *[""] * most][:most], words[most:]
