"""Tables of a convergence study."""

from __future__ import annotations

import math
from collections.abc import Iterator

from nldyn.plot.words import forces_of
from nldyn.reduction.convergence import QUANTITIES, ConvergenceStudy
from nldyn.reduction.model_errors import contact_time, largest_force
from nldyn.report.offline import Table
from nldyn.report.results import if_known

COLUMNS = (
    "label", "dofs", "modes", "size", "peak_hz", "peak_{}", "force_{}", "contact_s", "folds",
    "flips", "seconds_per_orbit", "branch_seconds",
    *(f"{quantity}_error" for quantity in QUANTITIES), "missing", "extra", "note",
)  # fmt: skip
SPECIAL_COLUMNS = ("label", "modes", "type", "frequency_hz")


def study_tables(study: ConvergenceStudy) -> dict[str, Table]:
    """The models, and their folds and flips."""
    units = [unit.lower().replace(" ", "_") for unit in study_units(study)]
    columns = [name.format(units["force" in name]) for name in COLUMNS]
    return {
        "models": (columns, list(model_rows(study))),
        "folds and flips": (SPECIAL_COLUMNS, list(special_rows(study))),
    }


def study_units(study: ConvergenceStudy) -> tuple[str, str]:
    """Units of the observed displacement and of the forces of the stops."""
    for orbit in (model.peak or model.orbit for model in study.models):
        if orbit is not None:
            return orbit.system.unit(orbit.observe), forces_of(orbit.system)[1]
    return "m", "N"


def model_rows(study: ConvergenceStudy) -> Iterator[tuple[object, ...]]:
    """Rows of ``convergence.csv``, empty where nothing is known; the reference comes last."""
    for model, error in zip(study.models, study.errors, strict=True):
        peak, orbit, special = model.peak, model.orbit, model.special_hz
        row = (
            model.label,
            model.dofs,
            model.modes,
            model.size,
            peak.frequency_hz if peak else math.nan,
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
        for kind, places in (model.special_hz or {}).items():
            for hz in places:
                yield model.label, model.modes, kind, hz
