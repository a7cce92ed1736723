"""Work-precision diagrams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bench.engines import NLDYN
from bench.measure import Sample, curve
from bench.models import MODELS

TITLES = {
    "state": "end of the period",
    "monodromy": "monodromy matrix",
    "flip": "frequency of a flip",
}
MODEL_TITLES = dict(zip(MODELS, ("1 DOF", "2 DOF", "4 DOF", "16 DOF"), strict=True))
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#5D4E9C", "#8B4513")
MARKERS = "osD^vP*X<>hd"
ROUNDING = 1e-16  # smaller errors are drawn there
Points = Sequence[tuple[float, float]]


def draw_model(
    samples: Sequence[Sample], model: str, folder: Path, extra: Mapping[str, Points]
) -> None:
    """Write the work-precision diagram of one model as PNG and SVG.

    Parameters
    ----------
    samples : sequence of Sample
        What was measured.
    model : str
        Which model.
    folder : Path
        Where to write ``work_precision_<model>.png`` and ``.svg``.
    extra : mapping of str to points
        Further (error, seconds) of the flip's frequency, by name.
    """
    figure = Figure(figsize=(15.0, 6.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, 3, sharex=True)
    engines = list(dict.fromkeys(s.engine for s in samples if s.model == model))
    for axes, (error, title) in zip(panels, TITLES.items(), strict=True):
        for number, engine in enumerate(engines):
            _line(axes, curve(samples, model, engine, error), engine, number)
        for number, (name, points) in enumerate(extra.items()):
            if error == "flip":
                _line(axes, points, name, len(engines) + number)
        axes.set_title(title)
        axes.set_ylabel("relative error")
        axes.set_xlabel("time per orbit in s")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.grid(which="major", linewidth=0.4, color="#cccccc")
    entries: dict[str, Artist] = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(
        list(entries.values()), list(entries), loc="outside lower center", ncols=4, frameon=False
    )
    figure.suptitle(f"{MODEL_TITLES.get(model, model)}: speed against error")
    with mpl.rc_context({"svg.hashsalt": "nldyn", "svg.fonttype": "none"}):
        for kind, metadata in (("png", None), ("svg", {"Date": None})):
            figure.savefig(folder / f"work_precision_{model}.{kind}", dpi=110, metadata=metadata)


def _line(axes: Axes, points: Points, name: str, number: int) -> None:
    shown = [(max(e, ROUNDING), t) for e, t in points]
    if not shown:
        return
    ours = name == NLDYN
    axes.plot(
        [t for _, t in shown],
        [e for e, _ in shown],
        label=name,
        color="black" if ours else COLOURS[number % len(COLOURS)],
        linewidth=2.4 if ours else 1.0,
        linestyle="--" if "events" in name else "-",
        marker=MARKERS[number % len(MARKERS)],
        markersize=6 if ours else 4,
    )
