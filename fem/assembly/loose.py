"""Directions of points that nothing resists, where a model says that these are to be held."""

from __future__ import annotations

from typing import Any

import numpy as np

from fem.assembly.constraints import BoolArray, Constraints, Numbering
from fem.base.arrays import FloatArray, IntArray
from fem.elements.scatter import SparseArray
from fem.model.structure import StructureModel

SOFT = 1e-8
"""A direction of a node against which the stiffness is this share of the greatest is loose."""


def loose_directions(
    model: StructureModel, numbering: Numbering, constraints: Constraints, stiffness: SparseArray
) -> BoolArray:
    """Which of the free degrees of freedom are to be held, shape (N,).

    Looked at are the stiffness (3, 3) of the translations and of the rotations of every node; for
    each of its eigenvalues that is all but zero the direction nearest to its vector is held.
    """
    held = np.zeros(len(constraints.free), dtype=np.bool_)
    names = model.attached.loose
    if not names:
        return held
    nodes = np.unique(np.concatenate([model.mesh.nodes(name) for name in names]))
    position = np.full(constraints.size + 1, -1)
    position[constraints.free] = np.arange(len(constraints.free))
    blocks = position[numbering.dofs(nodes)].reshape(-1, 3)
    blocks = blocks[(blocks >= 0).any(axis=1)]
    K = _blocks(stiffness, blocks)
    values, vectors = np.linalg.eigh(K)
    there = blocks >= 0
    largest = values[:, -1]
    for row in np.flatnonzero((values <= SOFT * largest[:, None]).any(axis=1)):
        weights = vectors[row] * there[row][:, None]
        for column in np.flatnonzero(values[row] <= SOFT * largest[row]):
            size = np.abs(weights[:, column]) * (there[row] & ~held[blocks[row]])
            if size.max() > 0.5:  # else it is a direction that this node does not have
                held[blocks[row][int(np.argmax(size))]] = True
    return held


def _blocks(stiffness: SparseArray, blocks: IntArray) -> FloatArray:
    """The stiffness (b, 3, 3) of blocks (b, 3) of free degrees of freedom; -1 has none."""
    rows = np.repeat(blocks, 3, axis=1).ravel()
    columns = np.tile(blocks, (1, 3)).ravel()
    picked: Any = stiffness[np.maximum(rows, 0), np.maximum(columns, 0)]
    found = np.asarray(getattr(picked, "toarray", lambda: picked)()).ravel()
    found = np.where((rows >= 0) & (columns >= 0), found, 0.0)
    return np.asarray(found.reshape(-1, 3, 3))
