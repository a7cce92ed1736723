"""Masses, springs and dashpots: elements at points, and the keywords that give their numbers."""

from __future__ import annotations

from dataclasses import dataclass, field

from fem.formats.abaqus.deck import Body, Deck, Element, Label
from fem.formats.abaqus.keywords import Keyword, filled
from fem.formats.abaqus.sets import Resolver
from fem.mesh.attachments import Attachments, Coupling, LinearEquation, Link, PointMass

DIRECTIONS = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
PROPERTY_OF = {"MASS": "MASS", "ROTARYI": "ROTARYINERTIA"}
PROPERTY_OF |= {f"SPRING{end}": "SPRING" for end in "12A"}
PROPERTY_OF |= {f"DASHPOT{end}": "DASHPOT" for end in "12A"}
SHOWN = {"MASS": "*MASS", "ROTARYINERTIA": "*ROTARY INERTIA"}
SHOWN |= {"SPRING": "*SPRING", "DASHPOT": "*DASHPOT"}


@dataclass
class Gathered:
    """What is attached, and the sets of nodes that were named for the purpose."""

    deck: Deck
    resolver: Resolver
    masses: list[PointMass] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    equations: list[LinearEquation] = field(default_factory=list)
    sets: dict[str, list[Label]] = field(default_factory=dict)
    transformed: dict[Label, str] = field(default_factory=dict)

    @property
    def attachments(self) -> Attachments:
        """All of it."""
        return Attachments(self.masses, self.links, self.couplings, self.equations)

    def point(self, node: Label) -> str:
        """The name of a node: "node 17" or "node PLATE-1.17"."""
        name = f"node {node[1]}" if not node[0] else f"node {node[0]}.{node[1]}"
        self.sets[name] = [node]
        return name

    def direction(self, word: str, node: Label, keyword: Keyword, row: int | None) -> str:
        """The direction of a number from 1 to 6, if the axes are those of the whole."""
        number = keyword.whole(word, row)
        if not 1 <= number <= 6:
            raise keyword.fail(f"{number} is not a direction from 1 to 6", row)
        if self.deck.bodies[node[0].upper()].turned:
            raise keyword.fail(
                f"node {node[1]} is of instance {node[0]!r}, which is turned, so that its"
                " directions are not along x, y and z; that is not read",
                row,
            )
        if node in self.transformed:
            raise keyword.fail(
                f"node {node[1]} has axes of its own by *TRANSFORM in {self.transformed[node]},"
                " which is not read where something is attached to it",
                row,
            )
        return DIRECTIONS[number - 1]


def read_transforms(gathered: Gathered) -> None:
    """Note the nodes whose axes a ``*TRANSFORM`` turns; they matter where something is attached."""
    for body in gathered.deck.bodies.values():
        for keyword in body.later():
            if keyword.name == "TRANSFORM":
                name = keyword.name_of("NSET")
                place = keyword.place()
                for node in gathered.resolver.reference("NSET", body, name, place, "*TRANSFORM"):
                    gathered.transformed[node] = place


def read_point_elements(gathered: Gathered) -> None:
    """Give the masses, springs and dashpots the numbers of the keywords that name their sets."""
    for body in gathered.deck.bodies.values():
        elements = {
            label: element for label, element in body.elements() if element.type.name in PROPERTY_OF
        }
        numbers: dict[Label, Keyword] = {}
        for keyword in body.later():
            if keyword.name in PROPERTY_OF.values():
                _give(gathered, body, keyword, numbers)
        for label, element in elements.items():
            keyword_name = PROPERTY_OF[element.type.name]
            given = numbers.pop((body.name, label), None)
            if given is None or given.name != keyword_name:
                raise gathered.deck.fail(
                    f"{element.place}: element {label} of type {element.type.name} has no"
                    f" {SHOWN[keyword_name]} that gives its numbers"
                )
            _READERS[keyword_name](gathered, (body.name, label), element, given)
        for (_, label), keyword in numbers.items():
            raise keyword.fail(f"names element {label}, which is not of its type")


def _give(gathered: Gathered, body: Body, keyword: Keyword, numbers: dict[Label, Keyword]) -> None:
    name = keyword.name_of("ELSET")
    place = keyword.place()
    for label in gathered.resolver.reference("ELSET", body, name, place, keyword.shown):
        if label in numbers:
            raise keyword.fail(f"element {label[1]} has its numbers already")
        numbers[label] = keyword


def _one_row(keyword: Keyword) -> list[float]:
    if len(keyword.rows) != 1:
        raise keyword.fail(f"has {len(keyword.rows)} lines of numbers and must have one")
    return keyword.numbers(0)


def _read_mass(gathered: Gathered, label: Label, element: Element, keyword: Keyword) -> None:
    keyword.only("ELSET")
    given = _one_row(keyword)
    if len(given) != 1 or not given[0] > 0.0:
        raise keyword.fail("must give one mass above zero", 0)
    node = gathered.resolver.nodes_of(label)[0]
    gathered.masses.append(PointMass(gathered.point(node), given[0]))


def _read_rotary(gathered: Gathered, label: Label, element: Element, keyword: Keyword) -> None:
    keyword.only("ELSET")
    given = [*_one_row(keyword), *[0.0] * 6][:6]
    if any(given[3:]):
        raise keyword.fail("products of inertia are not read; give principal axes along x, y, z", 0)
    node = gathered.resolver.nodes_of(label)[0]
    if len(set(given[:3])) > 1:
        gathered.direction("4", node, keyword, 0)
    gathered.masses.append(PointMass(gathered.point(node), 0.0, tuple(given[:3])))


def _read_link(gathered: Gathered, label: Label, element: Element, keyword: Keyword) -> None:
    """A spring or a dashpot; the first line holds directions, or nothing along the line."""
    keyword.only("ELSET")
    nodes = gathered.resolver.nodes_of(label)
    axial = element.type.name.endswith("A")
    rows = [filled(words) for words in keyword.rows]
    idle = axial and len(rows) == 2 and rows[0] and rows[0][0].isdigit()
    if len(rows) != (1 if axial and not idle else 2):  # the first line of an axial one is empty
        raise keyword.fail(
            f"has {len(rows)} lines of numbers: a constant that changes with frequency, temperature"
            " or field is not read"
            if len(rows) > 2
            else f"has {len(rows)} lines of numbers and needs directions and a constant"
        )
    directions = None
    if not axial:
        if len(rows[0]) != len(nodes):
            raise keyword.fail(f"needs {len(nodes)} directions, not {len(rows[0])}", 0)
        directions = tuple(
            gathered.direction(word, node, keyword, 0)
            for word, node in zip(rows[0], nodes, strict=True)
        )
    constant = keyword.number((rows[-1] or [""])[0], len(rows) - 1)
    if constant < 0.0:
        raise keyword.fail(f"a negative constant ({constant:g}) is not read", len(rows) - 1)
    names = [gathered.point(node) for node in nodes]
    second = names[1] if len(names) > 1 else None
    if keyword.name == "SPRING":
        gathered.links.append(Link(names[0], second, directions, stiffness=constant))
    else:
        gathered.links.append(Link(names[0], second, directions, damping=constant))


_READERS = {
    "MASS": _read_mass,
    "ROTARYINERTIA": _read_rotary,
    "SPRING": _read_link,
    "DASHPOT": _read_link,
}
