"""A page that shows shapes of a component in a browser, without a server."""

from __future__ import annotations

import base64
import html
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fem.base.arrays import FloatArray, IntArray
from fem.base.errors import ModelError
from fem.base.files import draft_of, plain_write_errors
from fem.render.colouring import surface_values
from fem.render.pictures import (
    AUTO_FRACTION,
    AnyComponent,
    checked_states,
    extent,
    quantity_unit,
    surface_of,
)

TEMPLATE = Path(__file__).with_name("page.html")


def write_page(
    component: AnyComponent,
    shapes: npt.ArrayLike,
    titles: Sequence[str],
    path: str | os.PathLike[str],
    *,
    heading: str = "",
    mirror: str | None = None,
    colour: str = "displacement",
    relative: bool = True,
) -> None:
    """Write one HTML file in which shapes can be chosen, turned, enlarged and set in motion.

    Nothing is loaded from elsewhere and no graphics library is needed to write it. The browser
    needs WebGL 2, which all current ones have.

    Parameters
    ----------
    component
        The assembled frame or structure.
    shapes
        Shape (N, k): displacements of the free degrees of freedom, one shape in each column.
    titles
        k texts, one for each shape.
    path
        The .html to write, whole or not at all.
    heading
        Text above the picture.
    mirror
        A point on a plane of symmetry, to draw half a frame whole.
    colour
        "displacement", "stress" or "moment", as for `fem.render.render_shape`.
    relative
        Whether the shapes are modes, of which only the form counts: colours are then relative to
        the largest of each. Else they are in units.

    Raises
    ------
    ModelError
        If the shapes do not belong to the component, there is not one title for each, the name
        does not end in .html or the file cannot be written.

    Examples
    --------
    >>> import fem, pathlib, tempfile
    >>> from fem.render import write_page
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 4)])
    >>> arm = fem.BeamPart(fem.Material(2e11, 7800.0), fem.RectangularSection(0.1, 0.02))
    >>> component = fem.assemble(fem.FrameModel(
    ...     mesh, {"arm": arm}, [fem.Support("root", ("x", "y", "rotation"))]))
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "arm.html"
    >>> write_page(component, np.eye(len(component.free))[:, :2], ["one", "two"], path)
    >>> "https://" in path.read_text()
    False
    """
    target = Path(path)
    if target.suffix.lower() != ".html":
        raise ModelError(f"{target}: the name must end in .html")
    states = checked_states(component, np.asarray(shapes, dtype=np.float64).T, 2)
    if len(titles) != len(states):
        raise ModelError(f"there are {len(states)} shapes to draw, but {len(titles)} titles")
    drawing = surface_of(component, mirror)
    rest, _ = drawing.place(np.zeros(states.shape[1]))
    content = {
        "heading": heading,
        "points": packed(rest, np.float32),
        "triangles": packed(triangles(drawing.faces()), np.uint32),
        "edges": packed(np.concatenate([*drawing.edges(), np.zeros((0, 2), int)]), np.uint32),
        "shapes": [
            shape_data(drawing, state, title, rest, colour, relative)
            for state, title in zip(states, titles, strict=True)
        ],
    }
    text = TEMPLATE.read_text(encoding="utf-8")
    text = text.replace("__TITLE__", html.escape(heading or "Shapes"))
    # "</script" could end the data, "<!--<script" hide their end; JSON has another way to write "<"
    data = json.dumps(content, ensure_ascii=False).replace("<", "\\u003c")
    with plain_write_errors(target), draft_of(target) as draft:
        draft.write_text(text.replace("__DATA__", data), encoding="utf-8")


def shape_data(
    drawing: Any, state: FloatArray, title: str, rest: FloatArray, colour: str, relative: bool
) -> dict[str, Any]:
    """How far every point of the surface moves as drawn, and its colour from 0 to 1."""
    values = surface_values(drawing, state, colour)
    largest = float(values.max())
    most = float(drawing.place(state)[1].max())
    factor = AUTO_FRACTION * extent(rest) / most if most > 0.0 else 1.0
    if relative:
        label, top = f"{colour} relative to the largest", 1.0
    else:
        label, on_colour = quantity_unit(colour, largest)
        top = largest * on_colour
    return {
        "title": title,
        "label": label,
        "top": top,
        "factor": None if relative else factor,
        "moves": packed(drawing.place(state, factor)[0] - rest, np.float32),
        "colours": packed(values / largest if largest > 0.0 else values, np.float32),
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
