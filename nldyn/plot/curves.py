"""Draw curves in the plane of two parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from nldyn.base.errors import SystemModelError, check_types, shown
from nldyn.bifurcations.kinds import kind_of
from nldyn.curves.curves import Curve
from nldyn.plot.diagram import PERIOD_COLOURS, new_axes
from nldyn.plot.words import unit_in
from nldyn.system.chart import unit_within
from nldyn.system.parameters import Parameter
from nldyn.system.system import System

TITLES = {
    "frequency_hz": "excitation frequency",
    "stiffness": "contact stiffness",
    "exponent": "exponent of the contact law",
    "dashpot": "dashpot of a stop",
    "amplitude": "force amplitude",
    "mass_times_radius": "unbalance",
    "force": "constant force",
    "coefficient": "damper",
    "spring_stiffness": "spring",
    "modal_damping": "damping ratio",
    "natural_frequency_hz": "frequency of a mode",
    "spin_hz": "shaft speed",
    "speed_hz": "shaft speed and excitation frequency",
}
MONITOR_NAMES = {
    "peak_force": "constant peak force",
    "max_penetration": "constant penetration",
    "max_abs_displacement": "constant displacement",
}


def plot_curves(curves: Sequence[Curve], ax: Axes | None = None) -> Axes:
    """Draw curves in two parameters, with the points marked on them.

    Parameters
    ----------
    curves : sequence of Curve
        All in the same two parameters.
    ax : Axes, optional
        Where to draw; a new figure unless given.

    Returns
    -------
    Axes

    Raises
    ------
    SystemModelError
        If there are no curves, or not all in the same two parameters.
    """
    several = isinstance(curves, list | tuple) and len(curves) > 0
    if not several or not all(
        isinstance(c, Curve) and len(c.parameters) == 2 and c.parameters == curves[0].parameters
        for c in curves
    ):
        raise SystemModelError(
            f"plot_curves needs a list of curves in the same two parameters, got {shown(curves)}"
        )
    check_types(ax=(ax, Axes, None))
    ax = ax or new_axes(7.5, 5.0)
    everything = np.vstack([curve.values for curve in curves])
    scales, labels = [], []
    system = curves[0].points[0].orbit.system
    for parameter, values in zip(curves[0].parameters, everything.T, strict=True):
        scale, label = _scale_and_label(parameter, float(np.abs(values).max()), system)
        scales.append(scale)
        labels.append(label)
    kinds = list(dict.fromkeys(curve.kind for curve in curves))
    for curve in curves:
        colour = PERIOD_COLOURS[kinds.index(curve.kind) % len(PERIOD_COLOURS)]
        monitor, of, interface = curve.kind.partition(" of ")
        name = MONITOR_NAMES.get(monitor, kind_of(monitor).words) + of + interface
        first = curve is next(c for c in curves if c.kind == curve.kind)
        x, y = (curve.values * scales).T
        ax.plot(x, y, color=colour, lw=1.4, label=name if first else None)
        for mark in curve.marks:
            place = (float(mark.values[0] * scales[0]), float(mark.values[1] * scales[1]))
            ax.plot(*place, "o", color=colour, ms=4.5, zorder=3)
            ax.annotate(
                mark.kind, place, xytext=(5, 4), textcoords="offset points", size=8, color=colour
            )
    ax.set_xlabel(labels[0])
    ax.set_ylabel(labels[1])
    ax.legend(frameon=False)
    return ax


def _scale_and_label(parameter: Parameter, largest: float, system: System) -> tuple[float, str]:
    """Factor from SI to the unit drawn, and the label of an axis."""
    title, unit = TITLES.get(parameter.name, parameter.name), unit_within(system, parameter)
    if parameter.name == "gap":
        factor, unit = unit_in(unit, largest)
        return 1.0 / factor, f"{title} ({unit})"
    return 1.0, title if unit == "1" else f"{title} ({unit.replace('^exponent', '$^p$')})"
