"""The report: one page for a browser with the diagram, its orbits, tables, scene and errors."""

from __future__ import annotations

import html
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np
import numpy.typing as npt

from nldyn.bifurcations.kinds import KINDS, title_of
from nldyn.branches.branch import Branch
from nldyn.plot.diagram import (
    MANY_MARKS,
    are_limit_cycles,
    beside_stable,
    branch_curve,
    branch_kind,
    file_figure,
    orbit_text,
    period_colours,
    plot_frequency,
    stability_runs,
    stop_places,
)
from nldyn.plot.words import Along, axis_unit, direction_of, displacement_of, units_of
from nldyn.report.contact import png_of
from nldyn.report.deflection import surface_content
from nldyn.report.offline import Table, as_table, versions, write_html
from nldyn.report.orbit_content import (
    ChosenOrbit,
    chosen_orbits,
    even,
    friction_columns,
    known,
    modal_motion,
    orbit_content,
    samples_each,
    stops_of,
)
from nldyn.report.stop_spheres import not_drawn
from nldyn.search.diagram import Diagram
from nldyn.system.chart import THE_FREQUENCY, parameter_name
from nldyn.system.naming import is_angle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    import cms
    from fem.render import StopSphere
    from fem.render.pictures import AnyComponent
    from nldyn.bifurcations.point import SpecialPoint
    from nldyn.orbits.orbit import Orbit
    from nldyn.scene.schema.scene import Scene

MOST_POINTS = 10_000  # of all branches together that are drawn and listed
NO_STOPS: dict[str, Any] = {"names": [], "turn": []}
LINE = 62  # letters in a line of what is shown at the pointer


@dataclass(frozen=True, eq=False)
class Drawn:
    """A structure that can be shown deflected.

    Parameters
    ----------
    component : fem.Component
        Of a mesh.
    reduced : cms.ReducedModel
        What it was reduced to: the modal coordinates are those of the orbits.
    mirror : str, optional
        A point on a plane of symmetry, to draw half a frame whole.
    stops : sequence of fem.render.StopSphere
        The stops that can be drawn.
    """

    component: AnyComponent
    reduced: cms.ReducedModel
    mirror: str | None = None
    stops: Sequence[StopSphere] = ()

    @property
    def surface(self) -> dict[str, Any]:
        """What the page shows of it, see `surface_content`."""
        return surface_content(self.component, self.reduced, self.mirror, self.stops)


def write_page(
    diagram: Diagram,
    path: Path,
    tables: Mapping[str, Table],
    summary: Mapping[str, Any],
    *,
    contact: Figure | None,
    scene: Scene | None = None,
    surface: Mapping[str, Any] | None = None,
    notes: Iterable[str] = (),
    yscale: Literal["linear", "log"] = "linear",
) -> None:
    """Write one HTML file that shows a diagram and its orbits in a browser, without a network.

    Parameters
    ----------
    diagram : Diagram
        What to show.
    path : Path
        The file.
    tables : dict of str to (columns, rows)
        ``points``, ``special_points`` and ``ends`` of the branches, as `write_results` writes them.
    summary : dict
        What `nldyn.report.results.summary` says of the diagram.
    contact : matplotlib.figure.Figure or None
        What `contact_figure` drew of it.
    scene : Scene, optional
        Its text and its title are shown.
    surface : dict, optional
        What `surface_content` gives of the structure, if there is one to be shown deflected.
    notes : iterable of str
        What is to be said beside the notes of the diagram.
    yscale : {"linear", "log"}
        Scale of the displacement axis at first.
    """
    branches = diagram.branches
    told = told_branches(diagram, tables)
    heights = [[node.orbit.max_abs_displacement for node in branch.nodes] for branch in told]
    system = branches[0].points[0].system if branches else None
    direction = scene.direction_at(diagram.observe) if scene else ""
    if system is not None:
        direction = direction_of(system, diagram.observe, direction)
    factor, unit = axis_unit(max((max(y) for y in heights), default=1.0), units_of(direction))
    system = branches[0].points[0].system if branches else None
    along = Along.of(diagram.parameter, max(map(abs, diagram.limits)), system)
    chosen = chosen_orbits(branches, heights)
    kept = kept_points(branches)
    notes = [*notes, *dict.fromkeys(diagram.notes), *limits(diagram, chosen, kept)]
    samples = samples_each(len(chosen))
    orbits = [orbit_content(each, diagram.axis, along, samples) for each in chosen]
    kinds = dict.fromkeys([*KINDS, *(s.kind for b in branches for s in b.special_points)])
    content: dict[str, Any] = {
        "title": (scene.title if scene else "") or "Bifurcation diagram",
        "answer": summary.get("answer", []),
        "range": [value / along.factor for value in diagram.limits],
        "span": along.range(*diagram.limits) + told_frequency(diagram),
        "along": along.label,
        "place": ["" if along.in_frequency else f"{along.noun} ", along.unit],
        "observed": displacement_of(diagram.observe, direction),
        "angle": is_angle(direction),
        "natural_hz": natural_hz(diagram),
        "gaps": gaps_of(diagram),
        "many": MANY_MARKS,
        "factor": factor,
        "unit": unit,
        "yscale": yscale,
        "notes": notes,
        "branches": drawn_branches(told, kept, along, factor, unit),
        "special": special_marks(told, along, factor, unit),
        "kinds": {kind: title_of(kind) for kind in kinds},
        "stops": stops_of(branches[0].points[0]) if branches else NO_STOPS,
        "friction": friction_columns(branches[0].points[0]) if branches else [],
        "orbits": orbits,
        "contact": png_of(contact),
        "frequency": png_of(frequency_figure(diagram)),
        "period": "period" if are_limit_cycles(branches) else "excitation period",
        "tables": {
            "special points": special_table(tables["special_points"], along, factor, unit),
            "branches": branch_table(branches, tables, along),
            "points": as_table(kept_rows(tables["points"], branches, kept)),
        },
        "errors": error_table(diagram, tables, summary, orbits),
        "versions": versions(),
        "system": repr(system) if system else "",
        "scene": scene.text if scene else "",
    }
    if surface is not None:
        content["surface"] = surface
        content["not_drawn"] = not_drawn(scene) if scene else []
        for shown, each in zip(orbits, chosen, strict=True):
            if "fault" not in shown:
                shown["motion"] = modal_motion(each.orbit)
    write_html(path, "page.html", content)


def frequency_figure(diagram: Diagram) -> Figure | None:
    """The frequencies of self-excited motions along their branches; None of others."""
    if not are_limit_cycles(diagram.branches):
        return None
    figure = file_figure(9.0, 3.0)
    plot_frequency(diagram, figure.add_subplot())
    return figure


def told_frequency(diagram: Diagram) -> str:
    """At which frequency a diagram is drawn over another parameter."""
    return "" if diagram.frequency_hz is None else f", at {diagram.frequency_hz:g} Hz"


def natural_hz(diagram: Diagram) -> list[float]:
    """Natural frequencies in Hz to be drawn in a diagram over the frequency."""
    if not diagram.branches or diagram.parameter != THE_FREQUENCY:
        return []
    found: list[float] = diagram.branches[0].points[0].system.frequencies_hz.tolist()
    return found


def gaps_of(diagram: Diagram) -> list[float]:
    """Distances in m at which the observed interface meets stops, where these do not change."""
    if not diagram.branches or diagram.parameter.name == "gap":
        return []
    orbit = diagram.branches[0].points[0]
    return sorted({abs(place) for place in stop_places(orbit.system, orbit.observe)})


@dataclass(frozen=True)
class ToldOrbit:
    """What the tables tell of an orbit, as far as it is drawn."""

    max_abs_displacement: float
    impacts: int
    stable: bool = False
    largest_multiplier: float = 0.0


@dataclass(frozen=True)
class ToldPoint:
    """Where an orbit lies along its branch."""

    orbit: ToldOrbit
    arclength: float
    value: float


@dataclass(frozen=True)
class ToldSpecial:
    """A special point, and what it means."""

    kind: str
    point: ToldPoint
    meaning: str

    @property
    def orbit(self) -> ToldOrbit:
        """The orbit."""
        return self.point.orbit


@dataclass(frozen=True)
class ToldBranch:
    """A branch as the tables tell it: its orbits need not be computed again."""

    name: str
    period: int
    nodes: list[ToldPoint]
    special_points: list[ToldSpecial]
    kind: str


def told_branches(diagram: Diagram, tables: Mapping[str, Table]) -> list[ToldBranch]:
    """The branches of a diagram, with the numbers of its tables."""
    points, special = records(tables["points"]), records(tables["special_points"])
    name_of_value = parameter_name(diagram.parameter)
    found = []
    for branch in diagram.branches:
        nodes = [
            ToldPoint(
                ToldOrbit(
                    row["max_abs_displacement"],
                    row["impacts"],
                    bool(row["stable"]),
                    row["largest_multiplier"],
                ),
                node.arclength,
                row[name_of_value],
            )
            for node, row in zip(branch.nodes, points, strict=False)
        ]
        marks = [
            ToldSpecial(
                str(row["type"]),
                ToldPoint(
                    ToldOrbit(row["max_abs_displacement"], row["impacts"]),
                    each.point.arclength,
                    row[name_of_value],
                ),
                str(row["meaning"]),
            )
            for each, row in zip(branch.special_points, special, strict=False)
        ]
        kind = branch_kind(branch)
        found.append(ToldBranch(branch.name or kind, branch.period, nodes, marks, kind))
    return found


def records(table: Table) -> Iterator[dict[str, Any]]:
    """The rows of a table by the names of its columns; those of sizes without m or rad.

    Examples
    --------
    >>> list(records((("impacts", "max_penetration_rad"), [(1, 0.2)])))
    [{'impacts': 1, 'max_penetration': 0.2}]
    """
    columns, rows = table
    names = [column.removesuffix("_m").removesuffix("_rad") for column in columns]
    return (dict(zip(names, row, strict=True)) for row in rows)


def kept_points(branches: Sequence[Branch]) -> list[list[int]]:
    """Numbers of the points of each branch that are drawn: all, or evenly spaced ones."""
    counts = [len(branch.points) for branch in branches]
    share = min(1.0, MOST_POINTS / max(sum(counts), 1))
    return [even(count, max(2, int(share * count))) for count in counts]


def limits(
    diagram: Diagram, chosen: Sequence[ChosenOrbit], kept: Sequence[Sequence[int]]
) -> list[str]:
    """Say what the page does not hold."""
    special = sum(len(branch.special_points) for branch in diagram.branches)
    points = sum(len(branch.points) for branch in diagram.branches)
    shown = sum(each.special >= 0 for each in chosen)
    spread = len(chosen) - shown
    dots = f"all {points} points"
    if spread < points:
        dots = f"{spread} of {points} points, evenly spaced"
    marks = f"{shown} of {special} special points and of " if special else ""
    said = [f"{len(chosen)} orbits can be looked at: those of {marks}{dots} (the dots)."]
    if shown < special:
        said.append(
            "Of special points those beside a stable orbit come first, evenly spaced ones of the "
            "others follow; a click on one that is not kept says so."
        )
    drawn = sum(map(len, kept))
    if drawn < points:
        said.append(
            f"The diagram is thinned: it shows {drawn} of {points} points; branches.csv has all."
        )
    return said


def drawn_branches(
    branches: Sequence[ToldBranch],
    kept: Sequence[Sequence[int]],
    along: Along,
    factor: float,
    unit: str,
) -> list[dict[str, Any]]:
    """Lines and points of the branches; displacements in units of ``factor`` metres."""
    colours = period_colours(branch.period for branch in branches)
    found = []
    for branch, numbers in zip(branches, kept, strict=True):
        x, y, stable = branch_curve(cast("Branch", branch))
        step = -(-len(branch.nodes) // max(len(numbers), 1))
        nodes = [branch.nodes[i] for i in numbers]
        runs = [
            {
                "stable": run.stable,
                "x": rounded(thinned(x[run.start : run.stop], step) / along.factor),
                "y": rounded(thinned(y[run.start : run.stop], step) / factor),
            }
            for run in stability_runs(stable)
        ]
        found.append(
            {
                "name": branch.name,
                "period": branch.period,
                "period_name": branch.kind,
                "colour": colours[branch.period],
                "runs": runs,
                "numbers": list(numbers),
                "x": rounded(node.value / along.factor for node in nodes),
                "y": rounded(node.orbit.max_abs_displacement / factor for node in nodes),
                "text": [
                    orbit_text(
                        cast("Orbit", node.orbit), along.told(node.value, 7), factor, unit
                    ).replace("\n", "<br>")
                    for node in nodes
                ],
            }
        )
    return found


def special_marks(
    branches: Sequence[ToldBranch], along: Along, factor: float, unit: str
) -> list[dict[str, Any]]:
    """Special points with what they mean, in the order of their table."""
    return [
        {
            "branch": number,
            "index": index,
            "kind": special.kind,
            "beside_stable": beside_stable(cast("Branch", branch), cast("SpecialPoint", special)),
            "x": float(f"{special.point.value / along.factor:.9g}"),
            "y": float(f"{special.orbit.max_abs_displacement / factor:.9g}"),
            "sentence": special.meaning,
            "text": "<br>".join(textwrap.wrap(html.escape(special.meaning), LINE)),
        }
        for number, branch in enumerate(branches)
        for index, special in enumerate(branch.special_points)
    ]


def special_table(table: Table, along: Along, factor: float, unit: str) -> dict[str, Any]:
    """What special points mean, first, and where they are; special_points.csv has every digit.

    Examples
    --------
    >>> names = ("meaning", "type", "frequency_hz", "max_abs_displacement_m", "branch")
    >>> row = ("A fold.", "LP", 20.123456789, 1.23456789e-4, "1/1")
    >>> special_table((names, [row]), Along(THE_FREQUENCY), 1e-6, "µm")["rows"]
    [['A fold.', 'LP', 20.1235, 123.457, '1/1', None, None]]
    """
    size_name = f"largest {'rotation' if unit.endswith('rad') else 'displacement'} ({unit})"
    rows = []
    for row in records(table):
        value, size = row[along.column] / along.factor, row["max_abs_displacement"] / factor
        told = [row["meaning"], row["type"], float(f"{value:.6g}"), float(f"{size:.6g}")]
        rows.append([*told, row["branch"], row.get("period"), row.get("impacts")])
    columns = ["meaning", "type", along.head, size_name]
    return {"columns": [*columns, "branch", "period", "impacts"], "rows": rows}


def rounded(values: Iterable[float]) -> list[float]:
    """Numbers for a drawing, to nine digits."""
    return [float(f"{value:.9g}") for value in values]


def thinned(values: np.ndarray[Any, Any], step: int) -> np.ndarray[Any, Any]:
    """Every so-many-th number, and the last one.

    Examples
    --------
    >>> thinned(np.arange(6.0), 2).tolist()
    [0.0, 2.0, 4.0, 5.0]
    """
    return values if step == 1 else np.append(values[:-1:step], values[-1])


def kept_rows(table: Table, branches: Sequence[Branch], kept: Sequence[Sequence[int]]) -> Table:
    """The rows of the points that are drawn, of a table that has all points branch by branch."""
    columns, rows = table
    starts = np.cumsum([0, *(len(branch.points) for branch in branches)]).tolist()
    wanted = [
        rows[start + number]
        for start, numbers in zip(starts, kept, strict=False)
        for number in numbers
    ]
    return columns, wanted


def branch_table(
    branches: Sequence[Branch], tables: Mapping[str, Table], along: Along
) -> dict[str, Any]:
    """Branches, one a row: where they go, why they end, and the largest errors along them."""
    size = next(name for name in tables["points"][0] if name.startswith("max_abs_displacement"))
    columns = (
        "branch", "period", "points", "special_points", f"lowest {along.head}",
        f"highest {along.head}",
        size, "stable_points", "largest_relative_error",
        "largest_liouville_error", "largest_uncertainty", "first_end", "last_end",
    )  # fmt: skip
    points, ends = records(tables["points"]), records(tables["ends"])
    rows = []
    for branch in branches:
        told = [next(points) for _ in branch.points]
        values = [row[along.column] / along.factor for row in told]
        rows.append(
            [
                branch.name,
                branch.period,
                len(told),
                len(branch.special_points),
                min(values),
                max(values),
                max(row["max_abs_displacement"] for row in told),
                sum(int(row["stable"]) for row in told),
                largest([orbit.error for orbit in branch.points]),
                largest([row["liouville_error"] for row in told]),
                largest([row["relative_uncertainty"] for row in told]),
                *(str(next(ends)["reason"]) for _ in range(2)),
            ]
        )
    return {"columns": list(columns), "rows": rows}


def error_table(
    diagram: Diagram,
    tables: Mapping[str, Table],
    summary: Mapping[str, Any],
    orbits: Sequence[Mapping[str, Any]],
) -> list[list[object]]:
    """The tolerance and the errors that are claimed: what, how large, how it is known."""
    branches = diagram.branches
    if not branches:
        return []
    special = [each for branch in branches for each in branch.special_points]
    flow = np.array([each["flow_error"] for each in orbits if "flow_error" in each], dtype=float)
    flow = flow.reshape(-1, 2)
    return [
        [
            "tolerance of the flow map, relative (rtol)",
            branches[0].points[0].problem.flow.options.rtol,
            "asked for",
        ],
        [
            "error of the orbits, relative",
            summary["largest_relative_error"],
            "the last step of Newton's method; the largest of all points",
        ],
        [
            "error of the flow map, of states, relative",
            largest(flow[:, 0]),
            "compared with a finer flow map; the largest of the orbits shown",
        ],
        [
            "error of the flow map, of monodromy matrices, relative",
            largest(flow[:, 1]),
            "compared with a finer flow map; the largest of the orbits shown",
        ],
        [
            "error of Liouville's formula",
            summary["largest_liouville_error"],
            "an independent check of the determinant; the largest of all points",
        ],
        [
            "uncertainty of ln |largest multiplier|",
            largest([row["relative_uncertainty"] for row in records(tables["points"])]),
            "estimated; the largest of all points",
        ],
        [
            "points whose stability is undecided",
            summary["stability_undecided"],
            "the unit circle lies within the uncertainty",
        ],
        [
            "error of the places of special points, relative",
            largest([each.error for each in special]),
            "estimated; the largest of all",
        ],
    ]


def largest(values: npt.ArrayLike) -> float | None:
    """The largest of some numbers for JSON; None if there are none, or one is nan or infinite.

    Examples
    --------
    >>> largest([1.0, 2.0]), largest([1.0, float("nan")]), largest([])
    (2.0, None, None)
    """
    array = np.asarray(values, dtype=float)
    return known(float(np.max(array))) if array.size else None
