"""Table and picture of what motions settle on over a parameter."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from nldyn.branches.tables import displacement_name
from nldyn.longterm.poincare import BruteForce
from nldyn.plot.diagram import file_axes, save_figure
from nldyn.plot.longterm import plot_brute_force
from nldyn.report.results import if_known, write_table
from nldyn.system.chart import parameter_name


def write_sweep(found: BruteForce, folder: Path, title: str = "") -> None:
    """Write ``sweep.csv``, ``sweep.png`` and ``.svg``."""
    system = found.columns[0].attractor.flow.system
    columns = (
        parameter_name(found.parameter), "direction", "attractor", "period", "impacts_per_period",
        displacement_name(system, found.observe), "largest_exponent_per_s",
    )  # fmt: skip
    write_table(folder / "sweep.csv", columns, sweep_rows(found))
    ax = plot_brute_force(found, file_axes())
    ax.set_title(title or "Sweep")
    save_figure(ax, folder / "sweep")


def sweep_rows(found: BruteForce) -> Iterator[tuple[object, ...]]:
    """Give the rows of ``sweep.csv``, a motion each; the period is empty unless it is periodic."""
    for value, column in zip(found.values, found.columns, strict=True):
        attractor, periods = column.attractor, column.peaks.size
        rate = column.impact_speed.size / periods if periods else math.nan
        known = (
            rate if attractor.orbit is None else attractor.impact_rate,
            float(column.peaks.max(initial=0.0)) if periods else math.nan,
            float(attractor.largest_exponent[0]),
        )
        yield (
            value, column.direction, attractor.name, attractor.period or None,
            *map(if_known, known),
        )  # fmt: skip
