"""Cells of a file that are left out by name."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from fem.base.arrays import IntArray
from fem.base.errors import ModelError, quoted
from fem.formats.content import CellBlock, MeshContent

UNGROUPED = "ungrouped"
"""Stands for the cells that are in no group."""
TYPE_PREFIX = "abaqus:"
"""Before the names of the cell sets that hold the cells of an element type of a deck."""
SET_PREFIX = "set:"
"""Before the names of groups and point sets where a format has data of cells and points only."""

Mask = NDArray[np.bool_]


def without_cells(
    content: MeshContent, names: Iterable[str], source: str
) -> tuple[MeshContent, list[str]]:
    """A mesh without some of its cells, and a sentence for each name on what was left out.

    Parameters
    ----------
    content
        The mesh of the file.
    names
        Of groups, of kinds of cells such as "quad", of element types of Abaqus such as "S4R", or
        "ungrouped" for the cells that are in no group.
    source
        Where the mesh comes from.

    Raises
    ------
    ModelError
        For a name of which there is no cell.

    Examples
    --------
    >>> content = MeshContent(
    ...     np.eye(3),
    ...     [CellBlock("line", np.array([[0, 1]])), CellBlock("triangle", np.array([[0, 1, 2]]))],
    ... )
    >>> left, said = without_cells(content, ["triangle"], "mesh")
    >>> [block.type for block in left.cells], said
    (['line'], ['1 triangle left out, as "triangle" is to be ignored'])
    """
    keep = [np.ones(len(block.data), dtype=np.bool_) for block in content.cells]
    said = []
    for name in names:
        found = list(_masks(content, name))
        counts: dict[str, int] = {}
        for block, mask in zip(content.cells, found, strict=True):
            if mask.any():
                counts[block.type] = counts.get(block.type, 0) + int(mask.sum())
        if not counts:
            known = [*_known(content), *dict.fromkeys(b.type for b in content.cells), UNGROUPED]
            raise ModelError(
                f"{source}: there is no cell of {name!r} to ignore; there are {quoted(known)}"
            )
        told = ", ".join(f"{count} {kind}" for kind, count in counts.items())
        said.append(f'{told} left out, as "{name}" is to be ignored')
        keep = [kept & ~mask for kept, mask in zip(keep, found, strict=True)]
    return (_kept(content, keep) if said else content), said


def _known(content: MeshContent) -> list[str]:
    """Names of groups and types that hold cells."""
    sets = [name for name, blocks in content.cell_sets.items() if any(len(at) for at in blocks)]
    names = [str(name).removeprefix(TYPE_PREFIX) for name in sets]
    names += [n.removeprefix(SET_PREFIX) for n in content.cell_data if n.startswith(SET_PREFIX)]
    return list(dict.fromkeys(names))


def _masks(content: MeshContent, name: str) -> Iterator[Mask]:
    """For each block which of its cells a name stands for."""
    for index, block in enumerate(content.cells):
        mask = np.full(len(block.data), block.type == name)
        groups = list(_named(content, index))
        for group, cells in groups:
            if group == name:
                mask[cells] = True
        if name == UNGROUPED:
            mask[:] = True
            for group, cells in groups:
                if not group.startswith(TYPE_PREFIX):
                    mask[cells] = False
        yield mask


def _named(content: MeshContent, index: int) -> Iterator[tuple[str, IntArray]]:
    for name, blocks in content.cell_sets.items():
        if index < len(blocks):
            cells = np.asarray(blocks[index], dtype=np.int64)
            yield str(name), cells
            if str(name).startswith(TYPE_PREFIX):
                yield str(name).removeprefix(TYPE_PREFIX), cells
    for name, blocks in content.cell_data.items():
        if name.startswith(SET_PREFIX):
            yield name.removeprefix(SET_PREFIX), np.flatnonzero(np.asarray(blocks[index]).ravel())


def _kept(content: MeshContent, keep: list[Mask]) -> MeshContent:
    """The mesh with the cells that are kept, and their sets and data."""
    stays = [i for i, mask in enumerate(keep) if mask.any()]
    number = [np.cumsum(mask) - 1 for mask in keep]

    def in_block(i: int, cells: IntArray) -> IntArray:
        cells = np.asarray(cells, dtype=np.int64)
        return np.asarray(number[i][cells[keep[i][cells]]], dtype=np.int64)

    return MeshContent(
        content.points,
        [CellBlock(content.cells[i].type, content.cells[i].data[keep[i]]) for i in stays],
        point_data=content.point_data,
        cell_data={
            n: [np.asarray(d[i])[keep[i]] for i in stays] for n, d in content.cell_data.items()
        },
        field_data=content.field_data,
        point_sets=content.point_sets,
        cell_sets={n: [in_block(i, s[i]) for i in stays] for n, s in content.cell_sets.items()},
        unit=content.unit,
    )
