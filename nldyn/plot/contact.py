"""Where contact presses and wears: at the points of an area, around a circle, by names."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from nldyn.base.arrays import Real
from nldyn.base.errors import (
    SystemModelError,
    check_choice,
    check_types,
    check_whole,
    numbers,
    shown,
)
from nldyn.flow.rigid_impacts import rigid_impacts, rubbed
from nldyn.orbits.orbit import Orbit
from nldyn.plot.diagram import PERIOD_COLOURS, new_axes, orbit_title
from nldyn.plot.words import unit_in
from nldyn.system.naming import slider_name, stop_name

PER = {"area": "/m²", "length": "/m", "node": ""}
STRAIGHT = 1e-6  # of their extent: how far off a line points may lie
ALIGNED = 1e-9  # 1 - cosine of the angle between a line and an axis of the mesh
MOST_BARS, ROOM = 20, 2  # bars that are drawn at most; for how many there is room at least
TWO_LINES = 6  # for how many bars at most names have room on two lines
SECTORS, INSTANTS = 72, 7200  # of a circle, and of an excitation period
ROLLS = 1e-9  # share of its speed at which what goes round does not slide, but for rounding


def plot_pressure(
    orbit: Orbit,
    area: str,
    ax: Axes | None = None,
    *,
    places: ArrayLike | None = None,
    measure: str | None = None,
) -> Axes:
    """Draw the largest and the mean pressure in a period at the points of an area of contact.

    Over the place along a straight line of points; of points that lie in a plane the largest
    pressure is told by colours.

    Parameters
    ----------
    orbit : Orbit
        A periodic orbit.
    area : str
        Name of the area, one of `System.areas`.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    places : (k,) or (k, 3) array_like, optional
        Where the points are in m: along a line, or in the mesh, as `fem.ContactPoints.places` has
        them; their numbers unless given.
    measure : {"area", "length", "node"}, optional
        What the weights of the points are, as `fem.ContactPoints.measure` says: m², m, or nothing.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    SystemModelError
        For an unknown area, or places that are not those of its points.

    Examples
    --------
    >>> from nldyn import HarmonicForce, System, contact_area, solve_orbit
    >>> system = System.from_modal([1.0], {"a": [1.0], "b": [0.5]}, modal_damping=0.1,
    ...     stops=contact_area("pads", ["a", "b"], 40.0, gap=[0.1, 0.1]),
    ...     excitation=[HarmonicForce("a", 10.0)])
    >>> ax = plot_pressure(solve_orbit(system, 0.7), "pads", places=[0.0, 0.2])
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('place (m)', 'force at a point (N)')
    """
    _check(orbit, ax, area, measure)
    found = next(each for each in orbit.areas if each.name == area)
    curves = {"largest in a period": found.pressure, "mean": found.mean_pressure}
    words = "force at a point" if _measure(orbit, area, measure) == "node" else "pressure"
    return _over_places(orbit, area, ax, places, curves, (words, "N", measure))


def plot_friction_loss(
    orbit: Orbit,
    ax: Axes | None = None,
    *,
    area: str | None = None,
    places: ArrayLike | None = None,
    measure: str | None = None,
) -> Axes:
    """Draw what friction dissipates in a period, where it wears.

    By bars for all that rubs, of an area of contact for all its points together; or, of one area,
    point by point as `plot_pressure` does.

    Parameters
    ----------
    orbit, ax, places, measure
        As for `plot_pressure`.
    area : str, optional
        Name of an area of contact, whose points are drawn.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    SystemModelError
        If nothing rubs, there or anywhere, or as for `plot_pressure`.

    Examples
    --------
    >>> from nldyn import HarmonicForce, System, solve_orbit
    >>> from nldyn.system import DryFriction
    >>> joint = [DryFriction(name, 1.0, 0.1) for name in ("x", "y")]
    >>> system = System.from_modal([1.0, 2.0], {"x": [1.0, 0.0], "y": [0.5, 1.0]},
    ...     modal_damping=0.05, dampers=joint, excitation=[HarmonicForce("x", 10.0)])
    >>> plot_friction_loss(solve_orbit(system, 0.7)).get_xlabel()
    'energy dissipated in a period (mJ)'
    """
    _check(orbit, ax, area, measure)
    lost = {each.slider.stop: each.loss for each in orbit.friction if each.slider.stop >= 0}
    if area is None:
        return _bars(orbit, ax)
    points = orbit.system.areas[area]
    if not lost.keys() >= set(points):
        raise SystemModelError(f"area '{area}' has no friction")
    weights = np.array([stop.share for stop in orbit.system.area_stops(area)])
    losses = np.array([lost[point] for point in points]) / weights
    words = "energy dissipated in a period"
    return _over_places(orbit, area, ax, places, {words: losses}, (words, "J", measure))


def plot_wear_around(orbit: Orbit, stop: int, ax: Axes | None = None) -> Axes:
    """Draw around a round clearance what friction dissipates in a period, in sectors of 5 degrees.

    The circle begins at its first direction and goes on to the second.

    Parameters
    ----------
    orbit : Orbit
        A periodic orbit.
    stop : int
        Which of `System.stops` the round clearance is.
    ax : matplotlib.axes.Axes, optional
        As for `plot_pressure`.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    SystemModelError
        If it is no round clearance with friction.

    Examples
    --------
    >>> from nldyn import RoundStop, System, Unbalance, solve_orbit
    >>> ring = RoundStop(("x", "y"), 2e6, 6e-4, 1.0, friction=0.05, surface_speed=5.0)
    >>> rotor = System.from_matrices([[10.0, 0.0], [0.0, 10.0]], [[4e5, 0.0], [0.0, 4e5]],
    ...     {"x": [1.0, 0.0], "y": [0.0, 1.0]}, modal_damping=0.1, stops=[ring],
    ...     excitation=[Unbalance("x", 2e-3), Unbalance("y", 2e-3, phase_deg=-90.0)])
    >>> plot_wear_around(solve_orbit(rotor, 28.0), 0).get_xlabel()
    'angle from x to y (°)'
    """
    _check(orbit, ax, None, None)
    system = orbit.system
    check_whole("stop", stop, 0)
    ring = system.round_stops.get(stop)
    if ring is None or ring.surface_speed is None:
        raise SystemModelError(f"stops[{stop}] is no round clearance with friction")
    count = INSTANTS * orbit.period
    phases = 2.0 * np.pi * orbit.period * np.arange(count) / count
    states = orbit.states(phases)
    at, pressed = system.round_polar(ring, states), orbit.history_at(phases, states).force[:, stop]
    slides = np.abs(at.sliding)
    slides[slides <= ROLLS * np.abs(at.sliding - ring.sliding_speed)] = 0.0
    lost = ring.friction * pressed * slides * orbit.duration / count
    normals = at.normal
    if ring.impulsive:
        hits = rigid_impacts(orbit.trajectory, stop)
        lost = np.concatenate([lost, ring.friction * rubbed(ring.friction, hits)])
        hit = system.round_polar(ring, orbit.states(hits.phase)).normal
        normals = np.concatenate([normals, hit])
    angles = np.degrees(np.arctan2(normals[:, 1], normals[:, 0]))
    values, edges = np.histogram(angles, bins=SECTORS, range=(-180.0, 180.0), weights=lost)
    factor, unit = unit_in("J", float(values.max()))
    ax = ax if ax is not None else new_axes(9.0, 4.0)
    ax.stairs(values / factor, edges, fill=True, color=PERIOD_COLOURS[0])
    ax.set_xticks(np.arange(-180.0, 181.0, 45.0))
    ax.set_xlim(-180.0, 180.0)
    ax.set_xlabel(f"angle from {ring.plane[0]} to {ring.plane[1]} (°)")
    ax.set_ylabel(f"energy dissipated in\na period, each 5° ({unit})")
    ax.set_title(f"{stop_name(system, stop)}, {orbit_title(orbit)}", parse_math=False)
    return ax


def _check(orbit: Orbit, ax: Axes | None, area: str | None, measure: str | None) -> None:
    check_types(
        orbit=(orbit, Orbit), ax=(ax, Axes, None), area=(area, str, None),
        measure=(measure, str, None),
    )  # fmt: skip
    if area is not None and area not in orbit.system.areas:
        known = ", ".join(orbit.system.areas) or "none"
        raise SystemModelError(f"area must be one of {known}, got {shown(area)}")
    if measure is not None:
        check_choice("measure", measure, tuple(PER))


def _measure(orbit: Orbit, area: str, given: str | None) -> str | None:
    """What the weights are: those of nodes are 1."""
    ones = all(stop.share == 1.0 for stop in orbit.system.area_stops(area))
    return "node" if given is None and ones else given


def _over_places(
    orbit: Orbit,
    area: str,
    ax: Axes | None,
    places: ArrayLike | None,
    curves: Mapping[str, Real],
    told: tuple[str, str, str | None],
) -> Axes:
    """Draw values of the points of an area over where they are: in words, of a unit, per what."""
    words, unit, given = told
    measure = _measure(orbit, area, given)
    factor, unit = unit_in(unit, max(float(values.max()) for values in curves.values()))
    label = f"{words} ({unit}{'/m or /m²' if measure is None else PER[measure]})"
    ax = ax if ax is not None else new_axes(9.0, 4.0)
    ax.set_title(f"'{area}', {orbit_title(orbit)}", parse_math=False)
    at, names = _coordinates(places, len(orbit.system.areas[area]))
    ax.set_xlabel(names[0])
    if len(names) == 2:
        values = next(iter(curves.values())) / factor
        marks = ax.scatter(at[:, 0], at[:, 1], c=values, s=40.0, vmin=0.0)
        ax.set_ylabel(names[1])
        ax.set_aspect("equal")
        ax.figure.colorbar(marks, ax=ax, label=label)
        return ax
    order = np.argsort(at[:, 0], kind="stable")
    for number, (name, values) in enumerate(curves.items()):
        colour = PERIOD_COLOURS[number]
        ax.plot(at[order, 0], values[order] / factor, ".-", color=colour, label=name)
    ax.set_ylabel(label)
    ax.set_ylim(bottom=0.0)
    if len(curves) > 1:
        ax.legend(fontsize="small")
    return ax


def _coordinates(places: ArrayLike | None, count: int) -> tuple[Real, tuple[str, ...]]:
    """Where points are, (k, 1) along a line or (k, 2) in a plane, and what that is called."""
    if places is None:
        return np.arange(1.0, count + 1.0)[:, None], ("number of the point",)
    at = numbers("places", places)
    if at.shape == (count,):
        return at[:, None], ("place (m)",)
    if at.shape != (count, 3):
        raise SystemModelError(f"places must be those of {count} points, got shape {at.shape}")
    beside = at - at.mean(axis=0)
    _, extents, axes = np.linalg.svd(beside, full_matrices=False)
    if extents[1] > STRAIGHT * extents[0]:
        flat = np.argsort(-np.ptp(at, axis=0), kind="stable")[:2]
        chosen = sorted(flat.tolist())
        return at[:, chosen], tuple(f"{'xyz'[axis]} (m)" for axis in chosen)
    axis = int(np.abs(axes[0]).argmax())
    if abs(axes[0, axis]) > 1.0 - ALIGNED:
        return at[:, axis : axis + 1], (f"{'xyz'[axis]} (m)",)
    along = beside @ axes[0] * np.sign(axes[0, axis])
    return (along - along.min())[:, None], ("distance along it (m)",)


def _bars(orbit: Orbit, ax: Axes | None) -> Axes:
    """A bar for each that rubs, the points of an area together, the largest first."""
    system, losses = orbit.system, dict[str, float]()
    inside = {place: name for name, places in system.areas.items() for place in places}
    for number, each in enumerate(orbit.friction):
        area = inside.get(each.slider.stop)
        name = f"'{area}', all points" if area else slider_name(system, number)
        losses[name] = losses.get(name, 0.0) + each.loss
    if not losses:
        raise SystemModelError("nothing rubs: there is no friction in this system")
    names = sorted(losses, key=lambda name: -losses[name])
    drawn, left = names[:MOST_BARS], len(names[MOST_BARS:])
    factor, unit = unit_in("J", max(losses.values()))
    ax = ax if ax is not None else new_axes(9.0, 1.6 + 0.35 * len(drawn))
    places, widths = range(len(drawn)), [losses[name] / factor for name in drawn]
    ax.barh(places, widths, color=PERIOD_COLOURS[0], height=0.6)
    then = ",\nstop at" if len(drawn) <= TWO_LINES else ", stop at"
    labels = [name.replace(", stop at", then) for name in drawn]
    ax.set_yticks(places, labels, parse_math=False)
    middle, half = (len(drawn) - 1) / 2.0, max(len(drawn), ROOM) / 2.0
    ax.set_ylim(middle + half, middle - half)  # the largest on top
    ax.set_xlabel(f"energy dissipated in a period ({unit})")
    ax.set_title(orbit_title(orbit) + (f", {left} more are smaller" if left else ""))
    return ax
