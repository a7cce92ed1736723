"""Write branches, special points and diagrams to a directory.

``branches.csv`` and ``special_points.csv`` hold every number to the last digit, in SI units;
``branches.h5`` has the branches themselves, see `nldyn.io.branches`; ``report.html`` shows them.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from nldyn.base.version import software_version
from nldyn.bifurcations.normal_forms import normal_form
from nldyn.branches.cascades import cascades_in
from nldyn.branches.endings import Ending
from nldyn.branches.tables import at_known, friction_names, orbit_columns, size_names
from nldyn.io.store import save
from nldyn.plot.diagram import save_diagram, save_figure
from nldyn.report.answer import answer_lines
from nldyn.report.contact import contact_figure
from nldyn.report.offline import Table
from nldyn.report.page import write_page
from nldyn.runtime.result_directory import result_directory
from nldyn.search.exploration import Exploration
from nldyn.system.chart import THE_FREQUENCY, parameter_name

if TYPE_CHECKING:
    from nldyn.bifurcations.point import BranchNode
    from nldyn.branches.branch import Branch
    from nldyn.branches.cascades import Cascade
    from nldyn.report.page import Drawn
    from nldyn.scene.schema.scene import Scene
    from nldyn.search.diagram import Diagram
    from nldyn.search.exploration import Exploration

DISPLACEMENT, PENETRATION = "max_abs_displacement", "max_penetration"  # without their units
FRICTION = "friction"  # its columns, where there is any
BRANCH_COLUMNS = (
    "branch",
    "point",
    "period",
    "frequency_hz",
    DISPLACEMENT,
    PENETRATION,
    "impacts",
    FRICTION,
    "stable",
    "largest_multiplier",
    "multiplier_angle_deg",
    "relative_uncertainty",
    "liouville_error",
)
SPECIAL_COLUMNS = (
    "branch",
    "period",
    "type",
    "frequency_hz",
    DISPLACEMENT,
    "impacts",
    "normal_form",
    "coefficient",
    "coefficient_error",
    "relative_shift",
    "meaning",
)

END_COLUMNS = (
    "branch",
    "end",
    "frequency_hz",
    DISPLACEMENT,
    "broken_off",
    "reason",
)
FILES = {
    "points": "branches.csv",
    "special_points": "special_points.csv",
    "ends": "ends.csv",
}
COVERAGE_COLUMNS = ("periods", "settled", "unsettled", "failed")


def write_results(
    found: Diagram | Exploration,
    directory: str | Path,
    scene: Scene | None = None,
    *,
    drawn: Drawn | None = None,
    yscale: Literal["linear", "log"] = "linear",
) -> Path:
    """Write a diagram as tables, pictures and a page for a browser, all of them or nothing.

    Parameters
    ----------
    found : Diagram or Exploration
        What `nldyn.scene.run.results_of` gave.
    directory : str or Path
        New, empty, or written by an earlier run, whose files are replaced; other files in it
        are kept. Gets ``branches.csv``, ``special_points.csv``, ``ends.csv``, ``branches.h5``,
        ``diagram.png``, ``diagram.svg``, ``summary.json``, ``report.html``, with an exploration
        ``coverage.csv``, with areas of contact or friction ``contact.png`` and ``contact.svg`` and,
        with a scene, ``scene.toml``.
    scene : Scene, optional
        The scene it was computed from; its text is copied.
    drawn : Drawn, optional
        The structure, for the page to show it deflected.
    yscale : {"linear", "log"}
        Scale of the displacement axis of the diagram.

    Returns
    -------
    Path
        The directory.

    Raises
    ------
    OutputError
        If the directory holds only other people's files or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from nldyn import System, Unbalance, diagram
    >>> system = System.from_modal([13.1], {"middle": [0.635]}, modal_damping=0.0142,
    ...     excitation=[Unbalance("middle", 4.92e-6)])
    >>> computed = diagram(system, (10.0, 16.0), [1], search_points=1)
    >>> folder = write_results(computed, tempfile.mkdtemp())
    >>> (folder / "branches.csv").read_text()[:20]
    'branch,point,period,'
    """
    exploration = found if isinstance(found, Exploration) else None
    diagram = found.diagram if isinstance(found, Exploration) else found
    with result_directory(directory, "run") as folder:
        tables = tables_of(diagram)
        for part, (columns, rows) in tables.items():
            write_table(folder / FILES[part], columns, rows)
        save(found, folder / "branches.h5")
        if exploration is not None:
            columns = (parameter_name(diagram.parameter), *COVERAGE_COLUMNS)
            write_table(folder / "coverage.csv", columns, coverage_rows(exploration))
        title = scene.title if scene else ""
        direction = scene.direction_at(diagram.observe) if scene else ""
        save_diagram(diagram, folder, title=title, direction=direction, yscale=yscale)
        pressed = contact_figure(diagram, scene)
        if pressed is not None:
            save_figure(pressed.axes[0], folder / "contact")
        answer = answer_lines(diagram, tables["special_points"])
        told = {**summary(diagram), "answer": answer}
        text = json.dumps(told, indent=1, allow_nan=False)
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
        if scene is not None:
            (folder / "scene.toml").write_text(scene.text, encoding="utf-8")
        page = folder / "report.html"
        surface = drawn.surface if drawn else None
        write_page(
            diagram, page, tables, told, contact=pressed, scene=scene, surface=surface,
            yscale=yscale,
        )  # fmt: skip
    return Path(directory)


def tables_of(diagram: Diagram) -> dict[str, Table]:
    """The tables of points, special points and ends; normal forms of special points take time."""
    return {
        name: (columns_of(columns, diagram), list(rows(diagram)))
        for name, columns, rows in (
            ("points", BRANCH_COLUMNS, branch_rows),
            ("special_points", SPECIAL_COLUMNS, special_rows),
            ("ends", END_COLUMNS, end_rows),
        )
    }


def columns_of(columns: tuple[str, ...], diagram: Diagram) -> tuple[str, ...]:
    """Columns with that of the parameter before the frequency, sizes with units, and friction."""
    system = diagram.branches[0].points[0].system if diagram.branches else None
    displacement, *penetrations = size_names(system, diagram.observe)
    given = {
        DISPLACEMENT: [displacement],
        PENETRATION: penetrations,
        FRICTION: friction_names(system),
    }
    named = [name for column in columns for name in given.get(column, [column])]
    at = named.index("frequency_hz")
    return (*named[:at], *dict.fromkeys((parameter_name(diagram.parameter), *named[at:])))


def branch_rows(diagram: Diagram) -> Iterable[tuple[object, ...]]:
    """Give the rows of ``branches.csv``, one for each point of each branch."""
    names = columns_of(BRANCH_COLUMNS, diagram)[2:]
    for branch in diagram.branches:
        values = np.array([node.value for node in branch.nodes])
        columns = {parameter_name(diagram.parameter): values}
        columns |= orbit_columns(branch.points, diagram.limits)
        columns["stable"] = columns["stable"].astype(int)
        rows = zip(*(columns[name].tolist() for name in names), strict=True)
        for number, row in enumerate(rows):
            yield (branch.name, number, *map(if_known, row))


def end_rows(diagram: Diagram) -> Iterable[tuple[object, ...]]:
    """Give the rows of ``ends.csv``: the last good points of each branch, and why it ends there."""
    for branch in diagram.branches:
        ends = zip(("first", "last"), branch.stop_reasons, (0, -1), strict=True)
        for name, reason, index in ends:
            orbit = branch.points[index]
            broken = reason.broken_off or reason.ending is Ending.NOT_FINISHED
            size = float(orbit.max_abs_displacement)
            where = place(diagram, branch.nodes[index])
            yield (branch.name, name, *where, size, int(broken), reason)


def place(diagram: Diagram, node: BranchNode) -> tuple[float, ...]:
    """The frequency of a point, and before it the value of another parameter that changes."""
    hz = at_known(node.orbit.frequency_hz, diagram.limits)
    return (hz,) if diagram.parameter == THE_FREQUENCY else (node.value, hz)


def coverage_rows(found: Exploration) -> Iterable[tuple[object, ...]]:
    """Give the rows of ``coverage.csv``, one for each value."""
    for c in found.coverage:
        periods = " ".join(map(str, c.periods))
        yield (c.value, periods, c.settled, c.unsettled, c.failed)


def if_known(value: object) -> object:
    """Give a value, or None (an empty cell) if it is nan or infinite."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def special_rows(diagram: Diagram) -> Iterable[tuple[object, ...]]:
    """Give the rows of ``special_points.csv``, branch by branch; the normal forms take time."""
    for branch in diagram.branches:
        for point in branch.special_points:
            orbit = point.orbit
            form = normal_form(point, branch.special_points)
            coefficient, shift = form.coefficient, form.frequency_shift
            yield (
                branch.name,
                orbit.period,
                str(point.kind),
                *place(diagram, point.point),
                float(orbit.max_abs_displacement),
                int(orbit.impacts),
                form.name,
                None if coefficient is None else if_known(coefficient.value),
                None if coefficient is None else if_known(coefficient.error),
                None if shift is None else if_known(shift.value),
                form.sentence,
            )


def write_table(path: Path, columns: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """Write a CSV file; floats keep every digit (``repr``)."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)


def summary(diagram: Diagram) -> dict[str, object]:
    """Say what was computed and how exactly, as plain numbers for ``summary.json``."""
    orbits = [orbit for branch in diagram.branches for orbit in branch.points]
    return {
        "software": software_name(),
        "points": len(orbits),
        "largest_relative_error": worst(orbit.error for orbit in orbits),
        "largest_liouville_error": worst(orbit.liouville_error for orbit in orbits),
        "stability_undecided": sum(orbit.stability.verdict == "undecided" for orbit in orbits),
        "notes": list(diagram.notes),
        "parameter": parameter_name(diagram.parameter),
        "frequency_hz": diagram.frequency_hz,
        "branches": [_branch_summary(branch, diagram) for branch in diagram.branches],
        "cascades": [_cascade_summary(cascade) for cascade in cascades_in(diagram.branches)],
    }


def software_name() -> str:
    """What computed the results, with its version."""
    return f"nldyn {software_version()}"


def _cascade_summary(cascade: Cascade) -> dict[str, object]:
    return {
        "periods": [flip.orbit.period for flip in cascade.flips],
        "flips": [float(flip.value) for flip in cascade.flips],
        "ratios": [float(ratio.value) for ratio in cascade.ratios],
    }


def _branch_summary(branch: Branch, diagram: Diagram) -> dict[str, object]:
    values = [place(diagram, node)[0] for node in branch.nodes]
    return {
        "name": branch.name,
        "period": branch.period,
        "points": len(values),
        "range": [min(values), max(values)] if values else None,
        "special_points": len(branch.special_points),
        "stop_reason": str(branch.stop_reason),
    }


def worst(values: Iterable[float]) -> float | None:
    """Give the largest of some error figures; none if there are none or one is nan or inf."""
    figures = [float(value) for value in values]
    return max(figures) if figures and all(map(math.isfinite, figures)) else None
