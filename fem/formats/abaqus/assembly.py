"""Scopes: the deck itself, its parts, and the instances of these in the assembly."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from fem.base.errors import ModelError
from fem.formats.abaqus.deck import Body, Deck, Scope
from fem.formats.abaqus.elements import read_elcopy, read_elements, read_elgen
from fem.formats.abaqus.keywords import Keyword
from fem.formats.abaqus.known import ADVICE, LEFT_OUT, MATERIALS, OF_SECTION, READ, UNKNOWN
from fem.formats.abaqus.nodes import (
    read_ncopy,
    read_nfill,
    read_ngen,
    read_nodes,
    read_system,
    turning,
)
from fem.formats.abaqus.sets import read_set

Action = Callable[[Deck, Scope, Keyword], None]
AT_ONCE: dict[str, Action] = {
    "NODE": read_nodes,
    "NGEN": read_ngen,
    "NFILL": read_nfill,
    "NCOPY": read_ncopy,
    "SYSTEM": read_system,
    "ELEMENT": read_elements,
    "ELGEN": read_elgen,
    "ELCOPY": read_elcopy,
    "NSET": read_set,
    "ELSET": read_set,
}
"""Keywords that are carried out where they stand; the others wait until all is known."""


def read_scopes(deck: Deck, keywords: Iterable[Keyword]) -> None:
    """Read all keywords into the scopes that they stand in; note those that are refused."""
    scope, in_material, section = deck.root, False, None
    for keyword in keywords:
        name = keyword.name
        if name.endswith("SECTION"):
            section = keyword
        elif name in OF_SECTION and section is not None:
            deck.changed.append((section, keyword))
        in_material = name == "MATERIAL" or (in_material and _of_material(name))
        if in_material:
            deck.materials.append(keyword)
        if name in LEFT_OUT:
            _leave_out(deck, scope, keyword)
        elif name not in READ:
            advice = ADVICE.get(name, UNKNOWN)
            deck.refuse(_canonical(keyword), keyword.place(), advice)
        elif name in AT_ONCE:
            try:
                AT_ONCE[name](deck, scope, keyword)
            except ModelError:
                if not deck.problems:  # else it may follow from what is refused already
                    raise
        elif name in ("PART", "ENDPART", "INSTANCE", "ENDINSTANCE", "ASSEMBLY", "ENDASSEMBLY"):
            scope = _entered(deck, keyword)
        else:
            scope.later.append(keyword)
    _finish(deck)


def _of_material(name: str) -> bool:
    """Whether a keyword goes on with the material before it; one that is not known does."""
    if name.endswith("SECTION") or name in ADVICE:
        return False
    return name in ("ELASTIC", "DENSITY") or (
        name not in READ and LEFT_OUT.get(name, MATERIALS) == MATERIALS
    )


def _canonical(keyword: Keyword) -> str:
    return "*" + " ".join(keyword.shown[1:].split()).upper()


def _leave_out(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    deck.leave_out(_canonical(keyword), keyword.place(), LEFT_OUT[keyword.name])
    if keyword.name in ("TRANSFORM", "ORIENTATION"):
        scope.later.append(keyword)


def _entered(deck: Deck, keyword: Keyword) -> Scope:
    """The scope that begins where a part, an instance or the assembly begins or ends."""
    name = keyword.name
    if name == "PART":
        keyword.only("NAME", "INTERNAL")
        called = keyword.name_of("NAME")
        if called.upper() in deck.parts:
            raise keyword.fail(f"part {called!r} is defined twice")
        deck.parts[called.upper()] = Scope(called)
        return deck.parts[called.upper()]
    return _instance(deck, keyword) if name == "INSTANCE" else deck.root


def _instance(deck: Deck, keyword: Keyword) -> Scope:
    keyword.only("NAME", "PART")
    called, of = keyword.name_of("NAME"), keyword.parameters.get("PART", "")
    if called.upper() in deck.bodies:
        raise keyword.fail(f"instance {called!r} is defined twice")
    own = Scope(called)
    scopes: tuple[Scope, ...] = (own,)
    if of:
        if of.upper() not in deck.parts:
            raise keyword.fail(f"instance {called!r} is of part {of!r}, which is not defined")
        scopes = (deck.parts[of.upper()], own)
    if len(keyword.rows) > 2:
        raise keyword.fail("needs a translation and a rotation, in two lines")
    shift = np.zeros(3)
    rotation = np.eye(3)
    if keyword.rows:
        shift = np.array([*keyword.numbers(0), 0.0, 0.0, 0.0][:3])
    if len(keyword.rows) == 2:
        rotation, centre = turning(keyword, 1)
        shift = rotation @ (shift - centre) + centre  # moved first, then turned
    deck.bodies[called.upper()] = Body(called, scopes, rotation, shift)
    return own


def _finish(deck: Deck) -> None:
    """The deck itself as a body; parts stand as they are where there are no instances at all."""
    if not deck.bodies:
        for key, part in deck.parts.items():
            deck.bodies[key] = Body(part.name, (part,))
    used = {id(scope) for body in deck.bodies.values() for scope in body.scopes}
    for part in deck.parts.values():
        if id(part) not in used:
            place = f"part {part.name!r}"
            deck.leave_out("*PART", place, "a part that has no instance is not in the assembly")
    deck.bodies[""] = Body("", (deck.root,))
