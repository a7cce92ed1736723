"""Meshes of straight members between named points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.mesh.checked_arrays import numbers
from fem.mesh.structure_mesh import StructureMesh


def frame_mesh(
    points: Mapping[str, Sequence[float]],
    members: Sequence[tuple[str, str, str, int]],
    source: str = "frame_mesh",
) -> StructureMesh:
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
        For an unknown point, a number of elements below one, and whatever `StructureMesh` refuses.

    Examples
    --------
    >>> mesh = frame_mesh(
    ...     {"corner": (0, 0), "middle": (0.66, 0), "foot": (0, -0.113)},
    ...     [("beam", "corner", "middle", 4), ("leaf", "corner", "foot", 2)],
    ... )
    >>> mesh.points.shape, {name: len(part["line"]) for name, part in mesh.groups.items()}
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
    return StructureMesh(
        np.array(nodes, dtype=np.float64).reshape(-1, 3),
        {"line": np.array(lines, dtype=np.int64).reshape(-1, 2)},
        {name: {"line": np.array(cells, dtype=np.int64)} for name, cells in parts.items()},
        {name: np.array([i], dtype=np.int64) for name, i in index.items()},
        source,
    )


def _coordinates(source: str, name: str, xyz: Sequence[float]) -> FloatArray:
    if len(xyz) not in (2, 3):
        raise ModelError(f"{source}: point {name!r} needs two or three coordinates, not {len(xyz)}")
    return numbers(f"{source}: coordinates of point {name!r}", [*xyz, 0.0][:3], np.float64)
