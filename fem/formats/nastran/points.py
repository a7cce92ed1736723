"""Masses, springs and dampers of a deck."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fem.base.arrays import FloatArray
from fem.formats.nastran.cards import Card
from fem.formats.nastran.deck import Deck
from fem.formats.nastran.gathered import Gathered, Term
from fem.mesh.attachments import Link, PointMass

STIFFNESS, DAMPING, MASS = "stiffness", "damping", "mass"
SCALARS = {
    "CELAS": ("PELAS", STIFFNESS),
    "CDAMP": ("PDAMP", DAMPING),
    "CMASS": ("PMASS", MASS),
}
"""Elements between two directions: their property, and what their number is."""
Property = Mapping[int, tuple[Card, int]]


def read_points(gathered: Gathered, mass_factor: float) -> None:
    """Read scalar elements, bushes, dampers and lumped masses."""
    for sort, (owner, kind) in SCALARS.items():
        properties = _properties(gathered, owner)
        for n in range(1, 5):
            for card in gathered.deck.of(f"{sort}{n}"):
                _read_scalar(gathered, card, n, kind, properties, mass_factor)
    corners = gathered.joined - gathered.turns
    for card in gathered.deck.of("CBUSH"):
        _read_bush(gathered, card, corners)
    for card in gathered.deck.of("CVISC"):
        _read_viscous(gathered, card)
    for card in gathered.deck.of("CONM2"):
        _read_lump(gathered, card, mass_factor)
    for card in gathered.deck.of("CONM1"):
        _read_full_mass(gathered, card, mass_factor)


def _properties(gathered: Gathered, name: str) -> Property:
    """Where the number of each property stands; a card may hold several."""
    found: dict[int, tuple[Card, int]] = {}
    size = 4 if name == "PELAS" else 2
    for card in gathered.deck.of(name):
        for at in range(0, 8, size):
            if card.given(at, size):
                number = card.whole(at)
                if number in found and found[number][0].fields != card.fields:
                    raise card.fail(f"{number} is defined twice")
                found[number] = (card, at + 1)
    return found


def _read_scalar(
    gathered: Gathered, card: Card, n: int, kind: str, properties: Property, mass_factor: float
) -> None:
    """A number between two directions; forms 1 and 3 name a property, 3 and 4 scalar points."""
    gathered.add_element(card)
    if n in (1, 3):
        number = card.whole(1, card.whole(0))
        if number not in properties:
            raise card.fail(f"names the property {number}, which is not defined")
        owner, at = properties[number]
    else:
        owner, at = card, 1
    value = owner.real(at)
    if kind == STIFFNESS and n < 4:
        gathered.deck.tell_of_damping(owner, at + 1 if n in (1, 3) else 6)
    ends = _ends(gathered, card, 2, n)
    if not ends:
        raise card.fail("is joined to no point")
    if len(ends) == 2 and ends[0] == ends[1]:
        reason = "both of its ends are one direction of one point"
        gathered.deck.leave_out(f"{card.name} between a point and itself", card.place, reason)
        return
    if value == 0.0:
        gathered.deck.leave_out(f"{card.name} of the number 0", card.place, "it does nothing")
        return
    if kind == MASS:
        value *= mass_factor
    for grid, component in ends:
        if component > 3 and kind != MASS:
            gathered.turns.add(grid)
    rows = [gathered.terms(card, grid, component) for grid, component in ends]
    plain = all(len(row) == 1 and row[0][2] == 1.0 for row in rows)
    if kind != MASS and plain and value > 0.0:
        points = [row[0][0] for row in rows]
        numbers = {kind: value}
        second = points[1] if len(points) > 1 else None
        link = Link(points[0], second, [row[0][1] for row in rows], **numbers)
        gathered.links.append(link)
        return
    signs = np.array([1.0, -1.0][: len(rows)])
    gathered.add_matrix(card, rows, **{kind: value * np.outer(signs, signs)})


def _ends(gathered: Gathered, card: Card, first: int, n: int) -> list[tuple[int, int]]:
    """The one or two directions of a scalar element; a blank point or 0 is the ground."""
    places = ((first, first + 1), (first + 2, first + 3)) if n < 3 else ((first, 0), (first + 1, 0))
    found = []
    for at, component in places:
        grid = card.whole(at, 0)
        if grid == 0:
            continue
        if grid in gathered.deck.scalars:
            found.append((grid, 1))
        elif n < 3:
            gathered.deck.place(grid, card)
            found.append((grid, card.components(component)[0]))
        else:
            raise card.fail(f"{grid} is not a scalar point")
    return found


def _read_lump(gathered: Gathered, card: Card, factor: float) -> None:
    """CONM2: a rigid body at a grid point, with its centre aside and its six inertias."""
    gathered.add_element(card)
    grid, system = card.whole(1), card.whole(2, 0)
    mass = factor * card.real(3)
    arm, numbers = np.array(card.reals(4, 3)), factor * np.array(card.reals(8, 6))
    place = gathered.deck.place(grid, card)
    if system == -1:  # then the arm is a place in basic coordinates
        arm, axes = arm - place, np.eye(3)
    else:
        axes = gathered.deck.systems.system(system, card).axes_at(place)
        arm = arm @ axes
    xx, xy, yy, xz, yz, zz = numbers
    inertia = axes.T @ np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]]) @ axes
    gathered.point(grid, card)
    gathered.joined.add(grid)
    if (inertia.any() or arm.any()) and grid not in gathered.turns:
        gathered.deck.leave_out(
            "offset or inertia of CONM2",
            card.place,
            "no element resists the rotations of its grid point, which are held",
        )
        inertia, arm = np.zeros((3, 3)), np.zeros(3)
    principal = np.diag(inertia)
    diagonal = np.abs(inertia - np.diag(principal)).max() <= 1e-12 * max(principal.max(), 1e-300)
    if mass >= 0.0 and diagonal and principal.min() >= 0.0 and (mass or not arm.any()):
        if mass or principal.any():
            body = PointMass(f"node {grid}", mass, tuple(principal.tolist()), tuple(arm.tolist()))
            gathered.masses.append(body)
        return
    x, y, z = arm
    to_centre = np.hstack([np.eye(3), [[0, z, -y], [-z, 0, x], [y, -x, 0]]])
    matrix = mass * to_centre.T @ to_centre
    matrix[3:, 3:] += inertia
    gathered.add_matrix(card, _basic(gathered, card, grid), mass=matrix)


def _basic(gathered: Gathered, card: Card, grid: int) -> list[list[Term]]:
    """The six basic directions of a grid point, each as a form of one term."""
    name = gathered.point(grid, card)
    directions = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
    return [[(name, direction, 1.0)] for direction in directions]


def _read_full_mass(gathered: Gathered, card: Card, factor: float) -> None:
    """CONM1: the lower triangle of a mass matrix (6, 6) in a system."""
    gathered.add_element(card)
    grid, system = card.whole(1), card.whole(2, 0)
    matrix = np.zeros((6, 6))
    matrix[np.tril_indices(6)] = factor * np.array(card.reals(3, 21))
    matrix = matrix + matrix.T - np.diag(np.diag(matrix))
    axes = gathered.deck.systems.system(system, card).axes_at(gathered.deck.place(grid, card))
    gathered.joined.add(grid)
    T = np.kron(np.eye(2), axes)
    matrix = T.T @ matrix @ T
    rows = _basic(gathered, card, grid)
    if grid not in gathered.turns:
        if matrix[3:].any():
            reason = "no element resists the rotations of its grid point, which are held"
            gathered.deck.leave_out("rotations of CONM1", card.place, reason)
        rows, matrix = rows[:3], matrix[:3, :3]
    gathered.add_matrix(card, rows, mass=matrix)


def _read_bush(gathered: Gathered, card: Card, corners: set[int]) -> None:
    """CBUSH: six springs and dampers at a place between two grid points, or to the ground.

    Of `corners` nothing else has rotations.
    """
    gathered.add_element(card)
    owners = gathered.deck.by_number("PBUSH")
    number = card.whole(1, card.whole(0))
    if number not in owners:
        raise card.fail(f"names the property PBUSH {number}, which is not defined")
    numbers = _bush_numbers(gathered.deck, owners[number])
    stiffness, damping = numbers["K"], numbers["B"]
    first, second = card.whole(2), card.whole(3, 0)
    ends = [first] + ([second] if second else [])
    places = [gathered.deck.place(grid, card) for grid in ends]
    across = any(each[i] != each[i + 1] for each in (stiffness, damping) for i in (1, 4))
    axes = _bush_axes(gathered, card, places, across)
    centre = _bush_centre(gathered, card, places)
    for grid, place in zip(ends, places, strict=True):
        if (stiffness[3:].any() or damping[3:].any()) or np.linalg.norm(centre - place) > 0.0:
            gathered.turns.add(grid)
            if grid in corners:
                gathered.deck.notes.append(
                    f"{gathered.deck.source}: {card.place}: CBUSH {card.whole(0)} turns the grid"
                    f" point {grid}, whose other elements have no rotations: hold these by SPC, or"
                    " leave out its K4 to K6 and its arm"
                )
        gathered.joined.add(grid)
    rows, forms = [], []
    for sign, grid, place in zip((1.0, -1.0), ends, places, strict=False):
        six = _basic(gathered, card, grid)
        turning = grid in gathered.turns
        rows += six if turning else six[:3]
        x, y, z = centre - place
        lever = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0.0]])
        B = np.zeros((6, 6))
        B[:3, :3], B[:3, 3:], B[3:, 3:] = axes, axes @ lever, axes
        forms.append(sign * (B if turning else B[:, :3]))
    B = np.hstack(forms)
    K, C = (B.T @ np.diag(each) @ B for each in (stiffness, damping))
    gathered.add_matrix(card, rows, stiffness=K, damping=C)


def _bush_numbers(deck: Deck, card: Card) -> dict[str, FloatArray]:
    """Six stiffnesses K and dampings B of PBUSH, whose words stand before six numbers each."""
    found = {"K": np.zeros(6), "B": np.zeros(6)}
    at = 1
    while at < len(card.fields):
        word = card.text(at)
        if word in found:
            found[word] = np.array([card.real(at + 1 + i) for i in range(6)])
            at += 7
        elif word == "M" and any(card.text(at + 1 + i) for i in range(6)):
            raise card.fail("its mass (M) is not read; give it as CONM2")
        elif word in ("GE", "RCV", "M", "T", "D"):  # RCV: recovery of stresses
            for i in range(6 if word == "GE" else 0):
                deck.tell_of_damping(card, at + 1 + i)
            at += 7
        elif not word:
            at += 1
        else:
            raise card.fail(f"{word!r} in {card.field(at)} is not read")
    return found


def _bush_axes(
    gathered: Gathered, card: Card, places: list[FloatArray], across: bool
) -> FloatArray:
    """Axes as rows: of a system, or along the line of the grid points and an orientation.

    Without `across` every orientation is the same.
    """
    systems = gathered.deck.systems
    if card.text(7):
        return systems.system(card.whole(7), card).axes_at(places[0])
    length = np.linalg.norm(places[-1] - places[0])
    if length == 0.0:
        raise card.fail("has no length, so it needs a coordinate system (CID) for its directions")
    x = (places[-1] - places[0]) / length
    if card.text(4) and not card.is_real(4):
        v = gathered.deck.place(card.whole(4), card) - places[0]
    elif any(card.text(at) for at in (4, 5, 6)):
        v = np.array(card.reals(4, 3)) @ gathered.deck.axes(card.whole(2))
    elif across:
        raise card.fail("acts across its line and needs an orientation (G0, X) or a system (CID)")
    else:
        v = np.eye(3)[np.argmin(np.abs(x))]
    z = np.cross(x, v)
    if not np.linalg.norm(z) > 0.0:
        raise card.fail("its orientation lies along it")
    z = z / np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def _bush_centre(gathered: Gathered, card: Card, places: list[FloatArray]) -> FloatArray:
    """Where the springs act: at a share of the way, by default half, or at an offset."""
    if card.text(9) and card.whole(9) >= 0:
        system = gathered.deck.systems.system(card.whole(9), card)
        return system.place(np.array(card.reals(10, 3)))
    share = card.real(8, 0.5)
    return np.asarray(places[0] + share * (places[-1] - places[0]))


def _read_viscous(gathered: Gathered, card: Card) -> None:
    """CVISC: a damper along a line, and one that turns about it."""
    gathered.add_element(card)
    owners = {}
    for own in gathered.deck.of("PVISC"):
        for at in (0, 4):
            if own.given(at, 4):
                owners[own.whole(at)] = (own, at + 1)
    number = card.whole(1, card.whole(0))
    if number not in owners:
        raise card.fail(f"names the property PVISC {number}, which is not defined")
    along, about = owners[number][0].reals(owners[number][1], 2)
    ends = [card.whole(2), card.whole(3)]
    span = gathered.deck.place(ends[1], card) - gathered.deck.place(ends[0], card)
    length = float(np.linalg.norm(span))
    if length == 0.0:
        raise card.fail("has no length")
    for first, value in ((0, along), (3, about)):
        if not value:
            continue
        if first:
            gathered.turns.update(ends)
        row: list[Term] = []
        for sign, grid in zip((1.0, -1.0), ends, strict=True):
            gathered.joined.add(grid)
            name = gathered.point(grid, card)
            ways = ("x", "y", "z") if first == 0 else ("rotation_x", "rotation_y", "rotation_z")
            row += [
                (name, w, sign * float(s)) for w, s in zip(ways, span / length, strict=True) if s
            ]
        gathered.add_matrix(card, [row], damping=np.array([[value]]))
