"""Tables and picture of a simulated motion."""

from __future__ import annotations

from pathlib import Path

from matplotlib.axes import Axes

from nldyn.io.history_files import write_history
from nldyn.longterm.impacts import Impacts
from nldyn.longterm.simulation import Motion
from nldyn.orbits.history import History
from nldyn.orbits.orbit import check_observe
from nldyn.plot.diagram import PERIOD_COLOURS, length_unit, new_axes, save_figure
from nldyn.plot.longterm import plot_sweep
from nldyn.report.results import write_table
from nldyn.runtime.result_directory import result_directory

PER_PERIOD = 64  # rows of the table in an excitation period


def write_simulation(
    motion: Motion, hits: Impacts, directory: str | Path, text: str, title: str = ""
) -> Path:
    """Write ``motion.csv``, ``impacts.csv``, ``simulation.png`` and ``.svg``, and the scene.

    Of a run-up also ``peaks.csv``, the largest displacement in each excitation period.

    Raises
    ------
    OutputError
        If the directory holds only other people's files or cannot be written.
    """
    observed = check_observe(motion.system, None)
    hz, peaks = motion.period_peaks(observed)
    history = motion.history(PER_PERIOD * max(hz.size, 1))
    with result_directory(directory, "simulation") as folder:
        write_history(history, folder / "motion.csv")
        columns = hits.columns()
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        write_table(folder / "impacts.csv", columns, rows)
        if motion.rate_hz_per_s:
            rows = zip(hz.tolist(), peaks.tolist(), strict=True)
            write_table(folder / "peaks.csv", ("frequency_hz", "max_abs_displacement_m"), rows)
        ax = plot_sweep(motion) if motion.rate_hz_per_s else plot_motion(history, observed)
        ax.set_title(title or "Simulation")
        save_figure(ax, folder / "simulation")
        (folder / "scene.toml").write_text(text, encoding="utf-8")
    return Path(directory)


def plot_motion(history: History, interface: str) -> Axes:
    """Draw the displacement of an interface over the time."""
    values = history.displacement[interface]
    factor, unit = length_unit(float(abs(values).max()))
    ax = new_axes()
    ax.plot(history.time, values / factor, color=PERIOD_COLOURS[0], linewidth=0.8)
    ax.set_xlabel("time (s)")
    ax.set_ylabel(f"displacement of {interface} ({unit})")
    return ax
