"""Read solids from Nastran bulk data; what is neither a solid nor told by a scene is refused."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

from fem.base.arrays import IntArray
from fem.base.errors import ModelError
from fem.formats.abaqus.keywords import decoded
from fem.mesh.attachments import LeftOut

KINDS = {
    "CTETRA": ("tetra", "tetra10"),
    "CPYRAM": ("pyramid", "pyramid13"),
    "CPYRA": ("pyramid", "pyramid13"),
    "CPENTA": ("wedge", "wedge15"),
    "CHEXA": ("hexahedron", "hexahedron20"),
}
"""Kinds of cells of first and of second order by their card."""
COUNTS = {"tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
COUNTS |= {"tetra10": 10, "pyramid13": 13, "wedge15": 15, "hexahedron20": 20}
ORDERS = {
    "wedge15": (*range(9), 12, 13, 14, 9, 10, 11),
    "hexahedron20": (*range(12), 16, 17, 18, 19, 12, 13, 14, 15),
}
"""Where VTK's nodes are among those of a card, which has the edges upwards before the top ones."""
PERMANENT = "GRID with PS"
"""A grid point that the deck holds for good."""
LEFT_OUT = {
    "materials and sections are given by the scene": ("MAT1", "PSOLID"),
    "supports are given by the scene": ("SPC", "SPC1", "SPCADD", PERMANENT),
    "loads are given by the scene": (
        *("DAREA", "DLOAD", "FORCE", "GRAV", "LOAD", "MOMENT", "PLOAD", "PLOAD4"),
        *("RLOAD1", "TABLED1", "TEMP", "TEMPD", "TLOAD1"),
    ),
    "which analysis is made is told by the scene": (
        *("EIGC", "EIGR", "EIGRL", "FREQ", "FREQ1", "PARAM", "TSTEP"),
    ),
}
"""Why a card does not matter."""
REASONS = {card: why for why, cards in LEFT_OUT.items() for card in cards}
MECHANICAL = ("", "SMECH")
"""What a PSOLID says in its seventh field where its elements are solids."""
REAL = re.compile(r"([+-]?(?:\d+\.\d*|\.\d+))(?:[ED]?([+-]?\d+))?", re.IGNORECASE)


@dataclass
class Card:
    """A card with the fields after its name, and the line that it begins in."""

    name: str
    fields: list[str]
    line: int


def read_nastran(path: Path) -> tuple[meshio.Mesh, list[LeftOut]]:
    """Read the grid points and solids of Nastran bulk data.

    Parameters
    ----------
    path
        In free, small or large fields. What is before ``BEGIN BULK`` is left out.

    Returns
    -------
    mesh
        A cell set for each property, "PSOLID 3" for number 3; no sets of points.
    left_out
        The cards that are left out by intention.

    Raises
    ------
    ModelError
        For cards that are not read (all of them in one sentence, with their number and the line
        of the first), coordinates in a system, an element that lacks nodes, numbers that stand
        twice or are not there, and fields that are no numbers.

    References
    ----------
    *MSC Nastran Quick Reference Guide*, bulk data entries.

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp()) / "corner.bdf"
    >>> _ = path.write_text(
    ...     "GRID,1,,0.,0.,0.\\nGRID,2,,1.,0.,0.\\nGRID,3,,0.,1.,0.\\nGRID,4,,0.,0.,1.\\n"
    ...     "CTETRA,1,3,1,2,3,4\\n"
    ... )
    >>> read_nastran(path)[0].cell_sets
    {'PSOLID 3': [array([0])]}
    """
    points: dict[int, list[float]] = {}
    cells: dict[str, list[list[int]]] = {}
    owners: dict[str, list[int]] = {}
    labels: set[int] = set()
    refused: dict[str, list[int]] = {}
    left: dict[str, list[int]] = {}
    for card in _cards(path):
        if card.name == "GRID":
            label = _whole(path, card, 0)
            if label in points:
                raise _fail(path, card, f"grid point {label} is defined twice")
            points[label] = _place(path, card)
            if [*card.fields, "", ""][6] not in ("", "0"):
                left.setdefault(PERMANENT, []).append(card.line)
        elif card.name in KINDS:
            label = _whole(path, card, 0)
            if label in labels:
                raise _fail(path, card, f"element {label} is defined twice")
            labels.add(label)
            kind, nodes = _cell(path, card, label)
            cells.setdefault(kind, []).append(nodes)
            owners.setdefault(kind, []).append(_whole(path, card, 1))
        elif card.name == "PSOLID" and (field := [*card.fields, *[""] * 7][6]) not in MECHANICAL:
            raise _fail(path, card, f"is of a fluid or another field ({field}), no solid")
        else:
            (left if card.name in REASONS else refused).setdefault(card.name, []).append(card.line)
    if refused:
        told = "; ".join(
            f"{name} ({len(at)}, first in line {at[0]})" for name, at in refused.items()
        )
        raise ModelError(
            f"{path}: holds cards that are not read: {told}; solids are (GRID, CTETRA, CPYRAM,"
            " CPENTA, CHEXA); write other elements as '.inp'; take out masses and springs and give"
            " them in the scene"
        )
    if not cells:
        raise ModelError(f"{path}: is no Nastran bulk data with solids (GRID, CTETRA, CHEXA, ...)")
    said = [LeftOut(n, len(at), f"line {at[0]}", REASONS[n]) for n, at in left.items()]
    return _content(path, points, cells, owners), said


def _content(
    path: Path,
    points: dict[int, list[float]],
    cells: dict[str, list[list[int]]],
    owners: dict[str, list[int]],
) -> meshio.Mesh:
    place = {label: i for i, label in enumerate(points)}
    missing = next((n for of in cells.values() for c in of for n in c if n not in place), None)
    if missing is not None:
        raise ModelError(f"{path}: an element has the grid point {missing}, which is not defined")
    blocks = [(kind, np.array([[place[n] for n in c] for c in of])) for kind, of in cells.items()]
    properties = sorted({number for of in owners.values() for number in of})
    sets: dict[str, list[IntArray]] = {
        f"PSOLID {number}": [np.flatnonzero(np.array(of) == number) for of in owners.values()]
        for number in properties
    }
    return meshio.Mesh(np.array(list(points.values())), blocks, cell_sets=sets)


def _place(path: Path, card: Card) -> list[float]:
    if card.fields[1] not in ("", "0"):
        raise _fail(path, card, "coordinates in a system of their own are not read")
    if len(card.fields) < 5:
        raise _fail(path, card, "has no third coordinate")
    return [_real(path, card, at) for at in (2, 3, 4)]


def _cell(path: Path, card: Card, label: int) -> tuple[str, list[int]]:
    """Kind and nodes of a solid, in VTK's order."""
    given = card.fields[2:]
    while given and not given[-1]:
        given.pop()
    kind = next((kind for kind in KINDS[card.name] if COUNTS[kind] == len(given)), None)
    if kind is None or not all(given):
        needed = " or ".join(str(COUNTS[kind]) for kind in KINDS[card.name])
        count = len([word for word in given if word])
        raise _fail(
            path, card, f"element {label} has {count} grid points where {needed} are needed"
        )
    nodes = [_whole(path, card, 2 + i) for i in range(len(given))]
    return kind, [nodes[i] for i in ORDERS.get(kind, range(len(nodes)))]


def _cards(path: Path) -> Iterator[Card]:
    """The cards of the bulk data, each with its continuations."""
    lines = decoded(path.read_bytes()).splitlines()
    begin = [i for i, line in enumerate(lines) if re.match(r"\s*BEGIN\s+BULK", line, re.IGNORECASE)]
    card: Card | None = None
    for number, raw in enumerate(lines, start=1):
        line = raw.partition("$")[0].rstrip()
        if (begin and number <= begin[0] + 1) or not line.strip():
            continue
        first, fields, rest = _fields(line)
        if any(re.match(r"[\d.-]", word) for word in rest) or any(rest[1:]):
            raise ModelError(f"{path}: line {number} has more fields than a line can have")
        if first.upper().rstrip("*") == "ENDDATA":
            break
        if not first or first[0] in "+*":
            if card is None:
                raise ModelError(f"{path}: line {number} goes on with a card that is not there")
            card.fields += fields
            continue
        if card is not None:
            yield card
        card = Card(first.upper().rstrip("*"), fields, number)
    if card is not None:
        yield card


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
    return first, [*words, *[""] * most][:most], words[most:]


def _whole(path: Path, card: Card, at: int) -> int:
    word = card.fields[at]
    if not re.fullmatch(r"\+?\d+", word):
        raise _fail(path, card, f"{word!r} is not a whole number")
    return int(word)


def _real(path: Path, card: Card, at: int) -> float:
    """A real number; Nastran may leave out the letter before the exponent. Blank is 0."""
    word = card.fields[at]
    found = REAL.fullmatch(word or "0.")
    if found is None:
        raise _fail(path, card, f"{word!r} is not a real number")
    return float(f"{found[1]}e{found[2] or 0}")


def _fail(path: Path, card: Card, text: str) -> ModelError:
    return ModelError(f"{path}: line {card.line}: {card.name}: {text}")
