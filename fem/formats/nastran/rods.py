"""Rods: CROD, CONROD and CTUBE, which stretch, and twist where their ends turn."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fem.base.errors import ModelError
from fem.formats.nastran.cards import Card
from fem.formats.nastran.deck import DIRECTIONS
from fem.formats.nastran.gathered import Gathered, Term
from fem.formats.nastran.materials import Isotropic, Materials
from fem.model.parts import Material, TrussPart

PROPERTIES = {"CROD": "PROD", "CTUBE": "PTUBE"}


@dataclass(frozen=True)
class _Rod:
    """The card of an element, its ends, and what it is made of."""

    card: Card
    ends: tuple[int, int]
    torsion: float
    law: Isotropic


def read_rods(gathered: Gathered, materials: Materials) -> list[_Rod]:
    """Read all rods, and the parts that their properties make of them."""
    deck, rods = gathered.deck, []
    for name, sort in PROPERTIES.items():
        owners = deck.by_number(sort)
        for card in deck.of(name):
            number = card.whole(1, gathered.add_element(card))
            if number not in owners:
                raise card.fail(f"names the property {sort} {number}, which is not defined")
            own = owners[number]
            numbers = _rod_numbers(own) if sort == "PROD" else _tube_numbers(own)
            rod = _rod(gathered, materials, card, own, f"{sort} {number}", 2, 1, numbers)
            rods.append(rod)
    names: dict[tuple[str, ...], str] = {}
    for card in deck.of("CONROD"):
        number = gathered.add_element(card)
        key = tuple(card.text(at) for at in (3, 4, 5, 7))
        name = names.setdefault(key, f"CONROD {number}")
        numbers = card.real(4), card.real(5), card.real(7)
        rods.append(_rod(gathered, materials, card, card, name, 1, 3, numbers))
    return rods


def _rod_numbers(card: Card) -> tuple[float, float, float]:
    return card.real(2), card.real(3), card.real(5)


def _tube_numbers(card: Card) -> tuple[float, float, float]:
    """Of the mean of both diameters; without a thickness the tube is a round bar."""
    outer = (card.real(2) + card.real(5, card.real(2))) / 2.0
    inner = outer - 2.0 * card.real(3) if card.real(3) else 0.0
    area = math.pi / 4.0 * (outer**2 - inner**2)
    return area, math.pi / 32.0 * (outer**4 - inner**4), card.real(4)


def _rod(
    gathered: Gathered,
    materials: Materials,
    card: Card,
    own: Card,
    group: str,
    first: int,
    material: int,
    numbers: tuple[float, float, float],
) -> _Rod:
    area, torsion, added = numbers
    ends = card.whole(first), card.whole(first + 1)
    gathered.add_cell(card, "line", ends, group)
    places = [gathered.deck.place(grid, card) for grid in ends]
    if not np.linalg.norm(places[1] - places[0]) > 0.0:
        raise card.fail("has no length")
    law = materials.isotropic(own.whole(material), own)
    if group not in gathered.described:
        try:
            if not area > 0.0:
                raise own.fail(f"its area is {area:g} and must be positive")
            density = law.density + materials.factor * added / area
            made = TrussPart(Material(law.youngs_modulus, density), area)
            gathered.described[group] = {"made": made}
        except ModelError as error:
            gathered.described[group] = {"refused": str(error)}
    return _Rod(card, ends, torsion, law)


def twist_rods(gathered: Gathered, rods: list[_Rod]) -> None:
    """Torsion of the rods both of whose ends turn; of others it resists nothing that moves."""
    for rod in rods:
        if not rod.torsion or not gathered.turns.issuperset(rod.ends):
            continue
        places = [gathered.deck.place(grid, rod.card) for grid in rod.ends]
        span = places[1] - places[0]
        length = float(np.linalg.norm(span))
        row: list[Term] = []
        for sign, grid in zip((1.0, -1.0), rod.ends, strict=True):
            name = gathered.point(grid, rod.card)
            row += [
                (name, way, sign * float(share))
                for way, share in zip(DIRECTIONS[3:], span / length, strict=True)
                if share
            ]
        stiffness = rod.law.shear_modulus * rod.torsion / length
        gathered.add_matrix(rod.card, [row], stiffness=np.array([[stiffness]]))
