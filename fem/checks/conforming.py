"""Whether neighbouring solids have the same functions on the face that they share."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fem.base.arrays import IntArray
from fem.base.errors import ModelError
from fem.mesh.cells import KINDS, all_facets, facet_keys
from fem.model.structure import StructureModel

Mismatch = tuple[IntArray, str, str]
"""Corners of faces (f, c), and what they are on one side and on the other."""


def check_conforming(model: StructureModel) -> None:
    """Refuse solids that have the corners of a face in common but not its functions.

    Raises
    ------
    ModelError
        Where cells of different order meet, where cells of second order have different nodes in
        the middle of an edge or a face, and where a quadrilateral is two triangles on the other
        side; with the place of the first and how many there are.

    Notes
    -----
    There the displacements of the two sides differ between the nodes: the body has a gap, the
    patch test fails, and frequencies need not come down to the right ones as cells get smaller.
    """
    found = list(_mismatches(model))
    if not found:
        return
    corners, one, other = found[0]
    x, y, z = model.mesh.points[corners[0]].mean(axis=0)
    raise ModelError(
        f"{model.mesh.source}: cells do not fit together at {sum(len(f) for f, *_ in found)} faces;"
        f" the first, at ({x:.6g}, {y:.6g}, {z:.6g}), is {one} on one side and {other} on the"
        " other; make both sides of the same order, and put pyramids between hexahedra and"
        " tetrahedra"
    )


def _mismatches(model: StructureModel) -> Iterator[Mismatch]:
    by_corners: dict[int, list[tuple[str, IntArray]]] = {}
    for kind, nodes in all_facets(kinds for _, kinds in model.solids.values()).items():
        by_corners.setdefault(len(KINDS[kind].corners), []).append((kind, nodes))
    for of_one_shape in by_corners.values():
        yield from _of_other_nodes(of_one_shape)
    if not model.plane:
        yield from _cut_in_two(model.facets)


def _of_other_nodes(facets: list[tuple[str, IntArray]]) -> Iterator[Mismatch]:
    """Facets with the same corners, but of another kind or with other nodes between these."""
    count = len(KINDS[facets[0][0]].corners)
    corners = np.concatenate([np.sort(nodes[:, :count], axis=1) for _, nodes in facets])
    between = np.concatenate([nodes[:, count:].sum(axis=1) for _, nodes in facets])
    names = np.repeat(np.arange(len(facets)), [len(nodes) for _, nodes in facets])
    key = facet_keys(corners)
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    other = (between[order][1:] != between[order][:-1]) | (names[order][1:] != names[order][:-1])
    for at in np.flatnonzero(same & other):
        first, second = order[at], order[at + 1]
        one, two = facets[names[first]][0], facets[names[second]][0]
        two = f"a {two} with other nodes between its corners" if one == two else f"a {two}"
        yield corners[[first]], f"a {one}", two


def _cut_in_two(outer: dict[str, IntArray]) -> Iterator[Mismatch]:
    """Outer quadrilaterals three of whose corners are those of an outer triangle."""
    triangles = [n[:, :3] for kind, n in outer.items() if len(KINDS[kind].corners) == 3]
    if not triangles:
        return
    known = np.concatenate(triangles)
    for kind, nodes in outer.items():
        if len(KINDS[kind].corners) == 4:
            halves = [np.delete(nodes[:, :4], i, axis=1) for i in range(4)]
            keys = facet_keys(np.sort(np.concatenate([known, *halves]), axis=1))
            cut = np.isin(keys[len(known) :], keys[: len(known)]).reshape(4, -1).any(axis=0)
            if cut.any():
                yield nodes[cut, :4], f"a {kind}", "two triangles"
