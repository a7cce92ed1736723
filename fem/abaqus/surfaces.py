"""Surfaces as sets of nodes: faces of elements, or nodes."""

from __future__ import annotations

from collections import Counter

from fem.abaqus.deck import Body, Label
from fem.abaqus.keywords import Keyword, filled
from fem.abaqus.sets import Resolver
from fem.abaqus.types import faces
from fem.cells import KINDS


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
        self._free: set[frozenset[Label]] | None = None

    def nodes(self, body: Body, name: str, keyword: Keyword) -> list[Label]:
        """Nodes of a surface by name, of a body or of an instance (INSTANCE.NAME)."""
        return self.of(*self._found(body, name, keyword))

    def by_nodes(self, body: Body, name: str, keyword: Keyword) -> bool:
        """Whether a surface by name is of nodes and not of faces."""
        _, surface = self._found(body, name, keyword)
        return surface.parameters.get("TYPE", "").upper() == "NODE"

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
            self._known[key] = list(dict.fromkeys(self._read(body, keyword)))
        return self._known[key]

    def _read(self, body: Body, keyword: Keyword) -> list[Label]:
        keyword.only("NAME", "TYPE", "INTERNAL", "INSTANCE")
        kind = keyword.parameters.get("TYPE", "ELEMENT").upper()
        if kind not in ("ELEMENT", "NODE"):
            raise keyword.fail(f"a surface of type {kind} is not read")
        if "INSTANCE" in keyword.parameters:
            body = self.resolver.body(keyword.parameters["INSTANCE"], keyword.place())
        nodes: list[Label] = []
        for row in range(len(keyword.rows)):
            words = filled(keyword.rows[row])
            if kind == "NODE":
                place = keyword.place(row)
                nodes += self.resolver.reference("NSET", body, words[0], place, "*SURFACE")
                continue
            place = keyword.place(row)
            for element in self.resolver.reference("ELSET", body, words[0], place, "*SURFACE"):
                nodes += self._face(keyword, row, element, words[1].upper() if words[1:] else "")
        return nodes

    def _face(self, keyword: Keyword, row: int, element: Label, face: str) -> list[Label]:
        nodes = self.resolver.nodes_of(element)
        element_type = self.resolver.deck.bodies[element[0].upper()].element(element[1]).type
        kind = element_type.kind
        if kind is None:
            raise keyword.fail(f"element {element[1]} is a point and has no face", row)
        if KINDS[kind].dimension == 1:
            return nodes
        plane = kind.startswith(("triangle", "quad"))
        shell = plane and not element_type.name.startswith("CP")
        if shell and face in ("", "SPOS", "SNEG", "S1", "S2"):
            return nodes
        local = faces(kind)
        if face == "":
            return [
                nodes[i]
                for each in local
                if self._is_free(frozenset(nodes[i] for i in each))
                for i in each
            ]
        number = face[1:] if face[:1] in ("S", "E") else face
        first = 3 if shell and face[:1] == "S" else 1  # CalculiX: S3 to S6 are edges of shells
        if not number.isdigit() or not 0 <= int(number) - first < len(local):
            raise keyword.fail(f"face {face!r} of element {element[1]} ({kind}) is not known", row)
        return [nodes[i] for i in local[int(number) - first]]

    def _is_free(self, face: frozenset[Label]) -> bool:
        """Whether no second element of the deck has a face."""
        if self._free is None:
            count: Counter[frozenset[Label]] = Counter()
            for body in self.resolver.deck.bodies.values():
                for label, element in body.elements():
                    kind = element.type.kind
                    if kind is not None and KINDS[kind].dimension > 1:
                        nodes = self.resolver.nodes_of((body.name, label))
                        for each in faces(kind):
                            count[frozenset(nodes[i] for i in each)] += 1
            self._free = {nodes for nodes, times in count.items() if times == 1}
        return face in self._free
