"""A node in the middle of cells of shells that have none: eight-node cells become nine-node ones.

Four quadrilaterals around a middle node bend in their plane without locking; the four triangles and
one quadrilateral into which eight nodes can be cut do not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from fem.base.arrays import IntArray
from fem.mesh.cells import KINDS
from fem.mesh.structure_mesh import StructureMesh

OPEN, FILLED = "quad8", "quad9"


def with_centres(mesh: StructureMesh, names: list[str]) -> StructureMesh:
    """The mesh in which all ``quad8`` of some groups are ``quad9``.

    The new nodes come after those of the mesh, each where the functions of its eight nodes have the
    middle of the cell. A point set that holds all eight holds the ninth, too.

    Parameters
    ----------
    mesh
        A mesh.
    names
        Of groups of cells.

    Returns
    -------
    StructureMesh
        The same one if there are no such cells; else a note tells how many there were.

    Examples
    --------
    >>> from fem.mesh.structure_mesh import box_mesh
    >>> mesh = with_centres(box_mesh("plate", (2.0, 1.0), (2, 1), kind="quad8"), ["plate"])
    >>> mesh.cells["quad9"][0], mesh.points[-2:]
    (array([ 0,  5,  7,  2,  3,  6,  4,  1, 13]), array([[0.5, 0.5, 0. ],
           [1.5, 0.5, 0. ]]))
    """
    found = [mesh.part(name).get(OPEN, np.zeros(0, dtype=np.int64)) for name in names]
    chosen = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *found]))
    if not len(chosen):
        return mesh
    cells = mesh.cells[OPEN][chosen]
    values, _ = KINDS[OPEN].basis(np.array([[0.5, 0.5]]))
    points = np.vstack([mesh.points, np.einsum("b,ebi->ei", values[0], mesh.points[cells])])
    centres = np.arange(len(mesh.points), len(points))
    kept = np.delete(mesh.cells[OPEN], chosen, axis=0)
    filled = [mesh.cells.get(FILLED, np.zeros((0, 9), dtype=np.int64))]
    filled.append(np.column_stack([cells, centres]))
    place = np.full(len(mesh.cells[OPEN]), -1)
    place[chosen] = len(filled[0]) + np.arange(len(chosen))
    return replace(
        mesh,
        points=points,
        cells={**mesh.cells, OPEN: kept, FILLED: np.concatenate(filled)},
        groups={name: _moved(group, place) for name, group in mesh.groups.items()},
        point_sets={
            name: np.append(nodes, centres[np.isin(cells, nodes).all(axis=1)])
            for name, nodes in mesh.point_sets.items()
        },
        notes=(
            *mesh.notes,
            f"{mesh.source}: {len(chosen)} {OPEN} of shells have a further node in their middle",
        ),
        element_types={name: _moved(group, place) for name, group in mesh.element_types.items()},
    )


def _moved(group: Mapping[str, IntArray], place: IntArray) -> dict[str, IntArray]:
    """The indices of a group's cells after some of one kind, at their place or -1, have moved."""
    if OPEN not in group:
        return dict(group)
    at = group[OPEN]
    stay, move = at[place[at] < 0], place[at[place[at] >= 0]]
    number = np.cumsum(place < 0) - 1
    return {
        **group,
        OPEN: number[stay],
        FILLED: np.append(group.get(FILLED, np.zeros(0, dtype=np.int64)), move),
    }
