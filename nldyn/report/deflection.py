"""The surface of a structure and how each of its modes moves it, for a page in a browser."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import cms
from fem.render.page import packed, triangles
from fem.render.pictures import AUTO_FRACTION, AnyComponent, extent, surface_of

MOST_NUMBERS = 2_000_000  # of 16 bits, that the motion of the surface may take


def surface_content(
    component: AnyComponent, reduced: cms.ReducedModel, mirror: str | None = None
) -> dict[str, Any]:
    """Points, triangles and edges of a surface, and how far each mode moves the points.

    Parameters
    ----------
    component
        The frame or structure.
    reduced
        What it was reduced to.
    mirror
        A point on a plane of symmetry, to draw half a frame whole.

    Returns
    -------
    dict
        For JSON: arrays in base64. The moves are whole numbers of 16 bits in units of ``quanta``
        (m); ``reach`` is the deflection in m that is drawn at first. If the surface is too large
        for a page, only ``fault``, which says so.
    """
    drawing = surface_of(component, mirror)
    rest, _ = drawing.place(np.zeros(len(component.free)))
    if rest.size * (reduced.size + 1) > MOST_NUMBERS:
        most = MOST_NUMBERS // (3 * (reduced.size + 1))
        return {
            "fault": f"The surface has {len(rest)} points; with {reduced.size} modes this page has "
            f"room for {most}. 'nldyn render' draws it."
        }
    moves = np.array([moved(drawing, shape, rest) for shape in reduced.basis.T])
    largest = np.abs(moves).max(axis=(1, 2), initial=0.0)
    quanta = np.where(largest > 0.0, largest / 32767.0, 1.0)
    return {
        "points": packed(rest, np.float32),
        "triangles": packed(triangles(drawing.faces()), np.uint32),
        "edges": packed(np.concatenate([*drawing.edges(), np.zeros((0, 2), int)]), np.uint32),
        "moves": [
            packed(np.rint(move / quantum), np.int16)
            for move, quantum in zip(moves, quanta, strict=True)
        ],
        "quanta": quanta.tolist(),
        "reach": AUTO_FRACTION * extent(rest),
    }


def moved(
    drawing: Any, shape: NDArray[np.float64], rest: NDArray[np.float64]
) -> NDArray[np.float64]:
    """How far a small multiple of a shape moves the points (p, 3), for the whole shape.

    Sections turn with the axis and are not stretched: so only small deflections are linear.
    """
    most = float(drawing.place(shape)[1].max(initial=0.0))
    if most == 0.0:
        return np.zeros_like(rest)
    small = 1e-4 * extent(rest) / most
    points, _ = drawing.place(shape, small)
    return np.asarray((points - rest) / small)
