"""Pages that show shapes or a motion of a component in a browser, without a server."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.base.files import draft_of, plain_write_errors
from fem.render.pictures import AnyComponent, checked_states, checked_times, surface_of
from fem.render.scenery import StopSphere
from fem.render.viewer import (
    mode_motion,
    packed,
    surface_data,
    value_motion,
    viewer_script,
    viewer_style,
)

TEMPLATE = Path(__file__).with_name("page.html")
KEPT = 1e-5  # part of the largest motion below which a share of all motions is left out


def write_page(
    component: AnyComponent,
    shapes: npt.ArrayLike,
    titles: Sequence[str],
    path: str | os.PathLike[str],
    *,
    heading: str = "",
    mirror: str | None = None,
    stops: Sequence[StopSphere] = (),
) -> None:
    """Write one HTML file in which modes can be chosen, turned, enlarged and set in motion.

    Of modes only the form counts: each is coloured by its displacement along the axis along which
    it moves most, relative to its largest. Nothing is loaded from elsewhere and no graphics library
    is needed to write it. The browser needs WebGL 2, which all current ones have.

    Parameters
    ----------
    component
        The assembled structure.
    shapes
        Shape (N, k): displacements of the free degrees of freedom, one shape in each column.
    titles
        k texts, one for each shape.
    path
        The .html to write, whole or not at all.
    heading
        Text above the picture.
    mirror
        A point on a plane of symmetry, to draw half a structure whole.
    stops
        The stops to draw, off by their gaps.

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
    >>> component = fem.assemble(fem.StructureModel(
    ...     mesh, {"arm": arm}, [fem.Support("root", ("x", "y", "rotation"))], plane=True))
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "arm.html"
    >>> write_page(component, np.eye(len(component.free))[:, :2], ["one", "two"], path)
    >>> "https://" in path.read_text()
    False
    """
    target = _named(path)
    states = checked_states(component, np.asarray(shapes, dtype=np.float64).T, 2)
    if len(titles) != len(states):
        raise ModelError(f"there are {len(states)} shapes to draw, but {len(titles)} titles")
    drawing = surface_of(component, mirror)
    surface = surface_data(component, states.T, mirror=mirror, stops=stops)
    motions = [mode_motion(drawing, states.T, number, title) for number, title in enumerate(titles)]
    _write(target, heading or "Shapes", surface, motions)


def write_motion(
    component: AnyComponent,
    displacements: npt.ArrayLike,
    path: str | os.PathLike[str],
    *,
    times: npt.ArrayLike,
    period: float,
    first: float = 0.0,
    title: str = "",
    heading: str = "",
    mirror: str | None = None,
    colour: str = "displacement",
    stops: Sequence[StopSphere] = (),
) -> None:
    """Write one HTML file that plays a periodic motion, or shows any instant of it.

    Parameters
    ----------
    component
        The assembled structure.
    displacements
        In m, shape (m, N): one state for each instant, the last instant of a period left out. In
        between the motion is taken as linear.
    path
        The .html to write, whole or not at all.
    times
        Ascending instants in s, shape (m,), from 0 to below the period.
    period
        In s.
    first
        The instant in s that is shown at first, standing until the motion is played.
    title, heading
        Texts above the picture.
    mirror, stops
        As for `write_page`; the gaps are scaled as the deflection is.
    colour
        "displacement", "stress" or "moment", as for `fem.render.render_shape`, at each instant.

    Raises
    ------
    ModelError
        If the displacements do not belong to the component, there is not one time for each, the
        name does not end in .html or the file cannot be written.

    Examples
    --------
    >>> import fem, pathlib, tempfile
    >>> from fem.render import write_motion
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 4)])
    >>> arm = fem.BeamPart(fem.Material(2e11, 7800.0), fem.RectangularSection(0.1, 0.02))
    >>> component = fem.assemble(fem.StructureModel(
    ...     mesh, {"arm": arm}, [fem.Support("root", ("x", "y", "rotation"))], plane=True))
    >>> times = np.arange(8) / 8
    >>> states = np.outer(np.sin(2 * np.pi * times), np.linspace(0, 1e-3, len(component.free)))
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "arm.html"
    >>> write_motion(component, states, path, times=times, period=1.0, title="swinging")
    """
    target = _named(path)
    states = checked_states(component, displacements, 2)
    instants = checked_times(times, len(states))
    drawing = surface_of(component, mirror)
    shapes, coordinates = shapes_of(states)
    begin = states[np.argmin(np.abs(instants - first))]
    surface = surface_data(component, shapes, mirror=mirror, stops=stops, seen=begin)
    motion = {
        "title": title,
        "times": packed(instants, np.float32),
        "period": period,
        "first": first,
        "coordinates": packed(coordinates, np.float32),
        **value_motion(drawing, states, colour),
    }
    _write(target, heading or title or "Motion", surface, [motion])


def shapes_of(states: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Few shapes (N, k) of which states (m, N) are sums, and their coordinates (m, k).

    Examples
    --------
    >>> shapes, coordinates = shapes_of(np.outer([1.0, 2.0, -1.0], [3.0, 4.0]))
    >>> shapes.shape, np.allclose(coordinates @ shapes.T, np.outer([1, 2, -1], [3, 4]))
    ((2, 1), True)
    """
    left, size, right = np.linalg.svd(states, full_matrices=False)
    kept = max(int(np.count_nonzero(size > KEPT * size[0])), 1)
    return right[:kept].T, left[:, :kept] * size[:kept]


def _named(path: str | os.PathLike[str]) -> Path:
    target = Path(path)
    if target.suffix.lower() != ".html":
        raise ModelError(f"{target}: the name must end in .html")
    return target


def _write(
    target: Path, heading: str, surface: dict[str, Any], motions: Sequence[dict[str, Any]]
) -> None:
    text = TEMPLATE.read_text(encoding="utf-8")
    text = text.replace("__STYLE__", viewer_style()).replace("__VIEWER__", viewer_script())
    text = text.replace("__TITLE__", html.escape(heading))
    content = {"heading": heading, "surface": surface, "motions": list(motions)}
    # "</script" could end the data, "<!--<script" hide their end; JSON has another way to write "<"
    data = json.dumps(content, ensure_ascii=False).replace("<", "\\u003c")
    with plain_write_errors(target), draft_of(target) as draft:
        draft.write_text(text.replace("__DATA__", data), encoding="utf-8")
