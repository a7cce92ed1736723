"""Pictures of long-term behaviour: sections, diagrams by brute force, sweeps, basins."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import LogNorm, to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from nldyn.base.arrays import Real
from nldyn.base.errors import SystemModelError, check_choice, check_types, is_finite, numbers, shown
from nldyn.branches.branch import Branch, check_branches
from nldyn.longterm.basins import Basins, unit_of
from nldyn.longterm.impacts import units_where
from nldyn.longterm.measures import UNITS as MEASURE_UNITS
from nldyn.longterm.measures import SpectraMap
from nldyn.longterm.poincare import BruteForce, Column, impact_section, stroboscopic_section
from nldyn.longterm.simulation import Motion
from nldyn.orbits.history import told
from nldyn.orbits.orbit import check_observe, stroboscopic
from nldyn.plot.diagram import (
    PERIOD_COLOURS,
    STABLE,
    UNSTABLE,
    draw_legend,
    followed,
    new_axes,
    period_colours,
    plot_diagram,
    stability_runs,
)
from nldyn.plot.words import (
    Along,
    axis_unit,
    direction_of,
    displacement_of,
    told_of,
    unit_in,
    units_of,
)
from nldyn.search.diagram import Diagram
from nldyn.system.chart import parameter_name
from nldyn.system.system import System

KIND_COLOURS = {
    "periodic": "#222222",
    "quasi-periodic": "#0072b2",
    "chaotic": "#b03a00",
    "drifting": "#009e73",
    "undecided": "#999999",
}
BEHIND = "#9a9a9a"  # states where no motion begins
SHADE = "#e8c9a0"
Quantity = Literal["peak", "strobe", "impact speed", "impact phase"]
QUANTITIES = {
    "peak": "largest {}",
    "strobe": "{} at forcing phase zero",
    "impact speed": "impact speed",
    "impact phase": "forcing phase of impacts",
}
WEAR_MARKS = "o^sDv"  # of measures, in their order: all can be hollow
MOST_DECADES = 16  # beyond the digits of a number


def plot_section(
    motion: Motion,
    ax: Axes | None = None,
    *,
    interface: str | None = None,
    stop: int | None = None,
) -> Axes:
    """Draw velocity against displacement once per excitation period, or the impacts on a stop.

    Parameters
    ----------
    motion : Motion
        What `nldyn.simulate` gave, with a transient left out.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    interface : str, optional
        Of the stroboscopic section; the first unless given.
    stop : int, optional
        Index of a stop: speed against forcing phase of each impact on it is drawn instead.

    Raises
    ------
    SystemModelError
        For input that makes no sense.
    """
    check_types(ax=(ax, Axes, None))
    if stop is not None:
        return _plot_impacts(motion, ax, stop)
    y, v = stroboscopic_section(motion, interface)
    name = interface or motion.system.interfaces[0]
    measure = motion.system.unit(name)
    factor, unit = unit_in(measure, float(np.abs(y).max()))
    pace, pace_unit = unit_in(measure, float(np.abs(v).max()))
    ax = ax if ax is not None else new_axes(7.0, 5.5)
    ax.plot(y / factor, v / pace, ".", markersize=1.5, color="black")
    ax.set_xlabel(f"{told_of(motion.system, name)} ({unit})")
    ax.set_ylabel(f"velocity ({pace_unit}/s)")
    return ax


def _plot_impacts(motion: Motion, ax: Axes | None, stop: int) -> Axes:
    """Draw speed against forcing phase of the impacts on a stop."""
    phase, speed = impact_section(motion, stop)
    at = motion.system.stops[stop].at
    pace, unit = unit_in(motion.system.unit(at), float(speed.max(initial=0.0)))
    ax = ax if ax is not None else new_axes(7.0, 5.5)
    ax.plot(phase, speed / pace, ".", markersize=1.5, color="black")
    ax.set_xlabel(f"forcing phase of impacts on {at} (°)")
    ax.set_ylabel(f"impact speed ({unit}/s)")
    return ax


def plot_brute_force(
    found: BruteForce,
    ax: Axes | None = None,
    *,
    quantity: Quantity = "peak",
    diagram: Diagram | Iterable[Branch] | None = None,
    unit: str | None = None,
) -> Axes:
    """Draw what motions settle on against what changes, over the branches if they are given.

    The peak or the stroboscopic displacement of a periodic motion lies on the line of its branch;
    a motion of period n shows up to n values. Ranges with chaotic motions are shaded.

    Parameters
    ----------
    found : BruteForce
        What `nldyn.longterm.brute_force` gave.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    quantity : {"peak", "strobe", "impact speed", "impact phase"}
        The largest absolute displacement of each recorded period, the displacement at forcing
        phase zero, or speed or forcing phase of each impact on any stop.
    diagram : Diagram or iterable of Branch, optional
        Branches drawn below, in the same quantity; of peaks or stroboscopic displacements only.
    unit : str, optional
        m, mm, µm or nm, of a rotation rad, mrad, µrad or nrad, per second for a speed; chosen from
        the size unless given. A phase is in degrees.

    Raises
    ------
    SystemModelError
        For input that makes no sense, or branches that observe another interface.
    """
    check_types(
        found=(found, BruteForce), ax=(ax, Axes, None), quantity=(quantity, str),
        diagram=(diagram, Diagram, Iterable, None), unit=(unit, str, None),
    )  # fmt: skip
    check_choice("quantity", quantity, QUANTITIES)
    branches = _branches_of(found, quantity, diagram)
    along = followed(branches) if branches else _along(found)
    sizes = [np.abs(_values(c, quantity)).max(initial=0.0) for c in found.columns]
    words, measure = _observed(found, quantity)
    chosen = None if quantity == "impact phase" else unit
    factor, name = unit_in(measure, float(max(sizes, default=1.0)), chosen)
    ax = ax if ax is not None else new_axes()
    if branches and quantity == "peak":
        plot_diagram(branches, ax, special_points=(), unit=name, references=False)
    elif branches:
        _draw_strobes(ax, branches, found.observe, along, factor)
    shade_ranges(ax, [(a / along.factor, b / along.factor) for a, b in found.ranges()])
    handles = _draw_columns(ax, found, quantity, along, factor)
    before = ax.get_legend()
    if before is not None:
        handles = [*before.legend_handles, *handles]
    ax.legend(handles=handles, fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    ax.set_xlabel(along.label)
    ending = "/s" if quantity == "impact speed" else ""
    ax.set_ylabel(f"{QUANTITIES[quantity].format(words)} ({name}{ending})")
    return ax


def _along(found: BruteForce) -> Along:
    """How the values of columns are told."""
    largest = float(np.abs(found.values).max(initial=0.0))
    return Along.of(found.parameter, largest, _system_of(found))


def _system_of(found: BruteForce) -> System | None:
    """The system whose motions are drawn, if there are any."""
    return found.columns[0].attractor.flow.system if found.columns else None


def _observed(found: BruteForce, quantity: str) -> tuple[str, str]:
    """The observed displacement in words, and the unit of what is drawn, of a speed times s."""
    system = _system_of(found)
    if system is None:
        words, measure = displacement_of(found.observe), "m"
    elif quantity == "impact speed":
        words, measure = "", told(system.unit(stop.at) for stop in system.stops) or "m"
    else:
        words, measure = told_of(system, found.observe), system.unit(found.observe)
    return words, "°" if quantity == "impact phase" else measure


def _branches_of(
    found: BruteForce, quantity: str, diagram: Diagram | Iterable[Branch] | None
) -> list[Branch]:
    """Branches that can be drawn with the motions."""
    if diagram is None:
        return []
    if quantity not in ("peak", "strobe"):
        raise SystemModelError(f"diagram: branches have no {quantity} to draw")
    branches = list(diagram.branches if isinstance(diagram, Diagram) else diagram)
    check_branches("diagram", branches)
    for branch in branches:
        if branch.parameter != found.parameter:
            followed, changed = map(parameter_name, (branch.parameter, found.parameter))
            raise SystemModelError(
                f"diagram: a branch was followed in {followed}, the motions differ in {changed}"
            )
        observed = branch.nodes[0].orbit.observe
        if quantity == "peak" and observed != found.observe:
            raise SystemModelError(
                f"diagram: a branch observes '{observed}', the motions '{found.observe}'"
            )
    return branches


def _draw_columns(
    ax: Axes, found: BruteForce, quantity: str, along: Along, factor: float
) -> list[Any]:
    """Draw the values of all columns, and give the entries of the legend."""
    handles: list[Any] = []
    places = np.array(found.values) / along.factor
    for kind, colour in KIND_COLOURS.items():
        chosen = [k for k, c in enumerate(found.columns) if c.attractor.kind == kind]
        if chosen:
            values = [_values(found.columns[k], quantity) for k in chosen]
            x = np.repeat(places[chosen], [v.size for v in values])
            y = np.concatenate(values) / factor
            ax.plot(x, y, ".", markersize=1.2, color=colour, zorder=3)
            handles.append(
                Line2D([], [], marker=".", linestyle="none", color=colour, label=f"{kind} motion")
            )
    handles.append(Patch(color=SHADE, label="chaotic range"))
    return handles


def _values(column: Column, quantity: str) -> Real:
    """What is drawn of a column."""
    fields = {"strobe": column.strobe, "impact speed": column.impact_speed}
    fields |= {"peak": column.peaks, "impact phase": column.impact_phase_deg}
    return fields[quantity]


def strobe_curves(branch: Branch, interface: str) -> tuple[Real, Real, NDArray[np.bool_]]:
    """Values (k,), displacements (k, n) at forcing phase zero, and stability of a branch.

    The values are those of what changes along it, Hz for the frequency. A branch of period n has n
    displacements at each of its points.
    """
    orbits = branch.points
    name = check_observe(orbits[0].system, interface)
    values = []
    for orbit in orbits:
        modal = orbit.problem.flow.to_modal(stroboscopic(orbit))
        phases = np.zeros(len(modal))
        values.append(orbit.system.displacement(name, modal, phases, orbit.omega)[0])
    stable = np.array([orbit.stable for orbit in orbits], dtype=bool)
    return branch.values, np.array(values), stable


def _draw_strobes(
    ax: Axes, branches: Sequence[Branch], interface: str, along: Along, factor: float
) -> None:
    """Draw the stroboscopic displacements of branches in the style of a diagram."""
    colours = period_colours(branch.period for branch in branches)
    for branch in branches:
        places, values, stable = strobe_curves(branch, interface)
        for run in stability_runs(stable):
            part = slice(run.start, run.stop)
            style = STABLE if run.stable else UNSTABLE
            ax.plot(
                places[part] / along.factor, values[part] / factor,
                color=colours[branch.period], linewidth=1.4, linestyle=style,
            )  # fmt: skip
    draw_legend(ax, colours, branches, {})


def shade_ranges(ax: Axes, ranges: Sequence[tuple[float, float]], colour: str = SHADE) -> None:
    """Shade ranges of what changes, below everything else."""
    for low, high in ranges:
        ax.axvspan(low, high, color=colour, alpha=0.6, linewidth=0.0, zorder=0)


def plot_sweep(
    motions: Motion | Sequence[Motion],
    ax: Axes | None = None,
    *,
    interface: str | None = None,
    direction: str = "",
    diagram: Diagram | Iterable[Branch] | None = None,
) -> Axes:
    """Draw the largest displacement of each excitation period of run-ups and run-downs.

    Parameters
    ----------
    motions : Motion or sequence of Motion
        What `nldyn.sweep` gave.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    interface : str, optional
        The first unless given.
    direction : str
        Its direction: "rotation" and the like are drawn in rad.
    diagram : Diagram or iterable of Branch, optional
        Branches drawn below.

    Raises
    ------
    SystemModelError
        For input that makes no sense, or a motion shorter than an excitation period.
    """
    check_types(
        motions=(motions, Motion, Sequence), ax=(ax, Axes, None),
        diagram=(diagram, Diagram, Iterable, None),
    )  # fmt: skip
    listed = [motions] if isinstance(motions, Motion) else list(motions)
    if not listed:
        raise SystemModelError("motions must hold at least one motion, got an empty list")
    for k, motion in enumerate(listed):
        check_types(**{f"motions: entry {k}": (motion, Motion)})
    curves = [motion.period_peaks(interface) for motion in listed]
    for k, (hz, _) in enumerate(curves):
        if not hz.size:
            raise SystemModelError(f"motions: entry {k} is shorter than an excitation period")
    tallest = max(float(peaks.max(initial=0.0)) for _, peaks in curves)
    observed = interface or listed[0].system.interfaces[0]
    direction = direction_of(listed[0].system, observed, direction)
    factor, unit = axis_unit(tallest, units_of(direction))
    ax = ax if ax is not None else new_axes()
    if diagram is not None:
        branches = diagram if isinstance(diagram, Diagram) else list(diagram)
        plot_diagram(branches, ax, special_points=(), unit=unit, references=False)
    before = ax.get_legend()
    handles: list[Any] = list(before.legend_handles) if before is not None else []
    for motion, (hz, peaks) in zip(listed, curves, strict=True):
        colour, label = _sweep_style(motion)
        mark = "." if motion.rate_hz_per_s == 0.0 else ""  # a line of one frequency has no length
        handles += ax.plot(
            hz, peaks / factor, marker=mark, linewidth=0.8, color=colour, label=label
        )
    ax.legend(handles=handles, fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    ax.set_xlabel("excitation frequency (Hz)")
    ax.set_ylabel(f"largest {displacement_of(direction=direction)} in a period ({unit})")
    return ax


def _sweep_style(motion: Motion) -> tuple[str, str]:
    """Colour and name of a motion in a picture of sweeps."""
    rate = motion.rate_hz_per_s
    if rate == 0.0:
        hz = float(motion.frequency_hz(motion.start_time))
        return KIND_COLOURS["undecided"], f"constant {hz:.4g} Hz"
    up = rate > 0.0
    return PERIOD_COLOURS[1 if up else 2], f"run-{'up' if up else 'down'}, {abs(rate):.3g} Hz/s"


def plot_wear(
    table: Mapping[str, NDArray[Any]],
    ax: Axes | None = None,
    *,
    measures: Sequence[str] = ("peak_force", "rms_force"),
    yscale: Literal["linear", "log"] = "log",
) -> Axes:
    """Draw contact measures of attractors against the excitation frequency.

    Each kind of motion has a colour, each measure a mark, hollow where the orbit is unstable.

    Parameters
    ----------
    table : mapping of str to (k,) array
        What `nldyn.longterm.measures_table` gave.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    measures : sequence of str
        Columns of the table, up to five of one unit.
    yscale : {"linear", "log"}
        Scale of the measures; a logarithmic one cannot show zeros.

    Raises
    ------
    SystemModelError
        For input that makes no sense.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance
    >>> from nldyn.longterm import brute_force
    >>> from nldyn.longterm.measures import measures_table
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> table = measures_table(brute_force(system, (25.0, 26.0), points=3))
    >>> plot_wear(table, measures=["impact_power"]).get_ylabel()
    'impact power (W)'
    """
    check_types(
        table=(table, Mapping), ax=(ax, Axes, None), measures=(measures, Sequence),
        yscale=(yscale, str),
    )  # fmt: skip
    check_choice("yscale", yscale, ("linear", "log"))
    unit = _unit_of_measures(table, measures)
    ax = ax if ax is not None else new_axes()
    hz = np.asarray(table["frequency_hz"])
    stable = np.asarray(table["stable"], dtype=bool)
    kinds = np.array([_kind_of(str(name)) for name in table["attractor"]])
    for kind in dict.fromkeys(kinds.tolist()):
        colour = KIND_COLOURS.get(kind, "#009e73")
        for measure, mark in zip(measures, WEAR_MARKS, strict=False):
            values = np.asarray(table[measure])
            label: str | None = f"{kind}, {_spoken(measure)}"
            for here, face in ((stable, colour), (~stable, "white")):
                chosen = (kinds == kind) & here
                if chosen.any():
                    ax.plot(
                        hz[chosen], values[chosen], mark, markersize=3.0, color=colour,
                        markerfacecolor=face, label=label,
                    )  # fmt: skip
                    label = None
    if hz.size:
        ax.legend(fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    ax.set_yscale(yscale)
    ax.set_xlabel("excitation frequency (Hz)")
    what = _spoken(measures[0]) if len(measures) == 1 else _common(measures)
    ax.set_ylabel(f"{what} ({unit})")
    return ax


def _unit_of_measures(table: Mapping[str, Any], measures: Sequence[str]) -> str:
    """Common unit of columns of a table of contact measures."""
    columns = ("frequency_hz", "attractor", "stable", "rotation")
    known = [name for name in MEASURE_UNITS if name not in columns]
    for column in (*columns, *measures):
        if column in measures and column not in known:
            raise SystemModelError(f"measures must be of {', '.join(known)}, got {shown(column)}")
        if column not in table:
            raise SystemModelError(f"table has no column '{column}'")
    told_units = units_where(MEASURE_UNITS, np.asarray(table["rotation"], dtype=bool))
    units = {told_units[name] for name in measures}
    if isinstance(measures, str) or not 1 <= len(measures) <= len(WEAR_MARKS) or len(units) > 1:
        raise SystemModelError(
            f"measures must be one to {len(WEAR_MARKS)} names of one unit, got {shown(measures)}"
        )
    return units.pop()


def _kind_of(attractor: str) -> str:
    return "periodic" if attractor.startswith("period ") else attractor


def _spoken(measure: str) -> str:
    return measure.replace("_", " ").replace("rms", "r.m.s.")


def _common(measures: Sequence[str]) -> str:
    """What several measures are together."""
    forces = all(name.endswith("force") for name in measures)
    return "contact force" if forces else ", ".join(map(_spoken, measures))


def plot_spectra(
    found: SpectraMap,
    ax: Axes | None = None,
    *,
    scale: Literal["frequency", "order"] = "frequency",
    decades: float = 4.0,
    unit: str | None = None,
) -> Axes:
    """Draw spectra as a map over the excitation frequency and the frequency in the spectrum.

    Each motion fills a column as wide as half the ways to the frequencies beside it; where
    several motions have one frequency, they share it from left to right. In Hz multiples of the
    excitation frequency are rays and resonances lie level; in orders the multiples lie level.

    Parameters
    ----------
    found : SpectraMap
        What `nldyn.longterm.spectra_map` gave, of at least one motion.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    scale : {"frequency", "order"}
        What goes upwards: the frequency in the spectrum in Hz, or that over the excitation
        frequency.
    decades : float
        Range of the colours, down from the largest value; what is smaller has the lowest colour.
        The mean displacement is left out of the choice.
    unit : {"m", "mm", "µm", "nm"}, optional
        Of the displacements, or of rotations "rad", "mrad", "µrad" or "nrad"; chosen from the size
        unless given.

    Raises
    ------
    SystemModelError
        For input that makes no sense, or spectra of no motion or without any displacement.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance
    >>> from nldyn.longterm import brute_force, spectra_map
    >>> system = System.from_matrices([[2.48]], [[16877.0]], {"middle": [1.0]},
    ...     modal_damping=0.0142, stops=[Stop("middle", stiffness=5.17e9)],
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> found = spectra_map(brute_force(system, (25.0, 27.0), points=3, directions=["up"]))
    >>> plot_spectra(found).get_ylabel()
    'frequency in the spectrum (Hz)'
    """
    check_types(found=(found, SpectraMap), ax=(ax, Axes, None))
    check_choice("scale", scale, ("frequency", "order"))
    if not (is_finite(decades) and 0.0 < decades <= MOST_DECADES):
        raise SystemModelError(
            f"decades must lie above 0 and up to {MOST_DECADES}, got {shown(decades)}"
        )
    largest = float(found.rms[:, 1:].max(initial=0.0))
    if largest == 0.0:
        raise SystemModelError("found holds no motion with a displacement that changes")
    factor, name = unit_in(found.unit, largest, unit)
    ax = ax if ax is not None else new_axes()
    width = float(found.order[1] - found.order[0])
    edges = np.append(found.order - 0.5 * width, found.order[-1] + 0.5 * width)
    edges[0] = 0.0
    norm = LogNorm(largest / factor * 10.0**-decades, largest / factor, clip=True)
    lefts, rights = _column_ends(found.frequency_hz)
    heights = found.frequency_hz if scale == "frequency" else np.ones(lefts.size)
    for k, height in enumerate(heights):
        values = np.maximum(found.rms[k], 1e-300)[:, None] / factor
        image = ax.pcolormesh(
            [lefts[k], rights[k]], edges * height, values, norm=norm, cmap="magma", rasterized=True
        )
    what = displacement_of(direction="rotation" if found.unit == "rad" else "")
    ax.figure.colorbar(image, ax=ax, label=f"r.m.s. {what} in a band ({name})")
    ax.set_xlim(lefts.min(), rights.max())
    ax.set_ylim(0.0, float(edges[-1] * heights.max()))
    ax.set_facecolor("0.85")
    ax.set_xlabel("excitation frequency (Hz)")
    ax.set_ylabel(
        "frequency in the spectrum (Hz)" if scale == "frequency" else "order of the excitation"
    )
    return ax


def _column_ends(hz: Real) -> tuple[Real, Real]:
    """Left and right ends (k,) of columns around frequencies (k,), ascending; equal ones share.

    Examples
    --------
    >>> left, right = _column_ends(np.array([10.0, 12.0, 12.0]))
    >>> left.tolist(), right.tolist()
    ([9.0, 11.0, 12.0], [11.0, 12.0, 13.0])
    """
    begins = np.append(True, np.diff(hz) > 1e-9 * hz[1:])  # what differs by rounding is equal
    first, which = np.flatnonzero(begins), np.cumsum(begins) - 1
    places, counts = hz[first], np.bincount(which)
    middles = 0.5 * (places[1:] + places[:-1])
    below, above = (places[1] - places[0], places[-1] - places[-2]) if middles.size else (1.0, 1.0)
    ends = np.concatenate([[places[0] - 0.5 * below], middles, [places[-1] + 0.5 * above]])
    widths = np.diff(ends)[which] / counts[which]
    lefts = ends[which] + (np.arange(hz.size) - first[which]) * widths
    return lefts, lefts + widths


def plot_basins(
    found: Basins,
    ax: Axes | None = None,
    *,
    manifolds: Sequence[Real] = (),
    saddles: Real | None = None,
    times: bool = False,
) -> Axes:
    """Draw basins of attraction; the phases of a subharmonic in tints of its colour.

    Parameters
    ----------
    found : Basins
        What `nldyn.basins` gave.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    manifolds : sequence of (k, 2) arrays
        Curves or points drawn over them, in coordinates of the plane.
    saddles : (k, 2) array, optional
        Points marked with crosses.
    times : bool
        Darken the cells whose motions take long to settle.
    """
    check_types(
        found=(found, Basins), ax=(ax, Axes, None), manifolds=(manifolds, Sequence, np.ndarray),
        times=(times, bool),
    )  # fmt: skip
    manifolds = [_points(f"manifolds: entry {k}", curve) for k, curve in enumerate(manifolds)]
    saddles = None if saddles is None else _points("saddles", saddles)
    ax = ax if ax is not None else new_axes(9.5, 6.5)
    plane = found.plane
    image, handles = _coloured(found)
    if times:
        slow = np.log(np.maximum(found.periods, 1))
        slow -= slow.min()
        image *= (1.0 - 0.8 * slow / max(float(slow.max()), 1e-9))[..., None]
    ends = (*plane.x_range, *plane.y_range)
    ax.imshow(image, origin="lower", extent=ends, aspect="auto", interpolation="nearest")
    for curve in manifolds:
        ax.plot(curve[:, 0], curve[:, 1], color="black", linewidth=0.6)
    if len(manifolds):
        handles.append(Line2D([], [], color="black", linewidth=0.6, label="stable manifold"))
    for index in range(len(found.attractors)):
        points = found.points(index)
        periodic = found.attractors[index].orbit is not None
        style: dict[str, Any] = {"marker": "o", "markersize": 6.0} if periodic else {"marker": "."}
        ax.plot(*points.T, linestyle="none", color="white", markeredgecolor="black", **style)
    if saddles is not None and len(saddles):
        ax.plot(*saddles.T, "x", color="black", markersize=8.0, label="saddle")
        handles.append(Line2D([], [], marker="x", linestyle="none", color="black", label="saddle"))
    ax.set_xlim(plane.x_range)
    ax.set_ylim(plane.y_range)
    ax.set_xlabel(_scaled(ax.xaxis, plane.x_label, plane.x_range))
    ax.set_ylabel(_scaled(ax.yaxis, plane.y_label, plane.y_range))
    ax.set_title(f"basins at {found.frequency_hz:g} Hz, forcing phase zero")
    ax.legend(handles=handles, fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return ax


def _scaled(axis: Axis, label: str, ends: Sequence[float]) -> str:
    """Show an axis in m, rad, m/s or rad/s, by its label, in a unit of its size; else as it is."""
    told = re.search(r" \((m|rad)(/s)?\)$", label)
    if told is None:
        return label
    factor, name = unit_in(told[1], max(abs(float(end)) for end in ends))
    axis.set_major_formatter(lambda value, _: f"{value / factor:g}")
    return f"{label[: told.start()]} ({name}{told[2] or ''})"


def _points(name: str, given: Real) -> Real:
    """Points (k, 2) in the plane."""
    points = numbers(name, given)
    if points.size and (points.ndim != 2 or points.shape[1] != 2):
        raise SystemModelError(f"{name} must be points (k, 2), got shape {points.shape}")
    return points


def _coloured(found: Basins) -> tuple[Real, list[Any]]:
    """Colours (ny, nx, 3) of the cells, and entries of the legend."""
    image = np.ones((*found.labels.shape, 3))
    handles: list[Any] = []
    for index, basin in enumerate(found.basins):
        base = np.asarray(to_rgb(PERIOD_COLOURS[index % len(PERIOD_COLOURS)]), dtype=float)
        phases = max(basin.attractor.period, 1)
        largest = max(abs(value) for value in basin.attractor.span)
        text = basin.told(*unit_in(unit_of(basin.attractor), largest)).replace(" %, ", " %\n")
        if phases > 1:
            handles.append(Patch(color="none", label=text))
        for phase in range(phases):
            here = (found.labels == index) & (found.phases == phase)
            if not here.any():
                continue
            tint = base + (1.0 - base) * 0.75 * phase / phases
            image[here] = tint
            share = 100.0 * float(here[found.possible].mean())
            label = f"phase {phase}: {share:.1f} %" if phases > 1 else text
            handles.append(Patch(color=tuple(tint), label=label))
    if found.undecided:
        label = f"undecided: {100.0 * found.undecided:.1f} %"
        handles.append(Patch(facecolor="white", edgecolor="black", linewidth=0.5, label=label))
    if not found.possible.all():
        image[~found.possible] = to_rgb(BEHIND)
        handles.append(Patch(color=BEHIND, label="behind a rigid stop"))
    return image, handles
