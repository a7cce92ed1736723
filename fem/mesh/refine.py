"""Meshes of lines, cut into finer ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.mesh.structure_mesh import StructureMesh


def refined(mesh: StructureMesh, times: int) -> StructureMesh:
    """A mesh of lines with every line cut into equal pieces; names of parts and points stay.

    Parameters
    ----------
    mesh : StructureMesh
        A mesh of two-node lines, and vertices.
    times : int
        Pieces of each line.

    Raises
    ------
    ModelError
        For a mesh with other cells.

    Examples
    --------
    >>> import fem
    >>> mesh = fem.frame_mesh({"a": (0, 0), "b": (1, 0)}, [("arm", "a", "b", 2)])
    >>> len(fem.refined(mesh, 3).cells["line"])
    6
    """
    if set(mesh.cells) - {"line", "vertex"}:
        raise ModelError(
            f"{mesh.source}: has cells other than two-node lines; refine it in the mesher"
        )
    points, lines, pieces = _cut(mesh.points, mesh.cells["line"], times)
    groups, cell_types = (
        {
            name: {k: pieces[at].ravel() if k == "line" else at for k, at in group.items()}
            for name, group in named.items()
        }
        for named in (mesh.groups, mesh.element_types)
    )
    cells = {**mesh.cells, "line": lines}
    return replace(mesh, points=points, cells=cells, groups=groups, element_types=cell_types)


def _cut(points: FloatArray, lines: IntArray, times: int) -> tuple[FloatArray, IntArray, IntArray]:
    """Points and lines where each line is cut into equal pieces, and their numbers (e, times)."""
    n, count = len(points), len(lines)
    first, last = (points[lines[:, end]] for end in (0, 1))
    share = np.arange(1, times)[None, :, None] / times
    inner = first[:, None] + share * (last - first)[:, None]
    numbers = n + np.arange(count * (times - 1)).reshape(count, times - 1)
    chain = np.hstack([lines[:, :1], numbers, lines[:, 1:]])
    cut = np.stack([chain[:, :-1], chain[:, 1:]], axis=-1).reshape(-1, 2)
    pieces = np.arange(count * times).reshape(count, times)
    return np.vstack([points, inner.reshape(-1, 3)]), cut, pieces
