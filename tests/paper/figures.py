"""Figures 2 to 9 in the paper's layout, as PNG and SVG."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from nldyn.branches.branch import Branch
from nldyn.orbits.orbit import Orbit
from nldyn.plot.diagram import (
    BESIDE,
    new_axes_pair,
    plot_diagram,
    plot_orbit,
    save_figure,
)
from nldyn.plot.longterm import SHADE, shade_ranges
from nldyn.search.diagram import Diagram
from paper.chaos import CAPTION, FIGURE, SHADED, Chaos
from paper.evidence import nearest_unstable, orbits_at
from paper.jobs import is_wide

Results = Mapping[str, Diagram]

SECOND_MODE_HZ = 125.1  # the dashed lines of Figure 4: superharmonics expected at 125.1 Hz / n
DASHED = ("figure_4", "figure_5")

# Ranges in Hz that are enlarged, and where: left, bottom, width and height of the axes.
INSETS = {
    "figure_2": ((28.0, 46.0), (0.03, 0.48, 0.47, 0.45)),
    "figure_4": ((21.5, 24.5), (0.02, 0.5, 0.16, 0.42)),
    "figure_5": ((21.5, 24.5), (0.02, 0.5, 0.16, 0.42)),
    "figure_7": ((24.5, 29.0), (0.02, 0.5, 0.16, 0.42)),
    "figure_8": ((20.0, 27.0), (0.02, 0.5, 0.16, 0.42)),
}

CAPTIONS = {
    "figure_2": "Figure 2: 1-DOF model",
    "figure_3": "Figure 3: orbit of the 1-DOF model at 25.3 Hz",
    "figure_4": "Figure 4: 2-DOF model, ξ = 0.01",
    "figure_5": "Figure 5: 2-DOF model, ξ = 0.001",
    "figure_6": "Figure 6: orbits of the 2-DOF model at 23.0 Hz, ξ = 0.001",
    "figure_7": "Figure 7: 4-DOF model, ξ = 0.01",
    "figure_8": "Figure 8: 4-DOF model, ξ = 0.001",
    "figure_9": "Figure 9: orbits of the 4-DOF model at 22.5 Hz, ξ = 0.001",
    FIGURE: CAPTION,
}

# The computations that a diagram shows.
SHOWN = {
    "figure_2": ("one_dof", "one_dof.listed"),
    "figure_4": ("two_dof_xi_0.01",),
    "figure_5": ("two_dof_xi_0.001", "two_dof.sub14"),
    "figure_7": ("four_dof_xi_0.01",),
    "figure_8": ("four_dof_xi_0.001",),
}


def title(name: str, results: Results) -> str:
    """The caption of a figure, with the range that was computed if it is a diagram."""
    branches = shown(name, results)
    if not branches:
        return CAPTIONS[name]
    low = min(float(branch.frequency_hz.min()) for branch in branches)
    return f"{CAPTIONS[name]}, computed from {low:.3g} to 90 Hz"


def shown(name: str, results: Results) -> list[Branch]:
    """Branches of a figure: the harmonic ones, the wide subharmonic ones and all doubled ones."""
    found = [branch for job in SHOWN.get(name, ()) if job in results
             for branch in results[job].branches]  # fmt: skip
    if name == "figure_2":
        return found
    return [b for b in found if b.period not in (2, 3) or is_wide(b)]


def legend_text(name: str) -> str:
    """What the page says below a figure beside its title."""
    shaded = " Shaded: frequencies at which a motion is chaotic." if name in SHADED else ""
    if name not in DASHED:
        return shaded
    return shaded + (
        f" Dashed lines: f₂/2 to f₂/5 with f₂ = {SECOND_MODE_HZ:g} Hz, the frequency of the second "
        "mode; its superharmonic peaks lie near them."
    )


def write_figures(results: Results, folder: Path, chaos: Chaos | None = None) -> None:
    """Write all figures to a folder; those of the larger models with their chaotic ranges."""
    for name in SHOWN:
        branches = shown(name, results)
        ax = _diagram(branches, title(name, results))
        if chaos is not None:
            _shade(ax, chaos.ranges(name))
        if name in DASHED:
            _dashed(ax, (2, 3, 4, 5))
        _inset(ax, branches, *INSETS[name])
        save_figure(ax, folder / name)
    _orbits(orbits_at(results["one_dof"], 1, 25.3)[:1], "figure_3", folder)
    _orbits(orbits_at(results["two_dof_xi_0.001"], 1, 23.0)[:3], "figure_6", folder)
    four = results["four_dof_xi_0.001"]
    wanted = nearest_unstable(four, 3, 22.5)
    _orbits([*orbits_at(four, 1, 22.5)[:2], *([wanted] if wanted else [])], "figure_9", folder)


def _diagram(branches: Iterable[Branch], heading: str) -> Axes:
    ax = plot_diagram(branches, special_points=(), unit="mm", references=False)
    ax.set_xlim(0.0, 90.0)
    ax.set_title(heading)
    return ax


def _shade(ax: Axes, ranges: Sequence[tuple[float, float]]) -> None:
    """Shade chaotic ranges, and say so in the legend."""
    shade_ranges(ax, ranges)
    legend = ax.get_legend()
    if ranges and legend is not None:
        handles = [*filter(None, legend.legend_handles), Patch(color=SHADE, alpha=0.6)]
        texts = [text.get_text() for text in legend.get_texts()]
        ax.legend(handles, [*texts, "a motion is chaotic"], **BESIDE)


def _dashed(ax: Axes, orders: Iterable[int]) -> None:
    """Mark and name where superharmonics of the second mode are expected."""
    for n in orders:
        hz = SECOND_MODE_HZ / n
        ax.axvline(hz, color="0.6", lw=0.8, ls="--", zorder=0)
        text = f" f₂/{n}" + (f", f₂ = {SECOND_MODE_HZ:g} Hz" if n == 2 else "")
        ax.text(hz, 0.97, text, color="0.4", fontsize=8, transform=ax.get_xaxis_transform())


def _inset(
    ax: Axes,
    branches: list[Branch],
    range_hz: tuple[float, float],
    bounds: tuple[float, float, float, float],
) -> None:
    """Enlarge a range of frequencies where the diagram is empty."""
    low, high = range_hz
    small = ax.inset_axes(bounds)
    plot_diagram(branches, small, special_points=(), unit="mm", references=False, legend=False)
    tops = [
        1e3 * o.max_abs_displacement
        for b in branches
        for o in b.points
        if low <= o.frequency_hz <= high
    ]
    small.set_xlim(low, high)
    small.set_ylim(0.0, 1.1 * max(tops, default=1.0))
    small.set_xlabel("")
    small.set_ylabel("")
    small.yaxis.tick_right()
    small.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    small.yaxis.set_major_formatter("{x:g}")
    small.tick_params(labelsize=7)
    small.set_title(f"{low:g} to {high:g} Hz", fontsize=8)


def _orbits(orbits: list[Orbit], name: str, folder: Path) -> None:
    """One picture for each orbit: ``name.png`` for the first, then ``name_b``, ``name_c``.

    The title tells the frequency of an orbit that is not at the one in the caption.
    """
    caption = CAPTIONS[name].replace("orbits", "orbit")
    for letter, orbit in zip("abc", orbits, strict=False):
        upper, lower = new_axes_pair()
        plot_orbit(orbit, (upper, lower))
        state = "stable" if orbit.stable else "unstable"
        impacts = f"{orbit.impacts} impact{'' if orbit.impacts == 1 else 's'}"
        deepest = len(orbit.impact_list)
        peaks = f" with {deepest} peaks" if deepest > orbit.impacts else ""
        which = f"orbit {letter}, " if len(orbits) > 1 else ""
        at = f"{orbit.frequency_hz:.4g} Hz"
        where = "" if at in caption or at.replace(" Hz", ".0 Hz") in caption else f", at {at}"
        upper.set_title(f"{caption}\n{which}{state}, {impacts}{peaks}{where}")
        save_figure(upper, folder / (name if letter == "a" else f"{name}_{letter}"))
