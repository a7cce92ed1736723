"""Orbits as tables: columns of numbers with their units in their names."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import NDArray

from nldyn.base.errors import SystemModelError, check_choice
from nldyn.base.version import software_version
from nldyn.branches.branch import Branch, Part
from nldyn.orbits.orbit import Orbit

if TYPE_CHECKING:
    import pandas
    import xarray

UNITS = {
    "period": "1",
    "frequency_hz": "Hz",
    "max_abs_displacement_m": "m",
    "max_penetration_m": "m",
    "impacts": "1",
    "stable": "1",
    "largest_multiplier": "1",
    "multiplier_angle_deg": "deg",
    "relative_uncertainty": "1",
    "liouville_error": "1",
    "error": "1",
    "arclength": "1",
    "frequency_error": "1",
}


def orbit_columns(
    orbits: Sequence[Orbit], known_hz: Sequence[float] = ()
) -> dict[str, NDArray[Any]]:
    """Give what is reported of orbits as columns.

    Parameters
    ----------
    orbits : sequence of Orbit
        One for each row.
    known_hz : sequence of float
        Frequencies that orbits may meet exactly, see `at_known`.

    Returns
    -------
    dict of str to (n,) array
        Their units are in `UNITS`.
    """
    columns: dict[str, list[Any]] = {
        "period": [orbit.period for orbit in orbits],
        "frequency_hz": [at_known(orbit.frequency_hz, known_hz) for orbit in orbits],
        "max_abs_displacement_m": [orbit.max_abs_displacement for orbit in orbits],
        "max_penetration_m": [orbit.max_penetration for orbit in orbits],
        "impacts": [orbit.impacts for orbit in orbits],
        "stable": [orbit.stable for orbit in orbits],
        "largest_multiplier": [abs(orbit.largest_multiplier) for orbit in orbits],
        "multiplier_angle_deg": [
            math.degrees(cmath.phase(orbit.largest_multiplier)) for orbit in orbits
        ],
        "relative_uncertainty": [orbit.stability.uncertainty for orbit in orbits],
        "liouville_error": [orbit.liouville_error for orbit in orbits],
        "error": [orbit.error for orbit in orbits],
    }
    kinds: dict[str, type] = {"period": int, "impacts": int, "stable": bool}
    return {name: np.array(list_, dtype=kinds.get(name, float)) for name, list_ in columns.items()}


def at_known(frequency_hz: float, known_hz: Sequence[float]) -> float:
    """Give the known frequency that a frequency meets, else the frequency itself.

    Orbits keep the logarithm of their frequency, so that 90 Hz come back as 89.99999999999999.

    Examples
    --------
    >>> at_known(89.99999999999999, (5.0, 90.0)), at_known(89.999, (5.0, 90.0))
    (90.0, 89.999)
    """
    met = (known for known in known_hz if math.isclose(frequency_hz, known, rel_tol=1e-14))
    return float(next(met, frequency_hz))


def branch_table(branch: Branch, part: Part = "points") -> dict[str, NDArray[Any]]:
    """Give the columns of a part of a branch; see `Branch.table`."""
    special = branch.special_points if part == "special_points" else ()
    check_choice("table: part", part, get_args(Part))
    if part == "points":
        points = list(branch.nodes)
    elif part == "special_points":
        points = [s.point for s in special]
    else:
        points = list(branch.requested)
    course = branch.course
    known = (*course.range_hz, *course.at) if course else ()
    columns = orbit_columns([point.orbit for point in points], known)
    columns["arclength"] = np.array([point.arclength for point in points], dtype=float)
    if part == "special_points":
        columns["frequency_error"] = np.array([s.frequency_error for s in special], dtype=float)
        columns = {"type": np.array([s.kind for s in special], dtype=str), **columns}
    return columns


def to_pandas(branch: Branch, part: Part = "points") -> pandas.DataFrame:
    """Give a part of a branch as a DataFrame; see `Branch.to_pandas`."""
    try:
        import pandas
    except ImportError:
        raise SystemModelError("to_pandas needs pandas, which is not installed") from None
    frame = pandas.DataFrame(branch_table(branch, part))
    frame.index.name = "point"
    frame.attrs = {"branch": branch.name, "software": f"nldyn {software_version()}"}
    return frame


def to_xarray(branch: Branch, part: Part = "points") -> xarray.Dataset:
    """Give a part of a branch as a Dataset; see `Branch.to_xarray`."""
    try:
        import xarray
    except ImportError:
        raise SystemModelError("to_xarray needs xarray, which is not installed") from None
    columns = branch_table(branch, part)
    orbits = {
        "points": branch.points,
        "special_points": [special.orbit for special in branch.special_points],
        "requested": [point.orbit for point in branch.requested],
    }[part]
    size = branch.nodes[0].orbit.problem.size
    multipliers = np.array([orbit.multipliers for orbit in orbits]).reshape(-1, size)
    data = {
        name: ("point", column, {"units": UNITS[name]} if name in UNITS else {})
        for name, column in columns.items()
    }
    return xarray.Dataset(
        {**data, "multipliers": (("point", "multiplier"), multipliers, {"units": "1"})},
        coords={"point": np.arange(len(orbits))},
        attrs={
            "branch": branch.name,
            "stop_reasons": list(branch.stop_reasons),
            "software": f"nldyn {software_version()}",
        },
    )
