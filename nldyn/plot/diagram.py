"""Draw branches against the excitation frequency, and orbits over time."""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from nldyn.base.errors import SystemModelError, check_choice, check_types
from nldyn.bifurcations.kinds import KINDS, kind_of, title_of
from nldyn.branches.branch import check_branches
from nldyn.plot.hover import show_labels
from nldyn.plot.words import (
    ANGLES,
    LENGTHS,
    Along,
    axis_unit,
    direction_of,
    displacement_of,
    forces_of,
    units_of,
)
from nldyn.runtime.progress import in_notebook
from nldyn.system.chart import THE_FREQUENCY, parameter_name
from nldyn.system.naming import stop_name
from nldyn.system.round_stop import RoundStop

if TYPE_CHECKING:
    from nldyn.bifurcations.point import BranchNode, SpecialPoint
    from nldyn.branches.branch import Branch
    from nldyn.orbits.orbit import Orbit
    from nldyn.search.diagram import Diagram
    from nldyn.system.system import System

REFERENCE = "#8a5a00"  # of stops in diagrams
STABLE: Literal["-"] = "-"
UNSTABLE = (0.0, (1.0, 1.4))
# Okabe and Ito's colours, told apart by colour-blind readers; dark ones first.
PERIOD_COLOURS = (
    "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#5D4E9C", "#8B4513",
    "#777777",
)  # fmt: skip
# a legend beside a diagram
BESIDE: dict[str, Any] = {"fontsize": "small", "loc": "upper left", "bbox_to_anchor": (1.01, 1.0)}
MANY_MARKS = 60  # special points, of which only those beside stable orbits are marked
SVG_SALT = "nldyn"


@dataclass(frozen=True)
class Run:
    """Consecutive points ``start`` to ``stop - 1`` of a branch, to be drawn in one style."""

    start: int
    stop: int
    stable: bool


def stability_runs(stable: ArrayLike) -> list[Run]:
    """Split a branch into runs to be drawn as stable or unstable.

    Parameters
    ----------
    stable : (n,) array_like of bool
        Stability of each point.

    Returns
    -------
    list of Run
        They cover the branch without gaps: two neighbours share one point, the last one of the
        stable side, so that a stable line ends at a stable orbit.

    Examples
    --------
    >>> for run in stability_runs([True, True, False, True]):
    ...     print(run.start, run.stop, run.stable)
    0 2 True
    1 4 False
    3 4 True
    """
    flags = np.asarray(stable, dtype=bool)
    if flags.size == 0:
        return []
    changes = np.flatnonzero(flags[1:] != flags[:-1]) + 1
    edges = [0, *changes.tolist(), flags.size]
    runs = []
    for first, last in pairwise(edges):
        if flags[first]:
            runs.append(Run(first, last, True))
        else:
            runs.append(Run(max(first - 1, 0), min(last + 1, flags.size), False))
    return runs


def branch_curve(
    branch: Branch,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    """Give the curve to draw of a branch: its points, with the special points in between.

    Parameters
    ----------
    branch : Branch
        A branch.

    Returns
    -------
    values, max_abs_displacement, stable : (n,) arrays
        The parameter's values (Hz for the frequency) and m, in the order along the branch. A
        special point counts as stable if a neighbour is, so that the drawn stability changes at the
        special point itself.
    """
    located = _located(branch)
    x = np.array([node.value for node, _ in located], dtype=float)
    y = np.array([node.orbit.max_abs_displacement for node, _ in located], dtype=float)
    return x, y, np.array([stable for _, stable in located], dtype=bool)


def _located(branch: Branch) -> list[tuple[BranchNode, bool]]:
    """Points and special points in order along a branch, and how each counts; a place once."""
    special = [(each.point, beside_stable(branch, each)) for each in branch.special_points]
    taken = {point.arclength for point, _ in special}
    nodes = [(node, node.orbit.stable) for node in branch.nodes if node.arclength not in taken]
    return sorted([*nodes, *special], key=lambda entry: entry[0].arclength)


def beside_stable(branch: Branch, special: SpecialPoint) -> bool:
    """Whether a point next to a special point along its branch is stable."""
    lengths = [node.arclength for node in branch.nodes]
    after = int(np.searchsorted(lengths, special.point.arclength))
    return any(node.orbit.stable for node in branch.nodes[max(after - 1, 0) : after + 1])


def mark_size(count: int) -> float:
    """Choose the size of special points in points: the more there are, the smaller.

    Examples
    --------
    >>> mark_size(10), mark_size(1000)
    (4.5, 1.8)
    """
    return min(4.5, max(1.8, 35.0 / math.sqrt(max(count, 1))))


def period_name(period: int) -> str:
    """Name a branch by the period of its orbits: ``harmonic``, ``1/2 subharmonic``, ...

    Examples
    --------
    >>> period_name(3)
    '1/3 subharmonic'
    """
    return "harmonic" if period == 1 else f"1/{period} subharmonic"


def branch_kind(branch: Branch) -> str:
    """What a branch is called in a legend."""
    return "limit cycle" if are_limit_cycles([branch]) else period_name(branch.period)


def are_limit_cycles(branches: Sequence[Branch]) -> bool:
    """Whether branches are those of self-excited motions."""
    return bool(branches) and getattr(branches[0].nodes[0].orbit, "self_excited", False)


def orbit_title(orbit: Orbit, digits: int = 6) -> str:
    """Say of an orbit whether it is stable, its period and its frequency.

    Examples
    --------
    >>> from nldyn import System, Unbalance, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> orbit_title(solve_orbit(system, frequency_hz=10.0))
    'stable harmonic orbit at 10 Hz'
    """
    what = "limit cycle" if orbit.self_excited else f"{period_name(orbit.period)} orbit"
    name = f"{orbit.stability.verdict} {what}"
    return f"{name} at {orbit.frequency_hz:.{digits}g} Hz"


def plot_diagram(
    diagram: Diagram | Branch | Iterable[Branch],
    ax: Axes | None = None,
    *,
    yscale: Literal["linear", "log"] = "linear",
    special_points: Sequence[str] | None = None,
    unit: str | None = None,
    direction: str = "",
    references: bool = True,
    legend: bool = True,
    hover: bool = True,
) -> Axes:
    """Draw the largest displacement of each orbit against the frequency, or another parameter.

    Parameters
    ----------
    diagram : Diagram, Branch or iterable of Branch
        Branches to draw.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure unless given, which pyplot shows where it is in use.
    yscale : {"linear", "log"}
        Scale of the displacement axis.
    special_points : sequence of str, optional
        Kinds to mark: LP, PD, NS, BP, GR, CS, GS, AS or events; all unless given. Of more than
        60 points only those beside a stable orbit are marked, and the legend says how many of how
        many.
    unit : {"m", "mm", "µm", "nm"}, optional
        Unit of the displacement axis, or of a rotation "rad", "mrad", "µrad" or "nrad"; chosen by
        the largest value unless given.
    direction : str
        That of the interface, such as "y" or "rotation_z", for the words of the axis.
    references : bool
        Whether to draw where the interface meets its stops, and the natural frequencies without
        contact.
    legend : bool
        Whether to explain colours, lines and marks.
    hover : bool
        Whether orbits and special points show their numbers under the pointer, where the figure is
        live: in a window, or in a notebook after ``%matplotlib widget``, drawn in axes of pyplot.

    Returns
    -------
    matplotlib.axes.Axes
        ``ax.figure.savefig(...)`` saves the picture.

    Raises
    ------
    SystemModelError
        For what is no branch or no axes, or a scale, kind or unit that there is not.

    Examples
    --------
    >>> from nldyn import System, Unbalance, continue_branch, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> branch = continue_branch(solve_orbit(system, frequency_hz=10.0), (5.0, 20.0))
    >>> ax = plot_diagram([branch])
    >>> ax.get_ylabel()
    'largest displacement of middle (µm)'
    """
    several = getattr(diagram, "branches", diagram)
    branches = list(several if isinstance(several, Iterable) else [several])
    check_branches("diagram", branches)
    check_types(ax=(ax, Axes, None), special_points=(special_points, Sequence, None))
    check_choice("yscale", yscale, ("linear", "log"))
    along = followed(branches)
    every = dict.fromkeys([*KINDS, *(s.kind for b in branches for s in b.special_points)])
    for kind in special_points or ():
        check_choice("special_points", kind, tuple(every))
    ax = ax if ax is not None else new_axes()
    observed = observed_interface(branches)
    if observed:
        direction = direction_of(branches[0].nodes[0].orbit.system, observed, direction)
    factor, unit = _unit_of(branches, unit, direction)
    colours = period_colours(branch.period for branch in branches)
    for branch in branches:
        _draw_branch(ax, branch, colours[branch.period], along, factor)
    marked = marked_points(branches, every if special_points is None else special_points)
    size = mark_size(sum(len(points) for points in marked.values()))
    for kind, points in marked.items():
        _draw_marks(ax, points, kind, along, factor, size)
    ax.set_xlabel(along.label)
    ax.set_ylabel(f"largest {displacement_of(observed, direction)} ({unit})")
    ax.set_yscale(yscale)
    if yscale == "linear":
        ax.set_ylim(bottom=-0.02 * ax.get_ylim()[1])
    references = references and observed != ""
    lines = draw_references(ax, branches, along, factor, unit) if references else []
    if legend and branches:
        draw_legend(ax, colours, branches, marked, lines)
    if hover:
        _label_orbits(ax, branches, marked, along, factor, unit)
    return ax


def plot_frequency(diagram: Diagram, ax: Axes) -> Axes:
    """Draw the frequencies of self-excited motions against the parameter of a diagram."""
    along = followed(diagram.branches)
    for branch in diagram.branches:
        places, stable = zip(*_located(branch), strict=True)
        x = np.array([place.value for place in places]) / along.factor
        hz = np.array([place.orbit.frequency_hz for place in places])
        for run in stability_runs(stable):
            part = slice(run.start, run.stop)
            style = STABLE if run.stable else UNSTABLE
            ax.plot(x[part], hz[part], color=PERIOD_COLOURS[0], linewidth=1.4, linestyle=style)
    kinds = dict.fromkeys(s.kind for branch in diagram.branches for s in branch.special_points)
    for kind, points in marked_points(diagram.branches, kinds).items():
        at = [point.value / along.factor for point in points]
        ax.plot(at, [point.orbit.frequency_hz for point in points], **mark_style(kind))
    ax.set_xlabel(along.label)
    ax.set_ylabel("frequency (Hz)")
    ax.ticklabel_format(axis="y", useOffset=False)
    return ax


def followed(branches: Sequence[Branch]) -> Along:
    """What some branches were followed along, the frequency if there are none.

    Raises
    ------
    SystemModelError
        If they were followed in several.
    """
    parameters = list(dict.fromkeys(branch.parameter for branch in branches))
    if len(parameters) > 1:
        names = ", ".join(map(parameter_name, parameters))
        raise SystemModelError(f"the branches were followed in different parameters: {names}")
    if parameters in ([], [THE_FREQUENCY]):
        return Along(THE_FREQUENCY)
    largest = max(float(np.abs(each.values).max()) for each in branches)
    return Along.of(parameters[0], largest, branches[0].nodes[0].orbit.system)


def observed_interface(branches: Sequence[Branch]) -> str:
    """The interface whose displacement is drawn; empty if the branches have several."""
    places = {branch.nodes[0].orbit.observe for branch in branches}
    return places.pop() if len(places) == 1 else ""


def marked_points(
    branches: Sequence[Branch], kinds: Iterable[str], many: int = MANY_MARKS
) -> dict[str, list[SpecialPoint]]:
    """The special points to mark, by kind: all, or of many those beside a stable orbit."""
    all_points = [(branch, point) for branch in branches for point in branch.special_points]
    all_points = [pair for pair in all_points if pair[1].kind in kinds]
    if len(all_points) > many:
        all_points = [pair for pair in all_points if beside_stable(*pair)]
    found = {kind: [p for _, p in all_points if p.kind == kind] for kind in kinds}
    return {kind: points for kind, points in found.items() if points}


def draw_references(
    ax: Axes, branches: Sequence[Branch], along: Along, factor: float, unit: str
) -> list[Line2D]:
    """Draw stops of the observed interface and natural frequencies, as far as the axes reach.

    They change no limit of the axes. What changes along the branches is not drawn. Entries for a
    legend are given.
    """
    system, name = branches[0].nodes[0].orbit.system, branches[0].nodes[0].orbit.observe
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    gap: dict[str, Any] = {"color": REFERENCE, "linewidth": 0.9, "linestyle": "-."}
    linear: dict[str, Any] = {"color": "0.6", "linewidth": 0.9, "linestyle": (0, (5, 3))}
    entries = []
    stays = along.parameter.name != "gap"
    places = [place for place in stop_places(system, name) if stays]
    for place in sorted({abs(place) / factor for place in places}):
        if max(low, 0.0) < place < high:
            ax.axhline(place, zorder=1, **gap)
            entries.append(Line2D([], [], label=f"gap of a stop, {place:.4g} {unit}", **gap))
    natural = [hz for hz in system.frequencies_hz if along.in_frequency and left < hz < right]
    for hz in natural:
        ax.axvline(hz, zorder=1, **linear)
    if natural:
        told = ", ".join(f"{hz:.4g}" for hz in natural[:4]) + (", ..." if natural[4:] else "")
        entries.append(Line2D([], [], label=f"natural, no contact:\n{told} Hz", **linear))
    ax.set_xlim(left, right)
    ax.set_ylim(low, high)
    return entries


def plot_orbit(
    orbit: Orbit,
    axes: tuple[Axes, Axes] | None = None,
    *,
    direction: str = "",
    samples: int = 4000,
) -> tuple[Axes, Axes]:
    """Draw displacement and contact force of an orbit over one of its periods.

    Parameters
    ----------
    orbit : Orbit
        A periodic orbit.
    axes : pair of matplotlib.axes.Axes, optional
        Where to draw displacement and force; a new figure unless given.
    direction : str
        That of the observed interface, such as "y", for the words of the axis.
    samples : int
        Number of equal time steps.

    Returns
    -------
    pair of matplotlib.axes.Axes
        Those for the displacement and for the contact force. The instants of `Orbit.impact_list`,
        when contacts are deepest, are marked in both, also those of contacts too short for the
        samples; and where stops against the ground are that the orbit comes near.

    Examples
    --------
    >>> from nldyn import Stop, System, Unbalance, solve_orbit
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     stops=[Stop("middle", stiffness=5.17e9)], excitation=[Unbalance("middle", 4.92e-6)])
    >>> displacement, force = plot_orbit(solve_orbit(system, frequency_hz=25.3))
    >>> displacement.get_title()
    'stable harmonic orbit at 25.3 Hz'
    """
    history = orbit.history(samples)
    upper, lower = axes if axes is not None else new_axes_pair()
    places = stop_places(orbit.system, orbit.observe)
    direction = direction_of(orbit.system, orbit.observe, direction)
    words = displacement_of(orbit.observe, direction)
    y = history.displacement[orbit.observe]
    _draw_displacement(upper, history.time, y, places, words, units_of(direction))
    upper.tick_params(labelbottom=True)
    _draw_forces(lower, history.time, history.force, orbit.system)
    _mark_deepest((upper, lower), [impact.time for impact in orbit.impact_list])
    upper.set_title(orbit_title(orbit))
    lower.set_xlabel("time (s)")
    return upper, lower


def stop_places(system: System, interface: str) -> list[float]:
    """Displacements in m, or rad, at which an interface meets its stops against the ground.

    Examples
    --------
    >>> from nldyn import Stop, System
    >>> stops = [Stop("m", 1e9, gap=2e-3, direction=d) for d in (1, -1)]
    >>> stop_places(System.from_modal([13.1], {"m": [0.635]}, stops=stops), "m")
    [-0.002, 0.002]
    """
    flat = [stop for stop in system.stops if not isinstance(stop, RoundStop)]
    ours = [stop for stop in flat if stop.at == interface and stop.against is None]
    return sorted({stop.direction * stop.gap for stop in ours})


def save_diagram(
    diagram: Diagram,
    directory: str | Path,
    *,
    title: str = "",
    direction: str = "",
    yscale: Literal["linear", "log"] = "linear",
) -> None:
    """Write ``diagram.png`` and ``diagram.svg`` to a directory that exists.

    Of self-excited motions the frequency stands below.
    """
    if are_limit_cycles(diagram.branches):
        ax, below = file_figure(10.5, 8.0).subplots(2, 1, sharex=True, height_ratios=[2, 1])
        plot_frequency(diagram, below)
    else:
        ax = file_axes()
    plot_diagram(diagram, ax, direction=direction, yscale=yscale)
    ax.label_outer()
    ax.set_title(title, parse_math=False)
    save_figure(ax, Path(directory) / "diagram")


def save_figure(ax: Axes, stem: Path) -> None:
    """Write the figure of some axes as ``stem.png`` and ``stem.svg``, the same on every run."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    with mpl.rc_context({"svg.hashsalt": SVG_SALT}):
        figure.savefig(stem.with_suffix(".png"), dpi=150)
        figure.savefig(stem.with_suffix(".svg"), metadata={"Date": None})


def new_axes(width: float = 10.5, height: float = 5.5) -> Axes:
    """Make the axes of a new figure, in inches, see `new_figure`."""
    return new_figure(width, height).add_subplot()


def file_axes(width: float = 10.5, height: float = 5.5) -> Axes:
    """Make the axes of a figure for a file, in inches, that is shown nowhere."""
    return file_figure(width, height).add_subplot()


def new_figure(width: float, height: float) -> Figure:
    """Make a figure that pyplot shows where it is in use, as in a notebook; else one of its own."""
    pyplot = sys.modules.get("matplotlib.pyplot")
    if pyplot is None and in_notebook():
        pyplot = importlib.import_module("matplotlib.pyplot")
    if pyplot is None:
        return file_figure(width, height)
    figure: Figure = pyplot.figure(figsize=(width, height), layout="constrained")
    return figure


def file_figure(width: float, height: float) -> Figure:
    """Make a figure for a file, in inches, that is shown nowhere."""
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def new_axes_pair(width: float = 9.0, height: float = 6.0) -> tuple[Axes, Axes]:
    """Make two axes one above the other that share the time axis."""
    figure = new_figure(width, height)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
    return upper, lower


def period_colours(periods: Iterable[int]) -> dict[int, str]:
    """Give each period its colour: the same for 1, 2 and 3 in every picture."""
    present = sorted(set(periods) | {1, 2, 3})
    return {p: PERIOD_COLOURS[i % len(PERIOD_COLOURS)] for i, p in enumerate(present)}


def _draw_branch(ax: Axes, branch: Branch, colour: str, along: Along, factor: float) -> None:
    x, y, stable = branch_curve(branch)
    for run in stability_runs(stable):
        part = slice(run.start, run.stop)
        style = STABLE if run.stable else UNSTABLE
        drawn = x[part] / along.factor, y[part] / factor
        ax.plot(*drawn, color=colour, linewidth=1.4, linestyle=style)


def _draw_marks(
    ax: Axes, points: Sequence[SpecialPoint], kind: str, along: Along, factor: float, size: float
) -> None:
    x = [float(point.value) / along.factor for point in points]
    y = [float(point.orbit.max_abs_displacement) / factor for point in points]
    ax.plot(x, y, **mark_style(kind, size))


def mark_style(kind: str, size: float = 4.5) -> dict[str, Any]:
    """How special points of a kind are drawn: arguments of `Axes.plot`.

    Examples
    --------
    >>> mark_style("PD")["marker"]
    's'
    """
    return {
        "linestyle": "none",
        "marker": kind_of(kind).marker,
        "markersize": size,
        "markerfacecolor": "white",
        "markeredgecolor": "black",
        "markeredgewidth": 0.18 * size,
        "zorder": 4,
    }


def _label_orbits(
    ax: Axes,
    branches: Sequence[Branch],
    marked: Iterable[str],
    along: Along,
    factor: float,
    unit: str,
) -> None:
    """Let special points, which come first, and points show what they are."""
    entries = [
        (branch.name, title_of(special.kind), special.point)
        for branch in branches
        for special in branch.special_points
        if special.kind in marked
    ]
    count = len(entries)  # at the special points stability changes
    entries += [
        (branch.name, f"point {number}", node)
        for branch in branches
        for number, node in enumerate(branch.nodes)
    ]
    places = [
        (node.value / along.factor, node.orbit.max_abs_displacement / factor)
        for _, _, node in entries
    ]

    def label(index: int) -> str:
        name, what, node = entries[index]
        orbit = node.orbit
        title, where = f"{name or period_name(orbit.period)}, {what}", along.told(node.value, 7)
        return f"{title}\n{orbit_text(orbit, where, factor, unit, stability=index >= count)}"

    show_labels(ax, np.array(places, dtype=float).reshape(-1, 2), label)


def orbit_text(
    orbit: Orbit, where: str, factor: float, unit: str, *, stability: bool = True
) -> str:
    """Say in two lines what an orbit is, with displacements in a unit of `factor` metres."""
    word = ("stable, " if orbit.stable else "unstable, ") if stability else ""
    impacts = f"{orbit.impacts} impact{'' if orbit.impacts == 1 else 's'}"
    return (
        f"{where}, largest {orbit.max_abs_displacement / factor:.5g} {unit}\n"
        f"{word}largest multiplier {abs(orbit.largest_multiplier):.4g}, {impacts}"
    )


def draw_legend(
    ax: Axes,
    colours: dict[int, str],
    branches: Sequence[Branch],
    marked: Mapping[str, Sequence[SpecialPoint]],
    others: Sequence[Line2D] = (),
) -> None:
    """Explain colours, lines and special points as far as they are drawn, and then other lines."""
    named = {branch.period: branch_kind(branch) for branch in branches}
    entries = [Line2D([], [], color=colours[p], label=named[p]) for p in sorted(named)]
    runs = [run for b in branches for run in stability_runs([stable for _, stable in _located(b)])]
    drawn = {run.stable for run in runs if run.stop - run.start > 1}
    if True in drawn:
        entries.append(Line2D([], [], color="0.3", linestyle=STABLE, label="stable"))
    if False in drawn:
        entries.append(Line2D([], [], color="0.3", linestyle=UNSTABLE, label="unstable"))
    for kind, points in marked.items():
        count = sum(p.kind == kind for branch in branches for p in branch.special_points)
        shown = f", {len(points)} of {count}" if len(points) < count else ""
        entries.append(Line2D([], [], label=title_of(kind) + shown, **mark_style(kind)))
    ax.legend(handles=[*entries, *others], **BESIDE)


def _draw_displacement(
    ax: Axes,
    time: NDArray[np.float64],
    y: NDArray[np.float64],
    places: Sequence[float],
    words: str,
    units: Sequence[tuple[float, str]],
) -> None:
    """Draw it with those of the stops that are neither at zero, where a line is, nor far off."""
    reach = float(np.abs(y).max())
    factor, unit = axis_unit(reach, units)
    ax.axhline(0.0, color="0.6", linewidth=0.6)
    ax.plot(time, y / factor, color=PERIOD_COLOURS[0], linewidth=1.4)
    shown = [place for place in places if 0.0 < abs(place) <= 1.5 * reach]
    for number, place in enumerate(shown):
        label = "stop" if number == 0 else None
        ax.axhline(place / factor, color=PERIOD_COLOURS[1], linestyle="-.", label=label)
    ax.set_ylabel(f"{words} ({unit})")


def _draw_forces(
    ax: Axes, time: NDArray[np.float64], forces: NDArray[np.float64], system: System
) -> None:
    count = len(system.stops)
    for number in range(count):
        colour = PERIOD_COLOURS[(number + 1) % len(PERIOD_COLOURS)]
        label = stop_name(system, number)
        ax.plot(time, forces[:, number], color=colour, linewidth=1.2, label=label)
    ax.set_ylabel("{} ({})".format(*forces_of(system)))
    ax.set_ylim(bottom=0.0)
    if count > 1:
        ax.legend(fontsize="small", loc="upper right")


def _mark_deepest(axes: Sequence[Axes], times: Sequence[float]) -> None:
    for ax in axes:
        for number, instant in enumerate(times):
            label = "deepest contact" if number == 0 else None
            ax.axvline(instant, color="0.35", linewidth=0.8, linestyle="--", label=label)
    if axes[0].get_legend_handles_labels()[0]:
        axes[0].legend(fontsize="small", loc="upper right")


def _unit_of(branches: Sequence[Branch], unit: str | None, direction: str) -> tuple[float, str]:
    if unit is None:
        largest = [float(np.max(b.max_abs_displacement)) for b in branches if len(b.points)]
        return axis_unit(max(largest, default=1.0), units_of(direction))
    units = (*LENGTHS, *ANGLES)
    check_choice("unit", unit, (name for _, name in units))
    return next(prefix for prefix in units if prefix[1] == unit)
