"""Picture of what becomes of basins over a parameter."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from nldyn.base.errors import check_types
from nldyn.longterm.basin_shares import UNDECIDED_NAME, BasinsOver
from nldyn.plot.diagram import PERIOD_COLOURS, new_axes
from nldyn.plot.words import Along

GREY = "#999999"


def plot_basins_over(found: BasinsOver, ax: Axes | None = None) -> Axes:
    """Draw the share of a plane that leads to each motion, with its standard error.

    Parameters
    ----------
    found : BasinsOver
        What `nldyn.longterm.basins_over` gave.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    """
    check_types(found=(found, BasinsOver), ax=(ax, Axes, None))
    ax = ax if ax is not None else new_axes()
    systems = [a.flow.system for each in found.maps for a in each.attractors]
    largest = float(np.abs(found.values).max())
    along = Along.of(found.axis.parameter, largest, systems[0] if systems else None)
    x = np.array(found.values) / along.factor
    for index, (name, share) in enumerate(found.shares().items()):
        colour = PERIOD_COLOURS[index % len(PERIOD_COLOURS)]
        ax.errorbar(
            x, 100.0 * share, yerr=100.0 * found.uncertainty(share), marker="o", markersize=4.0,
            linewidth=1.0, capsize=2.0, color=GREY if name == UNDECIDED_NAME else colour,
            label=name,
        )  # fmt: skip
    ax.set_xlabel(along.label)
    ax.set_ylabel("share of initial states (%)")
    ax.set_ylim(-3.0, 103.0)
    ax.set_title(f"basins over {found.axis.told_held()}, forcing phase zero")
    ax.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return ax
