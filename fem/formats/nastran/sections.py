"""The numbers of PBAR, PBARL, PBEAM and PBEAML at both ends of a beam."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fem.formats.nastran.cards import Card
from fem.formats.nastran.deck import Deck
from fem.formats.nastran.shapes import SHAPES, Numbers

End = tuple[float, float, float, float, float]
"""Area, I1, I2, I12 and J."""
NSM_PLACE = "its mass is taken at the neutral axis"
STATIONS = ("YES", "YESA", "NO")
SHEAR_OF = {"BAR": (5 / 6, 5 / 6), "ROD": (0.9, 0.9), "TUBE": (0.5, 0.5), "TUBE2": (0.5, 0.5)}
"""Shear factors of shapes for which they are the same in both planes."""


@dataclass(frozen=True)
class BeamNumbers:
    """What a property of beams says.

    Parameters
    ----------
    ends
        At the first and the second end.
    added
        Non-structural mass in kg/m at both ends.
    inertia
        Non-structural inertia against twisting in kg m at both ends.
    shear
        Shear factors in plane 1 and 2; 0 without shear deformation.
    axis
        Places (y, z) of the neutral axis at both ends as seen from the shear centre.
    """

    ends: tuple[End, End]
    added: tuple[float, float]
    shear: tuple[float, float] = (0.0, 0.0)
    axis: tuple[tuple[float, float], tuple[float, float]] = ((0.0, 0.0), (0.0, 0.0))
    inertia: tuple[float, float] = (0.0, 0.0)


def beam_numbers(deck: Deck, card: Card, mass_factor: float) -> BeamNumbers:
    """The numbers of a property, whose added mass counts times a factor."""
    return _READERS[card.name](deck, card, mass_factor)


def _pbar(deck: Deck, card: Card, mass_factor: float) -> BeamNumbers:
    area, first, second, torsion, added = card.reals(2, 5)
    end = (area, first, second, card.real(18), torsion)
    return BeamNumbers((end, end), (mass_factor * added,) * 2, (card.real(16), card.real(17)))


def _shape(card: Card) -> tuple[int, str]:
    shape = card.text(3)
    if shape not in SHAPES:
        raise card.fail(f"the shape {shape!r} is not read; give the numbers by PBAR or PBEAM")
    return SHAPES[shape][0], shape


def _shaped(card: Card, shape: str, first: int) -> Numbers:
    sizes = card.reals(first, SHAPES[shape][0])
    if min(sizes) <= 0.0 and not (shape == "TUBE" and sizes[0] > sizes[1] >= 0.0):
        raise card.fail(f"the dimensions of {shape} must be positive, not {sizes}")
    found = SHAPES[shape][1](*sizes)
    if not (found.area > 0.0 and found.along_y > 0.0 and found.along_z > 0.0):
        raise card.fail(f"the dimensions {sizes} of {shape} make no section")
    return found


def _end(numbers: Numbers) -> End:
    return numbers.area, numbers.along_y, numbers.along_z, numbers.mixed, numbers.torsion


def _pbarl(deck: Deck, card: Card, mass_factor: float) -> BeamNumbers:
    count, shape = _shape(card)
    end = _end(_shaped(card, shape, 8))
    card.check_fields("x" * (9 + count))
    added = mass_factor * card.real(8 + count)
    return BeamNumbers((end, end), (added, added), SHEAR_OF.get(shape, (0.0, 0.0)))


def _pbeaml(deck: Deck, card: Card, mass_factor: float) -> BeamNumbers:
    count, shape = _shape(card)
    first = _shaped(card, shape, 8)
    ends, added, at = [first], [card.real(8 + count)], 9 + count
    while at < len(card.fields) and any(card.texts(at)):
        if card.text(at) not in ("", *STATIONS):
            raise card.fail(f"has {card.text(at)!r} in {card.field(at)}, which is YES or NO")
        share = card.real(at + 1, 1.0)
        sized = any(card.text(at + 2 + i) for i in range(count))
        here = _shaped(card, shape, at + 2) if sized else first
        if share == 1.0:
            ends.append(here)
            added.append(card.real(at + 2 + count, added[0]))
        else:
            _tell_of_stations(deck, card)
        at += 3 + count
    last, mass = ends[-1], (mass_factor * added[0], mass_factor * added[-1])
    axis = [(-n.shear_centre[0], -n.shear_centre[1]) for n in (first, last)]
    _tell_of_axis(deck, card, axis)
    if any(mass) and any(map(any, axis)):
        deck.leave_out("place of NSM of PBEAML", card.place, NSM_PLACE)
    return BeamNumbers((_end(first), _end(last)), mass, (1.0, 1.0), (axis[0], axis[1]))


def _pbeam(deck: Deck, card: Card, mass_factor: float) -> BeamNumbers:
    rows = [card.fields[at : at + 8] for at in range(0, len(card.fields), 8)]
    start = card.reals(2, 6)
    ends, row = [start], 1
    if row < len(rows) and rows[row][0].upper() not in STATIONS:
        row += 1  # where stresses are recovered at the first end
    while row < len(rows) and rows[row][0].upper() in STATIONS:
        here = [card.real(8 * row + 2 + i, start[i]) for i in range(6)]
        if card.real(8 * row + 1, 1.0) == 1.0:
            ends.append(here)
        else:
            _tell_of_stations(deck, card)
        row += 2 if rows[row][0].upper() == "YES" else 1
    shear = (card.real(8 * row, 1.0), card.real(8 * row + 1, 1.0))
    if any(card.real(8 * row + i) for i in (6, 7)):
        deck.leave_out("warping of PBEAM", card.place, "beams warp freely")
    if any(card.real(8 * row + i) for i in (2, 3)):
        deck.leave_out("shear relief of PBEAM", card.place, "shear is that of a straight beam")
    turning = card.real(8 * row + 4), card.real(8 * row + 5, card.real(8 * row + 4))
    place, axis = _places(card, 8 * row + 8), _places(card, 8 * row + 12)
    _tell_of_axis(deck, card, axis)
    if (start[5] or ends[-1][5] or any(turning)) and place != axis:
        deck.leave_out("place of NSM of PBEAM", card.place, NSM_PLACE)
    card.check_fields("x" * (8 * row + 16))
    last = ends[-1]
    made = [(e[0], e[1], e[2], e[3], e[4]) for e in (start, last)]
    added = (mass_factor * start[5], mass_factor * last[5])
    inertia = (mass_factor * turning[0], mass_factor * turning[1])
    return BeamNumbers((made[0], made[1]), added, shear, (axis[0], axis[1]), inertia)


def _places(card: Card, at: int) -> list[tuple[float, float]]:
    """Places (y, z) at both ends; a blank one of the second end is that of the first."""
    first = card.real(at), card.real(at + 1)
    return [first, (card.real(at + 2, first[0]), card.real(at + 3, first[1]))]


def _tell_of_stations(deck: Deck, card: Card) -> None:
    reason = "the section changes linearly from one end to the other"
    deck.leave_out(f"stations of {card.name}", card.place, reason)


def _tell_of_axis(deck: Deck, card: Card, axis: Sequence[tuple[float, float]]) -> None:
    if axis[0] != axis[1]:
        reason = "their mean is that of the whole beam"
        deck.leave_out(f"neutral axes of {card.name} at its ends", card.place, reason)


_READERS = {"PBAR": _pbar, "PBARL": _pbarl, "PBEAM": _pbeam, "PBEAML": _pbeaml}
