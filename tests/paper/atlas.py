"""The atlas: complete diagrams of the larger models, with all branches that are known.

Each kept start leads to branches, which are followed over the whole range, with their flips up to
period 8. What a start leads to is a file of its own, so that a run that was interrupted goes on
with the starts left.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from nldyn.bifurcations.kinds import KINDS
from nldyn.branches.branch import Branch
from nldyn.branches.continuation import broken_off
from nldyn.branches.step_control import ContinuationOptions
from nldyn.orbits.axis import Axis
from nldyn.plot.diagram import plot_diagram, save_figure
from nldyn.report.results import write_table
from nldyn.runtime.files import write_whole
from nldyn.runtime.progress import Progress
from nldyn.runtime.result_directory import OutputError
from nldyn.search.collector import notes_on_ends
from nldyn.search.diagram import Diagram
from nldyn.search.fixed_point_index import index_note
from paper.jobs import scene_system
from paper.kept import stamp
from paper.starts import follow_starts, longest_whole, read_starts
from paper.workers import Task, Workers

# Branches of the larger models are long. One that is cut off by max_points would be found and
# followed again from the next orbit.
LONG = ContinuationOptions(max_points=20000)

# Flips are followed to period 8. Branches of period 6 and 8, whose own flips are not, have up to 25
# points each way; those of the model with several thousand flips up to 10.
DOUBLED, MANY_DOUBLED = (8, 25), (8, 10)
ABOUT = "atlas.json"
TALL = 60.0  # inches wide: one that is zoomed into


@dataclass(frozen=True)
class Chart:
    """A model of the atlas.

    Parameters
    ----------
    name : str
        Of its scene and its starts.
    range_hz : (float, float)
        Frequencies.
    doubled : (int, int)
        As for `follow_starts`.
    orbits : int
        About how many orbits it has, from which the time that it takes is estimated.
    """

    name: str
    range_hz: tuple[float, float]
    doubled: tuple[int, int]
    orbits: int

    @property
    def families(self) -> tuple[int, ...]:
        """Odd parts of the periods of its starts; no branch of one leads to one of another."""
        return tuple(sorted({odd_part(start.period) for start in read_starts(self.name)}))


CHARTS = (
    Chart("four_dof_xi_0.001", (18.0, 90.0), MANY_DOUBLED, 257_000),
    Chart("two_dof_xi_0.001", (18.0, 90.0), DOUBLED, 90_000),
    Chart("two_dof_xi_0.01", (15.0, 90.0), DOUBLED, 44_000),
    Chart("four_dof_xi_0.01", (15.0, 90.0), DOUBLED, 30_000),
)


def chart_named(name: str) -> Chart:
    """The chart of a model."""
    return next(chart for chart in CHARTS if chart.name == name)


def odd_part(period: int) -> int:
    """A period without its factors of two, which flips add."""
    return period // (period & -period)


def atlas_folder(out: str | Path) -> Path:
    """The directory of an atlas, made if there is none; what other code left there is refused.

    Raises
    ------
    OutputError
        If it is the atlas of other code or starts, holds something else, or cannot be made.
    """
    folder, mark = Path(out), stamp()
    about = folder / ABOUT
    try:
        if folder.exists() and any(folder.iterdir()):
            if not about.is_file():
                raise OutputError(f"{out}: holds something else than an atlas")
            if json.loads(about.read_bytes()).get("made_by") != mark:
                raise OutputError(f"{out}: is an atlas of another version; choose another place")
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError, AttributeError) as error:
        raise OutputError(f"{out}: {error}") from None
    write_whole(about, json.dumps({"made_by": mark}).encode())
    return folder


def write_atlas(folder: Path, workers: Workers) -> list[list[object]]:
    """Follow all starts, in processes, and write pictures and the table of what was found."""
    tasks = tuple(
        Task(f"{chart.name}, family {family}", follow_family, (chart.name, family, folder), weight)
        for chart in CHARTS
        for family, weight in _weights(chart).items()
    )
    workers.values(tasks)
    rows = [_chart_row(chart, _whole(chart, folder), folder) for chart in CHARTS]
    write_table(folder / "atlas.csv", COLUMNS, rows)
    return rows


def _weights(chart: Chart) -> dict[int, float]:
    """Orbits of the families of a chart, if each start leads to as many."""
    starts = read_starts(chart.name)
    counts = Counter(odd_part(start.period) for start in starts)
    return {family: chart.orbits * counts[family] / len(starts) for family in chart.families}


def follow_family(name: str, family: int, folder: Path, progress: Progress) -> tuple[str, ...]:
    """Follow the starts of one family of a model into files; what is there already is kept."""
    chart = chart_named(name)
    (folder / name).mkdir(exist_ok=True)
    starts = [s for s in read_starts(name) if odd_part(s.period) == family]
    place = partial(start_path, folder, name, family)
    system = scene_system(name)
    found = follow_starts(
        system, starts, chart.range_hz, LONG, chart.doubled, progress, keep_at=place
    )
    return found.notes


def start_path(folder: Path, name: str, family: int, number: int) -> Path:
    """File of what a start of a family leads to."""
    return folder / name / f"family_{family}_start_{number:03d}.h5"


def has_charts(folder: Path) -> bool:
    """Whether a directory keeps what any start leads to."""
    return any(folder.glob("*/family_*_start_*.h5"))


COLUMNS = (
    "model", "starts", "branches", "orbits", *KINDS, "largest_newton_step",
    "largest_liouville_error", "indices", "broken_off",
)  # fmt: skip


def _whole(chart: Chart, folder: Path) -> Diagram:
    """All branches of a chart, from its files."""
    parts = []
    for family in chart.families:
        starts = [s for s in read_starts(chart.name) if odd_part(s.period) == family]
        place = partial(start_path, folder, chart.name, family)
        parts.append(
            follow_starts(
                scene_system(chart.name), starts, chart.range_hz, LONG, chart.doubled, keep_at=place
            )
        )
    return joined(parts, chart)


def joined(parts: Sequence[Diagram], chart: Chart) -> Diagram:
    """The diagrams of the families of a chart as one, with what all of them together tell."""
    branches = tuple(branch for part in parts for branch in part.branches)
    notes = tuple(note for part in parts for note in part.notes)
    told = index_note(branches, Axis.in_frequency(chart.range_hz), longest_whole(chart.doubled[0]))
    notes = (*summed_up(branches, notes), told)
    return Diagram(branches, chart.range_hz, parts[0].observe, notes)


def summed_up(branches: Sequence[Branch], notes: Sequence[str]) -> list[str]:
    """How many ends of branches were broken off for which reason, and all other notes."""
    reasons = Counter(reason for branch in branches for _, reason in broken_off(branch))
    each = {note for branch in branches for note in notes_on_ends(branch)}
    counted = [f"{n} ends of branches broken off: {why}" for why, n in reasons.items()]
    return counted + [note for note in notes if note not in each]


def _chart_row(chart: Chart, found: Diagram, folder: Path) -> list[object]:
    """Draw a chart; what the table tells of it."""
    ax = plot_diagram(found, special_points=(), unit="mm", references=False, hover=False)
    figure = ax.get_figure(root=True)
    assert figure is not None
    figure.set_size_inches(TALL, 0.4 * TALL)
    ax.set_xlim(chart.range_hz)
    ax.set_title(f"{chart.name}: all branches that are known")
    save_figure(ax, folder / chart.name / "diagram")
    orbits = [orbit for branch in found.branches for orbit in branch.points]
    kinds = Counter(s.kind for branch in found.branches for s in branch.special_points)
    errors = [orbit.liouville_error for orbit in orbits]
    return [
        chart.name, len(read_starts(chart.name)), len(found.branches), len(orbits),
        *(kinds[kind] for kind in KINDS),
        f"{max((orbit.error for orbit in orbits), default=0.0):.1e}",
        f"{max((e for e in errors if e == e), default=0.0):.1e}",
        found.notes[-1],
        sum(len(broken_off(branch)) for branch in found.branches),
    ]  # fmt: skip
