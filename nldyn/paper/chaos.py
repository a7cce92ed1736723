"""Chaotic ranges of the larger models, decided by Lyapunov exponents, and the figure of them."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal, get_args

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from nldyn.longterm.attractors import Attractor, AttractorOptions
from nldyn.longterm.lifetimes import ChaosLifetime, chaos_lifetime, two_digits
from nldyn.longterm.poincare import BruteForce, brute_force
from nldyn.paper.evidence import Finding, published_claims
from nldyn.paper.jobs import scene_system
from nldyn.paper.workers import Workers
from nldyn.plot.diagram import save_figure

Way = Literal["up", "down"]
Task = tuple[str, Way]

RANGE_HZ, POINTS = (18.0, 90.0), 145
EFFORT = AttractorOptions(periods=500)
# motions from each chaotic one, and for how long they are followed: in published ranges, elsewhere
CLAIMED, ELSEWHERE = (4, 2500), (4, 1000)
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
CAPTION = (
    "Largest Lyapunov exponents: the damping reduces the chaotic ranges "
    f"(hollow: chaos that does not last for {ELSEWHERE[1]} periods more)"
)


@dataclass(frozen=True, eq=False)
class Chaos:
    """Attractors of the four models over the frequency, swept up and down.

    Parameters
    ----------
    diagrams : mapping of str to BruteForce
        By the name of the model's scene.
    lifetimes : mapping of str to list of ChaosLifetime
        How long chaos lasts at each chaotic frequency; longest followed in the ranges that
        `CLAIMS` name.
    """

    diagrams: Mapping[str, BruteForce]
    lifetimes: Mapping[str, Sequence[ChaosLifetime]]

    def ranges(self, figure: str) -> list[tuple[float, float]]:
        """Chaotic ranges in Hz that a figure shows."""
        return self.diagrams[SHADED[figure]].ranges() if figure in SHADED else []

    def finding(self, model: str, published: str) -> Finding:
        """Whether chaos lasts at most frequencies of each published range.

        A motion is chaotic if its largest Lyapunov exponent is positive by three standard errors.
        Chaos lasts where more than half of four motions from states of it are chaotic for 2500
        periods more (`CLAIMED`).
        """
        states, periods = CLAIMED
        found = self.diagrams[model]
        inside, texts, holds = 0, [], True
        for low, high in published_ranges(published):
            count, total = found.share(low, high)
            lives = [x for x in self.lifetimes[model] if low <= x.frequency_hz <= high]
            lasting = sum(2 * life.lasting > life.count for life in lives)
            inside += count
            holds = holds and 2 * lasting > total
            texts.append(
                f"{low:g}-{high:g} Hz: {count} of {total}{_typical(found, low, high)}; it lasts at "
                f"{lasting} of them{_settling(lives)}"
            )
        everywhere, _ = found.share(*RANGE_HZ)
        return Finding(
            holds=holds,
            text="frequencies with a chaotic motion, " + "; ".join(texts),
            note=f"swept up and down in steps of {_step(found):g} Hz; chaotic means a largest "
            "Lyapunov exponent above zero by three standard errors; it lasts where more than half "
            f"of {states} motions from states of it are chaotic for {periods} periods more; the "
            "statement holds if it lasts at more than half of the frequencies of each range. "
            f"Outside, {everywhere - inside} of the other frequencies from {RANGE_HZ[0]:g} to "
            f"{RANGE_HZ[1]:g} Hz have a chaotic motion, too",
        )

    def transients(self, model: str) -> set[float]:
        """Frequencies in Hz at which chaos does not last for 1000 periods, for half of the motions.

        So long motions are followed at every frequency (`ELSEWHERE`). One that is neither settled
        nor chaotic at the end has not lasted.
        """
        return {
            life.frequency_hz
            for life in self.lifetimes[model]
            if 2 * life.lasting_for(ELSEWHERE[1]) <= life.count
        }

    def damping(self) -> tuple[bool, str]:
        """Whether more damping leaves fewer chaotic frequencies in both models, and the numbers.

        Frequencies at which chaos does not last do not count.
        """
        smaller, texts = True, []
        for model in NAMES:
            counts, parts = [], []
            for xi in ("0.01", "0.001"):
                found, total = self.diagrams[f"{model}_xi_{xi}"].share(*RANGE_HZ)
                counts.append(found - len(self.transients(f"{model}_xi_{xi}")))
                parts.append(f"{found} of {total} frequencies at ξ = {xi}, lasting at {counts[-1]}")
            smaller = smaller and counts[0] < counts[1]
            texts.append(f"{model}: chaotic at {'; at '.join(parts)}")
        return smaller, "; ".join(texts)

    def with_damping(self, flips: Finding) -> Finding:
        """The claim on the damping: fewer flips, and smaller chaotic ranges."""
        smaller, text = self.damping()
        note = flips.note.partition(";")[0] + (
            "; chaotic frequencies from 18 to 90 Hz, lasting where more than half of the motions "
            f"from states of it are chaotic for {ELSEWHERE[1]} periods more"
        )
        return replace(
            flips, holds=bool(flips.holds) and smaller, text=f"{flips.text}; {text}", note=note
        )


def _step(found: BruteForce) -> float:
    """Distance of neighbouring frequencies in Hz."""
    return (RANGE_HZ[1] - RANGE_HZ[0]) / (found.share(*RANGE_HZ)[1] - 1)


def published_ranges(text: str) -> list[tuple[float, float]]:
    """Ends in Hz of ranges as the paper names them.

    Examples
    --------
    >>> published_ranges("30-37 and 59-66")
    [(30.0, 37.0), (59.0, 66.0)]
    """
    ends = [part.split("-") for part in text.split(" and ")]
    return [(float(low), float(high)) for low, high in ends]


def _settling(lives: Sequence[ChaosLifetime]) -> str:
    """How long chaos lasts where some of the motions settle, in words."""
    ending = [life.lifetime for life in lives if life.settled]
    if not ending:
        return ""
    ends = " to ".join(dict.fromkeys(two_digits(f(ending)) for f in (min, max)))
    many = "frequency" if len(ending) == 1 else "frequencies"
    return f" (some motions settle at {len(ending)} {many}, after {ends} periods in the mean)"


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


def _swept(points: int, task: Task) -> BruteForce:
    model, direction = task
    return brute_force(
        scene_system(model), RANGE_HZ, points=points, directions=[direction], recorded=1,
        options=EFFORT,
    )  # fmt: skip


def chaotic_places(diagrams: Mapping[str, BruteForce]) -> dict[tuple[str, float], Attractor]:
    """A chaotic attractor at each frequency that has one, by its model and the frequency in Hz."""
    found: dict[tuple[str, float], Attractor] = {}
    for model, diagram in diagrams.items():
        for column in diagram.columns:
            if column.attractor.kind == "chaotic":
                found.setdefault((model, round(column.frequency_hz, 9)), column.attractor)
    return dict(sorted(found.items()))


def effort_at(model: str, frequency_hz: float) -> tuple[int, int]:
    """How many motions are followed, and for how many periods: more where the paper says chaos."""
    inside = any(low <= frequency_hz <= high for low, high in claimed_ranges(model))
    return CLAIMED if inside else ELSEWHERE


@cache
def claimed_ranges(model: str) -> tuple[tuple[float, float], ...]:
    """Ends in Hz of the ranges in which the paper finds a model chaotic."""
    texts = [row["published"] for row in published_claims() if CLAIMS.get(row["id"]) == model]
    return tuple(ends for text in texts for ends in published_ranges(text))


def submit_sweeps(workers: Workers, points: int = POINTS) -> dict[Task, Future[BruteForce]]:
    """Begin to sweep all models up and down."""
    tasks: list[Task] = [(model, way) for model in MODELS for way in get_args(Way)]
    return {
        (model, way): workers.submit(f"sweep_{way}_{model}_{points}", _swept, points, (model, way))
        for model, way in tasks
    }


def chaos_of(halves: Mapping[Task, BruteForce], workers: Workers) -> Chaos:
    """Join the sweeps up and down, and see how chaos lasts."""
    diagrams = {
        model: BruteForce(
            halves[model, "up"].observe,
            halves[model, "up"].columns + halves[model, "down"].columns,
        )
        for model in MODELS
    }
    futures = {}
    for (model, hz), attractor in chaotic_places(diagrams).items():
        futures[model, hz] = workers.submit(
            f"lifetime_{model}_{hz:.9g}", _lifetime, attractor, *effort_at(model, hz)
        )
    lifetimes: dict[str, list[ChaosLifetime]] = {model: [] for model in MODELS}
    for (model, _), life in workers.values(futures, "times that chaos lasts").items():
        lifetimes[model].append(life)
    return Chaos(diagrams, lifetimes)


def _lifetime(attractor: Attractor, states: int, periods: int) -> ChaosLifetime:
    return chaos_lifetime(attractor, states=states, periods=periods)


def write_chaos_figure(chaos: Chaos, folder: Path) -> None:
    """Draw the largest exponents of both models at both dampings, with their errors."""
    figure = Figure(figsize=(10.5, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 1, sharex=True)
    for ax, (model, name) in zip(axes, NAMES.items(), strict=True):
        for xi, colour in DAMPINGS.items():
            scene = f"{model}_xi_{xi}"
            _draw(ax, chaos.diagrams[scene], chaos.transients(scene), f"ξ = {xi}", colour)
        ax.axhline(0.0, color="0.4", linewidth=0.8)
        ax.set_ylabel("largest exponent (1/s)")
        ax.set_title(name)
        ax.legend(fontsize="small", loc="upper right")
    axes[-1].set_xlabel("excitation frequency (Hz)")
    axes[-1].set_xlim(RANGE_HZ)
    save_figure(axes[0], folder / FIGURE)


def _draw(
    ax: Axes, found: BruteForce, transients: Collection[float], label: str, colour: str
) -> None:
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
    ended = [hz for hz in frequencies if any(math.isclose(hz, other) for other in transients)]
    heights = [largest[hz][0] for hz in ended]
    ax.plot(ended, heights, "o", color=colour, markersize=5.0, markerfacecolor="white", zorder=3)
