"""Matrices that a deck gives by DMIG, which case control adds to stiffness, mass or damping."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

from fem.base.errors import ModelError
from fem.formats.nastran.cards import Card
from fem.formats.nastran.control import Choice
from fem.formats.nastran.deck import Deck
from fem.formats.nastran.gathered import Gathered

CHOICES = {"K2GG": "stiffness", "M2GG": "mass", "B2GG": "damping"}
IN_RESPONSES = ("K2PP", "M2PP", "B2PP")
SYMMETRIC, SQUARE = 6, 1
REAL = (1, 2)
BEGUN, COLUMN = "xxxxxx-x", "xxx-xxxx *xxxxxxxx"
"""Fields of the card that begins a matrix and of those of its columns, as in `known.FIELDS`."""
MOST = 3000
"""Rows of a matrix that is kept whole."""
Entry = tuple[int, int]


@dataclass
class _Matrix:
    """A matrix: the card that begins it, and its values by row and column."""

    card: Card
    values: dict[tuple[Entry, Entry], float] = field(default_factory=dict)


def read_matrices(gathered: Gathered) -> None:
    """Read the matrices that K2GG, M2GG and B2GG name; the others are told."""
    deck = gathered.deck
    found = _all(deck.of("DMIG"))
    used = set()
    for choice, kind in CHOICES.items():
        if (chosen := deck.choice(choice)) is None:
            continue
        for factor, name in _named(deck, choice, chosen):
            if name not in found:
                raise _fault(deck, choice, chosen, f"there is no DMIG {name!r}")
            used.add(name)
            _add(gathered, kind, name, found[name], factor)
    for choice in IN_RESPONSES:
        if chosen := deck.choice(choice):
            name = chosen.value
            used.add(name)
            place = found[name].card.place if name in found else "case control"
            deck.leave_out(choice, place, "it acts in responses only, not in modes")
    for name, matrix in found.items():
        if name not in used:
            reason = "no K2GG, M2GG or B2GG of case control names it"
            deck.leave_out(f"DMIG {name}", matrix.card.place, reason)


def _fault(deck: Deck, name: str, choice: Choice, text: str) -> ModelError:
    place = choice.line.place(deck.source)
    return ModelError(f"{deck.source}: {place}: {name} = {choice.value}: {text}")


def _named(deck: Deck, name: str, choice: Choice) -> list[tuple[float, str]]:
    """Factors and names of "A", "A, B" and "2.0*A, 0.5*B", which may stand in parentheses."""
    words = re.split(r"\s*,\s*", choice.value.strip("() "))
    found = [re.fullmatch(r"(?:([-+.\dE]+) *\* *)?([A-Z]\w*)", word) for word in words]
    try:
        return [(float(m[1] or 1.0), m[2]) for m in found]  # type: ignore[index]
    except (TypeError, ValueError):
        fault = "is not read; name matrices of DMIG as A, B or 2.0*A, 0.5*B"
        raise _fault(deck, name, choice, fault) from None


def _all(cards: list[Card]) -> dict[str, _Matrix]:
    found: dict[str, _Matrix] = {}
    for card in cards:
        name = card.text(0)
        if card.text(1) == "0":
            card.check_fields(BEGUN)
            found[name] = _Matrix(card)
        elif name not in found:
            raise card.fail(f"the matrix {name} is not begun (DMIG,{name},0,...)")
        else:
            _column(card, found[name])
    return found


def _column(card: Card, matrix: _Matrix) -> None:
    card.check_fields(COLUMN)
    column = card.whole(1), card.whole(2, 0)
    for at in range(4, len(card.fields), 4):
        if card.given(at, 4):
            if card.text(at + 3) and matrix.card.whole(3) in REAL:
                raise card.fail(
                    f"has {card.text(at + 3)!r} in {card.field(at + 3)}, an imaginary part, but"
                    f" {card.text(0)} is real"
                )
            row, value = (card.whole(at), card.whole(at + 1, 0)), card.real(at + 2)
            if matrix.values.setdefault((row, column), value) != value:
                raise card.fail(f"the number of row {row} and column {column} stands twice")
            if matrix.card.whole(2) == SYMMETRIC:
                matrix.values[column, row] = value


def _add(gathered: Gathered, kind: str, name: str, matrix: _Matrix, factor: float) -> None:
    card = matrix.card
    if card.whole(2) not in (SYMMETRIC, SQUARE) or card.whole(3) not in REAL:
        raise card.fail("must be symmetric (6) or square (1) and real (1 or 2)")
    entries = sorted({entry for pair in matrix.values for entry in pair})
    if len(entries) > MOST:
        raise card.fail(
            f"{name} has {len(entries)} rows, more than {MOST}; give it as [matrices] in the scene"
        )
    at = {entry: i for i, entry in enumerate(entries)}
    full = np.zeros((len(entries), len(entries)))
    for (row, column), value in matrix.values.items():
        full[at[row], at[column]] = factor * value
    if not np.allclose(full, full.T, rtol=1e-9, atol=1e-9 * np.abs(full).max(initial=0.0)):
        raise card.fail(f"{name} is not symmetric")
    for grid, component in entries:
        if component > 3 and kind != "mass":
            gathered.turns.add(grid)
    rows = [gathered.terms(card, grid, max(component, 1)) for grid, component in entries]
    gathered.add_matrix(card, rows, **{kind: full})
