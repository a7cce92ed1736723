"""Tables and picture of a simulated motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from nldyn.base.arrays import Real
from nldyn.branches.tables import displacement_name
from nldyn.io.history_files import write_pieces
from nldyn.longterm.impacts import Impacts
from nldyn.longterm.simulation import Motion
from nldyn.orbits.history import History
from nldyn.orbits.orbit import check_observe
from nldyn.plot.diagram import PERIOD_COLOURS, file_axes, save_figure
from nldyn.plot.longterm import plot_sweep
from nldyn.plot.words import axis_unit, displacement_of, units_of
from nldyn.report.results import write_table

PER_PERIOD = 64  # rows of the table in an excitation period
DRAWN = 20_000  # points that a picture shows one by one
BARS = 2000  # from lowest to highest, that it shows of more
AT_ONCE = 8192  # rows that are held at once


def write_simulation(
    motion: Motion, hits: Impacts, folder: Path, title: str = "", direction: str = ""
) -> None:
    """Write ``motion.csv``, ``impacts.csv``, ``simulation.png`` and ``.svg``.

    Of a run-up also ``peaks.csv``, the largest displacement in each excitation period.
    """
    observed = check_observe(motion.system, None)
    hz, peaks = motion.period_peaks(observed)
    samples = PER_PERIOD * max(hz.size, 1)
    curve = Drawn(observed, math.ceil(samples / BARS) if samples > DRAWN else 1)
    pieces = motion.histories(samples, curve.each * max(AT_ONCE // curve.each, 1))
    write_pieces(map(curve.seen, pieces), folder / "motion.csv")
    columns = {**hits.columns(), "rotation": hits.rotation.astype(int)}
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    write_table(folder / "impacts.csv", columns, rows)
    if motion.rate_hz_per_s:
        rows = zip(hz.tolist(), peaks.tolist(), strict=True)
        size = displacement_name(motion.system, observed)
        write_table(folder / "peaks.csv", ("frequency_hz", size), rows)
    ax = (
        plot_sweep(motion, direction=direction)
        if motion.rate_hz_per_s
        else plot_motion(curve, direction)
    )
    ax.set_title(title or "Simulation")
    save_figure(ax, folder / "simulation")


@dataclass
class Drawn:
    """What is drawn of a motion: of every so many samples the lowest and the highest."""

    interface: str
    each: int
    times: list[Real] = field(default_factory=list)
    values: list[Real] = field(default_factory=list)

    def seen(self, history: History) -> History:
        """Take in a piece of the motion, and give it on."""
        values = history.displacement[self.interface]
        ends = np.arange(0, values.size, self.each)
        low, high = np.minimum.reduceat(values, ends), np.maximum.reduceat(values, ends)
        if self.each == 1:
            self.times.append(history.time)
            self.values.append(values)
        else:
            self.times.append(np.repeat(history.time[ends], 2))
            self.values.append(np.column_stack([low, high]).ravel())
        return history


def plot_motion(curve: Drawn, direction: str = "") -> Axes:
    """Draw the displacement of an interface over the time; of a rotation in rad."""
    time, values = np.concatenate(curve.times), np.concatenate(curve.values)
    factor, unit = axis_unit(float(abs(values).max()), units_of(direction))
    ax = file_axes()
    ax.plot(time, values / factor, color=PERIOD_COLOURS[0], linewidth=0.8)
    ax.set_xlabel("time (s)")
    ax.set_ylabel(f"{displacement_of(curve.interface, direction)} ({unit})")
    return ax
