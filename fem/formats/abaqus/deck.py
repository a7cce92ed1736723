"""What a deck holds: scopes (the deck itself, parts, instances) with nodes, elements and sets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.formats.abaqus.keywords import Keyword
from fem.formats.abaqus.types import ElementType

LONGEST_RANGE = 10_000_000  # numbers, of all ranges and generations of a file together
KINDS_OF_SETS = ("NSET", "ELSET")
TURNED = 1e-12  # change of a direction that is more than rounding
AT_ORIGIN = 1e-30  # m from the origin, and nearer: a place counts as that
SAME_PLACE = 1e-9  # of the coordinates: distance of two definitions of one node

Label = tuple[str, int]
"""A node or an element: the instance it is of (empty: of the deck itself), and its number."""


class Element(NamedTuple):
    """An element: its type, its nodes (numbers, or "instance.number"), and where it stands."""

    type: ElementType
    nodes: tuple[int | str, ...]
    place: str


class Member(NamedTuple):
    """What a set is made of: a number, a range of them, or a name, of an instance or its own."""

    item: int | range | str
    instance: str
    place: str


@dataclass
class NamedSet:
    """A set as it is written: its name and its members in their order."""

    name: str
    members: list[Member] = field(default_factory=list)
    keyword: Keyword | None = None
    elements: list[Member] = field(default_factory=list)

    @property
    def unsorted(self) -> bool:
        """Whether its members keep the order in which they are written."""
        return self.keyword is not None and "UNSORTED" in self.keyword.parameters


@dataclass
class Scope:
    """The deck itself, a part, or an instance with what is written in it."""

    name: str
    nodes: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    elements: dict[int, Element] = field(default_factory=dict)
    sets: dict[str, dict[str, NamedSet]] = field(
        default_factory=lambda: {kind: {} for kind in KINDS_OF_SETS}
    )
    later: list[Keyword] = field(default_factory=list)
    system: tuple[FloatArray, FloatArray] | None = None
    ignored: set[int] = field(default_factory=set)

    def grow(self, kind: str, name: str, members: list[Member]) -> NamedSet:
        """Add members to a set, which keeps the spelling of its first occurrence."""
        found = self.sets[kind].setdefault(name.upper(), NamedSet(name))
        found.members.extend(members)
        return found

    def add_node(self, keyword: Keyword, row: int | None, label: int, place: FloatArray) -> None:
        """A new node; a number that is taken already by one at another place is an error."""
        if label in self.nodes:
            size = max(float(np.abs(place).max()), AT_ORIGIN)
            if float(np.abs(place - np.array(self.nodes[label])).max()) > SAME_PLACE * size:
                raise keyword.fail(f"node {label} is defined twice, at two places", row)
            return
        self.nodes[label] = (float(place[0]), float(place[1]), float(place[2]))

    def add_element(self, keyword: Keyword, row: int | None, label: int, element: Element) -> None:
        """A new element; a number that is taken already is an error."""
        if label in self.elements:
            raise keyword.fail(f"element {label} is defined twice", row)
        self.elements[label] = element


@dataclass
class Body:
    """A scope as it stands in the assembly: turned, then shifted."""

    name: str
    scopes: tuple[Scope, ...]
    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    shift: FloatArray = field(default_factory=lambda: np.zeros(3))

    @property
    def turned(self) -> bool:
        """Whether its directions are others than those of the whole."""
        return bool(np.abs(self.rotation - np.eye(3)).max() > TURNED)

    def set_of(self, kind: str, name: str) -> NamedSet | None:
        """A set by name in any case."""
        found = (scope.sets[kind].get(name.upper()) for scope in self.scopes)
        return next((named for named in found if named), None)

    def has(self, kind: str, label: int) -> bool:
        """Whether it has a node or an element of a number."""
        return any(
            label in (scope.nodes if kind == "NSET" else scope.elements) for scope in self.scopes
        )

    def ignores(self, kind: str, label: int) -> bool:
        """Whether an element is of a type that is to be ignored."""
        return kind == "ELSET" and any(label in scope.ignored for scope in self.scopes)

    def element(self, label: int) -> Element:
        """An element by its number."""
        return next(s.elements[label] for s in self.scopes if label in s.elements)

    def elements(self) -> Iterator[tuple[int, Element]]:
        """All elements with their numbers."""
        for scope in self.scopes:
            yield from scope.elements.items()

    def later(self) -> Iterator[Keyword]:
        """The keywords that wait until all nodes and sets are known, in their order."""
        for scope in self.scopes:
            yield from scope.later

    def nodes(self) -> Iterator[tuple[int, FloatArray]]:
        """All nodes with their places in the whole."""
        for scope in self.scopes:
            if not scope.nodes:
                continue
            places = np.array(list(scope.nodes.values()))
            if self.turned or self.shift.any():
                places = places @ self.rotation.T + self.shift
            yield from zip(scope.nodes, places, strict=True)


def bare(what: str) -> str:
    """A keyword or an element type in capitals, without what stands around it.

    Examples
    --------
    >>> bare("elements of type gapuni"), bare("*Contact Pair"), bare("contactpair")
    ('GAPUNI', 'CONTACTPAIR', 'CONTACTPAIR')
    """
    return "".join(what.removeprefix("elements of type ").split()).lstrip("*").upper()


@dataclass
class Problem:
    """Something that is refused, how often it occurs, and where first."""

    what: str
    count: int
    place: str
    advice: str


@dataclass
class Deck:
    """A whole file while it is read."""

    path: Path
    root: Scope = field(default_factory=lambda: Scope(""))
    parts: dict[str, Scope] = field(default_factory=dict)
    bodies: dict[str, Body] = field(default_factory=dict)
    problems: dict[str, Problem] = field(default_factory=dict)
    left_out: dict[str, Problem] = field(default_factory=dict)
    materials: list[Keyword] = field(default_factory=list)
    changed: list[tuple[Keyword, Keyword]] = field(default_factory=list)
    """Sections, each with a keyword after it that changes what it is."""
    generated: int = 0
    ignore: frozenset[str] = frozenset()
    ignored: set[str] = field(default_factory=set)

    def fail(self, text: str) -> ModelError:
        """An error that names the file."""
        return ModelError(f"{self.path}: {text}")

    def refuse(self, what: str, place: str, advice: str, count: int = 1) -> None:
        """Keep what is refused, to be told together with all else, unless it is to be ignored."""
        word = bare(what)
        if word in self.ignore:
            self.ignored.add(word)
            self.leave_out(what, place, "it is to be ignored", count)
            return
        known = self.problems.setdefault(what, Problem(what, 0, place, advice))
        known.count += count

    def leave_out(self, what: str, place: str, reason: str, count: int = 1) -> None:
        """Keep what is left out by intention."""
        known = self.left_out.setdefault(what.upper(), Problem(what, 0, place, reason))
        known.count += count

    def count_generated(self, keyword: Keyword, row: int | None, count: int, what: str) -> None:
        """Refuse a file that makes more numbers than any mesh has."""
        self.generated += count
        if count < 0 or self.generated > LONGEST_RANGE:
            raise keyword.fail(what, row)

    def raise_problems(self) -> None:
        """One error that lists all that is refused."""
        if self.problems:
            told = "; ".join(
                f"{p.what} ({p.count}, first in {p.place}): {p.advice}"
                for p in self.problems.values()
            )
            raise self.fail(f"holds what is not read: {told}")
