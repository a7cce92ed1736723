"""Supports: SPC and SPC1 of the set that case control chooses, and what GRID holds for good."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.base.errors import ModelError
from fem.formats.nastran.cards import Card
from fem.formats.nastran.deck import DIRECTIONS, Deck
from fem.formats.nastran.gathered import Gathered
from fem.mesh.attachments import LinearEquation

Held = dict[int, tuple[Card, set[int]]]
"""The directions, 1 to 6, in which grid points are held, and the card that says so first."""
WHOLE = (range(1, 4), range(4, 7))


def chosen_sets(deck: Deck, name: str, sums: str, *cards: str) -> frozenset[int]:
    """The sets of a kind (SPC or MPC) that count, with those that the adding card names.

    Where there is no case control, the one set that there is; with it, what the first case
    chooses. What is not chosen is told.

    Raises
    ------
    ModelError
        If a set that is chosen or added is not there, unless cards of its kind are ignored. That
        MPC chooses one where the deck has no equations at all is told, as Nastran runs such decks.
    """
    given = {card.whole(0) for card in deck.of(*cards)}
    adding = {card.whole(0): card for card in deck.of(sums)}
    certain = deck.ignored.isdisjoint({sums, *cards})
    choice = deck.choice(name)
    chosen: set[int] = set()
    if choice and choice.value.isdigit():
        chosen = {int(choice.value)}
        told = f"{deck.source}: {choice.line.place(deck.source)}: {name} = {choice.value} chooses"
        if certain and name == "MPC" and not given | set(adding):
            deck.notes.append(f"{told} a set, but the deck has no {name}")
        elif certain and not chosen <= given | set(adding):
            raise ModelError(
                f"{told} a set that is not there; give its {' or '.join(cards)}, or take the line"
                " out"
            )
    elif not deck.control.there and len(given | set(adding)) >= 1:
        tops = set(adding) or given
        if len(tops) == 1:
            chosen = tops
            deck.notes.append(
                f"{deck.source}: there is no case control; {name} = {min(tops)}, the only set, is"
                " taken"
            )
    for number in list(chosen):
        if number in adding:
            parts = set(adding[number].wholes(1))
            if certain and not parts <= given:
                missing = ", ".join(map(str, sorted(parts - given)))
                raise adding[number].fail(f"adds the set {missing}, which is not there")
            chosen |= parts
    for card in deck.of(*cards):
        if card.whole(0) not in chosen:
            reason = f"no {name} of case control chooses the set {card.whole(0)}"
            deck.leave_out(f"{card.name} {card.whole(0)}", card.place, reason)
    return frozenset(chosen)


def read_supports(gathered: Gathered) -> None:
    """Hold what the chosen sets hold, in the directions of each grid point's own system."""
    deck = gathered.deck
    sets = chosen_sets(deck, "SPC", "SPCADD", "SPC", "SPC1")
    held: Held = {}
    for number, grid in deck.grids.items():
        if grid.held:
            held[number] = (grid.card, set(grid.held))
    for card, number, components in _given(deck, sets):
        held.setdefault(number, (card, set()))[1].update(components)
    by_ways: dict[tuple[str, ...], list[int]] = {}
    for number, (card, components) in held.items():
        ways = _held(gathered, number, card, components)
        if ways:
            by_ways.setdefault(tuple(ways), []).append(number)
    name = " ".join(["SPC", *map(str, sorted(sets))])
    for held_ways, numbers in by_ways.items():
        gathered.hold(name, numbers, held_ways)
    scalars = [number for number in deck.scalars if f"node {number}" in gathered.sets]
    if scalars:
        gathered.hold("SPOINT", scalars, ("y", "z"))


def _given(deck: Deck, sets: frozenset[int]) -> Iterator[tuple[Card, int, set[int]]]:
    for card in deck.of("SPC"):
        if card.whole(0) not in sets:
            continue
        for at in (1, 4):
            if card.given(at, 3):
                number = card.whole(at)
                if card.real(at + 2):
                    deck.leave_out("enforced motion of SPC", card.place, "loads are of the scene")
                yield card, number, _components(deck, card, number, at + 1)
    for card in deck.of("SPC1"):
        if card.whole(0) in sets:
            for number in deck.existing(card, card.wholes(2)):
                yield card, number, _components(deck, card, number, 1)


def _components(deck: Deck, card: Card, number: int, at: int) -> set[int]:
    if number in deck.scalars:
        return {1}
    deck.place(number, card)
    return set(card.components(at))


def _held(gathered: Gathered, number: int, card: Card, components: set[int]) -> list[str]:
    """Basic directions that are held; slanting ones become equations."""
    scalar = number in gathered.deck.scalars
    if f"node {number}" not in gathered.sets if scalar else number not in gathered.joined:
        return []  # nothing is joined to it
    ways = []
    kept = {c for c in components if gathered.has(number, c)}
    if len(kept) < len(components):
        gathered.deck.leave_out(
            "supports of rotations", card.place, "no element there resists rotations"
        )
    if scalar:
        return ["x"] if kept else []
    axes = gathered.deck.axes(number)
    for whole in WHOLE:
        own = kept.intersection(whole)
        if len(own) == 3 or (own and np.allclose(axes, np.eye(3), atol=1e-12)):
            ways += [DIRECTIONS[c - 1] for c in sorted(own)]
            continue
        for component in sorted(own):
            terms = gathered.terms(card, number, component)
            if len(terms) == 1:
                ways.append(terms[0][1])
                continue
            terms.sort(key=lambda term: -abs(term[2]))
            origin = f"{card.name} in {card.place}"
            gathered.equations.append(LinearEquation(terms, origin))
    return [way for way in DIRECTIONS if way in ways]
