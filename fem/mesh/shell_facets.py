"""Facets of three or four nodes, into which cells of shells are cut."""

from __future__ import annotations

import numpy as np

from fem.base.arrays import IntArray
from fem.mesh.shell_centres import OPEN

FACETS: dict[str, dict[str, tuple[tuple[int, ...], ...]]] = {
    "triangle": {"triangle": ((0, 1, 2),)},
    "triangle6": {"triangle": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))},
    "quad": {"quad": ((0, 1, 2, 3),)},
    "quad9": {"quad": ((0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3))},
}
"""How a cell of a kind is cut into facets with three or four nodes."""


def facets_of(kinds: dict[str, IntArray]) -> dict[str, IntArray]:
    """Cells (e, b) by kind, cut into facets of three or four nodes.

    Examples
    --------
    >>> facets_of({"quad9": np.arange(9)[None]})["quad"][0]
    array([0, 4, 8, 7])
    """
    found: dict[str, list[IntArray]] = {}
    for kind, cells in kinds.items():
        for facet, local in FACETS[kind].items():
            pieces = cells[:, np.array(local)].reshape(-1, len(local[0]))
            found.setdefault(facet, []).append(pieces)
    return {kind: np.concatenate(blocks) for kind, blocks in found.items()}


def shell_kinds() -> set[str]:
    """Names of the kinds of cells of which a shell may be; those of eight nodes get a ninth.

    Examples
    --------
    >>> sorted(shell_kinds())
    ['quad', 'quad8', 'quad9', 'triangle', 'triangle6']
    """
    return {OPEN, *FACETS}
