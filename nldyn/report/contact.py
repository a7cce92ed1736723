"""The picture of where contact presses and wears, at the orbit that loses or presses most."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from nldyn.base.errors import SceneError
from nldyn.plot.contact import plot_friction_loss, plot_pressure, plot_wear_around
from nldyn.plot.diagram import file_figure
from nldyn.plot.words import Along
from nldyn.scene.contact import areas_found

if TYPE_CHECKING:
    from nldyn.orbits.orbit import Orbit
    from nldyn.scene.schema.scene import Scene
    from nldyn.search.diagram import Diagram

SIZE = 9.0, 3.4  # of each of its parts, in inches


def contact_figure(diagram: Diagram, scene: Scene | None = None) -> Figure | None:
    """Pressures and losses by friction at the points of areas, around rings, and by name.

    Parameters
    ----------
    diagram : Diagram
        Its orbit that loses most by friction per period of the excitation is drawn; where none
        does, the one whose contacts press hardest.
    scene : Scene, optional
        Tells where the points of areas are.

    Returns
    -------
    matplotlib.figure.Figure or None
        None where nothing slides and no area is touched.
    """
    nodes = [node for branch in diagram.branches for node in branch.nodes]
    system = nodes[0].orbit.system if nodes else None
    if system is None or not (system.areas or system.rubbing):
        return None
    slides = any(_lost(node.orbit) for node in nodes)
    if not (slides or system.areas):
        return None
    size = _lost if slides else _pressed
    node = max(nodes, key=lambda node: size(node.orbit))
    if size(node.orbit) == 0.0:
        return None
    parts = _parts(node.orbit, _where(scene))
    along = Along.of(diagram.parameter, max(map(abs, diagram.limits)), system)
    figure = file_figure(SIZE[0], SIZE[1] * len(parts))
    axes = figure.subplots(len(parts), squeeze=False)[:, 0].tolist()
    for part, ax in zip(parts, axes, strict=True):
        part(ax=ax)
        ax.set_title(ax.get_title() + along.beside(node.value), parse_math=False)
    return figure


def _parts(orbit: Orbit, where: dict[str, dict[str, Any]]) -> list[Callable[..., Axes]]:
    """What is drawn: areas, rings, and bars unless there is but one of these."""
    system = orbit.system
    sliding = [slider.stop for slider in system.rubbing]
    worn = [name for name, places in system.areas.items() if places[0] in sliding]
    rings = [stop for stop in system.round_stops if stop in sliding]
    parts: list[Callable[..., Axes]] = [
        partial(plot_pressure, orbit, name, **where.get(name, {})) for name in system.areas
    ]
    parts += [partial(plot_friction_loss, orbit, area=name, **where.get(name, {})) for name in worn]
    parts += [partial(plot_wear_around, orbit, stop) for stop in rings]
    others = len(sliding) - len(rings) - sum(len(system.areas[name]) for name in worn)
    if others or len(rings) + len(worn) > 1:
        parts.append(partial(plot_friction_loss, orbit))
    return parts


def png_of(figure: Figure | None) -> str:
    """A figure as PNG in base64; empty without one."""
    if figure is None:
        return ""
    file = io.BytesIO()
    figure.savefig(file, dpi=100, metadata={"Software": None})
    return base64.b64encode(file.getvalue()).decode("ascii")


def _lost(orbit: Orbit) -> float:
    """What an orbit loses by friction per excitation period."""
    return sum(each.loss for each in orbit.friction) / orbit.period


def _pressed(orbit: Orbit) -> float:
    """Its hardest contact."""
    return max((hit.force or 0.0 for hit in orbit.impact_list), default=0.0)


def _where(scene: Scene | None) -> dict[str, dict[str, Any]]:
    """Places and measures of the areas of a scene whose mesh is at hand."""
    if scene is None or not scene.contact_areas:
        return {}
    try:
        found = areas_found(scene)
    except SceneError:  # the mesh is not where the copy of the scene looks for it
        return {}
    return {
        table.called: {"places": each.places, "measure": each.measure}
        for table, each in zip(scene.contact_areas, found, strict=True)
    }
