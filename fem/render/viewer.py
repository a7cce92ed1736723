"""What the viewer of pages, viewer.js, is given: a surface with its moves, and motions of it."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fem.base.arrays import FloatArray, IntArray
from fem.render.colouring import colour_name, surface_values
from fem.render.pictures import (
    AUTO_FRACTION,
    BLOCK,
    PLANE,
    SMALL,
    STEEL,
    STOP,
    AnyComponent,
    extent,
    quantity_unit,
    round_range,
    signed_values,
    surface_moves,
    surface_of,
    surroundings,
)
from fem.render.scenery import StopSphere
from fem.render.several import Surface
from fem.render.stop_scenery import SINKING, closing, drawn_radius
from fem.render.views import view_of_motion

HERE = Path(__file__).parent


def viewer_script() -> str:
    """The script that defines ``showSurface(holder, surface)``."""
    return (HERE / "viewer.js").read_text(encoding="utf-8").rstrip("\n")


def viewer_style() -> str:
    """The style of what the viewer puts into a page."""
    return (HERE / "viewer.css").read_text(encoding="utf-8").rstrip("\n")


def surface_data(
    component: AnyComponent,
    shapes: FloatArray,
    *,
    mirror: str | None = None,
    stops: Sequence[StopSphere] = (),
    seen: FloatArray | None = None,
) -> dict[str, Any]:
    """A surface with what stands around it, and how far each shape moves all points.

    Parameters
    ----------
    component
        The structure.
    shapes
        Displacements of the free degrees of freedom, one shape in each column, (N, k).
    mirror
        A point on a plane of symmetry, to draw half a structure whole.
    stops
        The stops.
    seen
        The displacement (N,) for whose motion the view is chosen; the first shape unless given.

    Returns
    -------
    dict
        For JSON: arrays in base64. The first ``count`` points are those of the surface, the others
        those of ``bodies``: supports, masses and stops. The moves are whole numbers of 16 bits in
        units of ``quanta`` (m); stops also move by ``gap``. ``reach`` is the deflection in m that
        is drawn at first, if none of ``stops`` then sinks in by more than its ``room``.
    """
    drawing = surface_of(component, mirror)
    rest, _ = drawing.place(np.zeros(shapes.shape[0]))
    bodies = list(_bodies(drawing, shapes, stops))
    points = np.concatenate([rest, *(body["points"] for body in bodies)])
    own = [surface_moves(drawing, shape, rest) for shape in shapes.T]
    moves = np.array([
        np.concatenate([move, *(body["moves"][k] for body in bodies)]) for k, move in enumerate(own)
    ]).reshape(len(own), len(points), 3)  # fmt: skip
    largest = np.abs(moves).max(axis=(1, 2), initial=0.0)
    quanta = np.where(largest > 0.0, largest / 32767.0, 1.0)
    starts = len(rest) + np.cumsum([0, *(len(body["points"]) for body in bodies)])
    shown = own[0] if seen is None else surface_moves(drawing, seen, rest)
    return {
        "points": packed(points, np.float32),
        "count": len(rest),
        "triangles": packed(triangles(drawing.faces()), np.uint32),
        "edges": packed(np.concatenate([*drawing.edges(), np.zeros((0, 2), int)]), np.uint32),
        "bodies": [
            {"triangles": packed(body["triangles"] + start, np.uint32), "colour": body["colour"]}
            for body, start in zip(bodies, starts, strict=False)
        ],
        "gap": packed(np.concatenate([*(b["gap"] for b in bodies), np.zeros((0, 3))]), np.float32),
        "moves": [
            packed(np.rint(move / quantum), np.int16)
            for move, quantum in zip(moves, quanta, strict=True)
        ],
        "quanta": quanta.tolist(),
        "reach": AUTO_FRACTION * extent(rest),
        "stops": [
            {
                "moves": [closing(drawing, shape, stop) for shape in shapes.T],
                "gap": stop.gap,
                "room": SINKING * drawn_radius(drawing, stop),
            }
            for stop in stops
        ],
        "view": view_of_motion(rest, shown).tolist(),
    }


def _bodies(
    drawing: Surface, shapes: FloatArray, stops: Sequence[StopSphere]
) -> Iterator[dict[str, Any]]:
    """Supports, stops and masses: points, triangles, colour, and how gap and shapes move them."""
    marks, touching, masses = surroundings(drawing, 0.0, stops)
    _, standing, _ = surroundings(drawing, 1.0, stops)
    still = [np.zeros((1, 3))] * shapes.shape[1]
    for solid, plane in marks:
        yield _body(solid, colour_of(PLANE, 0.25) if plane else colour_of(STEEL), still)
    for body, off in zip(touching, standing, strict=True):
        carried = [body.moved(drawing, shape, 1.0) for shape in shapes.T]
        moves = [np.zeros((1, 3)) if move is None else move[None] for move in carried]
        gap = np.asarray(off.solid.points - body.solid.points)
        yield _body(body.solid, colour_of(STOP), moves, gap)
    for mass in masses:
        moves = []
        rest = np.array(mass.solid.points, dtype=np.float64)
        for shape in shapes.T:
            small = SMALL * max(extent(rest), 1e-9) / (float(drawing.place(shape)[1].max()) or 1.0)
            placed: Any = drawing.component.shape(shape)
            mass.move(placed, small)
            moves.append((np.array(mass.solid.points) - rest) / small)
        mass.solid.points = rest
        yield _body(mass.solid, colour_of(BLOCK), moves)


def _body(
    solid: Any, colour: list[float], moves: Sequence[FloatArray], gap: FloatArray | None = None
) -> dict[str, Any]:
    points = np.array(solid.points, dtype=np.float64)
    cut = solid.triangulate()
    return {
        "points": points,
        "triangles": cut.faces.reshape(-1, 4)[:, 1:].astype(np.int64),
        "colour": colour,
        "gap": np.zeros_like(points) if gap is None else np.broadcast_to(gap, points.shape),
        "moves": [np.broadcast_to(move, points.shape) for move in moves],
    }


def colour_of(name: str, alpha: float = 1.0) -> list[float]:
    """Red, green, blue and opacity from 0 to 1.

    Examples
    --------
    >>> colour_of("#ff0000")
    [1.0, 0.0, 0.0, 1.0]
    """
    return [int(name[i : i + 2], 16) / 255.0 for i in (1, 3, 5)] + [alpha]


def mode_motion(drawing: Surface, shapes: FloatArray, number: int, title: str) -> dict[str, Any]:
    """The motion of one of shapes (N, k), coloured by its displacement along its main axis."""
    shape = shapes[:, number]
    rest, _ = drawing.place(np.zeros_like(shape))
    moved = surface_moves(drawing, shape, rest)
    values, axis = signed_values(moved)
    return {
        "title": title,
        "swing": True,
        "coordinates": packed(np.eye(shapes.shape[1])[number], np.float32),
        "colours": packed(np.rint(127.5 * (values + 1.0)), np.uint8),
        "label": f"displacement along {axis}, relative to the largest",
        "top": 1.0,
        "parts": 4,
        "unit": "",
        "view": view_of_motion(rest, moved).tolist(),
    }


def value_motion(drawing: Surface, states: FloatArray, colour: str) -> dict[str, Any]:
    """The colours of states (m, N) in one range, as the viewer takes them."""
    values = np.array([surface_values(drawing, state, colour) for state in states])
    largest = float(values.max(initial=0.0))
    unit, on_colour = quantity_unit(colour, largest)
    top, parts = round_range(largest * on_colour)
    levels = np.rint(255.0 * np.clip(values * on_colour / top, 0.0, 1.0))
    return {
        "colours": packed(levels, np.uint8),
        "label": colour_name(drawing, colour),
        "unit": unit,
        "top": top,
        "parts": parts,
    }


def triangles(polygons: Sequence[IntArray]) -> IntArray:
    """Convex polygons (f, k) cut into triangles (t, 3) as fans.

    Examples
    --------
    >>> triangles([np.array([[0, 1, 2, 3]])])
    array([[0, 1, 2],
           [0, 2, 3]])
    """
    fans = [
        faces[:, [0, corner, corner + 1]]
        for faces in polygons
        for corner in range(1, faces.shape[1] - 1)
    ]
    return np.concatenate([*fans, np.zeros((0, 3), dtype=np.int64)])


def packed(values: npt.NDArray[Any], kind: type[np.generic]) -> str:
    """The numbers in little-endian bytes, as base64."""
    little = np.ascontiguousarray(values).astype(np.dtype(kind).newbyteorder("<"))
    return base64.b64encode(little.tobytes()).decode("ascii")
