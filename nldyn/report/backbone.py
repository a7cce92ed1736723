"""Table and picture of a backbone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from nldyn.curves.backbone import Backbone, farthest_from
from nldyn.curves.curves import Curve
from nldyn.plot.diagram import PERIOD_COLOURS, file_axes, save_figure
from nldyn.plot.words import unit_in
from nldyn.report.results import write_table

COLUMNS = ("frequency_hz", "energy_j", "amplitude_{unit}", "impacts", "stable", "error")


def write_backbone(
    found: Backbone, folder: Path, title: str = "", forced: Curve | None = None
) -> None:
    """Write ``backbone.csv``, ``backbone.png`` and ``.svg``.

    With the forced curve of phase resonance also ``phase_resonance.csv``.
    """
    rows = zip(
        found.frequency_hz.tolist(),
        found.energy.tolist(),
        found.amplitude.tolist(),
        [orbit.impacts for orbit in found.orbits],
        [int(stable) for stable in found.stable],
        [orbit.error for orbit in found.orbits],
        strict=True,
    )
    names = [name.format(unit=measure_of(found)) for name in COLUMNS]
    write_table(folder / "backbone.csv", names, rows)
    ax = plot_backbone(found, title)
    if forced is not None:
        table = forced.table()
        rows = zip(*(table[name].tolist() for name in table), strict=True)
        write_table(folder / "phase_resonance.csv", tuple(table), rows)
        draw_forced(ax, forced, found)
    save_figure(ax, folder / "backbone")


def measure_of(found: Backbone) -> str:
    """In which the amplitudes are, m or rad."""
    orbit = found.orbits[0]
    return orbit.system.unit(orbit.observe)


def draw_forced(ax: Axes, forced: Curve, found: Backbone) -> None:
    """Add a curve of phase resonance to the backbone that is drawn."""
    factor, _ = unit_in(measure_of(found), float(found.amplitude.max()))
    sizes = np.array([farthest_from(found.rest_m, orbit) for orbit in forced.orbits])
    hz = [orbit.frequency_hz for orbit in forced.orbits]
    ax.plot(hz, sizes / factor, "--", color=PERIOD_COLOURS[1], label="forced, in phase resonance")
    ax.legend(fontsize="small")


def plot_backbone(found: Backbone, title: str = "") -> Axes:
    """Draw the amplitude against the frequency of the free motion; crosses are unstable."""
    ax = file_axes()
    measure = measure_of(found)
    factor, unit = unit_in(measure, float(found.amplitude.max()))
    what = "rotation" if measure == "rad" else "displacement"
    ax.plot(found.frequency_hz, found.amplitude / factor, ".-", color=PERIOD_COLOURS[0])
    unstable = ~found.stable
    if unstable.any():
        sizes = found.amplitude[unstable] / factor
        ax.plot(found.frequency_hz[unstable], sizes, "x", color="0.2", label="unstable")
        ax.legend(fontsize="small")
    ax.set_xlabel("frequency of the free motion (Hz)")
    ax.set_ylabel(f"largest {what} from rest at '{found.orbits[0].observe}' ({unit})")
    name = f"Backbone of mode {found.mode}"
    ax.set_title(f"{title}: {name.lower()}" if title else name)
    return ax
