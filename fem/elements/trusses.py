"""Trusses: lines that carry a force along themselves only."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError, quoted
from fem.mesh.cells import SPANS, CellKind
from fem.mesh.structure_mesh import StructureMesh
from fem.model.parts import TrussPart

TURNS_BACK = 1e-9  # of its squared length: how far a bar's curve goes ahead at its ends, at least
UNHELD = 1e-9  # of a bar's own hold: a direction in which a node has none


def truss_rows(
    part: TrussPart, kind: CellKind, coordinates: FloatArray, what: str
) -> tuple[FloatArray, FloatArray]:
    """Strains (e, q, b, 3) of lines from the moves of their nodes, and their stiffness (e, q).

    Along a curved line of three nodes the strain is that of its own direction.

    Raises
    ------
    ModelError
        If a line has no length, or doubles back on itself.
    """
    slopes, lengths, weights, _ = _along(kind, coordinates, what)
    tangent = np.einsum("ebi,qb->eqi", coordinates, slopes) / lengths[..., None]
    rows = slopes[None, :, :, None] * tangent[:, :, None, :] / lengths[..., None, None]
    return rows, part.material.youngs_modulus * part.area * lengths * weights


def truss_mass(part: TrussPart, kind: CellKind, coordinates: FloatArray, what: str) -> FloatArray:
    """Consistent mass (e, b, b) of lines for one direction, the same in all, in kg."""
    _, lengths, weights, values = _along(kind, coordinates, what)
    density = part.material.density * part.area
    found = density * np.einsum("eq,qa,qb->eab", lengths * weights, values, values)
    return np.asarray(found, dtype=np.float64)


def _along(
    kind: CellKind, coordinates: FloatArray, what: str
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Slopes (q, b), lengths of the mapping (e, q), weights (q,) and shape functions (q, b)."""
    places, weights = kind.quadrature
    values, slopes = kind.basis(places)
    chord = coordinates[:, 1] - coordinates[:, 0]
    _, ends = kind.basis(kind.corners)
    forward = np.einsum("ebi,qb,ei->eq", coordinates, ends[..., 0], chord)
    size = np.abs(coordinates - coordinates[:, :1]).max(axis=(1, 2))
    bad = np.flatnonzero(~(forward > TURNS_BACK * size[:, None] ** 2).all(axis=1))
    if len(bad):
        raise ModelError(f"{what}: line {bad[0]} has no length or doubles back on itself")
    run = np.einsum("ebi,qb->eqi", coordinates, slopes[..., 0])
    return slopes[..., 0], np.linalg.norm(run, axis=2), weights, values


def loose_nodes(
    points: FloatArray, lines: Sequence[IntArray], held: IntArray, dimension: int
) -> IntArray:
    """Nodes that lines of trusses do not hold in all directions.

    Parameters
    ----------
    points
        Coordinates, shape (n, 3).
    lines
        Nodes (e, 2) or (e, 3) of the trusses.
    held
        Whether each node is held in x, y and z by anything else, shape (n, 3).
    dimension
        3, or 2 for what moves in the x-y plane only.

    Examples
    --------
    >>> points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0.0]])
    >>> held = np.array([[1, 1, 1], [0, 0, 0], [1, 1, 1]])
    >>> loose_nodes(points, [np.array([[0, 1], [1, 2]])], held, 2)
    array([1])
    """
    pairs = np.concatenate([np.zeros((0, 2), dtype=np.int64), *map(chords, lines)])
    span = points[pairs[:, 1]] - points[pairs[:, 0]]
    span = span / np.linalg.norm(span, axis=1)[:, None]
    reach = np.zeros((len(points), 3, 3))
    for end in (0, 1):
        np.add.at(reach, pairs[:, end], span[:, :, None] * span[:, None, :])
    reach[:, range(3), range(3)] += held
    least = np.linalg.eigvalsh(reach[:, :dimension, :dimension])[:, 0]
    used = np.zeros(len(points), dtype=np.bool_)
    used[pairs] = True
    return np.flatnonzero(used & (least < UNHELD))


def chords(cells: IntArray) -> IntArray:
    """Pairs of nodes (m, 2) of lines with two or three nodes (e, b).

    Examples
    --------
    >>> chords(np.array([[0, 1, 2]]))
    array([[0, 2],
           [2, 1]])
    """
    kind = "line" if cells.shape[1] == 2 else "line3"
    return np.concatenate([cells[:, list(ends)] for ends in SPANS[kind]])


def loose_sentences(mesh: StructureMesh, nodes: IntArray) -> Iterator[str]:
    """One sentence that names the nodes of a mesh that nothing holds in all directions."""
    if len(nodes):
        listed = ", ".join(str(node) for node in nodes[:5]) + (", ..." if len(nodes) > 5 else "")
        names = [name for name, at in mesh.point_sets.items() if set(at) & set(nodes)]
        called = f" (of {quoted(names)})" if names else ""
        yield (
            f"{mesh.source}: {len(nodes)} nodes of trusses{called} are not held in all directions:"
            f" {listed}; hold them there, or divide no truss between its joints"
        )
