"""Pictures of long-term behaviour: sections, diagrams by brute force, sweeps, basins."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from nldyn.attractors import Attractor
from nldyn.basin_maps import UNDECIDED, Basins
from nldyn.branch import Branch
from nldyn.diagrams import Diagram
from nldyn.errors import SystemModelError, check_types, shown
from nldyn.linear import Real
from nldyn.plot import PERIOD_COLOURS, length_unit, new_axes, plot_diagram
from nldyn.sections import BruteForce, Column, stroboscopic_section
from nldyn.simulation import Motion
from nldyn.system import numbers

KIND_COLOURS = {
    "periodic": "#222222",
    "quasi-periodic": "#0072b2",
    "chaotic": "#b03a00",
    "drifting": "#009e73",
    "undecided": "#999999",
}
SHADE = "#e8c9a0"
UNITS = {"m": 1.0, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9}


def plot_section(motion: Motion, ax: Axes | None = None, *, interface: str | None = None) -> Axes:
    """Draw velocity against displacement once per excitation period.

    Parameters
    ----------
    motion : Motion
        What `nldyn.simulate` gave, with a transient left out.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure, free of pyplot, unless given.
    interface : str, optional
        The first unless given.
    """
    check_types(ax=(ax, Axes, None))
    y, v = stroboscopic_section(motion, interface)
    name = interface or motion.system.interfaces[0]
    factor, unit = length_unit(float(np.abs(y).max()))
    pace, pace_unit = length_unit(float(np.abs(v).max()))
    ax = ax if ax is not None else new_axes(7.0, 5.5)
    ax.plot(y / factor, v / pace, ".", markersize=1.5, color="black")
    ax.set_xlabel(f"displacement of {name} ({unit})")
    ax.set_ylabel(f"velocity ({pace_unit}/s)")
    return ax


def plot_brute_force(
    found: BruteForce,
    ax: Axes | None = None,
    *,
    diagram: Diagram | Iterable[Branch] | None = None,
    unit: str | None = None,
) -> Axes:
    """Draw the largest displacement of every recorded period, over the branches if they are given.

    The largest value of a periodic motion lies on the line of its branch; a motion of period n
    shows up to n values. Ranges with chaotic motions are shaded.

    Parameters
    ----------
    found : BruteForce
        What `nldyn.brute_force` gave.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure, free of pyplot, unless given.
    diagram : Diagram or iterable of Branch, optional
        Branches drawn below.
    unit : str, optional
        m, mm, µm or nm; chosen from the size unless given.
    """
    check_types(
        found=(found, BruteForce), ax=(ax, Axes, None), diagram=(diagram, Diagram, Iterable, None),
        unit=(unit, str, None),
    )  # fmt: skip
    if unit is not None and unit not in UNITS:
        raise SystemModelError(f"unit must be one of {', '.join(UNITS)}, got {shown(unit)}")
    largest = max((float(c.peaks.max(initial=0.0)) for c in found.columns), default=1.0)
    factor, name = length_unit(largest)
    if unit is not None:
        factor, name = UNITS[unit], unit
    ax = ax if ax is not None else new_axes()
    if diagram is not None:
        branches = diagram if isinstance(diagram, Diagram) else list(diagram)
        plot_diagram(branches, ax, special_points=(), unit=name)
    shade_ranges(ax, found.ranges())
    handles: list[Any] = []
    for kind, colour in KIND_COLOURS.items():
        chosen = [c for c in found.columns if c.attractor.kind == kind]
        if chosen:
            hz, values = _scattered(chosen)
            ax.plot(hz, values / factor, ".", markersize=1.2, color=colour, zorder=3)
            handles.append(
                Line2D([], [], marker=".", linestyle="none", color=colour, label=f"{kind} motion")
            )
    handles.append(Patch(color=SHADE, label="chaotic range"))
    before = ax.get_legend()
    if before is not None:
        handles = [*before.legend_handles, *handles]
    ax.legend(handles=handles, fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    ax.set_xlabel("excitation frequency (Hz)")
    ax.set_ylabel(f"largest displacement of {found.observe} ({name})")
    return ax


def shade_ranges(ax: Axes, ranges: Sequence[tuple[float, float]], colour: str = SHADE) -> None:
    """Shade ranges of frequencies, below everything else."""
    for low, high in ranges:
        ax.axvspan(low, high, color=colour, alpha=0.6, linewidth=0.0, zorder=0)


def _scattered(columns: Iterable[Column]) -> tuple[Real, Real]:
    columns = list(columns)
    hz = np.concatenate([np.full(c.peaks.size, c.frequency_hz) for c in columns])
    return hz, np.concatenate([c.peaks for c in columns])


def plot_sweep(
    motions: Motion | Sequence[Motion],
    ax: Axes | None = None,
    *,
    interface: str | None = None,
    diagram: Diagram | Iterable[Branch] | None = None,
) -> Axes:
    """Draw the largest displacement of each excitation period of run-ups and run-downs.

    Parameters
    ----------
    motions : Motion or sequence of Motion
        What `nldyn.sweep` gave.
    ax : matplotlib.axes.Axes, optional
        Where to draw; a new figure, free of pyplot, unless given.
    interface : str, optional
        The first unless given.
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
    factor, unit = length_unit(max(float(peaks.max(initial=0.0)) for _, peaks in curves))
    ax = ax if ax is not None else new_axes()
    if diagram is not None:
        branches = diagram if isinstance(diagram, Diagram) else list(diagram)
        plot_diagram(branches, ax, special_points=(), unit=unit)
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
    ax.set_ylabel(f"largest displacement in a period ({unit})")
    return ax


def _sweep_style(motion: Motion) -> tuple[str, str]:
    """Colour and name of a motion in a picture of sweeps."""
    rate = motion.rate_hz_per_s
    if rate == 0.0:
        hz = float(motion.frequency_hz(motion.start_time))
        return KIND_COLOURS["undecided"], f"constant {hz:.4g} Hz"
    up = rate > 0.0
    return PERIOD_COLOURS[1 if up else 2], f"run-{'up' if up else 'down'}, {abs(rate):.3g} Hz/s"


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
        Where to draw; a new figure, free of pyplot, unless given.
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
    ax.ticklabel_format(style="sci", scilimits=(-2, 4))
    ax.set_xlabel(plane.x_label)
    ax.set_ylabel(plane.y_label)
    ax.set_title(f"basins at {found.frequency_hz:g} Hz, forcing phase zero")
    ax.legend(handles=handles, fontsize="small", loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return ax


def _points(name: str, given: Real) -> Real:
    """Points (k, 2) in the plane."""
    points = numbers(name, given)
    if points.size and (points.ndim != 2 or points.shape[1] != 2):
        raise SystemModelError(f"{name} must be points (k, 2), got shape {points.shape}")
    return points


def _title(attractor: Attractor) -> str:
    """Name of an attractor, with its impacts if it is periodic."""
    if attractor.orbit is None:
        return attractor.name
    count = attractor.orbit.impacts
    return f"{attractor.name} ({count} impact{'' if count == 1 else 's'})"


def _coloured(found: Basins) -> tuple[Real, list[Any]]:
    """Colours (ny, nx, 3) of the cells, and entries of the legend."""
    image = np.ones((*found.labels.shape, 3))
    handles: list[Any] = []
    for index, basin in enumerate(found.basins):
        base = np.asarray(to_rgb(PERIOD_COLOURS[index % len(PERIOD_COLOURS)]), dtype=float)
        phases = max(basin.attractor.period, 1)
        for phase in range(phases):
            here = (found.labels == index) & (found.phases == phase)
            if not here.any():
                continue
            tint = base + (1.0 - base) * 0.75 * phase / phases
            image[here] = tint
            which = f", phase {phase}" if phases > 1 else ""
            label = f"{_title(basin.attractor)}{which}: {100.0 * here.mean():.1f} %"
            handles.append(Patch(color=tuple(tint), label=label))
    if np.any(found.labels == UNDECIDED):
        handles.append(Patch(color="white", label=f"undecided: {100.0 * found.undecided:.1f} %"))
    return image, handles
