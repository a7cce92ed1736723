"""Surfaces as sets of nodes: faces of elements, or nodes.

A model takes for a face all outer faces whose nodes are in a set, so those are counted that a
surface does not name although it has their nodes.
"""

from __future__ import annotations

from collections import Counter

from fem.formats.abaqus.deck import Body, Label
from fem.formats.abaqus.keywords import Keyword
from fem.formats.abaqus.sets import Resolver
from fem.formats.abaqus.types import ElementType, faces
from fem.mesh.cells import KINDS


class Surfaces:
    """Finds the nodes of the surfaces of a deck."""

    def __init__(self, resolver: Resolver) -> None:
        self.resolver = resolver
        self.named: dict[tuple[str, str], Keyword] = {}
        for body in resolver.deck.bodies.values():
            for keyword in body.later():
                if keyword.name == "SURFACE":
                    key = (body.name, keyword.name_of("NAME").upper())
                    if key in self.named:
                        first = self.named[key].place()
                        raise keyword.fail(f"{key[1]!r} is defined twice, first in {first}")
                    self.named[key] = keyword
        self._known: dict[tuple[str, str], list[Label]] = {}
        self._faces: dict[tuple[str, str], set[frozenset[Label]]] = {}
        self._free: set[frozenset[Label]] | None = None

    def nodes(self, body: Body, name: str, keyword: Keyword) -> list[Label]:
        """Nodes of a surface by name, of a body or of an instance (INSTANCE.NAME)."""
        found = self.of(*self._found(body, name, keyword))
        if not found:
            raise keyword.fail(f"names the surface {name!r}, which holds no node")
        return found

    def by_nodes(self, body: Body, name: str, keyword: Keyword) -> bool:
        """Whether a surface by name is of nodes and not of faces."""
        _, surface = self._found(body, name, keyword)
        return surface.parameters.get("TYPE", "").upper() == "NODE"

    def others(self, body: Body, name: str, keyword: Keyword) -> int:
        """How many outer faces have their nodes in a surface of faces without being named in it."""
        return self._others(*self._found(body, name, keyword))

    def notes(self) -> list[str]:
        """A sentence on each surface that has the nodes of faces that it does not name."""
        said = []
        for (owner, _), keyword in self.named.items():
            more = self._others(self.resolver.deck.bodies[owner.upper()], keyword)
            if more:
                name = keyword.name_of("NAME")
                said.append(
                    f"the nodes of the surface {name!r} in {keyword.place()} have {more} outer"
                    " faces that it does not name; what acts on it as a face acts on them, too"
                )
        return said

    def _others(self, body: Body, surface: Keyword) -> int:
        nodes = set(self.of(body, surface))
        named = self._faces[body.name, surface.name_of("NAME").upper()]
        if not named:
            return 0
        return sum(face <= nodes and face not in named for face in self._outer())

    def _found(self, body: Body, name: str, keyword: Keyword) -> tuple[Body, Keyword]:
        """The body that a surface is of, and the keyword that defines it."""
        owner = body
        if (body.name, name.upper()) not in self.named and "." in name:
            first, _, rest = name.partition(".")
            owner, name = self.resolver.body(first, keyword.place()), rest
        found = self.named.get((owner.name, name.upper()))
        if found is None:
            raise keyword.fail(f"names the surface {name!r}, which is not defined")
        return owner, found

    def of(self, body: Body, keyword: Keyword) -> list[Label]:
        """Nodes of the surface that a keyword defines."""
        key = (body.name, keyword.name_of("NAME").upper())
        if key not in self._known:
            pieces = self._read(body, keyword)
            self._known[key] = list(dict.fromkeys(node for piece in pieces for node in piece))
            by_nodes = keyword.parameters.get("TYPE", "").upper() == "NODE"
            self._faces[key] = set() if by_nodes else set(map(frozenset, pieces))
        return self._known[key]

    def _read(self, body: Body, keyword: Keyword) -> list[list[Label]]:
        """Nodes of the faces, or of the sets, that a surface is made of."""
        keyword.only("NAME", "TYPE", "INTERNAL", "INSTANCE")
        kind = keyword.parameters.get("TYPE", "ELEMENT").upper()
        if kind not in ("ELEMENT", "NODE"):
            raise keyword.fail(f"a surface of type {kind} is not read")
        if not keyword.rows:
            name = keyword.name_of("NAME")
            reason = "it has no data line, so no face and no node"
            self.resolver.deck.leave_out(f"*SURFACE {name}", keyword.place(), reason)
        if "INSTANCE" in keyword.parameters:
            body = self.resolver.body(keyword.parameters["INSTANCE"], keyword.place())
        pieces: list[list[Label]] = []
        for row in range(len(keyword.rows)):
            name, *face = keyword.words(row)
            place = keyword.place(row)
            if kind == "NODE":
                pieces.append(self.resolver.reference("NSET", body, name, place, "*SURFACE"))
                continue
            for element in self.resolver.reference("ELSET", body, name, place, "*SURFACE"):
                pieces += self._of_element(keyword, row, element, face[0].upper() if face else "")
        return pieces

    def _of_element(
        self, keyword: Keyword, row: int, element: Label, face: str
    ) -> list[list[Label]]:
        nodes = self.resolver.nodes_of(element)
        element_type = self.resolver.deck.bodies[element[0].upper()].element(element[1]).type
        kind = element_type.kind
        if kind is None:
            raise keyword.fail(f"element {element[1]} is a point and has no face", row)
        shell = _is_shell(element_type)
        if KINDS[kind].dimension == 1 or (shell and face in ("", "SPOS", "SNEG", "S1", "S2")):
            return [nodes]
        local = faces(kind)
        if face == "":
            outer = self._outer()
            pieces = [[nodes[i] for i in each] for each in local]
            return [piece for piece in pieces if frozenset(piece) in outer]
        number = face[1:] if face[:1] in ("S", "E") else face
        first = 3 if shell and face[:1] == "S" else 1  # CalculiX: S3 to S6 are edges of shells
        if not number.isdigit() or not 0 <= int(number) - first < len(local):
            raise keyword.fail(f"face {face!r} of element {element[1]} ({kind}) is not known", row)
        return [[nodes[i] for i in local[int(number) - first]]]

    def _outer(self) -> set[frozenset[Label]]:
        """The faces of solids that no second one has, and shells."""
        if self._free is None:
            count: Counter[frozenset[Label]] = Counter()
            shells: set[frozenset[Label]] = set()
            for body in self.resolver.deck.bodies.values():
                for label, element in body.elements():
                    kind = element.type.kind
                    if kind is None or KINDS[kind].dimension == 1:
                        continue
                    nodes = self.resolver.nodes_of((body.name, label))
                    if _is_shell(element.type):
                        shells.add(frozenset(nodes))
                    else:
                        count.update(frozenset(nodes[i] for i in each) for each in faces(kind))
            self._free = shells | {nodes for nodes, times in count.items() if times == 1}
        return self._free


def _is_shell(element_type: ElementType) -> bool:
    plane = str(element_type.kind).startswith(("triangle", "quad"))
    return plane and not element_type.name.startswith("CP")
