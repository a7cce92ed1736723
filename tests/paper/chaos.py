"""Chaotic ranges of the larger models, decided by Lyapunov exponents, and the figure of them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from nldyn.flow.flow_map import FlowMap, flow_of
from nldyn.longterm.attractors import Attractor, AttractorOptions, attractor_from
from nldyn.longterm.lifetimes import ChaosLifetime, chaos_lifetime, two_digits
from nldyn.orbits.orbit import check_observe
from nldyn.plot.diagram import BESIDE, save_figure
from nldyn.runtime.progress import Progress
from paper.evidence import Finding, published_claims
from paper.jobs import scene_system
from paper.kept import kept_numbers
from paper.workers import Task

Way = Literal["up", "down"]

RANGE_HZ = (18.0, 90.0)
STEP_HZ, CLAIMED_STEP_HZ = 1.0, 0.5  # outside, and within the ranges that the paper names
# Ends of the pieces that are swept apart, between two frequencies; none cuts a published range.
EDGES_HZ = (17.75, 23.75, 29.75, 38.25, 44.25, 50.75, 57.75, 66.25, 74.25, 82.25, 90.25)
EFFORT = AttractorOptions(periods=128)  # and up to eight times as many where they do not decide
STATES, LASTING = 4, 1000  # motions from each chaotic one, and for how many periods
MODELS = ("four_dof_xi_0.001", "four_dof_xi_0.01", "two_dof_xi_0.001", "two_dof_xi_0.01")
SECONDS = {"two": 1.6e-4, "four": 2.5e-4}  # for a period, about
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


@dataclass(frozen=True)
class Settled:
    """What a motion of a sweep settles on at one frequency.

    Parameters
    ----------
    frequency_hz : float
        Excitation frequency in Hz.
    way : {"up", "down"}
        Whether the motion begins at that of the frequency below or above.
    kind : str
        As `Attractor.kind`.
    exponent, error : float
        Largest Lyapunov exponent in 1/s and its standard error; nan where the simulation failed.
    ended : tuple of int
        Of motions from states of a chaotic one as `ChaosLifetime.ended`; empty if not followed.
    """

    frequency_hz: float
    way: Way
    kind: str
    exponent: float
    error: float
    ended: tuple[int, ...] = ()

    @property
    def chaotic(self) -> bool:
        """Whether the largest exponent is positive by three standard errors, twice."""
        return self.kind == "chaotic"

    @property
    def lifetime(self) -> ChaosLifetime:
        """How long the chaos lasts."""
        return ChaosLifetime(self.frequency_hz, LASTING, np.array(self.ended, dtype=np.int64))

    @property
    def lasts(self) -> bool:
        """Whether more than half of the motions from states of it are chaotic to the end."""
        return bool(self.ended) and 2 * self.lifetime.lasting > self.lifetime.count


@dataclass(frozen=True)
class Chaos:
    """What motions of the four models settle on over the frequency.

    Parameters
    ----------
    swept : mapping of str to sequence of Settled
        By the name of the model's scene.
    """

    swept: Mapping[str, Sequence[Settled]]

    def share(self, model: str, low: float, high: float) -> tuple[int, int]:
        """At how many frequencies from low to high (Hz) a motion is chaotic, and of how many."""
        inside = [s for s in self.swept[model] if low <= s.frequency_hz <= high]
        chaotic = {s.frequency_hz for s in inside if s.chaotic}
        return len(chaotic), len({s.frequency_hz for s in inside})

    def ranges(self, figure: str) -> list[tuple[float, float]]:
        """Chaotic ranges in Hz that a figure shows.

        They reach half way to the neighbouring frequencies.
        """
        swept = self.swept[SHADED[figure]] if figure in SHADED else ()
        frequencies = sorted({s.frequency_hz for s in swept})
        chaotic = {s.frequency_hz for s in swept if s.chaotic}
        found: list[tuple[float, float]] = []
        for i, hz in enumerate(frequencies):
            if hz in chaotic:
                low = 0.5 * (frequencies[max(i - 1, 0)] + hz)
                high = 0.5 * (frequencies[min(i + 1, len(frequencies) - 1)] + hz)
                joins = found and found[-1][1] == low
                found = [*found[:-1], (found[-1][0], high)] if joins else [*found, (low, high)]
        return found

    def finding(self, model: str, published: str) -> Finding:
        """Whether chaos lasts at most frequencies of each published range."""
        inside, texts, holds = 0, [], True
        for low, high in published_ranges(published):
            count, total = self.share(model, low, high)
            within = [s for s in self.swept[model] if low <= s.frequency_hz <= high]
            lasting = len({s.frequency_hz for s in within if s.lasts})
            inside += count
            holds = holds and 2 * lasting > total
            texts.append(
                f"{low:g}-{high:g} Hz: {count} of {total}{_typical(within)}; it lasts at "
                f"{lasting} of them{_settling(within)}"
            )
        everywhere, total = self.share(model, *RANGE_HZ)
        return Finding(
            holds=holds,
            text="frequencies with a chaotic motion, " + "; ".join(texts),
            note=f"swept up and down in steps of {CLAIMED_STEP_HZ:g} Hz; chaotic means a largest "
            "Lyapunov exponent above zero by three standard errors; it lasts where more than half "
            f"of {STATES} motions from states of it are chaotic for {LASTING} periods more; the "
            "statement holds if it lasts at more than half of the frequencies of each range. "
            f"Outside, in steps of {STEP_HZ:g} Hz, {everywhere - inside} of the other frequencies "
            f"from {RANGE_HZ[0]:g} to {RANGE_HZ[1]:g} Hz have a chaotic motion, too",
        )

    def damping(self) -> tuple[bool, str]:
        """Whether more damping leaves fewer chaotic frequencies in both models, and the numbers.

        Those of the sweeps up are compared, at the frequencies that all models have.
        """
        common = set(frequencies_hz("")[0])
        smaller, texts = True, []
        for model in NAMES:
            counts = []
            for xi in ("0.01", "0.001"):
                up = [s for s in self.swept[f"{model}_xi_{xi}"] if s.way == "up"]
                counts.append(sum(s.chaotic for s in up if s.frequency_hz in common))
            smaller = smaller and counts[0] < counts[1]
            texts.append(
                f"{model}: chaotic at {counts[0]} of {len(common)} frequencies at ξ = 0.01, at "
                f"{counts[1]} at ξ = 0.001"
            )
        return smaller, "; ".join(texts)

    def with_damping(self, flips: Finding) -> Finding:
        """The claim on the damping: fewer flips, and smaller chaotic ranges."""
        smaller, text = self.damping()
        note = flips.note.partition(";")[0] + (
            f"; chaotic frequencies in sweeps up from {RANGE_HZ[0]:g} to {RANGE_HZ[1]:g} Hz in "
            f"steps of {STEP_HZ:g} Hz"
        )
        return replace(
            flips, holds=bool(flips.holds) and smaller, text=f"{flips.text}; {text}", note=note
        )


def published_ranges(text: str) -> list[tuple[float, float]]:
    """Ends in Hz of ranges as the paper names them.

    Examples
    --------
    >>> published_ranges("30-37 and 59-66")
    [(30.0, 37.0), (59.0, 66.0)]
    """
    ends = [part.split("-") for part in text.split(" and ")]
    return [(float(low), float(high)) for low, high in ends]


@cache
def claimed_ranges(model: str) -> tuple[tuple[float, float], ...]:
    """Ends in Hz of the ranges in which the paper finds a model chaotic."""
    texts = [row["published"] for row in published_claims() if CLAIMS.get(row["id"]) == model]
    return tuple(ends for text in texts for ends in published_ranges(text))


def frequencies_hz(model: str) -> tuple[list[float], list[float]]:
    """Frequencies at which a model is swept up, and those at which it is swept down, too."""
    low, high = RANGE_HZ
    ends = claimed_ranges(model)
    claimed = [np.arange(a, b + 0.5 * CLAIMED_STEP_HZ, CLAIMED_STEP_HZ).tolist() for a, b in ends]
    down = sorted(hz for part in claimed for hz in part)
    up = np.arange(low, high + 0.5 * STEP_HZ, STEP_HZ).tolist()
    return sorted({*up, *down}), down


def piece_name(model: str, piece: int) -> str:
    """Name of what is swept of a model in one go."""
    return f"chaos_{model}_{piece}"


def sweep_piece(model: str, piece: int, progress: Progress) -> list[dict[str, Any]]:
    """Sweep a model up, then down, between two of `EDGES_HZ`; see how long its chaos lasts.

    Chaos is followed where the paper says so, at each frequency from the first chaotic motion.
    """
    low, high = EDGES_HZ[piece : piece + 2]
    up, down = ([hz for hz in ways if low < hz < high] for ways in frequencies_hz(model))
    flow = flow_of(scene_system(model))
    found: list[Settled] = []
    for way, frequencies in (("up", up), ("down", down[::-1])):
        for attractor in _swept(flow, frequencies):
            hz = attractor.frequency_hz
            followed = any(s.frequency_hz == hz and s.chaotic for s in found)
            ended: tuple[int, ...] = ()
            if attractor.kind == "chaotic" and hz in down and not followed:
                life = chaos_lifetime(attractor, states=STATES, periods=LASTING)
                ended = tuple(life.ended.tolist())
            largest = attractor.largest_exponent
            found.append(Settled(hz, cast(Way, way), attractor.kind, *largest, ended))
            progress("chaos", hz, len(found) / (len(up) + len(down)))
    return [asdict(settled) for settled in found]


def _swept(flow: FlowMap, frequencies: Sequence[float]) -> Iterator[Attractor]:
    """What motions settle on, each from the end of the one before."""
    state = np.zeros(2 * flow.system.size)
    observe = check_observe(flow.system, None)
    for hz in frequencies:
        attractor = attractor_from(flow, hz, observe, EFFORT, state)
        failed = attractor.kind == "failed"
        state = np.zeros_like(state) if failed else attractor.states[-1]
        yield attractor


def kept_piece(model: str, piece: int, folder: Path, progress: Progress) -> list[dict[str, Any]]:
    """As `sweep_piece`, unless the folder keeps it."""
    path = folder / f"{piece_name(model, piece)}.json"
    found: list[dict[str, Any]] = kept_numbers(path, lambda: sweep_piece(model, piece, progress))
    return found


def tasks_of_chaos(folder: Path) -> tuple[Task, ...]:
    """What is to be swept; the folder keeps it."""
    return tuple(
        Task(piece_name(model, piece), kept_piece, (model, piece, folder), _weight(model, piece))
        for model in MODELS
        for piece in range(len(EDGES_HZ) - 1)
    )


def _weight(model: str, piece: int) -> float:
    """Seconds that a piece takes, about, if half of the motions are chaotic."""
    low, high = EDGES_HZ[piece : piece + 2]
    up, down = (sum(low < hz < high for hz in ways) for ways in frequencies_hz(model))
    periods = 1500 * (up + down) + STATES * LASTING * down / 2
    return periods * SECONDS[model.partition("_")[0]]


def joined_chaos(values: Mapping[str, Any]) -> Chaos:
    """The pieces that were swept, together."""
    pieces = range(len(EDGES_HZ) - 1)
    swept = {
        model: [_settled(s) for piece in pieces for s in values[piece_name(model, piece)]]
        for model in MODELS
    }
    return Chaos(swept)


def _settled(values: Mapping[str, Any]) -> Settled:
    """As `sweep_piece` wrote it."""
    return Settled(**{**values, "ended": tuple(values["ended"])})


def _settling(within: Sequence[Settled]) -> str:
    """How long chaos lasts where some of the motions settle, in words."""
    lives = [s.lifetime for s in within if s.ended]
    ending = [life.lifetime for life in lives if life.settled]
    if not ending:
        return ""
    ends = " to ".join(dict.fromkeys(two_digits(f(ending)) for f in (min, max)))
    many = "frequency" if len(ending) == 1 else "frequencies"
    return f" (some motions settle at {len(ending)} {many}, after {ends} periods in the mean)"


def _typical(within: Sequence[Settled]) -> str:
    """The median chaotic exponent with its error, in words."""
    values = sorted((s.exponent, s.error) for s in within if s.chaotic)
    if not values:
        return ""
    value, error = values[len(values) // 2]
    return f" (median exponent {value:.3g} ± {error:.1g} 1/s)"


def write_chaos_figure(chaos: Chaos, folder: Path) -> None:
    """Draw the largest exponents of both models at both dampings, with their errors."""
    figure = Figure(figsize=(10.5, 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(2, 1, sharex=True)
    for ax, (model, name) in zip(axes, NAMES.items(), strict=True):
        for xi, colour in DAMPINGS.items():
            _draw(ax, chaos.swept[f"{model}_xi_{xi}"], f"ξ = {xi}", colour)
        ax.axhline(0.0, color="0.4", linewidth=0.8)
        ax.set_ylabel("largest Lyapunov exponent (1/s)")
        ax.set_title(name)
        ax.legend(**BESIDE, title="bars: standard\nerrors", title_fontsize="small")
    axes[-1].set_xlabel("excitation frequency (Hz)")
    axes[-1].set_xlim(RANGE_HZ)
    save_figure(axes[0], folder / FIGURE)


def _draw(ax: Axes, swept: Sequence[Settled], label: str, colour: str) -> None:
    """Draw the larger of the exponents at each frequency."""
    largest: dict[float, tuple[float, float]] = {}
    for settled in swept:
        if math.isfinite(settled.exponent):
            here = settled.exponent, settled.error
            before = largest.get(settled.frequency_hz, (-math.inf, 0.0))
            largest[settled.frequency_hz] = max(here, before)
    frequencies = sorted(largest)
    values = np.array([largest[hz] for hz in frequencies]).reshape(-1, 2)
    ax.errorbar(
        frequencies, *values.T, color=colour, label=label, linewidth=0.8, elinewidth=0.8,
        marker=".", markersize=4.0,
    )  # fmt: skip
