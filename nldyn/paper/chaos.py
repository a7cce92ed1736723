"""Chaotic ranges of the larger models, decided by Lyapunov exponents, and the figure of them."""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from nldyn.attractors import AttractorOptions
from nldyn.executors import as_finished
from nldyn.paper.evidence import Finding
from nldyn.paper.jobs import _ended_at_failure, scene_system
from nldyn.plot import save_figure
from nldyn.progress import progress_line
from nldyn.sections import BruteForce, Direction, brute_force

RANGE_HZ, POINTS = (18.0, 90.0), 145
EFFORT = AttractorOptions(periods=500)
MODELS = ("four_dof_xi_0.001", "four_dof_xi_0.01", "two_dof_xi_0.001", "two_dof_xi_0.01")
NAMES = {"two_dof": "2-DOF model", "four_dof": "4-DOF model"}
DAMPINGS = {"0.01": "#0072b2", "0.001": "#b03a00"}

# figures whose chaotic ranges are shaded
SHADED = {
    "figure_4": "two_dof_xi_0.01",
    "figure_5": "two_dof_xi_0.001",
    "figure_7": "four_dof_xi_0.01",
    "figure_8": "four_dof_xi_0.001",
}
CLAIMS = {"fig4.chaos": "two_dof_xi_0.01", "fig7.chaos": "four_dof_xi_0.01"}
FIGURE = "chaos"
CAPTION = "Largest Lyapunov exponents: the damping reduces the chaotic ranges"


@dataclass(frozen=True, eq=False)
class Chaos:
    """Attractors of the four models over the frequency, swept up and down.

    Parameters
    ----------
    diagrams : mapping of str to BruteForce
        By the name of the model's scene.
    """

    diagrams: Mapping[str, BruteForce]

    def ranges(self, figure: str) -> list[tuple[float, float]]:
        """Chaotic ranges in Hz that a figure shows."""
        return self.diagrams[SHADED[figure]].ranges() if figure in SHADED else []

    def finding(self, model: str, published: str) -> Finding:
        """Whether motions are chaotic at most frequencies of each published range.

        A motion is chaotic if its largest Lyapunov exponent is positive by three standard errors.
        """
        found = self.diagrams[model]
        inside, texts, holds = 0, [], True
        for text in published.split(" and "):
            low, high = (float(end) for end in text.split("-"))
            count, total = found.share(low, high)
            inside += count
            holds = holds and 2 * count > total
            texts.append(f"{text} Hz: {count} of {total}{_typical(found, low, high)}")
        everywhere, _ = found.share(*RANGE_HZ)
        return Finding(
            holds=holds,
            text="frequencies with a chaotic motion, " + "; ".join(texts),
            note=f"swept up and down in steps of {_step(found):g} Hz; chaotic means a largest "
            "Lyapunov exponent above zero by three standard errors; the statement holds if more "
            "than half of the frequencies of each range have such a motion. "
            f"Outside, {everywhere - inside} of the other frequencies from {RANGE_HZ[0]:g} to "
            f"{RANGE_HZ[1]:g} Hz have one, too",
        )

    def damping(self) -> tuple[bool, str]:
        """Whether more damping leaves fewer chaotic frequencies in both models, and the numbers."""
        smaller, texts = True, []
        for model in NAMES:
            more, less = (
                self.diagrams[f"{model}_xi_{xi}"].share(*RANGE_HZ) for xi in ("0.01", "0.001")
            )
            smaller = smaller and more[0] < less[0]
            texts.append(
                f"{model}: chaotic at {more[0]} of {more[1]} frequencies at ξ = 0.01, at {less[0]} "
                "at 0.001"
            )
        return smaller, "; ".join(texts)

    def with_damping(self, flips: Finding) -> Finding:
        """The claim on the damping: fewer flips, and smaller chaotic ranges."""
        smaller, text = self.damping()
        note = flips.note.partition(";")[0] + "; chaotic frequencies from 18 to 90 Hz"
        return replace(
            flips, holds=bool(flips.holds) and smaller, text=f"{flips.text}; {text}", note=note
        )


def _step(found: BruteForce) -> float:
    """Distance of neighbouring frequencies in Hz."""
    return (RANGE_HZ[1] - RANGE_HZ[0]) / (found.share(*RANGE_HZ)[1] - 1)


def _typical(found: BruteForce, low: float, high: float) -> str:
    """The median chaotic exponent in a range with its error, in words."""
    values = [
        c.attractor.largest_exponent
        for c in found.columns
        if c.attractor.kind == "chaotic" and low <= c.frequency_hz <= high
    ]
    if not values:
        return ""
    value, error = sorted(values)[len(values) // 2]
    return f" (median exponent {value:.3g} ± {error:.1g} 1/s)"


def _task(points: int, task: tuple[str, Direction]) -> BruteForce:
    model, direction = task
    return brute_force(
        scene_system(model), RANGE_HZ, points=points, directions=[direction], recorded=1,
        options=EFFORT,
    )  # fmt: skip


def _leave_ctrl_c() -> None:
    """Let a worker process leave Ctrl-C, which a terminal sends to all, to its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def compute_chaos(workers: int, points: int = POINTS) -> Chaos:
    """Sweep all models up and down, on as many processes as workers."""
    tasks: list[tuple[str, Direction]] = [
        (model, direction) for model in MODELS for direction in ("up", "down")
    ]
    halves: dict[tuple[str, str], BruteForce] = {}
    context = multiprocessing.get_context("spawn")
    with (
        progress_line() as report,
        ProcessPoolExecutor(workers, context, _leave_ctrl_c) as pool,
        _ended_at_failure(),
    ):
        for outcome in as_finished(partial(_task, points), tasks, pool):
            halves[tasks[outcome.index]] = outcome.value_or_raise()
            report(f"Lyapunov exponents, {len(halves)} of {len(tasks)} sweeps", 0.0)
    return Chaos(
        {
            model: BruteForce(
                halves[model, "up"].observe,
                halves[model, "up"].columns + halves[model, "down"].columns,
            )
            for model in MODELS
        }
    )


def write_chaos_figure(chaos: Chaos, folder: Path) -> None:
    """Draw the largest exponents of both models at both dampings, with their errors."""
    figure = Figure(figsize=(10.5, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 1, sharex=True)
    for ax, (model, name) in zip(axes, NAMES.items(), strict=True):
        for xi, colour in DAMPINGS.items():
            _draw(ax, chaos.diagrams[f"{model}_xi_{xi}"], f"ξ = {xi}", colour)
        ax.axhline(0.0, color="0.4", linewidth=0.8)
        ax.set_ylabel("largest exponent (1/s)")
        ax.set_title(name)
        ax.legend(fontsize="small", loc="upper right")
    axes[-1].set_xlabel("excitation frequency (Hz)")
    axes[-1].set_xlim(RANGE_HZ)
    save_figure(axes[0], folder / FIGURE)


def _draw(ax: Axes, found: BruteForce, label: str, colour: str) -> None:
    largest: dict[float, tuple[float, float]] = {}
    for column in found.columns:
        value, error = column.attractor.largest_exponent
        if math.isfinite(value):
            hz = column.frequency_hz
            largest[hz] = max((value, error), largest.get(hz, (-math.inf, 0.0)))
    frequencies = sorted(largest)
    values = np.array([largest[hz] for hz in frequencies])
    ax.errorbar(
        frequencies, *values.T, color=colour, label=label, linewidth=0.8, elinewidth=0.8,
        marker=".", markersize=4.0,
    )  # fmt: skip
