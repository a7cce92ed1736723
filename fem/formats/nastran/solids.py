"""Solids: tetrahedra, pyramids, wedges and hexahedra of PSOLID."""

from __future__ import annotations

from fem.base.errors import ModelError
from fem.formats.nastran.cards import Card
from fem.formats.nastran.gathered import Gathered
from fem.formats.nastran.materials import Materials
from fem.model.parts import Material, SolidPart

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
MECHANICAL = ("", "SMECH")
"""What a PSOLID says in its seventh field where its elements are solids."""


def read_solids(gathered: Gathered, materials: Materials) -> None:
    """Read all solids, and the parts that PSOLID and materials make of them."""
    properties = gathered.deck.by_number("PSOLID")
    used: dict[int, Card] = {}
    for card in gathered.deck.of(*KINDS):
        number = gathered.add_element(card)
        kind, grids = _cell(card, number)
        owner = card.whole(1, number)
        gathered.add_cell(card, kind, grids, f"PSOLID {owner}")
        used.setdefault(owner, card)
    for card in properties.values():
        if card.text(6) not in MECHANICAL:
            raise card.fail(f"is of a fluid or another field ({card.text(6)}), no solid")
        if card.text(3) or card.text(5):
            reason = "solids are integrated as their parts say"
            gathered.deck.leave_out("integration of PSOLID", card.place, reason)
    for owner, card in used.items():
        gathered.described[f"PSOLID {owner}"] = _described(owner, card, properties, materials)


def _described(
    owner: int, card: Card, properties: dict[int, Card], materials: Materials
) -> dict[str, object]:
    if owner not in properties:
        return {"refused": f"PSOLID {owner} of {card.name} in {card.place} is not defined"}
    own = properties[owner]
    try:
        law = materials.solid(own.whole(1), own)
        return {"made": SolidPart(Material(law.youngs_modulus, law.density, law.poissons_ratio))}
    except ModelError as error:
        return {"refused": str(error)}


def _cell(card: Card, number: int) -> tuple[str, list[int]]:
    """Kind and grid points of a solid, in VTK's order."""
    given = card.fields[2:]
    while given and not given[-1]:
        given.pop()
    kind = next((kind for kind in KINDS[card.name] if COUNTS[kind] == len(given)), None)
    if kind is None or not all(given):
        needed = " or ".join(str(COUNTS[kind]) for kind in KINDS[card.name])
        count = len([word for word in given if word])
        raise card.fail(f"element {number} has {count} grid points where {needed} are needed")
    grids = [card.whole(2 + i) for i in range(len(given))]
    return kind, [grids[i] for i in ORDERS.get(kind, range(len(grids)))]
