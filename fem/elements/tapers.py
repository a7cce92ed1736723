"""Beams whose section changes along them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.elements.straight_beams import PLACES
from fem.mesh.structure_mesh import StructureMesh
from fem.model.parts import TrussPart
from fem.model.sections import LinearSection, SectionRun, TaperedSection

BEYOND = 1e-6
"""Share of the way by which nodes may lie before the start or behind the end of a taper."""


def along(
    part: Any,
    mesh: StructureMesh,
    lines: IntArray,
    what: str,
    places: FloatArray = PLACES,
) -> Any:
    """The part with the numbers of its section at places along its lines, if it is tapered.

    Parameters
    ----------
    part
        A beam or a truss.
    mesh
        With the points between which the section changes.
    lines
        Pairs of nodes, shape (e, 2).
    what
        Begins the error texts.
    places
        Along each line, between 0 and 1, shape (q,); by default those of integration.

    Raises
    ------
    ModelError
        If there are no such points, or a line reaches beyond them.
    """
    if isinstance(part, TrussPart):
        return part
    if isinstance(part.section, LinearSection):
        return replace(part, section=SectionRun(part.section, np.tile(places, (len(lines), 1))))
    if not isinstance(part.section, TaperedSection):
        return part
    shares = taper_shares(part.section, mesh, lines, what)
    at = shares[:, :1] * (1.0 - places) + shares[:, 1:] * places
    return replace(part, section=SectionRun(part.section, at))


def taper_shares(
    section: TaperedSection, mesh: StructureMesh, lines: IntArray, what: str
) -> FloatArray:
    """Shares of the way from the start to the end of a taper at both ends of lines, (e, 2).

    Examples
    --------
    >>> import fem
    >>> ends = {"a": (0, 0), "b": (2, 0)}
    >>> mesh = fem.frame_mesh(ends, [("arm", "a", "b", 2)])
    >>> round_bar = fem.CircularSection(0.2), fem.CircularSection(0.1)
    >>> taper_shares(fem.TaperedSection(*round_bar, "a", "b"), mesh, mesh.cells["line"], "arm")
    array([[0. , 0.5],
           [0.5, 1. ]])
    """
    first, last = (mesh.points[mesh.node(p)] for p in (section.from_point, section.to_point))
    way = last - first
    square = float(way @ way)
    if square == 0.0:
        raise ModelError(
            f"{what}: its section changes from {section.from_point!r} to {section.to_point!r},"
            " which are at the same place"
        )
    shares = (mesh.points[lines] - first) @ way / square
    bad = np.argwhere((shares < -BEYOND) | (shares > 1.0 + BEYOND))
    if len(bad):
        raise ModelError(
            f"{what}: node {lines[tuple(bad[0])]} lies beyond the way from"
            f" {section.from_point!r} to {section.to_point!r}, along which its section changes"
        )
    return np.asarray(np.clip(shares, 0.0, 1.0), dtype=np.float64)
