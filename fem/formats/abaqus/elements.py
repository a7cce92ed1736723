"""Elements: given one by one, or generated from others."""

from __future__ import annotations

import re
from itertools import product

from fem.formats.abaqus.deck import Deck, Element, Member, Scope, bare
from fem.formats.abaqus.keywords import Keyword, filled
from fem.formats.abaqus.known import ELEMENT_ADVICE, OTHER_ELEMENT
from fem.formats.abaqus.sets import labels_now
from fem.formats.abaqus.types import ElementType, element_type


def read_elements(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    """``*ELEMENT``: a number and the nodes; a row goes on in the next where nodes are missing."""
    keyword.only("TYPE", "ELSET", "INPUT")
    name = keyword.name_of("TYPE").upper()
    kind = element_type(name)
    if kind is None:
        _refuse(deck, scope, keyword, name)
        return
    labels, row = [], 0
    while row < len(keyword.rows):
        first, words = row, filled(keyword.rows[row])
        while len(words) < kind.count + 1 and row + 1 < len(keyword.rows):
            row += 1
            words = words + filled(keyword.rows[row])
        label = keyword.whole(words[0] if words else "", first)
        scope.add_element(keyword, first, label, _element(keyword, first, kind, words))
        if kind.kind is not None and len(words) > kind.count + 1:
            place = keyword.place(first)
            deck.leave_out("orientation nodes of beams", place, "the scene orients beams")
        labels.append(label)
        row += 1
    if "ELSET" in keyword.parameters:
        members = [Member(label, "", keyword.place()) for label in labels]
        scope.grow("ELSET", keyword.name_of("ELSET"), members)


def _element(keyword: Keyword, row: int, kind: ElementType, words: list[str]) -> Element:
    nodes = words[1:]
    most = kind.count + 1 if kind.oriented and kind.kind == "line" else kind.count
    if not kind.count <= len(nodes) <= most or not all(nodes):
        count = len([node for node in nodes if node])
        raise keyword.fail(
            f"element {words[0]} of type {kind.name} has {count} nodes where {kind.count} are"
            " needed",
            row,
        )
    own = [node if "." in node else keyword.whole(node, row) for node in nodes[: kind.count]]
    return Element(kind, tuple(own), keyword.place(row))


def _refuse(deck: Deck, scope: Scope, keyword: Keyword, name: str) -> None:
    """Note a type that is not read; a row that ends in a comma goes on in the next."""
    advice = (said for pattern, said in ELEMENT_ADVICE if re.fullmatch(pattern, name))
    starts = [True, *(row[-1] != "" for row in keyword.rows[:-1])][: len(keyword.rows)]
    first = keyword.rows[0][0] if keyword.rows else "none"
    place = f"{keyword.place(0 if keyword.rows else None)}, element {first}"
    what = f"elements of type {name}"
    deck.refuse(what, place, next(advice, OTHER_ELEMENT), max(1, sum(starts)))
    if bare(what) in deck.ignore:
        rows = (row for row, start in zip(keyword.rows, starts, strict=True) if start)
        scope.ignored.update(int(row[0]) for row in rows if row[0].isdigit())
        if "ELSET" in keyword.parameters:
            scope.grow("ELSET", keyword.name_of("ELSET"), [])


def read_elgen(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    """``*ELGEN``: copies of an element in a row, in rows and in layers."""
    keyword.only("ELSET")
    labels = []
    for row, words in enumerate(keyword.rows):
        given = [keyword.whole(word or "1", row) for word in filled(words)]
        if not 2 <= len(given) <= 10:
            raise keyword.fail("needs an element and up to three triples of numbers", row)
        master, *rest = given + [1] * (10 - len(given))
        counts, node_steps, steps = rest[0::3], rest[1::3], rest[2::3]
        if min(counts) < 1:
            raise keyword.fail("a number of elements is below one", row)
        made = counts[0] * counts[1] * counts[2]
        deck.count_generated(keyword, row, made, "makes more elements than a mesh has")
        for at in product(*(range(count) for count in counts)):
            shift = sum(k * step for k, step in zip(at, steps, strict=True))
            by = sum(k * step for k, step in zip(at, node_steps, strict=True))
            if any(at):
                _copy(scope, keyword, row, (master, master + shift), by)
            labels.append(master + shift)
    if "ELSET" in keyword.parameters:
        members = [Member(label, "", keyword.place()) for label in labels]
        scope.grow("ELSET", keyword.name_of("ELSET"), members)


def read_elcopy(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    """``*ELCOPY``: copies of the elements of a set with other numbers."""
    keyword.only("ELEMENT SHIFT", "OLD SET", "NEW SET", "SHIFT NODES")
    old = labels_now(scope, "ELSET", keyword, None, keyword.name_of("OLD SET"))
    shift = keyword.whole(keyword.name_of("ELEMENT SHIFT"), None)
    by = keyword.whole(keyword.name_of("SHIFT NODES"), None)
    deck.count_generated(keyword, None, len(old), "makes more elements than a mesh has")
    for label in old:
        _copy(scope, keyword, None, (label, label + shift), by)
    if "NEW SET" in keyword.parameters:
        members = [Member(label + shift, "", keyword.place()) for label in old]
        scope.grow("ELSET", keyword.name_of("NEW SET"), members)


def _copy(
    scope: Scope, keyword: Keyword, row: int | None, labels: tuple[int, int], by: int
) -> None:
    """Make an element of one with another number and nodes whose numbers are shifted."""
    old, new = labels
    if old not in scope.elements:
        raise keyword.fail(f"element {old} is not defined before it", row)
    element = scope.elements[old]
    nodes = tuple(node + by if isinstance(node, int) else node for node in element.nodes)
    scope.add_element(keyword, row, new, Element(element.type, nodes, keyword.place(row)))
