"""Line meshes of frames: points, two-node lines, named parts and named points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError, quoted
from fem.mesh.attachments import Attachments, LeftOut

NO_LENGTH, LEAST_LENGTH = 1e-12, 1e-50  # of the frame, and in m: so short, a bar has no direction


Number = TypeVar("Number", np.float64, np.int64)


@dataclass(frozen=True, eq=False)
class FrameMesh:
    """A mesh of straight two-node lines.

    Parameters
    ----------
    points
        Coordinates in m, shape (n, 3).
    lines
        Node indices of the two ends of every element, shape (e, 2).
    parts
        Element indices by name. Groups may overlap here; a `FrameModel` picks those that it uses.
    point_sets
        Node indices by name. A set that a model uses as a point holds one node.
    source
        Where the mesh comes from; error texts begin with it.
    attachments
        Masses, springs, couplings and equations that the file holds beside its cells.
    element_types
        Elements by the type that the file gives them, such as "B31" or "S8R".
    described
        Material and section of parts, by the name of the part, as far as the file gives them.
    left_out
        What the file holds and the mesh, by intention, does not.
    notes
        What was left out on request, a sentence each.
    unit
        Unit of lengths that the file states, whatever the coordinates are taken to be in.

    Raises
    ------
    ModelError
        For an empty mesh, coordinates that are not finite, indices out of range, a node on no
        element, an element of zero length or one that appears twice.

    Examples
    --------
    >>> mesh = FrameMesh([[0, 0, 0], [1, 0, 0]], [[0, 1]], {"rod": [0]}, {"tip": [1]})
    >>> mesh.lengths
    array([1.])
    >>> mesh.node("tip")
    1
    """

    points: FloatArray
    lines: IntArray
    parts: Mapping[str, IntArray] = field(default_factory=dict)
    point_sets: Mapping[str, IntArray] = field(default_factory=dict)
    source: str = "mesh"
    attachments: Attachments = field(default_factory=Attachments)
    element_types: Mapping[str, IntArray] = field(default_factory=dict)
    described: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    left_out: Sequence[LeftOut] = ()
    notes: Sequence[str] = ()
    unit: str = ""

    def __post_init__(self) -> None:
        points = numbers(f"{self.source}: points", self.points, np.float64)
        lines = numbers(f"{self.source}: lines", self.lines, np.int64)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "lines", lines)
        object.__setattr__(self, "parts", index_sets(f"{self.source}: part", self.parts))
        sets = index_sets(f"{self.source}: point", self.point_sets)
        object.__setattr__(self, "point_sets", sets)
        types = index_sets(f"{self.source}: type", self.element_types)
        object.__setattr__(self, "element_types", types)
        self._check_arrays()
        self._check_elements()

    @property
    def spans(self) -> FloatArray:
        """Vectors in m from the first to the second end of every element, shape (e, 3)."""
        return self.points[self.lines[:, 1]] - self.points[self.lines[:, 0]]

    @property
    def lengths(self) -> FloatArray:
        """Element lengths in m, shape (e,)."""
        return np.asarray(np.linalg.norm(self.spans, axis=1), dtype=np.float64)

    def part(self, name: str) -> IntArray:
        """Element indices of a part; a `ModelError` lists the parts if the name is unknown."""
        if name not in self.parts:
            raise ModelError(
                f"{self.source}: there is no part {name!r}; there are {quoted(self.parts)}"
            )
        return self.parts[name]

    def nodes(self, name: str) -> IntArray:
        """Indices of the nodes of a point set; a `ModelError` if there is none or it is empty."""
        if name not in self.point_sets:
            raise ModelError(
                f"{self.source}: there is no point {name!r}; there are {quoted(self.point_sets)}"
            )
        if len(self.point_sets[name]) == 0:
            raise ModelError(f"{self.source}: point set {name!r} holds no node of the frame")
        return self.point_sets[name]

    def node(self, name: str) -> int:
        """Index of the one node of a named point.

        Raises
        ------
        ModelError
            If there is no point set of the name, or it does not hold exactly one node.
        """
        nodes = self.nodes(name)
        if len(nodes) != 1:
            raise ModelError(
                f"{self.source}: point {name!r} must hold exactly one node of the frame"
                f" but holds {len(nodes)}"
            )
        return int(nodes[0])

    def with_points(self, points: npt.ArrayLike) -> FrameMesh:
        """The same elements and names on other coordinates, shape (n, 3) in m.

        Examples
        --------
        >>> mesh = frame_mesh({"a": (0, 0), "b": (1, 0)}, [("rod", "a", "b", 2)])
        >>> float(mesh.with_points(2 * mesh.points).lengths.sum())
        2.0
        """
        return replace(self, points=np.asarray(points, dtype=np.float64))

    def with_point_sets(self, sets: Mapping[str, npt.ArrayLike]) -> FrameMesh:
        """The same mesh with further point sets, or others of the same names.

        Examples
        --------
        >>> mesh = frame_mesh({"a": (0, 0), "b": (1, 0)}, [("rod", "a", "b", 2)])
        >>> mesh.with_point_sets({"middle": [2]}).node("middle")
        2
        """
        return replace(self, point_sets={**self.point_sets, **sets})  # type: ignore[dict-item]

    def _check_arrays(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise ModelError(
                f"{self.source}: points must have shape (n, 3), not {self.points.shape}"
            )
        if len(self.points) == 0 or self.lines.size == 0:
            raise ModelError(f"{self.source}: the mesh is empty (no line elements)")
        if self.lines.ndim != 2 or self.lines.shape[1] != 2:
            raise ModelError(f"{self.source}: lines must have shape (e, 2), not {self.lines.shape}")
        bad = np.flatnonzero(~np.isfinite(self.points).all(axis=1))
        if len(bad):
            raise ModelError(
                f"{self.source}: the coordinates of node {bad[0]} are not finite numbers"
            )
        self._check_range("lines", self.lines, len(self.points))
        for name, elements in self.parts.items():
            self._check_range(f"part {name!r}", elements, len(self.lines))
        for name, nodes in self.point_sets.items():
            self._check_range(f"point {name!r}", nodes, len(self.points))

    def _check_range(self, what: str, indices: IntArray, count: int) -> None:
        if indices.size and not (indices.min() >= 0 and indices.max() < count):
            raise ModelError(f"{self.source}: {what} has an index outside 0 to {count - 1}")

    def _check_elements(self) -> None:
        size = float(np.ptp(self.points, axis=0).max())
        short = np.flatnonzero(self.lengths <= max(NO_LENGTH * size, LEAST_LENGTH))
        if len(short):
            raise ModelError(f"{self.source}: element {short[0]} has zero length")
        _, first, count = np.unique(
            np.sort(self.lines, axis=1), axis=0, return_index=True, return_counts=True
        )
        if count.max() > 1:
            twice = first[np.argmax(count > 1)]
            raise ModelError(
                f"{self.source}: element {twice} appears twice between the same two nodes"
            )
        loose = np.setdiff1d(np.arange(len(self.points)), self.lines)
        if len(loose):
            raise ModelError(f"{self.source}: node {loose[0]} is on no line element")


def frame_mesh(
    points: Mapping[str, Sequence[float]],
    members: Sequence[tuple[str, str, str, int]],
    source: str = "frame_mesh",
) -> FrameMesh:
    """Build a mesh of straight members between named points.

    Parameters
    ----------
    points
        Coordinates (x, y) or (x, y, z) in m by name; each becomes a point set of one node.
    members
        (part, from point, to point, number of elements); several may belong to one part.
    source
        Name of the mesh in error texts.

    Raises
    ------
    ModelError
        For an unknown point, a number of elements below one, and whatever `FrameMesh` refuses.

    Examples
    --------
    >>> mesh = frame_mesh(
    ...     {"corner": (0, 0), "middle": (0.66, 0), "foot": (0, -0.113)},
    ...     [("beam", "corner", "middle", 4), ("leaf", "corner", "foot", 2)],
    ... )
    >>> mesh.points.shape, {name: len(part) for name, part in mesh.parts.items()}
    ((7, 3), {'beam': 4, 'leaf': 2})
    """
    ends = {name: _coordinates(source, name, xyz) for name, xyz in points.items()}
    index = {name: i for i, name in enumerate(ends)}
    nodes = list(ends.values())
    lines: list[tuple[int, int]] = []
    parts: dict[str, list[int]] = {}
    for part, start, stop, count in members:
        for name in (start, stop):
            if name not in ends:
                raise ModelError(f"{source}: a member of part {part!r} ends at no point {name!r}")
        if not isinstance(count, int | np.integer) or count < 1:
            raise ModelError(f"{source}: a member of part {part!r} has {count!r} elements")
        steps = np.arange(1, count)[:, None] / count
        inner = ends[start] + steps * (ends[stop] - ends[start])
        chain = [index[start], *range(len(nodes), len(nodes) + count - 1), index[stop]]
        parts.setdefault(part, []).extend(range(len(lines), len(lines) + count))
        lines.extend(pairwise(chain))
        nodes.extend(inner)
    return FrameMesh(
        np.array(nodes, dtype=np.float64).reshape(-1, 3),
        np.array(lines, dtype=np.int64).reshape(-1, 2),
        {name: np.array(elements, dtype=np.int64) for name, elements in parts.items()},
        {name: np.array([i], dtype=np.int64) for name, i in index.items()},
        source,
    )


def _coordinates(source: str, name: str, xyz: Sequence[float]) -> FloatArray:
    if len(xyz) not in (2, 3):
        raise ModelError(f"{source}: point {name!r} needs two or three coordinates, not {len(xyz)}")
    return numbers(f"{source}: coordinates of point {name!r}", [*xyz, 0.0][:3], np.float64)


def numbers(what: str, values: npt.ArrayLike, dtype: type[Number]) -> npt.NDArray[Number]:
    """A copy that cannot be written to, or a ModelError that says what holds no numbers."""
    try:
        array = np.array(values, dtype=dtype)
    except (TypeError, ValueError):
        raise ModelError(f"{what} must be numbers, as many in each row") from None
    array.setflags(write=False)
    return array


def index_sets(what: str, sets: Mapping[str, npt.ArrayLike]) -> dict[str, IntArray]:
    found = {}
    for name, indices in sets.items():
        owner = f"{what} {name!r}"
        found[str(name)] = numbers(owner, np.unique(numbers(owner, indices, np.int64)), np.int64)
    return found
