"""Rigid elements and linear equations: RBE2, RBE3, RBAR, RROD and MPC."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fem.base.arrays import FloatArray
from fem.formats.nastran.cards import Card
from fem.formats.nastran.deck import DIRECTIONS
from fem.formats.nastran.gathered import Gathered, Term
from fem.formats.nastran.supports import chosen_sets
from fem.mesh.attachments import LinearEquation

ALIGNED = 1e10  # condition of the moments of an averaging element, from which it does not hold
NAMES = ("RBE2", "RBAR", "RBE3", "RROD")


def mark_turning(gathered: Gathered) -> frozenset[int]:
    """Note the grid points that are turned, before anything is attached to them.

    Returns
    -------
    frozenset of int
        The sets of equations (MPC) that hold.
    """
    deck = gathered.deck
    for card in deck.of("RBE2"):
        gathered.turns.add(card.whole(1))
        if max(card.components(2)) > 3:
            gathered.turns.update(deck.grids.keys() & set(_slaves(card)))
    for card in deck.of("RBAR"):
        gathered.turns.update([card.whole(1), card.whole(2)])
    for card in deck.of("RBE3"):
        gathered.turns.add(card.whole(2))
    sets = chosen_sets(deck, "MPC", "MPCADD", "MPC")
    for card in deck.of("MPC"):
        if card.whole(0) in sets:
            turned = [grid for grid, component, _ in _forms(gathered, card) if component > 3]
            gathered.turns.update(turned)
    return sets


def read_rigid(gathered: Gathered, sets: frozenset[int]) -> None:
    """Read all rigid elements, and the equations of the sets that hold."""
    for card in gathered.deck.of("RBE2"):
        gathered.add_element(card)
        _read_rbe2(gathered, card)
    for card in gathered.deck.of("RBAR"):
        gathered.add_element(card)
        _read_rbar(gathered, card)
    for card in gathered.deck.of("RROD"):
        gathered.add_element(card)
        _read_rrod(gathered, card)
    for card in gathered.deck.of("RBE3"):
        gathered.add_element(card)
        _read_rbe3(gathered, card)
    for card in gathered.deck.of("MPC"):
        if card.whole(0) in sets:
            _read_mpc(gathered, card)


def _equation(gathered: Gathered, card: Card, terms: Sequence[Term]) -> None:
    """The sum of the terms is zero; the first one follows from the others if it can."""
    found: dict[tuple[str, str], float] = {}
    for point, direction, value in terms:
        found[point, direction] = found.get((point, direction), 0.0) + value
    kept = [(point, direction, value) for (point, direction), value in found.items() if value]
    if kept:
        gathered.equations.append(LinearEquation(kept, f"{card.name} in {card.place}"))


def _row(
    gathered: Gathered, card: Card, grid: int, vector: FloatArray, factor: float
) -> list[Term]:
    """A form of the six basic displacements (6,) of a grid point; rotations that it lacks are 0."""
    name = gathered.point(grid, card)
    gathered.joined.add(grid)
    count = 6 if grid in gathered.turns else 3
    return [
        (name, DIRECTIONS[i], factor * float(vector[i])) for i in range(count) if vector[i] != 0.0
    ]


def _follow(gathered: Gathered, card: Card, master: int, slave: int, components: list[int]) -> None:
    """Directions of one grid point that follow another as those of one rigid body."""
    arm = gathered.deck.place(slave, card) - gathered.deck.place(master, card)
    x, y, z = arm
    lever = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
    motion = np.block([[np.eye(3), lever], [np.zeros((3, 3)), np.eye(3)]])
    axes = gathered.deck.axes(slave)
    own = np.kron(np.eye(2), axes)
    for component in components:
        if not gathered.has(slave, component):
            continue
        row = own[component - 1]
        terms = _row(gathered, card, slave, row, 1.0)
        terms.sort(key=lambda term: -abs(term[2]))
        _equation(gathered, card, terms + _row(gathered, card, master, row @ motion, -1.0))


def _slaves(card: Card) -> list[int]:
    """The dependent grid points of RBE2, without the number of expansion that may end it."""
    while card.fields and not card.fields[-1]:
        card.fields.pop()
    last = len(card.fields) - card.is_real(len(card.fields) - 1)
    return Card(card.name, card.fields[:last], card.line, card.source).wholes(3)


def _read_rbe2(gathered: Gathered, card: Card) -> None:
    """Grid points that follow the first one; a real number at the end is of expansion."""
    master, components, slaves = card.whole(1), card.components(2), _slaves(card)
    if card.is_real(len(card.fields) - 1):
        gathered.deck.leave_out("expansion of RBE2", card.place, "it is not used")
    if not slaves:
        raise card.fail("has no dependent grid point")
    for slave in dict.fromkeys(gathered.deck.existing(card, slaves)):
        if slave == master:
            raise card.fail(f"grid point {slave} depends on itself")
        _follow(gathered, card, master, slave, components)


def _read_rbar(gathered: Gathered, card: Card) -> None:
    """Two grid points of one rigid body, six of whose directions are independent."""
    ends = [card.whole(1), card.whole(2)]
    free = [card.components(at) if card.text(at) else [] for at in (3, 4)]
    if sum(map(len, free)) != 6:
        raise card.fail("its independent directions (CNA and CNB) are not six")
    tied = [card.components(at) if card.text(at) else [] for at in (5, 6)]
    if len(free[0]) == 6 or len(free[1]) == 6:
        master = 0 if len(free[0]) == 6 else 1
        components = tied[1 - master] or [1, 2, 3, 4, 5, 6]
        _follow(gathered, card, ends[master], ends[1 - master], components)
        return
    if any(tied):
        raise card.fail("dependent directions (CMA, CMB) go with six independent ones of one end")
    _follow(gathered, card, ends[0], ends[1], [1, 2, 3, 4, 5, 6])


def _read_rrod(gathered: Gathered, card: Card) -> None:
    """Two grid points whose distance stays."""
    ends = [card.whole(1), card.whole(2)]
    span = gathered.deck.place(ends[1], card) - gathered.deck.place(ends[0], card)
    row = np.append(span / np.linalg.norm(span), np.zeros(3))
    terms = _row(gathered, card, ends[1], row, 1.0) + _row(gathered, card, ends[0], row, -1.0)
    _equation(gathered, card, sorted(terms, key=lambda term: -abs(term[2])))


def _read_rbe3(gathered: Gathered, card: Card) -> None:
    """A grid point that moves with the weighted mean of others.

    Its motion is the rigid one nearest to theirs: with the weights W and the rigid motions S of
    their directions it is (SᵀWS)⁻¹SᵀWu, where weights of rotations are times the square of the
    mean distance.
    """
    point, wanted = card.whole(2), card.components(3)
    groups = _weighted(card)
    centre = gathered.deck.place(point, card)
    grids = [(w, comps, grid) for w, comps, found in groups for grid in found]
    arms = [gathered.deck.place(grid, card) - centre for _, _, grid in grids]
    size = float(np.mean([np.linalg.norm(arm) for arm in arms])) if arms else 0.0
    rows, weights, forms = [], [], []
    for (weight, components, grid), (x, y, z) in zip(grids, arms, strict=True):
        lever = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        motion = np.block([[np.eye(3), lever], [np.zeros((3, 3)), np.eye(3)]])
        own = np.kron(np.eye(2), gathered.deck.axes(grid))
        for component in components:
            if not gathered.has(grid, component):
                if weight:
                    gathered.deck.leave_out(
                        "rotations of RBE3", card.place, "no element there resists rotations"
                    )
                continue
            rows.append(own[component - 1] @ motion)
            forms.append(_row(gathered, card, grid, own[component - 1], 1.0))
            weights.append(weight * (size**2 if component > 3 else 1.0))
    S, W = np.array(rows).reshape(-1, 6), np.array(weights)
    normal = S.T @ (W[:, None] * S)
    scale = np.sqrt(np.maximum(np.diag(normal), 0.0))
    if not (scale > 0.0).all() or np.linalg.cond(normal / np.outer(scale, scale)) > ALIGNED:
        raise card.fail(
            "its grid points do not determine all six motions (they lie on a line or a point);"
            " give more of them, or more directions"
        )
    mean = np.linalg.solve(normal, S.T * W)
    own = np.kron(np.eye(2), gathered.deck.axes(point))
    for component in wanted:
        share = own[component - 1] @ mean
        terms = _row(gathered, card, point, own[component - 1], 1.0)
        terms.sort(key=lambda term: -abs(term[2]))
        for factor, form in zip(share, forms, strict=True):
            if abs(factor) > 1e-14:
                terms += [(p, d, -factor * value) for p, d, value in form]
        _equation(gathered, card, terms)


def _weighted(card: Card) -> list[tuple[float, list[int], list[int]]]:
    """The groups of RBE3: a weight, directions and grid points, up to UM or ALPHA."""
    end = next(
        (i for i, w in enumerate(card.fields) if i > 3 and w.upper() in ("UM", "ALPHA")),
        len(card.fields),
    )
    at, found = 4, []
    while at < end:
        if not card.text(at):
            at += 1
            continue
        weight, components = card.real(at), card.components(at + 1)
        stop = at + 2
        while stop < end and not card.is_real(stop):
            stop += 1
        own = Card(card.name, card.fields[at + 2 : stop], card.line, card.source)
        found.append((weight, components, own.wholes(0)))
        at = stop
    if not any(grids for _, _, grids in found):
        raise card.fail("has no grid points whose mean is taken")
    return found


def _read_mpc(gathered: Gathered, card: Card) -> None:
    """A linear equation between directions of grid points."""
    terms: list[Term] = []
    forms = _forms(gathered, card)
    if not forms:
        raise card.fail("has no terms")
    if forms[0][2] == 0.0:
        raise card.fail("its first factor is 0, so that its first direction depends on nothing")
    for grid, component, value in forms:
        terms += gathered.terms(card, grid, component, value)
    _equation(gathered, card, terms)


def _forms(gathered: Gathered, card: Card) -> list[tuple[int, int, float]]:
    """Grid point, direction and factor; two a line, after a blank field in all but the first."""
    found = []
    for start in range(0, len(card.fields), 8):
        for at in (start + 1, start + 4):
            if card.given(at, 3):
                grid, value = card.whole(at), card.real(at + 2)
                component = 1 if grid in gathered.deck.scalars else card.components(at + 1)[0]
                found.append((grid, component, value))
    return found
