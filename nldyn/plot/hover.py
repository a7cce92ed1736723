"""Labels that appear where the pointer is, in windows and notebooks with live figures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import Event, MouseEvent
from matplotlib.text import Annotation

from nldyn.base.arrays import Real

REACH = 8.0  # pixels


def show_labels(ax: Axes, places: Real, label: Callable[[int], str]) -> None:
    """Let a label appear beside the place next to the pointer.

    It needs a figure that is told of the pointer: one of a window, or in a notebook one of
    ``%matplotlib widget``. In any other figure nothing is drawn.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Where the places are drawn.
    places : (n, 2) array
        Data coordinates; of several equally near the first is taken.
    label : callable
        Gives the text of a place by its number.

    Examples
    --------
    >>> from nldyn.plot.diagram import new_axes
    >>> ax = new_axes()
    >>> show_labels(ax, np.array([[0.5, 0.5]]), str)
    >>> len(ax.texts)
    0
    """
    figure = ax.get_figure(root=True)
    assert figure is not None
    notes: list[Annotation] = []
    shown = -1

    def follow(event: Event) -> None:
        nonlocal shown
        nearest = -1
        if isinstance(event, MouseEvent) and event.inaxes is ax:
            nearest = _nearest(ax.transData.transform(places), event.x, event.y)
        if nearest == shown:
            return
        shown = nearest
        if not notes:
            notes.append(_empty_label(ax))
        (note,) = notes
        note.set_visible(nearest >= 0)
        if nearest >= 0:
            note.xy = (float(places[nearest, 0]), float(places[nearest, 1]))
            note.set_text(label(nearest))
            _turn_inwards(note, ax, event)
        figure.canvas.draw_idle()

    figure.canvas.mpl_connect("motion_notify_event", follow)


def _empty_label(ax: Axes) -> Annotation:
    note = ax.annotate(
        "",
        (0.0, 0.0),
        (10.0, 10.0),
        textcoords="offset points",
        fontsize="small",
        bbox={"boxstyle": "round", "facecolor": "white", "edgecolor": "0.5", "alpha": 0.95},
        zorder=10,
        parse_math=False,
    )
    note.set_in_layout(False)
    return note


def _nearest(pixels: Real, x: float, y: float) -> int:
    """Number of the place within reach of a pixel, or -1."""
    if not len(pixels):
        return -1
    distance = np.hypot(pixels[:, 0] - x, pixels[:, 1] - y)
    best = int(np.argmin(distance))
    return best if distance[best] <= REACH else -1


def _turn_inwards(note: Annotation, ax: Axes, event: Event) -> None:
    """Put the label on the side of the pointer where there is more room."""
    assert isinstance(event, MouseEvent)
    box = ax.bbox
    right, high = event.x > box.x0 + 0.5 * box.width, event.y > box.y0 + 0.5 * box.height
    note.set_horizontalalignment("right" if right else "left")
    note.set_verticalalignment("top" if high else "bottom")
    note.set_position((-10.0 if right else 10.0, -10.0 if high else 10.0))
