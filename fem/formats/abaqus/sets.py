"""Sets of nodes and elements, by number, by range and by the names of other sets."""

from __future__ import annotations

from collections.abc import Iterator

from fem.formats.abaqus.deck import Body, Deck, Label, Member, NamedSet, Scope
from fem.formats.abaqus.keywords import Keyword, filled

OTHER = {"NSET": "node", "ELSET": "element"}


def read_set(deck: Deck, scope: Scope, keyword: Keyword) -> None:
    """``*NSET`` and ``*ELSET``; the sets that they name may be defined later."""
    kind = keyword.name
    also = ("ELSET",) if kind == "NSET" else ()
    keyword.only(kind, "NAME", "GENERATE", "UNSORTED", "INTERNAL", "INSTANCE", "INPUT", *also)
    name = keyword.name_of(kind, "NAME")
    instance = keyword.parameters.get("INSTANCE", "")
    members = []
    if "GENERATE" in keyword.parameters:
        members = list(_ranges(deck, keyword, instance))
    else:
        for row, words in enumerate(keyword.rows):
            place = keyword.place(row)
            for word in (word.strip("\"'") for word in words if word):
                item = int(word) if word.isdigit() else word
                members.append(Member(item, instance, place))
    found = scope.grow(kind, name, members)
    found.keyword = found.keyword or keyword
    if kind == "NSET" and "ELSET" in keyword.parameters:
        found.elements.append(Member(keyword.parameters["ELSET"], instance, keyword.place()))


def _ranges(deck: Deck, keyword: Keyword, instance: str) -> Iterator[Member]:
    """Rows of first, last and step; a row of three may stand for several."""
    for row, words in enumerate(keyword.rows):
        given = [keyword.whole(word, row) for word in filled(words)]
        if len(given) not in (1, 2, 3):
            raise keyword.fail("needs the first number, the last one and a step", row)
        first, last, step = [*given, given[0], 1][:3] if len(given) == 1 else [*given, 1][:3]
        said = f"set {keyword.name_of(keyword.name, 'NAME')!r} cannot run from {first} to {last}"
        said += f" by {step}"
        if step < 1:
            raise keyword.fail(said, row)
        deck.count_generated(keyword, row, max(0, last - first) // step, said)
        yield Member(range(first, last + 1, step), instance, keyword.place(row))


def labels_now(scope: Scope, kind: str, keyword: Keyword, row: int | None, word: str) -> list[int]:
    """Numbers of a set, or the one number, as they are known where a keyword makes others."""
    if word.isdigit():
        return [int(word)]
    known: dict[str, list[int]] = {}

    def of(name: str, above: tuple[str, ...]) -> list[int]:
        key = name.upper()
        if key in above or key not in scope.sets[kind]:
            raise keyword.fail(f"names the set {name!r}, which is not defined before it", row)
        if key not in known:
            found: list[int] = []
            for item, _, _ in scope.sets[kind][key].members:
                if isinstance(item, str):
                    found += of(item, (*above, key))
                else:
                    found += [item] if isinstance(item, int) else list(item)
            unique = list(dict.fromkeys(found))
            known[key] = unique if scope.sets[kind][key].unsorted else sorted(unique)
        return known[key]

    return of(word, ())


class Resolver:
    """Finds what sets and references stand for, once the whole deck is known."""

    def __init__(self, deck: Deck) -> None:
        self.deck = deck
        self._known: dict[tuple[str, str, str], list[Label]] = {}
        self._open: set[tuple[str, str, str]] = set()

    def labels(self, kind: str, body: Body, name: str, place: str) -> list[Label]:
        """All nodes or elements of a set of a body, each once, sorted unless it is UNSORTED."""
        found = body.set_of(kind, name)
        if found is None:
            raise self._unknown(kind, name, place)
        key = (kind, body.name, found.name.upper())
        if key in self._open:
            raise self.deck.fail(f"{place}: the set {name!r} holds itself")
        if key not in self._known:
            self._open.add(key)
            self._known[key] = self._members(kind, body, found)
            self._open.discard(key)
        return self._known[key]

    def _members(self, kind: str, body: Body, named: NamedSet) -> list[Label]:
        labels: dict[Label, None] = {}
        for member in named.members:
            owner = self.body(member.instance, member.place) if member.instance else body
            if isinstance(member.item, range):
                # a range is of those numbers that there are
                own = [(owner.name, n) for n in member.item if owner.has(kind, n)]
                if not own and not any(owner.ignores(kind, n) for n in member.item):
                    last = f"{member.item.start} to {member.item.stop - 1}"
                    raise self.deck.fail(
                        f"{member.place}: set {named.name!r} runs from {last}, but no"
                        f" {OTHER[kind]} has a number of these"
                    )
                labels.update(dict.fromkeys(own))
            else:
                what = f"set {named.name!r}"
                word = str(member.item)
                labels.update(dict.fromkeys(self.reference(kind, owner, word, member.place, what)))
        for member in named.elements:
            owner = self.body(member.instance, member.place) if member.instance else body
            for element in self.reference("ELSET", owner, str(member.item), member.place, "*NSET"):
                labels.update(dict.fromkeys(self.nodes_of(element)))
        return list(labels) if named.unsorted else sorted(labels)

    def reference(
        self, kind: str, body: Body, word: str, place: str, what: str = ""
    ) -> list[Label]:
        """What a word stands for: a number, a set, or either of an instance (INSTANCE.NAME)."""
        word = word.strip("\"'")
        if word.isdigit():
            if body.ignores(kind, int(word)):
                return []
            if not body.has(kind, int(word)):
                raise self.deck.fail(
                    f"{place}: {what} holds {OTHER[kind]} {word}, which is not defined"
                )
            return [(body.name, int(word))]
        if body.set_of(kind, word) is None and "." in word:
            for end in (i for i, letter in enumerate(word) if letter == "."):
                owner = self.deck.bodies.get(word[:end].strip("\"'").upper())
                if owner is not None:
                    return self.reference(kind, owner, word[end + 1 :], place, what)
        return self.labels(kind, body, word, place)

    def body(self, name: str, place: str) -> Body:
        """An instance by name."""
        found = self.deck.bodies.get(name.upper())
        if found is None:
            raise self.deck.fail(f"{place}: names the instance {name!r}, which is not defined")
        return found

    def node(self, body: Body, word: str, keyword: Keyword) -> Label:
        """The one node that a word stands for."""
        found = self.reference("NSET", body, word, keyword.place(), keyword.shown)
        if len(found) != 1:
            raise keyword.fail(f"{word!r} holds {len(found)} nodes, and must be one")
        return found[0]

    def nodes_of(self, element: Label) -> list[Label]:
        """The nodes of an element."""
        body = self.deck.bodies[element[0].upper()]
        found = body.element(element[1])
        labels = []
        for node in found.nodes:
            if isinstance(node, int):
                if not body.has("NSET", node):
                    raise self.deck.fail(
                        f"{found.place}: element {element[1]} ends at node {node}, which is not"
                        " defined"
                    )
                labels.append((body.name, node))
            else:
                what = f"element {element[1]}"
                labels += self.reference("NSET", body, node, found.place, what)
        return labels

    def _unknown(self, kind: str, name: str, place: str) -> Exception:
        return self.deck.fail(
            f"{place}: names the {OTHER[kind]} set {name!r}, which is not defined anywhere in the"
            " file"
        )
