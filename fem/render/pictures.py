"""Pictures and animations of deflected structures with their true sections.

A function with a path writes that file off-screen; without one it gives the pyvista plotter, not
yet shown: ``plotter.show()`` opens a window, or the picture in a notebook. pyvista is imported when
the first picture is made.
"""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import numpy.typing as npt

from fem.assembly.component import Component
from fem.base.arrays import FloatArray
from fem.base.errors import ModelError
from fem.base.files import draft_of
from fem.render.colouring import colour_name, surface_values
from fem.render.gl import RenderError, on_screen, require_gl, require_library
from fem.render.scenery import Block, StopSphere, mass_blocks, support_marks
from fem.render.several import OfPart, Several, SeveralSurfaces, Surface, stops_at
from fem.render.stop_scenery import StopBody, largest_scale, stop_bodies
from fem.render.structure_surface import StructureSurface, structure_surface
from fem.render.views import MOTION, axes_of_view

if TYPE_CHECKING:
    import pyvista


AnyComponent = Component | Several
Mass = Block | OfPart
Image = npt.NDArray[np.uint8]
Plotter = Any  # pyvista.Plotter while it is drawn in

TEXT = "#202020"
GHOST = "#6b7785"
STEEL = "#55606e"
STOP = "#c0392b"
COLOURS = "viridis"
SIGNED_COLOURS = "coolwarm"
SMALL = 1e-4  # of the structure's size: so little it moves where its moves are taken as linear
BLOCK = "#8a8f98"
PLANE = "#3a78b5"
AUTO_FRACTION = 0.06
BAR_ROW = 110
GHOST_SHRINKAGE = 0.97
"""Makes undeformed beams a little thinner, so that the other hides it where they agree."""
BEHIND = (2.0, 2.0e4)
"""Factor and units of OpenGL's polygon offset: faces at rest lie behind those they agree with."""
TRIAD = 110  # pixels
FIELD = (0.20, 0.85, 0.94)
SHEET_FIELD = (0.05, 0.84, 0.94)
"""Where the structure goes: from this part of the field's height to that, and of its width."""


@overload
def render_shape(
    component: AnyComponent,
    u: FloatArray,
    path: None = None,
    *,
    title: str = ...,
    scale: float | None = ...,
    stops: Sequence[StopSphere] = ...,
    mirror: str | None = ...,
    colour: str = ...,
    view: str = ...,
    size: tuple[int, int] = ...,
) -> pyvista.Plotter: ...
@overload
def render_shape(
    component: AnyComponent,
    u: FloatArray,
    path: str | os.PathLike[str],
    *,
    title: str = ...,
    scale: float | None = ...,
    stops: Sequence[StopSphere] = ...,
    mirror: str | None = ...,
    colour: str = ...,
    view: str = ...,
    size: tuple[int, int] = ...,
) -> float: ...
def render_shape(
    component: AnyComponent,
    u: FloatArray,
    path: str | os.PathLike[str] | None = None,
    *,
    title: str = "",
    scale: float | None = None,
    stops: Sequence[StopSphere] = (),
    mirror: str | None = None,
    colour: str = "displacement",
    view: str = MOTION,
    size: tuple[int, int] = (1600, 900),
) -> pyvista.Plotter | float:
    """Picture of a deflected structure, coloured by its displacement or stress.

    Drawn with it: the same undeformed in grey, supports, point masses as blocks of steel of that
    mass, and the stops at their true places (their gaps scaled as the deflection is). The factor
    on the deflection is stated in the picture.

    Parameters
    ----------
    component
        The assembled structure.
    u
        Displacements of the free degrees of freedom in m, shape (N,).
    path
        The .png to write, whole or not at all; without it the plotter is returned.
    title
        Text above the picture.
    scale
        Factor on the deflection; by default a round one that makes it well visible, but lets no
        stop sink in by more than half its radius.
    stops
        The stops to draw.
    mirror
        A point on a plane of symmetry, to draw half a structure whole.
    colour
        "displacement"; "stress": von Mises' in solids, that of the outermost fibre in beams; or
        "moment": the bending moment of beams.
    view
        From where: one of `VIEWS`, or "motion", from where what moves is seen best. Axes in a
        corner show the directions.
    size
        Width and height in pixels.

    Returns
    -------
    float or pyvista.Plotter
        The factor on the deflection; without a path the plotter, not yet shown. Its ``show()``
        opens a window where there is a screen, and draws in a notebook.

    Raises
    ------
    RenderError
        If this machine cannot render, with what to install, or the name does not end in .png.
    ModelError
        If u has the wrong shape or is not finite, or a point is not in the mesh.

    Examples
    --------
    >>> import fem, numpy as np
    >>> from fem.render import gl_available, render_shape
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 4)])
    >>> arm = fem.BeamPart(fem.Material(2e11, 7800.0), fem.RectangularSection(0.1, 0.02))
    >>> component = fem.assemble(fem.StructureModel(
    ...     mesh, {"arm": arm}, [fem.Support("root", ("x", "y", "rotation"))], plane=True))
    >>> u = np.linspace(0.0, 1e-3, len(component.free))
    >>> if gl_available()[0]:
    ...     factor = render_shape(component, u, "arm.png", title="An arm")
    ...     render_shape(component, u, title="An arm").show()
    """
    target = None if path is None else named(path, (".png",))
    drawing = surface_of(component, mirror)
    states = checked_states(component, u, 1)
    factor = automatic_scale(drawing, states, stops) if scale is None else checked_scale(scale)
    require_gl()
    with picture(target, size) as plotter:
        moving = add_deflected(plotter, drawing, states[0], factor, colour)
        compose(plotter, moving, states, stops, title, size, view)
        add_note(plotter, scale_note(factor, stops), size)
    return plotter if target is None else factor


@overload
def render_modes(
    component: AnyComponent,
    shapes: npt.ArrayLike,
    titles: Sequence[str],
    path: None = None,
    *,
    mirror: str | None = ...,
    stops: Sequence[StopSphere] = ...,
    view: str = ...,
    size: tuple[int, int] | None = ...,
) -> pyvista.Plotter: ...
@overload
def render_modes(
    component: AnyComponent,
    shapes: npt.ArrayLike,
    titles: Sequence[str],
    path: str | os.PathLike[str],
    *,
    mirror: str | None = ...,
    stops: Sequence[StopSphere] = ...,
    view: str = ...,
    size: tuple[int, int] | None = ...,
) -> None: ...
def render_modes(
    component: AnyComponent,
    shapes: npt.ArrayLike,
    titles: Sequence[str],
    path: str | os.PathLike[str] | None = None,
    *,
    mirror: str | None = None,
    stops: Sequence[StopSphere] = (),
    view: str = MOTION,
    size: tuple[int, int] | None = None,
) -> pyvista.Plotter | None:
    """Picture with one mode in each field, all drawn with the same largest displacement.

    The colours are the displacement along the axis along which a mode moves most.

    Parameters
    ----------
    component
        The assembled structure.
    shapes
        Shape (N, k): one mode in each column, such as ``reduced.basis``.
    titles
        k texts, one above each mode.
    path
        The .png to write, whole or not at all; without it the plotter is returned.
    mirror
        A point on a plane of symmetry, to draw a half model whole.
    stops
        The stops to draw, off by their gaps as they are.
    view
        From where, as for `render_shape`; that of "motion" may differ from mode to mode.
    size
        Width and height in pixels; by default what k fields need.

    Returns
    -------
    None or pyvista.Plotter
        Without a path the plotter, not yet shown, as by `render_shape`.

    Raises
    ------
    RenderError
        If this machine cannot render, with what to install, or the name does not end in .png.
    ModelError
        If the shapes do not belong to the component or there is not one title for each.

    Examples
    --------
    >>> import fem, numpy as np
    >>> from fem.render import gl_available, render_modes
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 4)])
    >>> arm = fem.BeamPart(fem.Material(2e11, 7800.0), fem.RectangularSection(0.1, 0.02))
    >>> component = fem.assemble(fem.StructureModel(
    ...     mesh, {"arm": arm}, [fem.Support("root", ("x", "y", "rotation"))], plane=True))
    >>> if gl_available()[0]:
    ...     render_modes(component, np.eye(len(component.free))[:, :2], ["one", "two"], "arm.png")
    """
    target = None if path is None else named(path, (".png",))
    drawing = surface_of(component, mirror)
    modes = checked_states(component, np.asarray(shapes, dtype=np.float64).T, 2)
    if len(titles) != len(modes):
        raise ModelError(f"there are {len(modes)} modes to draw, but {len(titles)} titles")
    rows, columns = fields(len(modes))
    window = size or (900 * columns if columns > 1 else 1400, 390 * rows + BAR_ROW)
    require_gl()
    field = (window[0] // columns, (window[1] - BAR_ROW) // rows)
    with picture(target, window, (rows, columns), BAR_ROW / field[1]) as plotter:
        for index, (mode, title) in enumerate(zip(modes, titles, strict=True)):
            plotter.subplot(*divmod(index, columns))
            moving = add_mode(plotter, drawing, mode, title, field, view, stops)
        plotter.subplot(rows, 0)
        drawn = f"{moving.factor * 1e3:.3g} mm"
        label = f"displacement along the axis named, relative to the largest, drawn as {drawn}"
        add_scalar_bar(plotter, moving, label, window[0], BAR_ROW, 4)
    return plotter if target is None else None


@overload
def render_comparison(
    component: AnyComponent,
    full: FloatArray,
    reduced: FloatArray,
    path: None = None,
    *,
    title: str = ...,
    scale: float | None = ...,
    mirror: str | None = ...,
    size: tuple[int, int] = ...,
) -> pyvista.Plotter: ...
@overload
def render_comparison(
    component: AnyComponent,
    full: FloatArray,
    reduced: FloatArray,
    path: str | os.PathLike[str],
    *,
    title: str = ...,
    scale: float | None = ...,
    mirror: str | None = ...,
    size: tuple[int, int] = ...,
) -> float: ...
def render_comparison(
    component: AnyComponent,
    full: FloatArray,
    reduced: FloatArray,
    path: str | os.PathLike[str] | None = None,
    *,
    title: str = "",
    scale: float | None = None,
    mirror: str | None = None,
    size: tuple[int, int] = (1600, 900),
) -> pyvista.Plotter | float:
    """Picture of two deflections of one component: of the full and of a reduced model.

    The surface is the full one, coloured by the distance between the two; red lines are the sharp
    edges of the reduced one.

    Parameters
    ----------
    component
        The assembled component.
    full, reduced
        Displacements of the free degrees of freedom in m, each of shape (N,).
    path, title, scale, mirror, size
        As for `render_shape`.

    Returns
    -------
    float or pyvista.Plotter
        The largest distance over the largest displacement of the full model, which the picture
        says, too; without a path the plotter, not yet shown, as by `render_shape`.

    Raises
    ------
    RenderError, ModelError
        As for `render_shape`.
    """
    target = None if path is None else named(path, (".png",))
    drawing = surface_of(component, mirror)
    states = checked_states(component, np.stack([full, reduced]), 2)
    factor = automatic_scale(drawing, states) if scale is None else checked_scale(scale)
    apart = drawing.place(states[0] - states[1])[1]
    largest = float(drawing.place(states[0])[1].max())
    share = float(apart.max()) / largest if largest > 0.0 else 0.0
    require_gl()
    with picture(target, size) as plotter:
        moving = add_deflected(plotter, drawing, states[0], factor)
        other, _ = drawing.place(states[1], factor)
        _, lines = polydata(drawing, other)
        plotter.add_mesh(lines, color=STOP, line_width=3.0)
        compose(plotter, moving, states, (), title, size, MOTION)
        unit, per_metre = length_unit(float(apart.max()))
        moving.surface.point_data["colour"][:] = apart * per_metre
        parts = moving.range_of(0.0, float(apart.max()) * per_metre)
        add_scalar_bar(plotter, moving, f"distance between the two, {unit}", *size, parts)
        note = f"deflection drawn × {factor:g};  red lines: reduced model, off by {share:.2g}"
        add_note(plotter, note + " of the largest displacement", size)
    return plotter if target is None else share


def animate(
    component: AnyComponent,
    displacements: npt.ArrayLike,
    path: str | os.PathLike[str],
    *,
    times: npt.ArrayLike,
    scale: float | None = None,
    stops: Sequence[StopSphere] = (),
    mirror: str | None = None,
    colour: str = "displacement",
    title: str = "",
    view: str = MOTION,
    fps: float = 25.0,
    size: tuple[int, int] = (1120, 540),
) -> float:
    """Animation of a moving structure, repeated without end.

    Parameters
    ----------
    component
        The assembled structure.
    displacements
        In m, shape (m, N): one state for each picture. For one period of an orbit leave out
        the last instant, which is the first again.
    path
        A .gif, or an .mp4 where imageio-ffmpeg is installed; written whole or not at all.
    times
        Instants in s, shape (m,), shown in the pictures.
    scale, stops, mirror, colour, title, view
        As for `render_shape`; one scale and one range of colours for all pictures.
    fps
        Pictures per second.
    size
        Width and height in pixels.

    Returns
    -------
    float
        The factor on the deflection.

    Raises
    ------
    RenderError
        If this machine cannot render or cannot write .mp4, with what to install.
    ModelError
        If the displacements do not belong to the component or there is not one time for each.

    Examples
    --------
    >>> import fem, numpy as np
    >>> from fem.render import animate, gl_available
    >>> mesh = fem.frame_mesh({"root": (0, 0), "tip": (1, 0)}, [("arm", "root", "tip", 4)])
    >>> arm = fem.BeamPart(fem.Material(2e11, 7800.0), fem.RectangularSection(0.1, 0.02))
    >>> component = fem.assemble(fem.StructureModel(
    ...     mesh, {"arm": arm}, [fem.Support("root", ("x", "y", "rotation"))], plane=True))
    >>> times = np.arange(5) / 5
    >>> states = np.outer(np.sin(2 * np.pi * times), np.linspace(0, 1e-3, len(component.free)))
    >>> if gl_available()[0]:
    ...     factor = animate(component, states, "arm.gif", times=times)
    """
    target = named(path, (".gif", ".mp4"))
    drawing = surface_of(component, mirror)
    states = checked_states(component, displacements, 2)
    instants = checked_times(times, len(states))
    if not (math.isfinite(fps) and fps > 0.0):
        raise ModelError(f"fps must be positive, not {fps}")
    factor = automatic_scale(drawing, states, stops) if scale is None else checked_scale(scale)
    check_video(target)
    require_gl()
    with contextlib.closing(plotter_of(size, True)) as plotter:
        moving = add_deflected(plotter, drawing, states[0], factor, colour)
        compose(plotter, moving, states, stops, title, size, view)
        images = []
        for state, instant in zip(states, instants, strict=True):
            moving.move(state)
            add_note(plotter, f"t = {instant * 1e3:.2f} ms;  {scale_note(factor, stops)}", size)
            plotter.render()
            images.append(plotter.screenshot(None, return_img=True))
    write_video(target, images, fps)
    return factor


# What is asked for


def named(path: str | os.PathLike[str], endings: tuple[str, ...]) -> Path:
    """The path, or RenderError where its name has another ending or its folder is missing."""
    target = Path(path)
    if target.suffix.lower() not in endings:
        raise RenderError(f"{target}: the name must end in {' or '.join(endings)}")
    if not target.parent.is_dir():
        raise RenderError(f"{target}: there is no folder {target.parent}")
    return target


def checked_states(component: AnyComponent, states: npt.ArrayLike, dimensions: int) -> FloatArray:
    """The states as (m, N) floats, or ModelError."""
    array = np.asarray(states, dtype=np.float64)
    count = len(component.free)
    source = component.source if isinstance(component, Several) else component.model.mesh.source
    if array.ndim != dimensions or array.shape[-1] != count or array.size == 0:
        raise ModelError(
            f"{source}: displacements to draw have shape {array.shape},"
            f" but the component has {count} degrees of freedom"
        )
    if not np.all(np.isfinite(array)):
        raise ModelError(f"{source}: displacements to draw are not all finite numbers")
    return array.reshape(-1, count)


def checked_times(times: npt.ArrayLike, count: int) -> FloatArray:
    """The instants as (m,) floats, or ModelError where there is not one for each state."""
    instants = np.asarray(times, dtype=np.float64)
    if instants.shape != (count,):
        raise ModelError(f"there are {count} states to draw, but times has shape {instants.shape}")
    return instants


def checked_scale(scale: float) -> float:
    """The scale as a float, or ModelError."""
    if not math.isfinite(scale):
        raise ModelError(f"scale must be a finite number, not {scale}")
    return float(scale)


def check_video(target: Path) -> None:
    """Raise RenderError where the file is to be an .mp4 and nothing here can write one."""
    if target.suffix.lower() == ".mp4" and importlib.util.find_spec("imageio_ffmpeg") is None:
        raise RenderError(
            f"{target}: writing .mp4 needs imageio-ffmpeg (pip install imageio-ffmpeg); "
            ".gif needs nothing more"
        )


# Scale and units


def extent(points: FloatArray) -> float:
    """Diagonal of the box around points (P, 3), in m."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def automatic_scale(
    drawing: Surface, states: FloatArray, stops: Sequence[StopSphere] = ()
) -> float:
    """A factor 1, 2 or 5 times a power of ten that makes the largest deflection visible.

    It is so small that the stops do not sink in far, see `largest_scale`.
    """
    at_rest, _ = drawing.place(np.zeros(states.shape[1]))
    largest = max(float(drawing.place(state)[1].max()) for state in states)
    if largest == 0.0:
        return 1.0
    visible = AUTO_FRACTION * extent(at_rest) / largest
    return round_number(min(visible, largest_scale(drawing, states, stops)))


def round_number(value: float) -> float:
    """The largest of 1, 2 or 5 times a power of ten that is not above a positive value.

    Examples
    --------
    >>> round_number(37.0), round_number(0.6), round_number(1e-3)
    (20.0, 0.5, 0.001)
    """
    power = math.floor(math.log10(value) + 1e-12)
    lead = max(step for step in (1, 2, 5) if step <= value / 10.0**power * (1 + 1e-9))
    return float(f"{lead}e{power}")


def quantity_unit(colour: str, largest: float) -> tuple[str, float]:
    """The unit of the bar of colours, and the factor on the quantity.

    Examples
    --------
    >>> quantity_unit("stress", 2.3e8)
    ('MPa', 1e-06)
    """
    if colour == "displacement":
        return length_unit(largest)
    if colour == "stress":
        units = (("MPa", 1e-6), ("kPa", 1e-3), ("Pa", 1.0))
        return next((u, f) for u, f in units if largest * f >= 0.1 or f == 1.0)
    return "N m", 1.0


def round_range(largest: float) -> tuple[float, int]:
    """The end of a bar of colours that reaches up to a value, and the parts its ticks cut it into.

    Examples
    --------
    >>> round_range(5.05), round_range(1.54e-3), round_range(0.0)
    ((6.0, 3), (0.002, 4), (1.0, 5))
    """
    if largest <= 0.0:
        return 1.0, 5
    power = 10.0 ** math.floor(math.log10(largest))
    for lead, parts in ((1, 5), (1.5, 3), (2, 4), (2.5, 5), (3, 3), (4, 4), (5, 5), (6, 3), (8, 4)):
        if largest <= lead * power * (1 + 1e-9):
            return float(f"{lead * power:.3g}"), parts
    return float(f"{10 * power:.3g}"), 5


def length_unit(largest: float) -> tuple[str, float]:
    """A unit in which a length in m reads well, and how many of it make a metre."""
    for unit, per_metre in (("m", 1.0), ("mm", 1e3), ("µm", 1e6)):
        if largest * per_metre >= 0.5:
            return unit, per_metre
    return ("nm", 1e9) if largest > 0.0 else ("mm", 1e3)


def scale_note(factor: float, stops: Sequence[StopSphere]) -> str:
    """What the picture says about its scale."""
    red = f";  red: stop{'s' if len(stops) > 1 else ''}" if stops else ""
    return f"deflection drawn × {factor:g};  grey: undeformed{red}"


# What is drawn


@dataclass(eq=False)
class Moving:
    """The deflected structure in a plotter; the only thing that changes from picture to picture."""

    drawing: Surface
    factor: float
    surface: Any
    edges: Any
    actor: Any
    blocks: Sequence[Mass] = ()
    stops: Sequence[tuple[StopBody, Any]] = ()  # with what pyvista draws of them
    colour: str = "displacement"
    factor_on_colour: float = 1.0
    largest: float = 0.0

    def move(self, u: FloatArray) -> None:
        """Draw another state."""
        points, _ = self.drawing.place(u, self.factor)
        self.surface.points[:] = points
        self.edges.points[:] = points
        values = surface_values(self.drawing, u, self.colour)
        self.surface.point_data["colour"][:] = values * self.factor_on_colour
        self.surface.Modified()
        self.edges.Modified()
        shape: Any = self.drawing.component.shape(u)
        for block in self.blocks:
            block.move(shape, self.factor)
        for body, actor in self.stops:
            shift = body.moved(self.drawing, u, self.factor)
            if shift is not None:
                actor.position = tuple(shift)

    def colour_by(self, factor: float, largest: float) -> int:
        """Set the factor on the colours and their range, 0 to about ``largest`` in SI units.

        How many parts the ticks of the bar cut it into is returned.
        """
        self.surface.point_data["colour"][:] *= factor / self.factor_on_colour
        self.factor_on_colour = factor
        return self.range_of(0.0, largest * factor)

    def range_of(self, low: float, high: float) -> int:
        """Set the range of the colours, up to a round number; the parts that ticks cut it into."""
        top, parts = round_range(high)
        self.actor.mapper.scalar_range = (low, top)
        return parts


@contextlib.contextmanager
def picture(
    target: Path | None,
    size: tuple[int, int],
    shape: tuple[int, int] | None = None,
    bar_row: float = 0.0,
) -> Iterator[Plotter]:
    """A plotter to draw in, which is then written and closed, or without a target left open."""
    with contextlib.ExitStack() as stack:
        off_screen = target is not None or not on_screen()
        plotter = stack.enter_context(
            contextlib.closing(plotter_of(size, off_screen or None, shape, bar_row))
        )
        yield plotter
        if target is None:
            stack.pop_all()
        else:
            write_image(target, plotter.screenshot(None, return_img=True))


def plotter_of(
    size: tuple[int, int],
    off_screen: bool | None,
    shape: tuple[int, int] | None = None,
    bar_row: float = 0.0,
) -> Plotter:
    """A white plotter, off-screen or as pyvista is set.

    With a shape (rows, columns) it has these fields and below them one for the bar of colours,
    ``bar_row`` times as high as the others.
    """
    import pyvista

    theme = pyvista.themes.DocumentTheme()
    theme.font.family = "arial"
    theme.font.color = TEXT
    theme.background = "white"
    layout: dict[str, Any] = {}
    if shape is not None:
        rows, columns = shape
        layout = {"shape": (rows + 1, columns), "row_weights": [1.0] * rows + [bar_row]}
        layout["groups"] = [(rows, slice(None))] if columns > 1 else None
    plotter = pyvista.Plotter(
        off_screen=off_screen, window_size=list(size), border=False, theme=theme, **layout
    )
    plotter.enable_anti_aliasing("ssaa")
    return plotter


def polydata(drawing: Surface, points: FloatArray) -> tuple[Any, Any]:
    """The surface and its sharp edges as pyvista meshes on the same points."""
    import pyvista

    def cells(arrays: list[Any]) -> Any:
        rows = [np.insert(array, 0, array.shape[1], axis=1).ravel() for array in arrays]
        return np.concatenate(rows)

    surface = pyvista.PolyData(points.copy(), faces=cells(drawing.faces()))
    edges = pyvista.PolyData(points.copy(), lines=cells(drawing.edges()))
    return surface, edges


def surface_of(component: AnyComponent, mirror: str | None = None) -> Surface:
    """The surface of one component or several; only one can be mirrored.

    Raises
    ------
    RenderError
        If what draws it is not installed.
    """
    require_library()
    if isinstance(component, Several):
        if mirror is not None:
            raise ModelError(f"{component.source}: several components are drawn without a mirror")
        parts = {name: structure_surface(part) for name, part in component.parts.items()}
        return SeveralSurfaces(component, parts)
    return structure_surface(component, mirror)


def add_deflected(
    plotter: Plotter,
    drawing: Surface,
    u: FloatArray,
    factor: float,
    colour: str = "displacement",
    cmap: str = COLOURS,
) -> Moving:
    """Draw the deflected structure and, in grey, the undeformed one."""
    rest, _ = drawing.place(np.zeros_like(u), shrinkage=GHOST_SHRINKAGE)
    ghost, ghost_edges = polydata(drawing, rest)
    pale = plotter.add_mesh(ghost, color=GHOST, opacity=0.16, lighting=False, show_scalar_bar=False)
    pale.mapper.resolve = "polygon_offset"
    pale.mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(*BEHIND)
    plotter.add_mesh(ghost_edges, color=GHOST, opacity=0.55, line_width=1.5)
    points, _ = drawing.place(u, factor)
    surface, edges = polydata(drawing, points)
    values = surface_values(drawing, u, colour)
    surface.point_data["colour"] = values
    actor = plotter.add_mesh(
        surface,
        scalars="colour",
        cmap=cmap,
        show_scalar_bar=False,
        ambient=0.35,
        diffuse=0.75,
        specular=0.1,
    )
    plotter.add_mesh(edges, color=TEXT, opacity=0.6, line_width=1.5)
    return Moving(
        drawing, factor, surface, edges, actor, colour=colour, largest=float(values.max())
    )


def compose(
    plotter: Plotter,
    moving: Moving,
    states: FloatArray,
    stops: Sequence[StopSphere],
    title: str,
    size: tuple[int, int],
    view: str,
) -> None:
    """Put everything around the deflected structure, with one range of colours for all states."""
    drawing = moving.drawing
    add_surroundings(plotter, moving, moving.factor, stops)
    keep_room(plotter, drawing, states, moving.factor)
    largest = max(float(surface_values(drawing, u, moving.colour).max()) for u in states)
    unit, on_colour = quantity_unit(moving.colour, largest)
    parts = moving.colour_by(on_colour, largest)
    moving.move(states[0])
    label = f"{colour_name(drawing, moving.colour)}, {unit}"
    add_scalar_bar(plotter, moving, label, *size, parts)
    add_text(plotter, title, "title", (0.5, 0.92), 1.4 * text_height(size[1]), size[0])
    rest, _ = drawing.place(np.zeros_like(states[0]))
    most = max(states, key=lambda u: float(drawing.place(u)[1].max()))
    fit_camera(plotter, size, axes_of_view(view, rest, drawing.place(most)[0] - rest))
    add_triad(plotter, size)


def add_note(plotter: Plotter, text: str, size: tuple[int, int]) -> None:
    """The line of small text below the title."""
    letters = 0.9 * text_height(size[1])
    add_text(plotter, text, "note", (0.5, 0.875), letters, size[0])


def add_surroundings(
    plotter: Plotter,
    moving: Moving,
    factor: float,
    stops: Sequence[StopSphere],
) -> None:
    """Draw supports, the stops off by ``factor`` times their gaps, and the masses."""
    marks, bodies, moving.blocks = surroundings(moving.drawing, factor, stops)
    for solid, plane in marks:
        if plane:
            plotter.add_mesh(solid, color=PLANE, opacity=0.25, lighting=False)
        else:
            add_solid(plotter, solid, STEEL)
    moving.stops = [
        (body, add_solid(plotter, body.solid, STOP, smooth=body.solid.n_cells > 100))
        for body in bodies
    ]
    for block in moving.blocks:
        add_solid(plotter, block.solid, BLOCK)


def surroundings(
    drawing: Surface, factor: float, stops: Sequence[StopSphere]
) -> tuple[list[tuple[Any, bool]], list[StopBody], list[Mass]]:
    """Marks of the supports, bodies of the stops with ``factor`` times the gap, and the masses."""
    bodies = [body for stop in stops for body in stop_bodies(drawing, stop, factor)]
    if not isinstance(drawing, SeveralSurfaces):
        marks, masses = part_surroundings(drawing, stops)
        return marks, bodies, [*masses]
    all_marks: list[tuple[Any, bool]] = []
    all_masses: list[Mass] = []
    for name, part in drawing.parts.items():
        marks, masses = part_surroundings(part, stops_at(name, stops))
        all_marks.extend(marks)
        all_masses.extend(OfPart(name, mass) for mass in masses)
    return all_marks, bodies, all_masses


def part_surroundings(
    drawing: StructureSurface, stops: Sequence[StopSphere]
) -> tuple[list[tuple[Any, bool]], list[Block]]:
    """The marks of the supports of one component, and its masses."""
    return list(support_marks(drawing)), mass_blocks(drawing, stops)


def add_solid(plotter: Plotter, solid: Any, colour: str, smooth: bool = False) -> Any:
    """Draw a solid body with its sharp edges; what pyvista draws is returned."""
    return plotter.add_mesh(
        solid,
        color=colour,
        ambient=0.35,
        diffuse=0.7,
        smooth_shading=smooth,
        split_sharp_edges=smooth,
    )


def keep_room(plotter: Plotter, drawing: Surface, states: FloatArray, factor: float) -> None:
    """Make the picture large enough for all states."""
    import pyvista

    boxes = [drawing.place(state, factor)[0] for state in states]
    low = np.min([points.min(axis=0) for points in boxes], axis=0)
    high = np.max([points.max(axis=0) for points in boxes], axis=0)
    plotter.add_mesh(pyvista.PolyData(np.array([low, high])), opacity=0.0, point_size=1.0)


def add_scalar_bar(
    plotter: Plotter, moving: Moving, title: str, width: int, height: int, parts: int
) -> None:
    """A horizontal bar of colours at the bottom of a field of this size, its title above it.

    Its ticks cut it into so many parts.
    """
    letters = 20.0 if height > 300 else 17.0
    plotter.add_scalar_bar(
        title=" ",
        mapper=moving.actor.mapper,
        n_labels=parts + 1,
        fmt="%.3g",
        position_x=0.30,
        position_y=8.0 / height,
        width=0.40,
        height=3.0 * letters / height,
        label_font_size=round(letters),
        color=TEXT,
    )
    add_text(plotter, title, "unit", (0.5, (8.0 + 3.4 * letters) / height), letters, width)


def text_height(height: float) -> float:
    """Size of letters in pixels for a field of this height."""
    return float(np.clip(0.028 * height, 17.0, 28.0))


def add_text(
    plotter: Plotter,
    text: str,
    name: str,
    where: tuple[float, float],
    letters: float,
    width: float,
) -> None:
    """Text at a place given in parts of the field, made smaller where it would not fit."""
    import pyvista

    fitting = min(letters, 1.75 * 0.94 * width / max(len(text), 1))
    label = pyvista.Text(text, position=where, name=name)
    label.prop.font_family = "arial"
    label.prop.font_size = max(round(fitting), 6)
    label.prop.color = TEXT
    label.prop.justification_horizontal = "center"
    label.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    plotter.add_actor(label, name=name, reset_camera=False, render=False)


def add_triad(plotter: Plotter, size: tuple[int, int]) -> None:
    """Axes x, y and z in a corner of a field of so many pixels, as they lie in the picture."""
    wide, high = TRIAD / size[0], TRIAD / size[1]
    plotter.add_axes(line_width=2, color=TEXT, viewport=(0.0, 0.0, wide, high), interactive=False)


def fit_camera(
    plotter: Plotter,
    size: tuple[int, int],
    axes: FloatArray,
    field: tuple[float, float, float] = FIELD,
) -> None:
    """Look at the structure along the last of three axes, without perspective, as large as fits."""
    right, up, back = axes
    box = np.array(plotter.bounds).reshape(3, 2)
    corners = np.stack(np.meshgrid(*box, indexing="ij"), axis=-1).reshape(-1, 3)
    across, above = corners @ right, corners @ up
    half_width, half_height = np.ptp(across) / 2, np.ptp(above) / 2
    low, high, wide = field
    scale = max(half_height / (high - low), half_width / wide * size[1] / size[0])
    centre = (across.max() + across.min()) / 2 * right + (above.max() + above.min()) / 2 * up
    centre = centre + corners.mean(axis=0) @ back * back
    focus = centre - (low + high - 1.0) * scale * up
    distance = 10.0 * float(np.linalg.norm(np.ptp(corners, axis=0)))
    plotter.camera_position = [tuple(focus + distance * back), tuple(focus), tuple(up)]
    plotter.enable_parallel_projection()
    plotter.camera.parallel_scale = scale
    plotter.reset_camera_clipping_range()


def add_mode(
    plotter: Plotter,
    drawing: Surface,
    mode: FloatArray,
    title: str,
    size: tuple[int, int],
    view: str,
    stops: Sequence[StopSphere],
) -> Moving:
    """One field of the sheet of modes."""
    rest, _ = drawing.place(np.zeros_like(mode))
    largest = float(drawing.place(mode)[1].max())
    unit = mode / largest if largest > 0.0 else mode
    factor = AUTO_FRACTION * extent(rest)
    moved = surface_moves(drawing, unit, rest)
    values, axis = signed_values(moved)
    moving = add_deflected(plotter, drawing, unit, factor, cmap=SIGNED_COLOURS)
    add_surroundings(plotter, moving, 1.0, stops)
    moving.move(unit)
    moving.surface.point_data["colour"][:] = values
    moving.range_of(-1.0, 1.0)
    add_text(plotter, f"{title}, along {axis}", "title", (0.5, 0.89), 22.0, size[0])
    fit_camera(plotter, size, axes_of_view(view, rest, moved), SHEET_FIELD)
    add_triad(plotter, size)
    return moving


def surface_moves(drawing: Surface, shape: FloatArray, rest: FloatArray) -> FloatArray:
    """How far a small multiple of a shape moves the points (p, 3), for the whole shape.

    Sections turn with the axis and are not stretched: so only small deflections are linear.
    """
    most = float(drawing.place(shape)[1].max(initial=0.0))
    if most == 0.0:
        return np.zeros_like(rest)
    small = SMALL * extent(rest) / most
    points, _ = drawing.place(shape, small)
    return np.asarray((points - rest) / small)


def signed_values(moved: FloatArray) -> tuple[FloatArray, str]:
    """Displacements (p,) along the axis along which most moves, over the largest; and that axis.

    Examples
    --------
    >>> signed_values(np.array([[0.0, 2.0, 0.1], [0.0, -4.0, 0.1]]))
    (array([ 0.5, -1. ]), 'y')
    """
    axis = int(np.argmax(np.linalg.norm(moved, axis=0)))
    along = moved[:, axis]
    return along / (np.abs(along).max(initial=0.0) or 1.0), "xyz"[axis]


def fields(count: int) -> tuple[int, int]:
    """Rows and columns of the sheet for a number of modes."""
    columns = 1 if count <= 3 else 2
    return math.ceil(count / columns), columns


# Files


def write_image(target: Path, image: Image) -> None:
    """Write a .png."""
    import imageio.v3 as iio

    with draft_of(target) as draft:
        iio.imwrite(draft, image)


def write_video(target: Path, images: Sequence[Image], fps: float) -> None:
    """Write a .gif that repeats without end, or an .mp4."""
    import imageio.v3 as iio

    with draft_of(target) as draft:
        if target.suffix.lower() == ".gif":
            iio.imwrite(draft, np.stack(images), duration=1000.0 / fps, loop=0)
        else:
            iio.imwrite(draft, np.stack(images), fps=fps, plugin="FFMPEG", macro_block_size=2)
