"""Draw one orbit: displacement over time, phase portrait, spectrum, contact forces."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from nldyn.base.arrays import Real
from nldyn.base.errors import check_types, check_whole
from nldyn.orbits.harmonics import harmonics
from nldyn.orbits.orbit import Orbit, check_observe
from nldyn.plot.diagram import (
    PERIOD_COLOURS,
    STABLE,
    UNSTABLE,
    new_axes,
    orbit_title,
    stop_places,
)
from nldyn.plot.words import forces_of, told_of, unit_in
from nldyn.system.naming import stop_name

FLOOR = 1e-7  # amplitudes below this share of the largest are not shown


def plot_history(
    orbit: Orbit, ax: Axes | None = None, *, interface: str | None = None, samples: int = 4000
) -> Axes:
    """Draw the displacement of an interface over one period of an orbit.

    Parameters
    ----------
    orbit : Orbit
        A periodic orbit; an unstable one is drawn dotted.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    interface : str, optional
        The observed one unless given.
    samples : int
        Number of equal time steps; the instants of the contacts are drawn besides.

    Returns
    -------
    matplotlib.axes.Axes
        ``ax.figure.savefig(...)`` saves the picture.

    Raises
    ------
    SystemModelError
        For an unknown interface.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)])
    >>> ax = plot_history(solve_orbit(system, frequency_hz=25.3))
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('time (s)', 'displacement of middle (µm)')
    """
    name = _checked(orbit, ax, interface, samples)
    phases = drawn_phases(orbit, samples)
    y, _ = motion_at(orbit, name, phases)
    factor, unit = unit_in(orbit.system.unit(name), float(np.abs(y).max()))
    ax = _axes(ax, orbit)
    ax.axhline(0.0, color="0.6", linewidth=0.6)
    ax.plot(phases / orbit.omega, y / factor, **_style(orbit))
    for number, impact in enumerate(orbit.impact_list):
        label = "deepest contact" if number == 0 else None
        ax.axvline(impact.time, color="0.35", linewidth=0.8, linestyle="--", label=label)
    if orbit.impact_list:
        _draw_legend(ax)
    ax.set_xlabel("time (s)")
    ax.set_ylabel(f"{told_of(orbit.system, name)} ({unit})")
    return ax


def plot_phase_portrait(
    orbit: Orbit, ax: Axes | None = None, *, interface: str | None = None, samples: int = 4000
) -> Axes:
    """Draw the velocity of an interface against its displacement over one period of an orbit.

    The states at the start of each excitation period are marked, and the places of the stops
    between the interface and the ground.

    Parameters
    ----------
    orbit, ax, interface, samples
        As for `plot_history`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    SystemModelError
        For an unknown interface.
    """
    name = _checked(orbit, ax, interface, samples)
    y, speed = motion_at(orbit, name, drawn_phases(orbit, samples))
    measure = orbit.system.unit(name)
    factor, unit = unit_in(measure, float(np.abs(y).max()))
    pace, pace_unit = unit_in(measure, float(np.abs(speed).max()))
    ax = _axes(ax, orbit)
    ax.plot(y / factor, speed / pace, **_style(orbit))
    strobe = 2.0 * np.pi * np.arange(orbit.period, dtype=float)
    y, speed = motion_at(orbit, name, strobe)
    label = "start of an excitation period"
    ax.plot(y / factor, speed / pace, "o", color="black", markersize=5.0, label=label, zorder=4)
    for number, gap in enumerate(stop_places(orbit.system, name)):
        name_once = "stop" if number == 0 else None
        ax.axvline(gap / factor, color=PERIOD_COLOURS[1], linestyle="-.", label=name_once)
    _draw_legend(ax)
    ax.set_xlabel(f"{told_of(orbit.system, name)} ({unit})")
    ax.set_ylabel(f"velocity ({pace_unit}/s)")
    return ax


def plot_spectrum(
    orbit: Orbit, ax: Axes | None = None, *, interface: str | None = None, orders: int = 30
) -> Axes:
    """Draw the amplitudes of the displacement at the multiples of the orbit's frequency.

    Parameters
    ----------
    orbit, ax, interface
        As for `plot_history`.
    orders : int
        Highest multiple of the excitation frequency. Amplitudes below 1e-7 of the largest are not
        shown.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    SystemModelError
        For an unknown interface, or if `orders` is not a whole number of at least 1.
    """
    name = _checked(orbit, ax, interface)
    lines = harmonics(orbit, name, orders=orders)
    factor, unit = unit_in(orbit.system.unit(name), float(lines.amplitude.max()))
    height = lines.amplitude / factor
    shown = np.flatnonzero(height > FLOOR * height.max())
    floor = 0.5 * float(height[shown].min(initial=height.max())) or 1.0
    ax = _axes(ax, orbit)
    ax.set_yscale("log")
    harmonic = shown % orbit.period == 0
    kinds = [(harmonic, PERIOD_COLOURS[0], "multiple of the excitation frequency")]
    if orbit.period > 1:
        kinds.append((~harmonic, PERIOD_COLOURS[1], "other multiple of the orbit's frequency"))
    for chosen, colour, label in kinds:
        at = shown[chosen]
        hz, size = lines.frequency_hz[at], height[at]
        ax.vlines(hz, floor, size, color=colour, linewidth=1.2)
        ax.plot(hz, size, "o", color=colour, markersize=3.5, label=label)
    ax.set_ylim(floor, 3.0 * float(height.max()) or 10.0)
    ax.set_xlim(-0.02 * lines.frequency_hz[-1], 1.02 * lines.frequency_hz[-1])
    _draw_legend(ax)
    ax.set_xlabel("frequency (Hz)")
    ax.set_ylabel(f"amplitude of {name} ({unit})")
    return ax


def plot_contact_force(orbit: Orbit, ax: Axes | None = None, *, samples: int = 4000) -> Axes:
    """Draw the force of each stop over one period of an orbit.

    Parameters
    ----------
    orbit, ax, samples
        As for `plot_history`. The contacts are drawn through the nodes of the collocation, however
        short they are.

    Returns
    -------
    matplotlib.axes.Axes
    """
    _checked(orbit, ax, None, samples)
    phases = drawn_phases(orbit, samples)
    system = orbit.system
    forces = orbit.history_at(phases).force.T
    words, measure = forces_of(system)
    factor, unit = unit_in(measure, float(np.abs(forces).max(initial=0.0)))
    ax = _axes(ax, orbit)
    ax.axhline(0.0, color="0.6", linewidth=0.6)
    for row in range(len(system.stops)):
        colour = PERIOD_COLOURS[(row + 1) % len(PERIOD_COLOURS)]
        style = STABLE if orbit.stable else UNSTABLE
        ax.plot(
            phases / orbit.omega,
            forces[row] / factor,
            color=colour,
            linewidth=1.4,
            linestyle=style,
            label=stop_name(system, row),
        )
    if system.stops:
        _draw_legend(ax)
    ax.set_xlabel("time (s)")
    ax.set_ylabel(f"{words} ({unit})")
    return ax


def _checked(orbit: Orbit, ax: Axes | None, interface: str | None, samples: int = 1) -> str:
    """The interface to draw, after a look at the arguments that all these functions have."""
    check_types(orbit=(orbit, Orbit), ax=(ax, Axes, None), interface=(interface, str, None))
    check_whole("samples", samples, 1, 10**7)
    return check_observe(orbit.system, orbit.observe if interface is None else interface)


def drawn_phases(orbit: Orbit, samples: int) -> Real:
    """Equal steps of the phase over the orbit's period, with the nodes of its contacts."""
    end = 2.0 * np.pi * orbit.period
    nodes, _ = orbit.trajectory.contact_quadrature()
    within = nodes[(nodes > 0.0) & (nodes < end)]
    return np.unique(np.concatenate([np.linspace(0.0, end, samples + 1), within]))


def motion_at(orbit: Orbit, interface: str, phases: Real) -> tuple[Real, Real]:
    """Displacement and velocity of an interface at forcing phases."""
    return orbit.system.displacement(interface, orbit.states(phases), phases, orbit.omega)


def _axes(ax: Axes | None, orbit: Orbit) -> Axes:
    ax = ax if ax is not None else new_axes(9.5, 4.8)
    ax.set_title(orbit_title(orbit))
    return ax


def _draw_legend(ax: Axes) -> None:
    """Explain the lines, beside axes that are alone in their figure, else within them."""
    beside = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0)}
    ax.legend(fontsize="small", **(beside if len(ax.figure.axes) == 1 else {"loc": "best"}))


def _style(orbit: Orbit) -> dict[str, Any]:
    style = STABLE if orbit.stable else UNSTABLE
    return {"color": PERIOD_COLOURS[0], "linewidth": 1.4, "linestyle": style}
