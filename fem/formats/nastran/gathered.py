"""What a deck of Nastran comes to: cells, parts, and what is attached to points."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from fem.base.arrays import FloatArray
from fem.formats.content import CellBlock, MeshContent
from fem.formats.ignored import TYPE_PREFIX
from fem.formats.nastran.cards import Card
from fem.formats.nastran.deck import DIRECTIONS, Deck
from fem.mesh.attachments import (
    Attachments,
    LinearEquation,
    Link,
    PointMass,
    PointMatrix,
    Support,
)

Term = tuple[str, str, float]
OWN_NUMBERS = ("R", "CONM", "CMASS")
"""How the names of rigid elements and masses begin, which decks number by themselves."""
GOLDEN = (5**0.5 - 1.0) / 2.0
"""Share of a line by which points without a place follow each other, so that none meets another."""
APART = 1e-3  # of the diagonal: distance of points without a place from others, less if it must be
TINY = 1e-12  # of a unit vector: a component that is rounding


@dataclass
class Gathered:
    """Cells by kind with the groups that they are in, and all that is attached to points.

    Parameters
    ----------
    deck
        The deck.
    cells
        Grid points of the cells of each kind.
    groups, types
        Positions among the cells of a kind, by the name of a part and by that of a card.
    described
        The part of every group, under "made"; or under "refused" why there is none.
    turns
        Grid points that have rotations.
    sets
        Named grid points.
    """

    deck: Deck
    cells: dict[str, list[list[int]]] = field(default_factory=dict)
    groups: dict[str, dict[str, list[int]]] = field(default_factory=dict)
    types: dict[str, dict[str, list[int]]] = field(default_factory=dict)
    described: dict[str, dict[str, object]] = field(default_factory=dict)
    turns: set[int] = field(default_factory=set)
    sets: dict[str, list[int]] = field(default_factory=dict)
    masses: list[PointMass] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)
    equations: list[LinearEquation] = field(default_factory=list)
    supports: list[Support] = field(default_factory=list)
    matrices: list[PointMatrix] = field(default_factory=list)
    elements: dict[tuple[str, int], Card] = field(default_factory=dict)
    joined: set[int] = field(default_factory=set)

    def add_element(self, card: Card) -> int:
        """The number of an element, which may stand once only among those of its sort."""
        number = card.whole(0)
        sort = next((s for s in OWN_NUMBERS if card.name.startswith(s)), "")
        key = (sort, number)
        if key in self.elements:
            raise card.fail(f"element {number} is defined twice")
        self.elements[key] = card
        return number

    def add_cell(self, card: Card, kind: str, grids: Sequence[int], group: str) -> int:
        """A cell of a part; its position among the cells of its kind."""
        for grid in grids:
            self.deck.place(grid, card)
        rows = self.cells.setdefault(kind, [])
        for named, name in ((self.groups, group), (self.types, card.name)):
            named.setdefault(name, {}).setdefault(kind, []).append(len(rows))
        rows.append(list(grids))
        self.joined.update(grids)
        return len(rows) - 1

    def point(self, grid: int, card: Card) -> str:
        """The name of a grid point, "node 17", to which something is attached."""
        name = f"node {grid}"
        if name not in self.sets:
            if grid not in self.deck.scalars:
                self.deck.place(grid, card)
            self.sets[name] = [grid]
        return name

    def has(self, grid: int, component: int) -> bool:
        """Whether a grid point has a direction, 1 to 6."""
        if grid in self.deck.scalars:
            return component == 1
        return component <= 3 or grid in self.turns

    def terms(self, card: Card, grid: int, component: int, factor: float = 1.0) -> list[Term]:
        """A direction of a grid point, in the system of its displacements, as basic ones."""
        name = self.point(grid, card)
        if grid in self.deck.scalars:
            return [(name, "x", factor)]
        self.joined.add(grid)
        first = 0 if component <= 3 else 3
        row = self.deck.axes(grid)[component - 1 - first]
        return [
            (name, DIRECTIONS[first + i], factor * float(row[i]))
            for i in range(3)
            if abs(row[i]) > TINY
        ]

    def add_matrix(self, card: Card, rows: Sequence[Sequence[Term]], **kinds: FloatArray) -> None:
        """Matrices (k, k) between k linear forms of displacements, each given by its terms."""
        columns = list(dict.fromkeys((p, d) for row in rows for p, d, _ in row))
        at = {column: i for i, column in enumerate(columns)}
        T = np.zeros((len(rows), len(columns)))
        for i, row in enumerate(rows):
            for point, direction, factor in row:
                T[i, at[point, direction]] += factor
        made = {kind: (T.T @ matrix @ T).tolist() for kind, matrix in kinds.items() if matrix.any()}
        if made:
            self.matrices.append(
                PointMatrix(columns, **made, origin=f"{card.name} in {card.place}")
            )

    def hold(self, name: str, grids: Iterable[int], directions: Iterable[str]) -> None:
        """A support of basic directions of some grid points."""
        ways = tuple(directions)
        name = f"{name} {' '.join(ways)}"
        self.sets[name] = list(grids)
        self.supports.append(Support(name, ways))

    def attachments(self) -> Attachments:
        """All that is attached; what nothing resists is held unless the deck denies it."""
        only_solids = not (self.turns or self.links or self.matrices or self.equations)
        trusses = any(name in self.types for name in ("CROD", "CONROD", "CTUBE"))
        loose: tuple[str, ...] = ()
        if (trusses or not only_solids) and self._autospc():
            self.sets["all joined grid points"] = sorted(self.joined)
            loose = ("all joined grid points",)
        turning: tuple[str, ...] = ()
        if self.turns:
            self.sets["grid points that turn"] = sorted(self.turns)
            turning = ("grid points that turn",)
        scalars = [n for n in self.deck.scalars if f"node {n}" in self.sets]
        placeless = ("scalar points",) if scalars else ()
        if scalars:
            self.sets["scalar points"] = scalars
        return Attachments(
            self.masses,
            self.links,
            (),
            self.equations,
            self.supports,
            self.matrices,
            turning,
            loose,
            placeless,
        )

    def _autospc(self) -> bool:
        words = [card.text(1) for card in self.deck.of("PARAM") if card.text(0) == "AUTOSPC"]
        chosen = self.deck.choice("AUTOSPC")
        words += [chosen.value] if chosen else []
        return words[-1:] not in (["NO"], ["N"])

    def content(self) -> MeshContent:
        """Points, cells and names."""
        numbers = [*self.deck.grids, *self.deck.scalars]
        place = {number: i for i, number in enumerate(numbers)}
        points = np.array([self.deck.places[number] for number in self.deck.grids])
        points = np.concatenate([points, _elsewhere(points, len(self.deck.scalars))])
        kinds = list(self.cells)
        blocks = [
            CellBlock(kind, np.array([[place[n] for n in c] for c in self.cells[kind]]))
            for kind in kinds
        ]
        named = {**self.groups, **{TYPE_PREFIX + n: g for n, g in self.types.items()}}
        sets = {
            name: [np.array(group.get(kind, []), dtype=np.int64) for kind in kinds]
            for name, group in named.items()
        }
        point_sets = {
            name: np.unique(np.array([place[grid] for grid in grids], dtype=np.int64))
            for name, grids in self.sets.items()
        }
        return MeshContent(points, blocks, point_sets=point_sets, cell_sets=sets)


def _elsewhere(points: FloatArray, count: int) -> FloatArray:
    """Places (count, 3) among others (n, 3) where none of them is, for points without a place."""
    low, high = points.min(axis=0), points.max(axis=0)
    tree, found, step = cKDTree(points), np.empty((0, 3)), 0
    while len(found) < count:
        shares = GOLDEN * np.arange(step + 1, step + 1 + count) % 1.0
        tried = low + shares[:, None] * (high - low)
        far = tree.query(tried)[0] > APART * np.linalg.norm(high - low) / (1 + step)
        found, step = np.concatenate([found, tried[far]])[:count], step + count
    return found
