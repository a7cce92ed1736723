"""Shells: CQUAD4, CTRIA3, CQUAD8 and CTRIA6 of PSHELL, PCOMP and PCOMPG."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.formats.nastran.cards import Card
from fem.formats.nastran.deck import Deck
from fem.formats.nastran.gathered import Gathered
from fem.formats.nastran.materials import Materials
from fem.formats.nastran.plates import Sheet, composite, sheet
from fem.model.parts import ShellPart


@dataclass(frozen=True)
class _Fields:
    """Kind and number of the grid points of an element, and where its other fields stand."""

    kind: str
    count: int
    corners: int
    direction: int
    offset: int
    thickness: int
    relative: int


FIELDS = {
    "CQUAD4": _Fields("quad", 4, 4, 6, 7, 10, 9),
    "CQUADR": _Fields("quad", 4, 4, 6, 7, 10, 9),
    "CTRIA3": _Fields("triangle", 3, 3, 5, 6, 10, 9),
    "CTRIAR": _Fields("triangle", 3, 3, 5, 6, 10, 9),
    "CQUAD8": _Fields("quad8", 8, 4, 14, 15, 10, 16),
    "CTRIA6": _Fields("triangle6", 6, 3, 8, 9, 10, 13),
}
FIRST_ORDER = {"quad8": "quad", "triangle6": "triangle", "quad": "quad", "triangle": "triangle"}
PROPERTIES = ("PSHELL", "PCOMP", "PCOMPG")
Direction = float | tuple[float, ...]
Key = tuple[int, float, Direction, float | None]


@dataclass
class _Shells:
    """The groups of shells of one deck: one for each property, direction, offset, thickness."""

    gathered: Gathered
    materials: Materials
    owners: dict[int, Card]
    names: dict[Key, str]
    sheets: dict[tuple[int, float | None], Sheet | str]

    def sheet(self, number: int, thickness: float | None, card: Card) -> Sheet | str:
        """What a property says for elements of a thickness of their own, or why it cannot."""
        key = number, thickness
        if key not in self.sheets:
            self.sheets[key] = self._made(number, thickness, card)
        return self.sheets[key]

    def _made(self, number: int, thickness: float | None, card: Card) -> Sheet | str:
        if number not in self.owners:
            return f"PSHELL {number} of {card.name} in {card.place} is not defined"
        own = self.owners[number]
        try:
            if own.name == "PSHELL":
                return sheet(own, self.materials, thickness)
            return composite(own, self.materials)
        except ModelError as error:
            return str(error)

    def group(self, card: Card, key: Key) -> str:
        """The name of the part of an element: "PSHELL 3", then "PSHELL 3 (2)"."""
        if key not in self.names:
            number = key[0]
            sort = self.owners[number].name if number in self.owners else "PSHELL"
            count = 1 + sum(other[0] == number for other in self.names)
            name = f"{sort} {number}" + (f" ({count})" if count > 1 else "")
            self.names[key] = name
            made = self.sheet(number, key[3], card)
            self.gathered.described[name] = self._described(made, key)
        return self.names[key]

    def _described(self, made: Sheet | str, key: Key) -> dict[str, object]:
        if isinstance(made, str):
            return {"refused": made}
        _, offset, direction, _ = key
        part = ShellPart(made.material, made.thickness, offset, made.section, direction)
        return {"made": part}


def read_shells(gathered: Gathered, materials: Materials) -> None:
    """Read all shells, and the parts that their properties make of them."""
    owners = gathered.deck.by_number(*PROPERTIES)
    shells = _Shells(gathered, materials, owners, {}, {})
    for name, fields in FIELDS.items():
        for card in gathered.deck.of(name):
            gathered.add_element(card)
            card.fields += [""] * (18 - len(card.fields))
            kind, count = fields.kind, fields.count
            if not any(card.text(2 + i) for i in range(fields.corners, count)):
                kind, count = FIRST_ORDER[kind], fields.corners
            grids = [_grid(card, 2 + i) for i in range(count)]
            number = card.whole(1, card.whole(0))
            for grid in grids:
                gathered.deck.place(grid, card)
            thickness = _thickness(gathered.deck, card, fields, owners.get(number))
            made = shells.sheet(number, thickness, card)
            directed = not isinstance(made, str) and made.section is not None and made.directed
            direction = _direction(gathered.deck, card, fields, grids) if directed else 0.0
            offset = card.real(fields.offset)
            group = shells.group(card, (number, offset, direction, thickness))
            gathered.add_cell(card, kind, grids, group)
            gathered.turns.update(grids)
    _tell_of_groups(gathered, shells)


def _grid(card: Card, at: int) -> int:
    if not card.text(at):
        raise card.fail(f"has no grid point in {card.field(at)}; give all middle nodes or none")
    return card.whole(at)


def _thickness(deck: Deck, card: Card, fields: _Fields, owner: Card | None) -> float | None:
    """The mean of the thicknesses at the corners, if an element has its own."""
    places = range(fields.thickness, fields.thickness + fields.corners)
    given = [card.real(at) for at in places if card.text(at)]
    if card.text(fields.relative) not in ("", "0", "1"):
        raise card.fail(f"{card.text(fields.relative)!r} is no thickness flag (TFLAG, 0 or 1)")
    if not given or owner is None or owner.name != "PSHELL":
        return None
    if len(given) < fields.corners:
        given += [owner.real(2)] * (fields.corners - len(given))
    mean = float(np.mean(given))
    if card.text(fields.relative) == "1":
        mean *= owner.real(2)
    if max(given) - min(given) > 1e-9 * max(given):
        deck.leave_out("thickness at corners", card.place, "their mean is that of the element")
    return mean


def _direction(deck: Deck, card: Card, fields: _Fields, grids: Sequence[int]) -> Direction:
    """The x axis of the section: an angle from the first side, or a vector."""
    at = fields.direction
    places = [deck.places[grid] for grid in grids]
    if card.text(at) and not card.is_real(at):
        system = deck.systems.system(card.whole(at), card)
        return _rounded(system.axes_at(np.mean(places[: fields.corners], axis=0))[0])
    if len(grids) == fields.corners:
        return card.real(at)
    # pieces of second-order cells have sides of their own, so they need a vector
    first, second = places[1] - places[0], places[fields.corners - 1] - places[0]
    z = np.cross(first, second)
    x, z = first / np.linalg.norm(first), z / np.linalg.norm(z)
    angle = np.radians(card.real(at))
    return _rounded(np.cos(angle) * x + np.sin(angle) * np.cross(z, x))


def _rounded(vector: FloatArray) -> tuple[float, ...]:
    return tuple((np.round(vector, 9) + 0.0).tolist())


def _tell_of_groups(gathered: Gathered, shells: _Shells) -> None:
    """One note for the properties that are several parts."""
    several = [name for name in shells.names.values() if name.endswith("(2)")]
    if several:
        gathered.deck.notes.append(
            f"{gathered.deck.source}: elements of {several[0].removesuffix(' (2)')}"
            + (f" and of {len(several) - 1} other properties" if len(several) > 1 else "")
            + " differ in offset, thickness or direction; each kind is a part of its own"
        )
