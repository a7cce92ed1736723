"""A convergence study as one page for a browser: numbers over the modes, bands, advice, tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from nldyn.orbits.orbit import Orbit
from nldyn.plot.words import Along, axis_unit, unit_in
from nldyn.reduction.convergence import QUANTITIES, ConvergenceStudy
from nldyn.reduction.model_errors import (
    EIGENFREQUENCIES,
    Measured,
    contact_time,
    counted_modes,
    largest_force,
)
from nldyn.report.convergence_tables import study_units
from nldyn.report.offline import Table, as_table, versions
from nldyn.report.orbit_content import known

TOLERANCE = 0.01  # of the advice and of the light band
TIMES = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"))


def study_content(
    study: ConvergenceStudy, tables: Mapping[str, Table], title: str, text: str
) -> dict[str, Any]:
    """What the page of a convergence study shows, ready for JSON.

    Parameters
    ----------
    study : ConvergenceStudy
        What to show.
    tables : dict of str to (columns, rows)
        What `study_tables` gives.
    title, text : str
        Title and text of the scene.
    """
    along = along_of(study)
    return {
        "title": title or "Convergence study",
        "subtitle": f"harmonic branch over {along.range(*study.axis.limits)}; contacts at "
        f"{along.told(study.at)}",
        "along": along.label,
        "unit": along.unit,
        "advice": [line.removeprefix("advice: ") for line in study.advice(TOLERANCE)],
        "reference": study.said_of_references().splitlines(),
        "notes": study.notes(),
        "tolerance": TOLERANCE,
        "bound": known(study.reference_error) or 0.0,
        "views": views(study),
        "models": [
            {"name": f"{model.label}, {counted_modes(model)}", "special": special(model, along)}
            for model in study.models
        ],
        "panels": panels(study),
        "exact": special(study.best, along),
        "errors": {
            name: [positive(getattr(error, quantity)) for error in study.errors]
            for quantity, name in QUANTITIES.items()
        },
        "tables": {name: as_table(table) for name, table in tables.items()},
        "versions": versions(),
        "scene": text,
    }


def along_of(study: ConvergenceStudy) -> Along:
    """How the values along the branches are told."""
    system = None if study.best.orbit is None else study.best.orbit.system
    return Along.of(study.axis.parameter, study.axis.limits[1], system)


def special(model: Measured, along: Along) -> dict[str, list[float]]:
    """Values at the folds and flips of a model, in the unit that is told."""
    found = (model.special_values or {}).items()
    return {kind: [value / along.factor for value in values] for kind, values in found}


def views(study: ConvergenceStudy) -> list[dict[str, Any]]:
    """Over what the numbers are drawn: kept modes, and of several meshes their size."""

    def view(
        along: str, log: bool, x: Iterable[int], series: Mapping[str, Sequence[int]]
    ) -> dict[str, Any]:
        shown = [{"label": label, "models": list(models)} for label, models in series.items()]
        return {"along": along, "log": log, "x": list(x), "series": shown}

    found = [view("kept modes", False, (m.modes for m in study.models), study.series())]
    if by_mesh := study.mesh_series():
        found.append(view("degrees of freedom", True, (m.dofs for m in study.models), by_mesh))
    return found


def panels(study: ConvergenceStudy) -> list[dict[str, Any]]:
    """The numbers of all models, of the reference, and the span of the larger half of models."""
    contact = study.reference.orbit or study.best.orbit
    measure, force = study_units(study)
    metre, length = unit_in(
        measure, max((m.peak.max_abs_displacement for m in study.models if m.peak), default=1.0)
    )
    durations = [contact_time(m.orbit) for m in study.models if m.orbit]
    second, time = axis_unit(max(durations, default=0.0), TIMES)

    along = along_of(study)

    def duration(orbit: Orbit) -> float:
        return contact_time(orbit) / second

    def place(orbit: Orbit) -> float:
        return study.axis.value(orbit) / along.factor

    asked: list[tuple[str, str, Callable[[Measured], Sequence[float]], Sequence[float]]] = [
        ("eigenfrequencies", "Hz", eigenfrequencies, eigenfrequencies(study.reference)),
        ("peak position", along.unit or "1", of_peak(place), ()),
        ("peak height", length, of_peak(lambda orbit: orbit.max_abs_displacement / metre), ()),
        ("contact force", force, of_orbit(largest_force), of(largest_force, contact)),
        ("contact duration", time, of_orbit(duration), of(duration, contact)),
    ]
    found = []
    for name, unit, number, exact in asked:
        values = [list(number(model)) for model in study.models]
        if not any(value > 0.0 for row in values for value in row):
            continue
        span = [values[i] for i in larger_half(study)]
        found.append(
            {
                "name": name,
                "unit": unit,
                "values": values,
                "reference": list(exact or number(study.best)),
                "span": [] if name == "eigenfrequencies" else ends(span),
            }
        )
    return found


def eigenfrequencies(model: Measured) -> list[float]:
    """The lowest that an interface sees."""
    return [float(hz) for hz in model.frequencies_hz[:EIGENFREQUENCIES]]


def of(number: Callable[[Orbit], float], orbit: Orbit | None) -> list[float]:
    """A number of an orbit, if there is one; impacts on a rigid stop have no largest force."""
    found = [] if orbit is None else [float(number(orbit))]
    return [value for value in found if math.isfinite(value)]


def of_peak(number: Callable[[Orbit], float]) -> Callable[[Measured], list[float]]:
    """A number of the orbit at the top of the resonance peak."""
    return lambda model: of(number, model.peak)


def of_orbit(number: Callable[[Orbit], float]) -> Callable[[Measured], list[float]]:
    """A number of the orbit at the frequency of the study."""
    return lambda model: of(number, model.orbit)


def larger_half(study: ConvergenceStudy) -> list[int]:
    """The models like the best one that have at least half as many modes, with it."""
    best = study.best
    return [
        index
        for index, model in enumerate(study.models)
        if (model.mesh, model.method) == (best.mesh, best.method) and model.modes >= best.modes // 2
    ]


def ends(values: Iterable[Sequence[float]]) -> list[float]:
    """The least and the largest of some numbers, if there are two.

    Examples
    --------
    >>> ends([[1.0], [3.0], [2.0], []]), ends([[1.0]])
    ([1.0, 3.0], [])
    """
    given = [value for row in values for value in row]
    return [min(given), max(given)] if len(given) > 1 else []


def positive(error: float) -> float | None:
    """An error for a logarithmic axis: None where it is zero or unknown.

    Examples
    --------
    >>> positive(0.1), positive(0.0), positive(math.inf)
    (0.1, None, None)
    """
    return error if 0.0 < error < math.inf else None
