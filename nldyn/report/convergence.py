"""Tables and pictures of a convergence study."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from nldyn.bifurcations.kinds import KINDS
from nldyn.plot.diagram import PERIOD_COLOURS, file_axes, save_figure
from nldyn.reduction.convergence import QUANTITIES, ConvergenceStudy
from nldyn.reduction.model_errors import counted_modes
from nldyn.report.convergence_page import along_of, special, study_content
from nldyn.report.convergence_tables import study_tables
from nldyn.report.offline import write_html
from nldyn.report.results import write_table

SMALLEST = 1e-14

Series = Mapping[str, Sequence[int]]


def write_study(study: ConvergenceStudy, folder: Path, title: str = "", text: str = "") -> None:
    """Write ``convergence.html``, a page for a browser, tables, ``report.txt`` and pictures.

    The page shows the text of the scene.
    """
    tables = study_tables(study)
    write_table(folder / "convergence.csv", *tables["models"])
    write_table(folder / "special_points_by_model.csv", *tables["folds and flips"])
    content = study_content(study, tables, title, text)
    write_html(folder / "convergence.html", "convergence.html", content)
    (folder / "report.txt").write_text(study.report() + "\n", encoding="utf-8")
    if counts_vary(study):
        save_figure(plot_errors(study, title), folder / "convergence")
    save_figure(plot_cost(study, title), folder / "speed_against_error")
    save_figure(plot_special_points(study, title), folder / "special_points_by_model")
    if study.mesh_series():
        save_figure(plot_errors_by_mesh(study, title), folder / "meshes")


def counts_vary(study: ConvergenceStudy) -> bool:
    """Whether there are models that differ in nothing but their number of modes."""
    return any(len(indices) > 1 for indices in study.series().values())


def plot_errors(study: ConvergenceStudy, title: str = "") -> Axes:
    """Draw every error against the number of modes, one panel for each quantity."""
    places = [model.modes for model in study.models]
    return error_panels(study, study.series(), places, "kept modes", title)[0]


def plot_errors_by_mesh(study: ConvergenceStudy, title: str = "") -> Axes:
    """Draw every error against the degrees of freedom of the meshes."""
    places = [model.dofs for model in study.models]
    panels = error_panels(study, study.mesh_series(), places, "degrees of freedom", title)
    for panel in panels:
        panel.set_xscale("log")
    return panels[0]


def error_panels(
    study: ConvergenceStudy, series: Series, places: list[int], along: str, title: str
) -> list[Axes]:
    """Draw one panel for each quantity, and a legend of the series in the last one."""
    figure = Figure(figsize=(11.0, 6.5), layout="constrained")
    FigureCanvasAgg(figure)
    panels: list[Axes]
    *panels, key = list(figure.subplots(2, 4, sharex=True).ravel())
    for panel, (quantity, name) in zip(panels, QUANTITIES.items(), strict=True):
        draw_series(panel, study, series, quantity, places)
        panel.set_title(name, fontsize=10)
        panel.set_xlabel(along)
    panels[0].set_ylabel("relative error")
    panels[4].set_ylabel("relative error")
    for label, colour in colours(series).items():
        key.plot([], [], "o-", color=colour, markersize=4, label=label)
    key.set_axis_off()
    key.legend(loc="center", frameon=False)
    figure.suptitle(title)
    return panels


def plot_cost(study: ConvergenceStudy, title: str = "") -> Axes:
    """Draw the errors of the resonance peak and of the folds and flips against time per orbit."""
    ax = file_axes(8.0, 5.0)
    times = [1e3 * model.seconds_per_orbit for model in study.models]
    by_modes = counts_vary(study)
    series = study.series() if by_modes else study.mesh_series()
    numbers = [model.modes if by_modes else model.dofs for model in study.models]
    draw_series(ax, study, series, "peak_height", times, "o", numbers)
    draw_series(ax, study, series, "fold_flip", times, "s", numbers)
    said = "kept modes" if by_modes else "degrees of freedom"
    for label, colour in colours(series).items():
        ax.plot([], [], "-", color=colour, label=f"{label} (numbers: {said})")
    ax.plot([], [], "ko", label="peak height")
    ax.plot([], [], "ks", label="folds and flips")
    ax.set_xscale("log")
    ax.set_xlabel("time per orbit (ms)")
    ax.set_ylabel("relative error of the harmonic branch")
    ax.legend(frameon=False)
    ax.set_title(title)
    return ax


def draw_series(
    ax: Axes,
    study: ConvergenceStudy,
    series: Series,
    quantity: str,
    abscissa: Sequence[float],
    marker: str = "o",
    numbers: Sequence[int] = (),
) -> None:
    """Draw one error of every series; what is missing, infinite or zero leaves a gap.

    Zero is the error of the model that the others are compared with. Points with numbers get no
    line.
    """
    line = "" if numbers else "-"
    palette = colours(series)
    drawn = False
    for label, indices in series.items():
        x = [abscissa[i] for i in indices]
        errors = [getattr(study.errors[i], quantity) for i in indices]
        y = [max(e, SMALLEST) if 0.0 < e < math.inf else math.nan for e in errors]
        drawn = drawn or any(value > 0.0 for value in y)
        ax.plot(x, y, marker + line, color=palette[label], markersize=4, linewidth=1.0)
        if numbers:
            for place, value, index in zip(x, y, indices, strict=True):
                if not math.isfinite(place + value):
                    continue
                count = str(numbers[index])
                ax.annotate(count, (place, value), (4, 2), textcoords="offset points", fontsize=7)
    if drawn:
        ax.set_yscale("log")
    ax.grid(True, which="major", linewidth=0.3)


def plot_special_points(study: ConvergenceStudy, title: str = "") -> Axes:
    """Draw the folds and flips of the harmonic branch of every model, one line for each."""
    followed = [model for model in study.models if model.special_values]
    along = along_of(study)
    ax = file_axes(10.5, 1.5 + 0.22 * len(followed))
    for row, model in enumerate(followed):
        for kind, colour in (("LP", PERIOD_COLOURS[0]), ("PD", PERIOD_COLOURS[1])):
            places = special(model, along)[kind]
            ax.plot(places, [row] * len(places), KINDS[kind].marker, color=colour, markersize=3.5)
    ax.set_yticks(range(len(followed)), [f"{m.label}, {counted_modes(m)}" for m in followed])
    ax.tick_params(axis="y", labelsize=8)
    marks = "of folds (circles) and flips (squares) of the harmonic branch"
    ax.set_xlabel(f"{along.noun} {marks} ({along.unit or '1'})")
    ax.set_title(title)
    ax.grid(True, axis="y", linewidth=0.3)
    return ax


def colours(series: Series) -> dict[str, str]:
    """A colour for each series."""
    return {label: PERIOD_COLOURS[i % len(PERIOD_COLOURS)] for i, label in enumerate(series)}
