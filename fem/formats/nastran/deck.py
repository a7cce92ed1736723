"""A deck of Nastran: its cards by name, grid points, and what is told of the others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.formats.nastran.cards import INCLUDE, Card, cards_of, lines_of
from fem.formats.nastran.control import Choice, Control, divided
from fem.formats.nastran.known import FIELDS, LEFT_OUT, READ, advice
from fem.formats.nastran.systems import CARDS as SYSTEM_CARDS
from fem.formats.nastran.systems import Systems
from fem.mesh.attachments import LeftOut

DIRECTIONS = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
NO_BULK_DATA = "it holds no bulk data, which comes after CEND"
SUPERELEMENTS = "superelements are not read; write the model as one"


@dataclass(frozen=True)
class Grid:
    """A grid point: its card, the system of its displacements and what of it is held for good."""

    card: Card
    displacements: int
    held: tuple[int, ...]


@dataclass
class Told:
    """How often something is left out or refused, where first and why."""

    count: int
    place: str
    reason: str


@dataclass
class Deck:
    """The cards of a file and of those that it includes.

    Parameters
    ----------
    source
        The file.
    ignore
        Names of cards that are left out, in capitals.
    cards
        By name, in the order of the file.
    control
        What the case control chooses.
    ignored
        What of the names to ignore was met.
    """

    source: Path
    ignore: frozenset[str] = frozenset()
    cards: dict[str, list[Card]] = field(default_factory=dict)
    control: Control = field(default_factory=Control)
    left: dict[str, Told] = field(default_factory=dict)
    refused: dict[str, Told] = field(default_factory=dict)
    ignored: set[str] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)
    grids: dict[int, Grid] = field(default_factory=dict)
    scalars: dict[int, Card] = field(default_factory=dict)
    places: dict[int, FloatArray] = field(default_factory=dict)
    systems: Systems = field(init=False)

    def __post_init__(self) -> None:
        self.systems = Systems({}, self.place)

    def of(self, *names: str) -> list[Card]:
        """All cards of some names."""
        return [card for name in names for card in self.cards.get(name, [])]

    def by_number(self, *names: str) -> dict[int, Card]:
        """Cards by the number in their first field, which may stand there once only."""
        found: dict[int, Card] = {}
        for card in self.of(*names):
            number = card.whole(0)
            before = found.setdefault(number, card)
            if before is not card and before.fields != card.fields:
                raise card.fail(f"{number} is defined twice, first in {before.place}")
        return found

    def leave_out(self, what: str, place: str, reason: str, count: int = 1) -> None:
        """Keep what is left out by intention."""
        self.left.setdefault(what, Told(0, place, reason)).count += count

    def tell_of_damping(self, card: Card, at: int) -> None:
        """Tell of the coefficient of structural damping (GE) in a field of a card, once for all."""
        what = f"GE of {card.name}"
        if card.real(at) and what not in self.left:
            self.leave_out(what, card.place, "damping of materials is given by the scene")

    def refuse(self, what: str, place: str, reason: str) -> None:
        """Keep what is refused, to be told together with all else."""
        self.refused.setdefault(what, Told(0, place, reason)).count += 1

    def raise_refused(self) -> None:
        """One error that lists all that is refused."""
        if self.refused:
            told = "; ".join(
                f"{name} ({t.count}, first in {t.place}): {t.reason}"
                for name, t in self.refused.items()
            )
            raise ModelError(f"{self.source}: holds cards that are not read: {told}")

    @property
    def left_out(self) -> list[LeftOut]:
        """What is left out, for a mesh."""
        return [LeftOut(n, t.count, t.place, t.reason) for n, t in self.left.items()]

    def choice(self, name: str) -> Choice | None:
        """What the first case chooses that chooses; that of others is told."""
        found = self.control.choices(name)
        for other in found[1:]:
            self.notes.append(
                f"{self.source}: {name} = {found[0].value} of the first case that has one is"
                f" taken, not {name} = {other.value}"
            )
        return found[0] if found else None

    def existing(self, card: Card, numbers: Sequence[int]) -> list[int]:
        """The points of a card with THRU that are there; how many are not is told.

        Without THRU all stay, so that one that is missing is refused where it is looked up.
        """
        if "THRU" not in card.texts(0):
            return list(numbers)
        found = [n for n in numbers if n in self.grids or n in self.scalars]
        if missing := len(numbers) - len(found):
            what = f"points of {card.name} with THRU that are not defined"
            self.leave_out(what, card.place, "the others of its range are taken", missing)
        return found

    def place(self, number: int, card: Card) -> FloatArray:
        """Basic coordinates of a grid point that a card names."""
        if number in self.places:
            return self.places[number]
        if number not in self.grids:
            raise card.fail(f"names the grid point {number}, which is not defined")
        own = self.grids[number].card
        system = self.systems.system(own.whole(1, 0), own)
        self.places[number] = system.place(np.array(own.reals(2, 3)))
        return self.places[number]

    def axes(self, number: int) -> FloatArray:
        """The axes of the displacements of a grid point, as rows in basic coordinates."""
        grid = self.grids[number]
        if grid.displacements == 0:
            return np.eye(3)
        system = self.systems.system(grid.displacements, grid.card)
        return system.axes_at(self.places[number])


def read_deck(path: Path, folders: Sequence[Path], ignore: Iterable[str]) -> Deck:
    """Read all cards of a file, and place its grid points.

    Raises
    ------
    ModelError
        For cards that are not read, all of them in one sentence.
    """
    deck = Deck(path, frozenset(name.upper().rstrip("*") for name in ignore))
    lines = list(lines_of(path, folders))
    for line in lines:
        if INCLUDE.match(line.text):  # those of bulk data have become the lines that they hold
            deck.leave_out("INCLUDE of executive control", line.place(path), NO_BULK_DATA)
    deck.control, bulk, supers = divided(lines, path)
    for line in supers:
        raise ModelError(f"{path}: line {line.number}: {line.text.strip()}: {SUPERELEMENTS}")
    for card in cards_of(bulk, path):
        if card.name in deck.ignore:
            deck.ignored.add(card.name)
            deck.leave_out(card.name, card.place, "it is to be ignored")
        elif card.name in READ:
            if card.name in FIELDS:
                card.check_fields(FIELDS[card.name])
            deck.cards.setdefault(card.name, []).append(card)
        elif card.name in LEFT_OUT:
            deck.leave_out(card.name, card.place, LEFT_OUT[card.name])
        else:
            deck.refuse(card.name, card.place, advice(card.name))
    deck.raise_refused()
    _read_systems(deck)
    _read_points(deck)
    return deck


def _read_systems(deck: Deck) -> None:
    given: dict[int, tuple[Card, int]] = {}
    for card in deck.of(*SYSTEM_CARDS):
        by_numbers = SYSTEM_CARDS[card.name][0] == 2
        starts = [(0, 1)] if by_numbers or not card.given(4, 4) else [(0, 1), (4, 5)]
        for at, first in starts:
            number = card.whole(at)
            if number in given and given[number][0].fields != card.fields:
                raise card.fail(f"coordinate system {number} is defined twice")
            given[number] = (card, first)
    deck.systems = Systems(given, deck.place)


def _read_points(deck: Deck) -> None:
    preset = deck.of("GRDSET")
    defaults = [*(preset[0].fields if preset else []), *[""] * 8][:8]
    for card in deck.of("GRID"):
        number = card.whole(0)
        if len(card.fields) < 5:
            raise card.fail("has no third coordinate")
        card.fields += [""] * (8 - len(card.fields))
        for at in (1, 5, 6):
            card.fields[at] = card.fields[at] or defaults[at]
        if number in deck.grids and deck.grids[number].card.fields != card.fields:
            raise card.fail(f"grid point {number} is defined twice")
        held = tuple(card.components(6)) if card.text(6) not in ("", "0") else ()
        displacements = card.whole(5, 0)
        if displacements == -1:
            raise card.fail("is of a fluid (its displacement system is -1), which is not read")
        deck.grids[number] = Grid(card, displacements, held)
    for card in deck.of("SPOINT"):
        for number in card.wholes(0):
            if number in deck.grids:
                raise card.fail(f"scalar point {number} has the number of a grid point")
            deck.scalars[number] = card
    for number, grid in deck.grids.items():
        deck.place(number, grid.card)
        if grid.displacements:
            deck.systems.system(grid.displacements, grid.card)
