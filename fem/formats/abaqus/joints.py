"""Equations, multi-point constraints, ties, rigid bodies and couplings of a deck."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.spatial import cKDTree

from fem.base.arrays import FloatArray
from fem.formats.abaqus.attached import DIRECTIONS, Gathered
from fem.formats.abaqus.deck import Body, Label
from fem.formats.abaqus.keywords import Keyword, filled
from fem.formats.abaqus.known import PARTS
from fem.formats.abaqus.surfaces import Surfaces
from fem.mesh.attachments import Coupling, LinearEquation
from fem.mesh.element_types import family

TURNING = ("beam", "shell")
APART = 1e-6  # of both surfaces: nodes farther apart are not joined
Term = tuple[Label, str, float]


class Joints:
    """Reads what joins nodes, once all nodes and sets are known."""

    def __init__(
        self, gathered: Gathered, surfaces: Surfaces, places: dict[Label, FloatArray]
    ) -> None:
        self.gathered, self.surfaces, self.places = gathered, surfaces, places
        self.resolver = gathered.resolver
        self.turning = self._turning_nodes()
        self.rotation_nodes: dict[Label, Keyword] = {}

    def _turning_nodes(self) -> set[Label]:
        """Nodes of beams and shells, which have rotations of their own."""
        found: set[Label] = set()
        for body in self.gathered.deck.bodies.values():
            for label, element in body.elements():
                if element.type.kind and family(element.type.name) in TURNING:
                    found.update(self.resolver.nodes_of((body.name, label)))
        return found

    def read(self) -> None:
        """Read all keywords that join."""
        for body in self.gathered.deck.bodies.values():
            keywords = list(body.later())
            for at, keyword in enumerate(keywords):
                if keyword.name in _READERS:
                    if keyword.name != "RIGIDBODY" and not any(map(filled, keyword.rows)):
                        raise keyword.fail("has no data line")
                    _READERS[keyword.name](self, body, keyword)
                elif keyword.name == "COUPLING":
                    following = keywords[at + 1] if at + 1 < len(keywords) else None
                    self._coupling(body, keyword, following)
                elif keyword.name in ("KINEMATIC", "DISTRIBUTING") and (
                    at == 0 or keywords[at - 1].name != "COUPLING"
                ):
                    raise keyword.fail("does not follow a *COUPLING")
        used = {point for e in self.gathered.equations for point in e.points}
        used |= {point for link in self.gathered.links for point in link.points}
        used |= {mass.point for mass in self.gathered.masses}
        used |= {coupling.point for coupling in self.gathered.couplings}
        for node, keyword in self.rotation_nodes.items():
            if self.gathered.point(node) in used:
                raise keyword.fail(
                    f"its ROT NODE {node[1]} has something attached, which is not read"
                )
            del self.gathered.sets[self.gathered.point(node)]

    def _equation(self, terms: Sequence[Term], keyword: Keyword, row: int | None) -> None:
        self.gathered.equations.append(
            LinearEquation(
                [(self.gathered.point(node), way, value) for node, way, value in terms],
                f"{keyword.shown} in {keyword.place(row)}",
            )
        )

    def equations(self, body: Body, keyword: Keyword) -> None:
        """``*EQUATION``: a number of terms, then a node, a direction and a factor for each."""
        keyword.only("INPUT")
        words: list[tuple[str, int]] = [
            (word, row) for row, line in enumerate(keyword.rows) for word in filled(line)
        ]
        at = 0
        while at < len(words):
            word, row = words[at]
            count = keyword.whole(word, row)
            given = [word for word, _ in words[at + 1 : at + 1 + 3 * count]]
            if count < 1 or len(given) < 3 * count:
                raise keyword.fail(f"an equation of {count} terms needs {3 * count} words", row)
            at += 1 + 3 * count
            self._one_equation(body, keyword, row, given)

    def _one_equation(self, body: Body, keyword: Keyword, row: int, given: list[str]) -> None:
        place = keyword.place(row)
        nodes = [
            self.resolver.reference("NSET", body, word, place, keyword.shown)
            for word in given[0::3]
        ]
        for each in self._in_step(keyword, row, nodes):
            ways = [
                self.gathered.direction(word, node, keyword, row)
                for word, node in zip(given[1::3], each, strict=True)
            ]
            factors = [keyword.number(word, row) for word in given[2::3]]
            if not factors[0]:
                raise keyword.fail("the first factor is zero", row)
            self._equation(list(zip(each, ways, factors, strict=True)), keyword, row)

    def _in_step(
        self, keyword: Keyword, row: int, nodes: list[list[Label]]
    ) -> list[tuple[Label, ...]]:
        """Sets taken node by node, single nodes with each of them."""
        count = max(map(len, nodes))
        if any(len(each) not in (1, count) for each in nodes):
            sizes = ", ".join(str(len(each)) for each in nodes)
            raise keyword.fail(f"its sets hold different numbers of nodes ({sizes})", row)
        return [tuple(each[i % len(each)] for each in nodes) for i in range(count)]

    def constraints(self, body: Body, keyword: Keyword) -> None:
        """``*MPC`` of the types BEAM, TIE and PIN."""
        keyword.only()
        for row in range(len(keyword.rows)):
            kind, *names = keyword.words(row)
            if kind.upper() not in ("BEAM", "TIE", "PIN"):
                advice = "of these only BEAM, TIE and PIN are read; write it as *EQUATION"
                self.gathered.deck.refuse(f"*MPC {kind.upper()}", keyword.place(row), advice)
                continue
            if len(names) != 2:
                raise keyword.fail(f"{kind} needs two nodes or sets, not {len(names)}", row)
            place = keyword.place(row)
            pair = [self.resolver.reference("NSET", body, n, place, keyword.shown) for n in names]
            for first, second in self._in_step(keyword, row, pair):
                if kind.upper() == "BEAM":
                    self._rigid([first], second, keyword, row)
                else:
                    self._tied(first, second, keyword, row, kind.upper() == "TIE")

    def _tied(
        self, first: Label, second: Label, keyword: Keyword, row: int | None, turns: bool
    ) -> None:
        """Equal translations, and equal rotations where both nodes have them."""
        both = turns and first in self.turning and second in self.turning
        for number in range(1, 7 if both else 4):
            way = self.gathered.direction(str(number), first, keyword, row)
            self.gathered.direction(str(number), second, keyword, row)
            self._equation([(first, way, 1.0), (second, way, -1.0)], keyword, row)

    def _rigid(
        self,
        nodes: list[Label],
        point: Label,
        keyword: Keyword,
        row: int | None,
        directions: tuple[str, ...] = ("x", "y", "z"),
    ) -> None:
        moved = [node for node in nodes if node != point]
        if not moved:
            raise keyword.fail("joins no node to its reference node", row)
        for node in (*moved, point):
            if node in self.gathered.transformed and len(directions) < 3:
                self.gathered.direction("1", node, keyword, row)
        name = f"nodes of {keyword.shown} in {keyword.place(row)}"
        name = name if name not in self.gathered.sets else f"{name} to {point[1]} and {moved[0][1]}"
        self.gathered.sets[name] = moved
        self.gathered.couplings.append(
            Coupling(self.gathered.point(point), name, "rigid", None, directions)
        )

    def rigid_body(self, body: Body, keyword: Keyword) -> None:
        """``*RIGID BODY``: nodes, or those of elements, move as one with a reference node."""
        keyword.only(
            *("NSET", "ELSET", "REF NODE", "ROT NODE"),
            *("TIE NSET", "PIN NSET", "POSITION"),
        )
        if keyword.parameters.get("POSITION", "INPUT").upper() != "INPUT":
            raise keyword.fail("a reference node that moves to the centre of mass is not read")
        nodes: list[Label] = []
        place = keyword.place()
        for key in ("NSET", "TIE NSET", "PIN NSET"):
            if key in keyword.parameters:
                name = keyword.name_of(key)
                nodes += self.resolver.reference("NSET", body, name, place, keyword.shown)
        pinned = "PIN NSET" in keyword.parameters and self.turning.intersection(nodes)
        if pinned:
            raise keyword.fail("PIN NSET of nodes of beams or shells is not read; use *MPC, PIN")
        if "ELSET" in keyword.parameters:
            name = keyword.name_of("ELSET")
            for element in self.resolver.reference("ELSET", body, name, place, keyword.shown):
                nodes += self.resolver.nodes_of(element)
        reference = keyword.name_of("REF NODE")
        point = self.resolver.node(body, reference, keyword)
        turn = keyword.parameters.get("ROT NODE", "")
        if turn:
            self.rotation_nodes[self.resolver.node(body, turn, keyword)] = keyword
        self._rigid(list(dict.fromkeys(nodes)), point, keyword, None)

    def _coupling(self, body: Body, keyword: Keyword, following: Keyword | None) -> None:
        """``*COUPLING`` with ``*KINEMATIC`` or ``*DISTRIBUTING``."""
        keyword.only("CONSTRAINT NAME", "REF NODE", "SURFACE", "ORIENTATION")
        if following is None or following.name not in ("KINEMATIC", "DISTRIBUTING"):
            raise keyword.fail("is followed by neither *KINEMATIC nor *DISTRIBUTING")
        reference = keyword.name_of("REF NODE")
        point = self.resolver.node(body, reference, keyword)
        surface = keyword.name_of("SURFACE")
        nodes = self.surfaces.nodes(body, surface, keyword)
        numbers = self._numbers(following)
        if "ORIENTATION" in keyword.parameters and not self._in_all_axes(numbers):
            raise keyword.fail("directions of axes of its own (ORIENTATION) are not read")
        if following.name == "KINEMATIC":
            following.only()
            self._kinematic(nodes, point, following, numbers)
            return
        following.only("WEIGHTING METHOD", "COUPLING", "ROTATIONAL COUPLING")
        for key, plain in (("WEIGHTING METHOD", "UNIFORM"), ("COUPLING", "CONTINUUM")):
            if following.parameters.get(key, plain).upper() != plain:
                raise following.fail(f"{key} other than {plain} is not read")
        weighting = "nodes" if self.surfaces.by_nodes(body, surface, keyword) else "area"
        more = self.surfaces.others(body, surface, keyword)
        if weighting == "area" and more:
            raise keyword.fail(f"the nodes of {surface!r} have {more} faces that are not in it")
        self._averaging(nodes, point, following, numbers, weighting)

    @staticmethod
    def _in_all_axes(numbers: set[int]) -> bool:
        """Whether directions are the same in any axes: all translations, all or no rotations."""
        return {1, 2, 3} <= numbers and len(numbers & {4, 5, 6}) in (0, 3)

    def _numbers(self, keyword: Keyword) -> set[int]:
        """Directions from 1 to 6 given in rows of the first and the last; none: all."""
        found: set[int] = set()
        for row, words in enumerate(keyword.rows):
            found.update(_span(keyword, row, filled(words)))
        return found or set(range(1, 7))

    def _kinematic(
        self, nodes: list[Label], point: Label, keyword: Keyword, numbers: set[int]
    ) -> None:
        turning = self.turning.intersection(nodes) - {point}
        if turning and not {4, 5, 6} <= numbers:
            raise keyword.fail(
                "nodes of beams or shells keep rotations of their own, which is not read"
            )
        if turning and not {1, 2, 3} <= numbers:
            raise keyword.fail(
                "nodes of beams or shells follow in rotations but not in all translations, which"
                " is not read"
            )
        ways = tuple(DIRECTIONS[n - 1] for n in sorted(numbers) if n <= 3)
        if not ways:
            raise keyword.fail("no translation follows, which is not read")
        if len(ways) < 3:
            for node in nodes:
                self.gathered.direction("1", node, keyword, None)
        self._rigid(nodes, point, keyword, None, ways)

    def _averaging(
        self, nodes: list[Label], point: Label, keyword: Keyword, numbers: set[int], weighting: str
    ) -> None:
        if not {1, 2, 3} <= numbers:
            raise keyword.fail("a point that follows in some translations only is not read")
        if not {4, 5, 6} <= numbers and point in self.turning:
            raise keyword.fail("a point of a beam or a shell that keeps its rotation is not read")
        name = f"nodes of {keyword.shown} in {keyword.place()}"
        self.gathered.sets[name] = [node for node in nodes if node != point]
        self.gathered.couplings.append(
            Coupling(self.gathered.point(point), name, "averaging", weighting=weighting)
        )

    def kinematic_coupling(self, body: Body, keyword: Keyword) -> None:
        """``*KINEMATIC COUPLING``: rows of a node or set, the first and the last direction."""
        keyword.only("REF NODE")
        reference = keyword.name_of("REF NODE")
        point = self.resolver.node(body, reference, keyword)
        place = keyword.place()
        groups: dict[tuple[int, ...], list[Label]] = {}
        directions: dict[Label, set[int]] = {}
        for row in range(len(keyword.rows)):
            name, *ends = keyword.words(row)
            span = _span(keyword, row, ends)
            for node in self.resolver.reference("NSET", body, name, place, keyword.shown):
                directions.setdefault(node, set()).update(span)
        for node, numbers in directions.items():
            groups.setdefault(tuple(sorted(numbers)), []).append(node)
        for chosen, nodes in groups.items():
            self._kinematic(nodes, point, keyword, set(chosen))

    def distributing_coupling(self, body: Body, keyword: Keyword) -> None:
        """``*DISTRIBUTING COUPLING``: rows of a node or set and its weight."""
        keyword.only("ELSET")
        place = keyword.place()
        name = keyword.name_of("ELSET")
        elements = self.resolver.reference("ELSET", body, name, place, keyword.shown)
        if len(elements) != 1:
            raise keyword.fail(f"{name!r} must hold one element, not {len(elements)}")
        point = self.resolver.nodes_of(elements[0])[0]
        weights: dict[Label, float] = {}
        for row in range(len(keyword.rows)):
            node_or_set, *weight = keyword.words(row)
            value = keyword.number(weight[0], row) if weight else 1.0
            for node in self.resolver.reference("NSET", body, node_or_set, place, keyword.shown):
                weights[node] = value
        if len(set(weights.values())) != 1 or not min(weights.values()) > 0.0:
            raise keyword.fail("weights that differ from node to node are not read")
        self._averaging(list(weights), point, keyword, set(range(1, 7)), "nodes")

    def tie(self, body: Body, keyword: Keyword) -> None:
        """``*TIE`` of surfaces whose nodes are at the same places."""
        keyword.only("NAME", "POSITION TOLERANCE", "ADJUST", "TYPE", "NO ROTATION", "NO THICKNESS")
        for row, words in enumerate(keyword.rows):
            names = filled(words)
            if len(names) != 2:
                raise keyword.fail("needs a dependent and an independent surface", row)
            slaves, masters = (self.surfaces.nodes(body, name, keyword) for name in names)
            self._tie_pairs(slaves, masters, keyword, row)

    def _tie_pairs(
        self, slaves: list[Label], masters: list[Label], keyword: Keyword, row: int
    ) -> None:
        there = np.array([self.places[node] for node in masters])
        here = np.array([self.places[node] for node in slaves])
        size = float(np.ptp(np.vstack([there, here]), axis=0).max())
        distance, nearest = cKDTree(there).query(here)
        for slave, off, at in zip(slaves, np.asarray(distance), np.asarray(nearest), strict=True):
            master = masters[int(at)]
            if off > APART * size:
                advice = f"surfaces whose nodes are at other places are not joined; {PARTS}"
                self.gathered.deck.refuse("*TIE", keyword.place(row), advice)
                return
            if master != slave:
                turns = "NO ROTATION" not in keyword.parameters
                self._tied(slave, master, keyword, row, turns)


def _span(keyword: Keyword, row: int, words: list[str]) -> range:
    """Directions from 1 to 6 from the first to the last that a row gives; none: all."""
    given = [keyword.whole(word, row) for word in words]
    first, last = [*given, given[0]][:2] if given else (1, 6)
    if len(given) > 2 or not 1 <= first <= last <= 6:
        raise keyword.fail("needs the first and the last direction, from 1 to 6", row)
    return range(first, last + 1)


_READERS: dict[str, Callable[[Joints, Body, Keyword], None]] = {
    "EQUATION": Joints.equations,
    "MPC": Joints.constraints,
    "TIE": Joints.tie,
    "RIGIDBODY": Joints.rigid_body,
    "KINEMATICCOUPLING": Joints.kinematic_coupling,
    "DISTRIBUTINGCOUPLING": Joints.distributing_coupling,
}
