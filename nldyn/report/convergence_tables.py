"""Tables of a convergence study."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from nldyn.plot.words import forces_of
from nldyn.reduction.convergence import QUANTITIES, ConvergenceStudy
from nldyn.reduction.model_errors import contact_time, largest_force
from nldyn.report.offline import Table
from nldyn.report.results import if_known
from nldyn.system.chart import parameter_name

COLUMNS = (
    "label", "dofs", "modes", "size", "peak_{along}", "peak_{length}", "force_{force}", "contact_s",
    "folds", "flips", "seconds_per_orbit", "branch_seconds",
    *(f"{quantity}_error" for quantity in QUANTITIES), "missing", "extra", "note",
)  # fmt: skip
SPECIAL_COLUMNS = ("label", "modes", "type", "{along}")


def study_tables(study: ConvergenceStudy) -> dict[str, Table]:
    """The models, and their folds and flips."""
    return {
        "models": (_named(COLUMNS, study), list(model_rows(study))),
        "folds and flips": (_named(SPECIAL_COLUMNS, study), list(special_rows(study))),
    }


def _named(columns: Sequence[str], study: ConvergenceStudy) -> list[str]:
    """Columns with the name of what changes, and units."""
    length, force = (unit.lower().replace(" ", "_") for unit in study_units(study))
    along = parameter_name(study.axis.parameter)
    return [column.format(along=along, length=length, force=force) for column in columns]


def study_units(study: ConvergenceStudy) -> tuple[str, str]:
    """Units of the observed displacement and of the forces of the stops."""
    for orbit in (model.peak or model.orbit for model in study.models):
        if orbit is not None:
            return orbit.system.unit(orbit.observe), forces_of(orbit.system)[1]
    return "m", "N"


def model_rows(study: ConvergenceStudy) -> Iterator[tuple[object, ...]]:
    """Rows of ``convergence.csv``, empty where nothing is known; the reference comes last."""
    for model, error in zip(study.models, study.errors, strict=True):
        peak, orbit, special = model.peak, model.orbit, model.special_values
        row = (
            model.label,
            model.dofs,
            model.modes,
            model.size,
            study.axis.value(peak) if peak else math.nan,
            peak.max_abs_displacement if peak else math.nan,
            largest_force(orbit) if orbit else math.nan,
            contact_time(orbit) if orbit else math.nan,
            len(special["LP"]) if special else "",
            len(special["PD"]) if special else "",
            model.seconds_per_orbit,
            model.seconds,
            *(getattr(error, quantity) for quantity in QUANTITIES),
            *(error.counts or ("", "")),
            model.note,
        )
        yield tuple(map(if_known, row))


def special_rows(study: ConvergenceStudy) -> Iterator[tuple[object, ...]]:
    """Rows of ``special_points_by_model.csv``."""
    for model in study.models:
        for kind, places in (model.special_values or {}).items():
            for place in places:
                yield model.label, model.modes, kind, place
